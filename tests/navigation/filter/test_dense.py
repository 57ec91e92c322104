"""The trajectory between the epochs against the same instants estimated as epochs of their own, and
against the truth.
"""

from dataclasses import replace

import numpy as np
import pytest
from flown import NO_GATE, Flown, fly, start_near
from numpy.testing import assert_allclose, assert_array_equal
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation

from insgnss.geodesy.rotation import vector_from_rotation
from insgnss.navigation.filter import trajectory as module
from insgnss.navigation.filter.solution import Solution, solve
from insgnss.navigation.filter.trajectory import _give_back, dense_trajectory, trajectory
from insgnss.records import Trajectory

SIGMA = np.array([1.0, 1.0, 1.0, 0.5, 0.5, 0.5, *np.radians([0.5, 0.5, 1.0])])
BETWEEN = np.arange(8.035, 22.0, 0.5)  # s after the start, on samples of 200 Hz, 35 ms after a fix


@pytest.fixture(scope="module")
def flown() -> Flown:
    return fly(25.0, seed=6, gate=NO_GATE)


@pytest.fixture(scope="module")
def solution(flown) -> Solution:
    return solve(flown.problem, start_near(flown, SIGMA))


@pytest.fixture(scope="module")
def dense(solution) -> Trajectory:
    return dense_trajectory(solution, 2008)


