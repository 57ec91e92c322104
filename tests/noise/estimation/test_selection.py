"""Information criterion, cross-validation and near-stationarity against closed forms of linear
models and simulated recordings.
"""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from insgnss.base.errors import UsageError
from insgnss.navigation.noise_model.model import AxisNoise, GaussMarkov
from insgnss.noise.estimation import selection
from insgnss.noise.estimation.bootstrap import simulate_axis
from insgnss.noise.estimation.estimates import Linearised
from insgnss.noise.estimation.gmwm import fit, interval_weights, objective
from insgnss.noise.estimation.inference import covariances, efficient
from insgnss.noise.estimation.near_stationarity import near_stationarity
from insgnss.noise.estimation.selection import closed_optimism, rank
from insgnss.noise.moments.haar_covariance import haar_covariance
from insgnss.noise.moments.theory import haar_variance
from insgnss.noise.moments.wavelet import wavelet_variance
from insgnss.records import WaveletVariance

RATE, N = 10.0, 2**14
SLOW = AxisNoise(white_noise=1.0, gauss_markov=(GaussMarkov(10.0, 0.6),))
WALK = AxisNoise(white_noise=1.0, random_walk=0.1)


def recording(axis: AxisNoise, seed: int, n: int = N) -> WaveletVariance:
    return wavelet_variance(simulate_axis(axis, n, RATE, np.random.default_rng([77, seed])), RATE)


def unit(name: str, level: np.ndarray) -> np.ndarray:
    return haar_variance(replace(AxisNoise(), **{name: 1.0}), level, RATE)


def moved(axis: AxisNoise, sigmas: np.ndarray | float, levels: int = 11) -> WaveletVariance:
    """The curve of `axis` moved by `sigmas` standard deviations."""
    level = np.arange(1, levels + 1)
    V = haar_covariance(axis, level, N, RATE)
    nu = haar_variance(axis, level, RATE) + sigmas * np.sqrt(np.diag(V))
    eta = np.maximum((N - 2**level + 1) / 2.0**level, 1.0)
    return WaveletVariance(
        level,
        nu,
        eta * nu / stats.chi2.ppf(0.975, eta),
        eta * nu / stats.chi2.ppf(0.025, eta),
        N - 2**level + 1,
        RATE,
        N,
    )


@pytest.mark.parametrize("weights", ["efficient", "interval"])
def test_penalty_of_a_linear_model(weights):
    """Oracle: closed form, 2 tr(Omega A (A' Omega A)^-1 A' Omega V), which is twice the number of
    parameters for Omega = V^-1.
    """
    w = moved(WALK, 0.3 * np.random.default_rng(1).standard_normal(11))
    candidate = rank([w], ["WN+RW"], weights=weights).candidates[0]
    V = covariances(efficient(fit(w, "WN+RW")) if weights == "efficient" else fit(w, "WN+RW"))[0]
    A = np.array([unit("white_noise", w.level), unit("random_walk", w.level)]).T
    W = candidate.fit.weights[0]
    assert_allclose(
        candidate.optimism,
        2.0 * np.trace(W @ A @ np.linalg.inv(A.T @ W @ A) @ A.T @ W @ V),
        rtol=1e-4,
    )
    if weights == "efficient":
        assert_allclose(candidate.optimism, 4.0, rtol=1e-4)
    assert_allclose(candidate.wic, candidate.fit.objective + candidate.optimism, rtol=1e-12)


def test_penalty_where_the_model_does_not_fit():
    """Oracle: the definition (S.1), by moving nu_hat along each scale and fitting again."""
    w = moved(SLOW, np.r_[np.zeros(7), 1.0, -1.0, 0.5, 0.5])
    W = (np.linalg.inv(haar_covariance(SLOW, w.level, N, RATE)),)
    V = haar_covariance(SLOW, w.level, N, RATE)
    fitted = fit(w, "WN+GM", weights=W)
    total = 0.0
    for k, size in enumerate(1e-3 * np.sqrt(np.diag(V))):
        ends = []
        for sign in (1.0, -1.0):
            other = replace(w, variance=w.variance + sign * size * np.eye(11)[k])
            ends.append(fit(other, "WN+GM", weights=W).modelled[0])
        total += 2.0 * float(W[0][:, :] @ (ends[0] - ends[1]) / (2.0 * size) @ V[k])
    assert_allclose(closed_optimism(fitted, Linearised(fitted, [V])), total, rtol=1e-3)


