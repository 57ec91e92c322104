"""The examiner of stamps: columns of time become seconds of a GPS week on one clock.

The clock (`on_one_clock`), before stamps become times of a GPS week:

    a counter that falls by its range           counted on: 2^16 and 2^32 ticks, a day
    weeks that lag behind the times of week     taken from the times of week (`weeks_in_step`)
    a clock that was set back                   the rows before are moved by as much, where both
                                                sides have the same stamps with other values
    a date that was not known at first: years   even rows are counted back from the first dated one;
    behind, or seconds since power-up           of others their number is returned

A step ahead of less than that may be a pause of the recording: only motion tells. Positions show it
themselves (`_intervals_moved`), of an IMU `check_set_clock` of `navigation.recognise.claims` does.

What digits and delays of a logger do to the stamps of an even sensor is undone in `stamps`.
"""

from collections.abc import Callable, Mapping

import numpy as np

from ....base.errors import InputError
from ....base.wording import fill_in
from ....geodesy.gpstime import DAY_S, WEEK_S, gps_from_unix_utc, unwrap_week
from ....records import Array, Finding
from ..names import FRACTIONS_S
from .order import SHARE_LIMIT, Lines, Picked, Rows, note, put_in_order, refuse_rows
from .stamps import LEAST_LEVEL_ROWS, LEVEL_ROWS, without_repetitions
from .units import SENSOR_SCALES, split_unit, unit_factor

Notes = tuple[Finding, ...]

CLOCK_STEP = "clock step"  # name of the note on a clock that was set (`records.verdicts`)
COUNTED = (2.0**16, 2.0**32)  # ticks after which counters of loggers begin anew
# s: ranges of counters of which the file has seconds: 2^32 us, 0.1 ms and ms, and times of day
RANGES_S = (2.0**32 * 1e-6, 2.0**32 * 1e-4, 2.0**32 * 1e-3, DAY_S)
# of a range, within which stamps lie before its end and after its beginning where a counter begins
# anew: 86 s of 2^32 us; a clock that is set back by the range to 2 % is the rarer case (chosen)
NEAR_END = 0.02
# s: a clock without the date is years behind, or counts since power-up; two recordings of some
# days in one file are neither (chosen)
UNDATED_S, POWER_UP_S = 365.0 * DAY_S, 3600.0
MOST_FALLS = 200  # falls of the stamps: more are no clock's (chosen)
SET_INTERVALS = 1.5  # intervals: a smaller step is jitter
PAUSE_INTERVALS = 10.0  # intervals: shorter pauses are as long as a step back by chance (chosen)
# intervals from a row to the nearest one of the other side: below it both sides overlap, as no
# rows in the wrong order do, which fill each other's gaps
OVERLAP_INTERVALS = 0.75
# rows on either side of a step that show a velocity, m/s at least (chosen): of a hovering drone it
# is no measure of time
MOVED_ROWS, LEAST_SPEED_MPS = 6, 1.0
# of the way in an interval: what lines through both sides may miss, and of the speed: what it may
# change by, where the way shows the intervals; and most of these, as a turn brings a body back to
# its way later (chosen)
MOST_ASIDE, MOST_CHANGE, MOST_INTERVALS = 0.25, 0.25, 3


def check_increasing(lines: Lines, time: Array) -> None:
    """Refuse time (n,), s, that does not increase, with the line and both times."""
    back = np.concatenate([[False], np.diff(time) <= 0.0])
    message = "time {:.6f} s follows {:.6f} s; time must increase; sort the file or take out the"
    refuse_rows(lines, back, f"{message} double line", time, np.roll(time, 1))


def clock_of(cols: Mapping[str, Array]) -> Array:
    """Return readings of the column of time, with those of `FRACTIONS_S` where they exist."""
    tow = np.ascontiguousarray(cols["tow"])
    for name in FRACTIONS_S.keys() & cols.keys():
        tow = tow + FRACTIONS_S[name] * cols[name]
    return tow


