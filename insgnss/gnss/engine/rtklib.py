"""RTKLIB in processes of its own: forward and backward solutions of a rover against a base
(`Runs`, by the program of `program` with the option file of `options`), and their combination
(`combine_solutions`).

RTKLIB is global state without threads, and goes on without an option that it does not know. Choices
are given by number, as their words differ between versions.

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
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from contextvars import copy_context
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from ...base.advance import share
from ...base.errors import DataError, InputError, OptionError, UsageError
from ...base.files import atomic_write
from ...base.output.scratch import refuse_cut_off, scratch_directory
from ...base.wording import spell
from ...io.formats.gnss.rtklib_pos import PosRows, read_rtklib_pos
from ...records import Finding, GnssFixes, Question
from ..options import (
    ANTENNAS,
    KINEMATIC_MODE,
    PASSES_OF_ENGINE,
    EngineOptions,
    check_dynamics,
    option_file,
    single_point_file,
)
from ..rinex.navigation_message import navigation_bytes, read_navigation
from ..rinex.observation_record import Observations
from ..rinex.observations import read_observations
from .base_coordinates import Whereabouts, check_base_place
from .combined import combine_solutions
from .normalised import engine_observations
from .preflight import absolute, check_navigation, check_observations, interval, within_navigation
from .program import OF_ALL_VERSIONS, binary, check_names, check_version, engine_command, version

Source = str | Path
Progress = Callable[[str], None]

PROCESSES = 2  # forward and backward run at a time
WATCHED_S = 0.5  # between two looks at how far the engine is
REFUSED = re.compile(r"invalid option value (\S+)")
UNKNOWN_OPTION = 2  # exit code of our worker for an option that its RTKLIB does not have
WHERE = "where_"  # runs that find where a receiver stands
POLL_S = 0.02  # s between two looks whether a process has ended
INTERVALS_S = (1.0, 5.0, 10.0, 30.0)  # s, of thinned epochs: those at which receivers log
THINNED = 60  # least epochs of a position by codes where they are thinned
# bytes of an output where refusals stand; characters quoted of its end, and bytes that hold them
OUTPUT_HEAD_BYTES, TAIL, TAIL_BYTES = 8192, 200, 2000


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
        """Write the inputs into the directory and return their names.

        Observations of rover and base are as `normalised` has them, navigation is unpacked.
        """
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
        """Return positions by codes alone, at some 60 epochs, of the receiver of name.obs."""
        stamps = absolute(observations)
        span_s = stamps[-1] - stamps[0]
        thinned = next((s for s in INTERVALS_S if s * THINNED > span_s), INTERVALS_S[-1])
        path = self.scratch / f"{WHERE}{name}.pos"
        path.with_suffix(".conf").write_text(single_point_file(self.options), encoding="utf-8")
        # only epochs on full seconds remain, and there may be none of them: then all are taken
        for interval_s in (thinned, 0.0) if interval(observations) < thinned else (0.0,):
            files = [f"{name}.obs", *navigation]
            try:
                end = self.run(path.stem, files, threading.Event(), interval_s)
            except DataError as refusal:
                self._check_program(str(refusal))
                raise
            if _has_epochs(path):
                return read_rtklib_pos(path)
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
        if (
            not any(self.scratch.glob("*.pos"))
            and self.command[0] != sys.executable
            and OF_ALL_VERSIONS not in binary(Path(self.command[0]))
        ):
            message = "left no solution and shows none of RTKLIB's options: is it an rnx2rtkp?"
            raise OptionError("gnss.engine", f"{message} {statement}", self.command[0])

    def both(
        self, texts: Mapping[str, str], names: Sequence[str], epochs: int, say: Progress
    ) -> dict[str, RunEnd]:
        """Run each direction over so many epochs and return how it ended; an error ends all."""
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
        """Count the epochs that a run that has not ended has written."""
        path = self.scratch / f"{direction}.pos"
        return path.read_bytes().count(b"\n") if path.is_file() else 0

    def solution(self, direction: str, names: Sequence[str], stop: threading.Event) -> RunEnd:
        """Run one direction and return how it ended; DataError where its output has no epochs."""
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
            command = [*self.command, f"{name}.conf", f"{name}.pos", f"{every:g}", *files]
        else:
            thinning = ["-ti", f"{every:g}"] if every else []
            command = [*self.command, "-k", f"{name}.conf", *thinning, "-o", f"{name}.pos", *files]
        with tempfile.TemporaryFile() as output:
            streams: dict[str, Any] = dict.fromkeys(("stdout", "stderr"), output)
            process = subprocess.Popen(
                command, cwd=self.scratch, env=_environment(), stdin=subprocess.DEVNULL, **streams
            )
            try:
                cpu = _wait_for_cpu_s(process, time.monotonic() + self.options.timeout_s, stop)
            finally:
                if process.returncode is None:
                    process.kill()
                    process.wait()
            end = RunEnd(
                math.nan if cpu is None else cpu, _last_line(output), _refused_options(output)
            )
        if refused := [option for option in end.refused if option in self.options.rtklib_options]:
            problem = f"the engine refused {refused[0]} = {self.options.rtklib_options[refused[0]]}"
            raise OptionError("gnss.rtklib_options", problem)
        written = self.scratch / f"{name}.pos"
        if process.returncode == 0 and written.is_file():
            refuse_cut_off(written)
        if process.returncode == 0 or stop.is_set():
            return end
        if process.returncode == UNKNOWN_OPTION and self.command[0] == sys.executable:
            raise OptionError("gnss.rtklib_options", end.last_line)
        receiver = name.removeprefix(WHERE)
        subject = f"{name} solution" if receiver == name else f"position of the {receiver} by codes"
        message = f"the engine {self._exit_words(process.returncode, cpu)}; {end.statement}"
        raise DataError(f"{subject}: {message}")

    def _exit_words(self, code: int, cpu: float | None) -> str:
        """Return how the engine ended: by its exit code, or past the deadline (`cpu` None)."""
        if cpu is None:
            return (
                f"did not finish in {self.options.timeout_s:g} s; raise {spell('gnss.timeout_s')}"
            )
        return f"was ended by signal {-code}" if code < 0 else f"stopped with exit code {code}"


def _environment() -> dict[str, str]:
    """Return the environment, with the package where a Python in another directory finds it."""
    paths = [str(Path(__file__).resolve().parents[3]), os.environ.get("PYTHONPATH", "")]
    return os.environ | {"PYTHONPATH": os.pathsep.join(path for path in paths if path)}


def _wait_for_cpu_s(
    process: "subprocess.Popen[bytes]", deadline: float, stop: threading.Event
) -> float | None:
    """Wait for the process and return its CPU time, s, NaN where the system does not report it.

    It is None past the deadline (s, monotonic) or when `stop` is set.
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


