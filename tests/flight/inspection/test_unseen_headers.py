"""Headers of loggers that nobody here wrote: which columns are taken, and in which unit of time."""

from pathlib import Path

import numpy as np
import pytest

from insgnss.flight.inspection.tables.grids import tables_of_file
from insgnss.flight.inspection.tables.tabular import sources_of_table

ROWS = 400
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
    if low in ("time", "timeofweek") or low.endswith("reboot(s)"):
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
    return rng.normal(9.8 if low.endswith(("az", "accel_z", "z(g)", "vel[2]")) else 0.0, 0.1, ROWS)


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
