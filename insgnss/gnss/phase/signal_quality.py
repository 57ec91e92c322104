"""Quality of the rover's observations: cycle slips, gaps, C/N0, multipath.

By band (L1 and the second band, with wavelengths l1 and l2 and a = (l2 / l1)^2 = (f1 / f2)^2):

    geometry-free    l1 L1 - l2 L2                                                             (Q.1)
    multipath        C1 - l1 L1 - 2 / (a - 1) (l1 L1 - l2 L2)                                  (Q.2)

A cycle slip is a flag of the receiver (bit 0 of the loss-of-lock indicator) in a satellite's
running arc, or a step of (Q.1) by more than `STEP_M`, and `STEP_NOISE` times the median step of the
satellite, from one epoch to the next. (Q.2) holds code multipath and noise, and a constant of each
arc, whose mean is taken away; it is computed where the frequencies are known, of GLONASS only where
the header gives its slots. Observations of all elevations count.

Estey and Meertens (1999), TEQC: the multi-purpose toolkit for GPS/GLONASS data, GPS Solutions 3(1),
for (Q.1) and (Q.2).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.errors import DataError
from ...navigation.prepare.gaps import LEAST_GAP_INTERVALS
from ...records import Array
from ..rinex.observation_record import Observations
from ..satellites.frequencies import carriers
from ..satellites.orbits import LIGHT, unique_satellites
from .time_differences import LOCK_LOST, medians

Index = NDArray[np.int64]

# first, and those that may be second
BANDS = {"G": ("1", "25"), "J": ("1", "25"), "E": ("1", "57"), "R": ("1", "2"), "C": ("21", "76")}
# step of (Q.1): a cycle of L1 less one of L2 is 54 mm; and times the usual step, above noise
STEP_M, STEP_NOISE = 0.05, 10.0


@dataclass(frozen=True, eq=False)
class Signals:
    """Quality of the rover's signals.

    Parameters
    ----------
    interval_s : float
        Of its epochs, s.
    gaps : ndarray, shape (g, 2)
        Begin and end, s.
    slip_time, slip_satellite : ndarray, shape (s,)
        Cycle slips.
    flagged : ndarray of bool, shape (s,)
        Which of them the receiver flagged.
    hours : float
        Of satellite tracking.
    cn0_time : ndarray, shape (k,)
        s, each second or epoch.
    cn0 : mapping of ndarray, shape (k,)
        Median C/N0 of the satellites at `cn0_time`, dB-Hz, by band.
    multipath_m : mapping of float
        Code multipath, rms of all arcs, m, by system and code.
    """

    interval_s: float
    gaps: Array
    slip_time: Array
    slip_satellite: NDArray[np.str_]
    flagged: NDArray[np.bool_]
    hours: float
    cn0_time: Array
    cn0: Mapping[str, Array]
    multipath_m: Mapping[str, float]


def signals_of(observations: Observations) -> Signals:
    """Measure cycle slips, gaps, C/N0 and multipath of all satellites.

    Raises
    ------
    DataError
        For fewer than two epochs.
    """
    o = observations
    if o.time.size < 2:
        raise DataError(
            f"{o.header.path}: {o.time.size} epoch of observations; at least 2 are needed, copy the"
            " file again"
        )
    step = np.diff(o.time)
    interval = float(np.median(step))
    wide = np.flatnonzero(step > LEAST_GAP_INTERVALS * interval)
    gaps = np.column_stack([o.time[wide], o.time[wide + 1]])
    satellite, tracks = np.unique(o.satellite, return_inverse=True)
    rows = np.lexsort((o.epoch, tracks))
    slips: list[Index] = []
    multipath: dict[str, float] = {}
    hours = 0.0
    systems = np.array([name[0] for name in satellite])
    for system in np.unique(systems):
        system_rows = rows[systems[tracks[rows]] == system]
        arcs = _Arcs.of(o, system_rows, tracks, str(system), interval)
        if arcs is None:
            continue
        slips.append(np.column_stack([system_rows[arcs.slip], arcs.flagged[arcs.slip]]))
        multipath |= arcs.multipath()
        hours += arcs.tracked * interval / 3600.0
    slip_table = np.concatenate(slips) if slips else np.zeros((0, 2), dtype=np.int64)
    slip_table = slip_table[np.argsort(o.epoch[slip_table[:, 0]], kind="stable")]
    slip_rows = slip_table[:, 0]
    when, cn0 = _median_cn0(o)
    return Signals(
        interval_s=interval,
        gaps=gaps,
        slip_time=o.time[o.epoch[slip_rows]],
        slip_satellite=o.satellite[slip_rows],
        flagged=slip_table[:, 1] > 0,
        hours=hours,
        cn0_time=when,
        cn0=cn0,
        multipath_m=multipath,
    )


@dataclass(frozen=True, eq=False)
class _Arcs:
    """Rows of one system by satellite and epoch: phase, code (n, 2) m of the two bands, their loss
    of lock (n,), wavelengths (n, 2) m.

    track : (n,) number of the satellite.
    begins : (n,) whether the row begins an arc.
    names : of the two code signals.
    tracked : number of rows with a phase on the first band.
    """

    names: tuple[str, ...]
    phase: Array
    code: Array
    flagged: NDArray[np.bool_]
    length: Array
    track: Index
    begins: NDArray[np.bool_]
    tracked: int

    @classmethod
    def of(
        cls, o: Observations, rows: Index, tracks: Index, system: str, interval: float
    ) -> "_Arcs | None":
        """Return the arcs of `system` in `rows` (n,), or None where it has no phase."""
        primary, secondary = (
            _column_with_most_values(o, rows, "L", bands) for bands in BANDS.get(system, ("1", "2"))
        )
        if primary is None:
            return None
        columns = [primary, primary if secondary is None else secondary]
        length = np.column_stack([_wavelength(o, rows, o.signals[k][1]) for k in columns])
        phase = length * o.values[rows][:, columns]
        if secondary is None:
            phase[:, 1] = np.nan
        codes = [_column_with_most_values(o, rows, "C", o.signals[k][1]) for k in columns]
        code = np.column_stack(
            [o.values[rows, k] if k is not None else np.full(rows.size, np.nan) for k in codes]
        )
        time = o.time[o.epoch[rows]]
        track = tracks[rows]
        observed = np.isfinite(o.values[rows, primary])
        begins = track != np.roll(track, 1)
        begins |= time - np.roll(time, 1) > LEAST_GAP_INTERVALS * interval
        begins |= ~np.roll(observed, 1)
        begins[0] = True
        flagged = ((o.loss_of_lock[rows][:, columns] & LOCK_LOST) > 0).any(axis=1) & observed
        names = tuple(f"{system} {o.signals[k]}" if k is not None else "" for k in codes)
        return cls(names, phase, code, flagged, length, track, begins, int(observed.sum()))

    @property
    def slip(self) -> NDArray[np.bool_]:
        """Return which rows (n,) have a slip within an arc: flagged, or a step of (Q.1)."""
        geometry_free = self.phase[:, 0] - self.phase[:, 1]
        step = np.where(self.begins, np.nan, np.abs(geometry_free - np.roll(geometry_free, 1)))
        usual_step = medians(step, self.track, int(self.track.max()) + 1)[self.track]
        return ~self.begins & (self.flagged | (step > np.maximum(STEP_M, STEP_NOISE * usual_step)))

    def multipath(self) -> dict[str, float]:
        """Return the rms (Q.2) of both bands, m, by system and code; arcs end at slips."""
        arc_number = np.cumsum(self.begins | self.slip)
        out = {}
        for k, name in enumerate(self.names):
            phase, second_phase = self.phase[:, k], self.phase[:, 1 - k]
            ratio = (self.length[:, 1 - k] / self.length[:, k]) ** 2
            with np.errstate(divide="ignore", invalid="ignore"):
                mp = self.code[:, k] - phase - 2.0 / (ratio - 1.0) * (phase - second_phase)
            finite = np.isfinite(mp)
            arc = arc_number[finite]
            if finite.sum() < 2:
                continue
            count = np.maximum(np.bincount(arc), 1)
            residual = mp[finite] - (np.bincount(arc, mp[finite]) / count)[arc]
            redundancy = max(residual.size - np.unique(arc).size, 1)
            out[name] = float(np.sqrt(np.sum(residual**2) / redundancy))
        return out


def _column_with_most_values(o: Observations, rows: Index, kind: str, bands: str) -> int | None:
    """Return the column of `kind` with the most values in `rows` (n,), None where there is none.

    It is of the first of `bands` that has any values.
    """
    for band in bands:
        columns = [k for k, name in enumerate(o.signals) if name.startswith(kind + band)]
        count = [int(np.isfinite(o.values[rows, k]).sum()) for k in columns]
        if any(count):
            return columns[int(np.argmax(count))]
    return None


def _wavelength(o: Observations, rows: Index, band: str) -> Array:
    """Return the wavelength (n,), m, of rows of one system; NaN where it is not known."""
    codes, satellite = unique_satellites(o.satellite[rows])
    return LIGHT / carriers(codes, [band], o.header.glonass_slots)[satellite, 0]


def _median_cn0(o: Observations) -> tuple[Array, dict[str, Array]]:
    """Return times (k,), s, and median C/N0 (k,), dB-Hz, by band, each second or epoch."""
    seconds, index = np.unique(np.floor(o.time[o.epoch]), return_inverse=True)
    out = {}
    for band in sorted({name[1] for name in o.signals if name.startswith("S")}):
        level = np.column_stack(
            [o.values[:, k] for k, name in enumerate(o.signals) if name.startswith("S" + band)]
        )
        best = np.fmax.reduce(level, axis=1)
        if np.isfinite(best).any():
            out[f"band {band}"] = medians(best, index, seconds.size)
    return seconds, out


def signal_numbers(signals: Signals) -> dict[str, Any]:
    """Return figures of merit of the observations as plain numbers."""
    gap = signals.gaps[:, 1] - signals.gaps[:, 0]
    return {
        "interval_s": signals.interval_s,
        "gaps": int(gap.size),
        "longest_gap_s": float(gap.max(initial=0.0)),
        "cycle_slips": {
            "flagged": int(signals.flagged.sum()),
            "unflagged": int((~signals.flagged).sum()),
        },
        "cycle_slips_per_satellite_hour": (
            signals.slip_time.size / signals.hours if signals.hours > 0.0 else None
        ),
        "cn0_dbhz": {band: median(level) for band, level in signals.cn0.items()},
        "multipath_m": dict(signals.multipath_m),
    }


def median(x: Array) -> float | None:
    """Return the median of the finite values, None where there is none."""
    x = x[np.isfinite(x)]
    return float(np.median(x)) if x.size else None
