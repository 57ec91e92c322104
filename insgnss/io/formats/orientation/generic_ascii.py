"""A table of exterior orientations by template, data_specs/generic_ascii.md.

The columns are those of `ascii_columns`. The header says all conventions, so that the file reads
back without any option (`read_generic_ascii`); without a header nobody can know them, and
the reader refuses.
"""

import re
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....base.errors import InputError, UsageError
from ....base.files import atomic_write
from ....base.inputs import opened_text
from ....base.units import LENGTH_UNITS, METRE, LengthUnit
from ....geodesy.rotation import (
    CV_RUB,
    NED_ENU,
    rotation_from_opk,
    rotation_from_pok,
    rotation_from_quaternion,
    rotation_from_rpy,
    rotation_from_ypr,
)
from ....records import FramedOrientation
from ....records.framed import FRAME_KINDS, GEOCENTRIC
from ..text.numbers import finite, whole_rows
from ..text.text import Source, TextTable, read_text_table
from .ascii_columns import (
    ANGLE_FACTORS,
    CAMERA_AXES,
    COLUMN_GROUPS,
    DECIMALS,
    GIMBAL_CV,
    GROUP_OF,
    NORTHS,
    OF_NORTH,
    ROTATION_SENSES,
    Conventions,
    column_names,
    kind_of,
    line_form,
    numbers_of,
    of_height,
    usual,
)
from .exported import comment_lines, quoted_names, table_text

Array = NDArray[np.float64]

DELIMITERS = {"blank": " ", "comma": ",", "semicolon": ";", "tab": "\t"}
HEADER_FORMS = ("full", "names", "none")
DEFAULT_COLUMNS = "image xyz opk s_xyz s_opk"
CHOICES: dict[str, Collection[str]] = {
    "length_unit": LENGTH_UNITS,
    "delimiter": DELIMITERS,
    "header": HEADER_FORMS,
    "unit": ANGLE_FACTORS,
    "camera_axes": CAMERA_AXES,
    "attitude": ROTATION_SENSES,
    "north": NORTHS,
}
ROTATIONS: dict[str, Callable[[Any], Array]] = {  # by groups of columns, the best first
    "matrix": lambda rows: np.reshape(rows, (-1, 3, 3)),
    "quaternion": rotation_from_quaternion,
    "opk": rotation_from_opk,
    "pok": rotation_from_pok,
}
MOST_DECIMALS = 12  # of a number: with three digits before the point all that a double holds


def write_generic_ascii(
    eo: FramedOrientation,
    path: Source,
    columns: str | Sequence[str] = DEFAULT_COLUMNS,
    delimiter: str = "blank",
    header: str = "full",
    unit: str = "deg",
    camera_axes: str = "RUB",
    attitude: str = ROTATION_SENSES[0],
    north: str | None = None,
    decimals_m: int = 4,
    decimals_angle: int | None = None,
    length_unit: str | None = None,
) -> None:
    """Write a table in any frame.

    Parameters
    ----------
    eo : FramedOrientation
        The orientation in its frame.
    path : path
        The file.
    columns : str or sequence
        Names of columns and groups, `image` among them once.
    delimiter : {"blank", "comma", "semicolon", "tab"}
        What separates the columns.
    header : {"full", "names", "none"}
        "names" is one line of names without `#`.
    unit : {"deg", "gon", "rad"}
        Unit of angles.
    camera_axes : {"RUB", "CV"}
        Axes of the camera.
    attitude : {"camera to frame", "frame to camera"}
        Of omega phi kappa, matrix and quaternion.
    north : {"true", "frame"}, optional
        Of yaw; by default true but in a tangent plane.
    decimals_m : int
        0 to 12; standard deviations of lengths have one more.
    decimals_angle : int, optional
        0 to 12; by default 6, of radians 9.
    length_unit : {"m", "ft", "us-ft"}, optional
        Unit of coordinates, heights and their standard deviations; by default that of the CRS.

    Raises
    ------
    UsageError
        A template that makes no table.
    InputError
        Names that break it.
    DataError
        An angle set that is singular.
    """
    facing = north or usual(eo).north
    _check_choices(
        length_unit=length_unit or "m",
        delimiter=delimiter,
        header=header,
        unit=unit,
        camera_axes=camera_axes,
        attitude=attitude,
        north=facing,
    )
    if length_unit is not None:
        length = LENGTH_UNITS[length_unit]
        eo = replace(eo, frame=replace(eo.frame, units=(length, length)))
    how = Conventions(camera_axes, attitude, facing, unit, eo.frame.units)
    names = column_names(columns)
    _check_columns(eo, names, how)
    for option, value in (("decimals_m", decimals_m), ("decimals_angle", decimals_angle)):
        if value is not None and not (isinstance(value, int) and 0 <= value <= MOST_DECIMALS):
            raise UsageError(
                f"generic_ascii: {option} {value!r} is no whole number from 0 to {MOST_DECIMALS};"
                " leave it out for the usual ones"
            )
    separator = DELIMITERS[delimiter]
    between = None if delimiter == "blank" else separator
    images = quoted_names(eo.images, between)
    decimals = DECIMALS | {"metre": decimals_m, "sigma": decimals_m + 1}
    decimals["angle"] = decimals["angle sigma"] = (
        decimals_angle if decimals_angle is not None else 9 if unit == "rad" else 6
    )
    table = numbers_of(eo, [name for name in names if name != "image"], how)
    form = line_form(eo, names, separator, decimals) + "\n"
    head = _header(eo, names, how, separator, header)
    atomic_write(path, table_text(head, images, form, table, names.index("image")))


