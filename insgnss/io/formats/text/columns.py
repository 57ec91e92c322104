"""What a text table holds: its columns by name, their units, and how it is read and written.

A format of text has one `TableSpec`: the names of its columns, which of them it must have, their
units, the layouts without a header. `TableSpec.read` gives a `NamedTable`, whose methods take
columns and refuse rows, each at its line. A column gets its name from the caller's `columns`, else
from the header, else from the documented layout of the format. A header that does not name what is
needed is an error that prints it; names are never guessed from values. `TableOut` writes a table.
"""

import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ....base.errors import InputError, UsageError, near
from ....base.files import atomic_write
from ....base.wording import fill_in, spell
from ....records import Array, Finding
from ..names import Names, taken_by_readers
from .clock import examined_time, gps_time
from .dates import UNIX as DATES_UNIT
from .direct import DirectRows
from .headers import KIND_OF, SENSORS, Kinds, Settled, names_of, normalise_header, settled_units
from .layout import TextLayout, quote
from .order import first_repeat, note, open_end, refuse_rows
from .text import NumberTable, Source, TextTable, format_rows, read_table, read_text_table
from .units import check_units

Columns = Sequence[str] | Mapping[str, str] | None
DATES_FOR_STAMPS = (
    "the stamps are dates and were taken as UTC",
    "the time scale of the stamps",
    "if they are of another time scale, give times in seconds, or set time_offset_s",
)
METRES = "m metre metres meter meters"  # spellings of a unit, as `TableSpec.strict` has them


