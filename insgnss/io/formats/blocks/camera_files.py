"""Cameras as other programs read them, data_specs/camera_files.md.

    metashape    <calibration>, c_x and c_y from the image's centre, P_1 with r^2 + 2 x^2
    colmap       cameras.txt, OPENCV, FULL_OPENCV or a fisheye, pixels from the first one's corner
    opencv       YAML of cv::FileStorage, pixels from the centre of the first one
    opensfm      cameras.json of OpenDroneMap and WebODM, lengths in the longer side

In the last three p_2 belongs to r^2 + 2 x^2, with no skew b_2; k_4 is of fisheyes alone. What a
program cannot express is left out where it moves no pixel of the image by more than `EXACT_PX`, and
said; else the camera is refused. The same limit holds for a backward camera, which a forward one is
fitted to: on a grid over the image, by Gauss-Newton steps on (J.4) with the rays of (J.5).
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from xml.sax.saxutils import escape

import numpy as np

from ....base.errors import InputError, UsageError, near
from ....base.files import atomic_write
from ....records.block import INTERIOR, Array, BrownCamera, InteriorCovariance
from ..bundle.camera import BROWN_NAMES, FISHEYE_NAMES
from ..text.text import Source

EXACT_PX = 0.01  # of an image point: a tenth of what is measured
# shift of pixels (px): what is left out because a program has no place for it moves less
LOST_PX = 0.1
GRID = 25  # points to a side of the image: two cameras are compared there (chosen)
MOST_CAMERA_STEPS = 20  # of Gauss and Newton: a camera that needs more is not expressed (chosen)
# parameters that a program has no place for, by its format and whether the camera is a fisheye
NOT_HELD: dict[tuple[str, bool], tuple[str, ...]]
NOT_HELD = {(form, False): ("b2", "k4") for form in ("colmap", "opencv", "opensfm")}
NOT_HELD |= {(form, True): ("b2", "p1", "p2") for form in ("opencv", "opensfm")}
NOT_HELD |= {("colmap", True): ("b2",)}
Covariances = Sequence[InteriorCovariance | None]
Text = Callable[[Sequence[BrownCamera], Covariances], str]


def write_cameras(
    cameras: Sequence[BrownCamera],
    path: Source,
    form: str = "colmap",
    covariances: Covariances = (),
) -> tuple[str, ...]:
    """Write cameras for another program.

    Parameters
    ----------
    cameras : sequence of BrownCamera
        The cameras; COLMAP's file takes several, the others one.
    path : path
        The file, written whole or not at all.
    form : str
        A key of `CAMERA_FORMS`.
    covariances : sequence of InteriorCovariance or None, optional
        Of each camera; those of backward cameras, which another polynomial stands for, are not
        written.

    Returns
    -------
    tuple of str
        What the file does not express, with the pixels that it moves, in sentences.

    Raises
    ------
    UsageError
        A format that is unknown, another number of cameras than the file takes, or a file that
        cannot be written.
    InputError
        A camera that the program cannot express to `EXACT_PX`.
    """
    if form not in CAMERA_FORMS:
        raise UsageError(f"cameras as {form!r}; {near(form, CAMERA_FORMS)}")
    if not cameras or (len(cameras) > 1 and form != "colmap"):
        raise UsageError(
            f"{path}: {len(cameras)} cameras; a file of {form} holds one: write each by itself"
        )
    notes: list[str] = []
    ready = [
        _without_lacking_parameters(_forward(camera, form, notes), form, notes)
        for camera in cameras
    ]
    stated = covariances or [None] * len(cameras)
    written = [None if c.backward else P for c, P in zip(cameras, stated, strict=True)]
    atomic_write(path, CAMERA_FORMS[form](ready, written))
    return tuple(notes)


def _without_lacking_parameters(camera: BrownCamera, form: str, notes: list[str]) -> BrownCamera:
    """Return a camera without the parameters that a program lacks, if they are next to nothing."""
    lacking = [k for k in NOT_HELD.get((form, camera.fisheye), ()) if camera.of(k) != 0.0]
    if not lacking:
        return camera
    without = camera.with_([0.0 if k in lacking else camera.of(k) for k in INTERIOR])
    xy = _grid(camera)[1]
    moved = float(np.abs(_pixels(camera, xy) - _pixels(without, xy)).max())
    values = ", ".join(f"{k} = {camera.of(k):g}" for k in lacking)
    if moved > LOST_PX:
        raise InputError(
            f"camera {camera.name}: {form} cannot hold {values}, and leaving this out moves pixels"
            f" by up to {moved:.3g} (limit {LOST_PX} px); calibrate with the value zero in the"
            " camera's file and not in camera.free, or write metashape or TOML"
        )
    notes.append(
        f"camera {camera.name}: {values} left out, which moves pixels by at most {moved:.2g} px"
    )
    return without


def _basis(xy: Array) -> Array:
    """Return dD/d(k1 .. k4, p1, p2) of (J.3), (n, 2, 6), on points (n, 2)."""
    x, y = xy.T
    r2 = x * x + y * y
    radial = np.stack([r2, r2**2, r2**3, r2**4], axis=1)[:, None, :] * xy[:, :, None]
    first = np.stack([r2 + 2.0 * x * x, 2.0 * x * y], axis=1)
    second = np.stack([2.0 * x * y, r2 + 2.0 * y * y], axis=1)
    return np.concatenate([radial, first[:, :, None], second[:, :, None]], axis=2)


def _distortion(camera: BrownCamera, xy: Array) -> Array:
    """D of (J.3), (n, 2)."""
    return np.asarray(xy + _basis(xy) @ camera.interior[5:])


def _pixels(camera: BrownCamera, xy: Array) -> Array:
    """Pixels (n, 2) of rays in a forward camera (J.4)."""
    f, cx, cy, b1, b2 = camera.interior[:5]
    x, y = _distortion(camera, xy).T
    return np.stack([cx + (f + b1) * x + b2 * y, cy + f * y], axis=1)


def _grid(camera: BrownCamera) -> tuple[Array, Array]:
    """Pixels (n, 2) over the image, and rays that land about there; of a backward camera exactly.

    Those of a forward camera are ideal points, which is enough to say how far terms of its
    polynomial move pixels.
    """
    axes = [np.linspace(0.0, size, GRID) for size in (camera.width, camera.height)]
    uv = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    f, cx, cy, b1, b2 = camera.interior[:5]
    m = uv - (cx, cy)
    if not camera.backward:
        return uv, m / f
    a = np.stack([(1.0 + b1) * m[:, 0] + b2 * m[:, 1], m[:, 1]], axis=1) / camera.unit_px
    return uv, camera.unit_px / f * _distortion(camera, a)


def _forward(camera: BrownCamera, form: str, notes: list[str]) -> BrownCamera:
    """Return a forward camera that sees what a backward one does, if a program has such a one."""
    if not camera.backward:
        return camera
    uv, xy = _grid(camera)
    mine = [k not in NOT_HELD.get((form, False), ()) for k in INTERIOR]
    fitted = replace(camera, interior=_start(camera) * mine, backward=False, unit_px=1.0)
    with np.errstate(all="ignore"):
        for _ in range(MOST_CAMERA_STEPS):
            J, e = _jacobian(fitted, xy)[:, mine], (uv - _pixels(fitted, xy)).ravel()
            step = np.zeros(len(INTERIOR))
            step[mine] = np.linalg.lstsq(J, e)[0]
            values = fitted.interior + step
            if not np.isfinite(values).all() or not values[0] > 0.0:
                break
            fitted = fitted.with_(values)
            if np.abs(step[:3]).max() < 1e-9:
                break
        misfit = float(np.abs(uv - _pixels(fitted, xy)).max())
    if not misfit <= EXACT_PX:
        raise InputError(
            f"camera {camera.name}: its model is backward (measured to ideal), and the best forward"
            f" polynomial differs by {misfit:.3g} px (limit {EXACT_PX} px); calibrate a forward"
            " camera, or write TOML"
        )
    notes.append(
        f"camera {camera.name}: written as a forward polynomial, which differs from the backward"
        f" one by at most {misfit:.2g} px"
    )
    return fitted


def _start(camera: BrownCamera) -> Array:
    """First values of the forward camera: the same geometry without distortion."""
    f, cx, cy, b1, b2 = camera.interior[:5]
    return np.array([f, cx, cy, f / (1.0 + b1) - f, -f * b2 / (1.0 + b1), *np.zeros(6)])


def _jacobian(camera: BrownCamera, xy: Array) -> Array:
    """Derivatives (2 n, 11) of the pixels by the interior orientation."""
    f, _, _, b1, b2 = camera.interior[:5]
    D, B = _distortion(camera, xy), _basis(xy)
    J = np.zeros((len(xy), 2, len(INTERIOR)))
    J[:, :, 0] = D
    J[:, 0, 1] = J[:, 1, 2] = 1.0
    J[:, 0, 3], J[:, 0, 4] = D[:, 0], D[:, 1]
    J[:, 0, 5:] = (f + b1) * B[:, 0] + b2 * B[:, 1]
    J[:, 1, 5:] = f * B[:, 1]
    return J.reshape(-1, len(INTERIOR))


def _metashape(cameras: Sequence[BrownCamera], covariances: Covariances) -> str:
    (camera,), (P,) = cameras, covariances
    centre = {"cx": 0.5 * camera.width, "cy": 0.5 * camera.height}
    values = {key: camera.of(key) - centre.get(key, 0.0) for key in INTERIOR}
    return "\n".join(
        [
            '<?xml version="1.0" encoding="UTF-8"?>',
            "<calibration>",
            f"  <projection>{'fisheye' if camera.fisheye else 'frame'}</projection>",
            f"  <width>{camera.width}</width>",
            f"  <height>{camera.height}</height>",
            *(f"  <{key}>{value!r}</{key}>" for key, value in values.items()),
            f"  <!-- {escape(camera.name).replace('--', '- -')} -->",
            *(_metashape_covariance(P) if P is not None else ()),
            "</calibration>\n",
        ]
    )


def _metashape_covariance(P: InteriorCovariance) -> list[str]:
    """Lines of the covariance, as a project of Metashape has it."""
    coefficients = " ".join(f"{value:.16e}" for value in P.cov.ravel())
    return [
        "  <covariance>",
        f"    <params>{' '.join(P.parameters)}</params>",
        f"    <coeffs>{coefficients}</coeffs>",
        "  </covariance>",
    ]


def _opencv_covariance(
    camera: BrownCamera, P: InteriorCovariance
) -> tuple[list[str], Array, Array]:
    """Return OpenCV's names of the parameters, their sigmas (d,) and correlations (d, d)."""
    names = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", *("k4",) * camera.fisheye)
    source = {"fx": ("f", "b1"), "fy": ("f",), "p1": ("p2",), "p2": ("p1",)}
    M = np.zeros((len(names), len(INTERIOR)))
    for row, name in enumerate(names):
        for parameter in source.get(name, (name,)):
            M[row, INTERIOR.index(parameter)] = 1.0
    cov = M @ P.whole @ M.T
    rows = np.flatnonzero(np.diagonal(cov) > 0.0)
    sigma = np.sqrt(np.diagonal(cov)[rows])
    rho = cov[np.ix_(rows, rows)] / sigma / sigma[:, None]
    return [names[k] for k in rows], sigma, rho


