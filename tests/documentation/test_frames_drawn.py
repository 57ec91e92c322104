"""Drawings of frames and lever arms show what the package computes, and what the page says."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
FORWARD, RIGHT, DOWN = np.eye(3)


@pytest.fixture(scope="module")
def drawing():
    sys.path.insert(0, str(ROOT / "scripts"))
    try:
        import draw_frames
    finally:
        sys.path.pop(0)
    return draw_frames


def test_camera_axes_point_where_the_page_says(drawing):
    """Oracle: words of docs/frames.md: image top to the right wing; image top forward."""
    default = drawing.directions(drawing.TOP_TO_RIGHT_WING)
    np.testing.assert_allclose(-default["y"], RIGHT)
    np.testing.assert_allclose(default["x"], -FORWARD)
    np.testing.assert_allclose(default["z"], DOWN)
    forward = drawing.directions(drawing.TOP_FORWARD)
    np.testing.assert_allclose(-forward["y"], FORWARD)
    np.testing.assert_allclose(forward["x"], RIGHT)


@pytest.mark.parametrize(
    ("nose", "direction"),
    [("Down", "y"), ("Right", "x")],
)
def test_mounts_that_the_page_lists_have_the_nose_where_it_says(drawing, nose, direction):
    """Oracle: the axes of the image: x to its right, y down."""
    text = (ROOT / "docs" / "frames.md").read_text(encoding="utf-8")
    rows = re.search(rf"\*{nose}\*: `\[\[(.*?)\]\]`", text)[1].split("], [")
    matrix = [[float(x) for x in row.split(",")] for row in rows]
    np.testing.assert_allclose(drawing.directions(matrix)[direction], FORWARD)


def test_lever_arms_are_on_the_side_that_the_numbers_say(drawing):
    """Oracle: by hand: +x of the camera is backward, +y left, +z down, so -z is above."""
    place = drawing.levers()
    np.testing.assert_allclose(place["antenna"], [-0.462, 0.001, -0.065], atol=1e-12)
    np.testing.assert_allclose(place["IMU"], [-0.113, -0.020, 0.0], atol=1e-12)
    np.testing.assert_allclose(place["antenna"] - place["IMU"], [-0.349, 0.021, -0.065], atol=1e-12)


def test_positive_angles_turn_as_the_page_says(drawing):
    """Oracle: words: right wing down, nose up, over east; R of the two angle sets by hand."""
    turn = drawing.turns()
    assert turn["roll"][2] > 0.4  # down
    assert turn["pitch"][2] < -0.4  # the nose is up
    assert turn["yaw"][1] > 0.4  # east
    assert turn["omega"][2] > 0.4  # the image top rises
    assert turn["phi"][2] < -0.4  # the image's right side falls
    assert turn["kappa"][1] > 0.4  # counterclockwise from above
    assert turn["Metashape yaw"][0] > 0.4  # clockwise from above
    assert turn["Metashape pitch"][2] > 0.4
    assert turn["Metashape roll"][2] < -0.4


def test_drawings_that_are_kept_are_those_of_the_script(drawing):
    """Oracle: the listing of docs/images."""
    kept = {path.stem for path in (ROOT / "docs" / "images").glob("frames_*.svg")}
    assert kept == set(drawing.DRAWINGS)
