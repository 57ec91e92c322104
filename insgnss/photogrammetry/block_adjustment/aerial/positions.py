"""Aerial control from a file of positions: of a drone with RTK or PPK and without an IMU log.

The positions are read as `compare` reads them: .MRK, camera_positions.csv, `_events.pos` of
RTKLIB, references of Metashape or Pix4D, tables. Attitudes that the file has with standard
deviations are observed as those of a flight are. Else the images' own poses of the photogrammetry
program are first values, in the axes of the positions by (S.1) of `insgnss.geodesy.similarity`,
whose rotation is that of

    sum Y_k X_k^T + w |X| |Y| d v^T                                                        (P.1)

with X program's and Y measured positions about their means, |X| and |Y| the roots of the sums of
their squares, v the program's mean viewing direction
of unit length and d straight down: of positions along one line alone (P.1) has the rotation about
it, and elsewhere the small w moves nothing that a first value needs.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ....base.errors import InputError
from ....base.wording import some
from ....flight.config.block_tables.aerial_control import AerialControlTable
from ....geodesy.frames import TangentPlane
from ....geodesy.rotation import NED_ENU, nearest_rotation
from ....geodesy.similarity import Similarity, similarity
from ....io.exposures.images import natural
from ....io.exposures.numbering import image_numbers
from ....io.formats.blocks.joined import matched
from ....io.formats.blocks.measured_block import MeasuredBlock
from ....records import ExteriorOrientation
from ....records.block import Array
from ...comparison.hints import Hints, turned
from ...comparison.poses import Poses
from ...comparison.reading import read_poses

Rows = NDArray[np.int64]
FEWEST = 3  # images with position and pose, of which a similarity follows
DOWN_WEIGHT = 1e-3  # w of (P.1) (chosen): a block 30 times longer than it is wide still counts more
FIRST_VALUE_DEG = 0.4  # standard deviation (chosen) of attitudes that are first values
MISSHAPEN = 0.2  # rms that a similarity leaves, of the positions' own: they are of other images
VIEW = np.array([0.0, 0.0, 1.0])  # of a camera: x right, y down, z viewing direction
DOWN = np.array([0.0, 0.0, -1.0])  # of the tangent plane: east, north, up


def orientation_of(
    table: AerialControlTable, source: MeasuredBlock, notes: list[str]
) -> tuple[ExteriorOrientation, AerialControlTable]:
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
    rows, images = _of_images(poses, source, notes)
    poses = poses.taken(rows)
    plane = TangentPlane(float(np.mean(poses.lat)), float(np.mean(poses.lon)), 0.0)
    position = plane.position_from_geodetic(poses.lat, poses.lon, poses.height)
    C_mE = plane.C_mn(poses.lat, poses.lon) @ NED_ENU
    cov = np.zeros((len(images), 6, 6))
    cov[:, :3, :3] = _position_cov(poses, C_mE, table)
    if poses.C_Ex is not None and poses.cov_attitude is not None:
        cov[:, 3:, 3:] = turned(C_mE, poses.cov_attitude)
        C = C_mE @ poses.C_Ex
    else:
        cov[:, 3:, 3:] = np.radians(FIRST_VALUE_DEG) ** 2 * np.eye(3)
        if table.initial is not None:
            C, origin = _initial(table.initial, images, plane), f"of {table.initial.name}"
        else:
            C, origin = _first_attitudes(path, images, position, source), "of the program"
        notes.append(
            f"{path.name} has positions alone: attitudes follow from the image observations, and"
            f" begin with those {origin}"
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
        notes.append(f"{path.name} has no GPS times: the order of the images stands for them")
    time = poses.time if stamped and poses.time is not None else np.arange(len(images), dtype=float)
    return ExteriorOrientation(
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
    ), table


def _position_cov(poses: Poses, C_mE: Array, table: AerialControlTable) -> Array:
    """Return the covariances of the positions (n, 3, 3), as stated or as the file has them."""
    if table.sigma_m is not None:
        return np.tile(np.diag(np.square(table.sigma_m)), (poses.n, 1, 1))
    cov = turned(C_mE, poses.cov_position)
    if cov is None:
        raise InputError.in_file(
            poses.source,
            "has no standard deviations of the positions, without which nothing weighs them; give"
            " aerial_control.sigma_m (--position-sigma), such as 0.02 0.02 0.03 where fixed",
        )
    return cov


def _of_images(
    poses: Poses, source: MeasuredBlock, notes: list[str]
) -> tuple[Rows, tuple[str, ...]]:
    """Return the rows of poses that are of images of the block, by time, and their names.

    Names that are numbers, or rows without names, are matched by the counter in the names of the
    images; where it is no such counter and both are as many, by their order.
    """
    images = tuple(sorted(source.measured.images, key=natural))
    names = poses.images or tuple(str(k + 1) for k in range(poses.n))
    row = matched(images, names)
    if not (row >= 0).any() and all(name.isdecimal() for name in names):
        counter = image_numbers(images)
        row_of = {int(name): k for k, name in enumerate(names)}
        how = "numbers in the names of the images"
        if counter is not None and all(int(n) in row_of for n in counter):
            row = np.array([row_of[int(n)] for n in counter], dtype=np.int64)
        elif len(images) == len(names):
            row, how = np.arange(len(names)), "order of the images' names"
        if (row >= 0).any():
            notes.append(
                f"positions and images are matched by the {how}: {_pair(names, images, row)}"
            )
    chosen = np.flatnonzero(row >= 0)
    if not chosen.size:
        raise InputError.in_file(
            poses.source,
            f"none of its {len(names)} positions ({names[0]}, ...) is of one of the"
            f" {len(images)} images ({images[0]}, ...): give positions with the names of images, or"
            " as many of them",
        )
    if poses.time is not None:
        chosen = chosen[np.argsort(poses.time[row[chosen]], kind="stable")]
    return row[chosen].astype(np.int64), tuple(images[k] for k in chosen)


def _pair(names: Sequence[str], images: Sequence[str], row: Rows) -> str:
    """Return the first pair, which a reader can check."""
    k = int(np.argmax(row >= 0))
    return f"{names[row[k]]} is {images[k]}"


def _initial(path: Path, images: Sequence[str], plane: TangentPlane) -> Array:
    """Return the attitudes (n, 3, 3) that another file has of the images, NaN of others."""
    poses = read_poses(path)
    if poses.C_Ex is None or poses.x != "camera" or not poses.images:
        raise InputError.in_file(
            path, "has no attitudes of images by their names; leave aerial_control.initial out"
        )
    row = matched(images, poses.images)
    C = plane.C_mn(poses.lat, poses.lon) @ NED_ENU @ poses.C_Ex
    return np.where((row >= 0)[:, None, None], C[row], np.nan)


def _first_attitudes(
    path: Path, images: Sequence[str], position: Array, source: MeasuredBlock
) -> Array:
    """Return the attitudes (n, 3, 3) of the program's poses in the axes of the positions (P.1)."""
    row = matched(images, source.measured.images)
    X, C = source.position_m[row], source.C_mc[row]
    posed = np.isfinite(X).all(axis=1) & np.isfinite(C).all(axis=(1, 2))
    if posed.sum() < FEWEST:
        raise InputError.in_file(
            path,
            f"has positions and no attitudes, and only {int(posed.sum())} of {len(images)} images"
            " have a pose in the image observations to begin with; give the project of a program"
            " that has aligned them (Metashape, COLMAP, ...), or a table with angles",
        )
    fitted = oriented_similarity(X[posed], position[posed], C[posed])
    residual = fitted.points(X[posed]) - position[posed]
    spread = position[posed] - position[posed].mean(axis=0)
    rms, size = (float(np.sqrt(np.mean(np.sum(v**2, axis=1)))) for v in (residual, spread))
    if rms > MISSHAPEN * size:
        raise InputError.in_file(
            path,
            f"its positions are {rms:.1f} m (rms) from where the poses of the image observations"
            f" lie after shift, turn and scale, and spread by {size:.1f} m themselves: they do not"
            " belong to these images; check names and order",
        )
    out = np.full(C.shape, np.nan)
    out[posed] = fitted.rotation @ C[posed]
    return out


def oriented_similarity(X: Array, Y: Array, C: Array) -> Similarity:
    """Fit (S.1) to positions, with the rotation of (P.1).

    Parameters
    ----------
    X, Y : ndarray, (n, 3)
        Positions in the program's axes, and measured ones, up along z.
    C : ndarray, (n, 3, 3)
        Attitudes, camera to the program's axes.

    Returns
    -------
    Similarity
        From the program's axes to those of Y.
    """
    x, y = X - X.mean(axis=0), Y - Y.mean(axis=0)
    view = (C @ VIEW).mean(axis=0)
    weight = DOWN_WEIGHT * float(np.linalg.norm(x) * np.linalg.norm(y))
    turn = nearest_rotation(y.T @ x + weight * np.outer(DOWN, view / np.linalg.norm(view)))
    fitted = similarity(X, Y, turn)
    assert fitted is not None  # a rotation is given
    return fitted
