"""Names with blanks, parentheses, commas, quotation marks through every format: they come back, or
are refused with the remedy, which then works.
"""

import csv
import json
import re
import sqlite3
import xml.etree.ElementTree as ET
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import pytest
from oracles import oracle
from PIL import Image

from insgnss.base.errors import InputError, UsageError
from insgnss.flight.exporting.export import ExportFrame, export, refuse_names
from insgnss.flight.exporting.rename import read_names, rename_images
from insgnss.io.formats import EXPORTS, read_events
from insgnss.io.formats.events.events import write_events
from insgnss.io.formats.orientation.eo_json import read_eo_json
from insgnss.io.formats.orientation.eo_local_plane import read_eo_local_plane
from insgnss.io.formats.orientation.generic_ascii import read_generic_ascii
from insgnss.io.formats.orientation.relative_csv import read_relative_csv
from insgnss.records import CameraEvents, ExteriorOrientation

NAMES = ("IMG 0001 (1).jpg", 'a "b", c;d.jpg', "o'x=1 % & <é>.jpg")
QUOTED = (*NAMES, "'all'", '"all"', "#first.jpg", " blanks ")
CAMERA = "PINHOLE 5120 3840 5607 5607 2560 1920"
OPTIONS: dict[str, dict[str, Any]] = {
    "colmap": {"camera": CAMERA},
    "colmap_priors": {"camera": CAMERA},
    "inpho_prj": {"focal_mm": 20.0, "ground_m": 500.0},
    "opf": {"camera": CAMERA, "pixel_size_um": 3.3},
    "relative": {"noise": "navchip"},
    "rtklib_pos": {"lever_m": "0.4,0,-0.1"},
}
READERS = {
    "eo_json": read_eo_json,
    "eo_local_plane": read_eo_local_plane,
    "generic_ascii": read_generic_ascii,
}
OF_NO_NAMES = {"tum", "rtklib_pos"}
PAGES = Path(__file__).parents[3] / "data_specs"


def refused_by_page(name: str) -> bool:
    """Whether the format's page says that its program knows no quotation marks."""
    lines = (PAGES / f"{EXPORTS[name].page}.md").read_text(encoding="utf-8").splitlines()
    return any("is refused by" in line and f"`{name}`" in line for line in lines)


def flight(images: tuple[str, ...] = NAMES) -> ExteriorOrientation:
    """Cameras that look down, 1 s and 20 m apart."""
    n = len(images)
    return ExteriorOrientation(
        images=images,
        time=200_000.0 + np.arange(n),
        gps_week=2008,
        origin=np.array([0.812, 0.114, 400.0]),
        position_m=np.column_stack([20.0 * np.arange(n), np.zeros(n), np.full(n, 100.0)]),
        C_mc=np.tile(np.diag([1.0, -1.0, -1.0]), (n, 1, 1)),
        cov=np.tile(1e-4 * np.eye(6), (n, 1, 1)),
        cross=np.zeros((n - 1, 6, 6)),
        boresight=np.eye(3),
        camera_from_body=np.diag([-1.0, -1.0, 1.0]),
        history=("smoothed",),
    )


def texts(path: Path) -> str:
    """Everything that a reader of the format's own syntax finds, one item a line."""
    files = sorted(path.rglob("*")) if path.is_dir() else [path, *path.parent.glob("*_ids.txt")]
    found: list[str] = []
    for file in files:
        found.append(file.name)
        if file.suffix in (".gpkg", ".db"):
            with sqlite3.connect(file) as db:
                column, table = (
                    ("image", "images") if file.suffix == ".gpkg" else ("name", "images")
                )
                found += [row[0] for row in db.execute(f"SELECT {column} FROM {table}")]
            db.close()
            continue
        text = file.read_text(encoding="utf-8")
        if text.startswith(("{", "[")) and file.suffix != ".txt":
            found += [unquote(s) for s in strings(json.loads(text))]
        elif text.startswith("<"):
            found += [
                s for e in ET.fromstring(text).iter() for s in (e.text, *e.attrib.values()) if s
            ]
        else:
            found.append(text)
    return "\n".join(found)


def strings(item: Any) -> list[str]:
    if isinstance(item, dict):
        return [s for key, value in item.items() for s in (key, *strings(value))]
    if isinstance(item, list):
        return [s for value in item for s in strings(value)]
    return [item] if isinstance(item, str) else []


