"""Texts that Metashape and Pix4D write after the adjustment, data_specs/returned.md.

metashape_opk_text     PhotoID X Y Z Omega Phi Kappa r11 ... r33: Rx(omega) Ry(phi) Rz(kappa)
                       takes the camera (right, up, back) to the axes of the CRS, which the file
                       does not name; the matrix is its transpose
metashape_reference    the CRS as WKT, then a table with a header: reference coordinates and,
                       with _est behind their names, those of the adjustment
pix4d_external         imageName X Y Z Omega Phi Kappa; less the offset in <project>_offset.xyz,
                       in the CRS of <project>_wkt.prj
ign_opk                NOM X Y Z O P K CAMERA of IGN, in a CRS that is not named; lines above the
                           header may name the unit of angles
odm                    OpenDroneMap's geo.txt: positions alone
positions              a table of positions by the names of images, data_specs/pose_table.md
pix4d_camera           ten lines an image: K, distortions, position t, rotation R of the frame
                           to the camera, m = K [R|-Rt] X
"""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ....base.errors import InputError
from ....base.files import lines_of
from ....base.inputs import first_bytes
from ....geodesy.rotation import CV_RUB, rotation_from_opk, rotation_from_ypr
from ....records.framed import GEOGRAPHIC, PROJECTED
from ..blocks.gcp_list import head_crs
from ..blocks.pose_table import read_position_table
from ..origins import ORIGIN_BYTES
from ..text.layout import quote, split_fields, unquote
from ..text.text import Source, check_fields, decode_text, numbered_lines
from .crs import COORDINATE_SYSTEM, kind_of_wkt
from .poses import Array, ReturnedPoses, checked_rotations, image_names, numbers

OPK_COLUMNS = 7  # fields of a line: name, X, Y, Z and three angles
IGN_HEADER = re.compile(r"\s*nom\s+x\s+y\s+z\s+o\s+p\s+k\b", re.IGNORECASE)
IGN_UNITS = {"g": 0.9, "d": 1.0, "r": float(np.degrees(1.0))}  # deg of a unit, by its first letter
MATRIX_COLUMNS = 16  # fields of a line: those of OPK_COLUMNS and nine elements of the matrix
SAME = 1e-3  # elements of a matrix against its angles: both are printed with few digits
FIRST = {"x": ["x", "y", "z"], "yaw": ["yaw", "pitch", "roll"], "omega": ["omega", "phi", "kappa"]}
ACCURACIES = "x_acc", "y_acc", "z_acc"  # of reference coordinates, m
# what an export of positions calls the coordinates, with the code of its CRS behind the first
REFERENCE_NAMES = {"easting": "x", "northing": "y", "height": "z"}
EPSG = re.compile(r"EPSG:\d+(?:\+\d+)?")
ODM_FIELDS = 4, 7, 9  # of a line: name and position, angles, accuracies
PIX4D_LINES = 10  # lines of an image in calibrated_camera_parameters: the format
EXTERNAL, PIX4D_CAMERA = "_calibrated_external_camera_parameters", "_calibrated_camera_parameters"
FAR_M = 1e4  # coordinate (m): positions without their offset lie nearer to zero


def read_metashape_opk_text(path: Source) -> ReturnedPoses:
    """Read Metashape's export of cameras as omega, phi, kappa.

    Parameters
    ----------
    path : path
        The text.

    Returns
    -------
    ReturnedPoses
        In a frame that the file does not name.

    Raises
    ------
    InputError
        A line of another length, or a matrix that is not that of its angles, with file and line.
    """
    names, rows = [], []
    for line, text in enumerate(lines_of(decode_text(path)), start=1):
        if not text.strip() or text.startswith("#"):
            continue
        fields = text.split("\t") if "\t" in text else text.split()
        check_fields(path, line, fields, MATRIX_COLUMNS, text)
        values = numbers(fields[1:], path, line)
        R = rotation_from_opk(np.radians([values[3:6]]))[0]
        matrix = np.reshape(values[6:], (3, 3))
        if min(np.abs(matrix - R.T).max(), np.abs(matrix - R).max()) > SAME:
            raise InputError.at_line(
                path, line, "the matrix is not that of omega, phi, kappa; export the cameras again"
            )
        names.append(fields[0])
        rows.append(values[:6])
    return _poses_of_angles(path, names, np.reshape(rows, (-1, 6)))


