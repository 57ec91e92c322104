"""Conversions between continuous-time and discrete parameters: formulas in many digits, round trips, simulated recursions."""

import math
from decimal import Decimal, localcontext

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lfilter

from insgnss.errors import InputError, UsageError
from insgnss.stochastic.discrete import Ar1, DiscreteNoise, ar1_of, axis_of, discrete_of, gauss_markov_of
from insgnss.stochastic.model import AxisNoise, GaussMarkov
from insgnss.stochastic.moments.theory import haar_variance
from insgnss.stochastic.processes import simulate_noise

AXIS = AxisNoise(0.1, 0.02, 0.0, 0.2, 0.4, (GaussMarkov(0.4, 0.5), GaussMarkov(4737.1, 0.2)))
NOISE = DiscreteNoise(0.08, 0.0256, 0.005, 0.05, (Ar1.of_phi(0.7, 0.02), Ar1.of_phi(0.96, 0.003)))


@pytest.mark.parametrize("T", [0.001, 0.4, 2060.4, 4737.1, 1e7])
def test_ar1_of_a_gauss_markov_process(T):
    """Oracle: phi = exp(-1/(rate T)) and sigma^2 (1 - phi^2) of the textbooks in 60 digits, at 250 Hz."""
    process = GaussMarkov(T, 0.25)
    ar1 = ar1_of(process, 250.0)
    with localcontext(prec=60):
        phi = (-1 / (250 * Decimal(T))).exp()
        innovation = Decimal("0.25") ** 2 * Decimal(T) / 2 * (1 - phi**2)
        assert_allclose(ar1.one_minus_phi, float(1 - phi), rtol=1e-15)
        assert_allclose(ar1.phi, float(phi), atol=2e-16)
        assert_allclose(ar1.innovation_variance, float(innovation), rtol=1e-15)
    assert_allclose(ar1.variance, process.sigma**2, rtol=1e-14)


@pytest.mark.parametrize("rate", [1.0, 100.0, 250.0, 4000.0])
def test_there_and_back_is_the_same(rate):
    """Oracle: round trip, both ways; 1e-14 also for 4737 s at 4 kHz, where phi itself has lost seven digits of 1 - phi."""
    back = axis_of(discrete_of(AXIS, rate), rate)
    for name in ("white_noise", "quantization", "random_walk", "drift"):
        assert_allclose(getattr(back, name), getattr(AXIS, name), rtol=1e-14)
    for own, process in zip(back.gauss_markov, AXIS.gauss_markov, strict=True):
        assert_allclose([own.correlation_time_s, own.driving_noise], [process.correlation_time_s, process.driving_noise], rtol=1e-14)
    again = discrete_of(axis_of(NOISE, rate), rate)
    for name in ("white_variance", "quantization_variance", "random_walk_variance", "slope"):
        assert_allclose(getattr(again, name), getattr(NOISE, name), rtol=1e-14)
    for own, ar1 in zip(again.ar1, NOISE.ar1, strict=True):
        assert_allclose([own.one_minus_phi, own.innovation_variance], [ar1.one_minus_phi, ar1.innovation_variance], rtol=1e-14)


def recursions(rng: np.random.Generator, n: int) -> np.ndarray:
    """Series of `NOISE` from its discrete parameters alone, textbook recursions."""
    x = math.sqrt(NOISE.white_variance) * rng.standard_normal(n)
    x += math.sqrt(NOISE.quantization_variance) * np.diff(rng.standard_normal(n + 1))
    x += math.sqrt(NOISE.random_walk_variance) * np.cumsum(rng.standard_normal(n))
    x += NOISE.slope * np.arange(n)
    for ar1 in NOISE.ar1:
        x += math.sqrt(ar1.innovation_variance) * lfilter([1.0], [1.0, -ar1.phi], rng.standard_normal(n + 400))[400:]
    return x


@pytest.mark.parametrize("rate", [2.0, 50.0])
def test_recursions_have_the_wavelet_variance_of_the_continuous_axis(rate):
    """Oracle: simulation of 400 series by the recursions; mean wavelet variance within 4.5 of its standard errors, at any rate."""
    rng, factors = np.random.default_rng(11), 2 ** np.arange(7)
    nu = np.empty((400, factors.size))
    for row in nu:
        S = np.concatenate([[0.0], np.cumsum(recursions(rng, 256))])
        row[:] = [np.mean((S[2 * m :] - 2.0 * S[m:-m] + S[: -2 * m]) ** 2) / (4.0 * m * m) for m in factors]
    expected = haar_variance(axis_of(NOISE, rate), np.arange(1, 8), rate)
    assert (np.abs(nu.mean(axis=0) - expected) < 4.5 * nu.std(axis=0, ddof=1) / 20.0).all()


def test_simulated_values_have_the_discrete_variances():
    """Oracle: sample moments of simulate_noise's values against the conversion, within 5 sigma of 200000 samples."""
    rate, n = 20.0, 200_000
    noise = discrete_of(AXIS, rate)
    rng = np.random.default_rng(3)
    white = simulate_noise(AxisNoise(white_noise=AXIS.white_noise), n, 1.0 / rate, rng, "point")
    steps = np.diff(simulate_noise(AxisNoise(random_walk=AXIS.random_walk), n, 1.0 / rate, rng, "point"))
    rounding = np.cumsum(simulate_noise(AxisNoise(quantization=AXIS.quantization), n, 1.0 / rate, rng, "point"))
    x = simulate_noise(AxisNoise(gauss_markov=AXIS.gauss_markov[:1]), n, 1.0 / rate, rng, "point")
    bound = 5.0 * math.sqrt(2.0 / n)
    assert_allclose(white.var(), noise.white_variance, rtol=bound)
    assert_allclose(steps.var(), noise.random_walk_variance, rtol=bound)
    assert_allclose(rounding.var(), noise.quantization_variance, rtol=bound)
    assert_allclose((x[1:] - noise.ar1[0].phi * x[:-1]).var(), noise.ar1[0].innovation_variance, rtol=bound)
    assert_allclose(x[1:] @ x[:-1] / (x @ x), noise.ar1[0].phi, atol=5.0 * math.sqrt((1.0 - noise.ar1[0].phi ** 2) / n))


def test_what_is_no_sampled_gauss_markov_process_is_refused():
    """Oracle: by contract; phi outside 0 ... 1, negative variances, a rate that is none."""
    for phi in (1.0, -0.2, 1.2, math.nan):
        with pytest.raises(InputError, match="phi"):
            Ar1.of_phi(phi, 1.0)
    with pytest.raises(InputError, match="innovation variance -1"):
        Ar1(0.1, -1.0)
    with pytest.raises(InputError, match="no correlation time"):
        gauss_markov_of(Ar1.of_phi(0.0, 1.0), 10.0)
    with pytest.raises(InputError, match="slope -1"):
        DiscreteNoise(slope=-1.0)
    for call in (lambda: discrete_of(AXIS, 0.0), lambda: axis_of(NOISE, math.inf), lambda: ar1_of(AXIS.gauss_markov[0], -1.0)):
        with pytest.raises(UsageError, match="sampling rate"):
            call()
