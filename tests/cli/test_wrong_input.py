"""What a user who gives wrong input gets from `insgnss process`: an exit code, one line that helps,
and nothing else.

One short simulated flight is copied and spoiled for each kind of wrong input. Whatever the kind,
the tree of files must be afterwards what it was before, byte by byte: no product, no left-over, no
input touched.
"""

import hashlib
import json
import os
import re
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from insgnss.cli import main
from insgnss.flight.processing.products import PRODUCTS
from insgnss.geodesy.earth import curvature_radii, normal_gravity
from insgnss.simulation.dataset import write_dataset

IMU = "01_Observations/IMU/Data/Pre_calibrated/f8_1_sob.csv"
GNSS = "02_Processed/GPS-PPK/AntennaPos_WGS84.txt"
EVENTS = "01_Observations/Camera/Data/Events.txt"
OUT = "02_Processed/GPS-INS"
USE, INPUT, DATA = 2, 3, 4
AXES = "recognised axes: forward right down"
TURNS = "turn rate, gyro against GNSS course"
EARTH_RATE = 7.292115e-5

NOISE = """\
name = "test"
[gyro]
turn_on_bias = "100 deg/h"
white_noise = "10 deg/h/sqrt(Hz)"
[accel]
turn_on_bias = "2 mg"
white_noise = "50 ug/sqrt(Hz)"
"""


@dataclass(frozen=True)
class DataSet:
    """A copy of the good data set, to be spoiled."""

    root: Path

    def path(self, name: str) -> Path:
        return self.root / name

    def toml(self, old: str, new: str) -> None:
        self.text("flight.toml", old, new)

    def text(self, name: str, old: str, new: str) -> None:
        content = self.path(name).read_text()
        assert content.count(old) == 1, old
        self.path(name).write_text(content.replace(old, new))

    def lines(self, name: str, edit: Callable[[list[str]], list[str]]) -> None:
        self.path(name).write_text("\n".join(edit(self.path(name).read_text().splitlines())) + "\n")

    def table(self, name: str, edit: Callable[[Any], Any]) -> None:
        """Edit the numbers of the IMU or the GNSS file; the header stays."""
        sign = "," if name == IMU else " "
        header, *_ = self.path(name).read_text().splitlines()
        values = np.loadtxt(self.path(name), delimiter=sign.strip() or None, skiprows=1)
        np.savetxt(
            self.path(name),
            edit(values),
            fmt="%.9f" if name == IMU else "%.10f",
            delimiter=sign,
            header=header,
            comments="",
        )

    def noise(self, old: str, new: str) -> None:
        """Use a noise-model file, `NOISE` with one change."""
        assert old in NOISE
        self.path("noise.toml").write_text(NOISE.replace(old, new, 1))
        self.toml('"navchip"', '"noise.toml"')


@pytest.fixture(scope="session")
def good(tmp_path_factory):
    """The data set that everything is copied from, and nobody writes to."""
    root = tmp_path_factory.mktemp("wrong_input") / "good"
    write_dataset(root, "ign8", 2.5, imu_rate=100.0, seed=11, start_in_air=True)
    return root


@pytest.fixture
def data(good, tmp_path):
    """A copy of the good data set without the truth."""
    shutil.copytree(good, tmp_path / "ign8", ignore=lambda _, names: {"truth", "GCPs"} & set(names))
    return DataSet(tmp_path / "ign8")


def _tree(root: Path) -> dict[str, str]:
    """Every file below `root` and its content's hash, every directory with none."""
    return {
        str(p.relative_to(root)): hashlib.sha256(p.read_bytes()).hexdigest() if p.is_file() else ""
        for p in sorted(root.rglob("*"))
    }


def _refused(
    capsys: pytest.CaptureFixture[str],
    root: Path,
    code: int,
    words: tuple[str, ...],
    *arguments: str,
) -> None:
    """Process the data set at `root` and check everything that an error must and must not do."""
    before = _tree(root)
    assert main(["process", str(root), "--quiet", *arguments]) == code
    streams = capsys.readouterr()
    assert streams.out == ""
    line = streams.err.replace(str(root) + os.sep, "").replace(str(root), "")
    assert line.startswith("insgnss: error: ")
    assert line.endswith("\n")
    assert line.count("\n") == 1
    assert len(line) < 800
    missing = [word for word in words if word not in line]
    assert not missing, f"{missing} not in {line}"
    assert _tree(root) == before


Edit = Callable[[DataSet], object]


def _toml(old: str, new: str) -> Edit:
    return lambda d: d.toml(old, new)


def _imu_field(field: int, text: str) -> Edit:
    """Write `text` into one field of line 501 of the IMU file."""

    def edit(lines: list[str]) -> list[str]:
        fields = lines[500].split(",")
        fields[field] = text
        return [*lines[:500], ",".join(fields), *lines[501:]]

    return lambda d: d.lines(IMU, edit)


def _columns(name: str, which: Any, change: Callable[[Any], Any]) -> Edit:
    """Change columns of the IMU or the GNSS file."""

    def edit(values: Any) -> Any:
        values[:, which] = change(values[:, which])
        return values

    return lambda d: d.table(name, edit)


def _rows(name: str, keep: Callable[[Any], Any]) -> Edit:
    """Keep some rows of the IMU or the GNSS file, chosen by the seconds since the first."""
    return lambda d: d.table(name, lambda values: values[keep(values[:, 0] - values[0, 0])])


def _events(change: Callable[[list[str]], list[str]]) -> Edit:
    """Change the lines of the events, the header left in its place."""
    return lambda d: d.lines(EVENTS, lambda lines: [lines[0], *change(lines[1:])])


def _event_times(shift: Callable[[float], float]) -> Edit:
    return _events(
        lambda lines: [f"{name} {shift(float(tow)):.7f}" for name, tow in map(str.split, lines)]
    )


def _noise(old: str, new: str) -> Edit:
    return lambda d: d.noise(old, new)


def _cut(name: str, size: int) -> Edit:
    return lambda d: d.path(name).write_bytes(d.path(name).read_bytes()[:size])


def _write(name: str, content: bytes) -> Edit:
    return lambda d: d.path(name).write_bytes(content)


def _append(name: str, content: bytes) -> Edit:
    return lambda d: d.path(name).write_bytes(d.path(name).read_bytes() + content)


def _all(*edits: Edit) -> Edit:
    return lambda d: [edit(d) for edit in edits]


