"""The recogniser's signals and its least squares against dense algebra and central differences."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from insgnss.navigation.recognise.fit import (
    PRIOR_SIGMAS,
    _about_window_mean,
    _Model,
    _solve,
    _wahba,
    _weighted_median,
    scan_lags,
)
from insgnss.navigation.recognise.handedness import exchange_axes, explains, is_mirrored
from insgnss.navigation.recognise.positions import (
    _fast,
    _mean_velocities,
    _mean_velocity,
    _off,
    _pairs,
)
from insgnss.navigation.recognise.signal import (
    Accelerations,
    _most_moved,
    _nearest,
    _without_spikes,
    accelerations,
    dead_channel,
    imu_grid,
    propagate_force,
)
from insgnss.records import GnssFixes, ImuSamples


def turning(n=1500, hz=50.0, seed=1) -> ImuSamples:
    """Smooth rates and forces of a body that turns all the time."""
    t = 100.0 + np.arange(n) / hz
    phase = np.random.default_rng(seed).uniform(0.0, 6.0, (6, 1))
    wave = np.sin(np.outer([0.9, 1.3, 0.7, 1.1, 0.8, 0.5], t) + phase).T
    return ImuSamples(t, 0.4 * wave[:, :3], 3.0 * wave[:, 3:] - [0.0, 0.0, 9.8])


def motion(imu: ImuSamples, lag: float, C: np.ndarray, lever: np.ndarray) -> Accelerations:
    """What fixes late by `lag` would see of the integrated force, turned by C, at some nodes."""
    moved = propagate_force(imu_grid(imu), 1.0, 1.0)
    first = np.arange(imu.time[0] + 2.0, imu.time[-1] - 4.0, 0.5)
    nodes = np.column_stack([first, first + 1.0, first + 1.0])
    coef = np.tile([-1.0, 0.0, 1.0], (first.size, 1))
    window = ((first - first[0]) / 9.0).astype(np.int64)
    acc = Accelerations(
        "velocity", 1.0, nodes, coef, np.zeros((first.size, 3)), 1.0 + 0.0 * first, window
    )
    theta = np.zeros(8)
    theta[0], theta[1:4] = lag, lever
    u, *_ = _Model(moved, acc, 1).rows(theta, np.ones(first.size, dtype=bool))
    return replace(acc, z=u @ C.T)


LEVER = np.array([0.2, -0.1, 0.3])
TURN = Rotation.from_rotvec([0.3, -0.2, 1.1]).as_matrix()


def test_a_scan_explains_all_at_the_right_lag() -> None:
    """Oracle: the lag, the turn and no lever arm that made the accelerations; numpy's singular
    values elsewhere."""
    imu = turning()
    acc = motion(imu, 0.5, TURN, np.zeros(3))
    moved = propagate_force(imu_grid(imu), 1.0, 1.0)
    one = scan_lags(moved, acc, np.array([0.0, 0.5, 1.0]))
    assert one.best == 1
    assert one.score[1] == pytest.approx(1.0, abs=1e-6)
    assert one.down[1] < one.up[1]
    felt, *_ = _Model(moved, acc, 1).rows(np.zeros(8), np.ones(len(acc.z), dtype=bool))
    left, whole, used = 0.0, 0.0, 0
    for k in range(acc.window.max() + 1):
        rows = acc.window == k
        z, a = acc.z[rows], felt[rows]
        s = np.linalg.svd(z.T @ a)[1]
        sign = np.sign(np.linalg.det(z.T @ a))
        if rows.sum() < 5:
            continue
        left += np.sum(z**2) - (s[0] + s[1] + sign * s[2]) ** 2 / np.sum(a**2)
        whole += np.sum(z**2) - np.sum(z.sum(axis=0) ** 2) / rows.sum()
        used += 1
    assert one.up[0] == pytest.approx(1.0 - left / whole, abs=2e-3)
    n = np.isin(acc.window, np.flatnonzero(np.bincount(acc.window) >= 5)).sum()
    assert one.samples[0] == pytest.approx(3.0 * n * 0.5 - 4.0 * used)


@pytest.mark.parametrize("kind", ["velocity", "position"])
def test_derivatives_of_the_least_squares(kind) -> None:
    """Oracle: central differences of the rows by lag, lever arm, scale factor and gyro bias."""
    imu = turning()
    acc = replace(motion(imu, 0.0, np.eye(3), np.zeros(3)), kind=kind)
    if kind == "position":
        acc = replace(
            acc,
            nodes=acc.nodes[:, :1] + [0.0, 0.5, 1.0],
            coef=np.tile([4.0, -8.0, 4.0], (len(acc.z), 1)),
        )
    model = _Model(propagate_force(imu_grid(imu), 1.0, 1.0), acc, -1)
    use = np.ones(len(acc.z), dtype=bool)
    _, J, *_ = model.rows(np.zeros(8), use)
    step = np.array([1e-3, *[1e-3] * 3, 1e-4, *[1e-5] * 3])
    for k in range(8):
        theta = np.zeros(8)
        theta[k] = step[k]
        ahead, behind = (model.rows(s * theta, use)[0] for s in (1.0, -1.0))
        numeric = (ahead - behind) / (2.0 * step[k])
        assert_allclose(J[:, :, k], numeric, atol=2e-2 * max(1.0, np.abs(numeric).max()))


def test_rows_that_lie_inside_the_recording() -> None:
    """Oracle: by hand: both ends of a difference, moved by the lag, on the grid in one piece."""
    imu = turning(500)
    keep = np.abs(imu.time - 105.0) > 0.4
    imu = ImuSamples(imu.time[keep], imu.gyro[keep], imu.accel[keep])
    grid = imu_grid(imu)
    assert grid.broken[-1] == pytest.approx(0.82 / 0.02, abs=1.0)
    first = np.array([99.9, 100.1, 103.0, 104.2, 105.6, 108.85, 109.2])
    acc = SimpleNamespace(kind="velocity", nodes=np.column_stack([first, first, first + 1.0]))
    model = _Model(propagate_force(grid, 1.0, 1.0), acc, 1)
    assert model.inside(0.0).tolist() == [False, True, True, False, True, True, False]
    assert model.inside(0.2).tolist() == [True, True, True, False, True, False, False]


def test_a_step_is_that_of_all_normal_equations() -> None:
    """Oracle: numpy's solution of the whole system, in which each window has a rotation of its
    own with a sigma of one radian; the covariance of a window's heading."""
    rng = np.random.default_rng(4)
    n, window = 40, np.sort(np.arange(40) % 3)
    felt, J, r = rng.normal(size=(n, 3)), rng.normal(size=(n, 3, 8)), rng.normal(size=(n, 3))
    C = Rotation.random(3, rng=1).as_matrix()
    robust, sigma = rng.uniform(0.3, 1.0, n), np.array([0.5, 0.5, 0.8])
    theta = 0.01 * rng.normal(size=8)
    step, psi, H, g, yaw = _solve(J, C, felt, r, robust, sigma, window, theta)
    A = np.zeros((3 * n, 17))
    scale = np.sqrt(robust)[:, None] / sigma
    for i in range(n):
        w = window[i]
        A[3 * i : 3 * i + 3, 3 * w : 3 * w + 3] = np.cross(np.eye(3), -felt[i]) * scale[i][:, None]
        A[3 * i : 3 * i + 3, 9:] = C[w] @ J[i] * scale[i][:, None]
    free = np.r_[1e-6, np.ones(7)]
    N = A.T @ A + np.diag([*np.ones(9), *(free / PRIOR_SIGMAS**2)])
    b = A.T @ (r * scale).ravel()
    b[9:] -= np.r_[0.0, np.ones(7)] * theta / PRIOR_SIGMAS**2
    exact = np.linalg.solve(N, b)
    assert_allclose(psi.ravel(), exact[:9], atol=1e-9)
    assert_allclose(step, exact[9:], atol=1e-9)
    whole = N - np.diag([*np.zeros(9), *(free / PRIOR_SIGMAS**2)])
    reduced = whole[9:, 9:] - whole[9:, :9] @ np.linalg.solve(whole[:9, :9], whole[:9, 9:])
    assert_allclose(H, reduced, atol=1e-8)
    assert g.shape == (3, 8)
    assert_allclose(yaw, np.sqrt(np.diag(np.linalg.inv(N[:9, :9]))[2::3]))


