"""The pages of formats that are written only: their examples are what the writers write."""

import re
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from ba_scene import worked

from insgnss.base.errors import InputError
from insgnss.io.formats.orientation.generic_ascii import read_generic_ascii

SPECS = Path(__file__).parents[3] / "data_specs"
PRJ = {"focal_mm": 20.2, "ground_m": 510.0}
EXAMPLES: list[
    tuple[str, str, str, str, dict[str, Any], str]
] = [  # page, example, writer, frame, options, file
    ("metashape", "projected", "bundle.metashape:write_metashape", "EPSG:2056", {}, "x.txt"),
    ("metashape", "opk", "bundle.metashape:write_metashape_opk", "EPSG:2056", {}, "x.txt"),
    ("metashape", "offset", "bundle.metashape:write_metashape_offset", "geographic", {}, "x.txt"),
    (
        "metashape",
        "offset_text",
        "bundle.metashape:write_metashape_offset",
        "geographic",
        {},
        "x_gps_ins_offset.txt",
    ),
    ("pix4d", "true", "bundle.pix4d:write_pix4d_matic", "geographic", {}, "x.txt"),
    ("pix4d", "mapper", "bundle.pix4d:write_pix4d_mapper", "EPSG:2056", {}, "x.txt"),
    ("odm", "true", "bundle.odm:write_odm_geo", "geographic", {}, "x.txt"),
    ("opensfm", "true", "bundle.opensfm:write_opensfm", "tangent plane", {}, "x.txt"),
    (
        "opensfm",
        "reference",
        "bundle.opensfm:write_opensfm",
        "tangent plane",
        {},
        "reference_lla.json",
    ),
    ("micmac", "true", "bundle.micmac:write_micmac", "tangent plane", {}, "x.txt"),
    (
        "micmac",
        "xml",
        "bundle.micmac:write_micmac_xml",
        "tangent plane",
        {},
        "x.txt/Orientation-8001.tif.xml",
    ),
    (
        "realitycapture",
        "true",
        "bundle.realitycapture:write_realitycapture",
        "geographic",
        {},
        "x.txt",
    ),
    (
        "realitycapture",
        "accuracy",
        "bundle.realitycapture:write_realitycapture_accuracy",
        "geographic",
        {},
        "x.txt",
    ),
    ("bentley", "true", "bundle.bentley:write_bentley", "EPSG:2056", {}, "x.txt"),
    ("inpho", "true", "bundle.inpho:write_inpho_prj", "EPSG:2056", PRJ, "x.txt"),
    ("inpho", "ascii", "bundle.inpho:write_inpho_ascii", "EPSG:2056", {}, "x.txt"),
    (
        "generic_ascii",
        "true",
        "orientation.generic_ascii:write_generic_ascii",
        "EPSG:2056",
        {},
        "x.txt",
    ),
]


def example(page: str, kind: str) -> str:
    found = re.search(rf"```{kind}\n(.*?)```", (SPECS / f"{page}.md").read_text(), re.DOTALL)
    assert found is not None, f"{page}.md has no {kind} example"
    return found[1]


def lasting(text: str) -> str:
    """All but the version."""
    return re.sub(r"insgnss \d\S*:", "insgnss:", text).strip()


@pytest.mark.parametrize(("page", "kind", "writer", "where", "options", "file"), EXAMPLES)
def test_the_example_is_what_is_written(
    page: str,
    kind: str,
    writer: str,
    where: str,
    options: dict[str, Any],
    file: str,
    tmp_path: Path,
) -> None:
    """Oracle: the page, for the worked example of formats.md 0.2."""
    module, _, name = writer.partition(":")
    getattr(import_module(f"insgnss.io.formats.{module}"), name)(
        worked(where), tmp_path / "x.txt", **options
    )
    assert lasting((tmp_path / file).read_text()) == lasting(example(page, kind))


def test_a_bad_line_of_a_table_is_refused_as_printed(tmp_path: Path) -> None:
    """Oracle: the page of generic_ascii."""
    path = tmp_path / "table.txt"
    path.write_text(example("generic_ascii", "true"))
    assert read_generic_ascii(path).images == ("8001.tif",)
    path.write_text(example("generic_ascii", "true") + example("generic_ascii", "bad"))
    with pytest.raises(InputError) as refusal:
        read_generic_ascii(path)
    assert example("generic_ascii", "message").strip() in str(refusal.value)
