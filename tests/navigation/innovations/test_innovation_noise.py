"""Noise in flight from innovations: recovered where vibration raises it, and left alone where
something else is wrong.
"""

from dataclasses import replace

import numpy as np
import pytest
from flown import Flown, error_of, fly, start_near
from numpy.testing import assert_allclose
from scipy.stats import chi2

from insgnss.base.errors import DataError, UsageError
from insgnss.navigation.filter.layout import BarometerErrors, FixErrors, state_layout
from insgnss.navigation.filter.solution import Solution, solve
from insgnss.navigation.innovations.innovation_noise import (
    InFlightNoise,
    in_flight_noise,
    whiteness,
)
from insgnss.navigation.innovations.pieces import moving_parts, without_correlated
from insgnss.navigation.noise_model.model import NoiseModel, load_noise_model
from insgnss.simulation.raw_gnss.receiver import GnssOptions

SIGMA = np.array([0.5, 0.5, 0.5, 0.3, 0.3, 0.3, *np.radians([1.0, 1.0, 5.0])])
NAVCHIP = load_noise_model("navchip")
STATIC = state_layout(NAVCHIP)
NOWHERE = np.zeros((0, 2))
GOOD = GnssOptions(sigma_m=(0.005, 0.005, 0.008))
TRIPLED = 3.0


def louder(gyro: float, accel: float) -> NoiseModel:
    """The NavChip with factors on its white noise."""
    triads = [
        tuple(replace(axis, white_noise=f * axis.white_noise) for axis in triad)
        for triad, f in ((NAVCHIP.gyro, gyro), (NAVCHIP.accel, accel))
    ]
    return NoiseModel("louder", "made up", *triads)


def flown(
    seconds: float, seed: int, factor: float = TRIPLED, gnss: GnssOptions = GOOD, **changes: object
) -> Flown:
    """A flight whose IMU is louder by `factor` than the filter's model says."""
    return fly(
        seconds,
        seed,
        imu_hz=100.0,
        noise=louder(factor, factor),
        layout=STATIC,
        gnss=gnss,
        **changes,
    )


def solved(flight: Flown) -> Solution:
    return solve(flight.problem, start_near(flight, SIGMA), separations=0)


def estimate(solution: Solution, *parameters: str) -> InFlightNoise:
    return in_flight_noise(
        moving_parts(solution, NOWHERE), parameters or ("gyro.white_noise", "accel.white_noise")
    )


@pytest.fixture(scope="module")
def tripled() -> list[InFlightNoise]:
    return [estimate(solved(flown(240.0, seed))) for seed in range(5)]


@pytest.fixture(scope="module")
def quiet() -> Solution:
    """Four minutes with the noise that the model has."""
    return solved(flown(240.0, 11, factor=1.0))


@pytest.mark.slow
def test_tripled_white_noise_is_recovered_with_honest_standard_errors(tripled):
    """Oracle: the simulator's factor of three: ten errors in their standard errors, whose squares
    are chi-square (99.8 % bounds).

    The flights of four minutes tell a triad's factor to 10 to 20 % each; all together they must
    come within 10 %.
    """
    z = np.array([(np.log(n.factor[:2]) - np.log(TRIPLED)) / n.log_sigma[:2] for n in tripled])
    low, high = chi2.ppf([0.001, 0.999], z.size)
    assert low < np.sum(z**2) < high
    assert all(0.05 < sigma < 0.25 for n in tripled for sigma in n.log_sigma[:2])
    weight = np.array([n.log_sigma[:2] ** -2.0 for n in tripled])
    together = np.exp(
        np.sum(weight * np.log([n.factor[:2] for n in tripled]), axis=0) / weight.sum(axis=0)
    )
    assert_allclose(together, TRIPLED, rtol=0.1)


