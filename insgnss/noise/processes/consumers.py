r"""A noise model as other estimators read it, data_specs/noise_exports.md.

kalibr    imu.yaml of Kalibr
openvins  kalibr_imu_chain.yaml of OpenVINS
vins      the IMU lines of a configuration of VINS-Mono and VINS-Fusion
gtsam     values of PreintegrationCombinedParams
ros       covariances of sensor_msgs/Imu

A noise model is written as white noise and random walk, in the units of each.

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
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...base import __version__
from ...base.errors import DataError, UsageError
from ...base.units import STANDARD_GRAVITY
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


@dataclass(frozen=True)
class Sensor:
    """What a file needs beside the noise.

    Parameters
    ----------
    rate_hz : float
        Samples a second.
    topic : str
        Topic of its messages.
    """

    rate_hz: float
    topic: str


def _number(value: float) -> str:
    """A float as YAML 1.1 reads one: with a point."""
    mantissa, _, exponent = f"{value:.6g}".partition("e")
    point = mantissa if "." in mantissa else f"{mantissa}.0"
    return f"{point}e{exponent}" if exponent else point


def _densities(walk: RandomWalk, indent: str = "") -> list[str]:
    values = (
        ("accelerometer_noise_density", walk.accel_white, "m/s^2/sqrt(Hz)"),
        ("accelerometer_random_walk", walk.accel_walk, "m/s^3/sqrt(Hz)"),
        ("gyroscope_noise_density", walk.gyro_white, "rad/s/sqrt(Hz)"),
        ("gyroscope_random_walk", walk.gyro_walk, "rad/s^2/sqrt(Hz)"),
    )
    return [f"{indent}{name}: {_number(value)}  # {unit}" for name, value, unit in values]


def _kalibr(walk: RandomWalk, sensor: Sensor) -> list[str]:
    return [
        *_densities(walk),
        f"rostopic: {sensor.topic}",
        f"update_rate: {_number(sensor.rate_hz)}  # Hz",
    ]


def _matrix(name: str, size: int) -> list[str]:
    rows = [", ".join("1.0" if i == k else "0.0" for k in range(size)) for i in range(size)]
    return [f"  {name}:", *(f"    - [{row}]" for row in rows)]


def _openvins(walk: RandomWalk, sensor: Sensor) -> list[str]:
    zeros = ["  Tg:", *(f"    - [{', '.join(['0.0'] * 3)}]" for _ in range(3))]
    matrices = [_matrix(name, 3) for name in ("Tw", "R_IMUtoGYRO", "Ta", "R_IMUtoACC")]
    return [
        "imu0:",
        *_matrix("T_i_b", 4),
        *_densities(walk, "  "),
        f"  rostopic: {sensor.topic}",
        "  time_offset: 0.0",
        f"  update_rate: {_number(sensor.rate_hz)}",
        '  model: "kalibr"',
        *(line for matrix in matrices for line in matrix),
        *zeros,
    ]


def _vins(walk: RandomWalk, sensor: Sensor) -> list[str]:
    white, drive = math.sqrt(2.0 * sensor.rate_hz), math.sqrt(sensor.rate_hz)
    return [
        f'imu_topic: "{sensor.topic}"',
        f"acc_n: {_number(walk.accel_white * white)}  # m/s^2 a sample",
        f"gyr_n: {_number(walk.gyro_white * white)}  # rad/s a sample",
        f"acc_w: {_number(walk.accel_walk * drive)}  # m/s^3 a sample",
        f"gyr_w: {_number(walk.gyro_walk * drive)}  # rad/s^2 a sample",
        f"g_norm: {STANDARD_GRAVITY}",
    ]


def _gtsam(walk: RandomWalk, sensor: Sensor) -> list[str]:
    values = (
        ("accelerometerCovariance", walk.accel_white, "(m/s^2)^2/Hz"),
        ("gyroscopeCovariance", walk.gyro_white, "(rad/s)^2/Hz"),
        ("biasAccCovariance", walk.accel_walk, "(m/s^3)^2/Hz"),
        ("biasOmegaCovariance", walk.gyro_walk, "(rad/s^2)^2/Hz"),
    )
    lines = []
    for name, value, unit in values:
        v = _number(value**2)
        lines.append(f"{name}: [[{v}, 0.0, 0.0], [0.0, {v}, 0.0], [0.0, 0.0, {v}]]  # {unit}")
    return lines


def _ros(walk: RandomWalk, sensor: Sensor) -> list[str]:
    lines = []
    for name, white in (
        ("angular_velocity_covariance", walk.gyro_white),
        ("linear_acceleration_covariance", walk.accel_white),
    ):
        v = _number(white**2 * sensor.rate_hz)
        lines.append(f"{name}: [{v}, 0.0, 0.0, 0.0, {v}, 0.0, 0.0, 0.0, {v}]")
    return lines


CONSUMER_FORMS: dict[str, tuple[str, str, Callable[[RandomWalk, Sensor], list[str]]]] = {
    "kalibr": ("imu.yaml", "imu.yaml of Kalibr", _kalibr),
    "openvins": ("kalibr_imu_chain.yaml", "kalibr_imu_chain.yaml of OpenVINS", _openvins),
    "vins": ("vins_imu.yaml", "IMU lines of VINS-Mono and VINS-Fusion", _vins),
    "gtsam": ("gtsam_imu.yaml", "values of GTSAM's PreintegrationCombinedParams", _gtsam),
    "ros": ("imu_covariances.yaml", "covariances of sensor_msgs/Imu", _ros),
}
"""File name, description and lines by name."""


def text_for(
    form: str,
    model: NoiseModel,
    cluster_s: float = CLUSTER_S,
    rate_hz: float | None = None,
    topic: str = "/imu0",
) -> str:
    """Return the text of a noise model in the form of another estimator.

    Parameters
    ----------
    form : str
        One of `CONSUMER_FORMS`.
    model : NoiseModel
        The model.
    cluster_s : float
        Time at which the Allan variance is kept, s.
    rate_hz : float, optional
        Samples a second; None: of the recordings that the model is of.
    topic : str
        Topic of the IMU's messages.

    Returns
    -------
    str
        YAML.

    Raises
    ------
    UsageError
        There is no such form, or no rate.
    DataError
        The model has no white noise or no slow process.
    """
    if form not in CONSUMER_FORMS:
        raise UsageError(
            f"{form!r} is no form of a noise model; there are {', '.join(CONSUMER_FORMS)}"
        )
    recorded_rates = {source.sampling_rate_hz for source in model.recordings}
    rates = recorded_rates if rate_hz is None else {rate_hz}
    if len(rates) != 1 or not 0.0 < (rate := next(iter(rates))) < math.inf:
        raise UsageError(f"{model.name}: no rate of the samples is known; give rate=HZ")
    if any(c.isspace() or c in "\"'#:" for c in topic) or not topic.isprintable():
        raise UsageError(f"topic {topic!r} is no name of a topic, such as /imu0")
    walk = random_walk_of(model, cluster_s)
    lines = [*_head(model, walk, form), *CONSUMER_FORMS[form][2](walk, Sensor(rate, topic))]
    return ("%YAML:1.0\n" if form in ("openvins", "vins") else "") + "\n".join(lines) + "\n"


def _head(model: NoiseModel, walk: RandomWalk, form: str) -> Sequence[str]:
    """Comments: where the numbers are from, and what they leave out."""
    name = " ".join(model.name.split())
    lines = [
        f"insgnss {__version__}: noise model {name}, {CONSUMER_FORMS[form][1]}",
        f"white noise and random walk with the model's Allan variance at {walk.cluster_s:g} s,"
        " largest axis",
        f"turn-on bias, to be given as sigma of the initial bias: {walk.gyro_bias:.6g} rad/s,"
        f" {walk.accel_bias:.6g} m/s^2",
    ]
    return [f"# {line}" for line in lines]
