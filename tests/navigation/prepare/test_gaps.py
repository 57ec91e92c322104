"""Gaps of the IMU: how well they are bridged, and where they divide a flight."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from insgnss.base.errors import DataError
from insgnss.geodesy.rotation import vector_from_rotation
from insgnss.navigation.prepare.gaps import (
    bridged_variance,
    edges,
    find_gaps,
    nominal_interval,
    segments,
)
from insgnss.navigation.prepare.increments import body_increments
from insgnss.navigation.prepare.static_recording import static_span
from insgnss.navigation.recognise.plausibility import _imu_rate
from insgnss.simulation.scenario import ImuOptions, simulate_flight

BODY = np.eye(3)


@pytest.fixture(scope="module")
def flight():
    return simulate_flight(
        "ign8",
        3.0,
        seed=4,
        imu=ImuOptions(rate_hz=100.0, noise=None),
        start_in_air=True,
        line_length_m=120.0,
    )


def holed(imu, first, missing):
    keep = np.ones(imu.time.size, dtype=bool)
    keep[first : first + missing] = False
    return replace(imu, time=imu.time[keep], gyro=imu.gyro[keep], accel=imu.accel[keep])


def test_what_a_bridge_misses_is_what_it_is_said_to_miss(flight):
    """Oracle: exact motion at 60 gaps of 0.5 s; the mean of 60 squares over their variance lies in
    0.4 to 2.5, for turns come in bursts.
    """
    imu, motion = flight.imu, flight.flight.motion
    misses, said = [], []
    for first in np.linspace(1000, imu.time.size - 1000, 60).astype(int):
        gapped = holed(imu, first, 50)
        marks = np.array(
            [
                imu.time[first - 100],
                imu.time[first - 1],
                imu.time[first + 50],
                imu.time[first + 100],
            ]
        )
        inc = body_increments(gapped, BODY, marks)
        turn = np.einsum("ji,jk->ik", motion.C_lb(marks[1:2])[0], motion.C_lb(marks[2:3])[0])
        misses.append(
            vector_from_rotation(turn[None])[0] - inc.dtheta[inc.stop[1] : inc.stop[2]].sum(axis=0)
        )
        said.append(inc.bridged[2, :3])
        assert_array_equal(inc.bridged[[1, 3]], 0.0)
    ratio = np.mean(np.square(misses), axis=0) / np.mean(said, axis=0)
    assert ((ratio > 0.4) & (ratio < 2.5)).all(), ratio
    assert np.sqrt(np.mean(said)) > np.radians(
        0.2
    )  # the flight turns: a bridge that said nothing would be wrong


def test_a_gap_that_a_mark_divides_is_shared_out(flight):
    """Oracle: the variance of the whole gap."""
    imu = holed(flight.imu, 5000, 50)
    gaps = find_gaps(imu.time, nominal_interval(imu.time))
    (t, length), edge = gaps[0], edges(imu.time, imu.time[0], imu.time[-1])
    assert_allclose(edge, [t, t + length], rtol=0, atol=1e-9)
    whole = bridged_variance(imu, BODY, gaps, np.array([t - 1.0, t, t + length]))[2]
    parts = bridged_variance(imu, BODY, gaps, np.array([t - 1.0, t, t + 0.2, t + length, t + 1.0]))
    assert_allclose(parts[2] + parts[3], whole, rtol=1e-12)
    assert_allclose(parts[2], 0.2 / length * whole, rtol=1e-9)
    assert_array_equal(parts[[0, 1, 4]], 0.0)


def test_long_gaps_divide_the_flight(flight):
    """Oracle: the gaps that were made."""
    imu = holed(holed(flight.imu, 9000, 300), 4000, 150)
    t = flight.imu.time
    parts = segments(imu.time, t[0], t[-1])
    assert_allclose(
        parts, [(t[0], t[3999]), (t[4150], t[8999]), (t[9300], t[-1])], rtol=0, atol=1e-9
    )
    assert segments(imu.time, t[4200], t[8000]) == [(t[4200], t[8000])]
    assert segments(holed(flight.imu, 4000, 60).time, t[0], t[-1]) == [(t[0], t[-1])]


@pytest.mark.parametrize(("step_s", "bridged_s"), [(0.01, 1.0), (0.2, 1.0), (0.5, 1.5)])
def test_gaps_up_to_a_second_or_three_intervals_are_bridged(step_s, bridged_s):
    """Oracle: one second, three intervals of slower sensors; 5 % of a nominal interval beside."""
    for by, parts in ((-0.05, 1), (0.05, 2)):
        before = step_s * np.arange(100.0)
        after = before + before[-1] + bridged_s + by * step_s
        time = np.concatenate([before, after])
        assert len(segments(time, time[0], time[-1])) == parts


def test_intervals_that_lack_a_sample_and_gaps_with_edges():
    """Oracle: one and a half nominal intervals lack a sample; edges beyond a tenth of a second."""
    for length, lacks, edged in ((0.0149, 0, 0), (0.0151, 1, 0), (0.099, 1, 0), (0.101, 1, 2)):
        time = np.concatenate([0.01 * np.arange(100.0), 0.99 + length + 0.01 * np.arange(100.0)])
        assert len(find_gaps(time, nominal_interval(time))) == lacks
        assert edges(time, time[0], time[-1]).size == edged


def test_gaps_that_nothing_can_be_compared_with_are_refused(flight):
    """Oracle: the construction: 0.2 s of samples, 0.3 s of none, and so on, so that no 0.3 s are
    whole.
    """
    imu = flight.imu
    keep = (imu.time - imu.time[0]) % 0.5 < 0.2
    burst = replace(imu, time=imu.time[keep], gyro=imu.gyro[keep], accel=imu.accel[keep])
    with pytest.raises(DataError, match=r"gap of 0\.3\d* s at .*; record without gaps"):
        body_increments(burst, BODY, burst.time[[0, 50, -1]])


def test_a_pause_of_hours_is_a_gap_and_no_bunches(flight):
    """Oracle: the same recording whose stamps come ten at a time, twice a second or every 5 s."""
    imu = flight.imu
    pause = replace(imu, time=imu.time + 3.0 * 3600.0 * (imu.time > imu.time[9000]))
    check = _imu_rate(pause, nominal_interval(pause.time))
    assert check.verdict == "note"
    assert "1 gaps, longest 10800.0" in check.found
    assert static_span(pause).checks[0].verdict == "ok"
    for every in (0.1, 5.0):
        bunches = np.floor(imu.time / every) * every + 1e-6 * np.arange(imu.time.size)
        check = _imu_rate(replace(imu, time=bunches), nominal_interval(bunches))
        assert (check.verdict, "bunches" in check.advice) == ("contradiction", True)
        assert static_span(replace(imu, time=bunches)).checks[0].verdict == "contradiction"
