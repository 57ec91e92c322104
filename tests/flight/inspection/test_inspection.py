"""`insgnss inspect` on files that no flight file describes: what it finds, what it drafts, what it
refuses.
"""

import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from insgnss import load_flight
from insgnss.base.errors import InputError
from insgnss.base.units import STANDARD_GRAVITY
from insgnss.cli import main
from insgnss.flight.inspection.alone import by_gravity
from insgnss.flight.inspection.discovery import discover
from insgnss.flight.inspection.draft import Draft, toml, write_draft
from insgnss.flight.inspection.evidence import vertical_axes
from insgnss.flight.inspection.run import inspect_files
from insgnss.flight.inspection.sensing import fitting_model, noise_model, sense
from insgnss.flight.inspection.tables.roles import UnknownTable, gnss_roles, imu_roles
from insgnss.flight.processing.recording import read_recording
from insgnss.geodesy.axes import parse_axes
from insgnss.geodesy.earth import EARTH_RATE
from insgnss.records import ImuSamples
from insgnss.report.charts.files import charts_of
from insgnss.simulation.dataset import write_dataset

DATA = Path(__file__).parents[4] / "shared" / "data"
IMU, GNSS = (
    "01_Observations/IMU/Data/Pre_calibrated/f8_1_sob.csv",
    "02_Processed/GPS-PPK/AntennaPos_WGS84.txt",
)
G = STANDARD_GRAVITY


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """A data set whose IMU is mounted sideways and counts in deg/s and g, without its flight file,
    its truth and any name of a unit.
    """
    place = tmp_path_factory.mktemp("flown") / "set"
    write_dataset(
        place,
        minutes=3.0,
        imu_rate=100.0,
        seed=4,
        imu_axes="right backward down",
        gyro_unit="deg/s",
        accel_unit="g",
    )
    (place / "flight.toml").unlink()
    lines = (place / IMU).read_text().splitlines(keepends=True)
    (place / IMU).write_text("tow,gx,gy,gz,ax,ay,az\n" + "".join(lines[1:]))
    return place


@pytest.fixture(scope="module")
def drafted(flown, tmp_path_factory):
    """The flight file that `inspect --write` makes of it."""
    path = tmp_path_factory.mktemp("draft") / "flight.toml"
    assert main(["inspect", str(flown), "--write", str(path), "-q"]) == 0
    return path


def test_draft_of_a_simulated_flight_says_how_it_was_simulated(drafted):
    """Oracle: the options of the simulation."""
    flight = load_flight(drafted)
    assert flight.imu.axes == "right backward down"
    assert flight.imu.units == {"gyro": "deg/s", "accel": "g"}
    assert flight.imu.quantity == "mean_rate"
    assert flight.imu.noise == "navchip"
    assert flight.gnss.time_offset_s == 0.0
    assert flight.camera is not None
    assert flight.camera.events.name == "Events.txt"
    assert flight.filter.lever_arm


def test_draft_of_a_simulated_flight_is_processed_as_it_stands(drafted, capsys):
    """Oracle: the exit code of the contract, and the lever arm of the simulation (0.35 m from the
    IMU) within the sigma that is granted.
    """
    assert main(["process", str(drafted), "-q"]) == 0
    assert "images" in capsys.readouterr().out


def test_picture_stands_beside_the_draft(drafted):
    """Oracle: the signature of a PNG, and its size."""
    png = next(drafted.parent.glob("*recognition.png")).read_bytes()
    assert png.startswith(b"\x89PNG")
    assert len(png) > 20_000


def test_page_stands_beside_the_draft(drafted):
    """Oracle: the charts of a recording whose axes and clock are known; the axes that were
    simulated are the best.
    """
    page, charts = charts_of(next(drafted.parent.glob("*inspect.html")))
    assert [chart.name for chart in charts] == ["motion", "orientations", "clock"]
    (found,) = (x for x in charts[1].panels[0].layers if x.name == "found")
    assert list(found.texts) == ["right backward down"]
    assert "right backward down" in page.read_text()


def test_every_key_of_the_draft_has_its_evidence(drafted):
    """Oracle: the lines of the file: a key of [imu] that was recognised stands below a comment with
    a confidence.
    """
    lines = drafted.read_text().splitlines()
    for key in ("units", "axes"):
        row = next(k for k, line in enumerate(lines) if line.startswith(f"{key} = "))
        above = " ".join(lines[max(0, row - 6) : row])
        assert "confidence 0.9" in above, key


