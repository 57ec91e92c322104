"""Which camera of a rig took which image, and how neighbouring images of one camera err together.

The images of a rig stand in the order of time, those of one instant in the order of the cameras.
Next to an image stands one of another camera as a rule, of the same instant: what both err in
common is `cross` of their record. Relative control and flight lines want the next image of the same
camera instead; what an image errs in common with that stands here.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError
from .._checked import Array, freeze, frozen_integers


@dataclass(frozen=True, eq=False)
class RigCamera:
    """A camera of a rig.

    Parameters
    ----------
    name : of the camera.
    boresight, camera_from_body : (3, 3) matrices B and T of its mounting that were applied.

    Raises
    ------
    InputError : a matrix has another shape.
    """

    name: str
    boresight: Array
    camera_from_body: Array

    def __post_init__(self) -> None:
        freeze(self, {"boresight": (3, 3), "camera_from_body": (3, 3)})


@dataclass(frozen=True, eq=False)
class RigImages:
    """The cameras of n images.

    Parameters
    ----------
    cameras : the cameras of the rig, two at least, the first that of [camera] of the flight file.
    number : (n,) which of them took each image, from 0.
    cross : (n, 6, 6) covariance of the errors of each image with those of the next image of its
        camera, as `ExteriorOrientation.cov`; zeros where there is none. None: not known.

    Raises
    ------
    InputError : a shape is wrong, a number is that of no camera, or two cameras have one name.
    """

    cameras: tuple[RigCamera, ...]
    number: NDArray[np.int64]
    cross: Array | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "cameras", tuple(self.cameras))
        number = frozen_integers(self, "number")
        names = self.names
        if len(set(names)) < len(names):
            raise InputError(f"RigImages: two cameras of one name among {', '.join(names)}")
        if number.ndim != 1 or ((number < 0) | (number >= len(names))).any():
            raise InputError(f"RigImages.number: numbers of {len(names)} cameras, from 0")
        freeze(self, {"cross": (number.size, 6, 6)})

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the cameras."""
        return tuple(camera.name for camera in self.cameras)

    @property
    def of_images(self) -> list[str]:
        """The name of the camera of each image."""
        names = self.names
        return [names[k] for k in self.number.tolist()]

    @property
    def C_cb(self) -> Array:
        """(n, 3, 3), body to the camera of each image, T B."""
        each = np.stack([camera.camera_from_body @ camera.boresight for camera in self.cameras])
        return np.asarray(each[self.number])

    @property
    def next_of_camera(self) -> NDArray[np.int64]:
        """(n,) row of the next image of the same camera, -1 where there is none."""
        next_row = np.full(self.number.size, -1, dtype=np.int64)
        for rows in self.rows:
            next_row[rows[:-1]] = rows[1:]
        return next_row

    @property
    def rows(self) -> list[NDArray[np.int64]]:
        """The rows of the images of each camera."""
        return [np.flatnonzero(self.number == k) for k in range(len(self.cameras))]

    def taken(self, rows: NDArray[np.int64]) -> "RigImages":
        """Return those of some images.

        Parameters
        ----------
        rows : (k,) rows of the images.

        Returns
        -------
        RigImages
            Without `cross` where an image between two of one camera was left out.
        """
        chosen = replace(self, number=self.number[rows], cross=None)
        if self.cross is None:
            return chosen
        after, now = self.next_of_camera, chosen.next_of_camera
        has = now >= 0
        if (after[rows[has]] != rows[now[has]]).any():
            return chosen
        return replace(chosen, cross=np.where(has[:, None, None], self.cross[rows], 0.0))

    def neighbour_cross(self, rows: NDArray[np.int64], cross: Array | None) -> Array | None:
        """Return the covariance of each of some images with the next of them.

        Parameters
        ----------
        rows : (k,) rows of the images.
        cross : (n - 1, 6, 6) covariance of the images with their neighbours in time, where known.

        Returns
        -------
        Array or None
            (k - 1, 6, 6); None where two of them are neighbours neither in time nor of a camera.
        """
        first, second = rows[:-1], rows[1:]
        in_time = (second == first + 1) & (cross is not None)
        of_camera = (self.next_of_camera[first] == second) & (self.cross is not None)
        if not (in_time | of_camera).all():
            return None
        covariance = np.zeros((first.size, 6, 6))
        if self.cross is not None:
            covariance[of_camera] = self.cross[first[of_camera]]
        if cross is not None:
            covariance[in_time] = cross[first[in_time]]
        return covariance

    def index(self, name: str) -> int:
        """Return the number of a camera.

        Parameters
        ----------
        name : of the camera.

        Returns
        -------
        int
            Its number.

        Raises
        ------
        InputError : there is no such camera.
        """
        if name not in self.names:
            raise InputError(f"camera {name!r} is none of the rig; it has {', '.join(self.names)}")
        return self.names.index(name)


def merged_order(times: Sequence[Array]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the order of time of the images of several cameras.

    Parameters
    ----------
    times : exposures of each camera, s, increasing.

    Returns
    -------
    order : ndarray
        (n,) rows of the images of all cameras one after the other; of one instant in the order of
        the cameras.
    number : ndarray
        (n,) camera of each image in that order.
    """
    number = np.repeat(np.arange(len(times)), [time.size for time in times])
    order = np.lexsort((number, np.concatenate(times)))
    return order, number[order]
