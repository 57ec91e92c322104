"""The parts of the recogniser against closed forms."""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from insgnss.geodesy.axes import axes_words, parse_axes
from insgnss.geodesy.rotation import right_angle_rotations, rotation_from_vector
from insgnss.navigation.prepare.fix_path import jumps, liveliest, sound_fixes
from insgnss.navigation.recognise._kernels import interpolate
from insgnss.navigation.recognise.axes import Pose, down_direction, forward, scores
from insgnss.navigation.recognise.signal import (
    accelerations,
    dead_channel,
    imu_grid,
    propagate_force,
)
from insgnss.navigation.recognise.units import force_unit, gyro_factors, gyro_unit
from insgnss.navigation.recognise.verdict import of_clock
from insgnss.records import GnssFixes, ImuSamples

MICRO = 1e-6


def steady(rate, force, seconds=20.0, hz=100.0, quantity="mean_rate", offset=1.7e9):
    t = offset + np.arange(1, round(seconds * hz) + 1) / hz
    return ImuSamples(t, np.tile(rate, (t.size, 1)), np.tile(force, (t.size, 1)), quantity)


def fixes(time, north, east, height, velocity=None):
    """Fixes near the equator, where a metre is the same angle all over the flight."""
    n = time.size
    cov = np.broadcast_to(np.eye(3) * 1e-4, (n, 3, 3))
    M, N = 6335439.327, 6378137.0  # radii of curvature on the equator, m (WGS84)
    return GnssFixes(
        time, north / M, east / N, height, cov, velocity, None if velocity is None else cov
    )


def test_propagated_force_of_a_steady_turn():
    """Oracle: closed form: C = exp(t [w x]) and its integral, Rodrigues' formula term by term."""
    rate, force = np.array([0.1, -0.2, 0.4]), np.array([1.0, 2.0, -9.8])
    moved = propagate_force(imu_grid(steady(rate, force)), 1.0, 1.0)
    t = moved.grid.step * np.arange(moved.C.shape[0])
    assert_allclose(moved.C, rotation_from_vector(t[:, None] * rate), atol=MICRO)
    w = np.linalg.norm(rate)
    K = np.cross(np.eye(3), rate / w)  # row i is e_i x k, which is the matrix [k x]
    s, c = np.sin(w * t) / w, (1.0 - np.cos(w * t)) / w
    integral = t[:, None, None] * np.eye(3) + c[:, None, None] * K + (t - s)[:, None, None] * K @ K
    # the sculling of a grid interval of 20 ms is left out beyond first order: (w dt)^2 / 6 of the
    # force, 2e-5
    assert_allclose(moved.V, integral @ force, atol=200.0 * 2e-5)
    assert_allclose(moved.drifted, integral, atol=1e-4)
    assert_allclose(moved.turned, t[:, None] * rate, atol=MICRO)


