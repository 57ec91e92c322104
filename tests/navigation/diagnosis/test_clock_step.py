"""A clock that steps in mid flight: when, by how much, and whose; rates and offsets are none."""

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from flown import Flown, fly, start_near
from numpy.testing import assert_allclose

from insgnss.navigation.diagnosis.candidates import (
    FAR_FACTOR,
    ErrorModel,
    with_constants,
    with_layout,
)
from insgnss.navigation.diagnosis.clock_step import ClockStep, find_clock_step, step_check
from insgnss.navigation.diagnosis.clock_step import _insert_lost_time as bridged
from insgnss.navigation.diagnosis.clock_step import _move_fixes as moved_fixes
from insgnss.navigation.filter.epochs import make_epochs
from insgnss.navigation.filter.layout import FixErrors, StateLayout, state_layout
from insgnss.navigation.filter.solution import solve
from insgnss.navigation.noise_model.model import load_noise_model
from insgnss.navigation.prepare.clock import cut_fixes
from insgnss.navigation.prepare.increments import body_increments, merge_marks
from insgnss.records import GnssFixes, ImuSamples
from insgnss.records.states import TIME_OFFSET

SIGMA = np.array([0.5, 0.5, 0.5, 0.3, 0.3, 0.3, *np.radians([1.0, 1.0, 5.0])])
LONG_S, AT_S = 200.0, 90.0
Times = Callable[[np.ndarray], np.ndarray]


def with_clock() -> StateLayout:
    model = with_constants(ErrorModel(FixErrors()), [TIME_OFFSET], FAR_FACTOR)
    return state_layout(load_noise_model("navchip"), False, False, model.fixes)


@pytest.fixture(scope="module")
def clean() -> Flown:
    return fly(LONG_S, seed=31, imu_hz=100.0)


def posed(flown: Flown, imu: Times, gnss: Times) -> Flown:
    """The flight with other stamps, as a reader leaves them: each once, in order."""
    start = flown.sim.imu.time[0]
    samples: ImuSamples = flown.sim.imu
    stamps = start + imu(samples.time - start)
    kept = np.flatnonzero(stamps > np.maximum.accumulate(np.r_[-np.inf, stamps[:-1]]))
    samples = replace(
        samples, time=stamps[kept], gyro=samples.gyro[kept], accel=samples.accel[kept]
    )
    fixes: GnssFixes = flown.sim.gnss
    fixes = replace(fixes, time=start + gnss(fixes.time - start))
    fixes = cut_fixes(fixes, samples.time[0], samples.time[-1])
    marks, (at_fix,) = merge_marks(fixes.time)
    inc = body_increments(samples, np.eye(3), marks)
    none = np.zeros(0, dtype=np.int64)
    epochs = make_epochs(inc, at_fix, fixes, none, flown.problem.frame)
    return replace(flown, problem=replace(flown.problem, inc=inc, epochs=epochs))


def same(time: np.ndarray) -> np.ndarray:
    return time


def step(size: float) -> Times:
    return lambda time: time + np.where(time > AT_S, size, 0.0)


def found(flown: Flown) -> ClockStep | None:
    """What is found beyond an offset and a rate of the clock."""
    start, layout = start_near(flown, SIGMA), with_clock()
    problem, wide = with_layout(replace(flown.problem, gate=np.inf), start, layout)
    against = solve(problem, wide, separations=0)
    return find_clock_step(flown.problem, start, layout, against)


@pytest.mark.parametrize(
    ("imu", "gnss", "size", "of_imu", "missing"),
    [
        (step(0.05), same, 0.05, True, 0),
        (same, step(0.05), -0.05, False, 0),
        (same, step(-0.05), 0.05, False, 0),
        # 5 and 20 samples are left out, and the stamps count on: the latter moves the fixes by
        # metres, which a step of the clock in the one interval does not hold
        pytest.param(step(-0.05), same, -0.05, True, 5, marks=pytest.mark.slow),
        pytest.param(step(-0.2), same, -0.2, True, 20, marks=pytest.mark.slow),
    ],
)
def test_a_step_is_found_with_its_size_and_its_instant(clean, imu, gnss, size, of_imu, missing):
    """Oracle: what was planted, by the sign of the flight file: what the fixes' stamps lack; to 4
    sigma, its instant to two intervals of the fixes, and the number of samples that are lost.
    """
    flown = posed(clean, imu, gnss)
    one = found(flown)
    assert one is not None
    assert one.size == pytest.approx(size, abs=4.0 * one.sigma + 1e-3)
    assert one.sigma < 2e-3
    assert (one.of_imu, one.missing) == (of_imu, missing)
    at = clean.sim.imu.time[0] + AT_S
    assert one.before - 0.2 < at < one.after + 0.2
    check = step_check(one)
    assert check.verdict == "contradiction"
    shift = f"{'earlier' if one.size > 0.0 else 'later'} by {abs(one.size):.4f} +-"
    assert (f"{missing} IMU samples were lost" if missing else shift) in check.found
    if missing:  # the same sigma is half a sample or more of a faster IMU
        inc = replace(one.solution.problem.inc, nominal_s=1.9 * one.sigma)
        problem = replace(one.solution.problem, inc=inc)
        faster = replace(one, solution=replace(one.solution, problem=problem))
        assert step_check(faster).found.startswith(f"about {missing} IMU samples")
        assert check.found.startswith(f"{missing} IMU samples")
    assert ("start_tow" in check.advice) == (not of_imu or size > 0.0)


