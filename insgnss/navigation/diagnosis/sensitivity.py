"""What constants that the filter takes as known, or nearly, do to its innovations.

A constant d that the filter knows nothing of (a scale factor, say) leaves errors e = U d in its
states. From epoch to epoch, with the gains K that the filter has without it,

    U <- Phi U + G,     V = H U + B,     U <- U - K V                                          (Y.1)

and the innovations y of variance S have the mean V d. G and B are what the constant adds to
transition and measurement directly: the column of the state that acts in the same way, times a
measured value. A scale factor or misalignment of channel c towards channel f acts like the bias of
c times what f measures, the rate of a time offset like the offset times the time that has gone by,
a step of a clock like the offset from some instant on.
A constant that is a state already is followed from U = 1 at that state on: by how much it is off
from the beginning, beyond what its a-priori sigma allows for. Over all innovations

    J = sum V' V / S,     j = sum V' y / S                                                     (Y.2)

are the information and the right-hand side of d. Of a state with the a-priori variance s^2 they are
those beside it. Without it, with s^2 in the diagonal of s2 and zeros for what is no state,

    I = J (1 - s2 J)^-1,     b = (1 + I s2) j                                                  (Y.3)

Innovations that depend on d linearly give the same as a filter that has every constant as a state
with a wide sigma (Friedland 1969), and cost a tenth of it: the covariance, which does not depend on
them, is that of the filter without.

B. Friedland, "Treatment of bias in recursive filtering", IEEE Trans. Automatic Control 14 (1969).
"""

from dataclasses import dataclass

import numpy as np

from ...records import Array
from ...records.states import State
from ..filter.codes import ABSENT, AIDING_ERROR, BIAS, DRIFT_CODE, N_CHANNELS, N_NAV
from ..filter.kernels.records import Epochs, FilterHistory, IntegrationIntervals
from ..filter.layout import StateLayout
from ..filter.problem import EstimationProblem
from ._kernels import follow_constants

# between epochs: over more the mean of a product is not the product of means
LONGEST_INTERVAL_S = 0.21


@dataclass(frozen=True)
class Constants:
    """Constants whose effect is followed beside the filter.

    Parameters
    ----------
    states : tuple of State
        (c,) what they are.
    state : ndarray
        (c,) the state of the filter that it is, counted from the first of navigation, or ABSENT.
    like : ndarray
        (c,) of another one, the state that acts in the same way, else ABSENT.
    factor : ndarray
        (c,) and what it is multiplied with: a channel, `codes.DRIFT`, the time since the start, or
        `codes.AIDING_ERROR`, nothing.
    stated : Array
        (c,) the a-priori sigma of those that are states, else 0.
    wide : Array
        (c,) the wide one under which they are suspected.
    since : Array, optional
        (c,) s since the start, from which on one with an AIDING_ERROR acts.
    jump : Array, optional
        (c, 9) errors of navigation that it leaves besides, at the first epoch from then on.
    """

    states: tuple[State, ...]
    state: np.ndarray
    like: np.ndarray
    factor: np.ndarray
    stated: Array
    wide: Array
    since: Array | None = None
    jump: Array | None = None

    @classmethod
    def steps(cls, layout: StateLayout, since: Array, jump: Array, wide_s: float) -> "Constants":
        """Return steps of the time offset of the fixes, one at each of some instants.

        Parameters
        ----------
        layout : StateLayout
            States with the time offset among them.
        since : Array
            (c,) s since the start.
        jump : Array
            (c, 9) errors of navigation that a step of a second leaves at its instant.
        wide_s : float
            A-priori sigma of a step, s.

        Returns
        -------
        Constants
            c of them.
        """
        none = np.full(since.size, ABSENT)
        like, factor = np.full_like(none, N_NAV + layout.offset), np.full_like(none, AIDING_ERROR)
        steps = tuple(State(f"step at {time:.2f} s", unit="s") for time in since)
        zero, wide = np.zeros(since.size), np.full(since.size, wide_s)
        return cls(steps, none, like, factor, zero, wide, since, jump)

    @classmethod
    def of(cls, own: StateLayout, wide: StateLayout, states: list[int]) -> "Constants | None":
        """Return the constants of a wide layout as the filter of a narrower one follows them.

        Parameters
        ----------
        own : StateLayout
            The states of the filter.
        wide : StateLayout
            A layout with the constants among its states.
        states : list of int
            Which states of it they are.

        Returns
        -------
        Constants or None
            None where the filter has no state that acts like one of them.
        """
        rows: list[tuple[int, int, int, float]] = []  # state, like, factor, stated
        for s in states:
            constant, channel = wide.states[s], int(wide.channel[s])
            if constant in own.states:
                k = own.states.index(constant)
                rows.append((N_NAV + k, ABSENT, ABSENT, float(own.sigma0[k])))
                continue
            if s == wide.rate:
                acts_like, times = own.offset, DRIFT_CODE
            else:
                acts_like, times = _bias_of(own, channel), int(wide.factor[s])
            if acts_like == ABSENT or (times < 0 and times != DRIFT_CODE):
                return None
            rows.append((ABSENT, N_NAV + acts_like, times, 0.0))
        constants = tuple(wide.states[s] for s in states)
        state, like, factor, stated = (np.array(column) for column in zip(*rows, strict=True))
        return cls(constants, state, like, factor, stated, wide.sigma0[states])


