"""Table [camera] of the flight file: the exposures, and the images that belong to them.

A rig has several cameras on one body. The first is that of [camera] and [mounting]; each further
one is a table [[camera.further]] with its own events and its own mounting:

    [[camera.further]]
    name = "left"
    events = "left_events.txt"            # without it: exposed by the trigger of the first camera
    prefix = "left_"
    mounting = { from_camera_m = [0.0, -0.08, 0.02], camera_from_body = [...] }

The flight is solved once, with the exposures of all cameras among its epochs, so that the errors of
two images taken together are those of one body (`navigation.orient.rig`).
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from ...base.errors import OptionError
from .kinds import check
from .schema import Triple, columns_of_file, option, take_record

if TYPE_CHECKING:
    from ...base.tables import Columns
    from ...records import CameraEvents
    from ...records.cameras.mounting import Mounting

Matrix = tuple[Triple, Triple, Triple]
CAMERA_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.\-]*")  # goes into names of files
OF_FURTHER = "camera.further"


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
        needs=("images",),
        cli="--image-ending",
        metavar="EXT",
    )
    skip_events: tuple[int, ...] = option(
        (),
        "numbers, from 1, of events without an image",
        kind="event_numbers",
        form="list of whole numbers",
        cli="--skip-events",
    )
    skip_images: tuple[str, ...] = option(
        (), "names of images without an event", needs=("images",), cli="--skip-images"
    )

    def __post_init__(self) -> None:
        check(self, "camera")

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


def angle_sets() -> tuple[str, ...]:
    """Return the names of the sets of angles that a bore-sight may be given in."""
    from ...records.cameras.mounting import ANGLE_SETS

    return ANGLE_SETS


@dataclass(frozen=True, eq=False)
class CameraMounting:
    """Table `mounting` of a further camera: its place and attitude on the body.

    Parameters
    ----------
    from_camera_m : tuple of float or None
        (3,) position of this camera, from the first one, in the axes of the first, m; None: there.
    imu_m : tuple of float or None
        In its place (3,) position of the IMU, from this camera, in its axes, m.
    camera_from_body : matrix or None
        (3, 3) T_b'^c of this camera; None: that of the first.
    boresight : matrix or None
        (3, 3) B_b^b' of this camera; None: identity.
    boresight_deg : tuple or None
        In its place a set of angles and (3,) of it, deg: ``("opk", (0.1, 0.2, 0.3))``.

    Raises
    ------
    OptionError
        For a value that cannot be, and where its place is given twice.
    """

    from_camera_m: Triple | None = option(
        None,
        "position of this camera, from the first camera, in the axes of the first",
        kind="lever",
        unit="m",
        usual="at the first camera",
    )
    imu_m: Triple | None = option(
        None,
        "position of the IMU from this camera, in this camera's axes, as in mounting.imu_m;"
        " instead of `from_camera_m`",
        kind="lever",
        unit="m",
    )
    camera_from_body: Matrix | None = option(
        None,
        "T_b'^c of this camera",
        kind="matrix",
        form="3 rows of 3 numbers",
        usual="that of the first camera",
    )
    boresight: Matrix | None = option(
        None, "B_b^b' of this camera", kind="matrix", form="3 rows of 3 numbers", usual="identity"
    )
    boresight_deg: tuple[str, Triple] | None = option(
        None,
        "the same as angles, as mounting.boresight_deg",
        kind="angles",
        unit="deg",
        members=angle_sets,
    )

    def __post_init__(self) -> None:
        check(self, f"{OF_FURTHER}.mounting")
        for one, alternative in (("imu_m", "from_camera_m"), ("boresight_deg", "boresight")):
            if getattr(self, one) is not None and getattr(self, alternative) is not None:
                problem = f"{alternative} is given as well; keep one of them"
                raise OptionError(f"{OF_FURTHER}.mounting.{one}", problem)

    def on(self, first: "Mounting") -> "Mounting":
        """Return the mounting of this camera on a body.

        Parameters
        ----------
        first : Mounting
            That of the first camera.

        Returns
        -------
        Mounting
            As that of the first camera, vectors from this one and in its axes; the antenna is where
            the first camera's has it.

        Raises
        ------
        InputError
            A matrix is no rotation.
        """
        import numpy as np

        from ...records.cameras.mounting import Mounting, boresight_from_angles

        T, B = self.camera_from_body, self.boresight
        turn = first.camera_from_body if T is None else np.asarray(T, dtype=np.float64)
        if self.boresight_deg is not None:
            boresight = boresight_from_angles(*self.boresight_deg, turn)
        else:
            boresight = np.eye(3) if B is None else np.asarray(B, dtype=np.float64)
        turned = Mounting(camera_from_body=turn, boresight=boresight)
        if self.imu_m is not None:
            imu_m = np.asarray(self.imu_m)
        else:
            offset = np.asarray(self.from_camera_m or (0.0, 0.0, 0.0))
            imu_m = turned.C_cb @ -(first.camera_lever_b + first.C_cb.T @ offset)
        antenna_m = turned.C_cb @ first.antenna_lever_b + imu_m
        return Mounting(antenna_m, imu_m, turn, boresight, first.antenna_sigma_m)


@dataclass(frozen=True)
class CameraInput:
    """Table [camera]; `events` is None where the rover's file holds them (`rover_events`).

    Of a further camera it is None where the trigger of the first one exposes it. In Python `events`
    may be camera events, or an array or table of them, instead of a file, and `mounting` of a
    further camera a `Mounting`.

    Parameters
    ----------
    columns, units, time_scale : how the file of the events is read.
    time_offset_s : added to the times of the events, s.
    clock : "auto", "imu" or "receiver", whose clock stamps the events.
    name : of the camera in the products of a rig.
    prefix : put before the name of each image.
    mounting : of a further camera, `CameraMounting` or `Mounting`; None: that of the first one.
    further : further cameras of the rig.
    match : `ImageMatch`, which images there are.
    rover_events : `RoverEvents`, which events of the rover's RINEX are exposures.
    events : file, record, array or table of the exposures, or None.

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
        cli_meaning="camera events (.MRK, text, dates, directory of images) instead of those of "
        "the rover's file",
    )
    columns: "Columns" = columns_of_file("as imu.columns", of_file=True)
    units: Mapping[str, str] | None = option(
        None,
        "time, as imu.units: of a table whose times are no seconds of the GPS week",
        kind="units",
        members=lambda: ("time",),
        usual="by the header, else s",
        of_file=True,
    )
    time_scale: str | None = option(
        None,
        'scale of events given as dates that do not say it: "utc", "gpst", which is 18 s ahead, or '
        'of a camera in local time "utc+02:00"',
        usual="what the file says; if it says nothing, an error asks for it",
        cli="--time-scale",
        metavar="SCALE",
        of_file=True,
    )
    time_offset_s: float = option(
        0.0,
        "added to the times of the events: the delay from event to mid-exposure",
        unit="s",
        cli="--camera-delay",
    )
    clock: Literal["auto", "imu", "receiver"] = option(
        "auto",
        "clock that stamps the events; its time offset is applied to them. "
        '"receiver": clock of the fixes, with gnss.time_offset_s and the estimated time offset; '
        '"imu": clock of the samples, with imu.time_offset_s; "auto": "receiver" for events of '
        "the rover's RINEX, and of a .MRK beside gnss.rover or a .pos of RTKLIB, else the stamps "
        "are used as times of the IMU's clock",
    )
    name: str = option(
        "",
        "name of the camera in the products of a rig: letters, digits, . _ -",
        usual="camera_1, camera_2, ...",
    )
    prefix: str = option(
        "",
        'put before the name of each image of this camera, such as "left_": names must differ'
        " between cameras",
    )
    mounting: "CameraMounting | Mounting | None" = option(
        None,
        "place and attitude of this camera, below",
        kind="camera_mounting",
        form="table",
        usual="that of the first camera",
        only=OF_FURTHER,
    )
    further: "tuple[CameraInput, ...]" = option(
        (),
        "`[[camera.further]]`, further cameras of a rig: the keys of [camera] but those of the"
        " rover's events, and `mounting`; without `events` the trigger of the first camera exposes"
        " them",
        kind="tables",
        form="tables",
        only="camera",
    )
    match: ImageMatch = field(default_factory=ImageMatch)
    rover_events: RoverEvents = field(default_factory=RoverEvents)

    def __post_init__(self) -> None:
        check(self, "camera")
        take_record(self, "events", "camera_events")
        if self.name and not CAMERA_NAME.fullmatch(self.name):
            raise OptionError("camera.name", "is no name of letters, digits, . _ -", self.name)
        names = self.names
        if twice := [name for k, name in enumerate(names) if name in names[:k]]:
            problem = f"{twice[0]} names two cameras of the rig; give each a name of its own"
            raise OptionError("camera.name", problem)
        if any(camera.further for camera in self.further):
            raise OptionError(
                OF_FURTHER, "a further camera has no further ones; list all beside it"
            )

    @property
    def all_of_rig(self) -> "tuple[CameraInput, ...]":
        """The cameras of the rig, this one first."""
        return (self, *self.further)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the cameras of the rig."""
        return tuple(
            camera.name or f"camera_{k}" for k, camera in enumerate(self.all_of_rig, start=1)
        )

    def mountings(self, first: "Mounting") -> "tuple[Mounting, ...]":
        """Return the placed of the cameras of the rig.

        Parameters
        ----------
        first : Mounting
            That of the first camera, `Flight.mounting`.

        Returns
        -------
        tuple of Mounting
            One a camera.
        """
        placed = (first if camera.mounting is None else camera.mounting for camera in self.further)
        return (first, *(m.on(first) if isinstance(m, CameraMounting) else m for m in placed))
