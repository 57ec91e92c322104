"""Body increments against the exact motion: rotation and velocity of every interval, marks within
intervals, gaps.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from surveys import block_flight

from insgnss.base.errors import DataError
from insgnss.geodesy.axes import parse_axes
from insgnss.geodesy.rotation import rotation_from_vector, vector_from_rotation
from insgnss.navigation.prepare.gaps import find_gaps, nominal_interval
from insgnss.navigation.prepare.increments import body_increments, merge_marks
from insgnss.records import ImuSamples, Increments
from insgnss.simulation.motion import ExactMotion

RATE_HZ = 200.0
BODY = np.eye(3)


@pytest.fixture(scope="module")
def motion() -> ExactMotion:
    """25 s in the air, a line and a turn, with gusts."""
    return block_flight(25.0 / 60.0, seed=3, start_in_air=True, line_length_m=120.0).motion


def C_ib(motion: ExactMotion, time):
    """Body into axes that do not turn and agree with l at the start, (n, 3, 3)."""
    return rotation_from_vector(
        (time - motion.start)[:, None] * motion.frame.earth_rate_l
    ) @ motion.C_lb(time)


def exact_turn(motion: ExactMotion, t0, t1):
    """(n, 3) rotation vectors from t0 to t1 against inertial space."""
    return vector_from_rotation(np.swapaxes(C_ib(motion, t0), -1, -2) @ C_ib(motion, t1))


def exact_velocity(motion: ExactMotion, t0, t1):
    """(n, 3) integral of the specific force from t0 to t1 in the body axes at t0: Gauss-Legendre,
    eight nodes, error under 1e-15.
    """
    total = np.zeros((t0.size, 3))
    for x, w in zip(*np.polynomial.legendre.leggauss(8), strict=True):
        t = t0 + 0.5 * (x + 1.0) * (t1 - t0)
        force = np.einsum(
            "nji,njk,nk->ni", C_ib(motion, t0), C_ib(motion, t), motion.inertial(t)[1]
        )
        total += (0.5 * w * (t1 - t0))[:, None] * force
    return total


def rotated_velocity(inc: Increments):
    """(s, 3) velocity increments in the axes of the segment's start: the integral of exp([s phi x])
    u over s from 0 to 1, closed form.
    """
    phi, u = inc.dtheta, inc.dvel
    angle = np.linalg.norm(phi, axis=1)[:, None]
    once, twice = np.cross(phi, u), np.cross(phi, np.cross(phi, u))
    first = 0.5 * np.sinc(0.5 * angle / np.pi) ** 2
    second = np.where(
        angle > 1e-3,
        (1.0 - np.sinc(angle / np.pi)) / np.maximum(angle, 1e-3) ** 2,
        1.0 / 6.0 - angle**2 / 120.0,
    )
    return u + first * once + second * twice


@pytest.mark.parametrize(
    ("quantity", "turn", "velocity"),
    [("mean_rate", 1e-13, 2e-12), ("increments", 1e-13, 2e-12), ("instant_rate", 2e-10, 2e-10)],
)
def test_every_interval_has_the_exact_rotation_and_velocity(motion, quantity, turn, velocity):
    """Oracle: exact motion. Means know the integral; of instants the fourth-order error of the
    cubic through them remains.

    Without the coning term the rotations would be wrong by 2.6e-9 rad. The three intervals at
    either end have no neighbours on both sides and are held to a thousand times that.
    """
    imu = motion.imu(RATE_HZ, quantity)
    inc = body_increments(imu, BODY, imu.time[[0, -1]])
    turn_error = np.abs(inc.dtheta - exact_turn(motion, imu.time[:-1], imu.time[1:])).max(axis=1)
    velocity_error = np.abs(
        rotated_velocity(inc) - exact_velocity(motion, imu.time[:-1], imu.time[1:])
    ).max(axis=1)
    assert turn_error[3:-3].max() < turn
    assert velocity_error[3:-3].max() < velocity
    assert turn_error.max() < 1000.0 * turn
    assert velocity_error.max() < 1000.0 * velocity


def test_error_falls_with_the_fifth_power_of_the_interval(motion):
    """Oracle: exact motion at 100 and 200 Hz; (I.2) says that the rotations err by h^6 at the
    least, this asks for h^5.
    """
    error = []
    for rate in (100.0, 200.0):
        imu = motion.imu(rate)
        inc = body_increments(imu, BODY, imu.time[[0, -1]])
        error.append(
            np.abs(inc.dtheta - exact_turn(motion, imu.time[:-1], imu.time[1:]))[3:-3].max()
        )
    assert error[0] / error[1] > 2.0**5


def test_a_rate_that_bends_turns_across_its_bend():
    """Oracle: the product of 4000 small rotations, wrong by 1e-11 rad; (I.2) in its fifth order.

    Over the middle interval the mean rate is zero, the slope 2 rad/s^2 about x, the curvature
    20 rad/s^3 about y, so that the rotation is h^5 / 360 of their cross product, 1.1 urad about z,
    and nothing of lower order. Brackets of brackets are a hundredth of it.
    """
    h, slope, bend = 0.1, np.array([2.0, 0.0, 0.0]), np.array([0.0, 20.0, 0.0])

    def primitive(t):
        t = np.asarray(t)[:, None]
        return slope * t**2 / 2.0 + bend * (t**3 / 3.0 - t * h**2 / 12.0)

    edges = h * (np.arange(10) - 4.5)
    mean = np.vstack([np.zeros(3), np.diff(primitive(edges), axis=0) / h])
    inc = body_increments(
        ImuSamples(100.0 + edges, mean, np.zeros((10, 3))), BODY, 100.0 + edges[[0, -1]]
    )
    fine = np.linspace(-0.5 * h, 0.5 * h, 4001)
    C = np.eye(3)
    for small in rotation_from_vector(np.diff(primitive(fine), axis=0)):
        C = C @ small
    expected = vector_from_rotation(C)
    assert expected[2] == pytest.approx(h**5 / 360.0 * 40.0, rel=0.02)
    assert_allclose(inc.dtheta[4], expected, rtol=0, atol=5e-8)


def test_sensor_axes_are_turned_into_the_body(motion):
    """Oracle: the same increments from samples written in other axes; a permutation of columns
    moves no digit.
    """
    imu = motion.imu(RATE_HZ)
    C = parse_axes("right backward down")
    turned = ImuSamples(imu.time, imu.gyro @ C, imu.accel @ C)
    marks = imu.time[[0, -1]]
    expected, got = body_increments(imu, BODY, marks), body_increments(turned, C, marks)
    assert_array_equal(got.dtheta, expected.dtheta)
    assert_array_equal(got.dvel, expected.dvel)


def composed(inc: Increments, first: int, last: int):
    """(3, 3) product of the rotations of segments first..last-1."""
    C = np.eye(3)
    for phi in inc.dtheta[first:last]:
        C = C @ rotation_from_vector(phi)
    return C


def test_pieces_of_an_interval_multiply_to_the_whole(motion):
    """Oracle: composition of rotations, and of the velocities that they turn; what is left is a
    commutator of higher order.
    """
    imu = motion.imu(RATE_HZ)
    ends = imu.time[[0, -1]]
    inside = imu.time[1000:3000:8] + np.tile([0.0002, 0.0009, 0.0025, 0.0041, 0.0048], 50)
    whole = body_increments(imu, BODY, ends)
    split = body_increments(imu, BODY, np.sort(np.concatenate([ends, inside])))
    assert split.dt.size == whole.dt.size + inside.size
    whole_velocity, split_velocity = rotated_velocity(whole), rotated_velocity(split)
    turn_error, velocity_error = np.zeros(inside.size), np.zeros(inside.size)
    for k, mark in enumerate(inside):
        i = int(np.searchsorted(imu.time, mark)) - 1
        at = i + k
        assert_allclose(
            split.dt[at : at + 2], [mark - imu.time[i], imu.time[i + 1] - mark], rtol=0, atol=1e-12
        )
        first, second = rotation_from_vector(split.dtheta[at : at + 2])
        turn_error[k] = np.abs(
            vector_from_rotation((first @ second).T @ rotation_from_vector(whole.dtheta[i]))
        ).max()
        velocity_error[k] = np.abs(
            split_velocity[at] + first @ split_velocity[at + 1] - whole_velocity[i]
        ).max()
    assert turn_error.max() < 1e-12
    assert velocity_error.max() < 1e-10


def test_attitude_and_rate_at_marks_within_intervals(motion):
    """Oracle: exact motion. The rate is taken as linear within an interval: h^3/16 of its third
    derivative, some 1e-9 rad at 200 Hz.
    """
    imu = motion.imu(RATE_HZ)
    marks = np.concatenate(
        [imu.time[[10]], np.arange(imu.time[11] + 0.0013, imu.time[-10], 0.0771), imu.time[[-5]]]
    )
    inc = body_increments(imu, BODY, marks)
    C, worst = C_ib(motion, marks[:1])[0], 0.0
    expected = C_ib(motion, inc.marks)
    for k in range(1, marks.size):
        C = C @ composed(inc, inc.stop[k - 1], inc.stop[k])
        worst = max(worst, np.abs(vector_from_rotation(expected[k] @ C.T)).max())
    assert worst < 1e-8
    assert_allclose(inc.rate, motion.inertial(inc.marks)[0], atol=2e-4)
    assert_array_equal(inc.stop[[0, -1]], [0, inc.dt.size])
    assert_allclose(np.add.reduceat(inc.dt, inc.stop[:-1]), np.diff(inc.marks), rtol=0, atol=1e-10)


def thinned(imu: ImuSamples, first: int, missing: int) -> ImuSamples:
    keep = np.ones(imu.time.size, dtype=bool)
    keep[first : first + missing] = False
    return replace(imu, time=imu.time[keep], gyro=imu.gyro[keep], accel=imu.accel[keep])


@pytest.mark.parametrize("quantity", ["mean_rate", "increments", "instant_rate"])
def test_a_short_gap_is_bridged_and_counted(motion, quantity):
    """Oracle: exact motion and the bound of 1.3 mrad that the module states for 1 rad/s^2 over 50
    ms.
    """
    imu = motion.imu(RATE_HZ, quantity)
    holed = thinned(imu, 3000, 9)
    inc = body_increments(holed, BODY, imu.time[[0, -1]])
    assert len(inc.gaps) == 1
    assert_allclose(inc.gaps[0], (imu.time[2999], 0.05), rtol=0, atol=1e-9)
    assert inc.nominal_s == pytest.approx(1.0 / RATE_HZ)
    turn = exact_turn(motion, holed.time[2999:3000], holed.time[3000:3001])[0]
    assert_allclose(inc.dt[2999], 0.05, rtol=0, atol=1e-9)
    assert_allclose(inc.dtheta[2999], turn, atol=1.3e-3)
    assert np.abs(turn).max() > 1.3e-3  # a bridge that held nothing would show


@pytest.mark.parametrize("quantity", ["mean_rate", "increments", "instant_rate"])
def test_a_gap_of_a_ramp_is_bridged_exactly(quantity):
    """Oracle: the integral of a rate and a force that grow linearly, which the mean of both ends
    has; the end alone is a tenth of a second times 0.1 rad/s^2 off, over 0.2 s 1 mrad.
    """
    h, slope = 0.01, np.array([0.1, -0.2, 0.3])
    time = 100.0 + h * np.arange(101)
    middle = 0.0 if quantity == "instant_rate" else 0.5 * h
    factor = h if quantity == "increments" else 1.0
    values = factor * (time - 100.0 - middle)[:, None] * slope
    keep = np.ones(101, dtype=bool)
    keep[41:60] = False
    imu = ImuSamples(time[keep], values[keep], 10.0 * values[keep], quantity)
    inc = body_increments(imu, BODY, time[[0, -1]])
    assert_allclose(inc.dt[40], 0.2, rtol=0, atol=1e-9)
    later = 0.0 if quantity == "instant_rate" else -middle  # means end with their interval
    exact = slope * (0.5 + later) * 0.2
    assert_allclose(inc.dtheta[40], exact, rtol=0, atol=1e-6)
    assert_allclose(inc.dvel[40], 10.0 * exact, rtol=0, atol=2e-5)


def test_a_long_gap_is_refused_with_time_and_limit(motion):
    """Oracle: the limit of a second that `gaps` states."""
    imu = motion.imu(RATE_HZ)
    missing = int(RATE_HZ * 1.1)
    holed = thinned(imu, 3000, missing)
    with pytest.raises(
        DataError, match=rf"gap of 1\.105 s \(limit 1 s\) at {imu.time[2999]:.3f} s; cut the flight"
    ):
        body_increments(holed, BODY, imu.time[[0, -1]])
    assert len(body_increments(thinned(imu, 3000, missing - 30), BODY, imu.time[[0, -1]]).gaps) == 1


def test_gaps_outside_the_marks_do_not_count(motion):
    """Oracle: a gap that ends before the first mark, or begins after the last, is none of the
    flight.
    """
    imu = motion.imu(RATE_HZ)
    holed = thinned(thinned(imu, 4000, 250), 100, 250)
    assert body_increments(holed, BODY, imu.time[[400, 3900]]).gaps == ()
    with pytest.raises(DataError, match="gap"):
        body_increments(holed, BODY, imu.time[[50, 3900]])


def test_gaps_are_intervals_longer_than_one_and_a_half(motion):
    """Oracle: hand count."""
    time = np.array([0.0, 1.0, 2.0, 3.4, 4.4, 6.0, 7.0])
    assert nominal_interval(time) == pytest.approx(1.0)
    assert find_gaps(time, 1.0) == [(4.4, pytest.approx(1.6))]


def test_marks_merge_and_know_their_place():
    """Oracle: hand count; 50 ns is one instant, 200 ns are two."""
    union, (a, b, none) = merge_marks(
        np.array([1.0, 2.0, 3.0]), np.array([0.5, 2.0 + 5e-8, 3.0 + 2e-7]), np.zeros(0)
    )
    assert_array_equal(union, [0.5, 1.0, 2.0, 3.0, 3.0 + 2e-7])
    assert_array_equal(a, [1, 2, 3])
    assert_array_equal(b, [0, 2, 4])
    assert none.size == 0


def test_a_mark_beside_a_sample_is_that_sample(motion):
    """Oracle: 50 ns beside a sample moves onto it, 1 microsecond stays and makes a segment of its
    own.
    """
    imu = motion.imu(RATE_HZ)
    inc = body_increments(
        imu, BODY, np.array([imu.time[5] + 5e-8, imu.time[9] - 5e-8, imu.time[12] - 1e-6])
    )
    assert_array_equal(inc.marks, [imu.time[5], imu.time[9], imu.time[12] - 1e-6])
    assert_array_equal(inc.stop, [0, 4, 7])


@pytest.mark.parametrize("imu_hz", [100.0, 500.0, 1000.0])
def test_a_rate_at_a_mark_has_the_noise_of_its_window(imu_hz: float) -> None:
    """(I.4). Oracle: white noise of one sample, and a turn to and fro of 2 Hz."""
    rng, sigma = np.random.default_rng(8), 0.01
    n = int(60.0 * imu_hz)
    time = 100.0 + np.arange(n) / imu_hz
    swing = 0.3 * np.sin(4.0 * np.pi * (time - 0.5 / imu_hz))[:, None] * [1.0, 0.5, 0.0]
    noise = sigma * rng.standard_normal((n, 3))
    marks = np.arange(time[0] + 0.5, time[-1] - 0.5, 0.1)
    marks[0], marks[-1] = time[0], time[-1]  # their windows are not whole
    force = np.tile([0.0, 0.0, -9.8], (n, 1))
    clean, noisy = (
        body_increments(ImuSamples(time, gyro, force, "mean_rate"), BODY, marks).rate
        for gyro in (swing, swing + noise)
    )
    true = 0.3 * np.sin(4.0 * np.pi * marks)[:, None] * [1.0, 0.5, 0.0]
    # (I.4) of the sine: w^4 / 30 (4 pi)^4; the mean over a sample is below it by (2 pi f dt)^2 / 24
    assert_allclose(clean[1:-1], true[1:-1], atol=0.3 * (2e-4 + (4.0 * np.pi / imu_hz) ** 2 / 8.0))
    per_window = 0.04 * imu_hz
    expected = sigma * np.sqrt(25.0 / 18.0 / per_window)
    assert_allclose(np.std((noisy - clean)[1:-1]), expected, rtol=0.05)
