"""Columns of a large text table straight into the arrays of a record, in two threads.

The table is cut behind line ends into pieces that a processor's cache holds. Each thread takes the
next piece, whose lines are counted there and then, so that the place of its rows is known; parses
it into a table of that piece and puts the columns where they belong. So the file is read once,
there is one copy of the numbers, and of a large file no more than a piece a thread is in memory.
How many rows there will be is guessed by the length of the first lines, with some room; where they
are more after all, all lines are counted first.
Pieces with lines that are no rows leave holes, which are closed at the end.

Nothing is decided here: where anything is not as it should be, in whatever piece, None is returned
and `text.parse` reads the file from its beginning, row by row, and says what and where.
"""

import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....base.advance import share
from ....base.errors import InputError
from ....base.inputs import open_bytes
from ....records import Array
from .layout import TextLayout, decode, is_comment
from .pieces import FileBytes
from .text import parsed_rows

Bytes = NDArray[np.uint8] | FileBytes

PIECE_BYTES = 1 << 19  # bytes of a piece: a processor's cache holds it and its numbers (chosen)
THREADS = 2  # threads that parse pieces: more wait for memory (chosen)
ROOM = 1.1  # times the rows that the first lines promise: later lines may be shorter (chosen)
NEWLINE = b"\n"
Wanted = Mapping[str, Sequence[tuple[int | None, float]]]
"""Columns of each array by its name: column of the table, None for zeros, and its factor."""


@dataclass(frozen=True)
class DirectRows:
    """Rows of a file that were read without keeping their lines, which are looked for on demand.

    `complete` tells whether the last line has its end.
    """

    path: str
    layout: TextLayout
    complete: bool = True

    def error_at(self, row: int, message: str) -> InputError:
        """The error `message` at the line of `row`."""
        with open_bytes(self.path) as stream:
            stream.seek(self.layout.skip_to)
            remaining = row
            for line, raw in enumerate(stream, start=self.layout.first_line):
                text = decode(raw)
                if text.strip() and not is_comment(text):
                    if remaining == 0:
                        return InputError.at_line(self.path, line, message)
                    remaining -= 1
        return InputError.in_file(self.path, message)


def read_columns(buf: Bytes, layout: TextLayout, wanted: Wanted) -> dict[str, Array] | None:
    """Return columns of a table in arrays of their own; None where a row is not as it should be.

    Parameters
    ----------
    buf : ndarray or FileBytes
        Bytes of the file, which end in a newline.
    layout : TextLayout
        How it is written.
    wanted : mapping
        The arrays; other columns of the table are parsed and dropped.

    Returns
    -------
    dict of ndarray, or None
        The arrays (n, width) by name.
    """
    work = _Work(buf, layout, wanted)
    arrays = work.arrays(work.promised())
    if work.full:
        arrays = work.arrays(work.lines())
    return arrays


def _columns(
    array: Sequence[tuple[int | None, float]],
) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
    """Return columns of the table, their columns in an array, and their factors."""
    taken = [(column, k, factor) for k, (column, factor) in enumerate(array) if column is not None]
    columns, places, factors = zip(*taken, strict=True) if taken else ((), (), ())
    return np.array(columns, np.int64), np.array(places, np.int64), np.array(factors, np.float64)


class _Piece(NamedTuple):
    """Bytes that end in a newline, where they begin, and the lines before them and in them."""

    buf: NDArray[np.uint8]
    start: int
    first: int
    lines: int


class _Work:
    """A buffer, whose pieces threads parse one after the other until one of them says stop."""

    def __init__(self, buf: Bytes, layout: TextLayout, wanted: Wanted) -> None:
        self.buf, self.layout, self.wanted = buf, layout, wanted
        self.columns = {name: _columns(array) for name, array in wanted.items()}
        self.stopped, self.full = threading.Event(), False

    def pieces(self) -> Iterator[_Piece]:
        """Yield the pieces in order."""
        from . import _kernels

        start, first = self.layout.skip_to, 0
        while start < self.buf.size:
            size, end = PIECE_BYTES, 0
            while not end:
                piece = self.buf[start : start + size]
                whole = start + size >= self.buf.size
                end = piece.size if whole else piece.tobytes().rfind(NEWLINE) + 1
                size *= 2
            lines = int(_kernels.count_newlines(piece[:end]))
            yield _Piece(piece[:end], start, first, lines)
            start, first = start + end, first + lines

    def promised(self) -> int:
        """Rows that the first piece promises, with some room."""
        first = next(self.pieces(), None)
        if first is None:
            return 0
        pieces_left = (self.buf.size - first.start) / first.buf.size
        return first.lines if pieces_left <= 1.0 else int(ROOM * pieces_left * first.lines) + 1

    def lines(self) -> int:
        """All lines, counted."""
        return sum(piece.lines for piece in self.pieces())

    def arrays(self, room: int) -> dict[str, Array] | None:
        """The arrays, of at most `room` lines; None where a row is not as it should be.

        Where there are more lines, `full` is set.
        """
        from . import _kernels

        self.stopped, self.full = threading.Event(), False
        arrays = {name: np.empty((room, len(array))) for name, array in self.wanted.items()}
        for name, array in self.wanted.items():
            arrays[name][:, [k for k, (column, _) in enumerate(array) if column is None]] = 0.0
        placed: list[tuple[int, int]] = []  # first row and rows of each piece

        def parse(piece: _Piece) -> None:
            share(piece.start / self.buf.size)
            if piece.first + piece.lines > room:
                self.full = True
                self.stopped.set()
                return
            table = self.parsed(piece)
            if table is None:
                self.stopped.set()
                return
            placed.append((piece.first, len(table)))
            block = slice(piece.first, piece.first + len(table))
            for name, taken in self.columns.items():
                _kernels.take_columns(table, *taken, arrays[name][block])

        share(0.0)
        self.all(parse)
        if self.stopped.is_set():
            return None
        placed.sort()
        return {name: _without_holes(array, placed) for name, array in arrays.items()}

    def parsed(self, piece: _Piece) -> Array | None:
        """The rows (n, m) of a piece; None where one is not as it should be."""
        parsed = parsed_rows(piece.buf, self.layout, piece.lines)
        if not parsed.is_whole or any(
            (parsed.bad[k, 0] >= 0).any() for k, *_ in self.columns.values()
        ):
            return None
        return parsed.values

    def all(self, job: Callable[[_Piece], None]) -> None:
        """Do `job` for each piece; the first exception of a thread is raised here."""
        todo, lock = self.pieces(), threading.Lock()

        def work() -> None:
            while not self.stopped.is_set():
                try:
                    with lock:
                        piece = next(todo, None)
                    if piece is None:
                        return
                    job(piece)
                except BaseException:
                    self.stopped.set()
                    raise

        several = self.buf.size - self.layout.skip_to > PIECE_BYTES
        with ThreadPoolExecutor(THREADS) as pool:  # besides them, this thread works
            helpers = [pool.submit(work) for _ in range(THREADS - 1 if several else 0)]
            work()
            for helper in helpers:
                helper.result()


def _without_holes(array: Array, placed: Sequence[tuple[int, int]]) -> Array:
    """The rows without the holes behind those of each piece, in the same memory."""
    end = 0
    for start, count in placed:
        if end < start:
            array[end : end + count] = array[start : start + count].copy()
        end += count
    return array[:end]
