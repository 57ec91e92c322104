"""A least standard deviation of a fix by its quality code.

Receivers and engines state centimetres for float solutions whose ambiguities are decimetres off,
and standard deviations of the code noise for single-point positions whose error is the ionosphere.
A fix of a quality with a floor keeps its covariance where that is larger; else the missing variance
is added to the axis that lacks it, which leaves the correlations as they are and the covariance
positive.

Fixes of a code that promises more than that of the others, yet with several times the sigma of
those around them, contradict themselves (a stale RTK position between single-point ones) and are
left out: their errors last, and taken for white ones they would pull all the same, as a hundred of
them do with a tenth of the sigma of one. Float solutions between fixed ones are as they should be.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ....records import GnssFixes, Question
from ..fix_path import between_fixes

WORTHLESS = 5.0  # times the horizontal sigma of the fixes on both sides


def with_floors(gnss: GnssFixes, floors: Mapping[int, tuple[float, ...]]) -> GnssFixes:
    """Raise the standard deviations of the fixes to least values by quality code.

    Parameters
    ----------
    gnss : GnssFixes
    floors : mapping of int to tuple of float, m
        Least standard deviations north, east and down by quality code.

    Returns
    -------
    GnssFixes
        The fixes, with a note of how many changed; unchanged where they carry no quality.
    """
    if gnss.quality is None:
        return gnss
    cov = gnss.cov_ned.copy()
    changed = []
    for code, floor in floors.items():
        missing = (
            np.maximum(np.square(floor) - np.diagonal(cov, axis1=1, axis2=2), 0.0)
            * (gnss.quality == code)[:, None]
        )
        raised = int((missing > 0.0).any(axis=1).sum())
        if raised:
            cov += missing[:, :, None] * np.eye(3)
            changed.append(f"{raised} of quality {code} to {' / '.join(f'{s:g}' for s in floor)} m")
    if not changed:
        return gnss
    statement = f"standard deviations raised: {', '.join(changed)}"
    codes = "of RTKLIB's codes 1 fixed, 2 float, 3 SBAS, 4 DGPS, 5 single, 6 PPP"
    note = Question("GNSS quality", codes).note(statement, "gnss.quality_sigma_m sets them")
    return replace(gnss, cov_ned=cov, notes=(*gnss.notes, note))


def without_worthless(gnss: GnssFixes) -> GnssFixes:
    """Leave out fixes that promise more than those of the usual quality, and are worth far less.

    Parameters
    ----------
    gnss : GnssFixes
        With the standard deviations that the filter would take.

    Returns
    -------
    GnssFixes
        The rest, with a note; unchanged where they carry no quality, or only one.
    """
    if gnss.quality is None or gnss.time.size == 0:
        return gnss
    codes, counts = np.unique(gnss.quality, return_counts=True)
    usual = np.flatnonzero(gnss.quality == codes[np.argmax(counts)])
    sigma = np.sqrt(np.trace(gnss.cov_ned[:, :2, :2], axis1=1, axis2=2))
    before, after, beside = between_fixes(gnss.time, gnss.time[usual])
    around = np.maximum(sigma[usual[before]], sigma[usual[after]])
    worthless = beside & (gnss.quality < gnss.quality[usual[0]]) & (sigma > WORTHLESS * around)
    if not worthless.any():
        return gnss
    kinds = ", ".join(
        f"{np.count_nonzero(gnss.quality[worthless] == code)} of quality {code}"
        f" (sigma {np.median(sigma[worthless & (gnss.quality == code)]):.3g} m)"
        for code in np.unique(gnss.quality[worthless])
    )
    expected = f"less than {WORTHLESS:g} times the sigma of the fixes on both sides"
    note = Question("GNSS quality", expected).note(
        f"{kinds} left out: between fixes of quality {gnss.quality[usual[0]]}"
        f" ({np.median(sigma[usual]):.3g} m) they add no information",
        "to use them, state their standard deviations in gnss.quality_sigma_m",
    )
    kept = gnss[~worthless]
    return replace(kept, notes=(*gnss.notes, note))
