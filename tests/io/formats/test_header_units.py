"""Units that a header gives in brackets or behind the names of its columns, and what becomes of
them beside the caller's.
"""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from insgnss.base.errors import InputError
from insgnss.io.formats import read_events, read_gnss, read_imu
from insgnss.io.formats.text.headers import kinds_like, unit_in

G, DEG = 9.80665, np.pi / 180.0
N = 20
NUMBERS = np.random.default_rng(3).normal(size=(N, 6)).round(6)


def table(tmp_path: Path, header: str, time: np.ndarray | None = None) -> Path:
    path = tmp_path / "imu.csv"
    rows = np.column_stack([100.0 + 0.01 * np.arange(N) if time is None else time, NUMBERS])
    np.savetxt(path, rows, fmt="%.9f", delimiter=",", header=header, comments="")
    return path


def header(gyro: str, accel: str, time: str = "time") -> str:
    return ",".join([time, *(gyro.format(c) for c in "xyz"), *(accel.format(c) for c in "xyz")])


@pytest.mark.parametrize(
    ("field", "kind", "unit"),
    [
        ("Gyro X (deg/s)", "gyro", "deg/s"),
        ("Gyro X deg/s", "gyro", "deg/s"),
        ("gyro_x_rad_s", "gyro", "rad/s"),
        ("Gyroscope_x_DegPerS", "gyro", "deg/s"),
        ("GyroX_dps", "gyro", "deg/s"),
        ("omega2_deg_h", "gyro", "deg/h"),
        ("dtheta_x_rad", "gyro", "rad"),
        ("Acc_Z [m/s^2]", "accel", "m/s^2"),
        ("acc_z_m_s2", "accel", "m/s^2"),
        ("acc_z_m_per_s_2", "accel", "m/s^2"),
        ("imu1.ax_mg", "accel", "mg"),
        ("dv_x_m_s", "accel", "m/s"),
        ("gyro_x_rps", "gyro", "rad/s"),
        ("gyro_x_deg_hr", "gyro", "deg/h"),
        ("gyro_x_deg_per_h", "gyro", "deg/h"),
        ("GyroXDps", "gyro", "deg/s"),
        ("lat_rad", "angle", "rad"),
        ("LatRad", "angle", "rad"),
        ("lonrad", "angle", "rad"),
        ("gps.pos_rad[1]", "angle", "rad"),
        ("Lat (degrees)", "angle", "degrees"),
        ("alt_mm", "length", "mm"),
        ("sd_lat_deg", "length", "deg"),
        ("vel_n_m_s", "velocity", "m/s"),
        ("vn_cm_per_s", "velocity", "cm/s"),
        ("speed_kmh", "velocity", "km/h"),
        ("v_n_ms", "velocity", "m/s"),
        ("sog_knots", "velocity", "kn"),
        ("TimeUS", "time", "us"),
        ("towms", "time", "ms"),
        ("times", "time", None),
        ("status", "time", None),
        ("lat_grad", "angle", None),
        ("alt_msl", "length", None),
        ("vn", "velocity", None),
        ("timestamp_us", "time", "us"),
        ("Time (ms)", "time", "ms"),
        ("gyro_x", "gyro", None),
        ("gyro_x_g", "gyro", None),
        ("gyro_x_raw", "gyro", None),
        ("gyro_rad[0]", "gyro", None),
        ("acc_x_2g", "accel", None),
        ("acc_mag", "accel", None),
        ("g_x", "accel", None),
        ("gps_time", "time", None),
    ],
)
def test_unit_of_a_field(field: str, kind: str, unit: str | None) -> None:
    """Oracle: what a person reads in the name; PX4 calls rad/s gyro_rad[0], where nothing stands
    behind the axis.
    """
    assert unit_in(field, kinds_like(kind)) == unit


