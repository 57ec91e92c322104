"""Which epochs measure what, nodes of common errors and small kernels: by hand and by numpy."""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from insgnss.base.errors import DataError
from insgnss.navigation.filter.codes import (
    ABSENT,
    BIAS,
    COVARIANCE_RESET,
    NHC,
    NO_CONSTRAINT,
    NOT_MEASURED,
    REJECTED,
    USED,
    ZUPT,
)
from insgnss.navigation.filter.epochs import _error_unit, unfixed_solutions, with_nhc, with_zupt
from insgnss.navigation.filter.event_chain import EventTransitions, _whiten_cross, nodes_of
from insgnss.navigation.filter.event_clock import _means
from insgnss.navigation.filter.filter import (
    history_room,
    measured_slots,
    outages,
    refuse_divergence,
)
from insgnss.navigation.filter.kernels.transitions import event_transitions
from insgnss.navigation.filter.layout import FixErrors, state_layout
from insgnss.navigation.filter.smoother import diagonal, unpack_triangles
from insgnss.navigation.filter.solution import (
    _kept_rows,
    _nonlinear,
    inject_errors,
    refuse_negative_variances,
)
from insgnss.navigation.filter.strapdown import nav_difference
from insgnss.navigation.filter.trajectory import _give_back
from insgnss.navigation.noise_model.model import load_noise_model
from insgnss.records.qualities import Quality


class Named(SimpleNamespace):
    """Records of which only some fields are read."""

    def _replace(self, **changes):
        return Named(**{**vars(self), **changes})


def fixes(sigma_m, quality=None, n=20) -> SimpleNamespace:
    cov = np.broadcast_to(np.diag(np.square(sigma_m)), (n, 3, 3))
    return SimpleNamespace(time=np.arange(n), cov_ned=cov, quality=quality)


@pytest.mark.parametrize(
    ("sigma_m", "unfixed"),
    [((0.49, 0.49, 9.0), False), ((0.51, 0.51, 0.1), True), ((0.1, 0.72, 0.1), True)],
)
def test_code_solutions_by_their_sigma(sigma_m, unfixed) -> None:
    """Oracle: by hand: half a metre of the mean horizontal sigma, errors of ten minutes."""
    assert unfixed_solutions(fixes(sigma_m))[0].tolist() == [unfixed] * 20
    assert unfixed_solutions(fixes(sigma_m))[1] == 600.0


def test_solutions_by_their_quality() -> None:
    """Oracle: by hand: where one in ten is fixed or float the qualities count, for a minute."""
    for fixed, of_quality in ((2, True), (1, False)):
        quality = np.where(np.arange(20) < fixed, Quality.FIXED, Quality.SINGLE)
        unfixed, stays_s = unfixed_solutions(fixes((0.1, 0.1, 0.1), quality))
        assert stays_s == (60.0 if of_quality else 600.0)
        assert unfixed.sum() == (20 - fixed if of_quality else 0)
    ppp = unfixed_solutions(fixes((0.1,) * 3, np.full(20, Quality.FLOAT)))[0]
    assert ppp.all()


def test_unit_of_the_errors_is_the_median_times_powers_of_two() -> None:
    """Oracle: by hand: 1.4 times is one, 1.5 times is two; none where nothing is measured; one
    unit for code solutions that nearly all claim much the same."""
    factor = np.array([1.0, 1.0, 1.0, 1.4, 1.5, 0.7, 2.7, 0.0])
    cov = np.square(0.1 * factor)[:, None, None] * np.eye(3)
    expected = 0.1 * np.array([1.0, 1.0, 1.0, 1.0, 2.0, 0.5, 2.0, 0.0])
    group = np.zeros(8, dtype=np.int64)
    assert_allclose(_error_unit(cov, group), np.tile(expected[:, None], 3))
    assert_allclose(_error_unit(cov, group + 1)[:-1], 0.1)
    many = np.ones(20)
    many[:2] = 8.0  # nine of ten are no longer nearly all
    unit = _error_unit(np.square(many)[:, None, None] * np.eye(3), np.ones(20, dtype=np.int64))
    assert_allclose(unit[:, 0], many)


