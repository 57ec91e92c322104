"""Rest, and what looks like it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from insgnss.io.formats import read_gnss, read_imu
from insgnss.navigation.prepare.stationarity import stationary_periods
from insgnss.records import GnssFixes, ImuSamples
from insgnss.simulation.scenario import GnssOptions, ImuOptions, simulate_flight

DATA = Path(__file__).parents[4] / "shared" / "data"
IMU_COLUMNS = {"tow": "time", "gx": "p", "gy": "q", "gz": "r", "ax": "ax", "ay": "ay", "az": "az"}
GNSS_COLUMNS = {
    "tow": "time",
    "lat": "lat",
    "lon": "lon",
    "h": "alt",
    "vn": "vn",
    "ve": "ve",
    "vd": "vd",
}


def recording(seconds, seed=0, rate=100.0, gyro=1e-3, accel=0.01):
    """White noise about a constant."""
    rng, n = np.random.default_rng(seed), int(seconds * rate)
    return ImuSamples(
        100.0 + np.arange(n) / rate,
        rng.normal(0.0, gyro, (n, 3)) + [0.01, -0.02, 0.0],
        rng.normal(0.0, accel, (n, 3)) + [0.1, 0.2, -9.8],
    )


def shaken(imu, begin, end, gyro, accel, seed=1):
    """The recording with vibration between two instants."""
    inside = ((imu.time > begin) & (imu.time < end))[:, None]
    rng = np.random.default_rng(seed)
    noise = [rng.normal(0.0, s, imu.gyro.shape) * inside for s in (gyro, accel)]
    return replace(imu, gyro=imu.gyro + noise[0], accel=imu.accel + noise[1])


def standing_gnss(begin, end, velocity=(0.0, 0.0, 0.0), sigma=0.02, rate=5.0):
    """Fixes of a receiver at 46.5 N with a velocity, exact."""
    time = np.arange(begin, end, 1.0 / rate)
    north, east, _ = (time - begin)[:, None].T * np.array(velocity)[:, None]
    cov = np.broadcast_to(sigma**2 * np.eye(3), (time.size, 3, 3))
    return GnssFixes(
        time, np.radians(46.5) + north / 6.37e6, 0.1 + east / 4.4e6, np.full(time.size, 400.0), cov
    )


@pytest.fixture(scope="module")
def flown():
    return simulate_flight("ign8", 6.0, seed=1, imu=ImuOptions(rate_hz=100.0))


@pytest.mark.parametrize("with_gnss", [True, False])
def test_the_stand_before_take_off_is_found_and_nothing_in_the_air(flown, with_gnss):
    """Oracle: the simulator's exact velocity."""
    found = stationary_periods(flown.imu, flown.gnss if with_gnss else None)
    truth = flown.truth.trajectory
    speed = np.linalg.norm(truth.velocity_ned, axis=1)
    begins_to_move = truth.time[np.argmax(speed > 0.01)]
    assert len(found) == 1
    assert found.time[0, 0] < flown.imu.time[0] + 0.5
    assert begins_to_move - 1.0 < found.time[0, 1] < begins_to_move + 0.3
    assert speed[found.index_of(truth.time) == 0].max() < 0.02


def test_the_means_of_a_stretch_are_bias_earth_rate_and_gravity(flown):
    """Oracle: exact motion plus the simulated slow errors, within four sigmas of the white noise's
    mean.
    """
    found = stationary_periods(flown.imu)
    inside = found.index_of(flown.truth.trajectory.time) == 0
    bias = flown.truth.gyro_bias[inside].mean(axis=0)
    rate, _ = flown.flight.motion.inertial(np.array([found.time[0].mean()]))
    sigma = found.gyro_std[0] / np.sqrt(found.samples[0])
    assert (np.abs(found.gyro_mean[0] - bias - rate[0]) < 4.0 * sigma + 2e-6).all()
    assert np.linalg.norm(found.accel_mean[0]) == pytest.approx(9.81, abs=0.1)


def test_a_smooth_cruise_is_no_rest_where_gnss_is_there():
    """Oracle: constant velocity feels like rest (Newton); the GNSS moves."""
    imu = recording(60.0)
    assert len(stationary_periods(imu)) == 1
    assert len(stationary_periods(imu, standing_gnss(100.0, 160.0))) == 1
    assert len(stationary_periods(imu, standing_gnss(100.0, 160.0, (15.0, 0.0, 0.0)))) == 0
    assert len(stationary_periods(imu, standing_gnss(100.0, 160.0, (0.0, 0.5, 0.0)))) == 0
    poor = standing_gnss(
        100.0, 160.0, (0.0, 1.0, 0.0), sigma=3.0
    )  # seen over the whole stretch, in no single second
    assert len(stationary_periods(imu, poor)) == 0


def test_a_calm_flight_that_starts_in_the_air_never_rests():
    """Oracle: the simulator; no turbulence, ideal sensors, a receiver of 2 m."""
    calm = simulate_flight(
        "ign8",
        3.0,
        seed=2,
        imu=ImuOptions(rate_hz=50.0, noise=None),
        gnss=GnssOptions(sigma_m=(2.0, 2.0, 3.0)),
        start_in_air=True,
        turbulence=0.0,
    )
    assert len(stationary_periods(calm.imu, calm.gnss)) == 0


def test_hovering_is_no_rest():
    """Oracle: vibration of a hovering multirotor (0.5 m/s^2, 0.05 rad/s) while GNSS stands; with
    and without a stand on the ground.
    """
    gnss = standing_gnss(100.0, 160.0)
    hover = shaken(recording(60.0), 110.0, 150.0, 0.05, 0.5)
    found = stationary_periods(hover, gnss)
    np.testing.assert_allclose(found.time, [[100.2, 109.8], [150.2, 159.8]], rtol=0, atol=0.3)
    assert len(stationary_periods(shaken(recording(60.0), 0.0, 200.0, 0.05, 0.5), gnss)) == 0


