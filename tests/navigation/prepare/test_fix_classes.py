"""Covariances of an engine's positions: formula, belief, separation, and coverage of the errors of
a car in a city.
"""

from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from insgnss.base.errors import UsageError
from insgnss.geodesy.frames import LocalFrame, ecef_to_geodetic, geodetic_to_ecef, rotation_en
from insgnss.gnss.covariance_model import MODEL, CovarianceModel
from insgnss.gnss.engine.rtklib import solve
from insgnss.gnss.options import EngineOptions
from insgnss.gnss.ppk import PpkInput, solve_ppk
from insgnss.gnss.quality.solution_quality import solution_of
from insgnss.io.formats.gnss.rtklib_pos import read_pos_rows
from insgnss.navigation.prepare.fix_covariance.classes import (
    DEGRADED,
    FIXED,
    FLOAT,
    ISOLATED,
    SINGLE,
    UNSUPPORTED,
    VALIDATED,
    Separation,
    base_distance,
    calibrate,
    classes,
    confirmed_fixes,
    forward_backward,
    mark_degraded,
    outliers,
    scale_covariances,
)
from insgnss.navigation.prepare.fix_covariance.numbers import FIX_CLASSES
from insgnss.records import GnssFixes

DATA = Path(__file__).parents[4] / "shared" / "data"


def fixes_of(quality, interval=0.2, sigma=(0.005, 0.005, 0.01), offset=(0.0, 0.0, 0.0)):
    """Fixes that stand, `offset` m north, east, down of 46.5 N 6.5 E 500 m."""
    n = len(quality)
    place = geodetic_to_ecef(np.radians(46.5), np.radians(6.5), 500.0) + rotation_en(
        np.radians(46.5), np.radians(6.5)
    ) @ np.array(offset)
    lat, lon, height = (np.full(n, float(v)) for v in ecef_to_geodetic(place))
    cov = np.broadcast_to(np.diag(np.square(sigma)), (n, 3, 3))
    return GnssFixes(
        1000.0 + interval * np.arange(n),
        lat,
        lon,
        height,
        cov,
        quality=np.array(quality, dtype=np.int64),
        gps_week=2000,
    )


def test_sigmas_follow_the_formula_and_keep_the_engines_correlations():
    """Oracle: (k sigma)^2 + floor^2 + (ppm d)^2 by hand, one epoch of each class; k_i k_j cov_ij
    off the diagonal.
    """
    rng = np.random.default_rng(1)
    L = rng.normal(size=(len(FIX_CLASSES), 3, 3))
    cov = 1e-4 * (L @ np.swapaxes(L, 1, 2) + np.eye(3))
    model = MODEL.with_changes({"scale": {"fixed": (1.5, 2.0, 3.0)}, "ppm": (1.0, 2.0, 3.0)})
    distance = np.linspace(100.0, 20000.0, len(FIX_CLASSES))
    got = scale_covariances(cov, np.arange(len(FIX_CLASSES)), distance, model)
    for c, name in enumerate(FIX_CLASSES):
        for i in range(3):
            for j in range(3):
                expected = model.scale[name][i] * model.scale[name][j] * cov[c, i, j]
                if i == j:
                    expected += (
                        model.floor_m[name][i] ** 2 + (model.ppm[i] * 1e-6 * distance[c]) ** 2
                    )
                assert got[c, i, j] == pytest.approx(expected, rel=1e-12)


def test_single_fixes_among_floats_are_not_validated_and_long_runs_are():
    """Oracle: flags written by hand: 20 s fixed; then one fixed epoch in ten for 20 s."""
    quality = np.array([1] * 100 + [1 if k % 10 == 0 else 2 for k in range(100)])
    time = 0.2 * np.arange(200)
    kind = classes(time, quality, np.full(200, 12))
    assert (kind[:95] == FIXED).all()
    assert not (kind[130:] == FIXED).any()
    assert (kind[130:] == ISOLATED).all()  # more than 5 s from what is validated
    assert (kind[105:120][quality[105:120] == 2] == FLOAT).all()


