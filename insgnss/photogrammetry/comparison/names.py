r"""Whether image names stand beside the poses of other images.

It happens where a list of names and one of poses were joined one line off.

With the images in the order of their times, of the file or of their names, and p their places,

    name i has the pose of image i + k, k = -5 ... 5            d_i = p_b(i) - p_a(i + k)      (N.1)
    name i has the pose of image n - 1 - i                      the order reversed             (N.2)

The spread of d about its mean judges them, so that a shift or a geoid beside it does not hide it,
together with whatever else explains the horizontal with the names as they are.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...geodesy.conventions import orders
from ...geodesy.explain import Candidate, explain
from .hypotheses import LEAST_POSES, WRITTEN_DIGITS, finding, rms
from .matching import Matched
from .poses import Poses
from .position import difference, horizontal_and_time
from .result import Mismatch

Rows = NDArray[np.int64]

LEAST_SPREAD_M = 0.1  # spread below which positions do not distinguish images
ORDER_OF_NAMES = "names"


def by_order(matched: Matched) -> tuple[Mismatch, Matched] | None:
    """The order of names in which the poses agree, and the match by it.

    The result is None where that of the files is as good.
    """
    a, b = matched.a, matched.b
    if matched.how != "image" or a.n < LEAST_POSES or _spread(matched) < LEAST_SPREAD_M:
        return None
    candidates = [*_orders(a), *horizontal_and_time(a, b)]
    explanation = explain(matched, candidates, _spread, floor=WRITTEN_DIGITS["m"])
    if explanation is None or explanation.best.name != ORDER_OF_NAMES:
        return None
    return finding(explanation, "position", explanation.before, explanation.left), explanation.data


def _spread(matched: Matched) -> float:
    """rms, m, of the differences in position about their mean."""
    d = difference(matched.a, matched.b)
    return rms(d - d.mean(axis=0))


def _orders(a: Poses) -> Iterator[Candidate[Matched]]:
    """(N.1) and (N.2)."""
    sorted_by = {", in the order of the file": np.arange(a.n)}
    if a.time is not None:
        sorted_by = {", in the order of time": np.argsort(a.time, kind="stable"), **sorted_by}
    sorted_by[", in the order of names"] = np.array(sorted(range(a.n), key=lambda k: a.images[k]))
    for which, order in sorted_by.items():
        for k, of_b, of_a in orders(a.n):
            by = "one" if k is not None and abs(k) == 1 else f"{abs(k or 0)}"
            text = (
                "image names of b are in reversed order: the first name has the pose of the last"
                f" image{which}"
                if k is None
                else f"image names of b are off by {by}: each name has the pose of the image {by}"
                f" {'after' if k > 0 else 'before'} it{which}"
            )
            yield _joined(text, order[of_a], order[of_b], {} if k is None else {"images": k})


def _joined(text: str, of_a: Rows, of_b: Rows, values: dict[str, float]) -> Candidate[Matched]:
    """Rows of a with the poses that b has in other rows."""

    def read(m: Matched) -> Matched:
        poses_a, poses_b = m.taken(of_a), m.taken(of_b)
        return replace(poses_a, b=replace(poses_b.b, images=poses_a.a.images))

    return Candidate(text, read, ORDER_OF_NAMES, same=lambda m: m.taken(of_b), values=values)