@pytest.mark.parametrize("quantity", ["mean_rate", "instant_rate", "increments"])
def test_grid_keeps_the_integral(quantity):
    """Oracle: the integral of a parabola, which mean rates hold exactly and instants to dt^2/12 of
    the curvature.
    """
    t = 100.0 + np.sort(
        np.concatenate([np.arange(0.0, 10.0, 0.01), np.arange(3.0, 5.0, 0.01) + 0.003])
    )
    if quantity == "increments":
        t = 100.0 + np.arange(0.0, 10.0, 0.01)
    cube, square = (t - 100.0) ** 3 / 3.0, (t - 100.0) ** 2
    values = (
        square
        if quantity == "instant_rate"
        else np.concatenate([[0.0], np.diff(cube) / np.diff(t)])
    )
    readings = np.outer(values, [1.0, -2.0, 3.0])
    grid = imu_grid(ImuSamples(t, readings, readings, quantity))
    total = np.cumsum(grid.dvel, axis=0)
    at = grid.step * np.arange(1, total.shape[0] + 1)
    assert_allclose(
        total[:, 0], at**3 / 3.0, atol=2e-3
    )  # linear within a sample: dt^2/8 of the slope 20 of the rate
    assert_allclose(total[:, 2], 3.0 * total[:, 0], rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("kind", ["position", "velocity"])
def test_accelerations_of_uneven_fixes(kind):
    """Oracle: a parabola has one acceleration, whatever the times of its fixes; gravity on the
    equator is 9.780325 m/s^2.
    """
    rng = np.random.default_rng(0)
    t = np.arange(0.0, 60.0, 0.2) + rng.uniform(-0.02, 0.02, 300)
    a = np.array([0.5, -0.3, 0.2])
    p = 0.5 * a * (t[:, None] - 30.0) ** 2 + np.array([3.0, 4.0, 0.0]) * t[:, None]
    gnss = fixes(t, p[:, 0], p[:, 1], 1000.0 - p[:, 2], a * (t[:, None] - 30.0) + [3.0, 4.0, 0.0])
    acc = accelerations(gnss, sound_fixes(gnss), kind, 1.0, dense=True)
    assert acc.time.size > 250
    gravity = 9.780325 * (1.0 - 2.0 * gnss.height[0] / 6.378e6)
    assert_allclose(
        acc.z, np.tile(a - [0.0, 0.0, gravity], (acc.time.size, 1)), atol=2e-3
    )  # 0.1 % of radius by flattening and height
    assert_allclose(acc.coef.sum(axis=1), 0.0, atol=1e-9)


def test_gross_fixes_are_left_out():
    """Oracle: the fixes that the test displaced, of 3 m and more where the path is smooth to
    centimetres.
    """
    rng = np.random.default_rng(2)
    t = np.arange(0.0, 100.0, 0.1)
    north, east = (
        200.0 * np.sin(0.1 * t) + rng.normal(0.0, 0.02, t.size),
        200.0 * np.cos(0.1 * t) + rng.normal(0.0, 0.02, t.size),
    )
    gross = rng.random(t.size) < 0.04
    gross[:3] = gross[-3:] = False
    height = 500.0 + gross * rng.choice([-1.0, 1.0], t.size) * rng.uniform(3.0, 50.0, t.size)
    sound = sound_fixes(fixes(t, north, east, height))
    assert (~sound & gross).sum() >= 0.9 * gross.sum()
    assert (~sound & ~gross).sum() <= 0.02 * t.size


def test_interpolation_is_exact_for_cubics():
    """Oracle: a cubic polynomial."""
    t = 0.5 * np.arange(11)
    X, dX = (
        np.column_stack([t**3, t**2, 1.0 + t]),
        np.column_stack([3.0 * t**2, 2.0 * t, np.ones_like(t)]),
    )
    out = np.empty(3)
    for at in (0.0, 0.3, 2.77, 5.0):
        interpolate(at, X, dX, 0.5, out)
        assert_allclose(out, [at**3, at**2, 1.0 + at], rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("factor", "interval", "unit", "quantity"),
    [
        (1.0, 0.01, "m/s^2", "mean_rate"),
        (1.0 / 9.80665, 0.01, "g", "mean_rate"),
        (1e3 / 9.80665, 0.005, "mg", "mean_rate"),
        (0.01, 0.01, "m/s", "increments"),
        (0.002, 0.002, "m/s", "increments"),
    ],
)
def test_force_unit(factor, interval, unit, quantity):
    """Oracle: gravity in the unit that the test chose."""
    found = force_unit(
        imu_grid(steady([0.0, 0.0, 0.0], factor * np.array([3.0, -4.0, 8.4]), hz=1.0 / interval))
    )
    assert (found.unit, found.quantity) == (unit, quantity)
    assert found.of_unit.confidence > 0.99
    assert found.factor == pytest.approx(
        1.0 / factor, rel=2e-4
    )  # Unix time of our days resolves 0.24 us of 2 ms


def test_force_of_no_unit_is_told():
    """Oracle: raw counts, 1 g = 2048."""
    found = force_unit(imu_grid(steady([0.0, 0.0, 0.0], [0.0, 0.0, 200.0])))
    assert found.of_unit.found == "unknown"
    assert found.of_unit.confidence == 0.0
    assert found.factor * 200.0 == pytest.approx(9.80665)


def test_gyro_units_that_are_possible():
    """Oracle: 40 rad/s are 2292 deg/s, beyond the gyros of a drone; 40 deg/h are more than the
    Earth's 15.
    """
    grid = imu_grid(steady([0.0, 0.0, 40.0], [0.0, 0.0, -9.8]))
    assert [gyro_unit(f, "mean_rate", 0.01) for f in gyro_factors(grid, "mean_rate")] == [
        "deg/s",
        "deg/h",
    ]
    assert gyro_unit(100.0 * np.pi / 180.0, "increments", 0.01) == "deg"
    assert gyro_unit(57.2957795, "mean_rate", 0.01) == ""


def test_orientations_are_the_24_and_their_words_go_both_ways():
    """Oracle: `parse_axes`; the group of rotations of the cube has 24 elements."""
    C = right_angle_rotations()
    assert len({axes_words(c) for c in C}) == 24
    for c in C:
        assert np.array_equal(parse_axes(axes_words(c)), c)
        assert int(np.argmax(scores(c[2], c[0]))) == int(
            np.argmax([np.sum(c * other) for other in C])
        )


@pytest.mark.parametrize("ahead_of_x_deg", [0.0, 90.0, 180.0, -90.0, 20.0])
def test_forward_in_wind(ahead_of_x_deg):
    """Oracle: a craft of 14 m/s that turns in wind of 9 m/s: the velocity over ground is never
    along its nose, on average it is.
    """
    rng = np.random.default_rng(3)
    t = np.arange(0.0, 120.0, 0.5)
    nose = np.radians(30.0) + 0.1 * t
    heading_of_x = nose - np.radians(ahead_of_x_deg)
    c, s, o = np.cos(heading_of_x), np.sin(heading_of_x), np.zeros_like(t)
    C_ns = np.stack(
        [
            np.stack([c, -s, o], axis=1),
            np.stack([s, c, o], axis=1),
            np.stack([o, o, o + 1.0], axis=1),
        ],
        axis=1,
    )
    velocity = (
        14.0 * np.column_stack([np.cos(nose), np.sin(nose)])
        + [7.0, -5.6]
        + rng.normal(0.0, 0.5, (t.size, 2))
    )
    pose = Pose(t, C_ns, np.full(t.size, 0.02), velocity, np.zeros(t.size), 2.0)
    vertical = down_direction(pose)
    assert vertical.word == "+z"
    found = forward(pose, vertical)
    angle = np.degrees(np.arctan2(found.direction.vector[1], found.direction.vector[0]))
    assert abs((angle - ahead_of_x_deg + 180.0) % 360.0 - 180.0) < 1.0
    assert found.direction.word == {90.0: "+y", 180.0: "-x", -90.0: "-y"}.get(ahead_of_x_deg, "+x")
    assert found.direction.confidence > 0.99
    assert found.speed == pytest.approx(14.0, abs=0.3)
    assert_allclose(found.wind, [7.0, -5.6], atol=0.3)


def test_forward_of_who_goes_to_and_fro_without_turning_is_unknown():
    """Oracle: lines flown forward and backward with one heading say nothing about the nose."""
    t = np.arange(0.0, 240.0, 0.5)
    velocity = np.column_stack([8.0 * np.sign(np.sin(0.1 * t)), 0.0 * t])
    pose = Pose(
        t,
        np.tile(np.eye(3), (t.size, 1, 1)),
        np.full(t.size, 0.02),
        velocity,
        np.zeros(t.size),
        2.0,
    )
    assert forward(pose, down_direction(pose)).direction.confidence < 0.5


def test_dead_channel():
    """Oracle: the channel that the test silenced for half the recording; who stands with coarse
    steps is not dead.
    """
    rng = np.random.default_rng(4)
    t = np.arange(0.0, 100.0, 0.01)
    gyro, accel = rng.normal(0.0, 0.1, (t.size, 3)), rng.normal(0.0, 1.0, (t.size, 3))
    assert dead_channel(ImuSamples(t, gyro, accel)) == ""
    stuck = accel.copy()
    stuck[5000:, 1] = stuck[5000, 1]
    assert dead_channel(ImuSamples(t, gyro, stuck)) == "accelerometer y"
    coarse = gyro.copy()
    coarse[:6000] = 0.0
    assert dead_channel(ImuSamples(t, coarse, accel)) == ""


@pytest.mark.parametrize(("far", "told"), [(0.462, False), (0.1, True)])
def test_a_lag_that_does_not_stand_out_is_none(far, told):
    """Oracle: flights of two days, of which 48.8 % are explained at the best lag and 46.2 % at
    another one; and one that stands out.
    """
    lags = np.array([-20.0, -15.0, -10.0])
    scan = SimpleNamespace(
        lags=lags,
        score=np.array([far, 0.488, 0.0]),
        best=1,
        acc=SimpleNamespace(span_s=1.0),
        margin=lambda apart: 10.0,
    )
    relation = SimpleNamespace(
        scan=scan, fit=SimpleNamespace(theta=np.array([-14.95])), lag_sigma=0.1
    )
    assert (of_clock(relation, 2000, 0.999, 0.0).of_offset.confidence > 0.0) == told


def test_a_gross_fix_is_not_lively():
    """Oracle: the path: 20 m/s in the third hundred seconds, 1 m/s elsewhere, and a fix 5 km off in
    the first.
    """
    t = np.arange(0.0, 400.0, 0.5)
    north = np.cumsum(np.where((t >= 200.0) & (t < 300.0), 20.0, 1.0) * 0.5)
    north[100] += 5000.0
    assert_allclose(
        liveliest(fixes(t, north, 0.0 * t, 500.0 + 0.0 * t), 100.0), (200.0, 300.0), atol=1.0
    )


def test_a_fast_drone_is_lively_at_its_speed():
    """Oracle: the path: 45 m/s in the third hundred seconds, 30 m/s elsewhere."""
    t = np.arange(0.0, 400.0, 0.5)
    north = np.cumsum(np.where((t >= 200.0) & (t < 300.0), 45.0, 30.0) * 0.5)
    assert_allclose(
        liveliest(fixes(t, north, 0.0 * t, 500.0 + 0.0 * t), 100.0), (200.0, 300.0), atol=1.0
    )


def test_the_liveliest_part_holds_no_jump():
    """Oracle: the path, at 20 m/s from 200 to 300 s, where the fixes jump by 50 m at 270 s; 70 s of
    that are longer than 100 s at 1 m/s.
    """
    t = np.arange(0.0, 400.0, 0.5)
    north = np.cumsum(np.where((t >= 200.0) & (t < 300.0), 20.0, 1.0) * 0.5)
    east = np.where(t >= 270.0, 50.0, 0.0)
    assert jumps(t, np.column_stack([north, east])).tolist() == [540]
    first, last = liveliest(fixes(t, north, east, 500.0 + 0.0 * t), 100.0)
    assert first <= 200.0
    assert 269.0 <= last < 270.0