def alternating(gyro=1e-3, accel=0.01, bias=0.0, force=9.8):
    """Twenty seconds whose samples lie so much above and below their mean, in turn."""
    n = 2000
    sign = np.where(np.arange(n) % 2, 1.0, -1.0)[:, None]
    return ImuSamples(
        100.0 + 0.01 * np.arange(n),
        gyro * sign + [bias, 0.0, 0.0],
        accel * sign + [0.0, 0.0, -force],
    )


@pytest.mark.parametrize(
    ("key", "rest", "motion"),
    [
        ("gyro", 0.0196, 0.0204),
        ("accel", 0.294, 0.306),
        ("bias", 0.098, 0.102),
        ("bias", -0.098, -0.102),
        ("force", 9.18, 8.82),
        ("force", 10.4, 10.8),
    ],
)
def test_from_where_on_a_sensor_is_not_at_rest(key, rest, motion):
    """Oracle: 0.02 rad/s and 0.3 m/s^2 of noise, a mean rate of 0.1 rad/s, a force of 9 to 10.6
    m/s^2; 2 % on either side.
    """
    assert len(stationary_periods(alternating(**{key: rest}))) == 1
    assert len(stationary_periods(alternating(**{key: motion}))) == 0


def test_slow_turning_is_no_rest():
    """Oracle: a swing of 1 deg/s over 8 s on noise of 0.3 deg/s, where no rest is to compare it
    with; 3 deg/s steady beside a stand.
    """
    imu = recording(60.0, gyro=5e-3)
    swing = np.radians(1.0) * np.sin(2.0 * np.pi * imu.time / 2.0)[:, None]
    assert len(stationary_periods(replace(imu, gyro=imu.gyro + swing))) == 0
    imu = shaken(recording(60.0), 130.0, 131.0, 0.1, 1.0)
    turning = np.where(imu.time > 131.0, np.radians(3.0), 0.0)[:, None] * [0.0, 0.0, 1.0]
    found = stationary_periods(replace(imu, gyro=imu.gyro + turning))
    assert found.time.max() < 131.0
    assert len(found) == 1


def test_a_gap_ends_a_stretch_and_increments_are_rates():
    """Oracle: the same samples as increments; a second without samples."""
    imu = recording(20.0)
    keep = (imu.time < 108.0) | (imu.time > 109.0)
    broken = replace(imu, time=imu.time[keep], gyro=imu.gyro[keep], accel=imu.accel[keep])
    rates = stationary_periods(broken)
    np.testing.assert_allclose(rates.time, [[100.2, 107.8], [109.2, 119.7]], rtol=0, atol=0.11)
    summed = stationary_periods(
        replace(broken, gyro=broken.gyro * 0.01, accel=broken.accel * 0.01, quantity="increments")
    )
    np.testing.assert_allclose(summed.gyro_mean, rates.gyro_mean, rtol=0, atol=1e-12)
    np.testing.assert_allclose(summed.accel_std, rates.accel_std, rtol=1e-9)


def test_where_an_instant_lies():
    """Oracle: the stretches' own times."""
    found = stationary_periods(shaken(recording(60.0), 110.0, 150.0, 0.05, 0.5))
    assert found.index_of(np.array([99.0, 105.0, 130.0, 155.0, 170.0])).tolist() == [
        -1,
        0,
        -1,
        1,
        -1,
    ]
    assert stationary_periods(shaken(recording(60.0), 0.0, 200.0, 0.05, 0.5)).index_of(
        np.array([105.0])
    ).tolist() == [-1]


def test_walk_has_no_rest_but_at_its_end():
    """Oracle: the recording's description (nearly still for the last 25 s only) and the receiver's
    RTK speed.
    """
    if not (DATA / "tilt_rtk_walk").is_dir():
        pytest.skip("the recording tilt_rtk_walk is not here")
    imu = read_imu(DATA / "tilt_rtk_walk" / "imu.aimu", quantity="instant_rate")
    gnss = read_gnss(DATA / "tilt_rtk_walk" / "gnss.nmea")
    for fixes in (gnss, None):
        found = stationary_periods(imu, fixes)
        assert len(found) >= 1
        assert found.time.min() > imu.time[-1] - 25.0


def test_fixed_wing_rests_on_the_ground_only():
    """Oracle: the receiver's height and speed: airborne 351 s above 260 m, on the ground before and
    after.
    """
    path = DATA / "umn_thor75" / "thor_flight75_2012_10_10.mat"
    if not path.is_file():
        pytest.skip("the recording umn_thor75 is not here")
    common = {"variable": "flight_data", "gps_week": 1709}
    imu = read_imu(path, columns=IMU_COLUMNS, quantity="instant_rate", **common)
    gnss = read_gnss(
        path,
        columns=GNSS_COLUMNS,
        repeat_column="GPS_TOW",
        sigma_m=[1.5, 1.5, 3.0],
        sigma_velocity=[0.3, 0.3, 0.5],
        **common,
    )
    speed = np.linalg.norm(gnss.velocity_ned, axis=1)
    for fixes in (gnss, None):
        found = stationary_periods(imu, fixes)
        assert np.diff(found.time, axis=1).sum() > 100.0
        inside = found.index_of(gnss.time) >= 0
        assert gnss.height[inside].max() < 260.0
        assert speed[inside].max() < 1.0
