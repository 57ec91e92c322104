"""Open Photogrammetry Format of Pix4D: an OPF project of input cameras, data_specs/opf.md.

    input_cameras.json            what was measured: EPSG:4979, latitude, longitude, height; omega,
                                  phi, kappa to the projected CRS
    projected_input_cameras.json  the same in the processing CRS: coordinates + shift of
                                  scene_reference_frame.json
    camera_list.json              which file belongs to which camera
    project.opf                   the index of these

R = Rx(omega) Ry(phi) Rz(kappa) takes the camera (right, top, back) into the axes of the CRS. The
yaw, pitch, roll of the format are left alone, since its text does not say their navigation frame.
Standard deviations are those of the components; the full 6 x 6 covariance stands in the extension
`INSGNSS_covariance` of each input capture, position (m) and psi (rad) in the axes of the projected
CRS.

OPF takes heights with a CRS of two axes to be above that CRS's own ellipsoid. Where they are not
(LV95 with heights above WGS84's: 50 m), or above a geoid that no CRS names, the processing CRS
cannot be said: then scene frame and projected cameras are left out, which the program makes itself,
and the project's description says so.
"""

import hashlib
import json
import re
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from ....base import __version__
from ....base.errors import UsageError
from ....base.files import atomic_write
from ....records import Array, FramedOrientation, MapFrame
from ..orientation.ascii_columns import numbers_of
from ..orientation.exported import listed_rows, new_directory, position_sigma
from ..orientation.poses import local_sigma, positive, sentences, utc
from ..text.text import Source
from .camera import ColmapCamera, cameras_of

OPF_MIME = "application/opf-{}+json"
ITEMS = ("scene_reference_frame", "camera_list", "input_cameras", "projected_input_cameras")
OPF_FILES = (".opf", "_cameras.json", *(f"{name}.json" for name in ITEMS))
SOURCES = {
    "input_cameras": ("camera_list",),
    "projected_input_cameras": ("input_cameras", "scene_reference_frame"),
}
# of COLMAP, that OPF has as well
OPF_MODELS = ("SIMPLE_PINHOLE", "PINHOLE", "OPENCV", "FULL_OPENCV")
WHITE_LEVELS = {"uint8": 255, "uint12": 4095, "uint16": 65535}
OPF_BANDS = {
    "rgb": (("Red", 0.2126), ("Green", 0.7152), ("Blue", 0.0722)),
    "gray": (("Gray", 1.0),),
}
# step of the scene's shift (m): a short number that leaves small coordinates (chosen)
SCENE_SHIFT_STEP_M = 100.0
GRS80_AXIS_M = 6378137.0  # semi-major axis (m) of GRS 80 and WGS 84
GRS80_INVERSE_FLATTENING = 298.2572  # 1 / flattening (-) of both, as far as they agree
SAME_INVERSE_FLATTENING = 1e-4  # difference (-) up to which it is theirs: they differ by 1.5e-6
SENSOR = 1  # number of the first sensor: any would do, further ones count on from it


def write_opf(
    eo: FramedOrientation,
    path: Source,
    camera: str | None = None,
    pixel_size_um: float | None = None,
    pixel_type: str = "uint8",
    bands: str = "rgb",
    images: str = "",
) -> None:
    """Write the project into the directory `path`, which is made where it is missing.

    Parameters
    ----------
    eo : FramedOrientation
        The orientation in a projected frame.
    path : path
        The directory.
    camera : str
        In COLMAP's notation, PINHOLE, OPENCV or FULL_OPENCV (k3) with one focal length; of a rig
        "NAME=MODEL ...; NAME=...", each camera a sensor of its own.
    pixel_size_um : float
        Size of the sensor's pixels, micrometres.
    pixel_type : {"uint8", "uint12", "uint16"}
        Type of the pixels.
    bands : {"rgb", "gray"}
        Bands of the sensor.
    images : str
        Folder of the images, as seen from `path`.

    Raises
    ------
    UsageError
        A frame that is not projected, whose CRS names northing first, or whose heights were scaled;
        a missing camera; a `path` with items of another project.
    """
    definition, horizontal = crs_definition(eo.frame)
    camera_names, number = eo.cameras
    models = zip(cameras_of(camera, camera_names, "opf"), camera_names, strict=True)
    sensors = [
        {"id": sensor_id, "name": name or "camera"}
        | _sensor(model, pixel_size_um, pixel_type, bands)
        for sensor_id, (model, name) in enumerate(models, start=SENSOR)
    ]
    shift = np.zeros(3)
    if eo.images:
        shift = -np.round(eo.coordinates.mean(axis=0) / SCENE_SHIFT_STEP_M) * SCENE_SHIFT_STEP_M
    angles = numbers_of(eo, "opk s_opk")
    ids = [(_uid("capture", name), _uid("camera", name)) for name in eo.images]
    uris = [f"{images.rstrip('/')}/{name}" if images else name for name in eo.images]
    cameras = (
        f'{{"id":{pair[1]},"uri":{json.dumps(quote(uri))}}}'
        for pair, uri in zip(ids, uris, strict=True)
    )
    names = list(ITEMS) if definition is not None else ["camera_list", "input_cameras"]
    files = ("project.opf", *(f"{name}.json" for name in names))
    with new_directory(
        Path(path), files, lambda file: file.endswith(OPF_FILES), "an OPF project"
    ) as into:

        def item(name: str, content: dict[str, Any], lists: dict[str, Iterator[str]]) -> None:
            atomic_write(into / f"{name}.json", _json(name, content, lists))

        item("camera_list", {}, {"cameras": cameras})
        captures = _captures(eo, (ids, number + SENSOR), angles, horizontal, pixel_type)
        item("input_cameras", {"sensors": sensors}, {"captures": captures})
        if definition is not None:
            frame = {
                "base_to_canonical": {
                    "scale": [1, 1, 1],
                    "shift": shift.tolist(),
                    "swap_xy": False,
                },
                "crs": {"definition": definition},
            }
            item("scene_reference_frame", frame, {})
            projected = _projected_cameras(eo, ids, eo.coordinates + shift, angles)
            of_ids = {"sensors": [{"id": sensor["id"]} for sensor in sensors]}
            item("projected_input_cameras", of_ids, {"captures": projected})
        atomic_write(into / "project.opf", json.dumps(_project(eo, names), indent=1) + "\n")


