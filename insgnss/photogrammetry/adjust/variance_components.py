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

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...records.block import ImageObservations
from .adjustment import adjusted
from .groups import Rescaled
from .normals import Problem
from .precision import IMAGE, Component, Precision, image_components, precision_of
from .unknowns import Unknowns

# of a component from one (chosen): 0.5 % of a standard deviation
ENOUGH_CHANGE = 0.01
MOST_REWEIGHTINGS = 20  # adjustments until the components settle (chosen)
UNCERTAIN = 0.3
"""Relative standard deviation of a factor above which weights stay as they are."""
LARGEST_CHANGE = 100.0  # of a variance in one round, either way (chosen): no weight runs away
NAMED_SIGMAS, NAMED_FACTOR = 3.0, 1.3
"""Standard deviations, and factor of the variance either way, from which on a kind is named."""


@dataclass(frozen=True)
class Factor:
    """What is found of the variances of one kind of observations.

    Parameters
    ----------
    name : str
        The kind.
    observations : int
        Their number.
    redundancy : float
        Sum of their redundancy numbers.
    factor : float
        Of the stated variances; of a kind that was not re-weighted the component that it has beside
        the others' new weights. NaN without redundancy.
    sigma : float
        Standard deviation of the factor; infinite without redundancy.
    reweighted : bool
        Whether weights were divided by it.
    """

    name: str
    observations: int
    redundancy: float
    factor: float
    sigma: float
    reweighted: bool

    @property
    def differs(self) -> bool:
        """Whether the errors are certainly not those stated."""
        if not self.reweighted:
            return False
        far = abs(self.factor - 1.0) > NAMED_SIGMAS * self.sigma
        return far and not 1.0 / NAMED_FACTOR < self.factor < NAMED_FACTOR


@dataclass(frozen=True, eq=False)
class Reweighted:
    """An adjustment whose weights agree with its residuals.

    Parameters
    ----------
    precision : Precision
        The adjustment, with weights divided by the factors, and unit variance.
    factors : tuple of Factor
        Of image observations of each camera, then of groups by name.
    converged : bool
        Whether the last round changed no factor by more than 1 %.
    """

    precision: Precision
    factors: tuple[Factor, ...]
    converged: bool

    def sentences(self) -> list[str]:
        """Return what a person should know.

        Returns
        -------
        list of str
            Kinds whose errors are not those stated, kinds that could not be judged, and whether the
            factors had settled; none where all is as stated.
        """
        out = []
        for f in self.factors:
            if f.differs:
                side = "larger" if f.factor > 1.0 else "smaller"
                out.append(
                    f"{f.name}: errors are {side} than stated, their variances {f.factor:.2g} +-"
                    f" {f.sigma:.1g} times (standard deviations {np.sqrt(f.factor):.2g} times);"
                    " weights follow the residuals"
                )
            elif not f.reweighted:
                out.append(
                    f"{f.name}: {f.redundancy:.1f} redundant observations of {f.observations} are"
                    f" too few to judge their variances (at least {2.0 / UNCERTAIN**2:.0f});"
                    " weights stay as stated"
                )
        if not self.converged:
            out.append(
                f"variance components have not settled to {100 * ENOUGH_CHANGE:.0f} % in"
                f" {MOST_REWEIGHTINGS} rounds; take the factors as a rough sign"
            )
        return out


def reweighted(
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
        As `adjusted`.
    """
    product: dict[str, float] = {}
    trusted: set[str] | None = None
    of_images = image_components(problem.block)
    for _ in range(MOST_REWEIGHTINGS):
        current = with_factors(problem, product)
        result = adjusted(current, values)
        point = np.where(np.isnan(result.values.point), values.point, result.values.point)
        values = result.values.with_points(point)
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
            return Reweighted(precision, _factors(components, product, trusted), True)
        for name, variance in change.items():
            step = min(max(variance, 1.0 / LARGEST_CHANGE), LARGEST_CHANGE)
            product[name] = product.get(name, 1.0) * step
    return Reweighted(precision, _factors(components, product, trusted or set()), False)


def _relative(component: Component) -> float:
    """Return the relative standard deviation of a component."""
    return np.sqrt(2.0 / component.redundancy) if component.redundancy > 1e-6 else np.inf


def _factors(
    components: Sequence[Component], product: dict[str, float], trusted: set[str]
) -> tuple[Factor, ...]:
    out = []
    for c in components:
        factor = product.get(c.name, 1.0) if c.name in trusted else c.variance
        sigma = float(factor * _relative(c)) if np.isfinite(factor) else np.inf
        out.append(Factor(c.name, c.observations, c.redundancy, factor, sigma, c.name in trusted))
    return tuple(out)


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
    of_block = block.observations
    sigma = of_block.sigma_px * np.sqrt(factor)[:, None]
    observations = ImageObservations(of_block.image, of_block.point, of_block.uv, sigma)
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
