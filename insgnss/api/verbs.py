"""The verbs of the command line as functions of Python: process, adjust_block, inspect, tune,
calibrate_imu, simulate.
"""

import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, overload

from ..base.advance import heard, logged
from ..base.errors import UsageError
from ..base.inputs import Source, reading
from ..records import ImuSamples, Quantity
from .keywords import path_of

if TYPE_CHECKING:
    from ..flight.config.block_file import BlockFile, Mode
    from ..flight.config.block_tables.aerial_control import ControlKind
    from ..flight.config.flight_file import Flight
    from ..flight.inspection.described import FlightInspection
    from ..flight.inspection.rinex.result import RinexInspection
    from ..flight.inspection.run import Inspection
    from ..flight.processing.pipeline import ProcessResult
    from ..navigation.noise_model.model import NoiseModel
    from ..noise.multi_position.result import MultiPosition
    from ..noise.tuning.in_flight.estimation import FlightTuning
    from ..noise.tuning.result import TuneResult
    from ..noise.tuning.several import SeveralTuned
    from ..photogrammetry.block_adjustment.run import AdjustmentResult
    from ..simulation.dataset import Dataset
    from ..simulation.faults import ImuFaults
    from ..simulation.scenario import SimulatedFlight

Progress = Callable[[str], None]
FLIGHT_FILE = "flight.toml"


@heard
@reading()
def process(
    flight: "Flight | Source",
    out: Source | None = None,
    *,
    write: bool = True,
    force: bool = False,
    progress: Progress = logged,
) -> "ProcessResult":
    """Process a flight: raw data in, exterior orientation, trajectory and report out.

    Parameters
    ----------
    flight : a flight file, the directory that holds flight.toml, or a `Flight`.
    out : directory of the products; None: the flight file's output.directory.
    write : whether to write the products; False: they are in the result only.
    force : whether to overwrite results of other measurements.
    progress : is called with the name of each step.

    Returns
    -------
    The result: `trajectory`, `eo` (None without a camera), `biases`, `innovations`, `states`,
    `checks`, `diagnostics`, `report` (what report.json holds), `files` and `summary()`.

    Raises
    ------
    InputError : the flight file or an input is wrong, or they contradict each other.
    DataError : the data do not support an answer.
    UsageError : the products cannot be written into `out`.
    """
    from ..batch.season.earlier import earlier_flights
    from ..flight.processing.pipeline import process as run

    return run(flight_of(flight), path_of(out), progress, write, force, compare=earlier_flights)


def flight_of(flight: "Flight | Source") -> "Flight":
    """Return a flight file that may have been read already."""
    from ..flight.config.flight_file import Flight
    from ..flight.config.load import load_flight

    return flight if isinstance(flight, Flight) else load_flight(Path(flight))


@heard
@reading()
def adjust_block(
    block: "BlockFile | Source",
    out: Source | None = None,
    *,
    mode: "Mode | None" = None,
    control: "ControlKind | None" = None,
    trajectory: "Flight | Source | None" = None,
    write: bool = True,
    force: bool = False,
    progress: Progress = logged,
) -> "AdjustmentResult":
    """Adjust an image block with its aerial control (integrated sensor orientation).

    Parameters
    ----------
    block : a block file, the directory that holds block.toml, or what `load_block` gave.
    out : directory of the products; None: the block file's output.directory.
    mode : "iso", "indirect", "fast_at" or "direct"; None: the block file's adjustment.mode.
    control : "Ap/Aa", "Ap/Ra", "Rp/Ra", "Ap" or "Rp", absolute or relative position and attitude;
        None: the block file's aerial_control.control.
    trajectory : the flight file of the orientation, its directory, or a `Flight`: the images
        correct its trajectory, with products in the directory trajectory of `out`.
    write : whether to write the products; False: they are in the result only.
    force : whether to overwrite results of other image observations.
    progress : is called with the name of each step.

    Returns
    -------
    The result: `figures` (what adjust.json holds), `judgement` (headline, findings, what was
    determined), `solved` (values and covariances), `files`, `trajectory` (what `process` gives,
    after the images) and `summary()`.

    Raises
    ------
    InputError : the block file or an input is wrong, or they do not belong together.
    DataError : the observations do not determine the unknowns.
    UsageError : the products cannot be written into `out`.
    """
    from ..flight.config.block_file import BlockFile, load_block
    from ..photogrammetry.block_adjustment.run import adjust

    file = block if isinstance(block, BlockFile) else load_block(Path(block))
    changes: dict[str, Any] = {}
    if mode is not None:
        changes["adjustment"] = replace(file.adjustment, mode=mode)
    if control is not None:
        changes["aerial_control"] = replace(file.aerial_control, control=control)
    file = replace(file, **changes)
    flight = None if trajectory is None else flight_of(trajectory)
    return adjust(file, path_of(out), progress, write, force, flight)


