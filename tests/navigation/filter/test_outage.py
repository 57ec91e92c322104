"""The smoothed covariance within an outage, where large numbers cancel."""

import numpy as np
import pytest
from flown import NO_GATE, error_of, fly, passes_in_one, start_near
from numpy.testing import assert_allclose

from insgnss.base.errors import DataError
from insgnss.navigation.filter.codes import ABSENT, COVARIANCE_RESET, POSITION_ROW
from insgnss.navigation.filter.filter import make_history, run_filter
from insgnss.navigation.filter.solution import refuse_negative_variances, solve
from insgnss.simulation.scenario import GnssOptions

WIDE = np.array([1.0, 1.0, 1.0, 0.5, 0.5, 0.5, *np.radians([2.0, 2.0, 20.0])])
OUTAGE = (60.0, 240.0)


@pytest.fixture(scope="module")
def flown():
    """Five minutes on a NavChip, three of them without a fix."""
    events = np.array([50.0, 80.5, 150.25, 239.5, 260.0])
    flown = fly(300.0, 4, imu_hz=50.0, gate=NO_GATE, gnss=GnssOptions(rate_hz=1.0), events_s=events)
    time = flown.problem.epochs.time
    flown.problem.epochs.has_position[(time > OUTAGE[0]) & (time < OUTAGE[1])] = False
    return flown


@pytest.fixture(scope="module")
def smoothed(flown):
    """Start, forward pass, the same with what the smoother made of it."""
    start = start_near(flown, WIDE)
    forward = make_history(flown.problem.epochs, flown.problem.layout)
    run_filter(flown.problem, start, forward)
    passes = passes_in_one(flown.problem, start)
    passes.filter()
    full = passes.smooth()
    return forward, full, passes.chain(full)


def solved(A, B):
    """A^-1 B in extended precision, A symmetric and positive definite."""
    s = np.sqrt(np.diag(A))
    M = np.hstack([A / np.outer(s, s), B / s[:, None]])
    n = len(A)
    for k in range(n):
        M[k] /= M[k, k]
        others = np.arange(n) != k
        M[others] -= np.outer(M[others, k], M[k])
    return M[:, n:] / s[:, None]


def extended(forward, last, first, later):
    """Smoothed covariances from epoch `last` back to `first`, and the gain between the two:
    Rauch, Tung and Striebel (1965) as they wrote it, in extended precision.
    """
    n, P_s = later.shape[0], later.astype(np.longdouble)
    every, gain = {last: P_s}, np.eye(n, dtype=np.longdouble)
    for e in range(last - 1, first - 1, -1):
        o = forward.outage[e + 1]
        P = forward.P[e].astype(np.longdouble)
        Phi, Q = np.zeros((2, n, n), dtype=np.longdouble)
        Phi[:9], Q[:9], Q[9:, :9] = forward.F[e + 1], forward.W[o], forward.W[o][:, 9:].T
        Phi[9:, 9:], Q[9:, 9:] = np.diag(forward.D[e + 1]), np.diag(forward.Qbb[o])
        predicted = Phi @ P @ Phi.T + Q
        C = solved(predicted, Phi @ P).T
        P_s = P + C @ (P_s - predicted) @ C.T
        every[e], gain = P_s, C @ gain
    return every, gain


def test_covariances_are_those_of_extended_precision(flown, smoothed):
    """Oracle: the recursion of another form, with three digits more; a variance is a ten-millionth
    of the filter's at the end of the outage.
    """
    if np.finfo(np.longdouble).eps > 1e-18:
        pytest.skip("no extended precision on this machine")
    forward, full, _ = smoothed
    within = np.flatnonzero(forward.outage != ABSENT)
    first, last = within[0] - 1, within[-1]
    every, _ = extended(forward, last, first, full.P[last])
    small = 1.0
    for e in range(first, last):
        exact = np.asarray(every[e], dtype=float)
        s = np.sqrt(np.diag(exact))
        assert np.abs((full.P[e] - exact) / np.outer(s, s)).max() < 1e-4
        small = min(small, exact[0, 0] / forward.P[e, 0, 0])
    assert small < 1e-7


