"""`insgnss calibrate mounting`: lever arms, bore-sight and camera delay of one ordinary flight."""

import argparse
import math
from pathlib import Path

from ...base.errors import UsageError
from ..console import Progress
from ..verb import Verb
from .mounting_options import add_products, finished, pair


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument(
        "flight",
        type=Path,
        metavar="FLIGHT",
        help="the flight file, or the directory that holds flight.toml",
    )
    parser.add_argument(
        "poses",
        type=Path,
        metavar="POSES",
        help="adjusted poses of its images in any frame: Metashape, COLMAP, OpenSfM, MicMac,"
        " eo.json, poses.csv, ...",
    )
    parser.add_argument(
        "--frame",
        choices=("auto", "similarity", "shift"),
        default="auto",
        help="how the block's coordinates lie to the flight's: by a similarity; by a shift alone"
        " (ground control in their coordinates); auto: a similarity, and coordinates of another"
        " scale are refused (default: auto)",
    )
    parser.add_argument(
        "--shift-sigma",
        type=_length,
        metavar="M",
        help="standard deviation of a shift between ground control and fixes (default: not known)",
    )
    parser.add_argument(
        "--lever-arm-sigma",
        type=_length,
        default=0.3,
        metavar="M",
        help="of the antenna's lever arm from the IMU, as the flight file has it (default: 0.3)",
    )
    parser.add_argument(
        "--imu-sigma",
        type=_length,
        default=0.3,
        metavar="M",
        help="of the IMU's lever arm from the camera, as the flight file has it (default: 0.3)",
    )
    parser.add_argument(
        "--pose-sigma",
        type=pair,
        default=(0.03, 0.01),
        metavar="M,DEG",
        help="what the block's camera calibration moves poses by, all alike in camera axes, where"
        " they have no covariances (default: 0.03,0.01)",
    )
    add_products(parser)


def _length(text: str) -> float:
    """Return a standard deviation, m."""
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not 1e-4 <= value <= 10.0:
        raise argparse.ArgumentTypeError(f"{text!r}: m, between 0.0001 and 10")
    return value


def run(options: argparse.Namespace, progress: Progress) -> int:
    """Do what the parsed command line asks for; return the exit code."""
    from ...flight.config.load import load_flight
    from ...photogrammetry.mounting_calibration.equations import Assumptions
    from ...photogrammetry.mounting_calibration.flight_products import calibrated
    from ...photogrammetry.mounting_calibration.in_flight import calibrate_mounting

    if options.frame == "similarity" and options.shift_sigma is not None:
        raise UsageError(
            "calibrate mounting: --shift-sigma is of coordinates of ground control; leave --frame"
            " similarity out, or it"
        )
    flight = load_flight(options.flight)
    assumptions = Assumptions(
        options.shift_sigma,
        options.imu_sigma,
        options.lever_arm_sigma,
        options.frame,
        options.pose_sigma[0],
        math.radians(options.pose_sigma[1]),
    )
    result = calibrate_mounting(flight, options.poses, assumptions, progress)
    made = calibrated(result, flight, options.photo, options.date)
    return finished(options, progress, made, flight.path, options.poses)


VERB = Verb(
    "mounting",
    "lever arms, bore-sight and camera delay from one ordinary flight and the adjusted poses of its"
    " images",
    "  insgnss calibrate mounting ign8/flight.toml cameras.xml\n"
    "  insgnss calibrate mounting ign8 ign8/02_Processed/Adjustment/poses.csv --frame shift"
    " --shift-sigma 0.01",
    add_arguments,
    run,
)
