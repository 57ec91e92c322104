"""Small files that would cost hours or gigabytes: each is refused in a line and in a moment."""

import gzip
import sqlite3
import time
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from insgnss.base import unpacking
from insgnss.base.errors import InputError
from insgnss.base.received.nesting import DEEPEST_NESTING, parse_json, read_object
from insgnss.base.tables import parse_toml
from insgnss.io.formats.arrays.npy import load_numpy
from insgnss.io.formats.blocks.dbat import read_dbat
from insgnss.io.formats.blocks.metashape_project import opened_project
from insgnss.io.formats.blocks.opensfm_model import read_opensfm_model
from insgnss.io.formats.bundle.colmap_database import read_colmap_database
from insgnss.io.formats.bundle.micmac import read_micmac_xml
from insgnss.io.formats.images.xmp import set_properties
from insgnss.io.formats.imu.variances import read_variances
from insgnss.io.formats.logs.rosbag import read_imu_rosbag
from insgnss.io.formats.orientation.eo_json import read_eo_json
from insgnss.io.formats.returned.projects import read_bentley
from insgnss.io.formats.text import xml
from insgnss.io.formats.text.xml import parse_xml

DOCUMENT = b"<document>%b</document>"
ENDLESS = "WITH RECURSIVE n(k) AS (SELECT 1 UNION ALL SELECT k + 1 FROM n) "
ENTITIES = b'<!DOCTYPE a [<!ENTITY b "cccc">]>\n<a>&b;</a>'


def zipped(path: Path, name: str, content: bytes) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(name, content)
    return path


UNBOUNDED_S = 5.0  # CPU time (s) that no refusal takes: without bounds they took 9 s to for ever


def refused(read: Callable[[], object]) -> str:
    """Return the one line of a refusal that did not read on and on."""
    start = time.process_time()
    with pytest.raises(InputError) as no:
        read()
    assert time.process_time() - start < UNBOUNDED_S
    assert "\n" not in str(no.value)
    return str(no.value)


