"""`insgnss calibrate mounting`: lever arms, bore-sight and camera delay of one ordinary flight."""

import argparse
from dataclasses import dataclass
from pathlib import Path

from ...io.options.schema import argument
from ...photogrammetry.mounting_calibration.options import Assumptions
from ..console import Progress
from ..verb import Judged, Verb
from .mounting_options import Products, finished


@dataclass(frozen=True)
class Inputs:
    """Files of the verb."""

    flight: Path = argument(
        ..., "the flight file, or the directory that holds flight.toml", cli="FLIGHT"
    )
    poses: Path = argument(
        ...,
        "adjusted poses of its images in any frame: Metashape, COLMAP, OpenSfM, MicMac, eo.json,"
        " poses.csv, ...",
        cli="POSES",
    )


def run(options: argparse.Namespace, progress: Progress) -> Judged:
    """Do what the parsed command line asks for."""
    from ...flight.config.load import load_flight
    from ...photogrammetry.mounting_calibration.equations import Assumptions
    from ...photogrammetry.mounting_calibration.flight_products import calibrated
    from ...photogrammetry.mounting_calibration.in_flight import calibrate_mounting

    flight = load_flight(options.flight)
    result = calibrate_mounting(flight, options.poses, options.records[Assumptions], progress)
    made = calibrated(result, flight, options.photo, options.date)
    return finished(options, progress, made, flight.path, options.poses)


VERB = Verb(
    "mounting",
    "lever arms, bore-sight and camera delay from one ordinary flight and the adjusted poses of its"
    " images",
    "  insgnss calibrate mounting ign8/flight.toml cameras.xml\n"
    "  insgnss calibrate mounting ign8 ign8/02_Processed/Adjustment/poses.csv --frame shift"
    " --shift-sigma 0.01",
    (Inputs, Assumptions, Products),
    run,
)
