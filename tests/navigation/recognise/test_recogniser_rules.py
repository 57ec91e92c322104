"""The limits and the small formulas of the recogniser, each on either side or in closed form."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import linregress, norm

from insgnss.geodesy.rotation import rotation_from_rpy
from insgnss.navigation.prepare.fix_path import between_fixes
from insgnss.navigation.recognise import plausibility, turns
from insgnss.navigation.recognise.axes import ForwardAxis, Pose, _direction, down_direction, forward
from insgnss.navigation.recognise.claims import _compare_clock
from insgnss.navigation.recognise.fit import Scan
from insgnss.navigation.recognise.propulsion import Propulsion, propulsion
from insgnss.navigation.recognise.recognition import (
    _clocks,
    _exchange_latitude_longitude,
    _without_gnss,
)
from insgnss.navigation.recognise.relation import _halves, _scan, _usual_rate
from insgnss.navigation.recognise.streams import check_classes
from insgnss.navigation.recognise.units import _nearest, force_unit, unknown_force
from insgnss.navigation.recognise.verdict import (
    exchange_odds,
    odds,
    of_clock,
    of_forward,
    of_gyro,
    of_sign,
    of_vertical,
)
from insgnss.records import GnssFixes, ImuSamples

G = 9.80665
RATES = SimpleNamespace(quantity="mean_rate")


@pytest.mark.parametrize(
    ("ratio", "lag", "best", "here", "least_lag", "verdict", "word"),
    [
        # another lag fits: by 0.15 better, more than a second off, clear, and not at the edge
        (1.0, 1.1, 0.85, 0.6, 0.5, "contradiction", "a wrong clock"),
        (1.0, 1.1, 0.85, 0.72, 0.5, "ok", ""),
        (1.0, 0.9, 0.85, 0.6, 0.5, "note", ""),
        (1.0, 17.0, 0.9, 0.1, 0.5, "contradiction", "GPS against UTC"),
        (1.0, -19.5, 0.9, 0.1, 0.5, "contradiction", "GPS against UTC"),
        (1.0, 15.5, 0.9, 0.1, 0.5, "contradiction", "a wrong clock"),
        (1.0, 21.0, 0.9, 0.1, 0.5, "contradiction", "a wrong clock"),
        (1.0, 29.9, 0.9, 0.1, 0.5, "contradiction", "no common turn"),
        (1.0, 29.7, 0.9, 0.1, 0.5, "contradiction", "a wrong clock"),
        (1.0, 12.0, 0.79, 0.1, 0.5, "contradiction", "no common turn"),
        (1.0, 12.0, 0.81, 0.1, 0.5, "contradiction", "a wrong clock"),
        (1.0, 12.0, 0.59, 0.1, 0.5, "note", ""),
        # none fits
        (1.0, 0.0, 0.29, 0.2, 0.5, "contradiction", "no common turn"),
        (1.0, 0.0, 0.31, 0.2, 0.5, "note", ""),
        (1.0, 0.0, -0.61, -0.61, 0.5, "contradiction", "the other way"),
        (1.0, 0.0, -0.59, -0.59, 0.5, "note", ""),
        # the size of the rate
        (0.41, 0.0, 0.9, 0.9, 0.5, "ok", ""),
        (0.39, 0.0, 0.9, 0.9, 0.5, "contradiction", "check imu.units"),
        (1.79, 0.0, 0.9, 0.9, 0.5, "ok", ""),
        (1.81, 0.0, 0.9, 0.9, 0.5, "contradiction", "check imu.units"),
        # a short lag: half of what is left, a correlation of 0.9, beyond the interval
        (1.0, 0.7, 0.97, 0.9, 0.5, "note", "add +0.7 s"),
        (1.0, 0.54, 0.97, 0.9, 0.5, "ok", ""),
        (1.0, 0.56, 0.97, 0.9, 0.5, "note", "add +0.6 s"),
        (1.0, 0.7, 0.92, 0.87, 0.5, "ok", ""),
        (1.0, 0.7, 0.89, 0.76, 0.5, "ok", ""),
        (1.0, 0.7, 0.91, 0.77, 0.5, "note", "add +0.7 s"),
    ],
)
def test_what_the_turns_say(ratio, lag, best, here, least_lag, verdict, word) -> None:
    """Oracle: the rules of `turns` by hand, on either side of each limit."""
    said, remedy, _ = turns._judge_turns(ratio, lag, best, here, RATES, 0.01, least_lag)
    advice = str(remedy)
    assert (said, word in advice if word else advice == "") == (verdict, True)


@pytest.mark.parametrize(
    ("factor", "unit"),
    [
        (math.degrees(1.0), '"deg/s"'),
        (math.radians(1.0), '"rad/s" (not in deg)'),
        (math.radians(1.0) / 3600.0, "not in deg/h"),
        (1.0 / 3600.0, '"deg/s" (not in deg/h)'),
        (0.002, 'imu.quantity = "increments"'),
    ],
)
def test_a_ratio_names_the_unit_that_it_is_nearest(factor, unit) -> None:
    """Oracle: units by hand; a turn with the usual bank, 0.92 of the rate, 0.7 to 1.4 times."""
    for off, named in ((0.71, True), (1.0, True), (1.39, True), (0.69, False), (1.41, False)):
        advice = str(turns._gyro_unit_remedy(0.92 * factor * off, RATES, 0.002))
        assert (unit in advice) is named
    increments = SimpleNamespace(quantity="increments")
    factor, remedy = turns.quantity_guess(increments, 0.01)
    assert (factor, str(remedy)) == (100.0, 'imu.quantity = "mean_rate"')


def test_the_course_rate_of_a_circle() -> None:
    """Oracle: a circle of 10 m/s and 100 m; who stands has none."""
    t = np.arange(0.0, 60.0, 0.2)
    grid = np.arange(0.0, 59.0, 0.1)
    for radius_m, slow in ((100.0, False), (1.0, True)):
        place = radius_m * np.column_stack([np.sin(0.1 * t), 1.0 - np.cos(0.1 * t)])
        cov = np.broadcast_to(np.eye(3) * (1.0 if slow else 1e-4), (t.size, 3, 3))
        gnss = GnssFixes(t, place[:, 0] / 6335439.0, place[:, 1] / 6378137.0, 0.0 * t + 50.0, cov)
        rate, moving = turns._course_rate(gnss, grid, 20)
        assert moving.any() != slow
        assert not moving[:40].any()
        assert not moving[-40:].any()
        if not slow:
            assert moving[60:-60].all()
            assert_allclose(rate[moving], 0.1, rtol=0.01)


def test_turning_at_exposures() -> None:
    """Oracle: the mean by hand of the rates in the cells of 0.1 s; unknown where half lie off."""
    grid = np.arange(0.0, 10.0, 0.1)
    rate = np.where(grid < 5.0, -0.2, 0.1)
    moving = grid < 8.0
    assert turns._turning(np.array([1.04, 6.0]), grid, rate, moving) == pytest.approx(0.15)
    assert turns._turning(np.array([1.0, 2.0, 9.0]), grid, rate, moving) == pytest.approx(0.2)
    assert turns._turning(np.array([1.0, 9.0]), grid, rate, moving) == np.inf
    assert turns._turning(np.array([-1.0, 1.0, 11.0]), grid, rate, moving) == np.inf


@pytest.mark.parametrize(
    ("x", "probability"), [(2.1, 0.0), (2.3, 1.0 / (1.0 + math.exp(-2.3))), (60.0, 0.999)]
)
def test_odds_are_a_probability_from_nine_to_one_on(x, probability) -> None:
    """Oracle: the logistic function."""
    assert odds(x) == pytest.approx(probability)


def scan(score, lags, *, samples=400.0, up=None, reversed_=0.0, span_s=0.5) -> Scan:
    """A scan with these scores, of specific force."""
    score, lags = np.asarray(score, dtype=np.float64), np.asarray(lags, dtype=np.float64)
    other = np.full(lags.size, reversed_)
    acc = SimpleNamespace(span_s=span_s)
    return Scan(acc, lags, score, score if up is None else up, other, np.full(lags.size, samples))


def test_a_lag_is_as_sure_as_its_likelihood_and_as_it_is_usual() -> None:
    """Oracle: (R.5) by hand: 0.05 of the samples times the logarithm of what is left, less 4 where
    the lag is beyond a second, less 1 within 1.6 s of leap seconds."""
    lags = np.array([-17.0, -15.0, -1.1, 0.0, 0.9, 18.5, 19.0])
    one = scan([0.5] * 7, lags)
    level = 20.0 * np.log(2.0)
    assert_allclose(one.posterior, level + np.array([-1.0, -4.0, -4.0, 0.0, 0.0, -1.0, -4.0]))
    assert one.best == 3
    two = scan([0.5, 0.2, 0.5, 0.9, 0.9, 0.3, -np.inf], lags)
    assert two.margin(1.0) == pytest.approx(20.0 * np.log(0.5 / 0.1) + 1.0)
    assert two.gain() == pytest.approx(200.0 * np.log(10.0))
    assert two.against(0.5) == pytest.approx(200.0 * np.log(5.0))
    assert two.against(0.95) == 0.0
    assert scan([0.5], [0.0]).against(-3.0) == pytest.approx(200.0 * np.log(4.0))


def relation(one: Scan, *, scale=0.0, scale_sigma=0.01, lag=0.0, sign=1, rival=0.0, others=()):
    """A relation with one scan, and a fit of its lag and scale."""
    cov, theta = np.zeros((8, 8)), np.zeros(8)
    cov[4, 4], theta[4], theta[0] = scale_sigma**2, scale, lag
    return SimpleNamespace(
        scan=one,
        scans=(one, *others),
        fit=SimpleNamespace(theta=theta, cov=cov, sign=sign),
        factors=(1.0,) * (1 + len(others)),
        best=0,
        rival=rival,
        triads=np.eye(3),
        lag_sigma=0.01,
    )


LAGS = np.arange(-5.0, 5.5, 0.5)
PEAK = np.where(LAGS == 0.5, 0.9, 0.1)


@pytest.mark.parametrize(
    ("changes", "sure"),
    [
        ({}, True),
        ({"scale": 0.11}, True),
        ({"scale": -0.13}, False),
        ({"scale": 0.2, "scale_sigma": 0.026}, True),  # eight of its sigmas
        ({"scale": 0.2, "scale_sigma": 0.024}, False),
        ({"scale": 0.26, "scale_sigma": 0.09}, False),
        ({"scale_sigma": 0.11}, False),
    ],
)
def test_when_the_unit_of_the_gyros_is_sure(changes, sure) -> None:
    """Oracle: the limits of the scale by hand: 12 % and eight sigmas, 25 %, a sigma of 10 %."""
    unit, triads = of_gyro(relation(scan(PEAK, LAGS), **changes), RATES, 0.01)
    assert (unit.confidence > 0.0, triads.confidence > 0.0) == (sure, sure)
    assert unit.found == ("rad/s" if sure else "unknown")


def test_a_rival_unit_or_sense_takes_the_certainty() -> None:
    """Oracle: (R.10) by hand: a tenth of 200 log of what both leave, a logistic function."""
    near = 1.0 - 0.1 * math.exp(2.5 / 20.0)
    one = relation(scan(PEAK, LAGS), others=(scan(np.full(LAGS.size, near), LAGS),))
    unit, triads = of_gyro(one, RATES, 0.01)
    assert unit.confidence == pytest.approx(1.0 / (1.0 + math.exp(-2.5)))
    assert triads.confidence == unit.confidence
    _, triads = of_gyro(relation(scan(PEAK, LAGS), rival=near), RATES, 0.01)
    assert triads.confidence == pytest.approx(1.0 / (1.0 + math.exp(-2.5)))
    weak = relation(scan(np.where(LAGS == 0.5, 0.29, -0.5), LAGS, samples=4000.0))
    assert of_gyro(weak, RATES, 0.01)[0].confidence == 0.0


@pytest.mark.parametrize(("near", "sure"), [(1.0 - 1.29 * 0.1, False), (1.0 - 1.31 * 0.1, True)])
def test_a_clock_needs_a_distinct_lag(near, sure) -> None:
    """Oracle: by hand: whatever lies more than a second off leaves 1.3 times as much."""
    score = np.where(LAGS == 0.5, 0.9, np.where(LAGS == -3.0, near, 0.0))
    clock = of_clock(relation(scan(score, LAGS), lag=0.5), None, 0.9, 100.0)
    assert (clock.of_offset.confidence > 0.0) == sure
    assert clock.offset_s == (100.5 if sure else 0.0)


@pytest.mark.parametrize(
    ("lag", "at", "sure"),
    [(1.4, 0.5, True), (1.6, 0.5, False), (0.5, -5.0, False), (0.5, 5.0, False)],
)
def test_a_clock_is_that_of_fit_and_scan(lag, at, sure) -> None:
    """Oracle: by hand: the fit moves the lag by a second at most, and the edge is no lag."""
    score = np.where(at == LAGS, 0.99, 0.0)
    clock = of_clock(relation(scan(score, LAGS), lag=lag if at == 0.5 else at), None, 0.9, 0.0)
    assert (clock.of_offset.confidence > 0.0) == sure


@pytest.mark.parametrize(
    ("offset", "scale"),
    [
        (0.4, "same"),
        (0.6, "other"),
        (17.6, "GNSS in UTC"),
        (18.6, "other"),
        (-18.4, "IMU in UTC"),
        (-17.4, "other"),
    ],
)
def test_a_time_scale_is_known_to_half_a_second(offset, scale) -> None:
    """Oracle: whole seconds by hand; 18 leap seconds where no week is known."""
    clock = of_clock(relation(scan(PEAK, LAGS), lag=0.5), None, 0.9, offset - 0.5)
    assert clock.scale == scale


def test_the_sign_of_the_force() -> None:
    """Oracle: (R.10) by hand; an exchange of latitude and longitude that explains as much as the
    reversed force makes it uncertain, one that explains more unknown."""
    lone = scan([0.9], [0.0], samples=20.0, reversed_=0.2)
    sign, finding = of_sign(relation(lone), 0.95, -np.inf)
    assert (sign, finding.found) == (1, "unknown")  # log 8 = 2.08
    lone = scan([0.9], [0.0], samples=60.0 / math.log(8.0), reversed_=0.2)
    sign, finding = of_sign(relation(lone), 0.99, -np.inf)
    assert finding.confidence == pytest.approx(1.0 / (1.0 + math.exp(-3.0)))
    assert of_sign(relation(lone), 0.5, -np.inf)[1].confidence == 0.5
    assert of_sign(relation(lone, sign=-1), 0.99, -np.inf)[1].confidence == 0.0
    for odds_of_exchange, most in ((0.6, 0.96), (0.8, 0.5), (2.1, 0.5), (2.3, 0.0)):
        mirrored = 1.0 - 0.1 * math.exp(-odds_of_exchange / (0.05 * float(lone.samples[0])))
        assert exchange_odds(relation(lone), mirrored) == pytest.approx(odds_of_exchange)
        assert of_sign(relation(lone), 0.99, mirrored)[1].confidence <= most + 1e-9
        assert (of_sign(relation(lone), 0.99, mirrored)[1].confidence > 0.5) == (most > 0.5)


def test_an_axis_is_as_sure_as_its_angle_is_far_from_45_degrees() -> None:
    """Oracle: scipy's normal distribution."""
    for off_deg, sigma_deg in ((10.0, 8.0), (40.0, 5.0), (44.0, 20.0)):
        v = [math.sin(math.radians(off_deg)), 0.0, -math.cos(math.radians(off_deg))]
        found = _direction(3.0 * np.array(v), math.radians(sigma_deg))
        assert found.confidence == pytest.approx(2.0 * norm.cdf((45 - off_deg) / sigma_deg) - 1.0)
        assert (found.word, found.axis.tolist()) == ("-z", [0.0, 0.0, -1.0])
        assert math.degrees(found.off) == pytest.approx(off_deg)
        assert_allclose(found.vector, v)
    vertical = of_vertical(found, 1.0)
    assert (vertical.found, vertical.confidence) == ("unknown", 0.0)
    near = _direction(np.array([0.0, 0.0, 1.0]), math.radians(20.0))
    for also, known in ((0.52, True), (0.50, False)):  # the product of both, more likely than not
        assert (of_vertical(near, also).confidence > 0.0) is known