def test_few_satellites_are_no_fix_however_long():
    """Oracle: flags by hand; five satellites leave one redundant double difference a band."""
    kind = classes(np.arange(60.0), np.ones(60, dtype=np.int64), np.full(60, 5))
    assert (kind == UNSUPPORTED).all()
    assert (classes(np.arange(60.0), np.ones(60, dtype=np.int64), np.full(60, 6)) == FIXED).all()


def test_a_fix_among_missing_epochs_is_not_validated():
    """Oracle: two epochs, one of them fixed, alone within ten seconds, as a car in a street has
    them; it was 13 m off.
    """
    time = np.concatenate([np.arange(60.0), [75.0, 76.0], 90.0 + np.arange(60.0)])
    quality = np.ones(time.size, dtype=np.int64)
    quality[60] = 2
    assert classes(time, quality, np.full(time.size, 6))[61] == UNSUPPORTED


def test_rare_epochs_support_each_other():
    """Oracle: a static session of 30 s interval, all fixed but one in ten."""
    quality = np.where(np.arange(120) % 10 == 4, 2, 1)
    kind = classes(30.0 * np.arange(120), quality, np.full(120, 8))
    assert (kind == np.where(quality == 1, FIXED, FLOAT)).all()


@pytest.mark.parametrize("code", [0, 2, 3, 4, 5, 7])
def test_no_class_but_fixed_has_centimetres(code):
    """Oracle: the least sigma that the class's own floor allows, 0.3 m; the engine states a
    millimetre.
    """
    fixes = fixes_of([code] * 30, sigma=(0.001, 0.001, 0.001))
    calibrated, _ = calibrate(fixes, np.full(30, 20), np.zeros(30))
    assert np.sqrt(np.diagonal(calibrated.cov_ned, axis1=1, axis2=2)).min() >= 0.3


def test_what_is_not_validated_is_handed_on_as_float():
    """Oracle: flags written by hand."""
    calibrated, kind = calibrate(
        fixes_of([2] * 50 + [1] + [2] * 50), np.full(101, 14), np.zeros(101)
    )
    assert kind[50] == ISOLATED
    assert calibrated.quality[50] == 2
    assert "0 of 1" in calibrated.notes[-1].found


def test_standard_deviations_of_zero_become_what_the_engine_cannot_write():
    """Oracle: half of the last of four decimals."""
    model = MODEL.with_changes({"floor_m": {"fixed": 0.0}, "ppm": 0.0})
    got = scale_covariances(np.zeros((1, 3, 3)), np.array([FIXED]), np.zeros(1), model)
    assert np.allclose(got[0], np.eye(3) * 5e-5**2, rtol=1e-12)


def test_two_runs_that_contradict_each_other_are_covered_and_no_longer_fixed():
    """Oracle: 0.19 m and 0.4 m between two simulated runs; their difference must lie within one
    sigma.
    """
    quality = [1] * 100
    forward, backward = fixes_of(quality), fixes_of(quality, offset=(0.19, 0.0, -0.4))
    good = forward_backward(forward.time, forward, forward)
    bad = forward_backward(forward.time, forward, backward)
    assert np.allclose(bad.ned, [0.19, 0.0, -0.4], atol=1e-4)  # the vertical turns by 3e-8 rad
    part = np.arange(100) >= 60
    mixed = Separation(np.where(part[:, None], bad.ned, good.ned), bad.cov, good.fixed)
    calibrated, kind = calibrate(forward, np.full(100, 15), np.zeros(100), mixed)
    assert (kind[:50] == FIXED).all()
    assert not np.isin(kind[60:], VALIDATED).any()
    within = np.einsum(
        "ni,nij,nj->n", mixed.ned[60:], np.linalg.inv(calibrated.cov_ned[60:]), mixed.ned[60:]
    )
    assert (within <= 1.0).all()
    assert "not 40 because forward and backward" in calibrated.notes[-1].found


