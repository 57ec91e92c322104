"""RTKLIB in processes of its own: forward and backward solutions of a rover against a base, and
their combination (`combined`).

RTKLIB is global state without threads; two processes run at a time. The engine is the wheel
pyrtklib5 (RTKLIB EX 2.5.0; extra [ppk]) or, where it is not installed, any rnx2rtkp on PATH with
the same option file (`options`). Inputs are put beside each other in a directory that exists as
long as the runs, under plain names and unpacked, as RTKLIB takes `%` and `*` in paths for its own
and unpacks by shell. What the engine reports is not trusted: postpos() and rnx2rtkp return 0
without inputs, so that each output must exist and have epochs. They return 0, too, where they go on
without an option. A choice that a version does not know it writes down before it begins, and it is
reported here; a name that it does not know an rnx2rtkp leaves out without a word, so that names are
looked for in the program itself (2.4.3 b34 lacks pos2-arthresmin and -arthresmax, which are of EX,
and refuses gloarmode=fix-and-hold). Choices are given by number, as their words differ between
versions.
"""

import importlib.util
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
from typing import BinaryIO, NamedTuple

from ...base.advance import share
from ...base.errors import DataError, InputError, OptionError, UsageError
from ...base.files import atomic_write
from ...base.output.scratch import refuse_cut_off, scratch_directory
from ...base.wording import DOCTOR, named
from ...io.formats.gnss.rtklib_pos import PosRows, read_rtklib_pos
from ...records import Finding, GnssFixes, Question
from ..options import (
    ANTENNAS,
    DIRECTIONS,
    KINEMATIC,
    EngineOptions,
    check_dynamics,
    option_file,
    single_point_file,
)
from ..rinex.navigation_message import navigation_bytes, read_navigation
from ..rinex.observations import Observations, read_observations, without_events
from .combined import combined
from .preflight import (
    Whereabouts,
    absolute,
    check_base_place,
    check_navigation,
    check_observations,
    interval,
)
from .worker import nearest

Source = str | Path
Progress = Callable[[str], None]

PROCESSES = 2
WATCHED_S = 0.5  # between two looks at how far the engine is
MODULE = "pyrtklib5"
PROGRAM = "rnx2rtkp"
INSTALL = (
    "no GNSS engine: pip install 'insgnss[ppk]' (pyrtklib5), or put RTKLIB's rnx2rtkp (EX 2.5.0 or"
    f" later) on PATH; {DOCTOR}"
)
HOLDS = (2, 5, 0)
PROGRAM_LINE = re.compile(r"%\s*program\s*:.*?ver\.\s*(\S.*)")
EX_VERSION = re.compile(r"EX\s*(\d+)\.(\d+)\.(\d+)")
REFUSED = re.compile(r"invalid option value (\S+)")
OF_ALL_VERSIONS = b"pos1-posmode"
UNKNOWN_OPTION = 2
WHERE = "where_"  # runs that find where a receiver stands
POLL_S = 0.02
THINNED = 60
HEAD, TAIL = 8192, 200


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
    moving, standing = observations or (read_observations(rover), read_observations(base))
    checks = [] if observations else [*moving.notes, *standing.notes]
    broadcast, pace = read_navigation(files), (interval(moving), interval(standing))
    checks += [
        *check_observations(moving, standing, options),
        *check_navigation(broadcast, moving, options),
    ]
    checks += check_dynamics(options, pace[0])
    texts: dict[str, str] = {
        direction: option_file(options, standing.header, direction, *pace)
        for direction in DIRECTIONS
    }
    checks += check_names(command, texts["forward"], options)
    target = _made(Path(directory))
    with scratch_directory(target) as scratch:
        runs = _Runs(command, scratch, options)
        names = runs.stage(moving, standing, files)

        def whereabouts(observations: Observations) -> Whereabouts:
            name = "rover" if observations is moving else "base"
            return Whereabouts.of(
                runs.single_points(name, names[2:], observations), observations, broadcast
            )

        checks += check_base_place(moving, standing, options, whereabouts)
        ends = runs.both(texts, names, absolute(moving).size, say)
        cpu = {direction: end.cpu_s for direction, end in ends.items()}
        engine = _version(runs.scratch / "forward.pos", command)
        for direction, text in texts.items():
            atomic_write(target / f"{direction}.conf", text)
            atomic_write(target / f"{direction}.pos", _in_order(runs.scratch / f"{direction}.pos"))
    pos = {name: target / f"{name}.pos" for name in ("combined", *DIRECTIONS)}
    moves = f"pos1-posmode={KINEMATIC}" in texts["forward"].splitlines()
    together = combined(pos["forward"], pos["backward"], pos["combined"], moves)
    atomic_write(pos["combined"], together.lines)
    conf: dict[str, Path] = {direction: target / f"{direction}.conf" for direction in DIRECTIONS}
    checks += [*_check_refused(ends), *_check_version(engine)]
    return EngineRun(
        **pos,
        engine=engine,
        cpu_s=sum(cpu.values()),
        cpu_of=cpu,
        option_files=conf,
        rows=together.rows,
        checks=tuple(checks),
    )


