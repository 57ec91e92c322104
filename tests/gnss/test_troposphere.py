from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from insgnss.base.errors import DataError, InputError
from insgnss.geodesy.frames import ecef_to_geodetic, geodetic_to_ecef, rotation_en
from insgnss.geodesy.gpstime import WEEK_S
from insgnss.gnss.engine.rtklib import solve
from insgnss.gnss.options import EngineOptions
from insgnss.gnss.phase.time_differences import code_ranges
from insgnss.gnss.phase.troposphere import (
    Atmosphere,
    displacement_per_delay,
    engine_layer,
    hydrostatic_layer,
    mapping,
    standard_atmosphere,
    standard_slant_delay,
    wet_delay_correction,
    wet_layer,
)
from insgnss.gnss.quality.solution_quality import solution_of
from insgnss.gnss.rinex.navigation_message import read_navigation
from insgnss.gnss.rinex.observations import read_observations
from insgnss.gnss.satellites.engine_weighting import carrying_systems
from insgnss.gnss.satellites.frequencies import CHANNEL_HERTZ, HERTZ
from insgnss.gnss.satellites.orbits import LIGHT, emission_states, ranges, satellite_states, sky
from insgnss.gnss.satellites.satellite_geometry import Sky, common_sky
from insgnss.records import GnssFixes
from insgnss.simulation.dataset import write_dataset
from insgnss.simulation.raw_gnss.atmosphere import Weather
from insgnss.simulation.raw_gnss.errors import Tracking
from insgnss.simulation.raw_gnss.options import RawGnssOptions

DATA = Path(__file__).parents[3] / "shared" / "data"
WITHOUT = (
    "hardware_bias_m",
    "glonass_code_bias_m",
    "glonass_phase_bias_m",
    "broadcast_error_m",
    "iono_rate_ms",
    "iono_gradient",
)
ONLY_AIR = dict.fromkeys(
    (*WITHOUT, "iono_wave_m", "iono_vertical_m", "code_multipath_m", "phase_multipath_m"), 0.0
)
ONLY_AIR |= {
    "rate_hz": 2.0,
    "code_sigma_m": 0.02,
    "phase_sigma_m": 1e-5,
    "tracking": Tracking(slips_per_hour=0.0, outages_per_hour=0.0),
}
LAT, LON, HEIGHT = 0.82, 0.11, 450.0
PHASES = {"G": ("L1C", "L2W"), "R": ("L1C", "L2P")}
LOW = np.radians(20.0)
BASE = geodetic_to_ecef(LAT, LON, HEIGHT)


def ring(epochs, low=LOW, per_ring=6):
    """A zenith satellite and a ring of them at elevation `low`, of one system, at each epoch."""
    azimuth = np.concatenate([[0.0], 2.0 * np.pi * np.arange(per_ring) / per_ring])
    elevation = np.concatenate([[0.5 * np.pi], np.full(per_ring, low)])
    n = azimuth.size
    epoch, one = np.repeat(np.arange(epochs), n), np.ones(n * epochs)
    return Sky(
        epoch,
        np.tile(azimuth, epochs),
        np.tile(elevation, epochs),
        np.zeros(epoch.size, dtype=np.int64),
        one,
    )


def fixes_above(rise, quality=None):
    rise = np.asarray(rise, dtype=float)
    n = rise.size
    return GnssFixes(
        1000.0 + np.arange(n),
        np.full(n, LAT),
        np.full(n, LON),
        HEIGHT + rise,
        np.tile(1e-4 * np.eye(3), (n, 1, 1)),
        quality=quality,
    )


def profile(atmosphere, rise):
    """Pressure, hPa, temperature, K, vapour, hPa, over heights above the base, by steps of the
    hydrostatic equation.
    """
    h = np.linspace(0.0, rise, 20001)
    T = atmosphere.temperature_c + 273.15 - 6.5e-3 * h
    log_p = (
        -9.80665
        / 287.053
        * np.concatenate([[0.0], np.cumsum(0.5 * (1.0 / T[1:] + 1.0 / T[:-1]) * np.diff(h))])
    )
    e = atmosphere.vapour_pressure_hpa * np.exp(3.8 * log_p)
    return h, atmosphere.pressure_hpa * np.exp(log_p), T, e


