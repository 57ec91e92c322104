"""Groups of observations with covariances, variance factors, further observations."""

import numpy as np
import pytest

from insgnss.geodesy.least_squares import Equations, NormalEquations, condition_on, gauss_newton

UNKNOWNS = 3


def covariances(rng, k, d):
    root = rng.normal(size=(k, d, d))
    return root @ root.swapaxes(1, 2) + 0.1 * np.eye(d)


def group(rng, k, d, name="one"):
    A = rng.normal(size=(k, d, UNKNOWNS))
    return Equations(rng.normal(size=(k, d)), A, {name: covariances(rng, k, d)})


@pytest.mark.parametrize("seed", range(3))
def test_groups_and_prior_are_one_whitened_system(seed):
    """Oracle: numpy's QR least squares of all rows, whitened one vector at a time."""
    rng = np.random.default_rng(seed)
    prior = Equations.prior(rng.normal(size=2), covariances(rng, 1, 2)[0], np.eye(2, 3, 1))
    groups = [group(rng, 6, 2), group(rng, 1, 4, "two"), prior]
    got = NormalEquations(groups, {"two": 2.5})
    rows, right = [], []
    for one in groups:
        for e, A, V in zip(one.e, one.A, next(iter(one.shares.values())), strict=True):
            white = np.linalg.inv(np.linalg.cholesky(2.5 * V if "two" in one.shares else V))
            rows.append(white @ A)
            right.append(white @ e)
    A, y = np.concatenate(rows), np.concatenate(right)
    dx = np.linalg.lstsq(A, y, rcond=None)[0]
    np.testing.assert_allclose(got.dx, dx, rtol=1e-9)
    np.testing.assert_allclose(got.cov, np.linalg.inv(A.T @ A), rtol=1e-9)
    assert got.square(dx) == pytest.approx(float(np.sum(((y - A @ dx)[:-2]) ** 2)), rel=1e-9)
    e, J = groups[1].whitened({"two": 2.5})
    np.testing.assert_allclose(np.column_stack([J, e]), np.column_stack([A, y])[12:16], rtol=1e-9)


def test_redundancies_are_observations_less_unknowns():
    """Oracle: their sum by count; the square sums add up to that of all residuals (LS.2)."""
    rng = np.random.default_rng(4)
    split = group(rng, 5, 2)
    split = Equations(split.e, split.A, split.shares | {"more": covariances(rng, 5, 2)})
    first = NormalEquations([split, group(rng, 4, 3)], {"more": 0.3})
    fitted = [Equations(one.residual(first.dx), one.A, one.shares) for one in first.groups]
    sums = NormalEquations(fitted, {"more": 0.3}).components()
    assert set(sums) == {"one", "more"}
    assert sum(r for _, r in sums.values()) == pytest.approx(10 + 12 - UNKNOWNS)
    assert sum(s for s, _ in sums.values()) == pytest.approx(first.square(first.dx))


def test_variance_factors_come_out_as_they_were_planted():
    """Oracle: errors drawn with three and a half times one variance of two."""
    rng = np.random.default_rng(5)
    A, x = rng.normal(size=(2, 800, 1, UNKNOWNS)), rng.normal(size=UNKNOWNS)
    error = rng.normal(size=(2, 800, 1)) * np.sqrt([3.5, 1.0])[:, None, None]
    unit = np.ones((800, 1, 1))
    factors = {"a": 1.0, "b": 1.0}
    for _ in range(20):
        e = [a @ x + n for a, n in zip(A, error, strict=True)]
        first = NormalEquations(
            [Equations(e[0], A[0], {"a": unit}), Equations(e[1], A[1], {"b": unit})], factors
        )
        left = [Equations(one.residual(first.dx), one.A, one.shares) for one in first.groups]
        sums = NormalEquations(left, factors).components()
        factors = {name: factors[name] * s / r for name, (s, r) in sums.items()}
    assert factors["a"] == pytest.approx(3.5, rel=4.0 * np.sqrt(2.0 / 800))
    assert factors["b"] == pytest.approx(1.0, rel=4.0 * np.sqrt(2.0 / 800))


def test_further_observations_are_as_if_they_had_been_there():
    """Oracle: the normal equations of all observations at once."""
    rng = np.random.default_rng(6)
    some, more = group(rng, 5, 2), group(rng, 1, 3)
    first, whole = NormalEquations([some]), NormalEquations([some, more])
    e = more.residual(first.dx)[0]
    dx, cov = condition_on(first.cov, more.A[0], e, more.covariance()[0])
    np.testing.assert_allclose(first.dx + dx, whole.dx, rtol=1e-9)
    np.testing.assert_allclose(cov, whole.cov, rtol=1e-9)


def test_steps_end_where_the_values_stay():
    """Oracle: closed form, the mean of distances gives the radius; three steps are too few."""
    angle = np.linspace(0.0, 6.0, 9)
    seen = np.stack([2.0 * np.cos(angle) + 0.3, 2.0 * np.sin(angle) - 0.1], axis=1)

    def circle(steps):
        x = np.array([0.0, 0.0, 1.0])

        def linearised():
            d = seen - x[:2]
            r = np.linalg.norm(d, axis=1)
            A = np.column_stack([-d / r[:, None], -np.ones(9)])
            return [Equations((x[2] - r)[:, None], A[:, None], {"": np.full((9, 1, 1), 1e-4)})]

        return x, gauss_newton(linearised, lambda dx: np.add(x, dx, out=x), 1e-16, steps)[1]

    x, converged = circle(20)
    assert converged
    np.testing.assert_allclose(x, [0.3, -0.1, 2.0], atol=1e-12)
    assert not circle(2)[1]