@pytest.mark.parametrize(
    ("head", "gyro", "accel"),
    [
        (header("Gyro {} (deg/s)", "Acc_{} [m/s^2]"), DEG, 1.0),
        (header("gyro_{}_rad_s", "acc_{}_g"), 1.0, G),
        (header("gyro_{}_dps", "accel_{}_mps2", "time_s"), DEG, 1.0),
        (header("Gyro{}_deg_per_s", "Acc{}_mg"), DEG, 1e-3 * G),
        (header("w{} [rad s^-1]", "a{} [m s^-2]"), 1.0, 1.0),
        (header("angular_velocity_{} [°/s]", "linear_acceleration_{} [m·s⁻²]"), DEG, 1.0),
        ("time,gyro_x,gyro_y,gyro_z [deg/s],acc_x,acc_y,acc_z [g]", DEG, G),
    ],
)
def test_one_recording_under_many_headers(
    tmp_path: Path, head: str, gyro: float, accel: float
) -> None:
    """Oracle: the numbers of the file times the definitions of the units."""
    imu = read_imu(table(tmp_path, head))
    assert_allclose(imu.gyro, gyro * NUMBERS[:, :3], rtol=1e-14)
    assert_allclose(imu.accel, accel * NUMBERS[:, 3:], rtol=1e-14)
    assert_allclose(imu.time, 100.0 + 0.01 * np.arange(N), rtol=0, atol=1e-9)
    assert imu.notes == ()


def test_a_clock_with_its_unit_behind_the_name(tmp_path: Path) -> None:
    """Oracle: microseconds written, seconds read; also of a name that only the caller knows."""
    time = 1e6 * (100.0 + 0.01 * np.arange(N))
    named = table(tmp_path, header("gyro_{}_dps", "acc_{}_g", "time_us"), time)
    assert_allclose(read_imu(named).time, 1e-6 * time, rtol=1e-14)
    names = (
        {"tow": "boot_us"}
        | {f"g{c}": f"gyro_{c}_dps" for c in "xyz"}
        | {f"a{c}": f"acc_{c}_g" for c in "xyz"}
    )
    other = table(tmp_path, header("gyro_{}_dps", "acc_{}_g", "boot_us"), time)
    assert_allclose(read_imu(other, columns=names).time, 1e-6 * time, rtol=1e-14)


def test_increments_and_fields_of_arrays(tmp_path: Path) -> None:
    """Oracle: definitions of the units; a record of numpy has no brackets, only names."""
    imu = read_imu(table(tmp_path, header("dtheta_{}_deg", "dv_{}_m_s")), quantity="increments")
    assert_allclose(
        np.hstack([imu.gyro, imu.accel]), NUMBERS * [DEG, DEG, DEG, 1.0, 1.0, 1.0], rtol=1e-14
    )
    names = header("gyro_{}_dps", "acc_{}_g", "t_ms").split(",")
    record = np.zeros(N, dtype=[(name, float) for name in names])
    for name, column in zip(
        names, np.column_stack([1e5 + 10.0 * np.arange(N), NUMBERS]).T, strict=True
    ):
        record[name] = column
    np.save(tmp_path / "imu.npy", record)
    columns = dict(zip(("tow", "gx", "gy", "gz", "ax", "ay", "az"), names, strict=True))
    imu = read_imu(tmp_path / "imu.npy", columns=columns)
    assert_allclose(imu.gyro, DEG * NUMBERS[:, :3], rtol=1e-14)
    assert_allclose(imu.accel, G * NUMBERS[:, 3:], rtol=1e-14)
    assert_allclose(imu.time, 100.0 + 0.01 * np.arange(N), rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("head", "message"),
    [
        (
            "time,gx[rad/s],gy[deg/s],gz[rad/s],ax,ay,az",
            r"imu.csv:1: .* 'rad/s' and 'deg/s' for gx gy gz, .*; set units",
        ),
        (
            header("gyro_{}_deg", "acc_{}_g"),
            r"imu.csv:1: .* unit 'deg' for gx gy gz, which is none of rad/s, deg/s, mdeg/s, deg/h",
        ),
        (header("Gyro {} (LSB)", "acc_{}_g"), r"imu.csv:1: .* unit 'LSB' for gx gy gz"),
    ],
)
def test_units_that_cannot_be_are_refused_unless_the_caller_says_them(
    tmp_path: Path, head: str, message: str
) -> None:
    """Oracle: the header, which gives two units, that of another quantity, or none; and the
    caller's word.
    """
    path = table(tmp_path, head)
    with pytest.raises(InputError, match=message):
        read_imu(path)
    assert_allclose(read_imu(path, units={"gyro": "deg/s"}).gyro, DEG * NUMBERS[:, :3], rtol=1e-14)


