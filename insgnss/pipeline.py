"""The one place that knows the order: read -> prepare -> align -> filter -> smooth -> orient -> export.

`process` runs it for a flight file, `inspect` only the first two steps, `demo` on a flight that it simulates.
"""

import hashlib
import os
import platform
import shutil
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from . import __version__
from .errors import DataError, InputError, UsageError
from .flight import Flight, load_flight
from .recording import Progress, Recording, quiet, read_recording, sentence
from .records import Array, Check, Diagnostics, ExteriorOrientation, GnssFixes, Trajectory

if TYPE_CHECKING:
    from .navigation.filter import Problem, Start
    from .navigation.solution import Solution

EPOCH_HZ = 10.0  # outputs at a higher rate are recovered between the epochs
REPORT_ROWS = 4000
HOPELESS_RAD = np.radians(20.0)  # of attitude: beyond it neither the linearisation nor a user can do anything with the result
PRODUCTS = ("trajectory.sbet", "trajectory.smrmsg", "trajectory.csv", "report.html", "report.json")  # besides those of the images


@dataclass(frozen=True)
class ProcessResult:
    """Products of a run. report: what report.json holds. eo: None without camera events."""

    report: dict[str, Any]
    files: tuple[Path, ...]
    eo: ExteriorOrientation | None
    trajectory: Trajectory
    diagnostics: Diagnostics

    def summary(self) -> str:
        """A few lines for the terminal."""
        return "\n".join([self.report["headline"], *self.report["verdict"], *(f"wrote {file}" for file in self.files)])


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


def process(flight: Flight, out: Path | None = None, progress: Progress = quiet) -> ProcessResult:
    """The main job: from a flight file to the exterior orientation of every image and its report.

    out : directory of the products instead of the flight file's.
    Raises InputError where the input is wrong or contradicts itself, DataError where it does not support the answer.
    """
    directory = _target(flight, out)
    clock = _Clock(progress)
    clock.step("read")
    recording = read_recording(flight)
    _refuse(flight, recording.checks)
    clock.step("prepare")
    problem, inside, grid = _prepare(flight, recording)
    events, week, checks = recording.events, recording.gps_week, recording.checks
    samples = recording.imu.time.size
    del recording  # the samples are in the increments now
    clock.step("align")
    start, how = _align(flight, problem)
    from .navigation.solution import solve, trajectory

    solution = solve(problem, start, flight.filter.second_pass, clock.step)
    clock.step("orient")
    path = _trajectory(flight, solution, grid, week)
    rows = _report_rows(solution)
    sampled = trajectory(solution, rows, week)
    heading = _check_heading(flight, sampled)
    at_exposure = None if events is None else trajectory(solution, solution.event_epochs, week, events=True)
    _refuse_hopeless(flight, sampled if at_exposure is None else at_exposure)
    history = _history(flight, week, inside, solution, how, (*checks, heading))
    eo = None
    if events is not None and at_exposure is not None:
        from .geodesy.frames import TangentPlane
        from .orient.exterior import exterior_orientation

        plane = TangentPlane(*_origin(flight, inside))
        eo = exterior_orientation(at_exposure, events, flight.mounting, plane, history)
    clock.step("report")
    diagnostics = _diagnostics(solution, rows, sampled, (*checks, heading))
    report = _summary(flight, diagnostics, eo, history, clock, samples, solution.time.size)
    clock.step("write")
    files = _deliver(flight, directory, eo, path, report, diagnostics)
    clock.step("")
    return ProcessResult(report, files, eo, path, diagnostics)


