"""The smoothed covariances as tables: errors that epochs share, and states that are left out."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from insgnss.navigation.filter.codes import POS
from insgnss.navigation.filter.covariances import SmoothedCovariances
from insgnss.navigation.filter.smoother import SharedError

EPOCHS, STATES = 8, 14
INDEX = np.arange(EPOCHS)


def matrices() -> np.ndarray:
    """Covariances (8, 14, 14), of every epoch another one."""
    root = np.random.default_rng(7).normal(size=(EPOCHS, STATES, STATES))
    return root @ np.swapaxes(root, 1, 2)


def kept(P: np.ndarray) -> SmoothedCovariances:
    """All of them, as the smoother leaves them."""
    n = P.shape[1]
    row, column = np.tril_indices(n)
    nav_row, nav_column = np.tril_indices(9)
    sigma = np.sqrt(np.diagonal(P, axis1=1, axis2=2))
    return SmoothedCovariances(
        P[:, nav_row, nav_column], np.arange(len(P)), P[:, row, column], sigma, None, n
    )


@pytest.mark.parametrize("first", [0, 2])
def test_an_error_is_shared_from_its_first_epoch_to_its_last(first: int) -> None:
    """Oracle: the sum by hand at epochs 3 to 5, neither 2 nor 6, however the covariance is asked
    for, of the whole flight and of a part that counts its epochs anew.
    """
    P, shared = matrices(), np.array([[4.0, 1.0, 0.0], [1.0, 9.0, 2.0], [0.0, 2.0, 16.0]])
    expected = P.copy()
    expected[3:6, POS, POS] += shared
    part = kept(P).piece(first, EPOCHS - 1)
    part = part.enlarged((SharedError(3 - first, 5 - first, shared),))
    index, expected = INDEX[: EPOCHS - first], expected[first:]
    assert_allclose(part.whole(index), expected, rtol=1e-12)
    assert_allclose(part.of_navigation(index), expected[:, :9, :9], rtol=1e-12)
    assert_allclose(part.variance(index), np.diagonal(expected, axis1=1, axis2=2), rtol=1e-12)
    A = np.random.default_rng(8).normal(size=(2, STATES))
    of_sums = np.einsum("qi,kij,qj->kq", A, expected, A)
    assert_allclose(part.variance_of(index, A), of_sums, rtol=1e-9)


def test_states_that_are_left_out_twice_count_from_what_was_left() -> None:
    """Oracle: rows and columns by their letters: without the bias b and the scale k, then without
    what is third from navigation on by then, e.
    """
    P = matrices()
    once = kept(P).without(np.array([9 + 1, 9 + 3]))
    twice = once.without(np.array([9 + 2]))
    letters = [*"pppvvvqqq", *"abcke"]
    left = [k for k, letter in enumerate(letters) if letter not in "bke"]
    assert [letters[k] for k in left[9:]] == ["a", "c"]
    assert_array_equal(twice.whole(INDEX), P[:, left][:, :, left])
    assert_array_equal(twice.variance(INDEX), np.diagonal(P, axis1=1, axis2=2)[:, left])
    sigma = np.sqrt(np.diagonal(P, axis1=1, axis2=2))
    assert_array_equal(twice.filter_sigma, sigma[:, left])
