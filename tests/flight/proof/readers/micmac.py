"""MicMac, formats.md B5.

text   the first line names the columns behind #F=; W P K are omega, phi, kappa
       (eConvAngPhotoMDegre): Rx Ry Rz D takes the camera (right, down, view) into the world
xml    Orientation-<image>.xml: eConvApero_DistM2C, rows L1 L2 L3 of the matrix of the camera
       (right, down, view) into the world
"""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from .case import LOCAL, SPACE, Case
from .geometry import D, Frame, Poses, Table, opk
from .lines import named, numbers, rows

LETTERS = {
    "N": "name",
    "X": "x",
    "Y": "y",
    "Z": "z",
    "W": "omega",
    "P": "phi",
    "K": "kappa",
    "Ix": "sx",
    "Iy": "sy",
    "Iz": "sz",
}


def read(path: Path) -> Table:
    first = path.read_text(encoding="utf-8").splitlines()[0]
    assert first.startswith("#F=")
    return Table(*named(rows(path), " ".join(LETTERS[letter] for letter in first[3:].split())))


def poses(table: Table, frame: Frame) -> Poses:
    x = table.place()
    return Poses(
        table.names,
        frame.ecef(x),
        frame.axes(x) @ opk(table["omega"], table["phi"], table["kappa"]) @ D,
    )


def read_xml(path: Path) -> Table:
    names, centres, matrices = [], [], []
    for file in sorted(path.glob("Orientation-*.xml")):
        outer = ElementTree.parse(file).getroot().find(".//OrientationConique/Externe")
        assert outer is not None
        assert outer.findtext("KnownConv") == "eConvApero_DistM2C"
        names.append(file.name.removeprefix("Orientation-").removesuffix(".xml"))
        centres.append(numbers(outer.findtext("Centre", "")))
        matrices.append(
            [numbers(outer.findtext(f"ParamRotation/CodageMatr/L{i}", "")) for i in (1, 2, 3)]
        )
    return Table(
        names, dict(zip("xyz", np.array(centres).T, strict=True)) | {"R": np.array(matrices)}
    )


def poses_xml(table: Table, frame: Frame) -> Poses:
    x = table.place()
    return Poses(table.names, frame.ecef(x), frame.axes(x) @ table["R"])


CASES = {
    "micmac": Case(read, poses, (LOCAL, SPACE), "opk"),
    "micmac_xml": Case(read_xml, poses_xml, (LOCAL, SPACE), "matrix"),
}
