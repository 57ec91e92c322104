"""The order of the images in the normal matrix, in which those that have something in common are
near each other.

Two images have something in common where they see the same object point, or where one group
observes both. Images are ordered by breadth: from one that lies at an end, its neighbours, then
theirs (Cuthill and McKee 1969). Of this order and that of the block the one is taken whose
factorisation costs less.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...records.block import ImageBlock
from .envelope import Envelope, dense, envelope_of

Rows = NDArray[np.int64]

DENSE_IMAGES = 100
"""Images up to which a matrix is dense: nothing is gained."""


def arrange_poses(
    block: ImageBlock, together: Sequence[Sequence[int]], size: int
) -> tuple[Rows, Envelope]:
    """Decide where poses stand, and what of the normal matrix is stored.

    Parameters
    ----------
    block : ImageBlock
        The block.
    together : sequence of sequence
        Images that one group observes, for each group.
    size : int
        Columns of the normal matrix.

    Returns
    -------
    place : ndarray of int
        (n,) place of each image.
    envelope : Envelope
        What is stored.
    """
    n = len(block.images)
    best, position = dense(size), np.arange(n)
    if n <= DENSE_IMAGES:
        return position, best
    least = np.inf
    first, second = _pairs(block, together)
    for order in (np.arange(n), *_by_breadth(first, second, n)):
        trial = np.empty(n, dtype=np.int64)
        trial[order] = np.arange(n)
        low, high = np.minimum(trial[first], trial[second]), trial[second]
        high = np.maximum(trial[first], high)
        reach = np.arange(n)
        np.maximum.at(reach, low, high)
        envelope, operations = envelope_of(size, reach)
        if operations < least:
            best, least, position = envelope, operations, trial
    return (position if best.window else np.arange(n)), best


def _pairs(block: ImageBlock, together: Sequence[Sequence[int]]) -> tuple[Rows, Rows]:
    """Return the pairs of images that have something in common, each with itself among them."""
    from scipy.sparse import csr_array

    obs, m = block.observations, len(block.points)
    several = [sorted(set(images)) for images in together if len(set(images)) > 1]
    image = np.concatenate([obs.image, *(np.array(s, dtype=np.int64) for s in several)])
    shared = np.concatenate([obs.point, *(np.full(len(s), m + k) for k, s in enumerate(several))])
    shape = (len(block.images), m + len(several))
    sees = csr_array((np.ones(image.size), (image, shared)), shape=shape)
    common = (sees @ sees.T).tocoo()
    return common.row.astype(np.int64), common.col.astype(np.int64)


def _by_breadth(first: Rows, second: Rows, n: int) -> list[Rows]:
    """Return orders by breadth: from an end of each part that hangs together, and scipy's."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import (
        breadth_first_order,
        connected_components,
        reverse_cuthill_mckee,
    )

    graph = csr_array((np.ones(first.size), (first, second)), shape=(n, n))
    components, component = connected_components(graph, directed=False)
    order = []
    for k in range(components):
        start = int(np.flatnonzero(component == k)[0])
        for _ in range(3):  # the last one that is found lies at an end, and so on
            reached = breadth_first_order(graph, start, False, return_predecessors=False)
            start = int(reached[-1])
        order.append(reached)
    return [np.concatenate(order), reverse_cuthill_mckee(graph, symmetric_mode=True)]
