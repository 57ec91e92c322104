"""Variance components: how much larger or smaller the errors of each kind of observation are than
stated, and weights that agree with it.

Foerstner's simplified estimator: after an adjustment the component of a kind is s^2 = e^T P e / r,
with r the sum of its redundancy numbers; the weights of the kind are divided by it and the block is
adjusted again, until no component differs from one by more than 1 %. The factor of a kind is the
product of its components. With r redundant observations the relative standard deviation of the
factor is sqrt(2 / r): kinds for which it exceeds 0.3 (r < 22) keep their weights, as what they say
of themselves is mostly chance.

Source: Foerstner and Wrobel (2016), Photogrammetric Computer Vision, 4.2.4.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from .adjustment import adjust_problem
from .groups import Rescaled
from .normals import Problem
from .precision import IMAGE, Precision, VarianceComponent, image_components, precision_of
from .unknowns import Unknowns

# of a component from one (chosen): 0.5 % of a standard deviation
ENOUGH_CHANGE = 0.01
MOST_REWEIGHTINGS = 20  # adjustments until the components settle (chosen)
UNCERTAIN = 0.3
"""Relative standard deviation of a factor above which weights stay as they are."""
LARGEST_CHANGE = 100.0  # of a variance in one round, either way (chosen): no weight runs away


@dataclass(frozen=True, eq=False)
class Reweighted:
    """An adjustment whose weights agree with its residuals.

    Parameters
    ----------
    precision : Precision
        The adjustment, with weights divided by the factors, and unit variance.
    factors : dict
        By which the variances of a kind were multiplied, by its name; kinds that are missing have
        kept their weights, or needed no others.
    converged : bool
        Whether the last round changed no factor by more than 1 %.
    """

    precision: Precision
    factors: dict[str, float]
    converged: bool


def reweight_block(
    problem: Problem, values: Unknowns, kinds: Collection[str] | None = None
) -> Reweighted:
    """Adjust a block with weights that agree with the residuals.

    Parameters
    ----------
    problem : Problem
        The observations, free of gross errors (`outliers`): one of them spoils its whole kind.
    values : Unknowns
        First values.
    kinds : collection of str, optional
        Names of the components whose weights may change, of image observations "image observations"
        for every camera; by default all.

    Returns
    -------
    Reweighted
        The adjustment, and the factor of each kind's variances.

    Raises
    ------
    DataError
        As `adjust_problem`.
    """
    product: dict[str, float] = {}
    trusted: set[str] | None = None
    of_images = image_components(problem.block)
    for _ in range(MOST_REWEIGHTINGS):
        current = with_factors(problem, product)
        result = adjust_problem(current, values)
        values = result.values.completed(values)
        precision = precision_of(result, 1.0)
        components = precision.components()
        if trusted is None:  # by their redundancy with the stated weights
            trusted = {
                c.name
                for c in components
                if _relative(c) <= UNCERTAIN
                and (kinds is None or (IMAGE if c.name in of_images else c.name) in kinds)
            }
        change = {c.name: c.variance for c in components if c.name in trusted}
        if all(abs(v - 1.0) < ENOUGH_CHANGE for v in change.values()):
            return Reweighted(precision, product, True)
        for name, variance in change.items():
            step = min(max(variance, 1.0 / LARGEST_CHANGE), LARGEST_CHANGE)
            product[name] = product.get(name, 1.0) * step
    return Reweighted(precision, product, False)


def _relative(component: VarianceComponent) -> float:
    """Return the relative standard deviation of a component."""
    return np.sqrt(2.0 / component.redundancy) if component.redundancy > 1e-6 else np.inf


def with_factors(problem: Problem, factors: Mapping[str, float]) -> Problem:
    """Return a problem with variances multiplied by factors.

    Parameters
    ----------
    problem : Problem
        The observations.
    factors : mapping
        Factor by the name of the kind; kinds that are missing keep their variances.

    Returns
    -------
    Problem
        The same otherwise.
    """
    block = problem.block
    of_camera = np.array([factors.get(name, 1.0) for name in image_components(block)])
    factor = of_camera[block.camera[block.observations.image]]
    sigma_px = block.observations.sigma_px * np.sqrt(factor)[:, None]
    observations = replace(block.observations, sigma_px=sigma_px)
    groups = tuple(
        Rescaled(group, factors[group.name]) if group.name in factors else group
        for group in problem.groups
    )
    return replace(
        problem,
        block=replace(block, observations=observations),
        rays=problem.rays._replace(
            weight=problem.rays.weight / np.sqrt(factor[problem.order])[:, None]
        ),
        groups=groups,
    )
