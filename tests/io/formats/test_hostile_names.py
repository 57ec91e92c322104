"""Names that a program would take for something else: formulas, control characters."""

import re
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from ba_scene import exterior, framed

from insgnss.base.errors import InputError
from insgnss.base.files import atomic_write
from insgnss.io.formats.bundle.metashape import write_metashape
from insgnss.io.formats.exports import EXPORTS
from insgnss.io.formats.orientation.exported import check_characters, check_names, xml_text
from insgnss.io.formats.returned.tables import read_metashape_reference
from insgnss.navigation.orient.relative import GyroFigures, relative_control

FORMULAS = ("=HYPERLINK(1)", "@SUM(A1)", "+A1", "-1+cmd|' /C calc'!A0", "=1", "-x.tif")
CONTROLS = ("a\x01b", "\x1fa", "a\x7f", "a\ud800", "a\uffff", "a\tb", "a\rb")
OPTIONS = {"focal_mm": 35.0, "ground_m": 500.0, "lever_m": "0.4,0,-0.1", "undulation_m": 50.0} | {
    "camera": "SIMPLE_PINHOLE 5120 3840 5607 2560 1920"
}


def nadir(names: tuple[str, ...]) -> object:
    count = len(names)
    down = np.diag([1.0, -1.0, -1.0])
    eo = exterior(np.tile(down, (count, 1, 1)), 10.0 * np.arange(3.0 * count).reshape(count, 3))
    return replace(eo, images=names, cross=np.zeros((count - 1, 6, 6)))


@pytest.mark.parametrize(
    "name",
    [name for name, form in EXPORTS.items() if form.product.endswith((".csv", "xml", "kml"))],
)
def test_no_product_has_a_formula_or_a_character_that_its_readers_refuse(
    name: str, tmp_path: Path
) -> None:
    """Oracle: csv and ElementTree of the standard library; a refusal names the way out."""
    form = EXPORTS[name]
    needs = (*form.needs, *(["undulation_m"] if form.heights == "sea level" else []))
    options = {key: OPTIONS[key] for key in needs if key in OPTIONS}
    kind = form.frames[0]
    given = framed(nadir(("8001.tif", "8002.tif")), "EPSG:2056" if kind == "projected" else kind)
    for k, odd in enumerate((*FORMULAS, *CONTROLS)):
        directory = tmp_path / str(k)
        directory.mkdir()
        product = directory / form.product
        eo = replace(given, images=(odd, "8002.tif"))
        source = relative_control(eo, GyroFigures(1e-4, 1e-4)) if form.relative else eo
        if odd in CONTROLS or product.suffix == ".csv":
            with pytest.raises(InputError, match=r"^[^\n]*rename the image$"):
                form.write(source, product, **options)
            assert not list(directory.iterdir())
            continue
        form.write(source, product, **options)
        if product.suffix in (".xml", ".kml"):
            ElementTree.fromstring(product.read_bytes())


def test_harmless_names_come_back(tmp_path: Path) -> None:
    """Oracle: the names written; a number is no formula."""
    names = ("-5", "+7.5", "a=b", "8-1.tif", "x@y", "ä\u2026.tif", "\u65e5.tif")
    write_metashape(framed(nadir(names), "geographic"), tmp_path / "x.csv")
    assert read_metashape_reference(tmp_path / "x.csv").images == names


def test_the_table_of_the_report_copies_no_formula() -> None:
    """Oracle: the pattern of the page, whose syntax is Python's as well, on names and numbers."""
    script = (files("insgnss") / "report/assets/report.js").read_text(encoding="utf-8")
    pattern = re.search(r"const plain = \(text\) => \(/(.*?)/\.test\(text\) \? `'", script)
    assert pattern is not None
    for name in (*FORMULAS, "\tx", "\rx"):
        assert re.search(pattern[1], name), name
    for name in ("8001.tif", "-5", "-0.25", "a=b", "", "0.3"):
        assert not re.search(pattern[1], name), name


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_points_are_named_as_images_are(separator: str) -> None:
    """Oracle: what begins as a formula, in tables that a spreadsheet opens; blanks open none."""
    for name in FORMULAS:
        with pytest.raises(InputError, match=r"^point name .* begins with .*, as formulas of"):
            check_names(["ok", name], separator, "point")
    check_names([name for name in FORMULAS if " " not in name], None, "point")


def test_characters_that_xml_does_not_have(tmp_path: Path) -> None:
    """Oracle: ElementTree; XML 1.0, production 2."""
    for name in CONTROLS:
        with pytest.raises(InputError, match=r"^marker name '.*' has the control character"):
            check_characters([name], "marker")
        tag = f'<a b="{xml_text(name + "<&", quotes=True)}">{xml_text(name)}</a>'
        assert "\ufffd" in ElementTree.fromstring(tag).text
    with pytest.raises(InputError, match=r"name 'a\\udcff', which is not UTF-8; rename that file$"):
        atomic_write(tmp_path / "x", "a\udcff")
    assert not list(tmp_path.iterdir())
