"""Image observations as a plain table, data_specs/image_points.md."""

from dataclasses import dataclass

import numpy as np

from ....base.errors import DataError
from ....records.block import ImageObservations
from ..names import IN_IMAGE, sigma_names
from ..orientation.exported import quoted_names
from ..text.columns import Columns, TableOut, TableSpec
from ..text.layout import quote
from ..text.order import refuse_rows
from ..text.text import Source

PIXEL_UNITS = "px pixel pixels pix"
SPEC = TableSpec(
    {
        **IN_IMAGE,
        "x": "x u col column x_px",
        "y": "y v row line y_px",
        "sigma": "sigma sd std sigma_px sigma_xy",
        "sigma_x": sigma_names("x u"),
        "sigma_y": sigma_names("y v"),
        "correlation": "correlation corr rho rho_xy corr_xy",
    },
    required="image point x y",
    layouts=(
        "image point x y",
        "image point x y sigma",
        "image point x y sigma_x sigma_y",
        "image point x y sigma_x sigma_y correlation",
    ),
    text=True,
    strict=PIXEL_UNITS,
)
OUT = TableOut("image point x=%.4f y=%.4f")
PIXEL_ORIGIN = (
    "pixels, x right and y down from the outer corner of the upper left pixel, whose centre is"
    " (0.5, 0.5)"
)
SIGMA_PX = 1.0  # of points whose table has no standard deviations: a careful click


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
        As of `text.columns.TableSpec.index`; columns that it leaves out are not read.

    Returns
    -------
    ImagePoints
        All observations, those of points that are seen once too.

    Raises
    ------
    InputError
        A column that is unknown, a field that is no number, a standard deviation that is not
        positive, a correlation that is not between -1 and 1, or a point that is measured twice in
        an image, with file and line.
    DataError
        A `sigma_px` that is not positive.
    """
    positive_sigma(sigma_px, "image points")
    table = SPEC.read(path, columns)
    sigma_columns = ("sigma_x" in table, "sigma_y" in table)
    if any(sigma_columns) and (not all(sigma_columns) or "sigma" in table):
        raise table.error_at(
            0, "the columns of standard deviations are sigma alone, or sigma_x and sigma_y; choose"
        )
    images, image = table.rows_of("image", "image")
    points, point = table.rows_of("point", "point")

    def measured_twice(row: int) -> str:
        where = f"in image {quote(images[image[row]])}"
        return f"point {quote(points[point[row]])} is measured twice {where}"

    table.refuse_repeats(measured_twice, image, point)
    uv = table.block("x y")
    sigma = np.full_like(uv, sigma_px)
    if "sigma" in table or all(sigma_columns):
        sigma[:] = table.positive("sigma" if "sigma" in table else "sigma_x sigma_y", "px")
    correlation = table.floats("correlation") if "correlation" in table else np.zeros(len(uv))
    message = "correlation {:g}; it must be between -1 and 1"
    refuse_rows(table, np.abs(correlation) >= 1.0, message, correlation)
    return ImagePoints(images, points, ImageObservations(image, point, uv, sigma, correlation))


def write_image_points(measured: ImagePoints, path: Source) -> None:
    """Write a table of image observations: pixels with 4 decimals.

    Parameters
    ----------
    measured : ImagePoints
        The image observations.
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
    marks = measured.observations
    correlated = bool(marks.correlation.any())
    equal = not correlated and bool((marks.sigma_px[:, 0] == marks.sigma_px[:, 1]).all())
    sigma = marks.sigma_px[:, :1] if equal else marks.sigma_px
    out = OUT.with_columns("sigma=%.6g" if equal else "sigma_x=%.6g sigma_y=%.6g")
    if correlated:
        out = out.with_columns("correlation=%.5f")
        sigma = np.column_stack([sigma, marks.correlation])
    names = [images[i] for i in marks.image], [points[p] for p in marks.point]
    comment = f"image observations: {PIXEL_ORIGIN}"
    out.write(path, np.hstack([marks.uv, sigma]), *names, comments=(comment,))


def positive_sigma(sigma_px: float, who: str) -> None:
    """Refuse a standard deviation of image observations that is not positive.

    Parameters
    ----------
    sigma_px : float
        The standard deviation, pixels.
    who : str
        Who takes it, for the message.

    Raises
    ------
    DataError
        It is not positive.
    """
    if not 0.0 < sigma_px < np.inf:
        raise DataError(f"{who}: sigma_px {sigma_px:g}; it must be positive")
