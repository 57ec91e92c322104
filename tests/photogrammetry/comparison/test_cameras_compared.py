"""Calibrations compared in pixels and converted by the verb `camera`."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from insgnss.base.errors import DataError, UsageError
from insgnss.cli.camera import READ, WRITTEN
from insgnss.cli.main import main
from insgnss.io.formats.blocks.camera_files import CAMERA_FORMS, write_cameras
from insgnss.io.formats.blocks.camera_toml import write_camera_toml
from insgnss.io.formats.returned.cameras import BY_FORMAT, read_camera
from insgnss.photogrammetry.comparison.cameras import report_cameras
from insgnss.records.block import INTERIOR, BrownCamera


def camera(width: int = 5120, height: int = 3840, **values: float) -> BrownCamera:
    of = {"f": 5600.0, "cx": 2570.0, "cy": 1915.0, "k1": -0.05, "k2": 0.02, "p1": 1e-4} | values
    return BrownCamera("c", width, height, np.array([of.get(name, 0.0) for name in INTERIOR]))


def compared(tmp_path: Path, a: BrownCamera, b: BrownCamera, **options):
    for name, one in (("a", a), ("b", b)):
        write_camera_toml(one, tmp_path / f"{name}.toml")
    return report_cameras(tmp_path / "a.toml", tmp_path / "b.toml", **options)


def test_a_longer_camera_constant_moves_pixels_outwards(tmp_path: Path) -> None:
    """Oracle: without distortion 1 % of f is 1 % of the distance from the principal point, and no
    rotation takes it up.
    """
    plain = {"k1": 0.0, "k2": 0.0, "p1": 0.0, "cx": 2560.0, "cy": 1920.0}
    done = compared(tmp_path, camera(**plain), camera(**plain, f=5656.0))
    assert done.difference.largest == pytest.approx(0.01 * np.hypot(2560.0, 1920.0), rel=1e-9)
    assert done.difference.rms_after_rotation == pytest.approx(done.difference.rms, rel=1e-6)
    assert "after the best rotation" in done.summary()


def test_a_rotation_is_taken_up(tmp_path: Path) -> None:
    """Oracle: scipy's rotation of rays; a principal point 2 px off is nearly 0.02 deg about y,
    and a tenth of it remains towards the corners.
    """
    plain = {"k1": 0.0, "k2": 0.0, "p1": 0.0, "cx": 2560.0, "cy": 1920.0}
    done = compared(tmp_path, camera(**plain), camera(**plain | {"cx": 2562.0}))
    assert done.difference.rms == pytest.approx(2.0, rel=1e-9)
    turn = Rotation.from_rotvec([0.0, np.radians(done.difference.rotation_deg[1]), 0.0])
    moved = turn.apply([0.0, 0.0, 1.0])
    assert 5600.0 * moved[0] / moved[2] == pytest.approx(2.0, abs=0.3)
    assert done.difference.rms_after_rotation < 0.2
    assert "the calibrations agree to 0.5 px rms" in done.summary()


def test_of_another_resolution(tmp_path: Path) -> None:
    """Oracle: the same camera with half the pixels; another shape is another camera."""
    half = camera(2560, 1920, f=2800.0, cx=1285.0, cy=957.5)
    done = compared(tmp_path, camera(), half)
    assert done.difference.largest < 1e-9
    assert "scaled by 2 " in done.notes[0]
    with pytest.raises(DataError, match="are not of one image format"):
        compared(tmp_path, camera(), camera(5120, 3413))


def test_the_verb(tmp_path: Path, capsys) -> None:
    """Oracle: the camera that was written, through COLMAP's file and one of two cameras."""
    write_cameras([camera(), camera(f=4000.0)], tmp_path / "cameras.txt")
    command = ["camera", str(tmp_path / "cameras.txt"), "--name", "2", "--as", "opensfm"]
    assert main([*command, "--out", str(tmp_path / "cameras.json")]) == 0
    assert read_camera(tmp_path / "cameras.json").of("f") == pytest.approx(4000.0, abs=1e-9)
    other = [*command[:3], "1", *command[4:], "--out", str(tmp_path / "cameras.json")]
    assert main(other) == 2
    assert "cameras.json is there and differs; give another file, or --force" in (
        capsys.readouterr().err
    )
    assert read_camera(tmp_path / "cameras.json").of("f") == pytest.approx(4000.0, abs=1e-9)
    assert main([*other, "--force"]) == 0
    assert read_camera(tmp_path / "cameras.json").of("f") != pytest.approx(4000.0, abs=1.0)
    assert main([*command, "--out", str(tmp_path / "cameras.json"), "--force"]) == 0
    capsys.readouterr()
    pair = [str(tmp_path / "cameras.json"), str(tmp_path / "cameras.txt"), "--name", "2", "--json"]
    assert main(["camera", *pair]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["difference_px"]["largest"] < 1e-9
    assert [file["format"] for file in document["files"]] == ["opensfm", "colmap"]
    assert tuple(READ.split()) == tuple(BY_FORMAT)
    assert set(WRITTEN.split()) == {"toml", *CAMERA_FORMS}


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"form": "toml"}, "--as and --out belong together"),
        ({"form": "tom", "out": Path("x")}, "nearest: toml|'toml'"),
        ({"name": "3"}, "has no camera '3'"),
        ({"form": "toml", "out": Path("x")}, "has 2 cameras; name one: --name"),
    ],
)
def test_what_does_not_go_together(options, why: str, tmp_path: Path) -> None:
    """Oracle: two cameras in the file."""
    write_cameras([camera(), camera(f=4000.0)], tmp_path / "cameras.txt")
    with pytest.raises(UsageError, match=why):
        report_cameras(tmp_path / "cameras.txt", **options)
