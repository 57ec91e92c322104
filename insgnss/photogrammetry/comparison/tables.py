"""Poses from tables of images that other programs take.

Their columns follow from their order, their frame from the header or from what the caller says.

    metashape            label, x, y, z, yaw, pitch, roll, and the accuracies of all
    metashape_opk        the same with omega, phi, kappa
    pix4d_matic          name, coordinates in the order of the CRS, height, yaw, pitch, roll,
                         accuracies horizontal and vertical
    pix4d_mapper         name, x, y, z, omega, phi, kappa, without header; or positions alone in the
                         order of the CRS, latitude first, with accuracies horizontal and vertical
    realitycapture       name, latitude, longitude (or x, y), altitude, yaw, pitch, roll, and the
                         accuracies of all, or heading for yaw and the interior of each image
    micmac               name, x, y, z, omega, phi, kappa, standard deviations of the position
    inpho_ascii          identifier, east, north, height, omega, phi, kappa, seconds of the GPS week
    tum                  time, x, y, z, quaternion x y z w; no names

Omega, phi, kappa and quaternions are of the frame's axes, yaw, pitch, roll of true north, in a
tangent plane of its axes; the camera has axes right, up, back, that of tum right, down, viewing
direction (data_specs of the formats). Degrees and metres.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ...base.errors import InputError
from ...base.inputs import opened_text
from ...geodesy.crs import undulation
from ...geodesy.gpstime import gps_from_unix_utc
from ...geodesy.rotation import (
    CV_RUB,
    opk_jacobian,
    rotation_from_opk,
    rotation_from_quaternion,
    rotation_from_ypr,
    ypr_jacobian,
)
from ...io.formats.origins import ORIGIN_BYTES, origin_in
from ...io.formats.text.text import TextTable, read_text_table
from ...records import Array
from .hints import Hints, diagonal, globe_of
from .poses import CoordinateFrame, Poses, degrees_for_metres, tangent_frame

ON_ELLIPSOID = "above the ellipsoid"  # of heights, as a header says it
SYNONYMS = {"yaw": "heading"}  # of RealityCapture
# how the first coordinate begins where the second is the one to the east
NORTHINGS = "lat", "north"


@dataclass(frozen=True)
class PoseColumns:
    """Columns of a format, what may follow them at the end or stand alone, and its angles."""

    columns: tuple[str, ...]
    more: tuple[tuple[str, ...], ...]
    angle_set: str
    alone: tuple[tuple[str, ...], ...] = ()

    @property
    def whole(self) -> list[tuple[str, ...]]:
        """Columns of all tables of the format."""
        return [self.columns, *((*self.columns, *more) for more in self.more), *self.alone]


def _layout(columns: str, *more: str) -> PoseColumns:
    names = tuple(columns.split())
    return PoseColumns(
        names,
        tuple(tuple(further.split()) for further in more),
        "ypr" if "yaw" in names else "opk" if "omega" in names else "quaternion",
    )


INTERIORS = "f px py k1 k2 k3 k4 t1 t2"  # of an image, by RealityCapture
_ACCURACIES = "sx sy sz s1 s2 s3"
LAYOUTS = {
    "metashape": _layout("image x y z yaw pitch roll", _ACCURACIES),
    "metashape_opk": _layout("image x y z omega phi kappa", _ACCURACIES),
    "pix4d_matic": _layout("image x y z yaw pitch roll", "horizontal vertical"),
    "pix4d_mapper": replace(
        _layout("image x y z omega phi kappa"),
        alone=(("image", "x", "y", "z"), ("image", "x", "y", "z", "horizontal", "vertical")),
    ),
    "realitycapture": _layout("image x y z yaw pitch roll", _ACCURACIES, INTERIORS),
    "micmac": _layout("image x y z omega phi kappa", "sx sy sz"),
    "inpho_ascii": _layout("image x y z omega phi kappa", "time"),
    "tum": _layout("time x y z qx qy qz qw"),
}


def read_table_poses(form: str, path: Path, hints: Hints) -> Poses:
    """Poses of a file of one of `LAYOUTS`.

    Raises
    ------
    InputError
        With file and line for another table, or where neither the header nor the hints tell the
        frame.
    """
    table, layout = read_text_table(path), LAYOUTS[form]
    of = _columns(form, table, layout)
    x = _block(table, of, ("x", "y", "z"))
    head = [field.lower().partition("/")[0] for field in table.layout.header_fields or ()]
    if head and head[of["x"]].startswith(NORTHINGS):
        x = x[:, [1, 0, 2]]
    angles, R, E = _attitude(table, of, layout)
    notes: tuple[str, ...] = ()
    if R is None and degrees_for_metres(x[:, [1, 0, 2]]):
        head, x = ["lon"] * (of["x"] + 1), x[:, [1, 0, 2]]
        notes = (f"{path.name} has no header; its columns are taken as latitude and longitude",)
    frame = _frame(path, form, head[of["x"]] if head else "", x, hints)
    if R is None and frame.projection is not None and frame.projection.northing_first:
        x = x[:, [1, 0, 2]]
    unit_m = np.ones(3) if frame.projection is None else frame.projection.unit_m
    if hints.shift is not None and frame.projection is not None:
        x = x + hints.shift
    x = x * unit_m
    if frame.kind == "geographic":
        x = np.column_stack([np.radians(x[:, :2]), x[:, 2]])
        if hints.geoid is not None and ON_ELLIPSOID not in _head(path):
            x[:, 2] += undulation(hints.geoid, x[:, 1], x[:, 0])
    s_position, s_angles = _sigmas(table, of)
    time, week = _time(path, table, of)
    return frame.poses(
        path,
        form,
        x,
        R,
        layout.angle_set == "ypr" and frame.kind != "tangent plane",
        diagonal(path, None if s_position is None else s_position * unit_m),
        diagonal(path, s_angles, E),
        images=table.strings(of["image"]) if "image" in of else (),
        time=time,
        gps_week=week if week is not None else hints.gps_week,
        angle_set="" if angles is None else layout.angle_set,
        angles=angles,
        notes=notes,
    )


def _columns(form: str, table: TextTable, layout: PoseColumns) -> dict[str, int]:
    """Places of the columns.

    InputError where their number or the header's angles are of another format.
    """
    n = table.layout.n_fields
    whole = layout.whole
    names = next((columns for columns in whole if len(columns) == n), None)
    head = [field.lower() for field in table.layout.header_fields or ()]
    further = head[len(layout.columns) :]
    if form == "realitycapture" and set(further) <= set(INTERIORS.split()) and len(head) == n:
        names = names or (*layout.columns, *further)  # what its user has chosen
    if names is None:
        more = "".join(f", or also {' '.join(further)}" for further in layout.more)
        problem = f"{n} fields, but {form} has {' '.join(layout.columns)}{more}; name its format"
        # the name and the decimals of each number
        if table.layout.delimiter == "," and any(n in (2 * len(c) - 1, 2 * len(c)) for c in whole):
            problem += ", or are the decimal signs commas? write decimal points"
        raise InputError.at_line(table.path, table.layout.first_line, problem)
    for name, field in zip(names, table.layout.header_fields or (), strict=False):
        if name in ("yaw", "omega") and field.lower() not in (name, SYNONYMS.get(name)):
            why = (
                " (angles of the nominal camera, without the bore-sight: export metashape)"
                if field.lower().startswith("nominal")
                else ""
            )
            raise InputError.at_line(
                table.path,
                table.layout.header_line,
                f"{field!r} where {form} has {name}{why}; name its format",
            )
    return {name: k for k, name in enumerate(names)}


def _block(table: TextTable, of: dict[str, int], names: tuple[str, ...]) -> Array:
    return np.column_stack([table.floats(of[name]) for name in names])


def _attitude(
    table: TextTable, of: dict[str, int], layout: PoseColumns
) -> tuple[Array | None, Array | None, Array | None]:
    """Angles (n, 3) rad, the camera's rotation into their axes, and the Jacobian of psi by them.

    The camera has axes right, down, viewing direction. None of positions alone.
    """
    if not {"yaw", "omega", "qw"} & set(of):
        return None, None, None
    if layout.angle_set == "quaternion":
        return None, rotation_from_quaternion(_block(table, of, ("qw", "qx", "qy", "qz"))), None
    if layout.angle_set == "ypr":
        ypr = np.radians(_block(table, of, ("yaw", "pitch", "roll")))
        return ypr, rotation_from_ypr(ypr) @ CV_RUB, ypr_jacobian(ypr)
    opk = np.radians(_block(table, of, ("omega", "phi", "kappa")))
    return opk, rotation_from_opk(opk) @ CV_RUB, opk_jacobian(opk)


def _sigmas(table: TextTable, of: dict[str, int]) -> tuple[Array | None, Array | None]:
    """Standard deviations (n, 3) of positions, m, and of angles, rad; None where there are none."""
    if "horizontal" in of:
        return _block(table, of, ("horizontal", "horizontal", "vertical")), None
    if "sx" not in of:
        return None, None
    angles = np.radians(_block(table, of, ("s1", "s2", "s3"))) if "s1" in of else None
    return _block(table, of, ("sx", "sy", "sz")), angles


def _time(path: Path, table: TextTable, of: dict[str, int]) -> tuple[Array | None, int | None]:
    """Seconds of the GPS week, going on past its end, and the week where the clock gives it."""
    if "time" not in of:
        return None, None
    time = table.floats(of["time"])
    if "seconds since 1970" not in _head(path):
        return time, None
    week, time = gps_from_unix_utc(time)
    return time, week


def _head(path: Path) -> str:
    """Comment lines before and among the first data."""
    with opened_text(path, errors="replace") as stream:
        return "".join(line for line in stream.readlines(ORIGIN_BYTES) if line.startswith("#"))


def _frame(path: Path, form: str, first: str, x: Array, hints: Hints) -> CoordinateFrame:
    """Frame of coordinates x (n, 3): as the header says, else as the caller does.

    Parameters
    ----------
    first : name of the column of x.
    """
    head = _head(path)
    kind, datum, epoch = globe_of(head)
    if first.startswith(("lat", "lon")) or (
        first == "x" and form.startswith("metashape") and float(np.abs(x[:, :2]).max()) <= 360.0
    ):
        kind = "geographic"
    if kind in ("geographic", "geocentric"):
        return CoordinateFrame(kind, datum=datum, epoch=epoch)
    plane = origin_in(path)
    if plane is None and (projection := hints.projection_in(head if kind else "")) is not None:
        return CoordinateFrame("projected", projection=projection)
    return tangent_frame(path, x, hints.plane or plane)
