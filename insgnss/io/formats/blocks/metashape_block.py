"""Image blocks of Metashape: projects, exported cameras, markers, data_specs/metashape_block.md.

A camera is forward, with pixels from the outer corner of the first one, c_x and c_y from the
image's centre:

    u = w / 2 + c_x + (f + B_1) x' + B_2 y',    v = h / 2 + c_y + f y',    (x', y') = D(x, y)  (A.1)

with D of (J.3), P_1 with r^2 + 2 x^2. A calibration of PhotoScan with f_x, f_y and skew has f =
f_y, B_1 = f_x - f_y, B_2 = skew, its second tangential coefficient with r^2 + 2 x^2, and c_x, c_y
from the image's corner; which of the two origins is meant, the values tell: half the image apart.
"""

import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ....records.block import INTERIOR, Array, BrownCamera
from ..bundle.camera import brown_camera, of_opencv
from ..detect import head_of
from ..text.layout import quote
from ..text.numbers import whole
from ..text.text import Source
from ..text.xml import read_xml, text_of
from .ground_points import GroundTable
from .image_points import SIGMA_PX, positive_sigma
from .measured_block import MeasuredBlock, image_points
from .metashape_chunk import (
    Chunk,
    chunk_poses,
    flag,
    number_of,
    on_globe,
    opened_chunk,
    positive,
)
from .metashape_project import Element, ProjectFile, read_ply

CALIBRATION = re.compile(rb"\s*(<\?xml[^>]*>\s*)?<calibration\b")  # a file of one camera alone
MARKER_M = 0.005  # accuracy of markers (m) where the project states none: Metashape's default


def read_metashape_block(
    path: Source, sigma_px: float = SIGMA_PX, chunk: str | None = None
) -> MeasuredBlock:
    """Read a project, exported cameras, or exported markers.

    Parameters
    ----------
    path : path
        A .psx (with its folder), a .psz, or an XML file with a chunk.
    sigma_px : float
        Standard deviation of image observations where the file has no settings, pixels.
    chunk : str, optional
        Label or id of the chunk; needed where several have cameras.

    Returns
    -------
    MeasuredBlock
        The block. Images go by their labels, markers by theirs, tie points by numbers with a letter
        before. Disabled images are left out, and observations that are neither placed by hand nor
        confirmed.

    Raises
    ------
    InputError
        The file is damaged, has several chunks, a camera that is none of Brown's, or values that
        are no numbers.
    DataError
        A `sigma_px` that is not positive.
    """
    positive_sigma(sigma_px, "Metashape")
    of = opened_chunk(path, chunk)
    notes: list[str] = []
    enabled, disabled = of.images(notes)
    names = of.names(enabled)
    row_by_id = {c.get("id"): k for k, c in enumerate(enabled)}
    cameras, camera = _cameras(of, enabled, notes)
    poses = chunk_poses(of, enabled, notes)
    ground, labels = _ground(of, notes)
    image_row, point, uv = _markers(of, row_by_id, {c.get("id") for c in disabled}, labels, notes)
    n_markers = len(image_row)
    tied, track, pixels, size = _tie_points(of, row_by_id)
    prefix = "T"
    while any(re.fullmatch(rf"{prefix}\d+", name) for name in labels.values()):
        prefix = f"{prefix}_"
    sigma = np.full(n_markers + len(tied), of.setting("accuracy_projections", sigma_px))
    sigma[n_markers:] = of.setting("accuracy_tiepoints", sigma_px) * size
    measured, repeated = image_points(
        names,
        np.concatenate([np.array(image_row, dtype=np.int64), tied]),
        [*point, *(f"{prefix}{number}" for number in track.tolist())],
        np.concatenate([np.array(uv, dtype=np.float64).reshape(-1, 2), pixels]),
        sigma,
    )
    return MeasuredBlock(
        cameras,
        camera,
        measured,
        poses.position,
        poses.C_mc,
        ground,
        of.crs("marker") or None,
        poses.local,
        geocentric=on_globe(of, poses.local),
        notes=(*notes, *repeated),
    )


def _cameras(
    of: Chunk, images: Sequence[Element], notes: list[str]
) -> tuple[tuple[BrownCamera, ...], NDArray[np.int64]]:
    """Return the cameras of the images and the row of each; none where the file has no sensors."""
    sensors = {s.get("id"): s for s in of.all("sensors", "sensor")}
    used = list(dict.fromkeys(c.get("sensor_id") for c in images))
    if not sensors or used in ([], [None]):
        return (), np.zeros(len(images), dtype=np.int64)
    if missing := [number for number in used if number not in sensors]:
        raise of.source.error(f"no <sensor> with the id {missing[0]}; export the cameras again")
    rows = np.array([used.index(c.get("sensor_id")) for c in images], dtype=np.int64)
    return tuple(_camera(of.source, sensors[number], notes) for number in used), rows


