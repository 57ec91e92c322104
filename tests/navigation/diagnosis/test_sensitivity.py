"""What constants do to the innovations, as it is followed beside the filter."""

from dataclasses import replace

import numpy as np
import pytest
from flown import Flown, fly, start_near
from numpy.testing import assert_allclose, assert_array_equal

from insgnss.geodesy.rotation import rotation_from_quaternion, rpy_from_rotation
from insgnss.navigation.diagnosis.candidates import ErrorModel, ImuErrors, with_every_constant
from insgnss.navigation.diagnosis.constants import (
    constants_evidence,
    followed_constants,
    group_of,
    settled_evidence,
)
from insgnss.navigation.diagnosis.sensitivity import LONGEST_INTERVAL_S, Constants, Sensitivity
from insgnss.navigation.filter.codes import NAV, NHC
from insgnss.navigation.filter.filter import forward_inputs, make_history, run_filter
from insgnss.navigation.filter.kernels.records import FilterHistory
from insgnss.navigation.filter.layout import FixErrors, StateLayout, state_layout
from insgnss.navigation.filter.linearised import with_measurements
from insgnss.navigation.filter.problem import EstimationProblem
from insgnss.navigation.filter.solution import Solution, solve
from insgnss.navigation.noise_model.model import load_noise_model
from insgnss.records.measurements import Measurement
from insgnss.records.states import (
    CLOCK_RATE,
    MISALIGNMENT,
    OF_LEVER_ARM,
    SCALE_FACTOR,
    TIME_OFFSET,
    State,
)

NAVCHIP = load_noise_model("navchip")
SIGMA = np.array([0.5, 0.5, 0.5, 0.3, 0.3, 0.3, *np.radians([1.0, 1.0, 5.0])])
STATED = ErrorModel(FixErrors(lever_arm_m=2e-3, time_offset_s=1e-4))


def layout(model: ErrorModel) -> StateLayout:
    imu: ImuErrors = model.imu
    of_kinds = imu.scale_factor is not None, imu.misalignment is not None
    return state_layout(imu.of(NAVCHIP), *of_kinds, model.fixes, constants=imu.constants)


WIDE = layout(with_every_constant(STATED))


def posed(flown: Flown) -> Flown:
    """The flight with a lever arm and a time offset that are known to their stated sigmas."""
    return replace(flown, problem=replace(flown.problem, layout=layout(STATED)))


@pytest.fixture(scope="module")
def clean() -> Flown:
    return posed(fly(200.0, seed=31, imu_hz=100.0, velocity=True))


def passed(problem: EstimationProblem, flown: Flown) -> FilterHistory:
    """A pass that is linearised about the truth of the flight, whatever its data say."""
    history = make_history(problem.epochs, problem.layout)
    history.nav[:], history.x[:] = flown.true_nav(), 0.0
    run_filter(problem, start_near(flown, SIGMA), history, closed_loop=False)
    return history


def followed(flown: Flown, history: FilterHistory) -> Sensitivity:
    sensitivity = followed_constants(flown.problem, WIDE)
    assert sensitivity is not None
    intervals = forward_inputs(flown.problem, True)[0]
    sensitivity.through(intervals, flown.problem.epochs, history, 0)
    return sensitivity


def solved(flown: Flown) -> tuple[Solution, Sensitivity]:
    sensitivity = followed_constants(flown.problem, WIDE)
    assert sensitivity is not None
    start = start_near(flown, SIGMA)
    return solve(flown.problem, start, separations=0, follower=sensitivity.through), sensitivity


def with_readings(flown: Flown, channel: int, of: int, share: float) -> EstimationProblem:
    """The flight whose channel holds a share of what another one measures."""
    problem = flown.problem
    inc, rate = problem.inc, problem.epochs.rate.copy()
    both = np.hstack([inc.dtheta, inc.dvel])
    moved = both.copy()
    moved[:, channel] += share * both[:, of]
    if channel < 3:
        rate[:, channel] += share * problem.epochs.rate[:, of]
    inc = replace(inc, dtheta=moved[:, :3].copy(), dvel=moved[:, 3:].copy(), rate=rate)
    return replace(problem, inc=inc, epochs=problem.epochs._replace(rate=rate))


