"""What is seen of a block before it is adjusted: do its rays meet with the poses that are given?

Rays of a point meet to some pixels where image observations, camera and orientation belong to each
other, whatever is left of the bore-sight, which is fitted first. Where they do not meet at all, the
block is read as somebody may have written it: other pixel axes, other camera axes, images numbered
by one more, another camera. What then makes the rays meet (`insgnss/geodesy/explain.py`) is named.
Of a block whose rays meet, the images that alone do not are named, and the ground points that lie
elsewhere than the images see them. Where there is little to go by nothing is said.
"""

from dataclasses import replace
from functools import partial
from itertools import combinations

import numpy as np

from ...base.errors import DataError
from ...base.units import FOOT_M
from ...base.wording import some
from ...geodesy.conventions import Convention, exchanged_orders, lengths, reversed_signs
from ...geodesy.explain import EXPLAINS, Candidate, explain
from ...geodesy.rotation import rotation_from_vector
from ...io.formats.orientation.poses import LARGEST_GEOID_M
from ...records.block import Array
from ..adjust.start import intersect_rays
from .inputs import BlockInputs
from .readings import (
    FAR_OFF,
    FEWEST_RAYS_JUDGED,
    BlockReading,
    as_given,
    broken_orders,
    median_length,
    readings,
    some_rays,
    with_values,
)
from .vehicle.rays import refuse_elsewhere

FEWEST_IMAGES = 3  # with rays, or ground points with one: below, nothing is asked of their fit
FEWEST_OF_IMAGE = 8  # rays of an image, below which their median is not judged (chosen)
NOT_MEETING_SHARE = 0.02  # of the longer side: rays that are farther apart than this do not meet
DOUBTFUL_SHARE = 0.008  # the same, where another reading makes them meet
ATTITUDE_SIGMAS, FEW_ATTITUDE_SIGMAS = 5.0, 2.0  # of the attitudes, where they are that poor
MOST_NAMED_IMAGES = 6  # beyond, the cause lies in the block, not in single images (chosen)
# misclosure of rays over the stated sigma of pixels, from which that is doubted
WORSE_MISCLOSURE = 10.0
OTHER_HEIGHTS = {"feet": FOOT_M, "centimetres": 1e-2}  # m: units that heights are taken from
LARGEST_DATUM_M = 900.0  # m, in plan: shifts of old datums against GNSS are below (Tokyo: 0.5 km)
OFF_M = 5.0  # least distance of ground points that is asked about
PIXEL = 0.1  # what image observations of a right block leave


