r"""Which pose of one file belongs to which of the other.

They are matched by image name, else by time, the denser file interpolated.

Names are compared as they are and, where none agrees, without directory and ending.

Interpolation is the cubic through the four samples around an instant (Lagrange), of ECEF
coordinates, velocities and the rotation vector from the second of the four. Its error is 3/128 h^4
x'''' in the middle, 1e-5 m for accelerations of 10 m/s^2 that change within a second, sampled at 10
Hz. Over a gap of the samples longer than `GAP_STEPS` of their usual distance nothing is
interpolated.
"""

from dataclasses import dataclass, replace
from pathlib import PurePosixPath

import numpy as np
from numpy.typing import NDArray

from ...base.errors import DataError
from ...geodesy.frames import ecef_to_geodetic
from ...geodesy.gpstime import WEEK_S
from ...geodesy.rotation import rotation_from_vector, vector_from_rotation
from ...records import Array
from .poses import Poses

GAP_STEPS = 3.0  # of the usual distance of samples: over more, nothing is interpolated (chosen)
SAME_INSTANT_S = 1e-6  # between stamps of one instant: tables print microseconds


@dataclass(frozen=True, eq=False)
class Matched:
    """Row by row the same pose in `a` and `b`.

    Parameters
    ----------
    how : "image" or "time".
    left_a, left_b : poses without partner.
    of_time : rows of `a` and of `b` were taken at these times, s of a's week, or None.
    """

    a: Poses
    b: Poses
    how: str
    left_a: int
    left_b: int
    of_time: Array | None = None

    def taken(self, rows: NDArray[np.int64]) -> "Matched":
        """Only these rows; the others count as without partner."""
        beside = self.a.n - rows.size
        return Matched(
            self.a.taken(rows),
            self.b.taken(rows),
            self.how,
            self.left_a + beside,
            self.left_b + beside,
            None if self.of_time is None else self.of_time[rows],
        )


def match(a: Poses, b: Poses, shift_s: float = 0.0) -> Matched:
    """`a` and `b`, row by row; with `shift_s` added to the times of b.

    Raises
    ------
    DataError
        Where they share neither image names nor times.
    """
    if a.images and b.images:
        common = _common(a.images, b.images) or _common(_stems(a.images), _stems(b.images))
        if common:
            in_a, in_b = np.array(common).T
            time = None if a.time is None else a.time[in_a]
            return Matched(
                a.taken(in_a), b.taken(in_b), "image", a.n - len(common), b.n - len(common), time
            )
        if a.time is None or b.time is None:
            problem = (
                f"no image has the same name: {a.images[0]!r} of {a.source}, {b.images[0]!r} of"
                f" {b.source}"
            )
            raise DataError(f"{problem}; rename them, or give files with times")
    return _by_time(a, b, shift_s)


def _common(a: tuple[str, ...], b: tuple[str, ...]) -> list[tuple[int, int]]:
    """Rows of the names that both have."""
    row = {name: k for k, name in enumerate(b)}
    return [(k, row[name]) for k, name in enumerate(a) if name in row]


def _stems(images: tuple[str, ...]) -> tuple[str, ...]:
    """Names without directory and ending, in lower case.

    None of them where two images would become one.
    """
    stems = tuple(PurePosixPath(name.replace("\\", "/")).stem.lower() for name in images)
    return stems if len(set(stems)) == len(stems) else ()


def sparser(a: Poses, b: Poses) -> bool:
    """Whether partners are interpolated in b at the times of a: images, else the fewer poses."""
    return not b.images and (bool(a.images) or a.n <= b.n)


def times(a: Poses, b: Poses, shift_s: float = 0.0) -> tuple[Array, Array]:
    """Times of both in seconds of a's week, b's shifted; DataError where one has none."""
    for poses in (a, b):
        if poses.time is None:
            partner = b if poses is a else a
            problem = (
                f"{poses.source} has no times, {partner.source}"
                f" {'other image names' if partner.images else 'no image names'}"
            )
            raise DataError(
                f"{problem}: nothing tells which poses belong together; give the eo.json, which has"
                " both"
            )
    assert a.time is not None
    assert b.time is not None
    weeks = b.gps_week - a.gps_week if a.gps_week is not None and b.gps_week is not None else 0
    return a.time, b.time + WEEK_S * weeks + shift_s