def _poses_of_angles(
    path: Source,
    names: Sequence[str],
    table: Array,
    kind: str = "",
    crs: str = "",
    notes: tuple[str, ...] = (),
    angle_set: str = "opk",
) -> ReturnedPoses:
    """Return poses of a table (n, 6) of coordinates and angles of a set, deg."""
    angles = np.radians(table[:, 3:])
    rotation = rotation_from_opk if angle_set == "opk" else rotation_from_ypr
    return ReturnedPoses(
        image_names(names, path),
        table[:, :3],
        rotation(angles) @ CV_RUB,
        kind,
        crs,
        true_north=angle_set == "ypr" and kind in ("", PROJECTED),
        angle_set=angle_set,
        angles=angles,
        notes=notes,
    )


def read_metashape_reference(path: Source) -> ReturnedPoses:
    """Read a reference csv as Metashape writes it: estimated values where it has them.

    Parameters
    ----------
    path : path
        The csv, with its line "# CoordinateSystem: ..." and a header.

    Returns
    -------
    ReturnedPoses
        Images without estimated values are left out, with a note. Without angles the reference
        positions alone, with their accuracies where the table has them.

    Raises
    ------
    InputError
        No header or no coordinates, with file and line; a CRS that is unknown.
    """
    lines = lines_of(decode_text(path))
    wkt, header_row, fields, delimiter = _reference_header(path, lines)
    base = {name.removesuffix("_est") for name in fields}
    angles = next((name for name in ("yaw", "omega") if name in base), "")
    header_line = header_row + 1
    if "x" not in base:
        raise InputError.at_line(path, header_line, "the header names no X, Y, Z; export it again")
    table_rows = [
        (line, [word.strip().strip('"') for word in split_fields(text, delimiter)])
        for line, text in enumerate(lines[header_line:], start=header_line + 1)
        if text.strip() and not text.startswith("#")
    ]
    # Potree's orientedimages.txt keeps the header and has the first columns alone
    estimated = {"x_est", f"{angles}_est"} <= set(fields) and any(
        fields.index("x_est") < len(cells) and cells[fields.index("x_est")]
        for _, cells in table_rows
    )
    pose_names = [name for group in ("x", angles) for name in FIRST.get(group, ())]
    accuracies = [] if estimated else [name for name in ACCURACIES if name in fields]
    column_names = [f"{name}_est" if estimated else name for name in pose_names] + accuracies
    if missing := [name for name in column_names if name not in fields]:
        raise InputError.at_line(
            path, header_line, f"the header has no {missing[0]}; export the table with it"
        )
    names, table = _reference_rows(path, table_rows, fields, column_names, len(pose_names))
    kind, crs = kind_of_wkt(wkt, path)
    cov = None
    if len(accuracies) == len(ACCURACIES):
        cov = table[:, -3:, None] ** 2 * np.eye(3)
    if kind == GEOGRAPHIC:
        table[:, :2] = np.radians(table[:, :2])
    values = "estimated" if estimated else "reference values, not estimated ones:"
    left_out = len(table_rows) - len(names)
    notes = (f"{left_out} images without {values} pose are left out",) if left_out else ()
    if not estimated:
        notes = ("the file has reference values, none that the adjustment estimated", *notes)
    if not angles:
        images = image_names(names, path)
        return ReturnedPoses(images, table[:, :3], None, kind, crs, notes=notes, cov_position=cov)
    angle_set = "opk" if angles == "omega" else "ypr"
    poses = _poses_of_angles(path, names, table[:, :6], kind, crs, notes, angle_set)
    return replace(poses, cov_position=cov)


def _reference_header(path: Source, lines: Sequence[str]) -> tuple[str, int, list[str], str | None]:
    """Return the CRS, the row of the header #Label, its names in lower case and the delimiter."""
    stated_crs = COORDINATE_SYSTEM.match(lines[0]) if lines else None
    wkt = "" if stated_crs is None else stated_crs[1].strip()
    row = next((k for k, text in enumerate(lines) if re.match(r"#?\s*label\b", text, re.I)), None)
    if row is None:
        raise InputError.in_file(path, "has no header #Label; export the reference again")
    delimiter = next((sign for sign in "\t,;" if sign in lines[row]), None)
    names = [name.strip().lower().lstrip("# ") for name in split_fields(lines[row], delimiter)]
    without_units = [re.split("[/(]", name)[0].strip() for name in names]
    code = EPSG.search(lines[row]) if not wkt else None
    fields = [REFERENCE_NAMES.get(name, name) for name in without_units]
    return code[0] if code else wkt, row, fields, delimiter


def _reference_rows(
    path: Source,
    table_rows: Sequence[tuple[int, list[str]]],
    fields: Sequence[str],
    column_names: Sequence[str],
    pose_size: int,
) -> tuple[list[str], Array]:
    """Return names and numbers (n, columns) of the rows that have all of `pose_size` numbers."""
    columns = [fields.index(name) for name in column_names]
    names, rows = [], []
    for line, cells in table_rows:
        if len(cells) > len(fields):
            line_text = quote(" ".join(cells))
            problem = f"{len(cells)} fields, the header has {len(fields)}: {line_text}"
            raise InputError.at_line(path, line, problem)
        pose = [cells[k] if k < len(cells) else "" for k in columns]
        if all(any(pose[k : k + 3]) for k in range(0, pose_size, 3)):
            names.append(cells[fields.index("label")])
            rows.append(numbers(pose, path, line))
    return names, np.reshape(rows, (-1, len(columns)))


