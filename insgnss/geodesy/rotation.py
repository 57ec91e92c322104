r"""Rotations: matrices, rotation vectors, quaternions and the angle sets of the field, all
vectorised over leading dimensions.

A rotation vector v = theta u and its matrix (Rodrigues):

    exp([v x]) = I + sin(theta)/theta [v x] + (1 - cos(theta))/theta^2 [v x]^2                 (R.1)

A Hamilton quaternion q = (w, x, y, z) of the same direction as its matrix C obeys, entry by entry,
a linear relation:

    4 q q^T = [[1 + C00 + C11 + C22, C21 - C12, C02 - C20, C10 - C01], ...]                    (R.2)

so the column of (R.2) with the greatest diagonal entry, normalised, is q without loss of digits
anywhere.

An angle set is a product of three elementary (right-handed, active) rotations about three axes,

    R = R_i(s_1 a_1) R_j(s_2 a_2) R_k(s_3 a_3)                                                 (R.3)

and with R(true) = exp([psi x]) R the error psi, in the left-hand axes, of small errors of the
angles is

    psi = E da,   E = [s_1 e_i | s_2 R_i e_j | s_3 R_i R_j e_k]                                (R.4)

    set   angles               i j k   signs   takes
    rpy   roll pitch yaw       z y x   + + +   body FRD into NED; C = Rz(yaw) Ry(pitch) Rx(roll), so
                                               a_1 is the yaw
    opk   omega phi kappa      x y z   + + +   camera right-up-back into the map's axes
    pok   phi omega kappa      y x z   + + +   the same, phi first
    ypr   yaw pitch roll       z x y   - + +   camera right-up-back into ENU (Metashape,
                                               RealityCapture)

Arrays of angles hold them in the order of the set's letters. Sources: Groves (2013) 2.2;
The pages of data_specs/ say which program has which angles.
"""

from itertools import permutations, product

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

# exchange of north and east, down for up; camera with x right, y down for x right, y up
NED_ENU: Array = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
CV_RUB: Array = np.diag([1.0, -1.0, -1.0])
NED_ENU.flags.writeable = False
CV_RUB.flags.writeable = False


def right_angle_rotations() -> Array:
    """Return the rotations by multiples of 90 degrees about the axes, the identity first.

    Returns
    -------
    ndarray, (24, 3, 3)
        The signed permutations of determinant +1.
    """
    matrices = []
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            C = np.zeros((3, 3))
            C[range(3), order] = signs
            if np.linalg.det(C) > 0.0:
                matrices.append(C)
    return np.array(matrices)


