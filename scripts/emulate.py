"""A flight from a trajectory that was flown.

A spline goes through the sampled poses, which then is the truth.

Samples of position and attitude carry noise or rounding, and no accelerations. Their least-squares
spline of `motion` (quintic, four times differentiable, knots every `knot_s`),

    min over c of sum_k |x(t_k; c) - x_k|^2,   x(t; c) of (M.1)                                (E.1)

for north, east, down in l and for roll, pitch and unwrapped yaw of C_lb = C_ln C_nb, follows them
up to about 1 / (4 knot_s) Hz. Rates and specific forces are those of the spline itself, so a sensor
on it is exact by construction, whatever the samples were; how far the spline lies from them is
reported and matters to nothing but realism. Attitudes near the zenith, where the three angles are
no chart of the rotations, are refused. The motion begins and ends five knots inside the samples.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from insgnss.base.errors import InputError, UsageError
from insgnss.geodesy.frames import LocalFrame
from insgnss.geodesy.rotation import rotation_from_rpy, rpy_from_rotation
from insgnss.records import ImuSamples
from insgnss.simulation.flights import FlightMotion, flight_along
from insgnss.simulation.motion import ExactMotion

Array = NDArray[np.float64]

STEEPEST = np.radians(80.0)  # pitch: roll and yaw are not defined at 90 deg
# knots cut away at both ends, where neighbours on one side only leave the accelerations of the fit
# free to swing
ENDS = 5


@dataclass(frozen=True, eq=False)
class Emulation:
    """A motion along sampled poses.

    Parameters
    ----------
    position_rms_m, attitude_rms_rad : (3,) between spline and samples, in north, east, down and in
        roll, pitch, yaw.
    """

    motion: ExactMotion
    position_rms_m: Array
    attitude_rms_rad: Array

    def flight(self, name: str = "emulated", every_s: float = 2.0) -> FlightMotion:
        """The motion as a flight with an exposure every `every_s`."""
        return flight_along(self.motion, name, every_s)


def emulate_motion(
    time: ArrayLike,
    lat: ArrayLike,
    lon: ArrayLike,
    height: ArrayLike,
    rpy: ArrayLike,
    *,
    knot_s: float = 0.2,
) -> Emulation:
    """Motion along sampled poses (E.1).

    Parameters
    ----------
    time : (n,) s of a GPS week.
    lat, lon : (n,) rad.
    height : (n,) m above the ellipsoid.
    rpy : (n, 3) rad, roll, pitch, yaw, body forward-right-down to north-east-down.
    knot_s : s, between knots.

    Raises
    ------
    InputError : times that do not increase, samples too sparse for the knots, or a pitch beyond 80
        deg.
    UsageError : a knot spacing that is not positive, or too long for the trajectory.
    """
    time, lat, lon, height = (np.asarray(v, dtype=np.float64) for v in (time, lat, lon, height))
    rpy = np.asarray(rpy, dtype=np.float64)
    _refuse(time, rpy, knot_s)
    frame = LocalFrame(
        float(np.radians(np.round(np.degrees(lat[0]), 5))),
        float(np.radians(np.round(np.degrees(lon[0]), 5))),
        height[0],
    )
    angles = np.unwrap(rpy_from_rotation(frame.C_ln(lat, lon) @ rotation_from_rpy(rpy)), axis=0)
    poses = np.hstack([frame.position_from_geodetic(lat, lon, height), angles])
    pieces = int((time[-1] - time[0]) / knot_s + 1e-6)
    inside = time <= time[0] + pieces * knot_s
    control = _control(time[inside] - time[0], poses[inside], knot_s, pieces)
    motion = ExactMotion(frame, float(time[0]) + ENDS * knot_s, knot_s, control[ENDS:-ENDS])
    inside = (time >= motion.start) & (time <= motion.end)
    misfit = np.hstack([motion.position(time[inside]), motion.angles(time[inside])]) - poses[inside]
    rms = np.sqrt(np.mean(misfit**2, axis=0))
    return Emulation(motion, rms[:3], rms[3:])


def _refuse(time: Array, rpy: Array, knot_s: float) -> None:
    if not 0.0 < (2 * ENDS + 1) * knot_s <= time[-1] - time[0]:
        raise UsageError(
            f"knots every {knot_s} s for {time[-1] - time[0]:.3f} s of trajectory; use a positive"
            f" spacing, {2 * ENDS + 1} times in it"
        )
    step = np.diff(time)
    k = int(np.argmax((step <= 0.0) | (step > 0.5 * knot_s)))
    if step[k] <= 0.0 or step[k] > 0.5 * knot_s:
        raise InputError(
            f"trajectory: {step[k]:.4f} s from sample {k} at {time[k]:.3f} s to the next; time must"
            f" increase, by {0.5 * knot_s:.4f} s (half a knot spacing) or less; give denser samples"
            " or a longer knot_s"
        )
    steep = int(np.argmax(np.abs(rpy[:, 1])))
    if abs(rpy[steep, 1]) > STEEPEST:
        raise InputError(
            f"trajectory: pitch {np.degrees(rpy[steep, 1]):.1f} deg at {time[steep]:.3f} s (limit"
            f" {np.degrees(STEEPEST):.0f} deg); cut this part away: roll, pitch and yaw do not"
            " describe it smoothly"
        )


def _control(elapsed: Array, poses: Array, knot_s: float, pieces: int) -> Array:
    """(pieces + 5, 6) control points that fit `poses` (n, 6) best (E.1)."""
    from scipy.interpolate import make_lsq_spline

    knots = (np.arange(pieces + 11) - 5.0) * knot_s
    return np.asarray(make_lsq_spline(np.minimum(elapsed, pieces * knot_s), poses, knots, k=5).c)


def add_recorded_noise(samples: ImuSamples, noise: ArrayLike, first: int = 0) -> ImuSamples:
    """Samples plus a sensor's recorded errors, row by row.

    Parameters
    ----------
    noise : (m, 6) gyro rad/s and accelerometer m/s^2 of a sensor at rest, its constant part taken
        off, sampled at the rate of `samples` and in the sensor's axes.
    first : row of it that goes to the first sample.

    Raises
    ------
    UsageError
        Where the recording is shorter than the samples, or `samples` hold instantaneous rates.
    """
    noise = np.asarray(noise, dtype=np.float64)
    n = samples.time.size
    if noise.ndim != 2 or noise.shape[1] != 6 or not 0 <= first <= len(noise) - n:
        raise UsageError(
            f"recorded noise of shape {noise.shape} from row {first} on; {n} rows of 6 are needed"
        )
    if samples.quantity == "instant_rate":
        raise UsageError(
            "recorded noise belongs to whole sample intervals; simulate mean rates or increments"
        )
    unit = float(np.median(np.diff(samples.time))) if samples.quantity == "increments" else 1.0
    error = unit * noise[first : first + n]
    return replace(samples, gyro=samples.gyro + error[:, :3], accel=samples.accel + error[:, 3:])