@heard
def inspect(
    source: "Flight | Source | Sequence[Source]", *, progress: Progress = logged
) -> "FlightInspection | Inspection | RinexInspection":
    """Say what a recording is, without processing it.

    Parameters
    ----------
    source : a flight file or a `Flight`, whose claims are held against the data; or the files of a
        recording, or their directory, that no flight file describes.
    progress : is called with the name of each step.

    Returns
    -------
    What was found, with `summary()`, `as_dict()`, and `refusal`: the error that `process` would
    raise, or None. Of an undescribed recording `write(path)` drafts the flight file.

    Raises
    ------
    InputError : a file cannot be read, or there is not one recording.
    DataError : the samples cannot become a flight.
    """
    from ..flight.config.flight_file import Flight
    from ..flight.inspection.described import flight_file, inspect_flight
    from ..flight.inspection.run import inspect_files

    if isinstance(source, Flight):
        return inspect_flight(source, progress)
    paths = (
        [Path(source)] if isinstance(source, str | os.PathLike) else [Path(path) for path in source]
    )
    described = flight_file(paths, False)
    return (
        inspect_files(paths, progress) if described is None else inspect_flight(described, progress)
    )


@heard
@reading()
def tune(
    source: "Flight | Source | Sequence[Source]",
    *,
    out: Source | None = None,
    force: bool = False,
    parameters: Sequence[str] | None = None,
    progress: Progress = logged,
    **options: Any,
) -> "TuneResult | FlightTuning | SeveralTuned":
    """Estimate a noise model from static recordings of an IMU, or from the innovations of a flight.

    The model is written, with its table and figures beside it.

    Parameters
    ----------
    source : one or several static recordings of one IMU, or a file of published variances; or a
        `Flight`, a flight file (.toml), or a directory that holds flight.toml.
    out : file of the noise model; None: imu_noise.toml here, of a flight in_flight_noise.toml
        beside its file.
    force : whether files of other recordings are overwritten.
    parameters : of a flight, what to estimate; None: white noise of gyroscopes and accelerometers.
    progress : is called with the name of each step.
    **options : of static recordings, fields of `insgnss.TuneOptions`, such as ``model="WN+2GM"``.

    Returns
    -------
    The result, with `model`, `summary()` and `as_dict()`; of several IMUs `tuned`, one for each.

    Raises
    ------
    UsageError : an option is unknown or belongs to the other kind of source, a source is no path,
        or files are of other recordings.
    InputError : a recording cannot be read.
    DataError : the recording does not support a model.
    """
    from ..flight.config.changes import with_changes
    from ..flight.config.flight_file import Flight
    from ..noise.tuning.options import TuneOptions

    target = path_of(out)
    if isinstance(source, str | os.PathLike) and _is_flight(Path(source)):
        source = flight_of(source)
    if isinstance(source, Flight):
        if options:
            raise UsageError(
                f"tune: {next(iter(options))} is an option of static recordings, and the source "
                "is a flight; leave the option out"
            )
        from ..noise.tuning.several import tune_each

        return tune_each(source, target, parameters, progress, force)
    if parameters is not None:
        raise UsageError(
            "tune: parameters is an option of flights; for static recordings name the noise "
            "processes with model"
        )
    from ..noise.tuning.static import tune_static

    paths: Sequence[Any] = source if isinstance(source, list | tuple) else [source]
    no_paths = [path for path in paths if not isinstance(path, str | os.PathLike)]
    if no_paths:
        raise UsageError(
            f"tune: {type(no_paths[0]).__name__} is not a path of a file; save the table (n, 7) "
            'of time, gyro, accel by np.save and give its path, with gyro_unit="rad/s"'
        )
    chosen = with_changes(TuneOptions(), options)
    return tune_static([Path(path) for path in paths], chosen, target, force, progress)


