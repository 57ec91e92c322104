"""Offsets and turns between the images of a strip, against what they must be equal to."""

from dataclasses import replace

import numpy as np
import pytest
from draws import lower_factor
from simulated_blocks import camera, simulated

from insgnss.base.errors import InputError
from insgnss.geodesy.rotation import rotation_from_vector
from insgnss.photogrammetry.adjust.adjustment import adjust_problem
from insgnss.photogrammetry.adjust.aerial import (
    BORESIGHT,
    CAMERA_LEVER_ARM,
    COMMON_OF_TRAJECTORY,
    EXPOSURE_DELAY,
    LINE_DRIFT,
    SHIFT,
    AerialControl,
    ParameterObservation,
)
from insgnss.photogrammetry.adjust.groups import control_points, weight_of
from insgnss.photogrammetry.adjust.normals import problem_of
from insgnss.photogrammetry.adjust.precision import precision_of
from insgnss.photogrammetry.adjust.relative import (
    Datum,
    GyroNoise,
    ObservedStrip,
    RelativeAerialControl,
    as_printed,
    operator,
    relative_covariance,
)
from insgnss.photogrammetry.adjust.start import first_values

N = 8
PAIRS = np.stack([np.arange(N - 1), np.arange(1, N)], axis=1)
TURN = np.radians([12.0, -7.0, 20.0])
"""A bore-sight that no first value is near."""


def strip_covariance(n: int = N, dt: float = 2.0) -> np.ndarray:
    """A constant with a wandering part: positions (5 cm) and attitudes (0.02 deg)."""
    gap = np.abs(np.subtract.outer(np.arange(n), np.arange(n))) * dt
    in_time = 0.7 * np.exp(-gap / 60.0) + 0.3 * np.eye(n)
    return np.kron(in_time, np.diag(np.repeat([0.05, np.radians(0.02)], 3) ** 2))


@pytest.fixture(scope="module")
def block():
    """Eight images of a strip."""
    return simulated(51, strips=1, images=N, points=80, cameras=(camera(free=()),))


def observed_poses(block, rng, boresight=TURN, cov=None):
    """Poses with errors and a bore-sight."""
    L = lower_factor(strip_covariance() if cov is None else cov)
    errors = (L @ rng.normal(size=6 * N)).reshape(N, 6)
    C = rotation_from_vector(-errors[:, 3:]) @ block.truth.C_mc
    return block.truth.position - errors[:, :3], C @ rotation_from_vector(boresight).T


def group(block, poses, observed, parameters=None, common=None, cov=None):
    rng = np.random.default_rng(3)
    X, C = poses
    L = operator(C, observed)
    P = relative_covariance(L, strip_covariance()) if cov is None else cov
    velocity, rate = rng.normal(0.0, 10.0, (N, 3)), rng.normal(0.0, 0.2, (N, 3))
    time = 2.0 * np.arange(N)
    return RelativeAerialControl(
        tuple(range(N)),
        X,
        C,
        weight_of(P, "strip"),
        time,
        velocity,
        rate,
        parameters or {},
        common=common,
        observed=observed,
    )


@pytest.mark.parametrize("positions", ["absolute", "relative"])
def test_derivatives(block, positions) -> None:
    """Oracle: central differences through `Unknowns.moved`, far from the observed poses."""
    rng = np.random.default_rng(52)
    observed = ObservedStrip(positions, True, PAIRS)
    m = sum(observed.sizes(N))
    A = rng.normal(0.0, 0.01, (m, 2))
    blocks = {
        (CAMERA_LEVER_ARM, 0): np.array([0.5, -0.2, 0.1]),
        (EXPOSURE_DELAY, 0): np.array([0.03]),
        (LINE_DRIFT, 0): np.array([0.01, 0.02, -0.03]),
        (COMMON_OF_TRAJECTORY, 0): np.array([0.4, -0.8]),
    }
    own = group(block, observed_poses(block, rng), observed, {k: 0 for k, _ in blocks}, A)
    values = replace(
        block.truth,
        position=block.truth.position + rng.normal(0.0, 1.0, (N, 3)),
        C_mc=rotation_from_vector(rng.normal(0.0, 0.1, (N, 3))) @ block.truth.C_mc,
        blocks=blocks,
    )
    problem = problem_of(block.block, [own], blocks)
    layout = problem.layout
    e, J = own.linearised(values)
    assert e.size == m
    assert J.shape == (m, 6 * N + 3 + 1 + 3 + 2)
    columns = np.concatenate([layout.of(key)[0] for key in own.keys])
    still, step = np.zeros_like(values.point), 1e-6
    for k, column in enumerate(columns):
        dx = np.zeros(layout.size)
        dx[column] = step
        ahead = own.linearised(values.moved(layout, dx, still))[0]
        back = own.linearised(values.moved(layout, -dx, still))[0]
        numeric = -(ahead - back) / (2.0 * step)
        # rounding of coordinates of 1000 m, over the step
        np.testing.assert_allclose(J[:, k], numeric, atol=3e-6, rtol=1e-6)


def test_turns_are_free_of_the_bore_sight_and_those_in_the_camera_are_not(block) -> None:
    """Paper 003, equation 4: whatever the bore-sight, to rounding."""
    C = block.truth.C_mc
    observed = ObservedStrip("relative", True, PAIRS)
    turned = C @ rotation_from_vector(TURN).T
    e, _ = group(block, (block.truth.position, turned), observed).linearised(block.truth)
    assert np.abs(e).max() < 1e-12
    in_camera = turned[:-1].swapaxes(1, 2) @ turned[1:] - C[:-1].swapaxes(1, 2) @ C[1:]
    assert np.abs(in_camera).max() > 1e-3


