"""IMU tables straight into the record: the same numbers and refusals as row by row, at any cut."""

import os
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from insgnss.base.errors import InputError
from insgnss.io.formats import read_imu
from insgnss.io.formats.arrays.npy import load_numpy
from insgnss.io.formats.imu import imu_csv
from insgnss.io.formats.text import direct, text
from insgnss.io.formats.text.pieces import FileBytes
from insgnss.records import ImuSamples

HEAD = "tow[s],gx[rad/s],gy[rad/s],gz[rad/s],ax[m/s^2],ay[m/s^2],az[m/s^2],temp"


def lines_of(seed: int, count: int = 120) -> list[str]:
    """Lines of very different lengths."""
    rng = np.random.default_rng(seed)
    digits = rng.integers(1, 12, count)
    return [
        ",".join([f"{200000 + 0.002 * k:.6f}", *(f"{x:.{digits[k]}f}" for x in rng.normal(size=7))])
        for k in range(count)
    ]


def row_by_row(path: Path, monkeypatch: pytest.MonkeyPatch) -> ImuSamples | str:
    """What comes out where nothing is read directly; of a refusal its text."""
    with monkeypatch.context() as patch:
        patch.setattr("insgnss.io.formats.imu.imu_csv.read_columns", lambda *_: None)
        return outcome(path)


def outcome(path: Path) -> ImuSamples | str:
    try:
        return read_imu(path)
    except InputError as refusal:
        return str(refusal)


def check_same(path: Path, monkeypatch: pytest.MonkeyPatch) -> ImuSamples | str:
    expected = row_by_row(path, monkeypatch)
    for piece in (1, 37, 100, 1000, 10**6):
        monkeypatch.setattr(direct, "PIECE_BYTES", piece)
        got = outcome(path)
        if isinstance(expected, str) or isinstance(got, str):
            assert got == expected
            continue
        assert_array_equal(got.time, expected.time)
        assert_array_equal(got.gyro, expected.gyro)
        assert_array_equal(got.accel, expected.accel)
        assert got.notes == expected.notes
    return expected


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_same_numbers_at_any_cut(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seed: int, newline: str
) -> None:
    """Oracles: Python's float, and the reader of rows; pieces of 1 byte end behind each line."""
    lines = lines_of(seed)
    (tmp_path / "a.csv").write_bytes((newline.join([HEAD, *lines]) + newline).encode())
    got = check_same(tmp_path / "a.csv", monkeypatch)
    assert isinstance(got, ImuSamples)
    numbers = np.array([[float(field) for field in line.split(",")] for line in lines])
    assert_array_equal(np.column_stack([got.time, got.gyro, got.accel]), numbers[:, :7])


def test_holes_of_comments_and_blank_lines_are_closed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: the file without them; and the line of a fault behind them."""
    lines = lines_of(4)
    mixed = [part for k, line in enumerate(lines) for part in (*["# x", "", " "][: k % 4], line)]
    (tmp_path / "plain.csv").write_text("\n".join([HEAD, *lines]) + "\n")
    (tmp_path / "mixed.csv").write_text("\n".join([HEAD, *mixed]) + "\n")
    got = check_same(tmp_path / "mixed.csv", monkeypatch)
    assert isinstance(got, ImuSamples)
    assert_array_equal(got.gyro, read_imu(tmp_path / "plain.csv").gyro)
    late = mixed.index(lines[100])
    mixed[late] = "100000.0" + lines[100][lines[100].index(",") :]
    (tmp_path / "mixed.csv").write_text("\n".join([HEAD, *mixed]) + "\n")
    refused = check_same(tmp_path / "mixed.csv", monkeypatch)
    assert isinstance(refused, str)
    assert f"mixed.csv:{late + 2}: time 100000.000000 s follows" in refused


FAULTS = {
    "a number": ("200000.5,1,-,3,4,5,6,7", "'-' in field 3 where a finite number must stand"),
    "too few": ("1,2,3", "3 fields, expected 8"),
    "too many": ("200000.5,1,2,3,4,5,6,7,8", "9 fields, expected 8"),
    "a quote": ('200000.5,"1",2,3,4,5,6,7', "where a finite number must stand"),
    "binary": ("200000.5,1,\x00,3,4,5,6,7", "the file is binary, packed or damaged"),
    "not finite": ("200000.5,nan,2,3,4,5,6,7", "where a finite number must stand"),
}


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("place", [1, 60, 119])
def test_same_refusal_wherever_the_fault_stands(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fault: str, place: int
) -> None:
    """Oracle: the reader of rows, and the line of the fault; of two faults the first is told."""
    lines = lines_of(5)
    lines[-1] = "200001,x,2,3,4,5,6,7"
    lines[place] = FAULTS[fault][0]
    (tmp_path / "a.csv").write_text("\n".join([HEAD, *lines]) + "\n")
    refused = check_same(tmp_path / "a.csv", monkeypatch)
    assert isinstance(refused, str)
    assert f"a.csv:{place + 2}: " in refused
    assert FAULTS[fault][1] in refused


def test_other_files_are_read_as_ever(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: the reader of rows: no newline at the end, dates, text in a column that nobody wants,
    a header that does not name the columns beside a bad line, reversed axes, a double row.
    """
    path, lines = tmp_path / "a.csv", lines_of(6)
    for content in (
        "\n".join([HEAD, *lines]),
        "\n".join([HEAD, *lines[:-1], lines[-1][:-4]]),
        "\n".join([HEAD, *(line.rsplit(",", 1)[0] + ",warm" for line in lines)]) + "\n",
        "\n".join([HEAD.replace("gx", "foo"), *lines[:90], "1,2", *lines[90:]]) + "\n",
        "\n".join([HEAD.replace("gx", "foo"), *lines]) + "\n",
        "\n".join([HEAD.replace("gx[rad/s]", "-gx[deg/s]"), *lines]) + "\n",
        "\n".join([HEAD, *lines[:50], lines[49], *lines[50:]]) + "\n",
        "\n".join(
            [HEAD]
            + [
                f"2018-07-03T10:00:{k // 5:02d}.{2 * (k % 5)}00Z" + line[line.index(",") :]
                for k, line in enumerate(lines)
            ]
        )
        + "\n",
    ):
        path.write_text(content)
        check_same(path, monkeypatch)


