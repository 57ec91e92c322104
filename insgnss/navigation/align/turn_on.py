"""The bias at turn-on, from stationary periods before take-off or after landing.

With u the unit vector upwards in body axes, the mean readings of a stationary period are

    gyro  = b_g + w_e (u sin(lat) + h cos(lat)) + noise                                        (U.1)
    accel = b_a + g u + noise                                                                  (U.2)

h is north in the horizontal plane, of unknown heading: any direction across u, with mean zero and
covariance (I - u u^T) / 2. u comes from the accelerometers themselves, so only the magnitude of
(U.2) tells of their bias: u . b_a = |accel| - g. Across u a bias is a tilt, and stays what it was a
priori.

Each channel's a-priori standard deviation enters as such (the turn-on bias of the noise model), and
what comes out is the a-posteriori mean and covariance of the bias: a start for the filter. Several
periods see one bias plus a wander of their own, taken from the scatter of their means where there
are three and more; the Earth's rate is the same in all, and no mean takes its share away.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...base.errors import DataError
from ...base.units import STANDARD_GRAVITY
from ...geodesy.earth import EARTH_RATE, normal_gravity
from ...records import Array
from ..prepare.stationarity import StationaryPeriods

# rad/s, m/s^2, of the mean of a stationary period: sensors that round to a constant
LEAST_SIGMA = {"gyro": 1e-7, "accel": 2e-5}
# between verticals of stationary periods: a body that settles on its legs, not one that was turned
ONE_ATTITUDE_DEG = 5.0
GRAVITY_SIGMA_MS2 = 5e-4  # m/s^2, normal gravity against the true one


@dataclass(frozen=True, eq=False)
class TurnOnBias:
    """Bias in body axes with its covariance.

    Parameters
    ----------
    gyro : ndarray, (3,)
        Bias of the gyros, rad/s.
    gyro_cov : ndarray, (3, 3)
        Its covariance.
    accel : ndarray, (3,)
        Bias of the accelerometers, m/s^2.
    accel_cov : ndarray, (3, 3)
        Its covariance.
    seconds : float
        Length of the stationary periods used, s.
    """

    gyro: Array
    gyro_cov: Array
    accel: Array
    accel_cov: Array
    seconds: float

    @property
    def sigma(self) -> Array:
        """The standard deviations (6,), SI."""
        return np.sqrt(np.concatenate([np.diag(self.gyro_cov), np.diag(self.accel_cov)]))

    def summary(self) -> str:
        """Return the bias and its standard deviation in one sentence."""
        gyro, accel = np.degrees(3600.0 * self.sigma[:3]), 1e3 * self.sigma[3:] / STANDARD_GRAVITY
        return (
            f"{self.seconds:.0f} s at rest: gyro bias {_three(np.degrees(3600.0 * self.gyro))} +-"
            f" {_three(gyro)} deg/h (heading unknown), accelerometer bias"
            f" {_three(1e3 * self.accel / STANDARD_GRAVITY)} +- {_three(accel)} mg"
        )


def _three(values: Array) -> str:
    return "[" + ", ".join(f"{v:.1f}" for v in values) + "]"


def turn_on_bias(
    periods: StationaryPeriods,
    C_b_imu: ArrayLike,
    latitude: float,
    height: float,
    gyro_prior: ArrayLike,
    accel_prior: ArrayLike,
) -> TurnOnBias:
    """Estimate the bias from stationary periods in one attitude.

    Parameters
    ----------
    periods : StationaryPeriods
        The stationary periods; select those of one attitude with `within`.
    C_b_imu : array_like, (3, 3)
        Rotation of the IMU's axes into the body frame.
    latitude : float
        Geodetic latitude, rad.
    height : float
        Height above the ellipsoid, m.
    gyro_prior, accel_prior : array_like, (3,)
        A-priori standard deviations in body axes, rad/s and m/s^2.

    Returns
    -------
    TurnOnBias
        A-posteriori bias and covariance.

    Raises
    ------
    DataError
        Without a period, and where the attitudes of the periods differ by more than 5 deg.
    """
    if not len(periods):
        raise DataError(
            "no stationary period of a second; the turn-on bias needs one before or after the "
            "flight"
        )
    C = np.asarray(C_b_imu, dtype=np.float64)
    rates, each = periods.gyro_mean @ C.T, periods.accel_mean @ C.T
    of_gyro, of_accel = periods.gyro_std @ np.abs(C).T, periods.accel_std @ np.abs(C).T
    gyro, gyro_noise = _mean(rates, of_gyro, periods.samples, LEAST_SIGMA["gyro"])
    accel, accel_noise = _mean(each, of_accel, periods.samples, LEAST_SIGMA["accel"])
    u = accel / np.linalg.norm(accel)
    cosine = np.clip(each @ u / np.linalg.norm(each, axis=1), -1.0, 1.0)
    tilt = float(np.degrees(np.arccos(cosine).max()))
    if tilt > ONE_ATTITUDE_DEG:
        raise DataError(
            f"stationary periods tilted by {tilt:.1f} deg (limit {ONE_ATTITUDE_DEG:g} deg) against"
            " each other; take those of one attitude"
        )
    level_cov = 0.5 * (EARTH_RATE * np.cos(latitude)) ** 2 * (np.eye(3) - np.outer(u, u))  # (U.1)
    observed = gyro - EARTH_RATE * np.sin(latitude) * u, np.diag(gyro_noise**2) + level_cov
    bias, bias_cov = _kalman_update(np.diag(np.square(gyro_prior)), np.eye(3), *observed)
    g = float(normal_gravity(latitude, height))
    sigma = np.hypot(np.linalg.norm(u * accel_noise), GRAVITY_SIGMA_MS2)
    size = np.array([np.linalg.norm(accel) - g])
    force, force_cov = _kalman_update(
        np.diag(np.square(accel_prior)), u[None, :], size, np.array([[sigma**2]])
    )
    seconds = float(np.diff(periods.time, axis=1).sum())
    return TurnOnBias(bias, bias_cov, force, force_cov, seconds)


def _mean(
    means: Array, std: Array, samples: NDArray[np.int64], least: float
) -> tuple[Array, Array]:
    """Return the weighted mean (3,) of the periods and its standard deviation.

    It holds white noise and the periods' own scatter.
    """
    weight = samples / samples.sum()
    mean = weight @ means
    white = np.sqrt(weight @ std**2 / samples.sum())
    scatter = (
        np.sqrt(weight @ (means - mean) ** 2 / (len(means) - 1)) if len(means) > 2 else np.zeros(3)
    )
    return mean, np.maximum(np.maximum(white, scatter), least)


def _kalman_update(P: Array, H: Array, z: Array, R: Array) -> tuple[Array, Array]:
    """Return mean and covariance of a state after z = H x + noise of covariance R.

    Before, its mean is zero and its covariance P.
    """
    K = np.linalg.solve(H @ P @ H.T + R, H @ P).T
    I_KH = np.eye(len(P)) - K @ H
    return K @ z, I_KH @ P @ I_KH.T + K @ R @ K.T
