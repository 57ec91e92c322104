"""What is written beside a simulated flight's observations.

Where the files lie, their units, the flight file and the two readmes.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ..base.units import parse_quantity
from ..base.wording import toml
from ..geodesy.frames import ecef_to_geodetic
from ..geodesy.gpstime import calendar_from_gps
from ..records import Quantity
from .image_block import SimulatedBlock
from .scenario import EXACT_LEVER_ARM_M, EXACT_STAMP_S, SimulatedFlight

Tables = Mapping[str, Any]

EVENTS_FILE = "01_Observations/Camera/Data/Events.txt"
IMU_DIRECTORY = "01_Observations/IMU/Data/Pre_calibrated"
PPK = "02_Processed/GPS-PPK"
FIXES = f"{PPK}/AntennaPos_WGS84.txt"
RINEX = "01_Observations/GPS/Data"
BLOCK_FOLDER = "01_Observations/Camera/Block"


# decimals of readings in SI units: 1e-9 rad/s and 1e-8 m/s^2, below the noise of any sensor
_GYRO_DIGITS, _ACCEL_DIGITS = 9, 8


@dataclass(frozen=True)
class Units:
    """Units of the IMU file and their factors to SI."""

    gyro: str
    accel: str
    gyro_si: float
    accel_si: float
    more_digits: int

    @classmethod
    def of(cls, quantity: Quantity, gyro: str | None, accel: str | None) -> "Units":
        """Return the units of gyro and accelerometer; those that are None are SI.

        Raises
        ------
        InputError
            For a unit that does not exist or is of another dimension.
        """
        increments = quantity == "increments"
        gyro_si, accel_si = ("rad", "m/s") if increments else ("rad/s", "m/s^2")
        gyro = gyro or gyro_si
        accel = accel or accel_si
        factors = parse_quantity(f"1 {gyro}", gyro_si), parse_quantity(f"1 {accel}", accel_si)
        return cls(gyro, accel, *factors, 3 if increments else 0)

    def row(self) -> str:
        """Return the format of one line.

        Its step is 1e-9 rad/s and 1e-8 m/s^2 or less (1e-12 rad and 1e-11 m/s of increments).
        """
        gyro = max(0, int(np.ceil(_GYRO_DIGITS + self.more_digits + np.log10(self.gyro_si))))
        accel = max(0, int(np.ceil(_ACCEL_DIGITS + self.more_digits + np.log10(self.accel_si))))
        return "%.7f" + f",%.{gyro}f" * 3 + f",%.{accel}f" * 3 + "\n"


def imu_file(simulated: SimulatedFlight, number: int = 1) -> str:
    """Return the path of the IMU file, named as the paper's.

    The name has f, number of the flight, 1 for NC1, sob for the deterministic calibration applied.
    """
    plan = simulated.flight.plan
    return f"{IMU_DIRECTORY}/f{plan.first_image // 1000 if plan else 1}_{number}_sob.csv"


@dataclass(frozen=True)
class RinexNames:
    """Paths of the RINEX files, named as the paper's are.

    The rover's have the day of the year, the master's month and day.
    """

    rover: str
    base: str
    gps: str
    glonass: str

    @classmethod
    def of(cls, simulated: SimulatedFlight) -> "RinexNames":
        """Of the day on which the record begins."""
        day = calendar_from_gps(simulated.flight.gps_week, simulated.flight.motion.start, "gpst")
        rover = f"{RINEX}/Rover/rov0{day:%j}0.{day:%y}"
        return cls(
            f"{rover}o", f"{RINEX}/Master/tr2b{day:%m%d}a.{day:%y}o", f"{rover}n", f"{rover}g"
        )


def _gnss_table(simulated: SimulatedFlight) -> dict[str, Any]:
    """Return the table [gnss]: the RINEX files where there are some, else the positions.

    Position and weather of the base come with the RINEX files.
    """
    raw = simulated.raw_gnss
    if raw is None:
        return {"file": FIXES}
    names = RinexNames.of(simulated)
    lat, lon, height = ecef_to_geodetic(raw.base_position_m)
    return {
        "rover": names.rover,
        "base": names.base,
        "navigation": [names.gps, names.glonass],
        "base_position": [*np.degrees([lat, lon]).round(10).tolist(), round(float(height), 5)],
        "base_point": "apc",
        "atmosphere": asdict(raw.weather),
    }


def true_tables(simulated: SimulatedFlight, units: Units, noise: str) -> dict[str, Any]:
    """Return the flight file's keys and values, as the simulation has them."""
    options = simulated.imu_options
    rig = simulated.rig
    plane = simulated.tangent_plane
    return {
        "name": simulated.flight.name,
        "gps_week": simulated.flight.gps_week,
        "imu": {
            "file": imu_file(simulated),
            "units": {"gyro": units.gyro, "accel": units.accel},
            "quantity": options.quantity,
            "axes": options.axes,
            "noise": noise,
        },
        "gnss": {
            **_gnss_table(simulated),
            "time_sigma_s": EXACT_STAMP_S,
            "deflection_sigma_arcsec": 0.0,
        },
        "camera": {"events": EVENTS_FILE},
        "mounting": {
            "antenna_m": list(rig.antenna_m),
            "antenna_sigma_m": EXACT_LEVER_ARM_M,
            "imu_m": list(rig.imu_m),
            "camera_from_body": [list(row) for row in rig.camera_from_body],
            "boresight": [list(row) for row in rig.boresight],
        },
        "tangent_plane": {
            "origin": [*np.degrees([plane.lat, plane.lon]).round(10).tolist(), plane.height]
        },
        "output": {"directory": "02_Processed/GPS-INS", "formats": ["eo_local_plane", "metashape"]},
    }


