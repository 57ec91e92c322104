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
The factor of the positions' sigmas has a prior by the source that states them: its mean a
posteriori takes the place of the maximum, and the integral over the prior that of log(n) / 2
(`base.findings.scale_prior.ScalePrior`).

Innovations tell c^2 / T of a time-correlated error of the fixes, the rate at which it moves, and
not its share c: an error of 1 cm over 20 s, one of 2 cm over 60 s and noise that looks like either
are one to them. What is carried in the covariance hence is a mean over models, not the best of
them. With w_i the probabilities of shares c_i and correlation times T_i, a priori those of `SHARES`
and `SLOW_S`, and all together as probable as none (c = 0), it has the variance, and the rate, of
their mean:

    c^2 = sum w_i c_i^2,     c^2 / T = sum w_i c_i^2 / T_i                                     (V.3)

(Hoeting et al. 1999 on averages over models).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...records import Array
from ..filter.layout import FixErrors, StateLayout
from ..filter.solution import Solution
from ..innovations.likelihood import (
    CORRELATED,
    LinearSegment,
    available,
    evaluate,
    linear_segment,
)
from ..innovations.search import LAST_GAIN, Maximum, Search
from .candidates import (
    ErrorModel,
    LayoutFactory,
    only_code_fixes,
    with_larger_white_share,
    with_time_correlated_error,
)
from .evidence import NO_CLAIMS, FixClaims, liveliest_part
from .time_correlated import LEAST_WHITE, LONGEST_WINDOW_S, beyond_claim

