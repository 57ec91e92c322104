"""Pictures that tell when they were taken, for tests."""

from pathlib import Path

import pytest


def photograph(path: Path, second: float | None) -> None:
    """A picture of one pixel, taken so many seconds after noon, or without a time."""
    image = pytest.importorskip("PIL.Image")
    exif = image.Exif()
    if second is not None:
        whole, part = divmod(round(1000 * second), 1000)
        exif.get_ifd(0x8769).update(
            {0x9003: f"2018:10:04 12:00:{whole:02d}", 0x9291: f"{part:03d}"}
        )
    if path.suffix == ".dng":
        path.write_bytes(exif.tobytes().removeprefix(b"Exif\0\0"))  # a TIFF of tags alone
    else:
        image.new("L", (1, 1)).save(path, exif=exif)
