"""eo.json, formats.md E1: camera axes right, down, view; the tangent plane and, for a check,
quaternions w x y z and ECEF.
"""

import json
from pathlib import Path

import numpy as np

from .case import Case
from .geometry import Array, Frame, Poses, Table, Tangent, quaternion


def read(path: Path) -> Table:
    content = json.loads(path.read_text(encoding="utf-8"))
    images = content["images"]

    def column(*keys: str) -> Array:
        values = images
        for key in keys:
            values = [value[key] for value in values]
        return np.array(values)

    lat, lon, height = content["tangent_plane"]["origin_lat_lon_rad_height_m"]
    columns = dict(zip("xyz", column("position_m").T, strict=True)) | {
        "R": column("C_mc"),
        "q": column("quaternion_wxyz"),
    }
    columns |= {"ecef": column("ecef", "position_m"), "q_ecef": column("ecef", "quaternion_wxyz")}
    columns["origin"] = np.array([np.degrees(lon), np.degrees(lat), height])
    return Table([image["image"] for image in images], columns)


def poses(table: Table, frame: Frame) -> Poses:
    plane, x = Tangent(*table["origin"].tolist()), table.place()
    return Poses(table.names, plane.ecef(x), plane.axes(x) @ table["R"])


def poses_quaternion(table: Table, frame: Frame) -> Poses:
    plane, x = Tangent(*table["origin"].tolist()), table.place()
    return Poses(table.names, plane.ecef(x), plane.axes(x) @ quaternion(table["q"]))


def poses_ecef(table: Table, frame: Frame) -> Poses:
    return Poses(table.names, table["ecef"], quaternion(table["q_ecef"]))


CASES = {
    "eo_json": Case(read, poses, ("master",), "matrix"),
    "eo_json quaternion": Case(read, poses_quaternion, ("master",), "quaternion"),
    "eo_json ecef": Case(read, poses_ecef, ("master",), "", ()),
}
