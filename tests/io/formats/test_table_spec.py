"""One specification a format of text: what its header may say, what is refused, how it is written;
and the one table of names that readers and `inspect` share.
"""

import re
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from insgnss.base.errors import InputError
from insgnss.flight.inspection.tables.grids import tables_of_file
from insgnss.flight.inspection.tables.tabular import sources_of_table
from insgnss.io.formats import names, read_barometer, read_events, sniff_events
from insgnss.io.formats.blocks import ground_points, image_points, pose_table
from insgnss.io.formats.events import dated, events
from insgnss.io.formats.gnss import gnss_text
from insgnss.io.formats.imu import imu_csv
from insgnss.io.formats.text.columns import TableOut, TableSpec

SPECS = {
    "imu": imu_csv.SPEC,
    "gnss": gnss_text.SPEC,
    "events": events.SPEC,
    "dated": dated.SPEC,
    "ground": ground_points.SPEC,
    "images": image_points.SPEC,
    "poses": pose_table.POSE_SPEC,
    "positions": pose_table.GEODETIC_POSITIONS,
}
SPEC = TableSpec(
    {"name": "name id", "x": "x east", "sigma": "sigma sd"},
    required="name x",
    layouts=("name x", "name x sigma"),
    text=True,
    strict="m metres",
)