@pytest.mark.parametrize("free", [True, False])
@pytest.mark.parametrize(("speed", "slow"), [(2.9, True), (3.1, False)])
def test_who_is_slow_or_leans_may_fly_sideways(speed, slow, free) -> None:
    """Oracle: by hand: 0.85 of the certainty below 3 m/s or of a multirotor, else 0.995."""
    ahead = _direction(np.array([1.0, 0.0, 0.0]), 1e-3)
    moved = Propulsion(0.0 if free else 1.0, 0.01, 1.0)
    finding = of_forward(ForwardAxis(ahead, speed, 0.1, np.zeros(2)), moved, 0.9)
    assert finding.confidence == pytest.approx(0.9 * (0.85 if slow or free else 0.995))


@pytest.mark.parametrize(
    ("slope", "sigma", "seen", "leans", "pushed"),
    [
        (0.29, 0.1, 1.0, True, False),
        (0.31, 0.1, 1.0, False, False),
        (0.71, 0.1, 1.0, False, True),
        (0.69, 0.1, 1.0, False, False),
        (0.0, 0.1, 0.09, False, False),
        (1.0, 0.1, 0.11, False, True),
    ],
)
def test_who_leans_and_who_is_pushed(slope, sigma, seen, leans, pushed) -> None:
    """Oracle: two sigmas from a half by hand; without a slope, 10 m/s make an aircraft."""
    one = Propulsion(slope, sigma, seen)
    assert (one.leans, one.pushed) == (leans, pushed)
    assert one.nose_is_free(9.9) == (not pushed)
    assert one.nose_is_free(10.1) == leans


