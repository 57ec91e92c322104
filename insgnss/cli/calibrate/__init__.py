"""The verb `calibrate`: constants of the mounting and of the IMU, one kind a word.

`CALIBRATIONS` lists the words; each is a verb of its own.
"""

import argparse

from ..console import Parser
from ..verb import Verb
from . import imu, mounting

CALIBRATIONS: tuple[Verb, ...] = (imu.VERB, *mounting.MOUNTING_VERBS)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the kinds of calibration."""
    kinds = parser.add_subparsers(metavar="WHAT", required=True, dest="what", parser_class=Parser)
    for kind in CALIBRATIONS:
        kind.add_to(kinds, below=True)


VERB = Verb(
    "calibrate",
    "estimate constants of the mounting (lever arm, each component with a verdict) and of the IMU",
    "  insgnss calibrate imu turned_by_hand.csv --latitude 46.57 --height 420\n"
    "  insgnss calibrate tripod poses.csv pin.csv --out mounting.toml\n"
    "  insgnss calibrate similarity cameras.xml antenna.csv --ground gcp.csv\n"
    "  insgnss calibrate materialise camera.csv before.csv --pose poses.csv --image s.jpg"
    " --receiver r0.csv r90.csv",
    add_arguments,
    None,  # each kind has its own
)
