"""Thinning of long series: what is drawn stays what it was, and a page stays small.

Lines keep the extremes of each of many intervals, points as well; what must not be lost, as fixes
that were rejected or images that stand out, is named and kept.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .chart import Array, Layer

MOST_POINTS = 1500  # of a line: more than a page is wide
MOST_DOTS = 3000  # of points that are not singled out


def thin(y: Array, limit: int = MOST_POINTS) -> NDArray[np.int64]:
    """Return the rows of `y` (n,) that a line needs to look as all of it.

    They are the smallest and largest of each of limit / 2 intervals, and the first and last. An
    interval without finite value keeps one, so that the line stays broken there.
    """
    if y.size <= limit:
        return np.arange(y.size)
    width = -(-y.size // (limit // 2))
    padded = np.pad(y, (0, -y.size % width), mode="edge").reshape(-1, width)
    finite = np.isfinite(padded)
    first = np.arange(len(padded)) * width
    low = first + np.argmin(np.where(finite, padded, np.inf), axis=1)
    high = first + np.argmax(np.where(finite, padded, -np.inf), axis=1)
    return np.unique(np.clip(np.concatenate([[0, y.size - 1], low, high]), 0, y.size - 1))


def scatter(y: Array, limit: int = MOST_DOTS) -> NDArray[np.int64]:
    """Return the rows of `y` (n,) that a cloud of points needs to look as all of it.

    They are every so-manieth row, which keeps the density, and the extremes of intervals, which
    keeps what lies far out.
    """
    if y.size <= limit:
        return np.arange(y.size)
    regular = np.arange(0, y.size, -(-y.size // (7 * limit // 8)))
    return np.union1d(regular, thin(y, limit // 8))


def thin_layer(layer: Layer, limit: int = MOST_POINTS) -> Layer:
    """Return a layer of at most about `limit` points that looks as all of it.

    Parameters
    ----------
    layer : Layer
        Of points, a line or a band, in the order of x.
    limit : int
        How many points are enough; both edges of a band keep their extremes.

    Returns
    -------
    Layer
        The layer itself where it is short.
    """
    if layer.x.size <= limit:
        return layer
    keep = (scatter if layer.kind == "points" else thin)(layer.y, limit)
    if layer.y2 is not None:
        keep = np.union1d(keep, thin(layer.y2, limit))
    return replace(
        layer,
        x=layer.x[keep],
        y=layer.y[keep],
        y2=None if layer.y2 is None else layer.y2[keep],
        value=None if layer.value is None else layer.value[keep],
        texts=[layer.texts[k] for k in keep] if layer.texts else (),
    )
