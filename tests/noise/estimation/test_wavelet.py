"""Haar wavelet variance against its definition, the Allan variance of allantools, closed forms, and
the reference's recorded values.
"""

import json
from pathlib import Path

import allantools
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import integrate, optimize, stats

from insgnss.base.errors import DataError, InputError, UsageError
from insgnss.navigation.noise_model.model import AxisNoise, GaussMarkov
from insgnss.noise.moments.theory import haar_variance
from insgnss.noise.moments.wavelet import (
    biweight_constants,
    default_levels,
    wavelet_variance,
    wavelet_variances,
)
from insgnss.noise.processes.realisation import simulate_noise

DATA = Path(__file__).parents[4] / "shared" / "data"


def coefficients(x, level, stride=1):
    """Haar coefficients by convolution with the filter itself."""
    m = 2 ** (level - 1)
    taps = np.concatenate([np.full(m, 0.5 / m), np.full(m, -0.5 / m)])
    return np.convolve(x, taps, mode="valid")[::stride]


@pytest.mark.parametrize("n", [4, 5, 63, 64, 65, 1000, 1024, 9001])
def test_variance_is_that_of_the_convolution(n):
    """Oracle: numpy.convolve with the filter; lengths around powers of two and around the kernel's
    blocks.
    """
    x = np.random.default_rng(n).standard_normal(n) + 100.0
    overlapping, discrete = wavelet_variance(x, 2.0), wavelet_variance(x, 2.0, decomposition="dwt")
    assert overlapping.level.tolist() == list(range(1, default_levels(n) + 1))
    for k, j in enumerate(overlapping.level):
        w = coefficients(x, j)
        assert overlapping.count[k] == w.size
        assert_allclose(overlapping.variance[k], np.mean(w**2), rtol=1e-11)
        w = coefficients(x, j, 2**j)
        assert discrete.count[k] == w.size
        assert_allclose(discrete.variance[k], np.mean(w**2), rtol=1e-11)


@pytest.mark.parametrize("n", [4, 7, 8, 9, 15, 16, 1000, 2**19, 10**6, 2**20, 3105250])
def test_number_of_scales_is_the_references(n):
    """Oracle: floor(log2(n) - 1) of wv::wvar (R/wvar.R), as 2^(J + 1) <= n < 2^(J + 2)."""
    J = default_levels(n)
    assert 2 ** (J + 1) <= n < 2 ** (J + 2)


def test_levels_may_be_chosen():
    """Oracle: the default's first levels; the last that exists has a single coefficient."""
    x = np.random.default_rng(3).standard_normal(64)
    assert_allclose(
        wavelet_variance(x, 1.0, levels=2).variance,
        wavelet_variance(x, 1.0).variance[:2],
        rtol=1e-15,
    )
    assert wavelet_variance(x, 1.0, levels=6).count.tolist()[-1] == 1
    picked = wavelet_variance(x, 4.0).selected([4, 2, 9])
    assert picked.level.tolist() == [2, 4]
    assert picked.scale_s.tolist() == [1.0, 4.0]
    assert picked.averaging_time_s.tolist() == [0.5, 2.0]
    assert picked.samples == 64


def test_twice_the_variance_is_the_allan_variance():
    """Oracle: allantools.oadev."""
    x = np.cumsum(np.random.default_rng(5).standard_normal(5000))
    own = wavelet_variance(x, 100.0)
    _, deviation, _, _ = allantools.oadev(
        x, rate=100.0, data_type="freq", taus=own.averaging_time_s
    )
    assert_allclose(2.0 * own.variance, deviation**2, rtol=1e-10)


def test_interval_is_chi_square_with_the_stated_freedom():
    """Oracle: scipy.stats.chi2 on the formula that the reference documents (eta3)."""
    x = np.random.default_rng(7).standard_normal(1000)
    own = wavelet_variance(x, 1.0)
    eta = [max((1000 - 2**j + 1) / 2**j, 1.0) for j in own.level]
    assert_allclose(own.low, eta * own.variance / stats.chi2.ppf(0.975, eta), rtol=1e-10)
    assert_allclose(own.high, eta * own.variance / stats.chi2.ppf(0.025, eta), rtol=1e-10)


