"""Three scalars at a time (K.4, B.3) against the same one by one, and all at once."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from insgnss.navigation.filter.codes import N_NAV
from insgnss.navigation.filter.kernels.backward import remove_scalar, remove_triple
from insgnss.navigation.filter.kernels.update import (
    innovation_test,
    is_scalar,
    one_after_another,
    scalar_update,
    take_off,
    triple_update,
    weigh,
)

STATES, USED = 21, 15


@pytest.fixture
def posed():
    """A covariance, three whitened scalars that see a part of the states, and a mean."""
    rng = np.random.default_rng(20)
    root = rng.normal(size=(STATES, STATES))
    P = root @ root.T
    H = np.zeros((3, STATES))
    H[:, [0, 4, 7, 9, 14]] = rng.normal(size=(3, 5))
    H[1, 4] = 0.0
    return P, rng.normal(size=STATES), H, rng.normal(size=(3, 1)), rng.normal(size=(N_NAV, STATES))


def _one_by_one(P, m, H, nu, cross):
    """Oracle: the textbook's update with one scalar, three times."""
    P, m, cross, gains, S, y = P.copy(), m.copy(), cross.copy(), [], [], []
    for h, z in zip(H, nu[:, 0], strict=True):
        s = 1.0 + h @ P @ h
        k, d = P @ h / s, z - h @ m
        m, cross = m + k * d, cross - np.outer(cross @ h, k)
        P = (np.eye(STATES) - np.outer(k, h)) @ P
        gains.append(k)
        S.append(s)
        y.append(d)
    return P, m, cross, np.array(gains), np.array(S), np.array(y)


@pytest.mark.parametrize("tracked", [True, False])
def test_three_scalars_at_once_are_the_three_one_by_one(posed, tracked):
    P0, m0, H, nu, cross0 = posed
    P, m, cross = P0.copy(), m0.copy(), cross0.copy()
    HP, K, S, y = H @ P, np.empty((3, STATES)), np.empty(3), np.empty(3)
    triple_update(P, m, H, HP, nu, USED, K, S, y, cross, tracked, np.empty((3, N_NAV)))
    expected = _one_by_one(P0, m0, H, nu, cross0)
    for got, wanted in zip((P, m, cross, K, S, y), expected, strict=True):
        if got is not cross or tracked:
            assert_allclose(got, wanted, atol=1e-11)
    assert_array_equal(P, P.T)
    assert_array_equal(cross, cross if tracked else cross0)
    information = np.linalg.inv(P0) + H.T @ H
    assert_allclose(P, np.linalg.inv(information), atol=1e-9)
    at_once = m0 + np.linalg.inv(information) @ H.T @ (nu[:, 0] - H @ m0)
    assert_allclose(m, at_once, atol=1e-9)


@pytest.mark.parametrize("tracked", [True, False])
def test_one_scalar_is_a_triple_of_which_two_rows_are_empty(posed, tracked):
    """Oracle: the update of three scalars, and the smoother's way back across it."""
    P0, m0, H, nu, cross0 = posed
    H, nu = H.copy(), nu.copy()
    assert not is_scalar(H, USED)
    H[1:], nu[1:] = 0.0, 0.0
    assert is_scalar(H, USED)
    results = []
    for update in (triple_update, scalar_update):
        P, m, cross = P0.copy(), m0.copy(), cross0.copy()
        HP, K, S, y = H @ P, np.empty((3, STATES)), np.empty(3), np.empty(3)
        update(P, m, H, HP, nu, USED, K, S, y, cross, tracked, np.empty((3, N_NAV)))
        results.append((P, m, cross, K, S, y))
    for got, wanted in zip(*results, strict=True):
        assert_allclose(got, wanted, atol=1e-11)
    assert_array_equal(P, P.T)
    root = np.random.default_rng(21).normal(size=(STATES, STATES))
    triple, scalar, G = root @ root.T, root @ root.T, np.empty((3, STATES))
    weigh(triple, K, STATES, G)
    remove_triple(triple, H, K, S, USED, G)
    remove_scalar(scalar, H[0], K[0], S[0], USED, G[0])
    assert_allclose(scalar, triple, atol=1e-10)


def test_the_innovations_are_weighed_with_their_covariance(posed):
    """Oracle: H P H' + R by numpy."""
    P, m, H, nu, _ = posed
    R = np.diag([1.0, 2.0, 3.0]) + 0.1
    S, L, HP, out = np.empty((3, 3)), np.zeros((3, 3)), np.empty((3, STATES)), np.empty((2, 3))
    nis = innovation_test(P, H, nu, m, R, USED, S, L, HP, out)
    innovation = nu[:, 0] - H @ m
    assert_allclose(S, H @ P @ H.T + R, atol=1e-11)
    assert_allclose(HP, H @ P, atol=1e-11)
    assert_allclose(nis, innovation @ np.linalg.solve(S, innovation))
    assert_allclose(out, [innovation, np.sqrt(np.diag(S))])


def test_the_smoother_goes_back_across_three_updates(posed):
    """Oracle: (B.3) as it stands, from the last scalar to the first."""
    P0, m0, H, nu, cross = posed
    _, _, _, K, S, _ = _one_by_one(P0, m0, H, nu, cross)
    root = np.random.default_rng(21).normal(size=(STATES, STATES))
    expected = Lam = root @ root.T
    for h, k, s in zip(H[::-1], K[::-1], S[::-1], strict=True):
        kept = np.eye(STATES) - np.outer(k, h)
        expected = kept.T @ expected @ kept + np.outer(h, h) / s
    Lam, G = Lam.copy(), np.empty((3, STATES))
    weigh(Lam, K, STATES, G)
    remove_triple(Lam, H, K, S, USED, G)
    assert_allclose(Lam, expected, atol=1e-10)


def test_a_product_goes_through_three_updates(posed):
    """Oracle: (1 - K_2 h_2) (1 - K_1 h_1) (1 - K_0 h_0) M by numpy."""
    P0, m0, H, nu, cross = posed
    K = _one_by_one(P0, m0, H, nu, cross)[3]
    M = expected = np.random.default_rng(22).normal(size=(STATES, 6))
    for h, k in zip(H, K, strict=True):
        expected = expected - np.outer(k, h @ expected)
    M, HM = M.copy(), np.empty((3, 6))
    weigh(M, H, USED, HM)
    one_after_another(H, K, USED, HM)
    take_off(K, HM, 6, M)
    assert_allclose(M, expected, atol=1e-12)