def test_propulsion_is_a_regression() -> None:
    """Oracle: scipy's linear regression of the force along the axis on the gain of speed along it;
    its sigma for values of two seconds each."""
    rng = np.random.default_rng(4)
    time = 0.5 * np.arange(400)
    rpy = np.column_stack([0.2 * rng.normal(size=(400, 2)), rng.uniform(-3.0, 3.0, 400)])
    C, force = rotation_from_rpy(rpy), rng.normal(size=(400, 3)) - [0.0, 0.0, G]
    axis = np.array([0.0, 1.0, 0.0])
    ahead = C @ axis
    level = ahead[:, :2] / np.linalg.norm(ahead[:, :2], axis=1, keepdims=True)
    gained, felt = np.sum(level * force[:, :2], axis=1), np.sum(ahead * force, axis=1)
    line = linregress(gained, felt)
    found = propulsion(time, C, force, axis)
    assert found.slope == pytest.approx(line.slope)
    assert found.seen == pytest.approx(np.std(gained))
    assert found.sigma == pytest.approx(line.stderr * np.sqrt(398 / 100), rel=1e-9)


def test_forward_and_wind_of_a_flight() -> None:
    """Oracle: the speed, the wind and the mounting that made it; level flight on all courses."""
    heading = np.linspace(0.0, 12.0, 200)
    nose = np.column_stack([np.cos(heading), np.sin(heading)])
    rpy = np.column_stack([0.0 * heading, 0.0 * heading, heading])
    turned = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # x is to the right
    pose = Pose(
        10.0 * np.arange(200.0),
        rotation_from_rpy(rpy) @ turned.T,
        np.full(200, 0.01),
        12.0 * nose + [3.0, -1.0],
        np.zeros(200),
        2.0,
    )
    vertical = down_direction(pose)
    assert (vertical.word, vertical.confidence > 0.999) == ("+z", True)
    ahead = forward(pose, vertical)
    assert_allclose(ahead.direction.vector, turned @ [1.0, 0.0, 0.0], atol=1e-3)
    assert ahead.speed == pytest.approx(12.0, abs=0.02)
    assert_allclose(ahead.wind, [3.0, -1.0], atol=0.02)
    assert ahead.speed_sigma == pytest.approx(1.0 / np.sqrt(200.0), rel=0.1)  # gusts of 1 m/s


