"""Estimates, intervals and the J test against closed forms of linear models, brute-force profiles
and simulated recordings.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats
from scipy.optimize import minimize
from scipy.signal import lfilter

from insgnss.base.errors import UsageError
from insgnss.navigation.noise_model.model import AxisNoise, GaussMarkov
from insgnss.noise.estimation._profile import Local
from insgnss.noise.estimation.bootstrap import draw_variances, simulate_axis
from insgnss.noise.estimation.gmwm import fit, objective
from insgnss.noise.estimation.inference import covariances, efficient, infer, second_step
from insgnss.noise.moments.haar_covariance import haar_covariance
from insgnss.noise.moments.theory import haar_variance
from insgnss.noise.moments.wavelet import wavelet_variance
from insgnss.records import WaveletVariance

RATE, N = 10.0, 2**15
WALK = AxisNoise(white_noise=1.0, random_walk=0.05)
SLOW = AxisNoise(white_noise=1.0, gauss_markov=(GaussMarkov(20.0, 0.4),))


def curve_of(
    axis: AxisNoise, nudge: np.ndarray | float = 0.0, n: int = N, levels: int = 12
) -> WaveletVariance:
    """The curve that `axis` has on average, moved by `nudge` standard deviations."""
    level = np.arange(1, levels + 1)
    nu = haar_variance(axis, level, RATE)
    nu = nu + nudge * np.sqrt(np.diag(haar_covariance(axis, level, n, RATE)))
    eta = np.maximum((n - 2**level + 1) / 2.0**level, 1.0)
    low, high = eta * nu / stats.chi2.ppf(0.975, eta), eta * nu / stats.chi2.ppf(0.025, eta)
    return WaveletVariance(level, nu, low, high, n - 2**level + 1, RATE, n)


def recordings(count: int, n: int = N, seed: int = 1) -> list[WaveletVariance]:
    """Wavelet variances of recordings of SLOW, simulated here: white noise and an AR(1) that starts
    stationary.
    """
    gm = SLOW.gauss_markov[0]
    phi = math.exp(-1.0 / (RATE * gm.correlation_time_s))
    out = []
    for k in range(count):
        rng = np.random.default_rng([seed, k])
        w = rng.standard_normal(n) * gm.sigma * math.sqrt(1.0 - phi**2)
        w[0] = rng.standard_normal() * gm.sigma
        out.append(
            wavelet_variance(
                lfilter([1.0], [1.0, -phi], w) + rng.standard_normal(n) * math.sqrt(RATE), RATE
            )
        )
    return out


@pytest.mark.parametrize("levels", [[1, 2, 3, 4], [9, 10, 11, 12]])
def test_the_sandwich_of_a_density_of_zero_is_that_of_its_square(levels):
    """Oracle: the model is linear in the squares: 1.96 and 2.58 of the errors of (A' W A)^-1 A' W
    nu.

    At long scales rounding is lost in white noise, and its limit is a thousand times what it would
    be by itself.
    """
    w = curve_of(replace(WALK, random_walk=0.0), np.r_[-0.5, np.zeros(11)]).selected(levels)
    fitted = fit(w, "QN+WN")
    assert fitted.at_bound == ("quantization",)
    A = np.array(
        [
            haar_variance(AxisNoise(quantization=1.0), w.level, RATE),
            haar_variance(AxisNoise(white_noise=1.0), w.level, RATE),
        ]
    ).T
    W = fitted.weights[0]
    B = np.linalg.solve(A.T @ W @ A, A.T @ W)
    error = math.sqrt((B @ haar_covariance(fitted.axis, w.level, N, RATE) @ B.T)[0, 0])
    found = infer(fitted, intervals="sandwich")["quantization"]
    assert_allclose(
        [found.high, found.high_99], np.sqrt(error * np.array([1.959964, 2.575829])), rtol=1e-6
    )


@pytest.fixture(scope="module")
def inferred() -> list:
    """Efficient fits of WN+GM to 60 simulated recordings, and what is said of them."""
    return [infer(efficient(fit(w, "WN+GM"))) for w in recordings(60)]


def test_linear_model_is_generalised_least_squares():
    """Oracle: the closed form of Aitken's estimator in the variances, (A' W A)^-1 A' W nu and (A' W
    A)^-1.
    """
    nudge = np.random.default_rng(5).standard_normal(12) * 0.5
    w = curve_of(WALK, nudge)
    fitted, *_ = second_step(fit(w, "WN+RW"))
    A = np.array(
        [
            haar_variance(AxisNoise(white_noise=1.0), w.level, RATE),
            haar_variance(AxisNoise(random_walk=1.0), w.level, RATE),
        ]
    ).T
    W = fitted.weights[0]
    C = np.linalg.inv(A.T @ W @ A)
    v = C @ A.T @ W @ w.variance
    assert_allclose(fitted.parameters, np.sqrt(v), rtol=1e-8)
    found = infer(fitted, intervals="sandwich")
    B = C @ A.T @ W
    error = np.sqrt(np.diag(B @ covariances(fitted)[0] @ B.T)) / (2.0 * v)  # of log sqrt(v)
    assert_allclose([e.log_error for e in found.estimates], error, rtol=1e-8)
    assert_allclose(
        [e.high for e in found.estimates],
        np.sqrt(v) * np.exp(stats.norm.ppf(0.975) * error),
        rtol=1e-6,
    )
    assert_allclose(
        [e.high_99 for e in found.estimates],
        np.sqrt(v) * np.exp(stats.norm.ppf(0.995) * error),
        rtol=1e-6,
    )
    d = w.variance - A @ v
    assert_allclose(found.goodness.statistic, d @ W @ d, rtol=2e-3)  # weights settled to 0.03 sigma
    assert_allclose(found.goodness.degrees, 10.0, rtol=1e-3)


def test_profile_of_a_linear_model_is_a_parabola():
    """Oracle: closed form; with one linear parameter Q rises by (v - v_hat)^2 / var v."""
    w = curve_of(AxisNoise(white_noise=1.0), 0.3)
    fitted = efficient(fit(w, "WN"))
    found = infer(fitted, intervals="profile")["white_noise"]
    U = haar_variance(AxisNoise(white_noise=1.0), w.level, RATE)
    se = 1.0 / math.sqrt(U @ fitted.weights[0] @ U)
    v = fitted.parameters[0] ** 2
    for limit, z in ((found.low, -1.959964), (found.high, 1.959964), (found.high_99, 2.575829)):
        assert_allclose((limit**2 - v) / se, z, atol=0.02)


def test_a_density_of_zero_has_an_upper_limit():
    """Oracle: closed form; from an unconstrained estimate v < 0 the constrained Q rises by ((x -
    v)^2 - v^2) / var v.
    """
    white = AxisNoise(white_noise=1.0)
    w = curve_of(white, np.r_[np.zeros(8), -0.6 * np.ones(4)])
    fitted = efficient(fit(w, "WN+RW"))
    assert fitted.at_bound == ("random_walk",)
    W = fitted.weights[0]
    A = np.array(
        [
            haar_variance(AxisNoise(white_noise=1.0), w.level, RATE),
            haar_variance(AxisNoise(random_walk=1.0), w.level, RATE),
        ]
    ).T
    C = np.linalg.inv(A.T @ W @ A)
    v = (C @ A.T @ W @ w.variance)[1]
    assert v < 0.0
    found = infer(fitted, intervals="profile")["random_walk"]
    assert (found.value, found.low) == (0.0, 0.0)
    assert found.at_bound
    assert math.isnan(found.log_error)
    x = found.high**2
    assert_allclose(((x - v) ** 2 - v**2) / C[1, 1], 3.84, atol=0.06)
    by_error = infer(fitted, intervals="sandwich")["random_walk"]
    assert by_error.low == 0.0
    assert_allclose(
        by_error.high**2 / math.sqrt(C[1, 1]), 1.96, rtol=0.02
    )  # the weights are those of the step before


@pytest.mark.slow
def test_profile_limits_are_those_of_a_general_minimiser(inferred):
    """Oracle: scipy's Nelder-Mead over the other parameters; Q rises by 3.84 at the limits."""
    found = inferred[0]
    fitted = found.fit
    time = found["correlation_time_1"]
    assert found.intervals == "profile"
    for limit in (time.low, time.high):

        def rise(x: np.ndarray, T: float = limit) -> float:
            axis = AxisNoise(
                white_noise=math.exp(x[0]), gauss_markov=(GaussMarkov(T, math.exp(x[1])),)
            )
            return objective(axis, fitted.curves, fitted.weights) - fitted.objective

        best = minimize(
            rise,
            np.log(fitted.parameters[[0, 2]]),
            method="Nelder-Mead",
            options={"xatol": 1e-6, "fatol": 1e-6},
        )
        assert_allclose(best.fun, 3.84, atol=0.06)


