"""Gyros and accelerometers in two text files, as loggers of telephones write them: found by
`insgnss inspect`, joined under one stamp, and read by the flight file that it drafts.
"""

from pathlib import Path

import numpy as np
import pytest

import insgnss
from insgnss.base.errors import InputError
from insgnss.flight.config.load import load_flight
from insgnss.flight.inspection.run import inspect_files
from insgnss.flight.processing.recording import read_recording
from insgnss.io.formats import read_imu
from insgnss.io.formats.imu.apart import join_sensors
from insgnss.records import ImuSamples


def motion(t):
    """Rates and forces that vary slowly, (n, 3) each."""
    rate = 0.3 * np.sin(np.outer(t, [0.9, 1.1, 1.3]))
    return rate, np.cos(np.outer(t, [0.7, 1.0, 0.5])) + [0.0, 0.0, -9.8]


def half(t, gyro=True, quantity="mean_rate"):
    rate, force = motion(t)
    nothing = np.zeros_like(rate)
    return ImuSamples(t, rate if gyro else nothing, nothing if gyro else force, quantity, 2000)


def mean_force(t, step):
    """The mean of the forces over the interval that ends at t, exactly."""
    w, p = np.array([0.7, 1.0, 0.5]), np.array([0.0, 0.0, -9.8])
    return (np.sin(np.outer(t, w)) - np.sin(np.outer(t - step, w))) / (step * w) + p


def test_same_stamps_are_put_side_by_side():
    t = 100.0 + 0.01 * np.arange(500)
    samples = join_sensors(half(t), half(t, gyro=False))
    assert np.array_equal(samples.accel, motion(t)[1])
    assert np.array_equal(samples.gyro, motion(t)[0])
    assert not samples.notes


def test_other_stamps_keep_the_integral_of_the_forces():
    """Oracle: the integral of the motion; between stamps 5 ms apart a cosine of 1 rad/s is a line
    to 1e-5.
    """
    t, own = 100.0 + 0.01 * np.arange(1000), 100.0023 + 0.005 * np.arange(-4, 2004)
    accel = ImuSamples(own, np.zeros((own.size, 3)), mean_force(own, 0.005), "mean_rate", 2000)
    samples = join_sensors(half(t), accel)
    assert samples.time.size >= t.size - 1
    assert np.abs(samples.accel - mean_force(samples.time, 0.01)).max() < 2e-5
    (note,) = samples.notes
    assert "accelerometers (200 Hz) resampled to the gyros' stamps (100 Hz)" in note.found


def test_rates_at_an_instant_are_interpolated():
    t, own = 100.0 + 0.01 * np.arange(1000), 99.9913 + 0.005 * np.arange(2010)
    samples = join_sensors(half(t, quantity="instant_rate"), half(own, False, "instant_rate"))
    assert np.abs(samples.accel - motion(samples.time)[1]).max() < 1e-5


def test_where_the_accelerometers_lack_the_imu_has_a_gap():
    """Oracle: the second without accelerometers is left out, and nothing beside it but the
    intervals that reach into it.
    """
    t = 100.0 + 0.01 * np.arange(1000)
    own = 100.0023 + 0.01 * np.arange(-2, 1002)
    own = own[(own < 104.0) | (own > 105.0)]
    samples = join_sensors(half(t), half(own, gyro=False))
    missing = np.setdiff1d(np.round(t, 6), np.round(samples.time, 6))
    assert 99 <= missing[missing > 101.0].size <= 103
    assert missing[missing > 101.0].min() > 103.98
    assert missing.max() < 105.02
    assert "left out" in samples.notes[0].found


def test_recordings_that_do_not_overlap_are_refused():
    t = 100.0 + 0.01 * np.arange(1000)
    with pytest.raises(InputError, match="must be of one recording and one clock"):
        join_sensors(half(t), half(t + 8.0, gyro=False))
    with pytest.raises(InputError, match="its increments have other stamps"):
        join_sensors(half(t, quantity="increments"), half(t + 0.001, False, "increments"))


@pytest.fixture(scope="module")
def sim():
    return insgnss.simulate("ign8", 3.0, imu_rate_hz=100.0, seed=7)


def write(path: Path, head: str, *columns):
    np.savetxt(path, np.column_stack(columns), "%.9f", ",", header=head, comments="")


def written(folder: Path, sim, shift_s: float = 0.0):
    """What Sensor Logger writes: x y z beside a clock, without gravity and with it."""
    t, (g, f) = sim.imu.time, (sim.imu.gyro.T, sim.imu.accel)
    later = t + shift_s
    head = "seconds_elapsed,z,y,x"
    force = np.column_stack([np.interp(later, t, f[:, c]) for c in range(3)])
    write(folder / "Gyroscope.csv", head, t, g[2], g[1], g[0])
    write(folder / "TotalAcceleration.csv", head, later, *force.T[::-1])
    write(folder / "acc_gravity.csv", head, t, *np.tile([0.0, 0.0, 9.81], (t.size, 1)).T)
    less = f - np.array([0.0, 0.0, -9.8]) * (np.abs(f[:, 2:]) > 1.0)
    write(folder / "Accelerometer.csv", head, t, *(less - less.mean(axis=0)).T[::-1])
    fix = sim.gnss
    place = (fix.time, *np.degrees([fix.lat, fix.lon]), fix.height, *np.full((3, len(fix)), 0.02))
    write(folder / "Location.csv", "seconds_elapsed,lat,lon,height,sd_n,sd_e,sd_u", *place)


@pytest.mark.slow
def test_two_files_of_a_telephone_are_one_imu(tmp_path, sim):
    """Oracle: the simulated samples, in the axes and units that they have."""
    written(tmp_path, sim, 0.004)
    found = inspect_files([tmp_path])
    assert found.draft is not None
    assert any("without gravity" in why for _, why, *_ in found.left_out)
    assert any("gravity computed by the device" in why for _, why, *_ in found.left_out)
    found.write(tmp_path / "flight.toml")
    flight = load_flight(tmp_path / "flight.toml")
    assert flight.imu.accel_file == tmp_path / "TotalAcceleration.csv"
    assert flight.imu.columns == {
        "tow": "seconds_elapsed",
        **{f"{s}{c}": c for s in "ga" for c in "xyz"},
    }
    recording = read_recording(flight)
    assert "forward right down" in flight.imu.axes
    n = recording.imu.time.size
    assert n >= sim.imu.time.size - 3
    at = np.searchsorted(sim.imu.time, recording.imu.time)
    assert np.abs(recording.imu.gyro - sim.imu.gyro[at]).max() < 1e-8
    assert np.corrcoef(recording.imu.accel[:, 0], sim.imu.accel[at, 0])[0, 1] > 0.8
    assert any(check.name == "IMU files" for check in recording.checks)


def test_gyros_alone_are_refused_with_what_lacks(tmp_path, sim):
    written(tmp_path, sim)
    with pytest.raises(InputError, match=r"gyros alone, .* accelerometers are missing"):
        inspect_files([tmp_path / "Gyroscope.csv", tmp_path / "Location.csv"])
    with pytest.raises(InputError, match="accelerations without gravity"):
        inspect_files([tmp_path / "Gyroscope.csv", tmp_path / "Accelerometer.csv"])


def test_a_rate_without_stamps_is_refused(tmp_path, sim):
    written(tmp_path, sim)
    with pytest.raises(insgnss.UsageError, match="two files need time stamps"):
        read_imu(
            tmp_path / "Gyroscope.csv", accel_file=tmp_path / "TotalAcceleration.csv", rate_hz=100.0
        )