def _target(flight: Flight, out: Path | None) -> Path:
    """Directory of the products, once it is clear that they can be written there and take no input's place.

    Raises UsageError where it was named by the command, InputError where it was by the flight file.
    """
    from .formats import EXPORTS

    directory = flight.output.directory if out is None else Path(out)
    refusal, where = (InputError, f"{flight.path}: output.directory") if out is None else (UsageError, "--out")
    above = next(d for d in (directory, *directory.parents) if d.exists())
    if not above.is_dir():
        raise refusal(f"{where}: {above} is a file, a directory is expected; give another one")
    try:
        os.rmdir(tempfile.mkdtemp(prefix=".insgnss-", dir=above))
    except OSError as error:
        raise refusal(
            f"{where}: cannot write in {above}: {error.strerror or error}; check its permissions or give another directory"
        ) from None
    inputs = [file.resolve() for file in _inputs(flight)]
    for name in (*PRODUCTS, *(EXPORTS[form][1] for form in (*flight.output.formats, "eo_json"))):
        if (directory / name).resolve() in inputs:
            raise refusal(f"{where}: the product {name} would overwrite the input {directory / name}; give another directory")
        if (directory / name).is_dir():
            raise refusal(f"{where}: {directory / name} is a directory and in the way of a product; give another directory")
    return directory


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


def _prepare(flight: Flight, recording: Recording) -> "tuple[Problem, GnssFixes, np.ndarray]":
    """The estimation problem, the fixes within the span, and the epochs of the output grid."""
    from .geodesy.frames import LocalFrame
    from .navigation.filter import Problem, gate_from_sigma, make_epochs
    from .navigation.layout import state_layout
    from .prepare.clock import common_span, cut_fixes, refuse_outside
    from .prepare.increments import body_increments, merge_marks
    from .stochastic.model import load_noise_model

    lo, hi = common_span(recording.imu, recording.gnss, flight.start_tow, flight.end_tow)
    fixes = cut_fixes(recording.gnss, lo, hi)
    events = recording.events
    exposure = np.zeros(0)
    if events is not None:
        refuse_outside(events, lo, hi)
        exposure = events.time
    rate = min(flight.output.trajectory_hz or EPOCH_HZ, EPOCH_HZ)
    grid_time = lo + np.arange(int((hi - lo) * rate + 1e-6) + 1) / rate
    marks, (at_fix, at_event, at_grid) = merge_marks(fixes.time, exposure, grid_time)
    inc = body_increments(recording.imu, flight.imu.C_b_imu, marks)
    frame = LocalFrame(float(fixes.lat[0]), float(fixes.lon[0]), float(fixes.height[0]))
    layout = state_layout(load_noise_model(flight.imu.noise), flight.filter.scale_factor, flight.filter.misalignment)
    epochs = make_epochs(inc, at_fix, fixes, at_event, frame)
    interval = float(np.median(np.diff(fixes.time)))
    gate = gate_from_sigma(flight.gnss.gate_sigma)
    return Problem(inc, epochs, frame, layout, flight.mounting.antenna_lever_b, gate, interval), fixes, at_grid


