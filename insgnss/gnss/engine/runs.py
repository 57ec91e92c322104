"""Runs of RTKLIB in processes of their own: inputs in a directory, a time limit, how each ends.

Two processes run at a time. Inputs are put beside each other in a directory that exists as long as
the runs, under plain names and unpacked, as RTKLIB takes `%` and `*` in paths for its own and
unpacks by shell. What the engine reports is not trusted: postpos() and rnx2rtkp return 0 without
inputs, so that each output must exist and have epochs.
"""

import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from contextvars import copy_context
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from ...base.advance import share
from ...base.errors import DataError, OptionError
from ...base.output.scratch import refuse_cut_off
from ...base.wording import named
from ...io.formats.gnss.rtklib_pos import read_rtklib_pos
from ...records import GnssFixes
from ..options import ANTENNAS, EngineOptions, single_point_file
from ..rinex.navigation_message import navigation_bytes
from ..rinex.observation_record import Observations
from .preflight import absolute, interval
from .program import OF_ALL_VERSIONS, binary

Source = str | Path
Progress = Callable[[str], None]

PROCESSES = 2  # forward and backward run at a time
WATCHED_S = 0.5  # between two looks at how far the engine is
REFUSED = re.compile(r"invalid option value (\S+)")
UNKNOWN_OPTION = 2  # exit code of our worker for an option that its RTKLIB does not have
WHERE = "where_"  # runs that find where a receiver stands
POLL_S = 0.02  # s between two looks whether a process has ended
THINNED = 60  # least epochs of a position by codes where they are thinned
# bytes of an output where refusals stand; characters quoted of its end
OUTPUT_HEAD_BYTES, TAIL = 8192, 200


class RunEnd(NamedTuple):
    """How a run ended: CPU seconds (not a number where the system does not report them), the last
    line of its output, options whose values it refused.
    """

    cpu_s: float
    last_line: str = ""
    refused: tuple[str, ...] = ()

    @property
    def statement(self) -> str:
        """What it said at last."""
        return f"it said: {self.last_line or 'nothing'}"


