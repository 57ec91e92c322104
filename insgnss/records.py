"""The frozen tables that rooms hand to each other, checked once, at birth.

A record holds contiguous float64 arrays that nobody writes to again. Its construction refuses wrong shapes, values that
are not finite and time that does not increase, naming the record, the field, the row and the time. Readers turn such a
refusal into a message with file and line by checking before they build (`formats`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from .errors import InputError

Array = NDArray[np.float64]
Quantity = Literal["mean_rate", "increments", "instant_rate"]

QUANTITIES = ("mean_rate", "increments", "instant_rate")


def _frozen(record: Any, name: str, shape: tuple[int | None, ...]) -> Array:
    """Replace field `name` by a read-only contiguous float64 array after checking shape (None: any) and finiteness."""
    a = np.ascontiguousarray(getattr(record, name), dtype=np.float64)
    kind = type(record).__name__
    if a.ndim != len(shape) or any(want is not None and want != got for want, got in zip(shape, a.shape, strict=True)):
        raise InputError(f"{kind}.{name}: shape {a.shape}, expected {tuple('n' if s is None else s for s in shape)}")
    if not np.isfinite(a).all():
        row = int(np.argwhere(~np.isfinite(a))[0][0])
        raise InputError(f"{kind}.{name}: value in row {row} is not finite")
    if a.flags.writeable:
        a = a.view()
        a.flags.writeable = False
    object.__setattr__(record, name, a)
    return a


def _increasing(record: Any, time: Array) -> None:
    step = np.diff(time)
    if (step <= 0).any():
        row = int(np.argmax(step <= 0)) + 1
        raise InputError(f"{type(record).__name__}.time: {time[row]:.6f} s in row {row} follows {time[row - 1]:.6f} s; time must increase")


Verdict = Literal["ok", "note", "contradiction"]


@dataclass(frozen=True)
class Check:
    """One plausibility check: what was looked at, what was found, what was expected, and what to do about it."""

    name: str
    found: str
    expected: str
    verdict: Verdict = "ok"
    advice: str = ""


@dataclass(frozen=True, eq=False)
class ImuSamples:
    """IMU recording in the sensor's own axes or in the body's.

    time : (n,) s, GPST of `gps_week`; the stamp is the end of the sample's interval (mean rate, increments) or the instant.
    gyro : (n, 3) rad/s, or rad for increments.   accel : (n, 3) m/s^2 specific force, or m/s for increments.
    notes : what the reader found odd and did about it (rows left out or put in order, with counts).
    """

    time: Array
    gyro: Array
    accel: Array
    quantity: Quantity = "mean_rate"
    gps_week: int | None = None
    source: str = ""
    notes: tuple[Check, ...] = ()

    def __post_init__(self) -> None:
        n = _frozen(self, "time", (None,)).size
        _frozen(self, "gyro", (n, 3))
        _frozen(self, "accel", (n, 3))
        if n < 2:
            raise InputError(f"{self.source or 'ImuSamples'}: {n} samples; at least 2 are needed")
        if self.quantity not in QUANTITIES:
            raise InputError(f"ImuSamples.quantity: {self.quantity!r} is none of {', '.join(QUANTITIES)}")
        _increasing(self, self.time)


@dataclass(frozen=True, eq=False)
class Increments:
    """Body increments between consecutive marks and samples: what the filter integrates.

    dt (s,) s; dtheta (s, 3) rad; dvel (s, 3) m/s, body axes (`prepare.increments` says what they contain).
    marks (m,) s, GPST; stop (m,) number of segments before each mark; rate (m, 3) rad/s, gyro rate at each mark.
    nominal_s : sample interval.   gaps : (time, length) of every gap that was bridged.
    bridged : (m, 6) variance of the increments (rad^2, m^2/s^2) since the mark before where a gap was bridged, else 0; None without gaps.
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
        n = _frozen(self, "dt", (None,)).size
        _frozen(self, "dtheta", (n, 3))
        _frozen(self, "dvel", (n, 3))
        m = _frozen(self, "marks", (None,)).size
        _frozen(self, "rate", (m, 3))
        if self.bridged is not None:
            _frozen(self, "bridged", (m, 6))
        _increasing(self, self.marks)


