"""The made-up constellation: one orbit and one clock behind all messages of a satellite, its shape,
and another library's view of it.
"""

import importlib.util
import json
import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from insgnss.base.errors import UsageError
from insgnss.geodesy.frames import geodetic_to_ecef
from insgnss.gnss.rinex.navigation_message import (
    AF0,
    AF1,
    ECC,
    GLONASS,
    I0,
    KIND,
    MESSAGE_VALUES,
    ROOT_A,
    STATE,
    TOE,
    Navigation,
)
from insgnss.gnss.satellites.orbits import ranges, satellite_states, select_messages, sky
from insgnss.simulation.raw_gnss.constellation import (
    GLONASS_CHANNELS,
    PZ90_A,
    PZ90_J2,
    PZ90_MU,
    PZ90_RATE,
    constellation,
)
from insgnss.simulation.raw_gnss.rinex_files import write_navigation

WEEK, START, END = 2008, 205200.0, 212400.0  # two hours
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
    out.append([found, health[0], *(rs[k] for k in range(6)), dts[0], dts[1]])
print(json.dumps(out))
"""


@pytest.fixture(scope="module")
def navigation():
    return constellation(WEEK, START, END, seed=3)


def seams(navigation):
    """States of each satellite in the middle between two of its messages, by the one and by the
    other.
    """
    codes, before, after, time = [], [], [], []
    for code in np.unique(navigation.satellite):
        for a, b in pairwise(np.flatnonzero(navigation.satellite == code)):
            codes.append(code)
            before.append(a)
            after.append(b)
            time.append(navigation.table[[a, b], TOE].mean())
    return np.array(codes), *(
        satellite_states(navigation, codes, np.array(time), np.array(rows))
        for rows in (before, after)
    )


def test_messages_of_a_satellite_are_one_orbit_and_one_clock(navigation):
    """Oracle: the neighbouring message, half its interval away; Kepler's elements agree to
    rounding, GLONASS to its steps of 60 s.
    """
    codes, before, after = seams(navigation)
    gps = np.char.startswith(codes, "G")
    assert gps.sum() >= 31
    assert (~gps).sum() >= 24 * 4
    apart = np.linalg.norm(before.position - after.position, axis=1)
    assert apart[gps].max() < 1e-5
    assert apart[~gps].max() < 3e-3  # two Runge-Kutta arcs of 15 minutes
    assert np.linalg.norm(before.velocity - after.velocity, axis=1).max() < 1e-5
    assert_allclose(before.clock_s, after.clock_s, rtol=0.0, atol=1e-17)


def test_a_week_end_is_no_seam():
    """Oracle: the message of the other week; the node is counted from the start of each."""
    navigation = constellation(WEEK, 604800.0 - 1800.0, 604800.0 + 5400.0, seed=4)
    assert navigation.table[:, TOE].min() < 604800.0 < navigation.table[:, TOE].max()
    _, before, after = seams(navigation)
    assert np.linalg.norm(before.position - after.position, axis=1).max() < 3e-3


@pytest.mark.parametrize("span", [(START, END), (START + 1.0, START + 61.0), (604799.0, 604900.0)])
def test_messages_reach_all_of_the_flight(span):
    """Oracle: the spacing of broadcasts; the nearest message is never farther than half of it."""
    navigation = constellation(WEEK, *span)
    codes = np.unique(navigation.satellite)
    assert codes.size == 31 + 24
    for time in np.linspace(*span, 7):
        chosen = select_messages(navigation, codes, np.full(codes.size, time))
        reach = np.where(np.char.startswith(codes, "G"), 3600.0, 900.0)
        assert (np.abs(navigation.table[chosen, TOE] - time) <= reach).all()


def test_glonass_moves_by_the_equations_of_the_icd():
    """Oracle: the package's Runge-Kutta from the first message, an independent integration; and the
    Jacobi integral of the state.

    The integral is that of the rotating field with J2, kept where Sun and Moon do not act.
    """
    navigation = constellation(WEEK, START, START + 3600.0, "R", seed=5)
    assert (navigation.table[:, KIND] == GLONASS).all()
    for code in ("R01", "R13", "R24"):
        rows = np.flatnonzero(navigation.satellite == code)
        first, last = navigation.table[rows[0]], navigation.table[rows[-1]]
        state = satellite_states(navigation, [code], last[[TOE]], rows[:1])
        assert (
            np.linalg.norm(state.position[0] - last[STATE : STATE + 3]) < 0.02
        )  # 60 s steps over more than an hour
        pull = first[STATE + 6 : STATE + 9]
        energies = [
            jacobi(row[STATE : STATE + 3], row[STATE + 3 : STATE + 6], pull)
            for row in navigation.table[rows]
        ]
        assert_allclose(energies, energies[0], rtol=1e-11)


def jacobi(r, v, pull):
    """Energy per mass in axes that turn with the Earth, in a field of J2 and of a constant pull."""
    size = np.linalg.norm(r)
    oblate = 0.5 * PZ90_J2 * PZ90_MU * PZ90_A**2 / size**3 * (1.0 - 3.0 * (r[2] / size) ** 2)
    return (
        0.5 * v @ v
        - PZ90_MU / size
        - oblate
        - 0.5 * PZ90_RATE**2 * (r[0] ** 2 + r[1] ** 2)
        - pull @ r
    )


def test_shape_is_that_of_the_real_systems(navigation):
    """Oracle: numbers of the interface documents: inclination, period, eccentricity, frequency
    numbers of antipodes.
    """
    gps = navigation.table[np.char.startswith(navigation.satellite, "G")]
    assert np.abs(np.degrees(gps[:, I0]) - 55.0).max() < 3.0
    assert (gps[:, ECC] >= 1e-3).all()
    assert (gps[:, ECC] <= 2e-2).all()
    assert_allclose(
        2.0 * np.pi * np.sqrt(gps[:, ROOT_A] ** 6 / 3.986005e14), 43082.0, atol=30.0
    )  # half a sidereal day
    assert np.abs(gps[:, AF0]).max() < 1e-3
    assert np.abs(gps[:, AF1]).max() < 1e-10
    channels = navigation.channels()
    assert set(channels.values()) <= set(range(-7, 7))
    sharing = [(a, b) for a in channels for b in channels if a < b and channels[a] == channels[b]]
    assert len(sharing) == 12
    assert set(GLONASS_CHANNELS) == set(channels.values())
    codes = [code for pair in sharing for code in pair]
    position = satellite_states(navigation, codes, np.full(24, START)).position.reshape(12, 2, 3)
    unit = position / np.linalg.norm(position, axis=2, keepdims=True)
    assert (
        np.einsum("ki,ki->k", unit[:, 0], unit[:, 1]) < np.cos(np.radians(170.0))
    ).all()  # never above one horizon


def test_enough_satellites_stand_over_any_place():
    """Oracle: what the full constellations offer, eight GPS and six GLONASS satellites above 15
    degrees on average.
    """
    counts = []
    for seed in range(3):
        navigation = constellation(WEEK, START, END, seed=seed)
        codes = np.unique(navigation.satellite)
        for lat, lon, time in (
            (0.81, 0.11, START),
            (-0.6, 2.4, END),
            (0.0, -1.2, START),
            (1.1, 0.4, END),
        ):
            place = geodetic_to_ecef(lat, lon, 500.0)
            state = satellite_states(navigation, codes, np.full(codes.size, time))
            high = sky(ranges(state.position, place)[1], place)[1] > np.radians(15.0)
            counts.append([(high & np.char.startswith(codes, letter)).sum() for letter in "GR"])
    assert np.min(counts, axis=0)[0] >= 5
    assert np.min(counts, axis=0)[1] >= 3
    assert 7.0 < np.mean(counts, axis=0)[0] < 10.0
    assert 4.5 < np.mean(counts, axis=0)[1] < 7.5


def test_one_seed_is_one_constellation(navigation):
    """Oracle: the same call; and another seed."""
    again = constellation(WEEK, START, END, seed=3)
    assert_array_equal(again.table, navigation.table)
    assert_array_equal(again.satellite, navigation.satellite)
    assert not np.allclose(constellation(WEEK, START, END, seed=2).table, navigation.table)
    alone = constellation(WEEK, START, END, "G", seed=3)
    assert_array_equal(alone.table, navigation.table[np.char.startswith(navigation.satellite, "G")])
    assert isinstance(alone, Navigation)
    assert alone.table.shape[1] == MESSAGE_VALUES


def test_impossible_requests_are_refused():
    """Oracle: the message names the value."""
    for systems, span, seed, said in (
        ("GE", (START, END), 0, "'GE'"),
        ("", (START, END), 0, "''"),
        ("G", (END, START), 0, "its start first"),
        ("G", (0.0, 2e5), 0, "86400"),
        ("G", (START, END), -1, "seed -1"),
    ):
        with pytest.raises(UsageError, match=said):
            constellation(WEEK, *span, systems, seed)


@pytest.mark.skipif(
    importlib.util.find_spec("pyrtklib5") is None, reason="pyrtklib5 (extra ppk) is not installed"
)
def test_rtklib_sees_the_same_satellites(navigation, tmp_path):
    """Oracle: RTKLIB, satpos() from the written files; its own constants of GLONASS move a
    satellite by millimetres in 15 minutes.
    """
    files = [str(tmp_path / name) for name in ("sim.18n", "sim.18g")]
    write_navigation(*files, navigation)
    codes = np.unique(navigation.satellite)
    wanted = [(str(code), time) for time in (START, START + 3000.5, END) for code in codes]
    asked = json.dumps([files, WEEK, wanted])
    run = subprocess.run(
        [sys.executable, "-c", RTKLIB], input=asked, capture_output=True, text=True, check=True
    )
    theirs = np.array(json.loads(run.stdout))
    assert (theirs[:, 0] == 1).all()
    assert (theirs[:, 1] == 0).all()
    names, times = zip(*wanted, strict=True)
    ours = satellite_states(navigation, np.array(names), np.array(times))
    gps = np.char.startswith(np.array(names), "G")
    apart = np.linalg.norm(theirs[:, 2:5] - ours.position, axis=1)
    assert apart[gps].max() < 1e-3  # the twelve digits of the file
    assert apart[~gps].max() < 5e-3
    assert (
        np.linalg.norm(theirs[:, 5:8] - ours.velocity, axis=1).max() < 5e-3
    )  # RTKLIB's of GPS: difference over a millisecond
    assert_allclose(theirs[:, 8], ours.clock_s, rtol=0.0, atol=1e-13)