def _bias_of(layout: StateLayout, channel: int) -> int:
    """Return a state that is the constant bias of a channel, or ABSENT."""
    is_bias = (layout.channel == channel) & (layout.factor == BIAS) & (layout.beta == 0.0)
    return int(np.argmax(is_bias)) if is_bias.any() else ABSENT


@dataclass(frozen=True)
class Sensitivity:
    """What the innovations of a pass say of constants (Y.2).

    Parameters
    ----------
    problem : EstimationProblem
        The flight.
    constants : Constants
        The c constants.
    errors : Array
        (n, c) U after the latest epoch.
    information, vector : Array
        (c, c) J and (c,) j up to it.
    """

    problem: EstimationProblem
    constants: Constants
    errors: Array
    information: Array
    vector: Array

    @classmethod
    def before(cls, problem: EstimationProblem, constants: Constants) -> "Sensitivity":
        """Return that before the first epoch."""
        count = len(constants.states)
        errors = np.zeros((problem.layout.size, count))
        of_states = np.flatnonzero(constants.state != ABSENT)
        errors[constants.state[of_states], of_states] = 1.0
        return cls(problem, constants, errors, np.zeros((count, count)), np.zeros(count))

    def through(
        self, intervals: IntegrationIntervals, epochs: Epochs, history: FilterHistory, begin: int
    ) -> None:
        """Go on over the epochs of a block: a `navigation.filter.blocks.Follower`.

        Parameters
        ----------
        intervals : IntegrationIntervals
            The body increments.
        epochs : Epochs
            The epochs.
        history : FilterHistory
            What the forward pass left of them.
        begin : int
            The first of them to be passed.
        """
        h, constants, count = history, self.constants, self.vector.size
        measured = epochs.stop, epochs.time, epochs.rate
        records = h.F, h.D, h.H, h.K, h.S, h.y, h.used
        sums = self.errors, self.information, self.vector
        sizes = (N_NAV, count), (3, count), (3, count), N_CHANNELS
        scratch = tuple(np.empty(size) for size in sizes)
        since = np.zeros(count) if constants.since is None else constants.since
        jump = np.zeros((count, N_NAV)) if constants.jump is None else constants.jump
        acts = constants.like, constants.factor, since, jump
        follow_constants(*intervals, *measured, *records, begin, *acts, *sums, *scratch)

    def of_the_data(self) -> tuple[Array, Array]:
        """Return what the data alone say of the constants (Y.3).

        Returns
        -------
        information, vector : Array
            (c, c) I and (c,) b, in units of the wide sigmas.
        """
        s2, wide = np.diag(self.constants.stated**2), self.constants.wide
        one = np.eye(self.vector.size)
        information = np.linalg.solve((one - s2 @ self.information).T, self.information).T
        information = 0.5 * (information + information.T)
        vector = self.vector + information @ s2 @ self.vector
        return information * np.outer(wide, wide), vector * wide
