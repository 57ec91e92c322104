"""The limits of what in-flight noise says, each on either side; whiteness by scipy."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation
from scipy.stats import chi2, norm

from insgnss.navigation.innovations._kernels import minus_half_turn
from insgnss.navigation.innovations.innovation_noise import (
    InFlightNoise,
    WhitenedInnovations,
    Whiteness,
    _chance,
    _minutes,
    _untold,
    whiteness,
)
from insgnss.navigation.innovations.pieces import moving_parts
from insgnss.navigation.innovations.search import Maximum, Search

BLANK = WhitenedInnovations(
    1.0, 100, 0, 0.0, Whiteness(*(np.zeros(3),) * 1, 0.0, *(np.zeros(3),) * 2, 20, np.zeros(3))
)


def noise(**changes) -> InFlightNoise:
    names = ("gyro.white_noise", "accel.white_noise", "fixes.position")
    values = {
        "names": names,
        "factor": np.array([2.0, 3.0, 1.0]),
        "log_sigma": np.full(3, 0.1),
        "correlation": np.eye(3),
        "held": (),
        "gain": 20.0,
        "free": 2,
        "chance": 1e-5,
        "before": BLANK,
        "after": replace(BLANK, nis=2.0),
        "at_best": replace(BLANK, nis=3.0),
        "static_at_best": replace(BLANK, nis=4.0),
        "duration_s": 60.0,
        **changes,
    }
    return InFlightNoise(**values)


@pytest.mark.parametrize(("chance", "verdict"), [(0.9e-3, True), (1.1e-3, False)])
def test_what_is_significant(chance, verdict) -> None:
    """Oracle: one in a thousand, on either side; by the gain of a chi-square as well."""
    assert noise(chance=chance).significant is verdict
    loss = float(chi2.isf(chance, 2))
    assert _chance(loss, 2) == pytest.approx(chance)
    assert noise(held=(("a", ""), ("b", "")), loss=loss).asks_for_more is verdict


@pytest.mark.parametrize(
    ("lag_one", "bound", "p", "together", "white"),
    [
        (0.09, 0.05, 1.0, 0.0, True),
        (-0.11, 0.05, 1.0, 0.0, False),
        (0.11, 0.12, 1.0, 0.0, True),
        (0.0, 0.05, 0.9e-3, 0.11, False),
        (0.0, 0.05, 1.1e-3, 0.11, True),
        (0.0, 0.05, 0.0, 0.09, True),
    ],
)
def test_what_is_white(lag_one, bound, p, together, white) -> None:
    """Oracle: by hand: a tenth at lag one, or what chance makes; all lags likewise."""
    one = np.array([0.0, lag_one, 0.0])
    test = Whiteness(one, bound, one, np.array([1.0, p, 1.0]), 20, np.array([0.0, together, 0.0]))
    assert noise(at_best=replace(BLANK, whiteness=test)).white is white


@pytest.mark.parametrize(
    ("factor", "log_sigma", "scaled", "named"),
    [
        (1.15, 0.04, True, True),
        (1.15, 0.05, False, False),  # within three sigmas
        (1.08, 0.01, True, False),  # significant, and too little to matter
        (0.88, 0.01, True, True),
    ],
)
def test_when_the_fixes_are_off_their_claim(factor, log_sigma, scaled, named) -> None:
    """Oracle: by hand: three sigmas of the logarithm, and a tenth; factors of the IMU do not count.
    What is compared are the innovations beside the scale of the fixes."""
    one = noise(factor=np.array([9.0, 9.0, factor]), log_sigma=np.array([0.1, 0.1, log_sigma]))
    assert one.scaled is scaled
    assert one.off_claim == (("fixes.position",) if named else ())
    assert [each.nis for each in one.compared] == ([4.0, 3.0] if scaled else [1.0, 2.0])
    assert one.imu_factors() == {"gyro.white_noise": 9.0, "accel.white_noise": 9.0}
    assert one.sigma("fixes.position") == pytest.approx(factor * log_sigma)


def test_whiteness_is_ljung_and_boxs() -> None:
    """Oracle: autocorrelations by numpy, chi-square and normal by scipy."""
    x = np.cumsum(np.random.default_rng(3).normal(size=(200, 3)), axis=0) * 0.05
    x += np.random.default_rng(4).normal(size=(200, 3))
    got = whiteness(x)
    e = x - x.mean(axis=0)
    r = np.array(
        [[np.correlate(c, c, "full")[199 + lag] / (c @ c) for c in e.T] for lag in range(1, 21)]
    )
    q = 200 * 202 * np.sum(r**2 / (200 - np.arange(1, 21))[:, None], axis=0)
    assert_allclose(got.lag_one, r[0])
    assert_allclose(got.portmanteau, q)
    assert_allclose(got.p_value, chi2.sf(q, 20))
    assert got.bound == pytest.approx(norm.ppf(0.995) / np.sqrt(200.0))
    assert_allclose(got.together, np.sqrt(np.maximum(q - 20, 0.0) / 200))
    assert whiteness(x[:40]).lags == 10


def quadratic(A, best):
    """A likelihood whose -2 log L is a parabola about `best`, as the search evaluates it."""

    def evaluate(_, theta, free):
        off = theta - best
        return SimpleNamespace(cost=off @ A @ off / 2.0, gradient=A @ off, information=A)

    return evaluate


def test_the_search_finds_the_minimum_within_its_bounds(monkeypatch) -> None:
    """Oracle: a parabola's minimum by numpy; factors of the IMU from 1/300 to 300, of fixes from
    a fifth to thirty; what is held stays at one."""
    from insgnss.navigation.innovations import search as module

    names = ("gyro.white_noise", "accel.white_noise", "fixes.position")
    A = np.array([[4.0, 1.0, 0.5], [1.0, 3.0, 0.2], [0.5, 0.2, 2.0]])
    search = Search((), names, lambda _: None)
    for best, expected in (
        ([1.0, -2.0, 0.5], [1.0, -2.0, 0.5]),
        ([9.0, 0.0, 0.0], [np.log(300.0), None, None]),
        ([0.0, 0.0, -5.0], [None, None, np.log(0.2)]),
        ([0.0, 0.0, 9.0], [None, None, np.log(30.0)]),
    ):
        monkeypatch.setattr(module, "evaluate", quadratic(A, np.array(best)))
        found = search.maximum(np.ones(3, dtype=bool)).theta
        for k, value in enumerate(expected):
            if value is not None:
                assert found[k] == pytest.approx(value, abs=1e-3)
    monkeypatch.setattr(module, "evaluate", quadratic(A, np.array([1.0, -2.0, 0.5])))
    held = search.maximum(np.array([True, False, True])).theta
    reduced = A[np.ix_([0, 2], [0, 2])]
    expected = np.linalg.solve(reduced, reduced @ [1.0, 0.5] - 2.0 * A[[0, 2], 1])
    assert held[1] == 0.0
    assert_allclose(held[[0, 2]], expected, atol=1e-3)


def test_sigmas_of_a_maximum() -> None:
    """Oracle: numpy's inverse of half of the second derivative; infinite where there is none."""
    A = np.array([[4.0, 1.0, 0.0], [1.0, 3.0, 0.0], [0.0, 0.0, 0.9e-6]])
    sigma, correlation = Maximum(np.zeros(3), SimpleNamespace(information=A)).spread(
        np.ones(3, dtype=bool)
    )
    cov = 2.0 * np.linalg.inv(A[:2, :2])
    assert_allclose(sigma, [*np.sqrt(np.diag(cov)), np.inf])
    assert correlation[0, 1] == pytest.approx(cov[0, 1] / np.sqrt(cov[0, 0] * cov[1, 1]))
    sigma, _ = Maximum(np.zeros(3), SimpleNamespace(information=A)).spread(np.array([1, 0, 0]) > 0)
    assert_allclose(sigma, [np.sqrt(0.5), 0.0, 0.0])


