"""eo_images.npz: the numbers of many images beside their eo.json, data_specs/eo_json.md.

As text an image takes 4 kB, most of it covariances; here 568 bytes. The covariance of an image is
symmetric and stands as the upper triangle, its attitude as the quaternion of which C_mc is the
matrix; what follows from others (ECEF) is left out. All other numbers are kept bit by bit.
"""

import hashlib
import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....base.errors import InputError, legible
from ....base.inputs import read_bytes
from ....base.unpacking import check_archive
from ....geodesy.rotation import quaternion_from_rotation, rotation_from_quaternion
from ....records import ExteriorOrientation
from ..text.text import Source

Array = NDArray[np.float64]

FROM_IMAGES = 10_000  # images from which on the numbers stand here: as text they take 40 MB
PACKED_FORMAT = "insgnss images"
UPPER = np.triu_indices(6)  # row and column of each stored entry of a covariance
ARRAYS = {
    "time_s": ((), "seconds of gps_week, GPST"),
    "position_m": ((3,), "projection centre, m, east north up of the tangent plane"),
    "quaternion_wxyz": ((4,), "Hamilton, w x y z, of unit length, of C_mc"),
    "cov6_upper": ((21,), "upper triangle of cov6, row by row"),
    "cross_cov6_next": ((6, 6), "as in conventions, for all images but the last; may be missing"),
    "velocity_mps": ((3,), "as in conventions; may be missing"),
    "rate_radps": ((3,), "as in conventions; may be missing"),
}
RIG_ARRAYS = {
    "camera": ((), "which of `cameras` took the image, from 0"),
    "cross_cov6_next_of_camera": ((6, 6), "as in conventions, zeros for the last; may be missing"),
}
OPTIONAL = ("cross_cov6_next", "velocity_mps", "rate_radps")
TAKE_BOTH = "take both files of one run, or process the flight again"


def side_file(path: Source) -> Path:
    """Return the file of the numbers beside an eo.json."""
    return Path(path).with_name(f"{Path(path).stem}_images.npz")


@dataclass(frozen=True)
class Unpacked:
    """The numbers of the images: arguments of `ExteriorOrientation`, and arrays of a rig.

    The camera of each image and what it shares with the next of it are None of one camera.
    """

    pose: dict[str, Any]
    rig: dict[str, Any]


def meanings(eo: ExteriorOrientation) -> dict[str, str]:
    """Return what the arrays of `pack_numbers` are, in words."""
    arrays = ARRAYS | ({} if eo.rig is None else RIG_ARRAYS)
    return {name: meaning for name, (_, meaning) in arrays.items()}


def pack_numbers(eo: ExteriorOrientation) -> tuple[bytes, str]:
    """Return the numbers of the images as the content of a file, and its SHA-256.

    The same numbers give the same bytes.
    """
    arrays: dict[str, Any] = {
        "format": np.array(PACKED_FORMAT),
        "time_s": eo.time,
        "position_m": eo.position_m,
        "quaternion_wxyz": quaternion_from_rotation(eo.C_mc),
        "cov6_upper": eo.cov[:, UPPER[0], UPPER[1]],
    }
    optional = (eo.cross, eo.velocity_mps, eo.rate_radps)
    arrays |= {k: v for k, v in zip(OPTIONAL, optional, strict=True) if v is not None}
    if eo.rig is not None:
        arrays["camera"] = eo.rig.number.astype(np.float64)
        if eo.rig.cross is not None:
            arrays["cross_cov6_next_of_camera"] = eo.rig.cross
    stream = io.BytesIO()
    np.savez(stream, allow_pickle=False, **arrays)
    content = stream.getvalue()
    return content, hashlib.sha256(content).hexdigest()


def unpack_numbers(path: Path, digest: str, count: int) -> Unpacked:
    """Return the numbers of `count` images.

    Parameters
    ----------
    path : Path
        The file.
    digest : str
        Its SHA-256 as its eo.json has it.
    count : int
        Images of that eo.json.

    Returns
    -------
    Unpacked
        time, position_m, C_mc, cov, cross, velocity_mps and rate_radps, None for what is missing,
        and what there is of a rig.

    Raises
    ------
    InputError
        The file is missing, another one, or not that of this eo.json.
    """
    try:
        content = read_bytes(path)
    except OSError as error:
        why = "is missing" if isinstance(error, FileNotFoundError) else f"{error.strerror or error}"
        message = f"{why}, but the eo.json beside it keeps its numbers in this file; {TAKE_BOTH}"
        raise InputError.in_file(path, message) from None
    if hashlib.sha256(content).hexdigest() != digest:
        message = (
            f"does not belong to the eo.json beside it, which states another sha256; {TAKE_BOTH}"
        )
        raise InputError.in_file(path, message)
    with (
        legible(path, f"is no whole numpy archive; {TAKE_BOTH}"),
        np.load(io.BytesIO(content), allow_pickle=False) as file,
    ):
        check_archive(path, file.zip)
        if "format" not in file.files or str(file["format"]) != PACKED_FORMAT:
            raise InputError.in_file(path, f"holds no numbers of images; {TAKE_BOTH}")
        arrays = {name: file[name] for name in (*ARRAYS, *RIG_ARRAYS) if name in file.files}
    for name, (shape, _) in (ARRAYS | RIG_ARRAYS).items():
        expected = (count - (name == "cross_cov6_next"), *shape)
        if name not in arrays and name not in (*OPTIONAL, *RIG_ARRAYS):
            raise InputError.in_file(path, f"no {name}; {TAKE_BOTH}")
        if name in arrays and (arrays[name].shape != expected or arrays[name].dtype != np.float64):
            actual = f"{name}: {arrays[name].dtype} of shape {arrays[name].shape}"
            raise InputError.in_file(path, f"{actual}, expected {expected}; {TAKE_BOTH}")
        if name in arrays and not np.isfinite(arrays[name]).all():
            raise InputError.in_file(path, f"{name}: a number is not finite; {TAKE_BOTH}")
    cov = np.empty((count, 6, 6))
    cov[:, UPPER[0], UPPER[1]] = cov[:, UPPER[1], UPPER[0]] = arrays["cov6_upper"]
    quaternion = arrays["quaternion_wxyz"]
    if count and not np.abs(np.linalg.norm(quaternion, axis=1) - 1.0).max() < 1e-9:
        raise InputError.in_file(path, f"a quaternion is not of unit length; {TAKE_BOTH}")
    pose = {
        "time": arrays["time_s"],
        "position_m": arrays["position_m"],
        "C_mc": rotation_from_quaternion(quaternion),
        "cov": cov,
        "cross": arrays.get("cross_cov6_next"),
        "velocity_mps": arrays.get("velocity_mps"),
        "rate_radps": arrays.get("rate_radps"),
    }
    return Unpacked(pose, {name: arrays.get(name) for name in RIG_ARRAYS})
