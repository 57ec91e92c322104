"""What was estimated: the trajectory, the exterior orientation of the images, and how the filter
fared.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._checked import Array, frozen, increasing
from .verdicts import Check, StateVerdict, TimeCorrelatedError


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Position, velocity and attitude of the IMU's navigation centre, with covariance.

    time : (n,) s, GPST.   lat, lon : (n,) rad; height : (n,) m above the ellipsoid.
    velocity_ned : (n, 3) m/s.   C_nb : (n, 3, 3), body FRD to NED at the point.
    cov : (n, 9, 9) of position (m), velocity (m/s), attitude psi (rad), all in NED axes at the
        point.
    acceleration_b, rate_b : (n, 3) m/s^2 and rad/s of the body against the Earth, in body axes, or
        None.
    cross : (n - 1, 9, 9), covariance of the errors of row k with those of row k + 1, each in its
        own axes, or None.
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
        n = frozen(self, "time", (None,)).size
        shapes = {
            "lat": (n,),
            "lon": (n,),
            "height": (n,),
            "velocity_ned": (n, 3),
            "C_nb": (n, 3, 3),
            "cov": (n, 9, 9),
        }
        for name, shape in shapes.items():
            frozen(self, name, shape)
        if self.cross is not None:
            frozen(self, "cross", (max(n - 1, 0), 9, 9))
        for name in ("acceleration_b", "rate_b"):
            if getattr(self, name) is not None:
                frozen(self, name, (n, 3))
        increasing(self, self.time)

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
            given = [
                x for part in parts if part.time.size and (x := getattr(part, name)) is not None
            ]
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
    """Projection centre and attitude of every image in the tangent plane: the master from which
    every export is derived.

    origin : (3,) latitude rad, longitude rad, ellipsoidal height m of the tangent plane's origin.
    position_m : (n, 3) m, projection centre, east north up of the tangent plane.
    C_mc : (n, 3, 3), camera (x image right, y image down, z viewing direction) to the tangent
        plane.
    cov : (n, 6, 6) of position error (m) and psi (rad), both in tangent-plane axes; R(true) =
        exp([psi x]) R.
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
        shapes = {
            "time": (n,),
            "position_m": (n, 3),
            "C_mc": (n, 3, 3),
            "cov": (n, 6, 6),
            "cross": (max(n - 1, 0), 6, 6),
        }
        for name, shape in (
            shapes | {"origin": (3,), "boresight": (3, 3), "camera_from_body": (3, 3)}
        ).items():
            frozen(self, name, shape)


@dataclass(frozen=True, eq=False)
class Diagnostics:
    """How a run went, for the report. Axes north, east, down of the flight's local frame; states
    position, velocity, psi.

    time (m,) s; position (m, 3) m; velocity (m, 3) m/s; rpy (m, 3) rad; event (e,) rows of `time`
    that are exposures.
    filter_sigma, smoothed_sigma (m, 9).   bias, bias_sigma (m, 6): gyro x y z rad/s, accelerometer
                                           x y z m/s^2, body axes.
    fix_time (k,); innovation, innovation_sigma (k, 3) m; nis (k,) normalised innovation squared (3
    degrees of freedom), nis_limit; used (k,) bool; the same of velocities or None.
    separation_time (s,); separation, separation_sigma (s, 9): backward minus forward, NaN where not
    determined.
    gaps : (time, length) of bridged IMU gaps.   passes : filter passes.
    covariance_resets : times of covariance resets, after a second of rejected fixes.
    stationary : (k, 2) s, times in which the vehicle was taken to stand still.
    states : constants estimated besides biases.
    segments : first and last instant, s, of each segment that was solved by itself.
    time_correlated : time-correlated GNSS errors.
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
    checks: tuple[Check, ...] = ()
    stationary: Array | None = None
    states: tuple[StateVerdict, ...] = ()
    segments: tuple[tuple[float, float], ...] = ()
    time_correlated: tuple[TimeCorrelatedError, ...] = ()

    @classmethod
    def joined(cls, parts: "Sequence[Diagnostics]") -> "Diagnostics":
        """The parts, in the order of time, as one; constants are those of the longest part."""
        if len(parts) == 1:
            return parts[0]
        longest = max(parts, key=lambda part: part.time.size)
        values: dict[str, Any] = {}
        for f in fields(cls):
            given = [getattr(part, f.name) for part in parts]
            if f.name in ("gaps", "checks", "segments"):
                values[f.name] = tuple(dict.fromkeys(item for items in given for item in items))
            elif any(isinstance(x, np.ndarray) for x in given):
                values[f.name] = np.concatenate([x for x in given if x is not None])
            else:
                values[f.name] = getattr(longest, f.name)
        offset = np.cumsum([0, *(part.time.size for part in parts[:-1])])
        values["event"] = np.concatenate(
            [part.event + at for part, at in zip(parts, offset, strict=True)]
        )
        values["passes"] = max(part.passes for part in parts)
        return cls(**values)
