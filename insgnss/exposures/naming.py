"""The events with the names of the images, as a table [camera] brings them together.

Its keys are declared in `insgnss.config.camera_options`.
"""

from ..config.camera_options import ImageMatch
from ..records import CameraEvents
from .images import image_names, image_times
from .match import name_events

__all__ = ["ImageMatch", "named"]


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
