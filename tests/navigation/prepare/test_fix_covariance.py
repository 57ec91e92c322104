"""Ready positions of an engine: which are calibrated, which are left as they are, and what that
does for a car in a city.
"""

from pathlib import Path

import numpy as np
import pytest

from insgnss import load_flight
from insgnss.base.errors import InputError
from insgnss.flight.processing.recording import covariance_rules
from insgnss.geodesy.earth import curvature_radii
from insgnss.geodesy.frames import geodetic_to_ecef
from insgnss.gnss.covariance_model import MODEL
from insgnss.io.formats import read_gnss
from insgnss.io.formats.gnss.rtklib_pos import read_pos_rows, read_rtklib_pos
from insgnss.io.formats.gnss.rtklib_pos_write import write_rtklib_pos
from insgnss.io.formats.read_options import ReadOptions
from insgnss.navigation.prepare.fix_covariance.classes import base_distance, calibrate
from insgnss.navigation.prepare.fix_covariance.decision import (
    KEEP_SIGMAS,
    CovarianceRules,
    decide,
    with_calibration,
)
from insgnss.navigation.prepare.fix_covariance.numbers import MEASURED

DATA = Path(__file__).parents[4] / "shared" / "data"
LEGEND = (
    "% (lat/lon/height=WGS84/ellipsoidal,Q=1:fix,2:float,3:sbas,4:dgps,5:single,6:ppp,ns=# of"
    " satellites)\n"
)
BASE = "% ref pos   : 46.500000000    6.480000000   480.0000\n"
BASE_PLACE = (np.radians(46.5), np.radians(6.48), 480.0)
COLUMNS = (
    "%  GPST  latitude(deg) longitude(deg)  height(m) Q  ns sdn(m) sde(m) sdu(m) sdne(m) sdeu(m)"
    " sdun(m) age(s) ratio\n"
)
ROOTS = "0.0050 0.0050 0.0100 0.0010 -0.0010 0.0010   0.10   20.5"


def written(path, base=BASE, columns=COLUMNS, dated=False):
    """50 s fixed, 20 s float, 50 s fixed, at 1 Hz, 46.5 N 6.5 E."""
    ns = " 14" if " ns " in columns else ""
    rows = []
    for k in range(120):
        when = (
            f"2018/05/06 00:{16 + (40 + k) // 60:02d}:{(40 + k) % 60:02d}.000"
            if dated
            else f"2000 {1000.0 + k:.3f}"
        )
        rows.append(
            f"{when} 46.500000000 6.500000000 500.0000 {2 if 50 <= k < 70 else 1}{ns} {ROOTS}\n"
        )
    path.write_text("".join([base, LEGEND, columns, *rows]))
    return path


@pytest.mark.parametrize("dated", [False, True])
def test_a_file_that_tells_all_is_calibrated_as_a_run_of_our_own(tmp_path, dated):
    """Oracle: `calibrate` with the numbers that were written into the file."""
    path = written(tmp_path / "a.pos", dated=dated)
    fixes = read_rtklib_pos(path)
    base = geodetic_to_ecef(*BASE_PLACE)
    expected, _ = calibrate(fixes, np.full(120, 14), base_distance(fixes, base))
    got = with_calibration(fixes)[0]
    assert np.array_equal(got.cov_ned, expected.cov_ned)
    assert np.array_equal(got.quality, expected.quality)
    assert np.sqrt(got.cov_ned[60, 0, 0]) > 0.3
    assert got.notes[-1].advice.endswith(KEEP_SIGMAS)


def test_a_base_in_geocentric_coordinates_is_taken_as_such(tmp_path):
    """Oracle: 1534 m between two points on a parallel, by the radius of the ellipsoid there."""
    rover, base = (
        geodetic_to_ecef(np.radians(46.5), np.radians(lon), 500.0) for lon in (6.5, 6.48)
    )
    place = "{:14.4f} {:14.4f} {:14.4f}"
    columns = COLUMNS.replace(
        "latitude(deg) longitude(deg)  height(m)", "x-ecef(m) y-ecef(m) z-ecef(m)"
    )
    for name in ("ne", "n", "e", "u"):
        columns = columns.replace(
            f"sd{name}(m)", {"ne": "sdxy(m)", "n": "sdx(m)", "e": "sdy(m)", "u": "sdz(m)"}[name]
        )
    columns = columns.replace("sdeu(m)", "sdyz(m)").replace("sdun(m)", "sdzx(m)")
    rows = "".join(
        f"2000 {1000.0 + k:.3f} {place.format(*rover)} 1 14 {ROOTS}\n" for k in range(20)
    )
    (tmp_path / "a.pos").write_text(
        "% ref pos   :" + place.format(*base) + "\n" + LEGEND + columns + rows
    )
    read = read_pos_rows(tmp_path / "a.pos")
    assert np.linalg.norm(read.base_ecef - rover) == pytest.approx(
        np.radians(0.02) * 6378137.0 * 0.68954, rel=1e-3
    )