def _two_runs(both, ned):
    """A separation with sigmas of metres, as of fixes beside a float run."""
    n = len(both)
    return Separation(
        np.tile(np.asarray(ned, float), (n, 1)),
        np.broadcast_to(np.diag([4.0, 8.0, 12.0]), (n, 3, 3)),
        np.asarray(both),
    )


def test_an_island_of_fixes_that_one_run_alone_has_is_not_believed():
    """Oracle: 11 fixes among 400 float epochs a second apart, 2.6 m off; the other run, float and
    2.2 m away, is within its sigmas and confirms nothing. Its difference has to be covered.
    """
    quality = np.full(400, 2)
    quality[170:181] = 1
    fixes = fixes_of(quality, 1.0)
    sep = _two_runs(np.zeros(400, bool), (0.12, 2.02, 0.94))
    assert not sep.beyond(MODEL.gate).any()
    trusted, kind = calibrate(fixes, np.full(400, 12), np.full(400, 2000.0), sep)
    assert (kind == ISOLATED).all()
    assert (trusted.quality == 2).all()
    assert np.sqrt(trusted.cov_ned[175, 1, 1]) > 2.02
    assert "11 as short spans that only one run has fixed" in trusted.notes[-1].found
    alone, kind = calibrate(fixes, np.full(400, 12), np.full(400, 2000.0))
    assert (kind == ISOLATED).all()
    assert (alone.quality == 2).all()


def test_an_island_that_both_runs_fix_or_that_minutes_surround_is_believed():
    """Oracle: by hand; five epochs of both runs, or half of the minute to either side."""
    time = np.arange(400.0)
    island = np.zeros(400, bool)
    island[170:181] = True
    nowhere = np.zeros(400, bool)
    for together, believed in ((5, True), (4, False)):
        both = nowhere.copy()
        both[170 : 170 + together] = True
        sep = _two_runs(both, (0.0, 0.0, 0.0))
        assert confirmed_fixes(time, island, sep, nowhere)[island].all() == believed
        assert not confirmed_fixes(time, island, sep, both)[island].any()
    one_alone = _two_runs(nowhere, (0.0, 0.0, 0.0))
    for length, sep, believed in (
        *((61, one_alone, True), (40, one_alone, False)),
        *((31, None, True), (20, None, False)),  # of a ready solution half of it
    ):
        run = nowhere.copy()
        run[170 : 170 + length] = True
        assert confirmed_fixes(time, run, sep, nowhere)[run].all() == believed
    beside = nowhere.copy()
    beside[190:320] = True
    assert confirmed_fixes(time, island | beside, None, nowhere)[island].all()
    assert confirmed_fixes(time, island, None, nowhere, replace(MODEL, island_s=0.0))[island].all()
    # ten fixes behind an outage are alone, however few floats are there
    late = np.append(np.arange(100.0), 700.0 + np.arange(10.0))
    fixed = late >= 700.0
    assert not confirmed_fixes(late, fixed, None, np.zeros(110, bool)).any()
    # a recording of half a minute that is fixed throughout, and one of 30 s an epoch
    short = np.ones(30, bool)
    assert confirmed_fixes(np.arange(30.0), short, None, ~short).all()
    assert confirmed_fixes(30.0 * np.arange(30.0), short, None, ~short).all()