def test_which_differences_the_fixes_allow() -> None:
    """Oracle: by hand: lengths from 0.9 intervals on, the interval where none is that long."""
    for interval, halves in ((0.2, [0.2, 0.5]), (0.23, [0.5]), (0.7, [0.7])):
        gnss = SimpleNamespace(time=interval * np.arange(5))
        assert_allclose(_halves(gnss, (0.2, 0.5)), halves)
    grid = SimpleNamespace(
        step=0.25, dtheta=np.tile([[1.0], [2.0], [9.0]], (1, 3)).repeat(4, axis=0)
    )
    assert _usual_rate(grid).tolist() == [2.0, 2.0, 2.0]


@pytest.mark.parametrize(
    ("kind", "span_s", "step"), [("position", 2.0, 0.25), ("velocity", 2.0, 0.5)]
)
def test_steps_of_the_lag(monkeypatch, kind, span_s, step) -> None:
    """Oracle: by hand: a quarter of a difference's width, a quarter of a second at least and half
    of the width at most, 30 s to either side."""
    from insgnss.navigation.recognise import relation as module

    monkeypatch.setattr(module, "scan_lags", lambda moved, acc, lags, free: (lags, free))
    lags, free = _scan(None, SimpleNamespace(kind=kind, span_s=span_s))
    assert_allclose(np.diff(lags), step)
    assert_allclose(lags[[0, -1]], [-30.0, 30.0])
    assert free is False
    lags, free = _scan(None, SimpleNamespace(kind="velocity", span_s=0.2), 5.0, 31.0)
    assert_allclose(np.diff(lags), 0.1)
    assert (lags.mean(), free) == (pytest.approx(5.0), True)


