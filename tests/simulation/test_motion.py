"""The exact motion: splines, kinematics, dynamics, and the integrals an IMU reports."""

import numpy as np
import pyproj
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad_vec, solve_ivp
from scipy.interpolate import BSpline
from scipy.spatial.transform import Rotation
from surveys import block_flight

from insgnss.base.errors import UsageError
from insgnss.geodesy.earth import EARTH_RATE, normal_gravity
from insgnss.geodesy.frames import LocalFrame
from insgnss.simulation import motion as motion_module
from insgnss.simulation.motion import ExactMotion

START = 205200.0
FRAME = LocalFrame(float(np.radians(46.57)), float(np.radians(6.54)), 510.0)
ECEF = pyproj.Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)


def lively(spacing: float = 0.5, pieces: int = 40, start: float = START) -> ExactMotion:
    """Tens of metres and tenths of a radian between knots, in all six channels."""
    rng = np.random.default_rng(5)
    control = rng.standard_normal((pieces + 5, 6)) * [3.0, 3.0, 2.0, 0.1, 0.1, 0.1]
    control[:, 0] += 7.0 * np.arange(pieces + 5)
    control[:, 5] += 0.2 * np.arange(pieces + 5)
    return ExactMotion(FRAME, start, spacing, control)


@pytest.fixture(scope="module")
def motion() -> ExactMotion:
    return lively()


def gravity_vector_l(position_l):
    """Normal gravity along the ellipsoidal normal, by pyproj's geodetic coordinates."""
    lon, lat, h = ECEF.transform(
        *(FRAME.origin_ecef + FRAME.C_el @ position_l), direction="INVERSE"
    )
    lat, lon = np.radians(lat), np.radians(lon)
    up_e = np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
    return -normal_gravity(lat, h) * (FRAME.C_el.T @ up_e)


@pytest.mark.parametrize("order", range(5))
def test_channels_are_the_quintic_b_spline_of_their_control_points(motion, order):
    """Oracle: scipy's BSpline on the same uniform knots."""
    t = np.linspace(START, motion.end, 333)
    knots = (np.arange(motion.control.shape[0] + 6) - 5.0) * motion.spacing
    expected = (
        BSpline(knots, motion.control, 5).derivative(order)(t - START)
        if order
        else BSpline(knots, motion.control, 5)(t - START)
    )
    got = np.hstack([motion.position(t, order), motion.angles(t, order)])
    assert_allclose(got, expected, rtol=1e-11, atol=1e-10)


def test_velocity_and_acceleration_are_derivatives_of_position(motion):
    """Oracle: central differences over 2 ms; their error is d^2/6 of the third derivative, some 1e2
    m/s^3 and 1e3 m/s^4 here.
    """
    t = np.linspace(START + 1.0, motion.end - 1.0, 50)
    d = 1e-3
    assert_allclose(
        motion.velocity(t), (motion.position(t + d) - motion.position(t - d)) / (2 * d), atol=1e-4
    )
    assert_allclose(
        motion.position(t, 2),
        (motion.velocity(t + d) - motion.velocity(t - d)) / (2 * d),
        atol=1e-3,
    )


def test_control_points_belong_to_their_greville_abscissae():
    """Oracle: a B-spline of control points on a straight line is that line."""
    line = np.outer(np.arange(20) - 2.0, np.arange(1.0, 7.0))
    t = START + np.linspace(0.0, 7.4, 30)
    m = ExactMotion(FRAME, START, 0.5, line)
    assert_allclose(m.position(t), np.outer((t - START) / 0.5, [1.0, 2.0, 3.0]), rtol=0, atol=1e-9)


