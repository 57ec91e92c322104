"""The update (K): innovation gate, update with three scalars, covariance reset, feedback."""

import numpy as np

from ....base.compilation import njit
from ..codes import AX, AY, AZ, IMU0, N_NAV, PSI0, QW, QX, QY, QZ, VEL0
from .error_model import GRAVITY
from .strapdown import rotate_left

LARGEST_TILT_VARIANCE = 3e-4  # rad^2, a degree: what a covariance reset adds to psi at most


@njit(cache=True, allocates=False)
def cholesky(R, L):
    """Compute the lower Cholesky factor of a matrix.

    Parameters
    ----------
    R : ndarray
        (n, n) symmetric matrix; its lower triangle is read.
    L : ndarray
        (n, n) its factor, filled in place, which may be that of R; above its diagonal nothing is
        written.

    Returns
    -------
    bool
        Whether the matrix is positive definite.
    """
    for r in range(R.shape[0]):
        for c in range(r + 1):
            t = R[r, c]
            for k in range(c):
                t -= L[r, k] * L[c, k]
            if r == c:
                if t <= 0.0:
                    return False
                L[r, r] = np.sqrt(t)
            else:
                L[r, c] = t / L[c, c]
    return True


@njit(cache=True, allocates=False)
def forward_solve3(L, A):
    """Solve with a lower triangular matrix in place: A <- L^-1 A.

    Parameters
    ----------
    L : ndarray
        (3, 3) lower triangular matrix.
    A : ndarray
        (3, m) right-hand sides, changed in place.
    """
    for r in range(3):
        to = A[r]
        for k in range(r):
            t, of = L[r, k], A[k]
            for j in range(to.size):
                to[j] -= t * of[j]
        t = 1.0 / L[r, r]
        for j in range(to.size):
            to[j] *= t


@njit(cache=True, allocates=False)
def weigh(P, H, used, HP):
    """Compute H P of a triple.

    Parameters
    ----------
    P : ndarray
        (n, c) any matrix.
    H : ndarray
        (3, k) derivative of the measurement, k <= n.
    used : int
        Number of leading columns of H that may differ from zero.
    HP : ndarray
        (3, c) the product, filled in place.
    """
    h0, h1, h2 = H[0], H[1], H[2]
    p0, p1, p2 = HP[0], HP[1], HP[2]
    HP[:] = 0.0
    for k in range(used):  # most of H is zero
        a, b, c = h0[k], h1[k], h2[k]
        if a != 0.0 or b != 0.0 or c != 0.0:
            row = P[k]
            for i in range(p0.size):
                t = row[i]
                p0[i] += a * t
                p1[i] += b * t
                p2[i] += c * t


@njit(cache=True, allocates=False)
def one_after_another(H, K, used, HM):
    """Turn H M, of three scalars at once, into what each finds of M when its turn comes.

    Before scalar j the updates i < j have taken K_i of (h_i M) from M, so that

        h_j M_j = h_j M - sum over i < j of (h_j K_i) (h_i M_i)

    Parameters
    ----------
    H : ndarray
        (3, k) whitened derivatives.
    K : ndarray
        (3, n) gains.
    used : int
        Number of leading columns of H that may differ from zero.
    HM : ndarray
        (3, c) changed in place.
    """
    h1, h2, k0, k1 = H[1], H[2], K[0], K[1]
    a = b = c = 0.0
    for k in range(used):
        a += h1[k] * k0[k]
        b += h2[k] * k0[k]
        c += h2[k] * k1[k]
    m0, m1, m2 = HM[0], HM[1], HM[2]
    for i in range(m0.size):
        m1[i] -= a * m0[i]
        m2[i] -= b * m0[i] + c * m1[i]


@njit(cache=True, allocates=False)
def take_off(A, B, columns, M):
    """Take three products off a matrix in place: M <- M - A' B.

    Parameters
    ----------
    A : ndarray
        (3, r) of which rows of M are factors.
    B : ndarray
        (3, c) with what they are multiplied.
    columns : int
        Leading columns of B and M that take part.
    M : ndarray
        (r or more, c or more), changed in place.
    """
    a0, a1, a2 = A[0], A[1], A[2]
    b0, b1, b2 = B[0], B[1], B[2]
    for r in range(a0.size):
        a, b, c, row = a0[r], a1[r], a2[r], M[r]
        if a != 0.0 or b != 0.0 or c != 0.0:
            for k in range(columns):
                row[k] -= a * b0[k] + b * b1[k] + c * b2[k]


