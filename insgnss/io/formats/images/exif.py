"""When an image was taken, and by which camera, by its Exif.

DateTimeOriginal gives it to a second and, where the camera writes it, SubSecTimeOriginal its
fraction.

In JPEG, TIFF and the raw formats that are TIFF; nothing but the tags is read.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from typing import BinaryIO

from ....base.errors import InputError
from .jpeg import exif_of
from .tiff_tags import Tiff

# tags of Exif
CAMERA_MAKE, CAMERA_MODEL, EXIF_VERSION, ORIGINAL = 0x010F, 0x0110, 0x9000, 0x9003
FRACTION, OFFSET_ORIGINAL = 0x9291, 0x9011  # of DateTimeOriginal
# PixelXDimension, PixelYDimension, FocalLengthIn35mm
IMAGE_COLUMNS, IMAGE_ROWS, FOCAL_35_MM = 0xA002, 0xA003, 0xA405
TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")  # how TIFF and BigTIFF begin
DIAGONAL_35_MM = math.hypot(36.0, 24.0)  # of the film that FocalLengthIn35mmFilm speaks of


@dataclass(frozen=True)
class CameraTags:
    """What Exif says of the camera of an image.

    Parameters
    ----------
    model : str
        Its name; empty where it has none.
    image_size : tuple of int or None
        Columns and rows.
    focal_px : float or None
        Focal length, pixels, by that in 35 mm film, a whole number of mm that holds for the
        diagonal; good to 15 %.
    """

    model: str
    image_size: tuple[int, int] | None
    focal_px: float | None


def reader(stream: BinaryIO) -> Callable[[int, int], bytes]:
    """Return a function that reads bytes of a file at an offset and of a length."""

    def read(offset: int, length: int) -> bytes:
        stream.seek(offset)
        return stream.read(length)

    return read


def camera_tags(stream: BinaryIO, who: str) -> CameraTags:
    """Return what an image says of its camera, as far as it does.

    Parameters
    ----------
    stream : binary file
        The image.
    who : str
        Its name, for messages.

    Returns
    -------
    CameraTags
        The camera.

    Raises
    ------
    InputError
        Its tags are broken.
    """
    tiff = _tags(stream, who)
    if tiff is None:
        return CameraTags("", None, None)
    columns, rows, focal = (
        tiff.number_of(tiff.exif, tag) for tag in (IMAGE_COLUMNS, IMAGE_ROWS, FOCAL_35_MM)
    )
    size = (int(columns), int(rows)) if columns and rows else None
    focal_px = focal * math.hypot(*size) / DIAGONAL_35_MM if focal and size else None
    return CameraTags(tiff.text_of(tiff.first, CAMERA_MODEL), size, focal_px)


def time_taken(stream: BinaryIO, who: str) -> datetime:
    """Return the time of an image by its camera's clock.

    Raises
    ------
    ValueError
        The image has no time.
    InputError
        Its time is none, or its tags are broken.
    """
    second, fraction, _ = _written_time(stream, who)
    try:
        return datetime.strptime(f"{second}.{fraction[:6] or 0}", "%Y:%m:%d %H:%M:%S.%f")
    except ValueError:
        problem = f"DateTimeOriginal {second!r} with the fraction {fraction!r} is no time"
        advice = "correct the tags, or give a list of names (camera.images) in place of the images"
        raise InputError(f"{who}: {problem}; {advice}") from None


def stamp_taken(stream: BinaryIO, who: str) -> str:
    """Return the time of an image as it stands: `2021:03:18 12:19:04.62+02:00`.

    The fraction and the offset from UTC are there where the camera wrote them.

    Raises
    ------
    ValueError
        The image has no time.
    InputError
        Its tags are broken.
    """
    second, fraction, offset = _written_time(stream, who)
    return f"{second}{'.' if fraction else ''}{fraction}{offset}"


def _written_time(stream: BinaryIO, who: str) -> tuple[str, ...]:
    """Return second, fraction and offset as they stand; ValueError for an image without time.

    Exif writes an unknown time as blanks between colons; cameras whose clock was never set, zeros.
    """
    tiff = _tags(stream, who)
    if tiff is None:
        raise ValueError(f"{who}: has no Exif")
    second, fraction, offset = (
        tiff.text_of(tiff.exif, tag) for tag in (ORIGINAL, FRACTION, OFFSET_ORIGINAL)
    )
    if not second.strip(" :0"):
        raise ValueError(f"{who}: has no DateTimeOriginal")
    return second, fraction, "" if not offset.strip(" :") else offset


def camera_maker(stream: BinaryIO, who: str) -> str:
    """Return who made the camera of an image, empty where it does not say.

    Raises
    ------
    InputError
        Its tags are broken.
    """
    tiff = _tags(stream, who)
    return "" if tiff is None else tiff.text_of(tiff.first, CAMERA_MAKE)


def exif_version(stream: BinaryIO, who: str) -> bytes | None:
    """Return the version of Exif of an image, such as b"0231"; None where it has none.

    Raises
    ------
    InputError
        Its tags are broken.
    """
    tiff = _tags(stream, who)
    return None if tiff is None else tiff.bytes_of(tiff.exif, EXIF_VERSION)


def _tags(stream: BinaryIO, who: str) -> Tiff | None:
    """Return the directories of a TIFF, or of a JPEG's Exif; None where there are none."""
    size, read = stream.seek(0, 2), reader(stream)
    if read(0, 4) in TIFF:  # raw files of another kind begin with II or MM, too
        return Tiff(read, size, who)
    exif = exif_of(read, size, who) if read(0, 2) == b"\xff\xd8" else b""
    if not exif:
        return None
    return Tiff(lambda offset, length: exif[offset : offset + length], len(exif), who)
