"""Cameras with Brown's distortion as TOML, data_specs/camera_toml.md."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ....base.errors import InputError, near
from ....base.files import atomic_write
from ....base.inputs import is_file
from ....base.tables import OptionTable, read_toml
from ....base.wording import toml
from ....records.block import INTERIOR, RADIAL_MODELS, BrownCamera, InteriorCovariance
from ..text.numbers import array_of
from ..text.text import Source

PIXEL_ORIGINS = ("corner", "centre")
_TOP_KEYS = ("name", "model", "width", "height", "unit_px", "pixel_origin", *INTERIOR, "free")
CAMERA_KEYS: Mapping[str, tuple[str, ...]] = {
    "": (*_TOP_KEYS, "sigma", "correlations"),
    "sigma": INTERIOR,
}
LARGEST_PX = 1e6  # of a value in pixels: no camera has so many


def read_camera_toml(path: Source) -> BrownCamera:
    """Read a camera.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    BrownCamera
        The camera; parameters that the file does not name are zero.

    Raises
    ------
    InputError
        A key that is unknown or missing, or a value that cannot be, with file and line.
    """
    path = Path(path)
    if not is_file(path):
        raise InputError.in_file(path, "no such file; check the path of the camera")
    table = read_toml(path, CAMERA_KEYS)
    table.check_keys()
    if "model" not in table.data:
        raise table.error(
            "model", f"is missing; it is {' or '.join(RADIAL_MODELS)}, and has no default"
        )
    model = table.choice("model", RADIAL_MODELS, "")
    backward = model == "backward"
    width, height = _whole(table, "width"), _whole(table, "height")
    f = _positive(table, "f")
    further = [
        table.number(name, ..., -LARGEST_PX, LARGEST_PX)
        if name in ("cx", "cy")
        else table.number(name, 0.0)
        for name in INTERIOR[1:]
    ]
    interior = np.array([f, *further])
    if table.choice("pixel_origin", PIXEL_ORIGINS, PIXEL_ORIGINS[0]) == "centre":
        interior[1:3] += 0.5
    if not backward and "unit_px" in table.data:
        raise table.error(
            "unit_px", "belongs to backward cameras, and this camera is forward; leave unit_px out"
        )
    if backward and "unit_px" not in table.data:
        raise table.error(
            "unit_px", "is missing; give the unit of the backward camera's lengths in pixels"
        )
    unit = _positive(table, "unit_px") if backward else 1.0
    free = table.texts("free", ())
    for name in free:
        if name not in INTERIOR or free.count(name) > 1:
            raise table.error("free", f"{name!r} is unknown or given twice; {near(name, INTERIOR)}")
    name = table.text("name", path.stem)
    return BrownCamera(name, width, height, interior, backward, unit, free, model == "fisheye")


def read_camera_covariance(path: Source) -> InteriorCovariance | None:
    """Read the covariance of a camera's interior orientation.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    InteriorCovariance or None
        The covariance; None where the file has no table [sigma], or is of another program.

    Raises
    ------
    InputError
        A standard deviation that is not positive, or correlations that cannot be, with file and
        line.
    """
    if Path(path).suffix.lower() != ".toml":
        return None
    table = read_toml(Path(path), CAMERA_KEYS)
    if "sigma" not in table.data:
        return None
    sigmas = table.table("sigma")
    names = tuple(name for name in INTERIOR if name in sigmas.data)
    sigma = np.array([sigmas.number(name, ..., -LARGEST_PX, LARGEST_PX) for name in names])
    for name, value in zip(names, sigma, strict=True):
        if not value > 0.0:
            raise sigmas.error(name, f"{value:g}; a standard deviation must be greater than zero")
    rows = table.value("correlations", list, np.eye(len(names)).tolist())
    try:
        rho = array_of(rows, (len(names),) * 2)
        if rho is None or np.abs(rho - rho.T).max(initial=0.0) > 1e-9:
            raise ValueError
        return InteriorCovariance(names, rho * sigma * sigma[:, None])
    except (ValueError, InputError):
        raise table.error(
            "correlations",
            f"expected {len(names)} rows of as many numbers, symmetric and positive definite, in"
            f" the order {', '.join(names)}",
        ) from None


def _positive(table: OptionTable, key: str) -> float:
    value = float(table.number(key, ..., 0.0, LARGEST_PX))
    if value == 0.0:
        raise table.error(key, "0 px; it must be greater than zero")
    return value


def _whole(table: OptionTable, key: str) -> int:
    value = _positive(table, key)
    if value != int(value):
        raise table.error(key, f"{value:g} px; it is a whole number")
    return int(value)


def write_camera_toml(
    camera: BrownCamera, path: Source, covariance: InteriorCovariance | None = None
) -> None:
    """Write a camera; its numbers read back bit by bit.

    Parameters
    ----------
    camera : BrownCamera
        The camera.
    path : path
        The file, written whole or not at all.
    covariance : InteriorCovariance, optional
        Of its interior orientation.

    Raises
    ------
    UsageError
        The file cannot be written.
    """
    rows = [
        "# pixels from the outer corner of the upper left one, x right, y down: its centre is (0.5,"
        " 0.5)",
        f"name = {toml(camera.name)}",
        f'model = "{camera.model}"',
        f"width = {camera.width}",
        f"height = {camera.height}",
        *([f"unit_px = {camera.unit_px!r}"] if camera.backward else []),
        *(f"{name} = {camera.of(name)!r}" for name in INTERIOR),
        f"free = {toml(camera.free)}",
    ]
    if covariance is not None and covariance.parameters:
        sigma = np.sqrt(np.diagonal(covariance.cov))
        rho = covariance.cov / sigma / sigma[:, None]
        rho[np.diag_indices(len(sigma))] = 1.0
        lines = ",\n  ".join(f"[{', '.join(f'{x:.12g}' for x in row)}]" for row in rho)
        rows += [
            "# correlations in the order of [sigma]",
            f"correlations = [\n  {lines},\n]",
            "[sigma]",
            *(
                f"{name} = {float(s)!r}"
                for name, s in zip(covariance.parameters, sigma, strict=True)
            ),
        ]
    atomic_write(path, "\n".join(rows) + "\n")