def test_a_stand_is_measured_once_a_second() -> None:
    """Oracle: by hand: epochs a second apart in the stand, its velocity to 3 cm/s; the mean rate
    since the one before, of white noise over that time and 5e-5 rad/s of sway."""
    n, h = 40, 0.25
    marks = 100.0 + h * np.arange(n + 1)
    rng = np.random.default_rng(2)
    inc = SimpleNamespace(
        marks=marks, stop=np.arange(n + 1), dtheta=rng.normal(size=(n, 3)), dt=np.full(n, h)
    )
    blank = Named(
        constraint=np.full(n + 1, NO_CONSTRAINT),
        constraint_cov=np.zeros((n + 1, 3, 3)),
        zaru_rate=np.zeros((n + 1, 3)),
        zaru_variance=np.zeros(n + 1),
        time=marks - marks[0],
    )
    layout = SimpleNamespace(white=np.array([1e-8, 4e-8, 1e-8, 9.0, 9.0, 9.0]))
    out = with_zupt(blank, inc, np.array([[102.0, 104.6]]), layout)
    at = np.array([8, 12, 16])
    assert np.flatnonzero(out.constraint == ZUPT).tolist() == at.tolist()
    assert_allclose(out.constraint_cov[at], np.broadcast_to(9e-4 * np.eye(3), (3, 3, 3)))
    assert_allclose(out.zaru_rate[12], inc.dtheta[8:12].sum(axis=0))
    assert_allclose(out.zaru_variance[at], [0.0, 4e-8 + 25e-10, 4e-8 + 25e-10])
    free = with_nhc(out)
    assert np.flatnonzero(free.constraint == NHC).tolist() == [
        k for k in range(0, n + 1, 4) if k not in at
    ]
    assert_allclose(free.constraint_cov[0], np.diag([1.0, 0.09, 0.09]))
    assert_allclose(free.constraint_cov[8], 9e-4 * np.eye(3))
    slow = with_nhc(blank._replace(time=3.0 * np.arange(n + 1)))
    assert (slow.constraint == NHC).all()


def layout(beta, drive, sigma0) -> SimpleNamespace:
    arrays = (np.asarray(a, dtype=np.float64) for a in (beta, drive, sigma0))
    return SimpleNamespace(**dict(zip(("beta", "drive", "sigma0"), arrays, strict=True)))


def test_nodes_of_what_changes_slowly() -> None:
    """Oracle: by hand, of 1000 s with an event a second: a constant has one node, in the middle; a
    random walk one each 300 s; a process of 101 s one each half of that, one of 99 s none; nor has
    a state that is known."""
    time = np.arange(1001.0)
    states = layout(
        [0.0, 0.0, 1.0 / 101.0, 1.0 / 99.0, 0.0, 0.0],
        [0.0, 1.0, 1.0, 1.0, 1.0, 0.0],
        [1.0, 1.0, 1.0, 1.0, 0.0, 0.0],
    )
    event, state = nodes_of(states, time)
    assert event[state == 9].tolist() == [500]
    assert event[state == 10].tolist() == [125, 375, 625, 875]
    assert np.count_nonzero(state == 11) == 20  # 1000 / 50.5, up
    assert set(state) == {9, 10, 11}
    assert (np.diff(event) >= 0).all()


def test_nodes_are_two_hundred_at_most() -> None:
    """Oracle: by hand: intervals twice as long until all nodes are no more."""
    time = np.arange(0.0, 20000.0, 10.0)
    event, _ = nodes_of(layout([1e-2], [1.0], [1.0]), time)
    assert event.size == 200  # half of 400 at 50 s
    assert nodes_of(layout([0.0], [0.0], [1.0]), np.zeros(0))[0].size == 0


def test_whitened_errors_have_the_covariance_of_their_nodes() -> None:
    """Oracle: B (cov)^-1 B' by numpy, also of a covariance that rounding made singular."""
    rng = np.random.default_rng(1)
    root, cross = rng.normal(size=(4, 4)), rng.normal(size=(7, 4))
    cov = root @ root.T
    A = _whiten_cross(cross, cov)
    assert_allclose(A @ A.T, cross @ np.linalg.solve(cov, cross.T))
    same = np.ones((2, 2))
    A = _whiten_cross(np.ones((1, 2)), same)
    assert_allclose(A @ A.T, 1.0, rtol=1e-4)


