"""Poses of any bundle adjustment: names and first bytes tell the format."""

import re
from collections.abc import Mapping
from pathlib import Path

from ....base.errors import UsageError, near
from ..blocks.colmap_model import PARTS
from ..blocks.opensfm_model import reconstruction_in
from ..exports import function_at
from ..text.text import Source
from .documents import CALIBRATED_CAMERAS
from .poses import ReturnedPoses
from .tables import EXTERNAL, PIX4D_CAMERA

RETURNED: Mapping[str, str] = {
    "metashape_xml": "returned.projects:read_metashape_xml",
    "metashape_opk_text": "returned.tables:read_metashape_opk_text",
    "metashape_reference": "returned.tables:read_metashape_reference",
    "pix4d_external": "returned.tables:read_pix4d_external",
    "pix4d_camera": "returned.tables:read_pix4d_camera",
    "colmap": "returned.projects:read_colmap",
    "opensfm": "returned.projects:read_opensfm",
    "micmac_xml": "returned.projects:read_micmac",
    "bentley": "returned.projects:read_bentley",
    "inpho_prj": "returned.inpho:read_inpho_prj",
    "ign_opk": "returned.tables:read_ign_opk",
    "odm": "returned.tables:read_odm_geo",
    "odm_shots": "returned.documents:read_odm_shots",
    "geojson": "returned.documents:read_geojson",
    "positions": "returned.tables:read_named_positions",
    "opf": "returned.documents:read_opf",
}
"""Readers of adjusted poses; each takes a path and returns `ReturnedPoses`."""
PROJECT_HEADS = {  # first bytes in lower case
    "bentley": r"<blocksexchange\b",
    "metashape_xml": r"\A\s*(<\?xml[^>]*>\s*)?<(document|chunk)\b",
    "metashape_opk_text": r"^#\s*photoid,\s*x,\s*y,\s*z,\s*omega",
    "metashape_reference": r"\A#\s*coordinatesystem:|^#?\s*label\b.*\bx/(longitude|easting)",
    "pix4d_camera": r"^camera model m = k \[r\|-rt\] x",
    "pix4d_external": r"\A\s*#?\s*imagename\s+x\s+y\s+z\s+omega\s+phi\s+kappa",
    "ign_opk": r"^\s*nom\s+x\s+y\s+z\s+o\s+p\s+k\b",
    "inpho_prj": r"^\s*\$photo\s*$",
    "odm_shots": r"\A\s*\{.*\"featurecollection\".*\"(translation|rotation)\"\s*:",
    "geojson": r"\A\s*\{\s*\"type\"\s*:\s*\"featurecollection\"",
    "odm": r"\A\s*(epsg:\d+|wgs84( utm \d+[ns]?)?|\+proj.*)\s*$",
    "opf": r"application/opf-calibrated-cameras",
    "opensfm": r"\A\s*[\[{].*\"(cameras|shots)\"\s*:",
}


def returned_form(path: Source, beginning: str) -> str:
    """Return the format of a file or directory, empty where it is none of `RETURNED`.

    Parameters
    ----------
    path : path
        The file or directory.
    beginning : str
        First bytes of a file, as text; empty of a directory.

    Returns
    -------
    str
        A key of `RETURNED`, or nothing.
    """
    path = Path(path)
    if path.is_dir():
        if any(path.glob("Orientation-*.xml")) or any(path.glob("Ori-PerspCentral-*.xml")):
            return "micmac_xml"
        if any((path / f"images{kind}").is_file() for kind in (".txt", ".bin")):
            return "colmap"
        if (path / CALIBRATED_CAMERAS).is_file():
            return "opf"
        return "" if reconstruction_in(path) is None else "opensfm"
    if path.suffix.lower() in (".psx", ".psz"):
        return "metashape_xml"
    for format_name, ending in (("pix4d_external", EXTERNAL), ("pix4d_camera", PIX4D_CAMERA)):
        if path.name.endswith(f"{ending}.txt"):
            return format_name
    text = beginning.lower()
    for format_name, pattern in PROJECT_HEADS.items():
        flags = re.MULTILINE | (re.DOTALL if format_name in ("opensfm", "odm_shots") else 0)
        if re.search(pattern, text, flags):
            return format_name
    # after the others, since Metashape's text is called cameras.txt as well
    return "colmap" if re.fullmatch(rf"({'|'.join(PARTS)})\.(txt|bin)", path.name) else ""


def read_returned_poses(path: Source, form: str) -> ReturnedPoses:
    """Read the adjusted poses of a file or directory.

    Parameters
    ----------
    path : path
        The file or directory.
    form : str
        A key of `RETURNED`.

    Returns
    -------
    ReturnedPoses
        Its images that have a pose.

    Raises
    ------
    UsageError
        Another format.
    InputError
        What the reader refuses, with file and line.
    """
    if form not in RETURNED:
        raise UsageError(f"format {form!r} of adjusted poses; {near(form, RETURNED)}")
    poses: ReturnedPoses = function_at(RETURNED[form])(path)
    return poses