def test_rates_turn_the_attitude(motion):
    """Oracle: scipy's DOP853 on dC/dt = C [omega x], 5 s; at the knots of the motion it loses
    order, which leaves 3e-11.
    """

    def slope(t, c):
        x, y, z = motion.omega_lb_b(t)[0]
        return (c.reshape(3, 3) @ [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]).ravel()

    t0, t1 = START + 3.0, START + 8.0
    solution = solve_ivp(
        slope,
        (t0, t1),
        motion.C_lb(t0).ravel(),
        method="DOP853",
        rtol=1e-13,
        atol=1e-13,
        max_step=0.05,
    )
    assert_allclose(solution.y[:, -1].reshape(3, 3), motion.C_lb(t1)[0], rtol=0, atol=1e-10)


def test_attitude_is_yaw_then_pitch_then_roll(motion):
    """Oracle: scipy Rotation, intrinsic ZYX."""
    t = np.linspace(START, motion.end, 20)
    assert_allclose(
        motion.C_lb(t),
        Rotation.from_euler("ZYX", motion.angles(t)[:, ::-1]).as_matrix(),
        rtol=0,
        atol=1e-14,
    )


def test_specific_force_moves_the_body(motion):
    """Oracle: DOP853 on p'' = C_lb f - 2 omega x v + g(p), g through pyproj; 5 s, ten nanometres
    for the knots of the motion.
    """
    omega = EARTH_RATE * np.array([np.cos(FRAME.lat), 0.0, -np.sin(FRAME.lat)])

    def slope(t, y):
        f_l = motion.C_lb(t)[0] @ motion.inertial(t)[1][0]
        return np.concatenate([y[3:], f_l - 2.0 * np.cross(omega, y[3:]) + gravity_vector_l(y[:3])])

    t0, t1 = START + 3.0, START + 8.0
    start = np.concatenate([motion.position(t0)[0], motion.velocity(t0)[0]])
    solution = solve_ivp(
        slope, (t0, t1), start, method="DOP853", rtol=1e-13, atol=1e-12, max_step=0.05
    )
    assert_allclose(solution.y[:3, -1], motion.position(t1)[0], rtol=0, atol=1e-8)


def test_specific_force_obeys_newton_in_the_inertial_frame():
    """Oracle: second difference of the inertial position; exact for a quintic but for rounding,
    1e-9 m / (0.5 s)^2.

    Coriolis and centrifugal acceleration, 4e-3 and 2e-2 m/s^2, are nowhere in the oracle but in the
    turning of the Earth.
    """
    motion = lively(spacing=8.0, pieces=3)
    h, times = 0.5, START + 12.0 + 0.5 * np.arange(-2, 3)
    turn = Rotation.from_rotvec(
        np.outer(EARTH_RATE * (times - times[2]), [0.0, 0.0, 1.0])
    ).as_matrix()
    r_i = np.einsum("nij,nj->ni", turn, FRAME.origin_ecef + motion.position(times) @ FRAME.C_el.T)
    acceleration = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) @ (r_i - r_i[2]) / (12.0 * h * h)
    spin = np.array([0.0, 0.0, EARTH_RATE])
    gravitation = FRAME.C_el @ gravity_vector_l(motion.position(times[2])[0]) + np.cross(
        spin, np.cross(spin, r_i[2])
    )
    f_e = FRAME.C_el @ motion.C_lb(times[2])[0] @ motion.inertial(times[2])[1][0]
    assert_allclose(f_e, acceleration - gravitation, rtol=0, atol=2e-7)


def test_a_body_at_rest_feels_gravity_and_the_turning_earth():
    """Oracle: closed form, Somigliana gravity upwards and the Earth's rate at the latitude, in
    tilted axes.
    """
    roll, pitch, yaw = 0.3, -0.2, 2.0
    rest = ExactMotion(FRAME, START, 0.1, np.tile([0.0, 0.0, 0.0, roll, pitch, yaw], (40, 1)))
    C_lb = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()
    imu = rest.imu(100.0)
    assert_allclose(
        imu.accel,
        np.tile(C_lb.T @ [0.0, 0.0, -normal_gravity(FRAME.lat, 510.0)], (imu.time.size, 1)),
        rtol=0,
        atol=1e-9,
    )
    rate = EARTH_RATE * np.array([np.cos(FRAME.lat), 0.0, -np.sin(FRAME.lat)])
    assert_allclose(imu.gyro, np.tile(C_lb.T @ rate, (imu.time.size, 1)), rtol=0, atol=1e-17)
    assert not rest.velocity(imu.time).any()
    assert not rest.omega_lb_b(imu.time).any()


