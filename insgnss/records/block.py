"""An image block: cameras, images, image observations and ground control, as `adjust` takes it."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.errors import InputError
from ._checked import Array, freeze_field, frozen_integers

INTERIOR = ("f", "cx", "cy", "b1", "b2", "k1", "k2", "k3", "k4", "p1", "p2")
RADIAL = INTERIOR[5:9]  # k1 to k4
RADIAL_MODELS = ("forward", "backward", "fisheye")
"""Parameters of interior orientation, in the order of their arrays."""


@dataclass(frozen=True, eq=False)
class BrownCamera:
    """A frame or fisheye camera with Brown's distortion; equations (J.3) to (J.5) of
    `insgnss.photogrammetry.adjust`.

    Pixels count from the outer corner of the upper left one, u to the right, v down: the centre of
    that pixel is (0.5, 0.5).

    Parameters
    ----------
    name : str
        The camera's name.
    width, height : int
        Size of its images, pixels.
    interior : array_like
        (11,) values of `INTERIOR`: camera constant f and principal point cx, cy in pixels; b1, b2
        in pixels of a forward camera, without unit of a backward one; k1 to k4, p1, p2 of lengths
        in units of f (forward; of a fisheye the angle off the axis, rad) or of `unit_px`
        (backward), y down. p1 belongs to r^2 + 2 x^2.
    backward : bool
        Whether the polynomial takes measured to ideal points.
    unit_px : float
        Pixels in the unit of a backward polynomial, such as those of a millimetre.
    free : tuple of str
        Parameters that an adjustment estimates; the others keep their values.
    fisheye : bool
        Whether the polynomial of a forward camera takes equidistant points (J.4a).

    Raises
    ------
    InputError
        A size, f or `unit_px` that is not positive, a name in `free` that is none of `INTERIOR`,
        values that are not finite.
    """

    name: str
    width: int
    height: int
    interior: Array
    backward: bool = False
    unit_px: float = 1.0
    free: tuple[str, ...] = ()
    fisheye: bool = False

    def __post_init__(self) -> None:
        values = freeze_field(self, "interior", (len(INTERIOR),))
        object.__setattr__(self, "free", tuple(self.free))
        if min(self.width, self.height) <= 0 or values[0] <= 0.0 or not self.unit_px > 0.0:
            raise InputError(
                f"camera {self.name}: {self.width} x {self.height} pixels, f {values[0]:g} px, unit"
                f" {self.unit_px:g} px; each must be positive"
            )
        if self.backward and self.fisheye:
            raise InputError(
                f"camera {self.name}: a fisheye camera cannot be backward; give it a forward model"
            )
        if unknown := set(self.free) - set(INTERIOR):
            raise InputError(
                f"camera {self.name}: {', '.join(sorted(unknown))} is no parameter of interior"
                f" orientation; known are {', '.join(INTERIOR)}"
            )

    @property
    def model(self) -> str:
        """One of `RADIAL_MODELS`."""
        return RADIAL_MODELS[1 if self.backward else 2 * self.fisheye]

    def of(self, name: str) -> float:
        """Return a parameter of interior orientation.

        Parameters
        ----------
        name : str
            One of `INTERIOR`.

        Returns
        -------
        float
            Its value.
        """
        return float(self.interior[INTERIOR.index(name)])

    def with_(self, interior: ArrayLike) -> "BrownCamera":
        """Return the camera with another interior orientation.

        Parameters
        ----------
        interior : array_like, (11,)
            Its values.

        Returns
        -------
        BrownCamera
            The same otherwise.
        """
        return replace(self, interior=np.asarray(interior, dtype=np.float64))


@dataclass(frozen=True, eq=False)
class InteriorCovariance:
    """Covariance of the interior orientation of a camera.

    Parameters
    ----------
    parameters : tuple of str
        (d,) names of `INTERIOR`, in their order.
    cov : ndarray
        (d, d) in the units of `BrownCamera.interior`.

    Raises
    ------
    InputError
        A name that is none, an order that is not that of `INTERIOR`, a shape that differs, or a
        covariance that is not positive definite.
    """

    parameters: tuple[str, ...]
    cov: Array

    def __post_init__(self) -> None:
        d = len(self.parameters)
        cov = freeze_field(self, "cov", (d, d))
        if self.parameters != tuple(name for name in INTERIOR if name in self.parameters):
            raise InputError(
                f"covariance of a camera: {', '.join(self.parameters)} are not parameters in the"
                f" order {', '.join(INTERIOR)}"
            )
        root = np.sqrt(np.maximum(np.diagonal(cov), 0.0))
        if d and not ((root > 0.0).all() and np.linalg.eigvalsh(cov / root / root[:, None])[0] > 0):
            raise InputError("covariance of a camera: it is not positive definite")

    @property
    def whole(self) -> Array:
        """(11, 11) covariance of all parameters; zero of those that have none."""
        rows = [INTERIOR.index(name) for name in self.parameters]
        out = np.zeros((len(INTERIOR),) * 2)
        out[np.ix_(rows, rows)] = self.cov
        return out


@dataclass(frozen=True, eq=False)
class ImageObservations:
    """Points measured in images.

    Parameters
    ----------
    image, point : ndarray of int
        (n,) rows of the block's images and object points.
    uv : ndarray
        (n, 2) pixels from the outer corner of the upper left pixel, right and down.
    sigma_px : ndarray
        (n, 2) standard deviations, pixels.
    correlation : ndarray
        (n,) correlation of the errors of both coordinates; none by default.

    Raises
    ------
    InputError
        Shapes that differ, values that are not finite, a standard deviation that is not positive,
        or a correlation that is not between -1 and 1.
    """

    image: NDArray[np.int64]
    point: NDArray[np.int64]
    uv: Array
    sigma_px: Array
    correlation: Array = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        n = freeze_field(self, "uv", (None, 2)).shape[0]
        freeze_field(self, "sigma_px", (n, 2))
        if self.correlation is None:
            object.__setattr__(self, "correlation", np.zeros(n))
        freeze_field(self, "correlation", (n,))
        for name in ("image", "point"):
            rows = frozen_integers(self, name)
            if rows.shape != (n,) or (rows < 0).any():
                raise InputError(
                    f"ImageObservations.{name}: expected {n} row numbers, counted from 0"
                )
        if n and not self.sigma_px.min() > 0.0:
            raise InputError(
                f"ImageObservations.sigma_px: {self.sigma_px.min():g} px in row"
                f" {int(self.sigma_px.min(axis=1).argmin())}; it must be positive"
            )
        if n and not np.abs(self.correlation).max() < 1.0:
            worst = int(np.abs(self.correlation).argmax())
            raise InputError(
                f"ImageObservations.correlation: {self.correlation[worst]:g} in row {worst}; it"
                " must be between -1 and 1"
            )

    @property
    def whitening(self) -> Array:
        """(n, 3) entries (0, 0), (1, 0), (1, 1), 1 / px, of the lower triangular W with
        W^T W = P, the inverse of each observation's covariance.
        """
        inverse, rho = 1.0 / self.sigma_px, self.correlation
        scale = 1.0 / np.sqrt(1.0 - rho**2)
        return np.column_stack([inverse[:, 0], -rho * scale * inverse[:, 0], scale * inverse[:, 1]])

    def rows(self, rows: NDArray[np.int64] | NDArray[np.bool_]) -> "ImageObservations":
        """Return some of the observations.

        Parameters
        ----------
        rows : ndarray of int or bool
            Their rows, or which of all (n,) they are.

        Returns
        -------
        ImageObservations
            In the order of the rows.
        """
        return ImageObservations(
            self.image[rows],
            self.point[rows],
            self.uv[rows],
            self.sigma_px[rows],
            self.correlation[rows],
        )

    def __len__(self) -> int:
        """Return the number of observed points, each of two coordinates."""
        return int(self.uv.shape[0])


def whitened(whitening: Array, e: Array) -> Array:
    """Return residuals of image observations in units of their standard deviations.

    Parameters
    ----------
    whitening : ndarray, (n, 3)
        As `ImageObservations.whitening`.
    e : ndarray, (n, 2)
        Residuals, pixels.

    Returns
    -------
    ndarray, (n, 2)
        W e, of which no component depends on another.
    """
    second = whitening[:, 1] * e[:, 0] + whitening[:, 2] * e[:, 1]
    return np.column_stack([whitening[:, 0] * e[:, 0], second])


# standard deviation of a coordinate that is not known (m): larger than a block, so that it weighs
# nothing, and small enough that 13 digits hold the others beside it
UNKNOWN_M = 1e4


@dataclass(frozen=True, eq=False)
class GroundPoints:
    """Points on the ground with coordinates and their covariance.

    Parameters
    ----------
    point : ndarray of int
        (n,) rows of the block's object points.
    position_m : ndarray
        (n, 3) coordinates in the axes of the block, m.
    cov : ndarray
        (n, 3, 3) covariance, m^2.

    Raises
    ------
    InputError
        Shapes that differ, values that are not finite, or a covariance that is not positive
        definite.
    """

    point: NDArray[np.int64]
    position_m: Array
    cov: Array

    def __post_init__(self) -> None:
        n = freeze_field(self, "position_m", (None, 3)).shape[0]
        freeze_field(self, "cov", (n, 3, 3))
        rows = frozen_integers(self, "point")
        if rows.shape != (n,):
            raise InputError(
                f"GroundPoints.point: {rows.size} row numbers for {n} positions; give one for each"
            )
        if n and (smallest := np.linalg.eigvalsh(self.cov)[:, 0]).min() <= 0.0:
            raise InputError(
                f"GroundPoints.cov: of row {int(smallest.argmin())} not positive definite; give"
                " each coordinate a standard deviation"
            )

    @property
    def unknown(self) -> NDArray[np.bool_]:
        """(n, 3) coordinates that are not known: their values stand for nothing."""
        return np.diagonal(self.cov, axis1=1, axis2=2) > (0.5 * UNKNOWN_M) ** 2

    @property
    def complete(self) -> "GroundPoints":
        """The points of which all coordinates are known."""
        rows = ~self.unknown.any(axis=1)
        return GroundPoints(self.point[rows], self.position_m[rows], self.cov[rows])

    def __len__(self) -> int:
        """Return the number of points."""
        return int(self.position_m.shape[0])


@dataclass(frozen=True, eq=False)
class ImageBlock:
    """Images of one or more cameras over common object points.

    Axes are Cartesian (a tangent plane, or a local system of the object), right-handed. First
    values of poses may be missing: their rows are not finite, and they come by resection.

    Parameters
    ----------
    cameras : tuple of BrownCamera
        The cameras.
    images : tuple of str
        (n,) names of the images.
    camera : ndarray of int
        (n,) row of each image's camera.
    position_m : ndarray
        (n, 3) first values of the projection centres, m; NaN where there are none.
    C_mc : ndarray
        (n, 3, 3) first values of the attitude, camera (x right, y down, z viewing direction) to the
        axes of the block; NaN where there are none.
    held : ndarray of bool
        (n, 6) components of position and psi that keep their first values: the datum of a block
        without control.
    points : tuple of str
        (m,) names of the object points.
    observations : ImageObservations
        What was measured in the images.
    control, check : GroundPoints
        Ground control points, and points with known coordinates that do not take part.

    Raises
    ------
    InputError
        Shapes that differ, or a row that points to what is not there.
    """

    cameras: tuple[BrownCamera, ...]
    images: tuple[str, ...]
    camera: NDArray[np.int64]
    position_m: Array
    C_mc: Array
    held: NDArray[np.bool_]
    points: tuple[str, ...]
    observations: ImageObservations
    control: GroundPoints
    check: GroundPoints

    def __post_init__(self) -> None:
        """Refuse shapes that do not fit each other and rows that do not exist."""
        image_count, point_count = len(self.images), len(self.points)
        shapes = {
            "camera": (image_count,),
            "position_m": (image_count, 3),
            "C_mc": (image_count, 3, 3),
            "held": (image_count, 6),
        }
        for name, shape in shapes.items():
            if (actual := np.shape(getattr(self, name))) != shape:
                raise InputError(f"ImageBlock.{name}: shape {actual}, expected {shape}")
        rows = {
            "camera": (self.camera, len(self.cameras)),
            "observations.image": (self.observations.image, image_count),
            "observations.point": (self.observations.point, point_count),
            "control.point": (self.control.point, point_count),
            "check.point": (self.check.point, point_count),
        }
        for name, (index, limit) in rows.items():
            if index.size and (index.min() < 0 or index.max() >= limit):
                raise InputError(
                    f"ImageBlock.{name}: row {int(index.max())} does not exist; there are"
                    f" {limit} rows"
                )

    @property
    def oriented(self) -> NDArray[np.bool_]:
        """(n,) which images have first values of position and attitude."""
        finite = np.isfinite(self.position_m).all(axis=1)
        finite &= np.isfinite(self.C_mc).all(axis=(1, 2))
        return np.asarray(finite)