@pytest.mark.parametrize(
    ("theta", "sigma", "told"),
    [
        (0.0, 0.29, True),
        (0.0, 0.31, False),
        (0.63, 0.31, True),
        (-0.61, 0.31, False),
        (np.log(299.0), 0.1, True),
        (-np.log(300.0), 0.1, False),
    ],
)
def test_what_a_flight_tells_of_a_factor(theta, sigma, told) -> None:
    """Oracle: by hand: a sigma of 0.3 of the logarithm, or two sigmas from one, within the bounds;
    how long a flight must be goes with the square of the sigma."""
    reason = _untold(theta, sigma, 12.3)
    assert (reason == "") is told
    assert told or "would be determined by 13 min" in reason
    A = 2.0 * np.diag([1.0 / 0.6, 1.0 / 0.2, 1.0 / 10.0]) ** 2
    minutes = _minutes(Maximum(np.zeros(3), SimpleNamespace(information=A)), 5.0)
    assert_allclose(minutes, [20.0, np.inf, np.inf])
    A = 2.0 * np.diag([1.0 / 3.26, 1.0 / 3.31]) ** 2  # 590 and 609 minutes of ten hours at most
    minutes = _minutes(Maximum(np.zeros(2), SimpleNamespace(information=A)), 5.0)
    assert np.isfinite(minutes).tolist() == [True, False]


