"""`insgnss calibrate materialise`: the lever arm from targets on camera and receiver."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from ...base.errors import UsageError
from ..console import Progress
from ..verb import Verb, positive
from .mounting_options import add_products, finished, pair


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument(
        "camera",
        type=Path,
        metavar="CAMERA",
        help="targets on the camera in a scaled frame: a table name, x, y, z, or a block of a "
        "photogrammetry program in which they are measured",
    )
    parser.add_argument(
        "mounted",
        type=Path,
        metavar="MOUNTED",
        help="targets on camera and receiver in one block of the aircraft before the flight, "
        "alike; any frame and unit",
    )
    parser.add_argument(
        "--receiver",
        type=Path,
        nargs="+",
        required=True,
        metavar="FILE",
        help="targets on the receiver and its phase centre by GNSS (row antenna), a table a "
        "session",
    )
    parser.add_argument(
        "--pose",
        type=Path,
        metavar="POSES",
        help="pose of an image that the camera itself took, in the frame of CAMERA (default: its)",
    )
    parser.add_argument("--image", default="", metavar="NAME", help="name of that image")
    parser.add_argument(
        "--after", type=Path, metavar="FILE", help="as MOUNTED, after the flight: did it move?"
    )
    parser.add_argument(
        "--antenna-name",
        default="antenna",
        metavar="NAME",
        help="row of the phase centre (default: antenna)",
    )
    parser.add_argument(
        "--target-sigma",
        type=positive,
        metavar="M",
        help="standard deviation of targets whose table has none (default: 0.0002)",
    )
    parser.add_argument(
        "--pose-sigma",
        type=pair,
        metavar="M,DEG",
        help="standard deviations of a pose whose file has none (default: 0.0003,0.05)",
    )
    add_products(parser)


def _resolved(paths: Sequence[Path]) -> list[Path]:
    return [path.resolve() for path in paths]


def run(options: argparse.Namespace, progress: Progress) -> int:
    """Do what the parsed command line asks for; return the exit code."""
    from ...photogrammetry.mounting_calibration.materialise_files import (
        TARGET_M,
        MaterialiseOptions,
        calibrate_materialise,
    )
    from ...photogrammetry.mounting_calibration.poses import PoseSigma

    files = [p for p in (options.mounted, *options.receiver, options.after) if p is not None]
    twice = next((p for k, p in enumerate(files) if p.resolve() in _resolved(files[:k])), None)
    if twice is not None:
        raise UsageError(
            f"calibrate materialise: {twice} is given twice; sessions are independent"
            " measurements, one file each"
        )
    more = {} if options.pose_sigma is None else {"pose_sigma": PoseSigma(*options.pose_sigma)}
    given = MaterialiseOptions(
        receiver=tuple(options.receiver),
        pose=options.pose,
        image=options.image,
        after=options.after,
        antenna_name=options.antenna_name,
        target_sigma_m=options.target_sigma or TARGET_M,
        photo=options.photo,
        date=options.date or "",
        **more,
    )
    progress("calibrating")
    result = calibrate_materialise(options.camera, options.mounted, given)
    return finished(options, progress, result, options.camera, options.mounted)


VERB = Verb(
    "materialise",
    "lever arm from camera to antenna: targets on camera and receiver stand for the centres that"
    " nobody can touch",
    "  insgnss calibrate materialise camera.csv before.csv --pose poses.csv --image s.jpg \\\n"
    "      --receiver r0.csv r90.csv r180.csv r270.csv --after landed.csv",
    add_arguments,
    run,
)
