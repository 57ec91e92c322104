r"""Whether the clocks of two files agree.

Stamps of b may be early or late, by seconds or by milliseconds (latency).

Files matched by time are matched anew with whole seconds added to b's stamps; of the shift that
leaves least of the horizontal differences d the rest follows by least squares, until it does not
change,

    d = v dt + s + C_Ex l                                                                      (T.1)

with the velocity v, beside a constant shift s and, where the files are of different points and
there are attitudes, a lever arm l, which looks like time as long as the speed is the same. Time is
stated if it explains enough of what s and l leave. Files of images with times are held against each
other by name.
"""

import numpy as np

from ...base.errors import DataError
from ...geodesy.conventions import time_scale
from ...geodesy.explain import EXPLAINS, best_shift
from ...records import Array
from .hypotheses import LEAST_POSES, rms
from .matching import Matched, covered_instants, interpolate_poses, match, sparser, times
from .poses import Poses
from .position import difference, velocity_of
from .result import Mismatch

WIDEST_S = 30  # of the shifts that are tried: leap seconds are less
MOST_POSES = 500  # that the search looks at
LEAST_SHIFT_S = 5e-4  # of a shift that is named: 5 mm of the path at 10 m/s (chosen)
LEAST_UNEXPLAINED_M = 1e-3  # of what a shift and a lever arm leave; below it nobody asks why
NARROWINGS = 8  # of narrowing the search (chosen)
LEAP_S = 0.05  # what the motion leaves uncertain of whole leap seconds
LEAST_SHARE = 0.5  # of the poses that must have a partner at a shift


def by_names(matched: Matched) -> Mismatch | None:
    """The times that both files give for the same images: constant difference, if there is one."""
    a, b = matched.a, matched.b
    if matched.how != "image" or a.time is None or b.time is None:
        return None
    offset = times(a, b)[1] - a.time
    usual = float(np.median(offset))
    if abs(usual) < LEAST_SHIFT_S:
        return None
    before, after = (rms(seconds[:, None]) for seconds in (offset, offset - usual))
    if after > EXPLAINS * before:
        return None
    text = (
        f"stamps of b are {abs(usual):.3f} s {'later' if usual > 0 else 'earlier'} than those of a"
        f" for the same images{leap_words(usual)}"
    )
    return Mismatch("time", text, "time", before, after, {"seconds": usual}, unit="s")


def by_motion(a: Poses, b: Poses) -> tuple[Mismatch, Matched] | None:
    """Find the shift of b's stamps that explains the differences of poses matched by time.

    The match with it taken off comes with it; None where no shift explains them.
    """
    least = best_shift(lambda shift: _spread(a, b, shift), WIDEST_S, 1.0)
    if least is None:
        return None
    best = least[0]
    for _ in range(NARROWINGS):
        step = _step(a, b, best)
        best += step
        if abs(step) < 1e-6:
            break
    if abs(best) < LEAST_SHIFT_S:
        return None
    before, after = _spread(a, b, 0.0), _spread(a, b, best)
    if not np.isfinite(after):
        return None
    if not np.isfinite(
        before
    ):  # too few meet without it: by how much they would be apart on the way
        before = abs(best) * _speed(a, b, best)
    if before < LEAST_UNEXPLAINED_M or after > EXPLAINS * before:
        return None
    text = f"stamps of b are {abs(best):.4f} s {'early' if best > 0 else 'late'}{leap_words(-best)}"
    return Mismatch("time", text, "time", before, after, {"seconds": -best}), match(a, b, best)


def leap_words(late_s: float) -> str:
    """What it means that stamps of b are late by so many seconds."""
    scale = time_scale(late_s, LEAP_S)
    if "leap seconds between" in scale:
        scale += f": {'b is in UTC, a in GPST' if late_s < 0 else 'b is in GPST, a in UTC'}"
    return f" ({scale})" if scale else ""


def _spread(a: Poses, b: Poses, shift: float) -> float:
    """rms, m, of what s and l of (T.1) leave of the horizontal differences.

    `shift` is added to b's stamps. It is infinite where too few meet.
    """
    matched = _sampled(a, b, shift)
    if matched is None:
        return np.inf
    d, beside = _equations(*matched)
    residual = d - beside @ np.linalg.lstsq(beside, d, rcond=None)[0]
    return float(np.sqrt(2.0 * np.mean(residual**2)))


def _equations(a: Poses, b: Poses) -> tuple[Array, Array]:
    """d (2 n,) of (T.1), and the columns (2 n, k) of s and l."""
    shift = np.tile(np.eye(2), (a.n, 1))
    axes = a.C_Ex if a.C_Ex is not None else b.C_Ex
    lever = [] if axes is None or a.point == b.point else [axes[:, :2].reshape(-1, 3)]
    return difference(a, b)[:, :2].ravel(), np.hstack([shift, *lever])


def _speed(a: Poses, b: Poses, shift: float) -> float:
    """rms horizontal speed, m/s, where the files meet at `shift`."""
    matched = _sampled(a, b, shift)
    v = None if matched is None else velocity_of(*matched)
    return 0.0 if v is None else rms(v[:, :2])


def _step(a: Poses, b: Poses, shift: float) -> float:
    """What is to be added to `shift`, s: dt of (T.1)."""
    matched = _sampled(a, b, shift)
    v = None if matched is None else velocity_of(*matched)
    if matched is None or v is None:
        return 0.0
    d, beside = _equations(*matched)
    solution = np.linalg.lstsq(np.column_stack([v[:, :2].ravel(), beside]), d, rcond=None)[0]
    return float(np.clip(solution[0], -0.5, 0.5))


def _sampled(a: Poses, b: Poses, shift: float) -> tuple[Poses, Poses] | None:
    """Some poses of the one with fewer, and the other's at the same times; as `match`."""
    try:
        in_a, in_b = times(a, b, shift)
    except DataError:
        return None
    of_a = sparser(a, b)
    sparse, dense, wanted, samples = (a, b, in_a, in_b) if of_a else (b, a, in_b, in_a)
    inside = np.flatnonzero(covered_instants(samples, wanted))
    if inside.size < max(LEAST_POSES, LEAST_SHARE * wanted.size):
        return None
    rows = inside[:: max(1, inside.size // MOST_POSES)]
    taken, from_dense = sparse.taken(rows), interpolate_poses(dense, samples, wanted[rows])
    return (taken, from_dense) if of_a else (from_dense, taken)
