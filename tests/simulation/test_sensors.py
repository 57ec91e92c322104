"""IMU, GNSS and camera on an exact motion: geometry, statistics, options."""

import time as clock
from dataclasses import replace

import numpy as np
import pyproj
import pytest
from numpy.testing import assert_allclose
from scipy.stats import chi2
from surveys import block_flight

from insgnss.base.errors import UsageError
from insgnss.navigation.noise_model.model import AxisNoise, GaussMarkov, NoiseModel
from insgnss.simulation.raw_gnss.receiver import GnssOptions
from insgnss.simulation.scenario import SimulatedFlight, simulate_flight, true_eo
from insgnss.simulation.sensors import ImuOptions, Rig, antenna_states, axes_matrix, simulate_imu

S = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
TOPOCENTRIC = pyproj.Transformer.from_pipeline(
    "+proj=pipeline +step +proj=cart +ellps=WGS84 +step +proj=topocentric +ellps=WGS84 +lat_0=46.57"
    " +lon_0=6.54 +h_0=0"
)


@pytest.fixture(scope="module")
def flight():
    return block_flight(10.0, start_in_air=True, seed=2)


@pytest.fixture(scope="module")
def simulated() -> SimulatedFlight:
    return simulate_flight("ign8", 2.0, seed=1, imu=ImuOptions(rate_hz=100.0), start_in_air=True)


def enu(lat, lon, h):
    return np.stack(TOPOCENTRIC.transform(np.degrees(lon), np.degrees(lat), h), axis=-1)


def same(variance, expected, n):
    """Whether a sample variance of n values lies in the 99.9 % interval of chi-square."""
    low, high = chi2.ppf([0.0005, 0.9995], n) / n
    return low < variance / expected < high


def test_mounting_is_that_of_the_paper():
    """Oracle: Table 1 by hand: the antenna lies 0.349 m behind the IMU, 0.02 m to its right and
    0.065 m above, bore-sight apart.
    """
    rig = replace(Rig(), boresight=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))
    assert_allclose(rig.antenna_lever_b, [-0.349, 0.021, -0.065], atol=1e-15)
    assert_allclose(rig.camera_lever_b, [0.113, 0.020, 0.0], atol=1e-15)
    turned = Rig()
    assert_allclose(turned.C_cb @ turned.C_cb.T, np.eye(3), atol=1e-14)
    assert_allclose(np.array(turned.boresight)[0], [0.999909, 0.008952, 0.010018], atol=2e-6)


def test_true_orientation_is_equation_1_of_the_paper(simulated):
    """Oracle: R_enu^c = T B R_ned^b S with the attitude in l, whose axes are those of the tangent
    plane at the same origin.
    """
    eo, flight = simulated.truth.eo, simulated.flight
    T, B = np.diag([-1.0, -1.0, 1.0]), np.array(simulated.rig.boresight)
    R_ned_b = np.swapaxes(flight.motion.C_lb(flight.time), -1, -2)
    assert_allclose(np.swapaxes(eo.C_mc, -1, -2), T @ B @ R_ned_b @ S, atol=1e-13)


def test_camera_and_antenna_are_one_lever_apart(simulated):
    """Oracle: X_camera = X_antenna - R_c^m a_c (`formats.md` 0), antenna positions through pyproj;
    10 micrometres.
    """
    flight, rig, eo = simulated.flight, simulated.rig, simulated.truth.eo
    p_l, _ = antenna_states(flight.motion, rig.antenna_lever_b, flight.time)
    antenna = enu(*flight.motion.frame.geodetic_from_position(p_l))
    assert_allclose(eo.position_m, antenna - eo.C_mc @ np.array(rig.antenna_m), atol=1e-5)
    imu = enu(*flight.motion.geodetic(flight.time))
    assert_allclose(eo.position_m, imu - eo.C_mc @ np.array(rig.imu_m), atol=1e-5)


def test_cameras_look_down(simulated):
    """Oracle: the third axis of a nadir camera points down and its x axis backward along the
    track.
    """
    eo = simulated.truth.eo
    assert (eo.C_mc[:, 2, 2] < -0.97).all()
    velocity = S @ simulated.flight.motion.velocity(eo.time).T
    assert (np.einsum("ni,in->n", eo.C_mc[:, :, 0], velocity) < 0.0).all()


def test_antenna_velocity_is_the_derivative_of_its_position(flight):
    """Oracle: central difference over 2 ms."""
    t, d, lever = (
        np.linspace(flight.motion.start + 1, flight.motion.end - 1, 100),
        1e-3,
        np.array([3.0, -2.0, 1.0]),
    )
    ahead, behind = (antenna_states(flight.motion, lever, t + e)[0] for e in (d, -d))
    assert_allclose(
        antenna_states(flight.motion, lever, t)[1], (ahead - behind) / (2 * d), atol=1e-5
    )


