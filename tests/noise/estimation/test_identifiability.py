"""Verdicts on processes: the rules on noise-free curves of Table 5, and coverage and verdicts over
simulated recordings of it.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy import stats

from insgnss.navigation.noise_model.model import AxisNoise, GaussMarkov, load_noise_model
from insgnss.noise.estimation.gmwm import fit
from insgnss.noise.estimation.inference import Inference, efficient, infer
from insgnss.noise.moments.theory import haar_variance
from insgnss.noise.moments.wavelet import in_threads, wavelet_variance
from insgnss.noise.processes.composition import composition_of
from insgnss.noise.processes.realisation import simulate_noise
from insgnss.records import WaveletVariance

HOURS_4 = 4 * 3600.0
GYRO, ACCEL = (
    replace(axes[0], turn_on_bias=0.0)
    for axes in (load_noise_model("navchip").gyro, load_noise_model("navchip").accel)
)


def curve_of(axis: AxisNoise, n: int, rate_hz: float) -> WaveletVariance:
    """What `axis` has on average over n samples."""
    level = np.arange(1, n.bit_length() - 1)
    nu, count = haar_variance(axis, level, rate_hz, "mean"), n - 2**level + 1
    eta = np.maximum(count / 2.0**level, 1.0)
    return WaveletVariance(
        level,
        nu,
        eta * nu / stats.chi2.ppf(0.975, eta),
        eta * nu / stats.chi2.ppf(0.025, eta),
        count,
        rate_hz,
        n,
    )


@cache
def told(sensor: str, recordings: int) -> Inference:
    """Inference on noise-free curves of 4-hour recordings at 250 Hz."""
    axis = {"gyro": GYRO, "accel": ACCEL}[sensor]
    curves = [curve_of(axis, 3_600_000, 250.0)] * recordings
    return infer(efficient(fit(curves, composition_of(axis), sampling="mean")))


def test_table_5_from_one_recording():
    """Oracle: Table 5 and the issue; 2.5 s and 72.1 s can be had from four hours, 4737 s cannot."""
    verdicts = {v.process: v for v in told("gyro", 1).verdicts}
    assert [v.identifiable for v in verdicts.values()] == [True, True, True, False]
    slow = verdicts["gauss_markov_3"]
    assert slow.reason in ("long", "superfluous")
    assert "4.74e+03 s" in slow.sentence
    assert "4.8e+03 s" in slow.sentence or "fits as well" in slow.sentence
    assert "replicates" in slow.sentence or "record" in slow.sentence
    assert not {v.process: v for v in told("accel", 1).verdicts}["gauss_markov_2"].identifiable


def test_six_recordings_determine_the_driving_noise_and_not_yet_the_time():
    """Oracle: theory; the interval of log T shrinks by sqrt 6, to a factor of 3 still, around a
    third of the recording.
    """
    one, six = told("gyro", 1), told("gyro", 6)
    slow = six.verdicts[-1]
    assert (slow.identifiable, slow.reason, slow.parameters) == (
        False,
        "long",
        ("driving_noise_3",),
    )
    assert six["correlation_time_3"].high > 4800.0
    for name in (
        "white_noise",
        "correlation_time_1",
        "driving_noise_1",
        "correlation_time_2",
        "driving_noise_2",
    ):
        np.testing.assert_allclose(
            one[name].log_error / six[name].log_error, np.sqrt(6.0), rtol=0.02
        )
    width = [np.log(i["white_noise"].high / i["white_noise"].low) for i in (one, six)]
    np.testing.assert_allclose(width[0] / width[1], np.sqrt(6.0), rtol=0.02)


def test_a_long_recording_determines_it():
    """Oracle: the rule; over 40 days the process of 4737 s is seen 700 times."""
    n = round(40 * 86400 * 1.0)
    axis = AxisNoise(white_noise=GYRO.white_noise, gauss_markov=GYRO.gauss_markov[2:])
    verdict = infer(efficient(fit(curve_of(axis, n, 1.0), "WN+GM", sampling="mean"))).verdicts[1]
    assert (verdict.identifiable, verdict.reason) == (True, "")
    assert verdict.parameters == ("correlation_time_1", "driving_noise_1")
    assert "4.74e+03 s" in verdict.sentence


def simulated(
    axis: AxisNoise, seed: int, n: int = 50_000, rate_hz: float = 10.0
) -> WaveletVariance:
    return wavelet_variance(
        simulate_noise(axis, n, 1.0 / rate_hz, np.random.default_rng(seed)), rate_hz
    )


@pytest.mark.slow
def test_a_process_that_is_not_there():
    """Oracle: construction; the second Gauss-Markov process and the quantization are not in the
    data, the rest is.
    """
    axis = AxisNoise(white_noise=1.0, gauss_markov=(GaussMarkov(10.0, 0.5),))
    for seed in range(3):
        found = infer(efficient(fit(simulated(axis, seed), "QN+WN+2GM", sampling="mean")))
        verdicts = {v.process: v for v in found.verdicts}
        assert list(verdicts) == ["quantization", "white_noise", "gauss_markov_1", "gauss_markov_2"]
        assert not verdicts["quantization"].identifiable
        assert verdicts["quantization"].reason == "strength"
        assert verdicts["white_noise"].identifiable
        reasons = {v.reason for v in found.verdicts if v.process.startswith("gauss_markov")}
        assert reasons == {"superfluous", ""}
        there = next(
            v for v in found.verdicts if v.process.startswith("gauss_markov") and v.identifiable
        )
        assert there.parameters == (
            f"correlation_time_{there.process[-1]}",
            f"driving_noise_{there.process[-1]}",
        )
        assert "QN+WN+GM" in there.sentence
        assert all("\n" not in v.sentence for v in found.verdicts)


def test_no_gauss_markov_process_in_white_noise():
    """Oracle: construction."""
    for seed in range(3):
        verdicts = infer(
            efficient(fit(simulated(AxisNoise(white_noise=1.0), seed), "WN+GM", sampling="mean"))
        ).verdicts
        assert verdicts[0].identifiable
        assert not verdicts[1].identifiable


def test_a_process_below_the_sampling_interval_is_white():
    """Oracle: construction; a Gauss-Markov process of a tenth of a sample interval, alone."""
    axis = AxisNoise(gauss_markov=(GaussMarkov(0.01, 100.0),))
    (verdict,) = infer(efficient(fit(simulated(axis, 4), "GM", sampling="mean"))).verdicts
    assert (verdict.identifiable, verdict.reason) == (False, "short")
    assert "sampling interval, 0.02 s" in verdict.sentence


@pytest.fixture(scope="module")
def campaign() -> list[Inference]:
    """16 four-hour recordings of Table 5's accelerometer, sampled as means over 1.024 s: the same
    processes, fewer short scales.
    """
    samples = round(HOURS_4 / 1.024)
    curves = in_threads(lambda k: simulated(ACCEL, 1000 + k, samples, 1.0 / 1.024), 16)
    return [infer(efficient(fit(w, "WN+2GM", sampling="mean"))) for w in curves]


@pytest.mark.slow
def test_intervals_of_table_5_hold_the_truth(campaign):
    """Oracle: simulation; binomial bounds at 0.1 % of 95 % intervals, the median bias below a third
    of the error and what 16 scatter.
    """
    truth = composition_of(ACCEL).values(ACCEL)
    inside = np.array(
        [
            [e.low <= t <= e.high for e, t in zip(found.estimates, truth, strict=True)]
            for found in campaign
        ]
    )
    assert inside.sum(axis=0).min() >= stats.binom.ppf(0.001, 16, 0.95)
    value = np.array([[e.value for e in found.estimates] for found in campaign])
    error = np.array([[e.log_error for e in found.estimates] for found in campaign])
    bias = np.median(np.log(value / truth), axis=0) / np.nanmedian(error, axis=0)
    assert np.abs(np.delete(bias, 3)).max() < 1.0 / 3.0 + 2.0 * 1.25 / np.sqrt(
        16
    )  # but for the time that is not identifiable


@pytest.mark.slow
def test_verdicts_on_table_5(campaign):
    """Oracle: theory; 45 s can be had from four hours, 2060 s cannot: its standard error is a
    factor of four.
    """
    first, slow = (np.mean([found.verdicts[k].identifiable for found in campaign]) for k in (1, 2))
    assert first > 0.9
    assert slow < 0.2
