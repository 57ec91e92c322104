"""Tables without names as autopilots and loggers write them: what `insgnss inspect` makes of their
values, and what it says of the columns that it leaves out.
"""

from itertools import permutations

import numpy as np
import pytest
from air_motions import multirotor
from scipy.io import savemat
from scipy.spatial.transform import Rotation

from insgnss.flight.inspection.discovery import discover
from insgnss.flight.inspection.run import inspect_files
from insgnss.flight.inspection.tables.grids import GridTable
from insgnss.flight.inspection.tables.names import UnknownTable
from insgnss.flight.inspection.tables.quality import codes_of
from insgnss.flight.inspection.tables.roles import gnss_roles
from insgnss.flight.inspection.tables.tabular import sources_of_table
from insgnss.io.formats import read_gnss, read_imu
from insgnss.io.formats.gnss.rounding import floor_of_zeros, is_held
from insgnss.simulation.scenario import observe
from insgnss.simulation.sensors import ImuOptions

FIX = ("lat", "lon", "h")


def drive(n=600, dt=0.2, lat=-37.86, lon=144.76):
    """Clock, latitude and longitude in degrees, height and velocity north, east, down."""
    t = dt * np.arange(n)
    v = np.column_stack([9.0 * np.sin(0.1 * t), 7.0 * np.cos(0.13 * t), 0.8 * np.sin(0.2 * t)])
    place = np.cumsum(v, axis=0) * dt
    east = place[:, 1] / (6.38e6 * np.cos(np.radians(lat)))
    return (
        t,
        lat + np.degrees(place[:, 0] / 6.36e6),
        lon + np.degrees(east),
        30.0 - place[:, 2],
        v,
    )


def samples(n=6000, dt=0.02):
    rng = np.random.default_rng(4)
    force = rng.normal([0.1, -0.1, -9.8], 0.3, (n, 3))
    return dt * np.arange(n), rng.normal(0.0, 0.02, (n, 3)), force


def found(path):
    """The sources by role."""
    return {source.role: source for source in discover([path]).sources}


@pytest.fixture
def autopilot(tmp_path):
    """IMU.txt, GPS.txt and ATT.txt without header, with frames and milliseconds in two columns."""
    rng = np.random.default_rng(5)
    t, lat, lon, h, v = drive()
    ms = np.round(1e3 * t + rng.uniform(0.0, 8.0, t.size))
    zero, three = np.zeros(t.size), np.full(t.size, 3.0)
    course = np.degrees(np.arctan2(v[:, 1], v[:, 0])) % 360.0
    speed = np.hypot(v[:, 0], v[:, 1])
    fixes = [ms, three, ms, zero, zero, zero, lat, lon, h, h, speed, course, v[:, 2], zero]
    time, gyro, force = samples()
    tick = np.round(1e3 * time)
    angles = np.column_stack([5.0 * np.sin(time), 4.0 * np.cos(time), 90.0 + 0.5 * time])
    tables = {
        "IMU.txt": [tick, tick, *gyro.T, *force.T],
        "GPS.txt": fixes,
        "ATT.txt": [tick, tick, *angles.T, 0.0 * tick, 0.0 * tick],
    }
    for name, columns in tables.items():
        np.savetxt(tmp_path / name, np.column_stack(columns), fmt="%16.9e")
    return tmp_path


@pytest.mark.parametrize("order", list(permutations(["gyro", "other", "accel"])))
@pytest.mark.parametrize("other", ["gauss", "unit field", "force without gravity"])
def test_nine_axes_without_names_in_any_order(tmp_path, order, other):
    """Oracle: the columns as they were written, of a sensor that rolls, pitches and turns by its
    gyros; the field beside it turns with it, of 0.5 gauss or of size 1 as the force in g, or the
    force is there a second time without gravity.
    """
    rng = np.random.default_rng(6)
    time = 0.02 * np.arange(6000)
    angles = np.column_stack([0.05 * time, 0.2 * np.sin(0.9 * time), 0.3 * np.sin(0.7 * time)])
    body = Rotation.from_euler("ZYX", angles)
    rates = (body[:-1].inv() * body[1:]).as_rotvec() / 0.02
    gyro = np.vstack([rates, rates[-1:]]) + rng.normal(0.01, 0.002, (6000, 3))
    accelerations = rng.normal(0.0, 0.05, (6000, 3))
    force = body.inv().apply([0.0, 0.0, -1.0]) + accelerations
    field = body.inv().apply([0.44, 0.0, 0.9]) + rng.normal(0.0, 0.01, (6000, 3))
    sizes = {"gauss": 0.5 * field, "unit field": field, "force without gravity": accelerations}
    data = {"gyro": gyro, "accel": force, "other": sizes[other]}
    values = np.column_stack([1e6 * time, *(data[name] for name in order)])
    np.savetxt(tmp_path / "imu.txt", values, fmt="%.9f", delimiter=",")
    columns = found(tmp_path / "imu.txt")["imu"].keys["columns"]
    names = {"gyro": ["gx", "gy", "gz"], "accel": ["ax", "ay", "az"], "other": ["-"] * 3}
    assert columns == ["tow", *(c for name in order for c in names[name])]


