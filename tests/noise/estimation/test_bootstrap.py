"""Simulated series and drawn wavelet variances against theory and against each other."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from insgnss.base.errors import UsageError
from insgnss.navigation.noise_model.model import AxisNoise, GaussMarkov
from insgnss.noise.estimation.bootstrap import (
    _draws_of_recordings,
    _draws_of_reduced_recordings,
    bootstrap,
    draw_variances,
    has_interval_weights,
    redraw_curves,
    refit,
    robust_efficiency,
    simulate_axis,
)
from insgnss.noise.estimation.gmwm import NoiseFit, fit
from insgnss.noise.estimation.inference import efficient, infer
from insgnss.noise.moments.theory import haar_variance
from insgnss.noise.moments.wavelet import wavelet_variance
from insgnss.records import WaveletVariance

RATE = 20.0
AXES = {
    "white": AxisNoise(white_noise=0.3),
    "quantized": AxisNoise(quantization=0.02),
    "walk": AxisNoise(random_walk=0.1),
    "short": AxisNoise(gauss_markov=(GaussMarkov(0.05, 2.0),)),  # of one sample
    "clear": AxisNoise(white_noise=0.3, gauss_markov=(GaussMarkov(5.0, 0.3),)),
    "long": AxisNoise(
        white_noise=0.3, gauss_markov=(GaussMarkov(3.0, 0.2), GaussMarkov(100.0, 0.05))
    ),
}


def series_fit(n: int, axis: AxisNoise, composition: str) -> NoiseFit:
    """A fit to one simulated series; the processes drawn from are the fitted ones."""
    return fit(
        wavelet_variance(simulate_axis(axis, n, RATE, np.random.default_rng(3)), RATE), composition
    )


@pytest.mark.parametrize("sampling", ["point", "mean"])
@pytest.mark.parametrize("name", AXES)
def test_series_have_the_wavelet_variance_of_theory(name, sampling):
    """Oracle: the theoretical wavelet variance; means of 40 series within 4.5 of their standard
    errors.
    """
    curves = np.array(
        [
            wavelet_variance(
                simulate_axis(AXES[name], 4096, RATE, np.random.default_rng([1, k]), sampling),
                RATE,
                levels=8,
            ).variance
            for k in range(40)
        ]
    )
    expected = haar_variance(AXES[name], np.arange(1, 9), RATE, sampling)
    assert (
        np.abs(curves.mean(axis=0) - expected) < 4.5 * curves.std(axis=0, ddof=1) / math.sqrt(40)
    ).all()


def test_the_drift_is_a_slope_of_known_size():
    """Oracle: closed form, w m / (2 rate) for every coefficient of a line."""
    x = simulate_axis(AxisNoise(drift=0.5, turn_on_bias=3.0), 1024, RATE, np.random.default_rng(0))
    assert_allclose(np.diff(x), 0.5 / RATE, rtol=1e-9)
    assert_allclose(
        wavelet_variance(x, RATE).variance,
        (0.5 * 2.0 ** np.arange(9) / (2.0 * RATE)) ** 2,
        rtol=1e-6,
    )


@pytest.mark.parametrize("sampling", [pytest.param("point", marks=pytest.mark.slow), "mean"])
@pytest.mark.slow
def test_reduced_draws_are_those_of_whole_series(sampling):
    """Oracle: simulation of all samples; mean, standard deviation, skewness and correlation within
    what 160 draws scatter.
    """
    fitted = replace(series_fit(2**17, AXES["long"], "WN+2GM"), sampling=sampling)
    a, b = (
        drawn(fitted, fitted.curves[0], 160, (4, 0)) / fitted.modelled[0]
        for drawn in (_draws_of_recordings, _draws_of_reduced_recordings)
    )
    sigma = np.hypot(a.std(axis=0, ddof=1), b.std(axis=0, ddof=1)) / math.sqrt(160)
    assert (np.abs(a.mean(axis=0) - b.mean(axis=0)) < 4.0 * sigma).all()
    assert_allclose(
        a.std(axis=0) / b.std(axis=0), 1.0, atol=0.3
    )  # of skewed distributions; 0.06 of normal ones
    assert_allclose(
        np.quantile(a[:, -3:], [0.1, 0.5, 0.9], axis=0),
        np.quantile(b[:, -3:], [0.1, 0.5, 0.9], axis=0),
        rtol=0.3,
    )
    assert_allclose(np.corrcoef(a.T), np.corrcoef(b.T), atol=0.35)


def test_reduced_draws_have_the_moments_of_the_processes(monkeypatch):
    """Oracle: mean and exact covariance of the wavelet variances in theory, of a recording that is
    drawn by 64 blocks; what 600 draws scatter. Levels below are normal given those above.
    """
    from insgnss.noise.estimation import bootstrap as module
    from insgnss.noise.moments.haar_covariance import haar_covariance

    monkeypatch.setattr(module, "_BLOCKS", 7)
    curve = wavelet_variance(np.random.default_rng(1).normal(size=2**11), RATE, levels=9)
    fitted = SimpleNamespace(axis=AXES["clear"], sampling="point", curves=(curve,))
    drawn = _draws_of_reduced_recordings(fitted, curve, 600, (4, 0))
    expected = haar_variance(AXES["clear"], curve.level, RATE, "point")
    V = haar_covariance(AXES["clear"], curve.level, curve.samples, RATE, "point")
    sigma = np.sqrt(np.diag(V))
    assert_allclose((drawn.mean(axis=0) - expected) / sigma, 0.0, atol=4.5 / math.sqrt(600))
    assert_allclose(drawn.std(axis=0) / sigma, 1.0, atol=0.2)
    assert_allclose(np.corrcoef(drawn.T), V / np.outer(sigma, sigma), atol=0.2)


def test_seeds_decide_all():
    """Oracle: the contract; draws do not depend on how many threads there are or how many draws
    follow.
    """
    fitted = series_fit(2**12, AXES["long"], "WN+GM")
    first, again, other = (draw_variances(fitted, 6, seed=s)[0] for s in (1, 1, 2))
    assert_array_equal(first, again)
    assert_array_equal(draw_variances(fitted, 1, seed=1)[0], first[:1])
    assert not np.array_equal(first, other)
    assert_array_equal(draw_variances(fitted, 3, seed=1)[0], first[:3])
    two = replace(fitted, curves=fitted.curves * 2, weights=fitted.weights * 2)
    a, b = draw_variances(two, 3, seed=1)
    assert not np.array_equal(a, b)


def test_intervals_are_the_mirror_image_of_quantiles():
    """Oracle: numpy's quantiles of the re-fits' logarithms."""
    b = bootstrap(series_fit(2**13, AXES["white"], "WN"), 60, seed=5)
    logs, own = np.log(b.parameters[:, 0]), math.log(b.fit.parameters[0])
    low, high = np.quantile(logs, [0.025, 0.975])
    assert_allclose(np.log(b.interval()).ravel(), [2 * own - high, 2 * own - low], atol=1e-4)


@pytest.mark.slow
def test_bootstrapped_errors_are_those_of_the_sandwich():
    """Oracle: the sandwich with the exact covariance; 120 draws scatter by 6.5 %."""
    fitted = efficient(series_fit(2**14, AXES["clear"], "WN+GM"))
    b = bootstrap(fitted, 120, seed=6)
    expected = [e.log_error for e in infer(fitted).estimates]
    assert_allclose(np.log(b.parameters).std(axis=0, ddof=1), expected, rtol=0.25)
    interval = infer(fitted, intervals="bootstrap", draws=100, seed=6)
    assert interval.intervals == "bootstrap"
    for e in interval.estimates:
        assert 0.0 < e.low < e.high


def test_refits_follow_the_manner_of_the_fit():
    """Oracle: the fit itself, when its own curves are given again."""
    first = series_fit(2**12, AXES["long"], "WN+GM")
    for fitted in (first, efficient(first)):
        curves = next(redraw_curves(fitted, tuple(c.variance[None] for c in fitted.curves)))
        assert_allclose(refit(fitted, curves).parameters, fitted.parameters, rtol=1e-6)
    assert has_interval_weights(first)
    assert not has_interval_weights(efficient(first))


def robust_curve(efficiency: float, decomposition: str = "modwt") -> WaveletVariance:
    x = np.random.default_rng(2).standard_normal(2**12)
    return wavelet_variance(
        x, RATE, robust=True, efficiency=efficiency, decomposition=decomposition
    )


@pytest.mark.parametrize("decomposition", ["modwt", "dwt"])
def test_the_efficiency_of_a_robust_curve_is_in_its_intervals(decomposition):
    """Oracle: the efficiency that the estimate was made with."""
    assert_allclose(robust_efficiency(robust_curve(0.6, decomposition)), 0.6, rtol=1e-9)
    assert robust_efficiency(replace(robust_curve(0.9), robust=False)) == 1.0


@pytest.mark.slow
@pytest.mark.parametrize("decomposition", ["modwt", "dwt"])
def test_robust_draws_are_robust(decomposition):
    """Oracle: the definition of efficiency; the variance of the robust estimate at the shortest
    scale is 1/0.6 of the plain one's.
    """
    curve = robust_curve(0.6, decomposition)
    fitted = fit(curve, "WN")
    robust = draw_variances(fitted, 150, seed=1)[0][:, 0]
    plain = _draws_of_recordings(fitted, replace(curve, robust=False), 150, (1, 0))[:, 0]
    assert_allclose(robust.var() / plain.var(), 1.0 / 0.6, rtol=0.5)
    assert_allclose(robust.mean() / fitted.modelled[0][0], 1.0, atol=0.01)


def test_wrong_use_is_refused():
    """Oracle: the contract."""
    fitted = fit(robust_curve(0.6), "WN")
    with pytest.raises(UsageError, match="0 draws"):
        draw_variances(fitted, 0)