def _last_line(output: BinaryIO) -> str:
    """Return the end of the last line that is not empty, at most `TAIL` characters.

    RTKLIB ends its lines by carriage returns.
    """
    output.seek(0, os.SEEK_END)
    output.seek(max(output.tell() - TAIL_BYTES, 0))
    lines = re.split(r"[\r\n]+", output.read().decode("utf-8", errors="replace"))
    return next((line.strip()[-TAIL:] for line in reversed(lines) if line.strip()), "")


def _refused_options(output: BinaryIO) -> tuple[str, ...]:
    """Return the options whose values the engine refused, which its output names first."""
    output.seek(0)
    return tuple(REFUSED.findall(output.read(OUTPUT_HEAD_BYTES).decode("utf-8", errors="replace")))


def _has_epochs(path: Path) -> bool:
    if not path.is_file():
        return False
    with path.open("rb") as stream:
        return any(line.strip() and not line.startswith(b"%") for line in stream)


@dataclass(frozen=True)
class EngineRun:
    """Output of the engine and how it was computed.

    Parameters
    ----------
    combined, forward, backward : Path
        The .pos files (week, time of week, degrees, ellipsoidal heights); the first is ours, of
        the two others.
    engine : str
        The engine with its version as it writes it.
    cpu_s : float
        CPU time of the two runs, s, NaN where the system does not report it.
    cpu_of : mapping
        CPU time of each run, s, by direction.
    option_files : mapping
        Option files by direction.
    rows : mapping
        Rows of combined, forward and backward as numbers.
    checks : tuple of Finding
        Findings to report.
    codes : tuple of str
        Codes of the phases of rover and base that the engine had, by system.
    """

    combined: Path
    forward: Path
    backward: Path
    engine: str
    cpu_s: float
    cpu_of: Mapping[str, float]
    option_files: Mapping[str, Path]
    rows: Mapping[str, PosRows]
    checks: tuple[Finding, ...] = ()
    codes: tuple[str, ...] = ("", "")


