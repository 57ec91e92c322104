"""Adjusted poses in JSON documents, data_specs/returned.md.

odm_shots   shots.geojson of OpenDroneMap: a point each with longitude, latitude, height, and the
            rotation vector of the reconstruction's axes to the camera (right, down, viewing
            direction). Those axes are east, north, up at the place of the reconstruction: the
            program writes them beside coordinates of UTM without the meridian convergence.
geojson     points of images by `image`, `filename` or `name`: longitude, latitude, height above
            the ellipsoid, of WGS 84 or of `crs`; yaw, pitch, roll of true north (`ypr_deg`), where
            all have them; orthority's `xyz` and `opk`, rad, in `world_crs`
opf         calibrated_cameras.json of Pix4D's OPF: position of the processing CRS, scaled (to
            metres) and then shifted as scene_reference_frame.json says, and omega, phi, kappa to
            its axes; names in camera_list.json
"""

from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import unquote

import numpy as np

from ....base.errors import InputError
from ....base.received.nesting import parse_json
from ....geodesy.frames import TangentPlane
from ....geodesy.rotation import CV_RUB, rotation_from_opk, rotation_from_vector, rotation_from_ypr
from ....records.framed import TANGENT
from ..text.numbers import vector_of
from ..text.text import Source, decode_text
from .crs import kind_of_wkt
from .poses import Array, ReturnedPoses, image_names

CALIBRATED_CAMERAS = "calibrated_cameras.json"
IMAGE_PROPERTIES = "image", "filename", "name"  # of a GeoJSON point: the first that it has


def read_odm_shots(path: Source) -> ReturnedPoses:
    """Read shots.geojson of OpenDroneMap.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    ReturnedPoses
        In the tangent plane at the mean of its images.

    Raises
    ------
    InputError
        No GeoJSON, or a shot without place or rotation.
    """
    images, (lon, lat, h), shots = _points(path, _document(path))
    turns = [vector_of(path, properties, "rotation") for properties in shots]
    origin = (float(lat.mean()), float(lon.mean()), float(h.mean()))
    position = TangentPlane(*origin).position_from_geodetic(lat, lon, h)
    C = rotation_from_vector(np.array(turns)).swapaxes(1, 2)
    note = (
        "rotations of shots.geojson count from true north at the middle of the block, whatever its"
        " UTM zone"
    )
    return ReturnedPoses(images, position, C, TANGENT, origin=origin, notes=(note,))


def _points(
    path: Source, document: Mapping[str, Any]
) -> tuple[tuple[str, ...], Array, list[Mapping[str, Any]]]:
    """Return names, longitude, latitude, rad, height, m, (3, n), and properties of points."""
    names, places, points = [], [], []
    for feature in _list(path, document, "features"):
        geometry, properties = (_member(path, feature, key) for key in ("geometry", "properties"))
        key = next((key for key in IMAGE_PROPERTIES if key in properties), None)
        if geometry.get("type") == "Point" and key is not None:
            names.append(str(properties[key]))
            places.append(vector_of(path, geometry, "coordinates"))
            points.append(properties)
    images = image_names(names, path)
    lon, lat, h = np.array(places).T
    if np.abs(lat).max() > 90.0:
        problem = f"latitude {lat[np.abs(lat).argmax()]:g} deg; GeoJSON has longitude first"
        raise InputError.in_file(path, f"{problem}: exchange the coordinates")
    return images, np.array([np.radians(lon), np.radians(lat), h]), points


def read_geojson(path: Source) -> ReturnedPoses:
    """Read images that are points of GeoJSON.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    ReturnedPoses
        Longitude, latitude, height, or in orthority's CRS; positions alone where a point has no
        angles.

    Raises
    ------
    InputError
        No GeoJSON, no point with a name, or numbers that are none.
    """
    document = _document(path)
    images, x, points = _points(path, document)
    cov = None
    if all("sigma_enu_m" in point for point in points):
        sigma = [vector_of(path, point, "sigma_enu_m") for point in points]
        cov = np.square(sigma)[:, :, None] * np.eye(3)
    if "world_crs" in document:
        x, opk = (
            np.array([vector_of(path, point, key) for point in points]) for key in ("xyz", "opk")
        )
        kind, crs = kind_of_wkt(str(document["world_crs"]), path)
        return ReturnedPoses(
            images, x, rotation_from_opk(opk) @ CV_RUB, kind, crs, angle_set="opk", angles=opk
        )
    crs = "EPSG:4979"
    if "crs" in document:
        crs = str(_member(path, _member(path, document, "crs"), "properties").get("name"))
    kind, crs = kind_of_wkt(crs, path)
    if not all("ypr_deg" in point for point in points):
        return ReturnedPoses(images, x.T, None, kind, crs, cov_position=cov)
    ypr = np.radians([vector_of(path, point, "ypr_deg") for point in points])
    return ReturnedPoses(
        images,
        x.T,
        rotation_from_ypr(ypr) @ CV_RUB,
        kind,
        crs,
        angle_set="ypr",
        angles=ypr,
        cov_position=cov,
    )


def read_opf(path: Source) -> ReturnedPoses:
    """Read the calibrated cameras of an OPF project.

    Parameters
    ----------
    path : path
        calibrated_cameras.json or its directory; scene_reference_frame.json and camera_list.json
        lie beside it.

    Returns
    -------
    ReturnedPoses
        In the processing CRS, in its unit.

    Raises
    ------
    InputError
        A file that is missing or damaged, or a camera that camera_list.json does not have.
    """
    folder = Path(path) if Path(path).is_dir() else Path(path).parent
    file, scene = folder / CALIBRATED_CAMERAS, folder / "scene_reference_frame.json"
    uris = {
        camera.get("id"): str(camera.get("uri"))
        for camera in _list(path, _document(folder / "camera_list.json"), "cameras")
    }
    names, position, opk = [], [], []
    for camera in _list(file, _document(file), "cameras"):
        if camera.get("id") not in uris:
            raise InputError.in_file(
                file, f"camera {camera.get('id')} is not in camera_list.json; export again"
            )
        names.append(PurePosixPath(unquote(uris[camera["id"]])).name)
        position.append(vector_of(file, camera, "position"))
        opk.append(vector_of(file, camera, "orientation_deg"))
    images = image_names(names, file)
    frame = _document(scene)
    base = _member(scene, frame, "base_to_canonical")
    x = (np.array(position) - vector_of(scene, base, "shift")) / vector_of(scene, base, "scale")
    C = rotation_from_opk(np.radians(opk)) @ CV_RUB
    if base.get("swap_xy"):
        raise InputError.in_file(
            scene, "its CRS names northing first (swap_xy); export in its east-north sibling"
        )
    crs = str(_member(scene, frame, "crs").get("definition"))
    return ReturnedPoses(images, x, C, *kind_of_wkt(crs, scene), angle_set="opk")


def _document(path: Source) -> Mapping[str, Any]:
    document = parse_json(path, decode_text(path))
    if not isinstance(document, Mapping):
        raise InputError.in_file(path, "is no JSON object; export it again")
    return document


def _list(path: Source, document: Mapping[str, Any], key: str) -> Iterator[Mapping[str, Any]]:
    entries = document.get(key)
    if not isinstance(entries, list) or not all(isinstance(entry, Mapping) for entry in entries):
        raise InputError.in_file(path, f"has no list {key!r} of objects; export it again")
    yield from entries


def _member(path: Source, document: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    member = document.get(key)
    if not isinstance(member, Mapping):
        raise InputError.in_file(path, f"{key} is missing or no object; export it again")
    return member
