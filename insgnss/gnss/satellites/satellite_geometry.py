"""What rover and base observe in common: their epochs, and the satellites that carry the engine's
positions.

A fix belongs to the nearest epoch of the rover, a rover's epoch to the nearest one of the base.
"""

import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError
from ...geodesy.frames import geodetic_to_ecef
from ...geodesy.gpstime import WEEK_S
from ...records import Array, GnssFixes
from ..options import EngineOptions
from ..rinex.navigation_message import Navigation
from ..rinex.observation_record import Observations
from .engine_weighting import GLONASS_WEIGHT, carrying_systems
from .frequencies import engine_phases
from .orbits import ranges, satellite_states, sky, unique_satellites
from .visible_satellites import Sky

AS_USUAL = EngineOptions()
# s, between the stamp of an epoch and its position's, or the base's: clocks that receivers do not
# steer
LARGEST_OFFSET_S = 0.02


def common_sky(
    rover: Observations,
    base: Observations,
    navigation: Navigation,
    fixes: GnssFixes,
    options: EngineOptions = AS_USUAL,
) -> Sky:
    """Return the satellites that carry the engine's positions at each of `fixes`.

    They are of `carrying_systems`, with an ephemeris, above the mask, and rover and base both
    observe their phases.

    Raises
    ------
    InputError
        Where fixes and observations are of different times.
    """
    rover_epochs = epochs_of(fixes, rover)
    bands = common_bands(rover, base, options.frequencies).sum(axis=1)
    codes, which = unique_satellites(rover.satellite)
    carries = np.array([code[0] in carrying_systems(options) for code in codes], dtype=np.bool_)[
        which
    ]
    rows = np.flatnonzero(carries & (bands > 0))
    first_row = np.searchsorted(rover.epoch[rows], rover_epochs)
    count = np.searchsorted(rover.epoch[rows], rover_epochs, side="right") - first_row
    epoch = np.repeat(np.arange(rover_epochs.size), count)
    rows_taken = rows[
        np.arange(epoch.size) - np.repeat(np.cumsum(count) - count, count) + first_row[epoch]
    ]
    satellite = rover.satellite[rows_taken]
    states = satellite_states(
        navigation.of_week(rover.gps_week), satellite, rover.time[rover.epoch[rows_taken]]
    )
    antenna = geodetic_to_ecef(fixes.lat, fixes.lon, fixes.height)[epoch]
    azimuth, elevation = sky(ranges(states.position, antenna)[1], antenna)
    above_mask = elevation >= np.radians(options.elevation_mask_deg)
    codes, which = unique_satellites(satellite[above_mask])
    letters = sorted({code[0] for code in codes})
    system = np.array([letters.index(code[0]) for code in codes], dtype=np.int64)[which]
    weight = np.where(
        np.array([code[0] == "R" for code in codes], dtype=np.bool_), GLONASS_WEIGHT, 1.0
    )[which]
    return Sky(
        epoch[above_mask],
        azimuth[above_mask],
        elevation[above_mask],
        system,
        weight * bands[rows_taken][above_mask],
        rows_taken[above_mask],
    )


def epochs_of(fixes: GnssFixes, rover: Observations) -> NDArray[np.int64]:
    """Return the index (n,) of the rover's epoch nearest to each fix.

    Raises
    ------
    InputError
        Where there is none within `LARGEST_OFFSET_S`.
    """
    shift = (fixes.gps_week - rover.gps_week) * WEEK_S if fixes.gps_week is not None else 0.0
    index = _nearest(rover.time, fixes.time + shift)
    beyond = np.abs(rover.time[index] - fixes.time - shift) > LARGEST_OFFSET_S
    if beyond.any():
        first_time = fixes.time[int(np.argmax(beyond))]
        message = (
            f"{int(beyond.sum())} of {beyond.size} positions, the first at {first_time:.3f} s, are"
            " not at epochs of the rover"
        )
        raise InputError(
            f"{fixes.source or 'positions'}: {message} (limit {LARGEST_OFFSET_S:g} s); are they of"
            " this flight?"
        )
    return index


def _nearest(grid: Array, time: Array) -> NDArray[np.int64]:
    """Return the index (m,) in the increasing `grid` (n,) nearest to each of `time` (m,)."""
    return np.searchsorted(0.5 * (grid[1:] + grid[:-1]), time)


def base_rows(rover: Observations, base: Observations) -> NDArray[np.int64]:
    """Return the base's row (m,) of the same satellite, nearest in time to each row of the rover.

    It is -1 where there is none.
    """
    nearest_epoch = _nearest(base.time + (base.gps_week - rover.gps_week) * WEEK_S, rover.time)
    _, which = unique_satellites(np.concatenate([rover.satellite, base.satellite]))
    rover_key = which[: rover.satellite.size] * base.time.size + nearest_epoch[rover.epoch]
    base_key = which[rover.satellite.size :] * base.time.size + base.epoch
    order = np.argsort(base_key)
    row = order[np.minimum(np.searchsorted(base_key[order], rover_key), base_key.size - 1)]
    return np.where(base_key[row] == rover_key, row, -1)


def common_bands(rover: Observations, base: Observations, frequencies: int) -> NDArray[np.bool_]:
    """Return whether rover and base have a phase in the engine's frequencies (m, frequencies).

    The rows (m,) are the rover's.
    """
    row = base_rows(rover, base)
    return (
        engine_phases(rover, frequencies)
        & engine_phases(base, frequencies)[row]
        & (row >= 0)[:, None]
    )
