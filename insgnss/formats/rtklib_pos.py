"""Positions of RTKLIB (.pos) with their full covariance, data_specs/rtklib_pos.md.

RTKLIB writes a covariance c as its signed root s, c = sign(s) s^2, over north, east, up:

    sdn sde sdu sdne sdeu sdun    or over ECEF    sdx sdy sdz sdxy sdyz sdzx

and down is minus up, so cov(n, d) = -cov(u, n), cov(e, d) = -cov(e, u). The header names the columns; without it the file
is not read. Four decimals of the roots can leave a matrix of strong correlations not quite positive definite: such epochs
keep their standard deviations, lose their correlations, and are counted in a warning.
"""

import re
import warnings
from dataclasses import dataclass
from datetime import datetime

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..files import atomic_write
from ..geodesy.frames import ecef_to_geodetic, rotation_en
from ..geodesy.gpstime import GPS_EPOCH_UNIX_S, WEEK_S, gps_from_calendar, leap_seconds
from ..records import GnssFixes
from ._columns import check_increasing
from ._layout import decode, sniff
from ._text import InsgnssWarning, Source, Table, format_rows, load, parse

Array = NDArray[np.float64]

NED = np.diag([1.0, 1.0, -1.0])
JST_S = 9 * 3600.0
BAD_SHARE_LIMIT = 0.01
POSITION = {"latitude": ("latitude", "longitude", "height"), "x-ecef": ("x-ecef", "y-ecef", "z-ecef")}
ROOTS = {"latitude": ("sdn", "sde", "sdu", "sdne", "sdeu", "sdun"), "x-ecef": ("sdx", "sdy", "sdz", "sdxy", "sdyz", "sdzx")}
VELOCITY = {"latitude": ("vn", "ve", "vu"), "x-ecef": ("vx", "vy", "vz")}
VELOCITY_ROOTS = {
    "latitude": ("sdvn", "sdve", "sdvu", "sdvne", "sdveu", "sdvun"),
    "x-ecef": ("sdvx", "sdvy", "sdvz", "sdvxy", "sdvyz", "sdvzx"),
}


@dataclass(frozen=True)
class Header:
    """What a .pos header says: kind of coordinates, column names, time scale, heights above the ellipsoid, degrees or d m s."""

    kind: str
    names: tuple[str, ...]
    scale: str
    ellipsoidal: bool
    sexagesimal: bool


def read_rtklib_pos(path: Source, undulation_m: float | None = None, gps_week: int | None = None) -> GnssFixes:
    """Read fixes with full covariance, and velocities where the file has them.

    undulation_m : geoid height above the ellipsoid, m, to add to a file of `geodetic` heights, which is refused without it.
    Raises InputError with file and line; warns (InsgnssWarning) with the counts of what it could not take as it stands.
    """
    buf, complete = load(path)
    header, dated = _header(path, decode(buf[: 1 << 16].tobytes()))
    if dated:
        buf[(buf == ord("/")) | (buf == ord(":"))] = ord(" ")
    table = parse(path, buf, complete, sniff(path, buf))
    cols = _columns(table, header, dated)
    time, week = _time(table, cols, header, dated)
    if gps_week is not None and week != gps_week:
        raise table.at(0, f"GPS week {week}, but the flight is said to be of week {gps_week}; check gps_week or the file")
    lat, lon, height = _position(table, cols, header, undulation_m)
    C = np.broadcast_to(NED, (lat.size, 3, 3)) if header.kind == "latitude" else np.swapaxes(rotation_en(lat, lon), 1, 2)
    cov = _covariance(table, cols, ROOTS[header.kind], C)
    velocity = velocity_cov = None
    if VELOCITY[header.kind][0] in cols:
        if cols[VELOCITY_ROOTS[header.kind][0]].any():
            velocity = np.einsum("nij,nj->ni", C, _stack(cols, VELOCITY[header.kind]))
            velocity_cov = _covariance(table, cols, VELOCITY_ROOTS[header.kind], C)
        else:
            warnings.warn(
                InsgnssWarning(f"{path}: velocities with standard deviations of zero were not estimated and are left out"), stacklevel=2
            )
    quality = cols["Q"].astype(np.int64) if "Q" in cols else None
    return GnssFixes(time, lat, lon, height, cov, velocity, velocity_cov, quality, week, str(path))