def with_constant(flown: Flown, state: State, size: float) -> EstimationProblem:
    """The flight whose data, or whose flight file, have a constant of another size."""
    problem, k = flown.problem, WIDE.states.index(state)
    if state in OF_LEVER_ARM:
        arm = problem.antenna_lever_b.copy()
        arm[OF_LEVER_ARM.index(state)] -= size
        return replace(problem, antenna_lever_b=arm)
    return with_readings(flown, int(WIDE.channel[k]), int(WIDE.factor[k]), size)


@pytest.mark.parametrize(
    ("state", "size"),
    [
        (OF_LEVER_ARM[0], 1e-4),
        (OF_LEVER_ARM[2], 1e-4),
        (State(SCALE_FACTOR, "x", "", "gyro"), 1e-6),
        (State(MISALIGNMENT, "z from y", "rad", "gyro"), 1e-6),
        (State(SCALE_FACTOR, "z", "", "accel"), 1e-6),
        (State(MISALIGNMENT, "y from z", "rad", "accel"), 1e-6),
    ],
)
def test_a_constant_moves_the_innovations_as_is_followed(clean, state, size):
    """Oracle: the innovations of the same filter over data, or with a lever arm, that are moved by
    a little, whose difference is V: J holds its squares, to a thousandth, as the product of means
    stands for the mean of products over a tenth of a second. j grows by J times what was moved, to
    a hundredth: a lever arm moves the gains as well, and with them what the filter makes of noise.
    """
    before = passed(clean.problem, clean)
    moved = with_constant(clean, state, size)
    after = passed(moved, clean)
    V, S = (after.y - before.y) / size, np.where(before.S > 0.0, before.S, np.inf)
    of_before, of_after = followed(clean, before), followed(replace(clean, problem=moved), after)
    k, J = of_before.constants.states.index(state), of_before.information
    assert_allclose(J[k, k], np.sum(V**2 / S), rtol=1e-3)
    scale = np.sqrt(np.diag(J))
    growth = (of_after.vector - of_before.vector) / (size * scale * scale[k])
    assert_allclose(growth, J[:, k] / (scale * scale[k]), atol=1e-2)


def test_the_evidence_is_that_of_a_filter_with_every_constant_as_a_state(clean):
    """Oracle: that filter. Estimates within a tenth of their sigmas, log evidence within 0.3, what
    its own linearisation, about other states, may make of them.
    """
    solution, sensitivity = solved(clean)
    settled = settled_evidence(solution, sensitivity)
    start = start_near(clean, SIGMA)
    wide = constants_evidence(clean.problem, start, layout(STATED), WIDE)
    assert settled is not None
    assert wide is not None
    assert settled.states == wide.states
    assert_allclose(settled.stated, wide.stated)
    for mine, other in zip(settled.estimates(), wide.estimates(), strict=True):
        assert mine.state == other.state
        assert_allclose(mine.sigma, other.sigma, rtol=0.02)
        assert_allclose(mine.value, other.value, atol=0.1 * other.sigma)
    theirs = {one.groups: one.evidence for one in wide.hypotheses}
    for one in settled.hypotheses[:12]:
        assert_allclose(one.evidence, theirs[one.groups], atol=0.3)


