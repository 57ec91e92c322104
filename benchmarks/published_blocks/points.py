"""Points of a published block: tie points of a clumsy texture, surveyed points, and who sees them.

The texture is a sum of waves, between poor and rich. Where it is poor there are fewer tie points,
they are measured in fewer of the images that see them, and less precisely. Numbers of points and of
measurements are those of the tables exactly: of each point the fewest measurements that it needs,
of all others those that the texture favours.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from insgnss.base.errors import UsageError
from insgnss.records import ExteriorOrientation
from insgnss.records.block import BrownCamera
from insgnss.simulation.image_block import Terrain, Visible, seen_points, under_images

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

POOREST = 0.12
"""Weight of the poorest texture; of the richest it is 1."""
_WAVES, _WAVE_M, _SHARPNESS = 5, (70.0, 350.0), 2.0
_ROUNDS, _CANDIDATES = 60, 4
_NEAR_M = 110.0


def rolling(
    relief_m: float, wave_m: tuple[float, float], over: Array, rng: np.random.Generator
) -> Terrain:
    """Return ground (B.1) about height zero with a given relief.

    Parameters
    ----------
    relief_m : float
        Between its lowest and its highest place, m.
    wave_m : tuple of float
        Shortest and longest wave.
    over : ndarray, (n, 2)
        Places, east and north, over which the relief is meant.
    rng : numpy.random.Generator
        Where the waves are drawn.

    Returns
    -------
    Terrain
        The ground.
    """
    length, way = rng.uniform(*wave_m, 4), rng.uniform(0.0, 2.0 * np.pi, 4)
    wave = 2.0 * np.pi / length * np.array([np.cos(way), np.sin(way)])
    phase = rng.uniform(0.0, 2.0 * np.pi, 4)
    raw = np.sin(over @ wave + phase).sum(axis=1)
    amplitude = relief_m / float(np.ptp(raw))
    middle = -0.5 * amplitude * float(raw.max() + raw.min())
    return Terrain(middle, np.full(4, amplitude), wave, phase)


class Texture:
    """What the ground offers to matching, from `POOREST` to 1 at each place."""

    def __init__(self, rng: np.random.Generator) -> None:
        length, way = rng.uniform(*_WAVE_M, _WAVES), rng.uniform(0.0, 2.0 * np.pi, _WAVES)
        self._wave = 2.0 * np.pi / length * np.array([np.cos(way), np.sin(way)])
        self._phase = rng.uniform(0.0, 2.0 * np.pi, _WAVES)

    def __call__(self, horizontal: Array) -> Array:
        """Return the texture (n,) at places (n, 2)."""
        total = np.sin(horizontal @ self._wave + self._phase).sum(axis=1)
        rich = 1.0 / (1.0 + np.exp(-_SHARPNESS * total))
        return np.asarray(POOREST + (1.0 - POOREST) * rich)


def tie_points(
    eo: ExteriorOrientation,
    camera: BrownCamera,
    terrain: Terrain,
    texture: Callable[[Array], Array],
    numbers: tuple[int, int, int],
    rng: np.random.Generator,
) -> Visible:
    """Return tie points with an exact number of measurements.

    Parameters
    ----------
    eo : ExteriorOrientation
        True poses.
    camera : BrownCamera
        The true camera.
    terrain : Terrain
        Where they lie.
    texture : callable
        Texture (n,) at places (n, 2).
    numbers : tuple of int
        Points, measurements, fewest measurements of a point.
    rng : numpy.random.Generator
        Where they are drawn.

    Returns
    -------
    Visible
        The points and where they are measured.

    Raises
    ------
    UsageError
        The images do not overlap enough for these numbers.
    """
    count, total, fewest = numbers
    batches: list[Array] = []
    for _ in range(_ROUNDS):
        drawn = under_images(eo, terrain, _CANDIDATES * count, rng)
        drawn = drawn[rng.random(len(drawn)) < texture(drawn[:, :2])]
        drawn = drawn[seen_points(eo, drawn, camera).rays() >= fewest]
        batches.append(drawn)
        if sum(map(len, batches)) >= count:
            break
    position = np.vstack(batches)[:count]
    seen = seen_points(eo, position, camera)
    return measured(seen, total, fewest, texture(position[:, :2]), rng)


def measured(
    seen: Visible, total: int, fewest: int, weight: Array, rng: np.random.Generator
) -> Visible:
    """Return points with exactly so many measurements of those that are possible.

    Parameters
    ----------
    seen : Visible
        Where the points appear.
    total, fewest : int
        Measurements in all, and of each point at least.
    weight : ndarray, (m,)
        How readily each point is measured.
    rng : numpy.random.Generator
        Which images are taken.

    Returns
    -------
    Visible
        The same points.

    Raises
    ------
    UsageError
        There are not so many.
    """
    rays = seen.rays()
    if len(seen.point) < total or total < fewest * len(rays) or rays.min(initial=fewest) < fewest:
        raise UsageError(
            f"{len(rays)} points appear {len(seen.point)} times in the images, the rarest"
            f" {rays.min(initial=0)} times; {total} measurements, {fewest} of each, cannot be made"
        )
    key = np.log(rng.random(len(seen.point))) / weight[seen.point]
    order = np.lexsort((-key, seen.point))
    first = np.concatenate([[0], np.cumsum(rays)])
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    key[rank - first[seen.point] < fewest] = np.inf
    keep = np.sort(np.argsort(-key, kind="stable")[:total])
    return Visible(seen.position, seen.image[keep], seen.point[keep], seen.uv[keep])


def near_one_end(
    eo: ExteriorOrientation,
    camera: BrownCamera,
    terrain: Terrain,
    numbers: tuple[int, int, int, int],
    way: tuple[float, float],
    rng: np.random.Generator,
) -> tuple[Visible, Rows]:
    """Return surveyed points: control near one end or corner of the block, check points all over.

    Parameters
    ----------
    eo, camera, terrain :
        As of `tie_points`.
    numbers : tuple of int
        Control and check points, and how many images see each of them at least.
    way : tuple of float
        East and north of the direction at whose end the control points lie.
    rng : numpy.random.Generator
        Where they are drawn.

    Returns
    -------
    seen : Visible
        Control points, then check points, in all images that see them.
    control : ndarray of int
        Rows of the control points.

    Raises
    ------
    UsageError
        Too few places that so many images see.
    """
    n_control, n_check, control_rays, check_rays = numbers
    drawn = under_images(eo, terrain, 2000, rng)
    seen = seen_points(eo, drawn, camera)
    rays, far = seen.rays(), drawn[:, :2] @ np.array(way)
    often = np.flatnonzero(rays >= control_rays)
    others = np.flatnonzero(rays >= check_rays)
    if len(often) < n_control or len(others) < n_check:
        raise UsageError("too few places on the ground that enough images see; fly more lines")
    corner = drawn[often[np.argmax(far[often])], :2]
    close = often[np.linalg.norm(drawn[often, :2] - corner, axis=1) < _NEAR_M]
    control = _apart(drawn[:, :2], close, n_control)
    check = _apart(drawn[:, :2], others, n_check, control)
    return seen.chosen(np.r_[control, check]), np.arange(n_control)


def _apart(
    horizontal: Array, candidates: Rows, wanted: int, already: Rows | None = None
) -> NDArray[np.int64]:
    """Return candidates that lie as far from each other (and from others) as possible."""
    chosen: list[int] = []
    others = (
        horizontal[already] if already is not None else horizontal[candidates].mean(axis=0)[None]
    )
    gap = np.linalg.norm(horizontal[candidates][:, None] - others, axis=2).min(axis=1)
    for _ in range(min(wanted, len(candidates))):
        k = int(np.argmax(gap))
        own = np.linalg.norm(horizontal[candidates] - horizontal[candidates[k]], axis=1)
        gap = own if not chosen and already is None else np.minimum(gap, own)
        chosen.append(int(candidates[k]))
    return np.array(chosen, dtype=np.int64)


def in_groups(
    centreline: Callable[[Array], Array],
    across: Callable[[Array], Array],
    terrain: Terrain,
    groups: tuple[int, ...],
    length_m: tuple[float, float],
    rng: np.random.Generator,
) -> Array:
    """Return surveyed points in groups along a road.

    Parameters
    ----------
    centreline, across : callable
        Places (n, 2) of lengths along the road, and unit vectors to its right.
    terrain : Terrain
        Where they lie.
    groups : tuple of int
        How many points each group has.
    length_m : tuple of float
        Lengths along the road of the first and the last group.
    rng : numpy.random.Generator
        Where they are drawn.

    Returns
    -------
    ndarray, (m, 3)
        The points, group by group.
    """
    length = np.repeat(np.linspace(*length_m, len(groups)), groups)
    length = length + rng.uniform(-8.0, 8.0, length.size)
    side = np.where(np.arange(length.size) % 2, 1.0, -1.0) * rng.uniform(4.0, 20.0, length.size)
    return terrain.points(centreline(length) + side[:, None] * across(length))
