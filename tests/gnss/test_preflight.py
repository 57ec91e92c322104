"""What is asked of rover, base and navigation before the engine runs: each wrong input in one line,
with its exit code.
"""

import os
import re
from dataclasses import replace

import numpy as np
import pytest
from scripted_engine import BASE, BASE_LLH, Fake, navigation, observations, one_line, standing

from insgnss.base.errors import DataError, InputError, UsageError
from insgnss.cli import main
from insgnss.geodesy.frames import geodetic_to_ecef
from insgnss.gnss.engine.base_coordinates import Whereabouts, check_base_point
from insgnss.gnss.engine.preflight import check_navigation, check_observations, check_rover_antenna
from insgnss.gnss.options import EngineOptions
from insgnss.gnss.rinex.navigation_message import TOE, read_navigation
from insgnss.gnss.rinex.observations import read_observations


@pytest.fixture
def fake(tmp_path):
    if os.name == "nt":
        pytest.skip("a script is no program on Windows")
    return Fake(tmp_path)


def wrong_input(fake, name):
    """Change one input of a solution that would go well; words of the error."""
    if name == "base of another day":
        fake.base.write_text(observations(day=5, approx=BASE))
        return "no common time; is this the base file of another day"
    if name == "single frequency":
        fake.rover.write_text(observations(types=("C1", "L1")))
        return "0% of its epochs have 4 satellites with phases of 2 frequencies"
    if name == "truncated":
        fake.rover.write_text(fake.rover.read_text()[:-40])
        return "truncated"
    if name == "RINEX 5":
        fake.base.write_text(fake.base.read_text().replace("     2.11", "     5.00"))
        return "RINEX 5.00"
    if name == "not RINEX":
        fake.rover.write_text("tow,lat,lon,h\n1,2,3,4\n")
        return "is not RINEX"
    if name == "navigation of another day":
        fake.nav.write_text(navigation(day=6))
        return "give the navigation of that day"
    if name == "no GPS navigation":
        fake.rover.write_text(observations(system="E", types=("C1", "L1", "C7", "L7")))
        return "ephemerides of G, but the rover"
    if name == "one file twice":
        fake.base = fake.rover
        return "is given as rover and as base"
    if name == "no coordinates of the base":
        fake.base.write_text(observations())
        return "give the base's coordinates"
    if name == "the base moves":
        fake.does(where_base={"pos": standing(step=0.001)}, where_rover={"pos": standing()})
        return (
            r"the base moves: 22[23] m about its median, by codes \(limit 15 m\); the rover .*"
            r" stands: are rover and base swapped\?"
        )
    if name == "both move":
        fake.does(
            where_base={"pos": standing(step=0.001)}, where_rover={"pos": standing(step=0.002)}
        )
        return "the base moves: .* so does the rover .* cut its file to the time in which it does"
    if name == "the base moves, no word of the rover":
        fake.does(where_base={"pos": standing(step=0.001)}, where_rover={"pos": ""})
        return r"the base moves: .* are rover and base swapped\?$"
    if name == "swapped":
        fake.does(
            where_base={"pos": standing(lat=BASE_LLH[0] + 0.01)}, where_rover={"pos": standing()}
        )
        return (
            "stands 111[0-9] m from the base coordinates, but the rover .* stands at them: rover"
            " and base are swapped"
        )
    if name == "swapped, 20 m apart":
        fake.does(
            where_base={"pos": standing(lat=BASE_LLH[0] + 2e-4)}, where_rover={"pos": standing()}
        )
        return (
            "stands 2[0-9] m from the base coordinates, but the rover .* stands at them: rover"
            " and base are swapped"
        )
    if name == "coordinates of the rover's header":
        fake.rover.write_text(observations(approx=BASE))
        fake.base.write_text(observations(approx=(BASE[0] + 2.0, *BASE[1:])))
        return "coordinates are those in the header of the rover .* are rover and base swapped"
    if name == "coordinates of another place":
        fake.does(
            where_base={"pos": standing(lat=BASE_LLH[0] + 0.01)},
            where_rover={"pos": standing(step=0.001)},
        )
        place = (
            r"stands 111[0-9] m from the base coordinates \(limit 20 m\), by codes at"
            r" 53.290400,-9.057800,70.0"
        )
        return f"{place}; check the base coordinates, or are rover and base swapped"
    fake.does(where_base={"pos": ""})
    return "no position from codes"


