"""Time-differenced carrier phases (TDCP): pairs of phases of one satellite in two neighbouring
epochs, less all that ephemerides, positions and models say of them.

What is left is (V.2) of :mod:`insgnss.gnss.phase.velocity`: displacement, clock, noise, and the
ionosphere, which advances a phase of frequency f by I kappa, kappa = (f_1 / f)^2, with f_1 that of
GPS L1. Where a satellite has two bands or more, the change dI of a pair is the slope of its rows
over kappa, with the sign turned; its rate is averaged over `SMOOTHING_S` on either side, by which
its noise falls to 0.2 mm/s, and taken off every band (P.1). Otherwise it stays, and the standard
deviation says so.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...geodesy.frames import ecef_to_geodetic, geodetic_to_ecef
from ...geodesy.gpstime import WEEK_S
from ...records import Array, GnssFixes
from ...records.variances import MAD_TO_SIGMA
from ..rinex.navigation_message import Navigation
from ..rinex.observation_record import Observations
from ..satellites.frequencies import HERTZ, carriers
from ..satellites.orbits import (
    LIGHT,
    SatelliteStates,
    emission_states,
    ranges,
    sky,
    unique_satellites,
)
from .troposphere import standard_slant_delay

Index = NDArray[np.int64]

ACCELERATION = 3.0  # m/s^2, of a rover between given positions that stand apart
LOWEST_RAD = 0.05  # elevation (3 deg): lower, the mapping of the troposphere is taken as there
LOCK_LOST, HALF_CYCLE = 1, 2  # bits of the loss-of-lock indicator
SMOOTHING_S = 15.0  # to either side of an epoch: phase noise of mm becomes less than 0.1 mm/s
LEAST_SMOOTHED_S = 5.0  # of an arc within them: a mean over less is mostly noise (chosen)
# of kappa over the bands of a pair: below it they are one band, two of GPS have 0.2
LEAST_KAPPA_SPREAD = 1e-3
OUTLIER_SIGMAS = 5.0  # of robust ones: a rate beyond it is a cycle slip, no ionosphere
FREE_IONOSPHERE = 2e-3  # m/s in zenith, of an ionosphere that is not seen in two bands


@dataclass(frozen=True)
class VelocityOptions:
    """Limits of the time differences and of the least squares of `velocity`.

    Parameters
    ----------
    mask_deg : float
        Lowest elevation, deg.
    longest_s : float
        Longest interval, s.
    fewest : int
        Number of satellites.
    limit : float
        Of the normalised residual.
    rate : float
        m/s in zenith, of air and satellite clocks that the model leaves.
    largest_sd : float
        m/s, of the three components together.
    excess : float
        Chi-square over redundancy beyond which an interval is given up.
    reach_s : float
        Of epochs before the first or after the last position, s.
    position_sd : float
        m, largest of a position, with what it may be off between those given (3 m/s^2).
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
class AntennaPath:
    """The antenna at each epoch; NaN where unknown.

    Parameters
    ----------
    time : ndarray, shape (n,)
        True time, s.
    position : ndarray, shape (n, 3)
        m ECEF.
    sd : ndarray, shape (n,)
        Standard deviation of the position, m.
    clock : ndarray, shape (n,)
        Error of the receiver's clock, s.
    """

    time: Array
    position: Array
    sd: Array
    clock: Array


@dataclass(frozen=True, eq=False)
class Pairs:
    """Pairs of phases (m,), in the order of epochs and satellites.

    Parameters
    ----------
    epoch : ndarray of int, shape (m,)
        Index of the later epoch.
    satellite : ndarray of int, shape (m,)
        Number of the satellite.
    A, y : ndarray, shape (m, 4) and (m,)
        Of (V.2), y in m.
    sine : ndarray, shape (m,)
        Sine of the elevation.
    air : ndarray, shape (m,)
        Rate of the air left in y, m/s.
    group : ndarray of int, shape (m,)
        Group of noise, an index of `groups`.
    groups : tuple of str
        Names of the groups, by system and band ("G1").
    """

    epoch: Index
    satellite: Index
    A: Array
    y: Array
    sine: Array
    air: Array
    group: Index
    groups: tuple[str, ...]


def code_ranges(observations: Observations) -> Array:
    """Return a code range (m,), m, of each row's first signal that has one; NaN where none has."""
    columns = sorted((name[1], k) for k, name in enumerate(observations.signals) if name[0] == "C")
    code = np.full(observations.satellite.size, np.nan)
    for _, k in columns:
        code = np.where(np.isnan(code), observations.values[:, k], code)
    return code


