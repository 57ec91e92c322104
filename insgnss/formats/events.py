"""Mid-exposure instants of the camera: `[image] tow`, data_specs/events.md."""

import warnings

import numpy as np

from ..files import atomic_write
from ..records import CameraEvents
from ._columns import TIME, TIME_UNITS, Aliases, Columns, columns_of, gps_time, scale_of
from ._eo import check_names
from ._text import InsgnssWarning, Source, read_text_table

DEFAULTS = (("tow",), ("image", "tow"), ("image", "week", "tow"))
ALIASES: Aliases = {
    **TIME,
    "image": ("image", "images", "img", "photo", "name", "label", "filename", "file", "event", "event_id", "id"),
}


def read_events(path: Source, columns: Columns = None, gps_week: int | None = None) -> CameraEvents:
    """Read exposure instants; without a column of image names they are numbered from 1, with a warning.

    columns : name of each column out of image, week, tow; any other name leaves a column out; or a table of them to the header's.
    Raises InputError with file and line for a bad time, time that does not increase and an image that occurs twice.
    """
    table = read_text_table(path)
    index = columns_of(table, ALIASES, ("tow",), DEFAULTS, columns)
    scale_of(table, index, ("tow",), TIME_UNITS, None)
    week = table.floats(index["week"]) if "week" in index else None
    time, gps_week = gps_time(table, table.floats(index["tow"]), week, gps_week)
    if "image" in index:
        images = table.strings(index["image"])
        first: dict[str, int] = {}
        for row, name in enumerate(images):
            if first.setdefault(name, row) != row:
                what = f"image {name} occurs twice, first in line {table.lines[first[name]]}; is the first column the image?"
                raise table.at(row, f"{what} else set columns = [...] of image, week, tow")
    else:
        images = tuple(str(k + 1) for k in range(time.size))
        warnings.warn(InsgnssWarning(f"{path}: no image names; the {time.size} events are numbered from 1"), stacklevel=2)
    return CameraEvents(images, time, gps_week, str(path))


def write_events(events: CameraEvents, path: Source) -> None:
    """Write `image tow`, blank separated, seconds with 7 decimals."""
    check_names(events.images, None)
    rows = (f"{name} {time:.7f}\n" for name, time in zip(events.images, np.asarray(events.time).tolist(), strict=True))
    atomic_write(path, ["# image tow[s]\n", *rows])
