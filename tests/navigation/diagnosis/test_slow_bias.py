"""An IMU that warms up, or whose biases drift: the course that explains the innovations."""

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import insgnss
from insgnss.geodesy.rotation import vector_from_rotation
from insgnss.navigation.diagnosis.candidates import ErrorModel
from insgnss.navigation.diagnosis.drift import slow_bias_candidate
from insgnss.navigation.filter.layout import FixErrors

DEG_H, MG = np.radians(1.0) / 3600.0, 9.80665e-3


@dataclass(frozen=True)
class Posed:
    """What of a problem is looked at."""

    epochs: Any
    layout: Any = None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("time_s", "gyro", "accel", "words"),
    [
        (90.0, 150.0, 5.0, "warms up over about 90 s"),
        (90.0, 500.0, 16.0, "warms up over about 90 s"),  # no fix follows the flight file
        (np.inf, 200.0, 3.0, "biases drift linearly"),
        (None, 200.0, 5.0, "biases follow it"),
    ],
)
def test_a_slow_bias_is_named_and_the_images_are_honest(time_s, gyro, accel, words):
    """Oracle: the exact motion and what was planted: six biases in proportion 1, -0.7, 0.5; with
    larger noise in its place, tilts of the first minutes are off by many sigma. With a thermometer
    of a step of 0.1 deg the temperature swings by 10 deg, as when the sun comes and goes.
    """
    sim = insgnss.simulate("ign8", 6.0, imu_rate_hz=100.0, seed=700)
    since = sim.imu.time - sim.imu.time[0]
    thermometer = None
    if time_s is None:
        course = np.sin(2.0 * np.pi * since / 250.0) * np.cos(since / 70.0)
        thermometer = np.round(20.0 + 5.0 * course, 1)
    else:
        course = since / since[-1] if np.isinf(time_s) else np.exp(-since / time_s)
    shape = course[:, None] * np.array([1.0, -0.7, 0.5])
    imu = replace(
        sim.imu,
        gyro=sim.imu.gyro + gyro * DEG_H * shape,
        accel=sim.imu.accel + accel * MG * shape,
        temperature=thermometer,
    )
    plane = sim.tangent_plane
    result = insgnss.estimate(
        *(imu, sim.gnss, sim.events),
        mounting=replace(sim.mounting, antenna_sigma_m=0.005),
        tangent_plane=(*np.degrees([plane.lat, plane.lon]), plane.height),
    )
    (check,) = [check for check in result.checks if check.name == "IMU warm-up"]
    assert words in check.found
    assert "IMU noise" not in {check.name for check in result.checks}
    at = [sim.truth.eo.images.index(name) for name in result.eo.images]
    turn = sim.truth.eo.C_mc[at] @ np.swapaxes(result.eo.C_mc, -1, -2)
    error = np.hstack(
        [result.eo.position_m - sim.truth.eo.position_m[at], vector_from_rotation(turn)]
    )
    z = error / np.sqrt(np.diagonal(result.eo.cov, axis1=1, axis2=2))
    assert np.abs(z).max() < 4.0
    assert np.mean(z**2) < 2.0


@pytest.mark.parametrize(
    ("true_s", "found_s"), [(90.0, 90.0), (60.0, 68.4), (360.0, 360.0), (30.0, 30.0)]
)
def test_the_time_constant_is_found_on_a_grid_and_between(true_s, found_s):
    """Oracle: a likelihood with its maximum at a known place of log T: the nearest of the grid 30,
    90, 300 s, a drift over the 360 s of the flight, then between in steps of 3^(1/4).
    """

    def likelihood(slow, parameters):
        assert slow.course == ("drift" if slow.time_s == 360.0 else "decay")
        return 50.0 - 10.0 * abs(np.log(slow.time_s / true_s))

    model = ErrorModel(FixErrors())
    search = SimpleNamespace(
        layout=lambda model: model.imu.slow,
        progress=lambda _: None,
    )
    variances = SimpleNamespace(evidence_of=likelihood)
    problem = Posed(SimpleNamespace(time=np.array([0.0, 360.0]), temperature=np.zeros(2)))
    found = slow_bias_candidate(search, model, problem, variances)
    assert found is not None
    assert found.model.imu.slow.time_s == pytest.approx(found_s, rel=1e-3)
    nothing = SimpleNamespace(evidence_of=lambda *_: 3.9)
    assert slow_bias_candidate(search, model, problem, nothing) is None
    assert slow_bias_candidate(search, found.model, problem, variances) is None
