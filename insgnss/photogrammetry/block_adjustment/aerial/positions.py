"""Aerial control from a file of positions: of a drone with RTK or PPK and without an IMU log.

The positions are read as `compare` reads them: .MRK, camera_positions.csv, `_events.pos` of
RTKLIB, references of Metashape or Pix4D, tables. Attitudes that the file has with standard
deviations are observed as those of a flight are. Else poses to begin with (`first_poses`) give the
first attitudes.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ....base.errors import InputError
from ....base.findings import Finding
from ....base.wording import some
from ....flight.config.block_tables.aerial_control import AerialControlTable
from ....geodesy.rotation import NED_ENU
from ....io.exposures.images import natural
from ....io.exposures.numbering import image_numbers
from ....io.formats.blocks.joined import match_names
from ....io.formats.blocks.measured_block import MeasuredBlock
from ....io.formats.orientation.poses import LARGEST_GEOID_M
from ....records import ExteriorOrientation
from ....records.block import Array
from ...comparison.compare import compare_poses, largest_difference
from ...comparison.hints import Hints, rotate_covariance
from ...comparison.poses import Poses
from ...comparison.position import HEIGHTS_OTHERWISE, SHIFT_M
from ...comparison.reading import read_poses
from ..placing import noted_plane
from .first_poses import (
    FirstPoses,
    first_attitudes,
    first_poses,
    in_other_order,
    lie_elsewhere,
    plane_of,
)

Rows = NDArray[np.int64]
LEAST_SIGMA_M = 1e-4  # of positions in a file: no GNSS knows them better, another unit says it
FEWEST_PERMUTED = 12  # positions, below which a lost order is not told from another place (chosen)
FIRST_VALUE_DEG = 0.4  # standard deviation (chosen) of attitudes that are first values


def orientation_of(
    table: AerialControlTable, source: MeasuredBlock, notes: list[str]
) -> tuple[ExteriorOrientation, AerialControlTable, Finding]:
    """Read positions of images and give them first values of their attitudes.

    Parameters
    ----------
    table : AerialControlTable
        The file, its CRS, and what is known beyond it.
    source : MeasuredBlock
        Whose images are looked for, and whose poses are first values.
    notes : list of str
        Gets a sentence of what was assumed or left out.

    Returns
    -------
    orientation : ExteriorOrientation
        The images that both have, by time.
    table : AerialControlTable
        The same with what can be observed: positions alone ("Ap") where attitudes have no standard
        deviations.
    finding : Finding
        Whether anything but ground points checks where the positions lie.

    Raises
    ------
    InputError
        No standard deviations, names that do not match, attitudes that nothing tells.
    """
    path = table.file
    assert path is not None
    poses = read_poses(path, hints=Hints(crs=table.crs, geoid=table.geoid))
    if poses.C_Ex is not None and poses.x != "camera":
        raise InputError.in_file(
            path, "is a trajectory of the IMU, not of images; give the eo.json beside it"
        )
    first = first_poses(table, source)
    rows, images = _of_images(poses, first, source, notes)
    poses = poses.taken(rows)
    _refuse_distant(poses, images, first)
    plane = noted_plane(plane_of(poses), "positions", notes)
    position = plane.position_from_geodetic(poses.lat, poses.lon, poses.height)
    C_mE = plane.C_mn(poses.lat, poses.lon) @ NED_ENU
    cov = np.zeros((len(images), 6, 6))
    cov[:, :3, :3] = _position_cov(poses, C_mE, table)
    if poses.C_Ex is not None and poses.cov_attitude is not None:
        cov[:, 3:, 3:] = rotate_covariance(C_mE, poses.cov_attitude)
        C = C_mE @ poses.C_Ex
    else:
        cov[:, 3:, 3:] = np.radians(FIRST_VALUE_DEG) ** 2 * np.eye(3)
        measured = np.column_stack([poses.lat, poses.lon, poses.height])
        C = first_attitudes(path, images, measured, plane, first)
        notes.append(
            f"{path.name} has positions and no attitudes: attitudes are estimated from the"
            f" image observations; their initial values are those {first.origin}"
        )
        table = replace(table, control="Ap", boresight_sigma_deg=0.0)
    oriented = np.isfinite(C).all(axis=(1, 2))
    if (missing := int((~oriented).sum())) > 0:
        notes.append(
            f"{missing} images have a position and no pose in the image observations, and take no"
            f" part: {some([images[k] for k in np.flatnonzero(~oriented)])}"
        )
    keep = np.flatnonzero(oriented)
    stamped = poses.time is not None and poses.gps_week is not None
    if not stamped:
        notes.append(
            f"{path.name} has no GPS times: the order of the images is used in their place"
        )
    time = poses.time if stamped and poses.time is not None else np.arange(len(images), dtype=float)
    orientation = ExteriorOrientation(
        tuple(images[k] for k in keep),
        time[keep],
        int(poses.gps_week or 0),
        np.array([plane.lat, plane.lon, plane.height]),
        position[keep],
        C[keep],
        cov[keep],
        None,
        np.eye(3),
        np.eye(3),
        history=(f"positions of {path.name}",),
        datum=poses.datum,
        epoch=poses.epoch,
    )
    return orientation, table, lie_elsewhere(path, images, position, plane, first)


def _refuse_distant(poses: Poses, images: Sequence[str], first: FirstPoses) -> None:
    """Refuse positions of another place than the first poses, with what explains the distance."""
    if first.on_earth is None:
        return
    row = match_names(images, first.on_earth.images)
    names = tuple(images[k] for k in np.flatnonzero(row >= 0).tolist())
    a = replace(first.on_earth.taken(row[row >= 0]), images=names)
    b = replace(poses.taken(np.flatnonzero(row >= 0)), images=names)
    if problem := _permutation_sentence(names, a.ecef, b.ecef):
        raise InputError.in_file(poses.source, problem)
    away = float(np.median(np.linalg.norm(b.ecef - a.ecef, axis=1))) if names else 0.0
    if away > SHIFT_M:
        raise InputError(largest_difference(a, b))
    if away > LARGEST_GEOID_M:
        findings = compare_poses(replace(a, C_Ex=None), replace(b, C_Ex=None)).findings
        if wrong := [one.statement for one in findings if one.name in HEIGHTS_OTHERWISE]:
            raise InputError(f"{a.source} (a), {b.source} (b): {wrong[0]}")


def _permutation_sentence(names: Sequence[str], a: Array, b: Array) -> str:
    """Say that most positions b (n, 3), m, are where a has other images.

    Empty where most have their place, where all lie shifted, or are some rows off or in the reverse
    order, of which the image observations name the place.
    """
    from scipy.spatial import cKDTree

    n = len(names)
    if n < FEWEST_PERMUTED:
        return ""
    step = float(np.median(np.linalg.norm(np.diff(a, axis=0), axis=1)))
    misfit = np.linalg.norm(b - a - np.median(b - a, axis=0), axis=1)
    distance, nearest = cKDTree(a).query(b)
    rows = np.arange(n)
    right = nearest == rows
    in_one_order = np.unique(np.concatenate([nearest - rows, nearest + rows]), return_counts=True)
    scattered = max(right.sum(), in_one_order[1].max()) <= 0.5 * n
    if (
        not scattered
        or np.median(misfit) < 2.0 * step
        or np.median(distance) > 0.25 * step
        or np.unique(nearest).size < 0.8 * n
    ):
        return ""
    k = int(np.argmin(right))
    return (
        f"{1.0 - right.mean():.0%} of its positions are those of other images, {names[k]} has that"
        f" of {names[int(nearest[k])]}: its rows were sorted, and numbered anew; restore their"
        " order, or name positions by their images"
    )


def _position_cov(poses: Poses, C_mE: Array, table: AerialControlTable) -> Array:
    """Return the covariances of the positions (n, 3, 3), as stated or as the file has them."""
    if table.sigma_m is not None:
        return np.tile(np.diag(np.square(table.sigma_m)), (poses.n, 1, 1))
    cov = rotate_covariance(C_mE, poses.cov_position)
    if cov is None:
        raise InputError.in_file(
            poses.source,
            "has no standard deviations of the positions, so that their weights are unknown;"
            " give aerial_control.sigma_m (--position-sigma), such as 0.02 0.02 0.03 where"
            " fixed",
        )
    sigma_m = float(np.sqrt(np.median(np.trace(cov, axis1=1, axis2=2)) / 3.0))
    if sigma_m < LEAST_SIGMA_M:
        raise InputError.in_file(
            poses.source,
            f"states its positions to {1e3 * sigma_m:.2g} mm, which no GNSS reaches: look for"
            " another unit (km for m), or give aerial_control.sigma_m (--position-sigma)",
        )
    return cov


def _of_images(
    poses: Poses, first: FirstPoses, source: MeasuredBlock, notes: list[str]
) -> tuple[Rows, tuple[str, ...]]:
    """Return the rows of poses that are of images of the block, by time, and their names.

    Names that are numbers, or rows without names, are matched by the counter in the names of the
    images; where it is no such counter and both are as many, by their order.
    """
    images = tuple(sorted(source.measured.images, key=natural))
    names = poses.images or tuple(str(k + 1) for k in range(poses.n))
    row = match_names(images, names)
    if not (row >= 0).any() and all(name.isdecimal() for name in names):
        counter = image_numbers(images)
        row_of = {int(name): k for k, name in enumerate(names)}
        how = "numbers in the names of the images"
        if counter is not None and all(int(n) in row_of for n in counter):
            row = np.array([row_of[int(n)] for n in counter], dtype=np.int64)
        else:
            position = plane_of(poses).position_from_geodetic(poses.lat, poses.lon, poses.height)
            if problem := in_other_order(names, position, images, first):
                raise InputError.in_file(poses.source, problem)
            if len(images) == len(names):
                row, how = np.arange(len(names)), "order of the images' names"
        if (row >= 0).any():
            notes.append(
                f"positions and images are matched by the {how}: {_pair(names, images, row)}"
            )
    chosen = np.flatnonzero(row >= 0)
    if not chosen.size:
        raise InputError.in_file(
            poses.source,
            f"none of its {len(names)} positions ({names[0]}, ...) has the name of one of the"
            f" {len(images)} images ({images[0]}, ...): give positions under the names of"
            " images, or as many positions as images",
        )
    if poses.time is not None:
        chosen = chosen[np.argsort(poses.time[row[chosen]], kind="stable")]
    return row[chosen].astype(np.int64), tuple(images[k] for k in chosen)


def _pair(names: Sequence[str], images: Sequence[str], row: Rows) -> str:
    """Return the first pair, which a reader can check."""
    k = int(np.argmax(row >= 0))
    return f"{names[row[k]]} is {images[k]}"
