"""Is the vehicle where the images see its target? What is seen of it before an adjustment.

The ray of the target, through the pose that the aerial control gives, meets the level of the target
at a place; the vehicle must be there, to what poses are good for. Where it is metres away, it is
tried whether it was there at another time (a clock, leap seconds), or always as far beside, along
the axes of the block (another base or datum) or its own (lever arm). On a straight road these are
alike: all of them are named where it is far away, and else the adjustment tells them apart, which
also finds what is too small to be seen so.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ....base.errors import DataError
from ....geodesy.conventions import time_scale
from ....geodesy.explain import Candidate, best_shift, explain
from ....records.block import Array, ImageBlock
from ...adjust.start import directions
from ...adjust.unknowns import Unknowns
from ..readings import median_length
from .places import TWO_CLOCKS, Vehicle
from .track import along_course

Rows = NDArray[np.int64]

LEAST_MISS_M = 1.5  # less between rays and vehicle is left to the adjustment (chosen)
MISS_SIGMAS = 5.0  # of the attitudes on the ground, and of the size, that chance may explain
FEWEST_SIGHTINGS = 4  # of the target, below which medians say nothing (chosen)
# searched times either way: before the adjustment (leap seconds and clocks), after it; first step
RANGE_S, SHORT_RANGE_S, SEARCH_STEP_S = 60.0, 3.0, 0.25
FINER_S = (0.1, 0.02, 0.005)  # steps in which a time is searched: a vehicle moves centimetres
MEETING_FLOOR_M = 0.3  # what rays of right poses leave of a place on the ground
OTHER_TARGET_SIZE = 0.2
"""Of a size: heights above ground are known better than that before any adjustment."""
FAR_VEHICLE_M = 20.0
"""Nearer than this an adjustment converges, and tells clock, lever arm and base apart."""


def refuse_elsewhere(
    vehicle: Vehicle, block: ImageBlock, position_m: Array, C_mc: Array, sigma_rad: Array
) -> None:
    """Refuse a vehicle that is not where images see it, and name what is wrong.

    Parameters
    ----------
    vehicle : Vehicle
        The vehicle at the exposures.
    block : ImageBlock
        The block that sees it.
    position_m, C_mc : ndarray
        (n, 3), (n, 3, 3) poses of the images of the block by the aerial control; NaN without.
    sigma_rad : ndarray, (n,)
        Standard deviations of their attitudes, what is left of the bore-sight among them.

    Raises
    ------
    DataError
        It is metres away, and where it was at another time, beside itself, or nowhere.
    """
    image, _, ray = vehicle.rows_in(block)
    oriented = np.isfinite(position_m[image]).all(axis=1)
    oriented &= np.isfinite(C_mc[image]).all(axis=(1, 2))
    rows = np.flatnonzero(oriented)
    if rows.size < FEWEST_SIGHTINGS:
        return
    image, vehicle = image[rows], vehicle.rows(rows)
    direction = _directions(block, image, ray[rows], C_mc)
    centre, stated = position_m[image], vehicle.exposures.position_m
    if (direction[:, 2] > -0.2).any():
        return  # cameras that do not look down: rays and levels do not meet well
    depth = (stated[:, 2] - centre[:, 2]) / direction[:, 2]
    if (depth <= 0.0).any():
        return
    _refuse_sizes(vehicle, block, image, np.einsum("ni,ni->n", stated - centre, C_mc[image, :, 2]))
    met = centre + depth[:, None] * direction
    miss_m = (met - stated)[:, :2]
    limit = max(LEAST_MISS_M, MISS_SIGMAS * float(np.median(sigma_rad[image] * depth)))
    size = median_length(miss_m)
    if size <= limit:
        return
    text = (
        f"the vehicle is not where images see its target: {size:.1f} m beside it in the middle of"
        f" {rows.size} images, {np.linalg.norm(miss_m[0]):.1f} m in {vehicle.images[0]}"
    )
    explanation = explain(
        miss_m, _readings(vehicle, met, miss_m), median_length, floor=MEETING_FLOOR_M
    )
    if explanation is None:
        raise DataError(
            f"{text}; neither another time nor a constant shift brings it there:"
            f" {vehicle.options.file} is of another drive, or images are joined with other ones"
        )
    if explanation.alike and size < FAR_VEHICLE_M:
        return  # the adjustment tells them apart
    raise DataError(f"{text}, and {explanation.left:.1f} m {explanation.clauses()}")


def _refuse_sizes(vehicle: Vehicle, block: ImageBlock, image: Rows, depth: Array) -> None:
    """Refuse apparent sizes of the target that its diameter cannot have (J.22)."""
    options = vehicle.options
    sized = np.isfinite(vehicle.size_px)
    if options.size_m is None or sized.sum() < FEWEST_SIGHTINGS:
        return
    f = np.array([camera.of("f") for camera in block.cameras])[block.camera[image]]
    times = float(np.median(vehicle.size_px[sized] * depth[sized] / (f[sized] * options.size_m)))
    limit = max(OTHER_TARGET_SIZE, MISS_SIGMAS * options.size_sigma_m / options.size_m)
    if abs(times - 1.0) > limit:
        raise DataError(
            f"{options.sizes}: the target appears {times:.3g} times as large as vehicle.size_m ="
            f" {options.size_m:g} m makes it; a diameter of {times * options.size_m:.2f} m fits"
            " (metres, of the whole target)"
        )


def _directions(block: ImageBlock, image: Rows, ray: Rows, C_mc: Array) -> Array:
    """Return the rays of the target in the axes of the block."""
    xy = directions(block)[ray]
    return np.einsum("nij,nj->ni", C_mc[image], np.column_stack([xy, np.ones(len(xy))]))


def _readings(vehicle: Vehicle, met: Array, miss_m: Array) -> Iterator[Candidate[Array]]:
    """Return what may be wrong with places that lie `miss_m` (n, 2) from where images see them."""
    constant = np.median(miss_m, axis=0)
    yield Candidate(
        f"as if all its positions lay {constant[0]:+.1f} / {constant[1]:+.1f} m (east, north)"
        " from where they are: its base or datum is another",
        lambda d: d - constant,
    )
    course = along_course(vehicle.exposures.velocity)[:, :2, :2]
    arm = np.median(np.einsum("nji,nj->ni", course, miss_m), axis=0)
    yield Candidate(
        f"as if the target lay {arm[0]:+.1f} m forward and {arm[1]:+.1f} m to the right of"
        " where vehicle.target_m has it: look at its axes (forward, right, down)",
        lambda d: d - course @ arm,
    )
    best = _best_time(vehicle, met, RANGE_S)
    time = vehicle.track.time
    if best is None or time is None:
        return
    moved, within = vehicle.track.at(vehicle.time + best[0], _longest_gap(vehicle, time))
    seconds, scale = best[0], time_scale(best[0])
    if "leap seconds" in scale:
        seconds = round(seconds)  # of two time scales, whole; rays tell it to some 0.1 s
    offset = vehicle.options.time_offset_s - seconds
    yield Candidate(
        f"where it was {abs(seconds):.2f} s {'later' if seconds > 0 else 'before'}: the stamps of"
        f" the vehicle are off ({scale or TWO_CLOCKS}); correct them, vehicle.time_offset_s ="
        f" {offset:+.2f}",
        lambda _: (met - moved.position_m)[within, :2],
        same=lambda d: d[within],
    )


def _longest_gap(vehicle: Vehicle, time: Array) -> float:
    """Return the longest gap of the track's times, s, over which its places are interpolated."""
    return max(vehicle.options.longest_gap_s, 3.0 * float(np.median(np.diff(time))))


