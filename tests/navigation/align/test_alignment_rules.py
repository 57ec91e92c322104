"""The rules of the alignment: which window is taken, how wide the start is, by closed forms."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad_vec
from scipy.spatial.transform import Rotation

from insgnss.base.errors import DataError
from insgnss.navigation.align import coarse, initial
from insgnss.navigation.align._kernels import relative_motion
from insgnss.navigation.align.coarse import _attitude_cov, _robust_wahba, _unsteadiness
from insgnss.navigation.align.coarse import _candidates as coarse_candidates
from insgnss.navigation.align.initial import _aligned_window, _coarse_start, _first_velocity, _start
from insgnss.navigation.align.standing import StandingAttitude, longest_rest
from insgnss.navigation.align.turn_on import _kalman_update, _mean
from insgnss.navigation.filter.codes import ZUPT


def window(heading_deg: float, nis: float = 2.4) -> SimpleNamespace:
    """A solved window: how well it knows its heading, and how well it fits its fixes."""
    cov = np.zeros((1, 9, 9))
    cov[0, 8, 8] = np.radians(heading_deg) ** 2
    return SimpleNamespace(nis=np.full((5, 4), nis), nav_covariance=lambda *_: cov)


def taken(monkeypatch, windows, standing=None):
    """The first epoch of the window that is taken, of those that are solved in this order."""
    monkeypatch.setattr(initial, "standing_attitude", lambda _: standing)
    monkeypatch.setattr(
        initial, "_candidates", lambda *_: ((k, one, None) for k, one in enumerate(windows))
    )
    monkeypatch.setattr(initial, "_estimate_window", lambda one, _: one)
    return _aligned_window(None)[0]


@pytest.mark.parametrize(
    ("windows", "first"),
    [
        ([window(3.0), window(1.9), window(0.1)], 1),  # the earliest good to two degrees
        ([window(3.0), window(2.1), window(2.5)], 1),  # else the one that knows it best
        ([window(9.5)], 0),  # up to ten degrees
        ([window(0.1, 26.0), window(1.0, 24.0)], 1),  # what does not fit its fixes is none
        ([None, window(1.0)], 1),  # nor what has no solution
    ],
)
def test_which_window_the_flight_starts_from(monkeypatch, windows, first) -> None:
    """Oracle: the rules of the module's docstring, by hand."""
    assert taken(monkeypatch, windows) == first


@pytest.mark.parametrize(
    ("windows", "message"),
    [
        (
            [window(10.5)],
            r"heading not observable: .* gives the heading to 1[01] deg only \(limit 10\)",
        ),
        ([window(0.1, 26.0), window(11.0)], r"median NIS of the fixes 26 at best, limit 25"),
        ([window(0.1, 40.0), window(0.1, 30.0)], "median NIS of the fixes 30 at best"),
        ([None], "no initial attitude: GNSS and inertial motion agree in no part"),
    ],
)
def test_which_windows_give_no_start(monkeypatch, windows, message) -> None:
    """Oracle: the rules of the module's docstring, by hand."""
    with pytest.raises(DataError, match=message):
        taken(monkeypatch, windows)


def test_a_good_window_excuses_those_that_do_not_fit(monkeypatch) -> None:
    """Oracle: by hand: 9 deg is no hopeless heading, so a misfit elsewhere refuses nothing."""
    assert taken(monkeypatch, [window(0.1, 30.0), window(9.0)]) == 1
    standing = StandingAttitude(0, 9, np.eye(3), 0.01, 1.0)
    assert taken(monkeypatch, [window(9.0)], standing) == 0
    with pytest.raises(DataError, match=r"standing, roll 0\.00 .* at best \(limit 10 deg\)"):
        taken(monkeypatch, [window(11.0)], standing)


@pytest.mark.parametrize(("sigma_deg", "knows"), [(19.0, True), (21.0, False)])
def test_a_stand_knows_its_heading_to_twenty_degrees(sigma_deg, knows) -> None:
    """Oracle: the limit, on either side."""
    attitude = StandingAttitude(0, 9, np.eye(3), 0.01, np.radians(sigma_deg))
    assert attitude.knows_heading == knows


