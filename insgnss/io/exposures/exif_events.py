"""Exposures by the Exif of the images alone: the last resort, seconds of a camera's own clock.

DateTimeOriginal, with SubSecTimeOriginal and OffsetTimeOriginal where the camera writes them. What
the digits leave open is the standard deviation of the events (`io.formats.events.dated`), and goes
into every covariance that comes of them. That the clock of the camera is off by a constant nothing
here knows.
"""

from dataclasses import dataclass, replace
from pathlib import Path

from ...base.errors import InputError
from ...base.inputs import opened
from ...records import CameraEvents
from ..formats.events.dated import dated_events
from ..formats.images.exif import stamp_taken
from ..formats.read_options import ReadOptions
from ..formats.text.order import note
from .images import image_names


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
            with opened(directory / name) as stream:
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
