"""A simulated flight as a data set: the published tree (Figure 9 of paper 000), `flight.toml`, and the truth beside it.

    flight.toml  README.md  FLIGHT.md
    01_Observations/Camera/Data/Events.txt
    01_Observations/Camera/GCPs/WGS84.txt, WGS84_tangentplane.txt
    01_Observations/IMU/Data/Pre_calibrated/f8_1_sob.csv
    02_Processed/GPS-PPK/AntennaPos_WGS84.txt, AntennaPos_Img_WGS84.txt, AntennaPos_Img_WGS84_tangentplane.txt
    truth/EO_local-plane.txt, eo.npz, trajectory.npz

There are no images, no RINEX and no raw IMU files: nothing of theirs is simulated.
"""

import os
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import UsageError
from ..formats.events import write_events
from ..formats.gnss_text import ImagePositions, write_gnss_text, write_image_positions
from ..geodesy.rotation import CV_RUB, opk_from_rotation
from ..records import ImuSamples, Quantity
from ..stochastic.model import NoiseModel, load_noise_model, shipped_models, write_noise_model
from ..stochastic.units import parse_quantity
from .layout import FlightPlan
from .scenario import SimulatedFlight, simulate_flight
from .sensors import GnssOptions, ImuOptions, Rig, antenna_states

Array = NDArray[np.float64]

EVENTS = "01_Observations/Camera/Data/Events.txt"
TARGETS = "01_Observations/Camera/GCPs"
IMU = "01_Observations/IMU/Data/Pre_calibrated"
PPK = "02_Processed/GPS-PPK"
_TARGETS = 40
_RELIEF_M = 2.0
_CHUNK = 20000  # lines of the IMU file formatted at once


@dataclass(frozen=True, eq=False)
class Dataset:
    """A written data set: its directory, its flight file, and what it was made of."""

    directory: Path
    flight_file: Path
    simulated: SimulatedFlight


def write_dataset(
    directory: str | os.PathLike[str],
    flight: str | FlightPlan = "ign8",
    minutes: float | None = None,
    *,
    imu_rate: float = 500.0,
    seed: int = 0,
    noise: str | NoiseModel | None = "navchip",
    imu_axes: str = "forward right down",
    gyro_unit: str | None = None,
    accel_unit: str | None = None,
    quantity: Quantity = "mean_rate",
    gnss: GnssOptions | None = None,
    rig: Rig | None = None,
    missing_events: float = 0.0,
    **changes: Any,
) -> Dataset:
    """Simulate a flight and write it as a data set that `flight.toml` describes; whole or not at all.

    Parameters
    ----------
    directory : is created; it may exist if it is empty.
    flight, minutes, seed, gnss, rig, missing_events, changes : as in `simulate_flight`.
    imu_rate : Hz.   noise : as in `ImuOptions`; the flight file names it.
    imu_axes, gyro_unit, accel_unit, quantity : how the IMU file is written; SI units by default.

    Raises
    ------
    UsageError : the directory is not empty or cannot be written, the flight cannot be flown, or it has no exposure.
    InputError : a unit does not exist or is of another dimension.
    """
    target = Path(directory).resolve()
    if target.exists() and (not target.is_dir() or any(target.iterdir())):
        raise UsageError(f"{target}: exists and is not an empty directory; give another one")
    units = _Units.of(quantity, gyro_unit, accel_unit)
    imu = ImuOptions(imu_rate, noise, imu_axes, quantity)
    simulated = simulate_flight(flight, minutes, seed=seed, imu=imu, gnss=gnss, rig=rig, missing_events=missing_events, **changes)
    if not simulated.events.images:
        raise UsageError("no exposure in this flight; ask for more minutes, or start in the air")
    temporary = target.with_name(f".{target.name}.{os.getpid()}.tmp")
    try:
        temporary.mkdir(parents=True)
        _write_tree(temporary, simulated, units, np.random.default_rng([seed, 1]))
        if target.exists():
            target.rmdir()
        temporary.rename(target)
    except OSError as error:
        raise UsageError(f"{target}: cannot be written: {error.strerror or error}") from None
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    return Dataset(target, target / "flight.toml", simulated)


@dataclass(frozen=True)
class _Units:
    """Units of the IMU file and their factors to SI."""

    gyro: str
    accel: str
    gyro_si: float
    accel_si: float
    more_digits: int

    @classmethod
    def of(cls, quantity: Quantity, gyro: str | None, accel: str | None) -> "_Units":
        increments = quantity == "increments"
        gyro_si, accel_si = ("rad", "m/s") if increments else ("rad/s", "m/s^2")
        gyro, accel = gyro or gyro_si, accel or accel_si
        factors = parse_quantity(f"1 {gyro}", gyro_si), parse_quantity(f"1 {accel}", accel_si)
        return cls(gyro, accel, *factors, 3 if increments else 0)

    def row(self) -> str:
        """Format of one line: a step of 1e-9 rad/s and 1e-8 m/s^2 or less (1e-12 rad and 1e-11 m/s of increments)."""
        gyro = max(0, int(np.ceil(9 + self.more_digits + np.log10(self.gyro_si))))
        accel = max(0, int(np.ceil(8 + self.more_digits + np.log10(self.accel_si))))
        return "%.7f" + f",%.{gyro}f" * 3 + f",%.{accel}f" * 3 + "\n"


