"""Filter and smoother against filterpy and against batch least squares on the very same linear problem.

Run about a fixed nominal (K.6) the problem is linear: x_k = Phi_k x_(k-1) + gap_k + noise, with gap_k the nominal of the epoch
before carried forward, less that of the epoch. The nominal is a smoothed flight, so the gaps are not zero. With c_k = Phi_k c_(k-1)
+ gap_k taken off, x - c obeys the same equations without gaps, which is what filterpy and the batch solution know.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from flown import NO_GATE, fly, start_near

from insgnss.navigation._kernels import measured_triple, state_difference
from insgnss.navigation.error_model import linearise_interval
from insgnss.navigation.filter import BLOCK_S, KINDS, STILL, WHEELS, Problem, Start, make_store, run_filter
from insgnss.navigation.layout import FixErrors, state_layout
from insgnss.navigation.smoother import Smoothed, run_smoother
from insgnss.navigation.solution import solve
from insgnss.navigation.strapdown import kernel_earth, kernel_segments
from insgnss.stochastic.model import load_noise_model

RELATIVE = 1e-8  # of the standard deviations; measured 1e-10
SIGMA = np.array([0.5, 0.5, 0.5, 0.3, 0.3, 0.3, *np.radians([1.0, 1.0, 5.0])])
OFFSET = np.array([0.1, -0.2, 0.1, 0.1, 0.1, -0.1, *np.radians([0.5, -0.3, 2.0])])


@dataclass(frozen=True, eq=False)
class LinearProblem:
    """Phi, Q (m, n, n) from the epoch before; c (m, n) (see above); mean (n,), P (n, n) at the first epoch; measurements of each epoch."""

    Phi: np.ndarray
    Q: np.ndarray
    c: np.ndarray
    mean: np.ndarray
    P: np.ndarray
    measured: list[list[tuple[np.ndarray, np.ndarray, np.ndarray]]]  # (H, z, R)


@dataclass(frozen=True, eq=False)
class Case:
    """What the package makes of the problem: filtered mean and covariance, smoothed, and the same problem in matrices."""

    problem: Problem
    filtered: np.ndarray
    filtered_P: np.ndarray
    smoothed: Smoothed
    linear: LinearProblem
    events: np.ndarray


def events_at(problem: Problem, at: np.ndarray) -> Problem:
    """The problem with camera events at epochs `at`, every third velocity left out, and some motion and stillness made up."""
    event = np.full(problem.inc.marks.size, -1, dtype=np.int64)
    event[at] = np.arange(at.size)
    has_velocity = problem.epochs.has_velocity.copy()
    has_velocity[::3] = False
    epochs, m = problem.epochs._replace(event=event, has_velocity=has_velocity), event.size
    motion, still = np.zeros(m, dtype=np.int64), np.zeros(m)
    motion[10::17], motion[15::23], still[20::19] = STILL, WHEELS, 1e-4
    cov = np.broadcast_to(np.diag([25.0, 9.0, 4.0]), (m, 3, 3)).copy()
    group = (np.arange(m) // 40) % 2
    return replace(
        problem, epochs=epochs._replace(motion=motion, motion_cov=cov, still_var=still, still_rate=problem.inc.rate.copy(), group=group)
    )


def measurements(problem: Problem, nav, x, k: int, accel) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    ep, n = problem.epochs, problem.layout.size
    imu, earth = problem.layout.kernel_model(BLOCK_S, problem.aiding_interval_s), kernel_earth(problem.frame)
    out = []
    for kind in range(KINDS):
        H, nu, R, C = np.zeros((3, n)), np.zeros((3, 2)), np.zeros((3, 3)), np.zeros((3, 3))
        scratch = C, np.zeros(3), np.zeros(n - 9)
        if measured_triple(kind, k, ep, nav, x, problem.antenna_lever_b, accel, imu, earth, *scratch, H, nu, R):
            out.append((H, nu[:, 0], R))
    return out


def in_matrices(problem: Problem, start: Start, nav, x) -> LinearProblem:
    """The problem about the nominal nav (m, 10), x (m, ns)."""
    m, n = nav.shape[0], problem.layout.size
    seg, earth = kernel_segments(problem.inc), kernel_earth(problem.frame)
    imu, ep = problem.layout.kernel_model(BLOCK_S, problem.aiding_interval_s), problem.epochs
    Phi, Q, c, gap, accel = np.zeros((m, n, n)), np.zeros((m, n, n)), np.zeros((m, n)), np.zeros(n), np.zeros((m, 3))
    for k in range(1, m):
        step = linearise_interval(seg, ep.stop[k - 1], ep.stop[k], nav[k - 1], x[k - 1], imu, earth, ep.time[k - 1])
        state_difference(step.nav, step.x, nav[k], x[k], gap)
        accel[k] = (step.nav[3:6] - nav[k - 1, 3:6]) / (ep.time[k] - ep.time[k - 1])
        Phi[k], Q[k] = step.Phi, 0.5 * (step.Q + step.Q.T)
        c[k] = Phi[k] @ c[k - 1] + gap
    state_difference(start.nav, start.x, nav[0], x[0], gap)
    return LinearProblem(Phi, Q, c, gap + start.mean, start.P, [measurements(problem, nav[k], x[k], k, accel[k]) for k in range(m)])


@pytest.fixture(scope="module")
def case() -> Case:
    """9 s at 10 Hz with velocities, errors of the fixes as states, motion constraints, a turn, and six events.

    Two of the events are on epochs with a fix, and two 17 ms apart.
    """
    fixes = FixErrors(0.3, 0.05, 1e-3, (0.8, 0.7, 0.6), 5.0, (0.6, 0.6, 0.7), 1.0, 30.0, 0.4)
    layout = state_layout(load_noise_model("navchip"), fixes=fixes)
    flown = fly(9.0, seed=5, layout=layout, velocity=True, gate=NO_GATE, extra=np.array([2.0333, 4.4, 6.0777, 6.0947, 6.1]))
    events = np.union1d(flown.event_epochs, flown.extra_epochs)
    problem = events_at(flown.problem, events)
    start = start_near(flown, SIGMA, OFFSET)
    start = replace(start, mean=0.3 * np.sqrt(np.diag(start.P)) * np.cos(np.arange(start.mean.size)))
    first = solve(problem, start, "off")
    store = make_store(problem.epochs, problem.layout)
    store.nav[:], store.x[:] = first.nav, first.x
    run_filter(problem, start, store, closed=False)
    linear = in_matrices(problem, start, store.nav, store.x)
    filtered, filtered_P = store.m.copy(), store.P.copy()
    return Case(problem, filtered, filtered_P, run_smoother(problem.epochs, store), linear, events)


@pytest.fixture(scope="module")
def by_filterpy(case) -> tuple[KalmanFilter, np.ndarray, np.ndarray]:
    """Means (m, n, 1), gaps taken off, and covariances of filterpy's filter, one predict an epoch and one update a triple."""
    linear = case.linear
    m, n = linear.c.shape
    kf = KalmanFilter(n, 3)
    kf.x, kf.P = linear.mean[:, None].copy(), linear.P.copy()
    means, covariances = np.zeros((m, n, 1)), np.zeros((m, n, n))
    for k in range(m):
        if k:
            kf.predict(F=linear.Phi[k], Q=linear.Q[k])
        for H, z, R in linear.measured[k]:
            kf.update((z - H @ linear.c[k])[:, None], R=R, H=H)
        means[k], covariances[k] = kf.x, kf.P
    return kf, means, covariances


