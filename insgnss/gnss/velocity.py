"""Velocity of the antenna from the carrier phase of one receiver, differenced in time.

From epoch a to the next one b, a phase without loss of lock changes by that of the range, the clocks and the air:

    lambda (phi_b - phi_a) = [rho - c dt_s + T]_b - [rho - c dt_s + T]_a + c (dt_b - dt_a) + noise                (V.1)

rho with the Earth's rotation during the flight of the signal, dt_s the satellite's clock with relativity, T the standard troposphere,
dt the receiver's clock. Satellites are taken at emission from one and the same message at both epochs, so that the step from one
message to the next does not enter. With positions p known to metres, r_b - r_a = p_b - p_a + d, u the direction to the satellite:

    y = lambda (phi_b - phi_a) - [rho(p) - c dt_s + T]_b + [rho(p) - c dt_s + T]_a = -u d + c (dt_b - dt_a)       (V.2)

is solved for d and the clock by weighted least squares over all satellites and bands, one clock for all systems (their offsets are
constant). The result is the mean velocity over the interval, (r_b - r_a) / (t_b - t_a), stamped in its middle. It is the velocity at the
stamp but for r''' (t_b - t_a)^2 / 24. t is the receiver's stamp less its clock error from the code ranges, which also takes out the
steps of a receiver clock that is steered by milliseconds.

Rejection. A phase is not used where the receiver flags loss of lock at b, where the half-cycle flag changes, or at an epoch after a
power failure. Then a robust start (least absolute residuals) drops what is 6 sigma off, and least squares drops, one by one, the row of
the largest normalised residual above `limit`; an interval is given up when fewer than `fewest` satellites are left, their geometry makes
the standard deviation too large, or the chi-square is still too large. A slip that all satellites share is a clock, and does no harm.

Covariance. Each pair of phases has its own noise and, with the satellite's other bands, a share of what changes in its air and clock:

    sigma^2 = s^2 (1 + 1 / sin^2 E) + common^2,   common = rate (t_b - t_a) / sin E                               (V.3)
    cov = N (sum_i w_i^2 (sigma_i^2 - common_i^2) a_i^T a_i + sum_satellites g^T g) N,   g = sum_i w_i common_i a_i,
    N = (sum_i w_i a_i^T a_i)^-1,   w = 1 / sigma^2                                                               (V.4)

s is the noise at zenith of one phase, estimated from the residuals of the whole recording for every system and band; at the end all is
scaled by the chi-square of the whole. The ionosphere is taken off by `phase_pairs`. What an error of p does (satellites turn by
1.6e-4 rad/s) is added. Errors of neighbouring intervals share a phase: they correlate by -1/2, so that sums of displacements do not
drift faster than the air. A filter that takes the intervals as independent is on the safe side over more than one. `at_stamps` gives
velocities at the epochs themselves: of the two displacements around each, by which the shared phase cancels.

van Graas and Soloviev (2004), Navigation 51(4); Serrano et al. (2004), ION GNSS; Baarda (1968) for the normalised residual.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import DataError
from ..geodesy.frames import ecef_to_geodetic, rotation_en
from ..records import GnssFixes
from .navigation_message import Navigation
from .orbits import LIGHT
from .phase_pairs import MAD_TO_SIGMA, Antenna, Pairs, antenna_states, code_ranges, modelled_pairs, neighbours, phase_pairs

if TYPE_CHECKING:
    from .rinex import Observations

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SATELLITE_TURN = 1.6e-4  # rad/s, at which the direction to a satellite turns at most
SAME_TIME_S = 1e-3
POOLED_ROWS = 300  # of all groups that are added to those of each, when its noise is estimated
BENT_NOISE = 5.0 / 144.0  # variance of r''' T^2 / 6 over that of a velocity, whose neighbours correlate by -1/2
SEEN = 3.0
FIRST_NOISE_M = 0.01  # of the phase at zenith, before it is known


@dataclass(frozen=True)
class VelocityOptions:
    """Limits of what is used.

    mask_deg : lowest elevation.   longest_s : longest interval.   fewest : satellites.   limit : of the normalised residual.
    rate : m/s in zenith, of air and satellite clocks that the model leaves.   largest_sd : m/s, of the three components together.
    excess : chi-square over redundancy beyond which an interval is given up.   reach_s : of epochs before the first or after the last
    position.   position_sd : m, largest of a position, with what it may be off between those given (3 m/s^2).
    """

    mask_deg: float = 10.0
    longest_s: float = 2.0
    fewest: int = 5
    limit: float = 4.0
    rate: float = 5e-4
    largest_sd: float = 0.5
    excess: float = 9.0
    reach_s: float = 1.0
    position_sd: float = 50.0


@dataclass(frozen=True, eq=False)
class AntennaVelocity:
    """Mean velocities of the antenna over intervals between neighbouring epochs of the receiver.

    time : (n,) s, GPST of `gps_week`, the middle of the interval.   interval_s : (n,) its length.   velocity_ned : (n, 3) m/s.
    cov_ned : (n, 3, 3) m^2/s^2.   used : (n,) satellites.   consistency : (n,) chi-square over redundancy.
    epoch : (n,) place of the interval's end among the epochs of the observations.   clock_rate : (n,) of the receiver's clock.
    noise_m : phase noise at zenith that was found, by system and band ("G1").   intervals : that were to be solved.
    rejected : share of the pairs of phases without flag that were rejected.
    """

    time: Array
    interval_s: Array
    velocity_ned: Array
    cov_ned: Array
    used: Index
    consistency: Array
    epoch: Index
    clock_rate: Array
    noise_m: dict[str, float]
    gps_week: int
    intervals: int
    rejected: float


def time_differenced_velocity(
    observations: "Observations", navigation: Navigation, positions: GnssFixes, options: VelocityOptions | None = None
) -> AntennaVelocity:
    """Mean velocities over the intervals between neighbouring epochs of the rover, where its phases and `positions` allow.

    positions : of the antenna, to some metres; between them it is interpolated.   Raises DataError where no interval can be solved.
    """
    options = options or VelocityOptions()
    navigation = navigation.of_week(observations.gps_week)
    code = code_ranges(observations)
    antenna, states = antenna_states(observations, navigation, positions, code, options)
    first, second = neighbours(observations, antenna, options)
    modelled = modelled_pairs(observations, navigation, antenna, code, states, first, second)
    pairs = phase_pairs(observations, navigation, modelled, options) if first.size else None
    if pairs is None or pairs.y.size == 0:
        what = "no phase is there in two neighbouring epochs with a position, an ephemeris and no loss of lock"
        raise DataError(f"{observations.header.path}: {what}; check that positions and navigation are of this flight")
    return _solve(observations, antenna, pairs, options)


def _solve(observations: "Observations", antenna: Antenna, pairs: Pairs, options: VelocityOptions) -> AntennaVelocity:
    """Least squares of all intervals, and their velocities."""
    ends, start = np.unique(pairs.epoch, return_index=True)
    length = antenna.time[ends] - antenna.time[ends - 1]
    solution, cov, sums, weight, noise = _least_squares(pairs, np.append(start, pairs.epoch.size), length, options)
    factor = sums[:, 1].sum() / max(sums[:, 2].sum(), 1.0)
    consistency = sums[:, 1] / np.maximum(factor * sums[:, 2], 1e-9)
    largest = np.sqrt(factor * np.trace(cov[:, :3, :3], axis1=1, axis2=2)) / length
    good = (sums[:, 0] >= options.fewest) & (consistency <= options.excess) & (largest <= options.largest_sd)
    if not good.any():
        what = f"none of {ends.size} intervals has {options.fewest} satellites that agree to {options.largest_sd:g} m/s"
        raise DataError(f"{observations.header.path}: {what}; check that positions and navigation are of this flight")
    ends, length = ends[good], length[good]
    displacement = antenna.position[ends] - antenna.position[ends - 1] + solution[good, :3]
    lat, lon, _ = ecef_to_geodetic(antenna.position[ends])
    C_en = rotation_en(lat, lon)
    cov_ned = np.swapaxes(C_en, 1, 2) @ (factor * cov[good, :3, :3]) @ C_en / length[:, None, None] ** 2
    cov_ned += (SATELLITE_TURN * antenna.sd[ends])[:, None, None] ** 2 * np.eye(3)
    return AntennaVelocity(
        time=antenna.time[ends] - 0.5 * length,
        interval_s=length,
        velocity_ned=np.einsum("nij,ni->nj", C_en, displacement) / length[:, None],
        cov_ned=0.5 * (cov_ned + np.swapaxes(cov_ned, 1, 2)),
        used=sums[good, 0].astype(np.int64),
        consistency=consistency[good],
        epoch=ends,
        clock_rate=solution[good, 3] / LIGHT / length,
        noise_m={name: float(value * np.sqrt(factor)) for name, value in zip(pairs.groups, noise, strict=True)},
        gps_week=observations.gps_week,
        intervals=observations.time.size - 1,
        rejected=float(np.mean(weight == 0.0)),
    )


def _least_squares(pairs: Pairs, bounds: Index, length: Array, options: VelocityOptions) -> tuple[Array, Array, Array, Array, Array]:
    """Solutions (n, 4), covariances (n, 4, 4), sums (n, 3), weights (m,), and noise of each group that three passes before have found."""
    from . import _velocity_kernels

    n, m = length.size, pairs.y.size
    solution, cov, sums = np.zeros((n, 4)), np.zeros((n, 4, 4)), np.zeros((n, 3))
    weight, normalised = np.ones(m), np.zeros(m)
    shape = np.sqrt(1.0 + pairs.sine**-2)
    common = pairs.air * np.repeat(length, np.diff(bounds)) / pairs.sine
    noise, rejecting = np.full(len(pairs.groups), FIRST_NOISE_M), False
    for limit in (np.inf, options.limit, options.limit, options.limit):
        if limit < np.inf:
            noise = noise * _growth(normalised, weight > 0.0, pairs.group, noise.size, robust=not rejecting)
            rejecting = True
        sigma = np.hypot(noise[pairs.group] * shape, common)
        _velocity_kernels.solve(
            bounds, pairs.A, pairs.y, sigma, common, pairs.satellite, limit, options.fewest, solution, cov, weight, normalised, sums
        )
    return solution, cov, sums, weight, noise


class StampedVelocity(NamedTuple):
    """Velocities at epochs: velocity_ned (n, 3) m/s, cov_ned (n, 3, 3) m^2/s^2; NaN where there is none."""

    velocity_ned: Array
    cov_ned: Array


def _growth(normalised: Array, used: NDArray[np.bool_], group: Index, groups: int, robust: bool) -> Array:
    """Factors (groups,) by which the noise is larger than it was taken; of a group with few rows near that of all."""

    def size(rows: NDArray[np.bool_]) -> float:
        if not rows.any():
            return 1.0
        return float(MAD_TO_SIGMA * np.median(np.abs(normalised[rows])) if robust else np.sqrt(np.mean(normalised[rows] ** 2)))

    every = size(used)
    counts = np.bincount(group[used], minlength=groups)
    own = np.array([size(used & (group == k)) for k in range(groups)])
    return np.sqrt((counts * own**2 + POOLED_ROWS * every**2) / (counts + POOLED_ROWS))


def at_stamps(velocity: AntennaVelocity, time: ArrayLike) -> StampedVelocity:
    """Velocities at epochs `time` (n,), s, GPST of the velocities' week.

    Of the two intervals around an epoch v = (d_1 + d_2) / (T_1 + T_2), whose noise is that of the two outer phases alone. Its covariance
    holds the square of r''' T_1 T_2 / 6, by which it is off, where the velocities around show it above their noise. Not-a-number where an
    interval is missing. Errors of an epoch and the next but one correlate by -1/2, those of neighbours do not.
    """
    time = np.asarray(time, dtype=np.float64)
    T, v = velocity.interval_s, velocity.velocity_ned
    ends = velocity.time + 0.5 * T
    joined = np.flatnonzero(np.diff(velocity.epoch) == 1)
    out, cov = np.full((time.size, 3), np.nan), np.full((time.size, 3, 3), np.nan)
    if joined.size == 0:
        return StampedVelocity(out, cov)
    T1, T2 = T[joined], T[joined + 1]
    both = (T1 + T2)[:, None]
    mean = (v[joined] * T1[:, None] + v[joined + 1] * T2[:, None]) / both
    outer = 0.5 * (velocity.cov_ned[joined] * T1[:, None, None] ** 2 + velocity.cov_ned[joined + 1] * T2[:, None, None] ** 2)
    acceleration = 2.0 * (v[joined + 1] - v[joined]) / both
    jerk = np.zeros_like(mean)
    inner = np.flatnonzero((np.diff(joined[:-1]) == 1) & (np.diff(joined[1:]) == 1)) + 1
    jerk[inner] = (acceleration[inner + 1] - acceleration[inner - 1]) / (ends[joined[inner + 1]] - ends[joined[inner - 1]])[:, None]
    bent = jerk * (T1 * T2)[:, None] / 6.0
    noise = BENT_NOISE * np.trace(velocity.cov_ned[joined], axis1=1, axis2=2)
    bent[(bent**2).sum(axis=1) < SEEN**2 * noise] = 0.0
    whole = outer / both[:, :, None] ** 2 + bent[:, :, None] * bent[:, None, :]
    at = np.searchsorted(0.5 * (ends[joined][1:] + ends[joined][:-1]), time)
    near = np.abs(ends[joined][at] - time) <= SAME_TIME_S
    out[near], cov[near] = mean[at[near]], whole[at[near]]
    return StampedVelocity(out, cov)