def read_pix4d_external(path: Source) -> ReturnedPoses:
    """Read calibrated external camera parameters of Pix4D.

    Parameters
    ----------
    path : path
        The text; <project>_offset.xyz and <project>_wkt.prj beside it are taken.

    Returns
    -------
    ReturnedPoses
        In the output CRS of the project; in a frame that is not named without _wkt.prj.

    Raises
    ------
    InputError
        A line of another length, with file and line; a damaged file beside it.
    """
    names, table = _name_xyz_opk(path, "imagename", OPK_COLUMNS)
    offset, kind, crs, notes = _pix4d_offset_and_crs(path, EXTERNAL, table[:, :3])
    table[:, :3] += offset
    return _poses_of_angles(path, names, table, kind, crs, notes)


def read_ign_opk(path: Source) -> ReturnedPoses:
    """Read the orientations of IGN: NOM X Y Z O P K CAMERA, perhaps below CHANTIER and UNITE ANGLE.

    Parameters
    ----------
    path : path
        The .OPK.

    Returns
    -------
    ReturnedPoses
        In a frame that the file does not name.

    Raises
    ------
    InputError
        A line of another length, or another unit of angles, with file and line.
    """
    lines = lines_of(decode_text(path))
    header = next((k for k, text in enumerate(lines) if IGN_HEADER.match(text)), 0)
    names, table = _name_xyz_opk(path, "nom", OPK_COLUMNS + 1, header)
    for line, text in enumerate(lines[:header], start=1):
        key, _, unit = text.lower().partition(":")
        if "angle" in key and unit.strip():
            factor = next((IGN_UNITS[k] for k in IGN_UNITS if unit.strip().startswith(k)), None)
            if factor is None:
                raise InputError.at_line(
                    path, line, f"angles in {quote(unit.strip())}; grades, degres, radians are read"
                )
            table[:, 3:] *= factor
    return _poses_of_angles(path, names, table)


def _name_xyz_opk(
    path: Source, first: str, columns: int, skipped: int = 0
) -> tuple[list[str], Array]:
    """Return names and a table (n, 6) of coordinates and omega, phi, kappa, deg.

    The header, which may be missing, begins with `first`; lines before it are `skipped`.
    """
    names, rows = [], []
    for line, text in enumerate(lines_of(decode_text(path)), start=1):
        fields = [unquote(word) for word in split_fields(text.replace(",", " ").lstrip("# "), None)]
        if line <= skipped or not fields or fields[0].lower() == first:
            continue
        if len(fields) != columns:
            commas = "; are the decimal signs commas? write decimal points" if "," in text else ""
            raise InputError.at_line(
                path, line, f"{len(fields)} fields, expected {columns}: {quote(text)}{commas}"
            )
        names.append(fields[0])
        rows.append(numbers(fields[1:OPK_COLUMNS], path, line))
    return names, np.reshape(rows, (-1, 6))


def read_pix4d_camera(path: Source) -> ReturnedPoses:
    """Read calibrated camera parameters of Pix4D.

    Parameters
    ----------
    path : path
        The text; <project>_offset.xyz and <project>_wkt.prj beside it are taken.

    Returns
    -------
    ReturnedPoses
        As `read_pix4d_external`.

    Raises
    ------
    InputError
        A file that ends within an image, or a matrix that is no rotation, with file and line.
    """
    lines = lines_of(decode_text(path))
    first_line = 1 + next(
        (index for index, text in enumerate(lines) if text.startswith("camera model")), -1
    )
    rows = [
        (index + 1, text.split())
        for index, text in enumerate(lines)
        if index >= first_line and text.strip()
    ]
    names, centre, matrices = [], [], []
    for first_row in range(0, len(rows), PIX4D_LINES):
        section = rows[first_row : first_row + PIX4D_LINES]
        if len(section) < PIX4D_LINES or len(section[0][1]) < 3:
            line, fields = section[-1] if len(section) < PIX4D_LINES else section[0]
            problem = (
                f"{quote(' '.join(fields))}: an image has {PIX4D_LINES} lines; copy the file again"
            )
            raise InputError.at_line(path, line, problem)
        names.append(" ".join(section[0][1][:-2]))
        values = [numbers(fields, path, line) for line, fields in section[6:]]
        if [len(triple) for triple in values] != [3, 3, 3, 3]:
            raise InputError.at_line(
                path, section[6][0], "position and rotation are not 4 x 3; copy it again"
            )
        centre.append(values[0])
        matrices.append(values[1:])
    images = image_names(names, path)
    R = checked_rotations(np.reshape(matrices, (-1, 3, 3)), images, path)
    position = np.reshape(centre, (-1, 3))
    offset, kind, crs, notes = _pix4d_offset_and_crs(path, PIX4D_CAMERA, position)
    return ReturnedPoses(images, position + offset, R.swapaxes(1, 2), kind, crs, notes=notes)


