"""Units with the value of one count, clocks with their epochs, samples without a column of time."""

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from insgnss.base.errors import InputError, UsageError
from insgnss.io.formats import (
    SENSOR_SCALES,
    read_events,
    read_gnss,
    read_imu,
    split_unit,
    unit_factor,
)


@pytest.mark.parametrize(
    ("text", "kind", "factor"),
    [
        ("deg/s", "gyro", np.pi / 180),
        ("0.05 deg/s", "gyro", 0.05 * np.pi / 180),
        ("1e-3 rad/s", "gyro", 1e-3),
        (".5 °/s", "gyro", 0.5 * np.pi / 180),
        ("m/s²", "accel", 1.0),
        ("0.00333 g", "accel", 0.00333 * 9.80665),
        ("2*mg", "accel", 2e-3 * 9.80665),
        ("0.1 arcsec", "gyro increment", 0.1 * np.pi / 648000),
        ("125 ug*s", "accel increment", 125e-6 * 9.80665),
        ("ms", "time", 1e-3),
        ("km/h", "velocity", 1 / 3.6),
        ("knots", "velocity", 1852 / 3600),
    ],
)
def test_factor(text: str, kind: str, factor: float) -> None:
    """Oracle: definitions of the units, by hand."""
    assert unit_factor(text, kind) == pytest.approx(factor, rel=1e-15)


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("g", "gyro"),
        ("0 deg/s", "gyro"),
        ("-1 g", "accel"),
        ("counts", "accel"),
        ("", "time"),
        ("5", "time"),
    ],
)
def test_what_is_no_unit_of_its_kind(text: str, kind: str) -> None:
    """Oracle: the list of data_specs/README.md."""
    with pytest.raises(UsageError):
        unit_factor(text, kind)


def test_every_unit_is_found_by_its_own_name() -> None:
    """Oracle: the table itself."""
    assert all(
        unit_factor(name, kind) == factor
        for kind, units in SENSOR_SCALES.items()
        for name, factor in units.items()
    )
    assert split_unit("0.05 deg/s") == (0.05, "deg/s")


def counts(tmp_path: Path, columns: str = "", first: str = "") -> Path:
    path = tmp_path / "counts.txt"
    path.write_text(
        columns + "".join(f"{first.format(k)}{k} 0 0 0 0 {300 + k}\n" for k in range(5))
    )
    return path


def test_counts_without_a_column_of_time(tmp_path: Path) -> None:
    """Oracle: counts times the value of one, k / rate, by hand."""
    imu = read_imu(
        counts(tmp_path), units={"gyro": "0.05 deg/s", "accel": "0.00333 g"}, rate_hz=50.0
    )
    assert_allclose(imu.time, [0.0, 0.02, 0.04, 0.06, 0.08], rtol=0, atol=1e-15)
    assert_allclose(np.degrees(imu.gyro[:, 0]), 0.05 * np.arange(5), rtol=1e-14)
    assert_allclose(imu.accel[:, 2], 0.00333 * 9.80665 * (300 + np.arange(5)), rtol=1e-14)
    with pytest.raises(InputError, match="rate_hz is given, but the file has a time column"):
        read_imu(
            counts(tmp_path, first="{} "),
            columns=["tow", "gx", "gy", "gz", "ax", "ay", "az"],
            rate_hz=50.0,
        )
    with pytest.raises(UsageError, match="rate_hz = -1"):
        read_imu(counts(tmp_path), rate_hz=-1.0)


def test_milliseconds_of_caller_and_header(tmp_path: Path) -> None:
    """Oracle: thousandths."""
    spec = {"columns": ["tow", "gx", "gy", "gz", "ax", "ay", "az"], "units": {"time": "ms"}}
    assert_allclose(
        read_imu(counts(tmp_path, first="2000{}0 "), **spec).time,
        200.0 + 0.01 * np.arange(5) + 0.0,
        rtol=0,
        atol=1e-9,
    )
    head = "time[ms] gx gy gz ax ay az\n"
    assert_allclose(
        read_imu(counts(tmp_path, head, "2000{}0 ")).time,
        200.0 + 0.01 * np.arange(5),
        rtol=0,
        atol=1e-9,
    )


