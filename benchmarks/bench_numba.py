"""A bare pipeline in numba as the yardstick of speed: what one writes who needs one estimate.

    python benchmarks/bench_numba.py [--minutes 15] [--repeats 5]

Error-state Kalman filter with feedback and a modified Bryson-Frazier smoother, the states of the
layout (30 of the NavChip) and their whole smoothed covariance at every epoch, of a flight that
begins in the air. Given are the body increments and the start, which insgnss finds itself. Phi and
Q are of blocks of 50 ms, products are those of BLAS; no gate, no robust weights, no
checks, no lever arm or clock among the states. The results are those of the same optimum: the
largest difference is printed in sigmas. The bar is that insgnss, with its alignment, takes no more
than 0.75 times as long.
"""

import argparse

import numpy as np
from common import Case, block_flight, median_cpu, one_thread, processor
from numba import njit

from insgnss.geodesy.earth import normal_gravity
from insgnss.navigation.align.initial import initial_state
from insgnss.navigation.filter.problem import InitialState
from insgnss.navigation.filter.solution import Solution, solve
from insgnss.navigation.filter.strapdown import nav_difference
from insgnss.records import Array

BAR = 0.75
BLOCK_S = 0.05  # of Phi and Q
GRADIENT_STEP_M = 100.0  # over which the gradient of gravity is differenced
FEEDBACK_RAD = np.radians(1.0)  # sigma of the heading from which on errors are fed back
LARGEST_DIFFERENCE = 0.05  # sigmas, of two discretisations of one optimum


def main() -> None:
    one_thread()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=15.0)
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args()
    case = block_flight(options.minutes, start_in_air=True)
    problem, start = case.problem, initial_state(case.problem).start
    inputs = given(case, start)
    solution = solve(problem, start, "off", rows=problem.epochs.stop.size)
    nav, sigma = smoothed(*inputs)
    difference = off(solution, nav, sigma)
    assert difference < LARGEST_DIFFERENCE, f"another optimum: {difference:.2g} sigmas"

    us = 1e6 / case.samples
    theirs = us * median_cpu(lambda: smoothed(*inputs), options.repeats)
    own = us * median_cpu(lambda: solve(problem, start), options.repeats)
    both = us * median_cpu(lambda: solve(problem, initial_state(problem).start), options.repeats)
    print(processor())
    print(
        f"{case.samples} samples, {problem.epochs.stop.size} epochs, {problem.layout.size} states;"
        f" CPU microseconds a sample, medians of {options.repeats}"
    )
    print(f"  largest difference of results {difference:.2g} sigma")
    print(f"  numba, all covariances      {theirs:6.3f}")
    print(f"  insgnss, solve              {own:6.3f}   ratio {own / theirs:.2f}")
    print(f"  insgnss, alignment + solve  {both:6.3f}   ratio {both / theirs:.2f} (bar: {BAR})")


def given(case: Case, start: InitialState) -> tuple[Array, ...]:
    """Return the arguments of `smoothed`: increments, fixes, gravity, states and start."""
    problem = case.problem
    inc, ep, layout, frame = problem.inc, problem.epochs, problem.layout, problem.frame
    at = np.vstack([np.zeros(3), GRADIENT_STEP_M * np.eye(3)])
    lat, lon, h = frame.geodetic_from_position(at)
    g = frame.C_ln(lat, lon)[:, :, 2] * normal_gravity(lat, h)[:, None]
    gravity = np.ascontiguousarray(np.vstack([g[0], ((g[1:] - g[0]) / GRADIENT_STEP_M).T]))
    cov = np.where(ep.has_position[:, None, None], ep.position_cov, np.eye(3))
    whitened = np.linalg.inv(np.linalg.cholesky(cov))
    states = np.column_stack([layout.channel, layout.beta, layout.drive])
    return (
        *(inc.dt, inc.dtheta, inc.dvel, ep.stop, ep.has_position, ep.position, whitened),
        *(gravity, np.array(frame.earth_rate_l), np.array(problem.antenna_lever_b)),
        *(states, np.array(layout.white), start.nav, start.x, start.mean, start.P),
    )


def off(solution: Solution, nav: Array, sigma: Array) -> float:
    """Return the largest difference of navigation states from insgnss's, in its sigmas, and of
    the sigmas themselves.
    """
    own = np.sqrt(np.diagonal(solution.nav_covariance(), axis1=1, axis2=2))
    moved = np.abs(nav_difference(nav, solution.nav)) / own
    return float(max(moved.max(), np.abs(sigma[:, :9] / own - 1.0).max()))


