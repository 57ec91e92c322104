r"""What the exports of attitude share: frames, names, attitudes, angles and their sigmas.

With psi = E d(angles) the covariance of angles is E^-1 P E^-T, P the covariance of psi in the same
axes.

Angles that count from the frame's axes (omega phi kappa) come from C_fc and the P of the record.
Angles that count from true north (yaw pitch roll) come from C_Ec and C_fE^T P C_fE; in a tangent
plane, whose axes have no true north but at its origin, from those of the plane.
"""

import html
import os
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ....base import __version__
from ....base.errors import DataError, InputError, UsageError
from ....base.output.staging import destination, together
from ....base.units import METRE
from ....geodesy.rotation import (
    opk_from_rotation,
    opk_jacobian,
    pok_from_rotation,
    pok_jacobian,
    rpy_from_rotation,
    rpy_jacobian,
    ypr_from_rotation,
    ypr_jacobian,
)
from ....records import FramedOrientation, MapFrame
from ....records.framed import GEOGRAPHIC
from ..text.layout import COMMENTS, NUMBER

Array = NDArray[np.float64]

# of the middle angle: within 0.2 seconds of arc of 90 deg the outer two are one turn
LEAST_COSINE = 1e-6
EXPORT_QUOTES = "\"'"
COMMENT_SIGNS = (*COMMENTS, *EXPORT_QUOTES)  # a name that begins so would not be read as one
CONTROL = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f\ud800-\udfff\ufffe\uffff\r\t]")
"""What XML 1.0 does not have, tab, carriage return and delete."""
SPREADSHEET, FORMULA = (",", ";", "\t"), "=+-@"


@dataclass(frozen=True, eq=False)
class PlacedCameras:
    """Camera positions without attitude in a frame.

    Parameters
    ----------
    images : tuple of str
        Names.
    frame : MapFrame
        A projected CRS, or geographic coordinates of WGS84.
    coordinates : ndarray, shape (n, 3)
        Longitude, latitude, rad, or easting, northing, m; height, m.
    cov : ndarray, shape (n, 3, 3)
        Covariances in the frame's axes at the images, m^2.
    """

    images: tuple[str, ...]
    frame: MapFrame
    coordinates: Array
    cov: Array


Placed = FramedOrientation | PlacedCameras


class UnfitName(InputError):
    """A format cannot hold a name, which another one could."""


@dataclass(frozen=True)
class ExportedAngles:
    """Three angles of a rotation: their names, how to compute them, and the Jacobian E.

    The second angle is that of the singularity.
    """

    names: str
    from_rotation: Callable[[Array], Array]
    jacobian: Callable[[Array], Array]


OPK_ANGLES = ExportedAngles("omega phi kappa", opk_from_rotation, opk_jacobian)
POK = ExportedAngles("phi omega kappa", pok_from_rotation, pok_jacobian)
YPR = ExportedAngles("yaw pitch roll", ypr_from_rotation, ypr_jacobian)
RPY = ExportedAngles("roll pitch yaw", rpy_from_rotation, rpy_jacobian)


def check_names(names: Sequence[str], separator: str | None, of: str = "image") -> None:
    """Refuse names that a table with this separator would not give back.

    Parameters
    ----------
    names : sequence of str
        The names.
    separator : str, optional
        None stands for blanks. Comment signs and control characters are refused as well, and what
        a spreadsheet takes for a formula where it opens the table. No client reads a quoted or
        prefixed name back as it was, so that such a name is not changed in silence.
    of : str
        What they name, for the message.

    Raises
    ------
    InputError
        The first such name.
    """
    _refuse_unfit(names, lambda name: _unfit(name, separator), of)


def _refuse_unfit(
    names: Iterable[str],
    unfit: Callable[[str], str],
    of: str,
    holder: str = "this format cannot hold",
) -> None:
    """Refuse the first name of which `unfit` says why the holder does not take it."""
    for name in names:
        if why := unfit(name):
            raise UnfitName.advised(f"{of} name {name!r} {why}, which {holder}", f"rename the {of}")