@pytest.mark.parametrize("rise", [120.0, -80.0, 1500.0])
def test_layers_are_the_integrals_of_the_profile(rise):
    """Oracle: quadrature of the wet refractivity, and the pressure at the top of a column
    integrated step by step.
    """
    air = Atmosphere(935.0, 24.0, 0.55)
    h, P, T, e = profile(air, rise)
    refractivity = 1e-6 * (22.1 * e / T + 3.739e5 * e / T**2)
    assert wet_layer(air, rise) == pytest.approx(np.trapezoid(refractivity, h), rel=1e-6)
    f = 1.0 - 2.66e-3 * np.cos(2.0 * LAT) - 2.8e-7 * HEIGHT
    assert hydrostatic_layer(air, rise, LAT, HEIGHT) == pytest.approx(
        2.2768e-3 * (P[0] - P[-1]) / f, rel=1e-6
    )


def test_vapour_and_standard_values():
    """Oracle: WMO tables of the saturation vapour pressure; 2.31 m of hydrostatic delay at sea
    level, a decimetre of wet delay.
    """
    assert Atmosphere(1013.0, 20.0, 1.0).vapour_pressure_hpa == pytest.approx(23.37, abs=0.06)
    assert Atmosphere(1013.0, 0.0, 1.0).vapour_pressure_hpa == pytest.approx(6.11, abs=0.01)
    air = standard_atmosphere(450.0)
    assert (air.pressure_hpa, air.temperature_c) == (
        pytest.approx(960.4, abs=0.2),
        pytest.approx(12.075),
    )
    total = float(standard_slant_delay(np.radians(45.0), 0.0, 0.5 * np.pi))
    assert total == pytest.approx(2.31 + 0.12, abs=0.03)
    warm = standard_atmosphere(450.0, temperature_c=25.0, humidity=0.5)
    assert (warm.temperature_c, warm.humidity, warm.sd_temperature_c, warm.sd_humidity) == (
        25.0,
        0.5,
        3.0,
        0.1,
    )
    assert (warm.pressure_hpa, warm.sd_pressure_hpa) == (air.pressure_hpa, 10.0)
    assert standard_atmosphere(450.0, pressure_hpa=970.0).sd_pressure_hpa == 2.0
    assert wet_layer(warm, 100.0) == pytest.approx(0.0067, abs=0.0005)  # 16 hPa of vapour


def test_the_engine_leaves_out_the_wet_layer_alone_in_the_standard_atmosphere():
    """Oracle: the two formulas of the standard atmosphere, which agree to 0.1 % over 200 m."""
    hydrostatic = hydrostatic_layer(standard_atmosphere(HEIGHT), 200.0, LAT, HEIGHT)
    assert engine_layer(200.0, LAT, HEIGHT) == pytest.approx(float(hydrostatic), rel=1e-3)
    assert engine_layer(50.0, LAT, -100.0) == 0.0  # below sea level it takes sea level's pressure


def test_slope_of_a_ring_and_a_zenith_satellite():
    """Oracle: closed form; height and clock follow the delay exactly, what is symmetric leaves the
    horizontal alone.
    """
    slope = displacement_per_delay(ring(2), 2)
    down = float((mapping(0.5 * np.pi) - mapping(LOW)) / (1.0 - np.sin(LOW)))
    np.testing.assert_allclose(slope, np.tile([0.0, 0.0, down], (2, 1)), rtol=0, atol=1e-9)
    assert -3.1 < down < -2.7