def solve(
    rover: Source,
    base: Source,
    navigation: Source | Iterable[Source],
    options: EngineOptions,
    directory: Source,
    progress: Progress | None = None,
    observations: tuple[Observations, Observations] | None = None,
) -> EngineRun:
    """Solve the positions of the rover's antenna by two runs of the engine, and combine them.

    They are written to combined.pos, forward.pos and backward.pos of `directory`, with the option
    files of the runs, all in order of time.

    Parameters
    ----------
    rover, base : path-like
        RINEX 2 or 3 observations, plain or packed.
    navigation : path-like or iterable of these
        RINEX 2, 3 or 4 navigation files, plain or packed.
    options : EngineOptions
        Options of the engine.
    directory : path-like
        Gets the files.
    progress : callable, optional
        Is called with the name of each step.
    observations : tuple of Observations, optional
        Of rover and base, where the caller has read them.

    Raises
    ------
    UsageError
        Without an engine.
    InputError
        For inputs that do not belong together.
    DataError
        Where the engine gives no epochs, does not finish in options.timeout_s, or stops.
    """
    say = progress or (lambda _: None)
    command = engine_command(options.engine)
    files = [navigation] if isinstance(navigation, str | Path) else list(navigation)
    if not files:
        raise InputError(
            f"{rover}: no navigation file; give the broadcast ephemerides (.nav, .n, .g, .p) of"
            " that day"
        )
    broadcast = read_navigation(files)
    moving, standing = observations or (
        within_navigation(read_observations(path), broadcast) for path in (rover, base)
    )
    checks = [] if observations else [*moving.notes, *standing.notes]
    intervals = interval(moving), interval(standing)
    checks += check_observations(moving, standing, options)
    checks += check_navigation(broadcast, moving, options)
    checks += check_dynamics(options, intervals[0])
    texts: dict[str, str] = {
        direction: option_file(options, standing.header, direction, *intervals)
        for direction in PASSES_OF_ENGINE
    }
    checks += check_names(command, texts["forward"], options)
    target = _make_directory(Path(directory))
    observed, codes = zip(*map(engine_observations, (moving, standing)), strict=True)
    with scratch_directory(target) as scratch:
        runs = Runs(command, scratch, options)
        names = runs.stage(observed, files)

        def whereabouts(observations: Observations) -> Whereabouts:
            name = "rover" if observations is moving else "base"
            return Whereabouts.of(
                runs.single_points(name, names[2:], observations), observations, broadcast
            )

        checks += check_base_place(moving, standing, options, whereabouts)
        ends = runs.both(texts, names, absolute(moving).size, say)
        cpu = {direction: end.cpu_s for direction, end in ends.items()}
        engine = version(runs.scratch / "forward.pos", command)
        for direction, text in texts.items():
            atomic_write(target / f"{direction}.conf", text)
            atomic_write(
                target / f"{direction}.pos", _lines_by_time(runs.scratch / f"{direction}.pos")
            )
    pos = {name: target / f"{name}.pos" for name in ("combined", *PASSES_OF_ENGINE)}
    is_kinematic = f"pos1-posmode={KINEMATIC_MODE}" in texts["forward"].splitlines()
    solution = combine_solutions(pos["forward"], pos["backward"], pos["combined"], is_kinematic)
    atomic_write(pos["combined"], solution.lines)
    option_files: dict[str, Path] = {
        direction: target / f"{direction}.conf" for direction in PASSES_OF_ENGINE
    }
    checks += [*_check_refused(ends), *check_version(engine)]
    return EngineRun(
        **pos,
        engine=engine,
        cpu_s=sum(cpu.values()),
        cpu_of=cpu,
        option_files=option_files,
        rows=solution.rows,
        checks=tuple(checks),
        codes=codes,
    )


def _make_directory(directory: Path) -> Path:
    """Make the directory where it does not exist; UsageError where that fails."""
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(
            f"{directory}: no directory can be made there: {error.strerror or error}; give"
            " another one"
        ) from None
    return directory


def _check_refused(ends: Mapping[str, "RunEnd"]) -> tuple[Finding, ...]:
    names = sorted({name for end in ends.values() for name in end.refused})
    if not names:
        return ()
    advice = "the engine uses its own defaults instead; RTKLIB EX 2.5.0 accepts these values"
    finding = f"values that it refused: {' '.join(names)}"
    return (Question("engine options", "values that it takes").note(finding, advice),)


def _lines_by_time(path: Path) -> list[bytes]:
    """Return the lines of an output in order of time.

    RTKLIB writes those of a backward run from the last epoch to the first.
    """
    lines = path.read_bytes().splitlines(keepends=True)
    header = [line for line in lines if line.startswith(b"%")]
    rows = [line for line in lines if not line.startswith(b"%") and line.strip()]
    first_stamp, last_stamp = ([float(field) for field in rows[k].split()[:2]] for k in (0, -1))
    return header + (rows if first_stamp <= last_stamp else rows[::-1])