def _made(directory: Path) -> Path:
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(
            f"{directory}: no directory can be made there: {error.strerror or error}"
        ) from None
    return directory


def engine_command(engine: str = "auto") -> list[str]:
    """Return the beginning of the engine's command line: our worker with pyrtklib5, or an rnx2rtkp.

    Raises
    ------
    UsageError
        Where there is no engine.
    """
    if engine in ("auto", MODULE) and importlib.util.find_spec(MODULE) is not None:
        return [sys.executable, "-m", "insgnss.gnss.engine.worker"]
    if engine == MODULE:
        raise UsageError(INSTALL)
    program = shutil.which(PROGRAM if engine == "auto" else engine)
    if program is None:
        if engine == "auto":
            raise UsageError(INSTALL)
        instead = (
            INSTALL
            if importlib.util.find_spec(MODULE) is None
            else f"without it {MODULE} is taken, which is installed"
        )
        raise OptionError("gnss.engine", f"no program that can be run; {instead}", engine)
    return [str(Path(program).resolve())]


def check_names(command: Sequence[str], text: str, options: EngineOptions) -> tuple[Finding, ...]:
    """Check whether an rnx2rtkp knows the options of an option file.

    Its binary holds them as strings.

    Returns
    -------
    tuple of Finding
        A note for options of ours that it does not know, or where a wrapper does not show what the
        program holds.

    Raises
    ------
    OptionError
        For one of `rtklib_options` that it does not know.
    """
    if command[0] == sys.executable:
        return ()
    binary = _binary(Path(command[0]))
    requested = [line.split("=")[0] for line in text.splitlines()]
    if OF_ALL_VERSIONS not in binary:
        finding, advice = (
            f"{command[0]} does not show which it knows",
            "an unknown one is left out without a word; name the program itself",
        )
        names = " ".join(options.rtklib_options)
        return (
            (
                Question("engine options", "options that it knows").note(
                    f"{finding}: {names}", advice
                ),
            )
            if options.rtklib_options
            else ()
        )
    unknown = [name for name in requested if name.encode() + b"\0" not in binary]
    if wrong := [name for name in unknown if name in options.rtklib_options]:
        available = [
            option.decode()
            for option in re.findall(
                rb"(?:pos[12]|out|stats|ant[12]|misc|file)-[A-Za-z0-9_]+(?=\0)", binary
            )
        ]
        raise OptionError(
            "gnss.rtklib_options",
            f"{command[0]} has no option {wrong[0]}{nearest(wrong[0], available)}",
        )
    if not unknown:
        return ()
    advice = "it goes on with what it does by itself; RTKLIB EX 2.5.0 knows them"
    return (
        Question("engine options", "options that it knows").note(
            f"unknown to {command[0]}: {' '.join(unknown)}", advice
        ),
    )


def _binary(program: Path) -> bytes:
    """The program's file, empty where it may be run but not read."""
    try:
        return program.read_bytes()
    except OSError:
        return b""


def _check_refused(ends: Mapping[str, "_End"]) -> tuple[Finding, ...]:
    names = sorted({name for end in ends.values() for name in end.refused})
    if not names:
        return ()
    advice = "it goes on with what it does by itself; RTKLIB EX 2.5.0 takes them"
    return (
        Question("engine options", "values that it takes").note(
            f"values that it refused: {' '.join(names)}", advice
        ),
    )


