r"""Parametric bootstrap of wavelet variances and of fits: what would other recordings of the fitted
processes have given?

Two ways to draw the wavelet variances of a recording of n samples:

"series"    simulates all n samples and takes their wavelet variance as that of the recording was
            taken. What it says is exact.
"reduced"   simulates means over blocks of 2^k samples, 2^15 to 2^16 blocks, exactly, and takes the
            levels from k + 4 on from them. With a stride of 2^k instead of one sample, an eighth of
            m or less, they have the distribution of the full estimate to a few per thousand, be it
            ever so skewed. The levels below have degrees of freedom in the thousands and are drawn
            as normal given the others, from the exact covariance V of all levels (s small, l large
            levels):

                nu_s = E nu_s + V_sl V_ll^-1 (nu_l - E nu_l)
                       + normal of covariance V_ss - V_sl V_ll^-1 V_ls                         (B.1)

            A few milliseconds instead of a tenth of a second per million samples.

The interval of a bootstrapped fit is the "basic" one, the quantiles of the re-fitted parameters
mirrored at the estimate on the logarithmic scale, which takes out the bias that the re-fits show
(Davison and Hinkley 1997, chapter 5).
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...base.advance import through
from ...base.errors import UsageError
from ...navigation.noise_model.model import AxisNoise
from ...records import Array, WaveletVariance
from ..moments.haar_covariance import haar_covariance
from ..moments.theory import Sampling, haar_variance
from ..moments.wavelet import in_threads, wavelet_variance
from ..processes.realisation import simulate_noise
from .gmwm import NoiseFit, fit_alike, interval_weights

_BLOCKS = 15  # binary logarithm of the least number of blocks of "reduced"
_FIRST = 4  # level, counted in blocks, from which the block means serve


@dataclass(frozen=True, eq=False)
class Bootstrap:
    """Re-fits of drawn wavelet variances.

    parameters : (B, p), SI, in the order of the composition.
    objective : (B,).
    """

    fit: NoiseFit
    parameters: Array
    objective: Array

    def interval(self, level: float = 0.95) -> tuple[Array, Array]:
        """Lower and upper limits (p,), SI."""
        low, high = np.quantile(self.parameters, [0.5 - 0.5 * level, 0.5 + 0.5 * level], axis=0)
        square = self.fit.parameters**2
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(high > 0.0, square / high, 0.0), np.where(
                low > 0.0, square / low, np.inf
            )


_UPPER_95 = 0.975  # of chi-square, the upper end of a 95 % interval
_SAME_WEIGHTS = 1e-9  # relative difference of two weights that are the same but for rounding


def simulate_axis(
    axis: AxisNoise, n: int, rate_hz: float, rng: np.random.Generator, sampling: Sampling = "point"
) -> Array:
    """Return one series (n,), X, of which `theory.haar_variance` with the same `sampling` is the
    wavelet variance.

    All of it is normal, rounding errors too, as `haar_covariance` has it. The drift is a slope of
    known size, and the turn-on bias, which no wavelet variance shows, is left out.
    """
    random_part = replace(axis, quantization=0.0, drift=0.0, turn_on_bias=0.0)
    out = simulate_noise(random_part, n, 1.0 / rate_hz, rng, sampling)
    if axis.quantization:
        out += axis.quantization * rate_hz * np.diff(rng.standard_normal(n + 1))
    if axis.drift:
        out += axis.drift / rate_hz * np.arange(n)
    return out


def draw_variances(fitted: NoiseFit, draws: int, *, seed: int = 0) -> tuple[Array, ...]:
    """Return wavelet variances (draws, J_i) of each curve, X^2, at the levels of the fit, from
    recordings of the fitted processes; "reduced" for plain maximal-overlap curves of more than 2^17
    samples.

    Raises UsageError for fewer than one draw.
    """
    if draws < 1:
        raise UsageError(f"{draws} draws; give at least 1")
    out = []
    for i, curve in enumerate(fitted.curves):
        is_plain = curve.decomposition == "modwt" and not curve.robust
        draw = (
            _draws_of_reduced_recordings
            if is_plain and curve.samples > 2 ** (_BLOCKS + 2)
            else _draws_of_recordings
        )
        out.append(draw(fitted, curve, draws, (seed, i)))
    return tuple(out)


def _draws_of_recordings(
    fitted: NoiseFit, curve: WaveletVariance, draws: int, seed: tuple[int, int]
) -> Array:
    """Return wavelet variances (draws, J), X^2, of whole simulated recordings."""
    highest = int(curve.level[-1])
    options: dict[str, Any] = {"decomposition": curve.decomposition}
    if curve.robust:
        options |= {"robust": True, "efficiency": robust_efficiency(curve)}

    def draw(k: int) -> Array:
        rng = np.random.default_rng([*seed, k])
        x = simulate_axis(fitted.axis, curve.samples, curve.rate_hz, rng, fitted.sampling)
        return wavelet_variance(x, curve.rate_hz, levels=highest, **options).variance[
            curve.level - 1
        ]

    return np.array(in_threads(draw, draws))


def _draws_of_reduced_recordings(
    fitted: NoiseFit, curve: WaveletVariance, draws: int, seed: tuple[int, int]
) -> Array:
    """Return wavelet variances (draws, J), X^2: long scales of block means, short ones by (B.1)."""
    k = curve.samples.bit_length() - 1 - _BLOCKS
    blocks = curve.samples >> k
    block_s = 2**k / curve.rate_hz
    expected = haar_variance(fitted.axis, curve.level, curve.rate_hz, fitted.sampling)
    large = curve.level >= k + _FIRST
    block_level = curve.level[large] - k
    out = np.empty((draws, curve.level.size))
    if large.any():
        ratio = expected[large] / haar_variance(fitted.axis, block_level, 1.0 / block_s, "mean")

        def draw(i: int) -> Array:
            rng = np.random.default_rng([*seed, i])
            x = simulate_axis(fitted.axis, blocks, 1.0 / block_s, rng, "mean")
            curve_of_blocks = wavelet_variance(x, 1.0 / block_s, levels=int(block_level[-1]))
            return curve_of_blocks.variance[block_level - 1] * ratio

        out[:, large] = in_threads(draw, draws)
    if not large.all():
        cov = haar_covariance(
            fitted.axis, curve.level, curve.samples, curve.rate_hz, fitted.sampling
        )
        gain = np.linalg.solve(cov[np.ix_(large, large)], cov[np.ix_(large, ~large)])
        conditional = cov[np.ix_(~large, ~large)] - cov[np.ix_(~large, large)] @ gain
        normal = np.random.default_rng([*seed, draws]).standard_normal((draws, int((~large).sum())))
        out[:, ~large] = (
            expected[~large]
            + (out[:, large] - expected[large]) @ gain
            + normal @ np.linalg.cholesky(conditional).T
        )  # (B.1)
    return out


def robust_efficiency(curve: WaveletVariance) -> float:
    """Return the efficiency of a robust curve, from how much its intervals are wider than those of
    the plain estimate; 1 for a plain one.
    """
    from scipy.special import chdtri

    if not curve.robust:
        return 1.0
    degrees = float(curve.count[0])
    if curve.decomposition == "modwt":
        degrees = max(curve.count[0] / 2.0 ** curve.level[0], 1.0)
    plain_width = degrees / chdtri(degrees, _UPPER_95) - 1.0
    return float((plain_width / (curve.high[0] / curve.variance[0] - 1.0)) ** 2)


def redraw_curves(
    fitted: NoiseFit, variances: tuple[Array, ...]
) -> Iterator[tuple[WaveletVariance, ...]]:
    """Yield the fit's curves with each row of `variances` in place of theirs, intervals in
    proportion.
    """
    for rows in zip(*variances, strict=True):
        yield tuple(
            replace(
                curve,
                variance=row,
                low=curve.low * row / curve.variance,
                high=curve.high * row / curve.variance,
            )
            for curve, row in zip(fitted.curves, rows, strict=True)
        )


def has_interval_weights(fitted: NoiseFit) -> bool:
    """Return whether the fit's weights are those of the intervals of its curves."""
    return all(
        np.allclose(omega, interval_weights(curve), rtol=_SAME_WEIGHTS)
        for omega, curve in zip(fitted.weights, fitted.curves, strict=True)
    )


def refit(fitted: NoiseFit, curves: tuple[WaveletVariance, ...]) -> NoiseFit:
    """Fit other curves in the manner of `fitted`: interval weights are those of the new curves,
    other weights stay.
    """
    weights = None if has_interval_weights(fitted) else fitted.weights
    return fit_alike(fitted, curves, weights)


def bootstrap(fitted: NoiseFit, draws: int = 100, *, seed: int = 0) -> Bootstrap:
    """Draw wavelet variances of the fitted processes and re-fit each draw, in the manner of the
    fit.

    seed : as in `draw_variances`, and the errors too.
    """
    variances = draw_variances(fitted, draws, seed=seed)
    fits = [refit(fitted, curves) for curves in through(list(redraw_curves(fitted, variances)))]
    return Bootstrap(
        fitted,
        np.array([f.parameters for f in fits]),
        np.array([f.objective for f in fits]),
    )
