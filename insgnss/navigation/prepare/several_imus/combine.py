"""Several IMUs on one rigid body, combined into one at the position of the first.

All feel one rotation; the specific force at IMU j, at l_j from the first (body axes), differs by
the motion of the lever arm,

    f_j = f_1 + omega x (omega x l_j) + alpha x l_j,      alpha = d omega / dt                 (K.1)

Each is turned into body axes, put onto the time base of the first, freed of its lever arm and
weighted by its white noise:

    x = sum w_j x_j / sum w_j,   w_j = 1 / q_j^2                                               (K.2)

The root density of the result is 1 / sqrt(sum w_j).

Time base. What a mean rate or an increment integrates is interpolated as a running sum (cubic,
slopes from the neighbours), so nothing that was turned is lost or counted twice. Clocks may differ
by a constant time offset: found where the rates correlate best, refined by

    d = omega_j(t) - omega_1(t) = tau d omega / dt + constant + noise                          (K.3)

both smoothed over `SMOOTHED_RATES_S` (vibration is not alike), until tau does not change; it is
applied where it passes five of its standard deviations.

alpha is the slope of a least-squares line over `SLOPE_S` of that IMU's own rates (a fault of one
stays in it): a difference of two samples would have more gyro noise over a few centimetres than
the accelerometers have.

The parity of the combined samples (`parity`) shows whether one of them is faulty. It is reported,
and left in.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ....base.errors import InputError
from ....base.findings.remedies import Step
from ....records import Array, Finding, ImuSamples, Quantity, Question
from ..gaps import LEAST_GAP_INTERVALS, nominal_interval, sample_lengths
from ._kernels import interpolate, running_sum
from .parity import parity_check

MOST_LACKING = 0.1  # share of the samples
SLOPE_S = 0.02  # of the line whose slope is alpha (s): longer ones lose quick turns (chosen)
SMOOTHED_RATES_S = 0.1  # over which rates are smoothed for (K.3) (s): vibration is quicker
# that is looked for between two clocks (s): GPS against UTC is another fault (chosen)
LARGEST_CLOCK_OFFSET_S = 2.0
COARSE_S = 0.02  # step of the search (s): a fifth of the smoothing, refined by (K.3)
# of an offset that is added, and of the change that ends its refinement
APPLIED_SIGMAS, SETTLED_SIGMAS = 5.0, 0.1
LEAST_CLOCK_OFFSET_S = 2e-5  # 1 rad/s^2 makes 20 urad/s of it
LEAST_RATE_CORRELATION = 0.7  # least correlation of rates of one body
LEAST_RMS_RATE = 0.01  # rad/s, rms: less does not show the clocks
OFFSET_ITERATIONS = 6  # of (K.3) at most (chosen)


@dataclass(frozen=True, eq=False)
class CombinedImu:
    """Several IMUs as one.

    Parameters
    ----------
    samples : ImuSamples
        In body axes, at the first IMU's position and stamps.
    weight : ndarray, shape (m, 2)
        Shares of each in gyro and accelerometer, of sum 1: a process of density q_j in IMU j
        becomes sqrt(sum (weight q_j)^2).
    checks : tuple of Finding
        Of clocks, gaps and parity.
    """

    samples: ImuSamples
    weight: Array
    checks: tuple[Finding, ...]


def combine(
    imus: Sequence[ImuSamples],
    C_b_imu: Sequence[ArrayLike],
    lever_b: Sequence[ArrayLike],
    sigma: Sequence[tuple[float, float]],
) -> CombinedImu:
    """Combine two IMUs and more on one body (K.1, K.2).

    Parameters
    ----------
    imus : sequence of ImuSamples
        m recordings in their own axes, of one GPS week; mean rates and increments may be mixed,
        instantaneous rates not with them.
    C_b_imu : sequence of array, shape (3, 3)
        IMU axes to body, for each.
    lever_b : sequence of array, shape (3,), m
        From the first IMU to each, body axes; that of the first is zero.
    sigma : sequence of tuple of float
        White noise root densities of each (gyro rad/s/sqrt(Hz), accelerometer m/s^2/sqrt(Hz)).

    Returns
    -------
    CombinedImu

    Raises
    ------
    InputError
        For lists of different lengths, mixed quantities, a first lever arm that is not zero and
        recordings without overlap.
    """
    names = _check_imus(imus, C_b_imu, lever_b, sigma)
    base = imus[0]
    tracks = [
        _Track.of(imu, _body_rates(imu, np.asarray(C, dtype=np.float64)))
        for imu, C in zip(imus, C_b_imu, strict=True)
    ]
    stack = np.empty((len(imus), base.time.size, 6))
    present = np.ones(stack.shape[:2], dtype=bool)
    stack[0] = _body_rates(base, np.asarray(C_b_imu[0], dtype=np.float64))
    checks, angles = [], tracks[0].angles()
    for j in range(1, len(imus)):
        noise = max(sigma[0][0], sigma[j][0])
        offset, check = _offset(angles, tracks[j].angles(), noise, names[j])
        checks.append(check)
        stack[j], present[j] = tracks[j].over(base, offset)
        if not present[j].all():
            finding = (
                f"{names[j]} lacks {np.mean(~present[j]):.1%} of the samples; only the others are"
                " used there"
            )
            advice = (
                "the biases of the combination change with each loss; leave this IMU out, or cut "
                "the flight with start_tow and end_tow"
            )
            overlap = Question("IMU overlap", "all IMUs over the whole recording")
            checks.append(overlap.against(finding, advice, np.mean(~present[j]) >= MOST_LACKING))
    for reading, lever in zip(stack, lever_b, strict=True):
        _remove_lever(reading, base.time, np.asarray(lever, dtype=np.float64))
    sigmas = np.array(sigma, dtype=np.float64)
    checks.append(parity_check(stack, present, base.time, sigmas, imus, names))
    weight = 1.0 / np.square(sigmas)
    gyro, accel = (
        _weighted_mean(stack[:, :, axes], present, weight[:, k])
        for k, axes in enumerate((slice(0, 3), slice(3, 6)))
    )
    quantity: Quantity = "instant_rate" if base.quantity == "instant_rate" else "mean_rate"
    source = " + ".join(imu.source or "IMU" for imu in imus)
    samples = replace(
        base,
        gyro=gyro,
        accel=accel,
        quantity=quantity,
        source=source,
        temperature=None,  # each has its own
        notes=tuple(n for imu in imus for n in imu.notes),
    )
    return CombinedImu(samples, weight / weight.sum(axis=0), tuple(checks))


def _check_imus(
    imus: Sequence[ImuSamples],
    C: Sequence[ArrayLike],
    lever: Sequence[ArrayLike],
    sigma: Sequence[tuple[float, float]],
) -> tuple[str, ...]:
    """Names of the IMUs, after the refusals of `combine`."""
    m = len(imus)
    if m < 2 or not (len(C) == len(lever) == len(sigma) == m):
        raise InputError(
            f"{m} IMUs with {len(C)} sets of axes, {len(lever)} lever arms and {len(sigma)} noises;"
            " two and more, one of each"
        )
    if np.abs(np.asarray(lever[0])).max() > 0.0:
        raise InputError(
            f"lever arm {np.asarray(lever[0]).tolist()} m of the first IMU; lever arms are"
            " counted from the first IMU, so its own must be zero"
        )
    if not (np.array(sigma) > 0.0).all():
        raise InputError(
            f"noise {[tuple(s) for s in sigma]}; weights need root densities greater than zero"
        )
    instant = {imu.quantity == "instant_rate" for imu in imus}
    if len(instant) > 1:
        raise InputError(
            "instantaneous rates beside mean rates or increments; combine recordings of one kind"
        )
    if len({imu.gps_week for imu in imus} - {None}) > 1:
        raise InputError(
            f"GPS weeks {[imu.gps_week for imu in imus]} of the IMUs differ; convert all stamps"
            " to one week first"
        )
    for k, imu in enumerate(imus[1:], 2):
        if min(imu.time[-1], imus[0].time[-1]) - max(imu.time[0], imus[0].time[0]) < 1.0:
            span = f"{imu.time[0]:.3f} to {imu.time[-1]:.3f} s"
            raise InputError(
                f"{imu.source or f'IMU {k}'}: {span} does not overlap {imus[0].time[0]:.3f} to"
                f" {imus[0].time[-1]:.3f} s of the first"
            )
    return tuple(
        f"IMU {k} ({Path(imu.source).name})" if imu.source else f"IMU {k}"
        for k, imu in enumerate(imus, 1)
    )


def _body_rates(imu: ImuSamples, C_b_imu: Array) -> Array:
    """(n, 6) rates in body axes."""
    rates = np.hstack([imu.gyro @ C_b_imu.T, imu.accel @ C_b_imu.T])
    return rates / sample_lengths(imu.time)[:, None] if imu.quantity == "increments" else rates


@dataclass(frozen=True, eq=False)
class _Track:
    """Running sums of mean rates at the ends of samples, or instantaneous rates, in body axes.

    time (k,) s, value (k, 6), chord (k - 1, 6) mean slopes of value, broken (k - 1,) intervals
    without samples; instant says whether `value` is a rate.
    """

    time: Array
    value: Array
    chord: Array
    broken: NDArray[np.bool_]
    instant: bool

    @classmethod
    def of(cls, imu: ImuSamples, rates: Array) -> "_Track":
        """Track of a recording and its rates in body axes."""
        nominal = nominal_interval(imu.time)
        if imu.quantity == "instant_rate":
            step = np.diff(imu.time)
            chord = np.diff(rates, axis=0) / step[:, None]
            broken = step > LEAST_GAP_INTERVALS * nominal
            return cls(imu.time, rates, chord, broken, True)
        time = np.concatenate([[imu.time[0] - nominal], imu.time])
        value = np.empty((time.size, 6))
        running_sum(time, rates, value)
        return cls(time, value, rates, np.diff(time) > LEAST_GAP_INTERVALS * nominal, False)

    def values_at(self, instants: Array) -> Array:
        """Values (n, c), cubic interpolation at increasing instants; constant beyond the ends."""
        out = np.empty((instants.size, self.value.shape[1]))
        interpolate(self.time, self.value, self.chord, instants, out)
        return out

    def angles(self) -> "_Track":
        """Running sums of the angular rates alone, (k, 3) rad."""
        value = np.ascontiguousarray(self.value[:, :3])
        chord = np.ascontiguousarray(self.chord[:, :3])
        if self.instant:
            chord = 0.5 * (value[1:] + value[:-1])
            value = np.empty_like(value)
            running_sum(self.time, chord, value)
        return _Track(self.time, value, chord, self.broken, False)

    def over(self, base: ImuSamples, offset: float) -> tuple[Array, NDArray[np.bool_]]:
        """Rates (n, 6) over the samples of `base`, and which of them this track covers (n,).

        `offset` s is added to this track's stamps.
        """
        begin = end = base.time - offset
        rates = self.values_at(end)
        if not self.instant:
            begin = end - sample_lengths(base.time)
            rates = (rates - self.values_at(begin)) / (end - begin)[:, None]
        breaks = np.concatenate([[0], np.cumsum(self.broken)])
        slack = 1e-6
        lo = np.clip(np.searchsorted(self.time, begin + slack) - 1, 0, self.time.size - 1)
        hi = np.clip(np.searchsorted(self.time, end - slack), 0, self.time.size - 1)
        inside = (begin > self.time[0] - slack) & (end < self.time[-1] + slack)
        return rates, inside & (breaks[hi] == breaks[lo])


def _offset(first: _Track, second: _Track, noise: float, name: str) -> tuple[float, Finding]:
    """Time offset to add to the stamps of `second`, 0 where the rates show none; the check (K.3).

    first, second : running angles. noise : rad/s/sqrt(Hz), the larger of both.
    """
    ask = Question("IMU clocks", "stamps of one clock, to 1 ms")
    grid = np.arange(
        max(first.time[0], second.time[0]), min(first.time[-1], second.time[-1]), COARSE_S
    )
    a, b = _grid_rates(first, grid), _grid_rates(second, grid)
    if min(np.mean(a**2), np.mean(b**2)) < max(
        LEAST_RMS_RATE**2, 10.0 * noise**2 / SMOOTHED_RATES_S
    ):
        finding = f"{name}: the body hardly turns; the clock of the first IMU is assumed"
        return 0.0, ask.ok(finding)
    tau, alike = _coarse_offset(a, b)
    if alike < LEAST_RATE_CORRELATION:
        finding = f"{name}: rates correlate by {alike:.2f} with those of the first IMU"
        ask = replace(ask, expected=f"{LEAST_RATE_CORRELATION} and more of one body")
        advice = Step("check {imu.further}: file, axes and clock")
        return 0.0, ask.contradiction(finding, advice)
    slope, sigma = np.gradient(a, COARSE_S, axis=0), np.nan
    edge = abs(tau) + SMOOTHED_RATES_S
    inside = slice(*np.searchsorted(grid, [grid[0] + edge, grid[-1] - edge]))
    for _ in range(OFFSET_ITERATIONS):
        d, s = (a - _grid_rates(second, grid - tau))[inside], slope[inside]
        d, s = d - d.mean(axis=0), s - s.mean(axis=0)
        power = float(np.sum(s * s))
        change = -float(np.sum(s * d)) / power
        tau += change
        # neighbours within the window are one
        sigma = float(np.sqrt(np.mean(d * d) / power * SMOOTHED_RATES_S / COARSE_S))
        if abs(change) < SETTLED_SIGMAS * sigma:
            break
    applied = abs(tau) > max(APPLIED_SIGMAS * sigma, LEAST_CLOCK_OFFSET_S)
    finding = (
        f"{name}: {1e3 * tau:+.3f} +- {1e3 * sigma:.3f} ms "
        f"{'added' if applied else 'would fit, not added'} to the time stamps of this IMU"
    )
    check = ask.note(finding, when=applied and abs(tau) > 1e-3)
    return (tau if applied else 0.0), check


def _grid_rates(angles: _Track, grid: Array) -> Array:
    """(n - 1, 3) mean rates between the instants of the grid, smoothed, free of their mean."""
    rates = np.diff(angles.values_at(grid), axis=0) / COARSE_S
    reach = round(0.5 * SMOOTHED_RATES_S / COARSE_S)
    kernel = 1.0 + np.cos(np.pi * np.arange(-reach, reach + 1) / (reach + 1))
    padded = np.pad(rates - rates.mean(axis=0), ((reach, reach), (0, 0)), mode="edge")
    return np.stack(
        [np.convolve(column, kernel / kernel.sum(), mode="valid") for column in padded.T], axis=1
    )


def _coarse_offset(a: Array, b: Array) -> tuple[float, float]:
    """Offset at which rates (n, 3) on one grid correlate best, s, and the correlation there.

    It is interpolated to a fraction of `COARSE_S`.
    """
    n = len(a)
    size = 2 ** int(np.ceil(np.log2(2 * n)))
    correlation = np.fft.irfft(
        (np.fft.rfft(a, size, axis=0) * np.conj(np.fft.rfft(b, size, axis=0))).sum(axis=1), size
    )
    reach = min(int(LARGEST_CLOCK_OFFSET_S / COARSE_S), n - 2)
    lag = np.arange(-reach, reach + 1)
    value = correlation[lag] / np.sqrt(np.sum(a**2) * np.sum(b**2))
    k = int(np.clip(np.argmax(value), 1, lag.size - 2))
    left, middle, right = value[k - 1 : k + 2]
    bend = left - 2.0 * middle + right
    between = 0.5 * (left - right) / bend if bend < 0.0 else 0.0
    return float(COARSE_S * (lag[k] + between)), float(middle)


def _slope(rate: Array, time: Array) -> Array:
    """(n, 3) slope of the least-squares line through the rates within `SLOPE_S`."""
    dt = nominal_interval(time)
    reach = max(1, round(0.5 * SLOPE_S / dt))
    arms = np.arange(-reach, reach + 1, dtype=np.float64)
    kernel = -arms / (dt * np.sum(arms**2))
    padded = np.pad(rate, ((reach, reach), (0, 0)), mode="edge")
    return np.stack([np.convolve(column, kernel, mode="valid") for column in padded.T], axis=1)


def _weighted_mean(stack: Array, present: NDArray[np.bool_], weight: Array) -> Array:
    """(n, 3) weighted mean of (m, n, 3) over those that are there; the first where none is."""
    w = weight[:, None] * present
    total = w.sum(axis=0)
    mean = np.einsum("mn,mnc->nc", w, stack) / np.where(total > 0.0, total, 1.0)[:, None]
    return np.where((total > 0.0)[:, None], mean, stack[0])


def _remove_lever(reading: Array, time: Array, lever: Array) -> None:
    """Take the motion of its lever arm off the specific force of a reading (n, 6), in place (K.1).

    The motion is that of the reading's own rates.
    """
    if lever.any():
        rate = reading[:, :3]
        reading[:, 3:] -= np.cross(rate, np.cross(rate, lever)) + np.cross(
            _slope(rate, time), lever
        )
