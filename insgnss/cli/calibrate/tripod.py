"""`insgnss calibrate tripod`: the lever arm from poses of setups and pins of a tachymeter."""

import argparse
from dataclasses import dataclass
from pathlib import Path

from ...io.options.schema import argument
from ...photogrammetry.mounting_calibration.options import TripodOptions
from ..console import Progress
from ..verb import Judged, Verb
from .mounting_options import Products, finished


@dataclass(frozen=True)
class Inputs:
    """Files of the verb."""

    poses: Path = argument(
        ...,
        "camera poses, one a setup (a table image, x, y, z, omega, phi, kappa, ..., eo.json, "
        "Metashape, COLMAP, ...)",
        cli="POSES",
    )
    pins: Path = argument(
        ...,
        "tips of the pin in the antenna's place: a table of the same names, x, y, z",
        cli="PINS",
    )


def run(options: argparse.Namespace, progress: Progress) -> Judged:
    """Do what the parsed command line asks for."""
    from ...photogrammetry.mounting_calibration.tripod_files import calibrate_tripod

    progress("calibrating")
    result = calibrate_tripod(options.poses, options.pins, options.records[TripodOptions])
    return finished(options, progress, result, options.poses, options.pins)


VERB = Verb(
    "tripod",
    "lever arm from camera to antenna: camera poses by photogrammetry and pins by tachymetry, of"
    " an aircraft on a tripod in several setups",
    "  insgnss calibrate tripod poses.csv pin.csv --photo DSC0001.jpg --out mounting.toml",
    (Inputs, TripodOptions, Products),
    run,
)