@dataclass(frozen=True, eq=False)
class TableSpec:
    """What a text table holds.

    Attributes
    ----------
    names : mapping
        The names that a header may give a column, by its canonical name (`formats.names`).
    required : str
        Canonical names of the columns that it must have, blanks between them.
    layouts : tuple of str
        The columns of a file without a header, distinguished by their number.
    units : mapping
        The columns of each key of the option `units`.
    record : str
        What its rows are of, for the names of notes: "GNSS".
    text : bool
        Whether columns hold text, such as names of images.
    strict : str
        Spellings of the units that may stand in brackets behind a name. Where there are any, a
        column that nobody knows is refused: left out, a misspelled standard deviation would become
        the default one.
    ignored : mapping
        Names of columns that a strict table may have beside one of a name, and that are not read.
    """

    names: Names
    required: str = ""
    layouts: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)
    record: str = ""
    text: bool = False
    strict: str = ""
    ignored: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def exactly(cls, columns: str, text: bool = False) -> "TableSpec":
        """Return the specification of a table that has these columns under these names."""
        return cls({name: name for name in columns.split()}, columns, (columns,), text=text)

    @cached_property
    def aliases(self) -> dict[str, str]:
        """Canonical name by each name of a header."""
        return {alias: name for name, row in self.names.items() for alias in taken_by_readers(row)}

    @cached_property
    def kinds(self) -> Kinds:
        """Kinds of the units that may stand behind the name of each column."""
        return {
            name: (key, f"{key} increment") if key in SENSORS else (KIND_OF.get(key, key),)
            for key, columns in self.units.items()
            for name in columns.split()
        }

    def named(self, fields: Sequence[str]) -> list[str | None]:
        """Return what the reader takes each field of a header for."""
        return names_of(fields, self.aliases, self.kinds)

    def index(self, path: str, layout: TextLayout, columns: Columns = None) -> dict[str, int]:
        """Return the index of every known column by its canonical name.

        Parameters
        ----------
        path : str
            The file, for messages.
        layout : TextLayout
            How it is written.
        columns : sequence or mapping, optional
            Canonical name of each column, "-" or any other name leaving one out; or canonical name
            to name in the header, or to its index, "[1]" for the first.

        Raises
        ------
        InputError
            A required name that is missing or ambiguous, or a number of fields that does not fit.
        """
        assigned, source = self._assigned(path, layout, columns)
        index = {name: i for i, name in enumerate(assigned) if name is not None}
        twice = next((name for name in index if assigned.count(name) > 1), None)
        missing = [name for name in self.required.split() if name not in index]
        if twice or missing:
            why = f"names {twice} twice" if twice else f"does not name {', '.join(missing)}"
            line = None if columns is not None else layout.header_line
            how = (
                f"set {_list_columns()} of {', '.join(self.names)}, with '-' for what is to be left"
                f" out, or {fill_in('columns {...}', COLUMNS_EXAMPLE)}"
            )
            raise UnnamedColumns.at_line(path, line, f"{source} {why}", how)
        header = layout.header_fields or () if self.strict else ()
        beside = (self.ignored.get(normalise_header(name)[0], "") for name in header)
        ignored = " ".join(beside).split()
        for k, title in enumerate(header):
            name, unit = normalise_header(title)
            if k in index.values() and unit and unit.lower() not in (units := self.strict.split()):
                problem = f"is in {unit!r}, but must be in {units[0]}; convert it"
            elif k not in index.values() and columns is None and name not in ignored:
                how = f"delete it, or list all columns in {_list_columns()} with '-' in its place"
                problem = f"is unknown; {near(name, self.names)}; {how}"
            else:
                continue
            raise InputError.at_line(path, layout.header_line, f"column {quote(title)} {problem}")
        return index

    def _assigned(
        self, path: str, layout: TextLayout, columns: Columns
    ) -> tuple[list[str | None], str]:
        """Return the canonical name of each field, and what names it."""
        n = layout.n_fields
        if isinstance(columns, Mapping):
            source = f"{spell('columns')} = {dict(columns)}"
            return self._from_mapping(path, layout, columns), source
        if columns is not None:
            if len(columns) != n:
                message = (
                    f"{n} fields, but {spell('columns')} names {len(columns)}: {list(columns)}"
                )
                advice = "name each field, '-' for what is to be left out"
                raise InputError.at_line(path, layout.first_line, f"{message}; {advice}")
            taken, source = columns, f"{spell('columns')} = {list(columns)}"
        elif layout.header is not None:
            if layout.header_fields is None:
                raise _uneven_header(path, layout)
            return self.named(layout.header_fields), f"the header {quote(layout.header, 400)}"
        else:
            layouts = [names.split() for names in self.layouts]
            taken, source = next((names for names in layouts if len(names) == n), []), "the default"
            if not taken:
                message = (
                    f"{n} fields and no header; without a header the columns must be"
                    f" {'; '.join(self.layouts)}"
                )
                how = f"name them by {_list_columns()} of {', '.join(self.names)}"
                if "image" in self.names and not layout.delimiter and n > max(map(len, layouts)):
                    how += '; names with blanks stand in quotation marks: "my image 1.jpg"'
                raise UnnamedColumns.at_line(path, layout.first_line, message, how)
        return [name if name in self.names else None for name in taken], source

    def _from_mapping(
        self, path: str, layout: TextLayout, columns: Mapping[str, str]
    ) -> list[str | None]:
        assigned: list[str | None] = [None] * layout.n_fields
        for canonical, column in columns.items():
            if canonical not in self.names:
                choices = ", ".join(self.names)
                name = f"{spell('columns')}: {canonical!r}"
                raise UsageError(f"{path}: {name} is none of {choices}")
            index = place_of(path, layout, column)
            if assigned[index] is not None:
                raise UsageError(
                    f"{path}: {spell('columns')}: {column!r} is both {assigned[index]} and"
                    f" {canonical}; give each a field of its own"
                )
            assigned[index] = canonical
        return assigned

    def read(self, path: Source, columns: Columns = None) -> "NamedTable":
        """Read a table; InputError with file and line for what cannot be read."""
        table = read_text_table(path) if self.text else read_table(path, whole=False)
        return self.of(table, columns)

    def of(
        self,
        table: NumberTable | TextTable,
        columns: Columns = None,
        incomplete: Collection[str] = (),
    ) -> "NamedTable":
        """Return a table that was read with its columns.

        InputError as `index`, and for text where a number must stand: in columns other than those
        that may be `incomplete`.
        """
        if isinstance(table, NumberTable) and table.layout.header is None and columns is None:
            table.refuse_text(range(table.layout.n_fields))
        index = self.index(table.path, table.layout, columns)
        return NamedTable(self, table, index).checked(incomplete)

    def checked_units(self, units: Mapping[str, str] | None, *more: str) -> Mapping[str, str]:
        """Return the caller's units; UsageError for a key that is none, of these or `more`."""
        return check_units(units, (*self.units, *more))


class UnnamedColumns(InputError):
    """A table does not say what its columns are, or not of all that are needed."""


COLUMNS_EXAMPLE = 'columns = { tow = "its name in the file", ... }'


def _list_columns() -> str:
    """How the present caller lists the columns of a table."""
    return fill_in("columns [...]", "columns = [...]")


def _uneven_header(path: str, layout: TextLayout) -> InputError:
    """Return the error of a header that has another number of fields than the data."""
    message = (
        f"the header {quote(layout.header, 400)} does not have the {layout.n_fields} fields of the"
        " data"
    )
    how = f"set {_list_columns()}"
    # of numbers alone, or behind a name
    names = len(str(layout.header).split(","))
    if layout.delimiter == "," and layout.n_fields in (2 * names, 2 * names - 1):
        how += ", or, if the numbers have decimal commas, write them with decimal points"
    return UnnamedColumns.at_line(path, layout.header_line, message, how)


