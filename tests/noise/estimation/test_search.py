"""The search for correlation times against scipy, and the rules of a tuning, by hand."""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import nnls

from insgnss.noise.estimation._search import _interpolate, nonnegative, profile, settle
from insgnss.noise.estimation.goodness import goodness_of_fit
from insgnss.noise.tuning import fitting
from insgnss.noise.tuning.fitting import (
    _advise_slow_misfit,
    _determines_white_noise,
    _largest_deviation,
)


def columns(rng, p: int, m: int = 9) -> np.ndarray:
    A = rng.normal(size=(p, m)) + 0.7
    return A / np.linalg.norm(A, axis=1, keepdims=True)


@pytest.mark.parametrize("p", [1, 2, 3, 5])
def test_variances_are_those_of_nonnegative_least_squares(p: int) -> None:
    """Oracle: scipy's nnls: the variances, and b'x, the gain of (S.1)."""
    rng = np.random.default_rng(p)
    zeros = 0
    for _ in range(40):
        A, y = columns(rng, p), rng.normal(size=9) + 0.3
        x, work = np.empty(p), np.empty((p + 2, p))
        gain = nonnegative(A @ A.T, A @ y, x, work)
        exact, rest = nnls(A.T, y)
        zeros += np.count_nonzero(exact == 0.0)
        assert_allclose(x, exact, atol=1e-10)
        assert gain == pytest.approx(y @ y - rest**2)
    assert zeros > 5


def test_dependent_columns_share_nothing() -> None:
    """Oracle: scipy's nnls of one of two equal columns: the same gain."""
    A = columns(np.random.default_rng(3), 2)
    A[1] = A[0]
    y = np.abs(np.random.default_rng(4).normal(size=9))
    x, work = np.empty(2), np.empty((4, 2))
    gain = nonnegative(A @ A.T, A @ y, x, work)
    assert gain == pytest.approx(y @ y - nnls(A[:1].T, y)[1] ** 2)


def grid(candidates: int = 25, m: int = 12) -> tuple[np.ndarray, np.ndarray]:
    """Columns that change smoothly from candidate to candidate, and their derivatives."""
    t, k = np.arange(m), np.arange(candidates)[:, None]
    D = np.exp(-0.5 * ((t - 0.4 * k) / 2.5) ** 2)
    return D, D * (t - 0.4 * k) / 2.5**2 * 0.4


def test_columns_between_candidates_are_cubic() -> None:
    """Oracle: scipy's Hermite spline, value and two derivatives."""
    from scipy.interpolate import CubicHermiteSpline

    D, slope = grid()
    spline = CubicHermiteSpline(np.arange(len(D)), D, slope)
    d, d1, d2 = (np.empty(D.shape[1]) for _ in range(3))
    for at in (0.0, 0.3, 7.5, 11.9, 24.0):
        _interpolate(at, D, slope, d, d1, d2)
        assert_allclose(d, spline(at), atol=1e-12)
        assert_allclose(d1, spline(at, 1), atol=1e-12)
        if at != 24.0:
            assert_allclose(d2, spline(at, 2), atol=1e-11)


def test_the_profile_is_the_gain_of_one_more_process() -> None:
    """Oracle: scipy's nnls with each candidate beside the processes that are there."""
    rng = np.random.default_rng(5)
    D, slope = grid()
    D, slope = D / np.linalg.norm(D, axis=1)[:, None], slope
    linear, y = columns(rng, 1, 12), np.abs(rng.normal(size=12)) + D[15]
    positions, gain = np.array([4.0]), np.empty(len(D))
    profile(positions, linear, D, slope, y, gain)
    for c in range(len(D)):
        A = np.vstack([linear, D[4], D[c]])
        assert gain[c] == pytest.approx(y @ y - nnls(A.T, y)[1] ** 2, rel=1e-6)


def test_the_descent_ends_in_a_minimum() -> None:
    """Oracle: the positions of two processes that made the data; scipy's minimum over a position
    where noise moves it."""
    from scipy.optimize import minimize_scalar

    D, slope = grid(candidates=25)
    d, unused = np.empty(12), np.empty((2, 12))
    y = np.zeros(12)
    for at, size in ((4.3, 2.0), (19.6, 1.0)):
        _interpolate(at, D, slope, d, unused[0], unused[1])
        y += size * d
    positions = np.array([6.0, 17.0])
    assert settle(positions, np.empty((0, 12)), D, slope, y) < 1e-8
    assert_allclose(positions, [4.3, 19.6], atol=1e-3)
    y += 0.2 * np.random.default_rng(6).normal(size=12)

    def left(at):
        _interpolate(float(at), D, slope, d, unused[0], unused[1])
        return nnls(d[:, None], y)[1] ** 2

    best = minimize_scalar(left, bounds=(0.0, 12.0), method="bounded", options={"xatol": 1e-6})
    one = np.array([float(best.x) + 0.8])
    assert settle(one, np.empty((0, 12)), D, slope, y) == pytest.approx(best.fun, rel=1e-6)


def curve(level, variance, rate_hz=10.0, count=1e9) -> SimpleNamespace:
    level, variance = np.asarray(level), np.asarray(variance, dtype=np.float64)
    return SimpleNamespace(
        level=level,
        variance=variance,
        rate_hz=rate_hz,
        count=np.broadcast_to(count, level.shape),
        scale_s=2.0**level / rate_hz,
    )