@pytest.mark.slow
def test_intervals_hold_the_truth_and_errors_are_those_seen(inferred):
    """Oracle: simulation of 60 recordings; binomial and chi-square bounds at 0.1 %."""
    truth = np.array([1.0, 20.0, 0.4])
    inside = np.array(
        [
            [e.low <= t <= e.high for e, t in zip(found.estimates, truth, strict=True)]
            for found in inferred
        ]
    )
    assert inside.sum(axis=0).min() >= stats.binom.ppf(0.001, 60, 0.95)
    scaled = np.array(
        [
            [
                math.log(e.value / t) / e.log_error
                for e, t in zip(found.estimates, truth, strict=True)
            ]
            for found in inferred
        ]
    )
    low, high = np.sqrt(stats.chi2.ppf([0.0005, 0.9995], 59) / 59)
    assert (scaled.std(axis=0, ddof=1) > low).all()
    assert (
        scaled.std(axis=0, ddof=1) < high * 1.1
    ).all()  # logarithms of a time known to 20 % are a little wider than linear
    assert (np.abs(scaled.mean(axis=0)) < 1.0 / 3.0).all()


@pytest.mark.slow
def test_j_test_rejects_as_often_as_it_says(inferred):
    """Oracle: simulation; p-values of the true model are below 0.2 in a fifth of recordings, within
    binomial bounds at 0.1 %.
    """
    p = np.array([found.goodness.p_value for found in inferred])
    low, high = stats.binom.ppf([0.001, 0.999], 60, 0.2)
    assert low <= (p < 0.2).sum() <= high
    assert_allclose(
        inferred[0].goodness.degrees, inferred[0].fit.curves[0].level.size - 3, rtol=1e-2
    )


