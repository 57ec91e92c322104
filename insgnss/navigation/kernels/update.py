"""The update (K): innovation gate, scalar update, covariance reset, feedback."""

import numpy as np

from ...base.compilation import njit
from ..codes import AX, AY, AZ, IMU0, N_NAV, PSI0, QW, QX, QY, QZ, VEL0
from .error_model import GRAVITY
from .strapdown import rotate_left

LARGEST_TILT_VARIANCE = 3e-4  # rad^2, a degree: what a covariance reset adds to psi at most


@njit(cache=True)
def cholesky3(R, L):
    """Lower Cholesky factor of a 3 x 3; False where it is not positive definite."""
    for r in range(3):
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


@njit(cache=True)
def forward_solve3(L, A):
    """A <- L^-1 A for A (3, m)."""
    for j in range(A.shape[1]):
        for r in range(3):
            t = A[r, j]
            for k in range(r):
                t -= L[r, k] * A[k, j]
            A[r, j] = t / L[r, r]


@njit(cache=True)
def innovation_test(P, H, nu, m, R, used, S, L, out):
    """Normalised innovation squared of a triple; raw innovation and its sigma into out (2, 3)."""
    for r in range(3):
        t = nu[r, 0]
        for k in range(used):
            t -= H[r, k] * m[k]
        out[0, r] = t
    for r in range(3):
        for c in range(r + 1):
            t = R[r, c]
            for i in range(used):
                if H[r, i] != 0.0:
                    a = 0.0
                    for k in range(used):
                        a += P[i, k] * H[c, k]
                    t += H[r, i] * a
            S[r, c] = t
            S[c, r] = t
    if not cholesky3(S, L):
        return np.inf
    y0 = out[0, 0] / L[0, 0]
    y1 = (out[0, 1] - L[1, 0] * y0) / L[1, 1]
    y2 = (out[0, 2] - L[2, 0] * y0 - L[2, 1] * y1) / L[2, 2]
    for r in range(3):
        out[1, r] = np.sqrt(S[r, r])
    return y0 * y0 + y1 * y1 + y2 * y2


@njit(cache=True)
def reset_covariance(P, innovation, since_s):
    """(K.7): open P by an innovation (3,), and by what makes it within `since_s`."""
    for i in range(3):
        d = innovation[i]
        P[i, i] += d * d
        P[VEL0 + i, VEL0 + i] += (d / since_s) ** 2
    d = (innovation[0] ** 2 + innovation[1] ** 2) / (0.5 * GRAVITY * since_s * since_s) ** 2
    d = min(d, LARGEST_TILT_VARIANCE)
    for i in range(PSI0, N_NAV):
        P[i, i] += d


@njit(cache=True)
def scalar_update(P, m, h, nu, used, K, cross, track_cross):
    """(K.4) with one scalar of unit variance: gain into K; returns innovation variance, innovation.

    K[r] K[c] is the same product either way round, so that P stays symmetric.
    """
    n = P.shape[0]
    S = 1.0
    for r in range(n):
        t = 0.0
        for k in range(used):
            t += P[r, k] * h[k]
        K[r] = t
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


@njit(cache=True)
def feed_back(nav, x, m):
    """(K.5): move the error estimate into the nominal state."""
    for i in range(PSI0):
        nav[i] += m[i]
    rotate_left(nav, m[AX], m[AY], m[AZ])
    for s in range(x.size):
        x[s] += m[IMU0 + s]
    m[:] = 0.0


@njit(cache=True)
def state_difference(nav_a, x_a, nav_b, x_b, out):
    """out = a minus b as an error vector: a = b + out, for attitude q_a = exp(out) q_b."""
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