def _write_tree(root: Path, simulated: SimulatedFlight, units: _Units, rng: np.random.Generator) -> None:
    for folder in (Path(EVENTS).parent, TARGETS, IMU, PPK, "truth"):
        (root / folder).mkdir(parents=True, exist_ok=True)
    write_events(simulated.events, root / EVENTS)
    with (root / _imu_file(simulated)).open("w", encoding="utf-8", newline="\n") as stream:
        stream.writelines(_imu_lines(simulated.imu, units))
    write_gnss_text(simulated.gnss, root / PPK / "AntennaPos_WGS84.txt")
    _write_antenna_at_images(root / PPK, simulated, rng)
    _write_targets(root / TARGETS, simulated, rng)
    _write_truth(root / "truth", simulated)
    noise = _noise_name(root, simulated.imu_options.noise)
    for name, text in (
        ("flight.toml", _flight_toml(simulated, units, noise)),
        ("README.md", _README),
        ("FLIGHT.md", _flight_md(simulated)),
    ):
        (root / name).write_text(text, encoding="utf-8", newline="\n")


def _imu_file(simulated: SimulatedFlight) -> str:
    """The paper's name: f, number of the flight, 1 for NC1, sob for the deterministic calibration applied."""
    return f"{IMU}/f{simulated.flight.plan.first_image // 1000}_1_sob.csv"


def _imu_lines(imu: ImuSamples, units: _Units) -> Iterator[str]:
    columns = [f"g{c}[{units.gyro}]" for c in "xyz"] + [f"a{c}[{units.accel}]" for c in "xyz"]
    yield ",".join(["tow[s]", *columns]) + "\n"
    row = units.row()
    table = np.column_stack([imu.time, imu.gyro / units.gyro_si, imu.accel / units.accel_si])
    for first in range(0, len(table), _CHUNK):
        part = table[first : first + _CHUNK]
        yield row * len(part) % tuple(part.ravel().tolist())


def _write_antenna_at_images(folder: Path, simulated: SimulatedFlight, rng: np.random.Generator) -> None:
    """Antenna at the events with the white error of the fixes, in both frames."""
    motion, plane = simulated.flight.motion, simulated.tangent_plane
    position, _ = antenna_states(motion, simulated.rig.antenna_lever_b, simulated.events.time)
    error = rng.standard_normal(position.shape) * simulated.gnss_options.sigma_m
    lat, lon, height = motion.frame.geodetic_from_position(position + np.einsum("nij,nj->ni", motion.frame.C_ln_at(position), error))
    images = simulated.events.images
    write_image_positions(ImagePositions(images, np.column_stack([lat, lon, height]), "geodetic"), folder / "AntennaPos_Img_WGS84.txt")
    enu = ImagePositions(images, plane.position_from_geodetic(lat, lon, height), "tangent_plane")
    write_image_positions(enu, folder / "AntennaPos_Img_WGS84_tangentplane.txt")


def _write_targets(folder: Path, simulated: SimulatedFlight, rng: np.random.Generator) -> None:
    """Ground targets scattered under exposures all over the flight, on a ground of little relief."""
    flight, plane = simulated.flight, simulated.tangent_plane
    place = flight.motion.position(flight.time)[np.linspace(0, flight.time.size - 1, _TARGETS).round().astype(int)]
    place[:, :2] += 0.12 * -place[:, 2:] * rng.standard_normal((_TARGETS, 2))
    place[:, 2] = _RELIEF_M * rng.standard_normal(_TARGETS)
    lat, lon, height = flight.motion.frame.geodetic_from_position(place)
    enu = plane.position_from_geodetic(lat, lon, height)
    numbers = np.arange(1, _TARGETS + 1)
    tables = (
        (
            "WGS84.txt",
            "# id lat[deg] lon[deg] h[m]\n",
            "%d %.10f %.10f %.4f\n",
            np.column_stack([numbers, np.degrees(lat), np.degrees(lon), height]),
        ),
        ("WGS84_tangentplane.txt", "# id e[m] n[m] u[m]\n", "%d %.4f %.4f %.4f\n", np.column_stack([numbers, enu])),
    )
    for name, head, form, table in tables:
        (folder / name).write_text(head + "".join(form % tuple(row) for row in table.tolist()), encoding="utf-8", newline="\n")


