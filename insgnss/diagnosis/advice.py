"""The advice to the user: checks of the flight file against estimates, and a message of the model.

A lever arm or time offset that is taken as known, and comes out different by more than five sigma
and by more than the fixes' own sigma, contradicts the flight file. A lever arm that the flight
determines to no better than `DETERMINED_M`, or that is off by less than `NEGLIGIBLE_M`, does not,
and makes a note only: slow errors of PPK fixes of some millimetres, which their sigmas do not hold,
make such ones up.
"""

import numpy as np

from ..navigation.codes import NAV
from ..navigation.layout import FixErrors
from ..navigation.solution import Solution
from ..orient.mounting import Mounting
from ..records import Check
from .estimated import constant, rms_speed, usual_sigma

SIGNIFICANT = 5.0  # sigmas of the estimate
MATTERS = 1.0  # sigmas of the fixes
DETERMINED_M = 0.05  # sigma of a lever arm: beyond it slow errors that nobody claims can make it up
NEGLIGIBLE_M = (
    0.02  # of a lever arm; a right one came out 11 mm off on a simulated flight from RINEX
)


def contradictions(
    solution: Solution, mounting: Mounting, lever_known: bool, offset_known: bool
) -> list[Check]:
    """Compare the estimated lever arm and time offset with the flight file.

    Parameters
    ----------
    solution : Solution
        A solution that has these constants among its states.
    mounting : Mounting
        The mounting of the flight file, in whose axes the advice is given.
    lever_known, offset_known : bool
        Whether the flight file takes the lever arm and the time offset as known.

    Returns
    -------
    list of Check
        "antenna lever arm" and "GNSS time offset", each where it differs.
    """
    layout, epochs = solution.problem.layout, solution.problem.epochs
    fix_sigma = float(usual_sigma(epochs.position_cov[epochs.has_position]).max())
    checks = []
    if lever_known and layout.lever >= 0:
        checks.append(_lever_arm(solution, mounting, fix_sigma))
    if offset_known and layout.offset >= 0:
        checks.append(_time_offset(solution, fix_sigma))
    return [check for check in checks if check is not None]


def message(errors: FixErrors) -> str:
    """Describe the time-correlated GNSS error that is estimated, for the history of a run."""
    correlated, white = (
        " / ".join(f"{x:.2f}" for x in values)
        for values in (errors.gm_sigma or (), errors.white_scale)
    )
    return (
        "correlated innovations: a time-correlated (Gauss-Markov) GNSS error estimated, in "
        f"standard deviations of the file (N / E / D): {correlated} with a correlation time of "
        f"{errors.correlation_time_s:.1f} s, beside {white} of white error"
    )


def _lever_arm(solution: Solution, mounting: Mounting, fix_sigma: float) -> Check | None:
    """Check the antenna lever arm; None where the flight agrees with the flight file."""
    first = solution.problem.layout.lever
    lever = slice(first, first + 3)
    value = solution.x[-1, lever]
    sigma = np.sqrt(np.diag(solution.P[-1, NAV.stop :, NAV.stop :])[lever])
    off = np.abs(value) > np.maximum(SIGNIFICANT * sigma, MATTERS * fix_sigma)
    if not off.any():
        return None
    certain = bool((off & (sigma < DETERMINED_M) & (np.abs(value) > NEGLIGIBLE_M)).any())
    antenna = mounting.antenna_m + mounting.C_cb @ value
    estimate = ", ".join(f"{v:+.3f} +- {s:.3f}" for v, s in zip(value, sigma, strict=True))
    return Check(
        "antenna lever arm",
        f"from the IMU off by forward, right, down {estimate} m",
        f"within {SIGNIFICANT:g} sigma or {MATTERS * fix_sigma:.3f} m of the flight file's",
        "contradiction" if certain else "note",
        f"mounting.antenna_m = [{', '.join(f'{v:.3f}' for v in antenna)}] would be it (if imu_m is "
        "right), or set filter.lever_arm = true to have it estimated",
    )


def _time_offset(solution: Solution, fix_sigma: float) -> Check | None:
    """Check the time offset of the fixes; None where the flight agrees with the flight file."""
    offset, sigma = constant(solution, solution.problem.layout.offset)
    speed = rms_speed(solution)
    if abs(offset) <= SIGNIFICANT * sigma or abs(offset) * speed <= MATTERS * fix_sigma:
        return None
    return Check(
        "GNSS time offset",
        f"the fixes' stamps lack {offset:+.4f} +- {sigma:.4f} s, {abs(offset) * speed:.2f} m at "
        f"{speed:.1f} m/s",
        f"within {SIGNIFICANT:g} sigma of none, or less than {MATTERS * fix_sigma:.3f} m",
        "contradiction",
        f"add {offset:+.4f} to gnss.time_offset_s, or set filter.time_offset = true to have it "
        "estimated",
    )
