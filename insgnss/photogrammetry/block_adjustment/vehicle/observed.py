"""Which image observations are the vehicle's target.

The target is another object point in every image, as the vehicle drives. Its points are those whose
name begins with `vehicle.target`, such as K_IMG_0010 of image IMG_0010, or is just that, such as
KITE in all images. A name that several images have would make one point of places that are far from
each other: it is divided, one point an image.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ....base.errors import InputError, near
from ....io.formats.blocks.image_points import ImagePoints
from ....io.formats.text.layout import quote


@dataclass(frozen=True, eq=False)
class TargetViews:
    """Image observations in which the vehicle's target is a point of its own in every image.

    Parameters
    ----------
    measured : ImagePoints
        All image observations.
    images, points : tuple of str
        (k,) images that see the target, and its point in each.
    divided : tuple of str
        Names that several images had.
    """

    measured: ImagePoints
    images: tuple[str, ...]
    points: tuple[str, ...]
    divided: tuple[str, ...]


def observed_target(measured: ImagePoints, target: str, ground: Sequence[str] = ()) -> TargetViews:
    """Find the vehicle's target in the image observations, and divide it by images.

    Parameters
    ----------
    measured : ImagePoints
        All image observations.
    target : str
        Prefix of its names, or its name.
    ground : sequence of str
        Names of ground points, which do not move.

    Returns
    -------
    TargetViews
        The observations with a name an image.

    Raises
    ------
    InputError
        No point is called so, a point that stands still is, or an image has two of them.
    """
    names = measured.points
    mine = np.array([name.startswith(target) for name in names], dtype=bool)
    observations = measured.observations
    rows = np.flatnonzero(mine[observations.point])
    if not rows.size:
        raise InputError(
            f"vehicle.target: no point of the image observations begins with {quote(target)};"
            f" {near(target, names[:200])}; the target of image IMG is called {target}IMG"
        )
    fixed = set(ground)
    if fixed_points := [names[p] for p in np.unique(observations.point[rows]) if names[p] in fixed]:
        raise InputError(
            f"vehicle.target: point {quote(fixed_points[0])} begins with {quote(target)} and is a"
            " ground point, which does not move; rename it, or give another vehicle.target"
        )
    count = np.bincount(observations.image[rows], minlength=len(measured.images))
    if (count > 1).any():
        twice = int(np.argmax(count))
        two_points = [
            names[observations.point[r]] for r in rows[observations.image[rows] == twice][:2]
        ]
        raise InputError(
            f"vehicle.target: image {quote(measured.images[twice])} sees {count[twice]} points that"
            f" begin with {quote(target)} ({quote(two_points[0])}, {quote(two_points[1])}): a"
            " vehicle has one target; give a prefix that no other point has"
        )
    return _divide_by_image(measured, rows, target)


def _divide_by_image(measured: ImagePoints, rows: NDArray[np.int64], target: str) -> TargetViews:
    """Give every image a point of its own."""
    obs, points = measured.observations, list(measured.points)
    taken = set(points)
    shared = np.bincount(obs.point[rows], minlength=len(points)) > 1
    point = np.array(obs.point)
    divided = []
    for row in rows.tolist():
        old = int(obs.point[row])
        if not shared[old]:
            continue
        image = measured.images[int(obs.image[row])]
        name = f"{target}{image}" if target != measured.points[old] else f"{target}_{image}"
        while name in taken:
            name += "'"
        taken.add(name)
        point[row] = len(points)
        points.append(name)
        divided.append(measured.points[old])
    changed = replace(measured, points=tuple(points), observations=replace(obs, point=point))
    if divided:  # names that no image has any more
        used = np.bincount(point, minlength=len(points)) > 0
        used[: len(measured.points)] |= ~shared
        new = np.cumsum(used) - 1
        changed = replace(
            measured,
            points=tuple(name for name, is_used in zip(points, used, strict=True) if is_used),
            observations=replace(obs, point=new[point]),
        )
    of_changed = changed.observations
    return TargetViews(
        changed,
        tuple(changed.images[i] for i in of_changed.image[rows]),
        tuple(changed.points[p] for p in of_changed.point[rows]),
        tuple(dict.fromkeys(divided)),
    )


def without(observed: TargetViews, images: Sequence[str]) -> TargetViews:
    """Leave the target out of some images.

    Parameters
    ----------
    observed : TargetViews
        All of them.
    images : sequence of str
        Names of images.

    Returns
    -------
    TargetViews
        The rest; points that nobody sees any more keep their names.

    Raises
    ------
    InputError
        An image that does not see the target.
    """
    gone = set(images)
    if bad := sorted(gone - set(observed.images)):
        raise InputError(
            f"vehicle.skip: {bad[0]!r} does not see the target;"
            f" {near(bad[0], observed.images[:200])}"
        )
    points = {p for i, p in zip(observed.images, observed.points, strict=True) if i in gone}
    observations, names = observed.measured.observations, observed.measured.points
    keep = np.array([names[p] not in points for p in observations.point], dtype=bool)
    remaining = [k for k, image in enumerate(observed.images) if image not in gone]
    return replace(
        observed,
        measured=replace(observed.measured, observations=observations.rows(keep)),
        images=tuple(observed.images[k] for k in remaining),
        points=tuple(observed.points[k] for k in remaining),
    )