@pytest.mark.slow
def test_innovations_are_white_and_of_their_size_after_it(tripled):
    """Oracle: what innovations of a true model are: white (a chance below 1 % of three directions
    in five flights once or twice), NIS 1.
    """
    before, after = ([getattr(n, when) for n in tripled] for when in ("before", "after"))
    assert sum((w.whiteness.p_value < 0.01).sum() for w in before) > 10
    assert sum((w.whiteness.p_value < 0.01).sum() for w in after) < 3
    assert np.mean([w.nis for w in before]) > 1.02
    assert abs(np.mean([w.nis for w in after]) - 1.0) < 0.02
    assert all(n.significant and n.white and not n.held and not n.off_claim for n in tripled)


@pytest.mark.slow
def test_a_true_static_model_stays(quiet):
    """Oracle: the simulator's factor of one: within three standard errors, its gain no more than
    chance.
    """
    n = estimate(quiet)
    assert not n.significant
    told = n.log_sigma > 0.0
    assert (np.abs(np.log(n.factor[told])) < 3.0 * n.log_sigma[told]).all()
    assert n.factor[2] == pytest.approx(1.0, abs=0.05)


@pytest.mark.slow
def test_fixes_that_claim_too_little_are_no_noise_of_the_imu(quiet):
    """Oracle: sigmas claimed at half of what the simulator drew, with an IMU as its model says:
    twice for the fixes, one for the IMU.
    """
    ep = quiet.problem.epochs
    problem = replace(
        quiet.problem,
        epochs=ep._replace(position_cov=0.25 * ep.position_cov, sigma=0.5 * ep.sigma),
        gate=1e12,
    )
    n = estimate(replace(quiet, problem=problem))
    assert n.off_claim == ("fixes.position",)
    assert n.factor[2] == pytest.approx(2.0, rel=0.03)
    assert not n.significant
    assert n.before.nis == pytest.approx(4.0, rel=0.1)
    assert [nis.nis for nis in n.compared] == pytest.approx([1.0, 1.0], abs=0.05)


@pytest.mark.slow
def test_driving_noise_is_a_parameter_too():
    """Oracle: a model that has the driving noise of the accelerometers at a twentieth of what the
    simulator drew.
    """
    processes = tuple(
        replace(gm, driving_noise=20.0 * gm.driving_noise) for gm in NAVCHIP.accel[0].gauss_markov
    )
    axis = replace(NAVCHIP.accel[0], gauss_markov=processes)
    drifting = NoiseModel("drifting", "made up", NAVCHIP.gyro, (axis,) * 3)
    flight = fly(240.0, 13, imu_hz=100.0, noise=drifting, layout=STATIC, gnss=GOOD)
    n = estimate(solved(flight), "accel.driving_noise")
    assert n.significant
    assert abs(np.log(n.factor[0] / 20.0)) < 3.5 * n.log_sigma[0]


def test_what_a_short_flight_does_not_tell_is_held():
    """Oracle: half a minute with fixes of decimetres cannot know the white noise of a NavChip."""
    n = estimate(solved(flown(30.0, 12, factor=1.0, gnss=GnssOptions(sigma_m=(0.2, 0.2, 0.3)))))
    assert dict(n.held).keys() == {"gyro.white_noise", "accel.white_noise"}
    assert (n.free, n.chance) == (0, 1.0)
    assert n.imu_factors() == {"gyro.white_noise": 1.0, "accel.white_noise": 1.0}


@pytest.mark.slow
def test_a_factor_far_from_one_is_found():
    """Oracle: the simulator's factors of 120 for the gyroscopes and 3 for the accelerometers:
    within three standard errors.
    """
    quiet_gyros = state_layout(louder(1.0 / 40.0, 1.0))
    n = estimate(
        solved(fly(240.0, 15, imu_hz=100.0, noise=louder(3.0, 3.0), layout=quiet_gyros, gnss=GOOD))
    )
    assert not n.held
    assert n.white
    assert (np.abs(np.log(n.factor[:2] / [120.0, 3.0])) < 3.0 * n.log_sigma[:2]).all()