@pytest.mark.parametrize(
    ("size", "confidence"),
    [
        (1.0, 1.0),
        (math.exp(0.14), 1.0),
        (math.exp(0.275), 0.5),
        (math.exp(-0.39), 0.04),
        (math.exp(0.41), 0.0),
    ],
)
def test_a_unit_is_sure_where_gravity_has_its_size(size, confidence) -> None:
    """Oracle: by hand: sure within 15 %, not at all beyond 40 %, of the logarithm."""
    grid = SimpleNamespace(
        step=0.02,
        interval=0.02,
        dvel=np.tile([0.0, 0.0, -0.02 * G * size], (50, 1)),
        whole_accel=False,
    )
    assert force_unit(grid).of_unit.confidence == pytest.approx(0.999 * confidence, abs=1e-6)


def test_two_units_of_one_size_are_half_as_sure() -> None:
    """Oracle: increments over a second are what rates are."""
    grid = SimpleNamespace(
        step=0.02,
        interval=0.8,
        dvel=np.tile([0.0, 0.0, -0.02 * G], (50, 1)),
        whole_accel=False,
    )
    assert force_unit(grid).of_unit.confidence == pytest.approx(0.5 * 0.999)
    assert _nearest([(1.0, "a", "mean_rate"), (2.0, "b", "mean_rate")], G)[0][2] == "a"


@pytest.mark.parametrize(
    ("size", "unit", "confidence"),
    [
        (8205.0, f"{0.5**13:.12g} g", 1.0),
        (1.02 * 2048, f"{0.5**11:.12g} g", 1.0),
        (1012.0, f"{0.5**10:.12g} g", 0.5),  # as near to 1000 in mg
        (5000.0, "unknown", 0.0),
    ],
)
def test_counts_of_gravity_are_powers_of_two(size, unit, confidence) -> None:
    """Oracle: data sheets: a range of 2 to 16 g over 2^15 counts."""
    dvel = np.tile([0.0, 0.0, -0.02 * size], (50, 1))
    grid = SimpleNamespace(step=0.02, interval=0.02, dvel=dvel, whole_accel=True)
    found = force_unit(grid).of_unit
    assert (found.found, found.confidence) == (unit, pytest.approx(0.999 * confidence, abs=1e-6))


def test_who_stands_beside_a_path() -> None:
    """Oracle: by hand: a fix of the path within a second on both sides."""
    path = np.array([0.0, 1.0, 2.5, 10.0])
    time = np.array([-0.5, 0.5, 1.2, 1.6, 2.4, 9.5])
    assert between_fixes(time, path)[2].tolist() == [False, True, False, True, False, False]


@pytest.mark.parametrize(
    ("sigmas", "rows", "verdict"),
    [(2.9, 40, None), (3.1, 40, "note"), (5.1, 40, "contradiction"), (9.0, 19, None)],
)
def test_qualities_apart_by_sigmas(sigmas, rows, verdict) -> None:
    """Oracle: by hand: heights of the rarer quality off by sigmas of the difference, of 20 rows."""
    n = 200
    rare = np.isin(np.arange(n), 2 + 4 * np.arange(rows))
    cov = np.broadcast_to(0.5 * np.eye(3), (n, 3, 3))  # of the difference: one metre
    gnss = GnssFixes(
        0.2 * np.arange(n),
        np.full(n, 0.7),
        np.full(n, 0.1),
        50.0 + sigmas * rare,
        cov,
        quality=np.where(rare, 5, 4),
    )
    assert [check.verdict for check in check_classes(gnss)] == ([verdict] if verdict else [])


def at_rest(force, rate=(0.0, 0.0, 0.0), n=400, **more) -> ImuSamples:
    """Readings that never change but for the noise that keeps a channel alive."""
    noise = 1e-6 * np.random.default_rng(1).normal(size=(n, 6))
    gyro, accel = np.asarray(rate) + noise[:, :3], np.asarray(force) + noise[:, 3:]
    return ImuSamples(0.01 * np.arange(n), gyro, accel, **more)


@pytest.mark.parametrize(
    ("norm_", "load", "verdict"),
    [
        (8.7, 1.0, "contradiction"),
        (8.9, 1.0, "ok"),
        (10.9, 1.0, "ok"),
        (11.1, 1.0, "contradiction"),
        (14.0, 1.3, "ok"),
        (14.0, 1.2, "contradiction"),
    ],
)
def test_the_size_of_a_flights_force(norm_, load, verdict) -> None:
    """Oracle: 8.8 to 11 m/s^2 by hand, what turns add taken off above."""
    force = np.tile([0.0, 0.0, -norm_], (50, 1))
    check = plausibility._force_norm(0.0 * force, force, np.full(50, load), RATES, 0.01)
    assert check.verdict == verdict


