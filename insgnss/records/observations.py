"""What was recorded: samples of the IMU and their increments, fixes, exposures."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..base.errors import InputError
from ._checked import Array, frozen, increasing
from .verdicts import Check

Quantity = Literal["mean_rate", "increments", "instant_rate"]

QUANTITIES = ("mean_rate", "increments", "instant_rate")
# m/s, standard deviation of a component of velocity that was not measured: far beyond any drone
UNKNOWN_MPS = 1000.0


@dataclass(frozen=True, eq=False)
class ImuSamples:
    """IMU recording in the sensor's own axes or in the body's.

    time : (n,) s, GPST of `gps_week`; the stamp is the end of the sample's interval (mean rate,
        increments) or the instant.
    gyro : (n, 3) rad/s, or rad for increments.
    accel : (n, 3) m/s^2 specific force, or m/s for increments.
    notes : what the reader found odd and did about it (rows left out or put in order, with counts).
    units : that the numbers of the file were taken to be in, of "gyro" and "accel"; empty where its
        format fixes them.
    """

    time: Array
    gyro: Array
    accel: Array
    quantity: Quantity = "mean_rate"
    gps_week: int | None = None
    source: str = ""
    notes: tuple[Check, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n = frozen(self, "time", (None,)).size
        frozen(self, "gyro", (n, 3))
        frozen(self, "accel", (n, 3))
        if n < 2:
            raise InputError(f"{self.source or 'ImuSamples'}: {n} samples; at least 2 are needed")
        if self.quantity not in QUANTITIES:
            raise InputError(
                f"ImuSamples.quantity: {self.quantity!r} is none of {', '.join(QUANTITIES)}"
            )
        increasing(self, self.time)


@dataclass(frozen=True, eq=False)
class Increments:
    """Body increments between consecutive marks and samples: what the filter integrates.

    dt (s,) s; dtheta (s, 3) rad; dvel (s, 3) m/s, body axes (`prepare.increments` says what they
    contain). marks (m,) s, GPST; stop (m,) number of segments before each mark; rate (m, 3) rad/s,
    gyro rate at each mark.
    nominal_s : sample interval.   gaps : (time, length) of every gap that was bridged.
    bridged : (m, 6) variance of the increments (rad^2, m^2/s^2) since the mark before where a gap
        was bridged, else 0; None without gaps.
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
        n = frozen(self, "dt", (None,)).size
        frozen(self, "dtheta", (n, 3))
        frozen(self, "dvel", (n, 3))
        m = frozen(self, "marks", (None,)).size
        frozen(self, "rate", (m, 3))
        if self.bridged is not None:
            frozen(self, "bridged", (m, 6))
        increasing(self, self.marks)


@dataclass(frozen=True, eq=False)
class GnssFixes:
    """Positions (and velocities) of the antenna phase centre.

    time : (n,) s, GPST.   lat, lon : (n,) rad; height : (n,) m above the ellipsoid.
    cov_ned : (n, 3, 3) m^2 in north, east, down at the fix.
    velocity_ned : (n, 3) m/s and velocity_cov_ned : (n, 3, 3) m^2/s^2, or None.
    quality : (n,) of RTKLIB's codes (1 fixed, 2 float, 3 SBAS, 4 DGPS, 5 single, 6 PPP; 0 unknown),
        or None.
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
        n = frozen(self, "time", (None,)).size
        for name in ("lat", "lon", "height"):
            frozen(self, name, (n,))
        frozen(self, "cov_ned", (n, 3, 3))
        if self.velocity_ned is not None:
            frozen(self, "velocity_ned", (n, 3))
            frozen(self, "velocity_cov_ned", (n, 3, 3))
        if n < 1:
            raise InputError(f"{self.source or 'GnssFixes'}: no fix")
        increasing(self, self.time)


@dataclass(frozen=True, eq=False)
class CameraEvents:
    """Mid-exposure instants. images : n names as the bundle adjustment knows them; time : (n,) s,
    GPST. notes : of the reader.
    """

    images: tuple[str, ...]
    time: Array
    gps_week: int | None = None
    source: str = ""
    notes: tuple[Check, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "images", tuple(self.images))
        frozen(self, "time", (len(self.images),))
        increasing(self, self.time)
        if len(set(self.images)) != len(self.images):
            twice = next(name for i, name in enumerate(self.images) if name in self.images[:i])
            raise InputError(f"{self.source or 'CameraEvents'}: image {twice} occurs twice")