def _header(path: Source, text: str) -> tuple[Header, bool]:
    comments = [line for line in text.splitlines() if line.startswith("%")]
    first = next((line for line in text.splitlines() if line.strip() and not line.startswith("%")), "")
    said = next((line for line in reversed(comments) if any(name in line for name in (*POSITION, "e-baseline"))), None)
    if said is None:
        raise InputError.at(
            path, None, "no RTKLIB header (% GPST latitude(deg) ...); write it (out-outhead = on), or rename the file to .txt"
        )
    if "e-baseline" in said:
        raise InputError.at(path, None, "holds baselines, not positions; let RTKLIB write latitude longitude height (out-solformat = llh)")
    kind = next(name for name in POSITION if name in said)
    tokens = re.sub(r"\([^)]*\)", "", said.lstrip("% ")).replace(",", " ").split()
    geodetic = any("WGS84/geodetic" in line for line in comments)
    date = "/" in first.split(",")[0]
    return Header(kind, tuple(tokens[1:]), tokens[0], not geodetic, "(d'\")" in said), date


def _columns(table: Table, header: Header, dated: bool) -> dict[str, Array]:
    """Columns by RTKLIB's name; time as year ... second or week, tow, sexagesimal angles joined."""
    names = ["year", "month", "day", "hour", "minute", "second"] if dated else ["week", "tow"]
    for name in header.names:
        split = header.sexagesimal and name in ("latitude", "longitude")
        names += [f"{name}:{part}" for part in "dms"] if split else [{"sdue": "sdun", "sdvue": "sdvun"}.get(name, name)]
    if len(names) != table.values.shape[1]:
        what = f"{table.values.shape[1]} fields, but the header names {len(names)}: {' '.join(names)}; was the file put together from two?"
        raise table.at(0, what)
    cols = {name: np.ascontiguousarray(table.values[:, i]) for i, name in enumerate(names)}
    if header.sexagesimal:
        for name in ("latitude", "longitude"):
            d, m, s = (cols[f"{name}:{part}"] for part in "dms")
            cols[name] = np.copysign(np.abs(d) + m / 60.0 + s / 3600.0, d)
    return cols


