"""The path that the fixes draw: in metres, and which of them lie on it."""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from ...geodesy.earth import curvature_radii
from ...records import Array, GnssFixes

FASTEST_DRONE_MS = 50.0  # of a drone; a single gross fix makes no longer way than this
# a fix off its neighbours' cubic by so many typical distances, and by at least this
OUTLYING_SIGMAS, LEAST_DETOUR_M = 8.0, 0.05
# m/s^2 by which a velocity may change between fixes: no drone or car makes more than 1 g for long
STEEPEST_MS2 = 10.0
BESIDE_S = 1.0  # s to a fix on either side: the IMU carries the position from one to the other
# steps between fixes, whose median velocity a jump between two of them is compared with
STEPS_AROUND_JUMP = 5


def between_fixes(
    time: Array, path: Array
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """Return the fix of a path before and after each instant, and whether both are near it.

    Parameters
    ----------
    time : ndarray, shape (n,), s
    path : ndarray, shape (m,), s
        Times of the fixes.

    Returns
    -------
    tuple of ndarray, shape (n,)
        Indices of the fixes, and where both are within `BESIDE_S`.
    """
    after = np.searchsorted(path, time)
    inside = (after > 0) & (after < path.size)
    before, after = np.maximum(after - 1, 0), np.minimum(after, path.size - 1)
    near = (time - path[before] < BESIDE_S) & (path[after] - time < BESIDE_S)
    return before, after, inside & near


def north_east(gnss: GnssFixes) -> Array:
    """Return north and east from the first fix, shape (n, 2), m."""
    M, N = curvature_radii(gnss.lat[0])
    return np.column_stack(
        [(gnss.lat - gnss.lat[0]) * M, (gnss.lon - gnss.lon[0]) * N * np.cos(gnss.lat[0])]
    )


def liveliest(gnss: GnssFixes, length_s: float) -> tuple[float, float]:
    """Find the `length_s` seconds in which the fixes draw the longest path, and do not jump.

    Returns
    -------
    tuple of float, s
        Begin and end.
    """
    ne = north_east(gnss)
    step = np.minimum(
        np.linalg.norm(np.diff(ne, axis=0), axis=1),
        FASTEST_DRONE_MS * np.diff(gnss.time),
    )
    path = np.concatenate([[0.0], np.cumsum(step)])
    end = np.searchsorted(gnss.time, gnss.time + length_s, side="right") - 1
    sound = np.flatnonzero(sound_fixes(gnss))
    before = np.append(sound[jumps(gnss.time[sound], ne[sound]) - 1], gnss.time.size - 1)
    end = np.minimum(end, before[np.searchsorted(before, np.arange(gnss.time.size))])
    first = int(np.argmax(path[end] - path))
    return float(gnss.time[first]), float(gnss.time[end[first]])


def sound_fixes(gnss: GnssFixes) -> NDArray[np.bool_]:
    """Find the fixes that lie on a smooth path with their two neighbours on either side.

    Single gross fixes, the outliers of the path, do not.

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    p = np.column_stack([north_east(gnss), -gnss.height])
    sound = np.ones(gnss.time.size, dtype=bool)
    for _ in range(4):
        rows = np.flatnonzero(sound)
        if rows.size < 10:
            break
        q = p[rows]
        distance = np.zeros(rows.size)
        distance[2:-2] = np.linalg.norm(
            q[2:-2] - (4.0 * (q[1:-3] + q[3:-1]) - q[:-4] - q[4:]) / 6.0, axis=1
        )
        even = np.zeros(rows.size, dtype=bool)
        step = np.diff(gnss.time[rows])
        around = np.column_stack([step[:-3], step[1:-2], step[2:-1], step[3:]])
        even[2:-2] = around.max(axis=1) < 1.5 * np.median(step)
        distance[~even] = 0.0
        limit = max(OUTLYING_SIGMAS * float(np.median(distance)), LEAST_DETOUR_M)
        peak = distance.copy()
        for shift in (1, 2):
            peak[shift:] = np.maximum(peak[shift:], distance[:-shift])
            peak[:-shift] = np.maximum(peak[:-shift], distance[shift:])
        bad = (distance > limit) & (distance == peak)
        if not bad.any():
            break
        sound[rows[bad]] = False
    return sound


def jumps(time: Array, ne: Array) -> NDArray[np.int64]:
    """Find the fixes before which the path jumps farther than anything that flies can go.

    A jump of the receiver, by a glitch or from one kind of solution to another, is one step between
    two stretches that are smooth in themselves.

    Parameters
    ----------
    time : ndarray, shape (n,), s
    ne : ndarray, shape (n, 2), m
        North and east.

    Returns
    -------
    ndarray of int
    """
    if time.size <= STEPS_AROUND_JUMP:
        return np.empty(0, dtype=np.int64)
    interval = np.diff(time)
    velocity = np.diff(ne, axis=0) / interval[:, None]
    padded = np.pad(
        velocity, ((STEPS_AROUND_JUMP // 2, STEPS_AROUND_JUMP // 2), (0, 0)), mode="edge"
    )
    usual = np.median(sliding_window_view(padded, STEPS_AROUND_JUMP, axis=0), axis=-1)
    excess = np.linalg.norm(velocity - usual, axis=1) * interval
    limit = OUTLYING_SIGMAS * float(np.median(excess))
    steepest = (
        STEEPEST_MS2 * interval * (0.5 * interval + STEPS_AROUND_JUMP // 2 * np.median(interval))
    )
    return np.flatnonzero(excess > np.maximum(limit, steepest)) + 1