def _check_choices(**options: str) -> None:
    """Refuse an option that is none of its choices."""
    for option, value in options.items():
        if value not in (accepted := CHOICES[option]):
            raise UsageError(
                f"generic_ascii: {option} {value!r} is unknown; it is one of {', '.join(accepted)}"
            )


def _check_columns(eo: FramedOrientation, names: list[str], how: Conventions) -> None:
    """Refuse a template that makes no table."""
    unknown = [name for name in names if name != "image" and name not in GROUP_OF]
    if unknown:
        raise UsageError(
            f"generic_ascii: column {unknown[0]!r} is unknown; groups are "
            f"{', '.join(COLUMN_GROUPS)};"
            f" columns image, {', '.join(GROUP_OF)}"
        )
    twice = [name for name in names if names.count(name) > 1]
    if twice or "image" not in names:
        raise UsageError(
            f"generic_ascii: the template names {twice[0]} twice"
            if twice
            else "generic_ascii: the template has no column image"
        )
    plan = [name for name in names if name in COLUMN_GROUPS["s_plan"].columns]
    if plan and eo.frame.kind == GEOCENTRIC:
        raise UsageError(
            f"generic_ascii: {plan[0]} has no meaning in a {GEOCENTRIC} frame; take s_xyz"
        )
    if (
        how.north == "frame"
        and eo.frame.kind == GEOCENTRIC
        and any(_is_of_north(name) for name in names)
    ):
        raise UsageError("generic_ascii: a geocentric frame has no north; leave `north` out")


def _is_of_north(name: str) -> bool:
    return name != "image" and GROUP_OF[name].removeprefix("s_") in OF_NORTH


def _header(
    eo: FramedOrientation,
    names: list[str],
    how: Conventions,
    separator: str,
    header: str,
) -> str:
    if header == "none":
        return ""
    line = separator.join(names) + "\n"
    if header == "names":
        return line
    lines = [
        f"frame kind: {eo.frame.kind}",
        f"camera axes: {how.camera_axes} ({CAMERA_AXES[how.camera_axes]})",
    ]
    lines += [f"attitude: {how.attitude}", f"north: {how.north}", f"angle unit: {how.unit}"]
    if how.lengths != (METRE, METRE):
        lines.append(f"length units: {_length_words(how.lengths)}")
    return comment_lines(eo, *lines) + "#" + (" " if separator == " " else "") + line


def _length_words(units: tuple[LengthUnit, LengthUnit]) -> str:
    """Return the units of plan and heights with their lengths, as `_lengths` reads them."""
    plan, height = (f"{unit.name} = {unit.metres:.16g} m" for unit in units)
    return f"plan {plan}, heights {height}"


def _lengths(text: str) -> tuple[LengthUnit, LengthUnit]:
    """Return what `_length_words` has written; ValueError for other words."""
    units = re.fullmatch(r"plan (.+) = (\S+) m, heights (.+) = (\S+) m", text)
    if units is None:
        raise ValueError(text)
    plan, height = LengthUnit(units[1], finite(units[2])), LengthUnit(units[3], finite(units[4]))
    if not (plan.metres > 0.0 and height.metres > 0.0):
        raise ValueError(text)
    return plan, height


