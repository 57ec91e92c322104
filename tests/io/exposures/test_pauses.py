"""A clock of exposures that was set on the way is asked about; missed and late images are not."""

from dataclasses import replace

import numpy as np
import pytest

from insgnss.io.exposures.pauses import check_even_intervals
from insgnss.navigation.recognise.turns import exposure_ways
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
