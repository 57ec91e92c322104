"""What is asked of rover, base and navigation before the engine runs: each wrong input in one line, with its exit code."""

import os
import re

import numpy as np
import pytest
from scripted_engine import BASE, BASE_LLH, Fake, navigation, observations, one_line, standing

from insgnss.cli import main
from insgnss.errors import DataError, InputError, UsageError
from insgnss.gnss.preflight import Whereabouts


@pytest.fixture
def fake(tmp_path):
    if os.name == "nt":
        pytest.skip("a script is no program on Windows")
    return Fake(tmp_path)


def wrong_input(fake, name):
    """Change one input of a solution that would go well; words of the error."""
    if name == "base of another day":
        fake.base.write_text(observations(day=5, approx=BASE))
        return "no common time; is it the base of another day"
    if name == "single frequency":
        fake.rover.write_text(observations(types=("C1", "L1")))
        return "0% of its epochs have 4 satellites with phases of 2 frequencies"
    if name == "truncated":
        fake.rover.write_text(fake.rover.read_text()[:-40])
        return "truncated"
    if name == "RINEX 4":
        fake.base.write_text(fake.base.read_text().replace("     2.11", "     4.00"))
        return "RINEX 4.00"
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
        return r"the base moves: 22[23] m about its median, by codes \(limit 15 m\); the rover .* stands: are rover and base swapped\?"
    if name == "both move":
        fake.does(where_base={"pos": standing(step=0.001)}, where_rover={"pos": standing(step=0.002)})
        return "the base moves: .* so does the rover .* cut the file to the time in which it does"
    if name == "the base moves, no word of the rover":
        fake.does(where_base={"pos": standing(step=0.001)})
        return r"the base moves: .* are rover and base swapped\?$"
    if name == "swapped":
        fake.does(where_base={"pos": standing(lat=BASE_LLH[0] + 0.01)}, where_rover={"pos": standing()})
        return "stands 111[0-9] m from the base coordinates, and the rover .* stands there: they are swapped"
    if name == "swapped, 20 m apart":
        fake.does(where_base={"pos": standing(lat=BASE_LLH[0] + 2e-4)}, where_rover={"pos": standing()})
        return "stands 2[0-9] m from the base coordinates, and the rover .* stands there: they are swapped"
    if name == "coordinates of the rover's header":
        fake.rover.write_text(observations(approx=BASE))
        fake.base.write_text(observations(approx=(BASE[0] + 2.0, *BASE[1:])))
        return "coordinates are those of the header of the rover .* are the two swapped"
    if name == "coordinates of another place":
        fake.does(where_base={"pos": standing(lat=BASE_LLH[0] + 0.01)}, where_rover={"pos": standing(step=0.001)})
        return r"stands 111[0-9] m from the base coordinates \(limit 50 m\); check them, or are rover and base swapped"
    fake.does(where_base={"pos": ""})
    return "no position from codes"


WRONG = ["base of another day", "single frequency", "truncated", "RINEX 4", "not RINEX", "navigation of another day", "no GPS navigation"]
WRONG += ["one file twice", "no coordinates of the base", "the base moves", "both move", "the base moves, no word of the rover", "swapped"]
WRONG += ["swapped, 20 m apart", "coordinates of the rover's header", "coordinates of another place", "no position of the base"]
NOT_IN_THE_DATA = {"single frequency", "no position of the base"}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_input_is_told_in_one_line_before_the_engine_runs(fake, name):
    """Oracle: the words of the error, and the runs that the script noted."""
    what = wrong_input(fake, name)
    kwargs = {"base_position_m": None, "base_point": None} if name == "no coordinates of the base" else {}
    with pytest.raises((InputError, DataError), match=what) as info:
        fake.solve(**kwargs)
    one_line(info)
    assert not fake.log.exists() or set(fake.told()) <= {"where_base", "where_rover"}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_input_is_one_line_of_the_command(fake, name, capsys):
    """Oracle: exit codes of the contract, 3 for a wrong input and 4 for data that do not support the answer."""
    what = wrong_input(fake, name)
    latitude, longitude, height = BASE_LLH
    place = [] if name == "no coordinates of the base" else [f"--base-position={latitude},{longitude},{height}"]
    files = [str(fake.rover), "--base", str(fake.base), "--navigation", str(fake.nav)]
    code = main(["ppk", *files, *place, "--engine", str(fake.program), "--out", str(fake.out), "--quiet"])
    said = capsys.readouterr().err
    assert code == (4 if name in NOT_IN_THE_DATA else 3)
    assert said.startswith("insgnss: error: ")
    assert said.count("\n") == 1
    assert re.search(what, said.strip())
    assert not fake.log.exists() or set(fake.told()) <= {"where_base", "where_rover"}


def test_a_base_that_is_metres_off_its_coordinates_is_told(fake):
    """Oracle: 22.3 m (2e-4 deg of a meridian) from the script's position, the rover elsewhere; 6.7 m are within what codes know."""
    moving = {"where_rover": {"pos": standing(step=0.001)}}
    fake.does(where_base={"pos": standing(lat=BASE_LLH[0] + 2e-4)}, **moving)
    (check,) = fake.solve().checks
    assert (check.name, check.verdict) == ("base coordinates", "note")
    assert re.match(r"22\.\d m from the position of .*base\.18o by codes", check.found)
    fake.does(where_base={"pos": standing(lat=BASE_LLH[0] + 6e-5)}, **moving)
    assert fake.solve().checks == ()


@pytest.mark.parametrize(
    ("speed", "sd", "scatter", "what"),
    [
        (np.full(100, 0.01), 0.01, 2.0, ""),
        (np.full(100, 0.25), 0.10, 2.0, ""),
        (np.repeat([0.01, 9.0], [97, 3]), 0.01, 2.0, ""),
        (np.repeat([0.01, 1.4], [90, 10]), 0.01, 2.0, "at 1.4 m/s, and in 10% of its time (limit 5%) above 0.2 m/s, by phase"),
        (np.empty(0), 0.01, 2.0, ""),
        (np.empty(0), 0.01, 40.0, "40 m about its median, by codes (limit 15 m)"),
    ],
)
def test_what_moves(speed, sd, scatter, what):
    """Oracle: speeds and distances as they are made: 3 sigma above 0.2 m/s for more than 5 %, points on a line to either side."""
    points = np.array(BASE) + np.outer(np.linspace(-scatter, scatter, 201) / 0.9, [0.0, 0.0, 1.0])
    assert Whereabouts(points, speed, np.full(speed.size, sd)).motion() == what


def test_missing_navigation_is_told(fake):
    """Oracle: the words of the error."""
    with pytest.raises(InputError, match="no navigation file; give the broadcast ephemerides") as info:
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
    checks = {check.name: check for check in fake.solve(base_position_m=None, base_point=None).checks}
    assert set(checks) == {"base coordinates"}
    assert "APPROX POSITION XYZ" in checks["base coordinates"].found
    assert "taken as marker" in checks["base coordinates"].found


def test_a_base_that_ends_early_is_told(fake):
    """Oracle: 2 of 5 epochs within half a second of the base's two."""
    fake.base.write_text(observations(approx=BASE, epochs=2))
    (check,) = fake.solve(max_age_s=0.5).checks
    assert check.name == "epochs with a base"
    assert check.found.startswith("40.0% of 5 epochs")