def test_offset_and_trend_cost_no_digits():
    """Oracle: the definition in extended precision, noise of 1e-6 on 9.8 with a trend of 1000 times
    the noise; 1e-9 is 1e-3 of any use.
    """
    n = 200_000
    x = 9.8 + 1e-3 * np.arange(n) / n + 1e-6 * np.random.default_rng(9).standard_normal(n)
    own = wavelet_variance(x, 250.0)
    s = np.concatenate([[0.0], np.cumsum(x.astype(np.longdouble) - np.longdouble(9.8))])
    for k in (0, 3, 8, 14):
        m = 2**k
        w = (s[2 * m :] - 2 * s[m:-m] + s[: -2 * m]) / (2 * m)
        assert_allclose(own.variance[k], float(np.mean(w**2)), rtol=1e-9)


CLOSED = {
    "white_noise": lambda m: 100.0 / (2.0 * m),
    "quantization": lambda m: 1.5 * 100.0**2 / m**2,
}  # nu at 100 Hz of unit strength


@pytest.mark.parametrize("process", ["white_noise", "quantization"])
def test_simulated_process_has_its_theoretical_variance(process):
    """Oracle: closed form of white noise q^2 rate / (2m), of quantization 1.5 Q^2 rate^2 / m^2; 4
    standard errors by twice the freedom.
    """
    x = simulate_noise(
        AxisNoise(**{"white_noise": 0.0, process: 0.3}), 400_000, 0.01, np.random.default_rng(11)
    )
    own = wavelet_variance(x, 100.0, levels=10)
    expected = 0.09 * CLOSED[process](2.0 ** (own.level - 1))
    freedom = own.count / 2.0**own.level
    assert (np.abs(own.variance / expected - 1.0) < 4.0 * np.sqrt(2.0 / freedom)).all()


def test_simulated_sum_has_its_theoretical_variance():
    """Oracle: theory of the mean-sampled sum, on a simulation of the continuous processes."""
    axis = AxisNoise(
        white_noise=0.02,
        random_walk=0.01,
        gauss_markov=(GaussMarkov.from_sigma(0.5, 0.3), GaussMarkov.from_sigma(30.0, 0.2)),
    )
    x = np.stack(
        [simulate_noise(axis, 100_000, 0.01, np.random.default_rng(seed)) for seed in range(12)],
        axis=1,
    )
    own = wavelet_variances(x, 100.0, levels=13)
    mean = np.mean([curve.variance for curve in own], axis=0)
    freedom = 12 * own[0].count / 2.0 ** own[0].level
    assert (
        np.abs(mean / haar_variance(axis, own[0].level, 100.0, "mean") - 1.0)
        < 4.0 * np.sqrt(2.0 / freedom)
    ).all()


def test_intervals_cover_and_are_cautious():
    """Oracle: white noise of 600 simulated series; eta3 counts less than there is, so 95 % at
    least, within 3 binomial deviations.
    """
    x = np.random.default_rng(13).standard_normal((512, 600))
    curves = wavelet_variances(x, 1.0)
    truth = 0.5 / 2.0 ** (curves[0].level - 1)
    inside = np.mean([(c.low < truth) & (truth < c.high) for c in curves], axis=0)
    assert (inside > 0.95 - 3.0 * np.sqrt(0.95 * 0.05 / 600)).all(), inside
    discrete = wavelet_variances(x, 1.0, decomposition="dwt")
    inside = np.mean([(c.low < truth) & (truth < c.high) for c in discrete], axis=0)
    assert (np.abs(inside - 0.95) < 3.5 * np.sqrt(0.95 * 0.05 / 600)).all(), inside