@njit(cache=True, fastmath={"contract"})
def rotated(q, x, y, z):
    """Return q exp([x y z]), normalised."""
    a = np.sqrt(x * x + y * y + z * z)
    k = 0.5 if a < 1e-8 else np.sin(0.5 * a) / a
    w, x, y, z = np.cos(0.5 * a), k * x, k * y, k * z
    u, i, j, k = q
    out = np.array((u * w - i * x - j * y - k * z, u * x + i * w + j * z - k * y, 0.0, 0.0))
    out[2], out[3] = u * y - i * z + j * w + k * x, u * z + i * y - j * x + k * w
    return out / np.sqrt((out * out).sum())


@njit(cache=True, fastmath={"contract"})
def matrix(q):
    """Return the rotation matrix of a quaternion."""
    w, x, y, z = q
    C = np.empty((3, 3))
    C[0] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    C[1] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    C[2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)
    return C


@njit(cache=True)
def corrected(nav, d):
    """Add errors to the nominal in place, psi from the left."""
    nav[:6] += d[:6]
    back = np.dot(matrix(nav[6:]).T, d[6:9])
    nav[6:] = rotated(nav[6:], back[0], back[1], back[2])


@njit(cache=True)
def cross(a):
    """Return [a x]."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


@njit(cache=True, fastmath={"contract"})
def block(dt, dtheta, dvel, first, last, nav, bias, gravity, omega):
    """Integrate over a block in place; return the velocity gained, and C in the middle."""
    gained, q = np.zeros(3), nav[6:].copy()
    half = matrix(q)
    for i in range(first, last):
        h = dt[i]
        d0 = dtheta[i, 0] - bias[0] * h
        d1 = dtheta[i, 1] - bias[1] * h
        d2 = dtheta[i, 2] - bias[2] * h
        q = rotated(q, 0.5 * d0, 0.5 * d1, 0.5 * d2)
        C = matrix(q)
        step = np.zeros(3)
        for r in range(3):
            for k in range(3):
                step[r] += C[r, k] * (dvel[i, k] - bias[3 + k] * h)
        back = -(C.T @ omega) * h
        q = rotated(q, 0.5 * d0, 0.5 * d1, 0.5 * d2)
        q = rotated(q, back[0], back[1], back[2])
        if i == (first + last) // 2:
            half = C
        v = nav[3:6].copy()
        pull = gravity[0] + gravity[1:] @ nav[:3] - 2.0 * np.cross(omega, v + 0.5 * step)
        nav[3:6] += step + pull * h
        nav[:3] += 0.5 * h * (v + nav[3:6])
        gained += step
    nav[6:] = q
    return gained, half


@njit(cache=True, fastmath={"contract"})
def transition(B, gained, C, states, white, gravity, omega):
    """Return Phi = [F; 0 D] of a block, and Q by its upper 9 rows and the diagonal below."""
    n = 9 + len(states)
    F, D, W, q = np.zeros((9, n)), np.zeros(n - 9), np.zeros((9, n)), np.zeros(n - 9)
    S, O, SC, column = cross(gained), cross(omega), np.zeros((3, 3)), np.zeros((9, 6))
    SC[:] = S @ C
    for i in range(9):
        F[i, i] = 1.0
    for i in range(3):
        F[i, 3 + i] = B
        for k in range(3):
            F[i, 6 + k], F[3 + i, 6 + k] = -0.5 * B * S[i, k], -S[i, k]
            F[3 + i, k] = B * gravity[1 + i, k]
            F[3 + i, 3 + k] -= 2.0 * B * O[i, k]
            F[6 + i, 6 + k] -= B * O[i, k]
            column[i, k], column[3 + i, k] = SC[i, k] * (B * B / 6), SC[i, k] * (B / 2)
            column[6 + i, k] = column[3 + i, 3 + k] = -B * C[i, k]
            column[i, 3 + k] = -0.5 * B * B * C[i, k]
    for c in range(6):
        for r in range(9):
            t = white[c] / B * column[r, c]
            for k in range(9):
                W[r, k] += t * column[k, c]
    for s in range(n - 9):
        c, beta, drive = int(states[s, 0]), states[s, 1], states[s, 2]
        D[s] = np.exp(-beta * B)
        q[s] = drive * (B if beta == 0.0 else (1 - D[s] * D[s]) / (2 * beta))
        for r in range(9):
            F[r, 9 + s] = column[r, c]
            W[r, 9 + s] = 0.5 * q[s] * column[r, c]
    return F, D, W, q


@njit(cache=True, fastmath={"contract"})
def predicted(P, F, D, W, q):
    """Predict a covariance in place."""
    n = len(P)
    top = np.dot(F, P)
    P[:9, :9] = np.dot(top, F.T) + W[:, :9]
    for r in range(9):
        for s in range(9, n):
            P[r, s] = P[s, r] = top[r, s] * D[s - 9] + W[r, s]
    for s in range(9, n):
        for k in range(9, n):
            P[s, k] *= D[s - 9] * D[k - 9]
        P[s, s] += q[s - 9]


@njit(cache=True, fastmath={"contract"})
def before(Lam, lam, F, D):
    """Take what later data say to the epoch before, in place."""
    n = len(lam)
    top = np.dot(F.T, Lam[:9])  # Phi' Lam, whose upper rows of navigation alone are dense
    new = np.empty((n, n))
    whole = np.dot(np.ascontiguousarray(top[:, :9]), F)
    for r in range(n):
        for c in range(n):
            new[r, c] = whole[r, c]
            new[r, c] += top[r, c] * D[c - 9] if c >= 9 else 0.0
            new[r, c] += top[c, r] * D[r - 9] if r >= 9 else 0.0
            new[r, c] += D[r - 9] * D[c - 9] * Lam[r, c] if min(r, c) >= 9 else 0.0
    Lam[:] = 0.5 * (new + new.T)
    l = np.dot(F.T, lam[:9])
    l[9:] += D * lam[9:]
    lam[:] = l


@njit(cache=True, fastmath={"contract"})
def smoothed(
    dt, dtheta, dvel, stop, has, position, whitened, gravity, omega, lever, states, white,
    nav0, x0, d0, P0,
):  # fmt: skip
    """Return the smoothed navigation states (m, 10) and the sigmas (m, n) of all states."""
    m, n = stop.size, P0.shape[0]
    nav, x, P = nav0.copy(), x0.copy(), P0.copy()
    every_nav, every_P = np.empty((m, 10)), np.empty((m, n, n))
    every_F, every_D = np.zeros((m, 9, n)), np.ones((m, n - 9))
    every_H, every_K = np.zeros((m, 3, n)), np.zeros((m, 3, n))
    every_S, every_y = np.zeros((m, 3)), np.zeros((m, 3))
    bias, every_sigma, every_d = np.zeros(6), np.empty((m, n)), np.empty((m, n))
    d, fed_back = d0.copy(), False
    for e in range(m):
        if e > 0:
            first, total, decay = stop[e - 1], np.eye(n)[:9], every_D[e]
            span = dt[first : stop[e]].sum()
            blocks = max(1, int(np.ceil(span / BLOCK_S - 1e-6)))
            for b in range(blocks):
                last = stop[e - 1] + (stop[e] - stop[e - 1]) * (b + 1) // blocks
                bias[:] = 0.0
                B = dt[first:last].sum()
                for s in range(n - 9):  # the mean over the block
                    bias[int(states[s, 0])] += x[s] * np.exp(-0.5 * states[s, 1] * B)
                gained, C = block(dt, dtheta, dvel, first, last, nav, bias, gravity, omega)
                x *= np.exp(-states[:, 1] * B)
                F, D, W, q = transition(B, gained, C, states, white, gravity, omega)
                predicted(P, F, D, W, q)
                total = np.dot(np.ascontiguousarray(F[:, :9]), total)
                total[:, 9:] += F[:, 9:] * decay
                decay *= D
                first = last
            d[:9], d[9:] = np.dot(total, d), decay * d[9:]
            every_F[e] = total
        if has[e]:
            arm = matrix(nav[6:]) @ lever
            H = np.zeros((3, n))
            H[:, 0:3] = whitened[e]
            H[:, 6:9] = -whitened[e] @ cross(arm)
            nu = whitened[e] @ (position[e] - nav[:3] - arm)
            for i in range(3):
                k = np.dot(P, H[i])
                S = np.dot(H[i], k) + 1.0
                y = nu[i] - np.dot(H[i], d)
                d += k * (y / S)
                for a in range(n):
                    P[a] -= k[a] / S * k
                every_H[e, i], every_K[e, i], every_S[e, i], every_y[e, i] = H[i], k / S, S, y
            fed_back = fed_back or P[8, 8] < FEEDBACK_RAD**2
            if fed_back:
                corrected(nav, d)
                x += d[9:]
                d[:] = 0.0
        every_nav[e], every_P[e], every_d[e] = nav, P, d
    lam, Lam = np.zeros(n), np.zeros((n, n))
    for e in range(m - 1, -1, -1):
        P = every_P[e]
        cov = P - np.dot(np.dot(P, Lam), P)
        every_sigma[e] = np.sqrt(np.diag(cov))
        corrected(every_nav[e], every_d[e] + np.dot(P, lam))
        for i in range(2, -1, -1):
            if every_S[e, i] > 0.0:
                h, k, S = every_H[e, i], every_K[e, i], every_S[e, i]
                g = np.dot(Lam, k)
                t = np.dot(k, g) + 1 / S
                for a in range(n):
                    Lam[a] += (h[a] * t - g[a]) * h - h[a] * g
                lam = lam + h * (every_y[e, i] / S - np.dot(k, lam))
        if e > 0:
            before(Lam, lam, every_F[e], every_D[e])
    return every_nav, every_sigma


if __name__ == "__main__":
    main()
