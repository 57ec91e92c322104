"""What is seen of a block before it is adjusted: do its rays meet with the poses that are given?

Rays of a point meet to some pixels where image observations, camera and orientation belong to each
other, whatever is left of the bore-sight, which is fitted first. Where they do not meet at all, the
block is read as somebody may have written it: other pixel axes, other camera axes, images numbered
by one more, another camera. One reading that makes the rays meet five times better names what is
wrong. Of a block whose rays meet, the images that alone do not are named, and the ground points
that lie elsewhere than the images see them. Where there is little to go by nothing is said.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from ..adjust.start import directions, intersected
from ..base.errors import DataError
from ..geodesy.rotation import (
    CV_RUB,
    opk_from_rotation,
    rotation_from_opk,
    rotation_from_vector,
    rpy_from_rotation,
    vector_from_rotation,
)
from ..records.block import INTERIOR, Array, BrownCamera, ImageBlock
from .inputs import Inputs

FEWEST_RAYS, FEWEST_IMAGES, FEWEST_OF_IMAGE = 60, 3, 8
MOST_RAYS = 1500
APART = 0.02  # of the longer side: rays that are farther apart than this do not meet
DOUBTFUL = 0.008  # the same, where another reading makes them meet
SIGMAS, FEW_SIGMAS = 5.0, 2.0  # of the attitudes, where they are that poor
BETTER = 5.0
MOST_IMAGES = 6
STEPS, LONGEST_STEP = 10, 0.2
FAR_OFF = 1e6  # pixels, of a point behind its camera
FOOT_M = 0.3048
ALIKE, OFF_M = 0.2, 5.0
Rows = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Reading:
    """A block as somebody may have written it.

    Parameters
    ----------
    text : str
        What it says of the files, after "as if".
    remedy : str
        What to do where it fits.
    position, C : ndarray
        (n, 3) and (n, 3, 3) poses of the images.
    xy : ndarray
        (k, 2) rays, on the plane of unit distance.
    image, point : ndarray of int
        (k,) image and object point of each ray.
    f : ndarray
        (k,) camera constants, pixels.
    velocity, rate : ndarray, optional
        (n, 3) of the images, m/s and rad/s, where a delay of the exposures is fitted as well.
    """

    text: str
    remedy: str
    position: Array
    C: Array
    xy: Array
    image: Rows
    point: Rows
    f: Array
    velocity: Array | None = None
    rate: Array | None = None

    def rows(self, keep: NDArray[np.bool_] | Rows) -> "Reading":
        """Return some of its rays."""
        return replace(
            self,
            xy=self.xy[keep],
            image=self.image[keep],
            point=self.point[keep],
            f=self.f[keep],
        )

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
        X = intersected(position, C, self.xy, self.image, rows, points.size)
        q = np.einsum("nji,nj->ni", C[self.image], X[rows] - position[self.image])
        with np.errstate(all="ignore"):
            e = self.f[:, None] * (self.xy - q[:, :2] / q[:, 2:])
        seen = (q[:, 2] > 0.0) & np.isfinite(e).all(axis=1)
        return np.where(seen[:, None], np.clip(e, -FAR_OFF, FAR_OFF), FAR_OFF)

    def fitted(self) -> tuple[float, Array]:
        """Return the median distance of rays, pixels, and the change that makes it least."""
        n = 3 if self.velocity is None else 4
        change = np.zeros(n)
        e = self.residuals()
        best = _median(e)
        damping = 0.0
        for _ in range(STEPS):
            J = np.stack(
                [(self.residuals(change + 1e-5 * axis) - e) / 1e-5 for axis in np.eye(n)], axis=2
            )
            off = np.linalg.norm(e, axis=1)
            weight = np.minimum(1.0, max(best, 1e-6) / np.maximum(off, 1e-12))
            weight *= (np.abs(J).max(axis=(1, 2)) < FAR_OFF) & (off < FAR_OFF)
            N = np.einsum("n,nki,nkj->ij", weight, J, J)
            g = np.einsum("n,nki,nk->i", weight, J, e)
            if not np.linalg.cond(N) < 1e12:
                break
            step = -np.linalg.solve(N * (1.0 + damping * np.eye(n)), g)
            step *= min(1.0, LONGEST_STEP / max(float(np.linalg.norm(step)), 1e-12))
            ahead = self.residuals(change + step)
            if not (after := _median(ahead)) < best:
                if damping > 10.0:
                    break
                damping = max(10.0 * damping, 0.1)
                continue
            done = after > 0.99 * best
            change, e, best, damping = change + step, ahead, after, 0.1 * damping
            if done:
                break
        return best, change


def _median(e: Array) -> float:
    return float(np.median(np.linalg.norm(e, axis=1)))


def refuse_implausible(inputs: Inputs) -> None:
    """Refuse a block whose files do not belong to each other, and name what is wrong.

    Parameters
    ----------
    inputs : Inputs
        The block.

    Raises
    ------
    DataError
        Image observations do not fit the aerial control, those of some images do not, or the ground
        points lie elsewhere.
    """
    if inputs.eo is None:
        return
    whole = _as_given(inputs)
    few = _some(whole)
    if few.image.size < FEWEST_RAYS or np.unique(few.image).size < FEWEST_IMAGES:
        return
    size = max(max(camera.width, camera.height) for camera in inputs.block.cameras)
    apart, turn = few.fitted()
    sigma = float(np.median(_sigma_px(inputs, whole)))
    if apart > max(DOUBTFUL * size, FEW_SIGMAS * sigma):
        _refuse_readings(inputs, whole, apart, max(APART * size, SIGMAS * sigma))
    whole = replace(whole, C=whole.C @ rotation_from_vector(turn))
    _refuse_images(inputs, whole, apart, size)
    _refuse_ground(inputs, whole, apart)


def _as_given(inputs: Inputs) -> Reading:
    """Return the rays of images with aerial control to points that two of them see."""
    block, seen = inputs.block, inputs.block.observations
    keep = (inputs.eo_row >= 0)[seen.image]
    xy = directions(block)
    keep &= np.isfinite(xy).all(axis=1)
    count = np.bincount(seen.point[keep], minlength=len(block.points))
    keep &= count[seen.point] >= 2
    f = np.array([camera.of("f") for camera in block.cameras])[block.camera[seen.image]]
    given = Reading("", "", block.position_m, block.C_mc, xy, seen.image, seen.point, f)
    return given.rows(keep)


def _some(reading: Reading) -> Reading:
    """Return the rays of points in even steps, those of points with three rays or more first."""
    count = np.bincount(reading.point)
    points = np.flatnonzero(count >= 3)
    if count[points].sum() < FEWEST_RAYS:
        points = np.flatnonzero(count >= 2)
    if points.size and (total := int(count[points].sum())) > MOST_RAYS:
        steps = np.linspace(0, points.size - 1, max(1, points.size * MOST_RAYS // total))
        points = points[steps.astype(int)]
    return reading.rows(np.isin(reading.point, points))


def _sigma_px(inputs: Inputs, whole: Reading) -> Array:
    """Return what the standard deviations of the poses make of a ray of each image, pixels."""
    eo = inputs.eo
    assert eo is not None
    sigma = np.zeros(len(inputs.block.images))
    own = inputs.eo_row >= 0
    cov = eo.cov[inputs.eo_row[own]]
    f = float(np.median(whole.f)) if whole.f.size else 0.0
    sigma[own] = f * np.sqrt(np.trace(cov[:, 3:, 3:], axis1=1, axis2=2))
    return sigma


def _refuse_readings(inputs: Inputs, whole: Reading, apart: float, limit: float) -> None:
    """Refuse a block whose rays do not meet; name the reading with which they do."""
    best: tuple[float, Reading, Array] | None = None
    for reading in readings(inputs, whole):
        few = _some(reading)
        if few.image.size < FEWEST_RAYS:
            continue
        fits, change = few.fitted()
        if best is None or fits < best[0]:
            best = fits, reading, change
    start = f"image observations do not fit the aerial control: rays of a point pass {apart:.0f} px"
    if apart >= FAR_OFF:
        start = (
            "image observations do not fit the aerial control: rays of a point do not meet before"
            " the cameras,"
        )
    if best is not None and best[0] < min(apart / BETTER, limit):
        text = best[1].text.format(best[2][-1])
        raise DataError(
            f"{start} from each other, and {best[0]:.1f} px as if {text}; {best[1].remedy}"
            if apart < FAR_OFF
            else f"{start} and meet to {best[0]:.1f} px as if {text}; {best[1].remedy}"
        )
    if apart > limit:
        middle = "from each other, and" if apart < FAR_OFF else "and"
        raise DataError(
            f"{start} {middle} none of mirrored or exchanged pixel axes, turned images or camera"
            " axes, images in another order, a delay, a principal point from the middle fits;"
            f" {inputs.file.aerial_control.file} is of another flight, its angles were in other"
            " units (degrees for radians), or names of images or points are others"
        )


def readings(inputs: Inputs, whole: Reading) -> Iterator[Reading]:
    """Return how somebody may have written a block.

    Parameters
    ----------
    inputs : Inputs
        The block.
    whole : Reading
        As it is given.

    Yields
    ------
    Reading
        The block read in another way.
    """
    yield from _other_stamps(inputs, whole)
    yield from _other_numbers(inputs, whole)
    yield from _other_axes(whole)
    yield from _other_attitudes(whole)
    yield from _other_cameras(inputs, whole)


def _other_axes(whole: Reading) -> Iterator[Reading]:
    """Pixel axes and camera axes: the 48 signed permutations of the axes of a ray."""
    pixels = {
        ((0, 1), (1, -1)): ("y counted upwards from the lower edge", "mirror y: height - y"),
        ((0, 1), (-1, 1)): ("x counted from the right edge", "mirror x: width - x"),
        ((1, 0), (1, 1)): ("columns x and y were exchanged", "exchange them"),
        ((1, 0), (-1, -1)): ("x and y were exchanged and count backwards", "write x right, y down"),
    }
    for (order, sign), (text, remedy) in pixels.items():
        xy = whole.xy[:, order] * sign
        yield replace(whole, text=text, remedy=f"{remedy} (x right, y down from the upper left"
                      " corner)", xy=xy)
    for order in permutations(range(3)):
        for sign in product((1.0, -1.0), repeat=3):
            R = np.eye(3)[:, order] * sign
            if np.linalg.det(R) < 0.0 or np.allclose(R, np.eye(3)):
                continue
            words = _turn_words(R)
            yield replace(
                whole,
                text=f"the camera were turned by {words}",
                remedy="correct camera_from_body or bore-sight of the flight file and process"
                " again, or turn the images as the camera took them",
                C=whole.C @ R,
            )


def _turn_words(R: Array) -> str:
    turn = vector_from_rotation(R)
    angle = float(np.degrees(np.linalg.norm(turn)))
    axis = turn / np.linalg.norm(turn)
    k = int(np.argmax(np.abs(axis)))
    if abs(axis[k]) > 0.99:
        return f"{angle * np.sign(axis[k]):+.0f} deg about its {'xyz'[k]} axis"
    words = " ".join(f"{x:+.2f}" for x in axis)
    return f"{angle:.0f} deg about the axis {words} of its own"


def _other_attitudes(whole: Reading) -> Iterator[Reading]:
    """Attitudes that were composed in another way."""
    remedy = "write the attitudes of eo.json as its conventions say (data_specs/eo_json.md)"
    yield replace(
        whole,
        text="the matrices of the attitudes were transposed",
        remedy=remedy,
        C=np.ascontiguousarray(whole.C.swapaxes(1, 2)),
    )
    good = np.isfinite(whole.C).all(axis=(1, 2))
    R = whole.C[good] @ CV_RUB
    opk = opk_from_rotation(R)
    for text, angles in (
        ("omega, phi, kappa were composed in the reverse order", rpy_from_rotation(R)),
        ("omega and phi had the other sign", opk * [-1.0, -1.0, 1.0]),
        ("kappa had the other sign", opk * [1.0, 1.0, -1.0]),
    ):
        C = whole.C.copy()
        C[good] = rotation_from_opk(angles) @ CV_RUB.T
        yield replace(whole, text=text, remedy=remedy, C=C)


def _other_stamps(inputs: Inputs, whole: Reading) -> Iterator[Reading]:
    """Exposures that lag behind their stamps."""
    eo = inputs.eo
    if eo is None or eo.velocity_mps is None or eo.rate_radps is None:
        return
    own = inputs.eo_row >= 0
    velocity, rate = np.zeros((2, own.size, 3))
    velocity[own] = eo.velocity_mps[inputs.eo_row[own]]
    rate[own] = eo.rate_radps[inputs.eo_row[own]]
    yield replace(
        whole,
        text="the exposures had a delay of {:+.2f} s behind their stamps",
        remedy="correct the stamps or camera.time_offset_s of the flight file and process again",
        velocity=velocity,
        rate=rate,
    )


def _other_numbers(inputs: Inputs, whole: Reading) -> Iterator[Reading]:
    """Images that have the observations of a neighbour, or are numbered backwards."""
    eo = inputs.eo
    assert eo is not None
    order = np.argsort(inputs.eo_row, kind="stable")
    order = order[inputs.eo_row[order] >= 0]
    names = inputs.block.images
    remedy = "correct the names of the images or the stamps of the exposures"
    n = order.size
    for k in (1, -1, 2, -2, 3, -3):
        if abs(k) >= n:
            continue
        source = np.clip(np.arange(n) + k, 0, n - 1)
        inside = (np.arange(n) + k >= 0) & (np.arange(n) + k < n)
        position, C = whole.position.copy(), whole.C.copy()
        position[order], C[order] = whole.position[order[source]], whole.C[order[source]]
        keep = np.isin(whole.image, order[inside])
        first, second = order[n // 2], order[source[n // 2]]
        text = (
            f"each image had the pose of another: {names[first]} that of {names[second]}"
            f" ({k:+d} in the order of time)"
        )
        yield replace(whole, text=text, remedy=remedy, position=position, C=C).rows(keep)
    position, C = whole.position.copy(), whole.C.copy()
    position[order], C[order] = whole.position[order[::-1]], whole.C[order[::-1]]
    text = f"images were numbered in the reverse order, {names[order[0]]} the last"
    yield replace(whole, text=text, remedy=remedy, position=position, C=C)


def _other_cameras(inputs: Inputs, whole: Reading) -> Iterator[Reading]:
    """A principal point that counts from the middle of the image, a camera of another format."""
    block = inputs.block

    def read(text: str, remedy: str, cameras: list[BrownCamera]) -> Reading:
        other = replace(inputs, block=replace(block, cameras=tuple(cameras)))
        return replace(_as_given(other), text=text, remedy=remedy)

    middle = [_with(c, cx=c.of("cx") + c.width / 2, cy=c.of("cy") + c.height / 2)
              for c in block.cameras]
    yield read(
        "cx and cy, the principal point, counted from the middle of the image",
        f"write them from its upper left corner, {middle[0].of('cx'):.1f} and"
        f" {middle[0].of('cy'):.1f} px",
        middle,
    )
    for times in (0.5, 2.0):
        cameras = [_with(c, **{k: times * c.of(k) for k in ("f", "cx", "cy")})
                   for c in block.cameras]
        yield read(
            f"the camera were of images of {times:g} times the size",
            "give the camera of these images: f, cx, cy, width and height in their pixels",
            cameras,
        )


def _with(camera: BrownCamera, **values: float) -> BrownCamera:
    interior = np.array(camera.interior)
    for name, value in values.items():
        interior[INTERIOR.index(name)] = value
    return replace(camera, interior=interior)


def _refuse_images(inputs: Inputs, whole: Reading, apart: float, size: float) -> None:
    """Refuse a block some images of which do not fit, and name them."""
    names = inputs.block.images
    limit = np.maximum(
        max(APART * size, 10.0 * apart), SIGMAS * _sigma_px(inputs, whole)
    )
    n, out = len(names), list[tuple[int, float]]()
    rest = whole
    while len(out) <= MOST_IMAGES:
        count = np.bincount(rest.point)
        rest = rest.rows(count[rest.point] >= 2)
        off = np.linalg.norm(rest.residuals(), axis=1)
        medians = np.array(
            [
                np.median(off[rest.image == i]) if (rest.image == i).sum() >= FEWEST_OF_IMAGE
                else 0.0
                for i in range(n)
            ]
        )
        worst = int(np.argmax(medians / limit))
        if medians[worst] <= limit[worst]:
            break
        out.append((worst, float(medians[worst])))
        rest = rest.rows(rest.image != worst)
    if not out or len(out) > MOST_IMAGES or len(out) > 0.2 * n:
        return
    some = sorted(i for i, _ in out)
    words = " and ".join(names[i] for i in some)
    text = (
        f"image observations of {words} do not fit their poses: their rays pass"
        f" {out[0][1]:.0f} px from those of other images ({apart:.1f} px in the others)"
    )
    if len(some) == 2:
        exchanged = np.arange(n)
        exchanged[some] = some[::-1]
        other = replace(whole, position=whole.position[exchanged], C=whole.C[exchanged])
        off = np.linalg.norm(other.residuals(), axis=1)
        mine = np.isin(other.image, some)
        if np.median(off[mine]) < limit[some].min() / BETTER:
            raise DataError(
                f"{text}, and {np.median(off[mine]):.1f} px when they are exchanged; exchange"
                " their names"
            )
    skip = ", ".join(f'"{names[i]}"' for i in some)
    raise DataError(
        f"{text}; correct their names or poses, or leave them out: images.skip = [{skip}]"
    )


def _refuse_ground(inputs: Inputs, whole: Reading, apart: float) -> None:
    """Refuse ground points that lie elsewhere than images see them, all of them."""
    block = inputs.block
    rows = np.concatenate([block.control.point, block.check.point])
    given = np.concatenate([block.control.position_m, block.check.position_m])
    if rows.size < FEWEST_IMAGES:
        return
    mine = whole.rows(np.isin(whole.point, rows))
    X = intersected(
        mine.position, mine.C, mine.xy, mine.image, mine.point, len(block.points)
    )[rows]
    good = np.isfinite(X).all(axis=1)
    if good.sum() < FEWEST_IMAGES:
        return
    X, given = X[good], given[good]
    names = [block.points[p] for p in rows[good]]
    height = float(np.median(mine.position[mine.image, 2]) - np.median(X[:, 2]))
    # what misclosures of the rays leave to a point, thrice
    limit = max(OFF_M, 3.0 * apart / float(np.median(mine.f)) * abs(height), 0.02 * abs(height))
    off = given - X
    middle = np.median(off, axis=0)
    size = float(np.median(np.linalg.norm(off, axis=1)))
    if size <= limit:
        return
    spread = float(np.median(np.linalg.norm(off - middle, axis=1)))
    start = (
        f"ground points do not fit aerial control and images: {names[0]} lies"
        f" {', '.join(f'{x:+.1f}' for x in off[0])} m (east, north, up) from where images see it"
    )
    best: tuple[float, str] | None = None
    for text, other in (
        ("easting and northing were exchanged: exchange them", given[:, [1, 0, 2]]),
        ("all coordinates were in feet: give metres", given * FOOT_M),
        ("heights were in feet: give metres", given * [1.0, 1.0, FOOT_M]),
        ("heights counted downwards: change their sign", given * [1.0, 1.0, -1.0]),
        ("eastings had the other sign", given * [-1.0, 1.0, 1.0]),
        ("northings had the other sign", given * [1.0, -1.0, 1.0]),
    ):
        fits = float(np.median(np.linalg.norm(other - X, axis=1)))
        if best is None or fits < best[0]:
            best = fits, text
    if best is not None and best[0] < max(limit, size / (2 * BETTER)):
        raise DataError(f"{start}, and {best[0]:.1f} m as if {best[1]}")
    if spread < max(limit, ALIKE * size):
        constant = _camera_constant(inputs, whole, apart, height / (height - middle[2]))
        if constant is not None:
            if all("f" in camera.free for camera in block.cameras):
                return
            raise DataError(
                f"the camera constant does not fit: with {constant:.0f} px instead of"
                f" {block.cameras[0].of('f'):.0f} rays and ground points meet; correct f, or"
                ' estimate it (camera.free = ["f", ...])'
            )
        why = (
            "heights above the ellipsoid and above sea level (geoid) are mixed, or the base had"
            " another height"
            if abs(middle[2]) > 3.0 * np.linalg.norm(middle[:2])
            else "the base had coordinates of another datum, or ground.crs is another"
        )
        raise DataError(
            f"{start}, and all of them alike, by {', '.join(f'{x:+.1f}' for x in middle)} m; {why}"
        )
    raise DataError(
        f"{start}, {size:.0f} m in the middle, and none of exchanged or mirrored axes, feet, a shift"
        " fits; check ground.crs and the names of the points"
    )


def _camera_constant(
    inputs: Inputs, whole: Reading, apart: float, times_too_large: float
) -> float | None:
    """Return the camera constant that explains heights that are wrong by a factor, None if none."""
    if not 0.05 < times_too_large < 20.0:
        return None
    block = inputs.block
    cameras = tuple(_with(c, f=c.of("f") / times_too_large) for c in block.cameras)
    other = _as_given(replace(inputs, block=replace(block, cameras=cameras)))
    fits, _ = _some(other).fitted()
    return cameras[0].of("f") if fits < 0.5 * apart else None