def quiet(**processes) -> NoiseModel:
    axis = AxisNoise(**processes)
    return NoiseModel("test", "test", (axis,) * 3, (axis,) * 3)


def test_an_ideal_imu_reads_the_motion_in_its_own_axes(flight):
    """Oracle: the words: x right, y backward, z down reads (body y, minus body x, body z)."""
    body = flight.motion.imu(50.0)
    imu = simulate_imu(
        flight, ImuOptions(50.0, None, "right backward down"), np.random.default_rng(0)
    )
    assert_allclose(
        imu.samples.gyro,
        np.stack([body.gyro[:, 1], -body.gyro[:, 0], body.gyro[:, 2]], axis=-1),
        atol=0,
    )
    assert_allclose(
        imu.samples.accel,
        np.stack([body.accel[:, 1], -body.accel[:, 0], body.accel[:, 2]], axis=-1),
        atol=0,
    )
    assert imu.samples.gps_week == 2008


@pytest.mark.parametrize("quantity", ["mean_rate", "increments", "instant_rate"])
def test_white_noise_has_its_density(flight, quantity):
    """Oracle: root density q over an interval dt has the variance q^2/dt as a rate and q^2 dt as an
    increment.
    """
    q, dt = 1e-3, 0.02
    imu = simulate_imu(
        flight, ImuOptions(50.0, quiet(white_noise=q), quantity=quantity), np.random.default_rng(3)
    )
    error = imu.samples.gyro - flight.motion.imu(50.0, quantity).gyro
    assert same(
        (error**2).mean(), q * q * dt if quantity == "increments" else q * q / dt, error.size
    )
    assert not imu.gyro_bias.any()


@pytest.mark.parametrize("quantity", ["mean_rate", "increments"])
def test_vibration_multiplies_white_noise_in_motion_only(quantity):
    """Oracle: variance q^2/dt (q^2 dt of an increment) at rest and nine times that in flight, the
    slow errors the same to the bit.
    """
    q, dt = 1e-3, 0.02
    whole = block_flight(4.0, seed=2)  # stands for a minute
    options = ImuOptions(50.0, quiet(white_noise=q, turn_on_bias=0.01), quantity=quantity)
    calm, shaken = (
        simulate_imu(whole, replace(options, vibration=v), np.random.default_rng(3))
        for v in (1.0, 3.0)
    )
    ideal = whole.motion.imu(50.0, quantity)
    bias = shaken.accel_bias * (dt if quantity == "increments" else 1.0)
    error = shaken.samples.accel - ideal.accel - bias
    speed = np.linalg.norm(whole.motion.velocity(ideal.time), axis=1)
    one = q * q * dt if quantity == "increments" else q * q / dt
    assert same((error[speed < 1.0] ** 2).mean(), one, 3 * (speed < 1.0).sum())
    assert same((error[speed > 1.0] ** 2).mean(), 9.0 * one, 3 * (speed > 1.0).sum())
    assert_allclose(shaken.accel_bias, calm.accel_bias, atol=0)
    assert_allclose(shaken.samples.gyro[speed < 1.0], calm.samples.gyro[speed < 1.0], atol=0)


def test_slow_errors_are_the_bias_and_belong_to_the_body(flight):
    """Oracle: constants; reading minus motion, turned into the body, is the bias that the truth
    states, one unit in all quantities.
    """
    model = quiet(turn_on_bias=0.1, gauss_markov=(GaussMarkov.from_sigma(100.0, 0.01),))
    for quantity, unit in (("mean_rate", 1.0), ("increments", 0.02)):
        imu = simulate_imu(
            flight, ImuOptions(50.0, model, "up right forward", quantity), np.random.default_rng(4)
        )
        body = flight.motion.imu(50.0, quantity)
        error = imu.samples.accel @ np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]]) - body.accel
        assert_allclose(error, unit * imu.accel_bias, atol=1e-12)
        assert 0.002 < imu.gyro_bias.std(axis=0).min() < imu.gyro_bias.std(axis=0).max() < 0.03
        assert 0.01 < np.abs(imu.gyro_bias.mean(axis=0)).max() < 0.4


def test_scale_factor_and_misalignment_are_linear_in_the_motion(flight):
    """Oracle: least squares of reading on motion finds a constant matrix of the size that the model
    says, and nothing is left.
    """
    imu = simulate_imu(
        flight,
        ImuOptions(50.0, quiet(scale_factor=0.01, misalignment=0.003)),
        np.random.default_rng(5),
    )
    body = flight.motion.imu(50.0)
    for reading, truth in ((imu.samples.gyro, body.gyro), (imu.samples.accel, body.accel)):
        M = np.linalg.lstsq(truth, reading, rcond=None)[0].T - np.eye(3)
        assert_allclose(reading, truth @ (np.eye(3) + M).T, atol=1e-12)
        assert 1e-3 < np.abs(np.diag(M)).max() < 0.04
        assert 3e-4 < np.abs(M - np.diag(np.diag(M))).max() < 0.012


