"""Navigation that georinex reads: precise orbits as fitted messages."""

import sys
from datetime import datetime, timedelta

import numpy as np
import pytest
from broadcast import TOW, WEEK
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import solve_ivp

from insgnss.base.errors import InputError
from insgnss.gnss.rinex.navigation_message import AF0, AF1, navigation_bytes, read_navigation
from insgnss.gnss.satellites.orbits import satellite_states

MU, RATE, J2, RADIUS = 3.986004418e14, 7.2921151467e-5, 1.0826e-3, 6378137.0
MOON = 4.9e12 * np.array([0.6, -0.7, 0.4]) / np.linalg.norm([0.6, -0.7, 0.4])  # m^3/s^2
DISTANCE = 3.8e8
CLOCKS = {"G05": (1e-4, 3e-12), "E11": (-2e-5, -1e-11), "C20": (5e-5, 0.0), "J02": (0.0, 1e-12)}
AXES = {"G05": 26.56e6, "E11": 29.6e6, "C20": 27.9e6, "J02": 42.164e6}


def flown(axis, inclination, time):
    """An orbit (n, 3) m, ECEF, integrated in inertial axes with J2 and the pull of a third body."""

    def rate(_, y):
        r, r2 = y[:3], y[:3] @ y[:3]
        z = 5.0 * r[2] ** 2 / r2
        oblate = 1.5 * J2 * MU * RADIUS**2 / r2**2.5 * r * np.array([1.0 - z, 1.0 - z, 3.0 - z])
        moon = MOON / np.linalg.norm(MOON) * DISTANCE
        tide = np.linalg.norm(MOON) * (
            (moon - r) / np.linalg.norm(moon - r) ** 3 - moon / DISTANCE**3
        )
        return np.concatenate([y[3:], -MU * r / r2**1.5 - oblate + tide])

    speed = np.sqrt(MU / axis) * 1.004  # of some eccentricity
    first = [axis, 0.0, 0.0, 0.0, speed * np.cos(inclination), speed * np.sin(inclination)]
    span = (time[0], time[-1])
    y = solve_ivp(rate, span, first, "DOP853", time, rtol=1e-12, atol=1e-6).y
    angle = RATE * (time - TOW)
    c, s = np.cos(angle), np.sin(angle)
    return np.column_stack([c * y[0] + s * y[1], c * y[1] - s * y[0], y[2]])


def sp3_text(time, orbits, clocks, scale="GPS"):
    """SP3-c with positions (km) and clocks (microseconds) by satellite."""
    dates = [datetime(1980, 1, 6) + timedelta(weeks=WEEK, seconds=t) for t in time.tolist()]
    names = "".join(orbits)
    lines = [
        f"#cP{dates[0]:%Y %m %d %H %M}  0.00000000 {len(dates):7d} ORBIT IGS14 HLM  IGS",
        f"## {WEEK} {time[0]:15.8f} {time[1] - time[0]:14.8f} 60375 0.0000000000000",
        f"+   {len(orbits):2d}   {names}{'  0' * (17 - len(orbits))}",
        *([f"+        {'  0' * 17}"] * 4 + [f"++       {'  0' * 17}"] * 5),
        *([f"%c M  cc {scale} ccc cccc cccc cccc cccc ccccc ccccc ccccc ccccc"] * 2),
        *(["%f  0.0000000  0.000000000  0.00000000000  0.000000000000000"] * 2),
        *(["%i    0    0    0    0      0      0      0      0         0"] * 2 + ["/* "] * 4),
    ]
    for k, date in enumerate(dates):
        lines.append(f"*  {date:%Y %m %d %H %M}  0.00000000")
        for name, orbit in orbits.items():
            x, y, z = 1e-3 * orbit[k]
            lines.append(f"P{name}{x:14.6f}{y:14.6f}{z:14.6f}{1e6 * clocks[name][k]:14.6f}")
    return "\n".join([*lines, "EOF"]) + "\n"