@pytest.mark.parametrize(("base", "columns"), [("", COLUMNS), (BASE, COLUMNS.replace(" ns ", " "))])
def test_a_file_that_lacks_base_or_satellites_stays_as_it_is(tmp_path, base, columns):
    """Oracle: the record itself."""
    path = written(tmp_path / "a.pos", base, columns)
    fixes = read_rtklib_pos(path)
    assert with_calibration(fixes)[0] is fixes


def test_a_base_that_is_no_place_is_named_and_nothing_calibrated(tmp_path):
    """Oracle: degrees, minutes and seconds without blanks, as an old RTKLIB writes its base."""
    base = "% ref pos   : 350755.40544 1393727.50368   73.9077\n"
    fixes = read_rtklib_pos(written(tmp_path / "a.pos", base))
    assert "350755 1.39373e+06 73.9077 is no latitude, longitude, height" in fixes.notes[0].found
    assert with_calibration(fixes)[0] is fixes


def test_changes_to_the_model_are_those_of_a_run_of_our_own(tmp_path):
    """Oracle: `calibrate` with the same model; variances grow by the square of the floor that a
    flight file gives.
    """
    path = written(tmp_path / "a.pos")
    fixes = read_rtklib_pos(path)
    model = MODEL.with_changes({"floor_m": {"degraded": (0.1, 0.1, 0.2)}})
    expected, _ = calibrate(
        fixes, np.full(120, 14), base_distance(fixes, geodetic_to_ecef(*BASE_PLACE)), None, model
    )
    (tmp_path / "imu.csv").write_text(
        "tow,gx,gy,gz,ax,ay,az\n1000,0,0,0,0,0,-9.8\n1001,0,0,0,0,0,-9.8\n"
    )
    table = '[imu]\nfile = "imu.csv"\n[gnss]\nfile = "a.pos"\n'
    (tmp_path / "flight.toml").write_text(
        f"{table}[gnss.covariance.floor_m]\ndegraded = [0.1, 0.1, 0.2]\n"
    )
    got, _ = decide(fixes, covariance_rules(load_flight(tmp_path)))
    assert np.array_equal(got.cov_ned, expected.cov_ned)
    (tmp_path / "flight.toml").write_text(table)
    plain, _ = decide(fixes, covariance_rules(load_flight(tmp_path)))
    grown = np.diagonal(got.cov_ned - plain.cov_ned, axis1=1, axis2=2)[20]
    assert np.allclose(
        grown, np.square([0.1, 0.1, 0.2]) - np.square(MODEL.floor_m["degraded"]), rtol=1e-9
    )


def test_changes_to_the_model_are_refused_where_the_file_does_not_tell_what_it_needs(tmp_path):
    """Oracle: a .pos without base, and a text of positions; both stay as they are."""
    model = MODEL.with_changes({"gate": 20.0})
    path = written(tmp_path / "a.pos", base="")
    (tmp_path / "gnss.txt").write_text(
        "".join(f"{10 + k}.0 46.5 6.5 500.0 0.02 0.02 0.03 1\n" for k in range(3))
    )
    for file in (path, tmp_path / "gnss.txt"):
        fixes = read_gnss(file, gps_week=2000)
        with pytest.raises(
            InputError,
            match=(
                rf"{file.name}: gnss\.covariance calibrates positions with quality, satellites"
                r" and base"
            ),
        ):
            with_calibration(fixes, model, required=True)
        assert with_calibration(fixes)[0] is fixes


def test_rules_act_in_their_order_and_the_sentence_counts_them(tmp_path):
    """Oracle: the table by hand. Fixed epochs of 5 mm are degraded (4 x 5 mm, floor 25 mm), float
    ones raised to 0.4 m north, and longitudes in steps of 1e-6 deg (77 mm) enlarge all in the east.
    """
    path = written(tmp_path / "a.pos")
    text = path.read_text().splitlines(keepends=True)
    steps = [
        line.replace(" 6.500000000 ", f" 6.50000{k % 10}000 ") if line[0] != "%" else line
        for k, line in enumerate(text)
    ]
    path.write_text("".join(steps))
    fixes = read_rtklib_pos(path)
    got, sentence = decide(fixes, CovarianceRules(MEASURED, floors={2: (0.4, 0.1, 0.1)}))
    assert sentence == (
        "covariances of the GNSS positions: of their source; calibrated by class (100 degraded: 4"
        " sigma, floor 0.025 / 0.025 / 0.04 m, 10 float: 3 sigma, floor 0.3 / 0.3 / 0.6 m, 10"
        " isolated: 30 sigma, floor 0.3 / 0.3 / 0.6 m); 20 of 120 raised to gnss.quality_sigma_m;"
        " 0 left out; 120 enlarged by the rounding of their positions"
    )
    ppm = 1e-6 * base_distance(fixes, fixes.base_ecef)[[10, 51]]
    north = np.hypot([0.02, 0.4], [0.025, 0.0])
    assert np.allclose(
        got.cov_ned[[10, 51], 0, 0], north**2 + np.array([1.0, 0.0]) * ppm**2, rtol=1e-9
    )
    step = np.radians(1e-6) * curvature_radii(fixes.lat[0])[1] * np.cos(fixes.lat[0])
    assert got.cov_ned[10, 1, 1] == pytest.approx(
        0.02**2 + 0.025**2 + ppm[0] ** 2 + step**2 / 12.0, rel=1e-6
    )