def _write_truth(folder: Path, simulated: SimulatedFlight) -> None:
    truth, eo, path = simulated.truth, simulated.truth.eo, simulated.truth.trajectory
    angles = np.degrees(opk_from_rotation(eo.C_mc @ CV_RUB))
    head = (
        "# truth of a simulation: projection centre in the tangent plane (east north up), origin "
        f"{np.degrees(eo.origin[0]):.10f} {np.degrees(eo.origin[1]):.10f} deg {eo.origin[2]:.4f} m; R = Rx(omega) Ry(phi) Rz(kappa)\n"
        "# image E[m] N[m] U[m] omega[deg] phi[deg] kappa[deg] sE sN sU sOmega sPhi sKappa\n"
    )
    form = "%s %.4f %.4f %.4f %.6f %.6f %.6f 0 0 0 0 0 0\n"
    rows = (form % (name, *values) for name, values in zip(eo.images, np.hstack([eo.position_m, angles]).tolist(), strict=True))
    (folder / "EO_local-plane.txt").write_text(head + "".join(rows), encoding="utf-8", newline="\n")
    np.savez(folder / "eo.npz", images=np.array(eo.images), tow=eo.time, position_enu=eo.position_m, C_mc=eo.C_mc, origin=eo.origin)
    np.savez(
        folder / "trajectory.npz",
        tow=path.time,
        lat=path.lat,
        lon=path.lon,
        h=path.height,
        v_ned=path.velocity_ned,
        C_nb=path.C_nb,
        gyro_bias=truth.gyro_bias,
        accel_bias=truth.accel_bias,
        gnss_outlier=truth.outlier,
    )


def _noise_name(root: Path, noise: str | NoiseModel | None) -> str:
    """What the flight file calls the noise model: a shipped name, or the file that is written here. An ideal sensor is called navchip."""
    if noise is None:
        return "navchip"
    if isinstance(noise, str) and noise in shipped_models():
        return noise
    write_noise_model(load_noise_model(noise) if isinstance(noise, str) else noise, root / "noise.toml")
    return "noise.toml"


def _flight_toml(simulated: SimulatedFlight, units: _Units, noise: str) -> str:
    options, rig, plane = simulated.imu_options, simulated.rig, simulated.tangent_plane
    return f"""\
name = "{simulated.flight.plan.name}"
gps_week = {simulated.flight.gps_week}

[imu]
file = "{_imu_file(simulated)}"
units = {{ gyro = "{units.gyro}", accel = "{units.accel}" }}
quantity = "{options.quantity}"
axes = "{options.axes}"
noise = "{noise}"

[gnss]
file = "{PPK}/AntennaPos_WGS84.txt"

[camera]
events = "{EVENTS}"

[mounting]
antenna_m = {list(rig.antenna_m)}
imu_m = {list(rig.imu_m)}
camera_from_body = {[list(row) for row in rig.camera_from_body]}
boresight = {[list(row) for row in rig.boresight]}

[tangent_plane]
origin = [{np.degrees(plane.lat):.12g}, {np.degrees(plane.lon):.12g}, {plane.height}]

[output]
directory = "02_Processed/GPS-INS"
formats = ["eo_local_plane", "metashape"]
"""


_README = """\
# Simulated flight

No sensor recorded these data: they are a simulation in the tree of the open data of J. Skaloud, D. A. Cucci and K. J. Paul,
"Fixed-wing micro UAV open data with digicam and raw INS/GNSS". Images, RINEX and raw IMU files are not part of it.

- `flight.toml`: what is where, for `insgnss process flight.toml`.
- `01_Observations/Camera/Data/Events.txt`: mid-exposure times, GPS time of week.
- `01_Observations/Camera/GCPs`: ground targets, WGS84 (degrees, ellipsoidal height) and tangent plane (east, north, up).
- `01_Observations/IMU/Data/Pre_calibrated`: IMU samples; units are in the header, axes and kind of sample in `flight.toml`.
- `02_Processed/GPS-PPK`: antenna phase centre, all epochs and at the events.
- `truth`: exterior orientation, trajectory of the IMU (radians, NED) and biases in body axes, all without error.
"""


def _flight_md(simulated: SimulatedFlight) -> str:
    flight, plan = simulated.flight, simulated.flight.plan
    levels = ", ".join(f"{level.height_m:g} m ({level.lines} lines)" for level in plan.levels)
    return f"""\
# {plan.name} (simulated)

- Date: 3 July 2018, GPS week {flight.gps_week}, time of week {flight.motion.start:.1f} to {flight.motion.end:.1f} s
- Levels above ground in the full plan: {levels}; ground at {flight.motion.frame.height:g} m above the ellipsoid
- Lines with exposures: {np.unique(flight.line).size}; exposures: {flight.time.size}; events: {len(simulated.events.images)}
- Overlap: {100 * plan.forward_overlap:g} % forward, {100 * plan.side_overlap:g} % sideways
- Airspeed {plan.airspeed_ms:g} m/s, wind {plan.wind_ms:g} m/s from {plan.wind_from_deg:g} deg
- IMU {simulated.imu_options.rate_hz:g} Hz, GNSS {simulated.gnss_options.rate_hz:g} Hz ({simulated.gnss.time.size} fixes)
"""
