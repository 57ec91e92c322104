r"""How well a fit's parameters are determined, and whether the model fits: the efficient second
step, and all that is said of a fit.

V, the covariance of nu_hat at the fitted processes, is exact for Gaussian noise
(`haar_covariance`), times 1/efficiency for robust curves; recordings are independent of each other.

Efficient weights are V^-1 at the fit itself, fit and weights in turn repeated until they agree: the
estimate solves D' V^-1(theta) (nu_hat - nu(theta)) = 0, whose mean at the true theta is zero. In
one of six recordings with slow processes that has two solutions, and the global minimum jumps
between them; then that of the larger normal likelihood of nu_hat, the smaller

    log det V(theta) + (nu_hat - nu(theta))' V^-1(theta) (nu_hat - nu(theta)),                 (I.1)

is taken and followed. Weights from nu_hat itself, as those of the intervals,
favour scales that came out small by chance and pull the long-scale variances down: over 100
simulated 4-hour recordings of the NavChip 95 % sandwich intervals of such fits held the second
correlation time of the gyroscope in 61 cases, profiles of the efficient fit in 95.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...base.errors import DataError, UsageError
from ...records import Array
from ..moments.haar_covariance import haar_covariance
from ._profile import polish_fit
from .bootstrap import bootstrap, robust_efficiency
from .estimates import Linearised, NoiseEstimate, estimates
from .gmwm import NoiseFit, fit_alike
from .goodness import GoodnessOfFit, goodness_of_fit
from .identifiability import ProcessVerdict, verdicts

INTERVALS = ("auto", "sandwich", "profile", "bootstrap")
_LARGEST_CONDITION = 1e10  # of the correlation matrix of nu_hat
_SETTLED = 0.03  # standard errors by which repeated weights may still move the fit


@dataclass(frozen=True, eq=False)
class Inference:
    """What a fit is worth.

    covariance (p, p) : of the logarithms of the parameters; NaN for those at an edge.
    intervals : "sandwich", "profile" or "bootstrap".
    """

    fit: NoiseFit
    estimates: tuple[NoiseEstimate, ...]
    covariance: Array
    goodness: GoodnessOfFit
    verdicts: tuple[ProcessVerdict, ...]
    intervals: str

    def __getitem__(self, name: str) -> NoiseEstimate:
        """The estimate of a parameter by its name."""
        return next(e for e in self.estimates if e.name == name)


def covariances(fitted: NoiseFit) -> tuple[Array, ...]:
    """V (J_i, J_i), X^4, of the wavelet variances of each curve at the fitted processes.

    Raises UsageError for a "dwt" curve.
    """
    # recordings of the same length and rate share it
    computed: dict[tuple[object, ...], Array] = {}
    out = []
    for curve in fitted.curves:
        if curve.decomposition != "modwt":
            raise UsageError(
                "the covariance is that of 'modwt' wavelet variances, not of"
                f" {curve.decomposition!r}; take those"
            )
        key = (curve.samples, curve.rate_hz, *curve.level.tolist())
        if key not in computed:
            computed[key] = haar_covariance(
                fitted.axis, curve.level, curve.samples, curve.rate_hz, fitted.sampling
            )
        out.append(computed[key] / robust_efficiency(curve))
    return tuple(out)


_FEWEST_DRAWS = 20  # of which the ends of a 95 % interval can be taken at all


def inverse(V: Array) -> Array:
    """Return V^-1 of a covariance matrix (J, J) of any magnitude.

    It is all NaN where the correlations are singular to ten digits.
    """
    sigma = np.sqrt(np.diag(V))
    if not (np.isfinite(V).all() and sigma.min() > 0.0):
        return np.full(V.shape, np.nan)
    R = V / np.outer(sigma, sigma)
    if not 0.0 < np.linalg.cond(R) < _LARGEST_CONDITION or np.linalg.eigvalsh(R)[0] <= 0.0:
        return np.full(V.shape, np.nan)
    W = np.linalg.inv(R) / np.outer(sigma, sigma)
    return np.asarray(0.5 * (W + W.T))


def second_step(first: NoiseFit, *, iterations: int = 6) -> tuple[NoiseFit, str, bool]:
    """Fit with the weights V^-1 of the fit before, repeated until it moves by less than 0.03
    standard errors.

    iterations : at most so many; then the best by (I.1) goes on in its basin.

    Returns the fit, how it went and whether it settled; where V cannot be inverted, the last fit
    that could be made, and why.
    """
    fitted = first
    scored_fits: list[tuple[float, NoiseFit]] = []
    for step in range(1, 2 * iterations + 1):
        if step == iterations + 1 and scored_fits:
            fitted = min(scored_fits, key=lambda scored: scored[0])[1]
        V = covariances(fitted)
        weights = [inverse(block) for block in V]
        singular = [i for i, W in enumerate(weights, start=1) if not np.isfinite(W).all()]
        if singular:
            which = f"the covariance of the wavelet variance of curve {singular[0]}"
            return (
                fitted,
                f"{which} is singular at step {step}; the weights of the previous step are kept",
                True,
            )
        if step > 1:
            scored_fits.append((_pseudo_likelihood(fitted, V, weights), fitted))
        if step <= iterations:
            refitted = fit_alike(first, first.curves, weights)
        else:
            refitted = polish_fit(fitted, weights)
        moved = _distance(fitted, refitted)
        fitted = refitted
        if moved < _SETTLED:
            return fitted, f"efficient weights, settled after {step} steps", True
    return fitted, f"efficient weights, not settled after {2 * iterations} steps", False


def _pseudo_likelihood(fitted: NoiseFit, V: Sequence[Array], weights: Sequence[Array]) -> float:
    """Return (I.1) of a fit with V and V^-1 at the fit itself."""
    rows = zip(fitted.residuals, V, weights, strict=True)
    return sum(float(np.linalg.slogdet(block)[1] + d @ W @ d) for d, block, W in rows)


def efficient(first: NoiseFit, *, iterations: int = 8) -> NoiseFit:
    """The fit of `second_step`: weights are the inverse covariance of the wavelet variance at the
    fit; `first` where that is singular.
    """
    return second_step(first, iterations=iterations)[0]


def _distance(previous: NoiseFit, refitted: NoiseFit) -> float:
    """Distance of the modelled wavelet variances in standard deviations of all moments together."""
    pairs = zip(previous.modelled, refitted.modelled, refitted.weights, strict=True)
    return math.sqrt(max(sum(float((a - b) @ W @ (a - b)) for a, b, W in pairs), 0.0))


def infer(fitted: NoiseFit, *, intervals: str = "auto", draws: int = 0, seed: int = 0) -> Inference:
    """Standard errors, 95 % intervals, J test and a verdict on each process.

    intervals : "sandwich" (E.1); "profile" of Q, for efficient weights; "bootstrap", basic, of
        `draws` re-fits; "auto" is profile for efficient weights and sandwich for others.
    draws : of the bootstrapped J test, 0 for none.
    seed : of all draws.

    Raises UsageError for other words, "profile" without efficient weights, and "bootstrap" without
    draws; as `covariances`; DataError for a fit that has no random process.
    """
    if intervals not in INTERVALS:
        raise UsageError(f"intervals {intervals!r} are none of {', '.join(INTERVALS)}")
    if intervals == "bootstrap" and draws < _FEWEST_DRAWS:
        raise UsageError(f"{draws} draws for bootstrapped intervals; give 100 or more")
    V = covariances(fitted)
    if not all(np.diag(block).all() for block in V):
        raise DataError(
            f"{fitted.composition}: the fit is a drift without noise, which determines nothing; add"
            " WN to the model"
        )
    sharp = is_efficient(fitted, V)
    if intervals == "profile" and not sharp:
        raise UsageError(
            "intervals of a profile need a fit with efficient weights; take efficient(fit) first"
        )
    kind = ("profile" if sharp else "sandwich") if intervals == "auto" else intervals
    linear = Linearised(fitted, V)
    resampled = bootstrap(fitted, draws, seed=seed) if draws else None
    results, log_covariance = estimates(fitted, linear, kind, resampled)
    weights = fitted.weights if sharp else tuple(inverse(block) for block in V)
    goodness = goodness_of_fit(fitted, linear, resampled)
    return Inference(
        fitted, results, log_covariance, goodness, verdicts(fitted, results, weights), kind
    )


def is_efficient(fitted: NoiseFit, V: Sequence[Array]) -> bool:
    """Return whether the weights are the inverse of V to a factor of two in every direction."""
    for omega, block in zip(fitted.weights, V, strict=True):
        sigma = np.sqrt(np.diag(block))
        scale = np.outer(sigma, sigma)
        root = np.linalg.cholesky(omega * scale)
        ratio = np.linalg.eigvalsh(root.T @ (block / scale) @ root)
        if not (ratio[0] > 0.5 and ratio[-1] < 2.0):
            return False
    return True