def test_more_rows_than_the_first_lines_promise(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracles: Python's float, and the reader of rows; the later lines are a third as long."""
    long = [f"{k}.0000000000,1.50000000,2.50000000,3.50000000,4.5,5.5,6.5,7" for k in range(40)]
    short = [f"{40 + k}.0,1,2,3,4,5,6,7" for k in range(200)]
    path = tmp_path / "a.csv"
    path.write_text("\n".join([HEAD, *long, *short]) + "\n")
    counted = []
    count = direct._Work.lines
    monkeypatch.setattr(direct._Work, "lines", lambda self: counted.append(1) or count(self))
    got = check_same(path, monkeypatch)
    assert isinstance(got, ImuSamples)
    assert_array_equal(got.time, np.arange(240.0))
    assert len(counted) == 4  # at every cut but the one that takes the file whole


def test_of_a_large_file_pieces_are_in_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: tracemalloc: of a file of megabytes a piece a thread, and what is read of it."""
    monkeypatch.setattr(text, "PIECES_FROM", 1)
    path = tmp_path / "big.csv"
    path.write_text("\n".join([HEAD, *(lines_of(7) * 1500)]) + "\n")
    with text.loaded(path) as (buf, complete):
        assert complete
        assert isinstance(buf, FileBytes)
        tracemalloc.start()
        try:
            table = direct.read_columns(buf, direct_layout(path, buf), {"g": [(1, 1.0)]})
            peak = tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()
    assert table is not None
    assert len(table["g"]) == 120 * 1500
    assert peak < table["g"].nbytes + 12 * direct.PIECE_BYTES < 0.8 * path.stat().st_size


@pytest.mark.parametrize("large", [True, False])
def test_a_file_that_becomes_shorter_while_it_is_read_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, large: bool
) -> None:
    """Oracle: the file cut off behind a line, after its layout was looked at, and before that.

    A map of it would end the process.
    """
    path = tmp_path / "imu.csv"
    path.write_text("\n".join([HEAD, *(lines_of(7) * 50)]) + "\n")
    size = path.stat().st_size
    if large:
        monkeypatch.setattr(text, "PIECES_FROM", 1)
        target, name, real = imu_csv, "sniff", imu_csv.sniff
    else:
        target, name, real = text.np, "empty", np.empty
    cut = path.read_bytes().index(b"\n", size // 2) + 1

    def sniffed(*values, **options):
        os.truncate(path, cut)
        return real(*values, **options)

    monkeypatch.setattr(target, name, sniffed)
    with pytest.raises(InputError, match=r"imu\.csv: became shorter while .* at byte \d+ of \d+;"):
        read_imu(path)


def test_an_array_that_is_cut_off_or_goes_on_is_refused(tmp_path: Path) -> None:
    """Oracle: bytes taken away and added by hand."""
    path = tmp_path / "imu.npy"
    np.save(path, np.ones((50, 7)))
    whole = path.read_bytes()
    for content in (whole[:-8], whole + b"more"):
        path.write_bytes(content)
        with pytest.raises(InputError, match=r"is no whole numpy file"):
            load_numpy(path)


def direct_layout(path: Path, buf: np.ndarray) -> text.TextLayout:
    return text.sniff(path, buf)
