"""Lever arm on the ground, by targets on camera and receiver."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from insgnss.base.errors import DataError
from insgnss.photogrammetry.lever_arm.difference import lever_arm_difference
from insgnss.photogrammetry.lever_arm.materialisation import (
    ReceiverSession,
    Targets,
    camera_targets,
    intersected_target,
    materialised_lever_arm,
    receiver_targets,
)

BEFORE, AFTER, IN_FLIGHT = (  # Table 1 of paper 002, m
    np.array([0.086, -0.052, -0.082]),
    np.array([0.085, -0.051, -0.081]),
    np.array([0.098, -0.070, -0.091]),
)
ON_CAMERA = 1e-3 * np.array([[25.0, 20, -30], [-28, 22, -28], [26, -24, -15], [-20, -25, 5]])
ON_RECEIVER = 1e-3 * np.array([[30.0, 30, 0], [-32, 28, 4], [30, -33, 2], [-29, -30, 12]])
ANTENNA = np.array([0.002, -0.001, 0.021])  # in the receiver's frame
TARGET_M, ANTENNA_M = 0.2e-3, 1e-3
# phase centres by attitude, horizontal, mm: 7 apart in the mean, 11 at most, as in paper 002
MOVED = 1e-3 * np.array([[0.0, 0.0, 0.0], [4.0, 3.6, 0.0], [10.0, 4.58, 0.0], [4.0, 0.0, 0.0]])
R_BLOCK, R_MOUNTED = Rotation.from_rotvec([1.0, 0.3, -0.6]), Rotation.from_rotvec([0.1, -2.9, 0.2])
UNIT = 0.4  # metres for each unit of the block


def noisy(position, rng, cov):
    cov = np.broadcast_to(cov, (len(position), 3, 3))
    if rng is None:
        return Targets(position, cov)
    sigma = np.sqrt(np.diagonal(cov, axis1=1, axis2=2))
    return Targets(position + rng.normal(size=position.shape) * sigma, cov)


def session(k, rng=None, moved=(0.0, 0.0, 0.0), target_m=TARGET_M):
    """The receiver turned by 90 deg k times, somewhere in the survey's frame."""
    turn, at_m = Rotation.from_euler("z", 90.0 * k, degrees=True), np.array([3.0 + k, -2.0, 1.0])
    antenna = at_m + turn.apply(ANTENNA + moved)
    if rng is not None:
        antenna = antenna + rng.normal(0.0, ANTENNA_M, 3)
    targets = noisy(at_m + turn.apply(ON_RECEIVER), rng, target_m**2 * np.eye(3))
    return ReceiverSession(targets, antenna, ANTENNA_M**2 * np.eye(3))


def mounted(arm, rng=None, moved=None, pose=(0.0, 0.0)):
    """All that the calibration takes, made from a lever arm by (H.2) to (H.4)."""
    # one block of the bare camera: its pose and its targets
    c, C = np.array([0.3, 0.1, 0.9]), Rotation.from_rotvec([2.0, 0.4, 0.3])
    bare = noisy(c + C.apply(ON_CAMERA), rng, TARGET_M**2 * np.eye(3))
    pose_cov = np.diag(np.square(np.repeat(np.maximum(pose, 1e-9), 3)))
    if rng is not None:
        c = c + rng.normal(0.0, pose[0], 3)
        C = Rotation.from_rotvec(rng.normal(0.0, pose[1], 3)) * C
    camera = camera_targets(bare, c, C.as_matrix(), pose_cov)
    offsets = np.zeros((4, 3)) if moved is None else moved
    receiver = receiver_targets(*(session(k, rng, offsets[k]) for k in range(4)))
    # the aircraft: camera axes to the block
    first = session(0).targets.position - session(0).antenna_m
    on_receiver = arm + R_MOUNTED.apply(first)
    block_cov = (TARGET_M / UNIT) ** 2 * np.eye(3)
    P = noisy(R_BLOCK.apply(ON_CAMERA) / UNIT + 7.0, rng, block_cov)
    G = noisy(R_BLOCK.apply(on_receiver) / UNIT + 7.0, rng, block_cov)
    return camera, receiver, P, G


@pytest.mark.parametrize("arm", [BEFORE, AFTER])
def test_exact_data_close(arm):
    """Oracle: the lever arm that made the data; by one step and by the paper's two."""
    got = materialised_lever_arm(*mounted(arm))
    assert np.abs(got.lever_arm_m - arm).max() < 1e-9
    assert np.abs(got.two_step_m - arm).max() < 1e-9
    assert abs(got.scale - UNIT) < 1e-9
    assert (got.sigma_m < 2e-3).all()


@pytest.mark.slow
def test_errors_are_as_large_as_the_covariance_says():
    """Oracle: Monte Carlo through sessions, camera block and aircraft; NEES within 99 % of
    chi-square, with a camera pose of 0.3 mm and 10 mrad.
    """
    rng, n = np.random.default_rng(5), 200
    nees, factor, errors = np.empty(n), np.empty(n), np.empty((n, 2, 3))
    for k in range(n):
        got = materialised_lever_arm(*mounted(BEFORE, rng, pose=(0.3e-3, 0.01)))
        error = got.lever_arm_m - BEFORE
        nees[k], factor[k] = error @ np.linalg.solve(got.cov, error), got.variance_factor
        errors[k] = error, got.two_step_m - BEFORE
    low, high = chi2.ppf([0.005, 0.995], 3 * n) / n
    assert low < nees.mean() < high, nees.mean()
    dof = 11 * n
    low, high = chi2.ppf([0.005, 0.995], dof) / dof
    assert low < factor.mean() < high, factor.mean()
    assert (errors[:, 0] ** 2).mean() <= 1.02 * (errors[:, 1] ** 2).mean()


