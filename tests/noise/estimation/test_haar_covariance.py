"""Covariance of the wavelet variance estimates against quadratic forms, plain sums over all lags,
Monte Carlo and allantools.
"""

import math
from dataclasses import replace
from decimal import Decimal, localcontext

import numpy as np
import pytest
from allantools.ci import edf_greenhall
from numpy.testing import assert_allclose
from sampled import AXES, SAMPLINGS, autocorrelation, covariance, haar_filter, haar_rows
from scipy.signal import fftconvolve

from insgnss.base.errors import UsageError
from insgnss.navigation.noise_model.model import AxisNoise, GaussMarkov, load_noise_model
from insgnss.noise.moments._covariance_kernels import lag_covariance
from insgnss.noise.moments.haar_covariance import haar_covariance
from insgnss.noise.moments.theory import haar_variance
from insgnss.noise.processes.gauss_markov import gauss_markov_coefficients
from insgnss.noise.processes.realisation import simulate_noise

RATE = 8.0


@pytest.mark.slow
@pytest.mark.parametrize("sampling", SAMPLINGS)
@pytest.mark.parametrize("n", [128, 151])
@pytest.mark.parametrize("name", [*AXES, "drift"])
def test_it_is_the_covariance_of_the_quadratic_forms(name, n, sampling):
    """Oracle: nu = x'Bx has cov 2 tr(B S B' S) + 4 mu'B S B'mu in Gaussian x; every pair of levels.
    1e-9 is what S keeps at 40 s.
    """
    axis = replace(AXES["all"], drift=0.6) if name == "drift" else AXES[name]
    levels = np.arange(1, 8)
    S = covariance(axis, n, RATE, sampling)
    line = axis.drift / RATE * np.arange(n)
    forms = [rows.T @ rows / rows.shape[0] for rows in (haar_rows(level, n) for level in levels)]
    expected = [
        [2.0 * np.sum((A @ S) * (S @ B)) + 4.0 * line @ A @ S @ B @ line for B in forms]
        for A in forms
    ]
    assert_allclose(haar_covariance(axis, levels, n, RATE, sampling), expected, rtol=1e-9)