@pytest.fixture(scope="module")
def sky():
    """Positions of four systems' satellites at 7.5 minutes over six hours, and the clocks."""
    pytest.importorskip("georinex")
    time = TOW + 450.0 * np.arange(49)
    orbits = {
        name: flown(axis, np.radians(45.0 + 3 * k), time)
        for k, (name, axis) in enumerate(AXES.items())
    }
    clocks = {name: a + b * (time - TOW) for name, (a, b) in CLOCKS.items()}
    return time, orbits, clocks


def every_other(time, orbits, clocks):
    return time[::2], {n: x[::2] for n, x in orbits.items()}, {n: c[::2] for n, c in clocks.items()}


@pytest.mark.slow
def test_messages_fitted_to_precise_orbits_are_the_orbits(sky, tmp_path):
    """Oracle: the integrated orbits midway between the positions of the file, and the clocks that
    were put in; the engine's RINEX holds the same messages.
    """
    time, orbits, clocks = sky
    path = tmp_path / "orbits.sp3"
    path.write_text(sp3_text(*every_other(time, orbits, clocks)))
    navigation = read_navigation(path)
    assert navigation.mended == (("messages fitted to precise orbits (SP3)", 20),)
    midway = slice(1, None, 2)
    for name, orbit in orbits.items():
        instants = time[midway]
        states = satellite_states(navigation, [name] * instants.size, instants)
        assert np.linalg.norm(states.position - orbit[midway], axis=1).max() < 0.05
        rows = navigation.satellite == name
        assert_allclose(navigation.table[rows, AF1], CLOCKS[name][1], rtol=0.0, atol=1e-15)
        toe = navigation.table[rows][:, 2] - TOW  # of the clock
        assert_allclose(
            navigation.table[rows, AF0], CLOCKS[name][0] + CLOCKS[name][1] * toe, atol=1e-12
        )
    rinex = tmp_path / "for_the_engine.nav"
    rinex.write_bytes(navigation_bytes(path))
    assert rinex.read_text().startswith("     3.04           N: GNSS NAV DATA")
    again = read_navigation(rinex)
    assert again.mended == ()
    assert_array_equal(again.table, navigation.table)


def test_what_has_no_kepler_elements_or_no_clock_is_counted(sky, tmp_path):
    """Oracle: GLONASS, a geostationary BeiDou and a satellite without a clock beside a good one."""
    time, orbits, clocks = every_other(*sky)
    names = {"G05": "G05", "R01": "G05", "C03": "J02", "E11": "E11"}
    orbits = {name: orbits[other] for name, other in names.items()}
    clocks = {name: clocks[other] for name, other in names.items()}
    clocks["E11"] = np.full(time.size, 0.999999999999)
    path = tmp_path / "orbits.sp3"
    path.write_text(sp3_text(time, orbits, clocks))
    navigation = read_navigation(path)
    assert set(navigation.satellite) == {"G05"}
    assert sorted(count for _, count in navigation.left_out) == [1, 2]
    for text, what in (
        (sp3_text(time, orbits, clocks, "UTC"), "times of SP3 in UTC; GPS time is read"),
        (sp3_text(time[:3], orbits, clocks), "no orbit of an hour at least in 3 epochs"),
        (path.read_text()[:900], "georinex cannot read this file|no orbit of an hour"),
    ):
        path.write_text(text)
        with pytest.raises(InputError, match=what) as refused:
            read_navigation(path)
        assert "\n" not in str(refused.value)


def test_a_missing_georinex_is_told_with_its_extra(monkeypatch, tmp_path):
    """Oracle: the words of the error."""
    monkeypatch.setitem(sys.modules, "georinex", None)
    path = tmp_path / "orbits.sp3"
    path.write_text("#cP2024  3  6  0  0  0.00000000      96 ORBIT\n")
    with pytest.raises(InputError, match=r"SP3 is read by georinex: pip install 'insgnss\[ppk\]'"):
        read_navigation(path)
