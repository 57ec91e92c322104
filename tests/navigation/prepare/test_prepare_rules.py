"""The limits of what prepares a recording, each on either side or in closed form."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from insgnss.navigation.prepare import static_recording, stationarity
from insgnss.navigation.prepare.calibration import TriadCalibration
from insgnss.navigation.prepare.dead_band import DeadBand, dead_band_of
from insgnss.navigation.prepare.gaps import bridged_variance, find_gaps, in_bunches
from insgnss.navigation.prepare.several_imus import combine, parity
from insgnss.navigation.prepare.several_imus.parity import _robust_matrix, _slow, _spikes, _vote
from insgnss.navigation.prepare.stuck_channels import _shortest, constant_runs, dead_band
from insgnss.records import GnssFixes, ImuSamples

G = 9.80665


def imu_of(gyro, accel=None, h=0.01, **more) -> ImuSamples:
    gyro = np.asarray(gyro, dtype=np.float64)
    n = len(gyro)
    accel = np.tile([0.0, 0.0, -G], (n, 1)) if accel is None else accel
    return ImuSamples(h * np.arange(n), gyro, accel, **more)


def test_a_bridge_is_as_far_off_as_in_the_minute_around_it() -> None:
    """Oracle: (G.1) by hand: a gyro that alternates for 30 s on either side of a gap, and does
    not move before and after; farther away nothing counts."""
    t = 0.1 * np.arange(2000)
    wide = np.where(np.abs(t - 100.0) < 16.0, 1.0, 3.0)
    sway = np.where(np.abs(t - 100.0) < 31.0, wide * np.sin(2.0 * np.pi * t / 0.8), 0.0)
    gyro = np.zeros((2000, 3))
    gyro[:, 0] = sway
    marks = np.array([0.0, 99.9, 100.3, 199.0])
    keep = (t < 99.95) | (t > 100.25)
    imu = ImuSamples(t[keep], gyro[keep], np.zeros((keep.sum(), 3)))
    gaps = find_gaps(imu.time, 0.1)
    assert_allclose(gaps, [(99.9, 0.4)])
    got = bridged_variance(imu, np.eye(3), gaps, marks)
    k = 4
    j = np.arange(2000 - k)
    miss = 0.5 * (sway[j] + sway[j + k]) * 0.4 - 0.1 * np.array(
        [sway[i + 1 : i + k + 1].sum() for i in j]
    )
    near = (t[j] >= 69.9) & (t[j] < 130.3 - 0.4) & (np.abs(t[j] - 99.9) > 0.45)
    assert got[2, 0] == pytest.approx(np.mean(miss[near] ** 2), rel=0.1)
    assert got[[0, 1, 3]].max() < 1e-12
    assert not got[:, 1:].any()
    other = bridged_variance(imu, np.diag([-1.0, 1.0, -1.0]), gaps, np.array([0.0, 100.0, 199.0]))
    assert_allclose(other[1:, 0], got[2, 0] * np.array([0.25, 0.75]), rtol=1e-9)


def test_pauses_do_not_count_in_the_mean_interval() -> None:
    """Oracle: by hand: steps up to 10 s, or three usual ones where these are longer."""
    step = np.array([1.0] * 8 + [9.9, 10.1])
    assert in_bunches(np.concatenate([[0.0], np.cumsum(step)]), 0.1).endswith(
        f", mean {17.9 / 9:.3g} s"
    )
    step = np.array([5.0] * 8 + [14.9, 15.1])
    assert in_bunches(np.concatenate([[0.0], np.cumsum(step)]), 0.1).endswith(
        f", mean {54.9 / 9:.3g} s"
    )


@pytest.mark.parametrize(("inside", "found"), [(9, False), (11, True)])
def test_a_dead_band(inside, found) -> None:
    """Oracle: (D.1) by hand: one number in a tenth of the samples, the nearest other one, runs of
    that number weighed by their lengths."""
    column = np.linspace(0.5, 1.0, 100)
    column[:4], column[50 : 46 + inside] = 0.0, 0.0
    band = dead_band_of(column, 0.2)
    assert (band is not None) == found
    if band is not None:
        assert band.half_width == pytest.approx(column[column > 0.0].min())
        assert band.share == pytest.approx(0.11)
        assert band.duration_s == pytest.approx(0.2 * (16 + 49) / 11)
        assert band.sigma == pytest.approx(band.half_width / math.sqrt(3.0))


def test_a_dead_band_counts_beside_white_noise() -> None:
    """Oracle: by hand: 2 sigma^2 T against three tenths of the white noise's power; a run of more
    than a minute is a stand."""
    band = DeadBand(math.sqrt(3.0) * 0.01, 0.5, 2.0)  # 4e-4 rad^2/s
    assert band.counts(math.sqrt(4e-4 / 0.31))
    assert not band.counts(math.sqrt(4e-4 / 0.29))
    column = np.concatenate([np.zeros(100), [1.0], np.zeros(20)])
    assert dead_band_of(column, 1.0).duration_s == pytest.approx((3600 + 400) / 80)


def test_runs_of_one_value() -> None:
    """Oracle: itertools, run by run."""
    from itertools import groupby

    rng = np.random.default_rng(3)
    column = np.repeat(rng.integers(0, 3, 200).astype(float), rng.integers(1, 15, 200))
    for shortest in (5, 8, 20):
        expected, at = [], 0
        for _, run in groupby(column.tolist()):
            n = len(list(run))
            expected += [(at, at + n - 1)] if n >= shortest else []
            at += n
        assert constant_runs(column, shortest) == expected


@pytest.mark.parametrize(
    ("zeros", "rate", "band"),
    [(2, 0.06, True), (1, 0.06, False), (0, 0.049, True), (0, 0.06, False)],
)
def test_zeros_of_a_gyro_that_hardly_turns(zeros, rate, band) -> None:
    """Oracle: by hand: zero in one of a hundred other samples, or while all turn below 0.05."""
    gyro = np.full((150, 3), 0.3)
    gyro[10:40], gyro[10:40, 1] = 0.0, rate
    gyro[100 : 100 + zeros, 0] = 0.0
    assert dead_band(imu_of(gyro), 0, 10, 39) is band
    gyro[10:40, 0] = 1e-6
    assert not dead_band(imu_of(gyro), 0, 10, 39)


def test_the_shortest_run_that_chance_does_not_make() -> None:
    """Oracle: by hand: 20 samples, a fifth of a second, three times log n / log(1 / p)."""
    assert _shortest(np.arange(1000.0), 0.1) == 20
    assert _shortest(np.arange(1000.0), 0.001) == 200
    half = np.repeat(np.arange(500.0), 2)
    expected = 3.0 * math.log(1000) / math.log(999 / 500)
    assert _shortest(half, 0.1) == int(max(20, expected)) == 29


def fixes(speed=0.0, sigma_m=0.02, sigma_ms=None, n=11) -> GnssFixes:
    t = np.arange(float(n))
    cov = np.broadcast_to(sigma_m**2 * np.eye(3), (n, 3, 3))
    velocity = None if sigma_ms is None else np.tile([speed, 0.0, 0.0], (n, 1))
    of_velocity = None if sigma_ms is None else np.broadcast_to(sigma_ms**2 * np.eye(3), (n, 3, 3))
    north = 0.0 if velocity is not None else speed
    lat = 0.8 + north * t / 6367000.0
    return GnssFixes(t, lat, 0.1 + 0.0 * t, 50.0 + 0.0 * t, cov, velocity, of_velocity)


@pytest.mark.parametrize(
    ("changes", "seen"),
    [
        ({}, "CONFIRMED"),
        ({"sigma_m": 0.71}, "UNKNOWN"),  # 3 sqrt 2 sigma over two seconds are 1.5 m/s
        ({"sigma_m": 0.70}, "CONFIRMED"),
        ({"sigma_m": 0.0, "speed": 0.099}, "CONFIRMED"),
        ({"sigma_m": 0.0, "speed": 0.101}, "MOVING"),
        ({"sigma_m": 0.1, "speed": 0.31}, "CONFIRMED"),  # 3 sigma sqrt 2 / 2 and 0.1
        ({"sigma_m": 0.1, "speed": 0.32}, "MOVING"),
        ({"sigma_m": 9.0, "sigma_ms": 0.49}, "CONFIRMED"),
        ({"sigma_m": 9.0, "sigma_ms": 0.51}, "UNKNOWN"),
        ({"sigma_m": 9.0, "sigma_ms": 0.1, "speed": 0.39}, "CONFIRMED"),
        ({"sigma_m": 9.0, "sigma_ms": 0.1, "speed": 0.41}, "MOVING"),
    ],
)
def test_what_fixes_say_of_a_stand(changes, seen) -> None:
    """Oracle: by hand: 0.1 m/s and three sigmas; of use where these are below 1.5 m/s."""
    got = stationarity._seen_by_gnss(fixes(**changes), np.array([2.0]), np.array([4.0]))
    assert got[0] == getattr(stationarity, seen)


def test_where_fixes_cover_a_window() -> None:
    """Oracle: by hand: fixes on both sides, no longer apart than 2.5 intervals in between."""
    time = np.array([0.0, 1.0, 2.0, 4.4, 5.4, 8.0, 9.0])
    begin, end = np.array([-0.5, 0.5, 2.5, 4.5, 5.5, 8.2]), np.array([0.5, 1.5, 4.0, 5.0, 7.0, 9.5])
    covered = stationarity._windows_between_fixes(time, begin, end)
    assert covered.tolist() == [False, True, True, True, False, False]


def quiet_windows(gyro, accel, seen) -> np.ndarray:
    """Which windows of ten blocks of so much scatter, gyro and accelerometer, are stationary."""
    rng = np.random.default_rng(1)
    n = len(gyro)
    unit = rng.normal(size=(n, 100, 6))
    unit = (unit - unit.mean(axis=1, keepdims=True)) / unit.std(axis=1, keepdims=True)
    scale = np.concatenate([np.repeat(np.asarray(s)[:, None], 3, axis=1) for s in (gyro, accel)], 1)
    values = (unit * scale[:, None]).reshape(-1, 6) + [0.0, 0.0, 0.0, 0.0, 0.0, -G]
    imu = ImuSamples(0.001 * np.arange(len(values)), values[:, :3], values[:, 3:])
    sums = stationarity._block_sums(imu)
    count = sums.count.size
    lo = np.arange(0, count - 9, 10)
    return stationarity._quiet(
        sums, lo, lo + 10, np.ones(lo.size, bool), np.asarray(seen)[: lo.size]
    )


@pytest.mark.parametrize(
    ("confirmed", "times", "quiet"),
    [(False, 2.9, True), (False, 3.1, False), (True, 4.9, True), (True, 5.1, False)],
)
@pytest.mark.parametrize("sensor", ["gyro", "accel"])
def test_how_noisy_a_stand_may_be(sensor, confirmed, times, quiet) -> None:
    """Oracle: by hand: three times the quietest ten seconds, five where GNSS confirms it."""
    size = np.ones(200)
    size[150:160] = times
    gyro, accel = np.full(200, 1e-3), np.full(200, 0.02)
    (gyro if sensor == "gyro" else accel)[:] *= size
    seen = np.full(20, stationarity.CONFIRMED if confirmed else stationarity.UNKNOWN, dtype=np.int8)
    assert quiet_windows(gyro, accel, seen)[15] == quiet


@pytest.mark.parametrize(
    ("gyro", "accel", "quiet"),
    [(0.0195, 0.02, True), (0.0205, 0.02, False), (1e-3, 0.29, True), (1e-3, 0.31, False)],
)
def test_no_sensor_is_noisier_at_rest(gyro, accel, quiet) -> None:
    """Oracle: 0.02 rad/s and 0.3 m/s^2 by hand, for the whole of a recording."""
    seen = np.zeros(20, dtype=np.int8)
    assert quiet_windows(np.full(100, gyro), np.full(100, accel), seen).all() == quiet


@pytest.mark.parametrize(
    ("scatter", "verdict"), [(1.6, None), (1.4, "note"), (0.55, "note"), (0.45, "contradiction")]
)
def test_the_rounding_of_a_channel(scatter, verdict) -> None:
    """Oracle: by hand: 1.5 steps of the resolution are fine, half of one hides the noise."""
    rng = np.random.default_rng(2)
    column = np.rint(rng.normal(0.0, math.sqrt(max(scatter**2 - 1.0 / 12.0, 0.0)), 20000))
    column *= scatter / np.sqrt(np.median(column.reshape(-1, 100).var(axis=1)))
    checks = static_recording._channels([("gyro x", column)], 100.0)
    found = [check.verdict for check in checks if check.name == "rounding"]
    assert found == ([verdict] if verdict else [])


@pytest.mark.parametrize(
    ("run", "sigmas", "rail"), [(3, 6.5, True), (2, 6.5, False), (3, 5.5, False)]
)
def test_a_reading_at_the_end_of_the_range(run, sigmas, rail) -> None:
    """Oracle: by hand: one value three times in a row, six sigmas off."""
    column = np.tile([-1.0, 1.0], 5000).astype(float)
    column[100 : 100 + run] = column.mean() + sigmas * column.std()
    assert bool(static_recording._rail(column)) == rail


@pytest.mark.parametrize(
    ("force", "rate", "verdict", "advice"),
    [
        (9.01, 0.0, "ok", ""),
        (8.99, 0.0, "contradiction", "counts"),
        (10.59, 0.0, "ok", ""),
        (10.61, 0.0, "contradiction", "counts"),
        (9.8, 0.099, "ok", ""),
        (9.8, 0.101, "contradiction", "--gyro-unit"),
        (1.09, 0.0, "contradiction", "--accel-unit g"),
        (1.11, 0.0, "contradiction", "counts"),
        (910.0, 0.0, "contradiction", "--accel-unit mg"),
    ],
)
def test_the_units_of_a_recording_at_rest(force, rate, verdict, advice) -> None:
    """Oracle: gravity and 0.1 rad/s by hand; a tenth of gravity names a unit."""
    gyro, accel = np.tile([0.0, -rate, 0.0], (5, 1)), np.tile([0.0, force, 0.0], (5, 1))
    check = static_recording._units(gyro, accel, True)
    assert (check.verdict, advice in check.advice) == (verdict, True)
    assert static_recording._units(gyro, accel, False).verdict == (
        "contradiction" if rate > 0.1 else "ok"
    )


@pytest.mark.parametrize(("share", "noted"), [(0.49, True), (0.51, False)])
def test_rates_below_half_of_the_earths(share, noted) -> None:
    """Oracle: 15.04 deg an hour by hand."""
    gyro = np.tile([0.0, 0.0, share * np.radians(15.041) / 3600.0], (4, 1))
    assert bool(static_recording._earth_rate(gyro)) == noted


@pytest.mark.parametrize(("size", "rate_hz", "found"), [(0.5, 100.0, "shaken"), (0.0, 100.0, None)])
def test_a_disturbance_stands_where_it_is(size, rate_hz, found) -> None:
    """Oracle: noise that is e times as strong for two seconds; a step by a tenth of the noise that
    only means of ten seconds show."""
    rng = np.random.default_rng(5)
    x = rng.normal(size=(int(120 * rate_hz), 1))
    x[5000:5200] *= math.exp(2.0 * size)
    got = static_recording._disturbances(x, 1000.0, rate_hz)
    assert [d.kind for d in got] == ([found] if found else [])
    if got:
        assert (got[0].begin_s, got[0].length_s) == (1050.0, 2.0)
        assert got[0].channel == "gyro x"
    x[9000:] += 0.8
    (step,) = [d for d in static_recording._disturbances(x, 0.0, rate_hz) if d.kind == "step"]
    assert step.begin_s <= 90.0 <= step.begin_s + step.length_s
    assert not static_recording._disturbances(x[:3999], 0.0, rate_hz)


def test_a_matrix_between_two_imus_is_robust() -> None:
    """Oracle: the matrix that was made, of white noise; a tenth of the blocks far off; without a
    signal the a-priori sigma of 3 %."""
    rng = np.random.default_rng(6)
    K = 0.01 * rng.normal(size=(3, 3))
    signal = rng.normal(size=(3000, 3))
    noise = np.full(3000, 1e-4)
    d = signal @ K.T + 0.01 * rng.normal(size=(3000, 3))
    d[::10] += 1.0
    assert_allclose(_robust_matrix(d, signal, noise), K, atol=3e-3)
    weak = 1e-2 * np.sqrt(1.0 / 3000 / 0.03**2) * np.eye(3).repeat(1000, axis=0) * math.sqrt(3.0)
    one = _robust_matrix(weak @ np.diag([0.02] * 3), weak, noise)
    assert_allclose(np.diag(one), 0.01, rtol=1e-6)  # the signal says as much as the prior


def test_the_slow_part_of_a_signal() -> None:
    """Oracle: a straight line but for its ends, whatever stands out for less than half a minute."""
    x = np.tile(0.01 * np.arange(3000.0)[:, None], (1, 3))
    spiky = x.copy()
    spiky[1000:1200] += 50.0
    assert_allclose(_slow(x)[700:-700], x[700:-700], atol=1e-9)
    assert_allclose(_slow(spiky)[2200:2300], x[2200:2300], atol=1e-9)
    assert np.abs(_slow(spiky)[1000:1200] - x[1000:1200]).max() < 2.5


@pytest.mark.parametrize(
    ("first", "second", "unclear", "named"),
    [(6, 4, 0, 0), (5, 5, 0, None), (6, 2, 5, None), (7, 2, 6, 0), (2, 0, 9, None), (3, 0, 9, 0)],
)
def test_the_vote_of_three(first, second, unclear, named) -> None:
    """Oracle: by hand: more than half of the seconds that contradict, or three and more than three
    times as many as of any other; seconds in which all pairs contradict are nobody's."""
    contradicts = np.zeros((3, 30), dtype=bool)
    contradicts[:2, :first] = True  # pairs 0-1 and 0-2
    contradicts[[0, 2], first : first + second] = True
    contradicts[:, 20 : 20 + unclear] = True
    assert _vote(contradicts, ((0, 1), (0, 2), (1, 2)), 3, "abc")[0] == named


