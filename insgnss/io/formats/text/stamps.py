"""The examiner of stamps: what clocks, counters and loggers do to them, undone where it is certain.

The clock (`on_one_clock`), before stamps become times of a GPS week:

    a counter that falls by its range           counted on: 2^16 and 2^32 ticks, a day
    weeks that lag behind the times of week     taken from the times of week (`weeks_in_step`)
    a clock that was set back                   the rows before are moved by as much, where both
                                                sides have the same stamps with other values
    a date that was not known at first: years   even rows are counted back from the first dated one;
    behind, or seconds since power-up           of others their number is returned

A step ahead of less than that may be a pause of the recording: only motion tells. Positions show it
themselves (`_intervals_moved`), of an IMU `check_set_clock` of `navigation.recognise.claims` does.

Digits. A sensor samples evenly, its clock wanders by a few parts in a million, and a logger prints
its stamps in whole milliseconds: at 128 Hz they step by 8 and 7 ms in turns. Rates and forces are
then taken over intervals that are wrong by a seventh. A straight line through some seconds of
stamps knows the instants to a few hundredths of the last digit,

    t = a + T k over `FITTED_SPAN_S` (k counts samples),   |stamp - t| <= half of the digit

and where the rounding explains every stamp, these instants take the place of the stamps. Where it
does not, because a sensor samples unevenly or a logger stamps late, they stay as they are.

Delays. Stamps that scatter about the line over the count of the rows, or come in bunches, are of a
logger that is late, not of lost samples (`without_jitter`).

Stamps whose digit is the interval itself, 10 ms at 100 Hz, skip one instant and repeat the next
where the sensor is a little late: all rows are there, and the stamp between is put where it was.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ....geodesy.gpstime import DAY_S, WEEK_S, unwrap_week
from ....records import Array, Finding
from .order import Lines, note
from .units import split_unit, unit_factor

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
LEVEL_ROWS = 40  # rows on either side of a step whose median shows it, whatever single stamps do
LEAST_LEVEL_ROWS = 5  # rows of a side: fewer are rows out of place (chosen)
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

DIGITS_S = (1e-1, 1e-2, 1e-3, 1e-4)  # last printed digits (s) that can matter at the rates of IMUs
COARSE, TOO_COARSE = 0.02, 0.45  # of the interval: digits that matter, and that hide a sample
# of a line: longer than the beat of most rates with a millisecond; fewest stamps that are spread
FITTED_SPAN_S, LEAST_STAMPS = 20.0, 40
PAIRED = 0.95  # of the repeated stamps: those beside a skipped one
MOST_SENSORS = 3  # rows of each stamp that may be of as many sensors in one file
# of the rows: those with a stamp of their own where the rest tell a rate above the stamps' digit;
# more are single contradictions, half of them a second sensor (chosen)
MOST_SHARED = 0.95
MEAN_ROWS = 200  # rows of a mean interval: many times the rows that a driver hands over at once
# share of the steps that are no single interval, from which they are jitter: of fewer each is a
# gap or a row out of order (`order`)
LEAST_JITTERY = 0.01
# standard deviations of the steps that stamps scatter about the line: 0.7 if each is late by
# chance, 1 in bunches of ten, ten times as much if the intervals themselves vary (chosen)
MOST_WALK, MOST_DELAY = 1.2, 8.0
# of the steps: fewer are of a sensor that samples unevenly, or of a broken recording
LEAST_EVEN_SHARE = 0.98
MOST_RESIDUAL_DIGITS = 0.6  # of the digit: what rounding and the line leave at most
STAMPS_AT_A_TIME = 1 << 14  # stamps that are looked at together, which a processor's cache holds
ODD = 1e-3  # share of the stamps that may lie beyond


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
        seconds, ranges = _unwrapped(seconds, factor)
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


def _unwrapped(time: Array, tick: float) -> tuple[Array, list[tuple[int, float]]]:
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


def spread_evenly(time: Array) -> tuple[Array, tuple[Finding, ...]]:
    """Return stamps (n,), s, spread evenly where they are rounded, with the note on it.

    Parameters
    ----------
    time : ndarray, shape (n,), s
        In the order of the file.
    """
    if time.size < LEAST_STAMPS:
        return time, ()
    digit = _last_digit(time)
    if digit == 0.0:
        return time, ()
    usual = float(np.median(np.diff(time), overwrite_input=True))
    if (time[1:] <= time[:-1]).any() or not COARSE * usual < digit < TOO_COARSE * usual:
        return time, ()
    step = np.diff(time)
    near = np.abs(step - usual) < 1.5 * digit
    interval = float(np.mean(step[near]))
    if (
        near.mean() < LEAST_EVEN_SHARE or np.ptp(step[near]) < 0.5 * digit
    ):  # uneven, or as even as can be
        return time, ()
    ends = np.flatnonzero(~near) + 1
    out = _lines(time, ends, interval)
    distance = np.abs(out - time)
    if np.mean(distance > MOST_RESIDUAL_DIGITS * digit) > ODD or not (np.diff(out) > 0.0).all():
        return time, ()
    rate = f"an even {1.0 / interval:.6g} Hz"
    finding = f"stamps rounded to {1e3 * digit:g} ms at {rate} were spread evenly"
    advice = "log more digits if the logger can; all stamps may be late by half of the last digit"
    return out, (note("IMU rows", finding, "stamps of more digits than the rate needs", advice),)


def unrepeated(
    time: Array, same: Callable[[int, int], bool] = lambda i, k: False, name: str = "IMU rows"
) -> tuple[Array, tuple[Finding, ...]]:
    """Return stamps (n,), s, without repetitions beside skipped stamps, and their note `name`.

    Rows that a driver hands over at once have the stamp of the last of them. The stamps stay as
    they are where more repeat than that explains, or where most rows repeat with all their values.
    """
    repeats = time[1:] == time[:-1]
    if time.size < LEAST_STAMPS or not repeats.any() or _of_several_sensors(time):
        return time, ()
    if np.mean([same(k, k + 1) for k in np.flatnonzero(repeats).tolist()]) > 0.5:
        return time, ()
    usual = _mean_interval(time)
    run = np.concatenate([[0], np.cumsum(~repeats)])  # of rows of one stamp, each row's
    length = np.bincount(run)
    stamp = time[np.cumsum(length) - 1]
    # of bunches the first one counts back as the others do; else a row at an end is double
    in_bunches = np.median(length) > 1.0
    step = np.concatenate([[np.inf if in_bunches else 0.0], np.diff(stamp), [0.0]])
    skip_before = step[:-1] > (length - 0.5) * usual
    skip_after = (length == 2) & (step[1:] > 1.5 * usual) & ~skip_before
    mended = (length > 1) & (skip_before | skip_after)
    if usual <= 0.0 or mended.sum() < PAIRED * (length > 1).sum():
        return time, ()
    after = np.cumsum(length)[run] - 1 - np.arange(time.size)  # rows of the stamp after each
    out = time - usual * after * (mended & skip_before)[run]
    out[np.cumsum(length)[mended & skip_after] - 1] += usual
    finding = f"{int((length - 1)[mended].sum())} stamps occur twice beside a missing stamp"
    advice = "such rows got the missing stamps; if the logger can, log more digits or sensor time"
    return out, (note(name, finding, "stamps of more digits than the rate needs", advice),)


def without_jitter(time: Array) -> tuple[Array, tuple[Finding, ...]]:
    """Return stamps (n,), s, of an even sensor without the logger's delays, and the note on them.

    A logger that stamps when it gets round to it, or a bus that hands rows over in bunches, leaves
    steps that look like lost samples and like rows out of order. The count of the rows shows that
    none is lost: where their stamps scatter about a line over the count and do not walk away from
    it, the line takes their place, from one real gap to the next. A sensor that samples unevenly
    walks away.

    Parameters
    ----------
    time : ndarray, shape (n,), s
        In the order of the file.
    """
    if time.size < LEAST_STAMPS or _share_uneven(time, _mean_interval(time)) < LEAST_JITTERY:
        return time, ()
    interval, stamps = _mean_interval(time), np.unique(time)
    shared = stamps.size <= MOST_SHARED * time.size
    if _of_several_sensors(time) or stamps.size < LEAST_STAMPS or 2 * stamps.size == time.size:
        return time, ()
    if not shared and _share_uneven(stamps, interval) < LEAST_JITTERY:
        return time, ()  # rows out of order, or double
    ends = _gaps(time, interval)
    out = _lines(time, ends, interval)
    delay, step = time - out, np.delete(np.diff(time), ends - 1)
    scatter = float(np.std(step))
    if (
        np.std(delay) > MOST_WALK * scatter
        or np.abs(delay).max() > MOST_DELAY * scatter
        or not (np.diff(out) > 0.0).all()
    ):
        return time, ()
    finding = (
        f"stamps that scatter by {1e3 * np.std(delay):.2g} ms about an even"
        f" {1.0 / interval:.6g} Hz were spread evenly"
    )
    advice = "let the sensor stamp its samples; now all stamps may have the logger's mean delay"
    return out, (note("IMU rows", finding, "stamps of the sensor's clock", advice),)


def _mean_interval(time: Array) -> float:
    """Interval of the rows, s, whatever their jitter: the median of means over some of them."""
    rows = min(MEAN_ROWS, time.size // 2)
    return float(np.median(time[rows:] - time[:-rows])) / rows


def _share_uneven(time: Array, interval: float) -> float:
    """Share of the steps that are no single interval."""
    return float(np.mean(np.abs(np.diff(time) - interval) > 0.5 * interval))


def _gaps(time: Array, interval: float) -> NDArray[np.intp]:
    """Rows of jittery stamps before which samples are lost: the level of the stamps rises there."""
    step = np.diff(time)
    excess = time - interval * np.arange(time.size)
    single = step[np.abs(step - interval) < 20.0 * interval]
    jitter = min(float(np.std(single)) / interval, 3.0) if single.size else 3.0
    rows = int(max(LEVEL_ROWS, 16 * LEVEL_ROWS * jitter**2))
    k = np.flatnonzero(step > 1.5 * interval) + 1
    k = k[(k >= LEAST_LEVEL_ROWS) & (k <= time.size - LEAST_LEVEL_ROWS)]
    rise = np.array(
        [
            np.median(excess[row : row + rows]) - np.median(excess[max(row - rows, 0) : row])
            for row in k.tolist()
        ]
    )
    k = k[rise > 0.6 * interval]
    ends: list[int] = []
    for near in np.split(k, np.flatnonzero(np.diff(k) > rows) + 1) if k.size else []:
        distance = np.abs(near - np.mean(near)) / rows
        ends.append(int(near[np.argmax(step[near - 1] / interval - 4.0 * distance)]))
    return np.array(ends, dtype=np.intp)


def _of_several_sensors(time: Array) -> bool:
    """Whether all stamps occur twice, or three times: the rows may be of so many sensors."""
    length = np.diff(np.flatnonzero(np.concatenate([[True], time[1:] != time[:-1], [True]])))[1:-1]
    return bool(length.size and 1 < length[0] <= MOST_SENSORS and (length == length[0]).all())


def _last_digit(time: Array) -> float:
    """Unit of the last printed digit, s; 0 where it is finer than any that matters."""
    whole = np.floor(time[0])
    for digit in DIGITS_S:
        for first in range(0, time.size, STAMPS_AT_A_TIME):
            ticks = (time[first : first + STAMPS_AT_A_TIME] - whole) / digit
            if (np.abs(ticks - np.round(ticks)) >= 2e-3).any():
                break
        else:
            return digit
    return 0.0


def _lines(time: Array, ends: NDArray[np.intp], interval: float) -> Array:
    """Return stamps on lines between ends; those of few rows stay."""
    out = time.copy()
    for first, last in zip([0, *ends], [*ends, time.size], strict=True):
        if last - first >= LEAST_STAMPS:
            out[first:last] = _line(time[first:last], interval)
    return out


def _line(time: Array, interval: float) -> Array:
    """Line through the neighbours of each stamp, at it; at the ends the first and the last one."""
    n = time.size
    k = np.arange(n, dtype=np.float64)
    rest = time - time[0] - interval * k
    width = min(2 * int(0.5 * FITTED_SPAN_S / interval) + 1, n if n % 2 else n - 1)
    half = width // 2
    total, moment = (np.concatenate([[0.0], np.cumsum(values)]) for values in (rest, rest * k))
    middle = np.clip(np.arange(n), half, n - 1 - half)
    lo, hi = middle - half, middle + half + 1
    mean = (total[hi] - total[lo]) / width
    slope = (moment[hi] - moment[lo] - middle * width * mean) / (width * (width**2 - 1) / 12.0)
    return np.asarray(time[0] + interval * k + mean + slope * (k - middle))
