"""A least standard deviation of a fix by its quality code.

Receivers and engines state centimetres for float solutions whose ambiguities are decimetres off,
and standard deviations of the code noise for single-point positions whose error is the ionosphere.
A fix of a quality with a floor keeps its covariance where that is larger; else the missing variance
is added to the axis that lacks it, which leaves the correlations as they are and the covariance
positive.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..records import Check, GnssFixes


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
    note = Check("GNSS quality", statement, codes, "note", "gnss.quality_sigma_m sets them")
    return replace(gnss, cov_ned=cov, notes=(*gnss.notes, note))