WRONG = [
    "base of another day",
    "single frequency",
    "truncated",
    "RINEX 5",
    "not RINEX",
    "navigation of another day",
    "no GPS navigation",
]
WRONG += [
    "one file twice",
    "no coordinates of the base",
    "the base moves",
    "both move",
    "the base moves, no word of the rover",
    "swapped",
]
WRONG += [
    "swapped, 20 m apart",
    "coordinates of the rover's header",
    "coordinates of another place",
    "no position of the base",
]
NOT_IN_THE_DATA = {"single frequency", "no position of the base"}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_input_is_told_in_one_line_before_the_engine_runs(fake, name):
    """Oracle: the words of the error, and the runs that the script noted."""
    what = wrong_input(fake, name)
    kwargs = (
        {"base_position_m": None, "base_point": None}
        if name == "no coordinates of the base"
        else {}
    )
    with pytest.raises((InputError, DataError), match=what) as info:
        fake.solve(**kwargs)
    one_line(info)
    assert not fake.log.exists() or set(fake.told()) <= {"where_base", "where_rover"}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_input_is_one_line_of_the_command(fake, name, capsys):
    """Oracle: exit codes of the contract, 3 for a wrong input and 4 for data that do not support
    the answer.
    """
    what = wrong_input(fake, name)
    latitude, longitude, height = BASE_LLH
    place = (
        []
        if name == "no coordinates of the base"
        else [f"--base-position={latitude},{longitude},{height}"]
    )
    files = [str(fake.rover), "--base", str(fake.base), "--navigation", str(fake.nav)]
    code = main(
        ["ppk", *files, *place, "--engine", str(fake.program), "--out", str(fake.out), "--quiet"]
    )
    said = capsys.readouterr().err
    assert code == (4 if name in NOT_IN_THE_DATA else 3)
    assert said.startswith("insgnss: error: ")
    assert said.count("\n") == 1
    assert re.search(what, said.strip())
    assert not fake.log.exists() or set(fake.told()) <= {"where_base", "where_rover"}


def test_a_base_that_is_metres_off_its_coordinates_is_told(fake):
    """Oracle: 7.8, 4.5, 22.3 m (of a meridian) from the script's position, the rover elsewhere; 4.5
    m are within what codes know.
    """
    moving = {"where_rover": {"pos": standing(step=0.001)}}
    fake.does(where_base={"pos": standing(lat=BASE_LLH[0] + 7e-5)}, **moving)
    (check,) = fake.solve().checks
    assert (check.name, check.verdict) == ("base coordinates", "note")
    assert re.match(r"7\.8 m from the position of .*base\.18o by codes", check.found)
    fake.does(where_base={"pos": standing(lat=BASE_LLH[0] + 4e-5)}, **moving)
    assert fake.solve().checks == ()
    fake.does(where_base={"pos": standing(lat=BASE_LLH[0] + 2e-4)}, **moving)
    with pytest.raises(InputError, match=r"stands 22 m from the base coordinates \(limit 20 m\)"):
        fake.solve()
    advice = r"give gnss\.base_position and gnss\.base_point"
    with pytest.raises(
        InputError, match=rf"stands 22 m from APPROX POSITION XYZ of its header .* {advice}"
    ):
        fake.solve(base_position_m=None, base_point=None)


