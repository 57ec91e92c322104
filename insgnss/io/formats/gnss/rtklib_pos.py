"""Positions of RTKLIB (.pos) with their full covariance, data_specs/rtklib_pos.md.

RTKLIB writes a covariance c as its signed root s, c = sign(s) s^2, over north, east, up:

    sdn sde sdu sdne sdeu sdun    or over ECEF    sdx sdy sdz sdxy sdyz sdzx

and down is minus up, so cov(n, d) = -cov(u, n), cov(e, d) = -cov(e, u). Baselines (east, north, up
at the base, `sde sdn sdu sden sdnu sdue`) become positions where the header gives the base: r =
r_base + C_e,enu b. Four decimals of the roots can leave a matrix of strong correlations not quite
positive definite: such epochs keep their standard deviations, lose their correlations, and are
counted in a note.
"""

from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ....base.errors import InputError
from ....geodesy.frames import ecef_to_geodetic, geodetic_to_ecef, rotation_en
from ....geodesy.gpstime import GPS_EPOCH, GPS_EPOCH_UNIX_S, WEEK_S, leap_seconds
from ....geodesy.rotation import NED_ENU
from ....records import Array, Finding, GnssFixes
from ..read_options import STATED_NOTHING, ReadOptions
from ..text.clock import ordered_time
from ..text.layout import sniff
from ..text.order import note, open_end, refuse_rows
from ..text.text import NumberTable, Source, load, parse
from .fixes import of_the_solution
from .heights import GIVE, above_already
from .pos_covariance import DOWN_FROM_UP, LARGEST_ROOT, covariances
from .pos_header import (
    POS_DATE,
    POSITION_COLUMNS,
    ROOTS,
    SOLUTION_COLUMNS,
    VELOCITY_COLUMNS,
    VELOCITY_ROOTS,
    Header,
    degrees_of,
    is_rtklib_pos,
    read_header,
)

__all__ = ["PosRows", "is_rtklib_pos", "read_pos_rows", "read_rtklib_pos"]

JST_S = 9 * 3600.0  # Japan's time ahead of UTC (s): RTKLIB's scale JST


@dataclass(frozen=True, eq=False)
class PosRows:
    """The rows of a `.pos`, each stamp once and in order, and what was done for that.

    Attributes
    ----------
    header : Header
        The header.
    table : NumberTable
        The rows as they stand.
    columns : dict
        Arrays (n,) by RTKLIB's name.
    time : ndarray
        (n,) GPST, s of `gps_week`.
    gps_week : int
        The week of the first row.
    complete : bool
        Whether the last line has its end.
    notes : tuple of Finding
        Notes on rows left out or sorted.
    """

    header: Header
    table: NumberTable
    columns: dict[str, Array]
    time: Array
    gps_week: int
    complete: bool
    notes: tuple[Finding, ...]

    @property
    def base_ecef(self) -> Array | None:
        """ECEF position (3,) m of the base, None where the header has none, or no place.

        In a file of geocentric positions the header's is geocentric.
        """
        base = self.header.base
        if base is None or self.header.kind == "x-ecef":
            return None if base is None else np.array(base)
        return None if _no_place(base) else _frame_at(base)[0]


def read_pos_rows(path: Source, gps_week: int | None = None) -> PosRows:
    """Read the columns of a `.pos` as they stand.

    Raises
    ------
    InputError
        What cannot be read, with file and line.
    """
    buf, complete = load(path)
    header = read_header(path, buf)
    if header.dated:
        buf = _dates_apart(buf)
    return pos_rows(parse(path, buf, complete, sniff(path, buf)), header, gps_week)


def pos_rows(table: NumberTable, header: Header, gps_week: int | None = None) -> PosRows:
    """Return the columns of the numbers of a `.pos`, each stamp once and in order.

    Raises
    ------
    InputError
        What cannot be, with file and line.
    """
    columns = _columns(table, header)
    time, week, rows, notes = ordered_time(
        table,
        *_stamps(table, columns, header),
        "GNSS rows",
        gps_week,
        "s",
        lambda i, k: bool((table.values[i] == table.values[k]).all()),
        partial(_metres, columns, header),
    )
    assert week is not None
    if rows is not None:
        table = replace(table, values=table.values[rows], lines=table.lines[rows])
        columns = {name: column[rows] for name, column in columns.items()}
    return PosRows(header, table, columns, time, week, table.complete, notes)


