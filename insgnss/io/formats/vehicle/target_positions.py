"""Positions of a moving target as a plain table, data_specs/target_positions.md."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ....base.errors import InputError
from ....records import Array
from ..names import IN_IMAGE, PLACES, TIME
from ..orientation.exported import quoted_names
from ..text.columns import METRES, Columns, TableOut, TableSpec
from ..text.layout import quote
from ..text.text import Source

SIGMAS, CORRELATIONS = "sigma_x sigma_y sigma_z", ("corr_xy", "corr_xz", "corr_yz")
TARGET_COLUMNS = f"x y z {SIGMAS}"
SPEC = TableSpec(
    {
        "image": IN_IMAGE["image"],
        **TIME,
        **PLACES,
        **{name: f"{name} {name.replace('corr', 'rho')}" for name in CORRELATIONS},
    },
    required=TARGET_COLUMNS,
    layouts=(f"image {TARGET_COLUMNS}", f"week tow {TARGET_COLUMNS}"),
    text=True,
    strict=f"{METRES} s 1",
)
OUT = (
    "x=%.4f y=%.4f z=%.4f sigma_x=%.5f sigma_y=%.5f sigma_z=%.5f"
    " corr_xy=%.5f corr_xz=%.5f corr_yz=%.5f"
)


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
        As of `text.columns.TableSpec.index`.

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
    table = SPEC.read(path, columns)
    if "image" not in table and "tow" not in table:
        raise table.error_at(
            0,
            "no column image or tow, so the time of the target's positions is unknown; add the"
            " image that shows the target, or the time (tow, and week)",
        )
    images, time, week = None, None, None
    if "image" in table:
        names, rows = table.rows_of("image", "image")
        table.refuse_repeats(lambda row: f"image {quote(names[rows[row]])} is there twice", rows)
        images = names
    if "tow" in table:
        time, week = table.gps_time()
    position, sigma = table.block("x y z"), table.positive(SIGMAS, "m")
    correlation = np.tile(np.eye(3), (len(sigma), 1, 1))
    for name, (i, j) in zip(CORRELATIONS, ((0, 1), (0, 2), (1, 2)), strict=True):
        if name in table:
            correlation[:, i, j] = correlation[:, j, i] = table.floats(name)
    smallest = np.linalg.eigvalsh(correlation)[:, 0]
    if (smallest <= 1e-9).any():
        row = int(np.argmin(smallest))
        raise table.error_at(
            row, "the correlations give no positive definite covariance matrix; correct them"
        )
    cov = sigma[:, :, None] * correlation * sigma[:, None, :]
    if time is not None:
        order = np.argsort(time, kind="stable")
        if (repeated := np.diff(time[order]) <= 0.0).any():
            row = int(order[1:][np.argmax(repeated)])
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
    columns, texts, numbers = OUT, [], []
    if positions.time is not None:
        if positions.gps_week is None:
            raise InputError("target positions: stamps without GPS week; set gps_week")
        columns = f"week=%d tow=%.6f {columns}"
        numbers = [np.full(len(positions.time), positions.gps_week), positions.time]
    if positions.images is not None:
        columns, texts = f"image {columns}", [quoted_names(positions.images, ",")]
    sigma = np.sqrt(np.diagonal(positions.cov, axis1=1, axis2=2))
    corr = positions.cov / sigma[:, :, None] / sigma[:, None, :]
    values = [positions.position_m, sigma, corr[:, 0, 1], corr[:, 0, 2], corr[:, 1, 2]]
    TableOut(columns).write(path, np.column_stack([*numbers, *values]), *texts, comments=comments)