def refuse_implausible(inputs: BlockInputs, failed: bool = False) -> None:
    """Refuse a block whose files do not belong to each other, and name what is wrong.

    Parameters
    ----------
    inputs : BlockInputs
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
    if few.image.size < FEWEST_RAYS_JUDGED or np.unique(few.image).size < FEWEST_IMAGES:
        return
    size = max(max(camera.width, camera.height) for camera in inputs.block.cameras)
    misclosure_px, turn = few.fitted()
    sigma = float(np.median(_sigma_px(inputs, whole)))
    doubtful = max(DOUBTFUL_SHARE * size, FEW_ATTITUDE_SIGMAS * sigma)
    if failed or misclosure_px > doubtful:
        limit = np.inf if failed else max(NOT_MEETING_SHARE * size, ATTITUDE_SIGMAS * sigma)
        _refuse_readings(inputs, few, misclosure_px, (doubtful, limit))
    whole = replace(whole, C=whole.C @ rotation_from_vector(turn))
    _refuse_images(
        inputs, whole, misclosure_px, 0.0 if failed else NOT_MEETING_SHARE * size, failed
    )
    _refuse_ground(inputs, whole, misclosure_px)
    _refuse_vehicle(inputs, turn)


def worse_than_stated(inputs: BlockInputs) -> str:
    """Say of a block that cannot be adjusted that rays miss each other by far more than stated.

    Parameters
    ----------
    inputs : BlockInputs
        The block.

    Returns
    -------
    str
        The end of a sentence; empty where they do not, or there is little to go by.
    """
    few = None if inputs.eo is None else some_rays(as_given(inputs))
    if inputs.eo is None or few is None or few.image.size < FEWEST_RAYS_JUDGED:
        return ""
    points = intersect_rays(few.position, few.C, few.xy, few.image, few.point, few.point.max() + 1)
    depth = np.nanmedian(np.linalg.norm(points[few.point] - few.position[few.image], axis=1))
    variance = np.diagonal(inputs.eo.cov[inputs.eo_row[few.image]], axis1=1, axis2=2)
    angle = variance[:, 3:].sum(axis=1) + variance[:, :3].sum(axis=1) / depth**2
    sigma = float(np.median(few.f * np.sqrt(angle)))
    stated = float(np.median(inputs.block.observations.sigma_px[few.row]))
    misclosure_px, _ = few.fitted()
    if not misclosure_px >= max(WORSE_MISCLOSURE * stated, FEW_ATTITUDE_SIGMAS * sigma):
        return ""
    return (
        f"; rays of a point miss each other by {misclosure_px:.1f} px, where image"
        f" observations have stated sigmas of {stated:.2g} px and poses of {sigma:.2g} px:"
        " correct the observations, or state their true sigmas (images.sigma_px)"
    )


def _refuse_vehicle(inputs: BlockInputs, turn: Array) -> None:
    """Refuse a vehicle that is elsewhere than images see it, with the bore-sight that fits."""
    if inputs.vehicle is None or inputs.eo is None:
        return
    position = inputs.of_images(inputs.eo.position_m, np.nan)
    C = inputs.of_images(inputs.eo.C_mc, np.nan) @ rotation_from_vector(turn)
    refuse_elsewhere(inputs.vehicle, inputs.block, position, C, _sigma_rad(inputs))


def _sigma_rad(inputs: BlockInputs) -> Array:
    """Return the standard deviation of the attitude of each image, rad; zero without."""
    eo = inputs.eo
    assert eo is not None
    return inputs.of_images(np.sqrt(np.trace(eo.cov[:, 3:, 3:], axis1=1, axis2=2)))


def _sigma_px(inputs: BlockInputs, whole: BlockReading) -> Array:
    """Return what the standard deviations of the poses make of a ray of each image, pixels."""
    return (float(np.median(whole.f)) if whole.f.size else 0.0) * _sigma_rad(inputs)


def _refuse_readings(
    inputs: BlockInputs, few: BlockReading, misclosure_px: float, limits: tuple[float, float]
) -> None:
    """Refuse a block whose rays do not meet; name the reading with which they do.

    limits : distances, pixels, of rays that nobody doubts, and beyond which they do not meet.
    """

    def misfit(reading: BlockReading) -> float:
        if reading is few:  # fitted to the end, which others are not where they are hopeless
            return misclosure_px
        return (
            np.inf if reading.image.size < FEWEST_RAYS_JUDGED else reading.fitted(misclosure_px)[0]
        )

    def words(one: Candidate[BlockReading]) -> str:
        return f"{one.statement.format(one.read(few).fitted()[1][-1])}: {one.remedy}"

    start = f"rays of the same point miss each other by {misclosure_px:.0f} px"
    if misclosure_px >= FAR_OFF:
        start = "rays of a point do not meet before the cameras"
    start = f"image observations do not fit the aerial control: {start}"
    explanation = explain(few, readings(inputs, few), misfit, limits[0], PIXEL)
    if explanation is not None:
        raise DataError(
            f"{start}; they would fit to {explanation.left:.1f} px if {explanation.clauses(words)}"
        )
    _refuse_broken(inputs, as_given(inputs), limits[0])
    if misclosure_px > limits[1]:
        control = inputs.file.aerial_control
        angles = "first attitudes" if control.positions_alone else "its angles"
        raise DataError(
            f"{start}, and none of mirrored or exchanged pixel axes, turned images or camera"
            " axes, images in another order, a delay, a principal point from the middle fits;"
            f" {control.file} is of another flight, {angles} were in other units (degrees for"
            " radians), or names of images or points are others"
        )


def _refuse_broken(inputs: BlockInputs, whole: BlockReading, good_px: float) -> None:
    """Refuse a block the order of whose images breaks, and name where."""

    def misfit(reading: BlockReading) -> float:
        few = reading.image.size < FEWEST_RAYS_JUDGED
        return np.inf if few else median_length(reading.residuals())

    candidates = broken_orders(inputs, whole, good_px)
    explanation = explain(whole, candidates, misfit, good_px, PIXEL)
    if explanation is not None:
        raise DataError(
            "image observations of some images do not fit the aerial control: rays of their points"
            f" miss each other by {min(explanation.before, FAR_OFF):.0f} px, and by"
            f" {explanation.left:.1f} px if"
            f" {explanation.clauses(lambda one: f'{one.statement}: {one.remedy}')}"
        )


def _refuse_images(
    inputs: BlockInputs, whole: BlockReading, misclosure_px: float, least: float, failed: bool
) -> None:
    """Refuse a block some images of which do not fit, and name them."""
    names = inputs.block.images
    limit = np.maximum(max(least, 10.0 * misclosure_px), ATTITUDE_SIGMAS * _sigma_px(inputs, whole))
    n, out = len(names), list[tuple[int, float]]()
    remaining = whole
    while len(out) <= MOST_NAMED_IMAGES:
        remaining = remaining.crossing(np.ones(remaining.image.size, dtype=bool))
        residuals, medians = remaining.residuals(), np.zeros(n)
        for i in range(n):
            if (of_image := remaining.image == i).sum() >= FEWEST_OF_IMAGE:
                medians[i] = median_length(residuals[of_image])
        worst = int(np.argmax(medians / limit))
        if medians[worst] <= limit[worst]:
            break
        out.append((worst, float(medians[worst])))
        remaining = remaining.rows(remaining.image != worst)
    if len(out) > min(MOST_NAMED_IMAGES, 0.2 * n):
        _refuse_broken(inputs, whole, float(limit.max()))
        return
    control = inputs.file.aerial_control
    if not out or (control.positions_alone and not control.absolute_attitudes and not failed):
        return  # first attitudes are no observations: the adjustment tells which images do not fit
    some = sorted(i for i, _ in out)
    named = " and ".join(names[i] for i in some)
    text = (
        f"image observations of {named} do not fit their poses: their rays"
        + (
            f" miss those of other images by {out[0][1]:.0f} px"
            if out[0][1] < FAR_OFF
            else " do not meet those of other images"
        )
        + f" ({misclosure_px:.1f} px in the others)"
    )
    if len(some) == 2:
        rows = np.arange(n)
        rows[some] = some[::-1]

        def median(reading: BlockReading) -> float:
            return median_length(reading.residuals()[np.isin(reading.image, some)])

        moved = Candidate[BlockReading](
            "", lambda r: replace(r, position=r.position[rows], C=r.C[rows])
        )
        explanation = explain(whole, [moved], median, float(limit[some].min()))
        if explanation is not None:
            raise DataError(
                f"{text}, but only {explanation.left:.1f} px when the two are exchanged;"
                " exchange their names"
            )
    skip = ", ".join(f'"{names[i]}"' for i in some)
    raise DataError(
        f"{text}; correct their names or poses, or leave them out: images.skip = [{skip}]"
    )


def _refuse_ground(inputs: BlockInputs, whole: BlockReading, miss_px: float) -> None:
    """Refuse ground points that lie elsewhere than images see them, all of them."""
    block, control = inputs.block, inputs.block.control.complete
    rows = np.concatenate([control.point, block.check.point])
    stated = np.concatenate([control.position_m, block.check.position_m])
    if rows.size < FEWEST_IMAGES:
        return
    mine = whole.rows(np.isin(whole.point, rows))
    X = intersect_rays(mine.position, mine.C, mine.xy, mine.image, mine.point, len(block.points))[
        rows
    ]
    good = np.isfinite(X).all(axis=1)
    if good.sum() < FEWEST_IMAGES:
        return
    X, stated = X[good], stated[good]
    names = [block.points[p] for p in rows[good]]
    height = float(np.median(mine.position[mine.image, 2]) - np.median(X[:, 2]))
    # what misclosures of the rays leave to a point, thrice
    limit = max(OFF_M, 3.0 * miss_px / float(np.median(mine.f)) * abs(height), 0.02 * abs(height))
    offset = stated - X
    middle = np.median(offset, axis=0)
    size = median_length(offset)
    _refuse_exchanged(names, stated, X, limit)
    _refuse_some_alike(names, offset, limit)
    if size <= limit:
        return
    start = (
        f"ground points do not fit aerial control and images: {names[0]} lies"
        f" {', '.join(f'{x:+.1f}' for x in offset[0])} m (east, north, up) from where images see it"
    )

    def misfit(position: Array) -> float:
        return median_length(position - X)

    axes, above = ("easting", "northing", "height"), np.zeros(3)

    if inputs.eo is not None:
        above[2] = inputs.eo.origin[2]

    def of_heights(one: Convention) -> Convention:
        return Convention(one.words, lambda x: one.change(x + above) - above)

    heights = (
        Convention(f"heights in {unit}", partial(np.multiply, [1.0, 1.0, factor]))
        for unit, factor in OTHER_HEIGHTS.items()
    )
    turned = [
        *exchanged_orders(axes[:2]),
        *lengths("coordinates", ("feet",)),
        *map(of_heights, (*heights, *reversed_signs(axes, most=1))),
    ]
    shift = Candidate[Array]("a shift", lambda x: x - middle, parameters=3)
    candidates = [shift, *(Candidate(f"they had {one.words}", one.change) for one in turned)]
    explanation = explain(stated, candidates, misfit)
    if explanation is None:
        raise DataError(
            f"{start}, {size:.0f} m in the middle, and none of exchanged or mirrored axes, feet, a"
            " shift fits; check ground.crs and the names of the points"
        )
    if explanation.best is not shift:
        raise DataError(
            f"{start}; they would fit to {explanation.left:.1f} m if {explanation.clauses()}"
        )
    constant = _camera_constant(inputs, whole, miss_px, height / (height - middle[2]))
    if constant is None:
        raise DataError(
            f"{start}, and all of them alike, by {', '.join(f'{x:+.1f}' for x in middle)} m;"
            f" {_cause_of_shift(middle, mine.position + above, limit)}"
        )
    if not all("f" in camera.free for camera in block.cameras):
        raise DataError(
            "the camera constant does not fit: rays and ground points meet with"
            f" {constant:.0f} px instead of {block.cameras[0].of('f'):.0f}; correct f, or"
            ' estimate it (camera.free = ["f", ...])'
        )


def _cause_of_shift(shift_m: Array, cameras_m: Array, limit_m: float) -> str:
    """Return what shifts all ground points alike by east, north, up, m.

    Parameters
    ----------
    shift_m : ndarray, shape (3,)
    cameras_m : ndarray, shape (n, 3)
        Positions of the cameras, heights above the ellipsoid.
    limit_m : float
        Distance up to which points fit.
    """
    along, up = float(np.linalg.norm(shift_m[:2])), abs(float(shift_m[2]))
    of_height, camera_m = up > 3.0 * along, float(np.median(cameras_m[:, 2]))
    for unit, factor in (OTHER_HEIGHTS | {"metres with the other sign": -1.0}).items():
        if of_height and abs(shift_m[2] - (factor - 1.0) * camera_m) < max(limit_m, 0.01 * up):
            return f"the heights of the aerial control are in {unit}"
    if of_height and up < LARGEST_GEOID_M:
        return (
            "heights above the ellipsoid and above sea level (geoid) are mixed, or the base had"
            " another height"
        )
    if not of_height and along < LARGEST_DATUM_M:
        return "the base had coordinates of another datum, or ground.crs is another"
    quantity = "heights" if of_height else "coordinates"
    return f"a constant was subtracted from the {quantity} of the points, or of the base: add it"


def _refuse_some_alike(names: list[str], offset: Array, limit: float) -> None:
    """Refuse ground points some of which lie elsewhere, all of these alike, and the others fit."""
    far = np.linalg.norm(offset, axis=1) > limit
    if not far.any():
        return
    common = np.median(offset[far], axis=0)
    to_zero, to_common = (np.linalg.norm(offset - x, axis=1) for x in (0.0, common))
    bad = np.flatnonzero(to_common < to_zero)
    nearest = np.minimum(to_zero, to_common).max()
    if not 1 < bad.size < len(names) or nearest > min(limit, np.linalg.norm(common) / 3.0):
        return
    vertical = abs(common[2]) > 3.0 * np.linalg.norm(common[:2])
    raise DataError(
        f"{bad.size} of {len(names)} ground points ({some([names[k] for k in bad])}) lie"
        f" {', '.join(f'{x:+.1f}' for x in common)} m (east, north, up) from where images see them,"
        " all alike, and the others fit: "
        + (
            "heights above sea level (geoid) stand beside heights above the ellipsoid; bring all"
            " to one of them"
            if vertical
            else "they are of another datum or CRS; bring all to one of them"
        )
    )


def _refuse_exchanged(names: list[str], stated: Array, X: Array, limit: float) -> None:
    """Refuse two ground points that lie where images see each other."""
    distance_m = np.linalg.norm(stated[:, None] - X[None], axis=2)
    for i, j in combinations(np.flatnonzero(np.diagonal(distance_m) > limit).tolist(), 2):
        if max(distance_m[i, j], distance_m[j, i]) < limit:
            raise DataError(
                f"ground points {names[i]} and {names[j]} lie {distance_m[i, i]:.1f} and"
                f" {distance_m[j, j]:.1f} m from where images see them, and {distance_m[i, j]:.1f}"
                f" and {distance_m[j, i]:.1f} m when they are exchanged; exchange their names"
            )


def _camera_constant(
    inputs: BlockInputs, whole: BlockReading, misclosure_px: float, times_too_large: float
) -> float | None:
    """Return the camera constant that explains heights that are wrong by a factor, None if none."""
    if not 0.05 < times_too_large < 20.0:
        return None
    block = inputs.block
    cameras = tuple(with_values(c, f=c.of("f") / times_too_large) for c in block.cameras)
    rescaled = as_given(replace(inputs, block=replace(block, cameras=cameras)))
    fits, _ = some_rays(rescaled).fitted()
    return cameras[0].of("f") if fits < EXPLAINS * misclosure_px else None
