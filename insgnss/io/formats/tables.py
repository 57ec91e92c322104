"""What a file holds, for whoever has to find out: tables, the names of their columns, rows."""

from collections import Counter
from functools import lru_cache
from pathlib import Path

from ...base.errors import InputError
from .arrays.content import TableInfo, tables_of
from .detect import LOADERS, by_bytes, head_of, is_nmea, load_content
from .exports import function_at
from .text.headers import kinds_like, unit_in
from .text.sentences import read_sentences
from .text.text import read_table, read_text_table

AUTOPILOT_LOGS = {"ardupilot": "logs.ardupilot:read_log", "ulog": "logs.ulog:read_log"}


def tables_in(path: str | Path) -> list[TableInfo]:
    """List the tables of a file, as `io.formats.describe` states."""
    head = head_of(path)
    form = by_bytes(path, head)
    if form in LOADERS:
        return list(tables_of(load_content(form, path)))
    if form in AUTOPILOT_LOGS:
        return list(tables_of(function_at(AUTOPILOT_LOGS[form])(path).tables))
    if form == "rosbag":
        from .logs.rosbag import tables_of_bag

        return tables_of_bag(path)
    if form == "sbet":
        from .trajectory.sbet import FIELDS, read_sbet

        return [TableInfo("", FIELDS, read_sbet(path).time.size)]
    if is_nmea(head):
        return _sentence_kinds(path)
    return [_text(path)]


def _sentence_kinds(path: str | Path) -> list[TableInfo]:
    kinds = Counter(
        text.partition(b",")[0].decode("ascii", "replace")
        for _, text in read_sentences(path).texts()
    )
    return [TableInfo(name, (), count) for name, count in sorted(kinds.items())]


def _text(path: str | Path) -> TableInfo:
    """The table of a text file, which is parsed once as long as its size and date stay."""
    stat = Path(path).stat() if Path(path).is_file() else None
    return _text_as_of(str(path), stat and (stat.st_size, stat.st_mtime_ns))


@lru_cache(maxsize=16)
def _text_as_of(path: str, _: tuple[int, int] | None) -> TableInfo:
    try:
        numbers = read_table(path)
        layout, rows = numbers.layout, len(numbers.values)
    except InputError:  # some columns are text, or the file is none, which the second reading says
        table = read_text_table(path)
        layout, rows = table.layout, len(table.rows)
    names = layout.header_fields or tuple(f"[{k + 1}]" for k in range(layout.n_fields))
    units = tuple(
        unit_in(field, (*kinds_like("gyro"), *kinds_like("accel"))) or ""
        for field in layout.header_fields or ()
    )
    return TableInfo("", names, rows, units)
