"""The events with the names of the images, as a table [camera] brings them together.

Its keys are declared in `insgnss.io.options.camera_options`.
"""

from pathlib import Path
from typing import Any

from ...records import CameraEvents
from ..formats import read_events
from ..options.camera_options import ImageMatch
from .exif_events import exif_events
from .images import image_names, image_times
from .match import name_events

__all__ = ["ImageMatch", "events_of", "named"]


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


def named(events: CameraEvents, wanted: ImageMatch) -> CameraEvents:
    """Give the events the names of the images, matched by the images' own times if they have some.

    Without images, return the events that are not to be skipped.

    Raises
    ------
    InputError, UsageError
        As `image_names` and `name_events` raise them.
    """
    names = None if wanted.images is None else image_names(wanted.images, wanted.image_ending)
    taken = None if wanted.images is None or names is None else image_times(wanted.images, names)
    return name_events(
        events, names, taken_s=taken, skip_events=wanted.skip_events, skip_images=wanted.skip_images
    )
