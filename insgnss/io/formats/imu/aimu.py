"""IMU log of tilt-RTK receivers, `$AIMU` sentences, data_specs/aimu.md.

    $AIMU,sync,time,boot,yaw,pitch,roll,gx,gy,gz,ax,ay,az,temperature*hh

Gyro deg/s, accelerometer m/s^2, axes forward right down; time is Unix time (UTC). Samples with sync
1 were stamped before the clock was locked to the receiver's pulse and are left out by rule; their
number is reported in a note. A float64 Unix time holds 0.24 microseconds, so GPST is rounded to
whole microseconds.
"""

import numpy as np

from ....base.errors import InputError
from ....records import Array, Finding, ImuSamples
from ..read_options import STATED_NOTHING, ReadOptions
from ..text.layout import TextLayout
from ..text.order import note
from ..text.sentences import SentenceLines, read_sentences
from ..text.text import FileLine, Source, parsed_rows
from ..text.units import DEG
from .imu_csv import ACCEL, GYRO, Scales, imu_from_columns

N_FIELDS = 13  # numbers of a sentence, from sync to temperature: the logger's format
# their places in the sentence
SYNC, TIME_FIELD, GYRO_FIELDS, ACCEL_FIELDS = 0, 1, slice(6, 9), slice(9, 12)
# sync of a sample stamped by a clock locked to the receiver's pulse: the logger's format
LOCKED_SYNC = 2


def read_aimu(path: Source, options: ReadOptions = STATED_NOTHING) -> ImuSamples:
    """Read the samples of a locked clock into SI and GPST; notes count what was left out.

    Raises
    ------
    InputError
        What cannot be read, with file and line.
    """
    sentences = read_sentences(path)
    rows = [(line, text[5:]) for line, text in sentences.texts() if text.startswith(b"AIMU,")]
    table = _numbers(path, rows)
    locked = table[:, SYNC] == LOCKED_SYNC
    if not locked.any():
        message = (
            f"none of {len(table)} $AIMU samples has a locked clock (sync {LOCKED_SYNC}); start"
            f" moving"
            " only after the receiver's lock"
        )
        raise InputError.in_file(path, message)
    table = table[locked]
    kept = SentenceLines(str(path), [rows[k][0] for k in np.flatnonzero(locked)])
    notes: tuple[Finding, ...] = ()
    n_free = int(locked.size - locked.sum())
    if n_free or sentences.n_bad:
        finding = (
            f"{n_free} samples before the clock was locked and {sentences.n_bad} lines without a"
            " right checksum left out"
        )
        advice = "start moving only after the receiver's lock"
        notes = (note("IMU rows", finding, "a locked clock, whole sentences", advice),)
    notes = (*sentences.notes("IMU rows"), *notes)
    columns = {"tow": table[:, TIME_FIELD]}
    columns |= dict(zip(GYRO, table[:, GYRO_FIELDS].T, strict=True))
    columns |= dict(zip(ACCEL, table[:, ACCEL_FIELDS].T, strict=True))
    return imu_from_columns(columns, kept, Scales(DEG, 1.0, "unix"), options, notes)


def _numbers(path: Source, rows: list[tuple[int, bytes]]) -> Array:
    """Return the numbers (n, 13) of sentences behind their name; InputError at a wrong one."""
    if not rows:
        raise InputError.in_file(path, "holds no $AIMU sentence; is it the IMU's log?")
    buf = np.frombuffer(b"\n".join(text for _, text in rows) + b"\n", dtype=np.uint8).copy()
    parsed = parsed_rows(buf, TextLayout(",", ".", N_FIELDS), len(rows))
    row = len(parsed.values)
    if faults := [int(line) - 1 for start, line in parsed.bad if start >= 0]:
        row = min(faults)
    elif parsed.is_whole:
        return parsed.values
    line, fields = FileLine(path, rows[row][0]), rows[row][1].decode("ascii", "replace").split(",")
    if len(fields) != N_FIELDS:
        problem = f"{len(fields)} fields in $AIMU, expected {N_FIELDS}"
        raise line.error(f"{problem}; is it another version of the format?")
    for field in fields:
        line.value(field)
    return parsed.values
