"""Pixels at which ground points are expected, with their covariance: (GT.1)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...base.errors import InputError
from ...geodesy.rotation import skew
from ...records.block import INTERIOR, Array, BrownCamera, InteriorCovariance
from ...records.cameras.camera import pixels_of

Rows = NDArray[np.int64]

VISIBILITY = ("visible", "outside the format", "beyond the fold", "behind the camera")
"""What `Predictions.visibility` counts."""
_DIRECTION_STEP = 1e-5  # of directions: truncation and rounding of the derivative below 1e-6 px


@dataclass(frozen=True, eq=False)
class Predictions:
    """Ground points in images; one row a pair of them.

    Parameters
    ----------
    image, point : ndarray of int
        (n,) rows of the images and of the points.
    uv : ndarray
        (n, 2) pixels from the outer corner of the upper left pixel, right and down; NaN of points
        behind the camera or beyond the fold.
    cov : ndarray
        (n, 2, 2) covariance of (GT.1), px^2; NaN of points that are not visible.
    by_point : ndarray
        (n, 2, 3) derivative of the pixel by the point, px/m; NaN of points that are not visible.
    visibility : ndarray of int
        (n,) rows of `VISIBILITY`.
    """

    image: Rows
    point: Rows
    uv: Array
    cov: Array
    by_point: Array
    visibility: Rows

    def __len__(self) -> int:
        """Return the number of pairs."""
        return int(self.image.size)

    @property
    def visible(self) -> NDArray[np.bool_]:
        """(n,) which pairs are expected to be seen."""
        return np.asarray(self.visibility == 0)

    @property
    def ellipse(self) -> Array:
        """(n, 3) semi-axes of one sigma, px, and direction of the larger one, rad from u to v."""
        out = np.full((len(self), 3), np.nan)
        values, vectors = np.linalg.eigh(self.cov[self.visible])
        out[self.visible, :2] = np.sqrt(np.maximum(values[:, ::-1], 0.0))
        out[self.visible, 2] = np.mod(np.arctan2(vectors[:, 1, 1], vectors[:, 0, 1]), np.pi)
        return out


def predict(
    camera: BrownCamera,
    position_m: ArrayLike,
    C_mc: ArrayLike,
    cov: ArrayLike,
    points_m: ArrayLike,
    points_cov: ArrayLike,
    camera_cov: InteriorCovariance | None = None,
    margin_px: float = 0.0,
    own: bool = False,
) -> Predictions:
    """Project ground points into the images of a camera.

    Parameters
    ----------
    camera : BrownCamera
        The camera.
    position_m, C_mc, cov : array_like
        (n, 3), (n, 3, 3), (n, 6, 6) exterior orientation, as `records.ExteriorOrientation` has it.
    points_m : array_like, (m, 3)
        Ground points in the axes of the exterior orientation, m.
    points_cov : array_like, (m, 3, 3)
        Their covariance, m^2.
    camera_cov : InteriorCovariance, optional
        Covariance of the interior orientation; without it, that of a camera known exactly.
    margin_px : float
        Part of the format along its border in which a point does not count as visible, pixels;
        negative for points that may lie outside.
    own : bool
        Whether each image sees the point of its row alone, as of a target that moves.

    Returns
    -------
    Predictions
        All n m pairs, image by image; n pairs where each image has its own point.

    Raises
    ------
    InputError
        Shapes that differ, or values that are not finite.
    """
    arrays = [np.asarray(a, dtype=np.float64) for a in (position_m, C_mc, cov, points_m)]
    X0, C, P, X = arrays
    CX = np.asarray(points_cov, dtype=np.float64)
    n, m = len(X0), len(X)
    shapes = {"position_m": (n, 3), "C_mc": (n, 3, 3), "cov": (n, 6, 6), "points_m": (m, 3)}
    shapes["points_cov"] = (m, 3, 3)
    for (name, shape), got in zip(shapes.items(), [*arrays, CX], strict=True):
        if got.shape != shape or not np.isfinite(got).all():
            raise InputError(f"predict: {name} has shape {got.shape}; {shape} of finite values")
    image, point = np.indices((n, 1 if own else m))
    point = point + image if own else point
    rows = [
        _one(camera, X0[i], C[i], P[i], X[point[i]], CX[point[i]], camera_cov, margin_px)
        for i in range(n)
    ]
    uv, C_uv, B, visibility = (
        np.concatenate([row[k] for row in rows]) if n else np.empty(shape)
        for k, shape in enumerate([(0, 2), (0, 2, 2), (0, 2, 3), (0,)])
    )
    return Predictions(image.ravel(), point.ravel(), uv, C_uv, B, visibility.astype(np.int64))


def _one(
    camera: BrownCamera,
    X0: Array,
    C: Array,
    P: Array,
    X: Array,
    CX: Array,
    camera_cov: InteriorCovariance | None,
    margin_px: float,
) -> tuple[Array, Array, Array, Array]:
    """Pixels, covariances, derivatives by the points and visibility of points in one image."""
    m = len(X)
    d = X - X0
    q = d @ C
    uv, cov, B = np.full((m, 2), np.nan), np.full((m, 2, 2), np.nan), np.full((m, 2, 3), np.nan)
    visibility = np.full(m, VISIBILITY.index("behind the camera"), dtype=np.int64)
    front = np.flatnonzero(q[:, 2] > 0.0)
    with np.errstate(over="ignore", invalid="ignore"):  # points at the horizon
        xy = q[front, :2] / q[front, 2:]
        uv[front] = pixels_of(camera, xy)
        M = _slope(camera, xy)
        K = _by_interior(camera, camera_cov, xy)
    finite = np.isfinite(uv[front]).all(axis=1) & np.isfinite(M).all(axis=(1, 2))
    finite &= np.isfinite(K).all(axis=(1, 2))
    uv[front[~finite]] = np.nan
    visibility[front[~finite]] = VISIBILITY.index("beyond the fold")
    front, xy, M, K = front[finite], xy[finite], M[finite], K[finite]
    size = np.array([camera.width, camera.height], dtype=np.float64)
    inside = ((uv[front] >= margin_px) & (uv[front] <= size - margin_px)).all(axis=1)
    visibility[front] = np.where(inside, 0, VISIBILITY.index("outside the format"))
    rows, xy, M, K = front[inside], xy[inside], M[inside], K[inside]
    by_q = np.zeros((rows.size, 2, 3))
    by_q[:, 0, 0] = by_q[:, 1, 1] = 1.0 / q[rows, 2]
    by_q[:, :, 2] = -xy / q[rows, 2:]
    B[rows] = M @ by_q @ C.T
    turn = np.array([skew(one) for one in d[rows]]).reshape(-1, 3, 3)
    A = np.concatenate([-B[rows], B[rows] @ turn], axis=2)
    BX = B[rows] @ CX[rows] @ B[rows].transpose(0, 2, 1)
    cov[rows] = A @ P @ A.transpose(0, 2, 1) + BX + K @ K.transpose(0, 2, 1)
    return uv, cov, B, visibility.astype(np.float64)


def _slope(camera: BrownCamera, xy: Array) -> Array:
    """(n, 2, 2) derivative of pixels by directions."""
    steps = _DIRECTION_STEP * np.eye(2)
    sides = [pixels_of(camera, xy + s) - pixels_of(camera, xy - s) for s in steps]
    return np.stack(sides, axis=2) / (2.0 * _DIRECTION_STEP)


def _by_interior(camera: BrownCamera, cov: InteriorCovariance | None, xy: Array) -> Array:
    """(n, 2, d) derivative of pixels by the interior orientation, times the root of its covariance:
    differences of cameras one standard deviation to both sides along its eigenvectors.
    """
    if cov is None or not cov.parameters:
        return np.zeros((len(xy), 2, 0))
    scale = np.sqrt(np.diagonal(cov.cov))
    values, vectors = np.linalg.eigh(cov.cov / scale / scale[:, None])
    rows = [INTERIOR.index(name) for name in cov.parameters]
    out = []
    for root in (scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))).T:
        step = np.zeros(len(INTERIOR))
        step[rows] = root
        plus, minus = camera.with_(camera.interior + step), camera.with_(camera.interior - step)
        out.append(0.5 * (pixels_of(plus, xy) - pixels_of(minus, xy)))
    return np.stack(out, axis=2)
