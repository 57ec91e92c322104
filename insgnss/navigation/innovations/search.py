"""The maximum of the likelihood of the innovations over factors of noise.

With theta the logarithms of all factors, and g, A gradient and expected second derivative of
-2 log L (`likelihood`), the maximum is searched by scoring,

    theta <- theta + l s,     (A + k I) s = -g,     within the factors of `RANGE`,
    cov theta = 2 A^-1 at the maximum                                                          (N.1)

from the best of a few starts. Where the model of the noise is wrong, the curvature along a step is
not s' A s but c times as large: the gain of a step l s tells c, and the next has l = 1 / c where c
is above one,

    gain of l s = -l s' g - c l^2 s' A s / 2                                                   (N.2)
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...base.advance import converged_share, share, through, within
from ...records import Array
from .likelihood import IMU_PARAMETERS, Evaluated, LinearSegment, evaluate

# a fix is not trusted to less than a fifth of its sigma
RANGE, RANGE_OF_FIXES = (1.0 / 300.0, 300.0), (0.2, 30.0)
# of a search; its last step and gain; and its longest step, a factor of e (chosen)
SEARCH_STEPS, LAST_CHANGE, LONGEST_STEP = 40, 1e-4, 1.0
# of a step, l of (N.1): the shortest that is tried (chosen), and the whole
STEP_BOUNDS = (0.01, 1.0)
HOPE = 10.0  # gains of the last step, as many as a search may still win (chosen)
LAST_GAIN = 0.01  # gain of a step in -2 log L that ends a diagnosis: a tenth of a factor's sigma
# of the information: standard deviations of a logarithm of 1400 and 45 000
LEAST_INFORMATION, RIDGE = 1e-6, 1e-9
STARTED = 0.3  # of the search: by then the best of the starts is known
STARTS = (0.0, 1.0, -1.0)  # of the logarithms of the IMU's factors


@dataclass(frozen=True)
class Maximum:
    """The likelihood at its maximum over some factors.

    Parameters
    ----------
    theta : ndarray, (p,)
        Logarithms of the factors.
    evaluated : Evaluated
        The likelihood there.
    """

    theta: Array
    evaluated: Evaluated

    def spread(self, free: np.ndarray) -> tuple[Array, Array]:
        """Return standard deviations (p,) of theta and correlations (p, p).

        A standard deviation is infinite where nothing determines the parameter, 0 where it is held.
        """
        A = self.evaluated.information[np.ix_(free, free)]
        determined = np.diag(A) > LEAST_INFORMATION
        index = np.flatnonzero(free)[determined]
        cov = 2.0 * np.linalg.inv(A[np.ix_(determined, determined)] + RIDGE * np.eye(index.size))
        sigma, correlation = np.where(free, np.inf, 0.0), np.eye(free.size)
        sigma[index] = np.sqrt(np.diag(cov))
        correlation[np.ix_(index, index)] = cov / np.outer(sigma[index], sigma[index])
        return sigma, correlation


@dataclass
class Search:
    """Maxima of the likelihood of `segments` over some of the parameters `names`.

    Parameters
    ----------
    segments : sequence of LinearSegment
        The segments, with `names` as their parameters.
    names : tuple of str
        The parameters.
    progress : callable
        Receives the name of each step.
    range_of_fixes : tuple of float
        Bounds of the factors of the fixes.
    gain : float
        Gain of a step in -2 log L below which it was the last.
    """

    segments: Sequence[LinearSegment]
    names: tuple[str, ...]
    progress: Callable[[str], None]
    range_of_fixes: tuple[float, float] = RANGE_OF_FIXES
    gain: float = LAST_CHANGE

    def maximum(
        self, free: np.ndarray, starts: Sequence[float] = STARTS, to_beat: float = np.inf
    ) -> Maximum:
        """Maximise over some parameters, the others at one, from the best start.

        Parameters
        ----------
        free : ndarray of bool, (p,)
            The parameters that vary.
        starts : sequence of float
            Logarithms of the IMU's factors from which it is looked for.
        to_beat : float
            Value of -2 log L at which another search arrived.

        Returns
        -------
        Maximum
            The maximum; where it stays above `to_beat` in any case, a point on the way to it.
        """
        moved = np.array([name in IMU_PARAMETERS for name in self.names]) & free
        thetas = [np.where(moved, s, 0.0) for s in (starts if moved.any() else STARTS[:1])]
        count = int(np.count_nonzero(free))
        self.progress(f"likelihood of the innovations, {count} factor{'s' if count > 1 else ''}")
        with within(0.0, STARTED):
            first = [
                Maximum(theta, evaluate(self.segments, theta, free)) for theta in through(thetas)
            ]
        with within(STARTED, 1.0):
            return self._climb(min(first, key=lambda m: m.evaluated.cost), free, to_beat)

    def _climb(self, maximum: Maximum, free: np.ndarray, to_beat: float) -> Maximum:
        """Climb to the maximum by (N.1)."""
        low, high = np.log(
            [RANGE if name in IMU_PARAMETERS else self.range_of_fixes for name in self.names]
        ).T
        length, longest = 1.0, 0.0
        for _ in range(SEARCH_STEPS):
            theta, g = maximum.theta, maximum.evaluated.gradient
            active = free & ~((theta <= low) & (g > 0.0)) & ~((theta >= high) & (g < 0.0))
            if not active.any():
                break
            A = maximum.evaluated.information[np.ix_(active, active)]
            moved = theta.copy()
            moved[active] += np.clip(length * _step(A, g[active]), -LONGEST_STEP, LONGEST_STEP)
            moved = np.clip(moved, low, high)
            moved_maximum = Maximum(moved, evaluate(self.segments, moved, free))
            size = float(np.abs(moved - theta).max())
            longest = max(longest, size)
            share(converged_share(size, longest, LAST_CHANGE))
            gain, step = (
                maximum.evaluated.cost - moved_maximum.evaluated.cost,
                (moved - theta)[active],
            )
            if gain >= 0.0:
                maximum = moved_maximum
            if (
                size < LAST_CHANGE
                or 0.0 <= gain < self.gain
                or (gain < 0.0 and length == STEP_BOUNDS[0])
            ):
                break
            if maximum.evaluated.cost - HOPE * abs(gain) > to_beat:
                break
            curvature = 2.0 * float(-step @ g[active] - gain) / max(float(step @ A @ step), 1e-300)
            length = float(np.clip(1.0 / max(curvature, 1e-3), *STEP_BOUNDS))
        return maximum


def _step(A: Array, g: Array) -> Array:
    """Solve (A + k I) s = -g with the least k that leaves no component beyond the longest step.

    What the data determine moves as without k, what they hardly determine no further than that.
    """
    ridge = LEAST_INFORMATION
    while np.abs(step := np.linalg.solve(A + ridge * np.eye(len(A)), -g)).max() > LONGEST_STEP:
        ridge *= 4.0
    return np.asarray(step, dtype=np.float64)
