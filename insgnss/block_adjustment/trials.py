"""What explains observations that contradict each other: each remedy is tried, the best is named.

A group whose component lies beyond its bounds says that something is wrong and not what. The block
is adjusted once more with each unknown that the block file leaves out: a delay of the exposures, a
lever arm, a bore-sight, a shift between ground and aerial control (another CRS, geoid or datum),
the interior orientation. An unknown explains the contradiction where the cost falls by more than
chance (99.99 % of chi-square) and by a third at least of what is too much.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..adjust.adjustment import adjusted
from ..adjust.aerial import BORESIGHT, LEVER_ARM, TIME_OFFSET
from ..adjust.groups import ObservationGroup
from ..adjust.normals import problem_of
from ..adjust.precision import precision_of
from ..adjust.unknowns import CAMERA, Key
from ..adjust.variance_components import with_factors
from ..base.errors import DataError
from ..geodesy.rotation import vector_from_rotation
from ..records.block import INTERIOR, Array
from .control import control_of
from .datum import DATUM, ShiftedPoint
from .solve import IMAGE, Solved, ground_groups

LOOSE = {LEVER_ARM: 10.0, BORESIGHT: 30.0, TIME_OFFSET: 1.0}
CHANCE, SHARE = 0.9999, 1.0 / 3.0
USUAL = ("f", "cx", "cy")


@dataclass(frozen=True, eq=False)
class Trial:
    """One remedy and what it did.

    Parameters
    ----------
    name : str
        The unknown that was added.
    gain : float
        By how much the cost fell.
    unknowns : int
        How many unknowns were added.
    value, sigma : ndarray
        Their values and standard deviations, in `unit`.
    unit : str
        m, rad, s or px.
    explains : bool
        Whether it explains what was too much.
    key : str
        How a block file asks for it.
    """

    name: str
    gain: float
    unknowns: int
    value: Array
    sigma: Array
    unit: str
    explains: bool
    key: str


def trials(solved: Solved, excess: float, progress: Callable[[str], None]) -> tuple[Trial, ...]:
    """Try what the block file leaves out.

    Parameters
    ----------
    solved : Solved
        The adjusted block.
    excess : float
        By how much the cost is larger than its expectation.
    progress : callable
        Is called with the name of each step.

    Returns
    -------
    tuple of Trial
        Those that could be adjusted, the largest gain beyond its unknowns first.
    """
    done = []
    for name, key, unit, build in _remedies(solved):
        progress(f"trying: {name}")
        try:
            trial = _trial_of(solved, name, key, unit, build, excess)
        except DataError:
            continue  # it is not determined, so that it explains nothing
        done.append(trial)
    return tuple(sorted(done, key=lambda trial: trial.unknowns - trial.gain))


def _remedies(solved: Solved) -> Any:
    options = solved.inputs.file.aerial_control
    if solved.inputs.eo is not None:
        if options.time_offset_sigma_s == 0.0 and solved.inputs.eo.velocity_mps is not None:
            wider = replace(options, time_offset_sigma_s=LOOSE[TIME_OFFSET])
            key = "aerial_control.time_offset_sigma_s"
            yield "delay of the exposures", key, "s", (wider, (TIME_OFFSET, 0))
        if options.lever_arm_sigma_m is None:
            wider = replace(options, lever_arm_sigma_m=(LOOSE[LEVER_ARM],) * 3)
            yield "lever arm", "aerial_control.lever_arm_sigma_m", "m", (wider, (LEVER_ARM, 0))
        if options.boresight_sigma_deg < LOOSE[BORESIGHT]:
            wider = replace(options, boresight_sigma_deg=LOOSE[BORESIGHT])
            yield "bore-sight", "aerial_control.boresight_sigma_deg", "rad", (wider, (BORESIGHT, 0))
        if len(solved.inputs.block.control) > 1:
            yield "shift of ground control", "ground.crs", "m", (options, DATUM)
    cameras = solved.result.problem.block.cameras
    if any(not set(USUAL) <= set(camera.free) for camera in cameras):
        yield "interior orientation", "camera.free", "px", (options, (CAMERA, 0))


def _trial_of(
    solved: Solved, name: str, option: str, unit: str, build: tuple[Any, Key], excess: float
) -> Trial:
    from scipy.stats import chi2

    options, key = build
    result = solved.result
    own = result.problem
    block = own.block
    control = control_of(solved.inputs, options)
    points = ground_groups(own)
    groups: list[ObservationGroup] = [*control.groups, *points, *solved.inputs.interior]
    blocks = {k: result.values.blocks.get(k, v) for k, v in control.blocks.items()}
    if key == DATUM:
        groups = [*(g for g in groups if g not in points), *map(ShiftedPoint.of, points)]
        blocks[DATUM] = np.zeros(3)
    if key[0] == CAMERA:
        free = tuple(n for n in INTERIOR if n in USUAL or n in ("k1", "k2", "p1", "p2"))
        cameras = tuple(
            replace(c, free=tuple(n for n in INTERIOR if n in c.free or n in free))
            for c in block.cameras
        )
        block = replace(block, cameras=cameras)
    problem = problem_of(block, groups, blocks)
    # image observations have their final variances already
    rest = {name: f for name, f in solved.factors.items() if not name.startswith(IMAGE)}
    problem = with_factors(problem, rest)
    problem = problem.with_active_of(own)
    again = adjusted(problem, replace(result.values, blocks=blocks))
    precision = precision_of(again, 1.0)
    gain = result.cost - again.cost
    if key[0] == CAMERA:
        columns = again.problem.layout.columns
        value = again.values.interior[0, columns] - result.values.interior[0, columns]
    else:
        raw = again.values.blocks[key]
        value = vector_from_rotation(raw) if raw.ndim == 2 else raw
    sigma = np.sqrt(np.diagonal(precision.cov(key)))
    enough = gain > max(chi2.ppf(CHANCE, value.size), SHARE * excess)
    return Trial(name, float(gain), value.size, value, sigma, unit, bool(enough), option)
