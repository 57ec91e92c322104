"""Tables whose columns and conventions somebody says: the generic ASCII table by its header, and
the presets by formats.md B10.

Angle sets C1: opk and pok take the camera's axes into the frame's or back; ypr, ned and gimbal
count from north: ned of the body (forward, right, down), of which the camera is C = R
T-and-bore-sight, gimbal of (view, right, down) of the camera.
"""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import scene

from .case import EVERY, GLOBE, GRIDS, LOCAL, XYZ, Case
from .geometry import GIMBAL, SETS, D, Frame, Poses, S, Table, ned, quaternion, turn, ypr
from .lines import comments, named, rows

UNITS = {"deg": 1.0, "gon": 0.9, "rad": 180.0 / np.pi}
SEPARATORS = {"blank": None, "comma": ",", "semicolon": ";", "tab": "\t"}


def read(path: Path) -> Table:
    """By the header's `key: value` lines; the column names stand in its last one."""
    *head, last = comments(path)
    said = dict(line.split(": ", 1) for line in head if ": " in line)
    separator = next((s for s in (",", ";", "\t") if s in last), None)
    columns = [name.strip() for name in last.split(separator)]
    names, values = named(
        rows(path, separator), " ".join("name" if c == "image" else c for c in columns)
    )
    factor = UNITS[said["angle unit"]]
    plain = ("x", "y", "z", "lat", "lon", "h", "tow", "week", "number", "qw", "qx", "qy", "qz")
    values = {
        c: v if c in plain or c.startswith(("s", "r1", "r2", "r3")) else v * factor
        for c, v in values.items()
    }
    if "r11" in values:
        values["R"] = np.column_stack(
            [values[f"r{i}{j}"] for i in (1, 2, 3) for j in (1, 2, 3)]
        ).reshape(-1, 3, 3)
    if "qw" in values:
        values["R"] = quaternion(np.column_stack([values[f"q{c}"] for c in "wxyz"]))
    for long, short in (("_pok", ""), ("_ned", ""), ("gimbal_", "")):
        values |= {
            c.replace(long, short): v
            for c, v in values.items()
            if long in c and not c.startswith("s_")
        }
    kind = (
        "ypr"
        if "yaw" in columns
        else "ned"
        if "yaw_ned" in columns
        else "gimbal"
        if "gimbal_yaw" in columns
        else ""
    )
    kind = kind or ("R" if "R" in values else "pok" if "phi_pok" in columns else "opk")
    return Table(names, values, said | {"kind": kind})


def poses(table: Table, frame: Frame, body: np.ndarray | None = None) -> Poses:
    """body : (3, 3), camera (right, down, view) into the body, for angles of the body."""
    if "lat" in table.columns:
        x = table.place("lon", "lat", "h")
        centre, frame = Frame().ecef(x), frame
        x = x if type(frame) is Frame else table.place() if "x" in table.columns else x
    else:
        x = table.place()
        centre = frame.ecef(x)
    north = frame.axes(x) if table.said["north"] == "frame" else frame.north(x)
    kind = table.said["kind"]
    if kind == "ypr":
        return Poses(
            table.names, centre, north @ ypr(table["yaw"], table["pitch"], table["roll"]) @ D
        )
    if kind == "gimbal":
        return Poses(
            table.names,
            centre,
            north @ S @ ned(table["roll"], table["pitch"], table["yaw"]) @ GIMBAL.T,
        )
    if kind == "ned":
        assert body is not None
        return Poses(
            table.names, centre, north @ S @ ned(table["roll"], table["pitch"], table["yaw"]) @ body
        )
    if kind == "R":
        R = table["R"]
    else:
        columns, compose, _ = SETS[kind]
        R = compose(*(table[c] for c in columns))
    R = R if table.said["attitude"] == "camera to frame" else turn(R)
    return Poses(
        table.names,
        centre,
        frame.axes(x) @ (R @ D if table.said["camera axes"].startswith("RUB") else R),
    )


def _case(columns: str, frames: tuple[str, ...], kind: str, **options: Any) -> Case:
    place = ("lon", "lat", "h") if columns.startswith("image llh") else XYZ
    body = (scene.T @ scene.B).T  # camera (right, down, view) into the body
    return Case(
        read, partial(poses, body=body), frames, kind, place, {"columns": columns, **options}
    )


CASES = {
    "generic_ascii": _case("image xyz opk", EVERY, "opk"),
    "generic_ascii pok": _case("image xyz pok", EVERY, "pok", unit="gon", delimiter="comma"),
    "generic_ascii ypr": _case(
        "image xyz ypr", (LOCAL, GLOBE, *GRIDS), "ypr", delimiter="semicolon"
    ),
    "generic_ascii grid ypr": _case("image xyz ypr", (LOCAL, *GRIDS), "ypr", north="frame"),
    "generic_ascii ned": _case("image llh xyz ned", (LOCAL, GLOBE, *GRIDS), "ned", unit="rad"),
    "generic_ascii gimbal": _case("image xyz gimbal", (LOCAL, GLOBE, *GRIDS), "ned"),
    "generic_ascii inverse": _case(
        "image xyz opk",
        EVERY,
        "opk",
        attitude="frame to camera",
        camera_axes="CV",
        decimals_angle=8,
    ),
    "generic_ascii matrix": _case("image xyz matrix", EVERY, "matrix", delimiter="tab"),
    "generic_ascii quaternion": _case("image xyz quaternion", EVERY, "matrix", camera_axes="CV"),
}