@heard
@reading()
def calibrate_imu(
    imu: ImuSamples | Source,
    *,
    latitude_deg: float | None = None,
    height_m: float = 0.0,
    out: Source | None = None,
    **reading: Any,
) -> "MultiPosition":
    """Estimate bias, scale factors and non-orthogonality of an IMU in nine or more positions.

    Parameters
    ----------
    imu : samples, or a file of them.
    latitude_deg : of the place, for its gravity; None: 9.80665 m/s^2 with 0.02 m/s^2.
    height_m : of the place above the ellipsoid.
    out : file of the calibration, which imu.calibration of a flight file takes; None: none.
    **reading : of a file, how to read it, as in `insgnss.read_imu`.

    Returns
    -------
    The estimates with standard errors, with `calibration`, `summary()` and `as_dict()`.

    Raises
    ------
    UsageError : the latitude is none, or `reading` is given with samples.
    InputError : the file cannot be read.
    DataError : there are too few positions, or the result is no calibration.
    """
    if latitude_deg is not None and not abs(latitude_deg) <= 90.0:
        raise UsageError(
            f"calibrate_imu: latitude {latitude_deg} deg is beyond 90; give degrees, north positive"
        )
    if reading and isinstance(imu, ImuSamples):
        raise UsageError(
            f"calibrate_imu: {next(iter(reading))} is an option for reading a file, but samples "
            "are given; leave the option out"
        )
    import numpy as np

    from ..io.formats import read_imu
    from ..navigation.prepare.calibration import write_calibration
    from ..noise.multi_position.calibration import calibrate_multi_position

    samples = imu if isinstance(imu, ImuSamples) else read_imu(Path(imu), **reading)
    latitude = None if latitude_deg is None else float(np.radians(latitude_deg))
    result = calibrate_multi_position(samples, latitude, height_m)
    if out is not None:
        write_calibration(result.calibration, Path(out), tuple(result.summary().splitlines()))
    return result


