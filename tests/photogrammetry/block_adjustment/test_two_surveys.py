"""Ground points of two surveys, some of which lie shifted against the others.

Oracle: planted shifts of differences that are drawn with their covariance, common errors in it.
"""

import numpy as np
import pytest

from insgnss.photogrammetry.block_adjustment.residuals.surveys import best_split


def drawn(seed: int, n: int = 10) -> tuple[np.ndarray, np.ndarray, np.random.Generator]:
    """Return differences (n, 3) of right points, m, with their covariance; heights err together."""
    draw = np.random.default_rng(seed)
    common = np.kron(np.ones((n, n)), np.diag([0.02, 0.02, 0.2]) ** 2)
    C = common + np.kron(np.eye(n), np.diag([0.012, 0.012, 0.025]) ** 2)
    return (np.linalg.cholesky(C) @ draw.standard_normal(3 * n)).reshape(n, 3), C, draw


@pytest.mark.parametrize("size_m", [0.3, 5.0, 48.3])
@pytest.mark.parametrize("subset", [[0, 2, 4], [1, 3], [0, 1, 2, 3, 4]])
def test_the_points_of_another_survey_are_found(subset, size_m) -> None:
    for seed in range(20):
        d, C, _ = drawn(seed)
        d[subset, 2] -= size_m
        found = best_split(d, C)
        assert found is not None
        inside, shift, sigma, gain = found
        sign = 1.0 if inside[subset[0]] else -1.0  # halves: either may be called the subset
        assert set(np.flatnonzero(inside == inside[subset[0]])) == set(subset)
        assert abs(sign * shift[2] + size_m) < 4.5 * sigma[2]
        assert gain > 30.0


def test_points_of_another_datum_are_found_in_plan() -> None:
    d, C, _ = drawn(1)
    d[[2, 5, 6]] += [0.4, -0.3, 0.0]
    found = best_split(d, C)
    assert found is not None
    assert list(np.flatnonzero(found[0])) == [2, 5, 6]
    assert found[1][:2] == pytest.approx([0.4, -0.3], abs=0.05)


def test_right_points_and_a_shift_of_all_are_one_survey() -> None:
    for seed in range(200):
        d, C, _ = drawn(seed)
        assert best_split(d + [0.5, 1.0, -3.0], C) is None


def test_what_bends_all_heights_is_no_second_survey() -> None:
    """A wrong camera constant scales heights, a turned block tilts them, one point errs alone."""
    for seed in range(50):
        d, C, draw = drawn(seed)
        bent = d.copy()
        bent[:, 2] += 0.6 * draw.uniform(-1.0, 1.0, len(d))
        assert best_split(bent, C) is None
        d[3, 2] += 1.0
        assert best_split(d, C) is None


def test_too_few_points_are_not_judged() -> None:
    d, C, _ = drawn(1, 4)
    assert best_split(d, C) is None