def test_small_parts_of_the_fit() -> None:
    """Oracle: numpy: means of windows, the median where all weigh alike, the rotations made."""
    rng = np.random.default_rng(5)
    window, x = np.array([0, 0, 0, 1, 1, 2]), rng.normal(size=(6, 4))
    for k in range(3):
        rows = window == k
        assert_allclose(_about_window_mean(x, window)[rows], x[rows] - x[rows].mean(axis=0))
    values = rng.normal(size=101)
    assert _weighted_median(values, np.ones(101)) == np.median(values)
    assert _weighted_median(np.array([3.0, 1.0, 2.0]), np.array([5.0, 1.0, 1.0])) == 3.0
    C = Rotation.random(3, rng=2).as_matrix()
    a = rng.normal(size=(60, 3))
    of = np.arange(60) % 3
    z = np.einsum("nij,nj->ni", C[of], a)
    assert_allclose(_wahba(z, a, rng.uniform(0.1, 1.0, 60), of, 3), C, atol=1e-12)


@pytest.mark.parametrize(("times", "left"), [(9.9, 0), (10.1, 1)])
def test_a_single_reading_far_off_its_neighbours(times, left) -> None:
    """Oracle: by hand: ten times the distance that a tenth exceeds; its neighbours' mean."""
    x = np.zeros((101, 3))
    x[1::2, 0] = 1.0
    before = x.copy()
    x[50, 0] = 1.0 - times
    found = _without_spikes(x.copy())
    assert np.count_nonzero((found != x).any(axis=1)) == left
    assert found[50, 0] == (before[49, 0] if left else x[50, 0])


