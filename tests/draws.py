"""Errors drawn for Monte Carlo oracles: the same on every machine, and with exactly the mean and
the covariance that they are to have.
"""

import numpy as np

Array = np.ndarray


def lower_factor(cov: Array) -> Array:
    """L (n, n), lower triangular with L L' = cov, which may be singular.

    Written out, and not by eigenvectors or singular vectors: those have signs and, for equal
    values, directions that the library chooses. A pivot below 1e-12 of its variance is rounding,
    and its column zero.
    """
    L = np.zeros_like(cov, dtype=float)
    for j in range(len(cov)):
        left = cov[:, j] - L @ L[j]
        if left[j] > 1e-12 * cov[j, j]:
            L[j:, j] = left[j:] / np.sqrt(left[j])
    return L


def normal_draws(cov: Array, count: int, seed: int) -> Array:
    """(count, n) normal draws whose sample mean is zero and whose sample covariance (np.cov) is
    `cov`, to rounding.

    What is left of a Monte Carlo's chance is that of third and higher moments: a function of the
    draws that is linear but for terms of relative size e has a sample covariance that is right to
    some e / sqrt(count), whatever the seed.
    """
    z = np.random.default_rng(seed).standard_normal((count, len(cov)))
    z -= z.mean(axis=0)
    white = np.linalg.solve(lower_factor(z.T @ z / (count - 1)), z.T)
    return (lower_factor(np.asarray(cov)) @ white).T
