"""From RINEX of rover and base to antenna positions with honest covariances: the order of the
steps.

    read -> engine forward, backward -> `combined` -> covariance and validation (`covariance`)
         -> wet delay, ionosphere and velocity from phase (TDCP) in `corrections`
         -> camera events (`camera_events`, `exposures`), in GPST (`receiver_clock`)
         -> figures and verdict (`solution_quality`, `signal_quality`)

The combination of both runs gives the positions, their difference a measure of quality. Wet delay
and ionosphere are taken off after the validation, which they do not touch: forward and backward
share them. Of the camera events those of the rover's file are taken, with the names of the images
where a directory or a list of them is given.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import gettempdir
from typing import Any

import numpy as np

from ..base.files import pick_attributes
from ..base.output.scratch import scratch_directory
from ..base.output.staging import together
from ..geodesy.frames import ecef_to_geodetic
from ..geodesy.gpstime import WEEK_S
from ..io.exposures.match import check_delay, delay_events
from ..io.exposures.naming import ImageMatch, events_of, named
from ..io.formats.gnss.rtklib_pos_write import write_rtklib_pos
from ..navigation.prepare.fix_covariance.classes import (
    VALIDATED,
    Index,
    Separation,
    base_distance,
    calibrate,
    forward_backward,
)
from ..records import Array, CameraEvents, Finding, GnssFixes
from .antenna_files import SOLUTION_FILE
from .corrections import with_velocity, without_ionosphere, without_wet_delay
from .covariance_model import MODEL, CovarianceModel
from .engine.base_coordinates import check_base_point
from .engine.convert import convert_log, log_format
from .engine.normalised import MIXED_CODES
from .engine.preflight import check_rover_antenna, within_navigation
from .engine.rtklib import EngineRun, Progress, solve
from .exposures.event_times import check_beside, check_camera_delay
from .exposures.receiver_clock import to_gpst
from .options import EngineOptions, base_position
from .phase.signal_quality import signal_numbers, signals_of
from .phase.troposphere import Atmosphere
from .ppk_options import all_of
from .quality.solution_quality import (
    EngineSolution,
    coverage_numbers,
    grade,
    solution_numbers,
    solution_of,
    solution_series,
    verdict,
)
from .rinex.camera_events import RoverEvents, camera_events, unasked_events
from .rinex.joined import join_observations
from .rinex.navigation_message import read_navigation
from .rinex.observation_record import Observations
from .rinex.observations import read_observations
from .satellites.satellite_geometry import common_sky, epochs_of
from .satellites.visible_satellites import position_dilution


@dataclass(frozen=True)
class PpkInput:
    """Inputs and options of `solve_ppk`.

    Parameters
    ----------
    rover, base : Path or tuple of Path
        RINEX 2 or 3 observations, plain or packed; several files of a receiver are joined.
    navigation : tuple of Path
        RINEX 2, 3 or 4 navigation files, plain or packed.
    options : EngineOptions
        Options of the engine, with the base's position.
    covariance : CovarianceModel
        Model of `navigation.prepare.fix_covariance.classes`.
    wet_delay, ionosphere : bool
        Whether to correct these.
    atmosphere : Atmosphere or mapping, optional
        Air at the base, whole or arguments of `standard_atmosphere` as far as known; None for the
        standard one.
    velocity : bool
        Whether to take velocities from the carrier phase (TDCP).
    events : bool or Path, optional
        Whether to take the rover's camera events, None: where it has some; or another file of
        them (.MRK, text).
    rover_events : RoverEvents
        Which of the rover's events are exposures.
    match : ImageMatch
        Images that name them.
    camera_delay_s : float
        From the event to the exposure's middle, s. Where this, `rover_events` or `match` differs
        from its default, events are required.
    time_scale : str, optional
        Scale of events that are dates, where their file does not say it.
    base_point_chosen : bool
        Whether somebody said what stands at the base's coordinates; a note where not.
    """

    rover: Path | tuple[Path, ...]
    base: Path | tuple[Path, ...]
    navigation: tuple[Path, ...]
    options: EngineOptions = field(default_factory=EngineOptions)
    covariance: CovarianceModel = MODEL
    wet_delay: bool = True
    ionosphere: bool = True
    atmosphere: Atmosphere | Mapping[str, float] | None = None
    velocity: bool = True
    events: bool | Path | None = None
    rover_events: RoverEvents = field(default_factory=RoverEvents)
    match: ImageMatch = field(default_factory=ImageMatch)
    camera_delay_s: float = 0.0
    time_scale: str | None = None
    base_point_chosen: bool = True


@dataclass(frozen=True, eq=False)
class PpkResult:
    """Antenna positions of `solve_ppk`, their checks and quality.

    Parameters
    ----------
    fixes : GnssFixes
        The combination of both runs, with covariances of
        `navigation.prepare.fix_covariance.classes`; its notes are empty.
    events : CameraEvents, optional
        Camera events of the rover's file or of their own, None without any.
    checks : tuple of Finding
        Checks of all steps.
    verdict : str
        The quality in one sentence.
    quality : dict
        Figures of merit, plain numbers.
    series : dict
        Arrays for `report.charts.gnss`.
    files : dict of Path
        Files that were written, by name.
    engine : str
        The engine with its version.
    cpu_s : float
        CPU time of its runs, s.
    """

    fixes: GnssFixes
    events: CameraEvents | None
    checks: tuple[Finding, ...]
    verdict: str
    quality: dict[str, Any]
    series: dict[str, Any]
    files: dict[str, Path]
    engine: str
    cpu_s: float

    def write(self, path: Path) -> None:
        """Write the fixes as a `.pos`, with the combined solution's satellites, age and ratio."""
        names = [name for name in ("satellites", "age_s", "ratio") if name in self.series]
        write_rtklib_pos(replace(self.fixes, **{name: self.series[name] for name in names}), path)