@pytest.mark.parametrize(
    ("seconds", "length_s", "moves", "dead"),
    [
        (60.0, 19.9, True, False),
        (60.0, 20.2, True, True),
        (100.0, 29.9, True, False),
        (100.0, 30.2, True, True),
        (60.0, 20.2, False, False),
    ],
)
def test_a_channel_without_a_change(seconds, length_s, moves, dead) -> None:
    """Oracle: by hand: 20 s, three tenths of the recording, while another one moves."""
    n, rng = round(50 * seconds), np.random.default_rng(6)
    values = rng.normal(size=(n, 6))
    run = slice(200, 200 + round(50 * length_s))
    values[run, 1] = 0.5
    if not moves:
        values[run, [0]], values[run, [2]] = 0.1, 0.2
    imu = ImuSamples(np.arange(n) / 50.0, values[:, :3], values[:, 3:])
    assert dead_channel(imu) == ("gyro y" if dead else "")


def fixes(t, sigma=0.01, velocity=True) -> GnssFixes:
    way = np.column_stack([np.sin(t), np.cos(0.7 * t), 0.1 * t]) * 30.0
    speed = np.column_stack([np.cos(t), -0.7 * np.sin(0.7 * t), 0.1 + 0.0 * t]) * 30.0
    cov = np.square(np.broadcast_to(sigma, t.shape))[:, None, None] * np.eye(3)
    return GnssFixes(
        t,
        way[:, 0] / 6335439.327,
        way[:, 1] / 6378137.0,
        500.0 - way[:, 2],
        cov,
        speed if velocity else None,
        cov if velocity else None,
    )


@pytest.mark.parametrize(("kind", "half"), [("velocity", 0.5), ("position", 0.5)])
def test_which_fixes_make_a_difference(kind, half) -> None:
    """Oracle: by hand: nodes half a second apart (a second for positions), within three tenths of
    the whole length and 15 % in the middle; two halves make the second difference."""
    t = np.concatenate([np.arange(0.0, 10.0, 0.1), np.arange(13.0, 25.0, 0.1)])
    acc = accelerations(fixes(t), np.ones(t.size, dtype=bool), kind, half, dense=True)
    size = half if kind == "velocity" else 2.0 * half
    assert acc.span_s == size
    length = acc.nodes[:, 2] - acc.nodes[:, 0]
    assert (np.abs(length - size) < 0.3 * size).all()
    begins = t[(t < 9.9 - 0.7 * size) | ((t > 12.0) & (t < 24.9 - 0.7 * size))]
    if kind == "velocity":
        assert_allclose(acc.nodes[:, 0], begins)
        assert_allclose(acc.coef[:, [0, 2]], np.column_stack([-1.0 / length, 1.0 / length]))
    else:
        h1, h2 = acc.nodes[:, 1] - acc.nodes[:, 0], acc.nodes[:, 2] - acc.nodes[:, 1]
        assert (np.abs(h1 - half) < 0.15 * size).all()
        assert_allclose(acc.coef[:, 0], 2.0 / (h1 * (h1 + h2)))
        assert_allclose(acc.coef[:, 2], 2.0 / (h2 * (h1 + h2)))
    assert set(np.diff(acc.window)) <= {0, 1}
    assert acc.window.max() == 1  # of twenty seconds each