def test_paths_below_the_flight_file_are_relative(flown):
    """Oracle: the paths of the data set; the draft is removed again."""
    path = flown / "drafted.toml"
    try:
        assert main(["inspect", str(flown), "--write", str(path), "-q"]) == 0
        tree = tomllib.loads(path.read_text())
        assert tree["imu"]["file"] == IMU
        assert tree["gnss"]["file"] == GNSS
    finally:
        for name in ("drafted.toml", "drafted_recognition.png", "drafted_inspect.html"):
            (flown / name).unlink(missing_ok=True)


@pytest.mark.slow
def test_existing_files_are_not_overwritten(flown, drafted, capsys):
    """Oracle: the bytes before; exit code 2 of the contract."""
    before = drafted.read_bytes()
    assert main(["inspect", str(flown), "--write", str(drafted), "-q"]) == 2
    assert "already exist" in capsys.readouterr().err
    assert drafted.read_bytes() == before
    assert main(["inspect", str(flown), "--write", str(drafted), "--force", "-q"]) == 0


def test_a_claim_that_the_data_contradict_is_bad(flown, drafted, tmp_path, capsys):
    """Oracle: the axes of the simulation, turned by 90 deg about the vertical in the claim: nothing
    but recognition can tell it.
    """
    text = drafted.read_text().replace(
        'axes = "right backward down"', 'axes = "forward right down"'
    )
    path = tmp_path / "flight.toml"
    path.write_text(text)
    assert main(["inspect", str(path), "-q"]) == 3
    streams = capsys.readouterr()
    assert "BAD   recognised axes" in streams.out
    assert "right backward down" in streams.err
    assert main(["inspect", str(drafted), "-q"]) == 0


def test_json_is_one_document(flown, capsys):
    """Oracle: the json module."""
    import json

    assert main(["inspect", str(flown), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert {f["name"]: f["value"] for f in document["findings"]}["axes"] == "right backward down"
    assert {source["role"] for source in document["sources"]} == {"imu", "gnss", "events"}


# wrong input


def _copy(flown, place, *names):
    for name in names:
        (place / Path(name).name).write_bytes((flown / name).read_bytes())
    return place


def test_an_empty_directory_has_no_recording(tmp_path, capsys):
    """Oracle: exit code 3 of the contract."""
    assert main(["inspect", str(tmp_path)]) == 3
    assert "no IMU samples found; there are no files" in capsys.readouterr().err


def test_fixes_alone_are_no_recording(flown, tmp_path, capsys):
    """Oracle: exit code 3; the fixes that are there are named."""
    _copy(flown, tmp_path, GNSS)
    assert main(["inspect", str(tmp_path)]) == 3
    error = capsys.readouterr().err
    assert "no IMU samples" in error
    assert "AntennaPos_WGS84.txt" in error


def test_two_imus_are_listed_and_not_chosen_from(flown, tmp_path, capsys):
    """Oracle: exit code 3; both files are named."""
    _copy(flown, tmp_path, IMU, GNSS)
    (tmp_path / "second.csv").write_bytes((flown / IMU).read_bytes())
    assert main(["inspect", str(tmp_path)]) == 3
    error = capsys.readouterr().err
    assert "2 recordings of an IMU" in error
    assert "f8_1_sob.csv" in error
    assert "second.csv" in error
    named = [str(tmp_path / "second.csv"), str(tmp_path / "AntennaPos_WGS84.txt")]
    assert main(["inspect", *named, "-q"]) == 0


def test_a_truncated_file_is_refused_with_its_line(flown, tmp_path, capsys):
    """Oracle: exit code 3; the last line is cut within a number."""
    _copy(flown, tmp_path, IMU, GNSS)
    path = tmp_path / "f8_1_sob.csv"
    path.write_bytes(path.read_bytes()[:-30])
    for source in ([str(path), str(tmp_path / "AntennaPos_WGS84.txt")], [str(tmp_path)]):
        assert main(["inspect", *source]) == 3
        assert "truncated" in capsys.readouterr().err


def test_a_damaged_receiver_log_is_named_where_it_is_missing(flown, tmp_path, capsys):
    """Oracle: exit code 4, samples without fixes; why the file of fixes was not taken."""
    _copy(flown, tmp_path, IMU, GNSS)
    path = tmp_path / "AntennaPos_WGS84.txt"
    path.write_bytes(path.read_bytes()[:-30])
    assert main(["inspect", str(tmp_path), "-q"]) == 4
    error = capsys.readouterr().err
    assert "IMU samples alone give no position" in error
    assert "truncated" in error


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("imu.csv", b""),
        ("imu.csv", bytes(range(256)) * 8),
        ("imu.mat", b"no matlab"),
        ("imu.npy", b"\x93NUMPY\x01"),
    ],
)
def test_unreadable_files_are_named(tmp_path, capsys, name, content):
    """Oracle: exit code 3, one line with the file, by name and within a directory."""
    (tmp_path / name).write_bytes(content)
    for source in (tmp_path / name, tmp_path):
        assert main(["inspect", str(source)]) == 3
        error = capsys.readouterr().err
        assert name in error
        assert error.count("\n") == 1


