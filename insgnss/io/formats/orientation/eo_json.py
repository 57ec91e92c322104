"""eo.json: the master exterior orientation, source of every other export, data_specs/eo_json.md.

From `eo_packed.FROM_IMAGES` images on their numbers stand in a numpy archive beside it, whose hash
it holds, and the text keeps the head and the names.

Numbers are written so that they read back bit by bit. Attitude stands three times: as the matrix
C_mc, which is what is read back, as its quaternion in the tangent plane, which must agree with it,
and as the quaternion in ECEF.
"""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....base import __version__
from ....base.errors import InputError
from ....base.files import atomic_write, atomic_writes
from ....base.inputs import read_bytes, readable
from ....base.received.nesting import parse_json
from ....geodesy.frames import TangentPlane
from ....geodesy.rotation import is_rotation, quaternion_from_rotation, rotation_from_quaternion
from ....records import ExteriorOrientation
from ....records.cameras.rig import RigCamera, RigImages
from ....records.relative import RelativeControl
from ..text.numbers import LARGEST_EXACT_INTEGER, array_of
from ..text.text import Source
from . import eo_packed
from .eo_covariance import refusing
from .relative_csv import relative_member

Array = NDArray[np.float64]

EO_FORMAT = "insgnss exterior orientation"
FORMAT_VERSION = 1  # version of one camera, its numbers in the text: the first
# version of one camera, its numbers in the archive beside: readers of 1 refuse it
PACKED_VERSION = 2
RIG_VERSION = 3  # of several cameras, packed or not: a reader of one camera must not take it
VERSIONS = (FORMAT_VERSION, PACKED_VERSION, RIG_VERSION)
WGS84 = "WGS84 (EPSG:4979)"
AGREEMENT = 1e-9  # rotation between C_mc and quaternion (rad): rounding of what is printed
TINY_NUMBERS = re.compile(rb"[eE]-[0-9]{3}|0{300}")  # in each number below 1e-300
OF_A_RIG = {
    "camera": "which of `cameras` took the image; images stand in the order of time",
    "cross_cov6_next_of_camera": (
        "as cross_cov6_next, with the next image of the same camera; null for its last"
    ),
}
CONVENTIONS = {
    "position_m": "projection centre, m, east north up of the tangent plane",
    "C_mc": (
        "rows of the matrix that takes camera axes (x image right, y image down, z viewing"
        " direction) into the tangent plane"
    ),
    "quaternion_wxyz": "Hamilton, w x y z, of C_mc",
    "cov6": (
        "covariance of (dE, dN, dU, psi_E, psi_N, psi_U), m and rad, tangent-plane axes; "
        "error = truth - estimate, C_mc(true) = exp([psi x]) C_mc(estimate)"
    ),
    "cross_cov6_next": (
        "covariance of this image's error (rows) with that of the next image (columns), in the"
        " order of cov6; null for the last image"
    ),
    "velocity_mps": (
        "velocity of the projection centre, m/s, tangent-plane axes; missing where not known"
    ),
    "rate_radps": (
        "angular rate of the camera with respect to the Earth, rad/s, tangent-plane axes: C_mc(t +"
        " dt) = exp([rate dt x]) C_mc(t); missing where not known"
    ),
    "ecef": "the same projection centre and camera-to-frame quaternion in ECEF (EPSG:4978)",
    "time_s": "seconds of gps_week, GPST; past the week's end they go on counting",
}


def write_eo_json(
    eo: ExteriorOrientation, path: Source, relative: RelativeControl | None = None
) -> None:
    """Write the master file, and of many images their numbers beside it: both or neither.

    Parameters
    ----------
    eo : ExteriorOrientation
        The orientation.
    path : path
        The file.
    relative : RelativeControl, optional
        Relative control of neighbours in the tangent plane, for the member of that name; of many
        images it is left out, as it follows from the file.
    """
    many = len(eo) >= eo_packed.FROM_IMAGES
    content: dict[str, Any] = {
        "format": EO_FORMAT,
        "format_version": (
            RIG_VERSION if eo.rig is not None else PACKED_VERSION if many else FORMAT_VERSION
        ),
        "software": f"insgnss {__version__}",
        "gps_week": eo.gps_week,
        "time_scale": "GPST",
        "tangent_plane": {
            "datum": eo.datum or WGS84,
            **({} if eo.epoch is None else {"epoch": eo.epoch}),
            "origin_lat_lon_rad_height_m": eo.origin.tolist(),
            "origin_deg": np.degrees(eo.origin[:2]).tolist(),
        },
        "conventions": CONVENTIONS | ({} if eo.rig is None else OF_A_RIG),
        "height_system": f"above the ellipsoid of {eo.datum or 'WGS84'}",
        "image_up": _image_up(eo.camera_from_body),
        "applied": {
            "lever_arm": "applied: positions are those of the projection centre",
            "boresight": eo.boresight.tolist(),
            "camera_from_body": eo.camera_from_body.tolist(),
        },
        "history": list(eo.history),
    }
    if eo.rig is not None:
        content["cameras"] = _cameras(eo.rig)
    if many:
        numbers, digest = eo_packed.pack_numbers(eo)
        beside = eo_packed.side_file(path)
        content["packed"] = {
            "file": beside.name,
            "sha256": digest,
            "arrays": eo_packed.meanings(eo),
        }
        content["images"] = list(eo.images)
        text = json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False)
        atomic_writes({beside: numbers, Path(path): f"{text}\n"})
        return
    # the head is for people; one line an image, and a pair of relative control
    text = json.dumps(content, indent=1, allow_nan=False).removesuffix("\n}")
    if relative is not None:
        text += f',\n "relative": {_relative_text(relative)}'
    images = ",\n  ".join(_image_texts(eo))
    atomic_write(path, f'{text},\n "images": [\n  {images}\n ]\n}}\n')


