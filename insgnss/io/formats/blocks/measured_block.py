"""What a photogrammetry program knows of an image block, by names."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import PurePath

import numpy as np
from numpy.typing import NDArray

from ....base.errors import InputError
from ....records.block import Array, BrownCamera, ImageObservations
from ..text.layout import quote
from .ground_points import GroundTable
from .image_points import ImagePoints


@dataclass(frozen=True, eq=False)
class MeasuredBlock:
    """Cameras, image observations, poses and ground points of a program.

    Parameters
    ----------
    cameras : tuple of BrownCamera
        The cameras; none where the file has none.
    camera : ndarray of int
        (n,) row of each image's camera; zeros where there is none.
    measured : ImagePoints
        All images of the file, also those without observations; points; observations.
    position_m : ndarray
        (n, 3) projection centres in the program's own axes, NaN where there is no pose.
    C_mc : ndarray
        (n, 3, 3) attitudes, camera (x right, y down, z viewing direction) to these axes, NaN where
        there is none.
    ground : GroundTable, optional
        Ground points with their roles, in `crs`. Of a projected CRS x is easting, y northing; of a
        geographic one x is longitude and y latitude in degrees, while the covariance counts east,
        north, up in m^2.
    crs : str, optional
        CRS of `ground`, such as "EPSG:3826" or WKT; None: not stated.
    local : bool
        Whether the poses stand in axes of their own, up to a similarity. Where they do not, the
        axes are geocentric, or else those of `ground`.
    geocentric : bool
        Whether the poses stand in Earth-centred, Earth-fixed axes, m.
    free_stated : bool
        Whether the file says which parameters of its cameras are estimated.
    notes : tuple of str
        What was left out or taken on trust, in sentences.
    held : ndarray of bool, optional
        (n, 6) which components of the poses the file's own datum holds.

    Raises
    ------
    InputError
        Shapes that differ, an image or a point that is named twice, or an image whose camera is not
        there.
    """

    cameras: tuple[BrownCamera, ...]
    camera: NDArray[np.int64]
    measured: ImagePoints
    position_m: Array
    C_mc: Array
    ground: GroundTable | None = None
    crs: str | None = None
    local: bool = True
    geocentric: bool = False
    free_stated: bool = False
    notes: tuple[str, ...] = ()
    held: NDArray[np.bool_] | None = None

    def __post_init__(self) -> None:
        n = len(self.measured.images)
        shapes = {"camera": (n,), "position_m": (n, 3), "C_mc": (n, 3, 3)}
        for name, shape in shapes.items():
            if (got := np.shape(getattr(self, name))) != shape:
                raise InputError(f"MeasuredBlock.{name}: shape {got}, expected {shape}")
        if n and not 0 <= self.camera.min() <= self.camera.max() < max(1, len(self.cameras)):
            raise InputError(
                f"MeasuredBlock.camera: row {int(self.camera.max())} of {len(self.cameras)} cameras"
            )
        for kind in ("images", "points"):
            names = getattr(self.measured, kind)
            if len(set(names)) < len(names):
                twice = next(name for k, name in enumerate(names) if name in names[:k])
                raise InputError(f"MeasuredBlock.{kind}: {quote(twice)} is there twice")

    @property
    def oriented(self) -> NDArray[np.bool_]:
        """(n,) which images have a pose."""
        finite = np.isfinite(self.position_m).all(axis=1)
        return np.asarray(finite & np.isfinite(self.C_mc).all(axis=(1, 2)))


def minimal_datum(position: Array, reference: int, second: int | None = None) -> NDArray[np.bool_]:
    """Return which components of poses hold a block of seven degrees of freedom.

    Parameters
    ----------
    position : ndarray, (n, 3)
        Projection centres.
    reference : int
        Row of the image whose pose is held.
    second : int, optional
        Row of the image of which a coordinate is held: that which is farthest from the first. By
        default that of the image farthest away.

    Returns
    -------
    ndarray of bool, (n, 6)
        Of position and rotation.
    """
    held = np.zeros((len(position), 6), dtype=bool)
    distance_m = np.abs(position - position[reference])
    if second is not None:
        distance_m[np.arange(len(distance_m)) != second] = -1.0
    held[reference] = True
    held[np.unravel_index(int(np.nanargmax(distance_m)), distance_m.shape)] = True
    return held


def of_table(measured: ImagePoints, *cameras: BrownCamera) -> MeasuredBlock:
    """Return image observations alone as a block.

    Parameters
    ----------
    measured : ImagePoints
        The observations.
    *cameras : BrownCamera
        The camera of all images, or none.

    Returns
    -------
    MeasuredBlock
        Without poses and ground points.
    """
    n = len(measured.images)
    camera = np.zeros(n, dtype=np.int64)
    return MeasuredBlock(cameras, camera, measured, *no_poses(n))


def no_poses(n: int) -> tuple[Array, Array]:
    """Return positions (n, 3) and attitudes (n, 3, 3) of images without pose: NaN."""
    return np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan)


def file_names(paths: Sequence[str], path: object) -> tuple[str, ...]:
    """Return the names of images as an exterior orientation has them: those of their files.

    Parameters
    ----------
    paths : sequence of str
        Names, perhaps with folders before them.
    path : path
        The file that they stand in, for the message.

    Returns
    -------
    tuple of str
        File names; where two are the same, all with their folders.

    Raises
    ------
    InputError
        An image that is there twice.
    """
    names = tuple(PurePath(name.replace("\\", "/")).name for name in paths)
    if len(set(names)) < len(names):
        names = tuple(paths)
    if len(set(names)) < len(names):
        twice = next(name for k, name in enumerate(names) if name in names[:k])
        raise InputError.in_file(
            path, f"image {quote(twice)} occurs twice; give each image a name of its own"
        )
    return names


def check_once(
    path: object, lines: Sequence[int], image: Sequence[str], point: Sequence[str]
) -> None:
    """Refuse a point that is measured twice in an image.

    Parameters
    ----------
    path : path
        The file, for the message.
    lines : sequence of int, (m,)
        The line of each observation.
    image, point : sequence of str, (m,)
        Names of its image and its point.

    Raises
    ------
    InputError
        The first such point, with file and line.
    """
    first: dict[tuple[str, str], int] = {}
    for line, key in zip(lines, zip(image, point, strict=True), strict=True):
        if (before := first.setdefault(key, line)) != line:
            raise InputError.at_line(
                path,
                line,
                f"point {quote(key[1])} is measured twice in image {quote(key[0])}, before in line"
                f" {before}; delete one of the lines",
            )


def image_points(
    images: Sequence[str],
    image: Sequence[int] | NDArray[np.int64],
    point: Sequence[str],
    uv: Sequence[Sequence[float]] | Array,
    sigma_px: Sequence[float] | Array,
) -> tuple[ImagePoints, tuple[str, ...]]:
    """Return image observations by the names of their points.

    A point that is measured more than once in an image says nothing there: which of the
    measurements is meant is not known. These observations are left out.

    Parameters
    ----------
    images : sequence of str
        Names of all images.
    image : sequence of int, (m,)
        Row of each observation's image.
    point : sequence of str, (m,)
        Name of its point.
    uv : sequence, (m, 2)
        Pixels from the outer corner of the upper left one, right and down.
    sigma_px : sequence of float, (m,)
        Standard deviations of both coordinates, pixels.

    Returns
    -------
    measured : ImagePoints
        The observations.
    notes : tuple of str
        What was left out.
    """
    points = tuple(dict.fromkeys(point))
    row_by_name = {name: k for k, name in enumerate(points)}
    rows = np.array([row_by_name[name] for name in point], dtype=np.int64)
    image_row = np.asarray(image, dtype=np.int64).reshape(-1)
    key = image_row * max(1, len(points)) + rows
    _, where, count = np.unique(key, return_inverse=True, return_counts=True)
    keep = count[where.reshape(-1)] == 1
    notes: tuple[str, ...] = ()
    if n_repeated := int((~keep).sum()):
        row = int(np.argmin(keep))
        notes = (
            f"{n_repeated} observations left out: their points are measured more than once in an"
            f" image, such as {quote(points[rows[row]])} in {quote(images[image_row[row]])}",
        )
    sigma = np.repeat(np.asarray(sigma_px, dtype=np.float64).reshape(-1, 1), 2, axis=1)
    pixels = np.asarray(uv, dtype=np.float64).reshape(-1, 2)
    observations = ImageObservations(image_row[keep], rows[keep], pixels[keep], sigma[keep])
    return ImagePoints(tuple(images), points, observations), notes
