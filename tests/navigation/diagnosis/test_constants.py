"""Which constant is wrong, by how much, or none: the evidence of the innovations."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from flown import Flown, fly, start_near

from insgnss.navigation.diagnosis.candidates import (
    AS_STATED,
    ErrorModel,
    ImuErrors,
    widen_layout,
    with_constants,
    with_every_constant,
)
from insgnss.navigation.diagnosis.constants import (
    STRONG,
    ConstantsEvidence,
    constants_evidence,
)
from insgnss.navigation.diagnosis.estimated import combine_estimates
from insgnss.navigation.filter.codes import NOT_MEASURED, POSITION_ROW
from insgnss.navigation.filter.filter import make_history, run_filter
from insgnss.navigation.filter.layout import FixErrors, StateLayout, state_layout
from insgnss.navigation.filter.problem import EstimationProblem, InitialState
from insgnss.navigation.filter.solution import solve
from insgnss.navigation.noise_model.model import load_noise_model
from insgnss.records import GnssFixes, ImuSamples
from insgnss.records.states import (
    CLOCK_RATE,
    LEVER_ARM,
    MISALIGNMENT,
    OF_LEVER_ARM,
    SCALE_FACTOR,
    TIME_OFFSET,
    State,
)
from insgnss.records.verdicts import Estimate

NAVCHIP = load_noise_model("navchip")
SIGMA = np.array([0.5, 0.5, 0.5, 0.3, 0.3, 0.3, *np.radians([1.0, 1.0, 5.0])])
NOTHING = ErrorModel(FixErrors())
LONG_S = 240.0
GYRO_SCALES = State(SCALE_FACTOR, sensor="gyro")


def layout(model: ErrorModel) -> StateLayout:
    imu = model.imu
    of_kinds = imu.scale_factor is not None, imu.misalignment is not None
    return state_layout(imu.of(NAVCHIP), *of_kinds, model.fixes, constants=imu.constants)


def posed(flown: Flown, lever=(0.0, 0.0, 0.0)) -> tuple[EstimationProblem, InitialState]:
    """The flight with the antenna where it is not, by `lever`."""
    arm = flown.problem.antenna_lever_b - np.array(lever)
    problem = replace(flown.problem, antenna_lever_b=arm)
    return problem, start_near(replace(flown, problem=problem), SIGMA)


def evidence(flown: Flown, lever=(0.0, 0.0, 0.0)) -> ConstantsEvidence:
    wide = layout(with_every_constant(NOTHING))
    found = constants_evidence(*posed(flown, lever), layout(NOTHING), wide)
    assert found is not None
    return found


@pytest.fixture(scope="module")
def clean() -> Flown:
    return fly(LONG_S, seed=31, imu_hz=100.0)


def cost(problem: EstimationProblem, start: InitialState) -> float:
    """-2 log of the density of all innovations, with an open gate."""
    history = make_history(problem.epochs, problem.layout)
    run_filter(replace(problem, gate=np.inf), start, history)
    fixes = history.verdict[:, POSITION_ROW] != NOT_MEASURED
    S, y = history.S[fixes, :3], history.y[fixes, :3]
    return float(np.sum(np.log(S) + y**2 / S))


def test_what_is_stated_as_exact_gives_way_to_what_explains_as_much(clean):
    """Oracle: by hand; of two hypotheses within three of each other the one that leaves the exact
    lever arm alone is taken, and it has no rival that does not; a weaker one is no explanation.
    """
    arm, scale = OF_LEVER_ARM[1], GYRO_SCALES
    found = replace(evidence(clean), exact=(LEVER_ARM,))
    one = max(found.hypotheses, key=lambda each: each.groups == (arm,))
    for weaker, taken in ((58.0, scale), (50.0, arm)):
        every = (
            replace(one, evidence=60.0),
            replace(one, groups=(scale,), evidence=weaker),
        )
        found.__dict__["hypotheses"] = every
        suspected = found.strongest()
        assert suspected is not None
        assert suspected.groups == (taken,)
        assert found.denied(suspected) == (taken == arm)
        assert found.rivals(suspected) == []
    found = replace(found, exact=())
    found.__dict__["hypotheses"] = every
    assert not found.denied(every[0])


@pytest.mark.parametrize(("log_evidence", "taken"), [(2.5, False), (3.9, False), (4.1, True)])
def test_a_constant_is_no_state_by_chance(log_evidence: float, taken: bool) -> None:
    """Oracle: (D.2) by hand, of one constant of information i that is e of its sigmas off:
    e^2 / (1 + 1/i) / 2 - log(1 + i) / 2; and the bar of 4, which none of 90 right flights reached.
    """
    i = 400.0
    e = np.sqrt((2.0 * log_evidence + np.log1p(i)) * (1.0 + 1.0 / i))
    states, one = (replace(GYRO_SCALES, axis="x"),), np.ones(1)
    found = ConstantsEvidence(states, 0.05 * one, 0.0 * one, i * np.eye(1), e * i**0.5 * one)
    assert found.hypotheses[0].evidence == pytest.approx(log_evidence)
    assert (found.strongest() is not None) == taken


def test_families_within_three_are_compared_by_their_single_axes() -> None:
    """Oracle: (D.2) by hand, of constants of information i without correlation: the evidence of
    several is the sum of theirs, of one that is right -log(1 + i) / 2. Accelerometers win by all
    axes, 4.8 twice against 10 and -3; by single axes a gyro does, and those two stay its rival.
    """
    i = 400.0
    states = tuple(
        State(MISALIGNMENT, axis, "rad", sensor)
        for sensor in ("gyro", "accel")
        for axis in ("x from y", "x from z")
    )
    log_evidence = np.array([10.0, -0.5 * np.log1p(i), 4.8, 4.8])
    e = np.sqrt((2.0 * log_evidence + np.log1p(i)) * (1.0 + 1.0 / i))
    one = np.ones(4)
    found = ConstantsEvidence(states, 0.008 * one, 0.0 * one, i * np.eye(4), e * i**0.5)
    assert found.hypotheses[0].groups == (states[0].of_all_axes, states[2].of_all_axes)
    by_kind = {h.groups: h.evidence for h in found.hypotheses if len(h.groups) == 1}
    assert by_kind[(states[2].of_all_axes,)] == pytest.approx(9.6)
    assert by_kind[(states[0].of_all_axes,)] == pytest.approx(10.0 - 0.5 * np.log1p(i))
    found.__dict__["hypotheses"] = tuple(h for h in found.hypotheses if len(h.groups) == 1)
    suspected = found.strongest()
    assert suspected is not None
    assert suspected.groups == states[:1]
    assert suspected.evidence == pytest.approx(10.0)
    (rival,) = found.rivals(suspected)
    assert set(rival.groups) == set(states[2:])


@pytest.mark.parametrize("lever", [(0.0, 0.0, 0.0), (0.0, 0.1, 0.0)])
def test_evidence_is_the_ratio_of_two_likelihoods(clean, lever):
    """Oracle: the densities of all innovations of two filters, one with the constants as states and
    one without (Schweppe), whose logarithms differ by the evidence; a hundredth of it and 0.3 for
    the gate and the linearisation.
    """
    found = evidence(clean, lever)
    problem, start = posed(clean, lever)
    (together,) = [one for one in found.hypotheses if set(one.groups) == set(OF_LEVER_ARM)]
    model = with_constants(NOTHING, OF_LEVER_ARM, together.factor)
    with_states = layout(model)
    wide = replace(problem, layout=with_states)
    P = np.diag(np.concatenate([SIGMA, with_states.sigma0]) ** 2)
    size = with_states.size
    wide_start = InitialState(start.nav, np.zeros(size - 9), np.zeros(size), P)
    ratio = 0.5 * (cost(problem, start) - cost(wide, wide_start))
    assert together.evidence == pytest.approx(ratio, abs=0.3 + 0.01 * abs(ratio))


def test_nothing_is_suspected_where_nothing_is_wrong(clean):
    """Oracle: the simulator; what this flight alone knows of the constants, as filter states that
    are estimated one at a time know it.
    """
    found = evidence(clean)
    assert found.strongest() is None
    known = found.known_to()
    assert 0.002 < known[OF_LEVER_ARM[2]] < 0.02
    assert 1e-4 < known[TIME_OFFSET] < 2e-3


def late(seconds: float) -> Callable[[Any], Any]:
    return lambda flown: _with(flown, gnss=lambda g: replace(g, time=g.time + seconds))


def _with(
    flown: Flown,
    imu: Callable[[ImuSamples], ImuSamples] = lambda imu: imu,
    gnss: Callable[[GnssFixes], GnssFixes] = lambda gnss: gnss,
) -> Flown:
    """The flight with other samples and fixes, posed again."""
    from insgnss.navigation.filter.epochs import make_epochs
    from insgnss.navigation.prepare.clock import cut_fixes
    from insgnss.navigation.prepare.increments import body_increments, merge_marks

    samples, fixes = imu(flown.sim.imu), gnss(flown.sim.gnss)
    fixes = cut_fixes(fixes, samples.time[0], samples.time[-1])
    marks, (at_fix,) = merge_marks(fixes.time)
    inc = body_increments(samples, np.eye(3), marks)
    none = np.zeros(0, dtype=np.int64)
    epochs = make_epochs(inc, at_fix, fixes, none, flown.problem.frame)
    return replace(flown, problem=replace(flown.problem, inc=inc, epochs=epochs))


def faster(imu: ImuSamples) -> ImuSamples:
    start = imu.time[0]
    return replace(imu, time=start + (imu.time - start) * (1.0 + 1e-4))


@pytest.mark.parametrize(
    ("plant", "lever", "groups", "value"),
    [
        (late(0.008), (0, 0, 0), (TIME_OFFSET,), -0.008),
        (late(-0.008), (0, 0, 0), (TIME_OFFSET,), 0.008),
        (lambda f: f, (0, 0, 0.06), OF_LEVER_ARM[2:], 0.06),
        (lambda f: f, (0, -0.08, 0), OF_LEVER_ARM[1:2], -0.08),
        (lambda f: f, (0.1, 0, 0), OF_LEVER_ARM[:1], 0.1),
        (lambda f: f, (0, 0, 1.5), OF_LEVER_ARM[2:], 1.5),
        (lambda f: _with(f, imu=faster), (0, 0, 0), (CLOCK_RATE,), 1e-4),
        (
            lambda f: _with(f, imu=lambda i: replace(i, gyro=1.01 * i.gyro)),
            (0, 0, 0),
            (GYRO_SCALES,),
            0.01,
        ),
        (
            lambda f: _with(f, imu=lambda i: replace(i, accel=1.01 * i.accel)),
            (0, 0, 0),
            (replace(GYRO_SCALES, sensor="accel"),),
            0.01,
        ),
    ],
)
def test_the_right_constant_is_named_with_the_right_number(clean, plant, lever, groups, value):
    """Oracle: what was planted, by the sign conventions of the flight file: what its constants
    lack. By itself it explains the innovations as well as anything does, but for what chance may
    add (forward and time, at two speeds, differ by 20 of 250; five sigma make 12), with a value
    within 4 sigma and the 3 % that the a-priori takes off.
    """
    found = evidence(plant(clean), lever)
    suspected = found.strongest()
    assert suspected is not None
    (planted,) = [one for one in found.hypotheses if one.groups == groups]
    assert planted.evidence > max(5.0, suspected.evidence - 12.0)
    error = np.abs(planted.value - value)
    assert (error < 4.0 * planted.sigma + 0.03 * abs(value)).all()


@pytest.mark.slow
@pytest.mark.parametrize(("row", "column", "axis"), [(0, 1, "x from y"), (0, 2, "x from z")])
def test_one_axis_that_is_wrong_is_estimated_alone(clean, row, column, axis):
    """Oracle: what was planted: one gyro axis turned by 5 mrad towards one other, found alone, to 4
    sigma and the 3 % of the a-priori; the state vector has that one, the attitude's sigma of the
    right flight file grows by less than a half, where twelve states made it twenty times as large.
    """
    turn = np.eye(3)
    turn[row, column] = 0.005
    wrong = _with(clean, imu=lambda i: replace(i, gyro=i.gyro @ turn.T))
    found = evidence(wrong)
    suspected = found.strongest()
    assert suspected is not None
    assert [str(one) for one in suspected.groups] == [f"gyro {axis}"]
    assert abs(suspected.value[0] - 0.005) < 4.0 * suspected.sigma[0] + 1.5e-4
    model = with_constants(NOTHING, suspected.groups, suspected.factor)
    assert set(layout(model).states) - set(layout(NOTHING).states) == set(suspected.groups)
    problem, start = posed(wrong)
    tilt = [
        np.sqrt(np.median(solve(*wider, "off", separations=0).nav_covariance()[:, 6, 6]))
        for one in (NOTHING, model)
        for wider in [widen_layout(problem, start, layout(one))]
    ]
    assert tilt[1] < 1.5 * tilt[0]


def test_outliers_are_no_constants(clean):
    """Oracle: forty fixes 20 m off, one after the other and spread, and nothing else wrong."""

    def outliers(at: slice) -> Callable[[GnssFixes], GnssFixes]:
        def of(fixes: GnssFixes) -> GnssFixes:
            height = fixes.height.copy()
            height[at] += 20.0
            return replace(fixes, height=height)

        return of

    for at in (slice(600, 640), slice(600, 1800, 30)):
        assert evidence(_with(clean, gnss=outliers(at))).strongest() is None


def test_a_constant_that_is_estimated_already_is_not_suspected(clean):
    """Oracle: the lever arm is a state of the flight file's own; 0.1 m are within its sigma."""
    own = ErrorModel(FixErrors(lever_arm_m=0.3), AS_STATED)
    wide = layout(with_every_constant(own))
    requested = (LEVER_ARM,)
    found = constants_evidence(*posed(clean, (0.0, 0.1, 0.0)), layout(own), wide, requested)
    assert found is not None
    assert not any(g in OF_LEVER_ARM for one in found.hypotheses for g in one.groups)
    strongest = found.strongest()
    assert strongest is None or strongest.evidence < STRONG