@pytest.mark.parametrize("n", [1, 2, 5, 30])
def test_triangles_are_symmetric_matrices(n) -> None:
    """Oracle: numpy's lower triangles."""
    rng = np.random.default_rng(n)
    P = rng.normal(size=(3, n, n))
    P = P + np.swapaxes(P, 1, 2)
    packed = P[(slice(None), *np.tril_indices(n))]
    assert_array_equal(unpack_triangles(packed), P)
    assert_array_equal(diagonal(packed), np.diagonal(P, axis1=1, axis2=2))


def test_transitions_between_events_are_products_of_matrices() -> None:
    """Oracle: numpy: of each epoch the transition of all states, then (1 - K H) of each component
    of its measurements."""
    rng = np.random.default_rng(3)
    m, n, width = 7, 12, 12
    F = np.zeros((m, 9, n))
    F[:, :, :] = 0.1 * rng.normal(size=(m, 9, n))
    F[:, np.arange(9), np.arange(9)] += 1.0
    D = rng.uniform(0.8, 1.0, (m, n - 9))
    D[:, 0] = 1.0
    H, K = rng.normal(size=(m, 6, width)), 0.1 * rng.normal(size=(m, 6, n))
    S = np.ones((m, 6))
    S[2], S[4, 3:] = 0.0, 0.0
    event = np.full(m, ABSENT)
    event[[1, 4, 6]] = [0, 1, 2]
    transitions = EventTransitions.before(3, n, 6)
    slot, used = np.array([0, 3]), np.full(6, width)
    room = history_room(m, n, m, slot, used, np.full(m, ABSENT), 0, 3)
    event_transitions(event, room._replace(F=F, D=D, H=H, K=K, S=S), 0, transitions)
    expected, product = [], None
    for e in range(m):
        if product is not None:
            step = np.eye(n)
            step[:9], step[range(9, n), range(9, n)] = F[e], D[e]
            product = step @ product
            for first in (0, 3):
                if S[e, first] > 0.0:
                    for i in range(first, first + 3):
                        product = product - np.outer(K[e, i], H[e, i] @ product)
        if event[e] != ABSENT:
            expected.append(np.eye(n) if product is None else product)
            product = np.eye(n)
    assert_allclose(transitions.of_events, expected, atol=1e-12)


def test_what_a_strapdown_misses_is_given_back_without_a_kink() -> None:
    """Oracle: by hand: position by the cubic that begins with nothing and ends with miss and slope;
    scipy's Hermite spline; velocity and attitude in proportion."""
    from scipy.interpolate import CubicHermiteSpline
    from scipy.spatial.transform import Rotation

    share = np.linspace(0.0, 1.0, 9)
    miss = np.tile([0.3, -0.2, 0.1, 0.05, 0.02, -0.04, 0.2, -0.1, 0.3], (9, 1))
    nav = np.zeros((9, 10))
    nav[:, 6] = 1.0
    _give_back(nav, miss, share, np.full(9, 0.4))
    spline = CubicHermiteSpline([0.0, 0.4], [[0.0] * 3, miss[0, :3]], [[0.0] * 3, miss[0, 3:6]])
    assert_allclose(nav[:, :3], spline(0.4 * share), atol=1e-12)
    assert_allclose(nav[:, 3:6], share[:, None] * miss[:, 3:6])
    turned = Rotation.from_quat(nav[:, 6:], scalar_first=True).as_rotvec()
    assert_allclose(turned, share[:, None] * miss[:, 6:], atol=1e-12)
    start = np.zeros((9, 10))
    start[:, 6] = 1.0
    assert_allclose(nav_difference(nav, start)[-1], miss[-1], atol=1e-12)


