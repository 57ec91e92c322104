"""IMU, GNSS and event files."""

from datetime import datetime
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from written import image_positions, write_imu_csv

from insgnss.base.errors import InputError, UsageError
from insgnss.io.formats import read_events, read_gnss, read_imu, sniff_gnss, sniff_imu
from insgnss.io.formats.events.events import write_events
from insgnss.io.formats.gnss.gnss_text import (
    ImagePositions,
    write_gnss_text,
    write_image_positions,
)
from insgnss.io.formats.gnss.rtklib_pos import read_rtklib_pos
from insgnss.io.formats.gnss.rtklib_pos_write import write_rtklib_pos
from insgnss.io.formats.read_options import ReadOptions
from insgnss.records import CameraEvents, GnssFixes, ImuSamples

WEEKLY = ["week", "tow", "gx", "gy", "gz", "ax", "ay", "az"]
RNG = np.random.default_rng(20180703)
HEADER = (
    "%  GPST latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m) sdne(m) sdeu(m)"
    " sdun(m) age(s) ratio\n"
)


def write(tmp_path: Path, content: str, name: str = "file.txt") -> Path:
    path = tmp_path / name
    path.write_text(content)
    return path


def imu_text(columns: str, n: int = 3, delimiter: str = ",") -> str:
    rows = np.column_stack(
        [200000 + 0.002 * np.arange(n), np.tile([1.0, 2.0, 3.0, 4.0, 5.0, 6.0], (n, 1))]
    )
    return columns + "".join(delimiter.join(f"{x:.3f}" for x in row) + "\n" for row in rows)


def fixes(n: int = 5, velocity: bool = True) -> GnssFixes:
    A = RNG.normal(size=(2, n, 3, 3))
    P = 1e-4 * (A @ np.swapaxes(A, -1, -2) + np.eye(3))
    return GnssFixes(
        200000 + 0.1 * np.arange(n),
        np.radians(46.57 + 1e-5 * RNG.normal(size=n)),
        np.radians(6.54 + 1e-5 * RNG.normal(size=n)),
        630 + RNG.normal(size=n),
        P[0],
        RNG.normal(size=(n, 3)) if velocity else None,
        P[1] if velocity else None,
        np.arange(n) % 6 + 1,
        2008,
    )


@pytest.mark.parametrize(
    ("unit", "factor"), [("rad/s", 1.0), ("deg/s", np.pi / 180), ("deg/h", np.pi / 648000)]
)
@pytest.mark.parametrize(("accel", "gravity"), [("m/s^2", 1.0), ("g", 9.80665), ("mg", 9.80665e-3)])
def test_imu_units_of_caller_and_header(
    tmp_path: Path, unit: str, factor: float, accel: str, gravity: float
) -> None:
    """Oracle: the definitions of the units."""
    plain = read_imu(write(tmp_path, imu_text("")), units={"gyro": unit, "accel": accel})
    head = (
        "tow[s],"
        + ",".join(f"gyro_{c} ({unit})" for c in "xyz")
        + ","
        + ",".join(f"Acc {c} [{accel}]" for c in "xyz")
        + "\n"
    )
    named = read_imu(write(tmp_path, imu_text(head)))
    for imu in (plain, named):
        assert_allclose(imu.gyro[0], np.array([1, 2, 3]) * factor, rtol=1e-15)
        assert_allclose(imu.accel[0], np.array([4, 5, 6]) * gravity, rtol=1e-15)


def test_imu_columns_by_list_and_by_table(tmp_path: Path) -> None:
    """Oracle: the numbers as a person reads them."""
    path = write(tmp_path, imu_text("", 2))
    imu = read_imu(path, columns=["tow", "az", "ay", "ax", "gz", "gy", "gx"])
    assert imu.gyro[0].tolist() == [6, 5, 4]
    assert imu.accel[0].tolist() == [3, 2, 1]
    path = write(tmp_path, imu_text("Zeit,p,q,r,u,v,w\n", 2))
    with pytest.raises(
        InputError,
        match=r"file.txt:1: the header 'Zeit,p,q,r,u,v,w' does not name tow, gx.*columns = ",
    ):
        read_imu(path)
    imu = read_imu(
        path,
        columns={"tow": "Zeit", "gx": "p", "gy": "q", "gz": "r", "ax": "u", "ay": "v", "az": "w"},
    )
    assert imu.accel[0].tolist() == [4, 5, 6]
    with pytest.raises(InputError, match=r"'P1' is missing or twice in the header"):
        read_imu(path, columns={"tow": "P1"})
    with pytest.raises(InputError, match=r"7 fields, but columns names 3"):
        read_imu(path, columns=["tow", "gx", "gy"])
    with pytest.raises(InputError, match=r"does not name gx"):
        read_imu(path, columns=["tow", "-", "gy", "gz", "ax", "ay", "az"])


