"""Whose noise is larger than its model says."""

from dataclasses import astuple, replace
from types import SimpleNamespace

import numpy as np
import pytest
from flown import fly, start_near
from scipy.stats import norm

from insgnss.base.findings.scale_prior import ScalePrior
from insgnss.navigation.diagnosis import variances
from insgnss.navigation.diagnosis.candidates import ErrorModel, with_time_correlated_error
from insgnss.navigation.diagnosis.evidence import FixClaims
from insgnss.navigation.diagnosis.variances import (
    EVERY_S,
    EVERY_SHARE,
    SHARES,
    SLOW_S,
    VarianceHypothesis,
    VarianceSearch,
    _average_shares,
    with_variances,
)
from insgnss.navigation.filter.layout import FixErrors, state_layout
from insgnss.navigation.filter.solution import Solution, solve
from insgnss.navigation.innovations.likelihood import evaluate
from insgnss.navigation.noise_model.model import load_noise_model
from insgnss.report.rules.fixes import SHOWN_SHARE

SIGMA = np.array([0.5, 0.5, 0.5, 0.3, 0.3, 0.3, *np.radians([1.0, 1.0, 5.0])])
NAVCHIP = load_noise_model("navchip")


def louder(white: float, driving: float):
    """NavChip with its noise times these."""

    def axis(a):
        gm = tuple(replace(g, driving_noise=driving * g.driving_noise) for g in a.gauss_markov)
        walk = driving * a.random_walk
        return replace(a, white_noise=white * a.white_noise, random_walk=walk, gauss_markov=gm)

    triads = {s: tuple(axis(a) for a in getattr(NAVCHIP, s)) for s in ("gyro", "accel")}
    return replace(NAVCHIP, **triads)


def solved(white: float = 1.0, driving: float = 1.0, sigmas: float = 1.0) -> Solution:
    """A flight whose sensors have so many times the noise that its model says."""
    flown = fly(
        240.0, seed=41, imu_hz=100.0, noise=louder(white, driving), layout=state_layout(NAVCHIP)
    )
    ep = flown.problem.epochs
    epochs = ep._replace(position_cov=ep.position_cov / sigmas**2)
    problem = replace(flown.problem, epochs=epochs)
    return solve(problem, start_near(replace(flown, problem=problem), SIGMA), separations=0)


def search(solution: Solution) -> VarianceSearch:
    return VarianceSearch(solution, lambda _: None)


def test_nothing_promises_where_nothing_is_wrong():
    """Oracle: the simulator."""
    assert search(solved()).promising() == ()
    assert search(solved()).strongest() is None


@pytest.mark.parametrize(
    ("planted", "families", "factor"),
    [
        ({"white": 6.0}, ("IMU white noise", "IMU bias noise"), None),
        pytest.param({"driving": 8.0}, ("IMU bias noise",), None, marks=pytest.mark.slow),
        ({"sigmas": 2.0}, ("GNSS sigmas",), 2.0),
        pytest.param({"sigmas": 0.5}, ("GNSS sigmas",), 0.5, marks=pytest.mark.slow),
    ],
)
@pytest.mark.slow
def test_the_right_family_wins(planted, families, factor):
    """Oracle: what was planted. White noise and fast Gauss-Markov processes of a NavChip are alike
    to fixes a tenth of a second apart, so either may stand for the other. A factor of the fixes is
    known to 1 % by 7000 innovations.
    """
    winner = search(solved(**planted)).strongest()
    assert winner is not None
    assert winner.family in families
    assert winner.evidence > 20.0
    if factor is not None:
        assert winner.factors["fixes.position"] == pytest.approx(factor, rel=0.04)