def _best_time(vehicle: Vehicle, met: Array, range_s: float) -> tuple[float, float] | None:
    """Return by which time the vehicle is nearest to where it is seen, s, and how near, m."""
    track = vehicle.track
    if track.time is None or not np.isfinite(vehicle.time).all() or len(track.time) < 2:
        return None
    longest = _longest_gap(vehicle, track.time)

    def distance_m(seconds: float) -> float:
        moved, within = track.at(vehicle.time + seconds, longest)
        if within.sum() < max(FEWEST_SIGHTINGS, len(within) // 3):
            return np.inf
        return median_length((met - moved.position_m)[within, :2])

    return best_shift(distance_m, range_s, SEARCH_STEP_S, *FINER_S)


def moved_in_time(vehicle: Vehicle, block: ImageBlock, values: Unknowns) -> tuple[float, Vehicle]:
    """Return the vehicle at the time at which adjusted images see it, where (J.21) is linear.

    Parameters
    ----------
    vehicle : Vehicle
        The vehicle.
    block : ImageBlock
        The block that sees it.
    values : Unknowns
        Adjusted poses and cameras.

    Returns
    -------
    delay_s : float
        The delay of its clock so far; 0 where the time of its places is not known.
    vehicle : Vehicle
        Its places a delay earlier.
    """
    adjusted = replace(block, cameras=values.cameras(block.cameras))
    image, _, ray = vehicle.rows_in(block)
    direction = _directions(adjusted, image, ray, values.C_mc)
    centre = values.position[image]
    depth = (vehicle.exposures.position_m[:, 2] - centre[:, 2]) / direction[:, 2]
    met = centre + depth[:, None] * direction
    best = _best_time(vehicle, met, SHORT_RANGE_S)
    if best is None:
        return 0.0, vehicle
    moved, within = vehicle.track.at(vehicle.time + best[0], np.inf)
    if not within.all():
        return 0.0, vehicle
    return -best[0], replace(vehicle, exposures=moved)