def test_a_small_file_unpacks_to_200_times_its_size_or_100_mb(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Oracle: the rule of the docstring, and the variable that replaces it."""
    monkeypatch.delenv(unpacking.UNPACKED_GB, raising=False)
    limits = {1e3: 1e8, 1e6: 2e8, 3e6: 6e8, 1e9: 4e9}
    assert {size: unpacking.unpacked_limit(size) for size in limits} == limits
    monkeypatch.setenv(unpacking.UNPACKED_GB, "7")
    assert unpacking.unpacked_limit(1e3) == 7e9


def test_a_small_file_that_unpacks_to_much_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: 3 MB of zeros pack to 3 kB; the free size made 1 MB stands for 100 MB."""
    monkeypatch.delenv(unpacking.UNPACKED_GB, raising=False)
    monkeypatch.setattr(unpacking, "ALWAYS_UNPACKED_BYTES", 1e6)
    zeros = bytes(3_000_000)
    npz = tmp_path / "x.npz"
    np.savez_compressed(npz, tow=np.frombuffer(zeros, np.uint8))
    psz = zipped(tmp_path / "x.psz", "doc.xml", zeros)
    for read in (
        lambda: unpacking.unpack("x.gz", gzip.compress(zeros)),
        lambda: load_numpy(npz),
        lambda: opened_project(psz),
    ):
        assert "(limit 1 MB for a file of 0.00" in refused(read)


def test_elements_of_xml_count_as_what_the_file_unpacks_to(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: 40 000 elements of 4 bytes count as 3 MB, of which 1 MB is free."""
    monkeypatch.delenv(unpacking.UNPACKED_GB, raising=False)
    monkeypatch.setattr(unpacking, "ALWAYS_UNPACKED_BYTES", 1e6)
    content = DOCUMENT % (b"<a/>" * 40_000)
    psz = zipped(tmp_path / "x.psz", "doc.xml", content)
    assert "unpacks to at least 3.16 MB (limit 1 MB for" in refused(lambda: opened_project(psz))
    plain = tmp_path / "x.xml"
    plain.write_bytes(content)
    assert opened_project(plain)[0].tag == "document"  # 200 times 160 kB


def readers_of_xml(directory: Path, content: bytes) -> dict[str, Callable[[], object]]:
    """Return every reader of XML with a file of this content."""
    for name in ("x.xml", "Orientation-a.xml"):
        (directory / name).write_bytes(content)
    psz = zipped(directory / "x.psz", "doc.xml", content)
    return {
        "metashape xml": lambda: opened_project(directory / "x.xml"),
        "metashape psz": lambda: opened_project(psz),
        "dbat": lambda: read_dbat(directory / "x.xml"),
        "bentley": lambda: read_bentley(directory / "x.xml"),
        "micmac": lambda: read_micmac_xml(directory),
        "xmp": lambda: set_properties(content, {}, {}, "x.jpg"),
    }


def test_xml_without_end_is_refused_by_every_reader(tmp_path: Path) -> None:
    """Oracle: elements 20 000 deep, and entities of a document type."""
    nested = b'<rdf:RDF xmlns:rdf="r">' + b"<a>" * 20_000 + b"</a>" * 20_000 + b"</rdf:RDF>"
    for kind, read in readers_of_xml(tmp_path, nested).items():
        expected = "not well formed" if kind == "xmp" else "more than 100 deep"
        assert expected in refused(read), kind
    for kind, read in readers_of_xml(tmp_path, b"<!-- x -->\n" + ENTITIES).items():
        line = refused(read)
        assert "declares a document type" in line, kind
        assert kind == "xmp" or ":2: " in line, kind
    utf16 = ENTITIES.decode().encode("utf-16")
    assert "x:1: declares a document type" in refused(lambda: parse_xml("x", utf16))


def test_xml_is_parsed_as_it_stands(monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: the document written; its pieces cut it within marks and letters."""
    content = '<?xml version="1.0"?><!-- a --><a b="ü">c<d>&lt;é</d></a>\n'.encode()
    for piece in (1, 3, 1 << 20):
        monkeypatch.setattr(xml, "PARSED_AT_A_TIME", piece)
        root = parse_xml("x", content)
        assert (root.tag, root.get("b"), root.text, root[0].text) == ("a", "ü", "c", "<é")
    assert "x:3: is no XML: " in refused(lambda: parse_xml("x", b"<a>\n\n<b></a>"))
    coded = b'<?xml version="1.0" encoding="cp437x"?><a/>'
    assert "x:1: is no XML: " in refused(lambda: parse_xml("x", coded))


def colmap(path: Path, *statements: str) -> Path:
    with sqlite3.connect(path) as connection:
        connection.execute("CREATE TABLE cameras (camera_id, model, width, height, params)")
        connection.execute("INSERT INTO cameras VALUES (1, 0, 10, 10, zeroblob(24))")
        for statement in statements:
            connection.execute(statement)
    connection.close()
    return path


def test_a_database_is_read_no_further_than_its_tables(tmp_path: Path) -> None:
    """Oracle: views over an endless query, a virtual table, and columns that are generated."""
    view = "images AS " + ENDLESS + "SELECT k AS image_id, 'a' || k AS name, 1 AS camera_id FROM n"
    table = "CREATE TABLE images (image_id, name, camera_id)"
    frames = f"CREATE VIEW frames AS {ENDLESS} SELECT k AS frame_id, k AS rig_id FROM n"
    texts = "name TEXT AS (printf('%.*c', 9000, 'a'))"
    cases = {
        "view": (f"CREATE VIEW {view}",),
        "VIEW": (f"CREATE VIEW {view}".replace("images AS", "IMAGES AS"),),
        "frames": (table, frames, *(f"CREATE TABLE {n} (a)" for n in ("rigs", "frame_data"))),
        "virtual": ("CREATE VIRTUAL TABLE images USING fts5(image_id, name, camera_id)",),
        "generated": (
            f"CREATE TABLE images (image_id, {texts}, camera_id)",
            "INSERT INTO images VALUES (1, 1)",
        ),
    }
    reasons = {"virtual": "is a virtual, not", "generated": "columns that are computed"}
    for kind, statements in cases.items():
        file = colmap(tmp_path / f"{kind}.db", *statements)
        line = refused(lambda file=file: read_colmap_database(file, ["a1"]))  # type: ignore[misc]
        assert line.startswith(f"{file}: is no database of COLMAP: "), kind
        assert reasons.get(kind, "is a view") in line, kind
    good = colmap(tmp_path / "good.db", table, "INSERT INTO images VALUES (1, 'a1', 1)")
    assert read_colmap_database(good, ["a1"]).images[0].number == 1


def test_a_bag_whose_messages_are_a_view_is_not_read(tmp_path: Path) -> None:
    """Oracle: a view without end, under a name that rosbags takes from the metadata."""
    pytest.importorskip("rosbags")
    (tmp_path / "metadata.yaml").write_text("rosbag2_bagfile_information:\n  version: 5\n")
    colmap(tmp_path / "x.data", f"CREATE VIEW messages AS {ENDLESS} SELECT k FROM n")
    (tmp_path / "x.db3").touch()
    line = refused(lambda: read_imu_rosbag(tmp_path / "x.db3"))
    assert line.startswith(f"{tmp_path / 'x.data'}: is no whole ROS bag: messages is a view")


def test_steps_of_sqlite_are_limited_by_the_size_of_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: pages of the table lead back to each other, so that its rows have no end."""
    file = colmap(tmp_path / "x.db", "CREATE TABLE images (image_id, name, camera_id)")
    with sqlite3.connect(file) as connection:
        connection.executemany(
            "INSERT INTO images VALUES (?, ?, 1)", [(k, f"{k:0500d}") for k in range(1000)]
        )
        where = "SELECT rootpage FROM sqlite_master WHERE name = 'images'"
        page, root = (connection.execute(t).fetchone()[0] for t in ("PRAGMA page_size", where))
    connection.close()
    data = bytearray(file.read_bytes())
    start = (root - 1) * page
    assert data[start] == 5  # an inner page: each of its cells leads to a page of rows
    cells = int.from_bytes(data[start + 3 : start + 5], "big")
    offsets = [int.from_bytes(data[start + 12 + 2 * k :][:2], "big") for k in range(cells)]
    first = bytes(data[start + offsets[0] :][:4])
    for offset in offsets:
        data[start + offset : start + offset + 4] = first
    file.write_bytes(data)
    monkeypatch.setattr("insgnss.io.formats.text.database.FEWEST_INSTRUCTIONS", 1000)
    monkeypatch.setattr("insgnss.io.formats.text.database.INSTRUCTIONS_AT_A_TIME", 100)
    monkeypatch.setattr("insgnss.io.formats.text.database.BY_BYTE", 0)
    line = refused(lambda: read_colmap_database(file, ["a1"]))
    assert "more steps than a file of this size needs (limit 1000)" in line


def test_json_and_toml_are_followed_to_a_hundred_levels(tmp_path: Path) -> None:
    """Oracle: lists of 100 levels, and one more; levels that no recursion bears."""
    for levels in (1, DEEPEST_NESTING):
        text = "[" * levels + "]" * levels
        assert isinstance(parse_json("x", text), list)
    for levels in (DEEPEST_NESTING + 1, 990, 10**5):
        lists = "[" * levels + "]" * levels
        assert "x: has objects or lists nested more than 100 deep" in refused(
            lambda lists=lists: parse_json("x", lists)  # type: ignore[misc]
        )
        assert "(limit 100)" in refused(lambda lists=lists: parse_toml(tmp_path, f"a = {lists}"))  # type: ignore[misc]
        file = tmp_path / "reconstruction.json"
        file.write_text(lists)
        assert "more than 100 deep" in refused(lambda file=file: read_opensfm_model(file))  # type: ignore[misc]
        assert "more than 100 deep" in refused(lambda file=file: read_variances(file))  # type: ignore[misc]
        assert read_object(file) == {}
        eo = tmp_path / "eo.json"
        eo.write_text(f'{{"format": "insgnss master EO", "format_version": 1, "images": {lists}}}')
        refused(lambda eo=eo: read_eo_json(eo))  # type: ignore[misc]
    assert "x:2: is no JSON: " in refused(lambda: parse_json("x", "[\n"))
