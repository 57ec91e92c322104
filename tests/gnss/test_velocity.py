from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from broadcast import TOW, WEEK, constellation
from flown import error_of
from flown import fly as short_flight

from insgnss import load_flight
from insgnss.base.errors import DataError
from insgnss.flight.processing.pipeline import process
from insgnss.geodesy.frames import ecef_to_geodetic, geodetic_to_ecef, rotation_en
from insgnss.gnss.phase import _velocity_kernels
from insgnss.gnss.phase.time_differences import VelocityOptions
from insgnss.gnss.phase.troposphere import standard_slant_delay
from insgnss.gnss.phase.velocity import (
    UNKNOWN_JERK,
    UNSEEN_JERK,
    AntennaVelocity,
    at_stamps,
    jerk_weights,
    time_differenced_velocity,
)
from insgnss.gnss.rinex.header import RinexHeader
from insgnss.gnss.rinex.navigation_message import read_navigation
from insgnss.gnss.rinex.observation_record import Observations
from insgnss.gnss.rinex.observations import read_observations
from insgnss.gnss.satellites.frequencies import HERTZ
from insgnss.gnss.satellites.orbits import GPS_EARTH_RATE, LIGHT, ranges, satellite_states, sky
from insgnss.io.formats.gnss.rtklib_pos_write import write_rtklib_pos
from insgnss.navigation.align.initial import initial_state
from insgnss.records import GnssFixes
from insgnss.simulation.dataset import write_simulated
from insgnss.simulation.description import Units, flight_toml, true_tables
from insgnss.simulation.flights import fly
from insgnss.simulation.layout import BLOCK
from insgnss.simulation.raw_gnss.receiver import FixEpisode, GnssOptions
from insgnss.simulation.scenario import observe as record
from insgnss.simulation.sensors import ImuOptions, Rig, antenna_states

DATA = Path(__file__).parents[3] / "shared" / "data"
LAT, LON, HEIGHT = 0.82, 0.11, 450.0
SIGNALS = ("C1C", "L1C", "L2W", "L5Q")
BANDS = {"G": {"L1C": "1", "L2W": "2"}, "E": {"L1C": "1", "L5Q": "5"}}


@pytest.fixture(scope="module")
def navigation(tmp_path_factory):
    path = tmp_path_factory.mktemp("sky") / "brdc.nav"
    path.write_text(constellation())
    return read_navigation(path)


def turning(time, speed=12.0, radius=15.0):
    """Antenna (n, 3), ECEF, on circles, with a slow climb."""
    angle = speed / radius * (time - time[0])
    ned = np.column_stack(
        [radius * np.sin(angle), radius * (1.0 - np.cos(angle)), -0.5 * (time - time[0])]
    )
    return geodetic_to_ecef(LAT, LON, HEIGHT) + ned @ rotation_en(LAT, LON).T


def observe(navigation, time, path, clock=0.0, rng=None, noise=0.0, ionosphere=0.0):
    """Observations of the made-up sky: light time iterated in axes that do not turn, phases with an
    arbitrary start.

    clock : (n,) s of the receiver.
    noise : m, times sqrt(1 + 1 / sin^2 E).
    ionosphere : m/s, growth of its delay on L1 in zenith.
    """
    codes = np.unique(navigation.satellite)
    epoch, which = (
        np.repeat(np.arange(time.size), codes.size),
        np.tile(np.arange(codes.size), time.size),
    )
    at, receiver = time[epoch], path[epoch]
    flight = np.full(epoch.size, 0.08)
    message = np.array([int(np.flatnonzero(navigation.satellite == code)[0]) for code in codes])[
        which
    ]
    for _ in range(6):
        states = satellite_states(navigation, codes[which], at - flight, message)
        turn = GPS_EARTH_RATE * flight
        x, y, z = states.position.T
        there = np.column_stack(
            [np.cos(turn) * x + np.sin(turn) * y, np.cos(turn) * y - np.sin(turn) * x, z]
        )
        flight = np.linalg.norm(there - receiver, axis=1) / LIGHT
    _, elevation = sky(ranges(states.position, receiver)[1], receiver)
    high = elevation > np.radians(8.0)
    clock = np.broadcast_to(clock, time.shape)
    lat, _, height = ecef_to_geodetic(receiver)
    delay = standard_slant_delay(lat, height, np.maximum(elevation, 0.1))
    length = LIGHT * (flight + clock[epoch] - states.clock_s) + delay
    values = np.full((epoch.size, len(SIGNALS)), np.nan)
    values[:, 0] = length
    for system, bands in BANDS.items():
        rows = np.array([code[0] == system for code in codes])[which]
        for signal, band in bands.items():
            kappa = (HERTZ["G"]["1"] / HERTZ[system][band]) ** 2
            phase = length - kappa * ionosphere * (at - time[0]) / np.sin(
                np.maximum(elevation, 0.1)
            )
            if rng is not None:
                phase = phase + noise * np.sqrt(
                    1.0 + 1.0 / np.sin(elevation) ** 2
                ) * rng.standard_normal(phase.size)
            values[rows, SIGNALS.index(signal)] = (
                phase * HERTZ[system][band] / LIGHT + 1000.0 * which
            )[rows]
    header = RinexHeader(
        "made-up.obs", 3.04, "M", "GPS", "", "", "", None, np.zeros(3), None, None, {}
    )
    stamp = time + clock
    n, shape = time.size, values[high].shape
    zeros = np.zeros(shape, dtype=np.int8)
    flags = np.zeros(n, dtype=np.int8)
    nothing = np.full(n, np.nan)
    return Observations(
        header,
        WEEK,
        stamp,
        flags,
        nothing,
        epoch[high],
        codes[which[high]],
        SIGNALS,
        values[high],
        zeros,
        zeros.copy(),
        np.empty(0),
    )


