"""The limits and the small formulas of the diagnosis, each on either side or in closed form."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from insgnss.base.errors import DataError
from insgnss.navigation.diagnosis import (
    clock_step,
    constants,
    decision,
    estimated,
    incorrect_fixes,
    time_correlated,
)
from insgnss.navigation.diagnosis import evidence as evidence_module
from insgnss.navigation.diagnosis import variances as variances_module
from insgnss.navigation.diagnosis.candidates import (
    ImuErrors,
    with_larger_white_share,
    with_time_correlated_error,
)
from insgnss.navigation.diagnosis.evidence import (
    NO_CLAIMS,
    _liveliest,
    follows,
    loses_fixes,
    misfit,
)
from insgnss.navigation.diagnosis.sensitivity import Sensitivity
from insgnss.navigation.diagnosis.time_correlated import _towards_claim
from insgnss.navigation.diagnosis.variances import VarianceSearch, _average_shares, _promise
from insgnss.navigation.filter.codes import COVARIANCE_RESET, NOT_MEASURED, REJECTED, USED
from insgnss.navigation.filter.layout import FixErrors
from insgnss.navigation.noise_model.model import AxisNoise, GaussMarkov, NoiseModel
from insgnss.records.states import OF_LEVER_ARM, TIME_OFFSET


def solved(used=100, rejected=0, resets=0, nis=3.0, gate=14.0, sigma=0.02) -> SimpleNamespace:
    """What a filter left of so many fixes, all of them with this NIS."""
    kinds = [USED] * used + [REJECTED] * rejected + [COVARIANCE_RESET] * resets + [NOT_MEASURED] * 7
    verdict = np.full((len(kinds), 5), NOT_MEASURED)
    verdict[:, 0] = kinds
    return SimpleNamespace(
        verdict=verdict,
        nis=np.full((len(kinds), 5), nis),
        innovation_sigma=np.full((len(kinds), 6), sigma),
        problem=SimpleNamespace(gate=gate),
    )


@pytest.mark.parametrize(
    ("rejected", "nis", "verdict"),
    [(5, 5.9, True), (6, 5.9, False), (5, 6.1, False), (0, 3.0, True)],
)
def test_a_solution_follows_its_fixes(rejected, nis, verdict) -> None:
    """Oracle: by hand: one fix in twenty rejected, twice the expected NIS, at most."""
    assert follows(solved(100 - rejected, rejected, nis=nis)) is verdict


@pytest.mark.parametrize(
    ("before", "after", "lost"),
    [
        ((200, 0, 0), (198, 2, 0), False),
        ((200, 0, 0), (197, 3, 0), True),
        ((190, 10, 0), (188, 12, 0), False),
        ((190, 10, 0), (187, 13, 0), True),
        ((200, 0, 0), (199, 0, 1), True),
        ((198, 0, 2), (198, 0, 2), False),
        ((198, 0, 2), (199, 0, 1), False),
    ],
)
def test_a_solution_loses_fixes(before, after, lost) -> None:
    """Oracle: by hand: one in a hundred more rejected, or a covariance reset more."""
    assert loses_fixes(solved(*after), solved(*before)) is lost


def test_the_misfit_charges_each_rejected_fix_with_the_gate() -> None:
    """Oracle: (C.1) by hand: size of each fix, at most the gate, and 2 log of its three sigmas."""
    per_fix = 6.0 * np.log(0.02)
    assert misfit(solved(10, 4, 2, nis=3.0)) == pytest.approx(12 * 3.0 + 4 * 14.0 + 16 * per_fix)
    assert misfit(solved(10, nis=20.0)) == pytest.approx(10 * 14.0 + 10 * per_fix)


def test_the_liveliest_window_is_that_of_the_largest_variance() -> None:
    """Oracle: numpy's variance of the velocity over every window of so many fixes."""
    rng = np.random.default_rng(3)
    nav = np.cumsum(rng.normal(size=(60, 10)), axis=0)
    has = rng.random(60) < 0.7
    fixes = np.flatnonzero(has)
    solution = SimpleNamespace(
        nav=nav, problem=SimpleNamespace(epochs=SimpleNamespace(has_position=has))
    )
    v = nav[fixes, 3:6]
    variance = [v[k : k + 12].var(axis=0).sum() for k in range(fixes.size - 12)]
    best = int(np.argmax(variance))
    assert _liveliest(solution, 12) == (fixes[best], fixes[best + 12])
    assert _liveliest(solution, 1000) == (fixes[0], fixes[-1])


def test_the_promise_of_a_family_is_raos_score() -> None:
    """Oracle: (V.1): the quadratic's minimum over the free parameters, by numpy's solver."""
    rng = np.random.default_rng(4)
    root, g = rng.normal(size=(5, 5)), rng.normal(size=5)
    A = root @ root.T
    for free in ([0, 3], [1], [0, 1, 2, 3, 4]):
        chosen = np.isin(np.arange(5), free)
        own = A[np.ix_(free, free)]
        theta = -np.linalg.solve(own, g[free])
        gain = -(2.0 * g[free] @ theta + theta @ own @ theta) / 2.0
        assert _promise(g, A, chosen) == pytest.approx(gain)


