"""Exif and XMP of TIFF and JPEG files, formats.md B13, B2.3 and B10.

Exif   GPS directory 0x8825: references 1, 3, 5, values 2, 4 (degrees, minutes, seconds), 6;
       GPSAltitudeRef of Exif 3.0: 0 ellipsoid, 2 sea level, of older ones 0 sea level
XMP    Camera:Yaw, Pitch, Roll of Pix4D as Metashape's; drone-dji:Gimbal... of (view, right, down)
       of the camera in north, east, down
"""

import re
import struct
from pathlib import Path

import numpy as np
import scene

from .case import GLOBE, LV95, Case, at_sea
from .geometry import GIMBAL, Array, D, Frame, Poses, S, Table, ned, ypr

SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 7: 1, 10: 8}


def _directory(data: bytes, offset: int) -> dict[int, tuple[int, bytes]]:
    """Type and bytes of the values by tag."""
    out = {}
    for k in range(struct.unpack_from("<H", data, offset)[0]):
        tag, kind, count, field = struct.unpack_from("<HHI4s", data, offset + 2 + 12 * k)
        size = SIZES[kind] * count
        start = struct.unpack("<I", field)[0]
        out[tag] = (kind, field[:size] if size <= 4 else data[start : start + size])
    return out


def _pairs(value: tuple[int, bytes]) -> list[float]:
    flat = struct.unpack(f"<{len(value[1]) // 4}{'i' if value[0] == 10 else 'I'}", value[1])
    return [a / b for a, b in zip(flat[::2], flat[1::2], strict=True)]


def _exif_and_xmp(data: bytes) -> tuple[bytes, str]:
    """The TIFF that holds the tags, and the XMP packet."""
    if data[:2] == b"II":
        first = _directory(data, struct.unpack_from("<I", data, 4)[0])
        return data, first[700][1].decode("utf-8")
    assert data[:2] == b"\xff\xd8"
    exif, xmp, at = b"", "", 2
    while data[at + 1] in (0xE0, 0xE1):
        content = data[at + 4 : at + 2 + struct.unpack_from(">H", data, at + 2)[0]]
        exif = content[6:] if content.startswith(b"Exif\0\0") else exif
        xmp = (
            content.partition(b"\0")[2].decode("utf-8")
            if content.startswith(b"http://ns.adobe.com/xap/1.0/\0")
            else xmp
        )
        at += 2 + struct.unpack_from(">H", data, at + 2)[0]
    return exif, xmp


def read(path: Path) -> Table:
    """All images of a directory."""
    files = sorted(path.iterdir())
    rows: list[list[float]] = []
    for file in files:
        exif, xmp = _exif_and_xmp(file.read_bytes())
        first = _directory(exif, struct.unpack_from("<I", exif, 4)[0])
        gps = _directory(exif, struct.unpack("<I", first[0x8825][1])[0])
        version = _directory(exif, struct.unpack("<I", first[0x8769][1])[0])[0x9000][1]
        angle = {tag: np.dot(_pairs(gps[tag]), [1.0, 1.0 / 60.0, 1.0 / 3600.0]) for tag in (2, 4)}
        lat = angle[2] * (-1.0 if gps[1][1][:1] == b"S" else 1.0)
        lon = angle[4] * (-1.0 if gps[3][1][:1] == b"W" else 1.0)
        reference = gps[5][1][0]
        sea_level = reference >= 2 if version >= b"0300" else True
        row = [lon, lat, _pairs(gps[6])[0] * (-1.0 if reference % 2 else 1.0), float(sea_level)]
        for name in ("Camera:Yaw", "Camera:Pitch", "Camera:Roll"):
            row.append(float(re.search(rf'{name}="([^"]*)"', xmp)[1]))  # type: ignore[index]
        for name in ("Yaw", "Pitch", "Roll"):
            angle = re.search(rf'drone-dji:Gimbal{name}Degree="([^"]*)"', xmp)
            row.append(float(angle[1]) if angle else float("nan"))
        rows.append(row)
    names = [
        "x",
        "y",
        "z",
        "sea_level",
        "yaw",
        "pitch",
        "roll",
        "gimbal_yaw",
        "gimbal_pitch",
        "gimbal_roll",
    ]
    return Table([file.name for file in files], dict(zip(names, np.array(rows).T, strict=True)))


def _place(table: Table, undulation_m: float) -> Array:
    return table.place() + np.outer(table["sea_level"], [0.0, 0.0, undulation_m])


def poses(table: Table, frame: Frame, undulation_m: float) -> Poses:
    x = _place(table, undulation_m)
    return Poses(
        table.names,
        Frame().ecef(x),
        Frame().axes(x) @ ypr(table["yaw"], table["pitch"], table["roll"]) @ D,
    )


def poses_gimbal(table: Table, frame: Frame, undulation_m: float) -> Poses:
    x = _place(table, undulation_m)
    R_ned = ned(table["gimbal_roll"], table["gimbal_pitch"], table["gimbal_yaw"])
    return Poses(table.names, Frame().ecef(x), Frame().axes(x) @ S @ R_ned @ GIMBAL.T)


CASES = {
    "image_tags": Case(read, at_sea(poses), (GLOBE, LV95), "ypr"),
    "image_tags sea level": Case(
        read,
        at_sea(poses),
        (GLOBE,),
        "ypr",
        options={"undulation_m": scene.UNDULATION_M, "heights": "sea level"},
    ),
    "image_tags gimbal": Case(read, at_sea(poses_gimbal), (GLOBE,), options={"gimbal": "exact"}),
}
