"""Text tables in and whole files out: the base of every text format.

The rules are those of `layout`.
"""

import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....base.errors import InputError
from ....base.files import lines_of
from ....base.inputs import BOM, open_bytes, readable
from ....base.wording import some
from ....records import Array
from .dates import is_date, joined_dates, seconds_of_dates, take_calendar
from .layout import (
    BINARY,
    NUMBER,
    TextLayout,
    decode,
    float_of,
    is_binary,
    is_comment,
    kinds_of_lines,
    quote,
    refuse_long,
    row_fields,
    sniff,
    unquote,
)
from .order import SHARE_LIMIT, AtLines
from .pieces import FileBytes, shrunk

Source = str | os.PathLike[str]
PRINT_FROM = 100_000  # numbers: of fewer Python prints as fast as a kernel is loaded
_PLAIN_FORMAT = re.compile(r"%(?:d|\.1?\df)(?:([ ,;\t])%(?:d|\.1?\df)(?:\1%(?:d|\.1?\df))*)?\n")
MOST_KINDS = 6  # of lines, in a message
AROUND_FAULT_BYTES = 1 << 16  # bytes before and behind a fault: its line is looked for there
TRUNCATED = "truncated: the file ends within this line; copy it again or delete the line"
PIECES_FROM = 1 << 22  # bytes of a file: a smaller one is simply read


@dataclass(frozen=True, eq=False)
class NumberTable(AtLines):
    """Numbers of a text table.

    Attributes
    ----------
    path : str
        The file.
    layout : TextLayout
        How it is written.
    values : ndarray
        (n, m) numbers; not-a-number where a field is none.
    lines : ndarray
        (n,) the line of each row, counted from 1.
    complete : bool
        Whether the last line has its end.
    bad : mapping
        For each column (from 0) with a field that is no number, the error of the first such field,
        in the order of the file.
    dates : frozenset
        Columns that hold dates; their values are seconds since 1970 (`dates`).
    blank : mapping
        For each column (from 0) whose fields that are no number are all empty, their number.
    left_out : tuple of int
        Lines of rows that were left out, since they lack a value.
    """

    path: str
    layout: TextLayout
    values: Array
    lines: NDArray[np.int64]
    complete: bool = True
    bad: Mapping[int, InputError] = field(default_factory=dict)
    dates: frozenset[int] = frozenset()
    blank: Mapping[int, int] = field(default_factory=dict)
    left_out: tuple[int, ...] = ()

    def __len__(self) -> int:
        return len(self.values)

    def floats(self, column: int) -> Array:
        """Return a column (n,)."""
        return np.ascontiguousarray(self.values[:, column])

    def refuse_text(self, columns: Iterable[int]) -> None:
        """Raise InputError at the first field in these columns that is no number."""
        taken = set(columns)
        for column, refusal in self.bad.items():
            if column in taken:
                raise refusal

    def with_values(self, columns: Iterable[int]) -> "NumberTable":
        """Return the rows that have values in these columns; InputError where too many lack one.

        A field that is neither a number nor empty is refused at its line.
        """
        lacking = [k for k in columns if k in self.bad]
        rows = np.isnan(self.values[:, lacking]).any(axis=1)
        if not set(lacking) <= self.blank.keys() or rows.sum() >= SHARE_LIMIT * len(self):
            self.refuse_text(lacking)
        if not lacking:
            return self
        bad = {k: refusal for k, refusal in self.bad.items() if k not in lacking}
        out, lines = tuple(self.lines[rows].tolist()), self.lines[~rows]
        return replace(self, values=self.values[~rows], lines=lines, bad=bad, left_out=out)


