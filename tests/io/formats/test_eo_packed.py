"""eo.json of many images: numbers in an archive beside it, both of one run or one clear line."""

import hashlib
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from ba_scene import camera_of, exterior
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

import insgnss
from insgnss.base.errors import InputError
from insgnss.cli.main import main
from insgnss.io.formats.orientation import eo_json, eo_packed
from insgnss.io.formats.orientation.eo_json import read_eo_json, write_eo_json
from insgnss.records import ExteriorOrientation

COUNT = 12
KEPT = ("time", "position_m", "cov", "cross", "velocity_mps", "rate_radps", "origin", "boresight")


def scene(seed: int = 3, count: int = COUNT) -> ExteriorOrientation:
    rng = np.random.default_rng(seed)
    angles = rng.uniform(-8, 8, (2, count))
    eo = exterior(
        camera_of(*angles, rng.uniform(-180, 180, count)), 100.0 * rng.normal(size=(count, 3)), seed
    )
    cov = 0.5 * (eo.cov + eo.cov.swapaxes(1, 2))
    return replace(
        eo,
        cov=cov,
        cross=0.7 * cov[1:],
        velocity_mps=rng.normal(size=(count, 3)),
        rate_radps=rng.normal(size=(count, 3)),
    )


@pytest.fixture(autouse=True)
def _packed_from_ten(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(eo_packed, "FROM_IMAGES", 10)


def test_packed_images_come_back(tmp_path: Path) -> None:
    """Oracles: the record bit by bit, of the attitude the matrix of the quaternion (scipy); an
    archive that numpy alone reads; without what is optional.
    """
    eo = scene()
    write_eo_json(eo, tmp_path / "eo.json")
    back = insgnss.read_eo(tmp_path)
    for name in KEPT:
        assert_array_equal(getattr(back, name), getattr(eo, name))
    assert (back.images, back.gps_week, back.history) == (eo.images, eo.gps_week, eo.history)
    assert_allclose(back.C_mc, eo.C_mc, rtol=0, atol=4e-16 * 4)
    with np.load(tmp_path / "eo_images.npz") as file:
        assert_array_equal(file["cov6_upper"][:, 6], eo.cov[:, 1, 1])
        q = file["quaternion_wxyz"]
        assert_allclose(
            Rotation.from_quat(q[:, [1, 2, 3, 0]]).as_matrix(), eo.C_mc, rtol=0, atol=1e-14
        )
    bare = replace(eo, cross=None, velocity_mps=None, rate_radps=None)
    write_eo_json(bare, tmp_path / "eo.json")
    back = read_eo_json(tmp_path / "eo.json")
    assert (back.cross, back.velocity_mps, back.rate_radps) == (None, None, None)
    content = json.loads((tmp_path / "eo.json").read_text())
    assert content["images"] == list(eo.images)
    assert content["format_version"] == 2


def test_below_the_number_nothing_changes(tmp_path: Path) -> None:
    """Oracle: the text with a line an image, of version 1, and no file beside it."""
    write_eo_json(scene(count=9), tmp_path / "eo.json")
    assert [path.name for path in tmp_path.iterdir()] == ["eo.json"]
    assert json.loads((tmp_path / "eo.json").read_text())["format_version"] == 1


def test_both_kinds_export_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: the export of the same images as text; back to an eo.json of either kind."""
    write_eo_json(scene(), tmp_path / "many.json")
    monkeypatch.setattr(eo_packed, "FROM_IMAGES", 10_000)
    write_eo_json(scene(), tmp_path / "few.json")
    for stem in ("many", "few"):
        out = ["--out", str(tmp_path / f"{stem}.txt")]
        assert main(["export", str(tmp_path / f"{stem}.json"), "eo_local_plane", *out]) == 0
    assert (tmp_path / "many.txt").read_bytes() == (tmp_path / "few.txt").read_bytes()


def edited(path: Path, change: Callable[[dict], object]) -> None:
    """Change arrays of the archive, and let the eo.json have its new hash."""
    with np.load(path / "eo_images.npz") as file:
        arrays = dict(file)
    change(arrays)
    np.savez(path / "eo_images.npz", **arrays)
    content = json.loads((path / "eo.json").read_text())
    digest = hashlib.sha256((path / "eo_images.npz").read_bytes()).hexdigest()
    content["packed"]["sha256"] = digest
    (path / "eo.json").write_text(json.dumps(content))


CHANGES: dict[str, Callable[[dict], object]] = {
    r"no time_s; take both files": lambda a: a.pop("time_s"),
    r"position_m: float64 of shape \(11, 3\), expected \(12, 3\)": lambda a: a.update(
        position_m=a["position_m"][1:]
    ),
    r"rate_radps: float32 of shape \(12, 3\)": lambda a: a.update(
        rate_radps=a["rate_radps"].astype(np.float32)
    ),
    r"cross_cov6_next: float64 of shape \(12, 6, 6\), expected \(11, 6, 6\)": lambda a: a.update(
        cross_cov6_next=np.zeros((12, 6, 6))
    ),
    r"holds no numbers of images": lambda a: a.update(format=np.array("of another")),
    r"a quaternion is not of unit length": lambda a: a.update(
        quaternion_wxyz=1.1 * a["quaternion_wxyz"]
    ),
    r"image 8001.tif: cov6 is no covariance": lambda a: a.update(cov6_upper=-a["cov6_upper"]),
    r"eo_images.npz: cov6_upper: a number is not finite": lambda a: a.update(
        cov6_upper=np.nan * a["cov6_upper"]
    ),
}


@pytest.mark.parametrize("message", CHANGES)
def test_an_edited_archive_is_refused(tmp_path: Path, message: str) -> None:
    """Oracle: data_specs/eo_json.md, one line each."""
    write_eo_json(scene(), tmp_path / "eo.json")
    edited(tmp_path, CHANGES[message])
    with pytest.raises(InputError, match=message) as refusal:
        read_eo_json(tmp_path / "eo.json")
    assert "\n" not in str(refusal.value)


def test_a_missing_or_foreign_archive_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Oracle: the file is named, and what to do; exit code 2 or 3 and no traceback."""
    path, beside = tmp_path / "eo.json", tmp_path / "eo_images.npz"
    write_eo_json(scene(4), path)
    other = beside.read_bytes()
    write_eo_json(scene(5), path)
    whole = beside.read_bytes()
    for content, message in (
        (other, "does not belong to the eo.json beside it, which states another sha256"),
        (whole[:-10], "does not belong to the eo.json beside it, which states another sha256"),
        (None, "is missing, but the eo.json beside it keeps its numbers in this file"),
    ):
        beside.unlink()
        if content is not None:
            beside.write_bytes(content)
        with pytest.raises(InputError, match=f"eo_images.npz: {message}"):
            read_eo_json(path)
        assert main(["export", str(path), "eo_local_plane", "--out", str(tmp_path / "x.txt")]) != 0
        told = capsys.readouterr().err.strip().splitlines()
        assert len(told) == 1
        assert "take both files of one run" in told[0]
        beside.write_bytes(whole)
    content = json.loads(path.read_text())
    for file in ("../eo_images.npz", "/eo_images.npz"):
        content["packed"]["file"] = file
        path.write_text(json.dumps(content))
        with pytest.raises(InputError, match="no name of a file beside it"):
            read_eo_json(path)


def test_both_or_neither_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: what was there before a disk is full while the text is written."""
    write_eo_json(scene(6), tmp_path / "eo.json")
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert set(before) == {"eo.json", "eo_images.npz"}

    def full(*_: object, **__: object) -> str:
        return "\ud800"  # cannot be written as UTF-8

    monkeypatch.setattr(eo_json.json, "dumps", full)
    with pytest.raises(InputError, match="which is not UTF-8"):
        write_eo_json(scene(7), tmp_path / "eo.json")
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


@pytest.mark.parametrize(
    ("key", "value", "told"),
    [
        ("cross_cov6_next", None, "image 8002.tif: cross_cov6_next is null, not 6 x 6 numbers"),
        ("cov6", None, "image 8002.tif: cov6 is null, not 6 x 6 numbers"),
        ("time_s", None, "image 8002.tif: time_s is null, not a number"),
        ("position_m", [1.0, 2.0], r"image 8002.tif: position_m is \[1.0, 2.0\], not 3 numbers"),
        ("C_mc", "north", "image 8002.tif: C_mc is 'north', not 3 x 3 numbers"),
        ("time_s", "200002.0", "image 8002.tif: time_s is '200002.0', not a number"),
        ("time_s", True, "image 8002.tif: time_s is True, not a number"),
        ("time_s", 1e308, "image 8002.tif: time_s is 1e.308, not a number"),
        ("position_m", [1.0, "2.0", 3.0], "image 8002.tif: position_m is .*, not 3 numbers"),
        ("position_m", [1.0, False, 3.0], "image 8002.tif: position_m is .*, not 3 numbers"),
        ("gps_week", 2008.7, "gps_week is 2008.7, no whole number"),
        ("gps_week", "2008", "gps_week is '2008', not a number"),
        ("tangent_plane", {"epoch": "2020.5"}, "epoch is '2020.5', not a number"),
        ("tangent_plane", {"origin_lat_lon_rad_height_m": ["0.8", 0.1, 1]}, "not 3 numbers"),
        ("applied", {"boresight": [[1, 0, 0], [0, 1, 0], [0, 0, True]]}, "not 3 x 3 numbers"),
    ],
)
def test_a_value_that_is_none_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, key: str, value: object, told: str
) -> None:
    """Oracle: the image, the key and what stands there, in the words of the format."""
    monkeypatch.setattr(eo_packed, "FROM_IMAGES", 10_000)
    write_eo_json(scene(), tmp_path / "eo.json")
    content = json.loads((tmp_path / "eo.json").read_text())
    if key not in content:
        content["images"][1][key] = value
    else:
        content[key] = content[key] | value if isinstance(value, dict) else value
    (tmp_path / "eo.json").write_text(json.dumps(content))
    with pytest.raises(InputError, match=told):
        read_eo_json(tmp_path / "eo.json")
