"""Mismatches of convention put into a file on purpose, which the comparison must name, and name
alone.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from compared_files import Written
from numpy.testing import assert_allclose

from insgnss.geodesy.rotation import (
    CV_RUB,
    NED_ENU,
    rotation_from_opk,
    rotation_from_rpy,
    rotation_from_vector,
)
from insgnss.photogrammetry.comparison.compare import compare_files, compare_poses
from insgnss.photogrammetry.comparison.poses import Poses
from insgnss.photogrammetry.comparison.reading import read_poses
from insgnss.photogrammetry.comparison.result import Comparison

DEG = np.pi / 180.0


def rewritten(
    source: Path, target: Path, change: Callable[[list[str]], list[str]], delimiter: str | None
) -> Path:
    """A text file with the fields of its data lines changed."""
    lines = []
    for line in source.read_text().splitlines():
        fields = line.split(delimiter)
        data = not line.startswith("#") and any(field[:1].isdigit() for field in fields[1:])
        lines.append((delimiter or " ").join(change(fields)) if data else line)
    target.write_text("\n".join(lines) + "\n")
    return target


def swapped(i: int, j: int) -> Callable[[list[str]], list[str]]:
    def change(fields: list[str]) -> list[str]:
        fields[i], fields[j] = fields[j], fields[i]
        return fields

    return change


def scaled(factor: float, *at: int, plus: float = 0.0) -> Callable[[list[str]], list[str]]:
    def change(fields: list[str]) -> list[str]:
        for k in at:
            fields[k] = f"{factor * float(fields[k]) + plus:.12f}"
        return fields

    return change


FILES = {  # name: (file, change of its fields, names of what must be found)
    "omega and phi": ("EO_local-plane.txt", swapped(4, 5), ["angles exchanged"]),
    "east and north": ("EO_local-plane.txt", swapped(1, 2), ["east for north"]),
    "radians for degrees": ("EO_local-plane.txt", scaled(DEG, 4, 5, 6), ["radians for degrees"]),
    "gon for degrees": ("EO_local-plane.txt", scaled(1.0 / 0.9, 4, 5, 6), ["gon for degrees"]),
    "kappa reversed": ("EO_local-plane.txt", scaled(-1.0, 6), ["sign of angles"]),
    "geoid": ("metashape.csv", scaled(1.0, 3, plus=-49.6), ["geoid-sized height"]),
    "feet": ("metashape.csv", scaled(1.0 / 0.3048, 3), ["feet"]),
    "a quarter turn": ("metashape.csv", scaled(1.0, 4, plus=90.0), ["yaw turned"]),
    "grid north": ("metashape.csv", scaled(1.0, 4, plus=0.657), ["north"]),
    "pitch and roll": ("metashape.csv", swapped(5, 6), ["angles exchanged"]),
    "latitude and longitude": ("metashape.csv", swapped(1, 2), ["latitude for longitude"]),
}


@pytest.mark.slow
@pytest.mark.parametrize("what", FILES)
def test_a_changed_file_is_recognised(flight: Written, tmp_path: Path, what: str) -> None:
    """Oracle: what was changed in the text of the file; what remains is what its digits leave."""
    name, change, expected = FILES[what]
    delimiter = "," if name.endswith("csv") else None
    c = compare_files(
        flight["eo.json"], rewritten(flight[name], tmp_path / name, change, delimiter)
    )
    assert [f.name for f in c.findings] == expected
    assert c.findings[0].explained > 0.999
    for x in c.remaining:
        assert np.abs(x.difference).max() < (2e-4 if x.unit == "m" else 1e-5 * DEG)
    assert c.findings[0].sentence() in c.summary()
    assert c.figure().startswith(b"\x89PNG")


def test_values_are_those_that_were_put_in(flight: Written, tmp_path: Path) -> None:
    """Oracle: the numbers of the change."""
    name, change, _ = FILES["geoid"]
    c = compare_files(flight["eo.json"], rewritten(flight[name], tmp_path / name, change, ","))
    assert c.findings[0].values["up_m"] == pytest.approx(-49.6, abs=1e-4)
    assert "b above sea level, a above the ellipsoid" in c.findings[0].statement
    name, change, _ = FILES["grid north"]
    c = compare_files(flight["eo.json"], rewritten(flight[name], tmp_path / name, change, ","))
    assert c.findings[0].values["up_rad"] == pytest.approx(-0.657 * DEG, abs=1e-7)
    name, change, _ = FILES["a quarter turn"]
    c = compare_files(flight["eo.json"], rewritten(flight[name], tmp_path / name, change, ","))
    assert c.findings[0].statement == "yaw of b, clockwise from north, is +90 deg off that of a"


def camera(b: Poses, change: Callable[[np.ndarray], np.ndarray]) -> Poses:
    assert b.C_Ex is not None
    return replace(b, C_Ex=change(b.C_Ex), angles=None)


ATTITUDES: dict[str, tuple[Callable[[np.ndarray], np.ndarray], str, str]] = {
    "image top": (
        lambda C: C @ rotation_from_vector([0.0, 0.0, 90.0 * DEG]),
        "yaw turned",
        "turned by +90 deg about its viewing direction",
    ),
    "up and back": (lambda C: C @ CV_RUB, "camera axes", "right, up, back"),
    "NED": (lambda C: NED_ENU @ C, "axes of the frame", "north, east, down for east, north, up"),
    "inverse": (lambda C: C.swapaxes(1, 2), "inverse", "frame to camera"),
    "bore-sight": (
        lambda C: C @ rotation_from_vector(np.array([0.66, -0.57, 0.51]) * DEG),
        "boresight",
        "down -0.5700",
    ),
    "leaning frame": (
        lambda C: rotation_from_vector(np.array([0.3, -0.2, 0.1]) * DEG) @ C,
        "turn of the frame",
        "east +0.3000 north -0.2000 up +0.1000",
    ),
}


@pytest.mark.parametrize("what", ATTITUDES)
def test_turned_cameras_are_recognised(flight: Written, what: str) -> None:
    """Oracle: the turn that was put in."""
    change, name, words = ATTITUDES[what]
    b = camera(read_poses(flight["metashape.csv"]), change)
    c = compare_poses(read_poses(flight["eo.json"]), b)
    assert [f.name for f in c.findings] == [name]
    assert words in c.findings[0].statement
    assert c.findings[0].after < 2e-5 * DEG


def test_angles_of_another_set(flight: Written) -> None:
    """Oracle: yaw, pitch, roll of the camera read as omega, phi, kappa in their order."""
    a, b = read_poses(flight["eo.json"]), read_poses(flight["metashape.csv"])
    assert b.angles is not None
    wrong = replace(b, C_Ex=rotation_from_opk(b.angles) @ CV_RUB, angle_set="opk")
    c = compare_poses(a, wrong)
    assert [f.name for f in c.findings] == ["angle set"]
    assert c.findings[0].statement == "b has yaw pitch roll that were read as omega phi kappa"


def bodies(flight: Written) -> tuple[Poses, Poses]:
    return read_poses(flight["trajectory.csv"]), read_poses(flight["trajectory.sbet"])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda rpy: rpy[:, [1, 0, 2]], "b has roll and pitch exchanged"),
        (lambda rpy: rpy * [1.0, 1.0, -1.0], "b has heading with the other sign"),
        (
            lambda rpy: rpy + [0.0, 0.0, np.pi / 2],
            "yaw of b, clockwise from north, is +90 deg off that of a",
        ),
    ],
)
def test_turned_bodies_are_recognised(
    flight: Written, change: Callable[[np.ndarray], np.ndarray], words: str
) -> None:
    """Oracle: the change of roll, pitch, heading."""
    a, b = bodies(flight)
    assert b.angles is not None
    angles = change(b.angles)
    c = compare_poses(a, replace(b, C_Ex=NED_ENU @ rotation_from_rpy(angles), angles=angles))
    assert [f.statement for f in c.findings] == [words]


@pytest.mark.slow
@pytest.mark.parametrize("late", [-18.0, 18.0, -1.0, 0.02, -0.0013])
def test_clocks_that_disagree(flight: Written, late: float) -> None:
    """Oracle: the shift of the stamps."""
    a, b = bodies(flight)
    assert b.time is not None
    c = compare_poses(a, replace(b, time=b.time + late))
    assert [f.name for f in c.findings] == ["time"]
    assert c.findings[0].values["seconds"] == pytest.approx(late, abs=2e-5)
    assert ("leap seconds" in c.findings[0].statement) is (abs(late) == 18.0)
    for x in c.remaining[:3]:
        assert np.abs(x.difference).max() < 1e-3
    assert c.figure().startswith(b"\x89PNG")


def test_utc_is_told_from_gpst(flight: Written) -> None:
    """Oracle: UTC lags behind GPST by 18 s, so that its stamps are early."""
    a, b = bodies(flight)
    assert b.time is not None
    c = compare_poses(a, replace(b, time=b.time - 18.0))
    assert (
        "stamps of b are 18.0000 s early (the 18 leap seconds between GPS time and UTC: b is in"
        " UTC, a in GPST)" in c.summary()
    )


def test_time_and_lever_arm_are_told_apart(flight: Written) -> None:
    """Oracle: 20 ms put into the trajectory's stamps, and the rig's lever arm between camera and
    IMU, which looks much like it.
    """
    a, b = read_poses(flight["eo.json"]), read_poses(flight["trajectory.sbet"])
    assert b.time is not None
    c = compare_poses(a, replace(b, time=b.time + 0.02))
    found = {f.name: f.values for f in c.findings}
    assert found["time"]["seconds"] == pytest.approx(0.02, abs=2e-4)
    lever = np.array([found["lever arm"][f"{axis}_m"] for axis in ("right", "down")])
    expected = -(flight.eo.camera_from_body @ flight.eo.boresight @ flight.camera_lever_b)[:2]
    assert_allclose(lever, expected, atol=0.005)


def test_times_of_the_same_images(flight: Written) -> None:
    """Oracle: 18 s put into the stamps of one eo.json."""
    a = read_poses(flight["eo.json"])
    assert a.time is not None
    c = compare_poses(a, replace(a, time=a.time - 18.0))
    assert [f.name for f in c.findings] == ["time"]
    assert (
        "earlier than those of a for the same images (the 18 leap seconds"
        in c.findings[0].statement
    )


def test_several_mismatches_at_once(flight: Written) -> None:
    """Oracle: 18 s, a geoid and a quarter turn, all put in."""
    a, b = bodies(flight)
    assert b.time is not None
    assert b.angles is not None
    angles = b.angles + [0.0, 0.0, np.pi / 2]
    b = replace(
        b,
        time=b.time - 18.0,
        height=b.height - 50.0,
        C_Ex=NED_ENU @ rotation_from_rpy(angles),
        angles=angles,
    )
    c = compare_poses(a, b)
    assert [f.name for f in c.findings] == ["time", "geoid-sized height", "yaw turned"]


def test_noise_is_not_explained(flight: Written) -> None:
    """Oracle: random differences of 0.5 m and 3 deg have no reason, over twenty draws."""
    a = read_poses(flight["eo.json"])
    assert a.C_Ex is not None
    for seed in range(20):
        rng = np.random.default_rng(seed)
        moved = a.moved(
            a.lat + 8e-8 * rng.standard_normal(a.n),
            a.lon + 8e-8 * rng.standard_normal(a.n),
            a.height + rng.standard_normal(a.n),
        )
        b = replace(moved, C_Ex=rotation_from_vector(0.05 * rng.standard_normal((a.n, 3))) @ a.C_Ex)
        c: Comparison = compare_poses(a, b)
        assert c.findings == ()
