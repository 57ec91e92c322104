"""RTKLIB in processes of its own: combined, forward and backward solutions of a rover against a base.

RTKLIB is global state without threads; two processes run at a time. The engine is the wheel pyrtklib5 (RTKLIB EX 2.5.0; extra [ppk])
or, where it is not installed, any rnx2rtkp on PATH with the same option file (`options`). Inputs are put beside each other in a
directory that exists as long as the runs, under plain names and unpacked, as RTKLIB takes `%` and `*` in paths for its own and unpacks
by shell.
What the engine says is not believed: postpos() returns 0 without inputs, so that each output must exist and have epochs.
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
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ..errors import DataError, InputError, UsageError
from ..files import atomic_write
from ..formats.rtklib_pos import read_rtklib_pos
from ..geodesy.frames import geodetic_to_ecef
from ..records import Array, Check
from .events import without_events
from .navigation_message import read_navigation
from .options import ANTENNAS, DIRECTIONS, EngineOptions, option_file, single_point_file
from .preflight import absolute, check_base_place, check_navigation, check_observations
from .rinex import Observations, read_observations
from .rinex_header import load_rinex

Source = str | Path
Progress = Callable[[str], None]

PROCESSES = 2
MODULE = "pyrtklib5"
PROGRAM = "rnx2rtkp"
INSTALL = "no GNSS engine: pip install 'insgnss[ppk]' (pyrtklib5), or put RTKLIB's rnx2rtkp (EX 2.5.0 or later) on PATH"
HOLDS = (2, 5, 0)
PROGRAM_LINE = re.compile(r"%\s*program\s*:.*?ver\.\s*(\S.*)")
EX_VERSION = re.compile(r"EX\s*(\d+)\.(\d+)\.(\d+)")
UNKNOWN_OPTION = 2
POLL_S = 0.02
THINNED = 60
TAIL = 200


@dataclass(frozen=True)
class EngineRun:
    """What the engine left: the .pos files (week, time of week, degrees, ellipsoidal heights), and how it got them.

    engine : with its version as it writes it.   cpu_s : of the three runs, NaN where the system does not tell.   cpu_of : of each.
    option_files : by direction.   checks : what is to be told.
    """

    combined: Path
    forward: Path
    backward: Path
    engine: str
    cpu_s: float
    cpu_of: Mapping[str, float]
    option_files: Mapping[str, Path]
    checks: tuple[Check, ...] = ()


def solve(
    rover: Source,
    base: Source,
    navigation: Source | Iterable[Source],
    options: EngineOptions,
    directory: Source,
    progress: Progress | None = None,
    observations: tuple[Observations, Observations] | None = None,
) -> EngineRun:
    """Positions of the rover's antenna, written to combined.pos, forward.pos and backward.pos of `directory`, with their option files,
    all in order of time.

    rover, base, navigation : RINEX 2 or 3, plain or packed.   observations : of rover and base, where the caller has read them.
    Raises UsageError without an engine, InputError for inputs that do not belong together, DataError where the engine gives no epochs,
    does not finish in options.timeout_s, or stops.
    """
    say = progress or (lambda _: None)
    command = engine_command(options.engine)
    files = [navigation] if isinstance(navigation, str | Path) else list(navigation)
    if not files:
        raise InputError(f"{rover}: no navigation file; give the broadcast ephemerides (.nav, .n, .g, .p) of that day")
    moving, standing = observations or (read_observations(rover), read_observations(base))
    checks = [] if observations else [*moving.notes, *standing.notes]
    checks += [*check_observations(moving, standing, options), *check_navigation(read_navigation(files), moving, options)]
    texts: dict[str, str] = {direction: option_file(options, standing.header, direction) for direction in DIRECTIONS}
    target = _made(Path(directory))
    with tempfile.TemporaryDirectory(dir=target, prefix=".engine-") as scratch:
        runs = _Runs(command, Path(scratch), options)
        names = runs.stage(moving, standing, files)
        points = runs.single_points("base.obs", names[2:], standing)
        checks += check_base_place(points, options, standing.header, moving.header)
        cpu = runs.three(texts, names, say)
        engine = _version(runs.scratch / "combined.pos", command)
        for direction, text in texts.items():
            atomic_write(target / f"{direction}.conf", text)
            atomic_write(target / f"{direction}.pos", _in_order(runs.scratch / f"{direction}.pos"))
    pos = {direction: target / f"{direction}.pos" for direction in DIRECTIONS}
    conf: dict[str, Path] = {direction: target / f"{direction}.conf" for direction in DIRECTIONS}
    return EngineRun(
        **pos, engine=engine, cpu_s=sum(cpu.values()), cpu_of=cpu, option_files=conf, checks=(*checks, *_check_version(engine))
    )


def _made(directory: Path) -> Path:
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"{directory}: no directory can be made there: {error.strerror or error}") from None
    return directory


def engine_command(engine: str = "auto") -> list[str]:
    """Beginning of the command line of the engine: our worker with pyrtklib5, or an rnx2rtkp; UsageError where there is none."""
    if engine in ("auto", MODULE) and importlib.util.find_spec(MODULE) is not None:
        return [sys.executable, "-m", "insgnss.gnss._worker"]
    if engine == MODULE:
        raise UsageError(INSTALL)
    program = shutil.which(PROGRAM if engine == "auto" else engine)
    if program is None:
        raise UsageError(INSTALL if engine == "auto" else f"engine = {engine!r}: no such program; {INSTALL}")
    return [str(Path(program).resolve())]


@dataclass(frozen=True)
class _Runs:
    """Runs of one engine in one directory for scratch."""

    command: Sequence[str]
    scratch: Path
    options: EngineOptions

    def stage(self, rover: Observations, base: Observations, navigation: Sequence[Source]) -> list[str]:
        """Put the inputs into the directory, unpacked and without camera events; their names there, rover, base and navigation."""
        observed, broadcast = ["rover.obs", "base.obs"], [f"navigation{k}.nav" for k in range(1, len(navigation) + 1)]
        for observations, name in zip((rover, base), observed, strict=True):
            (self.scratch / name).write_bytes(without_events(observations))
        for source, name in zip(navigation, broadcast, strict=True):
            buf, _, _ = load_rinex(source)
            (self.scratch / name).write_bytes(bytes(buf))
        names = [*observed, *broadcast]
        if self.options.antex is not None:
            shutil.copyfile(self.options.antex, self.scratch / ANTENNAS)
        return names

    def single_points(self, name: str, navigation: Sequence[str], observations: Observations) -> Array:
        """Positions (n, 3) m ECEF of a receiver by codes alone, at some 60 of its epochs."""
        stamps = absolute(observations)
        step = float(np.median(np.diff(stamps))) if stamps.size > 1 else 1.0
        interval = next((s for s in (1.0, 5.0, 10.0, 30.0) if s * THINNED > stamps[-1] - stamps[0]), 30.0)
        (self.scratch / "where.conf").write_text(single_point_file(self.options), encoding="utf-8")
        self.run("where", [name, *navigation], threading.Event(), interval if step < interval else 0.0)
        if not _has_epochs(self.scratch / "where.pos"):
            what = "no position from codes; does the navigation cover its satellites, are there codes?"
            raise DataError(f"{observations.header.path}: {what}")
        fixes = read_rtklib_pos(self.scratch / "where.pos")
        return geodetic_to_ecef(fixes.lat, fixes.lon, fixes.height)

    def three(self, texts: Mapping[str, str], names: Sequence[str], say: Progress) -> dict[str, float]:
        """CPU seconds of each run; the first error ends the others."""
        for direction, text in texts.items():
            (self.scratch / f"{direction}.conf").write_text(text, encoding="utf-8")
        stop = threading.Event()
        cpu: dict[str, float] = {}
        with ThreadPoolExecutor(PROCESSES) as pool:
            jobs = {pool.submit(self.solution, direction, names, stop): direction for direction in texts}
            try:
                for job in as_completed(jobs):
                    cpu[jobs[job]] = job.result()
                    say(f"engine: {jobs[job]} solution, {len(cpu)} of {len(jobs)}")
            finally:
                stop.set()
        return {direction: cpu[direction] for direction in texts}

    def solution(self, direction: str, names: Sequence[str], stop: threading.Event) -> float:
        """CPU seconds of a run whose output has epochs; DataError where it has none."""
        if stop.is_set():
            return math.nan
        cpu, told = self.run(direction, names, stop)
        if not stop.is_set() and not _has_epochs(self.scratch / f"{direction}.pos"):
            what = "the engine gave no epochs, though rover, base and navigation share their time"
            raise DataError(f"{direction} solution: {what}; are their satellites the same? it said: {told or 'nothing'}")
        return math.nan if cpu is None else cpu

    def run(self, name: str, files: Sequence[str], stop: threading.Event, interval: float = 0.0) -> tuple[float | None, str]:
        """Run the engine on name.conf to name.pos; CPU seconds, and the end of what it said. DataError for a bad end."""
        if self.command[0] == sys.executable:
            line = [*self.command, f"{name}.conf", f"{name}.pos", f"{interval:g}", *files]
        else:
            line = [*self.command, "-k", f"{name}.conf", *(["-ti", f"{interval:g}"] if interval else []), "-o", f"{name}.pos", *files]
        with tempfile.TemporaryFile() as said:
            process = subprocess.Popen(line, cwd=self.scratch, env=_environment(), stdin=subprocess.DEVNULL, stdout=said, stderr=said)
            try:
                cpu = _wait(process, time.monotonic() + self.options.timeout_s, stop)
            finally:
                if process.returncode is None:
                    process.kill()
                    process.wait()
            told = _tail(said)
        if process.returncode == 0 or stop.is_set():
            return cpu, told
        if process.returncode == UNKNOWN_OPTION and self.command[0] == sys.executable:
            raise UsageError(f"more: {told}")
        raise DataError(f"{name} solution: the engine {self._end(process.returncode, cpu)}; it said: {told or 'nothing'}")

    def _end(self, code: int, cpu: float | None) -> str:
        if cpu is None:
            return f"did not finish in {self.options.timeout_s:g} s; raise timeout_s"
        return f"was ended by signal {-code}" if code < 0 else f"stopped with exit code {code}"


def _environment() -> dict[str, str]:
    """The environment, with the package where a Python in another directory finds it."""
    paths = [str(Path(__file__).resolve().parents[2]), os.environ.get("PYTHONPATH", "")]
    return os.environ | {"PYTHONPATH": os.pathsep.join(path for path in paths if path)}


def _wait(process: "subprocess.Popen[bytes]", deadline: float, stop: threading.Event) -> float | None:
    """CPU seconds of the process when it has ended, NaN where the system does not tell; None past the deadline or when told to stop."""
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


def _tail(said: BinaryIO) -> str:
    """The last line that is not empty, of the last 200 characters; RTKLIB ends its lines by carriage returns."""
    said.seek(0, os.SEEK_END)
    said.seek(max(said.tell() - 10 * TAIL, 0))
    lines = [line.strip() for line in re.split(r"[\r\n]+", said.read().decode("utf-8", errors="replace")) if line.strip()]
    return lines[-1][-TAIL:] if lines else ""


def _has_epochs(path: Path) -> bool:
    if not path.is_file():
        return False
    with path.open("rb") as stream:
        return any(line.strip() and not line.startswith(b"%") for line in stream)


def _in_order(path: Path) -> list[bytes]:
    """Lines of an output in order of time; RTKLIB writes those of a backward run from the last epoch to the first."""
    lines = path.read_bytes().splitlines(keepends=True)
    head, rows = [line for line in lines if line.startswith(b"%")], [line for line in lines if not line.startswith(b"%") and line.strip()]
    first, last = ([float(part) for part in rows[k].split()[:2]] for k in (0, -1))
    return head + (rows if first <= last else rows[::-1])


def _version(path: Path, command: Sequence[str]) -> str:
    """Engine and version, as it writes them into its output."""
    name = MODULE if command[0] == sys.executable else command[0]
    with path.open(encoding="utf-8", errors="replace") as stream:
        found = PROGRAM_LINE.match(next(stream, ""))
    return f"RTKLIB {found[1].strip()} ({name})" if found else f"RTKLIB of unknown version ({name})"


def _check_version(engine: str) -> tuple[Check, ...]:
    found = EX_VERSION.search(engine)
    if found and tuple(int(part) for part in found.groups()) >= HOLDS:
        return ()
    advice = "pip install 'insgnss[ppk]'; 2.4.3 b34 of Debian fixed 0.6 % of a drive with the options by which EX 2.5.0 fixed 98 %"
    return (Check("engine", engine, "RTKLIB EX 2.5.0 or later, for which the options hold", "note", advice),)
