"""The time offset of the fixes that has to go into their stamps before the flight is solved again.

As a state the offset d moves a fix by v d; what that leaves out is a d^2 / 2. An offset beyond
`LARGE_S` is therefore taken into the stamps, and the rest is estimated again.
"""

from ..navigation.solution import Solution
from .estimated import constant

ROUNDS = 4  # solutions again with moved stamps, at most
CERTAIN = 2.0  # sigmas of the offset
LARGE_S = 0.005  # what a smaller offset leaves of a d^2 / 2 is below 0.1 mm


def offset_to_apply(solution: Solution) -> float:
    """Return the estimated time offset of the fixes where it is too large to be left to the state.

    Parameters
    ----------
    solution : Solution
        The solved flight.

    Returns
    -------
    float
        What is to be added to the stamps, s; zero where the offset is not estimated, smaller than
        `LARGE_S` or than `CERTAIN` of its sigmas.
    """
    state = solution.problem.layout.offset
    if state < 0:
        return 0.0
    offset, sigma = constant(solution, state)
    return offset if abs(offset) > max(LARGE_S, CERTAIN * sigma) else 0.0
