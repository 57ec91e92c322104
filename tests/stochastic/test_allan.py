"""Allan family against allantools: deviations, degrees of freedom, intervals, kinds of noise; and
against brute force where it has none.
"""

import math

import allantools
import numpy as np
import pytest
from allantools.ci import autocorr_noise_id, confidence_interval, edf_greenhall
from numpy.testing import assert_allclose
from scipy import stats

from insgnss.base.errors import DataError, InputError, UsageError
from insgnss.stochastic.moments.allan import (
    NOISES,
    allan_deviation,
    averaging_factors,
    identify_noise,
)
from insgnss.stochastic.moments.edf import ORDER, degrees_of_freedom, lowest_alpha
from insgnss.stochastic.moments.wavelet import wavelet_variance

RATE = 100.0
OTHERS = {"allan": allantools.oadev, "modified": allantools.mdev, "hadamard": allantools.ohdev}


def series(alpha, n, seed=1):
    """Rate samples whose spectrum is near f^alpha for even alpha: differences and sums of white
    noise.
    """
    x = np.random.default_rng(seed).standard_normal(n + 2)
    x = {2: np.diff, 0: lambda x: x, -2: np.cumsum, -4: lambda x: np.cumsum(np.cumsum(x))}[alpha](x)
    return x[:n]


@pytest.mark.parametrize("spacing", ["octave", "decade", 6])
@pytest.mark.parametrize("alpha", [2, 0, -2])
@pytest.mark.parametrize("kind", OTHERS)
def test_deviation_is_that_of_allantools(kind, alpha, spacing):
    """Oracle: allantools at the same averaging times, 1e-10."""
    x = series(alpha, 4001) + 0.4
    own = allan_deviation(x, RATE, kind=kind, spacing=spacing)
    tau, deviation, _, _ = OTHERS[kind](x, rate=RATE, data_type="freq", taus=own.tau_s)
    at = [int(np.argmin(np.abs(own.tau_s - each))) for each in tau]
    assert len(at) >= own.tau_s.size - 1  # allantools drops a tau with a single difference
    assert_allclose(own.deviation[at], deviation, rtol=1e-10)


@pytest.mark.parametrize("kind", OTHERS)
def test_octaves_and_decades_are_those_of_allantools(kind):
    """Oracle: the averaging times that allantools chooses by name, without those of a single
    difference that it leaves out.
    """
    x = series(0, 3000)
    for spacing in ("octave", "decade"):
        tau, _, _, _ = OTHERS[kind](x, rate=RATE, data_type="freq", taus=spacing)
        assert_allclose(
            allan_deviation(x, RATE, kind=kind, spacing=spacing).tau_s[: tau.size], tau, rtol=1e-12
        )
    dense = averaging_factors(3000, kind, 4)
    assert set(averaging_factors(3000, kind, "octave")) <= set(dense)
    assert (np.diff(np.log2(dense[dense > 16])) < 0.3).all()


@pytest.mark.parametrize("kind", OTHERS)
@pytest.mark.parametrize("n", [97, 1000, 100_000, 3_600_000])
def test_degrees_of_freedom_are_those_of_allantools(kind, n):
    """Oracle: allantools edf_greenhall, wherever it has a formula, 1e-10."""
    compared = 0
    for alpha in range(2, lowest_alpha(kind) - 1, -1):
        for m in averaging_factors(n, kind, 3):
            try:
                wanted = edf_greenhall(
                    alpha, ORDER[kind], int(m), n + 1, overlapping=True, modified=kind == "modified"
                )
            except (NotImplementedError, AssertionError):
                # quantization at the last tau, and the reddest noise, whose row of its table is not
                # reached
                continue
            assert_allclose(degrees_of_freedom(kind, alpha, int(m), n), wanted, rtol=1e-10)
            compared += 1
    assert compared > 4 * averaging_factors(n, kind, 3).size


