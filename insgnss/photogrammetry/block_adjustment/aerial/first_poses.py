"""Poses of images to begin with, and what they say of measured positions of the same images.

They are those of another file (`aerial_control.initial`), or the photogrammetry program's own in
its axes, which a similarity (S.1) of `insgnss.geodesy.similarity` brings into those of the
positions. Its rotation is that of

    sum Y_k X_k^T + w |X| |Y| d v^T                                                        (P.1)

with X program's and Y measured positions about their means, |X| and |Y| the roots of the sums of
their squares, v the program's mean viewing direction
of unit length and d straight down: of positions along one line alone (P.1) has the rotation about
it, and elsewhere the small w moves nothing that a first value needs. Positions that are a mirror
image, such as with latitude and longitude exchanged, turn the cameras upwards; positions that are
too many, or those of neighbours, leave residuals as long as the steps between images.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ....base.errors import InputError
from ....base.findings import Finding, ranked
from ....flight.config.block_tables.aerial_control import AerialControlTable
from ....geodesy.conventions import exchanged_orders, orders, reversed_signs
from ....geodesy.explain import Candidate, explain
from ....geodesy.frames import TangentPlane
from ....geodesy.rotation import NED_ENU, nearest_rotation
from ....geodesy.similarity import Similarity, similarity
from ....io.formats.blocks.joined import match_names
from ....io.formats.blocks.measured_block import MeasuredBlock
from ....records.block import Array
from ...comparison.poses import Poses
from ...comparison.reading import read_poses

Rows = NDArray[np.int64]
FEWEST_PLACED = 3  # images with position and pose, of which a similarity follows
FEWEST_IN_ORDER = 8  # such images, below which no other order is looked for (chosen)
DOWN_WEIGHT = 1e-3  # w of (P.1) (chosen): a block 30 times longer than it is wide still counts more
MISSHAPEN = 0.2  # rms that a similarity leaves, of the positions' own: they are of other images
UPWARD = 0.5  # mean viewing direction (up), from which on cameras look into the sky (chosen)
WITHIN_STEP = 1.0 / 3.0  # rms that a similarity leaves of right pairs, of a step between images
MOST_EXTRA = 3  # positions or images too many that are looked for (chosen): test shots
MOST_ALIKE = 3  # images that may be the one too many, beyond which none is named (chosen)
ELSEWHERE_M = 5.0  # median distance of positions from first poses that is reported: as of codes
VIEW = np.array([0.0, 0.0, 1.0])  # of a camera: x right, y down, z viewing direction
DOWN = np.array([0.0, 0.0, -1.0])  # of the tangent plane: east, north, up


@dataclass(frozen=True, eq=False)
class FirstPoses:
    """Poses of images to begin with.

    Parameters
    ----------
    images : tuple of str
        Their names.
    position_m, C_mc : ndarray
        (n, 3) and (n, 3, 3) in axes of their own, NaN where there are none.
    origin : str
        Where they are from.
    on_earth : Poses or None
        The same where they stand on Earth.
    """

    images: tuple[str, ...]
    position_m: Array
    C_mc: Array
    origin: str
    on_earth: Poses | None = None

    def of(self, images: Sequence[str]) -> tuple[Array, Array]:
        """Return positions (n, 3) and attitudes (n, 3, 3) of images, NaN of others."""
        row = match_names(images, self.images)
        posed = (row >= 0) & np.isfinite(self.position_m[row]).all(axis=1)
        posed &= np.isfinite(self.C_mc[row]).all(axis=(1, 2))
        return (
            np.where(posed[:, None], self.position_m[row], np.nan),
            np.where(posed[:, None, None], self.C_mc[row], np.nan),
        )


def first_poses(table: AerialControlTable, source: MeasuredBlock) -> FirstPoses:
    """Return poses of the images to begin with.

    Parameters
    ----------
    table : AerialControlTable
        Names the file that has them.
    source : MeasuredBlock
        Whose poses are taken where none is named.

    Returns
    -------
    FirstPoses
        The poses.

    Raises
    ------
    InputError
        The file has no attitudes of images.
    """
    if (path := table.initial) is None:
        return FirstPoses(source.measured.images, source.position_m, source.C_mc, "of the program")
    poses = read_poses(path)
    if poses.C_Ex is None or poses.x != "camera" or not poses.images:
        raise InputError.in_file(
            path, "has no attitudes of images by their names; leave aerial_control.initial out"
        )
    plane = plane_of(poses)
    position = plane.position_from_geodetic(poses.lat, poses.lon, poses.height)
    C = plane.C_mn(poses.lat, poses.lon) @ NED_ENU @ poses.C_Ex
    return FirstPoses(poses.images, position, C, f"of {path.name}", poses)


def plane_of(poses: Poses) -> TangentPlane:
    """Return the tangent plane at the middle of poses.

    Parameters
    ----------
    poses : Poses
        The poses.

    Returns
    -------
    TangentPlane
        Its origin is on the ellipsoid.
    """
    return TangentPlane(float(np.mean(poses.lat)), float(np.mean(poses.lon)), 0.0)


def first_attitudes(
    path: Path, images: Sequence[str], measured: Array, plane: TangentPlane, first: FirstPoses
) -> Array:
    """Return attitudes of images to begin with, in the axes of the measured positions.

    Parameters
    ----------
    path : Path
        The file of the positions.
    images : sequence of str
        Whose positions they are.
    measured : ndarray, (n, 3)
        Latitude and longitude, rad, and height, m.
    plane : TangentPlane
        The axes.
    first : FirstPoses
        The poses to begin with.

    Returns
    -------
    ndarray, (n, 3, 3)
        Camera to the plane; NaN of images without a pose.

    Raises
    ------
    InputError
        Too few images have a pose, or the positions are not those of these images.
    """
    X, C = first.of(images)
    posed = np.isfinite(X[:, 0])
    if (poses := first.on_earth) is not None:
        assert poses.C_Ex is not None  # `first_poses` has asked for them
        row = match_names(images, poses.images)
        attitude = (plane.C_mn(poses.lat, poses.lon) @ NED_ENU @ poses.C_Ex)[row]
        out = np.where((row >= 0)[:, None, None], attitude, np.nan)
        if posed.sum() >= FEWEST_PLACED:
            _refuse_mirrored(path, measured[posed], X[posed], C[posed])
        return out
    if posed.sum() < FEWEST_PLACED:
        raise InputError.in_file(
            path,
            f"has positions and no attitudes, and only {int(posed.sum())} of {len(images)} images"
            " have a pose in the image observations to begin with; give the project of a program"
            " that has aligned them (Metashape, COLMAP, ...), or a table with angles",
        )
    _refuse_mirrored(path, measured[posed], X[posed], C[posed])
    Y = plane.position_from_geodetic(*measured[posed].T)
    fitted = oriented_similarity(X[posed], Y, C[posed])
    rms, size = _rms(fitted.points(X[posed]) - Y), _rms(Y - Y.mean(axis=0))
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


def _rms(vectors: Array) -> float:
    return float(np.sqrt(np.mean(np.sum(vectors**2, axis=1))))


def _refuse_mirrored(path: Path, measured: Array, X: Array, C: Array) -> None:
    """Refuse positions with latitude and longitude exchanged, or of the other sign."""

    def misfit(geodetic: Array) -> float:
        lat, lon, _ = geodetic.mean(axis=0).tolist()
        plane = TangentPlane(lat, lon, 0.0)
        Y = plane.position_from_geodetic(*geodetic.T)
        fitted = oriented_similarity(X, Y, C)
        if (fitted.rotation @ C @ VIEW).mean(axis=0)[2] > UPWARD:
            return np.inf
        return _rms(fitted.points(X) - Y) / _rms(Y - Y.mean(axis=0))

    if misfit(measured) <= MISSHAPEN:
        return
    names = ("latitude", "longitude")
    changes = (*exchanged_orders(names), *reversed_signs((*names, ""), most=1))
    candidates = [Candidate(one.words, one.change) for one in changes]
    if (explanation := explain(measured, candidates, misfit, MISSHAPEN)) is not None:
        raise InputError.in_file(
            path,
            f"its positions are a mirror image of the images' poses: it has"
            f" {explanation.clauses()}; correct it there",
        )


def in_other_order(names: Sequence[str], Y: Array, images: Sequence[str], first: FirstPoses) -> str:
    """Say which position or image is too many where only their order pairs them.

    Parameters
    ----------
    names : sequence of str
        What the file of the positions calls them.
    Y : ndarray, (n, 3)
        The positions, m.
    images : sequence of str
        The images, in their order.
    first : FirstPoses
        Whose positions show the order.

    Returns
    -------
    str
        What is wrong and what to do; empty where the order is right, or cannot be told.
    """
    X, C = first.of(images)
    n = min(len(Y), len(images))
    step = float(np.median(np.linalg.norm(np.diff(Y, axis=0), axis=1))) if n > 1 else 0.0

    def misfit(pairs: tuple[Rows, Rows]) -> float:
        of_position, of_image = pairs
        posed = np.isfinite(X[of_image, 0])
        if posed.sum() < FEWEST_IN_ORDER:
            return np.inf
        x, y = X[of_image[posed]], Y[of_position[posed]]
        return _rms(oriented_similarity(x, y, C[of_image[posed]]).points(x) - y)

    in_order = np.arange(n), np.arange(n)
    before = misfit(in_order)
    if len(Y) == len(images) and before <= WITHIN_STEP * step:
        return ""
    candidates = list(_other_orders(names, images))
    explanation = explain(in_order, candidates, misfit, WITHIN_STEP * step)
    if explanation is None or len(explanation.alike) >= MOST_ALIKE:
        return ""
    return (
        f"its {len(Y)} positions and {len(images)} images can be paired by their order alone;"
        f" so paired, they are {before:.1f} m (rms) from each other after shift, rotation and"
        f" scale, but {explanation.left:.1f} m {explanation.clauses()};"
        f" {explanation.best.remedy}"
    )


def _other_orders(
    names: Sequence[str], images: Sequence[str]
) -> Iterator[Candidate[tuple[Rows, Rows]]]:
    """Positions or images too many, or pairs that are some rows off."""

    def one(statement: str, remedy: str, *pairs: Rows) -> Candidate[tuple[Rows, Rows]]:
        return Candidate(statement, lambda _: (pairs[0], pairs[1]), remedy=remedy)

    n, extra = min(len(names), len(images)), len(names) - len(images)
    all_rows, few = np.arange(n + abs(extra)), np.arange(n)
    if extra == 0:
        for k, of_image, of_position in orders(n):
            middle = of_image.size // 2
            image, name = images[of_image[middle]], names[of_position[middle]]
            way = "in the reverse order" if k is None else f"{k:+d} off"
            yield one(
                f"{way}, {image} at position {name}",
                "look for a test shot or a lost image, or name the images in the file",
                of_position,
                of_image,
            )
    elif abs(extra) <= MOST_EXTRA:
        longer, kind = (names, "position") if extra > 0 else (images, "image")
        for k in range(n + 1):
            without = np.delete(all_rows, slice(k, k + abs(extra)))
            statement = f"without {kind} {' and '.join(longer[k : k + abs(extra)])}"
            if extra > 0:
                remedy = "remove it from the file (a test shot, or an exposure without an image)"
                yield one(statement, remedy, without, few)
            else:
                yield one(
                    statement, "leave it out by images.skip, or add its position", few, without
                )


def lie_elsewhere(
    path: Path, images: Sequence[str], measured: Array, plane: TangentPlane, first: FirstPoses
) -> Finding:
    """Say by how much positions lie elsewhere than the first poses of the same images.

    Parameters
    ----------
    path : Path
        The file of the positions.
    images : sequence of str
        Whose positions they are.
    measured : ndarray, (n, 3)
        The positions in the plane, m.
    plane : TangentPlane
        The axes.
    first : FirstPoses
        The poses to begin with.

    Returns
    -------
    Finding
        The difference, or that nothing checks them.
    """
    advice = (
        "measure a ground point in the images, which reveals errors of geoid, antenna height"
        " and base"
    )
    if (poses := first.on_earth) is not None:
        row = match_names(images, poses.images)
        X = plane.position_from_geodetic(poses.lat, poses.lon, poses.height)[row[row >= 0]]
        middle = np.median(measured[row >= 0] - X, axis=0) if X.size else np.zeros(3)
        sigma = poses.cov_position
        limit = ELSEWHERE_M
        if sigma is not None:
            limit += 3.0 * float(np.sqrt(np.median(np.trace(sigma, axis1=1, axis2=2))))
        if np.linalg.norm(middle) > limit:
            return Finding(
                "positions",
                f"positions of {path.name} lie {' / '.join(f'{x:+.1f}' for x in middle)} m (east,"
                f" north, up) from those {first.origin} of the same {len(X)} images, and no ground"
                " point shows which of them is right",
                verdict="unknown",
                remedy=advice,
                rank=0.99,
            )
    return ranked(
        "positions",
        0.5,
        f"nothing in this block checks the positions of {path.name} as a whole: a wrong base,"
        " geoid heights taken as ellipsoidal or a wrong antenna height move all images alike",
        advice,
    )


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