def test_j_test_finds_the_scale_that_misfits():
    """Oracle: construction; one level is moved by ten standard deviations."""
    found = infer(efficient(fit(curve_of(SLOW, np.eye(12)[4] * 10.0), "WN+GM")))
    assert found.goodness.p_value < 1e-6
    assert found.goodness.misfits[0] == (0, 5)
    assert "worst at scale 3.2 s" in found.goodness.sentence
    assert "fits" in infer(efficient(fit(curve_of(SLOW), "WN+GM"))).goodness.sentence


@pytest.mark.slow
def test_bootstrapped_j_test_agrees_with_the_asymptotic_one():
    """Oracle: chi-square, to 4 standard deviations of the bootstrap."""
    w = recordings(1, seed=9)[0]
    goodness = infer(efficient(fit(w, "WN+GM")), draws=150, seed=2).goodness
    assert goodness.draws == 150
    assert abs(goodness.bootstrapped - goodness.p_value) < 4.0 * max(
        goodness.bootstrapped_error, 0.02
    )
    assert_allclose(
        goodness.bootstrapped_error,
        math.sqrt(goodness.bootstrapped * (1.0 - goodness.bootstrapped) / 150),
        rtol=1e-12,
    )


def test_replicates_tighten_as_their_root():
    """Oracle: six independent recordings have a sixth of the variance."""
    w = curve_of(SLOW)
    one, six = (infer(efficient(fit([w] * k, "WN+GM"))) for k in (1, 6))
    for name in one.fit.composition.parameters:
        assert_allclose(one[name].log_error / six[name].log_error, math.sqrt(6.0), rtol=0.01)
    assert_allclose(six.goodness.degrees, 6 * 12 - 3, rtol=1e-6)


def test_efficient_is_a_fixed_point_and_better_than_interval_weights():
    """Oracle: Gauss and Markov; no weights give a smaller covariance than the inverse of V."""
    w = recordings(1, seed=3)[0]
    first = fit(w, "WN+GM")
    second = efficient(first)
    again, said, _ = second_step(second)
    assert "settled after 1 step" in said
    assert_allclose(again.parameters, second.parameters, rtol=0.01)
    diagonal = infer(
        replace(first, axis=second.axis, parameters=second.parameters), intervals="sandwich"
    )
    full = infer(second, intervals="sandwich")
    for a, b in zip(full.estimates, diagonal.estimates, strict=True):
        assert a.log_error <= b.log_error * 1.001


