"""Compiled kernels of `geodesy`; gravity is held against the numpy form and the potential in
test_earth.
"""

import numpy as np
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from insgnss.geodesy import _kernels as kernels


def test_matrix_of_quaternions():
    """Oracle: scipy Rotation."""
    rng = np.random.default_rng(5)
    for _ in range(20):
        q = rng.standard_normal(4)
        q /= np.linalg.norm(q)
        out = np.empty((3, 3))
        kernels.quat_to_matrix(q, out)
        assert_allclose(out, Rotation.from_quat(np.roll(q, -1)).as_matrix(), rtol=0, atol=1e-15)