@overload
def simulate(
    flight: str = "ign8",
    minutes: float | None = None,
    *,
    directory: None = None,
    imu_rate_hz: float = 500.0,
    noise: "str | NoiseModel | None" = "navchip",
    imu_quantity: Quantity = "mean_rate",
    imu_axes: str = "forward right down",
    gnss_rate_hz: float = 10.0,
    gnss_sigma_m: tuple[float, float, float] = (0.02, 0.02, 0.03),
    gnss_sigma_velocity_mps: tuple[float, float, float] | None = None,
    vibration: float = 1.0,
    imu_faults: "ImuFaults | None" = None,
    seed: int = 0,
    **changes: Any,
) -> "SimulatedFlight": ...
@overload
def simulate(
    flight: str = "ign8",
    minutes: float | None = None,
    *,
    directory: Source,
    imu_rate_hz: float = 500.0,
    noise: "str | NoiseModel | None" = "navchip",
    imu_quantity: Quantity = "mean_rate",
    imu_axes: str = "forward right down",
    gnss_rate_hz: float = 10.0,
    gnss_sigma_m: tuple[float, float, float] = (0.02, 0.02, 0.03),
    gnss_sigma_velocity_mps: tuple[float, float, float] | None = None,
    vibration: float = 1.0,
    imu_faults: "ImuFaults | None" = None,
    seed: int = 0,
    **changes: Any,
) -> "Dataset": ...
def simulate(
    flight: Literal["ign8", "ign6x1", "car", "walk"] | str = "ign8",
    minutes: float | None = None,
    *,
    directory: Source | None = None,
    imu_rate_hz: float = 500.0,
    noise: "str | NoiseModel | None" = "navchip",
    imu_quantity: Quantity = "mean_rate",
    imu_axes: str = "forward right down",
    gnss_rate_hz: float = 10.0,
    gnss_sigma_m: tuple[float, float, float] = (0.02, 0.02, 0.03),
    gnss_sigma_velocity_mps: tuple[float, float, float] | None = None,
    vibration: float = 1.0,
    imu_faults: "ImuFaults | None" = None,
    seed: int = 0,
    **changes: Any,
) -> "SimulatedFlight | Dataset":
    """Simulate the recording of a flight or a drive, with its truth.

    Parameters
    ----------
    flight : "ign8" (block), "ign6x1" (corridor), "car" (a drive in a town) or "walk".
    minutes : length of the record; None: that of the plan, of a drive 5.
    directory : where to write it as a data set with its flight file; None: it stays in memory.
    imu_rate_hz : IMU samples a second.
    noise : noise model of the IMU, or the name of a shipped one; None: an ideal sensor.
    imu_quantity : what a sample is, "mean_rate", "increments" or "instant_rate".
    imu_axes : body directions of the sensor's x, y, z.
    gnss_rate_hz : fixes a second.
    gnss_sigma_m : standard deviations of the fixes north, east, down, m.
    gnss_sigma_velocity_mps : the same of their velocities, m/s; None: no velocities.
    vibration : factor of the IMU's white noise in motion against the model.
    imu_faults : of the IMU's recording, `insgnss.ImuFaults`; None: none.
    seed : of everything random; the same arguments give the same numbers.
    **changes : of a flight fields of its plan, such as ``start_in_air=True`` or ``wind_ms=8.0``; of
        a drive ``stand_s``.

    Returns
    -------
    The flight: `imu`, `gnss`, `events`, `mounting` and `truth` (`eo`, `trajectory`, `gyro_bias`,
    `accel_bias`); with a directory the data set: `flight_file`, and `simulated`, the flight.

    Raises
    ------
    UsageError : the flight or a field is unknown, the plan is not feasible, or the directory is not
        empty.

    Examples
    --------
    >>> import insgnss
    >>> sim = insgnss.simulate("ign8", minutes=1.0, imu_rate_hz=100.0, start_in_air=True)
    >>> sim.imu
    <ImuSamples 6000 samples, TOW 205200.0 to 205260.0 s, week 2008, 100 Hz, mean_rate>
    """
    from ..simulation.dataset import write_simulated
    from ..simulation.faults import ImuFaults
    from ..simulation.raw_gnss.receiver import GnssOptions
    from ..simulation.scenario import simulate_flight
    from ..simulation.sensors import ImuOptions

    faults = imu_faults or ImuFaults()
    imu = ImuOptions(imu_rate_hz, noise, imu_axes, imu_quantity, vibration=vibration, faults=faults)
    gnss = GnssOptions(gnss_rate_hz, gnss_sigma_m, velocity_sigma_ms=gnss_sigma_velocity_mps)
    simulated = simulate_flight(flight, minutes, seed=seed, imu=imu, gnss=gnss, **changes)
    if directory is None:
        return simulated
    return write_simulated(directory, simulated, seed=seed)


def _is_flight(path: Path) -> bool:
    return path.suffix.lower() == ".toml" or (path / FLIGHT_FILE).is_file()
