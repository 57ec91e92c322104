"""Numba kernels: body increments of IMU samples between time marks, and sums of the samples.

Mathematics: `increments`, `stationarity`.
"""

from ...base.compilation import njit

# what samples hold, in the order of `records.QUANTITIES`
MEAN_RATE, INCREMENTS, INSTANT_RATE = 0, 1, 2


@njit(cache=True, allocates=False)
def sample_rate(time, gyro, accel, quantity, i, nominal, bridge, out):
    """Mean rate (6,) over the interval from sample i to sample i + 1, in the sensor's axes."""
    h = time[i + 1] - time[i]
    long = h > bridge
    for c in range(3):
        if quantity == INSTANT_RATE:
            out[c] = interval_mean(gyro, i, c, long)
            out[3 + c] = interval_mean(accel, i, c, long)
            continue
        k = 1.0
        if quantity == INCREMENTS:
            k = 1.0 / (nominal if long else h)
        out[c] = k * gyro[i + 1, c]
        out[3 + c] = k * accel[i + 1, c]
        if long:
            out[c] = 0.5 * (out[c] + k * gyro[i, c])
            out[3 + c] = 0.5 * (out[3 + c] + k * accel[i, c])


@njit(cache=True, allocates=False)
def interval_mean(a, i, c, long):
    """Mean of samples over [i, i + 1]: cubic through four samples (I.1), else the trapezoid.

    The trapezoid serves at the two ends of the recording and over gaps.
    """
    if long or i == 0 or i + 2 >= a.shape[0]:
        return 0.5 * (a[i, c] + a[i + 1, c])
    return (13.0 * (a[i, c] + a[i + 1, c]) - a[i - 1, c] - a[i + 2, c]) / 24.0


@njit(cache=True, allocates=False)
def rotate(C, v, out):
    """Rotate rate and specific force v (6,) by C (3, 3) into out (6,)."""
    for r in range(3):
        out[r] = C[r, 0] * v[0] + C[r, 1] * v[1] + C[r, 2] * v[2]
        out[3 + r] = C[r, 0] * v[3] + C[r, 1] * v[4] + C[r, 2] * v[5]


@njit(cache=True, allocates=False)
def even_spacing(time, i):
    """Whether the five intervals around interval i exist and differ by less than one percent."""
    if i < 2 or i + 3 >= time.size:
        return False
    h = time[i + 1] - time[i]
    even = True
    for k in range(i - 2, i + 3):
        even &= abs(time[k + 1] - time[k] - h) <= 0.01 * h
    return even


@njit(cache=True, allocates=False)
def body_rate(time, gyro, accel, quantity, C, i, nominal, bridge, raw, out):
    """Mean rate (6,) over interval i in body axes; False where there is no such interval."""
    if i < 0 or i + 1 >= time.size:
        return False
    sample_rate(time, gyro, accel, quantity, i, nominal, bridge, raw)
    rotate(C, raw, out)
    return True


@njit(cache=True, allocates=False)
def bracket(a, b, k, out):
    """out += k [a, b] of rates (omega, f): (a_w x b_w, a_w x b_f + a_f x b_w)."""
    for c in range(3):
        d, e = (c + 1) % 3, (c + 2) % 3
        out[c] += k * (a[d] * b[e] - a[e] * b[d])
        out[3 + c] += k * (a[d] * b[3 + e] - a[e] * b[3 + d] + a[3 + d] * b[e] - a[3 + e] * b[d])


