"""Exposures against the turns that GNSS saw. The turn rates of gyro and GNSS are held against wrong
files in test_wrong_input.
"""

from dataclasses import replace

import numpy as np
import pytest

from insgnss.geodesy.rotation import rotation_from_rpy
from insgnss.recognise.plausibility import check_heading
from insgnss.recognise.turns import _forces_agree, _judge_turns, check_events
from insgnss.simulation.manoeuvres import multirotor
from insgnss.simulation.raw_gnss.receiver import GnssOptions
from insgnss.simulation.scenario import ImuOptions, observe, simulate_flight


@pytest.fixture(scope="module", params=["ign8", "ign6x1"])
def flown(request):
    return simulate_flight(request.param, 12.0, seed=3, imu=ImuOptions(rate_hz=20.0))


@pytest.mark.parametrize("late", [18.0, -18.0])
def test_events_of_another_time_scale_lie_in_turns(flown, late):
    """Oracle: the simulator, which takes its images on lines only."""
    check = check_events(replace(flown.events, time=flown.events.time + late), flown.gnss)
    assert check.verdict == "contradiction"
    assert f"camera.time_offset_s = {-late:.0f}" in check.advice


def test_events_on_lines_are_believed(flown):
    """Oracle: the simulator's own events, and with half a second of delay, which cannot be told."""
    for late in (0.0, 0.5):
        assert (
            check_events(replace(flown.events, time=flown.events.time + late), flown.gnss).verdict
            == "ok"
        )


def test_a_few_images_or_a_short_flight_tell_nothing(flown):
    """Oracle: a chance of a few images in a turn is no proof."""
    few = replace(flown.events, images=flown.events.images[:10], time=flown.events.time[:10] + 18.0)
    assert check_events(few, flown.gnss).verdict == "ok"


def test_a_lag_within_the_interval_of_the_fixes_is_not_told(flown):
    """Oracle: fixes a second apart cannot tell a second, nor 0.98 from 0.97; ten times less left
    unexplained at 3 s is told.
    """
    for lag, here in ((1.0, 0.97), (3.0, 0.97)):
        assert _judge_turns(1.0, lag, 0.98, here, flown.imu, 0.05, 1.0) == ("ok", "")
    verdict, advice = _judge_turns(1.0, 3.0, 0.998, 0.97, flown.imu, 0.05, 1.0)
    assert verdict == "note"
    assert "add +3.0 s" in advice


def test_an_unclear_lag_at_the_edge_is_no_clock_error(flown):
    """Oracle: of 600 lags one always correlates; none is advised where it does not stand out."""
    for lag, best in ((-30.0, 0.9), (12.0, 0.7)):
        verdict, advice = _judge_turns(1.0, lag, best, 0.1, flown.imu, 0.05, 0.5)
        assert verdict == "contradiction"
        assert "time_offset_s" not in advice


def test_forces_speak_for_a_drone_whose_nose_does_not_follow_its_course():
    """Oracle: the simulator's records fit; with fixes 4 s late, or in the mirror, they do not."""
    flown = simulate_flight("ign8", 4.0, seed=3, imu=ImuOptions(rate_hz=50.0), start_in_air=True)
    assert _forces_agree(flown.imu, flown.gnss)
    assert not _forces_agree(flown.imu, replace(flown.gnss, time=flown.gnss.time + 4.0))
    assert not _forces_agree(replace(flown.imu, gyro=-flown.imu.gyro), flown.gnss)


def test_a_nose_across_a_single_course_tells_nothing_of_the_axes():
    """Oracle: a multirotor may fly one line with its nose anywhere; across two courses the same
    angle is a matter of the axes.
    """
    time = np.arange(400)
    for other, verdict in ((0.0, "note"), (2.5, "contradiction")):
        course = np.where(time < 200, 0.5, 0.5 + other)
        velocity = 12.0 * np.column_stack([np.cos(course), np.sin(course), np.zeros(400)])
        nose = course + 0.5 * np.pi
        C_nb = rotation_from_rpy(np.column_stack([0.0 * nose, 0.0 * nose, nose]))
        assert check_heading(time * 1.0, C_nb, velocity, np.eye(3)).verdict == verdict


@pytest.mark.parametrize("seed", [20, 25, 27])
def test_exposures_every_few_seconds_on_short_legs_are_in_no_other_time_scale(seed):
    """Oracle: the simulator's own events, every 5 s on legs of a quarter of a minute: 18 s away
    they would lie four times straighter, and so they would a few seconds away.
    """
    flight = multirotor(3.2, "sideways", seed=seed)
    sim = observe(flight, 22, imu=ImuOptions(50.0), gnss=GnssOptions(2.0), truth_hz=1.0)
    assert check_events(sim.events, sim.gnss).verdict == "ok"
