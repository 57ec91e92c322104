r"""The columns of text tables of exterior orientations, and how they are computed and written.

Columns come in groups that are computed together; a template names single columns or whole groups.
The tables of all programs are such templates.
With X the axes of the camera, CV (right, down, viewing direction) or RUB (right, up, back), and f
the frame,

    omega phi kappa ...      C_fX = Rx(omega) Ry(phi) Rz(kappa), or its inverse where the attitude
                             is "frame to camera"
    phi_pok omega_pok kappa_pok      the same of Ry(phi) Rx(omega) Rz(kappa)
    r11 ... r33, qw qx qy qz         the same rotation
    yaw pitch roll           C_EX = Rz(-yaw) Rx(pitch) Ry(roll), X = RUB always
    roll_ned pitch_ned yaw_ned       C_nb of the body forward right down: NED_ENU C_Ec T B, T
                                     nominal mounting, B bore-sight
    gimbal_yaw ...           the camera's axes viewing direction, right, down into north, east,
                             down: Rz(yaw) Ry(pitch) Rx(roll)

E is true north, or the frame's axes where `north` says so. The inverse R^T errs by -R^T psi in its
left-hand axes: P becomes R^T P R. Standard deviations are those of E^-1 P E^-T; their columns have
the names of the angles with s_ before.
"""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....base.files import atomic_write
from ....base.units import METRE, LengthUnit
from ....geodesy.gpstime import WEEK_S
from ....geodesy.rotation import CV_RUB, NED_ENU, quaternion_from_rotation
from ....records import FramedOrientation
from ....records.framed import GEOGRAPHIC, TANGENT
from ..text.text import Source
from .exported import (
    OPK_ANGLES,
    POK,
    RPY,
    YPR,
    ExportedAngles,
    Placed,
    angles_of,
    check_names,
    places,
    places_sigma,
    plan_and_height_sigma,
    table_text,
)

Array = NDArray[np.float64]

CAMERA_AXES = {"RUB": "x right, y up, z back", "CV": "x right, y down, z viewing direction"}
ROTATION_SENSES = ("camera to frame", "frame to camera")
NORTHS = ("true", "frame")
ANGLE_FACTORS = {"deg": np.degrees(1.0), "gon": 200.0 / np.pi, "rad": 1.0}  # of a radian
# of numbers by their kind: below any standard deviation of a survey (chosen)
DECIMALS = {"degree": 10, "metre": 4, "sigma": 5, "angle": 6, "angle sigma": 6}
DECIMALS |= {"matrix": 12, "second": 6, "whole": 0}
PLACEHOLDER = "NaN"  # stands in the place of a column that a program expects
# takes viewing direction, right, down into x, y, z of CV
GIMBAL_CV: Array = np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]])


@dataclass(frozen=True)
class Conventions:
    """What angles and matrices of a table mean.

    Attributes
    ----------
    camera_axes : str
        Axes of the camera, a key of `CAMERA_AXES`.
    attitude : str
        Direction of the rotation, one of `ROTATION_SENSES`.
    north : str
        North of yaw, one of `NORTHS`.
    unit : str
        Unit of angles.
    lengths : tuple of LengthUnit
        Units of plan and of heights, those of standard deviations included.
    """

    camera_axes: str = "RUB"
    attitude: str = ROTATION_SENSES[0]
    north: str = NORTHS[0]
    unit: str = "deg"
    lengths: tuple[LengthUnit, LengthUnit] = (METRE, METRE)


@dataclass(frozen=True)
class ColumnGroup:
    """Columns that are computed together.

    `kind` is "metre", "place", "sigma", "angle", "angle sigma", "matrix", "second" or "whole".
    """

    columns: tuple[str, ...]
    kind: str
    compute: Callable[[Any, Conventions], Array]