def antenna_states(
    observations: Observations,
    navigation: Navigation,
    positions: GnssFixes,
    code: Array,
    options: VelocityOptions,
) -> tuple[AntennaPath, SatelliteStates]:
    """Return the antenna at each epoch, and the satellites of each row at emission."""
    stamp, epoch = observations.time, observations.epoch
    week = observations.gps_week if positions.gps_week is None else positions.gps_week
    position_time = positions.time + (week - observations.gps_week) * WEEK_S
    fixed = geodetic_to_ecef(positions.lat, positions.lon, positions.height)
    states = emission_states(navigation, observations.satellite, stamp[epoch], code)
    position = _interpolate(stamp, position_time, fixed)
    rho, _ = ranges(states.position, position[epoch])
    clock = medians((code - rho) / LIGHT + states.clock_s, epoch, stamp.size)
    time = stamp - clock
    position = _interpolate(time, position_time, fixed)
    following = np.clip(np.searchsorted(position_time, time), 1, max(position_time.size - 1, 1))
    since = np.maximum(time - position_time[following - 1], 0.0)
    until = np.maximum(position_time[np.minimum(following, position_time.size - 1)] - time, 0.0)
    bend = 0.5 * ACCELERATION * since * until
    variance = np.trace(positions.cov_ned, axis1=1, axis2=2)
    sd = np.sqrt(np.interp(time, position_time, variance)) + bend
    is_known = (
        (time >= position_time[0] - options.reach_s)
        & (time <= position_time[-1] + options.reach_s)
        & (sd <= options.position_sd)
    )
    return AntennaPath(time, np.where(is_known[:, None], position, np.nan), sd, clock), states


def _interpolate(time: Array, position_time: Array, values: Array) -> Array:
    """Interpolate values (k, 3) at `position_time` (k,), s, linearly to `time` (n,), s."""
    return np.column_stack([np.interp(time, position_time, values[:, axis]) for axis in range(3)])


def medians(values: Array, group: Index, n: int) -> Array:
    """Return the median (n,) of the finite values (m,) of each group; NaN where there is none."""
    finite = np.isfinite(values)
    values, group = values[finite], group[finite]
    values = values[np.lexsort((values, group))]
    count = np.bincount(group, minlength=n)
    start = np.concatenate([[0], np.cumsum(count)[:-1]])
    out = np.full(n, np.nan)
    filled = count > 0
    low = start[filled] + (count[filled] - 1) // 2
    high = start[filled] + count[filled] // 2
    out[filled] = 0.5 * (values[low] + values[high])
    return out


def neighbours(
    observations: Observations, antenna: AntennaPath, options: VelocityOptions
) -> tuple[Index, Index]:
    """Return the rows of one satellite in an epoch and the next, by epoch and satellite."""
    epoch = observations.epoch
    _, satellite = unique_satellites(observations.satellite)
    order = np.lexsort((epoch, satellite))
    earlier, later = order[:-1], order[1:]
    length = np.diff(observations.time, prepend=-np.inf)
    consecutive = (satellite[earlier] == satellite[later]) & (epoch[later] == epoch[earlier] + 1)
    consecutive &= length[epoch[later]] <= options.longest_s
    consecutive &= observations.flag[epoch[later]] == 0
    has_position = np.isfinite(antenna.position[:, 0])
    consecutive &= has_position[epoch[earlier]] & has_position[epoch[later]]
    pair = np.flatnonzero(consecutive)
    pair = pair[np.lexsort((satellite[later[pair]], epoch[later[pair]]))]
    return earlier[pair], later[pair]


@dataclass(frozen=True, eq=False)
class Modelled:
    """Modelled change of the range between two neighbouring epochs, of m pairs of rows.

    Parameters
    ----------
    first, second : ndarray of int, shape (m,)
        Rows of the satellite in the two epochs.
    change : ndarray, shape (m,)
        Of rho - c dt_s + T, m.
    sight : ndarray, shape (m, 3)
        Direction to the satellite, ECEF.
    elevation : ndarray, shape (m,)
        rad.
    """

    first: Index
    second: Index
    change: Array
    sight: Array
    elevation: Array


def modelled_pairs(
    observations: Observations,
    navigation: Navigation,
    antenna: AntennaPath,
    code: Array,
    states: SatelliteStates,
    first: Index,
    second: Index,
) -> Modelled:
    """Model the pairs of rows (m,) by the ephemerides and the positions.

    Both epochs of a pair take the message of the second one, so that no change of ephemeris counts
    as motion.
    """
    message = states.message[second]
    position, clock = states.position[first], states.clock_s[first]
    changed = np.flatnonzero(states.message[first] != message)
    rows = first[changed]
    recomputed = emission_states(
        navigation,
        observations.satellite[rows],
        observations.time[observations.epoch[rows]],
        code[rows],
        message[changed],
    )
    position[changed] = recomputed.position
    clock[changed] = recomputed.clock_s
    range_1, sight_1, _ = _modelled_range(antenna, observations.epoch[first], position, clock)
    range_2, sight_2, elevation = _modelled_range(
        antenna, observations.epoch[second], states.position[second], states.clock_s[second]
    )
    return Modelled(first, second, range_2 - range_1, 0.5 * (sight_1 + sight_2), elevation)


