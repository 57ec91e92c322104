"""Checks of static recordings against simulated ones whose faults are known."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from insgnss.base.errors import DataError
from insgnss.navigation.noise_model.model import load_noise_model
from insgnss.navigation.prepare.static_recording import static_span
from insgnss.noise.processes.realisation import simulate_noise
from insgnss.records import ImuSamples

RATE, SECONDS = 50.0, 600
BIAS = (0.01, -0.02, 0.005)
GRAVITY = np.array([0.1, -0.2, -9.8])


def recording(seed=1, seconds=SECONDS, model="navchip"):
    """Ten minutes of an IMU at rest."""
    rng = np.random.default_rng(seed)
    n, noise = int(seconds * RATE), load_noise_model(model)
    gyro, accel = (
        np.column_stack([simulate_noise(axis, n, 1.0 / RATE, rng) for axis in triad])
        for triad in (noise.gyro, noise.accel)
    )
    return ImuSamples(100.0 + np.arange(n) / RATE, gyro + BIAS, accel + GRAVITY, source="made.csv")


@pytest.fixture(scope="module")
def still():
    return recording()


def changed(imu, **arrays):
    """The recording with functions applied to copies of its arrays."""
    out = {}
    for name, change in arrays.items():
        out[name] = getattr(imu, name).copy()
        change(out[name])
    return replace(imu, **out)


def verdicts(span):
    return {check.name: check.verdict for check in span.checks}


def found(span, name):
    return next(check for check in span.checks if check.name == name)


@pytest.mark.parametrize("model", ["navchip", "tactical"])
def test_rest_is_rest(model):
    """Oracle: simulation without faults; of ten recordings of six channels none may be called
    disturbed (eight sigma).
    """
    for seed in range(5):
        span = static_span(recording(seed, 300, model))
        assert set(verdicts(span).values()) == {"ok"}, span.checks
        assert span.disturbances == ()
        assert_allclose(span.rate_hz, RATE, rtol=1e-9)
        assert len(span.gyro) == 300 * RATE


def test_a_knock_is_found_where_it_was(still):
    """Oracle: a decaying vibration of a second at 200 s; eight times the noise of one axis."""
    t = np.arange(50) / RATE

    def knock(a):
        a[10_000:10_050, 1] += 8.0 * still.accel[:, 1].std() * np.sin(60.0 * t) * np.exp(-t)

    span = static_span(changed(still, accel=knock))
    (one,) = span.disturbances
    assert (one.kind, one.channel) == ("shaken", "accelerometer y")
    assert abs(one.begin_s - 200.0) <= 1.0
    assert one.length_s <= 3.0
    assert verdicts(span)["motion"] == "note"


def test_a_tilt_is_a_step(still):
    """Oracle: 5 mrad of tilt at 400 s, in the means of two axes and nowhere else."""

    def tilt(a):
        a[20_000:] += [0.049, 0.0, 0.0]

    span = static_span(changed(still, accel=tilt))
    assert abs(span.disturbances[0].begin_s - 400.0) < 12.0
    assert span.disturbances[0].channel == "accelerometer x"
    assert "disturbed" in found(span, "motion").found


def test_a_moving_sensor_is_refused(still):
    """Oracle: a car's sway, 0.1 Hz of 5 deg/s and its acceleration, over two thirds of the time."""
    t = still.time - still.time[0]
    on = np.where(t > 200.0, 1.0, 0.0)

    def turn(a):
        a[:, 2] += on * 0.09 * np.sin(0.6 * t)

    def sway(a):
        a[:, 0] += on * 1.0 * np.sin(0.5 * t)

    span = static_span(changed(still, gyro=turn, accel=sway))
    check = found(span, "motion")
    assert check.verdict == "contradiction"
    assert "at rest for 3" in check.found
    assert "longest from 0 to 200 s" in check.found


def test_gaps_are_told_and_the_longest_span_is_taken(still):
    """Oracle: gaps made by leaving out rows, of 0.1 s, 2 s and a row; the samples between them by
    count.
    """
    keep = np.ones(still.time.size, dtype=bool)
    keep[5_000:5_005] = keep[9_000:9_100] = keep[20_000] = False
    imu = replace(still, time=still.time[keep], gyro=still.gyro[keep], accel=still.accel[keep])
    span = static_span(imu)
    check = found(span, "missing samples")
    assert check.verdict == "note"
    assert "3 gaps, the longest of 2.02 s at 180.0 s" in check.found
    assert "36% of the samples" in check.found
    assert len(span.gyro) == 20_000 - 9_100
    assert_allclose(span.begin_s, 182.0, rtol=0, atol=1e-6)
    assert_allclose(span.gyro, still.gyro[9_100:20_000])


