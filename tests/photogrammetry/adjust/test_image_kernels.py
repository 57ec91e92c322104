"""Residuals and derivatives of image observations, directions and pixels."""

from dataclasses import replace

import numpy as np
import pytest
from oracles import oracle
from simulated_blocks import camera, simulated

from insgnss.geodesy.rotation import rotation_from_vector
from insgnss.io.formats.blocks.colmap_model import brown_of
from insgnss.io.formats.bundle.camera import camera_of
from insgnss.photogrammetry.adjust.kernels import collinearity
from insgnss.records.block import INTERIOR, RADIAL_MODELS, BrownCamera
from insgnss.records.cameras.camera import (
    distort,
    equidistant,
    fold_radius,
    pixels_of,
    rays_of,
    undistort,
)


def computed(X0, C, X, cam, interior, uv):
    """Observed - computed by (J.1) and (J.3) to (J.5), component by component; any number of
    observations of one camera.
    """
    q = np.einsum("...ji,...j->...i", C, X - X0)
    x, y = q[..., 0] / q[..., 2], q[..., 1] / q[..., 2]
    u, v = np.moveaxis(uv, -1, 0)
    f, cx, cy, b1, b2, *k, p1, p2 = interior
    if cam.backward:
        a = ((1 + b1) * (u - cx) + b2 * (v - cy)) / cam.unit_px
        b = (v - cy) / cam.unit_px
    else:
        r = np.sqrt(x**2 + y**2) if cam.fisheye else 1.0
        a, b = (x, y) if not cam.fisheye else (x / r * np.arctan(r), y / r * np.arctan(r))
    r2 = a**2 + b**2
    radial = 1 + sum(c * r2 ** (n + 1) for n, c in enumerate(k))
    da = a * radial + p1 * (r2 + 2 * a**2) + 2 * p2 * a * b
    db = b * radial + p2 * (r2 + 2 * b**2) + 2 * p1 * a * b
    if cam.backward:
        e = cam.unit_px * da - f * x, cam.unit_px * db - f * y
    else:
        e = u - cx - (f + b1) * da - b2 * db, v - cy - f * db
    return np.stack(e, axis=-1)


@pytest.mark.parametrize("model", RADIAL_MODELS)
def test_residual_and_derivative(model):
    """Oracle: the equations written out, and their central differences, psi on the left."""
    cam = replace(camera(model == "backward"), fisheye=model == "fisheye")
    interior = np.array(cam.interior)
    interior[8] = 1e-3 * interior[7]
    rng = np.random.default_rng(3)
    for _ in range(5):
        X0, C = rng.normal(0.0, 3.0, 3), rotation_from_vector(rng.normal(0.0, 1.0, 3))
        X = X0 + C @ (rng.uniform(-0.3, 0.3, 2).tolist() + [1.0]) * 100.0
        uv = np.array([2590.0, 1972.0]) + rng.uniform(-1500.0, 1500.0, 2)
        work, e, A, K, B = (np.empty(s) for s in (10, 2, (2, 6), (2, 11), (2, 3)))
        args = (X0, C, X, interior, RADIAL_MODELS.index(model), cam.unit_px)
        assert collinearity.image_residual(*args, np.inf, uv, work, e)
        assert e == pytest.approx(computed(X0, C, X, cam, interior, uv), abs=1e-8)
        collinearity.image_jacobian(*args, uv, work, A, K, B)

        def numeric(move, step):
            ahead, behind = (computed(*move(s), uv) for s in (step, -step))  # noqa: B023
            return -(ahead - behind) / (2.0 * step)

        for a in range(3):
            d = np.eye(3)[a]
            moves = {
                "A": (lambda s, d=d: (X0 + s * d, C, X, cam, interior), 1e-3, A[:, a]),  # noqa: B023
                "psi": (
                    lambda s, d=d: (X0, rotation_from_vector(s * d) @ C, X, cam, interior),  # noqa: B023
                    1e-5,
                    A[:, 3 + a],
                ),
                "B": (lambda s, d=d: (X0, C, X + s * d, cam, interior), 1e-3, B[:, a]),  # noqa: B023
            }
            for move, step, got in moves.values():
                assert got == pytest.approx(numeric(move, step), rel=1e-6, abs=1e-4)
        for a in range(11):
            step = 1e-2 / np.abs(K[:, a]).max()  # moves the pixel by 0.01
            got = numeric(
                lambda s, a=a: (X0, C, X, cam, interior + s * np.eye(11)[a]),  # noqa: B023
                step,
            )
            assert K[:, a] == pytest.approx(got, rel=1e-6, abs=1e-6 * np.abs(got).max())


def test_forward_camera_against_colmap():
    """Oracle: pycolmap's FULL_OPENCV, whose p1 and p2 stand in the other order."""
    pycolmap = oracle("pycolmap")
    rng = np.random.default_rng(5)
    xy = rng.uniform(-0.4, 0.4, (50, 2))
    cam = camera(free=())
    f, cx, cy, _, _, k1, k2, k3, _, p1, p2 = cam.interior
    ours = cam.with_(np.where(np.isin(INTERIOR, ("b1", "b2")), 0.0, cam.interior))
    params = [f, f, cx, cy, k1, k2, p2, p1, k3, 0.0, 0.0, 0.0]
    theirs = pycolmap.Camera(model="FULL_OPENCV", width=5120, height=3840, params=params)
    want = theirs.img_from_cam(np.column_stack([xy, np.ones(50)]))
    assert pixels_of(ours, xy) == pytest.approx(want, abs=1e-8)


