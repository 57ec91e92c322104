"""Mutated files through every reader: each must come out as a record or as one line that says what
is wrong.

Small files of every format are made in memory and mutated: bytes flipped, cut, doubled, swapped,
lines moved, numbers made huge or not a number, encodings changed, fields, lines and files made
long, brackets and elements put within each other by the thousand. What the readers do with them is
judged:

    record      read; what was left out or put in order is counted in its notes
    refused     InputError, UsageError or DataError with a message of one line
    find        any other exception, a warning, something printed, more than 5 s, more than 2 GB, a
                recording that was cut within a row and nothing said, or another number than the one
                that is written (`fuzz_values`)

A file that is cut exactly between two rows looks whole, and no reader can know. Input k depends on
the seed and on k alone, so a find is seen again by `--only k`; its file is left in the directory
that is printed.

    python scripts/fuzz_readers.py --count 1000000 --seed 1 --workers 4 --state fuzz.json

prints a table a format and ends with an error where there is a find. Pieces of inputs run in
processes of their own, as many as there are workers: one that the system ends, by a crash in a
library of C for instance, is a find, and the next takes up behind it. What is done stands in the
state file, from which the same command goes on. About 1000 inputs a second and core.
"""

import argparse
import contextlib
import faulthandler
import importlib.util
import io
import json
import os
import resource
import signal
import struct
import subprocess
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import FrameType

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

sys.path.insert(0, str(Path(__file__).parent))

import numpy as np
from fuzz_cases import Case, further_cases, static_cases
from fuzz_values import contradiction, structured

from insgnss.base.errors import DataError, InputError, UsageError
from insgnss.io.formats import read_events, read_gnss, read_imu
from insgnss.io.formats.trajectory.odyn import read_odyn_poses

LIMIT_S = 5
COMPILED_S = 600  # of the file as it stands, for which kernels are compiled where they are not yet
LIMIT_BYTES = 2_000_000_000
LONGEST = 2_000_000  # bytes of a file
SHOWN = 3  # finds of a kind that are printed
PIECE = 20_000  # inputs that a process takes
START = 200000.0
ROWS = 24


def dataflash(
    messages: list[tuple[str, str, str, list[tuple[float, ...]]]],
) -> tuple[bytes, frozenset[int]]:
    """An ArduPilot log of (name, format, labels, rows) by the public description of DataFlash; rows
    in the order of their first value.
    """
    sizes = dict(
        zip("bBhHiIfdcCeELMqQ", (1, 1, 2, 2, 4, 4, 4, 8, 2, 2, 4, 4, 4, 1, 8, 8), strict=True)
    )
    codes = dict(zip("cCeELM", "hHiIib", strict=True))
    scales = {**dict.fromkeys("cCeE", 100), "L": 10**7}
    out, rows = [], []
    fmt = [
        ("FMT", "BBnNZ", "Type,Length,Name,Format,Columns"),
        *((name, form, labels) for name, form, labels, _ in messages),
    ]
    for kind, (name, form, labels) in enumerate(fmt, 128):
        length = 89 if kind == 128 else 3 + sum(sizes[c] for c in form)
        out.append(
            struct.pack(
                "<BBBBB4s16s64s",
                0xA3,
                0x95,
                128,
                kind,
                length,
                name.encode(),
                form.encode(),
                labels.encode(),
            )
        )
    for kind, (_, form, _, table) in enumerate(messages, 129):
        pack = "<BBB" + "".join(codes.get(c, c) for c in form)
        for row in table:
            values = [
                v if c in "fd" else round(v * scales.get(c, 1))
                for c, v in zip(form, row, strict=True)
            ]
            rows.append((row[0], struct.pack(pack, 0xA3, 0x95, kind, *values)))
    out += [body for _, body in sorted(rows, key=lambda pair: pair[0])]
    return b"".join(out), frozenset(np.cumsum([len(part) for part in out]).tolist())


def ulog(topics: list[tuple[str, str, list[tuple[float, ...]]]]) -> tuple[bytes, frozenset[int]]:
    """A PX4 log of (topic, fields "type name; ...", rows) by the public description of ULog; the
    first field is the time stamp.
    """
    codes = {
        "uint64_t": "Q",
        "int64_t": "q",
        "uint32_t": "I",
        "int32_t": "i",
        "uint8_t": "B",
        "float": "f",
        "double": "d",
        "bool": "?",
    }
    out, rows = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)], []

    def message(kind: str, body: bytes) -> bytes:
        return struct.pack("<HB", len(body), ord(kind)) + body

    out.append(message("B", bytes(40)))
    out += [
        message("F", f"{name}:{fields};".replace("; ", ";").encode()) for name, fields, _ in topics
    ]
    out += [
        message("A", struct.pack("<BH", 0, k) + name.encode())
        for k, (name, _, _) in enumerate(topics)
    ]
    for k, (_, fields, table) in enumerate(topics):
        pack = "<H"
        for part in fields.split("; "):
            kind, _, count = part.split()[0].partition("[")
            pack += codes[kind] * int(count.rstrip("]") or 1)
        rows += [(row[0], message("D", struct.pack(pack, k, *row))) for row in table]
    out += [body for _, body in sorted(rows, key=lambda pair: pair[0])]
    return b"".join(out), frozenset(np.cumsum([len(part) for part in out]).tolist())


