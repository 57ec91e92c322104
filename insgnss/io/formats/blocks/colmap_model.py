"""COLMAP models, text and binary, through pycolmap, data_specs/colmap_model.md.

The program's cameras are forward ones, their pixels count from the outer corner of the first, its
camera axes are x right, y down, z viewing direction: as here. Its tangential coefficients have
OpenCV's order: the second belongs to r^2 + 2 x^2.
"""

from pathlib import Path
from typing import Any

import numpy as np

from ....base.errors import InputError, legible, required_library
from ....base.files import lines_of
from ....base.units import LARGEST_UNIT, spells_zero
from ....base.wording import DOCTOR
from ....records.block import Array, BrownCamera
from ..bundle.camera import (
    BROWN_NAMES,
    FISHEYE_NAMES,
    PARAMETER_NAMES,
    ColmapCamera,
    brown_camera,
    of_opencv,
)
from ..text.layout import decode, quote
from ..text.numbers import PLAIN, finite
from ..text.text import Source, load_bytes
from .image_points import SIGMA_PX, positive_sigma
from .measured_block import MeasuredBlock, file_names, image_points, no_poses

PARTS = ("cameras", "images", "points3D")
SIGNS = set("0123456789+-.eE \t\r")  # of numbers in a line of image points


def read_colmap_model(path: Source, sigma_px: float = SIGMA_PX) -> MeasuredBlock:
    """Read a model.

    Parameters
    ----------
    path : path
        Its directory, or one of its files.
    sigma_px : float
        Standard deviation of all image observations, pixels: a model has none.

    Returns
    -------
    MeasuredBlock
        The block in axes of the model's own. Points go by their numbers; image points without
        object point are left out.

    Raises
    ------
    UsageError
        pycolmap is not installed.
    InputError
        A directory without model, a model that pycolmap does not read, a camera model that is none
        of Brown's.
    DataError
        A `sigma_px` that is not positive.
    """
    positive_sigma(sigma_px, "COLMAP model")
    model = _model(Path(path))
    cameras = [
        brown_of(
            path,
            str(number),
            ColmapCamera(
                camera.model.name,
                int(camera.width),
                int(camera.height),
                tuple(map(float, camera.params)),
            ),
        )
        for number, camera in sorted(model.cameras.items())
    ]
    row_by_camera = {number: k for k, number in enumerate(sorted(model.cameras))}
    images = [model.images[number] for number in sorted(model.images)]
    names = file_names([image.name for image in images], path)
    position, C_mc = no_poses(len(images))
    image_row, point, uv = [], [], []
    for k, image in enumerate(images):
        if image.has_pose:
            pose = image.cam_from_world()
            C_mc[k] = pose.rotation.matrix().T
            position[k] = -C_mc[k] @ pose.translation
        measured_points = image.get_observation_points2D()
        image_row += [k] * len(measured_points)
        point += [str(p.point3D_id) for p in measured_points]
        uv += [p.xy for p in measured_points]
    measured, notes = image_points(names, image_row, point, uv, np.full(len(image_row), sigma_px))
    camera = np.array([row_by_camera[image.camera_id] for image in images], dtype=np.int64)
    return MeasuredBlock(tuple(cameras), camera, measured, position, C_mc, notes=notes)


def read_colmap_poses(path: Source) -> tuple[tuple[str, ...], Array, Array]:
    """Read the poses of a model, whatever its camera models.

    Parameters
    ----------
    path : path
        Its directory, or one of its files.

    Returns
    -------
    images : tuple of str
        (n,) names of the images that have a pose.
    position : ndarray, (n, 3)
        Projection centres in the axes of the model.
    C : ndarray, (n, 3, 3)
        Camera (x right, y down, z viewing direction) to these axes.

    Raises
    ------
    UsageError
        pycolmap is not installed.
    InputError
        A directory without model, or a model that pycolmap does not read.
    """
    model = _model(Path(path))
    images = [model.images[number] for number in sorted(model.images)]
    images = [image for image in images if image.has_pose]
    poses = [image.cam_from_world() for image in images]
    C = np.array([pose.rotation.matrix().T for pose in poses]).reshape(-1, 3, 3)
    T = np.array([pose.translation for pose in poses]).reshape(-1, 3, 1)
    return tuple(image.name for image in images), -(C @ T)[:, :, 0], C


