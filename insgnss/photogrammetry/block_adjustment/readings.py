"""A block as somebody may have written it: other axes, other order of images, other attitudes.

Each reading is fitted to itself: the bore-sight (and of one a delay of the exposures) that brings
rays of the same point nearest to each other, by least squares with weights of a robust scale. What
is left, the median distance of rays from the points that they intersect in, is in pixels.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...geodesy.conventions import CAMERA_SETS, JUDGED_ROWS, angles, orders, turned_by
from ...geodesy.explain import Candidate
from ...geodesy.rotation import CV_RUB, right_angle_rotations, rotation_from_vector
from ...records.block import INTERIOR, Array, BrownCamera
from ...records.rows import rows_of
from ..adjust.start import directions, intersect_rays
from .aerial.relative import flight_lines
from .inputs import BlockInputs

# below which no reading is judged (chosen): three or four unknowns are fitted
FEWEST_RAYS_JUDGED = 60
MOST_RAYS = 500  # of one reading (chosen): dozens of readings are fitted
# steps of a fit, and after how many a hopeless one is given up; longest step (rad, s) (chosen)
MOST_READING_STEPS, FEW_STEPS, LONGEST_READING_STEP = 10, 3, 0.2
OWN_AXES = ("its x axis", "its y axis", "its z axis")
OF_FLIGHT = "correct camera_from_body or bore-sight of the flight file and process again"
OF_EO = "write the attitudes of eo.json as its conventions say (data_specs/eo_json.md)"
ALONE = "begin with other attitudes (--initial)"
MISSED = (
    "a photograph or a position is missing there, or one too many; name positions by their images"
)
TURNS_DEG = (90.0, 180.0, 270.0)  # of the attitudes of a line: of a reversed course, of a camera
RAYS_OF_IMAGE = 20  # of an image (chosen), where the image is looked for at which an order breaks
MOST_MISSED = 2  # photographs or positions missing at one place that are looked for (chosen)
PLACES, PLACES_OF_LINE = 24, 4  # of all images and of a line, tried before single images (chosen)
FEWEST_IN_LINE = 4  # images of a line, below which its order is not judged (chosen)
FAR_OFF = 1e6  # pixels, of a point behind its camera
VERTICAL = np.array([0.0, 0.0, 1.0])  # up, of the tangent plane
Rows = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class BlockReading:
    """A block as somebody may have written it.

    Parameters
    ----------
    position, C : ndarray
        (n, 3) and (n, 3, 3) poses of the images.
    xy : ndarray
        (k, 2) rays, on the plane of unit distance.
    image, point : ndarray of int
        (k,) image and object point of each ray.
    f : ndarray
        (k,) camera constants, pixels.
    row : ndarray of int
        (k,) rows of the image observations.
    velocity, rate : ndarray, optional
        (n, 3) of the images, m/s and rad/s, where a delay of the exposures is fitted as well.
    """

    position: Array
    C: Array
    xy: Array
    image: Rows
    point: Rows
    f: Array
    row: Rows
    velocity: Array | None = None
    rate: Array | None = None

    def rows(self, keep: NDArray[np.bool_] | Rows) -> "BlockReading":
        """Return some of its rays."""
        return replace(self, **rows_of(self, keep, ("xy", "image", "point", "f", "row")))

    def crossing(self, keep: NDArray[np.bool_]) -> "BlockReading":
        """Return some of its rays, of points that two of them see."""
        some = self.rows(keep)
        return some.rows(np.bincount(some.point)[some.point] >= 2)

    def moved(self, change: Array) -> tuple[Array, Array]:
        """Return the poses with a bore-sight (3,), rad, and behind it perhaps a delay, s."""
        position, C = self.position, self.C @ rotation_from_vector(change[:3])
        if change.size > 3 and self.velocity is not None and self.rate is not None:
            position = position + change[3] * self.velocity
            C = rotation_from_vector(change[3] * self.rate) @ C
        return position, C

    def residuals(self, change: Array | None = None) -> Array:
        """Return the distances (k, 2) of intersected points from their rays, pixels.

        Parameters
        ----------
        change : ndarray, optional
            Bore-sight (3,), rad, and perhaps a delay, s.
        """
        position, C = self.moved(np.zeros(3) if change is None else change)
        points, rows = np.unique(self.point, return_inverse=True)
        X = intersect_rays(position, C, self.xy, self.image, rows, points.size)
        q = np.einsum("nji,nj->ni", C[self.image], X[rows] - position[self.image])
        with np.errstate(all="ignore"):
            e = self.f[:, None] * (self.xy - q[:, :2] / q[:, 2:])
        in_front = (q[:, 2] > 0.0) & np.isfinite(e).all(axis=1)
        return np.where(in_front[:, None], np.clip(e, -FAR_OFF, FAR_OFF), FAR_OFF)

    def fitted(self, hopeless: float = np.inf) -> tuple[float, Array]:
        """Return the median distance of rays, pixels, and the change that makes it least.

        Parameters
        ----------
        hopeless : float
            Pixels; a reading that is farther apart after a few steps is given up.
        """
        n = 3 if self.velocity is None else 4
        change = np.zeros(n)
        e = self.residuals()
        best = median_length(e)
        damping = 0.0
        for step_number in range(MOST_READING_STEPS):
            if step_number >= FEW_STEPS and best > hopeless:
                break
            J = np.stack(
                [(self.residuals(change + 1e-5 * axis) - e) / 1e-5 for axis in np.eye(n)], axis=2
            )
            distance = np.linalg.norm(e, axis=1)
            weight = np.minimum(1.0, max(best, 1e-6) / np.maximum(distance, 1e-12))
            weight *= (np.abs(J).max(axis=(1, 2)) < FAR_OFF) & (distance < FAR_OFF)
            N = np.einsum("n,nki,nkj->ij", weight, J, J)
            g = np.einsum("n,nki,nk->i", weight, J, e)
            if not np.linalg.cond(N) < 1e12:
                break
            step = -np.linalg.solve(N * (1.0 + damping * np.eye(n)), g)
            step *= min(1.0, LONGEST_READING_STEP / max(float(np.linalg.norm(step)), 1e-12))
            ahead = self.residuals(change + step)
            if not (after := median_length(ahead)) < best:
                if damping > 10.0:
                    break
                damping = max(10.0 * damping, 0.1)
                continue
            done = after > 0.99 * best
            change, e, best, damping = change + step, ahead, after, 0.1 * damping
            if done:
                break
        return best, change


def median_length(e: Array) -> float:
    """Return the median length of vectors.

    Parameters
    ----------
    e : ndarray, (n, d)
        The vectors.

    Returns
    -------
    float
        In their unit.
    """
    return float(np.median(np.linalg.norm(e, axis=1)))


def as_given(inputs: BlockInputs) -> BlockReading:
    """Return the rays of images with aerial control to points that two of them see.

    Parameters
    ----------
    inputs : BlockInputs
        The block.

    Returns
    -------
    BlockReading
        The block as it is given.
    """
    block, obs = inputs.block, inputs.block.observations
    keep = (inputs.eo_row >= 0)[obs.image]
    xy = directions(block)
    keep &= np.isfinite(xy).all(axis=1)
    count = np.bincount(obs.point[keep], minlength=len(block.points))
    keep &= count[obs.point] >= 2
    f = np.array([camera.of("f") for camera in block.cameras])[block.camera[obs.image]]
    rows = np.arange(keep.size)
    whole = BlockReading(block.position_m, block.C_mc, xy, obs.image, obs.point, f, rows)
    return whole.rows(keep)


def some_rays(reading: BlockReading, most: int = MOST_RAYS) -> BlockReading:
    """Return the rays of points in even steps, of those with three rays where there are enough.

    Parameters
    ----------
    reading : BlockReading
        All rays.
    most : int
        How many rays are wanted.

    Returns
    -------
    BlockReading
        With as many rays, about.
    """
    count = np.bincount(reading.point)
    points = np.flatnonzero(count >= 3)
    if count[points].sum() < FEWEST_RAYS_JUDGED:
        points = np.flatnonzero(count >= 2)
    if points.size and (total := int(count[points].sum())) > most:
        steps = np.linspace(0, points.size - 1, max(1, points.size * most // total))
        points = points[steps.astype(int)]
    return reading.rows(np.isin(reading.point, points))


def readings(inputs: BlockInputs, few: BlockReading) -> Iterator[Candidate[BlockReading]]:
    """Return how somebody may have written a block.

    Parameters
    ----------
    inputs : BlockInputs
        The block.
    few : BlockReading
        As it is given.

    Yields
    ------
    Candidate
        Its statement follows "as if"; of a delay, "{:+.2f}" stands for it.
    """
    yield from _other_stamps(inputs, few)
    yield from _other_numbers(inputs, few)
    alone = inputs.file.aerial_control.positions_alone
    yield from _other_axes(few, ALONE if alone else OF_FLIGHT)
    yield from _other_attitudes(few, ALONE if alone else OF_EO)
    yield from _other_cameras(inputs, few)


def _read(
    text: str,
    remedy: str,
    few: BlockReading,
    reread: BlockReading,
    keep: NDArray[np.bool_] | None = None,
) -> Candidate[BlockReading]:
    """Return a candidate; `keep`: the rays that it has, where those are not all."""
    if keep is None or keep.all():
        return Candidate(text, lambda _: reread, remedy=remedy)
    rays_of_reading, same = reread.crossing(keep), few.crossing(keep)
    return Candidate(text, lambda _: rays_of_reading, remedy=remedy, same=lambda _: same)


def _other_axes(few: BlockReading, attitudes: str) -> Iterator[Candidate[BlockReading]]:
    """Pixel axes and camera axes: the 48 signed permutations of the axes of a ray."""
    corner = "(x right, y down from the upper left corner)"
    for order, sign, text, remedy in (
        ([0, 1], (1, -1), "y counted upwards from the lower edge", "mirror y: height - y"),
        ([0, 1], (-1, 1), "x counted from the right edge", "mirror x: width - x"),
        ([1, 0], (1, 1), "columns x and y were exchanged", "exchange them"),
        ([1, 0], (-1, -1), "x and y were exchanged and count backwards", "write x right, y down"),
    ):
        reread = replace(few, xy=few.xy[:, order] * np.array(sign))
        yield _read(text, f"{remedy} {corner}", few, reread)
    remedy = f"{attitudes}, or turn the images as the camera took them"
    for R in right_angle_rotations()[1:].swapaxes(1, 2):
        text = f"the camera were turned by {turned_by(R, OWN_AXES)}"
        yield _read(text, remedy, few, replace(few, C=few.C @ R))


def _other_attitudes(few: BlockReading, remedy: str) -> Iterator[Candidate[BlockReading]]:
    """Attitudes that were composed in another way."""
    good = np.isfinite(few.C).all(axis=(1, 2))
    R = few.C[good] @ CV_RUB

    def turned(text: str, changed: Array) -> Candidate[BlockReading]:
        C = few.C.copy()
        C[good] = changed
        return _read(text, remedy, few, replace(few, C=C))

    transposed = np.ascontiguousarray(few.C[good].swapaxes(1, 2))
    yield turned("the matrices of the attitudes were transposed", transposed)
    opk, reverse = CAMERA_SETS["opk"], CAMERA_SETS["kpo"]
    for read_as, sets in ((opk, CAMERA_SETS), (reverse, {"opk": opk})):
        for one in angles(read_as, sets, units=()):
            text = f"the attitudes had {one.words}"
            yield turned(text, one.change(read_as.take(R)) @ CV_RUB.T)


def _other_stamps(inputs: BlockInputs, few: BlockReading) -> Iterator[Candidate[BlockReading]]:
    """Exposures that lag behind their stamps."""
    eo = inputs.eo
    if eo is None or eo.velocity_mps is None or eo.rate_radps is None:
        return
    velocity, rate = inputs.of_images(eo.velocity_mps), inputs.of_images(eo.rate_radps)
    yield _read(
        "the exposures had a delay of {:+.2f} s behind their stamps",
        "correct the stamps or camera.time_offset_s of the flight file and process again",
        few,
        replace(few, velocity=velocity, rate=rate),
    )


def _other_numbers(inputs: BlockInputs, few: BlockReading) -> Iterator[Candidate[BlockReading]]:
    """Images that have the observations of a neighbour, or are numbered backwards."""
    order = np.argsort(inputs.eo_row, kind="stable")
    order = order[inputs.eo_row[order] >= 0]
    names = inputs.block.images
    remedy = "correct the names of the images or the stamps of the exposures"
    for k, one, source_order in orders(order.size):
        images, source = order[one], order[source_order]
        position, C = few.position.copy(), few.C.copy()
        position[images] = few.position[source]
        if not inputs.file.aerial_control.positions_alone:
            C[images] = few.C[source]  # else attitudes come by name, from elsewhere
        text = f"images were numbered in the reverse order, {names[order[0]]} the last"
        if k is not None:
            middle = one.size // 2
            text = (
                f"each image had the pose of another: {names[images[middle]]} that of"
                f" {names[source[middle]]} ({k:+d} in the order of time)"
            )
        keep = np.isin(few.image, images)
        if keep.mean() < JUDGED_ROWS:
            continue
        yield _read(text, remedy, few, replace(few, position=position, C=C), keep)


def _other_cameras(inputs: BlockInputs, few: BlockReading) -> Iterator[Candidate[BlockReading]]:
    """A principal point that counts from the middle of the image, a camera of another format."""
    block = inputs.block

    def read(text: str, remedy: str, cameras: list[BrownCamera]) -> Candidate[BlockReading]:
        xy = directions(replace(block, cameras=tuple(cameras)))[few.row]
        f = np.array([camera.of("f") for camera in cameras])[block.camera[few.image]]
        keep = np.asarray(np.isfinite(xy).all(axis=1))
        return _read(text, remedy, few, replace(few, xy=xy, f=f), keep)

    middle = [
        with_values(c, cx=c.of("cx") + c.width / 2, cy=c.of("cy") + c.height / 2)
        for c in block.cameras
    ]
    yield read(
        "cx and cy, the principal point, counted from the middle of the image",
        f"write them from its upper left corner, {middle[0].of('cx'):.1f} and"
        f" {middle[0].of('cy'):.1f} px",
        middle,
    )
    for times in (0.5, 2.0):
        cameras = [
            with_values(c, **{k: times * c.of(k) for k in ("f", "cx", "cy")}) for c in block.cameras
        ]
        yield read(
            f"the camera were of images of {times:g} times the size",
            "give the camera of these images: f, cx, cy, width and height in their pixels",
            cameras,
        )


@dataclass(frozen=True)
class _Break:
    """What is wrong with the images of consecutive rows, in the order of time.

    first, end : rows from the first on, without the last.
    missed : by how many rows their positions are off; 0: they are in the reverse order, or
    turn_deg : their attitudes are turned about the vertical.
    """

    first: int
    end: int
    missed: int = 0
    turn_deg: float = 0.0

    def read(self, stated: BlockReading, order: Rows, alone: bool) -> BlockReading:
        """Return the block with it mended; `alone`: attitudes come by name, from elsewhere.

        `order` has the rows of images by time; those that then have no position take no part.
        """
        position, C = stated.position.copy(), stated.C.copy()
        rows = np.arange(self.first, self.end)
        if self.turn_deg:
            turn = rotation_from_vector(np.radians(self.turn_deg) * VERTICAL)
            C[order[rows]] = turn @ C[order[rows]]
            return replace(stated, C=C)
        source = rows + self.missed if self.missed else rows[::-1]
        has = (source >= self.first) & (source < self.end)
        position[order[rows[has]]] = stated.position[order[source[has]]]
        if not alone:
            C[order[rows[has]]] = stated.C[order[source[has]]]
        keep = ~np.isin(stated.image, order[rows[~has]])
        return replace(stated, position=position, C=C).crossing(keep)

    def statement(self, names: Sequence[str]) -> str:
        """Return what is the case, of images by name in the order of time."""
        images = f"images {names[self.first]} to {names[self.end - 1]}"
        if self.turn_deg:
            turned_deg = 360.0 - self.turn_deg
            return f"the attitudes of {images}, a flight line, were turned by {turned_deg:.0f} deg"
        if not self.missed:
            return f"{images}, a flight line, were numbered in the reverse order"
        n = abs(self.missed)
        which = f"{n} before it" if self.missed > 0 else f"{n} after it"
        return f"each of the {images} had the position of the image {which}"


def broken_orders(
    inputs: BlockInputs, whole: BlockReading, longest_px: float
) -> Iterator[Candidate[BlockReading]]:
    """Return how the order of images may break: from one image on, or in one flight line.

    Of each kind the place is taken that leaves the shortest distances of rays on average; their
    median says nothing, since most rays fit wherever an order breaks.

    Parameters
    ----------
    inputs : BlockInputs
        The block.
    whole : BlockReading
        As it is stated.
    longest_px : float
        Distance as which longer ones are counted.

    Yields
    ------
    Candidate
        One of each kind, judged by the rays of the points that its images see.
    """
    order = np.argsort(inputs.eo_row, kind="stable")
    order = order[inputs.eo_row[order] >= 0]
    if inputs.eo is None or not order.size:
        return
    few, names = some_rays(whole, RAYS_OF_IMAGE * order.size), inputs.block.images
    in_order = [names[k] for k in order]
    rows = inputs.eo_row[order]
    lines = [np.flatnonzero(np.isin(rows, line)) for line in flight_lines(inputs.eo)]
    lines = [line for line in lines if line.size >= FEWEST_IN_LINE]
    alone = inputs.file.aerial_control.positions_alone

    def misfit(one: _Break) -> float:
        distance = np.linalg.norm(one.read(few, order, alone).residuals(), axis=1)
        return float(np.minimum(distance, longest_px).mean())

    def candidate(one: _Break) -> Candidate[BlockReading]:
        concerned = np.isin(few.image, order[one.first : one.end])
        of_points = few.rows(np.isin(few.point, few.point[concerned]))
        mended = one.read(of_points, order, alone)
        same = of_points.rows(np.isin(of_points.row, mended.row))
        remedy = ALONE if one.turn_deg else MISSED if one.missed else "correct their names"
        return Candidate(
            one.statement(in_order), lambda _: mended, remedy=remedy, same=lambda _: same
        )

    def best(kind: Sequence[_Break], step: int = 1) -> _Break:
        coarse = min(kind[::step], key=misfit)
        k = kind.index(coarse)
        return min(kind[max(0, k - step + 1) : k + step], key=misfit)

    for missed in (k for k in range(-MOST_MISSED, MOST_MISSED + 1) if k):
        last = order.size - abs(missed)
        to_end = [_Break(k, order.size, missed) for k in range(1, last)]
        if to_end:
            yield candidate(best(to_end, max(1, len(to_end) // PLACES)))
        if lines:
            firsts = [line[: -abs(missed)] for line in lines]
            coarse = min(
                (
                    _Break(int(k), int(line[-1]) + 1, missed)
                    for line, first in zip(lines, firsts, strict=True)
                    for k in first[:: max(1, line.size // PLACES_OF_LINE)]
                ),
                key=misfit,
            )
            line = next(first for first in firsts if coarse.first in first)
            yield candidate(best([replace(coarse, first=int(k)) for k in line]))
    if lines:
        ends = [(int(line[0]), int(line[-1]) + 1) for line in lines]
        yield candidate(best([_Break(*line) for line in ends]))
        for turn_deg in TURNS_DEG:
            yield candidate(best([_Break(*line, turn_deg=turn_deg) for line in ends]))


def with_values(camera: BrownCamera, **values: float) -> BrownCamera:
    """Return a camera with other values of some parameters.

    Parameters
    ----------
    camera : BrownCamera
        The camera.
    **values : float
        Of `INTERIOR`, by name.

    Returns
    -------
    BrownCamera
        The camera otherwise as it was.
    """
    interior = np.array(camera.interior)
    for name, value in values.items():
        interior[INTERIOR.index(name)] = value
    return replace(camera, interior=interior)