def _steady(speed: float) -> Edit:
    """Level northward motion of constant speed: no manoeuvre that tells the heading."""

    def edit(d: DataSet) -> None:
        rng, lat = np.random.default_rng(1), np.radians(46.57)
        still = [
            EARTH_RATE * np.cos(lat),
            0.0,
            -EARTH_RATE * np.sin(lat),
            0.0,
            0.0,
            -float(normal_gravity(lat, 650.0)),
        ]
        noise = [5e-4] * 3 + [5e-3] * 3
        d.table(IMU, lambda a: np.column_stack([a[:, 0], rng.normal(still, noise, (len(a), 6))]))
        M, N = curvature_radii(lat)

        def fixes(a: Any) -> Any:
            error = rng.normal(0.0, 0.02, (len(a), 3))
            a[:, 1] = 46.57 + np.degrees((speed * (a[:, 0] - a[0, 0]) + error[:, 0]) / M)
            a[:, 2] = 6.54 + np.degrees(error[:, 1] / N / np.cos(lat))
            a[:, 3] = 650.0 + error[:, 2]
            return a

        d.table(GNSS, fixes)

    return edit


def _no_plane(d: DataSet) -> None:
    d.lines(
        "flight.toml",
        lambda lines: [
            line for line in lines if not line.startswith(("[tangent_plane]", "origin"))
        ],
    )


def _exchanged(d: DataSet) -> None:
    """Longitude where the latitude belongs."""
    d.table(GNSS, lambda a: a[:, [0, 2, 1, 3, 4, 5, 6]])


BINARY = np.random.default_rng(0).bytes(20000)
RADIANS = _columns(GNSS, [1, 2], np.radians)
UNITS = '{ gyro = "rad/s", accel = "m/s^2" }'

FLIGHT_FILE: dict[str, tuple[Edit, int, tuple[str, ...]]] = {
    "is missing": (
        lambda d: d.path("flight.toml").unlink(),
        INPUT,
        ("flight.toml: does not exist",),
    ),
    "is empty": (_write("flight.toml", b""), INPUT, ("flight.toml", "imu.file", "missing")),
    "is no TOML": (_toml("[imu]", "[imu"), INPUT, ("flight.toml:4: not TOML",)),
    "is binary": (_write("flight.toml", b"\xff\xfe\x00\x01"), INPUT, ("is not UTF-8",)),
    "unknown key": (
        _toml("quantity =", "quantitty ="),
        INPUT,
        ("flight.toml:7: imu.quantitty: unknown key", "'quantity'"),
    ),
    "unknown table": (
        _toml("[camera]", "[kamera]"),
        INPUT,
        ("flight.toml:16: kamera: unknown", "'camera'"),
    ),
    "wrong type": (
        _toml("= 2008", '= "2008"'),
        INPUT,
        ("flight.toml:2: gps_week = '2008'", "must be a whole number"),
    ),
    "no week anywhere": (
        _toml("gps_week = 2008\n", ""),
        INPUT,
        ("no file gives the GPS week", "give gps_week"),
    ),
    "axes, no such word": (
        _toml("forward right", "forward rihgt"),
        INPUT,
        ("flight.toml:8: imu.axes = 'forward rihgt down': 'rihgt'", "'right'"),
    ),
    "axes, left-handed": (
        _toml("forward right", "forward left"),
        INPUT,
        ("imu.axes = 'forward left down': left-handed", "'forward left up'"),
    ),
    "axes, one line twice": (
        _toml("forward right", "forward backward"),
        INPUT,
        ("imu.axes = 'forward backward down': two directions lie along one line",),
    ),
    "file is a directory": (
        _toml(IMU, "01_Observations"),
        INPUT,
        ("flight.toml:5: imu.file", "is a directory"),
    ),
    "unit of increments for rates": (
        _toml('gyro = "rad/s"', 'gyro = "rad"'),
        INPUT,
        ("imu.units.gyro", "use rad/s, deg/s, mdeg/s, deg/h"),
    ),
    "unit of the other sensor": (
        _toml('gyro = "rad/s"', 'gyro = "g"'),
        INPUT,
        ("imu.units.gyro", "belongs to the other sensor"),
    ),
    "bore-sight, no rotation": (
        _toml("[[0.99990", "[[0.95990"),
        INPUT,
        ("flight.toml:24: mounting.boresight: no rotation", "digits"),
    ),
    "bore-sight, mirrored": (
        _toml("[[0.99990", "[[-0.99990"),
        INPUT,
        ("mounting.boresight: no rotation, its determinant is -1",),
    ),
    "bore-sight, two rows": (
        lambda d: d.lines(
            "flight.toml",
            lambda x: [
                re.sub(r", \[[^[]*\]\]$", "]", s) if s.startswith("boresight") else s for s in x
            ],
        ),
        INPUT,
        ("flight.toml:24: mounting.boresight", "must be 3 rows"),
    ),
    "mounting, determinant 0": (
        _toml("[0.0, 0.0, 1.0]]", "[0.0, 0.0, 0.0]]"),
        INPUT,
        ("mounting.camera_from_body: no rotation",),
    ),
    "lever arm in mm": (
        _toml("[0.462, -0.001, -0.065]", "[462, -1, -65]"),
        INPUT,
        ("mounting.antenna_m", "467 m long", "unit is m"),
    ),
    "origin exchanged": (
        _toml("[46.57, 6.54,", "[6.54, 46.57,"),
        INPUT,
        ("latitude and longitude look exchanged", "tangent_plane.origin"),
    ),
    "origin is no number": (
        _toml("[46.57,", "[nan,"),
        INPUT,
        ("tangent_plane.origin", "must be latitude, longitude (deg), ellipsoidal height (m)"),
    ),
    "sigma zero": (
        _toml("[gnss]", "[gnss]\nsigma_m = [0.02, 0.0, 0.03]"),
        INPUT,
        ("gnss.sigma_m", "greater than zero"),
    ),
    "sigma negative": (
        _toml("[gnss]", "[gnss]\nsigma_m = [0.02, -0.02, 0.03]"),
        INPUT,
        ("gnss.sigma_m", "greater than zero"),
    ),
    "gate negative": (
        _toml("[gnss]", "[gnss]\ngate_sigma = -5"),
        INPUT,
        ("flight.toml:12: gnss.gate_sigma = -5: must be 2 to 30",),
    ),
    "gate without end": (
        _toml("[gnss]", "[gnss]\ngate_sigma = 1e9"),
        INPUT,
        ("gnss.gate_sigma", "must be 2 to 30"),
    ),
    "option of another format": (
        _toml("[gnss]", '[gnss]\nvariable = "tow"'),
        INPUT,
        ("gnss_text, which takes no variable", "columns"),
    ),
    "unknown check accepted": (
        _toml("[imu]", 'accept = ["specfic force"]\n[imu]'),
        INPUT,
        ("accept", "'specific force'"),
    ),
    "unknown output format": (
        _toml('"metashape"]', '"metashap"]'),
        INPUT,
        (
            "flight.toml:31: output.formats = ['eo_local_plane', 'metashap']: 'metashap'",
            "'metashape'",
        ),
    ),
    "output rate zero": (
        _toml("[output]", "[output]\ntrajectory_hz = 0"),
        INPUT,
        ("output.trajectory_hz = 0: must be 0.001",),
    ),
    "start after the end": (
        _toml("[imu]", "start_tow = 300000\n[imu]"),
        INPUT,
        ("no image between start_tow and end_tow",),
    ),
    "initial attitude in part": (
        _toml("[output]", "[initial]\nroll_deg = 0\n[output]"),
        INPUT,
        ("initial.pitch_deg: is missing",),
    ),
    "noise model unknown": (
        _toml('"navchip"', '"navchp"'),
        INPUT,
        ("imu.noise: 'navchp'", "shipped", "navchip"),
    ),
    "noise of another dimension": (
        _noise("10 deg/h/sqrt(Hz)", "10 deg/h"),
        INPUT,
        ("noise.toml:4: gyro.white_noise", "dimension"),
    ),
    "noise of the other sensor": (
        _noise("50 ug/sqrt(Hz)", "10 deg/h/sqrt(Hz)"),
        INPUT,
        ("noise.toml:7: accel.white_noise", "ug/sqrt(Hz)"),
    ),
    "noise without unit": (
        _noise("10 deg/h/sqrt(Hz)", "10"),
        INPUT,
        ("gyro.white_noise: '10' has no unit", "deg/h/sqrt(Hz)"),
    ),
    "noise as a number": (
        _noise('"10 deg/h/sqrt(Hz)"', "10"),
        INPUT,
        ("gyro.white_noise: 10 has no unit",),
    ),
    "noise of an unknown unit": (
        _noise("10 deg/h", "10 dog/h"),
        INPUT,
        ("unknown unit 'dog'", "'deg'"),
    ),
    "noise negative": (_noise("10 deg", "-10 deg"), INPUT, ("gyro.white_noise", "negative")),
    "noise, unknown key": (
        _noise("white_noise", "wite_noise"),
        INPUT,
        ("noise.toml:4: gyro.wite_noise: unknown key", "'white_noise'"),
    ),
    "noise file no TOML": (_noise("[gyro]", "[gyro"), INPUT, ("noise.toml:2: not TOML",)),
    "noise without end": (
        _noise("10 deg", "1e9 deg"),
        DATA,
        ("heading not observable", "noise model"),
    ),
}