BIAS_NOISE = "IMU bias noise"
POSITION_SIGMAS = "fixes.position"  # the parameter that has a prior
FAMILIES = {
    "IMU white noise": ("gyro.white_noise", "accel.white_noise"),
    BIAS_NOISE: ("gyro.driving_noise", "accel.driving_noise"),
    "GNSS sigmas": (POSITION_SIGMAS, "fixes.velocity"),
}
OF_IMU = ("IMU white noise", BIAS_NOISE)
LEAST_PROMISE = 30.0  # promised gain in -2 log L from which the maximum of a family is looked for
MOST_FIXES_JUDGED = 3000  # of the part that is looked at: five minutes at 10 Hz
LEAST_AVERAGED = 2.5  # gain of an error that excludes none: noise does it in one flight of thirty
NO_WEIGHT = 20.0  # loss in -2 log L from which on a share, and any larger one, weighs e^-10
LEAST_SPAN = 3.0  # correlation times, below which no slow error is determined
SLOW_FIRST = (0.5, 60.0)  # share and correlation time (s) that are looked at first
NO_STEP = 0.02  # log of the white factor, up to which (V.1) is exact to 0.2 for 3000 fixes
# a-priori probabilities of the share of the white error: beside 1 to 2 cm of noise carrier-phase
# multipath has some 5 mm, rarely as much as the noise; positions 4 cm off under 2 cm occur
SHARES = {0.25: 0.45, 0.5: 0.35, 1.0: 0.15, 1.5: 0.04, 2.0: 0.01}
# those of its correlation time, s: of RTK over short baselines about 115 s at rest (Miller, O'Keefe
# and Gao 2012), less in motion, which changes the reflections; 800 to 1000 s of a network's
# corrections, which a flight of minutes does not tell from an error of the base: 132 s in the mean
SLOW_S = {20.0: 0.15, 60.0: 0.3, 120.0: 0.3, 300.0: 0.25}
# both where the innovations show an error. Seconds, of a receiver's filter, are taken where slower
# errors lose by some 14 in -2 log L (planted ones of 60 s have lost by up to 10), ten minutes are
# the ionosphere's; what is shown is larger as a rule, up to some claims; from six on hardly rarer,
# since whoever exceeds a claim by so much does not know its errors (chosen)
EVERY_S = {1.0: 3e-4, 5.0: 3e-4, **SLOW_S, LONGEST_WINDOW_S: 0.03}
EVERY_SHARE = {0.5: 0.35, 1.0: 0.2, 1.5: 0.1, 3.0: 0.05, 6.0: 0.03, 12.0: 0.02}
NARROW_BELOW = 0.7  # factor below which sigmas are narrowed: nearer to one is as usual (chosen)
# correlation times (s) and shares, in sigmas, of errors that would look like smaller sigmas: of a
# receiver's filter, of multipath (`SLOW_S`), of what Doppler shares with the ionosphere; and how
# many of the times a flight has to determine
HIDDEN_S, HIDDEN_SHARES, FEWEST_TIMES = (1.0, 5.0, 20.0, 60.0, 120.0), (0.25, 0.5), 3
EXCLUDED = 6.0  # loss in -2 log L that excludes an error, by odds of 20 to 1
LEAST_AVERAGED_S = 3.0  # correlation time (s): shorter ones are of a receiver's filter (1 to 2 s)
LARGEST_STEP = 0.5  # of the logarithm of a share, from the same c^2 / T to its best
ONE_START = (0.0,)  # of the logarithms of the IMU's factors


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
    narrowed : tuple of str
        Parameters with a factor below one, of whose errors the flight excludes that they last.
    """

    family: str
    evidence: float
    factors: dict[str, float]
    narrowed: tuple[str, ...] = ()

    @property
    def of_fixes(self) -> dict[str, float]:
        """Factors of positions and velocities as they are adopted.

        Sigmas are lowered where they are `narrowed` alone: otherwise the user may have reasons.
        """
        stated = {name: self.factors.get(name, 1.0) for name in FAMILIES["GNSS sigmas"]}
        return {name: k if name in self.narrowed else max(1.0, k) for name, k in stated.items()}


class VarianceSearch:
    """The search for variances that explain the innovations of a solution better than its own.

    Parameters
    ----------
    solution : Solution
        The solved flight; of a long one the liveliest `MOST_FIXES_JUDGED` fixes are looked at.
    progress : callable
        Receives the name of each step.
    claims : FixClaims
        What is known beforehand of the sigmas of the fixes.
    """

    def __init__(
        self,
        solution: Solution,
        progress: Callable[[str], None],
        claims: FixClaims = NO_CLAIMS,
    ) -> None:
        self.prior = claims.scale
        self.part = liveliest_part(solution, MOST_FIXES_JUDGED)
        problem = self.part.problem
        names = available(problem.layout, bool(problem.epochs.has_velocity.any()))
        self.families = {
            family: some
            for family, parameters in FAMILIES.items()
            if (some := tuple(name for name in parameters if name in names))
        }
        self.names = tuple(dict.fromkeys(name for some in self.families.values() for name in some))
        segment = linear_segment(self.part, self.names)
        self.nothing = evaluate([segment], np.zeros(len(self.names)))
        # the segment, 9 kB a fix, stays only where a maximum is looked for
        segments = [segment] if self.promising() else []
        self.search = Search(segments, self.names, progress, gain=LAST_GAIN)

    def promising(self) -> tuple[str, ...]:
        """Return the families that promise more than `LEAST_PROMISE` (V.1)."""
        return tuple(one for one in self.families if self.left((one,)) > LEAST_PROMISE)

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
        best: VarianceHypothesis | None = None
        for family in sorted(self.promising(), key=lambda family: -self.left((family,))):
            one = self._hypothesis(family, max(0.0, best.evidence if best else 0.0))
            if one.evidence > (best.evidence if best else 0.0):
                best = one
        return best

    def narrowed(
        self, winner: VarianceHypothesis, layout_factory: LayoutFactory, errors: FixErrors
    ) -> VarianceHypothesis:
        """Tell which fixes are as much better than they claim as their innovations.

        Small innovations may be of an error that lasts. With k the white share, errors of the
        shares `HIDDEN_SHARES` and of all that k leaves of the claim, sqrt(1 - k^2), over each of
        `HIDDEN_S` that the flight determines, stand beside none: none of them may gain, and the
        last ones are to be excluded.

        Parameters
        ----------
        winner : VarianceHypothesis
            The strongest family.
        layout_factory : LayoutFactory
            The error states as a function of those of the fixes.
        errors : FixErrors
            The errors of the fixes that are estimated already.

        Returns
        -------
        VarianceHypothesis
            The same with the parameters that are `narrowed`.
        """
        factor = {name: winner.factors.get(name, 1.0) for name in FAMILIES["GNSS sigmas"]}
        k, v = (one if one < NARROW_BELOW else max(1.0, one) for one in factor.values())
        white = with_larger_white_share(errors, k, v)
        may_hide = {"fixes.position": errors.gm_sigma is None, "fixes.velocity": v < 1.0}
        may_hide["fixes.velocity"] &= errors.velocity_gm_sigma_mps is None
        return replace(
            winner,
            narrowed=tuple(
                name
                for name, possible in may_hide.items()
                if possible
                and factor[name] < NARROW_BELOW
                and not self._lasts(name, factor[name], layout_factory, white)
            ),
        )

    def _lasts(self, name: str, k: float, layout_factory: LayoutFactory, white: FixErrors) -> bool:
        """Tell whether an error may last that looks like white errors of the share k."""
        epochs = self.part.problem.epochs

        def cost(errors: FixErrors) -> float:
            return evaluate(
                [_linearise_in_layout(self.part, layout_factory(errors))], np.zeros(0)
            ).cost

        def with_hidden(share: float, time_s: float) -> FixErrors:
            if name == "fixes.position":
                return replace(white, gm_sigma=(share,) * 3, correlation_time_s=time_s)
            variance = np.diagonal(epochs.velocity_cov[epochs.has_velocity], axis1=1, axis2=2)
            sigma_mps = share * float(np.sqrt(np.median(variance)))
            return replace(
                white, velocity_gm_sigma_mps=sigma_mps, velocity_correlation_time_s=time_s
            )

        determined_s = float(epochs.time[-1] - epochs.time[0]) / LEAST_SPAN
        times = [time_s for time_s in HIDDEN_S if time_s <= determined_s]
        least, claim = cost(white), float(np.sqrt(1.0 - k**2))
        limits = {claim: -EXCLUDED, **dict.fromkeys(HIDDEN_SHARES, LEAST_AVERAGED)}
        return len(times) < FEWEST_TIMES or any(
            least - cost(with_hidden(share, time_s)) > limit
            for time_s in times
            for share, limit in limits.items()
        )

    def slow_error(self, layout_factory: LayoutFactory, errors: FixErrors) -> FixErrors | None:
        """Find an error of the fixes that is too slow, or too small, for the search of its shares.

        It stands beside their white error at its best size: a claim a tenth off would hide it. What
        is carried is the average (V.3) over a grid and none at all.

        Parameters
        ----------
        layout_factory : LayoutFactory
            The error states as a function of those of the fixes.
        errors : FixErrors
            The errors of the fixes that are estimated already.

        Returns
        -------
        FixErrors or None
            `errors` with the time-correlated one; None where the flight speaks against it.
        """
        k, without = self._white_share(layout_factory, errors)
        noise = k * errors.white_scale[0]  # which the shares are of, whatever the fixes claim

        def gains(time_s: float, shares: Sequence[float]) -> dict[tuple[float, float], float]:
            layout = layout_factory(with_time_correlated_error(errors, k, noise, time_s))
            segment = _linearise_in_layout(
                self.part, layout, (CORRELATED, POSITION_SIGMAS)
            )  # for all
            of_time: dict[tuple[float, float], float] = {}
            for c in shares:
                if min(of_time.values(), default=0.0) > -NO_WEIGHT:
                    of_time[c, time_s] = without - _least_cost(segment, np.array([np.log(c), 0.0]))
            return of_time

        time = self.part.problem.epochs.time
        c, T = SLOW_FIRST
        if time[-1] - time[0] < LEAST_SPAN * T or gains(T, (c,))[SLOW_FIRST] < 0.0:
            return None
        every = {key: gain for T in SLOW_S for key, gain in gains(T, tuple(SHARES)).items()}
        share, time_s = _average_shares(every, SHARES, SLOW_S)
        return with_time_correlated_error(errors, k, share * noise, time_s)

    def _white_share(self, layout_factory: LayoutFactory, errors: FixErrors) -> tuple[float, float]:
        """Return the factor of the fixes' white error without a slow one, and -2 log L with it."""
        index = self.names.index(POSITION_SIGMAS)
        g, A = self.nothing.gradient[index], self.nothing.information[index, index]
        step = -float(g / A)
        if abs(step) < NO_STEP:
            return 1.0, self.nothing.cost - 0.5 * float(g**2 / A)
        k = float(np.sqrt(max(LEAST_WHITE**2, 1.0 + 2.0 * step)))  # a variance is found at once
        layout = layout_factory(with_larger_white_share(errors, k))
        segment = _linearise_in_layout(self.part, layout, (POSITION_SIGMAS,))
        return k, _least_cost(segment, np.zeros(1))

    def averaged(self, layout_factory: LayoutFactory, errors: FixErrors) -> FixErrors:
        """Average a time-correlated error over the correlation times of the same c^2 / T (V.3).

        Neither the innovations nor the claim tells how far the error goes: PPK that claims 2 cm may
        wander by 4, and what the claim leaves beside its white share is no bound.

        Parameters
        ----------
        layout_factory : LayoutFactory
            The error states as a function of those of the fixes.
        errors : FixErrors
            The errors of the fixes with the time-correlated one, whose rate c^2 / T is right.

        Returns
        -------
        FixErrors
            The same with other share and correlation time; itself where code solutions state errors
            that last, and for errors of a receiver's filter, which innovations do tell.
        """
        code = only_code_fixes(self.part.problem)
        if errors.gm_sigma is None or (code and not beyond_claim(errors)):
            return errors
        first, first_s = errors.gm_sigma[0], errors.correlation_time_s
        if first_s < LEAST_AVERAGED_S:
            return errors

        def moved(share: float, time_s: float) -> FixErrors:
            sigma = tuple(share / first * one for one in errors.gm_sigma or ())
            return replace(errors, gm_sigma=sigma, correlation_time_s=time_s)

        gains: dict[tuple[float, float], float] = {}
        for time_s in EVERY_S:  # whichever was found: one reality, one sigma
            share, free = first * float(np.sqrt(time_s / first_s)), np.ones(1, bool)
            layout = layout_factory(moved(share, time_s))
            segment = [_linearise_in_layout(self.part, layout, (CORRELATED,))]
            near = evaluate(segment, np.zeros(1), free)  # one step of the scoring to the best share
            step = np.clip(-near.gradient / near.information[0], -LARGEST_STEP, LARGEST_STEP)
            best = evaluate(segment, step, np.zeros(1, bool)).cost
            share *= float(np.exp(step[0])) if best <= near.cost else 1.0
            gains[share, time_s] = self.nothing.cost - min(best, near.cost)
        # where the part speaks against each of them nothing is left to average
        return moved(*_average_shares(gains)) if max(gains.values()) > 0.0 else errors

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
        other = evaluate([_linearise_in_layout(self.part, errors_layout)], np.zeros(0))
        return self._evidence(other.cost, parameters)

    def _hypothesis(self, family: str, to_beat: float) -> VarianceHypothesis:
        """Maximise over a family; below the evidence `to_beat` the search ends before."""
        free = self._free(family)
        cost = self.nothing.cost - 2.0 * to_beat - self._penalty(int(free.sum()))
        maximum = self.search.maximum(free, ONE_START, cost)
        logs, loss, parameters = self._posterior(maximum, free)
        theta = dict(zip(self.names, np.exp(logs).tolist(), strict=True))
        factors = {name: theta[name] for name in self.families[family]}
        evidence = self._evidence(maximum.evaluated.cost, parameters) - loss
        return VarianceHypothesis(family, evidence, factors)

    def _posterior(self, maximum: Maximum, free: np.ndarray) -> tuple[Array, float, int]:
        """Return logarithms of the factors a posteriori, the prior's loss, and how many have none.

        What is estimated with the factor that has a prior moves along by its covariance.
        """
        position = np.array([name == POSITION_SIGMAS for name in self.names])
        if not (free & position).any() or np.isinf(self.prior.width):
            return maximum.theta, 0.0, int(free.sum())
        p = int(np.flatnonzero(position)[0])
        sigma, correlation = maximum.spread(free)
        mean, loss = self.prior.posterior(float(maximum.theta[p]), float(sigma[p] ** 2))
        moved = (mean - maximum.theta[p]) * correlation[:, p] * sigma / sigma[p]
        return maximum.theta + moved, loss, int(free.sum()) - 1

    def _evidence(self, cost: float, parameters: int) -> float:
        return 0.5 * (self.nothing.cost - cost - self._penalty(parameters))

    def _penalty(self, parameters: int) -> float:
        """Return the gain in -2 log L that so many parameters must bring (V.2)."""
        return float(parameters * np.log(3.0 * self.nothing.offered))

    def _free(self, family: str) -> np.ndarray:
        return np.array([name in self.families[family] for name in self.names])