@dataclass(frozen=True, eq=False)
class TextTable(AtLines):
    """Fields of a text table as they stand; numbers are taken from single columns."""

    path: str
    layout: TextLayout
    rows: list[list[str]]
    lines: list[int]
    complete: bool = True

    def __len__(self) -> int:
        return len(self.rows)

    def strings(self, column: int) -> tuple[str, ...]:
        """Return a column as text, without quotation marks."""
        return tuple(unquote(row[column]) for row in self.rows)

    def floats(self, column: int) -> Array:
        """Return a column as numbers (n,); InputError with the line for what is none."""
        out = np.empty(len(self.rows))
        for i, row in enumerate(self.rows):
            out[i] = number(row[column].strip("\"'"), self.path, self.lines[i], self.layout.decimal)
        return out


def number(field: str, path: object, line: int, decimal: str = ".") -> float:
    """Return the finite float of `field`; InputError names file, line and the field."""
    if (x := float_of(field.strip(), decimal)) is not None:
        return x
    problem = f"{quote(field)} where a finite number must stand"
    raise InputError.at_line(path, line, f"{problem}; correct the line or choose another column")


@dataclass(frozen=True)
class FileLine:
    """A line of a file, which refuses what stands in it."""

    path: Source
    number: int

    def error(self, problem: str) -> InputError:
        """Return the error `problem` at the line."""
        return InputError.at_line(self.path, self.number, problem)

    def value(self, field: str) -> float:
        """Return the finite float of a field of the line; InputError for what is none."""
        return number(field, self.path, self.number)


def data_lines(path: Source, text: str, first: int = 1) -> Iterator[tuple[FileLine, str]]:
    """Yield the lines of a table that are neither empty nor comments, counted from `first`.

    They end with a line feed alone, as the kernels count them: a carriage return stays in its line.
    """
    for line, row in enumerate(text.split("\n"), first):
        if row.strip() and not is_comment(row):
            yield FileLine(path, line), row


def decode_text(path: Source) -> str:
    """Return the text of a file that is no table; InputError where it cannot be read."""
    return decode(load_bytes(path).tobytes())


def numbered_lines(text: str) -> list[tuple[int, str]]:
    """Return the lines that are neither empty nor comments with their numbers, for any line end."""
    lines = enumerate(lines_of(text), start=1)
    return [(line, row) for line, row in lines if row.strip() and not is_comment(row)]


def check_fields(path: Source, line: int, fields: Sequence[str], count: int, text: str) -> None:
    """Refuse a line that has another number of fields."""
    if len(fields) != count:
        problem = f"{len(fields)} fields, expected {count}: {quote(text)}"
        raise InputError.at_line(path, line, problem)


def load(path: Source) -> tuple[NDArray[np.uint8], bool]:
    """Return the bytes of a text file with a newline behind them, and whether its last line ended.

    A byte order mark is turned to blanks.
    """
    buf = load_bytes(path, 1)
    if bytes(buf[:2]) in (b"\xff\xfe", b"\xfe\xff"):
        raise InputError.at_line(path, 1, "is UTF-16 text; save it as UTF-8")
    if bytes(buf[:3]) == BOM:
        buf[:3] = ord(" ")
    buf[-1] = ord("\n")
    return buf, bool(buf[-2] == ord("\n"))


@contextmanager
def loaded(path: Source) -> Iterator[tuple[NDArray[np.uint8] | FileBytes, bool]]:
    """Give the bytes of `load`, of a large file those of `FileBytes`: no copy of it is made.

    A large file with a byte order mark or without a newline at its end is loaded all the same.
    """
    if not Path(path).is_file() or Path(path).stat().st_size < PIECES_FROM:
        yield load(path)
        return
    with FileBytes(path) as buf:
        bom = bytes(buf[:2]) in (b"\xff\xfe", b"\xfe\xff", b"\xef\xbb")
        plain = buf[buf.size - 1 : buf.size][0] == ord("\n") and not bom
        yield (buf, True) if plain else load(path)


