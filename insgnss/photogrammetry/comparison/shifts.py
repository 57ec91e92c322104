"""What was subtracted from the coordinates of a file, and their CRS, by the positions of the other.

An export to COLMAP subtracts whole kilometres and says so in a comment, which COLMAP drops. A wrong
zone, or metres declared as feet, puts an image hundreds of kilometres away, while its numbers are
those of another CRS at the place of the other file.
"""

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...geodesy.crs import crs_of, source_crs
from ...io.formats.blocks.joined import matched
from ...io.formats.returned.crs import kind_of_crs
from ...io.formats.returned.reading import RETURNED, read_returned_poses
from ...records.framed import GEOCENTRIC, PROJECTED
from .hints import Hints
from .poses import Poses
from .reading import sniff_poses

Array = NDArray[np.float64]

STEP = 1000.0  # of what is subtracted, in the unit of the CRS: exports round to it
# largest difference of both files' positions beside whole steps: beyond, the next step is as near
CERTAIN = 0.3 * STEP
FEWEST = 3  # images of both files, by name: an outlier among fewer would be the median
# largest scatter of both files' differences, in that of the positions: axes of another CRS are
# turned by degrees against each other, 0.5 % are 0.3 deg
OF_EXTENT = 0.005
FITTING = 20.0  # distance (units of a CRS) up to which coordinates fit it: an adjustment moves less
OF_DATUM = (
    2000.0  # largest shift of a datum, in feet: without it a CRS is looked at in a millisecond
)
ALIKE = 1.0  # distance by which another CRS may fit worse and is named as well: WGS 84 and ETRS89
MOST_CRS = 2  # that are named: more do not fit into a line


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
    row = matched(returned.images, reference.images)
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
    whole = STEP * np.round(middle / STEP)
    if not whole.any() or np.abs(middle - whole).max() > CERTAIN:
        return None
    if _scatter(difference) > OF_EXTENT * _scatter(expected[to]):
        return None
    shift = (float(whole[0]), float(whole[1]), float(whole[2]))
    return replace(hints, crs=crs, shift=shift)


def fitting_crs(numbers: Array, reference: Poses) -> str:
    """Return the projected CRSs at the place of a file in which the numbers of the other one fit.

    Parameters
    ----------
    numbers : (n, 3) coordinates as the file has them.
    reference : the positions of the same flight.

    Returns
    -------
    Codes with "or" between them; empty where none of the registry fits.
    """
    from pyproj import CRS, Proj, Transformer
    from pyproj.aoi import AreaOfInterest
    from pyproj.database import query_crs_info
    from pyproj.enums import PJType
    from pyproj.exceptions import CRSError, ProjError

    lat, lon = np.degrees([np.median(reference.lat), np.median(reference.lon)]).tolist()
    globe = source_crs(reference.datum, reference.epoch)
    middle = np.median(numbers[:, :2], axis=0)
    tolerance = FITTING + _scatter(reference.ecef)
    fits = []
    for info in query_crs_info("EPSG", PJType.PROJECTED_CRS, AreaOfInterest(lon, lat, lon, lat)):
        try:
            crs = CRS.from_epsg(int(info.code))
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # that a PROJ text has no datum: it need not
                if np.linalg.norm(Proj(crs)(lon, lat) - middle) > tolerance + OF_DATUM:
                    continue
            x = Transformer.from_crs(globe, crs, always_xy=True).transform(lon, lat)
        except (CRSError, ProjError):
            continue
        distance = float(np.linalg.norm(x[:2] - middle))
        if distance < tolerance:
            geodetic = crs.geodetic_crs
            other_datum = geodetic is None or geodetic.name != globe.name
            fits.append((other_datum, distance, f"EPSG:{info.code} {info.name}"))
    nearest = min((distance for _, distance, _ in fits), default=0.0)
    names = [name for _, distance, name in sorted(fits) if distance <= nearest + ALIKE]
    return " or ".join(names[:MOST_CRS])


def _scatter(difference: Array) -> float:
    """Return the median distance of differences (n, 3) from their median."""
    middle = np.median(difference, axis=0)
    return float(np.median(np.linalg.norm(difference - middle, axis=1)))
