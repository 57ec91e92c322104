"""Fixes from named columns: units, clock, order, velocity, ranges, standard deviations.

Speed s and course c of the ground track stand for the horizontal velocity: vn = s cos c, ve = s sin
c. Where nothing says how fast the antenna rises, its vertical velocity is given as 0 with a
standard deviation of `UNKNOWN_MPS`, which is none.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ....base.errors import InputError, UsageError
from ....geodesy.frames import geodetic_to_ecef
from ....records import Array, Finding, GnssFixes
from ....records.observations import OF_THE_SOLUTION, UNKNOWN_MPS
from ..read_options import ReadOptions
from ..text.clock import clock_of, ordered_time
from ..text.order import Lines, Picked, note, refuse_rows
from .cartesian import geodetic_columns
from .pos_covariance import SIGMAS_ASSUMED
from .rounding import floor_of_zeros

FIX_SIGMAS, VELOCITY_SIGMA = ("sd_n", "sd_e", "sd_u"), ("sd_vn", "sd_ve", "sd_vd")
FIX_VELOCITIES = ("vn", "ve", "vd", "vu")
ASSUMED = "sd_assumed"  # column, not zero where the file states no standard deviations
QUALITY_CODES = ("rtklib", "nmea")
VARIANCE = ("var_n", "var_e", "var_u")
# columns that state standard deviations north, east, down, the best first
STATED_BY: dict[tuple[str, ...], tuple[tuple[str, ...], ...]] = {
    FIX_SIGMAS: (FIX_SIGMAS, ("sd_ne", "sd_ne", "sd_u"), VARIANCE),
    VELOCITY_SIGMA: (VELOCITY_SIGMA, ("sd_v", "sd_v", "sd_v")),
}
OF_POSITION = {*FIX_SIGMAS, "sd_ne", *VARIANCE}
MOST_QUALITY = 7  # largest quality code: RTKLIB has 0 to 7
# GGA to RTKLIB's codes: single, DGPS, PPS, fixed, float; else unknown
NMEA_QUALITY = {0: 0, 1: 5, 2: 4, 3: 5, 4: 1, 5: 2, 6: 0, 7: 0, 8: 0, 9: 3}
UNKNOWN_DOP = 99.0  # dilution of precision: receivers write 99.9 or 99.99 for one they do not know
LARGEST_COORDINATE = 1e7  # height (m), velocity (m/s) and their sigmas: no antenna is beyond it


@dataclass(frozen=True)
class FixScales:
    """Factors of the columns to SI and radians, the unit of time and the codes of quality."""

    angle: float = 1.0
    length: float = 1.0
    sigma: float = 1.0  # of positions
    velocity: float = 1.0
    course: float = 1.0
    time: str = "s"
    quality: str = "rtklib"


def fixes_from_columns(
    cols: Mapping[str, Array],
    lines: Lines,
    scales: FixScales,
    options: ReadOptions,
    undulation_m: float = 0.0,
    notes: tuple[Finding, ...] = (),
) -> GnssFixes:
    """Make fixes of columns, each stamp once, in order.

    Parameters
    ----------
    cols : mapping
        Columns (n,) by canonical name; those of `OF_THE_SOLUTION` may hold what is no number.
    lines : Lines
        Where the rows stand, for refusals.
    scales : FixScales
        Units of the columns.
    options : ReadOptions
        The week, where no column holds it; standard deviations, where no columns hold them, or, of
        positions, zeros or no numbers; the point that positions in metres count from.
    undulation_m : float
        Geoid above the ellipsoid, m, added to the heights.
    notes : tuple of Finding
        Notes that come before those of the order.

    Returns
    -------
    GnssFixes
        The fixes.

    Raises
    ------
    InputError
        The first row with an impossible value, or no standard deviation at all.
    """
    cols = geodetic_columns(cols, lines, options.reference, scales.angle, scales.length)
    cols, described = _apart(cols)
    if options.sigma_m is not None:
        stated = {name: np.nan_to_num(cols[name]) for name in OF_POSITION & cols.keys()}
        cols = {**cols, **stated}
    time, gps_week, rows, order_notes = ordered_time(
        lines,
        clock_of(cols),
        cols.get("week"),
        "GNSS rows",
        options.gps_week,
        scales.time,
        lambda i, k: all(column[i] == column[k] for column in cols.values()),
        partial(_positions, cols, scales),
    )
    if rows is not None:
        lines = Picked(lines, rows)
        cols, described = _take_rows(rows, cols, described)
    lat, lon = cols["lat"] * scales.angle, cols["lon"] * scales.angle
    for name, value, limit in (("lat", lat, 0.5 * np.pi), ("lon", lon, 2.0 * np.pi)):
        message = (
            f"{name} {{:.6f}} deg exceeds {np.degrees(limit):.0f}; check the columns and their"
        )
        refuse_rows(lines, np.abs(value) > limit + 1e-12, f"{message} unit", np.degrees(value))
    cols, floor_notes = with_floors_of_zeros(cols)
    height = cols["h"] * scales.length + undulation_m
    _within(lines, "height", height, "m")
    cov, assumed = _covariance(cols, FIX_SIGMAS, scales.sigma, lines, options.sigma_m, "sigma_m")
    unstated = int((assumed & (cols.get(ASSUMED, 0.0) == 0.0)).sum())
    if 0 < unstated < time.size:
        finding = f"{unstated} of {time.size} fixes state no standard deviation, or 0"
        advice = "sigma_m was used for these fixes; correct sigma_m if they are better or worse"
        expected = "positive standard deviations"
        floor_notes += (note("GNSS rows", finding, expected, advice, SIGMAS_ASSUMED),)
    velocity, velocity_cov = _velocity(cols, scales, lines, options.sigma_velocity)
    quality = _quality(cols, lines, scales.quality) if "q" in cols else None
    return GnssFixes(
        time,
        lat,
        lon,
        height,
        cov,
        velocity,
        velocity_cov,
        quality,
        gps_week,
        lines.path,
        (*notes, *order_notes, *floor_notes),
        sigma_assumed=assumed if assumed.any() else None,
        source_format="",  # the door to all readers names it
        **of_the_solution(described),
    )


def new_fixes(path: object, repeat_column: str, mark: Array) -> NDArray[np.intp]:
    """Return the rows at which the column `mark` (n,) of a file changes to a new fix.

    Raises
    ------
    InputError
        The column never changes.
    """
    is_new = np.isfinite(mark[1:]) & (mark[1:] != 0.0) & (mark[1:] != mark[:-1])
    rows = np.flatnonzero(is_new) + 1
    if rows.size == 0:
        raise InputError(
            f"{path}: {repeat_column} never changes, so no row is a new fix; set repeat_column to"
            " a field that changes with each fix, or to None"
        )
    return rows


def _positions(cols: Mapping[str, Array], scales: FixScales) -> Array:
    """ECEF positions (n, 3), m, of columns, whatever they hold."""
    with np.errstate(all="ignore"):
        lat, lon = scales.angle * cols["lat"], scales.angle * cols["lon"]
        return geodetic_to_ecef(lat, lon, scales.length * cols["h"])


def of_the_solution(columns: Mapping[str, Array]) -> dict[str, Array]:
    """Return what describes the solutions of fixes, as fields of `GnssFixes`.

    Parameters
    ----------
    columns : mapping
        Columns (n,) by the names of `OF_THE_SOLUTION`. A number that cannot be, such as a negative
        one of satellites, is not known: not-a-number. Of a program that does not know them there
        are zeros alone: then the column is left out. An age may be zero throughout, or negative.
    """
    valid = {}
    for name, column in columns.items():
        most = UNKNOWN_DOP if name.endswith("dop") else np.inf
        possible = np.isfinite(column) & ((name == "age_s") | (column >= 0.0)) & (column < most)
        valid[name] = np.where(possible, column, np.nan)
    informative = {name for name, column in valid.items() if (np.nan_to_num(column) != 0.0).any()}
    if informative and "age_s" in valid and np.isfinite(valid["age_s"]).any():
        informative.add("age_s")
    return {name: column for name, column in valid.items() if name in informative}


def _take_rows(rows: Any, *tables: Mapping[str, Array]) -> list[dict[str, Array]]:
    """Return some rows of the columns of tables."""
    return [{name: column[rows] for name, column in table.items()} for table in tables]


def _apart(cols: Mapping[str, Array]) -> tuple[Mapping[str, Array], Mapping[str, Array]]:
    """Return the columns that are needed, and those that describe the solution."""
    needed = {name: column for name, column in cols.items() if name not in OF_THE_SOLUTION}
    return needed, {name: column for name, column in cols.items() if name in OF_THE_SOLUTION}


def with_floors_of_zeros(
    cols: Mapping[str, Array],
) -> tuple[Mapping[str, Array], tuple[Finding, ...]]:
    """Return the columns with half of the last printed digit for rounded zeros, and the note.

    Only zeros of standard deviations whose other values reach down to the last digit are rounded
    (`rounding`).
    """
    floored, findings = dict(cols), []
    for name in (*FIX_SIGMAS, "sd_ne", *VELOCITY_SIGMA, "sd_v"):
        if name in cols and (floor := floor_of_zeros(cols[name])) is not None:
            zero = cols[name] == 0.0
            floored[name] = np.where(zero, floor, cols[name])
            findings.append(
                f"{name} is 0 in {int(zero.sum())} of {zero.size} fixes; {floor:g} was used"
            )
    if not findings:
        return cols, ()
    expected = "positive standard deviations"
    advice = "the file has too few decimals; half of the last decimal was used instead of 0"
    return floored, (note("GNSS rows", "; ".join(findings), expected, advice),)


def _within(lines: Lines, name: str, value: Array, unit: str) -> None:
    message = (
        f"{name} {{:g}} {unit} exceeds {LARGEST_COORDINATE:g}; check the columns and their unit"
    )
    refuse_rows(lines, np.abs(value) > LARGEST_COORDINATE, message, value)


def _quality(cols: Mapping[str, Array], lines: Lines, codes: str) -> NDArray[np.int64]:
    """Return the column q, whose codes are `codes`, as RTKLIB's codes."""
    if codes not in QUALITY_CODES:
        raise UsageError(f"units: quality = {codes!r} is none of {', '.join(QUALITY_CODES)}")
    q = cols["q"]
    accepted = NMEA_QUALITY if codes == "nmea" else range(MOST_QUALITY + 1)
    message = (
        f"quality {{:g}} is not a quality code of {codes}; check the columns, or set units ="
        " {{ quality"
    )
    refuse_rows(lines, ~np.isin(q, list(accepted)), f'{message} = "nmea" }}}}', q)
    quality = q.astype(np.int64)
    if codes == "nmea":
        quality = np.array([NMEA_QUALITY[k] for k in quality.tolist()], dtype=np.int64)
    return quality