@pytest.mark.parametrize("efficiency", [0.2, 0.6, 0.9, 0.99])
def test_biweight_constants_are_those_of_quadrature(efficiency):
    """Oracle: scipy.integrate.quad of the definitions over the normal density."""
    c, a = biweight_constants(efficiency)

    def mean(f):
        return (
            2.0
            * integrate.quad(lambda r: f(r) * stats.norm.pdf(r), 0.0, c, epsabs=0.0, epsrel=1e-11)[
                0
            ]
        )

    def psi(r):
        return r**2 * (1.0 - (r / c) ** 2) ** 4

    assert_allclose(a, mean(psi), rtol=1e-9)
    M, Q = mean(lambda r: (r**2 - 1.0) * psi(r)), mean(lambda r: psi(r) ** 2) - a**2
    assert_allclose(0.5 * M**2 / Q, efficiency, rtol=1e-9)


@pytest.mark.slow
def test_robust_variance_solves_its_equation_as_the_reference_seeks_it():
    """Oracle: Brent's search of the squared mismatch over (0, 2] plain variances, what R's optimize
    does; 1e-3 is its tolerance.
    """
    x = np.random.default_rng(15).standard_t(4, 20_000)
    own = wavelet_variance(x, 1.0, levels=8, robust=True)
    c, a = biweight_constants(0.6)
    for k, j in enumerate(own.level):
        w = coefficients(x, j)

        def mismatch(u, w=w):
            r2 = w**2 / (u * w.var(ddof=1))
            return (np.mean(r2 * np.maximum(1.0 - r2 / c**2, 0.0) ** 4) - a) ** 2

        found = optimize.fminbound(mismatch, 0.0, 2.0, xtol=1e-4) * w.var(ddof=1)
        assert_allclose(own.variance[k], found, rtol=1e-3)
        assert mismatch(own.variance[k] / w.var(ddof=1)) < 1e-18


def test_robust_variance_is_unbiased_in_normal_noise_and_has_its_efficiency():
    """Oracle: the wanted efficiency, of the discrete coefficients of 400 white series; the ratio's
    own deviation is 0.04.
    """
    x = np.random.default_rng(17).standard_normal((2000, 400))
    plain = np.array(
        [c.variance[0] for c in wavelet_variances(x, 1.0, levels=1, decomposition="dwt")]
    )
    robust = np.array(
        [
            c.variance[0]
            for c in wavelet_variances(x, 1.0, levels=1, decomposition="dwt", robust=True)
        ]
    )
    assert (
        abs(robust.mean() / 0.5 - 1.0) < 4.0 * robust.std() / 0.5 / 20.0 + 2e-3
    )  # 2e-3: bias of order 1/n
    assert abs(np.var(np.log(plain)) / np.var(np.log(robust)) - 0.6) < 0.12


def test_outliers_hardly_move_the_robust_variance():
    """Oracle: the clean series. One sample in 200 is 50 sigma off: 1 % of the coefficients at level
    1, 4 % at level 3.
    """
    rng = np.random.default_rng(19)
    clean = rng.standard_normal(100_000)
    spoiled = clean.copy()
    spoiled[rng.integers(0, clean.size, 500)] += 50.0
    truth = wavelet_variance(clean, 1.0, levels=3)
    assert (wavelet_variance(spoiled, 1.0, levels=3).variance > 5.0 * truth.variance).all()
    assert_allclose(
        wavelet_variance(spoiled, 1.0, levels=3, robust=True).variance, truth.variance, rtol=0.12
    )


def test_robust_interval_is_the_references():
    """Oracle: its formula, plain interval relative to the estimate times 1 / sqrt(efficiency), half
    the estimate where below zero.
    """
    x = np.random.default_rng(21).standard_normal(512)
    plain, own = wavelet_variance(x, 1.0), wavelet_variance(x, 1.0, robust=True)
    wider = np.sqrt(1.0 / 0.6)
    low = own.variance * (1.0 - (1.0 - plain.low / plain.variance) * wider)
    assert_allclose(
        own.high, own.variance * (1.0 + (plain.high / plain.variance - 1.0) * wider), rtol=1e-12
    )
    assert_allclose(own.low[low > 0.0], low[low > 0.0], rtol=1e-12)
    below = np.flatnonzero(low <= 0.0)
    assert below.tolist() == [7]
    assert own.low[7] == min(0.5 * own.variance[7], own.low[:7].min())


