"""A value that is present and cannot be read is an error; nothing is read as another number."""

from pathlib import Path

import numpy as np
import pytest

from insgnss.base.errors import InputError
from insgnss.base.units import parse_quantity
from insgnss.flight.config.load import read_covariance
from insgnss.gnss.rinex.header import scale_of
from insgnss.gnss.rinex.navigation_message import read_navigation
from insgnss.gnss.rinex.observations import read_observations
from insgnss.io.formats import read_barometer, read_events, read_gnss, read_imu
from insgnss.io.formats.imu.variances import read_variances
from insgnss.io.formats.orientation.mounting_file import read_mounting_file
from insgnss.io.formats.text.layout import float_of


def sentence(body: str) -> str:
    check = 0
    for byte in body.encode():
        check ^= byte
    return f"${body}*{check:02X}\r\n"


def epoch(k: int, **changed: str) -> str:
    """GGA, RMC and GST of second k; fields of the GGA changed by name."""
    clock = f"1000{k:02d}.00"
    fields = {"lat": f"4634.2{k:03d}", "quality": "4", "satellites": "20", "hdop": "0.6"}
    fields |= {"age": "1.4"} | changed
    place = f"{fields['lat']},N,00632.4,E"
    rest = f"580.5,M,49.5,M,{fields['age']},74"
    described = f"{fields['quality']},{fields['satellites']},{fields['hdop']}"
    return (
        sentence(f"GNGGA,{clock},{place},{described},{rest}")
        + sentence(f"GNRMC,{clock},A,,,,,0.01,90.0,030718,,,A")
        + sentence(f"GNGST,{clock},2,,,,0.01,0.02,0.03")
    )


def fixes(path: Path, text: str, mark: bytes = b""):
    path.write_bytes(mark + text.encode())
    return read_gnss(path)


def test_a_byte_order_mark_hides_no_sentence(tmp_path: Path) -> None:
    """Oracle: the same log without the mark."""
    text = "".join(epoch(k) for k in range(3))
    plain, marked = (fixes(tmp_path / "x.nmea", text, mark) for mark in (b"", b"\xef\xbb\xbf"))
    assert marked.time.tolist() == plain.time.tolist()
    assert marked.time.size == 3


def test_sentences_joined_in_one_line_all_count(tmp_path: Path) -> None:
    """Oracle: the same log with its line ends; a damaged sentence spoils no whole one behind it."""
    text = "".join(epoch(k) for k in range(4))
    whole = fixes(tmp_path / "x.nmea", text)
    joined = fixes(tmp_path / "x.nmea", text.replace("\r\n$GNRMC", "$GNRMC").replace("\r\n", "\n"))
    assert np.array_equal(joined.time, whole.time)
    assert np.array_equal(joined.lat, whole.lat)
    many = "".join(epoch(k) for k in range(60))
    begun = fixes(tmp_path / "x.nmea", many.replace("$GNGGA,100030", "$GNGGA,1000$GNGGA,100030"))
    assert begun.time.size == 60
    assert "left out 1 lines without a right checksum" in begun.notes[0].found


@pytest.mark.parametrize("field", ["quality", "satellites", "hdop", "age", "lat"])
@pytest.mark.parametrize("value", ["x", "1_0", "1e-320", "1,5".replace(",", "\N{MIDDLE DOT}")])
def test_a_field_of_a_sentence_that_is_no_number_is_refused(
    tmp_path: Path, field: str, value: str
) -> None:
    """Oracle: the rule itself, at the sentence's line."""
    with pytest.raises(InputError, match=r"x\.nmea:4: "):
        fixes(tmp_path / "x.nmea", epoch(0) + epoch(1, **{field: value}))


def test_text_among_the_numbers_of_a_solution_is_refused(tmp_path: Path) -> None:
    """Oracle: a column of text alone is none of numbers; a field among them is one, at its line."""
    path, head = tmp_path / "x.txt", "tow,lat,lon,h,sd_n,sd_e,sd_u,ratio\n"
    rows = [f"{k},46.5,6.5,600,0.01,0.01,0.02,{{}}\n" for k in range(3)]
    path.write_text(head + "".join(rows).format("n/a", "n/a", "n/a"))
    assert read_gnss(path).ratio is None
    path.write_text(head + "".join(rows).format("3.1", "n/a", "4.2"))
    with pytest.raises(InputError, match=r"x\.txt:3: 'n/a' in field 8"):
        read_gnss(path)