@pytest.mark.parametrize("gain", [19.5, 21.0])
@pytest.mark.parametrize(("code", "least"), [(False, 0.2), (True, 0.03)])
def test_which_time_correlated_error_is_taken(monkeypatch, gain, code, least) -> None:
    """Oracle: a parabola of the likelihood by hand, whose minimum lies beyond the bounds of the
    white share and of the correlation time: those are what is returned, if it gains 20."""
    best = np.log([0.01, 0.5, 1e3, 1.5])

    def cost(errors):
        if errors is None or errors.gm_sigma is None:
            return gain
        p = np.log([0.01, errors.gm_sigma[0], 1e3, errors.gm_sigma[2] / errors.gm_sigma[0]])
        return 30.0 * float(np.sum((p - best)[[1, 3]] ** 2))

    monkeypatch.setattr(
        time_correlated, "liveliest_window", lambda _: (SimpleNamespace(aiding_interval_s=0.2), 0)
    )
    monkeypatch.setattr(time_correlated, "only_code_fixes", lambda _: code)
    monkeypatch.setattr(time_correlated, "guesses", lambda _: ((0.01, 1.0, 1e3),))
    monkeypatch.setattr(time_correlated, "with_layout", lambda problem, start, layout: (layout,))
    monkeypatch.setattr(time_correlated, "minus_two_log_likelihood", cost)
    found = time_correlated.time_correlated_error(None, lambda errors: errors, FixErrors())
    if gain < 20.0:
        assert found is None
        return
    assert found is not None
    assert (found.white_scale[0], found.correlation_time_s) == (least, 600.0)
    assert_allclose(found.gm_sigma, [0.5, 0.5, 0.75], rtol=0.15)


def test_shares_by_component() -> None:
    """Oracle: by hand: heights by the ratio, and each attempt 1.6 times as white."""
    errors = with_time_correlated_error(FixErrors(), 0.5, 0.8, 30.0, 2.0)
    assert errors.gm_sigma == (0.8, 0.8, 1.6)
    assert with_time_correlated_error(FixErrors(), 0.5, 0.8, 30.0).gm_sigma == (0.8, 0.8, 0.8)
    assert errors.white_scale == (0.5, 0.5, 1.0)
    assert errors.unfixed_white_scale == 0.5
    whiter = with_larger_white_share(errors)
    assert_allclose(whiter.white_scale, [0.8, 0.8, 1.6])
    assert whiter.unfixed_white_scale == pytest.approx(0.8)
    assert whiter.gm_sigma == errors.gm_sigma


def test_what_is_scaled_in_a_model_of_the_imu() -> None:
    """Oracle: by hand: white noise by one factor, what drives random walks and Gauss-Markov
    processes by the other, each of its own triad; sigmas of constants only where they are set."""
    axis = AxisNoise(
        white_noise=1.0, random_walk=2.0, gauss_markov=(GaussMarkov(10.0, 3.0),), scale_factor=0.1
    )
    model = ImuErrors(white_noise=(2.0, 3.0), driving_noise=(5.0, 7.0), misalignment=0.2).of(
        NoiseModel("m", "", (axis,) * 3, (axis,) * 3)
    )
    for triad, white, driven in ((model.gyro, 2.0, 5.0), (model.accel, 3.0, 7.0)):
        for one in triad:
            assert (one.white_noise, one.random_walk) == (white, 2.0 * driven)
            assert one.gauss_markov[0].driving_noise == 3.0 * driven
            assert (one.scale_factor, one.misalignment) == (0.1, 0.2)


def spell(first, last, step=(1.0, 0.0, 0.0), misclosure=0.0) -> incorrect_fixes.FixSpell:
    return incorrect_fixes.FixSpell(first, last, np.array(step), np.full(3, 0.01), misclosure)


def withheld(spells, *, n=400, sigma_m=0.1, longest_s=60.0) -> bool:
    """Whether spells of fixes, one a second, are withheld."""
    epochs = SimpleNamespace(
        time=np.arange(float(n)),
        withheld=np.zeros(n, dtype=bool),
        has_position=np.ones(n, dtype=bool),
        position_cov=np.broadcast_to(sigma_m**2 * np.eye(3), (n, 3, 3)),
    )
    epochs._replace = lambda **changes: SimpleNamespace(**{**vars(epochs), **changes})
    return incorrect_fixes._withheld(Posed(epochs), spells, longest_s) is not None


class Posed(SimpleNamespace):
    """A problem of which only the epochs are read."""

    def __init__(self, epochs):
        super().__init__(epochs=epochs)