def _cameras(rig: RigImages) -> list[dict[str, Any]]:
    """Return the cameras of a rig as JSON, the first that of `applied`."""
    return [
        {
            "name": camera.name,
            "boresight": camera.boresight.tolist(),
            "camera_from_body": camera.camera_from_body.tolist(),
            "image_up": _image_up(camera.camera_from_body),
        }
        for camera in rig.cameras
    ]


def _datum(plane: dict[str, Any]) -> str | None:
    """Return the datum, None for WGS 84."""
    name = str(plane.get("datum", WGS84))
    return None if name == WGS84 else name


def _epoch(plane: dict[str, Any]) -> float | None:
    """Return the epoch, decimal year; None where there is none."""
    return float(_of_shape(plane, "epoch", ())) if "epoch" in plane else None


def _image_up(camera_from_body: Array) -> str:
    """Return which way of the body the image's top points, by the nominal mounting."""
    up = camera_from_body.T @ [0.0, -1.0, 0.0]
    axis = int(np.argmax(np.abs(up)))
    way = (("forward", "backward"), ("right", "left"), ("down", "up"))[axis][int(up[axis] < 0.0)]
    return (
        f"the top of the image (camera -y) points {way} in the body, whose axes are forward right"
        " down"
    )


def _relative_text(relative: RelativeControl) -> str:
    """Return relative control as JSON, a line a pair."""
    import orjson

    member = relative_member(relative)
    pairs = ",\n   ".join(orjson.dumps(pair).decode() for pair in member.pop("pairs"))
    head = json.dumps(member, indent=1, allow_nan=False).removesuffix("\n}")
    return f'{head},\n "pairs": [\n   {pairs}\n ]\n}}'.replace("\n ", "\n  ")


def _image_texts(eo: ExteriorOrientation) -> Iterator[str]:
    """Yield each image as JSON, by a compiled encoder: an image has 150 numbers."""
    import orjson

    plane = TangentPlane(*eo.origin)
    ecef = plane.origin_ecef + eo.position_m @ plane.C_em.T
    quaternion, quaternion_ecef = (
        quaternion_from_rotation(eo.C_mc),
        quaternion_from_rotation(plane.C_em @ eo.C_mc),
    )
    names = [] if eo.rig is None else eo.rig.of_images
    of_camera = [] if eo.rig is None else _of_camera(eo.rig)
    for k, name in enumerate(eo.images):
        image: dict[str, Any] = {
            "image": name,
            "time_s": float(eo.time[k]),
            "position_m": eo.position_m[k],
            "C_mc": eo.C_mc[k],
            "quaternion_wxyz": quaternion[k],
            "cov6": eo.cov[k],
            "cross_cov6_next": eo.cross[k] if eo.cross is not None and k < len(eo.cross) else None,
        }
        if eo.rig is not None:
            image |= {"camera": names[k], "cross_cov6_next_of_camera": of_camera[k]}
        if eo.velocity_mps is not None:
            image["velocity_mps"] = eo.velocity_mps[k]
        if eo.rate_radps is not None:
            image["rate_radps"] = eo.rate_radps[k]
        image["ecef"] = {"position_m": ecef[k], "quaternion_wxyz": quaternion_ecef[k]}
        yield orjson.dumps(image, option=orjson.OPT_SERIALIZE_NUMPY).decode()


def _of_camera(rig: RigImages) -> list[Array | None]:
    """Return what each image shares with the next of its camera, None for the last of one."""
    if rig.cross is None:
        return [None] * rig.number.size
    return [
        rig.cross[k] if after >= 0 else None for k, after in enumerate(rig.next_of_camera.tolist())
    ]


