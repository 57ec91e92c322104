"""Camera events that the clock of the fixes stamped: poses and covariances (X.1 to X.3)."""

from dataclasses import replace

import numpy as np
import pytest
from flown import NO_GATE, Flown, error_of, fly, start_near
from numpy.testing import assert_allclose
from scipy.stats import chi2

from insgnss.geodesy.rotation import quaternion_from_rotation, vector_from_rotation
from insgnss.navigation.filter.event_clock import event_delay, event_derivatives, receiver_events
from insgnss.navigation.filter.layout import FixErrors, state_layout
from insgnss.navigation.filter.solution import Solution, solve
from insgnss.navigation.filter.trajectory import rotate_blocks, trajectory
from insgnss.navigation.noise_model.model import load_noise_model
from insgnss.records import Trajectory

ALIGNED = np.array([1.0, 1.0, 1.0, 0.5, 0.5, 0.5, *np.radians([0.5, 0.5, 1.0])])
OFFSET_S, RATE = 5e-3, 2e-5  # sigmas
AT_S = np.arange(4.0333, 34.0, 2.1)
MODEL = load_noise_model("navchip")
EXACT = state_layout(MODEL)
CLOCK = state_layout(MODEL, fixes=FixErrors(time_offset_s=OFFSET_S, clock_rate=RATE))


def solved(seed: int, delay: tuple[float, float], layout=CLOCK) -> tuple[Flown, Solution]:
    flown = fly(36.0, seed, imu_hz=100.0, layout=layout, gate=NO_GATE, events_s=AT_S, delay=delay)
    return flown, solve(flown.problem, start_near(flown, ALIGNED))


def in_frame(flown: Flown, path: Trajectory) -> tuple[np.ndarray, np.ndarray]:
    """States (k, 10) in l of a trajectory, and C_ln (k, 3, 3)."""
    frame = flown.problem.frame
    C_ln = frame.C_ln(path.lat, path.lon)
    position = frame.position_from_geodetic(path.lat, path.lon, path.height)
    velocity = np.einsum("nij,nj->ni", C_ln, path.velocity_ned)
    return np.hstack([position, velocity, quaternion_from_rotation(C_ln @ path.C_nb)]), C_ln


def normalised(flown: Flown, path: Trajectory, delay: tuple[float, float]) -> np.ndarray:
    """Squares of the nine errors over their covariance, (k,), at the true instants of events."""
    motion, stamps = flown.sim.flight.motion, flown.problem.inc.marks[flown.event_epochs]
    true = stamps + delay[0] + delay[1] * (stamps - flown.problem.inc.marks[0])
    truth = np.hstack(
        [motion.position(true), motion.velocity(true), quaternion_from_rotation(motion.C_lb(true))]
    )
    nav, C_ln = in_frame(flown, path)
    error, cov = error_of(nav, truth), rotate_blocks(C_ln, path.cov, C_ln)
    return np.einsum("ni,ni->n", error, np.linalg.solve(cov, error[:, :, None])[:, :, 0])


@pytest.fixture(scope="module")
def late() -> tuple[Flown, Solution]:
    """Stamps 5 ms late."""
    return solved(5, (-5e-3, 0.0))


def positions(path: Trajectory) -> np.ndarray:
    return np.sqrt(np.diagonal(path.cov, axis1=1, axis2=2))[:, :3]


def test_a_latency_that_fixes_and_events_share_costs_nothing(late):
    """Oracle: the flight without latency and without the states; the exact motion.

    As events of the IMU's clock they lie 5 ms of flight, 60 mm, from the truth. On lines nothing is
    lost; in turns an offset that is known to 1 ms leaves open where between two fixes the IMU felt
    them, a quarter of a sigma of 3 mm in six flights. The 1 ms are 12 mm as events of the IMU's
    clock, four sigma, and what the prior of 5 ms pulls lies beyond 99 %.
    """
    flown, solution = late
    exact = solved(5, (0.0, 0.0), EXACT)[1]
    path = receiver_events(solution, 2008)
    assert path.time.size > 5
    as_imu = trajectory(solution, solution.event_epochs, 2008, events=True)
    least = positions(trajectory(exact, exact.event_epochs, 2008, events=True))
    ratio, of_imu = positions(path) / least, positions(as_imu) / least
    assert np.median(ratio) < 1.02
    assert ratio.max() < 1.35
    assert np.median(of_imu.max(axis=1)) > 2.0
    assert normalised(flown, path, (-5e-3, 0.0)).max() < chi2.isf(1e-4, 9)
    assert np.median(normalised(flown, as_imu, (-5e-3, 0.0))) > chi2.isf(0.01, 9)
    assert_allclose(path.time, as_imu.time + event_delay(solution), rtol=0, atol=1e-9)
    assert event_delay(solution).max() < -2e-3


