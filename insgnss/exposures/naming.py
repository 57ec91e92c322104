"""What of a table [camera] brings events to images, and the events with the names of these.

The keys and their defaults are documented in `insgnss.flight` and data_specs/flight_file.md.
"""

from dataclasses import dataclass
from pathlib import Path

from ..records import CameraEvents
from ..tables import Table
from .images import image_names, image_times
from .match import name_events


@dataclass(frozen=True)
class ImageMatch:
    """Which images there are, and which of them and of the events have no partner.

    images : directory or list of their names in order, None for the events' own names.   image_ending : of those to take from a directory.
    skip_events : numbers, from 1.   skip_images : names.
    """

    images: Path | None = None
    image_ending: str | None = None
    skip_events: tuple[int, ...] = ()
    skip_images: tuple[str, ...] = ()

    @property
    def files(self) -> tuple[Path, ...]:
        """The list of the names, where there is one."""
        return (self.images,) if self.images is not None and self.images.is_file() else ()


def image_match(table: Table) -> ImageMatch:
    """The match that a table [camera] asks for. Raises InputError with file and line."""
    images = table.resolve(table.text("images")) if "images" in table.data else None
    if images is not None and not images.exists():
        raise table.error("images", f"{images} does not exist; give the directory of the images or a list of their names in order")
    if images is None and (odd := [key for key in ("image_ending", "skip_images") if key in table.data]):
        raise table.error(odd[0], "is of camera.images, which is missing; give the directory of the images or a list of their names")
    skipped = table.value("skip_events", list, [])
    if not all(isinstance(number, int) and not isinstance(number, bool) and number > 0 for number in skipped):
        raise table.error("skip_events", f"{skipped}, expected a list of whole numbers from 1, as the events are counted")
    return ImageMatch(images, table.text("image_ending", None), tuple(skipped), table.texts("skip_images", ()))


def named(events: CameraEvents, wanted: ImageMatch) -> CameraEvents:
    """The events with the names of the images, matched by the images' own times where they tell them; without images those that are not
    to be skipped.

    Raises what `image_names` and `name_events` raise.
    """
    names = None if wanted.images is None else image_names(wanted.images, wanted.image_ending)
    taken = None if wanted.images is None or names is None else image_times(wanted.images, names)
    return name_events(events, names, taken_s=taken, skip_events=wanted.skip_events, skip_images=wanted.skip_images)