def test_a_sentence_without_its_fields_is_refused(tmp_path: Path) -> None:
    """Oracle: NMEA 0183, a GGA has its height in field 9."""
    short = sentence("GNGGA,100000.00,4634.2,N,00632.4,E,4,20,0.6")
    (tmp_path / "x.nmea").write_text(epoch(0) + short)
    with pytest.raises(InputError, match=r"x\.nmea:4: GGA of 9 fields"):
        read_gnss(tmp_path / "x.nmea", undulation_m=49.5)


OTHERS = ("\u0661\u0662", "\uff11\uff12", "\u22125", "1_0", "12\u00b2", "0x1p3", "1e-320", "1e-400")


@pytest.mark.parametrize("text", [*OTHERS, "nan", "inf", "1e308", "1,5", "1e", "", "1 2", "\u06db"])
def test_the_rule_of_numbers_refuses(text: str) -> None:
    """Oracle: no spelling of a finite number in ASCII with a point, or one beyond 10^150."""
    assert float_of(text) is None


@pytest.mark.parametrize("text", ["0", "-0.0", "0e-400", "1.", ".5", "+1E3", "1" * 30, "1e-200"])
def test_the_rule_of_numbers_takes_what_python_takes(text: str) -> None:
    """Oracle: float()."""
    assert float_of(text) == float(text)


def test_the_decimal_sign_of_a_table_is_the_only_one() -> None:
    """Oracle: 1.500 beside decimal commas may be fifteen hundred."""
    assert float_of("1,5", ",") == 1.5
    assert float_of("1.500", ",") is None