def test_what_is_held_but_ruled_out_is_reported():
    """Oracle: an IMU whose accelerometers are a thousandth as loud as the model says: out of the
    search, and not as the model has it.
    """
    loud = state_layout(louder(1.0, 1000.0))
    n = estimate(solved(fly(120.0, 16, imu_hz=100.0, noise=NAVCHIP, layout=loud, gnss=GOOD)))
    assert "accel.white_noise" in dict(n.held)
    assert n.loss > 100.0
    assert n.asks_for_more


def test_rests_are_left_out(quiet):
    """Oracle: times of the epochs; parts of less than 20 s go."""
    t0 = quiet.time[0]
    parts = moving_parts(quiet, np.array([[t0 + 50.0, t0 + 60.0], [t0 + 70.0, t0 + 200.0]]))
    assert [(round(p.time[0] - t0), round(p.time[-1] - t0)) for p in parts] == [(0, 50), (200, 240)]
    for part in parts:
        first = int(np.argmin(np.abs(quiet.time - part.time[0])))
        assert_allclose(part.nav, quiet.nav[first : first + part.time.size])
        assert part.problem.epochs.time[0] == 0.0
    with pytest.raises(DataError, match="standing"):
        in_flight_noise(moving_parts(quiet, np.array([[t0, t0 + 240.0]])))
    with pytest.raises(UsageError, match=r"fixes\.velocity"):
        in_flight_noise(parts, ("fixes.velocity",))


def test_a_solution_without_its_correlated_error_is_that_of_a_layout_without(quiet):
    """Oracle: the layout made without it; names and arrays agree, and the truth is as far away."""
    errors = FixErrors(
        lever_arm_m=0.1, gm_sigma=(1.0, 1.0, 1.0), unfixed_gm_sigma=1.0, white_scale=(0.5, 0.5, 0.5)
    )
    baro = BarometerErrors(10.0, 0.1, 0.05)
    wide = state_layout(NAVCHIP, fixes=errors, barometer=baro)
    white = replace(errors, gm_sigma=None, white_scale=(1.0, 1.0, 1.0))
    bare = state_layout(NAVCHIP, fixes=white, barometer=baro)
    flight = fly(30.0, 14, imu_hz=100.0, layout=wide)
    solution = without_correlated(solved(flight))
    for name in ("states", "lever", "gm", "unfixed_gm", "barometer", "white_scale"):
        assert getattr(solution.problem.layout, name) == getattr(bare, name)
    for name in ("channel", "factor", "beta", "drive", "sigma0"):
        assert_allclose(getattr(solution.problem.layout, name), getattr(bare, name))
    assert solution.covariance(np.array([3])).shape[1:] == (bare.size, bare.size)
    assert solution.x.shape[1] == bare.size - 9
    assert np.abs(error_of(solution.nav, flight.true_nav())[:, :3]).max() < 0.3


def test_whiteness_tells_white_from_coloured():
    """Oracle: Ljung and Box's sum term by term, and an autoregression of known correlation."""
    rng = np.random.default_rng(5)
    e = rng.standard_normal((4000, 3))
    e[:, 2] = np.convolve(rng.standard_normal(4200), 0.5 ** np.arange(60))[:4000]
    w = whiteness(e)
    n, x = len(e), e[:, 0] - e[:, 0].mean()
    r = [np.corrcoef(x[:-k], x[k:])[0, 1] for k in range(1, w.lags + 1)]
    assert w.portmanteau[0] == pytest.approx(
        n * (n + 2) * sum(v**2 / (n - k) for k, v in enumerate(r, start=1)), rel=0.02
    )
    assert w.bound == pytest.approx(2.576 / np.sqrt(n), rel=1e-3)
    assert (w.p_value[:2] > 1e-3).all()
    assert w.p_value[2] < 1e-12
    assert w.lag_one[2] == pytest.approx(0.5, abs=0.05)
    assert (w.together[:2] < 0.1).all()
    assert w.together[2] == pytest.approx(np.sqrt(1.0 / 3.0), abs=0.05)  # of 0.25^l, l = 1, 2, ...
