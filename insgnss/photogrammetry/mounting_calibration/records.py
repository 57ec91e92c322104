"""What a calibration of the mounting starts from: poses of an image block, and of the flight."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError
from ...geodesy.rotation import is_rotation
from ...records import ExteriorOrientation
from ...records.block import Array, BrownCamera
from ...records.cameras.mounting import Mounting
from ...records.rows import covariance_of_rows, rows_of
from ...records.strips import CommonErrors, StripCovariance

Rows = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class BlockPoses:
    """Poses of n images that an adjustment gave.

    Parameters
    ----------
    images : tuple of str
        Their names.
    position : ndarray, (n, 3)
        Projection centres in the axes r of the block, in its unit.
    C_rc : ndarray, (n, 3, 3)
        Camera axes into r.
    cov : ndarray, (n, 6, 6) or (6 n, 6 n), optional
        Covariance of position (unit of r) and attitude psi (rad, axes of r) of each image, or of
        all of them; None where the adjustment does not give it.
    georeferenced : bool
        Whether r is the tangent plane of the flight, m; otherwise r is any frame.
    source : str
        File, for messages.
    notes : tuple of str
        What was taken on trust.
    cameras : tuple of BrownCamera
        Those of the block, as far as it names them.
    shared : ndarray, (6, 6), optional
        Covariance of errors that all images have alike in camera axes, m (of the flight) and rad;
        None: as `equations` assumes them. Not beside the covariance of all images together.

    Raises
    ------
    InputError
        Shapes that differ, values that are not finite, or matrices that are no rotations.
    """

    images: tuple[str, ...]
    position: Array
    C_rc: Array
    cov: Array | None = None
    georeferenced: bool = False
    source: str = "poses"
    notes: tuple[str, ...] = ()
    cameras: tuple[BrownCamera, ...] = ()
    shared: Array | None = None

    def __post_init__(self) -> None:
        n = len(self.images)
        shapes = {"position": (n, 3), "C_rc": (n, 3, 3)}
        if self.cov is not None:
            shapes["cov"] = (n, 6, 6) if self.cov.ndim == 3 else (6 * n, 6 * n)
        for name, shape in shapes.items():
            value = getattr(self, name)
            if value.shape != shape:
                raise InputError(f"BlockPoses.{name}: shape {value.shape}, expected {shape}")
            if not (good := np.isfinite(value).reshape(n, -1).all(axis=1)).all():
                image = self.images[int(np.flatnonzero(~good)[0])]
                raise InputError(f"{self.source}: {name} of image {image} is not finite")
        for image, C in zip(self.images, self.C_rc, strict=True):
            if not is_rotation(C, 1e-4):
                raise InputError(
                    f"{self.source}: the attitude of image {image} is no rotation (determinant"
                    f" {np.linalg.det(C):.4f}; 1 is expected): mirrored axes, or rounded to fewer"
                    " than five digits"
                )

    def taken(self, rows: Rows) -> "BlockPoses":
        """Return these images alone.

        Parameters
        ----------
        rows : ndarray
            Rows of the images.

        Returns
        -------
        BlockPoses
            The same otherwise.
        """
        chosen = rows_of(self, rows, ("images", "position", "C_rc", "cov"))
        if self.cov is not None and self.cov.ndim == 2:
            chosen["cov"] = covariance_of_rows(self.cov, rows)
        return replace(self, **chosen)


@dataclass(frozen=True, eq=False)
class FlightPoses:
    """Poses of n images that a flight gave, with the covariance of all of them.

    Parameters
    ----------
    eo : ExteriorOrientation
        Poses in the tangent plane, with velocities and rates.
    lines : tuple of StripCovariance
        Covariance of each flight line; images in none stand alone.
    common : CommonErrors
        What all lines share, with the lever arm's share.
    mounting : Mounting
        What the flight was processed with.
    delay_s : float
        Delay from event to mid-exposure that it was processed with, s.

    Raises
    ------
    InputError
        The orientation has no velocities, or the covariances are of other images.
    """

    eo: ExteriorOrientation
    lines: tuple[StripCovariance, ...]
    common: CommonErrors
    mounting: Mounting
    delay_s: float = 0.0

    def __post_init__(self) -> None:
        if self.eo.velocity_mps is None or self.eo.rate_radps is None:
            raise InputError("FlightPoses: the orientation has no velocities and angular rates")
        if self.common.segment.size != len(self.eo):
            raise InputError(
                f"FlightPoses: {len(self.eo)} images, common errors of {self.common.segment.size}"
            )

    def pieces(self, rows: Rows) -> list[tuple[Rows, Array]]:
        """Return flight lines as far as they hold some images, each with its covariance.

        Parameters
        ----------
        rows : ndarray
            Increasing rows of the images that are wanted.

        Returns
        -------
        list of tuple of ndarray
            Rows (m,) and covariance (6 m, 6 m) of the errors that lines do not share.
        """
        wanted = np.zeros(len(self.eo), dtype=bool)
        wanted[rows] = True
        pieces: list[tuple[Rows, Array]] = []
        for line in self.lines:
            own = np.flatnonzero(wanted[line.rows])
            wanted[line.rows] = False
            if own.size:
                cov = covariance_of_rows(line.cov, own)
                pieces.append((line.rows[own], self.common.rest(line.rows[own], cov)))
        for row in np.flatnonzero(wanted):
            alone = np.array([row])
            pieces.append((alone, self.common.rest(alone, self.eo.cov[row])))
        return pieces


@dataclass(frozen=True, eq=False)
class Stated:
    """What a flight file says of the mounting.

    Parameters
    ----------
    mounting : Mounting
        Lever arms and bore-sight.
    delay_s : float
        Delay from event to mid-exposure, s.
    keys : frozenset of str
        Which of "antenna_m", "imu_m", "boresight", "delay", "antenna_sigma_m" the file itself
        states; others are defaults.
    """

    mounting: Mounting
    delay_s: float = 0.0
    keys: frozenset[str] = frozenset()

    @property
    def antenna_sigma_m(self) -> float | None:
        """Standard deviation of the antenna's lever arm, where the file states it, m."""
        return self.mounting.antenna_sigma_m if "antenna_sigma_m" in self.keys else None
