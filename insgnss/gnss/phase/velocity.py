"""Velocity of the antenna from the time-differenced carrier phase (TDCP) of one receiver.

From epoch a to the next one b, a phase without loss of lock changes by that of the range, the
clocks and the air:

    lambda (phi_b - phi_a) = [rho - c dt_s + T]_b - [rho - c dt_s + T]_a + c (dt_b - dt_a)
                             + noise                                                           (V.1)

rho with the Earth's rotation during the flight of the signal, dt_s the satellite's clock with
relativity, T the standard troposphere, dt the receiver's clock. Satellites are taken at emission
from one and the same message at both epochs, so that the step from one message to the next does not
enter. With positions p known to metres, r_b - r_a = p_b - p_a + d, u the direction to the
satellite:

    y = lambda (phi_b - phi_a) - [rho(p) - c dt_s + T]_b + [rho(p) - c dt_s + T]_a
      = -u d + c (dt_b - dt_a)                                                                 (V.2)

is solved for d and the clock by weighted least squares over all satellites and bands, one clock for
all systems (their offsets are constant). The result is the mean velocity over the interval, (r_b -
r_a) / (t_b - t_a), stamped in its middle. It is the velocity at the stamp but for r''' (t_b -
t_a)^2 / 24 (at the epochs themselves: V.5). t is the receiver's stamp less its clock error from the
code ranges, which also takes out the steps of a receiver clock that is steered by milliseconds.

Rejection. A phase is not used where the receiver flags loss of lock at b, where the half-cycle flag
changes, or at an epoch after a power failure. Then a robust start (least absolute residuals) drops
what is 6 sigma off, and least squares drops, one by one, the row of the largest normalised residual
above `limit`; an interval is given up when fewer than `fewest` satellites are left, their geometry
makes the standard deviation too large, or the chi-square is still too large. A slip that all
satellites share is a clock, and does no harm.

Covariance. Each pair of phases has its own noise and, with the satellite's other bands, a share of
what changes in its air and clock:

    sigma^2 = s^2 (1 + 1 / sin^2 E) + common^2,   common = rate (t_b - t_a) / sin E            (V.3)
    cov = N (sum_i w_i^2 (sigma_i^2 - common_i^2) a_i^T a_i + sum_satellites g^T g) N,
    g = sum_i w_i common_i a_i,   N = (sum_i w_i a_i^T a_i)^-1,   w = 1 / sigma^2              (V.4)

s is the noise at zenith of one phase, estimated from the residuals of the whole recording for every
system and band; at the end all is scaled by the chi-square of the whole. The ionosphere is taken
off by `time_differences`. What an error of p does (satellites turn by 1.6e-4 rad/s) is added.
Errors of neighbouring intervals share a phase: they correlate by -1/2, so that sums of
displacements do not drift faster than the air. A filter that takes the intervals as independent is
on the safe side over more than one.

Velocity at an epoch, between intervals T1 and T2 with mean velocities v1 and v2, j = r''' there:

    v = (T2 v1 + T1 v2) / (T1 + T2) - j T1 T2 / 6                                              (V.5)
    j = sum_i s_i v_i / T^2                                                                    (V.6)

exact on a path of third degree. Without its last term v is too slow by (w T)^2 / 6 of itself in a
turn of angular velocity w: 7 mm/s at 10 m/s, 15 m radius and 10 Hz, 0.7 m/s at 1 Hz, and that for
as long as the turn. s are the weights of the cubic that fits the positions of the epochs within
`JERK_S`, two at least, to either side (Savitzky and Golay 1964): two to either side see 1 - (w T)^2
/ 4 of j, many 1 - (w JERK_S)^2 / 18. Where intervals are missing or of different lengths there, two
are taken, or none and j = 0. The covariance is

    cov = sum_k e_k^2 P_k + (m b)(m b)^T + (J T1 T2 / 6)^2 1,   b = j T1 T2 / 6                (V.7)

e_k: weight of the phase at epoch k in (V.5), of P_k = cov T^2 / 2 in metres (the shared phase of v1
and v2 cancels; 12 intervals make the standard deviation 0.2 % larger than two without j, four 34
%). m: `MISSED_SHARE`. J: what the vehicle does within T no receiver sees; `UNKNOWN_JERK` stands for
it, 2 mm/s at 10 Hz and 0.17 m/s at 1 Hz, where a drone's swaying is aliased; `UNSEEN_JERK` without
(V.6).

van Graas and Soloviev (2004), Navigation 51(4); Serrano et al. (2004), ION GNSS; Baarda (1968) for
the normalised residual.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...base.errors import DataError
from ...geodesy.frames import ecef_to_geodetic, rotation_en
from ...records import Array, GnssFixes
from ...records.variances import MAD_TO_SIGMA
from ..rinex.navigation_message import Navigation
from ..rinex.observation_record import Observations
from ..satellites.orbits import LIGHT
from .time_differences import (
    AntennaPath,
    Pairs,
    VelocityOptions,
    antenna_states,
    code_ranges,
    modelled_pairs,
    neighbours,
    phase_pairs,
)

Index = NDArray[np.int64]

SATELLITE_TURN = 1.6e-4  # rad/s, at which the direction to a satellite turns at most
SAME_TIME_S = 1e-3  # between stamps of one epoch: receivers steer their clocks to a millisecond
POOLED_ROWS = 300  # of all groups that are added to those of each, when its noise is estimated
JERK_S = 0.6  # to either side of an epoch, in which its jerk is found
UNEVEN = 0.1  # of an interval, by which those around an epoch may differ
MISSED_SHARE = 0.2  # of what the jerk bends, that a cubic through the epochs around does not see
UNKNOWN_JERK, UNSEEN_JERK = 1.0, 5.0  # m/s^3, beside the jerk that is found, and where none is
OF_ANOTHER_FLIGHT = "check that positions and navigation are of this flight"
LEAST_REDUNDANCY = 1e-9  # of an interval: above zero, so that one without any has no ratio
FIRST_NOISE_M = 0.01  # of the phase at zenith, before it is known


@dataclass(frozen=True, eq=False)
class AntennaVelocity:
    """Mean velocities of the antenna over intervals between neighbouring epochs of the receiver.

    Parameters
    ----------
    time : ndarray, shape (n,)
        s, GPST of `gps_week`, the middle of the interval.
    interval_s : ndarray, shape (n,)
        Length of the interval, s.
    velocity_ned : ndarray, shape (n, 3)
        m/s, north, east, down.
    cov_ned : ndarray, shape (n, 3, 3)
        m^2/s^2.
    used : ndarray of int, shape (n,)
        Number of satellites.
    epoch : ndarray of int, shape (n,)
        Index of the interval's end among the epochs of the observations.
    clock_rate : ndarray, shape (n,)
        Of the receiver's clock, s/s.
    noise_m : dict of float
        Estimated phase noise at zenith, m, by system and band ("G1").
    gps_week : int
        Week of the times.
    intervals : int
        Number of intervals between the epochs.
    rejected : float
        Share of the pairs of phases without flag that were rejected.
    """

    time: Array
    interval_s: Array
    velocity_ned: Array
    cov_ned: Array
    used: Index
    epoch: Index
    clock_rate: Array
    noise_m: dict[str, float]
    gps_week: int
    intervals: int
    rejected: float


def time_differenced_velocity(
    observations: Observations,
    navigation: Navigation,
    positions: GnssFixes,
    options: VelocityOptions | None = None,
) -> AntennaVelocity:
    """Estimate mean velocities between neighbouring epochs of the rover by TDCP.

    Parameters
    ----------
    observations : Observations
        Of the rover.
    navigation : Navigation
        Broadcast ephemerides.
    positions : GnssFixes
        Of the antenna, to some metres; between them it is interpolated.
    options : VelocityOptions, optional
        Limits.

    Raises
    ------
    DataError
        Where no interval can be solved.
    """
    options = options or VelocityOptions()
    navigation = navigation.of_week(observations.gps_week)
    code = code_ranges(observations)
    antenna, states = antenna_states(observations, navigation, positions, code, options)
    earlier, later = neighbours(observations, antenna, options)
    modelled = modelled_pairs(observations, navigation, antenna, code, states, earlier, later)
    pairs = phase_pairs(observations, navigation, modelled, options) if earlier.size else None
    if pairs is None or pairs.y.size == 0:
        message = (
            "no satellite has a phase in two neighbouring epochs with a position, an ephemeris"
            " and no loss of lock"
        )
        raise DataError(f"{observations.header.path}: {message}; {OF_ANOTHER_FLIGHT}")
    return _solve(observations, antenna, pairs, options)


def _solve(
    observations: Observations, antenna: AntennaPath, pairs: Pairs, options: VelocityOptions
) -> AntennaVelocity:
    """Solve all intervals by least squares, and return the velocities of those that agree."""
    ends, start = np.unique(pairs.epoch, return_index=True)
    length = antenna.time[ends] - antenna.time[ends - 1]
    solution, cov, sums, weight, noise = _least_squares(
        pairs, np.append(start, pairs.epoch.size), length, options
    )
    factor = sums[:, 1].sum() / max(sums[:, 2].sum(), 1.0)
    consistency = sums[:, 1] / np.maximum(factor * sums[:, 2], LEAST_REDUNDANCY)
    sd = np.sqrt(factor * np.trace(cov[:, :3, :3], axis1=1, axis2=2)) / length
    good = (
        (sums[:, 0] >= options.fewest)
        & (consistency <= options.excess)
        & (sd <= options.largest_sd)
    )
    if not good.any():
        message = (
            f"none of {ends.size} intervals has {options.fewest} satellites that agree to"
            f" {options.largest_sd:g} m/s"
        )
        raise DataError(f"{observations.header.path}: {message}; {OF_ANOTHER_FLIGHT}")
    ends, length = ends[good], length[good]
    displacement = antenna.position[ends] - antenna.position[ends - 1] + solution[good, :3]
    lat, lon, _ = ecef_to_geodetic(antenna.position[ends])
    C_en = rotation_en(lat, lon)
    cov_ned = (
        np.swapaxes(C_en, 1, 2) @ (factor * cov[good, :3, :3]) @ C_en / length[:, None, None] ** 2
    )
    cov_ned += (SATELLITE_TURN * antenna.sd[ends])[:, None, None] ** 2 * np.eye(3)
    return AntennaVelocity(
        time=antenna.time[ends] - 0.5 * length,
        interval_s=length,
        velocity_ned=np.einsum("nij,ni->nj", C_en, displacement) / length[:, None],
        cov_ned=0.5 * (cov_ned + np.swapaxes(cov_ned, 1, 2)),
        used=sums[good, 0].astype(np.int64),
        epoch=ends,
        clock_rate=solution[good, 3] / LIGHT / length,
        noise_m={
            name: float(value * np.sqrt(factor))
            for name, value in zip(pairs.groups, noise, strict=True)
        },
        gps_week=observations.gps_week,
        intervals=observations.time.size - 1,
        rejected=float(np.mean(weight == 0.0)),
    )


def _least_squares(
    pairs: Pairs, bounds: Index, length: Array, options: VelocityOptions
) -> tuple[Array, Array, Array, Array, Array]:
    """Return solutions (n, 4), covariances (n, 4, 4), sums (n, 3), weights (m,) and noise (g,), m.

    The noise of each group is the one that the three passes before the last have estimated.
    """
    from . import _velocity_kernels

    n, m = length.size, pairs.y.size
    solution = np.zeros((n, 4))
    cov = np.zeros((n, 4, 4))
    sums = np.zeros((n, 3))
    weight = np.ones(m)
    normalised = np.zeros(m)
    shape = np.sqrt(1.0 + pairs.sine**-2)
    common = pairs.air * np.repeat(length, np.diff(bounds)) / pairs.sine
    noise = np.full(len(pairs.groups), FIRST_NOISE_M)
    rejecting = False
    for limit in (np.inf, options.limit, options.limit, options.limit):
        if limit < np.inf:
            noise = noise * _noise_growth(
                normalised, weight > 0.0, pairs.group, noise.size, robust=not rejecting
            )
            rejecting = True
        sigma = np.hypot(noise[pairs.group] * shape, common)
        _velocity_kernels.solve(
            *(bounds, pairs.A, pairs.y, sigma, common, pairs.satellite, limit, options.fewest),
            *(solution, cov, weight, normalised, sums),
        )
    return solution, cov, sums, weight, noise


class StampedVelocity(NamedTuple):
    """Velocities at epochs: velocity_ned (n, 3) m/s, cov_ned (n, 3, 3) m^2/s^2; NaN if missing."""

    velocity_ned: Array
    cov_ned: Array


def _noise_growth(
    normalised: Array, weighted: NDArray[np.bool_], group: Index, groups: int, robust: bool
) -> Array:
    """Return the ratio (groups,) of estimated to assumed noise of normalised residuals (m,).

    That of a group is pooled with `POOLED_ROWS` rows of the ratio of all, so that small groups
    are near it.
    """

    def sigma(rows: NDArray[np.bool_]) -> float:
        if not rows.any():
            return 1.0
        if robust:
            return float(MAD_TO_SIGMA * np.median(np.abs(normalised[rows])))
        return float(np.sqrt(np.mean(normalised[rows] ** 2)))

    pooled = POOLED_ROWS * sigma(weighted) ** 2
    counts = np.bincount(group[weighted], minlength=groups)
    sigma_of_group = np.array([sigma(weighted & (group == k)) for k in range(groups)])
    return np.sqrt((counts * sigma_of_group**2 + pooled) / (counts + POOLED_ROWS))


def at_stamps(velocity: AntennaVelocity, time: ArrayLike) -> StampedVelocity:
    """Return velocities at epochs `time` (n,), s, GPST of the velocities' week, by (V.5) to (V.7).

    They are not-a-number where the interval before or behind an epoch is missing. Errors of an
    epoch and the next but one correlate by -1/2, those of neighbours hardly.
    """
    time = np.asarray(time, dtype=np.float64)
    ends = velocity.time + 0.5 * velocity.interval_s
    joined = np.flatnonzero(np.diff(velocity.epoch) == 1)
    out = np.full((time.size, 3), np.nan)
    cov = np.full((time.size, 3, 3), np.nan)
    if joined.size == 0:
        return StampedVelocity(out, cov)
    end_velocity, end_cov = _velocity_at_ends(velocity, joined)
    index = np.searchsorted(0.5 * (ends[joined][1:] + ends[joined][:-1]), time)
    same_epoch = np.abs(ends[joined][index] - time) <= SAME_TIME_S
    out[same_epoch] = end_velocity[index[same_epoch]]
    cov[same_epoch] = end_cov[index[same_epoch]]
    return StampedVelocity(out, cov)


def _velocity_at_ends(velocity: AntennaVelocity, joined: Index) -> tuple[Array, Array]:
    """Return velocities (k, 3), m/s, and covariances (k, 3, 3) by (V.5) to (V.7).

    They are at the ends of the intervals `joined` (k,), each of which is followed by the next one.
    """
    T = velocity.interval_s
    out = np.empty((joined.size, 3))
    cov = np.empty((joined.size, 3, 3))
    widest = max(round(JERK_S / float(np.median(T))), 2)
    remaining = np.ones(joined.size, dtype=np.bool_)
    for half in dict.fromkeys((widest, 2, 0)):
        group = np.flatnonzero(remaining & _has_even_intervals(velocity, joined, half))
        remaining[group] = False
        k = joined[group]
        weights = np.zeros((group.size, max(2 * half, 2)))
        middle = weights.shape[1] // 2
        weights[:, middle - 1] = T[k + 1] / (T[k] + T[k + 1])
        weights[:, middle] = T[k] / (T[k] + T[k + 1])
        bend = T[k] * T[k + 1] / 6.0
        rows = k[:, None] + np.arange(1 - middle, 1 + middle)
        bent_velocity = np.zeros((group.size, 3))
        if half:
            jerk_term = (bend / np.mean(T[rows], axis=1) ** 2)[:, None] * jerk_weights(half)
            bent_velocity = np.einsum("kj,kjd->kd", jerk_term, velocity.velocity_ned[rows])
            weights -= jerk_term
        out[group] = np.einsum("kj,kjd->kd", weights, velocity.velocity_ned[rows])
        jerk_error = bend * (UNKNOWN_JERK if half else UNSEEN_JERK)
        cov[group] = (
            _weighted_covariance(velocity, rows, weights)
            + MISSED_SHARE**2 * bent_velocity[:, :, None] * bent_velocity[:, None, :]
        )
        cov[group] += (jerk_error**2)[:, None, None] * np.eye(3)
    return out, cov


def _has_even_intervals(velocity: AntennaVelocity, joined: Index, half: int) -> NDArray[np.bool_]:
    """Return whether (k,) the `half` intervals on either side of each end are even, without gap."""
    if half == 0:
        return np.ones(joined.size, dtype=np.bool_)
    inside = (joined - half + 1 >= 0) & (joined + half < velocity.epoch.size)
    start = np.where(inside, joined - half + 1, 0)
    end = np.where(inside, joined + half, 0)
    without_gap = velocity.epoch[end] - velocity.epoch[start] == 2 * half - 1
    rows = start[:, None] + np.arange(2 * half) * inside[:, None]
    T = velocity.interval_s[rows]
    return np.asarray(inside & without_gap & (np.ptp(T, axis=1) <= UNEVEN * T.mean(axis=1)))


def jerk_weights(half: int) -> Array:
    """Return the weights (2 half,) by which mean velocities of intervals of length 1 give (V.6).

    The weighted sum is the third derivative of the position in the middle.
    """
    position = np.arange(-half, half + 1, dtype=np.float64)
    of_position = 6.0 * np.linalg.pinv(np.vander(position, 4, increasing=True))[3]
    return np.asarray(np.cumsum(of_position[::-1])[::-1][1:])


def _weighted_covariance(velocity: AntennaVelocity, rows: Index, weights: Array) -> Array:
    """Return the covariance (k, 3, 3), m^2/s^2, of weighted sums of velocities (V.7).

    `rows` (k, w) are their intervals, `weights` (k, w); neighbouring intervals share a phase.
    """
    T = velocity.interval_s[rows]
    share = np.pad(weights / T, ((0, 0), (1, 1)))
    phase = np.diff(share, axis=1) ** 2  # of the phase at each epoch
    phase[:, 1:-1] *= 0.5  # which two intervals see
    out = np.zeros((rows.shape[0], 3, 3))
    for j in range(rows.shape[1]):
        of_both = 0.5 * (phase[:, j] + phase[:, j + 1]) * T[:, j] ** 2
        out += of_both[:, None, None] * velocity.cov_ned[rows[:, j]]
    return out
