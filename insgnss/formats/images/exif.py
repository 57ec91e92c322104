"""When an image was taken, by its Exif.

DateTimeOriginal gives it to a second and, where the camera writes it, SubSecTimeOriginal its
fraction.

In JPEG, TIFF and the raw formats that are TIFF; nothing but the tags is read.
"""

from datetime import datetime
from typing import BinaryIO

from .jpeg import exif_of
from .tiff_tags import Tiff

ORIGINAL, FRACTION = 0x9003, 0x9291


def time_taken(stream: BinaryIO, who: str) -> datetime:
    """Return the time of an image by its camera's clock.

    Raises
    ------
    ValueError
        The image has no time.
    InputError
        Its tags are broken.
    """
    size = stream.seek(0, 2)

    def read(offset: int, length: int) -> bytes:
        stream.seek(offset)
        return stream.read(length)

    if read(0, 2) == b"\xff\xd8":
        exif = exif_of(read, size, who)
        tiff = Tiff(lambda offset, length: exif[offset : offset + length], len(exif), who)
    else:
        tiff = Tiff(read, size, who)
    second, fraction = (
        (tiff.bytes_of(tiff.exif, tag) or b"").decode("ascii").strip("\0 ")
        for tag in (ORIGINAL, FRACTION)
    )
    return datetime.strptime(f"{second}.{fraction[:6] or 0}", "%Y:%m:%d %H:%M:%S.%f")
