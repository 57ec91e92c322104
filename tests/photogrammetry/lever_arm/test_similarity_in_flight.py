"""Lever arm in flight, by a similarity."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from insgnss.base.errors import DataError
from insgnss.photogrammetry.lever_arm.records import PosedAntennas
from insgnss.photogrammetry.lever_arm.similarity import PairedPoints, similarity_lever_arm

ARM = np.array([0.098, -0.070, -0.091])  # in-flight calibration of Table 1, paper 002
POSE_M, ANTENNA_M, GROUND_M = 3e-3, np.array([0.01, 0.01, 0.02]), 5e-3
ALONG_M, ACROSS_M, ABOVE_M = 15.0, 25.0, 100.0
NADIR = np.diag([1.0, -1.0, -1.0])


def covs(n, *sigma):
    one = np.diag(np.square(np.hstack(sigma)))
    return np.broadcast_to(one, (n, *one.shape))


def flight(opposite, tilt_deg, points=0, rng=None, attitude=1e-6, n=60):
    """Six strips of ten images, 100 m above ground; tilts of a given rms about both axes, with
    patterns that are neither correlated with each other nor with the position. The frame of the
    adjustment is turned, shifted and in a unit of its own. Rotations are scipy's.
    """
    i = np.arange(n)
    line, along = i // 10, i % 10
    X = np.stack([(along - 4.5) * ALONG_M, (line - 2.5) * ACROSS_M, 0.0 * i], axis=1)
    heading = np.where((line % 2 == 1) & opposite, 180.0, 0.0)
    tilt = np.sqrt(2.0) * tilt_deg
    roll = tilt * np.sin(2.0 * np.pi * i * 7 / n + 0.3)
    pitch = tilt * np.cos(2.0 * np.pi * i * 11 / n + 0.7)
    C = Rotation.from_euler("ZXY", np.stack([heading, roll, pitch], axis=1), degrees=True)
    C = C * Rotation.from_matrix(NADIR)
    G = X + C.apply(ARM)
    corner = np.array([[1.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]])[:points]
    Q = np.column_stack([corner * [4.5 * ALONG_M, 2.5 * ACROSS_M], np.full(points, -ABOVE_M)])
    R, scale, T = Rotation.from_rotvec([0.4, -0.2, 2.0]), 3.7, np.array([5.0, -2.0, 9.0])
    r = R.inv().apply(X - T) / scale
    P = R.inv().apply(Q - T) / scale if points else Q
    C_r = R.inv() * C
    if rng is not None:
        r = r + rng.normal(0.0, POSE_M / scale, r.shape)
        P = P + rng.normal(0.0, POSE_M / scale, P.shape)
        G = G + rng.normal(0.0, ANTENNA_M, G.shape)
        Q = Q + rng.normal(0.0, GROUND_M, Q.shape)
        C_r = Rotation.from_rotvec(rng.normal(0.0, attitude, (n, 3))) * C_r
    poses = PosedAntennas(
        r, C_r.as_matrix(), covs(n, [POSE_M / scale] * 3, [attitude] * 3), G, covs(n, ANTENNA_M)
    )
    ground = PairedPoints(P, covs(points, [POSE_M / scale] * 3), Q, covs(points, [GROUND_M] * 3))
    return poses, ground


@pytest.mark.parametrize(
    ("opposite", "tilt_deg", "points", "sigma_m"),
    [
        (False, 0.1, 0, (1.6, 1.6, 0.6)),
        (False, 0.1, 1, (9e-3, 9e-3, 9e-3)),
        (True, 4.0, 0, (1.4e-3, 1.4e-3, 14e-3)),
        (True, 4.0, 1, (1.4e-3, 1.4e-3, 7e-3)),
    ],
)
def test_formal_precision(opposite, tilt_deg, points, sigma_m):
    """Oracle: standard errors of the design of this calibration, computed apart from this code;
    within 10 %.
    """
    got = similarity_lever_arm(*flight(opposite, tilt_deg, points))
    assert np.abs(got.sigma_m / sigma_m - 1.0).max() < 0.1, got.sigma_m
    assert np.abs(got.lever_arm_m - ARM)[got.determined].max(initial=0.0) < 1e-6


@pytest.mark.parametrize("seed", range(6))
def test_verdicts(seed):
    """Oracle: geometry. One attitude tells nothing without ground, tilts of 4 deg leave the
    vertical at a correlation of 0.98, a ground point gives all.
    """
    rng = np.random.default_rng(seed)
    level = similarity_lever_arm(*flight(False, 0.1, 0, rng))
    assert not level.determined.any()
    assert level.summary().count("not determined") == 3
    assert "all images have one heading" in level.verdict(0)
    assert "tilted by 0.1 deg rms" in level.verdict(2)
    tilted = similarity_lever_arm(*flight(True, 4.0, 0, rng))
    assert tilted.determined.tolist() == [True, True, False]
    assert 0.97 < tilted.vertical_correlation[2] < 0.99
    assert abs(tilted.lever_arm_m[2] - ARM[2]) < 4.0 * tilted.sigma_m[2]
    held = similarity_lever_arm(*flight(True, 4.0, 1, rng))
    assert held.determined.all()
    assert (np.abs(held.lever_arm_m - ARM) < 4.0 * held.sigma_m).all()
    assert "not determined" not in held.summary()


@pytest.mark.parametrize("tilt_deg", [0.0, 1e-4])
def test_exactly_one_attitude(tilt_deg):
    """Oracle: (E.1) with one attitude; any lever arm fits, and none is given."""
    got = similarity_lever_arm(*flight(False, tilt_deg))
    assert not got.determined.any()
    assert (got.sigma_m > 10.0).all()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("tilt_deg", "points", "attitude"), [(4.0, 0, 0.02), (4.0, 2, 0.02), (0.1, 1, 1e-3)]
)
def test_errors_are_as_large_as_the_covariance_says(tilt_deg, points, attitude):
    """Oracle: Monte Carlo; NEES of lever arm and variance factor within 99 % of chi-square, with
    errors of the attitude of 1 deg so that they weigh, and smaller ones in level flight.
    """
    rng, n = np.random.default_rng(4), 150
    nees, factor = np.empty(n), np.empty(n)
    for k in range(n):
        got = similarity_lever_arm(*flight(True, tilt_deg, points, rng, attitude))
        error = got.lever_arm_m - ARM
        grown = got.variance_factor if got.variance_factor > got.factor_limit else 1.0
        nees[k] = error @ np.linalg.solve(got.cov[7:, 7:] / grown, error)
        factor[k] = got.variance_factor
    low, high = chi2.ppf([0.005, 0.995], 3 * n) / n
    assert low < nees.mean() < high, nees.mean()
    dof = (180 + 3 * points - 10) * n
    low, high = chi2.ppf([0.005, 0.995], dof) / dof
    assert low < factor.mean() < high, factor.mean()


def test_frame_of_the_adjustment_is_recovered():
    """Oracle: the similarity that made the frame of the adjustment."""
    got = similarity_lever_arm(*flight(True, 4.0, 3))
    R = Rotation.from_rotvec([0.4, -0.2, 2.0]).as_matrix()
    assert np.abs(got.frame.rotation - R).max() < 1e-9
    assert abs(got.frame.scale - 3.7) < 1e-8
    assert np.abs(got.frame.translation - [5.0, -2.0, 9.0]).max() < 1e-6


def test_covariances_too_small_grow_the_standard_errors():
    """Oracle: noise of three times what covariances say."""
    poses, ground = flight(True, 4.0, 1, np.random.default_rng(0))
    small = replace(poses, antenna_cov=poses.antenna_cov / 9.0)
    got = similarity_lever_arm(small, ground)
    honest = similarity_lever_arm(poses, ground)
    assert got.variance_factor > 4.0
    assert (got.sigma_m[:2] / honest.sigma_m[:2] > 0.8).all()
    assert "grown accordingly" in got.summary()


def shifted(poses, rows):
    return replace(poses, antenna_m=np.roll(poses.antenna_m, rows, axis=0))


def test_wrong_input_is_refused_with_the_reason():
    """Oracle: one defect planted in each."""
    rng = np.random.default_rng(6)
    poses, _ = flight(True, 4.0, 0, rng)
    with pytest.raises(DataError, match="four images"):
        similarity_lever_arm(PosedAntennas(*(getattr(poses, name)[:3] for name in vars(poses))))
    with pytest.raises(DataError, match="stand on a line"):
        similarity_lever_arm(PosedAntennas(*(getattr(poses, name)[:10] for name in vars(poses))))
    with pytest.raises(DataError, match="miss the poses"):
        similarity_lever_arm(shifted(poses, 1))
    with pytest.raises(DataError, match="miss the poses"):  # another flight
        similarity_lever_arm(replace(poses, antenna_m=poses.antenna_m[::-1] * [1.0, 0.3, 1.0]))
    with pytest.raises(DataError, match="above the horizon"):  # a mirrored frame: left-handed
        similarity_lever_arm(replace(poses, antenna_m=poses.antenna_m * [1.0, -1.0, 1.0]))
    with pytest.raises(DataError, match="no rotation"):
        replace(poses, C_rc=poses.C_rc * [1.0, 1.0, -1.0])
    with pytest.raises(DataError, match="not positive definite"):
        similarity_lever_arm(
            replace(poses, antenna_cov=0.0 * poses.antenna_cov, pose_cov=0.0 * poses.pose_cov)
        )
    with pytest.raises(DataError, match="finite"):
        replace(poses, antenna_m=poses.antenna_m * np.nan)


def test_a_delay_that_looks_like_a_lever_arm_is_refused():
    """Oracle: each antenna position is 15 m ahead of its image, on opposite strips."""
    poses, _ = flight(True, 1.0, 0, np.random.default_rng(7))
    head = np.where(np.arange(60) // 10 % 2 == 1, -1.0, 1.0)
    moved = poses.antenna_m + np.outer(head, [ALONG_M, 0.0, 0.0])
    with pytest.raises(DataError, match=r"comes out as \+15\.\d m along camera x"):
        similarity_lever_arm(replace(poses, antenna_m=moved))
