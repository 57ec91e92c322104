"""Heights above the geoid are not taken for heights above the ellipsoid where the file says so.

Oracle throughout: the meaning of the words, and an addition.
"""

from pathlib import Path

import numpy as np
import pytest

from insgnss.base.errors import InputError
from insgnss.io.formats import read_gnss

ROWS = "200000.0 46.57 6.54 630.0 0.02 0.02 0.03\n200000.1 46.57 6.54 630.0 0.02 0.02 0.03\n"
COLUMNS = ["tow", "lat", "lon", "h", "sd_n", "sd_e", "sd_u"]


def table(folder: Path, name: str, comment: str = "") -> Path:
    path = folder / "fixes.txt"
    path.write_text(f"{comment}tow lat lon {name} sd_n sd_e sd_u\n{ROWS}", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    "name", ["alt_msl", "hMSL", "height_amsl[m]", "orthometric_height", "h_orth", "EGM96"]
)
def test_a_column_above_the_geoid_asks_for_the_geoids_height(tmp_path: Path, name: str) -> None:
    path = table(tmp_path, name)
    columns = dict(zip(COLUMNS, ["tow", "lat", "lon", name, "sd_n", "sd_e", "sd_u"], strict=True))
    with pytest.raises(InputError, match=r":1: heights .* above the geoid.*gnss\.undulation_m"):
        read_gnss(path, columns=columns)
    assert read_gnss(path, columns=columns, undulation_m=49.5).height.tolist() == [679.5] * 2


@pytest.mark.parametrize(
    ("comment", "refused"),
    [
        ("# heights: orthometric (EGM2008)\n", True),
        ("# h above mean sea level\n", True),
        ("# heights above the ellipsoid, not above the geoid\n", False),
        ("# antenna positions\n", False),
    ],
)
def test_a_comment_before_the_table_is_believed(
    tmp_path: Path, comment: str, refused: bool
) -> None:
    path = table(tmp_path, "h", comment)
    if refused:
        with pytest.raises(InputError, match=r":1: heights are above the geoid.*undulation_m"):
            read_gnss(path)
        assert read_gnss(path, undulation_m=0.0).height[0] == 630.0
    assert read_gnss(path, undulation_m=49.5).height[0] == 679.5
    assert refused or not read_gnss(path).notes


@pytest.mark.parametrize(("name", "noted"), [("altitude", True), ("alt", True), ("height", False)])
def test_a_name_for_both_is_noted_until_it_is_settled(
    tmp_path: Path, name: str, noted: bool
) -> None:
    path = table(tmp_path, name)
    fixes = read_gnss(path)
    assert [note.name for note in fixes.notes] == ["GNSS position"] * noted
    assert not read_gnss(path, undulation_m=0.0).notes


def test_heights_above_the_ellipsoid_take_no_geoid(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"h_ell.*remove gnss\.undulation_m = 49\.5"):
        read_gnss(table(tmp_path, "h_ell"), undulation_m=49.5)
    # a field's name in a file of arrays
    arrays = {name: np.ones(3) for name in COLUMNS} | {"tow": np.arange(3.0)}
    np.savez(tmp_path / "a.npz", alt_msl=np.ones(3), **arrays)
    columns = {name: name for name in COLUMNS} | {"h": "alt_msl"}
    with pytest.raises(InputError, match="above the geoid"):
        read_gnss(tmp_path / "a.npz", columns=columns)


def test_headers_of_pos_files_and_the_geoid_of_the_caller(tmp_path: Path) -> None:
    names = "%  GPST latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m) sdne(m)"
    row = "2008 200000.000 46.57 6.54 630.0 1 9 0.02 0.02 0.03 0.0 0.0 0.0 0.0 9.0\n"
    head = f"% (lat/lon/height=WGS84/ellipsoidal)\n{names} sdeu(m) sdun(m) age(s) ratio\n"
    path = tmp_path / "x.pos"
    path.write_text(head + row, encoding="utf-8")
    with pytest.raises(InputError, match=r"by the header.*remove gnss\.undulation_m = 49\.5"):
        read_gnss(path, undulation_m=49.5)
    path.write_text(row, encoding="utf-8")  # without a header nothing says above what they are
    assert read_gnss(path).height[0] == 630.0
    assert read_gnss(path, undulation_m=49.5).height[0] == 679.5