def test_drawn_penalty_agrees_with_the_closed_one():
    """Oracle: the closed form; 300 draws of a chi-square of two degrees of freedom scatter by 8 %,
    skewness adds some.
    """
    w = recording(WALK, 1)
    closed, drawn = (
        rank([w], ["WN+RW"], draws=draws, seed=3).candidates[0].optimism for draws in (0, 300)
    )
    assert_allclose(drawn, closed, rtol=0.4)


@pytest.mark.parametrize(
    ("axis", "truth"), [(SLOW, "WN+GM"), (WALK, "WN+RW"), (AxisNoise(white_noise=1.0), "WN")]
)
@pytest.mark.slow
def test_the_true_model_is_chosen(axis, truth):
    """Oracle: simulation. The criterion takes one parameter too many in a sixth of cases, as
    Akaike's; never one too few here.
    """
    chosen = [
        str(
            rank(
                [recording(axis, seed)], ["WN", "GM", "WN+GM", "WN+RW", "QN+WN", "WN+2GM"]
            ).chosen.composition
        )
        for seed in range(3)
    ]
    assert chosen.count(truth) >= 2
    rankings = [rank([recording(axis, seed)], "QN+WN+2GM+RW") for seed in range(3)]
    assert [str(ranking.chosen.composition) for ranking in rankings].count(truth) >= 2
    ranking = rankings[0]
    assert ranking.criterion == "WIC"
    assert len(ranking.candidates) == 23
    wics = [c.wic for c in ranking.candidates]
    assert_allclose(wics, sorted(wics), rtol=1e-8)
    assert min(c.difference for c in ranking.candidates) == 0.0
    assert ranking.chosen.p_value > 0.01
    worst = ranking.candidates[-1]
    assert worst.p_value < 1e-10
    assert any("misfit" in remark for remark in worst.remarks)
    table = ranking.table().splitlines()
    assert len(table) == 24
    assert next(line for line in table if line.startswith("* ")).split()[1] == truth


def test_cross_validation_leaves_out_one_recording_after_the_other():
    """Oracle: fits made here of all recordings but one, and the objective on that one."""
    curves = [recording(SLOW, k) for k in range(3, 7)]
    ranking = rank(curves, ["WN", "WN+GM"], weights="interval", criterion="CVWVIC")
    best = ranking.candidates[0]
    assert str(best.composition) == "WN+GM"
    for k, held_out in enumerate(best.held_out):
        others = fit([c for i, c in enumerate(curves) if i != k], "WN+GM")
        assert_allclose(
            held_out, objective(others.axis, [curves[k]], [interval_weights(curves[k])]), rtol=1e-6
        )
    assert_allclose(best.cross_validated, best.held_out.mean(), rtol=1e-12)
    grouped = rank(curves, ["WN+GM"], recordings=[0, 0, 1, 1]).candidates[0]
    assert grouped.held_out.shape == (2,)


def test_wilcoxon_decides_which_models_are_equivalent():
    """Oracle: the signed-rank distribution; of five recordings that all get worse p is 1/32 < 5 %,
    of four 1/16.
    """
    for count, told_apart in ((5, True), (4, False)):
        curves = [recording(SLOW, k) for k in range(10, 10 + count)]
        ranking = rank(curves, ["WN", "WN+GM"], criterion="CVWVIC")
        assert str(ranking.chosen.composition) == ("WN+GM" if told_apart else "WN")


