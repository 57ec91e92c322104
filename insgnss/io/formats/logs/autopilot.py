"""Logs of autopilots: tables by message, one clock tied to GPST, and the records made of them.

ArduPilot and PX4 differ in the names of messages and columns, their units, and in which rows hold a
fix; what is done with the columns is the same. All stamps but those of fixes count from the start
of the autopilot and are taken to GPST by `boot_clock`.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....base.errors import InputError
from ....base.wording import spell
from ....records import Array, BarometerHeights, CameraEvents, Finding, ImuSamples
from ..barometer import BAROMETER_ROWS, heights_from_columns
from ..events.events import events_in_order
from ..imu.imu_csv import ACCEL, GYRO, Scales, imu_from_columns
from ..read_options import ReadOptions
from ..text.clock import agree_on_week, stale_weeks, weeks_in_step
from ..text.order import NumberedRows, note, refuse_rows
from ..text.text import Source
from .boot_clock import BootClock, fit_clock

Tables = dict[str, dict[str, Array]]

# GPS.Status and fix_type to RTKLIB's codes: 2D, 3D, DGPS, RTK float, RTK fixed
QUALITY_OF_FIX = {2: 5, 3: 5, 4: 4, 5: 2, 6: 1}
NO_FIX = "give the GNSS positions in a separate file, gnss.file"


class AbsentError(InputError):
    """A log lacks a message, or all of its fixes."""


def as_float(column: NDArray[Any]) -> Array:
    """Return a column as float64; what is not a number in it stays so, without a warning."""
    with np.errstate(invalid="ignore"):
        return column.astype(np.float64)


@dataclass(frozen=True)
class LogMessage:
    """A table of a log: its name, its columns, and where its rows stand."""

    name: str
    columns: Mapping[str, Array]
    lines: NumberedRows

    def __contains__(self, label: str) -> bool:
        return label in self.columns

    def floats(self, *labels: str) -> list[Array]:
        """Return columns; InputError where one is missing or has a value that is not finite."""
        if missing := [label for label in labels if label not in self.columns]:
            has = f"it has {' '.join(self.columns)}"
            raise InputError(f"{self.lines.path}: {self.name} has no {' '.join(missing)}; {has}")
        values = {label: self.columns[label] for label in labels}
        self.refuse_infinite(values)
        return list(values.values())

    def refuse_infinite(self, columns: Mapping[str, Array]) -> None:
        """Refuse the first value that is not finite in columns (n,)."""
        advice = f"set {spell('variable')} to another message, or export the other rows as a table"
        for label, column in columns.items():
            message = f"{label} is {{}}; it must be finite: {advice}"
            refuse_rows(self.lines, ~np.isfinite(column), message, column)

    def of(self, rows: NDArray[np.bool_]) -> "LogMessage":
        """Return the message of some rows, numbered anew."""
        kept = {label: column[rows] for label, column in self.columns.items()}
        return LogMessage(self.name, kept, self.lines)

    def qualities(self, label: str) -> Array:
        """Return RTKLIB's codes of a column of the autopilot's."""
        codes = [QUALITY_OF_FIX.get(int(code), 0) for code in self.columns[label]]
        return np.array(codes, dtype=np.float64)


@dataclass(frozen=True)
class Fixes:
    """Rows of a receiver's message with a fix: the autopilot's stamps, s, week and time of week."""

    message: LogMessage
    boot: Array
    week: Array
    tow: Array
    named_week: Array  # as the message has it, where it lags behind the times of week

    @classmethod
    def of(cls, message: LogMessage, fixed: NDArray[np.bool_], *times: Array) -> "Fixes":
        """Take the rows that are `fixed` of a message and of `boot`, `week` and `tow`.

        Raises
        ------
        AbsentError
            No row has a fix.
        """
        if not fixed.any():
            path, count = message.lines.path, f"{fixed.size} {message.name} messages"
            raise AbsentError(f"{path}: none of its {count} has both a fix and a time; {NO_FIX}")
        boot, week, tow = (time[fixed] for time in times)
        return cls(message.of(fixed), boot, weeks_in_step(week, tow), tow, week)

    def left_out(self, rows: int) -> tuple[Finding, ...]:
        """Return the notes on the messages without a fix, of so many, and on stale weeks."""
        n_without, wrong = rows - self.boot.size, int((self.week != self.named_week).sum())
        text = f"{n_without} messages without a fix left out"
        notes = (note("GNSS rows", text, "a fix each", ""),) if n_without else ()
        return (*notes, stale_weeks("GNSS rows", wrong, self.week.size)) if wrong else notes


@dataclass(frozen=True)
class Log:
    """Tables of a log by message, their columns as float64, and findings on the file itself.

    `kind` is what the program calls a message.
    """

    path: str
    tables: Tables
    findings: tuple[str, ...] = ()
    kind: str = "message"

    def notes(self, name: str) -> tuple[Finding, ...]:
        """Return the notes on the findings in the log, for the record `name`."""
        advice = "copy it again from the card"
        return tuple(note(name, text, "a whole log", advice) for text in self.findings)

    def message(self, names: tuple[str, ...], variable: str | None = None) -> LogMessage:
        """Return the message `variable`, else the first of `names` there is.

        Raises
        ------
        AbsentError
            No such message.
        """
        chosen = variable or next((name for name in names if name in self.tables), None)
        if chosen is None or chosen not in self.tables:
            present = ", ".join(sorted(self.tables)) or "none"
            wanted = chosen or " or ".join(names)
            raise AbsentError(f"{self.path}: no {self.kind} {wanted}; there are {present}")
        return LogMessage(chosen, self.tables[chosen], NumberedRows(self.path, chosen))

    def columns_of(self, fixes: Fixes, quality: str) -> tuple[dict[str, Any], tuple[Finding, ...]]:
        """Return the columns of time and quality of fixes, and the notes on what is left out.

        `quality` is the autopilot's column of it.
        """
        message = fixes.message
        cols = {"tow": fixes.tow, "week": fixes.week, "q": message.qualities(quality)}
        rows = self.tables[message.name][quality].size
        return cols, (*self.notes("GNSS rows"), *fixes.left_out(rows))


@dataclass(frozen=True)
class Autopilot:
    """What all readers of a program's logs share: its log, its receiver's fixes, its stamps.

    `fixes_of` takes the rows of a receiver's message, by the caller's `variable`, where there is a
    fix; `boot_of` the stamps of a message, s since the autopilot's start.
    """

    read: Callable[[Source], Log]
    fixes_of: Callable[[Log, str | None], Fixes]
    boot_of: Callable[[LogMessage], Array]

    def opened(
        self, path: Source, names: tuple[str, ...], options: ReadOptions
    ) -> tuple[Log, LogMessage]:
        """Return a log and its message `options.variable`, else the first of `names` there is."""
        log = self.read(path)
        return log, log.message(names, options.variable)

    def clock(self, log: Log, gps_week: int | None) -> BootClock:
        """Return the autopilot's clock by its receiver's fixes; InputError for another week.

        Without any fix the stamps stay those since power-up.
        """
        try:
            fixes = self.fixes_of(log, None)
        except AbsentError:
            return BootClock(gps_week)
        clock = fit_clock(log.path, fixes.boot, fixes.week, fixes.tow)
        assert clock.gps_week is not None  # that of the fixes
        agree_on_week(fixes.message.lines, clock.gps_week, gps_week)
        return clock

    def on_gpst(
        self, log: Log, message: LogMessage, gps_week: int | None, rows: str
    ) -> tuple[Array, int | None, tuple[Finding, ...]]:
        """Return the stamps of a message, s, on GPST, their week, and the notes on both."""
        boot, clock = self.boot_of(message), self.clock(log, gps_week)
        time = clock.gpst(message.lines, boot)
        return time, clock.gps_week, (clock.note(rows), *log.notes(rows))

    def samples(
        self,
        log: Log,
        message: LogMessage,
        triads: list[Array],
        options: ReadOptions,
        notes: tuple[Finding, ...] = (),
    ) -> ImuSamples:
        """Return samples of six columns in SI, at the stamps of a message."""
        cols = dict(zip((*GYRO, *ACCEL), triads, strict=True))
        message.refuse_infinite(cols)
        of_rows = self.on_gpst(log, message, options.gps_week, "IMU rows")
        cols["tow"], week, (of_clock, *of_log) = of_rows
        notes, options = (of_clock, *notes, *of_log), replace(options, gps_week=week)
        return imu_from_columns(cols, message.lines, Scales(1.0, 1.0), options, notes)

    def events(
        self, path: Source, options: ReadOptions, names: tuple[str, ...], images: str
    ) -> CameraEvents:
        """Read the events of a message of `names`, named by a column of whole numbers."""
        log, message = self.opened(path, names, options)
        numbers = None
        if images in message:
            (column,) = message.floats(images)
            whole = np.where(column == np.floor(column), column, np.nan)
            message.refuse_infinite({images: whole})
            numbers = tuple(str(int(k)) for k in whole)
        time, week, notes = self.on_gpst(log, message, options.gps_week, "event rows")
        return events_in_order(numbers, time, message.lines, week, notes)

    def heights(
        self, path: Source, options: ReadOptions, names: tuple[str, ...], labels: Mapping[str, str]
    ) -> BarometerHeights:
        """Read the heights of a message of `names`, by the labels of `pressure` and `h`."""
        log, message = self.opened(path, names, options)
        cols = {name: message.columns[x] for name, x in labels.items() if x in message}
        message.refuse_infinite(cols)
        time, week, notes = self.on_gpst(log, message, options.gps_week, BAROMETER_ROWS)
        return heights_from_columns(cols, time, message.lines, week, notes)
