"""Stamps of few digits: the standard deviation covers rounding and cutting off, exact ones keep
theirs.
"""

import numpy as np
import pytest

from insgnss.base.errors import InputError
from insgnss.io.exposures.instants import stamp_grid, with_stamp_rounding
from insgnss.io.formats.events.events import read_events
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
    assert stamp_grid(np.round(TIME, 1))[0] == pytest.approx(0.1)


def test_eight_stamps_and_two_changes_by_a_step_show_a_rounding():
    """Oracle: counts by hand: seven stamps show none; one interval a step longer is a trigger's."""
    assert stamp_grid(np.round(TIME[:8], 1))[0] == pytest.approx(0.1)
    for changes, rounded in ((1, False), (2, True)):
        interval = np.full(20, 2.0)
        interval[5 : 5 + changes] += 1.0
        got = with_stamp_rounding(events(100.0 + np.cumsum(interval)))
        assert (got.sigma_s is not None) == rounded


def lines(interval: np.ndarray) -> np.ndarray:
    """Stamps of lines of ten images, with turns of any length between them."""
    interval = interval.copy()
    interval[::10] = RNG.uniform(8.0, 20.0, interval[::10].size)
    return 205344.8 + np.cumsum(interval)


@pytest.mark.parametrize("step", [0.02, 0.05, 1 / 30, 1 / 60, 0.25])
@pytest.mark.parametrize("jitter", [0.0, 0.05])
def test_a_loop_that_stamps_exposures_is_found_by_its_grid(step, jitter):
    """Oracle: the instants before a loop read them, which begins anywhere; (S.1) by hand."""
    instants = lines(2.6 + 0.05 * RNG.standard_normal(60))
    begin = RNG.uniform(0.0, step)
    stamps = begin + step * (np.ceil((instants - begin) / step) + jitter * RNG.standard_normal(60))
    got = with_stamp_rounding(events(stamps))
    assert got.sigma_s == pytest.approx(step / 3.0**0.5, rel=1e-3)
    assert np.sqrt(np.mean(((stamps - instants) / got.sigma_s) ** 2)) < 1.2
    (note,) = got.notes
    assert f"{step:.4g} s" in note.found
    assert "m along the path" in note.found


def unsteady(interval: float, sigma: float) -> np.ndarray:
    """Stamps of an intervalometer whose lag varies."""
    return lines(np.full(60, interval)) + sigma * RNG.standard_normal(60)


TRIGGERS = {
    "intervalometer": lambda: lines(np.full(60, 2.0)),
    "intervalometer in milliseconds": lambda: np.round(lines(np.full(60, 2.0)), 3),
    "intervalometer set from 1.5 to 2 s": lambda: (
        0.123 + np.cumsum(np.repeat([1.5, 2.0], 30)) + 1e-4 * RNG.standard_normal(60)
    ),
    "intervalometer that misses images": lambda: (
        0.123 + np.cumsum(0.7 + 0.7 * (RNG.random(60) < 0.1))
    ),
    "lag of 1 ms": lambda: unsteady(2.0, 1e-3),
    "lag of 10 ms": lambda: unsteady(2.0, 1e-2),
    "interval that wanders": lambda: lines(2.0 + 0.01 * RNG.standard_normal(60)),
    "distance": lambda: np.round(lines(RNG.uniform(2.0, 3.0, 60)), 3),
}


@pytest.mark.parametrize("trigger", TRIGGERS)
def test_a_trigger_of_its_own_instants_is_no_grid(trigger):
    """Oracle: stamps that lost nothing, 20 flights of each trigger."""
    for _ in range(20):
        own = events(TRIGGERS[trigger]())
        assert with_stamp_rounding(own) is own


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


def test_a_table_states_how_well_its_stamps_are_known(tmp_path):
    """Oracle: the numbers written; a standard deviation of zero is refused with its line."""
    path = tmp_path / "events.csv"
    rows = [f"{k}.jpg,{time:.1f},0.0{1 + k % 2}" for k, time in enumerate(TIME[::-1])]
    path.write_text("\n".join(["image,tow,sigma_s", *rows[::-1]]) + "\n")
    read = read_events(path)
    assert read.sigma_s[:2] == pytest.approx([0.02, 0.01])
    assert with_stamp_rounding(read) is read
    path.write_text("image,tow,sigma_s\na.jpg,1.0,0.01\nb.jpg,2.0,0.0\n")
    with pytest.raises(InputError, match=r":3: sigma_s 0 s"):
        read_events(path)


@pytest.mark.parametrize(("step", "interval"), [(0.05, 2.617), (0.02, 2.6131), (0.2, 2.69)])
def test_few_changes_show_the_coarser_of_decimal_grids(step, interval):
    """Oracle: an intervalometer's exact stamps, of which a loop kept every step."""
    true = 205344.8123 + interval * np.arange(19)
    rounded = with_stamp_rounding(events(step * np.floor(true / step)))
    assert rounded.sigma_s is not None
    assert rounded.sigma_s[0] == pytest.approx(step / 3.0**0.5)
    assert np.sqrt(np.mean(((rounded.time - true) / rounded.sigma_s) ** 2)) < 1.2


def test_hundredths_are_seldom_taken_for_a_coarser_grid():
    """Oracle: chance; of 500 lists of 12 stamps a fiftieth at most is more than was lost."""
    draw = np.random.default_rng(11)
    steps = [
        stamp_grid(np.round(np.cumsum(2.6 + 0.02 * draw.standard_normal(12)), 2))[0]
        for _ in range(500)
    ]
    assert np.mean(np.array(steps) > 0.011) <= 0.02
