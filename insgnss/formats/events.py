"""Mid-exposure instants of the camera: `[image] tow`, data_specs/events.md."""

from collections.abc import Mapping

import numpy as np

from ..files import atomic_write
from ..records import Array, CameraEvents, Check
from ._columns import TIME, Aliases, Columns, columns_of, gps_time, unit_of
from ._eo import check_names
from ._order import Lines, Picked, note, open_end, put_in_order
from ._text import Source, read_text_table
from ._units import check_units

DEFAULTS = (("tow",), ("image", "tow"), ("image", "week", "tow"))
ALIASES: Aliases = {
    **TIME,
    "image": ("image", "images", "img", "photo", "name", "label", "filename", "file", "event", "event_id", "id"),
}


def read_events(path: Source, columns: Columns = None, gps_week: int | None = None, units: Mapping[str, str] | None = None) -> CameraEvents:
    """Read exposure instants; without a column of image names they are numbered from 1, with a note.

    columns : name of each column out of image, week, tow; any other name leaves a column out; or a table of them to the header's.
    units : of "time".
    Raises InputError with file and line for a bad time, time that does not increase and an image that occurs twice.
    """
    units = check_units(units, ("time",))
    table = read_text_table(path)
    index = columns_of(table, ALIASES, ("tow",), DEFAULTS, columns)
    unit = units.get("time") or unit_of(table, index, ("tow",), "time") or "s"
    week = table.floats(index["week"]) if "week" in index else None
    time, gps_week = gps_time(table, table.floats(index["tow"]), week, gps_week, unit)
    images = table.strings(index["image"]) if "image" in index else None
    return events_in_order(images, time, table, str(path), gps_week, open_end("event rows", table.complete))


def events_in_order(
    images: tuple[str, ...] | None, time: Array, lines: Lines, source: str, gps_week: int | None, notes: tuple[Check, ...] = ()
) -> CameraEvents:
    """Events of names, or numbers from 1, and times (n,), s, each stamp once, in order."""
    if images is None:
        found = f"no image names; the {time.size} events are numbered from 1"
        notes = (
            *notes,
            note("event rows", found, "a name for each event", "check that no image is missing before you join them by number"),
        )
        images = tuple(str(k + 1) for k in range(time.size))
    names = images
    rows, told = put_in_order(lines, time, lambda i, k: names[i] == names[k], "event rows")
    if rows is not None:
        time, images, lines = time[rows], tuple(names[k] for k in rows), Picked(lines, rows)
    first: dict[str, int] = {}
    for row, name in enumerate(images):
        if first.setdefault(name, row) != row:
            where = str(lines.at(first[name], "")).removeprefix(source).strip(": ")
            what = f"image {name[:80]} occurs twice, first in {where if ' ' in where else 'line ' + where}; is the first column the image?"
            raise lines.at(row, f"{what} else set columns = [...] of image, week, tow")
    return CameraEvents(images, time, gps_week, source, (*notes, *told))


def write_events(events: CameraEvents, path: Source) -> None:
    """Write `image tow`, blank separated, seconds with 7 decimals."""
    check_names(events.images, None)
    rows = (f"{name} {time:.7f}\n" for name, time in zip(events.images, np.asarray(events.time).tolist(), strict=True))
    atomic_write(path, ["# image tow[s]\n", *rows])