def test_fixes_that_claim_more_error_weigh_less() -> None:
    """Oracle: by hand: the usual variance and what fixes do not see, 0.1 m/s^2, over the worst of
    the fixes of a difference; one at most."""
    t = np.arange(0.0, 20.0, 0.1)
    sigma = np.where(np.arange(200) == 100, 0.5, 0.02)
    acc = accelerations(fixes(t, sigma), np.ones(200, dtype=bool), "velocity", 0.5, dense=True)
    floor = (0.1 * 0.5) ** 2
    hit = np.isclose(acc.nodes[:, 0], 10.0) | np.isclose(acc.nodes[:, 2], 10.0)
    assert_allclose(acc.weight[hit], (8e-4 + floor) / (0.5 + floor))
    assert_allclose(acc.weight[~hit], 1.0)
    acc = accelerations(fixes(t, sigma), np.ones(200, dtype=bool), "position", 0.5, dense=True)
    floor = 2.0 * (0.1 * 0.25) ** 2 / 6.0
    assert acc.weight.min() == pytest.approx((8e-4 + floor) / (0.5 + floor))


def test_the_windows_that_move_most_are_kept() -> None:
    """Oracle: by hand: of 40 windows of 100 rows the 15 whose horizontal accelerations scatter
    most, and none of fewer than five rows."""
    rng = np.random.default_rng(7)
    window = np.append(np.repeat(np.arange(40), 100), [40] * 4)
    size = rng.permutation(np.append(np.arange(1.0, 41.0), 0.0))
    size[40] = 99.0
    t = np.arange(window.size) * 0.1
    z = (
        size[window][:, None]
        * np.tile([[1.0, -1.0, 500.0]], (window.size, 1))
        * np.where(np.arange(window.size) % 2, 1.0, -1.0)[:, None]
    )
    nodes = np.column_stack([t, t, t])
    acc = _most_moved(Accelerations("velocity", 1.0, nodes, nodes, z, t, window), 1)
    kept = np.unique(window[np.isin(t, acc.weight)])
    assert sorted(kept) == sorted(np.argsort(size[:40])[::-1][:15])
    assert np.unique(acc.window).tolist() == list(range(15))
    half = _most_moved(Accelerations("velocity", 1.0, nodes, nodes, z, t, window), 2)
    assert np.unique(window[np.isin(t, half.weight)]).size == 30


def test_the_nearest_entry() -> None:
    """Oracle: numpy's least distance."""
    t = np.sort(np.random.default_rng(8).uniform(0.0, 9.0, 30))
    wanted = np.linspace(-1.0, 10.0, 200)
    expected = np.abs(t[None] - wanted[:, None]).argmin(axis=1)
    assert _nearest(t, wanted).tolist() == expected.tolist()