def gps_time(
    lines: Lines, tow: Array, week: Array | None, gps_week: int | None, unit: str = "s"
) -> tuple[Array, int | None]:
    """Return seconds of the first week, and that week.

    Parameters
    ----------
    lines : Lines
        Where the rows stand, for refusals.
    tow : ndarray
        (n,) times of week, or of a clock with an epoch.
    week : ndarray, optional
        (n,) a column of weeks; zeros are taken for none.
    gps_week : int, optional
        The caller's week.
    unit : str
        Unit of `tow`, of SENSOR_SCALES["time"]; of a clock with an epoch (unix, gps) the week
        follows.

    Raises
    ------
    InputError
        A time that is none, or a week that contradicts the caller's, with the line.
    """
    factor, epoch = unit_factor(unit, "time"), split_unit(unit)[1]
    seconds = tow if factor == 1.0 else tow * factor
    if epoch.startswith(("unix", "gps")):
        return _of_epoch(lines, seconds, epoch, gps_week)
    if week is not None and week.any():
        odd = (week != np.floor(week)) | (week < 0.0) | (week > 9999.0)
        message = f"GPS week {{:g}} in a file of week {week[0]:g}; check the columns, or split it"
        refuse_rows(lines, odd | (np.abs(week - week[0]) > 1.0), message, week)
        first = int(week[0])
        agree_on_week(lines, first, gps_week)
        time, gps_week = seconds + WEEK_S * (week - first), first
    else:
        time = unwrap_week(seconds)
    message = (
        f"time {{:.3f}} s is no GPS time of week (0 to {WEEK_S:.0f} s); check the column and units"
        f" = {{{{ time = ... }}}} ({', '.join(SENSOR_SCALES['time'])}), or convert the clock"
    )
    if unit == "s" and not np.mod(seconds, 1.0).any():
        message += (
            '; of a counter, units = {{ time = "1e-4 s" }} says how long a tick is, and'
            " time_offset_s what is to be added"
        )
    bad = (seconds < 0.0) | (seconds > 2.0 * WEEK_S)
    refuse_rows(lines, bad, message, seconds)
    return time, gps_week


def examined_time(
    lines: Lines,
    tow: Array,
    week: Array | None,
    name: str,
    gps_week: int | None,
    unit: str,
    same: Callable[[int, int], bool] | None = None,
) -> tuple[Array, int | None, tuple[Finding, ...]]:
    """Return what `gps_time` does of stamps that `on_one_clock` examined, and the notes.

    Raises
    ------
    InputError
        A stamp that is none, or the first row of those that were stamped before the date was known,
        where they are not of an even sensor.
    """
    tow, week, undated, notes = on_one_clock(lines, tow, week, unit, name, same)
    if undated:
        message = f"{undated} rows were stamped before the clock knew the date; delete these rows"
        raise lines.error_at(0, f"{message}, or correct their times")
    time, gps_week = gps_time(lines, tow, week, gps_week, unit)
    if same is not None:
        time, repeat_notes = without_repetitions(time, same, name)
        notes = (*notes, *repeat_notes)
    return time, gps_week, notes


def ordered_time(
    lines: Lines,
    tow: Array,
    week: Array | None,
    name: str,
    gps_week: int | None,
    unit: str,
    same: Callable[[int, int], bool],
    positions: Callable[[], Array],
) -> tuple[Array, int | None, Rows | None, tuple[Finding, ...]]:
    """Return seconds, the week, the rows of positions to take (None for all), and the notes.

    Stamps are examined as by `on_one_clock`, rows of the time before the date was known are left
    out, and the others put in order as by `put_in_order`.
    """
    tow, week, undated, clock_notes = on_one_clock(lines, tow, week, unit, name, same, positions)
    dated = np.arange(undated, tow.size)
    if undated:
        lines, tow = Picked(lines, dated), tow[undated:]
        week = None if week is None else week[undated:]
    time, gps_week = gps_time(lines, tow, week, gps_week, unit)

    def same_dated(i: int, k: int) -> bool:
        return same(i + undated, k + undated)

    shared = np.mean(time[1:] == time[:-1]) if time.size > 1 else 0.0
    # fewer stamps that a receiver repeats are single contradictions
    time, repeat_notes = (
        without_repetitions(time, same_dated, name) if shared > SHARE_LIMIT else (time, ())
    )
    rows, notes = put_in_order(lines, time, same_dated, name)
    if rows is not None:
        time, dated = time[rows], dated[rows]
    taken = None if rows is None and not undated else dated
    return time, gps_week, taken, (*clock_notes, *repeat_notes, *notes)