def quoted_names(names: Sequence[str], separator: str | None, of: str = "image") -> tuple[str, ...]:
    """Return names as a table of ours has them, which `text.layout` reads back.

    Those that would not stand for themselves are in double quotation marks, doubled within.

    Parameters
    ----------
    names : sequence of str
        The names.
    separator : str, optional
        None stands for blanks.
    of : str
        What they name, for the message.

    Raises
    ------
    InputError
        A name that is empty or has a line end; one that a spreadsheet takes for a formula, quoted
        or not, where it opens the table.
    """

    def unfit(name: str) -> str:
        if {"\n", "\r", "\0"} & set(name):
            return "has a line end"
        return (_control(name) or _formula(name, separator)) if name else "is empty"

    _refuse_unfit(names, unfit, of, "no table holds")
    return tuple(
        '"' + name.replace('"', '""') + '"'
        if _unfit(name, separator) or name[0] in EXPORT_QUOTES or name[-1] in EXPORT_QUOTES
        else name
        for name in names
    )


def _control(name: str) -> str:
    """Return which control character a name has, or an empty text."""
    match = CONTROL.search(name)
    return "" if match is None else f"has the control character {match[0]!r}"


def _formula(name: str, separator: str | None) -> str:
    """Return why a spreadsheet takes a name for a formula, or an empty text."""
    if separator in SPREADSHEET and name[0] in FORMULA and not NUMBER.fullmatch(name):
        return f"begins with {name[0]}, as formulas of spreadsheets do"
    return ""


def check_characters(names: Iterable[str], of: str = "image") -> None:
    """Refuse names with characters that XML 1.0 does not have, escaped or not.

    Parameters
    ----------
    names : iterable of str
        The names.
    of : str
        What they name, for the message.

    Raises
    ------
    InputError
        The first such name.
    """
    _refuse_unfit(names, _control, of)


def xml_text(text: str, quotes: bool = False) -> str:
    """Return text escaped for XML 1.0; a character that it does not have becomes U+FFFD.

    quotes : whether it stands in quotation marks, as a value of an attribute.
    """
    return html.escape(CONTROL.sub("\ufffd", text), quote=quotes)


def _unfit(name: str, separator: str | None) -> str:
    """Return why a name does not fit, or an empty text."""
    if not name:
        return "is empty"
    if "\n" not in name and (control := _control(name)):
        return control
    if formula := _formula(name, separator):
        return formula
    if sign := next((sign for sign in COMMENT_SIGNS if name.startswith(sign)), ""):
        return f"begins with {sign}"
    if separator is None:
        return "has a blank" if any(c.isspace() for c in name) else ""
    if "\n" in name:
        return "has a line end"
    if separator in name:
        return f"has {separator!r}"
    return "begins or ends with a blank" if name != name.strip() else ""


@contextmanager
def new_directory(
    directory: Path, own: Collection[str], alike: Callable[[str], bool], contents: str
) -> Iterator[Path]:
    """Give a directory to write files into, which appears whole or not at all.

    A file, and a directory that holds similar files of another export, are refused: these would
    pass for this export's.

    Parameters
    ----------
    directory : Path
        The directory to be written.
    own : collection of str
        Names of the files to be written.
    alike : callable
        Tells whether a name is like these.
    contents : str
        What the files are, for the message.

    Yields
    ------
    Path
        Where to write.

    Raises
    ------
    UsageError
        A file, or a directory with other files like these.
    """
    present = destination(directory)
    if present.exists() and not present.is_dir():
        raise UsageError(
            f"{present}: is a file, but the export writes a directory; give another name"
        )
    files = sorted(os.listdir(present)) if present.is_dir() else []
    if other := [file for file in files if alike(file) and file not in own]:
        raise UsageError(
            f"{present}: holds {contents} of another export ({other[0]}); give a new directory"
        )
    with together() as staging:
        yield staging.tree(directory)


def check_choice(option: str, value: object, choices: Collection[str]) -> None:
    """Refuse a value of an option that is none of its choices, with UsageError."""
    if value not in choices:
        raise UsageError(f"{option} {value!r} is none of {', '.join(choices)}")


def angle_sigma(
    angles: Array,
    jacobian: Callable[[Array], Array],
    middle: int,
    P: Array,
    who: Sequence[str] | Callable[[int], str],
    set_name: str,
) -> Array:
    """Return standard deviations (n, 3), rad, of angles whose psi has the covariances P.

    Parameters
    ----------
    angles : ndarray
        (n, 3) rad.
    jacobian : callable
        E of the angles.
    middle : int
        Index of the angle at whose right angles the set is singular.
    P : ndarray
        (n, 3, 3) covariances of psi.
    who : sequence or callable
        Image names, or what names a row.
    set_name : str
        Names of the angles.

    Raises
    ------
    DataError
        The first row at the singularity.
    """
    flat = np.cos(angles[:, middle]) < LEAST_COSINE
    if flat.any():
        row = int(np.argmax(flat))
        name = who(row) if callable(who) else f"image {who[row]}"
        degrees = np.degrees(angles[row, middle])
        message = f"the middle angle of {set_name} is {degrees:.4f} deg, where the set is singular"
        raise DataError(
            f"{name}: {message}; export a format without angles: bentley, colmap, g2o or eo_json"
        )
    E = jacobian(angles)
    # the rows of the inverse are the cross products of the columns over the determinant
    a, b, c = np.moveaxis(E, 2, 0)
    F = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
    F /= np.einsum("ni,ni->n", a, F[:, 0])[:, None, None]
    return np.sqrt(np.einsum("nij,nij->ni", F @ P, F))