def flight_toml(tables: Tables, changes: Tables) -> str:
    """Return the text of a TOML file of tables.

    `changes` replace single values or bring further ones, None takes a value away.
    """
    merged = dict(tables)
    for key, value in changes.items():
        merged[key] = {**merged.get(key, {}), **value} if isinstance(value, Mapping) else value
    values = [
        f"{key} = {toml(value)}"
        for key, value in merged.items()
        if not isinstance(value, Mapping) and value is not None
    ]
    sections = ["\n".join(values)]
    for name, table in merged.items():
        if isinstance(table, Mapping):
            rows = [f"{key} = {toml(value)}" for key, value in table.items() if value is not None]
            sections.append("\n".join([f"[{name}]", *rows]))
    return "\n\n".join(sections) + "\n"


_README = """\
# Simulated flight

No sensor recorded these data: they are a simulation in the tree of the open data of J. Skaloud,
D. A. Cucci and K. J. Paul, "Fixed-wing micro UAV open data with digicam and raw INS/GNSS".
{absent} are not part of it.

- `flight.toml`: what is where, for `insgnss process flight.toml`.
- `01_Observations/Camera/Data/Events.txt`: mid-exposure times, GPS time of week.
- `01_Observations/Camera/GCPs`: ground targets, WGS84 (degrees, ellipsoidal height) and tangent
  plane (east, north, up).
{more_files}\
- `01_Observations/IMU/Data/Pre_calibrated`: IMU samples; units are in the header, axes and
  kind of sample in `flight.toml`.
- `02_Processed/GPS-PPK`: antenna phase centre, all epochs and at the events{own}.
- `truth`: exterior orientation, trajectory of the IMU (radians, NED) and biases in body axes, all
  without error{more}.
"""
_RAW = """\
- `01_Observations/GPS/Data`: RINEX 2.11 of rover and master (GPS and GLONASS, two bands),
  navigation beside the rover; the rover's file holds the exposures as events, in the time of its
  clock.
"""


_BLOCK = """\
- `01_Observations/Camera/Block`: what was measured in the images (which do not exist):
  `image_points.csv` (pixels right and down from the outer corner of the upper left pixel),
  `ground_points.csv` (the targets, surveyed: control and check points), `camera.toml` (a
  calibration of before the flight, not the true one). `block.toml` names them for `insgnss adjust`,
  once the flight is processed.
"""
BLOCK_TOML = f"""\
# insgnss process flight.toml, then insgnss adjust block.toml
[images]
file = "{BLOCK_FOLDER}/image_points.csv"

[camera]
file = "{BLOCK_FOLDER}/camera.toml"

[aerial_control]
file = "02_Processed/GPS-INS/eo.json"

[ground]
file = "{BLOCK_FOLDER}/ground_points.csv"

[output]
directory = "02_Processed/Adjustment"
"""


