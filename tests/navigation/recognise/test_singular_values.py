"""The singular values by which lags are scored (R.4)."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from insgnss.geodesy.rotation import rotation_from_vector
from insgnss.navigation.recognise.fit import _singular_values


@pytest.mark.parametrize("kind", ["any", "flat", "along one axis", "reflected", "nothing"])
def test_singular_values_are_those_of_the_decomposition(kind):
    """Oracle: numpy's decomposition; 1e-7 of the largest is far below what a score decides by."""
    M = np.random.default_rng(9).normal(size=(200, 3, 3))
    if kind == "flat":
        M[..., 2] = 0.0
    elif kind == "along one axis":
        M = M[..., :1] * M[..., :1].swapaxes(-1, -2) + 1e-9 * M
    elif kind == "reflected":
        M = rotation_from_vector(M[:, 0]) * [[[2.0], [2.0], [-2.0]]]
    elif kind == "nothing":
        M = 0.0 * M
    d = np.linalg.svd(M, compute_uv=False)
    larger, least = _singular_values(M)
    scale = np.maximum(d[:, 0], 1e-300)
    assert_allclose(larger / scale, (d[:, 0] + d[:, 1]) / scale, atol=1e-7)
    assert_allclose(least / scale, d[:, 2] * np.sign(np.linalg.det(M)) / scale, atol=1e-7)