def test_lost_samples_are_bridged_as_a_gap_of_true_stamps(clean):
    """Oracle: the same samples with their true stamps, whose gap `navigation.prepare` bridges: the
    increments of it agree to its variance, the variance to a factor of two, all others agree.
    """
    lost = posed(clean, step(-0.2), same).problem
    gap = posed(clean, lambda t: np.where((t > AT_S + 1e-6) & (t < AT_S + 0.201), -1.0, t), same)
    since = clean.sim.imu.time[0] + AT_S - lost.inc.marks[0]
    mended, true = bridged(lost, since, 0.2), gap.problem
    last = mended.epochs.time.size
    assert_allclose(true.epochs.time[:last], mended.epochs.time)
    totals = []
    for problem in (mended, true):
        inc, stop = problem.inc, problem.epochs.stop[:last]
        sums = np.cumsum(np.hstack([inc.dt[:, None], inc.dtheta, inc.dvel]), axis=0)
        totals.append(np.diff(sums[stop[1:] - 1], axis=0))
    off, variance = totals[0] - totals[1], mended.epochs.gap
    assert_allclose(off[:, 0], 0.0, atol=2e-7)
    of_gap = true.epochs.gap[:last]
    assert ((variance > 0.0) == (of_gap > 0.0)).all()
    inside = variance[2:, 0] > 0.0
    assert_allclose(off[~inside, 1:], 0.0, atol=1e-6)
    assert (np.abs(off[inside, 1:].sum(axis=0)) < 2.0 * np.sqrt(variance.sum(axis=0))).all()
    ratio = variance.sum(axis=0) / of_gap.sum(axis=0)
    assert (ratio > 0.5).all()
    assert (ratio < 2.0).all()


def test_fixes_that_were_withheld_are_heard_again(clean):
    """Oracle: what was planted; after the first turn behind a step its fixes stand apart, and were
    taken for incorrect ones: 30 ms were called a rate of 300 ppm.
    """
    flown = posed(clean, step(0.03), same)
    withheld = flown.problem.epochs.time > AT_S + 15.0
    epochs = flown.problem.epochs._replace(withheld=withheld)
    one = find_clock_step(
        replace(flown.problem, epochs=epochs), start_near(flown, SIGMA), with_clock(), None
    )
    assert one is not None
    assert one.size == pytest.approx(0.03, abs=2e-3)


@pytest.mark.parametrize(
    ("imu", "gnss"),
    [
        (same, same),
        (same, lambda time: time + 0.03),
        (lambda time: time * (1.0 + 2e-4), same),
        # samples that lack, and no clock that steps
        (lambda time: np.where((time > AT_S) & (time < AT_S + 0.05), -1.0, time), same),
        (same, step(5e-4)),
    ],
)
def test_what_is_no_step_is_not_called_one(clean, imu, gnss):
    """Oracle: what was planted: nothing, an offset, a rate, a gap, a step that moves by 6 mm."""
    assert found(posed(clean, imu, gnss)) is None


def test_fixes_that_jump_are_no_clock_that_steps(clean):
    """Oracle: what was planted: from then on all fixes lie half a metre to one side, as after an
    incorrect ambiguity; flying another way shows that it is no time.
    """
    problem = clean.problem
    epochs = problem.epochs
    position = epochs.position + np.where(epochs.time > AT_S, 0.5, 0.0)[:, None] * [1.0, 0.0, 0.0]
    jumped = replace(problem, epochs=epochs._replace(position=position))
    assert found(replace(clean, problem=jumped)) is None


@pytest.mark.parametrize("size", [0.05, -0.05])
def test_velocities_are_moved_along_with_their_fixes(size: float) -> None:
    """Oracle: the exact motion: fixes that are of an instant 50 ms later or earlier from the middle
    on become those of their stamps, positions to 2 mm and velocities, up to 0.2 m/s off in turns,
    to 10 mm/s.
    """
    flown = fly(60.0, seed=31, imu_hz=50.0, velocity=True)
    problem, motion = flown.problem, flown.sim.flight.motion
    epochs, time = problem.epochs, problem.inc.marks

    def fixes(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        antenna = motion.position(at) + motion.C_lb(at) @ problem.antenna_lever_b
        return antenna, motion.velocity(at)

    since = 30.0
    taken = np.where(epochs.time >= since, np.clip(time + size, time[0], time[-1]), time)
    position, velocity = fixes(taken)
    late = replace(problem, epochs=epochs._replace(position=position, velocity=velocity))
    solution: Any = SimpleNamespace(nav=flown.true_nav())
    mended = moved_fixes(late, solution, since, size).epochs
    inside = epochs.has_position & (time < time[-1] - abs(size))
    true_position, true_velocity = fixes(time)
    assert np.abs(velocity - true_velocity)[inside].max() > 0.1
    assert np.abs(mended.position - true_position)[inside].max() < 2e-3
    assert np.abs(mended.velocity - true_velocity)[inside].max() < 0.01