def _modelled_range(
    antenna: AntennaPath, epoch: Index, satellite: Array, clock: Array
) -> tuple[Array, Array, Array]:
    """Return rho - c dt_s + T (m,), m, directions to satellites (m, 3) and elevations (m,), rad."""
    receiver = antenna.position[epoch]
    rho, sight = ranges(satellite, receiver)
    _, elevation = sky(sight, receiver)
    lat, _, height = ecef_to_geodetic(antenna.position)
    delay = standard_slant_delay(lat[epoch], height[epoch], np.maximum(elevation, LOWEST_RAD))
    return rho - LIGHT * clock + delay, sight, elevation


def phase_pairs(
    observations: Observations, navigation: Navigation, modelled: Modelled, options: VelocityOptions
) -> Pairs:
    """Form the time differences of phases above the mask that no flag forbids.

    Of each satellite the first signal of each band that has one is taken.
    """
    earlier, later = modelled.first, modelled.second
    codes, satellite = unique_satellites(observations.satellite[later])
    bands = sorted({signal[1] for signal in observations.signals if signal[0] == "L"})
    channels = dict(observations.header.glonass_slots) | navigation.channels()
    hertz = carriers(codes, bands, channels)[satellite]
    phase = np.full((later.size, len(bands)), np.nan)
    unfilled = np.ones(phase.shape, dtype=np.bool_)
    for k, signal in enumerate(observations.signals):
        if signal[0] != "L":
            continue
        column = bands.index(signal[1])
        flags = observations.loss_of_lock[later, k]
        earlier_flags = observations.loss_of_lock[earlier, k]
        unbroken = ((flags & LOCK_LOST) == 0) & (((flags ^ earlier_flags) & HALF_CYCLE) == 0)
        difference = observations.values[later, k] - observations.values[earlier, k]
        usable = unfilled[:, column] & np.isfinite(difference)
        phase[usable & unbroken, column] = difference[usable & unbroken]
        unfilled[usable, column] = False
    high = np.isfinite(modelled.change) & (modelled.elevation >= np.radians(options.mask_deg))
    y = phase * LIGHT / hertz - np.where(high, modelled.change, np.nan)[:, None]
    time = observations.time[observations.epoch[later]]
    length = time - observations.time[observations.epoch[earlier]]
    kappa = (HERTZ["G"]["1"] / hertz) ** 2
    rate = _ionosphere_rate(y, kappa, satellite, time, length)
    y += kappa * (np.nan_to_num(rate) * length)[:, None]
    air = np.where(np.isnan(rate), FREE_IONOSPHERE, options.rate)
    rows, band = np.nonzero(np.isfinite(y))
    names = np.char.add(
        np.array([code[0] for code in codes])[satellite[rows]], np.array(bands)[band]
    )
    groups, group = np.unique(names, return_inverse=True)
    A = np.column_stack([-modelled.sight[rows], np.ones(rows.size)])
    epoch = observations.epoch[later[rows]]
    sine = np.sin(modelled.elevation[rows])
    return Pairs(
        *(epoch, satellite[rows], A, y[rows, band], sine, air[rows], group),
        tuple(str(name) for name in groups),
    )


def _ionosphere_rate(y: Array, kappa: Array, satellite: Index, time: Array, length: Array) -> Array:
    """Return the rate (m,), m/s, of the ionospheric delay on GPS L1 of each pair (P.1).

    y and kappa are (m, bands), time and length (m,) in s; it is NaN where a pair lacks two bands.
    """
    finite = np.isfinite(y)
    count = np.maximum(finite.sum(axis=1, keepdims=True), 1)
    y = np.where(finite, y, 0.0)
    kappa = np.where(finite, kappa, 0.0)
    centred = np.where(finite, kappa - kappa.sum(axis=1, keepdims=True) / count, 0.0)
    spread = (centred**2).sum(axis=1)
    has_two_bands = spread > LEAST_KAPPA_SPREAD
    change = -(centred * y).sum(axis=1) / np.where(has_two_bands, spread, 1.0)
    out = np.full(length.size, np.nan)
    for k in range(int(satellite.max(initial=-1)) + 1):
        rows = np.flatnonzero((satellite == k) & has_two_bands)
        if rows.size == 0:
            continue
        deviation = np.abs(change[rows] - np.median(change[rows]))
        rows = rows[deviation <= OUTLIER_SIGMAS * MAD_TO_SIGMA * np.median(deviation)]
        sums = np.concatenate(
            [np.zeros((1, 2)), np.cumsum(np.column_stack([change[rows], length[rows]]), axis=0)]
        )
        rows_of_satellite = np.flatnonzero(satellite == k)
        low = np.searchsorted(time[rows], time[rows_of_satellite] - SMOOTHING_S)
        high = np.searchsorted(time[rows], time[rows_of_satellite] + SMOOTHING_S, side="right")
        total = sums[high] - sums[low]
        smoothed = total[:, 0] / np.maximum(total[:, 1], LEAST_SMOOTHED_S)
        out[rows_of_satellite] = np.where(total[:, 1] >= LEAST_SMOOTHED_S, smoothed, np.nan)
    return out
