"""insgnss: raw IMU and GNSS of a mapping drone to the exterior orientation of every image.

The data flow read -> prepare -> align -> filter -> smooth -> orient -> export; each step is a room
of a wing, and wings hand each other the frozen records of :mod:`insgnss.records`.

Public names
------------
Everything that a program needs is a name of `insgnss` itself; rooms may move, these names stay.
Importing the package loads none of them: each is loaded when it is first used.

Run
    `estimate` (arrays in, result out), `process` (a flight file), `adjust_block` (an image block
    with aerial control), `inspect`, `tune`, `calibrate_imu`, `ppk`, `export`, `compare`,
    `simulate`, `figures` of a page; the result of the first two is a `ProcessResult`.
    `relative_control` between images.
    `calibrate_tripod`, `calibrate_similarity`, `calibrate_materialise`, `calibrate_mounting`: lever
    arms, bore-sight and camera delay with verdicts.
    `predict_targets` and `measure_targets`: ground points in photographs, where a `Target` lies.
Read
    `read_imu`, `read_gnss`, `read_events`, `read_barometer`, `read_eo`, `read_poses`,
    `read_trajectory`, `load_flight`, `load_block`, `load_noise_model`, `write_noise_model`,
    `read_mounting`.
Records
    `ImuSamples`, `GnssFixes`, `CameraEvents`, `BarometerHeights`, `Trajectory`,
    `ExteriorOrientation`, `ImuBiases`, `Innovations`, `Check`, `RelativeControl`.
Say how
    `Flight`, `Mounting`, `boresight_from_angles`, `CameraInput` and `CameraMounting` (of a rig),
    `FilterOptions`, `InitialAttitude`, `TangentPlane`, `NoiseModel`, `AxisNoise`, `GaussMarkov`,
    `TuneOptions`, `EngineOptions`, `ImuFaults`.
Noise
    `simulate_noise`, `wavelet_variance` of samples, `haar_variance` of a model, `WaveletVariance`.
Errors
    `InsgnssError`, of it `UsageError` (its kind `OptionError`: of a value), `InputError` and
    `DataError`.

Conventions, stated here once
-----------------------------
Frames
    i inertial; e ECEF (WGS84); n local north-east-down at the point itself; l the flight's *local
    frame*: Cartesian, Earth-fixed, axes north-east-down at one reference point (`LocalFrame`); b
    body forward-right-down (FRD); c camera as computer vision has it (x image right, y image down,
    z viewing direction); m mapping: the tangent plane, Cartesian, Earth-fixed, axes east-north-up
    at its origin.
Rotations
    `C_nb` takes components in b into components in n; inner letters cancel: ``C_eb = C_en @ C_nb``,
    ``v_n = C_nb @ v_b``. Quaternions are (w, x, y, z), Hamilton, of the same direction as the
    matrix: ``q_lb`` belongs to ``C_lb``.
Vectors
    `r_ba_b` goes from the origin of b to a, written in the axes of b (the lever arm). `omega_ib_b`:
    rate of b with respect to i, in b.
Error state
    *truth = estimate + error*, for every state; for attitude ``C(true) = exp([psi x]) C(estimate)``
    with psi in the axes of the left-hand frame (l inside the filter, n in a trajectory, m in an
    exterior orientation).
Units
    SI and radians. Degrees only in files and on screen, and in names that say so (`heading_deg`).
    Noise densities are root power spectral densities and carry their unit in the name.
Time
    float64 seconds of one GPS week (GPST), the week beside it. Other scales and week roll-over are
    dealt with by readers. Past the week's end the seconds go on counting (they are not folded
    back).
"""

from typing import TYPE_CHECKING as _TYPE_CHECKING
from typing import Any as _Any

from .base import __version__ as __version__
from .base.caches import settle as _settle

