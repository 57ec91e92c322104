"""Correlations of gyro and course at many lags by Fourier transforms, against one lag at a time."""

import numpy as np
import pytest

from insgnss.navigation.recognise.turns import _correlations

LAGS = np.arange(-60, 61)


@pytest.mark.parametrize("seed", range(4))
def test_each_lag_is_numpys(seed: int) -> None:
    """Oracle: `numpy.corrcoef` of the pairs that are in use at each lag; an offset of the gyro a
    thousand times its turns, long pieces that are not in use, numbers of samples that are powers
    of two.
    """
    rng = np.random.default_rng(seed)
    n = (512, 256, 700, 333)[seed]
    a = np.convolve(rng.normal(size=n + 20), np.ones(20), "same")[:n]
    b = np.roll(a, 9) + rng.normal(size=n)
    a += 1000.0 * a.std()
    use = rng.random(n) < 0.7
    use[: n // 5] = False
    got = _correlations(a, np.where(use, b, 1e3 * rng.normal(size=n)), use, LAGS)
    for k, value in zip(LAGS.tolist(), got.tolist(), strict=True):
        i = np.arange(max(-k, 0), n - max(k, 0))
        i = i[use[i]]
        expected = np.corrcoef(a[i + k], b[i])[0, 1] if i.size > 50 else 0.0
        assert value == pytest.approx(expected, abs=1e-8)
    assert LAGS[np.argmax(got)] == -9


def test_what_does_not_vary_or_is_not_in_use_correlates_with_nothing() -> None:
    """Oracle: zero."""
    x, none = np.sin(0.1 * np.arange(300)), np.zeros(300, dtype=bool)
    constant, every = np.full(300, 0.1), ~none
    for a, b, use in ((constant, x, every), (x, constant, every), (x, x, none)):
        assert not _correlations(a, b, use, LAGS).any()
    few = none.copy()
    few[100:150] = True
    assert not _correlations(x, x, few, LAGS).any()