FILES: dict[str, tuple[Edit, int, tuple[str, ...]]] = {
    "IMU missing": (
        lambda d: d.path(IMU).unlink(),
        INPUT,
        ("flight.toml:5: imu.file", IMU, "does not exist"),
    ),
    "IMU empty": (_write(IMU, b""), INPUT, (IMU, "is empty", "copy")),
    "IMU header only": (
        lambda d: d.lines(IMU, lambda x: x[:1]),
        INPUT,
        (IMU, "holds no data line"),
    ),
    "IMU cut in mid-line": (
        _cut(IMU, -40),
        INPUT,
        (f"{IMU}:15001: truncated: the file ends within this line", "copy it again"),
    ),
    "IMU cut in mid-number": (
        _cut(IMU, -4),
        INPUT,
        (f"{IMU}:15001: truncated: the file ends within a number", "copy it again"),
    ),
    "IMU text": (
        _imu_field(3, "0.01x"),
        INPUT,
        (f"{IMU}:501: '0.01x' in field 4", "finite number"),
    ),
    "IMU NaN": (_imu_field(3, "nan"), INPUT, (f"{IMU}:501: 'nan' in field 4", "finite number")),
    "IMU infinite": (
        _imu_field(6, "-inf"),
        INPUT,
        (f"{IMU}:501: '-inf' in field 7", "finite number"),
    ),
    "IMU spike": (_imu_field(3, "1e6"), INPUT, ("gyro 1e+06 rad/s at 205205.000 s", "spikes")),
    "IMU spike of force": (
        _imu_field(5, "1e5"),
        INPUT,
        ("accelerometer 1e+05 m/s^2 at 205205.000 s", "spikes"),
    ),
    "IMU time backwards": (
        _imu_field(0, "205200.0"),
        INPUT,
        (f"{IMU}:501: time 205200.000000 s follows 205204.99", "must increase"),
    ),
    "IMU six columns": (
        lambda d: d.lines(IMU, lambda x: [s.rpartition(",")[0] for s in x]),
        INPUT,
        (f"{IMU}:1:", "does not name az"),
    ),
    "IMU six fields in a line": (
        lambda d: d.lines(IMU, lambda x: [*x[:700], x[700].rpartition(",")[0], *x[701:]]),
        INPUT,
        (f"{IMU}:701: 6 fields, expected 7",),
    ),
    "IMU six columns declared": (
        _toml("[imu]", '[imu]\ncolumns = ["tow", "gx", "gy", "gz", "ax", "ay"]'),
        INPUT,
        (IMU, "7 fields, but columns names 6"),
    ),
    "IMU decimal commas between commas": (
        lambda d: d.lines(IMU, lambda x: [x[0], *(s.replace(".", ",") for s in x[1:])]),
        INPUT,
        (IMU, "14 fields", "decimal commas"),
    ),
    "IMU bytes": (_write(IMU, BINARY), INPUT, (IMU, "binary")),
    "IMU zero bytes": (_write(IMU, bytes(20000)), INPUT, (IMU, "binary")),
    "IMU zero bytes within": (
        _imu_field(4, "\0" * 50),
        INPUT,
        (f"{IMU}:501:", "binary", "damaged"),
    ),
    "IMU zero bytes at the end": (
        _append(IMU, bytes(4096)),
        INPUT,
        (f"{IMU}:15002:", "binary", "damaged"),
    ),
    "IMU is the GNSS file": (_toml(IMU, GNSS), INPUT, (f"{GNSS}:1:", "does not name gx")),
    "IMU time in ms": (
        _columns(IMU, 0, lambda t: 1e3 * t),
        INPUT,
        (f"{IMU}:2: time 205200010.000 s is no GPS time of week",),
    ),
    "IMU time from zero": (
        _columns(IMU, 0, lambda t: t - t[0]),
        INPUT,
        ("recognised clock", "add -205200.0"),
    ),
    "IMU time in bunches of an uneven clock": (
        _columns(IMU, 0, lambda t: np.round(t + 0.4 * np.sin(t), 1) + 1e-6 * np.arange(t.size)),
        INPUT,
        ("stamps come in bunches",),
    ),
    "IMU clock set back, and exposures of it": (
        _all(
            _columns(IMU, 0, lambda t: t + 0.37 * (t < t[0] + 60.0)),
            _toml("[camera]", '[camera]\nclock = "imu"'),
        ),
        INPUT,
        (
            "clock step",
            "set during the recording, once, by -0.370 s",
            "add the step of the IMU's clock",
        ),
    ),
    "IMU clock set ahead": (
        _columns(IMU, 0, lambda t: t + 12.3 * (t > t[0] + 60.0)),
        INPUT,
        ("recognised clock", "clock was set by +12.300 s", "add -12.300 s to the stamps after"),
    ),
    "IMU shorter than ten seconds": (
        _rows(IMU, lambda t: (t >= 50) & (t < 58)),
        DATA,
        ("over 7.9 s in common (limit 10 s)",),
    ),
    "GNSS missing": (lambda d: d.path(GNSS).unlink(), INPUT, ("gnss.file", "does not exist")),
    "GNSS bytes": (_write(GNSS, BINARY), INPUT, (GNSS, "binary")),
    "GNSS header only": (
        lambda d: d.lines(GNSS, lambda x: x[:1]),
        INPUT,
        (GNSS, "holds no data line"),
    ),
    "GNSS cut in mid-line": (_cut(GNSS, -25), INPUT, (f"{GNSS}:1502: truncated",)),
    "GNSS NaN": (
        _columns(GNSS, 2, lambda x: np.where(np.arange(x.size) == 300, np.nan, x)),
        INPUT,
        (f"{GNSS}:302: 'nan' in field 3",),
    ),
    "GNSS time backwards": (
        lambda d: d.lines(GNSS, lambda x: [*x[:300], x[310], *x[300:]]),
        INPUT,
        (f"{GNSS}:302: time", "must increase"),
    ),
    "GNSS sigma zero": (
        _columns(GNSS, 4, lambda x: 0.0 * x),
        INPUT,
        (f"{GNSS}:2: standard deviation sd_n is 0", "positive"),
    ),
    "GNSS sigma negative": (
        _columns(GNSS, 6, np.negative),
        INPUT,
        (f"{GNSS}:2: standard deviation sd_u is -0.03", "positive"),
    ),
    "GNSS no sigma": (
        lambda d: d.lines(
            GNSS,
            lambda x: [
                "# tow[s] lat[deg] lon[deg] h[m]",
                *(" ".join(s.split()[:4]) for s in x[1:]),
            ],
        ),
        INPUT,
        (GNSS, "no standard deviations", "sigma_m = [north, east, down]"),
    ),
    "GNSS latitude over 90": (
        _columns(GNSS, 1, lambda x: x + 50.0),
        INPUT,
        (f"{GNSS}:2: lat 96.", "exceeds 90"),
    ),
    "GNSS degrees called radians": (
        _toml("[gnss]", '[gnss]\nunits = { angle = "rad" }'),
        INPUT,
        (f"{GNSS}:2: lat", "exceeds 90", "unit"),
    ),
    "GNSS of another week": (
        lambda d: d.lines(
            GNSS, lambda x: ["# week " + x[0].lstrip("# "), *(f"2009 {s}" for s in x[1:])]
        ),
        INPUT,
        (f"{GNSS}:2: the times are of GPS week 2009, but gps_week is 2008", "correct gps_week"),
    ),
    "GNSS of another day": (
        _columns(GNSS, 0, lambda t: t + 86400.0),
        INPUT,
        ("recognised clock", "add -86400.00"),
    ),
    "GNSS two fixes": (
        _rows(GNSS, lambda t: (t == 1.0) | (t == 140.0)),
        DATA,
        ("no initial attitude", "too few fixes"),
    ),
    "GNSS one fix": (
        _rows(GNSS, lambda t: t == 1.0),
        DATA,
        ("1 fix over 0.0 s in common (limit 10 s)",),
    ),
    "events missing": (
        lambda d: d.path(EVENTS).unlink(),
        INPUT,
        ("camera.events", "does not exist"),
    ),
    "events empty": (_write(EVENTS, b""), INPUT, ("flight.toml:17: camera.events", "is empty")),
    "events header only": (_events(lambda x: []), INPUT, (EVENTS, "holds no data line")),
    "events bytes": (_write(EVENTS, BINARY), INPUT, (EVENTS, "binary")),
    "events NaN": (
        _events(lambda x: [*x[:3], "8004.tif nan", *x[4:]]),
        INPUT,
        (f"{EVENTS}:5: 'nan'",),
    ),
    "events unsorted": (
        _events(lambda x: [*x[:3], x[4], x[3], *x[5:]]),
        INPUT,
        (f"{EVENTS}:6: time", "must increase"),
    ),
    "events, image twice": (
        _events(lambda x: [*x[:3], "8003.tif " + x[3].split()[1], *x[4:]]),
        INPUT,
        (f"{EVENTS}:5: image 8003.tif occurs twice, first in line 4",),
    ),
    "events in ms": (
        _event_times(lambda t: 1e3 * t),
        INPUT,
        (f"{EVENTS}:2: time", "no GPS time of week"),
    ),
    "events of another day": (
        _event_times(lambda t: t + 86400.0),
        INPUT,
        ("image 8001.tif at", "outside the flight", "25 of 25 images"),
    ),
    "events in UTC": (
        _event_times(lambda t: t - 18.0),
        INPUT,
        ("camera events", "look like UTC", "camera.time_offset_s = 18"),
    ),
    "one event too late": (
        _events(lambda x: [*x, "9999.tif 205450.0"]),
        INPUT,
        ("image 9999.tif at 205450.000 s is outside the flight", "1 of 26 images"),
    ),
}

