"""The readout of a rolling shutter, estimated beside a block and taken off."""

from dataclasses import replace

import numpy as np
import pytest
from mounted_blocks import Plan, precision_expected

from insgnss.geodesy.rotation import rotation_from_vector
from insgnss.photogrammetry.adjust.adjustment import adjust_problem
from insgnss.photogrammetry.adjust.normals import problem_of
from insgnss.photogrammetry.adjust.outliers import without_outliers
from insgnss.photogrammetry.adjust.shutter import readout_gain, without_readout
from insgnss.records.cameras.camera import pixels_of

PLAN = Plan(headings_deg=(0.0, 180.0, 90.0, 270.0), control=6, images=4, points=120)


def rolled(readout_s, plan=PLAN):
    """A block whose rows are exposed one after another, adjusted as if at once, and its motion."""
    true = precision_expected(plan).result
    block, values = true.problem.block, true.values
    draw = np.random.default_rng(3)
    n = len(block.images)
    course = np.repeat(np.radians(plan.headings_deg), n // len(plan.headings_deg))
    velocity = 12.0 * np.column_stack([np.cos(course), np.sin(course), 0.0 * course])
    rate = np.radians(5.0) * draw.normal(size=(n, 3))
    obs, camera = block.observations, block.cameras[0]
    i, P = obs.image, values.point[obs.point]
    uv = np.array(obs.uv)
    for _ in range(6):  # the row says when it is exposed, and that where it is seen
        tau = readout_s * (uv[:, 1] / camera.height - 0.5)
        C = rotation_from_vector(rate[i] * tau[:, None]) @ values.C_mc[i]
        q = np.einsum("nji,nj->ni", C, P - values.position[i] - velocity[i] * tau[:, None])
        uv = pixels_of(camera, q[:, :2] / q[:, 2:])
    block = replace(block, observations=replace(obs, uv=uv))
    problem = problem_of(block, true.problem.groups, values.blocks)
    return adjust_problem(problem, values), (velocity, rate), values


@pytest.mark.parametrize("readout_s", [0.012, -0.02])
def test_a_readout_time_is_estimated_with_its_sigma(readout_s):
    """Oracle: the planted readout; the sigma of the parabola through costs of adjustments of other
    readouts, which need no formula; the adjustment without it moves the centres as is said."""
    result, motion, true = rolled(readout_s)
    value, _, gain, moved = readout_gain(result, motion)
    assert value == pytest.approx(readout_s, rel=0.02)
    corrected = without_readout(result.problem, true, motion, readout_s)
    again = adjust_problem(problem_of(corrected, result.problem.groups, true.blocks), true)
    assert again.cost < 1e-3 * result.cost
    assert (result.cost - again.cost) / gain == pytest.approx(1.0, rel=0.05)
    centres = again.values.position - result.values.position
    assert np.abs(moved - centres).max() < 0.1 * np.abs(centres).max()


def test_a_rate_that_is_not_known_makes_the_readout_less_certain():
    """Oracle: the planted readout; the sigma of independent residuals is too small."""
    result, (velocity, rate), _ = rolled(0.012)
    value, sigma, gain, _ = readout_gain(result, (velocity, 0.0 * rate))
    assert abs(value - 0.012) < 2.0 * sigma
    assert abs(value - 0.012) > 3.0 * abs(value) / np.sqrt(gain)


@pytest.mark.slow
def test_rays_that_a_readout_made_gross_errors_take_part_again():
    """Oracle: the planted readout, over three draws of noise; without the rays that were rejected
    since the readout moved them most it is two sigma too small.
    """
    z = []
    for seed in range(3):
        result, motion, true = rolled(0.008)
        block = result.problem.block
        obs, draw = block.observations, np.random.default_rng(seed)
        obs = replace(obs, uv=obs.uv + obs.sigma_px * draw.normal(size=obs.uv.shape))
        block = replace(block, observations=obs)
        problem = problem_of(block, result.problem.groups, true.blocks)
        result = without_outliers(problem, true, 2.5).result
        estimates = (
            readout_gain(result, motion),
            readout_gain(result, motion, lambda p, v: without_outliers(p, v, 2.5).result),
        )
        z.append([(value - 0.008) / sigma for value, sigma, *_ in estimates])
    biased, mean = np.mean(z, axis=0)
    assert biased < -1.5
    assert abs(mean) < 1.0


def test_a_readout_that_the_camera_takes_up_is_less_certain():
    """Oracle: along one course at one speed rows that are exposed later are an affinity of the
    camera (b1, b2); without velocities nothing is said."""
    sigma = {}
    for free in (("f", "cx", "cy"), ("f", "cx", "cy", "b1", "b2")):
        result, motion, _ = rolled(0.01, replace(PLAN, headings_deg=(0.0,) * 4, free=free))
        motion = motion[0], 0.0 * motion[1]
        sigma[free] = readout_gain(result, motion)[1]
    few, many = sigma.values()
    assert many > 10.0 * few
    assert readout_gain(result, (0.0 * motion[0], motion[1])) is None
