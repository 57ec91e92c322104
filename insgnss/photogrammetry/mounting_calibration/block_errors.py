"""Errors of the poses of a block: their covariance by parts, what they share, how a block bends.

(L.2), (L.5) and (L.6) stand in `equations`.
"""

import numpy as np

from ...records.block import Array
from .records import CameraPoses

BENDS = 24  # coefficients of (L.5)
BEND_POSITION_M, BEND_ATTITUDE = 1.0, 0.02  # a-priori sigmas at the rim of the block
LEAST_POSITION, LEAST_ATTITUDE = 1e-4, 1e-7  # of Q, m and rad: nobody's adjustment is better
FIRST_POSITION, FIRST_ATTITUDE = 0.02, 1e-4  # of poses without covariance, m and rad
ALONG_VIEW = 10.0  # times as much: camera constant and height of a level block are one


def pose_covariances(block: CameraPoses, scale: float) -> dict[str, Array]:
    """Return the parts of Q in the unit of the block.

    What is stated is one part, with a floor, (n, 6, 6) of each image alone or (6 n, 6 n) of all; of
    poses without covariance positions and attitudes are one part each, of a first size.

    Parameters
    ----------
    block : CameraPoses
        The block.
    scale : float
        Metres for each unit of the block.

    Returns
    -------
    dict of str to ndarray
        The parts by name.
    """
    n = len(block.images)
    if block.cov is None:
        of_position = [(FIRST_POSITION / scale) ** 2] * 3 + [0.0] * 3
        parts = {"positions": of_position, "attitudes": [0.0] * 3 + [FIRST_ATTITUDE**2] * 3}
        return {name: np.tile(np.diag(share), (n, 1, 1)) for name, share in parts.items()}
    floor = np.array([(LEAST_POSITION / scale) ** 2] * 3 + [LEAST_ATTITUDE**2] * 3)
    whole = block.cov.ndim == 2
    return {"poses": block.cov + np.diag(np.tile(floor, n) if whole else floor)}


def shared_covariance(block: CameraPoses, scale: float, alike: tuple[float, float]) -> Array:
    """Return the covariance of errors that all images have alike in camera axes (L.6).

    Parameters
    ----------
    block : CameraPoses
        The block.
    scale : float
        Metres for each unit of the block.
    alike : tuple of float
        Standard deviations, m and rad, where nothing is stated; in viewing direction `ALONG_VIEW`
        times as much.

    Returns
    -------
    ndarray, (6, 6)
        m and rad; zeros where there are none.
    """
    if block.shared is not None:
        return block.shared
    if block.cov is None or block.cov.ndim == 2:
        sigma = alike[0] * np.array([1.0, 1.0, ALONG_VIEW])
        return np.diag(np.square([*sigma, *(alike[1],) * 3]))
    turn = np.zeros((len(block.images), 6, 6))
    turn[:, :3, :3] = scale * block.C_rc.swapaxes(1, 2)
    turn[:, 3:, 3:] = block.C_rc.swapaxes(1, 2)
    mean = (turn @ block.cov @ turn.swapaxes(1, 2)).mean(axis=0)
    return mean + np.diag([LEAST_POSITION**2] * 3 + [LEAST_ATTITUDE**2] * 3)


def bending(arm: Array) -> Array:
    """Return the derivatives of positions and attitudes by the coefficients of (L.5).

    Parameters
    ----------
    arm : ndarray, (n, 3)
        From the middle of the block, axes of the tangent plane, m.

    Returns
    -------
    ndarray, (n, 6, `BENDS`)
        m and rad.
    """
    x, y = arm[:, :2].T / max(float(np.abs(arm[:, :2]).max()), 1e-9)
    second = np.stack([x * x, x * y, y * y], axis=1)
    design = np.concatenate([np.stack([x, y], axis=1), second], axis=1)
    H = np.zeros((len(arm), 6, BENDS))
    H[:, :3, :9] = np.einsum("nk,ij->nikj", second, np.eye(3)).reshape(-1, 3, 9)
    H[:, 3:, 9:] = np.einsum("nk,ij->nikj", design, np.eye(3)).reshape(-1, 3, 15)
    return H


def propagate(D: Array, Q: Array) -> Array:
    """Return D Q D^T.

    Parameters
    ----------
    D : ndarray, (m, 6, 6)
        Of each image.
    Q : ndarray, (6 m, 6 m)
        Covariance of all.

    Returns
    -------
    ndarray, (6 m, 6 m)
        Covariance.
    """
    m = len(D)
    half = np.einsum("iab,ibjc->iajc", D, Q.reshape(m, 6, m, 6), optimize=True)
    return np.asarray(np.einsum("iajc,jdc->iajd", half, D, optimize=True).reshape(6 * m, 6 * m))