def as_nav(flown: Flown, path: Trajectory, rows) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position and velocity (k, 3) in l and C_lb (k, 3, 3) of rows of a trajectory."""
    frame = flown.problem.frame
    C_ln = frame.C_ln(path.lat[rows], path.lon[rows])
    position = frame.position_from_geodetic(path.lat[rows], path.lon[rows], path.height[rows])
    return position, np.einsum("nij,nj->ni", C_ln, path.velocity_ned[rows]), C_ln @ path.C_nb[rows]


def difference(flown: Flown, a: Trajectory, rows_a, b: Trajectory, rows_b) -> np.ndarray:
    """(k, 9) a minus b in l."""
    (pa, va, Ca), (pb, vb, Cb) = as_nav(flown, a, rows_a), as_nav(flown, b, rows_b)
    return np.hstack([pa - pb, va - vb, vector_from_rotation(Ca @ np.swapaxes(Cb, -1, -2))])


def test_a_rate_takes_the_first_instant_at_or_after_each_step(solution, dense, monkeypatch):
    """Oracle: all instants, of which the rows are looked up; whatever the epochs worked on at a
    time. At the last instant ends what is wanted.
    """
    for hz in (1.0, 7.3, 60.0, 1000.0):
        wanted = dense.time[0] + np.arange(int((dense.time[-1] - dense.time[0]) * hz) + 1) / hz
        rows = np.unique(np.clip(np.searchsorted(dense.time, wanted - 1e-6), 0, len(dense) - 1))
        for chunk in (1024, 5):
            monkeypatch.setattr(module, "EPOCHS_AT_A_TIME", chunk)
            some = dense_trajectory(solution, 2008, hz)
            for name in ("time", "lat", "lon", "height", "velocity_ned", "C_nb", "cov"):
                expected = getattr(dense, name)[rows]
                assert_allclose(getattr(some, name), expected, rtol=1e-13, atol=1e-13)


def test_there_is_a_row_for_every_sample_and_epoch(flown, dense):
    """Oracle: the union of sample times and epochs, after the first epoch."""
    marks = flown.problem.inc.marks
    samples = flown.sim.imu.time
    inside = samples[(samples > marks[0]) & (samples <= marks[-1])]
    expected = np.union1d(np.round(inside - marks[0], 7), np.round(marks[1:] - marks[0], 7))
    assert_allclose(dense.time - marks[0], expected, rtol=0, atol=2e-7)
    assert dense.gps_week == 2008


def test_at_epochs_it_is_the_smoothed_state(flown, solution, dense):
    """Oracle: the smoothed epochs themselves, states and covariances."""
    at = np.arange(1, solution.time.size)
    epochs = trajectory(solution, at, 2008)
    rows = np.searchsorted(dense.time, epochs.time)
    assert_array_equal(dense.time[rows], epochs.time)
    gap = np.abs(difference(flown, dense, rows, epochs, slice(None)))
    assert gap[:, :3].max() < 1e-8  # rounding of latitude and longitude
    assert gap[:, 3:].max() < 1e-10
    assert_allclose(dense.cov[rows], epochs.cov, rtol=1e-6, atol=1e-15)


def test_between_epochs_it_is_what_an_epoch_there_would_be(flown, solution, dense):
    """Oracle: a second run in which these instants are epochs without measurement.

    Measured: states to 0.0023 of a sigma, standard deviations to 0.2 %.
    """
    inserted = fly(25.0, seed=6, gate=NO_GATE, extra=BETWEEN)
    exact = trajectory(
        solve(inserted.problem, start_near(inserted, SIGMA)), inserted.extra_epochs, 2008
    )
    rows = np.searchsorted(dense.time, exact.time - 1e-7)
    assert_allclose(dense.time[rows], exact.time, rtol=0, atol=1e-7)
    assert not np.isin(exact.time, solution.time).any()
    sigma = np.sqrt(np.diagonal(exact.cov, axis1=1, axis2=2))
    off = np.abs(difference(flown, dense, rows, exact, slice(None))) / sigma
    assert off.max() < 0.01
    assert_allclose(np.sqrt(np.diagonal(dense.cov[rows], axis1=1, axis2=2)), sigma, rtol=0.01)


def test_between_epochs_the_error_is_as_large_as_its_sigma(flown, dense):
    """Oracle: exact motion at all samples of 15 s; the mean normalised square of a component
    correlates over seconds, 0.2 to 3.
    """
    rows = np.flatnonzero((dense.time > dense.time[0] + 7.0) & (dense.time < dense.time[0] + 22.0))[
        ::3
    ]
    motion = flown.sim.flight.motion
    position, velocity, C_lb = as_nav(flown, dense, rows)
    time = dense.time[rows]
    turn = vector_from_rotation(motion.C_lb(time) @ np.swapaxes(C_lb, -1, -2))
    error = np.hstack([motion.position(time) - position, motion.velocity(time) - velocity, turn])
    normalised = (error**2 / np.diagonal(dense.cov[rows], axis1=1, axis2=2)).mean(axis=0)
    assert (normalised < 3.0).all()
    assert 0.4 < normalised.mean() < 1.8


def test_misses_are_given_back_along_a_cubic():
    """Oracle: scipy's cubic Hermite spline from rest at zero to the missed position with the slope
    of the missed velocity.
    """
    missed, share = (
        np.array([1.0, -2.0, 3.0, 4.0, 5.0, -6.0, 0.01, -0.02, 0.03]),
        np.linspace(0.0, 1.0, 11),
    )
    length = np.full(share.size, 0.2)
    nav = np.tile([10.0, 20.0, 30.0, 1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0], (share.size, 1))
    given = nav.copy()
    _give_back(given, np.tile(missed, (share.size, 1)), share, length)
    spline = CubicHermiteSpline([0.0, 0.2], [np.zeros(3), missed[:3]], [np.zeros(3), missed[3:6]])
    assert_allclose(given[:, :3] - nav[:, :3], spline(0.2 * share), rtol=0, atol=1e-12)
    assert_allclose(given[:, 3:6] - nav[:, 3:6], np.outer(share, missed[3:6]), rtol=0, atol=1e-12)
    assert_allclose(
        Rotation.from_quat(given[:, 6:], scalar_first=True).as_rotvec(),
        np.outer(share, missed[6:]),
        rtol=0,
        atol=1e-12,
    )


def test_it_moves_without_steps(flown, dense):
    """Oracle: the velocity is the slope of the position. Central differences over 10 ms at 5 m/s^2
    a second err by 1e-4 m/s.
    """
    position, velocity, _ = as_nav(flown, dense, slice(None))
    even = np.abs(np.diff(dense.time) - 0.005) < 1e-6
    k = np.flatnonzero(even[1:] & even[:-1]) + 1
    slope = (position[k + 1] - position[k - 1]) / (dense.time[k + 1] - dense.time[k - 1])[:, None]
    assert np.abs(slope - velocity[k]).max() < 2e-4


def test_without_noise_it_is_the_exact_motion():
    """Oracle: exact motion; an ideal IMU and start, and fixes that hardly weigh, leave nothing to
    give back.
    """
    flown = fly(12.0, seed=6, noise=None)
    cov = 1e12 * flown.problem.epochs.position_cov
    problem = replace(flown.problem, epochs=flown.problem.epochs._replace(position_cov=cov))
    start = start_near(flown, np.full(9, 1e-6))
    start.P[9:, 9:] = 0.0
    path = dense_trajectory(solve(problem, start, "off"), 2008)
    position, _, C_lb = as_nav(flown, path, slice(None))
    truth = flown.sim.flight.motion
    assert np.abs(position - truth.position(path.time)).max() < 1e-5
    assert (
        np.abs(vector_from_rotation(truth.C_lb(path.time) @ np.swapaxes(C_lb, -1, -2))).max() < 1e-7
    )
