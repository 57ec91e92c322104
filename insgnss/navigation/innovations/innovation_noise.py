"""Noise of the IMU in flight by maximum likelihood over the innovations of the filter.

The estimate comes with what is needed to judge it.

What is asked for (`IMU_PARAMETERS` parameters, a factor on a static model's root density, one a
triad) is
estimated together with what else shapes the innovations: the scale of the fixes' own sigmas, and of
their time-correlated error where it is a state. Fixes that claim too little would otherwise be
taken for a noisy IMU. `search` finds
the maximum. The static model is the maximum with the IMU's factors held at one
and everything else free; the gain between the two is chi-square of as many degrees of freedom as
factors where the static model holds. A factor known to worse than `KNOWN_SIGMA` that may as well be
one, and a factor at the edge of the search, are not determined by this flight: they are held at one
and the others are estimated again. What -2 log L loses by that is chi-square, too: a significant
loss says that the innovations ask for a noise that these factors do not have. Whiteness goes by the
autocorrelations r_l of the whitened innovations: at lag one, and by Ljung and Box's sum Q over L =
`LAGS` lags of n (n + 2) r_l^2 / (n - l), chi-square of L degrees of freedom, one for each
direction. With many fixes the least correlation is significant; how large it is, all lags together,
tells

    sqrt((Q - L) / n)                                                                          (N.2)
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...base.errors import DataError
from ...records import Array
from ..filter.solution import Solution
from .likelihood import (
    CORRELATED,
    FIX_PARAMETERS,
    IMU_PARAMETERS,
    Evaluated,
    available,
    evaluate,
    linear_segment,
)
from .pieces import FEWEST_FIXES_MOVING, SHORTEST_S
from .search import RANGE, Maximum, Search

ESTIMATED_BY_DEFAULT = ("gyro.white_noise", "accel.white_noise")
# sigma of a logarithm up to which a factor is known, and its sigmas from one that may be chance
KNOWN_SIGMA, ONE_SIGMAS = 0.3, 2.0
SIGNIFICANT_CHANCE = 1e-3  # chance that the innovations of a true static model ask for another
LAGS = 20  # of the test for whiteness: errors of fixes that stay for less than 20 of them show
LONGEST_MIN = 600.0  # of a flight that is proposed
OFF_CLAIM, OFF_SIGMAS = 0.1, 3.0  # of the fixes' scale from one, beyond which it is reported
WHITE_ENOUGH = 0.1  # of the autocorrelation at lag one, and of those of all lags together
CHANCE_OF_WHITE = 1e-3  # chance of white innovations below which those together count
# gain in -2 log L that a time-correlated error of the fixes must bring beside free noise of the IMU
GAIN_OF_CORRELATION = 20.0


@dataclass(frozen=True)
class Whiteness:
    """Tests of the whitened innovations north, east, down.

    Parameters
    ----------
    lag_one : ndarray, (3,)
        Autocorrelation at lag one.
    bound : float
        Its 99 % bound for white innovations.
    portmanteau, p_value : ndarray, (3,)
        Ljung and Box's sum and its probability.
    lags : int
        Number of lags in the sum.
    together : ndarray, (3,)
        Size of the correlation of all lags (N.2).
    """

    lag_one: Array
    bound: float
    portmanteau: Array
    p_value: Array
    lags: int
    together: Array


@dataclass(frozen=True)
class WhitenedInnovations:
    """What a noise makes of the innovations of the positions.

    Parameters
    ----------
    nis : float
        Mean normalised innovation squared (NIS) a degree of freedom, of the used fixes.
    fixes, rejected : int
        Number of fixes, and of those rejected.
    cost : float
        -2 log L.
    whiteness : Whiteness
        Tests of the whitened innovations.
    """

    nis: float
    fixes: int
    rejected: int
    cost: float
    whiteness: Whiteness


@dataclass(frozen=True)
class InFlightNoise:
    """Factors of the noise by a flight's innovations.

    Parameters
    ----------
    names : tuple of str
        Parameters that were estimated, the IMU's first.
    factor : ndarray, (p,)
        Their factors on the static model.
    log_sigma : ndarray, (p,)
        Standard deviations of the logarithms; 0 where the factor is held.
    correlation : ndarray, (p, p)
        Correlations of the logarithms.
    held : tuple of (str, str)
        IMU parameters that the flight does not determine, with the reason.
    gain : float
        Gain of -2 log L against the static model, under which it is chi-square of `free` degrees of
        freedom.
    free : int
        Number of factors that were estimated.
    chance : float
        Probability of the gain under the static model.
    before, after : WhitenedInnovations
        Innovations with the static model and with the estimated IMU, the fixes as they claim.
    at_best : WhitenedInnovations
        Innovations with everything as estimated.
    static_at_best : WhitenedInnovations
        Innovations with the static IMU and everything else as estimated with it.
    duration_s : float
        Length of the motion used, s.
    loss : float
        Loss of -2 log L by what is held.
    """

    names: tuple[str, ...]
    factor: Array
    log_sigma: Array
    correlation: Array
    held: tuple[tuple[str, str], ...]
    gain: float
    free: int
    chance: float
    before: WhitenedInnovations
    after: WhitenedInnovations
    at_best: WhitenedInnovations
    static_at_best: WhitenedInnovations
    duration_s: float
    loss: float = 0.0

    def sigma(self, name: str) -> float:
        """Return the standard deviation of a factor, 0 where it is held."""
        k = self.names.index(name)
        return float(self.factor[k] * self.log_sigma[k])

    def imu_factors(self) -> dict[str, float]:
        """Return the factor of each IMU parameter; one where it is held."""
        return {
            name: float(f)
            for name, f in zip(self.names, self.factor, strict=True)
            if name in IMU_PARAMETERS
        }

    @property
    def significant(self) -> bool:
        """Whether the static model makes such innovations with a chance below
        `SIGNIFICANT_CHANCE`.
        """
        return self.chance < SIGNIFICANT_CHANCE

    @property
    def white(self) -> bool:
        """Whether what was estimated leaves the innovations white.

        A model of the noise that holds does, one that stands in for another does not.
        """
        w = self.at_best.whiteness
        near = np.abs(w.lag_one).max() < max(WHITE_ENOUGH, w.bound)
        return bool(near and ((w.p_value > CHANCE_OF_WHITE) | (w.together < WHITE_ENOUGH)).all())

    @property
    def asks_for_more(self) -> bool:
        """Whether the innovations rule out what is held."""
        return _chance(self.loss, len(self.held)) < SIGNIFICANT_CHANCE

    @property
    def scaled(self) -> bool:
        """Whether the fixes' errors are significantly larger or smaller than claimed."""
        return bool(self._far.any())

    @property
    def off_claim(self) -> tuple[str, ...]:
        """Scales of the fixes' errors that are not one, by so much that it matters."""
        far = self._far & (np.abs(self.factor - 1.0) > OFF_CLAIM)
        return tuple(name for name, differs in zip(self.names, far, strict=True) if differs)

    @property
    def _far(self) -> np.ndarray:
        of_fixes = np.array([name not in IMU_PARAMETERS for name in self.names])
        return np.asarray(of_fixes & (np.abs(np.log(self.factor)) > OFF_SIGMAS * self.log_sigma))

    @property
    def compared(self) -> tuple[WhitenedInnovations, WhitenedInnovations]:
        """The innovations before and after as they describe the IMU.

        The fixes are as they claim or, where their errors are of another size, as estimated.
        """
        return (self.static_at_best, self.at_best) if self.scaled else (self.before, self.after)