@pytest.mark.parametrize(
    ("spells", "taken"),
    [
        ([spell(10, 70)], True),
        ([spell(10, 71)], False),  # longer than a minute
        ([spell(10, 69), spell(100, 159)], True),  # 120 of 400
        ([spell(10, 69), spell(100, 159), spell(300, 300)], False),  # more than three in ten
        ([spell(10, 20, (0.0, 0.29, 0.0))], False),  # within three sigmas of what is claimed
        ([spell(10, 20, (0.0, 0.31, 0.0))], True),
        ([spell(10, 20, (0.0, 0.29, 0.0)), spell(30, 31)], True),
    ],
)
def test_which_spells_are_withheld(monkeypatch, spells, taken) -> None:
    """Oracle: limits by hand, on either side."""
    monkeypatch.setattr(incorrect_fixes, "replace", lambda problem, **changes: changes)
    assert withheld(spells) is taken


def history(verdict, innovation=None) -> SimpleNamespace:
    verdict = np.asarray(verdict)
    n = verdict.size
    out = np.full((n, 5), NOT_MEASURED)
    out[:, 0] = verdict
    size = np.zeros((n, 6)) if innovation is None else innovation
    return SimpleNamespace(verdict=out, innovation=size, innovation_sigma=1.0 + 0.0 * size)


def epochs_of(n) -> SimpleNamespace:
    return SimpleNamespace(
        epochs=SimpleNamespace(time=1.0 * np.arange(n), withheld=np.zeros(n, dtype=bool))
    )


@pytest.mark.parametrize(
    ("rejected", "resets", "verdict"), [(2, 0, True), (3, 0, False), (0, 1, False)]
)
def test_when_a_filter_follows_what_is_not_withheld(rejected, resets, verdict) -> None:
    """Oracle: by hand: one fix in a hundred rejected, no reset."""
    kinds = [USED] * (200 - rejected - resets) + [REJECTED] * rejected + [COVARIANCE_RESET] * resets
    assert incorrect_fixes._follows(epochs_of(200), history(kinds)) is verdict


def test_spells_of_rejected_fixes() -> None:
    """Oracle: by hand: those up to 5 s apart are one spell, with the largest innovation in it."""
    kinds, size = np.full(40, USED), np.zeros((40, 6))
    for index, offset in ((4, 1.0), (9, 5.0), (14, 2.0), (20, 3.0), (27, 0.5)):
        kinds[index], size[index, 1] = REJECTED, offset
    kinds[28] = COVARIANCE_RESET
    found = incorrect_fixes.rejected_spells(epochs_of(40), history(kinds, size))
    assert [(s.first, s.last, s.step[1]) for s in found] == [
        (4, 14, 5.0),
        (20, 20, 3.0),
        (27, 28, 0.5),
    ]


def test_spells_between_two_steps() -> None:
    """Oracle: by hand: the shorter of the parts between resets, each from the first rejected fix
    before it; the misclosure is what both steps leave, of the larger one."""
    kinds, size = np.full(60, USED), np.zeros((60, 6))
    kinds[[20, 21, 35]], kinds[[22, 36]] = REJECTED, COVARIANCE_RESET
    size[20:23, 0] = [1.0, 1.2, 9.0]
    size[35:37, 0] = [-0.8, -1.0]
    (found,) = incorrect_fixes.spells_apart(epochs_of(60), history(kinds, size))
    assert (found.first, found.last) == (20, 34)
    assert found.step[0] == pytest.approx(1.2)
    assert found.misclosure == pytest.approx(0.3 / 1.2)
    for closure, kept in ((0.49, 1), (0.51, 0)):
        size[35:37, 0] = -1.2 * (1.0 - closure)
        assert len(incorrect_fixes._closing_spells(epochs_of(60), history(kinds, size))) == kept
    alone = replace(found, misclosure=0.0)
    assert alone.last == 34


@pytest.mark.parametrize("gain", [-0.1, 0.1, 8.1, 30.0])
def test_when_a_slow_error_is_carried(monkeypatch, gain) -> None:
    """Oracle: by hand: none where the flight speaks against it, else the average over all; none of
    a flight shorter than three minutes."""
    gains = {
        (share, time_s): gain - 0.1 * (share != 1.0) - 5.0 * (time_s > 60.0)
        for share in variances_module.SHARES
        for time_s in variances_module.SLOW_S
    }
    gains[0.5, 60.0] = gain  # what is looked at first
    cost = {key: 100.0 - value for key, value in gains.items()}
    monkeypatch.setattr(
        variances_module, "_linearise_in_layout", lambda part, layout, names: layout
    )
    monkeypatch.setattr(
        variances_module,
        "evaluate",
        lambda layouts, theta, _: SimpleNamespace(
            cost=cost[
                round(layouts[0].gm_sigma[0] * float(np.exp(theta[0])), 9),
                layouts[0].correlation_time_s,
            ],
            gradient=np.zeros(2),
            information=np.eye(2),
        ),
    )

    def found(seconds):
        search = VarianceSearch.__new__(VarianceSearch)
        search._white_share = lambda *_: (1.0, 100.0)
        epochs = SimpleNamespace(time=np.array([0.0, seconds]))
        search.part = SimpleNamespace(problem=SimpleNamespace(epochs=epochs))
        return search.slow_error(lambda errors: errors, FixErrors())

    assert found(179.0) is None
    slow = found(181.0)
    if gain < 0.0:
        assert slow is None
        return
    assert slow is not None
    share, time_s = _average_shares(gains, variances_module.SHARES, variances_module.SLOW_S)
    assert slow.gm_sigma[0] == pytest.approx(share)
    assert slow.correlation_time_s == pytest.approx(time_s)


