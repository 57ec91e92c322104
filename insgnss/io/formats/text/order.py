"""Each stamp once, and in order: one rule for double, late or contradicting rows in all readers.

    a row like an earlier one in every value      left out and counted
    a row before its place, by less than 1 s      put in order and counted, where these are fewer
                                                  than 1 % of the rows
    another row of a stamp that is there already  left out and counted, where these are fewer than 1
                                                  % of the rows

and everything beyond is refused at the first such row. What was done is a note of the record.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ....base.errors import InputError
from ....records import Array, Finding, Question

Rows = NDArray[np.intp]

# lateness (s) of a row that is put in order: more is a clock that was set back (chosen)
LATE_LIMIT_S = 1.0
# share of rows that are put in order or left out: more is another fault (chosen)
SHARE_LIMIT = 0.01


class Lines(Protocol):
    """Rows of a file, which report errors at their lines."""

    @property
    def path(self) -> str:
        """The file."""
        ...

    def error_at(self, row: int, message: str, /) -> InputError:
        """Return the error `message` at the line of `row`."""
        ...


class AtLines:
    """Rows of a file, each at its line, for records that hold both."""

    path: str
    lines: Any

    def error_at(self, row: int, message: str) -> InputError:
        """Return the error `message` at the line of `row`."""
        return InputError.at_line(self.path, int(self.lines[row]), message)


@dataclass(frozen=True)
class Picked:
    """Rows that were picked out of others."""

    lines: Lines
    rows: Rows

    @property
    def path(self) -> str:
        """The file."""
        return self.lines.path

    def error_at(self, row: int, message: str) -> InputError:
        """Return the error `message` at the line of `row`."""
        return self.lines.error_at(int(self.rows[row]), message)


@dataclass(frozen=True)
class NumberedRows:
    """Rows of a table without lines (records, messages of a log), counted from 1."""

    path: str
    kind: str = "row"

    def error_at(self, row: int, message: str) -> InputError:
        """Return the error `message` at a row."""
        return InputError(f"{self.path}: {self.kind} {row + 1}: {message}")


def refuse_rows(
    lines: Lines, bad: NDArray[np.bool_], message: str, *values: NDArray[np.generic]
) -> None:
    """Refuse the first bad row, at its line.

    Parameters
    ----------
    lines : Lines
        Where the rows stand.
    bad : ndarray of bool
        (n,) which rows are bad.
    message : str
        What is wrong, with a format field for each of the values.
    *values : ndarray
        (n,) each.

    Raises
    ------
    InputError
        Where a row is bad.
    """
    if bad.any():
        row = int(np.argmax(bad))
        raise lines.error_at(row, message.format(*(column[row] for column in values)))


def note(
    name: str,
    finding: str,
    expected: str = "each stamp once, in order",
    advice: str = "check the logger, or how the file was put together",
    topic: str = "",
) -> Finding:
    """Return a note on what a reader left out or sorted."""
    return Question(name, expected, topic).note(finding, advice)


def open_end(name: str, complete: bool) -> tuple[Finding, ...]:
    """Return the note on a text file whose last line has no end; none where it has.

    Such a line may have been cut in a number.
    """
    finding = "the last line has no line break, so it may be incomplete"
    advice = "compare this line with the one before, and end it with a line break"
    return () if complete else (note(name, finding, "a line break at the end", advice),)


def put_in_order(
    lines: Lines, time: Array, same: Callable[[int, int], bool], name: str
) -> tuple[Rows | None, tuple[Finding, ...]]:
    """Return the rows to take, in order of time, or None for all as they stand; and the notes.

    Parameters
    ----------
    lines : Lines
        Where the rows stand, for refusals.
    time : ndarray
        (n,) s.
    same : callable
        Tells whether two rows agree in every value.
    name : str
        Name of the notes, such as "IMU rows".

    Raises
    ------
    InputError
        The first row beyond the limits.
    """
    if time.size < 2 or (time[1:] > time[:-1]).all():
        return None, ()
    order = np.argsort(time, kind="stable")
    keep, clashes, doubles, first = np.ones(time.size, dtype=bool), [], 0, int(order[0])
    for row in order[1:].tolist():
        if time[row] != time[first]:
            first = row
            continue
        keep[row] = False
        if same(first, row):
            doubles += 1
        else:
            clashes.append((row, first))
    _refuse_out_of_order(lines, time, keep)
    if len(clashes) >= SHARE_LIMIT * time.size:
        row, first = min(clashes)
        message = (
            f"time {time[row]:.6f} s follows {time[first]:.6f} s with other values, as in"
            f" {len(clashes)} of {time.size} rows"
        )
        remedy = "keep one row for each time, or take the time from another column"
        if row > 0 and (back := time[row - 1] - time[row]) > 0.0:
            message = (
                f"the clock goes back by {back:.6f} s here, to {time[row]:.6f} s, and"
                f" {len(clashes)} of {time.size} rows have the stamp of an earlier one"
            )
            later = f"add {back:.6f} s and one interval to all times from here on"
            remedy = f"split the file here, or {later}"
        raise lines.error_at(
            row, f"{message} (limit {SHARE_LIMIT:.0%}); time must increase; {remedy}"
        )
    done = [f"{doubles} double rows left out"] if doubles else []
    if clashes:
        done.append(
            f"{len(clashes)} rows left out that contradict an earlier row of their time, the first"
            f" at {time[min(clashes)[0]]:.3f} s"
        )
    out_of_order = keep & (time < np.maximum.accumulate(np.where(keep, time, -np.inf)))
    done += [f"{out_of_order.sum()} out-of-order rows sorted"] if out_of_order.any() else []
    return order[keep[order]], (note(name, f"{', '.join(done)}, of {time.size}"),)


def _refuse_out_of_order(lines: Lines, time: Array, keep: NDArray[np.bool_]) -> None:
    """Refuse rows that stand behind later ones by too much, or too many."""
    rows = np.flatnonzero(keep)
    kept = time[rows]
    by = np.maximum.accumulate(kept) - kept
    out_of_order = by > 0.0
    if not out_of_order.any():
        return
    worst = int(np.argmax(by))
    if by[worst] >= LATE_LIMIT_S or out_of_order.sum() >= SHARE_LIMIT * time.size:
        k = int(np.argmax(by >= LATE_LIMIT_S if by[worst] >= LATE_LIMIT_S else out_of_order))
        before = float(np.maximum.accumulate(kept)[k])
        message = (
            f"time {kept[k]:.6f} s follows {before:.6f} s; time must increase; {out_of_order.sum()}"
            f" of {time.size} rows are out of order"
        )
        limits = f"limits {LATE_LIMIT_S:.0f} s and {SHARE_LIMIT:.0%}"
        raise lines.error_at(
            int(rows[k]),
            f"{message}, by up to {by[worst]:.3f} s ({limits}); sort the file, or add"
            f" {by[k] + float(np.median(np.diff(kept))):.3f} s to the rows from here on if the"
            " clock was set",
        )


def first_repeat(*keys: NDArray[np.int64]) -> tuple[int, int] | None:
    """Return the first row whose keys stood in an earlier one, and that; None where all differ.

    Parameters
    ----------
    *keys : ndarray of int, (n,)
        The keys of each row.

    Returns
    -------
    tuple of int, optional
        The earlier row and the row.
    """
    order = np.lexsort(keys)
    twice = np.all([np.diff(key[order]) == 0 for key in keys], axis=0)
    if not twice.any():
        return None
    k = int(np.flatnonzero(twice)[np.argmin(order[1:][twice])])
    return int(order[k]), int(order[k + 1])
