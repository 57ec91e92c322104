"""What a program needs besides the export to read it: scripts and descriptions, ready to be used.

    metashape         a Python script that sets CRS and rotation angles and imports the reference
    realitycapture    the description of the flight log's columns, for flightlogs.xml
    micmac            the local tangent frame as a coordinate system (SysCoRTL.xml)

Sources: Metashape's Python reference (importReference, Chunk.euler_angles); RealityScan's help,
"Customize Import Formats" (elements and variables of a flight log); MicMac's wiki, "Coordinates
Systems" (eTC_RTL about a geocentric centre).
"""

import uuid
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from ... import __version__
from ...base.staging import written
from ...geodesy.frames import TangentPlane
from ...records import FramedOrientation
from ...records.framed import GEOGRAPHIC, TANGENT
from ..orientation.exported import frame_words

LOCAL = (
    'LOCAL_CS["Local Coordinates (m)",LOCAL_DATUM["Local Datum",0],'
    'UNIT["metre",1,AUTHORITY["EPSG","9001"]]]'
)
COLUMNS = "nxyzabcXYZABC"  # of a reference csv: label, position, angles, accuracies of both
SCRIPT = '''"""Import {file} into the active chunk of Metashape: Tools, Run Script.

Written by insgnss {version}. Frame: {frame}.
{note}
"""

import os

import Metashape

try:
    FILE = os.path.join(os.path.dirname(os.path.abspath(__file__)), {name!r})
except NameError:
    FILE = {name!r}
if not os.path.isfile(FILE):
    FILE = Metashape.app.getOpenFileName("Select " + {name!r})
CRS = Metashape.CoordinateSystem({crs!r})

chunk = Metashape.app.document.chunk
chunk.crs = CRS
chunk.euler_angles = Metashape.{angles}
chunk.importReference(
    path=FILE,
    format=Metashape.ReferenceFormatCSV,
    columns={columns!r},
    delimiter=",",
    skip_rows=1,
    items=Metashape.ReferenceItemsCameras,
    crs=CRS,
)
given = [camera for camera in chunk.cameras if camera.reference.rotation is not None]
print(str(len(given)) + " of " + str(len(chunk.cameras)) + " cameras have a reference")
if not given:
    print("labels of cameras must be the names in the file, with their endings")
'''
APPLIED = "Lever arm and bore-sight are applied: leave the GPS/INS offset of the camera at zero."
OFFSET = "Set the GPS/INS offset beside as well: the angles are those of the nominal camera."
FLIGHT_LOG = """<!-- {comment} -->
<FlightLogs>
  <format id="{{{guid}}}" desc={words} reader="RealityScan.Import.CSVFlightLog">
    <parser separator="," comment="#" showIgnoreFirstline="true">
{columns}    </parser>
  </format>
</FlightLogs>
"""
HOW = (
    "Copy the format element into FlightLogs of flightlogs.xml in the directory of RealityScan"
    " (RealityCapture: with the reader of the other formats there), then choose it when importing"
    " {file}."
)
RTL = """<SystemeCoord>
     <BSC>
          <TypeCoord>eTC_RTL</TypeCoord>
          <AuxR>{:.4f}</AuxR>
          <AuxR>{:.4f}</AuxR>
          <AuxR>{:.4f}</AuxR>
     </BSC>
     <BSC>
          <TypeCoord>eTC_GeoCentr</TypeCoord>
     </BSC>
</SystemeCoord>
"""


def metashape_script(eo: FramedOrientation, path: Path) -> dict[Path, str]:
    """Return <name>_import.py beside a reference csv of yaw, pitch, roll.

    Parameters
    ----------
    eo : FramedOrientation
        The orientation that was written.
    path : Path
        The csv.

    Returns
    -------
    dict
        Text by path.
    """
    return _script(eo, path, "EulerAnglesYPR", APPLIED)


def metashape_opk_script(eo: FramedOrientation, path: Path) -> dict[Path, str]:
    """Return <name>_import.py beside a reference csv of omega, phi, kappa, as `metashape_script`.

    Parameters
    ----------
    eo : FramedOrientation
        The orientation that was written.
    path : Path
        The csv.

    Returns
    -------
    dict
        Text by path.
    """
    return _script(eo, path, "EulerAnglesOPK", APPLIED)


