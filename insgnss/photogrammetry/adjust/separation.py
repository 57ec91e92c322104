"""Unknowns that the observations hardly tell apart, and what would separate them.

Two unknowns with a correlation beyond 0.9 share what the observations say of their sum; each alone
is uncertain, and errors of the model go into either. Whether that harms depends on what is wanted:
points within the block follow the sum; a camera or a mounting that is taken to another flight does
not. Besides the unknowns of cameras and mounting there are three motions that all images of a
camera have in common: height, and rotation about the camera's x and y.

Each advice stands in `REMEDIES_OF_PAIRS` with the flights in which it was tried: simulated ones in
which the pair is that strongly correlated, and no longer when the advice is followed
(`tests/photogrammetry/adjust/test_separation.py`). Pairs for which nothing was tried are listed
without advice.
"""

from dataclasses import dataclass

import numpy as np

from ...records.block import INTERIOR, RADIAL
from .aerial import (
    BORESIGHT,
    CAMERA_LEVER_ARM,
    COMMON_OF_TRAJECTORY,
    EXPOSURE_DELAY,
    LINE_DRIFT,
    SHIFT,
)
from .normals import unknown_name
from .precision import COMMON_MOTIONS, Precision
from .unknowns import CAMERA, POINT, POSE

TOO_CORRELATED = 0.9  # correlation from which on unknowns are named as hard to separate (chosen)
AERIAL = "aerial control"
HEIGHT_MOTION, ABOUT_Y, ABOUT_X = COMMON_MOTIONS
TWO_HEIGHTS = (
    "fly some strips at two and a half times the height: the effect of a camera parameter on"
    " the ground grows with the height, that of a lever arm does not"
)
TWO_HEADINGS = (
    "fly strips in opposite headings: errors of the camera or of its clock turn with the"
    " heading, a shift of the trajectory does not"
)
TWO_SPEEDS = (
    "fly strips whose speeds differ by a factor of three: the time offset moves the camera by"
    " metres that grow with the speed, the lever arm does not"
)
CALIBRATED_CENTRE = (
    "object points depend on the sum of both alone as long as camera and IMU stay mounted"
    " together, and no flight plan separates them; if each is wanted, give cx and cy of a"
    " calibration with their standard deviations (a pixel)"
)
HELD_CENTRE = (
    "object points depend on the sum of both alone, and no flight plan separates them; if the"
    " attitude is wanted, hold cx and cy at a calibration's values (leave them out of"
    " camera.free)"
)
CALIBRATED_DECENTRING = (
    "hold p1 and p2 at values of a calibration; cross strips, tilted images or more control"
    " help little"
)
OTHER_VIEWS = (
    "fly some strips with the camera tilted by 45 deg, or at two heights where the lever arm or a"
    " shift of the positions is an unknown"
)
NORMAL = "normal: within the image only their sum matters; nothing to do"

REMEDIES_OF_PAIRS: dict[frozenset[str], str] = {
    frozenset(("f", HEIGHT_MOTION)): (
        "observe the positions of the images (GNSS; from two heights where the lever arm or a"
        " shift is an unknown too), or fly some strips with the camera tilted by 45 deg"
    ),
    frozenset(("f", f"{CAMERA_LEVER_ARM} z")): TWO_HEIGHTS,
    frozenset(("f", f"{SHIFT} z")): TWO_HEIGHTS,
    frozenset(("cx", f"{CAMERA_LEVER_ARM} x")): TWO_HEIGHTS,
    frozenset(("cy", f"{CAMERA_LEVER_ARM} y")): TWO_HEIGHTS,
    **{frozenset((c, f"{SHIFT} {axis}")): TWO_HEADINGS for c in ("cx", "cy") for axis in "xy"},
    **{frozenset((EXPOSURE_DELAY, f"{SHIFT} {axis}")): TWO_HEADINGS for axis in "xy"},
    **{frozenset((EXPOSURE_DELAY, f"{CAMERA_LEVER_ARM} {axis}")): TWO_SPEEDS for axis in "xy"},
    frozenset(("cx", f"{BORESIGHT} y")): CALIBRATED_CENTRE,
    frozenset(("cy", f"{BORESIGHT} x")): CALIBRATED_CENTRE,
    frozenset(("cx", ABOUT_Y)): HELD_CENTRE,
    frozenset(("cy", ABOUT_X)): HELD_CENTRE,
    **{
        frozenset(("p1", name)): CALIBRATED_DECENTRING for name in ("cx", f"{BORESIGHT} y", ABOUT_Y)
    },
    **{
        frozenset(("p2", name)): CALIBRATED_DECENTRING for name in ("cy", f"{BORESIGHT} x", ABOUT_X)
    },
    frozenset(("k",)): NORMAL,
}


