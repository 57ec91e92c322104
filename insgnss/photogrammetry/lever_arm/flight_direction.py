"""Where the camera flies to, as it sees it: along this direction a delay of the exposures looks as
a lever arm does.
"""

from dataclasses import dataclass

import numpy as np

from ...geodesy.explain import explain
from ...geodesy.readings import of_attitudes, suspected_readings
from ...records import Array

STRAIGHT = 0.94  # cosine of the turn between neighbouring legs: 20 deg
STEP_RATIO = 2.0  # times the median distance of neighbours: within a strip
# length of the mean direction in camera axes: the camera looks the same way in flight
LOOKS_ALIKE = 0.9
FEWEST_COURSES = 8  # images on straight legs, for a mean direction (chosen)
# rms (deg) by which cameras are off a quarter turn to their courses, beyond which another reading
# of their angles is asked for, and below which one is named: wind turns aircraft by less
ASKEW_DEG, ALONG_DEG = 8.0, 5.0
QUARTER_DEG = 90.0  # turn by multiples of which cameras are mounted
BEARING_UNITS = ("degrees", "radians", "gon")
SIGNIFICANT_CORRELATION = 3.0  # of a correlation, over 1 / sqrt(n)
MOST_CORRELATION = 0.98  # of neighbours: 1 would leave one observation of all (chosen)


@dataclass(frozen=True, eq=False)
class FlightDirection:
    """The direction of flight.

    Parameters
    ----------
    in_camera : ndarray, (3,)
        Unit vector in camera axes.
    course : ndarray, (n, 3)
        Unit vectors in the mapping frame, NaN of images in turns and at the ends of strips.
    course_deg : ndarray, (n,)
        Their azimuths.
    speed_mps : float or None
        Median speed, where there are times.
    """

    in_camera: Array
    course: Array
    course_deg: Array
    speed_mps: float | None

    @property
    def words(self) -> str:
        """The camera axis nearest to it."""
        axis = int(np.argmax(np.abs(self.in_camera)))
        return f"{'+' if self.in_camera[axis] > 0.0 else '-'}{'xyz'[axis]}"

    def split_rms(self, residual: Array) -> tuple[float, float]:
        """Return rms residuals along the flight direction and across it.

        Parameters
        ----------
        residual : ndarray, (n, 3)
            Residuals in the mapping frame.

        Returns
        -------
        along, across : float
            Of the horizontal residuals in strips, in their unit.
        """
        use = np.isfinite(self.course[:, 0])
        d, e = self.course[use], residual[use]
        along = d[:, 0] * e[:, 0] + d[:, 1] * e[:, 1]
        across = d[:, 0] * e[:, 1] - d[:, 1] * e[:, 0]
        return float(np.sqrt((along**2).mean())), float(np.sqrt((across**2).mean()))

    def lever_arm(self, arm: Array, cov: Array) -> tuple[float, float]:
        """Return the lever arm along this direction and its standard error.

        Parameters
        ----------
        arm, cov : ndarray
            (3,) and (3, 3) in camera axes, m.

        Returns
        -------
        tuple of float
            m.
        """
        f = self.in_camera
        return float(f @ arm), float(np.sqrt(f @ cov @ f))


def flight_direction(position: Array, C_mc: Array, time: Array | None) -> FlightDirection | None:
    """Find where the camera flies to.

    Parameters
    ----------
    position : ndarray, (n, 3)
        Antenna positions in the mapping frame, in the order of the exposures.
    C_mc : ndarray, (n, 3, 3)
        Camera to mapping frame.
    time : ndarray, (n,), or None
        Stamps, s.

    Returns
    -------
    FlightDirection or None
        None where the camera does not look the same way along all strips, or few images stand in
        strips.
    """
    course, speed = courses(position, time)
    use = np.isfinite(course[:, 0])
    if use.sum() < FEWEST_COURSES:
        return None
    direction = np.einsum("nji,nj->ni", C_mc[use], course[use]).mean(axis=0)
    if (size := float(np.linalg.norm(direction))) < LOOKS_ALIKE:
        return None
    azimuth = np.degrees(np.arctan2(course[:, 0], course[:, 1])) % 360.0
    return FlightDirection(direction / size, course, azimuth, speed)


