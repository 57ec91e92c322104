"""The time of each image by the camera's own clock, and what it tells where events and images are not the same number.

Exif holds DateTimeOriginal to a second and, where the camera writes it, SubSecTimeOriginal behind it; in JPEG, TIFF and the raw formats
that are TIFF. The clock may be off by any constant. Where the counts agree these times are not asked: cameras stamp the end of writing
as well as the exposure, some only to a second.
"""

from collections.abc import Callable, Sequence
from datetime import datetime
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ..errors import InputError
from ..formats._jpeg import with_tags
from ..formats._tiff_tags import Tiff
from ..records import Array, CameraEvents

ORIGINAL, FRACTION = 0x9003, 0x9291  # DateTimeOriginal, SubSecTimeOriginal


def with_times(match: Callable[[Array | None], CameraEvents], place: Path | None, names: Sequence[str] | None) -> CameraEvents:
    """`match(None)`; where it refuses and the images of the directory `place` tell their times, what `match(times)` says."""
    try:
        return match(None)
    except InputError:
        times = None if place is None or names is None else image_times(place, names)
        if times is None:
            raise
        return match(times)


def image_times(place: Path, names: Sequence[str]) -> Array | None:
    """Seconds (n,) from the first image, None where `place` is no directory or one of its images does not tell its time."""
    if not place.is_dir():
        return None
    times: list[datetime] = []
    for name in names:
        try:
            with (place / name).open("rb") as stream:
                times.append(_taken(stream, name))
        except (OSError, ValueError, InputError):
            return None
    return np.array([(time - times[0]).total_seconds() for time in times])


def _taken(stream: BinaryIO, who: str) -> datetime:
    """Time of one image; ValueError or InputError where it has none."""
    size = stream.seek(0, 2)

    def read(offset: int, length: int) -> bytes:
        stream.seek(offset)
        return stream.read(length)

    if read(0, 2) == b"\xff\xd8":
        exif = _exif_of_jpeg(read, size, who)
        tiff = Tiff(lambda offset, length: exif[offset : offset + length], len(exif), who)
    else:
        tiff = Tiff(read, size, who)
    second, fraction = ((tiff.bytes_of(tiff.exif, tag) or b"").decode("ascii").strip("\0 ") for tag in (ORIGINAL, FRACTION))
    return datetime.strptime(f"{second}.{fraction[:6] or 0}", "%Y:%m:%d %H:%M:%S.%f")


def _exif_of_jpeg(read: Callable[[int, int], bytes], size: int, who: str) -> bytes:
    """The TIFF within the Exif segment, empty without one."""
    found: list[bytes] = []

    def seen(exif: bytes | None) -> bytes:
        found.append(exif or b"")
        return found[0]

    with_tags(read, size, who, seen, lambda packet: packet or b"")
    return found[0]
