"""MicMac: the text that OriConvert reads, and Orientation-<image>.xml, data_specs/micmac.md.

    text   #F=N X Y Z W P K Ix Iy Iz     W P K = omega phi kappa, degrees (eConvAngPhotoMDegre): R =
                                         Rx(omega) Ry(phi) Rz(kappa) takes the camera (right, up,
                                         back) to the frame; Ix Iy Iz standard deviations, m
    xml    the matrix C_fc by rows: camera (right, down, viewing direction) to the frame
           (eConvApero_DistM2C)

MicMac takes the frame for Euclidean: a tangent plane or geocentric coordinates, no projected CRS.
Standard deviations of angles have no place. An orientation in xml names the calibration file of its
camera, which MicMac looks for when it uses one.
"""

import os
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from ....base.errors import InputError
from ....records import FramedOrientation
from ....records.block import Array
from ..orientation.ascii_columns import write_columns
from ..orientation.exported import (
    UnfitName,
    check_names,
    comment_lines,
    new_directory,
    position_sigma,
    xml_text,
)
from ..text.layout import quote
from ..text.numbers import PLAIN, finite
from ..text.text import Source
from ..text.xml import read_xml

XML = """<?xml version="1.0" ?>
<ExportAPERO>
     <OrientationConique>
          <OrIntImaM2C>
               <I00>0 0</I00>
               <V10>1 0</V10>
               <V01>0 1</V01>
          </OrIntImaM2C>
          <TypeProj>eProjStenope</TypeProj>
          <ZoneUtileInPixel>true</ZoneUtileInPixel>
{interior}          <Externe>
               <KnownConv>eConvApero_DistM2C</KnownConv>
               <Centre>%.4f %.4f %.4f</Centre>
               <IncCentre>%.5f %.5f %.5f</IncCentre>
               <ParamRotation>
                    <CodageMatr>
                         <L1>%.12f %.12f %.12f</L1>
                         <L2>%.12f %.12f %.12f</L2>
                         <L3>%.12f %.12f %.12f</L3>
                    </CodageMatr>
               </ParamRotation>
          </Externe>
          <ConvOri>
               <KnownConv>eConvApero_DistM2C</KnownConv>
          </ConvOri>
     </OrientationConique>
</ExportAPERO>
"""


def write_micmac(eo: FramedOrientation, path: Source) -> None:
    """Write the text: metres with 4 decimals, degrees with 6, standard deviations with 5.

    Parameters
    ----------
    eo : FramedOrientation
        The orientation in a tangent plane or geocentric.
    path : path
        The file.

    Raises
    ------
    UsageError
        A frame that is not Euclidean.
    InputError
        Names with blanks.
    DataError
        phi is +-90 deg.
    """
    comment = comment_lines(
        eo,
        "angles: omega phi kappa, deg (eConvAngPhotoMDegre); R = Rx(omega) Ry(phi) Rz(kappa) takes"
        " right-up-back to the frame",
    )
    write_columns(eo, path, "image xyz opk s_xyz", " ", f"#F=N X Y Z W P K Ix Iy Iz\n{comment}")


def write_micmac_xml(eo: FramedOrientation, path: Source, calibration: str = "") -> None:
    """Write Orientation-<image>.xml of every image into the directory `path`.

    The directory is made where it is missing. Metres have 4 decimals, matrices 12.

    Parameters
    ----------
    eo : FramedOrientation
        The orientation in a tangent plane or geocentric.
    path : path
        The directory.
    calibration : str
        The camera's calibration file as MicMac is to find it; left out where empty.

    Raises
    ------
    UsageError
        A frame that is not Euclidean, a `path` that is a file or holds orientations of other
        images.
    InputError
        Names that make no file name.
    """
    check_names(eo.images, "/")
    unfit = next((name for name in eo.images if "\\" in name or "\0" in name), None)
    if unfit is not None:
        raise UnfitName(
            f"image name {unfit!r} cannot be part of a file name Orientation-<image>.xml; rename"
            " the image"
        )
    directory = Path(path)
    files = {f"Orientation-{name}.xml" for name in eo.images}
    interior = (
        f"          <FileInterne>{xml_text(calibration)}</FileInterne>\n" if calibration else ""
    )
    form = XML.replace("{interior}", interior.replace("%", "%%"))
    table = np.hstack([eo.coordinates, position_sigma(eo), eo.C_fc.reshape(-1, 9)])
    with new_directory(
        directory,
        files,
        lambda file: file.startswith("Orientation-") and file.endswith(".xml"),
        "orientations",
    ) as into:
        for name, row in zip(eo.images, table.tolist(), strict=True):
            path = f"{into}{os.sep}Orientation-{name}.xml"
            with open(path, "w", encoding="utf-8", newline="\n") as stream:
                stream.write(form % tuple(row))


def read_micmac_xml(path: Source) -> tuple[tuple[str, ...], Array, Array]:
    """Read Orientation-<image>.xml of a directory, as MicMac's bundle adjustment leaves them.

    MMVII, its second version, writes Ori-PerspCentral-<image>.xml, with the columns of the matrix.

    Parameters
    ----------
    path : path
        The directory, such as Ori-Compensated.

    Returns
    -------
    images : tuple of str
        (n,) names.
    position_m : ndarray, (n, 3)
        Projection centres in the axes of the orientation.
    C_mc : ndarray, (n, 3, 3)
        Camera (right, down, viewing direction) to these axes.

    Raises
    ------
    InputError
        No orientation stands there, or one is damaged or of another convention.
    """
    files = sorted(Path(path).glob("Orientation-*.xml"))
    second = () if files else sorted(Path(path).glob("Ori-PerspCentral-*.xml"))
    if not files and not second:
        raise InputError.in_file(path, "no Orientation-<image>.xml in it; give Ori-<name>")
    names, centres, matrices = [], [], []
    for file in files:
        root = read_xml(file)
        outer = root.find(".//Externe")
        convention = None if outer is None else outer.findtext("KnownConv")
        if outer is None or convention not in (None, "eConvApero_DistM2C"):
            problem = f"convention {convention}; only eConvApero_DistM2C, a matrix, can be read"
            raise InputError.in_file(file, problem)
        values = _vectors(file, outer, "Centre", *(f".//L{k}" for k in (1, 2, 3)))
        names.append(file.name.removeprefix("Orientation-").removesuffix(".xml"))
        centres.append(values[0])
        matrices.append(values[1:])
    for file in second:
        values = _vectors(file, read_xml(file), "Center", *(f".//Axe{k}" for k in "IJK"))
        names.append(file.name.removeprefix("Ori-PerspCentral-").removesuffix(".xml"))
        centres.append(values[0])
        matrices.append(values[1:].T)
    return tuple(names), np.array(centres), np.array(matrices)


def _vectors(file: Path, root: Element, *tags: str) -> Array:
    """Return the three numbers of each of some elements, (n, 3)."""
    texts = [root.findtext(tag) for tag in tags]
    rows = [[finite(word) for word in (text or "").split()] for text in texts]
    for tag, text, row in zip(tags, texts, rows, strict=True):
        if len(row) != 3 or np.isnan(row).any():
            problem = f"{tag.strip('./')} is not three numbers: {quote(text)}"
            raise InputError.in_file(file, f"{problem}; {PLAIN}, or copy it again")
    return np.array(rows)
