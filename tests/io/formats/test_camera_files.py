"""Cameras in the files of other programs, read by those programs or by their formulas."""

import re
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from format_pages import on_page
from oracles import oracle

from insgnss.base.errors import InputError, UsageError
from insgnss.io.formats.blocks.camera_files import write_cameras
from insgnss.io.formats.blocks.camera_toml import read_camera_toml
from insgnss.records.block import INTERIOR, BrownCamera
from insgnss.records.cameras.camera import pixels_of, rays_of


def camera(**values):
    """The page's camera, with other values."""
    own = {"f": 5606.998, "cx": 2590.441, "cy": 1971.87, "k1": 0.01717, "k2": -0.06895}
    own |= {"k3": 0.07745, "p1": -0.00089, "p2": 0.00103} | values
    return BrownCamera("c", 5120, 3840, np.array([own.get(name, 0.0) for name in INTERIOR]))


def grid():
    """Rays over the image."""
    axes = np.meshgrid(np.linspace(-0.45, 0.45, 13), np.linspace(-0.33, 0.33, 11))
    return np.stack(axes, axis=-1).reshape(-1, 2)


def test_colmap_reads_its_cameras(tmp_path):
    """Oracle: pycolmap reads the file and projects: the same pixels to 1e-9."""
    pycolmap = oracle("pycolmap")
    cameras = [camera(b1=2.5), camera(k3=0.0, p1=3e-3)]
    assert write_cameras(cameras, tmp_path / "cameras.txt") == ()
    for name in ("images.txt", "points3D.txt"):
        (tmp_path / name).write_text("")
    made = pycolmap.Reconstruction(str(tmp_path)).cameras
    assert [made[k].model.name for k in (1, 2)] == ["FULL_OPENCV", "OPENCV"]
    rays = np.column_stack([grid(), np.ones(len(grid()))])
    for k, own in enumerate(cameras, start=1):
        assert np.abs(made[k].img_from_cam(rays) - pixels_of(own, grid())).max() < 1e-9
        assert (made[k].width, made[k].height) == (5120, 3840)


def test_the_page_of_camera_files(tmp_path):
    """Oracle: the page, with the camera of camera_toml.md."""
    (tmp_path / "c.toml").write_text(on_page("camera_toml"))
    write_cameras([read_camera_toml(tmp_path / "c.toml")], tmp_path / "cameras.txt")
    assert (tmp_path / "cameras.txt").read_text() == on_page("camera_files")
    assert on_page("camera_files", "refused").strip() == "b2 = 3"
    with pytest.raises(InputError) as refusal:
        write_cameras([camera(b2=3.0)], tmp_path / "x")
    assert str(refusal.value) == on_page("camera_files", "message").strip()


def test_metashape_calibration(tmp_path):
    """Oracle: the manual's formula on the numbers of the file."""
    own = camera(b1=2.5, b2=-0.8, k4=-0.03)
    assert write_cameras([own], tmp_path / "c.xml", "metashape") == ()
    root = ElementTree.parse(tmp_path / "c.xml").getroot()
    assert (root.tag, root.find("projection").text) == ("calibration", "frame")
    v = {e.tag: float(e.text) for e in root if isinstance(e.tag, str) and e.tag != "projection"}
    x, y = grid().T
    r2 = x * x + y * y
    K = 1 + v["k1"] * r2 + v["k2"] * r2**2 + v["k3"] * r2**3 + v["k4"] * r2**4
    xd = x * K + v["p1"] * (r2 + 2 * x * x) + 2 * v["p2"] * x * y
    yd = y * K + v["p2"] * (r2 + 2 * y * y) + 2 * v["p1"] * x * y
    u = v["width"] / 2 + v["cx"] + xd * v["f"] + xd * v["b1"] + yd * v["b2"]
    w = v["height"] / 2 + v["cy"] + yd * v["f"]
    assert np.abs(np.column_stack([u, w]) - pixels_of(own, grid())).max() < 1e-9


