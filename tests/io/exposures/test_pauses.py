"""A clock of exposures that was set on the way is asked about; missed and late images are not."""

from dataclasses import replace

import numpy as np
import pytest

from insgnss.io.exposures.pauses import check_even_intervals
from insgnss.navigation.recognise.turns import exposure_ways
from insgnss.records import CameraEvents
from insgnss.simulation.scenario import ImuOptions, simulate_flight


@pytest.fixture(scope="module", params=["ign8", "ign6x1"])
def flown(request):
    simulated = simulate_flight(request.param, 12.0, seed=3, imu=ImuOptions(rate_hz=20.0))
    return simulated.events, simulated.gnss


def asked(flown, late=0.0, keep=slice(None)):
    events, gnss = flown
    events = replace(events, time=events.time + late)[np.arange(events.time.size)[keep]]
    return check_even_intervals(events, *exposure_ways(events.time, gnss))


@pytest.mark.parametrize("step_s", [3.7, 0.9, -0.9])
def test_a_clock_that_was_set_on_a_line_is_asked_about(flown, step_s):
    """Oracle: the step, 6 exposures behind the begin of the first line."""
    behind = np.arange(flown[0].time.size) > 6
    check = asked(flown, step_s * behind)
    assert check.verdict == "note"
    assert f"between images {flown[0].images[6]} and {flown[0].images[7]} " in check.found
    lacking = float(check.found.rpartition("lack ")[2].split()[0])
    assert lacking == pytest.approx(step_s, abs=0.05)


def test_steps_anywhere_are_mostly_asked_about(flown):
    """Oracle: 60 random steps; those in turns, at ends of lines and of multiples show nothing."""
    draw, count = np.random.default_rng(5), flown[0].time.size
    found = [
        asked(flown, draw.uniform(0.6, 5.0) * (np.arange(count) >= draw.integers(3, count - 3)))
        for _ in range(60)
    ]
    assert sum(check.verdict == "note" for check in found) >= 25


def test_right_missed_and_late_images_raise_no_question(flown):
    """Oracle: the simulator's exposures on lines, thinned and late by chance."""
    draw, count = np.random.default_rng(6), flown[0].time.size
    assert asked(flown).verdict == "ok"
    for _ in range(60):
        assert asked(flown, keep=np.sort(draw.permutation(count)[5:])).verdict == "ok"
        late = draw.normal(0.0, 0.02, count)
        late[draw.permutation(count)[:4]] += draw.uniform(0.2, 1.0)
        assert asked(flown, late).verdict == "ok"


def through_turns(flown, seed):
    """Exposures every 2 s of a whole flight, jitter of 5 ms."""
    gnss = flown[1]
    time = np.arange(gnss.time[0] + 70.0, gnss.time[-1] - 20.0, 2.0)
    time += np.random.default_rng(seed).normal(0.0, 0.005, time.size)
    images = tuple(f"{k:04d}" for k in range(time.size))
    return CameraEvents(images=images, time=time, gps_week=gnss.gps_week, source=""), gnss


@pytest.mark.parametrize("seed", range(3))
def test_a_step_within_a_turn_is_asked_about_where_the_trigger_goes_on(flown, seed):
    """Oracle: the step; without it, and with missed and late images, nothing is asked."""
    draw, whole = np.random.default_rng(seed), through_turns(flown, seed)
    events, gnss = whole
    turning = np.flatnonzero(~exposure_ways(events.time, gnss)[1])
    turning = turning[(turning > 5) & (turning < events.time.size - 6)]
    at = int(draw.choice(turning))
    check = asked(whole, 0.7 * (np.arange(events.time.size) > at))
    assert check.verdict == "note"
    assert f"{events.images[at]} and {events.images[at + 1]} " in check.found
    assert float(check.found.rpartition("lack ")[2].split()[0]) == pytest.approx(0.7, abs=0.05)
    assert asked(whole).verdict == "ok"
    late = np.zeros(events.time.size)
    late[draw.permutation(events.time.size)[:4]] += draw.uniform(0.3, 1.0)
    assert asked(whole, late).verdict == "ok"
    assert asked(whole, keep=np.sort(draw.permutation(events.time.size)[9:])).verdict == "ok"