def test_the_j_test_of_efficient_weights_is_chi_square() -> None:
    """Oracle: scipy's chi-square: all weights 1 or 0, J is the distance itself; with others the
    moments of (J.1); scales beyond three sigmas, the worst first."""
    from scipy.stats import chi2

    fitted = SimpleNamespace(
        residuals=(np.array([0.1, -0.4]), np.array([0.35, 0.0, 0.31])),
        composition=SimpleNamespace(parameters=("a", "b")),
        at_bound=("b",),
        objective=7.3,
        curves=(curve([1, 2], [1.0, 1.0]), curve([1, 2, 3], [1.0, 1.0, 1.0])),
    )
    seen = []

    def scatter(inside):
        seen.append(inside.tolist())
        return np.full(5, 0.1), weight

    linear = SimpleNamespace(free=np.array([0, 1]), scatter=scatter)
    weight = np.array([1.0, 1.0, 1.0, 0.0, 0.0])
    found = goodness_of_fit(fitted, linear, SimpleNamespace(objective=np.array([7.0, 7.3, 9.0])))
    assert seen == [[True, False]]
    assert (found.statistic, found.degrees) == (pytest.approx(7.3), pytest.approx(3.0))
    assert found.p_value == pytest.approx(chi2.sf(7.3, 3))
    assert (found.draws, found.bootstrapped) == (3, pytest.approx(3 / 4))
    assert found.bootstrapped_error == pytest.approx(np.sqrt(0.75 * 0.25 / 3))
    assert_allclose(found.residuals[0], [1.0, -4.0])
    assert found.misfits == ((0, 2), (1, 1), (1, 3))
    weight = np.array([2.0, 1.0, 1.0, 0.0, 0.0])
    found = goodness_of_fit(fitted, linear)
    assert (found.statistic, found.degrees) == (pytest.approx(7.3 * 4 / 6), pytest.approx(16 / 6))
    assert np.isnan(found.bootstrapped)


def test_how_far_a_model_is_off() -> None:
    """Oracle: by hand: ratios of deviations, where a recording holds fifty filter lengths."""
    one = curve([1, 2, 3], [1.0, 4.0, 1.0], count=np.array([101.0, 201.0, 399.0]))
    fitted = SimpleNamespace(curves=(one,), modelled=(np.array([1.21, 4.0, 100.0]),))
    assert _largest_deviation(fitted) == pytest.approx(0.1)
    low = SimpleNamespace(curves=(one,), modelled=(np.array([1.0, 4.0 * 0.49, 0.0]),))
    assert _largest_deviation(low) == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("misfits", "advised"),
    [([], False), ([(0, 6)], True), ([(0, 5)], False), ([(0, 2), (0, 9)], False), ([(0, 9)], True)],
)
def test_a_misfit_at_long_scales(misfits, advised) -> None:
    """Oracle: by hand: all of them in the upper half of levels 1 to 9, that is beyond 5."""
    from insgnss.noise.processes.composition import Composition

    fitted = SimpleNamespace(
        curves=(curve(np.arange(1, 10), np.ones(9)),), composition=Composition.parse("WN+GM")
    )
    sentence = _advise_slow_misfit(fitted, misfits)
    assert bool(sentence) is advised
    assert not advised or "WN+2GM or " in sentence


@pytest.mark.parametrize(
    ("share", "left", "seen"),
    [(0.51, 1.0, True), (0.49, 1.0, False), (0.51, 1.11, False), (0.51, 1.10, True)],
)
def test_whether_the_white_noise_is_still_seen(monkeypatch, share, left, seen) -> None:
    """Oracle: by hand: most of the variance at two scales that remain, and no less than within 5 %
    of the deviation at those left out."""
    whole = curve([1, 2, 3, 4], [left, 1.0, 1.0, 1.0])
    kept = curve([2, 3, 4], [1.0] * 3)
    parts = {
        "white_noise": np.array([share, share, 0.0]),
        "rest": 1.0 - np.array([share, share, 0]),
    }
    monkeypatch.setattr(fitting, "haar_variance_parts", lambda *_: parts)
    monkeypatch.setattr(fitting, "haar_variance", lambda *_: np.ones(1))
    axis = SimpleNamespace(white_noise=1.0)
    coarser = SimpleNamespace(axis=axis, curves=(kept,), sampling="point")
    assert _determines_white_noise(coarser, [whole]) is seen


@pytest.mark.parametrize(
    ("p", "settled", "kept"),
    [
        (0.9e-3, True, "first"),
        (1.1e-3, True, "second"),
        (0.5, False, "first"),
        (np.nan, True, "second"),
    ],
)
def test_which_fit_is_kept(monkeypatch, p, settled, kept) -> None:
    """Oracle: by hand: the efficient one where it settles and the J test does not refuse it."""
    monkeypatch.setattr(fitting, "second_step", lambda _: ("second", "", settled))
    goodness = SimpleNamespace(degrees=3.0, p_value=p)
    monkeypatch.setattr(fitting, "_j_test", lambda _: goodness)
    for weights, expected in (("auto", kept), ("diagonal", "first"), ("full", "second")):
        assert fitting._preferred_fit("first", SimpleNamespace(weights=weights))[0] == expected
