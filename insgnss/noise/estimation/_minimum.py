r"""The global minimum of the wavelet moments over correlation times.

Three stages, each of which leaves less to the next:

1. Beam. The best places of one process are found on a grid of times; beside each of the best few,
    the best places of one more,
   and so on. Every tuple settles to its minimum between the grid's times before it is compared: a
   grid alone would imitate one time between two candidates by both of them, and prefer that to a
   second process that is there.
2. Exchange. One process after the other is taken out and sought again, until nothing improves.
3. Descent. Newton's method on the exact columns, until the gradient vanishes to rounding.

A minimum may need fewer processes than it is allowed: least squares with non-negative coefficients
over a continuum of columns ends with finitely many (Caratheodory), so that there is a number beyond
which no process is of use. Those are taken out.
"""

from collections.abc import Sequence

import numpy as np

from ...records import Array
from ._matching import EDGE, MatchingSolution, Moments
from ._search import profile, settle

_PER_DECADE = 12  # candidate times
_BEAM = 4  # minima with k processes to which one more is added
_PEAKS = 4  # places tried for one more
_DESCENTS = 2  # minima that Newton's method starts from
# of Q, what an exchange must gain; what is between the interpolated and the exact columns is left
# to Newton's method
_BETTER = 1e-6
_LARGEST_STEP = 1.5  # of log T
_CLOSE = 1e-13  # of Q, the gain of a step that Q cannot tell from rounding, though its gradient can
_FLOOR = 1e-30  # of |y|^2, rounding of Q where the fit is exact
_EQUAL = 1e-12  # of Q, within which two solutions are equal


def minimum(moments: Moments) -> MatchingSolution:
    """Return the minimum over times and variances, of as few processes as it takes."""
    if moments.K == 0:
        return moments.solution(np.empty(0))
    minima = [descend(moments, times) for times in search(moments)]
    return without_idle(moments, min(minima, key=lambda minimum: minimum.value))


_POLISHING_STEPS = 5  # of Newton once a step gains nothing any more: they settle the last digits
_NEWTON_STEPS = 200  # at most (chosen)
_SHRINKING, _LEAST_STEP = 0.25, 1e-9  # of log T after a step that gains nothing, and where it ends
_ABOVE_ZERO = 1e-300  # added to an eigenvalue that divides
_LEAST_EIGENVALUE = 1e-14  # over the largest: below it a direction is flat to rounding


def search(moments: Moments) -> list[Array]:
    """Return starting times (K,), s, for the descent, best first: stages 1 and 2."""
    grid = TimeGrid(moments)
    K = moments.K
    beam = [np.empty(0)]
    for _ in range(K):
        starts = [
            np.append(positions, position)
            for positions in beam
            for position in grid.places(positions)
        ]
        beam = grid.settled(starts)[:_BEAM]
    best = beam[0]
    k = unchanged = 0
    while unchanged < K:
        others_fixed = np.delete(best, k)
        starts = [np.append(others_fixed, position) for position in grid.places(others_fixed)]
        trial = grid.settled(starts)[0]
        if grid.value(trial) < grid.value(best) * (1.0 - _BETTER):
            best = trial
            unchanged = 0
        else:
            unchanged += 1
        k = (k + 1) % K
    return [grid.times(positions) for positions in [best, *beam[1:_DESCENTS]]]


def descend(moments: Moments, times: Array) -> MatchingSolution:
    """Newton's method from `times` (K,) to the minimum in its basin, between the bounds."""
    now = moments.solution(moments.on_bounds(times))
    radius = _LARGEST_STEP
    polishing_steps = _POLISHING_STEPS
    g, G = moments.curvature(now)
    for _ in range(_NEWTON_STEPS):
        step = newton_step(np.log(now.times), g, G, np.log(moments.bounds))
        if not step.any():
            break
        close = -g @ step <= _CLOSE * now.value + _FLOOR
        step *= min(1.0, radius / np.abs(step).max())
        trial = moments.solution(moments.on_bounds(now.times * np.exp(step)))
        if close:
            slope, curvature = moments.curvature(trial)
            polishing_steps -= 1
            if (
                polishing_steps < 0
                or np.abs(slope).max() >= np.abs(g).max()
                or trial.value > now.value * (1.0 + _CLOSE) + _FLOOR
            ):
                break
            now, g, G = trial, slope, curvature
        elif trial.value < now.value:
            now = trial
            radius = min(2.0 * radius, _LARGEST_STEP)
            g, G = moments.curvature(now)
        else:
            radius = _SHRINKING * np.abs(step).max()
            if radius < _LEAST_STEP:
                break
    return now