def _align(flight: Flight, problem: "Problem") -> "tuple[Start, str]":
    from .align.initial import given_attitude, initial_state

    if flight.initial is not None:
        given = flight.initial
        rpy = np.radians([given.roll_deg, given.pitch_deg, given.heading_deg])
        return given_attitude(problem, rpy, np.radians(given.sigma_deg)), "initial attitude from the flight file"
    alignment = initial_state(problem)
    first, last = alignment.window
    sigma = np.degrees(alignment.heading_sigma)
    return alignment.start, (
        f"initial attitude from the motion between {first:.1f} and {last:.1f} s (heading to {sigma:.2f} deg there), "
        "filtered back to the first fix"
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
    from .prepare.plausibility import check_heading

    check = check_heading(rpy_from_rotation(sampled.C_nb)[:, 2], sampled.velocity_ned, flight.imu.C_b_imu)
    _refuse(flight, (check,))
    return check


def _history(flight: Flight, week: int, fixes: GnssFixes, solution: "Solution", how: str, checks: tuple[Check, ...]) -> tuple[str, ...]:
    from .navigation.filter import REOPENED, USED

    lever = flight.mounting.antenna_lever_b
    used = int(np.isin(solution.verdict[:, 0], (USED, REOPENED)).sum())
    reopened = int((solution.verdict[:, 0] == REOPENED).sum())
    problem = solution.problem
    passes = f"{solution.passes} filter pass{'es' if solution.passes > 1 else ''}"
    return (
        f"insgnss {__version__}; smoothed, {problem.layout.size} states, {passes}; GPST week {week}",
        f"GNSS: {used} of {fixes.time.size} fixes used, innovation gate {flight.gnss.gate_sigma:g} sigma, filter reopened {reopened} times",
        f"lever arm IMU to antenna applied, forward right down m: {lever[0]:.4f} {lever[1]:.4f} {lever[2]:.4f}",
        f"noise model {flight.imu.noise}; IMU axes {flight.imu.axes}; {how}",
        f"{len(problem.inc.gaps)} IMU gaps bridged; heights ellipsoidal (WGS84)",
        "lever arm IMU to camera and bore-sight applied",
        *(f"contradiction overruled by the flight file: {c.name}: {c.found}" for c in checks if c.verdict == "contradiction"),
    )


def _diagnostics(solution: "Solution", rows: np.ndarray, sampled: Trajectory, checks: tuple[Check, ...]) -> Diagnostics:
    from .geodesy.rotation import rpy_from_rotation
    from .navigation.filter import NOTHING, REJECTED, REOPENED, USED

    bias, bias_sigma = solution.channel_bias(rows)
    fix = np.flatnonzero(solution.verdict[:, 0] != NOTHING)
    speed = np.flatnonzero(solution.verdict[:, 1] != NOTHING)
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
        used=solution.verdict[fix, 0] != REJECTED,
        reopened=solution.time[solution.verdict[:, 0] == REOPENED],
        separation_time=solution.time[solution.separation_epoch],
        separation=solution.separation,
        separation_sigma=solution.separation_sigma,
        gaps=solution.problem.inc.gaps,
        passes=solution.passes,
        velocity_nis=solution.nis[speed, 1] if speed.size else None,
        velocity_used=solution.verdict[speed, 1] == USED if speed.size else None,
        checks=checks,
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

    inputs = {os.path.relpath(file, flight.path.parent): _sha256(file) for file in _inputs(flight)}
    versions = {"insgnss": __version__, "python": platform.python_version(), "numpy": np.__version__}
    return run_summary(
        diagnostics, eo, flight.resolved(), inputs, versions, dict(clock.seconds), history, imu_samples=samples, epochs=epochs
    )


def _inputs(flight: Flight) -> list[Path]:
    files = [flight.path, flight.imu.file, flight.gnss.file]
    if flight.camera is not None:
        files.append(flight.camera.events)
    if isinstance(flight.imu.noise, Path):
        files.append(flight.imu.noise)
    return files


def _sha256(file: Path) -> str:
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _deliver(
    flight: Flight, out: Path, eo: ExteriorOrientation | None, path: Trajectory, report: dict[str, Any], diagnostics: Diagnostics
) -> tuple[Path, ...]:
    """Write every product into a directory beside the target and move them in together: all of them, or none."""
    from .formats import EXPORTS
    from .formats.sbet import write_sbet, write_smrmsg
    from .formats.trajectory_csv import write_trajectory_csv
    from .report.page import write_report, write_report_json

    out = Path(out)
    made = [d for d in (out, *out.parents) if not d.exists()]
    out.mkdir(parents=True, exist_ok=True)
    staging = Path(tempfile.mkdtemp(prefix=".insgnss-", dir=out))
    try:
        if eo is not None:
            for name in dict.fromkeys([*flight.output.formats, "eo_json"]):
                write, product, _ = EXPORTS[name]
                write(eo, staging / product)
        write_sbet(path, staging / "trajectory.sbet")
        write_smrmsg(path, staging / "trajectory.smrmsg")
        write_trajectory_csv(path, staging / "trajectory.csv")
        write_report(staging / "report.html", report, diagnostics, eo)
        write_report_json(report, staging / "report.json")
        files = sorted(staging.iterdir())
        for file in files:
            os.replace(file, out / file.name)
    except BaseException:
        shutil.rmtree(staging, ignore_errors=True)
        for directory in made:
            _remove_if_empty(directory)
        raise
    staging.rmdir()
    return tuple(out / file.name for file in files)


def _remove_if_empty(directory: Path) -> None:
    if directory.exists() and not any(directory.iterdir()):
        directory.rmdir()


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