@pytest.mark.parametrize("delay", [0.03, -0.03, 0.004, -0.004, 0.0])
def test_means_over_the_delay_of_an_event(delay) -> None:
    """Oracle: the integral by hand, over samples of 10 ms: from the stamp to the delay, or a sample
    long where that is shorter, less the bias."""
    n, h = 20, 0.01
    rate = np.arange(n, dtype=np.float64)[:, None] * [1.0, -2.0, 3.0]
    inc = SimpleNamespace(
        dt=np.full(n, h), dtheta=rate * h, dvel=2.0 * rate * h, nominal_s=h, stop=np.array([0, 10])
    )
    bias = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    layout = SimpleNamespace(channel_sum=lambda: np.eye(6), factor=np.full(6, BIAS))
    courses = {"time": np.zeros(2), "temperature": np.zeros(2)}
    solution = SimpleNamespace(
        problem=SimpleNamespace(inc=inc, layout=layout, epochs=SimpleNamespace(**courses)),
        x=np.tile(bias, (2, 1)),
    )
    got, force = _means(solution, np.array([1]), np.array([delay]))
    taken = {0.03: [10, 11, 12], -0.03: [7, 8, 9], 0.004: [10], -0.004: [9], 0.0: [10]}[delay]
    assert_allclose(got[0], rate[taken].mean(axis=0) - bias[:3])
    assert_allclose(force[0], 2.0 * rate[taken].mean(axis=0) - bias[3:])


@pytest.mark.parametrize(
    ("tilt_deg", "heading_deg", "sigma_deg", "nonlinear"),
    [
        (0.0, 1.9, 90.0, False),
        (0.0, 2.1, 90.0, True),  # a start that is two degrees off
        (1.2, 1.7, 90.0, True),
        (1.0, 1.0, 0.131, False),
        (1.0, 1.0, 0.130, True),  # a product of a fifth of a sigma: 1.5 deg^2
        (0.0, 1.0, 0.0437, False),
        (0.0, 1.0, 0.0435, True),  # half of the square of the heading
    ],
)
def test_when_the_flight_is_linearised_again(tilt_deg, heading_deg, sigma_deg, nonlinear) -> None:
    """Oracle: (N.1) by hand, on either side of a fifth of a sigma and of two degrees."""
    delta = np.zeros((3, 9))
    delta[:, 6], delta[:, 8] = np.radians(tilt_deg), np.radians(heading_deg)
    assert _nonlinear(delta, np.full((3, 9), np.radians(sigma_deg))) is nonlinear


def test_the_nominal_is_moved_by_its_errors() -> None:
    """Oracle: scipy's product of rotations, the error on the left; sums elsewhere."""
    from scipy.spatial.transform import Rotation

    rng = np.random.default_rng(7)
    C, delta = Rotation.random(5, rng=3), 0.3 * rng.normal(size=(5, 12))
    nav = np.hstack([rng.normal(size=(5, 6)), C.as_quat(scalar_first=True)])
    x, before = rng.normal(size=(5, 3)), nav.copy()
    expected = x + delta[:, 9:]
    inject_errors(nav, x, delta)
    turned = (Rotation.from_rotvec(delta[:, 6:9]) * C).as_matrix()
    assert_allclose(Rotation.from_quat(nav[:, 6:], scalar_first=True).as_matrix(), turned)
    assert_allclose(nav[:, :6], before[:, :6] + delta[:, :6])
    assert_allclose(x, expected)


@pytest.mark.parametrize(
    ("minutes", "resets", "rejected", "refused"),
    [
        (9.9, 3, 0, False),
        (9.9, 4, 0, True),  # three, and one each ten minutes
        (10.1, 4, 0, False),
        (20.1, 5, 0, False),
        (20.1, 6, 0, True),
        (1.0, 0, 50, False),
        (1.0, 0, 51, True),  # more than half
    ],
)
def test_when_a_flight_does_not_follow_its_fixes(minutes, resets, rejected, refused) -> None:
    """Oracle: limits by hand, on either side."""
    kinds = [COVARIANCE_RESET] * resets + [REJECTED] * rejected
    kinds += [USED] * (100 - len(kinds)) + [NOT_MEASURED] * 30
    verdict, n = np.full((130, 5), NOT_MEASURED), 130
    verdict[:, 0] = kinds
    problem = SimpleNamespace(
        inc=SimpleNamespace(marks=np.linspace(5.0, 5.0 + 60.0 * minutes, n)),
        epochs=SimpleNamespace(time=np.linspace(0.0, 60.0 * minutes, n)),
        gate=14.0,
    )
    history = SimpleNamespace(
        sigma=np.ones((n, 9)), nav=np.ones((n, 10)), verdict=verdict, nis=np.full((n, 5), 99.0)
    )
    if not refused:
        refuse_divergence(problem, history)
        history.sigma[40:, 3] = np.nan
        with pytest.raises(DataError, match=f"diverged at {problem.inc.marks[40]:.3f} s"):
            refuse_divergence(problem, history)
        return
    with pytest.raises(DataError, match=rf"{rejected} of 100 GNSS fixes rejected, from 5\.0 s on"):
        refuse_divergence(problem, history)