def problem(time, position=None, *, sigma_m=0.01, velocity=None, sigma0=(), **more):
    """What the alignment reads of a problem: its epochs with fixes, and its layout."""
    n = time.size
    zeros = np.zeros((n, 3))
    epochs = SimpleNamespace(
        time=time,
        position=zeros if position is None else position,
        has_position=np.ones(n, dtype=bool),
        position_cov=np.broadcast_to(sigma_m**2 * np.eye(3), (n, 3, 3)),
        velocity=zeros if velocity is None else velocity,
        has_velocity=np.full(n, velocity is not None),
        **more,
    )
    sigma0 = np.asarray(sigma0 or np.zeros(6), dtype=np.float64)
    layout = SimpleNamespace(
        size=9 + sigma0.size, sigma0=sigma0, channel_sum=lambda: np.eye(6, sigma0.size)
    )
    return SimpleNamespace(epochs=epochs, layout=layout, antenna_lever_b=np.zeros(3))


@pytest.mark.parametrize(("sigma_m", "wide"), [(0.01, (10.0, 5.0)), (4.0, (40.0, 8.0))])
def test_a_start_knows_neither_position_nor_velocity(sigma_m, wide) -> None:
    """Oracle: by hand: 10 m and 5 m/s, or ten and twice what a fix is unsure by; the IMU's a-priori
    sigmas; the mean takes off what it is linearised about."""
    sigma0, att, x = [1e-3] * 3 + [2e-2] * 3, np.diag([1e-4, 2e-4, 3e-4]), np.arange(6.0)
    start = _start(
        problem(np.arange(3.0), sigma_m=sigma_m / np.sqrt(3.0), sigma0=sigma0), np.ones(10), att, x
    )
    assert_allclose(np.sqrt(np.diag(start.P)[:6]), np.repeat(wide, 3))
    assert_allclose(start.P[6:9, 6:9], att)
    assert_allclose(np.diag(start.P)[9:], np.square(sigma0))
    assert_allclose(start.mean, [*np.zeros(9), *-x])


def test_a_coarse_start_leaves_its_heading_unknown() -> None:
    """Oracle: by hand: half a degree more than the coarse tilt says, thirty at most; pi."""
    own = problem(np.arange(3.0))
    for tilt_deg, expected in ((2.0, 2.5), (40.0, 30.0)):
        cov = np.radians(tilt_deg) ** 2 * np.eye(3)
        attitude = coarse.CoarseAttitude(0, 2, np.eye(3), np.array([1.0, 2.0, 3.0]), cov)
        start = _coarse_start(own, attitude)
        sigma = np.degrees(np.sqrt(np.diag(start.P)[6:9]))
        assert_allclose(sigma, [expected, expected, 180.0])
        assert_allclose(start.nav[3:6], [1.0, 2.0, 3.0])


def test_the_first_velocity_is_that_of_two_seconds() -> None:
    """Oracle: numpy's polynomial fit to the fixes of the first two seconds; a Doppler velocity
    where there is one."""
    time = np.arange(0.0, 6.0, 0.2)
    position = np.column_stack([time**2, 3.0 * time, np.sin(time)])
    early = time < 2.0
    expected = np.polyfit(time[early], position[early], 1)[0]
    assert_allclose(_first_velocity(problem(time, position)), expected, rtol=1e-9)
    given = np.tile([7.0, 8.0, 9.0], (time.size, 1))
    assert_allclose(_first_velocity(problem(time, position, velocity=given)), [7.0, 8.0, 9.0])
    assert_allclose(_first_velocity(problem(5.0 * time, position)), np.diff(position, axis=0)[0])
    some = problem(time, position, velocity=given)
    some.epochs.has_velocity[0] = False  # the first fix decides
    assert_allclose(_first_velocity(some), expected, rtol=1e-9)


