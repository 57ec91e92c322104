"""Misalignments that the flight file leaves open: the gyros define the axes of the body."""

from dataclasses import replace

import numpy as np
import pytest
from air_motions import multirotor

import insgnss
from insgnss.geodesy.rotation import rotation_from_vector, vector_from_rotation
from insgnss.navigation.noise_model.model import load_noise_model
from insgnss.simulation.scenario import observe
from insgnss.simulation.sensors import ImuOptions

OPEN_RAD = 0.008  # misalignment of a consumer sensor, as `inspect` drafts it
TURN_RAD = np.array([0.006, -0.009, 0.008])  # of the gyros in their case
AGAINST_RAD = np.array([0.004, 0.003, -0.005])  # of the accelerometers against the gyros


def test_a_turned_imu_counts_as_bore_sight() -> None:
    """Oracle: exact motion, whose body the gyros' axes are turned against; a copter that flies
    sideways knows its tilt as well as one without misalignments, and errs by no more than its
    sigmas. With twelve open misalignments of 8 mrad what they share is 4 mrad = 0.23 deg.
    """
    sim = observe(multirotor(4.0, "sideways", seed=31), 31, imu=ImuOptions(100.0, "consumer"))
    R = rotation_from_vector(TURN_RAD)
    accel = sim.imu.accel @ R @ rotation_from_vector(AGAINST_RAD)
    turned = replace(sim.imu, gyro=sim.imu.gyro @ R, accel=accel)
    consumer = load_noise_model("consumer")
    gyro, accelerometer = (
        tuple(replace(axis, misalignment=OPEN_RAD) for axis in axes)
        for axes in (consumer.gyro, consumer.accel)
    )
    model = replace(consumer, gyro=gyro, accel=accelerometer)
    sigma = {}
    for is_open, imu in ((False, sim.imu), (True, turned)):
        path = insgnss.estimate(
            imu,
            sim.gnss,
            mounting=sim.mounting,
            noise=model,
            filter_options=insgnss.FilterOptions(misalignment=is_open),
        ).trajectory
        sigma[is_open] = np.sqrt(np.diagonal(path.cov, axis1=1, axis2=2)[:, 6:9])
        C_nb = sim.truth.trajectory.at(path.time).C_nb @ (R if is_open else np.eye(3))
        off = vector_from_rotation(path.C_nb @ np.swapaxes(C_nb, -1, -2))
        assert np.abs(off / sigma[is_open]).max() < 4.5
    tilt = {is_open: np.median(s[:, :2]) for is_open, s in sigma.items()}
    assert tilt[True] == pytest.approx(tilt[False], rel=0.5)
