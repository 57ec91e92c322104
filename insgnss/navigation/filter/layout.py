"""The state vector: which error states a noise model asks for, and where they stand.

The first nine states are the navigation errors (position, velocity, psi in the axes of l). Then,
one after the other, the IMU error states. Each adds ``x_s u_s`` to the measured rate of one of six
channels (gyro x y z, accelerometer x y z in body axes): u_s is one for a bias, the time since the
start for a drift, the temperature of the IMU for a bias that follows it, the measured rate of a
channel for a scale factor or a misalignment. Each obeys ``dx/dt = -beta x + sqrt(drive) w``:

    turn-on bias, scale factor, misalignment, drift    beta = 0, drive = 0    a constant with an
                                                                              a-priori sigma
    random walk                                        beta = 0, drive > 0
    Gauss-Markov                                       beta = 1/T, drive > 0  started in its
                                                                              stationary state
    slow bias                                          beta = 1/T, drive = 0  a exp(-t/T); else a
                                                                              drift, or with the
                                                                              temperature

A turn-on bias stays a state of its own. Folded into the longest Gauss-Markov process its fed-back
estimate would decay with that process's correlation time, and the filter would take for certain a
bias that walks away from it (NEES 3 for the tilt).

Behind them stand, where asked for, errors of the fixes that touch no channel (u_s = 0) and enter
the measurement alone (`navigation.filter.filter`): lever arm and time offset, constants with an
a-priori sigma, and the time-correlated error of the fixes, a Gauss-Markov process; and those of a
barometer, its bias, a random walk, and its scale factor, a constant.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from ...base.units import DEG_PER_H, MILLI_G
from ...records import Array
from ...records.measurements import Measurement, OwnState
from ...records.states import (
    BAROMETER_BIAS,
    CHANNELS,
    CLOCK_RATE,
    CORRELATED_ERROR,
    LEVER_ARM,
    MISALIGNMENT,
    OF_LEVER_ARM,
    SCALE_FACTOR,
    TIME_OFFSET,
    UNFIXED_ERROR,
    VELOCITY_ERROR,
    State,
)
from ..noise_model.model import AxisNoise, NoiseModel
from .codes import (
    ABSENT,
    AIDING_ERROR,
    BIAS,
    DRIFT_CODE,
    N_CHANNELS,
    N_NAV,
    TEMPERATURE_CODE,
)
from .kernels.records import StateModel

DEFAULT_SCALE = 1e-3  # scale factor, and misalignment in rad, of an uncalibrated MEMS sensor

# a-priori sigma of a slow bias, rad/s and m/s^2: MEMS that warm up by 20 to 40 K change by 100 to
# 500 deg/h and by 3 to 15 mg
SLOW_BIAS = {"gyro": 200.0 * DEG_PER_H, "accel": 5.0 * MILLI_G}
UNIT_OF_SENSOR = {"gyro": "rad/s", "accel": "m/s^2"}
SLOW_STATE = "slow bias"  # group of its states

Row = tuple[State, int, int, float, float, float]  # state, channel, factor, beta, drive, sigma0


@dataclass(frozen=True)
class FixErrors:
    """Errors of the GNSS fixes that are estimated; None where they are taken as known, or as white.

    Parameters
    ----------
    lever_arm_m : float or tuple of float, optional
        A-priori sigma of all components of the antenna's lever arm, or of each of them, m.
    time_offset_s : float, optional
        A-priori sigma of the time offset of the stamps, s.
    clock_rate : float, optional
        A-priori sigma of what the one clock gains on the other, s a second, besides.
    gm_sigma : tuple of float, optional
        (3,) stationary sigma of the time-correlated (Gauss-Markov) error of all fixes, north, east,
        down, in standard deviations of each fix.
    correlation_time_s : float
        Its correlation time.
    white_scale : tuple of float
        (3,) sigma of the white error in the same unit.
    unfixed_gm_sigma : float, optional
        Sigma of the time-correlated error that float and code solutions have besides
        (`epochs.unfixed_solutions`), of each axis, in the same unit.
    unfixed_correlation_time_s : float
        Its correlation time.
    unfixed_white_scale : float
        Sigma of the white error of such fixes, of each axis, in the same unit.
    velocity_gm_sigma_mps : float, optional
        Sigma of the time-correlated error of measured velocities, of each axis, m/s.
    velocity_correlation_time_s : float
        Its correlation time.
    velocity_white_scale : float
        Sigma of the white error of velocities in their standard deviations.
    """

    lever_arm_m: float | tuple[float, ...] | None = None
    time_offset_s: float | None = None
    clock_rate: float | None = None
    gm_sigma: tuple[float, ...] | None = None
    correlation_time_s: float = 60.0
    white_scale: tuple[float, ...] = (1.0, 1.0, 1.0)
    unfixed_gm_sigma: float | None = None
    unfixed_correlation_time_s: float = 60.0
    unfixed_white_scale: float = 1.0
    velocity_gm_sigma_mps: float | None = None
    velocity_correlation_time_s: float = 60.0
    velocity_white_scale: float = 1.0


@dataclass(frozen=True)
class SlowBias:
    """A bias of every channel that follows one deterministic course, as of an IMU that warms up.

    Parameters
    ----------
    course : str
        A decay exp(-t/T), a drift with time, or one with the temperature that the IMU logs.
    time_s : float
        Of a decay T, s; of a drift the length of the flight, over which it grows to `SLOW_BIAS`; of
        one with the temperature, which does so over the range of that, not used.
    """

    course: Literal["decay", "drift", "temperature"]
    time_s: float = np.inf


@dataclass(frozen=True)
class BarometerErrors:
    """Errors of a barometer that are estimated.

    Parameters
    ----------
    bias_m : float
        A-priori sigma of the bias of its heights at the start, m.
    bias_walk : float
        Random walk of the bias, m/sqrt(s): weather, temperature of the sensor, wind.
    scale_factor : float
        A-priori sigma of the scale factor of its heights: air warmer or colder than the standard
        atmosphere by 1 % of its absolute temperature makes 1 %.
    """

    bias_m: float
    bias_walk: float
    scale_factor: float


@dataclass(frozen=True)
class StateLayout:
    """The error states behind those of navigation, in their order.

    Parameters
    ----------
    states : tuple of State
        (ns,) what each is.
    channel, factor : ndarray
        (ns,) the channel that the state adds to, and what it is multiplied with before: BIAS,
        DRIFT_CODE, AIDING_ERROR (`navigation.filter.codes`) or the channel whose measured rate it
        is.
    beta, drive : Array
        (ns,) inverse correlation time, 1/s, and PSD of the driving noise.
    sigma0 : Array
        (ns,) a-priori standard deviation.
    white : Array
        (6,) PSD of the channels' white noise, (rad/s)^2/Hz and (m/s^2)^2/Hz.
    quantization : Array
        (6,) rad and m/s, of one increment.
    white_scale : tuple of float
        (3,) sigma of the fixes' white error in their standard deviations, north, east, down.
    unfixed_white_scale, velocity_white_scale : float
        That of float and code solutions, and that of velocities.
    """

    states: tuple[State, ...]
    channel: np.ndarray
    factor: np.ndarray
    beta: Array
    drive: Array
    sigma0: Array
    white: Array
    quantization: Array
    white_scale: tuple[float, ...] = (1.0, 1.0, 1.0)
    unfixed_white_scale: float = 1.0
    velocity_white_scale: float = 1.0

    def with_states_of(self, measurement: Measurement) -> "StateLayout":
        """Return the layout with the states of a further measurement, which stand last.

        Parameters
        ----------
        measurement : Measurement
            The measurement.

        Returns
        -------
        StateLayout
            The same otherwise.
        """
        rows = [_own_state(measurement.name, state) for state in measurement.states]
        if not rows:
            return self
        states, *numbers = zip(*rows, strict=True)
        names = ("channel", "factor", "beta", "drive", "sigma0")
        columns: dict[str, Any] = {
            name: np.append(getattr(self, name), np.array(more, dtype=getattr(self, name).dtype))
            for name, more in zip(names, numbers, strict=True)
        }
        return replace(self, states=self.states + states, **columns)

    @cached_property
    def _first(self) -> dict[str, int]:
        """The first state of each group."""
        return {state.group: s for s, state in reversed([*enumerate(self.states)])}

    @property
    def lever(self) -> int:
        """The first state of the lever arm's error, or ABSENT."""
        return self._first.get(LEVER_ARM, ABSENT)

    @property
    def offset(self) -> int:
        """The state of the time offset, or ABSENT."""
        return self._first.get(TIME_OFFSET.group, ABSENT)

    @property
    def rate(self) -> int:
        """The state of the rate of the time offset, or ABSENT."""
        return self._first.get(CLOCK_RATE.group, ABSENT)

    @property
    def read_of_events(self) -> np.ndarray:
        """Rows, among all states, that poses of events depend on: navigation, lever arm, clock."""
        lever = range(self.lever, self.lever + 3) if self.lever >= 0 else ()
        further = [*lever, *(s for s in (self.offset, self.rate) if s >= 0)]
        return np.concatenate([np.arange(N_NAV), N_NAV + np.array(further, dtype=np.int64)])

    @property
    def gm(self) -> int:
        """The first state of the time-correlated error of all fixes, or ABSENT."""
        return self._first.get(CORRELATED_ERROR, ABSENT)

    @property
    def unfixed_gm(self) -> int:
        """The first state of that which float and code solutions have besides, or ABSENT."""
        return self._first.get(UNFIXED_ERROR, ABSENT)

    @property
    def velocity_gm(self) -> int:
        """The first state of that of the velocities, or ABSENT."""
        return self._first.get(VELOCITY_ERROR, ABSENT)

    @property
    def barometer(self) -> int:
        """The state of a barometer's bias, with that of its scale factor behind it, or ABSENT."""
        return self._first.get(BAROMETER_BIAS, ABSENT)

    @property
    def size(self) -> int:
        """Number of all states, the nine of navigation included."""
        return N_NAV + len(self.states)

    def kernel_model(self, block_s: float, aiding_interval_s: float) -> StateModel:
        """Return the arrays as the kernels take them.

        Parameters
        ----------
        block_s : float
            Length of the blocks over which the transition is built as one step, s.
        aiding_interval_s : float
            Interval between fixes, s: quantization enters as white noise of the same variance over
            it.

        Returns
        -------
        StateModel
            The model of these states, with one component of noise.
        """
        white = self.white + 2.0 * self.quantization**2 / aiding_interval_s
        first_gm = np.array([self.gm, self.unfixed_gm, self.velocity_gm])
        of_fixes = self.lever, self.offset, self.rate, first_gm, self.white_scales
        return StateModel(
            *(self.channel, self.factor, self.beta, self.drive[None], white[None], block_s),
            *of_fixes,
            self.barometer,
        )

    @property
    def white_scales(self) -> Array:
        """(3, 3) shares of white errors: of fixed positions, of others, of velocities."""
        unfixed, velocity = (self.unfixed_white_scale,) * 3, (self.velocity_white_scale,) * 3
        return np.array([self.white_scale, unfixed, velocity])

    @property
    def of_fixes(self) -> bool:
        """Whether errors of the fixes are among the states."""
        return max(self.lever, self.offset, self.gm, self.unfixed_gm, self.velocity_gm) != ABSENT

    def channel_sum(self, factor: int = BIAS) -> Array:
        """Return the (6, ns) matrix that adds states up channel by channel.

        Parameters
        ----------
        factor : int
            Those of which factor: BIAS, DRIFT_CODE or TEMPERATURE_CODE.

        Returns
        -------
        Array
            Ones and zeros.
        """
        of_factor = np.flatnonzero(self.factor == factor)
        M = np.zeros((N_CHANNELS, len(self.states)))
        M[self.channel[of_factor], of_factor] = 1.0
        return M


