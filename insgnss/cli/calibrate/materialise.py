"""`insgnss calibrate materialise`: the lever arm from targets on camera and receiver."""

import argparse
from dataclasses import dataclass
from pathlib import Path

from ...base.errors import UsageError
from ...io.options.schema import argument
from ...photogrammetry.mounting_calibration.options import MaterialiseOptions
from ..console import Progress
from ..verb import Judged, Verb
from .mounting_options import Products, finished


@dataclass(frozen=True)
class Inputs:
    """Files of the verb."""

    camera: Path = argument(
        ...,
        "targets on the camera in a scaled frame: a table name, x, y, z, or a block of a "
        "photogrammetry program in which they are measured",
        cli="CAMERA",
    )
    mounted: Path = argument(
        ...,
        "targets on camera and receiver in one block of the aircraft before the flight, alike; any"
        " frame and unit",
        cli="MOUNTED",
    )


def run(options: argparse.Namespace, progress: Progress) -> Judged:
    """Do what the parsed command line asks for."""
    from ...photogrammetry.mounting_calibration.materialise_files import calibrate_materialise

    files = [p for p in (options.mounted, *options.receiver, options.after) if p is not None]
    resolved = [path.resolve() for path in files]
    twice = next((p for k, p in enumerate(files) if resolved[k] in resolved[:k]), None)
    if twice is not None:
        raise UsageError(
            f"calibrate materialise: {twice} is given twice; sessions are independent"
            " measurements, one file each"
        )
    progress("calibrating")
    given = options.records[MaterialiseOptions]
    result = calibrate_materialise(options.camera, options.mounted, given)
    return finished(options, progress, result, options.camera, options.mounted)


VERB = Verb(
    "materialise",
    "lever arm from camera to antenna: targets on camera and receiver stand for the centres that"
    " nobody can touch",
    "  insgnss calibrate materialise camera.csv before.csv --pose poses.csv --image s.jpg \\\n"
    "      --receiver r0.csv r90.csv r180.csv r270.csv --after landed.csv",
    (Inputs, MaterialiseOptions, Products),
    run,
)
