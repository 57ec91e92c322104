"""RTKLIB's .pos in all its variants: the same fixes, written by the rules of RTKLIB's solution.c,
come out the same.
"""

from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pyproj import Transformer

from insgnss.base.errors import InputError
from insgnss.io.formats import read_gnss, sniff_gnss
from insgnss.records import GnssFixes

WEEK, TOW = 2008, 604799.9
BASE = (46.5, 6.5, 600.0)
LLH = np.array(
    [
        [46.571234567, 6.541234567, 630.1234],
        [46.571244567, 6.541224567, 630.2234],
        [46.571254567, 6.541214567, 630.3234],
    ]
)
ROOTS = "0.0300 0.0200 0.0400 0.0100 -0.0150 -0.0200"  # over the axes of the file, in its order
VELOCITY = "1.00000 2.00000 3.00000 0.30000 0.20000 0.40000 0.10000 -0.15000 -0.20000"
TO_ECEF = Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)
NAMES = {
    "llh": ("latitude(deg) longitude(deg) height(m)", "n e u ne eu un", "vn(m/s) ve(m/s) vu(m/s)"),
    "dms": (
        "latitude(d'\") longitude(d'\") height(m)",
        "n e u ne eu ue",
        "vn(m/s) ve(m/s) vu(m/s)",
    ),
    "xyz": ("x-ecef(m) y-ecef(m) z-ecef(m)", "x y z xy yz zx", "vx(m/s) vy(m/s) vz(m/s)"),
    "enu": (
        "e-baseline(m) n-baseline(m) u-baseline(m)",
        "e n u en nu ue",
        "ve(m/s) vn(m/s) vu(m/s)",
    ),
}


def ecef(llh: np.ndarray) -> np.ndarray:
    return np.column_stack(TO_ECEF.transform(llh[:, 1], llh[:, 0], llh[:, 2]))


def enu_axes(lat: float, lon: float) -> np.ndarray:
    """Rows east, north, up in ECEF, built by cross products."""
    up = np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
    east = np.cross([0.0, 0.0, 1.0], up)
    east /= np.linalg.norm(east)
    return np.array([east, np.cross(up, east), up])


def dms(degrees: float) -> str:
    d, rest = divmod(degrees, 1.0)
    m, s = divmod(rest * 60.0, 1.0)
    return f"{d:.0f} {m:02.0f} {s * 60:011.8f}"


def place(kind: str) -> list[str]:
    if kind == "llh":
        return [f"{a:.9f} {b:.9f} {h:.4f}" for a, b, h in LLH]
    if kind == "dms":
        return [f"{dms(a)} {dms(b)} {h:.4f}" for a, b, h in LLH]
    xyz = ecef(LLH)
    if kind == "xyz":
        return [" ".join(f"{v:.4f}" for v in row) for row in xyz]
    axes = enu_axes(*np.radians(BASE[:2]))
    return [" ".join(f"{v:.4f}" for v in axes @ (row - ecef(np.array([BASE]))[0])) for row in xyz]


def file(
    tmp_path: Path,
    kind: str,
    scale: str = "GPST",
    dated: bool = False,
    sep: str = " ",
    velocity: bool = False,
    header: bool = True,
) -> Path:
    position, roots, speeds = NAMES[kind]
    names = (
        f"{scale} {position} Q ns " + " ".join(f"sd{a}(m)" for a in roots.split()) + " age(s) ratio"
    )
    names += f" {speeds} " + " ".join(f"sdv{a}" for a in roots.split()) if velocity else ""
    lines = (
        ["% program   : RTKLIB", f"% ref pos   : {BASE[0]:.9f} {BASE[1]:.9f} {BASE[2]:.4f}", "%"]
        if header
        else []
    )
    lines += ["%  " + sep.join(names.split(" "))] if header else []
    for k, text in enumerate(place(kind)):
        shift = {"GPST": 0.0, "UTC": -18.0, "JST": 32400.0 - 18.0}[scale]
        when = datetime(1980, 1, 6) + timedelta(weeks=WEEK, seconds=TOW + 0.1 * k + shift)
        seconds = WEEK * 604800 + TOW + 0.1 * k + shift
        stamp = (
            f"{when:%Y/%m/%d %H:%M:%S}.{when.microsecond // 1000:03d}"
            if dated
            else f"{seconds // 604800:.0f}{sep}{seconds % 604800:.3f}"
        )
        values = f"{text} 1 16 {ROOTS} 0.03 6.4" + (f" {VELOCITY}" if velocity else "")
        lines.append(stamp + sep + sep.join(values.split()))
    path = tmp_path / "x.pos"
    path.write_text("\n".join(lines) + "\n")
    return path


def covariance(kind: str, row: int) -> np.ndarray:
    """North, east, down, from vectors in ECEF."""
    P = np.array([[9e-4, 1e-4, -4e-4], [1e-4, 4e-4, -2.25e-4], [-4e-4, -2.25e-4, 16e-4]])
    here = enu_axes(*np.radians(LLH[row, :2]))
    to_ned = np.array([here[1], here[0], -here[2]])
    axes = (
        np.eye(3)
        if kind == "xyz"
        else enu_axes(*np.radians(BASE[:2]))
        if kind == "enu"
        else here[[1, 0, 2]]
    )
    return to_ned @ axes.T @ P @ axes @ to_ned.T