def test_correction_takes_off_what_least_squares_makes_of_the_delay():
    """Oracle: an epoch's weighted least squares of delayed ranges by numpy.linalg.lstsq, two
    systems with a clock each.
    """
    rng = np.random.default_rng(3)
    n = 14
    azimuth, elevation = (
        rng.uniform(-np.pi, np.pi, n),
        rng.uniform(np.radians(15.0), np.radians(88.0), n),
    )
    system = np.repeat([0, 1], n // 2)
    satellites = Sky(
        np.zeros(n, dtype=np.int64), azimuth, elevation, system, np.where(system == 1, 0.5, 1.0)
    )
    fixes = fixes_above([150.0])
    air = Atmosphere(950.0, 22.0, 0.6)
    found = wet_delay_correction(fixes, BASE, satellites, air)
    f = 1.0 - 2.66e-3 * np.cos(2.0 * LAT) - 2.8e-7 * HEIGHT
    standard = 1013.25 * (1.0 - 2.2557e-5 * np.array([HEIGHT, HEIGHT + 150.0])) ** 5.2568
    left = 2.2768e-3 * (standard[0] - standard[1]) / (1.0 - 2.66e-3 * np.cos(2.0 * LAT))
    _, P, _, _ = profile(air, 150.0)
    left -= 2.2768e-3 * (P[0] - P[-1]) / f + float(wet_layer(air, 150.0))
    assert found.zenith_m[0] == pytest.approx(left, abs=1e-6)
    assert left < -0.005
    u = np.column_stack(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            -np.sin(elevation),
        ]
    )
    A = np.column_stack([-u, system == 0, system == 1])
    root = np.sqrt(np.where(system == 1, 0.5, 1.0) / (1.0 + 1.0 / np.sin(elevation) ** 2))
    shift = np.linalg.lstsq(root[:, None] * A, root * mapping(elevation) * left, rcond=None)[0][:3]
    np.testing.assert_allclose(found.correction_ned[0], -shift, atol=1e-8)
    assert found.correction_ned[0, 2] < 0.0  # the rover comes out too low
    assert 1e-4 < found.height_per_metre < 4e-4
    np.testing.assert_allclose(found.cov_ned[0], np.swapaxes(found.cov_ned[0], 0, 1))
    assert 0.1 < np.sqrt(found.cov_ned[0, 2, 2]) / abs(found.correction_ned[0, 2]) < 0.6


def test_only_relative_solutions_are_corrected_and_float_ones_with_doubt():
    """Oracle: RTKLIB's meaning of quality: 1 fixed, 2 float, 4 and 5 from codes alone; a rover at
    the base's height needs nothing.
    """
    quality = np.array([1, 2, 4, 5, 0, 1])
    found = wet_delay_correction(fixes_above([100.0] * 5 + [0.0], quality), BASE, ring(6))
    down = found.correction_ned[:, 2]
    assert down[0] == down[1] < -0.008
    np.testing.assert_array_equal(down[2:5], 0.0)
    np.testing.assert_array_equal(found.cov_ned[2:5], 0.0)
    assert abs(down[5]) < 1e-6
    assert found.cov_ned[1, 2, 2] == pytest.approx(found.cov_ned[0, 2, 2] + down[0] ** 2)
    higher = wet_delay_correction(fixes_above([-100.0]), BASE, ring(1))
    assert higher.correction_ned[0, 2] == pytest.approx(-down[0], rel=0.1)
    assert np.isnan(wet_delay_correction(fixes_above([0.5]), BASE, ring(1)).height_per_metre)


def test_known_weather_has_the_smaller_uncertainty():
    """Oracle: the standard deviations that go with both."""
    standard = wet_delay_correction(fixes_above([100.0]), BASE, ring(1))
    measured = wet_delay_correction(
        fixes_above([100.0]), BASE, ring(1), Atmosphere(960.0, 12.0, 0.7)
    )
    assert measured.cov_ned[0, 2, 2] < 0.3 * standard.cov_ned[0, 2, 2]
    assert measured.correction_ned[0, 2] == pytest.approx(standard.correction_ned[0, 2], rel=0.05)


def test_wrong_input_is_refused():
    """Oracle: limits of the air, and a sky of three satellites."""
    with pytest.raises(
        InputError, match=r"atmosphere\.humidity: 70 is outside 0 to 1; check its unit"
    ):
        Atmosphere(1013.0, 15.0, 70.0)
    with pytest.raises(InputError, match=r"atmosphere\.pressure_hpa: 101325"):
        Atmosphere(101325.0, 15.0, 0.7)
    with pytest.raises(InputError, match=r"atmosphere\.sd_humidity: 10"):
        Atmosphere(1013.0, 15.0, 0.7, sd_humidity=10.0)
    few = ring(2)
    few = Sky(
        *(getattr(few, name)[:10] for name in ("epoch", "azimuth", "elevation", "system", "weight"))
    )
    with pytest.raises(
        DataError, match=r"1 positions, the first at 1001\.000 s, have too few satellites"
    ):
        wet_delay_correction(fixes_above([10.0, 10.0]), BASE, few)


@pytest.fixture(scope="module")
def simulated():
    place = DATA / "rinex_sim_6min"
    if not place.is_dir():
        pytest.skip("the recording rinex_sim_6min is not here")
    navigation = read_navigation([place / "brdc.18n", place / "brdc.18g"])
    return (
        read_observations(place / "rover.18o"),
        read_observations(place / "base.18o"),
        navigation,
        np.load(place / "truth.npz"),
    )


