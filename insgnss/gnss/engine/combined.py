"""One solution of a forward and a backward one: what RTKLIB's combined run does, without it.

A combined run of RTKLIB filters forward and backward once more and then takes, epoch by epoch,

    only one of the two has the epoch          that one
    one is of better quality                   that one: fixed, PPP, float, SBAS, DGPS, single
    both are of one quality                    P = (P_f^-1 + P_b^-1)^-1
                                               r = P (P_f^-1 r_f + P_b^-1 r_b)             (C.1)
    both are fixed, and on an axis of ECEF
    (r_f - r_b)^2 > 4^2 (P_f + P_b)            (C.1), called float                         (C.2)

The two runs that are there for their difference hold all of it, so that combining them here saves
half of the engine's time. They are read once from their text, positions and standard deviations to
0.1 mm, and are numbers from there on; their combination has the digits of its own text
(`POS_DECIMALS`),
which is written last. With them (C.1) comes within 0.15 mm of the engine's, and within 0.5 % of the
difference of the two more where that is large beside standard deviations of some millimetres, as
weights of rounded numbers are; the quality of an epoch at the very limit of (C.2) may be the other
one. Satellites, age and ratio of (C.1) are those of the forward solution, as RTKLIB has them. (C.2)
holds for moving receivers. Where one of two covariances is none, as of an engine that lost its
numbers, the other epoch is taken, where RTKLIB inverts what is none.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...geodesy.frames import ecef_to_geodetic, geodetic_to_ecef, rotation_en
from ...geodesy.gpstime import WEEK_S
from ...io.formats.gnss.pos_covariance import DOWN_FROM_UP as NED_NEU
from ...io.formats.gnss.pos_covariance import covariance_of_roots, without_inverse
from ...io.formats.gnss.pos_header import ROOTS
from ...io.formats.gnss.rtklib_pos import PosRows, pos_rows, read_pos_rows
from ...records import Array
from ...records.qualities import Quality

Index = NDArray[np.intp]

SAME_S = 0.005  # RTKLIB's DTTOL: stamps of two runs that belong to one epoch
PRIORITY = np.array([7, 1, 2, 3, 4, 5, 1, 6])  # of the qualities 0 to 7; the least is the best
AGREEING_SIGMAS = 4.0  # of an axis, up to which both runs agree: by chance one in 16 000 is beyond
FIXED_EPOCH, FLOAT_EPOCH = Quality.FIXED, Quality.FLOAT
# decimals of rows of both: 1e-11 deg are a micrometre, where the engine writes 0.1 mm
POS_DECIMALS = {"latitude": 11, "longitude": 11, "height": 5, "Q": 0}
POS_DECIMALS |= dict.fromkeys(ROOTS["latitude"], 6)


@dataclass(frozen=True, eq=False)
class Combination:
    """Two solutions and what they give together.

    Parameters
    ----------
    rows : mapping of str to PosRows
        Rows of "forward", "backward" and "combined", as numbers.
    lines : list of bytes
        Text of the combined solution, in order of time: the header of the forward solution, rows of
        one solution as they stand, rows of both with more decimals.
    """

    rows: Mapping[str, PosRows]
    lines: list[bytes]


def combine_solutions(
    forward: Path, backward: Path, path: Path, kinematic: bool = True
) -> Combination:
    """Combine two solutions by (C.1) and (C.2).

    Parameters
    ----------
    forward, backward : Path
        The `.pos` of the two runs: week, time of week, degrees, heights above the ellipsoid.
    path : Path
        Where the text of their combination is going to stand, for messages.
    kinematic : bool
        Whether the receiver moves: (C.2).
    """
    f, b = _Run.read(forward), _Run.read(backward)
    nearest = np.minimum(np.searchsorted(b.time, f.time - SAME_S), b.time.size - 1)
    simultaneous = np.abs(b.time[nearest] - f.time) <= SAME_S
    i = np.flatnonzero(simultaneous)
    j = nearest[simultaneous]
    order = PRIORITY[f.quality[i]] - PRIORITY[b.quality[j]]
    order = np.where(order == 0, b.sound[j].astype(int) - f.sound[i].astype(int), order)
    merged = (order == 0) & f.sound[i]
    of_backward = np.concatenate([np.setdiff1d(np.arange(b.time.size), j), j[order > 0]])
    of_forward = np.concatenate([np.flatnonzero(~simultaneous), i[(order <= 0) & ~merged]])
    row = i[merged]
    values_of_both = _merge_epochs(f, b, row, j[merged], kinematic)
    values = [f.values[of_forward], b.values[of_backward], values_of_both]
    lines = [run.lines[k] for run, indices in ((f, of_forward), (b, of_backward)) for k in indices]
    lines += [_merged_line(f, k, fields) for k, fields in zip(row, values_of_both, strict=True)]
    by_time = np.argsort(
        np.concatenate([f.time[of_forward], b.time[of_backward], f.time[row]]), kind="stable"
    )
    table = replace(
        f.rows.table,
        path=str(path),
        values=np.concatenate(values)[by_time],
        lines=len(f.head) + 1 + np.arange(by_time.size),
    )
    rows = {"forward": f.rows, "backward": b.rows, "combined": pos_rows(table, f.rows.header)}
    return Combination(rows, [*f.head, *(lines[k] for k in by_time)])


@dataclass(frozen=True, eq=False)
class _Run:
    """A solution: header lines, rows as text and as numbers, and of each its time (s of one week),
    quality, position (m, ECEF), covariance (m^2, ECEF) and whether it is one.
    """

    head: list[bytes]
    lines: list[bytes]
    rows: PosRows
    time: Array
    quality: NDArray[np.int64]
    position: Array
    cov: Array
    sound: NDArray[np.bool_]

    @property
    def values(self) -> Array:
        """Numbers of the rows (n, fields) in the order of the header's columns."""
        return self.rows.table.values

    @classmethod
    def read(cls, path: Path) -> "_Run":
        """Read a `.pos` of latitude, longitude and height, once as numbers and once as text."""
        rows = read_pos_rows(path)
        text_lines = path.read_bytes().splitlines(keepends=True)
        names = ("latitude", "longitude", "height")
        lat, lon, height = (rows.columns[name] for name in names)
        lat, lon = np.radians(lat), np.radians(lon)
        cov = covariance_of_roots(np.column_stack([rows.columns[n] for n in ROOTS["latitude"]]))
        C_e_neu = rotation_en(lat, lon) @ NED_NEU
        return cls(
            [line for line in text_lines if line.startswith(b"%")],
            [text_lines[line - 1] for line in rows.table.lines.tolist()],
            rows,
            rows.time + rows.gps_week * WEEK_S,
            rows.columns["Q"].astype(np.int64),
            geodetic_to_ecef(lat, lon, height),
            C_e_neu @ cov @ C_e_neu.swapaxes(1, 2),
            ~without_inverse(cov),
        )


