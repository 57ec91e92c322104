"""The smoother on arrays: everything that `process` does with a flight file, without any file."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from inspect import signature
from pathlib import Path
from typing import Any

from ..base.advance import heard, logged
from ..base.errors import UsageError
from ..base.wording import spoken_as
from ..flight.config.barometer_options import BarometerInput
from ..flight.config.filter_options import FilterOptions, InitialAttitude
from ..flight.config.flight_file import Flight, Output, change_flight
from ..flight.config.gnss_options import GnssInput
from ..flight.config.imu_options import ImuInput
from ..flight.processing.pipeline import ProcessResult, process
from ..geodesy.frames import TangentPlane
from ..io.options.camera_options import CameraInput
from ..navigation.noise_model.model import NoiseModel
from ..navigation.prepare.clock import NO_WEEK
from ..records import (
    Finding,
    Quantity,
    Question,
    barometer_heights,
    camera_events,
    gnss_fixes,
    imu_samples,
)
from ..records.cameras.mounting import Mounting
from ..records.measurements import Measurement

WHO = Path("insgnss.estimate")
# of [output], and no matter of files
OF_NO_FILE = ("output__trajectory_hz", "output__strip_covariance")
SPOKEN = {
    "filter": "filter_options",
    "initial": "initial_attitude",
    "imu.axes": "imu_axes",
    "imu.noise": "noise",
    "imu.quantity": "imu_quantity",
    "output.trajectory_hz": "trajectory_hz",
}
"""What the keys of a flight file are called here."""


@heard
def estimate(
    imu: Any,
    gnss: Any,
    events: Any = None,
    *,
    barometer: Any = None,
    measurements: Sequence[Measurement] = (),
    mounting: Mounting | None = None,
    noise: str | os.PathLike[str] | NoiseModel = "navchip",
    gps_week: int | None = None,
    imu_quantity: Quantity = "mean_rate",
    imu_axes: str = "forward right down",
    gnss_sigma_m: Sequence[float] | None = None,
    gnss_sigma_velocity_mps: Sequence[float] | None = None,
    tangent_plane: Sequence[float] | TangentPlane | None = None,
    initial_attitude: InitialAttitude | None = None,
    filter_options: FilterOptions | None = None,
    trajectory_hz: float | None = 10.0,
    accept: Sequence[str] = (),
    progress: Callable[[str], None] = logged,
    **changes: Any,
) -> ProcessResult:
    """Estimate trajectory, biases and exterior orientation from arrays; no file is read or written.

    It runs the checks, the alignment, the filter and the smoother of `process`, and gives the same
    numbers as a flight file that says the same.

    Parameters
    ----------
    imu : `ImuSamples`; (n, 7) array of time s, angular rate x y z rad/s, specific force x y z
        m/s^2, in the sensor's own axes; or a mapping or pandas table with the columns tow, gx, gy,
        gz, ax, ay, az, of which in a mapping `gyro` and `accel` (n, 3) may stand for three each.
        Rows must be in the order of time, as those of all arrays (`read_imu` and the other readers
        put those of a file in order).
    gnss : `GnssFixes`; (m, 4) array of time s, latitude deg, longitude deg, ellipsoidal height m of
        the antenna's phase centre, or (m, 7) with the standard deviations north, east, down, m; or
        a mapping or pandas table with the columns tow, lat_deg, lon_deg (or lat_rad, lon_rad), h_m,
        and as far as known sd_n_m, sd_e_m, sd_d_m, vn, ve, vd, sd_vn, sd_ve, sd_vd, quality.
    events : mid-exposure instants: `CameraEvents`; (k,) times, s; or a mapping or pandas table with
        the columns image and tow. None: there is no camera. Further cameras of a rig are
        ``camera__further=[insgnss.CameraInput(events=..., name="left", mounting=...)]``.
    barometer : heights of a barometer: `BarometerHeights`; (k, 2) array of time s and height m; or
        a mapping or pandas table with the columns tow and h_m. Its weight is set by
        ``barometer__sigma_m=1.0`` and the like. None: there is none.
    measurements : further sensors, each an `insgnss.Measurement`: times, values, sigmas, and a
        function that predicts the values from the motion (`insgnss.Motion`), with states of its own
        (`insgnss.OwnState`) where it has any.
    mounting : lever arms and bore-sight; None: antenna and camera at the IMU.
    noise : noise model, the name of a shipped one (navchip, tactical, consumer), or a file of one.
        Models are frozen dataclasses: ``dataclasses.replace(model, name="mine")`` changes one.
    gps_week : of all times; None: that of the records, else 0 stands in for it, with a note.
    imu_quantity : what a sample of an array or a table is, "mean_rate", "increments" (both over the
        interval that ends at the stamp) or "instant_rate".
    imu_axes : body directions of the sensor's x, y, z.
    gnss_sigma_m : (3,) standard deviations north, east, down, m, where `gnss` has none.
    gnss_sigma_velocity_mps : (3,) likewise of velocities, m/s.
    tangent_plane : (3,) latitude deg, longitude deg, ellipsoidal height m of the origin, or an
        `insgnss.TangentPlane`, whose angles are rad; None: at the first fix, rounded to
        0.01 deg.
    initial_attitude : of the first fix, where one is known; None: it is found in the motion.
    filter_options : states and constraints beside the usual ones, such as
        ``insgnss.FilterOptions(non_holonomic=True)``; None: those of an empty flight file.
    trajectory_hz : rate of the trajectory, Hz; None: every IMU sample. Images are exact in any
        case.
    accept : names of checks whose contradiction does not stop the run.
    progress : is called with the name of each step.
    **changes : any other value of a flight file by its key with two underscores for the dot, such
        as ``gnss__gate_sigma=4.0`` or ``start_tow=205400.0``.

    Returns
    -------
    The result: `trajectory`, `eo` (None without events), `biases`, `innovations`, `states`,
    `checks`, `diagnostics`, `report` (what report.json holds) and `summary()`.

    Raises
    ------
    InputError : an array has another shape or holds a value that cannot be, or the data contradict
        what is said of them (axes, units, clocks, lever arm).
    DataError : the data do not support an answer, such as a heading without a turn.
    UsageError : a key of `changes` does not exist, or a value is none of those known.

    Examples
    --------
    >>> import insgnss
    >>> sim = insgnss.simulate("ign8", minutes=1.0, imu_rate_hz=100.0, start_in_air=True)
    >>> result = insgnss.estimate(sim.imu, sim.gnss, sim.events, mounting=sim.mounting)
    >>> result.eo.position_m.shape == (len(result.eo), 3)
    True
    >>> result.biases.at(result.biases.time[-1]).gyro.shape  # rad/s, forward right down
    (1, 3)
    """
    samples = imu_samples(imu, imu_quantity, gps_week)
    if str(imu_quantity) not in ("mean_rate", samples.quantity):
        raise UsageError(f"estimate: imu_quantity = {imu_quantity!r}, but imu is {samples!r}")
    fixes = gnss_fixes(gnss, gnss_sigma_m, gnss_sigma_velocity_mps, gps_week)
    exposures = None if events is None else camera_events(events, gps_week)
    heights = None if barometer is None else barometer_heights(barometer, gps_week)
    if (
        all(r is None or r.gps_week is None for r in (samples, fixes, exposures))
        and gps_week is None
    ):
        samples = replace(samples, gps_week=NO_WEEK, notes=(*samples.notes, _no_week()))
    with spoken_as(SPOKEN):
        model = Path(noise) if isinstance(noise, os.PathLike) else noise
        unchecked: dict[str, Any] = {"accept": accept, "tangent_plane": tangent_plane}
        flight = Flight(
            path=WHO,
            name="estimate",
            gps_week=gps_week,
            imu=ImuInput(file=samples, quantity=samples.quantity, axes=imu_axes, noise=model),
            gnss=GnssInput(file=fixes),
            camera=None if exposures is None else CameraInput(events=exposures),
            mounting=Mounting() if mounting is None else mounting,
            output=Output(Path(), (), trajectory_hz),
            initial=initial_attitude,
            filter=FilterOptions() if filter_options is None else filter_options,
            barometer=None if heights is None else BarometerInput(file=heights),
            measurement=tuple(measurements),
            **unchecked,
        )
        _refuse_ambiguous(flight, changes)
        keywords = [name for name in signature(estimate).parameters if name != "changes"]
        flight = change_flight(flight, changes, keywords)
        return process(flight, progress=progress, write=False)


def _refuse_ambiguous(flight: Flight, changes: Mapping[str, Any]) -> None:
    """Refuse changes that are given by a keyword as well, and those that nothing looks at."""
    stated = {
        "noise": flight.imu.noise,
        "imu_axes": flight.imu.axes,
        "trajectory_hz": flight.output.trajectory_hz,
    }
    for name, value in stated.items():
        key = next(key for key, spoken in SPOKEN.items() if spoken == name).replace(".", "__")
        if key in changes and value != signature(estimate).parameters[name].default:
            raise UsageError(f"estimate: {name} and {key} are both given; keep one of them")
    for key in changes:
        if key.startswith("output__") and key not in OF_NO_FILE:
            raise UsageError(
                f"estimate: {key} belongs to files, and estimate writes none; give it to "
                "insgnss.export with the result"
            )


def _no_week() -> Finding:
    finding = f"none is given; {NO_WEEK} is used"
    return Question("GPS week", "gps_week, or a week in the records").note(
        finding, "times stay as they are"
    )
