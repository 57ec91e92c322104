"""RTKLIB in processes of its own: forward and backward solutions of a rover against a base
(`runs`, by the program of `program` with the option file of `options`), and their combination
(`combined`).

RTKLIB is global state without threads, and goes on without an option that it does not know. Choices
are given by number, as their words differ between versions.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from ...base.errors import InputError, UsageError
from ...base.files import atomic_write
from ...base.output.scratch import scratch_directory
from ...io.formats.gnss.rtklib_pos import PosRows
from ...records import Finding, Question
from ..options import KINEMATIC_MODE, PASSES_OF_ENGINE, EngineOptions, check_dynamics, option_file
from ..rinex.navigation_message import read_navigation
from ..rinex.observation_record import Observations
from ..rinex.observations import read_observations
from .base_coordinates import Whereabouts, check_base_place
from .combined import combined
from .normalised import engine_observations
from .preflight import absolute, check_navigation, check_observations, interval, within_navigation
from .program import check_names, check_version, engine_command, version
from .runs import Progress, RunEnd, Runs, Source


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
    solution = combined(pos["forward"], pos["backward"], pos["combined"], is_kinematic)
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
