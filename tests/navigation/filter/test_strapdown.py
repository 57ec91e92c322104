"""The strapdown against exact motion, closed forms and a naive twin.

Position errors of free-inertial navigation grow: horizontally with the Schuler oscillation,
bounded, vertically with exp(t sqrt(2 g / R)), 1.7 times in 5 minutes and 275 times in an hour. The
rotation error does not depend on either.
"""

from dataclasses import replace

import numpy as np
import pytest
from flown import error_of, moved
from numpy.testing import assert_allclose
from surveys import block_flight

from insgnss.flight.reference.strapdown import gravity
from insgnss.geodesy.earth import EARTH_RATE, A, B, normal_gravity
from insgnss.geodesy.frames import LocalFrame
from insgnss.geodesy.rotation import (
    quaternion_from_rotation,
    rotation_from_quaternion,
    rotation_from_vector,
)
from insgnss.navigation.filter.kernels.strapdown import gravity_l as kernel_gravity
from insgnss.navigation.filter.strapdown import free_inertial, kernel_earth
from insgnss.navigation.prepare.increments import body_increments
from insgnss.records import Increments
from insgnss.simulation.motion import ExactMotion

NANO_DEG = np.radians(1e-9)
LEVEL = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]])


def true_nav(motion: ExactMotion, time) -> np.ndarray:
    return np.hstack(
        [motion.position(time), motion.velocity(time), quaternion_from_rotation(motion.C_lb(time))]
    )


@pytest.fixture(scope="module")
def flight():
    """Five minutes from the stand through take-off and turns at 500 Hz: exact motion, increments
    between marks a second apart, truth.
    """
    motion = block_flight(5.0, seed=3, ground_s=20.0).motion
    imu = motion.imu(500.0)
    off_grid = imu.time[5000:50000:2500] + 0.00077
    inc = body_increments(imu, np.eye(3), np.sort(np.concatenate([imu.time[::500], off_grid])))
    return motion, inc, true_nav(motion, inc.marks), np.isin(inc.marks, off_grid)


def drift(flight, inc: Increments) -> np.ndarray:
    """(m, 9) error at the marks of free-inertial navigation from the exact start."""
    motion, _, truth, _ = flight
    return error_of(free_inertial(inc, motion.frame, truth[0]), truth)


def test_error_free_flight_stays_on_its_path(flight):
    """Oracle: exact motion. Measured 2 and 8 micrometres, 5e-12 deg at samples and 1e-8 deg between
    them.

    The bar of 1 mm over 45 minutes leaves 0.1 mm for these 5 horizontally; the vertical gets the
    same. Between samples the rate is taken as linear, which misses h^3/60 of its second derivative.
    """
    error = drift(flight, flight[1])
    between = flight[3]
    assert np.hypot(error[:, 0], error[:, 1]).max() < 1e-4
    assert np.abs(error[:, 2]).max() < 1e-4
    assert np.abs(error[:, 3:6]).max() < 1e-6
    assert np.abs(error[~between, 6:]).max() < NANO_DEG
    assert np.abs(error[between, 6:]).max() < 100.0 * NANO_DEG


def test_second_order_rotation_of_the_velocity_is_needed(flight):
    """Oracle: exact motion. Without phi x (phi x u) / 6 it drifts by 1.9 mm vertically and 0.6 mm
    horizontally in 5 minutes.
    """
    _, inc, _, _ = flight
    missing = np.cross(inc.dtheta, np.cross(inc.dtheta, inc.dvel)) / 6.0
    error = drift(flight, replace(inc, dvel=inc.dvel - missing))
    assert np.abs(error[:, 2]).max() > 1e-3
    assert np.hypot(error[:, 0], error[:, 1]).max() > 3e-4


def test_a_constant_bias_is_taken_off(flight):
    """Oracle: the run on increments from which bias times length was taken off beforehand; 1e-9 m
    is rounding over 30 s.
    """
    motion, inc, truth, _ = flight
    short = replace(inc, marks=inc.marks[:30], stop=inc.stop[:30], rate=inc.rate[:30])
    bias = np.array([3e-4, -2e-4, 1e-4, 0.01, -0.03, 0.02])
    spoilt = replace(
        short,
        dtheta=inc.dtheta + inc.dt[:, None] * bias[:3],
        dvel=inc.dvel + inc.dt[:, None] * bias[3:],
    )
    got = free_inertial(spoilt, motion.frame, truth[0], bias)
    assert_allclose(got, free_inertial(short, motion.frame, truth[0]), rtol=0.0, atol=1e-9)