@pytest.mark.parametrize("name", ["OPENCV_FISHEYE", "RADIAL_FISHEYE", "THIN_PRISM_FISHEYE"])
def test_fisheye_cameras_against_colmap(name):
    """Oracle: pycolmap's img_from_cam, up to 80 deg off the axis, and on it."""
    pycolmap = oracle("pycolmap")
    k, p = [0.03, -0.02, 0.004, -0.001], [3e-4, -2e-4]
    coefficients = {"OPENCV_FISHEYE": k, "RADIAL_FISHEYE": k[:2]}.get(name)
    coefficients = coefficients or [*k[:2], *p, *k[2:], 0.0, 0.0]
    focal = [800.0] if name == "RADIAL_FISHEYE" else [802.0, 800.0]
    params = [*focal, 1300.5, 980.25, *coefficients]
    theirs = pycolmap.Camera(model=name, width=2600, height=2000, params=params)
    ours = brown_of("", "c", camera_of(f"{name} 2600 2000 {' '.join(map(str, params))}", "c"))
    assert ours.model == "fisheye"
    off, about = np.meshgrid(np.radians([0.0, 1e-5, 20.0, 60.0, 80.0]), np.arange(0.0, 6.0, 0.7))
    xy = np.stack([np.tan(off) * np.cos(about), np.tan(off) * np.sin(about)], axis=-1)
    xy = xy.reshape(-1, 2)
    want = theirs.img_from_cam(np.column_stack([xy, np.ones(len(xy))]))
    assert pixels_of(ours, xy) == pytest.approx(want, abs=1e-8)


@pytest.mark.parametrize("model", RADIAL_MODELS)
def test_rays_and_pixels_are_inverse(model):
    """Oracle: the definition of an inverse, over the whole image."""
    cam = replace(camera(model == "backward"), fisheye=model == "fisheye")
    u, v = np.meshgrid(np.linspace(0.0, 5120.0, 9), np.linspace(0.0, 3840.0, 7))
    uv = np.column_stack([u.ravel(), v.ravel()])
    xy = rays_of(cam, uv)
    assert np.isfinite(xy).all()
    assert pixels_of(cam, xy) == pytest.approx(uv, abs=1e-7)


def test_the_derivative_of_the_distortion():
    """Oracle: central differences."""
    interior = camera().interior
    xy = np.random.default_rng(1).uniform(-0.5, 0.5, (20, 2))
    _, dD = distort(xy, interior)
    for k in range(2):
        h = 1e-6 * np.eye(2)[k]
        want = (distort(xy + h, interior)[0] - distort(xy - h, interior)[0]) / 2e-6
        assert dD[:, :, k] == pytest.approx(want, abs=1e-8)


def test_the_derivative_of_equidistant_points():
    """Oracle: central differences, on the axis too; a ray of 45 deg lies at pi / 4."""
    xy = np.array([[0.0, 0.0], [1.0, 0.0], [0.3, -0.7], [4.0, 5.0]])
    ab, dab = equidistant(xy)
    assert ab[1] == pytest.approx([0.25 * np.pi, 0.0])
    for k in range(2):
        h = 1e-5 * np.eye(2)[k]
        want = (equidistant(xy + h)[0] - equidistant(xy - h)[0]) / 2e-5
        assert dab[:, :, k] == pytest.approx(want, abs=1e-9)


def test_a_point_beyond_the_fold_is_not_seen():
    """Oracle: r - 0.4 r^3 is largest at r = 1 / sqrt(1.2); beyond it a point would be drawn within
    the image, at r = 1.5 where one of r = 0.15 is.
    """
    interior = np.zeros(11)
    interior[:3], interior[5] = (1000.0, 500.0, 500.0), -0.4
    assert fold_radius(interior) == pytest.approx(1.0 / np.sqrt(1.2))
    wide = BrownCamera("wide", 1000, 1000, interior)
    assert np.isnan(pixels_of(wide, [[1.5, 0.0]])).all()
    assert np.isnan(undistort([[0.7, 0.0]], interior)).all()
    assert undistort([[0.15, 0.0]], interior)[0, 0] == pytest.approx(0.1514, abs=1e-3)
    e, work = np.empty(2), np.empty(10)
    args = (interior, collinearity.FORWARD, 1.0, 1.0 / 1.2, np.array([650.0, 500.0]), work, e)
    assert not collinearity.image_residual(np.zeros(3), np.eye(3), np.array([1.5, 0.0, 1.0]), *args)
    assert not collinearity.image_residual(
        np.zeros(3), np.eye(3), np.array([0.1, 0.0, -1.0]), *args
    )
    assert collinearity.image_residual(np.zeros(3), np.eye(3), np.array([0.1, 0.0, 1.0]), *args)


def test_simulated_pixels_have_no_residual():
    """Oracle: the truth of the simulation, drawn by `pixels_of`."""
    from insgnss.photogrammetry.adjust.normals import cost, problem_of

    for backward in (False, True):
        made = simulated(2, cameras=(camera(backward),), noise_px=1e-9)
        total, invalid = cost(problem_of(made.block), made.truth)
        assert invalid == 0
        assert total / len(made.block.observations) < 10.0
