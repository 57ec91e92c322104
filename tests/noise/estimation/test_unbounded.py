"""Intervals of processes that a recording does not determine: their ends are zero and infinity, not
numbers.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from insgnss.base.errors import UsageError
from insgnss.navigation.noise_model.model import AxisNoise, GaussMarkov
from insgnss.noise.estimation._matching import pool_curves
from insgnss.noise.estimation._profile import Local
from insgnss.noise.estimation.gmwm import fit
from insgnss.noise.estimation.inference import efficient, infer, second_step
from insgnss.noise.estimation.selection import rank
from insgnss.noise.moments.theory import haar_variance
from insgnss.records import WaveletVariance, chi_square_interval

RATE, N = 100.0, 200_000


def exact(axis):
    """The curve of a recording whose wavelet variances are those of theory."""
    level = np.arange(1, 17)
    nu = haar_variance(axis, level, RATE)
    count = N - 2**level + 1
    low, high = chi_square_interval(nu, np.maximum(count / 2.0**level, 1.0))
    return WaveletVariance(level, nu, low, high, count.astype(np.int64), RATE, N)


def test_a_process_far_below_the_scatter_has_no_bounds():
    """Oracle: a Gauss-Markov process whose variance is 0.6 % of that of the white noise over its
    time; errors of e^6 and e^7.
    """
    weak = AxisNoise(white_noise=1.0, gauss_markov=(GaussMarkov.from_sigma(2.0, 0.08),))
    found = infer(fit(exact(weak), "WN+GM"), intervals="sandwich")
    for name in ("correlation_time_1", "driving_noise_1"):
        assert math.log(1e3) / 1.96 < found[name].log_error < 10.0
        assert (found[name].low, found[name].high) == (0.0, math.inf)
    white = found["white_noise"]
    assert white.low < 1.0 < white.high < 1.1


def test_profiles_keep_the_order_of_the_times():
    """Oracle: processes of 0.3, 2 and 20 s; the second, weak one ends at its neighbours and does
    not take their places.
    """
    axis = AxisNoise(
        white_noise=1.0,
        gauss_markov=tuple(
            GaussMarkov.from_sigma(T, s) for T, s in ((0.3, 1.0), (2.0, 0.25), (20.0, 0.6))
        ),
    )
    found = infer(efficient(fit(exact(axis), "WN+3GM")))
    assert found.intervals == "profile"
    assert 0.1 < found["correlation_time_2"].low < 2.0 < found["correlation_time_2"].high < 60.0


def test_one_step_of_efficient_weights_is_polished_as_it_is() -> None:
    """Oracle: the settled fit of many steps; of an erring curve the first step is far from it."""
    curve = exact(AxisNoise(white_noise=1.0, gauss_markov=(GaussMarkov.from_sigma(2.0, 1.0),)))
    wave = 1.0 + 0.3 * np.sin(curve.level)
    first = fit(replace(curve, variance=curve.variance * wave), "WN+GM")
    once, sentence, _ = second_step(first, iterations=1)
    assert "steps" in sentence
    assert np.allclose(once.modelled[0], second_step(first)[0].modelled[0], rtol=0.1)


def test_the_curve_with_wrong_weights_is_named() -> None:
    """Oracle: the number of the curve whose weights are negative."""
    curve = exact(AxisNoise(white_noise=1.0))
    identity = np.eye(curve.level.size)
    with pytest.raises(UsageError, match="weights of curve 2: not positive definite"):
        pool_curves([curve, curve, curve], [identity, -9.0 * identity, identity])


def test_of_equivalent_models_a_determined_one_is_chosen():
    """Oracle: white noise and one process put in; the rule of the module, checked from the fits: no
    edge, errors below a factor of e.
    """
    axis = AxisNoise(white_noise=1.0, gauss_markov=(GaussMarkov.from_sigma(4.0, 1.0),))
    ranking = rank([exact(axis)], ["WN+GM", "WN+2GM", "WN+GM+RW", "QN+WN+GM"])
    assert str(ranking.chosen.composition) == "WN+GM"
    assert ranking.chosen.determined
    assert not any(c.determined for c in ranking.candidates if c.fit.at_bound)


def test_no_overflow_where_a_density_has_no_end():
    """Oracle: numpy's own checks at the farthest coordinates that a profile may reach."""
    local = Local(
        fit(
            exact(AxisNoise(white_noise=1.0, gauss_markov=(GaussMarkov.from_sigma(2.0, 0.5),))),
            "QN+WN+GM+RW",
        )
    )
    local.coordinates(np.array([0.01, 1.0, 2.0, 0.5, 0.01]))
    with np.errstate(all="raise"):
        assert np.isfinite(local.parameters(local.high)).all()
        assert np.isfinite(local.residual(local.high)[0]).all()