@pytest.mark.parametrize(
    ("k", "c", "limit", "ends_at"),
    [
        (0.5, 0.6, 1e9, np.sqrt(1.0 - 0.25)),  # up to what the file claims
        (0.5, 1.5, 1e9, np.sqrt(1.0 - 0.25)),  # down to it
        (0.8, 1.5, 1e9, 1.5),  # k alone is most of the claim, and what is beyond it stays
        (0.8, 0.8, 1e9, 0.8),
        (0.5, 0.2, 120.0, None),  # not beyond a correlation time of ten minutes
    ],
)
def test_the_shares_move_towards_the_claim(k, c, limit, ends_at) -> None:
    """Oracle: k^2 + c^2 = 1 by hand, to half a step of the ridge; c^2 / T stays what it was."""
    start = np.log([k, c, 20.0, 1.0]) if ends_at else np.log([k, c, 400.0, 1.0])
    end = _towards_claim(lambda p: 0.0, start, 0.0)
    assert 2.0 * end[1] - end[2] == pytest.approx(2.0 * start[1] - start[2])
    assert end[0] == start[0]
    if ends_at is None:
        assert 600.0 / 1.3 < np.exp(end[2]) <= 600.0
    else:
        assert abs(np.exp(end[1]) / ends_at - 1.0) < 0.5 * np.log(1.3) + 0.05


@pytest.mark.parametrize(("rise", "moves"), [(0.9, True), (1.1, False)])
def test_the_claim_is_left_where_the_likelihood_doubts_it(rise, moves) -> None:
    """Oracle: a rise of -2 log L by one, what a sigma makes, on either side."""
    start = np.log([0.5, 0.6, 20.0, 1.0])
    end = _towards_claim(lambda p: rise, start, 0.0)
    assert (end[1] > start[1]) == moves


def test_the_average_over_models_weighs_by_likelihood() -> None:
    """Oracle: (V.3) by hand: two models of one likelihood each, none as probable as both."""
    gains = {(1.0, 20.0): 0.0, (0.5, 100.0): 2.0 * np.log(3.0)}
    share, time_s = _average_shares(gains, {1.0: 0.5, 0.5: 0.5}, {20.0: 1.0, 100.0: 1.0})
    w = np.array([0.5, 1.5]) / 3.0
    square = w @ [1.0, 0.25]
    assert share == pytest.approx(np.sqrt(square))
    assert time_s == pytest.approx(square / (w @ [1.0 / 20.0, 0.25 / 100.0]))


def next_state(
    monkeypatch,
    *,
    evidence=10.0,
    left=0.0,
    variance=None,
    promising=True,
    remedied=True,
    slow=None,
    delay=None,
):
    """What is adopted next: of a constant of some evidence, after which so much is left to be
    explained, of a variance, of a slow bias, and of a delay of a sensor."""
    suspected = SimpleNamespace(groups=("g",), evidence=evidence)
    constants = SimpleNamespace(strongest=lambda: suspected)
    monkeypatch.setattr(
        decision,
        "VarianceSearch",
        lambda *_: SimpleNamespace(
            promising=lambda: ("v",) if promising else (), left=lambda *_: left
        ),
    )
    monkeypatch.setattr(
        decision, "_with_constants", lambda *_: decision.Stage(1, None) if remedied else None
    )
    monkeypatch.setattr(decision, "_as_allowed", lambda *_: "constant")
    delays = [] if delay is None else [SimpleNamespace(evidence=delay)]
    monkeypatch.setattr(decision, "_of_lost_fixes", lambda *_: evidence)
    monkeypatch.setattr(decision, "late_sensors", lambda *_: delays)
    monkeypatch.setattr(decision, "_without_delay", lambda *_: "delay")
    monkeypatch.setattr(
        decision,
        "_variance",
        lambda *_: None if variance is None else (variance, lambda: "variance"),
    )
    monkeypatch.setattr(
        decision, "_slow_bias", lambda *_: None if slow is None else (slow, lambda: "slow")
    )
    search = SimpleNamespace(time_correlated=False, progress=None, variances=True, claims=NO_CLAIMS)
    here = decision.Stage(0, None)
    return decision.next_state(search, (None, None), here, constants)