MEANING: dict[str, tuple[Edit, int, tuple[str, ...]]] = {
    "axes turned by 90": (
        _toml("forward right down", "right backward down"),
        INPUT,
        (AXES, "right backward down"),
    ),
    "axes turned by -90": (
        _toml("forward right down", "left forward down"),
        INPUT,
        (AXES, "left forward down"),
    ),
    "axes turned by 180": (
        _toml("forward right down", "backward left down"),
        INPUT,
        (AXES, "backward left down"),
    ),
    "axes upside down": (
        _toml("forward right down", "forward left up"),
        INPUT,
        ("axes, vertical", "the IMU's z axis points down", "'up'"),
    ),
    "axes on end": (
        _toml("forward right down", "right down forward"),
        INPUT,
        ("the IMU's z axis points down", "'forward'"),
    ),
    "deg/s called rad/s": (
        _columns(IMU, [1, 2, 3], np.degrees),
        INPUT,
        (TURNS, 'look like imu.units gyro = "deg/s"'),
    ),
    "rad/s called deg/s": (
        _toml('gyro = "rad/s"', 'gyro = "deg/s"'),
        INPUT,
        (TURNS, 'look like imu.units gyro = "rad/s"'),
    ),
    "rad/s called deg/h": (
        _toml('gyro = "rad/s"', 'gyro = "deg/h"'),
        INPUT,
        (TURNS, 'look like imu.units gyro = "rad/s"'),
    ),
    "g called m/s^2": (
        _columns(IMU, [4, 5, 6], lambda f: f / 9.80665),
        INPUT,
        ("specific force", 'look like imu.units accel = "g"'),
    ),
    "mg called m/s^2": (
        _columns(IMU, [4, 5, 6], lambda f: f / 9.80665e-3),
        INPUT,
        ("specific force", 'look like imu.units accel = "mg"'),
    ),
    "m/s^2 called g": (
        _toml('accel = "m/s^2"', 'accel = "g"'),
        INPUT,
        ("specific force", 'look like imu.units accel = "m/s^2"'),
    ),
    "m/s^2 called mg": (
        _toml('accel = "m/s^2"', 'accel = "mg"'),
        INPUT,
        ("specific force", 'accel = "m/s^2"'),
    ),
    "increments called mean_rate": (
        _all(
            _columns(IMU, slice(1, 7), lambda x: 0.01 * x),
            lambda d: d.lines(IMU, lambda x: ["tow,gx,gy,gz,ax,ay,az", *x[1:]]),
        ),
        INPUT,
        ("specific force", 'imu.quantity = "increments"'),
    ),
    "mean_rate called increments": (
        _all(_toml('"mean_rate"', '"increments"'), _toml(UNITS, '{ gyro = "rad", accel = "m/s" }')),
        INPUT,
        ("specific force", 'imu.quantity = "mean_rate"'),
    ),
    "gyro and accelerometer exchanged": (
        lambda d: d.table(IMU, lambda a: a[:, [0, 4, 5, 6, 1, 2, 3]]),
        INPUT,
        ("specific force", "look exchanged", "imu.columns"),
    ),
    "gyro sign": (
        _columns(IMU, [1, 2, 3], np.negative),
        INPUT,
        (TURNS, "turn the other way", "gyro sign", "sign of latitude or longitude is wrong"),
    ),
    "gyro channel dead": (
        _columns(IMU, 2, lambda x: 0.0 * x),
        INPUT,
        ("silent sensor", "gyro y stays at 0", "dead"),
    ),
    "gyro channel dies": (
        _columns(IMU, 2, lambda x: np.where(np.arange(x.size) > 9000, x[9000], x)),
        INPUT,
        ("gyro y stays at", "for 60.0 s from 205290.0"),
    ),
    "accelerometer channel dead": (
        _columns(IMU, 4, lambda x: 0.0 * x + 0.3),
        INPUT,
        ("accelerometer x stays at 0.3", "dead"),
    ),
    "accelerometer dead": (
        _columns(IMU, [4, 5, 6], lambda x: 0.0 * x),
        INPUT,
        ("accelerometer x stays at 0", "accelerometer z"),
    ),
    "IMU dead": (
        _columns(IMU, slice(1, 7), lambda x: 0.0 * x),
        INPUT,
        ("accelerometer x stays at 0", "likewise", "dead"),
    ),
    "latitude and longitude exchanged": (
        _exchanged,
        INPUT,
        ("latitude and longitude look exchanged", "gnss.columns"),
    ),
    "the same without tangent plane": (
        _all(_exchanged, _no_plane),
        INPUT,
        ("latitude and longitude are exchanged",),
    ),
    "radians called degrees": (RADIANS, INPUT, ("GNSS position", 'gnss.units = { angle = "rad" }')),
    "radians without tangent plane": (
        _all(RADIANS, _no_plane),
        INPUT,
        ("GNSS position", 'gnss.units = { angle = "rad" }'),
    ),
    "positions all zero": (
        _all(_columns(GNSS, [1, 2, 3], lambda x: 0.0 * x), _no_plane),
        INPUT,
        ("GNSS position", "zeros"),
    ),
    "position frozen": (
        _columns(GNSS, [1, 2, 3], lambda x: 0.0 * x + x[0]),
        INPUT,
        ("latitude and longitude and height the same in all",),
    ),
    "heights zero": (
        _columns(GNSS, 3, lambda x: 0.0 * x),
        INPUT,
        ("GNSS position", "height the same in all 1501 fixes"),
    ),
    "heights in mm": (
        _columns(GNSS, 3, lambda x: 1e3 * x),
        INPUT,
        ("GNSS position", "unit of the heights, which is m"),
    ),
    "GNSS in UTC": (
        _columns(GNSS, 0, lambda t: t - 18.0),
        INPUT,
        (TURNS, "GPS against UTC (18 s)", "add +18.0 s to gnss.time_offset_s"),
    ),
    "IMU in UTC": (
        _columns(IMU, 0, lambda t: t - 18.0),
        INPUT,
        (TURNS, "GPS against UTC (18 s)", "s to imu.time_offset_s"),
    ),
    "GNSS a second off": (
        _columns(GNSS, 0, lambda t: t - 1.0),
        INPUT,
        ("recognised clock: +1.0", "gnss.time_offset_s"),
    ),
    "GNSS 50 ms off": (
        _columns(GNSS, 0, lambda t: t - 0.05),
        INPUT,
        ("GNSS time offset", "too early by 0.05"),
    ),
    "lever arm wrong by 1 m": (
        _toml("[0.462, -0.001, -0.065]", "[1.462, -0.001, -0.065]"),
        INPUT,
        (
            "antenna lever arm: the vector from the IMU to the antenna is off by forward +",
            "mounting.antenna_m = [0.4",
        ),
    ),
    "lever arm wrong by 5 m": (
        _toml("[0.462, -0.001, -0.065]", "[5.462, -0.001, -0.065]"),
        INPUT,
        ("antenna lever arm", "mounting.antenna_m = [0."),
    ),
    "standing still": (_steady(0.0), DATA, ("heading not observable", "manoeuvre", "[initial]")),
    "straight flight": (_steady(15.0), DATA, ("heading not observable", "manoeuvre", "[initial]")),
    "initial heading wrong": (
        _toml("[output]", "[initial]\nroll_deg = 0\npitch_deg = 0\nheading_deg = 180\n[output]"),
        DATA,
        ("GNSS fixes rejected", "contradict"),
    ),
}
SLOW = {
    "initial heading wrong",
    "lever arm wrong by 5 m",
    "GNSS 50 ms off",
    "lever arm wrong by 1 m",
    "the same without tangent plane",
}  # solve the whole flight, some twice