def load_bytes(path: Source, room: int = 0) -> NDArray[np.uint8]:
    """Return the bytes of a file, not empty, with `room` more behind them."""
    path = Path(path)
    if not path.exists():
        raise InputError.in_file(path, "no such file; check the path")
    with readable(path), open_bytes(path) as stream:
        size = os.fstat(stream.fileno()).st_size
        buf = np.empty(size + room, dtype=np.uint8)
        count = stream.readinto(buf.data[:size])
    if size == 0:
        raise InputError.in_file(path, "is empty; copy it again from its source")
    if count < size:
        raise shrunk(path, count, size)
    return buf


def read_table(path: Source, whole: bool = True) -> NumberTable:
    """Read a table of numbers; InputError with the first bad line.

    Parameters
    ----------
    path : path
        The file.
    whole : bool
        Every field must be a number; else only rows of another length are refused, and
        `NumberTable.bad` reports what is no number.
    """
    buf, complete = load(path)
    return parse(path, buf, complete, sniff(path, buf), whole)


class Parsed(NamedTuple):
    """Lines of a table as a kernel parsed them.

    Attributes
    ----------
    values : ndarray
        (n, m) numbers, up to the first line that is no row.
    lines : ndarray
        (n,) their lines.
    bad : ndarray
        (m, 2) offset and line of the first field of each column that is no number, -1 for none.
    status, offset, line : int
        What is wrong with the first line that is no row, and where it stands.
    """

    values: Array
    lines: NDArray[np.int64]
    bad: NDArray[np.int64]
    status: int
    offset: int
    line: int

    @property
    def is_whole(self) -> bool:
        """Whether every line is a row."""
        from . import _kernels

        return self.status == _kernels.OK


def parsed_rows(
    buf: NDArray[np.uint8], layout: TextLayout, count: int, start: int = 0, first_line: int = 1
) -> Parsed:
    """Parse at most `count` rows of bytes that end in a newline, from the offset `start` on."""
    from . import _kernels

    values, lines = np.empty((count, layout.n_fields)), np.empty(count, dtype=np.int64)
    bad = np.full((layout.n_fields, 2), -1, dtype=np.int64)
    delimiter = _kernels.WHITESPACE if layout.delimiter is None else ord(layout.delimiter)
    # without the compiler: a mantissa of more than 18 digits wraps and is taken again
    with np.errstate(over="ignore"):
        rows, status, offset, line = _kernels.parse_rows(
            buf, start, first_line, delimiter, ord(layout.decimal), values, lines, bad
        )
    return Parsed(values[:rows], lines[:rows], bad, status, offset, line)


def parse(
    path: Source, buf: NDArray[np.uint8], complete: bool, layout: TextLayout, whole: bool = True
) -> NumberTable:
    """Parse the numbers of `buf`, which ends in a newline, from the layout's first data line on."""
    from . import _kernels

    rows = parsed_rows(buf, layout, _kernels.count_newlines(buf), layout.skip_to, layout.first_line)
    at_fault = sorted((int(start), int(k)) for k, start in enumerate(rows.bad[:, 0]) if start >= 0)
    refused = {
        k: _refusal(path, buf, complete, layout, _kernels.BAD_NUMBER, start, int(rows.bad[k, 1]))
        for start, k in (at_fault[:1] if whole else at_fault)
    }
    if refused and whole:
        raise next(iter(refused.values()))
    if not rows.is_whole:
        raise _refusal(path, buf, complete, layout, rows.status, rows.offset, rows.line)
    if not complete:
        tail = decode(bytes(buf[-8192:])).split("\n", int(buf.size > 8192))[-1]
        _refuse_short_end(path, tail, layout, rows.line - 1)
    dates = take_calendar(layout.header_fields, rows.values)
    dates |= _take_dates(buf, layout, rows.values, refused) if refused else frozenset()
    refused = {k: refusal for k, refusal in refused.items() if k not in dates}
    blank = _blank(buf, layout, rows.values, refused)
    return NumberTable(str(path), layout, rows.values, rows.lines, complete, refused, dates, blank)


