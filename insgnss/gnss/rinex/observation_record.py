"""Observations of a RINEX file as a record: values by epoch, satellite and signal, and the events
between the epochs.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError
from ...geodesy.gpstime import WEEK_S
from ...records import Array, Finding
from ...records.rows import rows_of
from .header import RinexHeader


@dataclass(frozen=True)
class EventRecord:
    """An event between the epochs.

    Parameters
    ----------
    flag : int
        2 to 5.
    time : float, optional
        s, GPST, None where it has none.
    line : int
        Line of the file, from 1.
    records : tuple of str
        The lines that belong to it.
    """

    flag: int
    time: float | None
    line: int
    records: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Observations:
    """Observations of n epochs, m satellites in them, k signals.

    Parameters
    ----------
    header : RinexHeader
        Header of the file.
    gps_week : int
        Of the first epoch within `LONGEST_WEEKS` of the middle one.
    time : ndarray, shape (n,)
        s, GPST of that week as stamped by the receiver; past the week's end it counts on.
    flag : ndarray of int, shape (n,)
        0, or 1 after a power failure.
    clock_offset_s : ndarray, shape (n,)
        s, of the receiver's clock as the file has it, else NaN.
    epoch : ndarray of int, shape (m,)
        Index of the row's epoch in `time`, not decreasing.
    satellite : ndarray of str, shape (m,)
        Such as "G05".
    signals : tuple of str
        RINEX 3 codes ("C1C", "L2W").
    values : ndarray, shape (m, k)
        m, cycles, Hz or dB-Hz, NaN where missing, scale factors taken out.
    loss_of_lock : ndarray of int, shape (m, k)
        0 to 7: 1 lock lost since the last epoch, 2 half-cycle ambiguity, 4 anti-spoofing.
    strength : ndarray of int, shape (m, k)
        Signal strength indicator (SSI), 0 to 9.
    events : ndarray, shape (e,)
        s, of the external events (flag 5), as they stand in the file.
    records : tuple of EventRecord
        All events.
    notes : tuple of Finding
        Of the reader.
    """

    header: RinexHeader
    gps_week: int
    time: Array
    flag: NDArray[np.int8]
    clock_offset_s: Array
    epoch: NDArray[np.int64]
    satellite: NDArray[np.str_]
    signals: tuple[str, ...]
    values: Array
    loss_of_lock: NDArray[np.int8]
    strength: NDArray[np.int8]
    events: Array
    records: tuple[EventRecord, ...] = ()
    notes: tuple[Finding, ...] = ()

    def of(self, signal: str) -> Array:
        """Return the values (m,) of a signal; raise InputError where the file does not have it."""
        return self.values[:, self.column(signal)]

    def only(self, taken: NDArray[np.intp]) -> "Observations":
        """Return the observations of the epochs `taken`, times from the week of the first."""
        taken = np.arange(self.time.size)[taken]  # of a mask, too
        week = self.gps_week + int(self.time[taken[0]] // WEEK_S)
        weeks_s = (week - self.gps_week) * WEEK_S
        position = np.full(self.time.size, -1)
        position[taken] = np.arange(taken.size)
        epoch = position[self.epoch]
        rows = np.argsort(epoch, kind="stable")[np.sum(epoch < 0) :]
        records = tuple(
            replace(record, time=None if record.time is None else record.time - weeks_s)
            for record in self.records
        )
        return replace(
            self,
            gps_week=week,
            time=self.time[taken] - weeks_s,
            epoch=epoch[rows],
            events=self.events - weeks_s,
            records=records,
            **rows_of(self, taken, ("flag", "clock_offset_s")),
            **rows_of(self, rows, ("satellite", "values", "loss_of_lock", "strength")),
        )

    def column(self, signal: str) -> int:
        """Return the index of a signal among the columns."""
        if signal not in self.signals:
            raise InputError.in_file(
                self.header.path, f"has no {signal}; there are {', '.join(self.signals)}"
            )
        return self.signals.index(signal)
