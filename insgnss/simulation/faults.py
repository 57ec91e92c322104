"""What goes wrong between a sensor and its file.

Gaps, stuck channels, clocks, signs, vibration, and rows in disorder.

`ImuFaults` act on the samples, `RowFaults` on the rows of a written text file, which no record of
the package could hold (time that does not increase). Everything random comes from the generator
that is handed in.

Vibration of an engine is a line of slowly wandering frequency, the same in all channels but for
amplitude and phase,

    a(t) = A sin(theta(t) + phase),   theta' = 2 pi f (1 + e(t))                               (V.1)

with e a Gauss-Markov process of 2 % and 5 s. A mean rate or an increment takes the mean of (V.1)
over its interval from theta_0 to theta_1, A (cos theta_0 - cos theta_1) / (theta_1 - theta_0), an
instantaneous rate its value, which aliases in full. The true motion does not move with it, as a
housing that trembles moves by micrometres, A / (2 pi f)^2.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..base.errors import UsageError
from ..navigation.noise_model.model import AxisNoise, GaussMarkov
from ..noise.processes.realisation import simulate_noise
from ..records import Array, ImuSamples, Quantity

FAULT_CHANNELS = ("gyro x", "gyro y", "gyro z", "accel x", "accel y", "accel z")
_FREQUENCY_WANDER = GaussMarkov.from_sigma(5.0, 0.02)  # s, share of f: e of (V.1) (chosen)


def in_period(elapsed: Array, start_s: float, duration_s: float) -> NDArray[np.bool_]:
    """Tell which instants a period has, its end left out."""
    return (elapsed >= start_s) & (elapsed < start_s + duration_s)


@dataclass(frozen=True)
class Stuck:
    """A stuck channel (of `FAULT_CHANNELS`, sensor axes), which repeats `value` from `start_s` on.

    `start_s` counts from the record's start; without a `value` it is the channel's last reading.
    """

    channel: str
    start_s: float
    value: float | None = None
    duration_s: float = np.inf

    def __post_init__(self) -> None:
        if self.channel not in FAULT_CHANNELS:
            raise UsageError(
                f"stuck channel {self.channel!r} is none of {', '.join(FAULT_CHANNELS)}"
            )


@dataclass(frozen=True)
class Vibration:
    """Engine vibration (V.1) from `start_s` after the record's start for `duration_s`.

    The amplitudes are in m/s^2 and rad/s.
    """

    accel_ms2: float = 2.0
    gyro_rad_s: float = 0.02
    frequency_hz: float = 83.0
    start_s: float = 0.0
    duration_s: float = np.inf


@dataclass(frozen=True)
class ImuFaults:
    """Faults of an IMU recording; times are s after the record's start.

    Parameters
    ----------
    gaps : (start, length) without samples, s, as often as there are.
    random_gaps : number of further gaps at random.
    random_gap_s : length of the shortest and of the longest of them, s.
    stuck : stuck channels, each (channel such as "gyro x", start s, value or None for the last
        reading, duration s), of which the last two may be left out.
    vibration : of an engine, (accel m/s^2, gyro rad/s, frequency Hz, start s, duration s), of which
        the last may be left out; None: none.
    reversed_accel : whether the file holds minus the specific force.
    clock_offset_s : stamp minus GPS time, s; -18 for a clock in UTC.

    Raises
    ------
    UsageError : there is no such channel.

    Examples
    --------
    >>> import insgnss
    >>> faults = insgnss.ImuFaults(gaps=((60.0, 0.3),), stuck=(("gyro x", 90.0),))
    >>> sim = insgnss.simulate("ign8", 1.0, imu_rate_hz=100.0, start_in_air=True, imu_faults=faults)
    """

    gaps: tuple[tuple[float, float], ...] = ()
    random_gaps: int = 0
    random_gap_s: tuple[float, float] = (0.5, 0.5)
    stuck: tuple[Stuck, ...] = ()
    vibration: Vibration | None = None
    reversed_accel: bool = False
    clock_offset_s: float = 0.0

    def __post_init__(self) -> None:
        stuck = (item if isinstance(item, Stuck) else Stuck(*item) for item in self.stuck)
        object.__setattr__(self, "stuck", tuple(stuck))
        if isinstance(self.vibration, tuple):
            object.__setattr__(self, "vibration", Vibration(*self.vibration))

    def apply(self, ideal: ImuSamples, rng: np.random.Generator) -> ImuSamples:
        """Return samples as they are recorded.

        Parameters
        ----------
        ideal : samples without faults.
        rng : of the gaps and the vibration.

        Returns
        -------
        The samples with the faults.

        Raises
        ------
        UsageError : gaps leave fewer than two.
        """
        elapsed = ideal.time - ideal.time[0]
        table = np.hstack([ideal.gyro, ideal.accel])
        shaken, dropped = rng.spawn(2)
        if self.vibration is not None:
            table += _vibration_readings(self.vibration, elapsed, ideal.quantity, shaken)
        for stuck in self.stuck:
            _freeze(table[:, FAULT_CHANNELS.index(stuck.channel)], elapsed, stuck)
        if self.reversed_accel:
            table[:, 3:] *= -1.0
        keep = self._samples_outside_gaps(elapsed, dropped)
        if keep.sum() < 2:
            raise UsageError(f"IMU gaps {self.gaps} leave {keep.sum()} samples; shorten them")
        time = ideal.time[keep] + self.clock_offset_s
        return replace(ideal, time=time, gyro=table[keep, :3], accel=table[keep, 3:])

    def _samples_outside_gaps(self, elapsed: Array, rng: np.random.Generator) -> NDArray[np.bool_]:
        """Return which samples at `elapsed` (n,), s, no gap takes away."""
        keep = np.ones(elapsed.size, dtype=bool)
        length = rng.uniform(*self.random_gap_s, self.random_gaps)
        start = rng.uniform(0.0, 1.0, self.random_gaps) * (elapsed[-1] - length)
        for gap_start, gap_s in (*self.gaps, *zip(start, length, strict=True)):
            keep &= ~in_period(elapsed, gap_start, gap_s)
        return keep


def _vibration_readings(
    vibration: Vibration, elapsed: Array, quantity: Quantity, rng: np.random.Generator
) -> Array:
    """Return readings (n, 6) of the vibration (V.1) at `elapsed` (n,), s: gyro, accelerometer."""
    dt = float(np.median(np.diff(elapsed)))
    frequency_error = simulate_noise(
        AxisNoise(gauss_markov=(_FREQUENCY_WANDER,)), elapsed.size, dt, rng
    )
    step = 2.0 * np.pi * vibration.frequency_hz * (1.0 + frequency_error) * dt
    amplitude = np.repeat([vibration.gyro_rad_s, vibration.accel_ms2], 3) * rng.uniform(0.5, 1.0, 6)
    theta = np.cumsum(step)[:, None] + rng.uniform(0.0, 2.0 * np.pi, 6)
    if quantity == "instant_rate":
        readings = amplitude * np.sin(theta)
    else:
        readings = amplitude * (np.cos(theta - step[:, None]) - np.cos(theta)) / step[:, None]
    shaking = in_period(elapsed, vibration.start_s, vibration.duration_s)
    return np.where(shaking[:, None], readings * (dt if quantity == "increments" else 1.0), 0.0)


def _freeze(column: Array, elapsed: Array, stuck: Stuck) -> None:
    is_stuck = in_period(elapsed, stuck.start_s, stuck.duration_s)
    if is_stuck.any():
        column[is_stuck] = (
            column[max(int(np.argmax(is_stuck)) - 1, 0)] if stuck.value is None else stuck.value
        )


@dataclass(frozen=True)
class RowFaults:
    """Disorder of the rows of a text file, each as a share of the rows.

    Parameters
    ----------
    duplicated : rows written twice.
    reordered : rows that come one to `reach` rows later.
    delayed : rows whose stamp is up to `delay_s` s later than it should be.
    """

    duplicated: float = 0.0
    reordered: float = 0.0
    reach: int = 3
    delayed: float = 0.0
    delay_s: float = 0.02

    def __post_init__(self) -> None:
        for name in ("duplicated", "reordered", "delayed"):
            if not 0.0 <= getattr(self, name) < 1.0:
                raise UsageError(
                    f"{name} rows: the share is {getattr(self, name)}; it must lie between 0 and 1"
                )
        if self.reach < 1 or self.delay_s < 0.0:
            raise UsageError(
                f"rows moved by {self.reach} places and {self.delay_s} s late; use one place or"
                " more and no negative time"
            )

    def disturb(self, path: Path, rng: np.random.Generator) -> None:
        """Rewrite a text file whose rows begin with their time.

        Its header (`#`, or letters) stays in place.
        """
        lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
        header_lines = next(k for k, line in enumerate(lines) if line[:1].isdigit())
        rows = np.array(lines[header_lines:], dtype=object)
        delayed = np.flatnonzero(rng.random(rows.size) < self.delayed)
        for k, delay in zip(delayed, rng.uniform(0.0, self.delay_s, delayed.size), strict=True):
            rows[k] = _delayed_row(rows[k], delay)
        sort_key = np.arange(rows.size) + (rng.random(rows.size) < self.reordered) * (
            0.5 + rng.integers(1, self.reach + 1, rows.size)
        )
        order = np.argsort(sort_key, kind="stable")
        order = np.repeat(order, 1 + (rng.random(rows.size) < self.duplicated))
        path.write_text(
            "".join([*lines[:header_lines], *rows[order]]), encoding="utf-8", newline="\n"
        )


def _delayed_row(row: str, delay: float) -> str:
    """Return the row with its first field, s, later by `delay`, in as many digits."""
    width = next(k for k, c in enumerate(row) if not (c.isdigit() or c == "."))
    digits = len(row[:width].partition(".")[2])
    return f"{float(row[:width]) + delay:.{digits}f}{row[width:]}"