@njit(cache=True, allocates=False)
def build_segments(
    time, gyro, accel, quantity, C, nominal, bridge, marks, dt, dtheta, dvel, stop, rate, work
):
    """Fill the integration intervals (dt, dtheta, dvel) from marks[0] to marks[-1].

    Every mark lies within [time[0], time[-1]]; marks increase. stop (m,) is the number of intervals
    before each mark, rate (m, 3) the gyro rate there; work (10, 6) is scratch. Returns the number
    of intervals.
    """
    last = time.size - 2
    i = 0
    while i < last and time[i + 1] <= marks[0]:
        i += 1
    work[:] = 0.0
    r = work[:5]  # rates of intervals i - 2 .. i + 2
    raw, slope, fine, second, extra = work[5], work[6], work[7], work[8], work[9]
    for k in range(4):
        body_rate(time, gyro, accel, quantity, C, i - 2 + k, nominal, bridge, raw, r[k])
    n = 0
    m = 0
    while m < marks.size and i <= last:
        t0, t1 = time[i], time[i + 1]
        h = t1 - t0
        has_before, has_after = i > 0, i < last
        body_rate(time, gyro, accel, quantity, C, i + 2, nominal, bridge, raw, r[4])
        width = h
        if has_before and has_after:
            width = 0.5 * (t0 - time[i - 1]) + h + 0.5 * (time[i + 2] - t1)
        elif has_before:
            width = 0.5 * (t0 - time[i - 1]) + 0.5 * h
        elif has_after:
            width = 0.5 * (time[i + 2] - t1) + 0.5 * h
        lo, hi, inverse = r[1] if has_before else r[2], r[3] if has_after else r[2], 1.0 / width
        for c in range(6):
            slope[c] = (hi[c] - lo[c]) * inverse
            extra[c] = 0.0
        if even_spacing(time, i):
            inverse = 1.0 / (120.0 * h)
            for c in range(6):
                fine[c] = (82.0 * (r[3, c] - r[1, c]) - 11.0 * (r[4, c] - r[0, c])) * inverse
                second[c] = 0.5 * (r[3, c] + r[1, c]) - r[2, c]
            bracket(r[2], fine, h * h / 12.0, extra)
            bracket(second, fine, -h * h / 360.0, extra)
        else:
            bracket(r[2], slope, h * h / 12.0, extra)
        a = t0 if m > 0 else max(t0, marks[0])
        while True:
            is_mark = m < marks.size and marks[m] <= t1
            b = marks[m] if is_mark else t1
            d = b - a
            if d > 0.0 and m > 0:
                mid = 0.5 * (a + b) - 0.5 * (t0 + t1)
                share = (d / h) ** 2  # the bracket term of a piece of length d goes with d^3
                dt[n] = d
                for c in range(3):
                    dtheta[n, c] = d * (r[2, c] + share * extra[c] + slope[c] * mid)
                    dvel[n, c] = d * (r[2, 3 + c] + share * extra[3 + c] + slope[3 + c] * mid)
                n += 1
            a = b
            if not is_mark:
                break
            stop[m] = n
            for c in range(3):
                rate[m, c] = r[2, c] + slope[c] * (b - 0.5 * (t0 + t1))
            m += 1
            if m == marks.size:
                break
        for k in range(4):
            for c in range(6):
                r[k, c] = r[k + 1, c]
        i += 1
    return n


@njit(cache=True, allocates=False)
def average_rates(dt, dtheta, stop, half_s, longest_s, rate, angle):
    """Replace rate (m, 3) at marks by averages of the intervals around them (I.4).

    dt (n,), dtheta (n, 3) and stop (m,) are as `build_segments` leaves them; angle (2, 3) is
    scratch. A mark keeps its rate where the window of 4 half_s is not whole, or holds an interval
    of more than longest_s.
    """
    n = dt.size
    for m in range(stop.size):
        angle[:] = 0.0  # from -half_s to half_s, and from -2 half_s to 2 half_s
        complete = True
        for side in range(2):
            k = stop[m] if side == 1 else stop[m] - 1
            covered = 0.0
            while complete and covered < 2.0 * half_s:
                if k < 0 or k >= n or dt[k] > longest_s:
                    complete = False
                    break
                for window in range(2):
                    share = min(max((1 + window) * half_s - covered, 0.0) / dt[k], 1.0)
                    for c in range(3):
                        angle[window, c] += share * dtheta[k, c]
                covered += dt[k]
                k += 1 if side == 1 else -1
        if complete:
            for c in range(3):
                rate[m, c] = (8.0 * angle[0, c] - angle[1, c]) / (12.0 * half_s)


@njit(cache=True, allocates=False)
def add_up(x, edges, reference, out):
    """Add up samples x (n, 3) about `reference` (3,), and their squares, between edges (k + 1,).

    out (2, k, 3), zero before.
    """
    for k in range(edges.size - 1):
        for i in range(edges[k], edges[k + 1]):
            for c in range(3):
                d = x[i, c] - reference[c]
                out[0, k, c] += d
                out[1, k, c] += d * d
