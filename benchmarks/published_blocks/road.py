"""The corridor of paper 004: a road, a vehicle with a target on its roof, a drone that follows it.

The road starts southwards, turns by 180 deg and bends clockwise on its way north. Its course is a
sum of smooth steps of the length along it, and its places are the integral of that course. The
vehicle's length along the road is a sum of harmonics of time, the drone's is the vehicle's less a
tether that changes.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from insgnss.geodesy.frames import TangentPlane
from insgnss.geodesy.rotation import rotation_from_rpy, rotation_from_vector
from insgnss.records import Trajectory
from insgnss.simulation.image_block import Terrain

from .pose_errors import PoseErrors, gauss_markov
from .stations import ENU_NED, START_TOW, Stations

Array = NDArray[np.float64]

LENGTH_M = 2300.0
PHOTOS = 149
TARGET_M = (-0.35, 0.10, -1.20)
"""The target from the navigation centre of the vehicle, forward, right, down, m."""
RIGHT_BACK_DOWN = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""Camera from body where the image's top points forward."""
VEHICLE_ERRORS = PoseErrors((0.02, 0.02, 0.04), (0.015, 0.015, 0.03), axes="tangent plane")
"""Table 2 of paper 004; of the attitude what its inertial unit is said to give."""
REST_S = 1.0
"""Correlation time of what of the vehicle's errors does not last: rows 0.1 s apart are no noise."""
VELOCITY_SIGMA_MPS = 0.01
_STEPS = ((180.0, 125.0, 20.0), (25.0, 700.0, 60.0), (20.0, 1300.0, 80.0), (15.0, 1900.0, 60.0))
_COURSE_DEG = 170.0
_GRID_M = 0.05
_SPEED_MPS = 5.5
_SWAY = ((22.0, 0.07, 0.4), (6.0, 0.19, 1.1))  # of the length driven: m, rad/s, rad
_TETHER = ((5.0, 0.13, 0.0), (3.0, 0.31, 2.0))
_TETHER_M = 2.0
_HEIGHT_M, _UP_AND_DOWN_M = 85.0, 4.5  # of flight, 80 to 90 m above ground
_NAVIGATION_M = 1.5  # navigation centre above the road
_ROW_S, _AROUND_S = 0.1, 15.0
_GUST_S = 3.0
_RPY_DEG = np.array([3.5, 4.0, 3.0])
"""Of 149 draws the largest is 2.5 times as large: pitch up to 10 deg, as the paper has it."""
_OFF_M = np.array([1.5, 1.5, 0.3])
_RATE_DEGPS = 8.0


@dataclass(frozen=True, eq=False)
class Road:
    """The road by its length: positions (k, 2) at `length` (k,), from where photos begin."""

    length: Array
    position: Array

    @classmethod
    def built(cls) -> "Road":
        """Return the road of the corridor, with some of it before and after."""
        length = np.arange(-200.0, LENGTH_M + 200.0, _GRID_M)
        middle = 0.5 * (length[1:] + length[:-1])
        way = np.array([unit(course(s)) for s in (length[:-1], middle, length[1:])])
        step = _GRID_M / 6.0 * (way[0] + 4.0 * way[1] + way[2])
        position = np.vstack([np.zeros(2), np.cumsum(step, axis=0)])
        return cls(length, position - position[np.argmin(np.abs(length))])

    def at(self, length: Array) -> Array:
        """Return positions (n, 2) at lengths (n,), by the cubic through positions and courses."""
        k = np.clip(np.searchsorted(self.length, length) - 1, 0, self.length.size - 2)
        u = ((length - self.length[k]) / _GRID_M)[:, None]
        a, b = self.position[k], self.position[k + 1]
        m, n = (_GRID_M * unit(course(self.length[i])) for i in (k, k + 1))
        cubic = (1.0 + 2.0 * u) * (1.0 - u) ** 2 * a + u * (1.0 - u) ** 2 * m
        return np.asarray(cubic + u * u * (3.0 - 2.0 * u) * b + u * u * (u - 1.0) * n)


def course(length: Array) -> Array:
    """Return the course of the road, rad from north by east."""
    steps = [
        turn * 0.5 * (1.0 + np.tanh((length - centre) / wide)) for turn, centre, wide in _STEPS
    ]
    return np.asarray(np.radians(_COURSE_DEG + np.sum(steps, axis=0)))


def unit(angle: Array) -> Array:
    """Return unit vectors (n, 2) east, north of courses."""
    return np.column_stack([np.sin(angle), np.cos(angle)])


def driven(time: Array) -> tuple[Array, Array]:
    """Return the vehicle's length along the road, m, and its speed, m/s, at times (n,)."""
    t = time - START_TOW
    length, speed = _SPEED_MPS * t, np.full(t.shape, _SPEED_MPS)
    for size, rate, phase in _SWAY:
        length = length + size * (np.sin(rate * t + phase) - np.sin(phase))
        speed = speed + size * rate * np.cos(rate * t + phase)
    return length, speed


def _drone_length(time: Array) -> Array:
    """Return the drone's length along the road."""
    t = time - START_TOW
    swings = [size * np.sin(rate * t + phase) for size, rate, phase in _TETHER]
    return np.asarray(driven(time)[0] - _TETHER_M - np.sum(swings, axis=0))