def _opencv_values(camera: BrownCamera) -> dict[str, float]:
    """Parameters of OpenCV's model by its names; pixels from the outer corner of the first one."""
    keys = ("cx", "cy", "k1", "k2", "k3", *("k4",) * camera.fisheye)
    values = {key: camera.of(key) for key in keys}
    focal = {"fx": camera.of("f") + camera.of("b1"), "fy": camera.of("f")}
    return values | focal | {"p1": camera.of("p2"), "p2": camera.of("p1")}


def _distortion_keys(camera: BrownCamera) -> tuple[str, ...]:
    return ("k1", "k2", "k3", "k4") if camera.fisheye else ("k1", "k2", "p1", "p2", "k3")


def colmap_words(camera: BrownCamera) -> str:
    """Return a camera as exports take it: model, width, height, parameters.

    Parameters
    ----------
    camera : BrownCamera
        The camera.

    Returns
    -------
    str
        Words of COLMAP's cameras.txt, without the number.

    Raises
    ------
    InputError
        A camera that COLMAP cannot express.
    """
    ready = _without_lacking_parameters(_forward(camera, "colmap", []), "colmap", [])
    return _colmap([ready], [None]).splitlines()[-1].partition(" ")[2]


def _colmap(cameras: Sequence[BrownCamera], covariances: Covariances) -> str:
    rows = ["# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]"]
    for k, (camera, P) in enumerate(zip(cameras, covariances, strict=True), start=1):
        if P is not None:
            names, sigma, rho = _opencv_covariance(camera, P)
            sigmas = ", ".join(f"{name} {s:.6g}" for name, s in zip(names, sigma, strict=True))
            rows.append(f"# sigmas of camera {k}: {sigmas}")
            rows += [
                f"# correlations of {name}: {' '.join(f'{x:+.4f}' for x in row)}"
                for name, row in zip(names, rho, strict=True)
            ]
        value = _opencv_values(camera)
        model = "FULL_OPENCV" if value["k3"] else "OPENCV"
        if camera.fisheye:
            thin_prism = value["p1"] or value["p2"]
            model = "THIN_PRISM_FISHEYE" if thin_prism else "OPENCV_FISHEYE"
        keys = (BROWN_NAMES | FISHEYE_NAMES)[model]
        parameters = " ".join(f"{value.get(key, 0.0)!r}" for key in keys)
        rows.append(f"{k} {model} {camera.width} {camera.height} {parameters}")
    return "\n".join(rows) + "\n"