@pytest.mark.parametrize(
    ("norm_", "word"),
    [
        (0.86 * 1.0, '"g"'),
        (1.14 * 1.0, '"g"'),
        (0.84 * 1.0, "imu.columns"),
        (G * G, "not in g"),
        (1e-3 * G * G, 'quantity = "increments" or imu.units accel = "m/s^2" (not in mg)'),
        (1e3, '"mg"'),
        (0.01 * G, '"increments"'),
    ],
)
def test_the_unit_that_a_size_looks_like(norm_, word) -> None:
    """Oracle: gravity in each unit by hand, within 15 %."""
    force = np.tile([0.0, 0.0, -norm_], (50, 1))
    check = plausibility._force_norm(0.0 * force, force, np.ones(50), RATES, 0.01)
    assert word in check.advice


@pytest.mark.parametrize(
    ("angle_deg", "verdict"),
    [(29.0, "ok"), (31.0, "note"), (59.0, "note"), (61.0, "contradiction")],
)
def test_the_vertical_of_the_axes(angle_deg, verdict) -> None:
    """Oracle: a force tilted by hand."""
    angle = math.radians(angle_deg)
    force = np.tile(G * np.array([math.sin(angle), 0.0, -math.cos(angle)]), (20, 1))
    assert plausibility._down_axis(force, np.eye(3)).verdict == verdict


@pytest.mark.parametrize(
    ("gyro", "accel", "count", "verdict", "word"),
    [
        (99.0, 999.0, 1, "ok", ""),
        (101.0, 1.0, 1, "contradiction", "spikes"),
        (1.0, -1001.0, 1, "contradiction", "spikes"),
        (101.0, 1.0, 4, "contradiction", "spikes"),
        (101.0, 1.0, 5, "contradiction", "imu.units"),
    ],
)
def test_readings_that_no_sensor_gives(gyro, accel, count, verdict, word) -> None:
    """Oracle: limits by hand; more than one sample in a hundred is no spike."""
    imu = at_rest([0.0, 0.0, -G])
    imu.gyro.flags.writeable = imu.accel.flags.writeable = True
    imu.gyro[:count, 1], imu.accel[:count, 2] = gyro, accel
    check = plausibility._readings(imu, 0.01)
    assert (check.verdict, word in check.advice) == (verdict, True)
    scaled = ImuSamples(imu.time, 0.01 * imu.gyro, 0.01 * imu.accel, "increments")
    assert plausibility._readings(scaled, 0.01).verdict == verdict


def path(step_m, n=20, **changes) -> GnssFixes:
    """Fixes a second apart on the way north from a place in Europe."""
    t = np.arange(float(n))
    values = {
        "lat": 0.8 + step_m * t / 6367000.0,
        "lon": 0.1 + 1e-9 * t,
        "height": 100.0 + 0.1 * t,
        **changes,
    }
    cov = np.broadcast_to(1e-4 * np.eye(3), (n, 3, 3))
    return GnssFixes(t, values["lat"], values["lon"], values["height"], cov)


@pytest.mark.parametrize(("speed", "verdict"), [(99.0, "ok"), (102.0, "contradiction")])
def test_the_speed_of_a_flight(speed, verdict) -> None:
    """Oracle: 100 m/s by hand; a single jump is noted."""
    assert plausibility._gnss_speed(path(speed)).verdict == verdict
    jump = path(5.0)
    jump.lat.flags.writeable = True
    jump.lat[10:] += 120.0 / 6367000.0
    assert plausibility._gnss_speed(jump).verdict == "note"


@pytest.mark.parametrize(
    ("changes", "step_m", "verdict"),
    [
        ({}, 5.0, "ok"),
        ({"height": np.linspace(-999.0, 9999.0, 20)}, 5.0, "ok"),
        ({"height": np.linspace(-1001.0, 0.0, 20)}, 5.0, "contradiction"),
        ({"height": np.linspace(0.0, 10001.0, 20)}, 5.0, "contradiction"),
        ({"height": np.full(20, 100.0)}, 5.0, "contradiction"),
        ({"height": np.full(20, 100.0)}, 0.5, "note"),  # it hovers within 10 m
        ({"height": np.full(20, 100.0)}, 0.55, "contradiction"),
        ({"lat": np.radians(0.05 + 1e-6 * np.arange(20)), "lon": np.full(20, 0.05)}, 5.0, "ok"),
        (
            {"lat": np.radians(0.8 + 1e-6 * np.arange(20)), "lon": np.radians(np.arange(20) / 1e3)},
            0,
            "contradiction",
        ),
    ],
)
def test_where_positions_lie(changes, step_m, verdict) -> None:
    """Oracle: limits by hand: heights, columns that never change, radians read as degrees."""
    if "lat" in changes and verdict == "ok":
        changes = {**changes, "lon": np.radians(4.0) + 1e-9 * np.arange(20)}
    assert plausibility._gnss_position(path(step_m, **changes)).verdict == verdict


@pytest.mark.parametrize(("km", "verdict"), [(49.0, "ok"), (51.0, "contradiction")])
@pytest.mark.parametrize("axis", [0, 1])
def test_how_far_a_flight_is_from_its_origin(km, verdict, axis) -> None:
    """Oracle: 50 km by hand, of the curvature of the ellipsoid within 0.5 %."""
    origin = np.array([0.8, 0.1, 0.0])
    origin[axis] -= 1e3 * km / (6367000.0 if axis == 0 else 6389000.0 * math.cos(0.8))
    assert plausibility._origin_distance(path(1.0), origin).verdict == verdict