def _by_time(a: Poses, b: Poses, shift_s: float) -> Matched:
    in_a, in_b = times(a, b, shift_s)
    of_a = sparser(a, b)
    sparse, dense, wanted, samples = (a, b, in_a, in_b) if of_a else (b, a, in_b, in_a)
    inside = covered_instants(samples, wanted)
    if not inside.any():
        spans = (
            f"{a.source} from {in_a[0]:.3f} to {in_a[-1]:.3f} s, {b.source} from {in_b[0]:.3f} to"
            f" {in_b[-1]:.3f} s"
        )
        raise DataError(
            f"the time spans of the files do not overlap: {spans} of the same week; check week and"
            " time scale (UTC is 18 s behind GPST)"
        )
    rows = np.flatnonzero(inside)
    partner = interpolate_poses(dense, samples, wanted[rows])
    left_dense = int(((samples < wanted[rows[0]]) | (samples > wanted[rows[-1]])).sum())
    unmatched = (sparse.n - rows.size, left_dense)
    taken = sparse.taken(rows)
    if of_a:
        return Matched(taken, partner, "time", *unmatched, wanted[rows])
    return Matched(partner, taken, "time", unmatched[1], unmatched[0], wanted[rows])


def covered_instants(samples: Array, wanted: Array) -> NDArray[np.bool_]:
    """Which of the instants `wanted` lie between two samples that are not far apart."""
    if samples.size < 2:
        return np.zeros(wanted.shape, dtype=bool)
    longest = GAP_STEPS * float(np.median(np.diff(samples)))
    right = np.clip(np.searchsorted(samples, wanted - SAME_INSTANT_S), 1, samples.size - 1)
    near = samples[right] - samples[right - 1] <= longest
    return (wanted >= samples[0] - SAME_INSTANT_S) & (wanted <= samples[-1] + SAME_INSTANT_S) & near


def interpolate_poses(poses: Poses, samples: Array, wanted: Array) -> Poses:
    """`poses`, whose times are `samples`, at the instants `wanted`, which the samples cover."""
    count = min(4, samples.size)
    right = np.clip(np.searchsorted(samples, wanted - SAME_INSTANT_S), 1, samples.size - 1)
    first = np.clip(right - count // 2, 0, samples.size - count)
    rows = first[:, None] + np.arange(count)
    weight = _lagrange(samples[rows], wanted)
    lat, lon, height = ecef_to_geodetic(np.einsum("nk,nki->ni", weight, poses.ecef[rows]))
    C = poses.C_Ex
    if C is not None:
        base = C[rows[:, 1 if count > 1 else 0]]
        turn = vector_from_rotation(C[rows] @ np.swapaxes(base, 1, 2)[:, None])
        C = rotation_from_vector(np.einsum("nk,nki->ni", weight, turn)) @ base
    nearest = np.where(samples[right] - wanted < wanted - samples[right - 1], right, right - 1)
    velocity = (
        None if poses.velocity is None else np.einsum("nk,nki->ni", weight, poses.velocity[rows])
    )
    return replace(
        poses.taken(nearest),
        lat=lat,
        lon=lon,
        height=height,
        time=wanted,
        C_Ex=C,
        velocity=velocity,
        angles=None,
        angle_set=poses.angle_set,
    )


def _lagrange(t: Array, x: Array) -> Array:
    """Weights (n, k) of the samples at t (n, k) for the polynomial through them at x (n,)."""
    out = np.ones_like(t)
    for i in range(t.shape[1]):
        for j in range(t.shape[1]):
            if i != j:
                out[:, i] *= (x - t[:, j]) / (t[:, i] - t[:, j])
    return out