@pytest.mark.slow
@pytest.mark.parametrize("base", ["rt.base-20181004-1452.obs", "glw1277p.18o"])
def test_no_island_of_a_walking_single_frequency_receiver_is_believed(tmp_path, base):
    """Oracle: the receiver's own RTK solution (NAV-SOL, where it claims 3 cm): every fix that was
    validated before was 2.6 to 7 m off.
    """
    if find_spec("pyrtklib5") is None:
        pytest.skip("pyrtklib5 is not installed")
    place = DATA / "rinex_ublox_2018"
    if not place.is_dir():
        pytest.skip("the recording rinex_ublox_2018 is not here")
    given = PpkInput(
        place / "rover-20181004-1532.obs",
        place / base,
        (place / "glw1277p.18n", place / "glw1277p.18g"),
        EngineOptions(frequencies=1),
        events=False,
    )
    result = solve_ppk(given, tmp_path)
    assert not np.isin(result.series["kind"], VALIDATED).any()
    assert "poor: 0.0 % of 1180 epochs are fixed and confirmed" in result.verdict
    assert np.sqrt(np.diagonal(result.fixes.cov_ned, axis1=1, axis2=2)).min() > 0.25


def test_a_single_fix_beside_the_path_is_covered_and_its_neighbours_stay():
    """Oracle: a fix 13 m too high among fixes that stand, at 1 Hz, as one of a car in a city; the
    limit is 5 m.
    """
    fixes = fixes_of([1] * 60, interval=1.0)
    height = fixes.height.copy()
    height[30] += 13.0
    calibrated, kind = calibrate(replace(fixes, height=height), np.full(60, 15), np.zeros(60))
    assert np.flatnonzero(kind != FIXED).tolist() == [30]
    assert np.sqrt(calibrated.cov_ned[30, 2, 2]) >= 13.0
    assert "not 1 because they are outliers from the path" in calibrated.notes[-1].found


def test_what_a_drone_flies_is_on_its_path():
    """Oracle: a turn of 10 m/s and 15 m radius, 6.7 m/s^2, at 1, 5 and 10 Hz."""
    frame = LocalFrame(np.radians(46.5), np.radians(6.5), 500.0)
    for interval in (0.1, 0.2, 1.0):
        time = interval * np.arange(200)
        place = np.column_stack(
            [15.0 * np.cos(time / 1.5), 15.0 * np.sin(time / 1.5), np.zeros(200)]
        )
        lat, lon, height = frame.geodetic_from_position(place)
        cov = np.broadcast_to(np.eye(3) * 1e-6, (200, 3, 3))
        fixes = GnssFixes(time, lat, lon, height, cov, quality=np.ones(200, dtype=np.int64))
        assert not outliers(fixes, np.ones(200, dtype=bool), cov)[1].any()


def test_separation_is_unknown_where_a_run_has_no_epoch():
    """Oracle: epochs taken out by hand."""
    forward = fixes_of([1] * 10)
    fewer = GnssFixes(
        forward.time[5:], forward.lat[5:], forward.lon[5:], forward.height[5:], forward.cov_ned[5:]
    )
    separation = forward_backward(forward.time, forward, fewer)
    assert np.isnan(separation.ned[:5]).all()
    assert np.isfinite(separation.ned[5:]).all()
    assert not separation.beyond(MODEL.gate).any()