@pytest.mark.parametrize(("times", "count"), [(11.5, 0), (12.5, 1)])
def test_a_spike_of_one_sample(times, count) -> None:
    """Oracle: by hand: twelve times 1.4826 median distances from both neighbours, which agree."""
    x = np.tile([[0.0], [1.0]], (200, 6))
    usual = 1.4826 * 1.0
    x[101] = x[100] + 0.0
    x[101] = 0.5 * (x[100] + x[102]) + times * usual
    assert _spikes(x) in ((count,) if count else (0,))


@pytest.mark.parametrize(
    ("fault", "named"),
    [
        ({"stuck": 0.6}, 0),
        ({"stuck": 0.4}, None),
        ({"noise": 3.2}, 0),
        ({"noise": 2.8}, None),
        ({"noise": 3.2, "quiet": 0.5}, 0),
        ({"noise": 2.8, "quiet": 0.5}, None),  # the other one better than stated is no measure
        ({"spikes": 5}, 0),
        ({"spikes": 4}, None),
    ],
)
def test_of_two_the_one_that_shows_a_fault(fault, named) -> None:
    """Oracle: by hand: half a second of one value, nine times the stated variance, five spikes."""
    rng = np.random.default_rng(8)
    readings = rng.normal(size=(2, 4000, 6))
    if "stuck" in fault:
        readings[0, 100 : 100 + round(100 * fault["stuck"]), 2] = 0.3
    if "spikes" in fault:
        readings[0, 50 : 50 + 40 * fault["spikes"] : 40, 1] = 40.0
    readings[0] *= fault.get("noise", 1.0)
    readings[1] *= fault.get("quiet", 1.0)
    imus = [imu_of(x[:, :3], x[:, 3:]) for x in readings]
    sigma = np.full((2, 2), 0.1)  # per root of Hz, a second: unit variance at 100 Hz
    assert parity._self_evident(imus, sigma)[0] == named
    assert parity._stuck_samples(np.array([[1.0], [2.0], [2.0], [2.0], [1.0]])) == 3


