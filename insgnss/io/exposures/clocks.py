"""Events and images by their times, of clocks that differ by an unknown constant.

The constant is the one among the differences of single pairs that brings most events within `near`
of an image, each at most once; of these the one with the smallest remainders.

Where events and images are as many, times have one question to answer: whether they belong together
in their order. Cameras stamp the exposure, the end of writing, or whole seconds, so that times that
do not fit prove nothing by themselves. With r = image - event in order, N of n values of r fit
where they lie within some constant +- near:

    N = n                                                               the order holds
    else, of a match by times with M pairs,
    M > N, M >= n - max(1, n / 20), and its pairs are of unlike places  the order is wrong
    else                                                                the times do not decide

asked with near = 0.02 and then 0.15 of the median interval, or, of whole seconds, with 0.55 s. The
order is called wrong by `FEWEST_PAIRS` pairs at least, and where near is below 0.3 of the interval:
stamps that scatter, as writing takes its time, do not find partners for nineteen of twenty images
then.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...records import Array

# tolerance of a match, of the shortest interval: below one half, so that an image has one event
SHARE_OF_INTERVAL = 0.45
# first images tried as partner of an event, for the clock's offset: more are not lost (chosen)
LEADS = 40
FEWEST_PAIRS = 5  # pairs by which an order may be called wrong: fewer agree by chance (chosen)
# tolerances, of the median interval: of sharp stamps, then of scattered ones (chosen)
INTERVAL_SHARES = (0.02, 0.15)
# tolerance (s) for stamps in whole seconds: rounding takes 0.5 s, writing some more
WHOLE_SECOND_S = 0.55
# largest tolerance, of the interval, that calls an order wrong: wider ones pair by chance
MOST_SHARE = 0.3
MOST_LONELY = 0.05  # largest share of images without an event: nineteen of twenty have one (chosen)


@dataclass(frozen=True)
class ClockMatch:
    """Match of events and images by their times.

    Parameters
    ----------
    events, images : tuple of int
        Indices from 0 of those without a partner.
    offset_s : float
        Offset of the images' clock, s.
    rms_s : float
        Remainder of the pairs, rms, s.
    """

    events: tuple[int, ...]
    images: tuple[int, ...]
    offset_s: float
    rms_s: float


@dataclass(frozen=True)
class OrderMisfit:
    """Evidence against the order of as many events as images.

    Parameters
    ----------
    near_s : float
        Tolerance, s.
    images : tuple of int
        Indices of the images further than `near_s` from where their events put them.
    better : ClockMatch, optional
        The match that shows the order wrong, None where the times do not decide.
    """

    near_s: float
    images: tuple[int, ...]
    better: ClockMatch | None = None


def match_clocks(time: Array, taken_s: Array, tolerance_s: float | None = None) -> ClockMatch:
    """Match events and images by their times.

    Parameters
    ----------
    time : ndarray, shape (n,)
        s, of the events, not decreasing.
    taken_s : ndarray, shape (m,)
        s, of the images by their own clock, not decreasing.
    tolerance_s : float, optional
        Tolerance of a pair, s; 0.45 of the shortest interval between events where it is not given.

    Returns
    -------
    ClockMatch
        Offset of the image clock and what has no partner; all of both where one of them is empty.
    """
    if tolerance_s is None:
        tolerance_s = SHARE_OF_INTERVAL * (float(np.min(np.diff(time))) if time.size > 1 else 1.0)
    lead = min(LEADS, taken_s.size)
    widest_shift = abs(time.size - taken_s.size) + LEADS
    best_match: tuple[int, float, float] | None = None
    for image in range(lead):
        for event in range(max(0, image - widest_shift), min(time.size, image + widest_shift + 1)):
            offset = float(taken_s[image] - time[event])
            _, _, residual = _mutual_pairs(time + offset, taken_s, tolerance_s)
            if residual.size and (
                best_match is None
                or (residual.size, -float(np.std(residual))) > (best_match[0], -best_match[1])
            ):
                best_match = (
                    residual.size,
                    float(np.std(residual)),
                    offset + float(np.mean(residual)),
                )
    offset = best_match[2] if best_match else 0.0
    events, images, residual = _mutual_pairs(time + offset, taken_s, tolerance_s)
    unmatched_events = tuple(np.setdiff1d(np.arange(time.size), events).tolist())
    unmatched_images = tuple(np.setdiff1d(np.arange(taken_s.size), images).tolist())
    return ClockMatch(
        unmatched_events,
        unmatched_images,
        offset,
        float(np.sqrt(np.mean(residual**2))) if residual.size else math.inf,
    )


def misfit(time: Array, taken_s: Array) -> OrderMisfit | None:
    """Return what the times (n,) and (n,), s, show against the order; None where they fit.

    There must be three events and images at least.
    """
    interval, count = float(np.median(np.diff(time))), time.size
    whole_seconds = bool((taken_s == np.rint(taken_s)).all())
    order_misfit = None
    for tolerance_s in (
        (WHOLE_SECOND_S,)
        if whole_seconds
        else (fraction * interval for fraction in INTERVAL_SHARES)
    ):
        beyond = _rows_beyond(taken_s - time, tolerance_s)
        if not beyond:
            return None
        match = match_clocks(time, taken_s, tolerance_s)
        pairs = count - len(match.images)
        fits = pairs >= max(
            FEWEST_PAIRS, count - max(1.0, MOST_LONELY * count)
        ) and pairs > count - len(beyond)
        if fits and match.events != match.images and tolerance_s <= MOST_SHARE * interval:
            return OrderMisfit(tolerance_s, beyond, match)
        order_misfit = OrderMisfit(tolerance_s, beyond)
    return order_misfit


def _rows_beyond(residual: Array, tolerance_s: float) -> tuple[int, ...]:
    """Return rows of residuals, s, outside the interval of 2 tolerances that holds most of them."""
    ordered = np.sort(residual)
    interval_begin = ordered[
        np.argmax(
            np.searchsorted(ordered, ordered + 2.0 * tolerance_s, side="right")
            - np.arange(ordered.size)
        )
    ]
    return tuple(
        np.flatnonzero(
            (residual < interval_begin) | (residual > interval_begin + 2.0 * tolerance_s)
        ).tolist()
    )


def _mutual_pairs(
    time: Array, taken_s: Array, tolerance_s: float
) -> tuple[NDArray[np.intp], NDArray[np.intp], Array]:
    """Return mutually nearest events and images within a tolerance, s.

    Rows of the events and of the images, and their residuals: image minus event, s.
    """
    if not (time.size and taken_s.size):
        return np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp), np.zeros(0)
    nearest_image = _nearest(time, taken_s)
    nearest_event = _nearest(taken_s, time)
    residual = taken_s[nearest_image] - time
    events = np.flatnonzero(
        (nearest_event[nearest_image] == np.arange(time.size)) & (np.abs(residual) <= tolerance_s)
    )
    return events, nearest_image[events], residual[events]


def _nearest(time: Array, candidates: Array) -> NDArray[np.intp]:
    """Return the row of the increasing `candidates` (k,), s, that is nearest to each time, s."""
    index_after = np.clip(np.searchsorted(candidates, time), 1, max(candidates.size - 1, 1))
    if candidates.size == 1:
        return np.zeros(time.size, dtype=np.intp)
    return np.where(
        time - candidates[index_after - 1] <= candidates[index_after] - time,
        index_after - 1,
        index_after,
    )
