"""Ground control of OpenDroneMap, gcp_list.txt, data_specs/gcp_list.md.

    EPSG:32632
    x y z im_x im_y image [name]

x is easting or longitude. The program counts pixels from the centre of the first one, as OpenSfM
normalises them; here they count from its outer corner, 0.5 more.
"""

import re
from dataclasses import replace

import numpy as np

from ....base.errors import DataError, InputError
from ....base.files import atomic_write
from ....geodesy.crs import is_geographic
from ..orientation.exported import check_names
from ..text.layout import quote
from ..text.numbers import whole
from ..text.text import Source, decode_text, numbered_lines
from ..text.text import number as number_in
from .ground_points import GroundTable
from .image_points import SIGMA_PX, ImagePoints, positive_sigma
from .measured_block import MeasuredBlock, check_once, file_names, image_points, of_table

SIGMA_M = (0.02, 0.02, 0.04)
"""Standard deviations of x, y, z (easting, northing, height), m; the file has none."""
ORIGIN_PX = 0.5  # of the file: the middle of the upper left pixel is its origin
CRS_WORDS = ("EPSG:", "+PROJ", "WGS84")
CRS_MISSING = "the first line names the CRS, such as EPSG:32632, WGS84 UTM 32N or a +proj text"


def read_gcp_list(
    path: Source, sigma_px: float = SIGMA_PX, sigma_m: tuple[float, float, float] = SIGMA_M
) -> MeasuredBlock:
    """Read ground control points and where images show them.

    Parameters
    ----------
    path : path
        The file.
    sigma_px : float
        Standard deviation of image observations, pixels.
    sigma_m : tuple of float
        Standard deviations of easting, northing and height, m.

    Returns
    -------
    MeasuredBlock
        Control points with their observations; without cameras and poses. Points without name are
        numbered GCP1, GCP2, ... by their coordinates.

    Raises
    ------
    InputError
        A CRS that is missing or unknown, a line with too few fields, a name with two places, a
        point that is measured twice in an image, with file and line.
    DataError
        A standard deviation that is not positive.
    """
    positive_sigma(sigma_px, "gcp_list")
    if not min(sigma_m) > 0.0:
        raise DataError(f"gcp_list: sigma_m {sigma_m}; all three must be positive")
    text = decode_text(path)
    rows = numbered_lines(text)
    crs = head_crs(path, rows[0]) if rows else ""
    if len(rows) < 2:
        raise InputError.in_file(path, f"no ground point; {CRS_MISSING}, then come the points")
    if not text.endswith("\n"):
        _refuse_cut(path, rows)
    lines, uv, image, names = [], [], [], []
    name_by_place: dict[tuple[float, ...], str] = {}
    place_by_name: dict[str, tuple[int, tuple[float, ...]]] = {}
    for line, row in rows[1:]:
        fields = row.split()
        if len(fields) < 6:
            raise InputError.at_line(
                path,
                line,
                f"{len(fields)} fields: {quote(row.strip())}; a line holds x y z im_x im_y image",
            )
        x, y, z, u, v = (number_in(word, path, line) for word in fields[:5])
        position = (x, y, z)
        unnamed = name_by_place.setdefault(position, f"GCP{len(name_by_place) + 1}")
        name = fields[6] if len(fields) > 6 else unnamed
        before, stated = place_by_name.setdefault(name, (line, position))
        if stated != position:
            raise InputError.at_line(
                path,
                line,
                f"point {quote(name)} has other coordinates than in line {before}; correct one, or"
                " give it another name",
            )
        lines.append(line)
        uv.append((u + ORIGIN_PX, v + ORIGIN_PX))
        image.append(fields[5])
        names.append(name)
    check_once(path, lines, image, names)
    files = list(dict.fromkeys(image))
    image_row = [files.index(name) for name in image]
    points = tuple(place_by_name)
    n = len(points)
    ground = GroundTable(
        points,
        np.array([stated for _, stated in place_by_name.values()]),
        np.tile(np.diag(np.square(sigma_m)), (n, 1, 1)),
        np.zeros(n, dtype=bool),
    )
    images = file_names(files, path)
    measured, _ = image_points(images, image_row, names, uv, np.full(len(image_row), sigma_px))
    return replace(of_table(measured), ground=ground, crs=crs)