@pytest.mark.parametrize(
    ("head", "units", "found"),
    [
        (
            header("Gyro {} (deg/s)", "Acc_{} [g]"),
            {"gyro": "rad/s"},
            ['the header says deg/s, and units gyro = "rad/s" was taken'],
        ),
        (
            header("gyro_{}_dps", "acc_{}_g"),
            {"accel": "m/s^2"},
            ['the header says g, and units accel = "m/s^2" was taken'],
        ),
        (
            header("gyro_{}_dps", "acc_{}_g"),
            {"gyro": "0.05 deg/s"},
            ['the header says deg/s, and units gyro = "0.05 deg/s" was taken'],
        ),
        (
            header("gyro_{}_rad", "acc_{}_g"),
            {"gyro": "rad/s"},
            ['the header says rad, and units gyro = "rad/s" was taken'],
        ),
        (header("gyro_{}_deg_s", "acc_{}_g"), {"gyro": "dps", "accel": "g", "time": "s"}, []),
        (header("Gyro {} (LSB)", "acc_{}_g"), {"gyro": "0.05 deg/s"}, []),
        (
            header("gyro_{}_dps", "acc_{}_g", "time_ms"),
            {"time": "s"},
            ['the header says ms, and units time = "s" was taken'],
        ),
    ],
)
def test_the_caller_goes_before_the_header_and_a_note_says_where_they_differ(
    tmp_path: Path, head: str, units: dict[str, str], found: list[str]
) -> None:
    """Oracle: both units as they were put in; one unit spelled in two ways, or a header with none,
    is no difference.
    """
    notes = read_imu(table(tmp_path, head), units=units).notes
    assert [note.found for note in notes] == found
    assert all((note.name, note.verdict) == ("IMU units", "note") for note in notes)
    assert all(
        f"leave units {key} out" in note.advice for note, key in zip(notes, units, strict=False)
    )


TOW, LAT, LON, H, SD = 2e5 + np.arange(3.0), 0.8 + 1e-6 * np.arange(3.0), 0.1, 500.0, 0.02
SPEED, COURSE, DOWN = 5.0, 2.0, -0.5
KNOT = 1852.0 / 3600.0
FIXES = {  # name of each column, and what one of it is worth in s, rad, m, m/s
    "underscores": (
        {
            "tow": ("time_ms", 1e-3),
            "lat": ("lat_rad", 1.0),
            "lon": ("lon_rad", 1.0),
            "h": ("alt_cm", 1e-2),
        }
        | {name: (f"{name}_cm", 1e-2) for name in ("sd_n", "sd_e", "sd_u")}
        | {
            "speed": ("speed_kmh", 1.0 / 3.6),
            "course": ("course_rad", 1.0),
            "vd": ("vd_km_per_h", 1.0 / 3.6),
        }
    ),
    "brackets": (
        {
            "tow": ("time (us)", 1e-6),
            "lat": ("lat (rad)", 1.0),
            "lon": ("lon [rad]", 1.0),
            "h": ("h [mm]", 1e-3),
        }
        | {name: (f"{name} [mm]", 1e-3) for name in ("sd_n", "sd_e", "sd_u")}
        | {
            "speed": ("speed [kn]", KNOT),
            "course": ("course [rad]", 1.0),
            "vd": ("vd [knots]", KNOT),
        }
    ),
    "usual": (
        {
            "tow": ("tow_s", 1.0),
            "lat": ("lat_deg", DEG),
            "lon": ("lon_deg", DEG),
            "h": ("h_m", 1.0),
        }
        | {name: (f"{name}_m", 1.0) for name in ("sd_n", "sd_e", "sd_u")}
        | {"speed": ("speed_mps", 1.0), "course": ("course_deg", DEG), "vd": ("vd_m_s", 1.0)}
    ),
}