def test_short_gaps_are_filled_by_straight_lines_where_asked(still):
    """Oracle: the rows left out, of a recording that is a straight line itself."""
    line = replace(still, gyro=still.gyro + np.arange(still.time.size)[:, None] * 0.0)
    keep = np.ones(still.time.size, dtype=bool)
    keep[5_000:5_005] = keep[25_000:25_100] = False
    imu = replace(line, time=line.time[keep], gyro=line.gyro[keep], accel=line.accel[keep])
    span = static_span(imu, bridge_s=0.5)
    assert len(span.gyro) == 25_000
    between = np.interp(np.arange(6), [-1, 5], [still.gyro[4_999, 0], still.gyro[5_005, 0]])
    assert_allclose(span.gyro[5_000:5_005, 0], between[:5], rtol=1e-12)
    assert "filled by straight lines" in found(span, "missing samples").found


def test_what_is_skipped_and_kept(still):
    """Oracle: counts of rows."""
    span = static_span(still, skip_s=120.0, keep_s=300.0)
    assert_allclose(span.begin_s, 120.0)
    assert_allclose(span.gyro, still.gyro[6_000:21_000])
    with pytest.raises(DataError, match=r"nothing from 700 s on; the recording is 600\.0 s long"):
        static_span(still, skip_s=700.0)
    assert verdicts(static_span(still, keep_s=30.0))["length"] == "contradiction"


def test_increments_are_taken_as_rates(still):
    """Oracle: the rates that the increments are of."""
    span = static_span(
        replace(still, gyro=still.gyro / RATE, accel=still.accel / RATE, quantity="increments")
    )
    assert_allclose(span.gyro, still.gyro, rtol=1e-9)
    assert_allclose(span.accel, still.accel, rtol=1e-9)


@pytest.mark.parametrize(
    ("name", "change", "said"),
    [
        ("constant channel", {"gyro": lambda a: a[:, 1].fill(0.25)}, "gyro y is 0.25 throughout"),
        (
            "constant channel",
            {"accel": lambda a: a[2_000:2_500, 0].fill(0.3)},
            "accelerometer x stays at 0.3 for 10.0 s from 40.0 s on",
        ),
        (
            "units",
            {"accel": lambda a: np.divide(a, 9.80665, out=a)},
            "the values look like g: give --accel-unit g",
        ),
        (
            "units",
            {"accel": lambda a: np.multiply(a, 300.0, out=a)},
            "if these are counts, --accel-unit '0.003335 m/s^2'",
        ),
        (
            "units",
            {"gyro": lambda a: np.multiply(a, 57.29578, out=a)},
            "the sensor turns, or the unit is wrong; record at rest, or give --gyro-unit",
        ),
        (
            "rounding",
            {"gyro": lambda a: np.multiply(np.rint(a / 1e-3), 1e-3, out=a)},
            "the rounding hides the noise",
        ),
    ],
)
def test_unfit_recordings_are_refused(still, name, change, said):
    """Oracle: one fault each, put in by hand, and what undoes it in the sentence."""
    check = found(static_span(changed(still, **change)), name)
    assert check.verdict == "contradiction"
    assert said in f"{check.found} {check.advice}"


def test_rates_that_are_too_small_for_the_turning_earth_are_noted(still):
    """Oracle: rad/s taken for deg/s, which makes 1/57.3 of the noise and passed in silence; the
    Earth's 15.04 deg/h by hand. Deg/s taken for rad/s are refused, with the unit.
    """
    smaller = changed(still, gyro=lambda a: np.radians(a - a.mean(axis=0) + 1e-3, out=a))
    check = found(static_span(smaller), "Earth's rate")
    assert check.verdict == "note"
    assert check.found == "|mean rate| 6.24 deg/h"
    assert "the Earth turns by 15.04" in check.expected
    assert "(then 357 deg/h)" in check.advice
    assert "Earth's rate" not in verdicts(static_span(still))
    larger = changed(still, gyro=lambda a: np.degrees(a - a.mean(axis=0), out=a))
    assert "--gyro-unit deg/s" in found(static_span(larger), "motion").advice


def test_rounding_is_told_by_its_share(still):
    """Oracle: s^2/12 over the variance of the rounded samples; of 1 sigma a step that is 1/13."""
    sigma = float(np.diff(still.accel[:, 2]).std() / np.sqrt(2.0))

    def coarse(a):
        a[:, 2] = np.rint(a[:, 2] / sigma) * sigma

    check = found(static_span(changed(still, accel=coarse)), "rounding")
    assert check.verdict == "note"
    assert (
        "accelerometer z scatter by 1 steps of their resolution, 8 % of the variance is rounding"
        in check.found
    )


def test_a_rail_is_told(still):
    """Oracle: a reading held at the end of a range for five samples."""

    def rail(a):
        a[300:305, 0] = 5.0

    assert (
        "gyro x reads 5 in 5 samples"
        in found(static_span(changed(still, gyro=rail)), "range").found
    )


def test_stamps_in_bunches_make_no_rate(still):
    """Oracle: stamps of a logger that writes ten samples at once."""
    time = (
        100.0
        + np.floor(np.arange(still.time.size) / 10) * 0.2
        + np.arange(still.time.size) % 10 * 1e-4
    )
    check = found(static_span(replace(still, time=time)), "sampling")
    assert check.verdict == "contradiction"
    assert "--rate" in check.advice