def _pix4d_offset_and_crs(
    path: Source, ending: str, position: Array
) -> tuple[Array, str, str, tuple[str, ...]]:
    """Return offset (3,), kind and CRS of the files beside one of Pix4D, and what is missing."""
    file = Path(path)
    if file.stem.endswith("_wgs84"):
        raise InputError.in_file(
            path, f"is in degrees; give <project>{ending}.txt, which is in metres"
        )
    project = file.name.partition(ending)[0] if ending in file.name else ""
    offset, notes = np.zeros(3), []
    offset_file = file.with_name(f"{project}_offset.xyz")
    if project and offset_file.is_file():
        fields = " ".join(lines_of(decode_text(offset_file))).split()
        if len(fields) != len(offset):
            raise InputError.at_line(
                offset_file, 1, f"{len(fields)} numbers, expected 3; copy it again"
            )
        offset = np.array(numbers(fields, offset_file, 1))
    elif float(np.abs(position).max(initial=0.0)) < FAR_M:
        notes.append(
            f"{file.name}: no {project or '<project>'}_offset.xyz beside it; coordinates are taken"
            " as they are"
        )
    definition = file.with_name(f"{project}_wkt.prj")
    kind, crs = "", ""
    if project and definition.is_file():
        kind, crs = kind_of_wkt(" ".join(lines_of(decode_text(definition))).strip(), definition)
    return offset, kind, crs, tuple(notes)


def read_odm_geo(path: Source) -> ReturnedPoses:
    """Read positions of geo.txt; angles are not read, since the program itself turns them.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    ReturnedPoses
        Positions in the CRS of the first line, with accuracies where all lines have them.

    Raises
    ------
    InputError
        No CRS, or a line that is not name, x, y, z, three angles and two accuracies, with file and
        line.
    """
    rows = numbered_lines(decode_text(path))
    crs = head_crs(path, rows[0]) if rows else ""
    names, position, sigma = [], [], []
    for line, text in rows[1:]:
        fields = text.split()
        if len(fields) not in ODM_FIELDS:
            problem = f"{len(fields)} fields, name x y z yaw pitch roll horizontal vertical"
            raise InputError.at_line(path, line, f"{problem} are expected: {quote(text.strip())}")
        names.append(fields[0])
        position.append(numbers(fields[1:4], path, line))
        if len(fields) == ODM_FIELDS[-1]:
            plan, height = numbers(fields[7:], path, line)
            sigma.append([plan, plan, height])
    full = len(sigma) == len(names) > 0
    cov = np.array(sigma)[:, :, None] ** 2 * np.eye(3) if full else None
    return _poses_of_positions(path, names, np.reshape(position, (-1, 3)), crs, cov)


def read_named_positions(path: Source) -> ReturnedPoses:
    """Read a table of positions by the names of images.

    Parameters
    ----------
    path : path
        As of `read_position_table`; a comment above it may name the CRS.

    Returns
    -------
    ReturnedPoses
        Positions in the CRS that the comment names, in degrees by the names of the columns.

    Raises
    ------
    InputError
        As there.
    """
    table = read_position_table(path)
    beginning = first_bytes(path, ORIGIN_BYTES).decode("latin-1")
    code = EPSG.search("".join(line for line in lines_of(beginning) if line.startswith("#")))
    if not table.geodetic:
        return _poses_of_positions(
            path, table.names, table.position, code[0] if code else "", table.cov
        )
    degrees = np.column_stack([np.degrees(table.position[:, [1, 0]]), table.position[:, 2]])
    return _poses_of_positions(
        path, table.names, degrees, code[0] if code else "EPSG:4979", table.cov
    )


def _poses_of_positions(
    path: Source, names: Sequence[str], x: Array, crs: str, cov: Array | None
) -> ReturnedPoses:
    """Return positions (n, 3) of images in a CRS, in its unit or in degrees."""
    kind, crs = kind_of_wkt(crs, path)
    if kind == GEOGRAPHIC:
        x = np.column_stack([np.radians(x[:, :2]), x[:, 2]])
    return ReturnedPoses(image_names(names, path), x, None, kind, crs, cov_position=cov)