def _velocity(
    cols: Mapping[str, Array],
    scales: FixScales,
    lines: Lines,
    sigma_velocity: ArrayLike | None,
) -> tuple[Array | None, Array | None]:
    """Return velocity (n, 3) north, east, down and its covariances; None without such columns."""
    up = "vu" if "vu" in cols else "vd"
    named = [name for name in ("vn", "ve", "speed", "course", up) if name in cols]
    if not named:
        return None, None
    polar = "speed" in cols or "course" in cols
    needed = ("speed", "course") if polar else ("vn", "ve", up)
    if missing := [name for name in needed if name not in cols]:
        raise InputError(
            f"{lines.path}: velocity without {' '.join(missing)}; name vn ve vd, or speed course"
            " and vd, or leave out all velocity columns by '-'"
        )
    if polar:
        course = cols["course"] * scales.course
        north, east = cols["speed"] * np.cos(course), cols["speed"] * np.sin(course)
    else:
        north, east = cols["vn"], cols["ve"]
    has_vertical = up in cols
    down = np.zeros(north.size) if not has_vertical else cols["vd"] if up == "vd" else -cols["vu"]
    velocity = scales.velocity * np.column_stack([north, east, down])
    _within(lines, "velocity", np.abs(velocity).max(axis=1, initial=0.0), "m/s")
    cov, _ = _covariance(
        cols, VELOCITY_SIGMA, scales.velocity, lines, sigma_velocity, "sigma_velocity"
    )
    if not has_vertical:
        cov[:, 2, 2] = UNKNOWN_MPS**2
    return velocity, cov