def crs_definition(frame: MapFrame) -> tuple[str | None, str]:
    """Return the CRS with its heights, and its horizontal part.

    The first is None where OPF cannot name the heights.

    Raises
    ------
    UsageError
        A CRS that names northing first, or heights that were scaled.
    """
    if frame.northing_first:
        raise UsageError(
            f"{frame.name} names northing first, which makes OPF's axes left-handed; use its"
            " east-north sibling"
        )
    if frame.scaled_from_m is not None:
        raise UsageError(
            "OPF can name no CRS with scaled heights; export without the ground's height"
        )
    if frame.wkt.startswith("COMPOUNDCRS"):
        return frame.wkt, frame.crs or _horizontal(frame.wkt)
    horizontal = frame.crs or frame.wkt
    ellipsoid = re.search(r'ELLIPSOID\["[^"]*",([\d.]+),([\d.]+)', frame.wkt)
    is_grs80 = (
        ellipsoid is not None
        and float(ellipsoid[1]) == GRS80_AXIS_M
        and abs(float(ellipsoid[2]) - GRS80_INVERSE_FLATTENING) < SAME_INVERSE_FLATTENING
    )
    return (horizontal if is_grs80 and "ellipsoid" in frame.heights else None), horizontal


def _horizontal(wkt: str) -> str:
    """Return the horizontal part of a compound CRS, as WKT."""
    from pyproj import CRS

    return str(CRS.from_wkt(wkt).sub_crs_list[0].to_wkt())


def _uid(kind: str, name: str) -> int:
    """Return 64 bits that belong to a name, the same in every export."""
    return int.from_bytes(hashlib.blake2b(f"{kind}:{name}".encode(), digest_size=8).digest(), "big")


def _sensor(
    camera: ColmapCamera, pixel_size_um: float | None, pixel_type: str, bands: str
) -> dict[str, Any]:
    if pixel_type not in WHITE_LEVELS or bands not in OPF_BANDS:
        raise UsageError(
            f"opf: pixel_type {pixel_type!r} or bands {bands!r}; give one of "
            f"{', '.join(WHITE_LEVELS)}"
            f" and of {', '.join(OPF_BANDS)}"
        )
    fx, fy = camera.focal
    distortion = camera.values
    rational = any(distortion.get(key, 0.0) for key in ("k4", "k5", "k6"))
    if camera.model not in OPF_MODELS or fx != fy or rational:
        raise UsageError(
            f"opf: camera {camera.model} with focal lengths {fx:g} and {fy:g}; give PINHOLE, OPENCV"
            " or FULL_OPENCV (k4 to k6 zero) with one focal length"
        )
    if pixel_size_um is None:
        raise UsageError(
            "opf: needs pixel_size_um, the size of the sensor's pixels; give it in micrometres,"
            " such as --set pixel_size_um=3.76"
        )
    pixel = positive(
        pixel_size_um, "opf: pixel_size_um, the size of the sensor's pixels", "micrometres"
    )
    k1, k2, k3, p1, p2 = (distortion.get(key, 0.0) for key in ("k1", "k2", "k3", "p1", "p2"))
    return {
        "bands": [{"name": name, "weight": weight} for name, weight in OPF_BANDS[bands]],
        "image_size_px": [camera.width, camera.height],
        "internals": {
            "type": "perspective",
            "focal_length_px": fx,
            "principal_point_px": list(camera.principal_point),
            "radial_distortion": [k1, k2, k3],
            "tangential_distortion": [p1, p2],
        },
        "pixel_size_um": pixel,
        "shutter_type": "global",
    }


