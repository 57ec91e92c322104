from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from insgnss.geodesy.frames import ecef_to_geodetic, geodetic_to_ecef, rotation_en
from insgnss.gnss.corrections import without_ionosphere
from insgnss.gnss.options import EngineOptions
from insgnss.gnss.phase import ionosphere as room
from insgnss.gnss.phase.double_differences import DoubleDifferences, _two_bands, double_differences
from insgnss.gnss.phase.ionosphere import (
    GRADIENT,
    LAYER_VALUES,
    LEAST_FLIGHT_S,
    LOCAL_GRADIENT,
    VERTICAL_M,
    KnottedIonosphere,
    engine_models_it,
    expectation,
    fit,
    hats,
    ionosphere_correction,
    mean_kappa,
    moved_by,
)
from insgnss.gnss.phase.ionosphere_shell import SHELL_M, shell_design
from insgnss.gnss.phase.troposphere import Atmosphere, mapping
from insgnss.gnss.rinex.observations import read_observations
from insgnss.gnss.satellites.engine_weighting import displacement
from insgnss.gnss.satellites.satellite_geometry import Sky, common_bands, common_sky
from insgnss.records import GnssFixes
from insgnss.simulation.flights import fly
from insgnss.simulation.layout import PLANS
from insgnss.simulation.raw_gnss import atmosphere as raw_air
from insgnss.simulation.raw_gnss import scenario as raw_gnss
from insgnss.simulation.raw_gnss.errors import Tracking
from insgnss.simulation.raw_gnss.options import RawGnssOptions
from insgnss.simulation.raw_gnss.rinex_files import ObservationTable, Station, write_observations
from insgnss.simulation.raw_gnss.scenario import SIGNALS, simulate_raw_gnss
from insgnss.simulation.sensors import Rig, simulate_events

LAT, LON, HEIGHT = 0.82, 0.11, 450.0
BASE = geodetic_to_ecef(LAT, LON, HEIGHT)
RADIUS = 6.371e6
KAPPA_2 = (1575.42 / 1227.60) ** 2
MEAN_KAPPA = 0.5 * (1.0 + KAPPA_2)
MINUTES = 21.0
LEFT_OUT = (
    "hardware_bias_m",
    "glonass_code_bias_m",
    "glonass_phase_bias_m",
    "broadcast_error_m",
    "code_multipath_m",
    "iono_wave_m",
)
WITHOUT = dict.fromkeys((*LEFT_OUT, "phase_multipath_m", "code_sigma_m", "phase_sigma_m"), 0.0) | {
    "systems": "G",
    "rate_hz": 1.0,
}
WITHOUT |= {"tracking": Tracking(slips_per_hour=0.0, outages_per_hour=0.0)}
WITH = {"systems": "G", "rate_hz": 1.0, "iono_wave_m": 0.0}


def fixes_at(north, east, up, time=None, quality=None):
    """Fixes at places from the base, m, in its tangent plane."""
    place = (
        BASE
        + np.column_stack(np.broadcast_arrays(north, east, -np.asarray(up, dtype=float)))
        @ rotation_en(LAT, LON).T
    )
    lat, lon, height = ecef_to_geodetic(place)
    time = np.arange(lat.size, dtype=float) if time is None else time
    return GnssFixes(
        time, lat, lon, height, np.tile(1e-6 * np.eye(3), (lat.size, 1, 1)), quality=quality
    )


def sky_of(epochs, low_deg=15.0):
    """60 satellites evenly over the sky above `low_deg`, at each epoch."""
    k = np.arange(60) + 0.5
    elevation = np.arcsin(
        np.sin(np.radians(low_deg)) + (1.0 - np.sin(np.radians(low_deg))) * k / 60.0
    )
    azimuth = np.mod(k * np.pi * (3.0 - np.sqrt(5.0)), 2.0 * np.pi)
    epoch = np.repeat(np.arange(epochs), 60)
    return Sky(
        epoch,
        np.tile(azimuth, epochs),
        np.tile(elevation, epochs),
        np.zeros(epoch.size, dtype=np.int64),
        np.ones(epoch.size),
    )


