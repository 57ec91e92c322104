"""The state vector: which error states a noise model asks for, and where they stand.

The first nine states are the navigation errors (position, velocity, psi in the axes of l). Then, one after the other, the IMU
error states. Each adds ``x_s u_s`` to the measured rate of one of six channels (gyro x y z, accelerometer x y z in body axes):
u_s is one for a bias, the time since the start for a drift, the measured rate of a channel for a scale factor or a misalignment.
Each obeys ``dx/dt = -beta x + sqrt(drive) w``:

    turn-on bias, scale factor, misalignment, drift    beta = 0, drive = 0    a constant with an a-priori sigma
    random walk                                        beta = 0, drive > 0
    Gauss-Markov                                       beta = 1/T, drive > 0  started in its stationary state

A turn-on bias stays a state of its own. Folded into the longest Gauss-Markov process its fed-back estimate would decay with
that process's correlation time, and the filter would believe a bias that walks away from it (NEES 3 for the tilt).
"""

from dataclasses import dataclass

import numpy as np

from ..records import Array
from ..stochastic.model import AxisNoise, NoiseModel
from ._kernels import ImuModel

POS, VEL, PSI = slice(0, 3), slice(3, 6), slice(6, 9)
NAV = slice(0, 9)
BIAS, DRIFT = -1, -2
DEFAULT_SCALE = 1e-3  # scale factor, and misalignment in rad, of an uncalibrated MEMS sensor
CHANNELS = ("gyro x", "gyro y", "gyro z", "accel x", "accel y", "accel z")


@dataclass(frozen=True)
class StateLayout:
    """IMU error states in their order: arrays (ns,) and the white noise of the six channels.

    sigma0 : a-priori standard deviation.   white : (6,) PSD, (rad/s)^2/Hz and (m/s^2)^2/Hz.
    quantization : (6,) rad and m/s of one increment.
    """

    names: tuple[str, ...]
    channel: np.ndarray
    factor: np.ndarray
    beta: Array
    drive: Array
    sigma0: Array
    white: Array
    quantization: Array

    @property
    def size(self) -> int:
        """Number of all states, the nine of navigation included."""
        return 9 + len(self.names)

    def kernel_model(self, block_s: float, aiding_interval_s: float) -> ImuModel:
        """The arrays as the kernels take them. Quantization enters as white noise of the same variance over one aiding interval."""
        white = self.white + 2.0 * self.quantization**2 / aiding_interval_s
        return ImuModel(self.channel, self.factor, self.beta, self.drive, white, block_s)

    def channel_sum(self) -> Array:
        """(6, ns) matrix that adds the bias-like states up to the bias of each channel."""
        M = np.zeros((6, len(self.names)))
        for s, (c, f) in enumerate(zip(self.channel, self.factor, strict=True)):
            if f == BIAS:
                M[c, s] = 1.0
        return M


def state_layout(model: NoiseModel, scale_factor: bool = False, misalignment: bool = False) -> StateLayout:
    """The states that `model` asks for, and scale-factor and misalignment states where asked.

    Their a-priori sigma is the model's, where it has none 1000 ppm and 1 mrad.
    """
    rows: list[tuple[str, int, int, float, float, float]] = []
    axes = [*model.gyro, *model.accel]
    for c, axis in enumerate(axes):
        rows += _axis_states(c, axis)
    for c, axis in enumerate(axes):
        if scale_factor:
            rows.append((f"{CHANNELS[c]} scale factor", c, c, 0.0, 0.0, axis.scale_factor or DEFAULT_SCALE))
        if misalignment:
            triad = range(3 * (c // 3), 3 * (c // 3) + 3)
            rows += [(f"{CHANNELS[c]} from {CHANNELS[j][-1]}", c, j, 0.0, 0.0, axis.misalignment or DEFAULT_SCALE) for j in triad if j != c]
    names, channel, factor, beta, drive, sigma0 = zip(*rows, strict=True) if rows else ((), (), (), (), (), ())
    return StateLayout(
        tuple(names),
        np.array(channel, dtype=np.int64),
        np.array(factor, dtype=np.int64),
        np.array(beta, dtype=np.float64),
        np.array(drive, dtype=np.float64),
        np.array(sigma0, dtype=np.float64),
        np.array([a.white_noise**2 for a in axes]),
        np.array([a.quantization for a in axes]),
    )


def _axis_states(c: int, axis: AxisNoise) -> list[tuple[str, int, int, float, float, float]]:
    """(name, channel, factor, beta, drive, sigma0) of the bias-like states of one channel."""
    name = CHANNELS[c]
    rows = []
    if axis.turn_on_bias > 0.0 or axis.random_walk > 0.0:
        rows.append((f"{name} bias", c, BIAS, 0.0, axis.random_walk**2, axis.turn_on_bias))
    if axis.drift > 0.0:
        rows.append((f"{name} drift", c, DRIFT, 0.0, 0.0, axis.drift))
    for k, gm in enumerate(axis.gauss_markov, start=1):
        rows.append((f"{name} GM {k}", c, BIAS, 1.0 / gm.correlation_time_s, gm.driving_noise**2, gm.sigma))
    return rows