MISTAKES = {
    "exchanged": (
        (BASE_LLH[1], BASE_LLH[0], 70.0),
        "with latitude and longitude exchanged the coordinates agree",
    ),
    "radians": (
        (*np.radians(BASE_LLH[:2]), 70.0),
        "with latitude and longitude in radians the coordinates agree",
    ),
    "feet": ((*BASE_LLH[:2], 70.0 / 0.3048), "with the height in feet the coordinates agree"),
    "sea level": (
        (*BASE_LLH[:2], 14.0),
        "only the height differs, the position by codes is 56 m above it: give the height above",
    ),
    "too high": (
        (*BASE_LLH[:2], 95.0),
        "only the height differs, the position by codes is 25 m below it: give the height above",
    ),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_coordinates_that_are_mistaken_are_told_as_what_they_are(fake, name):
    """Oracle: the mistakes made on the place where the script says that the base is."""
    (lat, lon, height), what = MISTAKES[name]
    fake.does(where_rover={"pos": standing(step=0.001)})
    given = geodetic_to_ecef(np.radians(lat), np.radians(lon), height)
    with pytest.raises(
        InputError, match=f"by codes at 53.280400,-9.057800,70.0; {re.escape(what)}"
    ) as info:
        fake.solve(base_position_m=tuple(given.tolist()))
    one_line(info)


@pytest.mark.parametrize(
    ("speed", "sd", "scatter", "what"),
    [
        (np.full(100, 0.01), 0.01, 2.0, ""),
        (np.full(100, 0.25), 0.10, 2.0, ""),
        (np.repeat([0.01, 9.0], [97, 3]), 0.01, 2.0, ""),
        (
            np.repeat([0.01, 1.4], [90, 10]),
            0.01,
            2.0,
            "at 1.4 m/s, and in 10% of its time (limit 5%) above 0.2 m/s, by phase",
        ),
        (np.empty(0), 0.01, 2.0, ""),
        (np.empty(0), 0.01, 40.0, "40 m about its median, by codes (limit 15 m)"),
    ],
)
def test_what_moves(speed, sd, scatter, what):
    """Oracle: speeds and distances as they are made: 3 sigma above 0.2 m/s for more than 5 %,
    points on a line to either side.
    """
    points = np.array(BASE) + np.outer(np.linspace(-scatter, scatter, 201) / 0.9, [0.0, 0.0, 1.0])
    assert Whereabouts(points, speed, np.full(speed.size, sd)).motion() == what


def test_missing_navigation_is_told(fake):
    """Oracle: the words of the error."""
    with pytest.raises(
        InputError, match="no navigation file; give the broadcast ephemerides"
    ) as info:
        fake.solve(navigation=[])
    one_line(info)
    with pytest.raises(InputError, match="no such file"):
        fake.solve(navigation=[fake.directory / "absent.18n"])


def test_paths_that_cannot_be_are_told(fake, tmp_path):
    """Oracle: the words of the error."""
    with pytest.raises(InputError, match=r"absent\.atx: cannot be read"):
        fake.solve(base_point="arp", antex=tmp_path / "absent.atx")
    fake.out.write_text("")
    with pytest.raises(UsageError, match="no directory can be made there"):
        fake.solve()


def test_coordinates_of_the_header_are_told(fake):
    """Oracle: the header and the script's position, 0 m apart."""
    checks = {
        check.name: check for check in fake.solve(base_position_m=None, base_point=None).checks
    }
    assert set(checks) == {"base coordinates"}
    assert "APPROX POSITION XYZ" in checks["base coordinates"].found
    assert "taken as marker" in checks["base coordinates"].found


def test_a_base_that_ends_early_is_told(fake):
    """Oracle: 2 of 5 epochs within half a second of the base's two."""
    fake.base.write_text(observations(approx=BASE, epochs=2))
    (check,) = fake.solve(max_age_s=0.5).checks
    assert check.name == "epochs with a base"
    assert check.found.startswith("40.0% of 5 epochs")
    assert check.advice == "give base files that cover the whole flight"


def test_an_age_below_the_pace_of_the_base_is_told_as_that(fake):
    """Oracle: epochs of the rover every 0.25 s, of the base every second: 9 of 17 within 0.3 s; and
    none within 0.1 s half a second off.
    """
    fake.rover.write_text(observations(epochs=17, step=0.25, approx=(BASE[0] - 400.0, *BASE[1:])))
    (check,) = fake.solve(max_age_s=0.3).checks
    assert check.found.startswith("76.5% of 17 epochs")
    assert (
        check.advice == "raise max_age_s (--max-age) to 1 s at least: the base has epochs every 1 s"
    )
    rover, base = read_observations(fake.rover), read_observations(fake.base)
    late = replace(base, time=base.time + 0.125)
    with pytest.raises(
        InputError,
        match=r"no epoch within max_age_s = 0.1 s .* raise max_age_s \(--max-age\) to 1 s at least",
    ):
        check_observations(rover, late, EngineOptions(max_age_s=0.1))
    gap = replace(base, time=base.time + np.array([0.0, 0.0, 0.0, 40.0, 40.0]))
    long = replace(rover, time=rover.time[0] + 2.5 * np.arange(17))
    (check,) = check_observations(long, gap, EngineOptions(max_age_s=5.0))
    assert check.advice == "the base has gaps: give another, or raise max_age_s (--max-age)"


def test_a_third_frequency_that_nobody_observes_is_told(fake):
    """Oracle: the observation types of the two headers."""
    options, types = EngineOptions(frequencies=3), ("C1", "L1", "P2", "L2", "C5", "L5")
    rover, base = read_observations(fake.rover), read_observations(fake.base)
    (check,) = check_observations(rover, base, options)
    assert (check.name, check.verdict) == ("frequencies", "note")
    assert "no phases of a third frequency in" in check.found
    assert str(fake.rover) in check.found
    assert str(fake.base) in check.found
    fake.rover.write_text(observations(types=types))
    (check,) = check_observations(read_observations(fake.rover), base, options)
    assert str(fake.rover) not in check.found
    fake.base.write_text(observations(types=types))
    assert (
        check_observations(read_observations(fake.rover), read_observations(fake.base), options)
        == ()
    )


@pytest.mark.parametrize("system", ["R", "G"])
def test_navigation_of_another_day_beside_the_right_one_is_told(fake, system):
    """Oracle: a message of two days later for one system, of the day for another, both observed."""
    found, rover = read_navigation([fake.nav]), read_observations(fake.rover)
    late = found.table.copy()
    late[:, TOE] += 2 * 86400.0
    other = {"R": "G", "G": "R"}[system]
    both = replace(
        found,
        satellite=np.array([f"{other}02", f"{system}05"]),
        table=np.vstack([found.table, late]),
    )
    rover = replace(rover, satellite=np.where(np.arange(rover.satellite.size) % 2, "R07", "G07"))
    what = f"those of {system} are of 2018-10-06 13:00:00 to 2018-10-06 13:00:00"
    if system == "G":
        with pytest.raises(
            InputError,
            match=(
                f"no ephemerides of GPS for 2018-10-04 .* {what}; give the navigation of that day"
            ),
        ):
            check_navigation(both, rover, EngineOptions())
        return
    (check,) = check_navigation(both, rover, EngineOptions())
    assert check.found.startswith(
        "none of R for 2018-10-04 13:05:00 to 13:05:04 GPST: these systems are left out"
    )
    assert check.found.endswith(what)
    assert check.advice == "give the navigation of that day"
    (check,) = check_navigation(found, rover, EngineOptions())
    assert check.advice == "add their navigation file"


@pytest.mark.parametrize(
    ("given", "chosen", "verdict", "what"),
    [
        (
            {"base_position_m": BASE, "base_point": "apc"},
            True,
            "ok",
            r"taken as the antenna's phase centre \(apc\)$",
        ),
        (
            {"base_position_m": BASE, "base_point": "apc"},
            False,
            "note",
            r"taken as the antenna's phase centre \(apc\), as nothing says$",
        ),
        (
            {"base_position_m": BASE, "base_point": "arp"},
            True,
            "ok",
            r"taken as the antenna's reference point \(arp\)$",
        ),
        ({}, True, "ok", r"taken as the marker \(marker\)$"),
    ],
)
def test_what_stands_at_the_base_coordinates_is_told(fake, given, chosen, verdict, what):
    """Oracle: the coordinates of the script's base, BASE_LLH to a centimetre, and the words of the
    choice.
    """
    check = check_base_point(EngineOptions(**given), read_observations(fake.base).header, chosen)
    assert (check.name, check.verdict) == ("base point", verdict)
    place, _, words = check.found.partition(", ")
    assert np.allclose(
        [float(x) for x in place.split(",")], BASE_LLH, rtol=0.0, atol=[1e-7, 1e-7, 0.01]
    )
    assert re.search(what, words)


def test_an_antex_file_is_of_the_base_alone(tmp_path):
    """Oracle: what the positions are of; without such a file nothing is said."""
    path = tmp_path / "rover.18o"
    path.write_text(observations(types=("C1", "L1")))
    header = read_observations(path).header
    assert check_rover_antenna(EngineOptions(), header) == ()
    (check,) = check_rover_antenna(EngineOptions(antex=tmp_path / "igs20.atx"), header)
    assert "igs20.atx is used for the base alone" in check.found
    assert check.verdict == "ok"
