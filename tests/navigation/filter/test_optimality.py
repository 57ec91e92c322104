"""Filter and smoother against filterpy and against batch least squares on the very same linear
problem.

Run about a fixed nominal (K.6) the problem is linear, `flight.reference.linear` (T.20), with the
nominal of the epoch before carried forward, less that of the epoch, as the known gap. The nominal
is a smoothed flight, so the gaps are not zero. Transitions, noise and measurements are the core's
own here; the reference twin has its own (`tests/flight/reference`).
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from batch_least_squares import Batch, batch
from flown import NO_GATE, fly, passes_in_one, start_near
from linearised_interval import linearise_interval

from insgnss.flight.reference.linear import (
    GaussianStates,
    LinearProblem,
    kalman_filter,
    rts_smoother,
)
from insgnss.navigation.filter.blocks import BlockwisePasses
from insgnss.navigation.filter.codes import N_KINDS, N_NAV, NHC, POS, PSI, ZUPT
from insgnss.navigation.filter.correction import corrections
from insgnss.navigation.filter.event_chain import EventChain, common_errors, nodes_of
from insgnss.navigation.filter.filter import INCREMENT_BLOCK_S
from insgnss.navigation.filter.kernels.measurements import measured_triple
from insgnss.navigation.filter.kernels.records import make_triple
from insgnss.navigation.filter.kernels.update import state_difference
from insgnss.navigation.filter.layout import FixErrors, state_layout
from insgnss.navigation.filter.problem import EstimationProblem, InitialState
from insgnss.navigation.filter.smoother import SharedError, Smoothed
from insgnss.navigation.filter.solution import solve
from insgnss.navigation.filter.strapdown import kernel_earth, kernel_intervals
from insgnss.navigation.noise_model.model import load_noise_model

RELATIVE = 1e-8  # of the standard deviations; measured 1e-10
# the same after images: 1e-8 measured, more or less by the processor: the oracle inverts twice
BY_IMAGES = 1e-7
SIGMA = np.array([0.5, 0.5, 0.5, 0.3, 0.3, 0.3, *np.radians([1.0, 1.0, 5.0])])
OFFSET = np.array([0.1, -0.2, 0.1, 0.1, 0.1, -0.1, *np.radians([0.5, -0.3, 2.0])])


@dataclass(frozen=True, eq=False)
class Case:
    """What the package makes of the problem: filtered mean and covariance, smoothed, and the same
    problem in matrices.
    """

    problem: EstimationProblem
    start: InitialState
    nominal: tuple[np.ndarray, np.ndarray]
    filtered: np.ndarray
    filtered_P: np.ndarray
    smoothed: Smoothed
    linear: LinearProblem
    events: np.ndarray
    chain: EventChain


def events_at(problem: EstimationProblem, at: np.ndarray) -> EstimationProblem:
    """The problem with camera events at epochs `at`, every third velocity left out, and some motion
    and stillness made up.
    """
    event = np.full(problem.inc.marks.size, -1, dtype=np.int64)
    event[at] = np.arange(at.size)
    has_velocity = problem.epochs.has_velocity.copy()
    has_velocity[::3] = False
    epochs, m = problem.epochs._replace(event=event, has_velocity=has_velocity), event.size
    motion, still = np.zeros(m, dtype=np.int64), np.zeros(m)
    motion[10::17], motion[15::23], still[20::19] = ZUPT, NHC, 1e-4
    cov = np.broadcast_to(np.diag([25.0, 9.0, 4.0]), (m, 3, 3)).copy()
    group = (np.arange(m) // 40) % 2
    return replace(
        problem,
        epochs=epochs._replace(
            constraint=motion,
            constraint_cov=cov,
            zaru_variance=still,
            zaru_rate=problem.inc.rate.copy(),
            group=group,
        ),
    )


def measurements(
    problem: EstimationProblem, nav, x, k: int, accel
) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    ep, n = problem.epochs, problem.layout.size
    imu, earth = (
        problem.layout.kernel_model(INCREMENT_BLOCK_S, problem.aiding_interval_s),
        kernel_earth(problem.frame),
    )
    out = []
    for kind in range(N_KINDS):
        triple = make_triple(n - N_NAV)
        if measured_triple(kind, k, ep, nav, x, problem.antenna_lever_b, accel, imu, earth, triple):
            out.append((triple.H, triple.nu[:, 0], triple.R))
    return out


def in_matrices(problem: EstimationProblem, start: InitialState, nav, x) -> LinearProblem:
    """The problem about the nominal nav (m, 10), x (m, ns)."""
    m, n = nav.shape[0], problem.layout.size
    intervals, earth = kernel_intervals(problem.inc), kernel_earth(problem.frame)
    imu, ep = (
        problem.layout.kernel_model(INCREMENT_BLOCK_S, problem.aiding_interval_s),
        problem.epochs,
    )
    Phi, Q, gap, accel = (
        np.zeros((m, n, n)),
        np.zeros((m, n, n)),
        np.zeros((m, n)),
        np.zeros((m, 3)),
    )
    for k in range(1, m):
        step = linearise_interval(
            intervals, ep.stop[k - 1], ep.stop[k], nav[k - 1], x[k - 1], imu, earth, ep.time[k - 1]
        )
        state_difference(step.nav, step.x, nav[k], x[k], gap[k])
        accel[k] = (step.nav[3:6] - nav[k - 1, 3:6]) / (ep.time[k] - ep.time[k - 1])
        Phi[k], Q[k] = step.Phi, 0.5 * (step.Q + step.Q.T)
    mean = np.zeros(n)
    state_difference(start.nav, start.x, nav[0], x[0], mean)
    measured = [measurements(problem, nav[k], x[k], k, accel[k]) for k in range(m)]
    return LinearProblem(mean + start.mean, start.P, Phi, Q, gap, measured)


@pytest.fixture(scope="module")
def case() -> Case:
    """9 s at 10 Hz with velocities, errors of the fixes as states, motion constraints, a turn, and
    six events.

    Two of the events are on epochs with a fix, and two 17 ms apart.
    """
    fixes = FixErrors(0.3, 0.05, 1e-3, (0.8, 0.7, 0.6), 5.0, (0.6, 0.6, 0.7), 1.0, 30.0, 0.4)
    layout = state_layout(load_noise_model("navchip"), fixes=fixes)
    flown = fly(
        9.0,
        seed=5,
        layout=layout,
        velocity=True,
        gate=NO_GATE,
        extra=np.array([2.0333, 4.4, 6.0777, 6.0947, 6.1]),
    )
    events = np.union1d(flown.event_epochs, flown.extra_epochs)
    problem = events_at(flown.problem, events)
    start = start_near(flown, SIGMA, OFFSET)
    start = replace(
        start, mean=0.3 * np.sqrt(np.diag(start.P)) * np.cos(np.arange(start.mean.size))
    )
    first = solve(problem, start, "off")
    passes = passes_in_one(problem, start)
    history = passes.history
    history.nav[:], history.x[:] = first.nav, first.x
    passes.filter(closed_loop=False)
    linear = in_matrices(problem, start, history.nav, history.x)
    mean, P = history.m[1:].copy(), history.P[1:].copy()
    both = passes.smooth()
    chain = passes.chain(both)
    assert chain is not None
    nominal = first.nav, first.x
    return Case(problem, start, nominal, mean, P, both, linear, events, chain)


@pytest.fixture(scope="module")
def by_filterpy(case) -> GaussianStates:
    """Filterpy's filter, one predict an epoch and one update a triple."""
    return kalman_filter(case.linear)