def test_wrong_use(flown, drafted, tmp_path, capsys):
    """Oracle: exit codes of the contract: 3 for a path that is not there, 2 for options that do not
    go together.
    """
    assert main(["inspect", str(tmp_path / "none")]) == 3
    assert main(["inspect", str(flown), "--force"]) == 2
    assert main(["inspect", str(drafted), "--write", str(tmp_path / "a.toml")]) == 2
    assert main(["inspect", str(drafted), str(flown)]) == 2
    assert (
        main(
            ["inspect", str(flown), "--write", str(tmp_path / "no" / "such" / "flight.toml"), "-q"]
        )
        == 2
    )
    assert "does not exist" in capsys.readouterr().err.splitlines()[-1]


def test_static_samples_without_a_place_are_no_flight(tmp_path, capsys):
    """Oracle: exit code 4 of the contract, and gravity: 305 counts are one g."""
    rng = np.random.default_rng(5)
    counts = np.rint(
        rng.normal(0.0, [8.0, 8.0, 8.0, 1.1, 1.1, 1.1], (20_000, 6))
        + [5.0, -3.0, 2.0, 0.0, 0.0, -305.0]
    )
    np.save(tmp_path / "static.npy", counts.astype(np.int16))
    assert main(["inspect", str(tmp_path), "-q"]) == 4
    streams = capsys.readouterr()
    assert "needs a position" in streams.err
    assert "no clock" in streams.err
    assert "z down" in streams.out
    assert "0.0321" in streams.out  # m/s^2, 9.80665 / 305


def test_a_parked_sensor_gets_its_vertical_and_nothing_that_is_not_known(tmp_path):
    """Oracle: how the samples were made: z up in g, at rest, fixes that scatter by a metre; nothing
    tells forward, latency or gyro unit.
    """
    rng = np.random.default_rng(6)
    n, t = 6000, 1000.0
    samples = np.column_stack(
        [
            t + 0.01 * np.arange(n),
            rng.normal(0.0, 1e-3, (n, 3)),
            rng.normal([0.0, 0.0, 1.0], 2e-3, (n, 3)),
        ]
    )
    place = np.column_stack(
        [t + np.arange(60.0), rng.normal([46.5, 6.5], 1e-5, (60, 2)), rng.normal(400.0, 2.0, 60)]
    )
    _write(tmp_path / "imu.csv", "tow,gx,gy,gz,ax,ay,az", samples.T, ["%.3f", *SAMPLE])
    _write(tmp_path / "gnss.csv", "tow,lat,lon,h", place.T, ["%.3f"] + ["%.10f"] * 3)
    result = inspect_files([tmp_path]).write(tmp_path / "flight.toml")
    assert result.refusal is None
    flight = load_flight(tmp_path)
    np.testing.assert_allclose(flight.imu.C_b_imu @ [0.0, 0.0, 1.0], [0.0, 0.0, -1.0])
    assert flight.imu.units == {"accel": "g"}
    assert flight.gnss.time_offset_s == 0.0
    assert flight.filter.time_offset
    text = " ".join((tmp_path / "flight.toml").read_text().split("\n#   "))
    assert "the motion does not show the forward axis" in text


# columns


def _track(n=400, dt=0.1):
    """Clock, latitude, longitude rad, height and velocity east north up of a circle."""
    t = dt * np.arange(n)
    north, east = 80.0 * np.sin(0.15 * t), 80.0 * (1.0 - np.cos(0.15 * t))
    lat = 0.7 + north / 6.36e6
    lon = 2.0 + east / (6.38e6 * np.cos(0.7))
    v = np.column_stack([12.0 * np.sin(0.15 * t), 12.0 * np.cos(0.15 * t), 0.3 * np.cos(t)])
    return 1000.0 + t, lat, lon, 50.0 + 0.3 * np.sin(t), v