@pytest.mark.parametrize(
    ("spec", "error", "message"),
    [
        (
            {"units": {"gyro": "m/s^2"}},
            UsageError,
            "unit of gx gy gz: 'm/s\\^2' is none of rad/s, deg/s, mdeg/s, deg/h",
        ),
        ({"units": {"gyros": "rad/s"}}, UsageError, "'gyros' is none of gyro, accel"),
        (
            {"quantity": "increments", "units": {"accel": "g"}},
            UsageError,
            "unit of ax ay az: 'g' is none of m/s",
        ),
        ({"variable": "x"}, UsageError, "format imu_csv, which takes no variable"),
    ],
)
def test_imu_wrong_use(
    tmp_path: Path, spec: dict[str, object], error: type[Exception], message: str
) -> None:
    """Oracle: the options that data_specs/imu_csv.md lists."""
    with pytest.raises(error, match=message):
        read_imu(write(tmp_path, imu_text("")), **spec)


def test_imu_temperatures_are_rows_of_the_samples_and_refuse_no_file(tmp_path: Path) -> None:
    """Oracle: the numbers as they are written; a blank among them leaves the samples whole."""
    order = [0, 2, 1, *range(3, 400)]
    rows = [f"{0.01 * k:.2f},0,0,0,0,0,-9.8,{20 + k}" for k in order]
    head = "tow,gx,gy,gz,ax,ay,az,{}\n"
    path = write(tmp_path, head.format("temperature") + "\n".join(rows))
    assert read_imu(path).temperature.tolist() == [20.0 + k for k in range(400)]
    columns = {name: name for name in ("tow", "gx", "gy", "gz", "ax", "ay", "az")}
    columns["temperature"] = "die_T"
    path = write(tmp_path, head.format("die_T") + "\n".join(rows))
    assert read_imu(path).temperature is None
    assert read_imu(path, columns=columns).temperature[1] == 21.0
    rows[199] = rows[199].replace("219", "nan")
    path = write(tmp_path, head.format("temperature") + "\n".join(rows))
    imu = read_imu(path)
    assert len(imu) == 400
    assert imu.temperature is None
    (left_out,) = [note for note in imu.notes if note.name == "IMU temperature"]
    assert ":201:" in left_out.found


def test_imu_header_of_another_dimension_is_refused(tmp_path: Path) -> None:
    """Oracle: a gyroscope does not measure m."""
    with pytest.raises(InputError, match=r"file.txt:1: the header gives the unit 'm' for gx gy gz"):
        read_imu(write(tmp_path, imu_text("tow,gx[m],gy[m],gz[m],ax,ay,az\n")))


def test_week_end_is_counted_on_and_a_contradiction_refused(tmp_path: Path) -> None:
    """Oracle: GPS time, 604800 s a week."""
    row = ",0,0,0,0,0,-9.8\n"
    imu = read_imu(
        write(tmp_path, "".join(f"{t}{row}" for t in ("604799.99", "0.00", "0.01"))), gps_week=2008
    )
    assert_allclose(imu.time, [604799.99, 604800.0, 604800.01], rtol=0, atol=1e-9)
    imu = read_imu(
        write(tmp_path, f"2008,604799.99{row}2009,0.0{row}"), columns=WEEKLY, gps_week=2008
    )
    assert_allclose(imu.time, [604799.99, 604800.0], rtol=0, atol=1e-9)
    assert imu.gps_week == 2008
    with pytest.raises(
        InputError, match=r"file.txt:3: time 1.000000 s follows 1.000000 s with other values"
    ):
        read_imu(write(tmp_path, f"# c\n1.0{row}1.0{row.replace('9.8', '9.7')}"))
    with pytest.raises(InputError, match="no GPS time of week"):
        read_imu(write(tmp_path, f"1530600000.0{row}1530600001.0{row}"))
    with pytest.raises(InputError, match="of GPS week 2008, but gps_week is 2009"):
        read_imu(write(tmp_path, f"2008,1{row}2008,2{row}"), columns=WEEKLY, gps_week=2009)


@pytest.mark.parametrize("quantity", ["mean_rate", "increments"])
def test_imu_round_trip(tmp_path: Path, quantity: str) -> None:
    """Oracle: the samples written; half a unit of the last decimal."""
    imu = ImuSamples(
        2e5 + 0.002 * np.arange(50),
        RNG.normal(size=(50, 3)),
        RNG.normal(size=(50, 3)),
        quantity,
        2008,
    )  # type: ignore[arg-type]
    write_imu_csv(imu, tmp_path / "imu.csv")
    back = read_imu(tmp_path / "imu.csv", quantity=quantity, gps_week=2008)
    assert_allclose(back.time, imu.time, atol=0.51e-7, rtol=0)
    assert_allclose(back.gyro, imu.gyro, atol=0.51e-9, rtol=0)
    assert_allclose(back.accel, imu.accel, atol=0.51e-8, rtol=0)