def angles_of(
    eo: FramedOrientation, R: Array, P: Array, angle_set: ExportedAngles
) -> tuple[Array, Array]:
    """Return angles and standard deviations (n, 3), rad, of rotations R (n, 3, 3).

    P is the covariance of their psi, in left-hand axes.
    """
    angles = angle_set.from_rotation(R)
    return angles, angle_sigma(angles, angle_set.jacobian, 1, P, eo.images, angle_set.names)


def places(eo: Placed) -> Array:
    """Return coordinates (n, 3) as files have them.

    Longitude and latitude are in degrees, everything else in the unit of the CRS: m as a rule.
    """
    if eo.frame.kind != GEOGRAPHIC:
        return eo.coordinates / eo.frame.unit_m
    height = eo.coordinates[:, 2] / eo.frame.unit_m[2]
    return np.column_stack([np.degrees(eo.coordinates[:, :2]), height])


def position_sigma(eo: Placed) -> Array:
    """Return standard deviations (n, 3), m, along the frame's axes."""
    return np.sqrt(np.diagonal(eo.cov, axis1=1, axis2=2)[:, :3])


def places_sigma(eo: Placed) -> Array:
    """Return standard deviations (n, 3) along the frame's axes, in the units of `places`."""
    return position_sigma(eo) / eo.frame.unit_m


def plan_and_height_sigma(eo: Placed) -> Array:
    """Return horizontal and vertical standard deviations (n, 2), in the units of `places_sigma`.

    The horizontal one is the root mean square of both; not of a geocentric frame.
    """
    s = places_sigma(eo)
    return np.column_stack([np.sqrt(0.5 * (s[:, 0] ** 2 + s[:, 1] ** 2)), s[:, 2]])


def table_text(
    head: str, images: Sequence[str] | Sequence[int], form: str, table: Array, name_column: int = 0
) -> Iterable[str]:
    """Yield `head`, then lines of names and numbers.

    Parameters
    ----------
    head : str
        What stands before.
    images : sequence
        The names.
    form : str
        % format of a line, with its newline.
    table : ndarray
        (n, m) the numbers.
    name_column : int
        Column of the name.
    """
    yield head
    for name, row in zip(images, table.tolist(), strict=True):
        yield form % (*row[:name_column], name, *row[name_column:])


def listed_rows(head: str, rows: Iterable[str], between: str, foot: str) -> Iterator[str]:
    """Yield rows with `between` them, `head` before and `foot` behind."""
    yield head
    separator = ""
    for row in rows:
        yield separator + row
        separator = between
    yield foot


def one_line(text: str) -> str:
    """Return text on one line, without commas, to stand in a table's header."""
    return " ".join(text.replace(",", " ").split())


def frame_words(eo: Placed) -> str:
    """Return frame and heights in words."""
    heights = f", heights {eo.frame.heights}" if eo.frame.heights else ""
    if eo.frame.scaled_from_m is not None:
        heights += f", scaled from the ground at {eo.frame.scaled_from_m:.2f} m"
    plan, height = eo.frame.units
    if plan != METRE or height != METRE:
        differ = f", heights in {height.plural}" if height != plan else ""
        heights += f", coordinates and their standard deviations in {plan.plural}{differ}"
    return " ".join(f"{eo.frame.name}{heights}".split())


def comment_lines(
    eo: FramedOrientation, *more: str, applied: str = "lever arm and bore-sight applied"
) -> str:
    """Return comment lines: the content, its frame, what was `applied`, `more`, the history."""
    lines = [
        (
            f"insgnss {__version__}: exterior orientation of {len(eo.images)} images, GPS week"
            f" {eo.gps_week}"
        ),
        f"frame: {frame_words(eo)}",
        f"position: projection centre; {applied}",
        *more,
        *(f"done: {' '.join(sentence.split())}" for sentence in eo.history),
    ]
    return "".join(f"# {line}\n" for line in lines)