def state_layout(
    model: NoiseModel,
    scale_factor: bool = False,
    misalignment: bool = False,
    fixes: FixErrors = FixErrors(),
    barometer: BarometerErrors | None = None,
    slow: SlowBias | None = None,
    measurements: Sequence[Measurement] = (),
    constants: Collection[State] = (),
) -> StateLayout:
    """Return the states that a noise model asks for, and those that are asked for besides.

    Parameters
    ----------
    model : NoiseModel
        Noise of the six channels.
    scale_factor, misalignment : bool
        Whether each channel has a scale factor, and a misalignment towards either other axis of its
        triad, as states. Their a-priori sigma is the model's, where it has none 1000 ppm and 1
        mrad.
    fixes : FixErrors
        Which errors of the GNSS fixes are states.
    barometer : BarometerErrors, optional
        The errors of a barometer, where there is one.
    slow : SlowBias, optional
        A slow bias of every channel, where there is one.
    measurements : sequence of Measurement
        Measurements with states of their own, which stand last.
    constants : collection of State
        The scale factors and misalignments that are states, all of a sensor where the axis is
        empty; without any every channel has them.

    Returns
    -------
    StateLayout
        The states in their order.
    """

    def chosen(state: State) -> bool:
        return not constants or state in constants or state.of_all_axes in constants

    rows: list[Row] = []
    axes = [*model.gyro, *model.accel]
    for c, axis in enumerate(axes):
        rows += _axis_states(c, axis)
    if slow is not None:
        rows += [_slow_state(c, slow) for c in range(N_CHANNELS)]
    for c, axis in enumerate(axes):
        sensor, letter = CHANNELS[c]
        state = State(SCALE_FACTOR, letter, "", sensor)
        if scale_factor and chosen(state):
            rows.append((state, c, c, 0.0, 0.0, axis.scale_factor or DEFAULT_SCALE))
        if misalignment:
            sigma = axis.misalignment or DEFAULT_SCALE
            for j in range(3 * (c // 3), 3 * (c // 3) + 3):
                state = State(MISALIGNMENT, f"{letter} from {CHANNELS[j][1]}", "rad", sensor)
                if j != c and chosen(state):
                    rows.append((state, c, j, 0.0, 0.0, sigma))
    rows += _fix_states(fixes)
    if barometer is not None:
        rows += _barometer_states(barometer)
    rows += [_own_state(m.name, state) for m in measurements for state in m.states]
    named, channel, factor, beta, drive, sigma0 = zip(*rows, strict=True) if rows else ((),) * 6
    return StateLayout(
        tuple(named),
        np.array(channel, dtype=np.int64),
        np.array(factor, dtype=np.int64),
        np.array(beta, dtype=np.float64),
        np.array(drive, dtype=np.float64),
        np.array(sigma0, dtype=np.float64),
        np.array([a.white_noise**2 for a in axes]),
        np.array([a.quantization for a in axes]),
        white_scale=fixes.white_scale,
        unfixed_white_scale=fixes.unfixed_white_scale,
        velocity_white_scale=fixes.velocity_white_scale,
    )


def _fix_states(fixes: FixErrors) -> list[Row]:
    """Return the states of the errors of the fixes."""
    rows = []
    if fixes.lever_arm_m is not None:
        sigmas = np.broadcast_to(fixes.lever_arm_m, 3).tolist()
        rows += [_constant(*of_axis) for of_axis in zip(OF_LEVER_ARM, sigmas, strict=True)]
    if fixes.time_offset_s is not None:
        rows.append(_constant(TIME_OFFSET, fixes.time_offset_s))
        if fixes.clock_rate is not None:
            rows.append(_constant(CLOCK_RATE, fixes.clock_rate))
    if fixes.gm_sigma is not None:
        rows += _gauss_markov(CORRELATED_ERROR, fixes.gm_sigma, fixes.correlation_time_s)
    if (unfixed := fixes.unfixed_gm_sigma) is not None:
        time_s = fixes.unfixed_correlation_time_s
        rows += _gauss_markov(UNFIXED_ERROR, (unfixed,) * 3, time_s)
    if (velocity := fixes.velocity_gm_sigma_mps) is not None:
        time_s = fixes.velocity_correlation_time_s
        rows += _gauss_markov(VELOCITY_ERROR, (velocity,) * 3, time_s)
    return rows


def _constant(state: State, sigma: float) -> Row:
    """Return a constant that enters a measurement of its own alone."""
    return state, 0, AIDING_ERROR, 0.0, 0.0, sigma


def _barometer_states(errors: BarometerErrors) -> list[Row]:
    """Return bias and scale factor of a barometer."""
    bias = State(BAROMETER_BIAS, unit="m")
    return [
        (bias, 0, AIDING_ERROR, 0.0, errors.bias_walk**2, errors.bias_m),
        _constant(State("barometer scale factor"), errors.scale_factor),
    ]


def _own_state(measurement: str, quantity: OwnState) -> Row:
    """Return a state of a measurement given by its prediction."""
    state = State(measurement, quantity.name, quantity.unit)
    if quantity.correlation_time_s is None:
        return state, 0, AIDING_ERROR, 0.0, quantity.walk**2, quantity.sigma
    beta = 1.0 / quantity.correlation_time_s
    return state, 0, AIDING_ERROR, beta, 2.0 * beta * quantity.sigma**2, quantity.sigma


def _gauss_markov(group: str, sigma: tuple[float, ...], time_s: float) -> list[Row]:
    """Return a time-correlated error as three Gauss-Markov states."""
    beta, unit = 1.0 / time_s, "m/s" if group == VELOCITY_ERROR else ""
    return [
        (State(group, axis, unit), 0, AIDING_ERROR, beta, 2.0 * beta * s**2, s)
        for axis, s in zip(("north", "east", "down"), sigma, strict=True)
    ]


def _slow_state(c: int, slow: SlowBias) -> Row:
    """Return the slow bias of channel c."""
    sensor, letter = CHANNELS[c]
    state = State(SLOW_STATE, letter, UNIT_OF_SENSOR[sensor], sensor)
    if slow.course == "decay":
        return state, c, BIAS, 1.0 / slow.time_s, 0.0, SLOW_BIAS[sensor]
    if slow.course == "temperature":
        return state, c, TEMPERATURE_CODE, 0.0, 0.0, SLOW_BIAS[sensor]
    state = State(SLOW_STATE, letter, f"{UNIT_OF_SENSOR[sensor]}/s", sensor)
    return state, c, DRIFT_CODE, 0.0, 0.0, SLOW_BIAS[sensor] / slow.time_s


def _axis_states(c: int, axis: AxisNoise) -> list[Row]:
    """Return the bias-like states of channel c."""
    sensor, letter = CHANNELS[c]
    unit, rows = UNIT_OF_SENSOR[sensor], []
    if axis.turn_on_bias > 0.0 or axis.random_walk > 0.0:
        bias = State("bias", letter, unit, sensor)
        rows.append((bias, c, BIAS, 0.0, axis.random_walk**2, axis.turn_on_bias))
    if axis.drift > 0.0:
        drift = State("drift", letter, f"{unit}/s", sensor)
        rows.append((drift, c, DRIFT_CODE, 0.0, 0.0, axis.drift))
    for k, gm in enumerate(axis.gauss_markov, start=1):
        process = State(f"GM {k}", letter, unit, sensor)
        rows.append((process, c, BIAS, 1.0 / gm.correlation_time_s, gm.driving_noise**2, gm.sigma))
    return rows
