"""How many flights run side by side, and the forecast of their memory, without processes."""

import sys
from pathlib import Path

import numpy as np
import pytest

from insgnss.base.errors import UsageError
from insgnss.batch.season.pool import next_flight
from insgnss.batch.season.run import rows_of
from insgnss.batch.season.scheduler import run_on_scheduler
from insgnss.batch.season.work import Task

GB = 1e9


def tasks(*gigabytes: float) -> list[Task]:
    return [Task(str(k), "", forecast_bytes=g * GB) for k, g in enumerate(gigabytes)]


def test_flights_run_side_by_side_as_far_as_memory_holds_their_forecasts() -> None:
    """Oracle: by hand: of 10 GB nine may be taken; a flight of 4 GB waits beside 6 GB and has those
    after it not wait; one of 30 GB runs once no other does.
    """
    given = tasks(4.0, 30.0, 3.0)
    assert next_flight(given, tasks(6.0), 10 * GB) is given[2]
    assert next_flight(given, tasks(5.0), 10 * GB) is given[0]
    assert next_flight(given, tasks(3.0, 3.5), 10 * GB) is None
    assert next_flight(given[1:2], [], 10 * GB) is given[1]
    assert next_flight(given, tasks(30.0), None) is given[0]
    assert next_flight([], [], 10 * GB) is None


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
    with pytest.raises(UsageError, match=r"needs Dask.*pip install 'insgnss\[batch\]'"):
        run_on_scheduler([], "tcp://127.0.0.1:1", lambda _: None, lambda: None)