def skew(v: ArrayLike) -> Array:
    """Return the matrix [v x] of a cross product, [v x] w = v x w.

    Parameters
    ----------
    v : array_like, (..., 3)
        Vectors.

    Returns
    -------
    ndarray, (..., 3, 3)
        Skew-symmetric matrices.
    """
    v = np.asarray(v, dtype=np.float64)
    out = np.zeros((*v.shape, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = v[..., 2], -v[..., 1], v[..., 0]
    return out


def rotation_from_vector(v: ArrayLike) -> Array:
    """Return the rotation matrix exp([v x]) of a rotation vector (R.1).

    Parameters
    ----------
    v : array_like, (..., 3)
        Rotation vectors, rad.

    Returns
    -------
    ndarray, (..., 3, 3)
        Rotation matrices.
    """
    v = np.asarray(v, dtype=np.float64)
    theta = np.linalg.norm(v, axis=-1)[..., None, None]
    first = np.sinc(theta / np.pi)
    second = 0.5 * np.sinc(0.5 * theta / np.pi) ** 2
    V = skew(v)
    return np.eye(3) + first * V + second * (V @ V)


def vector_from_rotation(C: ArrayLike) -> Array:
    """Return the rotation vector of a rotation matrix.

    It is accurate near 0 and near pi.

    Parameters
    ----------
    C : array_like, (..., 3, 3)
        Rotation matrices.

    Returns
    -------
    ndarray, (..., 3)
        Rotation vectors of length at most pi, rad.
    """
    q = quaternion_from_rotation(C)
    sine = np.linalg.norm(q[..., 1:], axis=-1)
    small = sine < 1e-8
    angle = 2.0 * np.arctan2(sine, q[..., 0])
    # angle / sin(angle/2) -> 2, relative error < 1e-16
    factor = np.where(small, 2.0, angle / np.where(small, 1.0, sine))
    return factor[..., None] * q[..., 1:]


def inverse_right_jacobian(v: ArrayLike) -> Array:
    """Return the derivative of log(exp(v) exp(d)) by d at d = 0.

    Parameters
    ----------
    v : ndarray, (..., 3)
        Rotation vectors shorter than pi, rad.

    Returns
    -------
    ndarray, (..., 3, 3)
        The derivatives, I + [v x] / 2 + ...
    """
    v = np.asarray(v, dtype=np.float64)
    angle = np.sqrt((v * v).sum(axis=-1))[..., None, None]
    small = angle < 1e-4
    safe = np.where(small, 1.0, angle)
    second = 1.0 / safe**2 - (1.0 + np.cos(safe)) / (2.0 * safe * np.sin(safe))
    V = skew(v)
    return np.asarray(np.eye(3) + 0.5 * V + np.where(small, 1.0 / 12.0, second) * (V @ V))


def quaternion_from_rotation(C: ArrayLike) -> Array:
    """Return the unit quaternion of a rotation matrix, from (R.2).

    Parameters
    ----------
    C : array_like, (..., 3, 3)
        Rotation matrices.

    Returns
    -------
    ndarray, (..., 4)
        Hamilton quaternions w, x, y, z of the same direction, with w >= 0.
    """
    C = np.asarray(C, dtype=np.float64)
    d = np.diagonal(C, axis1=-2, axis2=-1)
    K = np.empty((*C.shape[:-2], 4, 4))
    K[..., 0, 0] = 1.0 + d.sum(axis=-1)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        K[..., i + 1, i + 1] = 1.0 + d[..., i] - d[..., j] - d[..., k]
        K[..., 0, i + 1] = K[..., i + 1, 0] = C[..., k, j] - C[..., j, k]
        K[..., j + 1, k + 1] = K[..., k + 1, j + 1] = C[..., j, k] + C[..., k, j]
    best = np.argmax(np.diagonal(K, axis1=-2, axis2=-1), axis=-1)
    q = np.take_along_axis(K, best[..., None, None], axis=-1)[..., 0]
    q /= np.linalg.norm(q, axis=-1, keepdims=True)
    return np.where(q[..., :1] < 0.0, -q, q)


def rotation_from_quaternion(q: ArrayLike) -> Array:
    """Return the rotation matrix of a unit quaternion.

    Parameters
    ----------
    q : array_like, (..., 4)
        Unit quaternions w, x, y, z.

    Returns
    -------
    ndarray, (..., 3, 3)
        Rotation matrices of the same direction.
    """
    q = np.asarray(q, dtype=np.float64)
    w, v = q[..., 0, None, None], q[..., 1:]
    V = skew(v)
    return np.eye(3) + 2.0 * w * V + 2.0 * (V @ V)


def _elementary(axis: int, angle: Array) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    j, k = (axis + 1) % 3, (axis + 2) % 3
    out = np.zeros((*angle.shape, 3, 3))
    out[..., axis, axis] = 1.0
    out[..., j, j] = out[..., k, k] = c
    out[..., k, j], out[..., j, k] = s, -s
    return out


def _compose(angles: Array, axes: tuple[int, int, int]) -> Array:
    """Return (R.3) with signs +; angles (..., 3) stand in the order of the product."""
    first, second, third = (_elementary(axis, angles[..., i]) for i, axis in enumerate(axes))
    return first @ second @ third


def _jacobian(angles: Array, axes: tuple[int, int, int]) -> Array:
    """Return (R.4) with signs +; angles (..., 3) and columns stand in the order of the product."""
    first = _elementary(axes[0], angles[..., 0])
    E = np.zeros((*angles.shape, 3))
    E[..., axes[0], 0] = 1.0
    E[..., 1] = first[..., axes[1]]
    E[..., 2] = (first @ _elementary(axes[1], angles[..., 1]))[..., axes[2]]
    return E


def _arcsin(x: Array) -> Array:
    return np.arcsin(np.clip(x, -1.0, 1.0))  # an entry of a rotation passes 1 by rounding only


_ZYX, _XYZ, _YXZ, _ZXY = (2, 1, 0), (0, 1, 2), (1, 0, 2), (2, 0, 1)  # axes i, j, k of (R.3)
_YPR_SIGNS = np.array([-1.0, 1.0, 1.0])  # s of (R.3): yaw is clockwise


def rotation_from_rpy(rpy: ArrayLike) -> Array:
    """Compose C_nb = Rz(yaw) Ry(pitch) Rx(roll) (R.3).

    Parameters
    ----------
    rpy : array_like, (..., 3)
        Roll, pitch, yaw, rad.

    Returns
    -------
    ndarray, (..., 3, 3)
        Rotation matrices, body FRD into NED.
    """
    return _compose(np.asarray(rpy, dtype=np.float64)[..., ::-1], _ZYX)


def rpy_from_rotation(C_nb: ArrayLike) -> Array:
    """Return roll, pitch, yaw of C_nb = Rz(yaw) Ry(pitch) Rx(roll).

    Parameters
    ----------
    C_nb : array_like, (..., 3, 3)
        Rotation matrices, body FRD into NED.

    Returns
    -------
    ndarray, (..., 3)
        Roll, pitch, yaw, rad. Roll and yaw lie in (-pi, pi], pitch in [-pi/2, pi/2].
    """
    C = np.asarray(C_nb, dtype=np.float64)
    roll, yaw = np.arctan2(C[..., 2, 1], C[..., 2, 2]), np.arctan2(C[..., 1, 0], C[..., 0, 0])
    return np.stack([roll, _arcsin(-C[..., 2, 0]), yaw], axis=-1)


def rpy_jacobian(rpy: ArrayLike) -> Array:
    """Return E of psi = E d(roll, pitch, yaw), psi in NED axes (R.4).

    Parameters
    ----------
    rpy : array_like, (..., 3)
        Roll, pitch, yaw, rad.

    Returns
    -------
    ndarray, (..., 3, 3)
        Jacobians; psi (rad) is the small rotation error of the true matrix exp([psi x]) R.
    """
    return _jacobian(np.asarray(rpy, dtype=np.float64)[..., ::-1], _ZYX)[..., ::-1]


def rotation_from_opk(opk: ArrayLike) -> Array:
    """Compose R = Rx(omega) Ry(phi) Rz(kappa) (R.3).

    Parameters
    ----------
    opk : array_like, (..., 3)
        Omega, phi, kappa, rad.

    Returns
    -------
    ndarray, (..., 3, 3)
        Rotation matrices, camera right-up-back into the map's axes.
    """
    return _compose(np.asarray(opk, dtype=np.float64), _XYZ)


def opk_from_rotation(R: ArrayLike) -> Array:
    """Return omega, phi, kappa of R = Rx(omega) Ry(phi) Rz(kappa).

    Parameters
    ----------
    R : array_like, (..., 3, 3)
        Rotation matrices, camera right-up-back into the map's axes.

    Returns
    -------
    ndarray, (..., 3)
        Omega, phi, kappa, rad. Phi lies in [-pi/2, pi/2].
    """
    R = np.asarray(R, dtype=np.float64)
    omega, kappa = np.arctan2(-R[..., 1, 2], R[..., 2, 2]), np.arctan2(-R[..., 0, 1], R[..., 0, 0])
    return np.stack([omega, _arcsin(R[..., 0, 2]), kappa], axis=-1)


def opk_jacobian(opk: ArrayLike) -> Array:
    """Return E of psi = E d(omega, phi, kappa), psi in the map's axes (R.4).

    Parameters
    ----------
    opk : array_like, (..., 3)
        Omega, phi, kappa, rad.

    Returns
    -------
    ndarray, (..., 3, 3)
        Jacobians; psi (rad) is the small rotation error of the true matrix exp([psi x]) R.
    """
    return _jacobian(np.asarray(opk, dtype=np.float64), _XYZ)


def rotation_from_pok(pok: ArrayLike) -> Array:
    """Compose R = Ry(phi) Rx(omega) Rz(kappa) (R.3).

    Parameters
    ----------
    pok : array_like, (..., 3)
        Phi, omega, kappa, rad.

    Returns
    -------
    ndarray, (..., 3, 3)
        Rotation matrices, camera right-up-back into the map's axes.
    """
    return _compose(np.asarray(pok, dtype=np.float64), _YXZ)


def pok_from_rotation(R: ArrayLike) -> Array:
    """Return phi, omega, kappa of R = Ry(phi) Rx(omega) Rz(kappa).

    Parameters
    ----------
    R : array_like, (..., 3, 3)
        Rotation matrices, camera right-up-back into the map's axes.

    Returns
    -------
    ndarray, (..., 3)
        Phi, omega, kappa, rad. Omega lies in [-pi/2, pi/2].
    """
    R = np.asarray(R, dtype=np.float64)
    phi, kappa = np.arctan2(R[..., 0, 2], R[..., 2, 2]), np.arctan2(R[..., 1, 0], R[..., 1, 1])
    return np.stack([phi, _arcsin(-R[..., 1, 2]), kappa], axis=-1)


def pok_jacobian(pok: ArrayLike) -> Array:
    """Return E of psi = E d(phi, omega, kappa), psi in the map's axes (R.4).

    Parameters
    ----------
    pok : array_like, (..., 3)
        Phi, omega, kappa, rad.

    Returns
    -------
    ndarray, (..., 3, 3)
        Jacobians; psi (rad) is the small rotation error of the true matrix exp([psi x]) R.
    """
    return _jacobian(np.asarray(pok, dtype=np.float64), _YXZ)


def rotation_from_ypr(ypr: ArrayLike) -> Array:
    """Compose R = Rz(-yaw) Rx(pitch) Ry(roll) (R.3).

    Parameters
    ----------
    ypr : array_like, (..., 3)
        Yaw, pitch, roll, rad.

    Returns
    -------
    ndarray, (..., 3, 3)
        Rotation matrices, camera right-up-back into ENU.
    """
    return _compose(np.asarray(ypr, dtype=np.float64) * _YPR_SIGNS, _ZXY)


def ypr_from_rotation(R: ArrayLike) -> Array:
    """Return yaw, pitch, roll of R = Rz(-yaw) Rx(pitch) Ry(roll).

    Parameters
    ----------
    R : array_like, (..., 3, 3)
        Rotation matrices, camera right-up-back into ENU.

    Returns
    -------
    ndarray, (..., 3)
        Yaw, pitch, roll, rad. Pitch lies in [-pi/2, pi/2].
    """
    R = np.asarray(R, dtype=np.float64)
    yaw, roll = np.arctan2(R[..., 0, 1], R[..., 1, 1]), np.arctan2(-R[..., 2, 0], R[..., 2, 2])
    return np.stack([yaw, _arcsin(R[..., 2, 1]), roll], axis=-1)


def ypr_jacobian(ypr: ArrayLike) -> Array:
    """Return E of psi = E d(yaw, pitch, roll), psi in ENU axes (R.4).

    Parameters
    ----------
    ypr : array_like, (..., 3)
        Yaw, pitch, roll, rad.

    Returns
    -------
    ndarray, (..., 3, 3)
        Jacobians; psi (rad) is the small rotation error of the true matrix exp([psi x]) R.
    """
    return _jacobian(np.asarray(ypr, dtype=np.float64) * _YPR_SIGNS, _ZXY) * _YPR_SIGNS


def nearest_rotation(M: ArrayLike) -> Array:
    """Return the rotation nearest to a matrix in the Frobenius norm.

    It is Kabsch's U diag(1, 1, det U V^T) V^T, of determinant +1.

    Parameters
    ----------
    M : array_like, (..., 3, 3)
        Matrices.

    Returns
    -------
    ndarray, (..., 3, 3)
        Rotation matrices.
    """
    U, _, Vt = np.linalg.svd(np.asarray(M, dtype=np.float64))
    sign = np.sign(np.linalg.det(U @ Vt))
    U[..., :, 2] *= sign[..., None]
    return U @ Vt


def is_rotation(M: ArrayLike, tol: float = 1e-6) -> bool:
    """Tell whether every matrix is orthonormal with determinant +1.

    Parameters
    ----------
    M : array_like, (..., 3, 3)
        Matrices.
    tol : float
        Limit of the greatest entry of M M^T - I.

    Returns
    -------
    bool
        False for another shape and for values that are not finite, too.
    """
    M = np.asarray(M, dtype=np.float64)
    if M.shape[-2:] != (3, 3) or not np.isfinite(M).all():
        return False
    residual = np.abs(M @ np.swapaxes(M, -1, -2) - np.eye(3)).max(initial=0.0)
    return bool(residual <= tol and (np.linalg.det(M) > 0.0).all())
