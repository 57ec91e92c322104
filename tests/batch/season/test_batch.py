"""`insgnss batch` on processes of this machine: no port, kills, Ctrl-C."""

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from seasons import batch, copies, short_flight, started

from insgnss.batch.season.tables import read_season

pytestmark = pytest.mark.slow


def test_neither_a_port_is_opened_nor_dask_loaded(tmp_path: Path) -> None:
    """Oracle: the sockets of every process of the run, by /proc/net; a Dask that cannot be
    imported; the table in the order of the flights.
    """
    for name in ("dask", "distributed"):
        (tmp_path / f"{name}.py").write_text("raise ImportError")
    copies(short_flight(tmp_path), 4)
    looked = 0
    with started(tmp_path, ".", "--workers", 2) as run:
        assert run.stdout is not None
        for line in run.stdout:
            if ": done" in line:
                looked += len(workers_of(run.pid))
                assert ports_of(of_session(run.pid)) == []
        assert run.wait(timeout=60) == 0
    assert looked >= 4
    rows = read_season(tmp_path / "season.csv")
    assert [row["name"] for row in rows] == ["f000", "f001", "f002", "f003"]


@pytest.mark.parametrize(
    ("number", "code", "word"),
    [(signal.SIGINT, 130, "interrupted"), (signal.SIGTERM, 143, "terminated")],
)
def test_ctrl_c_and_sigterm_end_calmly_and_the_next_run_goes_on(
    tmp_path: Path, number: signal.Signals, code: int, word: str
) -> None:
    """Oracle: exit code, one line, no process left, whole products and nothing half written, a
    table of what is done and what is not; Ctrl-C reaches the workers as well. Then the rest is.
    """
    flights = copies(short_flight(tmp_path), 8)
    with started(tmp_path, ".", "--workers", 2) as run:
        assert run.stdout is not None
        for line in run.stdout:
            if ": done" in line:
                whole = number == signal.SIGINT
                os.killpg(run.pid, number) if whole else run.send_signal(number)
                break
        _, errors = run.communicate(timeout=60)
    assert run.returncode == code
    assert errors == f"insgnss: error: {word}\n"
    assert none_left(run.pid) == []
    assert [p.name for flight in flights for p in flight.rglob(".insgnss*")] == []
    found = [row["status"] for row in read_season(tmp_path / "season.csv")]
    assert len(found) == len(flights)
    assert set(found) == {"done", "not reached"}
    assert "flights were not reached" in (tmp_path / "index.html").read_text()
    again = batch(".", "--workers", 2, "--parquet", cwd=tmp_path)
    assert (again.returncode, again.stderr) == (0, "")
    assert "kept, with unchanged inputs, options and version" in again.stdout
    assert {row["status"] for row in read_season(tmp_path / "season.csv")} == {"done", "kept"}


def test_a_run_killed_leaves_no_worker_and_a_worker_killed_no_failure(tmp_path: Path) -> None:
    """Oracle: the processes of the session; then the flight whose worker is killed is done."""
    flights = copies(short_flight(tmp_path), 8)
    with started(tmp_path, ".", "--workers", 2) as run:
        assert run.stdout is not None
        assert any(": done" in line for line in run.stdout)
        run.kill()
    assert none_left(run.pid) == []
    output = ""
    with started(tmp_path, ".", "--workers", 2) as run:
        assert run.stdout is not None
        for line in run.stdout:
            output += line
            if output.count(": done") == 2 and ": done" in line:
                os.kill(workers_of(run.pid)[-1], signal.SIGKILL)
        assert run.wait(timeout=60) == 0
    assert {row["status"] for row in read_season(tmp_path / "season.csv")} == {"done", "kept"}
    assert [p.name for flight in flights for p in flight.rglob(".insgnss*")] == []


def test_a_flight_that_kills_its_workers_is_one_failure(tmp_path: Path) -> None:
    """Oracle: a flight whose worker is killed each time: a failure with the reason; the others are
    done.
    """
    copies(short_flight(tmp_path), 4)
    code = (
        "import os, insgnss.batch.season.work as work\n"
        "whole = work.process_task\n"
        "def deadly(task):\n"
        "    if task.name == 'f001': os.kill(os.getpid(), 9)\n"
        "    return whole(task)\n"
    )
    (tmp_path / "deadly.py").write_text(code)
    script = (
        "import sys, deadly, insgnss.batch.season.pool as pool\n"
        "pool.process_task = deadly.deadly\n"
        "from insgnss.cli import main\n"
        "if __name__ == '__main__': sys.exit(main(['batch', '.', '--workers', '2', '--json']))\n"
    )
    (tmp_path / "run.py").write_text(script)
    done = subprocess.run(
        [sys.executable, "run.py"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])},
    )
    assert done.returncode == 4, done.stderr
    document = json.loads(done.stdout)
    failed = [row for row in document["flights"] if row["status"] == "failed"]
    assert failed[0]["name"] == "f001"
    assert len(failed) == 1, [(row["name"], row["reason"]) for row in failed]
    assert all(row["reason"] for row in failed)
    reason = next(row["reason"] for row in document["flights"] if row["name"] == "f001")
    assert "the process of this flight died again when it ran alone, by SIGKILL" in reason
    assert "the system reports no lack of memory (memory forecast 0." in reason


def ports_of(processes: list[int]) -> list[str]:
    """Lines of /proc/net on TCP and UDP whose sockets belong to one of some processes."""
    own = set()
    for pid in processes:
        for entry in Path(f"/proc/{pid}/fd").iterdir():
            with contextlib.suppress(OSError):
                own |= set(re.findall(r"socket:\[(\d+)\]", os.readlink(entry)))
    tables = [Path("/proc/net") / name for name in ("tcp", "tcp6", "udp", "udp6")]
    lines = [line for table in tables if table.is_file() for line in table.read_text().splitlines()]
    return [line for line in lines if own & set(line.split())]


def of_session(leader: int) -> list[int]:
    """Processes of a session, by /proc."""
    out = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                fields = (entry / "stat").read_text().rpartition(")")[2].split()
            except OSError:
                continue
            if int(fields[3]) == leader and fields[0] != "Z":
                out.append(int(entry.name))
    return out


def none_left(leader: int) -> list[str]:
    """Commands of a session that do not end within ten seconds.

    The process of multiprocessing that cleans up after others ends once it has seen them end.
    """
    end = time.monotonic() + 10.0
    while (left := of_session(leader)) and time.monotonic() < end:
        time.sleep(0.1)
    return [Path(f"/proc/{pid}/cmdline").read_text().replace("\0", " ") for pid in left]


def workers_of(leader: int) -> list[int]:
    """Workers of a run: processes that multiprocessing has started."""
    return [
        pid
        for pid in of_session(leader)
        if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()
    ]