def solve_ppk(
    ppk_input: PpkInput, directory: Path | None = None, progress: Progress | None = None
) -> PpkResult:
    """Solve a rover against a base.

    Parameters
    ----------
    ppk_input : PpkInput
        Files and options.
    directory : Path, optional
        Gets the `.pos` of the engine with their options, their combination, and `ppk.pos`, the
        result, all or none of them; None: nothing is kept.
    progress : callable, optional
        Is called with the name of each step.

    Raises
    ------
    InputError, UsageError, DataError
        Of the steps, each in one line.
    """
    observed = (*all_of(ppk_input.rover), *all_of(ppk_input.base))
    if len(observed) > 2 or any(map(log_format, observed)):
        return _solve_joined(ppk_input, directory, progress)
    assert isinstance(ppk_input.rover, Path)
    assert isinstance(ppk_input.base, Path)
    if directory is None:
        with scratch_directory(Path(gettempdir())) as scratch:
            return replace(_solved_in(ppk_input, scratch, progress or _quiet), files={})
    with together() as staging:
        into = staging.tree(directory)
        result = _solved_in(ppk_input, into, progress or _quiet)
        files = {name: directory / path.relative_to(into) for name, path in result.files.items()}
        return replace(result, files=files)


def _quiet(_: str) -> None:
    pass


