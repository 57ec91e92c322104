"""Each stamp once and in order: rows that are double, late, or contradict each other."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from insgnss.base.errors import InputError
from insgnss.io.formats import read_events, read_gnss, read_imu
from insgnss.io.formats.text.order import NumberedRows, put_in_order

N = 1000
TABLE = np.column_stack(
    [200000.0 + 0.01 * np.arange(N), np.random.default_rng(1).integers(-99, 99, (N, 6))]
)


def imu_file(tmp_path: Path, rows: np.ndarray) -> Path:
    path = tmp_path / "imu.csv"
    path.write_text(
        "".join(f"{row[0]:.2f}," + ",".join(f"{v:.0f}" for v in row[1:]) + "\n" for row in rows)
    )
    return path


@pytest.mark.slow
@settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    st.lists(st.integers(0, N - 100), max_size=8, unique=True),
    st.lists(st.integers(0, N - 1), max_size=30),
    st.integers(0, 2**31),
)
def test_whole_recording_comes_back(
    tmp_path: Path, late: list[int], double: list[int], seed: int
) -> None:
    """Oracle: the recording before rows were moved behind later ones by less than 1 s, and others
    doubled anywhere behind them.
    """
    rng = np.random.default_rng(seed)
    order = list(range(N))
    for row in late:
        order.remove(row)
        behind = row + int(rng.integers(20, 60))
        order.insert(
            order.index(next(k for k in range(behind, N) if k not in late)), row
        )  # one that was moved itself is further on
    for row in double:
        order.insert(int(rng.integers(order.index(row), len(order))) + 1, row)
    imu = read_imu(imu_file(tmp_path, TABLE[order]))
    assert np.allclose(imu.time, TABLE[:, 0], atol=1e-9, rtol=0)
    assert np.array_equal(np.column_stack([imu.gyro, imu.accel]), TABLE[:, 1:])
    told = "".join(note.found for note in imu.notes)
    assert (f"{len(double)} double rows left out" in told) == bool(double)
    assert (f"{len(late)} out-of-order rows sorted" in told) == bool(late)
    assert [note.name for note in imu.notes] == ["IMU rows"] * bool(late or double)


def test_later_contradiction_is_left_out_and_counted(tmp_path: Path) -> None:
    """Oracle: the row that came first, by hand."""
    rows = np.insert(TABLE, 500, TABLE[499] + [0, 5, 0, 0, 0, 0, 0], axis=0)
    imu = read_imu(imu_file(tmp_path, rows))
    assert np.array_equal(imu.gyro[499], TABLE[499, 1:4])
    assert (
        "1 rows left out that contradict an earlier row of their time, the first at"
        f" {TABLE[499, 0]:.3f} s, of 1001" in imu.notes[0].found
    )


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (
            np.roll(TABLE[:, :], 1, axis=0),
            r"imu.csv:2: time 200000.000000 s follows 200009.990000 s; .*999 of 1000 rows are out"
            " of order",
        ),
        (
            np.insert(TABLE[1:], 101, TABLE[0], axis=0),
            r"imu.csv:102: time 200000.000000 s follows 200001.010000 s; .*by up to 1.010 s",
        ),
        (
            np.repeat(TABLE, 2, axis=0) + np.outer(np.arange(2 * N) % 2, [0, 1, 0, 0, 0, 0, 0]),
            r"imu.csv:2: .*in 1000 of 2000 rows",
        ),
    ],
)
def test_beyond_the_limits_the_first_row_is_refused(
    tmp_path: Path, rows: np.ndarray, message: str
) -> None:
    """Oracle: the rule of data_specs/README.md, 1 s and 1 %."""
    with pytest.raises(InputError, match=message):
        read_imu(imu_file(tmp_path, rows))


def late(rows: int, by_s: float = 0.05) -> np.ndarray:
    """The recording with `rows` rows, 60 apart, moved behind others by a bit less than `by_s`."""
    order = np.arange(N, dtype=float)
    order[np.arange(rows) * 60] += 100.0 * by_s - 0.5
    return TABLE[np.argsort(order)]


def contradicting(rows: int) -> np.ndarray:
    """The recording, `rows` stamps of which come a second time with other values: N rows in all."""
    again = TABLE[: N - rows].copy()
    at = np.arange(rows) * 60
    return np.insert(again, at + 1, again[at] + [0, 5, 0, 0, 0, 0, 0], axis=0)


@pytest.mark.parametrize(
    ("rows", "word"),
    [(late, "out-of-order rows sorted"), (contradicting, "rows left out that contradict")],
)
def test_one_percent_is_the_limit(
    tmp_path: Path, rows: Callable[[int], np.ndarray], word: str
) -> None:
    """Oracle: data_specs/README.md, fewer than 1 %: of 1000 rows 9 are mended and counted, 10 are
    refused.
    """
    (told,) = read_imu(imu_file(tmp_path, rows(9))).notes
    assert f"9 {word}" in told.found
    assert told.found.endswith("of 1000")
    with pytest.raises(InputError, match=r"10 of 1000 rows.*1%"):
        read_imu(imu_file(tmp_path, rows(10)))


def test_one_second_is_the_limit_of_a_late_row(tmp_path: Path) -> None:
    """Oracle: data_specs/README.md, less than 1 s: by 0.99 s a row is put in its place, by 1.00 s
    it is refused.
    """
    (told,) = read_imu(imu_file(tmp_path, late(1, by_s=1.0))).notes
    assert "1 out-of-order rows sorted" in told.found
    with pytest.raises(InputError, match=r"by up to 1\.000 s \(limits 1 s and 1%\)"):
        read_imu(imu_file(tmp_path, late(1, by_s=1.01)))


def test_recording_that_stands_twice_in_its_file(tmp_path: Path) -> None:
    """Oracle: the recording once."""
    imu = read_imu(imu_file(tmp_path, np.vstack([TABLE, TABLE])))
    assert imu.time.size == N
    assert imu.notes[0].found == "1000 double rows left out, of 2000"


def test_fixes_and_events_follow_the_same_rule(tmp_path: Path) -> None:
    """Oracle: lines in order, once, by hand."""
    lines = [f"{k}.0 46.0 6.0 {500 + k}.0 0.1 0.1 0.1\n" for k in range(200)]
    lines[100:102] = [lines[101].replace("101.0 46", "100.5 46"), lines[100]]
    (tmp_path / "gnss.txt").write_text("".join([*lines, lines[50]]))
    fixes = read_gnss(tmp_path / "gnss.txt")
    assert fixes.notes[0].found == "1 double rows left out, 1 out-of-order rows sorted, of 201"
    assert fixes.height[100:103].tolist() == [600.0, 601.0, 602.0]
    lines = [f"{k}.tif {k}.0\n" for k in range(200)]
    (tmp_path / "events.txt").write_text(
        "".join([*lines[:7], "7.tif 7.5\n", *lines[8:50], lines[49], *lines[50:]])
    )
    events = read_events(tmp_path / "events.txt")
    assert events.images == tuple(f"{k}.tif" for k in range(200))
    assert [note.name for note in events.notes] == ["event rows"]


def test_rows_in_order_are_left_alone() -> None:
    """Oracle: nothing to do."""
    assert put_in_order(NumberedRows("x"), np.arange(5.0), lambda i, k: True, "IMU rows") == (
        None,
        (),
    )


def test_missing_end_of_the_last_line_is_told(tmp_path: Path) -> None:
    """Oracle: the file's last byte; whether 2.5 was 2.55 cannot be known."""
    (tmp_path / "e.txt").write_text("a 1.5\nb 2.5")
    assert "the last line has no line break" in read_events(tmp_path / "e.txt").notes[0].found
    (tmp_path / "e.txt").write_text("a 1.5\nb 2.5\n")
    assert read_events(tmp_path / "e.txt").notes == ()