@pytest.mark.parametrize(
    "words",
    [
        "forward left down",
        "forward right",
        "forward forward down",
        "north right down",
        "forward backward down",
    ],
)
def test_axes_that_are_none_are_refused(words):
    """Oracle: the contract; left-handed, incomplete, doubled, unknown and opposite directions."""
    with pytest.raises(UsageError, match="right-handed"):
        axes_matrix(words)


def test_simulation_is_a_function_of_its_seed(simulated):
    """Oracle: repetition, and independence: another receiver changes no IMU sample."""
    again = simulate_flight("ign8", 2.0, seed=1, imu=ImuOptions(rate_hz=100.0), start_in_air=True)
    assert np.array_equal(again.imu.gyro, simulated.imu.gyro)
    assert np.array_equal(again.gnss.lat, simulated.gnss.lat)
    assert again.events.images == simulated.events.images
    other = simulate_flight(
        "ign8",
        2.0,
        seed=1,
        imu=ImuOptions(rate_hz=100.0),
        gnss=GnssOptions(rate_hz=5.0),
        start_in_air=True,
    )
    assert np.array_equal(other.imu.gyro, simulated.imu.gyro)
    assert other.gnss.time.size == 601
    changed = simulate_flight("ign8", 2.0, seed=2, imu=ImuOptions(rate_hz=100.0), start_in_air=True)
    assert not np.array_equal(changed.imu.gyro, simulated.imu.gyro)


def test_missing_events_stay_in_the_truth():
    """Oracle: counting; events are a part of the exposures with unchanged names and times, and
    times fall off the IMU's stamps.
    """
    s = simulate_flight(
        "ign6x1", 5.0, seed=3, imu=ImuOptions(rate_hz=50.0), missing_events=0.2, start_in_air=True
    )
    exposed = dict(zip(s.truth.eo.images, s.truth.eo.time, strict=True))
    assert 0.6 * len(exposed) < len(s.events.images) < 0.95 * len(exposed)
    assert all(exposed[name] == t for name, t in zip(s.events.images, s.events.time, strict=True))
    assert np.abs(s.events.time * 500 % 1.0 - 0.5).std() > 0.1
    assert_allclose(true_eo(s.flight, s.rig, s.tangent_plane).position_m, s.truth.eo.position_m)


def test_true_trajectory_carries_state_and_biases(simulated):
    """Oracle: pyproj for position, finite differences of it for velocity, the difference of
    readings for the bias (noise averaged).
    """
    truth, path = simulated.truth, simulated.truth.trajectory
    p = enu(path.lat, path.lon, path.height)
    velocity = (p[2:] - p[:-2]) / (path.time[2:] - path.time[:-2])[:, None]
    assert_allclose(path.velocity_ned[1:-1] @ S, velocity, atol=0.05)
    ideal = simulated.flight.motion.imu(100.0)
    error = (simulated.imu.accel - ideal.accel).reshape(-1, 10, 3).mean(axis=1)
    white = 51.514e-6 * 9.80665 / np.sqrt(0.1)
    assert np.abs(error - truth.accel_bias[1:]).max() < 5.5 * white
    assert np.abs(truth.gyro_bias).max() > 1e-5
    assert truth.outlier.shape == simulated.gnss.time.shape


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"flight": "ign9"}, "ign9"),
        ({"missing_events": 1.0}, "between 0 and 1"),
        ({"truth_hz": 0.0}, "must be positive"),
        ({"seed": -1}, "negative"),
    ],
)
def test_wrong_use_is_refused(arguments, words):
    """Oracle: the contract; UsageError that names the value."""
    with pytest.raises(UsageError, match=words):
        simulate_flight(
            **{
                "flight": "ign8",
                "minutes": 0.2,
                "imu": ImuOptions(rate_hz=10.0),
                "start_in_air": True,
                **arguments,
            }
        )


def test_vibration_that_takes_noise_away_or_has_none_is_refused():
    """Oracle: the contract; the error names the value."""
    with pytest.raises(UsageError, match=r"0\.5"):
        ImuOptions(vibration=0.5)
    with pytest.raises(UsageError, match="vibration 3 of an ideal sensor"):
        ImuOptions(noise=None, vibration=3.0)


def test_a_short_flight_simulates_at_once():
    """Oracle: the clock, generously; Monte Carlo runs need a simulation of two minutes in about 0.1
    s.
    """
    start = clock.process_time()
    simulate_flight("ign8", 2.0, seed=8, imu=ImuOptions(rate_hz=200.0), start_in_air=True)
    assert clock.process_time() - start < 1.0