def _merge_epochs(f: _Run, b: _Run, i: Index, j: Index, kinematic: bool) -> Array:
    """Return the numbers (m, columns) of epochs i (m,) and j (m,) of the runs by (C.1), (C.2)."""
    separation = b.position[j] - f.position[i]
    total = f.cov[i] + b.cov[j]
    # P P_b^-1 = P_f (P_f + P_b)^-1, without an inverse of either
    gain = np.linalg.solve(total, f.cov[i]).swapaxes(1, 2)
    position = f.position[i] + np.einsum("nij,nj->ni", gain, separation)
    cov = f.cov[i] - gain @ f.cov[i]
    limit = AGREEING_SIGMAS**2 * np.diagonal(total, axis1=1, axis2=2)
    doubtful = (f.quality[i] == FIXED_EPOCH) & (separation**2 > limit).any(axis=1) & kinematic
    quality = np.where(doubtful, FLOAT_EPOCH, f.quality[i])
    lat, lon, height = ecef_to_geodetic(position)
    C_neu_e = (rotation_en(lat, lon) @ NED_NEU).swapaxes(1, 2)
    roots = _signed_roots(C_neu_e @ cov @ C_neu_e.swapaxes(1, 2))
    columns = (np.degrees(lat), np.degrees(lon), height, quality, *roots.T)
    values = f.values[i]
    for (name, digits), column in zip(POS_DECIMALS.items(), columns, strict=True):
        # Python's round, as a text of so many decimals that is read: numpy's is off by a last bit
        rounded = [round(float(x), digits) for x in column]
        values[:, f.rows.header.columns.index(name)] = rounded
    return values


def _merged_line(f: _Run, row: int, fields: Array) -> bytes:
    """Return the line `row` of the forward run with the merged numbers `fields` (columns,)."""
    text_fields = f.lines[row].split()
    for name, digits in POS_DECIMALS.items():
        column = f.rows.header.columns.index(name)
        text_fields[column] = b"%.*f" % (digits, fields[column])
    return b" ".join(text_fields) + b"\n"


def _signed_roots(cov: Array) -> Array:
    """Return the signed roots (n, 6), m, of covariances (n, 3, 3), in the order of a `.pos`."""
    order = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))
    terms = np.stack([cov[:, k, m] for k, m in order], axis=1)
    return np.asarray(np.sign(terms) * np.sqrt(np.abs(terms)))