def test_tables_of_an_autopilot_are_told_by_their_values(autopilot):
    """Oracle: the columns as they were written; attitudes and samples are no fixes."""
    sources = discover([autopilot]).sources
    assert [(s.role, s.path.name) for s in sources] == [("gnss", "GPS.txt"), ("imu", "IMU.txt")]
    gnss, imu = sources
    assert gnss.keys["columns"][6:13] == [*FIX, "-", "speed", "course", "vd"]
    assert gnss.keys["units"] == {"time": "ms"}
    assert imu.keys["columns"][2:] == ["gx", "gy", "gz", "ax", "ay", "az"]
    assert imu.keys["units"]["time"] == "ms"
    fixes = read_gnss(
        gnss.path,
        **{k: gnss.keys[k] for k in ("columns", "units", "sigma_m")},
        sigma_velocity=[1, 1, 1],
    )
    np.testing.assert_allclose(fixes.velocity_ned, drive()[4], atol=1e-6)


@pytest.mark.slow
def test_columns_that_nothing_takes_are_named(autopilot, capsys):
    """Oracle: the places of the columns beside those of clock, position and velocity."""
    (gnss,) = discover([autopilot]).of("gnss")
    assert gnss.columns_left_out == (
        *("[2]", "[3] (another clock)", "[4]", "[5]", "[6]", "[10]", "[14]"),
    )
    result = inspect_files([autopilot])
    assert "columns left out: [2]" in result.summary()
    assert "columns left out: [2]" in result.draft.text(autopilot)
    assert result.as_dict()["sources"][1]["columns_left_out"][0] == "[2]"


def test_known_columns_that_are_left_out_say_why(tmp_path):
    """Oracle: a table with a velocity without its vertical and deviations that are not positive."""
    t, lat, lon, h, v = drive()
    columns = {
        **{"time": t, "lat": lat, "lon": lon, "alt": h, "vn": v[:, 0], "ve": v[:, 1], "hdop": 1.0},
        **{"sd_n": -1.0, "sd_e": 1.0, "sd_u": 1.0, "fix": 3.0, "course": np.full(t.size, np.nan)},
    }
    values = np.column_stack([np.broadcast_to(c, t.size) for c in columns.values()])
    (source,) = sources_of_table(
        tmp_path / "g.csv", GridTable(UnknownTable(values, tuple(columns)), tuple(columns))
    )
    said = dict(text.partition(" (")[::2] for text in source.columns_left_out)
    assert said.keys() == columns.keys() - {"time", "lat", "lon", "alt"}
    assert said["hdop"] == ""
    assert "vn, ve and vd or vu are needed" in said["vn"]
    assert "not above 0 in 600 of 600 rows" in said["sd_n"]
    assert "whose codes may be RTKLIB's" in said["fix"]
    assert "no number in 600 of 600" in said["course"]


