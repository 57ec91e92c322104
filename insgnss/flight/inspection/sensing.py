"""What an IMU shows of itself: stationary periods, white noise, gravity, Earth rate, class.

White noise of root density q (X/sqrt(Hz)) in samples x of interval dt has the Allan variance q^2 /
tau. At rest q is the least of sigma_A(tau) sqrt(tau) over tau from 0.5 s on: at shorter ones
rounding and the sway of the support lie above it, at longer ones the drift of the bias. In motion
the sensor's own noise, the vibration of the vehicle and what the sampling folds down look alike to
the filter; the third difference of neighbouring samples takes the smooth motion away and leaves 20
variances of what is independent from sample to sample:

    q^2 = mean(d3^2) / 20 dt                                                                   (S.1)

A gyro that sees the Earth: the mean rate at rest has the size 7.292e-5 rad/s within a tenth, and
its own standard error q / sqrt(T) is below a tenth of that.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ...base.units import DEG_PER_H, MILLI_G, STANDARD_GRAVITY, round_in_unit
from ...geodesy.earth import EARTH_RATE
from ...navigation.noise_model.model import (
    AxisNoise,
    GaussMarkov,
    NoiseModel,
    load_noise_model,
    shipped_models,
)
from ...navigation.noise_model.noise_model import DRAFT_SOURCE, NOISE_UNITS
from ...navigation.prepare.gaps import nominal_interval
from ...navigation.prepare.stationarity import StationaryPeriods, stationary_periods
from ...records import Array, GnssFixes, ImuSamples

# shortest averaging time of the Allan deviation at rest, and pieces that show it to 7 % (chosen)
REST_TAU_S, LEAST_PIECES = 0.5, 100
QUIETEST_S = 10.0  # length of the blocks of which the quietest show a sensor's noise (chosen)
# share of the differences, and of the variance of normal ones that it holds
KEPT_DIFFERENCES, VARIANCE_KEPT = 0.95, 0.7588
EARTH_SHARE = 0.1  # of the Earth's rate, to which a gyro must show it for its heading
STATIC_SHARE = 0.1  # of a recording in motion that makes it no static one
DEG_S = np.pi / 180.0  # rad/s
Grade = Literal["consumer", "tactical", "navigation"]

# a-priori by class where the recording does not show it: turn-on bias, Gauss-Markov sigma (gyro
# rad/s, accelerometer m/s^2), its time, s
_CLASSES: dict[Grade, tuple[float, float, float, float, float]] = {
    "consumer": (1.0 * DEG_S, 50.0 * MILLI_G, 0.02 * DEG_S, 3.0 * MILLI_G, 200.0),
    "tactical": (20.0 * DEG_PER_H, 5.0 * MILLI_G, 2.0 * DEG_PER_H, 0.2 * MILLI_G, 300.0),
    "navigation": (0.05 * DEG_PER_H, 0.2 * MILLI_G, 0.01 * DEG_PER_H, 0.02 * MILLI_G, 3600.0),
}
# a-priori sigma of scale factors, and of misalignments in rad: tolerances of data sheets, 3 % and
# 2 % at most without a calibration of the single sensor; of a navigation sensor they do not count
_GRADE_LIMITS: dict[Grade, tuple[float, float] | None] = {
    "consumer": (0.01, 0.008),
    "tactical": (1e-3, 1e-3),
    "navigation": None,
}
# of a tactical gyro at most: white noise, rad/s/sqrt(Hz), and bias, rad/s (data sheets)
TACTICAL_WHITE, TACTICAL_BIAS = 2e-3 * DEG_S, 30.0 * DEG_PER_H
SHOWN_SIGMAS = 3.0  # of the turn-on bias of a shipped model, within which the mean at rest may lie
FITS = (0.5, 1.6)  # measured white noise over a shipped model's, each of the two sensors


@dataclass(frozen=True, eq=False)
class Sensing:
    """What an IMU shows of itself. X is rad/s for gyros, m/s^2 for accelerometers.

    Parameters
    ----------
    rate_hz : float, Hz
    length_s : float, s
    stationary : StationaryPeriods
    rest_s : float, s
        Total length of the stationary periods.
    mean_gyro, mean_accel : ndarray, shape (3,), X
        Means over them; NaN without any.
    rest_gyro, rest_accel : ndarray, shape (3,), X/sqrt(Hz)
        Root densities at rest, or where the recording is quietest.
    moving_gyro, moving_accel : ndarray, shape (3,), X/sqrt(Hz)
        Root densities in motion.
    """

    rate_hz: float
    length_s: float
    stationary: StationaryPeriods
    rest_s: float
    mean_gyro: Array
    mean_accel: Array
    rest_gyro: Array
    rest_accel: Array
    moving_gyro: Array
    moving_accel: Array

    @property
    def is_static(self) -> bool:
        """Whether all but a tenth of the recording is stationary."""
        return self.rest_s > (1.0 - STATIC_SHARE) * self.length_s

    @property
    def gravity(self) -> float:
        """|f| at rest, m/s^2; NaN without a stationary period."""
        return float(np.linalg.norm(self.mean_accel))

    @property
    def sees_earth(self) -> bool:
        """Whether the mean rate at rest is that of the Earth."""
        if not self.rest_s > 30.0:
            return False
        error = float(np.linalg.norm(self.rest_gyro)) / np.sqrt(self.rest_s)
        difference = abs(float(np.linalg.norm(self.mean_gyro)) - EARTH_RATE)
        return bool(difference < EARTH_SHARE * EARTH_RATE and error < EARTH_SHARE * EARTH_RATE)

    @property
    def grade(self) -> Grade:
        """Class that the sensor seems to be of."""
        if self.sees_earth:
            return "navigation"
        # zero: the device rounds rest away
        quiet = 0.0 < float(self.rest_gyro.max()) < TACTICAL_WHITE
        small = self.rest_s > 0.0 and float(np.abs(self.mean_gyro).max()) < TACTICAL_BIAS
        return "tactical" if quiet and small else "consumer"


def sense(imu: ImuSamples, gnss: GnssFixes | None = None) -> Sensing:
    """Measure what the samples, in SI, show; the fixes confirm stationary periods."""
    dt = nominal_interval(imu.time)
    scale = 1.0 / dt if imu.quantity == "increments" else 1.0
    values = np.column_stack([imu.gyro, imu.accel]) * scale
    periods = stationary_periods(imu, gnss)
    stationary_s = float(np.sum(periods.time[:, 1] - periods.time[:, 0])) if len(periods) else 0.0
    if len(periods):
        mean = [
            np.average(m, axis=0, weights=periods.samples)
            for m in (periods.gyro_mean, periods.accel_mean)
        ]
    else:
        mean = [np.full(3, np.nan), np.full(3, np.nan)]
    quiet = _rest_noise(imu.time, values, periods, dt)
    moving = np.maximum(quiet, _moving_noise(imu.time, values, periods, dt))
    length = float(imu.time[-1] - imu.time[0])
    return Sensing(
        1.0 / dt,
        length,
        periods,
        stationary_s,
        mean[0],
        mean[1],
        quiet[:3],
        quiet[3:],
        moving[:3],
        moving[3:],
    )


def _rest_noise(time: Array, values: Array, periods: StationaryPeriods, dt: float) -> Array:
    """Root density (6,) over the longest stationary period.

    Without one it is that of the quietest ten seconds by single samples (S.1).
    """
    if len(periods):
        longest = int(np.argmax(periods.time[:, 1] - periods.time[:, 0]))
        lo, hi = np.searchsorted(time, periods.time[longest])
        if (hi - lo) * dt > 4.0 * REST_TAU_S:
            spans = [
                m
                for k in range(12)
                if (m := max(1, round(REST_TAU_S * 2**k / dt))) * LEAST_PIECES <= hi - lo
            ]
            return np.min(
                [_allan(values[lo:hi], m, dt) for m in spans or [max(1, round(REST_TAU_S / dt))]],
                axis=0,
            )
    return _third_differences(time, values, dt, lambda blocks: np.min(blocks, axis=0))


def _moving_noise(time: Array, values: Array, periods: StationaryPeriods, dt: float) -> Array:
    """Root density (6,) outside the stationary periods (S.1); zero without any motion."""
    outside = periods.index_of(time) < 0
    if outside.mean() < STATIC_SHARE or outside.sum() * dt < QUIETEST_S:
        return np.zeros(6)
    return _third_differences(
        time[outside], values[outside], dt, lambda blocks: np.median(blocks, axis=0)
    )


def _allan(values: Array, m: int, dt: float) -> Array:
    """sigma_A(tau) sqrt(tau) at tau = m dt, of the smallest 95 % of the differences.

    So a knock or the first step does not move it.
    """
    n = len(values) // m
    step = np.sort(np.diff(values[: n * m].reshape(n, m, -1).mean(axis=1), axis=0) ** 2, axis=0)
    kept = step[: max(1, int(KEPT_DIFFERENCES * len(step)))]
    return np.asarray(np.sqrt(np.mean(kept, axis=0) / VARIANCE_KEPT * 0.5 * m * dt))


def _third_differences(
    time: Array, values: Array, dt: float, pick: Callable[[Array], Array]
) -> Array:
    """Root density (6,) by (S.1) in blocks of `QUIETEST_S`, of which `pick` takes one.

    Gaps are left out.
    """
    differences = values[3:] - 3.0 * values[2:-1] + 3.0 * values[1:-2] - values[:-3]
    without_gap = time[3:] - time[:-3] < 4.5 * dt
    differences = differences[without_gap]
    block_size = max(20, min(round(QUIETEST_S / dt), len(differences)))
    block_count = len(differences) // block_size
    if block_count == 0:
        return np.zeros(values.shape[1])
    blocks = np.sqrt(
        np.mean(
            differences[: block_count * block_size].reshape(block_count, block_size, -1) ** 2,
            axis=1,
        )
        / 20.0
        * dt
    )
    return np.asarray(pick(blocks))


def fitting_model(sensing: Sensing) -> str | None:
    """Return the name of a shipped noise model that fits the recording; None without one.

    Its white noise and biases are those of the recording.
    """
    for name in shipped_models():
        model = load_noise_model(name)
        ratios = [
            float(np.max(sensing.moving_gyro)) / max(axis.white_noise for axis in model.gyro),
            float(np.max(sensing.moving_accel)) / max(axis.white_noise for axis in model.accel),
        ]
        has_rest = sensing.rest_s > 0.0
        small = (
            not has_rest
            or float(np.abs(sensing.mean_gyro).max()) < SHOWN_SIGMAS * model.gyro[0].turn_on_bias
        )
        if all(FITS[0] < ratio < FITS[1] for ratio in ratios) and small:
            return name
    return None


def noise_model(sensing: Sensing, name: str) -> NoiseModel:
    """Make a noise model of the recording.

    White noise is that measured in motion; biases are those of the stationary periods where there
    are any, else by class, and so are scale factors and misalignments.
    """
    turn_gyro, turn_accel, sigma_gyro, sigma_accel, tau = _CLASSES[sensing.grade]
    if sensing.rest_s > 0.0 and sensing.grade != "navigation":
        turn_gyro = max(2.0 * float(np.abs(sensing.mean_gyro).max()), 5.0 * sigma_gyro)
        turn_accel = max(2.0 * abs(sensing.gravity - STANDARD_GRAVITY), 0.4 * turn_accel)
    of_sensors = (
        ("gyro", sensing.moving_gyro, turn_gyro, sigma_gyro),
        ("accel", sensing.moving_accel, turn_accel, sigma_accel),
    )
    gyro, accel = (
        _axes(
            sensor, white, turn_on, GaussMarkov.from_sigma(tau, sigma), _GRADE_LIMITS[sensing.grade]
        )
        for sensor, white, turn_on, sigma in of_sensors
    )
    source = (
        f"{DRAFT_SOURCE}white noise measured in this recording, other values a-priori of a "
        f"{sensing.grade} sensor"
    )
    return NoiseModel(name, source, gyro, accel)


def _axes(
    sensor: str,
    white: Array,
    turn_on: float,
    error: GaussMarkov,
    constants: tuple[float, float] | None,
) -> tuple[AxisNoise, AxisNoise, AxisNoise]:
    """The three axes alike, with the largest white noise of them.

    Two digits are kept in the units in which a file writes white noise, bias and driving noise.
    """
    values = {
        "white_noise": float(white.max()),
        "turn_on_bias": turn_on,
        "driving_noise": error.driving_noise,
    }
    units = NOISE_UNITS[sensor]
    density, bias, driving = (round_in_unit(value, units[key], 2) for key, value in values.items())
    error = replace(error, driving_noise=driving)
    axis = AxisNoise(density, turn_on_bias=bias, gauss_markov=(error,))
    if constants is not None:
        axis = replace(axis, scale_factor=constants[0], misalignment=constants[1])
    return axis, axis, axis