def test_unnamed_matrices_are_told_by_their_values(tmp_path):
    """Oracle: the columns as they were put together."""
    rng = np.random.default_rng(1)
    t, lat, lon, h, v = _track()
    sigma = rng.uniform(0.5, 2.0, (t.size, 6))
    week = np.full(t.size, 2202.0)
    gnss = np.column_stack(
        [week, t, np.ones(t.size), rng.integers(20, 40, t.size), lat, lon, h, v, sigma]
    )
    n = 4000
    imu_time = 1000.0 + 0.01 * np.arange(n)
    force, rate = rng.normal([0.5, -0.2, 9.8], 0.8, (n, 3)), rng.normal(0.0, 0.2, (n, 3))
    imu = np.column_stack([np.full(n, 2202.0), imu_time, force, rate, np.zeros(n)])
    savemat(tmp_path / "drive.mat", {"a": imu, "b": gnss})
    found = discover([tmp_path])
    (samples,), (fixes,) = found.of("imu"), found.of("gnss")
    assert samples.keys["columns"] == ["week", "tow", "ax", "ay", "az", "gx", "gy", "gz", "-"]
    assert samples.keys["variable"] == "a"
    rest = ["lat", "lon", "h", "ve", "vn", "vu", "sd_e", "sd_n", "sd_u", "sd_ve", "sd_vn", "sd_vd"]
    assert fixes.keys["columns"] == ["week", "tow", "-", "-", *rest]
    assert fixes.keys["units"] == {"angle": "rad"}


def test_of_two_clocks_that_of_the_imu_is_taken(tmp_path):
    """Oracle: the columns as they were put together, in the style of an autopilot's log."""
    rng = np.random.default_rng(2)
    t, lat, lon, h, v = _track(n=600)
    course = np.degrees(np.arctan2(v[:, 0], v[:, 1])) % 360.0
    columns = [
        5e8 + 1e3 * t,
        np.full(t.size, 1768.0),
        np.degrees(lat),
        np.degrees(lon),
        h - h[0],
        h,
        np.hypot(v[:, 0], v[:, 1]),
        course,
        -v[:, 2],
        1e3 * t,
    ]
    names = ["TimeMS", "Week", "Lat", "Lng", "RelAlt", "Alt", "Spd", "GCrs", "VZ", "T"]
    n = 3000
    imu = np.column_stack(
        [
            20.0 * np.arange(n) + 1e6,
            rng.normal(0.0, 0.1, (n, 3)),
            rng.normal([0, 0, -9.8], 0.5, (n, 3)),
        ]
    )
    labels = ["TimeMS", "GyrX", "GyrY", "GyrZ", "AccX", "AccY", "AccZ"]
    cells = {
        "IMU_label": np.array(labels, dtype=object),
        "GPS_label": np.array(names, dtype=object),
    }
    savemat(tmp_path / "log.mat", {"IMU": imu, "GPS": np.column_stack(columns), **cells})
    result = inspect_files([tmp_path / "log.mat"])
    fixes = result.sources[1]
    assert fixes.keys["columns"]["tow"] == "T"
    assert fixes.keys["units"] == {"time": "ms"}
    assert fixes.keys["columns"]["h"] == "Alt"
    assert result.gnss is not None
    assert result.gnss.velocity_ned is not None
    np.testing.assert_allclose(result.gnss.velocity_ned[:, 0], v[:, 1], atol=1e-6)


def test_held_fixes_are_found_by_what_changes_with_them():
    """Oracle: a table in which each fix is repeated 50 times."""
    t, lat, lon, h, _ = _track(n=40, dt=1.0)
    clock = t[0] + 0.02 * np.arange(2000)
    held = [np.repeat(column, 50) for column in (np.degrees(lat), np.degrees(lon), h, t)]
    grid = UnknownTable(np.column_stack([clock, *held]), ("time", "lat", "lon", "alt", "GPS_TOW"))
    roles = gnss_roles(grid)
    assert roles is not None
    assert roles.repeat_column == 4
    assert list(roles.clocks) == [0]


def test_names_decide_before_values():
    """Oracle: a header whose triads stand in an unusual order; a table of other names is no IMU."""
    rng = np.random.default_rng(3)
    values = np.column_stack(
        [np.arange(100.0) * 0.01, rng.normal(9.8, 0.1, (100, 3)), rng.normal(0.0, 0.1, (100, 3))]
    )
    roles = imu_roles(UnknownTable(values, ("IMUtime", "p", "q", "r", "AccX", "AccY", "AccZ")))
    assert roles is not None
    assert [roles.columns[name] for name in ("gx", "gy", "gz", "ax", "ay", "az")] == [
        1,
        2,
        3,
        4,
        5,
        6,
    ]
    assert imu_roles(UnknownTable(values, ("time", "a", "b", "c", "d", "e", "f"))) is None


# what a header may look like


