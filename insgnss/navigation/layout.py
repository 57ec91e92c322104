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

Behind them stand, where asked for, errors of the fixes that touch no channel (u_s = 0) and enter the measurement alone (`filter`):
lever arm and time offset, constants with an a-priori sigma, and the correlated error of the fixes, a Gauss-Markov process.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..records import Array
from ..stochastic.model import AxisNoise, NoiseModel
from ._kernels import ImuModel

POS, VEL, PSI = slice(0, 3), slice(3, 6), slice(6, 9)
NAV = slice(0, 9)
BIAS, DRIFT, OF_FIX = -1, -2, -3
DEFAULT_SCALE = 1e-3  # scale factor, and misalignment in rad, of an uncalibrated MEMS sensor
CHANNELS = ("gyro x", "gyro y", "gyro z", "accel x", "accel y", "accel z")


@dataclass(frozen=True)
class FixErrors:
    """What is estimated of the fixes' errors; None: taken as known, and errors as white.

    lever_arm_m : a-priori sigma of each component of the antenna's lever arm.   time_offset_s : of what is missing in the stamps;
    clock_rate : of what the one clock gains on the other, s a second, besides.
    correlated : (3,) stationary sigma of the correlated error, north, east, down, in standard deviations of each fix, and
    correlation_time_s, its correlation time.   scale : (3,) the uncorrelated error in the same unit.
    lasting : the same, one for all axes, of fixes whose errors stay for minutes (`filter.lasting_errors`), besides; lasting_time_s, its
    correlation time; lasting_scale, the uncorrelated error of such fixes.
    """

    lever_arm_m: float | None = None
    time_offset_s: float | None = None
    clock_rate: float | None = None
    correlated: tuple[float, ...] | None = None
    correlation_time_s: float = 60.0
    scale: tuple[float, ...] = (1.0, 1.0, 1.0)
    lasting: float | None = None
    lasting_time_s: float = 60.0
    lasting_scale: float = 1.0


@dataclass(frozen=True)
class StateLayout:
    """Error states behind those of navigation in their order: arrays (ns,) and the white noise of the six channels.

    sigma0 : a-priori standard deviation.   white : (6,) PSD, (rad/s)^2/Hz and (m/s^2)^2/Hz.
    quantization : (6,) rad and m/s of one increment.
    lever, offset, rate, coloured, lasting : first state of the lever arm, of the time offset, its rate, the correlated errors; -1 without.
    scale, lasting_scale : uncorrelated error of the fixes in their standard deviations, north, east, down.
    """

    names: tuple[str, ...]
    channel: np.ndarray
    factor: np.ndarray
    beta: Array
    drive: Array
    sigma0: Array
    white: Array
    quantization: Array
    lever: int = -1
    offset: int = -1
    rate: int = -1
    coloured: int = -1
    lasting: int = -1
    scale: tuple[float, ...] = (1.0, 1.0, 1.0)
    lasting_scale: float = 1.0

    @property
    def size(self) -> int:
        """Number of all states, the nine of navigation included."""
        return 9 + len(self.names)

    def kernel_model(self, block_s: float, aiding_interval_s: float) -> ImuModel:
        """The arrays as the kernels take them. Quantization enters as white noise of the same variance over one aiding interval."""
        white = self.white + 2.0 * self.quantization**2 / aiding_interval_s
        groups = np.array([self.coloured, self.lasting]), np.array([self.scale, (self.lasting_scale,) * 3])
        of_fixes = self.lever, self.offset, self.rate, *groups
        return ImuModel(self.channel, self.factor, self.beta, self.drive, white, block_s, *of_fixes)

    @property
    def of_fixes(self) -> bool:
        """Whether errors of the fixes are among the states."""
        return max(self.lever, self.offset, self.coloured, self.lasting) >= 0

    def channel_sum(self) -> Array:
        """(6, ns) matrix that adds the bias-like states up to the bias of each channel."""
        M = np.zeros((6, len(self.names)))
        for s, (c, f) in enumerate(zip(self.channel, self.factor, strict=True)):
            if f == BIAS:
                M[c, s] = 1.0
        return M


def state_layout(model: NoiseModel, scale_factor: bool = False, misalignment: bool = False, fixes: FixErrors = FixErrors()) -> StateLayout:
    """The states that `model` asks for, and scale-factor and misalignment states and those of the fixes' errors where asked.

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
    at: dict[str, int] = {}
    for what, states in _fix_states(fixes):
        at[what] = len(rows)
        rows += states
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
        **at,
        scale=fixes.scale,
        lasting_scale=fixes.lasting_scale,
    )


def _fix_states(fixes: FixErrors) -> Iterator[tuple[str, list[tuple[str, int, int, float, float, float]]]]:
    """Kind and states of the fixes' errors, as `_axis_states` has them."""
    if fixes.lever_arm_m is not None:
        yield "lever", [(f"antenna lever arm {axis}", 0, OF_FIX, 0.0, 0.0, fixes.lever_arm_m) for axis in ("forward", "right", "down")]
    if fixes.time_offset_s is not None:
        yield "offset", [("GNSS time offset", 0, OF_FIX, 0.0, 0.0, fixes.time_offset_s)]
        if fixes.clock_rate is not None:
            yield "rate", [("GNSS clock rate", 0, OF_FIX, 0.0, 0.0, fixes.clock_rate)]
    if fixes.correlated is not None:
        yield "coloured", _lasting("GNSS", fixes.correlated, fixes.correlation_time_s)
    if fixes.lasting is not None:
        yield "lasting", _lasting("GNSS lasting", (fixes.lasting,) * 3, fixes.lasting_time_s)


def _lasting(of: str, sigma: tuple[float, ...], time_s: float) -> list[tuple[str, int, int, float, float, float]]:
    """A correlated error as three Gauss-Markov states."""
    beta = 1.0 / time_s
    named = zip(("north", "east", "down"), sigma, strict=True)
    return [(f"{of} correlated error {axis}", 0, OF_FIX, beta, 2.0 * beta * s**2, s) for axis, s in named]


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