def read_metashape_cameras(path: Source) -> tuple[BrownCamera, ...]:
    """Read the cameras of a project, or of a calibration file of Metashape.

    Parameters
    ----------
    path : path
        .psx, .psz, XML of cameras, or <calibration> alone.

    Returns
    -------
    tuple of BrownCamera
        The sensors.

    Raises
    ------
    InputError
        As `read_metashape_block`.
    """
    if not CALIBRATION.match(head_of(Path(path))):
        chunk = opened_chunk(path)
        return tuple(_camera(chunk.source, sensor, []) for sensor in chunk.all("sensors", "sensor"))
    sensor = Element("sensor", label=Path(path).stem)
    sensor.append(calibration := read_xml(path))
    size = {key: text_of(calibration.find(key)) for key in ("width", "height")}
    calibration.append(Element("resolution", size))
    calibration.set("type", text_of(calibration.find("projection")) or "frame")
    return (_camera(ProjectFile(Path(path), zipped=False), sensor, []),)


def _camera(source: ProjectFile, sensor: Element, notes: list[str]) -> BrownCamera:
    """Return a camera: as it was adjusted, else as it was given, else as it was built."""
    name = sensor.get("label") or f"sensor {sensor.get('id')}"
    calibrations = {c.get("class", ""): c for c in sensor.findall("calibration")}
    calibration = calibrations.get("adjusted", next(iter(calibrations.values()), None))
    kind = sensor.get("type", "frame") if calibration is None else calibration.get("type", "frame")
    if kind not in ("frame", "fisheye"):
        raise source.error(
            f"camera {quote(name)} is of the type {kind}; frame and fisheye cameras are read,"
            " calibrate it as one"
        )
    size = sensor.find("resolution") if calibration is None else calibration.find("resolution")
    size = sensor.find("resolution") if size is None else size
    if size is None:
        raise source.error(f"camera {quote(name)} has no <resolution>; export the cameras again")
    width, height = (_pixels(source, size, key, name) for key in ("width", "height"))
    half = 0.5 * np.array([width, height])
    if calibration is None:
        value = {"f": _nominal_focal(source, sensor, name), "cx": half[0], "cy": half[1]}
        notes.append(f"camera {quote(name)} has no calibration; its nominal focal length is taken")
    else:
        read = {
            element.tag: number_of(source, text_of(element), f"camera {name}: {element.tag}")
            for element in calibration
            if element.tag in (*INTERIOR, "fx", "fy", "skew", "p3", "p4")
        }
        value = _brown_parameters(source, name, read, half, notes)
    return brown_camera(name, width, height, value, kind == "fisheye")


def _brown_parameters(
    source: ProjectFile, name: str, read: dict[str, float], half: Array, notes: list[str]
) -> dict[str, float]:
    """Return the parameters of a calibration as (J.3) and (J.4) have them."""
    if more := [key for key in ("p3", "p4") if read.pop(key, 0.0) != 0.0]:
        raise source.error(
            f"camera {quote(name)}: {', '.join(more)} other than zero, which Brown's polynomial"
            " does not have; optimize the cameras without these and export again"
        )
    old = "f" not in read
    if old:
        if not {"fx", "fy"} <= set(read):
            raise source.error(f"camera {quote(name)}: no <f>, nor <fx> and <fy>; calibrate it")
        read = of_opencv(read) | {"b2": read.get("skew", 0.0)}
    centre = np.array([read.get("cx", 0.0), read.get("cy", 0.0)])
    if (np.abs(centre) < 0.5 * half).all():
        centre = centre + half
        from_corner = False
    elif (np.abs(centre - half) < 0.5 * half).all():
        from_corner = True
    else:
        raise source.error(
            f"camera {quote(name)}: principal point ({centre[0]:.1f}, {centre[1]:.1f}) is neither"
            " near the image's centre nor near zero; calibrate it again"
        )
    if from_corner and not old and (read.get("p1", 0.0) or read.get("p2", 0.0)):
        notes.append(
            f"camera {quote(name)}: P1 and P2 of a project before PhotoScan 1.4 are read in the"
            " order of later versions (not verified with a file)"
        )
    return {k: v for k, v in read.items() if k in INTERIOR} | {"cx": centre[0], "cy": centre[1]}


def _pixels(source: ProjectFile, element: Element, key: str, name: str) -> int:
    """Return a side of an image."""
    value = whole(element.get(key))
    if value <= 0:
        problem = f"camera {name}: {key} {quote(element.get(key))} is no whole number of pixels"
        raise source.error(f"{problem}; export the cameras again")
    return value