def test_a_vertical_delay_shortens_baselines():
    """Oracle: the integral over an even sky, of equal weights, of what a place d nearer to a
    satellite raises its elevation by.

    d (1 / R + sin E / range) times dm/dE, m = 1 / cos z'; the shortening of L1 for 10^16 electrons
    per m^2 (0.162 m) is 0.06 ppm, of the order of the 0.1 ppm that Beutler et al. (1988) give as a
    rule.
    """
    angle = np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)
    fixes = fixes_at(3000.0 * np.cos(angle), 3000.0 * np.sin(angle), 0.0)
    sky = sky_of(8)
    sky = replace(sky, weight=1.0 + np.sin(sky.elevation) ** -2)
    moved = displacement(sky, -0.162 * shell_design(fixes, sky, BASE)[:, 0], 8)
    along = (moved[:, 0] * np.cos(angle) + moved[:, 1] * np.sin(angle)) / 3000.0
    sine = np.linspace(np.sin(np.radians(15.0)), 1.0, 2001)
    cos, share = np.sqrt(1.0 - sine**2), RADIUS / (RADIUS + 4e5)
    to_orbit = np.sqrt(2.66e7**2 - (RADIUS * cos) ** 2) - RADIUS * sine
    steeper = -(share**2) * sine * cos * (1.0 - (share * cos) ** 2) ** -1.5
    expected = 0.162 * np.mean(cos * steeper * (1.0 / RADIUS + sine / to_orbit)) / np.mean(cos**2)
    assert -7e-8 < expected < -5e-8
    assert along.mean() == pytest.approx(expected, rel=0.05)
    np.testing.assert_allclose(along, along.mean(), rtol=0.1)


@pytest.mark.parametrize("degrees", [90.0, 30.0, 15.0])
def test_the_design_is_that_of_a_thin_shell(degrees):
    """Oracle: closed form. Of a satellite in the east the ray of a rover 2 km north pierces as far
    north, less the share of the way.

    And one 100 m above the base is at z' of a larger sphere: sin z' = (R + h) cos E / (R + H), at
    the elevation that parallax leaves.
    """
    E, shell, orbit = np.radians(degrees), 6771e3, 26600e3
    one = np.ones(2)
    sky = Sky(np.arange(2), 0.5 * np.pi * one, E * one, np.zeros(2, dtype=np.int64), one)
    found = shell_design(fixes_at([2000.0, 0.0], [0.0, 0.0], [0.0, 100.0]), sky, BASE)
    to_shell, to_orbit = (
        np.sqrt(r**2 - (RADIUS * np.cos(E)) ** 2) - RADIUS * np.sin(E) for r in (shell, orbit)
    )
    slant = 1.0 / np.sqrt(1.0 - (RADIUS * np.cos(E) / shell) ** 2)
    assert found[0, 1] == pytest.approx(2000.0 * slant * (1.0 - to_shell / to_orbit), rel=3e-3)
    below = E + 100.0 * np.cos(E) / to_orbit
    higher = 1.0 / np.sqrt(1.0 - ((RADIUS + 100.0) * np.cos(E) / shell) ** 2) - 1.0 / np.sqrt(
        1.0 - (RADIUS * np.cos(below) / shell) ** 2
    )
    assert found[1, 0] == pytest.approx(higher, rel=1e-2, abs=1e-9)


def walk(minutes=45.0, every=10.0):
    """Time s and places north, east, up, m, of a rover that flies lines 1 to 2 km from its base."""
    time = np.arange(0.0, 60.0 * minutes, every)
    return (
        time,
        -1200.0 + 500.0 * np.sin(time / 70.0),
        900.0 + 300.0 * np.sin(time / 400.0),
        110.0 + 0.0 * time,
    )


SEEN = {  # of satellites 5 to 8, which are another system's, by the number of the epoch
    "one system": None,
    "another now and then": lambda epoch: epoch // 20 % 3 == 1,
    "another at first": lambda epoch: epoch < 20,
}


