"""`insgnss calibrate tripod`: the lever arm from poses of setups and pins of a tachymeter."""

import argparse
from pathlib import Path

from ..console import Progress
from ..verb import Verb, positive
from .mounting_options import add_common, finished, places, pose_sigma


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument(
        "poses",
        type=Path,
        metavar="POSES",
        help="camera poses, one a setup (a table image, x, y, z, omega, phi, kappa, ..., eo.json, "
        "Metashape, COLMAP, ...)",
    )
    parser.add_argument(
        "pins",
        type=Path,
        metavar="PINS",
        help="tips of the pin in the antenna's place: a table of the same names, x, y, z",
    )
    parser.add_argument(
        "--pin-sigma",
        type=positive,
        metavar="M",
        help="standard deviation of pins whose table has none (default: 0.001)",
    )
    add_common(parser)


def run(options: argparse.Namespace, progress: Progress) -> int:
    """Do what the parsed command line asks for; return the exit code."""
    from ...photogrammetry.mounting_calibration.tripod_files import (
        PIN_M,
        TripodOptions,
        calibrate_tripod,
    )

    given = TripodOptions(
        pose_sigma(options),
        options.pin_sigma or PIN_M,
        places(options),
        options.photo,
        options.date or "",
    )
    progress("calibrating")
    result = calibrate_tripod(options.poses, options.pins, given)
    return finished(options, progress, result, options.poses, options.pins)


VERB = Verb(
    "tripod",
    "lever arm from camera to antenna: camera poses by photogrammetry and pins by tachymetry, of"
    " an aircraft on a tripod in several setups",
    "  insgnss calibrate tripod poses.csv pin.csv --photo DSC0001.jpg --out mounting.toml",
    add_arguments,
    run,
)