def test_singular_covariance_leaves_the_fit_and_says_why():
    """Oracle: a line of known slope has no variance at all."""
    w = replace(
        curve_of(SLOW), variance=haar_variance(AxisNoise(drift=1.0), np.arange(1, 13), RATE)
    )
    first = fit(w, "DR")
    after, said, _ = second_step(first)
    assert after is first
    assert "singular at step 1" in said


def test_robust_curves_have_a_larger_covariance():
    """Oracle: the definition of efficiency, a ratio of variances."""
    rng = np.random.default_rng(8)
    x = rng.standard_normal(4096)
    plain, robust = (
        fit(wavelet_variance(x, RATE, robust=r, efficiency=0.7), "WN") for r in (False, True)
    )
    ratio = covariances(replace(robust, axis=plain.axis))[0] / covariances(plain)[0]
    assert_allclose(ratio, 1.0 / 0.7, rtol=1e-6)


def test_curves_of_different_rate_and_length_share_their_parameters():
    """Oracle: numerical derivatives of the modelled curves, and the objective itself, whose changes
    the pooled problem must have.
    """
    slow = wavelet_variance(simulate_axis(SLOW, 5000, 2.0, np.random.default_rng(1)), 2.0)
    fitted = efficient(fit([*recordings(2, 2**13), slow], "WN+GM"))
    local = Local(fitted)
    x = local.coordinates(fitted.parameters)
    assert len(local.groups) == 2
    for i, step in enumerate(1e-5 * np.eye(3)):
        ends = [
            replace(fitted, axis=fitted.composition.axis(local.parameters(x + s)))
            for s in (step, -step)
        ]
        numerical = (np.concatenate(ends[0].modelled) - np.concatenate(ends[1].modelled)) / 2e-5
        assert_allclose(local.derivative(x)[:, i], numerical, rtol=1e-5, atol=1e-9)
    away = local.parameters(x + 0.1)
    rise = (
        objective(fitted.composition.axis(away), fitted.curves, fitted.weights) - fitted.objective
    )
    pooled = [float(r @ r) for r, _ in (local.residual(x + 0.1), local.residual(x))]
    assert_allclose(pooled[0] - pooled[1], rise, rtol=1e-8)


def test_limits_of_the_caller_end_the_interval():
    """Oracle: the contract of `times_s`."""
    w = recordings(1, seed=3)[0]
    fitted = efficient(fit(w, "WN+GM", times_s=(0.5, 15.0)))
    assert fitted.times_s == (0.5, 15.0)
    assert fitted.parameters[1] == pytest.approx(15.0)
    time = infer(fitted)["correlation_time_1"]
    assert time.at_bound
    assert time.high == 15.0
    assert 0.5 <= time.low < 15.0


def test_the_covariance_is_that_of_drawn_variances():
    """Oracle: a parametric bootstrap; correlations of 400 draws scatter by 0.05, their standard
    deviations by 3.5 %.
    """
    fitted = fit(curve_of(SLOW, n=2**12, levels=8), "WN+GM")
    exact, drawn = (
        covariances(fitted)[0],
        np.cov(draw_variances(fitted, 400, seed=4)[0].T),
    )
    size = np.sqrt(np.outer(np.diag(exact), np.diag(exact)))
    assert_allclose(drawn / size, exact / size, atol=0.25)
    assert_allclose(np.diag(drawn) / np.diag(exact), 1.0, atol=0.3)


def test_wrong_use_is_refused():
    """Oracle: the contract."""
    w = curve_of(SLOW)
    diagonal = fit(w, "WN+GM")
    with pytest.raises(UsageError, match="take efficient"):
        infer(diagonal, intervals="profile")
    with pytest.raises(UsageError, match="'wald' are none of"):
        infer(diagonal, intervals="wald")
    with pytest.raises(UsageError, match="give 100 or more"):
        infer(diagonal, intervals="bootstrap")
    with pytest.raises(UsageError, match="of 'modwt' wavelet variances, not of 'dwt'"):
        covariances(fit(replace(w, decomposition="dwt"), "WN+GM"))
