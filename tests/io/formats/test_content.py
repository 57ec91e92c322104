"""Columns out of MATLAB and numpy files: labels, places, structs, HDF5; and what `describe` says is
there.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from oracles import oracle
from scipy.io import savemat

from insgnss.base.errors import InputError, UsageError
from insgnss.io.formats import describe, read_gnss, read_imu

DATA = Path(__file__).parents[3].parent / "shared" / "data"
T = 100.0 + 0.02 * np.arange(6)
M = np.column_stack([T * 1e3, np.tile([1.0, 2, 3, 4, 5, 6], (6, 1))])
NAMES = ["TimeMS", "GyrX", "GyrY", "GyrZ", "AccX", "AccY", "AccZ"]
CANONICAL = ("tow", "gx", "gy", "gz", "ax", "ay", "az")


def recording(name: str) -> Path:
    if not (DATA / name).exists():
        pytest.skip(f"the recording {name} is not at hand; it is not shipped")
    return DATA / name


def mat(path: Path) -> Path:
    labels = np.array(NAMES, dtype=object).reshape(-1, 1)
    savemat(
        path,
        {
            "IMU": M,
            "IMU_label": labels,
            "t": T,
            "w": M[:, 1:4],
            "f": M[:, 4:],
            "log": {"imu": {"M": M}},
            "title": "flight 1",
        },
    )
    return path


def mat73(path: Path) -> Path:
    h5py = oracle("h5py")
    with h5py.File(path, "w", userblock_size=512) as file:
        file["IMU"], file["t"], file["w"], file["f"] = M.T, T[None, :], M[:, 1:4].T, M[:, 4:].T
        file["log/imu/M"] = M.T
        cells = []
        for k, name in enumerate(NAMES):
            text = file.create_dataset(
                f"#refs#/{k}", data=np.array([[ord(c)] for c in name], dtype=np.uint16)
            )
            text.attrs["MATLAB_class"] = np.bytes_("char")
            cells.append(text.ref)
        file.create_dataset(
            "IMU_label", data=np.array([cells], dtype=h5py.ref_dtype), dtype=h5py.ref_dtype
        )
    return path


@pytest.mark.parametrize("make", [mat, mat73])
@pytest.mark.parametrize(
    "spec",
    [
        {
            "variable": "IMU",
            "columns": dict(zip(CANONICAL, NAMES, strict=True)),
            "units": {"time": "ms"},
        },
        {
            "columns": {name: f"IMU.{label}" for name, label in zip(CANONICAL, NAMES, strict=True)},
            "units": {"time": "ms"},
        },
        {
            "variable": "IMU",
            "columns": {name: f"[{k}]" for k, name in enumerate(CANONICAL, 1)},
            "units": {"time": "ms"},
        },
        {
            "columns": (
                {"tow": "t"}
                | {
                    f"{s}{c}": f"{m}[{k}]"
                    for s, m in (("g", "w"), ("a", "f"))
                    for k, c in enumerate("xyz", 1)
                }
            )
        },
        {
            "columns": {name: f"log.imu.M[{k}]" for k, name in enumerate(CANONICAL, 1)},
            "units": {"time": "ms"},
        },
        {"variable": "log.imu.M", "columns": list(CANONICAL), "units": {"time": "ms"}},
    ],
)
def test_ways_to_name_a_column(
    tmp_path: Path, make: Callable[[Path], Path], spec: dict[str, object]
) -> None:
    """Oracle: the matrix that was written."""
    imu = read_imu(make(tmp_path / "x.mat"), **spec)
    assert_allclose(imu.time, T, rtol=1e-15)
    assert np.array_equal(np.column_stack([imu.gyro, imu.accel]), M[:, 1:])


@pytest.mark.parametrize(
    ("spec", "error", "message"),
    [
        (
            {"columns": {"tow": "w"}},
            InputError,
            r"w is a matrix of 6 x 3; name one of its columns, w\[1\]",
        ),
        ({"columns": {"tow": "w[4]"}}, InputError, r"no w\[4\]; there are 3 columns"),
        (
            {"variable": "IMU", "columns": {"tow": "Time"}},
            InputError,
            "no IMU.Time; there are TimeMS, GyrX",
        ),
        ({"columns": {"tow": "title"}}, InputError, "title holds no numbers"),
        (
            {"columns": {"tow": "log.imu"}},
            InputError,
            r"log.imu holds no numbers \(a struct of M\)",
        ),
        (
            {"columns": {"tow": "t", "gx": "t"}},
            InputError,
            "columns does not name gy, gz, ax, ay, az",
        ),
        (
            {"columns": {"tow": "t", "omega": "t"}},
            UsageError,
            "columns: 'omega' is none of tow, week, gx",
        ),
        ({}, UsageError, r"needs columns = .*there are IMU: TimeMS GyrX .*; at the top: t "),
    ],
)
def test_refusals(
    tmp_path: Path, spec: dict[str, object], error: type[Exception], message: str
) -> None:
    """Oracle: data_specs/matlab.md."""
    with pytest.raises(error, match=message):
        read_imu(mat(tmp_path / "x.mat"), **spec)


def test_without_h5py_the_way_out_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: the message of data_specs/matlab.md's first line."""
    path = mat73(tmp_path / "x.mat")
    monkeypatch.setitem(__import__("sys").modules, "h5py", None)
    with pytest.raises(InputError, match="needs h5py: pip install h5py; or save it with -v7"):
        read_imu(path, columns={"tow": "t"})