def _solved_in(ppk_input: PpkInput, directory: Path, say: Progress) -> PpkResult:
    """Solve, and write the files into `directory`."""
    say("reading observations")
    # one file each: several have been joined
    (rover_path,), (base_path,) = all_of(ppk_input.rover), all_of(ppk_input.base)
    rover, base = read_observations(rover_path), read_observations(base_path)
    if ppk_input.navigation:
        navigation = read_navigation(ppk_input.navigation)
        rover, base = (within_navigation(observed, navigation) for observed in (rover, base))
    events, unasked = _events(ppk_input, rover)
    say("engine: forward and backward solutions")
    run = solve(
        *(rover_path, base_path, ppk_input.navigation, ppk_input.options),
        *(directory, say, (rover, base)),
    )
    say("covariance and quality")
    base_ecef = np.array(base_position(ppk_input.options, base.header)[0])
    solved = _Solved.of(run, base_ecef, ppk_input.covariance)
    base_point_check = check_base_point(ppk_input.options, base.header, ppk_input.base_point_chosen)
    checks = [*rover.notes, *base.notes, base_point_check, _phase_codes(run)]
    checks += check_rover_antenna(ppk_input.options, rover.header)
    checks += [*run.checks, *solved.fixes.notes]
    if events is not None:
        checks += _event_checks(events, ppk_input, rover, solved.fixes)
        events = _at_exposures(events, ppk_input, rover, solved.fixes)
    sky = None
    if ppk_input.wet_delay or ppk_input.ionosphere:
        sky = common_sky(rover, base, navigation, solved.fixes, ppk_input.options)
    fixes = solved.fixes
    if sky is not None and ppk_input.wet_delay:
        say("wet delay")
        fixes, check = without_wet_delay(fixes, sky, base_ecef, ppk_input.atmosphere)
        checks.append(check)
    if sky is not None and ppk_input.ionosphere:
        say("ionosphere")
        fixes, check = without_ionosphere(
            *(fixes, (rover, base), navigation, sky, base_ecef),
            *(ppk_input.options, ppk_input.atmosphere),
        )
        checks.append(check)
    if ppk_input.velocity:
        say("velocity")
        fixes, check = with_velocity(fixes, rover, navigation)
        checks.append(check)
    signals = signals_of(rover)
    numbers = solved.numbers(ppk_input.covariance.gate, rover)
    numbers["signals"] = signal_numbers(signals)
    numbers["grade"] = grade(numbers, checks)
    summary, causes = verdict(numbers, checks)
    if MIXED_CODES in "".join(run.codes):
        summary += f"; codes of the rover {run.codes[0]}, of the base {run.codes[1]}"
    fixes = replace(fixes, source=str(ppk_input.rover), notes=())
    files = pick_attributes(run, "combined", "forward", "backward") | {
        "solution": directory / SOLUTION_FILE
    }
    files |= {f"options of {direction}": path for direction, path in run.option_files.items()}
    series = solution_series(
        solved.combined, solved.kind, *solved.from_base, solved.separation, signals
    )
    if sky is not None:
        series["pdop"] = position_dilution(sky, fixes.time.size)
    checks += [*causes, *unasked, *(events.notes if events is not None else ())]
    result = PpkResult(
        fixes=fixes,
        events=events,
        checks=tuple(checks),
        verdict=summary,
        quality=numbers,
        series=series,
        files=files,
        engine=run.engine,
        cpu_s=run.cpu_s,
    )
    result.write(files["solution"])
    return result


def _solve_joined(
    ppk_input: PpkInput, directory: Path | None, progress: Progress | None
) -> PpkResult:
    """Solve receivers of which several files are given, joined to one each, or their own logs."""
    logs: list[Finding] = []
    with scratch_directory(Path(gettempdir())) as scratch:
        joined_files = []
        for files, name in ((ppk_input.rover, "rover"), (ppk_input.base, "base")):
            folder = scratch / name
            rinex = [convert_log(file, folder, ppk_input.navigation) for file in all_of(files)]
            logs += [check for file in rinex for check in file.checks]
            joined_files.append(join_observations([file.path for file in rinex], folder / "joined"))
        rover, base = joined_files
        result = solve_ppk(
            replace(ppk_input, rover=rover.path, base=base.path), directory, progress
        )
    source = str(all_of(ppk_input.rover)[0])
    checks = (*logs, *rover.checks, *base.checks)
    events = result.events
    if events is not None and events.source == str(rover.path):
        events = replace(events, source=source)
    return replace(
        result,
        fixes=replace(result.fixes, source=source),
        events=events,
        checks=(*checks, *result.checks),
    )


def _phase_codes(run: EngineRun) -> Finding:
    """Return a finding that names the codes of the phases that the engine used."""
    finding = f"rover {run.codes[0]}; base {run.codes[1]}"
    several = "; where a satellite lacks one, the other is in its place" * (MIXED_CODES in finding)
    return Finding("GNSS codes", finding + several, "codes of the phases, one a band and satellite")