def _refuse_cut(path: Source, rows: list[tuple[int, str]]) -> None:
    """Refuse a last line without end that has fewer fields than all others, or another name."""
    *earlier, (line, last) = [(line, row.split()) for line, row in rows[1:]]
    counts = {len(fields) for _, fields in earlier}
    names = {fields[6] for _, fields in earlier if fields[:3] == last[:3] and len(fields) > 6}
    fewer = len(counts) == 1 and len(last) < counts.pop()
    if fewer or (names and (len(last) < 7 or last[6] not in names)):
        raise InputError.at_line(
            path,
            line,
            f"truncated: the file ends within this line, {quote(' '.join(last))}; copy it again or"
            " delete the line",
        )


def head_crs(path: Source, row: tuple[int, str]) -> str:
    """Return the CRS of the first line of a file of OpenDroneMap.

    Parameters
    ----------
    path : path
        The file, for the message.
    row : tuple
        Number and text of the line.

    Returns
    -------
    str
        As pyproj knows it.

    Raises
    ------
    InputError
        It is missing or unknown.
    """
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    line, text = row[0], row[1].strip()
    parts = text.upper().split()
    if not text.upper().startswith(CRS_WORDS):
        raise InputError.at_line(path, line, f"{quote(text)} is no CRS; {CRS_MISSING}")
    if parts == ["WGS84"]:
        return "EPSG:4326"
    if parts[:2] == ["WGS84", "UTM"] and len(parts) == 3:
        zone, south = parts[2].rstrip("NS"), parts[2].endswith("S")
        if 1 <= whole(zone) <= 60:
            return f"EPSG:{(32700 if south else 32600) + whole(zone)}"
    try:
        CRS.from_user_input(text)
    except CRSError:
        raise InputError.at_line(
            path, line, f"CRS {quote(text)} is unknown; {CRS_MISSING}"
        ) from None
    return text


def write_gcp_list(measured: ImagePoints, ground: GroundTable, crs: str, path: Source) -> None:
    """Write control points and where images show them; check points are left out.

    Parameters
    ----------
    measured : ImagePoints
        Image observations of ground points.
    ground : GroundTable
        The points, in the axes of `crs`: easting or longitude first.
    crs : str
        An EPSG code.
    path : path
        The file, written whole or not at all.

    Raises
    ------
    InputError
        A CRS that is no code, a name that has a blank, or no control point.
    UsageError
        The file cannot be written.
    """
    if not re.fullmatch(r"EPSG:\d+", crs):
        raise InputError(
            f"gcp_list: CRS {crs!r} has no EPSG code, which gcp_list.txt requires; give --crs"
        )
    check_names(measured.images, None)
    check_names(measured.points, None, "point")
    row_by_name = {name: k for k, name in enumerate(ground.points) if not ground.check[k]}
    digits = 10 if is_geographic(crs) else 4
    # what the program reads is two-dimensional, heights behind it as they are
    code = "EPSG:4326" if crs == "EPSG:4979" else crs
    obs = measured.observations
    rows = []
    for i, p, (u, v) in zip(
        obs.image.tolist(), obs.point.tolist(), (obs.uv - ORIGIN_PX).tolist(), strict=True
    ):
        if (row := row_by_name.get(measured.points[p])) is not None:
            x, y, z = ground.position_m[row]
            rows.append(
                f"{x:.{digits}f} {y:.{digits}f} {z:.4f} {u:.4f} {v:.4f} {measured.images[i]}"
                f" {measured.points[p]}\n"
            )
    if not rows:
        raise InputError(
            "gcp_list: all points are check points, which gcp_list.txt cannot hold; give control"
            " points as well"
        )
    atomic_write(path, "".join([f"{code}\n", *rows]))