def agree(mean, P, expected, expected_P, unit=None, within=RELATIVE) -> None:
    """Means within a share of their standard deviations, covariances within that of the product
    of two, or of those of `unit`, from which they are differences.
    """
    sigma = np.sqrt(np.diagonal(expected_P, axis1=1, axis2=2))
    assert np.abs((mean - expected) / sigma).max() < within
    sigma = sigma if unit is None else np.sqrt(np.diagonal(unit, axis1=1, axis2=2))
    assert np.abs((P - expected_P) / (sigma[:, :, None] * sigma[:, None, :])).max() < within


def test_the_problem_is_a_fair_one(case):
    """Oracle: what the comparison needs: gaps that are not zero, velocities at some epochs only,
    noise that differs by epoch.
    """
    assert np.abs(case.linear.gap_response()[-1, :3]).max() > 1e-3
    assert {len(rows) for rows in case.linear.measured} == {0, 1, 2, 3}
    assert case.events.size == 6
    assert np.linalg.matrix_rank(case.linear.Q[5]) < case.problem.layout.size
    first, last = np.diag(case.filtered_P[0]), np.diag(case.filtered_P[-1])
    assert (last[:9] < first[:9]).all()


def test_filter_is_filterpys(case, by_filterpy):
    """Oracle: filterpy KalmanFilter.predict and update (Joseph form)."""
    agree(case.filtered, case.filtered_P, by_filterpy.mean, by_filterpy.P)


