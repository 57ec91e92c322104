r"""Does the model fit, and where not: the J test and the scales that misfit.

With P = 1 - D B of `estimates` the distance d = nu_hat - nu(theta_hat) has the covariance P V P',
so that Q = d' Omega d is a sum of squares of unit normals times the eigenvalues lambda of P' Omega
P V. With the mean and the variance of that sum,

    J = Q / c ~ chi-square(f),   c = sum lambda^2 / sum lambda,
                             f = (sum lambda)^2 / sum lambda^2                                 (J.1)

At the efficient fit all lambda are 1 or 0, J is Q and f the number of moments less that of
parameters: the J test (Hansen 1982). At the longest scales nu_hat is far from normal; the
bootstrapped p-value compares Q with that of re-fits to recordings of the fitted processes. d over
its standard deviation says which scales misfit.
"""

import math
from dataclasses import dataclass

import numpy as np

from ...records import Array
from .bootstrap import Bootstrap
from .estimates import Linearised
from .gmwm import NoiseFit

_MISFIT_SIGMAS = 3.0  # standard deviations of a scale that misfits


@dataclass(frozen=True, eq=False)
class GoodnessOfFit:
    """The J test (J.1), and which scales misfit.

    statistic, degrees : J and f of (J.1).
    p_value : asymptotic.
    bootstrapped : p-value over `draws` re-fits, with its Monte Carlo
    standard deviation `bootstrapped_error`; NaN for no draws.
    residuals : (J_i,) of each curve, standardised.
    misfits : (curve from 0, level) of those beyond 3, worst first.   sentence : the verdict.
    """

    statistic: float
    degrees: float
    p_value: float
    bootstrapped: float
    bootstrapped_error: float
    draws: int
    residuals: tuple[Array, ...]
    misfits: tuple[tuple[int, int], ...]
    sentence: str


def p_text(p: float) -> str:
    """A p-value in words."""
    return "p < 1e-99" if p < 1e-99 else f"p = {p:.2g}"


_SIGNIFICANCE = 0.05  # of a p-value, below which a model does not fit
_NAMED_SCALES = 4  # that a sentence names (chosen)


def goodness_of_fit(
    fitted: NoiseFit, linear: Linearised, resampled: Bootstrap | None = None
) -> GoodnessOfFit:
    """The J test of a fit, bootstrapped where there are re-fits."""
    from scipy.special import chdtrc

    residual = np.concatenate(fitted.residuals)
    inside = ~np.isin(np.asarray(fitted.composition.parameters)[linear.free], fitted.at_bound)
    scatter, weight = linear.scatter(inside)
    total = float(weight.sum())
    squares = float((weight**2).sum())
    statistic = fitted.objective * total / squares  # (J.1)
    degrees = total**2 / squares
    p_value = float(chdtrc(degrees, statistic))
    bootstrapped = error = math.nan
    draws = 0
    if resampled is not None:
        draws = resampled.objective.size
        bootstrapped = (1.0 + float((resampled.objective >= fitted.objective).sum())) / (
            draws + 1.0
        )
        error = math.sqrt(bootstrapped * (1.0 - bootstrapped) / draws)
    ends = np.cumsum([c.level.size for c in fitted.curves])[:-1]
    residuals = tuple(np.split(residual / scatter, ends))
    beyond_limits = [
        (abs(z), i, int(j))
        for i, (curve, of_curve) in enumerate(zip(fitted.curves, residuals, strict=True))
        for j, z in zip(curve.level, of_curve, strict=True)
        if abs(z) > _MISFIT_SIGMAS
    ]
    misfits = tuple((i, j) for _, i, j in sorted(beyond_limits, reverse=True))
    tested_p = p_value if resampled is None else bootstrapped
    sentence = _misfit_sentence(fitted, statistic, degrees, tested_p, residuals, misfits)
    return GoodnessOfFit(
        statistic=statistic,
        degrees=degrees,
        p_value=p_value,
        bootstrapped=bootstrapped,
        bootstrapped_error=error,
        draws=draws,
        residuals=residuals,
        misfits=misfits,
        sentence=sentence,
    )


def _misfit_sentence(
    fitted: NoiseFit,
    J: float,
    degrees: float,
    p: float,
    residuals: tuple[Array, ...],
    misfits: tuple[tuple[int, int], ...],
) -> str:
    """Return whether the model fits, and at which scales it does not, in words."""
    tested = f"J {J:.1f} for {degrees:.4g} degrees of freedom, {p_text(p)}"
    if p >= _SIGNIFICANCE:
        return f"{fitted.composition} fits: {tested}"
    worst = []
    for i, j in misfits[:_NAMED_SCALES]:
        k = int(np.flatnonzero(fitted.curves[i].level == j)[0])
        where = f"scale {fitted.curves[i].scale_s[k]:.3g} s"
        if len(fitted.curves) > 1:
            where += f" of curve {i + 1}"
        worst.append(f"{where} ({residuals[i][k]:+.1f} sigma)")
    finding = "no scale stands out, the misfit is spread"
    advice = "take another model"
    if worst:
        unnamed = len(misfits) - _NAMED_SCALES
        finding = f"worst at {', '.join(worst)}" + (f" and {unnamed} more" if unnamed > 0 else "")
        advice = "take another model or leave these scales out"
    return (
        f"{fitted.composition} does not fit: {tested}; {finding}; standard errors hold where a"
        f" model fits, {advice}"
    )
