"""Sensors on an exact motion.

IMU and camera, with their errors and their mounting, and the antenna's place (`receiver` measures
it).

Body axes b are the IMU's, turned to forward-right-down; T and B of paper 000 (equation 1) take them
to the camera's,

    C_cb = T B,   r_ba_b = C_cb^T (a_c - b_c),   r_bc_b = -C_cb^T b_c                          (S.1)

with a_c, b_c from the camera to antenna and IMU in camera axes (Table 1). The motion's position is
that of the IMU. With r = r_ba_b the antenna is at, and moves with,

    p_a = p + C_lb r,   v_a = v + C_lb (omega_lb_b x r)                                        (S.2)

An IMU reads, in body axes and then in its own, the truth plus the errors of its noise model,

    reading = (I + M) truth + slow errors + white and quantization noise                       (S.3)

where M, drawn once, holds scale factors on its diagonal and misalignments off it. The slow errors
are the truth for the biases that a filter estimates. An airframe that shakes the sensor adds
broad-band noise as soon as it moves: white noise then is `vibration` times the model's (lines of an
engine are `faults.Vibration`).
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from ..base.advance import through, within
from ..base.errors import UsageError
from ..geodesy.rotation import nearest_rotation
from ..navigation.noise_model.model import AxisNoise, NoiseModel, load_noise_model
from ..noise.processes.realisation import simulate_noise
from ..records import Array, CameraEvents, ImuSamples, Quantity
from .faults import ImuFaults
from .flights import FlightMotion
from .motion import ExactMotion

MOVES_MS = 1.0  # speed above which vibration is added to white noise (chosen)
# T and B of paper 000
_PAPER_T = ((-1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0))
_PAPER_B = (  # as printed, to six digits
    (0.999909, 0.008952, 0.010018),
    (-0.009067, 0.999893, 0.011465),
    (-0.009914, -0.011555, 0.999884),
)
_DIRECTIONS = {
    word: (line, sense)
    for line, pair in enumerate((("forward", "backward"), ("right", "left"), ("down", "up")))
    for word, sense in zip(pair, (1.0, -1.0), strict=True)
}


@dataclass(frozen=True)
class Rig:
    """Mounting of IMU, antenna and camera.

    The paper's by default (Tables 1 and 2, B re-orthonormalised).

    Parameters
    ----------
    antenna_m, imu_m : (3) m, from the camera in camera axes.
    camera_from_body, boresight : 3 x 3, T and B.
    """

    antenna_m: tuple[float, ...] = (0.462, -0.001, -0.065)
    imu_m: tuple[float, ...] = (0.113, 0.020, 0.000)
    camera_from_body: tuple[tuple[float, ...], ...] = _PAPER_T
    boresight: tuple[tuple[float, ...], ...] = tuple(
        tuple(row) for row in nearest_rotation(_PAPER_B).tolist()
    )

    @property
    def C_cb(self) -> Array:
        """(3, 3), body into camera (S.1)."""
        return np.array(self.camera_from_body) @ np.array(self.boresight)

    @property
    def antenna_lever_b(self) -> Array:
        """(3,) m, IMU to antenna in body axes (S.1)."""
        return self.C_cb.T @ (np.array(self.antenna_m) - np.array(self.imu_m))

    @property
    def camera_lever_b(self) -> Array:
        """(3,) m, IMU to projection centre in body axes (S.1)."""
        return -self.C_cb.T @ np.array(self.imu_m)


@dataclass(frozen=True)
class ImuOptions:
    """How the IMU samples and errs.

    Parameters
    ----------
    noise : shipped model, path, `NoiseModel`, or None for an ideal sensor; its x, y, z act on the
        body's forward, right, down.
    axes : body directions of the sensor's x, y, z.
    phase_s : of the stamps against the record's start.
    vibration : factor of the white noise while the vehicle moves, against the model's, which knows
        nothing of it.
    faults : of the recording.
    """

    rate_hz: float = 500.0
    noise: str | NoiseModel | None = "navchip"
    axes: str = "forward right down"
    quantity: Quantity = "mean_rate"
    phase_s: float = 0.0
    faults: ImuFaults = field(default_factory=ImuFaults)
    vibration: float = 1.0

    def __post_init__(self) -> None:
        if not 1.0 <= self.vibration < np.inf:
            raise UsageError(
                f"vibration {self.vibration:g}; it is a factor of the white noise, one or more"
            )
        if self.vibration > 1.0 and self.noise is None:
            raise UsageError(
                f"vibration {self.vibration:g} of an ideal sensor, which has no white noise to"
                " multiply; name a noise model"
            )


@dataclass(frozen=True)
class SecondImu:
    """Another IMU on the same body; imu_m : (3) m, from the camera in camera axes, as in `Rig`.

    `options.axes` turn it to the body.
    """

    options: ImuOptions = field(default_factory=ImuOptions)
    imu_m: tuple[float, ...] = (0.113, 0.060, 0.000)


@dataclass(frozen=True, eq=False)
class SimulatedImu:
    """Samples in the sensor's own axes as recorded, and the slow errors of the sensor.

    The slow errors (n, 3) are in body axes, rad/s and m/s^2.

    Parameters
    ----------
    time : (n,) s GPST, ends of the intervals that the slow errors are of; faults of the recording
        do not touch them.
    """

    samples: ImuSamples
    time: Array
    gyro_bias: Array
    accel_bias: Array


ROUNDING = 1e-9  # of a determinant: right-handed unit vectors have 1 exactly
MOTION_SHARE = 0.5  # of the time of an IMU that its ideal readings take; its errors take the rest


def axes_matrix(axes: str) -> Array:
    """Return C_bs (3, 3), sensor into body, of the body directions of the sensor's x, y, z.

    Raises
    ------
    UsageError
        Unless they are right-handed.
    """
    C_bs = np.zeros((3, 3))
    directions = axes.split()
    if len(directions) == 3 and all(direction in _DIRECTIONS for direction in directions):
        for k, direction in enumerate(directions):
            line, sense = _DIRECTIONS[direction]
            C_bs[line, k] = sense
    if abs(np.linalg.det(C_bs) - 1.0) > ROUNDING:
        raise UsageError(
            f"IMU axes {axes!r} are no right-handed three of {', '.join(_DIRECTIONS)}; e.g. 'right"
            " backward down'"
        )
    return C_bs


def simulate_imu(
    flight: FlightMotion,
    options: ImuOptions,
    rng: np.random.Generator,
    lever_b: ArrayLike = (0.0, 0.0, 0.0),
) -> SimulatedImu:
    """Simulate the samples of an IMU over a whole flight (S.3).

    The IMU is at `lever_b` (3,) m in body axes from the motion's point.
    """
    C_bs = axes_matrix(options.axes)
    with within(0.0, MOTION_SHARE):
        ideal = flight.motion.imu(
            options.rate_hz, options.quantity, phase_s=options.phase_s, lever_b=lever_b
        )
    model = load_noise_model(options.noise) if isinstance(options.noise, str) else options.noise
    dt = 1.0 / options.rate_hz
    readings, slow = [], []
    *streams, faults = rng.spawn(3)
    added_noise = _added_noise_factor(flight.motion, ideal.time, options.vibration)
    vibration_rngs = rng.spawn(2)
    triads = (model.gyro, model.accel) if model else ((), ())
    ideal_triads = (ideal.gyro, ideal.accel)
    for k, (truth, axes, stream, vibration_rng) in enumerate(
        zip(ideal_triads, triads, streams, vibration_rngs, strict=True)
    ):
        start = MOTION_SHARE + 0.5 * (1.0 - MOTION_SHARE) * k
        with within(start, start + 0.5 * (1.0 - MOTION_SHARE)):
            reading, bias = _with_errors(truth, axes, dt, options.quantity, stream)
        if options.vibration > 1.0:
            white = np.array([axis.white_noise for axis in axes])
            white_to_reading = (
                np.sqrt(dt) if options.quantity == "increments" else 1.0 / np.sqrt(dt)
            )
            reading = reading + white_to_reading * added_noise[
                :, None
            ] * white * vibration_rng.standard_normal(reading.shape)
        readings.append(reading @ C_bs)
        slow.append(bias)
    samples = replace(
        ideal, gyro=readings[0], accel=readings[1], gps_week=flight.gps_week, source="simulated IMU"
    )
    return SimulatedImu(options.faults.apply(samples, faults), ideal.time, slow[0], slow[1])


def _added_noise_factor(motion: ExactMotion, time: Array, vibration: float) -> Array:
    """Return the white noise (n,) that vibration adds at `time` (n,), s, over the model's.

    It is independent, so that the sum is `vibration` times as large.
    """
    velocity = motion.velocity(np.clip(time, motion.start, motion.end))
    return np.sqrt(vibration**2 - 1.0) * (np.linalg.norm(velocity, axis=1) > MOVES_MS)


def _with_errors(
    truth: Array,
    axes: tuple[AxisNoise, ...],
    dt: float,
    quantity: Quantity,
    rng: np.random.Generator,
) -> tuple[Array, Array]:
    """Return readings (n, 3) in the quantity's unit and slow errors (n, 3) as rates (S.3).

    `truth` (n, 3) is the ideal reading of three axes, `dt` the interval, s.
    """
    if not axes:
        return truth, np.zeros_like(truth)
    to_quantity = dt if quantity == "increments" else 1.0
    bias = np.empty_like(truth)
    reading = np.empty_like(truth)
    M = np.array(
        [
            rng.standard_normal(3)
            * [axis.scale_factor if j == i else axis.misalignment for j in range(3)]
            for i, axis in enumerate(axes)
        ]
    )
    for i, axis in through(list(enumerate(axes))):
        fast = AxisNoise(white_noise=axis.white_noise, quantization=axis.quantization)
        bias[:, i] = simulate_noise(
            replace(axis, white_noise=0.0, quantization=0.0), len(truth), dt, rng
        )
        reading[:, i] = (
            truth[:, i]
            + truth @ M[i]
            + to_quantity * (bias[:, i] + simulate_noise(fast, len(truth), dt, rng))
        )
    return reading, bias


def antenna_states(motion: ExactMotion, lever_b: ArrayLike, time: Array) -> tuple[Array, Array]:
    """Return position (n, 3) m and velocity (n, 3) m/s in l of a point of the body (S.2).

    The point is at `lever_b` (3,) m in body axes.
    """
    C_lb = motion.C_lb(time)
    lever = np.asarray(lever_b, dtype=np.float64)
    velocity_b = np.cross(motion.omega_lb_b(time), lever)
    velocity = motion.velocity(time) + np.einsum("nij,nj->ni", C_lb, velocity_b)
    return motion.position(time) + C_lb @ lever, velocity


def simulate_events(
    flight: FlightMotion, missing_fraction: float, rng: np.random.Generator
) -> CameraEvents:
    """Return mid-exposure events of a flight; a share of them, drawn at random, is missing.

    Raises
    ------
    UsageError
        When the share is not in [0, 1).
    """
    if not 0.0 <= missing_fraction < 1.0:
        raise UsageError(f"a share of {missing_fraction} missing events; it lies between 0 and 1")
    keep = rng.random(flight.time.size) >= missing_fraction
    names = tuple(name for name, has_event in zip(flight.images, keep, strict=True) if has_event)
    return CameraEvents(names, flight.time[keep], flight.gps_week, "simulated camera")
