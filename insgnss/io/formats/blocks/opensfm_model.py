"""Reconstructions of OpenSfM and OpenDroneMap with their tracks, data_specs/opensfm_model.md.

Lengths in the image count in units of the longer side from its centre, so that the origin of
pixels does not matter. Cameras are forward; the second tangential coefficient belongs to r^2 + 2
x^2. A shot has R and t, the camera (x right, y down, z viewing direction) from the reconstruction's
axes, X_c = R X + t: east, north, up at `reference_lla`.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....base.errors import InputError
from ....base.files import lines_of
from ....base.received.nesting import parse_json
from ....geodesy.frames import TangentPlane
from ....geodesy.rotation import rotation_from_vector
from ....records.block import Array, BrownCamera
from ..bundle.camera import brown_camera, of_opencv
from ..bundle.opensfm import REFERENCE
from ..text.layout import quote
from ..text.numbers import are_whole, array_of, vector_of, whole
from ..text.text import Source, check_fields, decode_text
from ..text.text import number as number_in
from .image_points import SIGMA_PX, positive_sigma
from .measured_block import MeasuredBlock, file_names, image_points, no_poses

RECONSTRUCTION, TRACKS, INSIDE = "reconstruction.json", "tracks.csv", "opensfm"
TRACKS_VERSION = "OPENSFM_TRACKS_VERSION_v"
TRACK_FIELDS = {0: 8, 1: 9, 2: 11}  # of a line of tracks.csv, by version; from 1 on with the scale
# of the longer side: OpenSfM's unit of a focal length; telescopes (2 m before 36 mm) are below
LONGEST_FOCAL = 60.0
FISHEYE_MODELS = ("fisheye", "fisheye_opencv")
OPENSFM_MODELS = ("perspective", "brown", "radial", "simple_radial", *FISHEYE_MODELS)


def read_opensfm_model(path: Source, sigma_px: float = SIGMA_PX) -> MeasuredBlock:
    """Read reconstruction.json and the tracks.csv beside it.

    Parameters
    ----------
    path : path
        reconstruction.json, its directory, or that of an OpenDroneMap project.
    sigma_px : float
        Standard deviation of an image observation of median scale, pixels; others have one in
        proportion to the scale of their feature, as the program weighs them.

    Returns
    -------
    MeasuredBlock
        The block, in geocentric axes where a reference is known. Points are tracks that have been
        reconstructed.

    Raises
    ------
    InputError
        A file that is missing or damaged, or a camera that is none of Brown's.
    DataError
        A `sigma_px` that is not positive.
    """
    positive_sigma(sigma_px, "OpenSfM")
    file = _file(Path(path))
    models, notes = _models(file)
    cameras = [(key, c) for model in models for key, c in _table(file, model, "cameras").items()]
    shots = [(key, s) for model in models for key, s in _table(file, model, "shots").items()]
    used = list(dict.fromkeys(str(shot.get("camera")) for _, shot in shots))
    camera_by_name = dict(cameras)
    if missing := [key for key in used if key not in camera_by_name]:
        raise InputError.in_file(file, f"no camera {quote(missing[0])}; export it again")
    brown = tuple(_camera(file, key, camera_by_name[key]) for key in used)
    tracks = {key for model in models for key in _table(file, model, "points")}
    track = _tracks(file.with_name(TRACKS), {key: k for k, (key, _) in enumerate(shots)}, tracks)
    image_row, point, xy, scale = track
    camera = np.array([used.index(str(shot.get("camera"))) for _, shot in shots], dtype=np.int64)
    size = np.array([(c.width, c.height) for c in brown], dtype=np.float64).reshape(-1, 2)
    of = size[camera[image_row]]
    uv = xy * of.max(axis=1, initial=0.0)[:, None] + 0.5 * of
    names = file_names([key for key, _ in shots], file)
    measured, repeated = image_points(names, image_row, point, uv, sigma_px * scale)
    position, C_mc = _shot_poses(file, shots)
    plane = _reference(file, models)
    if plane is not None:
        position, C_mc = plane.origin_ecef + position @ plane.C_em.T, plane.C_em @ C_mc
    return MeasuredBlock(
        brown,
        camera,
        measured,
        position,
        C_mc,
        local=plane is None,
        geocentric=plane is not None,
        notes=(*notes, *repeated),
    )


def read_opensfm_poses(
    path: Source,
) -> tuple[tuple[str, ...], Array, Array, TangentPlane | None, tuple[str, ...]]:
    """Read the shots of reconstruction.json alone, whatever their cameras.

    Parameters
    ----------
    path : path
        As of `read_opensfm_model`.

    Returns
    -------
    images : tuple of str
        (n,) names of the shots.
    position : ndarray, (n, 3)
        Projection centres in the axes of the reconstruction, m.
    C : ndarray, (n, 3, 3)
        Camera (x right, y down, z viewing direction) to these axes.
    plane : TangentPlane or None
        These axes; None where their place is not known.
    notes : tuple of str
        What was left out.

    Raises
    ------
    InputError
        A file that is missing or damaged.
    """
    file = _file(Path(path))
    models, notes = _models(file)
    shots = [(key, shot) for model in models for key, shot in _table(file, model, "shots").items()]
    position, C = _shot_poses(file, shots)
    return tuple(key for key, _ in shots), position, C, _reference(file, models), notes


def _shot_poses(file: Path, shots: Sequence[tuple[str, Any]]) -> tuple[Array, Array]:
    """Return projection centres (n, 3) and attitudes (n, 3, 3) of shots, in their own axes."""
    position, C = no_poses(len(shots))
    for k, (key, shot) in enumerate(shots):
        who = f"shot {quote(key)}: "
        C[k] = rotation_from_vector(vector_of(file, shot, "rotation", who)).T
        position[k] = -C[k] @ vector_of(file, shot, "translation", who)
    return position, C


def reconstruction_in(directory: Path) -> Path | None:
    """Return reconstruction.json of a directory of OpenSfM, or of a project; None without one."""
    files = (directory / RECONSTRUCTION, directory / INSIDE / RECONSTRUCTION)
    return next((file for file in files if file.is_file()), None)


def _file(path: Path) -> Path:
    """Return reconstruction.json of a directory, or the file itself."""
    file = reconstruction_in(path) if path.is_dir() else path
    if file is None:
        raise InputError.in_file(
            path, f"has no {RECONSTRUCTION}; give the directory of OpenSfM, or of the project"
        )
    return file


def _models(file: Path) -> tuple[list[Mapping[str, Any]], tuple[str, ...]]:
    """Return the reconstructions of a file that stand in common axes: all of them, or the largest.

    Those without reference are not connected with each other.
    """
    document = parse_json(file, decode_text(file))
    models = document if isinstance(document, list) else [document]
    if not models or not all(isinstance(model, dict) and "shots" in model for model in models):
        raise InputError.in_file(
            file, "is no list of reconstructions with shots; give OpenSfM's file of that name"
        )
    references = {json.dumps(model.get("reference_lla")) for model in models}
    if len(models) == 1 or (len(references) == 1 and references != {"null"}):
        return models, ()
    largest = max(models, key=lambda model: len(model["shots"]))
    n_left = sum(len(model["shots"]) for model in models) - len(largest["shots"])
    return [largest], (
        f"{n_left} images left out: they belong to {len(models) - 1} reconstructions that are not"
        " connected with the largest",
    )


def _table(file: Path, model: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    value = model.get(key, {})
    if not (isinstance(value, dict) and all(isinstance(item, dict) for item in value.values())):
        problem = f"{key} is no table of tables"
        raise InputError.in_file(file, f"{problem}; export the reconstruction again")
    return value


def _value(file: Path, table: Any, key: str, default: float | None, of: str) -> float:
    """Return a finite number of a table."""
    value = table.get(key, default) if isinstance(table, dict) else None
    if (number := array_of(value, ())) is None:
        raise InputError.in_file(file, f"{of}: {key} {value!r:.60} is no number; export it again")
    return float(number)


def read_opensfm_cameras(path: Source) -> tuple[BrownCamera, ...]:
    """Read cameras.json of OpenDroneMap and WebODM, or the cameras of a reconstruction.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    tuple of BrownCamera
        Each name once.

    Raises
    ------
    InputError
        A damaged file, or a camera that is none of Brown's.
    """
    file = Path(path)
    document = parse_json(file, decode_text(file))
    models = document if isinstance(document, list) else [document]
    if not all(isinstance(model, dict) for model in models):
        raise InputError.in_file(file, "is no table of cameras; export it again")
    tables = [
        _table(file, model if "cameras" in model else {"cameras": model}, "cameras")
        for model in models
    ]
    return tuple(
        _camera(file, key, camera)
        for key, camera in {k: c for table in tables for k, c in table.items()}.items()
    )


def _camera(file: Path, name: str, entry: Any) -> BrownCamera:
    """Return a camera in pixels."""
    model = entry.get("projection_type", "perspective")
    if model not in OPENSFM_MODELS:
        raise InputError.in_file(
            file,
            f"camera {quote(name)}: {model!r} is not Brown's; reconstruct with camera-lens brown",
        )

    def value(key: str, default: float | None = 0.0) -> float:
        return _value(file, entry, key, default, f"camera {quote(name)}")

    width, height = value("width", None), value("height", None)
    if not are_whole(width, height):
        problem = f"camera {quote(name)}: width and height are no whole numbers of pixels"
        raise InputError.in_file(file, f"{problem}; export it again")
    size = max(width, height)
    fx, fy = [
        value("focal" if model in ("perspective", "fisheye") else key, None)
        for key in ("focal_x", "focal_y")
    ]
    if max(fx, fy) > LONGEST_FOCAL:
        problem = f"camera {quote(name)}: focal {max(fx, fy):g} is in pixels, of the oldest format"
        raise InputError.in_file(file, f"{problem}; divide it by the longer side, {size:.0f} px")
    fisheye = model in FISHEYE_MODELS
    terms = {k: value(k) for k in ("k1", "k2", "k3", *(("k4",) if fisheye else ()), "p1", "p2")}
    terms |= {"fx": size * fx, "fy": size * fy, "b1": size * (fx - fy)}
    terms |= {
        "cx": 0.5 * width + size * value("c_x"),
        "cy": 0.5 * height + size * value("c_y"),
    }
    return brown_camera(name, width, height, of_opencv(terms), fisheye)


def _reference(file: Path, models: Sequence[Mapping[str, Any]]) -> TangentPlane | None:
    """Return the tangent plane of the reconstruction, None where its place is not known."""
    reference, beside = models[0].get("reference_lla"), file.with_name(REFERENCE)
    if reference is None and beside.is_file():
        reference = parse_json(beside, decode_text(beside))
    if reference is None:
        return None
    lat, lon, height = (
        _value(file, reference, key, None, "reference_lla")
        for key in ("latitude", "longitude", "altitude")
    )
    return TangentPlane(np.radians(lat), np.radians(lon), height)


def _tracks(
    file: Path, row_by_image: Mapping[str, int], wanted: set[str]
) -> tuple[NDArray[np.int64], list[str], Array, Array]:
    """Return image rows, tracks, coordinates (n, 2) and scales over their median.

    Tracks that were not reconstructed are left out, unless none was.
    """
    if not file.is_file():
        raise InputError.in_file(
            file,
            "no such file; copy it beside reconstruction.json, since it holds the image"
            " observations",
        )
    lines = lines_of(decode_text(file))
    version, first = 0, 0
    if lines[0].startswith(TRACKS_VERSION):
        text, first = lines[0][len(TRACKS_VERSION) :].strip(), 1
        version = whole(text)
    if version not in TRACK_FIELDS:
        raise InputError.at_line(
            file, 1, f"version {quote(lines[0])}; read are 0 to {max(TRACK_FIELDS)}"
        )
    image_row, point, xy, scale = [], [], [], []
    for line, text in enumerate(lines[first:], start=first + 1):
        if not text.strip():
            continue
        fields = text.split("\t")
        check_fields(file, line, fields, TRACK_FIELDS[version], text)
        row = row_by_image.get(fields[0])
        if row is None or (wanted and fields[1] not in wanted):
            continue
        image_row.append(row)
        point.append(fields[1])
        xy.append([number_in(word, file, line) for word in fields[3:5]])
        scale.append(number_in(fields[5], file, line) if version else 1.0)
        if scale[-1] < 0.0:
            raise InputError.at_line(file, line, f"scale {scale[-1]:g}; it must not be negative")
    if not image_row:
        raise InputError.in_file(
            file, "observes no image of reconstruction.json; copy both files from the same run"
        )
    ratio = np.array(scale)
    good = ratio > 0.0  # zero: not known
    ratio[good] /= np.median(ratio[good]) if good.any() else 1.0
    ratio[~good] = 1.0
    return np.array(image_row, dtype=np.int64), point, np.array(xy).reshape(-1, 2), ratio
