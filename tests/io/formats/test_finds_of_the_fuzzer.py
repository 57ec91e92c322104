"""What a million mutated files showed; the rest of them stands with each reader's own tests."""

import json
import time
import zipfile

import numpy as np
import pytest

from insgnss.base.errors import InputError, UsageError
from insgnss.batch.season.tables import read_season
from insgnss.gnss.rinex.observations import read_observations
from insgnss.io.formats import read_barometer, read_events, unit_factor
from insgnss.io.formats.blocks.colmap_model import read_colmap_model
from insgnss.io.formats.blocks.dbat import read_dbat
from insgnss.io.formats.blocks.opensfm_model import read_opensfm_model, read_opensfm_poses
from insgnss.io.formats.logs.rosbag import tables_of_bag
from insgnss.io.formats.orientation.eo_covariance import read_eo_covariance
from insgnss.io.formats.orientation.eo_json import read_eo_json
from insgnss.io.formats.orientation.generic_ascii import read_generic_ascii
from insgnss.io.formats.orientation.mounting_file import read_mounting_file
from insgnss.io.formats.trajectory.odyn import read_odyn_poses

HUGE = "1e200"
ROW = "{} 46.57 6.54 400.0 {} 0.0 0.0 0.0\n"
SHOT = {"rotation": [1e200, 0.0, 0.0], "translation": [0.0, 0.0, 0.0], "camera": "c"}
CAMERA = {"projection_type": "brown", "width": 100, "height": 100, "focal_x": 1.0, "focal_y": 1.0}
MODEL = [{"cameras": {"c": CAMERA}, "points": {}, "shots": {"a.jpg": SHOT}}]
HEADER = (
    f"{'2.11':>9}{'':11}{'OBSERVATION DATA':20}{'G (GPS)':20}RINEX VERSION / TYPE\n"
    f"{'     0':60}# / TYPES OF OBSERV\n{'':60}END OF HEADER\n"
)
SCRIPT = (
    '<document dbat_script_version="1"><input><cameras><camera><aspect>1</aspect></camera>'
    "</cameras></input><set_initial_values><io>{}</io></set_initial_values></document>"
)
CASES = {
    "camera axes of no words": (
        read_generic_ascii,
        "# frame kind: tangent\n# camera axes:\n# image east\na 1.0\n",
        "has no header line .# attitude",
    ),
    "a quaternion beyond any number": (
        read_odyn_poses,
        ROW.format(1.0, 1.0) + ROW.format(2.0, HUGE) + ROW.format(3.0, 1.0),
        r":2: quaternion of length inf",
    ),
    "a lever arm beyond any number": (
        lambda path: read_mounting_file(path, np.eye(3)),
        f"[mounting]\nantenna_m = [0.4, {HUGE}, 0.0]\n",
        r":2: mounting.antenna_m: .* is 1e\+200 m long",
    ),
    "a turn beyond any number": (read_opensfm_poses, json.dumps(MODEL), "rotation is not three"),
    "no types of observations": (read_observations, HEADER, "holds no epoch"),
    "a turn too small for a float": (
        read_opensfm_poses,
        json.dumps(MODEL).replace("1e+200", "1e-400"),
        "is no JSON: 1e-400 is too small",
    ),
    "a position too small for a float": (
        read_eo_json,
        '{"position_m": [1e-400]}',
        "is no JSON: 1e-400 is too small",
    ),
    "a carriage return between dates": (
        read_events,
        "image,datetime_utc\na.tif,2021-03-18 12:19:04.6\nb.tif\r,2021-03-18 12:19:05.6\n",
        ":3: 'b.tif.*has a carriage return",
    ),
    "a shot that is a list": (
        read_opensfm_model,
        json.dumps([{"shots": {"a.jpg": [1.0]}}]),
        "shots is no table of tables",
    ),
    "a table of flights without columns": (
        read_season,
        "# insgnss season 1\n",
        ":2: has no line of column names",
    ),
    "a figure of a flight too small for a float": (
        read_season,
        "# insgnss season 1\nname,images\na,1e-400\n",
        "images: '1e-400' is no number",
    ),
    "an encoding that is none": (
        read_dbat,
        '<?xml version="1.0" encoding="x-8"?><document/>',
        ":1: is no XML: unknown encoding",
    ),
    "an aspect in other digits beside the camera": (
        read_dbat,
        SCRIPT.format("<aspect>\u0661</aspect>"),
        "set_initial_values: <aspect> '\u0661' is not given as a number in <camera>",
    ),
    "first values that are not those of the camera": (
        read_dbat,
        SCRIPT.format("default"),
        "set_initial_values: <cc> 'default' is not given as a number in <camera>",
    ),
}