@pytest.mark.parametrize(
    ("evidence", "history"),
    [(1.0, ("lag",)), (-1.0, ("allows for a rival of the estimated lever arm",))],
)
def test_a_lag_is_tried_where_the_lever_arm_has_moved(monkeypatch, evidence, history) -> None:
    """Oracle: the more probable of both is adopted, the other is in the covariance, either way."""
    monkeypatch.setattr(
        decision, "VarianceSearch", lambda *_: SimpleNamespace(promising=lambda: ())
    )
    monkeypatch.setattr(decision, "_slow_bias", lambda *_: None)
    monkeypatch.setattr(decision, "arm_has_moved", lambda _: True)
    monkeypatch.setattr(decision, "missing_rate", lambda _: 0.0)
    lag = SimpleNamespace(
        evidence=evidence,
        sentence="lag",
        posed=None,
        solution="with lag",
        dynamics=SimpleNamespace(name="receiver dynamics"),
        check=lambda: SimpleNamespace(name="lag", found=""),
        shared_error=lambda _, adopted=True: adopted,
    )
    monkeypatch.setattr(decision, "lag_beside_arm", lambda *_: lag)
    search = SimpleNamespace(time_correlated=False, progress=None, variances=True, claims=NO_CLAIMS)
    adopted = decision.next_state(search, (None, None), decision.Stage("before", None), None)
    assert adopted.shared == (evidence > 0.0,)
    assert adopted.solution == ("with lag" if evidence > 0.0 else "before")
    assert history[0] in adopted.history[0]
    assert decision.next_state(search, (None, None), adopted, None) is None


@pytest.mark.parametrize(
    ("offset_s", "sigma_s", "rate"),
    [(3e-3, 2e-4, 3e-5), (1.9e-3, 2e-4, 0.0), (0.0, 1.5e-3, 1e-5), (0.0, 1.3e-3, 0.0)],
)
def test_a_time_offset_that_has_moved_gets_a_rate_beside_it(
    monkeypatch, offset_s, sigma_s, rate
) -> None:
    """Oracle: the rule: a mean offset of 3 ms may be a clock of 20 ppm over five minutes, and
    so may what a straight flight leaves at its a-priori sigma of 2 ms.
    """
    monkeypatch.setattr(
        decision, "VarianceSearch", lambda *_: SimpleNamespace(promising=lambda: ())
    )
    monkeypatch.setattr(decision, "_slow_bias", lambda *_: None)
    monkeypatch.setattr(decision, "arm_has_moved", lambda _: False)
    monkeypatch.setattr(estimated, "constant", lambda *_: (offset_s, sigma_s))
    monkeypatch.setattr(decision, "constant", lambda *_: (offset_s, sigma_s))
    layout = SimpleNamespace(offset=3, rate=-1, sigma0=np.full(4, 2e-3))
    monkeypatch.setattr(estimated, "rms_speed", lambda _: 15.0)
    before: Any = SimpleNamespace(
        problem=SimpleNamespace(layout=layout), time=np.array([0.0, 84.0])
    )
    search = SimpleNamespace(
        time_correlated=False,
        progress=None,
        variances=True,
        claims=NO_CLAIMS,
        solved=lambda _, model: model.fixes.clock_rate,
    )
    here = decision.Stage(before, decision.ErrorModel(FixErrors(time_offset_s=2e-3)))
    adopted = decision.next_state(search, (None, None), here, None)
    assert (adopted is not None) == (rate > 0.0)
    if adopted is not None:
        assert adopted.solution == rate
        assert f"early by {1e3 * offset_s:+.1f} +-" in adopted.history[0]


@pytest.mark.parametrize(
    ("changes", "adopted"),
    [
        ({}, "constant"),
        ({"promising": False, "left": 99.0}, "constant"),  # nothing is left where none promises
        ({"remedied": False}, None),
        ({"remedied": False, "variance": 1.0}, "variance"),
        ({"left": 29.0, "evidence": 50.0, "variance": 99.0}, "constant"),  # at once
        ({"left": 31.0, "evidence": 50.0, "variance": 99.0}, "variance"),
        ({"left": 31.0, "evidence": 50.0, "variance": 49.0}, "constant"),
        ({"left": 51.0, "evidence": 50.0, "variance": 1.0}, "variance"),  # explains less than left
        ({"left": 51.0, "evidence": 50.0}, None),
        (
            {"slow": 51.0, "left": 29.0, "evidence": 50.0},
            "slow",
        ),  # a constant is blamed after it has lost
        ({"slow": 49.0, "left": 29.0, "evidence": 50.0}, "constant"),
        ({"slow": 9.0, "remedied": False, "variance": 8.0}, "slow"),
        ({"slow": 7.0, "remedied": False, "variance": 8.0}, "variance"),
        ({"delay": 12.9}, "constant"),  # which says that the flight does not tell them apart
        ({"delay": 13.1}, "delay"),
        ({"delay": 13.1, "slow": 14.0}, "slow"),
    ],
)
def test_which_explanation_is_adopted(monkeypatch, changes, adopted) -> None:
    """Oracle: the rules of the decision by hand: by evidence, but a constant that leaves little is
    taken at once unless a slow bias explains more, one that leaves more than it explains is not,
    and one that a delay beats by three is not tried."""
    assert next_state(monkeypatch, **changes) == adopted