def _opencv(cameras: Sequence[BrownCamera], covariances: Covariances) -> str:
    (camera,), (P,) = cameras, covariances
    v = _opencv_values(camera)
    K = (v["fx"], 0.0, v["cx"] - 0.5, 0.0, v["fy"], v["cy"] - 0.5, 0.0, 0.0, 1.0)
    keys = _distortion_keys(camera)
    matrices: dict[str, tuple[int, int, Sequence[float]]] = {
        "camera_matrix": (3, 3, K),
        "distortion_coefficients": (len(keys), 1, [v[key] for key in keys]),
    }
    names: list[str] = []
    if P is not None:
        names, sigma, rho = _opencv_covariance(camera, P)
        d = len(names)
        matrices |= {
            "standard_deviations": (d, 1, sigma.tolist()),
            "correlations": (d, d, rho.ravel().tolist()),
        }
    rows = ["%YAML:1.0", "---", f"image_width: {camera.width}", f"image_height: {camera.height}"]
    rows += ["distortion_model: equidistant"] if camera.fisheye else []
    for key, (height, width, values) in matrices.items():
        data = ", ".join(f"{value!r}" for value in map(float, values))
        rows += [f"{key}: !!opencv-matrix", f"   rows: {height}", f"   cols: {width}", "   dt: d"]
        rows.append(f"   data: [ {data} ]")
    if names:
        quoted = ", ".join(f'"{name}"' for name in names)
        rows.append(f"standard_deviations_of: [ {quoted} ]")
    return "\n".join(rows) + "\n"


def _opensfm(cameras: Sequence[BrownCamera], _: Covariances) -> str:
    (camera,) = cameras
    size, v = max(camera.width, camera.height), _opencv_values(camera)
    kind = "fisheye_opencv" if camera.fisheye else "brown"
    entry = {"projection_type": kind, "width": camera.width, "height": camera.height}
    entry |= {"focal_x": v["fx"] / size, "focal_y": v["fy"] / size}
    entry |= {"c_x": (2.0 * v["cx"] - camera.width) / (2.0 * size)}
    entry |= {"c_y": (2.0 * v["cy"] - camera.height) / (2.0 * size)}
    entry |= {key: v[key] for key in _distortion_keys(camera)}
    return json.dumps({camera.name: entry}, indent=2) + "\n"


CAMERA_FORMS: Mapping[str, Text] = {
    "metashape": _metashape,
    "colmap": _colmap,
    "opencv": _opencv,
    "opensfm": _opensfm,
}
