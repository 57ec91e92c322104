"""Numba kernels that put a recording onto other stamps. Mathematics: `combine`."""

from ....base.compilation import njit
from ....records import Array


@njit(cache=True)
def running_sum(time: Array, rate: Array, out: Array) -> None:
    """Integrate mean rates (n, c) over the intervals between the instants time (n + 1,).

    The integral goes into out (n + 1, c).
    """
    out[0] = 0.0
    for k in range(rate.shape[0]):
        h = time[k + 1] - time[k]
        for c in range(rate.shape[1]):
            out[k + 1, c] = out[k, c] + h * rate[k, c]


@njit(cache=True)
def interpolate(time: Array, value: Array, chord: Array, instants: Array, out: Array) -> None:
    """Interpolate by a cubic through value (n, c) at time (n,) at increasing instants (m,).

    The result goes into out (m, c); it is constant beyond the ends. chord (n - 1, c) are the mean
    slopes between the values. The slope at a value is that of the parabola through its neighbours.
    """
    i, last = 0, time.size - 2
    for k in range(instants.size):
        t = min(max(instants[k], time[0]), time[-1])
        while i < last and time[i + 1] <= t:
            i += 1
        h = time[i + 1] - time[i]
        before, after = max(i - 1, 0), min(i + 1, last)
        # share of the chord before in the slope at i
        left = h / (h + time[before + 1] - time[before])
        right = h / (h + time[after + 1] - time[after])
        u = (t - time[i]) / h
        v = 1.0 - u
        a, b, c0, c1 = (
            v * v * (1.0 + 2.0 * u),
            u * u * (1.0 + 2.0 * v),
            u * v * v * h,
            -u * u * v * h,
        )
        for c in range(value.shape[1]):
            s = chord[i, c]
            slope0 = left * chord[before, c] + (1.0 - left) * s
            slope1 = right * chord[after, c] + (1.0 - right) * s
            out[k, c] = a * value[i, c] + b * value[i + 1, c] + c0 * slope0 + c1 * slope1
