"""Blocks whose normal matrix is stored by its envelope, against the dense one."""

from dataclasses import replace

import numpy as np
import pytest
from simulated_blocks import camera, simulated
from test_adjustment import Difference
from test_aerial_control import strip_covariance

from insgnss.base.errors import DataError, UsageError
from insgnss.geodesy.rotation import rotation_from_vector
from insgnss.photogrammetry.adjust import envelope, ordering
from insgnss.photogrammetry.adjust.adjustment import _step, adjust_problem
from insgnss.photogrammetry.adjust.aerial import (
    BORESIGHT,
    CAMERA_LEVER_ARM,
    SHIFT,
    AerialControl,
    ParameterObservation,
)
from insgnss.photogrammetry.adjust.groups import control_points, weight_of
from insgnss.photogrammetry.adjust.normals import linearise_groups, problem_of
from insgnss.photogrammetry.adjust.precision import precision_of
from insgnss.records.block import ImageObservations


@pytest.fixture(scope="module")
def corridor():
    """Two strips of 60 images each with pieces of strips as groups, mounting, shifts, a pose that
    is held in part, and a tie between two points: everything that has a place in the matrix.
    """
    made = simulated(61, strips=2, images=60, points=1500, cameras=(camera(free=("f", "cx")),))
    rng = np.random.default_rng(62)
    n = len(made.block.images)
    held = np.zeros((n, 6), dtype=bool)
    held[[5, 77], 2] = True
    shuffled = replace(made.block, held=held)
    error = rng.normal(0.0, 0.02, (n, 3))
    groups = control_points(made.block.control)
    blocks = {(BORESIGHT, 0): np.eye(3), (CAMERA_LEVER_ARM, 0): np.zeros(3)}
    groups.append(ParameterObservation((CAMERA_LEVER_ARM, 0), np.zeros(3), np.eye(3) / 0.01**2))
    for k in range(6):
        rows = np.arange(20 * k, 20 * k + 20)
        blocks[(SHIFT, k)] = np.zeros(3)
        groups.append(ParameterObservation((SHIFT, k), np.zeros(3), np.eye(3) / 0.05**2, "shift"))
        groups.append(
            AerialControl(
                tuple(int(i) for i in rows),
                made.truth.position[rows] + error[rows],
                made.truth.C_mc[rows],
                weight_of(strip_covariance(20), "strip"),
                2.0 * rows,
                np.zeros((20, 3)),
                np.zeros((20, 3)),
                {BORESIGHT: 0, CAMERA_LEVER_ARM: 0, SHIFT: k},
            )
        )
    seen = np.flatnonzero(np.bincount(shuffled.observations.point) > 3)
    a, b = int(seen[0]), int(seen[-1])
    tie = made.truth.point[b] - made.truth.point[a]
    groups.append(Difference(a, b, tie, np.eye(3) / 0.05**2))
    turned = rotation_from_vector(rng.normal(0.0, 1e-3, (n, 3))) @ made.truth.C_mc
    first = replace(made.truth, blocks=blocks, C_mc=turned)
    return shuffled, groups, first


def both(block, groups, blocks, monkeypatch):
    """The problem with its envelope, and with a dense matrix."""
    sparse = problem_of(block, groups, blocks)
    with monkeypatch.context() as patch:
        patch.setattr(ordering, "DENSE_IMAGES", 10**9)
        whole = problem_of(block, groups, blocks)
    assert whole.layout.envelope.window == 0
    assert sparse.layout.envelope.window == 6 * len(block.images)
    assert sparse.layout.envelope.starts[-1] < 0.5 * whole.layout.envelope.starts[-1]
    return sparse, whole


def of_images(problem, dx):
    """Corrections of poses, and of what stands behind them."""
    n = problem.layout.n_images
    return dx[: 6 * n].reshape(n, 6)[problem.layout.place], dx[6 * n :]


def test_one_step(corridor, monkeypatch) -> None:
    """Oracle: the dense matrix: corrections to 1e-9 sigma, damped and not."""
    block, groups, first = corridor
    sparse, whole = both(block, groups, first.blocks, monkeypatch)
    sigma = np.sqrt(np.diagonal(precision_of(adjust_problem(whole, first), 1.0).pose_cov, 0, 1, 2))
    sigma[sigma == 0.0] = 1.0
    for damping in (0.0, 1e-3):
        (got, got_points, _), (want, want_points, _) = (
            _step(problem, first, damping, linearise_groups(problem, first))
            for problem in (sparse, whole)
        )
        poses, others = of_images(sparse, got)
        assert (np.abs(poses - of_images(whole, want)[0]) / sigma).max() < 1e-9
        assert others == pytest.approx(of_images(whole, want)[1], rel=1e-8, abs=1e-11)
        assert got_points == pytest.approx(want_points, abs=1e-10)