@dataclass(frozen=True)
class Inseparable:
    """Two unknowns that the observations hardly tell apart.

    Parameters
    ----------
    first, second : str
        Names of the unknowns.
    value : float
        Their correlation.
    remedy : str
        What would separate them, or why it does no harm; empty where nothing was tried.
    """

    first: str
    second: str
    value: float
    remedy: str


def inseparable(precision: Precision) -> tuple[Inseparable, ...]:
    """Return the pairs of unknowns whose correlation is beyond `TOO_CORRELATED`.

    Parameters
    ----------
    precision : Precision
        Of an adjustment.

    Returns
    -------
    tuple of Inseparable
        The strongest first: unknowns of cameras and of blocks that groups bring, and common motions
        of a camera's images.
    """
    problem, Q = precision.result.problem, precision.cofactors
    layout, block = problem.layout, problem.block
    columns, unknowns = [], list[tuple[str, str, int | None]]()
    for column, (name, row) in enumerate(layout.names()):
        if name in (POSE, POINT, COMMON_OF_TRAJECTORY) or layout.held[column]:
            continue
        position = column - int(layout.of((name, row))[0][0])
        columns.append(column)
        kind, camera_row = _kind(name, position, layout.columns), row if name == CAMERA else None
        unknowns.append((unknown_name(problem, column), kind, camera_row))
    n, rows = len(columns), np.array(columns, dtype=np.int64)
    for c, camera in enumerate(block.cameras):
        whose = f" of {camera.name}" if len(block.cameras) > 1 else ""
        unknowns += [(f"{motion} of all images{whose}", motion, c) for motion in COMMON_MOTIONS]
    covariance = np.block([[Q.of(rows), Q.common[rows]], [Q.common[rows].T, Q.common_motions]])
    sigma = np.sqrt(np.diagonal(covariance))
    with np.errstate(divide="ignore", invalid="ignore"):
        rho = np.nan_to_num(covariance / sigma / sigma[:, None])
    observed = any(group.name == AERIAL for group in problem.groups)
    pairs = []
    for i, j in np.argwhere(np.triu(np.abs(rho), 1) > TOO_CORRELATED):
        # motions are no unknowns: what is told of them is told of a parameter of their camera
        (first, kind, camera_row), (second, other_kind, other_row) = unknowns[i], unknowns[j]
        if i < n and (j < n or camera_row == other_row):
            pair = frozenset((kind, other_kind))
            remedy = REMEDIES_OF_PAIRS.get(pair, "")
            if pair == {"f", HEIGHT_MOTION} and observed:
                remedy = OTHER_VIEWS
            pairs.append(Inseparable(first, second, float(rho[i, j]), remedy))
    return tuple(sorted(pairs, key=lambda pair: -abs(pair.value)))


def _kind(name: str, position: int, columns: np.ndarray) -> str:
    """Return what an unknown is, whosever it is."""
    if name == CAMERA:
        parameter = INTERIOR[columns[position]]
        return "k" if parameter in RADIAL else parameter
    if name in (CAMERA_LEVER_ARM, BORESIGHT, SHIFT, LINE_DRIFT):
        return f"{name} {'xyz'[position]}"
    return name
