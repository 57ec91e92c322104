"""The events with the names of the images, as a table [camera] brings them together.

Its keys are declared in `insgnss.io.options.camera_options`.

Without a file of events the Exif of the images gives the exposures, in seconds of the camera's own
clock: DateTimeOriginal, SubSecTimeOriginal and OffsetTimeOriginal where the camera writes them.
What the digits leave open is the standard deviation of the events (`io.formats.events.dated`), and
goes into every covariance that comes of them. That the clock of the camera is off by a constant
nothing here knows.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import InputError
from ...base.inputs import open_bytes
from ...records import CameraEvents
from ...records.cameras.camera_positions import CameraPositions
from ..formats import read_events
from ..formats.events.dated import dated_events
from ..formats.images.exif import stamp_taken
from ..formats.read_options import ReadOptions
from ..formats.text.order import note
from ..options.camera_options import ImageMatch
from .images import image_names, image_times
from .match import name_events


@dataclass(frozen=True)
class _Images:
    """Where the stamps stand."""

    path: str
    names: tuple[str, ...]

    def error_at(self, row: int, message: str) -> InputError:
        """The error `message` at an image."""
        return InputError.in_file(Path(self.path) / self.names[row], message)


def exif_events(
    directory: Path,
    ending: str | None = None,
    time_scale: str | None = None,
    gps_week: int | None = None,
) -> CameraEvents:
    """Return the exposures of a directory of images by their Exif.

    Parameters
    ----------
    directory : Path
        Images with DateTimeOriginal.
    ending : str, optional
        Of the images to take.
    time_scale : str, optional
        "utc", "gpst" or "utc+hh:mm" of the camera's clock, where the images do not say.
    gps_week : int, optional
        The caller's week.

    Returns
    -------
    CameraEvents
        In order of time, with the standard deviations of their digits.

    Raises
    ------
    InputError
        An image without a time, or two of one stamp.
    """
    names = image_names(directory, ending)
    images = _Images(str(directory), names)
    stamps = []
    for row, name in enumerate(names):
        try:
            with open_bytes(directory / name) as stream:
                stamps.append(stamp_taken(stream, name))
        except (OSError, ValueError) as error:
            raise images.error_at(row, f"holds no time of its exposure ({error})") from None
    options = ReadOptions(gps_week=gps_week, time_scale=time_scale)
    events = dated_events(names, stamps, images, "", options)
    by_exif = note(
        "exposure times",
        f"{len(names)} from the Exif of the images, which have the camera's own clock",
        "event marks of the receiver",
        "an error of this clock moves all images along the path; correct camera.time_offset_s",
    )
    return replace(events, notes=(*events.notes, by_exif))


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