def test_gnss_round_trip(tmp_path: Path) -> None:
    """Oracle: the fixes written; half a unit of the last decimal (6 um in position)."""
    given = fixes()
    write_gnss_text(given, tmp_path / "gnss.txt")
    back = read_gnss(tmp_path / "gnss.txt", gps_week=2008)
    for name in ("lat", "lon"):
        assert_allclose(
            getattr(back, name), getattr(given, name), atol=0.51e-10 * np.pi / 180, rtol=0
        )
    assert_allclose(back.height, given.height, atol=0.51e-4, rtol=0)
    for P, Q in ((back.cov_ned, given.cov_ned), (back.velocity_cov_ned, given.velocity_cov_ned)):
        assert_allclose(
            np.sqrt(np.diagonal(P, axis1=1, axis2=2)),
            np.sqrt(np.diagonal(Q, axis1=1, axis2=2)),
            atol=0.51e-5,
        )
    assert_allclose(back.velocity_ned, given.velocity_ned, atol=0.51e-5)
    assert back.quality is not None
    assert back.quality.tolist() == given.quality.tolist()  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("content", "spec", "message"),
    [
        ("1 46 6 500\n2 46 6 500\n", {}, "no standard deviations sd_n sd_e sd_u; .*sigma_m"),
        ("1 46 6 500\n2 46 6 500\n", {"sigma_m": [0.1, 0.0, 0.1]}, "must be positive"),
        (
            "1 46 6 500 .1 .1 .1\n2 46 6 500 .1 -.1 .1\n",
            {},
            "file.txt:2: standard deviation sd_e is -0.1",
        ),
        (
            "1 46 6 500 .1 .1 .1\n2 96 6 500 .1 .1 .1\n",
            {},
            "file.txt:2: lat 96.000000 deg exceeds 90",
        ),
        ("1 46 6 500 9\n", {}, "5 fields and no header"),
        ("tow lat lon h vn ve\n1 46 6 500 1 1\n", {"sigma_m": [1, 1, 1]}, "velocity without vd"),
        ("tow lat lon alt height\n1 46 6 500 1\n", {"sigma_m": [1, 1, 1]}, "names h twice"),
        (
            "tow lat lon\n1 46 6 500\n",
            {"sigma_m": [1, 1, 1]},
            "does not have the 4 fields of the data",
        ),
    ],
)
def test_gnss_refusals(tmp_path: Path, content: str, spec: dict[str, object], message: str) -> None:
    """Oracle: data_specs/gnss_text.md."""
    with pytest.raises(InputError, match=message):
        read_gnss(write(tmp_path, content), **spec)


def test_gnss_up_velocity_and_radians(tmp_path: Path) -> None:
    """Oracle: down is minus up; pi / 4 is 45 deg."""
    path = write(
        tmp_path,
        "tow latitude[rad] longitude[rad] height vn ve vu\n1 0.7853981633974483 0.1 500 1 2 3\n",
    )
    got = read_gnss(path, sigma_m=[1, 2, 3], sigma_velocity=[0.1, 0.2, 0.3], undulation_m=49.5)
    assert got.velocity_ned is not None
    assert got.velocity_ned[0].tolist() == [1, 2, -3]
    assert got.lat[0] == pytest.approx(np.pi / 4, abs=1e-15)
    assert got.height[0] == 549.5
    assert_allclose(got.cov_ned[0], np.diag([1, 4, 9]))


