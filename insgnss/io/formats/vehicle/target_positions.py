"""Positions of a moving target as a plain table, data_specs/target_positions.md."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ....base.errors import InputError
from ..blocks.columns import first_repeat, named_columns, positive, rows_of, write_table
from ..blocks.ground_points import ALIASES as GROUND
from ..blocks.ground_points import METRES
from ..orientation.exported import quoted_names
from ..text.columns import TIME, Aliases, Columns, gps_time
from ..text.layout import shown
from ..text.text import Source, read_text_table

Array = NDArray[np.float64]

POSITION = ("x", "y", "z", "sigma_x", "sigma_y", "sigma_z")
CORRELATIONS = ("corr_xy", "corr_xz", "corr_yz")
ALIASES: Aliases = {
    "image": ("image", "img", "photo", "image_name", "image_id", "filename"),
    **TIME,
    **{name: GROUND[name] for name in POSITION},
    **{name: (name, name.replace("corr", "rho")) for name in CORRELATIONS},
}
DEFAULTS = (("image", *POSITION), ("week", "tow", *POSITION))
UNITS = (*METRES, "s", "1")


@dataclass(frozen=True, eq=False)
class TargetPositions:
    """Where a moving target was.

    Parameters
    ----------
    images : tuple of str or None
        (n,) image that saw it there; None where the table has stamps alone.
    time : ndarray or None
        (n,) s of `gps_week`; None where the table names images alone.
    gps_week : int or None
        GPS week of `time`, where the table says it.
    position_m : ndarray
        (n, 3) in the axes of the block, or of a projected CRS, m.
    cov : ndarray
        (n, 3, 3) covariance of each, m^2.
    """

    images: tuple[str, ...] | None
    time: Array | None
    gps_week: int | None
    position_m: Array
    cov: Array


def read_target_positions(path: Source, columns: Columns = None) -> TargetPositions:
    """Read a table of target positions.

    Parameters
    ----------
    path : path
        The file.
    columns : sequence or mapping, optional
        As of `insgnss.io.formats.text.columns.columns_of`.

    Returns
    -------
    TargetPositions
        The positions; those with stamps in the order of time.

    Raises
    ------
    InputError
        A column that is unknown, a field that is no number, a standard deviation that is not
        positive, a covariance that is none, an image or a stamp that is there twice, or neither
        images nor stamps, with file and line.
    """
    table = read_text_table(path)
    index = named_columns(table, ALIASES, POSITION, DEFAULTS, UNITS, columns)
    if "image" not in index and "tow" not in index:
        raise table.error_at(
            0,
            "neither image nor tow among its columns: nothing says when the target was there; name"
            " the image that saw it, or the time (tow, and week)",
        )
    images, time, week = None, None, None
    if "image" in index:
        names, rows = rows_of(table, index["image"], "image")
        if (twice := first_repeat(rows)) is not None:
            raise table.error_at(
                twice[1],
                f"image {shown(names[rows[twice[1]]])} is there twice, before in line"
                f" {table.lines[twice[0]]}; delete one of the lines",
            )
        images = names
    if "tow" in index:
        weeks = table.floats(index["week"]) if "week" in index else None
        time, week = gps_time(table, table.floats(index["tow"]), weeks, None)
    position = np.column_stack([table.floats(index[name]) for name in POSITION[:3]])
    sigma = np.column_stack([positive(table, index[name], name, "m") for name in POSITION[3:]])
    correlation = np.tile(np.eye(3), (len(sigma), 1, 1))
    for name, (i, j) in zip(CORRELATIONS, ((0, 1), (0, 2), (1, 2)), strict=True):
        if name in index:
            correlation[:, i, j] = correlation[:, j, i] = table.floats(index[name])
    smallest = np.linalg.eigvalsh(correlation)[:, 0]
    if (smallest <= 1e-9).any():
        row = int(np.argmin(smallest))
        raise table.error_at(row, "correlations that cannot be: no covariance has them; see units")
    cov = sigma[:, :, None] * correlation * sigma[:, None, :]
    if time is not None:
        order = np.argsort(time, kind="stable")
        if (same := np.diff(time[order]) <= 0.0).any():
            row = int(order[1:][np.argmax(same)])
            raise table.error_at(row, f"time {time[row]:.6f} s is there twice; delete one line")
        time, position, cov = time[order], position[order], cov[order]
        images = None if images is None else tuple(images[k] for k in order)
    return TargetPositions(images, time, week, position, cov)


def write_target_positions(
    positions: TargetPositions, path: Source, comments: Sequence[str] = ()
) -> None:
    """Write a table of target positions: seconds with 6 decimals, coordinates with 4.

    Parameters
    ----------
    positions : TargetPositions
        The positions.
    path : path
        The file, written whole or not at all.
    comments : sequence of str
        Lines before the header, such as what the axes are.

    Raises
    ------
    InputError
        A name that the table cannot hold, or stamps without their week.
    UsageError
        The file cannot be written.
    """
    n = len(positions.position_m)
    head: list[str] = []
    first = [""] * n
    if positions.images is not None:
        names = quoted_names(positions.images, ",")
        head, first = ["image"], [f"{name}," for name in names]
    if positions.time is not None:
        if positions.gps_week is None:
            raise InputError("target positions: stamps without GPS week; give it")
        head += ["week", "tow"]
        first = [
            f"{a}{positions.gps_week},{t:.6f}," for a, t in zip(first, positions.time, strict=True)
        ]
    sigma = np.sqrt(np.diagonal(positions.cov, axis1=1, axis2=2))
    corr = positions.cov / sigma[:, :, None] / sigma[:, None, :]
    values = np.column_stack(
        [positions.position_m, sigma, corr[:, 0, 1], corr[:, 0, 2], corr[:, 1, 2]]
    )
    form = "%.4f,%.4f,%.4f,%.5f,%.5f,%.5f,%.5f,%.5f,%.5f\n"
    rows = (a + form % tuple(v) for a, v in zip(first, values.tolist(), strict=True))
    write_table(path, comments, (*head, *POSITION, *CORRELATIONS), rows)
