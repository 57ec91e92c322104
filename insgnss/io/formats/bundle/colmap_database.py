"""What a database of COLMAP calls its images, cameras, rigs and frames, data_specs/colmap.md.

A model with known poses belongs to a database by these numbers: the program triangulates points by
the image's number, and takes the camera by its own. Databases are SQLite files, their parameters
little endian doubles; those older than COLMAP 3.12 know neither rigs nor frames.
"""

import sqlite3
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ....base.errors import InputError, UsageError
from ..text.database import opened_database
from ..text.layout import quote
from ..text.text import Source
from .camera import PARAMETER_NAMES, ColmapCamera

COLMAP_MODELS = (
    *("SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "OPENCV_FISHEYE"),
    *("FULL_OPENCV", "FOV", "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE", "THIN_PRISM_FISHEYE"),
    *("RAD_TAN_THIN_PRISM_FISHEYE", "SIMPLE_DIVISION", "DIVISION", "SIMPLE_FISHEYE", "FISHEYE"),
    *("EUCM", "EQUIRECTANGULAR"),
)
"""Camera models of COLMAP by their number."""
WITH_RIGS = ("rigs", "rig_sensors", "frames", "frame_data")
DATABASE_TABLES = ("images", "cameras", *WITH_RIGS)
DATABASE_KIND = "database of COLMAP; give its database.db"


@dataclass(frozen=True)
class DatabaseImage:
    """One image of a database.

    Parameters
    ----------
    number, camera : int
        Its number and that of its camera.
    name : str
        Its name there, perhaps with folders.
    rig, frame : int or None
        Those that it stands in alone; None where the database has none.
    """

    number: int
    camera: int
    name: str
    rig: int | None = None
    frame: int | None = None


@dataclass(frozen=True)
class ColmapDatabase:
    """Images by the names of an exterior orientation, and cameras by their numbers.

    Parameters
    ----------
    images : tuple of DatabaseImage
        In the order of the orientation.
    cameras : dict
        Cameras of these images by number.
    rows : tuple of int
        Which images of the orientation these are.
    """

    images: tuple[DatabaseImage, ...]
    cameras: dict[int, ColmapCamera]
    rows: tuple[int, ...]


def read_colmap_database(path: Source, images: Sequence[str], skip: bool = False) -> ColmapDatabase:
    """Read the numbers of images and their cameras; the file stays as it is.

    Parameters
    ----------
    path : path
        The database.
    images : sequence of str
        Names of the images; those of the database may have folders before them.
    skip : bool
        Whether images that the database lacks are left out.

    Returns
    -------
    ColmapDatabase
        The images and their cameras.

    Raises
    ------
    InputError
        No database of COLMAP, an image that it lacks, or a camera that is damaged.
    UsageError
        Images in a rig of several cameras.
    """
    with opened_database(path, DATABASE_TABLES, DATABASE_KIND) as connection:
        stored = {
            _text(path, name): (_integer(path, number), _integer(path, camera))
            for number, name, camera in connection.execute(
                "SELECT image_id, name, camera_id FROM images"
            )
        }
        frames = _frames(path, connection)
        rows = connection.execute("SELECT camera_id, model, width, height, params FROM cameras")
        stored_cameras = {_integer(path, row[0]): row[1:] for row in rows}
    chosen = []
    names = names_in_database(images, tuple(stored), path, skip)
    for name in names.values():
        number, camera = stored[name]
        rig, frame, count = frames.get(number, (None, None, 1))
        if count > 1:
            raise UsageError(
                f"{path}: image {quote(name)} belongs to a rig of several cameras, whose poses"
                " COLMAP takes from the rig; give a database without rigs"
            )
        if frames and frame is None:
            raise InputError.in_file(
                path,
                f"image {quote(name)} belongs to no frame of the database; extract features again",
            )
        chosen.append(DatabaseImage(number, camera, name, rig, frame))
    used = sorted({image.camera for image in chosen})
    cameras = {k: _camera(path, k, stored_cameras.get(k)) for k in used}
    return ColmapDatabase(tuple(chosen), cameras, tuple(names))


def names_in_database(
    images: Sequence[str], names: Sequence[str], path: object, skip: bool = False
) -> dict[int, str]:
    """Return the names that images have in a database, where these may have folders before them.

    Parameters
    ----------
    images : sequence of str
        Names to look for.
    names : sequence of str
        Those of the database.
    path : path
        The database, for the message.
    skip : bool
        Whether images that the database lacks are left out.

    Returns
    -------
    dict
        By the number of the image among `images`, from 0: the very name, or the only one that ends
        in it.

    Raises
    ------
    InputError
        Images that the database lacks, all of them where they are skipped, or that it has in
        several folders.
    """
    by_file: dict[str, list[str]] = {}
    for name in names:
        by_file.setdefault(name.replace("\\", "/").rpartition("/")[2], []).append(name)
    requested = set(names)
    choices = [[image] if image in requested else by_file.get(image, []) for image in images]
    missing = [image for image, matches in zip(images, choices, strict=True) if not matches]
    if missing and (not skip or len(missing) == len(images)):
        unused = sorted(requested - {matches[0] for matches in choices if matches})
        has = f"; it has {quote(unused[0])}" if unused else ""
        message = (
            f"has no image {missing[0]!r} ({len(missing)} of {len(images)} are missing){has}:"
            " rename our images as in the database (--rename OLD=NEW or a table), extract features"
            " of all images, or leave out what is missing (--set missing=skip)"
        )
        raise InputError.in_file(path, message)
    if doubles := [matches for matches in choices if len(matches) > 1]:
        message = (
            f"has {quote(doubles[0][0])} and {quote(doubles[0][1])}, and the orientation may mean"
            " either; name its images with their folders"
        )
        raise InputError.in_file(path, message)
    return {k: matches[0] for k, matches in enumerate(choices) if matches}


def _frames(path: Source, connection: sqlite3.Connection) -> dict[int, tuple[int, int, int]]:
    """Return rig, frame, and number of images of that frame and of sensors of that rig, by image.

    The number is the larger one. Databases without frames give none.
    """
    tables = {name for (name,) in connection.execute("SELECT name FROM sqlite_master")}
    if not tables.issuperset(WITH_RIGS):
        return {}
    images = "SELECT frame_id, COUNT(*) AS n FROM frame_data GROUP BY frame_id"
    sensors = "SELECT rig_id, COUNT(*) + 1 AS n FROM rig_sensors GROUP BY rig_id"
    query = (
        "SELECT d.data_id, f.rig_id, f.frame_id, MAX(i.n, COALESCE(s.n, 1)) FROM frame_data d"
        f" JOIN frames f ON f.frame_id = d.frame_id JOIN ({images}) i ON i.frame_id = f.frame_id"
        f" LEFT JOIN ({sensors}) s ON s.rig_id = f.rig_id WHERE d.sensor_type = 0"
    )
    return {
        _integer(path, image): (_integer(path, rig), _integer(path, frame), _integer(path, count))
        for image, rig, frame, count in connection.execute(query)
    }


def _integer(path: Source, value: Any) -> int:
    """Return a whole number; a table of SQLite may hold anything in its place."""
    if type(value) is not int:
        problem = f"{value!r:.60} in place of a whole number; create the database again"
        raise InputError.in_file(path, problem)
    return value


def _text(path: Source, value: Any) -> str:
    """Return the name of an image."""
    if not isinstance(value, str):
        problem = f"{value!r:.60} in place of an image name; create the database again"
        raise InputError.in_file(path, problem)
    return value


def _camera(path: Source, number: int, row: tuple[Any, ...] | None) -> ColmapCamera:
    """Return a camera of the database."""
    if row is None:
        raise InputError.in_file(path, f"has no camera {number}; extract features again")
    model, width, height, blob = row
    if type(model) is not int or not 0 <= model < len(COLMAP_MODELS):
        raise InputError.in_file(
            path, f"camera {number}: model {model!r:.60} is none of COLMAP's known here"
        )
    name, parameters = COLMAP_MODELS[model], np.full(1, np.nan)
    if isinstance(blob, bytes):
        count = len(PARAMETER_NAMES[name]) if name in PARAMETER_NAMES else len(blob) // 8
        parameters = np.frombuffer(blob, dtype="<f8") if len(blob) == 8 * count else parameters
    sizes = all(type(side) is int and side > 0 for side in (width, height))
    if not (sizes and np.isfinite(parameters).all()):
        problem = f"camera {number} ({name}, {width!r:.60} x {height!r:.60} pixels)"
        raise InputError.in_file(
            path, f"{problem}: size or parameters are no numbers; make the database anew"
        )
    return ColmapCamera(name, width, height, tuple(parameters.tolist()))
