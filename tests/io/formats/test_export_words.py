"""What exports say in their headers and refusals."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ba_scene import ORIGIN, block, exterior, framed, worked

from insgnss.base.errors import DataError, InputError, UsageError
from insgnss.geodesy.projection import MapProjection
from insgnss.io.formats import EXPORTS
from insgnss.io.formats.bundle.bentley import on_ellipsoid, write_bentley
from insgnss.io.formats.bundle.metashape import write_metashape
from insgnss.io.formats.bundle.micmac import write_micmac_xml
from insgnss.io.formats.exports import PROJECTED
from insgnss.io.formats.orientation.exported import check_names
from insgnss.navigation.orient.frame import in_frame

CAMERA = "PINHOLE 5120 3840 5607 5607 2560 1920"
OPTIONS: dict[str, dict[str, Any]] = {
    "colmap": {"camera": CAMERA},
    "inpho_prj": {"focal_mm": 20.0, "ground_m": 500.0},
    "kml": {"undulation_m": 49.6},
}
ELSEWHERE = {
    "inpho_prj": "no comments",
    "pix4d_mapper": "no header",
    "opf": "refuses scaled heights",
    "image_tags": "needs images; positions in WGS84",
    "relative": "takes relative control",
    "colmap_priors": "a database",
    "geopackage": "in the description of the CRS",
    "rtklib_pos": "positions in WGS84",
    "odm": "the program takes the first line for the CRS",
}


@pytest.mark.parametrize(
    "name",
    [name for name, form in EXPORTS.items() if PROJECTED in form.frames and name not in ELSEWHERE],
)
def test_scaled_heights_are_said(name: str, tmp_path: Path) -> None:
    """Oracle: the ground that was asked for, in the text or its header; nothing of it where nothing
    was scaled.
    """
    eo, projection = replace(block(), cross=np.zeros((2, 6, 6))), MapProjection("EPSG:2056")
    EXPORTS[name].write(
        in_frame(eo, PROJECTED, projection, 417.5), tmp_path / "a", **OPTIONS.get(name, {})
    )
    EXPORTS[name].write(
        in_frame(eo, PROJECTED, projection), tmp_path / "b", **OPTIONS.get(name, {})
    )
    scaled, plain = (_text(tmp_path / file) for file in "ab")
    assert "scaled from the ground at 417.50 m" in scaled
    assert "scaled" not in plain


def _text(path: Path) -> str:
    return (path / "images.txt" if path.is_dir() else path).read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("name", "separator", "says"),
    [
        ("", ",", "'' is empty,"),
        ("a b", None, "'a b' has a blank,"),
        ("#1.tif", None, "'#1.tif' begins with #,"),
        ("//1.tif", ",", "begins with //,"),
        ("a,b", ",", "has ',',"),
        (" a", ",", "' a' begins or ends with a blank,"),
        ("a\nb", ",", "has a line end,"),
    ],
)
def test_names_that_do_not_fit(name: str, separator: str | None, says: str) -> None:
    """Oracle: what is wrong with each, read by eye."""
    with pytest.raises(InputError) as refusal:
        check_names(["good.tif", name], separator)
    assert says in str(refusal.value)
    assert "\n" not in str(refusal.value)
    check_names(["good name.tif"], ",")


def test_a_singular_set_names_formats_without_angles(tmp_path: Path) -> None:
    """Oracle: a camera that looks along the horizon; the formats named do take it."""
    north = np.array(
        [[[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]]
    )  # image right to the east, down to the ground, view north
    eo = framed(exterior(north, np.array([[0.0, 0.0, 200.0]])), "tangent plane")
    for name in ("bentley", "colmap", "g2o"):
        EXPORTS[name].write(eo, tmp_path / name, **OPTIONS.get(name, {}))
        assert (tmp_path / name).exists()
    with pytest.raises(
        DataError, match="export a format without angles: bentley, colmap, g2o or eo_json"
    ):
        write_metashape(eo, tmp_path / "m.csv")


def test_bentley_names_the_frame_that_it_is_in(tmp_path: Path) -> None:
    """Oracle: the height of the origin, 412.5 m, and of the image, 630 m."""
    eo = worked("tangent plane")
    write_bentley(eo, tmp_path / "b.xml")
    text = (tmp_path / "b.xml").read_text()
    assert "412.5" not in text
    assert text.count("6.5400000000 deg, 0.0000 m (on the ellipsoid)") == 2
    assert "<z>630.0000</z>" in text
    assert on_ellipsoid(eo).frame.origin == (*ORIGIN[:2], 0.0)
    assert on_ellipsoid(worked("geographic")).frame == worked("geographic").frame


def test_orientations_of_other_images_stay(tmp_path: Path) -> None:
    """Oracle: the listing; fewer images into a directory of more."""
    eo = framed(block(3), "tangent plane")
    write_micmac_xml(eo, tmp_path / "Ori")
    few = framed(block(2), "tangent plane")
    with pytest.raises(
        UsageError, match=r"holds orientations of another export \(Orientation-8003\.tif\.xml\)"
    ):
        write_micmac_xml(few, tmp_path / "Ori")
    write_micmac_xml(replace(eo, history=()), tmp_path / "Ori")
    assert len(list((tmp_path / "Ori").iterdir())) == 3