def test_smoother_is_filterpys(case, by_filterpy):
    """Oracle: filterpy KalmanFilter.rts_smoother, the method, whose Fs[k + 1] leads from k to k +
    1.
    """
    expected = rts_smoother(case.linear, by_filterpy)
    agree(case.smoothed.delta, case.smoothed.P, expected.mean, expected.P)


@pytest.fixture(scope="module")
def in_one(case) -> Batch:
    """Least squares over all epochs at once."""
    return batch(case.linear)


def test_smoother_is_batch_least_squares(case, in_one):
    """Oracle: one least-squares solution over the whole flight by singular values."""
    P = np.array([in_one.covariance(k, k) for k in range(case.linear.gap.shape[0])])
    agree(case.smoothed.delta, case.smoothed.P, in_one.mean, P)


def test_cross_covariance_of_neighbouring_events_is_the_batch_solutions(case, in_one):
    """Oracle: blocks off the diagonal of the batch covariance; the nearest two events correlate by
    more than 0.99.
    """
    assert not case.smoothed.event_cross[0].any()
    strongest = 0.0
    for i, (j, k) in enumerate(zip(case.events[:-1], case.events[1:], strict=True), start=1):
        expected = in_one.covariance(j, k)[:9, :9]
        scale = np.sqrt(
            np.outer(np.diag(in_one.covariance(j, j))[:9], np.diag(in_one.covariance(k, k))[:9])
        )
        assert np.abs((case.smoothed.event_cross[i] - expected) / scale).max() < RELATIVE
        strongest = max(strongest, np.abs(expected / scale).max())
    assert strongest > 0.99


def test_covariance_of_all_events_is_the_batch_solutions(case, in_one):
    """Oracle: every block of the batch covariance between two of six events, all states. It is
    symmetric, of images a second apart positive definite, its blocks of neighbours are
    `event_cross`, and a part of the events has the same blocks as all.

    Chained from neighbours, as if nine states were Markov, events 0 and 2 are 8 % of their sigmas
    off.
    """
    k, n = case.events.size, case.problem.layout.size
    found = case.chain.covariance_of(np.arange(k), np.tile(np.eye(n), (k, 1, 1)))
    expected = np.block([[in_one.covariance(a, b) for b in case.events] for a in case.events])
    sigma = np.sqrt(np.diag(expected))
    assert np.abs((found - expected) / np.outer(sigma, sigma)).max() < RELATIVE
    np.testing.assert_array_equal(found, found.T)
    blocks = found.reshape(k, n, k, n).transpose(0, 2, 1, 3)[:, :, :9, :9]
    own = sigma.reshape(k, n)[:, :9]
    scale = own[:, None, :, None] * own[None, :, None, :]
    for a in range(k - 1):
        cross = case.smoothed.event_cross[a + 1]
        assert np.abs((blocks[a, a + 1] - cross) / scale[a, a + 1]).max() < RELATIVE
    part = case.chain.covariance_of(np.arange(1, 4), np.tile(np.eye(9, n), (3, 1, 1)))
    part = part.reshape(3, 9, 3, 9).transpose(0, 2, 1, 3)
    assert np.abs((part - blocks[1:4, 1:4]) / scale[1:4, 1:4]).max() < 1e-12
    pose = np.r_[0:3, 6:9]
    normal = (blocks / scale)[:3, :3, pose[:, None], pose]
    assert np.linalg.eigvalsh(normal.transpose(0, 2, 1, 3).reshape(18, 18)).min() > RELATIVE
    chained = blocks[0, 1] @ np.linalg.solve(blocks[1, 1], blocks[1, 2])
    assert np.abs((chained - blocks[0, 2]) / scale[0, 2]).max() > 0.05


