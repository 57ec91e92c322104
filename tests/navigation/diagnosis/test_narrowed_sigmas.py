"""Sigmas of the fixes that are too wide: narrowed where the errors are white, and not else."""

from dataclasses import replace

import numpy as np
import pytest
from flown import error_of, fly, start_near
from scipy.stats import chi2

from insgnss.navigation.diagnosis.candidates import ErrorModel
from insgnss.navigation.diagnosis.decision import diagnose
from insgnss.navigation.diagnosis.evidence import ErrorModelSearch
from insgnss.navigation.diagnosis.variances import VarianceSearch, with_variances
from insgnss.navigation.filter.layout import FixErrors, state_layout
from insgnss.navigation.filter.solution import Solution, solve
from insgnss.navigation.innovations.withheld import PIECE_S, predicts, withheld_pieces
from insgnss.navigation.noise_model.model import load_noise_model
from insgnss.records.cameras.mounting import Mounting
from insgnss.simulation.raw_gnss.receiver import GnssOptions

SIGMA = np.array([0.5, 0.5, 0.5, 0.3, 0.3, 0.3, *np.radians([1.0, 1.0, 5.0])])
NAVCHIP = load_noise_model("navchip")
PLAIN = ErrorModel(FixErrors())
LEVEL = Mounting([0.31, -0.12, 0.55], [0.03, 0.0, 0.01], np.eye(3))


def layout_factory(fixes=PLAIN.fixes, imu=PLAIN.imu):
    return state_layout(imu.of(NAVCHIP), fixes=fixes)


def flight(seed, positions=1.0, velocities=1.0, lasting_mps=0.0, time_s=20.0, seconds=120.0):
    """A flight with sigmas so many times too wide, and an error of the velocities that lasts."""
    flown = fly(seconds, seed=seed, imu_hz=100.0, velocity=True, layout=layout_factory())
    epochs = flown.problem.epochs
    rows, draw = np.flatnonzero(epochs.has_velocity), np.random.default_rng(seed)
    velocity, error = epochs.velocity.copy(), lasting_mps * draw.normal(size=3)
    for row, last in zip(rows, np.r_[rows[0], rows[:-1]], strict=True):
        phi = np.exp((epochs.time[last] - epochs.time[row]) / time_s)
        error = phi * error + lasting_mps * np.sqrt(1.0 - phi**2) * draw.normal(size=3)
        velocity[row] += error
    epochs = epochs._replace(
        velocity=velocity,
        position_cov=positions**2 * epochs.position_cov,
        velocity_cov=velocities**2 * epochs.velocity_cov,
    )
    return replace(flown, problem=replace(flown.problem, epochs=epochs))


def solved(flown) -> Solution:
    return solve(flown.problem, start_near(flown, SIGMA), separations=0)


def winner_of(solution):
    search = VarianceSearch(solution, lambda _: None)
    strongest = search.strongest()
    assert strongest is not None
    return search.narrowed(strongest, layout_factory, FixErrors())


@pytest.mark.parametrize("seed", [61, 62])
def test_white_velocities_with_wide_sigmas_are_narrowed(seed):
    """Oracle: the simulator's white errors; the factor is known to 2 % by 3600 innovations."""
    winner = winner_of(solved(flight(seed, velocities=2.5)))
    assert winner.narrowed == ("fixes.velocity",)
    narrowed = with_variances(PLAIN, winner)
    assert narrowed is not None
    assert narrowed.fixes.velocity_white_scale == pytest.approx(0.4, rel=0.06)
    assert narrowed.fixes.white_scale == pytest.approx((1.0,) * 3, abs=0.03)


@pytest.mark.parametrize("time_s", [20.0, 60.0])
@pytest.mark.parametrize("share", [0.5, 1.0])
def test_errors_that_last_are_not_taken_for_small_ones(time_s, share):
    """Oracle: the planted Gauss-Markov errors, which fill the claim, or half of what is left."""
    lasting = share * 0.03 * np.sqrt(2.5**2 - 1.0)
    winner = winner_of(solved(flight(63, velocities=2.5, lasting_mps=lasting, time_s=time_s)))
    assert "fixes.velocity" not in winner.narrowed


@pytest.mark.parametrize("time_s", [15.0, 60.0])
def test_positions_that_err_for_long_are_not_narrowed(time_s):
    """Oracle: the planted Gauss-Markov errors, which fill a claim of 2.5 sigma; white, they are."""
    shape = (0.046, 0.046, 0.069)
    gnss = GnssOptions(correlated_sigma_m=shape, correlation_time_s=time_s)
    for options, narrowed in ((gnss, ()), (GnssOptions(), ("fixes.position",))):
        flown = fly(200.0, seed=65, imu_hz=100.0, gnss=options, layout=layout_factory())
        epochs = flown.problem.epochs
        epochs = epochs._replace(
            position_cov=2.5**2 * np.diag([0.02, 0.02, 0.03]) ** 2 + 0.0 * epochs.position_cov
        )
        problem = replace(flown.problem, epochs=epochs)
        assert winner_of(solved(replace(flown, problem=problem))).narrowed == narrowed


def test_predicted_pieces_judge_the_sigmas():
    """Oracle: the simulator's white errors: normalised squares of one with right sigmas; with half
    of them the pieces are not predicted. What is off is the sigma of a fix and that of the IMU.
    """

    def judged(factor):
        flown = flight(64, factor, factor)
        solution = solved(flown)

        def start(problem):
            return start_near(replace(flown, problem=problem), SIGMA)

        return (
            withheld_pieces(solution, start, PIECE_S),
            predicts(solution, lambda problem: (start(problem), "")),
        )

    (right, honest), (_, overconfident) = judged(1.0), judged(0.5)
    assert right is not None
    assert right.squares.shape == (right.piece.size, 3)
    assert right.of_pieces.size == 2
    assert 0.5 < right.of_pieces.mean() < 1.7
    assert honest
    assert not overconfident


def diagnosed(seed, factor, time_correlated=True) -> tuple[np.ndarray, Solution]:
    """NEES of position and velocity at nine instants, of a flight that is diagnosed."""
    flown = flight(seed, factor, factor, seconds=200.0)
    start = start_near(flown, SIGMA)
    search = ErrorModelSearch(
        FixErrors(),
        layout_factory,
        LEVEL,
        time_correlated,
        "auto",
        lambda _: None,
        lambda problem: (start_near(replace(flown, problem=problem), SIGMA), ""),
    )
    solution = diagnose(search, start, solved(flown)).solution
    rows = np.linspace(0, solution.time.size - 1, 11).astype(int)[1:-1]
    error = error_of(solution.nav[rows], flown.true_nav(rows))[:, :6]
    P = solution.nav_covariance()[rows][:, :6, :6]
    return np.einsum("ni,ni->n", error, np.linalg.solve(P, error[:, :, None])[:, :, 0]), solution


@pytest.mark.slow
@pytest.mark.parametrize("factor", [2.5, 1.0])
def test_sigmas_of_24_flights_are_consistent_after_narrowing(factor):
    """Oracle: exact motion. One instant in the middle of each flight, six degrees of freedom: the
    sum is within the two-sided 99.8 % bounds of chi-square.
    """
    middle = []
    for seed in range(24):
        squares, solution = diagnosed(700 + seed, factor)
        middle.append(squares[4])
        layout = solution.problem.layout
        white = np.r_[layout.white_scale, layout.velocity_white_scale]
        np.testing.assert_allclose(white, 1.0 / factor, rtol=0.1)
    low, high = chi2.ppf([0.001, 0.999], 6 * 24)
    assert low < np.sum(middle) < high