def metashape_offset_script(eo: FramedOrientation, path: Path) -> dict[Path, str]:
    """Return <name>_import.py beside a csv of the nominal camera, as `metashape_script`.

    Parameters
    ----------
    eo : FramedOrientation
        The orientation that was written.
    path : Path
        The csv.

    Returns
    -------
    dict
        Text by path.
    """
    return _script(eo, path, "EulerAnglesYPR", OFFSET)


def _script(eo: FramedOrientation, path: Path, angles: str, note: str) -> dict[Path, str]:
    crs, frame = _metashape_crs(eo), eo.frame
    if frame.heights and "geoid" in frame.heights:
        note += f"\nHeights are {frame.heights}: choose the CRS with these heights in its place."
    text = SCRIPT.format(
        file=path.name,
        name=path.name,
        version=__version__,
        frame=frame_words(eo).replace("\\", "/").replace('"', "'"),
        note=note,
        crs=crs,
        angles=angles,
        columns=COLUMNS,
    )
    return {path.with_name(f"{path.stem}_import.py"): text}


def _metashape_crs(eo: FramedOrientation) -> str:
    """Return the CRS as Metashape takes it: a code, or well-known text of the first kind."""
    frame = eo.frame
    if frame.kind == TANGENT:
        return LOCAL
    if frame.kind == GEOGRAPHIC:
        return "EPSG::4979"
    if frame.crs and not frame.wkt.startswith("COMPOUNDCRS"):
        return frame.crs.replace(":", "::")
    from pyproj import CRS

    return str(CRS.from_wkt(frame.wkt).to_wkt("WKT1_GDAL"))


def flight_log_format(eo: FramedOrientation, path: Path) -> dict[Path, str]:
    """Return <name>_format.xml beside a flight log of RealityScan.

    Parameters
    ----------
    eo : FramedOrientation
        The orientation that was written.
    path : Path
        The flight log, whose header names its columns.

    Returns
    -------
    dict
        Text by path.
    """
    with written(path).open(encoding="utf-8") as stream:
        head = next(line for line in stream if line.startswith("#name"))
    fields = head.strip().lstrip("#").split(",")
    variables = VARIABLES | (ON_GLOBE if eo.frame.kind == GEOGRAPHIC else {})
    columns = "".join(
        f'      <{variables[name][0]} index="{k}" format="{variables[name][1]}"/>\n'
        for k, name in enumerate(fields)
    )
    words = "insgnss: " + ", ".join(fields)
    comment = f"insgnss {__version__}: {HOW.format(file=path.name)} Frame: {frame_words(eo)}"
    guid = str(uuid.uuid5(uuid.NAMESPACE_OID, words)).upper()
    text = FLIGHT_LOG.format(
        comment=escape(comment).replace("--", "- -"),
        guid=guid,
        words=quoteattr(words),
        columns=columns,
    )
    return {path.with_name(f"{path.stem}_format.xml"): text}


VARIABLES = {
    "name": ("Image", "name.ext"),
    "x": ("X", "value"),
    "y": ("Y", "value"),
    "latitude": ("Latitude", "degrees"),
    "longitude": ("Longitude", "degrees"),
    "altitude": ("Altitude", "value"),
    "yaw": ("Yaw", "value"),
    "pitch": ("Pitch", "value"),
    "roll": ("Roll", "value"),
    "accX": ("XAccuracy", "value"),
    "accY": ("YAccuracy", "value"),
    "accZ": ("AltitudeAccuracy", "value"),
    "accYaw": ("YawAccuracy", "value"),
    "accPitch": ("PitchAccuracy", "value"),
    "accRoll": ("RollAccuracy", "value"),
}
"""Variables of a flight log and their formats, by the columns of ours."""
ON_GLOBE = {"accX": ("LongitudeAccuracy", "value"), "accY": ("LatitudeAccuracy", "value")}


def tangent_system(eo: FramedOrientation, path: Path) -> dict[Path, str]:
    """Return <name>_SysCoRTL.xml, MicMac's name for the tangent plane of an orientation.

    Its origin is the geocentric one of ours, so that no order of angles can be mistaken.

    Parameters
    ----------
    eo : FramedOrientation
        The orientation that was written.
    path : Path
        The text, or the directory.

    Returns
    -------
    dict
        Text by path; none of a frame that is no tangent plane.
    """
    if eo.frame.kind != TANGENT:
        return {}
    origin = TangentPlane(*eo.frame.origin).origin_ecef
    text = RTL.format(*np.asarray(origin).tolist())
    return {path.with_name(f"{path.stem}_SysCoRTL.xml"): text}
