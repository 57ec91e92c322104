"""Variances and spectra of the processes against definitions, published formulas in many digits,
aliasing sums and simulation.
"""

import math
from decimal import Decimal, localcontext

import numpy as np
import pytest
from numpy.testing import assert_allclose
from sampled import AXES, SAMPLINGS, autocorrelation, covariance, haar_filter

from insgnss.base.errors import UsageError
from insgnss.base.units import parse_quantity
from insgnss.stochastic.model import AxisNoise, GaussMarkov
from insgnss.stochastic.moments.theory import (
    allan_variance,
    gauss_markov_haar,
    haar_variance,
    haar_variance_parts,
    hadamard_variance,
    modified_allan_variance,
    psd,
    psd_parts,
    variance_parts,
)
from insgnss.stochastic.processes import simulate_noise

RATE = 8.0
KINDS = {
    "allan": (allan_variance, lambda m: math.sqrt(2.0) * haar_filter(m)),
    "modified": (
        modified_allan_variance,
        lambda m: math.sqrt(2.0) * np.convolve(haar_filter(m), np.full(m, 1.0 / m)),
    ),
    "hadamard": (
        hadamard_variance,
        lambda m: np.repeat([1.0, -2.0, 1.0], m) / (m * math.sqrt(6.0)),
    ),
}


@pytest.mark.parametrize("sampling", SAMPLINGS)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", AXES)
def test_variances_are_those_of_the_filtered_series(name, kind, sampling):
    """Oracle: definition; filter on both sides of the covariance of the samples. 1e-10 is what that
    covariance keeps at 40 s.
    """
    function, filter_ = KINDS[kind]
    factors = np.array([1, 2, 3, 7, 16])
    expected = []
    for m in factors:
        a = filter_(m)
        expected.append(a @ covariance(AXES[name], a.size, RATE, sampling) @ a)
    assert_allclose(function(AXES[name], factors, RATE, sampling), expected, rtol=1e-10)


@pytest.mark.parametrize("kind", KINDS)
def test_a_line_has_the_variance_of_its_filtered_slope(kind):
    """Oracle: definition; the filter applied to the line itself."""
    function, filter_ = KINDS[kind]
    expected = [(filter_(m) @ (0.7 / RATE * np.arange(filter_(m).size))) ** 2 for m in (1, 5, 16)]
    assert_allclose(
        function(AxisNoise(drift=0.7), [1, 5, 16], RATE), expected, rtol=1e-12, atol=1e-25
    )


def published(T: Decimal, m: int, sampling: str) -> Decimal:
    """Haar wavelet variance, sigma = 1: Guerrier et al. (2013) for AR(1); IEEE Std 952 annex C,
    halved, for means.
    """
    if sampling == "mean":
        x = m / T
        return (1 - (3 - 4 * (-x).exp() + (-2 * x).exp()) / (2 * x)) / x
    phi = (-1 / T).exp()
    return (m - 3 * phi - m * phi**2 + 4 * phi ** (m + 1) - phi ** (2 * m + 1)) / (
        2 * m * m * (1 - phi) ** 2
    )


TIMES = ["0.01", "0.1", "0.4999", "0.5001", "0.7", "1", "3", "30", "1e3", "1184275", "1e9"]


