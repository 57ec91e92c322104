"""Image observations as a plain table, data_specs/image_points.md."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ....records.block import ImageObservations
from ..orientation.exported import quoted_names
from ..text.columns import Aliases, Columns, sigma_aliases
from ..text.layout import shown
from ..text.text import Source, TextTable, read_text_table
from .columns import first_repeat, named_columns, positive, positive_sigma, rows_of, write_table

ALIASES: Aliases = {
    "image": ("image", "img", "photo", "image_name", "image_id", "filename"),
    "point": ("point", "point_id", "point_name", "id", "pt", "label", "marker"),
    "x": ("x", "u", "col", "column", "x_px"),
    "y": ("y", "v", "row", "line", "y_px"),
    "sigma": ("sigma", "sd", "std", "sigma_px", "sigma_xy"),
    "sigma_x": sigma_aliases("x", "u"),
    "sigma_y": sigma_aliases("y", "v"),
}
REQUIRED = ("image", "point", "x", "y")
DEFAULTS = (REQUIRED, (*REQUIRED, "sigma"), (*REQUIRED, "sigma_x", "sigma_y"))
PIXEL_ORIGIN = (
    "pixels, x right and y down from the outer corner of the upper left pixel, whose centre is"
    " (0.5, 0.5)"
)
PIXELS = ("px", "pixel", "pixels", "pix")
SIGMA_PX = 1.0


@dataclass(frozen=True, eq=False)
class ImagePoints:
    """What was measured in images, by names.

    Parameters
    ----------
    images, points : tuple of str
        Names in the order of the table, each once.
    observations : ImageObservations
        The measurements; their rows are those of `images` and `points`.
    """

    images: tuple[str, ...]
    points: tuple[str, ...]
    observations: ImageObservations


def read_image_points(
    path: Source, sigma_px: float = SIGMA_PX, columns: Columns = None
) -> ImagePoints:
    """Read a table of image observations.

    Parameters
    ----------
    path : path
        The file.
    sigma_px : float
        Standard deviation of both coordinates where the table has no such column, pixels.
    columns : sequence or mapping, optional
        As of `insgnss.io.formats.text.columns.columns_of`; columns that it leaves out are not read.

    Returns
    -------
    ImagePoints
        All observations, those of points that are seen once too.

    Raises
    ------
    InputError
        A column that is unknown, a field that is no number, a standard deviation that is not
        positive, or a point that is measured twice in an image, with file and line.
    DataError
        A `sigma_px` that is not positive.
    """
    positive_sigma(sigma_px, "image points")
    table = read_text_table(path)
    index = named_columns(table, ALIASES, REQUIRED, DEFAULTS, PIXELS, columns)
    both = ("sigma_x" in index, "sigma_y" in index)
    if any(both) and (not all(both) or "sigma" in index):
        raise table.error_at(
            0, "the columns of standard deviations are sigma alone, or sigma_x and sigma_y; choose"
        )
    images, image = rows_of(table, index["image"], "image")
    points, point = rows_of(table, index["point"], "point")
    _once(table, image, point, images, points)
    uv = np.column_stack([table.floats(index[name]) for name in ("x", "y")])
    sigma = np.full_like(uv, sigma_px)
    for k, name in enumerate(("sigma_x", "sigma_y")):
        if (key := "sigma" if "sigma" in index else name) in index:
            sigma[:, k] = positive(table, index[key], key, "px")
    return ImagePoints(images, points, ImageObservations(image, point, uv, sigma))


def _once(
    table: TextTable,
    image: NDArray[np.int64],
    point: NDArray[np.int64],
    images: Sequence[str],
    points: Sequence[str],
) -> None:
    """Refuse a table in which an image has two measurements of one point."""
    if (twice := first_repeat(image, point)) is not None:
        first, row = twice
        raise table.error_at(
            row,
            f"point {shown(points[point[row]])} is measured twice in image"
            f" {shown(images[image[row]])}, before in line {table.lines[first]}; delete one of the"
            " lines",
        )


def write_image_points(measured: ImagePoints, path: Source) -> None:
    """Write a table of image observations: pixels with 4 decimals.

    Parameters
    ----------
    measured : ImagePoints
        The observations.
    path : path
        The file, written whole or not at all.

    Raises
    ------
    InputError
        A name that the table cannot hold.
    UsageError
        The file cannot be written.
    """
    images = quoted_names(measured.images, ",")
    points = quoted_names(measured.points, ",", "point")
    seen = measured.observations
    equal = bool((seen.sigma_px[:, 0] == seen.sigma_px[:, 1]).all())
    names = (*REQUIRED, "sigma") if equal else (*REQUIRED, "sigma_x", "sigma_y")
    sigma = seen.sigma_px[:, :1] if equal else seen.sigma_px
    form = "%s,%s,%.4f,%.4f" + ",%.6g" * sigma.shape[1] + "\n"
    values = np.hstack([seen.uv, sigma]).tolist()
    rows = (
        form % (images[i], points[p], *row)
        for i, p, row in zip(seen.image.tolist(), seen.point.tolist(), values, strict=True)
    )
    write_table(path, (f"image observations: {PIXEL_ORIGIN}",), names, rows)