def read_eo_json(path: Source) -> ExteriorOrientation:
    """Read the master file back, bit by bit; of packed images the attitude as its quaternion is.

    Raises
    ------
    InputError
        Another format or version, a missing key, attitudes that disagree, or a file beside it that
        is missing or of another run.
    """
    content = _content(path)
    with refusing(path, "export the file again"):
        packed = _read_archive(path, content)
        names, numbers, quaternion = _images(content, packed)
        eo = ExteriorOrientation(
            images=names,
            **numbers,
            gps_week=_week(content),
            origin=_of_shape(content["tangent_plane"], "origin_lat_lon_rad_height_m", (3,)),
            boresight=_of_shape(content["applied"], "boresight", (3, 3)),
            camera_from_body=_of_shape(content["applied"], "camera_from_body", (3, 3)),
            history=tuple(content["history"]),
            datum=_datum(content["tangent_plane"]),
            epoch=_epoch(content["tangent_plane"]),
            rig=_rig(content, packed),
        )
    if unsound := _unsound(eo):
        raise InputError.in_file(path, f"{unsound}; the file was edited; export it again")
    disagrees = (
        np.abs(rotation_from_quaternion(quaternion) - eo.C_mc).max(axis=(1, 2), initial=0.0)
        > AGREEMENT
    )
    if disagrees.any() or not is_rotation(eo.C_mc):
        name = eo.images[int(np.argmax(disagrees))]
        raise InputError.in_file(
            path,
            f"image {name}: C_mc and quaternion disagree, or C_mc is no rotation; the file was"
            " edited; export it again",
        )
    return eo


def read_one_camera(path: Source, consumer: str) -> ExteriorOrientation:
    """Read the master file of a single camera.

    Parameters
    ----------
    path : path
        The file.
    consumer : str
        Which work takes no other, for the message.

    Returns
    -------
    ExteriorOrientation
        As `read_eo_json`.

    Raises
    ------
    InputError
        As `read_eo_json`, and for images of several cameras.
    """
    eo = read_eo_json(path)
    if eo.rig is None:
        return eo
    names = eo.rig.names
    message = (
        f"holds images of {len(names)} cameras ({', '.join(names)}), {consumer} takes those of one"
        f" camera: run insgnss export {Path(path).name} eo_json --camera {names[0]}, and give the"
        " file that it writes"
    )
    raise InputError.in_file(path, message)


def _read_archive(path: Source, content: dict[str, Any]) -> eo_packed.Unpacked | None:
    """Return the numbers that stand in the archive beside; None where the text has them."""
    if content["format_version"] != PACKED_VERSION and "packed" not in content:
        return None
    file, digest = str(content["packed"]["file"]), str(content["packed"]["sha256"])
    if Path(file).name != file:
        raise ValueError(f"packed.file {file!r} is no name of a file beside it")
    return eo_packed.unpack_numbers(Path(path).with_name(file), digest, len(content["images"]))


def _images(
    content: dict[str, Any], packed: eo_packed.Unpacked | None
) -> tuple[tuple[str, ...], dict[str, Any], Array]:
    """Return the names of the images, their numbers, and their quaternions in the tangent plane."""
    images = content["images"]
    if packed is not None:
        quaternion = quaternion_from_rotation(packed.pose["C_mc"])
        return tuple(map(str, images)), packed.pose, quaternion
    numbers = {
        "time": _array(images, "time_s", ()),
        "position_m": _array(images, "position_m", (3,)),
        "C_mc": _array(images, "C_mc", (3, 3)),
        "cov": _array(images, "cov6", (6, 6)),
        "cross": _cross(images),
        "velocity_mps": _optional(images, "velocity_mps"),
        "rate_radps": _optional(images, "rate_radps"),
    }
    names = tuple(str(image["image"]) for image in images)
    return names, numbers, _array(images, "quaternion_wxyz", (4,))


def _rig(content: dict[str, Any], packed: eo_packed.Unpacked | None) -> RigImages | None:
    """Return the cameras of the images, None where one took all of them."""
    if content["format_version"] != RIG_VERSION:
        return None
    cameras = tuple(
        RigCamera(
            str(camera["name"]),
            _of_shape(camera, "boresight", (3, 3)),
            _of_shape(camera, "camera_from_body", (3, 3)),
        )
        for camera in content["cameras"]
    )
    images = content["images"]
    if packed is not None:
        of_rig = packed.rig
        return RigImages(cameras, of_rig["camera"], of_rig["cross_cov6_next_of_camera"])
    numbers = {camera.name: k for k, camera in enumerate(cameras)}
    for image in images:
        if image["camera"] not in numbers:
            raise ValueError(
                f"image {image['image']}: camera {image['camera']!r} is not listed in cameras"
            )
    number = np.array([numbers[image["camera"]] for image in images], dtype=np.int64)
    rig = RigImages(cameras, number)
    last = rig.next_of_camera < 0
    none = [[0.0] * 6] * 6
    crosses = [image["cross_cov6_next_of_camera"] for image in images]
    if not last.all() and all(values is None for values in crosses):
        return rig
    filled = [
        image | {"cross_cov6_next_of_camera": none} if alone else image
        for image, alone in zip(images, last.tolist(), strict=True)
    ]
    return RigImages(cameras, number, _array(filled, "cross_cov6_next_of_camera", (6, 6)))