@pytest.mark.parametrize("name", [name for name in EXPORTS if name != "image_tags"])
def test_every_format_holds_these_names_or_says_how_to_export_all_the_same(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: a parser of the format's syntax, our own reader where there is one, and the page."""
    if name == "colmap_priors":
        oracle("pycolmap")
    form = EXPORTS[name]
    options, target, eo = OPTIONS.get(name, {}), ExportFrame(), flight()
    if form.heights == "sea level":
        monkeypatch.setattr(
            "insgnss.flight.exporting.export._undulation",
            lambda eo, *_: np.full(len(eo.images), 49.6),
        )
    if name == "opf":
        target = ExportFrame("EPSG:32632")
    path = tmp_path / "out" / form.product
    path.parent.mkdir()
    assert refused_by_page(name) == bool(form.separator)
    if form.separator:
        with pytest.raises(InputError, match=r"image name .* --rename"):
            refuse_names(NAMES, [name], [])
        refuse_names(NAMES, [name], ["safe"])
        with pytest.raises(InputError, match=r"image name .* --rename"):
            export(eo, name, path, target, **options)
        assert not list(path.parent.iterdir())
        done = export(eo, name, path, target, ["safe"], **options)
        expected = ("IMG_0001__1_.jpg", "a__b___c_d.jpg", "o_x_1________.jpg")
        table = path.with_name(f"{path.stem}_names.csv")
        assert read_names(table) == dict(zip(NAMES, expected, strict=True))
        assert done.files == (path, table)
        assert "'IMG_0001__1_.jpg' for 'IMG 0001 (1).jpg'" in done.notes[0]
        table.unlink()
    else:
        export(eo, name, path, target, **options)
        expected = NAMES
    if name in OF_NO_NAMES:
        return
    if name in READERS:
        assert READERS[name](path).images == expected
    elif name == "relative":
        assert read_relative_csv(path).names == tuple(pairwise(NAMES))
    else:
        found = texts(path)
        for image in expected:
            stem = image.removesuffix(".jpg")
            assert image in found or (name.startswith("inpho") and stem in found), image


def test_tables_of_ours_give_back_what_would_break_them(tmp_path: Path) -> None:
    """Oracle: the names that were written; csv of the standard library reads the comma separated
    ones alike.
    """
    eo = flight(QUOTED)
    for form in ("eo_local_plane", "generic_ascii", "eo_json"):
        export(eo, form, tmp_path / form)
        assert READERS[form](tmp_path / form).images == QUOTED, form
    for delimiter in ("comma", "semicolon", "tab"):
        export(eo, "generic_ascii", tmp_path / delimiter, delimiter=delimiter)
        assert read_generic_ascii(tmp_path / delimiter).images == QUOTED, delimiter
    export(eo, "generic_ascii", tmp_path / "csv", delimiter="comma", header="names")
    with (tmp_path / "csv").open(newline="", encoding="utf-8") as stream:
        rows = list(csv.reader(stream))[1:]
    assert tuple(row[0] for row in rows) == QUOTED
    events = CameraEvents(QUOTED, np.arange(float(len(QUOTED))), None, "")
    write_events(events, tmp_path / "events.txt")
    assert read_events(tmp_path / "events.txt").images == QUOTED


def test_rules_of_other_names(tmp_path: Path) -> None:
    """Oracle: names written by hand; a name that has the sign of the rule itself."""
    table = tmp_path / "names.csv"
    table.write_text('# of May\nold,new\n"IMG 0001 (1).jpg",1.jpg\nother.jpg,2.jpg\n')
    eo = flight()
    assert rename_images(eo, [table])[0].images == ("1.jpg", *NAMES[1:])
    assert rename_images(eo, [f"{NAMES[2]}=x=y.jpg", str(table)])[1] == {
        NAMES[0]: "1.jpg",
        NAMES[2]: "x=y.jpg",
    }
    folders = replace(eo, images=("a/1.jpg", "a\\2.jpg", "3.jpg"))
    assert rename_images(folders, ["basename"])[0].images == ("1.jpg", "2.jpg", "3.jpg")
    assert rename_images(eo, [])[0] is eo


@pytest.mark.parametrize(
    ("rule", "text", "message"),
    [
        ("clean", "", "'clean' is neither a file nor OLD=NEW nor one of safe, basename"),
        ("a.jpg=b.jpg", "", "no image has this name; one is 'IMG 0001 (1).jpg'"),
        ("t.csv", "a,b\n", "names none of the 3 images, such as 'IMG 0001 (1).jpg'"),
        ("t.csv", "a,b\nc\n", "t.csv:2: 'c' is not old,new, each old name once"),
        ("t.csv", "a,b\na,c\n", "t.csv:2: 'a,c' is not old,new"),
        ("t.csv", "old,new\n", "names no image"),
    ],
)
def test_rules_that_are_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rule: str, text: str, message: str
) -> None:
    """Oracle: what is wrong with each, read by eye."""
    monkeypatch.chdir(tmp_path)
    if text:
        Path(rule).write_text(text)
    with pytest.raises((UsageError, InputError), match=re.escape(message)):
        rename_images(flight(), [rule])


def test_two_images_get_no_name_in_common(tmp_path: Path) -> None:
    """Oracle: names that differ by a character that becomes another one."""
    with pytest.raises(InputError, match="'a b' and 'a_b' would both be called 'a_b'"):
        export(flight(("a b", "a_b")), "odm", tmp_path / "geo.txt", None, ["safe"])
    assert not list(tmp_path.iterdir())


def test_copies_of_images_keep_their_names(tmp_path: Path) -> None:
    """Oracle: the files of the images."""
    (tmp_path / "photos").mkdir()
    for name in NAMES:
        Image.new("L", (8, 8)).save(tmp_path / "photos" / name)
    export(
        flight(), "image_tags", tmp_path / "out", None, ["safe"], images=str(tmp_path / "photos")
    )
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == sorted(NAMES)