def place_of(path: str, layout: TextLayout, column: str) -> int:
    """Return the index of a field that the caller names, or gives by its place."""
    fields = layout.header_fields
    names = [normalise_header(field)[0] for field in fields or ()]
    if match := re.fullmatch(r"\[([0-9]+)\]", column):
        if 0 <= (index := int(match[1]) - 1) < layout.n_fields:
            return index
        problem = f"there is no field {column}; the data have {layout.n_fields}, counted from 1"
        raise InputError.at_line(path, layout.first_line, f"{spell('columns')}: {problem}")
    if fields is None:
        problem = f"the file has no header; give the places of fields, [1] to [{layout.n_fields}]"
        message = f"{spell('columns')} names fields of the header, but {problem}"
        raise InputError.at_line(path, layout.first_line, message)
    if fields.count(column) == 1:
        return fields.index(column)
    if names.count(normalise_header(column)[0]) != 1:
        problem = f"{column!r} is missing or twice in the header {quote(layout.header, 400)}"
        raise InputError.at_line(path, layout.header_line, f"{spell('columns')}: {problem}")
    return names.index(normalise_header(column)[0])


@dataclass(frozen=True, eq=False)
class NamedTable:
    """A table with the index of its columns by canonical name."""

    spec: TableSpec
    table: NumberTable | TextTable | DirectRows
    index: Mapping[str, int]

    @property
    def path(self) -> str:
        """The file."""
        return self.table.path

    def __contains__(self, name: str) -> bool:
        return name in self.index

    def __len__(self) -> int:
        assert not isinstance(self.table, DirectRows)
        return len(self.table)

    def error_at(self, row: int, message: str) -> InputError:
        """The error `message` at the line of `row`."""
        return self.table.error_at(row, message)

    def checked(self, incomplete: Collection[str] = ()) -> "NamedTable":
        """Return the table; InputError where a column of numbers, none `incomplete`, holds text.

        Rows of a recording that lack a value are left out, which `settled` notes.
        """
        if not isinstance(self.table, NumberTable):
            return self
        columns = [k for name, k in self.index.items() if name not in incomplete]
        if self.spec.record:
            return replace(self, table=self.table.with_values(columns))
        self.table.refuse_text(columns)
        return self

    def floats(self, name: str) -> Array:
        """Return a column as numbers (n,); InputError with the line for what is none."""
        assert not isinstance(self.table, DirectRows)
        return self.table.floats(self.index[name])

    def numbers(self) -> dict[str, Array]:
        """Return all columns (n,) of numbers."""
        return {name: self.floats(name) for name in self.index}

    def block(self, names: str) -> Array:
        """Return columns (n, k) of numbers."""
        return np.column_stack([self.floats(name) for name in names.split()])

    def strings(self, name: str) -> tuple[str, ...]:
        """Return a column as text."""
        assert isinstance(self.table, TextTable)
        return self.table.strings(self.index[name])

    def fields(self, names: str) -> list[str]:
        """Return the fields of the header for columns, as far as there are any."""
        header = self.table.layout.header_fields
        return [header[self.index[n]] for n in names.split() if n in self.index] if header else []

    def reversed_names(self) -> list[str]:
        """Return the columns that the header calls by the reverse of their axis: -YAccel."""
        return [
            name
            for name in self.index
            if any(re.match(r"[\"'\s]*-\s*[A-Za-z]", field) for field in self.fields(name))
        ]

    def settled(
        self,
        units: Mapping[str, str],
        kinds: Mapping[str, str] | None = None,
        unheeded: Sequence[str] = (),
    ) -> Settled:
        """Settle the units by caller and header; notes on them, dates and an open end.

        The header's unit of the columns `unheeded` does not count.
        """
        layout, rows = self.table.layout, f"{self.spec.record} rows"
        dates: tuple[Finding, ...] = ()
        if self.index.get("tow") in getattr(self.table, "dates", ()):
            units = {"time": DATES_UNIT, **units}
            if "utc" not in " ".join(self.fields("tow")).lower():
                dates = (note(rows, *DATES_FOR_STAMPS),)
        fields = {
            key: self.fields(" ".join(name for name in names.split() if name not in unheeded))
            for key, names in self.spec.units.items()
        }
        line, spec = layout.header_line, self.spec
        settled = settled_units(self.path, line, spec.units, fields, units, spec.record, kinds)
        notes = (*open_end(rows, self.table.complete), *settled.notes, *dates, *self._left_out())
        return settled._replace(notes=notes)

    def _left_out(self) -> tuple[Finding, ...]:
        """The note on rows that lack a value; none where all have theirs."""
        if not isinstance(self.table, NumberTable) or not (lines := self.table.left_out):
            return ()
        share = f"{len(lines)} of {len(lines) + len(self.table)} rows"
        finding = f"{share} left out that lack a value, the first in line {lines[0]}"
        return (note(f"{self.spec.record} rows", finding, "a value in every field"),)

    def gps_time(self, gps_week: int | None = None, unit: str = "s") -> tuple[Array, int | None]:
        """Return seconds of the first week and that week, as `clock.gps_time` does."""
        week = self.floats("week") if "week" in self else None
        return gps_time(self, self.floats("tow"), week, gps_week, unit)

    def examined_time(
        self,
        name: str,
        gps_week: int | None,
        unit: str,
        same: Callable[[int, int], bool] | None = None,
    ) -> tuple[Array, int | None, tuple[Finding, ...]]:
        """Return what `gps_time` does of examined stamps, and the notes `name` on them."""
        week = self.floats("week") if "week" in self else None
        return examined_time(self, self.floats("tow"), week, name, gps_week, unit, same)

    def positive(self, names: str, unit: str) -> Array:
        """Return columns (n, k) of standard deviations; InputError for one that is not positive."""
        values = self.block(names)
        for k, name in enumerate(names.split()):
            message = f"{name} {{:g}} {unit}; a standard deviation must be greater than zero"
            refuse_rows(self, values[:, k] <= 0.0, message, values[:, k])
        return values

    def rows_of(self, column: str, kind: str) -> tuple[tuple[str, ...], NDArray[np.int64]]:
        """Return the names of a column, each once and in order, and which of them each line has.

        Parameters
        ----------
        column : str
            The column.
        kind : str
            What it names, for the message.

        Raises
        ------
        InputError
            A name that is empty, with file and line.
        """
        texts = self.strings(column)
        empty = np.array([not text for text in texts])
        refuse_rows(self, empty, f"the name of the {kind} is missing; write it, or delete the line")
        names = tuple(dict.fromkeys(texts))
        row_by_name = {name: k for k, name in enumerate(names)}
        return names, np.array([row_by_name[name] for name in texts], dtype=np.int64)

    def refuse_repeats(self, message: Callable[[int], str], *keys: NDArray[np.int64]) -> None:
        """Refuse the first row whose keys stood in an earlier one; `message` says so of a row."""
        if (twice := first_repeat(*keys)) is not None:
            assert isinstance(self.table, TextTable)
            first, row = twice
            before = f"before in line {self.table.lines[first]}"
            raise self.error_at(row, f"{message(row)}, {before}; delete one of the lines")


