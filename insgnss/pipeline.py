"""The one place that knows the order: read -> prepare -> align -> filter -> smooth -> orient -> export.

`process` runs it for a flight file, `inspect` only the first two steps, `demo` on a flight that it simulates.
"""

import os
import platform
import time
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from . import __version__
from .calibrate.fixes import lasting_errors, state_verdicts
from .delivery import deliver, inputs_of, sha256, target
from .errors import DataError, InputError
from .files import json_ready
from .flight import Flight, load_flight
from .recording import Progress, Recording, quiet, read_recording, sentence
from .records import Array, Check, Diagnostics, ExteriorOrientation, GnssFixes, ImuBiases, Innovations, StateVerdict, Trajectory
from .stretch import EPOCH_HZ, Stretch, check_images, check_motion, solve_stretches

if TYPE_CHECKING:
    from .navigation.solution import Solution

REPORT_ROWS = 4000
HOPELESS_RAD = np.radians(20.0)  # of attitude: beyond it neither the linearisation nor a user can do anything with the result


@dataclass(frozen=True, repr=False)
class ProcessResult:
    """What a run found.

    Parameters
    ----------
    report : what report.json holds: figures of merit, checks, the resolved flight file, versions.
    files : that were written.
    eo : exterior orientation of the images; None without camera events.
    trajectory : of the IMU's navigation centre, at the rate that was asked for.
    diagnostics : series for the report: filter and smoothed sigmas, innovations, biases.
    """

    report: dict[str, Any]
    files: tuple[Path, ...]
    eo: ExteriorOrientation | None
    trajectory: Trajectory
    diagnostics: Diagnostics

    @property
    def checks(self) -> tuple[Check, ...]:
        """Every check of the run, those that found nothing wrong among them."""
        return self.diagnostics.checks

    @property
    def states(self) -> tuple[StateVerdict, ...]:
        """Constants that were estimated besides biases: scale factors, lever arm, time offset."""
        return self.diagnostics.states

    @property
    def biases(self) -> ImuBiases:
        """Biases of the IMU over time, with standard deviations."""
        return replace(self.diagnostics.biases, gps_week=self.trajectory.gps_week)

    @property
    def innovations(self) -> Innovations:
        """Position fixes against what the filter predicted of them."""
        return replace(self.diagnostics.innovations, gps_week=self.trajectory.gps_week)

    def __repr__(self) -> str:
        """Return what there is and the headline of the report."""
        return f"<ProcessResult {self.trajectory!r}, {self.eo!r}: {self.report['headline']}>"

    def summary(self) -> str:
        """A few lines for the terminal."""
        notes = dict.fromkeys(note for export in self.report.get("exports", ()) for note in export["notes"])
        told = (*self.report["verdict"], *(f"note: {note}" for note in notes), *(f"wrote {file}" for file in self.files))
        return "\n".join([self.report["headline"], *told])


@dataclass
class _Clock:
    """CPU seconds of each step."""

    progress: Progress
    seconds: dict[str, float] = field(default_factory=dict)
    _step: str = ""
    _since: float = 0.0

    def step(self, name: str) -> None:
        now = time.process_time()
        if self._step:
            self.seconds[self._step] = self.seconds.get(self._step, 0.0) + now - self._since
        self._step, self._since = name, now
        if name:
            self.progress(name)


def process(flight: Flight, out: Path | None = None, progress: Progress = quiet, write: bool = True) -> ProcessResult:
    """The main job: from a flight file to the exterior orientation of every image and its report.

    out : directory of the products instead of the flight file's.   write : whether to write them at all.
    Raises InputError where the input is wrong or contradicts itself, DataError where it does not support the answer.
    """
    directory = target(flight, out) if write else None
    clock = _Clock(progress)
    clock.step("read")
    recording = read_recording(flight)
    _refuse(flight, recording.checks)
    week = recording.gps_week
    parts, more = _solve(flight, recording, clock.step)
    checks = (*recording.checks, *more)
    clock.step("orient")
    from .navigation.solution import trajectory

    path = Trajectory.joined([_trajectory(flight, part.solution, part.grid, week) for part in parts])
    rows = [_report_rows(part.solution) for part in parts]
    sampled = [trajectory(part.solution, at, week) for part, at in zip(parts, rows, strict=True)]
    checks = (*checks, _check_heading(flight, Trajectory.joined(sampled)))
    history = _history(flight, recording, parts, checks)
    eo = _exterior(flight, recording, parts, history)
    if eo is None:
        _refuse_hopeless(flight, Trajectory.joined(sampled))
    clock.step("report")
    every = [_diagnostics(part, at, told, recording.rests.time) for part, at, told in zip(parts, rows, sampled, strict=True)]
    diagnostics = replace(Diagnostics.joined(every), checks=checks)
    epochs = sum(part.solution.time.size for part in parts)
    report = _summary(flight, diagnostics, eo, history, clock, recording.imu.time.size, epochs)
    if recording.ppk is not None:
        report["ppk"] = {"engine": recording.ppk.engine, "verdict": recording.ppk.verdict, "quality": json_ready(recording.ppk.quality)}
    clock.step("write" if write else "")
    files = () if directory is None else deliver(flight, directory, eo, path, report, diagnostics, recording)
    clock.step("")
    return ProcessResult(report, files, eo, path, diagnostics)