@dataclass(frozen=True, eq=False)
class AsciiOrientation:
    """What a table holds.

    Attributes
    ----------
    images : tuple of str
        Image names.
    frame_kind : str
        Kind of its frame.
    how : Conventions
        The conventions of its header.
    columns : dict
        Columns (n,) by name, m, s and rad (also longitude and latitude).
    """

    images: tuple[str, ...]
    frame_kind: str
    how: Conventions
    columns: dict[str, Array]

    def block(self, group: str) -> Array | None:
        """Return the columns (n, k) of a group, None where the table lacks any."""
        names = COLUMN_GROUPS[group].columns
        return (
            np.column_stack([self.columns[name] for name in names])
            if set(names) <= set(self.columns)
            else None
        )

    @property
    def C_fc(self) -> Array | None:
        """(n, 3, 3) rotations of camera axes to the frame's; None where no columns give them.

        Camera axes are x right, y down, z viewing direction.
        """
        groups = {group: self.block(group) for group in ROTATIONS}
        stated = next((group for group in groups if groups[group] is not None), None)
        if stated is None:
            return None
        R = ROTATIONS[stated](groups[stated])
        if self.how.attitude != ROTATION_SENSES[0]:
            R = R.swapaxes(1, 2)
        return R @ CV_RUB if self.how.camera_axes == "RUB" else R

    @property
    def C_Ec(self) -> Array | None:
        """(n, 3, 3) rotations of camera axes to east, north, up; None where no columns give them.

        Camera axes are those of `C_fc`; north is that of `how.north`.
        """
        if (a := self.block("ypr")) is not None:
            return np.asarray(rotation_from_ypr(a) @ CV_RUB)
        if (a := self.block("gimbal")) is not None:
            return np.asarray(NED_ENU @ rotation_from_rpy(a) @ GIMBAL_CV.T)
        return None


def read_generic_ascii(path: Source) -> AsciiOrientation:
    """Read a table that was written with a full header.

    Raises
    ------
    InputError
        Another header, or an unknown column, with file and line.
    """
    table = read_text_table(path)
    head = _header_words(path)
    try:
        kind, axes = head["frame kind"], head["camera axes"].partition(" ")[0]
        lengths = _lengths(head["length units"]) if "length units" in head else (METRE, METRE)
        how = Conventions(axes, head["attitude"], head["north"], head["angle unit"], lengths)
    except KeyError as missing:
        message = (
            f"has no header line '# {missing.args[0]}: ...'; only tables of generic_ascii with a"
            " full header say their conventions"
        )
        raise InputError.in_file(path, message) from None
    except ValueError:
        message = f"length units {head['length units']!r} are unknown; export the table again"
        raise InputError.in_file(path, message) from None
    stated = {"unit": how.unit, "camera_axes": axes, "attitude": how.attitude, "north": how.north}
    if kind not in FRAME_KINDS or any(stated[option] not in CHOICES[option] for option in stated):
        raise InputError.in_file(
            path, f"the header's conventions {kind!r}, {how} are unknown; export it again"
        )
    names = [field.lstrip("# ") for field in table.layout.header_fields or ()]
    strange = [name for name in names if name != "image" and name not in GROUP_OF]
    if strange or names.count("image") != 1:
        raise InputError.at_line(
            path,
            table.layout.header_line,
            f"the header names {strange or names}; columns are image, {', '.join(GROUP_OF)}",
        )
    values = {
        name: _column(table, k, name, kind, how) for k, name in enumerate(names) if name != "image"
    }
    return AsciiOrientation(table.strings(names.index("image")), kind, how, values)


def _column(table: TextTable, k: int, name: str, frame_kind: str, how: Conventions) -> Array:
    kind = kind_of(name, frame_kind)
    if kind == "degree":
        return np.radians(table.floats(k))
    if kind.startswith("angle"):
        return table.floats(k) / ANGLE_FACTORS[how.unit]
    if kind in ("metre", "sigma"):
        return table.floats(k) * how.lengths[of_height(name)].metres
    if kind == "whole":
        return whole_rows(table, table.floats(k), name).astype(np.float64)
    return table.floats(k)


def _header_words(path: Source) -> dict[str, str]:
    """Return what the comment lines before the table state, by key."""
    stated: dict[str, str] = {}
    with opened_text(path, errors="replace") as stream:
        for line in stream:
            if not line.startswith("#"):
                break
            key, colon, value = line[1:].partition(":")
            if colon:
                stated.setdefault(key.strip(), value.strip())
    return stated