def joint(in_one, events, T, event, state):
    """Covariances of the batch: of poses and nodes, and of nodes."""
    k, d, n = T.shape
    of_nodes = np.eye(n)[state]
    cross = np.zeros((k, d, event.size))
    cov = np.zeros((event.size, event.size))
    for c, e in enumerate(event):
        for a in range(k):
            cross[a, :, c] = T[a] @ in_one.covariance(events[a], events[e]) @ of_nodes[c]
        for other, f in enumerate(event):
            cov[other, c] = of_nodes[other] @ in_one.covariance(events[f], events[e]) @ of_nodes[c]
    return cross.reshape(k * d, -1), cov


def test_common_errors_explain_what_the_batch_says(case, in_one):
    """Oracle: (B.9) from the batch covariance of poses and nodes. With the states of the first and
    the last event and constants in the middle what is explained is cov(y, c) cov(c)^-1 cov(c, y);
    given all states of one event nothing is left between those before and after it.
    """
    k, n = case.events.size, case.problem.layout.size
    T = np.tile(np.eye(9, n)[[0, 1, 2, 6, 7, 8]], (k, 1, 1))
    sigma = np.sqrt(
        np.concatenate(
            [
                np.diag(t @ in_one.covariance(e, e) @ t.T)
                for t, e in zip(T, case.events, strict=True)
            ]
        )
    )
    event, state = np.array([0, 0, 2, 2, 5]), np.array([9, 10, 0, 12, n - 1])
    found = common_errors(case.chain, event, state, T.__getitem__).reshape(6 * k, -1)
    cross, cov = joint(in_one, case.events, T, event, state)
    expected = cross @ np.linalg.solve(cov, cross.T)
    assert np.abs((found @ found.T - expected) / np.outer(sigma, sigma)).max() < RELATIVE
    assert np.abs(expected / np.outer(sigma, sigma)).max() > 0.5
    event, state = np.full(n, 2), np.arange(n)
    found = common_errors(case.chain, event, state, T.__getitem__).reshape(6 * k, -1)
    rest = (case.chain.covariance_of(np.arange(len(T)), T) - found @ found.T) / np.outer(
        sigma, sigma
    )
    assert np.abs(rest[:12, 18:]).max() < 1e-6  # digits of 30 states, some known by sums alone
    assert np.abs(rest[:12, :12]).max() > 1e-3


@pytest.mark.parametrize("block", [POS, PSI])
def test_what_a_spell_shares_is_a_common_error(case, block):
    """Oracle: the covariance between events inside with and without it, of the states it is of."""
    k, n = case.events.size, case.problem.layout.size
    T = np.tile(np.eye(9, n), (k, 1, 1))
    cov = np.array([[0.04, 0.01, 0.0], [0.01, 0.09, 0.0], [0.0, 0.0, 0.0]])
    spell = SharedError(int(case.events[1]), int(case.events[3]), cov, block)
    chain = replace(case.chain, shared=(spell,))
    nodes = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    A = common_errors(chain, *nodes, T.__getitem__).reshape(9 * k, -1)
    added = chain.covariance_of(np.arange(len(T)), T) - case.chain.covariance_of(
        np.arange(len(T)), T
    )
    np.testing.assert_allclose(A @ A.T, added, atol=1e-12)
    second = added.reshape(k, 9, k, 9)[1, block, 2, block]
    np.testing.assert_allclose(second, cov, atol=1e-12)
    assert np.abs(added).max() > 0.05


def test_pairs_share_a_spell_where_both_lie_in_it(case, in_one):
    """Oracle: every block of the batch covariance on or above its diagonal, and what a spell from
    the second event to the fourth adds by hand: to pairs within it, to none that it ends between.
    """
    first, second = np.triu_indices(case.events.size)
    n = case.problem.layout.size
    cov = np.array([[4.0, 1.0, 0.0], [1.0, 9.0, 2.0], [0.0, 2.0, 16.0]])
    spell = SharedError(int(case.events[1]), int(case.events[3]), cov)
    T = np.eye(9, n), np.roll(np.eye(9, n), 1, axis=0)  # the second of a pair by other rows
    derivatives = tuple(np.tile(of, (first.size, 1, 1)) for of in T)
    found = replace(case.chain, shared=(spell,)).cross((first, second), derivatives)
    for j, k, block in zip(first, second, found, strict=True):
        expected = in_one.covariance(case.events[j], case.events[k])
        own = (in_one.covariance(e, e) for e in case.events[[j, k]])
        sigma = [np.sqrt(np.diag(P)) for P in own]
        expected[:3, :3] += cov if j >= 1 and k <= 3 else 0.0
        scale = np.outer(T[0] @ sigma[0], T[1] @ sigma[1])
        assert np.abs((block - T[0] @ expected @ T[1].T) / scale).max() < RELATIVE, (j, k)


