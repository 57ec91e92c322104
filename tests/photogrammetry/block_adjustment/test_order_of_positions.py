"""Positions that are paired with images by number, and whose rows lost their order."""

import numpy as np
import pytest

from insgnss.photogrammetry.block_adjustment.aerial.positions import _permutation_sentence


def rows_of_lines(n_lines: int = 5, images: int = 12) -> np.ndarray:
    """Positions (n, 3) of lines to and fro, m."""
    along = 16.0 * np.arange(images)
    return np.vstack(
        [
            np.column_stack([along[:: (-1) ** k], np.full((images, 2), [32.0 * k, 80.0])])
            for k in range(n_lines)
        ]
    )


@pytest.mark.parametrize("seed", range(5))
def test_positions_in_a_lost_order_are_named_and_no_other_mistake_is(seed) -> None:
    """Oracle: the order itself; a shift, rows off, a reversed line are others' to name."""
    draw = np.random.default_rng(seed)
    X = rows_of_lines()
    names = [f"DJI_{k:04d}.JPG" for k in range(len(X))]
    Y = X + 0.5 * draw.standard_normal(X.shape)
    lost = np.argsort(Y[:, 0])
    k = int(np.flatnonzero(lost != np.arange(len(X)))[0])
    assert f"{names[k]} has that of {names[lost[k]]}" in _permutation_sentence(names, X, Y[lost])
    reverse_of_line = np.r_[0:24, 35:23:-1, 36:60]
    for order in (np.arange(60), np.r_[1:60, 0], np.arange(60)[::-1], reverse_of_line):
        assert _permutation_sentence(names, X, Y[order]) == ""
    for shift_m in ([0.0, 32.0, 0.0], [16.0, 0.0, 0.0], [500.0, -80.0, 48.0]):
        assert _permutation_sentence(names, X, Y + shift_m) == ""