def brute_force_freedom(taps, terms):
    """2 (E V)^2 / var V of the mean of squares of `terms` consecutive outputs of a filter of white
    noise.
    """
    R = np.correlate(taps, taps, mode="full")[taps.size - 1 :]
    R = np.concatenate([R, np.zeros(max(terms - R.size, 0))])[:terms]
    weight = 2.0 * (1.0 - np.arange(terms) / terms)
    weight[0] = 1.0
    return terms / float(weight @ (R / R[0]) ** 2)


@pytest.mark.parametrize(
    ("kind", "n", "m"),
    [
        ("allan", 64, 20),
        ("allan", 64, 31),
        ("allan", 64, 8),
        ("hadamard", 90, 25),
        ("hadamard", 90, 6),
    ],
)
def test_freedom_of_quantization_is_exact(kind, n, m):
    """Oracle: the covariance of the differences of white phase, summed; at the last averaging times
    allantools has no formula.
    """
    binomial = np.array([1.0, -2.0, 1.0] if kind == "allan" else [1.0, -3.0, 3.0, -1.0])
    taps = np.zeros((binomial.size - 1) * m + 1)
    taps[::m] = binomial
    assert_allclose(
        degrees_of_freedom(kind, 2, m, n),
        brute_force_freedom(taps, n + 1 - (taps.size - 1)),
        rtol=1e-12 if m > 8 else 0.02,
    )


@pytest.mark.parametrize(
    ("n", "m"), [(200, 4), (200, 16), (200, 50), (200, 90), (2000, 64), (2000, 300)]
)
def test_freedom_of_white_noise_is_near_the_exact_one(n, m):
    """Oracle: the covariance of the second differences of integrated white noise, summed.

    The formulas take each phase as a mean over a sample, which at small m counts up to 12 % too
    few; at large m they are good to 4 %.
    """
    taps = np.concatenate([np.full(m, -1.0), np.full(m, 1.0)])
    ratio = degrees_of_freedom("allan", 0, m, n) / brute_force_freedom(taps, n + 1 - 2 * m)
    assert 0.96 - 0.4 / m < ratio < 1.02


def test_interval_is_that_of_allantools():
    """Oracle: allantools confidence_interval at 95 %."""
    own = allan_deviation(series(-2, 5000), RATE)
    wanted = [confidence_interval(*each, 0.95) for each in zip(own.deviation, own.edf, strict=True)]
    assert_allclose(np.stack([own.low, own.high], axis=1), wanted, rtol=1e-10)


def test_intervals_cover():
    """Oracle: the true deviation of 400 simulated white series, 95 % within 3.5 binomial
    deviations.
    """
    x = np.random.default_rng(3).standard_normal((400, 600))
    curves = [allan_deviation(row, 1.0, noise="white_noise") for row in x]
    truth = 1.0 / np.sqrt(curves[0].tau_s)
    inside = np.mean([(c.low < truth) & (truth < c.high) for c in curves], axis=0)
    assert (np.abs(inside - 0.95) < 3.5 * math.sqrt(0.95 * 0.05 / 400)).all(), inside