@pytest.fixture(scope="module")
def numbers(flown):
    """Samples in rad/s and m/s^2, and fixes, of the data set: time, gyro, accel; time, lat, lon, h,
    sigmas.
    """
    imu = np.loadtxt(flown / IMU, delimiter=",", skiprows=1)
    return imu[:, 0], np.radians(imu[:, 1:4]), G * imu[:, 4:7], np.loadtxt(flown / GNSS)[:, :7]


def _write(path, header, columns, forms, delimiter=","):
    rows = zip(*(np.asarray(column).tolist() for column in columns), strict=True)
    text = "".join(
        delimiter.join(form % x for form, x in zip(forms, row, strict=True)) + "\n" for row in rows
    )
    path.write_text((header + "\n" if header else "") + text)


SAMPLE = ["%.9f"] * 6
UNIX_2008 = 315964800 + 2008 * 604800 - 18


def _euroc(place, t, w, f, fixes):
    names = (
        "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],a_RS_S_x [m"
        " s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]"
    )
    _write(
        place / "imu.csv",
        names,
        [np.rint((t + UNIX_2008) * 1e9).astype(np.int64), *w.T, *f.T],
        ["%d", *SAMPLE],
    )
    stamps = np.rint((fixes[:, 0] + UNIX_2008) * 1e9).astype(np.int64)
    _write(
        place / "fix.csv",
        "timestamp [ns],latitude [deg],longitude [deg],altitude [m]",
        [stamps, *fixes.T[1:4]],
        ["%d"] + ["%.10f"] * 3,
    )


def _increments(place, t, w, f, fixes):
    dt = float(np.median(np.diff(t)))
    _write(place / "imu.txt", "", [t, *(w * dt).T, *(f * dt).T], ["%.4f"] + ["%.12f"] * 6, " ")
    _write(place / "gnss.txt", "", fixes.T, ["%.3f"] + ["%.10f"] * 6, " ")


def _reversed_force(place, t, w, f, fixes):
    ms = np.rint(1e3 * (t - t[0]) + 5000)
    _write(
        place / "imu.csv",
        "t_ms;gyro_x;gyro_y;gyro_z;acc_x;acc_y;acc_z",
        [ms, *np.degrees(w).T, *(-f / G).T],
        ["%d", *SAMPLE],
        ";",
    )
    ms = np.rint(1e3 * (fixes[:, 0] - t[0]) + 5000)
    _write(place / "gps.csv", "t_ms;lat;lon;alt", [ms, *fixes.T[1:4]], ["%d"] + ["%.10f"] * 3, ";")


def _lying_header(place, t, w, f, fixes):
    names = "tow [s],gx [deg/s],gy [deg/s],gz [deg/s],ax [m/s^2],ay [m/s^2],az [m/s^2]"
    _write(place / "imu.csv", names, [t, *w.T, *f.T], ["%.4f", *SAMPLE])
    _write(
        place / "gnss.txt", "tow lat lon h sd_n sd_e sd_u", fixes.T, ["%.3f"] + ["%.10f"] * 6, " "
    )


def _two_clocks_and_half_a_velocity(place, t, w, f, fixes):
    names = "time,tow,GyroX_dps,GyroY_dps,GyroZ_dps,AccX_g,AccY_g,AccZ_g"
    _write(
        place / "imu.csv",
        names,
        [t - t[0], t, *np.degrees(w).T, *(f / G).T],
        ["%.4f", "%.4f", *SAMPLE],
    )
    columns = [fixes[:, 0], fixes[:, 2], fixes[:, 1], fixes[:, 3], 0.0 * t[: len(fixes)]]
    _write(
        place / "gnss.csv", "tow,lon,lat,ellipsoidal_height,vn", columns, ["%.3f"] + ["%.10f"] * 4
    )


def _units_behind_names(place, t, w, f, fixes):
    names = "time_s,gyro_x_deg_s,gyro_y_deg_s,gyro_z_deg_s,acc_x_m_s2,acc_y_m_s2,acc_z_m_s2"
    _write(place / "imu.csv", names, [t, *np.degrees(w).T, *f.T], ["%.4f", *SAMPLE])
    _write(
        place / "gnss.txt", "tow lat lon h sd_n sd_e sd_u", fixes.T, ["%.3f"] + ["%.10f"] * 6, " "
    )


def _units_at_the_last_of_a_triad(place, t, w, f, fixes):
    _write(
        place / "imu.csv",
        "tow,gx,gy,gz [deg/s],ax,ay,az [g]",
        [t, *np.degrees(w).T, *(f / G).T],
        ["%.4f", *SAMPLE],
    )
    _write(
        place / "gnss.txt", "tow lat lon h sd_n sd_e sd_u", fixes.T, ["%.3f"] + ["%.10f"] * 6, " "
    )