@pytest.mark.parametrize("make", [mat, mat73])
def test_description(tmp_path: Path, make: Callable[[Path], Path]) -> None:
    """Oracle: what was written."""
    tables = {table.name: table for table in describe(make(tmp_path / "x.mat"))}
    assert tables["IMU"].columns == tuple(NAMES)
    assert tables["log.imu.M"].columns == tuple(f"[{k}]" for k in range(1, 8))
    assert {"t", "w[1]", "f[3]"} <= set(tables[""].columns)
    assert all(table.rows == 6 for table in tables.values())


def test_numpy_files(tmp_path: Path) -> None:
    """Oracle: the arrays that were written."""
    spec = {"columns": list(CANONICAL), "units": {"time": "ms"}}
    np.save(tmp_path / "x.npy", M)
    np.savez(tmp_path / "x.npz", IMU=M, t=T)
    record = np.rec.fromarrays(list(M.T), names=NAMES)
    np.save(tmp_path / "r.npy", record)
    named = {"columns": dict(zip(CANONICAL, NAMES, strict=True)), "units": {"time": "ms"}}
    for imu in (
        read_imu(tmp_path / "x.npy", **spec),
        read_imu(tmp_path / "x.npz", variable="IMU", **spec),
        read_imu(tmp_path / "r.npy", **named),
    ):
        assert_allclose(imu.time, T, rtol=1e-15)
        assert np.array_equal(np.column_stack([imu.gyro, imu.accel]), M[:, 1:])
    assert describe(tmp_path / "r.npy")[0].columns == tuple(NAMES)
    assert describe(tmp_path / "x.npy")[0].columns[0] == "[1]"
    np.save(tmp_path / "o.npy", np.array([{}], dtype=object))
    with pytest.raises(InputError, match="is no whole numpy file"):
        read_imu(tmp_path / "o.npy", **spec)
    (tmp_path / "x.npy").write_bytes((tmp_path / "x.npy").read_bytes() + b"\0")
    with pytest.raises(InputError, match="465 bytes, expected 464"):
        read_imu(tmp_path / "x.npy", **spec)


def test_description_of_text_and_sentences(tmp_path: Path) -> None:
    """Oracle: the lines as a person reads them."""
    (tmp_path / "a.csv").write_text("Time (ms),ax [g],note\n1,2,3\n4,5,6\n")
    table = describe(tmp_path / "a.csv")[0]
    assert (table.columns, table.units, table.rows) == (
        ("Time (ms)", "ax [g]", "note"),
        ("ms", "g", ""),
        2,
    )
    (tmp_path / "b.txt").write_text("1 2 3\n4 5 6\n")
    assert describe(tmp_path / "b.txt")[0].columns == ("[1]", "[2]", "[3]")
    (tmp_path / "c.nmea").write_text("$GPTXT,hello*01\r\n")
    assert [(table.name, table.rows) for table in describe(tmp_path / "c.nmea")] == [("GPTXT", 1)]


def moved(lat: np.ndarray, lon: np.ndarray, time: np.ndarray) -> np.ndarray:
    """North and east velocity (n - 2, 2), m/s, by central differences of positions on a sphere."""
    north, east = 6371e3 * lat, 6371e3 * np.cos(lat[0]) * lon
    return (
        np.column_stack([(north[2:] - north[:-2]), (east[2:] - east[:-2])])
        / (time[2:] - time[:-2])[:, None]
    )


