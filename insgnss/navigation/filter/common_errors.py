"""Errors that all flight lines have in common, however far apart.

Constants (turn-on biases, scale factors, lever arm, time offset), slow Gauss-Markov processes and
random walks are the same, or nearly so, in all flight lines: an accelerometer bias tilts the body
in each of them. The smoothed errors of such states at a few events (nodes), c, are jointly normal
with what is wanted of every event, y_k. Hence with cov_s(c) = L L'

    y_k = A_k c' + rest_k,    c' = L^-1 c,    cov(c') = 1,    A_k = cov_s(y_k, c) L^-T       (B.9)

where cov_s(y_k, c) is that of (B.8), and rest is independent of c': cov(rest_j, rest_k) =
cov_s(y_j, y_k) - A_j A_k', what is left of the covariance once c' is known, positive semi-definite
for any choice of nodes. The choice decides what rest of different flight lines still share.
Constants have one node. Other states with correlation times above `SLOW` have nodes half of it
apart, a random walk every `WALK_S`. Of ign8 (434 images in 26 lines, 35 min) rest between lines is
below 0.0001 of the sigmas in the median and 0.31 at most (headings of lines that one turn
separates; tilts 0.12, positions 0.04). The sigma of the mean tilt comes out 0.99 to 1.00 of the
exact one, of the mean heading 1.11; with constants alone the tilt 0.76 to 0.80, of independent
lines 0.26 to 0.36. The mean position of a corridor whose fixes have errors of 300 s: 1.00, with
constants alone and of independent lines 0.66.

What epochs share that no state describes (`SharedError`) is common to them in the same sense.
"""

import numpy as np
from numpy.typing import NDArray

from ...records import Array
from .codes import N_NAV
from .event_chain import EventChain
from .layout import StateLayout

SLOW_CORRELATION_S = 100.0  # correlation time; below, lines a turn apart share little
# interval (s) of a random walk's nodes: the figures above were reached with it (chosen)
WALK_S = 300.0
NODE_INTERVAL = 0.5  # interval between them, in correlation times
MOST_NODES = 200  # nodes of a segment; farther apart where it takes more
JITTER = (0.0, 1e-12, 1e-9)  # of the variances: bias and slow process are known by their sum


def nodes_of(layout: StateLayout, time: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the nodes of the states that change slowly, or not at all.

    Parameters
    ----------
    layout : StateLayout
        The states.
    time : ndarray
        (k,) times of all events of the solution, s.

    Returns
    -------
    event, state : ndarray
        (c,) event and state of each node, events not decreasing.
    """
    if not time.size:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    duration, wider, number = float(time[-1] - time[0]), 1.0, MOST_NODES + 1
    interval = np.full(layout.beta.size, np.inf)  # of a constant
    driven = layout.drive > 0.0
    interval[driven] = WALK_S
    decays = driven & (layout.beta > 0.0)
    interval[decays] = NODE_INTERVAL / layout.beta[decays]
    states = np.flatnonzero(layout.sigma0 > 0.0)
    states = states[~decays[states] | (layout.beta[states] * SLOW_CORRELATION_S <= 1.0)]
    while number > MOST_NODES and wider < 1e6:
        count = np.maximum(np.ceil(duration / (wider * interval[states])), 1.0).astype(np.int64)
        number, wider = int(count.sum()), 2.0 * wider
    state = np.repeat(states, count)
    share = np.concatenate([(np.arange(k) + 0.5) / k for k in count]) if states.size else count
    event = np.abs(time[:, None] - time[0] - duration * share).argmin(axis=0)
    nodes = np.unique(np.column_stack([event, N_NAV + state]), axis=0)
    return nodes[:, 0], nodes[:, 1]


def common_errors(
    chain: EventChain, event: NDArray[np.int64], state: NDArray[np.int64], T: Array
) -> Array:
    """Return what errors common to all events make of each (B.9).

    Parameters
    ----------
    chain : EventChain
        What ties the k events.
    event, state : ndarray
        (c,) the nodes, events not decreasing.
    T : Array
        (k, d, n) what is wanted of each event, as the derivative by the errors of all states.

    Returns
    -------
    Array
        (k, d, q) A_k, by errors of unit variance that are independent of each other.
    """
    cross, cov = _of_nodes(chain, event, state, T)
    k, d, c = cross.shape
    sigma = np.sqrt(np.diagonal(cov))
    parts = [_whitened(cross.reshape(k * d, c) / sigma, cov / np.outer(sigma, sigma))]
    for error in chain.shared:
        inside = (chain.epoch >= error.first) & (chain.epoch <= error.last)
        size, axes = np.linalg.eigh(error.cov)
        root = axes * np.sqrt(np.maximum(size, 0.0))
        derivative = np.where(inside[:, None, None], T[:, :, error.block], 0.0)
        parts.append((derivative @ root).reshape(k * d, 3))
    return np.concatenate(parts, axis=1).reshape(k, d, -1)


def _of_nodes(
    chain: EventChain, event: NDArray[np.int64], state: NDArray[np.int64], T: Array
) -> tuple[Array, Array]:
    """Return cov_s(y_k, c), (k, d, c), and cov_s(c), (c, c), by (B.8) from node to event."""
    k, d, n = T.shape
    M = chain.transitions
    rows = [chain.row_of(*node) for node in zip(event, state, strict=True)]
    P, gain = chain.filtered[rows], chain.gain[rows]
    cross, cov = np.zeros((k, d, event.size)), np.zeros((event.size, event.size))
    begin = np.searchsorted(event, np.arange(k + 1))
    back = np.zeros((n, event.size))
    for j in range(k - 1, -1, -1):  # nodes at this event, and later ones
        own, later = slice(begin[j], begin[j + 1]), slice(begin[j], None)
        back[:, own] = gain[own].T
        cross[j, :, later] = chain.product(T[j], chain.filtered, j) @ back[:, later]
        cov[own, later] = P[own] @ back[:, later]
        back[:, later] = M[j].T @ back[:, later]
    ahead = np.zeros((event.size, n))
    for j in range(k):  # earlier nodes
        own, earlier = slice(begin[j], begin[j + 1]), slice(0, begin[j])
        ahead[earlier] = ahead[earlier] @ M[j].T
        cross[j, :, earlier] = chain.product(T[j], chain.gain, j) @ ahead[earlier].T
        ahead[own] = P[own]
    upper = np.triu(cov, 1)
    return cross, upper + upper.T + np.diag(np.diagonal(cov))


def _whitened(cross: Array, cov: Array) -> Array:
    """Return cross L^-T of a covariance L L' with unit diagonal, zeros where it has no digits."""
    for jitter in JITTER:
        try:
            L = np.linalg.cholesky(cov + jitter * np.eye(len(cov)))
        except np.linalg.LinAlgError:
            continue
        return np.asarray(np.linalg.solve(L, cross.T).T)
    return np.zeros_like(cross)
