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
from ..text.order import note
from ..text.sentences import SentenceLines, read_sentences
from ..text.text import FileLine, Source
from ..text.units import DEG
from .imu_csv import ACCEL, GYRO, Scales, imu_from_columns

N_FIELDS = 13  # numbers of a sentence, from sync to temperature
# their places in the sentence
SYNC, TIME_FIELD, GYRO_FIELDS, ACCEL_FIELDS = 0, 1, slice(6, 9), slice(9, 12)
LOCKED_SYNC = 2  # sync of a sample that was stamped by a clock locked to the receiver's pulse


def read_aimu(path: Source, options: ReadOptions = STATED_NOTHING) -> ImuSamples:
    """Read the samples of a locked clock into SI and GPST; notes count what was left out.

    Raises
    ------
    InputError
        What cannot be read, with file and line.
    """
    sentences = read_sentences(path)
    bodies, lines = sentences.bodies(b"$AIMU,")
    table = _numbers(path, bodies, lines)
    locked = table[:, SYNC] == LOCKED_SYNC
    if not locked.any():
        message = (
            f"none of {len(table)} $AIMU samples has a locked clock (sync {LOCKED_SYNC}); start"
            f" moving"
            " only after the receiver's lock"
        )
        raise InputError.in_file(path, message)
    table = table[locked]
    kept = SentenceLines(str(path), np.array(lines)[locked].tolist())
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


def _numbers(path: Source, bodies: list[bytes], lines: list[int]) -> Array:
    """Return the numbers (n, 13) of the sentences' bodies; InputError at the first wrong one."""
    from ..text import _kernels

    if not bodies:
        raise InputError.in_file(path, "holds no $AIMU sentence; is it the IMU's log?")
    buf = np.frombuffer(b"\n".join(bodies) + b"\n", dtype=np.uint8).copy()
    table, counted = np.empty((len(bodies), N_FIELDS)), np.empty(len(bodies), dtype=np.int64)
    bad = np.full((N_FIELDS, 2), -1, dtype=np.int64)
    row, status, _, _ = _kernels.parse_rows(buf, 0, 1, ord(","), ord("."), table, counted, bad)
    if (bad >= 0).any():
        row, status = int(bad[bad[:, 0] >= 0, 1].min()) - 1, _kernels.BAD_NUMBER
    if status != _kernels.OK:
        line = FileLine(path, lines[row])
        fields = bodies[row].decode("ascii", "replace").split(",")
        if len(fields) != N_FIELDS:
            problem = f"{len(fields)} fields in $AIMU, expected {N_FIELDS}"
            raise line.error(f"{problem}; is it another version of the format?")
        for field in fields:
            line.value(field)
    return table