def test_a_body_at_rest_stays_for_an_hour():
    """Oracle: closed form, nothing moves. Measured 0.03 mm and 7e-11 rad, the rounding of 360 000
    additions grown by the Schuler loop.
    """
    frame = LocalFrame(float(np.radians(46.57)), float(np.radians(6.54)), 510.0)
    motion = ExactMotion(
        frame, 1000.0, 1.0, np.tile([3.0, 4.0, -20.0, 0.02, -0.05, 1.1], (3606, 1))
    )
    imu = motion.imu(100.0)
    inc = body_increments(imu, np.eye(3), imu.time[::6000])
    truth = true_nav(motion, inc.marks)
    error = error_of(free_inertial(inc, frame, truth[0]), truth)
    assert np.abs(error[:, :3]).max() < 2e-4
    assert np.abs(error[:, 3:6]).max() < 2e-7
    assert np.abs(error[:, 6:]).max() < 1e-9


def test_schuler_oscillation_of_an_initial_tilt():
    """Oracle: closed form at the pole, where the radius of curvature is a^2/b and Earth rotation
    only turns the horizontal plane.

    With z = north + i east of the position error, psi = psi_n + i psi_e and W^2 = g/R + Omega^2,
    the linear equations (S.1) give z = exp(i Omega t) (i g psi / W^2) (1 - cos W t), to 0.4 % the
    textbook R psi (1 - cos(t sqrt(g/R))). The amplitude is 1275 m over one period of 84 minutes;
    second-order terms are psi times that, 0.1 m, in the vertical only, and 5e-4 of 1e-4 m^2 of
    curvature: 5 mm are four parts in a million.
    """
    tilt, h, n = np.array([0.6e-4, 0.8e-4, 0.0]), 0.1, 50640
    frame = LocalFrame(0.5 * np.pi, 0.3, 0.0)
    g, R = float(normal_gravity(frame.lat, 0.0)), A**2 / B
    stop = np.arange(0, n + 1, 600)
    marks = stop * h
    turn, push = np.tile(frame.earth_rate_l * h, (n, 1)), np.tile([0.0, 0.0, -g * h], (n, 1))
    inc = Increments(np.full(n, h), turn, push, marks, stop, np.zeros((stop.size, 3)), h)
    start = moved(LEVEL, -np.concatenate([np.zeros(6), tilt])[None])[0]
    error = error_of(free_inertial(inc, frame, start), np.tile(LEVEL, (stop.size, 1)))
    W = np.sqrt(g / R + EARTH_RATE**2)
    expected = (
        np.exp(1j * EARTH_RATE * marks)
        * 1j
        * g
        * (tilt[0] + 1j * tilt[1])
        / W**2
        * (1.0 - np.cos(W * marks))
    )
    assert np.abs(expected).max() > 1270.0
    assert np.abs(error[:, 0] + 1j * error[:, 1] - expected).max() < 5e-3
    textbook = R * 1e-4 * (1.0 - np.cos(np.sqrt(g / R) * marks))
    assert_allclose(np.hypot(error[:, 0], error[:, 1]), textbook, atol=0.012 * R * 1e-4)


def test_gravity_leans_by_the_deflection_of_the_vertical() -> None:
    """Oracle: definition of xi and eta, the zenith's way north and east of the normal, and the
    readable twin's gravity away from the origin, where turned axes are 1.2 m off in height.
    """
    xi, eta = np.radians([36.0, -50.0]) / 3600.0
    frame = LocalFrame(np.radians(46.5), np.radians(6.5), 1500.0, deflection=(xi, eta))
    found, scratch = np.zeros(3), np.zeros(3)
    for place in (np.zeros(3), np.array([2000.0, -1500.0, -300.0])):
        kernel_gravity(*place, kernel_earth(frame), scratch, found)
        np.testing.assert_allclose(found, gravity(frame, place), atol=5e-6)
        if not place.any():
            astronomic = found / np.linalg.norm(found)
            np.testing.assert_allclose(astronomic, [-xi, -eta, 1.0], atol=1e-7)


