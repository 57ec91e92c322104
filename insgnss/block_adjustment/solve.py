"""The adjustment of a block: gross errors, variances by components, and trials of what it lacks."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..adjust.adjustment import Adjusted, adjusted
from ..adjust.groups import control_points
from ..adjust.normals import Problem, problem_of
from ..adjust.outliers import Cleaned, without_outliers
from ..adjust.precision import Component, Precision, precision_of
from ..adjust.start import first_values
from ..base.errors import DataError
from .control import Control, control_of
from .inputs import Inputs

IMAGE, GROUND = "image observations", "ground control"
SETTLED = 0.01  # of a component's change
MOST_ROUNDS = 6
Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Solved:
    """An adjusted block.

    Parameters
    ----------
    inputs : Inputs
        What it started from.
    control : Control
        Its aerial control.
    precision : Precision
        Values, covariances and tests; variance of unit weight one.
    rejected : ndarray of int
        Rows of the image observations that were rejected.
    factors : dict
        By which the variances of a group were multiplied, by its name.
    iterations : int
        Steps of the adjustment from the first values, before variances were multiplied.
    """

    inputs: Inputs
    control: Control
    precision: Precision
    rejected: NDArray[np.int64]
    factors: dict[str, float]
    iterations: int

    @property
    def result(self) -> Adjusted:
        """The adjustment."""
        return self.precision.result

    @property
    def components(self) -> tuple[Component, ...]:
        """Variance components with the variances that were taken at last."""
        return self.precision.components()


def solved(inputs: Inputs, progress: Progress) -> Solved:
    """Adjust a block.

    Parameters
    ----------
    inputs : Inputs
        The block.
    progress : callable
        Is called with the name of each step.

    Returns
    -------
    Solved
        The adjustment.

    Raises
    ------
    DataError
        The observations do not determine the unknowns, or the iteration does not converge.
    """
    control = control_of(inputs)
    block = inputs.block
    groups = [*control.groups, *control_points(block.control)]
    if not groups:
        raise DataError(
            "neither aerial control nor ground control: nothing says where the block lies; give"
            " eo.json, or ground points that are measured in images"
        )
    progress(f"first values of {len(block.images)} images and {len(block.points)} points")
    values = replace(first_values(block), blocks=control.blocks)
    problem = problem_of(block, groups, control.blocks)
    options = inputs.file.adjustment
    progress(f"adjusting {len(block.observations)} image observations")
    if options.keep_all:
        cleaned = Cleaned(precision_of(adjusted(problem, values)), np.zeros(0, dtype=np.int64))
    else:
        cleaned = without_outliers(problem, values, options.limit_w)
    precision, factors = _reweighted(cleaned.precision, options.reweight, progress)
    steps = cleaned.result.iterations
    return Solved(inputs, control, precision, cleaned.rejected, factors, steps)


def _reweighted(
    precision: Precision, names: Sequence[str], progress: Progress
) -> tuple[Precision, dict[str, float]]:
    """Multiply variances of groups by their components until these are one."""
    factors: dict[str, float] = {}
    for _ in range(MOST_ROUNDS):
        change = {
            c.name: c.variance
            for c in precision.components()
            if c.name.partition(" of ")[0] in names and np.isfinite(c.variance) and c.variance > 0.0
        }
        if not change:
            break
        factors = {name: factors.get(name, 1.0) * v for name, v in change.items()}
        progress("variance components")
        result = precision.result
        problem = scaled(result.problem, change)
        precision = precision_of(adjusted(problem, result.values), 1.0)
        if max(abs(v - 1.0) for v in change.values()) < SETTLED:
            break
    else:
        pass
    if precision.scale != 1.0:
        precision = precision_of(precision.result, 1.0)
    return precision, factors


def scaled(problem: Problem, factors: dict[str, float]) -> Problem:
    """Return a problem with variances of groups multiplied.

    Parameters
    ----------
    problem : Problem
        The observations.
    factors : dict
        Factor of the variances by name of the component.

    Returns
    -------
    Problem
        The same otherwise.
    """
    block, groups = problem.block, []
    for group in problem.groups:
        factor = factors.get(group.name, 1.0)
        groups.append(replace(group, weight=group.weight / factor) if factor != 1.0 else group)  # type: ignore[type-var]
    sigma = np.array(block.observations.sigma_px)
    for c, camera in enumerate(block.cameras):
        name = f"{IMAGE} of {camera.name}" if len(block.cameras) > 1 else IMAGE
        mine = block.camera[block.observations.image] == c
        sigma[mine] *= np.sqrt(factors.get(name, 1.0))
    block = replace(block, observations=replace(block.observations, sigma_px=sigma))
    weight = 1.0 / sigma[problem.order]
    return replace(
        problem, block=block, groups=tuple(groups), rays=problem.rays._replace(weight=weight)
    )
