"""Exposures against the turns that GNSS saw. The turn rates of gyro and GNSS are held against wrong files in test_wrong_input."""

from dataclasses import replace

import pytest

from insgnss.prepare.turns import check_events
from insgnss.simulate.scenario import ImuOptions, simulate_flight


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
        assert check_events(replace(flown.events, time=flown.events.time + late), flown.gnss).verdict == "ok"


def test_a_few_images_or_a_short_flight_tell_nothing(flown):
    """Oracle: a chance of a few images in a turn is no proof."""
    few = replace(flown.events, images=flown.events.images[:10], time=flown.events.time[:10] + 18.0)
    assert check_events(few, flown.gnss).verdict == "ok"
