"""The two signals of the recogniser: accelerations seen by GNSS, and propagated specific force.

The gyros propagate the force of the accelerometers. Mathematics: the package's docstring, (R.1) to
(R.3).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...geodesy.earth import normal_gravity
from ...records import Array, GnssFixes, ImuSamples
from ..prepare.fix_path import north_east
from ..prepare.gaps import nominal_interval
from ..prepare.stuck_channels import run_edges
from ._kernels import propagate

# a drone turns some degrees in it at most; finer than any lag that is looked for
FORCE_GRID_S = 0.02
# an IMU interval longer than this, and than 5 nominal ones, holds a motion that is unseen
UNSEEN_MOTION_S = 0.1
# in which the gyros propagate the attitude: a bias of 0.3 deg/s turns it by 3 deg from its middle
# to its end
FORCE_WINDOW_S = 20.0
UNSEEN_MS2 = 0.1  # of the specific force that fixes do not see: vibration, lever arm
LEAST_WINDOW_ROWS = 5  # accelerations of a window whose median counts (chosen)
# accelerations that are fitted: more take time and tell nothing new (chosen)
MOST_FITTED_ROWS = 1500
# times the distance from the neighbours' mean that a tenth of the readings exceed
SPIKE_DISTANCES = 10.0
# s and share of the recording without a change, and changes of a neighbour meanwhile
DEAD_S, DEAD_SHARE, ALIVE = 20.0, 0.3, 10
LEAST_COUNT = 100.0  # that a sensor which counts reaches in motion: half a g, a few deg/s


@dataclass(frozen=True, eq=False)
class ImuGrid:
    """Raw increments on an even grid of n intervals.

    Parameters
    ----------
    start : float, s
    step : float, s
        Length of an interval.
    dtheta, dvel : ndarray, shape (n, 3)
        In the file's unit times s.
    broken : ndarray, shape (n + 1,)
        Number of grid intervals up to each instant that lie in a gap.
    interval : float, s
        Nominal interval of the recording.
    whole_gyro, whole_accel : bool
        Whether all readings of the sensor are whole numbers.
    """

    start: float
    step: float
    dtheta: Array
    dvel: Array
    broken: Array
    interval: float
    whole_gyro: bool = False
    whole_accel: bool = False


def imu_grid(imu: ImuSamples) -> ImuGrid:
    """Integrate the readings as if they were rates, whatever their unit, and cut evenly."""
    dt = nominal_interval(imu.time)
    width = np.diff(imu.time)
    gap = width > max(UNSEEN_MOTION_S, 5.0 * dt)
    weight = np.full(width.size, dt) if imu.quantity == "increments" else width
    step = max(FORCE_GRID_S, dt)
    n = max(1, int((imu.time[-1] - imu.time[0]) / step))
    instants = imu.time[0] + step * np.arange(n + 1)
    # position of each instant among the samples, once for all seven columns
    k = np.clip(np.searchsorted(imu.time, instants, side="right") - 1, 0, width.size - 1)
    share = ((instants - imu.time[k]) / width[k])[:, None]
    readings = []
    for values in (imu.gyro, imu.accel):
        mean = 0.5 * (values[1:] + values[:-1]) if imu.quantity == "instant_rate" else values[1:]
        piece = mean * weight[:, None]
        total = np.concatenate([np.zeros((1, 3)), np.cumsum(piece, axis=0)])
        readings.append(_without_spikes(np.diff(total[k] + share * piece[k], axis=0)))
    inside = np.concatenate([[0.0], np.cumsum(gap * width)])
    broken = np.rint((inside[k] + share[:, 0] * (gap * width)[k]) / step + 0.499)
    gyro, accel = readings
    whole = _whole(imu.gyro), _whole(imu.accel)
    return ImuGrid(float(imu.time[0]), step, gyro, accel, broken, dt, *whole)


def _whole(values: Array) -> bool:
    """Tell whether readings (n, 3) are whole numbers, as counts are, and not all of a few."""
    if np.abs(values).max() < LEAST_COUNT:
        return False
    return all(bool((piece % 1.0 == 0.0).all()) for piece in (values[:100], values))


def _without_spikes(x: Array) -> Array:
    """Replace single rows of increments (n, 3) far off the mean of their neighbours by that mean.

    Only the recogniser sees this.
    """
    if len(x) < 3:
        return x
    mean = 0.5 * (x[:-2] + x[2:])
    deviation = np.linalg.norm(x[1:-1] - mean, axis=1)
    beyond = deviation > SPIKE_DISTANCES * float(np.quantile(deviation, 0.9)) + 1e-12
    beyond[1:] &= deviation[1:] >= deviation[:-1]
    beyond[:-1] &= deviation[:-1] >= deviation[1:]
    rows = np.flatnonzero(beyond)
    x[rows + 1] = mean[rows]
    return x


def dead_channel(imu: ImuSamples) -> str:
    """Name a channel that repeats one value for a large part of the recording.

    Its neighbours change meanwhile. The name is empty where there is no such channel.
    """
    least = max(DEAD_SHARE * imu.time.size, DEAD_S / nominal_interval(imu.time))
    # what does not change for so long has the same value at two neighbours of every half of it
    sparse = np.concatenate([imu.gyro, imu.accel], axis=1)[:: max(1, int(0.5 * least))]
    if not np.any(sparse[1:] == sparse[:-1]):
        return ""
    for sensor, values in (("gyro", imu.gyro), ("accelerometer", imu.accel)):
        edges = [run_edges(column) for column in values.T]
        for c, changes in enumerate(edges):
            k = int(np.argmax(np.diff(changes)))
            first, last = changes[k], changes[k + 1]
            others = [int(np.sum((e > first) & (e < last))) for e in edges]
            if last - first > least and max(others) > ALIVE:
                return f"{sensor} {'xyz'[c]}"
    return ""


@dataclass(frozen=True, eq=False)
class PropagatedForce:
    """Specific force in the axes 0 that the sensor had at the grid's start (R.1).

    Parameters
    ----------
    grid : ImuGrid
    gyro_factor : float
        Factor from the gyro readings to rad/s.
    C : ndarray, shape (n, 3, 3)
        Sensor axes into axes 0.
    V, S : ndarray, shape (n, 3), m/s and m
        Integrals of the force.
    """

    grid: ImuGrid
    gyro_factor: float
    C: Array
    V: Array
    S: Array

    @cached_property
    def force(self) -> Array:
        """Derivative of V, shape (n, 3), m/s^2."""
        return np.gradient(self.V, self.grid.step, axis=0)

    @cached_property
    def C_rate(self) -> Array:
        """Derivative of C, shape (n, 3, 3), 1/s."""
        return np.gradient(self.C, self.grid.step, axis=0)

    @cached_property
    def turned(self) -> Array:
        """Integral of C omega, (n, 3) rad: the rotation by a relative error of the gyro factor."""
        turn = np.einsum("nij,nj->ni", self.C[:-1], self.grid.dtheta * self.gyro_factor)
        return np.concatenate([np.zeros((1, 3)), np.cumsum(turn, axis=0)])

    @cached_property
    def drifted(self) -> Array:
        """Integral of C, shape (n, 3, 3), s: the rotation that a gyro bias makes."""
        turn = 0.5 * self.grid.step * (self.C[1:] + self.C[:-1])
        return np.concatenate([np.zeros((1, 3, 3)), np.cumsum(turn, axis=0)])


def propagate_force(grid: ImuGrid, gyro_factor: float, accel_factor: float) -> PropagatedForce:
    """Propagate the specific force (R.1), the readings multiplied by the factors."""
    n = grid.broken.size
    C, V, S = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty((n, 3))
    propagate(grid.dtheta * gyro_factor, grid.dvel * accel_factor, grid.step, C, V, S)
    return PropagatedForce(grid, gyro_factor, C, V, S)


@dataclass(frozen=True, eq=False)
class Accelerations:
    """Specific force in north, east, down that GNSS saw (R.2, R.3).

    Parameters
    ----------
    kind : str
        "position" or "velocity".
    span_s : float, s
        From first to last node, nominal.
    nodes : ndarray, shape (m, 3), s
    coef : ndarray, shape (m, 3)
        Coefficients of the differences at the nodes.
    z : ndarray, shape (m, 3), m/s^2
    weight : ndarray, shape (m,)
        At most 1, less where the receiver gives a fix a larger variance than its usual ones.
    window : ndarray of int, shape (m,)
        Number of its window.
    """

    kind: Literal["position", "velocity"]
    span_s: float
    nodes: Array
    coef: Array
    z: Array
    weight: Array
    window: NDArray[np.int64]

    @property
    def time(self) -> Array:
        """Middle of the nodes, shape (m,), s."""
        return 0.5 * (self.nodes[:, 0] + self.nodes[:, 2])


def accelerations(
    gnss: GnssFixes,
    sound: NDArray[np.bool_],
    kind: Literal["position", "velocity"],
    half_s: float,
    dense: bool = False,
) -> Accelerations:
    """Differentiate the fixes: over `half_s` (velocity) or over twice that (position).

    Parameters
    ----------
    gnss : GnssFixes
    sound : ndarray of bool, shape (n,)
        The fixes that are used.
    kind : str
        "position" or "velocity".
    half_s : float, s
    dense : bool
        Whether differences begin as densely as `MOST_FITTED_ROWS` allows, else `half_s` after each
        other.

    Returns
    -------
    Accelerations
        Weights are those of the fixes' errors together with `UNSEEN_MS2`, which no accuracy of the
        fixes takes away.
    """
    t = gnss.time[sound]
    size = half_s if kind == "velocity" else 2.0 * half_s
    gravity = np.array([0.0, 0.0, float(normal_gravity(gnss.lat[0], gnss.height[0]))])
    begin = np.arange(t.size)
    end = _nearest(t, t + size)
    middle = _nearest(t, t + 0.5 * size) if kind == "position" else end
    near = np.abs(t[end] - t - size) < 0.3 * size
    if kind == "position":
        near &= (
            (middle > begin) & (end > middle) & (np.abs(t[middle] - t - 0.5 * size) < 0.15 * size)
        )
    begin, middle, end = begin[near], middle[near], end[near]
    t1, t2, t3 = t[begin], t[middle], t[end]
    if kind == "velocity":
        assert gnss.velocity_ned is not None
        assert gnss.velocity_cov_ned is not None
        v, cov = gnss.velocity_ned[sound], gnss.velocity_cov_ned[sound]
        c = 1.0 / (t3 - t1)
        coef = np.column_stack([-c, np.zeros_like(c), c])
        z = (v[end] - v[begin]) * c[:, None] - gravity
    else:
        p, cov = np.column_stack([north_east(gnss), -gnss.height])[sound], gnss.cov_ned[sound]
        c1, c3 = 2.0 / ((t2 - t1) * (t3 - t1)), 2.0 / ((t3 - t2) * (t3 - t1))
        coef = np.column_stack([c1, -c1 - c3, c3])
        z = c1[:, None] * (p[begin] - p[middle]) + c3[:, None] * (p[end] - p[middle]) - gravity
    variance = cov[:, 0, 0] + cov[:, 1, 1]
    worst = np.maximum(np.maximum(variance[begin], variance[middle]), variance[end])
    unseen, terms = (half_s, 2.0) if kind == "velocity" else (half_s**2, 6.0)
    floor = 2.0 * (UNSEEN_MS2 * unseen) ** 2 / terms
    weight = np.minimum(1.0, (np.median(variance) + floor) / (worst + floor))
    nodes = np.column_stack([t1, t2, t3])
    window = ((t1 - t[0]) / FORCE_WINDOW_S).astype(np.int64)
    thin = round(half_s / float(np.median(np.diff(t))))
    thin = min(thin, -(-t1.size // MOST_FITTED_ROWS)) if dense else thin
    return _most_moved(Accelerations(kind, size, nodes, coef, z, weight, window), max(1, thin))


def _most_moved(acc: Accelerations, every: int) -> Accelerations:
    """Thin the rows by `every`, to `MOST_FITTED_ROWS` in the windows of the largest changes."""
    rows = np.arange(0, acc.window.size, every)
    first = np.unique(acc.window[rows], return_index=True)[1]
    pieces = np.split(rows, first[1:])
    change = np.full(len(pieces), -1.0)
    for k, piece in enumerate(pieces):
        if piece.size >= LEAST_WINDOW_ROWS:
            level = acc.z[piece, :2]
            change[k] = np.median(np.abs(level - np.median(level, axis=0)))
    kept: list[NDArray[np.int64]] = []
    for k in np.argsort(change)[::-1]:
        if change[k] >= 0.0 and sum(piece.size for piece in kept) < MOST_FITTED_ROWS:
            kept.append(pieces[k])
    rows = np.sort(np.concatenate(kept)) if kept else rows[:0]
    window = np.unique(acc.window[rows], return_inverse=True)[1]
    nodes, coef, z, weight = acc.nodes[rows], acc.coef[rows], acc.z[rows], acc.weight[rows]
    return Accelerations(acc.kind, acc.span_s, nodes, coef, z, weight, window)


def _nearest(t: Array, wanted: Array) -> NDArray[np.int64]:
    """Index of the entry of t (n,) nearest to each of `wanted`."""
    k = np.clip(np.searchsorted(t, wanted), 1, t.size - 1)
    return k - (wanted - t[k - 1] < t[k] - wanted)
