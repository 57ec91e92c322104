"""Poses as the file of a bundle adjustment has them, and how numbers of its text are read."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ....base.errors import InputError
from ..blocks.measured_block import file_names
from ..text.layout import quote
from ..text.text import Source, number

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ReturnedPoses:
    """Adjusted poses of n images, in the frame of their file.

    Parameters
    ----------
    images : tuple of str
        (n,) names of the images.
    position : ndarray, (n, 3)
        Projection centres: easting, northing, height in the unit of the CRS; longitude, latitude,
        rad, and height, m; or Cartesian coordinates, m.
    C : ndarray, (n, 3, 3), or None
        Camera (x right, y down, z viewing direction) to the axes of the frame at the image; None
        of positions alone.
    kind : str
        Kind of the frame, of `records.framed.KINDS`; empty where the file does not say.
    crs : str
        CRS where the file names it: of a projected frame, or a geographic one of another datum
        than WGS 84.
    origin : tuple of float
        Latitude and longitude, rad, and height, m, of a tangent plane's origin.
    true_north : bool
        Whether attitudes count from true north, in a projected CRS as well.
    angle_set : str
        "opk" or "ypr" where the file has angles.
    angles : ndarray, (n, 3), or None
        These angles, rad.
    notes : tuple of str
        What was left out or taken on trust.
    cov_position, cov_attitude : ndarray, (n, 3, 3), or None
        In the axes of the frame, m^2 and rad^2; None where an image has none.
    """

    images: tuple[str, ...]
    position: Array
    C: Array | None
    kind: str = ""
    crs: str = ""
    origin: tuple[float, ...] = ()
    true_north: bool = False
    angle_set: str = ""
    angles: Array | None = None
    notes: tuple[str, ...] = ()
    cov_position: Array | None = None
    cov_attitude: Array | None = None


def numbers(fields: Sequence[str], path: Source, line: int) -> list[float]:
    """Return the numbers of a line.

    Parameters
    ----------
    fields : sequence of str
        Its fields.
    path : path
        The file.
    line : int
        Number of the line.

    Returns
    -------
    list of float
        Finite numbers.

    Raises
    ------
    InputError
        A word that is none, with file and line.
    """
    return [number(word, path, line) for word in fields]


def checked_rotations(R: Array, names: Sequence[str], path: Source) -> Array:
    """Return matrices that are rotations.

    Parameters
    ----------
    R : ndarray, (n, 3, 3)
        Matrices of a file.
    names : sequence of str
        Names of the images.
    path : path
        The file.

    Returns
    -------
    ndarray, (n, 3, 3)
        The same.

    Raises
    ------
    InputError
        The first that is none, by more than its printed digits leave.
    """
    deviation = np.abs(R @ R.swapaxes(1, 2) - np.eye(3)).max(axis=(1, 2))
    deviation = np.where(np.linalg.det(R) > 0.0, deviation, np.inf)
    if (deviation > ROUND).any():
        k = int(np.argmax(deviation > ROUND))
        raise InputError.in_file(
            path, f"the matrix of image {quote(names[k])} is no rotation; export it again"
        )
    return R


def image_names(names: Sequence[str], path: Source) -> tuple[str, ...]:
    """Return names of images as an exterior orientation has them, as `file_names` does.

    Parameters
    ----------
    names : sequence of str
        Those of the file, perhaps with folders.
    path : path
        The file.

    Returns
    -------
    tuple of str
        File names, each once.

    Raises
    ------
    InputError
        None at all, or an image that is there twice.
    """
    if not names:
        raise InputError.in_file(path, UNPOSED)
    return file_names(names, path)


UNPOSED = "no image has a pose; align the images and export them again"
ROUND = 1e-4  # of elements of a rotation from an orthonormal one: files print five digits or more