def test_fixes_of_minutes_with_many_floats_are_degraded():
    """Oracle: the share counted epoch by epoch; 25 minutes at 1 Hz, of which 5 in the middle have 8
    s float of 20.
    """
    time = np.arange(1500.0)
    quality = np.where((time // 300 == 2) & (time % 20 < 8), 2, 1)
    before = classes(time, quality, np.full(1500, 14))
    kind = mark_degraded(time, before)
    for k in range(0, 1500, 7):
        near = np.abs(time - time[k]) <= 180.0
        share = (before[near] == FIXED).mean()
        assert kind[k] == (DEGRADED if before[k] == FIXED and share < 0.9 else before[k])
    assert (kind[:450] == FIXED).all()
    assert (kind[1050:] == FIXED).all()
    assert set(kind[600:900].tolist()) == {DEGRADED, FLOAT}


def test_scattered_floats_and_short_runs_hamper_nothing():
    """Oracle: flags written by hand: one float in twenty for ten minutes; ten fixed epochs and no
    more; the same with three floats.
    """
    quality = np.where(np.arange(6000) % 20 == 7, 2, 1)
    assert not (
        mark_degraded(0.1 * np.arange(6000), classes(0.1 * np.arange(6000), quality, None))
        == DEGRADED
    ).any()
    _, kind = calibrate(fixes_of([1] * 10), None, np.zeros(10))
    assert (kind == FIXED).all()
    _, kind = calibrate(fixes_of([1] * 5 + [2] * 3 + [1] * 5), None, np.zeros(13))
    assert (kind == np.where(np.isin(np.arange(13), [5, 6, 7]), FLOAT, DEGRADED)).all()


def test_floats_before_the_first_and_after_the_last_fix_hamper_nothing():
    """Oracle: flags written by hand: 20 minutes at 5 Hz, the first 150 s and the last 200 s float;
    then 150 s in the middle.
    """
    time = 0.2 * np.arange(6000)
    ends = np.where((time < 150.0) | (time >= 1000.0), 2, 1)
    kind = mark_degraded(time, classes(time, ends, np.full(6000, 14)))
    assert (kind[ends == 1] == FIXED).all()
    middle = np.where((time >= 500.0) & (time < 650.0), 2, 1)
    kind = mark_degraded(time, classes(time, middle, np.full(6000, 14)))
    near = (middle == 1) & (time > 450.0) & (time < 700.0)
    assert (kind[near] == DEGRADED).all()
    assert (mark_degraded(time, np.full(6000, FLOAT)) == FLOAT).all()


def test_degraded_fixes_stay_fixed_with_sigmas_of_centimetres():
    """Oracle: (V.1) by hand of k = 4, 25, 25, 40 mm and 1 ppm of 5 km; the quality handed on; and a
    share of 0, which names none.
    """
    quality = np.repeat([1, 2, 1], 100)
    fixes, there = fixes_of(quality), quality == 1
    calibrated, kind = calibrate(fixes, np.full(300, 14), np.full(300, 5000.0))
    assert (kind[there] == DEGRADED).all()
    assert (calibrated.quality == fixes.quality).all()
    sigma = np.sqrt(np.diagonal(calibrated.cov_ned[there], axis1=1, axis2=2))
    assert np.allclose(
        sigma,
        np.sqrt([20.0**2 + 25.0**2 + 5.0**2] * 2 + [40.0**2 + 40.0**2 + 5.0**2]) * 1e-3,
        rtol=1e-9,
    )
    assert "200 of the validated are degraded" in calibrated.notes[-1].found
    assert calibrated.notes[-1].verdict == "note"
    plain, kind = calibrate(
        fixes, np.full(300, 14), np.full(300, 5000.0), None, replace(MODEL, degraded_share=0.0)
    )
    assert (kind[there] == FIXED).all()
    assert np.sqrt(np.diagonal(plain.cov_ned[there], axis1=1, axis2=2)).max() < 0.015
    assert plain.notes[-1].verdict == "ok"


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize(("share", "outlier"), [(0.97, False), (1.03, True)])
def test_a_vehicle_that_turns_as_hard_as_it_can_is_no_outlier(axis, share, outlier):
    """Oracle: uniform acceleration a from rest, x = a t^2 / 2, whose chord lies a T1 T2 / 2 away.

    Three fixes 0.2 and 0.5 s apart with sigmas of 0.01 mm: 3 % less than the model's acceleration
    is a turn, 3 % more an outlier (V.4). And at rest: 3 sigma of the difference, by hand.
    """
    time = np.array([0.0, 0.2, 0.7])

    def middle_is_outlier(offset_m, sigma_m):
        fixes = fixes_of([1, 1, 1])
        moved = [fixes_of([1], offset=np.eye(3)[axis] * off) for off in offset_m]
        place = {
            name: np.concatenate([getattr(fix, name) for fix in moved])
            for name in ("lat", "lon", "height")
        }
        fixes = replace(fixes, time=1000.0 + time, **place)
        return bool(
            outliers(fixes, np.ones(3, dtype=bool), np.tile(np.eye(3) * sigma_m**2, (3, 1, 1)))[1][
                1
            ]
        )

    acceleration = share * MODEL.acceleration_mps2[axis]
    assert middle_is_outlier(0.5 * acceleration * time**2, 1e-5) == outlier
    sigma = np.sqrt(1.0 + (5.0 / 7.0) ** 2 + (2.0 / 7.0) ** 2)
    allowed = 0.5 * MODEL.acceleration_mps2[axis] * 0.2 * 0.5 + 3.0 * 0.1 * sigma
    assert middle_is_outlier([0.0, share * allowed, 0.0], 0.1) == outlier


def test_an_outlier_among_degraded_fixes_is_found_as_among_others():
    """Oracle: a fix 0.2 m to the east at 5 Hz; with sigmas of fixed epochs (V.4) allows 0.09 m,
    with those of degraded ones 0.33 m.
    """
    fixes = fixes_of([1] * 60 + [2] * 60 + [1] * 60, sigma=(0.02, 0.02, 0.04))
    moved = fixes_of([1], offset=(0.0, 0.2, 0.0))
    lon = fixes.lon.copy()
    lon[30] = moved.lon[0]
    model = replace(MODEL, acceleration_mps2=(1.0, 1.0, 1.0))
    _, kind = calibrate(replace(fixes, lon=lon), np.full(180, 15), np.zeros(180), None, model)
    assert np.flatnonzero(kind[:60] != DEGRADED).tolist() == [30]


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"scale": {"fixed": (1.0, -1.0, 1.0)}}, "scale.fixed"),
        ({"floor_m": {"float": (1.0, 2.0)}}, "floor_m.float"),
        ({"scale": {"flaot": 1.0}}, "flaot"),
        ({"pmm": 1.0}, "pmm"),
        ({"ppm": (np.inf, 1.0, 1.0)}, "ppm"),
        ({"support_share": 50}, "support_share"),
        ({"least_satellites": 1}, "least_satellites"),
        ({"degraded_share": 1.5}, "degraded_share"),
        ({"degraded_s": -1.0}, "degraded_s"),
    ],
)
def test_wrong_numbers_are_refused_by_name(changes, word):
    """Oracle: the model's own bounds."""
    with pytest.raises(UsageError, match=word):
        CovarianceModel().with_changes(changes)


