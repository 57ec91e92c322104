"""Lines of a flight: found where they were flown, and only there."""

import dataclasses

import numpy as np
import pytest

from insgnss.report.flightlines import HALF_S, flight_lines, line_figures

START = 205200.0


def test_lines_are_those_that_were_flown(block) -> None:
    """Oracle: exact motion; four lines of 20 s (the last of 30) at 10 m/s, courses 0 and 180 deg,
    half-circles of 10 s between them.
    """
    rows = line_figures(block(), None)
    assert [row["line"] for row in rows] == [1, 2, 3, 4]
    assert [row["start_s"] - START for row in rows] == pytest.approx([0, 30, 60, 90], abs=HALF_S)
    assert [row["end_s"] - START for row in rows] == pytest.approx([20, 50, 80, 120], abs=HALF_S)
    assert [row["length_m"] for row in rows] == pytest.approx(
        [200, 200, 200, 300], abs=2 * 10 * HALF_S
    )
    courses = np.radians([row["course_deg"] for row in rows])
    assert np.cos(courses) == pytest.approx([1, -1, 1, -1], abs=0.01)
    assert [row["turned_before_deg"] for row in rows] == pytest.approx(
        [0, 180, 360, 540], abs=18 * HALF_S
    )
    assert rows[3]["turned_after_deg"] == pytest.approx(0.0, abs=1e-9)


def test_a_circle_and_a_stand_have_no_line(diagnostics) -> None:
    """Oracle: definition; a circle flown in two minutes bends 45 deg in 15 s, and what stands is no
    line.
    """
    assert flight_lines(diagnostics(), None) == ()
    still = np.zeros((1200, 3))
    assert flight_lines(diagnostics(position=still, velocity=still), None) == ()


def test_a_step_of_time_ends_a_line(block) -> None:
    """Oracle: by hand; ten seconds without rows in the middle of the third line make two pieces of
    it, too short to be lines.
    """
    d = block()
    kept = (d.time < START + 65) | (d.time > START + 75)
    parts = {
        name: getattr(d, name)[kept]
        for name in ("time", "position", "velocity", "rpy", "smoothed_sigma", "filter_sigma")
    }
    assert (
        len(flight_lines(dataclasses.replace(d, **parts, event=np.zeros(0, dtype=np.int64)), None))
        == 3
    )


def test_with_images_the_lines_are_those_that_have_some(block, eo) -> None:
    """Oracle: by hand; images at 65 to 75 s only, all on the third line, whose sigmas are then
    those of the images, and not those of the trajectory below them.
    """
    d = block()
    cov = eo().cov.copy()
    cov[:, 5, 5] = np.radians(0.5) ** 2
    images = dataclasses.replace(eo(), cov=cov, time=START + 65.0 + np.arange(30) / 3.0)
    d = block(event=np.searchsorted(d.time, images.time - 1e-6))
    (row,) = line_figures(d, images)
    assert (row["images"], row["first_image"], row["last_image"]) == (30, "8001.tif", "8030.tif")
    assert row["start_s"] - START == pytest.approx(60, abs=HALF_S)
    assert row["heading_deg"] == pytest.approx(0.5)
    assert row["horizontal_mm"] == pytest.approx(np.hypot(3, 2))
