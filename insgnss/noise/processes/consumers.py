"""A noise model as other estimators read it, data_specs/noise_exports.md.

kalibr    imu.yaml of Kalibr
openvins  kalibr_imu_chain.yaml of OpenVINS
vins      the IMU lines of a configuration of VINS-Mono and VINS-Fusion
gtsam     values of PreintegrationCombinedParams
ros       covariances of sensor_msgs/Imu

The numbers are those of `random_walk`, in the units of each.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from ...base import __version__
from ...base.errors import UsageError
from ...base.units import STANDARD_GRAVITY
from ...navigation.noise_model.model import NoiseModel
from .random_walk import CLUSTER_S, RandomWalk, random_walk_of


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
        Time at which the Allan variance is kept (`random_walk`), s.
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
