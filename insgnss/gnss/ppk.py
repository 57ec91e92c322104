"""From RINEX of rover and base to antenna positions with honest covariances: the order of the steps.

    read -> engine forward, backward, combined -> covariance and belief (`covariance`) -> wet delay (`troposphere`)
         -> velocity from phase (`velocity`) -> camera events (`events`) -> figures and verdict (`quality`, `signals`)

The combined run gives the positions; the other two run for their difference alone. The wet delay is taken off after the belief, which it
does not touch: forward and backward share it. Of the camera events those of the rover's file are taken, with the names of the images
where a directory or a list of them is given.

An epoch without velocity from phase gets that of its neighbours' positions, with their covariance and `UNKNOWN_MPS`.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from ..errors import DataError
from ..formats import read_events
from ..formats.rtklib_pos import write_rtklib_pos
from ..geodesy.frames import ecef_to_geodetic, geodetic_to_ecef, rotation_en
from ..geodesy.gpstime import WEEK_S
from ..records import Array, CameraEvents, Check, GnssFixes
from .covariance import MODEL, SAME_EPOCH_S, CovarianceModel, Index, Separation, base_distance, calibrate, forward_backward
from .engine import EngineRun, solve
from .events import camera_events, image_names, name_events
from .image_times import with_times
from .navigation_message import Navigation, read_navigation
from .options import EngineOptions, base_position
from .quality import Solution, read_solution, solution_numbers, solution_series, verdict
from .rinex import Observations, read_observations
from .signals import signal_numbers, signals_of
from .troposphere import Atmosphere, common_sky, displacement_per_delay, standard_atmosphere, wet_delay_correction
from .velocity import at_stamps, time_differenced_velocity

Progress = Callable[[str], None]

SOLUTION = "ppk.pos"
UNKNOWN_MPS = 1.0
SINGLE_QUALITY = 5
MOST_VELOCITIES = 0.9


def quiet(_: str) -> None:
    """No progress."""


@dataclass(frozen=True)
class PpkInput:
    """What `solve_ppk` is given.

    rover, base, navigation : RINEX 2 or 3, plain or packed.   options : of the engine, with the base's position.
    covariance : of `gnss.covariance`.   wet_delay, velocity : whether to correct the one and to find the other.   atmosphere : at the
    base, whole or arguments of `standard_atmosphere` as far as known; None for the standard one.
    events : whether to take the rover's camera events, None: where it has some; or another file of them (.MRK, text).
    images : directory or list of their names in order, None: numbers.   image_ending, camera_delay_s, events_containing, skip_events,
    skip_images : of `events.camera_events`.
    """

    rover: Path
    base: Path
    navigation: tuple[Path, ...]
    options: EngineOptions = field(default_factory=EngineOptions)
    covariance: CovarianceModel = MODEL
    wet_delay: bool = True
    atmosphere: Atmosphere | Mapping[str, float] | None = None
    velocity: bool = True
    events: bool | Path | None = None
    images: Path | None = None
    image_ending: str | None = None
    camera_delay_s: float = 0.0
    events_containing: str = ""
    skip_events: Collection[int] = ()
    skip_images: Collection[str] = ()


@dataclass(frozen=True, eq=False)
class PpkResult:
    """Antenna positions, and what is to be known of them.

    fixes : combined, with covariances of `gnss.covariance`, notes empty.   events : of the rover's file, None without any.
    checks : of all steps.   verdict : in one sentence.   quality : plain numbers.   series : arrays for `report.gnss`.
    files : written, by name.   engine : with its version.   cpu_s : of its runs.
    """

    fixes: GnssFixes
    events: CameraEvents | None
    checks: tuple[Check, ...]
    verdict: str
    quality: dict[str, Any]
    series: dict[str, Any]
    files: dict[str, Path]
    engine: str
    cpu_s: float


def solve_ppk(given: PpkInput, directory: Path | None = None, progress: Progress = quiet) -> PpkResult:
    """Solve a rover against a base.

    directory : gets the three `.pos` of the engine with their options, and `ppk.pos`, the result; None: nothing is kept.
    Raises InputError, UsageError and DataError of the steps, each in one line.
    """
    if directory is None:
        with TemporaryDirectory(prefix="insgnss-ppk-") as scratch:
            return replace(solve_ppk(given, Path(scratch), progress), files={})
    progress("reading observations")
    rover, base = read_observations(given.rover), read_observations(given.base)
    events = _events(given, rover)
    progress("engine: three solutions")
    run = solve(given.rover, given.base, given.navigation, given.options, directory, progress, (rover, base))
    progress("covariance and quality")
    position, _ = base_position(given.options, base.header)
    solved = _Solved.of(run, np.array(position), given.covariance)
    navigation = read_navigation(given.navigation)
    fixes, checks = solved.fixes, [*rover.notes, *run.checks, *solved.fixes.notes]
    if given.wet_delay:
        progress("wet delay")
        fixes, check = _without_wet_delay(fixes, rover, base, navigation, given)
        checks.append(check)
    if given.velocity:
        progress("velocity")
        fixes, check = _with_velocity(fixes, rover, navigation)
        checks.append(check)
    signals = signals_of(rover)
    numbers = solved.numbers(given.covariance.gate) | {"signals": signal_numbers(signals)}
    told, causes = verdict(numbers)
    fixes = replace(fixes, source=str(given.rover), notes=())
    write_rtklib_pos(fixes, directory / SOLUTION)
    files = {"combined": run.combined, "forward": run.forward, "backward": run.backward, "solution": directory / SOLUTION}
    series = solution_series(solved.combined, solved.kind, *solved.from_base, solved.separation, signals)
    checks += [*causes, *(events.notes if events is not None else ())]
    return PpkResult(fixes, events, tuple(checks), told, numbers, series, files, run.engine, run.cpu_s)


@dataclass(frozen=True, eq=False)
class _Solved:
    """The engine's combined solution, its fixes with calibrated covariance and classes (n,), and the separation of the two others.

    from_base : distance (n,) m and height difference (n,) m.
    """

    combined: Solution
    fixes: GnssFixes
    kind: Index
    separation: Separation
    from_base: tuple[Array, Array]

    @classmethod
    def of(cls, run: EngineRun, base_ecef: Array, model: CovarianceModel) -> "_Solved":
        combined, forward, backward = (read_solution(path) for path in (run.combined, run.forward, run.backward))
        plain = replace(model, hampered_share=0.0)  # what hampers both runs does not part them
        alone = [calibrate(s.fixes, s.satellites, base_distance(s.fixes, base_ecef), None, plain)[0] for s in (forward, backward)]
        separation = forward_backward(combined.fixes.time, *alone)
        distance = base_distance(combined.fixes, base_ecef)
        fixes, kind = calibrate(combined.fixes, combined.satellites, distance, separation, model)
        return cls(combined, fixes, kind, separation, (distance, combined.fixes.height - ecef_to_geodetic(base_ecef)[2]))

    def numbers(self, gate: float) -> dict[str, Any]:
        """Figures of merit."""
        return solution_numbers(self.combined, self.fixes, self.kind, *self.from_base, self.separation, gate)


def _events(given: PpkInput, rover: Observations) -> CameraEvents | None:
    """Camera events of the rover's file or of one of their own; InputError where they are asked for and there is none."""
    if given.events is False or (given.events is None and given.images is None and rover.events.size == 0):
        return None
    names = None if given.images is None else image_names(given.images, given.image_ending)
    events, images, delay = given.skip_events, given.skip_images, given.camera_delay_s
    if isinstance(given.events, Path):
        read = read_events(given.events, gps_week=rover.gps_week)
        return with_times(
            lambda taken: name_events(read, names, delay, taken_s=taken, skip_events=events, skip_images=images), given.images, names
        )
    return with_times(
        lambda taken: camera_events(
            rover, names, delay, taken_s=taken, containing=given.events_containing, skip_events=events, skip_images=images
        ),
        given.images,
        names,
    )


