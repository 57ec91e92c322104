"""Exposures of RTKLIB and its kin (`*_events.pos`): the epochs of a .pos at the time marks.

RTKNAVI, RTKPOST and Emlid Studio interpolate the solution to the time marks of the rover and write
them as a .pos, GPST or UTC as its header says. Its times are the exposures; its positions are used
by nothing here. They take one mark between two epochs at most: of a mark that follows another
within the same interval they write none.
"""

import numpy as np

from ....records import CameraEvents
from ..gnss.rtklib_pos import read_pos_rows
from ..read_options import STATED_NOTHING, ReadOptions
from ..text.order import note
from ..text.text import Source
from .events import numbered_names


def read_events_pos(path: Source, options: ReadOptions = STATED_NOTHING) -> CameraEvents:
    """Read the exposures, numbered from 1; InputError with file and line."""
    rows = read_pos_rows(path, options.gps_week)
    images, numbering = numbered_names(rows.time.size)
    usual = float(np.median(np.diff(rows.time))) if rows.time.size > 1 else 0.0
    one_each = note(
        "event positions",
        f"{rows.time.size} time marks, {usual:.3g} s apart in the median; the program that wrote"
        " them keeps only the first of several marks within one epoch of the rover",
        "as many events as images",
        "if there are more images than events, use the rover's RINEX file, which has all marks",
    )
    notes = (numbering, one_each, *rows.notes)
    return CameraEvents(images, rows.time, rows.gps_week, str(path), notes)
