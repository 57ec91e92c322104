"""Covariance of all poses of a block together: written and read, and of other poses refused."""

import re
from pathlib import Path

import numpy as np
import pytest

from insgnss.base.errors import InputError
from insgnss.io.formats.orientation.pose_covariance import (
    read_pose_covariance,
    write_pose_covariance,
)

NAMES = ("3.tif", "5.tif", "7.tif")
PAGE = Path(__file__).parents[3] / "data_specs/pose_covariance.md"


def covariance() -> np.ndarray:
    A = np.random.default_rng(1).standard_normal((18, 30))
    return A @ A.T


def test_a_choice_of_images_comes_back_in_its_order(tmp_path) -> None:
    """Oracle: the matrix that was written."""
    path, cov = tmp_path / "poses_covariance.npz", covariance()
    write_pose_covariance(NAMES, cov, path)
    rows = np.r_[12:18, 0:6]
    np.testing.assert_array_equal(
        read_pose_covariance(path, ("7.tif", "3.tif")), cov[np.ix_(rows, rows)]
    )


def test_the_file_of_other_poses_is_refused(tmp_path) -> None:
    path, cov = tmp_path / "poses_covariance.npz", covariance()
    write_pose_covariance(NAMES, cov, path)
    own = np.array([cov[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] for k in range(3)])
    read_pose_covariance(path, NAMES, own)
    own[2, 0, 0] *= 1.3
    (said,) = re.findall(r"```message\n(.*?)\n```", PAGE.read_text(), re.DOTALL)
    with pytest.raises(InputError, match=re.escape(said)):
        read_pose_covariance(path, NAMES, own)
    with pytest.raises(InputError, match=r"image 9\.tif differs or is missing"):
        read_pose_covariance(path, ("9.tif",))


def test_a_damaged_file_is_refused(tmp_path) -> None:
    path = tmp_path / "poses_covariance.npz"
    path.write_bytes(b"PK")
    with pytest.raises(InputError, match="is damaged"):
        read_pose_covariance(path, NAMES)
    np.savez(path, images=np.array(NAMES), cov=np.eye(6))
    with pytest.raises(InputError, match=r"cov of shape \(6, 6\), \(18, 18\) finite"):
        read_pose_covariance(path, NAMES)
