"""The covariance of any two images of a rig, in one segment, of one clock or of two."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ....geodesy.frames import TangentPlane
from ....navigation.filter.event_chain import EVENTS_OF_PIECE
from ....navigation.orient.exterior import pose_derivatives
from ....records import Array
from .images import CameraImages, Instants, chain_of


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
