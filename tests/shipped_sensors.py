"""Sensors of every shipped kind of [[measurement]]: what they measure on a simulated flight.

A new kind is a line in each of the tables `truths`, `EXPECTED` and, where it has any, `OPTIONS`.
"""

import json
from pathlib import Path

import numpy as np

from insgnss.geodesy.frames import LocalFrame
from insgnss.geodesy.rotation import rotation_from_vector, rpy_from_rotation

OFFSET = np.radians([0.6, -0.8, 1.5])  # by which sensors are turned against the body
LEVER = np.array([1.0, 0.2, -0.1])
SCALE = 0.015
WIND = [5.0, -3.0]  # m/s, north and east, at the start
STATION = [46.5705, 6.5395, 580.0]  # deg and m
SHIFT = np.array([0.02, -0.01, 0.015])  # m, north, east, down, of the station
LATE_S = 0.03
HARD = np.array([2.5, -1.5, 1.0])  # uT
SOFT = np.array([[0.02, -0.01, 0.015], [0.0, -0.03, 0.01], [0.02, 0.0, 0.01]])
# of the dipole at 46.57 deg of latitude: 47.87 uT and a dip of 64.67 deg
FIELD = [47.9 / 47.87 - 1.0, np.radians(63.1 - 64.67), np.radians(0.4)]


def truths(sim) -> dict[str, tuple[str, np.ndarray, float]]:
    """Header, exact values in the units of the file, and the sigma of each kind."""
    path = sim.truth.trajectory[20:-20:4]
    C = path.C_nb
    body = np.einsum("kji,kj->ki", C, path.velocity_ned)
    turned = rpy_from_rotation(C @ rotation_from_vector(OFFSET))
    rotated = (1.0 + SCALE) * body @ rotation_from_vector(OFFSET)
    apart = C @ rotation_from_vector(OFFSET) @ LEVER
    tow = path.time[:, None]
    heading = rpy_from_rotation(C)[:, 2:] + OFFSET[2]
    steps = np.random.default_rng(3).standard_normal((len(path), 2))
    wind = WIND + np.cumsum(0.2 * np.sqrt(np.diff(path.time).mean()) * steps, axis=0)
    against = path.velocity_ned - np.pad(wind, ((0, 0), (0, 1)))
    through_air = np.einsum("ki,ki->k", C[:, :, 0], against)[:, None]
    dip, azimuth = np.radians([63.1, 2.9])
    level = np.cos(dip) * np.array([np.cos(azimuth), np.sin(azimuth)])
    field = np.einsum("kji,j->ki", C, 47.9 * np.array([*level, np.sin(dip)]))
    magnetic = field + field @ SOFT.T + HARD
    lat, lon, height = STATION
    station = LocalFrame(np.radians(lat), np.radians(lon), height)
    prism = station.position_from_geodetic(path.lat, path.lon, path.height)
    prism += np.einsum("kij,kjl,l->ki", station.C_ln(path.lat, path.lon), C, LEVER) - SHIFT
    prism += LATE_S * np.einsum("kij,kj->ki", station.C_ln(path.lat, path.lon), path.velocity_ned)
    prism = (prism @ rotation_from_vector([0.0, 0.0, OFFSET[0]]))[:, [1, 0, 2]] * [1, 1, -1]
    return {
        "position": ("tow,easting,northing,height", np.hstack([tow, prism]), 0.01),
        "heading": ("tow,heading", np.hstack([tow, np.degrees(heading)]), 0.2),
        "attitude": ("tow,roll,pitch,yaw", np.hstack([tow, np.degrees(turned)]), 0.2),
        "body_velocity": ("tow,vx,vy,vz", np.hstack([tow, rotated]), 0.05),
        "magnetometer": ("tow,mag_x,mag_y,mag_z", np.hstack([tow, magnetic * [-1, -1, 1]]), 0.4),
        "airspeed": ("tow,tas", np.hstack([tow, (1.0 + SCALE) * through_air]), 0.3),
        "baseline": ("tow,rel_n,rel_e,rel_d", np.hstack([tow, apart]), 0.005),
    }


EXPECTED = {
    "position": np.array([OFFSET[0], *SHIFT, LATE_S]),
    "heading": OFFSET[2:],
    "attitude": OFFSET,
    "body_velocity": np.array([SCALE, *OFFSET]),
    "baseline": OFFSET,
    "airspeed": np.array([SCALE]),  # beside wind, which is no constant
    "magnetometer": np.array([*HARD, *SOFT.ravel(), *FIELD]),
}

OPTIONS = {
    "baseline": {"lever_m": LEVER.tolist()},
    "magnetometer": {"declination_deg": 2.5, "axes": "back left down"},
    "position": {"lever_m": LEVER.tolist(), "station": STATION, "clock_sigma_s": 0.1},
}


def written(root: Path, sim, kind: str, **options) -> Path:
    """The flight file with a sensor of a kind, with noise."""
    header, values, sigma = truths(sim)[kind]
    values = values.copy()
    noise = np.random.default_rng(7).standard_normal(values[:, 1:].shape)
    values[:, 1:] += sigma * noise
    np.savetxt(root / f"{kind}.csv", values, "%.9f", ",", header=header, comments="")
    keys = {"sigma": sigma} | OPTIONS.get(kind, {}) | options
    more = "\n".join(f"{key} = {json.dumps(value)}" for key, value in keys.items())
    table = f'\n[[measurement]]\nkind = "{kind}"\nfile = "{kind}.csv"\n{more}\n'
    file = root / f"with_{kind}.toml"
    file.write_text((root / "flight.toml").read_text() + table)
    return file