@dataclass(frozen=True, eq=False)
class Vehicle:
    """The vehicle: its true and its estimated trajectory, and its target.

    Parameters
    ----------
    truth, estimate : Trajectory
        Of the navigation centre at 10 Hz; the standard deviations are those of the estimate.
    target_m : ndarray
        (n, 3) true positions of the target at the exposures, tangent plane.
    """

    truth: Trajectory
    estimate: Trajectory
    target_m: Array


def exposures() -> Array:
    """Return the times (n,) of the exposures, at equal lengths along the road."""
    time = START_TOW + np.arange(-60.0, 1.2 * LENGTH_M / _SPEED_MPS, 0.01)
    wanted = np.linspace(0.0, LENGTH_M, PHOTOS)
    return np.interp(wanted, _drone_length(time), time)


def followed(terrain: Terrain, rng: np.random.Generator) -> Stations:
    """Return the poses of the images.

    Parameters
    ----------
    terrain : Terrain
        Under the drone.
    rng : numpy.random.Generator
        Of gusts.

    Returns
    -------
    Stations
        In the order of time.
    """
    time, road = exposures(), Road.built()
    length = _drone_length(time)
    ground = terrain.points(road.at(length))
    gust = gauss_markov(time, _GUST_S, 6, rng)
    height = _HEIGHT_M + _UP_AND_DOWN_M * np.sin(2.0 * np.pi * length / 420.0)
    position = ground + np.column_stack([np.zeros((time.size, 2)), height]) + gust[:, 3:] * _OFF_M
    rpy = np.radians(gust[:, :3] * _RPY_DEG)
    rpy[:, 2] += course(length)
    C_mb = ENU_NED @ rotation_from_rpy(rpy)
    speed = np.gradient(length, time)
    velocity = np.column_stack([speed[:, None] * unit(course(length)), np.zeros(time.size)])
    return Stations(
        time,
        position,
        C_mb @ RIGHT_BACK_DOWN.T,
        velocity,
        np.radians(_RATE_DEGPS) * rng.standard_normal((time.size, 3)),
        RIGHT_BACK_DOWN,
    )


def vehicle(
    time: Array,
    terrain: Terrain,
    plane: TangentPlane,
    gps_week: int,
    rng: np.random.Generator,
    errors: PoseErrors = VEHICLE_ERRORS,
) -> Vehicle:
    """Return the vehicle below the drone.

    Parameters
    ----------
    time : ndarray, (n,)
        The exposures.
    terrain : Terrain
        Under the road.
    plane : TangentPlane
        Its axes.
    gps_week : int
        Of the times.
    rng : numpy.random.Generator
        Of the trajectory's errors.
    errors : PoseErrors
        Their statistics.

    Returns
    -------
    Vehicle
        Trajectories and target.
    """
    road = Road.built()
    rows = np.arange(time[0] - _AROUND_S, time[-1] + _AROUND_S, _ROW_S)
    truth = _trajectory(rows, *_motion(rows, road, terrain), plane, gps_week, errors)
    slow = gauss_markov(rows, errors.correlation_s, 6, rng)
    rest = gauss_markov(rows, REST_S, 6, rng)
    off = errors.sigma * (np.sqrt(errors.share) * slow + np.sqrt(1.0 - errors.share) * rest)
    position, velocity, C_mb = _motion(rows, road, terrain)
    estimate = _trajectory(
        rows,
        position - off[:, :3],
        velocity - VELOCITY_SIGMA_MPS * rng.standard_normal(velocity.shape),
        rotation_from_vector(-off[:, 3:]) @ C_mb,
        plane,
        gps_week,
        errors,
    )
    centre, _, attitude = _motion(time, road, terrain)
    return Vehicle(truth, estimate, centre + attitude @ np.array(TARGET_M))


def _motion(time: Array, road: Road, terrain: Terrain) -> tuple[Array, Array, Array]:
    """Return position, velocity and attitude C_mb of the vehicle, tangent plane."""
    length, speed = driven(time)
    horizontal, way = road.at(length), unit(course(length))
    slope = np.cos(horizontal @ terrain.wave + terrain.phase) * (way @ terrain.wave)
    rise = slope @ terrain.amplitude_m
    position = terrain.points(horizontal) + [0.0, 0.0, _NAVIGATION_M]
    velocity = speed[:, None] * np.column_stack([way, rise])
    rpy = np.column_stack([np.zeros(time.size), np.arctan(rise), course(length)])
    return position, velocity, ENU_NED @ rotation_from_rpy(rpy)


def _trajectory(
    time: Array,
    position: Array,
    velocity: Array,
    C_mb: Array,
    plane: TangentPlane,
    gps_week: int,
    errors: PoseErrors,
) -> Trajectory:
    lat, lon, height = plane.geodetic_from_position(position)
    C_nm = plane.C_mn(lat, lon).transpose(0, 2, 1)
    east_north_up = np.r_[errors.sigma[:3], np.full(3, VELOCITY_SIGMA_MPS), errors.sigma[3:]]
    ned = east_north_up[[1, 0, 2, 3, 4, 5, 7, 6, 8]]
    return Trajectory(
        time,
        lat,
        lon,
        height,
        np.einsum("nij,nj->ni", C_nm, velocity),
        C_nm @ C_mb,
        np.tile(np.diag(ned**2), (time.size, 1, 1)),
        gps_week,
    )