def test_what_ppk_has_calibrated_is_not_calibrated_again(tmp_path):
    """Oracle: the record itself, which has all that a calibration needs."""
    fixes = read_rtklib_pos(written(tmp_path / "a.pos"))
    got, sentence = decide(fixes, CovarianceRules(MEASURED, ppk={"fixed": 120, "float": 0}))
    assert np.array_equal(got.cov_ned, fixes.cov_ned)
    assert "of PPK, calibrated by class (120 fixed: 0.75 sigma, floor 0.001 m); 0 of" in sentence


def test_fixes_without_standard_deviations_are_said_to_have_those_of_the_flight_file(tmp_path):
    """Oracle: rows written by hand: a text without standard deviations, a .pos of six zero roots
    in two of 120 rows.
    """
    (tmp_path / "gnss.txt").write_text("".join(f"{10 + k}.0 46.5 6.5 500.0\n" for k in range(3)))
    columns = ["tow", "lat", "lon", "h"]
    text = read_gnss(tmp_path / "gnss.txt", columns=columns, gps_week=2000, sigma_m=(1, 1, 2))
    assert text.sigma_assumed.tolist() == [True] * 3
    assert (
        "positions: gnss.sigma_m, their source has none; 0 of" in decide(text, CovarianceRules())[1]
    )
    path = written(tmp_path / "a.pos")
    lines = path.read_text().splitlines(keepends=True)
    for k in (10, 20):
        lines[3 + k] = lines[3 + k].replace(ROOTS, "0.0 0.0 0.0 0.0 0.0 0.0 0.10 20.5")
    path.write_text("".join(lines))
    fixes = read_rtklib_pos(path, ReadOptions(sigma_m=(1, 1, 2)))
    assert np.flatnonzero(fixes.sigma_assumed).tolist() == [10, 20]
    assert "of their source, gnss.sigma_m for 2;" in decide(fixes, CovarianceRules())[1]
    assert read_rtklib_pos(written(tmp_path / "a.pos")).sigma_assumed is None


def test_what_was_calibrated_once_is_not_calibrated_again(tmp_path):
    """Oracle: the file that `ppk` writes, read back."""
    path = written(tmp_path / "a.pos")
    once = with_calibration(read_rtklib_pos(path))[0]
    write_rtklib_pos(once, tmp_path / "ppk.pos")
    back = read_rtklib_pos(tmp_path / "ppk.pos")
    assert with_calibration(back)[0] is back
    sigma = [np.sqrt(np.diagonal(fixes.cov_ned, axis1=1, axis2=2)) for fixes in (back, once)]
    assert np.allclose(*sigma, rtol=0.0, atol=1e-6)  # the last digit of the file


def test_a_ready_solution_of_a_car_in_a_city_is_covered():
    """Oracle: an Applanix reference; 21 % of the epochs lie beyond three sigma where the fixed ones
    have those of the file.
    """
    place = DATA / "matrtklib" / "kinematic"
    if not place.is_dir():
        pytest.skip("the recording matrtklib is not here")
    fixes = read_rtklib_pos(place / "rover_1Hz_rtk.pos")
    reference = np.loadtxt(place / "reference.csv", delimiter=",", skiprows=1)
    row = np.searchsorted(reference[:, 0], fixes.time - 1e-3)
    apart = geodetic_to_ecef(fixes.lat, fixes.lon, fixes.height) - reference[row, 5:8]
    there = np.abs(reference[row, 0] - fixes.time) < 2e-3
    for record, least, most in (
        (fixes, 0.2, 1.0),
        (with_calibration(fixes)[0], 0.0, 0.02),
    ):
        sigma = np.sqrt(np.trace(record.cov_ned, axis1=1, axis2=2))
        assert least <= (np.linalg.norm(apart, axis=1) > 3.0 * sigma)[there].mean() <= most