def test_displacements_over_two_seconds() -> None:
    """Oracle: closed form of the path; the trapezoid of its velocity; none over a gap."""
    t = np.concatenate([np.arange(0.0, 20.0, 0.1), np.arange(30.0, 50.0, 0.1)])
    first, last = _pairs(t)
    assert_allclose(t[last] - t[first], 2.0, atol=1.0)
    assert not ((t[first] < 20.0) & (t[last] > 30.0)).any()
    gnss = fixes(t)
    moved, mean = (
        _mean_velocities(gnss, (first, last)),
        _mean_velocity(t, gnss.velocity_ned, (first, last)),
    )
    assert_allclose(moved, mean, atol=0.05 * 30.0)
    assert _off(moved, mean) < 2e-3
    assert _off(1.5 * mean, mean) == pytest.approx(0.5)
    exact = 30.0 * (np.sin(t[last]) - np.sin(t[first])) / (t[last] - t[first])
    assert_allclose(moved[:, 0], exact, atol=1e-6 * 30.0)
    assert _pairs(t[:29]) is None
    assert _pairs(np.arange(31.0) * 0.1) is None  # eleven pairs
    speed = np.outer([0.5, 0.9, 1.1, 2.0, 3.0], [1.0, 0.0])
    assert _fast(speed, 1.0).tolist() == [False, False, False, True, True]
    assert _fast(speed, 2.5).tolist() == [False, False, False, False, True]


def recognised(triads="aligned", sign=1, sure=0.995) -> SimpleNamespace:
    findings = {
        "gyro triad": SimpleNamespace(found=triads, confidence=sure),
        "force sign": SimpleNamespace(found="", confidence=sure),
    }
    return SimpleNamespace(finding=findings.__getitem__, accel_sign=sign)


def test_which_readings_are_mirrored_and_what_explains_them() -> None:
    """Oracle: by hand: gyros and force both reversed are left-handed axes; a trial explains them
    with aligned triads and specific force, surer than 0.99."""
    assert is_mirrored(recognised("gyro -x -y -z", -1))
    assert is_mirrored(recognised("gyro -x -y -z", 1), -1)
    assert not is_mirrored(recognised("gyro -x -y -z", 1))
    assert not is_mirrored(recognised("aligned", -1))
    assert not is_mirrored(recognised("gyro -x -y -z", -1, 0.0))
    assert explains(recognised())
    assert not explains(recognised(sure=0.985))
    assert not explains(recognised(sign=-1))
    assert not explains(recognised("gyro -x -y -z"))
    imu = turning(4)
    other = exchange_axes(imu, (0, 2), -1)
    assert_allclose(other.gyro, imu.gyro[:, [2, 1, 0]])
    assert_allclose(other.accel, -imu.accel[:, [2, 1, 0]])
    assert math.isclose(other.time[0], imu.time[0])


def test_the_lag_is_that_of_the_most_certain_fit(monkeypatch) -> None:
    """Oracle: (R.7) by hand: its sigma, what others are farther off than theirs, and a quarter of
    the sample interval; fits that gain less than three tenths of the most are none."""
    from insgnss.navigation.recognise import relation

    def scan(gain, lag):
        acc = SimpleNamespace(span_s=1.0, time=np.zeros(10), kind=lag)
        shares = {"up": np.array([1.0]), "down": np.zeros(1)}
        return SimpleNamespace(gain=lambda: gain, acc=acc, lags=np.array([lag]), best=0, **shares)

    scans = [scan(10.0, 0.50), scan(8.0, 0.60), scan(3.1, 0.52), scan(2.9, 9.0)]
    sigma = {0.50: 0.02, 0.60: 0.03, 0.52: 0.04, 9.0: 0.001}
    monkeypatch.setattr(relation, "accelerations", lambda *_, **__: scans[0].acc)
    monkeypatch.setattr(relation, "_kinds", lambda _: ["velocity"])
    monkeypatch.setattr(relation, "_halves", lambda *_: [0.2, 0.5, 1.0, 2.0])
    queue = list(scans)
    monkeypatch.setattr(relation, "_scan", lambda *_: queue.pop(0))
    monkeypatch.setattr(
        relation,
        "fit",
        lambda moved, acc, lag, sign: SimpleNamespace(theta=np.array([lag]), lag_sigma=sigma[lag]),
    )
    grid = SimpleNamespace(interval=0.02)
    best, acc, lag_sigma = relation._refine(grid, None, None, None, scans[0])
    assert (best.theta[0], acc.kind) == (0.5, 0.5)
    excess = np.mean([0.0, 0.1**2 - 0.03**2, 0.0])
    assert lag_sigma == pytest.approx(np.sqrt(0.02**2 + excess + 0.005**2))
    nothing = scan(0.0, 0.5)
    assert relation._refine(grid, None, None, None, nothing)[0] is None