def ardupilot_log(n: int = ROWS) -> tuple[bytes, frozenset[int]]:
    """A short log: IMU at 50 Hz, GPS, GPA and BARO at 5 Hz, CAM at 1 Hz; fixes 0.1 s before their
    messages.
    """
    micro = [1_000_000 + 20_000 * k for k in range(10 * n)]
    imu = [(t, 0, 0.01, -0.02, 0.03, 0.1, -0.2, -9.8) for t in micro]
    gps = [
        (
            t,
            0,
            3,
            (START + 1e-6 * t - 0.1) * 1e3,
            2008,
            12,
            0.9,
            46.57 + 1e-8 * k,
            6.54,
            580.5,
            10.0,
            90.0,
            0.1,
        )
        for k, t in enumerate(micro[::10])
    ]
    gpa = [(t, 0, 1.5, 0.9, 1.4, 0.2, -49.5) for t in micro[::10]]
    baro = [(t, 0, 0.1 * k, 89874.6 - k, 25.0) for k, t in enumerate(micro[::10])]
    cam = [(t, k + 1) for k, t in enumerate(micro[::50])]
    return dataflash(
        [
            ("IMU", "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ", imu),
            (
                "GPS",
                "QBBIHBcLLefff",
                "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ",
                gps,
            ),
            ("GPA", "QBCCCCf", "TimeUS,I,VDop,HAcc,VAcc,SAcc,Und", gpa),
            ("BARO", "QBfff", "TimeUS,I,Alt,Press,Temp", baro),
            ("CAM", "QH", "TimeUS,Img", cam),
        ]
    )


def px4_log(n: int = ROWS) -> tuple[bytes, frozenset[int]]:
    """A short log: sensor_combined at 100 Hz, vehicle_gps_position and vehicle_air_data at 5 Hz,
    camera_capture at 1 Hz; fixes 0.1 s before their messages.
    """
    unix = 315964800.0 + 2008 * 604800.0 + START - 18.0
    micro = [1_000_000 + 10_000 * k for k in range(20 * n)]
    imu = [(t, 0.01, -0.02, 0.03, 0.1, -0.2, -9.8) for t in micro]
    gps = [
        (
            t,
            round((unix - 0.1) * 1e6) + t,
            465700000 + k,
            65400000,
            630000,
            3,
            0.9,
            1.4,
            0.2,
            10.0,
            0.0,
            -0.1,
        )
        for k, t in enumerate(micro[::20])
    ]
    fields = (
        "uint64_t timestamp; uint64_t time_utc_usec; int32_t lat; int32_t lon; int32_t"
        " alt_ellipsoid; uint8_t fix_type; float eph; "
    )
    fields += "float epv; float s_variance_m_s; float vel_n_m_s; float vel_e_m_s; float vel_d_m_s"
    return ulog(
        [
            (
                "sensor_combined",
                "uint64_t timestamp; float[3] gyro_rad; float[3] accelerometer_m_s2",
                imu,
            ),
            ("vehicle_gps_position", fields, gps),
            (
                "vehicle_air_data",
                "uint64_t timestamp; uint64_t timestamp_sample; float baro_alt_meter; float"
                " baro_pressure_pa",
                [(t, t - 8000, 600.0, 89874.6 - k) for k, t in enumerate(micro[::20])],
            ),
            (
                "camera_capture",
                "uint64_t timestamp; uint32_t seq",
                [(t, k + 1) for k, t in enumerate(micro[::100])],
            ),
        ]
    )


