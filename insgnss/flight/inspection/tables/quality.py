"""Which column of fixes is their quality, and whose codes it has.

RTKLIB's codes (1 fixed, 2 float, 4 DGPS, 5 single) and those of NMEA (1 single, 2 DGPS, 4 fixed, 5
float) are the same few numbers for opposite things, and no name tells them apart for certain. The
standard deviations beside them do: fixed ambiguities have the smallest, single-point fixes the
largest. Without standard deviations a column that is called quality is taken to have RTKLIB's
codes, as its reader does, and nothing else is taken for one.
"""

import numpy as np

from ....io.formats.gnss.fixes import MOST_QUALITY, NMEA_QUALITY
from ....records import Array
from .names import UnknownTable

MOST_CODES = 6  # that a column of qualities has in one flight; one with more counts satellites
LEAST_ROWS = 5  # of a code
TELLING_RATIO = 3.0  # times that standard deviations of a worse code exceed those of a better one
# from the best: fixed, float, DGPS, single point
_ORDER = {1: 0, 2: 1, 4: 2, 5: 3}


def codes_of(quality: Array, sigma: Array) -> str | None:
    """Return whose codes the quality of fixes has: rtklib or nmea; None where nothing tells.

    Parameters
    ----------
    quality : ndarray, shape (n,)
    sigma : ndarray, shape (n,), any unit
        Standard deviations of the positions; zero, or no number, where a kind of fixes has none, as
        the worst ones do.
    """
    sigma = np.where(np.nan_to_num(sigma) > 0.0, sigma, np.inf)
    codes, counts = np.unique(quality, return_counts=True)
    if codes.size > MOST_CODES or not np.isin(codes, range(MOST_QUALITY + 1)).all():
        return None
    size = {
        int(code): float(np.median(sigma[quality == code]))
        for code, count in zip(codes, counts, strict=True)
        if count >= LEAST_ROWS
    }
    fits = {
        "rtklib": _fits_codes(size),
        "nmea": _fits_codes({NMEA_QUALITY.get(k, 0): v for k, v in size.items()}),
    }
    telling = [name for name, fit in fits.items() if fit]
    return telling[0] if len(telling) == 1 else None


def _fits_codes(size: dict[int, float]) -> bool:
    """Whether worse codes have larger standard deviations, and the worst telling ones."""
    ranked = [size[code] for code in sorted(size, key=lambda k: _ORDER.get(k, 9)) if code in _ORDER]
    return len(ranked) > 1 and ranked == sorted(ranked) and ranked[-1] > TELLING_RATIO * ranked[0]


def quality_by_values(grid: UnknownTable, taken: set[int], sigma: Array) -> tuple[int, str] | None:
    """Find the one column of a table without names that is a quality, and whose codes it has."""
    matches = []
    for k in range(grid.values.shape[1]):
        column = grid.values[:, k]
        if k in taken or np.ptp(column) == 0.0 or (column != np.round(column)).any():
            continue
        if (codes := codes_of(column, sigma)) is not None:
            matches.append((k, codes))
    return matches[0] if len(matches) == 1 else None