def agree(mean, P, expected, expected_P) -> None:
    """Means within `RELATIVE` of their standard deviations, covariances within that of the product of two."""
    sigma = np.sqrt(np.diagonal(expected_P, axis1=1, axis2=2))
    assert np.abs((mean - expected) / sigma).max() < RELATIVE
    assert np.abs((P - expected_P) / (sigma[:, :, None] * sigma[:, None, :])).max() < RELATIVE


def test_the_problem_is_a_fair_one(case):
    """Oracle: what the comparison needs: gaps that are not zero, velocities at some epochs only, noise that differs by epoch."""
    assert np.abs(case.linear.c[-1, :3]).max() > 1e-3
    assert {len(rows) for rows in case.linear.measured} == {0, 1, 2, 3}
    assert case.events.size == 6
    assert np.linalg.matrix_rank(case.linear.Q[5]) < case.problem.layout.size
    first, last = np.diag(case.filtered_P[0]), np.diag(case.filtered_P[-1])
    assert (last[:9] < first[:9]).all()


def test_filter_is_filterpys(case, by_filterpy):
    """Oracle: filterpy KalmanFilter.predict and update (Joseph form)."""
    _, means, covariances = by_filterpy
    agree(case.filtered, case.filtered_P, means[..., 0] + case.linear.c, covariances)


def scaled_inverse(P):
    """Inverse by way of the correlation matrix: metres and radians a second in one matrix cost plain inversion four digits."""
    sigma = np.sqrt(np.diag(P))
    return np.linalg.inv(P / np.outer(sigma, sigma)) / np.outer(sigma, sigma)