def test_precision(corridor, monkeypatch) -> None:
    """Oracle: the dense matrix: standard deviations to 1e-6, redundancy numbers, tests, and the
    covariance of images that have nothing in common.
    """
    block, groups, first = corridor
    sparse, whole = both(block, groups, first.blocks, monkeypatch)
    got, want = (precision_of(adjust_problem(problem, first), 1.0) for problem in (sparse, whole))
    free = want.pose_cov[:, np.arange(6), np.arange(6)] > 0.0
    assert free.sum() == 6 * 120 - 2
    sigmas = [np.sqrt(p.pose_cov[:, np.arange(6), np.arange(6)][free]) for p in (got, want)]
    assert sigmas[0] == pytest.approx(sigmas[1], rel=1e-6)
    assert (got.pose_cov[5, 2] == 0.0).all()
    assert got.point_cov == pytest.approx(want.point_cov, rel=1e-6, abs=1e-10, nan_ok=True)
    assert got.redundancy == pytest.approx(want.redundancy, abs=1e-8, nan_ok=True)
    assert got.sigma_interior(0) == pytest.approx(want.sigma_interior(0), rel=1e-6)
    for mine, theirs in zip(got.groups, want.groups, strict=True):
        assert mine.redundancy == pytest.approx(theirs.redundancy, abs=1e-8)
        assert mine.w == pytest.approx(theirs.w, abs=1e-4)
    far = (("pose", 0), ("pose", 59), (BORESIGHT, 0))
    assert got.cov(*far) == pytest.approx(want.cov(*far), rel=1e-5, abs=1e-12)
    columns = np.concatenate([sparse.layout.of(key)[0] for key in far])
    with pytest.raises(UsageError, match="not stored"):
        sparse.layout.envelope.entries(got.cofactors.stored, columns)


def test_a_point_measured_twice_in_an_image() -> None:
    """Oracle: one measurement of half the variance: standard deviations and poses."""
    made = simulated(63, strips=2, images=4, points=40, cameras=(camera(free=("f",)),))
    seen, groups = made.block.observations, control_points(made.block.control)
    twice = [np.concatenate([a, a[::3]]) for a in (seen.image, seen.point, seen.uv)]
    again = np.concatenate([seen.sigma_px, seen.sigma_px[::3]])
    better = seen.sigma_px.copy()
    better[::3] /= np.sqrt(2.0)
    got, want = (
        precision_of(
            adjust_problem(problem_of(replace(made.block, observations=o), groups), made.truth), 1
        )
        for o in (
            ImageObservations(*twice, again),
            ImageObservations(seen.image, seen.point, seen.uv, better),
        )
    )
    assert got.pose_cov == pytest.approx(want.pose_cov, rel=1e-6, abs=1e-14)
    assert got.point_cov == pytest.approx(want.point_cov, rel=1e-6, abs=1e-10, nan_ok=True)
    assert got.result.values.position == pytest.approx(want.result.values.position, abs=1e-6)


def test_the_order_of_the_images_does_not_matter(corridor) -> None:
    """Oracle: the same block whose images are listed at random costs as little."""
    block, _, _ = corridor
    n = len(block.images)
    images = np.random.default_rng(3).permutation(n)
    row = np.argsort(images)
    seen = replace(block.observations, image=row[block.observations.image])
    shuffled = replace(block, observations=seen)
    given = ordering.arrange_poses(block, [], 6 * n + 5)[1].starts[-1]
    assert ordering.arrange_poses(shuffled, [], 6 * n + 5)[1].starts[-1] < 1.3 * given


def test_a_large_block_without_datum_is_refused_by_name(corridor) -> None:
    """Oracle: image observations alone do not see where the block lies."""
    block, _, first = corridor
    free = replace(block, held=np.zeros_like(block.held))
    problem = problem_of(free)
    assert problem.layout.envelope.window
    with pytest.raises(DataError, match="is not determined by the observations"):
        adjust_problem(problem, replace(first, blocks={}))


@pytest.mark.parametrize(("n", "border"), [(30, 7), (30, 0), (1, 4), (0, 9), (60, 20)])
@pytest.mark.parametrize("images", [2, 8, 64])
def test_any_envelope(n, border, images, monkeypatch) -> None:
    """Oracle: numpy's dense inverse and solution; columns that are left out are zero."""
    rng = np.random.default_rng(n + border)
    size = 6 * n + border
    reach = np.minimum(np.arange(n) + rng.integers(0, 5, n), n - 1)
    A = np.zeros((size, size))
    for i in range(max(n, 1)):
        columns = np.r_[6 * i : 6 * reach[i] + 6, 6 * n : size] if n else np.arange(size)
        J = rng.normal(size=(40, columns.size))
        A[np.ix_(columns, columns)] += J.T @ J
    monkeypatch.setattr(envelope, "PANELS", (images,))
    monkeypatch.setattr(envelope, "PANEL", -1e12)  # many panels, even where it does not pay
    stored_as = envelope.envelope_of(size, reach)[0]
    stored = np.zeros(stored_as.starts[-1])
    for k, (first, stop, _) in enumerate(stored_as.panels):
        stored_as.panel(stored, k)[:] = A[np.ix_(stored_as.rows(k), np.arange(first, stop))]
    scale = 1.0 / np.sqrt(np.diagonal(A))
    scale[[0, -1]] = 0.0
    free = np.flatnonzero(scale)
    factor, column = envelope.factorise_envelope(stored_as, stored, scale, 0.0)
    assert column == -1
    right = rng.normal(size=(size, 2))
    want = np.zeros_like(right)
    want[free] = np.linalg.solve(A[np.ix_(free, free)], right[free])
    assert factor.solved(right) == pytest.approx(want, abs=1e-12)
    inverse = np.zeros_like(A)
    inverse[np.ix_(free, free)] = np.linalg.inv(A[np.ix_(free, free)])
    stored = factor.inverted()
    for first, stop, last in stored_as.panels:
        columns = np.r_[first:last, stored_as.window : size] if stop > first else np.arange(0)
        for c in columns[: stop - first]:
            got = stored_as.entries(stored, np.array([c, columns[-1]]))
            pair = np.ix_([c, columns[-1]], [c, columns[-1]])
            assert got == pytest.approx(inverse[pair], abs=1e-12)
    assert stored_as.diagonal(stored) == pytest.approx(np.diagonal(inverse), abs=1e-12)
