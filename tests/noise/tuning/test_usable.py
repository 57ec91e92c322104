"""What a recording cannot tell, written as what it acts like; and the turn-on bias of the means."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from insgnss.base.errors import DataError
from insgnss.navigation.noise_model.model import (
    NOISE_UNITS,
    AxisNoise,
    GaussMarkov,
    RecordingSource,
)
from insgnss.noise.estimation.estimates import NoiseEstimate
from insgnss.noise.estimation.gmwm import fit
from insgnss.noise.estimation.inference import infer
from insgnss.noise.moments.theory import haar_variance
from insgnss.noise.processes.composition import CORRELATION_TIME, DRIVING, NoiseTerm
from insgnss.noise.tuning.products.table import interval, plus_minus, print_parameter, unit_text
from insgnss.noise.tuning.recordings import StaticRecording
from insgnss.noise.tuning.static import turn_on_sigmas
from insgnss.noise.tuning.usable import departures, envelope, rounded_axis, usable_axis
from insgnss.records import WaveletVariance

RATE, SAMPLES = 100.0, 400_000
DEG_H = np.pi / 180.0 / 3600.0


def curve_of(axis, sampling="point"):
    """The wavelet variance that theory gives for an axis, with intervals as of a recording of that
    length.
    """
    level = np.arange(1, 17)
    nu = haar_variance(axis, level, RATE, sampling)
    count = SAMPLES - 2**level + 1
    width = 2.0 * np.sqrt(2.0 * 2.0**level / count)
    return WaveletVariance(level, nu, nu / (1.0 + width), nu * (1.0 + width), count, RATE, SAMPLES)


def test_a_process_shorter_than_a_sample_is_white_to_a_filter():
    """Oracle: 2000 sums over 1000 samples of the AR(1) series itself; their variance over their
    time, to 3.2 % by chance.
    """
    sigma, T = 1e-3, 0.004
    inference = infer(
        fit(curve_of(AxisNoise(gauss_markov=(GaussMarkov.from_sigma(T, sigma),))), "GM")
    )
    noise, remarks = usable_axis(inference)
    assert noise.gauss_markov == ()
    assert "white noise, and the model contains it as white noise" in remarks[0]
    assert "upper envelope" in remarks[-1]
    from scipy.signal import lfilter

    phi = np.exp(-1.0 / (RATE * T))
    x = lfilter(
        [sigma * np.sqrt(1.0 - phi**2)],
        [1.0, -phi],
        np.random.default_rng(1).standard_normal(2_000_000),
    )
    sums = x.reshape(2000, 1000).sum(axis=1) / RATE
    assert_allclose(noise.white_noise**2, np.var(sums) / (1000 / RATE), rtol=0.12)


def test_a_process_whoseinterval_reaches_a_sample_stays_as_it_was_fitted():
    """Oracle: the wavelet variance of the process put in, 71 s of 20 deg/h under 10.8
    deg/h/sqrt(Hz); as white noise it would be 239 deg/h/sqrt(Hz).
    """
    truth = AxisNoise(
        white_noise=10.8 * DEG_H, gauss_markov=(GaussMarkov.from_sigma(71.0, 20.0 * DEG_H),)
    )
    inference = infer(fit(curve_of(truth), "WN+GM"))
    unsure = replace(
        inference,
        verdicts=tuple(
            replace(v, identifiable=False, reason="short") if "gauss" in v.process else v
            for v in inference.verdicts
        ),
    )
    noise, remarks = usable_axis(unsure)
    level = np.arange(1, 17)
    assert_allclose(haar_variance(noise, level, RATE), haar_variance(truth, level, RATE), rtol=1e-3)
    assert_allclose(noise.white_noise, 10.8 * DEG_H, rtol=1e-3)
    assert "the model contains it as fitted, with 71 s" in remarks[0]


def test_what_falls_short_of_the_fit_is_refused_and_what_exceeds_it_told():
    """Oracle: by hand: half the white noise is half the deviation at the finest scale, twice is
    twice.
    """
    fitted = fit(curve_of(AxisNoise(white_noise=1e-4, random_walk=1e-6)), "WN+RW")
    with pytest.raises(DataError, match=r"0\.5 times the deviation of the WN\+RW .* at 0\.02 s"):
        envelope(replace(fitted.axis, white_noise=0.5e-4), fitted)
    (told,) = envelope(replace(fitted.axis, white_noise=2e-4), fitted)
    assert "an upper envelope of the WN+RW that was fitted" in told
    assert "up to 2 times that of the fit, at 0.02 s" in told
    assert envelope(rounded_axis(fitted.axis, NOISE_UNITS["gyro"]), fitted) == ()
    assert departures(fitted.axis, fitted) == ()


def test_a_process_without_end_is_a_random_walk():
    """Oracle: the random walk whose variances it was fitted to, and which it replaces to a per
    mille.
    """
    inference = infer(fit(curve_of(AxisNoise(white_noise=1e-4, random_walk=1e-6)), "WN+GM"))
    noise, remarks = usable_axis(inference)
    assert noise.gauss_markov == ()
    assert_allclose([noise.white_noise, noise.random_walk], [1e-4, 1e-6], rtol=1e-3)
    assert "random walk" in remarks[0]
    assert set(dict(noise.standard_error)) == {"white_noise", "random_walk"}


def test_what_is_known_is_kept():
    """Oracle: the process of the curve itself."""
    inference = infer(
        fit(curve_of(AxisNoise(white_noise=1e-4, gauss_markov=(GaussMarkov(20.0, 1e-5),))), "WN+GM")
    )
    noise, remarks = usable_axis(inference)
    assert remarks == ()
    assert_allclose(noise.gauss_markov[0].correlation_time_s, 20.0, rtol=1e-3)
    assert set(dict(noise.standard_error)) == {
        "white_noise",
        "correlation_time_1",
        "driving_noise_1",
    }


def test_a_number_that_is_hardly_known_is_reported():
    """Oracle: a process far below the scatter of the curve; said of its two parameters unless a
    verdict says so already.
    """
    weak = AxisNoise(white_noise=1e-4, gauss_markov=(GaussMarkov.from_sigma(2.0, 8e-6),))
    inference = infer(fit(curve_of(weak), "WN+GM"), intervals="sandwich")
    trusted = replace(
        inference,
        verdicts=tuple(replace(v, identifiable=True, reason="") for v in inference.verdicts),
    )
    (remark,) = usable_axis(trusted)[1]
    assert remark.startswith(
        "correlation time 1 and driving noise 1: uncertain by more than a factor of 2.7"
    )
    doubted = replace(
        inference,
        verdicts=tuple(
            replace(v, identifiable=False, reason="strength") for v in inference.verdicts
        ),
    )
    assert usable_axis(doubted)[1] == ()


def test_digits_of_the_file():
    """Oracle: the decimal digits in the units of the file, six and two."""
    axis = AxisNoise(
        1.23456789e-4,
        gauss_markov=(GaussMarkov(7.123456789, 1e-5),),
        standard_error={"white_noise": 1.2345e-6},
    )
    short = rounded_axis(axis, NOISE_UNITS["gyro"])
    assert f"{short.white_noise / DEG_H:.10g}" == f"{1.23456789e-4 / DEG_H:.6g}"
    assert short.gauss_markov[0].correlation_time_s == 7.12346
    assert f"{dict(short.standard_error)['white_noise'] / DEG_H:.6g}" == f"{1.2345e-6 / DEG_H:.2g}"


def recording(gyro, accel):
    """A recording with these means."""
    blocks = {"gyro": np.tile(gyro, (4, 1)), "accel": np.tile(accel, (4, 1))}
    curves = dict.fromkeys(f"{sensor}_{axis}" for sensor in blocks for axis in "xyz")
    return StaticRecording(RecordingSource("r", "0", 4, 1.0), curves, blocks, 0.0, 4.0)


def test_turn_on_bias_of_the_means():
    """Oracle: by hand; rms of the rates, excess of the force, the Earth's rotation where it is
    seen, and nothing of variances.
    """
    values, told = turn_on_sigmas(
        [recording([3e-3, 0, 0], [0, 0, 9.9]), recording([0, 4e-3, 0], [0, 0, 9.7])]
    )
    assert_allclose(values["gyro"], np.sqrt((9e-6 + 16e-6) / 6.0))
    assert_allclose(values["accel"], np.sqrt(np.mean(np.square([9.9 - 9.80665, 9.7 - 9.80665]))))
    assert "over 2 recordings the means spread by" in told[0]
    earth = 7.292115e-5
    values, told = turn_on_sigmas([recording([0.6 * earth, 0.81 * earth, 0], [0, 0, 9.81])])
    assert_allclose(values["gyro"], abs(np.hypot(0.6, 0.81) - 1.0) * earth, rtol=1e-6)
    assert values["accel"] == 0.015
    assert "Earth" in told[0]
    values, told = turn_on_sigmas([replace(recording([0, 0, 0], [0, 0, 9.8]), blocks=None)])
    assert values == {}
    assert "set turn_on_bias by hand" in told[0]


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (10.8251, 0.0213, "10.825 +- 0.021"),
        (4737.1, 312.0, "4737 +- 312"),
        (0.5, np.nan, "0.5"),
        (1.0, 0.0, "1"),
        (2e6, 3e5, "2e+06 +- 3e+05"),
    ],
)
def test_values_with_their_errors(value, error, text):
    """Oracle: by definition, two digits of the error."""
    assert plus_minus(value, error) == text


def testintervals_without_an_end_are_said_to_have_none():
    """Oracle: by hand, 1 s to 2 s, and the words for infinity."""
    for low, high, text in (
        (1.0, 2.0, "1 to 2"),
        (1.0, math.inf, "from 1, not bounded"),
        (0.0, math.inf, "not bounded"),
    ):
        assert (
            interval(
                "gyro",
                NoiseEstimate(NoiseTerm(CORRELATION_TIME, 1), 1.5, 0.1, low, high, high, False),
            )
            == text
        )


def test_printed_units_are_those_of_table_5():
    """Oracle: Table 5 of paper 000; 4.943 of 1e-3 deg/s^2/sqrt(Hz), 10.825 deg/h/sqrt(Hz), 6.546
    ug/s/sqrt(Hz).
    """
    assert_allclose(print_parameter("gyro", DRIVING, np.radians(4.943e-3)), 4.943)
    assert_allclose(print_parameter("gyro", "white_noise", 10.825 * DEG_H), 10.825)
    assert_allclose(print_parameter("accel", DRIVING, 6.546 * 9.80665e-6), 6.546)
    assert unit_text("gyro", DRIVING) == "1e-3 deg/s^2/sqrt(Hz)"