def newton_step(t: Array, g: Array, G: Array, bounds: Array) -> Array:
    """Return the step (K,) of log T downhill, zero for times that the gradient holds on a bound and
    for processes without variance.
    """
    low, high = bounds
    free = ~(((t <= low + EDGE) & (g > 0.0)) | ((t >= high - EDGE) & (g < 0.0)) | (g == 0.0))
    step = np.zeros(t.size)
    if free.any():
        eigenvalue, V = np.linalg.eigh(G[np.ix_(free, free)])
        size = np.abs(eigenvalue)
        size = np.maximum(size, _LEAST_EIGENVALUE * size.max() + _ABOVE_ZERO)
        step[free] = -V @ ((V.T @ g[free]) / size)
    return step


def without_idle(moments: Moments, solution: MatchingSolution) -> MatchingSolution:
    """The same minimum with as few processes as it takes.

    Processes that change nothing get variance zero and the longest time; a time that may as well
    lie on a bound is put there.
    """
    limit = solution.value * (1.0 + _EQUAL) + _FLOOR
    L = len(moments.linear)
    times = solution.times[solution.x[L:] > 0.0]
    for k in reversed(range(times.size)):
        fewer_times = np.delete(times, k)
        if L + fewer_times.size and moments.solution(fewer_times).value <= limit:
            times = fewer_times
    for bound in moments.bounds:
        for k in range(times.size):
            moved = np.sort(np.append(np.delete(times, k), bound))
            if moments.solution(moved).value <= limit:
                times = moved
    active = moments.solution(times)
    needed = active.x[L:] > 0.0
    idle = moments.K - int(needed.sum())
    x = np.concatenate([active.x[:L], active.x[L:][needed], np.zeros(idle)])
    return MatchingSolution(
        np.append(times[needed], np.full(idle, moments.bounds[1])), x, active.value
    )


class TimeGrid:
    """Columns of the candidate times, evenly spaced in log T, and the search among and between
    them; a position is an index with fraction.
    """

    def __init__(self, moments: Moments) -> None:
        low, high = moments.bounds
        count = int(np.ceil(np.log10(high / low) * _PER_DECADE)) + 1
        self.y, self.linear = moments.y, moments.linear
        self.T = np.geomspace(low, high, count)
        self.D, slope, _ = moments.columns(self.T)
        slope -= self.D * np.einsum("tm,tm->t", self.D, slope)[:, None]
        self.slope = slope * (np.log(high / low) / (count - 1))
        self.values: dict[bytes, float] = {}

    def times(self, positions: Array) -> Array:
        """Return the correlation times (K,), s, of positions."""
        return np.exp(np.interp(positions, np.arange(self.T.size), np.log(self.T)))

    def value(self, positions: Array) -> float:
        """Return Q over |y|^2 at positions that have settled."""
        return self.values[positions.tobytes()]

    def places(self, positions: Array) -> list[float]:
        """Return the best positions (a few) of one more process beside `positions`.

        They are the peaks of its profile.
        """
        gain = np.empty(self.T.size)
        profile(positions, self.linear, self.D, self.slope, self.y, gain)
        padded = np.concatenate([[-np.inf], gain, [-np.inf]])
        peaks = np.flatnonzero((gain >= padded[:-2]) & (gain > padded[2:]))
        return [float(i) for i in peaks[np.argsort(-gain[peaks])][:_PEAKS]]

    def settled(self, starts: Sequence[Array]) -> list[Array]:
        """Return the minima reached from `starts` (positions (K,)), each once, best first."""
        minima: dict[tuple[int, ...], Array] = {}
        for start in starts:
            positions = np.array(start)
            value = settle(positions, self.linear, self.D, self.slope, self.y)
            positions.sort()
            self.values[positions.tobytes()] = value
            minima.setdefault(tuple(np.round(4.0 * positions).astype(int)), positions)
        return sorted(minima.values(), key=self.value)