@settings(
    max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(st.integers(0, 2**31))
def test_pos_round_trip_keeps_the_covariance(tmp_path: Path, seed: int) -> None:
    """Oracle: the covariances written; roots of 6 decimals, so 2 sigma 0.5e-6 and twice that for
    the sum of roundings.
    """
    A = np.random.default_rng(seed).normal(size=(4, 3, 3))
    P = 1e-2 * (A @ np.swapaxes(A, 1, 2) + 0.1 * np.eye(3))
    one = np.zeros(4)
    given_fixes = GnssFixes(
        604799.8 + 0.1 * np.arange(4), one + 0.8, one - 0.1, one + 600, P, P[:, 0], P, None, 2008
    )
    write_rtklib_pos(given_fixes, tmp_path / "x.pos")
    back = read_gnss(tmp_path / "x.pos")
    assert_allclose(back.cov_ned, P, atol=2e-6 * np.sqrt(P.max()))
    assert_allclose(back.velocity_cov_ned, P, atol=2e-6 * np.sqrt(P.max()))
    assert_allclose(back.velocity_ned, P[:, 0], atol=0.51e-5)
    assert_allclose(back.time, given_fixes.time, rtol=0, atol=1e-6)


def test_pos_signed_roots_are_those_of_rtklib(tmp_path: Path) -> None:
    """Oracle: cov = sign(s) s^2 over north, east, up (RTKLIB solution.c), by hand; north-down and
    east-down change sign.
    """
    got = read_gnss(
        write(
            tmp_path,
            HEADER + "2008 1.0 46.0 6.0 500.0 1 9 0.3 0.2 0.4 0.1 -0.15 -0.2 0 9\n",
            "x.pos",
        )
    )
    assert_allclose(
        got.cov_ned[0],
        [[0.09, 0.01, 0.04], [0.01, 0.04, 0.0225], [0.04, 0.0225, 0.16]],
        rtol=0,
        atol=1e-15,
    )


@pytest.mark.parametrize(("scale", "seconds"), [("GPST", 0), ("UTC", 18), ("JST", 18 - 32400)])
def test_pos_time_scales(tmp_path: Path, scale: str, seconds: float) -> None:
    """Oracle: datetime arithmetic from 1980-01-06, 18 leap seconds in 2018."""
    row = "2018/07/03 10:20:30.250 46.0 6.0 500.0 1 9 0.3 0.2 0.4 0.1 -0.15 -0.2 0 9\n"
    got = read_gnss(write(tmp_path, HEADER.replace("GPST", scale) + row, "x.pos"))
    elapsed = (
        datetime(2018, 7, 3, 10, 20, 30, 250000) - datetime(1980, 1, 6)
    ).total_seconds() + seconds
    assert got.gps_week == elapsed // 604800
    assert got.time[0] == pytest.approx(elapsed % 604800, abs=1e-9)


def test_pos_week_and_time_of_week_of_japan(tmp_path: Path) -> None:
    """Oracle: by hand; Japan is nine hours ahead of UTC, which lags 18 s behind GPST."""
    row = "2008 200000.000 46.0 6.0 500.0 1 9 0.3 0.2 0.4 0.1 -0.15 -0.2 0 9\n"
    got = read_gnss(write(tmp_path, HEADER.replace("GPST", "JST") + row, "x.pos"))
    assert (got.gps_week, got.time[0]) == (
        2008,
        pytest.approx(200000.0 - 9 * 3600.0 + 18.0, abs=1e-9),
    )


def test_pos_ecef_and_sexagesimal_agree_with_degrees(tmp_path: Path) -> None:
    """Oracle: pyproj for the position; a rotation of the covariance built from east, north, up
    vectors by hand.
    """
    from pyproj import Transformer

    lat, lon, h = -33.0 - 15 / 60 - 30.5 / 3600, 6.5, 500.0
    tail = " 1 9 0.3 0.2 0.4 0.1 -0.15 -0.2 0 9\n"
    dms = HEADER.replace("latitude(deg)", "latitude(d'\")").replace(
        "longitude(deg)", "longitude(d'\")"
    )
    a = read_gnss(write(tmp_path, dms + f"2008 1.0 -33 15 30.5 6 30 0.0 {h}" + tail, "x.pos"))
    assert_allclose(np.degrees([a.lat[0], a.lon[0]]), [lat, lon], rtol=0, atol=1e-12)
    xyz = Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True).transform(lon, lat, h)
    ecef = (
        "%  GPST x-ecef(m) y-ecef(m) z-ecef(m) Q ns sdx(m) sdy(m) sdz(m) sdxy(m) sdyz(m) sdzx(m)"
        " age(s) ratio\n"
    )
    b = read_gnss(
        write(tmp_path, ecef + "2008 1.0 " + " ".join(f"{x:.6f}" for x in xyz) + tail, "x.pos")
    )
    assert_allclose(
        [b.lat[0], b.lon[0], b.height[0]], [a.lat[0], a.lon[0], h], rtol=0, atol=1e-6
    )  # 1 um along, printed digits
    up = np.array(
        [np.cos(a.lat[0]) * np.cos(a.lon[0]), np.cos(a.lat[0]) * np.sin(a.lon[0]), np.sin(a.lat[0])]
    )
    east = np.cross([0, 0, 1], up) / np.hypot(up[0], up[1])
    C = np.column_stack([np.cross(up, east), east, -up])
    P = np.array([[0.09, 0.01, -0.04], [0.01, 0.04, -0.0225], [-0.04, -0.0225, 0.16]])
    assert_allclose(b.cov_ned[0], C.T @ P @ C, atol=1e-8)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            HEADER.replace(
                "latitude(deg) longitude(deg) height(m)",
                "e-baseline(m) n-baseline(m) u-baseline(m)",
            )
            + "2008 1 1 1 1 1 9 .1 .1 .1 0 0 0 0 9\n",
            "holds baselines, but its header gives no base",
        ),
        (
            "% (lat/lon/height=WGS84/geodetic)\n"
            + HEADER
            + "2008 1 46 6 500 1 9 .1 .1 .1 0 0 0 0 9\n",
            "above the geoid .*undulation_m",
        ),
        (
            HEADER.replace("GPST", "GLO") + "2008 1 46 6 500 1 9 .1 .1 .1 0 0 0 0 9\n",
            "time scale 'GLO'",
        ),
        (HEADER + "2008 1 46 6 500 1 9 .1 .1 .1 0 0 0 0\n", "14 fields, but the header names 15"),
        (HEADER + "2018/13/03 1:2:3 46 6 500 1 9 .1 .1 .1 0 0 0 0 9\n", "holds no date"),
        (
            HEADER + "2008 1 46 6 500 1 9 .1 .1 .1 .2 0 0 0 9\n",
            "x.pos:2: 1 of 1 covariances .* not positive definite",
        ),
        # singular: the least eigenvalue is rounding of either sign, +7e-18 m^2 of these
        (
            HEADER + "2008 1 46 6 500 1 9 .3 .1 .2 .1732050807568877 0 0 0 9\n",
            "x.pos:2: 1 of 1 covariances .* not positive definite",
        ),
        (HEADER + "2008 1 146 6 500 1 9 .1 .1 .1 0 0 0 0 9\n", "x.pos:2: latitude 146"),
        (
            HEADER.replace("sdne(m)", "abcd") + "2008 1 46 6 500 1 9 .1 .1 .1 0 0 0 0 9\n",
            "does not name sdne",
        ),
    ],
)
def test_pos_refusals(tmp_path: Path, content: str, message: str) -> None:
    """Oracle: data_specs/rtklib_pos.md."""
    with pytest.raises(InputError, match=message):
        read_gnss(write(tmp_path, content, "x.pos"))