def test_integrated_force_of_a_steady_turn() -> None:
    """Oracle: scipy's rotations and quadrature: of a constant rate and force, v = int C f and s =
    int v, from the first mark on, not from the first sample."""
    rate, force, h = np.array([0.5, -0.3, 0.8]), np.array([1.0, 2.0, -9.8]), 1e-3
    n, stop = 2000, np.array([300, 1100, 2000])
    dtheta, dvel = np.tile(rate * h, (n, 1)), np.tile(force * h, (n, 1))
    out = np.empty((3, 15))
    relative_motion(np.full(n, h), dtheta, dvel, stop, out)
    for k, t in enumerate(h * (stop - stop[0])):
        turned = lambda u: Rotation.from_rotvec(u * rate).as_matrix() @ force  # noqa: E731
        v = quad_vec(turned, 0.0, t, epsabs=1e-9)[0]
        s = quad_vec(lambda u, t=t, turned=turned: (t - u) * turned(u), 0.0, t, 1e-9)[0]
        assert_allclose(out[k, :3], v, atol=3e-6)  # (rate h)^2 of force t
        assert_allclose(out[k, 3:6], s, atol=3e-6)
        assert_allclose(
            out[k, 6:].reshape(3, 3), Rotation.from_rotvec(t * rate).as_matrix(), atol=1e-12
        )


def test_rotation_of_a_large_increment_is_exact_to_its_series() -> None:
    """Oracle: scipy: increments of 0.2 rad, of which the terms beyond r^2 / 24 are 1e-9."""
    turn = np.array([[0.1, -0.12, 0.12], [-0.05, 0.15, 0.1]])
    out = np.empty((2, 15))
    relative_motion(np.ones(2), turn, np.zeros((2, 3)), np.array([0, 2]), out)
    exact = (Rotation.from_rotvec(turn[0]) * Rotation.from_rotvec(turn[1])).as_matrix()
    assert_allclose(out[1, 6:].reshape(3, 3), exact, atol=1e-8)


def test_unsteadiness_is_the_median_distance_from_a_line() -> None:
    """Oracle: numpy's fit of a line to each coordinate and its median; heights do not count."""
    rng = np.random.default_rng(5)
    for n in (20, 21):
        time, position = np.sort(rng.uniform(0.0, 10.0, n)), rng.normal(size=(n, 3))
        left = [p - np.polyval(np.polyfit(time, p, 1), time) for p in position[:, :2].T]
        assert _unsteadiness(time, position) == pytest.approx(np.median(np.abs(left)))