@pytest.mark.parametrize(
    ("rms", "noise", "shown"),
    [(0.0099, 1e-4, False), (0.0101, 1e-4, True), (0.0199, 2e-3, False), (0.0201, 2e-3, True)],
)
@pytest.mark.parametrize("which", [0, 1])
def test_a_body_that_hardly_turns_shows_no_clock(monkeypatch, rms, noise, shown, which) -> None:
    """Oracle: by hand: 0.01 rad/s of either, or ten times the noise over a tenth of a second."""
    tracks = [SimpleNamespace(time=np.arange(0.0, 9.0, 0.1)) for _ in range(2)]
    rates = {id(track): np.full((400, 3), 1.0) for track in tracks}
    rates[id(tracks[which])] = np.full((400, 3), rms)
    monkeypatch.setattr(combine, "_grid_rates", lambda track, grid: rates[id(track)])
    monkeypatch.setattr(combine, "_coarse_offset", lambda a, b: (0.0, 0.69))
    *_, check = combine._offset(*tracks, noise, "b")
    assert ("hardly turns" in check.found) is not shown
    assert ("correlate by 0.69" in check.found) is shown


def test_a_calibration_takes_bias_and_response_off() -> None:
    """Oracle: (C.1) turned round by hand, of rates, and of increments over their intervals."""
    rng = np.random.default_rng(11)
    response = np.eye(3) + 0.01 * rng.normal(size=(3, 3))
    triad = TriadCalibration(np.array([0.1, -0.2, 0.3]), response)
    true, dt = rng.normal(size=(5, 3)), np.linspace(0.1, 0.2, 5)[:, None]
    assert_allclose(triad.correct(true @ response.T + triad.bias), true)
    assert_allclose(triad.correct((true * dt) @ response.T + triad.bias * dt, dt), true * dt)
    assert_allclose(triad.scale_factor, np.diag(response) - 1.0)
