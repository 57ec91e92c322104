"""Fixes minus solution: against the measurement model of the twin, on honest solutions, and on
those that leave their fixes.
"""

from dataclasses import replace

import numpy as np
import pytest
from flown import Flown, fly, start_near
from numpy.testing import assert_allclose

from insgnss.flight.reference.measurements import measurement
from insgnss.flight.reference.strapdown import NominalState
from insgnss.navigation.filter.codes import POSITION_ROW, REJECTED, USED, VEL
from insgnss.navigation.filter.layout import FixErrors, StateLayout, state_layout
from insgnss.navigation.filter.solution import Solution, solve
from insgnss.navigation.innovations.residuals import mean_residuals, weighted_mean, worst_piece
from insgnss.navigation.noise_model.model import load_noise_model
from insgnss.report.statistics import BEYOND_BOUND, residual_limit

SECONDS = 25.0
ALIGNED = np.array([1.0, 1.0, 1.0, 0.5, 0.5, 0.5, *np.radians([0.5, 0.5, 1.0])])


def layout(fixes: FixErrors) -> StateLayout:
    return state_layout(load_noise_model("navchip"), fixes=fixes)


def solved(fixes: FixErrors) -> tuple[Flown, Solution]:
    flown = fly(SECONDS, seed=6, imu_hz=100.0, layout=layout(fixes))
    return flown, solve(flown.problem, start_near(flown, ALIGNED), "off", separations=0)


@pytest.fixture(scope="module")
def plain() -> Solution:
    return solved(FixErrors())[1]


def test_means_are_those_of_the_measurement_model():
    """Oracle: (T.15) of the twin, its derivative by central differences, without the
    time-correlated errors; (Y.1) written out fix by fix.
    """
    errors = FixErrors(
        lever_arm_m=0.03,
        time_offset_s=0.01,
        clock_rate=1e-4,
        gm_sigma=(0.5, 0.6, 0.7),
        white_scale=(0.8, 0.7, 0.6),
    )
    flown, solution = solved(errors)
    problem, states = flown.problem, flown.problem.layout
    solution.verdict[30, POSITION_ROW] = REJECTED
    gm = slice(states.gm, states.gm + 3)
    pieces = mean_residuals(solution)
    assert len(pieces) == 8
    acceleration = np.gradient(solution.nav[:, VEL], solution.time, axis=0)
    for piece in pieces[:3]:
        inside = (solution.time >= piece.begin_s) & (solution.time <= piece.end_s)
        rows = np.flatnonzero(inside & (solution.verdict[:, POSITION_ROW] == USED))
        assert rows.size == piece.fixes
        w, r, white, own = [], [], [], []
        for e in rows:
            x = solution.x[e].copy()
            x[gm] = 0.0
            state = NominalState.from_arrays(solution.nav[e], x)
            H, z, R = measurement(problem, int(e), POSITION_ROW, state, acceleration[e])
            H[:, 9 + states.gm : 12 + states.gm] = 0.0
            r.append(z)
            white.append(np.diag(R))
            own.append(np.diag(H @ solution.covariance(np.array([e]))[0] @ H.T))
        c = problem.epochs.sigma[rows] * errors.gm_sigma
        w = 1.0 / (np.array(white) + c**2)
        w /= w.sum(axis=0)
        variance = (w**2 * white).sum(axis=0) + (w * c).sum(axis=0) ** 2 + np.mean(own, axis=0)
        assert_allclose(piece.mean_m, (w * r).sum(axis=0), atol=2e-6)
        assert_allclose(piece.sigma_m, np.sqrt(variance), rtol=1e-3)


def test_an_honest_solution_stays_with_its_fixes(plain):
    """Oracle: the simulator; the bound for the pieces of the run."""
    pieces = mean_residuals(plain)
    assert worst_piece(pieces)[2] < residual_limit(3 * len(pieces))


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_solution_that_leaves_its_fixes_is_seen(plain, axis):
    """Oracle: by construction, a tenth of the flight is shifted by 0.1 m on one axis."""
    nav = plain.nav.copy()
    fourth = (plain.time > plain.time[0] + 9.5) & (plain.time < plain.time[0] + 12.3)
    nav[fourth, axis] += 0.1
    pieces = mean_residuals(replace(plain, nav=nav))
    worst, of_axis, sigmas = worst_piece(pieces)
    assert of_axis == axis
    assert sigmas > residual_limit(3 * len(pieces))
    assert worst == pieces[3]
    assert worst.mean_m[axis] == pytest.approx(-0.1, abs=0.02)