def test_pos_geodetic_heights_with_undulation(tmp_path: Path) -> None:
    """Oracle: h = H + N."""
    path = write(
        tmp_path,
        "% (lat/lon/height=WGS84/geodetic)\n" + HEADER + "2008 1 46 6 500 1 9 .1 .1 .1 0 0 0 0 9\n",
        "x.pos",
    )
    assert read_rtklib_pos(path, ReadOptions(undulation_m=49.5)).height[0] == 549.5


def test_pos_odd_covariance_and_zero_velocity_are_told(tmp_path: Path) -> None:
    """Oracle: one in two hundred epochs has a correlation of 4, none a velocity."""
    head = HEADER.rstrip("\n") + " vn(m/s) ve(m/s) vu(m/s) sdvn sdve sdvu sdvne sdveu sdvun\n"
    rows = [
        f"2008 {k} 46 6 500 1 9 .1 .1 .1 {0.2 if k == 7 else 0} 0 0 0 9 0 0 0 0 0 0 0 0 0\n"
        for k in range(200)
    ]
    got = read_gnss(write(tmp_path, head + "".join(rows), "x.pos"))
    assert sorted(told.found.split()[0] for told in got.notes) == ["1", "velocities"]
    assert got.velocity_ned is None
    assert_allclose(got.cov_ned[7], 0.01 * np.eye(3), rtol=0, atol=1e-15)


def test_pos_one_percent_of_odd_covariances_is_the_limit(tmp_path: Path) -> None:
    """Oracle: the limit that the refusal names: of 200 epochs 2 are mended and counted, 3 are
    refused.
    """

    def rows(odd: int) -> str:
        return "".join(
            f"2008 {k} 46 6 500 1 9 .1 .1 .1 {0.2 if k < odd else 0} 0 0 0 9\n" for k in range(200)
        )

    (told,) = read_gnss(write(tmp_path, HEADER + rows(2), "x.pos")).notes
    assert told.found.startswith("2 of 200 covariances")
    with pytest.raises(InputError, match=r"3 of 200 covariances .* \(limit 1%\)"):
        read_gnss(write(tmp_path, HEADER + rows(3), "x.pos"))


def nmea(body: str) -> str:
    check = 0
    for c in body.encode():
        check ^= c
    return f"${body}*{check:02X}\r\n"


