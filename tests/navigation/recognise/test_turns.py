"""Exposures against the turns that GNSS saw. The turn rates of gyro and GNSS are held against wrong
files in test_wrong_input.
"""

import re
from dataclasses import replace

import numpy as np
import pytest
from air_motions import multirotor

from insgnss.geodesy.rotation import rotation_from_rpy
from insgnss.navigation.recognise import turns
from insgnss.navigation.recognise.plausibility import check_heading, check_recording
from insgnss.navigation.recognise.turns import (
    Forces,
    _forces,
    _judge_turns,
    check_events,
    check_turns,
)
from insgnss.records import GnssFixes, ImuSamples
from insgnss.simulation.raw_gnss.receiver import GnssOptions
from insgnss.simulation.scenario import ImuOptions, observe, simulate_flight


@pytest.fixture(scope="module", params=["ign8", "ign6x1"])
def flown(request):
    return simulate_flight(request.param, 12.0, seed=3, imu=ImuOptions(rate_hz=20.0))


@pytest.mark.parametrize("late", [18.0, -18.0])
def test_events_of_another_time_scale_lie_in_turns(flown, late):
    """Oracle: the simulator, which takes its images on lines only."""
    check = check_events(replace(flown.events, time=flown.events.time + late), flown.gnss)
    assert check.verdict == "contradiction"
    assert f"camera.time_offset_s = {-late:.0f}" in check.advice


@pytest.mark.parametrize(
    ("scale", "late", "advice"),
    [
        ("gpst", -18.0, 'camera.time_scale = "utc"'),
        ("utc", 18.0, 'camera.time_scale = "gpst"'),
        ("utc", -18.0, "camera.time_offset_s = 18"),
        ("", -18.0, "camera.time_offset_s = 18"),
    ],
)
def test_a_wrong_time_scale_is_mended_by_its_key(flown, scale, late, advice):
    """Oracle: UTC taken as GPST is 18 s early; a key that was not given helps nothing."""
    events = replace(flown.events, time=flown.events.time + late, time_scale=scale)
    assert advice in check_events(events, flown.gnss).advice


def test_events_on_lines_are_believed(flown):
    """Oracle: the simulator's own events, and with half a second of delay, which cannot be told."""
    for late in (0.0, 0.5):
        assert (
            check_events(replace(flown.events, time=flown.events.time + late), flown.gnss).verdict
            == "ok"
        )


def test_the_finding_says_whose_clock_stamps_the_exposures(flown):
    """Oracle: what it was told."""
    said = [check_events(flown.events, flown.gnss, clock).found for clock in ("imu", "receiver")]
    assert ["IMU's clock" in said[0], "receiver's clock" in said[1]] == [True, True]
    assert "clock" not in check_events(flown.events, flown.gnss).found


def test_a_few_images_or_a_short_flight_tell_nothing(flown):
    """Oracle: a chance of a few images in a turn is no proof."""
    few = replace(flown.events, images=flown.events.images[:10], time=flown.events.time[:10] + 18.0)
    assert check_events(few, flown.gnss).verdict == "ok"


def test_a_lag_within_the_interval_of_the_fixes_is_not_told(flown):
    """Oracle: fixes a second apart cannot tell a second, nor 0.98 from 0.97; ten times less left
    unexplained at 3 s is told.
    """
    for lag, here in ((1.0, 0.97), (3.0, 0.97)):
        assert _judge_turns(1.0, lag, 0.98, here, flown.imu, 0.05, 1.0) == ("ok", "", False)
    verdict, remedy, of_clock = _judge_turns(1.0, 3.0, 0.998, 0.97, flown.imu, 0.05, 1.0)
    assert (verdict, of_clock) == ("note", True)
    assert "add +3.0 s" in str(remedy)


def test_an_unclear_lag_at_the_edge_is_no_clock_error(flown):
    """Oracle: of 600 lags one always correlates; none is advised where it does not stand out."""
    for lag, best in ((-30.0, 0.9), (12.0, 0.7)):
        verdict, remedy, of_clock = _judge_turns(1.0, lag, best, 0.1, flown.imu, 0.05, 0.5)
        assert (verdict, of_clock) == ("contradiction", True)
        assert "time_offset_s" not in str(remedy)


