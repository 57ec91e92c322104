"""Columns of the plain tables of an image block: every one is known, in the table's one unit."""

from collections.abc import Sequence

from ...base.errors import InputError, near
from ..text.columns import Aliases, Columns, columns_of
from ..text.headers import normalised
from ..text.layout import shown
from ..text.text import TextTable


def named_columns(
    table: TextTable,
    aliases: Aliases,
    required: Sequence[str],
    defaults: Sequence[Sequence[str]],
    units: Sequence[str],
    columns: Columns = None,
) -> dict[str, int]:
    """Return the index of every column by its canonical name.

    Unlike `columns_of`, a column of the header that nobody knows is refused: left out, a misspelled
    standard deviation would become the default one.

    Parameters
    ----------
    table : TextTable
        The table.
    aliases, required, defaults, columns
        As of `columns_of`.
    units : sequence of str
        Spellings of the unit that may stand in brackets behind a name.

    Returns
    -------
    dict
        Indices of the columns.

    Raises
    ------
    InputError
        A column that is unknown, missing or named twice, or of another unit.
    """
    index = columns_of(table, aliases, required, defaults, columns)
    layout = table.layout
    fields = layout.header_fields or ()
    for k, field in enumerate(fields):
        name, unit = normalised(field)
        if k in index.values():
            if unit is not None and unit.lower() not in units:
                raise InputError.at_line(
                    table.path,
                    layout.header_line,
                    f"column {shown(field)} is in {unit!r}; {units[0]} is read: convert it",
                )
        elif columns is None:
            raise InputError.at_line(
                table.path,
                layout.header_line,
                f"column {shown(field)} is unknown; {near(name, aliases)}; take it out, or name"
                " the columns by columns = [...] with '-' for it",
            )
    return index
