r"""Which model to take. Whether one serves all recordings is asked in `near_stationarity`.

Model selection (Guerrier, Radi, Molinari and co-workers; Radi et al. 2019 for IMUs). The objective
of a fit is smaller than that of the same parameters on another recording, by the optimism of having
been fitted to this one. With Q = d' Omega d, an independent nu_hat0 of the same covariance V, and
theta_hat a function of nu_hat,

    E Q0 - E Q = 2 tr(Omega cov(nu_hat, nu(theta_hat)))                                        (S.1)

To first order nu(theta_hat) moves by D H^-1 D' Omega (nu_hat - nu), where H is half the Hessian of
Q at the fit, H = D' Omega D - sum_j (Omega d)_j d^2 nu_j, whose second part is that of a model that
does not fit. So the wavelet information criterion is

    WIC = Q + 2 tr(H^-1 D' Omega V Omega D)                                                    (S.2)

and for Omega = V^-1 and a model that fits the penalty is twice the number of parameters, as
Akaike's. V and Omega must be the same for all models; they are taken at the largest of the family.
Parameters at an edge count for nothing. With re-fits of drawn curves, (S.1) is the covariance of
nu* and nu(theta*), edges and all.

The relative curvatures of H against D' Omega D are kept above one half: below, the quadratic
picture of Q has ended.

With several recordings the objective on a recording that the fit has not seen can be had itself:
each is left out in turn, and the mean objective on those left out is the cross-validated criterion
CVWVIC of R package mgmwm (there half of the recordings are left out).

By WIC, models within 2 of the least are equivalent to it, the usual measure for Akaike's criterion.
By CVWVIC those are that Wilcoxon's signed-rank test over the recordings does not tell from the best
(5 %), as in mgmwm; six recordings are few for that test, and WIC uses them all at once. Of the
equivalent models those go first whose parameters are all determined, none at an edge and each to a
factor of e, and of these the smallest is chosen. Where that is asked for, a model of which a
Gauss-Markov process is shorter than a sample leaves the competition.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...base.advance import through
from ...base.errors import UsageError
from ...records import Array, WaveletVariance
from ..moments.theory import Sampling
from ..processes.composition import Composition, families
from .bootstrap import draw_variances, redraw_curves
from .estimates import Linearised
from .gmwm import NoiseFit, fit, fit_alike, interval_weights, objective
from .goodness import goodness_of_fit
from .inference import covariances, efficient, inverse

_DERIVATIVE_STEP = 1e-4  # of the coordinates, for second derivatives
# of H over that of the first order (chosen): a flat fit has no endless optimism
_LEAST_CURVATURE = 0.5
_WITHIN = 2.0  # of WIC
_SIGNIFICANCE = 0.05  # p-value
_FACTOR_E = 1.0  # standard error of a logarithm


@dataclass(frozen=True, eq=False)
class CandidateModel:
    """One model of a family.

    Parameters
    ----------
    fit : NoiseFit
        Its fit.
    wic, optimism : float
        The criterion, which is objective + optimism, and the optimism.
    difference : float
        Difference of the criterion to the least.
    p_value : float
        p-value of the J test, asymptotic.
    held_out : ndarray (R,) or None
        Objective on each recording when it is left out.
    equivalent : bool
        Whether it cannot be distinguished from the best by its criterion.
    determined : bool
        Whether no parameter is at an edge and each is known to a factor of e.
    remarks : tuple of str
        What is odd about the fit.
    """

    fit: NoiseFit
    wic: float
    optimism: float
    difference: float
    p_value: float
    held_out: Array | None
    equivalent: bool
    determined: bool
    remarks: tuple[str, ...]

    @property
    def composition(self) -> Composition:
        """The processes of the model."""
        return self.fit.composition

    @property
    def cross_validated(self) -> float:
        """Mean objective on the recordings left out, NaN for a single recording."""
        return math.nan if self.held_out is None else float(self.held_out.mean())


@dataclass(frozen=True, eq=False)
class Ranking:
    """Candidates by `criterion` ("WIC" or "CVWVIC"), best first.

    chosen : of those equivalent to the best, the smallest that is determined, else the smallest.
    """

    candidates: tuple[CandidateModel, ...]
    criterion: str
    chosen: CandidateModel

    def table(self) -> str:
        """One line a model, best first."""
        rows = [
            f"{'model':<16}{'par':>4}{'Q':>10}{'WIC':>10}{'diff':>9}{'CV':>10}{'J p':>8}  remarks"
        ]
        for model in self.candidates:
            mark = "* " if model is self.chosen else "= " if model.equivalent else "  "
            cv = "" if model.held_out is None else f"{model.cross_validated:.4g}"
            row = f"{mark + str(model.composition):<16}{model.composition.size:>4}"
            row += f"{model.fit.objective:>10.4g}{model.wic:>10.4g}{model.difference:>9.3g}{cv:>10}"
            rows.append(f"{row}{model.p_value:>8.2g}  {'; '.join(model.remarks)}".rstrip())
        return "\n".join(rows)


_RIDGE = 1e-12  # added to a normal matrix of unit diagonal, that rounding makes none indefinite
_EQUAL = 1e-9  # relative difference of objectives that are the same but for rounding


def rank(
    curves: Sequence[WaveletVariance],
    models: Composition | str | Sequence[Composition | str],
    *,
    weights: str = "efficient",
    criterion: str = "WIC",
    recordings: Sequence[int] | None = None,
    sampling: Sampling = "point",
    draws: int = 0,
    seed: int = 0,
    below_a_sample: bool = True,
) -> Ranking:
    """Fit all models to the curves and rank them.

    Parameters
    ----------
    curves : sequence of WaveletVariance
        Wavelet variances of one or several recordings and axes.
    models : Composition, str or sequence of them
        The models, or one, which stands for itself and all that it contains.
    weights : {"efficient", "interval"}
        The inverse covariance at the largest model, or the weights of the intervals.
    criterion : {"WIC", "CVWVIC"}
        The criterion; "CVWVIC" needs two and more recordings.
    recordings : sequence of int, optional
        Number of the recording of each curve, where one has several (axes); by default each its
        own.
    sampling : {"point", "mean"}
        What a sample is of the continuous process.
    draws, seed : int
        Re-fits for the bootstrapped optimism, 0 for (S.2), and the seed of their draws.
    below_a_sample : bool
        Whether a model stays of which a Gauss-Markov process is shorter than a sample.

    Returns
    -------
    Ranking
        The candidates, best first.

    Raises
    ------
    UsageError
        For other weights or criteria, no model, and recording numbers that do not go with the
        curves.
    """
    curves = tuple(curves)
    if weights not in ("efficient", "interval"):
        raise UsageError(f"weights {weights!r} are neither 'efficient' nor 'interval'")
    groups = recording_numbers(curves, recordings)
    if criterion not in ("WIC", "CVWVIC"):
        raise UsageError(f"criterion {criterion!r} is neither 'WIC' nor 'CVWVIC'")
    if criterion == "CVWVIC" and np.unique(groups).size < 2:
        raise UsageError(
            "CVWVIC leaves out one recording after the other and needs two at least; take 'WIC'"
        )
    compositions = _compositions(models)
    largest = max(compositions, key=lambda c: c.size)
    reference = fit(curves, largest, sampling=sampling)
    reference = efficient(reference) if weights == "efficient" else reference
    V = covariances(reference)
    Omega = tuple(inverse(block) for block in V)
    if weights == "interval":
        Omega = tuple(interval_weights(curve) for curve in curves)
    if not all(np.isfinite(W).all() for W in Omega):
        raise UsageError(
            "the covariance of the wavelet variances is singular; take weights='interval'"
        )
    drawn = (
        tuple(redraw_curves(reference, draw_variances(reference, draws, seed=seed)))
        if draws
        else ()
    )
    candidates = [
        _evaluate_model(curves, c, Omega, V, groups, sampling, drawn) for c in through(compositions)
    ]
    if not below_a_sample:
        candidates = [c for c in candidates if not _has_process_below_sampling(c.fit)] or candidates
    return _rank_candidates(candidates, criterion)


def _has_process_below_sampling(fitted: NoiseFit) -> bool:
    """Tell whether a Gauss-Markov process of the fit is shorter than a sampling interval.

    It is white noise by another name, and the model without it competes by itself.
    """
    interval_s = 1.0 / max(curve.rate_hz for curve in fitted.curves)
    return any(0.0 < p.correlation_time_s < interval_s for p in fitted.axis.gauss_markov)


def recording_numbers(
    curves: Sequence[WaveletVariance], recordings: Sequence[int] | None
) -> np.ndarray:
    """Return the number of the recording of each curve."""
    groups = np.arange(len(curves)) if recordings is None else np.asarray(recordings)
    if groups.size != len(curves):
        raise UsageError(
            f"{groups.size} recording numbers for {len(curves)} curves; give one a curve"
        )
    return groups


def _compositions(
    models: Composition | str | Sequence[Composition | str],
) -> tuple[Composition, ...]:
    """Return the models to rank: those named, or all that the one named contains."""
    if isinstance(models, str | Composition):
        return families(Composition.parse(models) if isinstance(models, str) else models)
    compositions = tuple(
        dict.fromkeys(Composition.parse(m) if isinstance(m, str) else m for m in models)
    )
    if not compositions:
        raise UsageError("no model to rank; name some, as in 'WN+GM', 'WN+2GM'")
    return compositions


def _evaluate_model(
    curves: tuple[WaveletVariance, ...],
    composition: Composition,
    Omega: tuple[Array, ...],
    V: tuple[Array, ...],
    groups: np.ndarray,
    sampling: Sampling,
    drawn: tuple[tuple[WaveletVariance, ...], ...],
) -> CandidateModel:
    """Fit one model with the weights Omega and compute its criteria, J test and remarks."""
    fitted = fit(curves, composition, weights=Omega, sampling=sampling)
    linear = Linearised(fitted, V)
    optimism = _drawn_optimism(fitted, drawn) if drawn else closed_optimism(fitted, linear)
    test = goodness_of_fit(fitted, linear)
    held_out = _held_out_objectives(fitted, groups) if np.unique(groups).size > 1 else None
    remarks = [f"{name} at its edge".replace("_", " ") for name in fitted.at_bound]
    if test.p_value < _SIGNIFICANCE and test.misfits:
        i, level = test.misfits[0]
        scale_s = 2.0**level / curves[i].rate_hz
        of_curve = f" of curve {i + 1}" if len(curves) > 1 else ""
        remarks.append(f"misfit, worst at scale {scale_s:.3g} s{of_curve}")
    errors = np.sqrt(np.diag(linear.covariance())) * linear.local.logarithmic(linear.x)
    determined = not fitted.at_bound and bool((errors < _FACTOR_E).all())
    return CandidateModel(
        fit=fitted,
        wic=fitted.objective + optimism,
        optimism=optimism,
        difference=math.nan,
        p_value=test.p_value,
        held_out=held_out,
        equivalent=False,
        determined=determined,
        remarks=tuple(remarks),
    )


def closed_optimism(fitted: NoiseFit, linear: Linearised) -> float:
    """Return the penalty (S.2); second derivatives by central differences of the analytic first
    ones.
    """
    inside = np.flatnonzero(~np.isin(fitted.composition.parameters, fitted.at_bound))
    gap = linear.Omega @ np.concatenate(fitted.residuals)
    D = linear.local.derivative(linear.x)[:, inside]
    A = D.T @ linear.Omega @ D
    H = A.copy()
    for column, i in enumerate(inside):
        step = np.zeros(linear.x.size)
        step[i] = _DERIVATIVE_STEP
        plus, minus = (linear.local.derivative(linear.x + s)[:, inside] for s in (step, -step))
        H[:, column] -= (plus - minus).T @ gap / (2.0 * _DERIVATIVE_STEP)
    root = np.sqrt(np.diag(A))
    L = np.linalg.cholesky(A / np.outer(root, root) + _RIDGE * np.eye(root.size))
    scaled = np.linalg.solve(L, np.linalg.solve(L, 0.5 * (H + H.T) / np.outer(root, root)).T)
    curvature, E = np.linalg.eigh(0.5 * (scaled + scaled.T))
    F = E.T @ np.linalg.solve(L, (D / root).T @ linear.Omega)
    traces = np.einsum("ij,jk,ik->i", F, linear.V, F)
    return 2.0 * float(np.sum(traces / np.maximum(curvature, _LEAST_CURVATURE)))


def _drawn_optimism(fitted: NoiseFit, drawn: tuple[tuple[WaveletVariance, ...], ...]) -> float:
    """Return the penalty (S.1) over re-fits with the same weights."""
    fits = [fit_alike(fitted, curves, fitted.weights) for curves in drawn]
    total = 0.0
    for i, Omega in enumerate(fitted.weights):
        nu = np.array([curves[i].variance for curves in drawn])
        modelled = np.array([f.modelled[i] for f in fits])
        total += float(((nu - nu.mean(axis=0)) @ Omega * modelled).sum()) / (len(drawn) - 1)
    return 2.0 * total


def _held_out_objectives(fitted: NoiseFit, groups: np.ndarray) -> Array:
    """Return the objective (R,) on each recording of the fit to all others."""
    out = []
    for recording in np.unique(groups):
        members = np.flatnonzero(groups != recording)
        weights = [fitted.weights[i] for i in members]
        refitted = fit_alike(fitted, [fitted.curves[i] for i in members], weights)
        held_out = np.flatnonzero(groups == recording)
        curves = [fitted.curves[i] for i in held_out]
        held_out_weights = [fitted.weights[i] for i in held_out]
        out.append(objective(refitted.axis, curves, held_out_weights, fitted.sampling))
    return np.array(out)


def _rank_candidates(candidates: list[CandidateModel], criterion: str) -> Ranking:
    """Order the candidates by the criterion, mark those equivalent to the best and choose one."""

    def key(c: CandidateModel) -> tuple[float, int]:
        value = c.cross_validated if criterion == "CVWVIC" else c.wic
        return float(f"{value:.9g}"), c.composition.size  # equal to rounding: the smaller first

    least_wic = min(candidate.wic for candidate in candidates)
    best = min(candidates, key=key)
    equivalent = _indistinguishable if criterion == "CVWVIC" else _is_within_wic
    marked = [
        replace(c, difference=c.wic - least_wic, equivalent=c is best or equivalent(c, best))
        for c in sorted(candidates, key=key)
    ]
    chosen = min(
        (c for c in marked if c.equivalent),
        key=lambda c: (not c.determined, c.composition.size, key(c)),
    )
    return Ranking(tuple(marked), criterion, chosen)


def _is_within_wic(candidate: CandidateModel, best: CandidateModel) -> bool:
    return candidate.wic - best.wic < _WITHIN


def _indistinguishable(candidate: CandidateModel, best: CandidateModel) -> bool:
    """Return whether a model is as good as the best by Wilcoxon's signed-rank test.

    The test is over the recordings left out, at `_SIGNIFICANCE`.
    """
    from scipy.stats import wilcoxon

    if (
        candidate.held_out is None
        or best.held_out is None
        or np.allclose(candidate.held_out, best.held_out, rtol=_EQUAL)
    ):
        return True
    test = wilcoxon(candidate.held_out, best.held_out, alternative="greater")
    return float(test.pvalue) > _SIGNIFICANCE
