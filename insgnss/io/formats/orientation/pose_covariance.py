"""Covariance of all poses of an adjusted block together, `poses_covariance.npz`,
data_specs/pose_covariance.md.
"""

from collections.abc import Sequence

import numpy as np

from ....base.errors import InputError
from ....base.output.staging import staged_path
from ....records.block import Array
from ....records.rows import covariance_of_rows
from ..text.text import Source
from .eo_covariance import opened_archive

POSES_COVARIANCE_FILE = "poses_covariance.npz"
MATCHES = 0.02  # relative difference of two standard deviations: the table prints few digits


def write_pose_covariance(images: Sequence[str], cov: Array, path: Source) -> None:
    """Write the covariance.

    Parameters
    ----------
    images : sequence of str
        (n,) names.
    cov : ndarray, (6 n, 6 n)
        Position (m) and psi (rad), image after image, axes of the block.
    path : path
        The file.
    """
    with staged_path(path) as work, work.open("wb") as stream:
        np.savez(stream, images=np.array(images), cov=cov)


def read_pose_covariance(path: Source, images: Sequence[str], each: Array | None = None) -> Array:
    """Read the covariance of some images.

    Parameters
    ----------
    path : path
        The file.
    images : sequence of str
        Names of the n images that are wanted.
    each : ndarray, (n, 6, 6), optional
        Covariances that another file has of each image by itself.

    Returns
    -------
    ndarray, (6 n, 6 n)
        Their covariance, in this order.

    Raises
    ------
    InputError
        The file is damaged, has no such image, or is of other poses.
    """
    with opened_archive(path, "is damaged ({}); adjust the block again") as file:
        names = [str(name) for name in file["images"]]
        cov = file["cov"].astype(np.float64, casting="safe")
    if cov.shape != (6 * len(names),) * 2 or not np.isfinite(cov).all():
        problem = f"cov of shape {cov.shape}, {(6 * len(names),) * 2} finite values are expected"
        raise InputError.in_file(path, problem)
    row_by_name = {name: k for k, name in enumerate(names)}
    missing = next((name for name in images if name not in row_by_name), None)
    rows = np.array([row_by_name.get(name, 0) for name in images], dtype=np.int64)
    cov = covariance_of_rows(cov, rows)
    if missing is None and each is not None:
        sigma = np.sqrt(np.diagonal(cov).reshape(-1, 6)[:, :3])
        sigma_of_each = np.sqrt(np.diagonal(each, axis1=1, axis2=2)[:, :3])
        difference = np.abs(sigma / sigma_of_each - 1.0).max(axis=1)
        if (difference > MATCHES).any():
            missing = images[int(np.argmax(difference))]
    if missing is not None:
        raise InputError.in_file(
            path,
            f"does not belong to these poses: image {missing} differs or is missing; take both"
            " files of one run, or remove this one",
        )
    return cov