def errors_of(fixes, reference):
    """Errors (n, 3) m, north, east, down, against rows of time, week, latitude, longitude, height;
    and (n,) where there is a row.
    """
    row = np.clip(np.searchsorted(reference[:, 0], fixes.time - 1e-3), 0, len(reference) - 1)
    apart = geodetic_to_ecef(fixes.lat, fixes.lon, fixes.height)
    apart -= geodetic_to_ecef(*np.radians(reference[row, 2:4]).T, reference[row, 4])
    return (
        np.einsum("nji,nj->ni", rotation_en(fixes.lat, fixes.lon), apart),
        np.abs(reference[row, 0] - fixes.time) < 2e-3,
    )


def driven(name):
    """Errors (n, 3) m, calibrated covariances, classes, and the engine's flags of a car in Nagoya
    as the solution `name` has it.
    """
    place = DATA / "matrtklib" / "kinematic"
    if not place.is_dir():
        pytest.skip("the recording matrtklib is not here")
    solution = solution_of(read_pos_rows(place / name))
    fixes = solution.fixes
    lat, lon, height = np.loadtxt(place / "base_position.txt")
    distance = base_distance(fixes, geodetic_to_ecef(np.radians(lat), np.radians(lon), height))
    calibrated, kind = calibrate(fixes, solution.satellites, distance)
    error, there = errors_of(fixes, np.loadtxt(place / "reference.csv", delimiter=",", skiprows=1))
    return error[there], calibrated.cov_ned[there], kind[there], fixes.quality[there]


@pytest.fixture(scope="module")
def car():
    """The solution at 5 Hz."""
    return driven("rover_rtk.pos")


