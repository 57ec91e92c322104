"""The candidates of the search: the errors of the fixes that are tried as states of a problem.

All of them are states of `navigation.layout.FixErrors`. Estimated together on one flight they
explain each other's share:

    lever arm dl and time offset d    moving the antenna by C_lb dl and v d: seen in turns and in
                                      changes of speed
    GNSS errors themselves            white, k times the sigma of each fix, and a Gauss-Markov
                                      process, c times it, with correlation time T
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..navigation.codes import NAV
from ..navigation.layout import FixErrors, StateLayout
from ..navigation.problem import EstimationProblem, InitialState

SUSPECT_LEVER_ARM_M = 1.0  # a-priori sigma of a component of the lever arm in the search
SUSPECT_TIME_OFFSET_S = 0.3  # a-priori sigma of the time offset in the search
CLOCK_RATE = 1e-4  # s/s, a-priori sigma of the rate of a quartz that nothing disciplines
WHITER = 1.6  # factor of the white share, each time that the filter loses fixes with a candidate

# k, c, T (s) from which the search for the time-correlated error starts
GUESSES = (
    (0.6, 1.0, 20.0),
    (1.0, 1.0, 20.0),
    (1.0, 3.0, 20.0),
    (0.3, 0.7, 20.0),
    (0.4, 0.8, 3.0),
)
CODE_GUESSES = (
    (0.1, 0.2, 10.0),
)  # the same for code solutions, whose sigmas hold errors of minutes

LayoutFactory = Callable[[FixErrors], StateLayout]
"""Gives the error states of a flight for the errors of the fixes that are to be among them."""


def with_lever_arm_and_time_offset(errors: FixErrors) -> FixErrors:
    """Add the lever arm, the time offset and its rate to the estimated errors.

    Parameters
    ----------
    errors : FixErrors
        The errors of the fixes that are estimated already; the a-priori sigmas that it has stay.

    Returns
    -------
    FixErrors
        The same errors with these constants among them.
    """
    return replace(
        errors,
        lever_arm_m=errors.lever_arm_m or SUSPECT_LEVER_ARM_M,
        time_offset_s=errors.time_offset_s or SUSPECT_TIME_OFFSET_S,
        clock_rate=errors.clock_rate or CLOCK_RATE,
    )


def with_time_correlated_error(
    errors: FixErrors, k: float, c: float, time_s: float, height_ratio: float = 1.0
) -> FixErrors:
    """Add a time-correlated (Gauss-Markov) GNSS error to the estimated errors.

    Parameters
    ----------
    errors : FixErrors
        The errors of the fixes that are estimated already.
    k, c : float
        The white and the time-correlated share, in standard deviations of each fix.
    time_s : float
        The correlation time, s.
    height_ratio : float
        The factor of both shares in height.

    Returns
    -------
    FixErrors
        The same errors with the time-correlated one among them.
    """
    return replace(
        errors,
        gm_sigma=(c, c, c * height_ratio),
        correlation_time_s=time_s,
        white_scale=(k, k, k * height_ratio),
        unfixed_white_scale=min(k, errors.unfixed_white_scale),
    )


def with_larger_white_share(errors: FixErrors) -> FixErrors:
    """Raise the white share of the fixes' errors by `WHITER`, which heavy tails call for."""
    return replace(
        errors,
        white_scale=tuple(WHITER * k for k in errors.white_scale),
        unfixed_white_scale=WHITER * errors.unfixed_white_scale,
    )


def guesses(problem: EstimationProblem) -> tuple[tuple[float, float, float], ...]:
    """Return k, c and T (s) of the time-correlated errors from which the search starts."""
    return CODE_GUESSES if only_code_fixes(problem) else GUESSES


def only_code_fixes(problem: EstimationProblem) -> bool:
    """Tell whether the errors of all fixes are of the kind that stays for minutes."""
    return bool((problem.epochs.group[problem.epochs.has_position] == 1).all())


def with_layout(
    problem: EstimationProblem, start: InitialState, layout: StateLayout
) -> tuple[EstimationProblem, InitialState]:
    """Pose the same problem with the states of another layout.

    Parameters
    ----------
    problem, start : EstimationProblem, InitialState
        The problem and its initial state.
    layout : StateLayout
        The states that it is to have.

    Returns
    -------
    tuple of EstimationProblem and InitialState
        The problem with `layout`. States of the same name keep their value and their covariance,
        new ones start at zero with their a-priori sigma, uncorrelated with the others.
    """
    old = problem.layout
    index = [old.names.index(name) if name in old.names else -1 for name in layout.names]
    kept = np.array([s for s, k in enumerate(index) if k >= 0], dtype=np.int64)
    source = np.array([k for k in index if k >= 0], dtype=np.int64)
    n = NAV.stop
    x, mean = np.zeros(layout.size - n), np.zeros(layout.size)
    P = np.diag(np.concatenate([np.zeros(n), layout.sigma0**2]))
    x[kept] = start.x[source]
    mean[NAV], mean[n + kept] = start.mean[NAV], start.mean[n + source]
    rows = np.concatenate([np.arange(n), n + kept])
    columns = np.concatenate([np.arange(n), n + source])
    P[np.ix_(rows, rows)] = start.P[np.ix_(columns, columns)]
    return replace(problem, layout=layout), InitialState(start.nav, x, mean, P)
