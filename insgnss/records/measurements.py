"""A measurement of one's own: times, values, covariance, and the prediction of the values.

The prediction is a function of the motion and of states of the measurement itself. It takes all
instants at once, so that no Python runs inside the filter's loop; the filter sees its differences.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..base.errors import InputError
from ..geodesy.frames import LocalFrame
from ..geodesy.rotation import rpy_from_rotation
from ._checked import Array, freeze_field, increasing

NOT_SI = {
    **dict.fromkeys(("deg", "degree", "degrees", "°", "mrad", "gon"), "rad"),
    **dict.fromkeys(("deg/s", "deg/h"), "rad/s"),
    **dict.fromkeys(("mm", "cm", "km", "ft"), "m"),
    **dict.fromkeys(("km/h", "kn", "cm/s", "mm/s"), "m/s"),
}
"""Units that a state is given in by mistake, with those that it has to be in."""
MOST_VALUES = 3  # at one instant: the filter takes its measurements as triples


@dataclass(frozen=True)
class OwnState:
    """A quantity that enters one measurement alone and is estimated with the flight.

    It starts at zero, so that `predict` adds or multiplies what is known of it.

    Parameters
    ----------
    name : str
        What it is, such as "offset".
    sigma : float
        A-priori standard deviation, in `unit`.
    unit : str
        SI unit; empty of a ratio.
    walk : float
        Random walk, unit/sqrt(s); zero of a constant.
    correlation_time_s : float, optional
        Correlation time of a Gauss-Markov process with the stationary standard deviation `sigma`.

    Raises
    ------
    InputError
        For numbers that cannot be.
    """

    name: str
    sigma: float
    unit: str = ""
    walk: float = 0.0
    correlation_time_s: float | None = None

    def __post_init__(self) -> None:
        time_s = self.correlation_time_s
        for key, value, low in (
            ("sigma", self.sigma, np.nextafter(0.0, 1.0)),
            ("walk", self.walk, 0.0),
            ("correlation_time_s", 1.0 if time_s is None else time_s, np.nextafter(0.0, 1.0)),
        ):
            if not low <= value < np.inf:
                limit = "above 0" if low else "0 or more"
                raise InputError(f"OwnState {self.name!r}: {key} = {value:g}, expected {limit}")
        if self.unit in NOT_SI:
            problem = f"unit {self.unit!r} is not an SI unit; give its sigma in {NOT_SI[self.unit]}"
            raise InputError(f"OwnState {self.name!r}: {problem}")
        if time_s is not None and self.walk:
            raise InputError(
                f"OwnState {self.name!r}: walk and correlation_time_s exclude each other; give one"
            )


def _read_only(array: Array) -> Array:
    """Return a view that nobody can write to: predictions share what is worked out once."""
    view = np.asarray(array).view()
    view.flags.writeable = False
    return view


@dataclass(frozen=True, eq=False)
class Motion:
    """The motion of the IMU at k instants, as `Measurement.predict` sees it; read only.

    Parameters
    ----------
    time : Array
        (k,) s, GPST.
    position, velocity : Array
        (k, 3) m and m/s, in the local frame: axes fixed to the Earth at the origin of `frame`.
    C_lb : Array
        (k, 3, 3) body axes (forward, right, down) to the local frame.
    rate : Array
        (k, 3) rad/s, angular rate against the Earth, body axes.
    gyro_bias : Array
        (k, 3) rad/s, estimated bias of the gyros, body axes.
    frame : LocalFrame
        The local frame.
    """

    time: Array
    position: Array
    velocity: Array
    C_lb: Array
    rate: Array
    gyro_bias: Array
    frame: LocalFrame

    def __post_init__(self) -> None:
        for each in fields(self)[:-1]:
            object.__setattr__(self, each.name, _read_only(getattr(self, each.name)))

    @cached_property
    def geodetic(self) -> tuple[Array, Array, Array]:
        """Latitude and longitude, rad, and ellipsoidal height, m, (k,) each."""
        return self.frame.geodetic_from_position(self.position)

    @cached_property
    def C_nl(self) -> Array:
        """(k, 3, 3), local frame to north, east, down at the point."""
        lat, lon, _ = self.geodetic
        return _read_only(np.swapaxes(self.frame.C_ln(lat, lon), -1, -2))

    @cached_property
    def C_nb(self) -> Array:
        """(k, 3, 3), body axes to north, east, down at the point."""
        return _read_only(self.C_nl @ self.C_lb)

    @cached_property
    def velocity_ned(self) -> Array:
        """(k, 3) m/s, north, east, down at the point."""
        return _read_only(np.einsum("kij,kj->ki", self.C_nl, self.velocity))

    @cached_property
    def velocity_body(self) -> Array:
        """(k, 3) m/s, forward, right, down."""
        return _read_only(np.einsum("kji,kj->ki", self.C_lb, self.velocity))

    @cached_property
    def roll_pitch_heading(self) -> Array:
        """(k, 3) rad."""
        return _read_only(rpy_from_rotation(self.C_nb))

    def changed(self, **arrays: Any) -> "Motion":
        """Return the motion with other fields, and of the rest what is worked out already.

        Parameters
        ----------
        **arrays : Array
            Fields of `Motion`.

        Returns
        -------
        Motion
            The same otherwise.
        """
        motion = replace(self, **arrays)
        for name, follows_from in DERIVED.items():
            if name in self.__dict__ and arrays.keys().isdisjoint(follows_from):
                motion.__dict__[name] = self.__dict__[name]
        return motion


DERIVED = {
    "geodetic": ("position",),
    "C_nl": ("position",),
    "C_nb": ("position", "C_lb"),
    "velocity_ned": ("position", "velocity"),
    "velocity_body": ("C_lb", "velocity"),
    "roll_pitch_heading": ("position", "C_lb"),
}
"""What `Motion` works out, and from which of its fields."""


Predict = Callable[[Motion, Array], Array]
"""Takes the motion at k instants and the own states (k, q), returns values (k, c) or (k,)."""
N_ERRORS = 12  # error states of position, velocity, attitude and gyro biases: four triples


@dataclass(frozen=True, eq=False, repr=False)
class Measurement:
    """Measured values that filter and smoother use beside the fixes.

    Parameters
    ----------
    name : str
        What measures, such as "inclinometer"; no two measurements of a flight share it.
    time : Array
        (k,) increasing, s, GPST.
    values : Array
        (k, c) of up to three components, or (k,) of one.
    sigma : Array
        Standard deviation of their white errors: one number, or (c,), or (k, c); or (k, c, c)
        covariances.
    predict : callable
        ``predict(motion, states)`` returns what should be measured at all instants of `motion`
        (`Motion`); `states` (k, q) are the values of the own states there.
    states : tuple of OwnState
        Errors of the measurement itself that are estimated.
    gate_sigma : float
        Values further from their prediction, in standard deviations, are left out.
    period : float, optional
        Values that differ by it are the same: 2 pi of an angle in rad.
    derivative : callable, optional
        Takes what `predict` takes; returns (k, c, 12 + q), the derivatives of the values by the
        errors of position, velocity and attitude (m, m/s and the small rotation in rad that is
        applied from the left to `C_lb`), of the biases of the gyros and of the own states. Without
        it differences of `predict` are taken.

    Raises
    ------
    InputError
        For shapes that do not fit each other, and values that cannot be.
    """

    name: str
    time: Array
    values: Array
    sigma: Any
    predict: Predict
    states: tuple[OwnState, ...] = ()
    gate_sigma: float = 5.0
    period: float | None = None
    derivative: Predict | None = None
    cov: Array = field(init=False)

    def __post_init__(self) -> None:
        set_field = object.__setattr__
        if not (self.name and isinstance(self.name, str)):
            raise InputError(f"Measurement.name: {self.name!r}, expected a text that names it")
        values = np.asarray(self.values)
        set_field(self, "values", values[:, None] if values.ndim == 1 else values)
        time = freeze_field(self, "time", (None,))
        increasing(self, time)
        components = np.shape(self.values)[-1] if np.ndim(self.values) else 0
        freeze_field(self, "values", (time.size, components))
        if not 1 <= components <= MOST_VALUES:
            problem = f"{components} values at an instant, limit {MOST_VALUES}"
            raise self._refusal(f"{problem}; split it into several")
        set_field(self, "cov", self._covariance(time.size, components))
        freeze_field(self, "cov", (time.size, components, components))
        positive = np.linalg.eigvalsh(self.cov)[:, 0] > 0.0
        if not positive.all():
            row = int(np.argmin(positive))
            raise self._refusal(
                f"sigma in row {row}, time {time[row]:.6f} s, makes no positive covariance;"
                " expected standard deviations above 0"
            )
        if not self.gate_sigma > 0.0 or (self.period is not None and not self.period > 0.0):
            numbers = f"gate_sigma = {self.gate_sigma:g} and period = {self.period}"
            raise self._refusal(f"{numbers}, expected numbers above 0")
        set_field(self, "states", tuple(self.states))

    def _refusal(self, problem: str) -> InputError:
        return InputError(f"Measurement {self.name!r}: {problem}")

    def _covariance(self, k: int, c: int) -> Array:
        """Return the covariances (k, c, c) that `sigma` states."""
        sigma = np.asarray(self.sigma, dtype=np.float64)
        if sigma.shape == (k, c, c):
            return sigma
        if sigma.shape == (k,) and c == 1:
            sigma = sigma[:, None]
        if sigma.shape not in ((), (c,), (k, c)):
            expected = f"one number, ({c},), ({k}, {c}) or covariances ({k}, {c}, {c})"
            raise self._refusal(f"sigma has shape {sigma.shape}, expected {expected}")
        if not (sigma > 0.0).all():
            raise self._refusal(f"sigma = {sigma.min():g}, expected values above 0")
        return np.broadcast_to(sigma, (k, c))[:, :, None] ** 2 * np.eye(c)

    def __repr__(self) -> str:
        """Return name, number of instants and components in one line."""
        return f"<Measurement {self.name!r}, {self.time.size} x {self.values.shape[1]}>"

    def predicted(self, motion: Motion, states: Array) -> Array:
        """Return the prediction as an array (k, c).

        Parameters
        ----------
        motion : Motion
            The motion at k instants.
        states : Array
            (k, q) own states.

        Returns
        -------
        Array
            (k, c), checked.

        Raises
        ------
        InputError
            Where `predict` returns another shape, or values that are not finite.
        """
        shape = (motion.time.size, self.values.shape[1])
        return self._returned("predict", self.predict, motion, states, shape)

    def derived(self, motion: Motion, states: Array) -> Array | None:
        """Return the derivatives that `derivative` gives, None without it.

        Parameters
        ----------
        motion : Motion
            The motion at k instants.
        states : Array
            (k, q) own states.

        Returns
        -------
        Array or None
            (k, c, 12 + q), checked.

        Raises
        ------
        InputError
            Where `derivative` returns another shape, or values that are not finite.
        """
        if self.derivative is None:
            return None
        shape = (motion.time.size, self.values.shape[1], N_ERRORS + len(self.states))
        return self._returned("derivative", self.derivative, motion, states, shape)

    def _returned(
        self, name: str, function: Predict, motion: Motion, states: Array, shape: tuple[int, ...]
    ) -> Array:
        """Return what a function of the user returns, checked."""
        out = np.asarray(function(motion, _read_only(states)), dtype=np.float64)
        out = out[:, None] if out.ndim == len(shape) - 1 and shape[1] == 1 else out
        if out.shape != shape:
            raise self._refusal(f"{name} returned shape {out.shape}, expected {shape}")
        finite = np.isfinite(out).all(axis=tuple(range(1, out.ndim)))
        if not finite.all():
            row = int(np.argmin(finite))
            problem = f"{name} returned {out[row]} at {motion.time[row]:.6f} s"
            raise self._refusal(f"{problem}, expected finite values")
        return out

    def minus(self, rows: np.ndarray, prediction: Array) -> Array:
        """Return measured minus predicted values of some rows, an angle on the shorter way round.

        Parameters
        ----------
        rows : ndarray
            (k,) rows of `values`.
        prediction : Array
            (k, c) predicted values there.

        Returns
        -------
        Array
            (k, c).
        """
        return self.wrapped(self.values[rows] - prediction)

    def wrapped(self, difference: Array) -> Array:
        """Return differences of values, those of an angle on the shorter way round.

        Parameters
        ----------
        difference : Array
            Any shape.

        Returns
        -------
        Array
            The same shape.
        """
        if self.period is None:
            return difference
        return difference - self.period * np.rint(difference / self.period)