class _End(NamedTuple):
    """How a run ended: CPU seconds (not a number where the system does not report them), the last
    line of its output, options whose values it refused.
    """

    cpu_s: float
    last_line: str = ""
    refused: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Runs:
    """Runs of one engine in one directory for scratch."""

    command: Sequence[str]
    scratch: Path
    options: EngineOptions

    def stage(
        self, rover: Observations, base: Observations, navigation: Sequence[Source]
    ) -> list[str]:
        """Put the inputs into the directory, unpacked and without camera events, behind which
        RTKLIB EX 2.5 drops the epoch where the interval between epochs is not the one before; their
        names there, rover, base and navigation."""
        observed, broadcast = (
            ["rover.obs", "base.obs"],
            [f"navigation{k}.nav" for k in range(1, len(navigation) + 1)],
        )
        for observations, name in zip((rover, base), observed, strict=True):
            (self.scratch / name).write_bytes(without_events(observations))
        for source, name in zip(navigation, broadcast, strict=True):
            (self.scratch / name).write_bytes(navigation_bytes(source))
        names = [*observed, *broadcast]
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
        for every in (
            (thinned, 0.0) if interval(observations) < thinned else (0.0,)
        ):  # thinned are epochs on full seconds
            try:
                end = self.run(where.stem, [f"{name}.obs", *navigation], threading.Event(), every)
            except DataError as refusal:
                self._check_program(str(refusal))
                raise
            if _has_epochs(where):
                return read_rtklib_pos(where)
            self._check_program(f"it said: {end.last_line or 'nothing'}")
        message = (
            "no position from codes; does the navigation cover its satellites, are there codes?"
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
            and OF_ALL_VERSIONS not in _binary(Path(self.command[0]))
        ):
            message = "left no solution and shows none of RTKLIB's options: is it an rnx2rtkp?"
            raise OptionError("gnss.engine", f"{message} {statement}", self.command[0])

    def both(
        self, texts: Mapping[str, str], names: Sequence[str], epochs: int, say: Progress
    ) -> dict[str, _End]:
        """The end of each run over so many epochs; the first error ends the others."""
        for direction, text in texts.items():
            (self.scratch / f"{direction}.conf").write_text(text, encoding="utf-8")
        stop = threading.Event()
        ends: dict[str, _End] = {}
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

    def solution(self, direction: str, names: Sequence[str], stop: threading.Event) -> _End:
        """The end of a run whose output has epochs; DataError where it has none."""
        if stop.is_set():
            return _End(math.nan)
        end = self.run(direction, names, stop)
        if not stop.is_set() and not _has_epochs(self.scratch / f"{direction}.pos"):
            message = (
                "the engine gave no epochs, though rover, base and navigation share their time"
            )
            raise DataError(
                f"{direction} solution: {message}; are their satellites the same? it said:"
                f" {end.last_line or 'nothing'}"
            )
        return end

    def run(
        self, name: str, files: Sequence[str], stop: threading.Event, every: float = 0.0
    ) -> _End:
        """Run the engine on name.conf to name.pos, on epochs `every` s (0: all). DataError,
        OptionError for a bad end.
        """
        if self.command[0] == sys.executable:
            line = [*self.command, f"{name}.conf", f"{name}.pos", f"{every:g}", *files]
        else:
            line = [
                *self.command,
                "-k",
                f"{name}.conf",
                *(["-ti", f"{every:g}"] if every else []),
                "-o",
                f"{name}.pos",
                *files,
            ]
        with tempfile.TemporaryFile() as output:
            process = subprocess.Popen(
                line,
                cwd=self.scratch,
                env=_environment(),
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
            )
            try:
                cpu = _wait(process, time.monotonic() + self.options.timeout_s, stop)
            finally:
                if process.returncode is None:
                    process.kill()
                    process.wait()
            last_line, refused = _tail(output), _refused(output)
        if wrong := [option for option in refused if option in self.options.rtklib_options]:
            problem = f"the engine refused {wrong[0]} = {self.options.rtklib_options[wrong[0]]}"
            raise OptionError("gnss.rtklib_options", problem)
        if process.returncode == 0 and (written := self.scratch / f"{name}.pos").is_file():
            refuse_cut_off(written)
        if process.returncode == 0 or stop.is_set():
            return _End(math.nan if cpu is None else cpu, last_line, refused)
        if process.returncode == UNKNOWN_OPTION and self.command[0] == sys.executable:
            raise OptionError("gnss.rtklib_options", last_line)
        of_what = (
            f"position of the {name.removeprefix(WHERE)} by codes"
            if name.startswith(WHERE)
            else f"{name} solution"
        )
        raise DataError(
            f"{of_what}: the engine {self._end(process.returncode, cpu)}; it said:"
            f" {last_line or 'nothing'}"
        )

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
    lines = [
        line.strip()
        for line in re.split(r"[\r\n]+", output.read().decode("utf-8", errors="replace"))
        if line.strip()
    ]
    return lines[-1][-TAIL:] if lines else ""


def _refused(output: BinaryIO) -> tuple[str, ...]:
    """Options whose values the engine did not take, which it says before anything else."""
    output.seek(0)
    return tuple(REFUSED.findall(output.read(HEAD).decode("utf-8", errors="replace")))


def _has_epochs(path: Path) -> bool:
    if not path.is_file():
        return False
    with path.open("rb") as stream:
        return any(line.strip() and not line.startswith(b"%") for line in stream)


def _in_order(path: Path) -> list[bytes]:
    """Lines of an output in order of time; RTKLIB writes those of a backward run from the last
    epoch to the first.
    """
    lines = path.read_bytes().splitlines(keepends=True)
    head, rows = (
        [line for line in lines if line.startswith(b"%")],
        [line for line in lines if not line.startswith(b"%") and line.strip()],
    )
    first, last = ([float(field) for field in rows[k].split()[:2]] for k in (0, -1))
    return head + (rows if first <= last else rows[::-1])


def _version(path: Path, command: Sequence[str]) -> str:
    """Engine and version, as it writes them into its output."""
    name = MODULE if command[0] == sys.executable else command[0]
    with path.open(encoding="utf-8", errors="replace") as stream:
        match = PROGRAM_LINE.match(next(stream, ""))
    return f"RTKLIB {match[1].strip()} ({name})" if match else f"RTKLIB of unknown version ({name})"


def _check_version(engine: str) -> tuple[Finding, ...]:
    match = EX_VERSION.search(engine)
    if match and tuple(int(number) for number in match.groups()) >= HOLDS:
        return ()
    advice = (
        "pip install 'insgnss[ppk]'; 2.4.3 b34 of Debian fixed 0.6 % of a drive with the options by"
        f" which EX 2.5.0 fixed 98 %; {DOCTOR}"
    )
    return (
        Question("engine", "RTKLIB EX 2.5.0 or later, for which the options hold").note(
            engine, advice
        ),
    )
