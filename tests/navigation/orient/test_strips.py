"""Which images stand together in one covariance."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from insgnss.navigation.orient import strips
from insgnss.navigation.orient.frame import in_frame
from insgnss.navigation.orient.relative import line_pairs
from insgnss.navigation.orient.strips import strip_rows
from insgnss.records import ExteriorOrientation

NADIR = np.diag([1.0, -1.0, -1.0])


def flown(course_deg: np.ndarray, time: np.ndarray | None = None) -> ExteriorOrientation:
    """Images 30 m apart, each in the direction of its course, looking down with the top there."""
    n = course_deg.size
    course = np.radians(course_deg)
    step = 30.0 * np.column_stack([np.sin(course), np.cos(course), np.zeros(n)])
    C = Rotation.from_rotvec(np.outer(-course, [0.0, 0.0, 1.0])).as_matrix() @ NADIR
    cov = np.tile(np.eye(6), (n, 1, 1))
    return ExteriorOrientation(
        images=tuple(f"{k}.tif" for k in range(n)),
        time=2.0 * np.arange(n) if time is None else time,
        gps_week=2008,
        origin=np.array([0.81, 0.11, 500.0]),
        position_m=np.cumsum(step, axis=0) + [0.0, 0.0, 120.0],
        C_mc=C,
        cov=cov,
        cross=0.5 * cov[1:],
        boresight=np.eye(3),
        camera_from_body=np.eye(3),
    )


LINES = np.concatenate([np.zeros(12), [60.0, 120.0], np.full(12, 180.0), [120.0], np.zeros(12)])
ONE = np.zeros(LINES.size, dtype=np.int64)


def listed(found: tuple[np.ndarray, ...]) -> list[tuple[int, int]]:
    return [(int(rows[0]), int(rows[-1])) for rows in found]


def test_strips_are_the_lines_of_relative_control() -> None:
    """Oracle: three lines by construction, and the pairs of relative control, both images of which
    are in one strip; images in the turns are in none.
    """
    eo = flown(LINES)
    found = strip_rows(eo, ONE)
    assert [rows.size for rows in found] == [12, 12, 12]
    framed = in_frame(eo, "tangent plane")
    first, line = line_pairs(framed.time, framed.coordinates, framed.C_fE[:, :, 2], framed.C_fc)
    for k, rows in enumerate(found, 1):
        assert (np.diff(rows) == 1).all()
        np.testing.assert_array_equal(first[line == k], rows[:-1])


def test_no_strip_holds_images_of_two_segments_or_too_many(monkeypatch) -> None:
    """Oracle: counts by hand."""
    eo = flown(LINES)
    in_two = np.array([0] * 5 + [1] * (LINES.size - 5))
    assert listed(strip_rows(eo, in_two))[:2] == [(0, 4), (5, 11)]
    pieces = strip_rows(eo, ONE, largest=5)
    assert [rows.size for rows in pieces] == [4] * 9
    monkeypatch.setattr(strips, "LARGEST_BYTES", 6 * 288 * LINES.size)
    assert max(rows.size for rows in strip_rows(eo, ONE)) == 6


def test_a_way_without_lines_is_taken_in_pieces() -> None:
    """Oracle: a bend of 30 deg an image, all of which are of one piece, and of two where there is a
    gap; a single image has no neighbour.
    """
    bend = flown(np.arange(20) * 30.0)
    none = np.zeros(20, dtype=np.int64)
    assert listed(strip_rows(bend, none)) == [(0, 19)]
    assert listed(strip_rows(bend, none, largest=10)) == [(0, 9), (10, 19)]
    assert listed(strip_rows(bend, np.array([0] * 19 + [1]))) == [(0, 18)]
    assert strip_rows(bend[:1], none[:1]) == ()
    slow = replace(flown(np.zeros(8)), time=20.0 * np.arange(8))  # no pair within 10 s
    assert listed(strip_rows(slow, np.zeros(8, dtype=np.int64))) == [(0, 7)]


def apart(images: list[int]) -> ExteriorOrientation:
    """Images straight on, so many 2 s apart and then a gap of 20 s, again and again."""
    step = np.concatenate([[20.0] + [2.0] * (count - 1) for count in images])
    return flown(np.zeros(step.size), time=np.cumsum(step))


def test_three_images_make_a_line_and_two_do_not() -> None:
    """Oracle: by hand: lines of three as such, pairs as one way; lines count where they hold half
    of the images, and not where they hold less.
    """
    none = np.zeros(13, dtype=np.int64)
    assert listed(strip_rows(apart([3] * 3), none[:9])) == [(0, 2), (3, 5), (6, 8)]
    assert listed(strip_rows(apart([2] * 4), none[:8])) == [(0, 7)]
    assert listed(strip_rows(apart([3, 3, *[1] * 6]), none[:12])) == [(0, 2), (3, 5)]
    assert listed(strip_rows(apart([3, 3, *[1] * 7]), none)) == [(0, 12)]


def test_an_image_where_two_lines_meet_belongs_to_the_first() -> None:
    """Oracle: by hand: six images north and six east of a camera that keeps its heading; the sixth
    ends the first line and begins the second, and stands in one strip.
    """
    corner = flown(np.array([0.0] * 6 + [90.0] * 6))
    corner = replace(corner, C_mc=np.tile(NADIR, (12, 1, 1)))
    framed = in_frame(corner, "tangent plane")
    first, line = line_pairs(framed.time, framed.coordinates, framed.C_fE[:, :, 2], framed.C_fc)
    assert (line[first == 4], line[first == 5]) == (1, 2)
    assert listed(strip_rows(corner, np.zeros(12, dtype=np.int64))) == [(0, 5), (6, 11)]


def test_half_of_the_images_in_lines_make_strips_of_lines() -> None:
    """Oracle: counts by hand: a line of 12 images beside 10 or 14 in bends of 30 deg."""
    for bends, found in ((10, [(0, 11)]), (14, [(0, 25)])):
        eo = flown(np.concatenate([np.zeros(12), 30.0 * np.arange(1, bends + 1)]))
        assert listed(strip_rows(eo, np.zeros(len(eo), dtype=np.int64))) == found


def test_strips_are_of_400_images_and_256_megabytes_at_most() -> None:
    """Oracle: 288 bytes of a pair of images; 500 images are two strips, and of 2500 images one of
    355 is the largest that leaves 256 MB for all.
    """
    for n, pieces in ((400, 1), (401, 2), (2500, 8)):
        found = strip_rows(flown(np.zeros(n)), np.zeros(n, dtype=np.int64))
        assert len(found) == pieces
        assert sum(288 * rows.size**2 for rows in found) <= 256e6


@pytest.mark.parametrize(
    ("turn_deg", "gap_s", "lines"),
    [(19.0, 2.0, 1), (21.0, 2.0, 2), (0.0, 9.9, 1), (0.0, 10.1, 2)],
)
def test_a_line_ends_at_a_turn_of_20_deg_or_a_gap_of_10_s(turn_deg, gap_s, lines) -> None:
    """Oracle: a turn and a gap in the middle of twelve images."""
    later = np.arange(12) >= 6
    time = 2.0 * np.arange(12) + later * (gap_s - 2.0)
    eo = flown(turn_deg * later, time)
    framed = in_frame(eo, "tangent plane")
    _, line = line_pairs(framed.time, framed.coordinates, framed.C_fE[:, :, 2], framed.C_fc)
    assert line.max() == lines
