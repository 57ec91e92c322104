"""The evidence that a variance of the flight is wrong: whose noise is larger than its model says.

Errors that are no constants show in the size and the colour of the innovations. Each family below
scales root densities or sigmas by factors f = exp(theta), of gyros and of accelerometers by
themselves, and competes by the likelihood of all measured triples (L.4):

    IMU white noise     vibration, and the noise of a flight beside that of a laboratory
    IMU bias noise      what drives random walks and Gauss-Markov processes: temperature
    IMU noise           both
    GNSS sigmas         of positions and of velocities

At theta = 0, with gradient g and expected second derivative A of -2 log L (L.5), a family promises
the gain

    g' A^-1 g / 2                                                                              (V.1)

(Rao's score test); only where one promises more than `LEAST_PROMISE` its maximum is looked for.
With p factors and n scalar innovations the logarithm of its evidence against the flight file is
then

    gain / 2 - p log(n) / 2                                                                    (V.2)

(Schwarz 1978), on the one scale with constants (D.2) and with a time-correlated error of the fixes.

Factors of the IMU are adopted in both directions: a model drafted from a recording in vibration is
many times too large. What is below one is adopted at its upper limit of `CERTAIN` sigmas, so that a
factor that the flight does not determine stays one. Fixes that are better than they claim would
have the IMU's noise taken for too large as well: where their factor wins and is below one, those of
the IMU are looked for beside it, and theirs alone are adopted, since an error that stays for
minutes is part of what a fix claims and leaves no trace in innovations.

A time-correlated error that is neither shown nor excluded is carried in the covariance. With w_i
the probabilities of shares c_i and correlation times T_i, all together a priori as probable as none
(c = 0), what is carried has the variance, and the rate at which it moves, of their mean:

    c^2 = sum w_i c_i^2,     c^2 / T = sum w_i c_i^2 / T_i                                     (V.3)

(Hoeting et al. 1999 on averages over models).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from ...records import Array
from ..filter.layout import FixErrors, StateLayout
from ..filter.solution import Solution
from ..innovations.likelihood import (
    Evaluated,
    available,
    evaluate,
    linear_segment,
)
from ..innovations.search import Maximum, Search
from .candidates import OF_GNSS, ErrorModel, LayoutFactory, with_time_correlated_error
from .evidence import linearised, linearised_cost, liveliest_part

FAMILIES = {
    "IMU white noise": ("gyro.white_noise", "accel.white_noise"),
    "IMU bias noise": ("gyro.driving_noise", "accel.driving_noise"),
    OF_GNSS: ("fixes.position", "fixes.velocity"),
}
OF_IMU = ("IMU white noise", "IMU bias noise")
LEAST_PROMISE = 30.0  # promised gain in -2 log L from which the maximum of a family is looked for
MOST_FIXES = 3000  # of the part that is looked at: five minutes at 10 Hz
# gain of a slow error of the fixes, one parameter: from there on noise does it in one of 500
LEAST_SLOW, DOUBTFUL = 8.0, 2.0
# the same, from which on it is not excluded: noise does it in one flight of thirty
LEAST_AVERAGED = 2.5
LEAST_SPAN = 3.0  # correlation times, below which no slow error is determined
SLOW_FIRST, SHARES, SLOW_S = (0.5, 60.0), (0.5, 1.0, 1.5), (20.0, 60.0, 120.0, 300.0)
# change of a logarithm, and gain in -2 log L, at which a search ends: 0.1, since its last step, of
# quadratic convergence, leaves some per cent of a noise and at most a third of its sigma
SETTLED = 0.1
CERTAIN = 2.0  # sigmas of a factor below one, to whose upper limit it is adopted


@dataclass(frozen=True)
class VarianceHypothesis:
    """A family of variances that is suspected.

    Parameters
    ----------
    family : str
        One of `FAMILIES`.
    evidence : float
        Logarithm of its evidence against the flight file's variances (V.2).
    factors : dict of str to float
        Factors of root densities and sigmas by parameter.
    upper : dict of str to float
        Upper limits of factors below one; one that is not there is not determined.
    """

    family: str
    evidence: float
    factors: dict[str, float]
    upper: dict[str, float] = field(default_factory=dict)

    def of_imu(self, name: str) -> float:
        """Return the factor of a noise of the IMU that is adopted."""
        factor = self.factors.get(name, 1.0)
        return factor if factor >= 1.0 else self.upper.get(name, 1.0)


class VarianceSearch:
    """The search for variances that explain the innovations of a solution better than its own.

    Parameters
    ----------
    solution : Solution
        The solved flight; of a long one the liveliest `MOST_FIXES` fixes are looked at.
    progress : callable
        Receives the name of each step.
    """

    def __init__(self, solution: Solution, progress: Callable[[str], None]) -> None:
        self.part = liveliest_part(solution, MOST_FIXES)
        problem = self.part.problem
        names = available(problem.layout, bool(problem.epochs.has_velocity.any()))
        self.families = {
            family: own
            for family, parameters in FAMILIES.items()
            if (own := tuple(name for name in parameters if name in names))
        }
        self.names = tuple(dict.fromkeys(name for own in self.families.values() for name in own))
        self.segment, self.progress = linear_segment(self.part, self.names), progress
        self.nothing = self._evaluated({})

    def _evaluated(self, factors: dict[str, float]) -> Evaluated:
        """Evaluate the likelihood, with every slope, at some factors."""
        theta = np.log([factors.get(name, 1.0) for name in self.names])
        return evaluate([self.segment], theta)

    def promising(self) -> tuple[str, ...]:
        """Return the families that promise more than `LEAST_PROMISE` (V.1)."""
        g, A = self.nothing.gradient, self.nothing.information
        return tuple(
            family for family in self.families if _promise(g, A, self._free(family)) > LEAST_PROMISE
        )

    def left(self, families: Sequence[str] = tuple(FAMILIES)) -> float:
        """Return the largest gain that some families still promise (V.1).

        Parameters
        ----------
        families : sequence of str
            Some of `FAMILIES`.

        Returns
        -------
        float
            The gain, zero without any.
        """
        g, A = self.nothing.gradient, self.nothing.information
        chosen = [family for family in self.families if family in families]
        return max((_promise(g, A, self._free(family)) for family in chosen), default=0.0)

    def strongest(self) -> VarianceHypothesis | None:
        """Return the promising family of the largest positive evidence (V.2), or None."""
        hypotheses = [self._hypothesis(family) for family in self.promising()]
        best = max(hypotheses, key=lambda one: one.evidence, default=None)
        fixes: dict[str, float] = {}
        if best is not None and best.family == OF_GNSS and max(best.factors.values()) < 1.0:
            fixes, best = best.factors, self._beside(best)
        if best is None or best.evidence <= 0.0:
            return None
        return best if best.family == OF_GNSS else self._limited(best, fixes)

    def _limited(self, best: VarianceHypothesis, fixes: Mapping[str, float]) -> VarianceHypothesis:
        """Return a hypothesis with upper limits of its factors below one, the others held.

        Such a factor may have no maximum above nothing, so that its limit is where -2 log L has
        risen by the square of `CERTAIN`.
        """
        best_factors = {**fixes, **best.factors}

        def cost(**other: float) -> float:
            return self._evaluated({**best_factors, **other}).cost

        most, upper = cost() + CERTAIN**2, {}
        for name, factor in best.factors.items():
            if factor >= 1.0 or cost(**{name: 1.0}) <= most:
                continue
            low, high = np.log(factor), 0.0
            while high - low > SETTLED:
                middle = 0.5 * (low + high)
                inside = cost(**{name: float(np.exp(middle))}) <= most
                low, high = (middle, high) if inside else (low, middle)
            upper[name] = float(np.exp(high))
        return replace(best, upper=upper)

    def _beside(self, better: VarianceHypothesis) -> VarianceHypothesis | None:
        """Return the strongest family of the IMU beside fixes that are better than they claim."""
        there = self._evaluated(better.factors)
        g, A = there.gradient, there.information
        hypotheses = [
            self._hypothesis(family, better.factors, there)
            for family in self.families
            if family != OF_GNSS and _promise(g, A, self._free(family)) > LEAST_PROMISE
        ]
        return max(hypotheses, key=lambda one: one.evidence, default=None)

    def slow_error(self, layout_factory: LayoutFactory, errors: FixErrors) -> FixErrors | None:
        """Find an error of the fixes that is too slow, or too small, for the search of its shares.

        Of the size that the fixes claim, or half of it, beside their white error: one number, the
        correlation time, is looked for on a grid by the likelihood of the part.

        Parameters
        ----------
        layout_factory : LayoutFactory
            The error states as a function of those of the fixes.
        errors : FixErrors
            The errors of the fixes that are estimated already.

        What gains less than `LEAST_SLOW`, and more than `LEAST_AVERAGED`, is neither shown nor
        excluded: then the average over the grid and no such error at all is carried (V.3).

        Returns
        -------
        FixErrors or None
            `errors` with the time-correlated one; None where the flight speaks against it.
        """

        cost = linearised_cost(self.part, layout_factory)

        def gain(share: float, time_s: float) -> float:
            model = with_time_correlated_error(errors, 1.0, share, time_s)
            return float(self.nothing.cost - cost(model))

        time = self.part.problem.epochs.time
        if time[-1] - time[0] < LEAST_SPAN * SLOW_FIRST[1] or gain(*SLOW_FIRST) < LEAST_AVERAGED:
            return None
        gains = {(share, time_s): gain(share, time_s) for share in SHARES for time_s in SLOW_S}
        best = max(gains, key=lambda one: gains[one])
        if gains[best] < LEAST_SLOW:
            return with_time_correlated_error(errors, 1.0, *_averaged(gains))
        # the largest that is as good: the fixes tell c^2 / T better than c
        share, time_s = max(one for one in gains if gains[one] > gains[best] - DOUBTFUL)
        return with_time_correlated_error(errors, 1.0, share, time_s)

    def evidence_of(self, errors_layout: StateLayout, parameters: int) -> float:
        """Return the log evidence (V.2) of the same flight with other states of its fixes.

        Parameters
        ----------
        errors_layout : StateLayout
            The states of the solution and others, which start at zero.
        parameters : int
            Number of variances and correlation times that were estimated for it.

        Returns
        -------
        float
            Against the layout of the solution.
        """
        other = evaluate([linearised(self.part, errors_layout)], np.zeros(0))
        return self._evidence(other.cost, parameters)

    def _hypothesis(
        self,
        family: str,
        beside: Mapping[str, float] = MappingProxyType({}),
        base: Evaluated | None = None,
    ) -> VarianceHypothesis:
        """Find the maximum of a family; factors `beside`, at which `base` is, vary as well."""
        base = self.nothing if base is None else base
        names = (*self.families[family], *beside)
        index = [self.names.index(name) for name in names]
        start = replace(
            base, gradient=base.gradient[index], information=base.information[np.ix_(index, index)]
        )
        theta = np.log([beside.get(name, 1.0) for name in names])
        free = np.ones(len(names), dtype=np.bool_)
        search = Search([self.segment.only(names)], names, self.progress, settled=SETTLED)
        self.progress(f"likelihood of the innovations, {len(names)} factors")
        maximum = search.climb(Maximum(theta, start), free)
        factors = dict(zip(names, np.exp(maximum.theta).tolist(), strict=True))
        factors = {name: factors[name] for name in self.families[family]}
        return VarianceHypothesis(
            family,
            self._evidence(maximum.evaluated.cost, len(factors), base.cost),
            factors,
        )

    def _evidence(self, cost: float, parameters: int, base: float | None = None) -> float:
        gain = (self.nothing.cost if base is None else base) - cost
        return float(0.5 * gain - 0.5 * parameters * np.log(3.0 * self.nothing.offered))

    def _free(self, family: str) -> np.ndarray:
        return np.array([name in self.families[family] for name in self.names])


def _averaged(gains: dict[tuple[float, float], float]) -> tuple[float, float]:
    """Average share and correlation time (V.3) over their gains in -2 log L."""
    share, time_s = np.array(list(gains)).T
    likelihood = np.exp(0.5 * np.array(list(gains.values()))) / len(gains)
    weight = likelihood / (1.0 + likelihood.sum())
    variance = float(weight @ share**2)
    return float(np.sqrt(variance)), variance / float(weight @ (share**2 / time_s))


def _promise(gradient: Array, information: Array, free: np.ndarray) -> float:
    """Return the gain that the free parameters promise (V.1)."""
    A, g = information[np.ix_(free, free)], gradient[free]
    scale = np.sqrt(np.maximum(np.diag(A), 1e-12))
    b, M = g / scale, A / np.outer(scale, scale) + 1e-9 * np.eye(g.size)
    return float(0.5 * b @ np.linalg.solve(M, b))


def with_variances(model: ErrorModel, suspected: VarianceHypothesis) -> ErrorModel | None:
    """Return an error model with variances as a hypothesis has them.

    Parameters
    ----------
    model : ErrorModel
        What is estimated already.
    suspected : VarianceHypothesis
        The factors.

    Returns
    -------
    ErrorModel or None
        The model; None where nothing changes: fixes are better than they claim, which their user
        may have reasons for, or the flight does not determine a smaller noise.
    """
    factors = suspected.factors
    if suspected.family == OF_GNSS:
        k, of_velocity = factors["fixes.position"], factors.get("fixes.velocity", 1.0)
        if max(k, of_velocity) <= 1.0:
            return None
        k, of_velocity = max(k, 1.0), max(of_velocity, 1.0)
        fixes = model.fixes
        return replace(
            model,
            fixes=replace(
                fixes,
                white_scale=tuple(k * x for x in fixes.white_scale),
                unfixed_white_scale=k * fixes.unfixed_white_scale,
                velocity_white_scale=of_velocity * fixes.velocity_white_scale,
            ),
        )
    white = suspected.family == "IMU white noise"
    kind = "white_noise" if white else "driving_noise"
    present = model.imu.white_noise if white else model.imu.driving_noise
    gyro, accel = (suspected.of_imu(f"{triad}.{kind}") for triad in ("gyro", "accel"))
    if gyro == accel == 1.0:
        return None
    pair = (gyro * present[0], accel * present[1])
    imu = replace(model.imu, white_noise=pair) if white else replace(model.imu, driving_noise=pair)
    return replace(model, imu=imu)
