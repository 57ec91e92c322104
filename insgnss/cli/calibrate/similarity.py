"""`insgnss calibrate similarity`: the lever arm from adjusted poses and antenna positions."""

import argparse
from dataclasses import dataclass
from pathlib import Path

from ...io.options.schema import argument
from ...photogrammetry.mounting_calibration.options import SimilarityOptions
from ..console import Progress
from ..verb import Judged, Verb
from .mounting_options import Products, finished


@dataclass(frozen=True)
class Inputs:
    """Files of the verb."""

    cameras: Path = argument(
        ...,
        "adjusted poses in any frame: Metashape, COLMAP, OpenSfM, eo.json, a table, ...",
        cli="CAMERAS",
    )
    antenna: Path = argument(
        ...,
        "antenna positions at exposures, by image: a table image, x, y, z or lat, lon, h, or the "
        "file of Metashape whose references they are",
        cli="ANTENNA",
    )


def run(options: argparse.Namespace, progress: Progress) -> Judged:
    """Do what the parsed command line asks for."""
    from ...photogrammetry.mounting_calibration.similarity_files import calibrate_similarity

    progress("calibrating")
    given = options.records[SimilarityOptions]
    result = calibrate_similarity(options.cameras, options.antenna, given)
    return finished(options, progress, result, options.cameras, options.antenna)


VERB = Verb(
    "similarity",
    "lever arm from camera to antenna: adjusted poses in any frame, antenna positions at exposures"
    " and 0 and more ground points",
    "  insgnss calibrate similarity cameras.xml antenna.csv --ground gcp.csv --crs EPSG:2056+5728\n"
    "  insgnss calibrate similarity cameras.xml cameras.xml --antenna-sigma 1,2",
    (Inputs, SimilarityOptions, Products),
    run,
)
