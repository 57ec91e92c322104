"""A camera that has other parameters from an image of the flight on."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from insgnss.base.errors import InputError, OptionError
from insgnss.io.formats.blocks.camera_toml import read_camera_toml
from insgnss.io.formats.blocks.image_points import read_image_points, write_image_points
from insgnss.photogrammetry.block_adjustment.run import adjust
from insgnss.records.block import INTERIOR


def knocked(directory, first, df_px=6.0, dx_px=3.0):
    """Let the camera have another f and principal point from an image on, exactly: of a forward
    camera pixels are linear in both.
    """
    camera = read_camera_toml(directory / "truth/camera.toml")
    path = directory / "01_Observations/Camera/Block/image_points.csv"
    table = read_image_points(path)
    seen, uv = table.observations, table.observations.uv.copy()
    rows = np.isin(seen.image, [k for k, name in enumerate(table.images) if name >= first])
    c, f = np.array([camera.of("cx"), camera.of("cy")]), camera.of("f")
    uv[rows] = c + (uv[rows] - c) * (f + df_px) / f + (dx_px, 0.0)
    write_image_points(replace(table, observations=replace(seen, uv=uv)), path)
    return np.array([df_px, dx_px])


def test_a_camera_of_a_part_of_the_flight(flown, adjusted, tmp_path) -> None:
    """Oracle: a camera that was knocked between two images, by 6 px of f and 3 px of the principal
    point, exactly: the parameters of both parts differ by as much, by chi-square (99.9 %), poses
    are those of the whole camera's block within their sigmas; one camera alone leaves residuals.
    """
    copied = flown.copied(tmp_path / "flight")
    first = adjusted.solved.result.problem.block.images[26]
    planted = knocked(copied.directory, first)
    block = copied.block
    one = adjust(block, write=False)
    parts = adjust(replace(block, camera=replace(block.camera, new_from=(first,))), write=False)
    solved = parts.solved
    assert [camera["images"] for camera in parts.figures["cameras"]] == [26, 27]
    assert solved.result.problem.block.cameras[1].name.endswith(f" from {first}")
    interior, precision = solved.result.values.interior, solved.precision
    columns = [INTERIOR.index("f"), INTERIOR.index("cx")]
    at = [list(solved.result.problem.layout.columns).index(k) for k in columns]
    n = len(solved.result.problem.layout.columns)
    cov = precision.cov(("camera", 0), ("camera", 1))
    J = np.zeros((2, 2 * n))
    J[[0, 1], at], J[[0, 1], np.add(at, n)] = -1.0, 1.0
    off = (interior[1] - interior[0])[columns] - planted
    assert off @ np.linalg.solve(J @ cov @ J.T, off) < chi2.ppf(0.999, 2)
    sigma = np.sqrt(np.diagonal(precision.pose_cov, axis1=1, axis2=2))[:, :3]
    moved = solved.result.values.position - adjusted.solved.result.values.position
    assert np.abs(moved / sigma).max() < 3.0
    assert parts.figures["verdict"] == "consistent"
    assert one.solved.factors["image observations"] > 1.25
    assert all(abs(factor - 1.0) < 0.15 for factor in solved.factors.values())


def test_parts_that_cannot_be(flown) -> None:
    """Oracle: an image that is none, and parts of a camera that is held, are refused by name."""
    block = flown.block
    with pytest.raises(InputError, match=r"camera\.new_from: .none\.tif. is no image of the block"):
        adjust(replace(block, camera=replace(block.camera, new_from=("none.tif",))), write=False)
    with pytest.raises(OptionError, match=r"camera\.weighed fixes one camera for all images"):
        replace(block, camera=replace(block.camera, new_from=("a.tif",), weighed=True))
