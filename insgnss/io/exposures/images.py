"""Names of the images of a flight in order, and the time of each by the camera's own clock.

That clock may be off by any constant.
"""

import re
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

import numpy as np

from ...base.errors import InputError
from ...base.files import lines_of, refuse_other_than_utf8
from ...base.inputs import open_bytes, read_bytes, readable
from ...base.wording import spell
from ...records import Array
from ..formats.images.exif import time_taken
from ..formats.names import IMAGE_ENDINGS
from ..formats.text.layout import decode, quote


def image_names(source: str | Path, ending: str | None = None) -> tuple[str, ...]:
    """Return the names of images, of a directory or of a list.

    Parameters
    ----------
    source : path-like
        A directory, whose images are taken in the order of the numbers in their names, or a list
        with one name a line, which is taken as it stands.
    ending : str, optional
        Of the files to take, such as ".jpg"; needed where the directory holds the same images in
        several formats.

    Raises
    ------
    InputError
        Where there is no image, a name twice, or several formats of the same image.
    """
    path = Path(source)
    if path.is_dir():
        files = [
            entry.name
            for entry in path.iterdir()
            if entry.is_file() and not entry.name.startswith(".")
        ]
        endings = IMAGE_ENDINGS if ending is None else {"." + ending.lower().lstrip(".")}
        names = sorted(
            (name for name in files if Path(name).suffix.lower() in endings), key=natural
        )
        if len({Path(name).stem for name in names}) < len(names):
            kinds = sorted({Path(name).suffix for name in names})
            raise InputError.in_file(
                path,
                f"holds the same image as {' and '.join(kinds)}; choose one by"
                f" {spell('camera.image_ending')}",
            )
    else:
        with readable(path, "give a directory or a list of names"):
            names = [line.strip() for line in lines_of(decode(read_bytes(path)))]
        names = [name for name in names if name and not name.startswith("#")]
    refuse_other_than_utf8(names)
    if not names:
        raise InputError.in_file(path, "holds no image; check the path and the ending")
    if len(set(names)) < len(names):
        twice = next(name for k, name in enumerate(names) if name in names[:k])
        raise InputError.in_file(path, f"image {quote(twice)} occurs twice; correct the list")
    return tuple(names)


def natural(name: str) -> tuple[tuple[int, int, str], ...]:
    """Order in which IMG_9 stands before IMG_10."""
    return tuple(
        (1, int(piece), "") if piece.isdecimal() and len(piece) < 1000 else (0, 0, piece.lower())
        for piece in re.findall(r"\d+|\D+", name)
    )


def image_times(directory: Path, names: Sequence[str]) -> Array | None:
    """Return the times of images by their camera's clock, s (n,) from the first image.

    None where `directory` is no directory or one of its images holds no time.

    Raises
    ------
    InputError
        An image whose tags are broken, or whose time is none.
    """
    if not directory.is_dir():
        return None
    times: list[datetime] = []
    for name in names:
        try:
            with open_bytes(directory / name) as stream:
                times.append(time_taken(stream, name))
        except (OSError, ValueError):
            return None
        except InputError as error:
            raise InputError(f"{directory}: {error}") from None
    return np.array([(time - times[0]).total_seconds() for time in times])