def test_opencv_yaml(tmp_path):
    """Oracle: OpenCV's formula (k1 k2 p1 p2 k3; the centre of the first pixel is (0, 0)) on the
    numbers of the file, read as text.
    """
    own = camera(b1=2.5)
    assert write_cameras([own], tmp_path / "c.yaml", "opencv") == ()
    text = (tmp_path / "c.yaml").read_text()
    assert text.startswith("%YAML:1.0\n---\nimage_width: 5120\nimage_height: 3840\n")
    K, d = (
        np.array(found.split(","), dtype=float) for found in re.findall(r"data: \[(.*?)\]", text)
    )
    shapes = re.findall(r"rows: (\d)\n   cols: (\d)\n   dt: d", text)
    assert shapes == [("3", "3"), ("5", "1")]
    x, y = grid().T
    r2 = x * x + y * y
    radial = 1 + d[0] * r2 + d[1] * r2**2 + d[4] * r2**3
    xd = x * radial + 2 * d[2] * x * y + d[3] * (r2 + 2 * x * x)
    yd = y * radial + d[2] * (r2 + 2 * y * y) + 2 * d[3] * x * y
    uv = np.column_stack([xd, yd, np.ones(len(xd))]) @ K.reshape(3, 3).T
    assert np.abs(uv[:, :2] + 0.5 - pixels_of(own, grid())).max() < 1e-9


@pytest.mark.parametrize("form", ["colmap", "opencv"])
def test_what_a_program_cannot_express(form, tmp_path):
    """Oracle: pixels of both cameras; a skew of 0.01 px at the corner is nothing, one of 1 px is
    refused.
    """
    own = camera(b2=0.02, k4=1e-5)
    (note,) = write_cameras([own], tmp_path / "c", form)
    assert note.startswith("camera c: b2 = 0.02, k4 = 1e-05 left out, ")
    said = float(re.search(r"pixels by at most (\S+) px", note)[1])
    xy = rays_of(own, [[0.0, 0.0], [5120.0, 0.0], [0.0, 3840.0], [5120.0, 3840.0]])
    moved = np.abs(pixels_of(own, xy) - pixels_of(camera(), xy)).max()
    assert said == pytest.approx(moved, rel=0.1)
    with pytest.raises(
        InputError, match=r"cannot hold k4 = 5, and leaving this out moves pixels by up to"
    ):
        write_cameras([camera(k4=5.0)], tmp_path / "d", form)
    assert not (tmp_path / "d").exists()


def test_a_backward_camera(tmp_path):
    """Oracle: rays of its pixels, through COLMAP's reading of the file; one that no polynomial
    follows to 0.01 px is refused.
    """
    pycolmap = oracle("pycolmap")
    interior = camera(b1=1e-3, k1=2e-5, k2=-1e-8, k3=0, p1=3e-6, p2=-3e-6).interior
    own = replace(camera(), interior=interior, backward=True, unit_px=156.0)
    (note,) = write_cameras([own], tmp_path / "cameras.txt")
    assert re.fullmatch(
        r"camera c: written as a forward polynomial, which differs from the"
        r" backward one by at most 0.00\d+ px",
        note,
    )
    for name in ("images.txt", "points3D.txt"):
        (tmp_path / name).write_text("")
    made = pycolmap.Reconstruction(str(tmp_path)).cameras[1]
    uv = np.stack(np.meshgrid(np.linspace(0, 5120, 9), np.linspace(0, 3840, 8)), axis=-1)
    uv = uv.reshape(-1, 2)
    rays = np.column_stack([rays_of(own, uv), np.ones(len(uv))])
    assert np.abs(made.img_from_cam(rays) - uv).max() < 0.01
    strong = replace(own, interior=camera(k1=2e-3, k2=-1e-6, k3=0).interior)
    with pytest.raises(InputError, match=r"is backward .* the best forward polynomial differs by"):
        write_cameras([strong], tmp_path / "d")


def test_files_that_take_one_camera(tmp_path):
    """Oracle: the page."""
    with pytest.raises(UsageError, match="2 cameras; a file of opencv holds one"):
        write_cameras([camera(), camera()], tmp_path / "c", "opencv")
    with pytest.raises(UsageError, match="cameras as 'colmaps'; did you mean 'colmap'"):
        write_cameras([camera()], tmp_path / "c", "colmaps")
