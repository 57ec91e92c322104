"""First values: forward intersection of points, resection of images."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ...geodesy.rotation import nearest_rotation, rotation_from_vector, skew
from ...records.block import Array, BrownCamera, ImageBlock
from ...records.cameras.camera import rays_of
from .unknowns import Unknowns

# imaginary share of a real root, and misclosure of its ratios of distances (1): a double root has
# half of the digits, 1e-8, more where its coefficients cancel
DOUBLE_ROOT = 1e-4


def directions(
    block: ImageBlock,
    cameras: Sequence[BrownCamera] = (),
    chosen: slice | NDArray[np.bool_] = slice(None),
) -> Array:
    """Return the rays of image observations of a block.

    Parameters
    ----------
    block : ImageBlock
        The block.
    cameras : sequence of BrownCamera
        Cameras in the place of its own, such as adjusted ones.
    chosen : slice or ndarray of bool
        Which observations; all where it is left out.

    Returns
    -------
    ndarray, (n, 2)
        Directions on the plane of unit distance, in the camera.
    """
    uv, of_camera = block.observations.uv[chosen], block.camera[block.observations.image[chosen]]
    xy = np.empty((len(uv), 2))
    for c, camera in enumerate(cameras or block.cameras):
        rows = of_camera == c
        xy[rows] = rays_of(camera, uv[rows])
    return xy


def intersect_rays(
    position: Array,
    C_mc: Array,
    xy: Array,
    image: NDArray[np.int64],
    point: NDArray[np.int64],
    n_points: int,
) -> Array:
    """Intersect rays: the points that are nearest to all of their rays.

    Parameters
    ----------
    position, C_mc : ndarray
        (n, 3) and (n, 3, 3) poses of the images; NaN of images without.
    xy : ndarray, (k, 2)
        Rays, on the plane of unit distance.
    image, point : ndarray of int, (k,)
        Image and object point of each ray.
    n_points : int
        Number of object points.

    Returns
    -------
    ndarray, (n_points, 3)
        Points, m; NaN of those with fewer than two rays, or parallel ones (0.001 deg).
    """
    d = np.einsum("nij,nj->ni", C_mc[image], np.column_stack([xy, np.ones(len(xy))]))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    good = np.isfinite(d).all(axis=1) & np.isfinite(position[image]).all(axis=1)
    d, image, point = d[good], image[good], point[good]
    P = np.eye(3) - d[:, :, None] * d[:, None, :]
    centre = np.zeros(3) if not good.any() else position[image].mean(axis=0)
    right = np.einsum("nij,nj->ni", P, position[image] - centre)
    N = np.stack(
        [np.bincount(point, P[:, i, j], n_points) for i in range(3) for j in range(3)], axis=1
    ).reshape(-1, 3, 3)
    h = np.stack([np.bincount(point, right[:, i], n_points) for i in range(3)], axis=1)
    values = np.linalg.eigvalsh(N)
    solvable = values[:, 0] > np.radians(1e-3) ** 2 * 0.5
    out = np.full((n_points, 3), np.nan)
    out[solvable] = np.linalg.solve(N[solvable], h[solvable, :, None])[..., 0] + centre
    return out


def three_point_poses(xy: Array, X: Array) -> list[tuple[Array, Array]]:
    """Return the poses from which three known points are seen in three directions (Grunert).

    Parameters
    ----------
    xy : ndarray, (3, 2)
        Rays, on the plane of unit distance.
    X : ndarray, (3, 3)
        Object points, m.

    Returns
    -------
    list of tuple
        Up to eight pairs of projection centre (3,) and C_mc (3, 3), some of them twice.
    """
    d = np.column_stack([xy, np.ones(3)])
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    a2, b2, c2 = (((X[i] - X[j]) ** 2).sum() for i, j in ((1, 2), (0, 2), (0, 1)))
    if min(a2, b2, c2) == 0.0:
        return []
    cos_alpha, cos_beta, cos_gamma = d[1] @ d[2], d[0] @ d[2], d[0] @ d[1]
    # distances s_2 = u s_1, s_3 = v s_1; u = numerator(v) / denominator(v) is put into
    # u^2 - 2 u cos(gamma) = side(v), the law of cosines of the first two rays
    p, q = (a2 - c2) / b2, c2 / b2
    numerator = np.array([-1.0 + p, -2.0 * p * cos_beta, 1.0 + p])
    denominator = np.array([-2.0 * cos_alpha, 2.0 * cos_gamma])
    side = np.array([q, -2.0 * q * cos_beta, q - 1.0])
    quartic = np.polyadd(
        np.polymul(numerator, numerator),
        np.polyadd(
            -2.0 * cos_gamma * np.polymul(numerator, denominator),
            -np.polymul(side, np.polymul(denominator, denominator)),
        ),
    )
    poses = []
    for root in np.roots(quartic):
        v = root.real
        length = 1.0 + v * v - 2.0 * v * cos_beta
        if abs(root.imag) > DOUBLE_ROOT * abs(root) or v <= 0.0 or length <= 0.0:
            continue
        # where the triangle is symmetric, the denominator is zero at a root: both u may be right
        spread = np.sqrt(max(cos_gamma**2 + np.polyval(side, v), 0.0))
        for u in (cos_gamma - spread, cos_gamma + spread):
            misclosure = u * np.polyval(denominator, v) - np.polyval(numerator, v)
            if u > 0.0 and abs(misclosure) <= DOUBLE_ROOT:
                distance = np.sqrt(b2 / length) * np.array([1.0, u, v])
                poses.append(_absolute(d * distance[:, None], X))
    return poses


def _absolute(q: Array, X: Array) -> tuple[Array, Array]:
    """Return X_0 and C with X = X_0 + C q, by least squares (Kabsch)."""
    q0, X0 = q.mean(axis=0), X.mean(axis=0)
    C = nearest_rotation((X - X0).T @ (q - q0))
    return X0 - C @ q0, C


def resect_image(xy: Array, X: Array) -> tuple[Array, Array, float] | None:
    """Return the pose of an image from points that it sees.

    All choices of three among eight well-spread points give poses; the one with the smallest
    median of the angles between rays and points is improved by all points (Gauss-Newton).

    Parameters
    ----------
    xy : ndarray, (n, 2)
        Rays, on the plane of unit distance.
    X : ndarray, (n, 3)
        Object points, m; four at least.

    Returns
    -------
    tuple or None
        Projection centre (3,), C_mc (3, 3) and median distance on the plane of unit distance; None
        where no pose sees the points before the camera.
    """
    if len(xy) < 4:
        return None
    chosen = [int(np.argmax(((xy - xy.mean(axis=0)) ** 2).sum(axis=1)))]
    while len(chosen) < min(8, len(xy)):
        far = ((xy[:, None] - xy[chosen][None]) ** 2).sum(axis=2).min(axis=1)
        chosen.append(int(np.argmax(far)))
    best: tuple[Array, Array, float] | None = None
    for three in combinations(chosen, 3):
        for X0, C in three_point_poses(xy[list(three)], X[list(three)]):
            misfit = _misfit(X0, C, xy, X)
            if best is None or misfit < best[2]:
                best = X0, C, misfit
    if best is None or not np.isfinite(best[2]):
        return None
    return _improve_pose(*best, xy, X)


def _misfit(X0: Array, C: Array, xy: Array, X: Array) -> float:
    """Return the median distance of points from their rays, of the fourth nearest at least."""
    q = (X - X0) @ C
    with np.errstate(all="ignore"):
        residual = np.linalg.norm(q[:, :2] / q[:, 2:] - xy, axis=1)
    residual = np.sort(np.where(q[:, 2] > 0.0, residual, np.inf))
    return float(residual[max(3, len(residual) // 2)])  # three points fit any pose that they gave


def _improve_pose(
    X0: Array, C: Array, miss: float, xy: Array, X: Array
) -> tuple[Array, Array, float]:
    """Improve a pose by least squares over the points that lie near their rays."""
    for _ in range(5):
        q = (X - X0) @ C
        e = xy - q[:, :2] / q[:, 2:]
        near = (q[:, 2] > 0.0) & (np.linalg.norm(e, axis=1) <= 5.0 * miss + 1e-6)
        if near.sum() < 4:
            return X0, C, miss
        q, e = q[near], e[near]
        G = np.zeros((len(q), 2, 3))
        G[:, 0, 0] = G[:, 1, 1] = 1.0 / q[:, 2]
        G[:, :, 2] = -q[:, :2] / q[:, 2:] ** 2
        B = G @ C.T
        J = np.concatenate([-B, B @ skew(X[near] - X0)], axis=2).reshape(-1, 6)
        dx = np.linalg.lstsq(J, e.ravel(), rcond=None)[0]
        trial = X0 + dx[:3], rotation_from_vector(dx[3:]) @ C
        if not (better := _misfit(*trial, xy, X)) <= miss:
            return X0, C, miss
        X0, C, miss = *trial, better
    return X0, C, miss


def first_values(block: ImageBlock) -> Unknowns:
    """Return first values of all unknowns of a block.

    Images without pose are resected from ground control and from points that other images have
    intersected, most points first; then all points are intersected. Ground control of which all
    coordinates are known keeps them.

    Parameters
    ----------
    block : ImageBlock
        The block.

    Returns
    -------
    Unknowns
        Poses and points; NaN of images and points that could not be found.
    """
    obs = block.observations
    xy = directions(block)
    position, C_mc = np.array(block.position_m), np.array(block.C_mc)
    surveyed = np.full((len(block.points), 3), np.nan)
    surveyed[block.control.complete.point] = block.control.complete.position_m
    failed: set[int] = set()
    while True:
        point = intersect_rays(position, C_mc, xy, obs.image, obs.point, len(block.points))
        control = np.isfinite(surveyed[:, 0])
        point[control] = surveyed[control]
        waiting = np.asarray(~np.isfinite(position).all(axis=1))
        waiting |= ~np.isfinite(C_mc).all(axis=(1, 2))
        waiting[list(failed)] = False
        usable = np.isfinite(point[obs.point, 0]) & np.isfinite(xy).all(axis=1)
        count = np.bincount(obs.image[usable], minlength=len(block.images)) * waiting
        if not count.any() or count.max() < 4:
            break
        i = int(np.argmax(count))
        rows = usable & (obs.image == i)
        pose = resect_image(xy[rows], point[obs.point[rows]])
        if pose is None:
            failed.add(i)
            continue
        position[i], C_mc[i] = pose[:2]
        failed.clear()
    interior = np.array([camera.interior for camera in block.cameras])
    unseen = np.isnan(point[block.control.point]).any(axis=1)
    point[block.control.point[unseen]] = block.control.position_m[unseen]
    return Unknowns(position, C_mc, interior, point)