@pytest.mark.parametrize("moved_s", [0.0, 0.03])
def test_both_say_what_the_stamps_of_the_file_lack(moved_s):
    """Oracle: the stamps, which are right or were moved by 30 ms, and an a-priori value of the
    offset that knows it: both correct the file's value, within 4 sigma.
    """
    of_file = fly(60.0, seed=31, imu_hz=50.0)
    estimated = ErrorModel(FixErrors(lever_arm_m=2e-3, time_offset_s=0.1, clock_rate=1e-4))
    own, requested = layout(estimated), (TIME_OFFSET.group, CLOCK_RATE.group)
    problem = replace(of_file.problem, layout=own)
    start = start_near(replace(of_file, problem=problem), SIGMA)
    start.mean[NAV.stop + own.offset] = -moved_s
    follower = followed_constants(problem, WIDE)
    assert follower is not None
    solution = solve(problem, start, separations=0, follower=follower.through)
    beside = settled_evidence(solution, follower, requested)
    pass_ = constants_evidence(problem, start, own, WIDE, requested)
    for found in (beside, pass_):
        assert found is not None
        offset = {one.state: one for one in found.estimates()}[TIME_OFFSET]
        assert abs(offset.value - moved_s) < 4.0 * offset.sigma < 0.02


def test_a_wrong_lever_arm_is_not_settled(clean):
    """Oracle: the lever arm, five centimetres off: ten times what such a flight tells."""
    wrong = replace(clean, problem=with_constant(clean, OF_LEVER_ARM[1], 0.05))
    assert settled_evidence(*solved(wrong)) is None
    assert settled_evidence(*solved(clean)) is not None


def test_what_is_of_another_problem_or_of_a_pass_that_lost_fixes_settles_nothing(clean):
    """Oracle: identity; a verdict of the filter."""
    solution, sensitivity = solved(clean)
    assert settled_evidence(solution, None) is None
    withheld = clean.problem.epochs._replace(withheld=clean.problem.epochs.withheld.copy())
    for changes in ({"gate": 30.0}, {"epochs": withheld}, {"layout": replace(WIDE)}):
        other = replace(solution, problem=replace(clean.problem, **changes))
        assert settled_evidence(other, sensitivity) is None
    nis = solution.nis.copy()
    nis[10:13, 0] = 1e3
    assert settled_evidence(replace(solution, nis=nis), sensitivity) is None


def test_measurements_have_no_say_of_constants_and_need_no_pass_for_it(clean):
    """Oracle: the evidence of the same flight without them, to the bit."""
    at = np.flatnonzero(clean.problem.epochs.has_position)[5::10]
    heading = rpy_from_rotation(rotation_from_quaternion(clean.true_nav(at)[:, 6:]))[:, 2]
    compass = Measurement(
        *("compass", clean.problem.inc.marks[at], heading, 1e-3),
        lambda motion, states: rpy_from_rotation(motion.C_lb)[:, 2],
        period=2.0 * np.pi,
    )
    problem = with_measurements(clean.problem, [compass], [np.arange(at.size)], [at])
    (alone, of_alone), (_, of_both) = solved(clean), solved(replace(clean, problem=problem))
    for one, other in zip(of_alone.of_the_data(), of_both.of_the_data(), strict=True):
        assert_array_equal(one, other)
    solution = solve(problem, start_near(clean, SIGMA))
    assert settled_evidence(solution, of_both) is not None
    assert followed_constants(solution.problem, WIDE) is None
    assert solution.nav_covariance()[:, 8, 8].max() < alone.nav_covariance()[:, 8, 8].max()


def test_what_cannot_be_followed_is_left_to_the_pass(clean):
    """Oracle: the conditions of the docstring, one after the other."""
    epochs = clean.problem.epochs
    constraint = epochs.constraint.copy()
    constraint[5] = NHC
    height = np.full_like(epochs.barometer_variance, 1.0)
    others = [
        replace(clean.problem, epochs=epochs._replace(constraint=constraint)),
        replace(clean.problem, epochs=epochs._replace(barometer_variance=height)),
        replace(
            clean.problem,
            epochs=epochs._replace(time=epochs.time * (1.1 * LONGEST_INTERVAL_S / 0.1)),
        ),
        replace(clean.problem, layout=state_layout(NAVCHIP)),  # no offset whose rate it could be
    ]
    assert followed_constants(clean.problem, WIDE) is not None
    for problem in others:
        assert followed_constants(problem, WIDE) is None
    states = [s for s, state in enumerate(WIDE.states) if group_of(state)]
    assert Constants.of(state_layout(NAVCHIP), WIDE, states) is None
