"""Fixes that say nothing beside those around them."""

import numpy as np

from insgnss.prepare.fix_quality import without_worthless
from insgnss.records import GnssFixes


def fixes(time, quality, sigma):
    n = np.size(time)
    cov = np.square(np.broadcast_to(sigma, n))[:, None, None] * np.eye(3)
    lat = np.full(n, 0.8)
    return GnssFixes(time, lat, lat, np.full(n, 100.0), cov, quality=quality)


def test_a_stale_row_between_better_ones_is_left_out():
    """Oracle: ten fixes a second of 2 m, every tenth of another quality and worth 40 m."""
    time = 0.1 * np.arange(1000)
    odd = np.arange(1000) % 10 == 3
    kept = without_worthless(fixes(time, np.where(odd, 1, 5), np.where(odd, 40.0, 2.0)))
    assert np.array_equal(kept.time, time[~odd])
    assert "100 of quality 1 (sigma 56.6 m) left out" in kept.notes[-1].found


def test_what_bridges_an_outage_or_claims_enough_stays():
    """RTK at 2 cm with float of 0.3 m while it is lost stays whole, but for what is beside it."""
    time = 0.1 * np.arange(1000)
    lost = (time > 40.0) & (time < 60.0)
    outage = fixes(time, np.where(lost, 2, 1), np.where(lost, 0.3, 0.02))
    assert without_worthless(outage) is outage
    near = np.arange(1000) % 10 == 3
    similar = fixes(time, np.where(near, 2, 1), np.where(near, 8.0, 2.0))
    assert without_worthless(similar) is similar
    one_quality = fixes(time, np.full(1000, 5), np.where(near, 40.0, 2.0))
    assert without_worthless(one_quality) is one_quality


def test_float_solutions_between_fixed_ones_stay():
    """Oracle: what the codes mean: float is worth less than fixed, and says so."""
    time = 0.1 * np.arange(1000)
    near = np.arange(1000) % 10 == 3
    mixed = fixes(time, np.where(near, 2, 1), np.where(near, 2.0, 0.015))
    assert without_worthless(mixed) is mixed
