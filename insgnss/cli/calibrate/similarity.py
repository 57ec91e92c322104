"""`insgnss calibrate similarity`: the lever arm from adjusted poses and antenna positions."""

import argparse
from pathlib import Path

from ..console import Progress
from ..verb import Verb
from .mounting_options import add_common, finished, pair, places, pose_sigma


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb."""
    parser.add_argument(
        "cameras",
        type=Path,
        metavar="CAMERAS",
        help="adjusted poses in any frame: Metashape, COLMAP, OpenSfM, eo.json, a table, ...",
    )
    parser.add_argument(
        "antenna",
        type=Path,
        metavar="ANTENNA",
        help="antenna positions at exposures, by image: a table image, x, y, z or lat, lon, h, or "
        "the file of Metashape whose references they are",
    )
    parser.add_argument(
        "--antenna-sigma",
        type=pair,
        metavar="H,V",
        help="their standard deviations, m, in the place of the file's (default without: "
        "0.02,0.03)",
    )
    parser.add_argument(
        "--ground",
        type=Path,
        metavar="FILE",
        help="ground points, which are measured in images; CAMERAS itself for its markers",
    )
    parser.add_argument(
        "--points",
        type=Path,
        metavar="FILE",
        help="image observations of ground points, where CAMERAS has none",
    )
    parser.add_argument(
        "--camera",
        type=Path,
        metavar="FILE",
        help="camera.toml, where CAMERAS has no interior orientation",
    )
    add_common(parser)


def run(options: argparse.Namespace, progress: Progress) -> int:
    """Do what the parsed command line asks for; return the exit code."""
    from ...photogrammetry.mounting_calibration.similarity_files import (
        SimilarityOptions,
        calibrate_similarity,
    )

    given = SimilarityOptions(
        pose_sigma(options),
        options.antenna_sigma,
        options.ground,
        options.points,
        options.camera,
        places(options),
        options.photo,
        options.date or "",
    )
    progress("calibrating")
    result = calibrate_similarity(options.cameras, options.antenna, given)
    return finished(options, progress, result, options.cameras, options.antenna)


VERB = Verb(
    "similarity",
    "lever arm from camera to antenna: adjusted poses in any frame, antenna positions at exposures"
    " and 0 and more ground points",
    "  insgnss calibrate similarity cameras.xml antenna.csv --ground gcp.csv --crs EPSG:2056+5728\n"
    "  insgnss calibrate similarity cameras.xml cameras.xml --antenna-sigma 1,2",
    add_arguments,
    run,
)