def read_rtklib_pos(path: Source, options: ReadOptions = STATED_NOTHING) -> GnssFixes:
    """Read fixes with full covariance, and velocities where the file has them.

    The notes count what could not be taken as it stands.

    Parameters
    ----------
    path : path
        The `.pos`.
    options : ReadOptions
        `undulation_m`, added to a file of `geodetic` heights, which is refused without it;
        `sigma_m` of epochs whose six roots are all zero, which RTKLIB writes for unknown.

    Returns
    -------
    GnssFixes
        The fixes.

    Raises
    ------
    InputError
        What cannot be read, with file and line.
    """
    return fixes_of_rows(read_pos_rows(path, options.gps_week), options)


def fixes_of_rows(read: PosRows, options: ReadOptions = STATED_NOTHING) -> GnssFixes:
    """Return the fixes of the rows of a `.pos`, as `read_rtklib_pos` does.

    Parameters
    ----------
    read : PosRows
        The rows.
    options : ReadOptions
        As in `read_rtklib_pos`.

    Returns
    -------
    GnssFixes
        The fixes.

    Raises
    ------
    InputError
        What cannot be, with file and line.
    """
    header, table, cols = read.header, read.table, read.columns
    undulation_m = options.undulation_m
    notes = [*open_end("GNSS rows", read.complete)]
    if not header.stated:
        above = "geoid" if undulation_m else "ellipsoid"
        finding = f"no header; read as {header.scale}, heights above the {above}"
        advice = "check both; if the heights are above the geoid, set gnss.undulation_m"
        notes.append(note("GNSS rows", finding, "RTKLIB's header", advice))
    if header.kind != "x-ecef" and header.base and (problem := _no_place(header.base)):
        advice = "correct % ref pos in the header; the standard deviations were used unchanged"
        notes.append(note("GNSS rows", problem, "the position of the base", advice))
    lat, lon, height, C = _position(table, cols, header, undulation_m)
    cov, assumed = covariances(table, cols, ROOTS[header.kind], C, notes, options.sigma_m)
    velocity, velocity_cov = _velocity(table, cols, header, C, notes)
    quality = _quality(table, cols["Q"]) if "Q" in cols else None
    described = {
        SOLUTION_COLUMNS[n.lower()]: c for n, c in cols.items() if n.lower() in SOLUTION_COLUMNS
    }
    return GnssFixes(
        read.time,
        *(lat, lon, height, cov, velocity, velocity_cov),
        quality,
        read.gps_week,
        table.path,
        (*notes, *read.notes),
        base_ecef=read.base_ecef,
        sigma_assumed=assumed if assumed.any() else None,
        source_format="rtklib_pos",
        **of_the_solution(described),
    )