def readme(simulated: SimulatedFlight, with_block: bool = False) -> str:
    """Return the text of README.md of the data set."""
    files = _BLOCK if with_block else ""
    truth_of_block = ""
    if with_block:
        truth_of_block = (
            ";\n  the true camera; of the block all points, pixels without error and which have a"
            " gross\n  error, rows as in `image_points.csv`"
        )
    if simulated.raw_gnss is None:
        absent = "Images, RINEX and raw IMU files"
        return _README.format(absent=absent, more_files=files, own="", more=truth_of_block)
    fix_errors = (
        ", with errors of their own, not\n  those of the RINEX files, which `flight.toml` names in"
        " their place"
    )
    truth_of_block += ";\n  antenna (ECEF), clocks and cycle slips of the receivers"
    absent = "Images, a virtual reference station and raw IMU files"
    return _README.format(
        absent=absent, more_files=files + _RAW, own=fix_errors, more=truth_of_block
    )


def flight_md(simulated: SimulatedFlight, block: SimulatedBlock | None = None) -> str:
    """Return the text of FLIGHT.md of the data set."""
    flight = simulated.flight
    plan = flight.plan
    lines = [
        f"# {flight.name} (simulated)",
        "",
        (
            f"- Date: 3 July 2018, GPS week {flight.gps_week}, time of week"
            f" {flight.motion.start:.1f} to {flight.motion.end:.1f} s"
        ),
    ]
    if plan is not None:
        levels = ", ".join(f"{level.height_m:g} m ({level.lines} lines)" for level in plan.levels)
        lines += [
            (
                f"- Levels above ground in the full plan: {levels}; ground at"
                f" {flight.motion.frame.height:g} m above the ellipsoid"
            ),
            (
                f"- Lines with exposures: {np.unique(flight.line).size}; exposures:"
                f" {flight.time.size}; events: {len(simulated.events.images)}"
            ),
            (
                f"- Overlap: {100 * plan.forward_overlap:g} % forward, {100 * plan.side_overlap:g}"
                " % sideways"
            ),
            (
                f"- Airspeed {plan.airspeed_ms:g} m/s, wind {plan.wind_ms:g} m/s from"
                f" {plan.wind_from_deg:g} deg"
            ),
        ]
    lines.append(
        f"- IMU {simulated.imu_options.rate_hz:g} Hz, GNSS {simulated.gnss_options.rate_hz:g} Hz"
        f" ({simulated.gnss.time.size} fixes)"
    )
    raw = simulated.raw_gnss
    if raw is not None:
        rates = f"rover {raw.options.rate_hz:g} Hz, master {raw.options.base_rate_hz:g} Hz"
        distance = np.linalg.norm(raw.rover.position - raw.base_position_m, axis=1)
        lines.append(
            f"- RINEX: {rates}, {distance.min() / 1e3:.1f} to {distance.max() / 1e3:.1f} km apart"
        )
    if block is not None:
        lines += _block_lines(block)
    return "\n".join(lines) + "\n"


def _block_lines(block: SimulatedBlock) -> list[str]:
    """Return the lines of FLIGHT.md on what was measured in the images."""
    options = block.options
    observations = block.measured.observations
    check = block.ground.check
    ties = len(block.measured.points) - check.size
    east, north, up = (1e3 * sigma for sigma in options.ground_sigma_m)
    camera = options.true_camera
    return [
        (
            f"- Image points: {len(observations)} of {ties} tie points ({options.tie_sigma_px:g}"
            f" px) and {check.size} targets ({options.target_sigma_px:g} px); gross errors:"
            f" {int(block.gross.sum())}"
        ),
        (
            f"- Targets: {int((~check).sum())} control and {int(check.sum())} check points,"
            f" {east:g}, {north:g}, {up:g} mm (east, north, up)"
        ),
        f"- Terrain: rolling, {options.relief_m:g} m above and below the site at most",
        (
            f"- Camera: {camera.width} x {camera.height} pixels, true f {camera.of('f'):.3f} px;"
            f" camera.toml says {options.stated_camera.of('f'):.3f} px"
        ),
    ]
