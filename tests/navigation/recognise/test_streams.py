"""Fixes of two qualities beside each other: which of them lie off the path is told, and nothing of
those that draw one path.
"""

from dataclasses import replace

import numpy as np
import pytest

from insgnss.navigation.recognise.streams import check_classes, classes_apart
from insgnss.records import GnssFixes
from insgnss.records.qualities import Quality

SINGLE, FIXED = (1.5, 2.0, 6.0), (0.02, 0.02, 0.04)


def drive(seed, bias=(1.0, -1.5, 4.0)):
    """Ten minutes of single-point fixes of a car with a bias, one fixed one in ten between them."""
    rng = np.random.default_rng(seed)
    t = 0.1 * np.arange(6000)
    fixed = np.arange(6000) % 10 == 7
    place = np.column_stack([300.0 * np.sin(0.03 * t), 200.0 * np.cos(0.04 * t), 0.0 * t])
    place += np.where(fixed[:, None], rng.normal(0.0, 0.02, (6000, 3)), np.asarray(bias))
    sigma = np.where(fixed[:, None], FIXED, SINGLE)
    cov = (sigma**2)[:, :, None] * np.eye(3)
    lat, lon = 0.7 + place[:, 0] / 6.36e6, 2.0 + place[:, 1] / (6.38e6 * np.cos(0.7))
    quality = np.where(fixed, Quality.FIXED, Quality.SINGLE).astype(np.int64)
    return GnssFixes(t, lat, lon, 50.0 - place[:, 2], cov, None, None, quality, 2200, "g"), fixed


@pytest.mark.parametrize("seed", range(3))
def test_rows_of_another_solution_are_told_with_what_they_are_worth(seed):
    """Oracle: fixed rows that are 8 s old, between single-point ones; with the sigmas advised they
    are explained.
    """
    gnss, fixed = drive(seed)
    assert check_classes(gnss) == []
    lat, lon = gnss.lat.copy(), gnss.lon.copy()
    for column in (lat, lon):
        column[fixed] = np.interp(gnss.time[fixed] - 8.0, gnss.time, column)
    old = replace(gnss, lat=lat, lon=lon)
    (check,) = check_classes(old)
    assert check.verdict == "contradiction"
    assert "fixed fixes lie" in check.found
    assert "quality_sigma_m = { fixed = [" in check.advice
    ((_, sigma, ratio),) = classes_apart(old).values()
    assert ratio > 5.0
    cov = old.cov_ned.copy()
    cov[fixed] = np.diag(np.square(sigma))
    assert check_classes(replace(old, cov_ned=cov)) == []


def test_qualities_in_turn_are_not_compared():
    """Oracle: half of a drive fixed, half of it single; 20 m between them show nowhere."""
    gnss, _ = drive(1, (20.0, 0.0, 0.0))
    quality = np.where(gnss.time < 300.0, Quality.FIXED, Quality.SINGLE).astype(np.int64)
    assert check_classes(replace(gnss, quality=quality)) == []
    assert check_classes(replace(gnss, quality=None)) == []