def _angles_for_rates(place, t, w, f, fixes):
    names = "tow,gyro_x_deg,gyro_y_deg,gyro_z_deg,acc_x_mps2,acc_y_mps2,acc_z_mps2"
    _write(place / "imu.csv", names, [t, *np.degrees(w).T, *f.T], ["%.4f", *SAMPLE])
    _write(
        place / "gnss.txt", "tow lat lon h sd_n sd_e sd_u", fixes.T, ["%.3f"] + ["%.10f"] * 6, " "
    )


def _utc_fixes(place, t, w, f, fixes):
    _write(place / "imu.txt", "", [t, *w.T, *f.T], ["%.4f", *SAMPLE], " ")
    _write(
        place / "gnss.txt", "", [fixes[:, 0] - 18.0, *fixes.T[1:]], ["%.3f"] + ["%.10f"] * 6, " "
    )


@pytest.mark.parametrize(
    ("write", "imu_keys", "offset"),
    [
        (_euroc, {"units": {"time": "unix_ns", "gyro": "rad/s", "accel": "m/s^2"}}, 0.0),
        pytest.param(
            _increments,
            {"quantity": "increments", "units": {"gyro": "rad", "accel": "m/s"}},
            0.0,
            marks=pytest.mark.slow,
        ),
        (
            _reversed_force,
            {"units": {"time": "ms", "gyro": "deg/s", "accel": "g"}, "accel_sign": -1},
            0.0,
        ),
        pytest.param(
            _lying_header,
            {"units": {"gyro": "rad/s", "accel": "m/s^2"}},
            0.0,
            marks=pytest.mark.slow,
        ),
        (_two_clocks_and_half_a_velocity, {"units": {"gyro": "deg/s", "accel": "g"}}, 0.0),
        pytest.param(
            _units_behind_names,
            {"units": {"gyro": "deg/s", "accel": "m/s^2"}},
            0.0,
            marks=pytest.mark.slow,
        ),
        pytest.param(
            _units_at_the_last_of_a_triad,
            {"units": {"gyro": "deg/s", "accel": "g"}},
            0.0,
            marks=pytest.mark.slow,
        ),
        (
            _angles_for_rates,
            {"quantity": "mean_rate", "units": {"gyro": "deg/s", "accel": "m/s^2"}},
            0.0,
        ),
        (_utc_fixes, {"units": {"gyro": "rad/s", "accel": "m/s^2"}}, 18.0),
    ],
)
@pytest.mark.slow
def test_files_of_other_makes_are_drafted_right_and_read_by_the_draft(
    numbers, tmp_path, write, imu_keys, offset
):
    """Oracle: the simulated samples, as the file was made of them; the draft reads them back in SI
    and on the fixes' clock.
    """
    t, w, f, fixes = numbers
    write(tmp_path, t, w, f, fixes)
    result = inspect_files([tmp_path]).write(tmp_path / "flight.toml")
    tree = tomllib.loads((tmp_path / "flight.toml").read_text())
    assert {key: tree["imu"].get(key) for key in imu_keys} == imu_keys
    assert tree["imu"]["axes"] == "right backward down"
    assert tree["gnss"].get("time_offset_s", 0.0) == pytest.approx(offset, abs=0.03)
    assert result.refusal is None
    recording = read_recording(load_flight(tmp_path))
    scale = float(np.median(np.diff(t))) if imu_keys.get("quantity") == "increments" else 1.0
    np.testing.assert_allclose(recording.imu.gyro / scale, w, atol=1e-7)
    np.testing.assert_allclose(recording.imu.accel / scale, f, atol=1e-6)
    assert abs((recording.gnss.time[0] - fixes[0, 0]) - (recording.imu.time[0] - t[0])) < 0.03


@pytest.mark.slow
def test_the_header_is_the_claim_of_a_flight_file_without_units(numbers, tmp_path):
    """Oracle: the units of the header, which holds; one that the flight file contradicts is told
    with both.
    """
    _units_behind_names(tmp_path, *numbers)
    inspect_files([tmp_path]).write(tmp_path / "flight.toml")
    text = (tmp_path / "flight.toml").read_text()
    units = 'units = { gyro = "deg/s", accel = "m/s^2" }\n'
    assert units in text
    for written, imu_units in (
        ("", []),
        (
            units.replace("deg/s", "deg/h"),
            ['the header says deg/s, and units gyro = "deg/h" was taken'],
        ),
    ):
        (tmp_path / "flight.toml").write_text(text.replace(units, written))
        checks = read_recording(load_flight(tmp_path)).checks
        assert [check.found for check in checks if check.name == "IMU units"] == imu_units
        claims = [check.expected for check in checks if check.name == "recognised units"]
        assert claims == ([] if imu_units else ["gyro in deg/s, accelerometer in m/s^2, mean_rate"])


