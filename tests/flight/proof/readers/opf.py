"""OPF, formats.md B2.5: omega_phi_kappa, Rx Ry Rz takes right-top-back of the image into the axes
of the CRS.

Input cameras hold coordinates in the order of the axes of their own CRS (EPSG:4979: latitude
first), projected input cameras those of the processing CRS after base_to_canonical, which here only
shifts.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np

from .case import CAMERA, GRIDS, UTM, XYZ, Case
from .geometry import D, Frame, Poses, Projected, Table, opk


def _items(directory: Path) -> dict[str, Any]:
    project = json.loads((directory / "project.opf").read_text(encoding="utf-8"))
    return {
        item["type"]: json.loads(
            (directory / item["resources"][0]["uri"]).read_text(encoding="utf-8")
        )
        for item in project["items"]
    }


def read(path: Path) -> Table:
    items = _items(path)
    file = {
        camera["id"]: camera["uri"].rpartition("/")[2] for camera in items["camera_list"]["cameras"]
    }
    captures = items["input_cameras"]["captures"]
    place = [capture["geolocation"] for capture in captures]
    attitude = [capture["orientation"] for capture in captures]
    assert {p["crs"]["definition"] for p in place} == {"EPSG:4979"}
    assert {a["type"] for a in attitude} == {"omega_phi_kappa"}
    (crs,) = {a["crs"] for a in attitude}
    columns = dict(
        zip(("lat", "lon", "h"), np.array([p["coordinates"] for p in place]).T, strict=True)
    )
    columns |= dict(
        zip(("omega", "phi", "kappa"), np.array([a["angles_deg"] for a in attitude]).T, strict=True)
    )
    return Table(
        [file[capture["reference_camera_id"]] for capture in captures], columns, {"crs": crs}
    )


def poses(table: Table, frame: Frame) -> Poses:
    place = table.place("lon", "lat", "h")
    grid = Projected(table.said["crs"])
    x = grid.coordinates(Frame().ecef(place))
    return Poses(
        table.names,
        Frame().ecef(place),
        grid.axes(x) @ opk(table["omega"], table["phi"], table["kappa"]) @ D,
    )


def read_projected(path: Path) -> Table:
    items = _items(path)
    scene = items["scene_reference_frame"]
    to_canonical = scene["base_to_canonical"]
    assert to_canonical["scale"] == [1, 1, 1]
    assert not to_canonical["swap_xy"]
    captures = items["projected_input_cameras"]["captures"]
    x = np.array([c["geolocation"]["position"] for c in captures]) - to_canonical["shift"]
    angles = np.array([c["orientation"]["angles_deg"] for c in captures])
    file = {
        camera["id"]: camera["uri"].rpartition("/")[2] for camera in items["camera_list"]["cameras"]
    }
    name = {c["id"]: file[c["reference_camera_id"]] for c in items["input_cameras"]["captures"]}
    columns = dict(zip("xyz", x.T, strict=True)) | dict(
        zip(("omega", "phi", "kappa"), angles.T, strict=True)
    )
    return Table([name[c["id"]] for c in captures], columns, {"crs": scene["crs"]["definition"]})


def poses_projected(table: Table, frame: Frame) -> Poses:
    grid, x = Projected(table.said["crs"]), table.place()
    return Poses(
        table.names,
        grid.ecef(x),
        grid.axes(x) @ opk(table["omega"], table["phi"], table["kappa"]) @ D,
    )


CASES = {
    "opf": Case(
        read, poses, GRIDS, "opk", ("lon", "lat", "h"), {"camera": CAMERA, "pixel_size_um": 1.4}
    ),
    "opf projected": Case(
        read_projected,
        poses_projected,
        (UTM,),
        "opk",
        XYZ,
        {"camera": CAMERA, "pixel_size_um": 1.4},
    ),
}
