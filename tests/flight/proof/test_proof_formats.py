"""Every export, read by a reader that knows nothing of its writer, puts the points of the scene on
their pixels within 0.01 px.

`CASES` says, for each way to read a format, the writer's name in the registry, the reader, and in
which frames. Each mistake of `readers.mistakes` that the format allows must cost more than
`NOTICED_PX`, so that the scene would show it.
"""

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scene
from oracles import oracle
from readers import (
    bentley,
    colmap,
    generic,
    gis,
    graphs,
    inpho,
    local_plane,
    master,
    metashape,
    micmac,
    mistakes,
    odm,
    opensfm,
    opf,
    pix4d,
    realitycapture,
    rtklib,
    tags,
)
from readers.geometry import Frame, Poses, Table, turn, up_axes

from insgnss.io.formats.exports import function_at

LIMIT_PX, NOTICED_PX = 0.01, 1.0
LOCAL, GLOBE, SPACE, LV95, UTM, NORTH_FIRST = (
    "tangent plane",
    "geographic",
    "geocentric",
    "EPSG:2056",
    "EPSG:32632",
    "EPSG:3044",
)
GRIDS = (LV95, UTM)
CAMERA = "PINHOLE 5120 3840 5607 5607 2590.4 1971.9"
XYZ = ("x", "y", "z")


@dataclass(frozen=True)
class Case:
    """One way to read one format.

    writer, product : module and function in `insgnss.io.formats`, file name.
    read, poses : of the reader.
    frames : to be proven in.
    attitude : key of `mistakes.of_attitude`.
    place : columns of the coordinates.
    own_north : angles count from the frame's axes.
    """

    writer: str
    product: str
    read: Callable[[Path], Table]
    poses: Callable[[Table, Frame], Poses]
    frames: tuple[str, ...]
    attitude: str = ""
    place: tuple[str, str, str] = XYZ
    options: dict[str, Any] = field(default_factory=dict)


def _generic(columns: str, frames: tuple[str, ...], kind: str, **options: Any) -> Case:
    body = (scene.T @ scene.B).T  # camera (right, down, view) into the body
    place = ("lon", "lat", "h") if columns.startswith("image llh") else XYZ
    options |= {"columns": columns}
    writer = "orientation.generic_ascii:write_generic_ascii"
    return Case(
        writer,
        "table.txt",
        generic.read,
        partial(generic.poses, body=body),
        frames,
        kind,
        place,
        options,
    )


def _at_sea(poses: Callable[..., Poses]) -> Callable[[Table, Frame], Poses]:
    return partial(poses, undulation_m=scene.UNDULATION_M)