def epoch(
    clock: str, date: str = "030718", quality: int = 4, gst: bool = True, height: float = 580.5
) -> str:
    gga = nmea(
        f"GNGGA,{clock},4634.20000000,S,00632.40000000,W,{quality},20,0.6,{height},M,-49.5,M,1.4,74"
    )
    return (
        gga
        + nmea(f"GNRMC,{clock},A,,,,,0.012,325.9,{date},,,A")
        + (nmea(f"GNGST,{clock},2,,,,0.01,0.02,0.03") if gst else "")
    )


def test_nmea_over_midnight(tmp_path: Path) -> None:
    """Oracle: datetime arithmetic with 18 leap seconds; degrees and minutes by hand."""
    got = read_gnss(
        write(tmp_path, epoch("235959.90", "070718") + epoch("000000.00", "080718"), "x.nmea")
    )
    elapsed = (datetime(2018, 7, 7, 23, 59, 59, 900000) - datetime(1980, 1, 6)).total_seconds() + 18
    assert got.gps_week == elapsed // 604800
    assert_allclose(got.time, elapsed % 604800 + np.array([0, 0.1]), rtol=0, atol=1e-7)
    assert_allclose(np.degrees([got.lat[0], got.lon[0]]), [-46.57, -6.54], rtol=0, atol=1e-12)
    assert got.height[0] == pytest.approx(531.0, abs=1e-12)
    assert_allclose(got.cov_ned[0], np.diag([1e-4, 4e-4, 9e-4]), rtol=0, atol=1e-15)


def test_nmea_quality_codes_and_counts(tmp_path: Path) -> None:
    """Oracle: NMEA 0183 (1 GPS, 2 DGPS, 4 RTK, 5 float) and RTKLIB (5, 4, 1, 2)."""
    rows = [epoch(f"1000{k // 10:02d}.{k % 10}0", quality=(1, 2, 4, 5)[k % 4]) for k in range(100)]
    content = "".join(rows) + epoch("100020.00", quality=0) + "$GNGGA,broken*00\n"
    got = read_gnss(write(tmp_path, content, "x.nmea"))
    assert (
        "left out 1 lines without a right checksum, 1 epochs without fix, 0 of"
        in got.notes[0].found
    )
    assert got.quality is not None
    assert got.quality[:4].tolist() == [5, 4, 1, 2]


@pytest.mark.parametrize("what", ["checksum", "GST"])
def test_nmea_one_percent_is_the_limit(tmp_path: Path, what: str) -> None:
    """Oracle: data_specs/nmea.md, at most 1 %: of 300 lines 3 without checksum, of 100 fixes 1
    without GST.
    """

    def log(bad: int) -> str:
        epochs = [
            epoch(f"1000{k // 10:02d}.{k % 10}0", gst=what != "GST" or k >= bad) for k in range(100)
        ]
        if what == "GST":
            return "".join(epochs)
        return "".join(
            e.replace(",0.012,", ",0.013,") if k < bad else e for k, e in enumerate(epochs)
        )

    most = 3 if what == "checksum" else 1
    (told,) = read_gnss(write(tmp_path, log(most), "x.nmea")).notes
    assert f"{most} lines without a right checksum" in told.found or f" {most} of " in told.found
    with pytest.raises(InputError, match=f"{most + 1} of (300|100)"):
        read_gnss(write(tmp_path, log(most + 1), "x.nmea"))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (epoch("100000.00", gst=False), "1 of 1 fixes have no GST sentence .*sigma_m"),
        (epoch("100000.00").replace("*", "*1"), "x.nmea:1: no right checksum"),
        (epoch("100000.00", "310218"), "date '310218' is not ddmmyy"),
        (
            epoch("100000.00") + epoch("100001.00", "040718"),
            "x.nmea:5: date 040718 does not follow",
        ),
        (epoch("100000.00", quality=0), "no GGA sentence with a fix"),
        (
            epoch("100000.00") + epoch("100000.00", height=581),
            "x.nmea:4: time .* with other values",
        ),
        (epoch("100001.00") + epoch("100000.00"), "x.nmea:4: time .* must increase"),
        (
            nmea("GNGGA,100000.00,4634.2,N,00632.4,E,4,20,0.6,580.5,M,,M,1.4,74"),
            "without geoid separation",
        ),
    ],
)
def test_nmea_refusals(tmp_path: Path, content: str, message: str) -> None:
    """Oracle: data_specs/nmea.md."""
    with pytest.raises(InputError, match=message):
        read_gnss(write(tmp_path, content, "x.nmea"))


def test_nmea_sigma_stands_in_for_gst(tmp_path: Path) -> None:
    """Oracle: the standard deviations given."""
    got = read_gnss(
        write(tmp_path, epoch("100000.00", gst=False), "x.nmea"), sigma_m=[1, 2, 3], gps_week=2008
    )
    assert_allclose(got.cov_ned[0], np.diag([1, 4, 9]))
    with pytest.raises(InputError, match="of GPS week 2008, but gps_week is 2009"):
        read_gnss(tmp_path / "x.nmea", sigma_m=[1, 2, 3], gps_week=2009)


