"""The maximum of the likelihood of the innovations over factors of noise.

With theta the logarithms of all factors, and g, A gradient and expected second derivative of
-2 log L (`likelihood`), the maximum is searched by scoring with damping d,

    theta <- theta - (A + d diag A)^-1 g,     within the factors of `RANGE`,
    cov theta = 2 A^-1 at the maximum                                                          (N.1)

from the best of a few starts.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...base.advance import converged, share, through, within
from ...records import Array
from .likelihood import IMU, Evaluated, LinearSegment, evaluate

# a fix is not trusted to less than a fifth of its sigma
RANGE, RANGE_OF_FIXES = (1.0 / 300.0, 300.0), (0.2, 30.0)
# of a search; its last step and gain; and its longest step, a factor of e (chosen)
STEPS, DONE, LONGEST_STEP = 40, 1e-4, 1.0
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
        Gain of a step in -2 log L below which it was the last: 0.01 is a tenth of a parameter's
        standard deviation.
    """

    segments: Sequence[LinearSegment]
    names: tuple[str, ...]
    progress: Callable[[str], None]
    range_of_fixes: tuple[float, float] = RANGE_OF_FIXES
    gain: float = DONE

    def maximum(self, free: np.ndarray, starts: Sequence[float] = STARTS) -> Maximum:
        """Maximise over some parameters, the others at one, from the best start.

        Parameters
        ----------
        free : ndarray of bool, (p,)
            The parameters that vary.
        starts : sequence of float
            Logarithms of the IMU's factors from which it is looked for.

        Returns
        -------
        Maximum
            The maximum.
        """
        moved = np.array([name in IMU for name in self.names]) & free
        thetas = [np.where(moved, s, 0.0) for s in (starts if moved.any() else STARTS[:1])]
        count = int(np.count_nonzero(free))
        self.progress(f"likelihood of the innovations, {count} factor{'s' if count > 1 else ''}")
        with within(0.0, STARTED):
            first = [
                Maximum(theta, evaluate(self.segments, theta, free)) for theta in through(thetas)
            ]
        with within(STARTED, 1.0):
            return self._climb(min(first, key=lambda m: m.evaluated.cost), free)

    def _climb(self, here: Maximum, free: np.ndarray) -> Maximum:
        """Climb to the maximum by (N.1)."""
        low, high = np.log([RANGE if name in IMU else self.range_of_fixes for name in self.names]).T
        damping, longest = 0.0, 0.0
        for _ in range(STEPS):
            theta, g = here.theta, here.evaluated.gradient
            active = free & ~((theta <= low) & (g > 0.0)) & ~((theta >= high) & (g < 0.0))
            if not active.any():
                break
            A = here.evaluated.information[np.ix_(active, active)]
            step = -np.linalg.solve(A + np.diag(damping * np.diag(A) + 1e-6), g[active])
            moved = theta.copy()
            moved[active] += np.clip(step, -LONGEST_STEP, LONGEST_STEP)
            moved = np.clip(moved, low, high)
            there = Maximum(moved, evaluate(self.segments, moved, free))
            size = float(np.abs(moved - theta).max())
            longest = max(longest, size)
            share(converged(size, longest, DONE))
            if there.evaluated.cost <= here.evaluated.cost:
                small = here.evaluated.cost - there.evaluated.cost < self.gain or size < DONE
                here, damping = there, 0.1 * damping if damping > 1e-3 else 0.0
                if small:
                    break
            elif size < DONE or damping > 1e6:
                break
            else:
                damping = max(10.0 * damping, 1e-2)
        return here