def undifferenced(observations, place, codes, stamps, navigation):
    """Phases less the true range, m, NaN where missing: (bands, satellites, stamps)."""
    states = emission_states(
        navigation,
        observations.satellite,
        observations.time[observations.epoch],
        code_ranges(observations),
    )
    modelled = ranges(states.position, place[observations.epoch])[0] - LIGHT * states.clock_s
    time = np.round(observations.time[observations.epoch], 3)
    out = np.full((2, len(codes), stamps.size), np.nan)
    for k, code in enumerate(codes):
        rows = np.flatnonzero((observations.satellite == code) & np.isin(time, stamps))
        columns = [observations.column(name) for name in PHASES[code[0]]]
        phases = (
            observations.values[np.ix_(rows, columns)] * wavelengths(code, navigation)
            - modelled[rows, None]
        )
        out[:, k, np.searchsorted(stamps, time[rows])] = phases.T
    return out


def single_differences(rover, base, navigation, truth):
    """Codes and stamps (s), rover minus base less the true range, m, whole cycles of slips put
    back: (bands, satellites, s).
    """
    stamps = np.intersect1d(np.round(rover.time, 3), np.round(base.time, 3))
    codes = [str(code) for code in np.intersect1d(rover.satellite, base.satellite)]
    standing = np.tile(truth["rb"], (base.time.size, 1))
    out = undifferenced(rover, truth["xyz"], codes, stamps, navigation) - undifferenced(
        base, standing, codes, stamps, navigation
    )
    seen = np.isfinite(out).all(axis=0).mean(axis=1) > 0.95
    codes, out = [code for code, there in zip(codes, seen, strict=True) if there], out[:, seen]
    for series in out.reshape(-1, stamps.size):
        series -= series[np.isfinite(series)][0]
    out -= np.nanmedian(out, axis=1, keepdims=True)
    for k, code in enumerate(codes):
        for band, length in enumerate(wavelengths(code, navigation)):
            there = np.isfinite(out[band, k])
            steps = np.diff(out[band, k, there], prepend=out[band, k, there][0])
            out[band, k, there] -= np.cumsum(np.round(steps / length)) * length
    return codes, stamps, out


def wavelengths(code, navigation):
    channel = navigation.channels().get(str(code), 0)
    return np.array(
        [LIGHT / (HERTZ[code[0]][band] + CHANNEL_HERTZ[band] * channel) for band in "12"]
    )


def test_height_bias_of_a_climb_goes_away(simulated):
    """Oracle: truth of a flight simulated by others with a wet and a dry troposphere; rover minus
    base phases, ambiguities of the ground.

    The phases' errors, correlated over 20 s, leave 3 mm to the mean height over the 43 s aloft.
    """
    rover, base, navigation, truth = simulated
    codes, stamps, phases = single_differences(rover, base, navigation, truth)
    assert len(codes) >= 16
    lat, lon, height = ecef_to_geodetic(truth["xyz"][np.searchsorted(truth["tow"], stamps - 0.05)])
    rise = height - ecef_to_geodetic(truth["rb"])[2]
    states = satellite_states(navigation, codes, np.full(len(codes), stamps[180]))
    azimuth, elevation = sky(ranges(states.position, truth["rb"])[1], truth["rb"])
    system = np.array([code[0] == "R" for code in codes]).astype(int)
    rows = (
        np.tile(values, rise.size) for values in (azimuth, elevation, system, np.ones(len(codes)))
    )
    satellites = Sky(np.repeat(np.arange(rise.size), len(codes)), *rows)
    fixes = GnssFixes(stamps, lat, lon, height, np.tile(1e-4 * np.eye(3), (rise.size, 1, 1)))
    found = wet_delay_correction(fixes, truth["rb"], satellites)
    residual = phases.mean(axis=0) + mapping(elevation)[:, None] * engine_layer(
        rise, lat[0], height[0] - rise[0]
    )
    ground, aloft = rise < 10.0, rise > 90.0
    moved = np.nanmean(residual[:, aloft], axis=1) - np.nanmean(residual[:, ground], axis=1)
    root = 1.0 / np.sqrt(1.0 + 1.0 / np.sin(elevation) ** 2)
    clocks = [system == 0, system == 1]
    zenith = np.linalg.lstsq(
        root[:, None] * np.column_stack([mapping(elevation), *clocks]), root * moved, rcond=None
    )[0][0]
    cos = np.cos(elevation)
    A = np.column_stack(
        [-cos * np.cos(azimuth), -cos * np.sin(azimuth), np.sin(elevation), *clocks]
    )
    down = np.linalg.lstsq(root[:, None] * A, root * moved, rcond=None)[0][2]

    def between(values):
        return values[aloft].mean() - values[ground].mean()

    assert zenith == pytest.approx(between(found.zenith_m), abs=1.5e-3)
    assert down > 0.010
    assert abs(down + between(found.correction_ned[:, 2])) < 0.007


