"""When an image was taken, and by whose camera, by its Exif.

DateTimeOriginal gives it to a second and, where the camera writes it, SubSecTimeOriginal its
fraction.

In JPEG, TIFF and the raw formats that are TIFF; nothing but the tags is read.
"""

from datetime import datetime
from typing import BinaryIO

from .jpeg import exif_of
from .tiff_tags import Tiff

CAMERA_MAKE, ORIGINAL, FRACTION = 0x010F, 0x9003, 0x9291


def time_taken(stream: BinaryIO, who: str) -> datetime:
    """Return the time of an image by its camera's clock.

    Raises
    ------
    ValueError
        The image has no time.
    InputError
        Its tags are broken.
    """
    tiff = _tags(stream, who)
    if tiff is None:
        raise ValueError(f"{who}: has no Exif")
    second, fraction = (
        (tiff.bytes_of(tiff.exif, tag) or b"").decode("ascii").strip("\0 ")
        for tag in (ORIGINAL, FRACTION)
    )
    return datetime.strptime(f"{second}.{fraction[:6] or 0}", "%Y:%m:%d %H:%M:%S.%f")


def camera_maker(stream: BinaryIO, who: str) -> str:
    """Return who made the camera of an image, empty where it does not say.

    Raises
    ------
    InputError
        Its tags are broken.
    """
    tiff = _tags(stream, who)
    maker = b"" if tiff is None else tiff.bytes_of(tiff.first, CAMERA_MAKE) or b""
    return maker.decode("ascii", "replace").strip("\0 ")


def _tags(stream: BinaryIO, who: str) -> Tiff | None:
    """Return the directories of a TIFF, or of a JPEG's Exif; None where there are none."""
    size = stream.seek(0, 2)

    def read(offset: int, length: int) -> bytes:
        stream.seek(offset)
        return stream.read(length)

    if read(0, 2) in (b"II", b"MM"):
        return Tiff(read, size, who)
    exif = exif_of(read, size, who) if read(0, 2) == b"\xff\xd8" else b""
    if not exif:
        return None
    return Tiff(lambda offset, length: exif[offset : offset + length], len(exif), who)
