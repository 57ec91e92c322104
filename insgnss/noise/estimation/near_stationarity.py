"""Whether one model serves all recordings.

Near-stationarity (Bakalli et al. 2018): do all recordings have the same parameters? With efficient
weights the joint fit is worse than the single ones by

    S = Q(theta_joint) - sum_i Q_i(theta_i) ~ chi-square(p (R - 1))                            (S.3)

for R recordings; since slow processes are far from that limit, the distribution is bootstrapped:
draws from the joint fit, re-fitted jointly and singly. Each recording's share of S says which of
them differs.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...base.errors import UsageError
from ...records import Array
from .bootstrap import draw_variances, redraw_curves
from .estimates import Linearised
from .gmwm import NoiseFit, fit_alike, objective
from .goodness import p_text
from .inference import covariances, efficient
from .selection import recording_numbers

_SIGNIFICANCE = 0.05  # of a p-value, below which one parameter set does not serve all


@dataclass(frozen=True, eq=False)
class NearStationarity:
    """The test of near-stationarity (S.3).

    Parameters
    ----------
    statistic, degrees, p_value : float
        S, its degrees of freedom, and its asymptotic p-value.
    bootstrapped, bootstrapped_error : float
        p-value over `draws` and its Monte Carlo standard deviation; NaN for no draws.
    draws : int
        Number of draws.
    shares : ndarray, (R,)
        Share of each recording in the statistic.
    joint : NoiseFit
        Fit of all recordings.
    single : tuple of NoiseFit
        Fit of each.
    spread : tuple of (str, float, float)
        Of each parameter the standard deviation of its logarithm over the recordings, and what it
        is by chance; NaN at edges.
    """

    statistic: float
    degrees: int
    p_value: float
    bootstrapped: float
    bootstrapped_error: float
    draws: int
    shares: Array
    joint: NoiseFit
    single: tuple[NoiseFit, ...]
    spread: tuple[tuple[str, float, float], ...]

    @property
    def sentence(self) -> str:
        """The verdict, with recordings by their numbers from 1."""
        return self.in_words([f"recording {k + 1}" for k in range(self.shares.size)])

    def in_words(self, names: Sequence[str]) -> str:
        """Return the verdict, with the names of the recordings."""
        p = self.bootstrapped if self.draws else self.p_value
        count = len(names)
        if p >= _SIGNIFICANCE:
            return (
                f"one parameter set serves all {count} recordings: they fit together"
                f" {self.statistic:.1f} worse than singly, {p_text(p)}"
            )
        if count == 2:
            return (
                f"one parameter set does not serve both recordings: they differ, {p_text(p)}; tune"
                " them singly and compare"
            )
        worst = int(np.argmax(self.shares))
        share = 100.0 * self.shares[worst] / self.statistic
        return (
            f"one parameter set does not serve all {count} recordings: {p_text(p)}; {names[worst]}"
            f" has {share:.0f} % of the difference; look at it, or leave it out"
        )


def near_stationarity(
    joint: NoiseFit, *, recordings: Sequence[int] | None = None, draws: int = 100, seed: int = 0
) -> NearStationarity:
    """Test whether one parameter set serves all recordings (S.3).

    Parameters
    ----------
    joint : NoiseFit
        Fit of all curves; its weights are replaced by efficient ones.
    recordings : sequence of int, optional
        Number of the recording of each curve, where one has several (axes); by default each its
        own.
    draws, seed : int
        Draws of the bootstrap, 0 for none, and their seed.

    Returns
    -------
    NearStationarity
        The test.

    Raises
    ------
    UsageError
        For fewer than two recordings, and where recording numbers and curves differ in number.
    """
    from scipy.special import chdtrc

    groups = recording_numbers(joint.curves, recordings)
    if np.unique(groups).size < 2:
        raise UsageError("one recording; near-stationarity is a comparison of two or more")
    joint = efficient(joint)
    statistic, shares, single = _compare_with_single_fits(joint, groups)
    degrees = joint.composition.size * (len(single) - 1)
    bootstrapped = error = math.nan
    if draws:
        null = [
            _compare_with_single_fits(fit_alike(joint, curves, joint.weights), groups)[0]
            for curves in redraw_curves(joint, draw_variances(joint, draws, seed=seed))
        ]
        bootstrapped = (1.0 + float((np.array(null) >= statistic).sum())) / (draws + 1.0)
        error = math.sqrt(bootstrapped * (1.0 - bootstrapped) / draws)
    asymptotic = float(chdtrc(degrees, statistic))
    spread = _scatter_of_parameters(joint, single, groups)
    return NearStationarity(
        statistic=statistic,
        degrees=degrees,
        p_value=asymptotic,
        bootstrapped=bootstrapped,
        bootstrapped_error=error,
        draws=draws,
        shares=shares,
        joint=joint,
        single=single,
        spread=spread,
    )


def _compare_with_single_fits(
    joint: NoiseFit, groups: np.ndarray
) -> tuple[float, Array, tuple[NoiseFit, ...]]:
    """Return S (S.3), its share (R,) by recording, and the single fits.

    These have the weights of the joint fit.
    """
    single, shares = [], []
    for recording in np.unique(groups):
        members = np.flatnonzero(groups == recording)
        curves = [joint.curves[i] for i in members]
        weights = [joint.weights[i] for i in members]
        single_fit = fit_alike(joint, curves, weights)
        single.append(single_fit)
        shares.append(objective(joint.axis, curves, weights, joint.sampling) - single_fit.objective)
    return float(np.sum(shares)), np.array(shares), tuple(single)


def _scatter_of_parameters(
    joint: NoiseFit, single: tuple[NoiseFit, ...], groups: np.ndarray
) -> tuple[tuple[str, float, float], ...]:
    """Return of each parameter its name and the scatter of its logarithm, found and expected."""
    out = []
    V = covariances(joint)
    members = np.flatnonzero(groups == groups[0])
    of_first_recording = replace(
        joint,
        curves=tuple(joint.curves[i] for i in members),
        weights=tuple(joint.weights[i] for i in members),
    )
    linear = Linearised(of_first_recording, [V[i] for i in members])
    expected = np.sqrt(np.diag(linear.covariance())) * linear.local.logarithmic(linear.x)
    for i, name in enumerate(joint.composition.parameters):
        values = [f.parameters[i] for f in single if name not in f.at_bound]
        scatter = float(np.std(np.log(values), ddof=1)) if len(values) > 1 else math.nan
        out.append((name, scatter, math.nan if name in joint.at_bound else float(expected[i])))
    return tuple(out)