def _time(table: Table, cols: dict[str, Array], header: Header, dated: bool) -> tuple[Array, int]:
    """GPST seconds of the first epoch's week, and that week."""
    if header.scale not in ("GPST", "UTC", "JST"):
        raise table.at(0, f"time scale {header.scale!r} is none of GPST, UTC, JST; let RTKLIB write GPST")
    shift = JST_S if header.scale == "JST" else 0.0
    if dated:
        ymd = np.column_stack([cols["year"], cols["month"], cols["day"]])
        days, back = np.unique(ymd, axis=0, return_inverse=True)
        try:
            starts = [gps_from_calendar(datetime(int(day[0]), int(day[1]), int(day[2])), "gpst") for day in days]
        except ValueError as error:
            raise InputError.at(table.path, None, f"a date is none: {error}") from None
        seconds = np.array([week * WEEK_S + tow for week, tow in starts])[back.reshape(-1)]
        tod = cols["hour"] * 3600.0 + cols["minute"] * 60.0 + cols["second"] - shift
    else:
        seconds, tod = cols["week"] * WEEK_S, cols["tow"] - shift
    if header.scale != "GPST":
        tod = tod + leap_seconds(seconds + GPS_EPOCH_UNIX_S + np.floor(tod))
    week = int((seconds[0] + tod[0]) // WEEK_S)
    time = (seconds - week * WEEK_S) + tod
    check_increasing(table, time)
    return time, week


def _position(table: Table, cols: dict[str, Array], header: Header, undulation_m: float | None) -> tuple[Array, Array, Array]:
    if header.kind == "x-ecef":
        return ecef_to_geodetic(_stack(cols, POSITION["x-ecef"]))
    height = cols["height"]
    if not header.ellipsoidal:
        if undulation_m is None:
            what = "heights are above the geoid (geodetic); let RTKLIB write them above the ellipsoid, or give undulation_m"
            raise InputError.at(table.path, None, what)
        height = height + undulation_m
    for name, limit in (("latitude", 90.0), ("longitude", 360.0)):
        if (beyond := np.abs(cols[name]) > limit).any():
            row = int(np.argmax(beyond))
            raise table.at(row, f"{name} {cols[name][row]:.6f} deg exceeds {limit:.0f}")
    return np.radians(cols["latitude"]), np.radians(cols["longitude"]), height


def _stack(cols: dict[str, Array], names: tuple[str, ...]) -> Array:
    return np.column_stack([cols[name] for name in names])


def _covariance(table: Table, cols: dict[str, Array], names: tuple[str, ...], C: Array) -> Array:
    """Covariances (n, 3, 3) of signed roots, taken by C (n, 3, 3) into north, east, down."""
    missing = [name for name in names if name not in cols]
    if missing:
        raise InputError.at(
            table.path, None, f"the header does not name {' '.join(missing)}; let RTKLIB write standard deviations (out-outstd)"
        )
    roots = _stack(cols, names)
    if (zero := roots[:, :3] <= 0.0).any():
        row, k = (int(i) for i in np.argwhere(zero)[0])
        raise table.at(row, f"standard deviation {names[k]} is {roots[row, k]:g}; it must be positive; is it a solution with a covariance?")
    c = np.sign(roots) * roots**2
    P = np.empty((len(c), 3, 3))
    P[:, 0, 0], P[:, 1, 1], P[:, 2, 2] = c[:, 0], c[:, 1], c[:, 2]
    P[:, 0, 1] = P[:, 1, 0] = c[:, 3]
    P[:, 1, 2] = P[:, 2, 1] = c[:, 4]
    P[:, 0, 2] = P[:, 2, 0] = c[:, 5]
    least = np.linalg.eigvalsh(P)[:, 0]
    if (bad := least <= 0.0).any():
        row = int(np.argmax(bad))
        what = f"{bad.sum()} of {len(P)} covariances of {names[0]} ... {names[5]} are not positive definite"
        if bad.mean() > BAD_SHARE_LIMIT:
            raise table.at(row, f"{what} (limit {BAD_SHARE_LIMIT:.0%}); write more decimals or check the columns")
        P[bad] *= np.eye(3)
        warnings.warn(InsgnssWarning(f"{table.path}:{table.lines[row]}: {what}; these keep their standard deviations only"), stacklevel=3)
    return np.asarray(C @ P @ np.swapaxes(C, 1, 2))


def _roots(P: Array) -> Array:
    """Signed roots (n, 6) of covariances (n, 3, 3) in north, east, down, in RTKLIB's order over north, east, up."""
    U = NED @ P @ NED
    c = np.stack([U[:, 0, 0], U[:, 1, 1], U[:, 2, 2], U[:, 0, 1], U[:, 1, 2], U[:, 2, 0]], axis=1)
    return np.sign(c) * np.sqrt(np.abs(c))


def write_rtklib_pos(fixes: GnssFixes, path: Source) -> None:
    """Write fixes as RTKLIB does: week, time of week, degrees, height above the ellipsoid, signed roots (6 decimals, against 4)."""
    if fixes.gps_week is None:
        raise InputError(f"{fixes.source or 'GnssFixes'}: no GPS week, which .pos carries; set gps_week")
    n = fixes.time.size
    quality = np.zeros(n) if fixes.quality is None else fixes.quality
    beyond = np.floor(fixes.time / WEEK_S)
    parts = [fixes.gps_week + beyond, fixes.time - WEEK_S * beyond, np.degrees(fixes.lat), np.degrees(fixes.lon), fixes.height]
    table = [*parts, quality, _roots(fixes.cov_ned)]
    head = "%  GPST  latitude(deg) longitude(deg) height(m) Q sdn(m) sde(m) sdu(m) sdne(m) sdeu(m) sdun(m)"
    form = "%4d %10.6f %14.10f %15.10f %10.4f %3d" + " %10.6f" * 6
    if fixes.velocity_ned is not None and fixes.velocity_cov_ned is not None:
        head += " vn(m/s) ve(m/s) vu(m/s) sdvn sdve sdvu sdvne sdveu sdvun"
        form += " %10.5f" * 3 + " %9.6f" * 6
        table += [fixes.velocity_ned @ NED, _roots(fixes.velocity_cov_ned)]
    legend = "% (lat/lon/height=WGS84/ellipsoidal,Q=1:fix,2:float,3:sbas,4:dgps,5:single,6:ppp)\n"
    atomic_write(path, [legend, head + "\n", *format_rows(form + "\n", np.column_stack(table))])
