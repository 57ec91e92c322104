"""Headers of loggers that nobody here wrote: which columns are taken, and in which unit of time."""

from pathlib import Path

import numpy as np
import pytest

from insgnss.base.errors import InputError
from insgnss.flight.inspection.discovery import discover
from insgnss.flight.inspection.tables.grids import tables_of_file
from insgnss.flight.inspection.tables.tabular import sources_of_table
from insgnss.io.formats import read_gnss, read_imu
from insgnss.io.formats.text.text import read_table

ROWS = 400
DOWN = (
    "az",
    "accel_z",
    "z(g)",
    "vel[2]",
    "accz",
    "acz",
    "smooth[2]",
    "z [m/s²]",
    "fz_g",
    "accel_zout",
)
STEP_S = 0.02
HEADERS = {
    "balloon": (
        "millis,bmp_tempC,mpu_ax,mpu_ay,mpu_az,mpu_gx,mpu_gy,mpu_gz,gps_lat,gps_lon,gps_alt_m",
        {"imu": ("millis", "ms", "mpu_gx", "mpu_az"), "gnss": ("millis", "ms", "gps_lat", None)},
    ),
    "microseconds": (
        "timestamp_us,gps_lat,gps_lon,gps_alt,imu_accel_x,imu_accel_y,imu_accel_z,imu_gyro_x,"
        "imu_gyro_y,imu_gyro_z",
        {
            "imu": ("timestamp_us", "us", "imu_gyro_x", "imu_accel_z"),
            "gnss": ("timestamp_us", "us", "gps_lat", None),
        },
    ),
    "u-blox": (
        "iTOW,year,month,day,hour,min,sec,lon,lat,height,velN,velE,velD",
        {"gnss": ("iTOW", "ms", "lat", None)},
    ),
    "uINS": (
        "time,theta[0],theta[1],theta[2],vel[0],vel[1],vel[2],dt",
        {"imu": ("time", None, "theta[0]", "vel[2]")},
    ),
    "uINS solution": (
        "timeOfWeek,theta[0],theta[1],theta[2],uvw[0],uvw[1],uvw[2],lla[0],lla[1],lla[2]",
        {},
    ),
    "ArduPilot table": (
        "TimeUS,I,Status,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,Yaw",
        {"gnss": ("TimeUS", "us", "Lat", None)},
    ),
    "Arduino": (
        "ms,AcX,AcY,AcZ,GyX,GyY,GyZ,Tmp",
        {"imu": ("ms", "ms", "GyX", "AcZ")},
    ),
    "blackbox": (
        "loopIteration,time (us),gyroADC[0] (deg/s),gyroADC[1] (deg/s),gyroADC[2] (deg/s),"
        "accSmooth[0],accSmooth[1],accSmooth[2],motor[0],motor[1],motor[2],motor[3]",
        {"imu": ("time (us)", "us", "gyroADC[0] (deg/s)", "accSmooth[2]")},
    ),
    "German": (
        "Zeit [s],Drehrate X [°/s],Drehrate Y [°/s],Drehrate Z [°/s],Beschleunigung X [m/s²],"
        "Beschleunigung Y [m/s²],Beschleunigung Z [m/s²]",
        {"imu": ("Zeit [s]", None, "Drehrate X [°/s]", "Beschleunigung Z [m/s²]")},
    ),
    "VectorNav": (
        "TimeStartup,TimeGps,TimeGpsTow,GpsWeek,UncompAccX,UncompAccY,UncompAccZ,UncompGyroX,"
        "UncompGyroY,UncompGyroZ,Temp,Pressure",
        {"imu": ("TimeGpsTow", "ns", "UncompGyroX", "UncompAccZ")},
    ),
    "letters with units": (
        "time,p_degs,q_degs,r_degs,fx_g,fy_g,fz_g",
        {"imu": ("time", None, "p_degs", "fz_g")},
    ),
    "registers": (
        "time,ACCEL_XOUT,ACCEL_YOUT,ACCEL_ZOUT,GYRO_XOUT,GYRO_YOUT,GYRO_ZOUT,MAG_XOUT",
        {"imu": ("time", None, "GYRO_XOUT", "ACCEL_ZOUT")},
    ),
    "racing": (
        "time,Roll rate,Pitch rate,Yaw rate,Long acc,Lat acc,Vert acc",
        {"imu": ("time", None, "Roll rate", "Vert acc")},
    ),
    "abbreviated": (
        "time,Beschl_X,Beschl_Y,Beschl_Z,Gyro_X,Gyro_Y,Gyro_Z",
        {"imu": ("time", None, "Gyro_X", "Beschl_Z")},
    ),
    "attitude and outputs": ("time,roll_cmd,pitch_cmd,yaw_cmd,out1,out2,out3", {}),
    "phone": (
        "accelerometerTimestamp_sinceReboot(s),accelerometerAccelerationX(G),"
        "accelerometerAccelerationY(G),accelerometerAccelerationZ(G),gyroRotationX(rad/s),"
        "gyroRotationY(rad/s),gyroRotationZ(rad/s)",
        {
            "imu": (
                "accelerometerTimestamp_sinceReboot(s)",
                None,
                "gyroRotationX(rad/s)",
                "accelerometerAccelerationZ(G)",
            )
        },
    ),
}