def check(got: GnssFixes, kind: str) -> None:
    assert got.gps_week == WEEK
    assert_allclose(got.time, TOW + 0.1 * np.arange(3), rtol=0, atol=2e-6)
    back = np.column_stack([np.degrees(got.lat), np.degrees(got.lon), got.height])
    assert_allclose(ecef(back), ecef(LLH), rtol=0, atol=2e-4)  # digits printed: 1e-9 deg and 0.1 mm
    for row in range(3):
        assert_allclose(got.cov_ned[row], covariance(kind, row), atol=1e-9)
    assert got.quality is not None
    assert got.quality.tolist() == [1, 1, 1]


@pytest.mark.parametrize("sep", [" ", ",", "\t", ";"])
@pytest.mark.parametrize("dated", [False, True])
@pytest.mark.parametrize("kind", NAMES)
def test_separators_coordinates_and_time(tmp_path: Path, kind: str, dated: bool, sep: str) -> None:
    """Oracle: the fixes written; pyproj and cross products for coordinates and covariances,
    datetime for the week.
    """
    path = file(tmp_path, kind, dated=dated, sep=sep)
    assert sniff_gnss(path) == "rtklib_pos"
    check(read_gnss(path), kind)


@pytest.mark.parametrize("scale", ["UTC", "JST"])
@pytest.mark.parametrize("dated", [False, True])
def test_time_scales_over_the_week_end(tmp_path: Path, scale: str, dated: bool) -> None:
    """Oracle: datetime arithmetic with 18 leap seconds."""
    check(read_gnss(file(tmp_path, "llh", scale, dated)), "llh")


@pytest.mark.parametrize("kind", NAMES)
def test_velocities(tmp_path: Path, kind: str) -> None:
    """Oracle: vectors turned by cross products."""
    got = read_gnss(file(tmp_path, kind, velocity=True, dated=True))
    here = enu_axes(*np.radians(LLH[0, :2]))
    axes = (
        np.eye(3)
        if kind == "xyz"
        else enu_axes(*np.radians(BASE[:2]))
        if kind == "enu"
        else here[[1, 0, 2]]
    )
    v = axes.T @ [1.0, 2.0, 3.0]
    assert got.velocity_ned is not None
    assert got.velocity_cov_ned is not None
    assert_allclose(
        got.velocity_ned[0], [here[1] @ v, here[0] @ v, -here[2] @ v], rtol=0, atol=1e-7
    )
    assert_allclose(got.velocity_cov_ned[0], 100.0 * covariance(kind, 0), atol=1e-7)


@pytest.mark.parametrize("kind", ["llh", "xyz"])
@pytest.mark.parametrize("dated", [False, True])
@pytest.mark.parametrize("velocity", [False, True])
def test_without_header(tmp_path: Path, kind: str, dated: bool, velocity: bool) -> None:
    """Oracle: the fixes written; the note says what was taken for granted."""
    path = file(tmp_path, kind, dated=dated, header=False, velocity=velocity)
    assert sniff_gnss(path) == "rtklib_pos"
    got = read_gnss(path)
    check(got, kind)
    assert "no header; read as GPST, heights above the ellipsoid" in got.notes[0].found


def test_roots_of_zero_take_the_callers_sigma(tmp_path: Path) -> None:
    """Oracle: the standard deviations given."""
    path = file(tmp_path, "llh")
    path.write_text(path.read_text().replace(ROOTS, "0.0000 0.0000 0.0000 0.0000 0.0000 0.0000", 1))
    with pytest.raises(InputError, match="standard deviation sdn is 0"):
        read_gnss(path)
    got = read_gnss(path, sigma_m=[1, 2, 3])
    assert_allclose(got.cov_ned[0], np.diag([1, 4, 9]))
    assert_allclose(got.cov_ned[1], covariance("llh", 1), rtol=0, atol=1e-12)
    assert "sigma_m used for 1 of 3 epochs without standard deviations" in got.notes[0].found


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("% ref pos", "% rev pos"), "holds baselines, but its header gives no base"),
        (
            ("46.500000000 6.5", "146.500000000 6.5"),
            "the base position 146.5 6.5 600 is no latitude",
        ),
        (("sden(m)", "what(m)"), "does not name sden"),
        (("n-baseline(m)", "n"), "the header lacks n-baseline or has it twice"),
        ((" 1 16 ", " 9 16 "), "x.pos:5: 9 is no quality of RTKLIB"),
    ],
)
def test_refusals(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    """Oracle: data_specs/rtklib_pos.md."""
    path = file(tmp_path, "enu")
    path.write_text(path.read_text().replace(*change))
    with pytest.raises(InputError, match=message):
        read_gnss(path)


def test_two_files_in_one(tmp_path: Path) -> None:
    """Oracle: two headers that name other columns."""
    text = file(tmp_path, "llh").read_text() + file(tmp_path, "xyz").read_text()
    (tmp_path / "x.pos").write_text(text)
    with pytest.raises(InputError, match="holds 2 headers that differ"):
        read_gnss(tmp_path / "x.pos")
    text = file(tmp_path, "llh").read_text()
    (tmp_path / "x.pos").write_text(text + text)
    assert read_gnss(tmp_path / "x.pos").notes[0].found == "3 double rows left out, of 6"