@pytest.mark.parametrize("kind", FLIGHT_FILE)
def test_a_wrong_flight_file_is_refused_and_nothing_is_left(kind, data, capsys):
    """Oracle: the contract of the command line: exit code, one line with what is wrong and what to
    do; the tree of files as it was.
    """
    edit, code, words = FLIGHT_FILE[kind]
    edit(data)
    _refused(capsys, data.root, code, words)


@pytest.mark.parametrize("kind", FILES)
def test_a_wrong_file_is_refused_and_nothing_is_left(kind, data, capsys):
    """Oracle: the contract of the command line: exit code, one line with what is wrong and what to
    do; the tree of files as it was.
    """
    edit, code, words = FILES[kind]
    edit(data)
    _refused(capsys, data.root, code, words)


@pytest.mark.parametrize(
    "kind",
    [pytest.param(kind, marks=pytest.mark.slow) if kind in SLOW else kind for kind in MEANING],
)
def test_files_that_contradict_each_other_are_refused_and_nothing_is_left(kind, data, capsys):
    """Oracle: the contract of the command line, and the change that was made, which the line must
    name.
    """
    edit, code, words = MEANING[kind]
    edit(data)
    _refused(capsys, data.root, code, words)


def test_an_output_directory_that_cannot_be_is_refused_before_anything_runs(data, capsys):
    """Oracle: the contract; named by the command: wrong use; by the flight file: bad input."""
    data.path("02_Processed/file").write_text("mine")
    for out in ("file", "file/below"):
        _refused(
            capsys,
            data.root,
            USE,
            ("--out", "is a file, a directory is expected"),
            "--out",
            str(data.path("02_Processed") / out),
        )
    data.toml(f'"{OUT}"', '"02_Processed/file/below"')
    _refused(capsys, data.root, INPUT, ("output.directory", "is a file, a directory is expected"))
    data.toml('"02_Processed/file/below"', '"02_Processed/file"')
    _refused(
        capsys,
        data.root,
        INPUT,
        ("flight.toml:30: output.directory", "is a file, a directory is expected"),
    )


