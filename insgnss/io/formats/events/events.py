"""Mid-exposure instants of the camera: `[image] tow`, data_specs/events.md."""

from collections.abc import Mapping

import numpy as np

from ....base.files import atomic_write
from ....base.wording import named
from ....records import Array, CameraEvents, Finding
from ..orientation.exported import quoted_names
from ..text.columns import TIME, Aliases, Columns, columns_of, fields_of, gps_time
from ..text.headers import Kinds, settled_units
from ..text.order import Lines, Picked, note, open_end, put_in_order
from ..text.text import Source, read_text_table
from ..text.units import check_units

UNNAMED = "event names"  # name of the note on events that have numbers alone
DEFAULTS = (("tow",), ("image", "tow"), ("image", "week", "tow"))
ALIASES: Aliases = {
    **TIME,
    "image": (
        "image",
        "images",
        "img",
        "photo",
        "name",
        "label",
        "filename",
        "file",
        "event",
        "event_id",
        "id",
    ),
}
KINDS: Kinds = {"tow": ("time",)}


def read_events(
    path: Source,
    columns: Columns = None,
    gps_week: int | None = None,
    units: Mapping[str, str] | None = None,
) -> CameraEvents:
    """Read exposure instants.

    Without a column of image names they are numbered from 1, with a note.

    Parameters
    ----------
    path : path
        The file.
    columns : sequence or mapping, optional
        Name of each column out of image, week, tow; any other name leaves a column out; or a table
        of them to the header's.
    gps_week : int, optional
        The week, where no column holds it.
    units : mapping, optional
        Unit of "time", else the one that the header gives, in brackets or behind the name, else s;
        a note where both differ.

    Returns
    -------
    CameraEvents
        The events.

    Raises
    ------
    InputError
        A bad time, time that does not increase, or an image that occurs twice, with file and line.
    """
    units = check_units(units, ("time",))
    table = read_text_table(path)
    index = columns_of(table, ALIASES, ("tow",), DEFAULTS, columns, KINDS)
    fields = {"time": fields_of(table.layout, index, ("tow",))}
    taken, _, unit_notes = settled_units(
        str(path),
        table.layout.header_line,
        {"time": ("tow",)},
        {"time": "time"},
        fields,
        units,
        "event",
    )
    week = table.floats(index["week"]) if "week" in index else None
    time, gps_week = gps_time(table, table.floats(index["tow"]), week, gps_week, taken["time"])
    images = table.strings(index["image"]) if "image" in index else None
    notes = (*open_end("event rows", table.complete), *unit_notes)
    return events_in_order(images, time, table, str(path), gps_week, notes)


def events_in_order(
    images: tuple[str, ...] | None,
    time: Array,
    lines: Lines,
    source: str,
    gps_week: int | None,
    notes: tuple[Finding, ...] = (),
) -> CameraEvents:
    """Make events of names, or numbers from 1, and times (n,), s: each stamp once, in order."""
    if images is None:
        images, numbering = numbered(time.size)
        notes = (*notes, numbering)
    names = images
    rows, odd = put_in_order(lines, time, lambda i, k: names[i] == names[k], "event rows")
    if rows is not None:
        time, images, lines = time[rows], tuple(names[k] for k in rows), Picked(lines, rows)
    first: dict[str, int] = {}
    for row, name in enumerate(images):
        if first.setdefault(name, row) != row:
            where = str(lines.error_at(first[name], "")).removeprefix(source).strip(": ")
            message = (
                f"image {name[:80]} occurs twice, first in"
                f" {where if ' ' in where else 'line ' + where}; is the first column the image?"
            )
            raise lines.error_at(row, f"{message} else set columns = [...] of image, week, tow")
    return CameraEvents(images, time, gps_week, source, (*notes, *odd))


def numbered(count: int) -> tuple[tuple[str, ...], Finding]:
    """Return numbers from 1 in place of names, and the note that says so."""
    finding = f"no image names; the {count} events are numbered from 1"
    advice = (
        f"give the images ({named('camera.images')}), or check that none is missing before you join"
        " them by number"
    )
    return tuple(str(k + 1) for k in range(count)), note(
        UNNAMED, finding, "a name for each event", advice
    )


def write_events(events: CameraEvents, path: Source) -> None:
    """Write `image tow`, blank separated, seconds with 7 decimals."""
    images = quoted_names(events.images, None)
    rows = (
        f"{name} {time:.7f}\n"
        for name, time in zip(images, np.asarray(events.time).tolist(), strict=True)
    )
    atomic_write(path, ["# image tow[s]\n", *rows])
