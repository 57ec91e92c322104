"""COLMAP: the text model with known poses, and a database with pose priors, data_specs/colmap.md.

    images.txt    IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME: R = C_fc', the frame into the
                  camera; T = -R X
    pose prior    position, its full 3 x 3 covariance, gravity = C_Ec' (0, 0, -1): down, in the
                  camera's axes

The camera's axes are ours (x right, y down, z viewing direction). A prior has no place for the
heading, nor for the correlation of position and attitude. Coordinates beyond `SHIFTED_FROM_M` lose
digits in single precision: a shift is subtracted and said in the files. Numbers count from 1, or
are those of a database (`colmap_database`).
"""

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path, PurePath
from typing import Any, Literal

import numpy as np

from ....base.errors import InputError, UsageError, legible, required_library
from ....base.files import atomic_write
from ....base.inputs import readable
from ....base.output.staging import staged_path
from ....base.wording import DOCTOR
from ....geodesy.rotation import quaternion_from_rotation
from ....records import Array, FramedOrientation
from ....records.framed import GEOGRAPHIC
from ..orientation.ascii_columns import numbers_of
from ..orientation.exported import UnfitName, check_names, comment_lines, new_directory
from ..orientation.poses import vector
from ..text.database import opened_database
from ..text.text import Source
from .camera import ColmapCamera, camera_of, cameras_of
from .colmap_database import (
    DATABASE_KIND,
    DATABASE_TABLES,
    DatabaseImage,
    names_in_database,
    read_colmap_database,
)

# coordinates (m) from which a shift is subtracted: single precision has steps of 8 mm there
SHIFTED_FROM_M = 1e5
# shift of an axis (m) that is left out: single precision has steps of 1 mm there
LEAST_SHIFT_M = 1e4
# step of the shift (m): whole kilometres are read and typed without error (chosen)
SHIFT_STEP_M = 1e3
# quaternion to 1e-12, T to 1e-6 m: below any sigma
POSE_FORMAT = " ".join(["%.12f"] * 4 + ["%.6f"] * 3)
# COLMAP takes a binary model before a text
MODEL_FILES = ("cameras", "images", "points3D", "frames", "rigs")
Missing = Literal["refuse", "skip"]
NOT_ROWS = ("time", "coordinates", "C_fc", "C_fE", "cov", "geodetic")  # arrays of a row an image


def write_colmap(
    eo: FramedOrientation,
    path: Source,
    camera: str | None = None,
    shift: str | Sequence[float] | None = None,
    database: Source | None = None,
    missing: Missing = "refuse",
) -> tuple[str, ...]:
    """Write cameras.txt, images.txt and points3D.txt (empty) into the directory `path`.

    The directory is made where it is missing.

    Parameters
    ----------
    eo : FramedOrientation
        The orientation in a Cartesian frame.
    path : path
        The directory.
    camera : str
        "MODEL WIDTH HEIGHT PARAMETERS", COLMAP's notation, of a rig "NAME=MODEL ...; NAME=...";
        with `database` in the place of its cameras.
    shift : (3,) m, or text with commas
        Subtracted from the positions; by default whole kilometres where these exceed 100 km, else
        none.
    database : path, optional
        COLMAP's database, whose numbers and names of images, cameras, rigs and frames are taken,
        so that the model belongs to its features and matches; else images count from 1.
    missing : {"refuse", "skip"}
        What becomes of images that the database lacks.

    Returns
    -------
    tuple of str
        What to know: how many images were left out.

    Raises
    ------
    UsageError
        A frame that is not Cartesian, a missing camera, one of another kind or size than those of
        the database, or a `path` with another model (binary, or with rigs).
    InputError
        Names with blanks, or a database that lacks an image or cannot be read.
    """
    notes: tuple[str, ...] = ()
    if database is None:
        check_names(eo.images, None)
        names, number = eo.cameras
        images = tuple(
            DatabaseImage(k, int(row) + 1, name)
            for k, (row, name) in enumerate(zip(number, eo.images, strict=True), start=1)
        )
        cameras = dict(enumerate(cameras_of(camera, names, "colmap"), start=1))
    else:
        numbered = read_colmap_database(database, eo.images, missing == "skip")
        images, cameras = numbered.images, numbered.cameras
        eo, notes = _orientation_of_rows(eo, numbered.rows)
        _check_stored_names(images, database)
        if camera is not None:
            cameras = _set_camera_model(camera_of(camera, "colmap"), cameras, database)
    directory = Path(path)
    texts = _model_texts(eo, images, cameras, _shift(eo, shift))
    with new_directory(
        directory,
        tuple(texts),
        lambda file: PurePath(file).stem in MODEL_FILES and file.endswith((".txt", ".bin")),
        "a model",
    ) as into:
        for name, text in texts.items():
            atomic_write(into / name, text)
    return notes