def numbers_in(columns: dict[str, tuple[str, float]]) -> np.ndarray:
    """Rows of one recording, in the units of the columns."""
    si = {
        "tow": TOW,
        "lat": LAT,
        "lon": LON,
        "h": H,
        "speed": SPEED,
        "course": COURSE,
        "vd": DOWN,
    } | dict.fromkeys(("sd_n", "sd_e", "sd_u"), SD)
    return np.column_stack(
        [np.broadcast_to(si[name], 3) / factor for name, (_, factor) in columns.items()]
    )


def fixes_file(tmp_path: Path, kind: str, columns: dict[str, tuple[str, float]]) -> Path:
    """The recording as text, or as a record of numpy."""
    rows, names = numbers_in(columns), [name for name, _ in columns.values()]
    if kind == "text":
        np.savetxt(
            tmp_path / "g.csv",
            rows,
            fmt="%.12f",
            delimiter=",",
            header=",".join(names),
            comments="",
        )
        return tmp_path / "g.csv"
    record = np.zeros(len(rows), dtype=[(name, float) for name in names])
    for name, column in zip(names, rows.T, strict=True):
        record[name] = column
    np.save(tmp_path / "g.npy", record)
    return tmp_path / "g.npy"


@pytest.mark.parametrize("spelled", list(FIXES))
@pytest.mark.parametrize("kind", ["text", "text by columns", "npy"])
def test_fixes_of_one_flight_under_many_headers(tmp_path: Path, kind: str, spelled: str) -> None:
    """Oracle: the flight in SI, written by the definitions of the units; twelve decimals of a
    degree are a micrometre.
    """
    columns = FIXES[spelled]
    path = fixes_file(tmp_path, kind.split()[0], columns)
    names = None if kind == "text" else {name: field for name, (field, _) in columns.items()}
    fixes = read_gnss(path, columns=names, sigma_velocity=[0.1, 0.1, 0.1])
    assert_allclose(fixes.time, TOW, rtol=0, atol=1e-9)
    assert_allclose(fixes.lat, LAT, rtol=0, atol=1e-12)
    assert_allclose(fixes.lon, LON, rtol=0, atol=1e-12)
    assert_allclose(fixes.height, H, rtol=0, atol=1e-9)
    assert_allclose(np.sqrt(np.diagonal(fixes.cov_ned[0])), SD, rtol=1e-10)
    assert fixes.velocity_ned is not None
    assert_allclose(
        fixes.velocity_ned[0],
        [SPEED * np.cos(COURSE), SPEED * np.sin(COURSE), DOWN],
        rtol=0,
        atol=1e-9,
    )
    assert fixes.notes == ()


