"""Bands: which of them the engine takes, and their carriers.

A band is the digit of RINEX 3's signal names. RTKLIB EX 2.5.0 gives each signal of a system a
place, its first, second, third frequency and so on (`code2idx`); `pos1-frequency` takes as many of
them, three at most. What has a later place is left out: E6 and E5 of Galileo, L6 of QZSS, B3 and
B1C of BeiDou. A satellite without a phase in a place has one band less, whatever others it has.
RTKLIB 2.4.3 has the same table, but for B1C, which it puts in the first place beside B1I; of 2.5.0
the table is tested.

GLONASS has two bands in a place, by frequency and by code division; it takes the carrier of the
former, of which the channels differ by 0.3 % at most.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ...records import Array
from ..rinex.observation_record import Observations
from .orbits import unique_satellites

ENGINE_BANDS = {
    "G": ("1", "2", "5"),
    "R": ("14", "26", "3"),
    "E": ("1", "7", "5"),
    "J": ("1", "2", "5"),
    "C": ("2", "7", "5"),
}
HERTZ = {  # carriers by system and band
    "G": {"1": 1575.42e6, "2": 1227.60e6, "5": 1176.45e6},
    "J": {"1": 1575.42e6, "2": 1227.60e6, "5": 1176.45e6, "6": 1278.75e6},
    "E": {"1": 1575.42e6, "5": 1176.45e6, "6": 1278.75e6, "7": 1207.14e6, "8": 1191.795e6},
    "C": {
        "1": 1575.42e6,
        "2": 1561.098e6,
        "5": 1176.45e6,
        "6": 1268.52e6,
        "7": 1207.14e6,
        "8": 1191.795e6,
    },
    "R": {"1": 1602.0e6, "2": 1246.0e6, "3": 1202.025e6, "4": 1600.995e6, "6": 1248.06e6},
}
CHANNEL_HERTZ = {"1": 0.5625e6, "2": 0.4375e6}  # GLONASS, per frequency number


def kappa(system: str, band: str) -> float:
    """Return the ionospheric delay on a carrier over that on L1 of GPS: (f_1 / f)^2."""
    return (HERTZ["G"]["1"] / HERTZ[system][band]) ** 2


def engine_phases(observations: Observations, frequencies: int) -> NDArray[np.bool_]:
    """Return whether each row has a phase in the engine's frequencies (m, frequencies)."""
    out = np.zeros((observations.satellite.size, frequencies), dtype=np.bool_)
    observed = np.isfinite(observations.values) & (observations.values != 0.0)
    for letter, rows in rows_of_systems(observations.satellite).items():
        for k, bands in enumerate(ENGINE_BANDS.get(letter, ())[:frequencies]):
            columns = [
                j
                for j, signal in enumerate(observations.signals)
                if signal[0] == "L" and signal[1] in bands
            ]
            out[rows, k] = observed[rows][:, columns].any(axis=1)
    return out


def rows_of_systems(satellite: NDArray[np.str_]) -> dict[str, NDArray[np.int64]]:
    """Return the rows of each system, by its letter, of satellites (m,)."""
    codes, which = unique_satellites(satellite)
    system = np.array([code[0] for code in codes], dtype="U1")[which]
    return {letter: np.flatnonzero(system == letter) for letter in np.unique(system).tolist()}


def carriers(codes: list[str], bands: list[str], channels: Mapping[str, int]) -> Array:
    """Return carrier frequencies (codes, bands), Hz; NaN where a satellite has none, or its GLONASS
    channel is unknown.
    """
    out = np.full((len(codes), len(bands)), np.nan)
    for i, code in enumerate(codes):
        for k, band in enumerate(bands):
            out[i, k] = HERTZ.get(code[0], {}).get(band, np.nan)
            if code[0] == "R" and band in CHANNEL_HERTZ:
                out[i, k] += CHANNEL_HERTZ[band] * channels.get(code, np.nan)
    return out
