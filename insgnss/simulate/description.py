"""What is written beside a simulated flight's observations: where the files lie, their units, the flight file and the two readmes."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..records import Quantity
from ..units import parse_quantity
from .scenario import SimulatedFlight

Tables = Mapping[str, Any]

EVENTS = "01_Observations/Camera/Data/Events.txt"
IMU = "01_Observations/IMU/Data/Pre_calibrated"
PPK = "02_Processed/GPS-PPK"
FIXES = f"{PPK}/AntennaPos_WGS84.txt"


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
        """Of gyro and accelerometer, SI where None. Raises InputError for a unit that does not exist or is of another dimension."""
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


def imu_file(simulated: SimulatedFlight, number: int = 1) -> str:
    """The paper's name: f, number of the flight, 1 for NC1, sob for the deterministic calibration applied."""
    plan = simulated.flight.plan
    return f"{IMU}/f{plan.first_image // 1000 if plan else 1}_{number}_sob.csv"


def true_tables(simulated: SimulatedFlight, units: Units, noise: str) -> dict[str, Any]:
    """The flight file's keys and values, as the simulation has them."""
    options, rig, plane = simulated.imu_options, simulated.rig, simulated.tangent_plane
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
        "gnss": {"file": FIXES},
        "camera": {"events": EVENTS},
        "mounting": {
            "antenna_m": list(rig.antenna_m),
            "imu_m": list(rig.imu_m),
            "camera_from_body": [list(row) for row in rig.camera_from_body],
            "boresight": [list(row) for row in rig.boresight],
        },
        "tangent_plane": {"origin": [*np.degrees([plane.lat, plane.lon]).round(10).tolist(), plane.height]},
        "output": {"directory": "02_Processed/GPS-INS", "formats": ["eo_local_plane", "metashape"]},
    }


def flight_toml(tables: Tables, changes: Tables) -> str:
    """TOML of tables; `changes` take the place of single values or bring further ones, None takes a value away."""
    merged = dict(tables)
    for key, value in changes.items():
        merged[key] = {**merged.get(key, {}), **value} if isinstance(value, Mapping) else value
    top = [f"{key} = {_toml(value)}" for key, value in merged.items() if not isinstance(value, Mapping) and value is not None]
    parts = ["\n".join(top)]
    for name, table in merged.items():
        if isinstance(table, Mapping):
            rows = [f"{key} = {_toml(value)}" for key, value in table.items() if value is not None]
            parts.append("\n".join([f"[{name}]", *rows]))
    return "\n\n".join(parts) + "\n"


def _toml(value: Any) -> str:
    """A value in one line of TOML."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_toml(inner)}" for key, inner in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_toml(inner) for inner in value) + "]"
    return json.dumps(value, ensure_ascii=False)


README = """\
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


def flight_md(simulated: SimulatedFlight) -> str:
    """FLIGHT.md of the data set."""
    flight, plan = simulated.flight, simulated.flight.plan
    lines = [
        f"# {flight.name} (simulated)",
        "",
        f"- Date: 3 July 2018, GPS week {flight.gps_week}, time of week {flight.motion.start:.1f} to {flight.motion.end:.1f} s",
    ]
    if plan is not None:
        levels = ", ".join(f"{level.height_m:g} m ({level.lines} lines)" for level in plan.levels)
        lines += [
            f"- Levels above ground in the full plan: {levels}; ground at {flight.motion.frame.height:g} m above the ellipsoid",
            f"- Lines with exposures: {np.unique(flight.line).size}; exposures: {flight.time.size}; events: {len(simulated.events.images)}",
            f"- Overlap: {100 * plan.forward_overlap:g} % forward, {100 * plan.side_overlap:g} % sideways",
            f"- Airspeed {plan.airspeed_ms:g} m/s, wind {plan.wind_ms:g} m/s from {plan.wind_from_deg:g} deg",
        ]
    lines.append(
        f"- IMU {simulated.imu_options.rate_hz:g} Hz, GNSS {simulated.gnss_options.rate_hz:g} Hz ({simulated.gnss.time.size} fixes)"
    )
    return "\n".join(lines) + "\n"
