"""Filter, smoother and batch least squares of the reference room on tiny linear problems that know
nothing of navigation.
"""

import numpy as np
import pytest
from batch_least_squares import batch
from posed import cross_covariance

from insgnss.flight.reference.linear import LinearProblem, kalman_filter, rts_smoother

EPOCHS, STATES = 12, 3


@pytest.fixture(scope="module")
def problem() -> LinearProblem:
    """Three states of different size; transitions, noise and gaps that change from epoch to epoch;
    a constant among the states.
    """
    rng = np.random.default_rng(4)
    size = np.array([1.0, 1e-3, 50.0])
    Phi = np.eye(STATES) + 0.3 * rng.standard_normal((EPOCHS, STATES, STATES)) * np.outer(
        size, 1.0 / size
    )
    Phi[:, 1] = [0.0, 1.0, 0.0]
    root = 0.2 * rng.standard_normal((EPOCHS, STATES, 2)) * size[:, None]
    root[:, 1] = 0.0
    gap = rng.standard_normal((EPOCHS, STATES)) * size
    measured = []
    for k in range(EPOCHS):
        rows = [
            (
                rng.standard_normal((2, STATES)) / size,
                rng.standard_normal(2),
                np.array([[0.5, 0.1], [0.1, 0.3]]),
            )
        ]
        measured.append(rows * (k % 3))
    return LinearProblem(
        rng.standard_normal(STATES) * size,
        np.diag(size**2),
        Phi,
        root @ np.swapaxes(root, 1, 2),
        gap,
        measured,
    )


def normal_equations(problem: LinearProblem) -> tuple[np.ndarray, np.ndarray]:
    """Mean (m n,) and covariance (m n, m n) of all errors, from the joint normal distribution, by
    conditioning on all measurements.
    """
    n = STATES
    A, mean = np.zeros((EPOCHS * n, EPOCHS * n)), np.zeros(EPOCHS * n)
    noise = np.zeros_like(A)
    for k in range(EPOCHS):
        now = slice(n * k, n * k + n)
        noise[now, now] = problem.Q[k] if k else problem.P
        A[now, now] = np.eye(n)
        mean[now] = problem.gap[k] if k else problem.mean
        if k:
            before = slice(n * k - n, n * k)
            A[now, : n * k] = problem.Phi[k] @ A[before, : n * k]
            mean[now] += problem.Phi[k] @ mean[before]
    P = A @ noise @ A.T
    rows = [(k, H, z, R) for k in range(EPOCHS) for H, z, R in problem.measured[k]]
    H = np.zeros((2 * len(rows), EPOCHS * n))
    for i, (k, one, _, _) in enumerate(rows):
        H[2 * i : 2 * i + 2, n * k : n * k + n] = one
    R = np.kron(np.eye(len(rows)), rows[0][3])
    gain = np.linalg.solve(H @ P @ H.T + R, H @ P).T
    return mean + gain @ (np.concatenate([z for _, _, z, _ in rows]) - H @ mean), P - gain @ H @ P


def test_smoother_and_batch_are_the_conditional_distribution(problem):
    """Oracle: the joint normal distribution of all errors, conditioned on all measurements by one
    matrix equation.
    """
    mean, P = normal_equations(problem)
    smooth, least_squares = rts_smoother(problem, kalman_filter(problem)), batch(problem)
    sigma = np.sqrt(np.diag(P)).reshape(EPOCHS, STATES)
    for estimate in (smooth.mean, least_squares.mean):
        assert np.abs((estimate - mean.reshape(EPOCHS, STATES)) / sigma).max() < 1e-9
    for j in range(EPOCHS):
        for k in range(j, EPOCHS):
            expected = P[STATES * j : STATES * j + STATES, STATES * k : STATES * k + STATES]
            scale = np.outer(sigma[j], sigma[k])
            assert (np.abs(least_squares.covariance(j, k) - expected) / scale).max() < 1e-9
            assert (np.abs(cross_covariance(smooth, j, k) - expected) / scale).max() < 1e-9


def test_filter_is_the_smoother_of_what_came_before(problem):
    """Oracle: batch least squares of the problem cut after each epoch."""
    found = kalman_filter(problem)
    for k in range(3, EPOCHS):
        cut = LinearProblem(
            problem.mean,
            problem.P,
            problem.Phi[: k + 1],
            problem.Q[: k + 1],
            problem.gap[: k + 1],
            problem.measured[: k + 1],
        )
        expected = batch(cut)
        sigma = np.sqrt(np.diag(expected.covariance(k, k)))
        assert np.abs((found.mean[k] - expected.mean[k]) / sigma).max() < 1e-9
        assert (
            np.abs(found.P[k] - expected.covariance(k, k)) / np.outer(sigma, sigma)
        ).max() < 1e-9


def test_filterpys_function_of_the_same_name_would_be_wrong(problem):
    """Oracle: the conditional distribution; why the method is taken: the function takes the
    transition of the epoch before.
    """
    from filterpy.kalman import rts_smoother

    flat = LinearProblem(
        problem.mean, problem.P, problem.Phi, problem.Q, 0.0 * problem.gap, problem.measured
    )
    right = kalman_filter(flat)
    mean, *_ = rts_smoother(right.mean[..., None], right.P, flat.Phi, flat.Q)
    expected = batch(flat)
    sigma = np.sqrt([np.diag(expected.covariance(k, k)) for k in range(EPOCHS)])
    assert np.abs((mean[..., 0] - expected.mean) / sigma).max() > 0.1
