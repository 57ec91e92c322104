"""The drawing of the mounting in the drafted flight file and on the page of an inspection."""

import re
import tomllib
import xml.etree.ElementTree as ET
from pathlib import Path

from insgnss.flight.inspection.draft import Draft
from insgnss.flight.inspection.mounting_drawing import (
    camera_axes,
    drawn_as_svg,
    drawn_in_letters,
    in_words,
)

PAPER = [[-1, 0, 0], [0, -1, 0], [0, 0, 1]]
USUAL = [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]  # image right is right, its top is forward


def test_axes_are_where_the_matrix_has_them():
    """Oracle: rows of the matrix, by hand."""
    assert camera_axes(PAPER) == {
        "x, image right": "backward",
        "y, image down": "left",
        "z, view": "down",
    }
    assert camera_axes(USUAL)["y, image down"] == "backward"
    lines = drawn_in_letters(USUAL, [0, 0, 0], [0, 0, 0])
    assert any(re.search(r"C---->\s+\[x, image right\]", line) for line in lines)
    assert any(re.search(r"backward\s+\[y, image down\]", line) for line in lines)
    assert "[z, view] points down." in lines


def test_lever_arms_in_words():
    """Oracle: Table 1 of paper 000: the antenna of that drone, 462 mm image right, is behind."""
    assert in_words(PAPER, [0.462, -0.001, -0.065]) == (
        "0.462 m backward, 0.001 m right, 0.065 m up of the camera"
    )
    assert in_words(PAPER, [0, 0, 0]).startswith("at the camera, as no value is given")


def test_the_picture_has_the_antenna_where_it_is():
    """Oracle: an antenna 0.2 m above the camera: at the centre from above, higher from the side."""
    root = ET.fromstring(drawn_as_svg(USUAL, [0.0, 0.0, -0.2], [0.0, 0.0, 0.0]))
    spots = [c.attrib for c in root.iter() if c.tag.endswith("circle") and c.attrib["r"] == "5"]
    above, imu_above, side, imu_side = spots
    assert (above["cx"], above["cy"]) == (imu_above["cx"], imu_above["cy"])
    assert side["cx"] == imu_side["cx"]
    assert float(side["cy"]) < float(imu_side["cy"]) - 50.0


def test_the_draft_stays_a_toml_file():
    """Oracle: TOML's own reader."""
    draft = Draft()
    lines = drawn_in_letters(PAPER, [0, 0, 0], [0, 0, 0])
    draft.add("mounting", "antenna_m", [0.0, 0.0, 0.0], "measure it", drawing=lines)
    text = draft.text(Path("."))
    assert tomllib.loads(text) == {"mounting": {"antenna_m": [0.0, 0.0, 0.0]}}
    assert "#                     forward" in text
    assert draft.value("mounting", "antenna_m") == [0.0, 0.0, 0.0]
