r"""A fit near its minimum: derivatives, coordinates without edges, and profiles of the objective.

Each density q enters the wavelet variance by v = q^2 >= 0, each Gauss-Markov process also by its
time T: nu(theta) = sum_k v_k U_k(T_k), with U_k the wavelet variance of unit driving noise. A
recording of length L may leave v at zero or T without an upper limit, where logarithms run away.
The coordinates here are logarithms where a parameter is determined, and linear at these edges:

    w = asinh(v / 2s),   w >= 0,                     dv/dw = 2 s cosh w                        (L.1)
    u = -log(1/T + b),   b = 1/(3 L),                d log T/du = 1 + b T                      (L.2)

s, the standard error that v would have if it were the only unknown, is the size at which v is lost
among the scatter. u has a finite end for the random walk that T = infinity is, and there nu has a
finite derivative with respect to it.

Curves of the same rate and levels are pooled as in (M.1) of `_matching`: but for a constant Q = |y
- L' nu|^2 over the groups.

The profile of a parameter is Q minimised over all others. For weights that are the inverse
covariance of nu_hat its rise above the minimum is chi-square with one degree of freedom, so that
the values with a rise below 3.84 are a 95 % interval. In contrast to estimate and standard error it
need not be symmetric, and reaches zero or infinity where the data do not exclude them. The profile
sees all of the model: where one Gauss-Markov process less fits nearly as well, the superfluous one
may be any of them, and intervals are wide.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...navigation.noise_model.model import AxisNoise
from ...records import Array
from ..moments.theory import gauss_markov_haar, haar_variance
from ._matching import LONGEST_LENGTHS, SHORTEST_SAMPLES, PooledCurves, pool_curves
from .gmwm import NoiseFit, objective

RISE_95, RISE_99 = 3.841459, 6.634897  # 95 and 99 % of chi-square of one degree of freedom
_NO_END = 100.0  # w of (L.1) beyond which a density has no end: 1e43 times the scatter
_LINEAR_BEYOND = 3.0  # lengths of the longest recording where (L.2) turns from logarithm to linear
_PROFILE_EXCESS = 1e-3  # of Q, by which a profile's value may be too large
_HIT = 0.04  # of the rise, about 1 % of its limit
# of (L.2), within which a time is at its edge: 300 times the rounding of a logarithm, and 3e-8 of
# the longest time
_EDGE = 1e-12


# Levenberg-Marquardt: damping at the start, its factors after a good and a bad step, and its ends
_FIRST_DAMPING, _DAMPING_DOWN, _DAMPING_UP = 1e-3, 0.2, 8.0
_LEAST_DAMPING, _MOST_DAMPING = 1e-9, 1e9  # between Newton and no step at all
_MARQUARDT_STEPS = 60  # at most (chosen)
_STRIDE = 1.5  # largest step of a coordinate: farther the linearisation is worthless
_NEGLIGIBLE = 0.1  # of the wanted accuracy: a step that promises less is not made
_LEAST_DIAGONAL = 1e-12  # over the largest: below it a coordinate is without effect
_ABOVE_ZERO = 1e-300  # scale of a problem that no coordinate has an effect on: it divides
_LIMIT_STEPS, _STEP_UP = 40, 1.6  # towards a limit at most, and how a step grows meanwhile
_LEAST_STEP = 1e-4  # of a coordinate towards a limit: 0.01 % of a parameter
_FARTHER = 0.2  # first step from the 95 % to the 99 % limit, over the half width of the interval
_OFF_ENDS = 0.1  # share of a bracket that an interpolated step keeps off its ends
_POLISHED = 1e-9  # of Q, to which a fit with other weights is minimised: below any rounding


class Local:
    """The least squares problem of a fit in the coordinates (L.1, L.2), in the order of
    `composition.parameters`.
    """

    def __init__(self, fitted: NoiseFit) -> None:
        self.sampling, self.composition = fitted.sampling, fitted.composition
        self.groups = pool_curves(fitted.curves, fitted.weights)
        kinds = [(g.rate_hz, *g.level.tolist()) for g in self.groups]
        self.kind = [kinds.index((c.rate_hz, *c.level.tolist())) for c in fitted.curves]
        self.roots = [g.root for g in self.groups]
        self.y = np.concatenate([g.root @ g.mean for g in self.groups])
        names = self.composition.parameters
        self.time = self.composition.is_time
        self.linear = {
            i: [self._unit(name, c) for c in self.groups]
            for i, name in enumerate(names)
            if name in self.composition.linear
        }
        length = max(c.samples / c.rate_hz for c in fitted.curves)
        self.b = 1.0 / (_LINEAR_BEYOND * length)
        shortest, longest = (
            SHORTEST_SAMPLES / max(c.rate_hz for c in self.groups),
            LONGEST_LENGTHS * length,
        )
        self.ends = (0.0, math.inf)  # what the edges of a correlation time mean
        if fitted.times_s is not None:
            shortest, longest = self.ends = fitted.times_s[0], min(longest, fitted.times_s[1])
        self.low = np.where(self.time, -math.log(1.0 / shortest + self.b), 0.0)
        self.high = np.where(self.time, -math.log(1.0 / longest + self.b), _NO_END)
        self.s = np.ones(len(names))

    def _unit(self, name: str, curve: PooledCurves) -> Array:
        """Return the wavelet variance (J,) of a process of density one."""
        density: dict[str, Any] = {name: 1.0}
        return haar_variance(AxisNoise(**density), curve.level, curve.rate_hz, self.sampling)

    def units(self, times: Array) -> tuple[list[Array], list[Array]]:
        """Return U (p, J) and T dU/dT (p, J) of each kind of curve; rows of times are zero, those
        of their densities hold both.
        """
        value = [np.zeros((self.time.size, c.level.size)) for c in self.groups]
        slope = [np.zeros((self.time.size, c.level.size)) for c in self.groups]
        for i, rows in self.linear.items():
            for k, row in enumerate(rows):
                value[k][i] = row
        where = np.flatnonzero(self.time)
        if where.size:
            for k, c in enumerate(self.groups):
                g, dg = gauss_markov_haar(times[:, None] * c.rate_hz, c.level, self.sampling)
                value[k][where + 1] = 0.5 * times[:, None] * g
                slope[k][where + 1] = 0.5 * times[:, None] * (g + dg)
        return value, slope

    def coordinates(self, parameters: Array) -> Array:
        """Return x (p,) of parameters (p,) in SI, and set the scale s of (L.1) from them."""
        value, _ = self.units(parameters[self.time])
        power = sum(
            np.einsum("pj,pj->p", v @ root.T, v @ root.T)
            for v, root in zip(value, self.roots, strict=True)
        )
        self.s[~self.time] = 1.0 / np.sqrt(power[~self.time])
        x = np.empty(parameters.size)
        x[self.time] = -np.log(1.0 / parameters[self.time] + self.b)
        x[~self.time] = np.arcsinh(parameters[~self.time] ** 2 / (2.0 * self.s[~self.time]))
        return self.within(x)

    def within(self, x: Array) -> Array:
        """Return x (p,) between the edges; a time within `_EDGE` of an edge is on it, whatever the
        last digit of its logarithm.
        """
        margin = np.where(self.time, _EDGE, 0.0)
        return np.where(
            x <= self.low + margin, self.low, np.where(x >= self.high - margin, self.high, x)
        )

    def parameters(self, x: Array) -> Array:
        """Return the parameters (p,), SI, of x (p,)."""
        out = np.empty(x.size)
        out[self.time] = 1.0 / (np.exp(-x[self.time]) - self.b)
        out[~self.time] = np.sqrt(2.0 * self.s[~self.time] * np.sinh(x[~self.time]))
        return out

    def logarithmic(self, x: Array) -> Array:
        """Return d log parameter / dx (p,); infinite at a density of zero."""
        with np.errstate(divide="ignore"):
            return np.where(
                self.time,
                1.0 + self.b / (np.exp(-np.where(self.time, x, 0.0)) - self.b),
                0.5 / np.tanh(x),
            )

    def modelled(self, x: Array) -> tuple[list[Array], list[Array]]:
        """Return nu (J,) and its derivative D (J, p) with respect to x, of each kind of curve."""
        times = 1.0 / (np.exp(-x[self.time]) - self.b)
        value, slope = self.units(times)
        v = np.where(self.time, 0.0, 2.0 * self.s * np.sinh(np.where(self.time, 0.0, x)))
        rate = np.where(self.time, 0.0, 2.0 * self.s * np.cosh(np.where(self.time, 0.0, x)))
        where = np.flatnonzero(self.time)
        derivatives = []
        for U, dU in zip(value, slope, strict=True):
            D = U * rate[:, None]
            D[where] = v[where + 1, None] * dU[where + 1] * (1.0 + self.b * times)[:, None]
            derivatives.append(D.T)
        return [v @ U for U in value], derivatives

    def derivative(self, x: Array) -> Array:
        """Return D (M, p) of all curves below each other."""
        derivatives = self.modelled(x)[1]
        return np.concatenate([derivatives[k] for k in self.kind])

    def residual(self, x: Array) -> tuple[Array, Array]:
        """Return the weighted residual and its derivative (., p) over the kinds of curves; Q is the
        residual's square but for a constant.
        """
        nu, D = self.modelled(x)
        r = self.y - np.concatenate([root @ a for root, a in zip(self.roots, nu, strict=True)])
        return r, -np.concatenate([root @ a for root, a in zip(self.roots, D, strict=True)])

    def minimise(
        self, x: Array, fixed: int | None = None, enough: float = _PROFILE_EXCESS
    ) -> tuple[Array, float]:
        """Return the minimum of Q near x, to `enough`, with coordinate `fixed` held.

        Levenberg-Marquardt steps; coordinates at an edge stay there while that pays.
        """
        x = x.copy()
        damping = _FIRST_DAMPING
        r, D = self.residual(x)
        Q = float(r @ r)
        for _ in range(_MARQUARDT_STEPS):
            g = D.T @ r
            free = ~(((x <= self.low) & (g > 0.0)) | ((x >= self.high) & (g < 0.0)))
            if fixed is not None:
                free[fixed] = False
            A = D[:, free].T @ D[:, free]
            size = np.diag(A) + _LEAST_DIAGONAL * np.diag(A).max(initial=_ABOVE_ZERO)
            step = np.zeros(x.size)
            step[free] = -np.linalg.solve(A + np.diag(damping * size), g[free])
            step = np.clip(x + np.clip(step, -_STRIDE, _STRIDE), self.low, self.high) - x
            promised = -float(2.0 * g @ step + step @ D.T @ D @ step)
            if promised < _NEGLIGIBLE * enough:
                break
            trial, trial_D = self.residual(x + step)
            value = float(trial @ trial)
            if value < Q:
                if Q - value > 0.5 * promised:
                    damping = max(_DAMPING_DOWN * damping, _LEAST_DAMPING)
                x, r, D, Q = self.within(x + step), trial, trial_D, value
            else:
                damping *= _DAMPING_UP
                if damping > _MOST_DAMPING:
                    break
        return x, Q

    def limit(
        self, x: Array, Q: float, i: int, step: float, rise: float, height: float = 0.0
    ) -> Array:
        """Return the minimum (p,) given coordinate i where its profile is `rise` above Q.

        It is sought from x along `step`, at most to the edge. Where Gauss-Markov processes would
        change places, the limit is there: they go by the order of their times. `height` is the
        square root of the rise at x.
        """
        edge = self.high[i] if step > 0.0 else self.low[i]
        inside, outside, best = (x[i], height), None, x  # coordinate and square root of the rise
        goal = math.sqrt(rise)
        if x[i] == edge:
            return x
        for _ in range(_LIMIT_STEPS):
            trial = best.copy()
            trial[i] = np.clip(
                inside[0] + step if outside is None else _interpolate_rise(inside, outside, goal),
                self.low[i],
                self.high[i],
            )
            trial, value = self.minimise(trial, i)
            swapped = bool((np.diff(trial[self.time]) < 0.0).any())
            height = 2.0 * goal if swapped else math.sqrt(max(value - Q, 0.0))
            if abs(height**2 - rise) < _HIT or (
                outside is not None and abs(trial[i] - inside[0]) < _LEAST_STEP
            ):
                return trial
            if height < goal:
                best, inside = trial, (trial[i], height)
                if trial[i] == edge:
                    return trial
                step *= _STEP_UP
            else:
                outside = (trial[i], height)
        return trial

    def profile(self, parameters: Array, i: int) -> tuple[float, float, float]:
        """Return the 95 % interval of parameter i, SI, by the profile of Q about its minimum at
        `parameters`, and the upper limit of the 99 % one.

        Zero or infinite where the profile stays below to the edge of what is admissible.
        """
        x = self.coordinates(parameters)
        r, D = self.residual(x)
        Q = float(r @ r)
        curvature = float(D[:, i] @ D[:, i])
        step = 1.0
        if curvature > 0.0:
            step = min(max(math.sqrt(RISE_95 / curvature), _LEAST_STEP), 1.0)
        low = self.limit(x, Q, i, -step, RISE_95)
        high = self.limit(x, Q, i, step, RISE_95)
        farther = high
        if high[i] != self.high[i]:
            step = max(_FARTHER * (high[i] - x[i]), _LEAST_STEP)
            farther = self.limit(high, Q, i, step, RISE_99, math.sqrt(RISE_95))
        return self._end(low, i), self._end(high, i), self._end(farther, i)

    def _end(self, x: Array, i: int) -> float:
        """Return parameter i at x, SI; at an edge zero, infinite or the limit given to the fit."""
        if x[i] == self.low[i]:
            return self.ends[0] if self.time[i] else 0.0
        if x[i] == self.high[i]:
            return self.ends[1] if self.time[i] else math.inf
        return float(self.parameters(x)[i])


def polish_fit(fitted: NoiseFit, weights: Sequence[Array]) -> NoiseFit:
    """Return the minimum with other weights in the basin of a fit."""
    local = Local(replace(fitted, weights=tuple(weights)))
    x, _ = local.minimise(local.coordinates(fitted.parameters), enough=_POLISHED)
    names = fitted.composition.parameters
    axis = fitted.composition.axis(local.parameters(x))
    at_bound = tuple(
        name
        for name, coordinate, low, high in zip(names, x, local.low, local.high, strict=True)
        if coordinate in (low, high)
    )
    values = fitted.composition.values(axis)
    Q = objective(axis, fitted.curves, weights, fitted.sampling)
    return replace(
        fitted, axis=axis, parameters=values, weights=tuple(weights), objective=Q, at_bound=at_bound
    )


def _interpolate_rise(
    inside: tuple[float, float], outside: tuple[float, float], goal: float
) -> float:
    """Interpolate the coordinate linearly to a square root of the rise, kept off the ends."""
    share = (goal - inside[1]) / (outside[1] - inside[1])
    return inside[0] + min(max(share, _OFF_ENDS), 1.0 - _OFF_ENDS) * (outside[0] - inside[0])
