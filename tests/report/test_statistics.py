"""Consistency of innovations: bounds, whiteness, and verdicts on samples of known distribution."""

import numpy as np
import pytest
from scipy import stats

from insgnss.report.statistics import (
    NIS_95,
    Z_CONFIDENCE,
    consistency,
    lag_one,
    mean_bounds,
    normalised_rms,
    rms_bound,
    without_fix,
)

K = 3000


@pytest.mark.parametrize("dof", [1, 3, 30, 81000])
def test_bounds_hold_99_percent(dof: int) -> None:
    """Oracle: scipy.stats.chi2; 1e-9 relative is the accuracy of its special functions."""
    low, high = mean_bounds(dof)
    assert low * dof == pytest.approx(stats.chi2.ppf(0.005, dof), rel=1e-9)
    assert high * dof == pytest.approx(stats.chi2.ppf(0.995, dof), rel=1e-9)


def test_constants_are_quantiles() -> None:
    """Oracle: scipy.stats."""
    assert pytest.approx(stats.chi2.ppf(0.95, 3), rel=1e-12) == NIS_95
    assert pytest.approx(stats.norm.ppf(0.995), rel=1e-12) == Z_CONFIDENCE


@pytest.mark.parametrize(
    ("scale", "verdict"), [(1.0, "consistent"), (1.1, "overconfident"), (0.9, "conservative")]
)
def test_verdict_on_white_innovations(scale: float, verdict: str) -> None:
    """Oracle: closed form; with innovations `scale` times their sigma the mean NIS per degree of
    freedom is scale^2.
    """
    nis = ((scale * np.random.default_rng(1).standard_normal((K, 3))) ** 2).sum(axis=1)
    found = consistency(nis, np.ones(K, dtype=bool))
    assert found["verdict"] == verdict
    assert found["mean_per_dof"] == pytest.approx(
        scale**2, rel=4 * np.sqrt(2 / (3 * K))
    )  # four of its standard deviations
    share = stats.chi2.sf(NIS_95 / scale**2, 3)
    assert found["share_beyond_95"] == pytest.approx(
        share, abs=4 * np.sqrt(share * (1 - share) / K)
    )


def test_rejected_innovations_do_not_count() -> None:
    """Oracle: closed form; NIS 3 of three components is 1 per degree of freedom whatever was
    rejected.
    """
    nis = np.array([3.0, 1e6, 3.0, np.nan])
    assert consistency(nis, np.array([True, False, True, True]))["mean_per_dof"] == 1.0
    assert consistency(nis, np.zeros(4, dtype=bool))["verdict"] == "unknown"


def test_lag_one_of_an_autoregression() -> None:
    """Oracle: closed form; x_k = a x_(k-1) + w_k has the lag-1 autocorrelation a, estimated within
    sqrt((1 - a^2) / K).
    """
    rng = np.random.default_rng(2)
    a = np.array([0.8, 0.0, -0.4])
    x = np.zeros((K, 3))
    for k in range(1, K):
        x[k] = a * x[k - 1] + rng.standard_normal(3)
    assert np.abs(lag_one(x) - a).max() < 4.0 / np.sqrt(K)


def test_lag_one_of_a_constant_is_unknown() -> None:
    """Oracle: definition; no variance, no correlation."""
    assert np.isnan(lag_one(np.ones((10, 2)))).all()
    assert np.isnan(lag_one(np.empty((0, 3)))).all()


def test_normalised_rms_skips_what_is_undetermined() -> None:
    """Oracle: by hand."""
    x = np.array([[2.0, np.nan], [-2.0, np.nan], [np.nan, np.nan]])
    ratio = normalised_rms(x, np.array([[1.0, 1.0], [1.0, 1.0], [1.0, 0.0]]))
    assert ratio[0] == 2.0
    assert np.isnan(ratio[1])


def test_the_bound_of_an_rms_knows_what_is_correlated() -> None:
    """Oracle: chi-square with the degrees of freedom of a constant (1), white noise (K) and a
    first-order autoregression, K (1 - a) / (1 + a) (its closed form).
    """
    K, a, rng = 4000, 0.95, np.random.default_rng(5)
    white = rng.standard_normal(K)
    x = np.column_stack([np.full(K, 0.3), white, np.zeros(K), np.full(K, np.nan)])
    x[0, 2] = white[0]
    for k in range(1, K):
        x[k, 2] = a * x[k - 1, 2] + np.sqrt(1.0 - a**2) * white[k]
    bound = rms_bound(x, np.ones_like(x))
    dof = np.array([1.0, K, K * (1.0 - a) / (1.0 + a)])
    np.testing.assert_allclose(bound[:3], np.sqrt(stats.chi2.isf(1e-4, dof) / dof), rtol=0.05)
    assert np.isnan(bound[3])


def test_time_without_fix_counts_both_ends_and_rejections() -> None:
    """Oracle: by hand; one span with all fixes, with three rejected, with none, and two spans with
    a fix between them.
    """
    time = np.array([1.0, 2.0, 3.0, 4.0, 9.0])
    every = np.ones(5, dtype=bool)
    one = np.array([[0.0, 10.0]])
    assert without_fix(one, time, every).tolist() == [
        [0, 1],
        [1, 1],
        [2, 1],
        [3, 1],
        [4, 5],
        [9, 1],
    ]
    assert without_fix(one, time, np.array([True, False, False, False, True])).tolist() == [
        [0, 1],
        [1, 8],
        [9, 1],
    ]
    assert without_fix(one, time, ~every).tolist() == [[0, 10]]
    assert without_fix(np.array([[0.0, 2.5], [3.5, 8.0]]), time, every).tolist() == [
        [0, 1],
        [1, 1],
        [2, 0.5],
        [3.5, 0.5],
        [4, 4],
    ]