def test_what_turns_add_to_gravity() -> None:
    """Oracle: 1 / cos(bank) of a level turn, tan(bank) = v w / g; 3 at most."""
    time = np.arange(2.0, 18.0, 0.1)
    for rate, speed in ((0.3, 20.0), (2.0, 40.0)):
        load = plausibility._load(time, np.tile([0.0, 0.0, rate], (time.size, 1)), path(speed))
        bank = math.atan(rate * speed / G)
        assert_allclose(load, min(1.0 / math.cos(bank), 3.0), rtol=2e-3)


@pytest.mark.parametrize(
    ("nose_deg", "scatter_deg", "verdict"),
    [
        (29.0, 0.0, "ok"),
        (31.0, 0.0, "note"),
        (59.0, 0.0, "note"),
        (61.0, 0.0, "contradiction"),
        (90.0, 29.0, "contradiction"),
        (90.0, 31.0, "note"),
    ],
)
def test_a_nose_off_its_course(nose_deg, scatter_deg, verdict) -> None:
    """Oracle: angles by hand, on courses all around; half of them within the scatter."""
    n = 400
    course = np.linspace(0.0, 25.0, n)
    speed = np.where(np.arange(n) < 200, 7.9, 8.1)
    velocity = np.column_stack([speed * np.cos(course), speed * np.sin(course), 0.0 * course])
    off = np.radians(nose_deg + scatter_deg * np.where(np.arange(n) % 2, 1.0, -1.0))
    rpy = np.column_stack([0.0 * off, 0.0 * off, course + off])
    C_nb = rotation_from_rpy(rpy)
    check = plausibility.check_heading(1.0 * np.arange(n), C_nb, velocity, np.eye(3))
    assert check.verdict == verdict
    if verdict == "contradiction":
        assert "turned by 90 deg" in check.advice
    slow = plausibility.check_heading(1.0 * np.arange(n), C_nb, 0.97 * velocity, np.eye(3))
    assert "never faster" in slow.found


@pytest.mark.parametrize(
    ("begins", "ends", "clocks"),
    [
        (90.1, 900.0, (-90.1, 60.0)),  # 9.9 s in common: no common clock
        (89.9, 900.0, (0.0, 30.0)),
        (500.0, 600.0, (-500.0, 100.0)),
        (500.0, 530.0, (-500.0, 100.0)),
        (500.0, 1300.0, (-500.0, 800.0)),
        (500.0, 1500.0, (-500.0, 900.0)),
    ],
)
def test_which_clocks_are_set_to_a_common_start(begins, ends, clocks) -> None:
    """Oracle: by hand: ten seconds in common are one clock; else lags up to the longer of both
    recordings, a minute at least, a quarter of an hour at most."""
    imu = SimpleNamespace(time=np.array([0.0, 100.0]))
    gnss = SimpleNamespace(time=np.array([begins, ends]))
    if ends == 900.0:
        clocks = (clocks[0], min(max(809.9, 60.0), 900.0)) if clocks[0] else clocks
    assert_allclose(_clocks(imu, gnss), clocks)


def test_an_abstention_keeps_the_readings_as_they_are() -> None:
    """Oracle: by hand: the unit of the force, and factors of one."""
    found = _without_gnss(unknown_force(2.0, "why"), 0.5, "because")
    assert found.curves == {}
    curves = {"lag_s": np.arange(3.0)}
    assert _without_gnss(unknown_force(2.0, "why"), 0.5, "because", curves).curves is curves
    assert (found.gyro_factor, found.accel_factor, found.accel_sign) == (1.0, 1.0, 1)
    assert (found.time_offset_s, found.time_offset_sigma_s) == (0.0, np.inf)
    assert (found.axes, found.time_scale, found.gyro_unit) == (None, "same", "rad/s")
    assert [one.confidence for one in found.findings] == [0.0] * len(found.findings)


@pytest.mark.parametrize(
    ("changes", "looked_at"),
    [
        ({}, True),
        ({"up": 0.9}, False),
        ({"turned": True}, False),
        ({"velocity": 1}, False),
        ({"lon": 1.58}, False),
    ],
)
def test_when_an_exchange_of_latitude_and_longitude_is_looked_at(monkeypatch, changes, looked_at):
    """Oracle: by hand: of a force that looks reversed, by positions alone, of aligned triads, where
    a longitude may be a latitude."""
    from insgnss.navigation.recognise import recognition

    other = SimpleNamespace(scan=SimpleNamespace(up=np.array([0.7]), best=0))
    monkeypatch.setattr(recognition, "relate", lambda *_: other)
    monkeypatch.setattr(recognition, "replace", lambda gnss, **_: gnss)
    up = np.array([changes.get("up", 0.1)])
    relation_ = SimpleNamespace(
        triads=-np.eye(3) if "turned" in changes else np.eye(3),
        scan=SimpleNamespace(up=up, down=np.array([0.8]), best=0),
    )
    lon = np.array([changes.get("lon", 1.5)])
    gnss = SimpleNamespace(velocity_ned=changes.get("velocity"), lat=lon, lon=lon)
    found = _exchange_latitude_longitude(relation_, None, gnss, None, None, 30.0)
    assert found == (0.7 if looked_at else -np.inf)