def rosbag(n: int = ROWS) -> bytes:
    """A bag of ROS 1 with IMU messages at 200 Hz, by rosbags' own writer."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    of = {name.rpartition("/")[2]: kind for name, kind in store.types.items()}
    of["Time"] = store.types["builtin_interfaces/msg/Time"]
    zero = {
        f"{name}_covariance": np.zeros(9)
        for name in ("orientation", "angular_velocity", "linear_acceleration")
    }
    with tempfile.TemporaryDirectory() as folder:
        with Writer(Path(folder) / "x.bag") as writer:
            connection = writer.add_connection("/imu", "sensor_msgs/msg/Imu", typestore=store)
            for k in range(n):
                stamp = of["Time"](sec=1_530_623_100, nanosec=5_000_000 * k)
                message = of["Imu"](
                    header=of["Header"](seq=k, stamp=stamp, frame_id="imu"),
                    orientation=of["Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
                    angular_velocity=of["Vector3"](0.01, 0.02, 0.03),
                    linear_acceleration=of["Vector3"](0.1, -0.2, 9.8),
                    **zero,
                )
                data = store.serialize_ros1(message, "sensor_msgs/msg/Imu")
                writer.write(connection, 10**18 + k, data)
        return (Path(folder) / "x.bag").read_bytes()


def sentence(body: str) -> str:
    """An NMEA sentence with its checksum."""
    check = 0
    for c in body.encode():
        check ^= c
    return f"${body}*{check:02X}\r\n"


def _nmea() -> str:
    out = []
    for k in range(ROWS):
        clock = f"0731{13 + k // 10:02d}.{k % 10}0"
        out.append(
            sentence(
                f"GNGGA,{clock},4634.2000{k:04d},N,00632.40000000,E,4,34,0.6,580.5000,M,49.5000,M,"
                "1.4,74"
            )
        )
        out.append(
            sentence(f"GNRMC,{clock},A,4634.20000000,N,00632.40000000,E,0.012,325.9,030718,,,A")
        )
        out.append(sentence(f"GNGST,{clock},2.21,0.01,0.01,49.4292,0.010,0.011,0.026"))
    return "".join(out)


def _rows(form: str, *columns: object) -> str:
    """Lines of a % format; a column that is not a list stands in every row."""
    lists = [column if isinstance(column, list) else [column] * ROWS for column in columns]
    return "".join(form % row + "\n" for row in zip(*lists, strict=True))


def _mrk() -> str:
    form = (
        "%d\t%.6f\t[2024]\t   -26,N\t    19,E\t  "
        " 191,V\t%.8f,Lat\t174.63075195,Lon\t170.415,Ellh\t1.492559, 1.368525, 3.180128\t16,Q"
    )
    return _rows(
        form,
        [k + 1 for k in range(ROWS)],
        [START + 2.7 * k for k in range(ROWS)],
        [-36.4 + 1e-6 * k for k in range(ROWS)],
    )


def text_cases() -> list[Case]:
    """One case a text format, and its variants."""
    t = [START + 0.1 * k for k in range(ROWS)]
    imu = "tow[s],gx[rad/s],gy[rad/s],gz[rad/s],ax[m/s^2],ay[m/s^2],az[m/s^2]\n"
    imu += _rows(
        "%.4f,%.6f,0.020000,0.030000,0.1000,-0.2000,-9.8000", t, [1e-4 * k for k in range(ROWS)]
    )
    ms = _rows("%d;0,01;0,02;0,03;0,10;-0,20;-9,80", [20 * k for k in range(ROWS)])
    gnss = "# tow[s] lat[deg] lon[deg] h[m] sd_n[m] sd_e[m] sd_u[m] Q\n" + _rows(
        "%.3f 46.57%06d 6.5400000000 630.0000 0.0200 0.0200 0.0300 1", t, list(range(ROWS))
    )
    pos = (
        "% (lat/lon/height=WGS84/ellipsoidal,Q=1:fix)\n%  GPST latitude(deg) longitude(deg)"
        " height(m) Q ns "
    )
    pos += "sdn(m) sde(m) sdu(m) sdne(m) sdeu(m) sdun(m) age(s) ratio\n"
    tail = "630.0000 1 16 0.0049 0.0046 0.0102 0.0028 0.0018 -0.0033 0.03 6.4"
    body = _rows(f"2008 %.3f 46.57%06d 6.540000000 {tail}", t, list(range(ROWS)))
    dated = _rows(
        f"2018/07/03 07:33:%06.3f,46.57%06d,6.540000000,{tail.replace(' ', ',')}",
        [0.1 * k for k in range(ROWS)],
        list(range(ROWS)),
    )
    aimu = "".join(
        sentence(
            f"AIMU,2,{1774683140 + 0.01 * k:.3f},{634 + 0.01 * k:.3f},0,0,0,"
            "-5.313,+11.600,-6.795,-1.294,-0.924,-8.596,45.8"
        )
        for k in range(ROWS)
    )
    psins = (
        "% PSINS-format SIMU log file.\n0.0 0.0 -90.6 0.0 0.0 0.0\n34.246048 108.909664 380.0 0.0"
        " 10.0 9.780327\n"
    )
    psins += "0.1 0.1 0.1 125.0 125.0 125.0\n"
    poses = _rows(
        "%.1f,46.57%06d,6.5400000,630.0,0.0,0.7071067811865476,0.7071067811865476,0.00",
        t,
        list(range(ROWS)),
    )
    log = "FMT, 129, 31, IMU, QBffffff, TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ\n"
    log += "FMT, 130, 50, GPS, QBBIHLLe, TimeUS,I,Status,GMS,GWk,Lat,Lng,Alt\n"
    log += _rows(
        "GPS, %d, 0, 3, %d, 2008, 46.57, 6.54, 580.5",
        [10**6 + 20000 * k for k in range(ROWS)],
        [200000000 + 20 * k for k in range(ROWS)],
    )
    log += _rows(
        "IMU, %d, 0, 0.0012, -0.0003, 0.0100, 0.1200, -0.0300, -9.8010",
        [10**6 + 20000 * k for k in range(ROWS)],
    )
    units = {"gyro": "0.05 deg/s", "accel": "1 mg", "time": "ms"}
    named = ["tow", "gx", "gy", "gz", "ax", "ay", "az"]
    texts: list[tuple[str, str, str, Callable[[Path], object]]] = [
        ("imu_csv", "imu.csv", imu, read_imu),
        ("imu_csv units", "imu.txt", ms, lambda p: read_imu(p, columns=named, units=units)),
        ("gnss_text", "gnss.txt", gnss, read_gnss),
        ("rtklib_pos", "x.pos", pos + body, read_gnss),
        ("rtklib_pos dated", "x.pos", pos + dated, read_gnss),
        ("rtklib_pos plain", "x.pos", body, read_gnss),
        ("nmea", "x.nmea", _nmea(), lambda p: read_gnss(p, sigma_velocity=[0.1, 0.1, 0.1])),
        ("aimu", "x.aimu", aimu, read_imu),
        (
            "events",
            "e.txt",
            "# image tow[s]\n" + _rows("%d.tif %.7f", [8001 + k for k in range(ROWS)], t),
            read_events,
        ),
        ("mrk", "x.MRK", _mrk(), read_events),
        (
            "psins",
            "x.imu",
            psins + _rows("%d 0 2 0 0 80", [k % 7 - 3 for k in range(ROWS)]),
            lambda p: read_imu(p, quantity="increments"),
        ),
        ("odyn", "reference.txt", poses, read_odyn_poses),
        ("ardupilot text", "x.log", log, lambda p: read_imu(p, quantity="instant_rate")),
    ]
    return [Case(name, file, text.encode(), read) for name, file, text, read in texts]


def binary_cases() -> list[Case]:
    """One case a binary format and kind of record, as far as its library is there."""
    from scipy.io import savemat

    t = START + 0.1 * np.arange(ROWS)
    table = np.column_stack([t, np.tile([0.01, 0.02, 0.03, 0.1, -0.2, -9.8], (ROWS, 1))])
    mat, packed, npy, npz = io.BytesIO(), io.BytesIO(), io.BytesIO(), io.BytesIO()
    names = dict(
        zip(
            ("tow", "gx", "gy", "gz", "ax", "ay", "az"),
            (f"m[{k}]" for k in range(1, 8)),
            strict=True,
        )
    )
    savemat(mat, {"m": table})
    fixes = {
        "lat": 46.57 + 1e-8 * np.arange(ROWS),
        "lon": 6.54 + np.zeros(ROWS),
        "h": 630.0 + np.zeros(ROWS),
        "tow": t,
    }
    savemat(packed, {"gps": fixes}, do_compression=True)
    np.save(npy, table)
    np.savez(npz, **fixes)
    sbet = np.zeros((ROWS, 17))
    sbet[:, 0], sbet[:, 1], sbet[:, 2], sbet[:, 3] = t, 0.8, 0.1, 630.0
    rms = np.column_stack([t, np.full((ROWS, 9), 0.02)])
    same = {key: key for key in fixes}
    near, rec = {"sigma_m": [1, 1, 2]}, frozenset(range(136, ROWS * 136, 136))
    cases = [
        Case("matlab", "x.mat", mat.getvalue(), lambda p: read_imu(p, columns=names), False),
        Case(
            "matlab packed",
            "x.mat",
            packed.getvalue(),
            lambda p: read_gnss(p, columns=same, variable="gps", **near),
            False,
        ),
        Case("npy", "x.npy", npy.getvalue(), lambda p: read_imu(p, columns=list(names)), False),
        Case("npz", "x.npz", npz.getvalue(), lambda p: read_gnss(p, columns=same, **near), False),
        Case(
            "sbet",
            "x.sbet",
            sbet.tobytes(),
            lambda p: read_gnss(p, sigma_m=[1, 1, 2], sigma_velocity=[1, 1, 1]),
            False,
            rec,
        ),
        Case(
            "smrmsg",
            "x.smrmsg",
            rms.tobytes(),
            lambda p: read_gnss(p.with_suffix(".sbet")),
            False,
            frozenset(range(80, ROWS * 80, 80)),
            {"x.sbet": sbet.tobytes()},
        ),
    ]
    if importlib.util.find_spec("pymavlink"):
        data, borders = ardupilot_log()
        readers = {
            "imu": lambda p: read_imu(p, quantity="instant_rate"),
            "gnss": read_gnss,
            "events": read_events,
        }
        cases += [
            Case(f"ardupilot {kind}", "x.bin", data, read, False, borders)
            for kind, read in readers.items()
        ]
    if importlib.util.find_spec("pyulog"):
        data, borders = px4_log()
        cases += [
            Case(f"ulog {kind}", "x.ulg", data, read, False, borders)
            for kind, read in (("imu", read_imu), ("gnss", read_gnss), ("events", read_events))
        ]
    if importlib.util.find_spec("rosbags"):
        bag = Case("rosbag", "x.bag", rosbag(), read_imu, False, cuts=False)  # of packed chunks
        cases.append(bag)
    if importlib.util.find_spec("h5py"):
        cases.append(
            Case("matlab 7.3", "x.mat", _hdf5(table), lambda p: read_imu(p, columns=names), False)
        )
    return cases


def _hdf5(table: np.ndarray) -> bytes:
    import h5py

    stream = io.BytesIO()
    with h5py.File(stream, "w", userblock_size=512) as file:
        file["m"] = table.T
    return b"MATLAB 7.3 MAT-file".ljust(512) + stream.getvalue()[512:]


TOKENS = (
    b"nan",
    b"inf",
    b"-inf",
    b"1e308",
    b"-1e999",
    b"99999999999999999999999",
    b"",
    b"x",
    b"0",
    b"-",
    b"1e-320",
    b"1,5",
    b"\xff\xfe",
    b"\x00",
    b"1_0",
)
ODD = (float("nan"), float("inf"), -1e300, 1e18, -0.0, 5e-324)


def mutate(rng: np.random.Generator, case: Case) -> tuple[bytes, str]:
    """The case's file after one to four mutations, and what a reader must make of it.

    That is "cut" where all that was done is a cut within a row, else one of `fuzz_values` or "".
    """
    kind = rng.random()
    if kind < 0.1:
        size = int(rng.integers(1, len(case.data)))
        return case.data[:size], "" if case.looks_whole(size) else "cut"
    if case.text and kind < 0.65:
        return structured(rng, case)
    data = case.data
    kinds = (*BYTES, *LINES) if case.text else (*BYTES, odd_value)
    for _ in range(int(rng.integers(1, 5))):
        data = kinds[int(rng.integers(len(kinds)))](rng, data)[:LONGEST]
        if not data:
            break
    return data, ""


def flip(rng: np.random.Generator, data: bytes) -> bytes:
    """Some bytes changed."""
    out = bytearray(data)
    for place in rng.integers(0, len(data), int(rng.integers(1, 9))):
        out[place] = int(rng.integers(256))
    return bytes(out)


def drop(rng: np.random.Generator, data: bytes) -> bytes:
    """A piece taken out."""
    i = int(rng.integers(len(data)))
    return data[:i] + data[i + int(rng.integers(1, 200)) :]


def repeat(rng: np.random.Generator, data: bytes) -> bytes:
    """A piece, or all, doubled."""
    if rng.random() < 0.1:
        return data + data
    i = int(rng.integers(len(data)))
    k = i + int(rng.integers(1, 200))
    return data[:k] + data[i:]


def cut(rng: np.random.Generator, data: bytes) -> bytes:
    """The end taken away."""
    return data[: int(rng.integers(len(data) + 1))]


def noise(rng: np.random.Generator, data: bytes) -> bytes:
    """Random bytes put in."""
    i = int(rng.integers(len(data) + 1))
    return data[:i] + rng.bytes(int(rng.integers(1, 40))) + data[i:]


def blank(rng: np.random.Generator, data: bytes) -> bytes:
    """A piece of zeros, or of ones."""
    i, n = int(rng.integers(len(data))), int(rng.integers(1, 64))
    return (
        data[:i]
        + (b"\0" if rng.random() < 0.5 else b"\xff") * min(n, len(data) - i)
        + data[i + n :]
    )


def odd_value(rng: np.random.Generator, data: bytes) -> bytes:
    """Eight bytes of a double that should not be."""
    i = int(rng.integers(len(data) // 8 + 1)) * 8
    return data[:i] + struct.pack("<d", ODD[int(rng.integers(len(ODD)))]) + data[i + 8 :]


def swap_lines(rng: np.random.Generator, data: bytes) -> bytes:
    """Two lines change places."""
    lines = data.split(b"\n")
    i, k = (int(v) for v in rng.integers(0, len(lines), 2))
    lines[i], lines[k] = lines[k], lines[i]
    return b"\n".join(lines)


def double_line(rng: np.random.Generator, data: bytes) -> bytes:
    """A line that stands twice, near or far."""
    lines = data.split(b"\n")
    i = int(rng.integers(len(lines)))
    lines.insert(i + 1 if rng.random() < 0.7 else int(rng.integers(len(lines))), lines[i])
    return b"\n".join(lines)


def drop_line(rng: np.random.Generator, data: bytes) -> bytes:
    """A line taken out."""
    lines = data.split(b"\n")
    del lines[int(rng.integers(len(lines)))]
    return b"\n".join(lines)


def token(rng: np.random.Generator, data: bytes) -> bytes:
    """A field replaced by what does not belong there; NMEA checksums made right again, so that what
    is behind them is reached.
    """
    lines = data.split(b"\n")
    i = int(rng.integers(len(lines)))
    sign = next((s for s in (b"\t", b";", b",") if s in lines[i]), b" ")
    fields = lines[i].split(sign)
    fields[int(rng.integers(len(fields)))] = TOKENS[int(rng.integers(len(TOKENS)))]
    lines[i] = sign.join(fields)
    if lines[i].startswith(b"$"):
        lines[i] = (
            sentence(lines[i][1:].partition(b"*")[0].decode("latin-1"))
            .rstrip("\n")
            .encode("latin-1", "replace")
        )
    return b"\n".join(lines)


def digit(rng: np.random.Generator, data: bytes) -> bytes:
    """A digit changed."""
    places = [i for i, c in enumerate(data) if 48 <= c <= 57]
    if not places:
        return data
    i = places[int(rng.integers(len(places)))]
    return data[:i] + b"%d" % rng.integers(10) + data[i + 1 :]


def recode(rng: np.random.Generator, data: bytes) -> bytes:
    """Another encoding, other line ends, a byte order mark."""
    text = data.decode("latin-1")
    forms = (
        text.encode("utf-16"),
        text.encode("utf-8-sig"),
        data.replace(b"\n", b"\r\n"),
        data.replace(b"\n", b"\r"),
        data.replace(b",", b";"),
    )
    return forms[int(rng.integers(len(forms)))]


def lengthen(rng: np.random.Generator, data: bytes) -> bytes:
    """A run of one character or of one piece, up to a hundred thousand bytes long."""
    i = int(rng.integers(len(data)))
    piece = data[i : i + int(rng.choice([1, 1, 2, 5, 40]))]
    if rng.random() < 0.5:
        piece = LONG[int(rng.integers(len(LONG)))]
    return data[:i] + piece * (int(10 ** rng.uniform(1.0, 5.0)) // len(piece) + 1) + data[i:]


def many_lines(rng: np.random.Generator, data: bytes) -> bytes:
    """A line that stands a thousand times."""
    lines = data.split(b"\n")
    i = int(rng.integers(len(lines)))
    count = min(int(10 ** rng.uniform(1.0, 3.5)), LONGEST // (len(lines[i]) + 1) + 1)
    return b"\n".join([*lines[:i], *[lines[i]] * count, *lines[i:]])


def respell(rng: np.random.Generator, data: bytes) -> bytes:
    """Bytes that encodings, editors and str.splitlines see in different ways."""
    i = int(rng.integers(len(data) + 1))
    return data[:i] + SPELLED[int(rng.integers(len(SPELLED)))] + data[i:]


def nest(rng: np.random.Generator, data: bytes) -> bytes:
    """Brackets, tables or elements within each other, closed or not, at the begin of a value."""
    opened, closed = NESTED[int(rng.integers(len(NESTED)))]
    depth = int(10 ** rng.uniform(0.5, 4.3))
    places = [k + 1 for k, c in enumerate(data) if c in b"=:,>[\n"] or [0]
    i = places[int(rng.integers(len(places)))]
    end = closed * depth if rng.random() < 0.5 else b""
    return data[:i] + opened * depth + end + data[i:]


LONG = (
    b"1",
    b"9",
    b" ",
    b"\t",
    b",",
    b"a",
    b"(",
    b"[",
    b"1.",
    b"-",
    b"\x00",
    b"\n",
    b'"',
    b"e1",
    b"_",
)
SPELLED = (
    *(b"\x85", b"\xa0", b"\x0b", b"\x0c", b"\x1c", b"\x1e", b"\r", b"\x1a", b"\x7f"),
    *(
        b"\xe2\x80\xa8",
        b"\xe2\x80\x8b",
        b"\xef\xbb\xbf",
        b"\xed\xa0\x80",
        b"\xc0\x80",
        b"\xf4\x90\x80\x80",
    ),
    *(
        "\u0661\u0662".encode(),
        "\uff11".encode(),
        "\u00b2".encode(),
        "\u2212".encode(),
        b"1_0",
        b"0x1p3",
    ),
)
NESTED = (
    *((b"[", b"]"), (b"{", b"}"), (b'{"a":', b"}"), (b"{a=", b"}"), (b"(", b")"), (b"a.", b"")),
    *((b"<a>", b"</a>"), (b"[[", b"]]"), (b'"', b'"'), (b"<!--", b"-->")),
)
BYTES = (flip, drop, repeat, cut, noise, blank, respell, lengthen)
LINES = (
    *(swap_lines, double_line, drop_line, token, token, digit, digit, recode),
    *(respell, lengthen, many_lines, nest),
)


class Hang(BaseException):
    """The limit of time is over."""


def _over(signum: int, frame: FrameType | None) -> None:
    raise Hang


def judge(
    case: Case,
    path: Path,
    expected: str = "",
    base: list[object] | None = None,
    limit_s: int = LIMIT_S,
) -> tuple[str, str]:
    """Verdict (record, noted, refused, find) on the file at `path`, and the note on it.

    `base` holds the record of the file as it stands, and gets it where it is empty.
    """
    said, left = io.StringIO(), []
    sys.unraisablehook = lambda unraisable: left.append(str(unraisable.exc_value))
    signal.alarm(limit_s)
    try:
        with (
            warnings.catch_warnings(),
            contextlib.redirect_stdout(said),
            contextlib.redirect_stderr(said),
        ):
            warnings.simplefilter("error")
            verdict, why = _read(case, path, expected, [] if base is None else base)
    except Hang:
        return "find", f"more than {limit_s} s"
    finally:
        signal.alarm(0)
        sys.unraisablehook = sys.__unraisablehook__
    if said.getvalue() or left:
        return (
            "find",
            f"printed {said.getvalue()[:80]!r}" if said.getvalue() else f"left behind: {left[0]}",
        )
    return verdict, why


def _read(case: Case, path: Path, expected: str, base: list[object]) -> tuple[str, str]:
    try:
        record = case.read(path)
    except (InputError, UsageError, DataError) as error:
        text = str(error)
        return (
            ("find", f"message of {len(text.splitlines())} lines: {text!r}")
            if "\n" in text or not text
            else ("refused", text)
        )
    except MemoryError:
        return "find", f"more than {LIMIT_BYTES / 1e9:g} GB"
    except Exception as error:
        return "find", f"{type(error).__name__}: {error}"
    notes = getattr(record, "notes", ())
    if expected == "cut":
        return ("noted", "") if notes else ("find", "cut within a row and nothing said")
    if base and (why := contradiction(expected, record, base[0])):
        return "find", why
    base += [] if base else [record]
    return ("noted" if notes else "record"), ""


def all_cases() -> list[Case]:
    """Every reader's, always in the same order."""
    return [*text_cases(), *binary_cases(), *further_cases(), *static_cases()]