def courses(position: Array, time: Array | None) -> tuple[Array, float | None]:
    """Return the directions (n, 3) in which images are flown, and the median speed, m/s.

    Parameters
    ----------
    position, time : ndarray
        As of `flight_direction`.

    Returns
    -------
    course : ndarray, (n, 3)
        Horizontal unit vectors, NaN in turns and at the ends of strips.
    speed_mps : float or None
        None without times.
    """
    order = np.arange(len(position)) if time is None else np.argsort(time, kind="stable")
    step = np.diff(position[order], axis=0)
    step[:, 2] = 0.0
    length = np.linalg.norm(step, axis=1)
    course = np.full(position.shape, np.nan)
    speeds = []
    usual = float(np.median(length)) if len(length) else 0.0
    for k in range(1, len(order) - 1):
        a, b = step[k - 1], step[k]
        area = length[k - 1] * length[k]
        if not 0.0 < max(length[k - 1], length[k]) <= STEP_RATIO * usual or a @ b < STRAIGHT * area:
            continue
        course[order[k]] = (a + b) / np.linalg.norm(a + b)
        if time is not None and (dt := time[order[k + 1]] - time[order[k - 1]]) > 0.0:
            speeds.append(float(np.linalg.norm(a + b)) / dt)
    return course, float(np.median(speeds)) if speeds else None


def misread_angles(
    C_mc: Array,
    R: Array,
    opk: Array | None,
    exposures: tuple[Array, Array | None],
    source: str,
) -> tuple[str, ...]:
    """Say of cameras askew to their courses in which other reading of their angles they are not.

    Neither the residuals of a short lever arm nor tilts show a wrong kappa. Cameras are mounted by
    quarter turns as a rule: it is asked, not refused.

    Parameters
    ----------
    C_mc : ndarray, (n, 3, 3)
        Camera to mapping frame.
    R : ndarray, (3, 3)
        Axes of the poses to the mapping frame.
    opk : ndarray, (n, 3), or None
        Angles as the file has them, rad.
    exposures : tuple
        Positions and stamps, as of `flight_direction`.
    source : str
        Name of the file.

    Returns
    -------
    tuple of str
        A note, or none.
    """
    course, _ = courses(*exposures)
    use = np.isfinite(course[:, 0])
    if use.sum() < FEWEST_COURSES:
        return ()

    def askew(C: Array) -> float:
        along = np.einsum("nji,nj->ni", C[use], course[use])
        turn = np.degrees(np.arctan2(along[:, 1], along[:, 0]))
        askew_deg = (turn + 0.5 * QUARTER_DEG) % QUARTER_DEG - 0.5 * QUARTER_DEG
        return float(np.sqrt((askew_deg**2).mean()))

    if (misread := askew(C_mc)) < ASKEW_DEG:
        return ()
    readings = of_attitudes(opk, BEARING_UNITS)
    candidates = suspected_readings(source, readings, lambda C, change: R @ change(R.T @ C))
    explanation = explain(C_mc, candidates, askew, ALONG_DEG)
    if explanation is None:
        return ()
    return (
        f"cameras stand {misread:.0f} deg askew to their courses, and {askew(explanation.data):.0f}"
        f" deg if {explanation.clauses()}: are its angles read rightly? The lever arm is wrong if"
        " not",
    )


def neighbour_correlation(residual: Array) -> Array:
    """Return the correlation of neighbouring rows, zero where chance explains it.

    Parameters
    ----------
    residual : ndarray, (n, 3)
        Residuals in the order of the exposures.

    Returns
    -------
    ndarray, (3,)
        Between 0 and 0.98.
    """
    n = len(residual)
    e = residual - residual.mean(axis=0)
    size = (e**2).sum(axis=0)
    rho = np.where(size > 0.0, (e[1:] * e[:-1]).sum(axis=0) / np.maximum(size, 1e-300), 0.0)
    return np.where(
        rho * np.sqrt(n) > SIGNIFICANT_CORRELATION, np.minimum(rho, MOST_CORRELATION), 0.0
    )
