"""One flight's estimation problem, the state it starts from, and problems cut out of others."""

from dataclasses import dataclass, fields, replace

import numpy as np

from ...geodesy.frames import LocalFrame
from ...records import Array, Increments
from ...records.measurements import Measurement
from .codes import ABSENT, DRIFT_CODE, N_KINDS, TEMPERATURE_CODE
from .kernels.records import Epochs
from .layout import StateLayout

LINEARISED_FIELDS = ("linear_about", "linear_H", "linear_residual", "linear_cov")
"""Of `Epochs`, which differ from one linearisation to the next; the last three of each row."""


@dataclass(frozen=True)
class MeasuredRows:
    """A measurement that is given by its prediction, and which of its rows a problem holds.

    Parameters
    ----------
    measurement : Measurement
        The measurement.
    rows, at_epoch : ndarray
        (k,) its rows, and the epochs of these.
    states : slice
        Its own states among those of all measurements, which are the last of the layout.
    """

    measurement: Measurement
    rows: np.ndarray
    at_epoch: np.ndarray
    states: slice


@dataclass(frozen=True)
class EstimationProblem:
    """Everything that one flight's estimation stands on.

    Parameters
    ----------
    inc : Increments
        Body increments between the marks; every mark is an epoch.
    epochs : Epochs
        What is measured at each of the m epochs.
    frame : LocalFrame
        The local frame l in which everything is estimated.
    layout : StateLayout
        The error states behind those of navigation.
    antenna_lever_b : Array
        (3,) m, from the IMU to the antenna's phase centre, body axes.
    gate : float
        Normalised innovation squared (NIS) above which a triple is rejected.
    aiding_interval_s : float
        Usual interval between fixes, s.
    backward : bool
        The increments and fixes run against time (`navigation.align.initial`), so that the Earth
        turns the other way.
    huber_threshold : float
        NIS above which a triple is taken with a larger covariance (K.11); infinite for never.
    event_chain : bool
        Whether the solution is to give the covariance between any two camera events (B.8).
    measurements : tuple of MeasuredRows
        What is linearised about each solution (`linearised`).
    gates_of_measurements : tuple of float
        NIS above which each linearised measurement (K.13) of the epochs is rejected.
    """

    inc: Increments
    epochs: Epochs
    frame: LocalFrame
    layout: StateLayout
    antenna_lever_b: Array
    gate: float
    aiding_interval_s: float
    backward: bool = False
    huber_threshold: float = np.inf
    event_chain: bool = True
    measurements: tuple[MeasuredRows, ...] = ()
    gates_of_measurements: tuple[float, ...] = ()

    @property
    def gates(self) -> Array:
        """NIS above which each kind is rejected, those of linearised measurements last."""
        return np.array([float(self.gate)] * N_KINDS + list(self.gates_of_measurements))

    @property
    def linearised(self) -> bool:
        """Whether a pass sees all measurements, which are linearised about a solution."""
        rows = any(measured.rows.size for measured in self.measurements)
        return not rows or bool(self.epochs.linear_cov.any())

    def same_otherwise(self, later: "EstimationProblem") -> bool:
        """Return whether another problem differs by the linearisation of measurements at most.

        Parameters
        ----------
        later : EstimationProblem
            A problem that `dataclasses.replace` may have made of this one.

        Returns
        -------
        bool
            False where any other array is another object.
        """
        names = [each.name for each in fields(self) if each.name not in ("epochs", "measurements")]
        of_epochs = [name for name in Epochs._fields if name not in LINEARISED_FIELDS]
        return all(
            getattr(mine, name) is getattr(theirs, name)
            for mine, theirs, compared in (
                (self, later, names),
                (self.epochs, later.epochs, of_epochs),
            )
            for name in compared
        )

    @property
    def without_measurements(self) -> "EstimationProblem":
        """The problem without what is linearised, whose own states then stay as they start."""
        epochs = self.epochs
        none = {
            name: np.zeros((epochs.stop.size, 0, *getattr(epochs, name).shape[2:]))
            for name in LINEARISED_FIELDS[1:]
        }
        return replace(
            self, epochs=epochs._replace(**none), measurements=(), gates_of_measurements=()
        )


@dataclass(frozen=True)
class InitialState:
    """The state at the first epoch.

    Parameters
    ----------
    nav : Array
        (10,) nominal position (m) and velocity (m/s) in l, quaternion q_lb (w, x, y, z).
    x : Array
        (ns,) nominal values of the other states.
    mean : Array
        (n,) a-priori mean of the errors about the nominal.
    P : Array
        (n, n) a-priori covariance of the errors.
    """

    nav: Array
    x: Array
    mean: Array
    P: Array


def channel_biases(problem: EstimationProblem, x: Array, index: np.ndarray | slice) -> Array:
    """Return what the bias-like states make of the channels' biases at some epochs.

    Parameters
    ----------
    problem : EstimationProblem
        The problem.
    x : ndarray
        (k, ns) values of the states behind those of navigation.
    index : ndarray or slice
        The k epochs.

    Returns
    -------
    Array
        (k, 6) rad/s and m/s^2 in body axes.
    """
    M = problem.layout.channel_sum
    biases = x @ M().T
    for factor, course in bias_courses(problem).items():
        biases += course[index, None] * (x @ M(factor).T)
    return np.ascontiguousarray(biases)


def bias_courses(problem: EstimationProblem) -> dict[int, Array]:
    """Return what the states that follow a course are multiplied with.

    Parameters
    ----------
    problem : EstimationProblem
        The problem.

    Returns
    -------
    dict of int to Array
        (m,) of each such factor of its states.
    """
    courses = {DRIFT_CODE: problem.epochs.time, TEMPERATURE_CODE: problem.epochs.temperature}
    return {factor: x for factor, x in courses.items() if (problem.layout.factor == factor).any()}


def sub_problem(problem: EstimationProblem, first: int, last: int) -> EstimationProblem:
    """Return the epochs first..last of a problem as a problem of their own, without camera events.

    Parameters
    ----------
    problem : EstimationProblem
        The whole problem.
    first, last : int
        The first and the last epoch, both included.

    Returns
    -------
    EstimationProblem
        The part, whose time counts from its own first epoch.
    """
    index = np.arange(first, last + 1)
    inc, s0, s1 = problem.inc, problem.epochs.stop[first], problem.epochs.stop[last]
    increments = Increments(
        inc.dt[s0:s1],
        inc.dtheta[s0:s1],
        inc.dvel[s0:s1],
        inc.marks[index],
        problem.epochs.stop[index] - s0,
        inc.rate[index],
        inc.nominal_s,
    )
    return with_epochs(problem, index, increments)


def with_epochs(
    problem: EstimationProblem, index: np.ndarray, inc: Increments
) -> EstimationProblem:
    """Return the problem with some of its epochs over other increments, without camera events.

    Parameters
    ----------
    problem : EstimationProblem
        The problem whose epochs are taken.
    index : ndarray
        (k,) the epochs to take, in the order of the marks of `inc`.
    inc : Increments
        The increments between these epochs, with k marks.

    Returns
    -------
    EstimationProblem
        The problem of the k epochs, whose measurements stay as they are linearised.
    """
    ep = problem.epochs
    names = ("stop", "time", "rate", "event")
    taken = {name: getattr(ep, name)[index] for name in ep._fields if name not in names}
    event = np.full(index.size, ABSENT, dtype=np.int64)
    epochs = ep._replace(
        stop=inc.stop, time=inc.marks - inc.marks[0], rate=inc.rate, event=event, **taken
    )
    return replace(problem, inc=inc, epochs=epochs, measurements=())
