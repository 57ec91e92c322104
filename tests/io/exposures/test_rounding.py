"""Stamps of few digits: the standard deviation covers rounding and cutting off, exact ones keep
theirs.
"""

import numpy as np
import pytest

from insgnss.io.exposures.rounding import stamp_step, with_stamp_rounding
from insgnss.records import CameraEvents

RNG = np.random.default_rng(5)
TIME = 205344.8 + np.cumsum(2.6 + 0.02 * RNG.standard_normal(60))


def events(time: np.ndarray) -> CameraEvents:
    return CameraEvents(tuple(f"{k}.jpg" for k in range(time.size)), time)


@pytest.mark.parametrize("step", [1.0, 0.1, 0.01])
@pytest.mark.parametrize("cut", [np.rint, np.floor, np.ceil])
def test_the_sigma_covers_what_the_digits_lost(step, cut):
    """Oracle: the stamps before they were rounded; of n uniform errors the rms is within 20 % of
    what cutting off has, or below.
    """
    rounded = with_stamp_rounding(events(step * cut(TIME / step)))
    assert rounded.sigma_s is not None
    error = rounded.time - TIME
    expected = step / (12.0 if cut is np.rint else 3.0) ** 0.5
    assert np.sqrt(np.mean(error**2)) == pytest.approx(expected, rel=0.2)
    assert np.sqrt(np.mean((error / rounded.sigma_s) ** 2)) < 1.2
    (note,) = rounded.notes
    assert (note.name, note.verdict) == ("exposure times", "note")
    assert f"multiples of {step:g} s, rounded" in note.found


def test_stamps_with_their_digits_stay_as_they_are():
    """Oracle: identity; milliseconds cost a centimetre at most and are no rounding that counts."""
    for time in (TIME, np.round(TIME, 3), np.round(TIME[:7], 0)):
        own = events(time)
        assert with_stamp_rounding(own) is own
    assert stamp_step(np.round(TIME, 1)) == 0.1


def test_eight_stamps_and_two_changes_by_a_step_show_a_rounding():
    """Oracle: counts by hand: seven stamps show none; one interval a step longer is a trigger's."""
    assert stamp_step(np.round(TIME[:8], 1)) == 0.1
    for changes, rounded in ((1, False), (2, True)):
        interval = np.full(20, 2.0)
        interval[5 : 5 + changes] += 1.0
        got = with_stamp_rounding(events(100.0 + np.cumsum(interval)))
        assert (got.sigma_s is not None) == rounded


def test_an_intervalometer_is_asked_about_and_not_doubted():
    """Oracle: intervals of 2 s, two lines: nobody can tell, so nothing is added."""
    time = np.concatenate([np.arange(100.0, 160.0, 2.0), np.arange(190.0, 250.0, 2.0)])
    asked = with_stamp_rounding(events(time))
    assert asked.sigma_s is None
    assert "taken as exact" in asked.notes[0].found


def test_what_the_file_says_of_its_stamps_counts():
    """Oracle: identity."""
    own = CameraEvents(
        tuple(f"{k}" for k in range(TIME.size)),
        np.round(TIME),
        sigma_s=np.full(TIME.size, 0.29),
    )
    assert with_stamp_rounding(own) is own
