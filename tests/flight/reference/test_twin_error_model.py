"""Strapdown, error model and measurements of the reference room, each against something that is
neither the core nor itself.
"""

from dataclasses import replace

import numpy as np
from batch_least_squares import batch
from filterpy.common import van_loan_discretization
from flown import fly, without_noise
from numpy.testing import assert_allclose
from posed import Pose, posed

from insgnss.flight.reference.error_model import continuous, earth_rate, influence, propagate
from insgnss.flight.reference.strapdown import NominalState, rotation
from insgnss.flight.reference.twin import run_forward, solve_twin
from insgnss.navigation.filter.layout import FixErrors
from insgnss.navigation.noise_model.model import AxisNoise, GaussMarkov

NOISE_G = AxisNoise(5e-5, 0.0, 5e-3, 1e-4, 1e-4, (GaussMarkov(2.5, 2e-4),), 1e-2, 1e-2)
NOISE_A = AxisNoise(5e-4, 0.0, 5e-2, 1e-3, 1e-3, (GaussMarkov(1.5, 2e-3),), 1e-2, 1e-2)
EVERY = Pose(
    NOISE_G,
    NOISE_A,
    {"scale_factor": True, "misalignment": True},
    FixErrors(0.3, 0.02, 1e-3, (0.8, 0.7, 0.6), 5.0),
)


def test_strapdown_follows_the_exact_motion():
    """Oracle: closed-form motion of the simulator and its ideal IMU at 200 Hz, 12 s of lines and a
    turn, without aiding.

    Measured 6 micrometres, 6e-8 m/s and 6e-12 rad; without the Earth's half turn of (T.5) 80
    micrometres.
    """
    flown = without_noise(fly(12.0, seed=2, imu_hz=200.0, noise=None))
    truth = flown.true_nav()
    state = NominalState.from_arrays(truth[0], np.zeros(flown.problem.layout.size - 9))
    for k in range(1, truth.shape[0]):
        state = propagate(flown.problem, k, state).state
    error = NominalState.from_arrays(truth[-1], state.x).minus(state)
    assert np.abs(error[:3]).max() < 2e-5
    assert np.abs(error[3:6]).max() < 1e-6
    assert np.abs(error[6:9]).max() < 1e-10


def test_rotation_and_its_integral():
    """Oracle: a fine sum of scipy's rotations; the quarter turn about z by hand."""
    from scipy.spatial.transform import Rotation

    for phi in ([0.0, 0.0, 0.5 * np.pi], [1e-5, -2e-5, 3e-5], [0.02, 0.5, -1.0]):
        C, J = rotation(np.array(phi))
        assert_allclose(C, Rotation.from_rotvec(phi).as_matrix(), rtol=0.0, atol=1e-14)
        middles = (np.arange(2000) + 0.5) / 2000.0
        assert_allclose(
            J,
            Rotation.from_rotvec(np.outer(middles, phi)).as_matrix().mean(axis=0),
            rtol=0.0,
            atol=1e-7,
        )
    assert_allclose(
        rotation(np.array([0.0, 0.0, 0.5 * np.pi]))[0] @ [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        atol=1e-15,
    )


def test_transition_is_the_derivative_of_the_strapdown():
    """Oracle: central differences of the nominal carried over a tenth of a second in a turn; steps
    of 1 m, 0.1 m/s, 1e-4 rad, a sigma.
    """
    problem, start = posed(EVERY)
    state = NominalState.from_arrays(
        start.nav, 0.3 * problem.layout.sigma0 * np.cos(np.arange(start.x.size))
    )
    steps = np.concatenate([np.repeat([1.0, 0.1, 1e-4], 3), problem.layout.sigma0])
    numeric = np.column_stack(
        [
            (
                propagate(problem, 5, state.plus(step)).state.minus(
                    propagate(problem, 5, state.plus(-step)).state
                )
            )
            / 2.0
            for step in np.diag(steps)
        ]
    )
    Phi = propagate(problem, 5, state).Phi * steps
    assert np.abs(Phi - numeric)[:3].max() < 1e-6
    assert np.abs(Phi - numeric)[3:6].max() < 2e-6
    assert np.abs(Phi - numeric)[6:9].max() < 2e-8
    assert (np.abs(Phi - numeric)[9:] / problem.layout.sigma0[:, None]).max() < 1e-6


def test_transition_and_noise_of_one_sample_are_van_loans():
    """Oracle: filterpy's van_loan_discretization of the continuous model, constant over the
    sample.
    """
    problem, start = posed(EVERY)
    layout, inc = problem.layout, problem.inc
    one = replace(
        problem,
        epochs=problem.epochs._replace(
            stop=np.arange(problem.epochs.stop.size), time=inc.dt[0] * np.arange(41.0)
        ),
    )
    state = NominalState.from_arrays(start.nav, start.x)
    got = propagate(one, 1, state)
    rates = np.concatenate([inc.dtheta[0], inc.dvel[0]]) / inc.dt[0]
    U = influence(layout, 0.5 * inc.dt[0], 0.0, rates)
    C = 0.5 * (state.C_lb + got.state.C_lb)
    A, W, _ = continuous(layout, C, rates[3:], U, earth_rate(problem), layout.white)
    w, V = np.linalg.eigh(W)
    Phi, Q = van_loan_discretization(A, V * np.sqrt(np.maximum(w, 0.0)), inc.dt[0])
    size = np.concatenate([np.repeat([1.0, 0.1, 1e-2], 3), layout.sigma0])
    assert (np.abs(got.Phi - Phi) * size / size[:, None]).max() < 1e-6
    driven = np.diag(Q) > 0.0
    sigma = np.sqrt(np.diag(Q))
    error = (
        np.abs(got.Q - Q) / np.outer(np.where(driven, sigma, 1.0), np.where(driven, sigma, 1.0))
    )[3:, 3:]
    # measured 3e-4; of position, which one sample moves by nanometres, the trapezoid keeps the size
    assert error.max() < 1e-3


def test_smoothed_flight_is_batch_least_squares():
    """Oracle: all epochs at once about the twin's own nominal, with every state of the error
    model.
    """
    problem, start = posed(EVERY)
    forward, smoothed = run_forward(problem, start), solve_twin(problem, start).smoothed
    expected = batch(forward.linear)
    for k in range(0, problem.epochs.time.size, 8):
        P = expected.covariance(k, k)
        sigma = np.sqrt(np.diag(P))
        assert np.abs((smoothed.mean[k] - expected.mean[k]) / sigma).max() < 1e-7
        assert (np.abs(smoothed.P[k] - P) / np.outer(sigma, sigma)).max() < 1e-7
