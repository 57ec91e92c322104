"""Exports into a CRS that counts in feet: positions and their standard deviations in its unit."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from insgnss.base.errors import UsageError
from insgnss.flight.exporting.export import ExportFrame, export
from insgnss.flight.proof.scene import make_scene
from insgnss.io.formats.exports import EXPORTS
from insgnss.io.formats.orientation.eo_json import write_eo_json
from insgnss.io.formats.orientation.generic_ascii import read_generic_ascii
from insgnss.photogrammetry.comparison.compare import compare_files
from insgnss.photogrammetry.comparison.reading import read_poses
from insgnss.records import ExteriorOrientation

FEET, METRES, US_FOOT_M, FOOT_M = "EPSG:6539", "EPSG:6538", 1200.0 / 3937.0, 0.3048
OPTIONS = {"inpho_prj": {"focal_mm": 35.0, "ground_m": 30.0}}
# how many numbers of an image are lengths in the CRS: coordinates, standard deviations
LENGTHS = {
    "metashape": 6,
    "metashape_opk": 6,
    "metashape_offset": 6,
    "pix4d_matic": 5,
    "pix4d_mapper": 3,
    "bentley": 3,
    "inpho_prj": 4,
    "inpho_ascii": 3,
    "generic_ascii": 6,
}


@pytest.fixture(scope="module")
def eo() -> ExteriorOrientation:
    """The scene of proofs, on Long Island, in the datum of the CRS."""
    origin = np.array([*np.radians([40.75, -73.4]), 20.0])
    return replace(make_scene().eo, origin=origin, datum="EPSG:6319", epoch=2010.0)


def numbers(path: Path) -> np.ndarray:
    """All numbers with decimals outside of comments."""
    text = re.sub(r"^#[^\n]*|<!--.*?-->", "", path.read_text(), flags=re.MULTILINE | re.DOTALL)
    return np.array([float(x) for x in re.findall(r"-?\d+\.\d{3,}", text)])


@pytest.mark.parametrize("name", LENGTHS)
def test_lengths_are_those_of_the_metric_sibling_in_feet(
    eo: ExteriorOrientation, tmp_path: Path, name: str
) -> None:
    """Oracle: the export in the sibling that counts in metres, and the foot by definition: so many
    numbers differ by it, all others not at all.
    """
    files = []
    for code in (FEET, METRES):
        path = tmp_path / f"{code[5:]}.{EXPORTS[name].product.rpartition('.')[2]}"
        files.append(export(eo, name, path, ExportFrame(code), **OPTIONS.get(name, {})).file)
    feet, metres = (numbers(path) for path in files)
    assert feet.shape == metres.shape
    same = np.abs(feet - metres) < 2e-6
    scaled = np.abs(feet * US_FOOT_M - metres) < 2e-4
    assert (same | scaled).all()
    assert int((~same).sum()) == LENGTHS[name] * len(eo.images)


@pytest.mark.parametrize("name", ["metashape", "pix4d_matic", "inpho_ascii", "generic_ascii"])
def test_what_is_in_feet_reads_back(eo: ExteriorOrientation, tmp_path: Path, name: str) -> None:
    """Oracle: the master, to the digits of the file; standard deviations in metres again."""
    write_eo_json(eo, tmp_path / "eo.json")
    done = export(eo, name, tmp_path / "x.txt", ExportFrame(FEET))
    assert "standard deviations are in US survey feet" in " ".join(done.notes)
    crs = FEET if name == "pix4d_matic" else None
    c = compare_files(tmp_path / "eo.json", done.file, form_b=name, crs=crs)
    assert c.findings == ()
    assert max(float(np.abs(x.difference).max()) for x in c.components[:3]) < 1e-4
    b = read_poses(done.file, name)
    if b.cov_position is not None:
        a = read_poses(tmp_path / "eo.json")
        assert a.cov_position is not None
        ratio = np.diagonal(b.cov_position, 0, 1, 2) / np.diagonal(a.cov_position, 0, 1, 2)
        assert np.abs(ratio - 1.0).max() < 0.05


def test_formats_of_metres_name_the_metric_sibling(eo: ExteriorOrientation, tmp_path: Path) -> None:
    """Oracle: the registry of CRSs."""
    for name in ("colmap", "g2o", "tum", "opf", "odm"):
        with pytest.raises(UsageError, match=r"counts in US survey feet.*sibling, EPSG:6538"):
            export(eo, name, tmp_path / "x", ExportFrame(FEET))
    with pytest.raises(UsageError, match="geojson of orthority takes metres"):
        export(eo, "geojson", tmp_path / "x", ExportFrame(FEET), dialect="orthority")
    assert not (tmp_path / "x").exists()


@pytest.mark.parametrize(
    ("unit", "metres", "target"),
    [
        ("us-ft", US_FOOT_M, ExportFrame()),
        ("ft", FOOT_M, ExportFrame(METRES)),
        ("m", 1.0, ExportFrame(FEET)),
        ("us-ft", US_FOOT_M, ExportFrame(frame="geographic")),
    ],
)
def test_a_table_in_any_unit_of_lengths(
    eo: ExteriorOrientation, tmp_path: Path, unit: str, metres: float, target: ExportFrame
) -> None:
    """Oracle: the same table in metres, and the foot by definition; the header says the unit, and
    the table reads back in metres.
    """
    columns = "image xyz llh s_xyz s_plan opk"
    same = ExportFrame(METRES) if target.crs else target
    for file, frame, options in (("m", same, {}), ("x", target, {"length_unit": unit})):
        export(eo, "generic_ascii", tmp_path / file, frame, columns=columns, **options)
    rows = [
        np.array(
            [
                line.split()[1:]
                for line in (tmp_path / file).read_text().splitlines()
                if line[0] != "#"
            ],
            dtype=float,
        )
        for file in ("m", "x")
    ]
    scale = np.array([metres] * 3 + [1.0, 1.0, metres] + [metres] * 5 + [1.0] * 3)
    if target.frame == "geographic":
        scale[:2] = 1.0
    assert np.abs(rows[1] * scale - rows[0]).max() < 1e-4
    head = (tmp_path / "x").read_text()
    assert ("length units: plan US survey foot = 0.3048006096012192" in head) is (unit == "us-ft")
    back, first = read_generic_ascii(tmp_path / "x"), read_generic_ascii(tmp_path / "m")
    for name in ("x", "z", "h", "sx", "s_vertical"):
        assert np.abs(back.columns[name] - first.columns[name]).max() < 1e-4
    with pytest.raises(UsageError, match="length_unit 'yd' is unknown; it is one of m, ft, us-ft"):
        export(eo, "generic_ascii", tmp_path / "y", target, length_unit="yd")
