"""Exposures on the clock of a recording: their week, their digits, the span of the flight. Oracle
throughout: a calendar of round numbers.
"""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from insgnss.base.errors import InputError
from insgnss.io.exposures.instants import cut_events, on_clock, refuse_outside, within
from insgnss.io.exposures.rig import CameraExposures, ClockOffsets, rig_exposures
from insgnss.records import CameraEvents


def events(*time: float, week: int | None = None) -> CameraEvents:
    return CameraEvents(
        tuple(f"{i}.tif" for i in range(len(time))), np.array(time), week, "events.txt"
    )


def test_stamps_get_their_week_their_digits_and_their_numbers_in_one_stop():
    """Oracle: a week has 604 800 s; whole seconds and a number that lacks are noted, in order."""
    own = events(*np.cumsum([5.0, 2, 3, 2, 3, 2, 2, 3, 2, 3, 2]), week=2009)
    numbers = tuple(f"{k + (k > 5)}.tif" for k in range(11))
    own = CameraEvents(numbers, own.time, 2009, "events.txt")
    (camera,) = on_clock([CameraExposures("camera_1", own)], None, ClockOffsets(), 2008)
    assert camera.events.gps_week == 2008
    assert_array_equal(camera.events.time, own.time + 604800.0)
    assert camera.events.sigma_s == pytest.approx(np.full(11, 3.0**-0.5))
    assert [note.name for note in camera.events.notes] == ["exposure times", "images"]


def test_images_that_the_span_leaves_out_are_counted():
    """Oracle: two of four lie outside."""
    cameras = [CameraExposures("camera_1", events(9.0, 10.0, 20.0, 20.5))]
    (inside,), (note,) = within(cameras, 10.0, 20.0)
    assert inside.events.images == ("1.tif", "2.tif")
    assert note.found == "2 of 4 images lie outside of these times and get no orientation"
    assert within(cameras, None, None)[1] == []


def test_events_are_cut_where_the_flight_is():
    """Oracle: names and times of the middle two; no cut gives all of them back, a cut that leaves
    none is refused.
    """
    four = events(9.0, 10.0, 20.0, 20.5)
    cut = cut_events(four, 10.0, 20.0)
    assert cut.images == ("1.tif", "2.tif")
    assert_array_equal(cut.time, [10.0, 20.0])
    assert cut_events(four, None, None) is four
    assert cut_events(four, None, 9.0).images == ("0.tif",)
    with pytest.raises(InputError, match="no image between start_tow and end_tow"):
        cut_events(four, 11.0, 12.0)


def test_exposures_outside_are_named_and_counted():
    """Oracle: two of four lie outside; both ends belong to the flight."""
    refuse_outside(events(10.0, 15.0, 20.0), 10.0, 20.0)
    with pytest.raises(
        InputError,
        match=(
            r"events\.txt: image 0\.tif at 9\.000 s is outside the flight, 10\.000 to 20\.000 s .*2"
            r" of 4 images"
        ),
    ):
        refuse_outside(events(9.0, 10.0, 20.0, 20.5), 10.0, 20.0)


def test_exposures_after_a_counter_began_anew_are_told_with_its_range():
    """Oracle: micros of 32 bits, whose events all lie behind the wrap that the samples show."""
    lo, hi = 2.0**32 * 1e-6 - 100.0, 2.0**32 * 1e-6 + 260.0
    with pytest.raises(InputError, match=r"camera\.time_offset_s = 4294\.967296, which puts all"):
        refuse_outside(events(40.0, 41.0, 250.0), lo, hi)
    with pytest.raises(InputError, match="check the time scale"):
        refuse_outside(events(40.0, 41.0, 270.0), lo, hi)


def test_a_camera_without_exposures_is_refused():
    """Oracle: the message: what to leave out for a trajectory alone."""
    none = CameraEvents((), np.empty(0), 2008)
    with pytest.raises(InputError, match="no exposures; leave them out"):
        rig_exposures(None, "", none, None, None)