def aimu(sync: int, time: str, gyro: str = "+10.000,0,0") -> str:
    return nmea(f"AIMU,{sync},{time},1.0,0,0,0,{gyro},0,0,-9.81,40.0")


def test_aimu_leaves_out_the_free_clock(tmp_path: Path) -> None:
    """Oracle: Unix time to GPST, 18 leap seconds, in integers; 10 deg/s by hand."""
    content = aimu(1, "1700000000.000") + "".join(aimu(2, f"1774683140.{k:02d}8") for k in range(5))
    file = write(tmp_path, content, "imu.aimu")
    assert sniff_imu(file) == "aimu"
    imu = read_imu(file, gps_week=2411)
    assert "1 samples before the clock was locked" in imu.notes[0].found
    whole = 1774683140 - 315964800 + 18
    assert imu.gps_week == whole // 604800
    assert_allclose(imu.time, whole % 604800 + 0.008 + 0.01 * np.arange(5), rtol=0, atol=1e-9)
    assert_allclose(imu.gyro[0], [np.pi / 18, 0, 0], rtol=0, atol=1e-16)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            aimu(2, "1774683140.0") + aimu(2, "1774683140.01", "+1,x,0"),
            "imu.aimu:2: 'x' where a finite number",
        ),
        (
            aimu(2, "1774683140.0") + aimu(2, "1774683140.01", "+1,0"),
            "imu.aimu:2: 12 fields in .AIMU, expected 13",
        ),
        (aimu(1, "1774683140.0"), "none of 1 .AIMU samples has a locked clock"),
        (aimu(2, "1774683140.0") + aimu(2, "1774683139.0"), "imu.aimu:2: time .* must increase"),
    ],
)
def test_aimu_refusals(tmp_path: Path, content: str, message: str) -> None:
    """Oracle: data_specs/aimu.md."""
    with pytest.raises(InputError, match=message):
        read_imu(write(tmp_path, content, "imu.aimu"))


@pytest.mark.parametrize(
    ("content", "images"),
    [
        ("8001.tif 1.5\n8002.tif 2.5\n", ("8001.tif", "8002.tif")),
        ("8001,1.5\n8002,2.5\n", ("8001", "8002")),
        ("Photo;GPS time [s]\nIMG 1.jpg;1,5\nIMG 2.jpg;2,5\n", ("IMG 1.jpg", "IMG 2.jpg")),
        ("a.tif 2008 1.5\nb.tif 2008 2.5\n", ("a.tif", "b.tif")),
    ],
)
def test_events(tmp_path: Path, content: str, images: tuple[str, ...]) -> None:
    """Oracle: the lines as a person reads them."""
    events = read_events(write(tmp_path, content))
    assert events.images == images
    assert events.time.tolist() == [1.5, 2.5]


def test_events_without_names_are_numbered_aloud(tmp_path: Path) -> None:
    """Oracle: counting."""
    events = read_events(write(tmp_path, "1.5\n2.5\n"))
    assert events.images == ("1", "2")
    assert "the 2 events are numbered from 1" in events.notes[0].found


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            "2008 1.5\n2008 2.5\n",
            "file.txt:2: image 2008 occurs twice, first in line 1; delete one of them, or, if",
        ),
        ("a 1.5\nb 1.5\n", "file.txt:2: time 1.500000 s follows 1.500000 s"),
        ("a 1.5\nb x\n", "file.txt:2: 'x' where a finite number"),
    ],
)
def test_events_refusals(tmp_path: Path, content: str, message: str) -> None:
    """Oracle: data_specs/events.md."""
    with pytest.raises(InputError, match=message):
        read_events(write(tmp_path, content))


def test_events_round_trip(tmp_path: Path) -> None:
    """Oracle: the events written."""
    events = CameraEvents(("a.tif", "b.tif"), np.array([200000.1234567, 200001.5]), 2008)
    write_events(events, tmp_path / "Events.txt")
    back = read_events(tmp_path / "Events.txt", gps_week=2008)
    assert back.images == events.images
    assert_allclose(back.time, events.time, atol=0.51e-7, rtol=0)
    with pytest.raises(InputError, match="has a line end"):
        write_events(CameraEvents(("a\nb",), np.array([1.0])), tmp_path / "x.txt")


