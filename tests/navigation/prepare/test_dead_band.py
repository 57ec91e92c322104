"""Gyros that hide slow turns: the band is found, its error enters noise model and sigmas."""

from dataclasses import replace

import numpy as np
import pytest

import insgnss
from insgnss.flight.processing.recording import with_dead_bands
from insgnss.geodesy.rotation import vector_from_rotation
from insgnss.navigation.noise_model.model import load_noise_model
from insgnss.navigation.prepare.dead_band import DeadBand, dead_band_of, dead_bands
from insgnss.simulation.ground import drive
from insgnss.simulation.scenario import ImuOptions, observe
from insgnss.simulation.sensors import axes_matrix

DT = 0.01


def test_band_of_a_slow_turn():
    """Oracle: (D.1) by hand. A rate that swings by 0.05 rad/s in 20 s and reads 0.003 below a
    hundredth of a rad/s stays there for 20 s asin(0.2) / pi = 1.28 s at a time.
    """
    time = np.arange(0.0, 200.0, DT)
    rate = 0.05 * np.sin(2.0 * np.pi * time / 20.0 + 0.3)
    band = dead_band_of(0.003 + np.where(np.abs(rate) < 0.01, 0.0, rate), DT)
    assert band is not None
    assert band.half_width == pytest.approx(0.01, rel=0.02)
    assert band.duration_s == pytest.approx(20.0 * np.arcsin(0.2) / np.pi, rel=0.02)
    assert band.share == pytest.approx(2.0 * np.arcsin(0.2) / np.pi, abs=0.01)
    assert band.sigma == pytest.approx(0.01 / np.sqrt(3.0), rel=0.02)
    assert dead_band_of(rate, DT) is None
    assert dead_band_of(np.round(rate, 4), DT) is None


def test_a_tenth_of_the_samples_and_runs_of_a_minute_at_most():
    """Oracle: (D.1) by hand: a tenth of all readings is zero; of one run of 100 s 60 s count."""
    rng = np.random.default_rng(2)
    for share, found in ((0.09, False), (0.11, True)):
        rate = np.where(np.arange(10_000) % 100 < 100 * share, 0.0, rng.normal(0.0, 0.1, 10_000))
        assert (dead_band_of(rate, DT) is not None) == found
    stand = np.concatenate([np.zeros(10_000), rng.normal(0.0, 0.1, 10_000)])
    band = dead_band_of(stand, DT)
    assert band is not None
    assert band.duration_s == pytest.approx(60.0)


def test_it_counts_from_three_tenths_of_the_white_noise_on():
    """Oracle: power at low frequencies of a Gauss-Markov process, 2 sigma^2 T: 1.2e-6 of a band
    of 1e-3 sqrt(3) for 0.6 s, beside 0.3 of that of the white noise.
    """
    band = DeadBand(1e-3 * np.sqrt(3.0), 0.5, 0.6)
    assert band.counts(0.0019)  # 0.3 w^2 = 1.1e-6
    assert not band.counts(0.0021)  # 1.3e-6


def drives(seed=1):
    """A drive of three minutes with poor fixes, its IMU turned."""
    imu = ImuOptions(100.0, "consumer", "right backward down")
    return observe(drive(3.0, seed=seed), seed, imu=imu, truth_hz=1.0)


def test_it_enters_at_its_axis_of_the_body():
    """Oracle: the sensor's y points backward, so the body's forward gyro has the process; what
    noise lifts out of the band at every sample is left alone.
    """
    imu, noise = drives().imu, load_noise_model("consumer")
    C_b_imu = axes_matrix("right backward down")
    gyro = imu.gyro.copy()
    gyro[:, 1] = np.where(np.abs(gyro[:, 1]) < 0.02, 0.0, gyro[:, 1])
    changed, (note,) = with_dead_bands(dead_bands(replace(imu, gyro=gyro)), C_b_imu, noise)
    assert [len(axis.gauss_markov) for axis in changed.gyro] == [1, 0, 0]
    assert changed.gyro[0].gauss_markov[0].sigma == pytest.approx(0.02 / np.sqrt(3.0), rel=0.05)
    assert note.name == "IMU noise"
    assert "gyro y" in note.found
    increments = replace(imu, gyro=gyro * DT, accel=imu.accel * DT, quantity="increments")
    again, _ = with_dead_bands(dead_bands(increments), C_b_imu, noise)
    found = again.gyro[0].gauss_markov[0]
    assert found.sigma == pytest.approx(changed.gyro[0].gauss_markov[0].sigma, rel=1e-3)
    assert with_dead_bands(dead_bands(imu), C_b_imu, noise) == (noise, [])
    dithered = replace(imu, gyro=np.round(imu.gyro, 3))
    assert with_dead_bands(dead_bands(dithered), C_b_imu, noise) == (noise, [])


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1])
def test_heading_of_a_drive_without_slow_turns_is_honest(seed):
    """Oracle: the simulator's truth. Rates cut to hundredths of a rad/s (0.57 deg/s) had made
    headings 3 and tilts 6 sigmas wrong, or a refusal.
    """
    sim = drives(seed)
    imu = replace(sim.imu, gyro=np.trunc(100.0 * sim.imu.gyro) / 100.0)
    result = insgnss.estimate(
        *(imu, sim.gnss),
        mounting=sim.mounting,
        noise="consumer",
        imu_axes="right backward down",
        trajectory_hz=1.0,
    )
    own, motion = result.trajectory, sim.flight.motion
    true = motion.C_nl(own.time) @ motion.C_lb(own.time)
    psi = vector_from_rotation(true @ np.swapaxes(own.C_nb, 1, 2))
    z = psi / np.sqrt(np.diagonal(own.cov, axis1=1, axis2=2))[:, 6:]
    assert np.abs(z).max() < 4.5
    assert np.mean(z**2) < 2.0
    (note,) = [c for c in result.checks if c.found.startswith("dead band")]
    assert note.verdict == "note"
