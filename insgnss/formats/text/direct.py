"""Columns of a large text table straight into the arrays of a record, in two threads.

The table is cut behind line ends into pieces that a processor's cache holds. A first pass counts
the lines of each, so that the place of every row is known; then each thread takes the next piece,
parses it into a table of that piece and puts the columns where they belong. So there is one copy of
the numbers, and of a large file no more than a piece a thread is in memory.
Pieces with lines that are no rows leave holes, which are closed at the end.

Nothing is decided here: where anything is not as it should be, in whatever piece, None is returned
and `text.parse` reads the file from its beginning, row by row, and says what and where.
"""

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...base.advance import share
from ...base.errors import InputError
from .layout import Layout, decode, is_comment
from .pieces import FileBytes

Array = NDArray[np.float64]
Bytes = NDArray[np.uint8] | FileBytes

PIECE = 1 << 18  # bytes
THREADS = 2


@dataclass(frozen=True)
class Target:
    """Where a column goes: into column `index` of `array` (n, m), each value times `factor`."""

    array: str
    index: int
    factor: float = 1.0


@dataclass(frozen=True)
class Rows:
    """Rows of a file that were read without keeping their lines, which are looked for on demand."""

    path: str
    layout: Layout

    def error_at(self, row: int, message: str) -> InputError:
        """The error `message` at the line of `row`."""
        with Path(self.path).open("rb") as stream:
            stream.seek(self.layout.skip_to)
            left = row
            for line, raw in enumerate(stream, start=self.layout.first_line):
                text = decode(raw)
                if text.strip() and not is_comment(text):
                    if left == 0:
                        return InputError.at_line(self.path, line, message)
                    left -= 1
        return InputError.at_line(self.path, None, message)


def read_columns(
    buf: Bytes, layout: Layout, targets: Mapping[int, Target], widths: Mapping[str, int]
) -> dict[str, Array] | None:
    """Return columns of a table in arrays of their own; None where a row is not as it should be.

    Parameters
    ----------
    buf : ndarray or FileBytes
        Bytes of the file, which end in a newline.
    layout : Layout
        How it is written.
    targets : mapping
        Where each column goes, by its index; the others are parsed and dropped.
    widths : mapping
        Columns of each array, by its name.

    Returns
    -------
    dict of ndarray, or None
        The arrays (n, width) by name.
    """
    from . import _kernels

    ends = _ends(buf, layout.skip_to)
    work = _Work(buf, layout, targets, ends)
    newlines = np.zeros(ends.size, dtype=np.int64)

    def count(k: int) -> None:
        newlines[k] = _kernels.count_newlines(work.piece(k))

    work.all(count)
    first = np.concatenate([[0], np.cumsum(newlines)])
    arrays = {name: np.empty((int(first[-1]), width)) for name, width in widths.items()}
    columns = {name: _columns(targets, name) for name in widths}
    rows = np.zeros(ends.size, dtype=np.int64)

    def parse(k: int) -> None:
        share(k / ends.size)
        table = work.parsed(k, int(newlines[k]))
        if table is None:
            work.stopped.set()
            return
        rows[k] = len(table)
        block = slice(int(first[k]), int(first[k]) + len(table))
        for name, taken in columns.items():
            _kernels.take_columns(table, *taken, arrays[name][block])

    share(0.0)
    work.all(parse)
    if work.stopped.is_set():
        return None
    return {name: _without_holes(array, first, rows) for name, array in arrays.items()}


def _columns(
    targets: Mapping[int, Target], name: str
) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
    """Return columns of the table, their columns in an array of so many, and their factors."""
    own = [(column, target) for column, target in targets.items() if target.array == name]
    return (
        np.array([column for column, _ in own], dtype=np.int64),
        np.array([target.index for _, target in own], dtype=np.int64),
        np.array([target.factor for _, target in own], dtype=np.float64),
    )


@dataclass
class _Work:
    """Pieces of a buffer, done by threads one after the other until one of them says stop."""

    buf: Bytes
    layout: Layout
    targets: Mapping[int, Target]
    ends: NDArray[np.int64]

    def __post_init__(self) -> None:
        self.stopped = threading.Event()

    def piece(self, k: int) -> NDArray[np.uint8]:
        return self.buf[self.layout.skip_to if k == 0 else self.ends[k - 1] : self.ends[k]]

    def parsed(self, k: int, lines: int) -> Array | None:
        """The rows (n, m) of a piece of so many lines; None where one is not as it should be."""
        from . import _kernels

        layout = self.layout
        table = np.empty((lines, layout.n_fields))
        bad = np.full((layout.n_fields, 2), -1, dtype=np.int64)
        delimiter = _kernels.WHITESPACE if layout.delimiter is None else ord(layout.delimiter)
        # without the compiler: a mantissa of more than 18 digits wraps and is taken again
        with np.errstate(over="ignore"):
            rows, status, _, _ = _kernels.parse_rows(
                self.piece(k),
                *(0, 1, delimiter, ord(layout.decimal)),
                *(table, np.empty(lines, dtype=np.int64), bad),
            )
        if status != _kernels.OK or any(bad[column, 0] >= 0 for column in self.targets):
            return None
        return table[:rows]

    def all(self, job: Callable[[int], None]) -> None:
        """Do `job` for each piece; the first exception of a thread is raised here."""
        todo = iter(range(self.ends.size))
        lock, failed = threading.Lock(), list[BaseException]()

        def work() -> None:
            while not self.stopped.is_set():
                with lock:
                    k = next(todo, None)
                if k is None:
                    return
                try:
                    job(k)
                except BaseException as error:
                    failed.append(error)
                    self.stopped.set()

        threads = [threading.Thread(target=work) for _ in range(min(THREADS, self.ends.size) - 1)]
        for thread in threads:
            thread.start()
        work()
        for thread in threads:
            thread.join()
        if failed:
            raise failed[0]


def _ends(buf: Bytes, start: int) -> NDArray[np.int64]:
    """Ends of the pieces from `start` on, each behind a newline."""
    ends = []
    while start < buf.size:
        end = min(start + PIECE, buf.size)
        while end < buf.size and buf[end - 1 : end][0] != ord("\n"):
            near = bytes(buf[end : end + 4096]).find(b"\n")
            end = min(end + 4096, buf.size) if near < 0 else end + near + 1
        ends.append(end)
        start = end
    return np.array(ends, dtype=np.int64)


def _without_holes(array: Array, first: NDArray[np.int64], rows: NDArray[np.int64]) -> Array:
    """The rows without the holes behind those of each piece, in the same memory."""
    if int(rows.sum()) == len(array):
        return array
    end = 0
    for start, count in zip(first[:-1].tolist(), rows.tolist(), strict=True):
        if end < start:
            array[end : end + count] = array[start : start + count].copy()
        end += count
    return array[:end]