def test_columns_are_as_one_by_one():
    """Oracle: single axes; counts of an integer recording as floats."""
    x = np.random.default_rng(23).integers(-30, 30, (4097, 5), dtype=np.int16)
    together = wavelet_variances(x, 100.0, robust=True)
    for k, curve in enumerate(together):
        alone = wavelet_variance(x[:, k].astype(float), 100.0, robust=True)
        assert curve.variance.tolist() == alone.variance.tolist()
        assert curve.high.tolist() == alone.high.tolist()


NAN = np.array([1.0, 2.0, np.nan, 4.0, 5.0])


@pytest.mark.parametrize(
    ("x", "options", "error", "words"),
    [
        (NAN, {}, InputError, "sample 3 of 5 is nan"),
        (np.array([1.0, -np.inf, 3.0, 4.0]), {}, InputError, "sample 2 of 4 is -inf"),
        (np.full(8, 1e308), {}, InputError, "overflow"),
        (np.full(100, 0.1), {}, DataError, "all 100 samples are 0.1"),
        (np.arange(3.0), {}, DataError, "3 samples; at least 4"),
        (np.tile([1.0, -1.0], 50), {}, DataError, "no variance at level 2"),
        (
            np.repeat([0.0, 1.0, 0.0], 1000),
            {"robust": True},
            DataError,
            "most coefficients are zero",
        ),
        (np.arange(9.0), {"levels": 4}, UsageError, "4 levels of 9 samples; give 1 to 3"),
        (np.arange(9.0), {"rate_hz": 0.0}, UsageError, "rate 0.0 Hz"),
        (np.arange(9.0), {"decomposition": "fft"}, UsageError, "neither"),
        (
            np.random.default_rng(1).standard_normal(64),
            {"robust": True, "efficiency": 1.0},
            UsageError,
            "efficiency",
        ),
        (np.ones((3, 3)), {}, UsageError, "one axis"),
    ],
)
def test_what_has_no_answer_is_refused(x, options, error, words):
    """Oracle: the documented refusals."""
    options = {"rate_hz": 100.0} | options
    with pytest.raises(error, match=words):
        wavelet_variance(x, **options)


def test_refusal_names_the_column():
    """Oracle: the column that was spoiled."""
    x = np.random.default_rng(25).standard_normal((50, 6))
    x[:, 4] = 2.0
    with pytest.raises(DataError, match="column 5: all 50 samples are 2"):
        wavelet_variances(x, 100.0)
    with pytest.raises(UsageError, match="columns"):
        wavelet_variances(x[:, 0], 100.0)


def test_recorded_variances_of_the_reference():
    """Oracle: wavelet variances and intervals that R package wv published of the first ADIS16405
    recording, to 1e-8.
    """
    file, recording = (
        DATA / "imu_variances" / "variances.json",
        DATA / "adis16405_static" / "adis_16405_imu1.npy",
    )
    if not file.is_file() or not recording.is_file():
        pytest.skip("the ADIS16405 recording and its published variances are not here")
    published = json.loads(file.read_text())["adis_wv"]["adis_wv"]["wvar"]
    own = wavelet_variances(np.load(recording) * np.array([0.05] * 3 + [0.00333] * 3), 100.0)
    for curve, wanted in zip(own, published.values(), strict=True):
        assert curve.level.size == len(wanted["variance"])
        assert_allclose(curve.scale_s, np.ravel(wanted["scales"]), rtol=1e-12)
        for name, key in (("variance", "variance"), ("low", "ci_low"), ("high", "ci_high")):
            assert_allclose(getattr(curve, name), wanted[key], rtol=1e-8)