@dataclass(frozen=True)
class Runs:
    """Runs of one engine in one directory for scratch."""

    command: Sequence[str]
    scratch: Path
    options: EngineOptions

    def stage(self, observed: Sequence[bytes], navigation: Sequence[Source]) -> list[str]:
        """Put the inputs into the directory: observations of rover and base as `normalised` has
        them, navigation unpacked; their names there."""
        names = ["rover.obs", "base.obs"]
        names += [f"navigation{k}.nav" for k in range(1, len(navigation) + 1)]
        contents = (*observed, *map(navigation_bytes, navigation))
        for name, content in zip(names, contents, strict=True):
            (self.scratch / name).write_bytes(content)
        if self.options.antex is not None:
            shutil.copyfile(self.options.antex, self.scratch / ANTENNAS)
        return names

    def single_points(
        self, name: str, navigation: Sequence[str], observations: Observations
    ) -> GnssFixes:
        """Positions of a receiver by codes alone, at some 60 epochs; name.obs is its file."""
        stamps = absolute(observations)
        thinned = next(
            (s for s in (1.0, 5.0, 10.0, 30.0) if s * THINNED > stamps[-1] - stamps[0]), 30.0
        )
        where = self.scratch / f"{WHERE}{name}.pos"
        where.with_suffix(".conf").write_text(single_point_file(self.options), encoding="utf-8")
        # thinned are epochs on full seconds
        for every in (thinned, 0.0) if interval(observations) < thinned else (0.0,):
            try:
                end = self.run(where.stem, [f"{name}.obs", *navigation], threading.Event(), every)
            except DataError as refusal:
                self._check_program(str(refusal))
                raise
            if _has_epochs(where):
                return read_rtklib_pos(where)
            self._check_program(end.statement)
        message = (
            "no position from codes; check that the file has codes and that the navigation files"
            " cover its satellites"
        )
        raise DataError(f"{observations.header.path}: {message}")

    def _check_program(self, statement: str) -> None:
        """UsageError where a program has left no output yet and does not hold RTKLIB's options, as
        a wrapper would not either.
        """
        silent = not any(self.scratch.glob("*.pos"))
        if (
            silent
            and self.command[0] != sys.executable
            and OF_ALL_VERSIONS not in binary(Path(self.command[0]))
        ):
            message = "left no solution and shows none of RTKLIB's options: is it an rnx2rtkp?"
            raise OptionError("gnss.engine", f"{message} {statement}", self.command[0])

    def both(
        self, texts: Mapping[str, str], names: Sequence[str], epochs: int, say: Progress
    ) -> dict[str, RunEnd]:
        """The end of each run over so many epochs; the first error ends the others."""
        for direction, text in texts.items():
            (self.scratch / f"{direction}.conf").write_text(text, encoding="utf-8")
        stop = threading.Event()
        ends: dict[str, RunEnd] = {}
        with ThreadPoolExecutor(PROCESSES) as pool:
            jobs = {
                pool.submit(copy_context().run, self.solution, direction, names, stop): direction
                for direction in texts
            }
            running = set(jobs)
            try:
                while running:
                    ended, running = wait(running, WATCHED_S, FIRST_COMPLETED)
                    for job in ended:
                        ends[jobs[job]] = job.result()
                        say(f"engine: {jobs[job]} solution, {len(ends)} of {len(jobs)}")
                    written = [self._epochs_of(jobs[job]) / epochs for job in running]
                    share(min([*written, 1.0]))
            finally:
                stop.set()
        return {direction: ends[direction] for direction in texts}

    def _epochs_of(self, direction: str) -> int:
        """How many epochs a run that has not ended has written."""
        path = self.scratch / f"{direction}.pos"
        return path.read_bytes().count(b"\n") if path.is_file() else 0

    def solution(self, direction: str, names: Sequence[str], stop: threading.Event) -> RunEnd:
        """The end of a run whose output has epochs; DataError where it has none."""
        if stop.is_set():
            return RunEnd(math.nan)
        end = self.run(direction, names, stop)
        if not stop.is_set() and not _has_epochs(self.scratch / f"{direction}.pos"):
            message = (
                "the engine solved no epoch, although rover, base and navigation overlap in time;"
                f" do they have satellites in common? {end.statement}"
            )
            raise DataError(f"{direction} solution: {message}")
        return end

    def run(
        self, name: str, files: Sequence[str], stop: threading.Event, every: float = 0.0
    ) -> RunEnd:
        """Run the engine on name.conf to name.pos, on epochs `every` s (0: all). DataError,
        OptionError for a bad end.
        """
        if self.command[0] == sys.executable:
            line = [*self.command, f"{name}.conf", f"{name}.pos", f"{every:g}", *files]
        else:
            thinning = ["-ti", f"{every:g}"] if every else []
            line = [*self.command, "-k", f"{name}.conf", *thinning, "-o", f"{name}.pos", *files]
        with tempfile.TemporaryFile() as output:
            to: dict[str, Any] = dict.fromkeys(("stdout", "stderr"), output)
            process = subprocess.Popen(
                line, cwd=self.scratch, env=_environment(), stdin=subprocess.DEVNULL, **to
            )
            try:
                cpu = _wait(process, time.monotonic() + self.options.timeout_s, stop)
            finally:
                if process.returncode is None:
                    process.kill()
                    process.wait()
            end = RunEnd(math.nan if cpu is None else cpu, _tail(output), _refused(output))
        if wrong := [option for option in end.refused if option in self.options.rtklib_options]:
            problem = f"the engine refused {wrong[0]} = {self.options.rtklib_options[wrong[0]]}"
            raise OptionError("gnss.rtklib_options", problem)
        if process.returncode == 0 and (written := self.scratch / f"{name}.pos").is_file():
            refuse_cut_off(written)
        if process.returncode == 0 or stop.is_set():
            return end
        if process.returncode == UNKNOWN_OPTION and self.command[0] == sys.executable:
            raise OptionError("gnss.rtklib_options", end.last_line)
        receiver = name.removeprefix(WHERE)
        of_what = f"{name} solution" if receiver == name else f"position of the {receiver} by codes"
        message = f"the engine {self._end(process.returncode, cpu)}; {end.statement}"
        raise DataError(f"{of_what}: {message}")

    def _end(self, code: int, cpu: float | None) -> str:
        if cpu is None:
            return (
                f"did not finish in {self.options.timeout_s:g} s; raise {named('gnss.timeout_s')}"
            )
        return f"was ended by signal {-code}" if code < 0 else f"stopped with exit code {code}"


def _environment() -> dict[str, str]:
    """The environment, with the package where a Python in another directory finds it."""
    paths = [str(Path(__file__).resolve().parents[3]), os.environ.get("PYTHONPATH", "")]
    return os.environ | {"PYTHONPATH": os.pathsep.join(path for path in paths if path)}


def _wait(
    process: "subprocess.Popen[bytes]", deadline: float, stop: threading.Event
) -> float | None:
    """CPU seconds of the process when it has ended, NaN where the system does not report them; None
    past the deadline or when `stop` is set.
    """
    while time.monotonic() < deadline and not stop.is_set():
        if not hasattr(os, "wait4"):
            if process.poll() is not None:
                return math.nan
        else:
            pid, status, usage = os.wait4(process.pid, os.WNOHANG)
            if pid:
                process.returncode = os.waitstatus_to_exitcode(status)
                return usage.ru_utime + usage.ru_stime
        time.sleep(POLL_S)
    return None


def _tail(output: BinaryIO) -> str:
    """The last line that is not empty, of the last 200 characters; RTKLIB ends its lines by
    carriage returns.
    """
    output.seek(0, os.SEEK_END)
    output.seek(max(output.tell() - 10 * TAIL, 0))
    lines = re.split(r"[\r\n]+", output.read().decode("utf-8", errors="replace"))
    return next((line.strip()[-TAIL:] for line in reversed(lines) if line.strip()), "")


def _refused(output: BinaryIO) -> tuple[str, ...]:
    """Options whose values the engine did not take, which it says before anything else."""
    output.seek(0)
    return tuple(REFUSED.findall(output.read(OUTPUT_HEAD_BYTES).decode("utf-8", errors="replace")))


def _has_epochs(path: Path) -> bool:
    if not path.is_file():
        return False
    with path.open("rb") as stream:
        return any(line.strip() and not line.startswith(b"%") for line in stream)