def test_outages_and_rows_that_are_kept() -> None:
    """Oracle: by hand: epochs after a fix that is the last for more than five seconds, up to the
    next one; every so many epochs, both ends and the events."""
    time = np.array([0.0, 1.0, 2.0, 4.0, 6.9, 7.0, 12.0, 12.1, 13.0])
    has = np.array([1, 1, 0, 0, 0, 1, 0, 1, 1], dtype=bool)
    withheld = np.zeros(9, dtype=bool)
    epochs = SimpleNamespace(
        time=time,
        has_position=has,
        withheld=withheld,
        stop=np.arange(9),
        event=np.full(9, ABSENT),
    )
    assert outages(epochs).tolist() == [ABSENT, ABSENT, 0, 1, 2, 3, 4, 5, ABSENT]
    withheld[7] = True
    time[7:] = 12.0
    assert outages(epochs).tolist() == [
        ABSENT,
        ABSENT,
        0,
        1,
        2,
        3,
        ABSENT,
        ABSENT,
        ABSENT,
    ]
    epochs.event[5] = 0
    layout = SimpleNamespace(size=9, read_of_events=np.arange(9))
    problem = SimpleNamespace(epochs=epochs, layout=layout)
    assert _kept_rows(problem, 0).tolist() == [0, 5, 8]
    assert _kept_rows(problem, 3).tolist() == [0, 3, 5, 6, 8]
    assert _kept_rows(problem, 9).tolist() == list(range(9))
    layout.size = 3000  # whose covariances take more than those of events may
    assert _kept_rows(problem, 3).tolist() == [0, 3, 6, 8]


def test_where_the_triples_of_a_kind_stand() -> None:
    """Oracle: by hand: three rows each of what is measured; a position depends on navigation alone
    where the fixes have no states, a velocity constraint always."""
    epochs = SimpleNamespace(
        has_velocity=np.array([False]),
        constraint=np.array([ZUPT]),
        zaru_variance=np.zeros(1),
        barometer_variance=np.ones(1),
        linear_cov=np.zeros((1, 1, 3, 3)),
    )
    for of_fixes, columns in ((True, 30), (False, 9)):
        slot, used = measured_slots(epochs, SimpleNamespace(size=30, of_fixes=of_fixes))
        assert slot.tolist() == [0, ABSENT, 3, ABSENT, 6, 9]
        assert used.tolist() == [columns] * 3 + [9] * 3 + [30] * 6


def test_a_negative_variance_is_refused_with_its_instant() -> None:
    """Oracle: by hand: the first of the instants with one."""
    P = np.tile(np.eye(9)[np.tril_indices(9)], (4, 1))
    problem = SimpleNamespace(inc=SimpleNamespace(marks=np.array([10.0, 11.0, 12.0, 13.0])))
    refuse_negative_variances(problem, P)
    P[2, 5], P[3, 0] = -1.0, np.nan
    with pytest.raises(DataError, match=r"negative variances from 12\.0 s on"):
        refuse_negative_variances(problem, P)


def test_fixes_are_taken_as_they_claim_by_default() -> None:
    """Oracle: by hand: factors of one of every kind; a factor that is set stands in its own row."""
    model = load_noise_model("navchip")
    assert_array_equal(state_layout(model).white_scales, np.ones((3, 3)))
    errors = FixErrors(
        white_scale=(2.0, 3.0, 4.0), unfixed_white_scale=5.0, velocity_white_scale=6.0
    )
    expected = [[2.0, 3.0, 4.0], [5.0] * 3, [6.0] * 3]
    assert_array_equal(state_layout(model, fixes=errors).white_scales, expected)