def test_nodes_lie_half_a_correlation_time_apart(case):
    """Oracle: the rule, by hand: constants once, fast states never, the slow ones often enough."""
    layout = case.problem.layout
    for duration in (50.0, 3600.0, 36000.0):
        time = 1000.0 + np.arange(0.0, duration + 1.0, 2.0)
        event, state = nodes_of(layout, time)
        assert (np.diff(event) >= 0).all()
        assert event.size <= 200
        for s in range(layout.beta.size):
            own = time[event[state == 9 + s]]
            tau = 1.0 / layout.beta[s] if layout.beta[s] else np.inf
            if layout.drive[s] == 0.0:
                assert own.size == 1
            elif tau < 100.0:
                assert own.size == 0
            elif duration < 36000.0:  # there, ten hours, 200 nodes allow no more
                far = np.abs(time[:, None] - own).min(axis=1).max()
                assert far < 2.0 + min(0.25 * tau, 0.5 * duration)
    assert nodes_of(layout, time[:0])[0].size == 0


@pytest.mark.parametrize(("block", "columns"), [(16, 20), (1000, 20), (16, 100)])
def test_images_correct_all_epochs_as_one_batch_does(case, in_one, block, columns):
    """Oracle: least squares over all epochs at once with rows that tie the poses of all six events
    to each other, as reduced normal equations of images do, and do not determine them.
    """
    events, n = case.events, case.problem.layout.size
    T = np.tile(np.eye(9, n)[[0, 1, 2, 6, 7, 8]], (events.size, 1, 1))
    of_noise = np.concatenate([in_one.free, in_one.seen], axis=2)
    poses = np.concatenate([t @ of_noise[e] for t, e in zip(T, events, strict=True)])
    C = poses @ poses.T
    rng = np.random.default_rng(11)
    rows = rng.normal(size=(20, len(C))) * 5.0 / np.sqrt(np.diag(C))
    z, J = rng.normal(size=20) * 3.0, rows @ poses
    _, s, Vt = np.linalg.svd(J, full_matrices=False)
    images = of_noise @ Vt.T  # the rest of the noise is as it was
    expected = images @ (Vt @ (J.T @ z) / (1.0 + s**2))
    taken = images * (s / np.sqrt(1.0 + s**2))
    without = of_noise @ np.swapaxes(of_noise, 1, 2)
    expected_P = without - taken @ np.swapaxes(taken, 1, 2)

    K = rows.T @ np.linalg.inv(rows @ C @ rows.T + np.eye(20))  # of the poses alone
    root = rows.T @ np.linalg.inv(np.linalg.cholesky(rows @ C @ rows.T + np.eye(20))).T
    turned = root @ np.linalg.qr(rng.normal(size=(columns, 20)))[0].T  # the same product
    b = np.column_stack([K @ z, turned]).reshape(events.size, 6, columns + 1)
    passes = BlockwisePasses(case.problem, case.start, np.arange(1), 0, block, 0)
    passes.history.nav[:], passes.history.x[:] = case.nominal
    passes.filter(closed_loop=False)
    chain = passes.chain(passes.smooth())
    assert chain is not None
    found, less = np.empty((len(expected), n)), np.empty_like(without)
    for piece in corrections(passes.again(), chain, T, b):
        found[piece.first : piece.last] = piece.mean(piece.z[:, 0])
        X, Z = piece.multiples(slice(None), n), piece.z[:, 1:]
        less[piece.first : piece.last] = X @ (Z @ Z.T) @ np.swapaxes(X, 1, 2)
    agree(found, case.smoothed.P - less, expected, expected_P, without, BY_IMAGES)
    assert np.abs(expected / np.sqrt(np.diagonal(expected_P, axis1=1, axis2=2))).max() > 1.0
    left = np.diagonal(expected_P / without, axis1=1, axis2=2)
    assert left.min() < 0.5


def test_last_filtered_state_is_the_smoothed_one(case):
    """Oracle: at the last epoch filter and smoother have seen the same data."""
    np.testing.assert_array_equal(case.smoothed.delta[-1], case.filtered[-1])
    np.testing.assert_allclose(case.smoothed.P[-1], case.filtered_P[-1], rtol=1e-15)