def fixes_of(time, path, sd=0.02, week=WEEK):
    lat, lon, height = ecef_to_geodetic(path)
    return GnssFixes(
        time, lat, lon, height, np.tile(sd**2 * np.eye(3), (time.size, 1, 1)), gps_week=week
    )


def mean_velocity(path, time, ends):
    """Mean velocity (n, 3), north, east, down, over the intervals that end at the epochs `ends`."""
    lat, lon, _ = ecef_to_geodetic(path[ends])
    moved = (path[ends] - path[ends - 1]) / (time[ends] - time[ends - 1])[:, None]
    return np.einsum("nij,ni->nj", rotation_en(lat, lon), moved)


def nees(error, cov):
    return np.einsum("ni,nij,nj->n", error, np.linalg.inv(cov), error)


def test_mean_velocity_of_turns_is_exact(navigation):
    """Oracle: the flown path, without noise; positions 3 m off, a drifting clock, an ionosphere
    that grows by 3 mm/s.
    """
    time = TOW + 1000.0 + 0.1 * np.arange(300)
    path = turning(time)
    clock = 4e-4 + 3e-7 * (time - time[0])
    observations = observe(navigation, time, path, clock, ionosphere=3e-3)
    found = time_differenced_velocity(
        observations, navigation, fixes_of(time, path + [1.0, -2.0, 2.0], 2.0)
    )
    assert found.time.size == 299
    error = found.velocity_ned - mean_velocity(path, time, found.epoch)
    assert np.abs(error).max() < 1.5e-3  # 3 m times 1.6e-4 rad/s, and the bent ionosphere
    assert np.sqrt(np.mean(error**2)) < 6e-4
    np.testing.assert_allclose(found.time, 0.5 * (time[1:] + time[:-1]), rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(found.clock_rate, 3e-7, rtol=0.0, atol=1e-11)
    assert found.rejected == 0.0


def test_errors_of_the_positions_are_in_the_covariance(navigation):
    """Oracle: satellites turn by 1.6e-4 rad/s, and positions known to 8 m on each axis may be off
    by root 3 of that, 2.2 mm/s.
    """
    time = TOW + 1000.0 + 0.2 * np.arange(20)
    path = turning(time)
    observations = observe(navigation, time, path)
    near, far = (
        time_differenced_velocity(observations, navigation, fixes_of(time, path, sd)).cov_ned
        for sd in (0.02, 8.0)
    )
    np.testing.assert_allclose(
        far - near,
        np.tile(3.0 * (1.6e-4 * 8.0) ** 2 * np.eye(3), (len(far), 1, 1)),
        rtol=0.01,
        atol=1e-9,
    )


def test_covariance_tells_the_error(navigation):
    """Oracle: chi-square of 3 x n, two-sided 99.9 %, over 25 short flights; neighbours correlate by
    -1/2.
    """
    rng = np.random.default_rng(5)
    time = TOW + 1000.0 + 0.2 * np.arange(60)
    path = turning(time)
    values, normalised, products = [], [], []
    for _ in range(25):
        found = time_differenced_velocity(
            observe(navigation, time, path, rng=rng, noise=0.003), navigation, fixes_of(time, path)
        )
        error = found.velocity_ned - mean_velocity(path, time, found.epoch)
        assert found.noise_m["G1"] == pytest.approx(0.003 * np.sqrt(2.0), rel=0.15)
        values.append(nees(error, found.cov_ned))
        normalised.append(error[:, 2] / np.sqrt(found.cov_ned[:, 2, 2]))
        products.append(np.mean(normalised[-1][1:] * normalised[-1][:-1]))
    assert np.mean(values) / 3.0 == pytest.approx(1.0, abs=0.08)
    assert np.mean(products) == pytest.approx(-0.5, abs=0.05)


def test_covariance_and_residuals_are_those_of_dense_matrices():
    """Oracle: numpy; bands of a satellite share an error, so that Sigma has blocks: N A'W Sigma W A
    N; and Baarda's normalised residual.

    Six satellites of two bands, the redundancy of a row by the projector I - A N A'W.
    """
    rng = np.random.default_rng(4)
    direction = np.repeat(rng.standard_normal((6, 3)), 2, axis=0)
    A = np.column_stack([direction / np.linalg.norm(direction, axis=1)[:, None], np.ones(12)])
    satellite, sigma, common = (
        np.repeat(np.arange(6), 2),
        np.tile([0.005, 0.007], 6),
        np.full(12, 0.004),
    )
    y = A @ [0.3, -0.2, 0.1, 5.0] + 0.002 * rng.standard_normal(12)
    solution, cov, weight = np.zeros((1, 4)), np.zeros((1, 4, 4)), np.zeros(12)
    normalised, sums = np.zeros(12), np.zeros((1, 3))
    bounds = np.array([0, 12])
    _velocity_kernels.solve(
        bounds, A, y, sigma, common, satellite, np.inf, 5, solution, cov, weight, normalised, sums
    )
    W = np.diag(sigma**-2.0)
    N = np.linalg.inv(A.T @ W @ A)
    Sigma = np.diag(sigma**2 - common**2) + np.outer(common, common) * (
        satellite[:, None] == satellite
    )
    np.testing.assert_allclose(solution[0], N @ A.T @ W @ y, rtol=1e-9)
    np.testing.assert_allclose(cov[0], N @ A.T @ W @ Sigma @ W @ A @ N, rtol=1e-8, atol=1e-14)
    projector = np.eye(12) - A @ N @ A.T @ W
    np.testing.assert_allclose(
        np.abs(normalised), np.abs(projector @ y) / (sigma * np.sqrt(np.diag(projector))), rtol=1e-6
    )
    np.testing.assert_allclose(sums[0], [6.0, y @ projector.T @ W @ projector @ y, 8.0], rtol=1e-6)


def test_slips_are_left_out(navigation):
    """Oracle: the same flight without them. Three satellites slip at once without a flag, one with
    a flag and by thousands of cycles.
    """
    rng = np.random.default_rng(8)
    time = TOW + 1000.0 + 0.1 * np.arange(100)
    path = turning(time)
    clean = observe(navigation, time, path, rng=rng, noise=0.002)
    values, flags = clean.values.copy(), clean.loss_of_lock.copy()
    codes = np.unique(clean.satellite[clean.epoch == 50])
    for code, cycles in zip(codes[:3], (1.0, -1.0, 7.0), strict=True):
        values[(clean.satellite == code) & (clean.epoch >= 50), 1] += cycles
    flagged = clean.satellite == codes[3]
    values[flagged & (clean.epoch >= 50), 1:] += 4321.0
    flags[flagged & (clean.epoch == 50), 1:] = 1
    positions = fixes_of(time, path)
    with_slips = time_differenced_velocity(
        replace(clean, values=values, loss_of_lock=flags), navigation, positions
    )
    without = time_differenced_velocity(clean, navigation, positions)
    assert with_slips.time.size == 99
    assert np.abs(with_slips.velocity_ned - without.velocity_ned).max() < 0.03
    k = int(np.flatnonzero(with_slips.epoch == 50)[0])
    error = with_slips.velocity_ned[k] - mean_velocity(path, time, np.array([50]))[0]
    assert nees(error[None], with_slips.cov_ned[k : k + 1])[0] < 16.0
    assert with_slips.used[k] < without.used[k]
    assert 0.0 < with_slips.rejected - without.rejected < 0.01


def test_flags_gate_single_pairs_of_phases(navigation):
    """Oracle: the flags; a half-cycle ambiguity that comes or goes takes a satellite out of two
    intervals, loss of lock out of one.
    """
    time = TOW + 1000.0 + 0.1 * np.arange(40)
    path = turning(time)
    clean = observe(navigation, time, path)
    codes = np.unique(clean.satellite)
    flags = clean.loss_of_lock.copy()
    flags[(clean.satellite == codes[0]) & (clean.epoch >= 10) & (clean.epoch < 20), 1:] = 2
    flags[(clean.satellite == codes[1]) & (clean.epoch == 30), 1:] = 1
    positions = fixes_of(time, path)
    without = time_differenced_velocity(clean, navigation, positions)
    fewer = (
        without.used
        - time_differenced_velocity(replace(clean, loss_of_lock=flags), navigation, positions).used
    )
    assert without.epoch[fewer > 0].tolist() == [10, 20, 30]


def test_steps_of_the_clock_leave_no_trace(navigation):
    """Oracle: the same flight with a steady clock; stamps and code ranges step by a millisecond,
    phases do not.
    """
    time = TOW + 1000.0 + 0.1 * np.arange(60)
    path = turning(time)
    steady = observe(navigation, time, path)
    step = np.where(np.arange(60) >= 30, 1e-3, 0.0)
    values = steady.values.copy()
    values[:, 0] += LIGHT * step[steady.epoch]
    stepped = replace(steady, time=steady.time + step, values=values)
    positions = fixes_of(time, path)
    one, other = (time_differenced_velocity(o, navigation, positions) for o in (steady, stepped))
    np.testing.assert_allclose(other.velocity_ned, one.velocity_ned, rtol=0.0, atol=2e-5)
    np.testing.assert_allclose(other.time, one.time, rtol=0.0, atol=1e-7)


def test_gaps_and_power_failures_are_not_bridged(navigation):
    """Oracle: the epochs that are taken away."""
    time = TOW + 1000.0 + 0.5 * np.arange(40)
    path = turning(time)
    observations = observe(navigation, time, path)
    flag = observations.flag.copy()
    flag[30] = 1
    keep = np.abs(np.arange(40) - 20) > 3  # epochs 17 to 23 are missing
    epoch = np.cumsum(keep) - 1
    rows = keep[observations.epoch]
    less = replace(
        observations,
        time=observations.time[keep],
        flag=flag[keep],
        clock_offset_s=observations.clock_offset_s[keep],
        epoch=epoch[observations.epoch[rows]],
        satellite=observations.satellite[rows],
        values=observations.values[rows],
        loss_of_lock=observations.loss_of_lock[rows],
    )
    found = time_differenced_velocity(less, navigation, fixes_of(time, path))
    missing = set(range(1, 33)) - set(found.epoch.tolist())
    assert missing == {17, 23}  # the first behind the gap, and the one of flag 1
    stamped = at_stamps(found, time)
    none = np.flatnonzero(np.isnan(stamped.velocity_ned[:, 0]))
    assert none.tolist() == [0, 16, *range(17, 25), 29, 30, 39]


@pytest.mark.parametrize(("interval", "half"), [(0.1, 6), (0.2, 3), (1.0, 2)])
def test_jerk_is_that_of_a_cubic(interval, half):
    """Oracle: the third derivative of polynomials of degree 3, from the mean velocities of their
    intervals.
    """
    rng = np.random.default_rng(2)
    edges = interval * np.arange(-half, half + 1)
    for _ in range(5):
        cubic = np.polynomial.Polynomial(rng.standard_normal(4))
        mean = np.diff(cubic(edges)) / interval
        assert jerk_weights(half) @ mean / interval**2 == pytest.approx(
            cubic.deriv(3)(0.0), abs=1e-9
        )


def intervals(edges, position, sd, epoch=None):
    """`AntennaVelocity` of the positions (n, 3), north, east, down, m, at `edges` (n,), with phases
    of standard deviation `sd`, m.
    """
    T = np.diff(edges)
    n = T.size
    cov = 2.0 * sd**2 / T[:, None, None] ** 2 * np.eye(3)
    velocity = np.diff(position, axis=0) / T[:, None]
    number = np.arange(1, n + 1) if epoch is None else epoch
    return AntennaVelocity(
        edges[1:] - 0.5 * T,
        T,
        velocity,
        cov,
        np.full(n, 9),
        number,
        np.zeros(n),
        {},
        WEEK,
        intervals=n,
        rejected=0.0,
    )


@pytest.mark.parametrize("interval", [0.1, 0.5])
def test_velocity_at_the_epochs_has_the_noise_of_its_phases(interval):
    """Oracle: 4000 epochs of white phases on a straight line and on a cubic; the covariance is
    theirs, the cubic leaves no trace.
    """
    rng = np.random.default_rng(11)
    edges = interval * np.arange(4001)
    noise = 0.003 * rng.standard_normal((edges.size, 3))
    straight = at_stamps(intervals(edges, noise, 0.003), edges[7:-7])
    phase_only = straight.cov_ned - (UNKNOWN_JERK * interval**2 / 6.0) ** 2 * np.eye(3)
    normalised = np.einsum(
        "ni,nij,nj->n", straight.velocity_ned, np.linalg.inv(phase_only), straight.velocity_ned
    )
    assert np.mean(normalised) / 3.0 == pytest.approx(1.0, abs=0.06)
    bent = 0.5 * ((edges - edges[2000]) ** 3)[:, None] * [1.0, -0.4, 0.1]
    cubic = at_stamps(intervals(edges, noise + bent, 0.003), edges[7:-7])
    true = 1.5 * ((edges[7:-7] - edges[2000]) ** 2)[:, None] * [1.0, -0.4, 0.1]
    np.testing.assert_allclose(
        cubic.velocity_ned - true, straight.velocity_ned, rtol=0.0, atol=1e-6 * interval
    )


def test_a_missing_epoch_makes_no_false_velocity():
    """Oracle: an accelerated path of second degree, whose velocity is exact over uneven intervals
    too; beside them no jerk is found.
    """
    edges = np.delete(0.1 * np.arange(40), [15, 16, 30])
    path = np.column_stack([3.0 * edges**2, 10.0 * edges, np.zeros(edges.size)])
    found = at_stamps(intervals(edges, path, 0.002), edges)
    np.testing.assert_allclose(found.velocity_ned[1:-1, 0], 6.0 * edges[1:-1], rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(found.velocity_ned[1:-1, 1], 10.0, rtol=0.0, atol=1e-9)
    beside = np.flatnonzero(np.isclose(edges, 1.4))[0]
    unseen = found.cov_ned[beside, 0, 0] - found.cov_ned[6, 0, 0]
    assert unseen > 0.8 * (UNSEEN_JERK * 0.1 * 0.3 / 6.0) ** 2
    missing = np.arange(1, edges.size)
    missing[20:] += 1  # an interval that could not be solved
    apart = at_stamps(intervals(edges, path, 0.002, missing), edges)
    assert np.isnan(apart.velocity_ned[[0, 20, -1]]).all()


@pytest.fixture(scope="module")
def survey():
    """Exact motion of lines and turns of 15 m radius at 10 m/s (bank 34 deg), and the antenna on
    it.
    """
    plan = BLOCK.changed(
        minutes=3.0,
        start_in_air=True,
        line_length_m=120.0,
        airspeed_ms=10.0,
        wind_ms=0.0,
        max_bank_deg=34.2,
    )
    assert plan.turn_radius_m == pytest.approx(15.0, abs=0.01)
    return fly(plan, 7, start_tow=TOW + 1000.0).motion


def flown(motion, hz):
    """`at` the epochs of a receiver of this rate."""
    return at(motion, motion.start + np.arange(int((motion.end - motion.start) * hz)) / hz)


def at(motion, time):
    """Times (n,), the antenna's place (n, 3) ECEF and velocity (n, 3) north, east, down, and where
    it turns (n,), all exact.
    """
    time = np.clip(time, motion.start, motion.end)
    place, velocity = antenna_states(motion, Rig().antenna_lever_b, time)
    path = motion.frame.origin_ecef + place @ motion.frame.C_el.T
    lat, lon, _ = ecef_to_geodetic(path)
    true = np.einsum("nij,ni->nj", rotation_en(lat, lon), velocity @ motion.frame.C_el.T)
    return time, path, true, np.abs(motion.angles(time, 1)[:, 2]) > 0.3


@pytest.mark.parametrize(("hz", "largest_along"), [(10.0, 2e-3), (5.0, 3e-3), (1.0, 0.1)])
def test_velocity_holds_in_turns_as_in_straight_flight(navigation, survey, hz, largest_along):
    """Oracle: exact motion with gusts. In turns no lag along the path (18 mm/s at 5 Hz and 0.44 m/s
    at 1 Hz without the jerk).
    """
    time, path, true, turns = flown(survey, hz)
    observations = observe(navigation, time, path, rng=np.random.default_rng(3), noise=0.0015)
    stamped = at_stamps(
        time_differenced_velocity(observations, navigation, fixes_of(time, path)), time
    )
    error, known = stamped.velocity_ned - true, np.isfinite(stamped.velocity_ned[:, 0])
    assert known.sum() == time.size - 2
    normalised = nees(error[known], stamped.cov_ned[known]) / 3.0
    size = [np.sqrt(np.mean(error[known & which] ** 2, axis=0)) for which in (turns, ~turns)]
    for which in (turns, ~turns):
        assert (0.5 if hz > 1.0 else 0.02) < np.mean(normalised[which[known]]) < 1.2
    along = np.einsum("ni,ni->n", error, true) / np.linalg.norm(true, axis=1)
    assert abs(np.mean(along[known & turns])) < largest_along
    if hz > 1.0:
        assert (size[0] < 1.3 * size[1]).all()
        assert (size[1] < [0.015, 0.015, 0.026]).all()


def test_loss_of_lock_in_turns_does_no_harm(navigation, survey):
    """Oracle: exact motion; in turns each satellite slips once in 10 s, 7 of 10 with a flag, which
    saves a search.
    """
    time, path, true, turns = flown(survey, 10.0)
    rng = np.random.default_rng(4)
    clean = observe(navigation, time, path, rng=rng, noise=0.0015)
    values, flags = clean.values.copy(), clean.loss_of_lock.copy()
    slips = np.flatnonzero(turns[clean.epoch] & (rng.random(clean.epoch.size) < 0.01))
    flagged = rng.random(slips.size) < 0.7
    assert slips.size > 40
    for row, told in zip(slips, flagged, strict=True):
        behind = (clean.satellite == clean.satellite[row]) & (clean.epoch >= clean.epoch[row])
        values[behind, 1:] += rng.integers(1, 40, values.shape[1] - 1) * (
            1.0 if told else rng.choice([-1.0, 1.0])
        )
        flags[row, 1:] = int(told)
    positions = fixes_of(time, path)
    found = time_differenced_velocity(
        replace(clean, values=values, loss_of_lock=flags), navigation, positions
    )
    assert found.time.size > 0.995 * (
        time.size - 1
    )  # an interval in which too few satellites hold is given up
    stamped = at_stamps(found, time)
    error, known = stamped.velocity_ned - true, np.isfinite(stamped.velocity_ned[:, 0])
    normalised = nees(error[known], stamped.cov_ned[known])
    assert np.mean(normalised[turns[known]]) / 3.0 == pytest.approx(1.0, abs=0.25)
    assert np.mean(normalised > 16.3) < 5e-3  # 0.1 % of chi-square with 3
    assert np.abs(error[known]).max() < 0.15
    blind = time_differenced_velocity(replace(clean, values=values), navigation, positions)
    assert blind.rejected > found.rejected + 0.5 * flagged.sum() / clean.epoch.size


FLOAT_ERROR = {"sigma_m": (0.4, 0.4, 0.8), "correlation_time_s": 30.0}


@pytest.mark.slow
def test_velocity_of_float_positions_carries_a_flight_over_them(navigation, tmp_path):
    """Oracle: exact motion, through `process`. A minute of float positions in turns, off by
    decimetres: velocities from phase, found with these very positions, bring the trajectory from
    decimetres to millimetres, and its sigmas cover the errors."""
    plan = BLOCK.changed(
        minutes=3.0,
        start_in_air=True,
        line_length_m=120.0,
        airspeed_ms=10.0,
        wind_ms=0.0,
        max_bank_deg=34.2,
    )
    lost = FixEpisode(60.0, 60.0, **FLOAT_ERROR)
    gnss = GnssOptions(sigma_m=(0.005, 0.005, 0.01), episodes=(lost,))
    simulated = record(fly(plan, 3, start_tow=TOW + 1000.0), 3, imu=ImuOptions(100.0), gnss=gnss)
    motion, fixes = simulated.flight.motion, simulated.gnss
    _, path, true, _ = at(motion, fixes.time)
    observations = observe(navigation, fixes.time, path, rng=np.random.default_rng(5), noise=0.0015)
    stamped = at_stamps(
        time_differenced_velocity(observations, navigation, replace(fixes, gps_week=WEEK)),
        fixes.time,
    )
    unseen = np.isnan(stamped.velocity_ned[:, 0])
    known = ~unseen & (fixes.quality == 2)
    assert np.mean(
        nees((stamped.velocity_ned - true)[known], stamped.cov_ned[known])
    ) / 3.0 == pytest.approx(1.0, abs=0.2)
    velocity = np.where(unseen[:, None], 0.0, stamped.velocity_ned)
    cov = np.where(unseen[:, None, None], 1e4 * np.eye(3), stamped.cov_ned)
    root = write_simulated(tmp_path / "flight", simulated).directory
    off = {}
    for name, given in {
        "without": fixes,
        "with": replace(fixes, velocity_ned=velocity, velocity_cov_ned=cov),
    }.items():
        write_rtklib_pos(given, root / f"{name}.pos")
        tables = true_tables(simulated, Units.of("mean_rate", None, None), "navchip")
        (root / f"{name}.toml").write_text(
            flight_toml(tables, {"gnss": {"file": f"{name}.pos"}, "output": {"formats": []}})
        )
        found = process(load_flight(root / f"{name}.toml"), tmp_path / name).trajectory
        error = motion.frame.position_from_geodetic(
            found.lat, found.lon, found.height
        ) - motion.position(found.time)
        inside = (found.time > motion.start + 60.0) & (found.time < motion.start + 120.0)
        assert np.mean(nees(error[inside], found.cov[inside][:, :3, :3])) / 3.0 < 2.0
        off[name] = np.sqrt(np.mean(error[inside] ** 2, axis=0))
    assert off["without"][:2].max() > 0.1
    assert (off["with"] < [0.01, 0.01, 0.02]).all()


@pytest.mark.parametrize("seed", [7, 8])
def test_velocity_aligns_a_flight_of_float_positions(seed):
    """Oracle: exact motion; a minute of float positions alone gives the heading to 0.25 deg, with
    velocities to 0.06 deg.
    """
    sigma = {}
    for velocity in (None, (0.014, 0.012, 0.023)):
        gnss = GnssOptions(
            velocity_sigma_ms=velocity, episodes=(FixEpisode(0.0, 100.0, **FLOAT_ERROR),)
        )
        flight = short_flight(60.0, seed=seed, imu_hz=100.0, gnss=gnss)
        found = initial_state(flight.problem)
        error = error_of(found.start.nav[None], flight.true_nav([0]))[0]
        assert abs(error[8]) < 4.0 * found.heading_sigma
        sigma[velocity is not None] = found.heading_sigma
    assert sigma[False] > 3.0 * sigma[True]
    assert np.degrees(sigma[True]) < 0.08
    assert np.abs(error[3:6]).max() < 0.01


def test_what_gives_no_velocity_is_refused(navigation):
    """Oracle: inputs without a common time, and more satellites asked for than there are."""
    time = TOW + 1000.0 + 0.1 * np.arange(20)
    path = turning(time)
    observations = observe(navigation, time, path)
    with pytest.raises(
        DataError,
        match=r"made-up\.obs: no satellite .* positions and navigation are of this flight",
    ):
        time_differenced_velocity(observations, navigation, fixes_of(time + 500.0, path))
    with pytest.raises(DataError, match="no satellite has a phase"):
        time_differenced_velocity(observations, navigation, fixes_of(time, path, week=WEEK + 1))
    with pytest.raises(DataError, match="none of 19 intervals has 40 satellites"):
        time_differenced_velocity(
            observations, navigation, fixes_of(time, path), VelocityOptions(fewest=40)
        )


def recorded(rover, navigation_files):
    files = [DATA / name for name in (rover, *navigation_files)]
    if not all(file.is_file() for file in files):
        pytest.skip(f"the recording {rover} is not here")
    return read_observations(files[0]), read_navigation(files[1:])


def test_simulated_flight():
    """Oracle: truth of a flight simulated by others, real orbits, 10 Hz: unbiased to 0.5 mm/s,
    errors as the covariance says.
    """
    observations, navigation = recorded(
        "rinex_sim_6min/rover.18o", ["rinex_sim_6min/brdc.18n", "rinex_sim_6min/brdc.18g"]
    )
    truth = np.load(DATA / "rinex_sim_6min" / "truth.npz")
    found = time_differenced_velocity(
        observations, navigation, fixes_of(truth["tow"], truth["xyz"], week=observations.gps_week)
    )
    assert found.time.size == found.intervals == 3600
    error = found.velocity_ned - mean_velocity(truth["xyz"], truth["tow"], found.epoch)
    assert (np.sqrt(np.mean(error**2, axis=0)) < [0.016, 0.015, 0.030]).all()
    assert np.abs(error.mean(axis=0)).max() < 5e-4
    assert np.mean(nees(error, found.cov_ned)) / 3.0 == pytest.approx(1.0, abs=0.1)
    assert np.mean(nees(error, found.cov_ned) > 16.3) < 3e-3  # 0.1 % of chi-square with 3
    lat, lon, _ = ecef_to_geodetic(truth["xyz"])
    stamped = at_stamps(found, truth["tow"])
    off = (stamped.velocity_ned - np.einsum("nij,ni->nj", rotation_en(lat, lon), truth["vel"]))[
        1:-1
    ]
    assert np.mean(nees(off, stamped.cov_ned[1:-1])) / 3.0 == pytest.approx(1.0, abs=0.15)
    assert (np.sqrt(np.mean(off**2, axis=0)) < [0.008, 0.008, 0.016]).all()


@pytest.mark.parametrize(
    ("rover", "files", "place"),
    [
        (
            "cssrlib_rtk/SEPT078M.21O",
            ["cssrlib_rtk/SEPT078M.21P"],
            (-3962108.673, 3381309.574, 3668678.638),
        ),
        ("matrtklib/static/rover.obs", ["matrtklib/static/base.nav"], None),
    ],
)
def test_standing_receiver_does_not_move(rover, files, place):
    """Oracle: zero velocity of real antennas at 1 Hz, within 1 mm/s horizontally and 2 mm/s
    vertically (rms), as the covariance says.
    """
    observations, navigation = recorded(rover, files)
    if place is None:
        lat, lon, height = np.loadtxt(DATA / "matrtklib" / "static" / "rover_position.txt")
        place = geodetic_to_ecef(np.radians(lat), np.radians(lon), height)
    standing = fixes_of(
        observations.time, np.tile(place, (observations.time.size, 1)), week=observations.gps_week
    )
    found = time_differenced_velocity(observations, navigation, standing)
    assert found.time.size > 0.99 * found.intervals
    assert (np.sqrt(np.mean(found.velocity_ned**2, axis=0)) < [1e-3, 1e-3, 2e-3]).all()
    assert 0.6 < np.mean(nees(found.velocity_ned, found.cov_ned)) / 3.0 < 1.5


def test_jerk_of_a_real_car_at_one_hertz():
    """Oracle: the velocities of an inertial reference, from its own positions once a second: in
    turns a third less off than their mean over two seconds, and within the sigmas."""
    file = DATA / "matrtklib" / "kinematic" / "reference.csv"
    if not file.is_file():
        pytest.skip("the recording of a drive with its reference is not here")
    rows = np.loadtxt(file, delimiter=",", skiprows=1)[::5]
    time, velocity = rows[:, 0], rows[:, [12, 11, 13]] * [1.0, 1.0, -1.0]
    place = (rows[:, 5:8] - rows[0, 5:8]) @ rotation_en(*np.radians(rows[0, 2:4]))
    stamped = at_stamps(intervals(time, place, 0.001), time[2:-2])
    error = stamped.velocity_ned - velocity[2:-2]
    plain = (place[3:-1] - place[1:-3]) / (time[3:-1] - time[1:-3])[:, None] - velocity[2:-2]
    course = np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0]))
    turns = ((np.abs(np.gradient(course, time)) > 0.15) & (np.linalg.norm(velocity, axis=1) > 2.0))[
        2:-2
    ]
    assert turns.sum() > 30
    size, without = (np.sqrt(np.mean(e[turns, :2] ** 2)) for e in (error, plain))
    assert size < 0.75 * without
    assert np.mean(nees(error, stamped.cov_ned)) / 3.0 < 1.0