@pytest.mark.parametrize(
    ("unit", "factor"), [("unix", 1), ("unix_ms", 10**3), ("unix_us", 10**6), ("unix_ns", 10**9)]
)
def test_unix_time(tmp_path: Path, unit: str, factor: int) -> None:
    """Oracle: datetime arithmetic in integers, 18 leap seconds in 2018; a float64 of Unix
    nanoseconds holds 0.3 us.
    """
    whole = int(datetime(2018, 7, 3, 10, 20, 30, tzinfo=UTC).timestamp())
    (tmp_path / "e.txt").write_text("".join(f"{k} {(whole + k) * factor}\n" for k in range(3)))
    events = read_events(tmp_path / "e.txt", units={"time": unit})
    elapsed = int((datetime(2018, 7, 3, 10, 20, 30) - datetime(1980, 1, 6)).total_seconds()) + 18
    assert events.gps_week == elapsed // 604800
    assert_allclose(events.time, elapsed % 604800 + np.arange(3), rtol=0, atol=1e-6)
    with pytest.raises(InputError, match="of GPS week 2008, but gps_week is 2009"):
        read_events(tmp_path / "e.txt", units={"time": unit}, gps_week=2009)


def test_gps_seconds_since_1980(tmp_path: Path) -> None:
    """Oracle: 604800 s a week."""
    (tmp_path / "g.txt").write_text(
        f"{2008 * 604800 + 5}.25 46.0 6.0 500.0\n{2008 * 604800 + 6}.25 46.0 6.0 500.0\n"
    )
    fixes = read_gnss(tmp_path / "g.txt", sigma_m=[1, 1, 1], units={"time": "gps"})
    assert (fixes.gps_week, fixes.time.tolist()) == (2008, [5.25, 6.25])
    (tmp_path / "g.txt").write_text("-5 46.0 6.0 500.0\n")
    with pytest.raises(
        InputError, match=r"g.txt:1: time -5.000 s lies before the start of GPS time"
    ):
        read_gnss(tmp_path / "g.txt", sigma_m=[1, 1, 1], units={"time": "gps"})
    with pytest.raises(InputError, match=r"g.txt:1: .*GPS time starts at Unix time"):
        read_gnss(tmp_path / "g.txt", sigma_m=[1, 1, 1], units={"time": "unix"})


def test_speed_and_course_in_their_units(tmp_path: Path) -> None:
    """Oracle: sine and cosine of 30 deg, knots in m/s, by hand; what nothing measured weighs
    nothing.
    """
    (tmp_path / "g.txt").write_text("tow lat lon h speed[kn] course[deg]\n1 46 6 500 10 30\n")
    fixes = read_gnss(tmp_path / "g.txt", sigma_m=[1, 1, 1], sigma_velocity=[0.1, 0.2, 0.3])
    assert fixes.velocity_ned is not None
    assert fixes.velocity_cov_ned is not None
    assert_allclose(
        fixes.velocity_ned[0], [18520 / 3600 * np.sqrt(3) / 2, 18520 / 3600 / 2, 0.0], rtol=1e-14
    )
    assert_allclose(np.sqrt(np.diagonal(fixes.velocity_cov_ned[0])), [0.1, 0.2, 1000.0])
    with pytest.raises(InputError, match="velocity without course"):
        read_gnss(
            tmp_path / "g.txt",
            columns=["tow", "lat", "lon", "h", "speed", "-"],
            sigma_m=[1, 1, 1],
            sigma_velocity=[1, 1, 1],
        )


def test_lengths_and_quality_codes(tmp_path: Path) -> None:
    """Oracle: a thousand mm a metre; NMEA 0183 (4 RTK, 5 float, 1 single) and RTKLIB (1, 2, 5)."""
    (tmp_path / "g.txt").write_text(
        "".join(f"{k} 46 6 500000 20 20 30 {q}\n" for k, q in enumerate((4, 5, 1)))
    )
    fixes = read_gnss(tmp_path / "g.txt", units={"length": "mm", "quality": "nmea"})
    assert fixes.height.tolist() == [500.0] * 3
    assert_allclose(np.sqrt(np.diagonal(fixes.cov_ned[0])), [0.02, 0.02, 0.03])
    assert fixes.quality is not None
    assert fixes.quality.tolist() == [1, 2, 5]
    with pytest.raises(UsageError, match="quality = 'ublox' is none of rtklib, nmea"):
        read_gnss(tmp_path / "g.txt", units={"quality": "ublox"})


def test_columns_by_place(tmp_path: Path) -> None:
    """Oracle: counting fields from 1."""
    path = tmp_path / "g.txt"
    path.write_text("9 6.0 46.0 500.0 1.0\n9 6.0 46.0 500.0 2.0\n")
    fixes = read_gnss(
        path, columns={"tow": "[5]", "lat": "[3]", "lon": "[2]", "h": "[4]"}, sigma_m=[1, 1, 1]
    )
    assert fixes.time.tolist() == [1.0, 2.0]
    assert np.degrees(fixes.lat[0]) == pytest.approx(46.0)
    with pytest.raises(InputError, match=r"there is no field \[6\]; the data have 5"):
        read_gnss(path, columns={"tow": "[6]"})
    with pytest.raises(UsageError, match=r"'\[5\]' is both tow and lat"):
        read_gnss(path, columns={"tow": "[5]", "lat": "[5]"})