@pytest.mark.parametrize("rate", [100.0, 333.0])
def test_increments_are_integrals_of_the_signals(rate):
    """Oracle: scipy's adaptive quadrature; at 333 Hz intervals straddle knots, where the fifth
    derivative jumps.

    The motion starts at zero, where the quadrature's abscissae are not rounded to the 3e-11 s of a
    time of week.
    """
    motion = lively(start=0.0)
    imu = motion.imu(rate, "increments")
    knot = int(np.searchsorted(imu.time, 4.0))  # interval that ends at or after a knot
    for k in (1, knot, knot + 1):
        a, b = imu.time[k - 1], imu.time[k]
        total, _ = quad_vec(
            lambda t: np.concatenate(motion.inertial(t)).ravel(), a, b, epsabs=1e-16, epsrel=1e-13
        )
        assert_allclose(np.concatenate([imu.gyro[k], imu.accel[k]]), total, rtol=1e-12, atol=1e-16)


def test_quadrature_has_converged():
    """Oracle: twice the nodes, on a flight at 100 Hz; relative to the norm of the signal, 1e-14."""
    flight = block_flight(0.5, start_in_air=True, seed=4).motion
    four, eight = flight.imu(100.0), flight.imu(100.0, nodes=8)
    assert np.abs(four.accel - eight.accel).max() < 1e-14 * 9.81
    assert np.abs(four.gyro - eight.gyro).max() < 1e-14


def test_increments_of_fast_and_slow_sampling_add_up(motion):
    """Oracle: additivity of the integral; 5 samples of 500 Hz are one of 100 Hz."""
    fast, slow = motion.imu(500.0, "increments"), motion.imu(100.0, "increments")
    assert_allclose(fast.gyro.reshape(-1, 5, 3).sum(axis=1), slow.gyro, rtol=0, atol=1e-13)
    assert_allclose(
        fast.accel.reshape(-1, 5, 3).sum(axis=1), slow.accel, rtol=0, atol=1e-10
    )  # a stamp of 2e5 s is good to 3e-11 s


def test_mean_rates_belong_to_the_stamps_that_are_given(motion):
    """Oracle: definition; mean rate times the difference of the stamps is the increment, stamps a
    phase off the start.
    """
    mean, sums = motion.imu(200.0, phase_s=0.0013), motion.imu(200.0, "increments", phase_s=0.0013)
    assert mean.time[0] == START + (0.0013 + 1 / 200)
    assert_allclose(
        mean.accel[1:] * np.diff(mean.time)[:, None], sums.accel[1:], rtol=1e-13, atol=1e-15
    )
    assert mean.time[-1] <= motion.end


def test_instantaneous_rates_are_the_limit_of_mean_rates(motion):
    """Oracle: a short mean before and after, which brackets the instant: h^2/6 f'' off, f'' up to
    1e3 m/s^4.
    """
    now, fast = motion.imu(50.0, "instant_rate"), motion.imu(5000.0)
    k = np.searchsorted(fast.time, now.time[:-1] - 1e-6)
    assert_allclose(now.accel[:-1], 0.5 * (fast.accel[k] + fast.accel[k + 1]), atol=2e-5)
    assert_allclose(now.gyro[:-1], 0.5 * (fast.gyro[k] + fast.gyro[k + 1]), atol=1e-6)