def gravity_l(frame: LocalFrame, position) -> np.ndarray:
    lat, _, height = frame.geodetic_from_position(position)
    return frame.C_ln_at(position) @ [0.0, 0.0, float(normal_gravity(lat, height))]


def naive(inc: Increments, frame: LocalFrame, start) -> np.ndarray:
    """State after every segment: one segment a time, matrices for quaternions, closed-form
    integrals, gravity at every midpoint.
    """
    p, v, C = start[:3], start[3:6], rotation_from_quaternion(start[6:])
    earth, out = frame.earth_rate_l, []
    nodes, weights = np.polynomial.legendre.leggauss(4)
    for h, phi, u in zip(inc.dt, inc.dtheta, inc.dvel, strict=True):
        s = 0.5 * (nodes + 1.0)
        turned = 0.5 * np.einsum("k,kij,j->i", weights, rotation_from_vector(s[:, None] * phi), u)
        half_back = rotation_from_vector(-0.5 * h * earth)
        push = half_back @ C @ turned
        g = gravity_l(frame, p + 0.5 * h * v)
        coriolis = 2.0 * np.cross(earth, v + 0.5 * (push + h * g))
        v_new = v + push + h * (g - coriolis)
        p = p + 0.5 * h * (v + v_new)
        v = v_new
        C = half_back @ half_back @ C @ rotation_from_vector(phi)
        out.append(np.concatenate([p, v, quaternion_from_rotation(C)]))
    return np.array(out)


@pytest.mark.slow
def test_kernel_is_its_naive_twin(flight):
    """Oracle: the equations written down plainly, 12 s of a turn at 500 Hz.

    The kernel carries gravity from the start of a block by its main gradients. What it leaves out,
    the change of gravity with latitude of 8e-9 m/s^2 a metre over half a block of 0.3 m, is 1.2e-9
    m/s^2: 0.1 micrometres in 12 s.
    """
    motion, _, _, _ = flight
    imu = motion.imu(500.0)
    inc = body_increments(imu, np.eye(3), motion.start + np.arange(34.0, 46.01, 0.5))
    start = true_nav(motion, inc.marks[:1])[0]
    assert np.ptp(motion.angles(inc.marks)[:, 2]) > 1.0
    got = free_inertial(inc, motion.frame, start)[1:]
    error = error_of(got, naive(inc, motion.frame, start)[inc.stop[1:] - 1])
    assert np.abs(error[:, :3]).max() < 2e-7
    assert np.abs(error[:, 3:6]).max() < 3e-8
    assert np.abs(error[:, 6:]).max() < 1e-12


def test_kernel_is_its_naive_twin_on_rough_increments():
    """Oracle: the equations written down plainly, 3 s of a body that is shaken and climbs at 100
    Hz.

    Turns of half a radian a second and forces of 1.5 g, other ones in each segment, so that each
    term of (S.2) to (S.6) is a multiple of the tolerance: 10 nm/s, and of psi 1e-12 rad. The series
    of (S.3) ends with the third power of the turn; its next terms are 1e-11 m/s a segment.
    """
    rng, n, h = np.random.default_rng(11), 300, 0.01
    turn = 0.5 * h * rng.standard_normal((n, 3))
    push = h * (5.0 * rng.standard_normal((n, 3)) + [4.0, -3.0, -16.0])
    frame = LocalFrame(0.8, 0.1, 400.0)
    stop = np.arange(0, n + 1, 50)
    inc = Increments(np.full(n, h), turn, push, 100.0 + stop * h, stop, np.zeros((stop.size, 3)), h)
    attitude = quaternion_from_rotation(rotation_from_vector([0.1, -0.2, 2.0]))
    start = np.concatenate([[30.0, -20.0, -100.0, 10.0, 5.0, -8.0], attitude])
    got = free_inertial(inc, frame, start)[1:]
    error = error_of(got, naive(inc, frame, start)[inc.stop[1:] - 1])
    assert np.abs(error[:, :3]).max() < 2e-8
    assert np.abs(error[:, 3:6]).max() < 1e-8
    assert np.abs(error[:, 6:]).max() < 1e-12
