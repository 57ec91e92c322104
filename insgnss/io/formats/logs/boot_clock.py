"""From an autopilot's boot clock to GPST, by the stamps of its GNSS receiver's messages.

A fix is taken at GPST g and its message comes in at b on the autopilot's clock, a latency l >= 0
later: b = (g + l - o) (1 + d) with the offset o and the drift d of the autopilot's crystal. A
straight line through g - b over b, robust against late messages (medians of the slopes and then of
the offsets, Theil 1950, Sen 1968), gives o - mean l: what is left over is the receiver's mean
latency, by which samples and exposures come out early against the fixes. `insgnss inspect` finds it
from the motion.
"""

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from ....base.errors import InputError
from ....geodesy.gpstime import WEEK_S
from ....records import Array, Finding
from ..text.order import Lines, note, refuse_rows

MOST_MESSAGES = 200  # messages that the slope is taken from
LEAST_DRIFT_SPAN_S = 60.0  # below it the clock's drift is taken for zero
CRYSTAL_DRIFT = 500e-6  # s/s; a crystal is ten times better, a steeper clock is searched for steps
WINDOW_MESSAGES = 20  # on each side of a step: their medians average the latency's scatter out
STEP_LIMIT_S = 0.2  # of a steep clock: a latency changes by less, a clock that was set by more
LONGEST_LOG_S = 1e8  # of a log
# median residual (s) about the line: latencies of messages are tenths (chosen)
SPREAD_LIMIT_S = 1.0


@dataclass(frozen=True)
class BootClock:
    """GPST = boot + offset_s + drift (boot - at_s), in seconds of `gps_week`.

    `spread_s` is the median absolute distance of the messages. Without any, the stamps stay those
    of the autopilot since power-up.
    """

    gps_week: int | None
    offset_s: float = 0.0
    drift: float = 0.0
    at_s: float = 0.0
    spread_s: float = 0.0
    messages: int = 0

    def gpst(self, lines: Lines, boot_s: Array) -> Array:
        """Return seconds of the week of stamps (n,) of the autopilot, s, to the microsecond.

        Raises
        ------
        InputError
            The first stamp that cannot be one.
        """
        message = f"stamp {{:g}} s of the autopilot; it must be between 0 and {LONGEST_LOG_S:g} s"
        refuse_rows(lines, ~((boot_s >= 0.0) & (boot_s < LONGEST_LOG_S)), message, boot_s)
        return np.round(boot_s + self.offset_s + self.drift * (boot_s - self.at_s), 6)

    def note(self, name: str) -> Finding:
        """Return the note on the clock, for the record `name`."""
        if not self.messages:
            finding = "no GNSS fix in the log: its stamps count from the start of the autopilot"
            return note(name, finding, "GPST", "gnss.time_offset_s relates fixes of a file to them")
        finding = (
            f"{self.messages} messages relate its clock to GPST: drift {1e6 * self.drift:+.0f}"
            f" ppm, spread {1e3 * self.spread_s:.0f} ms"
        )
        advice = "the times still contain the receiver's mean latency; time_offset_s removes it"
        return note(name, finding, "one clock", advice)


def fit_clock(path: object, boot_s: Array, week: Array, tow: Array) -> BootClock:
    """Fit the clock to stamps of messages of fixes.

    Parameters
    ----------
    path
        The log, for messages.
    boot_s : ndarray
        (n,) stamps of the autopilot, s.
    week, tow : ndarray
        (n,) GPS week and time of week, s, of their fixes.

    Returns
    -------
    BootClock
        The clock.

    Raises
    ------
    InputError
        Stamps that do not follow a clock.
    """
    if boot_s.size == 0:
        raise InputError(
            f"{path}: no GNSS fix with a GPS time, so the autopilot's clock has no relation to"
            " GPS time; give IMU, positions and events as tables with stamps of one clock"
        )
    first = int(week[0])
    difference = (week - first) * WEEK_S + tow - boot_s
    reference_s = float(np.median(boot_s))
    drift = 0.0
    pick = np.unique(np.linspace(0, boot_s.size - 1, MOST_MESSAGES).astype(np.int64))
    i, k = np.triu_indices(pick.size, 1)
    spacing = boot_s[pick[k]] - boot_s[pick[i]]
    if (far := spacing > LEAST_DRIFT_SPAN_S).any():
        drift = float(np.median((difference[pick[k]] - difference[pick[i]])[far] / spacing[far]))
    residual = difference - drift * (boot_s - reference_s)
    offset = float(np.median(residual))
    spread = float(np.median(np.abs(residual - offset)))
    step, after = _largest_step(residual) if abs(drift) > CRYSTAL_DRIFT else (0.0, 0)
    if spread > SPREAD_LIMIT_S or step > STEP_LIMIT_S:
        message = (
            f"GPS times of {boot_s.size} messages do not follow the autopilot's clock: spread"
            f" {spread:.3f} s about a drift of {1e6 * drift:+.0f} ppm (limit {SPREAD_LIMIT_S:.0f}"
            f" s), step {step:.3f} s at stamp {boot_s[after]:.1f} s (limit {STEP_LIMIT_S:g} s)"
        )
        raise InputError(f"{path}: {message}; split the log where the clock was set")
    over = int((offset + boot_s[0]) // WEEK_S)
    return BootClock(first + over, offset - over * WEEK_S, drift, reference_s, spread, boot_s.size)


def _largest_step(residual: Array) -> tuple[float, int]:
    """Return the largest step of residuals (n,), s, and the message after it.

    It is that of the medians of the messages before and after, so single late ones make none.
    """
    width = min(WINDOW_MESSAGES, residual.size // 2)
    if width == 0:
        return 0.0, 0
    median = np.median(sliding_window_view(residual, width), axis=1)
    steps = np.abs(median[width:] - median[:-width])
    return float(steps.max()), int(steps.argmax()) + width
