"""Which images stand together in one covariance: those of a flight line.

Lines are those of relative control (`navigation.orient.relative.line_numbers`). An image where two
lines meet belongs to the first of them, and one in no line has its own covariance alone. Where
fewer than half of the images lie in lines, as on a drive through bends, all images do, piece by
piece in the order of time. A line of many images is cut into equal pieces, since its covariance
grows with the square of their number. Errors of two segments share nothing, and no strip holds
images of both.
"""

import numpy as np
from numpy.typing import NDArray

from ...records import ExteriorOrientation
from .frame import in_frame
from .relative import line_numbers

MOST_STRIP_IMAGES = 400  # images of a strip: 46 MB
LARGEST_BYTES = 256e6  # of all strips of a flight; pieces are smaller where it takes more
BYTES = 8 * 6 * 6  # of a pair of images
LINE_IMAGES, IN_LINES = 3, 0.5  # a line of two is none; share of the images


def strip_rows(
    eo: ExteriorOrientation, segment: NDArray[np.int64], largest: int = MOST_STRIP_IMAGES
) -> tuple[NDArray[np.int64], ...]:
    """Return the rows of the images of each strip.

    Parameters
    ----------
    eo : ExteriorOrientation
        The n images.
    segment : ndarray
        (n,) number of the segment of each image, not decreasing.
    largest : int
        Most images of a strip.

    Returns
    -------
    tuple of ndarray
        Consecutive rows of two images at least, in the order of time; none stands in two strips.
    """
    framed, n = in_frame(eo, "tangent plane"), len(eo)
    number = line_numbers(framed.time, framed.coordinates, framed.C_fE[:, :, 2], framed.C_fc)
    long = np.flatnonzero(np.bincount(number, minlength=1) >= LINE_IMAGES)
    if np.isin(number, long[long > 0]).sum() < IN_LINES * n:
        number[:] = 1
    largest = max(2, min(largest, int(LARGEST_BYTES / (BYTES * max(n, 1)))))
    edges = np.flatnonzero((np.diff(number) != 0) | (np.diff(segment) != 0)) + 1
    strips: list[NDArray[np.int64]] = []
    for rows in np.split(np.arange(n), edges):
        if rows.size > 1 and number[rows[0]] > 0:
            strips += np.array_split(rows, -(-rows.size // largest))
    return tuple(strips)
