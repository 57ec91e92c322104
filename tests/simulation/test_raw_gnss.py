"""Raw GNSS data of a simulated flight: geometry, air, clocks, noise, locks; and the engine, which
must find the simulated motion again.
"""

import importlib.util
import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import quad
from scipy.stats import chi2, poisson
from surveys import block_flight

from insgnss.base.errors import UsageError
from insgnss.geodesy.frames import ecef_to_geodetic, geodetic_to_ecef, rotation_en
from insgnss.gnss.options import EngineOptions
from insgnss.gnss.phase.troposphere import Atmosphere
from insgnss.gnss.ppk import PpkInput, solve_ppk
from insgnss.records import CameraEvents
from insgnss.simulation.raw_gnss.atmosphere import (
    MEAN_EARTH_RADIUS_M,
    SimulatedIonosphere,
    Troposphere,
    Weather,
)
from insgnss.simulation.raw_gnss.errors import (
    LARGEST_RESTART,
    LARGEST_SLIP,
    Tracking,
    clock,
    noise,
    track,
)
from insgnss.simulation.raw_gnss.options import RawGnssOptions
from insgnss.simulation.raw_gnss.rinex_files import (
    ObservationTable,
    Station,
    write_navigation,
    write_observations,
)
from insgnss.simulation.raw_gnss.scenario import SIGNALS, simulate_raw_gnss
from insgnss.simulation.sensors import Rig, antenna_states

LIGHT, EARTH_RATE = 299792458.0, 7.2921151467e-5
GPS_HZ = np.array([1575.42e6, 1227.60e6])
MILLIMETRE = 1e-3
SHELL = 6721e3  # m from the Earth's centre
STEADY = Tracking(slips_per_hour=0.0, outages_per_hour=0.0)
EXACT = RawGnssOptions(
    code_sigma_m=0.0,
    phase_sigma_m=0.0,
    code_multipath_m=0.0,
    phase_multipath_m=0.0,
    doppler_sigma_ms=0.0,
    hardware_bias_m=0.0,
    glonass_code_bias_m=0.0,
    glonass_phase_bias_m=0.0,
    broadcast_error_m=0.0,
    tracking=STEADY,
)
needs_engine = pytest.mark.skipif(
    importlib.util.find_spec("pyrtklib5") is None, reason="pyrtklib5 (extra ppk) is not installed"
)
RTKLIB = """
import json, sys
import pyrtklib5 as p
files, week, wanted = json.load(sys.stdin)
nav, obs, sta = p.nav_t(), p.obs_t(), p.sta_t()
for file in files:
    p.readrnx(file, 1, "", obs, nav, sta)
p.uniqnav(nav)
out = []
for code, tow in wanted:
    time, rs, dts = p.gpst2time(week, tow), p.Arr1Ddouble(6), p.Arr1Ddouble(2)
    var, health = p.Arr1Ddouble(1), p.Arr1Dint(1)
    found = p.satpos(time, time, p.satid2no(code), 0, nav, rs, dts, var, health)
    out.append([found, *(rs[k] for k in range(3)), dts[0]])
print(json.dumps(out))
"""


@pytest.fixture(scope="module")
def flight():
    return block_flight(1.0, start_in_air=True, seed=2)


@pytest.fixture(scope="module")
def exact(flight):
    return simulated(flight, EXACT)


def simulated(flight, options, seed=1):
    events = CameraEvents(flight.images, flight.time, flight.gps_week)
    return simulate_raw_gnss(flight, Rig(), events, options, np.random.default_rng(seed))


def column(observed, name):
    return observed.values[:, SIGNALS.index(name)]


def frequencies(raw, observed):
    """Carriers (m, 2), Hz, of the rows."""
    channels = raw.navigation.channels()
    number = np.array([channels.get(str(code), 0) for code in observed.satellite])[:, None]
    glonass = np.char.startswith(observed.satellite, "R")[:, None]
    return np.where(glonass, [1602.0e6, 1246.0e6] + number * [0.5625e6, 0.4375e6], GPS_HZ)


