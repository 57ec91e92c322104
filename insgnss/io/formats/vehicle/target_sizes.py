"""Apparent sizes of a target of known size as a plain table, data_specs/target_sizes.md."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..blocks.columns import first_repeat, named_columns, positive, rows_of, write_table
from ..blocks.image_points import ALIASES as IMAGE_POINTS
from ..blocks.image_points import PIXELS
from ..orientation.exported import quoted_names
from ..text.columns import Aliases, Columns
from ..text.layout import shown
from ..text.text import Source, read_text_table

Array = NDArray[np.float64]

COLUMNS = ("image", "point", "size_px", "sigma_px")
ALIASES: Aliases = {
    "image": IMAGE_POINTS["image"],
    "point": IMAGE_POINTS["point"],
    "size_px": ("size_px", "size", "diameter", "diameter_px", "major_axis", "major_axis_px"),
    "sigma_px": ("sigma_px", "sigma", "sd", "std", "sigma_size", "sigma_size_px"),
}


@dataclass(frozen=True, eq=False)
class TargetSizes:
    """Apparent sizes of a target.

    Parameters
    ----------
    images, points : tuple of str
        (n,) image and point of each.
    size_px, sigma_px : ndarray
        (n,) length of the diameter that is parallel to the image, without distortion, and its
        standard deviation, pixels.
    """

    images: tuple[str, ...]
    points: tuple[str, ...]
    size_px: Array
    sigma_px: Array


def read_target_sizes(path: Source, columns: Columns = None) -> TargetSizes:
    """Read a table of target sizes.

    Parameters
    ----------
    path : path
        The file.
    columns : sequence or mapping, optional
        As of `insgnss.io.formats.text.columns.columns_of`.

    Returns
    -------
    TargetSizes
        The sizes.

    Raises
    ------
    InputError
        A column that is unknown, a field that is no number, a length that is not positive, or an
        image with two sizes, with file and line.
    """
    table = read_text_table(path)
    index = named_columns(table, ALIASES, COLUMNS, (COLUMNS,), PIXELS, columns)
    images, image = rows_of(table, index["image"], "image")
    points, point = rows_of(table, index["point"], "point")
    if (twice := first_repeat(image)) is not None:
        raise table.error_at(
            twice[1],
            f"image {shown(images[image[twice[1]]])} has two sizes, the first in line"
            f" {table.lines[twice[0]]}; delete one of the lines",
        )
    size = table.floats(index["size_px"])
    if (size <= 0.0).any():
        row = int(np.argmax(size <= 0.0))
        raise table.error_at(row, f"size_px {size[row]:g} px; a size must be greater than zero")
    sigma = positive(table, index["sigma_px"], "sigma_px", "px")
    return TargetSizes(
        tuple(images[i] for i in image), tuple(points[p] for p in point), size, sigma
    )


def write_target_sizes(sizes: TargetSizes, path: Source, comments: Sequence[str] = ()) -> None:
    """Write a table of target sizes, pixels with 4 decimals.

    Parameters
    ----------
    sizes : TargetSizes
        The sizes.
    path : path
        The file, written whole or not at all.
    comments : sequence of str
        Lines before the header.

    Raises
    ------
    InputError
        A name that the table cannot hold.
    UsageError
        The file cannot be written.
    """
    images = quoted_names(sizes.images, ",")
    points = quoted_names(sizes.points, ",", "point")
    rows = (
        f"{image},{point},{size:.4f},{sigma:.4g}\n"
        for image, point, size, sigma in zip(
            images, points, sizes.size_px, sizes.sigma_px, strict=True
        )
    )
    write_table(path, comments, COLUMNS, rows)
