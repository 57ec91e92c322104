"""Where each image of the flights of paper 003 was taken: lines of a fixed-wing drone.

The camera's long side lies along the flight, image right forward: with the short side along it the
55 photos of the corridor, 80 % of which overlap, would reach 690 m of its 1200.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from insgnss.geodesy.rotation import rotation_from_rpy

from .pose_errors import gauss_markov

Array = NDArray[np.float64]

FORWARD_RIGHT_DOWN = np.eye(3)
"""Camera from body where the image's right side points forward."""
ENU_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
START_TOW = 200000.0
_SPEED_MPS, _TURN_S = 16.0, 12.0  # airspeed without wind; of a turn beside the way to the next line
_GUST_S = 4.0
_OFF_M = np.array([1.5, 1.5, 1.0])  # of the planned place
_RPY_DEG = np.array([3.0, 2.0, 2.0])
_PITCH_DEG, _CRAB_DEG = 3.0, 4.0
_RATE_DEGPS = 2.0


@dataclass(frozen=True, eq=False)
class Stations:
    """True poses of the images of a flight, in the tangent plane.

    Parameters
    ----------
    time : ndarray
        (n,) exposures, s of the week.
    position_m : ndarray
        (n, 3) projection centres.
    C_mc : ndarray
        (n, 3, 3) camera to tangent plane.
    velocity_mps, rate_radps : ndarray
        (n, 3) along its axes.
    camera_from_body : ndarray
        (3, 3) the nominal mounting.
    """

    time: Array
    position_m: Array
    C_mc: Array
    velocity_mps: Array
    rate_radps: Array
    camera_from_body: Array


@dataclass(frozen=True)
class Line:
    """A flight line: first and last planned exposure (east, north, m), height, photos."""

    first: tuple[float, float]
    last: tuple[float, float]
    height_m: float
    photos: int


def parallel_lines(
    height_m: float, base_m: float, spacing_m: float, photos: Sequence[int], course_deg: float
) -> list[Line]:
    """Return lines about the origin, flown to and fro.

    Parameters
    ----------
    height_m : float
        Of the images.
    base_m, spacing_m : float
        Distances of exposures and of lines.
    photos : sequence of int
        Of each line.
    course_deg : float
        Of the first line, from north by east.

    Returns
    -------
    list of Line
        In the order of flight.
    """
    course = np.radians(course_deg)
    along = np.array([np.sin(course), np.cos(course)])
    right = np.array([along[1], -along[0]])
    lines = []
    for k, count in enumerate(photos):
        middle = (k - 0.5 * (len(photos) - 1)) * spacing_m * right
        half = 0.5 * (count - 1) * base_m * along * (-1.0) ** k
        lines.append(Line(_pair(middle - half), _pair(middle + half), height_m, count))
    return lines


def _pair(point: Array) -> tuple[float, float]:
    return float(point[0]), float(point[1])


def along_lines(lines: Sequence[Line], rng: np.random.Generator) -> Stations:
    """Return the poses of images along lines.

    Parameters
    ----------
    lines : sequence of Line
        In the order of flight.
    rng : numpy.random.Generator
        Of gusts.

    Returns
    -------
    Stations
        In the order of time.
    """
    time, planned, course = [], [], []
    clock, end = START_TOW, np.array(lines[0].first)
    for line in lines:
        first, last = np.array(line.first), np.array(line.last)
        clock += float(np.linalg.norm(first - end)) / _SPEED_MPS + _TURN_S
        share = np.linspace(0.0, 1.0, line.photos)[:, None]
        horizontal = first + share * (last - first)
        length = float(np.linalg.norm(last - first))
        time.append(clock + share[:, 0] * length / _SPEED_MPS)
        planned.append(np.column_stack([horizontal, np.full(line.photos, line.height_m)]))
        course.append(np.full(line.photos, np.arctan2(*(last - first))))
        clock, end = float(time[-1][-1]), last
    stamps, heading = np.concatenate(time), np.concatenate(course)
    n, gust = stamps.size, gauss_markov(stamps, _GUST_S, 6, rng)
    rpy = np.radians(gust[:, :3] * _RPY_DEG + [0.0, _PITCH_DEG, _CRAB_DEG])
    rpy[:, 2] += heading
    C_mb = ENU_NED @ rotation_from_rpy(rpy)
    velocity = _SPEED_MPS * np.column_stack([np.sin(heading), np.cos(heading), np.zeros(n)])
    return Stations(
        stamps,
        np.vstack(planned) + gust[:, 3:] * _OFF_M,
        C_mb @ FORWARD_RIGHT_DOWN.T,
        velocity,
        np.radians(_RATE_DEGPS) * rng.standard_normal((n, 3)),
        FORWARD_RIGHT_DOWN,
    )