@pytest.mark.parametrize(
    ("rate_hz", "moving_s", "parts"),
    [(10.0, 19.8, 0), (10.0, 20.2, 1), (2.0, 29.4, 0), (2.0, 29.6, 1)],
)
def test_parts_in_motion(monkeypatch, rate_hz, moving_s, parts) -> None:
    """Oracle: by hand: 20 s and 60 fixes and more, outside of what stands still."""
    from insgnss.navigation.innovations import pieces as module

    time = np.arange(0.0, 100.0, 1.0 / rate_hz)
    solution = SimpleNamespace(
        time=time,
        problem=SimpleNamespace(epochs=SimpleNamespace(has_position=np.ones(time.size, bool))),
    )
    monkeypatch.setattr(module, "sub_solution", lambda _, first, last: (first, last))
    begin = 10.0 + moving_s + 1.0 / rate_hz
    found = moving_parts(solution, np.array([[-1.0, 10.0], [begin, 200.0]]))
    assert len(found) == parts
    if found:
        first, last = found[0]
        assert time[first] == pytest.approx(10.0 + 1.0 / rate_hz)
        assert time[last] < begin


@pytest.mark.parametrize(("minutes", "pieces"), [(3.0, 8), (8.9, 8), (9.1, 9)])
def test_pieces_of_a_minute_or_eighths(monkeypatch, minutes, pieces) -> None:
    """Oracle: by hand: a minute each, eight at least; fixes that were not used do not count, and
    sixty covariances stand for all of a piece."""
    from insgnss.navigation.filter.codes import NOT_MEASURED, USED
    from insgnss.navigation.innovations import residuals as module

    time = np.arange(0.0, 60.0 * minutes + 0.05, 0.1)
    verdict = np.full((time.size, 5), NOT_MEASURED)
    verdict[:, 0] = USED
    epochs = SimpleNamespace(
        withheld=np.zeros(time.size, bool), has_position=np.ones(time.size, bool)
    )
    solution = SimpleNamespace(
        problem=SimpleNamespace(epochs=epochs),
        verdict=verdict,
        time=time,
        rows=np.arange(time.size),
    )
    n = time.size
    monkeypatch.setattr(
        module, "claimed_errors", lambda _, rows: (np.ones((n, 3)), np.zeros((2, n, 3)))
    )
    monkeypatch.setattr(
        module, "_residuals", lambda _, rows: (np.ones((n, 3)), np.ones((n, 3)), np.ones((n, 3)))
    )
    taken: list[int] = []

    def variance(solution, rows, C, a):
        taken.append(rows.size)
        return np.full((rows.size, 3), 4.0)

    monkeypatch.setattr(module, "_antenna_variance", variance)
    found = module.mean_residuals(solution)
    assert len(found) == pieces
    assert sum(piece.fixes for piece in found) == n
    assert max(taken) <= 60
    for piece in found:
        assert_allclose(piece.sigma_m, np.sqrt(4.0 + 1.0 / piece.fixes))
        assert piece.end_s - piece.begin_s == pytest.approx(60.0 * minutes / pieces, abs=0.25)


