"""What a calibration of the mounting starts from: poses of an image block, and of the flight."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError, UsageError
from ...geodesy.frames import TangentPlane, ecef_to_geodetic
from ...geodesy.rotation import is_rotation
from ...io.formats.blocks.measured_block import MeasuredBlock
from ...records import ExteriorOrientation
from ...records.block import Array, BrownCamera
from ...records.cameras.mounting import Mounting
from ...records.rows import covariance_of_rows, rows_of
from ...records.strips import CommonErrors, StripCovariance
from .options import PoseSigma

Rows = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class CameraPoses:
    """Poses of n images that a file has, such as those of an adjusted block.

    Parameters
    ----------
    images : tuple of str
        Their names.
    position : ndarray, (n, 3)
        Projection centres in the Cartesian frame r of the file, in its unit.
    C_rc : ndarray, (n, 3, 3)
        Camera axes (x right, y down, z viewing direction) into r.
    cov : ndarray, (n, 6, 6) or (6 n, 6 n), optional
        Covariance of position (unit of r) and attitude psi (rad, axes of r) of each image, or of
        all of them; None where the file does not give it.
    frame : str
        "own" axes, "geocentric", or "plane".
    source : str
        The file, for messages.
    notes : tuple of str
        What was left out, or taken on trust.
    plane : TangentPlane, optional
        That of "plane", where it is known.
    load : callable, optional
        Reads what else the program of the file knows, which poses do not need.
    date : str
        Of the exposures, ISO; empty where the file has no week.
    opk : ndarray, (n, 3), optional
        Angles of a table as they stand there, rad.
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
    frame: str = "own"
    source: str = "poses"
    notes: tuple[str, ...] = ()
    plane: TangentPlane | None = None
    load: Callable[[], MeasuredBlock] | None = None
    date: str = ""
    opk: Array | None = None
    shared: Array | None = None

    def __post_init__(self) -> None:
        n = len(self.images)
        shapes = {"position": (n, 3), "C_rc": (n, 3, 3)}
        if self.cov is not None:
            shapes["cov"] = (n, 6, 6) if self.cov.ndim == 3 else (6 * n, 6 * n)
        for name, shape in shapes.items():
            value = getattr(self, name)
            if value.shape != shape:
                raise InputError(f"CameraPoses.{name}: shape {value.shape}, expected {shape}")
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

    def taken(self, rows: Rows) -> "CameraPoses":
        """Return these images alone.

        Parameters
        ----------
        rows : ndarray
            Rows of the images.

        Returns
        -------
        CameraPoses
            The same otherwise.
        """
        chosen = rows_of(self, rows, ("images", "position", "C_rc", "cov", "opk"))
        if self.cov is not None and self.cov.ndim == 2:
            chosen["cov"] = covariance_of_rows(self.cov, rows)
        return replace(self, **chosen)

    @cached_property
    def block(self) -> MeasuredBlock | None:
        """What else the program of the file knows; refused as the reader of blocks does."""
        return None if self.load is None else self.load()

    @property
    def cameras(self) -> tuple[BrownCamera, ...]:
        """Cameras that the program of the file knows; none where it has poses alone."""
        try:
            return () if self.block is None else tuple(self.block.cameras)
        except (InputError, UsageError):
            return ()

    @property
    def georeferenced(self) -> bool:
        """Whether r is a tangent plane, m: of a block that of the flight."""
        return self.frame == "plane"

    def with_sigma(self, sigma: PoseSigma, scale: float = 1.0) -> Array:
        """Return the covariances of the file, those of `sigma` where it has none.

        Parameters
        ----------
        sigma : PoseSigma
            Standard deviations.
        scale : float
            Metres for each unit of the frame.

        Returns
        -------
        ndarray, (n, 6, 6)
            In the unit of the frame.
        """
        if self.cov is not None:
            return self.cov
        each = np.repeat([sigma.position_m / scale, np.radians(sigma.angle_deg)], 3)
        return np.broadcast_to(np.diag(np.square(each)), (len(self.images), 6, 6)).copy()

    def in_plane(self, plane: TangentPlane) -> "CameraPoses":
        """Return poses on the Earth in another tangent plane.

        Parameters
        ----------
        plane : TangentPlane
            Its axes.

        Returns
        -------
        CameraPoses
            The same otherwise.

        Raises
        ------
        InputError
            The poses stand in axes of their own.
        """
        if self.frame == "own":
            raise InputError.in_file(
                self.source, "poses stand in axes of their own, with no place on the Earth"
            )
        x, R = self.position, np.eye(3)
        if self.plane is not None:
            lat, lon, h = self.plane.geodetic_from_position(x)
            R = plane.C_em.T @ self.plane.C_em
        else:
            lat, lon, h = ecef_to_geodetic(x)
            R = plane.C_em.T
        turn = np.kron(np.eye(2), R)
        cov = None if self.cov is None else turn @ self.cov @ turn.T
        return replace(
            self,
            position=plane.position_from_geodetic(lat, lon, h),
            C_rc=R @ self.C_rc,
            cov=cov,
            frame="plane",
            plane=plane,
        )


@dataclass(frozen=True, eq=False)
class CovariantPoses:
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
            chosen = np.flatnonzero(wanted[line.rows])
            wanted[line.rows] = False
            if chosen.size:
                cov = covariance_of_rows(line.cov, chosen)
                pieces.append((line.rows[chosen], self.common.rest(line.rows[chosen], cov)))
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