def in_camera_axes(eo: FramedOrientation, how: Conventions) -> tuple[Array, Array]:
    """Return the rotation of the frame's attitude by `how`, and the covariances of its psi.

    Both are (n, 3, 3).
    """
    R, P = eo.C_fc @ (CV_RUB if how.camera_axes == "RUB" else np.eye(3)), eo.cov[:, 3:, 3:]
    if how.attitude == ROTATION_SENSES[0]:
        return R, P
    R_t = R.swapaxes(1, 2)
    return R_t, R_t @ P @ R


def to_north(eo: FramedOrientation, how: Conventions) -> tuple[Array, Array]:
    """Return the rotation of the camera (CV) to east, north, up, and the covariances of psi there.

    Both are (n, 3, 3); `how` says which north.
    """
    if how.north == "frame":
        return eo.C_fc, eo.cov[:, 3:, 3:]
    return eo.C_Ec, eo.C_fE.swapaxes(1, 2) @ eo.cov[:, 3:, 3:] @ eo.C_fE


def _camera(eo: FramedOrientation, how: Conventions) -> tuple[Array, Array]:
    R, P = to_north(eo, how)
    return R @ CV_RUB, P


def _body(eo: FramedOrientation, how: Conventions) -> tuple[Array, Array]:
    R, P = to_north(eo, how)
    return NED_ENU @ R @ eo.C_cb, NED_ENU @ P @ NED_ENU


def _gimbal(eo: FramedOrientation, how: Conventions) -> tuple[Array, Array]:
    R, P = to_north(eo, how)
    return NED_ENU @ R @ GIMBAL_CV, NED_ENU @ P @ NED_ENU


def _angle_groups(
    name: str,
    columns: str,
    attitude: Callable[[FramedOrientation, Conventions], tuple[Array, Array]],
    angle_set: ExportedAngles,
) -> Iterator[tuple[str, ColumnGroup]]:
    names = tuple(columns.split())

    def values(which: int) -> Callable[[FramedOrientation, Conventions], Array]:
        return lambda eo, how: angles_of(eo, *attitude(eo, how), angle_set)[which]

    yield name, ColumnGroup(names, "angle", values(0))
    yield (
        f"s_{name}",
        ColumnGroup(tuple(f"s_{column}" for column in names), "angle sigma", values(1)),
    )