@pytest.mark.slow
def test_forces_speak_for_a_drone_whose_nose_does_not_follow_its_course():
    """Oracle: the simulator's records fit; with fixes 4 s late, or in the mirror, they do not."""
    flown = simulate_flight("ign8", 4.0, seed=3, imu=ImuOptions(rate_hz=50.0), start_in_air=True)
    found = _forces(flown.imu, flown.gnss)
    assert found.sure_of_all > 0.99
    assert abs(found.offset_s) < 0.05
    late = _forces(flown.imu, replace(flown.gnss, time=flown.gnss.time + 4.0))
    assert late.offset_s == pytest.approx(-4.0, abs=0.05)
    assert _forces(replace(flown.imu, gyro=-flown.imu.gyro), flown.gnss).sure_of_all == 0.0


def turning(gyro, course_rate, jump_m=0.0, every=4):
    """Records of 5 minutes whose course turns with one rate and whose gyro with another, rad/s.

    The fixes, of which one in `every` 0.05 s exists, jump aside for 12 s in every 40 s.
    """
    t = np.arange(0.0, 300.0, 0.05)
    course = np.cumsum(course_rate(t)) * 0.05
    north, east = 8.0 * 0.05 * np.cumsum([np.cos(course), np.sin(course)], axis=1)
    north += jump_m * (t % 40.0 < 12.0)
    lat = 0.8 + north[::every] / 6.36e6
    cov = np.broadcast_to(1e-4 * np.eye(3), (lat.size, 3, 3))
    lon = 0.1 + east[::every] / (6.38e6 * np.cos(0.8))
    gnss = GnssFixes(
        t[::every], lat, lon, np.full(lat.size, 50.0), cov, None, None, None, 2200, "g"
    )
    rate = np.column_stack([0.0 * t, 0.0 * t, gyro(t)])
    force = np.tile([0.0, 0.0, -9.8], (t.size, 1))
    imu = ImuSamples(t, rate, force, "mean_rate", 2200, "i")
    return lambda forces: check_turns(t, rate, force, gnss, imu, 0.05, forces)


def drawn(seed, width=100):
    """A smooth random rate of turn."""
    noise = np.random.default_rng(seed).normal(size=8000)
    smooth = np.convolve(noise, np.hanning(width), mode="same")
    smooth *= 0.25 / np.std(smooth)
    return lambda t: np.interp(t, 0.05 * np.arange(-1000, 7000), smooth)


@pytest.mark.parametrize(("jump_m", "every"), [(20.0, 4), (1e5, 4), (100.0, 20), (1e5, 20)])
def test_turns_are_seen_between_jumps_of_the_fixes(jump_m, every):
    """Oracle: the same fixes without jumps, five times and once a second."""
    rate, ratios = drawn(8), []
    for jump in (0.0, jump_m):
        found = turning(rate, rate, jump, every)(Forces())
        assert (found.verdict, found.advice) == ("ok", "")
        ratios.append(float(re.search(r"ratio ([\d.]+)", found.found)[1]))
    assert ratios[1] == pytest.approx(ratios[0], abs=0.1)


def test_turns_never_contradict_what_the_forces_show():
    """Oracle: a nose that turns as the course did 20 s ago; where the forces show 0.1 s, or 0.25 s
    and nothing else for certain, no clock is advised; where they show nothing, or the same, it is.
    """
    rate = drawn(8)
    check = turning(lambda t: rate(t - 20.0), rate)
    for forces in (Forces(0.1, 0.999, 0.999), Forces(0.25, 0.95, 0.0)):
        found = check(forces)
        assert found.verdict == "note"
        assert "but the forces" in found.found
        assert "time_offset_s" not in found.advice
    for forces in (Forces(), Forces(20.0, 0.999, 0.999)):
        found = check(forces)
        assert found.verdict == "contradiction"
        assert "add +20.0 s to gnss.time_offset_s" in found.advice