def _json(name: str, content: dict[str, Any], lists: dict[str, Iterator[str]]) -> Iterator[str]:
    """A core item; its long lists line by line, since only json's plain encoder is compiled."""
    start = {"format": OPF_MIME.format(name.replace("_", "-")), "version": "1.0", **content}
    yield json.dumps(start, indent=1).removesuffix("\n}")
    for key, items in lists.items():
        yield from listed_rows(f',\n "{key}": [\n  ', items, ",\n  ", "\n ]")
    yield "\n}\n"


def _captures(
    eo: FramedOrientation,
    numbered: tuple[list[tuple[int, int]], Any],
    angles: Array,
    crs: str,
    pixel_type: str,
) -> Iterator[str]:
    pixels = (
        f'"pixel_range":{{"min":0,"max":{WHITE_LEVELS[pixel_type]}}},"pixel_type":"{pixel_type}"'
    )
    camera = f'{{"id":%d,"model_source":"user",{pixels},"sensor_id":%d}}'
    geolocation = (
        f'"geolocation":{{"crs":{{"definition":"{eo.frame.datum}"}},'
        '"coordinates":[%.10f,%.10f,%.4f],'
        '"sigmas":[%.5f,%.5f,%.5f]}'
    )
    orientation = '"orientation":{"type":"omega_phi_kappa","crs":' + json.dumps(crs).replace(
        "%", "%%"
    )
    orientation += ',"angles_deg":[%.6f,%.6f,%.6f],"sigmas_deg":[%.6f,%.6f,%.6f]}'
    matrix_template = ",".join("[" + ",".join(["%.9g"] * 6) + "]" for _ in range(6))
    covariance = (
        f'"extensions":{{"INSGNSS_covariance":{{"version":"1.0","cov6":[{matrix_template}]}}}}'
    )
    template = f'{{"id":%d,"cameras":[{camera}],"reference_camera_id":%d,'
    template += f'"rig_model_source":"not_applicable","time":"%s",{geolocation},'
    template += f"{orientation},{covariance}}}"
    sigma = local_sigma(eo)[:, [1, 0, 2]]
    table = np.hstack([numbers_of(eo, "llh"), sigma, angles, eo.cov.reshape(-1, 36)])
    for (capture, camera_id), sensor, time, row in zip(
        *numbered, utc(eo), table.tolist(), strict=True
    ):
        yield template % (capture, camera_id, sensor, camera_id, time, *row)


def _projected_cameras(
    eo: FramedOrientation, ids: list[tuple[int, int]], x: Array, angles: Array
) -> Iterator[str]:
    form = '{"id":%d,"geolocation":{"position":[%.4f,%.4f,%.4f],"sigmas":[%.5f,%.5f,%.5f]},'
    form += '"orientation":{"angles_deg":[%.6f,%.6f,%.6f],"sigmas_deg":[%.6f,%.6f,%.6f]}}'
    table = np.hstack([x, position_sigma(eo), angles])
    for (capture, _), row in zip(ids, table.tolist(), strict=True):
        yield form % (capture, *row)


def _project(eo: FramedOrientation, names: list[str]) -> dict[str, Any]:
    space = uuid.uuid5(
        uuid.NAMESPACE_URL, "insgnss:" + "\n".join([eo.frame.name, str(eo.gps_week), *eo.images])
    )
    ids = {name: str(uuid.uuid5(space, name)) for name in names}
    remark = (
        "projected cameras are left out, since OPF would take these heights to be above another"
    )
    left_out = () if len(names) == len(ITEMS) else (f"{remark} surface",)
    return {
        "format": OPF_MIME.format("project"),
        "version": "1.0",
        "id": str(space),
        "name": "exterior orientation",
        "description": "; ".join(sentences(eo, *left_out)),
        "generator": {"name": "insgnss", "version": __version__},
        "items": [
            {
                "id": ids[name],
                "name": name,
                "type": name,
                "resources": [
                    {"format": OPF_MIME.format(name.replace("_", "-")), "uri": f"{name}.json"}
                ],
                "sources": [
                    {"id": ids[source], "type": source} for source in SOURCES.get(name, ())
                ],
            }
            for name in names
        ],
    }