@pytest.mark.parametrize("sampling", SAMPLINGS)
@pytest.mark.parametrize("T", TIMES)
def test_gauss_markov_keeps_its_digits_at_every_correlation_time(T, sampling):
    """Oracle: published formulas and their central difference by log T, in 120 digits; levels to
    22; 1184275 is 4737.1 s at 250 Hz.
    """
    levels = np.arange(1, 23)
    value, slope = gauss_markov_haar(float(T), levels, sampling)
    with localcontext(prec=120):
        time, step = Decimal(float(T)), 1 + Decimal("1e-30")
        exact = [published(time, 2**j // 2, sampling) for j in levels.tolist()]
        log_step = 2 * Decimal("1e-30")
        change = [
            (
                published(time * step, 2**j // 2, sampling)
                - published(time / step, 2**j // 2, sampling)
            )
            / log_step
            for j in levels.tolist()
        ]
        relative = [float(Decimal(float(v)) / e - 1) for v, e in zip(value, exact, strict=True)]
        error = [
            float((Decimal(float(s)) - c) / e) for s, c, e in zip(slope, change, exact, strict=True)
        ]
    assert np.abs(relative).max() < 2e-15
    assert np.abs(error).max() < 4e-15


def test_the_textbook_difference_in_doubles_is_91_times_wrong():
    """Oracle: the issue's figure for 4737 s at 250 Hz, second scale; what the other test would find
    without the series.
    """
    T, m = 4737.1 * 250.0, 2
    phi = math.exp(-1.0 / T)
    textbook = (m - 3 * phi - m * phi**2 + 4 * phi ** (m + 1) - phi ** (2 * m + 1)) / (
        2 * m * m * (1 - phi) ** 2
    )
    assert textbook / gauss_markov_haar(T, 2)[0] > 50.0
    assert_allclose(
        gauss_markov_haar(T, 2)[0], (2.0 * m * m + 1.0) / (12.0 * m) * 2.0 / T, rtol=1e-5
    )  # the random walk it is there


@pytest.mark.parametrize("sampling", SAMPLINGS)
def test_modified_and_hadamard_variance_keep_their_digits(sampling):
    """Oracle: sixth difference of the sums of the autocovariance, in 80 digits, for T to 1e9
    samples and m to 1e5.
    """
    for T in (0.3, 1.9, 2.1, 40.0, 1184275.0, 1e9):
        axis = AxisNoise(gauss_markov=(GaussMarkov.from_sigma(T, 1.0),))
        factors = [1, 2, 3, 10, 1000, 100_000]
        with localcontext(prec=80):
            u = 1 / Decimal(T)
            phi = (-u).exp()
            P1 = phi / (1 - phi) ** 2
            linear, sine = (1 + phi) / (2 * (1 - phi)), ((1 / phi) - phi) / 2
            P, c = (P1, linear) if sampling == "point" else (1 / u**2, 1 / u)
            once = [[-(P * phi ** (k * m) + c * k * m) for k in range(4)] for m in factors]
            twice = [
                [
                    P * P1 * (phi ** (k * m) + sine * k * m) + c * ((k * m) ** 3 - k * m) / 6
                    for k in range(4)
                ]
                for m in factors
            ]
            hadamard = [
                float((20 * K[0] - 30 * K[1] + 12 * K[2] - 2 * K[3]) / (6 * m * m))
                for K, m in zip(once, factors, strict=True)
            ]
            modified = [
                float((20 * K[0] - 30 * K[1] + 12 * K[2] - 2 * K[3]) / (2 * m**4))
                for K, m in zip(twice, factors, strict=True)
            ]
        assert_allclose(hadamard_variance(axis, factors, 1.0, sampling), hadamard, rtol=3e-15)
        assert_allclose(modified_allan_variance(axis, factors, 1.0, sampling), modified, rtol=1e-14)


def test_sums_are_sums_and_haar_is_half_of_allan():
    """Oracle: independence of the processes; Allan variance at m = 2^(j-1) is twice the wavelet
    variance (Percival and Guttorp 1994).
    """
    axis = AxisNoise(0.1, 0.02, 7.0, 0.2, 0.4, (GaussMarkov(0.4, 0.5), GaussMarkov(5.0, 0.2)))
    levels = np.arange(1, 9)
    parts = haar_variance_parts(axis, levels, RATE)
    assert list(parts) == [
        "white_noise",
        "quantization",
        "random_walk",
        "drift",
        "gauss_markov_1",
        "gauss_markov_2",
    ]
    assert_allclose(sum(parts.values()), haar_variance(axis, levels, RATE), rtol=1e-15)
    assert_allclose(
        allan_variance(axis, 2 ** (levels - 1), RATE),
        2.0 * haar_variance(axis, levels, RATE),
        rtol=1e-15,
    )
    assert not haar_variance(AxisNoise(turn_on_bias=1.0), levels, RATE).any()
    assert haar_variance(axis, 3, RATE).shape == ()


@pytest.mark.parametrize("sampling", SAMPLINGS)
def test_simulated_series_have_these_wavelet_variances(sampling):
    """Oracle: simulation of 400 series of 512 samples; the mean over them within 4.5 of its own
    standard errors at every level.
    """
    axis, n, levels = AXES["all"], 512, np.arange(1, 9)
    rng = np.random.default_rng(5)
    nu = np.empty((400, levels.size))
    for row in nu:
        S = np.concatenate([[0.0], np.cumsum(simulate_noise(axis, n, 1.0 / RATE, rng, sampling))])
        row[:] = [
            np.mean((S[2 * m :] - 2.0 * S[m:-m] + S[: -2 * m]) ** 2) / (4.0 * m * m)
            for m in 2 ** (levels - 1)
        ]
    error = nu.std(axis=0, ddof=1) / math.sqrt(len(nu))
    assert (
        np.abs(nu.mean(axis=0) - haar_variance(axis, levels, RATE, sampling)) < 4.5 * error
    ).all()


def test_table_5_read_as_printed():
    """Oracle: stationary sigmas of the issue, to the digits given: root PSD, gyro driving noise in
    1e-3 deg/s^2/sqrt(Hz).
    """
    gyro = [(2.5, 4.943), (72.1, 1.017), (4737.1, 0.330)]
    accel = [(45.0, 6.546), (2060.4, 1.646)]
    sigma = [
        GaussMarkov(T, parse_quantity(f"{q}e-3 deg/s^2/sqrt(Hz)", "deg/s^2/sqrt(Hz)")).sigma
        for T, q in gyro
    ]
    assert_allclose(np.degrees(sigma) * 3600.0, [19.9, 22.0, 57.8], atol=0.05)
    sigma = [
        GaussMarkov(T, parse_quantity(f"{q} ug/s/sqrt(Hz)", "ug/s/sqrt(Hz)")).sigma
        for T, q in accel
    ]
    assert_allclose(np.array(sigma) / 9.80665e-6, [31.1, 52.8], atol=0.05)


@pytest.mark.parametrize("sampling", SAMPLINGS)
@pytest.mark.parametrize("name", AXES)
def test_the_spectrum_through_the_filter_is_the_wavelet_variance(name, sampling):
    """Oracle: integral of the spectrum times the filter's squared gain, by a Gauss rule in panels
    of a quarter octave.
    """
    edges = RATE * 2.0 ** np.arange(-44.0, -0.9, 0.25)
    node, weight = np.polynomial.legendre.leggauss(12)
    f = (0.5 * (edges[1:] + edges[:-1])[:, None] + 0.5 * np.diff(edges)[:, None] * node).ravel()
    w = (0.5 * np.diff(edges)[:, None] * weight).ravel()
    for level in (1, 2, 4):
        m = 2 ** (level - 1)
        gain = np.sin(np.pi * f * m / RATE) ** 4 / (m * np.sin(np.pi * f / RATE)) ** 2
        integral = 2.0 * np.sum(w * gain * psd(AXES[name], f, RATE, sampling))
        assert_allclose(integral, haar_variance(AXES[name], level, RATE, sampling), rtol=1e-9)


@pytest.mark.parametrize("sampling", SAMPLINGS)
def test_spectra_are_the_continuous_ones_folded(sampling):
    """Oracle: the continuous spectra summed over 20000 aliases, times the gain of the mean; the
    rest of the sum falls as 1/aliases.
    """
    axis = AxisNoise(
        random_walk=0.8,
        gauss_markov=(GaussMarkov(0.05, 1.5), GaussMarkov(5.0, 0.2), GaussMarkov(4e3, 0.01)),
    )
    f = np.array([1e-4, 0.02, 0.3, 2.2, 4.0])
    shifted = f[:, None] + RATE * np.arange(-20000, 20001)
    gain = np.sinc(shifted / RATE) ** 2 if sampling == "mean" else 1.0
    parts = psd_parts(axis, f, RATE, sampling)
    walk = (gain * 0.8**2 / (2.0 * np.pi * shifted) ** 2).sum(axis=1)
    assert_allclose(parts["random_walk"], walk, rtol=2e-4)
    for i, p in enumerate(axis.gauss_markov, start=1):
        folded = (
            gain * p.driving_noise**2 / (p.correlation_time_s**-2 + (2.0 * np.pi * shifted) ** 2)
        ).sum(axis=1)
        assert_allclose(parts[f"gauss_markov_{i}"], folded, rtol=2e-4)


@pytest.mark.parametrize("sampling", SAMPLINGS)
def test_spectra_are_transforms_of_the_autocovariances(sampling):
    """Oracle: Fourier sum over the lags; for a slow process, whose spectrum of means cancels in the
    textbook form, and a fast one.
    """
    f = np.array([0.01, 0.7, 3.99])
    for T in (0.02, 0.3, 4.0):
        axis = AxisNoise(gauss_markov=(GaussMarkov.from_sigma(T, 1.0),))
        rho = autocorrelation(T * RATE, 3000, sampling)
        transform = (
            rho[0] + 2.0 * np.cos(2.0 * np.pi * np.outer(f, np.arange(1, 3000)) / RATE) @ rho[1:]
        )
        assert_allclose(psd(axis, f, RATE, sampling), transform / RATE, rtol=1e-9)


REFUSED = [
    (lambda: haar_variance(AXES["all"], [1, 0], RATE), "level 0"),
    (lambda: haar_variance(AXES["all"], 1.5, RATE), "level 1.5"),
    (lambda: allan_variance(AXES["all"], math.nan, RATE), "averaging factor nan"),
    (lambda: haar_variance(AXES["all"], 1, 0.0), "sampling rate 0"),
    (lambda: haar_variance(AXES["all"], 1, RATE, "median"), "sampling 'median'"),
    (lambda: variance_parts("total", AXES["all"], 1, RATE), "variance 'total'"),
    (lambda: psd(AXES["all"], [0.0, 1.0], RATE), "from 0 to 1 Hz"),
    (lambda: psd(AXES["all"], 4.1, RATE), "half the rate, 4 Hz"),
    (lambda: gauss_markov_haar([1.0, -2.0], 1), "-2 samples"),
]


@pytest.mark.parametrize(("call", "words"), REFUSED)
def test_what_has_no_answer_is_refused(call, words):
    """Oracle: by contract; the message names the value."""
    with pytest.raises(UsageError, match=words):
        call()