@pytest.mark.parametrize(("spacing_s", "told"), [(0.2, True), (1.0, False)])
def test_a_lag_below_the_interval_of_the_fixes_is_none(monkeypatch, spacing_s, told) -> None:
    """Oracle: by hand: 0.8 s between turns that fit at no other lag; fixes a second apart do not
    show it."""
    t = np.arange(0.0, 300.0, 0.05)
    course = np.interp(t, t, np.cumsum(0.3 * np.sin(0.5 * t) * np.sin(0.037 * t)) * 0.05)
    way = 8.0 * 0.05 * np.cumsum([np.cos(course), np.sin(course)], axis=1)
    every = round(spacing_s / 0.05)
    cov = np.broadcast_to(1e-4 * np.eye(3), (t[::every].size, 3, 3))
    lat, lon = 0.8 + way[0][::every] / 6.36e6, 0.1 + way[1][::every] / (6.38e6 * np.cos(0.8))
    gnss = GnssFixes(t[::every], lat, lon, 50.0 + 0.0 * lat, cov)
    rate = np.zeros((t.size, 3))
    rate[:, 2] = np.interp(t - 0.8, t, np.gradient(course, t))
    force = np.tile([0.0, 0.0, -G], (t.size, 1))
    imu = ImuSamples(t, rate, force)
    found = turns.check_turns(t, rate, force, gnss, imu, 0.05, turns.Forces())
    assert ("time_offset_s" in found.advice) is told


@pytest.mark.parametrize(("spacing_s", "steps"), [(0.2, 20), (0.49, 20), (0.6, 24), (1.0, 40)])
def test_how_long_rates_are_smoothed(spacing_s, steps) -> None:
    """Oracle: by hand: two seconds, four intervals of the fixes at least, in steps of 0.1 s."""
    gnss = SimpleNamespace(time=spacing_s * np.arange(50.0))
    assert turns._width(gnss, np.zeros(99)) == steps
    assert turns._width(SimpleNamespace(time=np.zeros(1)), np.zeros(99)) == 99
    x = np.arange(50.0)
    assert_allclose(turns._smooth(x, 5)[2:-2], x[2:-2])


def test_the_best_lag_and_its_rival() -> None:
    """Oracle: by hand: a rate of turn that is 3.1 s late and reversed; the rival is the largest
    correlation farther than 5 s from there, numpy's."""
    rng = np.random.default_rng(9)
    rate = np.convolve(rng.normal(size=1400), np.hanning(25), mode="same")
    course, gyro = rate[100:1300], -rate[100 - 31 : 1300 - 31]
    moving = np.ones(1200, dtype=bool)
    lag, best, here, rival = turns._best_lag(gyro, course, moving)
    assert lag == pytest.approx(3.1)
    assert best == pytest.approx(-1.0, abs=1e-9)
    assert here == pytest.approx(np.corrcoef(gyro, course)[0, 1], abs=1e-9)
    far = [
        abs(
            np.corrcoef(gyro[max(k, 0) : 1200 + min(k, 0)], course[max(-k, 0) : 1200 - max(k, 0)])[
                0, 1
            ]
        )
        for k in range(-300, 301)
        if abs(k - 31) > 50
    ]
    assert rival == pytest.approx(max(far), abs=1e-9)


@pytest.mark.parametrize(
    ("here", "later", "near", "images", "verdict"),
    [
        (0.021, 0.005, 1.0, 20, "contradiction"),
        (0.019, 0.001, 1.0, 20, "ok"),  # less than 0.02 rad/s are no turns
        (0.1, 0.024, 1.0, 20, "contradiction"),
        (0.1, 0.026, 1.0, 20, "ok"),  # four times straighter
        (0.1, 0.02, 0.041, 20, "contradiction"),
        (0.1, 0.02, 0.039, 20, "ok"),  # and no such line a few seconds away
        (0.1, 0.02, 1.0, 19, "ok"),
        (np.inf, 0.02, 1.0, 20, "ok"),
    ],
)
def test_when_exposures_lie_in_turns(monkeypatch, here, later, near, images, verdict) -> None:
    """Oracle: the rule by hand, on either side of each limit, of mean rates at the exposures."""
    time = 100.0 + np.arange(float(images))
    rates = {0.0: here, 18.0: later, -18.0: 1.0, 4.0: near}
    monkeypatch.setattr(turns, "_course_rate", lambda *_: (None, None))
    monkeypatch.setattr(turns, "_turning", lambda t, *_: rates.get(float(t[0] - 100.0), 1.0))
    gnss = SimpleNamespace(time=np.arange(0.0, 300.0, 0.2))
    events = SimpleNamespace(time=time, images=("a",) * images, time_scale="")
    check = turns.check_events(events, gnss)
    assert check.verdict == verdict
    assert ("time_offset_s = 18" in check.advice) == (verdict == "contradiction")


@pytest.mark.parametrize("weeks", [1, -2])
def test_fixes_of_another_week_are_set_to_that_of_the_imu(weeks):
    """Oracle: whole weeks of 604 800 s beside the offset that is set already."""
    found = SimpleNamespace(found="", evidence="", confidence=1.0)
    recognition = SimpleNamespace(
        finding=lambda _: found,
        time_offset_s=604800.0 * weeks + 0.2,
        time_offset_sigma_s=0.1,
        time_scale="",
    )
    finding = _compare_clock(recognition, 3.0)
    assert f"gnss.time_offset_s = {604800.0 * weeks + 3.0:.1f}" in str(finding.as_dict())