def elevations(raw, observed, position):
    """Elevation (m,), rad, of satellites at positions (m, 3) seen from a receiver at its rows."""
    place = observed.position[observed.epoch]
    lat, lon, _ = ecef_to_geodetic(place)
    away = position - place
    down = rotation_en(lat, lon)[:, :, 2]
    return np.arcsin(-np.einsum("mi,mi->m", away, down) / np.linalg.norm(away, axis=1))


def same(variance, expected, n):
    """Whether a sample variance of n values lies in the 99.9 % interval of chi-square."""
    low, high = chi2.ppf([0.0005, 0.9995], n) / n
    return low < variance / expected < high


def written(raw, directory):
    """The four RINEX files of raw data."""
    files = [directory / name for name in ("rover.18o", "base.18o", "sim.18n", "sim.18g")]
    for path, observed in zip(files, (raw.rover, raw.base), strict=False):
        lock = np.zeros(observed.values.shape, dtype=np.int8)
        lock[:, 2:4] = observed.loss_of_lock
        table = ObservationTable(
            observed.gps_week,
            observed.stamp,
            observed.epoch,
            observed.satellite,
            SIGNALS,
            observed.values,
            lock,
            np.empty(0),
        )
        write_observations(path, Station(path.stem, tuple(observed.position[0] + 20.0)), table)
    write_navigation(*files[2:], raw.navigation)
    return files


def test_the_antenna_flies_the_exact_motion(flight, exact):
    """Oracle: antenna_states() at the true times; central difference for the velocity; stamps on
    the receiver's grid.
    """
    rover, frame = exact.rover, flight.motion.frame
    place, _ = antenna_states(flight.motion, Rig().antenna_lever_b, rover.time)
    assert_allclose(rover.position, frame.origin_ecef + place @ frame.C_el.T, rtol=0.0, atol=1e-8)
    assert_allclose(rover.stamp * 10.0, np.rint(rover.stamp * 10.0), rtol=0.0, atol=1e-6)
    assert_allclose(rover.stamp - rover.time, rover.clock_s, rtol=0.0, atol=1e-10)
    step = (rover.position[2:] - rover.position[:-2]) / (rover.time[2:] - rover.time[:-2])[:, None]
    assert np.abs(step - rover.velocity[1:-1]).max() < 0.1  # jerk of a drone over 0.1 s
    assert rover.stamp[0] - flight.motion.start < 0.2
    assert flight.motion.end - rover.stamp[-1] < 0.2
    assert np.ptp(exact.base.position, axis=0).max() == 0.0
    baseline = np.linalg.norm(exact.base_position_m - frame.origin_ecef)
    assert baseline == pytest.approx(1500.0, abs=1.0)
    assert ecef_to_geodetic(exact.base_position_m)[2] == pytest.approx(frame.height + 6.0, abs=1e-6)
    assert exact.base.stamp[0] < rover.stamp[0]
    assert exact.base.stamp[-1] > rover.stamp[-1]


@needs_engine
def test_codes_are_what_rtklib_s_satellites_and_a_receiver_s_place_give(flight, exact, tmp_path):
    """Oracle: RTKLIB's satellites and clocks at the instants of emission, the Sagnac formula of the
    textbooks, (A.2) for the air.

    Groves (2013) 8.5.3. The first-order Sagnac term is short of half a millimetre, RTKLIB's GLONASS
    of millimetres.
    """
    files = [str(tmp_path / name) for name in ("sim.18n", "sim.18g")]
    write_navigation(*files, exact.navigation)
    dry = simulated(
        flight,
        replace(EXACT, iono_vertical_m=0.0, iono_rate_ms=0.0, iono_gradient=0.0, iono_wave_m=0.0),
    )
    assert_array_equal(dry.navigation.table, exact.navigation.table)
    for observed in (dry.rover, dry.base):
        rows = np.flatnonzero(observed.epoch % 97 == 0)
        code, place = column(observed, "C1")[rows], observed.position[observed.epoch[rows]]
        time, offset = (
            observed.time[observed.epoch[rows]],
            LIGHT * observed.clock_s[observed.epoch[rows]],
        )
        sent, dts = time - 0.075, np.zeros(rows.size)
        for _ in range(3):
            asked = json.dumps(
                [
                    files,
                    dry.rover.gps_week,
                    list(zip(observed.satellite[rows].tolist(), sent.tolist(), strict=True)),
                ]
            )
            run = subprocess.run(
                [sys.executable, "-c", RTKLIB],
                input=asked,
                capture_output=True,
                text=True,
                check=True,
            )
            found = np.array(json.loads(run.stdout))
            assert (found[:, 0] == 1).all()
            position, dts = found[:, 1:4], found[:, 4]
            straight = np.linalg.norm(position - place, axis=1)
            away = straight + EARTH_RATE / LIGHT * (
                position[:, 0] * place[:, 1] - position[:, 1] * place[:, 0]
            )
            sent = time - away / LIGHT
        elevation = elevations(dry, replace(observed, epoch=observed.epoch[rows]), position)
        _, _, height = ecef_to_geodetic(place)
        air = Troposphere(dry.weather, ecef_to_geodetic(dry.base_position_m)[2]).slant_delay(
            height, elevation
        )
        left = code - (away + offset - LIGHT * dts + air)
        gps = np.char.startswith(observed.satellite[rows], "G")
        assert np.abs(left[gps]).max() < 2 * MILLIMETRE
        assert np.abs(left[~gps]).max() < 20 * MILLIMETRE