def _average_shares(
    gains: dict[tuple[float, float], float],
    shares: dict[float, float] = EVERY_SHARE,
    times: dict[float, float] = EVERY_S,
) -> tuple[float, float]:
    """Average share and correlation time (V.3) over their gains in -2 log L and the odds a priori
    of both.
    """
    share, time_s = np.array(list(gains)).T
    prior = _prior(share, shares) * _prior(time_s, times)
    half_gain = 0.5 * np.array(list(gains.values()))
    largest = max(0.0, float(half_gain.max()))
    likelihood = prior * np.exp(half_gain - largest)
    weight = likelihood / (np.exp(-largest) + likelihood.sum())
    variance = float(weight @ share**2)
    return float(np.sqrt(variance)), variance / float(weight @ (share**2 / time_s))


def _prior(values: Array, table: dict[float, float]) -> Array:
    """Interpolate a-priori probabilities in the logarithm, constant beyond the ends."""
    return np.interp(np.log(values), np.log(list(table)), list(table.values()))


def _linearise_in_layout(
    solution: Solution, layout: StateLayout, names: Sequence[str] = ()
) -> LinearSegment:
    """Linearise about the solution with the states of another layout at zero where they are new."""
    states = solution.problem.layout.states
    x = np.zeros((solution.x.shape[0], len(layout.states)))
    for s, state in enumerate(layout.states):
        if state in states:
            x[:, s] = solution.x[:, states.index(state)]
    other = replace(solution, problem=replace(solution.problem, layout=layout), x=x)
    return linear_segment(other, names)