def _orientation_of_rows(
    eo: FramedOrientation, rows: Sequence[int]
) -> tuple[FramedOrientation, tuple[str, ...]]:
    """Return the images `rows` of an orientation, and a note of those that are left out."""
    kept = set(rows)
    left_out = [name for k, name in enumerate(eo.images) if k not in kept]
    if not left_out:
        return eo, ()
    k = list(rows)
    chosen = replace(
        eo,
        images=tuple(eo.images[row] for row in k),
        cross=None,
        rig=None if eo.rig is None else eo.rig.taken(np.array(k)),
        **{name: getattr(eo, name)[k] for name in NOT_ROWS},
    )
    return chosen, (
        f"{len(left_out)} of {len(eo.images)} images are not in the database and were left out,"
        f" such as {left_out[0]}",
    )


def _check_stored_names(images: Sequence[DatabaseImage], database: Source) -> None:
    """Refuse names of a database that a text model cannot hold; only the files can be renamed."""
    try:
        check_names([image.name for image in images], None)
    except UnfitName as error:
        problem = (
            f"{error.problem}: rename the files of the images without blanks,"
            " extract their features again, and export with --rename safe"
        )
        raise InputError.in_file(database, problem) from None


def _set_camera_model(
    model: ColmapCamera, cameras: Mapping[int, ColmapCamera], database: Source
) -> dict[int, ColmapCamera]:
    """Return `model` in the place of all cameras of a database, of whose kind and size it is."""
    for number, saved in cameras.items():
        if (saved.width, saved.height) != (model.width, model.height):
            raise UsageError(
                f"colmap: camera is {model.width} x {model.height} px, camera {number} of"
                f" {database} {saved.width} x {saved.height}; give the camera of these images, or"
                " leave it out to use the cameras of the database"
            )
        if saved.model != model.model:
            raise UsageError(
                f"colmap: camera is a {model.model}, camera {number} of {database} a {saved.model},"
                f" and COLMAP takes no other; give it as {saved.model}, or extract features with"
                f" --ImageReader.camera_model {model.model}"
            )
    return dict.fromkeys(cameras, model)


def _model_texts(
    eo: FramedOrientation,
    images: Sequence[DatabaseImage],
    cameras: Mapping[int, ColmapCamera],
    offset: Array,
) -> dict[str, list[str]]:
    """Return the files of a model by name; with those of rigs and frames where images have them."""
    R = eo.C_fc.swapaxes(1, 2)
    T = -(R @ (eo.coordinates - offset)[:, :, None])[:, :, 0]
    table = np.column_stack([quaternion_from_rotation(R), T])
    poses = [POSE_FORMAT % tuple(row) for row in table.tolist()]
    subtracted = (
        f"shift: {offset[0]:.4f} {offset[1]:.4f} {offset[2]:.4f} m was subtracted from the"
        " positions"
    )
    comments = comment_lines(
        eo, subtracted, "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then a line of its points"
    )
    rows = [
        f"{image.number} {pose} {image.camera} {image.name}\n\n"
        for image, pose in zip(images, poses, strict=True)
    ]
    lines = [f"{number} {model.line}\n" for number, model in sorted(cameras.items())]
    texts = {
        "cameras.txt": ["# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n", *lines],
        "points3D.txt": ["# POINT3D_ID X Y Z R G B ERROR TRACK[]; none yet\n"],
        "images.txt": [comments, *rows],
    }
    if any(image.frame is not None for image in images):
        rigs = dict.fromkeys((image.rig, image.camera) for image in images)
        texts["rigs.txt"] = [
            "# RIG_ID NUM_SENSORS REF_SENSOR_TYPE REF_SENSOR_ID; each of one camera\n",
            *(f"{rig} 1 CAMERA {sensor}\n" for rig, sensor in rigs),
        ]
        texts["frames.txt"] = [
            "# FRAME_ID RIG_ID QW QX QY QZ TX TY TZ NUM_DATA_IDS, then CAMERA CAMERA_ID IMAGE_ID\n",
            *(
                f"{image.frame} {image.rig} {pose} 1 CAMERA {image.camera} {image.number}\n"
                for image, pose in zip(images, poses, strict=True)
            ),
        ]
    return texts


def _shift(eo: FramedOrientation, shift: str | Sequence[float] | None) -> Array:
    if shift is None:
        if not eo.images or np.abs(eo.coordinates).max() <= SHIFTED_FROM_M:
            return np.zeros(3)
        rounded_centre = np.round(eo.coordinates.mean(axis=0) / SHIFT_STEP_M) * SHIFT_STEP_M
        return np.where(np.abs(rounded_centre) > LEAST_SHIFT_M, rounded_centre, 0.0)
    return vector(shift, "shift")


