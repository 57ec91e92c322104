"""Flights in the shape of the open data set: geometry, dynamics, exposures, duration."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from surveys import block_flight, corridor_flight

from insgnss.base.errors import UsageError
from insgnss.simulation.flights import FlightMotion
from insgnss.simulation.layout import BLOCK

PER_HEIGHT = 6.4e-6 / 0.035  # ground sampling distance per metre of height


@pytest.fixture(scope="module")
def block() -> FlightMotion:
    return block_flight(seed=1)


@pytest.fixture(scope="module")
def corridor() -> FlightMotion:
    return corridor_flight(seed=1)


def on_lines(flight):
    """Times at which the aircraft is between the first and the last exposure of a line."""
    parts = [
        np.arange(t[0], t[-1], 0.25)
        for k in np.unique(flight.line)
        if (t := flight.time[flight.line == k]).size > 2
    ]
    return np.concatenate(parts)


def test_block_has_the_lines_and_images_of_ign8(block):
    """Oracle: Tables 6 and 7 of paper 000: 26 lines, two levels at 140 and 180 m, 440 images, 45
    min endurance.
    """
    assert np.unique(block.line).size == 26
    assert len(block.images) == pytest.approx(440, abs=15)
    assert block.images[:2] == ("8001.tif", "8002.tif")
    height = -block.motion.position(block.time)[:, 2]
    low = block.line <= 14
    assert_allclose(height[low], 140.0, atol=4.0)  # gusts of 0.5 m
    assert_allclose(height[~low], 180.0, atol=4.0)
    assert 30 < (block.motion.end - block.motion.start) / 60 < 45


def test_corridor_has_the_lines_of_ign6x1(corridor):
    """Oracle: Tables 6 and 7 of paper 000: 4 lines on two levels, about 2 km and 290 images."""
    assert np.unique(corridor.line).size == 4
    assert len(corridor.images) == pytest.approx(290, abs=25)
    assert corridor.images[0] == "6001.tif"
    height = -corridor.motion.position(corridor.time)[:, 2]
    assert_allclose(np.where(corridor.line <= 2, 100.0, 140.0), height, atol=4.0)
    position = corridor.motion.position(corridor.time[corridor.line == 1])
    assert np.linalg.norm(position[-1] - position[0]) == pytest.approx(2200.0, abs=60.0)


def test_levels_of_the_block_cross_at_right_angles(block):
    """Oracle: geometry of the exposures."""
    course = {}
    for k in (3, 20):
        p = block.motion.position(block.time[block.line == k])
        course[k] = np.arctan2(*(p[-1] - p[0])[[1, 0]])
    assert abs(np.cos(course[3] - course[20])) < np.sin(np.radians(1.0))


@pytest.mark.parametrize(("name", "overlap"), [("block", 0.65), ("corridor", 0.70)])
def test_forward_overlap_is_as_specified(name, overlap, request):
    """Oracle: footprint of 5120 pixels; trigger delays of 20 ms at 18 m/s move an exposure by 0.36
    m at most.
    """
    flight = request.getfixturevalue(name)
    position = flight.motion.position(flight.time)
    same = np.diff(flight.line) == 0
    spacing = np.hypot(*np.diff(position[:, :2], axis=0).T)[same]
    footprint = 5120 * PER_HEIGHT * np.array([lv.height_m for lv in flight.plan.levels])
    share = len(flight.plan.levels) * [0]
    for k, length in enumerate(footprint):
        here = np.isclose(flight.spacing_m[1:][same], (1 - overlap) * length, atol=0.01)
        assert here.any()
        share[k] = here.sum()
        assert_allclose(spacing[here], (1 - overlap) * length, atol=0.6)
        assert spacing[here].mean() == pytest.approx((1 - overlap) * length, abs=0.1)
    assert sum(share) == same.sum()
    assert np.diff(flight.time).min() >= 1.3


def test_side_overlap_is_as_specified(block):
    """Oracle: footprint of 3840 pixels at 45 %; gusts move a line's mean by decimetres."""
    for lines, height in ((range(1, 15), 140.0), (range(15, 27), 180.0)):
        course = np.radians(35.0 if height == 140.0 else 125.0)
        across = [
            -np.sin(course) * p[:, 0].mean() + np.cos(course) * p[:, 1].mean()
            for k in lines
            for p in [block.motion.position(block.time[block.line == k])]
        ]
        assert_allclose(np.diff(np.sort(across)), 0.55 * 3840 * PER_HEIGHT * height, atol=1.5)


@pytest.mark.parametrize("name", ["block", "corridor"])
def test_the_aircraft_does_what_a_small_fixed_wing_can(name, request):
    """Oracle: limits of the task: bank 40 deg, 60 deg/s, load factor below 1.5, nothing below
    ground.
    """
    motion = request.getfixturevalue(name).motion
    t = np.arange(motion.start, motion.end, 0.05)
    assert np.degrees(np.abs(motion.angles(t)[:, 0])).max() < 40.0
    assert np.degrees(np.abs(motion.omega_lb_b(t))).max() < 60.0
    assert np.abs(motion.position(t, 2)).max() < 8.0
    force = np.abs(motion.inertial(t)[1])
    assert force[:, 2].max() < 1.5 * 9.81
    assert force[:, 1].max() < 2.0  # turns are coordinated
    assert motion.position(t)[:, 2].max() < 0.1
    assert np.degrees(np.abs(motion.angles(t)[:, 0])).max() > 25.0  # and it does turn


