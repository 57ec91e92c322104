"""PATB orientation file, data_specs/patb.md.

Three records a photo in Fortran's fixed columns: I16,16X,3F16.5 number, X, Y, Z; 5F16.12 a11 a12
a13 a21 a22; 4F16.12 a23 a31 a32 a33. The matrix is written as Rx(omega) Ry(phi) Rz(kappa), camera
right-up-back to the frame; that PATB means this direction could not be checked: sin(phi) must stand
at a13. Photos have numbers, which are the file names without ending where all of these are numbers,
else 1, 2, ...; a table beside the file says which is which. Standard deviations have no place.
"""

from pathlib import Path, PurePath

import numpy as np

from ...base.files import atomic_writes
from ...records import FramedOrientation
from ...records.framed import PROJECTED, TANGENT
from ..orientation.exported import (
    check_frame,
    check_names,
    comment_lines,
    frame_attitude,
    places,
    table_text,
)
from ..text.text import Source

WIDEST = 10**15
FORM = "%16d" + 16 * " " + "%16.5f" * 3 + "\n" + "%16.12f" * 5 + "\n" + "%16.12f" * 4 + "\n"


def write_patb(eo: FramedOrientation, path: Source) -> None:
    """Write a projected or tangent-plane frame, and <name>_ids.txt beside it.

    Metres have 5 decimals, matrices 12.

    Raises
    ------
    UsageError
        Another frame.
    InputError
        Names with line ends.
    """
    check_frame(eo, "patb", PROJECTED, TANGENT)
    check_names(eo.images, "\n")
    numbers = photo_numbers(eo.images)
    R, _ = frame_attitude(eo)
    table = np.hstack([places(eo), R.reshape(-1, 9)])
    head = comment_lines(
        eo,
        "experimental: PATB's direction of the matrix is unverified; here it takes right-up-back to"
        " the frame",
    )
    path = Path(path)
    beside = "".join(f"{number} {name}\n" for number, name in zip(numbers, eo.images, strict=True))
    atomic_writes(
        {
            path: table_text("", numbers, FORM, table),
            path.with_name(f"{path.stem}_ids.txt"): head + "# number image\n" + beside,
        }
    )


def photo_numbers(images: tuple[str, ...]) -> list[int]:
    """Return numbers of photos: those of their names where all differ, else 1, 2, ..."""
    stems = [PurePath(name).stem for name in images]
    if all(stem.isascii() and stem.isdigit() and int(stem) < WIDEST for stem in stems):
        numbers = [int(stem) for stem in stems]
        if len(set(numbers)) == len(numbers):
            return numbers
    return list(range(1, len(images) + 1))
