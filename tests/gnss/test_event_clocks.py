"""Camera events of a file beside the rover's: equal, off by a constant, or of another flight."""

import numpy as np
import pytest

from insgnss.gnss.exposures.event_times import check_beside, check_camera_delay
from insgnss.records import CameraEvents

WEEK = 2021  # of 2018: 18 leap seconds
UNEVEN = 392700.0 + np.cumsum(np.random.default_rng(5).uniform(1.8, 2.6, 80))
EVEN = 392700.0 + 2.137 * np.arange(80)


def events(time, week=WEEK, source="flight.MRK"):
    return CameraEvents(tuple(str(k) for k in range(time.size)), time, week, source)


@pytest.mark.parametrize("time", [UNEVEN, EVEN], ids=["uneven", "even"])
@pytest.mark.parametrize(
    ("offset", "verdict", "what"),
    [
        (
            0.0,
            "ok",
            (
                "75 of the 75 events of flight.MRK and of the 80 events of the rover are the same,"
                " +0.0 ms apart"
            ),
        ),
        (0.002, "ok", "the same, +2.0 ms apart"),
        (-18.0, "contradiction", "the same but for -18.000 s, the 18 leap seconds: UTC?"),
        (-0.9, "contradiction", "the same but for -0.900 s"),
        (0.35, "contradiction", "the same but for +0.350 s"),
    ],
)
def test_a_constant_between_file_and_rover_is_found(time, offset, verdict, what):
    """Oracle: the constant added to the stamps; at even intervals the smallest that fits, or a
    likely one.
    """
    check = check_beside(events(time[3:78] + offset), events(time), WEEK)
    assert check.verdict == verdict
    assert check.found.endswith(what)
    assert ("GPST" in check.advice) == (verdict == "contradiction")


def test_a_constant_that_is_not_the_leap_seconds_is_not_taken_for_them():
    """Oracle: the constant added, 0.2 s from 18 s."""
    check = check_beside(events(UNEVEN - 18.2), events(UNEVEN), WEEK)
    assert check.found.endswith("the same but for -18.200 s")


def test_weeks_are_taken_off():
    """Oracle: the same events counted from the week before, and without a week."""
    before = events(UNEVEN + 604800.0, WEEK - 1)
    assert check_beside(before, events(UNEVEN), WEEK).verdict == "ok"
    assert check_beside(events(UNEVEN, None), events(UNEVEN), WEEK).verdict == "ok"


def test_events_of_another_flight_are_told():
    """Oracle: intervals from another seed."""
    other = 392700.0 + np.cumsum(np.random.default_rng(6).uniform(1.8, 2.6, 60))
    check = check_beside(events(other), events(UNEVEN), WEEK)
    assert check.verdict == "note"
    assert "of the 60 events of flight.MRK" in check.found


def test_two_events_prove_nothing():
    """Oracle: two of them can always be brought together."""
    assert check_beside(events(UNEVEN[:2] + 0.5), events(UNEVEN), WEEK) is None
    assert check_beside(events(UNEVEN), events(UNEVEN[:0]), WEEK) is None


@pytest.mark.parametrize(
    ("delay", "verdict"), [(0.0012, "ok"), (-0.5, "ok"), (0.51, "note"), (-1.2, "note")]
)
def test_the_camera_delay_is_told(delay, verdict):
    """Oracle: half a second."""
    check = check_camera_delay(delay)
    assert check.verdict == verdict
    assert check.found.startswith(f"{delay:+g} s added to each event")