@pytest.mark.parametrize(("frame", "atol"), [("geodetic", 1e-12), ("tangent_plane", 0.51e-4)])
def test_image_positions_round_trip(tmp_path: Path, frame: str, atol: float) -> None:
    """Oracle: the positions written; 10 decimals of a degree, 4 of a metre."""
    position = np.array([[0.8, 0.1, 600.0], [0.81, 0.11, 601.0]])
    write_image_positions(
        ImagePositions(("a", "b"), position, frame), tmp_path / "AntennaPos_Img.txt"
    )
    images, back = image_positions(tmp_path / "AntennaPos_Img.txt")
    assert images == ("a", "b")
    assert_allclose(back, position, atol=atol, rtol=0)


def test_matlab_struct_and_matrix(tmp_path: Path) -> None:
    """Oracle: scipy.io.savemat of known numbers; fixes counted by hand (zero and the held value are
    none).
    """
    from scipy.io import savemat

    t = 100.0 + 0.02 * np.arange(6)
    mark = np.array([0, 0, 7, 7, 8, 8.0])
    lat = np.array([45, 45, 46, 46, 46.1, 46.1])
    struct = {
        "time": t,
        "p": t,
        "q": t,
        "r": t,
        "f": -t,
        "GPS_TOW": mark,
        "lat": lat,
        "lon": lat / 7,
        "alt": lat * 10,
    }
    savemat(
        tmp_path / "x.mat",
        {"flight_data": struct, "m": np.column_stack([t, np.tile([1, 2, 3, 4, 5, 6.0], (6, 1))])},
    )
    path = tmp_path / "x.mat"
    imu = read_imu(
        path,
        columns={"tow": "time", "gx": "p", "gy": "q", "gz": "r", "ax": "f", "ay": "f", "az": "f"},
        variable="flight_data",
    )
    assert_allclose(imu.accel[:, 2], -t)
    imu = read_imu(
        path,
        columns=["tow", "gx", "gy", "gz", "ax", "ay", "az"],
        variable="m",
        units={"gyro": "deg/s", "accel": "g"},
    )
    assert_allclose(imu.gyro[0], np.radians([1, 2, 3]))
    assert_allclose(imu.accel[0], 9.80665 * np.array([4, 5, 6]))
    spec = {
        "columns": {"tow": "time", "lat": "lat", "lon": "lon", "h": "alt"},
        "variable": "flight_data",
        "sigma_m": [2, 2, 4],
    }
    got = read_gnss(path, repeat_column="GPS_TOW", **spec)
    assert_allclose(got.time, t[[2, 4]], rtol=0, atol=1e-9)
    assert_allclose(np.degrees(got.lat), [46, 46.1])
    with pytest.raises(InputError, match="more than half of the rows repeat"):
        read_gnss(path, **spec)
    with pytest.raises(InputError, match=r"no flight_data.zeit; there are time, p, q"):
        read_imu(path, columns={"tow": "zeit"}, variable="flight_data")
    with pytest.raises(UsageError, match="set variable to one of flight_data, m"):
        read_imu(path, columns=["tow"])
    with pytest.raises(InputError, match=r"m has the shape \(6, 7\), but columns names 1"):
        read_imu(path, columns=["tow"], variable="m")
    (tmp_path / "y.mat").write_bytes(path.read_bytes()[:300])
    with pytest.raises(InputError, match="is no whole MATLAB file"):
        read_imu(tmp_path / "y.mat", columns=["tow"], variable="m")
    with pytest.raises(UsageError, match="needs columns"):
        read_imu(path)


@pytest.mark.parametrize(
    ("content", "form"),
    [
        (HEADER + "2008 1\n", "rtklib_pos"),
        ("1 46 6 500\n", "gnss_text"),
        ("% tow lat lon h\n1 46 6 500\n", "gnss_text"),
        ("$GPTXT,hello*00\n$GPGGA,1\n", "nmea"),
        ("cut,line*00\n$GPGGA,1\n", "nmea"),
    ],
)
def test_format_is_found_by_content(tmp_path: Path, content: str, form: str) -> None:
    """Oracle: data_specs; the ending .pos says nothing, other tools write plain text under it."""
    assert sniff_gnss(write(tmp_path, content, "x.pos")) == form


def test_names_with_blanks_are_told_to_stand_in_quotation_marks(tmp_path):
    """Oracle: the names; the advice of the refusal works."""
    path = tmp_path / "Events.txt"
    path.write_text("my image 1.jpg 200010.5\nmy image 2.jpg 200012.5\n")
    with pytest.raises(InputError, match='names with blanks stand in quotation marks: "my image'):
        read_events(path, gps_week=2008)
    path.write_text('"my image 1.jpg" 200010.5\n"my image 2.jpg" 200012.5\n')
    assert read_events(path, gps_week=2008).images == ("my image 1.jpg", "my image 2.jpg")