@pytest.mark.parametrize(("j", "k"), [(13, 13), (13, 12), (13, 4), (9, 1), (3, 3)])
def test_panels_are_the_sum_over_all_lags(j, k):
    """Oracle: every lag summed, its covariance from the autocovariance by direct convolution; 1e-8
    is the convolution's share.
    """
    n, T = 30_000, (3.0, 70.0, 900.0)
    axis = AxisNoise(white_noise=2.0, gauss_markov=tuple(GaussMarkov.from_sigma(t, 1.0) for t in T))
    gamma = sum(autocorrelation(t, 2 * n, "point") for t in T)
    gamma[0] += 4.0
    both = np.concatenate([gamma[:0:-1], gamma])
    a, b = haar_filter(2 ** (j - 1)), haar_filter(2 ** (k - 1))
    C = fftconvolve(both, np.convolve(a, b[::-1]), mode="same")
    centre = gamma.size - 1
    M = n - a.size + 1
    h = np.arange(-n, n + 1)
    overlap = np.maximum(M - np.maximum(np.abs(h) - (a.size - b.size) // 2, 0), 0)
    expected = np.sum(overlap * 2.0 * C[centre + h] ** 2) / (M * (n - b.size + 1))
    own = haar_covariance(axis, [j, k], n, 1.0)
    assert_allclose(own[0, 1], expected, rtol=1e-8)


@pytest.mark.parametrize("sampling", SAMPLINGS)
def test_lags_of_a_slow_process_keep_their_digits(sampling):
    """Oracle: nine terms of the generalised covariance in 80 digits, T = 4737 s at 250 Hz and
    shorter; where doubles keep none.
    """
    m_j = 2**18
    for T in (1184275.0, 1e5, 300.0):
        P, B, c = gauss_markov_coefficients(T, sampling)
        for m_k in (1, 64, m_j):
            lags = [
                0,
                1,
                m_k,
                m_k + 5,
                m_j - m_k,
                m_j - 3,
                m_j,
                m_j + m_k // 2,
                m_j + m_k,
                m_j + 9 * m_k,
            ]
            own = [
                lag_covariance(
                    float(h), float(m_j), float(m_k), 0.0, 0.0, np.array([[1.0 / T, P, B, c]])
                )
                for h in lags
            ]
            with localcontext(prec=80):
                phi = (-1 / Decimal(T)).exp()
                scale, slope = (
                    (phi / (1 - phi) ** 2, (1 + phi) / (2 * (1 - phi)))
                    if sampling == "point"
                    else (Decimal(T) ** 2, Decimal(T))
                )
                weights = [
                    (a, b, (1 - 3 * (a == 0)) * (1 - 3 * (b == 0)))
                    for a in (-1, 0, 1)
                    for b in (-1, 0, 1)
                ]
                distances = [[(w, abs(h + a * m_j + b * m_k)) for a, b, w in weights] for h in lags]
                exact = [
                    -sum(w * (scale * phi**d + slope * d) for w, d in row) / (4 * m_j * m_k)
                    for row in distances
                ]
            largest = float(max(abs(value) for value in exact))
            assert_allclose(own, [float(value) for value in exact], rtol=1e-9, atol=1e-12 * largest)


def test_a_long_recording_of_table_5():
    """Oracle: a covariance is positive definite; n/1.5 degrees of freedom of differenced white
    noise; four hours at 250 Hz, 20 levels.
    """
    axis, n, levels = load_noise_model("navchip").gyro[0], 3_600_000, np.arange(1, 21)
    C = haar_covariance(axis, levels, n, 250.0)
    scale = 1.0 / np.sqrt(np.diag(C))
    assert np.linalg.eigvalsh(C * np.outer(scale, scale)).min() > 0.01
    assert_allclose(
        2.0 * haar_variance(axis, 1, 250.0) ** 2 / C[0, 0], n / 1.5, rtol=1e-3
    )  # 1 + 2/4 by correlation -1/2


@pytest.mark.parametrize(
    ("axis", "alpha"),
    [
        (AxisNoise(white_noise=1.0), 0),
        (AxisNoise(random_walk=1.0), -2),
        (AxisNoise(quantization=1.0), 2),
    ],
)
def test_degrees_of_freedom_are_greenhalls(axis, alpha):
    """Oracle: allantools edf_greenhall, from m = 64 on; below it takes its continuous approximation
    (3205 for 2730 at m = 1).
    """
    n, levels = 4096, np.arange(7, 11)
    expected = [
        edf_greenhall(alpha, 2, 2 ** (j - 1), n + 1, overlapping=True, modified=False)
        for j in levels.tolist()
    ]
    freedom = (
        2.0
        * haar_variance(axis, levels, 1.0, "mean") ** 2
        / np.diag(haar_covariance(axis, levels, n, 1.0, "mean"))
    )
    assert_allclose(freedom, expected, rtol=1e-3)


@pytest.mark.parametrize("sampling", SAMPLINGS)
def test_monte_carlo_agrees(sampling):
    """Oracle: 3000 simulated series of 200 samples; every element within 5 of its own standard
    errors.
    """
    axis, n, levels = replace(AXES["all"], quantization=0.0), 200, np.arange(1, 8)
    rng = np.random.default_rng(21)
    nu = np.empty((3000, levels.size))
    for row in nu:
        S = np.concatenate([[0.0], np.cumsum(simulate_noise(axis, n, 1.0 / RATE, rng, sampling))])
        row[:] = [
            np.mean((S[2 * m :] - 2.0 * S[m:-m] + S[: -2 * m]) ** 2) / (4.0 * m * m)
            for m in 2 ** (levels - 1)
        ]
    d = nu - nu.mean(axis=0)
    products = d[:, :, None] * d[:, None, :]
    error = products.std(axis=0) / math.sqrt(len(nu))
    assert (
        np.abs(products.mean(axis=0) - haar_covariance(axis, levels, n, RATE, sampling))
        < 5.0 * error
    ).all()


def test_order_and_choice_of_levels_are_free():
    """Oracle: the rows and columns of the full matrix; a silent axis has no variance."""
    full = haar_covariance(AXES["all"], np.arange(1, 8), 200, RATE)
    assert_allclose(
        haar_covariance(AXES["all"], [6, 2, 5], 200, RATE),
        full[np.ix_([5, 1, 4], [5, 1, 4])],
        rtol=1e-15,
    )
    assert not haar_covariance(AxisNoise(), [1, 2], 200, RATE).any()


@pytest.mark.parametrize("level", [[8], [0, 1], [1.5], [], [[1, 2]]])
def test_levels_that_the_series_does_not_have_are_refused(level):
    """Oracle: by contract; a filter of 2^8 samples does not fit into 200."""
    with pytest.raises(UsageError, match="level"):
        haar_covariance(AXES["all"], level, 200, RATE)