def test_it_stands_still_before_launch_and_after_landing(block):
    """Oracle: the plan; 60 s before and 20 s after, less the 3 s over which smoothing reaches."""
    motion = block.motion
    for t in (
        np.linspace(motion.start, motion.start + 57.0, 200),
        np.linspace(motion.end - 16.0, motion.end, 50),
    ):
        assert np.abs(motion.velocity(t)).max() < 1e-9
        assert np.abs(motion.omega_lb_b(t)).max() < 1e-9
    launch = motion.position(np.array([motion.start, motion.end]))
    assert_allclose(launch, [(*BLOCK.launch, 0.0)] * 2, rtol=0, atol=1e-6)


@pytest.mark.parametrize("name", ["block", "corridor"])
def test_airspeed_and_crab_follow_the_wind_triangle(name, request):
    """Oracle: air velocity = ground velocity - wind has 14 m/s and the heading's direction; gusts:
    0.3 m/s and a degree.
    """
    flight = request.getfixturevalue(name)
    t = on_lines(flight)
    air = flight.motion.velocity(t) - flight.wind_l
    assert np.hypot(*air[:, :2].T).mean() == pytest.approx(14.0, abs=0.05)
    assert np.hypot(*air[:, :2].T).std() < 0.4
    heading = flight.motion.angles(t)[:, 2]
    slip = np.angle(np.exp(1j * (heading - np.arctan2(air[:, 1], air[:, 0]))))
    assert np.degrees(slip).std() < 1.5
    velocity = flight.motion.velocity(t)
    crab = np.degrees(np.angle(np.exp(1j * (heading - np.arctan2(velocity[:, 1], velocity[:, 0])))))
    assert np.abs(crab).max() > 8.0


def test_calm_air_and_no_turbulence_give_straight_lines():
    """Oracle: geometry; without gusts the line is straight, level and without crab but for
    smoothing at its ends.
    """
    flight = block_flight(3.0, start_in_air=True, wind_ms=0.0, turbulence=0.0)
    t = flight.time[flight.line == 1][1:-1]
    position, angles = flight.motion.position(t), flight.motion.angles(t)
    course = np.radians(35.0)
    across = -np.sin(course) * position[:, 0] + np.cos(course) * position[:, 1]
    assert np.ptp(across) < 1e-6
    assert_allclose(position[:, 2], -140.0, rtol=0, atol=1e-6)
    assert_allclose(np.sin(angles[:, 2] - course), 0.0, atol=1e-6)
    assert_allclose(angles[:, 0], 0.0, atol=1e-6)


@pytest.mark.parametrize("minutes", [9.0, 15.0, 44.0])
def test_a_grounded_flight_lasts_as_long_as_asked_and_lands(minutes):
    """Oracle: the clock, and the launch place."""
    flight = block_flight(minutes)
    assert flight.motion.end - flight.motion.start == pytest.approx(60.0 * minutes, abs=1e-6)
    assert_allclose(
        flight.motion.position(flight.motion.end), [(*BLOCK.launch, 0.0)], rtol=0, atol=1e-6
    )
    heights = np.unique(np.round(-flight.motion.position(flight.time)[:, 2], -1))
    assert {140.0, 180.0} <= set(heights)  # both levels, trimmed or not


def test_a_short_flight_ends_in_the_air_and_an_airborne_one_never_stands():
    """Oracle: velocity at both ends."""
    short, airborne = block_flight(4.0), corridor_flight(2.0, start_in_air=True)
    assert np.linalg.norm(short.motion.velocity(short.motion.end)) > 8.0
    assert short.motion.end - short.motion.start == pytest.approx(240.0)
    t = np.arange(airborne.motion.start, airborne.motion.end, 0.2)
    assert np.linalg.norm(airborne.motion.velocity(t), axis=1).min() > 8.0
    assert airborne.motion.end - airborne.motion.start == pytest.approx(120.0)
    assert airborne.time.min() > airborne.motion.start
    assert airborne.time.max() < airborne.motion.end


def test_the_seed_decides():
    """Oracle: repetition; the same seed gives the same motion and times, another seed others of the
    same plan.
    """
    a, b, c = (block_flight(1.0, start_in_air=True, seed=seed) for seed in (3, 3, 4))
    assert np.array_equal(a.motion.control, b.motion.control)
    assert np.array_equal(a.time, b.time)
    apart = np.abs(a.motion.control - c.motion.control)
    assert 0.05 < apart[:, :3].max() < 6.0


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"forward_overlap": 0.95}, "the camera needs 1.3 s"),
        ({"wind_ms": 12.0}, "70 % of the airspeed"),
        ({"side_overlap": 45.0}, "0.65 is 65 %"),
        ({"minutes": -1.0}, "positive duration"),
        ({"hight": 3.0}, "'hight' is unknown"),
        ({"ground_s": -1.0}, "negative"),
    ],
)
def test_plans_that_cannot_be_flown_are_refused(changes, words):
    """Oracle: the contract; UsageError that says why."""
    with pytest.raises(UsageError, match=words):
        block_flight(**{"minutes": 2.0, "start_in_air": True, **changes})