def column(name: str, rng: np.random.Generator) -> np.ndarray:
    """Values of a column as its name has them; receivers write each fix in ten rows."""
    k = np.arange(ROWS)
    held = k - k % 10 if "gps" in name else k
    low = name.lower()
    clocks = {"millis": 20, "timestamp_us": 20000, "itow": 200, "timeus": 200000}
    if low in clocks:
        return 1000 + clocks[low] * k
    if (low.startswith("time") and "gps" in low) or low == "timestartup":
        return 1e9 * ((1.2e9 if low == "timegps" else 2e5) + STEP_S * k)
    if low == "gpsweek":
        return np.full(ROWS, 2008)
    if low in ("ms", "time (us)"):
        return np.round((1e3 if low == "ms" else 1e6) * (37.0 + STEP_S * k))
    if low in ("time", "zeit [s]", "timeofweek") or low.endswith("reboot(s)"):
        return 100.0 + STEP_S * k
    if low == "sec":
        return np.floor(0.2 * k) % 60
    fixed = {"year": 2018, "hour": 9, "min": 5, "nsats": 18, "hdop": 1, "status": 3, "yaw": 0}
    if low in fixed:
        return np.full(ROWS, fixed[low])
    if "lat" in low or low == "lla[0]":
        return 46.5 + 1e-6 * held
    if "lon" in low or low in ("lng", "lla[1]"):
        return 6.5 + 1e-6 * held
    if "alt" in low or low in ("height", "lla[2]"):
        return 500.0 + 0.01 * held
    return rng.normal(9.8 if low.endswith(DOWN) else 0.0, 0.1, ROWS)


@pytest.mark.parametrize("logger", HEADERS)
def test_columns_and_clock_of_a_header(tmp_path: Path, logger: str) -> None:
    """Oracle: what the loggers' sources write into these columns."""
    header, expected = HEADERS[logger]
    rng = np.random.default_rng(4)
    table = np.column_stack([column(name, rng) for name in header.split(",")])
    path = tmp_path / "log.csv"
    np.savetxt(path, table, "%.9f", ",", header=header, comments="")
    (grid,) = tables_of_file(path)
    found = {source.role: source.keys for source in sources_of_table(path, grid)}
    assert set(found) == set(expected)
    for role, (clock, unit, first, last) in expected.items():
        keys = found[role]
        columns = keys["columns"]
        assert columns["tow"] == clock
        assert keys.get("units", {}).get("time") == unit
        assert columns["gx" if role == "imu" else "lat"] == first
        assert last is None or columns["az"] == last