# what the sensor shows


def _samples(
    noise_gyro, noise_accel, rate=100.0, seconds=200.0, seed=0, motion=0.0, mean=(0.0, 0.0, 0.0)
):
    rng = np.random.default_rng(seed)
    n = int(rate * seconds)
    t = np.arange(1, n + 1) / rate
    gyro = (
        np.array(mean)
        + rng.normal(0.0, noise_gyro * np.sqrt(rate), (n, 3))
        + motion * np.sin(2 * np.pi * 0.5 * t)[:, None]
    )
    accel = (
        np.array([0.0, 0.0, -9.8])
        + rng.normal(0.0, noise_accel * np.sqrt(rate), (n, 3))
        + 5.0 * motion * np.sin(2 * np.pi * 0.3 * t)[:, None]
    )
    return ImuSamples(t, gyro, accel)


def test_white_noise_is_measured_at_rest_and_under_motion():
    """Oracle: the density that was put in; 100 pieces give a sigma to 7 %, the least of several
    taus somewhat less.
    """
    still = sense(_samples(1e-4, 1e-3))
    np.testing.assert_allclose(still.rest_gyro, 1e-4, rtol=0.25)
    np.testing.assert_allclose(still.rest_accel, 1e-3, rtol=0.25)
    assert still.is_static
    moving = sense(
        _samples(1e-4, 1e-3, motion=0.3)
    )  # 0.3 rad/s at 0.5 Hz: its third difference is 1e-5 rad/s
    assert not len(moving.stationary)
    np.testing.assert_allclose(moving.moving_gyro, 1e-4, rtol=0.05)
    np.testing.assert_allclose(moving.moving_accel, 1e-3, rtol=0.05)


def test_earth_rate_is_seen_by_gyros_that_are_good_enough():
    """Oracle: the Earth's rate in the mean; the noise is that of a laser gyro, of a consumer
    sensor, and a bias hides it.
    """
    earth = EARTH_RATE * np.array([0.6, 0.0, 0.8])
    assert sense(_samples(1e-6, 1e-4, mean=earth)).sees_earth
    assert sense(_samples(1e-6, 1e-4, mean=earth)).grade == "navigation"
    assert not sense(_samples(3e-4, 1e-4, mean=earth)).sees_earth
    assert not sense(_samples(1e-6, 1e-4, mean=3.0 * earth)).sees_earth


def test_a_model_by_class_has_what_data_sheets_allow():
    """Scale factors of 1 % and misalignments of 8 mrad of a consumer sensor; none of a laser gyro,
    whose class calibrates them away.
    """
    consumer = noise_model(sense(_samples(3e-4, 1e-2, motion=0.3)), "x")
    assert {(a.scale_factor, a.misalignment) for a in (*consumer.gyro, *consumer.accel)} == {
        (0.01, 0.008)
    }
    earth = EARTH_RATE * np.array([0.6, 0.0, 0.8])
    navigation = noise_model(sense(_samples(1e-6, 1e-4, mean=earth)), "x")
    assert not navigation.gyro[0].scale_factor


def test_a_shipped_model_fits_its_own_noise_only():
    """Oracle: the densities of the shipped navchip model (paper 000, Table 5), and ten times."""
    gyro, accel = np.radians(10.825 / 3600.0), 51.514e-6 * G
    assert fitting_model(sense(_samples(gyro, accel))) == "navchip"
    assert fitting_model(sense(_samples(10.0 * gyro, 10.0 * accel))) != "navchip"


@pytest.mark.parametrize(("unit", "factor"), [("m/s^2", 1.0), ("g", 1.0 / G), ("mg", 1e3 / G)])
def test_gravity_tells_the_unit_of_force(unit, factor):
    """Oracle: the unit that was put in; the gyro's is not told."""
    imu = _samples(1e-4, 1e-3)
    alone = by_gravity(ImuSamples(imu.time, imu.gyro, imu.accel * factor), free=True)
    assert alone.findings[0].found == unit
    np.testing.assert_allclose(alone.imu.accel, imu.accel, rtol=1e-9)
    assert alone.findings[1].found == "unknown"


