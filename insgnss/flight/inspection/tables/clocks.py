"""Which columns of an unknown table are its clocks, and in which unit they count.

A known name gives the candidates, else a column that increases in nearly equal steps is one; the
step gives the unit. A counter of rows or packets runs as evenly and is none.
"""

import re
from collections.abc import Sequence

import numpy as np

from ....io.formats.text.headers import TIME_FACTORS
from ....records import Array
from .names import CLOCK_NAMES, WEEK_NAMES, UnknownTable, bare, spellings, squash_name

UNIX_FROM = 5e8  # s: a clock beyond this counts from 1970
EVEN_SHARE = 0.6  # of the steps of an unnamed clock near the usual one: receivers leave fixes out
# of the steps of an IMU's clock that go forward: fewer are of a receiver beside it, whose stamps
# repeat; of bunches of 30 rows that share theirs, where no other clock is there
LEAST_FORWARD, LEAST_BUNCHES = 0.5, 0.03
TWIN = 1e-3  # of a decade: how near a power of a thousand the ratio of two clocks of one device is
# clocks whose name says their unit
FIXED_TICKS = {
    "sampletimefine": "100 us",
    **dict.fromkeys(("itow", "gms", "millis"), "ms"),
    "micros": "us",
}
SHORTEST_TICK_S = 1e-5  # of a sensor: a header's unit that makes shorter steps is wrong (chosen)
COUNTER = re.compile(
    r".*(count|counter|cnt|seq|index|idx|packet|number|frame|sample|id|row)(nr|no)?"
)
SECONDS_SUFFIX, FRACTIONS = (
    re.compile(r"(.*?)(?:unixtime|secs?|seconds?)"),
    {
        "nsec": re.compile(r"(.*?)n(?:ano)?(?:secs?|seconds?)"),
        "usec": re.compile(r"(.*?)(?:u|micro)(?:secs?|seconds?)"),
    },
)


def clocks(grid: UnknownTable, longest_step: float) -> dict[int, str]:
    """Find the columns that are clocks, and their units.

    Parameters
    ----------
    grid : UnknownTable
        Names give the candidates where there are any; the step gives the unit.
    longest_step : float, s
        Of the sensor; 0.5 for an IMU, 30 for GNSS.

    Returns
    -------
    dict of int to str
        Unit by column, the best clock first.
    """
    one_by_one = _clocks(grid, longest_step, LEAST_FORWARD)
    return one_by_one or _clocks(grid, longest_step, LEAST_BUNCHES)


def _clocks(grid: UnknownTable, longest_step: float, least_forward: float) -> dict[int, str]:
    """Return the unit of each column that counts time, by column, the best clock first."""
    named = any(name is not None for name in grid.names)
    fraction_columns = [column for column, _ in seconds_and_fractions(grid.names).values()]
    units: dict[int, str] = {}
    for column, name in enumerate(grid.names):
        clock = [] if name is None else clock_names(name)
        if named and (not clock or column in fraction_columns):
            continue
        unit = _clock_unit(grid.values[:, column], longest_step, not named, least_forward)
        if unit is not None:
            named_units = [
                FIXED_TICKS[abbreviation] for abbreviation in clock if abbreviation in FIXED_TICKS
            ]
            named_units += filter(None, [grid.unit_of(column, "time")])
            steps = np.diff(grid.values[:, column])
            typical = float(np.median(steps[steps > 0.0]))
            units[column] = next(
                (
                    candidate
                    for candidate in named_units
                    if SHORTEST_TICK_S < typical * tick(candidate) <= longest_step
                ),
                unit,
            )
    return _best_first(grid, units)


def clock_names(name: str) -> list[str]:
    """Return the spellings of a column's name that are names of clocks."""
    return [s for s in (*spellings(name), *bare(name, ("time",))) if s in CLOCK_NAMES]


def clocks_by_values(grid: UnknownTable, longest_step: float, taken: set[int]) -> dict[int, str]:
    """Find the columns that no name calls a clock but that run like one.

    A counter of rows or packets is none.
    """
    units: dict[int, str] = {}
    for k, name in enumerate(grid.names):
        steps = np.diff(grid.values[:, k])
        counts = (steps == 1.0).mean() > 0.5 or (
            name is not None and COUNTER.fullmatch(squash_name(name)) is not None
        )
        if k in taken or counts:
            continue
        unit = _clock_unit(grid.values[:, k], longest_step, unnamed=True)
        if unit is not None:
            units[k] = unit
    return _best_first(grid, units)


