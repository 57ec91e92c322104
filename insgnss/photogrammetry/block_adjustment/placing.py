"""Where a block lies: first values of poses by a similarity from a program's own axes, its datum.

The program's axes are any (of its own, of a grid, geocentric). Images that both know, and ground
control points that its rays intersect, give

    X = T + s R X'                                                                         (S.1)

R is that of the attitudes of common images; without three of them (S.1) is fitted to three ground
points or more. First values need no more: the adjustment does the rest.

A block without control has the datum of its first values: components of poses that are held, or
inner constraints (`adjust.groups`). Distances give it its scale.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from ...base.errors import InputError, near
from ...flight.config.block_file import Datum
from ...geodesy.frames import TangentPlane, ecef_to_geodetic
from ...geodesy.rotation import nearest_rotation
from ...geodesy.similarity import similarity
from ...io.formats.blocks.joined import JoinedBlock
from ...io.formats.blocks.measured_block import minimal_datum
from ...io.formats.origins import statement_of
from ...io.formats.text.columns import METRES, TableSpec
from ...records.block import Array, ImageBlock
from ..adjust.groups import DistanceObservation, InnerConstraints, ObservationGroup
from ..adjust.start import directions, first_values, intersect_rays
from ..adjust.unknowns import POINT, POSE

DISTANCES = TableSpec(
    {"from": "from point_1", "to": "to point_2", "distance": "distance length", "sigma": "sigma"},
    required="from to distance sigma",
    layouts=("from to distance sigma",),
    text=True,
    strict=METRES,
)
# of a point of a free network: of two, one that is rejected leaves it undetermined
FEWEST_FREE_RAYS = 3
MOST_FREE_POINTS = 1500  # of a free network (chosen): its normal matrix of points is dense, 160 MB
FEWEST_COMMON = 3  # images, or ground points: fewer leave a similarity (S.1) a rotation


def place_images(block: ImageBlock, position: Array, C: Array) -> ImageBlock:
    """Return a block whose images without first values have those of a program.

    Parameters
    ----------
    block : ImageBlock
        The block; images with first values keep them.
    position, C : ndarray
        (n, 3) and (n, 3, 3) poses of its images in the program's axes; NaN where there are none.

    Returns
    -------
    ImageBlock
        The same otherwise; as it was where nothing ties both axes.
    """
    has_pose = np.isfinite(position).all(axis=1) & np.isfinite(C).all(axis=(1, 2))
    missing = has_pose & ~block.oriented
    if not missing.any():
        return block
    common = has_pose & block.oriented
    fitted = None
    if common.sum() >= FEWEST_COMMON:
        R = nearest_rotation(np.einsum("nij,nkj->ik", block.C_mc[common], C[common]))
        fitted = similarity(position[common], block.position_m[common], R)
    elif len(control := block.control.complete) >= FEWEST_COMMON:
        obs = block.observations
        X = intersect_rays(position, C, directions(block), obs.image, obs.point, len(block.points))[
            control.point
        ]
        good = np.isfinite(X).all(axis=1)
        if good.sum() >= FEWEST_COMMON:
            fitted = similarity(X[good], control.position_m[good])
    if fitted is None:
        return block
    new_position, new_C = np.array(block.position_m), np.array(block.C_mc)
    new_position[missing] = fitted.points(position[missing])
    new_C[missing] = fitted.rotation @ C[missing]
    return replace(block, position_m=new_position, C_mc=new_C)


def in_tangent_plane(union: JoinedBlock, notes: list[str]) -> JoinedBlock:
    """Return geocentric poses in the tangent plane at the middle of the images.

    Parameters
    ----------
    union : JoinedBlock
        Poses in Earth-centred, Earth-fixed axes.
    notes : list of str
        Gets a sentence with the origin.

    Returns
    -------
    JoinedBlock
        The same otherwise.
    """
    lat, lon, h = (float(x) for x in ecef_to_geodetic(np.nanmean(union.position_m, axis=0)))
    plane = noted_plane(TangentPlane(lat, lon, h), "images", notes)
    position = plane.position_from_geodetic(*ecef_to_geodetic(union.position_m))
    return replace(union, position_m=position, C_mc=plane.C_em.T @ union.C_mc)


def noted_plane(plane: TangentPlane, members: str, notes: list[str]) -> TangentPlane:
    """Return a tangent plane that no file states.

    Parameters
    ----------
    plane : TangentPlane
        The plane.
    members : str
        At the middle of which it is.
    notes : list of str
        Gets a sentence with its origin.

    Returns
    -------
    TangentPlane
        The plane.
    """
    notes.append(
        f"axes are those of the tangent plane with {statement_of(plane)}, the middle of the"
        f" {members}"
    )
    return plane


def in_own_datum(
    block: ImageBlock, union: JoinedBlock, kind: Datum, distances: tuple[DistanceObservation, ...]
) -> tuple[ImageBlock, tuple[ObservationGroup, ...]]:
    """Return a block without control in the datum of its program's poses.

    Parameters
    ----------
    block : ImageBlock
        The block.
    union : JoinedBlock
        Poses in the program's axes, and which of their components its datum holds.
    kind : str
        As adjustment.datum.
    distances : tuple of DistanceObservation
        Which determine the scale.

    Returns
    -------
    block : ImageBlock
        With these poses and what is held of them.
    groups : tuple of ObservationGroup
        The inner constraints of a free network.

    Raises
    ------
    InputError
        No poses to begin with, or too many points for a free network of them.
    """
    block = replace(block, position_m=union.position_m, C_mc=union.C_mc)
    if not block.oriented.any():
        raise InputError(
            f'adjustment.datum = "{kind}" needs initial poses, which the image observations do'
            " not have; give the project of a program that has aligned the images"
        )
    block = _scale_to_distances(block, distances)
    if kind == "control" and union.held is not None:
        return replace(block, held=union.held), ()
    if kind == "minimal":
        held = minimal_datum(block.position_m, int(np.argmax(block.oriented)))
        if distances:
            held[held.sum(axis=1) == 1] = False
        return replace(block, held=held), ()
    values = first_values(block)
    if kind == "images":
        rows, first = np.flatnonzero(block.oriented), values.position
        keys = tuple((POSE, int(row)) for row in rows)
    else:
        rays = np.bincount(block.observations.point, minlength=len(block.points))
        rows, first = np.flatnonzero(np.isfinite(values.point[:, 0])), values.point
        rows = rows[rays[rows] >= FEWEST_FREE_RAYS]
        keys = tuple((POINT, int(row)) for row in rows)
        if not FEWEST_COMMON <= rows.size <= MOST_FREE_POINTS:
            raise InputError(
                f'adjustment.datum = "points": {rows.size} points are seen by'
                f" {FEWEST_FREE_RAYS} images or more; a free network needs {FEWEST_COMMON} to"
                f' {MOST_FREE_POINTS} of them; take "images"'
            )
    return block, (InnerConstraints(keys, first[rows], not distances),)


def _scale_to_distances(
    block: ImageBlock, distances: tuple[DistanceObservation, ...]
) -> ImageBlock:
    """Return a block whose first values have the scale of distances, in the middle."""
    X = first_values(block).point
    lengths = [float(np.linalg.norm(X[b] - X[a])) for a, b in (bar.points for bar in distances)]
    factors = [bar.distance_m / x for bar, x in zip(distances, lengths, strict=True) if x > 0.0]
    if not factors:
        return block
    return replace(block, position_m=float(np.median(factors)) * block.position_m)


def read_distances(path: Path | None, block: ImageBlock) -> tuple[DistanceObservation, ...]:
    """Read distances between measured points.

    Parameters
    ----------
    path : Path or None
        A table of two points, their distance and its standard deviation, m.
    block : ImageBlock
        Whose points they are.

    Returns
    -------
    tuple of DistanceObservation
        One a row; none without a table.

    Raises
    ------
    InputError
        A point that no image has, or a field that cannot be read.
    """
    if path is None:
        return ()
    table = DISTANCES.read(path)
    rows = {name: k for k, name in enumerate(block.points)}
    ends = list(zip(table.strings("from"), table.strings("to"), strict=True))
    distance, sigma = table.positive("distance", "m")[:, 0], table.positive("sigma", "m")[:, 0]
    for row, pair in enumerate(ends):
        for name in pair:
            if name not in rows:
                problem = (
                    f"point {name!r} is measured in no image; {near(name, block.points[:200])}"
                )
                raise table.error_at(row, problem)
        if pair[0] == pair[1]:
            raise table.error_at(
                row, f"a distance from point {pair[0]!r} to itself; name two different points"
            )
    return tuple(
        DistanceObservation((rows[a], rows[b]), float(d), np.array([[s**-2.0]]))
        for (a, b), d, s in zip(ends, distance, sigma, strict=True)
    )