def test_lines_before_a_header_and_units_under_it(tmp_path: Path) -> None:
    """Oracle: the same table without them; a torn first row is still refused."""
    rows = "".join(f"{0.01 * k:.2f},{k},0.5\n" for k in range(1, 30))
    plain, told, torn = (tmp_path / name for name in ("plain.csv", "told.csv", "torn.csv"))
    plain.write_text("time [s],gx [deg/s],h [m]\n" + rows)
    told.write_text("StartTime: 2018-05-01\nRate: 100 Hz\ntime,gx,h\ns,deg/s,m\n" + rows)
    torn.write_text("time,gx,h\n0.0,1\n" + rows)
    expected, table = read_table(plain), read_table(told)
    np.testing.assert_array_equal(table.values, expected.values)
    assert table.layout.header_fields == expected.layout.header_fields
    assert table.layout.first_line == 5
    with pytest.raises(InputError, match=r"torn\.csv:2: 2 fields"):
        read_table(torn)


def test_camera_messages_beside_fixes_are_exposures(tmp_path: Path) -> None:
    """Oracle: an autopilot's tables: CAM has a row an image, GPS a row a fix."""
    k = np.arange(ROWS)
    lat_lon_h = np.column_stack([46.5 + 1e-5 * k, 6.5 + 1e-5 * k, 500.0 + 0.1 * np.sin(k)])
    fixes = np.column_stack([205200.0 + 0.2 * k, lat_lon_h])
    images = np.column_stack([k + 1, 205200.0 + 1.7 * k, lat_lon_h])[:40]
    for name, header, table in (
        ("GPS.csv", "tow,lat,lon,alt", fixes),
        ("CAM.csv", "Img,tow,lat,lon,alt", images),
    ):
        np.savetxt(tmp_path / name, table, "%.9g", ",", header=header, comments="")
    found = {source.path.name: source.role for source in discover([tmp_path]).sources}
    assert found == {"GPS.csv": "gnss", "CAM.csv": "events"}


def test_heights_in_millimetres_beside_deviations_in_metres(tmp_path: Path) -> None:
    """Oracle: PX4's receiver message: whole mm beside float eph and epv in m."""
    k = np.arange(ROWS)
    lat, lon, h = 465e6 + 10 * k, 65e6 + 10 * k, np.round(5e5 + 100 * np.sin(k))
    table = np.column_stack([205200 + 0.2 * k, lat, lon, h, np.full((ROWS, 2), [0.014, 0.02])])
    path = tmp_path / "gps.csv"
    np.savetxt(path, table, "%.9g", ",", header="tow,lat,lon,alt,eph,epv", comments="")
    (grid,) = tables_of_file(path)
    (source,) = sources_of_table(path, grid)
    fixes = read_gnss(path, columns=source.keys["columns"], units=source.keys["units"])
    np.testing.assert_allclose(np.sqrt(np.diagonal(fixes.cov_ned[0])), [0.014, 0.014, 0.02])
    np.testing.assert_allclose(fixes.height, 1e-3 * h)
    whole = read_gnss(
        path, columns=source.keys["columns"], units={"angle": "1e-7 deg", "length": "mm"}
    )
    np.testing.assert_allclose(np.sqrt(whole.cov_ned[0, 0, 0]), 1.4e-5)


def test_dates_with_the_day_first_and_thousandths_of_degrees(tmp_path: Path) -> None:
    """Oracle: by hand: 3 July 2018 is a Tuesday of week 2008, 18 s ahead in GPST."""
    path = tmp_path / "imu.csv"
    rows = [
        f"03.07.2018;09:00:{k // 100:02d}.{k % 100:02d};0;0;-1000;{k};0;500" for k in range(300)
    ]
    header = "Datum;Uhrzeit;acc_x_mg;acc_y_mg;acc_z_mg;gyr_x_mdps;gyr_y_mdps;gyr_z_mdps"
    path.write_text("\n".join([header, *rows]) + "\n")
    (grid,) = tables_of_file(path)
    (source,) = sources_of_table(path, grid)
    imu = read_imu(path, columns=source.keys["columns"], units=source.keys["units"])
    assert imu.gps_week == 2008
    np.testing.assert_allclose(imu.time, 2 * 86400 + 9 * 3600 + 18 + 0.01 * np.arange(300))
    np.testing.assert_allclose(imu.gyro[:, 0], np.radians(1e-3 * np.arange(300)))
    np.testing.assert_allclose(imu.accel[0, 2], -9.80665)


