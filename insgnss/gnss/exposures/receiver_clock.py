"""The time of camera events: from the rover's clock to GPST.

RINEX stamps an event in the time frame of the observations, the receiver's clock. RTKLIB takes that
clock's error, as it finds it from the codes, off the stamps of its positions, so that an event at
the receiver's t_r belongs to the position at

    t = t_r - c(t_r),   c(stamp of an epoch) = stamp - time of its position                    (C.1)

whether the stamps have been corrected (RCV CLOCK OFFS APPL) or not. Receivers keep c below half a
millisecond, 7 mm at 15 m/s, by steering the clock or by jumps of a millisecond. Between epochs c is
linear. A step of more than `JUMP_S` beyond the drift is a jump; it comes with the later epoch, as a
receiver makes it when it takes one, and c goes on as before until then. The codes know c to
nanoseconds. A clock that jumps back comes to the same stamps again: those of the last millisecond
before such an epoch are taken as behind it.

One converter does not hold to RINEX: RTKLIB's convbin copies the time marks of u-blox receivers
(TIM-TM2), which they give in the system time of their time pulse, and stamps their epochs by the
receiver's clock (RXM-RAWX). Files that say so in their header keep their events. That follows from
the interface description of u-blox; no recording with both has been seen.

Where epochs are missing, c is linear over the gap, or before a jump in it as at the last epoch;
outside of the positions it is that of the nearest one. Such events are reported in a check.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...geodesy.gpstime import WEEK_S
from ...records import Array, CameraEvents, Finding, GnssFixes, Question
from ..quality.solution_quality import LONG_GAP_S
from ..rinex.observation_record import Observations
from ..satellites.satellite_geometry import epochs_of

JUMP_S = 5e-5  # in a step between epochs, beyond the drift
MOST_DRIFT = 1e-5  # s/s, of a bad crystal
MARKS_IN_GPST = "format: u-blox"  # in a comment of the header


def to_gpst(events: CameraEvents, rover: Observations, fixes: GnssFixes) -> CameraEvents:
    """Bring events of the rover's file from its clock to GPST, with a note of the clock.

    Parameters
    ----------
    events : CameraEvents
        Of the rover's week, or of none.
    rover : Observations
        Observations of the file.
    fixes : GnssFixes
        The engine's positions of the same file.

    Raises
    ------
    InputError
        Where fixes and observations are of different times.
    """
    stamp, clock = clock_error(rover, fixes)
    if any(MARKS_IN_GPST in line.lower() for line in rover.header.records.get("COMMENT", ())):
        finding = f"{_span(clock)} off GPST, not subtracted from the times of the camera events"
        clock_note = Question(
            "receiver clock",
            "time marks of u-blox, which its converter writes in GPST",
        ).ok(finding)
        return replace(events, notes=(*events.notes, clock_note))
    week = rover.gps_week if events.gps_week is None else events.gps_week
    when = events.time + (week - rover.gps_week) * WEEK_S
    error, surrounded = error_at(stamp, clock, when)
    return replace(
        events,
        time=events.time - error,
        notes=(*events.notes, _clock_note(clock, when[~surrounded])),
    )


def clock_error(rover: Observations, fixes: GnssFixes) -> tuple[Array, Array]:
    """Return the error of the receiver's clock at the epochs that have a position (C.1).

    Returns
    -------
    stamp : ndarray, shape (n,)
        s of the rover's week, of these epochs.
    clock : ndarray, shape (n,)
        s, the receiver's clock minus GPST there.
    """
    week = rover.gps_week if fixes.gps_week is None else fixes.gps_week
    stamp = rover.time[epochs_of(fixes, rover)]
    return stamp, stamp - (fixes.time + (week - rover.gps_week) * WEEK_S)


def error_at(stamp: Array, clock: Array, when: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Interpolate the clock's error.

    Parameters
    ----------
    stamp, clock : ndarray, shape (n,)
        Of `clock_error`, s.
    when : ndarray, shape (k,)
        s by the receiver's clock.

    Returns
    -------
    error : ndarray, shape (k,)
        s, clock minus GPST.
    surrounded : ndarray of bool, shape (k,)
        Whether epochs less than `LONG_GAP_S` apart are before and behind.
    """
    if stamp.size == 1:
        return np.full(when.shape, clock[0]), when == stamp[0]
    step = np.diff(clock)
    length = np.diff(stamp)
    jumps = np.abs(step) > JUMP_S + MOST_DRIFT * length
    drift = np.where(jumps, 0.0, step / length)
    previous = np.maximum(np.arange(step.size) - 1, 0)
    drift = np.where(jumps, drift[previous], drift)  # a jump does not follow a jump
    k = np.clip(np.searchsorted(stamp, when, side="right") - 1, 0, step.size - 1)
    inside = (when >= stamp[0]) & (when <= stamp[-1])
    rate = np.where(jumps & (length > LONG_GAP_S), 0.0, drift)[k]
    error = np.where(when < stamp[-1], clock[k] + rate * (when - stamp[k]), clock[-1])
    return np.where(when < stamp[0], clock[0], error), inside & (length[k] <= LONG_GAP_S)


def _span(clock: Array) -> str:
    return f"{1e3 * clock.min():+.4f} to {1e3 * clock.max():+.4f} ms"


def _clock_note(clock: Array, unsure: Array) -> Finding:
    """Report the clock's error (n,), s, and how many events, at `unsure` (k,), s, lack fixes."""
    finding = f"{_span(clock)} off GPST, subtracted from the times of the camera events"
    if not unsure.size:
        return Question("receiver clock", "below 1 ms").ok(finding)
    finding += (
        f"; {unsure.size} events, the first at {unsure[0]:.3f} s, have no positions before and"
        f" behind them within {LONG_GAP_S:g} s"
    )
    return Question("receiver clock", "positions around each event").note(
        finding, "their clock error is taken from the nearest positions"
    )
