"""Cameras on arrays: pixels of rays, rays of pixels, and where the polynomial folds back."""

import numpy as np
from numpy.typing import ArrayLike

from ...base.errors import DataError
from ..block import Array, BrownCamera

_K, _P = slice(5, 9), slice(9, 11)  # radial and tangential coefficients in `BrownCamera`'s order
NEWTON_STEPS = 30  # at most: Newton's method has its answer by then, or has none (chosen)
# square of the distance from the axis up to which a fisheye is a frame camera: (1e-6)^2, where the
# two differ by 3e-19
AXIS_R2 = 1e-12
# imaginary share of a root (-) below which it is real: the rounding of `numpy.roots`, for a
# polynomial of degree 4 some 1e-12, and far below that of roots which are a true pair
IMAGINARY = 1e-9
NEWTON_TOLERANCE = 1e-13  # of the unit: 1e-9 px of any camera


def distort(xy: ArrayLike, interior: Array) -> tuple[Array, Array]:
    """Return D of (J.3) and its derivative.

    Parameters
    ----------
    xy : array_like, (n, 2)
        Points, in the polynomial's unit.
    interior : ndarray, (11,)
        Interior orientation.

    Returns
    -------
    D : ndarray, (n, 2)
        Distorted points.
    dD : ndarray, (n, 2, 2)
        Derivatives by the points.
    """
    xy = np.asarray(xy, dtype=np.float64)
    k, p = interior[_K], interior[_P]
    r2 = (xy * xy).sum(axis=1)
    radial = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * (k[2] + r2 * k[3])))
    slope = k[0] + r2 * (2.0 * k[1] + r2 * (3.0 * k[2] + r2 * 4.0 * k[3]))
    along = xy @ p
    D = radial[:, None] * xy + r2[:, None] * p + 2.0 * along[:, None] * xy
    outer = xy[:, :, None] * p + p[:, None] * xy[:, None, :]
    dD = 2.0 * slope[:, None, None] * xy[:, :, None] * xy[:, None, :] + 2.0 * outer
    dD += (radial + 2.0 * along)[:, None, None] * np.eye(2)
    return D, dD


def undistort(xy: ArrayLike, interior: Array) -> Array:
    """Return the points that D of (J.3) takes to `xy`, by Newton's method.

    Parameters
    ----------
    xy : array_like, (n, 2)
        Distorted points, in the polynomial's unit.
    interior : ndarray, (11,)
        Interior orientation.

    Returns
    -------
    ndarray, (n, 2)
        Points within the fold of the polynomial; NaN where no such point is found.
    """
    xy = np.asarray(xy, dtype=np.float64)
    limit = fold_radius(interior)
    out = xy.copy()
    with np.errstate(all="ignore"):  # a point that has no answer runs away, and becomes NaN
        for _ in range(NEWTON_STEPS):
            D, dD = distort(out, interior)
            det = dD[:, 0, 0] * dD[:, 1, 1] - dD[:, 0, 1] * dD[:, 1, 0]
            e = xy - D
            step = np.stack(
                [
                    dD[:, 1, 1] * e[:, 0] - dD[:, 0, 1] * e[:, 1],
                    dD[:, 0, 0] * e[:, 1] - dD[:, 1, 0] * e[:, 0],
                ],
                axis=1,
            )
            out += step / det[:, None]
            if not (np.abs(e) > NEWTON_TOLERANCE).any():
                break
        wrong = ~(np.abs(e).max(axis=1, initial=0.0) <= 1e-9)
        wrong |= ~((out * out).sum(axis=1) < limit**2)
    out[wrong] = np.nan
    return out


def fold_radius(interior: Array) -> float:
    """Return the radius at which the radial polynomial folds back.

    Parameters
    ----------
    interior : ndarray, (11,)
        Interior orientation.

    Returns
    -------
    float
        The radius, in the polynomial's unit; infinity where it never does.
    """
    k1, k2, k3, k4 = interior[_K]
    roots = np.roots([9.0 * k4, 7.0 * k3, 5.0 * k2, 3.0 * k1, 1.0])
    fold_squared = roots.real[(np.abs(roots.imag) < IMAGINARY * np.abs(roots)) & (roots.real > 0.0)]
    return float(np.sqrt(fold_squared.min())) if fold_squared.size else float("inf")


