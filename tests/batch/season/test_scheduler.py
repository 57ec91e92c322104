"""`insgnss batch --scheduler` on Dask: two workers, kills of a worker and of the scheduler."""

import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from oracles import oracle
from seasons import batch, broken, copies, short_flight, started

from insgnss.batch.season.tables import read_season

pytestmark = pytest.mark.slow
MANY = 200
Cluster = tuple[str, list[subprocess.Popen[bytes]]]


@pytest.fixture(scope="module", autouse=True)
def dask() -> None:
    """Skipped without Dask."""
    oracle("distributed")


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


@pytest.fixture
def scheduler(tmp_path: Path) -> Iterator[Cluster]:
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
    yield address, processes
    for process in reversed(processes):
        process.kill()
        process.wait()


def test_two_hundred_flights_and_a_worker_killed_in_the_middle(
    tmp_path: Path, scheduler: Cluster
) -> None:
    """Oracle: 199 results and one failure with its reason, whatever happens to a worker; products
    of every flight; nothing is processed twice when the command is given again.
    """
    address, (_, worker, _) = scheduler
    flights = copies(short_flight(tmp_path), MANY)
    broken(flights[2])
    done = 0
    with started(tmp_path, ".", "--scheduler", address) as run:
        assert run.stdout is not None
        for line in run.stdout:
            done += ": done" in line
            if done == 40 and ": done" in line:
                worker.kill()
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


def test_a_scheduler_killed_in_the_middle_leaves_table_page_and_one_line(
    tmp_path: Path, scheduler: Cluster
) -> None:
    """Oracle: exit code 4 and a line that names the scheduler; table and page of what is done and
    what is not; the same flights without a scheduler are kept and done.
    """
    address, (program, *_) = scheduler
    flights = copies(short_flight(tmp_path), 24)
    with started(tmp_path, ".", "--scheduler", address) as run:
        assert run.stdout is not None
        for line in run.stdout:
            if ": done" in line:
                program.send_signal(signal.SIGKILL)
                break
        _, errors = run.communicate(timeout=60)
    assert run.returncode == 4, errors
    assert errors.count("\n") == 1
    assert f"--scheduler {address}: the scheduler ended or cannot be reached" in errors
    found = [row["status"] for row in read_season(tmp_path / "season.csv")]
    assert len(found) == len(flights)
    assert set(found) == {"done", "not reached"}
    assert "flights were not reached" in (tmp_path / "index.html").read_text()
    again = batch(".", cwd=tmp_path)
    assert (again.returncode, again.stderr) == (0, "")
    assert {row["status"] for row in read_season(tmp_path / "season.csv")} == {"done", "kept"}


def test_a_scheduler_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    """Oracle: exit code 2 within seconds."""
    (tmp_path / "flight.toml").write_text("")
    start = time.monotonic()
    done = batch(".", "--scheduler", f"tcp://127.0.0.1:{free_port()}", cwd=tmp_path)
    assert (done.returncode, time.monotonic() - start < 60) == (2, True)
    assert done.stderr.count("\n") == 1
    assert "not reached within 10 s" in done.stderr


def test_a_worker_of_several_threads_is_refused(tmp_path: Path, scheduler: Cluster) -> None:
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
    assert "has 4 threads, but must have 1" in done.stderr
    assert f"`dask worker {address} --nthreads 1 --nworkers 4`" in done.stderr