@dataclass(frozen=True)
class TableOut:
    """How a text table is written.

    Attributes
    ----------
    columns : str
        Names of the columns with their % formats, blanks between them: "image tow=%.7f"; a column
        without a format holds text.
    separator : str
        What separates them. With blanks the header is a comment.
    """

    columns: str
    separator: str = ","

    @property
    def names(self) -> str:
        """Names of the columns, blanks between them."""
        return " ".join(column.partition("=")[0] for column in self.columns.split())

    def with_columns(self, columns: str) -> "TableOut":
        """Return the table with more columns behind the others."""
        return replace(self, columns=f"{self.columns} {columns}")

    def write(
        self, path: Source, table: Array, *texts: Sequence[str], comments: Iterable[str] = ()
    ) -> None:
        """Write a table, whole or not at all.

        Parameters
        ----------
        path : path
            The file.
        table : ndarray
            (n, m) the numbers.
        *texts : sequence of str
            (n,) the columns of text.
        comments : iterable of str
            Lines before the header.
        """
        forms = [column.partition("=")[2] for column in self.columns.split()]
        form = self.separator.join(form or "%s" for form in forms) + "\n"
        rows = format_rows(form, table)
        if texts:
            texts_left, numbers = iter(texts), iter(table.T.tolist())
            columns = [next(numbers if form else texts_left) for form in forms]
            rows = (form % row for row in zip(*columns, strict=True))
        if self.separator == " ":
            write_table(path, [*comments, self.names], (), rows)
        else:
            write_table(path, comments, self.names.split(), rows)


def write_table(
    path: Source, comments: Iterable[str], columns: Sequence[str], rows: Iterable[str]
) -> None:
    """Write a table of columns with commas between them, whole or not at all.

    Parameters
    ----------
    path : path
        The file.
    comments : iterable of str
        Lines before the header.
    columns : sequence of str
        Names of the columns.
    rows : iterable of str
        The lines, each with its end.
    """
    head = [f"# {line}\n" for line in comments] + [",".join(columns) + "\n"] * bool(columns)
    atomic_write(path, [*head, *rows])
