"""The verb `targets`: ground points predicted and measured in photographs."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from ..base.errors import UsageError
from ..flight.config.block_file import VehicleTable
from .console import Progress
from .verb import Verb, positive, show_judged, show_result

if TYPE_CHECKING:
    from ..photogrammetry.target_measurement.request import Request

KINDS = ("quadrants", "disc", "cross", "ring", "picture")
# those of `photogrammetry.target_measurement.request.KINDS`, named here so that help needs no numpy
EXAMPLE = """\
  insgnss targets predict 02_Processed/GPS-INS/eo.json gcp.csv camera.toml
  insgnss targets measure eo.json gcp.csv camera.toml photographs --crs EPSG:2056+5728 --size 0.3
  insgnss targets measure eo.json gcp.csv camera.toml photographs --signal ring --size 0.06 \\
      --bits 12 --search-px 10
  insgnss targets measure eo.json vehicle/trajectory.csv camera.toml photographs --vehicle \\
      --target-m 0.4 -0.2 -2.1 --signal disc --size 0.8
  insgnss adjust eo.json --images targets/image_points.csv --camera camera.toml \\
      --ground targets/ground_points.csv"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument(
        "job",
        choices=("predict", "measure"),
        help=(
            "predict: pixels of ground points with their covariance ellipses; measure: find the"
            " targets there, for adjust, Metashape, Pix4D and OpenDroneMap"
        ),
    )
    parser.add_argument("eo", type=Path, metavar="EO", help="eo.json of a processed flight")
    parser.add_argument(
        "ground",
        type=Path,
        metavar="GROUND",
        help="ground points: a table, or a program's file; with --vehicle where the vehicle was",
    )
    parser.add_argument("camera", type=Path, metavar="CAMERA", help="camera.toml")
    parser.add_argument(
        "images",
        type=Path,
        nargs="?",
        metavar="IMAGES",
        help="of measure: directory of the photographs",
    )
    parser.add_argument(
        "--crs",
        metavar="CRS",
        help="of the ground points, such as EPSG:2056+5728 (default: the tangent plane of EO)",
    )
    parser.add_argument(
        "--geoid", type=Path, metavar="GRID", help="grid of geoid heights, for heights above it"
    )
    parser.add_argument(
        "--vehicle",
        action="store_true",
        help=(
            "the target is on a vehicle, seen where it is just then: GROUND is its trajectory.csv,"
            " its eo.json, or a table of target positions"
        ),
    )
    parser.add_argument(
        "--target-m",
        type=float,
        nargs=3,
        metavar=("FORWARD", "RIGHT", "DOWN"),
        help="of --vehicle: the target from the point of its trajectory, in the vehicle's axes",
    )
    _add_target(parser)
    parser.add_argument(
        "--search-px",
        type=float,
        default=0.0,
        metavar="PX",
        help="standard deviation added to both coordinates of a prediction (default: 0)",
    )
    parser.add_argument(
        "--whole", action="store_true", help="predict: list points that are not seen, too"
    )
    parser.add_argument(
        "--out",
        type=Path,
        metavar="PATH",
        help="predict: the table; measure: directory of the products (default: targets beside EO)",
    )
    parser.add_argument(
        "--force",
        action="store_true",
        help="overwrite the results of another flight, or (predict) a file that is no predictions",
    )


def _add_target(parser: argparse.ArgumentParser) -> None:
    """Add the options that say what the targets look like."""
    parser.add_argument(
        "--signal", choices=KINDS, default="quadrants", help="kind of target (default: quadrants)"
    )
    parser.add_argument(
        "--size",
        type=positive,
        default=0.3,
        metavar="M",
        help=(
            "side of a quadrant pattern or of the picture, diameter of a disc (of a ring: the disc"
            " in its middle), length of a cross's bars (default: 0.3)"
        ),
    )
    parser.add_argument(
        "--arm", type=positive, metavar="M", help="width of a cross's bars (default: size / 6)"
    )
    parser.add_argument(
        "--dark", action="store_true", help="disc, cross or ring are darker than their ground"
    )
    parser.add_argument(
        "--around",
        type=positive,
        metavar="N",
        help="diameter of the even ground about a disc, in its own (default: 1.6)",
    )
    parser.add_argument(
        "--bits", type=int, default=12, metavar="N", help="segments of a ring (default: 12)"
    )
    parser.add_argument(
        "--ring",
        type=positive,
        nargs=2,
        default=(2.0, 3.0),
        metavar=("INNER", "OUTER"),
        help="diameters of a ring, in diameters of its disc (default: 2 3)",
    )
    parser.add_argument(
        "--number", type=int, metavar="N", help="of --vehicle: what the ring of its target says"
    )
    parser.add_argument(
        "--picture", type=Path, metavar="FILE", help="image of a target, north up, square"
    )


def request_of(options: argparse.Namespace) -> "Request":
    """Return what the command line asks for.

    Raises
    ------
    UsageError
        Options that do not go together.
    """
    from ..photogrammetry.target_measurement.request import Request, Target

    if options.job == "predict" and options.images is not None:
        raise UsageError("targets predict: takes no photographs; did you mean targets measure?")
    target = Target(
        options.signal,
        options.size,
        options.arm,
        options.dark,
        options.around,
        options.bits,
        (options.ring[0], options.ring[1]),
        options.picture,
        options.number,
    )
    vehicle = None
    if options.vehicle:
        arm = options.target_m
        own = None if arm is None else (arm[0], arm[1], arm[2])
        vehicle = VehicleTable(file=options.ground, target_m=own)
    elif options.target_m is not None or options.number is not None:
        raise UsageError("targets: --target-m and --number belong to --vehicle; give it too")
    return Request(
        options.eo,
        options.ground,
        options.camera,
        options.images,
        options.crs,
        options.geoid,
        target,
        options.search_px,
        options.whole,
        vehicle,
    )


def run(options: argparse.Namespace, progress: Progress) -> int:
    """Do what the parsed command line asks for; return the exit code."""
    from ..photogrammetry.target_measurement.run import measure_targets, predict_targets

    request = request_of(options)
    if options.job == "predict":
        return show_result(
            options, progress, predict_targets(request, options.out, progress, force=options.force)
        )
    result = measure_targets(request, options.out, progress, force=options.force)
    return show_judged(options, progress, result, request.ground)


VERB = Verb(
    "targets",
    "find ground points in photographs: predicted with their covariance, measured to a tenth of a"
    " pixel",
    EXAMPLE,
    add_arguments,
    run,
)
