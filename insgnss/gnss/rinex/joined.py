"""Observation files of one receiver that follow each other, joined to one: hourly files of a
station, a rover that begins a new file every hour.

The engine takes one file a receiver. The files are put in order of their first epochs; the header
is the first one's. They have to be of one version, with the same kinds of observations, the same
antenna and, where they state it, the same place within `SAME_PLACE_M`: else they are refused, since
one header would be wrong for the others. Of an epoch that two neighbours have alike (the full hour)
the reader and the engine take the first; files that overlap by more are refused.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from ...base.errors import InputError
from ...geodesy.gpstime import WEEK_S
from ...records import Finding, Question
from .header import RinexHeader, header_of, load_rinex
from .observation_record import Observations
from .observations import read_observations

SAME_PLACE_M = 100.0  # a rover's first epochs of two files; of a base its coordinates are looked at
SAME_EPOCH_S = 1e-3  # between stamps of one epoch: receivers steer clocks to a millisecond
QUOTED_CHARACTERS = 60  # of a header's value in a message of one line (chosen)


@dataclass(frozen=True)
class RinexFile:
    """Observations of one receiver, and what is to be said of them."""

    path: Path
    checks: tuple[Finding, ...] = ()


def join_observations(paths: Sequence[Path], directory: Path) -> RinexFile:
    """Join observation files of one receiver; a single one stays where it is.

    Parameters
    ----------
    paths : sequence of Path
        RINEX 2 or 3, plain or packed, in any order.
    directory : Path
        Gets the joined file; is made.

    Raises
    ------
    InputError
        Where a file cannot be read, headers differ, or files overlap.
    """
    if len(paths) == 1:
        return RinexFile(paths[0])
    files_by_time = sorted((read_observations(path) for path in paths), key=_first_stamp)
    for earlier, following in pairwise(files_by_time):
        _check_same_setting(files_by_time[0].header, following.header)
        if _first_stamp(following) < _last_stamp(earlier) - SAME_EPOCH_S:
            overlap_s = _last_stamp(earlier) - _first_stamp(following)
            message = (
                f"begins {overlap_s:.3f} s before {earlier.header.path} ends; give"
                " files that follow each other, each once"
            )
            raise InputError.in_file(following.header.path, message)
    directory.mkdir(parents=True, exist_ok=True)
    path = (
        directory / f"{Path(files_by_time[0].header.path).name} and {len(files_by_time) - 1} more"
    )
    with path.open("wb") as file:
        for k, observations in enumerate(files_by_time):
            buf, _, _ = load_rinex(observations.header.path)
            _, start = header_of(observations.header.path, buf)
            file.write(bytes(buf[0 if k == 0 else start :]))
    span = (_last_stamp(files_by_time[-1]) - _first_stamp(files_by_time[0])) / 3600.0
    gaps = [
        _first_stamp(later) - _last_stamp(earlier) for earlier, later in pairwise(files_by_time)
    ]
    station = files_by_time[0].header.marker or path.name
    finding = f"{len(files_by_time)} of {station} over {span:.2f} hours"
    check = Question("GNSS files", "files that follow each other").ok(
        f"{finding}, at most {max(gaps):g} s between them"
    )
    return RinexFile(path, (check, *(note for earlier in files_by_time for note in earlier.notes)))


def _first_stamp(observations: Observations) -> float:
    """Return the first epoch, s since 1980-01-06, GPST."""
    return float(observations.gps_week * WEEK_S + observations.time[0])


def _last_stamp(observations: Observations) -> float:
    """Return the last epoch, s since 1980-01-06, GPST."""
    return float(observations.gps_week * WEEK_S + observations.time[-1])


def _check_same_setting(first: RinexHeader, following: RinexHeader) -> None:
    """InputError where the first header would be wrong for the other file's observations."""
    pairs = {
        "the RINEX version": (first.version, following.version),
        "the kinds of observations": (first.types, following.types),
        "the antenna": (first.antenna, following.antenna),
        "the antenna's height": tuple(
            header.antenna_delta_m.tolist() for header in (first, following)
        ),
        "the time system": (first.clock, following.clock),
        "scale factors": (first.scale, following.scale),
    }
    for name, (first_value, following_value) in pairs.items():
        if first_value != following_value:
            message = (
                f"{name} is not that of {first.path}: {str(following_value)[:QUOTED_CHARACTERS]},"
                f" not {str(first_value)[:QUOTED_CHARACTERS]};"
                " only files of one receiver and setting can be joined: convert all with the same"
                " options"
            )
            raise InputError.in_file(following.path, message)
    if first.approx_position_m is None or following.approx_position_m is None:
        return
    distance = float(np.linalg.norm(first.approx_position_m - following.approx_position_m))
    if first.marker != following.marker and distance > SAME_PLACE_M:
        message = (
            f"is of {following.marker or 'another marker'}, {distance:.0f} m from {first.marker} of"
            f" {first.path}; join files of one station"
        )
        raise InputError.in_file(following.path, message)