def _without_wet_delay(
    fixes: GnssFixes, rover: Observations, base: Observations, navigation: Navigation, given: PpkInput
) -> tuple[GnssFixes, Check]:
    """Fixes with the correction of `troposphere` and its covariance, and what it amounts to."""
    position, _ = base_position(given.options, base.header)
    sky = common_sky(rover, base, navigation, fixes, given.options.elevation_mask_deg)
    blind = ~np.isfinite(displacement_per_delay(sky, fixes.time.size)[:, 0])
    quality = np.where(blind, SINGLE_QUALITY, 1 if fixes.quality is None else fixes.quality)  # single: not corrected
    air = given.atmosphere
    if isinstance(air, Mapping):
        air = standard_atmosphere(float(ecef_to_geodetic(np.array(position))[2]), **air)
    found = wet_delay_correction(replace(fixes, quality=quality), np.array(position), sky, air)
    place = geodetic_to_ecef(fixes.lat, fixes.lon, fixes.height)
    place += np.einsum("nij,nj->ni", rotation_en(fixes.lat, fixes.lon), found.correction_ned)
    lat, lon, height = ecef_to_geodetic(place)
    down = 1e3 * found.correction_ned[:, 2]
    told = f"heights raised by {-down.max():.1f} to {-down.min():.1f} mm"
    if np.isfinite(found.height_per_metre):
        told += f", {1e3 * found.height_per_metre:+.3f} mm per metre above the base"
    told += f"; {blind.sum()} epochs with too few satellites stay as they are" if blind.any() else ""
    source = "standard atmosphere" if given.atmosphere is None else "given atmosphere"
    check = Check("GNSS wet delay", told, f"a correction from the {source}; the engine leaves it out")
    return replace(fixes, lat=lat, lon=lon, height=height, cov_ned=fixes.cov_ned + found.cov_ned), check


