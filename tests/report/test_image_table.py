"""The table of images, its flags, and the fixes line by line."""

import base64
import dataclasses
from typing import Any

import numpy as np
import pytest

from insgnss.report.page import FLAGS, image_table, shortened
from insgnss.report.summary import fixes_of_lines

START = 205200.0


def _values(column: dict[str, Any]) -> np.ndarray:
    """What the page's script makes of a column."""
    steps = np.frombuffer(base64.b64decode(column["steps"]), dtype=f"<i{column['bytes']}")
    whole = np.cumsum(steps.astype(np.int64)) if column.get("differences") else steps
    return column.get("offset", 0.0) + whole * 10.0 ** -column["digits"]


def _flags(table: dict[str, Any], row: int) -> set[str]:
    bits = np.frombuffer(base64.b64decode(table["flags"]), dtype="<u2")[row]
    return {name for bit, name in enumerate(FLAGS) if bits >> bit & 1}


def test_columns_hold_the_orientation_to_the_digits_they_show(diagnostics, eo) -> None:
    """Oracle: the exterior orientation; half of the last printed digit."""
    d, images = diagnostics(), eo()
    columns = {column["key"]: column for column in image_table(d, images)["columns"]}
    np.testing.assert_allclose(_values(columns["time"]), images.time, atol=0.5001e-3)
    for k, key in enumerate(("east", "north", "up")):
        np.testing.assert_allclose(_values(columns[key]), images.position_m[:, k], atol=0.5001e-3)
    np.testing.assert_allclose(_values(columns["sigma N"]), 3.0)
    np.testing.assert_allclose(_values(columns["psi U"]), 0.02)
    assert columns["line"]["bytes"] == 1


@pytest.mark.parametrize(
    "names",
    [("8001.tif", "8002.tif", "8010.tif"), ("a", "b"), ("one.jpg",), ("same", "same"), ("x", "xx")],
)
def test_shortened_names_are_put_together_again(names: tuple[str, ...]) -> None:
    """Oracle: the names."""
    prefix, suffix, middle = shortened(names)
    assert tuple(prefix + name + suffix for name in middle) == names


def test_names_of_a_camera_lose_what_they_share() -> None:
    """Oracle: by hand."""
    assert shortened(("DJI_0001.JPG", "DJI_0024.JPG")) == ("DJI_00", ".JPG", ["01", "24"])


def test_images_are_flagged_where_they_should_be(block, eo) -> None:
    """Oracle: by hand; images 3 s apart on lines of 20 s with turns of 10 s between: no fix before
    2 s and after 100 s, none from 40 to 52 s, a bridged gap, one image of large sigmas.
    """
    time = START + 1.0 + 3.0 * np.arange(30)
    time[-1] = START + 105.0
    base = eo()
    cov = np.tile(np.diag(np.full(6, 1e-6)), (30, 1, 1))
    cov[5] *= 16.0
    images = dataclasses.replace(base, time=time, cov=cov)
    plain = block()
    t = plain.fix_time - START
    used = (t >= 2.0) & (t <= 100.0) & ~((t > 40.0) & (t < 52.0))
    d = block(used=used, gaps=((START + 12.9, 0.2),))
    table = image_table(d, images)
    beyond = "before the first or after the last fix"
    assert beyond in _flags(table, 0)
    assert beyond in _flags(table, 29)
    assert _flags(table, 4) == {"in a bridged gap of the IMU"}
    assert _flags(table, 5) == {
        *("largest position sigma", "largest attitude sigma"),
        *("position sigma over 3 times the median", "attitude sigma over 3 times the median"),
    }
    assert "outside the lines" in _flags(table, 8)
    inside = [k for k in range(30) if 40.0 < time[k] - START < 52.0]
    flagged = [k for k in range(1, 29) if "in an outage" in _flags(table, k)]
    assert flagged == inside
    assert flagged


def test_fixes_are_counted_and_described_line_by_line(block) -> None:
    """Oracle: by hand; every tenth fix of the second line rejected, its source float there, 9
    satellites in its middle, a mean innovation of 10 mm east on the third.
    """
    plain = block()
    t = plain.fix_time - START
    second, third = (t >= 32.0) & (t <= 48.0), (t > 58.0) & (t < 82.0)
    used = ~(second & (np.arange(t.size) % 10 == 0))
    innovation = np.zeros_like(plain.innovation)
    innovation[third, 1] = 0.01
    d = block(used=used, innovation=innovation)
    series = {
        "time": plain.fix_time,
        "kind": np.where(second, 2, 0),
        "satellites": np.where(np.abs(t - 40.0) < 0.55, 9.0, 14.0),
        "pdop": np.full(t.size, 1.6),
    }
    rows = fixes_of_lines(d, None, series)
    assert [row["line"] for row in rows] == [1, 2, 3, 4]
    assert [row["rejected"] for row in rows] == [0, int((~used).sum()), 0, 0]
    assert all(row["fixes"] == row["used"] + row["rejected"] for row in rows)
    assert rows[0]["fixed_share"] == 1.0
    assert rows[1]["float_share"] == pytest.approx(second.sum() / rows[1]["fixes"], abs=0.02)
    assert (rows[1]["satellites"], rows[1]["least_satellites"]) == (14.0, 9.0)
    assert (rows[2]["pdop"], rows[2]["largest_pdop"]) == (1.6, 1.6)
    assert rows[2]["innovation_mm"] == pytest.approx([0.0, 10.0, 0.0])
    bare = fixes_of_lines(d, None, None)[1]
    assert (bare["fixed_share"], bare["satellites"], bare["pdop"]) == (None, None, None)
