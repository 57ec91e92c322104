"""The trajectory on the output grid, and the exterior orientation of the images.

`RigPairs` gives the covariance of any two images of a rig.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ....base.errors import DataError
from ....geodesy.frames import TangentPlane
from ....navigation.filter.event_chain import EVENTS_OF_PIECE
from ....navigation.filter.trajectory import dense_trajectory, trajectory
from ....navigation.orient.exterior import exterior_orientation, pose_derivatives
from ....navigation.orient.rig import rig_orientation
from ....records import Array, ExteriorOrientation, GnssFixes, Trajectory
from ....records.cameras.rig import merged_order
from ...config.flight_file import Flight
from ..checks import refuse_unobservable
from ..estimation_problem import MOST_EPOCHS_HZ
from ..recording import Recording
from ..segment import Segment
from .images import CameraImages, Instants, chain_of, images_of


class RigPairs:
    """The covariance of any two images of a rig (O.4).

    Parameters
    ----------
    images : sequence of CameraImages
        The images of each camera.
    order : ndarray of int
        (n,) rows among all of them, one camera behind the other, as the rig has them.
    number : ndarray of int
        (n,) the camera of each image of the rig.
    plane : TangentPlane
        Of the poses.
    """

    def __init__(
        self,
        images: Sequence[CameraImages],
        order: NDArray[np.int64],
        number: NDArray[np.int64],
        plane: TangentPlane,
    ) -> None:
        self.images, self.number = images, number
        self.segment = np.concatenate([camera.segment for camera in images])[order]
        self.instant = np.concatenate([camera.instant for camera in images])[order]
        J = [pose_derivatives(camera.exposed, camera.mounting, plane) for camera in images]
        self.J = np.concatenate(J)[order]
        self.cov = np.concatenate([camera.exposed.cov for camera in images])[order]
        self.receiver = np.array([camera.of_receiver for camera in images])[number]
        triggered = [camera.camera.triggered or camera is images[0] for camera in images]
        self.triggered = np.array(triggered)[number]

    def of_neighbours(self) -> tuple[Array, Array]:
        """Return the covariances of neighbours.

        Returns
        -------
        in_time : Array
            (n - 1, 6, 6) of neighbours in time.
        of_camera : Array
            (n, 6, 6) of an image and the next of its camera; zeros of the last.
        """
        n = self.number.size
        in_time = self.of(np.arange(n - 1), np.arange(1, n))
        of_camera = np.zeros((n, 6, 6))
        for k in range(len(self.images)):
            rows = np.flatnonzero(self.number == k)
            of_camera[rows[:-1]] = self.of(rows[:-1], rows[1:])
        return in_time, of_camera

    def of(self, a: NDArray[np.int64], b: NDArray[np.int64]) -> Array:
        """Return the covariances of pairs of images.

        Parameters
        ----------
        a, b : ndarray of int
            (p,) the first and the second of each.

        Returns
        -------
        Array
            (p, 6, 6); zeros where they lie in different segments.
        """
        cov = np.zeros((a.size, 6, 6))
        for key in {(int(self.segment[k]), bool(self.receiver[k])) for k in a}:
            of_clock = (self.segment[a] == key[0]) & (self.receiver[a] == key[1])
            rows = np.flatnonzero(of_clock & (self.segment[b] == key[0]))
            cov[rows] = self._in_segment(a[rows], b[rows])
        return cov

    def _in_segment(self, a: NDArray[np.int64], b: NDArray[np.int64]) -> Array:
        """Return those of pairs in one segment whose first images are of one clock."""
        if not a.size:
            return np.zeros((0, 6, 6))
        way = self.instant[b] - self.instant[a]
        alike = self.receiver[a] == self.receiver[b]
        together, beside = alike & (way == 0), alike & (way == 1)
        at_instants = self._instants(int(a[0])).trajectory
        P = np.zeros((a.size, 9, 9))
        P[together] = at_instants.cov[self.instant[a[together]]]
        by_trigger = together & self.triggered[a] & self.triggered[b]
        P[by_trigger] = self.cov[a[by_trigger]]
        assert at_instants.cross is not None
        P[beside] = at_instants.cross[self.instant[a[beside]]]
        cov = self.J[a] @ P @ np.swapaxes(self.J[b], 1, 2)
        for candidates in (~(together | beside) & (way >= 0), ~(together | beside) & (way < 0)):
            if candidates.any():
                first, second = (a, b) if (way[candidates] >= 0).all() else (b, a)
                pairs = self._by_chain(first[candidates], second[candidates])
                cov[candidates] = pairs if first is a else np.swapaxes(pairs, 1, 2)
        return cov

    def _by_chain(self, a: NDArray[np.int64], b: NDArray[np.int64]) -> Array:
        """Return those of pairs whose instants are apart, or of two clocks."""
        chain = chain_of(self._instants(int(a[0])).segment)
        cov, begin = np.zeros((a.size, 6, 6)), self.instant[a] // EVENTS_OF_PIECE * EVENTS_OF_PIECE
        for first in np.unique(begin):
            pairs = np.flatnonzero(begin == first)
            piece = chain.piece(int(first), int(self.instant[b[pairs]].max()) + 1)
            T = [self.J[rows] @ self._derivatives(rows) for rows in (a[pairs], b[pairs])]
            events = (self.instant[a[pairs]] - first, self.instant[b[pairs]] - first)
            cov[pairs] = piece.cross(events, (T[0], T[1]))
        return cov

    def _derivatives(self, rows: NDArray[np.int64]) -> Array:
        """(images, 9, n) errors at images of one segment by the errors of all states."""
        instants = self._instants(int(rows[0]))
        T = instants.derivatives(self.instant[rows])
        of_other_clock = self.receiver[rows] != instants.of_receiver
        if of_other_clock.any():
            index = rows[of_other_clock]
            T[of_other_clock] = self._instants(int(index[0])).derivatives(self.instant[index])
        return T

    def _instants(self, row: int) -> Instants:
        return self.images[int(self.number[row])].instants[int(self.segment[row])]


ORIGIN_DIGITS = 2  # decimals of a degree of the tangent plane's origin by default


def output_trajectory(flight: Flight, segments: Sequence[Segment], gps_week: int) -> Trajectory:
    """Recover the trajectory at the rate that the flight file asks for.

    Parameters
    ----------
    flight : Flight
        The flight file.
    segments : sequence of Segment
        The solved segments.
    gps_week : int
        The GPS week whose seconds the stamps count.

    Returns
    -------
    Trajectory
        The poses of all segments, of the navigation centre of the IMU.
    """
    hz = flight.output.trajectory_hz
    return Trajectory.joined(
        [
            trajectory(segment.solution, segment.grid, gps_week)
            if at_epochs(hz)
            else dense_trajectory(segment.solution, gps_week, hz)
            for segment in segments
        ]
    )


def at_epochs(hz: float | None) -> bool:
    """Tell whether the rows of the output are epochs, which need no increments between them.

    Parameters
    ----------
    hz : float or None
        `output.trajectory_hz`.

    Returns
    -------
    bool
        Whether the rate is at most `MOST_EPOCHS_HZ`.
    """
    return hz is not None and hz <= MOST_EPOCHS_HZ


def orient_images(
    flight: Flight,
    recording: Recording,
    segments: Sequence[Segment],
    history: tuple[str, ...],
) -> ExteriorOrientation | None:
    """Orient the images within the segments.

    Their times are those of the trajectory: an exposure that the receiver stamped is given the
    instant in the IMU's clock.

    Parameters
    ----------
    flight : Flight
        The flight file.
    recording : Recording
        The recording, which holds the exposures.
    segments : sequence of Segment
        The solved segments.
    history : tuple of str
        What was done, sentence by sentence; the result carries it.

    Returns
    -------
    ExteriorOrientation or None
        The orientation of each image in the tangent plane; None without a camera.

    Raises
    ------
    DataError
        Where no image lies in a segment, or the attitudes are not determined.
    """
    if not recording.cameras:
        return None
    images = images_of(flight, recording, segments)
    if not images:
        raise DataError(
            f"{recording.cameras[0].events.source}: no image lies in a segment that could be"
            " solved; see the gaps of `insgnss inspect`"
        )
    refuse_unobservable(flight, images[0].exposed)
    plane = tangent_plane(flight, segments[0].fixes)
    oriented = []
    for of_camera in images:
        taken = of_camera.camera.events[of_camera.rows]
        if of_camera.of_receiver:
            taken = replace(taken, time=of_camera.exposed.time)
        eo = exterior_orientation(of_camera.exposed, taken, of_camera.mounting, plane, history)
        oriented.append(replace(eo, datum=flight.gnss.datum, epoch=flight.gnss.epoch))
    if len(recording.cameras) == 1:
        return oriented[0]
    order, number = merged_order([eo.time for eo in oriented])
    cross = RigPairs(images, order, number, plane).of_neighbours()
    return rig_orientation(
        oriented, [of_camera.camera.name for of_camera in images], order, number, cross
    )


def tangent_plane(flight: Flight, fixes: GnssFixes) -> TangentPlane:
    """Return the tangent plane of the flight file, else at the first fix, rounded, height 0.

    Parameters
    ----------
    flight : Flight
        The flight file.
    fixes : GnssFixes
        The fixes of the first segment.

    Returns
    -------
    TangentPlane
        Of the orientation of all images.
    """
    if flight.tangent_plane is not None:
        return TangentPlane(*map(float, flight.tangent_plane.origin))
    near = np.radians(np.round(np.degrees([fixes.lat[0], fixes.lon[0]]), ORIGIN_DIGITS))
    return TangentPlane(float(near[0]), float(near[1]), 0.0)
