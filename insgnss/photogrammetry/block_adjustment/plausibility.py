"""What is seen of a block before it is adjusted: do its rays meet with the poses that are given?

Rays of a point meet to some pixels where image observations, camera and orientation belong to each
other, whatever is left of the bore-sight, which is fitted first. Where they do not meet at all, the
block is read as somebody may have written it: other pixel axes, other camera axes, images numbered
by one more, another camera. One reading that makes the rays meet five times better names what is
wrong. Of a block whose rays meet, the images that alone do not are named, and the ground points
that lie elsewhere than the images see them. Where there is little to go by nothing is said.
"""

from dataclasses import replace
from itertools import combinations

import numpy as np

from ...base.errors import DataError
from ...geodesy.rotation import rotation_from_vector
from ...records.block import Array
from ..adjust.start import intersected
from .inputs import Inputs
from .readings import (
    FAR_OFF,
    FEWEST_RAYS,
    Reading,
    as_given,
    readings,
    some_rays,
    with_values,
)
from .vehicle.rays import refuse_elsewhere

FEWEST_IMAGES, FEWEST_OF_IMAGE = 3, 8
APART = 0.02  # of the longer side: rays that are farther apart than this do not meet
DOUBTFUL = 0.008  # the same, where another reading makes them meet
SIGMAS, FEW_SIGMAS = 5.0, 2.0  # of the attitudes, where they are that poor
BETTER = 5.0
MOST_IMAGES = 6
FOOT_M = 0.3048
ALIKE, OFF_M = 0.2, 5.0


def refuse_implausible(inputs: Inputs, failed: bool = False) -> None:
    """Refuse a block whose files do not belong to each other, and name what is wrong.

    Parameters
    ----------
    inputs : Inputs
        The block.
    failed : bool
        Whether its adjustment has failed, so that less is enough to name what is wrong.

    Raises
    ------
    DataError
        Image observations do not fit the aerial control, those of some images do not, or the ground
        points lie elsewhere.
    """
    if inputs.eo is None:
        return
    whole = as_given(inputs)
    few = some_rays(whole)
    if few.image.size < FEWEST_RAYS or np.unique(few.image).size < FEWEST_IMAGES:
        return
    size = max(max(camera.width, camera.height) for camera in inputs.block.cameras)
    apart, turn = few.fitted()
    sigma = float(np.median(_sigma_px(inputs, whole)))
    if failed:
        _refuse_readings(inputs, whole, apart, np.inf)
    elif apart > max(DOUBTFUL * size, FEW_SIGMAS * sigma):
        _refuse_readings(inputs, whole, apart, max(APART * size, SIGMAS * sigma))
    whole = replace(whole, C=whole.C @ rotation_from_vector(turn))
    _refuse_images(inputs, whole, apart, 0.0 if failed else APART * size)
    _refuse_ground(inputs, whole, apart)
    _refuse_vehicle(inputs, turn)


def _refuse_vehicle(inputs: Inputs, turn: Array) -> None:
    """Refuse a vehicle that is elsewhere than images see it, with the bore-sight that fits."""
    if inputs.vehicle is None or inputs.eo is None:
        return
    n = len(inputs.block.images)
    position, C, sigma = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan), np.zeros(n)
    own = inputs.eo_row >= 0
    rows = inputs.eo_row[own]
    position[own] = inputs.eo.position_m[rows]
    C[own] = inputs.eo.C_mc[rows] @ rotation_from_vector(turn)
    sigma[own] = np.sqrt(np.trace(inputs.eo.cov[rows][:, 3:, 3:], axis1=1, axis2=2))
    refuse_elsewhere(inputs.vehicle, inputs.block, position, C, sigma)


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
        few = some_rays(reading)
        if few.image.size < FEWEST_RAYS:
            continue
        fits, change = few.fitted(apart)
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


def _refuse_images(inputs: Inputs, whole: Reading, apart: float, least: float) -> None:
    """Refuse a block some images of which do not fit, and name them."""
    names = inputs.block.images
    limit = np.maximum(max(least, 10.0 * apart), SIGMAS * _sigma_px(inputs, whole))
    n, out = len(names), list[tuple[int, float]]()
    rest = whole
    while len(out) <= MOST_IMAGES:
        count = np.bincount(rest.point)
        rest = rest.rows(count[rest.point] >= 2)
        off = np.linalg.norm(rest.residuals(), axis=1)
        medians = np.array(
            [
                np.median(off[rest.image == i])
                if (rest.image == i).sum() >= FEWEST_OF_IMAGE
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
        f"image observations of {words} do not fit their poses: their rays"
        + (
            f" pass {out[0][1]:.0f} px from those of other images"
            if out[0][1] < FAR_OFF
            else " do not meet those of other images"
        )
        + f" ({apart:.1f} px in the others)"
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
    X = intersected(mine.position, mine.C, mine.xy, mine.image, mine.point, len(block.points))[rows]
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
        _refuse_exchanged(names, given, X, limit)
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
        f"{start}, {size:.0f} m in the middle, and none of exchanged or mirrored axes, feet, a"
        " shift fits; check ground.crs and the names of the points"
    )


def _refuse_exchanged(names: list[str], given: Array, X: Array, limit: float) -> None:
    """Refuse two ground points that lie where images see each other."""
    apart = np.linalg.norm(given[:, None] - X[None], axis=2)
    for i, j in combinations(np.flatnonzero(np.diagonal(apart) > limit).tolist(), 2):
        if max(apart[i, j], apart[j, i]) < limit:
            raise DataError(
                f"ground points {names[i]} and {names[j]} lie {apart[i, i]:.1f} and"
                f" {apart[j, j]:.1f} m from where images see them, and {apart[i, j]:.1f} and"
                f" {apart[j, i]:.1f} m when they are exchanged; exchange their names"
            )


def _camera_constant(
    inputs: Inputs, whole: Reading, apart: float, times_too_large: float
) -> float | None:
    """Return the camera constant that explains heights that are wrong by a factor, None if none."""
    if not 0.05 < times_too_large < 20.0:
        return None
    block = inputs.block
    cameras = tuple(with_values(c, f=c.of("f") / times_too_large) for c in block.cameras)
    other = as_given(replace(inputs, block=replace(block, cameras=cameras)))
    fits, _ = some_rays(other).fitted()
    return cameras[0].of("f") if fits < 0.5 * apart else None