def _covariance(
    cols: Mapping[str, Array],
    names: tuple[str, ...],
    factor: float,
    lines: Lines,
    stand_in: ArrayLike | None,
    option: str,
) -> tuple[Array, NDArray[np.bool_]]:
    """Return diagonal covariances (n, 3, 3), and of which rows (n,) the file states none.

    They are of the file's standard deviations times `factor`, else of the `given` three, which also
    stand for the zeros of rows.
    """
    n = cols["tow"].size
    present = [name for name in names if name in cols]
    assumed = cols[ASSUMED] != 0.0 if ASSUMED in cols else np.zeros(n, dtype=np.bool_)
    if stated := next((axes for axes in STATED_BY[names] if cols.keys() >= set(axes)), None):
        sigma = np.column_stack([cols[name] for name in stated])
        sigma = factor * (np.sqrt(np.maximum(sigma, 0.0)) if stated == VARIANCE else sigma)
    elif present or stand_in is None:
        missing = " ".join(name for name in names if name not in cols)
        raise InputError(
            f"{lines.path}: no standard deviations {missing}; name their columns, or set {option} ="
            " [north, east, down]"
        )
    else:
        sigma = np.broadcast_to(np.asarray(stand_in, dtype=np.float64), (n, 3))
        assumed = np.ones(n, dtype=np.bool_)
        if not (np.isfinite(sigma) & (sigma > 0.0)).all():
            raise InputError(f"{option}: {np.asarray(stand_in).tolist()} must be positive")
    if stand_in is not None and (unstated := (sigma == 0.0).any(axis=1)).any():
        sigma = np.where(unstated[:, None], np.asarray(stand_in, dtype=np.float64), sigma)
        assumed = assumed | unstated
    bad = ~((sigma > 0.0) & (sigma <= LARGEST_COORDINATE))
    if bad.any():
        row, k = (int(i) for i in np.argwhere(bad)[0])
        limit = f" and at most {LARGEST_COORDINATE:g}" if sigma[row, k] > 0.0 else ""
        problem = f"standard deviation {names[k]} is {sigma[row, k]:g}; it must be positive{limit}"
        raise lines.error_at(row, f"{problem}; leave the fix out or correct it")
    return np.asarray((sigma**2)[:, :, None] * np.eye(3)), assumed