if _TYPE_CHECKING:
    from .api.calibration import calibrate_materialise as calibrate_materialise
    from .api.calibration import calibrate_mounting as calibrate_mounting
    from .api.calibration import calibrate_similarity as calibrate_similarity
    from .api.calibration import calibrate_tripod as calibrate_tripod
    from .api.calibration import read_mounting as read_mounting
    from .api.estimation import estimate as estimate
    from .api.products import compare as compare
    from .api.products import export as export
    from .api.products import figures as figures
    from .api.products import ppk as ppk
    from .api.products import relative_control as relative_control
    from .api.readers import read_eo as read_eo
    from .api.readers import read_poses as read_poses
    from .api.readers import read_trajectory as read_trajectory
    from .api.targets import measure_targets as measure_targets
    from .api.targets import predict_targets as predict_targets
    from .api.verbs import adjust_block as adjust_block
    from .api.verbs import calibrate_imu as calibrate_imu
    from .api.verbs import inspect as inspect
    from .api.verbs import process as process
    from .api.verbs import simulate as simulate
    from .api.verbs import tune as tune
    from .base.errors import DataError as DataError
    from .base.errors import InputError as InputError
    from .base.errors import InsgnssError as InsgnssError
    from .base.errors import UsageError as UsageError
    from .flight.config.block_file import load_block as load_block
    from .flight.config.filter_options import FilterOptions as FilterOptions
    from .flight.config.filter_options import InitialAttitude as InitialAttitude
    from .flight.config.flight_file import Flight as Flight
    from .flight.config.load import load_flight as load_flight
    from .flight.processing.pipeline import ProcessResult as ProcessResult
    from .geodesy.frames import TangentPlane as TangentPlane
    from .geodesy.gpstime import gps_from_dates as gps_from_dates
    from .gnss.options import EngineOptions as EngineOptions
    from .io.formats import read_barometer as read_barometer
    from .io.formats import read_events as read_events
    from .io.formats import read_gnss as read_gnss
    from .io.formats import read_imu as read_imu
    from .io.options.camera_options import CameraInput as CameraInput
    from .io.options.camera_options import CameraMounting as CameraMounting
    from .navigation.noise_model.model import AxisNoise as AxisNoise
    from .navigation.noise_model.model import GaussMarkov as GaussMarkov
    from .navigation.noise_model.model import NoiseModel as NoiseModel
    from .navigation.noise_model.model import load_noise_model as load_noise_model
    from .navigation.noise_model.model import write_noise_model as write_noise_model
    from .noise.moments.theory import haar_variance as haar_variance
    from .noise.moments.wavelet import wavelet_variance as wavelet_variance
    from .noise.processes.realisation import simulate_noise as simulate_noise
    from .noise.tuning.options import TuneOptions as TuneOptions
    from .photogrammetry.target_measurement.request import Target as Target
    from .records import BarometerHeights as BarometerHeights
    from .records import CameraEvents as CameraEvents
    from .records import Check as Check
    from .records import ExteriorOrientation as ExteriorOrientation
    from .records import GnssFixes as GnssFixes
    from .records import ImuBiases as ImuBiases
    from .records import ImuSamples as ImuSamples
    from .records import Innovations as Innovations
    from .records import Trajectory as Trajectory
    from .records import WaveletVariance as WaveletVariance
    from .records.cameras.mounting import Mounting as Mounting
    from .records.cameras.mounting import boresight_from_angles as boresight_from_angles
    from .records.measurements import Measurement as Measurement
    from .records.measurements import Motion as Motion
    from .records.measurements import OwnState as OwnState
    from .records.relative import RelativeControl as RelativeControl
    from .simulation.faults import ImuFaults as ImuFaults

_settle()

_ROOMS = {  # where each public name is defined; loaded when it is first used
    "api.calibration": (
        *("calibrate_materialise", "calibrate_mounting", "calibrate_similarity"),
        *("calibrate_tripod", "read_mounting"),
    ),
    "api.estimation": ("estimate",),
    "api.products": ("compare", "export", "figures", "ppk", "relative_control"),
    "api.readers": ("read_eo", "read_poses", "read_trajectory"),
    "api.targets": ("measure_targets", "predict_targets"),
    "api.verbs": ("adjust_block", "calibrate_imu", "inspect", "process", "simulate", "tune"),
    "io.options.camera_options": ("CameraInput", "CameraMounting"),
    "flight.config.filter_options": ("FilterOptions", "InitialAttitude"),
    "flight.config.flight_file": ("Flight",),
    "flight.config.block_file": ("load_block",),
    "flight.config.load": ("load_flight",),
    "base.errors": ("DataError", "InputError", "InsgnssError", "UsageError"),
    "io.formats": ("read_barometer", "read_events", "read_gnss", "read_imu"),
    "geodesy.frames": ("TangentPlane",),
    "geodesy.gpstime": ("gps_from_dates",),
    "gnss.options": ("EngineOptions",),
    "records.cameras.mounting": ("Mounting", "boresight_from_angles"),
    "flight.processing.pipeline": ("ProcessResult",),
    "records": (
        *("BarometerHeights", "CameraEvents", "Check", "ExteriorOrientation", "GnssFixes"),
        *("ImuBiases", "ImuSamples", "Innovations", "Trajectory", "WaveletVariance"),
    ),
    "records.measurements": ("Measurement", "Motion", "OwnState"),
    "records.relative": ("RelativeControl",),
    "simulation.faults": ("ImuFaults",),
    "navigation.noise_model.model": (
        "AxisNoise",
        "GaussMarkov",
        "NoiseModel",
        "load_noise_model",
        "write_noise_model",
    ),
    "noise.moments.theory": ("haar_variance",),
    "noise.moments.wavelet": ("wavelet_variance",),
    "noise.processes.realisation": ("simulate_noise",),
    "photogrammetry.target_measurement.request": ("Target",),
    "noise.tuning.options": ("TuneOptions",),
}
_HOME = {name: room for room, names in _ROOMS.items() for name in names}

__all__ = sorted((*_HOME, "__version__"))


def __getattr__(name: str) -> _Any:
    """Load a public name when it is first used."""
    if name not in _HOME:
        raise AttributeError(f"module 'insgnss' has no attribute {name!r}")
    from importlib import import_module

    value = globals()[name] = getattr(import_module(f".{_HOME[name]}", __name__), name)
    return value


def __dir__() -> list[str]:
    """Return the public names."""
    return __all__