def test_code_and_phase_part_by_the_ionosphere_alone(exact):
    """Oracle: the dispersion law; without noise P2 - C1 is (f1^2/f2^2 - 1) I, phases the same with
    the other sign plus constants.
    """
    for observed in (exact.rover, exact.base):
        f = frequencies(exact, observed)
        delay = (column(observed, "P2") - column(observed, "C1")) / ((f[:, 0] / f[:, 1]) ** 2 - 1.0)
        # 2.5 m in zenith, 1.5 m less at the farthest point of the shell that is seen, and three
        # times that at the mask
        assert delay.min() > 0.5
        assert delay.max() < 13.0
        for name, band in (("L1", 0), ("L2", 1)):
            phase = column(observed, name) * LIGHT / f[:, band]
            parted = (
                column(observed, ("C1", "P2")[band])
                - phase
                - 2.0 * delay * (f[:, 0] / f[:, band]) ** 2
            )
            for code in np.unique(observed.satellite):
                assert np.ptp(parted[observed.satellite == code]) < 1e-6


def test_doppler_is_the_rate_of_the_phase(exact):
    """Oracle: central difference of the phases over 0.2 s; what is left is the third derivative of
    the range of a drone.
    """
    rover = exact.rover
    for name, phase in (("D1", "L1"), ("D2", "L2")):
        for code in np.unique(rover.satellite):
            rows = np.flatnonzero(rover.satellite == code)
            rows = rows[: np.argmax(np.diff(rover.epoch[rows], append=-1) != 1) + 1]
            rate = (column(rover, phase)[rows[2:]] - column(rover, phase)[rows[:-2]]) / 0.2
            error = 0.19 * (rate + column(rover, name)[rows[1:-1]])
            assert np.abs(error).max() < 0.05
            assert abs(error.mean()) < 2 * MILLIMETRE


def test_double_differences_of_phase_are_whole_cycles(flight):
    """Oracle: integers; where both antennas are at one place at one time, nothing else is left of
    GPS.
    """
    raw = simulated(
        flight, replace(EXACT, base_offset_m=offset_of(flight), clock_offset_s=0.0, clock_drift=0.0)
    )
    first, other = (
        dict(zip(o.satellite[rows].tolist(), o.values[rows], strict=True))
        for o, rows in rows_of_a_second(raw)
    )
    pivot, *others = [code for code in first if code in other and code[0] == "G"]
    assert len(others) >= 5
    for band in (2, 3):
        single = [first[code][band] - other[code][band] for code in (pivot, *others)]
        double = np.array(single[1:]) - single[0]
        assert_allclose(double, np.rint(double), rtol=0.0, atol=2e-3)  # half a millimetre


