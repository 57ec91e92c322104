"""Checks of a static recording: is it fit to show the noise of its sensor?

It must be stationary, whole, alive, in the right units and finer than its own rounding. Blocks of a
second show that: their means and variances. A sensor at rest has noise and a bias that wanders, and
both are Gaussian, so in each channel the values

    log of the variance in a block, difference of two neighbouring means,
    difference of two neighbouring means of ten blocks                                         (S.1)

scatter about their medians like normal deviates whose sigma is 1.4826 median |deviation|. One that
is beyond eight sigma is no noise: it is a knock, a person walking by, a tilt of the table, or a
jump of the bias (a step, where only the means of ten blocks show it). Slow wander of the bias does
not trigger it, since its own differences are the scale. `stationarity` decides whether the sensor
is stationary, with limits of its own.

Rounding to a step s adds s^2/12 of white noise as long as the noise before it exceeds half a step
(Widrow and Kollar 2008, chapter 5); below that the rounding error follows the signal, and no
variance shows the sensor's noise any more.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...base.errors import DataError
from ...base.units import STANDARD_GRAVITY
from ...base.wording import some
from ...geodesy.earth import EARTH_RATE
from ...records import Array, Finding, ImuSamples, Question
from ...records.interpolation import columns_at
from ...records.variances import MAD_TO_SIGMA
from .gaps import LEAST_GAP_INTERVALS, find_gaps, in_bunches, nominal_interval
from .stationarity import (
    MAX_ACCEL,
    MAX_BIAS,
    MAX_GYRO,
    NORM_HIGH,
    NORM_LOW,
    StationaryPeriods,
    stationary_periods,
)
from .stuck_channels import CHANCE_RUNS, CHANNEL_NAMES, MOST_PROBED, STUCK_S, constant_runs

# length (s): six times `LONG_BLOCKS` blocks; a shorter one shows white noise alone (chosen)
LEAST_LENGTH_S = 60.0
STUCK_SAMPLES = 10  # of a run at slow rates, where 5 s have few samples (chosen)
MOMENT_BLOCK_S = 1.0  # length of a block (s): a knock takes about as long (chosen)
LEAST_IN_BLOCK = 20  # samples whose variance is taken: its sigma is then a third of it
LONG_BLOCKS = 10  # blocks of the means that show a step (chosen)
# robust deviations from (S.1) beyond which a block is disturbed: none is by chance
DISTURBED_SIGMAS = 8.0
# robust deviations from which on a recording should be cut, not only looked at (chosen)
STRONG_SIGMAS = 20.0
LEAST_EARTH = 0.5  # of the Earth's rate, below which the mean rate is not that of a sensor at rest
UNIT_TOLERANCE = 0.1  # of the mean force to gravity, to suggest a unit
LEAST_RISE = 0.3  # of the log of a variance: what a thermal fan does to it is not reported
# of the time that the sensor has to stand, so that its noise is that of a rest (chosen)
REST_SHARE = 0.9
FINE_STEPS = 1.5  # samples scatter by so many steps of their rounding
ROUNDED = 0.5  # below it the rounding hides the noise
RAIL_RUN = 3  # samples in a row at the extreme value that are clipped: noise does not repeat it
RAIL_SIGMAS = 6.0  # of the extreme from the mean: extremes of noise alone are nearer


@dataclass(frozen=True)
class Disturbance:
    """A disturbance of a static recording, which is no noise of the sensor.

    Parameters
    ----------
    begin_s : float, s
        From the recording's start.
    length_s : float, s
    channel : str
    kind : str
        "shaken" or "step".
    sigmas : float
        Size in robust standard deviations.
    """

    begin_s: float
    length_s: float
    channel: str
    kind: str
    sigmas: float

    def __str__(self) -> str:
        return (
            f"{self.kind} at {self.begin_s:.0f} s for {self.length_s:.0f} s ({self.channel},"
            f" {self.sigmas:.0f} sigma)"
        )


@dataclass(frozen=True, eq=False)
class StaticSpan:
    """The samples that serve, as mean rates in SI at equal intervals, with the checks.

    Parameters
    ----------
    gyro : ndarray, shape (n, 3), rad/s
    accel : ndarray, shape (n, 3), m/s^2
    rate_hz : float, Hz
    begin_s : float, s
        Begin of the span, from the recording's first sample.
    checks : tuple of Finding
    disturbances : tuple of Disturbance
        The strongest first.
    """

    gyro: Array
    accel: Array
    rate_hz: float
    begin_s: float
    checks: tuple[Finding, ...]
    disturbances: tuple[Disturbance, ...]

    @property
    def length_s(self) -> float:
        """Length of the span, s."""
        return len(self.gyro) / self.rate_hz


def static_span(
    imu: ImuSamples,
    skip_s: float = 0.0,
    keep_s: float = np.inf,
    bridge_s: float = 0.0,
    channels: Sequence[bool] = (True,) * 6,
) -> StaticSpan:
    """Find the longest unbroken span of a recording and check it.

    A check with the verdict "contradiction" makes the recording unfit.

    Parameters
    ----------
    imu : ImuSamples
    skip_s : float, s
        Time left out at the beginning.
    keep_s : float, s
        Time taken from there on.
    bridge_s : float, s
        Gaps up to this length are filled by the straight line between their ends.
    channels : sequence of bool
        Which of gyroscopes x, y, z and accelerometers x, y, z are there; others hold constants, of
        which nothing is checked.

    Returns
    -------
    StaticSpan

    Raises
    ------
    DataError
        Where nothing is left from `skip_s` on.
    """
    nominal = nominal_interval(imu.time)
    time = imu.time - imu.time[0]
    lo, hi = (int(k) for k in np.searchsorted(time, [skip_s - 1e-9, skip_s + keep_s - 1e-9]))
    if hi - lo < 2:
        raise DataError(
            f"{imu.source}: no samples from {skip_s:g} s on, as the recording is {time[-1]:.1f} s "
            "long; skip less"
        )
    first, last, whole = _longest_unbroken(time, lo, hi, nominal, bridge_s)
    cells = _places(time[first:last], nominal)
    filled = int(cells[-1]) + 1 - cells.size
    scale = 1.0 / nominal if imu.quantity == "increments" else 1.0
    gyro, accel = (
        _resample_evenly(triad[first:last], cells, filled, scale) for triad in (imu.gyro, imu.accel)
    )
    rate = float(cells[-1] / (time[last - 1] - time[first]))
    checks = [_rate(time[lo:hi], nominal), whole, _length(len(gyro) / rate)]
    named = [
        (name, column)
        for name, column, alive in zip(CHANNEL_NAMES, [*gyro.T, *accel.T], channels, strict=True)
        if alive
    ]
    checks += _channels(named, rate)
    checks.append(_units(gyro, accel, all(channels[3:])))
    checks += _earth_rate(gyro) if all(channels[:3]) else []
    disturbances: tuple[Disturbance, ...] = ()
    if all(check.verdict != "contradiction" for check in checks):
        columns = [column for _, column in named]
        disturbances, at_rest = _at_rest(gyro, accel, float(time[first]), rate, columns)
        checks.append(at_rest)
    begin_s, checks = float(time[first]), [*imu.notes, *checks]
    return StaticSpan(gyro, accel, rate, begin_s, tuple(checks), disturbances)


def _length(length_s: float) -> Finding:
    advice = "record for longer: hours, to resolve slow processes"
    return Question("length", f"{LEAST_LENGTH_S:.0f} s and more").contradiction(
        f"{length_s:.1f} s without interruption", advice, when=length_s < LEAST_LENGTH_S
    )


def _rate(time: Array, nominal: float) -> Finding:
    """Stamps that come in bunches make no rate."""
    ask = Question("sampling", "even stamps")
    finding = f"{1.0 / nominal:.6g} Hz, {time[-1] - time[0]:.1f} s, {time.size} samples"
    if bunches := in_bunches(time, nominal):
        advice = (
            "time stamps come in bunches; leave their column out and give the sampling rate "
            "(--columns, --rate)"
        )
        return ask.contradiction(f"{finding}; {bunches}", advice)
    return ask.ok(finding)


def _longest_unbroken(
    time: Array, lo: int, hi: int, nominal: float, bridge_s: float
) -> tuple[int, int, Finding]:
    """First sample, the one after the last of the longest unbroken span, and the check."""
    ask = Question("missing samples", "no interval over 1.5 nominal ones")
    gaps = find_gaps(time[lo:hi], nominal)
    if not gaps:
        return lo, hi, ask.ok("none")
    step = np.diff(time[lo:hi])
    cuts = np.flatnonzero(step > max(LEAST_GAP_INTERVALS * nominal, bridge_s + 1.001 * nominal))
    edges = np.concatenate([[0], cuts + 1, [hi - lo]])
    longest = int(np.argmax(np.diff(edges)))
    first, last = lo + int(edges[longest]), lo + int(edges[longest + 1])
    worst = max(gaps, key=lambda gap: gap[1])
    finding = f"{len(gaps)} gaps, the longest of {worst[1]:.3g} s at {worst[0]:.1f} s"
    if cuts.size:
        share = (last - first) / (hi - lo)
        finding += (
            f"; only the longest span without gaps is used, {time[first]:.1f} to"
            f" {time[last - 1]:.1f} s, {share:.0%} of the samples"
        )
    if bridge_s:
        finding += f"; gaps up to {bridge_s:g} s are filled by straight lines"
    advice = "" if bridge_s else "--bridge SECONDS fills short gaps instead"
    return first, last, ask.note(finding, advice)


def _places(time: Array, nominal: float) -> NDArray[np.int64]:
    """Number of each sample on a grid of equal intervals."""
    step = np.diff(time)
    whole = np.where(step > LEAST_GAP_INTERVALS * nominal, np.rint(step / nominal), 1.0)
    return np.concatenate([[0], np.cumsum(whole)]).astype(np.int64)


def _resample_evenly(values: Array, cells: NDArray[np.int64], filled: int, scale: float) -> Array:
    """(n, 3) on the grid, in rates."""
    if filled:
        values = columns_at(np.arange(float(cells[-1] + 1)), cells.astype(np.float64), values)
    return values if scale == 1.0 else values * scale


def _channels(named: Sequence[tuple[str, Array]], rate: float) -> list[Finding]:
    """Check for stuck channels, rails and rounding."""
    ask = Question("constant channel", f"no channel constant for over {STUCK_S:.0f} s")
    if stuck := [f"{name} {how}" for name, column in named if (how := _stuck(column, rate))]:
        advice = "the sensor is dead, the column is wrong, or the driver hides small values"
        return [ask.contradiction("; ".join(stuck), advice)]
    checks = [ask.ok("every channel alive")]
    size = max(LEAST_IN_BLOCK, round(MOMENT_BLOCK_S * rate))
    coarse = {name: n for name, column in named if (n := _rounding(column, size)) is not None}
    if coarse:
        names = ", ".join(coarse)
        steps = ", ".join(f"{n:.2g}" for n in coarse.values())
        shares = ", ".join(f"{100 / 12 / n**2:.0f}" for n in coarse.values())
        finding = (
            f"{names} scatter by {steps} steps of their resolution, {shares} % of the variance is"
            " rounding"
        )
        hidden = min(coarse.values()) < ROUNDED
        advice = "the white noise found contains the rounding"
        if hidden:
            advice = "rounding hides the noise; record with a finer resolution"
        scattering = Question("rounding", f"samples scatter by {FINE_STEPS} steps and more")
        checks.append(scattering.against(finding, advice, hidden))
    if rails := [f"{name} {how}" for name, column in named if (how := _rail(column))]:
        at_end = Question("range", "no reading at the end of the range")
        checks.append(at_end.note("; ".join(rails), "a knock, or a range too small"))
    return checks


def _stuck(column: Array, rate: float) -> str:
    """Describe how a channel is stuck; empty where it is not."""
    if column.min() == column.max():
        return f"is {column[0]:z.6g} throughout"
    probed = column[:MOST_PROBED]
    p = min(max(float(np.mean(probed[1:] == probed[:-1])), 1e-6), 0.9999)
    shortest = int(
        max(STUCK_SAMPLES, STUCK_S * rate, CHANCE_RUNS * np.log(column.size) / np.log(1.0 / p))
    )
    runs = constant_runs(column, shortest + 1)
    if not runs:
        return ""
    first, last = max(runs, key=lambda run: run[1] - run[0])
    return (
        f"stays at {column[first]:z.6g} for {(last - first + 1) / rate:.1f} s from"
        f" {first / rate:.1f} s on"
    )


def _units(gyro: Array, accel: Array, whole: bool) -> Finding:
    """Check the units against gravity and the smallness of the rate at rest.

    whole : whether the three accelerometers are there; fewer do not show gravity.
    """
    ask = Question(
        "units",
        f"|mean force| {NORM_LOW} to {NORM_HIGH} m/s^2, mean rate below"
        f" {np.degrees(MAX_BIAS):.1f} deg/s",
    )
    force, rate = float(np.linalg.norm(accel.mean(axis=0))), float(np.abs(gyro.mean(axis=0)).max())
    finding = f"|mean force| {force:.4g} m/s^2, mean rate {np.degrees(rate):.3g} deg/s"
    if whole and not NORM_LOW < force < NORM_HIGH:
        factors = {"g": STANDARD_GRAVITY, "mg": 1e-3 * STANDARD_GRAVITY}
        one = f"{STANDARD_GRAVITY / max(force, 1e-12):.4g} m/s^2"
        advice = f"if these are counts, --accel-unit {one!r}"
        for unit, factor in factors.items():
            if abs(force * factor / STANDARD_GRAVITY - 1.0) < UNIT_TOLERANCE:
                advice = f"the values look like {unit}: give --accel-unit {unit}"
        return ask.contradiction(finding, f"{advice}; gravity must be in them")
    if rate > MAX_BIAS:
        return ask.contradiction(
            finding,
            "the sensor turns, or the unit is wrong; record at rest, or give --gyro-unit (deg/s, "
            "or the value of one count)",
        )
    return ask.ok(finding)


def _earth_rate(gyro: Array) -> list[Finding]:
    """Note that the rates are too small for a sensor on the turning Earth.

    At rest the three read the Earth's rate and their biases, whose sum is so small by chance only.
    """
    mean = float(np.linalg.norm(gyro.mean(axis=0)))
    if mean >= LEAST_EARTH * EARTH_RATE:
        return []
    per_hour = 3600.0 * np.degrees([mean, EARTH_RATE, np.degrees(mean)])
    advice = (
        "nothing to do if the sensor subtracts its mean at the start; else the unit is larger, "
        f"rad/s read as deg/s (then {per_hour[2]:.3g} deg/h): give --gyro-unit"
    )
    least, earth = LEAST_EARTH * per_hour[1], per_hour[1]
    ask = Question("Earth's rate", f"{least:.3g} deg/h and more: the Earth turns by {earth:.4g}")
    return [ask.note(f"|mean rate| {per_hour[0]:.3g} deg/h", advice)]


def _rounding(column: Array, size: int) -> float | None:
    """Scatter of the samples in steps of their resolution, where that is coarse."""
    probed = column[: min(MOST_PROBED, len(column) // size * size) // size * size]
    values = np.unique(probed)
    if values.size < 2 or values.size > probed.size // 4:
        return None
    step = float(np.quantile(np.diff(values), 0.2))
    scatter = float(np.sqrt(np.median(probed.reshape(-1, size).var(axis=1))))
    return None if scatter > FINE_STEPS * step else max(scatter / step, 1e-3)


def _rail(column: Array) -> str:
    """Describe a reading at the end of the range; empty where there is none.

    That is the same extreme value, far off, several times in a row.
    """
    mean, sigma = float(column.mean()), float(column.std())
    for extreme in (column.min(), column.max()):
        if abs(extreme - mean) > RAIL_SIGMAS * sigma:
            rows = np.flatnonzero(column == extreme)
            if (
                rows.size >= RAIL_RUN
                and (rows[RAIL_RUN - 1 :] - rows[: 1 - RAIL_RUN] == RAIL_RUN - 1).any()
            ):
                return f"reads {extreme:.4g} in {rows.size} samples"
    return ""


def _at_rest(
    gyro: Array, accel: Array, begin: float, rate: float, columns: Sequence[Array]
) -> tuple[tuple[Disturbance, ...], Finding]:
    """Find the disturbances, and check that the sensor is stationary."""
    length = len(gyro) / rate
    periods = stationary_periods(ImuSamples(np.arange(len(gyro)) / rate, gyro, accel))
    share = float(np.sum(periods.time[:, 1] - periods.time[:, 0]) / length)
    ask = Question("motion", f"at rest for {REST_SHARE:.0%} of the time and more")
    if share < REST_SHARE:
        scatter = ", ".join(
            f"{x.std(axis=0).max():.2g} {unit}" for x, unit in ((gyro, "rad/s"), (accel, "m/s^2"))
        )
        in_degrees = gyro.std(axis=0).max() > MAX_GYRO and accel.std(axis=0).max() < MAX_ACCEL
        unit = ", and the rates look like deg/s: --gyro-unit deg/s" if in_degrees else ""
        advice = (
            "a moving sensor shows motion, not noise; give a recording at rest, or cut one out "
            "with --skip and --keep. If the sensor was at rest, check the units: the scatter is "
            f"{scatter}{unit}"
        )
        finding = f"at rest for {share:.0%} of the time{_longest(periods, begin)}"
        return (), ask.contradiction(finding, advice)
    disturbances = _disturbances(np.column_stack(columns), begin, rate)
    if not disturbances:
        return (), ask.ok("at rest throughout")
    how, advice = "slightly disturbed", ""
    if disturbances[0].sigmas > STRONG_SIGMAS:
        how, advice = "disturbed", "leave the recording out, or cut it with --skip and --keep"
    finding = f"{how}: {some(disturbances, 3, '; ')}"
    return disturbances, replace(ask, expected="nothing but noise").note(finding, advice)


def _longest(periods: StationaryPeriods, begin: float) -> str:
    if not len(periods):
        return ""
    lo, hi = periods.time[int(np.argmax(periods.time[:, 1] - periods.time[:, 0]))] + begin
    return f", longest from {lo:.0f} to {hi:.0f} s"


def _disturbances(x: Array, begin: float, rate: float) -> tuple[Disturbance, ...]:
    """All beyond `DISTURBED_SIGMAS` (S.1), merged where they touch."""
    size = max(LEAST_IN_BLOCK, round(MOMENT_BLOCK_S * rate))
    blocks = len(x) // size
    if blocks < 4 * LONG_BLOCKS:
        return ()
    cut = x[: blocks * size].reshape(blocks, size, -1)
    mean, power = cut.mean(axis=1), np.log(np.maximum(cut.var(axis=1), 1e-300))
    long = _moving_mean(mean, LONG_BLOCKS)
    scores = np.zeros((3, blocks, x.shape[1]))
    scores[0] = _score(power, LEAST_RISE / DISTURBED_SIGMAS)
    scores[1, 1:] = _score(np.diff(mean, axis=0), 0.0)
    half = long.shape[0] - LONG_BLOCKS
    scores[2, LONG_BLOCKS : LONG_BLOCKS + half] = _score(long[LONG_BLOCKS:] - long[:half], 0.0)
    scores[0] = np.maximum(scores[0], 0.0)
    beyond = np.flatnonzero((np.abs(scores) > DISTURBED_SIGMAS).any(axis=(0, 2)))
    if not beyond.size:
        return ()
    disturbances = []
    for run in np.split(beyond, np.flatnonzero(np.diff(beyond) > LONG_BLOCKS) + 1):
        run_scores = np.abs(scores[:, run[0] : run[-1] + 1])
        channel = int(np.argmax(run_scores.max(axis=(0, 1))))
        quick = bool(run_scores[:2].max() > DISTURBED_SIGMAS)
        lo, hi = _quick_span(run_scores[:2], run[0]) if quick else (run[0], run[-1] + 1)
        first_s, length_s = begin + lo * size / rate, (hi - lo) * size / rate
        kind, sigmas = "shaken" if quick else "step", float(run_scores.max())
        disturbances.append(Disturbance(first_s, length_s, CHANNEL_NAMES[channel], kind, sigmas))
    return tuple(sorted(disturbances, key=lambda d: -d.sigmas))


def _quick_span(scores: Array, first: int) -> tuple[int, int]:
    blocks = np.flatnonzero((scores > DISTURBED_SIGMAS).any(axis=(0, 2)))
    return first + int(blocks[0]), first + int(blocks[-1]) + 1


def _moving_mean(x: Array, width: int) -> Array:
    total = np.concatenate([np.zeros((1, x.shape[1])), np.cumsum(x, axis=0)])
    return np.asarray((total[width:] - total[:-width]) / width)


def _score(x: Array, least: float) -> Array:
    """Deviations from the median in robust sigmas, column by column."""
    deviation = x - np.median(x, axis=0)
    sigma = np.maximum(MAD_TO_SIGMA * np.median(np.abs(deviation), axis=0), least)
    return np.asarray(deviation / np.where(sigma > 0.0, sigma, np.inf))
