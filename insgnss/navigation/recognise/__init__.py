"""What the recording itself shows of units, axes and clocks, and whether the flight file agrees.

Mathematics of the recogniser. The gyros propagate the specific force into the axes 0 that the
sensor had at the start (`signal`), from increments dtheta, dvel over steps h:

    C[k+1] = C[k] exp([dtheta x]),   V[k+1] = V[k] + d,   S[k+1] = S[k] + h (V[k] + d / 2),
    d = C[k] (dvel + dtheta x dvel / 2)                                                        (R.1)

GNSS sees the same force, gravity g taken off, as differences of velocities or of positions:

    z = (v3 - v1) / (t3 - t1) - g                                                              (R.2)
    z = 2 (p1 - p2) / ((t2 - t1) (t3 - t1)) + 2 (p3 - p2) / ((t3 - t2) (t3 - t1)) - g          (R.3)

The same differences of V and of S, at times shifted by a lag, are a. In each window of some seconds
one rotation takes a to z. Wahba's problem, with the singular values s of M = sum w z a', leaves

    sum w |z|^2 - (s1 + s2 +- s3)^2 / sum w |a|^2                                              (R.4)

unexplained (`fit.scan_lags`); s3 is added for the score, with the sign of det M for specific force,
with its reverse for reversed force. The score is the share of the scatter of z that is explained,

    log likelihood = -CAUTION / 2 * samples * log(1 - score)                                   (R.5)

with a prior for usual lags. Least squares then estimate lag, lever arm l, gyro scale error k, gyro
bias b and the rotation C_w of each window (`fit.fit`):

    z = C_w (exp([r x]) a(t + lag) + D l),   r = k (turn) + b (drift)                          (R.6)

with D the same difference of C.

Of the fits of several differences the one of the smallest sigma is taken (`relation`), with

    sigma^2 = sigma_best^2 + mean of max((lag_i - lag)^2 - sigma_i^2, 0) + (interval / 4)^2    (R.7)

The attitude at each row is C_ns = C_w exp([r x]) C (R.8). Forward is the direction in which the
velocity v, north + i east, follows the heading h of an axis, by regression with the wind (`axes`):

    v = c h + wind,   |c| the speed, arg c the angle of forward against the axis               (R.9)

Positions against the velocities beside them, and what misreading explains a difference, is (R.11)
(`positions`).

A confidence is the probability 1 / (1 + exp(-x)) for the logarithm x of a likelihood ratio, zero
where x is below `verdict.TELLING` (R.10).
"""