def test_smoother_is_filterpys(case, by_filterpy):
    """Oracle: filterpy KalmanFilter.rts_smoother, the method, whose Fs[k + 1] leads from k to k + 1."""
    kf, means, covariances = by_filterpy
    smoothed, smoothed_P, _, _ = kf.rts_smoother(means, covariances, Fs=case.linear.Phi, Qs=case.linear.Q, inv=scaled_inverse)
    agree(case.smoothed.delta, case.smoothed.P, smoothed[..., 0] + case.linear.c, smoothed_P)


def square_root(P):
    """S with S S' = P for a semidefinite P."""
    sigma = np.sqrt(np.diag(P))
    sigma = np.where(sigma > 0.0, sigma, 1.0)
    w, V = np.linalg.eigh(P / np.outer(sigma, sigma))
    keep = w > 1e-13 * w[-1]
    return sigma[:, None] * V[:, keep] * np.sqrt(w[keep])


@dataclass(frozen=True, eq=False)
class Batch:
    """Batch solution: mean (m, n), gaps added, and two factors (m, n, .) with P_jk = free_j free_k' + seen_j seen_k'."""

    mean: np.ndarray
    free: np.ndarray
    seen: np.ndarray

    def covariance(self, j: int, k: int) -> np.ndarray:
        return self.free[j] @ self.free[k].T + self.seen[j] @ self.seen[k].T


@pytest.fixture(scope="module")
def batch(case) -> Batch:
    """Least squares over all epochs at once.

    The trajectory is x = mean + A w with independent w of unit variance (start and process noise), the whitened measurements are
    z = M w + unit noise. With M = U s V', w given z has the mean V (s / (1 + s^2)) U' z and the covariance (1 - V V') + V V' / (1 + s^2),
    which needs no inverse of the singular Q.
    """
    linear = case.linear
    m, n = linear.c.shape
    roots = [square_root(linear.P)] + [square_root(linear.Q[k]) for k in range(1, m)]
    begin = np.concatenate([[0], np.cumsum([root.shape[1] for root in roots])])
    A, mean = np.zeros((m, n, begin[-1])), np.zeros((m, n))
    mean[0] = linear.mean
    for k in range(m):
        if k:
            A[k], mean[k] = linear.Phi[k] @ A[k - 1], linear.Phi[k] @ mean[k - 1]
        A[k][:, begin[k] : begin[k + 1]] += roots[k]
    mean += linear.c
    rows, values = [], []
    for k in range(m):
        for H, z, R in linear.measured[k]:
            L = np.linalg.cholesky(R)
            rows.append(np.linalg.solve(L, H @ A[k]))
            values.append(np.linalg.solve(L, z - H @ mean[k]))
    U, s, Vt = np.linalg.svd(np.vstack(rows), full_matrices=False)
    w = Vt.T @ (s / (1.0 + s**2) * (U.T @ np.concatenate(values)))
    seen = A @ Vt.T
    return Batch(mean + A @ w, A - seen @ Vt, seen / np.sqrt(1.0 + s**2))


def test_smoother_is_batch_least_squares(case, batch):
    """Oracle: one least-squares solution over the whole flight by singular values."""
    P = np.array([batch.covariance(k, k) for k in range(case.linear.c.shape[0])])
    agree(case.smoothed.delta, case.smoothed.P, batch.mean, P)


def test_cross_covariance_of_neighbouring_events_is_the_batch_solutions(case, batch):
    """Oracle: blocks off the diagonal of the batch covariance; the nearest two events correlate by more than 0.99."""
    assert not case.smoothed.event_cross[0].any()
    strongest = 0.0
    for i, (j, k) in enumerate(zip(case.events[:-1], case.events[1:], strict=True), start=1):
        expected = batch.covariance(j, k)[:9, :9]
        scale = np.sqrt(np.outer(np.diag(batch.covariance(j, j))[:9], np.diag(batch.covariance(k, k))[:9]))
        assert np.abs((case.smoothed.event_cross[i] - expected) / scale).max() < RELATIVE
        strongest = max(strongest, np.abs(expected / scale).max())
    assert strongest > 0.99


def test_last_filtered_state_is_the_smoothed_one(case):
    """Oracle: at the last epoch filter and smoother have seen the same data."""
    np.testing.assert_array_equal(case.smoothed.delta[-1], case.filtered[-1])
    np.testing.assert_allclose(case.smoothed.P[-1], case.filtered_P[-1], rtol=1e-15)