def test_an_output_directory_without_permission_is_refused(data, capsys, tmp_path, monkeypatch):
    """Oracle: the contract; the operating system says no (its answer is made up, since root may
    write everywhere).
    """

    def refuse(prefix: str, dir: Path) -> str:
        raise PermissionError(13, "Permission denied", str(dir))

    monkeypatch.setattr("insgnss.base.output.scratch.tempfile.mkdtemp", refuse)
    _refused(
        capsys,
        data.root,
        USE,
        ("--out: cannot write in", "Permission denied", "permissions"),
        "--out",
        str(tmp_path / "locked"),
    )
    _refused(capsys, data.root, INPUT, ("output.directory: cannot write in", "Permission denied"))


@pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="a directory that nobody can write to")
def test_a_read_only_file_system_is_refused(data, capsys):
    """Oracle: the kernel, which lets nobody create anything in /proc."""
    _refused(
        capsys, data.root, USE, ("--out: cannot write in /proc",), "--out", "/proc/insgnss/products"
    )


def test_a_product_never_takes_the_place_of_an_input(data, capsys):
    """Oracle: design 6, inputs are never touched: here one has a product's name in the output
    directory.
    """
    data.path(OUT).mkdir()
    data.path(IMU).rename(data.path(OUT) / "trajectory.csv")
    data.toml(IMU, f"{OUT}/trajectory.csv")
    _refused(
        capsys, data.root, INPUT, ("output.directory", "trajectory.csv would overwrite the input")
    )


def test_a_directory_in_the_place_of_a_product_is_refused(data, capsys):
    """Oracle: design 6, all products or none."""
    (data.path(OUT) / "report.json").mkdir(parents=True)
    _refused(capsys, data.root, INPUT, ("report.json is a directory",))


@pytest.mark.slow
def test_a_full_disk_leaves_nothing(data, capsys, monkeypatch):
    """Oracle: design 6, all products or none; the last file finds no space."""

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device", "report.json")

    monkeypatch.setattr("insgnss.flight.processing.products.write_report_json", full)
    _refused(capsys, data.root, 2, ("No space left on device", "free space"))


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["process"], "FLIGHT"),
        (["proces", "x"], "proces"),
        (["process", "x", "--outt", "y"], "--outt"),
        ([], "VERB"),
    ],
)
def test_wrong_use_says_how(arguments, word, capsys):
    """Oracle: the contract of the command line, exit code 2."""
    assert main(arguments) == USE
    streams = capsys.readouterr()
    assert streams.err.startswith("insgnss: error: ")
    assert streams.err.count("\n") == 1
    assert word in streams.err
    assert streams.out == ""


def _processed(capsys: pytest.CaptureFixture[str], data: DataSet) -> dict[str, Any]:
    """Process, which must work without a word on standard error; the report."""
    assert main(["process", str(data.root), "--json"]) == 0
    streams = capsys.readouterr()
    assert streams.err == ""
    return json.loads(streams.out)


@pytest.mark.parametrize(
    "edit",
    [
        pytest.param(
            lambda d: d.lines(IMU, lambda x: [s.replace(",", ";").replace(".", ",") for s in x]),
            id="decimal commas",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            lambda d: d.path(IMU).write_bytes(d.path(IMU).read_bytes().replace(b"\n", b"\r\n")),
            id="Windows",
        ),
    ],
)
@pytest.mark.slow
def test_harmless_ways_of_writing_change_nothing(edit, data, capsys):
    """Oracle: the unchanged recording, of which every fix is used."""
    edit(data)
    report = _processed(capsys, data)
    assert report["counts"]["fixes_used"] == report["counts"]["fixes"] == 1500


