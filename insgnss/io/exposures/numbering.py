"""Whether the numbers in the images' names go with the times of the exposures.

A table of names and stamps that lost a name in one row and a stamp in another is whole to look at:
every name has a stamp, and between both rows each image has that of its neighbour. Its numbers show
it: from one image to the next the camera counts up by one and one usual interval passes. Where a
number lacks and no more time passes than between the neighbours, the camera did not take the one
that lacks, or the stamp belongs to another name. A line's end is no such place: there the time is
longer than the numbers say.
"""

import re
from dataclasses import replace

import numpy as np

from ...records import Array, CameraEvents, Question

FEWEST_NUMBERED_IMAGES = 8  # images: fewer do not show how the camera counts (chosen)
# intervals on either side that give the usual one: a flight line has more (chosen)
NEIGHBOUR_INTERVALS = 4
# usual intervals: in a shorter one no second image was taken (chosen, 2 with one lost)
TOO_SHORT = 1.5
# pairs of images that a note names: further ones are counted, to keep it short
MOST_NAMED_PAIRS = 3


def with_numbering_note(events: CameraEvents) -> CameraEvents:
    """Note the images before which a number lacks and no time.

    Parameters
    ----------
    events : CameraEvents

    Returns
    -------
    CameraEvents
        With a note; `events` itself where numbers and times go together, or where the names do not
        count up by one.
    """
    number = image_numbers(events.images)
    if number is None:
        return events
    skipped = numbers_without_time(number, events.time)
    if not skipped.size:
        return events
    places = [
        f"{events.images[k]} and {events.images[k + 1]}, {events.time[k + 1] - events.time[k]:.2f}"
        " s apart"
        for k in skipped[:MOST_NAMED_PAIRS]
    ]
    further = (
        f" and {skipped.size - MOST_NAMED_PAIRS} more" if skipped.size > MOST_NAMED_PAIRS else ""
    )
    note = Question("images", "numbers and times with the same gaps").note(
        f"a number is missing between {', '.join(places)}{further}, but by the time no exposure is",
        "check names and stamps there: if another row lost its stamp, all images between the two"
        " rows have the stamp of their neighbour",
    )
    return replace(events, notes=(*events.notes, note))


def image_numbers(images: tuple[str, ...]) -> "np.ndarray | None":
    """Return the numbers by which the names of images count up.

    Parameters
    ----------
    images : tuple of str
        n names, in the order of their times.

    Returns
    -------
    ndarray, shape (n,), or None
        int; None where the names differ in more than numbers, there are too few of them, or no
        number goes up from each to the next, by one as a rule.
    """
    pieces = [re.split(r"(\d+)", name) for name in images]
    texts = {tuple(split[::2]) for split in pieces}
    if len(images) < FEWEST_NUMBERED_IMAGES or len(texts) > 1:
        return None
    columns = np.array([split[1::2] for split in pieces]).T
    for column in columns[::-1]:  # the last is the counter's, dates stand in front
        if max(map(len, column)) > 9:
            continue
        number = column.astype(np.int64)
        step = np.diff(number)
        if (step >= 1).all() and np.median(step) == 1:
            return number
    return None


def numbers_without_time(number: np.ndarray, time: Array) -> np.ndarray:
    """Return after which images a number lacks although but one usual interval passes.

    Parameters
    ----------
    number : ndarray, shape (n,)
        int, increasing.
    time : ndarray, shape (n,)
        s, increasing.

    Returns
    -------
    ndarray, shape (k,)
        int.
    """
    step, interval = np.diff(number), np.diff(time)
    places = []
    for k in np.flatnonzero(step > 1).tolist():
        around = np.arange(
            max(k - NEIGHBOUR_INTERVALS, 0), min(k + NEIGHBOUR_INTERVALS + 1, step.size)
        )
        usual = interval[around[step[around] == 1]]
        if usual.size >= NEIGHBOUR_INTERVALS and interval[k] < TOO_SHORT * np.median(usual):
            places.append(k)
    return np.array(places, dtype=np.int64)