@dataclass(frozen=True, eq=False)
class _Solved:
    """The combined solution, its fixes with calibrated covariance and classes (n,), and
    the separation of the two others.

    from_base : distance (n,) m and height difference (n,) m.
    """

    combined: EngineSolution
    fixes: GnssFixes
    kind: Index
    separation: Separation
    from_base: tuple[Array, Array]

    @classmethod
    def of(cls, run: EngineRun, base_ecef: Array, model: CovarianceModel) -> "_Solved":
        """Calibrate the combined fixes by the separation of the runs; base_ecef (3,) is in m."""
        combined, forward, backward = (
            solution_of(run.rows[name]) for name in ("combined", "forward", "backward")
        )
        # an obstruction degrades both runs alike, and each run confirms the islands of the other
        run_model = replace(model, degraded_share=0.0, island_s=0.0)
        run_fixes = [
            calibrate(s.fixes, s.satellites, base_distance(s.fixes, base_ecef), None, run_model)[0]
            for s in (forward, backward)
        ]
        separation = forward_backward(combined.fixes.time, *run_fixes)
        distance = base_distance(combined.fixes, base_ecef)
        fixes, kind = calibrate(combined.fixes, combined.satellites, distance, separation, model)
        from_base = distance, combined.fixes.height - ecef_to_geodetic(base_ecef)[2]
        return cls(combined, fixes, kind, separation, from_base)

    def numbers(self, gate: float, rover: Observations) -> dict[str, Any]:
        """Figures of merit, of the solution and of the rover's epochs."""
        week = rover.gps_week if self.fixes.gps_week is None else self.fixes.gps_week
        solved, fixed = np.zeros((2, rover.time.size), dtype=np.bool_)
        epochs = epochs_of(self.fixes, rover)
        solved[epochs] = True
        fixed[epochs] = np.isin(self.kind, VALIDATED)
        numbers = solution_numbers(
            self.combined, self.fixes, self.kind, *self.from_base, self.separation, gate
        )
        return numbers | coverage_numbers(
            rover.time + (rover.gps_week - week) * WEEK_S, solved, fixed
        )


def _events(
    ppk_input: PpkInput, rover: Observations
) -> tuple[CameraEvents | None, tuple[Finding, ...]]:
    """Return the camera events of the rover's file, by its clock, or of a file of their own.

    The note names events that the rover's file holds although no option requests them. Raises
    InputError where events are requested and the file has none.
    """
    check_delay(ppk_input.camera_delay_s)
    if ppk_input.events is False:
        return None, ()
    options = ppk_input.rover_events, ppk_input.match, ppk_input.camera_delay_s
    by_default = options == (RoverEvents(), ImageMatch(), 0.0)
    if isinstance(ppk_input.events, Path):
        stamps = {"gps_week": rover.gps_week, "time_scale": ppk_input.time_scale}
        events = events_of(ppk_input.events, ppk_input.match.image_ending, **stamps)
        return named(events, ppk_input.match), ()
    if ppk_input.events is None and by_default:
        return unasked_events(rover)
    return named(camera_events(rover, ppk_input.rover_events), ppk_input.match), ()


def _event_checks(
    events: CameraEvents, ppk_input: PpkInput, rover: Observations, fixes: GnssFixes
) -> list[Finding]:
    """Return the checks of the delay, and of a file's events against those of the rover."""
    checks = [check_camera_delay(ppk_input.camera_delay_s)] if ppk_input.camera_delay_s else []
    if isinstance(ppk_input.events, Path) and rover.events.size:
        stamps = np.unique(rover.events)
        names = tuple(map(str, range(stamps.size)))
        rover_events = CameraEvents(names, stamps, rover.gps_week, str(ppk_input.rover))
        comparison = check_beside(events, to_gpst(rover_events, rover, fixes), rover.gps_week)
        checks += [] if comparison is None else [comparison]
    return checks


def _at_exposures(
    events: CameraEvents, ppk_input: PpkInput, rover: Observations, fixes: GnssFixes
) -> CameraEvents:
    """Events at the middles of their exposures, GPST: the clock is that of the stamps, so that it
    is taken off before the delay comes.
    """
    return delay_events(
        events if isinstance(ppk_input.events, Path) else to_gpst(events, rover, fixes),
        ppk_input.camera_delay_s,
    )
