"""The update (K): innovation gate, scalar update, covariance reset, feedback."""

import numpy as np

from ...base.compilation import njit
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
    for j in range(A.shape[1]):
        for r in range(3):
            t = A[r, j]
            for k in range(r):
                t -= L[r, k] * A[k, j]
            A[r, j] = t / L[r, r]


@njit(cache=True, allocates=False)
def innovation_test(P, H, nu, m, R, used, S, L, PH, out):
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
    PH : ndarray
        (n,) scratch.
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
    for c in range(3):
        PH[:] = 0.0
        for k in range(used):  # P is symmetric, and most of H is zero
            t = H[c, k]
            if t != 0.0:
                row = P[k]
                for i in range(PH.size):
                    PH[i] += t * row[i]
        for r in range(c, 3):
            t = R[r, c]
            for i in range(used):
                if H[r, i] != 0.0:
                    t += H[r, i] * PH[i]
            S[r, c] = t
            S[c, r] = t
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
def scalar_update(P, m, h, nu, used, K, cross, track_cross):
    """Update mean and covariance with one scalar measurement of unit variance (K.4), in place.

    K[r] K[c] is the same product either way round, so that P stays symmetric.

    Parameters
    ----------
    P : ndarray
        (n, n) covariance of the errors, changed in place.
    m : ndarray
        (n,) estimate of the errors about the nominal, changed in place.
    h : ndarray
        (n,) whitened derivative of the measurement.
    nu : float
        Whitened innovation of the nominal.
    used : int
        Number of leading columns of h that may differ from zero.
    K : ndarray
        (n,) the gain, filled in place.
    cross : ndarray
        (9, n) covariance of the latest event's navigation error with the errors now.
    track_cross : bool
        Whether `cross` is updated as well.

    Returns
    -------
    tuple of float
        Innovation variance and innovation of the scalar.
    """
    n = P.shape[0]
    S = 1.0
    K[:] = 0.0
    for k in range(used):  # P is symmetric, and most of h is zero
        t = h[k]
        if t != 0.0:
            row = P[k]
            for c in range(n):
                K[c] += t * row[c]
    y = nu
    for k in range(used):
        S += h[k] * K[k]
        y -= h[k] * m[k]
    inv = 1.0 / S
    root = np.sqrt(inv)
    for r in range(n):
        m[r] += K[r] * inv * y
        K[r] *= root
    for r in range(n):
        t = K[r]
        row = P[r]
        for c in range(n):
            row[c] -= t * K[c]
    for r in range(n):
        K[r] *= root
    if track_cross:
        for r in range(N_NAV):
            t = 0.0
            for k in range(used):
                t += cross[r, k] * h[k]
            for c in range(n):
                cross[r, c] -= t * K[c]
    return S, y


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
