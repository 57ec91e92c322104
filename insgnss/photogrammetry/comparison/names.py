r"""Whether image names stand beside the poses of other images.

It happens where a list of names and one of poses were joined one line off.

With the images in the order of their times, of the file or of their names, and p their places,

    name i has the pose of image i + k, k = -5 ... 5            d_i = p_b(i) - p_a(i + k)      (N.1)
    name i has the pose of image n - 1 - i                      the order reversed             (N.2)

The spread of d about its mean judges them, so that a shift or a geoid beside it does not hide it.
It is stated where it takes off enough and leaves less than half of what any hypothesis on the
positions of the names as they are leaves.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .hypotheses import DIGITS, ENOUGH, LEAST_POSES, rms
from .matching import Matched
from .poses import Poses
from .position import difference, horizontal
from .result import Finding

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

FARTHEST = 5  # images by which names may be off
LEAST_M = 0.1  # spread below which positions do not distinguish images
BETTER = 0.5  # what must be left of what another hypothesis leaves


def by_order(matched: Matched) -> tuple[Finding, Matched] | None:
    """The order of names in which the poses agree, and the match by it.

    The result is None where that of the files is as good.
    """
    a, b = matched.a, matched.b
    if matched.how != "image" or a.n < LEAST_POSES:
        return None
    before = _spread(a, b)
    if before < LEAST_M:
        return None
    judged = [
        (_spread(a.taken(of_a), b.taken(of_b)), words, k, of_a, of_b)
        for words, k, of_a, of_b in _orders(a)
    ]
    after, words, k, of_a, of_b = min(judged, key=lambda trial: trial[0])
    if after**2 > (1.0 - ENOUGH) * before**2 or _otherwise(a, b, before) * BETTER < after:
        return None
    time = None if matched.of_time is None else matched.of_time[of_a]
    unpaired = a.n - of_a.size
    named = replace(b.taken(of_b), images=a.taken(of_a).images)
    again = Matched(
        a.taken(of_a), named, "image", matched.left_a + unpaired, matched.left_b + unpaired, time
    )
    values = {} if k is None else {"images": float(k)}
    return (
        Finding("names", words, "position", before, after, 1.0 - (after / before) ** 2, values),
        again,
    )


def _spread(a: Poses, b: Poses) -> float:
    """rms, m, of the differences in position about their mean."""
    d = difference(a, b)
    return rms(d - d.mean(axis=0))


def _otherwise(a: Poses, b: Poses, before: float) -> float:
    """rms, m, that the hypotheses on the horizontal leave with the names as they are."""
    explained = horizontal(a, b, True)
    return before if explained is None else _spread(a, explained[1]) + DIGITS["m"]


def _orders(a: Poses) -> Iterator[tuple[str, int | None, Rows, Rows]]:
    """(N.1) and (N.2): statement, k, rows of a and of b that belong together."""
    orders = {", in the order of the file": np.arange(a.n)}
    if a.time is not None:
        orders = {", in the order of time": np.argsort(a.time, kind="stable"), **orders}
    orders[", in the order of names"] = np.array(sorted(range(a.n), key=lambda row: a.images[row]))
    for which, order in orders.items():
        for k in range(-FARTHEST, FARTHEST + 1):
            if k == 0 or a.n - abs(k) < LEAST_POSES:
                continue
            by = "one" if abs(k) == 1 else f"{abs(k)}"
            words = (
                f"image names of b are off by {by}: each name has the pose of the image {by}"
                f" {'after' if k > 0 else 'before'} it{which}"
            )
            yield words, k, order[max(0, k) : a.n + min(0, k)], order[max(0, -k) : a.n - max(0, k)]
        words = (
            "image names of b are in reversed order: the first name has the pose of the last"
            f" image{which}"
        )
        yield words, None, order[::-1], order