@pytest.mark.parametrize(
    ("header", "deviations"),
    [
        (
            "Unix Time,Microseconds,Latitude,Longitude,Height,"
            "Latitude Standard Deviation,Longitude Standard Deviation,Height Standard Deviation",
            ("Latitude Standard Deviation", "Height Standard Deviation"),
        ),
        (
            "Unix Time,Microseconds,PosLat (deg),PosLon (deg),PosAlt (m),"
            "PosNorthStdev (m),PosEastStdev (m),PosDownStdev (m)",
            ("PosNorthStdev (m)", "PosDownStdev (m)"),
        ),
        (
            "Unix Time,Microseconds,Latitude [deg],Longitude [deg],Altitude [m],"
            "Latitude accuracy [m],Longitude accuracy [m],Altitude accuracy [m]",
            ("Latitude accuracy [m]", "Altitude accuracy [m]"),
        ),
    ],
)
def test_fixes_of_ins_exports(tmp_path: Path, header: str, deviations: tuple[str, str]) -> None:
    """Oracle: times and deviations that were written: seconds and microseconds are one clock."""
    k = np.arange(ROWS)
    us = 200_000 * k + 1530608382_060000
    place = [46.5 + 1e-6 * k, 6.5 + 1e-6 * k, 500.0 + 0.01 * k, *np.full((3, ROWS), 0.02)]
    table = np.column_stack([us // 1_000_000, us % 1_000_000, *place])
    path = tmp_path / "gnss.csv"
    np.savetxt(path, table, ["%d", "%d", *["%.9f"] * 6], ",", header=header, comments="")
    (grid,) = tables_of_file(path)
    (source,) = sources_of_table(path, grid)
    columns = source.keys["columns"]
    assert (columns["sd_n"], columns["sd_u"]) == deviations
    assert columns["usec"] == "Microseconds"
    fixes = read_gnss(path, columns=columns, units=source.keys["units"])
    np.testing.assert_allclose(fixes.time - fixes.time[0], 0.2 * k, atol=1e-6)
    np.testing.assert_allclose(np.sqrt(np.diagonal(fixes.cov_ned[0])), 0.02)


def test_a_telephone_writes_dates_with_names_of_months(tmp_path: Path) -> None:
    """Oracle: the instants written, as timetables of MATLAB Mobile: a file a sensor, X Y Z."""
    stamps = np.datetime64("2018-05-01T05:59:59.5") + (20 * np.arange(ROWS)).astype("m8[ms]")
    rng = np.random.default_rng(8)
    for name, size in (("Acceleration", 9.8), ("AngularVelocity", 0.1)):
        values = rng.normal([0.0, 0.0, size], 0.05, (ROWS, 3))
        rows = [
            f"01-May-2018 {str(stamp)[11:]}," + ",".join(f"{v:.6f}" for v in row)
            for stamp, row in zip(stamps, values, strict=True)
        ]
        (tmp_path / f"{name}.csv").write_text("\n".join(["Timestamp,X,Y,Z", *rows]) + "\n")
    found = {source.role: source for source in discover([tmp_path]).sources}
    assert set(found) == {"gyro", "accel"}
    seconds = (stamps - np.datetime64("1970-01-01")) / np.timedelta64(1, "s")
    assert np.ptp(found["gyro"].span) == pytest.approx(np.ptp(seconds), abs=1e-6)
    assert found["gyro"].keys["units"]["time"] == "unix"
