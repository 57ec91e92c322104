"""Sensors of [[measurement]] with a wrong constant: named, or covered by the sigmas."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import insgnss
import insgnss.flight.config.imu_options  # registers the kind of option "axes"
from insgnss.base.errors import InputError
from insgnss.flight.sensors.kinds import kinds
from insgnss.flight.sensors.options import MeasurementInput
from insgnss.geodesy.rotation import rotation_from_vector

LEVER = np.array([1.0, 0.2, -0.1])  # m, from the first antenna to the second
FIELD = np.array([20.5, 0.9, 42.7])  # uT, north, east, down: a declination of 2.5 deg
OF_BASELINE = {"lever_m": tuple(LEVER)}
OF_FIELD = {"declination_deg": 2.5}


def sensor(kind: str, time, values, sigma, seed: int, options) -> insgnss.Measurement:
    """Values with noise as a table [[measurement]] of the kind takes them."""
    columns = ("forward",) if kind == "body_velocity" else tuple(kinds()[kind].values.split())
    table = MeasurementInput(kind=kind, file=Path("x"), **options)
    predict, states, *derivative = kinds()[kind].model(table, columns)
    noisy = values + sigma * np.random.default_rng(seed).standard_normal(values.shape)
    period = 2.0 * np.pi if kinds()[kind].unit == "angle" else None
    return insgnss.Measurement(
        *(kind, time, noisy, sigma, predict, states),
        period=period,
        derivative=(*derivative, None)[0],
    )


def heading(path):
    return path.rpy[:, 2:]


def course(path):
    return np.arctan2(path.velocity_ned[:, 1:2], path.velocity_ned[:, :1])


def forward(path):
    return np.einsum("ki,ki->k", path.C_nb[:, :, 0], path.velocity_ned)[:, None]


def baseline(path, turn_deg=0.0):
    return path.C_nb @ (rotation_from_vector(np.radians([0.0, 0.0, turn_deg])) @ LEVER)


def field(path):
    return np.swapaxes(path.C_nb, 1, 2) @ FIELD


def disturbed(path, field_ut=10.0):
    """Iron or a current for half a minute."""
    spell = during(path, 60.0, 90.0)
    return field(path) + field_ut * spell[:, None] * np.array([0.6, -0.8, 0.0])


def during(path, begin_s, end_s):
    after = path.time - path.time[0]
    return (after > begin_s) & (after < end_s)


def rolled(path, begin_s, end_s, factor):
    """A wheel that turns too much or too little from one time to another."""
    return forward(path) * np.where(during(path, begin_s, end_s), factor, 1.0)[:, None]


def ground_speed(path):
    return np.linalg.norm(path.velocity_ned[:, :2], axis=1)[:, None]


COVERED = None
WRONG = {
    "baseline turned": ("baseline", lambda p: baseline(p, 2.0), 0.005, OF_BASELINE, COVERED),
    "baseline turned, stated as exact": (
        *("baseline", lambda p: baseline(p, 2.0), 0.005),
        *(
            OF_BASELINE | {"offset_sigma_deg": 0.0},
            r"offset down (at|is) [12]\.\d+.* deg.*(stated 0|0 .*stated)",
        ),
    ),
    "antennas further apart than stated": (
        *("baseline", baseline, 0.005, {"lever_m": (1.2, 0.2, -0.1)}),
        r"divided by 0\.8[345]\d* \(unit, sign or length\)",
    ),
    "antenna to the side of where it is stated": (
        *("baseline", baseline, 0.005, {"lever_m": (1.0, 0.0, -0.1)}),
        r"with its offset down at 1[01]\.\d deg \(stated 0",
    ),
    "odometer scale": ("body_velocity", lambda p: 1.01 * forward(p), 0.05, {}, COVERED),
    "odometer scale, stated as exact": (
        *("body_velocity", lambda p: 1.01 * forward(p), 0.05, {"scale_sigma": 0.0}),
        "body_velocity contradicts the flight solved without this sensor",
    ),
    "odometer sign": (
        *("body_velocity", lambda p: -forward(p), 0.05, {}),
        r"with its scale factor at -2(\.\d+)? \(stated 0",
    ),
    "odometer in km/h": (
        *("body_velocity", lambda p: 3.6 * forward(p), 0.05, {}),
        r"with its scale factor at 2\.6",
    ),
    "magnetometer disturbed": (
        *("magnetometer", disturbed, 0.4, OF_FIELD),
        "values contradict the flight solved without these sensors: magnetometer",
    ),
    "magnetometer disturbed a little": (
        *("magnetometer", lambda p: disturbed(p, 3.0), 0.4, OF_FIELD),
        "magnetometer contradicts the flight solved without this sensor",
    ),
    "magnetometer without declination": (
        *("magnetometer", field, 0.4, {"declination_deg": 0.0}),
        r"declination is 2\.\d+ .* 0 \+- 0\.5 is stated",
    ),
    "odometer slips": (
        *("body_velocity", lambda p: rolled(p, 60.0, 70.0, 0.9), 0.05, {}),
        "values contradict the flight solved without these sensors: body_velocity",
    ),
    "wheel of another size in flight": (
        *("body_velocity", lambda p: rolled(p, 90.0, np.inf, 1.02), 0.05, {}),
        "body_velocity contradicts the flight solved without this sensor",
    ),
    "antennas exchanged": (
        *("baseline", lambda p: -baseline(p), 0.005, OF_BASELINE),
        r"divided by -1 \(unit, sign or length\)",
    ),
    "ground speed given as airspeed": ("airspeed", ground_speed, 0.3, {}, COVERED),
    "course given as heading": (
        *("heading", course, np.radians(0.2), {}),
        r"taken for the course over ground they scatter (1|0\.9\d) times",
    ),
    "right heading": ("heading", heading, np.radians(0.2), {}, COVERED),
}
CLOCK = {
    -0.1: r"with -0\.(09|10)\d s added to its stamps",  # values stamped 0.1 s late
    0.1: r"with \+0\.(09|10)\d s added to its stamps",
}
LATE = {0.1: COVERED, 0.3: r"with -0\.(2|3)\d+ s added", 0.5: r"with -0\.(4|5)\d+ s added"}


def flown(seed: int):
    """A flight of three minutes with a consumer IMU, and where it truly was."""
    sim = insgnss.simulate(
        "ign8", 3.0, imu_rate_hz=50.0, noise="consumer", seed=seed, start_in_air=True
    )
    return sim, sim.truth.trajectory


def estimated(sim, measurement, noise="consumer"):
    return insgnss.estimate(
        *(sim.imu, sim.gnss, sim.events),
        mounting=sim.mounting,
        noise=noise,
        measurements=[measurement],
    )


@pytest.mark.slow
@pytest.mark.parametrize("seed", [7, 8])
@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_constant_is_named_or_covered(name, seed):
    """Oracle: what was put in: the sentence names it with its size; else the true heading lies
    within four sigmas throughout, and no other noise of the IMU is made up for it.
    """
    kind, values, sigma, options, said = WRONG[name]
    sim, truth = flown(seed)
    path = truth[10:-10]
    measurement = sensor(kind, path.time, values(path), sigma, seed, options)
    named_or_covered(sim, truth, measurement, said)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [7, 8])
@pytest.mark.parametrize("late_s", LATE)
def test_a_late_odometer_is_named_or_covered(late_s, seed):
    """Oracle: as above; of a flight at nearly one speed a delay shows in its turns alone."""
    sim, truth = flown(seed)
    time = truth[10:-10].time
    values = forward(truth.at(time - late_s))
    measurement = sensor("body_velocity", time, values, 0.05, seed, {})
    named_or_covered(sim, truth, measurement, LATE[late_s])


def named_or_covered(sim, truth, measurement, said):
    """What is wrong of a sensor is said, or left out, or the heading lies in four sigmas."""
    if said is not None and "without these" not in said:
        with pytest.raises(InputError, match=said):
            estimated(sim, measurement)
        return
    result = estimated(sim, measurement)
    found, exact = result.trajectory, truth.at(result.trajectory.time)
    turn = np.einsum("kj,kj->k", found.C_nb[:, 1], exact.C_nb[:, 0])
    assert (np.abs(turn) < 4.0 * np.sqrt(found.cov[:, 8, 8])).all()
    notes = [check.found for check in result.checks if check.verdict == "note"]
    assert not any("explains the innovations" in note for note in notes)
    assert any(said in note for note in notes) if said else not any("left out" in n for n in notes)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [7, 8])
@pytest.mark.parametrize("early_s", CLOCK)
def test_stamps_that_are_off_are_named_with_what_puts_them_right(early_s, seed):
    """Oracle: the tenth of a second put in, to 10 ms."""
    sim, truth = flown(seed)
    path = truth[10:-10]
    values = heading(truth.at(path.time + early_s))
    measurement = sensor("heading", path.time, values, np.radians(0.2), seed, {})
    with pytest.raises(InputError, match=CLOCK[early_s]):
        estimated(sim, measurement)


@pytest.mark.slow
def test_stamps_that_are_off_are_named_while_the_imu_warms_up():
    """Oracle: the tenth of a second put in; the flight without the sensor has states of its own."""
    sim = insgnss.simulate("ign8", 4.0, imu_rate_hz=50.0, seed=7)
    course = np.exp((sim.imu.time[0] - sim.imu.time) / 90.0)[:, None] * [1.0, -0.7, 0.5]
    gyro = sim.imu.gyro + np.radians(150.0 / 3600.0) * course
    sim = replace(sim, imu=replace(sim.imu, gyro=gyro, accel=sim.imu.accel + 0.05 * course))
    truth = sim.truth.trajectory
    path = truth[10:-10]
    late = heading(truth.at(path.time - 0.1))
    measurement = sensor("heading", path.time, late, np.radians(0.2), 7, {})
    with pytest.raises(InputError, match=CLOCK[-0.1]):
        estimated(sim, measurement, "navchip")