def equidistant(xy: ArrayLike) -> tuple[Array, Array]:
    """Return the points of (J.4a), as far from the axis as their rays are off it in rad.

    Parameters
    ----------
    xy : array_like, (n, 2)
        Directions on the plane of unit distance.

    Returns
    -------
    ab : ndarray, (n, 2)
        Points.
    dab : ndarray, (n, 2, 2)
        Derivatives by the directions.
    """
    xy = np.asarray(xy, dtype=np.float64)
    r2 = np.maximum((xy * xy).sum(axis=1), AXIS_R2)
    scale = np.arctan(np.sqrt(r2)) / np.sqrt(r2)
    slope = (1.0 / (1.0 + r2) - scale) / r2
    outer = xy[:, :, None] * xy[:, None, :]
    return scale[:, None] * xy, scale[:, None, None] * np.eye(2) + slope[:, None, None] * outer


def _perspective(ab: Array) -> Array:
    """Return the directions (n, 2) of equidistant points; NaN of 90 deg off the axis and beyond."""
    angle = np.sqrt(np.maximum((ab * ab).sum(axis=1), AXIS_R2))
    scale = np.where(angle < 0.5 * np.pi, np.tan(angle) / angle, np.nan)
    return np.asarray(scale[:, None] * ab)


def rays_of(camera: BrownCamera, uv: ArrayLike) -> Array:
    """Return the directions that pixels look in.

    Parameters
    ----------
    camera : BrownCamera
        The camera.
    uv : array_like, (n, 2)
        Pixels.

    Returns
    -------
    ndarray, (n, 2)
        x, y on the plane of unit distance, of (J.4) or (J.5); NaN beyond the polynomial's fold.
    """
    f, cx, cy, b1, b2 = camera.interior[:5]
    m = np.asarray(uv, dtype=np.float64) - (cx, cy)
    if not camera.backward:
        y = m[:, 1] / f
        ab = np.stack([(m[:, 0] - b2 * y) / (f + b1), y], axis=1)
        ab = undistort(ab, camera.interior)
        return _perspective(ab) if camera.fisheye else ab
    a = np.stack([(1.0 + b1) * m[:, 0] + b2 * m[:, 1], m[:, 1]], axis=1) / camera.unit_px
    out = camera.unit_px / f * distort(a, camera.interior)[0]
    out[(a * a).sum(axis=1) >= fold_radius(camera.interior) ** 2] = np.nan
    return out


def pixels_of(camera: BrownCamera, xy: ArrayLike) -> Array:
    """Return the pixels that directions appear at; the inverse of `rays_of`.

    Parameters
    ----------
    camera : BrownCamera
        The camera.
    xy : array_like, (n, 2)
        Directions on the plane of unit distance.

    Returns
    -------
    ndarray, (n, 2)
        Pixels; NaN beyond the polynomial's fold.

    Raises
    ------
    DataError
        A backward camera whose b1 leaves its pixels no width.
    """
    xy = np.asarray(xy, dtype=np.float64)
    f, cx, cy, b1, b2 = camera.interior[:5]
    if not camera.backward:
        xy = equidistant(xy)[0] if camera.fisheye else xy
        D = distort(xy, camera.interior)[0]
        D[(xy * xy).sum(axis=1) >= fold_radius(camera.interior) ** 2] = np.nan
        return np.stack([cx + (f + b1) * D[:, 0] + b2 * D[:, 1], cy + f * D[:, 1]], axis=1)
    if not 1.0 + b1 > 0.0:
        raise DataError(
            f"camera {camera.name}: b1 {b1:g} makes the width of its pixels zero or negative;"
            " correct b1"
        )
    a = camera.unit_px * undistort(f / camera.unit_px * xy, camera.interior)
    return np.stack([cx + (a[:, 0] - b2 * a[:, 1]) / (1.0 + b1), cy + a[:, 1]], axis=1)
