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

import numpy as np

from ....base import __version__
from ....base.output.staging import written_path
from ....geodesy.crs import first_wkt
from ....geodesy.frames import TangentPlane
from ....records import FramedOrientation
from ....records.framed import GEOGRAPHIC, TANGENT
from ..orientation.exported import Placed, frame_words

LOCAL_WKT = (
    'LOCAL_CS["Local Coordinates (m)",LOCAL_DATUM["Local Datum",0],'
    'UNIT["metre",1,AUTHORITY["EPSG","9001"]]]'
)
# of a reference csv: label, position, angles, accuracies of both, and the same without angles
HELPER_COLUMNS, WITHOUT_ANGLES = "nxyzabcXYZABC", "nxyzXYZ"
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
{angles}chunk.importReference(
    path=FILE,
    format=Metashape.ReferenceFormatCSV,
    columns={columns!r},
    delimiter=",",
    skip_rows=1,
    items=Metashape.ReferenceItemsCameras,
    crs=CRS,
)
given = [camera for camera in chunk.cameras if camera.reference.{what} is not None]
print(str(len(given)) + " of " + str(len(chunk.cameras)) + " cameras have a reference")
if not given:
    print("labels of cameras must be the names in the file, with their endings")
'''
APPLIED = "Lever arm and bore-sight are applied: leave the GPS/INS offset of the camera at zero."
NO_ANGLES = "The file has no angles: Metashape keeps the angles stored in the images."
GPS_INS_OFFSET = (
    "Set the GPS/INS offset beside as well: the angles are those of the nominal camera."
)
FLIGHT_LOG = """<!-- {comment} -->
<FlightLogs>
  <format id="{{{guid}}}" desc={words} reader="RealityScan.Import.CSVFlightLog">
    <parser separator="," comment="#" showIgnoreFirstline="true">
{columns}    </parser>
  </format>
</FlightLogs>
"""
COPY_FORMAT = (
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


def metashape_script(eo: Placed, path: Path) -> dict[Path, str]:
    """Return <name>_import.py beside a reference csv, whose header names its angles.

    Parameters
    ----------
    eo : FramedOrientation or PlacedCameras
        What was written.
    path : Path
        The csv.

    Returns
    -------
    dict
        Text by path.
    """
    first = _header(path, "#Label").split(",")[4]
    frame = eo.frame
    note = {"Nominal_yaw": GPS_INS_OFFSET, "X_acc": NO_ANGLES}.get(first, APPLIED)
    if "geoid" in frame.heights:  # a file here, which no CRS names
        note += f"\nHeights are {frame.heights}: choose the CRS with these heights in its place."
    angles = {"Omega": "EulerAnglesOPK", "X_acc": ""}.get(first, "EulerAnglesYPR")
    text = SCRIPT.format(
        file=path.name,
        name=path.name,
        version=__version__,
        frame=frame_words(eo).replace("\\", "/").replace('"', "'"),
        note=note,
        crs=LOCAL_WKT if frame.kind == TANGENT else metashape_crs(frame.crs, frame.wkt),
        angles=f"chunk.euler_angles = Metashape.{angles}\n" if angles else "",
        columns=HELPER_COLUMNS if angles else WITHOUT_ANGLES,
        what="rotation" if angles else "location",
    )
    return {path.with_name(f"{path.stem}_import.py"): text}


def _header(path: Path, start: str) -> str:
    """Return the first line of an export that begins with `start`."""
    with written_path(path).open(encoding="utf-8") as stream:
        return next(line for line in stream if line.startswith(start)).strip()


def metashape_crs(crs: str, wkt: str) -> str:
    """Return a CRS as Metashape takes it: a code, or well-known text of the first kind.

    Parameters
    ----------
    crs : str
        Its code or name; empty for latitude and longitude of WGS84.
    wkt : str
        Its well-known text, where it is projected or has no code.

    Returns
    -------
    str
        The argument of Metashape.CoordinateSystem.
    """
    if not wkt:
        return (crs or "EPSG:4979").replace(":", "::")
    if crs.startswith("EPSG:") and not wkt.startswith("COMPOUNDCRS"):
        return crs.replace(":", "::")
    from pyproj import CRS

    return first_wkt(CRS.from_wkt(wkt), "metashape")


def flight_log_format(eo: Placed, path: Path) -> dict[Path, str]:
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
    from xml.sax.saxutils import escape, quoteattr

    fields = _header(path, "#name").lstrip("#").split(",")
    variables = FLIGHTLOG_VARIABLES | (ON_GLOBE if eo.frame.kind == GEOGRAPHIC else {})
    columns = "".join(
        f'      <{variables[name][0]} index="{k}" format="{variables[name][1]}"/>\n'
        for k, name in enumerate(fields)
    )
    title = "insgnss: " + ", ".join(fields)
    comment = (
        f"insgnss {__version__}: {COPY_FORMAT.format(file=path.name)} Frame: {frame_words(eo)}"
    )
    guid = str(uuid.uuid5(uuid.NAMESPACE_OID, title)).upper()
    text = FLIGHT_LOG.format(
        comment=escape(comment).replace("--", "- -"),
        guid=guid,
        words=quoteattr(title),
        columns=columns,
    )
    return {path.with_name(f"{path.stem}_format.xml"): text}


FLIGHTLOG_VARIABLES = {
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