def test_what_no_sensor_has_is_no_hypothesis(clean):
    """Oracle: the bound of 4 a-priori sigmas; an axis exchange looks like misalignments of a
    radian.
    """
    turned = _with(clean, imu=lambda i: replace(i, gyro=1.2 * i.gyro))
    for one in evidence(turned).hypotheses:
        scale = [v for s, v in zip(one.states, one.value, strict=True) if s.group == SCALE_FACTOR]
        assert all(abs(v) <= 4.0 * ImuErrors(0.01).scale_factor + 1e-12 for v in scale)


def test_estimates_of_a_flight_alone_are_those_of_its_information() -> None:
    """Oracle: normal equations: the data alone and the wide a-priori sigma of the lever arm's three
    components, the time offset marginalised with the sigma that the flight file states; and two
    segments as one by their weights.
    """
    rng = np.random.default_rng(2)
    states = (*OF_LEVER_ARM, TIME_OFFSET)
    wide, stated = np.array([2.0, 2.0, 2.0, 0.5]), np.array([0.005, 0.005, 0.005, 2e-4])
    root = rng.normal(size=(4, 4)) * 100.0
    information, vector = root @ root.T, rng.normal(size=4) * 100.0
    evidence = ConstantsEvidence(states, wide, stated, information, vector)
    estimates = evidence.estimates()
    prior = np.diag([1.0, 1.0, 1.0, (wide[3] / stated[3]) ** 2])
    cov = np.linalg.inv(information + prior)
    expected = wide * (cov @ vector)
    sigma = wide * np.sqrt(np.diag(cov))
    assert [one.state for one in estimates] == list(states)
    assert [one.value for one in estimates[:3]] == pytest.approx(expected[:3])
    assert [one.sigma for one in estimates[:3]] == pytest.approx(sigma[:3])
    same = combine_estimates([estimates, estimates])
    assert [one.value for one in same] == pytest.approx([one.value for one in estimates])
    assert [one.sigma * 2**0.5 for one in same] == pytest.approx([one.sigma for one in estimates])
    blind = ConstantsEvidence(states, wide, stated, np.zeros((4, 4)), np.zeros(4))
    assert blind.estimates() == ()