def write_colmap_priors(
    eo: FramedOrientation,
    path: Source,
    camera: str | None = None,
    database: Source | None = None,
    shift: str | Sequence[float] | None = None,
    missing: Missing = "refuse",
) -> tuple[str, ...]:
    """Write pose priors through pycolmap into a new database, or into a copy of `database`.

    `database` stays as it is. In the copy, images are found by name, and their priors replaced.

    Parameters
    ----------
    eo : FramedOrientation
        The orientation in a Cartesian or geographic frame; geographic priors are latitude,
        longitude, height above the ellipsoid, covariances east, north, up.
    path : path
        The database to write.
    camera : str, optional
        Camera of a new database, in COLMAP's notation; of a rig as `write_colmap`.
    database : path, optional
        The database to copy.
    shift : (3,) m, or text with commas
        Subtracted from the positions, none by default, since a database cannot state it; a
        geographic frame takes none.
    missing : {"refuse", "skip"}
        What becomes of images that the database lacks.

    Returns
    -------
    tuple of str
        What to know: how many images were left out.

    Raises
    ------
    UsageError
        pycolmap is missing, or an option does not fit the frame.
    InputError
        The database lacks an image or cannot be read.
    """
    pycolmap = _pycolmap()
    if eo.frame.kind == GEOGRAPHIC and shift is not None:
        raise UsageError("shift: latitude and longitude are not shifted; leave it out")
    models = None
    notes: tuple[str, ...] = ()
    if database is None:
        models = cameras_of(camera, eo.cameras[0], "a new database of colmap_priors")
    with staged_path(path) as work:
        if database is not None:
            _copy(database, work)
        db = _open_database(pycolmap, work, database)
        try:
            if models is not None:
                ids = _new_images(pycolmap, db, eo, models)
            else:
                stored = _stored_images(db, eo, database, missing == "skip")
                eo, notes = _orientation_of_rows(eo, tuple(stored))
                ids = list(stored.values())
            _write_priors(pycolmap, db, eo, ids, shift)
        finally:
            db.close()
    return notes


def _pycolmap() -> Any:
    with required_library(
        "colmap_priors needs pycolmap, which is not installed; pip install pycolmap, or export"
        f" colmap; {DOCTOR}"
    ):
        import pycolmap
    return pycolmap


def _copy(database: Source, work: Path) -> None:
    """Copy a database whose tables are tables, which pycolmap does not ask for."""
    with opened_database(database, (*DATABASE_TABLES, "pose_priors"), DATABASE_KIND):
        pass
    with readable(database):
        shutil.copyfile(database, work)


def _open_database(pycolmap: Any, work: Path, database: Source | None) -> Any:
    with legible(database, "is no database of COLMAP: {}; give its database.db", MemoryError):
        return pycolmap.Database.open(work)


def _new_images(
    pycolmap: Any, db: Any, eo: FramedOrientation, models: Sequence[ColmapCamera]
) -> list[Any]:
    """Write cameras and images into a new database; return the data ids of the images."""
    camera_ids = []
    for model in models:
        camera = pycolmap.Camera(
            model=model.model, width=model.width, height=model.height, params=list(model.parameters)
        )
        camera.has_prior_focal_length = True
        camera_ids.append(db.write_camera(camera))
    ids = []
    with pycolmap.DatabaseTransaction(db):
        for name, row in zip(eo.images, eo.cameras[1], strict=True):
            image = pycolmap.Image(name=name, camera_id=camera_ids[row])
            image.image_id = db.write_image(image)
            ids.append(image.data_id)
    return ids


def _stored_images(
    db: Any, eo: FramedOrientation, database: Source | None, skip: bool
) -> dict[int, Any]:
    """Return the data ids of images in a database by their numbers in the orientation."""
    ids = {image.name: image.data_id for image in db.read_all_images()}
    names = names_in_database(eo.images, tuple(ids), database, skip)
    return {k: ids[name] for k, name in names.items()}


def _write_priors(
    pycolmap: Any,
    db: Any,
    eo: FramedOrientation,
    ids: list[Any],
    shift: str | Sequence[float] | None,
) -> None:
    system = pycolmap.PosePriorCoordinateSystem
    if eo.frame.kind == GEOGRAPHIC:
        position, kind = numbers_of(eo, "llh"), system.WGS84
    else:
        offset = np.zeros(3) if shift is None else _shift(eo, shift)
        position, kind = eo.coordinates - offset, system.CARTESIAN
    gravity = -eo.C_Ec[:, 2]
    earlier = {
        (p.corr_data_id.sensor_id.id, p.corr_data_id.id): p.pose_prior_id
        for p in db.read_all_pose_priors()
    }
    with pycolmap.DatabaseTransaction(db):
        for k, data_id in enumerate(ids):
            prior = pycolmap.PosePrior()
            prior.corr_data_id = data_id
            prior.position, prior.position_covariance = position[k], eo.cov[k, :3, :3]
            prior.gravity, prior.coordinate_system = gravity[k], kind
            prior_id = earlier.get((data_id.sensor_id.id, data_id.id))
            if prior_id is None:
                db.write_pose_prior(prior)
            else:
                prior.pose_prior_id = prior_id
                db.update_pose_prior(prior)
