"""Value and Jacobian of the antenna's position and velocity."""

import numpy as np
import pytest
from flown import fly, moved, without_noise
from numpy.testing import assert_allclose

from insgnss.geodesy.earth import EARTH_RATE
from insgnss.geodesy.rotation import rotation_from_quaternion
from insgnss.navigation._kernels import position_rows, velocity_rows
from insgnss.navigation.filter import BLOCK_S
from insgnss.navigation.layout import PSI, state_layout
from insgnss.navigation.strapdown import kernel_earth
from insgnss.simulate.sensors import antenna_states
from insgnss.stochastic.model import AxisNoise, GaussMarkov, NoiseModel

LEVER = np.array([-0.4, 0.15, -0.3])
AXIS = AxisNoise(1e-4, 0.0, 1e-3, 0.0, 1e-5, (GaussMarkov(10.0, 1e-4),), 1e-2, 1e-2)
LAYOUT = state_layout(NoiseModel("all", "made up", (AXIS,) * 3, (AXIS,) * 3), scale_factor=True, misalignment=True)
RATE = np.array([0.4, -0.3, 0.6])
Z = np.array([3.0, -2.0, 1.0])


@pytest.fixture(scope="module")
def flown():
    return without_noise(fly(15.0, seed=2, layout=LAYOUT, velocity=True))


def rows(flown, nav, x, kind: str, elapsed: float = 7.0, rate=RATE, lever=LEVER):
    """Innovation (3,) against the measurement Z and its Jacobian (3, n)."""
    H, nu, C = np.zeros((3, LAYOUT.size)), np.zeros((3, 1)), np.zeros((3, 3))
    if kind == "position":
        position_rows(nav, lever, Z, C, H, nu)
    else:
        imu = LAYOUT.kernel_model(BLOCK_S, 0.1)
        velocity_rows(nav, x, elapsed, lever, rate, Z, imu, kernel_earth(flown.problem.frame), C, H, nu)
    return nu[:, 0].copy(), H.copy()


@pytest.mark.parametrize("kind", ["position", "velocity"])
def test_jacobian_is_the_derivative_of_its_own_value(flown, kind):
    """Oracle: central differences; steps of 1e-4 leave 1e-9 of third order.

    (K.2) takes omega_lb as independent of psi; that leaves out Earth rate times lever arm, 4e-5 m/s a radian.
    """
    nav = flown.true_nav([100])
    x = 0.5 * LAYOUT.sigma0
    _, H = rows(flown, nav[0], x, kind)
    step = 1e-4
    numeric = np.zeros_like(H)
    for s in range(LAYOUT.size):
        for sign in (1.0, -1.0):
            error = np.zeros(LAYOUT.size)
            error[s] = sign * step
            nu, _ = rows(flown, moved(nav, error[None, :9])[0], x + error[9:], kind)
            numeric[:, s] -= sign * nu / (2.0 * step)
    attitude = np.zeros(LAYOUT.size, dtype=bool)
    attitude[PSI] = kind == "velocity"
    assert_allclose(H[:, ~attitude], numeric[:, ~attitude], atol=1e-8)
    assert_allclose(H[:, attitude], numeric[:, attitude], atol=EARTH_RATE * np.linalg.norm(LEVER))
    assert np.abs(H[:, 6:9]).max() > 0.1
    assert (np.abs(H[:, 9:]).max() > 0.1) == (kind == "velocity")


def test_values_are_the_antennas(flown):
    """Oracle: exact motion of the antenna (rig of the simulator); 1e-4 m/s is the linear rate between samples times the lever arm."""
    motion, marks = flown.sim.flight.motion, flown.problem.inc.marks[20:130:5]
    lever = flown.problem.antenna_lever_b
    position, velocity = antenna_states(motion, lever, marks)
    truth, rate = flown.true_nav(slice(20, 130, 5)), flown.problem.inc.rate[20:130:5]
    zero = np.zeros(LAYOUT.size - 9)
    for k in range(marks.size):
        nu, _ = rows(flown, truth[k], zero, "position", lever=lever)
        assert_allclose(Z - nu, position[k], rtol=0.0, atol=1e-9)
        nu, _ = rows(flown, truth[k], zero, "velocity", rate=rate[k], lever=lever)
        assert_allclose(Z - nu, velocity[k], rtol=0.0, atol=1e-4)


def test_every_gyro_error_takes_its_share_of_the_rate(flown):
    """Oracle: hand calculation of omega = gyro - bias - drift t - M gyro, and the cross product with the lever arm."""
    x = np.zeros(LAYOUT.size - 9)
    errors = {
        "gyro x bias": 0.01,
        "gyro y drift": 0.002,
        "gyro z GM 1": -0.03,
        "gyro x scale factor": 0.05,
        "gyro z from x": 0.02,
        "accel x bias": 9.0,
    }
    for name, value in errors.items():
        x[LAYOUT.names.index(name)] = value
    nav = flown.true_nav([60])[0]
    C = rotation_from_quaternion(nav[6:])
    omega = RATE - [0.01 + 0.05 * RATE[0], 0.002 * 7.0, -0.03 + 0.02 * RATE[0]] - C.T @ flown.problem.frame.earth_rate_l
    nu, _ = rows(flown, nav, x, "velocity")
    assert_allclose(Z - nu, nav[3:6] + C @ np.cross(omega, LEVER), rtol=0.0, atol=1e-12)


def test_without_lever_arm_only_the_state_itself_is_seen(flown):
    """Oracle: identity."""
    nav = flown.true_nav([60])[0]
    for kind, column in (("position", 0), ("velocity", 3)):
        nu, H = rows(flown, nav, 0.5 * LAYOUT.sigma0, kind, lever=np.zeros(3))
        expected = np.zeros_like(H)
        expected[:, column : column + 3] = np.eye(3)
        assert_allclose(H, expected, atol=0.0)
        assert_allclose(nu, Z - nav[column : column + 3], rtol=1e-15)


def test_epochs_carry_measurements_to_the_local_frame(flown):
    """Oracle: fixes of the simulator against the exact antenna, normalised by the epoch's own covariance: chi-square of 3 a fix."""
    ep, motion = flown.problem.epochs, flown.sim.flight.motion
    at = np.flatnonzero(ep.has_position & ep.has_velocity)
    position, velocity = antenna_states(motion, flown.problem.antenna_lever_b, flown.problem.inc.marks[at])
    for value, truth, cov in ((ep.position, position, ep.position_cov), (ep.velocity, velocity, ep.velocity_cov)):
        error = value[at] - truth
        nis = np.einsum("ni,nij,nj->n", error, np.linalg.inv(cov[at]), error)
        assert abs(nis.mean() - 3.0) < 3.0 * np.sqrt(6.0 / at.size)
    assert_allclose(ep.position_cov[at[0]], np.diag([0.02, 0.02, 0.03]) ** 2, atol=1e-7)
    assert ep.time[0] == 0.0
