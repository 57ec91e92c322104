"""What was recorded: samples of the IMU and their increments, fixes, exposures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.errors import InputError
from ..geodesy.gpstime import WEEK_S
from ._checked import Array, float_array, freeze, freeze_field, increasing
from .rows import Rows, RowShapes
from .verdicts import Finding

Quantity = Literal["mean_rate", "increments", "instant_rate"]

QUANTITIES = ("mean_rate", "increments", "instant_rate")
# what describes the solution of a fix and weighs nothing; fields of `GnssFixes` by name
OF_THE_SOLUTION = ("satellites", "ratio", "age_s", "pdop", "hdop")
FINEST_DEG = 1e-7  # step of an angle (deg): a centimetre on the ground
# m/s, standard deviation of a component of velocity that was not measured: far beyond any drone
UNKNOWN_MPS = 1000.0


@dataclass(frozen=True, eq=False, repr=False)
class ImuSamples(Rows):
    """Samples of an inertial measurement unit in the sensor's own axes or in the body's.

    Parameters
    ----------
    time : (n,) s, GPST of `gps_week`, increasing: rows must be in order (`read_imu` puts those of a
        file in order). The stamp is the end of the sample's interval (mean rate, increments) or the
        instant (instant rate).
    gyro : (n, 3) angular rate with respect to inertial space, rad/s; rad for increments.
    accel : (n, 3) specific force, m/s^2; m/s for increments.
    quantity : what a sample is, "mean_rate", "increments" or "instant_rate".
    gps_week : GPS week of `time`, None where it is not known.
    source : where the samples come from, for messages; the path of a file.
    notes : what the reader found odd and did about it (rows left out or put in order, with counts).
    units : units that the numbers of the file were taken to be in, of "gyro" and "accel"; empty
        where the file's format fixes them.
    temperature : (n,) of the sensor, deg C or of any other thermometer that is linear in it, or
        None.

    Raises
    ------
    InputError : a shape is wrong, a value is not finite, time does not increase, or there are fewer
        than two samples; the field, the row and the time are named.

    Examples
    --------
    >>> import numpy as np, insgnss
    >>> time = np.arange(500) / 100.0
    >>> imu = insgnss.ImuSamples(time, np.zeros((500, 3)), np.tile([0.0, 0.0, -9.81], (500, 1)))
    >>> imu
    <ImuSamples 500 samples, TOW 0.0 to 5.0 s, 100 Hz, mean_rate>
    >>> imu.between(1.0, 2.0)
    <ImuSamples 101 samples, TOW 1.0 to 2.0 s, 100 Hz, mean_rate>
    """

    _ROWS: ClassVar[RowShapes] = {"time": (), "gyro": (3,), "accel": (3,), "temperature": ()}
    _NOUN: ClassVar[str] = "samples"

    time: Array
    gyro: Array
    accel: Array
    quantity: Quantity = "mean_rate"
    gps_week: int | None = None
    source: str = ""
    notes: tuple[Finding, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)
    temperature: Array | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if (n := len(self)) < 2:
            raise InputError(f"{self.source or 'ImuSamples'}: {n} samples; at least 2 are needed")
        if self.quantity not in QUANTITIES:
            raise InputError(
                f"ImuSamples.quantity: {self.quantity!r} is none of {', '.join(QUANTITIES)}"
            )

    @classmethod
    def from_array(
        cls,
        table: ArrayLike,
        quantity: Quantity = "mean_rate",
        gps_week: int | None = None,
        source: str = "ImuSamples",
    ) -> "ImuSamples":
        """Return the samples of a table.

        Parameters
        ----------
        table : (n, 7) time s; gyro x y z rad/s; accelerometer x y z m/s^2 (rad, m/s of increments).
        quantity, gps_week, source : as in `ImuSamples`.

        Returns
        -------
        The samples.

        Raises
        ------
        InputError : the table has another shape, or what `ImuSamples` refuses.
        """
        values = _table(source, table, (7,), "time, gyro x y z, accelerometer x y z")
        return cls(values[:, 0], values[:, 1:4], values[:, 4:7], quantity, gps_week, source)

    def _details(self) -> list[str]:
        return [_rate(self.time), self.quantity]

    def _columns(self) -> dict[str, Any]:
        triads = zip(
            ("gx", "gy", "gz", "ax", "ay", "az"), (*self.gyro.T, *self.accel.T), strict=True
        )
        columns = {"tow": self.time, **dict(triads)}
        return columns if self.temperature is None else columns | {"temperature": self.temperature}


@dataclass(frozen=True, eq=False)
class Increments:
    """Body increments between consecutive marks and samples: what the filter integrates.

    `navigation.prepare.increments` says what they contain.

    Parameters
    ----------
    dt : ndarray
        (s,) lengths of the integration intervals, s.
    dtheta : ndarray
        (s, 3) angle increments, body axes, rad.
    dvel : ndarray
        (s, 3) velocity increments, body axes, m/s.
    marks : ndarray
        (m,) instants of the epochs of the filter, s, GPST, increasing.
    stop : ndarray
        (m,) number of integration intervals before each mark.
    rate : ndarray
        (m, 3) gyro rate at each mark, body axes, rad/s.
    nominal_s : float
        Sample interval, s.
    gaps : tuple of tuple of float
        Time and length, s, of every gap that was bridged.
    bridged : ndarray, optional
        (m, 6) variance of the increments (rad^2, m^2/s^2) since the mark before where a gap was
        bridged, else 0; None without gaps.

    Raises
    ------
    InputError
        Where a shape is wrong, a value is not finite, or the marks do not increase.
    """

    dt: Array
    dtheta: Array
    dvel: Array
    marks: Array
    stop: NDArray[np.int64]
    rate: Array
    nominal_s: float
    gaps: tuple[tuple[float, float], ...] = ()
    bridged: Array | None = None

    def __post_init__(self) -> None:
        n = freeze_field(self, "dt", (None,)).size
        m = freeze_field(self, "marks", (None,)).size
        freeze(self, {"dtheta": (n, 3), "dvel": (n, 3), "rate": (m, 3), "bridged": (m, 6)})
        increasing(self, self.marks)


@dataclass(frozen=True, eq=False, repr=False)
class GnssFixes(Rows):
    """Positions, and velocities where there are some, of the antenna's phase centre.

    `GnssFixes.from_degrees` makes them of degrees and standard deviations.

    Parameters
    ----------
    time : (n,) s, GPST of `gps_week`, increasing.
    lat, lon : (n,) geodetic latitude and longitude, rad, WGS84.
    height : (n,) m above the ellipsoid.
    cov_ned : (n, 3, 3) covariance of the position, m^2, in north, east, down at the fix.
    velocity_ned : (n, 3) m/s, or None.
    velocity_cov_ned : (n, 3, 3) covariance of the velocity, m^2/s^2, or None without velocity.
    quality : (n,) RTKLIB's codes (1 fixed, 2 float, 3 SBAS, 4 DGPS, 5 single, 6 PPP; 0 unknown), or
        None.
    gps_week : GPS week of `time`, None where it is not known.
    source : where the fixes come from, for messages; the path of a file.
    notes : what the reader found odd and did about it.
    satellites : (n,) number of satellites used; this and what follows describes the solution and
        weighs nothing. Each is None where the source has none, not-a-number where it is not known.
    ratio : (n,) ratio of the ambiguity validation: the second best's sum of squares to the best's.
    age_s : (n,) age of the base's observations or of the corrections, s.
    pdop, hdop : (n,) dilution of precision of the position, of its horizontal part.
    base_ecef : (3,) m, position of the base that an engine solved them against; None: not stated.
    sigma_assumed : (n,) bool, fixes whose source states no covariance, so that `cov_ned` is what
        the reader was told to assume; None: none.
    source_format : format of the source by its reader's name ("rtklib_pos", "ulog", ...), which
        tells how well its sigmas hold (`navigation.prepare.fix_covariance.numbers`); "": unknown.

    Raises
    ------
    InputError : a shape is wrong, a value is not finite, time does not increase, or there is no
        fix; the field, the row and the time are named.
    """

    _ROWS: ClassVar[RowShapes] = {
        **{"time": (), "lat": (), "lon": (), "height": (), "cov_ned": (3, 3)},
        **dict.fromkeys(("velocity_ned", "velocity_cov_ned", "quality", *OF_THE_SOLUTION)),
        "sigma_assumed": None,
    }
    _NOUN: ClassVar[str] = "fixes"

    time: Array
    lat: Array
    lon: Array
    height: Array
    cov_ned: Array
    velocity_ned: Array | None = None
    velocity_cov_ned: Array | None = None
    quality: NDArray[np.int64] | None = None
    gps_week: int | None = None
    source: str = ""
    notes: tuple[Finding, ...] = ()
    satellites: Array | None = None
    ratio: Array | None = None
    age_s: Array | None = None
    pdop: Array | None = None
    hdop: Array | None = None
    base_ecef: Array | None = None
    sigma_assumed: NDArray[np.bool_] | None = None
    source_format: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        n = len(self)
        if self.velocity_ned is not None:
            freeze_field(self, "velocity_ned", (n, 3))
            freeze_field(self, "velocity_cov_ned", (n, 3, 3))
        for name in OF_THE_SOLUTION:
            if getattr(self, name) is not None:
                freeze_field(self, name, (n,), finite=False)
        freeze(self, {"base_ecef": (3,)})
        if n < 1:
            raise InputError(f"{self.source or 'GnssFixes'}: no fix; give one at least")

    @classmethod
    def from_degrees(
        cls,
        time: ArrayLike,
        lat_deg: ArrayLike,
        lon_deg: ArrayLike,
        height_m: ArrayLike,
        *,
        sigma_m: ArrayLike,
        velocity_ned_mps: ArrayLike | None = None,
        sigma_velocity_mps: ArrayLike | None = None,
        quality: ArrayLike | None = None,
        gps_week: int | None = None,
        source: str = "GnssFixes",
    ) -> "GnssFixes":
        """Return the fixes of latitudes and longitudes in degrees and of standard deviations.

        Parameters
        ----------
        time : (n,) s, GPST of `gps_week`, increasing.
        lat_deg, lon_deg : (n,) geodetic latitude and longitude, deg, WGS84.
        height_m : (n,) m above the ellipsoid.
        sigma_m : (3,) or (n, 3) standard deviations north, east, down, m.
        velocity_ned_mps : (n, 3) north, east, down, m/s, or None.
        sigma_velocity_mps : (3,) or (n, 3) standard deviations north, east, down, m/s; needed with
            a velocity.
        quality : (n,) RTKLIB's codes, or None.
        gps_week, source : as in `GnssFixes`.

        Returns
        -------
        The fixes; errors of different axes are taken as independent.

        Raises
        ------
        InputError : an angle is beyond its range, a standard deviation is missing or not positive,
            or what `GnssFixes` refuses.

        Examples
        --------
        >>> import insgnss
        >>> fixes = insgnss.GnssFixes.from_degrees(
        ...     [10.0, 11.0], [46.57, 46.5701], [6.54, 6.54], [512.0, 512.1],
        ...     sigma_m=(0.02, 0.02, 0.03),
        ... )
        >>> fixes
        <GnssFixes 2 fixes, TOW 10.0 to 11.0 s, 1 Hz>
        """
        stamps = float_array(source, time)
        lat, lon = (float_array(source, x, FINEST_DEG) for x in (lat_deg, lon_deg))
        for name, angle, limit in (("lat_deg", lat, 90.0), ("lon_deg", lon, 360.0)):
            if (beyond := np.abs(angle) > limit).any():
                row = int(np.argmax(beyond))
                raise InputError(
                    f"{source}: {name} {angle[row]:.6f} in row {row} is beyond {limit:.0f} deg; are"
                    " latitude and longitude swapped?"
                )
        velocity_cov = None
        if velocity_ned_mps is not None:
            velocity_cov = _diagonal(source, "sigma_velocity_mps", sigma_velocity_mps, stamps.size)
        return cls(
            time=stamps,
            lat=np.radians(lat),
            lon=np.radians(lon),
            height=np.asarray(height_m, dtype=np.float64),
            cov_ned=_diagonal(source, "sigma_m", sigma_m, stamps.size),
            velocity_ned=(
                None if velocity_ned_mps is None else np.asarray(velocity_ned_mps, dtype=np.float64)
            ),
            velocity_cov_ned=velocity_cov,
            quality=None if quality is None else np.asarray(quality, dtype=np.int64),
            gps_week=gps_week,
            source=source,
        )

    def _details(self) -> list[str]:
        velocity = [] if self.velocity_ned is None else ["with velocity"]
        return [_rate(self.time), *velocity]

    def _columns(self) -> dict[str, Any]:
        sigma = np.sqrt(np.diagonal(self.cov_ned, axis1=1, axis2=2))
        columns = self._position_columns()
        columns |= dict(zip(("sd_n_m", "sd_e_m", "sd_d_m"), sigma.T, strict=True))
        if self.velocity_ned is not None and self.velocity_cov_ned is not None:
            columns |= dict(zip(("vn", "ve", "vd"), self.velocity_ned.T, strict=True))
            sigma = np.sqrt(np.diagonal(self.velocity_cov_ned, axis1=1, axis2=2))
            columns |= dict(zip(("sd_vn", "sd_ve", "sd_vd"), sigma.T, strict=True))
        described = {name: getattr(self, name) for name in ("quality", *OF_THE_SOLUTION)}
        return columns | {name: value for name, value in described.items() if value is not None}


@dataclass(frozen=True, eq=False, repr=False)
class CameraEvents(Rows):
    """Mid-exposure instants of the images.

    Parameters
    ----------
    images : n names, as the bundle adjustment knows them, none twice.
    time : (n,) s, GPST of `gps_week`, increasing.
    gps_week : GPS week of `time`, None where it is not known.
    source : where the events come from, for messages; the path of a file.
    notes : what the reader found odd and did about it.
    offset_ned : (n, 3) m, camera minus antenna, north, east, down, where the drone states it.
    sigma_s : (n,) standard deviation of `time`, s, where it is known to be one that matters.
    time_scale : of stamps that do not say it themselves, as the caller gave it; else empty.

    Raises
    ------
    InputError : a time is not finite or does not increase, or an image occurs twice.

    Examples
    --------
    >>> import insgnss
    >>> events = insgnss.CameraEvents(
    ...     ("a.jpg", "b.jpg", "c.jpg"), [10.0, 12.0, 14.0], gps_week=2008
    ... )
    >>> events["b.jpg"]
    <CameraEvents 1 images, TOW 12.0 to 12.0 s, week 2008>
    """

    _ROWS: ClassVar[RowShapes] = {"images": None, "time": (), "offset_ned": (3,), "sigma_s": ()}
    _NOUN: ClassVar[str] = "images"
    _NAMES: ClassVar[str | None] = "images"

    images: tuple[str, ...]
    time: Array
    gps_week: int | None = None
    source: str = ""
    notes: tuple[Finding, ...] = ()
    offset_ned: Array | None = None
    sigma_s: Array | None = None
    time_scale: str = ""

    def _columns(self) -> dict[str, Any]:
        return {"image": list(self.images), "tow": self.time}


@dataclass(frozen=True, eq=False, repr=False)
class BarometerHeights(Rows):
    """Heights of a barometer, above whatever level and on whatever scale it counts them.

    Parameters
    ----------
    time : (n,) s, GPST of `gps_week`, increasing.
    height : (n,) m, upwards.
    gps_week : GPS week of `time`, None where it is not known.
    source : where the heights come from, for messages; the path of a file.
    notes : what the reader found odd and did about it.

    Raises
    ------
    InputError : a shape is wrong, a value is not finite, time does not increase, or there is no
        height.
    """

    _ROWS: ClassVar[RowShapes] = {"time": (), "height": ()}
    _NOUN: ClassVar[str] = "heights"

    time: Array
    height: Array
    gps_week: int | None = None
    source: str = ""
    notes: tuple[Finding, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        if not len(self):
            raise InputError(f"{self.source or 'BarometerHeights'}: no height; give one at least")

    def _details(self) -> list[str]:
        return [_rate(self.time)]

    def _columns(self) -> dict[str, Any]:
        return {"tow": self.time, "h_m": self.height}


Timed = TypeVar("Timed", ImuSamples, GnssFixes, CameraEvents, BarometerHeights)


def in_week(record: Timed, week: int) -> Timed:
    """Return the record with its times in seconds of `week`.

    Parameters
    ----------
    record : ImuSamples, GnssFixes, CameraEvents or BarometerHeights
        One without a week of its own is taken to be of that week.
    week : int
        The GPS week.

    Returns
    -------
    The record of the same kind.
    """
    if record.gps_week in (None, week):
        return replace(record, gps_week=week)
    return replace(record, time=record.time + (record.gps_week - week) * WEEK_S, gps_week=week)


def _table(source: str, table: ArrayLike, widths: Sequence[int], expected: str) -> Array:
    """The table as float64; InputError where its number of columns is none of `widths`."""
    values = float_array(source, table)
    if values.ndim != 2 or values.shape[1] not in widths:
        columns = " or ".join(map(str, widths))
        raise InputError(
            f"{source}: a table of shape {values.shape}, expected (n, {columns}): {expected}"
        )
    return values


def _diagonal(source: str, name: str, sigma: ArrayLike | None, count: int) -> Array:
    """(n, 3, 3) covariances of standard deviations (3,) or (n, 3)."""
    values = float_array(source, [] if sigma is None else sigma)
    if values.shape not in ((3,), (count, 3)):
        raise InputError(
            f"{source}: {name} of shape {values.shape}; give (3,) or ({count}, 3), north east down"
        )
    if not (np.isfinite(values) & (values > 0.0)).all():
        raise InputError(
            f"{source}: {name} holds {values.min():g}; standard deviations must be positive"
        )
    return np.asarray(np.broadcast_to(values**2, (count, 3))[:, :, None] * np.eye(3))


def _rate(time: Array) -> str:
    """The rate of stamps, for people."""
    return f"{1.0 / float(np.median(np.diff(time))):.4g} Hz" if time.size > 1 else "one instant"