def _nominal_focal(source: ProjectFile, sensor: Element, name: str) -> float:
    """Return the focal length in pixels that a sensor was built with."""
    properties = {p.get("name"): p.get("value") for p in sensor.findall("property")}
    if not {"focal_length", "pixel_width"} <= set(properties):
        raise source.error(
            f"camera {quote(name)} has neither calibration nor focal length; align the images first"
        )
    focal, pixel = (positive(source, properties[k], k) for k in ("focal_length", "pixel_width"))
    return focal / pixel


def _ground(of: Chunk, notes: list[str]) -> tuple[GroundTable | None, dict[str | None, str]]:
    """Return markers with coordinates, and the labels of all markers by their ids."""
    markers = of.all("markers", "marker")
    labels = {m.get("id"): m.get("label") or f"marker {m.get('id')}" for m in markers}
    if twice := [name for name, count in Counter(labels.values()).items() if count > 1]:
        raise of.source.error(f"marker {quote(twice[0])} is there twice; rename one of them")
    plane = [m.find("reference[@x][@y]") for m in markers]
    if flat := sum(reference is not None and reference.get("z") is None for reference in plane):
        notes.append(f"{flat} markers without height are used as tie points")
    named = [(labels[marker.get("id")], marker) for marker in markers]
    return of.references("markers", MARKER_M, named), labels


def _markers(
    of: Chunk,
    row_by_id: dict[str | None, int],
    disabled: set[str | None],
    labels: dict[str | None, str],
    notes: list[str],
) -> tuple[list[int], list[str], list[list[float]]]:
    """Return rows of images, names and pixels of markers in images."""
    image_row, point, uv, loose = [], [], [], 0
    frame = of.frame
    for marker in [] if frame is None else frame.findall("./markers/marker"):
        number = marker.get("marker_id")
        if number not in labels:
            raise of.frame_source.error(f"no marker with the id {number}; export the markers again")
        for location in marker.findall("location"):
            image = location.get("camera_id")
            if image in disabled:
                continue
            if image not in row_by_id:
                raise of.frame_source.error(
                    f"marker {quote(labels[number])} is measured in an image of the id {image},"
                    " which is not in the file; export markers with their images"
                )
            pinned, valid = (flag(of.frame_source, location, k) for k in ("pinned", "valid"))
            if not (pinned and valid):
                loose += 1
                continue
            description = f"marker {labels[number]} in image id {image}"
            image_row.append(row_by_id[image])
            point.append(labels[number])
            uv.append([number_of(of.frame_source, location.get(k), description) for k in "xy"])
    if loose:
        notes.append(f"{loose} projections of markers left out: not placed or confirmed by hand")
    return image_row, point, uv


def _tie_points(
    of: Chunk, row_by_id: dict[str | None, int]
) -> tuple[NDArray[np.int64], NDArray[np.int64], Array, Array]:
    """Return image rows, numbers, pixels (n, 2) and sizes of tie points with object coordinates."""
    image_row, track, uv, size = [], [], [], []
    frame = of.frame
    clouds = [] if frame is None else [*frame.findall("point_cloud"), *frame.findall("tie_points")]
    for element in clouds:
        cloud, source = of.frame_source.opened(element)
        points = cloud.find("points")
        valid = (
            None
            if points is None or not points.get("path")
            else read_ply(source, points.get("path", ""), ("id",))["id"].astype(np.int64)
        )
        for projections in cloud.findall("projections"):
            if (row := row_by_id.get(projections.get("camera_id"))) is None:
                continue
            table = read_ply(source, projections.get("path", ""), ("x", "y", "id"))
            number = table["id"].astype(np.int64)
            keep = np.ones(len(table), dtype=bool) if valid is None else np.isin(number, valid)
            n = int(keep.sum())
            image_row.append(np.full(n, row, dtype=np.int64))
            track.append(number[keep])
            uv.append(np.column_stack([table["x"], table["y"]]).astype(np.float64)[keep])
            names = table.dtype.names or ()
            size.append(table["size"].astype(np.float64)[keep] if "size" in names else np.ones(n))
    if not image_row:
        none = np.zeros(0, dtype=np.int64)
        return none, none, np.zeros((0, 2)), np.zeros(0)
    scale = np.concatenate(size)
    if not (scale >= 0.0).all():
        raise of.frame_source.error(
            "a tie point has a negative size or none; save the project again"
        )
    scale[scale == 0.0] = 1.0
    return np.concatenate(image_row), np.concatenate(track), np.concatenate(uv), scale
