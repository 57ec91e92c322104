"""Fixes of several kinds in one file, such as RTK and single-point ones in turn.

The kinds may count heights from other surfaces or be of other datums, and loggers join them with
velocities of another sense. With the positions x, a velocity is held against the displacements of
its own kind over `VELOCITY_LAG_S`, and positions of one kind against those of the best one, carried
over the step between two rows of different kinds by the slope of their path:

    d = x_k - (x_i + x'_i (t_k - t_i))                                                    (FK.1)

d is the median over all such steps, its sigma from their median absolute deviation.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ....geodesy.earth import curvature_radii
from ....records import Array, Finding, GnssFixes
from ....records.qualities import Quality
from ..text.order import note

Rows = NDArray[np.int64]

BEST_FIRST = (1, 2, 6, 4, 3, 5, 0)  # codes of `Quality`: fixed, float, PPP, DGPS, SBAS, single
FEWEST_OF_KIND = 20  # of a kind (chosen): fewer are outliers rather than a kind
# s: noise of 2 m over it is 1.4 m/s, less than any vehicle flies; turns take longer
VELOCITY_LAG_S = 2.0
OPPOSED = 0.8  # correlation with the displacements: velocities of good receivers exceed 0.95
FEWEST_STEPS_BETWEEN_KINDS = 4  # between kinds, of which a median and its sigma follow (chosen)
# usual intervals between rows of a step: after a gap the slope is another
LONGEST_STEP_INTERVALS = 1.5
LEAST_OFFSET_M, LEAST_SIGMAS = 0.5, 5.0  # m and sigmas: smaller offsets are in the fixes' sigmas
DEVIATION = 1.4826 * 1.2533  # of normal errors: sigma of a median by the deviations' median


def with_agreeing_kinds(fixes: GnssFixes) -> GnssFixes:
    """Return fixes whose kinds agree in the sense of their velocities, with notes on what differs.

    Velocities of a kind that oppose its own displacements, where those of another kind follow
    theirs, are turned round; offsets between kinds are told and stay.
    """
    if fixes.quality is None:
        return fixes
    codes, counts = np.unique(fixes.quality, return_counts=True)
    kinds = [k for k in BEST_FIRST if k in codes[counts >= FEWEST_OF_KIND]]
    if len(kinds) < 2:
        return fixes
    M, N = curvature_radii(fixes.lat[0])
    north = (fixes.lat - fixes.lat[0]) * M
    east = (fixes.lon - fixes.lon[0]) * N * np.cos(fixes.lat[0])
    path = np.column_stack([north, east, fixes.height])
    rows = {kind: np.flatnonzero(fixes.quality == kind) for kind in kinds}
    turned, findings = _reverse_velocities(fixes, path, rows)
    for kind in kinds[1:]:
        findings += _offset(fixes.time, path, rows[kinds[0]], rows[kind], (kinds[0], kind))
    return replace(turned, notes=(*turned.notes, *findings))


def _name(kind: int) -> str:
    """The name of a quality in small letters."""
    return Quality(kind).name.lower()


def _reverse_velocities(
    fixes: GnssFixes, path: Array, rows: dict[int, Rows]
) -> tuple[GnssFixes, tuple[Finding, ...]]:
    """Turn velocities round that oppose the displacements of their kind, with notes."""
    if fixes.velocity_ned is None:
        return fixes, ()
    likeness = {
        kind: _likeness(fixes.time[k], path[k, :2], fixes.velocity_ned[k, :2])
        for kind, k in rows.items()
    }
    opposed = [kind for kind, like in likeness.items() if like < -OPPOSED]
    if not opposed or max(likeness.values()) < OPPOSED:
        return fixes, ()
    velocity, findings = fixes.velocity_ned.copy(), []
    for kind in opposed:
        velocity[rows[kind]] *= -1.0
        finding = (
            f"velocities of the {rows[kind].size} fixes of quality {_name(kind)} point"
            f" against the displacements between these fixes (correlation {likeness[kind]:.2f})"
        )
        advice = "their signs were reversed; correct the file"
        findings.append(
            note("GNSS velocity", finding, "velocities along the displacements", advice)
        )
    return replace(fixes, velocity_ned=velocity), tuple(findings)


def _likeness(time: Array, path: Array, velocity: Array) -> float:
    """Correlation of horizontal velocities with displacements over `VELOCITY_LAG_S`; 0 where none
    moves.
    """
    later = np.searchsorted(time, time + VELOCITY_LAG_S)
    first = np.flatnonzero(later < time.size)
    first = first[time[later[first]] - time[first] < 2.0 * VELOCITY_LAG_S]
    last = later[first]
    mean = 0.5 * (velocity[first] + velocity[last])
    moved = (path[last] - path[first]) / (time[last] - time[first])[:, None]
    size = np.sqrt(np.sum(mean**2) * np.sum(moved**2))
    return float(np.sum(mean * moved) / size) if size > 0.0 else 0.0


def _offset(
    time: Array, path: Array, best: Rows, worse: Rows, kinds: tuple[int, int]
) -> tuple[Finding, ...]:
    """Return the note on the offset of a kind of fixes from the best one by (FK.1)."""
    slope = np.gradient(path[best], time[best], axis=0)
    longest = LONGEST_STEP_INTERVALS * float(np.median(np.diff(time)))
    after = np.searchsorted(time[best], time[worse])
    steps = []
    for near in (after - 1, after):
        k = np.flatnonzero((near >= 0) & (near < best.size))
        ahead = time[worse[k]] - time[best[near[k]]]
        k, ahead = k[np.abs(ahead) <= longest], ahead[np.abs(ahead) <= longest]
        predicted = path[best[near[k]]] + slope[near[k]] * ahead[:, None]
        steps.append(path[worse[k]] - predicted)
    d = np.concatenate(steps)
    if len(d) < FEWEST_STEPS_BETWEEN_KINDS:
        return ()
    middle = np.median(d, axis=0)
    sigma = DEVIATION * np.median(np.abs(d - middle), axis=0) / np.sqrt(len(d))
    if not (np.abs(middle) > np.maximum(LEAST_OFFSET_M, LEAST_SIGMAS * sigma)).any():
        return ()
    n, e, u = middle
    finding = (
        f"fixes of quality {_name(kinds[1])} lie {n:+.2f} m north, {e:+.2f} m east, {u:+.2f} m up"
        f" of those of quality {_name(kinds[0])} (sigma {' '.join(f'{x:.2f}' for x in sigma)} m,"
        f" from {len(d)} changes between the two qualities)"
    )
    advice = (
        f"leave the {_name(kinds[1])} fixes out, or correct their heights if these refer to"
        " another surface, or state in gnss.quality_sigma_m how wrong they may be"
    )
    return (note("GNSS kinds", finding, f"within {LEAST_OFFSET_M:g} m of each other", advice),)