def in_flight_noise(
    solutions: Sequence[Solution],
    parameters: Sequence[str] = ESTIMATED_BY_DEFAULT,
    progress: Callable[[str], None] = lambda _: None,
) -> InFlightNoise:
    """Estimate factors of the IMU's noise from solved segments in motion.

    Parameters
    ----------
    solutions : sequence of Solution
        The segments in motion, of one flight.
    parameters : sequence of str
        Parameters of `IMU_PARAMETERS` to estimate.
    progress : callable
        Takes a line on each step.

    Returns
    -------
    InFlightNoise
        The factors and what they make of the innovations.

    Raises
    ------
    UsageError
        For a parameter that the layout of states does not have.
    DataError
        For too short a flight.
    """
    duration = sum(float(s.time[-1] - s.time[0]) for s in solutions)
    if not solutions:
        raise DataError(
            f"no segment in motion of {SHORTEST_S:g} s and {FEWEST_FIXES_MOVING} fixes; the"
            f" innovations of a"
            " standing or very short recording say nothing of the noise in flight: use a flight,"
            " or `insgnss tune` on static recordings"
        )
    progress("linearise")
    present = available(
        solutions[0].problem.layout, all(s.problem.epochs.has_velocity.any() for s in solutions)
    )
    names = (*parameters, *(name for name in (*FIX_PARAMETERS, CORRELATED) if name in present))
    segments = [linear_segment(s, names) for s in solutions]
    search = Search(segments, names, progress)
    imu = np.array([name in IMU_PARAMETERS for name in names])
    static = search.maximum(~imu)
    held: dict[str, str] = {}
    whole = Maximum(static.theta, evaluate(segments, static.theta))
    minutes, every = _minutes(whole, duration / 60.0), np.inf
    while True:
        free = np.array([name not in held for name in names])
        best = search.maximum(free) if (free & imu).any() else static
        every = min(every, best.evaluated.cost)
        sigma, correlation = best.spread(free)
        unknown = {
            name: reason
            for i, name in enumerate(names)
            if imu[i]
            and free[i]
            and (reason := _untold(float(best.theta[i]), float(sigma[i]), float(minutes[i])))
        }
        if not unknown:
            break
        worst = max(unknown, key=lambda name: sigma[names.index(name)])
        held[worst] = unknown[worst]
    count = int(np.count_nonzero(free & imu))
    gain = max(static.evaluated.cost - best.evaluated.cost, 0.0)
    only_imu = np.where(imu, best.theta, 0.0)
    progress("innovations before and after")
    return InFlightNoise(
        names,
        np.exp(best.theta),
        sigma,
        correlation,
        tuple(held.items()),
        gain,
        count,
        _chance(gain, count),
        innovations(evaluate(segments, np.zeros(len(names)))),
        innovations(evaluate(segments, only_imu)),
        innovations(best.evaluated),
        innovations(static.evaluated),
        duration,
        best.evaluated.cost - every,
    )


