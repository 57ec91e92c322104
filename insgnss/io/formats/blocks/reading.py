"""Image blocks of any readable program: names and first bytes tell the format."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ....base.errors import InputError, UsageError, near
from ....base.files import lines_of
from ..detect import head_of
from ..exports import function_at
from ..text.layout import decode, is_comment
from ..text.text import Source
from .colmap_model import PARTS
from .dbat import read_dbat
from .gcp_list import CRS_WORDS
from .ground_points import GroundTable
from .image_points import SPEC, ImagePoints, read_image_points
from .measured_block import MeasuredBlock, of_table
from .opensfm_model import INSIDE, RECONSTRUCTION, TRACKS, reconstruction_in

FORMATS: Mapping[str, tuple[str, tuple[str, ...], str]] = {
    "metashape": (
        "blocks.metashape_block:read_metashape_block",
        ("sigma_px", "chunk"),
        "Metashape (.psx, .psz, XML of cameras or markers)",
    ),
    "colmap": (
        "blocks.colmap_model:read_colmap_model",
        ("sigma_px",),
        "a directory with a COLMAP model",
    ),
    "opensfm": (
        "blocks.opensfm_model:read_opensfm_model",
        ("sigma_px",),
        f"{RECONSTRUCTION} of OpenSfM or OpenDroneMap",
    ),
    "gcp_list": (
        "blocks.gcp_list:read_gcp_list",
        ("sigma_px", "sigma_m"),
        "gcp_list.txt of OpenDroneMap",
    ),
    "bingo": (
        "blocks.bingo:read_bingo",
        ("sigma_px", "unit", "pixel_um", "width", "height"),
        "BINGO (blocks that end in -99)",
    ),
    "dbat": ("blocks.reading:read_dbat_block", (), "a script of DBAT"),
    "image_points": (
        "blocks.reading:read_table_block",
        ("sigma_px", "columns"),
        "a table image, point, x, y",
    ),
}
"""Readers with their options, and what they read in a word."""
METASHAPE_PARTS = ("project", "chunk", "frame", "point_cloud")  # zips that a project is read from
COLMAP_FILE = re.compile(rf"({'|'.join(PARTS)})\.(txt|bin)")


def read_measured_block(path: Source, format: str = "auto", **options: Any) -> MeasuredBlock:
    """Read what a photogrammetry program knows of an image block.

    Parameters
    ----------
    path : path
        A file or directory of a program in `FORMATS`.
    format : str
        A key of `FORMATS`; "auto" tells it by names and first bytes.
    **options : object
        What the format takes: `sigma_px` (standard deviation where the file has none, pixels),
        `chunk` of Metashape, `sigma_m` of gcp_list, `unit`, `pixel_um`, `width` and `height` of
        BINGO, `columns` of a table. None is no option.

    Returns
    -------
    MeasuredBlock
        The block.

    Raises
    ------
    UsageError
        A format that is unknown, or an option that it does not take.
    InputError
        A file that none of the formats is, or that its reader refuses, with file and line.
    DataError
        An option whose value cannot be.
    """
    form = recognise_format(path) if format == "auto" else format
    if form not in FORMATS:
        raise UsageError(f"format {form!r} of image observations; {near(form, FORMATS)}")
    reader, accepted, _ = FORMATS[form]
    requested = {key: value for key, value in options.items() if value is not None}
    # a standard deviation stands in where a file has none; one that always has it needs none
    if "sigma_px" not in accepted:
        requested.pop("sigma_px", None)
    if extra := [key for key in requested if key not in accepted]:
        raise UsageError(
            f"{path}: is of the format {form}, which takes no {', '.join(extra)}; it takes"
            f" {', '.join(accepted) or 'no option'}"
        )
    block: MeasuredBlock = function_at(reader)(path, **requested)
    return block


def parts_of_block(path: Source) -> list[Path]:
    """List the files that a block is read from, where its path names one of several or a directory.

    Parameters
    ----------
    path : path
        The file or directory of an image block.

    Returns
    -------
    list of Path
        Files of a COLMAP model or of OpenSfM's directory, those of a Metashape project; else what
        the path names.
    """
    path = Path(path)
    folder = path if path.is_dir() else path.parent
    if path.is_dir() or COLMAP_FILE.fullmatch(path.name) or path.name == RECONSTRUCTION:
        model = [file for file in folder.iterdir() if COLMAP_FILE.fullmatch(file.name)]
        inner = [folder / sub / name for sub in (".", INSIDE) for name in (RECONSTRUCTION, TRACKS)]
        return sorted({path, *model, *inner})
    if path.suffix.lower() == ".psx":
        zips = path.with_suffix(".files").rglob("*.zip")
        return [path, *sorted(file for file in zips if file.stem in METASHAPE_PARTS)]
    return [path]


def recognise_format(path: Source) -> str:
    """Return the format of a file or directory.

    Parameters
    ----------
    path : path
        The file or directory.

    Returns
    -------
    str
        A key of `FORMATS`.

    Raises
    ------
    InputError
        None of them.
    """
    path = Path(path)
    if path.is_dir():
        if any((path / f"cameras{kind}").is_file() for kind in (".txt", ".bin")):
            return "colmap"
        if reconstruction_in(path) is not None:
            return "opensfm"
        raise _unrecognised_error(path)
    head = head_of(path)
    if not head:
        raise InputError.in_file(path, "is empty; export the image observations again")
    text = decode(head).lstrip()
    if head.startswith(b"PK\x03\x04") or path.suffix.lower() in (".psx", ".psz"):
        return "metashape"
    if COLMAP_FILE.fullmatch(path.name):
        return "colmap"
    if text.startswith("<"):
        if "dbat_script_version" in text:
            return "dbat"
        if re.search(r"<(document|chunk)\b", text):
            return "metashape"
        raise _unrecognised_error(path)
    if text.startswith(("[", "{")) and '"' in text:
        return "opensfm"
    rows = [row for row in lines_of(text) if row.strip() and not is_comment(row)]
    if rows and rows[0].strip().upper().startswith(CRS_WORDS):
        return "gcp_list"
    if any(row.split()[0] == "-99" for row in rows):
        return "bingo"
    if rows and _is_header(rows[0]):
        return "image_points"
    if "\0" not in text and any(len(re.split(r"[\s,;]+", row.strip())) >= 4 for row in rows):
        return "image_points"
    raise _unrecognised_error(path)


def _is_header(row: str) -> bool:
    """Whether a line is the header of a table of image observations, in part at least."""
    names = {SPEC.aliases.get(name.strip().lower()) for name in re.split(r"[\s,;]+", row)}
    return {"image", "point"} <= names


def _unrecognised_error(path: Path) -> InputError:
    readable = "; ".join(word for _, _, word in FORMATS.values())
    return InputError.in_file(
        path, f"is not recognised as image observations; readable are {readable}"
    )


def read_table_block(path: Source, **options: Any) -> MeasuredBlock:
    """Read a plain table of image observations as a block.

    Parameters
    ----------
    path : path
        The file.
    **options : object
        As of `read_image_points`.

    Returns
    -------
    MeasuredBlock
        The observations; without cameras, poses and ground points.
    """
    return of_table(read_image_points(path, **options))


def read_dbat_block(path: Source) -> MeasuredBlock:
    """Read a script of DBAT as a block; its datum is left out.

    Parameters
    ----------
    path : path
        The script.

    Returns
    -------
    MeasuredBlock
        The block, with poses in the axes of its ground points.
    """
    block = read_dbat(path)
    groups = (block.control, block.check)
    ground = None
    if any(len(points) for points in groups):
        ground = GroundTable(
            tuple(block.points[p] for points in groups for p in points.point),
            np.concatenate([points.position_m for points in groups]),
            np.concatenate([points.cov for points in groups]),
            np.repeat([False, True], [len(points) for points in groups]),
        )
    return MeasuredBlock(
        block.cameras,
        block.camera,
        ImagePoints(block.images, block.points, block.observations),
        block.position_m,
        block.C_mc,
        ground,
        local=ground is None,
        free_stated=True,
        held=block.held if block.held.any() else None,
    )
