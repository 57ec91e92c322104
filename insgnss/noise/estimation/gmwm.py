r"""Generalised method of wavelet moments (GMWM): processes fitted to wavelet variances; several
curves at once (M-GMWM).

Guerrier, Skaloud, Stebler and Victoria-Feser (2013) fit nu(theta), the wavelet variance of a sum of
processes, to estimates nu_hat by weighted least squares; Bakalli, Radi, Nassar, Guerrier, Zhang and
Molinari (2018) add up the objectives of replicates:

    Q(theta) = sum_i (nu_hat_i - nu_i(theta))' Omega_i (nu_hat_i - nu_i(theta))                (G.1)

One mechanism serves both. Curves may differ in length, rate and levels, since theta is of
continuous time. The weights are Omega_i = diag(1 / (high - low)^2) of the 95 % intervals, or given.
How the minimum is found: `_matching`, `_minimum`.

A minimum may lie on the edge of what is admissible: a density of zero, or a correlation time so
short that the process is white from sample to sample, or so long that it is a random walk within
the recording. `NoiseFit.at_bound` names such parameters.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.errors import DataError, UsageError
from ...navigation.noise_model.model import AxisNoise
from ...records import Array, WaveletVariance
from ..moments.theory import Sampling, haar_variance
from ..processes.composition import CORRELATION_TIME, Composition
from ._matching import LONGEST_LENGTHS, SHORTEST_SAMPLES, MatchingSolution, Moments, pool_curves
from ._minimum import minimum


@dataclass(frozen=True, eq=False)
class NoiseFit:
    """Processes fitted to wavelet variances.

    Parameters
    ----------
    parameters : ndarray, (p,)
        Values in SI, in the order of `composition.parameters`.
    curves : tuple of WaveletVariance
        The curves as fitted, of the selected levels only.
    weights : tuple of ndarray, (J_i, J_i)
        Omega_i of each curve, 1/X^4.
    objective : float
        Q of (G.1).
    sampling : {"point", "mean"}
        What a sample is of the continuous process.
    at_bound : tuple of str
        Parameters on the edge of the admissible; the time of a Gauss-Markov process without driving
        noise is arbitrary and stands at its upper bound.
    times_s : tuple of float or None
        Limits of the correlation times that the caller set, s.
    """

    composition: Composition
    axis: AxisNoise
    parameters: Array
    curves: tuple[WaveletVariance, ...]
    weights: tuple[Array, ...]
    objective: float
    sampling: Sampling
    at_bound: tuple[str, ...]
    times_s: tuple[float, float] | None = None

    @property
    def modelled(self) -> tuple[Array, ...]:
        """nu_i(theta) (J_i,) at the levels of each curve, X^2."""
        return tuple(
            haar_variance(self.axis, curve.level, curve.rate_hz, self.sampling)
            for curve in self.curves
        )

    @property
    def residuals(self) -> tuple[Array, ...]:
        """nu_hat_i - nu_i(theta) (J_i,) of each curve, X^2."""
        return tuple(
            curve.variance - modelled
            for curve, modelled in zip(self.curves, self.modelled, strict=True)
        )


_LEAST_WIDTH = 1e-140  # of an interval (X^2): its inverse square is finite
_SYMMETRIC = 1e-6  # difference of two halves of a weight matrix over its diagonal, by rounding


def interval_weights(curve: WaveletVariance) -> Array:
    """Return a diagonal Omega (J, J), 1/X^4: one over the squared width of each 95 % interval.
    Raises DataError where one has no width.
    """
    width = curve.high - curve.low
    if not (width > _LEAST_WIDTH).all():
        raise DataError(
            f"level {int(curve.level[np.argmin(width)])}: the interval of the wavelet variance has"
            " no width; give weights"
        )
    return np.diag(1.0 / width**2)


def objective(
    axis: AxisNoise,
    curves: Sequence[WaveletVariance],
    weights: Sequence[Array],
    sampling: Sampling = "point",
) -> float:
    """Return Q (G.1) of the processes of an axis."""
    total = 0.0
    for curve, omega in zip(curves, weights, strict=True):
        residual = curve.variance - haar_variance(axis, curve.level, curve.rate_hz, sampling)
        total += float(residual @ omega @ residual)
    return total


def fit(
    curves: Sequence[WaveletVariance] | WaveletVariance,
    composition: Composition | str,
    *,
    weights: Sequence[Array] | None = None,
    sampling: Sampling = "point",
    levels: Sequence[int] | None = None,
    times_s: tuple[float, float] | None = None,
) -> NoiseFit:
    """Fit the processes of a composition to all curves by minimising Q (G.1).

    Parameters
    ----------
    curves : sequence of WaveletVariance
        Wavelet variances of one or several recordings and axes.
    composition : Composition or str
        The processes, or their name, such as "WN+3GM".
    weights : sequence of ndarray (J, J), optional
        A symmetric positive definite Omega, 1/X^4, for each curve and the levels that remain;
        `interval_weights` by default.
    sampling : {"point", "mean"}
        What a sample is of the continuous process (`theory`).
    levels : sequence of int, optional
        Levels to fit, by default all.
    times_s : tuple of float, optional
        Shortest and longest admissible correlation time, s; by default from white to random walk
        (`_matching`).

    Returns
    -------
    NoiseFit
        The fitted processes.

    Raises
    ------
    UsageError
        Where curves, levels or weights do not fit together.
    DataError
        For fewer levels than parameters.
    """
    composition = Composition.parse(composition) if isinstance(composition, str) else composition
    chosen = _select_levels([curves] if isinstance(curves, WaveletVariance) else curves, levels)
    if weights is None:
        omegas = tuple(interval_weights(curve) for curve in chosen)
    else:
        omegas = _check_weights(weights, chosen)
    different = {(j, c.rate_hz) for c in chosen for j in c.level.tolist()}
    if len(different) < composition.size:
        parameters = f"the {composition.size} parameters of {composition}"
        raise DataError(
            f"{len(different)} scales for {parameters}; name fewer processes or record longer"
        )
    moments = Moments(
        pool_curves(chosen, omegas), composition, sampling, _time_bounds(times_s, chosen)
    )
    values = _parameters_of_solution(moments, composition, minimum(moments))
    values.flags.writeable = False
    axis = composition.axis(values)
    value = objective(axis, chosen, omegas, sampling)
    return NoiseFit(
        composition=composition,
        axis=axis,
        parameters=values,
        curves=chosen,
        weights=omegas,
        objective=value,
        sampling=sampling,
        at_bound=_at_bound(moments, composition, values),
        times_s=times_s,
    )


def fit_alike(
    fitted: NoiseFit,
    curves: Sequence[WaveletVariance],
    weights: Sequence[Array] | None,
    composition: Composition | None = None,
) -> NoiseFit:
    """Return the fit of other curves, weights or another composition in the manner of `fitted`."""
    composition = composition or fitted.composition
    options: dict[str, Any] = {"sampling": fitted.sampling, "times_s": fitted.times_s}
    return fit(curves, composition, weights=weights, **options)


def _select_levels(
    curves: Sequence[WaveletVariance], levels: Sequence[int] | None
) -> tuple[WaveletVariance, ...]:
    """Return the curves with the levels to fit; UsageError where a curve has none of them."""
    if not curves:
        raise UsageError("no wavelet variance to fit; give at least one curve")
    if levels is None:
        return tuple(curves)
    available = {int(j) for curve in curves for j in curve.level}
    if unknown := sorted(set(levels) - available):
        raise UsageError(
            f"level {unknown[0]} is in no curve; the curves have levels {min(available)} to"
            f" {max(available)}"
        )
    for i, curve in enumerate(curves, start=1):
        if not np.isin(curve.level, list(levels)).any():
            raise UsageError(
                f"curve {i} has none of the levels to fit, only {curve.level[0]} to"
                f" {curve.level[-1]}; leave it out"
            )
    return tuple(curve.selected(list(levels)) for curve in curves)


def _time_bounds(
    times_s: tuple[float, float] | None, curves: tuple[WaveletVariance, ...]
) -> tuple[float, float]:
    """Return the bounds of the correlation times, s."""
    low = SHORTEST_SAMPLES / max(c.rate_hz for c in curves)
    high = LONGEST_LENGTHS * max(c.samples / c.rate_hz for c in curves)
    if times_s is None:
        return low, high
    shortest, longest = float(times_s[0]), float(times_s[1])
    if not (low <= shortest < longest):
        raise UsageError(
            f"correlation times from {shortest:g} to {longest:g} s; give at least {low:g} s, and"
            " then a longer one"
        )
    return shortest, min(longest, high)


def _check_weights(
    weights: Sequence[Array], curves: tuple[WaveletVariance, ...]
) -> tuple[Array, ...]:
    """Return symmetric weights (J, J) of each curve; UsageError for any that cannot be weights."""
    if len(weights) != len(curves):
        raise UsageError(
            f"{len(weights)} weight matrices for {len(curves)} curves; give one a curve"
        )
    checked = []
    for i, (omega, curve) in enumerate(zip(weights, curves, strict=True), start=1):
        matrix = np.array(omega, dtype=np.float64)
        J = curve.level.size
        if matrix.shape != (J, J):
            raise UsageError(
                f"weights of curve {i}: shape {matrix.shape}, expected ({J}, {J}), its levels"
            )
        root = np.sqrt(np.maximum(np.diag(matrix), 0.0))
        asymmetry = np.abs(matrix - matrix.T)
        if not (
            np.isfinite(matrix).all()
            and root.min() > 0.0
            and (asymmetry <= _SYMMETRIC * np.outer(root, root)).all()
        ):
            raise UsageError(
                f"weights of curve {i}: not a symmetric matrix of finite numbers with a positive"
                " diagonal"
            )
        checked.append(0.5 * (matrix + matrix.T))
    return tuple(checked)


def _parameters_of_solution(
    moments: Moments, composition: Composition, solution: MatchingSolution
) -> Array:
    """Return the parameters (p,), SI, in the order of the composition."""
    L = len(composition.linear)
    variance = solution.x * moments.length
    named = dict(zip(composition.linear, np.sqrt(variance[:L] / moments.norm), strict=True))
    if composition.gauss_markov:
        q2 = 2.0 * variance[L:] / (moments.columns(solution.times)[2] * solution.times)
        for k, (time, density) in enumerate(zip(solution.times, np.sqrt(q2), strict=True), start=1):
            named |= {f"correlation_time_{k}": time, f"driving_noise_{k}": density}
    return np.array([named[name] for name in composition.parameters])


def _at_bound(moments: Moments, composition: Composition, parameters: Array) -> tuple[str, ...]:
    """Return the names of the parameters on the edge: times on a bound of the search, densities of
    zero.
    """
    valued = zip(composition.terms, parameters.tolist(), strict=True)
    return tuple(
        str(term)
        for term, value in valued
        if value in (moments.bounds if term.kind == CORRELATION_TIME else (0.0,))
    )