@pytest.mark.parametrize(
    ("resets", "gain", "expected"),
    [(0, 20.0, 50.0), (1, 20.0, 10.0), (1, 200.0, 50.0), (1, None, 0.0)],
)
def test_evidence_of_a_flight_that_has_lost_fixes(monkeypatch, resets, gain, expected) -> None:
    """Oracle: by hand: half the gain in -2 log L, where a lost fix counts no more than the gate, as
    it does of the rivals; without lost fixes that of the hypothesis."""
    here = decision.Stage(1.0, decision.ErrorModel(FixErrors()))
    monkeypatch.setattr(decision, "_resets", lambda _: resets)
    monkeypatch.setattr(decision, "misfit", lambda solution: solution)
    solved = None if gain is None else 1.0 - gain
    search = SimpleNamespace(solved=lambda *_: solved)
    suspected = SimpleNamespace(groups=(OF_LEVER_ARM[0],), factor=1.0, evidence=50.0)
    assert decision._of_lost_fixes(search, (None, None), here, suspected) == expected


def test_shares_of_code_solutions_within_their_bounds() -> None:
    """Oracle: by hand: 2 % of a sigma, a millimetre to three metres a second; white shares first
    where nothing else helps."""
    model = FixErrors(
        unfixed_gm_sigma=1.0,
        unfixed_white_scale=0.5,
        velocity_gm_sigma_mps=0.1,
        velocity_white_scale=1.0,
    )
    names = ("position", "unfixed_correlated", "velocity_correlated", "velocity")
    for factor, expected in (
        (0.5, (0.25, 0.5, 0.05, 0.5)),
        (1e-3, (0.02, 0.02, 1e-3, 0.02)),
        (100.0, (50.0, 100.0, 3.0, 100.0)),
    ):
        got = time_correlated._with_factors(model, {f"fixes.{name}": factor for name in names})
        assert_allclose(
            (got.unfixed_white_scale, got.unfixed_gm_sigma)
            + (got.velocity_gm_sigma_mps, got.velocity_white_scale),
            expected,
        )
    whiter = time_correlated._whiter(model)
    assert_allclose([whiter.unfixed_white_scale, whiter.velocity_white_scale], [0.8, 1.6])


@pytest.mark.parametrize(
    ("k", "c", "share", "time_s"),
    [
        (0.89, 1.0, 0.456, 600.0 * 0.2079),
        (0.91, 1.0, None, None),
        (0.6, 1.6, 0.8, 150.0),
        (0.6, 0.4, 0.8, 600.0),
        (0.6, 80.0, 0.8, 1.0),
    ],
)
def test_shares_make_what_code_solutions_claim(k, c, share, time_s) -> None:
    """Oracle: (D.3) by hand: k^2 + c^2 = 1 with c^2 / T as it was, of one second to ten minutes; a
    share of nine tenths is all white."""
    model = FixErrors(unfixed_white_scale=k, unfixed_gm_sigma=c, unfixed_correlation_time_s=60.0)
    got = time_correlated._as_claimed(model)
    if share is None:
        assert got.unfixed_gm_sigma is None
    else:
        assert got.unfixed_gm_sigma == pytest.approx(share, abs=1e-3)
        assert got.unfixed_correlation_time_s == pytest.approx(time_s, rel=2e-3)


def test_what_the_gate_rejects_of_code_solutions() -> None:
    """Oracle: by hand: the share of the positions, or half of that of the velocities."""
    for of_position, of_velocity, expected in ((3, 4, 0.3), (1, 4, 0.2), (0, 0, 0.0)):
        verdict = np.full((12, 5), NOT_MEASURED)
        verdict[:10, :2] = USED
        verdict[:of_position, 0], verdict[:of_velocity, 1] = REJECTED, REJECTED
        assert time_correlated._rejected_share(SimpleNamespace(verdict=verdict)) == pytest.approx(
            expected
        )


