"""Variances of the processes against definitions, published formulas in many digits, and
simulation.
"""

import math
from decimal import Decimal, localcontext

import numpy as np
import pytest
from numpy.testing import assert_allclose
from sampled import AXES, SAMPLINGS, covariance, haar_filter

from insgnss.base.errors import UsageError
from insgnss.base.units import parse_quantity
from insgnss.navigation.noise_model.model import AxisNoise, GaussMarkov
from insgnss.noise.moments.theory import (
    gauss_markov_haar,
    haar_variance,
    haar_variance_parts,
)
from insgnss.noise.processes.realisation import simulate_noise

RATE = 8.0


@pytest.mark.parametrize("sampling", SAMPLINGS)
@pytest.mark.parametrize("name", AXES)
def test_variances_are_those_of_the_filtered_series(name, sampling):
    """Oracle: definition; filter on both sides of the covariance of the samples. 1e-10 is what that
    covariance keeps at 40 s.
    """
    levels = np.array([1, 2, 3, 5])
    expected = []
    for level in levels.tolist():
        a = haar_filter(2 ** (level - 1))
        expected.append(a @ covariance(AXES[name], a.size, RATE, sampling) @ a)
    assert_allclose(haar_variance(AXES[name], levels, RATE, sampling), expected, rtol=1e-10)


def test_a_line_has_the_variance_of_its_filtered_slope():
    """Oracle: definition; the filter applied to the line itself."""
    levels = [1, 3, 5]
    filters = [haar_filter(2 ** (level - 1)) for level in levels]
    expected = [(a @ (0.7 / RATE * np.arange(a.size))) ** 2 for a in filters]
    assert_allclose(haar_variance(AxisNoise(drift=0.7), levels, RATE), expected, rtol=1e-12)


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


def test_sums_are_sums():
    """Oracle: independence of the processes."""
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


REFUSED = [
    (lambda: haar_variance(AXES["all"], [1, 0], RATE), "level 0"),
    (lambda: haar_variance(AXES["all"], 1.5, RATE), "level 1.5"),
    (lambda: haar_variance(AXES["all"], math.nan, RATE), "level nan"),
    (lambda: haar_variance(AXES["all"], 1, 0.0), "sampling rate 0"),
    (lambda: haar_variance(AXES["all"], 1, RATE, "median"), "sampling 'median'"),
    (lambda: gauss_markov_haar([1.0, -2.0], 1), "-2 samples"),
]


@pytest.mark.parametrize(("call", "words"), REFUSED)
def test_what_has_no_answer_is_refused(call, words):
    """Oracle: by contract; the message names the value."""
    with pytest.raises(UsageError, match=words):
        call()
