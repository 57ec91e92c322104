"""The charts of a sensor's noise: what they show, and in which units."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from insgnss.records import WaveletVariance, chi_square_interval
from insgnss.report.charts.chart import Layer
from insgnss.report.figures.noise import (
    NoisePanel,
    SpectrumPanel,
    noise_chart,
    process_label,
    spectrum_charts,
)

DEG_H = np.pi / 180.0 / 3600.0
RATE = 100.0
LEVEL = np.arange(1, 17)
TAU = 2.0 ** (LEVEL - 1) / RATE
WHITE = (10.0 * DEG_H) ** 2 / (
    2.0 * TAU
)  # wavelet variance of 10 deg/h/sqrt(Hz): deviation 10 deg/h at 1 s


def curve(variance, samples=200_000):
    count = samples - 2**LEVEL + 1
    low, high = chi_square_interval(variance, np.maximum(count / 2.0**LEVEL, 1.0))
    return WaveletVariance(LEVEL, variance, low, high, count, RATE, samples)


def panel(curves, levels=None, modelled=WHITE, words="J test: p = 0.3"):
    labels = [f"static_{k}" for k in range(len(curves))]
    parts = (
        {"white_noise": 0.9 * modelled, "gauss_markov_1": 0.1 * modelled} if modelled.size else {}
    )
    told = {
        "white_noise": "white noise  9.5 deg/h",
        "gauss_markov_1": "Gauss-Markov  2.5 s, 20 deg/h",
    }
    return NoisePanel(
        "x", curves, labels, TAU[: modelled.size], modelled, parts, told, levels, words
    )


def layers(one: NoisePanel) -> dict[str, Layer]:
    (axes,) = noise_chart("gyro", [one]).panels
    return {layer.name: layer for layer in axes.layers if layer.name}


def test_white_noise_of_ten_degrees_an_hour_is_drawn_as_such():
    """Oracle: the deviation of white noise q over tau is q / sqrt(tau), here 10 deg/h at 1 s."""
    shown = layers(panel([curve(WHITE)]))
    for name in ("static_0, 95 %", "fitted sum, J test: p = 0.3"):
        assert_allclose(shown[name].y, 10.0 / np.sqrt(shown[name].x), rtol=1e-9)
    part = shown["white noise  9.5 deg/h"]
    assert_allclose(part.y, np.sqrt(0.9) * 10.0 / np.sqrt(TAU), rtol=1e-12)
    assert part.dashed
    assert "left out of the fit" not in shown
    assert not any("off by" in name for name in shown)


def test_intervals_are_those_of_chi_square():
    """Oracle: roots of the bounds of the variance, times sqrt(2)."""
    one = curve(WHITE)
    (axes,) = noise_chart("gyro", [panel([one])]).panels
    band = next(layer for layer in axes.layers if layer.kind == "band")
    assert_allclose(band.y, np.sqrt(2.0 * one.low) / DEG_H, rtol=1e-12)
    assert_allclose(band.y2, np.sqrt(2.0 * one.high) / DEG_H, rtol=1e-12)


def test_scales_left_out_are_grey_and_those_that_do_not_fit_are_ringed():
    """Oracle: the levels that were left out, and the one that was moved by 30 % where its interval
    is 1 %.
    """
    variance = WHITE.copy()
    variance[4] *= 1.3**2
    shown = layers(panel([curve(variance)], levels=range(3, 15)))
    assert_allclose(shown["left out of the fit"].x, TAU[[0, 1, 14, 15]])
    assert shown["left out of the fit"].ink == "faint"
    assert_allclose(shown["fit off by more than 5 %"].x, TAU[[4]])
    assert shown["static_0, 95 %"].x.size == 12
    assert len(shown["static_0, 95 %"].texts) == 12


def test_several_recordings_share_one_entry_of_the_legend():
    """Oracle: the number of recordings; light curves carry no rings."""
    shown = layers(panel([curve(WHITE * f) for f in (1.0, 1.2, 2.0)]))
    assert "3 recordings, 95 %" in shown
    assert not any(name.startswith(("static", "fit off")) for name in shown)


def test_without_a_fit_there_are_the_curves_alone():
    """Oracle: by hand."""
    shown = layers(panel([curve(WHITE)], modelled=np.zeros(0), words=""))
    assert list(shown) == ["static_0, 95 %"]


def test_limits_hold_the_curve_and_hours_stand_at_the_top():
    """Oracle: the smallest and largest deviation; the minute lies within 0.01 to 330 s, ten minutes
    do not.
    """
    chart = noise_chart("gyro", [panel([curve(WHITE)])] * 3)
    assert len(chart.panels) == 3
    assert (chart.scale, chart.panels[0].scale) == ("log", "log")
    low, high = chart.panels[0].limits
    assert low < 10.0 / np.sqrt(TAU[-1])
    assert high > 10.0 / np.sqrt(TAU[0])
    assert chart.limits[0] < TAU[0] < TAU[-1] < chart.limits[1]
    clock = next(layer for layer in chart.panels[0].layers if layer.kind == "labels")
    assert (clock.x.tolist(), list(clock.texts)) == ([60.0], ["1 min"])
    assert low < clock.y[0] < high


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("gyro", "white_noise", 10.825 * DEG_H), "white noise  10.8 deg/h/√Hz"),
        (("accel", "white_noise", 51.514 * 9.80665e-6), "white noise  51.5 µg/√Hz"),
        (("gyro", "gauss_markov", 57.8 * DEG_H, 4737.1), "Gauss-Markov  79 min, 57.8 deg/h"),
        (("gyro", "gauss_markov", 20.0 * DEG_H, 2.5), "Gauss-Markov  2.5 s, 20 deg/h"),
        (("accel", "gauss_markov", 31.1 * 9.80665e-6, 0.0052), "Gauss-Markov  5.2 ms, 31.1 µg"),
        (("gyro", "random_walk", 2.0 * DEG_H), "random walk  2 deg/h/s/√Hz"),
        (("accel", "random_walk", 3.0 * 9.80665e-6), "random walk  3 µg/s/√Hz"),
        (("gyro", "quantization", 4e-6), "quantization  4 µrad"),
        (("accel", "quantization", 5e-5), "quantization  0.05 mm/s"),
        (("gyro", "drift", 12345.0 * DEG_H / 3600.0), "drift  12300 deg/h/h"),
    ],
)
def test_processes_are_named_in_the_units_of_data_sheets(arguments, words):
    """Oracle: the units by hand."""
    assert process_label(*arguments) == words


def spectrum(sensor, axis, lines=(43.6, 87.2)):
    f = np.fft.rfftfreq(400, 1.0 / 200.0)
    density = np.full(f.size, 30.0 * DEG_H)
    return SpectrumPanel(
        sensor, axis, f, density, [("static model", density / 3.0), ("tuned", density)], lines
    )


def test_a_chart_of_spectra_for_each_sensor():
    """Oracle: the channels, whether there are six, three or four."""
    six = [spectrum(sensor, axis) for sensor in ("gyro", "accel") for axis in "xyz"]
    for panels, expected in ((six, (3, 3)), (six[:3], (3,)), (six[:4], (3, 1))):
        charts = spectrum_charts(panels)
        assert tuple(len(chart.panels) for chart in charts) == expected
        assert [chart.name for chart in charts] == ["spectrum-gyro", "spectrum-accel"][
            : len(expected)
        ]


def test_spectrum_is_drawn_beside_its_models():
    """Oracle: the densities that were put in, 30 and 10 deg/h/sqrt(Hz); lines that are close share
    a label.
    """
    (chart,) = spectrum_charts([spectrum("gyro", "x", (43.6, 44.0, 87.2))])
    (axes,) = chart.panels
    shown = {layer.name or layer.kind: layer for layer in axes.layers}
    assert_allclose(shown["in straight flight"].y, 30.0, rtol=1e-12)
    assert_allclose(shown["static model"].y, 10.0, rtol=1e-12)
    assert_allclose(shown["lines (propellers)"].x, [43.6, 44.0, 87.2])
    assert axes.limits[0] < 10.0 < 30.0 < axes.limits[1]
    assert list(shown["labels"].texts) == ["43.6 Hz", "87.2 Hz"]
