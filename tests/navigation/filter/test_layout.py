"""The state vector that follows from a noise model."""

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal

from insgnss.navigation.filter.codes import BIAS, DRIFT_CODE
from insgnss.navigation.filter.layout import FixErrors, StateLayout, state_layout
from insgnss.navigation.noise_model.model import (
    AxisNoise,
    GaussMarkov,
    NoiseModel,
    load_noise_model,
)

HOUR = 3600.0


def model(gyro: AxisNoise, accel: AxisNoise) -> NoiseModel:
    return NoiseModel("made up", "made up", (gyro,) * 3, (accel,) * 3)


def names(layout: StateLayout) -> tuple[str, ...]:
    return tuple(map(str, layout.states))


def test_table_5_makes_thirty_states():
    """Oracle: Table 5 of paper 000 by hand: bias and three GM a gyro, bias and two GM an
    accelerometer, nine of navigation.
    """
    layout = state_layout(load_noise_model("navchip"))
    assert layout.size == 30
    assert names(layout)[:4] == ("gyro x bias", "gyro x GM 1", "gyro x GM 2", "gyro x GM 3")
    assert names(layout)[-3:] == ("accel z bias", "accel z GM 1", "accel z GM 2")
    assert_allclose(layout.sigma0[0], np.radians(100.0) / HOUR)
    assert_allclose(1.0 / layout.beta[1:4], [2.5, 72.1, 4737.1])
    assert_allclose(
        layout.sigma0[2], np.radians(1.017e-3) * np.sqrt(72.1 / 2.0)
    )  # stationary: q sqrt(T / 2)
    assert_allclose(layout.white[0], (np.radians(10.825) / HOUR) ** 2)
    assert (layout.factor == BIAS).all()


def test_a_turn_on_bias_and_its_random_walk_are_one_state():
    """Oracle: the sum of a constant and a random walk is a random walk that starts there."""
    layout = state_layout(
        model(AxisNoise(turn_on_bias=2.0, random_walk=3.0), AxisNoise(random_walk=4.0))
    )
    assert names(layout) == tuple(
        f"{sensor} {axis} bias" for sensor in ("gyro", "accel") for axis in "xyz"
    )
    assert_array_equal(layout.sigma0, [2.0] * 3 + [0.0] * 3)
    assert_array_equal(layout.drive, [9.0] * 3 + [16.0] * 3)
    assert not layout.beta.any()


def test_channel_sum_adds_what_acts_as_a_bias():
    """Oracle: by hand: bias and Gauss-Markov count, drift and scale factor do not."""
    gyro = AxisNoise(turn_on_bias=1.0, drift=1.0, gauss_markov=(GaussMarkov(1.0, 1.0),))
    layout = state_layout(model(gyro, AxisNoise(turn_on_bias=1.0)), scale_factor=True)
    assert names(layout)[:3] == ("gyro x bias", "gyro x drift", "gyro x GM 1")
    assert layout.factor[1] == DRIFT_CODE
    M = layout.channel_sum()
    assert M.shape == (6, layout.size - 9)
    assert_array_equal(M[0, :3], [1.0, 0.0, 1.0])
    assert_array_equal(M.sum(axis=1), [2.0, 2.0, 2.0, 1.0, 1.0, 1.0])


def test_scale_factors_and_misalignments_come_where_asked():
    """Oracle: count by hand: six scale factors, twice two misalignments an axis triad; sigmas of
    the model, else 1000 ppm and 1 mrad.
    """
    layout = state_layout(
        model(AxisNoise(scale_factor=2e-4), AxisNoise(misalignment=3e-4)),
        scale_factor=True,
        misalignment=True,
    )
    assert layout.size == 9 + 6 + 12
    sigma = dict(zip(names(layout), layout.sigma0, strict=True))
    assert sigma["gyro y scale factor"] == 2e-4
    assert sigma["accel y scale factor"] == 1e-3
    assert sigma["accel z from x"] == 3e-4
    assert sigma["gyro z from x"] == 1e-3
    assert dict(zip(names(layout), layout.factor, strict=True))["accel z from x"] == 3
    assert state_layout(load_noise_model("navchip"), misalignment=True).size == 30 + 12


def test_quantization_enters_as_white_noise_of_the_same_variance():
    """Oracle: an angle between two fixes is the difference of two rounded ones, variance 2 q^2;
    white noise makes PSD times T.
    """
    layout = state_layout(
        model(AxisNoise(white_noise=1e-3, quantization=5e-5), AxisNoise(quantization=2e-3))
    )
    T = 0.1
    expected = [1e-6 * T + 2.0 * 5e-5**2] * 3 + [2.0 * 2e-3**2] * 3
    assert_allclose(layout.kernel_model(0.05, T).white[0] * T, expected, rtol=1e-12)


def test_a_model_without_states_leaves_navigation_alone():
    """Oracle: nine states."""
    layout = state_layout(model(AxisNoise(white_noise=1e-3), AxisNoise()))
    assert (layout.size, layout.states) == (9, ())
    assert layout.channel_sum().shape == (6, 0)


def test_correlated_errors_of_the_fixes_are_stationary():
    """Oracle: de/dt = -e/T + w keeps the variance sigma^2 where the driving noise has 2 sigma^2 /
    T.
    """
    fixes = FixErrors(
        gm_sigma=(0.5, 0.6, 0.7),
        correlation_time_s=20.0,
        unfixed_gm_sigma=2.0,
        unfixed_correlation_time_s=60.0,
    )
    layout = state_layout(load_noise_model("navchip"), fixes=fixes)
    for first, sigma, time_s in (
        (layout.gm, [0.5, 0.6, 0.7], 20.0),
        (layout.unfixed_gm, [2.0] * 3, 60.0),
    ):
        at = slice(first, first + 3)
        assert_allclose(layout.beta[at], 1.0 / time_s, rtol=1e-12)
        assert_allclose(layout.sigma0[at], sigma, rtol=1e-12)
        assert_allclose(layout.drive[at], 2.0 * np.square(sigma) / time_s, rtol=1e-12)