def _unsound(eo: ExteriorOrientation) -> str:
    """Return what is wrong with times or covariances; an empty text where nothing is."""
    rows = [np.arange(len(eo))] if eo.rig is None else eo.rig.rows
    falls = np.zeros(len(eo), dtype=bool)
    falls[1:] = np.diff(eo.time) < 0.0
    for of_camera in rows:
        falls[of_camera[1:]] |= np.diff(eo.time[of_camera]) <= 0.0
    if falls.any():
        return (
            f"image {eo.images[int(np.argmax(falls))]}: its time does not follow that of the image"
            " before"
        )
    variances = np.diagonal(eo.cov, axis1=1, axis2=2)
    scale = np.sqrt(np.maximum(variances[:, :, None] * variances[:, None, :], 0.0))
    bad = (variances <= 0.0).any(axis=1)
    bad |= (np.abs(eo.cov - np.swapaxes(eo.cov, 1, 2)) > AGREEMENT * scale).any(axis=(1, 2)) | (
        np.abs(eo.cov) > (1.0 + 1e-6) * scale
    ).any(axis=(1, 2))
    if bad.any():
        return (
            f"image {eo.images[int(np.argmax(bad))]}: cov6 is no covariance, it has a variance that"
            " is not positive or is not symmetric"
        )
    return ""


def _array(images: list[dict[str, Any]], key: str, shape: tuple[int, ...]) -> Array:
    """Return the numbers of a key of every image, (n, *shape)."""
    if not images:
        return np.zeros((0, *shape))
    array = array_of([image[key] for image in images], (len(images), *shape))
    if array is None:
        array = np.stack([_of_shape(image, key, shape) for image in images])
    return array


def _of_shape(of: dict[str, Any], key: str, shape: tuple[int, ...]) -> Array:
    """Return the numbers of a key; ValueError, with the image where it is one, for others."""
    if (array := array_of(of[key], shape)) is not None:
        return array
    size = " x ".join(map(str, shape)) + " numbers" if shape else "a number"
    who = f"image {of['image']}: " if "image" in of else ""
    shown_value = "null" if of[key] is None else f"{of[key]!r:.60}"
    raise ValueError(f"{who}{key} is {shown_value}, not {size}")


def _week(content: dict[str, Any]) -> int:
    """Return the GPS week, a whole number."""
    week = float(_of_shape(content, "gps_week", ()))
    if not (week.is_integer() and abs(week) < LARGEST_EXACT_INTEGER):
        raise ValueError(f"gps_week is {content['gps_week']!r}, no whole number")
    return int(week)


def _optional(images: list[dict[str, Any]], key: str) -> Array | None:
    """Vectors (n, 3) of every image; None where no image has one, as in earlier files."""
    return _array(images, key, (3,)) if any(key in image for image in images) else None


def _cross(images: list[dict[str, Any]]) -> Array | None:
    """Covariances between neighbours; None where the file has none of them, as of images that were
    no neighbours.
    """
    if len(images) > 1 and all(image["cross_cov6_next"] is None for image in images):
        return None
    return _array(images[:-1], "cross_cov6_next", (6, 6))


def _content(path: Source) -> dict[str, Any]:
    import orjson

    with readable(path):
        text = read_bytes(path)
    try:
        content = orjson.loads(text)
        if TINY_NUMBERS.search(text):  # orjson takes 1e-400 for zero
            content = parse_json(path, text.decode())
    except orjson.JSONDecodeError as error:
        if "UTF-8" in error.msg:
            raise InputError.in_file(path, "is no UTF-8 text; is it an eo.json?") from None
        if not text.lstrip().startswith(b"{"):
            advice = "give the eo.json of an output directory, or the directory"
            raise InputError.in_file(path, f"is no eo.json; {advice}") from None
        raise InputError.at_line(
            path, error.lineno, f"is no whole JSON: {error.msg}; export it again"
        ) from None
    if not isinstance(content, dict) or content.get("format") != EO_FORMAT:
        raise InputError.in_file(
            path, "is no master EO of insgnss; give the eo.json of an output directory"
        )
    if content.get("format_version") not in VERSIONS:
        raise InputError.in_file(
            path,
            f"format_version {content.get('format_version')!r}, this version reads"
            f" {FORMAT_VERSION} to {RIG_VERSION}; export it again",
        )
    return content
