"""The engine on small blocks, against solvers of others."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.linalg import block_diag
from simulated_blocks import camera, simulated
from test_image_kernels import computed

from insgnss.base.advance import listening
from insgnss.base.errors import DataError
from insgnss.geodesy.rotation import (
    inverse_right_jacobian,
    rotation_from_vector,
    vector_from_rotation,
)
from insgnss.photogrammetry.adjust.adjustment import adjust_problem
from insgnss.photogrammetry.adjust.groups import (
    InteriorObservation,
    PoseObservation,
    control_points,
    weight_of,
)
from insgnss.photogrammetry.adjust.normals import problem_of
from insgnss.photogrammetry.adjust.precision import NONCENTRALITY, precision_of
from insgnss.photogrammetry.adjust.start import first_values
from insgnss.records.block import INTERIOR, RADIAL_MODELS

SMALL = {"strips": 1, "images": 3, "points": 20, "control": 4}


def vector_of(block, values):
    """Unknowns as one vector: psi of each pose about its value here."""
    free = [INTERIOR.index(name) for name in block.cameras[0].free]
    poses = np.hstack([values.position, np.zeros_like(values.position)])
    return np.concatenate([poses.ravel(), values.interior[:, free].ravel(), values.point.ravel()])


def residual_function(block, values, more):
    """Whitened residuals of the vector of unknowns, written without the engine; one camera."""
    n, free = len(block.images), [INTERIOR.index(name) for name in block.cameras[0].free]
    seen = block.observations
    root = np.linalg.cholesky(covariances(seen))

    def residuals(x):
        poses = x[: 6 * n].reshape(n, 6)
        C = rotation_from_vector(poses[:, 3:]) @ values.C_mc
        interior = values.interior.copy()
        k = len(free) * len(interior)
        interior[:, free] = x[6 * n : 6 * n + k].reshape(len(interior), -1)
        point = x[6 * n + k :].reshape(-1, 3)
        i, p = seen.image, seen.point
        e = computed(poses[i, :3], C[i], point[p], block.cameras[0], interior[0], seen.uv)
        control = (block.control.position_m - point[block.control.point]) / np.sqrt(
            block.control.cov[0, 0, 0]
        )
        return np.concatenate(
            [
                np.linalg.solve(root, e[:, :, None]).ravel(),
                control.ravel(),
                more(poses[:, :3], C, interior, point),
            ]
        )

    return residuals


def covariances(seen):
    """Covariance (n, 2, 2) of each image observation."""
    cov = seen.sigma_px[:, :, None] * seen.sigma_px[:, None]
    cov[:, [0, 1], [1, 0]] *= seen.correlation[:, None]
    return cov


def correlated(block, rng):
    """The block with standard deviations and correlations that differ from ray to ray."""
    seen = block.observations
    sigma = seen.sigma_px * rng.uniform(0.5, 2.0, seen.uv.shape)
    rho = rng.uniform(-0.95, 0.95, len(seen))
    return replace(block, observations=replace(seen, sigma_px=sigma, correlation=rho))


def nothing(*_):
    return np.zeros(0)


def scipy_solution(block, values, more=nothing):
    """The fit, its covariance, and the values about which its rotation vectors count: those of a
    first fit, so that they are psi.
    """
    from scipy.optimize import least_squares

    values = values.with_points(np.nan_to_num(values.point))
    n = 6 * len(block.images)
    for jacobian in ("2-point", "3-point"):
        function = residual_function(block, values, more)
        got = least_squares(
            function, vector_of(block, values), jacobian, xtol=1e-15, ftol=1e-15, x_scale="jac"
        )
        about = values
        values = replace(
            values,
            position=got.x[:n].reshape(-1, 6)[:, :3],
            C_mc=rotation_from_vector(got.x[:n].reshape(-1, 6)[:, 3:]) @ values.C_mc,
            point=got.x[-values.point.size :].reshape(-1, 3),
        )
        interior = values.interior.copy()
        interior[:, [INTERIOR.index(name) for name in block.cameras[0].free]] = got.x[
            n : -values.point.size
        ].reshape(len(interior), -1)
        values = replace(values, interior=interior)
    return got, covariance(got.jac), about


def covariance(jacobian):
    """Inverse of the normal matrix of whitened residuals; zero of what they do not see."""
    used = np.abs(jacobian).max(axis=0) > 0.0
    cov = np.zeros((used.size, used.size))
    scale = 1.0 / np.linalg.norm(jacobian[:, used], axis=0)
    J = jacobian[:, used] * scale
    cov[np.ix_(used, used)] = np.linalg.inv(J.T @ J) * scale * scale[:, None]
    return cov


@pytest.mark.parametrize(
    ("model", "rho"), [*((model, False) for model in RADIAL_MODELS), ("forward", True)]
)
@pytest.mark.slow
def test_against_scipy(model, rho):
    """Oracle: scipy's trust region on all unknowns at once with numeric derivatives: cost, values
    to 0.01 sigma, standard deviations to 1e-4, redundancy numbers and w by dense matrices; with
    coordinates of a point that are correlated, too.
    """
    backward = model == "backward"
    free = ("f", "cx", "cy", "k1", "p1") if not backward else ("f", "cx", "cy", "b1", "k1")
    one = replace(camera(backward, free), fisheye=model == "fisheye")
    made = simulated(4, cameras=(one,), start_m=0.5, start_deg=0.3, **SMALL)
    block = correlated(made.block, np.random.default_rng(4)) if rho else made.block
    first = first_values(block)
    result = adjust_problem(problem_of(block, control_points(block.control)), first)
    got, cov, about = scipy_solution(block, first)
    assert result.cost == pytest.approx(2.0 * got.cost, rel=1e-8)
    n, k = len(block.images), len(free)
    sigma = np.sqrt(np.diagonal(cov))
    precision = precision_of(result, 1.0)
    poses = got.x[: 6 * n].reshape(n, 6)
    C = rotation_from_vector(poses[:, 3:]) @ about.C_mc
    psi = vector_from_rotation(result.values.C_mc @ C.swapaxes(1, 2))
    off = np.hstack([result.values.position - poses[:, :3], psi])
    assert np.abs(off.ravel() / sigma[: 6 * n]).max() < 0.01
    assert np.sqrt(np.diagonal(precision.pose_cov, axis1=1, axis2=2)).ravel() == pytest.approx(
        sigma[: 6 * n], rel=1e-4
    )
    columns = [INTERIOR.index(name) for name in free]
    off = result.values.interior[0, columns] - got.x[6 * n : 6 * n + k]
    assert np.abs(off / sigma[6 * n : 6 * n + k]).max() < 0.01
    assert precision.sigma_interior(0)[columns] == pytest.approx(sigma[6 * n : 6 * n + k], rel=1e-4)
    seen = np.isfinite(first.point[:, 0])
    of_points = sigma[6 * n + k :].reshape(-1, 3)[seen]
    off = (result.values.point - got.x[6 * n + k :].reshape(-1, 3))[seen]
    assert np.abs(off / of_points).max() < 0.01
    got_points = np.sqrt(np.diagonal(precision.point_cov[seen], axis1=1, axis2=2))
    assert got_points == pytest.approx(of_points, rel=1e-4)
    total = np.nansum(precision.redundancy) + sum(t.redundancy.sum() for t in precision.groups)
    assert total == pytest.approx(result.redundancy, abs=1e-6)
    hat = got.jac @ cov @ got.jac.T
    m = 2 * len(block.observations)
    half = block_diag(*np.linalg.cholesky(covariances(block.observations)))
    P = np.linalg.inv(half @ half.T)
    Q_vv = half @ (np.eye(m) - hat[:m, :m]) @ half.T
    want = np.diagonal(Q_vv @ P).reshape(-1, 2)
    assert precision.redundancy == pytest.approx(want, abs=1e-5)
    size = np.sqrt(np.diagonal(P @ Q_vv @ P).reshape(-1, 2))
    w = (P @ half @ got.fun[:m]).reshape(-1, 2) / size
    checked = np.diagonal(P).reshape(-1, 2) * 0.01 < size**2  # redundant to a per cent
    assert precision.w[checked] == pytest.approx(w[checked], abs=2e-3)
    want = NONCENTRALITY / size[checked]
    assert precision.detectable_px[checked] == pytest.approx(want, rel=1e-3)


@dataclass(frozen=True, eq=False)
class ShiftedPositions:
    """Positions of several images with one common shift and a full covariance: a group as later
    aerial control brings it, unknown to the engine.
    """

    images: tuple[int, ...]
    observed: np.ndarray
    weight: np.ndarray
    name: str = "aerial positions"

    @property
    def keys(self):
        return (*(("pose", i) for i in self.images), ("shift", 0))

    def linearised(self, values):
        shift = values.blocks[("shift", 0)]
        e = (self.observed - values.position[list(self.images)] - shift).ravel()
        J = np.zeros((e.size, 6 * len(self.images) + 3))
        for k in range(len(self.images)):
            J[3 * k : 3 * k + 3, 6 * k : 6 * k + 3] = np.eye(3)
            J[3 * k : 3 * k + 3, -3:] = np.eye(3)
        return e, J


@dataclass(frozen=True, eq=False)
class Difference:
    """Coordinate differences of two object points, such as of a measured distance."""

    first: int
    second: int
    observed: np.ndarray
    weight: np.ndarray
    name: str = "differences"

    @property
    def keys(self):
        return (("point", self.first), ("point", self.second))

    def linearised(self, values):
        e = self.observed - (values.point[self.second] - values.point[self.first])
        return e, np.hstack([-np.eye(3), np.eye(3)])


def test_groups_that_the_engine_does_not_know():
    """Oracle: scipy on all unknowns at once. Positions with full covariance and a common shift,
    a tie between two points, a prior of the camera and of a pose.
    """
    made = simulated(6, cameras=(camera(free=("f", "cx", "cy")),), **SMALL)
    block = made.block
    rng = np.random.default_rng(8)
    n = len(block.images)
    root = rng.normal(0.0, 0.02, (3 * n, 3 * n)) + 0.05 * np.eye(3 * n)
    P = weight_of(root @ root.T, "positions")
    true_shift = np.array([0.3, -0.2, 0.5])
    observed = made.truth.position + true_shift + (root @ rng.normal(size=3 * n)).reshape(n, 3)
    a, b = (int(p) for p in np.flatnonzero(np.isfinite(first_values(block).point[:, 0]))[[0, 5]])
    tie = made.truth.point[b] - made.truth.point[a] + rng.normal(0.0, 0.01, 3)
    P_tie, P_pose = np.eye(3) / 0.01**2, weight_of(np.diag([1.0] * 3 + [1e-4] * 3), "pose")
    calibrated = np.array([5610.0, 2588.0])
    P_cam = weight_of(np.array([[9.0, 2.0], [2.0, 4.0]]), "camera")
    turned = rotation_from_vector([0.02, -0.01, 0.03]) @ made.truth.C_mc[1]
    groups = [
        *control_points(block.control),
        ShiftedPositions(tuple(range(n)), observed, P),
        Difference(a, b, tie, P_tie),
        PoseObservation(1, made.truth.position[1] + 0.5, turned, P_pose),
        InteriorObservation(0, np.array([0, 1]), calibrated, P_cam),
    ]
    first = first_values(block)
    first = replace(first, blocks={("shift", 0): np.zeros(3)})
    result = adjust_problem(problem_of(block, groups, first.blocks), first)

    from scipy.optimize import least_squares

    roots = {name: np.linalg.cholesky(W).T for name, W in [("P", P), ("pose", P_pose)]}
    camera_root = np.linalg.cholesky(P_cam).T
    shift = [np.zeros(3)]

    def more(position, C, interior, point):
        psi = vector_from_rotation(turned @ C[1].T)
        pose = np.concatenate([made.truth.position[1] + 0.5 - position[1], psi])
        return np.concatenate(
            [
                roots["P"] @ (observed - position - shift[0]).ravel(),
                (tie - point[b] + point[a]) / 0.01,
                roots["pose"] @ pose,
                camera_root @ (calibrated - interior[0, :2]),
            ]
        )

    start = first.with_points(np.nan_to_num(first.point))
    function = residual_function(block, start, more)

    def with_shift(x):
        shift[0] = x[-3:]
        return function(x[:-3])

    x0 = np.concatenate([vector_of(block, start), np.zeros(3)])
    got = least_squares(with_shift, x0, x_scale="jac", xtol=1e-15, ftol=1e-15)
    assert result.cost == pytest.approx(2.0 * got.cost, rel=1e-8)
    used = np.abs(got.jac).max(axis=0) > 0.0
    sigma = np.sqrt(np.diagonal(covariance(got.jac)))[-3:]
    precision = precision_of(result, 1.0)
    mine = np.sqrt(np.diagonal(precision.cov(("shift", 0))))
    assert mine == pytest.approx(sigma, rel=1e-4)
    assert np.abs(result.values.blocks[("shift", 0)] - got.x[-3:]).max() < 0.01 * sigma.min()
    assert precision.cov(("point", a), ("shift", 0)).shape == (6, 6)
    total = np.nansum(precision.redundancy) + sum(t.redundancy.sum() for t in precision.groups)
    assert total == pytest.approx(result.redundancy, abs=1e-6)
    assert result.redundancy == 2 * len(block.observations) + 12 + 3 * n + 3 + 6 + 2 - (used.sum())


def test_pose_derivative_of_a_large_residual():
    """Oracle: central differences of the rotation vector."""
    v = np.array([0.5, -0.8, 1.1])
    R = rotation_from_vector(v)
    want = np.empty((3, 3))
    for k in range(3):
        d = 1e-6 * np.eye(3)[k]
        ahead, behind = (vector_from_rotation(R @ rotation_from_vector(s * d)) for s in (1, -1))
        want[:, k] = (ahead - behind) / 2e-6
    assert inverse_right_jacobian(v) == pytest.approx(want, abs=1e-8)
    assert inverse_right_jacobian(1e-5 * v) == pytest.approx(np.eye(3), abs=1e-5)


def test_bad_first_values_of_a_strip_converge():
    """Oracle: the same block from its true poses. Start attitudes of one degree, a single strip
    with control at its ends.
    """
    made = simulated(9, strips=1, images=6, points=80, control=6, start_m=2.0, start_deg=1.0)
    groups = control_points(made.block.control)
    problem = problem_of(made.block, groups)
    far = adjust_problem(problem, first_values(made.block))
    near = adjust_problem(problem, made.truth)
    assert far.cost == pytest.approx(near.cost, rel=1e-8)
    assert far.iterations < 20


def test_images_without_orientation_are_resected():
    """Oracle: the truth of the simulation, pixels without noise."""
    made = simulated(11, points=150, control=8, control_m=1e-6, noise_px=1e-6)
    n = len(made.block.images)
    bare = replace(made.block, position_m=np.full((n, 3), np.nan), C_mc=np.full((n, 3, 3), np.nan))
    got = first_values(bare)
    assert got.position == pytest.approx(made.truth.position, abs=1e-3)
    assert got.C_mc == pytest.approx(made.truth.C_mc, abs=1e-5)


@pytest.mark.parametrize("seed", range(12, 22))
def test_a_block_without_datum_is_refused_by_name(seed):
    """Oracle: seven degrees of freedom that image observations cannot see; with seven components
    of two poses held there are none.
    """
    shape = {"strips": 1 + seed % 3, "images": 3 + seed % 5, "points": 60}
    made = simulated(seed, cameras=(camera(free=()),), control=0, **shape)
    with pytest.raises(DataError, match="is not determined by the observations"):
        adjust_problem(problem_of(made.block), made.truth)
    with pytest.raises(DataError, match="is not determined by the observations"):
        adjust_problem(problem_of(made.block), first_values(made.block))
    held = np.zeros((len(made.block.images), 6), dtype=bool)
    held[0] = True
    with pytest.raises(DataError, match="is not determined by the observations"):
        adjust_problem(problem_of(replace(made.block, held=held)), made.truth)  # scale is missing
    held[2, 0] = True
    block = replace(made.block, held=held)
    result = adjust_problem(problem_of(block), made.truth)
    precision = precision_of(result)
    assert precision.pose_cov[0] == pytest.approx(np.zeros((6, 6)))
    assert 0.7 < result.sigma0 < 1.3


@pytest.mark.parametrize(("least", "within"), [(1e-2, 1e-12), (1e-9, 1e-6), (1e-12, 1e-3)])
def test_a_weight_is_the_inverse_of_a_covariance(least, within):
    """Oracle: axes and variances that the covariance is made of, down to one near singular, which
    Cholesky's factor does not decide; sigmas of a metre beside a microradian.
    """
    axes = np.linalg.qr(np.random.default_rng(4).normal(size=(12, 12)))[0]
    variance, sigma = np.geomspace(least, 1.0, 12), np.repeat([1.0, 1e-6], 6)
    cov = sigma[:, None] * (axes * variance) @ axes.T * sigma
    expected = (axes / variance) @ axes.T
    weight = weight_of(cov, "strip")
    np.testing.assert_array_equal(weight, weight.T)
    found = sigma[:, None] * weight * sigma
    assert np.abs(found - expected).max() < within * np.abs(expected).max()


def test_a_covariance_that_is_none_is_refused():
    """Oracle: a singular matrix."""
    with pytest.raises(DataError, match="strip: covariance is not positive definite"):
        weight_of(np.ones((3, 3)), "strip")


def test_an_iteration_says_how_far_it_has_come():
    """Oracle: from nothing to all of it, and never back: steps of Newton only shrink here."""
    block = simulated(4, cameras=(camera(free=()),), start_m=0.5, start_deg=0.3, **SMALL).block
    problem, heard = problem_of(block, control_points(block.control)), []
    with listening(heard.append):
        adjust_problem(problem, first_values(block))
    assert heard[0] == 0.0
    assert heard[-1] == 1.0
    assert len(heard) > 2
    assert heard == sorted(heard)
