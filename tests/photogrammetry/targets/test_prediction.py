"""Ground points in images: pixels, covariances, and whether they are seen.

Oracles: the collinearity written out for one camera without distortion; the central differences of
the prediction itself, whose pixels the first test holds; draws of all errors.
"""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from insgnss.base.errors import InputError
from insgnss.photogrammetry.targets.prediction import VISIBILITY, Predictions, predict
from insgnss.records.block import INTERIOR, BrownCamera, InteriorCovariance

Array = NDArray[np.float64]
DOWN = np.diag([1.0, -1.0, -1.0])


def camera(backward: bool = False, **values: float) -> BrownCamera:
    given = {"f": 5600.0, "cx": 2590.0, "cy": 1970.0} | values
    interior = np.array([given.get(name, 0.0) for name in INTERIOR])
    return BrownCamera("c", 5120, 3840, interior, backward, 200.0 if backward else 1.0)


def poses(n: int = 3) -> tuple[Array, Array, Array]:
    rng = np.random.default_rng(11)
    X0 = np.column_stack([rng.uniform(-20, 20, (n, 2)), rng.uniform(110, 130, n)])
    C = Rotation.from_euler("xyz", rng.normal(0.0, [0.05, 0.05, 1.0], (n, 3))).as_matrix() @ DOWN
    L = rng.normal(size=(n, 6, 6)) * np.array([0.02, 0.02, 0.03, 1e-4, 1e-4, 3e-4])[:, None]
    return X0, C, L @ L.transpose(0, 2, 1)


DISTORTED = {"b1": 0.5, "b2": -0.3, "k1": 0.016, "k2": -0.06, "k3": 0.06, "p1": -9e-4, "p2": 1e-3}
BACKWARD = {"b1": 1e-4, "b2": -2e-4, "k1": -1e-4, "k2": 2e-7, "p1": -1e-5, "p2": 2e-5}
CAMERAS = [camera(**DISTORTED), camera(True, **BACKWARD)]
INTERIOR_COV = InteriorCovariance(
    ("f", "cx", "cy", "k1"),
    np.diag([1.5, 0.8, 0.9, 4e-6]) @ (0.3 + 0.7 * np.eye(4)) @ np.diag([1.5, 0.8, 0.9, 4e-6]),
)


def test_pixels_are_those_of_the_collinearity() -> None:
    """Oracle: a pinhole camera that looks down, by hand."""
    X0, P = np.array([[100.0, 200.0, 150.0]]), np.eye(6)[None] * 1e-4
    X = np.array([[110.0, 195.0, 50.0]])
    got = predict(camera(), X0, DOWN[None], P, X, 1e-4 * np.eye(3)[None])
    np.testing.assert_allclose(got.uv, [[2590.0 + 560.0, 1970.0 + 280.0]], atol=1e-9)
    assert got.visible.all()


def _shifted(camera: BrownCamera, d: Array) -> Array:
    """The pixel of one point with errors d of pose (6), point (3) and f, cx, cy, k1 (4)."""
    X0, C, _ = poses(1)
    interior = camera.interior.copy()
    interior[[0, 1, 2, 5]] += d[9:]
    C = Rotation.from_rotvec(d[3:6]).as_matrix() @ C
    X = np.array([[15.0, -12.0, 3.0]]) + d[6:9]
    got = predict(
        camera.with_(interior), X0 + d[:3], C, np.zeros((1, 6, 6)), X, np.zeros((1, 3, 3))
    )
    return np.asarray(got.uv[0])