def _model(path: Path) -> Any:
    """Return the reconstruction that pycolmap reads."""
    with required_library(
        "a COLMAP model is read through pycolmap, which is not installed; pip install"
        f" 'insgnss[colmap]', or write the image points as a table; {DOCTOR}"
    ):
        import pycolmap
    directory = path if path.is_dir() else path.parent
    kinds = [
        kind for kind in (".bin", ".txt") if all((directory / (p + kind)).is_file() for p in PARTS)
    ]
    if not kinds:
        raise InputError.in_file(
            directory,
            f"holds no COLMAP model ({', '.join(PARTS)}, all .bin or all .txt); give the directory"
            " that does, such as sparse/0",
        )
    if kinds[0] == ".txt":
        _refuse_text(directory)
    damaged = "pycolmap does not read this model: {}; write it again from COLMAP"
    with legible(directory, damaged, MemoryError):
        model = pycolmap.Reconstruction(str(directory))
        _ = [image.name for image in model.images.values()]  # which must be UTF-8
        return model


def _refuse_text(directory: Path) -> None:
    """Refuse lines with what is no number: pycolmap takes 5% for 5, and a missing one for others'.

    In images.txt a line of an image is followed by that of its image points.
    """
    for name in ("cameras.txt", "images.txt"):
        below, path = False, directory / name
        data = load_bytes(path).tobytes() if path.stat().st_size else b""
        for line, text in enumerate(lines_of(decode(data)), start=1):
            if not below and (not text.strip() or text.lstrip().startswith("#")):
                continue
            fields = text.split() if below or name == "cameras.txt" else text.split(maxsplit=9)
            if below:
                good = len(fields) % 3 == 0 and _spells_numbers(text, fields)
            elif name == "images.txt":
                good = len(fields) == 10 and not np.isnan([*map(finite, fields[:9])]).any()
                good = good and fields[0].isdigit() and fields[8].isdigit()
            else:
                names = PARAMETER_NAMES.get(fields[1] if len(fields) > 1 else "")
                count = len(fields) - 4 if names is None else len(names)
                values = [finite(word) for word in (*fields[:1], *fields[2:])]
                good = len(fields) == 4 + max(0, count) and not np.isnan(values).any()
                good = good and all(fields[k].isdigit() for k in (0, 2, 3))
            below = name == "images.txt" and not below
            if not good:
                problem = f"{quote(text)}: a field is missing or is no number"
                raise InputError.at_line(path, line, f"{problem}; {PLAIN}")


def _spells_numbers(text: str, fields: list[str]) -> bool:
    """Whether all words of a line are numbers, by `float`, which is quick, and their signs.

    Each third is the whole number of a point.
    """
    try:
        values, _ = [*map(float, fields)], [*map(int, fields[2::3])]
    except ValueError:
        return False
    pairs = zip(fields, values, strict=True) if 0.0 in values else ()
    zeros = all(spells_zero(word) for word, x in pairs if x == 0.0)
    return zeros and set(text) <= SIGNS and max(map(abs, values), default=0.0) < LARGEST_UNIT


def brown_of(path: Source, name: str, camera: ColmapCamera) -> BrownCamera:
    """Return a camera of COLMAP whose model is Brown's, or a part of it, or a fisheye's.

    Parameters
    ----------
    path : path
        Its file, for the message.
    name : str
        Its name.
    camera : ColmapCamera
        Model, size and parameters.

    Returns
    -------
    BrownCamera
        The same.

    Raises
    ------
    InputError
        Another model, a rational polynomial or a thin prism.
    """
    model = camera.model
    fisheye = model in FISHEYE_NAMES
    if not fisheye and model not in BROWN_NAMES:
        raise InputError.in_file(
            path,
            f"camera {name}: model {model} is not Brown's; reconstruct with one of"
            f" {', '.join((*BROWN_NAMES, *FISHEYE_NAMES))}",
        )
    value = camera.values
    if value.pop("sx1", 0.0) or value.pop("sy1", 0.0):
        problem = (
            f"camera {name}: {model} with thin-prism terms (sx1 or sy1 not zero) cannot be read"
        )
        raise InputError.in_file(path, f"{problem}; reconstruct with OPENCV_FISHEYE")
    unlike = () if fisheye else ("k4", "k5", "k6")
    if rational := [name for name in unlike if value.pop(name, 0.0) != 0.0]:
        raise InputError.in_file(
            path,
            f"camera {name}: {model} with a rational polynomial ({', '.join(rational)} not zero)"
            " cannot be read; reconstruct with OPENCV, or hold k4, k5, k6 at zero",
        )
    return brown_camera(name, camera.width, camera.height, of_opencv(value), fisheye)