def fuzz(
    count: int,
    seed: int,
    first: int = 0,
    keep: Path | None = None,
    only: str = "",
    begun: Callable[[int], object] = lambda number: None,
) -> tuple[dict[str, Counter[str]], list[str]]:
    """Verdicts by case on `count` inputs from number `first` on, and the finds; their files are
    left in `keep`. `begun` gets each number before its file is read.
    """
    cases = [case for case in all_cases() if only in case.name]
    counts: dict[str, Counter[str]] = {case.name: Counter() for case in cases}
    finds: list[str] = []
    bases: list[list[object]] = [[] for _ in cases]
    before = signal.signal(signal.SIGALRM, _over)
    try:
        with tempfile.TemporaryDirectory(
            dir="/dev/shm" if Path("/dev/shm").is_dir() else None
        ) as folder:
            for number, case in enumerate(cases):
                directory = Path(folder) / str(number)
                directory.mkdir()
                for name, data in case.beside.items():
                    (directory / name).write_bytes(data)
                path = directory / case.file
                path.write_bytes(case.data)
                verdict, why = judge(case, path, base=bases[number], limit_s=COMPILED_S)
                bases[number] = bases[number] or [None]
                if verdict not in ("record", "noted") and case.name not in UNREAD:
                    finds.append(f"{case.name}, as it stands: {verdict} {why}")
            for k in range(first, first + count):
                number = k % len(cases)
                case = cases[number]
                data, expected = mutate(np.random.default_rng([seed, k]), case)
                path = Path(folder) / str(number) / case.file
                path.write_bytes(data)
                begun(k)
                faulthandler.dump_traceback_later(20 * LIMIT_S, exit=True)
                verdict, why = judge(case, path, expected, bases[number])
                faulthandler.cancel_dump_traceback_later()
                counts[case.name][verdict] += 1
                if verdict == "find":
                    finds.append(f"{k} {case.name}: {why}")
                    if keep is not None:
                        (keep / f"{k}_{case.file}").write_bytes(data)
    finally:
        signal.signal(signal.SIGALRM, before)
    return counts, finds