def test_common_satellites_are_those_of_both(simulated):
    """Oracle: satellites read by eye from the files: a base without a satellite takes it from the
    rover's sky.
    """
    rover, base, navigation, truth = simulated
    lat, lon, height = ecef_to_geodetic(truth["xyz"][::100])
    fixes = GnssFixes(
        truth["tow"][::100],
        lat,
        lon,
        height,
        np.tile(1e-4 * np.eye(3), (lat.size, 1, 1)),
        gps_week=rover.gps_week,
    )
    both = common_sky(rover, base, navigation, fixes)
    keep = base.satellite != "G17"
    fewer = replace(
        base,
        epoch=base.epoch[keep],
        satellite=base.satellite[keep],
        values=base.values[keep],
        loss_of_lock=base.loss_of_lock[keep],
    )
    without = common_sky(rover, fewer, navigation, fixes)
    lost = np.bincount(both.epoch, minlength=lat.size) - np.bincount(
        without.epoch, minlength=lat.size
    )
    assert set(np.unique(lost)) <= {0, 1}
    assert lost.mean() > 0.9
    assert both.elevation.min() >= np.radians(15.0)
    assert set(both.system) == {0}  # GPS, on both bands
    assert set(both.weight) == {2.0}
    other_week = replace(fixes, gps_week=rover.gps_week + 1, time=fixes.time - WEEK_S)
    np.testing.assert_array_equal(
        common_sky(rover, base, navigation, other_week).elevation, both.elevation
    )
    with pytest.raises(InputError, match="are not at epochs of the rover"):
        common_sky(rover, base, navigation, replace(fixes, time=fixes.time + 0.05))


def test_satellites_and_weights_follow_the_options(simulated):
    """Oracle: both systems are in the file on two bands; the engine's factor of GLONASS is 1.5 in
    the standard deviation.
    """
    rover, base, navigation, truth = simulated
    lat, lon, height = ecef_to_geodetic(truth["xyz"][::300])
    fixes = GnssFixes(
        truth["tow"][::300],
        lat,
        lon,
        height,
        np.tile(1e-4 * np.eye(3), (lat.size, 1, 1)),
        gps_week=rover.gps_week,
    )
    both = common_sky(
        rover, base, navigation, fixes, EngineOptions(rtklib_options={"pos2-gloarmode": "1"})
    )
    assert set(both.system) == {0, 1}
    np.testing.assert_allclose(
        both.weight, np.where(both.system == 1, 2.0 / 2.25, 2.0)
    )  # GPS before GLONASS
    one = common_sky(
        rover, base, navigation, fixes, EngineOptions(frequencies=1, elevation_mask_deg=30.0)
    )
    assert set(one.weight) == {1.0}
    assert one.elevation.min() >= np.radians(30.0)
    blind = base.values.copy()
    blind[:, base.column("L2W")] = np.nan  # a base without the second band of GPS leaves one
    assert set(common_sky(rover, replace(base, values=blind), navigation, fixes).weight) == {1.0}


@pytest.mark.parametrize(
    ("systems", "more", "carrying"),
    [
        ("GREJC", {}, "GEJC"),
        ("GREJC", {"pos2-bdsarmode": "0"}, "GEJ"),
        ("GR", {"pos2-gloarmode": "on"}, "GR"),
        ("GR", {"pos2-armode": "3"}, "GR"),  # a hold calibrates GLONASS
        ("GR", {"pos2-armode": "3", "pos2-gloarmode": "0"}, "G"),
        ("GR", {"pos2-armode": "0"}, "GR"),
        ("R", {}, "R"),
    ],
)
def test_systems_whose_ambiguities_are_integers_carry(systems, more, carrying):
    """Oracle: RTKLIB's manual on the modes of ambiguity resolution, worked out by hand."""
    assert carrying_systems(EngineOptions(systems=systems, rtklib_options=more)) == carrying


