"""Numbers of images against their times: a shifted table is seen, a real one left alone."""

import numpy as np
import pytest

from insgnss.io.exposures.numbering import image_numbers, with_numbering_note
from insgnss.records import CameraEvents

RNG = np.random.default_rng(11)
INTERVALS = 2.6 * (1.0 + 0.15 * RNG.uniform(-1.0, 1.0, 39))
INTERVALS[[12, 26]] += [31.0, 24.0]  # turns between lines
TIME = 205340.0 + np.concatenate([[0.0], np.cumsum(INTERVALS)])
NAMES = [f"DSC{k:05d}.JPG" for k in range(801, 841)]


def notes(names, time):
    return with_numbering_note(CameraEvents(tuple(names), time)).notes


def test_a_table_that_lost_a_name_here_and_a_stamp_there_is_seen():
    """Oracle: the name and the stamp that were taken out by hand; ten images have a wrong one."""
    (note,) = notes(np.delete(NAMES, 5), np.delete(TIME, 15))
    assert (note.name, note.verdict) == ("images", "note")
    assert "DSC00805.JPG and DSC00807.JPG" in note.found
    assert note.found.count(" apart") == 1


@pytest.mark.parametrize("gone", [[], [7], [5, 6, 7], [15, 17, 19, 21, 23], [12, 13], [0, 39]])
def test_images_that_were_deleted_with_their_stamps_are_left_alone(gone):
    """Oracle: rows taken out whole, within a line, every other one, in a turn and at the ends."""
    names, time = np.delete(NAMES, gone), np.delete(TIME, gone)
    own = CameraEvents(tuple(names), time)
    assert with_numbering_note(own) is own


def test_a_number_that_was_counted_in_a_turn_is_left_alone():
    """Oracle: an image on the ground or in a turn, whose row is gone; there is time for it."""
    names = [*NAMES[:13], *(f"DSC{k:05d}.JPG" for k in range(815, 842))]
    assert notes(names, TIME) == ()


def test_names_that_do_not_count_say_nothing():
    """Oracle: by hand; dates and a constant band behind the counter are told from it."""
    assert image_numbers(tuple(NAMES[:7])) is None
    assert image_numbers(tuple(f"{k}.tif" for k in range(800, 880, 2))) is None
    assert image_numbers((*NAMES[:9], "other.JPG")) is None
    assert image_numbers(tuple(reversed(NAMES))) is None
    dated = [f"2018-07-01_{k:04d}_3.tif" for k in range(9, 20)]
    np.testing.assert_array_equal(image_numbers(tuple(dated)), range(9, 20))