@pytest.mark.slow
def test_evidence_is_the_gain_less_what_the_factors_cost():
    """Oracle: (V.2) by hand, of the costs of (L.4) with and without the factor."""
    looked = search(solved(sigmas=2.0))
    winner = looked.strongest()
    assert winner is not None
    free = np.array([name in winner.factors for name in looked.names])
    theta = np.where(free, np.log(winner.factors["fixes.position"]), 0.0)
    gain = looked.nothing.cost - evaluate(looked.search.segments, theta).cost
    assert looked.nothing.offered == 2400
    assert winner.evidence == pytest.approx(0.5 * gain - 0.5 * np.log(7200.0), abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("prior", [ScalePrior(0.6, 0.02), ScalePrior(0.0, 0.3)])
def test_the_factor_of_the_fixes_is_its_mean_under_the_prior(prior):
    """Oracle: quadrature of likelihood and prior. A narrow prior, as wide as what 7000 innovations
    tell, has as much of a say as they.
    """
    looked = VarianceSearch(solved(sigmas=2.0), lambda _: None, FixClaims(prior))
    winner = looked.strongest()
    assert winner is not None
    free = np.array([name in winner.factors for name in looked.names])
    theta = np.linspace(0.3, 0.8, 101)
    costs = [evaluate(looked.search.segments, np.where(free, t, 0.0)).cost for t in theta]
    log = 0.5 * (looked.nothing.cost - np.array(costs)) + norm.logpdf(theta, *astuple(prior))
    weight = np.exp(log - log.max())
    mean = float(weight @ theta / weight.sum())
    evidence = float(log.max() + np.log(np.trapezoid(weight, theta)))
    assert np.log(winner.factors["fixes.position"]) == pytest.approx(mean, abs=1e-3)
    assert winner.evidence == pytest.approx(evidence, abs=0.01 * abs(evidence) + 0.5)


@pytest.mark.parametrize("narrowed", [(), ("fixes.position",)])
def test_sigmas_are_lowered_where_withheld_pieces_are_predicted(narrowed):
    """Oracle: by hand; otherwise the user's claim holds, and that of velocities in any case."""
    for found in (0.5, 0.8, 1.3):
        factors = {"fixes.position": found, "fixes.velocity": 0.5}
        hypothesis = VarianceHypothesis("GNSS sigmas", 100.0, factors, narrowed)
        model = with_variances(ErrorModel(FixErrors()), hypothesis)
        if not narrowed and found < 1.0:
            assert model is None
            continue
        assert model is not None
        assert model.fixes.white_scale == pytest.approx((found,) * 3)
        assert model.fixes.velocity_white_scale == 1.0


@pytest.mark.slow
def test_what_a_hypothesis_changes_in_the_error_model():
    """Oracle: hand calculation; fixes that are better than they claim are left as they are."""
    model = ErrorModel(FixErrors(white_scale=(1.0, 1.0, 2.0), unfixed_white_scale=0.5))
    winner = search(solved(sigmas=2.0)).strongest()
    assert winner is not None
    k = winner.factors["fixes.position"]
    raised = with_variances(model, winner)
    assert raised is not None
    assert raised.fixes.white_scale == pytest.approx((k, k, 2.0 * k))
    assert raised.fixes.unfixed_white_scale == pytest.approx(0.5 * k)
    better = replace(winner, factors={"fixes.position": 0.5})
    assert with_variances(model, better) is None
    driven = replace(
        winner,
        family="IMU bias noise",
        factors={"gyro.driving_noise": 3.0, "accel.driving_noise": 0.2},
    )
    imu = with_variances(model, driven)
    assert imu is not None
    assert imu.imu.driving_noise == (3.0, 1.0)
    own = imu.imu.of(NAVCHIP)
    assert own.gyro[0].gauss_markov[0].sigma == pytest.approx(
        3.0 * NAVCHIP.gyro[0].gauss_markov[0].sigma
    )
    assert own.accel == NAVCHIP.accel
    # smaller noise than somebody states is not adopted, that of a draft is
    quiet = {"gyro.driving_noise": 0.5, "accel.driving_noise": 0.2}
    quieter = replace(driven, factors=quiet)
    assert with_variances(model, quieter) is None
    drafted = with_variances(model, quieter, drafted=True)
    assert drafted is not None
    assert drafted.imu.driving_noise == (0.5, 0.2)
    assert with_variances(model, better, drafted=True) is None


@pytest.mark.parametrize(
    ("position", "velocity", "adopted"),
    [(0.8, 1.8, (1.0, 1.8)), (2.0, 0.5, (2.0, 1.0)), (2.0, 1.8, (2.0, 1.8)), (0.8, 0.9, None)],
)
def test_positions_and_velocities_get_their_own_factor(position, velocity, adopted):
    """Oracle: hand calculation. Velocities of a recorded walk were 1.8 times worse than they
    claimed beside positions that were right, and nothing was adopted.
    """
    factors = {"fixes.position": position, "fixes.velocity": velocity}
    model = ErrorModel(FixErrors(unfixed_white_scale=0.5, velocity_white_scale=0.5))
    raised = with_variances(model, VarianceHypothesis("GNSS sigmas", 100.0, factors))
    if adopted is None:
        assert raised is None
        return
    assert raised is not None
    k, v = adopted
    assert raised.fixes.white_scale == (k, k, k)
    assert raised.fixes.unfixed_white_scale == 0.5 * k
    assert raised.fixes.velocity_white_scale == 0.5 * v


def slow_error(monkeypatch, gain):
    """What is made of a flight of five minutes whose slow errors have such gains in -2 log L."""
    part = SimpleNamespace(problem=SimpleNamespace(epochs=SimpleNamespace(time=np.r_[0.0, 300.0])))
    looked = SimpleNamespace(part=part, _white_share=lambda *_: (1.0, 1000.0))

    def evaluated(segments, theta, _):
        (errors,) = segments
        own = gain(errors.gm_sigma[0] * np.exp(theta[0]), errors.correlation_time_s)
        return SimpleNamespace(cost=1000.0 - own, gradient=np.zeros(2), information=np.eye(2))

    monkeypatch.setattr(variances, "_linearise_in_layout", lambda _, errors, names: errors)
    monkeypatch.setattr(variances, "evaluate", evaluated)
    return VarianceSearch.slow_error(looked, lambda errors: errors, FixErrors())


def test_a_slow_error_is_carried_by_its_probability(monkeypatch):
    """Oracle: value and slope at lag zero of the autocovariance, averaged by hand over the shares
    and times at their odds a priori, and none at all. What the flight speaks against is not
    carried; what it shows without doubt is the mean of all that explain it as well.
    """
    assert slow_error(monkeypatch, lambda c, T: -0.1) is None
    grid = [(c, T) for c in SHARES for T in SLOW_S]
    gains = {(c, T): 6.0 - 2.0 * c - 0.01 * T for c, T in grid}
    odds = {(c, T): SHARES[c] * SLOW_S[T] * np.exp(gain / 2.0) for (c, T), gain in gains.items()}
    total = 1.0 + sum(odds.values())
    value = sum(odds[c, T] / total * c**2 for c, T in grid)
    slope = sum(odds[c, T] / total * c**2 / T for c, T in grid)
    carried = slow_error(monkeypatch, lambda c, T: 6.0 - 2.0 * c - 0.01 * T)
    assert carried is not None
    assert carried.gm_sigma == pytest.approx((value**0.5,) * 3)
    assert carried.correlation_time_s == pytest.approx(value / slope)
    assert carried.white_scale == (1.0, 1.0, 1.0)
    shown = slow_error(monkeypatch, lambda c, T: 3.0 + 3000.0 * (abs(c - 1.0) < 1e-9))
    assert shown is not None
    assert shown.gm_sigma == pytest.approx((1.0,) * 3)
    assert shown.correlation_time_s == pytest.approx(1.0 / sum(p / T for T, p in SLOW_S.items()))


def drifting(claim: float, wander: float) -> VarianceSearch:
    """Fixes that claim so many times their white sigma, with a slow error of 40 s beside it."""
    flown = fly(240.0, seed=47, imu_hz=100.0, noise=NAVCHIP, layout=state_layout(NAVCHIP))
    ep = flown.problem.epochs
    sigma = np.sqrt(np.diagonal(ep.position_cov, axis1=1, axis2=2))
    phi = np.exp(-np.diff(ep.time, prepend=ep.time[0]) / 40.0)
    white = np.random.default_rng(5).standard_normal(sigma.shape)
    slow = np.zeros_like(sigma)
    for k in range(1, phi.size):
        slow[k] = phi[k] * slow[k - 1] + np.sqrt(1.0 - phi[k] ** 2) * white[k]
    position = ep.position + wander * sigma * slow
    claimed = {"position_cov": claim**2 * ep.position_cov, "sigma": claim * ep.sigma}
    epochs = ep._replace(position=position, **claimed)
    problem = replace(flown.problem, epochs=epochs)
    start = start_near(replace(flown, problem=problem), SIGMA)
    return search(solve(problem, start, separations=0))


@pytest.mark.parametrize("claim", [0.8, 1.2])
def test_a_claim_that_is_off_hides_no_slow_error(claim):
    """Oracle: the same fixes with the right claim: the slow error is the same in metres, and the
    white one the true one. Where there is none, and this noise does not speak against one, what is
    carried by its odds is the same whatever the claim, and too small to stand out.
    """

    def found(of_claim, wander):
        looked = drifting(of_claim, wander)
        return looked.slow_error(lambda errors: state_layout(NAVCHIP, fixes=errors), FixErrors())

    right, other = found(1.0, 0.7), found(claim, 0.7)
    assert right is not None
    assert other is not None
    assert claim * other.gm_sigma[0] == pytest.approx(right.gm_sigma[0], rel=0.01)
    assert claim * other.white_scale[0] == pytest.approx(1.0, abs=0.01)
    by_odds, with_claim = found(1.0, 0.0), found(claim, 0.0)
    assert claim * with_claim.gm_sigma[0] == pytest.approx(by_odds.gm_sigma[0], rel=0.01)
    assert by_odds.gm_sigma[0] < SHOWN_SHARE


def test_a_slow_error_stands_beside_the_white_one_that_is_known():
    """Oracle: by hand."""
    known = FixErrors(white_scale=(1.2, 1.2, 1.5))
    both = with_time_correlated_error(known, 0.5, 0.8, 30.0, 2.0)
    assert both.white_scale == pytest.approx((0.6, 0.6, 1.5))
    assert both.gm_sigma == pytest.approx((0.8, 0.8, 1.6))


@pytest.mark.parametrize(("k", "c"), [(0.9, 200.0**0.5), (0.5, 0.8)])
def test_no_claim_bounds_a_slow_error(monkeypatch, k, c):
    """Oracle: by hand: where innovations tell c^2 / T alone, and 1.44 times it after the step of
    the scoring, c^2 is that times the mean of T at its odds a priori, of shares as of times, beyond
    the claim or not. The white share and the ratio of heights stay; a claim of code solutions
    holds.
    """
    part = SimpleNamespace(cost=1000.0, problem=None)
    looked = SimpleNamespace(part=part, nothing=part)
    step = SimpleNamespace(gradient=-np.log(1.2) * np.ones(1), information=np.eye(1), cost=50.0)
    code = []
    monkeypatch.setattr(variances, "only_code_fixes", lambda _: bool(code))
    monkeypatch.setattr(variances, "_linearise_in_layout", lambda _, errors, names: errors)
    monkeypatch.setattr(variances, "evaluate", lambda *_: step)
    fitted = with_time_correlated_error(FixErrors(), k, c, 100.0, 1.5)
    found = VarianceSearch.averaged(looked, lambda errors: errors, fitted)
    square = {T: 1.44 * c**2 * T / 100.0 for T in EVERY_S}
    shares, odds_of_shares = np.log(list(EVERY_SHARE)), list(EVERY_SHARE.values())
    odds = {
        T: EVERY_S[T] * np.interp(0.5 * np.log(square[T]), shares, odds_of_shares) for T in EVERY_S
    }
    share = (sum(square[T] * p for T, p in odds.items()) / sum(odds.values())) ** 0.5
    assert found.gm_sigma == pytest.approx((share, share, 1.5 * share))
    assert found.correlation_time_s == pytest.approx(share**2 / (1.44 * c**2 / 100.0))
    assert found.white_scale == fitted.white_scale
    code.append(True)
    of_code = VarianceSearch.averaged(looked, lambda errors: errors, fitted)
    assert (of_code == fitted) is (k < 0.7)


def test_a_little_more_evidence_carries_a_little_more():
    """Oracle: none; what is carried grows with the evidence, by less than a fifth a unit of log
    evidence where the error is shown: one reality has one sigma, whatever the noise.
    """
    grid = [(c, T) for c in SHARES for T in SLOW_S]
    carried = [
        _average_shares({(c, T): gain - 4.0 * np.log(c**2 / T / 0.004) ** 2 for c, T in grid})[0]
        for gain in np.arange(2.0, 40.0, 2.0)
    ]
    growth = np.diff(np.log(carried))
    assert (growth > 0.0).all()
    assert growth[2:].max() < 0.2
    assert carried[-1] < 1.0
