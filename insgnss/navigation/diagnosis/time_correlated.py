"""The time-correlated (Gauss-Markov) errors of the fixes: of all of them, and of code solutions.

Of all fixes the white share k, the time-correlated share c (both times a ratio in height) and the
correlation time T are those that make (C.1) of `evidence` smallest over its window. The error is
accepted where it gains more than `evidence.GAIN` in -2 log L. Over such a window the fixes tell how
fast the error moves, c^2 / T, better than how far: along that ridge c and T go towards what the
file claims, k^2 + c^2 = 1, as long as the likelihood allows it and k alone does not exhaust the
claim. What lasts longer than the window (a wrong base coordinate, the ionosphere of a single-point
solution) leaves no trace in innovations.

The standard deviation of a code solution holds errors that last: ionosphere, ephemerides, the
receiver's own filter. Its white share may be all of it or a thirtieth, and only the data know. Four
quantities are found by the likelihood (L.4) of the liveliest minutes, by its slopes (L.5):

    k    white share of the positions, in their standard deviations
    q    rate c^2 / T at which the time-correlated share c grows, T its correlation time
    v    white share of the velocities, in theirs
    w    m/s, of a time-correlated error of the velocities, T there `OF_VELOCITY_S`

A receiver that filters its velocities, or whose Doppler shares the ionosphere, is wrong by the same
centimetres a second for a minute; integrated by a filter that takes them for white, they carry the
positions tens of metres off their own fixes. What the fixes claim in all is taken at its word,

    k^2 + c^2 = 1,     T = c^2 / q, at most `LONGEST_WINDOW_S`
     (D.3)

since a share that lasts longer than the recording leaves no trace in it; from k = `ALL_WHITE` on
nothing is left to last.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ...base.errors import DataError
from ...records import Array
from ..filter.codes import NOT_MEASURED, POSITION_ROW, REJECTED, VELOCITY_ROW
from ..filter.layout import FixErrors
from ..filter.problem import EstimationProblem, InitialState
from ..filter.solution import Solution, solve
from ..innovations.likelihood import CORRELATED_STATES, FIX_PARAMETERS, available, linear_segment
from ..innovations.search import LAST_GAIN, Search
from .candidates import (
    WHITER,
    LayoutFactory,
    guesses,
    only_code_fixes,
    with_layout,
    with_time_correlated_error,
)
from .evidence import (
    GAIN,
    IMPOSSIBLE,
    liveliest_part,
    liveliest_window,
    minus_two_log_likelihood,
)

# s, bound of T: the ionosphere of a single-frequency receiver; what lasts longer leaves no trace in
# the innovations of a window
LONGEST_WINDOW_S = 600.0
LEAST_WHITE = 0.2  # bound of k: a fix is not taken to be better than a fifth of its sigma
LEAST_WHITE_CODE = 0.03  # the same for code solutions
WHITE_CLAIM = 0.5  # k^2 beyond which the file's claim is of the white error alone
RESTART_AT = np.log(6.0)  # of T, where the search begins again
STEP_ALONG_RIDGE = np.log(1.3)  # step of T along c^2 / T
ONE_SIGMA_RISE = 1.0  # rise of -2 log L that one sigma makes
LARGEST_LOGARITHM = 8.0  # bound of the logarithms of all parameters
# of code solutions
OF_VELOCITY_S = 60.0  # correlation time of the errors of velocities
ALL_WHITE = 0.9  # share of the sigma
ROUNDS, SETTLED = 3, 0.3  # of fits; logarithm of a factor that is no longer a change
FACTOR_BOUNDS = (0.01, 100.0)  # bounds of what a fit changes
# of the part that the first fit and the later ones look at
FIRST_FIXES, MOST_FIXES_FITTED = 2000, 9000
FEWEST_FIXES = 60  # below which no share is determined
TRIES, REJECTED_BY_FIT = 6, 0.05  # of larger white shares; share of the fixes
# bounds of the shares, and of time-correlated velocity errors
LEAST, LEAST_MPS, MOST_MPS = 0.02, 1e-3, 3.0


def is_suspicious(solution: Solution, layout_factory: LayoutFactory, errors: FixErrors) -> bool:
    """Tell whether a time-correlated GNSS error explains the liveliest window better.

    Parameters
    ----------
    solution : Solution
        The solved flight.
    layout_factory : LayoutFactory
        The error states of the flight as a function of those of its fixes.
    errors : FixErrors
        What is estimated already.

    Returns
    -------
    bool
        Whether it gains `evidence.GAIN` in (C.1); never where one is estimated already.
    """
    if errors.gm_sigma is not None:
        return False
    problem, start = liveliest_window(solution)
    candidates = [errors]
    candidates += [with_time_correlated_error(errors, *guess) for guess in guesses(problem)]
    cost = [
        minus_two_log_likelihood(*with_layout(problem, start, layout_factory(candidate)))
        for candidate in candidates
    ]
    return cost[0] - min(cost[1:]) > GAIN


def time_correlated_error(
    solution: Solution, layout_factory: LayoutFactory, errors: FixErrors
) -> FixErrors | None:
    """Find the time-correlated GNSS error that explains the innovations best.

    Parameters
    ----------
    solution : Solution
        The solved flight.
    layout_factory : LayoutFactory
        The error states of the flight as a function of those of its fixes.
    errors : FixErrors
        The errors of the fixes that are estimated in any case.

    Returns
    -------
    FixErrors or None
        `errors` with the time-correlated error and the scale of the fixes' sigmas by (C.1); None
        where they gain less than `evidence.GAIN`.
    """
    problem, start = liveliest_window(solution)
    interval_s, code = problem.aiding_interval_s, only_code_fixes(problem)
    least_white = LEAST_WHITE_CODE if code else LEAST_WHITE

    def model(p: Array) -> FixErrors:
        k, c, T, ratio = np.exp(p)
        time_s = float(np.clip(T, interval_s, LONGEST_WINDOW_S))
        return with_time_correlated_error(errors, max(k, least_white), c, time_s, ratio)

    def cost(p: Array) -> float:
        if np.abs(p).max() > LARGEST_LOGARITHM:
            return IMPOSSIBLE
        return minus_two_log_likelihood(*with_layout(problem, start, layout_factory(model(p))))

    without = minus_two_log_likelihood(*with_layout(problem, start, layout_factory(errors)))
    first = min((np.log([*guess, 1.0]) for guess in guesses(problem)), key=cost)
    best = _descend(cost, first)
    # once more along the ridge: the first may have ended in a hollow
    again = _descend(cost, best.x + [0.0, 0.5 * RESTART_AT, RESTART_AT, 0.0])
    best = min(best, again, key=lambda minimum: float(minimum.fun))
    if without - best.fun < GAIN:
        return None
    return model(best.x if code else _towards_claim(cost, best.x, best.fun))


def beyond_claim(errors: FixErrors) -> bool:
    """Tell whether fixes scatter more than they claim, so that the claim bounds no slow error.

    Parameters
    ----------
    errors : FixErrors
        Errors of the fixes with a time-correlated one.

    Returns
    -------
    bool
        Whether the white share exhausts the claim, or the time-correlated one exceeds it.
    """
    assert errors.gm_sigma is not None
    return errors.white_scale[0] ** 2 > WHITE_CLAIM or errors.gm_sigma[0] > 1.0


def _descend(cost: Callable[[Array], float], first: Array) -> Any:
    """Minimise `cost` of log k, c, T and the ratio of heights by the method of Nelder and Mead."""
    from scipy.optimize import minimize

    steps = [
        [0.0, 0, 0, 0],
        [-1.0, 0, 0, 0],
        [0, -1.0, 0.7, 0],
        [-0.5, 0.5, -1.5, 0],
        [-0.3, 0, 0, -0.7],
    ]
    options = {
        "initial_simplex": first + np.array(steps),
        "maxfev": 60,
        "xatol": 0.05,
        "fatol": 1.0,
    }
    return minimize(cost, first, method="Nelder-Mead", options=options)


def _towards_claim(cost: Callable[[Array], float], p: Array, least: float) -> Array:
    """Move along c^2 / T towards k^2 + c^2 = 1, as long as the cost stays near `least`."""
    while True:
        claim = np.exp(2.0 * p[0]) + np.exp(2.0 * p[1])
        step = np.sign(1.0 - claim) * np.array([0.0, 0.5 * STEP_ALONG_RIDGE, STEP_ALONG_RIDGE, 0.0])
        after = np.exp(2.0 * p[0]) + np.exp(2.0 * (p[1] + step[1]))
        if (
            (claim > 1.0 and np.exp(2.0 * p[0]) > WHITE_CLAIM)
            or abs(np.log(after)) > abs(np.log(claim))
            or (p + step)[2] > np.log(LONGEST_WINDOW_S)
            or cost(p + step) > least + ONE_SIGMA_RISE
        ):
            return p
        p = p + step


def code_errors(
    problem: EstimationProblem,
    start: InitialState,
    layout_factory: LayoutFactory,
    errors: FixErrors,
    progress: Callable[[str], None],
) -> FixErrors | None:
    """Find white and time-correlated errors of code solutions, of positions and of velocities.

    Parameters
    ----------
    problem, start : EstimationProblem, InitialState
        The problem and its initial state.
    layout_factory : LayoutFactory
        The error states of the flight as a function of those of its fixes.
    errors : FixErrors
        The errors of the fixes that the flight file asks for.
    progress : callable
        Receives the name of each step.

    Returns
    -------
    FixErrors or None
        `errors` with what the data say of the fixes; None where not all fixes are code solutions,
        where there are too few, or where no such model has a solution.
    """
    fixes = np.count_nonzero(problem.epochs.has_position)
    if fixes < FEWEST_FIXES or errors.unfixed_gm_sigma is None or not only_code_fixes(problem):
        return None
    progress("white and time-correlated errors of the code solutions")
    measured = problem.epochs.has_velocity
    model = replace(
        errors,
        unfixed_gm_sigma=1.0,
        unfixed_correlation_time_s=LONGEST_WINDOW_S,
        unfixed_white_scale=1.0,
    )
    if measured.any():
        variance = np.diagonal(problem.epochs.velocity_cov[measured], axis1=1, axis2=2)
        sigma = float(np.sqrt(np.median(variance)))
        model = replace(
            model, velocity_gm_sigma_mps=sigma, velocity_correlation_time_s=OF_VELOCITY_S
        )
    fitted = _fit(problem, start, layout_factory, model, progress)
    return None if fitted is None else _as_claimed(fitted)


def _fit(
    problem: EstimationProblem,
    start: InitialState,
    layout_factory: LayoutFactory,
    model: FixErrors,
    progress: Callable[[str], None],
) -> FixErrors | None:
    """Fit k, c at `LONGEST_WINDOW_S`, v and w; None without a solution."""
    fits, white_only = 0, True
    for _ in range(ROUNDS + TRIES):
        posed = with_layout(problem, start, layout_factory(model))
        try:
            solution = solve(*posed, "off", progress, separations=0)
        except DataError:
            solution = None
        if solution is None or _rejected_share(solution) > REJECTED_BY_FIT:
            # something else is wrong besides, which white errors have to hold
            model, fits = _whiter(model), fits if white_only else ROUNDS
            continue
        if fits == ROUNDS:
            return model
        factors = _maximum(solution, white_only, progress)
        model = _with_factors(model, factors)
        settled = max(abs(np.log(factor)) for factor in factors.values()) < SETTLED
        fits = ROUNDS if settled and not white_only else fits + 1
        white_only = False
    return None


def _with_factors(model: FixErrors, factors: dict[str, float]) -> FixErrors:
    """Return the model with its shares multiplied, within their bounds."""
    white = max(model.unfixed_white_scale * factors["fixes.position"], LEAST)
    share = max((model.unfixed_gm_sigma or 1.0) * factors["fixes.unfixed_correlated"], LEAST)
    model = replace(model, unfixed_white_scale=white, unfixed_gm_sigma=share)
    if model.velocity_gm_sigma_mps is None:
        return model
    sigma_mps = model.velocity_gm_sigma_mps * factors["fixes.velocity_correlated"]
    return replace(
        model,
        velocity_gm_sigma_mps=float(np.clip(sigma_mps, LEAST_MPS, MOST_MPS)),
        velocity_white_scale=max(model.velocity_white_scale * factors["fixes.velocity"], LEAST),
    )


def _whiter(model: FixErrors) -> FixErrors:
    """Return the model with larger white shares."""
    return replace(
        model,
        unfixed_white_scale=WHITER * model.unfixed_white_scale,
        velocity_white_scale=WHITER * model.velocity_white_scale,
    )


def _rejected_share(solution: Solution) -> float:
    """Return the share of positions, or half that of velocities, that the gate rejected."""
    verdict = solution.verdict[:, [POSITION_ROW, VELOCITY_ROW]]
    offered = np.maximum(np.count_nonzero(verdict != NOT_MEASURED, axis=0), 1)
    return float(np.max(np.count_nonzero(verdict == REJECTED, axis=0) / offered * [1.0, 0.5]))


def _maximum(
    solution: Solution, white_only: bool, progress: Callable[[str], None]
) -> dict[str, float]:
    """Return the factors of the fixes' errors that maximise the likelihood.

    White errors come first: beside a white share that is far too large no other is seen.
    """
    liveliest = liveliest_part(solution, FIRST_FIXES if white_only else MOST_FIXES_FITTED)
    layout = liveliest.problem.layout
    possible = available(layout, bool(liveliest.problem.epochs.has_velocity.any()))
    names = tuple(name for name in possible if name in (*FIX_PARAMETERS, *CORRELATED_STATES))
    segment = linear_segment(liveliest, names)
    search = Search([segment], names, progress, FACTOR_BOUNDS, gain=LAST_GAIN)
    free = np.array([name in FIX_PARAMETERS or not white_only for name in names])
    theta = search.maximum(free).theta
    return dict(zip(names, np.exp(theta).tolist(), strict=True))


def _as_claimed(model: FixErrors) -> FixErrors:
    """Return the model whose shares make what the fixes claim (D.3)."""
    k, c = model.unfixed_white_scale, model.unfixed_gm_sigma or 0.0
    if k >= ALL_WHITE:
        return replace(model, unfixed_gm_sigma=None)
    share = float(np.sqrt(1.0 - k**2))
    time_s = float(np.clip(LONGEST_WINDOW_S * (share / c) ** 2, 1.0, LONGEST_WINDOW_S))
    return replace(model, unfixed_gm_sigma=share, unfixed_correlation_time_s=time_s)


def code_message(model: FixErrors) -> str:
    """Describe the errors of code solutions, for the history of a run."""
    correlated = "none time-correlated"
    if model.unfixed_gm_sigma is not None:
        time = f"over {model.unfixed_correlation_time_s:.0f} s"
        correlated = f"{model.unfixed_gm_sigma:.2f} time-correlated {time}"
    text = (
        "errors of the code solutions, in their standard deviations:"
        f" {model.unfixed_white_scale:.2f} white, {correlated}"
    )
    if model.velocity_gm_sigma_mps is None:
        return text
    return (
        f"{text}; of the velocities {model.velocity_white_scale:.2f} white,"
        f" {100.0 * model.velocity_gm_sigma_mps:.1f} cm/s time-correlated over"
        f" {model.velocity_correlation_time_s:.0f} s"
    )