@pytest.mark.parametrize("order", [("lat", "lon"), ("lon", "lat")])
@pytest.mark.parametrize("unit", [1.0, np.pi / 180.0])
@pytest.mark.parametrize("place", [(40.2, 116.2), (47.4, 8.0), (31.0, -60.0)])
def test_order_and_unit_of_latitude_and_longitude_are_those_of_the_velocity(
    tmp_path, order, unit, place
):
    """Oracle: the table as it was put together, one row in nine of another receiver metres off."""
    rng = np.random.default_rng(6)
    t, lat, lon, h, v = drive(lat=place[0], lon=place[1])
    wrong = rng.permutation(t.size)[: t.size // 9]
    lat[wrong] += 3e-4
    angles = {"lat": unit * lat, "lon": unit * lon}
    sats = rng.integers(38, 42, t.size)
    sigma = rng.uniform(1.0, 2.0, (t.size, 3))
    rows = [1e3 + t, sats, *(angles[name] for name in order), h, v[:, 1], v[:, 0], -v[:, 2]]
    np.save(tmp_path / "g.npy", np.column_stack([*rows, sigma]))
    source = found(tmp_path)["gnss"]
    assert source.keys["columns"] == [
        "tow",
        "-",
        *order,
        "h",
        "ve",
        "vn",
        "vu",
        "sd_e",
        "sd_n",
        "sd_u",
    ]
    assert source.keys.get("units", {}) == ({} if unit == 1.0 else {"angle": "rad"})


def test_codes_of_a_quality_are_told_by_the_deviations_beside_it():
    """Oracle: what NMEA and RTKLIB call single, float and fixed."""
    sigma = np.repeat([2.0, 0.3, 0.01], 50)
    assert codes_of(np.repeat([1.0, 5.0, 4.0], 50), sigma) == "nmea"
    assert codes_of(np.repeat([5.0, 2.0, 1.0], 50), sigma) == "rtklib"
    assert codes_of(np.repeat([2.0, 3.0, 6.0], 50), sigma) is None
    assert codes_of(np.repeat([1.0, 5.0, 4.0], 50), np.full(150, 1.0)) is None


def test_empty_columns_beside_the_samples_do_no_harm(tmp_path):
    """Oracle: the columns as they were put together, one of them without numbers."""
    time, gyro, force = samples(2000)
    np.save(tmp_path / "a.npy", np.column_stack([time, np.full(2000, np.nan), gyro, force]))
    source = found(tmp_path)["imu"]
    assert source.keys["columns"] == ["tow", "-", "gx", "gy", "gz", "ax", "ay", "az"]
    assert source.columns_left_out == ("[2] (no number in some rows)",)
    read = read_imu(source.path, columns=source.keys["columns"])
    np.testing.assert_array_equal(read.gyro, gyro)


# rounded fixes


def hover(n=500):
    """A copter that stands in the wind, its position rounded to a centimetre or so."""
    rng = np.random.default_rng(7)
    way = np.cumsum(rng.normal(0.0, 0.003, (n, 2)), axis=0)
    lat, lon = np.round(46.5 + 1e-5 * way, 7).T
    return 0.1 * np.arange(n), lat, lon, np.round(500.0 + 0.05 * rng.normal(size=n), 2)


def test_a_hovering_copter_holds_no_fix_until_the_next(tmp_path):
    """Oracle: rows of which each is a fix of its own; a table that repeats each row ten times."""
    t, lat, lon, h = hover()
    assert np.mean((np.diff(lat) == 0.0) & (np.diff(lon) == 0.0)) > 0.5
    roles = gnss_roles(
        UnknownTable(np.column_stack([t, lat, lon, h]), ("time", "lat", "lon", "alt"))
    )
    assert roles.repeat_column is None
    assert not is_held((lat, lon), (np.full(t.size, 500.0),))
    record = np.zeros(t.size, dtype=[(name, float) for name in ("tow", *FIX)])
    for name, column in zip(("tow", *FIX), (t, lat, lon, h), strict=True):
        record[name] = column
    np.save(tmp_path / "g.npy", record)
    columns = {name: name for name in ("tow", *FIX)}
    fixes = read_gnss(tmp_path / "g.npy", columns=columns, sigma_m=[1, 1, 1])
    assert fixes.time.size == t.size
    held = [np.repeat(column, 10) for column in (lat, lon, h)]
    assert is_held(held[:2], held[2:])
    clock = 0.01 * np.arange(10 * t.size)
    grid = UnknownTable(np.column_stack([clock, *held]), ("time", "lat", "lon", "alt"))
    assert gnss_roles(grid).repeat_column == 1


def test_deviations_printed_as_zero_are_half_of_the_last_digit(tmp_path):
    """Oracle: RTK prints 0.00, 0.01 and 0.02 m; a zero among metres is no rounded number."""
    sigma = np.array([0.01, 0.0, 0.02, 0.01])
    assert floor_of_zeros(sigma) == pytest.approx(0.005)
    assert floor_of_zeros(np.array([1.25, 0.0, 2.31])) is None
    assert floor_of_zeros(np.array([0.0123456789, 0.0])) is None
    assert floor_of_zeros(np.zeros(4)) is None
    path = tmp_path / "g.txt"
    rows = [f"{k} 46.5{k} 6.5 500.{k} {s:.2f} 0.01 0.02\n" for k, s in enumerate(sigma)]
    path.write_text("# tow lat lon h sd_n sd_e sd_u\n" + "".join(rows))
    fixes = read_gnss(path)
    np.testing.assert_allclose(np.sqrt(fixes.cov_ned[:, 0, 0]), [0.01, 0.005, 0.02, 0.01])
    (note,) = fixes.notes
    assert "sd_n is 0 in 1 of 4 fixes; 0.005 was used" in note.found


# matrices


@pytest.mark.parametrize("clock", ["apart", "inside", "none"])
@pytest.mark.parametrize("upright", [True, False])
def test_gyros_and_accelerometers_in_two_matrices(tmp_path, clock, upright):
    """Oracle: the samples that were written, with a vector of stamps, stamps in both matrices, or
    none; 3 x N as well as N x 3.
    """
    time, gyro, force = samples(3000)
    sensors = {"gyro": gyro, "acc": force}
    if clock == "inside":
        sensors = {name: np.column_stack([time, triad]) for name, triad in sensors.items()}
    if not upright:
        sensors = {name: triad.T for name, triad in sensors.items()}
    stamps = {"time": time} if clock == "apart" else {}
    np.savez(tmp_path / "a.npz", **sensors, **stamps)
    savemat(tmp_path / "b.mat", sensors | stamps)
    for name in ("a.npz", "b.mat"):
        if clock == "none" and name == "b.mat":
            continue  # MATLAB files hold anything: six columns without a clock are no samples
        source = found(tmp_path / name)["imu"]
        rate = source.keys.get("rate_hz")
        assert (rate is None) == (clock != "none")
        read = read_imu(source.path, columns=source.keys["columns"], rate_hz=rate)
        np.testing.assert_array_equal(read.gyro, gyro)
        np.testing.assert_array_equal(read.accel, force)
        if rate is None:
            np.testing.assert_array_equal(read.time, time)


@pytest.mark.slow
def test_a_hover_that_determines_no_axes_is_no_complaint(tmp_path):
    """Oracle: a copter that holds its place with its z axis up; the draft has the vertical, and
    says that it defines forward.
    """
    imu = ImuOptions(200.0, "consumer", "forward left up")
    sim = observe(multirotor(4.0, "hover", seed=3), 3, imu=imu, truth_hz=1.0)
    samples = np.column_stack([sim.imu.time, sim.imu.gyro, sim.imu.accel])
    g = sim.gnss
    sigma = np.sqrt(np.diagonal(g.cov_ned, axis1=1, axis2=2))
    fixes = np.column_stack([g.time, np.degrees(g.lat), np.degrees(g.lon), g.height, sigma])
    for name, header, values in (
        ("imu.csv", "time,gx,gy,gz,ax,ay,az", samples),
        ("gnss.csv", "time,lat,lon,h_ell,sd_n,sd_e,sd_u", fixes),
    ):
        np.savetxt(tmp_path / name, values, "%.9f", ",", header=header, comments="")
    result = inspect_files([tmp_path])
    assert result.recognition.finding("axes").found == "unknown"
    assert "\nGood: the vehicle stayed in place" in result.summary()
    text = " ".join(result.draft.text(tmp_path).split("\n#   "))
    assert '\naxes = "forward left up"' in text
    assert "so x is taken as forward" in text
    assert "NOT" not in text


@pytest.mark.parametrize(
    ("stamps", "unit"),
    [
        (lambda t: np.where(t < 20.0, 0.0, 1.7e9) + t, "unix"),
        (lambda t: 1e3 * (np.where(t < 0.1, 0.0, 1.7e9) + t), "unix_ms"),
        (lambda t: 2e5 + np.repeat(t[9::10], 10), None),
        (lambda t: 1.7e9 + np.repeat(t[19::20], 20), "unix"),
    ],
    ids=["1970 first", "two of 1970", "bunches", "dated bunches"],
)
def test_clocks_that_were_set_or_stamp_in_bunches_are_found(tmp_path, stamps, unit):
    """Oracle: the unit in which the stamps were written, and samples at their rate."""
    t, gyro, force = samples()
    table = np.column_stack([stamps(t), gyro, force])
    path = tmp_path / "imu.csv"
    header = "time,gx[rad/s],gy[rad/s],gz[rad/s],ax[m/s^2],ay[m/s^2],az[m/s^2]"
    np.savetxt(path, table, fmt="%.4f", delimiter=",", header=header, comments="")
    source = found(path)["imu"]
    assert source.keys.get("units", {}).get("time") == unit
    assert "rate_hz" not in source.keys
    imu = read_imu(path, units={"time": unit or "s"})
    np.testing.assert_allclose(np.diff(imu.time), 0.02, atol=1e-4)