def _least_cost(segment: LinearSegment, theta: Array) -> float:
    """Return -2 log L at the best of the last parameter, by a step of the scoring."""
    near = evaluate([segment], theta, np.arange(theta.size) == theta.size - 1)
    return near.cost - 0.5 * float(near.gradient[-1] ** 2 / near.information[-1, -1])


def _promise(gradient: Array, information: Array, free: np.ndarray) -> float:
    """Return the gain that the free parameters promise (V.1)."""
    A, g = information[np.ix_(free, free)], gradient[free]
    scale = np.sqrt(np.maximum(np.diag(A), 1e-12))
    b, M = g / scale, A / np.outer(scale, scale) + 1e-9 * np.eye(g.size)
    return float(0.5 * b @ np.linalg.solve(M, b))


def with_variances(
    model: ErrorModel,
    suspected: VarianceHypothesis,
    drafted: bool = False,
) -> ErrorModel | None:
    """Return an error model with variances as a hypothesis has them.

    Parameters
    ----------
    model : ErrorModel
        What is estimated already.
    suspected : VarianceHypothesis
        The factors.
    drafted : bool
        Whether nobody states the noise of the IMU: a draft is a class's, and may be too large.

    Returns
    -------
    ErrorModel or None
        The model; None where noise is smaller than it is stated, which its user may have reasons
        for, but of fixes that are `narrowed`.
    """
    if suspected.family == "GNSS sigmas":
        of_fixes = list(suspected.of_fixes.values())
        if all(factor == 1.0 for factor in of_fixes):
            return None
        return replace(model, fixes=with_larger_white_share(model.fixes, *of_fixes))
    stated = [suspected.factors.get(name, 1.0) for name in FAMILIES[suspected.family]]
    factors = [max(0.0 if drafted else 1.0, factor) for factor in stated]
    if not drafted and max(factors) <= 1.0:
        return None
    if suspected.family == BIAS_NOISE:
        gyro, accel = np.multiply(model.imu.driving_noise, factors).tolist()
        return replace(model, imu=replace(model.imu, driving_noise=(gyro, accel)))
    gyro, accel = np.multiply(model.imu.white_noise, factors).tolist()
    return replace(model, imu=replace(model.imu, white_noise=(gyro, accel)))