def made(truth, h=0.0, t=0.0, noise=0.0, seed=0, minutes=45.0, seen=None, every=10.0):
    """Double differences of a sky that turns, with V, G and, if any, L of `truth` (n, 3 or 5), h,
    t, `every` s.

    noise : m, of each phase at the zenith.

    seen : a value of `SEEN`; None for nine satellites of one system throughout.
    """
    time, north, east, up = walk(minutes, every)
    fixes = fixes_at(north, east, up, time)
    sky = sky_of(time.size)
    some = np.isin(np.arange(sky.epoch.size) % 60, [3, 11, 17, 24, 30, 38, 45, 51, 58])
    sky = Sky(
        *(
            getattr(sky, name)[some]
            for name in ("epoch", "azimuth", "elevation", "system", "weight")
        )
    )
    sky = replace(sky, azimuth=sky.azimuth + 1.2e-4 * time[sky.epoch])
    D = shell_design(fixes, sky, BASE)
    there = truth(time)[sky.epoch]
    delay = np.einsum("mi,mi->m", D[:, : there.shape[1]], there)
    rng, n = np.random.default_rng(seed), time.size
    x, c = 5e-3 * rng.standard_normal((n, 3)), rng.standard_normal((n, 2, 2))
    which = np.tile(np.arange(9), n)
    system = np.zeros(which.size, dtype=np.int64) if seen is None else (which > 4).astype(np.int64)
    there = (system == 0) | (np.zeros(which.size, dtype=bool) if seen is None else seen(sky.epoch))
    sine, cos = np.sin(sky.elevation), np.cos(sky.elevation)
    geometry = (
        -cos * np.cos(sky.azimuth) * x[sky.epoch, 0]
        - cos * np.sin(sky.azimuth) * x[sky.epoch, 1]
        + sine * x[sky.epoch, 2]
    )
    geometry += t * up[sky.epoch] * mapping(sky.elevation)
    sides = [
        geometry - kappa * delay + side * h * sine for kappa, side in ((1.0, 0.5), (KAPPA_2, -0.5))
    ]
    parts = (
        np.column_stack(sides)
        + c[sky.epoch, system]
        + noise * rng.standard_normal((sine.size, 2)) / sine[:, None]
    )
    rows = (
        time[sky.epoch],
        sky.epoch,
        system,
        which,
        parts,
        np.tile([1.0, KAPPA_2], (sine.size, 1)),
        D,
        sky.azimuth,
        sky.elevation,
    )
    return DoubleDifferences(*(values[there] for values in (*rows, up[sky.epoch])))


def total(value):
    """V and G + L (n, 3) of values (n, 5): the plane's gradient, and its difference."""
    return value @ TOTAL.T


def linear(V, rate, *G):
    return lambda time: np.column_stack([V + rate * time, *(np.full(time.size, g) for g in G)])


@pytest.mark.parametrize("seen", SEEN.values(), ids=SEEN)
def test_what_is_put_in_is_found(monkeypatch, seen):
    """Oracle: phases made by (I.1) to (I.3) without noise: V, G, h and t come back, positions and
    clocks of any size do not matter.

    At the one height of this rover z is the same as t, and is taken for nothing.
    """
    monkeypatch.setattr(room, "NUISANCES", np.array([room.OFFSET_M, room.AIR_SLOPE, 1e-9, 1e-3]))
    found = fit(made(linear(4.0, 1e-4, 1.2e-6, -2.1e-6), h=7e-3, t=1e-5, seen=seen))
    value = total(found.interpolate([0.0, 1350.0, 2690.0])[0])
    np.testing.assert_allclose(
        value,
        [[4.0, 1.2e-6, -2.1e-6], [4.135, 1.2e-6, -2.1e-6], [4.269, 1.2e-6, -2.1e-6]],
        rtol=5e-3,
    )
    assert found.offset_m[0] == pytest.approx(7e-3, abs=5e-5)
    assert found.air[0] == pytest.approx(1e-5, abs=1e-7)


@pytest.mark.parametrize("seen", SEEN.values(), ids=SEEN)
def test_it_is_found_within_its_standard_deviations(monkeypatch, seen):
    """Oracle: phases with white noise of 2 mm and V, G drawn from what is expected: normalised
    squares have the mean 1.

    15 draws of 3 values: chi-square of 45 lies between 0.45 and 1.8 of its mean but for 1 in 1000.
    `CORRELATED_S` would count white noise of 10 s as twenty times what it is; here it counts once.
    What is drawn has no L, z and p, of which nothing is expected here.
    """
    monkeypatch.setattr(room, "LOCAL_GRADIENT", 1e-9)
    monkeypatch.setattr(room, "NUISANCES", np.array([room.OFFSET_M, room.AIR_SLOPE, 1e-6, 1e-6]))
    monkeypatch.setattr(room, "CORRELATED_S", 10.0)
    squares = []
    for seed in range(15):
        V, *G = np.random.default_rng(100 + seed).standard_normal(3) * [
            VERTICAL_M[1],
            GRADIENT,
            GRADIENT,
        ] + [VERTICAL_M[0], 0.0, 0.0]
        found = fit(made(linear(V, 0.0, *G), noise=2e-3, seed=seed, seen=seen))
        value, cov = found.interpolate([1350.0])
        off = value[0, :3] - [V, *G]
        squares.append(off @ np.linalg.solve(cov[0, :3, :3], off) / 3.0)
    assert 0.45 < np.mean(squares) < 1.8


