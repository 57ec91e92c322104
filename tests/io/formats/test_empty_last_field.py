"""A row whose last field is empty lacks a value; it is neither torn nor another table."""

from pathlib import Path

import numpy as np
import pytest

from insgnss.base.errors import InputError
from insgnss.flight.inspection.tables.grids import tables_of_file
from insgnss.io.formats import read_gnss, read_imu
from insgnss.io.formats.text.text import read_table, read_text_table

HEAD = "tow,gx,gy,gz,ax,ay,az"
ROWS = 400


def rows(columns: int, seed: int) -> list[list[str]]:
    values = np.random.default_rng(seed).normal(size=(ROWS, columns - 1))
    return [[f"{200000 + 0.01 * k:.2f}", *(f"{x:.5f}" for x in v)] for k, v in enumerate(values)]


def written(path: Path, head: str, table: list[list[str]], sign: str = ",") -> Path:
    lines = [sign.join(row) for row in table]
    path.write_text("\n".join([head.replace(",", sign), *lines]) + "\n")
    return path


@pytest.mark.parametrize("sign", [",", ";", "\t"])
@pytest.mark.parametrize("lacking", [[0], [5, 27, 300], [398, 399]])
def test_imu_rows_that_lack_a_value_are_left_out_and_counted(tmp_path, sign, lacking):
    """Oracle: the rows that were written, without those."""
    table = rows(7, 1)
    for k in lacking:
        table[k][-1 if k % 2 else 3] = ""
    imu = read_imu(written(tmp_path / "imu.csv", HEAD, table, sign))
    numbers = np.array([row for row in table if "" not in row], dtype=float)
    np.testing.assert_array_equal(np.column_stack([imu.gyro, imu.accel]), numbers[:, 1:])
    (found,) = [one.found for one in imu.notes if "lack" in one.found]
    assert f"{len(lacking)} of 400 rows" in found
    assert found.endswith(f"in line {lacking[0] + 2}")
    (grid,) = tables_of_file(tmp_path / "imu.csv")
    np.testing.assert_array_equal(grid.grid.values, numbers)


def test_many_rows_that_lack_a_value_are_refused_at_the_first(tmp_path):
    """Oracle: 1 % of 400."""
    table = rows(7, 2)
    for k in (9, 19, 29, 39):
        table[k][-1] = ""
    with pytest.raises(InputError, match=r"imu.csv:11: nothing in field 7 where a finite number"):
        read_imu(written(tmp_path / "imu.csv", HEAD, table))


def test_an_empty_field_that_weighs_nothing_is_unknown(tmp_path):
    """Oracle: the fields as they were written; of 20 rows at the top most end so."""
    table = rows(9, 3)
    for k, row in enumerate(table):
        row[1:4] = ["46.5", f"{6.5 + 1e-6 * k:.7f}", "500.0"]
        row[4:7] = ["0.02", "0.02", "0.03"]
        row[7], row[8] = "7", "" if k < 15 or k % 3 == 0 else "1.5"
    head = "tow,lat,lon,h,sd_n,sd_e,sd_u,nsat,hdop"
    fixes = read_gnss(written(tmp_path / "fixes.csv", head, table))
    assert len(fixes) == ROWS
    assert np.isnan(fixes.hdop).sum() == sum(row[8] == "" for row in table)


def test_without_header_rows_of_the_sample_say_how_many_fields_there_are(tmp_path):
    """Oracle: the longest rows; those that end behind a comma lack their last."""
    path = tmp_path / "table.csv"
    path.write_text("1,2,\n3,4,\n5,6,7\n8,9,\n")
    table = read_table(path, whole=False)
    np.testing.assert_array_equal(table.values[:, 2], [np.nan, np.nan, 7.0, np.nan])
    assert table.blank == {2: 3}


def test_a_comma_that_closes_every_line_is_no_field(tmp_path):
    """Oracle: by hand."""
    (tmp_path / "table.csv").write_text("a,b,\n1,2,\n3,4,\n")
    assert read_table(tmp_path / "table.csv").values.tolist() == [[1.0, 2.0], [3.0, 4.0]]


def test_text_tables_have_the_empty_field(tmp_path):
    """Oracle: by hand."""
    (tmp_path / "table.csv").write_text("a.jpg,1,x\nb.jpg,2,\nc.jpg,3,z\n")
    assert read_text_table(tmp_path / "table.csv").strings(2) == ("x", "", "z")


@pytest.mark.parametrize("end", ["5,6,", "5,6, "])
def test_a_file_that_ends_behind_a_delimiter_is_cut(tmp_path, end):
    """Oracle: no line end: what follows may be lost."""
    (tmp_path / "table.csv").write_text(f"1,2,3\n3,4,5\n{end}")
    for read in (lambda path: read_table(path, whole=False), read_text_table):
        with pytest.raises(InputError, match=r"table.csv:3: truncated"):
            read(tmp_path / "table.csv")