@pytest.mark.slow
def test_an_outage_is_bridged_and_told(data, capsys):
    """Oracle: the three seconds that were taken away."""
    _rows(GNSS, lambda t: (t < 60.0) | (t >= 63.0))(data)
    report = _processed(capsys, data)
    assert report["longest_outage"]["length_s"] == pytest.approx(3.1, abs=0.01)
    assert any("no GNSS position was used for 3.1 s" in sentence for sentence in report["verdict"])


def test_a_missing_sample_is_bridged_and_told(data, capsys):
    """Oracle: the sample that was taken away."""
    data.lines(IMU, lambda lines: [*lines[:5000], *lines[5001:]])
    report = _processed(capsys, data)
    assert [gap["length_s"] for gap in report["imu_gaps"]] == [pytest.approx(0.02)]
    assert any("1 gap of the IMU" in sentence for sentence in report["verdict"])


@pytest.mark.parametrize(
    ("key", "change"),
    [
        ("lever_arm", _toml("[0.462, -0.001, -0.065]", "[0.962, -0.001, -0.065]")),
        ("time_offset", _columns(GNSS, 0, lambda t: t - 0.05)),
    ],
)
@pytest.mark.slow
def test_the_advice_on_lever_arm_and_clock_puts_it_right(data, capsys, key, change):
    """Oracle: the refused flight runs once the state is estimated, and estimates the change that
    was made.
    """
    change(data)
    data.toml("[output]", f"[filter]\n{key} = true\n[output]")
    report = _processed(capsys, data)
    assert report["counts"]["fixes_rejected"] == 0
    assert any("observed by this flight" in line for line in report["history"])


@pytest.mark.slow
@pytest.mark.parametrize("length", [0.5, pytest.param(3.0, marks=pytest.mark.slow)])
def test_a_gap_is_bridged_or_divides_the_flight_and_is_told(data, capsys, length):
    """Oracle: the gap that was made, and a second as the limit; images within a gap that is not
    bridged have no orientation.
    """
    _rows(IMU, lambda t: (t < 60.0) | (t >= 60.0 + length))(data)
    times = [float(line.split()[1]) for line in data.path(EVENTS).read_text().splitlines()[1:]]
    report = _processed(capsys, data)
    assert report["counts"]["imu_gaps"] == (length < 1.0)
    in_gap = [t for t in times if 205260.0 < t < 205260.0 + length and length > 1.0]
    assert report["counts"]["images"] == len(times) - len(in_gap)
    told = [check for check in report["checks"] if check["name"] == "IMU gaps"]
    assert bool(told) == (length > 1.0)


@pytest.mark.slow
def test_a_row_that_stands_twice_is_left_out_and_told(data, capsys):
    """Oracle: the row that was doubled."""
    data.lines(IMU, lambda x: [*x[:500], x[499], *x[500:]])
    report = _processed(capsys, data)
    assert [
        check["found"]
        for check in report["checks"]
        if check["name"] == "IMU rows" and "1 " in check["found"]
    ]


@pytest.mark.slow
def test_the_advice_on_a_clock_in_utc_puts_it_right(data, capsys):
    """Oracle: the refused flight runs once what the line says is done."""
    _columns(GNSS, 0, lambda t: t - 18.0)(data)
    data.toml("[gnss]", "[gnss]\ntime_offset_s = 18.0")
    assert _processed(capsys, data)["counts"]["fixes_rejected"] == 0


@pytest.mark.slow
def test_a_flight_can_be_cut_before_a_gap(data, capsys):
    """Oracle: the flight cut before a gap; the images after it are left out and told."""
    _rows(IMU, lambda t: (t < 100.0) | (t >= 103.0))(data)
    data.toml("[imu]", "end_tow = 205299\n[imu]")
    times = [float(line.split()[1]) for line in data.path(EVENTS).read_text().splitlines()[1:]]
    report = _processed(capsys, data)
    assert report["counts"]["images"] == sum(t <= 205299.0 for t in times) < len(times)
    assert any("lie outside of these times" in sentence for sentence in report["verdict"])


@pytest.mark.slow
def test_a_contradiction_can_be_overruled_and_is_told(data, capsys):
    """Oracle: the name in the refusal, put into the flight file; the history says what was
    overruled and what was found.
    """
    data.toml("forward right down", "right backward down")
    data.toml(
        "[imu]",
        'accept = ["heading against course", "recognised axes", "antenna lever arm"]\n[imu]',
    )
    report = _processed(capsys, data)
    assert [
        s
        for s in report["history"]
        if s.startswith(
            "contradiction overruled by the flight file: heading against course: median -9"
        )
    ]


@pytest.fixture(scope="session")
def products(good, tmp_path_factory):
    """The directory of the good data set's products, and the truth beside it."""
    out = tmp_path_factory.mktemp("products") / "new" / "out"
    before = _tree(good)
    assert main(["process", str(good / "flight.toml"), "--quiet", "--out", str(out)]) == 0
    assert _tree(good) == before
    return out


@pytest.fixture(scope="session")
def truth(good):
    """True exterior orientation and trajectory of the simulation."""
    return {name: dict(np.load(good / "truth" / f"{name}.npz")) for name in ("eo", "trajectory")}


def _rub(C_mc: Any) -> Any:
    """Camera right-up-back to east-north-up, from the camera with y down and z forward."""
    return C_mc @ np.diag([1.0, -1.0, -1.0])


def test_the_products_are_those_of_the_contract(products):
    """Oracle: design 6."""
    table = {"metashape.csv", "metashape_import.py"}
    expected = {"EO_local-plane.txt", "eo.json", *table, *PRODUCTS}
    assert {file.name for file in products.iterdir()} == expected
    assert all(file.stat().st_size for file in products.iterdir())