@njit(cache=True, allocates=False)
def innovation_test(P, H, nu, m, R, used, S, L, HP, out):
    """Compute the normalised innovation squared (NIS) of a triple.

    Parameters
    ----------
    P : ndarray
        (n, n) covariance of the errors.
    H : ndarray
        (3, n) derivative of the measurement.
    nu : ndarray
        (3, 1) innovation of the nominal.
    m : ndarray
        (n,) estimate of the errors about the nominal.
    R : ndarray
        (3, 3) covariance of the measurement.
    used : int
        Number of leading columns of H that may differ from zero.
    S, L : ndarray
        (3, 3) innovation covariance and its Cholesky factor, filled in place.
    HP : ndarray
        (3, n) H P, filled in place.
    out : ndarray
        (2, 3) innovation and its standard deviation, filled in place.

    Returns
    -------
    float
        The NIS; infinite where the innovation covariance is not positive definite.
    """
    for r in range(3):
        t = nu[r, 0]
        for k in range(used):
            t -= H[r, k] * m[k]
        out[0, r] = t
    weigh(P, H, used, HP)
    h0, h1, h2 = H[0], H[1], H[2]
    p0, p1, p2 = HP[0], HP[1], HP[2]
    for c in range(3):
        for r in range(c, 3):
            S[r, c] = R[r, c]
    for k in range(used):
        t = h0[k]
        S[0, 0] += t * p0[k]
        t = h1[k]
        S[1, 0] += t * p0[k]
        S[1, 1] += t * p1[k]
        t = h2[k]
        S[2, 0] += t * p0[k]
        S[2, 1] += t * p1[k]
        S[2, 2] += t * p2[k]
    S[0, 1], S[0, 2], S[1, 2] = S[1, 0], S[2, 0], S[2, 1]
    if not cholesky(S, L):
        return np.inf
    y0 = out[0, 0] / L[0, 0]
    y1 = (out[0, 1] - L[1, 0] * y0) / L[1, 1]
    y2 = (out[0, 2] - L[2, 0] * y0 - L[2, 1] * y1) / L[2, 2]
    for r in range(3):
        out[1, r] = np.sqrt(S[r, r])
    return y0 * y0 + y1 * y1 + y2 * y2


@njit(cache=True, allocates=False)
def reset_covariance(P, innovation, since_s):
    """Reset the covariance of position, velocity and psi after rejected fixes (K.7), in place.

    Parameters
    ----------
    P : ndarray
        (n, n) covariance of the errors, changed in place.
    innovation : ndarray
        (3,) innovation of the position in l, m.
    since_s : float
        Time within which the errors must have made it, s.
    """
    for i in range(3):
        d = innovation[i]
        P[i, i] += d * d
        P[VEL0 + i, VEL0 + i] += (d / since_s) ** 2
    d = (innovation[0] ** 2 + innovation[1] ** 2) / (0.5 * GRAVITY * since_s * since_s) ** 2
    d = min(d, LARGEST_TILT_VARIANCE)
    for i in range(PSI0, N_NAV):
        P[i, i] += d


@njit(cache=True, allocates=False)
def triple_update(P, m, H, HP, nu, used, K, S, y, cross, track_cross, T):
    """Update mean and covariance with three scalars of unit variance (K.4), in place.

    One after another, h_0 first, as if each came by itself: with k_i = P_i h_i, s_i = h_i' k_i + 1

        P_i+1 = P_i - k_i k_i' / s_i        P_i+1 h_j = P_i h_j - k_i (k_i' h_j) / s_i

    so that the gains come from H P alone, and P is gone through once instead of three times. The
    sum of k[r] k[c] is the same either way round, so that P stays symmetric.

    Parameters
    ----------
    P : ndarray
        (n, n) covariance of the errors, changed in place.
    m : ndarray
        (n,) estimate of the errors about the nominal, changed in place.
    H : ndarray
        (3, n) whitened derivative of the measurement.
    HP : ndarray
        (3, n) H P, whitened likewise; k_i / sqrt(s_i) afterwards.
    nu : ndarray
        (3, 1) whitened innovation of the nominal.
    used : int
        Number of leading columns of H that may differ from zero.
    K : ndarray
        (3, n) the gains k_i / s_i, filled in place.
    S, y : ndarray
        (3,) innovation variances s_i and innovations, filled in place.
    cross : ndarray
        (9, n) covariance of the latest event's navigation error with the errors now.
    track_cross : bool
        Whether `cross` is updated as well.
    T : ndarray
        (3, 9) scratch.
    """
    n = P.shape[0]
    h1, h2 = H[1], H[2]
    k1, k2 = HP[1], HP[2]
    if track_cross:
        T[:] = 0.0
        t0, t1, t2 = T[0], T[1], T[2]
        for k in range(used):
            a, b, c = H[0, k], h1[k], h2[k]
            if a != 0.0 or b != 0.0 or c != 0.0:
                for r in range(N_NAV):
                    t = cross[r, k]
                    t0[r] += t * a
                    t1[r] += t * b
                    t2[r] += t * c
    for i in range(3):
        h, own, gain = H[i], HP[i], K[i]
        s, d, of_1, of_2 = 1.0, nu[i, 0], 0.0, 0.0
        for k in range(used):
            t = own[k]
            s += h[k] * t
            d -= h[k] * m[k]
            of_1 += h1[k] * t
            of_2 += h2[k] * t
        S[i], y[i] = s, d
        inv = 1.0 / s
        root, d, of_1, of_2 = np.sqrt(inv), d * inv, of_1 * inv, of_2 * inv
        for r in range(n):
            t = own[r]
            m[r] += t * d
            gain[r] = t * inv
        if i == 0:
            for r in range(n):
                k1[r] -= of_1 * own[r]
            for r in range(N_NAV):
                T[1, r] -= of_1 * T[0, r]
        if i < 2:
            for r in range(n):
                k2[r] -= of_2 * own[r]
            for r in range(N_NAV):
                T[2, r] -= of_2 * T[i, r]
        for r in range(n):
            own[r] *= root
    take_off(HP, HP, n, P)
    if track_cross:
        take_off(T, K, n, cross)


