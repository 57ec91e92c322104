"""Standard deviations and correlations of cameras in the files of each program."""

import re

import numpy as np
import pytest

from insgnss.base.errors import InputError
from insgnss.io.formats.blocks.camera_files import write_cameras
from insgnss.io.formats.blocks.camera_toml import (
    read_camera_covariance,
    read_camera_toml,
    write_camera_toml,
)
from insgnss.records.block import INTERIOR, BrownCamera, InteriorCovariance

NAMES = ("f", "cx", "b1", "k1", "p1", "p2")
SIGMA = np.array([0.4, 0.3, 0.2, 1e-3, 2e-5, 3e-5])


@pytest.fixture
def camera() -> BrownCamera:
    value = {"f": 5600.0, "cx": 2590.0, "cy": 1971.0, "b1": 1.5, "k1": 0.02, "p1": -9e-4}
    interior = [value.get(name, 0.0) for name in INTERIOR]
    return BrownCamera("c", 5120, 3840, np.array(interior), free=NAMES)


@pytest.fixture
def covariance() -> InteriorCovariance:
    """Correlations as of a strip: f with b1 and k1, cx with p1."""
    rho = np.eye(6)
    for i, j, value in ((0, 2, -0.6), (0, 3, 0.5), (1, 4, 0.9), (4, 5, 0.1)):
        rho[i, j] = rho[j, i] = value
    return InteriorCovariance(NAMES, rho * SIGMA * SIGMA[:, None])


def test_toml_reads_back(camera, covariance, tmp_path) -> None:
    """Oracle: what was written."""
    write_camera_toml(camera, tmp_path / "c.toml", covariance)
    got = read_camera_covariance(tmp_path / "c.toml")
    assert got.parameters == NAMES
    assert got.cov == pytest.approx(covariance.cov, rel=1e-9, abs=1e-25)
    assert read_camera_toml(tmp_path / "c.toml").interior.tolist() == camera.interior.tolist()
    write_camera_toml(camera, tmp_path / "without.toml")
    assert read_camera_covariance(tmp_path / "without.toml") is None


def test_a_covariance_that_cannot_be(camera, covariance, tmp_path) -> None:
    """Oracle: the words of the message."""
    write_camera_toml(camera, tmp_path / "c.toml", covariance)
    text = (tmp_path / "c.toml").read_text()
    for old, new, words in (
        ("f = 0.4", "f = 0.0", "sigma.f: 0; a standard deviation must be greater than zero"),
        ("0.9", "1.1", "symmetric and positive definite, in the order f, cx, b1"),
        ("0.9", '"0.9"', "expected 6 rows of as many numbers"),
        ("[1, ", "[true, ", "expected 6 rows of as many numbers"),
        ("f = 0.4", "f = 1e308", "sigma.f: 1e+308 is outside"),
    ):
        (tmp_path / "bad.toml").write_text(text.replace(old, new))
        with pytest.raises(InputError, match=re.escape(words)):
            read_camera_covariance(tmp_path / "bad.toml")
    with pytest.raises(InputError, match="not parameters in the order"):
        InteriorCovariance(("cx", "f"), np.eye(2))


def test_metashape_has_it_as_its_projects_do(camera, covariance, tmp_path) -> None:
    """Oracle: the element's names in a project; cx counts from the image's centre all the same."""
    write_cameras([camera], tmp_path / "c.xml", "metashape", [covariance])
    text = (tmp_path / "c.xml").read_text()
    assert re.search("<params>(.*)</params>", text)[1] == "f cx b1 k1 p1 p2"
    got = np.array(re.search("<coeffs>(.*)</coeffs>", text)[1].split(), dtype=float)
    assert got.reshape(6, 6).tolist() == covariance.cov.tolist()


def test_opencv_names(camera, covariance, tmp_path) -> None:
    """Oracle: fx = f + b1, fy = f, p1 and p2 exchanged, by hand."""
    write_cameras([camera], tmp_path / "c.yaml", "opencv", [covariance])
    text = (tmp_path / "c.yaml").read_text()
    names = re.findall(r'"(\w+)"', text.splitlines()[-1])
    sigma = re.search(r"standard_deviations: .*?data: \[(.*?)\]", text, re.DOTALL)[1]
    sigma = dict(zip(names, np.array(sigma.split(","), dtype=float), strict=True))
    fx = np.sqrt(0.4**2 + 0.2**2 - 2 * 0.6 * 0.4 * 0.2)
    assert sigma == pytest.approx(
        {"fx": fx, "fy": 0.4, "cx": 0.3, "k1": 1e-3, "p1": 3e-5, "p2": 2e-5}
    )
    rho = re.search(r"correlations: .*?data: \[(.*?)\]", text, re.DOTALL)[1]
    rho = np.array(rho.split(","), dtype=float).reshape(6, 6)
    i, j = names.index("cx"), names.index("p2")
    assert rho[i, j] == pytest.approx(0.9)
    assert np.diagonal(rho) == pytest.approx(np.ones(6))


def test_colmap_has_it_in_comments(camera, covariance, tmp_path) -> None:
    """Oracle: the lines that are no comments are those without it."""
    write_cameras([camera], tmp_path / "a.txt", "colmap")
    write_cameras([camera], tmp_path / "b.txt", "colmap", [covariance])
    plain, more = ((tmp_path / name).read_text().splitlines() for name in ("a.txt", "b.txt"))
    assert [line for line in more if not line.startswith("#")] == plain[1:]
    assert "# sigmas of camera 1: fx 0.32" in "\n".join(more)