EVERY = (LOCAL, GLOBE, SPACE, *GRIDS)
EARTH = (LOCAL, GLOBE, *GRIDS, NORTH_FIRST)
SEA = {"undulation_m": scene.UNDULATION_M}
OPF = {"camera": CAMERA, "pixel_size_um": 1.4}
LEVER = {"lever_m": scene.LEVER_C}
CASES: dict[str, Case] = {
    "eo_local_plane": Case(
        "orientation.eo_local_plane:write_eo_local_plane",
        "eo.txt",
        local_plane.read,
        local_plane.poses,
        (LOCAL,),
        "opk",
    ),
    "metashape": Case(
        "bundle.metashape:write_metashape",
        "m.csv",
        metashape.read,
        metashape.poses,
        (LOCAL, GLOBE, *GRIDS),
        "ypr",
    ),
    "metashape_opk": Case(
        "bundle.metashape:write_metashape_opk",
        "m.csv",
        metashape.read_opk,
        metashape.poses_opk,
        EARTH,
        "opk",
    ),
    "metashape_offset": Case(
        "bundle.metashape:write_metashape_offset",
        "m.csv",
        metashape.read_offset,
        metashape.poses_offset,
        (LOCAL, GLOBE, *GRIDS),
        "ypr",
    ),
    "pix4d_matic": Case(
        "bundle.pix4d:write_pix4d_matic",
        "p.csv",
        pix4d.read,
        pix4d.poses,
        (GLOBE, *GRIDS, NORTH_FIRST),
        "ypr",
        ("first", "second", "z"),
    ),
    "pix4d_mapper": Case(
        "bundle.pix4d:write_pix4d_mapper",
        "p.csv",
        pix4d.read_mapper,
        pix4d.poses_mapper,
        (LOCAL, *GRIDS),
        "opk",
    ),
    "odm": Case("bundle.odm:write_odm_geo", "geo.txt", odm.read, odm.poses, (GLOBE, *GRIDS)),
    "opensfm": Case(
        "bundle.opensfm:write_opensfm",
        "exif_overrides.json",
        opensfm.read,
        opensfm.poses,
        (LOCAL,),
        "opk",
        ("lon", "lat", "z"),
    ),
    "micmac": Case(
        "bundle.micmac:write_micmac", "m.txt", micmac.read, micmac.poses, (LOCAL, SPACE), "opk"
    ),
    "micmac_xml": Case(
        "bundle.micmac:write_micmac_xml",
        "Ori-Nav",
        micmac.read_xml,
        micmac.poses_xml,
        (LOCAL, SPACE),
        "matrix",
    ),
    "realitycapture": Case(
        "bundle.realitycapture:write_realitycapture",
        "r.csv",
        realitycapture.read,
        realitycapture.poses,
        (LOCAL, GLOBE),
        "ypr",
    ),
    "realitycapture_accuracy": Case(
        "bundle.realitycapture:write_realitycapture_accuracy",
        "r.csv",
        realitycapture.read,
        realitycapture.poses,
        (LOCAL, GLOBE),
        "ypr",
    ),
    "bentley": Case(
        "bundle.bentley:write_bentley", "b.xml", bentley.read, bentley.poses, EARTH, "matrix"
    ),
    "inpho_prj": Case(
        "bundle.inpho:write_inpho_prj",
        "i.prj",
        inpho.read_prj,
        inpho.poses_prj,
        (LOCAL, *GRIDS),
        "matrix",
        options={"focal_mm": 7.85, "ground_m": 518.0},
    ),
    "inpho_ascii": Case(
        "bundle.inpho:write_inpho_ascii", "i.txt", inpho.read, inpho.poses, (LOCAL, *GRIDS), "opk"
    ),
    "generic_ascii": _generic("image xyz opk", EVERY, "opk"),
    "generic_ascii pok": _generic("image xyz pok", EVERY, "pok", unit="gon", delimiter="comma"),
    "generic_ascii ypr": _generic(
        "image xyz ypr", (LOCAL, GLOBE, *GRIDS), "ypr", delimiter="semicolon"
    ),
    "generic_ascii grid ypr": _generic("image xyz ypr", (LOCAL, *GRIDS), "ypr", north="frame"),
    "generic_ascii ned": _generic("image llh xyz ned", (LOCAL, GLOBE, *GRIDS), "ned", unit="rad"),
    "generic_ascii gimbal": _generic("image xyz gimbal", (LOCAL, GLOBE, *GRIDS), "ned"),
    "generic_ascii inverse": _generic(
        "image xyz opk",
        EVERY,
        "opk",
        attitude="frame to camera",
        camera_axes="CV",
        decimals_angle=8,
    ),
    "generic_ascii matrix": _generic("image xyz matrix", EVERY, "matrix", delimiter="tab"),
    "generic_ascii quaternion": _generic("image xyz quaternion", EVERY, "matrix", camera_axes="CV"),
    "eo_json": Case(
        "orientation.eo_json:write_eo_json",
        "eo.json",
        master.read,
        master.poses,
        ("master",),
        "matrix",
    ),
    "eo_json quaternion": Case(
        "orientation.eo_json:write_eo_json",
        "eo.json",
        master.read,
        master.poses_quaternion,
        ("master",),
        "quaternion",
    ),
    "eo_json ecef": Case(
        "orientation.eo_json:write_eo_json",
        "eo.json",
        master.read,
        master.poses_ecef,
        ("master",),
        "",
        (),
    ),  # type: ignore[arg-type]
    "colmap": Case(
        "bundle.colmap:write_colmap",
        "model",
        colmap.read,
        colmap.poses,
        (LOCAL, SPACE, *GRIDS),
        "quaternion",
        options={"camera": CAMERA},
    ),
    "colmap_priors": Case(
        "bundle.colmap:write_colmap_priors",
        "database.db",
        colmap.read_priors,
        colmap.poses_priors,
        (LOCAL, GLOBE, SPACE, *GRIDS),
        options={"camera": CAMERA},
    ),
    "opf": Case(
        "bundle.opf:write_opf", "opf", opf.read, opf.poses, GRIDS, "opk", ("lon", "lat", "h"), OPF
    ),
    "opf projected": Case(
        "bundle.opf:write_opf",
        "opf",
        opf.read_projected,
        opf.poses_projected,
        (UTM,),
        "opk",
        XYZ,
        OPF,
    ),
    "tum": Case(
        "orientation.tum:write_tum",
        "t.tum",
        graphs.read_tum,
        graphs.poses,
        (LOCAL, SPACE, *GRIDS),
        "quaternion",
    ),
    "g2o": Case(
        "orientation.g2o:write_g2o",
        "g.g2o",
        graphs.read_g2o,
        graphs.poses,
        (LOCAL, SPACE, *GRIDS),
        "quaternion",
    ),
    "g2o edges": Case(
        "orientation.g2o:write_g2o",
        "g.g2o",
        graphs.read_g2o,
        graphs.poses_by_edges,
        (LOCAL, SPACE),
        "quaternion",
    ),
    "geojson": Case(
        "gis.geojson:write_geojson", "g.geojson", gis.read_geojson, gis.poses_geojson, EVERY, "ypr"
    ),
    "geojson opk": Case(
        "gis.geojson:write_geojson",
        "g.geojson",
        gis.read_geojson,
        gis.poses_geojson_opk,
        EVERY,
        "opk",
    ),
    "geojson orthority": Case(
        "gis.geojson:write_geojson",
        "g.geojson",
        gis.read_orthority,
        gis.poses_orthority,
        GRIDS,
        "opk",
        ("X", "Y", "Z"),
        {"dialect": "orthority"},
    ),
    "kml": Case(
        "gis.kml:write_kml",
        "k.kml",
        gis.read_kml,
        _at_sea(gis.poses_kml),
        (GLOBE, LV95),
        "kml",
        options=SEA,
    ),
    "geopackage": Case(
        "gis.geopackage:write_geopackage",
        "g.gpkg",
        gis.read_geopackage,
        gis.poses_geopackage,
        (LOCAL, GLOBE, *GRIDS, NORTH_FIRST),
        "quaternion",
    ),
    "geopackage opk": Case(
        "gis.geopackage:write_geopackage",
        "g.gpkg",
        gis.read_geopackage,
        gis.poses_geopackage_opk,
        (LOCAL, GLOBE, *GRIDS),
        "opk",
    ),
    "geopackage ypr": Case(
        "gis.geopackage:write_geopackage",
        "g.gpkg",
        gis.read_geopackage,
        gis.poses_geopackage_ypr,
        (LOCAL, GLOBE, *GRIDS),
        "ypr",
    ),
    "image_tags": Case(
        "images.image_tags:write_image_tags",
        "tagged",
        tags.read,
        _at_sea(tags.poses),
        (GLOBE, LV95),
        "ypr",
    ),
    "image_tags sea level": Case(
        "images.image_tags:write_image_tags",
        "tagged",
        tags.read,
        _at_sea(tags.poses),
        (GLOBE,),
        "ypr",
        options=SEA | {"heights": "sea level"},
    ),
    "image_tags gimbal": Case(
        "images.image_tags:write_image_tags",
        "tagged",
        tags.read,
        _at_sea(tags.poses_gimbal),
        (GLOBE,),
        options={"gimbal": "exact"},
    ),
    "rtklib_pos": Case(
        "gnss.rtklib_pos_write:write_antenna_pos",
        "a.pos",
        rtklib.read,
        rtklib.poses,
        (GLOBE, LV95),
        options=LEVER,
    ),
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


def written(case: Case, where: str, directory: Path) -> Table:
    """The case's file, written and read."""
    options = dict(case.options)
    if case.writer == "bundle.colmap:write_colmap_priors":
        oracle("pycolmap")
    if case.writer.startswith("images.image_tags"):
        images = directory / "images"
        images.mkdir()
        for k, name in enumerate(scene.NAMES):  # what they are is told by their first bytes
            (images / name).write_bytes(tiny_jpeg() if k % 2 else tiny_tiff())
        options["images"] = images
    path = directory / case.product
    function_at(case.writer)(
        scene.master() if where == "master" else scene.framed(where), path, **options
    )
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
    table = written(case, where, tmp_path)
    off = scene.residuals(seen(case, table, where))
    assert off.size >= 3 * len(scene.POINTS)
    assert off.max() < LIMIT_PX


def costs(name: str, where: str, directory: Path) -> Iterator[tuple[str, float]]:
    """Each mistake that the format allows in this frame, and the median of the residuals that it
    makes, px.
    """
    case = CASES[name]
    table = written(case, where, directory)
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
    case = CASES["colmap_priors"]
    table = written(case, where, tmp_path)
    place = scene.PLANE.geographic(scene.CAMERAS)
    down = -(turn(scene.TRUTH.axes) @ up_axes(place[:, 0], place[:, 1])[:, :, 2:])[:, :, 0]
    assert np.linalg.norm(np.cross(table["down"], down), axis=1).max() * scene.FOCAL_PX < LIMIT_PX
    assert ((table["down"] * down).sum(axis=1) > 0.0).all()
