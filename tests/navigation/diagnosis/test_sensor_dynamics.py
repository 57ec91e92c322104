"""Errors of sensors that follow the motion: their correction, and that no constant is blamed."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from flown import fly
from numpy.testing import assert_allclose

import insgnss
from insgnss.geodesy.rotation import vector_from_rotation
from insgnss.navigation.diagnosis.sensor_dynamics import (
    DYNAMICS,
    DynamicsTrial,
    with_earlier_gyros,
    with_followed_fixes,
    without_load_bias,
)
from insgnss.navigation.prepare.increments import body_increments

EARTH_A, EARTH_E2 = 6378137.0, 6.69437999014e-3
BLAMED = {"antenna lever arm", "GNSS time offset", "clock rate", "clock step"}
BLAMED |= {"IMU misalignments", "IMU scale factors", "IMU bias step", "IMU noise"}
G = 9.80665


def late_gyros(sim: Any, late_s: float) -> Any:
    time, gyro = sim.imu.time, sim.imu.gyro
    late = np.stack([np.interp(time - late_s, time, column) for column in gyro.T], axis=1)
    return replace(sim.imu, gyro=late), sim.gnss, sim.mounting


def slow_receiver(sim: Any, hertz: complex) -> Any:
    """Fixes behind the true antenna by its acceleration over (2 pi Hz)^2."""
    fixes = sim.gnss
    true = sim.truth.trajectory.at(fixes.time)
    w = 2.0 * np.pi * hertz
    north, east, down = -np.gradient(true.velocity_ned, fixes.time, axis=0).T / (w**2).real
    root = np.sqrt(1.0 - EARTH_E2 * np.sin(fixes.lat) ** 2)
    lat = fixes.lat + north / (EARTH_A * (1.0 - EARTH_E2) / root**3 + fixes.height)
    lon = fixes.lon + east / ((EARTH_A / root + fixes.height) * np.cos(fixes.lat))
    return sim.imu, replace(fixes, lat=lat, lon=lon, height=fixes.height - down), sim.mounting


def rectifying(sim: Any, mg: float) -> Any:
    """Accelerometer biases of so much a g of load beyond one, alike on all axes."""
    load = np.linalg.norm(sim.imu.accel, axis=1) / G - 1.0
    accel = sim.imu.accel + (1e-3 * G * mg * load)[:, None]
    return replace(sim.imu, accel=accel), sim.gnss, sim.mounting


def estimated(sim: Any, records: Any) -> insgnss.ProcessResult:
    imu, gnss, mounting = records
    plane = sim.tangent_plane
    return insgnss.estimate(
        *(imu, gnss, sim.events),
        mounting=replace(mounting, antenna_sigma_m=0.005),
        tangent_plane=(*np.degrees([plane.lat, plane.lon]), plane.height),
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("motion", "seed", "plant", "size", "name", "sentence"),
    [
        ("ign8", 700, late_gyros, 5e-3, "gyro delay", "ms later than accelerometers"),
        ("ign6x1", 701, late_gyros, -8e-3, "gyro delay", "ms earlier than accelerometers"),
        ("ign8", 700, slow_receiver, 2.0, "receiver dynamics", "receiver of 2.0 Hz"),
        ("ign6x1", 701, slow_receiver, 1.0, "receiver dynamics", "receiver of 1.0 Hz"),
        ("ign8", 700, rectifying, 10.0, "load-dependent bias", "mg per g"),
        ("ign6x1", 701, rectifying, 10.0, "load-dependent bias", "mg per g"),
        # these lose the fixes
        ("ign6x1", 700, rectifying, 20.0, "load-dependent bias", "mg per g"),
        ("ign6x1", 700, slow_receiver, 0.5, "receiver dynamics", "receiver of 0.5 Hz"),
    ],
)
def test_what_follows_the_motion_is_named_and_no_constant(
    motion, seed, plant, size, name, sentence
):
    """Oracle: the exact motion and what was planted, to 4 sigma; before, a lever arm was refused
    that is not there, or scale factors and a step were noted. Images are within 4 of their sigmas.
    """
    sim = insgnss.simulate(motion, 5.0, imu_rate_hz=100.0, seed=seed)
    result = estimated(sim, plant(sim, size))
    assert BLAMED.isdisjoint(check.name for check in result.checks)
    (check,) = [check for check in result.checks if check.name == name]
    assert sentence in check.found
    if name == "gyro delay":
        value, sigma = check.found.removeprefix("gyros ").split(" ms ")[0].split(" +- ")
        assert abs(float(value) - 1e3 * abs(size)) < 4.0 * float(sigma)
    if name == "load-dependent bias":
        for pair in check.found.partition(" by ")[2].partition(" mg ")[0].split(", "):
            value, sigma = pair[2:].split(" +- ")
            assert abs(float(value) - size) < 4.0 * float(sigma)
    at = [sim.truth.eo.images.index(image) for image in result.eo.images]
    turn = sim.truth.eo.C_mc[at] @ np.swapaxes(result.eo.C_mc, -1, -2)
    error = np.hstack(
        [result.eo.position_m - sim.truth.eo.position_m[at], vector_from_rotation(turn)]
    )
    z = error / np.sqrt(np.diagonal(result.eo.cov, axis1=1, axis2=2))
    assert np.abs(z).max() < 4.0
    assert np.mean(z**2) < 2.0


def averaging_receiver(sim: Any, span_s: float) -> Any:
    """Fixes ahead of the antenna in turns by its acceleration times span^2 / 24, as means are."""
    return slow_receiver(sim, complex(0.0, np.sqrt(24.0) / span_s / (2.0 * np.pi)))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("motion", "seed", "plant", "size"),
    [
        ("ign8", 701, slow_receiver, 2.0),
        ("ign6x1", 703, slow_receiver, 2.0),
        ("ign6x1", 702, slow_receiver, 4.0),
        ("ign8", 702, averaging_receiver, 0.5),
    ],
)
def test_a_lag_does_not_hide_in_a_lever_arm_that_nobody_states(motion, seed, plant, size) -> None:
    """Oracle: the exact heights: 62 mm off at 2 Hz and 11 sigmas, in silence, before."""
    sim = insgnss.simulate(motion, 5.0, imu_rate_hz=100.0, seed=seed)
    imu, gnss, mounting = plant(sim, size)
    unstated = replace(mounting, antenna_sigma_m=None)
    plane = sim.tangent_plane
    result = insgnss.estimate(
        *(imu, gnss, sim.events),
        mounting=unstated,
        tangent_plane=(*np.degrees([plane.lat, plane.lon]), plane.height),
    )
    at = [sim.truth.eo.images.index(image) for image in result.eo.images]
    error = result.eo.position_m - sim.truth.eo.position_m[at]
    z = error / np.sqrt(np.diagonal(result.eo.cov, axis1=1, axis2=2))[:, :3]
    assert np.abs(z).max() < 4.0


def test_what_is_not_adopted_is_in_the_covariance() -> None:
    """Oracle: mean and mixture by hand: a shift of 40 mm with a lag of 4 +- 1, as probable as not;
    about the adopted one half of the mixture is 40 mm off, the other has 10 mm of its own.
    """
    time = np.arange(5.0)
    before: Any = SimpleNamespace(nav=np.zeros((5, 10)), time=time)
    after: Any = SimpleNamespace(nav=np.zeros((5, 10)) + np.eye(10)[2] * 0.04, time=time)
    posed: Any = None
    lag = DynamicsTrial(DYNAMICS[1], np.array([4e-3]), np.array([1e-3]), 0.0, posed, after)
    assert_allclose(lag.shared_error(before).cov[2, 2], 0.5 * 0.04**2 + 0.5 * 0.01**2)
    assert_allclose(lag.shared_error(before, False).cov[2, 2], 0.5 * (0.04**2 + 0.01**2))
    assert lag.shared_error(before).within(np.arange(5)).all()


@pytest.mark.slow
@pytest.mark.parametrize("size_m", [0.1, -0.1])
def test_a_wrong_lever_arm_is_no_late_sensor(size_m: float) -> None:
    """Oracle: what was planted: an antenna 10 cm too high or too low, which in a coordinated turn
    is what a receiver's tracking loop does.
    """
    sim = insgnss.simulate("ign8", 5.0, imu_rate_hz=100.0, seed=700)
    off = sim.mounting.C_cb @ np.array([0.0, 0.0, size_m])
    mounting = replace(sim.mounting, antenna_m=sim.mounting.antenna_m + off)
    with pytest.raises(
        insgnss.InsgnssError,
        match="antenna lever arm: the vector from the IMU to the antenna is off by down",
    ):
        estimated(sim, (sim.imu, sim.gnss, mounting))


@pytest.mark.slow
def test_a_scale_factor_is_no_load_dependent_bias() -> None:
    """Oracle: what was planted: accelerometers that show 1 % too much, whose vertical one has a
    bias that grows with the load factor as well.
    """
    sim = insgnss.simulate("ign8", 5.0, imu_rate_hz=100.0, seed=700)
    imu = replace(sim.imu, accel=1.01 * sim.imu.accel)
    names = {check.name for check in estimated(sim, (imu, sim.gnss, sim.mounting)).checks}
    assert "IMU scale factors" in names
    assert "load-dependent bias" not in names


def test_a_bias_that_grows_with_the_load_is_taken_off() -> None:
    """Oracle: by hand: increments of 1.3 g for half of the time; a bias of 0.1 m/s^2 a g is 0.03
    m/s^2 there and none at 1 g, but within a quarter of a second of the change.
    """
    flown = fly(20.0, seed=3, imu_hz=100.0, noise=None)
    inc = flown.problem.inc
    since = np.cumsum(inc.dt)
    load = np.where(since > 10.0, 0.3, 0.0)
    dvel = np.outer((1.0 + load) * inc.dt, [0.0, 0.0, -G])
    biased = dvel + np.outer(load * inc.dt, [0.1, -0.1, 0.0])
    problem = replace(flown.problem, inc=replace(inc, dvel=biased))
    solution: Any = SimpleNamespace()
    mended = without_load_bias(problem, solution)(np.array([0.1, -0.1, 0.0])).inc.dvel
    away = np.abs(since - 10.0) > 0.3
    # its share in the magnitude, 0.03^2 / 2 / 13, is left
    assert_allclose(mended[away], dvel[away], atol=1e-7)


def test_late_gyros_are_taken_back() -> None:
    """Oracle: samples whose gyros are those of the sample before: a delay of one interval, without
    which increments and rates are those of the right samples; accelerometers stay.
    """
    flown = fly(20.0, seed=3, imu_hz=100.0, noise=None)
    imu, marks, true = flown.sim.imu, flown.problem.inc.marks, flown.problem.inc
    late = replace(imu, gyro=np.concatenate([imu.gyro[:1], imu.gyro[:-1]]))
    inc = body_increments(late, np.eye(3), marks)
    solution: Any = SimpleNamespace()
    mended = with_earlier_gyros(replace(flown.problem, inc=inc), solution)(np.array([0.01])).inc
    inside = slice(5, -5)
    assert_allclose(mended.dtheta[inside], true.dtheta[inside], atol=2e-6)
    assert np.abs(inc.dtheta - true.dtheta)[inside].max() > 5e-5
    assert_allclose(mended.dvel, inc.dvel)
    assert_allclose(mended.rate[inside], true.rate[inside], atol=4e-3)


def test_fixes_that_lag_are_moved_ahead() -> None:
    """Oracle: the exact motion: fixes behind the antenna by its acceleration over (2 pi)^2, up to
    0.1 m, come back to it within a twentieth of that.
    """
    flown = fly(60.0, seed=31, imu_hz=50.0)
    problem, motion, time = flown.problem, flown.sim.flight.motion, flown.problem.inc.marks

    def antenna(at: np.ndarray) -> np.ndarray:
        return motion.position(at) + motion.C_lb(at) @ problem.antenna_lever_b

    h, lag = 1e-2, 1.0 / (2.0 * np.pi) ** 2
    at = np.clip(time, time[0] + h, time[-1] - h)
    behind = lag * (antenna(at + h) - 2.0 * antenna(at) + antenna(at - h)) / h**2
    epochs = problem.epochs._replace(position=antenna(time) - behind)
    solution: Any = SimpleNamespace(nav=flown.true_nav())
    followed = with_followed_fixes(replace(problem, epochs=epochs), solution)
    mended = followed(np.array([lag])).epochs.position
    inside = np.flatnonzero(problem.epochs.has_position)[5:-5]
    largest = np.abs(behind[inside]).max()
    assert largest > 0.1
    assert np.abs(mended - antenna(time))[inside].max() < 0.05 * largest
