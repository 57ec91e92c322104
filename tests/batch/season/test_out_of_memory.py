"""Flights that really take more memory than there is, beside flights that do not."""

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from seasons import copies, short_flight

from insgnss.batch.season.tables import read_season

pytestmark = pytest.mark.slow
ROOM = 2.4e9  # for two workers
GROUPS = Path("/sys/fs/cgroup")

HUNGRY = """
import resource, time
import numpy as np
import insgnss.batch.season.work as work
whole, processed = work.process_task, work._process_flight

def filled(task, size):
    kept = []
    while sum(map(len, kept)) < size:
        kept.append(bytearray(b'\\x01') * (32 << 20))
        time.sleep(0.03)
    return processed(task)

def hungry(task):
    if task.name == 'f001':  # more than there is
        return filled(task, 6e9)
    if task.name == 'f002':  # more than was forecast, and less than there is
        return filled(task, 1.3e9)
    if task.name == 'f003':
        limits = resource.getrlimit(resource.RLIMIT_AS)
        resource.setrlimit(resource.RLIMIT_AS, (8 << 30, limits[1]))
        try:
            np.ones(10 << 30)
        finally:
            resource.setrlimit(resource.RLIMIT_AS, limits)
    return processed(task)

work._process_flight = hungry

def process_task(task):
    return whole(task)
"""
RUN = """
import sys, hungry, insgnss.batch.season.pool as pool
pool.process_task = hungry.process_task
room = float(sys.argv[1])
pool.available = lambda: int(room) or None
from insgnss.cli import main
if __name__ == '__main__':
    sys.exit(main(['batch', '.', '--workers', '2']))
"""


def rows_after(directory: Path, room: float, *before: str) -> dict[str, dict[str, Any]]:
    """Rows by flight of a season on two workers that share the room, 0: of no limit."""
    copies(short_flight(directory), 5)
    (directory / "hungry.py").write_text(HUNGRY)
    (directory / "run.py").write_text(RUN)
    done = subprocess.run(
        [*before, sys.executable, "run.py", str(room)],
        cwd=directory,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(directory), *sys.path])},
    )
    assert done.returncode == 4, done.stdout + done.stderr
    assert done.stderr.count("insgnss: error: ") == 1
    return {row["name"]: row for row in read_season(directory / "season.csv")}


def check_others(rows: dict[str, dict[str, Any]]) -> None:
    """Whatever memory does not hold is one failure each, and names what numpy asked for."""
    failed = [name for name, row in rows.items() if row["status"] != "done"]
    assert failed == ["f001", "f003"], {name: rows[name]["reason"] for name in failed}
    reason = rows["f003"]["reason"]
    assert reason.startswith("memory is exhausted: Unable to allocate 80.0 GiB")
    assert "take a machine with more memory" in reason


def test_who_takes_more_than_its_worker_may_have_is_named_and_nobody_else(tmp_path: Path) -> None:
    """Oracle: 95 % of 2.4 GB, which two workers may take together and one alone: a flight of 1.5 GB
    is done, one of 6 GB fails of memory with the number.
    """
    rows = rows_after(tmp_path, ROOM)
    check_others(rows)
    reason = rows["f001"]["reason"]
    assert reason.startswith("memory: the process of this flight was stopped at 2.")
    assert "it ran alone with a limit of 2.40 GB (memory forecast 0.6 GB)" in reason
    assert "process the flight in parts (start_tow, end_tow)" in reason


@pytest.fixture
def group() -> Iterator[Path]:
    """A control group of 2 GB."""
    parent = GROUPS / "memory" if (GROUPS / "memory").is_dir() else GROUPS
    own = parent / f"insgnss-test-{os.getpid()}"
    limit = "memory.limit_in_bytes" if parent != GROUPS else "memory.max"
    try:
        own.mkdir()
        (own / limit).write_text("2000000000")
    except OSError as error:
        pytest.skip(f"no control group of memory can be made here: {error}")
    yield own
    end = time.monotonic() + 30.0
    while (own / "cgroup.procs").read_text() and time.monotonic() < end:
        time.sleep(0.1)  # the process that cleans up after others ends last
    own.rmdir()


def test_who_is_killed_by_the_kernel_for_memory_is_named_and_nobody_else(
    tmp_path: Path, group: Path
) -> None:
    """Oracle: the kernel's own count of the processes that it ended in the group."""
    enter = ["sh", "-c", f'echo $$ > "{group}/cgroup.procs" && exec "$@"', "sh"]
    rows = rows_after(tmp_path, 0.0, *enter)
    control = group / "memory.oom_control"
    text = (control if control.is_file() else group / "memory.events").read_text()
    assert int(text.rsplit("oom_kill ", 1)[1].split()[0]) >= 2
    check_others(rows)
    reason = rows["f001"]["reason"]
    assert reason.startswith(
        "memory: the system ended the process of this flight for lack of memory (it had "
    )
    assert "GB when last seen); it ran alone" in reason