COLMAP = {
    "cameras.txt": "1 SIMPLE_PINHOLE 100 80 90.0 50.0 40.0\n",
    "images.txt": "1 1 0 0 0 0 0 9 1 a.jpg\n1.5 2.5 7\n",
    "points3D.txt": "7 0 0 9 0 0 0 0.5 1 0\n",
}


@pytest.mark.parametrize(
    ("name", "old", "new", "says"),
    [
        ("images.txt", b"1.5", b"1e-400", "images.txt:2: .*: a field is missing or is no number"),
        ("images.txt", b" 7", b" 0.7e1", "images.txt:2: .*: a field is missing or is no number"),
        (
            "images.txt",
            b"1 1 0",
            b"1e1 1 0",
            "images.txt:1: .*: a field is missing or is no number",
        ),
        ("cameras.txt", b"100", b"1e2", "cameras.txt:1: .*: a field is missing or is no number"),
        ("images.txt", b"a.jpg", b"\xff\xfe", "pycolmap does not read this model: 'utf-8'"),
    ],
)
def test_a_model_of_colmap_is_refused_in_one_line(name, old, new, says, tmp_path):
    """Oracle: what was written; pycolmap takes 0, 0, 1, 1, and a name that no text holds."""
    pytest.importorskip("pycolmap")
    for file, text in COLMAP.items():
        (tmp_path / file).write_text(text)
    assert read_colmap_model(tmp_path).measured.images == ("a.jpg",)
    (tmp_path / name).write_bytes(COLMAP[name].encode().replace(old, new, 1))
    with pytest.raises(InputError, match=says):
        read_colmap_model(tmp_path)


def test_an_archive_whose_header_is_none(tmp_path):
    """Oracle: the refusal; numpy's way to old headers ends in an error of Python's tokenizer."""
    with zipfile.ZipFile(tmp_path / "x.npz", "w") as archive:
        archive.writestr("format.npy", b"\x93NUMPY\x01\x00\x04\x00{( \n")
    with pytest.raises(InputError, match="is no whole numpy archive"):
        read_eo_covariance(tmp_path / "x.npz", None)


def test_a_record_of_a_bag_longer_than_the_memory(tmp_path, monkeypatch):
    """Oracle: the memory that is refused; the library asks for what four bytes of the file say."""
    highlevel = pytest.importorskip("rosbags.highlevel")

    def asks(*_: object, **__: object) -> None:
        raise MemoryError

    monkeypatch.setattr(highlevel, "AnyReader", asks)
    (tmp_path / "x.bag").write_bytes(b"#ROSBAG V2.0\n")
    with pytest.raises(InputError, match="a record takes more memory than there is"):
        tables_of_bag(tmp_path / "x.bag")


@pytest.mark.parametrize("case", CASES)
def test_it_is_refused_in_one_line(case, tmp_path):
    """Oracle: the place and the reason by hand; no warning, which would be an error here."""
    read, text, says = CASES[case]
    path = tmp_path / "x.txt"
    path.write_text(text)
    with pytest.raises(InputError, match=says) as refusal:
        read(path)
    assert len(str(refusal.value)) < 500


def test_fields_that_are_nearly_too_long_take_no_time(tmp_path):
    """Oracle: linear time; 2 MB of fields of 4000 bytes took 2000 looks at each byte, minutes."""
    (tmp_path / "x").write_text(",".join(500 * ["9" * 4000]) + "\n")
    start = time.process_time()
    with pytest.raises(InputError, match="a line of more than 65536 bytes"):
        read_barometer(tmp_path / "x")
    assert time.process_time() - start < 2.0


def test_a_unit_that_is_none_takes_no_time():
    """Oracle: linear time; 40 000 blanks took the square of it, minutes."""
    start = time.process_time()
    with pytest.raises(UsageError, match="is none of") as refusal:
        unit_factor(40_000 * "a " + "b", "gyro")
    assert time.process_time() - start < 2.0
    assert len(str(refusal.value)) < 500