def is_clock_of(grid: UnknownTable, column: int, clock: int) -> bool:
    """Tell whether a column runs with a clock, in the same ticks or a thousandth of them."""
    a, b = grid.values[:, clock], grid.values[:, column]
    span = float(a[-1] - a[0])
    ratio = float(b[-1] - b[0]) / span if span else 0.0
    if not ratio > 0.0 or abs(np.log10(ratio) - 3.0 * round(np.log10(ratio) / 3.0)) > TWIN:
        return False
    deviation = np.abs(b - b[0] - ratio * (a - a[0])) / ratio
    return bool(np.quantile(deviation, EVEN_SHARE) < np.median(np.diff(a)))


def _best_first(grid: UnknownTable, units: dict[int, str]) -> dict[int, str]:
    """Times of week beside a week first, clocks that count from 1970, then those in seconds.

    One that falls, as seconds of a minute do, is none beside one that does not.
    """
    forward = {k: u for k, u in units.items() if (np.diff(grid.values[:, k]) >= 0.0).all()}

    beside_week = bool(weeks(grid))

    def rank(item: tuple[int, str]) -> tuple[bool, bool, bool]:
        k, unit = item
        of_week = beside_week and squash_name(grid.names[k] or "").endswith("tow")
        return (
            not of_week,
            not float(np.median(grid.values[:, k])) * tick(unit) > UNIX_FROM,
            unit != "s",
        )

    return dict(sorted((forward or units).items(), key=rank))


def tick(unit: str) -> float:
    """Return the seconds of a unit of time, which a number may precede."""
    number, _, name = unit.rpartition(" ")
    return float(number or 1.0) * TIME_FACTORS[name]


def seconds_and_fractions(names: Sequence[str | None]) -> dict[int, tuple[int, str]]:
    """Find pairs of columns of one clock by their names.

    Such are `stamp.secs` and `stamp.nsecs`, `sec` and `nanosec`, `Unix Time` and `Microseconds`.
    A column of seconds has that of its fractions, and what these are called (`FRACTIONS_S`).
    """
    pairs = {}
    candidates = (
        (fine, key, match)
        for fine, name in enumerate(names)
        for key, pattern in FRACTIONS.items()
        if (match := pattern.fullmatch(squash_name(name or "")))
    )
    for fine, key, match in candidates:
        whole = [
            k
            for k, column in enumerate(names)
            if k != fine
            and (m := SECONDS_SUFFIX.fullmatch(squash_name(column or "")))
            and m[1] == match[1]
        ]
        if len(whole) == 1:
            pairs[whole[0]] = fine, key
    return pairs


def fraction_of(grid: UnknownTable, clock: int) -> dict[str, int]:
    """Return the column of the fractions of a clock's seconds by its name; none of most."""
    return {key: fine for fine, key in [grid.fractions[clock]]} if clock in grid.fractions else {}


def _clock_unit(
    column: Array, longest_step: float, unnamed: bool, least_forward: float = LEAST_FORWARD
) -> str | None:
    """Return the time unit in which a column's steps are a clock's; None where it is none."""
    step = np.diff(column)
    forward = step[step > 0.0]
    if (
        forward.size < (least_forward if longest_step < 1.0 else 0.001) * step.size
        or forward.size < 5
        or (step < 0.0).mean() > 0.01
    ):
        return None
    typical = float(np.median(forward))
    if unnamed and (
        forward.size < 0.99 * step.size
        or np.mean(np.abs(forward - typical) < 0.5 * typical) < EVEN_SHARE
    ):
        return None
    span = float(column[-1] - column[0])
    if unnamed and span < 0.5 * typical * step.size:
        return None
    return next(
        (unit for unit, factor in TIME_FACTORS.items() if typical * factor <= longest_step), None
    )


def weeks(grid: UnknownTable) -> list[int]:
    """Find the columns that are GPS weeks."""
    out = []
    for k, name in enumerate(grid.names):
        column = grid.values[:, k]
        if name is not None and squash_name(name) not in WEEK_NAMES:
            continue
        is_week = np.ptp(column) <= 2 and (column == np.round(column)).all()
        if is_week and column.min() >= 500 and column.max() <= 4000:
            out.append(k)
    return out


def week_column(grid: UnknownTable) -> int | None:
    """Return the first column that is a GPS week, or None."""
    return next(iter(weeks(grid)), None)
