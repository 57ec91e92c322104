"""Loops over a whole recording: cumulated samples, powers of their differences, and the biweight's
moments.

Compiled without fastmath a running sum cannot be vectorised, an addition of arrays can; hence sums
over a block go into a row of partial sums first. All release the interpreter's lock, so that axes
run in threads.
"""

import numpy as np

from ...base.compilation import njit

# samples whose differences are formed for all averaging factors before the next are touched
BLOCK_SAMPLES = 4096
LANES = 128  # partial sums


@njit(cache=True, nogil=True)
def copy_sum(x, out):
    """Copy x (n,) to out[1:], out[0] = 0; its sum, and whether all values are the same."""
    n = x.size
    first = x[0]
    same = True
    whole = 0.0
    out[0] = 0.0
    for start in range(0, n, BLOCK_SAMPLES):
        partial = 0.0
        for i in range(start, min(start + BLOCK_SAMPLES, n)):
            v = x[i]
            out[i + 1] = v
            partial += v
            same &= v == first
        whole += partial
    return whole, same


@njit(cache=True, nogil=True)
def cumulate(s, mean):
    """Replace s[1:] by the cumulated sum of s[1:] - mean, in place."""
    total = 0.0
    for i in range(1, s.size):
        total += s[i] - mean
        s[i] = total


@njit(cache=True, nogil=True)
def second_difference_power(s, m, stride, power):
    """Sum over t = 0, stride[k], ... of (s[t + 2 m] - 2 s[t + m] + s[t])^2 for every averaging
    factor m[k], into power[k].

    s (n + 1,).   m, stride, power (K,).   Blocks of t are finished for all m in turn: for octaves
                                           of m the end of one
    filter is the middle of the next and still in the cache, so that a block is loaded K + 2 and not
    3 K times.
    """
    lanes = np.empty(LANES)
    last = s.size - 2 * m
    power[:] = 0.0
    for start in range(0, s.size, BLOCK_SAMPLES):
        for k in range(m.size):
            stop = min(start + BLOCK_SAMPLES, last[k])
            if stop <= start:
                continue
            step = stride[k]
            if step == 1:
                power[k] += _second(
                    s[start:stop],
                    s[start + m[k] : stop + m[k]],
                    s[start + 2 * m[k] : stop + 2 * m[k]],
                    lanes,
                )
            else:
                partial = 0.0
                for t in range(-(-start // step) * step, stop, step):
                    d = s[t + 2 * m[k]] - 2.0 * s[t + m[k]] + s[t]
                    partial += d * d
                power[k] += partial


@njit(cache=True, nogil=True)
def _second(a, b, c, lanes):
    """Sum of (a - 2 b + c)^2."""
    lanes[:] = 0.0
    full = a.size // LANES * LANES
    for i in range(0, full, LANES):
        for j in range(LANES):
            d = (c[i + j] - b[i + j]) - (b[i + j] - a[i + j])
            lanes[j] += d * d
    partial = 0.0
    for i in range(full, a.size):
        d = (c[i] - b[i]) - (b[i] - a[i])
        partial += d * d
    return partial + lanes.sum()


@njit(cache=True, nogil=True)
def haar_squares(s, m, stride, out):
    """Square of the Haar coefficients of averaging factor m at t = 0, stride, ..., from s of
    `cumulate`, into out.
    """
    scale = 0.5 / m
    for i in range(out.size):
        t = i * stride
        d = scale * ((s[t + 2 * m] - s[t + m]) - (s[t + m] - s[t]))
        out[i] = d * d


@njit(cache=True, nogil=True)
def biweight_mean(q, k):
    """Mean over q (n,) of y (1 - y)^4 where y = k q < 1, else 0, and its derivative with respect to
    log k.
    """
    lanes = np.zeros((2, LANES))
    value, slope = lanes[0], lanes[1]
    full = q.size // LANES * LANES
    for i in range(0, full, LANES):
        for j in range(LANES):
            y = k * q[i + j]
            z = max(1.0 - y, 0.0)
            z3 = z * z * z * y
            value[j] += z3 * z
            slope[j] += z3 * (z - 4.0 * y)
    for i in range(full, q.size):
        y = k * q[i]
        z = max(1.0 - y, 0.0)
        z3 = z * z * z * y
        value[0] += z3 * z
        slope[0] += z3 * (z - 4.0 * y)
    return value.sum() / q.size, slope.sum() / q.size
