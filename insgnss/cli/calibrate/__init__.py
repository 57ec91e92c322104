"""The verb `calibrate`: constants of the mounting and of the IMU, one kind a word.

`CALIBRATIONS` lists the words; each is a verb of its own.
"""

import argparse
from functools import partial

from ..console import Parser
from ..verb import Verb

CALIBRATIONS = {
    "imu": "bias, scale factors and non-orthogonality of an IMU, from a recording at rest in nine"
    " or more positions",
    "tripod": "lever arm from camera to antenna, with the aircraft on a tripod in several setups:"
    " camera poses by photogrammetry, antenna marks (pins) by total station",
    "similarity": "lever arm from camera to antenna, from adjusted poses in any frame and antenna"
    " positions at the exposures; ground points are optional",
    "materialise": "lever arm from camera to antenna, from targets fixed to camera and receiver,"
    " since neither centre can be touched",
    "mounting": "lever arms, bore-sight and camera delay from one ordinary flight and the adjusted"
    " poses of its images",
}
"""What each kind of calibration does, in the order of the help."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the kinds of calibration."""
    kinds = parser.add_subparsers(metavar="WHAT", required=True, dest="what", parser_class=Parser)
    for name, clause in CALIBRATIONS.items():
        kinds.add_parser(name, help=clause, later=partial(_declare, name))


def _declare(name: str, parser: Parser) -> None:
    """Give the parser of a kind what its module declares."""
    from . import imu, mounting

    verbs = (imu.VERB, *mounting.MOUNTING_VERBS)
    verb = next(each for each in verbs if each.name == name)
    verb.declare(parser, CALIBRATIONS[name], below=True)


VERB = Verb(
    "calibrate",
    "  insgnss calibrate imu turned_by_hand.csv --latitude 46.57 --height 420\n"
    "  insgnss calibrate tripod poses.csv pin.csv --out mounting.toml\n"
    "  insgnss calibrate similarity cameras.xml antenna.csv --ground gcp.csv\n"
    "  insgnss calibrate materialise camera.csv before.csv --pose poses.csv --image s.jpg"
    " --receiver r0.csv r90.csv",
    add_arguments,
    None,  # each kind has its own
)
