"""Points from held poses, against derivatives of the intersection by everything that it takes."""

from dataclasses import replace

import numpy as np
import pytest
from draws import lower_factor
from simulated_blocks import camera, simulated

from insgnss.geodesy.rotation import rotation_from_vector
from insgnss.photogrammetry.adjust.adjustment import adjust_problem, residuals_px
from insgnss.photogrammetry.adjust.aerial import AerialControl
from insgnss.photogrammetry.adjust.direct import direct_precision, joint_covariance
from insgnss.photogrammetry.adjust.groups import InteriorObservation, weight_of
from insgnss.photogrammetry.adjust.normals import problem_of
from insgnss.photogrammetry.adjust.start import first_values

N = 4


def of_poses_and_camera() -> np.ndarray:
    P = np.zeros((6 * N + 2, 6 * N + 2))
    P[: 6 * N, : 6 * N], P[6 * N :, 6 * N :] = covariance(), CALIBRATION
    return P


def covariance() -> np.ndarray:
    """Positions (3 cm), attitudes (0.05 deg), mostly common to all images."""
    in_time = 0.75 * np.ones((N, N)) + 0.25 * np.eye(N)
    return np.kron(in_time, np.diag(np.repeat([0.03, np.radians(0.05)], 3) ** 2))


CALIBRATION = np.diag([0.8, 0.5]) ** 2
"""Of f and cx, px^2."""


def held(block):
    cameras = tuple(replace(c, free=()) for c in block.cameras)
    return problem_of(replace(block, held=np.ones_like(block.held), cameras=cameras))


def intersection(block, values, step=None, rays=None, camera=None):
    """Points and whitened residuals with poses moved by `step`, pixels by `rays`, f and cx too."""
    if camera is not None:
        interior = values.interior.copy()
        interior[0, :2] += camera
        values = replace(values, interior=interior)
    if step is not None:
        values = replace(
            values,
            position=values.position + step[:, :3],
            C_mc=rotation_from_vector(step[:, 3:]) @ values.C_mc,
        )
    if rays is not None:
        seen = block.observations
        block = replace(block, observations=replace(seen, uv=seen.uv + rays))
    result = adjust_problem(held(block), values)
    return result.values.point.ravel(), residuals_px(result).ravel() / 0.5


@pytest.fixture(scope="module")
def case():
    made = simulated(
        61, strips=1, images=N, points=12, cameras=(camera(free=("f", "cx")),), control=0
    )
    block = made.block
    rows, zeros = tuple(range(N)), np.zeros((N, 3))
    control = AerialControl(
        rows,
        made.truth.position,
        made.truth.C_mc,
        weight_of(covariance(), "poses"),
        np.arange(N) * 1.0,
        zeros,
        zeros,
    )
    calibration = InteriorObservation(
        0, np.array([0, 1]), made.truth.interior[0, :2], np.linalg.inv(CALIBRATION)
    )
    problem = problem_of(block, [control, calibration])
    first = first_values(replace(block, position_m=made.truth.position, C_mc=made.truth.C_mc))
    alone = adjust_problem(held(block), first)
    done = replace(alone, problem=problem.with_active_of(alone.problem))
    return made, done


@pytest.fixture(scope="module")
def derivatives(case):
    """Of points and whitened residuals by poses and camera, and by whitened pixels, numerically."""
    made, done = case
    values, block = done.values, made.block
    by_pose, by_ray = [], []
    for k in range(6 * N):
        step = np.zeros(6 * N)
        step[k] = 1e-3 if k % 6 < 3 else 1e-5
        ahead = intersection(block, values, step.reshape(N, 6))
        back = intersection(block, values, -step.reshape(N, 6))
        by_pose.append([(a - b) / (2.0 * step[k]) for a, b in zip(ahead, back, strict=True)])
    for k in range(2):
        step = 0.05 * np.eye(2)[k]
        ahead = intersection(block, values, camera=step)
        back = intersection(block, values, camera=-step)
        by_pose.append([(a - b) / 0.1 for a, b in zip(ahead, back, strict=True)])
    n = block.observations.uv.size
    for k in range(n):
        step = np.zeros(n)
        step[k] = 0.05
        ahead = intersection(block, values, rays=step.reshape(-1, 2))
        back = intersection(block, values, rays=-step.reshape(-1, 2))
        by_ray.append([(a - b) / (2.0 * 0.1) for a, b in zip(ahead, back, strict=True)])
    of_points = (np.array([d[0] for d in by_pose]).T, np.array([d[0] for d in by_ray]).T)
    of_residuals = (np.array([d[1] for d in by_pose]).T, np.array([d[1] for d in by_ray]).T)
    return of_points, of_residuals


def test_covariance_of_points_and_between_them(case, derivatives) -> None:
    """(J.19). Oracle: F P F^T with derivatives of the intersection itself."""
    _, done = case
    (by_pose, by_ray), _ = derivatives
    whole = by_pose @ of_poses_and_camera() @ by_pose.T + by_ray @ by_ray.T
    precision = direct_precision(done)
    good = np.flatnonzero(np.isfinite(done.values.point[:, 0]))
    columns = (3 * good[:, None] + np.arange(3)).ravel()
    joint = joint_covariance(done.problem, done.values, good.tolist())
    expected = whole[np.ix_(columns, columns)]
    sigma = np.sqrt(np.diagonal(expected))
    # central differences and Gauss-Newton without second derivatives: 1e-3 of the sigmas
    np.testing.assert_allclose(
        joint / sigma / sigma[:, None], expected / sigma / sigma[:, None], atol=3e-3
    )
    for k, p in enumerate(good):
        own = joint[3 * k : 3 * k + 3, 3 * k : 3 * k + 3]
        np.testing.assert_allclose(precision.point_cov[p], own, rtol=1e-9, atol=1e-15)
    # the error that all poses share moves all points alike: without it between them the oracle
    # above would be met by the diagonal blocks alone
    assert abs(joint[0, 3] / sigma[0] / sigma[3]) > 0.5


def test_expected_squares_of_residuals(case, derivatives) -> None:
    """(J.20). Oracle: the same derivatives of the residuals."""
    _, done = case
    _, (by_pose, by_ray) = derivatives
    squares = np.diagonal(by_pose @ of_poses_and_camera() @ by_pose.T + by_ray @ by_ray.T)
    precision = direct_precision(done)
    found = precision.redundancy.ravel()
    active = np.isfinite(found)
    np.testing.assert_allclose(found[active], squares[active], rtol=1e-2, atol=2e-3)


@pytest.mark.slow
def test_points_lie_within_their_covariance(case) -> None:
    """300 draws: normalised squares of one point within 99.99 % of chi-square."""
    from scipy.stats import chi2

    made, done = case
    rng = np.random.default_rng(62)
    L, values = lower_factor(covariance()), done.values
    point = int(np.flatnonzero(np.isfinite(values.point[:, 0]))[0])
    cov = direct_precision(done).point_cov[point]
    total, draws = 0.0, 300
    for _ in range(draws):
        step = (L @ rng.normal(size=6 * N)).reshape(N, 6)
        noise = 0.5 * rng.normal(size=made.block.observations.uv.shape)
        camera_off = np.sqrt(np.diagonal(CALIBRATION)) * rng.normal(size=2)
        moved, _ = intersection(made.block, values, step, noise, camera_off)
        off = moved.reshape(-1, 3)[point] - values.point[point]
        total += off @ np.linalg.solve(cov, off)
    low, high = chi2.ppf([5e-5, 1.0 - 5e-5], 3 * draws)
    assert low < total < high