def test_vertical_axes_are_right_handed_and_vertical():
    """Oracle: `parse_axes` refuses others; the axis that feels gravity upward is up."""
    for axis in range(3):
        for sign in (-1.0, 1.0):
            force = sign * G * np.eye(3)[axis]
            words, _ = vertical_axes(force)
            np.testing.assert_allclose(parse_axes(words) @ force, [0.0, 0.0, -G], atol=1e-12)


# the draft


def test_draft_is_toml_and_unsure_keys_are_comments(tmp_path):
    """Oracle: tomllib on names with quotes, backslashes and a control character."""
    draft = Draft()
    draft.add("", "name", 'a "b" \\ c\x07')
    draft.add("imu", "file", tmp_path / "x" / "imu.csv", "evidence " * 40)
    draft.add("imu", "axes", "forward right down", "unsure", sure=False)
    draft.add("imu", "units", {"gyro": "0.05 deg/s"})
    draft.add("gnss", "columns", [f"column_{k}" for k in range(30)])
    (path,) = write_draft(draft, tmp_path / "flight.toml")
    tree = tomllib.loads(path.read_text())
    assert tree["name"] == 'a "b" \\ c\x07'
    assert tree["imu"] == {"file": "x/imu.csv", "units": {"gyro": "0.05 deg/s"}}
    assert tree["gnss"]["columns"][29] == "column_29"
    assert '# axes = "forward right down"' in path.read_text()
    assert max(map(len, path.read_text().splitlines())) < 140


@pytest.mark.parametrize("value", [True, 3, -0.5, 1e-9, "x", [1.0, [2, "y"]], {"a": 1}])
def test_values_come_back_as_they_are(value):
    """Oracle: tomllib."""
    assert tomllib.loads(f"key = {toml(value)}")["key"] == value


# recorded data


def _inspected(*parts):
    path = DATA.joinpath(*parts)
    if not path.exists():
        pytest.skip(f"the recording {path.name} is not here")
    return inspect_files([path])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("parts", "axes", "offset", "width"),
    [
        (("umn_thor75",), "forward right down", -0.15, 0.1),
        (("apm_skywalker_x8", "TestLog2.mat"), "forward right down", -0.25, 0.06),
        (("apm_skywalker_x8", "SwissLog1.mat"), "forward right down", -0.22, 0.06),
        (("hipnuc_car",), "right forward up", -0.15, 0.15),
        (("tilt_rtk_walk",), "forward right down", 0.0, 0.03),
        (("apm_quad106",), "forward right down", -0.19, 0.1),
        (("hipnuc_car_2", "data20220303.mat"), "right forward up", -0.145, 0.05),
        (("hipnuc_car_2", "data20220416.mat"), "right forward up", -0.145, 0.05),
    ],
)
def test_recordings_are_recognised(parts, axes, offset, width):
    """Oracle: the notes beside the recordings: axes and units checked there by a filter of its own,
    latency as far as it is known.
    """
    found = _inspected(*parts).recognition
    assert found is not None
    assert found.axes == axes
    assert (found.gyro_unit, found.accel_unit, found.accel_sign) == (
        "rad/s",
        "m/s^2",
        1,
    )  # of the numbers as read
    assert abs(found.time_offset_s - offset) < width


def test_laser_gyro_gets_its_site_and_its_axes():
    """Oracle: the header of the file, and the notes beside it: x right, y forward, z up, Earth rate
    seen.
    """
    result = _inspected("psins_lasergyro")
    assert result.sensing.sees_earth
    assert result.draft is not None
    tables = {
        table: {entry.key: entry.value for entry in entries}
        for table, entries in result.draft.tables.items()
    }
    assert tables["imu"]["axes"] == "right forward up"
    np.testing.assert_allclose(
        tables["gnss"]["stationary"], [34.246048, 108.909664, 380.0], atol=1e-9
    )


@pytest.mark.slow
def test_static_counts_are_told_as_such():
    """Oracle: the notes beside the recording: z down, one count of the accelerometers 3.33 mg."""
    result = _inspected("adis16405_static", "adis_16405_imu1.npy")
    assert result.sensing.is_static
    values = {finding.name: finding.found for finding in result.findings}
    assert values["vertical axis"] == "z down"
    assert float(values["accelerometer unit"].split()[0]) == pytest.approx(3.33e-3 * G, rel=0.03)
    assert "position" in result.missing


@pytest.mark.slow
def test_several_recordings_in_a_directory_are_listed():
    """Oracle: the six files of the recording."""
    if not (DATA / "adis16405_static").is_dir():
        pytest.skip("the recording adis16405_static is not here")
    with pytest.raises(InputError, match="6 recordings of an IMU"):
        inspect_files([DATA / "adis16405_static"])