@pytest.mark.parametrize("value", OTHERS)
def test_every_reader_of_numbers_refuses_other_spellings(tmp_path: Path, value: str) -> None:
    """Oracle: the rule itself, in a table read by the kernel, a header, a quantity, a log."""
    imu, table = tmp_path / "imu.csv", "tow,gx,gy,gz,ax,ay,az\n1,2,3,4,5,6,7\n"
    imu.write_text(table + f"2,{value},3,4,5,6,7\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"imu\.csv:3: "):
        read_imu(imu)
    imu.write_text(f"{value},2,3,4,5,6,7\n2,2,3,4,5,6,7\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"imu\.csv:1: "):
        read_imu(imu, columns=table.split("\n")[0].split(","))
    heights = tmp_path / "h.txt"
    heights.write_text(f"tow h\n1 100\n2 {value}\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"h\.txt:3: "):
        read_barometer(heights)
    with pytest.raises(InputError):
        parse_quantity(f"{value} deg/h", "deg/h")
    log = tmp_path / "x.log"
    log.write_text(
        "FMT, 129, 31, IMU, QBffffff, TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ\n"
        f"IMU, 1, 0, {value}, 0, 0, 0, 0, 0\n",
        encoding="utf-8",
    )
    with pytest.raises(InputError, match="1 of 2 lines are no message"):
        read_imu(log)


def test_counts_of_variances_are_whole_numbers(tmp_path: Path) -> None:
    """Oracle: a recording of 250.7 samples was taken as one of 250; JSON texts as numbers."""
    path = tmp_path / "x.txt"
    rows = "# rate_hz = 100\n# axis = gyro_x\n# scale_s wavelet_variance\n0.02 1e-6\n"
    path.write_text(f"# samples = 250.7\n{rows}")
    with pytest.raises(InputError, match=r"x\.txt:1: samples 250\.7; it must be a whole number"):
        read_variances(path)
    curve = '{"scales": [0.02], "variance": ["1e-6"], "ci_low": [5e-7], "ci_high": [2e-6]}'
    path.write_text(
        f'{{"wvar": {{"x": {curve}}}, "type": "gyro", "axis": "x", "freq": 100, "n": 250}}'
    )
    with pytest.raises(InputError, match="variance"):
        read_variances(path)


@pytest.mark.parametrize("text", ["G   12", "G   1x", "     1", "G    0"])
def test_a_scale_factor_that_is_none_is_refused(text: str) -> None:
    """Oracle: RINEX 3.04, factors of 1, 10, 100 and 1000 behind the system's letter."""
    record = (7, "SYS / SCALE FACTOR", f"{text}  1 L1C".ljust(60))
    with pytest.raises(InputError, match="x:7: SYS / SCALE FACTOR"):
        scale_of("x", [record], {"G": ("L1C",)})


def test_a_message_of_another_script_is_refused(tmp_path: Path) -> None:
    """Oracle: int() and float() read these digits and the underscore, RINEX has none."""
    head = "     3.04           N: GNSS NAV DATA    G: GPS              RINEX VERSION / TYPE\n"
    head += "END OF HEADER".rjust(73) + "\n"
    clock = "G05 2018 10 04 14 00 00-1.000000000000D-04 1.000000000000D-12 0.000000000000D+00\n"
    rest = "     6.000000000000D+01 2.000000000000D+01 4.500000000000D-09 1.000000000000D+00\n" * 7
    for old, new in (("14 00", "1_4 0"), ("-12 0.0", "-12 0_0"), ("10 04", "99 04")):
        (tmp_path / "x.nav").write_text(head + clock.replace(old, new) + rest)
        with pytest.raises(InputError, match=r"x\.nav:3: .*(no number|no date)"):
            read_navigation(tmp_path / "x.nav")


def test_what_stands_between_seconds_and_flag_is_refused(tmp_path: Path) -> None:
    """Oracle: RINEX 2.11, table A2: two blanks there; a label stands in columns 61 to 80."""
    page = (Path(__file__).parents[3] / "data_specs/rinex.md").read_text()
    text, path = page.partition("```true\n")[2].partition("```")[0], tmp_path / "x.18o"
    path.write_text(text)
    assert read_observations(path).events.size == 2
    path.write_text(text.replace("0.0421877  5", "0.0421877 65"))
    with pytest.raises(InputError, match=r"x\.18o:11: .*where an epoch must begin"):
        read_observations(path)
    path.write_text(text.replace("0.0000        0.0000    ", "0.0000        0.0000   ", 1))
    with pytest.raises(InputError, match=r"x\.18o:6: ANTENNA: DELTA H/E/N stands beside"):
        read_observations(path)


def test_a_message_without_its_sensor_and_an_image_without_its_number(tmp_path: Path) -> None:
    """Oracle: the count of what was left out, and the rule itself."""
    log = "FMT, 129, 31, IMU, QBffffff, TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ\n"
    log += "FMT, 130, 50, GPS, QBBIHLLe, TimeUS,I,Status,GMS,GWk,Lat,Lng,Alt\n"
    log += "FMT, 131, 50, CAM, QH, TimeUS,Img\n"
    for k in range(30):
        log += f"GPS, {10**6 + 20000 * k}, 0, 3, {200000000 + 20 * k}, 2008, 46.57, 6.54, 580.5\n"
        log += f"IMU, {10**6 + 20000 * k}, {'nan' if k == 7 else 0}, 0, 0, 0, 0, 0, -9.8\n"
    path = tmp_path / "x.log"
    path.write_text(log + "CAM, 1500000, 3.5\n")
    imu = read_imu(path)
    assert imu.time.size == 29
    assert any("1 IMU messages without a sensor number" in note.found for note in imu.notes)
    with pytest.raises(InputError, match="CAM 1: Img is"):
        read_events(path)


def test_a_setting_beyond_all_quantities_is_refused(tmp_path: Path) -> None:
    """Oracle: the rule itself: 1e-400 was zero, a sigma of 1e200 a stray overflow."""
    path = tmp_path / "covariance.toml"
    for value in ("1e-400", "-1e999", "9" * 400):
        path.write_text(f"ppm = [{value}, 1, 2]\n")
        with pytest.raises(InputError, match=r"covariance\.toml:"):
            read_covariance(path)
    given = "[mounting]\nantenna_m = [1, 2, 3]\n[calibration.sigma]\nantenna_m = [1e200, 1, 1]\n"
    path.write_text(given)
    with pytest.raises(InputError, match=r"covariance\.toml:4: .*below 1e\+150"):
        read_mounting_file(path, np.eye(3))