def _blank(
    buf: NDArray[np.uint8], layout: TextLayout, values: Array, columns: Iterable[int]
) -> dict[int, int]:
    """Return the number of empty fields of each column that has no other without a number."""
    numbers = {k: np.flatnonzero(np.isnan(values[:, k])) for k in columns}
    rows = _fields_of(buf, layout) if numbers else []
    return {
        k: missing.size
        for k, missing in numbers.items()
        if len(rows) == len(values) and not any(rows[row][k] for row in missing.tolist())
    }


def _take_dates(
    buf: NDArray[np.uint8], layout: TextLayout, values: Array, columns: Iterable[int]
) -> frozenset[int]:
    """Put seconds since 1970 into the columns of `values` that hold dates; return these columns."""
    of_dates = set[int]()
    rows = _fields_of(buf, layout)
    if len(rows) != len(values) or not rows:
        return frozenset()
    texts = {k: [row[k] for row in rows] for k in columns}
    for k, day in list(texts.items()):
        later = (c for c in texts if c != k)
        if match := next(((c, d) for c in later if (d := joined_dates(day, texts[c]))), None):
            texts[match[0]] = match[1]
    for k, fields in texts.items():
        if is_date(fields[0]) and (seconds := seconds_of_dates(fields)) is not None:
            values[:, k] = seconds
            of_dates.add(k)
    return frozenset(of_dates)


def _fields_of(buf: NDArray[np.uint8], layout: TextLayout) -> list[list[str]]:
    """Fields of each line from the layout's first data line on."""
    text = decode(bytes(buf[layout.skip_to : -1]))
    return [row_fields(row, layout) for _, row in data_lines("", text)]


def _like_it(buf: NDArray[np.uint8], layout: TextLayout, advice: str) -> str:
    """Say how many data lines have another number of fields, where it is more than one; and advice.

    Of lines that each begin with one of a few words, as loggers of several sensors write them, say
    what belongs to each.
    """
    rows = _fields_of(buf, layout)
    uneven = sum(len(row) != layout.n_fields for row in rows)
    if uneven < 2:
        return f"; {advice}"
    if kinds := kinds_of_lines(rows):
        named = some(sorted(kinds), MOST_KINDS)
        return f"; it has lines of {len(kinds)} kinds, {named}: write each to a file of its own"
    other_lines = f"{uneven} of {len(rows)} lines have another number of fields"
    return f"; {other_lines} than {layout.n_fields}; {advice}"


def _refusal(
    path: Source,
    buf: NDArray[np.uint8],
    complete: bool,
    layout: TextLayout,
    status: int,
    offset: int,
    line: int,
) -> InputError:
    """Return what is wrong with the line around `offset`."""
    from . import _kernels

    at_the_line = FileLine(path, line)
    near = max(0, offset - AROUND_FAULT_BYTES)
    before = bytes(buf[near:offset]).rpartition(b"\n")[2]
    after = bytes(buf[offset : offset + AROUND_FAULT_BYTES])
    behind = after.partition(b"\n")[0]
    text = decode(before + behind).strip("\r\n")
    fields = row_fields(text, layout)
    quoted, advice = quote(text), "correct or delete the line"
    if is_binary(text):
        quoted, advice = ascii(text[:10]) + "...", BINARY
    last = offset + len(behind) + 1 >= buf.size and not complete
    short = len(fields) <= layout.n_fields and status != _kernels.TOO_MANY
    if last and short and not is_binary(text):
        problem = f"truncated: the file ends within this line, {quoted}"
        return at_the_line.error(f"{problem}; copy it again or delete the line")
    if max(len(before), len(behind)) == AROUND_FAULT_BYTES:
        problem = f"a line of more than {AROUND_FAULT_BYTES} bytes with a missing or wrong number"
        return at_the_line.error(f"{quoted}, {problem}; {advice}")
    if status != _kernels.BAD_NUMBER or len(fields) != layout.n_fields:
        problem = f"{len(fields)} fields, expected {layout.n_fields}: {quoted}"
        return at_the_line.error(f"{problem}{_like_it(buf, layout, advice)}")
    prefix = decode(before)
    column = len(prefix.split()) if layout.delimiter is None else prefix.count(layout.delimiter)
    field = quote(fields[column]) if column < len(fields) and fields[column] else "nothing"
    problem = f"{field} in field {column + 1} where a finite number must stand"
    return at_the_line.error(f"{problem}: {quoted}; {advice}")


