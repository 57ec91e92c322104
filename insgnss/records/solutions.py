"""What was estimated: the trajectory, the exterior orientation of the images, and how the filter
fared.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.errors import InputError
from ._checked import Array, freeze
from .cameras.rig import RigImages
from .rows import Chosen, Rows, RowShapes
from .series import ConstantSeries, ImuBiases, Innovations
from .verdicts import Estimate, Finding, MeanResidual, TimeCorrelatedError


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory(Rows):
    """Position, velocity and attitude of the IMU's navigation centre, with covariance.

    Parameters
    ----------
    time : (n,) s, GPST of `gps_week`, increasing.
    lat, lon : (n,) geodetic latitude and longitude, rad, WGS84.
    height : (n,) m above the ellipsoid.
    velocity_ned : (n, 3) with respect to the Earth, north, east, down at the point, m/s.
    C_nb : (n, 3, 3) attitude, body forward-right-down to north-east-down at the point.
    cov : (n, 9, 9) covariance of position (m), velocity (m/s) and attitude psi (rad), all in north,
        east, down at the point; C_nb(true) = exp([psi x]) C_nb.
    gps_week : GPS week of `time`.
    acceleration_b : (n, 3) of the body with respect to the Earth, body axes, m/s^2, or None.
    rate_b : (n, 3) angular rate of the body with respect to the Earth, body axes, rad/s, or None.
    cross : (n - 1, 9, 9) covariance of the errors of row k with those of row k + 1, each in its own
        axes; None where it is not known.

    Raises
    ------
    InputError : a shape is wrong, a value is not finite, or time does not increase.
    """

    _ROWS: ClassVar[RowShapes] = {
        **{"time": (), "lat": (), "lon": (), "height": (), "velocity_ned": (3,), "C_nb": (3, 3)},
        **{"cov": (9, 9), "acceleration_b": (3,), "rate_b": (3,)},
    }
    _NOUN: ClassVar[str] = "epochs"
    _CROSS: ClassVar[str | None] = "cross"

    time: Array
    lat: Array
    lon: Array
    height: Array
    velocity_ned: Array
    C_nb: Array
    cov: Array
    gps_week: int
    acceleration_b: Array | None = None
    rate_b: Array | None = None
    cross: Array | None = None

    @property
    def rpy(self) -> Array:
        """(n, 3) roll, pitch, heading, rad: C_nb = Rz(heading) Ry(pitch) Rx(roll)."""
        from ..geodesy.rotation import rpy_from_rotation

        return rpy_from_rotation(self.C_nb)

    def at(self, time_s: ArrayLike, tolerance_s: float = 0.0) -> "Trajectory":
        """Return the trajectory at any instants, interpolated between its epochs.

        Position follows the cubic through positions and velocities of both neighbours, attitude
        turns at the constant rate between theirs, velocity and covariance are linear. What this
        leaves out grows with the square of the interval: between epochs 0.1 s apart a turn that
        speeds up by 1 rad/s^2 is 0.07 deg off in the middle. A run with `trajectory_hz = "imu"`
        holds every sample.

        Parameters
        ----------
        time_s : one instant or (k,) increasing instants, s.
        tolerance_s : by how much an instant may lie before the first epoch or behind the last, s.

        Returns
        -------
        The trajectory at these instants; without accelerations, rates and `cross`.

        Raises
        ------
        DataError : an instant is outside the trajectory, or in a gap of more than 1 s.
        """
        from .interpolation import interpolate_trajectory

        return interpolate_trajectory(
            self, np.atleast_1d(np.asarray(time_s, dtype=np.float64)), tolerance_s
        )

    def _details(self) -> list[str]:
        return [f"{1.0 / float(np.median(np.diff(self.time))):.4g} Hz"] if len(self) > 1 else []

    def _columns(self) -> dict[str, Any]:
        velocity = zip(("vn", "ve", "vd"), self.velocity_ned.T, strict=True)
        rpy = np.degrees(self.rpy)
        # -1e-15 % 360 is 360
        rpy[:, 2] = np.where((heading := rpy[:, 2] % 360.0) < 360.0, heading, 0.0)
        angles = zip(("roll_deg", "pitch_deg", "heading_deg"), rpy.T, strict=True)
        return {**self._position_columns(), **dict(velocity), **dict(angles), **self._sigmas()}

    def _sigmas(self) -> dict[str, Any]:
        """Return standard deviations; a heading has none at the zenith, by its Jacobian."""
        from ..geodesy.rotation import rpy_jacobian

        sigma = np.sqrt(np.diagonal(self.cov, axis1=1, axis2=2)[:, :6])
        from_rotation = np.linalg.inv(rpy_jacobian(self.rpy))
        angles = np.degrees(
            np.sqrt(np.einsum("nij,njk,nik->ni", from_rotation, self.cov[:, 6:, 6:], from_rotation))
        )
        linear = zip(
            ("sd_n_m", "sd_e_m", "sd_d_m", "sd_vn", "sd_ve", "sd_vd"), sigma.T, strict=True
        )
        angular = zip(("sd_roll_deg", "sd_pitch_deg", "sd_heading_deg"), angles.T, strict=True)
        return {**dict(linear), **dict(angular)}

    @classmethod
    def joined(cls, segments: "Sequence[Trajectory]") -> "Trajectory":
        """Return the segments as one; errors of different segments are independent.

        Parameters
        ----------
        segments : trajectories in the order of time.

        Returns
        -------
        The whole.
        """
        if len(segments) == 1:
            return segments[0]
        filled = [segment for segment in segments if len(segment)] or segments[:1]
        rows = {}
        for name in cls._ROWS:
            pieces = [getattr(segment, name) for segment in filled]
            if not any(piece is None for piece in pieces):
                rows[name] = np.concatenate(pieces)
        crosses = [segment.cross for segment in filled if segment.cross is not None]
        if len(crosses) == len(filled):
            between = [x for cross in crosses for x in (cross, np.zeros((1, 9, 9)))]
            rows["cross"] = np.concatenate(between[:-1])
        return cls(gps_week=segments[0].gps_week, **rows)


@dataclass(frozen=True, eq=False, repr=False)
class ExteriorOrientation(Rows):
    """Projection centre and attitude of every image in the tangent plane.

    It is the master from which every export is derived. ``eo["8001.tif"]`` is a record of that one
    image, and ``eo[["8001.tif", "8002.tif"]]`` one of two.

    Parameters
    ----------
    images : n names.
    time : (n,) mid-exposure, s, GPST of `gps_week`.
    gps_week : GPS week of `time`.
    origin : (3,) latitude rad, longitude rad, ellipsoidal height m of the tangent plane's origin.
    position_m : (n, 3) projection centre, east, north, up of the tangent plane, m.
    C_mc : (n, 3, 3) camera (x image right, y image down, z viewing direction) to the tangent plane.
    cov : (n, 6, 6) covariance of position (m) and attitude psi (rad), both in tangent-plane axes;
        C_mc(true) = exp([psi x]) C_mc.
    cross : (max(n - 1, 0), 6, 6) covariance of the errors of image k with those of image k + 1;
        None where it is not known, as after a choice that leaves images out.
    boresight, camera_from_body : (3, 3) matrices B and T of the mounting that were applied.
    history : what was done to get it, sentence by sentence.
    datum, epoch : geographic CRS of the positions and their decimal year; None: WGS 84.
    velocity_mps : (n, 3) of the projection centre, tangent-plane axes, m/s; None where not known.
    rate_radps : (n, 3) angular rate of the camera with respect to the Earth, tangent-plane axes,
        rad/s: C_mc(t + dt) = exp([rate dt x]) C_mc(t); None where it is not known.
    rig : cameras of the images where there are several; `boresight` and `camera_from_body` are
        those of the first then. None: one camera took all images.

    Raises
    ------
    InputError : a shape is wrong or a value is not finite.
    """

    _ROWS: ClassVar[RowShapes] = {
        **{"images": None, "time": (), "position_m": (3,), "C_mc": (3, 3), "cov": (6, 6)},
        **{"velocity_mps": (3,), "rate_radps": (3,)},
    }
    _NOUN: ClassVar[str] = "images"
    _NAMES: ClassVar[str | None] = "images"
    _CROSS: ClassVar[str | None] = "cross"

    images: tuple[str, ...]
    time: Array
    gps_week: int
    origin: Array
    position_m: Array
    C_mc: Array
    cov: Array
    cross: Array | None
    boresight: Array
    camera_from_body: Array
    history: tuple[str, ...] = field(default_factory=tuple)
    datum: str | None = None
    epoch: float | None = None
    velocity_mps: Array | None = None
    rate_radps: Array | None = None
    rig: RigImages | None = None

    def __post_init__(self) -> None:
        n = self._freeze_rows()
        freeze(self, {"origin": (3,), "boresight": (3, 3), "camera_from_body": (3, 3)})
        if self.rig is not None and self.rig.number.size != n:
            raise InputError(f"ExteriorOrientation.rig: {self.rig.number.size} of {n} images")

    def of_camera(self, name: str) -> "ExteriorOrientation":
        """Return the images of one camera of a rig, as if it had flown alone.

        Parameters
        ----------
        name : of the camera, one of ``eo.rig.names``.

        Returns
        -------
        The images in the order of time, with the cross-covariances of neighbours of that camera and
        its bore-sight.

        Raises
        ------
        InputError : there is no such camera, or the images are all of one camera.

        Examples
        --------
        >>> left = result.eo.of_camera("left")  # doctest: +SKIP
        """
        if self.rig is None:
            raise InputError(f"camera {name!r}: the images are all of one camera; leave it out")
        number = self.rig.index(name)
        camera = self.rig.cameras[number]
        return replace(
            self[self.rig.number == number],
            boresight=camera.boresight,
            camera_from_body=camera.camera_from_body,
            rig=None,
        )

    @property
    def C_cb(self) -> Array:
        """(3, 3), or (n, 3, 3) of a rig: body to camera, T B."""
        return self.camera_from_body @ self.boresight if self.rig is None else self.rig.C_cb

    def _taken(self, rows: Chosen) -> "ExteriorOrientation":
        """The rows; of a rig with what neighbours in time or of a camera err in common."""
        if self.rig is None:
            return super()._taken(rows)
        if isinstance(rows, slice):
            rows = np.arange(*rows.indices(len(self)), dtype=np.int64)
        plain = Rows._taken(replace(self, rig=None), rows)
        cross = self.rig.neighbour_cross(rows, self.cross)
        return replace(plain, cross=cross, rig=self.rig.taken(rows))

    @property
    def opk(self) -> Array:
        """Angles omega, phi, kappa, (n, 3) rad.

        Rx Ry Rz takes the camera (right, up, back) to the tangent plane.
        """
        from ..geodesy.rotation import CV_RUB, opk_from_rotation

        return opk_from_rotation(self.C_mc @ CV_RUB)

    def _details(self) -> list[str]:
        lat, lon = np.degrees(self.origin[:2])
        return [f"tangent plane {lat:.4g} {lon:.4g}"]

    def _columns(self) -> dict[str, Any]:
        from ..geodesy.rotation import opk_jacobian

        sigma = np.sqrt(np.maximum(np.diagonal(self.cov, axis1=1, axis2=2)[:, :3], 0.0))
        F = np.linalg.inv(opk_jacobian(self.opk))
        angles = np.sqrt(np.maximum(np.einsum("nij,njk,nik->ni", F, self.cov[:, 3:, 3:], F), 0.0))
        columns: dict[str, Any] = {"image": list(self.images), "tow": self.time}
        columns |= {} if self.rig is None else {"camera": self.rig.of_images}
        blocks = {"{}_m": ("enu", self.position_m), "sd_{}_m": ("enu", sigma)}
        named = ("omega", "phi", "kappa")
        degrees = {
            "{}_deg": (named, np.degrees(self.opk)),
            "sd_{}_deg": (named, np.degrees(angles)),
        }
        for form, (names, block) in (blocks | degrees).items():
            columns |= {form.format(name): block[:, k] for k, name in enumerate(names)}
        return columns


@dataclass(frozen=True, eq=False)
class Diagnostics:
    """How a run went, for the report, at m epochs of the flight.

    Axes are north, east, down of the flight's local frame; the nine navigation states are position
    (m), velocity (m/s) and psi (rad).

    Parameters
    ----------
    time : ndarray
        (m,) s, GPST.
    position : ndarray
        (m, 3) position, m.
    velocity : ndarray
        (m, 3) velocity, m/s.
    rpy : ndarray
        (m, 3) roll, pitch, heading, rad.
    event : ndarray
        (e,) rows of `time` that are exposures.
    filter_sigma, smoothed_sigma : ndarray
        (m, 9) standard deviations of the navigation states, of the filter and of the smoother.
    bias, bias_sigma : ndarray
        (m, 6) biases and their standard deviations: gyro x y z rad/s, accelerometer x y z m/s^2,
        body axes.
    fix_time : ndarray
        (k,) times of the k position fixes, s.
    innovation, innovation_sigma : ndarray
        (k, 3) innovations of the position fixes and their standard deviations, m.
    nis : ndarray
        (k,) normalised innovation squared of the position fixes, with 3 degrees of freedom.
    nis_limit : float
        The value of it beyond which a fix is rejected.
    used : ndarray
        (k,) bool, whether the position fix was used.
    separation_time : ndarray
        (s,) epochs of the forward/backward separation, s.
    separation, separation_sigma : ndarray
        (s, 9) backward minus forward of the navigation states and its standard deviation; NaN where
        the later data do not determine it.
    gaps : tuple of tuple of float
        Time and length, s, of each bridged IMU gap.
    passes : int
        Number of filter passes.
    covariance_resets : ndarray, optional
        Times of covariance resets after a second of rejected fixes, s.
    velocity_nis : ndarray, optional
        Normalised innovation squared of the velocity fixes; None without such.
    velocity_used : ndarray, optional
        Whether each velocity fix was used; None without such.
    barometer_nis : ndarray, optional
        Normalised innovation squared of a barometer's heights, with 1 degree of freedom; None
        without such.
    barometer_used : ndarray, optional
        Whether each of its heights was used; None without such.
    checks : tuple of Finding
        All checks of the run.
    stationary : ndarray, optional
        (k, 2) first and last instant of each stationary period, s.
    states : tuple of Estimate
        Constants estimated besides biases.
    segments : tuple of tuple of float
        First and last instant, s, of each segment that was solved by itself.
    time_correlated : tuple of TimeCorrelatedError
        Time-correlated (Gauss-Markov) GNSS errors that were estimated.
    residuals : tuple of MeanResidual
        Fixes minus smoothed solution, minute by minute.
    withheld : ndarray, optional
        (k,) bool, whether the position fix was withheld as one of a spell of incorrect ones; those
        are not used. None: none was.
    constants : ConstantSeries, optional
        Constants estimated besides biases, at `time`; None where there was none.
    """

    time: Array
    position: Array
    velocity: Array
    rpy: Array
    event: NDArray[np.int64]
    filter_sigma: Array
    smoothed_sigma: Array
    bias: Array
    bias_sigma: Array
    fix_time: Array
    innovation: Array
    innovation_sigma: Array
    nis: Array
    nis_limit: float
    used: NDArray[np.bool_]
    separation_time: Array
    separation: Array
    separation_sigma: Array
    gaps: tuple[tuple[float, float], ...] = ()
    passes: int = 1
    covariance_resets: Array | None = None
    velocity_nis: Array | None = None
    velocity_used: NDArray[np.bool_] | None = None
    barometer_nis: Array | None = None
    barometer_used: NDArray[np.bool_] | None = None
    checks: tuple[Finding, ...] = ()
    stationary: Array | None = None
    states: tuple[Estimate, ...] = ()
    segments: tuple[tuple[float, float], ...] = ()
    time_correlated: tuple[TimeCorrelatedError, ...] = ()
    residuals: tuple[MeanResidual, ...] = ()
    withheld: NDArray[np.bool_] | None = None
    constants: ConstantSeries | None = None

    @property
    def biases(self) -> ImuBiases:
        """Biases of the IMU at `time`, a few thousand epochs at most."""
        b, s = self.bias, self.bias_sigma
        return ImuBiases(self.time, b[:, :3], b[:, 3:], s[:, :3], s[:, 3:])

    @property
    def innovations(self) -> Innovations:
        """Innovations of the position fixes, all of them."""
        return Innovations(
            self.fix_time, self.innovation, self.innovation_sigma, self.nis, self.used
        )

    @classmethod
    def joined(cls, segments: "Sequence[Diagnostics]") -> "Diagnostics":
        """Return the diagnostics of several segments as one.

        Constants are those of the longest segment.

        Parameters
        ----------
        segments : sequence of Diagnostics
            Those of the segments, in the order of time.

        Returns
        -------
        Diagnostics
            The whole.
        """
        if len(segments) == 1:
            return segments[0]
        longest = max(segments, key=lambda segment: segment.time.size)
        values: dict[str, Any] = {}
        for f in fields(cls):
            pieces = [getattr(segment, f.name) for segment in segments]
            if f.name in ("gaps", "checks", "segments", "residuals"):
                values[f.name] = tuple(dict.fromkeys(item for items in pieces for item in items))
            elif any(isinstance(x, np.ndarray) for x in pieces):
                values[f.name] = np.concatenate([x for x in pieces if x is not None])
            else:
                values[f.name] = getattr(longest, f.name)
        offset = np.cumsum([0, *(segment.time.size for segment in segments[:-1])])
        values["event"] = np.concatenate(
            [segment.event + first for segment, first in zip(segments, offset, strict=True)]
        )
        values["passes"] = max(segment.passes for segment in segments)
        values["constants"] = ConstantSeries.joined(
            [segment.constants for segment in segments], [segment.time.size for segment in segments]
        )
        return cls(**values)