def test_withheld_and_rejected_fixes_do_not_count(plain):
    """Oracle: by construction, the fixes that are 5 m off were not used."""
    ep = plain.problem.epochs
    odd = np.flatnonzero(ep.has_position)[20:80]
    position, verdict = ep.position.copy(), plain.verdict.copy()
    position[odd] += 5.0
    verdict[odd[:30], POSITION_ROW] = REJECTED
    withheld = ep.withheld.copy()
    withheld[odd[30:]] = True
    problem = replace(plain.problem, epochs=ep._replace(position=position, withheld=withheld))
    pieces = mean_residuals(replace(plain, problem=problem, verdict=verdict))
    assert sum(piece.fixes for piece in pieces) == np.count_nonzero(ep.has_position) - 60
    assert worst_piece(pieces)[2] < residual_limit(3 * len(pieces))


def test_the_limit_is_that_of_the_largest_of_many():
    """Oracle: draws; of 24 correlated standard normal values the largest exceeds the bound no more
    often than stated, of independent ones about as often.
    """
    rng = np.random.default_rng(3)
    n, runs = 24, 200_000
    bound = residual_limit(n)
    largest = np.abs(rng.standard_normal((runs, n))).max(axis=1)
    assert np.mean(largest > bound) == pytest.approx(BEYOND_BOUND, abs=4 * 2.2e-5)
    assert bound > residual_limit(1) > 3.0


@pytest.mark.parametrize("kind", ["white", "correlated", "both", "outage"])
def test_honest_flights_raise_no_alarm(kind):
    """Oracle: 200 flights of 8 min in one axis, of the covariances that their estimate is made of.

    The position is an integrated random walk, estimated by least squares of all fixes at once with
    the true covariance; the statistic is that of the eighths. Shifted by 8 of its sigmas in one
    piece, every one of them is seen.
    """
    rng = np.random.default_rng(17)
    time = np.arange(0.0, 480.0)
    if kind == "outage":
        time = time[(time < 100.0) | ((time > 170.0) & (time % 60.0 < 40.0))]
    white = np.full(time.size, 0.02 if kind != "correlated" else 0.002)
    correlated = np.full(time.size, 0.0 if kind in ("white", "outage") else 0.03)
    apart = np.abs(time[:, None] - time)
    # of an integrated random walk: q t^2 (3 T - t) / 6, t the earlier and T the later instant
    early, later = np.minimum(time[:, None], time), np.maximum(time[:, None], time)
    X = 4.0 + 1e-6 * early**2 * (3.0 * later - early) / 6.0
    R = np.diag(white**2) + np.outer(correlated, correlated) * np.exp(-apart / 45.0)
    gain = np.linalg.solve(X + R, X).T
    P = X - gain @ X
    values, vectors = np.linalg.eigh(X)
    root_x = (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
    values, vectors = np.linalg.eigh(R)
    root_r = (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
    truth = root_x @ rng.standard_normal((time.size, 200))
    fixes = truth + root_r @ rng.standard_normal((time.size, 200))
    residual = fixes - gain @ fixes
    piece = np.minimum((time / 60.0).astype(int), 7)
    ratio, shifted = [], []
    for k in range(8):
        of = piece == k
        if not of.any():
            continue
        one = np.ones((1, 3))
        for run in range(200):
            mean, sigma = weighted_mean(
                residual[of, run, None] * one,
                white[of, None] * one,
                (correlated[of, None] * one)[None],
                np.full(3, np.diag(P)[of].mean()),
            )
            ratio.append(abs(mean[0]) / sigma[0])
            shifted.append(abs(mean[0] + 8.0 * sigma[0]) / sigma[0])
    limit = residual_limit(24)
    assert max(ratio) < limit
    assert min(shifted) > limit