def test_windows_are_the_liveliest_of_each_length() -> None:
    """Oracle: numpy's fits of a line to windows of 10, 20 and 60 s that begin every half of that:
    the four with the largest median distance from it, and the first above the median of all;
    windows of less than five fixes are none."""
    time = np.arange(0.0, 121.0)
    position = np.cumsum(np.random.default_rng(6).normal(size=(121, 3)), axis=0)
    expected = []
    for length in (10, 20, 60):
        cut = [np.arange(k, min(k + length, 120) + 1) for k in range(0, 120, length // 2)]
        left = [
            [p - np.polyval(np.polyfit(w, p, 1), w) for p in position[w, :2].T]
            for w in cut
            if w.size >= 5
        ]
        size = np.array([np.median(np.abs(one)) for one in left])
        expected += [cut[k].tolist() for k in np.argsort(size)[::-1][:4]]
        expected.append(cut[int(np.flatnonzero(size > np.median(size))[0])].tolist())
    assert [w.tolist() for w in coarse_candidates(problem(time, position))] == expected
    assert coarse_candidates(problem(20.0 * np.arange(4.0))) == []


def test_outliers_do_not_turn_wahbas_solution() -> None:
    """Oracle: the rotation that made the pairs; one row in ten is off by a hundred sigmas. The
    misfit is that of the noise, in sigmas of a row's three components."""
    rng = np.random.default_rng(2)
    C = Rotation.from_rotvec([0.3, -0.5, 1.0]).as_matrix()
    a, tau = 50.0 * rng.normal(size=(300, 3)), np.linspace(0.0, 10.0, 300)
    design = np.column_stack([np.ones(300), tau])
    z = a @ C.T + design @ [[3.0, 1.0, 2.0], [0.5, -0.2, 0.1]] + rng.normal(size=(300, 3))
    z[::10] += 100.0
    turned, v0, _, misfit = _robust_wahba(design, z, a)
    error = Rotation.from_matrix(turned @ C.T).magnitude()
    assert error < 5e-3
    assert_allclose(v0, [0.5, -0.2, 0.1], atol=0.25)
    assert misfit == pytest.approx(1.0, rel=0.15)


def test_covariance_of_a_coarse_attitude() -> None:
    """Oracle: (A.2) and the biases by hand: a gyro bias over half of the window, an accelerometer
    bias against gravity and against the manoeuvre's acceleration, 12 rms / length^2."""
    seen = np.array([[30.0, 0.0, 0.0], [0.0, 40.0, 0.0], [0.0, 0.0, 50.0], [10.0, 10.0, 10.0]])
    sigma0 = [1e-3, 2e-3, 3e-3, 0.01, 0.05, 0.02]
    cov = _attitude_cov(problem(np.arange(3.0), sigma0=sigma0), seen, 2.0, 20.0, np.full(4, 5.0))
    information = np.sum(seen**2) * np.eye(3) - seen.T @ seen
    turn, moved = 3e-3 * 10.0, np.sqrt(np.mean(seen[:, :2] ** 2)) / 5.0 * 12.0 / 400.0
    tilt, heading = (0.05 / 9.8) ** 2 + turn**2, (0.05 / moved) ** 2 + turn**2
    assert_allclose(cov, 4.0 * np.linalg.inv(information) + np.diag([tilt, tilt, heading]))
    calm = _attitude_cov(problem(np.arange(3.0), sigma0=sigma0), seen, 0.5, 20.0, np.full(4, 5.0))
    assert_allclose(calm, cov - 3.0 * np.linalg.inv(information))


@pytest.mark.parametrize(
    ("pieces", "rest"),
    [
        ([(0, 29)], None),
        ([(0, 30)], (0, 30)),
        ([(0, 40), (43, 90)], (43, 90)),  # 3 s without a ZUPT end a stand
        ([(0, 50), (60, 95)], (0, 50)),  # the longest, not the last
        ([(0, 40), (42, 90)], (0, 90)),  # 2 s do not
        ([(5, 900)], (5, 605)),  # ten minutes at most
    ],
)
def test_a_stand_lasts_from_half_a_minute_to_ten(pieces, rest) -> None:
    """Oracle: seconds by hand, an epoch each."""
    time = np.arange(0.0, 1000.0)
    constraint = np.zeros(time.size, dtype=np.int64)
    for first, last in pieces:
        constraint[first : last + 1] = ZUPT
    assert longest_rest(problem(time, constraint=constraint)) == rest


@dataclass(frozen=True)
class Window:
    """What a window's second attempt changes."""

    gate: float = 14.0
    huber_threshold: float = np.inf


def test_a_window_that_rejects_its_fixes_is_solved_with_all_of_them(monkeypatch) -> None:
    """Oracle: by hand: an open gate, and fixes beyond four sigmas weighed down; None where that
    fails too."""
    tried = []

    def solve(window, start, *_, **__):
        tried.append((window.gate, window.huber_threshold))
        if window.gate < np.inf or start == "hopeless":
            raise DataError("rejected")
        return "solved"

    monkeypatch.setattr(initial, "solve", solve)
    assert initial._estimate_window(Window(), "start") == "solved"
    assert tried == [(14.0, np.inf), (np.inf, 16.0)]
    assert initial._estimate_window(Window(), "hopeless") is None


@pytest.mark.parametrize("known", [True, False])
def test_windows_to_try_in_the_order_of_time(monkeypatch, known) -> None:
    """Oracle: by hand: a stand that knows its heading first, then the five most certain coarse
    attitudes by their time, of a minute or as long as they are."""
    time = np.arange(0.0, 200.0)
    coarse_ones = [
        coarse.CoarseAttitude(first, last, np.eye(3), np.zeros(3), np.eye(3))
        for first, last in ((90, 100), (30, 130), (190, 195), (60, 70), (10, 20), (0, 5))
    ]
    monkeypatch.setattr(initial, "coarse_attitudes", lambda _: coarse_ones)
    monkeypatch.setattr(initial, "sub_problem", lambda _, first, last: (first, last))
    monkeypatch.setattr(initial, "_coarse_start", lambda window, one: one.first)
    monkeypatch.setattr(initial, "_nav", lambda *_: None)
    monkeypatch.setattr(initial, "_start", lambda window, nav, att: np.sqrt(np.diag(att)))
    stand = StandingAttitude(3, 150, np.eye(3), 0.01, 0.2 if known else 0.5)
    tries = list(initial._candidates(problem(time), stand))
    if known:
        first, window, sigma = tries.pop(0)
        assert (first, window) == (3, (3, 150))
        assert_allclose(sigma, np.array([0.01, 0.01, 0.2]) + np.radians([0.05, 0.05, 0.1]))
    assert [window for _, window, _ in tries] == [
        *((10, 70), (30, 130), (60, 120), (90, 150), (190, 199))
    ]


@pytest.mark.parametrize("count", [2, 3, 4])
def test_means_of_stands_scatter_where_there_are_three(count) -> None:
    """Oracle: numpy: the weighted mean; white noise of all samples, or the standard error of three
    means and more; a floor."""
    rng = np.random.default_rng(count)
    means, std = rng.normal(size=(count, 3)), np.full((count, 3), 2.0)
    samples = np.full(count, 100)
    mean, sigma = _mean(means, std, samples, 1e-3)
    assert_allclose(mean, means.mean(axis=0))
    white = 2.0 / np.sqrt(100.0 * count)
    scatter = means.std(axis=0, ddof=1) / np.sqrt(count) if count > 2 else np.zeros(3)
    assert_allclose(sigma, np.maximum(white, scatter))
    assert_allclose(_mean(0.0 * means, 0.0 * std, samples, 1e-3)[1], 1e-3)
    unequal, _ = _mean(means, std, np.arange(1, count + 1), 1e-3)
    assert_allclose(unequal, np.average(means, axis=0, weights=np.arange(1, count + 1)))


@pytest.mark.parametrize("rows", [1, 3])
def test_the_update_of_a_bias_is_that_of_information(rows) -> None:
    """Oracle: numpy's information form: the sum of what was known and what was measured."""
    rng = np.random.default_rng(rows)
    P, H, z = np.diag([0.5, 1.0, 2.0]), rng.normal(size=(rows, 3)), rng.normal(size=rows)
    root = rng.normal(size=(rows, rows))
    R = root @ root.T + 0.5 * np.eye(rows)
    expected = np.linalg.inv(np.linalg.inv(P) + H.T @ np.linalg.solve(R, H))
    x, cov = _kalman_update(P, H, z, R)
    assert_allclose(cov, expected, atol=1e-12)
    assert_allclose(x, expected @ H.T @ np.linalg.solve(R, z), atol=1e-12)


def test_the_start_is_ten_times_as_wide_as_the_window_knows(monkeypatch):
    """Oracle: the sum of variances: the window's ten times as wide, and 0.5, 0.5, 1 deg."""
    sigma = np.radians([0.2, 0.3, 0.4])
    P = np.zeros((9, 9))
    P[range(6, 9), range(6, 9)] = sigma**2
    solved = SimpleNamespace(
        covariance=lambda _: P[None], nav=[None], x=[None], time=np.array([5.0, 65.0])
    )
    monkeypatch.setattr(initial, "_aligned_window", lambda _: (0, solved))
    monkeypatch.setattr(initial, "_start", lambda problem, nav, cov, x: cov)
    aligned = initial.initial_state(None)
    floor = np.radians([0.5, 0.5, 1.0])
    assert_allclose(aligned.start, np.diag(100.0 * sigma**2 + floor**2))
    assert (aligned.window, aligned.heading_sigma) == ((5.0, 65.0), pytest.approx(sigma[2]))