def _solve(flight: Flight, recording: Recording, step: Progress) -> tuple[list[Stretch], tuple[Check, ...]]:
    """The solved stretches of the flight, and checks of what was left out of it and of what the solutions say."""
    from .prepare.clock import common_span, refuse_outside

    if recording.events is not None:
        refuse_outside(recording.events, *common_span(recording.imu, recording.gnss, flight.start_tow, flight.end_tow))
    solved, gaps = solve_stretches(flight, recording, step)
    checks = [check for part in solved for check in part.checks] + check_motion(flight, solved)
    _refuse(flight, tuple(checks))
    checks += [*gaps, *check_images(recording, solved)]
    return solved, tuple(checks)


def _exterior(flight: Flight, recording: Recording, parts: list[Stretch], history: tuple[str, ...]) -> ExteriorOrientation | None:
    """Exterior orientation of the images within the stretches; None without a camera."""
    if recording.events is None:
        return None
    from .geodesy.frames import TangentPlane
    from .navigation.solution import trajectory
    from .orient.exterior import exterior_orientation
    from .prepare.clock import take_events

    at = np.concatenate([part.at_event for part in parts])
    if not at.size:
        raise DataError(f"{recording.events.source}: no image lies in a stretch that could be solved; see the gaps of `insgnss inspect`")
    exposed = Trajectory.joined(
        [trajectory(part.solution, part.solution.event_epochs, recording.gps_week, events=True) for part in parts if part.at_event.size]
    )
    _refuse_hopeless(flight, exposed)
    plane = TangentPlane(*_origin(flight, parts[0].fixes))
    return exterior_orientation(exposed, take_events(recording.events, at), flight.mounting, plane, history)


def _refuse(flight: Flight, checks: tuple[Check, ...]) -> None:
    bad = [c for c in checks if c.verdict == "contradiction" and c.name not in flight.accept]
    if bad:
        more = "contradiction" if len(bad) == 2 else "contradictions"
        also = f"; {len(bad) - 1} more {more}, see `insgnss inspect`" if bad[1:] else ""
        names = ", ".join(f'"{c.name}"' for c in bad)
        raise InputError(f"{flight.path}: {sentence(bad[0])}{also}; accept = [{names}] in the flight file overrules")


def _refuse_hopeless(flight: Flight, path: Trajectory) -> None:
    """Refuse attitudes that are not determined at half of the rows."""
    sigma = np.median(np.sqrt(np.diagonal(path.cov, axis1=1, axis2=2)[:, 6:]), axis=0)
    if not sigma.max() < HOPELESS_RAD:
        raise DataError(
            f"{flight.path}: attitude not observable: its standard deviation is {np.degrees(sigma.max()):.0f} deg in the median (limit "
            f"{np.degrees(HOPELESS_RAD):.0f}); check the noise model {flight.imu.noise} and the sigmas of the fixes, or include manoeuvres"
        )


def _origin(flight: Flight, fixes: GnssFixes) -> tuple[float, float, float]:
    """Latitude, longitude (rad) and height (m) of the tangent plane's origin; by default the first fix to 0.01 deg, on the ellipsoid."""
    if flight.tangent_plane is not None:
        lat, lon, height = flight.tangent_plane.origin
        return float(lat), float(lon), float(height)
    lat_deg, lon_deg = np.round(np.degrees([fixes.lat[0], fixes.lon[0]]), 2)
    return float(np.radians(lat_deg)), float(np.radians(lon_deg)), 0.0


def _trajectory(flight: Flight, solution: "Solution", grid: np.ndarray, week: int) -> Trajectory:
    from .navigation.dense import dense_trajectory
    from .navigation.solution import trajectory

    hz = flight.output.trajectory_hz
    if hz is not None and hz <= EPOCH_HZ:
        return trajectory(solution, grid, week)
    dense = dense_trajectory(solution, week)
    if hz is None:
        return dense
    wanted = dense.time[0] + np.arange(int((dense.time[-1] - dense.time[0]) * hz) + 1) / hz
    at = np.unique(np.clip(np.searchsorted(dense.time, wanted - 1e-6), 0, dense.time.size - 1))
    return Trajectory(
        dense.time[at], dense.lat[at], dense.lon[at], dense.height[at], dense.velocity_ned[at], dense.C_nb[at], dense.cov[at], week
    )