def test_outliers_hardly_count():
    """Oracle: the same phases without them: a satellite off by a fifth of a cycle in every tenth
    epoch moves V and G by less than half a standard deviation, where least squares without Huber's
    weights would move one of them by more than one."""
    clean = made(linear(3.0, 0.0, 1e-6, 1e-6), noise=2e-3)
    spoiled = clean.parts.copy()
    spoiled[(clean.satellite == 5) & (clean.epoch % 10 == 0), 0] += 0.04
    (plain, cov), (other, _) = (
        fit(clean).interpolate([1000.0]),
        fit(replace(clean, parts=spoiled)).interpolate([1000.0]),
    )
    assert (np.abs(other - plain)[0] < 0.5 * np.sqrt(np.diag(cov[0]))).all()


@pytest.mark.parametrize("seen", SEEN.values(), ids=SEEN)
def test_noise_is_measured(seen):
    """Oracle: the noise that is put in: root 2 of it in differences of bands, 1 / root 2 in their
    mean.

    Of the mean five satellites leave one residual in an epoch, 270 in all, of which the median of
    four draws knows it to 4 %; weights that cut make residuals of least redundancy a little small:
    a tenth in all.
    """
    sigma = np.mean(
        [
            fit(made(linear(3.0, 0.0, 0.0, 0.0), noise=2e-3, seed=seed, seen=seen)).sigma_m
            for seed in range(4)
        ],
        axis=0,
    )
    np.testing.assert_allclose(sigma, 2e-3 * np.array([2.0, 0.5]) ** 0.5, rtol=0.1)