def _minutes(static: Maximum, minutes: float) -> Array:
    """Return the lengths (p,), min, of such a flight that determine factors to `KNOWN_SIGMA`.

    The factors are near one; a length is infinite where that is no question of length.
    """
    sigma = static.spread(np.ones(static.theta.size, dtype=np.bool_))[0]
    longer = minutes * (sigma / KNOWN_SIGMA) ** 2
    return np.where((longer > minutes) & (longer < LONGEST_MIN), longer, np.inf)


def _untold(theta: float, sigma: float, minutes: float) -> str:
    """Return why a flight does not determine a factor, and how long a flight would; or nothing."""
    longer = (
        f"; a factor near one would be determined by {np.ceil(minutes):.0f} min of such a flight"
        if np.isfinite(minutes)
        else ""
    )
    if not abs(theta) < np.log(RANGE[1]) - 1e-6:
        return (
            f"no maximum of the likelihood between 1/{RANGE[1]:g} and {RANGE[1]:g} times the static"
            f" model{longer}"
        )
    if sigma > KNOWN_SIGMA and abs(theta) < ONE_SIGMAS * sigma:
        factor = np.exp(min(sigma, 9.0))
        return (
            f"the likelihood gives {np.exp(theta):.2f}, but only within a factor of {factor:.2f} "
            f"(limit {np.exp(KNOWN_SIGMA):.2f}){longer}"
        )
    return ""


def _chance(gain: float, free: int) -> float:
    from scipy.special import chdtrc

    return float(chdtrc(free, gain)) if free else 1.0


def innovations(evaluated: Evaluated) -> WhitenedInnovations:
    """Summarise the innovations of the positions.

    Parameters
    ----------
    evaluated : Evaluated
        The likelihood at one theta.

    Returns
    -------
    WhitenedInnovations
        Its figures.
    """
    return WhitenedInnovations(
        float(np.mean(evaluated.white**2)),
        evaluated.offered,
        evaluated.rejected,
        evaluated.cost,
        whiteness(evaluated.white),
    )


def whiteness(white: Array) -> Whiteness:
    """Test whether innovations are white, column by column.

    Parameters
    ----------
    white : ndarray, (k, 3)
        Whitened innovations in the order of time.

    Returns
    -------
    Whiteness
        The tests.
    """
    from scipy.special import chdtrc, ndtri

    n = len(white)
    lags = min(LAGS, n // 4)
    e = white - white.mean(axis=0)
    power = np.sum(e**2, axis=0)
    r = np.array([np.sum(e[lag:] * e[:-lag], axis=0) / power for lag in range(1, lags + 1)])
    sum_ = n * (n + 2.0) * np.sum(r**2 / (n - np.arange(1, lags + 1))[:, None], axis=0)
    together = np.sqrt(np.maximum(sum_ - lags, 0.0) / n)
    return Whiteness(
        r[0], float(ndtri(0.995) / np.sqrt(n)), sum_, np.asarray(chdtrc(lags, sum_)), lags, together
    )
