"""Quantiles of the normal and chi-square distributions."""

import math

import pytest
from numpy.testing import assert_allclose
from scipy.special import chdtr, chdtrc, chdtri, ndtri

from insgnss.base.quantiles import chi_square_log_tails, chi_square_quantile, normal_quantile

SHARES = (1e-290, 1e-100, 5.7e-7, 1e-4, 0.025, 0.4999, 0.5, 0.5001, 0.975, 0.9999, 1.0 - 1e-10)


@pytest.mark.parametrize("dof", [0.5, 1.0, 2.0, 3.0, 9.7, 50.0, 333.3, 2e4, 81000.0])
def test_quantiles_are_those_of_a_library(dof):
    """Oracle: scipy; to 1e-12, what the logarithm of the gamma function leaves of 81 000."""
    for above in SHARES:
        assert_allclose(chi_square_quantile(dof, above), chdtri(dof, above), rtol=1e-12)


@pytest.mark.parametrize(("dof", "x"), [(3.0, 0.1), (3.0, 20.0), (40.0, 30.0), (40.0, 60.0)])
def test_tails_are_those_of_a_library(dof, x):
    """Oracle: scipy."""
    below, above = chi_square_log_tails(dof, x)
    assert_allclose(math.exp(below), chdtr(dof, x), rtol=1e-12)
    assert_allclose(math.exp(above), chdtrc(dof, x), rtol=1e-12)


def test_ends():
    """Oracle: what is exceeded never, and scipy's normal quantiles."""
    assert chi_square_quantile(3.0, 0.0) == math.inf
    for share in SHARES:
        assert_allclose(normal_quantile(share), ndtri(share), rtol=1e-12, atol=1e-15)