def offset_of(flight):
    """Where the antenna is ten seconds after the flight's start: north, east, up of the site."""
    frame = flight.motion.frame
    place, _ = antenna_states(
        flight.motion, Rig().antenna_lever_b, np.array([flight.motion.start + 10.0])
    )
    lat, lon, height = frame.geodetic_from_position(place[0])
    foot = frame.position_from_geodetic(lat, lon, frame.height)
    for _ in range(
        5
    ):  # the foot of the place in the plane from whose geodetic coordinates the base is set up
        found = frame.position_from_geodetic(
            *frame.geodetic_from_position([foot[0], foot[1], 0.0])[:2], height
        )
        foot = foot + place[0] - found
    return float(foot[0]), float(foot[1]), float(height - frame.height)


def rows_of_a_second(raw):
    """Rows of rover and base at ten seconds after the flight's start."""
    second = raw.rover.stamp[0] + 10.0
    for observed in (raw.rover, raw.base):
        yield (
            observed,
            np.flatnonzero(np.abs(observed.stamp[observed.epoch] - np.rint(second)) < 1e-6),
        )


def test_events_are_by_the_rover_s_clock(flight, exact):
    """Oracle: the clock's true offset, interpolated between the epochs around."""
    apart = exact.events - flight.time
    expected = np.interp(flight.time, exact.rover.time, exact.rover.clock_s)
    assert apart.size > 3
    assert_allclose(apart, expected, rtol=0.0, atol=1e-10)
    assert np.abs(apart).max() > 1e-6


def test_events_keep_the_old_clock_until_the_epoch_of_a_jump(flight):
    """Oracle: the rule: before the later epoch of a jump the line of the two epochs before it goes
    on, from that epoch on that of the two behind. 0.11 us: the clock is drawn on the grid of the
    stamps, where an interval with a jump of 1 ms is not longer; times its drift."""
    options = replace(EXACT, clock_offset_s=4e-4, clock_drift=1e-4, clock_jump_s=1e-3, systems="G")
    time = np.arange(flight.time[0], flight.time[-1], 0.0371)
    events = CameraEvents(tuple(str(k) for k in range(time.size)), time, flight.gps_week)
    raw = simulate_raw_gnss(flight, Rig(), events, options, np.random.default_rng(1))
    at, clock = raw.rover.time, raw.rover.clock_s
    k = np.searchsorted(at, time, side="right") - 1
    jumps = np.flatnonzero(np.abs(np.diff(clock)) > 5e-4)
    between = np.isin(k, jumps)
    assert between.sum() > 5
    first = np.where(between, k - 1, k)
    line = clock[k] + (clock[first + 1] - clock[first]) / (at[first + 1] - at[first]) * (
        time - at[k]
    )
    assert_allclose(raw.events - time, line, rtol=0.0, atol=1.1e-7)


def test_a_millisecond_jump_moves_stamps_codes_and_phases_together(flight):
    """Oracle: closed form; whatever the jumps, an epoch's code less its clock is the range at its
    true time.
    """
    options = replace(EXACT, clock_offset_s=4e-4, clock_drift=1e-4, clock_jump_s=1e-3, systems="G")
    raw = simulated(flight, options)
    clock_s = raw.rover.clock_s
    assert np.abs(clock_s).max() <= 0.5e-3 + 1e-9
    assert (np.abs(np.diff(clock_s)) > 0.9e-3).any()
    for name, size in (("C1", 1.0), ("L1", LIGHT / GPS_HZ[0])):
        for code in np.unique(raw.rover.satellite):
            rows = raw.rover.satellite == code
            epoch = raw.rover.epoch[rows]
            free = column(raw.rover, name)[rows] * size - LIGHT * clock_s[epoch]
            step = np.diff(free)[np.diff(epoch) == 1]
            assert (
                np.abs(np.diff(step)).max() < 3.0
            )  # a range without jump: 300 km of it would show
            assert np.abs(step).max() < 100.0


def test_clock_of_a_receiver_walks_as_its_crystal():
    """Oracle: closed form of the variance of a step, and the limits of the start."""
    rng = np.random.default_rng(1)
    series = np.array([clock(400, 0.1, 1e-4, 0.0, rng) for _ in range(200)])
    assert np.abs(series[:, 0]).max() <= 1e-4
    assert np.abs(series[:, 0]).max() > 0.9e-4
    second = np.diff(series, n=2, axis=1)
    expected = 2.0 * 1e-20 * 0.1 + (2e-11 * 0.1) ** 2 * 0.1
    assert np.mean(second**2) == pytest.approx(expected, rel=0.03)
    assert np.std([clock(11, 0.1, 0.0, 3e-8, rng)[-1] for _ in range(400)]) == pytest.approx(
        3e-8, rel=0.15
    )


