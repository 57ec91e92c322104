"""BlocksExchange, formats.md B8: M takes the world into the camera, whose axes CameraOrientation
names; an SRS is a code or ENU:lat,lon.
"""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from .case import EARTH, Case
from .geometry import D, Frame, Poses, Projected, Table, Tangent, turn
from .lines import numbers


def read(path: Path) -> Table:
    root = ElementTree.parse(path).getroot()
    photos = root.findall(".//Photo")
    pose = [photo.find("Pose/Metadata") for photo in photos]
    assert all(p is not None and p.findtext("SRSId") == root.findtext(".//SRS/Id") for p in pose)
    x = np.array(
        [[float(p.findtext(f"Center/{axis}", "")) for axis in "xyz"] for p in pose if p is not None]
    )
    M = [
        [[float(p.findtext(f"Rotation/M_{i}{j}", "")) for j in range(3)] for i in range(3)]
        for p in pose
        if p is not None
    ]
    said = {
        "srs": root.findtext(".//SRS/Definition", ""),
        "camera": root.findtext(".//CameraOrientation", "XRightYDown"),
    }
    return Table(
        [p.findtext("ImagePath", "") for p in photos],
        dict(zip("xyz", x.T, strict=True)) | {"R": np.array(M)},
        said,
    )


def poses(table: Table, frame: Frame) -> Poses:
    srs = table.said["srs"]
    own = (
        Frame()
        if srs == "EPSG:4326"
        else Projected(srs)
        if srs.startswith("EPSG")
        else Tangent(*numbers(srs)[::-1], 0.0)
    )
    x = table.place()
    R = own.axes(x) @ turn(table["R"])
    return Poses(table.names, own.ecef(x), R if table.said["camera"] == "XRightYDown" else R @ D)


CASES = {
    "bentley": Case(read, poses, EARTH, "matrix"),
}