def work(options: argparse.Namespace, keep: Path) -> None:
    """One piece of the inputs in this process; its verdicts go to standard output as JSON."""
    size = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0]) * 4096
    resource.setrlimit(resource.RLIMIT_AS, (size + LIMIT_BYTES, resource.RLIM_INFINITY))
    progress = os.open(keep / f"begun_{options.first}", os.O_CREAT | os.O_RDWR)
    counts, finds = fuzz(
        options.count,
        options.seed,
        options.first,
        keep,
        options.format,
        lambda number: os.pwrite(progress, f"{number:12d}".encode(), 0),
    )
    json.dump({"counts": counts, "finds": finds}, sys.stdout)


def piece(first: int, count: int, options: argparse.Namespace, keep: Path) -> dict[str, object]:
    """Verdicts on some inputs by processes of their own: a new one behind each crash."""
    counts: dict[str, Counter[str]] = {}
    finds: list[str] = []
    end = first + count
    while first < end:
        command = [sys.executable, __file__, "--work", str(keep), "--seed", str(options.seed)]
        command += ["--first", str(first), "--count", str(end - first), "--format", options.format]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode == 0:
            result = json.loads(done.stdout)
            for name, verdicts in result["counts"].items():
                counts.setdefault(name, Counter()).update(verdicts)
            finds += result["finds"]
            break
        begun = keep / f"begun_{first}"
        text = begun.read_text(encoding="ascii") if begun.is_file() else ""
        number = int(text or first)  # ended before it began: from outside
        why = (done.stderr.strip().splitlines() or [""])[-1]
        finds.append(f"{number} the process ended with {done.returncode}: {why}")
        if number > first:  # what stood before the crash, once more
            before = piece(first, number - first, options, keep)
            for name, verdicts in before["counts"].items():  # type: ignore[attr-defined]
                counts.setdefault(name, Counter()).update(verdicts)
            finds += before["finds"]  # type: ignore[arg-type]
        first = number + 1
    return {"counts": counts, "finds": finds}