def test_eo_local_plane_is_that_of_the_contract(products, truth):
    """Oracle: design 6 for header and columns; the simulation's truth, with scipy's rotations, for
    the numbers.
    """
    lines = (products / "EO_local-plane.txt").read_text().splitlines()
    header = [line for line in lines if line.startswith("#")]
    assert lines[: len(header)] == header
    said = "\n".join(header)
    for word in (
        "tangent plane, east north up",
        "46.57",
        "6.54",
        "omega phi kappa",
        "R = Rx(omega) Ry(phi) Rz(kappa)",
        "lever arm",
        "bore-sight",
    ):
        assert word in said
    assert header[-1] == "# image E N U omega phi kappa sE sN sU sOmega sPhi sKappa"
    rows = [line.split(" ") for line in lines[len(header) :]]
    assert {len(row) for row in rows} == {13}
    assert [row[0] for row in rows] == truth["eo"]["images"].tolist()
    table = np.array([[float(field) for field in row[1:]] for row in rows])
    assert (table[:, 6:] > 0.0).all()
    assert (np.abs(table[:, :3] - truth["eo"]["position_enu"]) < 5.0 * table[:, 6:9]).all()
    turn = (
        Rotation.from_euler("XYZ", table[:, 3:6], degrees=True)
        * Rotation.from_matrix(_rub(truth["eo"]["C_mc"])).inv()
    )
    tilt, heading = turn.as_rotvec(degrees=True)[:, :2], turn.as_rotvec(degrees=True)[:, 2]
    assert np.abs(tilt).max() < 0.1  # five sigma of tilt
    assert (np.abs(heading) < 5.0 * table[:, 11]).all()


def test_metashape_is_that_of_the_contract(products, truth):
    """Oracle: the header and the matrix of formats.md B1; the simulation's truth."""
    header, *lines = (products / "metashape.csv").read_text().splitlines()
    assert header == "#Label,X,Y,Z,Yaw,Pitch,Roll,X_acc,Y_acc,Z_acc,Yaw_acc,Pitch_acc,Roll_acc"
    assert [line.split(",")[0] for line in lines] == truth["eo"]["images"].tolist()
    table = np.array([[float(field) for field in line.split(",")[1:]] for line in lines])
    assert table.shape[1] == 12
    assert (
        np.abs(table[:, :2] - [6.54, 46.57]).max() < 0.05
    )  # x is longitude, y latitude, and the flight some km at most from the origin
    assert (table[:, 6:] > 0.0).all()
    M = _rub(truth["eo"]["C_mc"])
    ypr = np.degrees(
        [
            np.arctan2(M[:, 0, 1], M[:, 1, 1]),
            np.arcsin(M[:, 2, 1]),
            np.arctan2(-M[:, 2, 0], M[:, 2, 2]),
        ]
    ).T
    off = (table[:, 3:6] - ypr + 180.0) % 360.0 - 180.0
    assert (
        np.abs(off) < 5.0 * table[:, 9:12] + 0.02
    ).all()  # 0.02 deg: the meridians of camera and origin


def test_eo_json_holds_the_full_covariances(products, truth):
    """Oracle: design 6: 6 x 6 an image and the cross-covariances between neighbours; jointly they
    are a covariance.
    """
    content = json.loads((products / "eo.json").read_text())
    images = content["images"]
    assert [image["image"] for image in images] == truth["eo"]["images"].tolist()
    cov = np.array([image["cov6"] for image in images])
    assert cov.shape == (len(images), 6, 6)
    assert images[-1]["cross_cov6_next"] is None
    cross = np.array([image["cross_cov6_next"] for image in images[:-1]])
    assert cross.shape == (len(images) - 1, 6, 6)
    for k in range(len(images) - 1):
        pair = np.block([[cov[k], cross[k]], [cross[k].T, cov[k + 1]]])
        scale = 1.0 / np.sqrt(np.diag(pair))
        assert np.linalg.eigvalsh(pair * np.outer(scale, scale)).min() > 0.0
    assert content["gps_week"] == 2008
    assert np.allclose([image["time_s"] for image in images], truth["eo"]["tow"], rtol=0, atol=1e-6)


def test_the_trajectory_is_that_of_the_contract(products, truth):
    """Oracle: the header of design 6; the simulation's truth at the IMU; the record sizes and units
    of SBET and smrmsg (formats.md B11).
    """
    header, *lines = (products / "trajectory.csv").read_text().splitlines()
    state = "gps_week,tow,lat_deg,lon_deg,h_m,vn,ve,vd,roll_deg,pitch_deg,heading_deg"
    assert (
        header
        == f"{state},sd_n_m,sd_e_m,sd_d_m,sd_vn,sd_ve,sd_vd,sd_roll_deg,sd_pitch_deg,sd_heading_deg"
    )
    table = np.array([[float(field) for field in line.split(",")] for line in lines])
    assert set(table[:, 0]) == {2008.0}
    assert np.allclose(np.diff(table[:, 1]), 0.1, atol=1e-6)
    true = truth["trajectory"]
    at = np.searchsorted(true["tow"], table[:, 1] - 1e-4)
    assert np.abs(true["tow"][at] - table[:, 1]).max() < 1e-4
    assert (np.abs(np.degrees(true["lat"][at]) - table[:, 2]) * 111e3 < 6.0 * table[:, 11]).all()
    assert (np.abs(true["h"][at] - table[:, 4]) < 6.0 * table[:, 13]).all()
    assert (np.abs(true["v_ned"][at] - table[:, 5:8]) < 6.0 * table[:, 14:17]).all()
    sbet = np.fromfile(products / "trajectory.sbet", "<f8").reshape(-1, 17)
    smrmsg = np.fromfile(products / "trajectory.smrmsg", "<f8").reshape(-1, 10)
    assert np.allclose(sbet[:, 0], table[:, 1], atol=1e-6)
    assert np.allclose(np.degrees(sbet[:, 1:3]), table[:, 2:4], atol=1e-9)
    assert np.allclose(sbet[:, 4:7], table[:, 5:8] * [1.0, -1.0, -1.0], atol=1e-5)
    assert np.allclose(smrmsg[:, 0], sbet[:, 0])
    assert np.allclose(smrmsg[:, 1:4], table[:, 11:14], atol=1e-5)
    assert np.allclose(smrmsg[:, 7:10] / 60.0, table[:, 17:20], atol=1e-6)  # minutes of arc


def test_the_report_says_what_was_done_to_what(good, products):
    """Oracle: design 6: figures, the resolved flight file, versions, hashes of the inputs
    (hashlib); the page stands alone.
    """
    report = json.loads((products / "report.json").read_text())
    hashes = {
        name: hashlib.sha256((good / name).read_bytes()).hexdigest()
        for name in ("flight.toml", IMU, GNSS, EVENTS)
    }
    assert report["inputs_sha256"] == hashes
    assert report["flight"]["gnss"]["gate_sigma"] == 5.0
    assert {"insgnss", "python", "numpy"} <= set(report["versions"])
    assert report["counts"]["images"] == len((good / EVENTS).read_text().splitlines()) - 1
    page = (products / "report.html").read_text()
    assert not re.findall(r"""(?:src|href)\s*=\s*["'`]?(?!data:|#)[^"'`\s>]+""", page)
    assert page.rstrip().endswith("</html>")
