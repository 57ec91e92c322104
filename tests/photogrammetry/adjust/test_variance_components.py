"""Weights that agree with the residuals."""

from dataclasses import replace

import numpy as np
import pytest
from simulated_blocks import camera, simulated, with_pixels
from test_precision import POSE_COV, aerial

from insgnss.photogrammetry.adjust.adjustment import adjust_problem
from insgnss.photogrammetry.adjust.groups import control_points, weight_of
from insgnss.photogrammetry.adjust.normals import problem_of
from insgnss.photogrammetry.adjust.precision import precision_of
from insgnss.photogrammetry.adjust.variance_components import reweight_block

SHAPE = {"strips": 3, "images": 6, "points": 150}


def found(seed, pose=1.0, pixels=1.0, **shape):
    """Factors of a block whose poses and pixels have `pose` and `pixels` times the variances that
    are stated; by name.
    """
    cameras = (camera(free=("f", "cx", "cy")),)
    made = simulated(seed, cameras=cameras, control_m=0.01, **(SHAPE | shape))
    seen = made.block.observations
    block = with_pixels(made.block, seen.uv, seen.sigma_px / np.sqrt(pixels))
    groups = aerial(made, np.random.default_rng([5, seed]), claimed=POSE_COV / pose)
    got = reweight_block(problem_of(block, groups + control_points(block.control)), made.truth)
    assert got.converged
    return {c.name: c for c in got.precision.components()}, got


@pytest.mark.parametrize(("pose", "pixels"), [(2.5, 1.0), (6.25, 1.0), (1.0, 2.5), (0.4, 1.0)])
def test_a_kind_with_incorrect_variances_has_its_factor(pose, pixels) -> None:
    """Oracle: the simulation: the factor within four standard deviations of a component, three of
    them and 30 % from one; that of the other kind is nearer to one.
    """
    components, got = found(71, pose, pixels)
    for name, truth in (("pose", pose), ("image observations", pixels)):
        factor = got.factors.get(name, 1.0)
        sigma = factor * np.sqrt(2.0 / components[name].redundancy)
        assert abs(factor - truth) < 4.0 * sigma
        differs = abs(factor - 1.0) > 3.0 * sigma and not 1.0 / 1.3 < factor < 1.3
        assert differs == (truth != 1.0)


@pytest.mark.slow
def test_a_right_model_has_components_near_one() -> None:
    """Oracle: the simulation, eight blocks: means within 0.9 to 1.1 (that of poses scatters by
    0.03).
    """
    values = {"pose": [], "image observations": []}
    for seed in range(80, 88):
        _, got = found(seed, strips=6, images=12, points=400)
        for name, factor in values.items():
            factor.append(got.factors.get(name, 1.0))
    assert all(0.9 < np.mean(v) < 1.1 for v in values.values())


def test_few_redundant_observations_keep_their_weights() -> None:
    """Oracle: the stated limit; three control points have nine coordinates."""
    components, got = found(72, control=3)
    assert "ground control" not in got.factors
    assert components["ground control"].redundancy < 9.0
    P = [g.weight for g in got.precision.result.problem.groups if g.name == "ground control"]
    assert P[0] == pytest.approx(np.eye(3) / 0.01**2)


def test_the_covariance_follows_the_factors() -> None:
    """Oracle: an adjustment to which the true variances were stated."""
    made = simulated(73, cameras=(camera(free=()),), control=0, **SHAPE)
    rng = np.random.default_rng(9)
    stated = aerial(made, rng, claimed=POSE_COV / 2.5)
    got = reweight_block(problem_of(made.block, stated), made.truth)
    factor = got.factors["pose"]
    weights = [g.weight for g in got.precision.result.problem.groups]
    assert weights[0] == pytest.approx(weight_of(POSE_COV / 2.5 * factor, "pose"), rel=1e-9)
    true = [replace(g, weight=weight_of(POSE_COV, "pose")) for g in stated]
    want = precision_of(adjust_problem(problem_of(made.block, true), made.truth), 1.0)
    sigmas = [np.sqrt(np.diagonal(p.pose_cov, 0, 1, 2)) for p in (got.precision, want)]
    assert sigmas[0] == pytest.approx(sigmas[1], rel=0.15)  # half of three times 0.1