@dataclass(frozen=True, eq=False)
class GnssFixes:
    """Positions (and velocities) of the antenna phase centre.

    time : (n,) s, GPST.   lat, lon : (n,) rad; height : (n,) m above the ellipsoid.
    cov_ned : (n, 3, 3) m^2 in north, east, down at the fix.
    velocity_ned : (n, 3) m/s and velocity_cov_ned : (n, 3, 3) m^2/s^2, or None.
    quality : (n,) of RTKLIB's codes (1 fixed, 2 float, 3 SBAS, 4 DGPS, 5 single, 6 PPP; 0 unknown), or None.
    notes : what the reader found odd and did about it.
    """

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
    notes: tuple[Check, ...] = ()

    def __post_init__(self) -> None:
        n = _frozen(self, "time", (None,)).size
        for name in ("lat", "lon", "height"):
            _frozen(self, name, (n,))
        _frozen(self, "cov_ned", (n, 3, 3))
        if self.velocity_ned is not None:
            _frozen(self, "velocity_ned", (n, 3))
            _frozen(self, "velocity_cov_ned", (n, 3, 3))
        if n < 1:
            raise InputError(f"{self.source or 'GnssFixes'}: no fix")
        _increasing(self, self.time)


@dataclass(frozen=True, eq=False)
class CameraEvents:
    """Mid-exposure instants. images : n names as the bundle adjustment knows them; time : (n,) s, GPST. notes : of the reader."""

    images: tuple[str, ...]
    time: Array
    gps_week: int | None = None
    source: str = ""
    notes: tuple[Check, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "images", tuple(self.images))
        _frozen(self, "time", (len(self.images),))
        _increasing(self, self.time)
        if len(set(self.images)) != len(self.images):
            twice = next(name for i, name in enumerate(self.images) if name in self.images[:i])
            raise InputError(f"{self.source or 'CameraEvents'}: image {twice} occurs twice")


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Position, velocity and attitude of the IMU's navigation centre, with covariance.

    time : (n,) s, GPST.   lat, lon : (n,) rad; height : (n,) m above the ellipsoid.
    velocity_ned : (n, 3) m/s.   C_nb : (n, 3, 3), body FRD to NED at the point.
    cov : (n, 9, 9) of position (m), velocity (m/s), attitude psi (rad), all in NED axes at the point.
    acceleration_b, rate_b : (n, 3) m/s^2 and rad/s of the body against the Earth, in body axes, or None.
    cross : (n - 1, 9, 9), covariance of the errors of row k with those of row k + 1, each in its own axes, or None.
    """

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

    def __post_init__(self) -> None:
        n = _frozen(self, "time", (None,)).size
        for name in ("lat", "lon", "height"):
            _frozen(self, name, (n,))
        _frozen(self, "velocity_ned", (n, 3))
        _frozen(self, "C_nb", (n, 3, 3))
        _frozen(self, "cov", (n, 9, 9))
        if self.cross is not None:
            _frozen(self, "cross", (max(n - 1, 0), 9, 9))
        for name in ("acceleration_b", "rate_b"):
            if getattr(self, name) is not None:
                _frozen(self, name, (n, 3))
        _increasing(self, self.time)

    @classmethod
    def joined(cls, parts: "Sequence[Trajectory]") -> "Trajectory":
        """The parts, in the order of time, as one; errors of different parts are independent."""
        if len(parts) == 1:
            return parts[0]
        rows = {
            name: np.concatenate([getattr(part, name) for part in parts])
            for name in ("time", "lat", "lon", "height", "velocity_ned", "C_nb", "cov")
        }
        for name in ("acceleration_b", "rate_b"):
            given = [x for part in parts if part.time.size and (x := getattr(part, name)) is not None]
            if len(given) == sum(part.time.size > 0 for part in parts):
                rows[name] = np.concatenate(given)
        cross = None
        known = [part.cross for part in parts if part.time.size and part.cross is not None]
        if len(known) == sum(part.time.size > 0 for part in parts):
            between = [x for own in known for x in (own, np.zeros((1, 9, 9)))]
            cross = np.concatenate(between[:-1]) if between else np.zeros((0, 9, 9))
        return cls(gps_week=parts[0].gps_week, cross=cross, **rows)


@dataclass(frozen=True, eq=False)
class ExteriorOrientation:
    """Projection centre and attitude of every image in the tangent plane: the master from which every export is derived.

    origin : (3,) latitude rad, longitude rad, ellipsoidal height m of the tangent plane's origin.
    position_m : (n, 3) m, projection centre, east north up of the tangent plane.
    C_mc : (n, 3, 3), camera (x image right, y image down, z viewing direction) to the tangent plane.
    cov : (n, 6, 6) of position error (m) and psi (rad), both in tangent-plane axes; R(true) = exp([psi x]) R.
    cross : (max(n - 1, 0), 6, 6), covariance of the errors of image k with those of image k + 1.
    boresight, camera_from_body : (3, 3) that were applied.
    history : what was done to get it, sentence by sentence.
    """

    images: tuple[str, ...]
    time: Array
    gps_week: int
    origin: Array
    position_m: Array
    C_mc: Array
    cov: Array
    cross: Array
    boresight: Array
    camera_from_body: Array
    history: tuple[str, ...] = field(default_factory=tuple)

    def __post_init__(self) -> None:
        object.__setattr__(self, "images", tuple(self.images))
        n = len(self.images)
        _frozen(self, "time", (n,))
        _frozen(self, "origin", (3,))
        _frozen(self, "position_m", (n, 3))
        _frozen(self, "C_mc", (n, 3, 3))
        _frozen(self, "cov", (n, 6, 6))
        _frozen(self, "cross", (max(n - 1, 0), 6, 6))
        _frozen(self, "boresight", (3, 3))
        _frozen(self, "camera_from_body", (3, 3))


@dataclass(frozen=True)
class StateVerdict:
    """A constant that the flight estimates besides biases: value, sigma and a-priori sigma in SI.

    moves_m : how far its sigma moves the fixes, None for an error of the IMU.   observed : whether the flight determines it.
    """

    name: str
    value: float
    sigma: float
    prior: float
    moves_m: float | None
    observed: bool


@dataclass(frozen=True)
class LastingError:
    """A correlated error of the fixes that was estimated: (3,) are north, east, down.

    time_s : how long it lasts.   fixes : how many fixes have it.   sigma_m : its sigma at the median fix.
    share, white : itself and the uncorrelated error of these fixes in standard deviations of the file.
    """

    time_s: float
    fixes: int
    sigma_m: tuple[float, ...]
    share: tuple[float, ...]
    white: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Diagnostics:
    """How a run went, for the report. Axes north, east, down of the flight's local frame; states position, velocity, psi.

    time (m,) s; position (m, 3) m; velocity (m, 3) m/s; rpy (m, 3) rad; event (e,) rows of `time` that are exposures.
    filter_sigma, smoothed_sigma (m, 9).   bias, bias_sigma (m, 6): gyro x y z rad/s, accelerometer x y z m/s^2, body axes.
    fix_time (k,); innovation, innovation_sigma (k, 3) m; nis (k,) normalised innovation squared (3 degrees of freedom),
    nis_limit; used (k,) bool; the same of velocities or None.
    separation_time (s,); separation, separation_sigma (s, 9): backward minus forward, NaN where not determined.
    gaps : (time, length) of bridged IMU gaps.   passes : filter passes.
    reopened : times at which the filter opened its covariance after a second of rejected fixes.
    rests : (k, 2) s, times in which the vehicle was taken to stand still.   states : constants estimated besides biases.
    stretches : first and last instant, s, of each part that was solved by itself.   lasting : correlated errors of the fixes.
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
    reopened: Array | None = None
    velocity_nis: Array | None = None
    velocity_used: NDArray[np.bool_] | None = None
    checks: tuple[Check, ...] = ()
    rests: Array | None = None
    states: tuple[StateVerdict, ...] = ()
    stretches: tuple[tuple[float, float], ...] = ()
    lasting: tuple[LastingError, ...] = ()

    @classmethod
    def joined(cls, parts: "Sequence[Diagnostics]") -> "Diagnostics":
        """The parts, in the order of time, as one; constants are those of the longest part."""
        if len(parts) == 1:
            return parts[0]
        longest = max(parts, key=lambda part: part.time.size)
        values: dict[str, Any] = {}
        for f in fields(cls):
            given = [getattr(part, f.name) for part in parts]
            if f.name in ("gaps", "checks", "stretches"):
                values[f.name] = tuple(dict.fromkeys(item for items in given for item in items))
            elif any(isinstance(x, np.ndarray) for x in given):
                values[f.name] = np.concatenate([x for x in given if x is not None])
            else:
                values[f.name] = getattr(longest, f.name)
        offset = np.cumsum([0, *(part.time.size for part in parts[:-1])])
        values["event"] = np.concatenate([part.event + at for part, at in zip(parts, offset, strict=True)])
        values["passes"] = max(part.passes for part in parts)
        return cls(**values)
