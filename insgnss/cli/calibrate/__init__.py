"""The verb `calibrate`: constants of the mounting and of the IMU, one kind a word.

`KINDS` lists the words; each is a verb of its own in the module of its name beside this one.
"""

import argparse
import warnings
from pathlib import Path
from typing import Any

from ...base.errors import UsageError
from ..console import Parser
from ..verb import Verb
from . import imu, materialise, mounting, similarity, tripod

KINDS: tuple[Verb, ...] = (imu.VERB, tripod.VERB, similarity.VERB, materialise.VERB, mounting.VERB)
NAMES = tuple(kind.name for kind in KINDS)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the kinds of calibration."""
    if isinstance(parser, Parser):
        parser.rearranged = _with_kind
    kinds = parser.add_subparsers(metavar="WHAT", required=True, dest="what", parser_class=Parser)
    for kind in KINDS:
        kind.add_to(kinds, below=True)


def _with_kind(parse: Any, words: Any, namespace: Any) -> Any:
    """Parse the words, which before there were kinds named the recording of an IMU at once."""
    words = list(words)
    values = [word for word in words if not word.startswith("-")]
    first = values[0] if values else ""
    if first and not set(NAMES) & set(values) and "." not in first and not Path(first).exists():
        raise UsageError(f"calibrate: {first!r} is none of {', '.join(NAMES)}, and no file")
    if values and not set(NAMES) & set(values) and not {"-h", "--help"} & set(words):
        warnings.warn(
            "insgnss calibrate IMU_FILE is called insgnss calibrate imu IMU_FILE now; the next"
            " release will refuse the old form",
            FutureWarning,
            stacklevel=2,
        )
        words = ["imu", *words]
    return parse(words, namespace)


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