def run(options: argparse.Namespace, keep: Path) -> dict[str, dict[str, object]]:
    """Verdicts of all pieces by their first number; those of the state file are not run again."""
    state: dict[str, dict[str, object]] = {}
    head = {"seed": options.seed, "format": options.format, "piece": PIECE}
    if options.state is not None and options.state.is_file():
        content = json.loads(options.state.read_text(encoding="utf-8"))
        assert content["head"] == head, f"{options.state} is of {content['head']}"
        state = content["pieces"]
    numbers = range(options.first, options.first + options.count, PIECE)
    open_pieces = [number for number in numbers if str(number) not in state]
    end = options.first + options.count

    def one(number: int) -> tuple[int, dict[str, object]]:
        return number, piece(number, min(PIECE, end - number), options, keep)

    with ThreadPoolExecutor(options.workers) as pool:
        for number, result in pool.map(one, open_pieces):
            state[str(number)] = result
            if options.state is not None:
                text = json.dumps({"head": head, "pieces": state}, indent=1)
                options.state.write_text(text, encoding="utf-8")
    return state


def kind_of(find: str) -> str:
    """What kind of find it is: slow, memory or crashed."""
    why = find.partition(": ")[2]
    return (
        "slow"
        if why.endswith(" s") and why.startswith("more than")
        else ("memory" if why.startswith("more than") else "crashed")
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=1_000_000, help="inputs")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="number of the first input")
    parser.add_argument("--only", type=int, help="this one input")
    parser.add_argument("--format", default="", help="formats whose name holds this text")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="processes")
    parser.add_argument("--state", type=Path, help="JSON file of what is done, to go on from")
    parser.add_argument("--work", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    faulthandler.enable()
    if options.work is not None:
        work(options, options.work)
        return
    keep = Path(tempfile.mkdtemp(prefix="fuzz_"))
    start = time.monotonic()
    if options.only is not None:
        options.first, options.count = options.only, 1
    pieces = run(options, keep)
    total: dict[str, Counter[str]] = {}
    finds: list[str] = []
    for result in pieces.values():
        finds += result["finds"]  # type: ignore[arg-type]
        for name, verdicts in result["counts"].items():  # type: ignore[attr-defined]
            total.setdefault(name, Counter()).update(verdicts)
    finds = list(dict.fromkeys(finds))
    for find in finds:
        name = find.partition(": ")[0].partition(" ")[2]
        total.setdefault(name, Counter())[kind_of(find)] += 1
    columns = ("record", "noted", "refused", "crashed", "slow", "memory")
    print(f"{'format':22}" + "".join(f"{column:>9}" for column in columns))
    for name, verdicts in total.items():
        print(f"{name[:22]:22}" + "".join(f"{verdicts[column]:9}" for column in columns))
    count = sum(sum(verdicts[c] for c in (*columns[:3], "find")) for verdicts in total.values())
    print(
        f"{count} inputs, {time.monotonic() - start:.0f} s, {len(finds)} finds"
        + (f", their files in {keep}" if finds else "")
    )
    shown: Counter[str] = Counter()
    for find in finds:
        head, _, why = find.partition(": ")
        number, _, name = head.partition(" ")
        kind = f"{name} {why[:12]}"
        shown[kind] += 1
        if shown[kind] <= SHOWN:
            print(f"  {number} {name}: {why[:240]}")
    assert not finds, f"{len(finds)} finds"


UNREAD = ("block file", "compared odyn")
"""Cases whose file is refused as it stands: what it names is not there, or is no pose."""


if __name__ == "__main__":
    main()