def test_all_pairs_are_the_poses_with_free_shift_and_bore_sight(block) -> None:
    """Oracle: absolute control of the same strip with the same covariance, a shift and a bore-sight
    of a kilometre and a radian (which say 1e-9 of what is observed).
    """
    rng = np.random.default_rng(53)
    small = np.radians([0.5, -0.3, 0.8])
    poses = observed_poses(block, rng, small)
    control = control_points(block.block.control)
    relative = group(block, poses, ObservedStrip("relative", True, PAIRS))
    time, zeros = 2.0 * np.arange(N), np.zeros((N, 3))
    absolute = AerialControl(
        tuple(range(N)),
        *poses,
        weight_of(strip_covariance(), "strip"),
        time,
        zeros,
        zeros,
        {BORESIGHT: 0, SHIFT: 0},
    )
    blocks = {(BORESIGHT, 0): np.eye(3), (SHIFT, 0): np.zeros(3)}
    free = [
        ParameterObservation((BORESIGHT, 0), np.eye(3), np.eye(3)),
        ParameterObservation((SHIFT, 0), np.zeros(3), 1e-6 * np.eye(3)),
    ]
    start = first_values(block.block)
    one = adjust_problem(problem_of(block.block, [*control, relative]), start)
    two = adjust_problem(
        problem_of(block.block, [*control, absolute, *free], blocks), replace(start, blocks=blocks)
    )
    sigma = precision_of(one, 1.0).pose_cov
    off = one.values.position - two.values.position
    root = np.sqrt(np.diagonal(sigma, axis1=1, axis2=2))
    # both have converged to a thousandth of a standard deviation
    assert np.abs(off / root[:, :3]).max() < 5e-3
    other = precision_of(two, 1.0).pose_cov
    scale = root[:, :, None] * root[:, None, :]
    np.testing.assert_allclose(sigma / scale, other / scale, atol=1e-4)


def test_independent_pairs_forget_what_neighbours_share() -> None:
    """White errors: successive differences have the correlation -1/2, so that the way over n pairs
    has 2 sigma^2, and 2 n sigma^2 by equation 5.
    """
    C = np.tile(np.eye(3), (N, 1, 1))
    P = np.kron(np.eye(N), np.diag(np.repeat([0.03, 1e-3], 3) ** 2))
    observed = ObservedStrip("relative", True, PAIRS)
    whole = relative_covariance(operator(C, observed), P)
    printed = as_printed(P, C, observed, np.arange(N) * 2.0, None)
    np.testing.assert_allclose(np.diagonal(whole), np.diagonal(printed))
    np.testing.assert_allclose(whole[0, 3] / whole[0, 0], -0.5)
    assert printed[0, 3] == 0.0
    k = 3 * (N - 1)
    way = np.kron(np.ones(N - 1), np.eye(3))
    np.testing.assert_allclose(way @ whole[:k, :k] @ way.T, 2.0 * 0.03**2 * np.eye(3), atol=1e-15)
    np.testing.assert_allclose(
        way @ printed[:k, :k] @ way.T, 2.0 * (N - 1) * 0.03**2 * np.eye(3), atol=1e-15
    )


def test_equation_6_as_printed() -> None:
    """Numbers by hand: 0.1 deg/sqrt(s), 0.02 deg/s and 1.5 over 4 s."""
    C = np.tile(np.eye(3), (2, 1, 1))
    observed = ObservedStrip("absolute", True, np.array([[0, 1]]))
    cov = as_printed(
        np.eye(12), C, observed, np.array([0.0, 4.0]), GyroNoise(*np.radians([0.1, 0.02]), 1.5)
    )
    tilt, heading = 0.04 + 0.0064, 0.04 + 0.0144
    np.testing.assert_allclose(
        np.degrees(np.degrees(np.diagonal(cov)[6:])), [tilt, tilt, heading], rtol=1e-12
    )
    np.testing.assert_allclose(cov[:6, :6], np.eye(6))


def test_a_weak_datum_says_nothing_where_anything_else_does(block) -> None:
    """With ground control it moves no image by more than what 5 m and 2 deg weigh beside 3 cm."""
    rng = np.random.default_rng(54)
    relative = group(block, observed_poses(block, rng), ObservedStrip("relative", True, PAIRS))
    sigma = (5.0, float(np.radians(2.0)))
    C = rotation_from_vector(np.radians([0.5, 0.5, 0.5])) @ block.truth.C_mc[3]
    datum = Datum(3, block.truth.position[3] + 1.0, C, sigma)
    groups = [*control_points(block.block.control), relative]
    first = first_values(block.block)
    without = adjust_problem(problem_of(block.block, groups), first)
    with_it = adjust_problem(problem_of(block.block, [*groups, datum]), first)
    off = np.abs(with_it.values.position - without.values.position).max()
    # a metre off at 5 m, beside positions of the block known to a few cm: (0.05 / 5)^2 of a metre
    assert off < 5e-4
    tests = precision_of(with_it, 1.0).groups
    assert tests[-1].redundancy.min() > 0.99


def test_a_weak_datum_of_attitude_alone_observes_three() -> None:
    datum = Datum(0, np.zeros(3), np.eye(3), (np.inf, 0.1))
    assert datum.weight.shape == (3, 3)
    np.testing.assert_allclose(np.diagonal(datum.weight), 100.0)


def test_shapes_are_refused(block) -> None:
    poses = block.truth.position, block.truth.C_mc
    with pytest.raises(InputError, match=r"weight: shape \(6, 6\), expected \(42, 42\)"):
        group(block, poses, ObservedStrip("relative", True, PAIRS), cov=np.eye(6))
