"""The events with the names of the images, as a table [camera] brings them together.

Its keys are declared in `insgnss.io.options.camera_options`.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...records import CameraEvents
from ...records.cameras.camera_positions import CameraPositions
from ..formats import read_events
from ..options.camera_options import ImageMatch
from .exif_events import exif_events
from .images import image_names, image_times
from .match import name_events

__all__ = ["ImageMatch", "events_of", "named", "named_positions"]


def events_of(path: Path, ending: str | None = None, **spec: Any) -> CameraEvents:
    """Read exposures of a file, or of the Exif of a directory of images.

    Parameters
    ----------
    path : Path
        The file or the directory.
    ending : str, optional
        Of the images to take of a directory.
    **spec
        What the file does not say, as `io.formats.read_events` takes it.

    Returns
    -------
    CameraEvents
        The exposures.
    """
    if path.is_dir():
        return exif_events(path, ending, spec.get("time_scale"), spec.get("gps_week"))
    return read_events(path, **spec)


def named(events: CameraEvents, matching: ImageMatch) -> CameraEvents:
    """Give the events the names of the images, matched by the images' own times if they have some.

    Without images, return the events that are not to be skipped.

    Raises
    ------
    InputError, UsageError
        As `image_names` and `name_events` raise them.
    """
    names = None if matching.images is None else image_names(matching.images, matching.image_ending)
    image_times_s = (
        None if matching.images is None or names is None else image_times(matching.images, names)
    )
    return name_events(
        events,
        names,
        taken_s=image_times_s,
        skip_events=matching.skip_events,
        skip_images=matching.skip_images,
    )


def named_positions(
    positions: CameraPositions, matching: ImageMatch
) -> tuple[CameraPositions, tuple[str, ...]]:
    """Give camera positions the names of the images, as `named` does with events.

    Returns
    -------
    positions : CameraPositions
        Those that are not to be skipped.
    notes : tuple of str
        What a reader should know of the match.
    """
    images, time = positions.images, positions.time
    events = named(CameraEvents(images, time, positions.gps_week, positions.source), matching)
    notes = [f"{note.name}: {note.found}" for note in events.notes]
    if matching.images is None and all(name.isdecimal() for name in images):
        notes.append("images are called by numbers; --images DIR gives their names")
    chosen = positions[np.searchsorted(time, events.time)]
    return replace(chosen, images=events.images), tuple(notes)