def test_an_offset_that_changes_is_that_of_the_middle() -> None:
    """Oracle: a straight line by least squares, whose value at the middle is the mean of symmetric
    samples, known to their sigma over sqrt n.
    """
    time, sigma_s = np.linspace(0.0, 200.0, 101), 3e-3
    wide, stated = np.array([0.5, 2e-3]), np.array([0.1, 1e-4])
    value = -0.02 + 3e-5 * time + sigma_s * np.random.default_rng(5).normal(size=time.size)
    A = np.column_stack([np.ones(time.size), time]) * wide / sigma_s
    states = (TIME_OFFSET, CLOCK_RATE)
    evidence = ConstantsEvidence(states, wide, stated, A.T @ A, A.T @ value / sigma_s)
    offset, rate = evidence.estimates(100.0)
    assert offset.value == pytest.approx(value.mean(), abs=2e-6)
    assert offset.sigma == pytest.approx(sigma_s / time.size**0.5, rel=1e-3)
    assert rate.value == evidence.estimates()[1].value


def test_segments_that_differ_have_a_mean_that_is_known_no_better() -> None:
    """Oracle: by hand: -10 and -30 ms of 1 and 2 ms weigh 4 to 1, mean -14, X = 36 + 64 = 80 of the
    variance 0.8 ms^2: a sigma of 8 ms; three that agree have the sigma of their weights.
    """
    apart = [[Estimate(TIME_OFFSET, -10.0, 1.0)], [Estimate(TIME_OFFSET, -30.0, 2.0)]]
    (one,) = combine_estimates(apart)
    assert (one.value, one.sigma) == pytest.approx((-14.0, 8.0))
    (same,) = combine_estimates([*[[Estimate(TIME_OFFSET, -10.0, 3.0)]] * 3, []])
    assert (same.value, same.sigma) == pytest.approx((-10.0, 3.0**0.5))
