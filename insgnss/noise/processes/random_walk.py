r"""A noise model as white noise and random walk, which is what other estimators take.

Kalibr, OpenVINS, VINS-Mono and GTSAM know, of each sensor, a white noise of root PSD N and a bias
that is a random walk driven by white noise of root PSD K, whose Allan variance over a time T is

    A(T) = N^2 / T + K^2 T / 3                                                                 (W.1)

(IEEE Std 952, annex C). A sum of other processes cannot be written so at all T. It is at one, the
cluster time T: there each process gives its Allan variance to the term of (W.1) that its own
follows, to N where it falls with T and to K where it rises:

    quantization Q     3 Q^2 / T^2                     falls     N^2 += 3 Q^2 / T              (W.2)
    drift R            R^2 T^2 / 2                     rises     K^2 += 3 R^2 T / 2            (W.3)
    Gauss-Markov       s^2 g(T / tau)                  falls from T = 1.89 tau on              (W.4)
        g(x) = (2 x - 3 + 4 e^-x - e^-2x) / x^2,   s the stationary sigma, tau the correlation time
        rises: K^2 += 3 s^2 g / T                      falls: N^2 += T s^2 g

so that A(T) is kept exactly. What is lost: over times shorter than T a Gauss-Markov process of the
second kind has less noise than N says, over times longer than T one of the first kind has less than
K says, whose walk grows without end; and the turn-on bias, which has no Allan variance, is to be
given to the estimator as the sigma of its initial bias. T is the time over which the estimator
relies on the IMU between its other measurements; the axis with the largest value stands for all.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...base.errors import DataError, UsageError
from ...navigation.noise_model.model import AxisNoise, NoiseModel

CLUSTER_S = 10.0  # T by default (chosen), see above: --set cluster changes it
PEAK_RATIO = 1.8926  # T / tau at which (W.4) is largest
_SERIES = 1e-2  # T / tau below which (W.4) is summed as a power series


@dataclass(frozen=True)
class RandomWalk:
    """White noise and random walk of a model, X = rad/s and m/s^2.

    Parameters
    ----------
    gyro_white, accel_white : float
        Root PSD N, X/sqrt(Hz).
    gyro_walk, accel_walk : float
        Root PSD K of what drives the bias, X/s/sqrt(Hz).
    gyro_bias, accel_bias : float
        Standard deviation of the turn-on bias, X; 0 where the model has none.
    cluster_s : float
        The time T at which the Allan variance is the model's, s.
    """

    gyro_white: float
    gyro_walk: float
    accel_white: float
    accel_walk: float
    gyro_bias: float
    accel_bias: float
    cluster_s: float


def gauss_markov_allan(x: float) -> float:
    """Return the Allan variance (W.4) of a Gauss-Markov process of sigma 1.

    Parameters
    ----------
    x : float
        Cluster time over correlation time.
    """
    if x < _SERIES:
        return x * (2.0 / 3.0 - x / 2.0 + 7.0 * x**2 / 30.0)
    return (2.0 * x - 3.0 + 4.0 * math.exp(-x) - math.exp(-2.0 * x)) / x**2


def white_and_walk(axis: AxisNoise, cluster_s: float) -> tuple[float, float]:
    """Return N and K of an axis by (W.1) to (W.4).

    Parameters
    ----------
    axis : AxisNoise
        Its processes.
    cluster_s : float
        The time T, s.

    Returns
    -------
    white, walk : float
        X/sqrt(Hz) and X/s/sqrt(Hz).

    Raises
    ------
    UsageError
        T is not greater than zero.
    """
    T = cluster_s
    if not 0.0 < T < math.inf:
        raise UsageError(f"cluster time {T:g} s; give a number of seconds greater than zero")
    white = axis.white_noise**2 + 3.0 * axis.quantization**2 / T
    walk = axis.random_walk**2 + 1.5 * axis.drift**2 * T
    for process in axis.gauss_markov:
        x = T / process.correlation_time_s
        variance = process.sigma**2 * gauss_markov_allan(x)
        if x < PEAK_RATIO:
            walk += 3.0 * variance / T
        else:
            white += T * variance
    return math.sqrt(white), math.sqrt(walk)


def random_walk_of(model: NoiseModel, cluster_s: float = CLUSTER_S) -> RandomWalk:
    """Return white noise and random walk of a model, of the largest axis of each sensor.

    Parameters
    ----------
    model : NoiseModel
        The model.
    cluster_s : float
        The time T of the rule, s.

    Returns
    -------
    RandomWalk
        The numbers.

    Raises
    ------
    DataError
        A sensor has no white noise, or nothing that a random walk could stand for: an estimator
        would take its bias for known.
    UsageError
        T is not greater than zero.
    """
    triads: dict[str, Sequence[AxisNoise]] = {"gyro": model.gyro, "accel": model.accel}
    values: dict[str, float] = {}
    for sensor, axes in triads.items():
        white, walk = np.max([white_and_walk(axis, cluster_s) for axis in axes], axis=0).tolist()
        for name, value in (("white noise", white), ("process slower than the cluster time", walk)):
            if value <= 0.0:
                problem = f"the {sensor} of {model.name!r} has no {name} ({cluster_s:g} s)"
                raise DataError(f"{problem}; tune it with GM or RW, or give a shorter cluster time")
        values |= {f"{sensor}_white": white, f"{sensor}_walk": walk}
        values[f"{sensor}_bias"] = max(axis.turn_on_bias for axis in axes)
    return RandomWalk(**values, cluster_s=cluster_s)