def test_the_covariances_are_those_of_small_errors(late):
    """Oracle: (X.1) differentiated numerically by its eleven states, and their smoothed
    covariances put together by hand; 1e-4 of sigmas is what squares of the steps leave.
    """
    flown, solution = late
    layout, at = solution.problem.layout, solution.event_epochs
    middle = receiver_events(solution, 2008)
    C_ln = flown.problem.frame.C_ln(middle.lat, middle.lon)
    C_nl = np.swapaxes(C_ln, 1, 2)

    def changed(state: int, step: float) -> np.ndarray:
        """Errors (k, 9) in n that a step of one of nine, offset and rate makes."""
        nav, x = solution.nav.copy(), solution.x.copy()
        if state < 6:
            nav[:, state] += step
        elif state < 9:
            half = 0.5 * step * np.eye(3)[state - 6]
            w, (a, b, c) = np.cos(0.5 * step), np.sinc(0.5 * step / np.pi) * half
            turn = np.array([[w, -a, -b, -c], [a, w, -c, b], [b, c, w, -a], [c, -b, a, w]])
            nav[:, 6:] = nav[:, 6:] @ turn.T
        else:
            x[:, (layout.offset, layout.rate)[state - 9]] += step
        path = receiver_events(replace(solution, nav=nav, x=x), 2008)
        moved, here = in_frame(flown, path)[0], in_frame(flown, middle)[0]
        psi = vector_from_rotation(path.C_nb @ np.swapaxes(middle.C_nb, 1, 2))
        linear = [
            np.einsum("nij,nj->ni", C_nl, moved[:, c] - here[:, c])
            for c in (slice(0, 3), slice(3, 6))
        ]
        return np.hstack([*linear, psi])

    steps = [*[1e-2] * 6, *[1e-4] * 3, 1e-4, 1e-6]
    J = np.stack(
        [(changed(s, h) - changed(s, -h)) / (2.0 * h) for s, h in enumerate(steps)], axis=2
    )
    rows = np.r_[0:9, 9 + layout.offset, 9 + layout.rate]
    P = solution.covariance(at)[:, rows[:, None], rows]
    expected = J @ P @ np.swapaxes(J, 1, 2)
    sigma = np.sqrt(np.diagonal(expected, axis1=1, axis2=2))
    of_sigmas = sigma[:, :, None] * sigma[:, None, :]
    assert np.abs((middle.cov - expected) / of_sigmas).max() < 1e-4
    joint = P[1:].copy()  # e_k with c, and c with c, of the later event
    joint[:, :9, :9] = solution.event_cross[1:]
    joint[:, :9, 9:] = P[:-1, :9, 9:]
    cross = J[:-1] @ joint @ np.swapaxes(J[1:], 1, 2)
    assert middle.cross is not None
    of_pairs = sigma[:-1, :, None] * sigma[1:, None, :]
    assert np.abs((middle.cross - cross) / of_pairs).max() < 1e-4
    # all pairs of events at once (B.8)
    T = event_derivatives(solution, of_receiver=True)
    k = at.size
    blocks = (
        solution.chain.covariance_of(np.arange(len(T)), T).reshape(k, 9, k, 9).transpose(0, 2, 1, 3)
    )
    assert np.abs((np.einsum("aaij->aij", blocks) - expected) / of_sigmas).max() < 1e-4
    every = np.arange(k)
    assert np.abs((blocks[every[:-1], every[1:]] - cross) / of_pairs).max() < 1e-4
    assert np.abs((blocks[every[:-1], every[1:]] - middle.cross) / of_pairs).max() < 1e-8
    exact = solution.chain.covariance_of(np.arange(k), np.tile(np.eye(T.shape[2])[rows], (k, 1, 1)))
    exact = exact.reshape(k, rows.size, k, -1).transpose(0, 2, 1, 3)
    ends = J[0] @ exact[0, -1] @ J[-1].T
    assert np.abs((blocks[0, -1] - ends) / np.outer(sigma[0], sigma[-1])).max() < 1e-4
    # what the offset adds to neighbours is no small part of it
    plain = trajectory(solution, at, 2008, events=True).cross
    assert plain is not None
    assert np.abs((plain - cross) / of_pairs).max() > 0.1


def test_without_a_time_offset_among_the_states_nothing_moves():
    """Oracle: the trajectory at the stamps, digit by digit."""
    solution = solved(5, (0.0, 0.0), EXACT)[1]
    path, plain = (
        receiver_events(solution, 2008),
        trajectory(solution, solution.event_epochs, 2008, events=True),
    )
    assert not event_delay(solution).any()
    for name in ("time", "lat", "height", "C_nb", "cov", "cross"):
        np.testing.assert_array_equal(getattr(path, name), getattr(plain, name))


@pytest.mark.slow
def test_errors_over_many_flights_are_as_large_as_the_covariance_says():
    """Oracle: chi-square of 12 flights of nine errors, 99 % bounds; offsets and rates are drawn
    from their sigmas.

    One event a flight, so that they are independent. As events of the IMU's clock with exact
    stamps they would exceed the bounds.
    """
    nees, wrong = [], []
    for seed in range(12):
        o, r = np.random.default_rng(2000 + seed).standard_normal(2) * (OFFSET_S, RATE)
        flown, solution = solved(100 + seed, (o, r))
        path = receiver_events(solution, 2008)
        k = path.time.size // 2
        nees.append(normalised(flown, path, (o, r))[k])
        as_imu = trajectory(solution, solution.event_epochs, 2008, events=True)
        wrong.append(normalised(flown, as_imu, (o, r))[k])
    low, high = chi2.ppf([0.005, 0.995], 12 * 9)
    assert low < sum(nees) < high
    assert sum(wrong) > high