@pytest.mark.parametrize(
    ("units", "found"),
    [
        ({"angle": "deg"}, ['the header says rad, and units angle = "deg" was taken']),
        (
            {"length": "m", "time": "s"},
            [
                'the header says ms, and units time = "s" was taken',
                'the header says cm, and units length = "m" was taken',
            ],
        ),
        ({"velocity": "m/s"}, ['the header says km/h, and units velocity = "m/s" was taken']),
        ({"course": "deg"}, ['the header says rad, and units course = "deg" was taken']),
        ({"angle": "rad", "length": "cm", "velocity": "km/h", "course": "rad", "time": "ms"}, []),
    ],
)
@pytest.mark.parametrize("kind", ["text", "npy"])
def test_the_caller_goes_before_the_names_of_fixes_and_a_note_says_so(
    tmp_path: Path, kind: str, units: dict[str, str], found: list[str]
) -> None:
    """Oracle: both units as they were put in, and the latitude as it then is."""
    columns = FIXES["underscores"]
    path = fixes_file(tmp_path, kind, columns | {"tow": ("time_ms", 1.0)})
    names = {name: field for name, (field, _) in columns.items()}
    fixes = read_gnss(path, columns=names, units=units, sigma_velocity=[0.1, 0.1, 0.1])
    assert [(note.name, note.verdict) for note in fixes.notes] == [("GNSS units", "note")] * len(
        found
    )
    assert [note.found for note in fixes.notes] == found
    factor = DEG if units.get("angle") == "deg" else 1.0
    assert_allclose(fixes.lat, LAT * factor, rtol=1e-12)


def test_units_of_fixes_that_cannot_be_are_refused(tmp_path: Path) -> None:
    """Oracle: the header: a latitude in rad beside a longitude in deg, and a standard deviation
    that is an angle.
    """
    (tmp_path / "g.csv").write_text("time,lat_rad,lon_deg,h\n1,0.8,6,500\n2,0.8,6,500\n")
    with pytest.raises(InputError, match=r"g.csv:1: .* 'rad' and 'deg' for lat lon, .*; set units"):
        read_gnss(tmp_path / "g.csv", sigma_m=[1, 1, 1])
    (tmp_path / "s.csv").write_text(
        "time,lat,lon,h,sd_lat_deg,sd_lon_deg,sd_h\n1,46,6,500,1,1,1\n2,46,6,500,1,1,1\n"
    )
    names = {name: name for name in ("lat", "lon", "h")} | {
        "tow": "time",
        "sd_n": "sd_lat_deg",
        "sd_e": "sd_lon_deg",
        "sd_u": "sd_h",
    }
    with pytest.raises(InputError, match=r"s.csv:1: the header gives the unit 'deg' for sd_n"):
        read_gnss(tmp_path / "s.csv", columns=names)


def test_a_name_as_it_is_goes_before_one_with_a_unit_behind_it(tmp_path: Path) -> None:
    """Oracle: the columns as written; two names with units for one quantity are as ambiguous as two
    without.
    """
    path = tmp_path / "g.csv"
    path.write_text("time,time_us,lat,lon,h,alt_mm,lat_rad\n1,9,46,6,500,7,3\n2,9,46,6,500,7,3\n")
    fixes = read_gnss(path, sigma_m=[1, 1, 1])
    assert (fixes.time.tolist(), fixes.height.tolist()) == ([1.0, 2.0], [500.0, 500.0])
    assert_allclose(fixes.lat, np.radians(46.0), rtol=1e-15)
    path.write_text("time,lat,lon,alt_mm,alt_cm\n1,46,6,500,7\n2,46,6,500,7\n")
    with pytest.raises(InputError, match="names h twice"):
        read_gnss(path, sigma_m=[1, 1, 1])


def test_units_of_events(tmp_path: Path) -> None:
    """Oracle: milliseconds written, seconds read."""
    path = tmp_path / "e.csv"
    path.write_text("image,time_ms\na.jpg,200000500\nb.jpg,200001500\n")
    events = read_events(path)
    assert (events.time.tolist(), events.notes) == ([200000.5, 200001.5], ())
    given = read_events(path, columns={"image": "image", "tow": "time_ms"}, units={"time": "us"})
    assert_allclose(given.time, [200.0005, 200.0015], rtol=0, atol=1e-9)
    assert [(note.name, note.found) for note in given.notes] == [
        ("event units", 'the header says ms, and units time = "us" was taken')
    ]
