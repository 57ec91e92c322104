"""`insgnss batch` on Dask: a cluster of its own, a scheduler with two workers, kills, Ctrl-C."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from oracles import oracle
from seasons import broken, copies, short_flight

from insgnss.season.tables import read_season

pytestmark = pytest.mark.slow
MANY = 200
INSGNSS = [sys.executable, "-m", "insgnss"]


@pytest.fixture(scope="module", autouse=True)
def dask() -> None:
    """Skipped without Dask."""
    oracle("distributed")


def batch(*words: object, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [*INSGNSS, "batch", *map(str, words)]
    return subprocess.run(
        command, cwd=cwd, capture_output=True, text=True, check=False, timeout=500
    )


def started(cwd: Path, *words: object) -> subprocess.Popen[str]:
    """A run whose standard output is read line by line; its workers are in its own session."""
    return subprocess.Popen(
        [*INSGNSS, "batch", *map(str, words)],
        cwd=cwd,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


@pytest.fixture
def scheduler(tmp_path: Path) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """A scheduler and two workers, each a process of its own without a nanny that revives it."""
    address = f"tcp://127.0.0.1:{free_port()}"
    program = [sys.executable, "-m", "distributed.cli.dask_scheduler"]
    worker = [sys.executable, "-m", "distributed.cli.dask_worker", address, "--nthreads", "1"]
    commands = [
        [*program, "--host", "127.0.0.1", "--port", address.rpartition(":")[2], "--no-dashboard"],
        *[[*worker, "--no-dashboard", "--no-nanny"]] * 2,
    ]
    processes = []
    for k, command in enumerate(commands):
        with (tmp_path / f"dask{k}.log").open("wb") as log:
            processes.append(subprocess.Popen(command, stdout=log, stderr=log, cwd=tmp_path))
    yield address, processes[1:]
    for process in reversed(processes):
        process.kill()
        process.wait()


def test_two_hundred_flights_and_a_worker_killed_in_the_middle(
    tmp_path: Path, scheduler: tuple[str, list[subprocess.Popen[bytes]]]
) -> None:
    """Oracle: 199 results and one failure with its reason, whatever happens to a worker; products
    of every flight; nothing is processed twice when the command is given again.
    """
    address, workers = scheduler
    flights = copies(short_flight(tmp_path), MANY)
    broken(flights[2])
    done = 0
    with started(tmp_path, ".", "--scheduler", address) as run:
        assert run.stdout is not None
        for line in run.stdout:
            done += ": done" in line
            if done == 40 and ": done" in line:
                workers[0].kill()
        assert run.wait(timeout=60) == 3
    rows = read_season(tmp_path / "season.csv")
    assert len(rows) == MANY
    assert [row["name"] for row in rows if row["status"] == "failed"] == ["f002"]
    reason = next(row["reason"] for row in rows if row["status"] == "failed")
    assert "axes, vertical" in reason
    assert "correct imu.axes" in reason
    written = [flight / "02_Processed" / "GPS-INS" / "report.html" for flight in flights]
    assert sum(page.is_file() for page in written) == MANY - 1
    page = (tmp_path / "index.html").read_text()
    assert page.index("Failed flights") < page.index("axes, vertical")
    again = batch(".", "--scheduler", address, cwd=tmp_path)
    assert again.returncode == 3
    assert f"{MANY} flights: 0 processed, {MANY - 1} kept" in again.stdout
    assert again.stderr.count("\n") == 1


def test_ctrl_c_ends_calmly_and_the_next_run_goes_on(tmp_path: Path) -> None:
    """Oracle: exit code 130, one line, no process left, whole products, a table of what is done and
    what is not; then a cluster of its own whose worker is killed with SIGKILL, and the rest done.
    """
    flights = copies(short_flight(tmp_path), 16)
    with started(tmp_path, ".", "--workers", 2) as run:
        assert run.stdout is not None
        for line in run.stdout:
            if ": done" in line:
                run.send_signal(signal.SIGINT)
                break
        _, errors = run.communicate(timeout=60)
    assert run.returncode == 130
    assert errors == "insgnss: error: interrupted\n"
    assert none_left(run.pid) == []
    found = [row["status"] for row in read_season(tmp_path / "season.csv")]
    assert len(found) == len(flights)
    assert set(found) == {"done", "not reached"}
    assert "flights were not reached" in (tmp_path / "index.html").read_text()
    output = ""
    with started(tmp_path, ".", "--workers", 2, "--parquet") as run:
        assert run.stdout is not None
        for line in run.stdout:
            output += line
            if output.count(": done") == 2 and ": done" in line:
                os.kill(workers_of(run.pid)[-1], signal.SIGKILL)
        assert run.wait(timeout=60) == 0
    assert "kept, whose inputs, options and version are the same" in output
    assert {row["status"] for row in read_season(tmp_path / "season.csv")} == {"done", "kept"}
    left = [p.name for flight in flights for p in flight.rglob(".insgnss*")]
    assert left == []


def test_a_flight_that_kills_its_workers_is_one_failure(tmp_path: Path) -> None:
    """Oracle: a flight whose worker is killed each time: a failure with the reason; the others are
    done.
    """
    copies(short_flight(tmp_path), 4)
    code = (
        "import os, insgnss.season.work as work\n"
        "whole = work.process_task\n"
        "def deadly(task):\n"
        "    if task.name == 'f001': os.kill(os.getpid(), 9)\n"
        "    return whole(task)\n"
    )
    (tmp_path / "deadly.py").write_text(code)
    script = (
        "import sys, deadly, insgnss.season.engine as engine\n"
        "engine.process_task = deadly.deadly\n"
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
    assert "its worker died 3 times beside other flights and as often alone" in reason
    assert "neither Dask nor the system says that it was for memory (memory forecast 0." in reason


def test_a_scheduler_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    """Oracle: exit code 2 within seconds."""
    (tmp_path / "flight.toml").write_text("")
    start = time.monotonic()
    done = batch(".", "--scheduler", f"tcp://127.0.0.1:{free_port()}", cwd=tmp_path)
    assert (done.returncode, time.monotonic() - start < 60) == (2, True)
    assert done.stderr.count("\n") == 1
    assert "not reached within 10 s" in done.stderr


def test_a_worker_of_several_threads_is_refused(
    tmp_path: Path, scheduler: tuple[str, list[subprocess.Popen[bytes]]]
) -> None:
    """Oracle: a third worker with the four threads that it gets on a machine with four processors:
    warnings of one flight were told of another one.
    """
    address, _ = scheduler
    (tmp_path / "flight.toml").write_text("")
    command = [sys.executable, "-m", "distributed.cli.dask_worker", address, "--nthreads", "4"]
    with (
        (tmp_path / "third.log").open("wb") as log,
        subprocess.Popen([*command, "--no-nanny", "--no-dashboard"], stderr=log) as third,
    ):
        end = time.monotonic() + 30.0
        while b"Registered to" not in (tmp_path / "third.log").read_bytes():
            assert time.monotonic() < end
            time.sleep(0.1)
        done = batch(".", "--scheduler", address, cwd=tmp_path)
        third.kill()
    assert done.returncode == 2
    assert "has 4 threads, 1 is right" in done.stderr
    assert f"`dask worker {address} --nthreads 1 --nworkers 4`" in done.stderr


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
    """Workers of a cluster: processes that multiprocessing has started."""
    return [
        pid
        for pid in of_session(leader)
        if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()
    ]