@njit(cache=True, allocates=False)
def is_scalar(H, used):
    """Tell whether a triple has its first row alone.

    Parameters
    ----------
    H : ndarray
        (3, k) derivative of the measurement.
    used : int
        Number of leading columns of H that may differ from zero.

    Returns
    -------
    bool
        Whether rows 1 and 2 are zero.
    """
    h1, h2 = H[1], H[2]
    largest = 0.0
    for k in range(used):
        largest = max(largest, abs(h1[k]), abs(h2[k]))
    return largest == 0.0


@njit(cache=True, allocates=False)
def scalar_update(P, m, H, HP, nu, used, K, S, y, cross, track_cross, T):
    """Update as `triple_update` does, where the triple has its first row alone (`is_scalar`).

    Parameters
    ----------
    P, m : ndarray
        (n, n) covariance and (n,) estimate of the errors, changed in place.
    H, HP : ndarray
        (3, n) whitened derivative, and H P.
    nu : ndarray
        (3, 1) whitened innovation of the nominal.
    used : int
        Number of leading columns of H that may differ from zero.
    K, S, y : ndarray
        (3, n) gains, (3,) innovation variances and innovations, filled in place; rows 1 and 2 as of
        a measurement that says nothing.
    cross : ndarray
        (9, n) covariance of the latest event's navigation error with the errors now.
    track_cross : bool
        Whether `cross` is updated as well.
    T : ndarray
        (3, 9) scratch.
    """
    n = P.shape[0]
    h, k0, gain, t0 = H[0], HP[0], K[0], T[0]
    K[1:], S[1:], y[1:] = 0.0, 1.0, 0.0
    s, d = 1.0, nu[0, 0]
    for k in range(used):
        s += k0[k] * h[k]
        d -= m[k] * h[k]
    S[0], y[0] = s, d
    inv = 1.0 / s
    d *= inv
    for r in range(n):
        gain[r] = k0[r] * inv
        m[r] += k0[r] * d
    for r in range(n):
        t, row = k0[r], P[r]
        for k in range(n):
            row[k] -= t * k0[k] * inv
    if track_cross:
        t0[:] = 0.0
        for k in range(used):
            if h[k] != 0.0:
                for r in range(N_NAV):
                    t0[r] += cross[r, k] * h[k]
        for r in range(N_NAV):
            t, row = t0[r], cross[r]
            for k in range(n):
                row[k] -= t * gain[k]


@njit(cache=True, allocates=False)
def feed_back(nav, x, m):
    """Move the error estimate into the nominal state (K.5), and set it to zero.

    Parameters
    ----------
    nav : ndarray
        (10,) nominal position (m), velocity (m/s) and quaternion q_lb in l, changed in place.
    x : ndarray
        (ns,) nominal values of the other states, changed in place.
    m : ndarray
        (n,) estimate of the errors about the nominal, changed in place.
    """
    for i in range(PSI0):
        nav[i] += m[i]
    rotate_left(nav, m[AX], m[AY], m[AZ])
    for s in range(x.size):
        x[s] += m[IMU0 + s]
    m[:] = 0.0


@njit(cache=True, allocates=False)
def state_difference(nav_a, x_a, nav_b, x_b, out):
    """Compute the difference a minus b of two states as an error vector.

    It is such that a = b + out; for the attitude q_a = exp(out) q_b.

    Parameters
    ----------
    nav_a, x_a : ndarray
        (10,) and (ns,) the state a.
    nav_b, x_b : ndarray
        (10,) and (ns,) the state b.
    out : ndarray
        (n,) the difference, filled in place.
    """
    for i in range(PSI0):
        out[i] = nav_a[i] - nav_b[i]
    w, x, y, z = nav_b[QW], -nav_b[QX], -nav_b[QY], -nav_b[QZ]
    a, b, c, d = nav_a[QW], nav_a[QX], nav_a[QY], nav_a[QZ]
    qw = a * w - b * x - c * y - d * z
    qx = a * x + b * w + c * z - d * y
    qy = a * y - b * z + c * w + d * x
    qz = a * z + b * y - c * x + d * w
    if qw < 0.0:
        qw, qx, qy, qz = -qw, -qx, -qy, -qz
    s = np.sqrt(qx * qx + qy * qy + qz * qz)
    k = 2.0 if s < 1e-10 else 2.0 * np.arctan2(s, qw) / s
    out[AX], out[AY], out[AZ] = k * qx, k * qy, k * qz
    for s in range(x_a.size):
        out[IMU0 + s] = x_a[s] - x_b[s]