@pytest.mark.parametrize(
    ("changes", "found"),
    [
        ({}, True),
        ({"gained": 39.0}, False),  # log evidence of 19.5
        ({"gained": None}, True),  # there is no solution without it
        ({"speed": 1.9}, False),  # 19 mm
        ({"speed": 2.1}, True),
        ({"resets": 1}, False),
        ({"rejected": 6}, False),
        ({"candidate": False}, False),
    ],
)
def test_when_a_clock_steps(monkeypatch, changes, found) -> None:
    """Oracle: the rules by hand: an evidence of twenty, two centimetres of way, fixes that are
    followed without a jump; the fixes on either side."""
    gained = changes.get("gained", 41.0)
    after = solved(
        100 - changes.get("rejected", 0), changes.get("rejected", 0), changes.get("resets", 0)
    )
    shown = SimpleNamespace(since=3.2, lapse=None, loses_samples=False)
    candidate = shown if changes.get("candidate", True) else None
    monkeypatch.setattr(clock_step, "widen_layout", lambda problem, start, layout: (problem, start))
    monkeypatch.setattr(clock_step, "replace", lambda problem, **changes: problem)
    monkeypatch.setattr(clock_step, "_strongest", lambda *_: candidate)
    monkeypatch.setattr(clock_step, "_refine_step", lambda *_: (None, 3.2, -0.01, 1e-3))
    monkeypatch.setattr(clock_step, "solve", lambda *_: after)
    monkeypatch.setattr(clock_step, "misfit", lambda one: 0.0 if one is after else gained)
    monkeypatch.setattr(clock_step, "rms_speed", lambda _: changes.get("speed", 10.0))
    epochs = SimpleNamespace(
        withheld=np.zeros(9, bool), time=np.arange(9.0), has_position=np.arange(9) != 4
    )
    epochs._replace = lambda **_: epochs
    problem = SimpleNamespace(
        epochs=epochs, layout=None, inc=SimpleNamespace(marks=np.array([100.0]))
    )
    against = None if gained is None else "other"
    step = clock_step.find_clock_step(problem, None, None, against)
    assert (step is not None) is found
    if step is not None:
        assert (step.before, step.after) == (103.0, 105.0)
        assert (step.size, step.sigma, step.of_imu) == (-0.01, 1e-3, False)
        assert step.evidence == (np.inf if gained is None else 20.5)


def test_gaps_that_may_be_steps_of_the_imus_clock() -> None:
    """Oracle: by hand: of bridged epochs the intervals longer than 1.5 nominal ones, by their
    length, sixteen at most; without the lapse a gap is one sample long."""
    n = 400
    dt = np.full(n, 0.1)
    gap = np.zeros((n + 1, 6))
    for k, length in enumerate(np.linspace(0.14, 1.0, 20)):
        dt[20 * k + 5] = length
        gap[20 * k + 6 : 20 * k + 8, 0] = 1.0
    has = np.ones(n + 1, dtype=bool)
    epochs = SimpleNamespace(stop=np.arange(n + 1), gap=gap, has_position=has)
    inc = SimpleNamespace(dt=dt, nominal_s=0.1, dtheta=np.ones((n, 3)), dvel=np.ones((n, 3)))
    problem = SimpleNamespace(epochs=epochs, inc=inc)
    gaps = clock_step._gaps(problem)
    assert len(gaps) == 16
    assert_allclose([one.step_s for one in gaps], np.linspace(0.14, 1.0, 20)[:3:-1] - 0.1)
    assert gaps[0].epochs.tolist() == [386, 387]
    assert gaps[0].intervals.tolist() == [385]
    for interval, found in ((0.149, 0), (0.151, 16)):
        dt[:] = interval
        assert len(clock_step._gaps(problem)) == found


@pytest.mark.parametrize(("gain", "contradicts"), [(19.9, False), (20.1, True), (None, True)])
def test_biases_that_the_innovations_show(monkeypatch, gain, contradicts) -> None:
    """Oracle: a gain of twenty, on either side; no solution without them."""
    monkeypatch.setattr(evidence_module, "misfit", lambda one: {"with": 0.0, "without": gain}[one])
    model = NoiseModel("m", "", (AxisNoise(white_noise=1.0),) * 3, (AxisNoise(),) * 3)
    check = evidence_module.check_biases_in_innovations(
        model, None if gain is None else "without", lambda: "with"
    )
    assert (check is not None) is contradicts
    assert evidence_module.without_turn_on(model) == ("gyro",)
    biases = [axis.turn_on_bias for axis in evidence_module.with_turn_on(model).gyro]
    assert_allclose(biases, np.radians(100.0 / 3600.0))


def test_what_the_data_alone_say_of_constants() -> None:
    """Oracle: numpy's normal equations: a filter that knows a constant to its stated sigma has the
    information of the data without it, less what the constant itself took up."""
    rng = np.random.default_rng(5)
    A, y = rng.normal(size=(30, 2)), rng.normal(size=30)
    stated, wide = np.array([0.3, 0.0]), np.array([2.0, 5.0])
    V = np.eye(30) + stated[0] ** 2 * np.outer(A[:, 0], A[:, 0])
    J, j = A.T @ np.linalg.solve(V, A), A.T @ np.linalg.solve(V, y)
    known = SimpleNamespace(stated=stated, wide=wide)
    information, vector = Sensitivity(None, known, None, J, j).of_the_data()
    assert_allclose(information, A.T @ A * np.outer(wide, wide), rtol=1e-9)
    assert_allclose(vector, A.T @ y * wide, rtol=1e-9)