def _of_epoch(lines: Lines, seconds: Array, epoch: str, gps_week: int | None) -> tuple[Array, int]:
    """Return seconds of the first week, to the microsecond, and that week.

    The clock counts on from its epoch.
    """
    if epoch == "gps":
        if seconds.size == 0 or not seconds.min() >= 0.0:
            problem = (
                f"time {seconds.min():.3f} s lies before the start of GPS time (6 January 1980);"
                " check unit and time scale of the time column"
            )
            row = int(np.argmin(seconds))
            raise lines.error_at(
                row, f"{problem}, {fill_in('units time', 'units = { time = ... }')}"
            )
        first = int(seconds[0] // WEEK_S)
        time = seconds - first * WEEK_S
    else:
        try:
            first, time = gps_from_unix_utc(seconds)
        except InputError as refusal:
            raise lines.error_at(int(np.argmin(seconds)), str(refusal)) from None
    agree_on_week(lines, first, gps_week)
    return np.round(time, 6), first


def agree_on_week(lines: Lines, week: int, gps_week: int | None) -> None:
    """Refuse the week of the first row where the caller says another."""
    if gps_week is not None and week != gps_week:
        message = f"the times are of GPS week {week}, but gps_week is {gps_week}"
        raise lines.error_at(0, f"{message}; correct gps_week, or take the right file")


def on_one_clock(
    lines: Lines,
    tow: Array,
    week: Array | None,
    unit: str,
    name: str,
    same: Callable[[int, int], bool] | None = None,
    positions: Callable[[], Array] | None = None,
) -> tuple[Array, Array | None, int, Notes]:
    """Return stamps and weeks as one clock would have written them.

    Parameters
    ----------
    lines : Lines
        Where the rows stand, for the notes.
    tow : ndarray
        (n,) stamps in the order of the file, in `unit`.
    week : ndarray, optional
        (n,) a column of weeks; zeros alone are taken for none.
    unit : str
        Unit of `tow`, of UNITS["time"].
    name : str
        Name of the notes, such as "IMU rows".
    same : callable, optional
        Tells whether two rows agree in every value; of rows of a sensor that samples evenly.
    positions : callable, optional
        Answers the positions (n, 3), m, of rows that hold some.

    Returns
    -------
    tow : ndarray, (n,)
    week : ndarray, (n,), optional
    undated : int
        Leading rows whose date was not known, and which cannot be counted back.
    notes : tuple of Finding
    """
    factor, epoch = unit_factor(unit, "time"), split_unit(unit)[1]
    notes: list[Finding] = []
    seconds = tow if factor == 1.0 else factor * tow
    if week is not None and week.any() and np.isfinite(week).all():
        mended = weeks_in_step(week, seconds)
        if wrong := int((mended != week).sum()):
            notes.append(stale_weeks(name, wrong, week.size))
        week = mended
        seconds = seconds + WEEK_S * (week - week[0])
    step = np.diff(seconds)
    if not step.size:
        return tow, week, 0, tuple(notes)
    longest = DAY_S if positions is None else SET_INTERVALS * float(np.median(step))
    if step.min() > 0.0 and step.max() < longest:
        return tow, week, 0, tuple(notes)
    if week is None and not epoch.startswith(("unix", "gps")):
        seconds, ranges = _unwrap_counter(seconds, factor)
        seconds = unwrap_week(seconds)
        notes += [_begins_anew(lines, name, row, length) for row, length in ranges]
    undated = 0
    if same is None or positions is not None:
        jumps = np.flatnonzero(np.diff(seconds) > DAY_S) + 1
        undated = int(jumps[-1]) if jumps.size and jumps[-1] < 0.5 * seconds.size else 0
        if undated and not _is_undated(seconds[0], seconds[undated] - seconds[0]):
            undated = 0
        if undated:
            finding = f"{undated} rows before {line_of(lines, undated)} left out, of {seconds.size}"
            advice = "they were stamped before the clock knew the date"
            notes.append(note(name, finding, "stamps of one clock", advice))
    if same is not None:
        steps = [step for step in _steps(seconds, same, positions) if step[0] > undated]
        seconds, set_notes = _without_steps(lines, seconds, name, steps)
        notes += set_notes
    if week is not None:
        seconds = seconds - WEEK_S * (week - week[0])
    return seconds / factor, week, undated, tuple(notes)


def weeks_in_step(week: Array, tow: Array) -> Array:
    """Return the weeks of times of week, which count on where the times begin anew.

    A receiver's messages may name the week before for some time after its end, or 0 until it is
    known: then most of the rows decide. Where a clock was set, too, as the times of week show by a
    step of more than `POWER_UP_S`, the weeks stay.

    Parameters
    ----------
    week, tow : ndarray
        (n,) weeks, and times of week, s, in the order of the file.
    """
    ends = np.round((unwrap_week(tow) - tow) / WEEK_S)
    values, count = np.unique(week - ends, return_counts=True)
    mended = values[np.argmax(count)] + ends
    changes = np.diff(mended != week)
    set_by = np.diff(tow + WEEK_S * mended)[changes]
    stale = 2 * count.max() > week.size and (np.abs(set_by) < POWER_UP_S).all()
    return mended if stale else week


def stale_weeks(name: str, wrong: int, rows: int) -> Finding:
    """Return the note on weeks that do not follow from the times of week."""
    finding = f"the GPS week of {wrong} of {rows} rows contradicts their times of week"
    advice = "the receiver reported an outdated week; the week of most rows was used for all"
    return note(name, finding, "weeks that change where the time of week restarts", advice)


def _is_undated(stamp: float, lacks: float) -> bool:
    """Whether a clock that lacks so many seconds did not know the date at a stamp, s."""
    return lacks > UNDATED_S or (lacks > DAY_S and stamp < POWER_UP_S)


def undated_rows(name: str, count: int, first: str) -> Finding:
    """Return the note on so many rows that were stamped before the date was known."""
    finding = f"{count} rows before {first} left out: stamped before the clock knew the date"
    return note(name, finding, "stamps of one clock", "to keep such rows, switch on earlier")


def line_of(lines: Lines, row: int) -> str:
    """File and line of a row."""
    return str(lines.error_at(row, "")).strip(": ")


def _unwrap_counter(time: Array, tick: float) -> tuple[Array, list[tuple[int, float]]]:
    """Return stamps (n,), s, of a counter that begins anew, and rows and ranges where it does."""
    ranges = sorted({*RANGES_S, *(tick * count for count in COUNTED)})
    done, out = [], time
    for row in (np.flatnonzero(np.diff(time) < 0.0) + 1).tolist():
        before, fall = time[row - 1], time[row - 1] - time[row]
        for length in ranges:
            near = NEAR_END * length
            at_end = abs(before - length) < near or abs(before - 0.5 * length) < near
            if at_end and -near < fall - length < 0.0:
                if out is time:
                    out = time.copy()
                out[row:] += length
                done.append((row, length))
                break
    return out, done


def _begins_anew(lines: Lines, name: str, row: int, length: float) -> Finding:
    finding = (
        f"the time restarts at {line_of(lines, row)}, after {length:.6f} s of recording; the times"
        " behind it were shifted so that they go on"
    )
    return note(name, finding, "a clock without restarts", "nothing to do")


def _without_steps(
    lines: Lines, time: Array, name: str, steps: list[tuple[int, float]]
) -> tuple[Array, Notes]:
    """Return stamps (n,), s, of even rows without the steps, s, of a clock that was set."""
    if not steps:
        return time, ()
    # what each row lacks to the clock of the last one, or of the last one that knows the date
    lacks = np.zeros(len(steps) + 1)
    lacks[:-1] = np.cumsum([change for _, change in steps[::-1]])[::-1]
    anchor = int(np.flatnonzero(lacks <= lacks.min() + DAY_S)[-1])
    lacks -= lacks[anchor]
    out = time + np.repeat(lacks, np.diff([0, *(row for row, _ in steps), time.size]))
    moved = "before the step were shifted to the clock after the step"
    if anchor < len(steps):
        moved = "without a date were shifted to the clock that knows the date"
    count = f"{len(steps)} times, first" if len(steps) > 1 else "once,"
    finding = (
        f"the clock was set during the recording, {count} by {steps[0][1]:+.3f} s at"
        f" {line_of(lines, steps[0][0])}; the rows {moved}"
    )
    advice = "no row is assumed missing there; exposures of the same clock need the same shift"
    return out, (note(CLOCK_STEP, f"{name}: {finding}", "a clock without steps", advice),)


def _steps(
    time: Array, same: Callable[[int, int], bool], positions: Callable[[], Array] | None
) -> list[tuple[int, float]]:
    """Return the rows of even stamps (n,), s, at which a clock was set, and by how much, s."""
    step = np.diff(time)
    usual = float(np.median(step))
    rows = np.flatnonzero((step < (1.0 - SET_INTERVALS) * usual) | (step > DAY_S)) + 1
    usual_steps = step[np.abs(step - usual) < 0.6 * usual]
    if not usual_steps.size or rows.size > MOST_FALLS:
        return []
    interval = float(np.mean(usual_steps))
    steps: list[tuple[int, float]] = []
    x = None if positions is None else positions()
    falls: list[int] = rows.tolist()
    for first, row, end in zip([0, *falls], falls, [*falls[1:], time.size], strict=False):
        before = time[max(first, row - LEVEL_ROWS) : row]
        after = time[row : min(end, row + LEVEL_ROWS)]
        count_back = interval * np.arange(1 - before.size, 1)
        level_after = np.median(after - interval * np.arange(after.size))
        change = float(level_after - np.median(before - count_back)) - interval
        undated = _is_undated(min(time[first], time[row]), abs(change))
        leads = undated and first == 0 and change > 0.0
        if x is not None and (moved := _intervals_moved(time, x, row, interval)):
            steps.append((row, float(step[row - 1]) - moved * interval))
            continue
        if (min(before.size, after.size) < LEAST_LEVEL_ROWS and not leads) or (
            not undated
            and (
                change > -SET_INTERVALS * interval
                or not _overlap(time, first, row, end, interval, same)
            )
        ):
            continue
        steps.append((row, change))
    pauses = np.flatnonzero((step > (1.0 + SET_INTERVALS) * interval) & (step <= DAY_S)) + 1
    for row in pauses.tolist() if pauses.size <= MOST_FALLS else []:
        ahead = float(step[row - 1]) - interval
        if x is not None and (moved := _intervals_moved(time, x, row, interval)):
            ahead -= (moved - 1) * interval
            if ahead > SET_INTERVALS * interval:
                steps.append((row, ahead))
        # a pause as long as the clock was set back is that it was set ahead again, or before
        elif step[row - 1] > PAUSE_INTERVALS * interval and any(
            abs(ahead + change) < 0.5 * interval for _, change in steps if change < 0.0
        ):
            steps.append((row, ahead))
    return sorted(steps)


def _intervals_moved(time: Array, x: Array, row: int, interval: float) -> int:
    """Intervals that positions x (n, 3), m, took to come to a row; 0 where they do not show it.

    Lines through the rows on either side meet the step with the same velocity, and the way between
    them is that of a few intervals, along it.
    """
    ends = []
    sides = ((slice(max(row - MOVED_ROWS, 0), row), row - 1), (slice(row, row + MOVED_ROWS), row))
    for rows, end in sides:
        t = time[rows] - time[end]
        if t.size < LEAST_LEVEL_ROWS or not ((step := np.diff(t)) > 0.0).all():
            return 0
        if step.max() > SET_INTERVALS * interval or not np.isfinite(x[rows]).all():
            return 0
        line = np.column_stack([np.ones_like(t), t])
        ends.append(np.linalg.lstsq(line, x[rows] - x[end], rcond=None)[0])
    v = 0.5 * (ends[0][1] + ends[1][1])
    speed, turned = np.linalg.norm(v), np.linalg.norm(ends[1][1] - ends[0][1])
    if not speed > LEAST_SPEED_MPS or turned > MOST_CHANGE * speed:
        return 0
    way = x[row] + ends[1][0] - x[row - 1] - ends[0][0]
    moved = round(float(way @ v) / (speed**2 * interval))
    aside = float(np.linalg.norm(way - v * moved * interval))
    return moved if 0 < moved <= MOST_INTERVALS and aside < MOST_ASIDE * speed * interval else 0


def _overlap(
    time: Array, first: int, row: int, end: int, interval: float, same: Callable[[int, int], bool]
) -> bool:
    """Whether the rows from `row` on have stamps of the rows before, and other values."""
    rows = first + np.flatnonzero(time[first:row] > time[row] - interval)
    if not rows.size:
        return False
    rows = rows[np.argsort(time[rows], kind="stable")]
    after = np.arange(row, end)[time[row:end] <= time[rows[-1]]]
    next_row = np.searchsorted(time[rows], time[after]).clip(1, max(rows.size - 1, 1))
    nearest = np.stack([rows[next_row - 1], rows[np.minimum(next_row, rows.size - 1)]])
    distance = np.abs(time[nearest] - time[after])
    near = nearest[np.argmin(distance, axis=0), np.arange(after.size)]
    repeated = [
        time[i] == time[k] and same(i, k)
        for i, k in zip(near.tolist(), after.tolist(), strict=True)
    ]
    return bool(
        np.mean(distance.min(axis=0) < OVERLAP_INTERVALS * interval) > 0.5
        and np.mean(repeated) < 0.5
    )
