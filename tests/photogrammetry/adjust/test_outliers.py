"""Gross errors of image observations."""

from dataclasses import replace

import numpy as np
import pytest
from simulated_blocks import camera, simulated, with_pixels

from insgnss.base.errors import DataError
from insgnss.geodesy.rotation import rotation_from_vector
from insgnss.photogrammetry.adjust import direct, outliers
from insgnss.photogrammetry.adjust.adjustment import adjust_problem
from insgnss.photogrammetry.adjust.groups import PoseObservation, control_points
from insgnss.photogrammetry.adjust.normals import problem_of
from insgnss.photogrammetry.adjust.outliers import without_outliers
from insgnss.photogrammetry.adjust.precision import precision_of
from insgnss.photogrammetry.adjust.start import first_values

SHAPE = {"strips": 2, "images": 6, "points": 150, "control": 8}


def test_gross_errors_are_rejected_and_little_else() -> None:
    """Oracle: the planted errors, 2 % of the observations, of 5 to 300 pixels. All that exceed
    twice their minimal detectable bias go, and fewer than 0.5 % of what belongs to other points.
    """
    made = simulated(31, cameras=(camera(free=("f", "k1")),), **SHAPE)
    groups = control_points(made.block.control)
    good = precision_of(adjust_problem(problem_of(made.block, groups), made.truth), 1.0)
    rng = np.random.default_rng(2)
    n = len(made.block.observations)
    planted = rng.choice(n, n // 50, replace=False)
    uv = made.block.observations.uv.copy()
    size = np.exp(rng.uniform(np.log(5.0), np.log(300.0), planted.size))
    uv[planted, rng.integers(0, 2, planted.size)] += size
    block = with_pixels(made.block, uv)
    cleaned = without_outliers(problem_of(block, groups), first_values(block))
    visible = planted[size > 2.0 * good.detectable_px[planted].max(axis=1)]
    assert visible.size > 5
    # two rays of which one is wrong across the base intersect somewhere else
    rays = np.bincount(block.observations.point, minlength=len(block.points))
    certain = visible[rays[block.observations.point[visible]] > 2]
    assert set(certain) <= set(cleaned.rejected)
    at_fault = np.unique(block.observations.point[planted])
    others = ~np.isin(block.observations.point[cleaned.rejected], at_fault)
    assert others.sum() < 0.005 * n
    assert 0.9 < cleaned.result.sigma0 < 1.1


def test_a_small_gross_error_is_rejected_by_its_w() -> None:
    """Oracle: the planted error of 1.03 minimal detectable biases, some five standard deviations,
    in a point of many rays: too small for the robust weights.
    """
    made = simulated(34, cameras=(camera(free=()),), **SHAPE)
    groups = control_points(made.block.control)
    good = precision_of(adjust_problem(problem_of(made.block, groups), made.truth), 1.0)
    seen = made.block.observations
    many = np.bincount(seen.point)[seen.point] > 4
    sound = (np.abs(good.w).max(axis=1) < 1.0) & (good.redundancy[:, 0] > 0.7)
    row = int(np.flatnonzero(many & sound)[0])
    uv = seen.uv.copy()
    uv[row, 0] += np.sign(good.w[row, 0]) * 1.03 * good.detectable_px[row, 0]
    block = with_pixels(made.block, uv)
    cleaned = without_outliers(problem_of(block, groups), made.truth)
    assert row in cleaned.rejected
    assert cleaned.rejected.size <= 4  # and one coordinate in 16 000, with its point


def test_good_observations_stay() -> None:
    """Oracle: normal noise; at w = 4 one coordinate in 16 000 is rejected."""
    made = simulated(32, cameras=(camera(free=()),), **SHAPE)
    cleaned = without_outliers(
        problem_of(made.block, control_points(made.block.control)), made.truth
    )
    assert cleaned.rejected.size <= 1


def test_points_behind_their_camera_at_first_are_taken_when_poses_are_better() -> None:
    """Oracle: the same block from true poses. The last image starts upside down."""
    made = simulated(33, cameras=(camera(free=()),), **SHAPE)
    problem = problem_of(made.block, control_points(made.block.control))
    want = adjust_problem(problem, made.truth)
    C = made.truth.C_mc.copy()
    rays = made.block.observations.image == 3
    few = made.truth.point.copy()
    few[made.block.observations.point[rays][::2]] += (0.0, 0.0, 400.0)  # above the image
    C[3] = rotation_from_vector([0.1, 0.0, 0.0]) @ C[3]
    got = adjust_problem(problem, replace(made.truth, C_mc=C, point=few))
    assert got.redundancy == want.redundancy
    assert abs(got.cost - want.cost) < 1e-6 * want.cost


@pytest.mark.parametrize(("axis", "aerial"), [(0, False), (2, False), (2, True), (1, True)])
def test_a_gross_control_point_is_rejected_and_does_not_bend_the_block(axis, aerial) -> None:
    """Oracle: the planted half metre in one of eight control points; the block is that without it,
    to a tenth of its standard deviations.
    """
    made = simulated(35, cameras=(camera(free=("f",)),), **SHAPE)
    position = made.block.control.position_m.copy()
    position[3, axis] += 0.5
    block = replace(made.block, control=replace(made.block.control, position_m=position))
    groups = [*control_points(block.control)]
    if aerial:
        P = np.diag([1 / 0.1**2] * 3 + [1 / np.radians(0.05) ** 2] * 3)
        rng = np.random.default_rng(5)
        groups += [
            PoseObservation(i, x + rng.normal(0.0, 0.1, 3), C, P)
            for i, (x, C) in enumerate(zip(made.truth.position, made.truth.C_mc, strict=True))
        ]
    cleaned = without_outliers(problem_of(block, groups), first_values(block))
    assert [r.group for r in cleaned.control] == [3]
    bad = cleaned.control[0]
    assert bad.point == block.points[block.control.point[3]]
    assert bad.off_m[axis] == pytest.approx(0.5, abs=0.15)
    assert bad.w > 4.0
    del groups[3]
    want = precision_of(adjust_problem(problem_of(block, groups), made.truth))
    sigma = np.sqrt(np.diagonal(want.pose_cov, 0, 1, 2))[:, :3]
    off = cleaned.result.values.position - want.result.values.position
    assert (np.abs(off) / sigma).max() < 0.1 + 0.9 * (cleaned.rejected.size > 0)
    assert cleaned.rejected.size <= 1


@pytest.mark.parametrize(("control", "px"), [(1, 30.0), (5, 15.0), (5, 30.0), (6, 80.0)])
def test_good_control_stays_where_a_ray_to_it_is_bad(control, px) -> None:
    """Oracle: the planted ray of a good control point, of three rays where the control
    would go, or that beside it (15 px).
    """
    made = simulated(35, cameras=(camera(free=()),), **SHAPE)
    seen = made.block.observations
    row = np.flatnonzero(seen.point == made.block.control.point[control])[0]
    uv = seen.uv.copy()
    uv[row, 0] += px
    block = with_pixels(made.block, uv)
    cleaned = without_outliers(problem_of(block, control_points(block.control)), made.truth)
    assert row in cleaned.rejected
    assert cleaned.control == ()
    assert cleaned.rejected.size <= 2  # and one coordinate in 16 000, with its point


def test_control_that_claims_too_little_stays() -> None:
    """Oracle: the simulation: eight points three times worse than stated are no gross errors."""
    for seed in range(36, 40):
        made = simulated(seed, cameras=(camera(free=()),), **SHAPE)
        control = replace(made.block.control, cov=made.block.control.cov / 9.0)
        cleaned = without_outliers(problem_of(made.block, control_points(control)), made.truth)
        assert cleaned.control == ()


def test_the_last_three_control_points_stay() -> None:
    """Oracle: with two there is no datum. What an error along a strip leaves is a large w; where
    the three lie nearly in a line and rays go with it, the block is refused by name.
    """
    made = simulated(41, cameras=(camera(free=()),), **(SHAPE | {"control": 3}))
    position = made.block.control.position_m.copy()
    position[1, 0] += 0.5
    control = replace(made.block.control, position_m=position)
    said = ""
    try:
        cleaned = without_outliers(problem_of(made.block, control_points(control)), made.truth)
    except DataError as refused:
        said = str(refused)
    if said:
        assert "is not determined by the observations" in said
    else:
        assert cleaned.control == ()
        largest = max(np.abs(t.w).max() for t in cleaned.precision.groups)
        assert largest > 4.0 or cleaned.rejected.size


@pytest.mark.parametrize("held", [False, True])
def test_what_is_rejected_has_no_part_where_the_rounds_run_out(
    held: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: the adjustment's own observations: those rejected have no residual in it."""
    for module in (outliers, direct):
        monkeypatch.setattr(module, "MOST_REJECTIONS", 1)
    made = simulated(31, cameras=(camera(free=()),), **SHAPE)
    uv = made.block.observations.uv.copy()
    uv[:: len(uv) // 40, 0] += 8.0
    problem = problem_of(with_pixels(made.block, uv), control_points(made.block.control))
    if held:
        truth, weight = made.truth, np.diag(np.repeat([1e4, 1e8], 3))
        poses = [
            PoseObservation(k, truth.position[k], truth.C_mc[k], weight)
            for k in range(len(truth.position))
        ]
        problem = problem_of(problem.block, poses)
        precision, rejected = direct.intersected_points(problem, truth)
    else:
        cleaned = without_outliers(problem, made.truth)
        precision, rejected = cleaned.precision, cleaned.rejected
    used = precision.result.problem
    assert rejected.size > 3
    without_part = np.sort(used.order[problem.rays.active & ~used.rays.active])
    assert without_part.tolist() == rejected.tolist()
