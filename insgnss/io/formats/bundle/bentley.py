"""BlocksExchange XML of Bentley ContextCapture, iTwin Capture: pose priors, data_specs/bentley.md.

The matrix is C_fc^T, world to camera, with camera axes x right, y down (CameraOrientation
XRightYDown), under Pose/Metadata, where what navigation devices say has its place. x is easting or
longitude. The system of reference:

    projected       EPSG code                          the axes of the grid
    geographic      EPSG:4326, or the code of its datum        east, north, up at the image
    tangent plane   ENU:latitude,longitude             its origin lies on the ellipsoid, so z = U +
                                                       height of our origin, exactly

The program takes no standard deviations, only whether a pose is accurate: position true, rotation
false.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ....base.errors import UsageError
from ....base.files import atomic_write
from ....records import FramedOrientation
from ....records.framed import TANGENT
from ..orientation.ascii_columns import line_form
from ..orientation.exported import check_names, comment_lines, frame_words, places, xml_text
from ..text.text import Source

BENTLEY_HEAD = """<?xml version="1.0" encoding="utf-8"?>
<!--
{comment}-->
<BlocksExchange version="2.1">
 <SpatialReferenceSystems><SRS><Id>0</Id><Name>{name}</Name>\
<Definition>{definition}</Definition></SRS></SpatialReferenceSystems>
 <Block><Name>insgnss</Name><Type>Nadir</Type><SRSId>0</SRSId>
  <Photogroups>"""
PHOTOGROUP = "<Photogroup><Name>{name}</Name>\n{camera}"
FOOT = "</Photogroups>\n </Block>\n</BlocksExchange>\n"
LENS = """   <ImageDimensions><Width>{width}</Width><Height>{height}</Height></ImageDimensions>
   <CameraModelType>Perspective</CameraModelType><FocalLengthPixels>{focal:.6f}</FocalLengthPixels>
   <CameraOrientation>XRightYDown</CameraOrientation>
"""
FROM_EXIF = "   <ManualOpticalParams>false</ManualOpticalParams>\n"
MATRIX = "".join(f"<M_{i}{j}>%.12f</M_{i}{j}>" for i in range(3) for j in range(3))


def write_bentley(
    eo: FramedOrientation,
    path: Source,
    width_px: int | None = None,
    height_px: int | None = None,
    focal_px: float | None = None,
) -> None:
    """Write a projected, geographic or tangent-plane frame.

    Degrees are written with 10 decimals, metres with 4, matrices with 12.

    Parameters
    ----------
    eo : FramedOrientation
        The orientation in its frame.
    path : path
        The file.
    width_px, height_px, focal_px
        Size and focal length of the images, all or none; without them the program takes the camera
        from the images' EXIF.

    Raises
    ------
    UsageError
        A CRS without code, or a camera that is half given.
    InputError
        Names with line ends.
    """
    check_names(eo.images, "\n")
    camera = FROM_EXIF
    optics = [x for x in (width_px, height_px, focal_px) if x is not None]
    if optics:
        if len(optics) < 3 or not all(0 < x < np.inf for x in optics):
            how = (
                "give all three, such as --set width_px=5120 --set height_px=3840 --set"
                " focal_px=5607, or none"
            )
            raise UsageError(
                f"bentley: width_px, height_px and focal_px belong together and are positive; {how}"
            )
        camera = LENS.format(width=width_px, height=height_px, focal=focal_px)
    eo = on_ellipsoid(eo)
    definition, coordinates = _reference(eo)
    comment = comment_lines(
        eo, "rotation: matrix of world to camera, x right, y down, z viewing direction"
    ).replace("--", "- -")
    opening = BENTLEY_HEAD.format(
        comment=comment, name=xml_text(frame_words(eo)), definition=xml_text(definition)
    )
    atomic_write(
        path,
        _text(eo, opening, camera, np.hstack([eo.C_fc.swapaxes(1, 2).reshape(-1, 9), coordinates])),
    )


def on_ellipsoid(eo: FramedOrientation) -> FramedOrientation:
    """Move a tangent plane's origin to height 0, where ENU:latitude,longitude has it.

    Any other frame is returned as it is.
    """
    if eo.frame.kind != TANGENT:
        return eo
    lat, lon, h = eo.frame.origin
    origin = (
        f"latitude {np.degrees(lat):.10f} deg, longitude {np.degrees(lon):.10f} deg, 0.0000 m (on"
        " the ellipsoid)"
    )
    name = f"tangent plane of {eo.frame.datum_name} at {origin}"
    frame = replace(eo.frame, name=name, origin=(lat, lon, 0.0))
    return replace(eo, frame=frame, coordinates=eo.coordinates + [0.0, 0.0, h])


def _reference(eo: FramedOrientation) -> tuple[str, NDArray[np.float64]]:
    """Return the definition of the reference system, and coordinates in it (n, 3), deg and m."""
    if eo.frame.kind == TANGENT:
        lat, lon = np.degrees(eo.frame.origin[:2])
        return f"ENU:{lat:.10f},{lon:.10f}", eo.coordinates
    if eo.frame.crs == "EPSG:4979":
        return "EPSG:4326", places(eo)
    if not eo.frame.crs:
        raise UsageError(
            f"bentley: {eo.frame.name} has no EPSG code; export a CRS that has one, or the tangent"
            " plane"
        )
    return eo.frame.crs, places(eo)


def _text(
    eo: FramedOrientation, opening: str, camera: str, table: NDArray[np.float64]
) -> Iterable[str]:
    """Yield the XML text, one photo group for each camera."""
    x, y, z = line_form(eo, "xyz", " ").split()
    photo = (
        "   <Photo><Id>%d</Id><ImagePath>%s</ImagePath><Pose><Metadata><SRSId>0</SRSId><Rotation>"
        + MATRIX
        + "<Accurate>false</Accurate>"
        f"</Rotation><Center><x>{x}</x><y>{y}</y><z>{z}</z><Accurate>true</Accurate></Center>"
        "</Metadata></Pose></Photo>\n"
    )
    yield opening
    names, number = eo.cameras
    for camera_number, name in enumerate(names):
        rows = np.flatnonzero(number == camera_number)
        yield PHOTOGROUP.format(name=xml_text(name or "camera"), camera=camera)
        for row, values in zip(rows.tolist(), table[rows].tolist(), strict=True):
            yield photo % (row, xml_text(eo.images[row]), *values)
        yield "  </Photogroup>"
    yield FOOT