def _dates_apart(buf: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the file with its dates and times of day as six fields, separated as the others."""
    data = buf.tobytes()
    first = POS_DATE.search(data)
    line = data[first.start() :].partition(b"\n")[0] if first else b""
    sign = next((sign for sign in (b"\t", b";", b",") if sign in line), b" ")
    return np.frombuffer(
        bytearray(POS_DATE.sub(sign.join([rb"\1", rb"\2", rb"\3", rb"\4", rb"\5", b""]), data)),
        dtype=np.uint8,
    )


def _columns(table: NumberTable, header: Header) -> dict[str, Array]:
    """Return columns by RTKLIB's name, sexagesimal angles joined.

    Time stands as year ... second or week, tow.
    """
    names = header.columns
    if len(names) != table.values.shape[1]:
        message = (
            f"{table.values.shape[1]} fields, but the header names {len(names)}:"
            f" {' '.join(names)[:400]}; was it put together from two files?"
        )
        raise table.error_at(0, message)
    needed = [
        name if not header.sexagesimal or name == "height" else f"{name}:d"
        for name in POSITION_COLUMNS[header.kind]
    ]
    twice = [name for name in names if names.count(name) > 1]
    if missing := [name for name in needed if name not in names] + twice:
        message = f"the header lacks {missing[0][:80]} or has it twice: {' '.join(names)[:400]}"
        raise InputError.in_file(table.path, f"{message}; let RTKLIB write the header")
    cols = {name: np.ascontiguousarray(table.values[:, i]) for i, name in enumerate(names)}
    if header.sexagesimal:
        for name in ("latitude", "longitude"):
            d, m, s = (cols[f"{name}:{component}"] for component in "dms")
            cols[name] = degrees_of(d, m, s)
    return cols


def _stamps(table: NumberTable, cols: dict[str, Array], header: Header) -> tuple[Array, Array]:
    """Return times of week, s, GPST, and their weeks."""
    shift = JST_S if header.scale == "JST" else 0.0
    if header.dated:
        ymd = np.column_stack([cols["year"], cols["month"], cols["day"]])
        days, back = np.unique(ymd, axis=0, return_inverse=True)
        try:
            dates = [datetime(int(day[0]), int(day[1]), int(day[2]), tzinfo=UTC) for day in days]
        except ValueError as error:
            raise InputError.in_file(table.path, f"holds no date: {error}; correct it") from None
        starts = np.array([(date - GPS_EPOCH).total_seconds() for date in dates])
        seconds = starts[back.reshape(-1)]
        tod = cols["hour"] * 3600.0 + cols["minute"] * 60.0 + cols["second"] - shift
        bad = (cols["hour"] > 24.0) | (cols["minute"] > 60.0) | (cols["second"] > 61.0)
        _refuse(table, bad, tod, "{:.3f} s is no time of day")
    else:
        week, tow = cols["week"], cols["tow"]
        bad = (week < 0.0) | (week > 9999.0) | (week % 1.0 != 0.0)
        _refuse(table, bad, week, "{:g} is no GPS week")
        _refuse(table, (tow < 0.0) | (tow > 2.0 * WEEK_S), tow, "{:.3f} s is no time of week")
        seconds, tod = cols["week"] * WEEK_S, cols["tow"] - shift
    if header.scale != "GPST":
        tod = tod + leap_seconds(seconds + GPS_EPOCH_UNIX_S + np.floor(tod))
    week = np.floor((seconds + tod) / WEEK_S)
    return (seconds - WEEK_S * week) + tod, week


def _metres(cols: dict[str, Array], header: Header) -> Array:
    """Positions (n, 3), m, of columns along any axes, whatever they hold."""
    x = _stack(cols, POSITION_COLUMNS[header.kind])
    with np.errstate(all="ignore"):
        lat, lon = np.radians(x[:, :2].T)
        return geodetic_to_ecef(lat, lon, x[:, 2]) if header.kind == "latitude" else x


def _refuse(table: NumberTable, bad: NDArray[np.bool_], value: Array, message: str) -> None:
    """Refuse the first bad row; `message` has a format field for its value."""
    refuse_rows(table, bad, f"{message}; check the columns", value)


def _position(
    table: NumberTable, cols: dict[str, Array], header: Header, undulation_m: float | None
) -> tuple[Array, Array, Array, Array]:
    """Return latitude, longitude, height, and rotations (n, 3, 3) into north, east, down.

    The rotations are of the axes in which the file gives vectors.
    """
    if undulation_m and header.stated and (header.ellipsoidal or header.kind != "latitude"):
        message = above_already("heights, by the header,", undulation_m)
        raise InputError.in_file(table.path, message)
    coordinates = _stack(cols, POSITION_COLUMNS[header.kind])
    if header.kind == "latitude":
        n = len(coordinates)
        for name, limit in (("latitude", 90.0), ("longitude", 360.0)):
            message = f"{name} {{:.6f}} deg exceeds {limit:.0f}"
            _refuse(table, np.abs(cols[name]) > limit, cols[name], message)
        height = _above_ellipsoid(table, header, coordinates[:, 2], undulation_m)
        lat, lon = np.radians(coordinates[:, :2].T)
        return lat, lon, height, np.broadcast_to(DOWN_FROM_UP, (n, 3, 3))
    C_e = np.eye(3)
    if header.kind == "e-baseline":
        origin, C_e = _base_frame(table, header)
        coordinates = origin + coordinates @ C_e.T
    with np.errstate(over="ignore"):  # a length that is no number of this machine is none of one
        radius = np.linalg.norm(coordinates, axis=1)
    bad = (radius < 6e6) | (radius > 6e7)
    _refuse(
        table,
        bad,
        radius,
        "{:.0f} m from the Earth's centre cannot be an antenna's position",
    )
    lat, lon, height = ecef_to_geodetic(coordinates)
    return lat, lon, height, np.swapaxes(rotation_en(lat, lon), 1, 2) @ C_e


def _above_ellipsoid(
    table: NumberTable, header: Header, height: Array, undulation_m: float | None
) -> Array:
    _refuse(table, np.abs(height) > 1e7, height, "{:g} m is no height")
    if header.ellipsoidal and header.stated:
        return height
    if undulation_m is None and header.stated:
        message = f"heights are above the geoid (the header says geodetic); {GIVE}"
        raise InputError.in_file(table.path, message)
    return height + (undulation_m or 0.0)


def _base_frame(table: NumberTable, header: Header) -> tuple[Array, Array]:
    """Return the base's ECEF position (3,), and the rotation (3, 3) of its east, north, up.

    The rotation takes them into ECEF.
    """
    if header.base is None:
        message = (
            "holds baselines, but its header gives no base (% ref pos : latitude longitude height);"
            " set out-solformat = llh in RTKLIB"
        )
        raise InputError.in_file(table.path, message)
    if problem := _no_place(header.base):
        raise InputError.in_file(table.path, f"{problem}; check % ref pos")
    return _frame_at(header.base)


def _no_place(geodetic: tuple[float, ...]) -> str:
    """Return what is wrong with latitude, longitude, deg, and height; empty for a place."""
    if abs(geodetic[0]) <= 90.0 and abs(geodetic[1]) <= 360.0:
        return ""
    numbers = " ".join(f"{x:g}" for x in geodetic)
    return f"the base position {numbers} is no latitude, longitude, height"


def _frame_at(geodetic: tuple[float, ...]) -> tuple[Array, Array]:
    lat, lon = np.radians(geodetic[0]), np.radians(geodetic[1])
    origin = geodetic_to_ecef(lat, lon, np.float64(geodetic[2]))
    return origin, rotation_en(lat, lon) @ NED_ENU


def _quality(table: NumberTable, q: Array) -> NDArray[np.int64]:
    _refuse(table, ~np.isin(q, range(8)), q, "{:g} is no quality of RTKLIB (0 to 7)")
    return q.astype(np.int64)


def _velocity(
    table: NumberTable, cols: dict[str, Array], header: Header, C: Array, notes: list[Finding]
) -> tuple[Array | None, Array | None]:
    """Return velocity and covariances in north, east, down, where the file has estimated them."""
    names, roots = VELOCITY_COLUMNS[header.kind], VELOCITY_ROOTS[header.kind]
    if names[0] not in cols:
        return None, None
    if not all(name in cols for name in (*names, *roots)) or not cols[roots[0]].any():
        finding = "velocities with no or zero standard deviations were not estimated and are"
        expected = "velocities with their standard deviations"
        advice = "let RTKLIB use Doppler, or leave velocities out"
        notes.append(note("GNSS rows", f"{finding} left out", expected, advice))
        return None, None
    velocity = np.einsum("nij,nj->ni", C, _stack(cols, names))
    fastest = np.abs(velocity).max(axis=1, initial=0.0)
    _refuse(table, fastest > LARGEST_ROOT, fastest, "{:g} m/s is no velocity")
    return velocity, covariances(table, cols, roots, C, notes, None)[0]


def _stack(cols: dict[str, Array], names: tuple[str, ...]) -> Array:
    return np.column_stack([cols[name] for name in names])
