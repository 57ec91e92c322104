"""Positions that a file holds with too few digits for what they claim.

Receivers print 1e-7 deg (1.1 cm), decimetres, or a ten-thousandth of a minute (18 cm). Rounding to
a step q adds an error of variance q^2 / 12 where the position moves or scatters by more than a
step; while the same number comes again and again, its error does too, and n such fixes say no more
than one,

    var = n q^2 / 12                                                                           (Q.1)

for each of a run of n equal numbers. It is added where a single rounding is as large as a third of
what a fix claims; below that it is in the claim's own uncertainty.
"""

from dataclasses import replace

import numpy as np

from ....geodesy.earth import curvature_radii
from ....records import Array, GnssFixes, Question
from ....records.variances import decimal_step
from ..stuck_channels import run_edges

PROBED = 2000  # positions that show the step
LARGEST_M, SMALLEST_STEP_M = 20.0, 1e-4  # of a step that is looked for
EXACT_M = 1e-6  # off the multiples of a step: conversions of units, no measurement
COUNTS = 0.3  # of the sigma, from which on a rounding is added
# m: sigma that a run's rounding adds at most: decimetres with few digits are not to be taken for
# code solutions (`navigation.filter.epochs.CODE_M`)
MOST_M = 0.35


def with_rounding(gnss: GnssFixes) -> GnssFixes:
    """Add the variance of rounded positions (Q.1) to the covariances.

    Parameters
    ----------
    gnss : GnssFixes

    Returns
    -------
    GnssFixes
        With a note of the steps; `gnss` itself where no rounding counts.
    """
    meridian, normal = curvature_radii(gnss.lat[0])
    columns = (
        (gnss.lat, float(meridian)),
        (gnss.lon, float(normal * np.cos(gnss.lat[0]))),
        (gnss.height, 1.0),
    )
    variance = np.diagonal(gnss.cov_ned, axis1=1, axis2=2)
    more, steps = np.zeros((gnss.time.size, 3)), [0.0, 0.0, 0.0]
    for k, (column, metres) in enumerate(columns):
        scales = (1.0,) if k == 2 else (np.degrees(1.0), 60.0 * np.degrees(1.0), 1.0)
        step = metres * max(rounding_step(column * s, metres / s) / s for s in scales)
        if step**2 / 12.0 > COUNTS**2 * np.median(variance[:, k]):
            steps[k] = step
            most = max(1.0, MOST_M**2 / (step**2 / 12.0))
            lengths = np.diff(run_edges(column))
            more[:, k] = step**2 / 12.0 * np.minimum(np.repeat(lengths, lengths), most)
    if not any(steps):
        return gnss
    shown = " / ".join(f"{100.0 * step:.2g}" for step in steps)
    expected = f"steps below {COUNTS * np.sqrt(12.0):.1g} standard deviations"
    note = Question("GNSS quality", expected).note(
        f"positions are rounded to {shown} cm (north, east, height), which their standard "
        "deviations do not cover; these were enlarged by the rounding",
        "write the positions with more digits (9 decimals of a degree, millimetres of height)",
    )
    cov = gnss.cov_ned + more[:, :, None] * np.eye(3)
    return replace(gnss, cov_ned=cov, notes=(*gnss.notes, note))


def rounding_step(column: Array, metres: float) -> float:
    """Return the decimal step of which all values are multiples; 0 where there is none.

    Parameters
    ----------
    column : ndarray, shape (n,)
    metres : float
        Of its unit.

    Returns
    -------
    float
        In units of the column.
    """
    probed = column[np.linspace(0, column.size - 1, PROBED).astype(np.int64)]
    return decimal_step(probed, LARGEST_M / metres, SMALLEST_STEP_M / metres, EXACT_M / metres)
