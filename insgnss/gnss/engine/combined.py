"""One solution of a forward and a backward one: what RTKLIB's combined run does, without it.

A combined run of RTKLIB filters forward and backward once more and then takes, epoch by epoch,

    only one of the two has the epoch          that one
    one is of better quality                   that one: fixed, PPP, float, SBAS, DGPS, single
    both are of one quality                    P = (P_f^-1 + P_b^-1)^-1
                                               r = P (P_f^-1 r_f + P_b^-1 r_b)             (C.1)
    both are fixed, and on an axis of ECEF
    (r_f - r_b)^2 > 4^2 (P_f + P_b)            (C.1), called float                         (C.2)

The two runs that are there for their difference hold all of it, so that combining them here saves
half of the engine's time. They are taken from their text, positions and standard deviations to 0.1
mm: (C.1) comes within 0.15 mm of the engine's, and within 0.5 % of the difference of the two more
where that is large beside standard deviations of some millimetres, as weights of rounded numbers
are; the quality of an epoch at the very limit of (C.2) may be the other one. Satellites, age and
ratio of (C.1) are those of the forward solution, as RTKLIB has them. (C.2) holds for moving
receivers. Where one of two covariances is none, as of an engine that lost its numbers, the other
epoch is taken, where RTKLIB inverts what is none.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...formats.gnss.pos_header import ROOTS
from ...formats.gnss.rtklib_pos import NED as NED_NEU
from ...formats.gnss.rtklib_pos import read_pos_rows, without_inverse
from ...geodesy.frames import ecef_to_geodetic, geodetic_to_ecef, rotation_en
from ...geodesy.gpstime import WEEK_S
from ...records.qualities import Quality

Array = NDArray[np.float64]
Index = NDArray[np.intp]

SAME_S = 0.005  # RTKLIB's DTTOL: stamps of two runs that belong to one epoch
PRIORITY = np.array([7, 1, 2, 3, 4, 5, 1, 6])  # of the qualities 0 to 7; the least is the best
SIGMAS = 4.0
FIXED, FLOAT = Quality.FIXED, Quality.FLOAT


def combined(forward: Path, backward: Path, kinematic: bool = True) -> list[bytes]:
    """Combine two solutions by (C.1) and (C.2).

    Parameters
    ----------
    forward, backward : Path
        The `.pos` of the two runs: week, time of week, degrees, heights above the ellipsoid.
    kinematic : bool
        Whether the receiver moves: (C.2).

    Returns
    -------
    list of bytes
        The lines of their combination, in order of time: the header of the forward solution, rows
        of one solution as they stand, rows of both with more decimals.
    """
    f, b = _Run.read(forward), _Run.read(backward)
    near = np.minimum(np.searchsorted(b.time, f.time - SAME_S), b.time.size - 1)
    both = np.abs(b.time[near] - f.time) <= SAME_S
    i, j = np.flatnonzero(both), near[both]
    order = PRIORITY[f.quality[i]] - PRIORITY[b.quality[j]]
    order = np.where(order == 0, b.sound[j].astype(int) - f.sound[i].astype(int), order)
    merged = (order == 0) & f.sound[i]
    of_backward = np.concatenate([np.setdiff1d(np.arange(b.time.size), j), j[order > 0]])
    of_forward = np.concatenate([np.flatnonzero(~both), i[(order <= 0) & ~merged]])
    runs = ((f, of_forward), (b, of_backward))
    rows = [(run.time[k], run.lines[k]) for run, taken in runs for k in taken]
    rows += zip(f.time[i[merged]], _merged(f, b, i[merged], j[merged], kinematic), strict=True)
    return [*f.head, *(line for _, line in sorted(rows, key=lambda row: float(row[0])))]


@dataclass(frozen=True, eq=False)
class _Run:
    """A solution: header lines, rows as text, and of each its time (s of one week), quality,
    position (m, ECEF), covariance (m^2, ECEF) and whether it is one.
    """

    head: list[bytes]
    lines: list[bytes]
    columns: list[str]
    time: Array
    quality: NDArray[np.int64]
    position: Array
    cov: Array
    sound: NDArray[np.bool_]

    @classmethod
    def read(cls, path: Path) -> "_Run":
        read = read_pos_rows(path)
        text = path.read_bytes().splitlines(keepends=True)
        names = ("latitude", "longitude", "height")
        lat, lon, height = (read.columns[name] for name in names)
        lat, lon = np.radians(lat), np.radians(lon)
        cov = _covariance(np.column_stack([read.columns[n] for n in ROOTS["latitude"]]))
        C = rotation_en(lat, lon) @ NED_NEU
        return cls(
            [line for line in text if line.startswith(b"%")],
            [text[line - 1] for line in read.table.lines.tolist()],
            read.header.columns,
            read.time + read.gps_week * WEEK_S,
            read.columns["Q"].astype(np.int64),
            geodetic_to_ecef(lat, lon, height),
            C @ cov @ C.swapaxes(1, 2),
            ~without_inverse(cov),
        )


def _merged(f: _Run, b: _Run, i: Index, j: Index, kinematic: bool) -> list[bytes]:
    """Rows of the epochs i of one run and j of the other, by (C.1) and (C.2)."""
    apart, total = b.position[j] - f.position[i], f.cov[i] + b.cov[j]
    # P P_b^-1 = P_f (P_f + P_b)^-1, without an inverse of either
    gain = np.linalg.solve(total, f.cov[i]).swapaxes(1, 2)
    position = f.position[i] + np.einsum("nij,nj->ni", gain, apart)
    cov = f.cov[i] - gain @ f.cov[i]
    limit = SIGMAS**2 * np.diagonal(total, axis1=1, axis2=2)
    doubtful = (f.quality[i] == FIXED) & (apart**2 > limit).any(axis=1) & kinematic
    quality = np.where(doubtful, FLOAT, f.quality[i])
    lat, lon, height = ecef_to_geodetic(position)
    C = (rotation_en(lat, lon) @ NED_NEU).swapaxes(1, 2)
    roots = _roots(C @ cov @ C.swapaxes(1, 2))
    place = np.column_stack([np.degrees(lat), np.degrees(lon), height])
    at = {name: k for k, name in enumerate(f.columns)}
    rows = []
    for k, row in enumerate(i.tolist()):
        fields = f.lines[row].split()
        fields[at["latitude"] : at["height"] + 1] = [b"%.11f %.11f %.5f" % tuple(place[k])]
        first = at[ROOTS["latitude"][0]] - 2
        fields[first : first + 6] = [b"%.6f" % root for root in roots[k]]
        fields[at["Q"] - 2] = b"%d" % quality[k]
        rows.append(b" ".join(fields) + b"\n")
    return rows


def _covariance(roots: Array) -> Array:
    """(n, 3, 3) of the signed roots (n, 6) of a `.pos`, in the order of its axes."""
    c = np.sign(roots) * roots**2
    return c[:, [[0, 3, 5], [3, 1, 4], [5, 4, 2]]]


def _roots(P: Array) -> Array:
    """The signed roots (n, 6) of covariances."""
    c = np.stack([P[:, k, m] for k, m in ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))], axis=1)
    return np.asarray(np.sign(c) * np.sqrt(np.abs(c)))