def test_errors_that_last_widen_what_is_found(monkeypatch):
    """Oracle: white noise of the same size: what stays for 200 s counts as one error in its 20
    epochs, root of 20 / 3 wider.
    """
    monkeypatch.setattr(room, "CORRELATED_S", 30.0)
    truth = linear(3.0, 0.0, 0.0, 0.0)
    white, lasting = made(truth, noise=2e-3), made(truth)
    rng = np.random.default_rng(5)
    block = (lasting.time // 200.0).astype(int)
    slow = (
        2e-3
        * rng.standard_normal((block.max() + 1, 9, 2))[block, lasting.satellite]
        / np.sin(lasting.elevation)[:, None]
    )
    found, plain = fit(replace(lasting, parts=lasting.parts + slow)), fit(white)
    assert found.correlation[0] > 8.0
    assert found.correlation[1] > 6.0
    assert plain.correlation == (pytest.approx(3.0), pytest.approx(3.0))


def test_short_flights_measure_nothing():
    """Oracle: the limit that is documented."""
    short, longer = (
        made(linear(3.0, 0.0, 0.0, 0.0), minutes=LEAST_FLIGHT_S / 60.0 + more, every=4.0)
        for more in (-0.5, 0.5)
    )
    assert fit(short) is None
    assert fit(longer) is not None


def slow_reflections(d, seed, sigma_m=2e-4, each_s=200.0):
    """Errors (m, 2) m that each satellite keeps for a time, over the sine of the elevation."""
    block = (d.time / each_s).astype(int)
    drawn = np.random.default_rng(seed).standard_normal((block.max() + 1, 9, 2))
    return sigma_m * drawn[block, d.satellite] / np.sin(d.elevation)[:, None]


@pytest.mark.slow
def test_a_slope_over_the_kilometres_is_no_plane_of_the_sky():
    """Oracle: the slope of 1.5 mm/km between base and rover that is put in, under a sky that is
    even, with reflections of 200 s: its errors are of the size of its standard deviations.

    12 draws of 2 values: chi-square of 24 is below 1.8 of its mean but for 1 in 100. A fit that
    takes the sky's plane for the slope, and 30 s for the longest reflections, has 3.0.
    """
    squares = []
    for seed in range(12):
        slope = 1.5e-6 * np.array([np.cos(seed), np.sin(seed)])
        d = made(linear(3.0, 0.0, 0.0, 0.0, *slope), seed=seed)
        found = fit(replace(d, parts=d.parts + slow_reflections(d, 50 + seed)))
        value, cov = found.interpolate([1350.0])
        off = total(value)[0, 1:] - slope
        squares.append(off @ np.linalg.solve((TOTAL @ cov[0] @ TOTAL.T)[1:, 1:], off) / 2.0)
    assert np.mean(squares) < 1.8


@pytest.mark.parametrize(("left", "moves"), [(0.99, False), (0.5, True)])
def test_heights_move_as_far_as_the_flight_shows(left, moves):
    """Oracle: (I.7) by hand: of gradients as uncertain as before but for a hundredth the height
    keeps the delay V alone and all of its uncertainty; half of the variance is enough to move it.
    """
    before = (
        np.array([1.0, *4 * [left]])
        * np.array([1.0, GRADIENT, GRADIENT, LOCAL_GRADIENT, LOCAL_GRADIENT]) ** 2
    )
    of_one_time = KnottedIonosphere(
        np.array([0.0]),
        np.array([[3.0, 1e-6, 0.0, 1e-6, 0.0]]),
        np.diag(before),
        (0.0, 1.0),
        (0.0, 1.0),
        2,
        (1.0, 1.0),
        (1.0, 1.0),
    )
    each = np.zeros((2, 3, LAYER_VALUES))
    each[:, 0, 0], each[:, 2, 0], each[:, 2, [1, 3]] = 1e-3, 2e-4, 5e3
    moved, cov, gain = moved_by(each, of_one_time, np.zeros(2), np.ones(2, dtype=bool))
    assert gain == pytest.approx(1.0 - left)
    np.testing.assert_allclose(moved[0], [3e-3, 0.0, 6e-4 + (1e-2 if moves else 0.0)])
    slope = (left if moves else 1.0) * 25e6 * (GRADIENT**2 + LOCAL_GRADIENT**2)
    assert cov[0, 2, 2] == pytest.approx(4e-8 + slope)
    assert cov[0, 0, 2] == pytest.approx(2e-7)


def test_expectation_is_of_means_and_changes():
    """Oracle: the covariance of means and changes that is put in, by inverting the information."""
    knots = np.array([0.0, 600.0, 1200.0, 1800.0])
    expected, information = expectation(knots)
    cov = np.linalg.inv(information)
    mean = np.zeros(24)
    mean[0:20:5] = 0.25
    change = np.zeros(24)
    change[[6, 1]] = 1.0, -1.0
    assert mean @ cov @ mean == pytest.approx(VERTICAL_M[1] ** 2)
    assert change @ cov @ change == pytest.approx(room.LAYER_CHANGE[1] ** 2)
    assert mean @ expected == pytest.approx(VERTICAL_M[0])
    weights = hats(knots, np.array([-5.0, 150.0, 9000.0]))
    np.testing.assert_allclose(weights, [[1, 0, 0, 0], [0.75, 0.25, 0, 0], [0, 0, 0, 1]])


def test_covariance_between_knots():
    """Oracle: the closed form of the variance of a linear interpolation."""
    rng = np.random.default_rng(3)
    root = rng.standard_normal((10, 10))
    iono = KnottedIonosphere(
        np.array([0.0, 10.0]),
        np.arange(10.0).reshape(2, 5),
        root @ root.T,
        (0.0, 1.0),
        (0.0, 1.0),
        2,
        (1.0, 1.0),
        (1.0, 1.0),
    )
    J = np.hstack([0.7 * np.eye(5), 0.3 * np.eye(5)])
    value, cov = iono.interpolate([3.0])
    np.testing.assert_allclose(value[0], [1.5, 2.5, 3.5, 4.5, 5.5])
    np.testing.assert_allclose(cov[0], J @ root @ root.T @ J.T)


@pytest.fixture
def shells(monkeypatch):
    """The simulator's ionospheres."""
    theirs, used = raw_gnss._ionosphere, []

    def shell(*given):
        used.append(theirs(*given))
        return used[-1]

    monkeypatch.setattr(raw_gnss, "_ionosphere", shell)
    return used


def simulated(tmp_path, seed, **options):
    """Rover and base as read from RINEX, navigation, fixes at the true positions and what was
    simulated, of a flight of 21 minutes.
    """
    flight = fly(PLANS["ign8"].changed(minutes=MINUTES), seed)
    rng = np.random.default_rng(seed)
    raw = simulate_raw_gnss(
        flight, Rig(), simulate_events(flight, 0.0, rng), RawGnssOptions(**options), rng
    )
    read = []
    for name, o in (("rover", raw.rover), ("base", raw.base)):
        lost = np.zeros(o.values.shape, np.int8)
        lost[:, 2:4] = o.loss_of_lock
        path = tmp_path / f"{name}.18o"
        table = ObservationTable(
            o.gps_week, o.stamp, o.epoch, o.satellite, SIGNALS, o.values, lost, np.empty(0)
        )
        write_observations(path, Station(name, tuple(o.position[0]), interval_s=1.0), table)
        read.append(read_observations(path))
    r = raw.rover
    lat, lon, height = ecef_to_geodetic(r.position)
    quality = np.ones(lat.size, dtype=np.int64)
    fixes = GnssFixes(
        r.time,
        lat,
        lon,
        height,
        np.tile(1e-6 * np.eye(3), (lat.size, 1, 1)),
        quality=quality,
        gps_week=r.gps_week,
    )
    return *read, raw.navigation, fixes, raw


AIR = Atmosphere(957.0, 18.0, 0.6)
TOTAL = np.array([[1, 0, 0, 0, 0], [0, 1, 0, 1, 0], [0, 0, 1, 0, 1]])


def truth_of(shell):
    return np.array([shell.vertical_m + shell.rate_ms * 0.5 * 60.0 * MINUTES, *shell.gradient])


def found_in(rover, base, navigation, fixes, raw):
    sky = common_sky(rover, base, navigation, fixes)
    return ionosphere_correction(fixes, rover, base, navigation, raw.base_position_m, sky, AIR), sky


def test_v_and_g_of_a_simulated_flight_without_noise(tmp_path, shells):
    """Oracle: the ionosphere that was simulated, through RINEX, orbits and integers; phases rounded
    to 0.2 mm are what is left of noise.

    0.15 mm/km and 0.3 m are half a millimetre of height and 0.2 mm of length at 1.5 km.
    """
    rover, base, navigation, fixes, raw = simulated(tmp_path, 3, **WITHOUT)
    found, _ = found_in(rover, base, navigation, fixes, raw)
    off = total(found.ionosphere.value).mean(axis=0) - truth_of(shells[0])
    assert (np.abs(off) < [0.3, 1.5e-7, 1.5e-7]).all(), off


@pytest.mark.parametrize("seed", [4, 5, 6])
def test_v_and_g_of_simulated_flights(tmp_path, shells, seed):
    """Oracle: the ionosphere that was simulated, with noise and reflections of 20 s: V and G within
    three standard deviations.
    """
    rover, base, navigation, fixes, raw = simulated(tmp_path, seed, **WITH)
    found, _ = found_in(rover, base, navigation, fixes, raw)
    value, cov = found.ionosphere.interpolate([fixes.time.mean()])
    off, sd = total(value)[0] - truth_of(shells[0]), np.sqrt(np.diag(TOTAL @ cov[0] @ TOTAL.T))
    assert (np.abs(off) < 3.0 * sd).all()
    sigma = np.sqrt(np.diagonal(found.cov_ned, axis1=1, axis2=2))
    assert (sigma.max(axis=0) < [4e-3, 4e-3, 8e-3]).all()


def test_the_displacement_of_a_least_squares_position_goes_away(tmp_path, monkeypatch):
    """Oracle: least squares of the simulated phases themselves, L1 and L2 with equal weights, at
    the true positions and without noise.

    They are off by millimetres; half a millimetre is left, of which the air's two models differ by
    some. The shell that is simulated is put where the model has it: one 50 km lower adds half a
    millimetre, which the standard deviation is for.
    """
    monkeypatch.setattr(raw_air, "SHELL_HEIGHT_M", SHELL_M)
    rover, base, navigation, fixes, raw = simulated(tmp_path, 5, **WITHOUT)
    found, sky = found_in(rover, base, navigation, fixes, raw)
    place = np.array(raw.base_position_m)
    d = double_differences(
        fixes, rover, base, navigation, place, sky, shell_design(fixes, sky, place), AIR
    )
    moved = displacement(
        Sky(d.epoch, d.azimuth, d.elevation, d.system, np.ones(d.epoch.size)),
        d.parts.mean(axis=1),
        fixes.time.size,
    )
    there = np.isfinite(moved[:, 0])
    assert there.sum() > 1000
    before, after = (
        np.abs(moved[there].mean(axis=0)),
        np.abs((moved + found.correction_ned)[there].mean(axis=0)),
    )
    assert before.max() > 2e-3, before
    assert after.max() < 7e-4, (before, after)
    sigma = np.sqrt(np.diagonal(found.cov_ned, axis1=1, axis2=2))
    assert (sigma[there] >= 0.1 * np.abs(found.correction_ned[there])).all()


def test_without_an_ionosphere_nothing_moves(tmp_path):
    """Oracle: zero: a flight without one is moved by less than three standard deviations of the
    correction.
    """
    none = {"iono_vertical_m": 0.0, "iono_gradient": 0.0, "iono_rate_ms": 0.0}
    rover, base, navigation, fixes, raw = simulated(tmp_path, 7, **WITH, **none)
    found, _ = found_in(rover, base, navigation, fixes, raw)
    sigma = np.sqrt(np.diagonal(found.cov_ned, axis1=1, axis2=2))
    assert (np.abs(found.correction_ned) < 3.0 * sigma).all()


def test_what_is_not_fixed_or_far_stays(tmp_path):
    """Oracle: zero correction and covariance of float positions; a base of another place, out of
    reach, measures nothing.
    """
    rover, base, navigation, fixes, raw = simulated(tmp_path, 3, **WITHOUT)
    quality = fixes.quality.copy()
    quality[::7] = 2
    found, sky = found_in(rover, base, navigation, replace(fixes, quality=quality), raw)
    assert not found.correction_ned[::7].any()
    assert not found.cov_ned[::7].any()
    assert found.correction_ned[1::7].any(axis=1).all()
    far = raw.base_position_m + np.array([0.0, 1.2e4, 0.0])
    assert ionosphere_correction(fixes, rover, base, navigation, far, sky, AIR) is None


def test_one_band_measures_nothing(tmp_path):
    """Oracle: None, where the base has no L2."""
    rover, base, navigation, fixes, raw = simulated(tmp_path, 3, **WITHOUT)
    values = base.values.copy()
    values[:, [k for k, name in enumerate(base.signals) if name[:2] == "L2"]] = np.nan
    assert found_in(rover, replace(base, values=values), navigation, fixes, raw)[0] is None


FREQUENCY = {
    "G1": 1575.42,
    "G5": 1176.45,
    "E1": 1575.42,
    "E5": 1176.45,
    "E7": 1207.14,
    "C2": 1561.098,
    "C5": 1176.45,
    "C7": 1207.14,
}
FREQUENCY |= {"G2": 1227.60, "R1": 1602.0, "R2": 1246.0}


@pytest.mark.parametrize(
    ("satellite", "rover", "base", "frequencies", "taken"),
    [
        ("G05", "L1C L2W L5Q", "L1C L2W L5Q", 1, "1"),
        ("G05", "L1C L2W L5Q", "L1C L2W L5Q", 2, "12"),
        ("G05", "L1C L2W L5Q", "L1C L2W L5Q", 3, "125"),
        ("G05", "L1C L5X", "L1C L5X", 2, "1"),
        ("G05", "L1C L5X", "L1C L5X", 3, "15"),
        ("G05", "L1C L2W", "L1C L5X", 3, "1"),
        ("E05", "L1C L5Q L7Q", "L1C L5Q L7Q", 2, "17"),
        ("E05", "L1C L5Q L8Q", "L1C L5Q L8Q", 2, "1"),
        ("C05", "L2I L6I", "L2I L6I", 2, "2"),
        ("C05", "L1P L2I L5P L7D", "L1P L2I L5P L7I", 3, "275"),
        ("R05", "L1C L2P", "L1C L2C", 2, "12"),
    ],
)
def test_mean_kappa_is_of_the_bands_that_the_engine_takes_of_both(
    satellite, rover, base, frequencies, taken
):
    """Oracle: RTKLIB's table of frequencies, worked out by hand; carriers of the interface
    documents, GLONASS of channel 0.
    """
    signals = tuple(sorted({*rover.split(), *base.split()}))
    observed = [observations_of(satellite, signals, has.split()) for has in (rover, base)]
    one = Sky(
        np.zeros(1, dtype=np.int64),
        np.zeros(1),
        np.ones(1),
        np.zeros(1, dtype=np.int64),
        np.ones(1),
        np.zeros(1, dtype=np.int64),
    )
    expected = np.mean([(1575.42 / FREQUENCY[satellite[0] + band]) ** 2 for band in taken])
    assert mean_kappa(*observed, one, frequencies)[0] == pytest.approx(expected, rel=1e-9)
    assert common_bands(*observed, frequencies).sum() == len(taken)


def test_a_band_that_the_engine_leaves_out_still_measures():
    """Oracle: frequencies of the interface document: of B1I and B3I alone the second is B3, of B1I,
    B2I and B3I it is the engine's.
    """
    row = np.zeros(1, dtype=np.int64)
    for has, second in (("L2I L6I", "6"), ("L2I L6I L7I", "7"), ("L1P L2I L6I", "6")):
        observed = observations_of("C05", ("L1P", "L2I", "L6I", "L7I"), has.split())
        bands, hertz = _two_bands(observed, observed, row, row)
        assert bands.tolist() == [["2", second]]
        assert hertz[0].tolist() == [1561.098e6, {"6": 1268.52e6, "7": 1207.14e6}[second]]


def observations_of(satellite, signals, has):
    """One epoch of one satellite, with a phase in the signals that it has."""
    values = np.array([[1e8 if name in has else np.nan for name in signals]])
    one = np.zeros(1, dtype=np.int64)
    return SimpleNamespace(
        time=np.zeros(1),
        gps_week=2000,
        epoch=one,
        satellite=np.array([satellite]),
        signals=signals,
        values=values,
    )


@pytest.mark.parametrize(
    ("value", "models"), [("est-stec", True), ("3", True), ("1", False), ("off", False)]
)
def test_engine_that_models_it(value, models):
    """Oracle: RTKLIB's names and numbers of pos1-ionoopt."""
    assert engine_models_it(EngineOptions(rtklib_options={"pos1-ionoopt": value})) == models
    assert not engine_models_it(EngineOptions())


def test_ppk_tells_what_it_did(tmp_path, shells):
    """Oracle: the correction of the room itself, and its words; a flight that is too short, or an
    engine that models it, stays.
    """
    rover, base, navigation, fixes, raw = simulated(tmp_path, 5, **WITHOUT)
    found, sky = found_in(rover, base, navigation, fixes, raw)
    options = EngineOptions()
    moved, check = without_ionosphere(
        fixes, (rover, base), navigation, sky, raw.base_position_m, options, AIR
    )
    place = geodetic_to_ecef(fixes.lat, fixes.lon, fixes.height) - geodetic_to_ecef(
        moved.lat, moved.lon, moved.height
    )
    ned = np.einsum("nij,ni->nj", rotation_en(fixes.lat, fixes.lon), -place)
    np.testing.assert_allclose(ned, found.correction_ned, atol=2e-6)
    np.testing.assert_allclose(moved.cov_ned - fixes.cov_ned, found.cov_ned, atol=1e-12)
    assert f"{found.ionosphere.value[:, 0].mean():.1f} m in zenith" in check.found
    assert check.verdict == "ok"
    few = replace(fixes, quality=np.where(fixes.time < fixes.time[0] + 300.0, 1, 2))
    still, note = without_ionosphere(
        few, (rover, base), navigation, sky, raw.base_position_m, options, AIR
    )
    assert still is few
    assert (note.verdict, note.found[:13]) == ("note", "not corrected")
    engine = EngineOptions(rtklib_options={"pos1-ionoopt": "4"})
    same, told = without_ionosphere(
        fixes, (rover, base), navigation, sky, raw.base_position_m, engine, AIR
    )
    assert same is fixes
    assert (told.verdict, "left to the engine" in told.found) == ("ok", True)
