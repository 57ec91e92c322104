"""Table [camera] of the flight file: the exposures, and the images that belong to them."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from .gnss_options import BY_HEADER
from .schema import check, option, take_record

if TYPE_CHECKING:
    from ..base.tables import Columns
    from ..records import CameraEvents


@dataclass(frozen=True)
class ImageMatch:
    """Which images there are, and which of them and of the events have no partner."""

    images: Path | None = option(
        None,
        "directory of the images, or list of their names, in the order of exposure, for events "
        "without names (in the rover's RINEX, .MRK, a text of times; numbers are no names), below",
        kind="images",
        form="directory or file",
        usual="numbers",
        cli="--images",
        metavar="PLACE",
        cli_meaning="directory of the images, or list of their names in the order of exposure",
    )
    image_ending: str | None = option(
        None,
        "ending of the images to take from a directory that holds them in several formats",
        usual="all",
        cli="--image-ending",
        metavar="EXT",
    )
    skip_events: tuple[int, ...] = option(
        (),
        "numbers, from 1, of events without an image",
        kind="event_numbers",
        form="list of whole numbers",
        cli="--skip-events",
        metavar="N",
    )
    skip_images: tuple[str, ...] = option(
        (), "names of images without an event", cli="--skip-images", metavar="NAME"
    )

    @property
    def files(self) -> tuple[Path, ...]:
        """The list of the names, where there is one."""
        return (self.images,) if self.images is not None and self.images.is_file() else ()


@dataclass(frozen=True)
class RoverEvents:
    """Which external events of the rover's RINEX are exposures."""

    events_containing: str = option(
        "",
        "of the events in the rover's RINEX only those whose record lines hold this text",
        cli="--events-containing",
        metavar="TEXT",
    )
    invalid_events: bool = option(
        False,
        'of the events in the rover\'s RINEX also those with the comment "Time mark is not valid" '
        "(rinex.md); false: left out, with a note of their number and times",
        cli="--invalid-events",
        cli_meaning="take also the events of the rover's file that it marks as not valid",
    )


@dataclass(frozen=True)
class CameraInput:
    """Table [camera]; `events` is None where the rover's file holds them (`rover_events`).

    In Python `events` may be camera events, or an array or table of them, instead of a file.

    Raises
    ------
    OptionError
        For a value that cannot be.
    InputError
        Where `events` is neither a path nor events.
    """

    events: "Path | CameraEvents | None" = option(
        ...,
        "mid-exposure instants: a text, a table of names and dates, .MRK, _events.pos of RTKLIB, a "
        "log, or as a last resort the directory of the images for their Exif times; without the "
        "table the product is the trajectory alone; with gnss.rover by default those of the "
        "rover's RINEX",
        kind="file_or_directory",
        form="file or directory",
        cli="--events",
        metavar="FILE",
        cli_meaning="camera events (.MRK, text, dates, directory of images) instead of those of "
        "the rover's file",
    )
    columns: "Columns" = option(
        None, "as imu.columns", kind="columns", usual=BY_HEADER, of_file=True
    )
    time_scale: str | None = option(
        None,
        'scale of events given as dates that do not say it: "utc", "gpst", which is 18 s ahead, or '
        'of a camera in local time "utc+02:00"',
        usual="what the file says, else it is asked for",
        cli="--time-scale",
        metavar="SCALE",
        of_file=True,
    )
    time_offset_s: float = option(
        0.0,
        "added to the times of the events: the delay from event to mid-exposure",
        unit="s",
        cli="--camera-delay",
        metavar="S",
    )
    clock: Literal["auto", "imu", "receiver"] = option(
        "auto",
        'whose clock stamps the events, which are moved with its offset: "receiver": that of the '
        'fixes, with gnss.time_offset_s and what is estimated of the time offset; "imu": that of '
        'the samples, with imu.time_offset_s; "auto": "receiver" for events of the rover\'s RINEX, '
        "and of a .MRK beside gnss.rover or a .pos of RTKLIB, else the stamps are those of the "
        "IMU's clock as they stand",
    )
    match: ImageMatch = field(default_factory=ImageMatch)
    rover_events: RoverEvents = field(default_factory=RoverEvents)

    def __post_init__(self) -> None:
        check(self, "camera")
        take_record(self, "events", "camera_events")
