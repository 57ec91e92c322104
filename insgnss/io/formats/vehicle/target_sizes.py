"""Apparent sizes of a target of known size as a plain table, data_specs/target_sizes.md."""

from dataclasses import dataclass

import numpy as np

from ....records import Array
from ..blocks.image_points import PIXEL_UNITS
from ..names import IN_IMAGE
from ..orientation.exported import quoted_names
from ..text.columns import Columns, TableOut, TableSpec
from ..text.layout import quote
from ..text.order import refuse_rows
from ..text.text import Source

OUT = TableOut("image point size_px=%.4f sigma_px=%.4g")
SPEC = TableSpec(
    {
        **IN_IMAGE,
        "size_px": "size_px size diameter diameter_px major_axis major_axis_px",
        "sigma_px": "sigma_px sigma sd std sigma_size sigma_size_px",
    },
    required=OUT.names,
    layouts=(OUT.names,),
    text=True,
    strict=PIXEL_UNITS,
)


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
        As of `text.columns.TableSpec.index`.

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
    table = SPEC.read(path, columns)
    images, image = table.rows_of("image", "image")
    points, point = table.rows_of("point", "point")
    table.refuse_repeats(lambda row: f"image {quote(images[image[row]])} has two sizes", image)
    size, sigma = table.floats("size_px"), table.positive("sigma_px", "px")[:, 0]
    refuse_rows(table, size <= 0.0, "size_px {:g} px; a size must be greater than zero", size)
    return TargetSizes(
        tuple(images[i] for i in image), tuple(points[p] for p in point), size, sigma
    )


def write_target_sizes(sizes: TargetSizes, path: Source) -> None:
    """Write a table of target sizes, pixels with 4 decimals.

    Parameters
    ----------
    sizes : TargetSizes
        The sizes.
    path : path
        The file, written whole or not at all.

    Raises
    ------
    InputError
        A name that the table cannot hold.
    UsageError
        The file cannot be written.
    """
    images = quoted_names(sizes.images, ",")
    points = quoted_names(sizes.points, ",", "point")
    numbers = np.column_stack([sizes.size_px, sizes.sigma_px])
    OUT.write(path, numbers, images, points)
