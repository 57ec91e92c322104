"""The verb `targets`: ground points predicted and measured in photographs."""

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from ..base.errors import UsageError
from ..flight.config.block_file import VehicleTable
from ..flight.config.command_line import add_options, made_of
from ..io.options.schema import Triple, argument
from ..photogrammetry.target_measurement.request import Target, TargetRequest
from .console import Progress
from .verb import Judged, Result, Verb

EXAMPLE = """\
  insgnss targets predict 02_Processed/GPS-INS/eo.json gcp.csv camera.toml
  insgnss targets measure eo.json gcp.csv camera.toml photographs --crs EPSG:2056+5728 --size 0.3
  insgnss targets measure eo.json gcp.csv camera.toml photographs --signal ring --size 0.06 \\
      --bits 12 --search-px 10
  insgnss targets measure eo.json vehicle/trajectory.csv camera.toml photographs --vehicle \\
      --target-m 0.4 -0.2 -2.1 --signal disc --size 0.8
  insgnss adjust eo.json --images targets/image_points.csv --camera camera.toml \\
      --ground targets/ground_points.csv"""


@dataclass(frozen=True)
class Job:
    """What is done, and where the files go."""

    job: Literal["predict", "measure"] = argument(
        ...,
        "predict: pixel positions of ground points with error ellipses; measure: find the targets"
        " there, for adjust, Metashape, Pix4D and OpenDroneMap",
        cli="JOB",
    )
    vehicle: bool = argument(
        False,
        "the target is on a moving vehicle: GROUND is the vehicle's trajectory.csv or eo.json, or"
        " a table of target positions",
    )
    target_m: Triple | None = argument(
        None,
        "vector from the vehicle's trajectory point to the target, in the vehicle's axes, for"
        " --vehicle",
        metavar="FORWARD RIGHT DOWN",
    )
    out: Path | None = argument(
        None,
        "predict: the table; measure: directory of the products",
        usual="targets beside EO",
        metavar="PATH",
    )
    force: bool = argument(
        False, "overwrite the results of another flight, or (predict) a file without predictions"
    )


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    add_options(parser, (Job, TargetRequest, Target))


def request_of(options: argparse.Namespace) -> TargetRequest:
    """Return what the command line asks for.

    Raises
    ------
    UsageError
        Options that do not go together.
    """
    if options.job == "predict" and options.images is not None:
        raise UsageError("targets predict: takes no photographs; did you mean targets measure?")
    vehicle = None
    if options.vehicle:
        vehicle = VehicleTable(file=options.ground, target_m=options.target_m)
    elif options.target_m is not None or options.number is not None:
        raise UsageError("targets: --target-m and --number belong to --vehicle; give --vehicle too")
    target = made_of(Target, options)
    return made_of(TargetRequest, options, target=target, vehicle=vehicle)


def run(options: argparse.Namespace, progress: Progress) -> Result | Judged:
    """Do what the parsed command line asks for."""
    from ..photogrammetry.target_measurement.run import measure_targets, predict_targets

    request = request_of(options)
    if options.job == "predict":
        return predict_targets(request, options.out, progress, force=options.force)
    result = measure_targets(request, options.out, progress, force=options.force)
    return Judged(result, result.refusal, (request.ground,))


VERB = Verb("targets", EXAMPLE, add_arguments, run)