@pytest.mark.parametrize(
    ("file", "spec", "fixes"),
    [
        (
            "apm_skywalker_x8/TestLog2.mat",
            {
                "variable": "GPS",
                "columns": {
                    "tow": "T",
                    "week": "Week",
                    "lat": "Lat",
                    "lon": "Lng",
                    "h": "Alt",
                    "speed": "Spd",
                    "course": "GCrs",
                    "vd": "VZ",
                },
                "units": {"time": "ms"},
            },
            3050,
        ),
        (
            "apm_skywalker_x8/SwissLog1.mat",
            {
                "columns": {
                    "tow": "GPStime",
                    "lat": "LatDeg",
                    "lon": "LngDeg",
                    "h": "Hgt",
                    "speed": "GndSpd",
                    "course": "CourseDeg",
                    "vd": "VelD",
                },
                "units": {"course": "rad"},
            },
            502,
        ),
    ],
)
def test_speed_and_course_are_those_of_the_track(
    file: str, spec: dict[str, object], fixes: int
) -> None:
    """Oracle: differences of the recorded positions (stamps of 5 Hz jitter by some 10 %,
    single-point fixes).
    """
    got = read_gnss(recording(file), sigma_m=[2, 2, 4], sigma_velocity=[0.3, 0.3, 0.5], **spec)
    assert got.time.size == fixes
    assert got.velocity_ned is not None
    differences, told = moved(got.lat, got.lon, got.time), got.velocity_ned[1:-1, :2]
    fast = np.hypot(told[:, 0], told[:, 1]) > 8.0
    assert fast.sum() > 100
    assert np.corrcoef(differences[fast, 0], told[fast, 0])[0, 1] > 0.97
    assert np.corrcoef(differences[fast, 1], told[fast, 1])[0, 1] > 0.97


def test_autopilot_export() -> None:
    """Oracle: the recording's description: 30650 samples at 49.99 Hz over 613 s, 502 and 13656
    rows, matrices with labels.
    """
    path = recording("apm_skywalker_x8/TestLog2.mat")
    imu = read_imu(
        path, variable="IMU", columns=dict(zip(CANONICAL, NAMES, strict=True)), units={"time": "ms"}
    )
    assert imu.time.size == 30650
    assert imu.time[-1] - imu.time[0] == pytest.approx(613.1, abs=0.1)
    assert np.median(imu.accel[:200, 2]) == pytest.approx(-9.6, abs=0.1)
    week = {"tow": "TimeMS", "week": "Week", "lat": "Lat", "lon": "Lng", "h": "Alt"}
    gps = read_gnss(path, variable="GPS", columns=week, units={"time": "ms"}, sigma_m=[2, 2, 4])
    assert (gps.gps_week, gps.time.size, gps.time[0]) == (1768, 3049, 511214.5)
    assert "1 rows left out that contradict an earlier row of their time" in gps.notes[1].found
    path = recording("apm_skywalker_x8/SwissLog1.mat")
    columns = {"tow": "IMUtime"} | {
        f"{s}{c}": f"{m}[{k}]"
        for s, m in (("g", "angRate"), ("a", "accel"))
        for k, c in enumerate("xyz", 1)
    }
    assert read_imu(path, columns=columns).time.size == 13656
    tables = describe(path)
    assert any(
        {"GPStime", "CourseDeg"} <= set(table.columns) and table.rows == 502 for table in tables
    )
    assert any(
        {"IMUtime", "angRate[3]", "accel[1]"} <= set(table.columns) and table.rows == 13656
        for table in tables
    )


def test_static_counts() -> None:
    """Oracle: the recording's description: LSB 0.05 deg/s and 0.00333 g, 100 Hz, 10000 s, mean of
    accelerometer z -1.017 g.
    """
    path = recording("adis16405_static/adis_16405_imu1.npy")
    spec = {
        "columns": list(CANONICAL[1:]),
        "units": {"gyro": "0.05 deg/s", "accel": "0.00333 g"},
        "rate_hz": 100.0,
    }
    imu = read_imu(path, **spec)
    raw = np.load(path, mmap_mode="r")
    assert_allclose(np.degrees(imu.gyro[::1000]), raw[::1000, :3] * 0.05, rtol=1e-14)
    assert imu.accel[:, 2].mean() / 9.80665 == pytest.approx(-1.017, abs=1.5e-3)
    assert (imu.time[0], imu.time[-1]) == (0.0, 9999.99)
