"""The pictures of a sensor's noise: what is drawn, in which units, and that all shapes of input
give a picture.
"""

import io

import numpy as np
import pytest
from matplotlib.figure import Figure
from numpy.testing import assert_allclose

from insgnss.records import WaveletVariance, chi_square_interval
from insgnss.report.figures import noise
from insgnss.report.figures.noise import (
    NoisePanel,
    SpectrumPanel,
    draw_noise,
    draw_psd,
    process_label,
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


def panel(curves, levels=None, modelled=WHITE, words=("J test p = 0.3",)):
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


def drawn(one):
    ax = Figure().subplots()
    noise._panel(ax, one, 1.0 / DEG_H)
    return {line.get_label(): line for line in ax.get_lines()}


def size_of(png):
    from PIL import Image

    return Image.open(io.BytesIO(png)).size


def test_white_noise_of_ten_degrees_an_hour_is_drawn_as_such():
    """Oracle: the deviation of white noise q over tau is q / sqrt(tau), here 10 deg/h at 1 s."""
    lines = drawn(panel([curve(WHITE)]))
    for label in ("static_0, 95 %", "fitted sum of"):
        tau, deviation = lines[label].get_data()
        assert_allclose(deviation, 10.0 / np.sqrt(tau), rtol=1e-9)
    assert_allclose(
        lines["white noise  9.5 deg/h"].get_ydata(), np.sqrt(0.9) * 10.0 / np.sqrt(TAU), rtol=1e-12
    )
    assert "left out of the fit" not in lines
    assert not any("off by" in label for label in lines)


def test_scales_left_out_are_grey_and_those_that_do_not_fit_are_ringed():
    """Oracle: the levels that were left out, and the one that was moved by 30 % where its interval
    is 1 %.
    """
    variance = WHITE.copy()
    variance[4] *= 1.3**2
    lines = drawn(panel([curve(variance)], levels=range(3, 15)))
    assert_allclose(lines["left out of the fit"].get_xdata(), TAU[[0, 1, 14, 15]])
    assert_allclose(lines["fit off by more than 5 %"].get_xdata(), TAU[[4]])
    assert lines["static_0, 95 %"].get_xdata().size == 12


def test_several_recordings_share_one_entry_of_the_legend():
    """Oracle: the number of recordings; light curves carry no rings."""
    lines = drawn(panel([curve(WHITE * f) for f in (1.0, 1.2, 2.0)]))
    assert "3 recordings, 95 %" in lines
    assert not any(label.startswith(("static", "fit off")) for label in lines)


@pytest.mark.parametrize(
    ("panels", "subtitle", "height"),
    [
        ([panel([curve(WHITE)])] * 3, "static_0, 2000 s at 100 Hz", 993),
        ([panel([curve(WHITE), curve(2.0 * WHITE)], levels=range(3, 15))], "words " * 60, 567),
        ([panel([curve(WHITE)], modelled=np.zeros(0), words=())], "", 516),
    ],
)
def test_picture_is_a_png_that_grows_with_its_words(panels, subtitle, height):
    """Oracle: the image library; 11 inches at 100 points, 2.75 a panel (0.9 more where it is
    alone), 0.22 and 0.17 a line of words.
    """
    width, got = size_of(draw_noise("gyro", panels, "white noise fits", subtitle))
    assert width == 1100
    assert abs(got - height) <= 1


def test_limits_hold_the_curve_and_hours_run_along_the_top():
    """Oracle: the smallest and largest deviation; the minute and the ten minutes within 0.01 to 330
    s.
    """
    low, high = noise._heights(panel([curve(WHITE)]), 1.0 / DEG_H)
    assert low < 10.0 / np.sqrt(TAU[-1])
    assert high > 10.0 / np.sqrt(TAU[0])
    ax = Figure().subplots()
    noise._log(ax, (0.005, 460.0), (low, high))
    noise._clock(ax, (0.005, 460.0))
    assert [text.get_text() for text in ax.child_axes[0].get_xticklabels()] == ["1 min"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("gyro", "white_noise", 10.825 * DEG_H), "white noise  10.8 deg/h/√Hz"),
        (("accel", "white_noise", 51.514 * 9.80665e-6), "white noise  51.5 µg/√Hz"),
        (("gyro", "gauss_markov_2", 57.8 * DEG_H, 4737.1), "Gauss-Markov  79 min, 57.8 deg/h"),
        (("gyro", "gauss_markov_1", 20.0 * DEG_H, 2.5), "Gauss-Markov  2.5 s, 20 deg/h"),
        (("accel", "gauss_markov_1", 31.1 * 9.80665e-6, 0.0052), "Gauss-Markov  5.2 ms, 31.1 µg"),
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


@pytest.mark.slow
def test_spectra_stand_in_a_column_a_sensor():
    """Oracle: the image library; three rows of 2.3 inches and their head, whether there are six
    channels, three or four.
    """
    six = [spectrum(sensor, axis) for sensor in ("gyro", "accel") for axis in "xyz"]
    for panels in (six, six[:3], six[:4]):
        width, height = size_of(
            draw_psd(panels, "vibration triples the white noise", "212 s of straight flight")
        )
        assert width == 1100
        assert abs(height - 858) <= 1


def test_spectrum_is_drawn_beside_its_models():
    """Oracle: the densities that were put in, 30 and 10 deg/h/sqrt(Hz); lines that are close share
    a label.
    """
    ax = Figure().subplots()
    noise._spectrum(ax, spectrum("gyro", "x", (43.6, 44.0, 87.2)), first=True)
    lines = {line.get_label(): line for line in ax.get_lines()}
    assert_allclose(lines["in straight flight"].get_ydata(), 30.0, rtol=1e-12)
    assert_allclose(lines["static model"].get_ydata(), 10.0, rtol=1e-12)
    assert ax.get_ylim()[0] < 10.0 < 30.0 < ax.get_ylim()[1]
    assert [text.get_text() for text in ax.texts] == ["43.6 Hz", "87.2 Hz"]