def _report_rows(solution: "Solution") -> np.ndarray:
    stride = max(1, solution.time.size // REPORT_ROWS)
    return np.unique(np.concatenate([np.arange(0, solution.time.size, stride), solution.event_epochs]))


def _check_heading(flight: Flight, sampled: Trajectory) -> Check:
    from .geodesy.rotation import rpy_from_rotation
    from .recognise.plausibility import check_heading

    check = check_heading(rpy_from_rotation(sampled.C_nb)[:, 2], sampled.velocity_ned, flight.imu.C_b_imu)
    _refuse(flight, (check,))
    return check


def _history(flight: Flight, recording: Recording, parts: list[Stretch], checks: tuple[Check, ...]) -> tuple[str, ...]:
    from .navigation.filter import MOTION, NOTHING, POSITION, REOPENED, USED

    lever = flight.mounting.antenna_lever_b
    verdict = np.concatenate([part.solution.verdict for part in parts])
    used, reopened = (int(np.isin(verdict[:, POSITION], kinds).sum()) for kinds in ((USED, REOPENED), (REOPENED,)))
    count = max(part.solution.passes for part in parts)
    problem = parts[0].solution.problem
    fixes = sum(part.fixes.time.size for part in parts)
    motion = verdict[:, MOTION]
    offered, taken = int((motion != NOTHING).sum()), int((motion == USED).sum())
    longest = max(parts, key=lambda part: part.solution.time.size)
    return (
        f"insgnss {__version__}; smoothed, {problem.layout.size} states, {count} filter pass{'es' if count > 1 else ''}; "
        f"GPST week {recording.gps_week}",
        f"GNSS: {used} of {fixes} fixes used, innovation gate {flight.gnss.gate_sigma:g} sigma, filter reopened {reopened} times",
        f"lever arm IMU to antenna applied, forward right down m: {lever[0]:.4f} {lever[1]:.4f} {lever[2]:.4f}",
        f"noise model {flight.imu.noise}; IMU axes {flight.imu.axes}; {'; '.join(parts[0].history)}",
        *(f"stretch from {part.solution.time[0]:.1f} s on: {'; '.join(part.history)}" for part in parts[1:]),
        *([f"the motion itself (rest, wheels) measured {offered} times, {taken} used"] if offered else []),
        *([recording.turn_on] if recording.turn_on else []),
        *(f"the stamps of the fixes moved by {part.time_offset_s:+.4f} s" for part in parts if part.time_offset_s),
        *(_estimated(state) for state in state_verdicts(longest.solution, longest.time_offset_s)),
        f"{sum(len(part.solution.problem.inc.gaps) for part in parts)} IMU gaps bridged; heights ellipsoidal (WGS84)",
        "lever arm IMU to camera and bore-sight applied",
        *(f"contradiction overruled by the flight file: {c.name}: {c.found}" for c in checks if c.verdict == "contradiction"),
    )


def _estimated(state: StateVerdict) -> str:
    return f"estimated: {state.name} {state.value:.4g} +- {state.sigma:.2g}, {'' if state.observed else 'not '}observed by this flight"


def _diagnostics(part: Stretch, rows: np.ndarray, sampled: Trajectory, rests: Array) -> Diagnostics:
    from .geodesy.rotation import rpy_from_rotation
    from .navigation.filter import NOTHING, POSITION, REJECTED, REOPENED, USED, VELOCITY

    solution = part.solution
    bias, bias_sigma = solution.channel_bias(rows)
    fix = np.flatnonzero(solution.verdict[:, POSITION] != NOTHING)
    speed = np.flatnonzero(solution.verdict[:, VELOCITY] != NOTHING)
    smoothed = np.sqrt(np.diagonal(solution.P[:, :9, :9][rows], axis1=1, axis2=2))
    return Diagnostics(
        time=solution.time[rows],
        position=solution.nav[rows, :3],
        velocity=solution.nav[rows, 3:6],
        rpy=rpy_from_rotation(sampled.C_nb),
        event=np.searchsorted(rows, solution.event_epochs),
        filter_sigma=solution.filter_sigma[rows, :9],
        smoothed_sigma=smoothed,
        bias=bias,
        bias_sigma=bias_sigma,
        fix_time=solution.time[fix],
        innovation=solution.innovation[fix, :3],
        innovation_sigma=solution.innovation_sigma[fix, :3],
        nis=solution.nis[fix, 0],
        nis_limit=solution.problem.gate,
        used=solution.verdict[fix, POSITION] != REJECTED,
        reopened=solution.time[solution.verdict[:, POSITION] == REOPENED],
        separation_time=solution.time[solution.separation_epoch],
        separation=solution.separation,
        separation_sigma=solution.separation_sigma,
        gaps=solution.problem.inc.gaps,
        passes=solution.passes,
        velocity_nis=solution.nis[speed, 1] if speed.size else None,
        velocity_used=solution.verdict[speed, VELOCITY] == USED if speed.size else None,
        rests=rests[(rests[:, 1] > solution.time[0]) & (rests[:, 0] < solution.time[-1])],
        states=state_verdicts(solution, part.time_offset_s),
        stretches=((float(solution.time[0]), float(solution.time[-1])),),
        lasting=lasting_errors(solution),
    )


def _summary(
    flight: Flight,
    diagnostics: Diagnostics,
    eo: ExteriorOrientation | None,
    history: tuple[str, ...],
    clock: _Clock,
    samples: int,
    epochs: int,
) -> dict[str, Any]:
    from .report.summary import run_summary

    inputs = {os.path.relpath(file, flight.path.parent): sha256(file) for file in inputs_of(flight)}
    versions = {"insgnss": __version__, "python": platform.python_version(), "numpy": np.__version__}
    return run_summary(
        diagnostics, eo, flight.resolved(), inputs, versions, dict(clock.seconds), history, imu_samples=samples, epochs=epochs
    )


@dataclass(frozen=True)
class DemoResult:
    """Errors of a processed simulated flight against its truth, root mean square over the images."""

    process: ProcessResult
    images: int
    position_rms_m: Array
    attitude_rms_rad: Array
    position_nse: Array
    attitude_nse: Array
    directory: Path

    def as_dict(self) -> dict[str, Any]:
        """JSON-able."""
        return {
            "images": self.images,
            "position_rms_mm": (1e3 * self.position_rms_m).round(3).tolist(),
            "attitude_rms_deg": np.degrees(self.attitude_rms_rad).round(6).tolist(),
            "position_normalised_error_squared": self.position_nse.round(3).tolist(),
            "attitude_normalised_error_squared": self.attitude_nse.round(3).tolist(),
            "directory": str(self.directory),
            "files": [str(file) for file in self.process.files],
        }

    def summary(self) -> str:
        """The errors in a small table."""
        mm, deg = 1e3 * self.position_rms_m, np.degrees(self.attitude_rms_rad)
        return "\n".join(
            [
                f"{self.images} images against the simulated truth (axes east, north, up):",
                f"  position rms            {mm[0]:8.2f} {mm[1]:8.2f} {mm[2]:8.2f}  mm",
                f"  attitude rms            {deg[0]:8.4f} {deg[1]:8.4f} {deg[2]:8.4f}  deg",
                "  error squared over its variance, mean (1 is honest, 0.5 to 2 usual for one flight):",
                f"    position              {self.position_nse[0]:8.2f} {self.position_nse[1]:8.2f} {self.position_nse[2]:8.2f}",
                f"    attitude              {self.attitude_nse[0]:8.2f} {self.attitude_nse[1]:8.2f} {self.attitude_nse[2]:8.2f}",
                f"flight and products: {self.directory}",
                f"report: {next(f for f in self.process.files if f.name == 'report.html')}",
            ]
        )


def demo(directory: Path | None = None, minutes: float = 8.0, seed: int = 0, progress: Progress = quiet) -> DemoResult:
    """Simulate a block flight with a NavChip, process it from its files and compare with the truth."""
    from .simulate.dataset import write_dataset

    directory = Path("insgnss_demo") if directory is None else Path(directory)
    progress("simulate")
    dataset = write_dataset(directory, "ign8", minutes, imu_rate=500.0, seed=seed)
    result = process(load_flight(dataset.flight_file), None, progress)
    assert result.eo is not None
    return compare_with_truth(result, dataset.simulated.truth.eo, directory)


def compare_with_truth(result: ProcessResult, truth: ExteriorOrientation, directory: Path) -> DemoResult:
    """Errors of `result` at the images that truth has too, truth in the same tangent plane."""
    from .geodesy.rotation import vector_from_rotation

    eo = result.eo
    assert eo is not None
    at = {image: k for k, image in enumerate(truth.images)}
    k = np.array([at[image] for image in eo.images])
    error = np.concatenate(
        [truth.position_m[k] - eo.position_m, vector_from_rotation(truth.C_mc[k] @ np.swapaxes(eo.C_mc, -1, -2))], axis=1
    )
    nse = np.mean(error**2 / np.diagonal(eo.cov, axis1=1, axis2=2), axis=0)
    rms = np.sqrt(np.mean(error**2, axis=0))
    return DemoResult(result, len(eo.images), rms[:3], rms[3:], nse[:3], nse[3:], directory)
