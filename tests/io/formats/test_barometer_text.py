"""Heights of a barometer in text files."""

from pathlib import Path

import pytest

from insgnss.base.errors import InputError, UsageError
from insgnss.io.formats import read_barometer


def written(tmp_path: Path, text: str) -> Path:
    """A file of the text."""
    path = tmp_path / "barometer.txt"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("text", "height"),
    [
        ("100.0 512.5\n101.0 513.0\n", 512.5),
        ("tow, alt\n100.0, 512.5\n101.0, 513.0\n", 512.5),
        ("tow altitude_cm\n100.0 51250\n101.0 51300\n", 512.5),
        ("tow,pressure [hPa]\n100.0,898.746\n101.0,898.7\n", 1000.0),
        ("tow,temp,press_Pa,alt\n100.0,20,89874.6,3\n101.0,20,89870,4\n", 1000.0),
    ],
)
def test_heights_and_pressures(tmp_path: Path, text: str, height: float) -> None:
    """Oracle: the numbers of the file, and ISO 2533's 89874.6 Pa at 1000 m."""
    heights = read_barometer(written(tmp_path, text), gps_week=2008)
    assert heights.time.tolist() == [100.0, 101.0]
    assert heights.height[0] == pytest.approx(height, abs=0.05)
    assert heights.gps_week == 2008


def test_columns_and_units_that_the_file_does_not_give(tmp_path: Path) -> None:
    """Oracle: the same values in Pa and s."""
    path = written(tmp_path, "1000 5 898.746\n2000 5 898.7\n")
    columns, units = ["tow", "-", "pressure"], {"pressure": "hPa", "time": "ms"}
    heights = read_barometer(path, columns=columns, units=units)
    assert heights.time.tolist() == [1.0, 2.0]
    assert heights.height[0] == pytest.approx(1000.0, abs=0.05)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("tow pressure\n100.0 898.7\n", ":2: pressure 898.7 Pa .* units = { pressure = ... }"),
        ("tow h\n100.0 512\n101.0 51200\n", ":3: h 51200 m .* between -2000 and 11000 m"),
        ("tow temperature\n100.0 20\n", "no column h or pressure"),
        ("height\n512\n", "does not name tow"),
        ("100.0 512.5\n101.0 nan\n", ":2: "),
        ("", "empty|no data"),
    ],
)
def test_what_cannot_be_is_refused_with_its_line(tmp_path: Path, text: str, message: str) -> None:
    """Oracle: the line of the file, by eye."""
    with pytest.raises(InputError, match=message):
        read_barometer(written(tmp_path, text))


def test_options_that_a_log_does_not_have(tmp_path: Path) -> None:
    """Oracle: the table of options."""
    path = tmp_path / "x.bin"
    path.write_bytes(b"\xa3\x95\x80")
    with pytest.raises(UsageError, match="ardupilot, which takes no columns"):
        read_barometer(path, columns=["tow", "h"])