@pytest.mark.parametrize("camera", CAMERAS, ids=["forward", "backward"])
def test_covariance_has_all_three_parts(camera: BrownCamera) -> None:
    """Oracle: central differences over errors of pose, point and camera (GT.1)."""
    X0, C, P = poses(1)
    CX = np.diag([0.01, 0.02, 0.03]) ** 2 + 1e-5
    X = np.array([[15.0, -12.0, 3.0]])
    step = np.array([1e-3] * 3 + [1e-6] * 3 + [1e-3] * 3 + [1e-2] * 3 + [1e-7])
    J = np.array(
        [(_shifted(camera, s) - _shifted(camera, -s)) / (2 * s.max()) for s in np.diag(step)]
    ).T
    whole = np.zeros((13, 13))
    whole[:6, :6], whole[6:9, 6:9], whole[9:, 9:] = P[0], CX, INTERIOR_COV.cov
    got = predict(camera, X0, C, P, X, CX[None], INTERIOR_COV)
    np.testing.assert_allclose(got.cov[0], J @ whole @ J.T, rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(got.by_point[0], J[:, 6:9], rtol=1e-5, atol=1e-5)
    known = predict(camera, X0, C, P, X, CX[None])
    assert (np.linalg.eigvalsh(got.cov[0] - known.cov[0]) > 0.0).all()


def test_ellipse_holds_the_draws() -> None:
    """Oracle: the share of draws within the ellipse of 2.45 sigma is 95 %; directions by hand."""
    cov = np.array([[5.0, 4.0], [4.0, 5.0]])
    one = np.zeros(1, dtype=np.int64)
    row = Predictions(one, one, np.zeros((1, 2)), cov[None], np.zeros((1, 2, 3)), one)
    major, minor, along = row.ellipse[0]
    assert (major, minor, along) == pytest.approx((3.0, 1.0, np.pi / 4))


def test_what_is_not_seen_says_why() -> None:
    """Oracle: points placed behind, beside, beyond the fold, and on either side of the border."""
    barrel = camera(k1=-0.4)  # folds back at r = 0.91, where the format ends at some 0.57
    X0, P = np.zeros((1, 3)), 1e-4 * np.eye(6)[None]
    X = np.array(
        [
            [0.0, 0.0, -100.0],
            [0.0, 0.0, 100.0],
            [150.0, 0.0, -100.0],
            [60.0, 0.0, -100.0],
            [0.0, 0.0, 0.0],
            [1.0, 35.0, -100.0],
        ]
    )
    got = predict(barrel, X0, DOWN[None], P, X, np.tile(1e-4 * np.eye(3), (6, 1, 1)))
    assert [VISIBILITY[k] for k in got.visibility] == [
        "visible",
        "behind the camera",
        "beyond the fold",
        "outside the format",
        "behind the camera",
        "visible",
    ]
    assert np.isfinite(got.cov[got.visible]).all()
    assert not np.isfinite(got.cov[~got.visible]).any()
    assert np.isfinite(got.uv[3]).all()
    v = got.uv[5, 1]
    for margin, seen in ((v - 1.0, True), (v + 1.0, False)):
        again = predict(
            barrel, X0, DOWN[None], P, X[5:], 1e-4 * np.eye(3)[None], margin_px=float(margin)
        )
        assert again.visible.tolist() == [seen]


def test_rows_are_pairs_image_by_image_and_shapes_are_checked() -> None:
    """Oracle: each pair alone."""
    X0, C, P = poses(3)
    X = np.array([[0.0, 0.0, 0.0], [5.0, 5.0, 2.0]])
    CX = np.tile(1e-4 * np.eye(3), (2, 1, 1))
    got = predict(CAMERAS[0], X0, C, P, X, CX, INTERIOR_COV)
    assert len(got) == 6
    for row, (i, p) in enumerate(zip(got.image, got.point, strict=True)):
        alone = predict(
            CAMERAS[0],
            *(a[i : i + 1] for a in (X0, C, P)),
            X[p : p + 1],
            CX[p : p + 1],
            INTERIOR_COV,
        )
        np.testing.assert_allclose(got.uv[row], alone.uv[0], atol=1e-9)
        # px^2; the correlation is what is left of terms of some 10 px^2
        np.testing.assert_allclose(got.cov[row], alone.cov[0], rtol=1e-9, atol=1e-9)
    assert not len(predict(CAMERAS[0], X0, C, P, np.empty((0, 3)), np.empty((0, 3, 3))))
    with pytest.raises(InputError, match="points_cov"):
        predict(CAMERAS[0], X0, C, P, X, CX[:1])