def test_neighbours_within_an_outage_keep_their_covariance(flown, smoothed):
    """Oracle: gain by gain in extended precision; between two events within the outage."""
    if np.finfo(np.longdouble).eps > 1e-18:
        pytest.skip("no extended precision on this machine")
    forward, full, _ = smoothed
    j, k = flown.event_epochs[2:4]
    every, gain = extended(forward, k, j, full.P[k])
    exact = np.asarray(gain @ every[k], dtype=float)[:9, :9]
    scale = np.sqrt(np.outer(np.diag(full.P[j])[:9], np.diag(full.P[k])[:9]))
    assert_allclose(full.event_cross[3] / scale, exact / scale, atol=1e-4)


def test_events_around_and_within_an_outage_keep_theirs(flown, smoothed):
    """Oracle: gain by gain in extended precision, for all pairs of three events within the outage;
    the covariance of all five is positive definite, and of neighbours what it is elsewhere.
    """
    if np.finfo(np.longdouble).eps > 1e-18:
        pytest.skip("no extended precision on this machine")
    forward, full, chain = smoothed
    n = full.P.shape[1]
    cov = chain.covariance_of(np.arange(5), np.tile(np.eye(9, n), (5, 1, 1)))
    blocks = cov.reshape(5, 9, 5, 9).transpose(0, 2, 1, 3)
    epochs = flown.event_epochs
    sigma = np.sqrt(np.diagonal(full.P, axis1=1, axis2=2))[epochs, :9]
    for a, b in ((1, 2), (2, 3), (1, 3)):
        every, gain = extended(forward, epochs[b], epochs[a], full.P[epochs[b]])
        exact = np.asarray(gain @ every[epochs[b]], dtype=float)[:9, :9]
        assert_allclose(
            blocks[a, b] / np.outer(sigma[a], sigma[b]),
            exact / np.outer(sigma[a], sigma[b]),
            atol=1e-4,
        )
    for a in range(4):
        pair = np.outer(sigma[a], sigma[a + 1])
        assert_allclose(blocks[a, a + 1] / pair, full.event_cross[a + 1] / pair, atol=1e-6)
    for a in range(5):
        own = np.outer(sigma[a], sigma[a])
        assert_allclose(blocks[a, a] / own, full.P[epochs[a], :9, :9] / own, atol=1e-6)
    assert np.linalg.eigvalsh(cov / np.outer(*[sigma.ravel()] * 2)).min() > 0.0


def test_an_outage_of_minutes_is_within_its_sigmas(flown):
    """Oracle: the exact motion. Every variance is positive, every error below 5 sigma."""
    solution = solve(flown.problem, start_near(flown, WIDE))
    variance = solution.variance(np.arange(solution.time.size))
    assert (variance > 0.0).all()
    error = error_of(solution.nav, flown.true_nav())
    assert (np.abs(error) < 5.0 * np.sqrt(variance[:, :9])).all()
    assert not np.any(solution.verdict[:, POSITION_ROW] == COVARIANCE_RESET)
    at = np.searchsorted(solution.time, flown.problem.inc.marks[0] + OUTAGE[1] - 1.0)
    assert 0.001 < np.sqrt(variance[at, :3]).max() < 0.1


def test_a_negative_variance_stops_the_run(flown, smoothed):
    """Oracle: one that is made negative by hand; it would be a sigma of NaN."""
    nav_cov = smoothed[1].nav_cov.copy()
    refuse_negative_variances(flown.problem, nav_cov)
    nav_cov[100, 2] = -1e-9  # of the east component
    with pytest.raises(DataError, match=r"negative variances from \d+\.\d s on"):
        refuse_negative_variances(flown.problem, nav_cov)