def _refuse_short_end(path: Source, tail: str, layout: TextLayout, line: int) -> None:
    """Refuse a last line without newline whose last number seems cut.

    It has fewer decimals than in all of the ten lines before, or the last field is empty.
    """
    rows = [row_fields(text, layout) for _, text in data_lines(path, tail)]
    if rows and len(rows[-1]) == layout.n_fields and not rows[-1][-1]:
        raise InputError.at_line(path, line, TRUNCATED)
    *earlier, last = [row[-1] for row in rows if NUMBER.fullmatch(row[-1])] or [""]
    decimals = {len(field.partition(layout.decimal)[2]) for field in earlier[-10:]}
    if (
        len(decimals) == 1
        and len(earlier) >= 2
        and len(last.partition(layout.decimal)[2]) < decimals.pop()
    ):
        message = (
            f"truncated: the file ends within a number, {quote(last)} after {quote(earlier[-1])};"
            " copy it again or delete the line"
        )
        raise InputError.at_line(path, line, message)


def read_text_table(path: Source) -> TextTable:
    """Read a table with columns of text, such as image names; for files of some thousand lines."""
    from . import _kernels

    buf, complete = load(path)
    layout = sniff(path, buf)
    rows, lines = [], []
    content = decode(bytes(buf[layout.skip_to : -1]))
    for at_line, text in data_lines(path, content, layout.first_line):
        line = at_line.number
        refuse_long(path, line, text)
        fields = row_fields(text, layout)
        if len(fields) != layout.n_fields:
            status = _kernels.TOO_MANY if len(fields) > layout.n_fields else _kernels.TOO_FEW
            ends = np.flatnonzero(buf == ord("\n"))
            offset = int(ends[line - 2]) + 1 if line > 1 else 0
            raise _refusal(path, buf, complete, layout, status, offset, line)
        rows.append(fields)
        lines.append(line)
    if not complete:
        _refuse_short_end(path, content, layout, lines[-1])
    return TextTable(str(path), layout, rows, lines, complete)


def format_rows(form: str, table: Array, chunk: int = 20000) -> Iterable[str]:
    """Yield rows of `table` (n, m) by the % format of one row (with its newline), in chunks.

    Large tables of plain numbers, such as "%d,%.6f,%.3f", are printed by a kernel, to the same
    bytes.
    """
    plain = _PLAIN_FORMAT.fullmatch(form)
    if plain is None or table.size < PRINT_FROM or os.environ.get("NUMBA_DISABLE_JIT", "0") != "0":
        for first in range(0, len(table), chunk):
            block = table[first : first + chunk]
            yield form * len(block) % tuple(block.ravel().tolist())
        return
    from . import _kernels

    sign = plain[1] or "\n"
    wanted = form.removesuffix("\n").split(sign)
    decimals = np.array([-1 if x == "%d" else int(x[2:-1]) for x in wanted], dtype=np.int64)
    out = np.empty(chunk * decimals.size * _kernels.PRINTED, dtype=np.uint8)
    for first in range(0, len(table), chunk):
        block, row = np.ascontiguousarray(table[first : first + chunk], dtype=np.float64), 0
        while row < len(block):
            row, length = _kernels.print_rows(block, row, decimals, ord(sign), ord("\n"), out)
            yield out[:length].tobytes().decode("ascii")
            if row < len(block):
                yield form % tuple(block[row].tolist())
                row += 1