def _with_velocity(fixes: GnssFixes, rover: Observations, navigation: Navigation) -> tuple[GnssFixes, Check]:
    """Fixes with velocities from phase where there are some, else from positions."""
    velocity, cov = _from_positions(fixes)
    try:
        found = time_differenced_velocity(rover, navigation, fixes)
        weeks = 0.0 if fixes.gps_week is None else (fixes.gps_week - found.gps_week) * WEEK_S
        phase, phase_cov = at_stamps(found, fixes.time + weeks)
        known = np.isfinite(phase).all(axis=1)
        if not known.any():
            raise DataError(f"{rover.header.path}: no two neighbouring intervals have a velocity from phase")
    except DataError as error:
        advice = "velocities are those of the positions; look at the loss-of-lock flags and the navigation files"
        return replace(fixes, velocity_ned=velocity, velocity_cov_ned=cov), Check("GNSS velocity", str(error), "velocities", "note", advice)
    velocity[known], cov[known] = phase[known], phase_cov[known]
    sigma = 1e3 * np.sqrt(np.median(np.diagonal(cov[known], axis1=1, axis2=2), axis=0))
    told = f"{known.sum()} of {known.size} epochs from phase, standard deviations {', '.join(f'{s:.0f}' for s in sigma)} mm/s"
    few = known.mean() < MOST_VELOCITIES
    advice = "the others have those of the positions; cycle slips or few satellites" if few else ""
    check = Check("GNSS velocity", told, f"{100 * MOST_VELOCITIES:.0f} % at least", "note" if few else "ok", advice)
    return replace(fixes, velocity_ned=velocity, velocity_cov_ned=cov), check


def _from_positions(fixes: GnssFixes) -> tuple[Array, Array]:
    """Velocities (n, 3) m/s and covariances (n, 3, 3) from the positions before and after each fix."""
    n = fixes.time.size
    before, after = np.maximum(np.arange(n) - 1, 0), np.minimum(np.arange(n) + 1, n - 1)
    interval = np.maximum(fixes.time[after] - fixes.time[before], SAME_EPOCH_S)
    place = geodetic_to_ecef(fixes.lat, fixes.lon, fixes.height)
    moved = np.einsum("nji,nj->ni", rotation_en(fixes.lat, fixes.lon), place[after] - place[before])
    cov = (fixes.cov_ned[after] + fixes.cov_ned[before]) / interval[:, None, None] ** 2 + UNKNOWN_MPS**2 * np.eye(3)
    return moved / interval[:, None], cov
