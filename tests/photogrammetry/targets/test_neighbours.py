"""Measurements of one point against each other.

Oracle: draws of poses, point and matches; the exchanged measurement is known.
"""

import numpy as np

from insgnss.photogrammetry.targets.neighbours import disagreeing


def _drawn(seed: int, n: int = 5) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(seed)
    B = np.array([[50.0, 0.0, 5.0], [0.0, -50.0, 5.0]]) + rng.normal(0, 5.0, (n, 2, 3))
    cov = np.tile(np.array([[4.0, 1.0], [1.0, 3.0]]), (n, 1, 1))
    point = np.diag([0.1, 0.1, 0.2]) ** 2  # 5 px: common to all images
    errors = rng.normal(size=(n, 2)) @ np.array([[2.0, 0.5], [0.0, np.sqrt(2.75)]])
    return B @ (np.sqrt(point) @ rng.normal(size=3)) + errors, cov, B, point


def test_one_wrong_measurement_leaves_and_no_other() -> None:
    """Oracle: 40 px in one image of five; the others keep theirs."""
    for seed in range(20):
        off, cov, B, point = _drawn(seed)
        off[seed % 5] += [40.0, -30.0]
        assert np.flatnonzero(np.isfinite(disagreeing(off, cov, B, point))).tolist() == [seed % 5]


def test_good_measurements_stay() -> None:
    """Oracle: 1500 drawn; of 3.4e-4 of them a residual is beyond 4 sigma (Rayleigh)."""
    lost = sum(int(np.isfinite(disagreeing(*_drawn(100 + seed))).sum()) for seed in range(300))
    assert lost <= 3


def test_two_images_tell_nothing() -> None:
    """Oracle: either may be wrong."""
    off, cov, B, point = _drawn(1, 2)
    off[0] += 100.0
    assert not np.isfinite(disagreeing(off, cov, B, point)).any()