def _fold_angles(eo: FramedOrientation) -> Array:
    return np.column_stack([eo.time % WEEK_S, eo.gps_week + eo.time // WEEK_S])


COLUMN_GROUPS: dict[str, ColumnGroup] = {
    "xyz": ColumnGroup(("x", "y", "z"), "place", lambda eo, _: places(eo)),
    "llh": ColumnGroup(
        ("lat", "lon", "h"),
        "geodetic",
        lambda eo, _: np.column_stack(
            [np.degrees(eo.geodetic[:, :2]), eo.geodetic[:, 2] / eo.frame.unit_m[2]]
        ),
    ),
    "s_xyz": ColumnGroup(("sx", "sy", "sz"), "sigma", lambda eo, _: places_sigma(eo)),
    "s_plan": ColumnGroup(
        ("s_horizontal", "s_vertical"), "sigma", lambda eo, _: plan_and_height_sigma(eo)
    ),
    **dict(_angle_groups("opk", "omega phi kappa", in_camera_axes, OPK_ANGLES)),
    **dict(_angle_groups("pok", "phi_pok omega_pok kappa_pok", in_camera_axes, POK)),
    **dict(_angle_groups("ypr", "yaw pitch roll", _camera, YPR)),
    **dict(_angle_groups("ned", "roll_ned pitch_ned yaw_ned", _body, RPY)),
    **dict(_angle_groups("gimbal", "gimbal_roll gimbal_pitch gimbal_yaw", _gimbal, RPY)),
    "matrix": ColumnGroup(
        tuple(f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3)),
        "matrix",
        lambda eo, how: in_camera_axes(eo, how)[0].reshape(-1, 9),
    ),
    "quaternion": ColumnGroup(
        ("qw", "qx", "qy", "qz"),
        "matrix",
        lambda eo, how: quaternion_from_rotation(in_camera_axes(eo, how)[0]),
    ),
    "time": ColumnGroup(("tow", "week"), "time", lambda eo, _: _fold_angles(eo)),
    "number": ColumnGroup(
        ("number",), "whole", lambda eo, _: np.arange(1.0, len(eo.images) + 1.0)[:, None]
    ),
}
GROUP_OF = {column: name for name, group in COLUMN_GROUPS.items() for column in group.columns}
OF_NORTH = ("ypr", "ned", "gimbal")


def kind_of(column: str, frame_kind: str) -> str:
    """Return what a number of this column is.

    It is "degree", "metre", "sigma", "angle", "angle sigma", "matrix", "second" or "whole".
    """
    kind = COLUMN_GROUPS[GROUP_OF[column]].kind
    if kind == "time":
        return "second" if column == "tow" else "whole"
    if column in ("lat", "lon") or (column in ("x", "y") and frame_kind == GEOGRAPHIC):
        return "degree"
    return "metre" if kind in ("place", "geodetic") else kind


def of_height(column: str) -> bool:
    """Tell whether a length counts in the unit of heights."""
    return column in ("z", "sz", "h", "s_vertical")


def column_names(columns: str | Sequence[str]) -> list[str]:
    """Return the single columns of a template."""
    tokens = re.split(r"[\s,]+", columns.strip()) if isinstance(columns, str) else list(columns)
    return [
        name
        for token in tokens
        for name in (COLUMN_GROUPS[token].columns if token in COLUMN_GROUPS else (token,))
    ]


def usual(eo: Placed) -> Conventions:
    """Return the conventions of the programs: true north, in a tangent plane that of its axes."""
    return Conventions(north="frame" if eo.frame.kind == TANGENT else "true")


def numbers_of(eo: Placed, columns: str | Sequence[str], how: Conventions | None = None) -> Array:
    """Return the columns (n, k) of a template of numbers alone, in the units of a file."""
    how = how or usual(eo)
    names = column_names(columns)
    blocks = {
        name: COLUMN_GROUPS[name].compute(eo, how)
        for name in dict.fromkeys(GROUP_OF[column] for column in names)
    }
    out = np.empty((len(eo.images), len(names)))
    for k, column in enumerate(names):
        group = COLUMN_GROUPS[GROUP_OF[column]]
        unit = ANGLE_FACTORS[how.unit] if group.kind.startswith("angle") else 1.0
        out[:, k] = unit * blocks[GROUP_OF[column]][:, group.columns.index(column)]
    return out


def line_form(
    eo: Placed,
    columns: str | Sequence[str],
    separator: str,
    decimals: Mapping[str, int] = DECIMALS,
) -> str:
    """Return the % format of the columns of a template, text of images among them."""

    def form(name: str) -> str:
        if name == "image":
            return "%s"
        return name if name == PLACEHOLDER else f"%.{decimals[kind_of(name, eo.frame.kind)]}f"

    return separator.join(map(form, column_names(columns)))


def write_columns(
    eo: Placed,
    path: Source,
    columns: str,
    separator: str,
    head: str = "",
    images: Sequence[str] | None = None,
) -> None:
    """Write the table of a program: a line an image.

    Parameters
    ----------
    eo : FramedOrientation or PlacedCameras
        The images in their frame.
    path : path
        The file.
    columns : str
        The template, "image" first, with `PLACEHOLDER` for what stays open.
    separator : str
        Of the columns: a comma, or a blank.
    head : str
        What stands before.
    images : sequence of str, optional
        Identifiers in the place of the images' names.

    Raises
    ------
    InputError
        A name that the table would not give back.
    DataError
        An angle set that is singular.
    """
    images = eo.images if images is None else images
    check_names(images, separator.strip() or None)
    numbers = [name for name in column_names(columns) if name not in ("image", PLACEHOLDER)]
    form = line_form(eo, columns, separator) + "\n"
    atomic_write(path, table_text(head, images, form, numbers_of(eo, numbers)))
