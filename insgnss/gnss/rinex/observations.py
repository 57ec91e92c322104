"""Observations at rate from RINEX 2 to 4: values, loss of lock, events, everything that stands
between the epochs.

A file is epochs in order of time. Between them stand event records: 2 the antenna starts to move, 3
a new site, 4 header records follow, 5 an external event at its own stamp, each with as many records
as it announces; and 6, cycle slips that the receiver found and repaired, written like an epoch.
Header records behind an event hold from there on: observation types and scale factors change how
the following epochs are read; all others are kept and reported in a note.

Missing values are not-a-number; RINEX writes them blank or 0.0, whichever the kind. Stamps are
those of the receiver, in GPST: GPS, Galileo, QZSS and NavIC time as they stand, BeiDou time + 14 s,
GLONASS time (UTC) + leap seconds.

Epoch lines of RINEX 3 whose numbers do not stand in their columns, as the converter aboard drones
in wide use writes them (one blank, no leading zeros, blanks before the ">"), are read number by
number and counted.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError
from ...geodesy.gpstime import GPS_EPOCH_UNIX_S, WEEK_S, leap_seconds
from ...io.formats.text.layout import decode, quote
from ...io.formats.text.order import AtLines, Picked, Rows, note, put_in_order
from ...io.formats.text.text import Source
from ...records import Array, Finding
from .header import (
    LABEL_COLUMN,
    LETTERS_ALONE,
    SYSTEM_LETTERS,
    SYSTEM_NAMES,
    Record,
    RinexHeader,
    codes_of,
    header_of,
    line_at,
    load_rinex,
    scale_of,
    types_of,
)
from .observation_record import EventRecord, Observations
from .systems import BEIDOU_LAG_S

TICKS_PER_WEEK = 6_048_000_000_000  # 604 800 s of `_kernels.TICKS_PER_S`
# weeks that a recording may last: 52, since stamps of a receiver that does not know the date are
# years away, and seconds of a week years away are doubles too coarse for the others
LONGEST_WEEKS = 52
SLIPS = 6  # epoch flag of records of cycle slips, which are no observations
# epochs of a file in which a clock that was set back is told from epochs out of order, and the
# intervals of a pause that missing ones leave
FEWEST_AROUND, PAUSE = 20, 1.5
SAMPLE = 1 << 18  # bytes by which the number of lines is guessed
MEANINGS = {
    2: "the antenna starts to move",
    3: "a new site is occupied",
    4: "header records follow",
    5: "external event",
}
COPY_AGAIN = "copy the file again, or convert it again from the receiver's own format"
END_OF_FILE = "END OF RINEX"  # begins the last line of some converters' files
# an epoch line of RINEX 3 number by number: date, second, flag, count, clock offset
EPOCH_3 = re.compile(
    rb"^[ \t]*> *(\d{4})" + 4 * rb" +(\d\d?)" + rb" +(\d*\.\d+) +(\d) +(\d{1,3})"
    rb"(?: +(-?\d*\.\d+))?[ \d]*\r?$",
    re.MULTILINE,
)
IN_COLUMNS = re.compile(rb"> \d{4}(?: [ \d]\d){4} [ \d]\d\.\d{7}  \d[ \d]{3}(?:$| )")


def read_observations(path: Source) -> Observations:
    """Read a RINEX 2, 3 or 4 observation file, plain or packed (gzip, compress, Hatanaka).

    Raises
    ------
    InputError
        With file and line: another format or version, navigation data, a header or an epoch that is
        not whole, a number, satellite or stamp that is none, a satellite twice in an epoch, time
        that does not increase.
    """
    buf, complete, complaints = load_rinex(path)
    header, offset = header_of(path, buf)
    reading = _Reading(path, header, buf, complete, offset)
    reading.read()
    observations = reading.observations()
    notes = tuple(
        note("unpacking", complaint, "no complaint", "compare the file with its source")
        for complaint in complaints
    )
    return replace(observations, notes=notes + observations.notes)


class _Reading(AtLines):
    """The arrays that a file is read into, and how its lines stand where the reading is."""

    def __init__(
        self, path: Source, header: RinexHeader, buf: NDArray[np.uint8], complete: bool, offset: int
    ) -> None:
        from . import _kernels

        self.kernels = _kernels
        self.path, self.header, self.buf, self.complete = str(path), header, buf, complete
        self.signals: list[str] = []
        self.types = dict(header.types)
        self.scales = dict(header.scale)
        self.widths = np.full(len(SYSTEM_LETTERS), -1, dtype=np.int64)
        self.columns = np.zeros((len(SYSTEM_LETTERS), 1), dtype=np.int64)
        self.scale = np.ones((len(SYSTEM_LETTERS), 1))
        self.state = np.zeros(_kernels.STATE_SIZE, dtype=np.int64)
        self.state[_kernels.OFFSET], self.state[_kernels.LINE] = offset, header.lines + 1
        self.sats = np.empty(1000, dtype=np.int64)
        self.seen = np.full(100 * len(SYSTEM_LETTERS), -1, dtype=np.int64)
        # flag, ticks, line, records
        self.event_records: list[tuple[int, int, int, tuple[str, ...]]] = []
        self.notes: list[Finding] = []
        if header.version >= 3:
            for system in self.types:
                self.learn(system)
        sample = buf[offset : offset + SAMPLE]
        lines = (
            1.05 * np.count_nonzero(sample == ord("\n")) * (buf.size - offset) / max(sample.size, 1)
        )
        a_satellite = max(-(-len(self.types[""]) // 5), 1) if header.version < 3 else 1
        self.allocate(int(lines / a_satellite / 4) + 16, int(lines / a_satellite) + 16)

    def allocate(self, epochs: int, rows: int) -> None:
        """Make room, keeping what there is."""
        n, m = (int(self.state[k]) for k in (self.kernels.EPOCHS, self.kernels.ROWS))
        filled = self.__dict__.copy()
        shape = (rows, len(self.signals))
        self.ticks = np.empty(epochs, dtype=np.int64)
        self.lines = np.empty(epochs, dtype=np.int64)
        self.flags = np.empty(epochs, dtype=np.int8)
        self.clock = np.empty(epochs)
        self.epoch = np.empty(rows, dtype=np.int64)
        self.satellite = np.empty(rows, dtype=np.int16)
        self.values = np.empty(shape)
        self.lock = np.empty(shape, dtype=np.int8)
        self.strength = np.empty(shape, dtype=np.int8)
        if n == 0:
            return
        for name in ("ticks", "lines", "flags", "clock"):
            getattr(self, name)[:n] = filled[name][:n]
        for name in ("epoch", "satellite"):
            getattr(self, name)[:m] = filled[name][:m]
        for name, missing in {"values": np.nan, "lock": 0, "strength": 0}.items():
            width = filled[name].shape[1]
            getattr(self, name)[:m, :width] = filled[name][:m]
            getattr(self, name)[:m, width:] = missing

    def learn(self, system: str) -> None:
        """Take the present types of a system into the columns."""
        types = self.types[system if self.header.version >= 3 else ""]
        codes = codes_of(self.header.version, system, types)
        self.signals += [code for code in codes if code not in self.signals]
        row, width = SYSTEM_LETTERS.index(system), max(self.columns.shape[1], len(types))
        for name, widened in (
            ("columns", np.zeros((len(SYSTEM_LETTERS), width), dtype=np.int64)),
            ("scale", np.ones((len(SYSTEM_LETTERS), width))),
        ):
            present = getattr(self, name)
            widened[:, : present.shape[1]] = present
            setattr(self, name, widened)
        self.widths[row] = len(types)
        self.columns[row, : len(types)] = [self.signals.index(code) for code in codes]
        self.scale[row, : len(types)] = [self.scales.get((system, name), 1.0) for name in types]

    def read(self) -> None:
        """Parse to the end, event by event."""
        k = self.kernels
        three = self.header.version >= 3
        blank = SYSTEM_LETTERS.find(
            self.header.system if self.header.system in SYSTEM_LETTERS else "G"
        )
        while True:
            status = k.parse(
                self.buf,
                three,
                blank,
                self.widths,
                self.columns,
                self.scale,
                self.state,
                self.sats,
                self.seen,
                self.ticks,
                self.flags,
                self.clock,
                self.lines,
                self.epoch,
                self.satellite,
                self.values,
                self.lock,
                self.strength,
            )
            if status == k.DONE:
                break
            if status == k.EVENT:
                self.take_event()
            elif status == k.FULL:
                self.allocate(2 * self.ticks.size + 1000, 2 * self.satellite.size + 1000)
            elif status == k.NEW_SYSTEM and not three:
                self.learn(SYSTEM_LETTERS[int(self.state[k.SYSTEM])])
                self.seen[:] = -1
                self.allocate(self.ticks.size, self.satellite.size)
            elif not (status == k.BAD_EPOCH and (self.skip_comment() or self.bring_in_columns())):
                line = int(self.state[k.MARK_LINE])
                raise InputError.at_line(self.path, line, self.fault(int(status)))
        self.refuse_cut_line()

    def take_event(self) -> None:
        """Read the records of the event before the state's place, and apply what they change."""
        k, state = self.kernels, self.state
        flag, line, offset = int(state[k.FLAG]), int(state[k.MARK_LINE]), int(state[k.OFFSET])
        lines: list[str] = []
        for number in range(line + 1, line + 1 + int(state[k.COUNT])):
            if offset >= self.buf.size:
                problem = f"{len(lines)} of {state[k.COUNT]} records of this event; copy it again"
                raise InputError.at_line(self.path, line, f"truncated: {problem}")
            text, offset = line_at(self.buf, offset)
            if text.startswith(">") or (flag < 5 and not text[LABEL_COLUMN:].strip()):
                message = (
                    f"{quote(text)} where record {len(lines) + 1} of {state[k.COUNT]} of the event"
                    f" in line {line} must stand"
                )
                raise InputError.at_line(
                    self.path, number, f"{message}; correct the event's number of records"
                )
            lines.append(text.rstrip())
        if flag == 5 and state[k.TICKS] < 0:
            problem = "an external event without a stamp; delete it or give it one"
            raise InputError.at_line(self.path, line, problem)
        state[k.OFFSET], state[k.LINE] = offset, line + 1 + len(lines)
        self.event_records.append((flag, int(state[k.TICKS]), line, tuple(lines)))
        records = [
            (line + 1 + i, text[LABEL_COLUMN:].strip(), text[:LABEL_COLUMN])
            for i, text in enumerate(lines)
        ]
        self.change(line, flag, [record for record in records if record[1] != "COMMENT"])

    def change(self, line: int, flag: int, records: Sequence[Record]) -> None:
        """Let header records behind an event hold from here on."""
        types = types_of(self.path, self.header.version, records)
        if types or any(label == "SYS / SCALE FACTOR" for _, label, _ in records):
            self.types |= types
            self.scales |= scale_of(self.path, records, self.types)
            systems = [
                s for s in SYSTEM_LETTERS if self.widths[SYSTEM_LETTERS.index(s)] >= 0 or s in types
            ]
            for system in systems:
                self.learn(system)
            self.allocate(self.ticks.size, self.satellite.size)
        if flag < 5 and (flag != 4 or records):
            labels = ", ".join(dict.fromkeys(label for _, label, _ in records))
            finding = f"line {line}: {MEANINGS[flag]}" + (f" ({labels})" if labels else "")
            advice = "see whether the antenna or its height changed there"
            self.notes.append(note("event records", finding, "one site and one header", advice))

    def bring_in_columns(self) -> bool:
        """Bring the numbers of all further epoch lines into their columns; whether one moved."""
        offset, moved = int(self.state[self.kernels.OFFSET]), 0

        def line(match: re.Match[bytes]) -> bytes:
            nonlocal moved
            if IN_COLUMNS.match(match[0]):
                return match[0]
            moved += 1
            year, *date, second, flag, count, clock = (text.decode() for text in match.groups(b""))
            stamp = f"> {year} {' '.join(f'{int(n):02d}' for n in date)}{float(second):11.7f}"
            return f"{stamp}  {flag}{count:>3}{clock and f'{clock:>21}'}".encode()

        lines = EPOCH_3.sub(line, self.buf[offset:].tobytes())
        if self.header.version < 3 or not moved:
            return False
        self.buf = np.frombuffer(self.buf[:offset].tobytes() + lines, dtype=np.uint8)
        finding = f"{moved} whose numbers do not stand in their columns, read number by number"
        self.notes.append(note("epoch lines", finding, "the columns of RINEX 3"))
        return True

    def skip_comment(self) -> bool:
        """Step over a comment between two epochs, which belongs to no event, or a closing line;
        whether it was one.
        """
        line, next_offset = line_at(self.buf, int(self.state[self.kernels.OFFSET]))
        if line[LABEL_COLUMN:].strip() != "COMMENT" and not line.startswith(END_OF_FILE):
            return False
        self.state[self.kernels.OFFSET] = next_offset
        self.state[self.kernels.LINE] += 1
        return True

    def fault(self, status: int) -> str:
        """Return what is wrong at the state's fault, and what to do about it."""
        k, state = self.kernels, self.state
        line, next_offset = "", self.buf.size
        if state[k.MARK] < self.buf.size:
            line, next_offset = line_at(self.buf, int(state[k.MARK]))
        field = quote(line.strip())
        if status == k.CUT or (next_offset >= self.buf.size and not self.complete):
            epoch_line, _ = line_at(self.buf, int(state[k.OFFSET]))
            epoch = f"the epoch of line {state[k.LINE]} ({epoch_line[:32].strip(' >')})"
            return (
                f"truncated: the file ends within {epoch}; copy it again, or delete the lines from"
                f" {state[k.LINE]} on"
            )
        if status == k.BAD_EPOCH and "RINEX VERSION" in line[LABEL_COLUMN:]:
            return (
                "a second header: files were put together; give one of them, or join them with"
                " gfzrnx or teqc"
            )
        if status == k.BAD_EPOCH:
            return f"{field} where an epoch must begin; {COPY_AGAIN}"
        if status == k.BAD_SATELLITE:
            return f"{field} names no satellite of the epoch in line {state[k.LINE]}; {COPY_AGAIN}"
        if status == k.NEW_SYSTEM:
            name = SYSTEM_NAMES[SYSTEM_LETTERS[int(state[k.SYSTEM])]]
            return (
                f"{field}: the header lists no types of observation of {name}; complete the header"
            )
        if status == k.TWICE:
            finding = f"this satellite stands twice in the epoch of line {state[k.LINE]}"
            return f"{field}: {finding}; {COPY_AGAIN}"
        return (
            "a field of 14 columns is no number with a decimal point, or there is text behind the"
            f" last type of observation: {field}; {COPY_AGAIN}"
        )

    def refuse_cut_line(self) -> None:
        """Refuse a last line without an end whose last number is cut, and note a whole one."""
        if self.complete:
            return
        last_line = decode(bytes(self.buf[-4096:-1])).rpartition("\n")[2]
        width = len(last_line.rstrip()) - (3 if self.header.version >= 3 else 0)
        if width > 0 and width % 16 not in (14, 15, 0):
            line = int(self.state[self.kernels.LINE]) - 1
            problem = f"the file ends within a number: {quote(last_line.strip())}; copy it again"
            raise InputError.at_line(self.path, line, f"truncated: {problem}")
        finding = "the last line has no end, so the file may be cut"
        self.notes.append(note("end of the file", finding, "a line's end", "copy it again"))

    def observations(self) -> Observations:
        """Return the observations; epochs that repeat the one before are left out and counted."""
        k = self.kernels
        n, m = int(self.state[k.EPOCHS]), int(self.state[k.ROWS])
        ticks, flags = self.ticks[:n], self.flags[:n]
        has_observations = flags < SLIPS
        if not has_observations.any():
            problem = "holds no epoch; check that the recording was copied whole"
            raise InputError.in_file(self.path, problem)
        of_events = [ticks for _, ticks, _, _ in self.event_records]
        stamps = _gpst_ticks(self.header, self.notes, ticks, flags, of_events)
        of_other_weeks = (
            np.abs(stamps[0] - np.median(stamps[0][has_observations]))
            > LONGEST_WEEKS * TICKS_PER_WEEK
        )
        week = int(stamps[0][np.argmax(has_observations & ~of_other_weeks)] // TICKS_PER_WEEK)
        time, when = ((instants - week * TICKS_PER_WEEK) / k.TICKS_PER_S for instants in stamps)
        epoch, rows = self.epoch[:m], slice(0, m)
        names = np.array([f"{s}{number:02d}" for s in SYSTEM_LETTERS for number in range(100)])
        satellite = names[self.satellite[rows]]
        rows_taken = self.in_order(time, has_observations, epoch, satellite)
        records = tuple(
            EventRecord(flag, float(t) if stamp >= 0 else None, line, lines)
            for t, (flag, stamp, line, lines) in zip(when, self.event_records, strict=True)
        )
        events = np.array([record.time for record in records if record.flag == 5], dtype=np.float64)
        read = Observations(
            *(self.header, week, time, flags, self.clock[:n], epoch, satellite),
            *(tuple(self.signals), self.values[rows], self.lock[rows], self.strength[rows]),
            *(events, records, tuple(self.notes)),
        )
        return read if rows_taken is None else read.only(rows_taken)

    def in_order(
        self,
        time: Array,
        real: NDArray[np.bool_],
        epoch: NDArray[np.int64],
        satellite: NDArray[np.str_],
    ) -> Rows | None:
        """Return the epochs with observations, each stamp once, in order; None for all."""
        places = np.flatnonzero(real)

        def is_repeated(i: int, k: int) -> bool:
            rows_i, rows_k = (slice(*np.searchsorted(epoch, (e, e + 1))) for e in places[[i, k]])
            return np.array_equal(satellite[rows_i], satellite[rows_k]) and np.array_equal(
                self.values[rows_i], self.values[rows_k], equal_nan=True
            )

        _refuse_set_back(Picked(self, places), time[places], is_repeated)
        rows, notes = put_in_order(Picked(self, places), time[places], is_repeated, "epochs")
        self.notes += notes
        if rows is not None:
            return places[rows]
        return None if real.all() else places


def _refuse_set_back(lines: Picked, time: Array, same: Callable[[int, int], bool]) -> None:
    """Refuse epochs of a receiver whose clock was set back, which sorted would be mixed.

    Epochs that a program wrote out of order leave a pause where they are missing, a clock none.

    Parameters
    ----------
    lines : Picked
        Where the epochs stand.
    time : ndarray, (n,)
        Their stamps, s.
    same : callable
        Tells whether two epochs agree in every value.
    """
    steps = np.diff(time)
    (back,) = np.nonzero(steps < 0.0)
    if back.size != 1 or time.size < FEWEST_AROUND:
        return
    row, interval = int(back[0]) + 1, float(np.median(steps))
    again = np.searchsorted(time[:row], time[row])  # the first epoch that its stamp follows or is
    behind = row + np.searchsorted(time[row:], time[row - 1], side="right")
    around = np.concatenate([steps[again - 1 if again else 0 : row - 1], steps[row:behind]])
    if row - again < 2 or (around > PAUSE * interval).any() or same(int(again), row):
        return
    by = interval - float(steps[row - 1])
    raise lines.error_at(
        row,
        f"the receiver's clock was set back by {by:.3f} s here, to {time[row]:.3f} s: {row} epochs"
        f" before and {time.size - row} behind have stamps of two clocks, and the earlier ones were"
        " set for being wrong; cut the file here and process what is behind",
    )


def _gpst_ticks(
    header: RinexHeader,
    notes: list[Finding],
    ticks: NDArray[np.int64],
    flags: NDArray[np.int8],
    events: Sequence[int],
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the ticks of epochs (n,) and events (k,) since 1980-01-06, GPST."""
    second = TICKS_PER_WEEK // int(WEEK_S)
    event_ticks = np.array(events, dtype=np.int64)
    record = "".join(header.records.get("TIME OF FIRST OBS", ("",))[-1:])
    finding = "the header names none; taken for GPS time" if header.clock is None else ""
    if LETTERS_ALONE.search(record) and record[48:51].upper() != header.clock:
        finding = f"{header.clock} does not stand in columns 49 to 51 of the header's record"
    if finding:
        expected = "a time system in TIME OF FIRST OBS"
        notes.append(note("clock of the stamps", finding, expected, "check it"))
    if header.clock == "GLO":
        leap = int(leap_seconds(float(ticks[flags < SLIPS][0]) / second + GPS_EPOCH_UNIX_S))
        return ticks + leap * second, event_ticks + leap * second
    shift = int(BEIDOU_LAG_S) * second if header.clock == "BDT" else 0
    return ticks + shift, event_ticks + shift