@pytest.mark.parametrize("alpha", [2, 0, -2, -4])
@pytest.mark.parametrize("m", [1, 7, 50])
def test_kind_of_noise_is_that_of_allantools(alpha, m):
    """Oracle: allantools autocorr_noise_id of the same means, 1e-6 of the exponent: its detrending
    is that of numpy.polyfit.
    """
    x = series(alpha, 2003, seed=5)
    for most in (2, 3):
        whole, found = identify_noise(x[: x.size // m * m].reshape(-1, m).mean(axis=1), most)
        wanted = autocorr_noise_id(x, m, data_type="freq", dmin=0, dmax=most)
        assert whole == wanted[0]
        assert_allclose(found, wanted[1], atol=1e-6)


@pytest.mark.parametrize(
    ("alpha", "kind"), [(2, "allan"), (0, "modified"), (-2, "allan"), (-4, "hadamard")]
)
def test_kind_of_noise_is_what_was_simulated(alpha, kind):
    """Oracle: the simulated exponent, at all averaging times with 200 means or more."""
    own = allan_deviation(series(alpha, 60_000, seed=7), RATE, kind=kind)
    assert (own.alpha[own.tau_s * RATE * 200 < 60_000] == alpha).all()


def test_kind_of_noise_follows_tau():
    """Oracle: quantization below a second, random walk above 20 s, whose Allan variances 3
    Q^2/tau^2 and q^2 tau/3 were set so.
    """
    rng = np.random.default_rng(9)
    n, Q, q = 400_000, 1.0, 0.02
    x = np.diff(rng.standard_normal(n + 1)) * Q * RATE + np.cumsum(
        rng.standard_normal(n)
    ) * q / math.sqrt(RATE)
    own = allan_deviation(x, RATE)
    assert (own.alpha[own.tau_s < 1.0] == 2).all()
    assert (own.alpha[(own.tau_s > 40.0) & (own.tau_s < 300.0)] == -2).all()
    quiet = own.tau_s < 1.0
    assert_allclose(own.deviation[quiet], math.sqrt(3.0) * Q / own.tau_s[quiet], rtol=0.02)
    late = (own.tau_s > 40.0) & (own.tau_s < 300.0)
    wanted = q * np.sqrt(own.tau_s[late] / 3.0)
    assert (own.low[late] < wanted).all()
    assert (wanted < own.high[late]).all()


def test_noise_may_be_named():
    """Oracle: degrees of freedom by the exponent itself; the redder the noise, the wider the
    interval at long tau.
    """
    x = series(0, 1000)
    by_name, by_number = (
        allan_deviation(x, RATE, noise="random_walk"),
        allan_deviation(x, RATE, noise=-2),
    )
    assert by_name.low.tolist() == by_number.low.tolist()
    assert by_name.edf[0] == degrees_of_freedom("allan", NOISES["random_walk"], 1, 1000)
    assert_allclose(
        by_name.deviation[:8] ** 2, 2.0 * wavelet_variance(x, RATE).variance, rtol=1e-12
    )
    assert stats.chi2.ppf(0.5, by_name.edf[0]) > 0.0


def test_hadamard_is_blind_to_drift():
    """Oracle: the same series without the ramp."""
    x = series(0, 3000)
    wanted = allan_deviation(x, RATE, kind="hadamard", noise=0).deviation
    drifting = allan_deviation(x + 0.01 * np.arange(3000), RATE, kind="hadamard", noise=0).deviation
    assert_allclose(drifting, wanted, rtol=1e-8)


@pytest.mark.parametrize(
    ("x", "options", "error", "words"),
    [
        (series(0, 100), {"kind": "total"}, UsageError, "known are allan, modified, hadamard"),
        (series(0, 100), {"spacing": 0}, UsageError, "spacing 0"),
        (series(0, 100), {"spacing": "all"}, UsageError, "spacing 'all'"),
        (series(0, 100), {"noise": "pink"}, UsageError, "known are quantization"),
        (series(0, 100), {"noise": 3}, UsageError, "known are quantization"),
        (series(0, 100), {"noise": "random_run"}, UsageError, "use 'hadamard'"),
        (series(0, 29), {}, DataError, "29 samples; at least 30"),
        (np.tile([1.0, -1.0], 50), {}, DataError, "no variance at 0.02 s"),
        (np.append(series(0, 100), np.nan), {}, InputError, "sample 101 of 101 is nan"),
        (np.ones(100), {}, DataError, "all 100 samples"),
    ],
)
def test_what_has_no_answer_is_refused(x, options, error, words):
    """Oracle: the documented refusals."""
    with pytest.raises(error, match=words):
        allan_deviation(x, RATE, **options)
