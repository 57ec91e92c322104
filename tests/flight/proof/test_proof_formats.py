"""Every export, read by a reader that knows nothing of its writer, puts the points of the scene on
their pixels within 0.01 px.

The `CASES` of each module of `readers` say, for each way to read a format, the export's name, the
reader, and in which frames. Each mistake of `readers.mistakes` that the format allows must cost
more than `NOTICED_PX`, so that the scene would show it.
"""

import struct
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
import scene
from oracles import oracle
from readers import mistakes
from readers.case import Case, export_of
from readers.geometry import Frame, Poses, Table, turn, up_axes

LIMIT_PX, NOTICED_PX = 0.01, 1.0
CASES: dict[str, Case] = {
    name: case
    for module in sorted((Path(__file__).parent / "readers").glob("*.py"))
    for name, case in getattr(import_module(f"readers.{module.stem}"), "CASES", {}).items()
}
PLACES = [  # the first frame of each format is quick; the others go by the same writer
    pytest.param(name, where, id=f"{name} {where}", marks=[pytest.mark.slow] if k else [])
    for name, case in CASES.items()
    for k, where in enumerate(case.frames)
]


def tiny_tiff() -> bytes:
    """One grey pixel."""
    entries = [
        (256, 3, 1),
        (257, 3, 1),
        (258, 3, 8),
        (259, 3, 1),
        (262, 3, 1),
        (273, 4, 8),
        (277, 3, 1),
        (278, 3, 1),
        (279, 4, 1),
    ]
    head = b"II*\0" + struct.pack("<I", 10) + b"\x80\0"
    return (
        head
        + struct.pack("<H", len(entries))
        + b"".join(struct.pack("<HHII", tag, kind, 1, v) for tag, kind, v in entries)
        + b"\0" * 4
    )


def tiny_jpeg() -> bytes:
    """Its head, which is all that a writer of tags looks at: JFIF, then a table of quantisation."""
    return (
        b"\xff\xd8\xff\xe0\0\x10JFIF\0\1\1\0\0\1\0\1\0\0\xff\xdb\0\x43\0"
        + bytes(range(1, 65))
        + b"\xff\xd9"
    )


def written(name: str, where: str, directory: Path) -> Table:
    """The case's file, written and read."""
    case, export = CASES[name], export_of(name)
    options = dict(case.options)
    if name == "colmap_priors":
        oracle("pycolmap")
    if "images" in export.needs:
        images = directory / "images"
        images.mkdir()
        for k, name in enumerate(scene.NAMES):  # what they are is told by their first bytes
            (images / name).write_bytes(tiny_jpeg() if k % 2 else tiny_tiff())
        options["images"] = images
    path = directory / export.product
    export.write(scene.master() if where == "master" else scene.framed(where), path, **options)
    return case.read(path)


def seen(case: Case, table: Table, where: str) -> Poses:
    """Its poses; the antenna's positions taken back to the camera by the true attitude."""
    poses = case.poses(table, scene.FRAMES.get(where, Frame()))
    if "lever_m" in case.options:
        poses = Poses(poses.names, poses.centre - scene.TRUTH.axes @ scene.LEVER_C, None)
    return poses


@pytest.mark.parametrize(("name", "where"), PLACES)
def test_points_fall_on_their_pixels(name: str, where: str, tmp_path: Path) -> None:
    """Oracle: the scene's pinhole and an independent reader."""
    case = CASES[name]
    table = written(name, where, tmp_path)
    off = scene.residuals(seen(case, table, where))
    assert off.size >= 3 * len(scene.POINTS)
    assert off.max() < LIMIT_PX


def costs(name: str, where: str, directory: Path) -> Iterator[tuple[str, float]]:
    """Each mistake that the format allows in this frame, and the median of the residuals that it
    makes, px.
    """
    case = CASES[name]
    table = written(name, where, directory)
    changes = [
        *mistakes.of_attitude(case.attitude),
        *(mistakes.of_place(case.place) if case.place else ()),
    ]
    for what, change in changes:
        if where != "geocentric" or not what.startswith("height"):
            yield what, float(np.median(scene.residuals(seen(case, change(table), where))))
    right = seen(case, table, where)
    wrong = {
        "grid north for true north, or the plane's axes for the place's": mistakes.other_north(
            right, scene.FRAMES.get(where, Frame())
        ),
        "image turned by 90 deg": mistakes.quarter_turn(right),
        "bore-sight left out": mistakes.without_boresight(right, scene.B, scene.T),
        "lever arm applied twice": mistakes.shifted(right, scene.LEVER_C, scene.TRUTH.axes),
    }
    yield from (
        (what, float(np.median(scene.residuals(poses))))
        for what, poses in wrong.items()
        if poses is not None
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "where"), [place for place in PLACES if place.values[0] != "g2o edges"]
)  # its vertices are in g2o
def test_wrong_conventions_are_noticed(name: str, where: str, tmp_path: Path) -> None:
    """Oracle: a hundred times the limit."""
    found = dict(costs(name, where, tmp_path))
    assert found
    assert {what: px for what, px in found.items() if not px > NOTICED_PX} == {}


@pytest.mark.parametrize("where", CASES["colmap_priors"].frames)
def test_gravity_of_a_pose_prior_points_down(where: str, tmp_path: Path) -> None:
    """Oracle: the true attitude and the vertical at the camera; the limit as an angle of the
    image.
    """
    table = written("colmap_priors", where, tmp_path)
    place = scene.PLANE.geographic(scene.CAMERAS)
    down = -(turn(scene.TRUTH.axes) @ up_axes(place[:, 0], place[:, 1])[:, :, 2:])[:, :, 0]
    assert np.linalg.norm(np.cross(table["down"], down), axis=1).max() * scene.FOCAL_PX < LIMIT_PX
    assert ((table["down"] * down).sum(axis=1) > 0.0).all()