def test_turns_that_repeat_themselves_show_no_clock():
    """Oracle: a course that turns to and fro every 12 s, and a gyro a quarter of that later: the
    same at 3 and at 15 s.
    """

    def rate(t):
        return 0.2 * np.sin(2.0 * np.pi * t / 12.0)

    found = turning(lambda t: rate(t - 3.0), rate)(Forces())
    assert found.verdict == "note"
    assert "turns repeat" in found.advice


def test_a_nose_across_a_single_course_tells_nothing_of_the_axes():
    """Oracle: a multirotor may fly one line with its nose anywhere; across two courses the same
    angle is a matter of the axes.
    """
    time = np.arange(400)
    for other, verdict in ((0.0, "note"), (2.5, "contradiction")):
        course = np.where(time < 200, 0.5, 0.5 + other)
        velocity = 12.0 * np.column_stack([np.cos(course), np.sin(course), np.zeros(400)])
        nose = course + 0.5 * np.pi
        C_nb = rotation_from_rpy(np.column_stack([0.0 * nose, 0.0 * nose, nose]))
        assert check_heading(time * 1.0, C_nb, velocity, np.eye(3)).verdict == verdict


@pytest.mark.parametrize("seed", [20, 25, 27])
def test_exposures_every_few_seconds_on_short_legs_are_in_no_other_time_scale(seed):
    """Oracle: the simulator's own events, every 5 s on legs of a quarter of a minute: 18 s away
    they would lie four times straighter, and so they would a few seconds away.
    """
    flight = multirotor(3.2, "sideways", seed=seed)
    sim = observe(flight, 22, imu=ImuOptions(50.0), gnss=GnssOptions(2.0), truth_hz=1.0)
    assert check_events(sim.events, sim.gnss).verdict == "ok"


@pytest.mark.parametrize(("correlation", "seen"), [(0.5, False), (0.85, True)])
def test_fixes_whose_course_rates_are_noise_show_no_turns(monkeypatch, correlation, seen):
    """Oracle: the correlation that the course rates of every other fix are made with."""
    one, other = np.random.default_rng(3).standard_normal((2, 2000))
    halves = [one, correlation * one + np.sqrt(1.0 - correlation**2) * other]
    known = np.ones(one.size, dtype=bool)
    monkeypatch.setattr(turns, "_course_rate", lambda half, *_: (halves[half], known))

    class EveryOther:
        def __getitem__(self, rows: slice) -> int:
            return rows.start

    assert turns._reliable(EveryOther(), one, 1) == seen


@pytest.mark.parametrize(("rate", "offset"), [(0.08, 0.0), (-0.05, 3.0), (0.12, -20.0)])
def test_a_clock_of_another_rate_is_named_by_it(flown, rate, offset):
    """Oracle: the rate; the turns of 12 minutes show it to a second of them, 0.14 %."""
    start = flown.gnss.time[0]
    time = start + (flown.imu.time - start) * (1.0 + rate) + offset
    imu = replace(flown.imu, time=time)
    checks = check_recording(imu, np.eye(3), flown.gnss, None, None)
    (check,) = [one for one in checks if one.name == turns.OF_TURNS]
    assert check.verdict == "contradiction"
    unit, shift = (float(x) for x in re.findall(r'= "?(-?[\d.]+)', check.advice))
    assert unit == pytest.approx(1.0 / (1.0 + rate), abs=1.4e-3)
    assert np.abs(unit * time + shift - flown.imu.time).max() < 1.0
    assert ("fast" if rate > 0.0 else "slow") in check.advice


def test_an_offset_is_no_rate(flown):
    """Oracle: the offset."""
    imu = replace(flown.imu, time=flown.imu.time + 4.2)
    checks = check_recording(imu, np.eye(3), flown.gnss, None, None)
    (check,) = [one for one in checks if one.name == turns.OF_TURNS]
    assert "+4.3 s to gnss.time_offset_s" in check.advice
