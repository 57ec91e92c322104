"""What was subtracted from the coordinates of a file, by the positions of the other.

An export to COLMAP subtracts whole kilometres and says so in a comment, which COLMAP drops.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from ...geodesy.crs import crs_of
from ...io.formats.blocks.joined import match_names
from ...io.formats.returned.crs import kind_of_crs
from ...io.formats.returned.reading import RETURNED, read_returned_poses
from ...records import Array
from ...records.framed import GEOCENTRIC, PROJECTED
from .hints import Hints
from .poses import Poses
from .reading import sniff_poses

KILOMETRE = 1000.0  # of what is subtracted, in the unit of the CRS: exports round to it
# largest difference of both files' positions beside whole steps: beyond, the next step is as near
CERTAIN_SHIFT_M = 0.3 * KILOMETRE
FEWEST = 3  # images of both files, by name: an outlier among fewer would be the median
# largest scatter of both files' differences, in that of the positions: axes of another CRS are
# turned by degrees against each other, 0.5 % are 0.3 deg
OF_EXTENT = 0.005
OF_PLANE = 0.1  # of what whole steps leave, where the tangent plane of the other file leaves less


def shift_from_positions(
    path: Path, form: str | None, hints: Hints, reference: Poses
) -> Hints | None:
    """Return the hints with what was subtracted from the coordinates of a file.

    Parameters
    ----------
    path, form : the file.
    hints : what the caller says of it: its CRS; without one it is held against geocentric axes and
        the tangent plane of `reference`.
    reference : positions of the same images.

    Returns
    -------
    None where the positions do not tell it: too few names in common, or no whole kilometres.
    """
    form = form or sniff_poses(path)
    if form not in RETURNED or hints.shift is not None:
        return None
    returned = read_returned_poses(path, form)
    row = match_names(returned.images, reference.images)
    position, to = returned.position[row >= 0], row[row >= 0]
    if returned.kind not in ("", PROJECTED) or to.size < FEWEST:
        return None
    crs = hints.crs or returned.crs or "EPSG:4978"
    if kind_of_crs(crs_of(crs))[0] == GEOCENTRIC:
        expected = reference.ecef
    else:
        projection = hints.projected(crs)
        expected = (
            projection.forward(reference.lat, reference.lon, reference.height) / projection.unit_m
        )
    difference = expected[to] - position
    middle = np.median(difference, axis=0)
    whole = KILOMETRE * np.round(middle / KILOMETRE)
    if not whole.any() or np.abs(middle - whole).max() > CERTAIN_SHIFT_M:
        return None
    if scatter(difference) > OF_EXTENT * scatter(expected[to]):
        return None
    if reference.plane is not None:  # in whose axes the coordinates may stand as they are
        x = reference.plane.position_from_geodetic(reference.lat, reference.lon, reference.height)
        beside = np.median(np.abs(x[to] - position), axis=0).max()
        if beside < OF_PLANE * np.abs(middle - whole).max():
            return None
    shift = (float(whole[0]), float(whole[1]), float(whole[2]))
    return replace(hints, crs=crs, shift=shift)


def scatter(difference: Array) -> float:
    """Return the median distance of vectors (n, 3) from their median."""
    middle = np.median(difference, axis=0)
    return float(np.median(np.linalg.norm(difference - middle, axis=1)))