def test_wrong_fixes_of_a_car_in_a_city_are_not_validated(car):
    """Oracle: an Applanix reference; 108 of 1793 fixed epochs are off by more than 0.3 m (0.4 m in
    height).
    """
    error, _, kind, quality = car
    wrong = (np.hypot(error[:, 0], error[:, 1]) > 0.3) | (np.abs(error[:, 2]) > 0.4)
    fixed, validated = quality == 1, np.isin(kind, VALIDATED)
    assert (wrong & fixed).sum() > 100
    assert not (wrong & validated).any()
    assert validated.sum() > 0.8 * (fixed & ~wrong).sum()  # what the validation costs


def beyond_three_sigma(error, cov):
    """(n,) where an error is beyond on any axis."""
    return (np.abs(error) > 3.0 * np.sqrt(np.diagonal(cov, axis1=1, axis2=2))).any(axis=1)


def test_calibrated_sigmas_cover_the_errors_of_a_car_in_a_city(car):
    """Oracle: an Applanix reference, taken as exact, no datum removed: at most 2 % of the epochs
    lie beyond three sigma on any axis.

    All of the drive, each half, and the validated fixes by themselves; whose sigmas are not far
    larger than the errors (mean square 0.5).
    """
    error, cov, kind, _ = car
    beyond, half = beyond_three_sigma(error, cov), 2 * np.arange(len(error)) // len(error)
    validated = np.isin(kind, VALIDATED)
    for part in (half >= 0, half == 0, half == 1, validated):
        assert beyond[part].mean() < 0.02
    square = np.einsum("ni,nij,nj->n", error, np.linalg.inv(cov), error)[validated] / 3.0
    assert 0.5 < square.mean() < 2.0


def test_a_second_solution_of_the_drive_is_covered():
    """Oracle: the same reference; other options, 1 Hz: integers of each epoch by itself, above 30
    degrees. It chose no number.
    """
    error, cov, kind, _ = driven("rover_1Hz_rtk.pos")
    assert np.isin(kind, VALIDATED).sum() > 100
    assert beyond_three_sigma(error, cov).mean() < 0.02


@pytest.mark.slow
def test_fixes_under_an_open_sky_keep_the_engines_sigmas(tmp_path):
    """Oracle: published coordinates of a standing antenna, solved as moving, 5.3 km from its base.

    None is degraded, and errors of 1 to 3 mm lie within the sigmas, of which 5 mm are for the
    distance.
    """
    if find_spec("pyrtklib5") is None:
        pytest.skip("pyrtklib5 is not installed")
    place, base = DATA / "cssrlib_rtk", (-3959400.631, 3385704.533, 3667523.111)
    if not place.is_dir():
        pytest.skip("the recording cssrlib_rtk is not here")
    files = [place / name for name in ("SEPT078M1.21O", "3034078M1.21O", "SEPT078M.21P")]
    run = solve(
        files[0],
        files[1],
        files[2:],
        EngineOptions(base_position_m=base, base_point="apc"),
        tmp_path,
    )
    solution = solution_of(run.rows["combined"])
    fixes, kind = calibrate(
        solution.fixes, solution.satellites, base_distance(solution.fixes, base)
    )
    assert (kind == FIXED).all()
    error = geodetic_to_ecef(fixes.lat, fixes.lon, fixes.height) - np.array(
        [-3962108.673, 3381309.574, 3668678.638]
    )
    error = np.einsum("nji,nj->ni", rotation_en(fixes.lat, fixes.lon), error)
    assert not beyond_three_sigma(error, fixes.cov_ned).any()
    assert np.sqrt(np.diagonal(fixes.cov_ned, axis1=1, axis2=2)).max() < 0.015


def test_classes_of_what_is_unknown_or_single():
    """Oracle: the table of RTKLIB's codes."""
    assert (classes(np.arange(3.0), np.array([0, 5, 7]), None) == SINGLE).all()
