"""Mid-exposure instants of the camera: `[image] tow [sigma_s]`, data_specs/events.md."""

from ....base.wording import spell
from ....records import Array, CameraEvents, Finding
from ..names import EVENTS
from ..orientation.exported import quoted_names
from ..read_options import STATED_NOTHING, ReadOptions
from ..text.columns import TableOut, TableSpec
from ..text.order import Lines, Picked, note, put_in_order
from ..text.text import Source

UNNAMED = "event names"  # name of the note on events that have numbers alone
SPEC = TableSpec(
    EVENTS,
    required="tow",
    layouts=("tow", "image tow", "image week tow"),
    units={"time": "tow"},
    record="event",
    text=True,
)
OUT = TableOut("image tow[s]=%.7f", " ")


def read_events(path: Source, options: ReadOptions = STATED_NOTHING) -> CameraEvents:
    """Read exposure instants.

    Without a column of image names they are numbered from 1, with a note.

    Parameters
    ----------
    path : path
        The file.
    options : ReadOptions
        `columns` of image, week, tow, sigma_s; `units` of "time", else the one that the header
        gives, in brackets or behind the name, else s.

    Returns
    -------
    CameraEvents
        The events.

    Raises
    ------
    InputError
        A bad time, time that does not increase, or an image that occurs twice, with file and line.
    """
    units = SPEC.checked_units(options.units)
    table = SPEC.read(path, options.columns)
    settled = table.settled(units)
    time, gps_week, notes = table.examined_time(
        "event rows", options.gps_week, settled.units["time"]
    )
    images = table.strings("image") if "image" in table else None
    sigma = table.positive("sigma_s", "s")[:, 0] if "sigma_s" in table else None
    return events_in_order(images, time, table, gps_week, (*settled.notes, *notes), sigma)


def events_in_order(
    images: tuple[str, ...] | None,
    time: Array,
    lines: Lines,
    gps_week: int | None,
    notes: tuple[Finding, ...],
    sigma_s: Array | None = None,
) -> CameraEvents:
    """Make events of names, or numbers from 1, and times (n,), s: each stamp once, in order."""
    if images is None:
        images, numbering = numbered_names(time.size)
        notes = (*notes, numbering)
    names = images
    rows, order_notes = put_in_order(lines, time, lambda i, k: names[i] == names[k], "event rows")
    if rows is not None:
        time, images, lines = time[rows], tuple(names[k] for k in rows), Picked(lines, rows)
        sigma_s = None if sigma_s is None else sigma_s[rows]
    first: dict[str, int] = {}
    for row, name in enumerate(images):
        if first.setdefault(name, row) != row:
            where = str(lines.error_at(first[name], "")).removeprefix(lines.path).strip(": ")
            message = (
                f"image {name[:80]} occurs twice, first in"
                f" {where if ' ' in where else 'line ' + where}; delete one of them, or, if this"
            )
            raise lines.error_at(
                row, f"{message} is no image name, set columns = [...] of image, week, tow"
            )
    return CameraEvents(images, time, gps_week, lines.path, (*notes, *order_notes), sigma_s=sigma_s)


def numbered_names(count: int) -> tuple[tuple[str, ...], Finding]:
    """Return numbers from 1 in place of names, and the note that says so."""
    finding = f"no image names; the {count} events are numbered from 1"
    advice = (
        f"give the images ({spell('camera.images')}), or check that none is missing before you join"
        " them by number"
    )
    names = tuple(str(k + 1) for k in range(count))
    return names, note(UNNAMED, finding, "a name for each event", advice)


def write_events(events: CameraEvents, path: Source) -> None:
    """Write `image tow`, blank separated, seconds with 7 decimals."""
    OUT.write(path, events.time[:, None], quoted_names(events.images, None))