def written(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def points_of(path: Path) -> None:
    """Read a table of points as their readers do."""
    table = SPEC.read(path)
    points, rows = table.rows_of("name", "point")
    table.refuse_repeats(lambda row: f"{points[rows[row]]} is there twice", rows)
    table.positive("x", "m")


@pytest.mark.parametrize("spec", SPECS.values(), ids=SPECS)
def test_a_name_in_a_header_means_one_column(spec: TableSpec) -> None:
    """Oracle: the rows of the table of names, counted; required ones and layouts are among them."""
    rows = [name for row in spec.names.values() for name in names.taken_by_readers(row)]
    assert len(rows) == len(set(rows)) == len(spec.aliases)
    assert set(spec.required.split()) <= set(spec.names)
    for layout in spec.layouts:
        assert set(spec.required.split()) <= set(layout.split())


def test_inspect_takes_what_readers_take() -> None:
    """Oracle: the table of names; a reader's name that inspect did not know would be left out."""
    for row in (names.IMU | names.GNSS).values():
        taken = names.taken_by_inspect(row)
        assert {name.replace("_", "") for name in names.taken_by_readers(row)} <= set(taken)
    for sensor, letter in (("gyro", "g"), ("accel", "a")):
        triads = {triad[0] for triad in names.TRIADS[sensor]}
        readers = names.taken_by_readers(names.IMU[f"{letter}x"])
        assert {name.replace("_", "") for name in readers} <= triads


def test_columns_by_header_layout_and_caller(tmp_path: Path) -> None:
    """Oracle: the numbers put in, by three ways of naming them."""
    headed = SPEC.read(written(tmp_path / "a.csv", "sd [m],id,east\n0.1,P1,5\n0.2,P2,7\n"))
    bare = SPEC.read(written(tmp_path / "b.csv", "P1,5,0.1\nP2,7,0.2\n"))
    table = written(tmp_path / "c.csv", "5,P1,0.1\n7,P2,0.2\n")
    chosen = SPEC.read(table, {"x": "[1]", "name": "[2]", "sigma": "[3]"})
    for read in (headed, bare, chosen):
        assert_array_equal(read.block("x sigma"), [[5.0, 0.1], [7.0, 0.2]])
        assert read.strings("name") == ("P1", "P2")


@pytest.mark.parametrize(
    ("text", "refusal"),
    [
        (
            "id,east,sdd\nP1,5,0.1\n",
            ":1: column 'sdd' is unknown; known are name, x, sigma; delete it",
        ),
        ("id,east [mm]\nP1,5\n", r":1: column 'east \[mm\]' is in 'mm', but must be in m"),
        ("id,sd\nP1,5\n", ":1: the header 'id,sd' does not name x; set columns"),
        ("id,x,east\nP1,5,5\n", ":1: the header 'id,x,east' names x twice"),
        (
            "P1,5,1,1\n",
            ":1: 4 fields and no header; without a header the columns must be name x; name x s",
        ),
        ("id,east\nP1,5\nP2,five\n", ":3: 'five' where a finite number must stand"),
        ("id,east\nP1,5\nP2,5\nP1,6\n", ":4: P1 is there twice, before in line 2; delete one"),
        ("id,east\nP1,5\nP2,-6\n", r":3: x -6 m; a standard deviation must be greater than zero"),
        ('id,east\nP1,5\n"",6\n', ":3: the name of the point is missing; write it"),
    ],
)
def test_refusals_are_one_line_with_file_line_and_remedy(
    tmp_path: Path, text: str, refusal: str
) -> None:
    """Oracle: the line and the value that was spoilt."""
    path = written(tmp_path / "points.csv", text)
    with pytest.raises(InputError, match=f"^{re.escape(str(path))}({refusal})"):
        points_of(path)


@pytest.mark.parametrize("separator", [",", " "])
def test_what_is_written_comes_back(tmp_path: Path, separator: str) -> None:
    """Oracle: the numbers and texts put in, the columns of text not beside each other."""
    out = TableOut("name x=%.3f role", separator).with_columns("y=%.2f n=%d")
    rng = np.random.default_rng(4)
    table = np.column_stack([rng.normal(size=(50, 2)).round(2), np.arange(50)])
    texts = ([f"P{k}" for k in range(50)], ["check" if k % 3 else "control" for k in range(50)])
    out.write(tmp_path / "t", table, *texts, comments=("of nothing",))
    read = TableSpec.exactly(out.names, text=True).read(tmp_path / "t")
    assert_array_equal(read.block("x y n"), table)
    assert (list(read.strings("name")), list(read.strings("role"))) == texts
    assert (tmp_path / "t").read_text().startswith("# of nothing\n")


@pytest.mark.parametrize(
    "header", ["filename,gps_datetime", "photo_file,shot_at", "Remark,Where,taken"]
)
def test_images_beside_dates_are_events_whatever_they_are_called(
    tmp_path: Path, header: str
) -> None:
    """Oracle: the instants put in; values decide where the header does not."""
    extra = "none," if header.count(",") == 2 else ""
    rows = "".join(f"{extra}IMG_{k}.JPG,2024-05-01 10:00:{k:02d}.250\n" for k in range(5))
    path = written(tmp_path / "photos.csv", f"{header}\n{rows}")
    assert sniff_events(path) == "event_dates"
    read = read_events(path, time_scale="gpst")
    assert read.images == tuple(f"IMG_{k}.JPG" for k in range(5))
    assert_array_equal(read.time, 3 * 86400.0 + 36000.25 + np.arange(5))


def test_two_columns_of_dates_are_not_chosen_between(tmp_path: Path) -> None:
    """Oracle: nothing says which of two dates is that of the exposure."""
    row = "IMG_0.JPG,2024-05-01 10:00:00.250,2024-05-01 10:00:09.250"
    path = written(tmp_path / "photos.csv", f"first,second,third\n{row}\n")
    with pytest.raises(InputError, match="does not name time"):
        read_events(path, time_scale="gpst")


@pytest.mark.parametrize(
    ("clock", "gyro", "accel"),
    [
        ("time_utc_usec", "IMU::AngularRate::{}", "IMU::Acceleration::{}"),
        ("timestamp", "gyro_rad[{}]", "accelerometer_m_s2[{}]"),
        ("seconds_elapsed", "RotationRate.{}", "TotalAcceleration.{}"),
    ],
)
def test_inspect_knows_the_names_of_loggers(
    tmp_path: Path, clock: str, gyro: str, accel: str
) -> None:
    """Oracle: the columns put in."""
    axes = "012" if "[" in gyro else "XYZ" if "::" in gyro else "xyz"
    head = [clock, *(gyro.format(c) for c in axes), *(accel.format(c) for c in axes)]
    rng = np.random.default_rng(5)
    values = np.column_stack([np.arange(100) * 1e4, rng.normal(size=(100, 6)) + [0, 0, 0, 0, 0, 9]])
    rows = "".join(",".join(f"{x:.6f}" for x in row) + "\n" for row in values)
    path = written(tmp_path / "log.csv", ",".join(head) + "\n" + rows)
    (table,) = tables_of_file(path)
    (source,) = sources_of_table(path, table)
    assert source.role == "imu"
    canonical = ("tow", "gx", "gy", "gz", "ax", "ay", "az")
    assert source.keys["columns"] == dict(zip(canonical, head, strict=True))


def test_dates_stamp_a_barometer_too(tmp_path: Path) -> None:
    """Oracle: the instants put in; 2024-05-01 is a Wednesday, GPST 18 s ahead of UTC."""
    rows = "".join(f"2024-05-01T10:00:{k:02d}Z,{100 + k}\n" for k in range(5))
    read = read_barometer(written(tmp_path / "b.csv", f"time,height\n{rows}"))
    assert_array_equal(read.time, 3 * 86400.0 + 36018.0 + np.arange(5))
    assert any("stamps are dates" in check.found for check in read.notes)
