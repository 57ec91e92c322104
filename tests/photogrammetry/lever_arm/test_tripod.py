"""Lever arm from a tripod."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from insgnss.base.errors import DataError
from insgnss.photogrammetry.lever_arm.records import PosedAntennas
from insgnss.photogrammetry.lever_arm.tripod import tripod_lever_arm

TABLE_1 = {  # paper 000: antenna and both IMUs, from the projection centre in camera axes, m
    "antenna": (0.462, -0.001, -0.065),
    "NC0": (0.133, 0.020, 0.000),
    "NC1": (0.113, 0.020, 0.000),
}
POSE_M, POSE_RAD, PIN_M = 1e-3, np.radians(0.05), np.array([0.6e-3, 0.6e-3, 1e-3])


def setups(arm, rng=None, n=8, scale=1.0):
    """A fuselage rolled by 90 deg, seen from turned and tilted stations, with noise of millimetres;
    rotations are scipy's.
    """
    turns = Rotation.from_euler(
        "zyx", [[45.0 * j, 4.0 * (-1) ** j, 90.0 + 3.0 * (j % 3)] for j in range(n)], degrees=True
    )
    c = np.array([[2.0 + 0.3 * j, 1.0 - 0.2 * j, 1.2] for j in range(n)])
    p = c + turns.apply(arm)
    if rng is not None:
        c = c + scale * rng.normal(0.0, POSE_M, (n, 3))
        p = p + scale * rng.normal(0.0, PIN_M, (n, 3))
        # truth = exp([psi x]) estimate
        turns = Rotation.from_rotvec(scale * rng.normal(0.0, POSE_RAD, (n, 3))).inv() * turns
    pose = np.diag([POSE_M**2] * 3 + [POSE_RAD**2] * 3)
    return PosedAntennas(
        c,
        turns.as_matrix(),
        np.broadcast_to(pose, (n, 6, 6)),
        p,
        np.broadcast_to(np.diag(PIN_M**2), (n, 3, 3)),
    )


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("origin", TABLE_1)
def test_table_1_is_recovered(origin, seed):
    """Oracle: Table 1 of paper 000; within four of its own standard errors, below a millimetre."""
    got = tripod_lever_arm(setups(TABLE_1[origin], np.random.default_rng(seed)))
    assert (np.abs(got.lever_arm_m - TABLE_1[origin]) < 4.0 * got.sigma_m).all()
    assert (got.sigma_m < 0.8e-3).all()
    assert not got.outlier.any()
    assert got.consistent


@pytest.mark.slow
def test_errors_are_as_large_as_the_covariance_says():
    """Oracle: Monte Carlo; NEES and variance factor within 99 % of chi-square, an antenna at half a
    metre with 0.05 deg and pose covariances of very different size, so that weights matter.
    """
    rng, n, arm = np.random.default_rng(3), 300, np.array(TABLE_1["antenna"])
    nees, factor = np.empty(n), np.empty(n)
    for k in range(n):
        clean, noisy = setups(arm), setups(arm, rng)
        grow = np.where(np.arange(8) % 4 == 0, 6.0, 1.0)
        pin = clean.antenna_m + (noisy.antenna_m - clean.antenna_m) * grow[:, None]
        data = replace(
            noisy, antenna_m=pin, antenna_cov=noisy.antenna_cov * grow[:, None, None] ** 2
        )
        got = tripod_lever_arm(data)
        error = got.lever_arm_m - arm
        cov = got.cov / (1.0 if got.consistent else got.variance_factor)
        nees[k], factor[k] = error @ np.linalg.solve(cov, error), got.variance_factor
    low, high = chi2.ppf([0.005, 0.995], 3 * n) / n
    assert low < nees.mean() < high * 1.03, nees.mean()  # 1 % of sets lose a good setup
    low, high = chi2.ppf([0.005, 0.995], 21 * n) / (21 * n)
    assert low * 0.98 < factor.mean() < high, factor.mean()


def test_error_of_the_attitude_acts_by_the_lever_arm():
    """Oracle: a difference quotient; the pose is turned by psi = 1 mrad about each axis."""
    data = setups(TABLE_1["antenna"], n=1)
    only = np.zeros((1, 6, 6))
    for axis in range(3):
        psi = np.zeros(3)
        psi[axis] = 1e-3
        turned = Rotation.from_rotvec(psi).as_matrix() @ data.C_rc
        moved = tripod_lever_arm(replace(data, C_rc=turned)).lever_arm_m - TABLE_1["antenna"]
        only[0, 3 + axis, 3 + axis] = 1e-6
        got = tripod_lever_arm(replace(data, pose_cov=only, antenna_cov=1e-14 * np.eye(3)[None]))
        only[:] = 0.0
        assert np.abs(got.sigma_m - np.abs(moved)).max() < 1e-6


def test_a_setup_with_a_knocked_pin_is_left_out():
    """Oracle: 20 mm planted in one setup of six; the mean is that of the other five."""
    data = setups(TABLE_1["antenna"], np.random.default_rng(5), n=6)
    pin = data.antenna_m.copy()
    pin[2] += [0.0, 0.02, 0.0]
    got = tripod_lever_arm(replace(data, antenna_m=pin))
    assert got.outlier.tolist() == [False, False, True, False, False, False]
    assert "setup 3 (" in got.summary()
    assert got.consistent
    assert (np.abs(got.lever_arm_m - TABLE_1["antenna"]) < 4.0 * got.sigma_m).all()


@pytest.mark.parametrize("seed", range(4))
def test_covariances_too_small_grow_the_standard_errors_and_reject_nothing(seed):
    """Oracle: noise of four times what the covariances say; the variance factor is some 16."""
    got = tripod_lever_arm(setups(TABLE_1["antenna"], np.random.default_rng(seed), scale=4.0))
    assert not got.outlier.any()
    assert not got.consistent
    assert 6.0 < got.variance_factor < 32.0
    assert (np.abs(got.lever_arm_m - TABLE_1["antenna"]) < 4.0 * got.sigma_m).all()
    assert "more than their covariances say" in got.summary()


def test_an_offset_between_both_frames_shows_where_setups_are_turned():
    """Oracle: 10 mm between tachymetry and photogrammetry, planted."""
    data = setups(TABLE_1["antenna"], np.random.default_rng(1))
    assert not tripod_lever_arm(
        replace(data, antenna_m=data.antenna_m + [0.01, 0.0, 0.0])
    ).consistent
    same = replace(
        data,
        C_rc=np.broadcast_to(data.C_rc[0], (8, 3, 3)),
        antenna_m=data.position + data.C_rc[0] @ np.array(TABLE_1["antenna"]),
    )
    assert "would not show" in tripod_lever_arm(same).summary()
    assert "would not show" not in tripod_lever_arm(data).summary()


def test_one_setup_is_not_called_checked():
    """Oracle: there is nothing to compare it with."""
    got = tripod_lever_arm(setups(TABLE_1["NC0"], n=1))
    assert np.isnan(got.variance_factor)
    assert not got.consistent
    assert "nothing checks it" in got.summary()


def test_wrong_input_is_refused():
    """Oracle: a mirrored frame, covariances of zero, a value that is missing."""
    data = setups(TABLE_1["NC0"])
    with pytest.raises(DataError, match="no rotation"):
        replace(data, C_rc=data.C_rc * [1.0, 1.0, -1.0])
    with pytest.raises(DataError, match="not positive definite"):
        tripod_lever_arm(
            replace(data, pose_cov=0.0 * data.pose_cov, antenna_cov=0.0 * data.antenna_cov)
        )
    with pytest.raises(DataError, match="finite"):
        replace(data, antenna_m=data.antenna_m * np.nan)
