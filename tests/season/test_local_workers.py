"""How many flights run side by side, and the forecast of their memory, without a cluster."""

import sys
from pathlib import Path

import numpy as np
import pytest

from insgnss.base.errors import UsageError
from insgnss.season.engine import cluster, local_workers, portions
from insgnss.season.forecast import rows_of
from insgnss.season.work import Task

GB = 1e9


def tasks(*gigabytes: float) -> list[Task]:
    return [Task(str(k), "", forecast_bytes=g * GB) for k, g in enumerate(gigabytes)]


@pytest.mark.parametrize(
    ("forecasts", "wanted", "room_gb", "count", "limited_by"),
    [
        ((1.0,) * 9, 4, 100.0, 4, "processors"),
        ((1.0,) * 3, 4, 100.0, 3, "flights"),
        ((1.0, 1.0, 4.0, 1.0), 4, 10.0, 2, "memory"),
        ((30.0,) * 4, 4, 10.0, 1, "memory"),
    ],
)
def test_processors_flights_and_memory_limit_them(
    forecasts: tuple[float, ...], wanted: int, room_gb: float, count: int, limited_by: str
) -> None:
    """Oracle: the least of processors, flights, and nine tenths of memory over the largest."""
    workers = local_workers(tasks(*forecasts), wanted, int(room_gb * GB))
    assert (workers.count, workers.limited_by) == (count, limited_by)
    assert workers.memory_bytes == pytest.approx(room_gb * GB / count)


def test_one_large_flight_does_not_have_all_others_wait() -> None:
    """Oracle: by hand: of 10 GB nine may be taken, by four workers 2.25 GB each; the flights of 4
    and 8 GB run by themselves, one at a time, with all of it.
    """
    given = tasks(1.0, 4.0, 2.0, 8.0, 1.5, 1.0)
    (small, first), (large, then) = portions(given, 4, int(10 * GB))
    assert [task.forecast_bytes / GB for task in small] == [1.0, 2.0, 1.5, 1.0]
    assert [task.forecast_bytes / GB for task in large] == [4.0, 8.0]
    assert (first.count, then.count, then.limited_by) == (4, 1, "memory")
    assert then.memory_bytes == first.alone.memory_bytes == 10 * GB
    ((whole, workers),) = portions(given, 4, int(100 * GB))
    assert (list(whole), workers.count) == (given, 4)
    ((whole, workers),) = portions(tasks(8.0, 8.0), 4, int(10 * GB))
    assert (len(whole), workers.count) == (2, 1)


def test_rows_are_counted_by_the_size_of_a_file(tmp_path: Path) -> None:
    """Oracle: the lines of a file that is longer than what is looked at, and rows of doubles."""
    text, array = tmp_path / "imu.csv", tmp_path / "imu.bin"
    text.write_text("".join(f"{k:06d},1,2,3,4,5,6\n" for k in range(20_000)))
    assert rows_of(text) == pytest.approx(20_000, rel=0.001)
    array.write_bytes(np.zeros((100, 7)).tobytes())
    assert rows_of(array) == 100
    assert rows_of(tmp_path / "none") == rows_of(None) == 0


def test_without_dask_one_line_says_how_to_have_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: the message; None in sys.modules is how Python is told that there is none."""
    monkeypatch.setitem(sys.modules, "dask", None)
    with (
        pytest.raises(UsageError, match=r"needs Dask.*pip install 'insgnss\[batch\]'"),
        cluster(local_workers(tasks(1.0), 1), None),
    ):
        pass