@pytest.mark.parametrize("quantity", ["mean_rate", "increments", "instant_rate"])
def test_a_sensor_off_the_point_feels_the_turning(motion, quantity):
    """Oracle: the motion of the point at the lever: Newton on its own position, second difference
    over 2 ms (1e-5 m/s^2 of rounding).

    At an instant directly; over an interval by Simpson's rule on instants, whose error is h^4/2880
    of the fourth derivative. What is left is the gradient of gravity, 3e-6 m/s^2 for each m.
    """
    lever, h = np.array([0.4, -0.2, 0.3]), 0.01
    here, there = motion.imu(100.0, quantity), motion.imu(100.0, quantity, lever_b=lever)
    assert np.array_equal(here.gyro, there.gyro)
    k = np.arange(50, 1500, 97)
    unit = h if quantity == "increments" else 1.0

    def more(t):
        """Difference of the accelerations of point and body, inertial axes that stand still at t,
        in body axes.
        """
        d, spin = 1e-3, motion.frame.earth_rate_l
        arm = np.stack([np.einsum("nij,j->ni", motion.C_lb(t + e), lever) for e in (-d, 0.0, d)])
        second, first = (arm[2] - 2.0 * arm[1] + arm[0]) / d**2, (arm[2] - arm[0]) / (2.0 * d)
        inertial = second + 2.0 * np.cross(spin, first) + np.cross(spin, np.cross(spin, arm[1]))
        return np.einsum("nji,nj->ni", motion.C_lb(t), inertial)

    stamps = here.time[k]
    if quantity == "instant_rate":
        expected = more(stamps)
    else:
        expected = unit * (more(stamps - h) + 4.0 * more(stamps - 0.5 * h) + more(stamps)) / 6.0
    assert_allclose((there.accel - here.accel)[k], expected, atol=5e-4 * unit)
    assert np.abs(expected).max() > 0.05 * unit


def test_geodetic_state_is_that_of_pyproj(motion):
    """Oracle: pyproj's cart, a micrometre."""
    t = np.linspace(START, motion.end, 10)
    lat, lon, h = motion.geodetic(t)
    xyz = np.stack(ECEF.transform(np.degrees(lon), np.degrees(lat), h), axis=-1)
    assert_allclose(xyz, FRAME.origin_ecef + motion.position(t) @ FRAME.C_el.T, rtol=0, atol=1e-6)
    down = (
        np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], axis=-1)
        * -1.0
    )
    assert_allclose(motion.C_nl(t)[:, 2] @ FRAME.C_el.T, down, rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda m: m.position(START - 1.0), "outside the motion"),
        (lambda m: m.imu(100.0, "rate"), "none of"),
        (lambda m: m.imu(100.0, phase_s=0.02), "phase"),
        (lambda m: ExactMotion(FRAME, START, 0.1, np.zeros((5, 6))), "at least 6"),
        (lambda m: ExactMotion(FRAME, START, 0.0, np.zeros((6, 6))), "spacing"),
    ],
)
def test_what_has_no_answer_is_refused(motion, call, words):
    """Oracle: the contract; UsageError that says why."""
    with pytest.raises(UsageError, match=words):
        call(motion)


@pytest.mark.parametrize("rate_hz", [100.0, 333.0])
def test_integrals_in_pieces_are_those_of_one_piece_to_the_last_bit(rate_hz, monkeypatch):
    """Oracle: the same motion integrated in one call of the kernel."""
    flown = lively(spacing=0.1, pieces=300)
    whole = flown.imu(rate_hz, lever_b=(0.1, 0.2, 0.3))
    monkeypatch.setattr(motion_module, "PIECE_INTERVALS", 700)
    elapsed = np.arange(whole.time.size + 1) / rate_hz
    assert len(motion_module.pieces(elapsed, flown.spacing)) > 3
    again = flown.imu(rate_hz, lever_b=(0.1, 0.2, 0.3))
    assert (again.gyro == whole.gyro).all()
    assert (again.accel == whole.accel).all()
