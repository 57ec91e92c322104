"""From IMU samples to body increments between the filter's epochs.

Mean of an instantaneous quantity x over one interval of a cubic through four samples:

    mean = (-x[i-1] + 13 x[i] + 13 x[i+1] - x[i+2]) / 24                                       (I.1)

Rotation and velocity increment of an interval obey one linear equation on pairs (omega, f) with the
bracket [(w, f), (w', f')] = (w x w', w x f' + f x w'). With r the mean rate of the interval, a1 the
slope and a2 the curvature at its middle, the Magnus series of that equation (time-symmetric, Blanes
et al. 2009) gives

    (dphi, du) = h r + (h^3 / 12) [r, a1*] - (h^5 / 360) [a2, a1*] + O(h^6 double brackets)    (I.2)

dphi is the rotation vector of the interval; du the velocity increment without its rotation part,
which the strapdown adds after the bias is taken off. The second term holds what is known as coning
and sculling. The slope that this needs to fifth order comes from the means of the four neighbouring
intervals (the whole flight is there, so both sides are known):

    a1* h = (82 (r[k+1] - r[k-1]) - 11 (r[k+2] - r[k-2])) / 120,
    a2 h^2 = (r[k+1] + r[k-1]) / 2 - r[k]                                                      (I.3)

Where the five intervals are not alike (ends, gaps, jitter over one percent), the slope is the
difference of the two neighbours over the time between their middles and a2 is left out. A time mark
inside an interval (fix, exposure) splits it under the rate r + a1 (t - middle); the bracket of a
piece of length d is that of the interval times (d / h)^3, which makes the product of the two pieces
the rotation of the whole.

The rate at a mark is what the velocity of the antenna is computed with. That of one sample has the
noise of its whole band: 0.5 deg/s at 1000 Hz of a consumer IMU, and errors in the rate pull an
estimated lever arm towards zero (0.08 of 0.35 m with velocities of 3 cm/s at 20 Hz). So it is the
average over +- w and +- 2 w of the mark, with M(w) = (theta(t + w) - theta(t - w)) / (2 w),

    rate = (4 M(w) - M(2 w)) / 3 = omega - w^4 / 30 d4omega/dt4 + ...                          (I.4)

of which white noise has the variance 1.4 / (2 w) of its density, and a motion of 5 Hz is 0.5 % too
small at w = 20 ms. At marks whose window is not whole it is that of the sample.

Blanes, Casas, Oteo, Ros (2009) "The Magnus expansion and some of its applications"; Savage (1998)
for the one-sided forms.

Gaps of up to a second are bridged by the mean of the rates at their two ends, with the variance
that `gaps` finds for it.
"""

import numpy as np

from ...base.errors import DataError
from ...records import QUANTITIES, Array, ImuSamples, Increments
from .gaps import LEAST_GAP_INTERVALS, bridged_variance, find_gaps, limit, nominal_interval

# a mark this close to another, or to a sample, is the same instant: 15 m/s make 1.5 micrometres of
# it
SNAP_S = 1e-7
# w of (I.4), s: vibration of propellers (50 Hz and more) averages out, gusts (below 5 Hz) do not
HALF_WINDOW_S = 0.02
# longest interval within that window, s: of an IMU of 100 Hz, with jitter; slower ones keep theirs
LONGEST_AVERAGED_S = 0.012


def merge_marks(*times: Array) -> tuple[Array, list[np.ndarray]]:
    """Merge sorted instants; instants closer than `SNAP_S` are one.

    Parameters
    ----------
    *times : ndarray, shape (n_i,), s

    Returns
    -------
    union : ndarray, shape (m,), s
        The sorted union.
    indices : list of ndarray of int, shape (n_i,)
        For each input, the index of its instants in the union.
    """
    every = np.sort(np.concatenate(times))
    keep = np.concatenate([[True], np.diff(every) > SNAP_S])
    union = every[keep]
    indices = [np.searchsorted(union, t + SNAP_S, side="right") - 1 for t in times]
    return union, indices


def body_increments(imu: ImuSamples, C_b_imu: Array, marks: Array) -> Increments:
    """Integrate samples into body increments from the first to the last mark, split at every mark.

    Parameters
    ----------
    imu : ImuSamples
        Samples in the sensor's axes.
    C_b_imu : ndarray, shape (3, 3)
        Sensor axes to body.
    marks : ndarray, shape (m,), s
        Increasing instants within the recording.

    Returns
    -------
    Increments

    Raises
    ------
    DataError
        Where a gap between the first and the last mark is too long to be bridged, or the recording
        does not show how well it is bridged.
    """
    from ._kernels import average_rates, build_segments

    nominal = nominal_interval(imu.time)
    gaps = [g for g in find_gaps(imu.time, nominal) if g[0] + g[1] > marks[0] and g[0] < marks[-1]]
    for t, length in gaps:
        if length > limit(nominal):
            raise DataError(
                f"{imu.source or 'IMU'}: gap of {length:.3f} s (limit {limit(nominal):.3g} s) at"
                f" {t:.3f} s; cut the flight there with start_tow or end_tow"
            )
    room = imu.time.size + marks.size
    dt, dtheta, dvel = np.empty(room), np.empty((room, 3)), np.empty((room, 3))
    stop, rate = np.empty(marks.size, dtype=np.int64), np.empty((marks.size, 3))
    snapped = _snap_to_samples(marks, imu.time)
    samples = (imu.time, imu.gyro, imu.accel, QUANTITIES.index(imu.quantity))
    C, bridge = np.ascontiguousarray(C_b_imu), LEAST_GAP_INTERVALS * nominal
    out = dt, dtheta, dvel, stop, rate, np.empty((10, 6))
    n = build_segments(*samples, C, nominal, bridge, snapped, *out)
    limits = HALF_WINDOW_S, LONGEST_AVERAGED_S
    average_rates(dt[:n], dtheta[:n], stop, *limits, rate, np.empty((2, 3)))
    bridged = bridged_variance(imu, C_b_imu, gaps, snapped) if gaps else None
    return Increments(
        dt[:n], dtheta[:n], dvel[:n], snapped, stop, rate, nominal, tuple(gaps), bridged
    )


def _snap_to_samples(marks: Array, time: Array) -> Array:
    """Move marks within `SNAP_S` of a sample onto it, so that no interval is shorter than that."""
    i = np.clip(np.searchsorted(time, marks), 1, time.size - 1)
    nearest = np.where(marks - time[i - 1] < time[i] - marks, time[i - 1], time[i])
    return np.where(np.abs(nearest - marks) < SNAP_S, nearest, marks)