def test_near_stationarity_of_a_linear_model_is_cochrans_statistic():
    """Oracle: closed form of the heterogeneity of independent estimates, sum (v_i - mean)^2 / var
    v.
    """
    curves = [moved(AxisNoise(white_noise=1.0), s) for s in (0.5, -0.2, 0.1, -0.6)]
    test = near_stationarity(fit(curves, "WN"), draws=0)
    W = test.joint.weights[0]
    U = unit("white_noise", curves[0].level)
    v = np.array([U @ W @ c.variance for c in curves]) / (U @ W @ U)
    share = (v - v.mean()) ** 2 * (U @ W @ U)
    assert_allclose(test.statistic, share.sum(), rtol=1e-6)
    assert_allclose(test.shares, share, rtol=1e-5, atol=1e-8)
    assert_allclose(test.p_value, stats.chi2.sf(share.sum(), 3), rtol=1e-6)
    assert math.isnan(test.bootstrapped)
    name, found, expected = test.spread[0]
    assert name == "white_noise"
    assert_allclose(found, np.std(0.5 * np.log(v), ddof=1), rtol=1e-6)
    assert_allclose(expected, 0.5 / v.mean() / math.sqrt(U @ W @ U), rtol=1e-3)


@pytest.mark.slow
def test_near_stationarity_tells_a_disturbed_recording():
    """Oracle: construction; the third recording has half more driving noise, several times its
    standard error.
    """
    disturbed = AxisNoise(white_noise=1.0, gauss_markov=(GaussMarkov(10.0, 0.9),))
    alike = [recording(SLOW, k) for k in range(20, 24)]
    calm = near_stationarity(fit(alike, "WN+GM"), draws=30, seed=1)
    assert calm.bootstrapped > 0.05
    assert abs(calm.bootstrapped - calm.p_value) < 4.0 * max(calm.bootstrapped_error, 0.05)
    assert "serves all 4 recordings" in calm.sentence
    test = near_stationarity(
        fit([*alike[:2], recording(disturbed, 30), alike[3]], "WN+GM"), draws=30, seed=1
    )
    assert test.bootstrapped < 0.05
    assert int(np.argmax(test.shares)) == 2
    assert "recording 3 has" in test.sentence
    assert "; recording 1.npy has" in test.in_words(["a.npy", "b.npy", "recording 1.npy", "c.npy"])
    assert test.degrees == 9
    assert len(test.single) == 4


def test_wrong_use_is_refused():
    """Oracle: the contract."""
    curves = [recording(SLOW, 1)]
    with pytest.raises(UsageError, match="neither 'efficient' nor 'interval'"):
        rank(curves, "WN+GM", weights="equal")
    with pytest.raises(UsageError, match="no model to rank"):
        rank(curves, [])
    with pytest.raises(UsageError, match="2 recording numbers for 1 curves"):
        rank(curves, "WN", recordings=[1, 2])
    with pytest.raises(UsageError, match="neither 'WIC' nor 'CVWVIC'"):
        rank(curves, "WN", criterion="AIC")
    with pytest.raises(UsageError, match="needs two at least"):
        rank(curves, "WN", criterion="CVWVIC")
    with pytest.raises(UsageError, match="comparison of two or more"):
        near_stationarity(fit(curves, "WN"))
    with pytest.raises(UsageError, match="2 recording numbers"):
        near_stationarity(fit(curves * 3, "WN"), recordings=[0, 1])


def test_the_worst_misfit_is_named(monkeypatch):
    """Oracle: the misfits of the test, worst first: level 3 of the second curve, at 10 Hz."""
    goodness = SimpleNamespace(p_value=0.0, misfits=((1, 3), (0, 5)))
    monkeypatch.setattr(selection, "goodness_of_fit", lambda *_: goodness)
    curves = [moved(WALK, 0.0), moved(WALK, 0.0)]
    best = rank(curves, ["WN"], weights="interval").candidates[0]
    assert "misfit, worst at scale 0.8 s of curve 2" in best.remarks
