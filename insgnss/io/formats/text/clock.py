"""Columns of time become seconds of a GPS week."""

from collections.abc import Callable, Mapping

import numpy as np

from ....base.errors import InputError
from ....base.wording import written
from ....geodesy.gpstime import WEEK_S, gps_from_unix_utc, unwrap_week
from ....records import Array, Finding
from .order import SHARE_LIMIT, Lines, Picked, Rows, put_in_order, refuse_rows
from .stamps import on_one_clock, unrepeated
from .units import SENSOR_SCALES, split_unit, unit_factor


def check_increasing(lines: Lines, time: Array) -> None:
    """Refuse time (n,), s, that does not increase, with the line and both times."""
    back = np.concatenate([[False], np.diff(time) <= 0.0])
    message = "time {:.6f} s follows {:.6f} s; time must increase; sort the file or take out the"
    refuse_rows(lines, back, f"{message} double line", time, np.roll(time, 1))


def clock_of(cols: Mapping[str, Array]) -> Array:
    """Return readings of the column of time, with the nanoseconds of `nsec` where it exists."""
    tow = np.ascontiguousarray(cols["tow"])
    return tow + 1e-9 * cols["nsec"] if "nsec" in cols else tow


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
    refuse_rows(lines, (seconds < 0.0) | (seconds > 2.0 * WEEK_S), message, seconds)
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
        time, repeat_notes = unrepeated(time, same, name)
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
    time, repeat_notes = unrepeated(time, same_dated, name) if shared > SHARE_LIMIT else (time, ())
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
                row, f"{problem}, {written('units time', 'units = { time = ... }')}"
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