@pytest.mark.parametrize("first", [0, 4])
def test_the_antenna_of_a_solution_by_its_states(first) -> None:
    """Oracle: (K.1) by hand, of states that begin at any place: lever arm, time offset and rate."""
    from insgnss.navigation.innovations.residuals import _antenna_variance, _residuals

    m, n = 5, first + 5
    layout = SimpleNamespace(lever=first + 2, offset=first, rate=first + 1)
    time = np.arange(m) * 2.0
    nav = np.zeros((m, 10))
    nav[:, 3:6], nav[:, 6] = [3.0, -2.0, 1.0], 1.0
    x = np.zeros((m, n))
    x[:, first : first + 5] = [0.1, 0.01, 0.5, 0.6, 0.7]
    rate = np.tile([0.0, 0.0, 0.2], (m, 1))
    epochs = SimpleNamespace(time=time, rate=rate, position=np.zeros((m, 3)))
    lever = np.array([1.0, 2.0, 3.0])
    P = np.diag(np.arange(1.0, 10.0 + n))
    solution = SimpleNamespace(
        problem=SimpleNamespace(layout=layout, epochs=epochs, antenna_lever_b=lever),
        nav=nav,
        x=x,
        covariance=lambda rows: np.tile(P, (rows.size, 1, 1)),
    )
    rows = np.array([1, 3])
    residual, C, a = _residuals(solution, rows)
    arm = lever + [0.5, 0.6, 0.7]
    assert_allclose(a, np.tile(arm, (2, 1)))
    d = (0.1 + 0.01 * time[rows])[:, None]
    assert_allclose(residual, -(arm + d * (nav[rows, 3:6] + np.cross([0.0, 0.0, 0.2], arm))))
    H = np.zeros((2, 3, 9 + n))
    for k, e in enumerate(rows):
        H[k, :, :3] = np.eye(3)
        H[k, :, 6:9] = -np.cross(np.eye(3), -arm)
        H[k, :, 9 + first + 2 : 9 + first + 5] = np.eye(3)
        H[k, :, 9 + first] = nav[e, 3:6]
        H[k, :, 9 + first + 1] = time[e] * nav[e, 3:6]
    expected = np.einsum("kij,jl,kil->ki", H, P, H)
    assert_allclose(_antenna_variance(solution, rows, C, a), expected)


@pytest.mark.parametrize(("sigma_m", "wide"), [(0.01, (10.0, 5.0)), (4.0, (40.0, 8.0))])
def test_what_a_part_of_a_flight_knows_before_it(sigma_m, wide) -> None:
    """Oracle: by hand: nothing of position and velocity, ten times the attitude's sigma beside half
    a degree and one of heading, the IMU as the model has it."""
    from insgnss.navigation.innovations.likelihood import _start

    P = np.zeros((1, 9, 9))
    P[0, 6:9, 6:9] = np.diag([1e-6, 4e-6, 9e-6])
    epochs = SimpleNamespace(position_cov=(sigma_m**2 / 3.0) * np.eye(3)[None])
    layout = SimpleNamespace(sigma0=np.array([0.1, 0.2]))
    solution = SimpleNamespace(
        problem=SimpleNamespace(layout=layout, epochs=epochs), nav_covariance=lambda _: P
    )
    sigma = np.sqrt(np.diag(_start(solution)))
    assert_allclose(sigma[:6], np.repeat(wide, 3))
    floor = np.radians([0.5, 0.5, 1.0])
    assert_allclose(sigma[6:9], np.hypot(floor, [1e-2, 2e-2, 3e-2]))
    assert_allclose(sigma[9:], [0.1, 0.2])


@pytest.mark.parametrize("turn", [(0.3, -0.5, 0.8), (1e-6, 2e-6, -3e-6)])
def test_minus_half_a_turn_is_scipys(turn):
    """Oracle: scipy's rotation by minus half of the vector."""
    A = np.empty((3, 3))
    minus_half_turn(*turn, A)
    assert_allclose(A, Rotation.from_rotvec(-0.5 * np.array(turn)).as_matrix(), rtol=0, atol=1e-15)