def test_noise_is_white_and_gauss_markov_over_the_sine():
    """Oracle: variance and autocorrelation of the two processes in closed form."""
    sine = np.tile(np.linspace(0.2, 1.0, 20), (20000, 1))
    out = noise(sine, 0.0015, 0.0012, 20.0, 0.1, np.random.default_rng(2)) * sine
    assert np.mean(out**2) == pytest.approx(0.0015**2 + 0.0012**2, rel=0.05)
    for lag, share in ((1, np.exp(-0.1 / 20.0)), (200, np.exp(-1.0)), (800, np.exp(-4.0))):
        assert np.mean(out[lag:] * out[:-lag]) == pytest.approx(
            share * 0.0012**2, abs=0.1 * 0.0012**2
        )
    white = noise(sine, 0.15, 0.0, 20.0, 0.1, np.random.default_rng(3)) * sine
    assert same(np.mean(white**2), 0.15**2, white.size)


def test_locks_slip_and_are_lost_as_often_as_told():
    """Oracle: Poisson's law of counts, uniform lengths of losses, and what each must do to phase
    and flags.
    """
    n, s, interval = 36000, 20, 0.1
    bank = np.where(np.arange(n) < n // 2, 0.0, np.radians(30.0))
    tracking = Tracking(
        slips_per_hour=6.0, reported_share=0.75, outages_per_hour=3.0, outage_s=(2.0, 6.0)
    )
    locks = track(np.ones((n, s), dtype=bool), bank, interval, tracking, np.random.default_rng(4))
    slipped = locks.slips.any(axis=2)
    for part, factor in ((slice(0, n // 2), 1.0), (slice(n // 2, n), 5.0)):
        low, high = poisson.ppf([0.0005, 0.9995], 6.0 * 0.5 * s * factor)
        assert 0.95 * low <= slipped[part].sum() <= high  # a lost satellite does not slip
        starts = (~locks.held[part, :, 1][1:] & locks.held[part, :, 1][:-1]).sum()
        low, high = poisson.ppf([0.0005, 0.9995], 3.0 * 0.5 * s * factor)
        assert 0.95 * low <= starts <= high
    lost = (~locks.held[:, :, 1]).sum() * interval
    assert lost == pytest.approx(4.0 * 3.0 * 0.5 * s * 6.0, rel=0.2)
    assert (
        0.2
        < (locks.held[:, :, 0] & ~locks.held[:, :, 1]).sum() / (~locks.held[:, :, 1]).sum()
        < 0.4
    )
    assert (np.abs(locks.slips[slipped]).max(axis=1) >= 1).all()
    assert np.abs(locks.slips).max() <= LARGEST_SLIP
    jumps = np.diff(locks.cycles, axis=0, prepend=locks.cycles[:1])
    again = locks.held & ~np.roll(locks.held, 1, axis=0)
    again[0] = False
    assert_array_equal(jumps[~again], locks.slips[~again])
    assert np.std(jumps[again]) == pytest.approx(LARGEST_RESTART / np.sqrt(3.0), rel=0.1)
    assert locks.report[again].all()
    assert not locks.report[0].any()
    silent = slipped & ~locks.report.any(axis=2)
    assert 0.15 < silent.sum() / slipped.sum() < 0.35
    assert not locks.report[(locks.slips == 0) & ~again].any()


def test_satellites_rise_set_and_hide_behind_the_wing():
    """Oracle: the masks, by elevations of the written messages; the banked antenna sees less."""
    flight = block_flight(45.0, seed=3)
    options = RawGnssOptions(rate_hz=0.5, base_rate_hz=0.2, tracking=STEADY)
    raw = simulated(flight, options)
    rover = raw.rover
    count = np.bincount(rover.epoch, minlength=rover.stamp.size)
    assert count.min() >= 8
    assert 14 < count.mean() < 22
    ends = [set(rover.satellite[rover.epoch == k].tolist()) for k in (0, rover.stamp.size - 1)]
    assert ends[0] - ends[1]
    assert ends[1] - ends[0]
    assert all((np.diff(rover.epoch) > 0) | (rover.satellite[1:] > rover.satellite[:-1]))
    open_sky = simulated(flight, replace(options, antenna_mask_deg=-90.0))
    hidden = np.bincount(open_sky.rover.epoch) - count
    bank = np.abs(flight.motion.angles(rover.time)[:, 0])
    assert hidden.min() == 0
    assert (
        hidden[bank > np.radians(25.0)].mean() > 0.2 > hidden[bank < np.radians(8.0)].mean() == 0.0
    )
    strength = column(rover, "S1")
    assert 23.0 < strength.min() < 40.0  # 10 degrees below the antenna's plane
    assert 48.0 < strength.max() < 54.0


def test_one_seed_is_one_recording(flight, exact):
    """Oracle: the same call; errors of another seed differ."""
    again = simulated(flight, EXACT)
    assert_array_equal(again.rover.values, exact.rover.values)
    assert_array_equal(again.base.values, exact.base.values)
    assert simulated(flight, EXACT, seed=9).rover.values.shape != exact.rover.values.shape or (
        simulated(flight, EXACT, seed=9).rover.values[0, 0] != exact.rover.values[0, 0]
    )


@pytest.mark.parametrize("elevation_deg", [5.0, 10.0, 15.0, 30.0, 90.0])
@pytest.mark.parametrize("height", [500.0, 700.0])
def test_delay_of_the_troposphere_is_the_integral_along_the_ray(elevation_deg, height):
    """Oracle: scipy's quad along the straight line itself; and the table between its points."""
    air = Troposphere(Weather(), 516.0)
    sine, start = np.sin(np.radians(elevation_deg)), MEAN_EARTH_RADIUS_M + height

    def along(s):
        return 1e-6 * float(
            air.refractivity(
                np.sqrt(start**2 + 2.0 * start * s * sine + s**2) - MEAN_EARTH_RADIUS_M
            )
        )

    end = -start * sine + np.sqrt((start * sine) ** 2 + 8e4 * (2.0 * start + 8e4))
    points = [
        -start * sine + np.sqrt((start * sine) ** 2 + top * (2.0 * start + top))
        for top in (2e3, 1.1e4 - height, 3e4)
    ]
    expected = quad(along, 0.0, end, points=points, epsabs=1e-7, limit=400)[0]
    found = air.slant_delay(height, np.radians(elevation_deg))
    assert found == pytest.approx(
        expected, abs=5e-4
    )  # 11 km lies within a layer: the bend of the temperature there
    table = air.table(480.0, 720.0, np.radians(3.0))
    assert table(height, np.radians(elevation_deg), grid=False) / sine == pytest.approx(
        found, abs=2e-5
    )


def test_zenith_delay_is_that_of_others():
    """Oracle: Saastamoinen's 2.2768 mm/hPa of dry air (other refractivity, 0.3 %), Chao's mapping
    (1 %), decay of vapour by height.
    """
    dry = Troposphere(Weather(humidity=0.0), 516.0)
    zenith = float(dry.slant_delay(516.0, 0.5 * np.pi))
    assert zenith == pytest.approx(
        2.2768e-3 * 957.0 / (1.0 - 2.66e-3 * np.cos(2 * 0.81) - 2.8e-7 * 516.0), rel=3e-3
    )
    for degrees in (10.0, 20.0, 45.0):
        E = np.radians(degrees)
        mapping = 1.0 / (np.sin(E) + 0.00143 / (np.tan(E) + 0.0445))
        assert float(dry.slant_delay(516.0, E)) == pytest.approx(zenith * mapping, rel=1e-2)
    wet = Troposphere(Weather(), 516.0)
    vapour = [
        wet.slant_delay(h, 0.5 * np.pi) - dry.slant_delay(h, 0.5 * np.pi) for h in (516.0, 716.0)
    ]
    assert 0.1 < vapour[0] < 0.2
    assert 0.88 < vapour[1] / vapour[0] < 0.93


def test_the_ionosphere_has_its_gradient_and_wave():
    """Oracle: closed form in zenith, where the pierce point is above the receiver's own place, and
    of the zenith angle at the shell.
    """
    shell = SimulatedIonosphere((0.8, 0.1), 2.5, 1e-4, (1e-6, -2e-6), 0.0, (1.0, 0.0), 0.0)
    up, none = np.full((2, 1), 0.5 * np.pi), np.zeros(2)
    away = 3e4 / (SHELL * np.cos(0.8))
    delay = shell.delay(
        np.array([0.0, 100.0]),
        (np.array([0.8, 0.8 + 1e4 / SHELL]), np.array([0.1, 0.1]), none),
        np.zeros((2, 1)),
        up,
    )
    assert_allclose(delay[:, 0], [2.5, 2.5 + 0.01 + 0.01], rtol=0.0, atol=1e-7)
    delay = shell.delay(
        none, (np.full(2, 0.8), np.array([0.1, 0.1 + away]), none), np.zeros((2, 1)), up
    )
    assert_allclose(
        delay[:, 0], [2.5, 2.5 - 0.06], rtol=0.0, atol=1e-4
    )  # a parallel leaves the tangent plane's east by 69 m
    level = SimulatedIonosphere((0.8, 0.1), 2.5, 0.0, (0.0, 0.0), 0.0, (1.0, 0.0), 0.0)
    for height in (0.0, 3000.0):
        place = (np.array([0.8]), np.array([0.1]), np.array([height]))
        slant = level.delay(np.zeros(1), place, np.zeros((1, 1)), np.full((1, 1), np.radians(10.0)))
        expected = 2.5 / np.sqrt(1.0 - ((6371e3 + height) / 6721e3 * np.cos(np.radians(10.0))) ** 2)
        assert slant[0, 0] == pytest.approx(expected, rel=1e-12)
    wave = SimulatedIonosphere((0.8, 0.1), 0.0, 0.0, (0.0, 0.0), 0.01, (0.0, 1.0), 0.0)
    quarter = np.arcsin(37.5e3 / (SHELL * np.cos(0.8)))
    crest = wave.delay(
        np.zeros(1),
        (np.array([0.8]), np.array([0.1 + quarter]), np.zeros(1)),
        np.zeros((1, 1)),
        up[:1],
    )
    assert crest[0, 0] == pytest.approx(0.01, abs=1e-9)


def test_rays_of_two_receivers_meet_the_shell_where_vectors_do():
    """Oracle: the sphere cut by straight rays in Cartesian coordinates, from two receivers 3 km and
    500 m of height apart.

    A gradient makes the delay a measure of the place: 1e-6 m/m of a micrometre is a metre on the
    shell.
    """
    shell = SimulatedIonosphere((0.8, 0.1), 0.0, 0.0, (1e-6, 2e-6), 0.0, (1.0, 0.0), 0.0)
    lat, lon, height = np.array([0.8, 0.8003]), np.array([0.1, 0.1004]), np.array([0.0, 500.0])
    azimuth, elevation = np.radians([[20.0, 140.0, 300.0]]), np.radians([[15.0, 45.0, 70.0]])
    delay = shell.delay(
        np.zeros(2),
        (lat, lon, height),
        np.repeat(azimuth, 2, axis=0),
        np.repeat(elevation, 2, axis=0),
    )
    axes = rotation_en(0.8, 0.1)
    for k in range(2):
        own = rotation_en(lat[k], lon[k])
        for j, (A, E) in enumerate(zip(azimuth[0], elevation[0], strict=True)):
            start, ray = (
                -(6371e3 + height[k]) * own[:, 2],
                own @ [np.cos(E) * np.cos(A), np.cos(E) * np.sin(A), -np.sin(E)],
            )
            point = start + ray * (
                np.sqrt((start @ ray) ** 2 - start @ start + SHELL**2) - start @ ray
            )
            slant = SHELL / (point @ ray)
            assert delay[k, j] == pytest.approx(
                slant * (point @ axes[:, 0] * 1e-6 + point @ axes[:, 1] * 2e-6), abs=1e-9
            )


@needs_engine
@pytest.mark.slow
def test_the_engine_finds_the_simulated_motion(flight, exact, tmp_path):
    """Oracle: exact simulated motion, solved by RTKLIB from what was written.

    Without noise what is left is the ionosphere's gradient over 1.5 km (some 2 mm, more in height)
    and a digit of RINEX, 0.2 mm.
    """
    fixed, error, _ = solved(flight, exact, tmp_path)
    assert fixed.mean() > 0.99
    assert np.abs(error[fixed, :2]).max() < 6 * MILLIMETRE
    assert np.abs(error[fixed, 2]).max() < 15 * MILLIMETRE


@pytest.mark.slow
@needs_engine
def test_the_engine_fixes_under_the_errors_of_the_default(tmp_path):
    """Oracle: exact simulated motion; the bars of a mapping flight, over two minutes of it in the
    air.
    """
    flight = block_flight(2.0, start_in_air=True, seed=6)
    raw = simulated(flight, replace(RawGnssOptions(), rate_hz=5.0), seed=6)
    fixed, error, normalised = solved(flight, raw, tmp_path)
    assert fixed.mean() > 0.98
    assert np.abs(error[fixed]).max() < 0.1
    rms = np.sqrt(np.mean(error[fixed] ** 2, axis=0))
    assert (rms[:2] < 6 * MILLIMETRE).all()
    assert rms[2] < 15 * MILLIMETRE
    assert 0.05 < normalised[fixed].mean() < 3.0  # two minutes are a few correlation times


def solved(flight, raw, directory):
    """Which epochs are fixed, their errors (n, 3), m, north, east, down, and errors squared over
    the covariance, by 3.
    """
    rover, base, *navigation = written(raw, directory)
    options = EngineOptions(base_position_m=tuple(raw.base_position_m), base_point="apc")
    air = Atmosphere(raw.weather.pressure_hpa, raw.weather.temperature_c, raw.weather.humidity)
    fixes = solve_ppk(
        PpkInput(rover, base, tuple(navigation), options, atmosphere=air, velocity=False)
    ).fixes
    assert abs(fixes.time.size - raw.rover.stamp.size) <= 2
    frame = flight.motion.frame
    place, _ = antenna_states(
        flight.motion,
        Rig().antenna_lever_b,
        np.clip(fixes.time, flight.motion.start, flight.motion.end),
    )
    apart = geodetic_to_ecef(fixes.lat, fixes.lon, fixes.height) - (
        frame.origin_ecef + place @ frame.C_el.T
    )
    error = np.einsum("nij,ni->nj", rotation_en(fixes.lat, fixes.lon), apart)
    return (
        fixes.quality == 1,
        error,
        np.einsum("ni,nij,nj->n", error, np.linalg.inv(fixes.cov_ned), error) / 3.0,
    )


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: RawGnssOptions(rate_hz=0.0), "rate_hz = 0.0: must be"),
        (lambda: RawGnssOptions(phase_sigma_m=-1.0), "phase_sigma_m = -1.0: must be"),
        (lambda: RawGnssOptions(systems="E"), "'E'"),
        (lambda: RawGnssOptions(elevation_mask_deg=1.0), "elevation_mask_deg = 1.0: must be"),
        (lambda: RawGnssOptions(base_share=2.0), "base_share = 2.0: must be"),
        (lambda: RawGnssOptions(iono_vertical_m=1.0), "no delay can be negative"),
        (
            lambda: RawGnssOptions(glonass_phase_bias_m=float("nan")),
            "glonass_phase_bias_m = nan: must be",
        ),
        (lambda: Tracking(slips_per_hour=-1.0), "slips_per_hour = -1.0: must be"),
        (lambda: Tracking(outage_s=(3.0, 1.0)), "outage_s"),
        (lambda: Weather(pressure_hpa=95700.0), "pressure_hpa = 95700.0: must be"),
    ],
)
def test_impossible_options_are_refused(make, said):
    """Oracle: the message names the option and the value."""
    with pytest.raises(UsageError, match=said):
        make()


def test_a_sky_or_a_flight_too_poor_is_refused(flight):
    """Oracle: the message names the limit."""
    with pytest.raises(UsageError, match="lower a mask"):
        simulated(flight, RawGnssOptions(systems="R", elevation_mask_deg=50.0))
    with pytest.raises(UsageError, match="raise rate_hz"):
        simulated(flight, RawGnssOptions(rate_hz=0.05))