@pytest.mark.parametrize("seed", range(5))
def test_spread_of_the_receiver_rotations(seed):
    """Oracle: phase centres planted as far apart as in paper 002 (0.7 cm mean, 1.1 at most) come
    back to three standard deviations of a difference of two, and the standard error of their mean
    grows.
    """
    rng = np.random.default_rng(seed)
    got = receiver_targets(*(session(k, rng, MOVED[k]) for k in range(4)))
    assert abs(got.apart_m.mean() - 0.0070) < 2.0 * ANTENNA_M
    assert abs(got.apart_m.max() - 0.0110) < 3.0 * np.sqrt(2.0) * ANTENNA_M
    assert got.variance_factor > got.factor_limit
    assert "moves with the attitude" in got.summary()
    assert np.sqrt(np.diag(got.antenna_cov))[0] > 2.0 * ANTENNA_M / np.sqrt(4.0)
    calm = receiver_targets(*(session(k, rng) for k in range(4)))
    assert "moves with the attitude" not in calm.summary()
    assert "nothing checks it" in receiver_targets(session(0)).summary()


def test_differences_of_table_1():
    """Oracle: Table 1 of paper 002 by hand; before minus after 1.7 mm, and 23.4 and 25.1 mm to the
    calibration in flight (the paper's text: within 2 mm, and 26 mm).
    """
    cov = (2e-3) ** 2 * np.eye(3)
    landing = lever_arm_difference(BEFORE, cov, AFTER, cov)
    assert abs(1e3 * landing.length_m - np.sqrt(3.0)) < 1e-9
    assert landing.agrees
    for other, length in ((BEFORE, np.sqrt(549.0)), (AFTER, np.sqrt(630.0))):
        flight = lever_arm_difference(other, cov, IN_FLIGHT, cov)
        assert abs(1e3 * flight.length_m - length) < 1e-9
        assert not flight.agrees
        assert "contradict each other" in flight.summary()
    assert flight.difference_m.round(6).tolist() == [0.013, -0.019, -0.010]


def test_intersection():
    """Oracle: (H.1) by hand for exact coordinates; Monte Carlo for covariance and variance factor
    of eight images around a target.
    """
    rng, n = np.random.default_rng(1), 300
    P = np.array([0.1, -0.2, 0.05])
    angle = np.arange(8) * np.pi / 4.0
    c = np.column_stack([np.cos(angle), np.sin(angle), np.full(8, 0.8)])
    z = -c / np.linalg.norm(c, axis=1)[:, None]
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x, axis=1)[:, None]
    C = np.stack([x, np.cross(z, x), z], axis=2)
    u = np.einsum("nji,nj->ni", C, P - c)
    exact = u[:, :2] / u[:, 2:]
    assert np.abs(intersected_target(c, C, exact, 1e-4)[0] - P).max() < 1e-12
    nees, factor = np.empty(n), np.empty(n)
    for k in range(n):
        image = exact + rng.normal(0.0, 1e-4, (8, 2))
        got, cov, factor[k] = intersected_target(c, C, image, 1e-4)
        nees[k] = (got - P) @ np.linalg.solve(cov, got - P)
    low, high = chi2.ppf([0.005, 0.995], 3 * n) / n
    assert low < nees.mean() < high
    low, high = chi2.ppf([0.005, 0.995], 13 * n) / (13 * n)
    assert low < factor.mean() < high
    with pytest.raises(DataError, match="needs two"):
        intersected_target(c[:1], C[:1], exact[:1], 1e-4)
    with pytest.raises(DataError, match="parallel"):
        intersected_target(c[[0, 0]], C[[0, 0]], exact[[0, 0]], 1e-4)
    with pytest.raises(DataError, match="behind a camera"):
        intersected_target(c, C @ np.diag([1.0, -1.0, -1.0]), -exact, 1e-4)


def test_wrong_input_is_refused_with_the_reason():
    """Oracle: one defect planted in each."""
    camera, receiver, P, G = mounted(BEFORE)
    swapped = replace(P, position=P.position[[1, 0, 2, 3]])
    with pytest.raises(DataError, match="miss each other"):
        materialised_lever_arm(camera, receiver, swapped, G)
    mirrored = [replace(block, position=block.position * [1.0, 1.0, -1.0]) for block in (P, G)]
    with pytest.raises(DataError, match="as in a mirror"):
        materialised_lever_arm(camera, receiver, *mirrored)
    with pytest.raises(DataError, match="in the block"):
        materialised_lever_arm(camera, receiver, P, Targets(G.position[:3], G.cov[:3]))
    line = replace(P, position=np.outer(np.arange(4.0), [1.0, 2.0, 0.5]))
    with pytest.raises(DataError, match="on a line"):
        materialised_lever_arm(camera, receiver, line, G)
    turned = session(1)
    other = replace(turned.targets, position=turned.targets.position[[1, 0, 2, 3]])
    with pytest.raises(DataError, match="session 2 miss"):
        receiver_targets(session(0), replace(turned, targets=other))
    with pytest.raises(DataError, match="stand on no line"):
        Targets(P.position[:2], P.cov[:2])
    with pytest.raises(DataError, match="not positive definite"):
        Targets(P.position, 0.0 * P.cov)