@pytest.mark.parametrize(
    ("attempted", "requested", "resets", "looks"),
    [
        ((), (), 0, False),
        ((TIME_OFFSET,), (), 0, True),
        ((), (TIME_OFFSET.group,), 0, True),
        ((OF_LEVER_ARM[0],), (), 0, False),
        ((), (), 1, True),
    ],
)
def test_when_a_step_of_a_clock_is_looked_for(
    monkeypatch, attempted, requested, resets, looks
) -> None:
    """Oracle: by hand: where an offset or a rate is adopted or requested, or fixes were lost."""
    monkeypatch.setattr(decision, "step_under", lambda search, posed, model, against: "step")
    search = SimpleNamespace(requested=requested, requested_model=decision.ErrorModel(FixErrors()))
    here = SimpleNamespace(
        attempted=frozenset(attempted),
        model=decision.ErrorModel(FixErrors()),
        solution=solved(resets=resets),
    )
    assert decision._clock_step(search, None, here) == ("step" if looks else None)


def test_what_is_settled_beside_needs_no_pass(monkeypatch) -> None:
    """Oracle: by hand: the evidence that was followed along spares the pass; of too few fixes
    nothing is looked at; three winners at most."""
    passes, rounds = [], []

    def adopted(search, posed, here, constants):
        rounds.append(constants)
        return here if len(rounds) < 9 else None

    search = SimpleNamespace(
        requested_model=decision.ErrorModel(FixErrors()),
        progress=lambda _: None,
        requested=(),
        exact=(),
        events_with_fixes=False,
        constants=lambda *_: passes.append(1),
    )
    monkeypatch.setattr(decision, "settled_evidence", lambda *_: settled)
    monkeypatch.setattr(decision, "next_state", adopted)
    monkeypatch.setattr(decision, "_clock_step", lambda *_: None)
    monkeypatch.setattr(decision, "unseen_constants", lambda *_: None)
    few, enough = solved(59), solved(60)
    enough.problem.epochs = SimpleNamespace(time=np.array([0.0, 10.0]))
    assert decision.diagnose(search, None, few).solution is few
    assert rounds == []
    settled = SimpleNamespace(estimates=lambda middle_s: (middle_s,))
    found = decision.diagnose(search, None, enough)
    assert (len(rounds), passes, found.constants) == (3, [], (5.0,))
    settled = None
    decision.diagnose(search, None, enough)
    assert len(passes) == 3


@pytest.mark.parametrize(("interval_s", "followed"), [(0.2, True), (0.22, False)])
def test_constants_are_followed_between_epochs_that_are_near(
    monkeypatch, interval_s, followed
) -> None:
    """Oracle: by hand: 0.21 s; no barometer, NHC or measurement of one's own in the pass."""
    monkeypatch.setattr(constants.Constants, "of", lambda *_: "constants")
    monkeypatch.setattr(constants.Sensitivity, "before", lambda *_: "followed")
    layout = SimpleNamespace(states=())

    def found(constraint=0, barometer=0.0, gates=(), linearised=True):
        epochs = SimpleNamespace(
            time=interval_s * np.arange(9.0),
            barometer_variance=np.full(9, barometer),
            constraint=np.full(9, constraint),
        )
        problem = SimpleNamespace(
            epochs=epochs, layout=layout, gates_of_measurements=gates, linearised=linearised
        )
        return constants.followed_constants(problem, layout) is not None

    assert found() is followed
    assert found(constraint=1) is followed  # a stand
    assert not found(constraint=2)
    assert not found(barometer=1.0)
    assert not found(gates=(9.0,))
    assert found(gates=(9.0,), linearised=False) is followed


@pytest.mark.parametrize(
    ("solutions", "fits", "scale"),
    [
        ([0.0] * 4, 3, 0.5),  # of white shares, then of all, three times
        ([0.04] * 4, 3, 0.5),
        ([0.06, 0.0, 0.0, 0.0, 0.0], 3, 0.5 * 1.6),  # whiter first
        ([None, 0.0, 0.0, 0.0, 0.0], 3, 0.5 * 1.6),
        ([0.0, 0.0, 0.06, 0.0], 2, 0.5 * 1.6),  # whiter last, and as it is
        ([0.06] * 9, 0, None),
    ],
)
def test_rounds_of_a_fit_of_code_errors(monkeypatch, solutions, fits, scale) -> None:
    """Oracle: by hand: up to 5 % of the fixes rejected, three fits, six whiter attempts."""
    queue, fitted = list(solutions), []

    def solve(*_, **__):
        share = queue.pop(0)
        if share is None:
            raise DataError("no solution")
        return share

    def maximum(solution, white_only, progress):
        fitted.append(white_only)
        return {"fixes.position": 1.5, "fixes.unfixed_correlated": 1.0}

    monkeypatch.setattr(time_correlated, "solve", solve)
    monkeypatch.setattr(time_correlated, "with_layout", lambda *_: ())
    monkeypatch.setattr(time_correlated, "_rejected_share", lambda share: share)
    monkeypatch.setattr(time_correlated, "_maximum", maximum)
    model = FixErrors(unfixed_gm_sigma=1.0, unfixed_white_scale=0.5)
    got = time_correlated._fit(None, None, lambda _: None, model, lambda _: None)
    assert fitted == [True, False, False][:fits]
    if scale is None:
        assert got is None
    else:
        assert got is not None
        assert got.unfixed_white_scale == pytest.approx(scale * 1.5**fits)
