"""Fixes that say nothing beside those around them."""

import numpy as np
import pytest

from insgnss.navigation.prepare.fix_covariance.quality import without_worthless
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


@pytest.mark.parametrize(
    ("before_s", "after_s", "ratio", "left_out"),
    [
        (0.95, 0.95, 5.1, True),
        (0.95, 0.95, 4.9, False),
        (1.05, 0.5, 40.0, False),
        (0.5, 1.05, 40.0, False),
    ],
)
def test_five_sigmas_within_a_second_on_both_sides(before_s, after_s, ratio, left_out):
    """Oracle: steps and ratio of the sigmas by hand: fewer seconds and more sigmas are left out."""
    start = (before_s + after_s) * np.arange(20.0)
    time = np.sort(np.concatenate([start, start[:-1] + before_s]))
    odd = np.arange(39) % 2 == 1
    given = fixes(time, np.where(odd, 1, 5), np.where(odd, ratio, 1.0))
    assert without_worthless(given).time.size == (20 if left_out else 39)


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