FLOWN_IN = {  # weather at the base and seeds of skies; none was looked at when the model was made
    "warm, low pressure": (Weather(pressure_hpa=940.0, temperature_c=27.0, humidity=0.8), 31),
    "cold, high pressure": (Weather(pressure_hpa=975.0, temperature_c=2.0, humidity=0.5), 44),
    "as usual": (Weather(), 73),
}


@pytest.fixture(scope="module", params=FLOWN_IN, ids=[name.split(",")[0] for name in FLOWN_IN])
def aloft(request, tmp_path_factory):
    """Four minutes about 130 m above the base with the air as the only error: its weather, and what
    the engine makes of them.
    """
    if find_spec("pyrtklib5") is None:
        pytest.skip("pyrtklib5 is not installed")
    weather, seed = FLOWN_IN[request.param]
    place = tmp_path_factory.mktemp("aloft")
    write_dataset(
        place,
        "ign8",
        4.0,
        imu_rate=20.0,
        seed=seed,
        start_in_air=True,
        raw_gnss=RawGnssOptions(weather=weather, **ONLY_AIR),
    )
    return weather, lambda systems: moved_by_the_air(place, systems)


def moved_by_the_air(place, systems):
    """Fixes (n,) of the engine, their errors (n, 3) m, north, east, down, the sky, the base."""
    rover, base, *navigation = (
        next(place.rglob(pattern)) for pattern in ("rov*o", "tr2*o", "rov*n", "rov*g")
    )
    truth = np.load(place / "truth" / "raw_gnss.npz")
    options = EngineOptions(
        base_position_m=tuple(truth["base_position"].tolist()), base_point="apc", systems=systems
    )
    observed = read_observations(rover), read_observations(base)
    run = solve(rover, base, tuple(navigation), options, place / systems, lambda _: None, observed)
    fixes = solution_of(run.rows["combined"]).fixes
    true = CubicSpline(truth["rover_time"], truth["rover_position"])(fixes.time)
    off = geodetic_to_ecef(fixes.lat, fixes.lon, fixes.height) - true
    error = np.einsum("nji,nj->ni", rotation_en(fixes.lat, fixes.lon), off)
    assert (fixes.quality == 1).mean() > 0.99
    return (
        fixes,
        error,
        common_sky(*observed, read_navigation(navigation), fixes, options),
        truth["base_position"],
    )


@pytest.mark.slow
@pytest.mark.parametrize(("systems", "tolerance"), [("G", 7e-4), ("GR", 2e-3)])
def test_the_engine_moves_as_the_model_says(aloft, systems, tolerance):
    """Oracle: simulated truth under the real engine, with air by ray tracing that shares no formula
    with the model.

    Of 15 to 40 mm the mapping and the profile leave 1 to 2 %. GLONASS is taken not to count, but
    follows the sky over four minutes (E.1).
    """
    weather, solved = aloft
    fixes, error, satellites, base = solved(systems)
    found = wet_delay_correction(
        fixes,
        base,
        satellites,
        Atmosphere(weather.pressure_hpa, weather.temperature_c, weather.humidity),
    )
    moved, rest = error.mean(axis=0), (error + found.correction_ned).mean(axis=0)
    assert moved[2] > 0.004
    assert (np.abs(rest) < tolerance).all(), (moved, rest)


@pytest.mark.slow
def test_an_unknown_weather_stays_within_its_sigma(aloft):
    """Oracle: the same truth, corrected by the standard atmosphere: three standard deviations of
    the correction's own covariance.
    """
    fixes, error, satellites, base = aloft[1]("G")
    found = wet_delay_correction(fixes, base, satellites)
    rest, sigma = (
        (error + found.correction_ned).mean(axis=0),
        np.sqrt(np.diagonal(found.cov_ned.mean(axis=0))),
    )
    assert 0.2 < sigma[2] / np.abs(found.correction_ned[:, 2].mean()) < 0.8
    assert abs(rest[2]) < 3.0 * sigma[2]
    assert abs(rest[2]) < abs(error[:, 2].mean())
