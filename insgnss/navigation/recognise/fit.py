"""The fit of propagated specific force to the accelerations of GNSS: time offset and sign.

All lags are scanned by Wahba's problem; least squares then fit the lag to the millisecond.
Mathematics: the package's docstring, (R.4) to (R.7).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...geodesy.rotation import rotation_from_vector, skew
from ...records import Array
from ...records.variances import MAD_TO_SIGMA
from ._kernels import differences, scan
from .signal import LEAST_WINDOW_ROWS, Accelerations, PropagatedForce

# of the logarithms of likelihood ratios: residuals are time-correlated and not normal
CAUTION = 0.1
# a survey repeats itself line by line: a lag beyond the first is a priori less likely by this
USUAL_S, UNUSUAL = 1.0, -4.0
MEAN_LEAP_S, LEAP_TOLERANCE_S, LEAP = 17.0, 1.6, -1.0  # one of the leap seconds since 2012 less so
RUN_SPANS = 2.0  # of the differences, that the lag may move from where the scan found it
# of the least squares, and of Student's distribution of the residuals
MOST_FIT_STEPS, FREEDOM = 8, 4.0
LEVER, SCALE_OF_FORCE, GYRO_BIAS = slice(1, 4), slice(4, 5), slice(5, 8)  # the lag comes first
PRIOR_SIGMAS = np.array([2.0, 0.4, 0.4, 0.4, 0.3, 0.01, 0.01, 0.01])  # s, m, 1, rad/s


@dataclass(frozen=True, eq=False)
class Scan:
    """Fit at each of n lags.

    Parameters
    ----------
    acc : Accelerations
    lags : ndarray, shape (n,), s
    score : ndarray, shape (n,)
        Explained share of the GNSS accelerations; -inf where too few overlap.
    up, down : ndarray, shape (n,)
        That share if the force is specific force, or its reverse (R.4).
    samples : ndarray, shape (n,)
        Number of independent values behind the score.
    any_clock : bool
        Whether no lag is more usual than another.
    """

    acc: Accelerations
    lags: Array
    score: Array
    up: Array
    down: Array
    samples: Array
    any_clock: bool = False

    @cached_property
    def posterior(self) -> Array:
        """Logarithm of the posterior (R.5) of each lag, (n,): likelihood and how usual it is."""
        unusual = np.zeros(self.lags.size)
        if not self.any_clock:
            unusual[np.abs(self.lags) > USUAL_S] = UNUSUAL
            unusual[np.abs(np.abs(self.lags) - MEAN_LEAP_S) < LEAP_TOLERANCE_S] = LEAP
        left = np.maximum(1.0 - np.where(np.isfinite(self.score), self.score, 0.0), 1e-6)
        return np.where(
            np.isfinite(self.score), unusual - 0.5 * CAUTION * self.samples * np.log(left), -np.inf
        )

    @cached_property
    def best(self) -> int:
        """Index of the best lag."""
        return int(np.argmax(self.posterior))

    def margin(self, apart: float) -> float:
        """Return by how much, as a logarithm, the best lag exceeds all further than `apart`, s."""
        far = np.abs(self.lags - self.lags[self.best]) > apart
        return float(self.posterior[self.best] - self.posterior[far].max(initial=0.0))

    def gain(self) -> float:
        """Return the logarithm of the likelihood of the best lag against no relation at all."""
        return self.against(0.0)

    def against(self, other: float, score: float | None = None) -> float:
        """Return the logarithm of the likelihood of the best lag against a fit of score `other`.

        Its own score is another one where only one sign of the force is allowed.
        """
        score = float(self.score[self.best]) if score is None else score
        if not score > max(other, 0.0):
            return 0.0
        ratio = (1.0 - max(other, -1.0)) / max(1.0 - score, 1e-6)
        return float(0.5 * self.samples[self.best] * np.log(ratio))


def scan_lags(
    propagated: PropagatedForce, acc: Accelerations, lags: Array, any_clock: bool = False
) -> Scan:
    """Solve Wahba's problem in every window at every lag (R.4).

    Parameters
    ----------
    propagated : PropagatedForce
    acc : Accelerations
    lags : ndarray, shape (n,), s
    any_clock : bool
        Whether no lag is more usual than another.

    Returns
    -------
    Scan
    """
    grid = propagated.grid
    of_positions = acc.kind == "position"
    X = propagated.S if of_positions else propagated.V
    dX = propagated.V if of_positions else propagated.force
    out = np.zeros((lags.size, acc.window.max(initial=0) + 1, 16))
    rows = acc.nodes, acc.coef, acc.z, acc.weight, acc.window
    steps, scratch = (grid.broken, grid.start, grid.step), (np.empty(3), np.empty(3))
    scan(*rows, lags, X, dX, *steps, *scratch, out)
    M, z = out[..., :9].reshape(*out.shape[:2], 3, 3), out[..., 11:14]
    zz, aa, weight, count = (out[..., k] for k in (9, 10, 14, 15))
    use = count >= LEAST_WINDOW_ROWS
    larger, least = _singular_values(M)
    sums = (larger + np.abs(least), larger + least, larger - least)
    left = [np.where(use, zz - s**2 / np.maximum(aa, 1e-300), 0.0).sum(axis=1) for s in sums]
    whole = np.where(use, zz - np.sum(z**2, axis=2) / np.maximum(weight, 1e-300), 0.0).sum(axis=1)
    covered = np.where(use, weight, 0.0).sum(axis=1)
    spacing = float(np.median(np.diff(acc.time))) if acc.time.size > 1 else 1.0
    independent = 3.0 * covered * min(spacing / acc.span_s, 1.0)
    samples = np.maximum(independent - 4.0 * use.sum(axis=1), 0.0)
    score, up, down = (
        np.where(covered > 0.5 * acc.weight.sum(), 1.0 - x / np.maximum(whole, 1e-300), -np.inf)
        for x in left
    )
    return Scan(acc, lags, score, up, down, samples, any_clock)


def _singular_values(M: Array) -> tuple[Array, Array]:
    """Sum of the two larger singular values of matrices (..., 3, 3), and the least.

    The least has the sign of the determinant. The squares are the eigenvalues of M' M, by the
    trigonometric solution of its cubic (Smith, 1961); they are good to 1e-7 of the largest, which
    is more than a score needs, and ten times as fast as to have them exactly.
    """
    a, b, c = np.moveaxis(M, -1, 0)
    aa, bb, cc = (np.einsum("...i,...i", v, v) for v in (a, b, c))
    ab, ac, bc = (np.einsum("...i,...i", v, w) for v, w in ((a, b), (a, c), (b, c)))
    det = np.einsum("...i,...i", a, np.cross(b, c))
    mean = (aa + bb + cc) / 3.0
    x, y, z = aa - mean, bb - mean, cc - mean
    spread = np.sqrt((x * x + y * y + z * z + 2.0 * (ab * ab + ac * ac + bc * bc)) / 6.0)
    half = x * (y * z - bc * bc) - ab * (ab * z - bc * ac) + ac * (ab * bc - y * ac)
    cosine = 0.5 * half / np.maximum(spread**3, 1e-300)
    angle = np.arccos(np.clip(cosine, -1.0, 1.0)) / 3.0
    first = mean + 2.0 * spread * np.cos(angle)
    # the other two by their sum and product, which a root close to another would spoil
    both = np.maximum(3.0 * mean - first, 0.0)
    apart = np.sqrt(np.maximum(both**2 - 4.0 * det**2 / np.where(first > 0.0, first, 1.0), 0.0))
    largest, second = np.sqrt(np.maximum(first, 0.0)), np.sqrt(0.5 * (both + apart))
    product = largest * second
    least = det / np.where(product > 0.0, product, 1.0)
    return largest + second, np.clip(least, -second, second)


@dataclass(frozen=True, eq=False)
class RecognitionFit:
    """Least squares at the end (R.6): m rows in w windows.

    Parameters
    ----------
    theta, cov : ndarray, shape (8,) and (8, 8)
        Of lag s, lever arm m (IMU axes), relative gyro scale error, gyro bias rad/s.
    C : ndarray, shape (w, 3, 3)
        Axes 0 into north, east, down, of each window.
    yaw_sigma : ndarray, shape (w,), rad
    used : ndarray of bool
        The rows of the accelerations that lie inside the recording.
    seen, felt : ndarray, shape (m, 3), m/s^2
        z, and what the IMU makes of it, north, east, down.
    middle : ndarray of int, shape (m,)
        Row of the grid of the propagated force.
    turned : ndarray, shape (m, 3), rad
        Rotation vector by which the gyro errors turn each row.
    sigma : ndarray, shape (3,), m/s^2
        Typical residuals.
    sign : int
        Sign of the force.
    """

    theta: Array
    cov: Array
    C: Array
    yaw_sigma: Array
    used: NDArray[np.bool_]
    seen: Array
    felt: Array
    middle: NDArray[np.int64]
    turned: Array
    sigma: Array
    sign: int

    @property
    def lag_sigma(self) -> float:
        """Standard deviation of the lag, s."""
        return float(np.sqrt(self.cov[0, 0]))


class _Model:
    """Rows of the least squares (R.6) and their derivatives."""

    def __init__(self, propagated: PropagatedForce, acc: Accelerations, sign: int) -> None:
        self.propagated, self.acc, self.sign = propagated, acc, sign
        if acc.kind == "position":
            self.X, self.dX, self.E = propagated.S, propagated.V, propagated.C
        else:
            self.X, self.dX, self.E = propagated.V, propagated.force, propagated.C_rate

    def inside(self, lag: float) -> NDArray[np.bool_]:
        grid = self.propagated.grid
        first = self.acc.nodes[:, 0] + lag - grid.start
        last = self.acc.nodes[:, 2] + lag - grid.start
        inside = (first >= 0.0) & (last <= grid.step * (grid.broken.size - 1))
        i, j = (
            np.clip((x / grid.step).astype(np.int64), 0, grid.broken.size - 2)
            for x in (first, last)
        )
        return inside & (grid.broken[j + 1] == grid.broken[i])

    def rows(
        self, theta: Array, use: NDArray[np.bool_]
    ) -> tuple[Array, Array, NDArray[np.int64], Array]:
        """u (k, 3) of (R.6), its derivative (k, 3, 8) by theta, grid row (k,) of the middles.

        The last value is the rotation (k, 3) by which gyro errors turn each row.
        """
        grid, lag = self.propagated.grid, theta[0]
        nodes, coef, window = self.acc.nodes[use], self.acc.coef[use], self.acc.window[use]
        k = len(nodes)
        a, da, D = np.empty((k, 3)), np.empty((k, 3)), np.empty((k, 3, 3))
        cell = (nodes + (lag - grid.start)) / grid.step
        differences(cell, coef, self.X, self.dX, self.E, grid.step, a, da, D)
        instants = 0.5 * (nodes[:, 0] + nodes[:, 2]) + lag - grid.start
        middle = np.rint(instants / grid.step).astype(np.int64)
        turn = _about_window_mean(self.propagated.turned[middle], window)
        drifted = self.propagated.drifted[middle].reshape(-1, 9)
        drift = _about_window_mean(drifted, window).reshape(-1, 3, 3)
        a, da = self.sign * a, self.sign * da
        turned = turn * theta[SCALE_OF_FORCE] + drift @ theta[GYRO_BIAS]
        R = rotation_from_vector(turned)
        a, da = np.einsum("nij,nj->ni", R, a), np.einsum("nij,nj->ni", R, da)
        cross = -skew(a)
        J = np.concatenate([da[:, :, None], D, (cross @ turn[:, :, None]), cross @ drift], axis=2)
        return a + D @ theta[LEVER], J, middle, turned


def _about_window_mean(x: Array, window: NDArray[np.int64]) -> Array:
    n = np.bincount(window)
    sums = np.column_stack([np.bincount(window, column) for column in x.T])
    return x - (sums / np.maximum(n, 1)[:, None])[window]


def _wahba(z: Array, a: Array, weight: Array, window: NDArray[np.int64], windows: int) -> Array:
    """Proper rotation (w, 3, 3) of each window that takes a to z."""
    M = np.zeros((windows, 3, 3))
    np.add.at(M, window, weight[:, None, None] * z[:, :, None] * a[:, None, :])
    U, _, Vt = np.linalg.svd(M)
    U[:, :, 2] *= np.where(np.linalg.det(U @ Vt) < 0.0, -1.0, 1.0)[:, None]
    return U @ Vt


def fit(
    propagated: PropagatedForce, acc: Accelerations, lag: float, sign: int
) -> RecognitionFit | None:
    """Fit by least squares (R.6) from a lag of the scan on.

    Parameters
    ----------
    propagated : PropagatedForce
    acc : Accelerations
    lag : float, s
        The lag to start from.
    sign : int
        Sign of the force.

    Returns
    -------
    RecognitionFit or None
        None where the lag runs away from its start, or out of the recording.
    """
    model = _Model(propagated, acc, sign)
    theta = np.zeros(8)
    theta[0] = lag
    windows = int(acc.window.max()) + 1
    C = np.empty((0, 3, 3))
    for _ in range(MOST_FIT_STEPS):
        use = model.inside(theta[0])
        if use.sum() < LEAST_WINDOW_ROWS or abs(theta[0] - lag) > RUN_SPANS * acc.span_s:
            return None
        u, J, middle, turned = model.rows(theta, use)
        window, z = acc.window[use], acc.z[use]
        if not len(C):
            C = _wahba(z, u, acc.weight[use], window, windows)
        felt = np.einsum("nij,nj->ni", C[window], u)
        r = z - felt
        robust = acc.weight[use]
        medians = [_weighted_median(column**2, robust) for column in r.T]
        north, east, down = MAD_TO_SIGMA * np.sqrt(np.array(medians))
        level = np.sqrt(0.5 * (north**2 + east**2))
        sigma = np.maximum(np.array([level, level, down]), 1e-3)
        robust = robust * (FREEDOM + 3.0) / (FREEDOM + np.sum((r / sigma) ** 2, axis=1) * robust)
        step, psi, H, g, yaw = _solve(J, C, felt, r, robust, sigma, window, theta)
        theta = theta + step
        C = rotation_from_vector(psi) @ C
        if abs(step[0]) < 2e-4 and np.abs(psi).max() < 1e-3:
            break
    overlap = max(acc.span_s / max(float(np.median(np.diff(acc.time))), 1e-3), 1.0)
    prior = np.diag(1.0 / PRIOR_SIGMAS**2)
    H0 = np.linalg.inv(H + prior)
    cluster = H0 @ (g.T @ g + prior) @ H0
    simple = np.linalg.inv(H / overlap + prior)
    cov = np.maximum(1.0, np.sqrt(np.diag(cluster) / np.diag(simple)))
    cov = cov[:, None] * simple * cov
    return RecognitionFit(
        theta, cov, C, np.sqrt(overlap) * yaw, use, z, felt, middle, turned, sigma, sign
    )


def _solve(
    J: Array,
    C: Array,
    felt: Array,
    r: Array,
    robust: Array,
    sigma: Array,
    window: NDArray[np.int64],
    theta: Array,
) -> tuple[Array, Array, Array, Array, Array]:
    """One step of theta (8,) and psi (w, 3), with what the covariance needs.

    That is the normal matrix (8, 8), the gradients (w, 8) of the windows and sigma of psi's down
    (w,).
    """
    n = C.shape[0]
    scale = np.sqrt(robust)[:, None] / sigma
    G = np.concatenate([-skew(felt), C[window] @ J], axis=2) * scale[:, :, None]
    y = r * scale
    H, b = np.diag(1.0 / PRIOR_SIGMAS**2), -theta / PRIOR_SIGMAS**2
    b = b * np.r_[0.0, np.ones(7)]
    H = H * np.r_[1e-6, np.ones(7)]
    N, v = np.zeros((n, 11, 11)), np.zeros((n, 11))
    edges = np.searchsorted(window, np.arange(n + 1))
    for k in range(n):
        A = G[edges[k] : edges[k + 1]].reshape(-1, 11)
        N[k], v[k] = A.T @ A, A.T @ y[edges[k] : edges[k + 1]].reshape(-1)
    N[:, range(3), range(3)] += 1.0
    P = np.linalg.inv(N[:, :3, :3])
    K = N[:, 3:, :3] @ P
    reduced = N[:, 3:, 3:] - K @ N[:, :3, 3:]
    g = v[:, 3:] - np.einsum("nij,nj->ni", K, v[:, :3])
    total = reduced.sum(axis=0)
    step = np.linalg.solve(H + total, b + g.sum(axis=0))
    psi = np.einsum("nij,nj->ni", P, v[:, :3] - N[:, :3, 3:] @ step)
    return step, psi, total, g, np.sqrt(P[:, 2, 2])


def _weighted_median(x: Array, weight: Array) -> float:
    order = np.argsort(x)
    c = np.cumsum(weight[order])
    return float(x[order][np.searchsorted(c, 0.5 * c[-1])])
