"""Of which other reading of the poses' angles the antenna positions fit clearly better.

Omega and phi exchanged, or of the other sign, leave cameras as level and as much along their
courses as they were. What they turn is the lever arm: of 0.1 m a tilt of 5 deg moves the antenna by
9 mm, in each image otherwise, and the sum of weighted squares tells what a single residual does
not.
"""

from dataclasses import replace

import numpy as np

from ...base.errors import InsgnssError
from ...geodesy.readings import of_attitudes, suspected_readings
from ...records import Array
from .records import PosedAntennas
from .similarity import PairedPoints, similarity_lever_arm

# sum of weighted squares by which another reading must be better: 5 sigma, since thirty are tried
BETTER_BY = 25.0
MOST_COMPARED = 300  # images, evenly taken, in which readings are compared: more take seconds each


def better_angles(
    poses: PosedAntennas, ground: PairedPoints, opk: Array | None, growth: float, source: str
) -> tuple[str, ...]:
    """Ask whether angles are read rightly where another reading leaves clearly less.

    Parameters
    ----------
    poses : PosedAntennas
    ground : PairedPoints
    opk : ndarray, (n, 3), or None
        Angles as the file has them, rad.
    growth : float
        Of the variance of a mean, as residuals of neighbouring images are alike.
    source : str
        Name of the file of the poses.

    Returns
    -------
    tuple of str
        A note, or none.
    """
    n = len(poses.position)
    rows = np.unique(np.linspace(0, n - 1, min(n, MOST_COMPARED)).astype(int))
    few = poses.changed(lambda x: x[rows], *vars(poses))

    def factor(C: Array) -> float:
        try:
            return similarity_lever_arm(replace(few, C_rc=C), ground).variance_factor
        except InsgnssError:
            return np.inf

    readings = of_attitudes(None if opk is None else opk[rows])
    candidates = suspected_readings(source, readings, lambda C, change: change(C))
    factors = {one.statement: factor(one.read(few.C_rc)) for one in candidates}
    statement, least = min(factors.items(), key=lambda item: item[1])
    as_read, redundancy = factor(few.C_rc), 3 * (len(rows) + len(ground.model)) - 10
    if not redundancy * (as_read - least) > BETTER_BY * growth * max(least, 1.0):
        return ()
    return (
        f"the antenna positions fit {np.sqrt(as_read / least):.2f} times as well if {statement}:"
        " are its angles read rightly? The lever arm is wrong if not",
    )
