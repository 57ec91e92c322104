"""SQLite files of other programs: read only, and no further than their size accounts for.

A view, a virtual table, a computed column or a page that leads to itself can take hours, so that
plain tables alone are read, by no more instructions of SQLite than rows of the file could need.
"""

import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path

from ....base.errors import InputError
from ....base.inputs import open_bytes

FILE_HEAD = b"SQLite format 3\0"
COLUMNS_QUERY = (
    "SELECT t.name, t.type, MAX(c.hidden) FROM pragma_table_list AS t, pragma_table_xinfo(t.name)"
    " AS c WHERE t.schema = 'main' GROUP BY t.name"
)
"""Of each table its kind and the largest mark of its columns, from 2 on of one that is computed."""
INSTRUCTIONS_AT_A_TIME = 10_000  # instructions of SQLite between two looks at the budget: 0.1 ms
FEWEST_INSTRUCTIONS = 10_000_000  # instructions for a file of any size: a tenth of a second
BY_BYTE = 20  # instructions for each byte: a row has 8 bytes or more and is joined by about 100
# bytes of a text or blob, or those of the file where they are fewer
LONGEST_VALUE_BYTES = 100_000_000


def is_database(file: Path) -> bool:
    """Tell whether a file begins as those of SQLite do."""
    with open_bytes(file) as stream:
        return stream.read(len(FILE_HEAD)) == FILE_HEAD


@contextmanager
def opened_database(
    path: object, tables: Sequence[str], wanted: str
) -> Iterator[sqlite3.Connection]:
    """Open a file for reading; whatever SQLite finds wrong with it is said in one line.

    Parameters
    ----------
    path : path
        The file.
    tables : sequence of str
        Names that must be tables, where they are there at all.
    wanted : str
        What the file should be and what to do, such as "database of COLMAP; give its database.db".

    Yields
    ------
    connection
        The open file.

    Raises
    ------
    InputError
        It cannot be read or is no database; one of the names is no table; or reading takes more
        instructions than its size accounts for.
    """
    file = Path(str(path))
    kind, _, advice = wanted.partition("; ")
    try:
        begins, size = is_database(file), file.stat().st_size
    except OSError as error:
        problem = f"cannot be read: {error.strerror or error}"
        raise InputError.in_file(path, problem) from None
    budget = FEWEST_INSTRUCTIONS + BY_BYTE * size
    spent = 0

    def exhausted() -> bool:
        nonlocal spent
        spent += INSTRUCTIONS_AT_A_TIME
        return spent > budget

    try:
        if not begins:
            raise ValueError("no SQLite file")
        address = f"{file.resolve().as_uri()}?mode=ro"
        with closing(sqlite3.connect(address, uri=True)) as connection:
            connection.set_progress_handler(exhausted, INSTRUCTIONS_AT_A_TIME)
            connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, min(size, LONGEST_VALUE_BYTES))
            connection.execute("PRAGMA trusted_schema = OFF")
            for name, sort, hidden in connection.execute(COLUMNS_QUERY).fetchall():
                if str(name).lower() in tables and (sort != "table" or hidden):
                    fault = "a table with columns that are computed" if hidden > 1 else f"a {sort}"
                    raise ValueError(f"{name} is {fault}, not a plain table")
            yield connection
    except (sqlite3.Error, TypeError, ValueError, OverflowError) as error:
        why = " ".join(str(error).split())[:120]
        if spent > budget:
            why = f"reading takes more steps than a file of this size needs (limit {budget})"
        raise InputError.in_file(path, f"is no {kind}: {why}; {advice}") from None
