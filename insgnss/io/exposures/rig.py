"""The exposures of all cameras of a rig, whose clock stamps them, and the instants they share.

Two cameras may be exposed at one instant, and the names of their images are no more than names:
the filter knows instants alone. Stamps of any cameras that are closer to each other than `SHARED_S`
are of one instant; its pose and covariance are computed once and serve all images taken then.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError
from ...records import CameraEvents
from ..formats.events.events import UNNAMED
from ..options.camera_options import CameraInput
from .naming import events_of, named

SHARED_S = 1e-7  # within which `navigation.prepare.increments` takes instants for one
EventClock = Literal["imu", "receiver"]


class ClockOffsets(NamedTuple):
    """What is added to stamps, s, so that all count on one clock.

    Parameters
    ----------
    imu, gnss : of the IMU and of the fixes.
    unstated : of what stands on the IMU's clock as its file has it.
    """

    imu: float = 0.0
    gnss: float = 0.0
    unstated: float = 0.0


@dataclass(frozen=True)
class CameraExposures:
    """The exposures of one camera of a rig.

    Parameters
    ----------
    name : str
        Of the camera.
    events : CameraEvents
        The exposures.
    clock : {"imu", "receiver"}
        Whose clock stamps them; the receiver's is that of the fixes.
    triggered : bool
        Whether the trigger of the first camera exposes it, so that errors of the stamps are common.
    """

    name: str
    events: CameraEvents
    clock: EventClock = "imu"
    triggered: bool = False

    def moved(self, offset_s: float) -> "CameraExposures":
        """Return the exposures with their stamps moved by `offset_s`, s."""
        return replace(self, events=replace(self.events, time=self.events.time + offset_s))


def own_events(camera: CameraInput, gps_week: int | None) -> CameraEvents | None:
    """Read the events of a camera as its file has them, without the names of its images.

    Parameters
    ----------
    camera : CameraInput
        Table of the camera.
    gps_week : int or None
        The GPS week of a file that carries the time of week alone.

    Returns
    -------
    CameraEvents or None
        None where no file or object has them.
    """
    events = camera.events
    if events is None or isinstance(events, CameraEvents):
        return events
    return events_of(
        events,
        camera.match.image_ending,
        columns=camera.columns,
        gps_week=gps_week,
        units=camera.units,
        time_scale=camera.time_scale,
    )


def with_names(events: CameraEvents, camera: CameraInput) -> CameraEvents:
    """Give the events of a camera the names of its images, with its prefix.

    Parameters
    ----------
    events : CameraEvents
        The exposures.
    camera : CameraInput
        Table of the camera.

    Returns
    -------
    CameraEvents
        The exposures that have images.
    """
    events = named(events, camera.match)
    if not camera.prefix:
        return events
    return replace(events, images=tuple(f"{camera.prefix}{name}" for name in events.images))


def triggered_events(trigger: CameraEvents, camera: CameraInput) -> CameraEvents:
    """Return the exposures of a further camera that the trigger of the first one exposes.

    Parameters
    ----------
    trigger : CameraEvents
        The events of the first camera, before these got the names of its images.
    camera : CameraInput
        Table of the further camera.

    Returns
    -------
    CameraEvents
        With the names of its own images where there are some, else with those of the trigger.
    """
    events = replace(trigger, notes=())
    if camera.match.images is not None:
        numbers = tuple(str(k) for k in range(1, len(trigger) + 1))
        events = replace(events, images=numbers)
    events = with_names(events, camera)
    return replace(events, notes=tuple(note for note in events.notes if note.name != UNNAMED))


class FixSource(Protocol):
    """What the table [gnss] says of where the fixes come from."""

    @property
    def file(self) -> Any:
        """The file of the antenna positions, or what stands in its place."""

    @property
    def raw(self) -> Any:
        """Raw observations; None where there are none."""


def event_clock(camera: CameraInput | None, gnss: FixSource) -> EventClock:
    """Tell whose clock stamps the events of a camera (`camera.clock`).

    Parameters
    ----------
    camera : CameraInput or None
        Table of the camera.
    gnss : FixSource
        Table of the fixes.

    Returns
    -------
    {"imu", "receiver"}
        "receiver" where the flight file says so, or leaves it open and the receiver of the fixes
        wrote the events itself: in the rover's RINEX, or in a .MRK beside raw observations or
        positions of RTKLIB, which keep the stamps of the receiver; a log or a stream has its own.
        "imu" without a camera.
    """
    from ..formats import sniff_events, sniff_gnss

    if camera is None:
        return "imu"
    if camera.clock != "auto":
        return camera.clock
    if camera.events is None:
        return "receiver"
    if not isinstance(camera.events, Path) or camera.events.is_dir():
        return "imu"
    form = sniff_events(camera.events)
    if form == "events_pos":
        return "receiver"
    if form != "mrk":
        return "imu"
    of_receiver = gnss.raw is not None or (
        isinstance(gnss.file, Path) and sniff_gnss(gnss.file) == "rtklib_pos"
    )
    return "receiver" if of_receiver else "imu"


def rig_exposures(
    camera: CameraInput | None,
    gnss: FixSource,
    first: CameraEvents,
    trigger: CameraEvents | None,
    gps_week: int | None,
) -> tuple[CameraExposures, ...]:
    """Return the exposures of all cameras of a rig, each with its clock.

    Parameters
    ----------
    camera : CameraInput or None
        Table of the first camera; None for events of the rover's file, which no table asks for.
    gnss : FixSource
        Table of the fixes.
    first : CameraEvents
        The events of the first camera, with the names of its images.
    trigger : CameraEvents or None
        The same before they got names; None where no further camera is exposed by them.
    gps_week : int or None
        The GPS week of a file that carries the time of week alone.

    Returns
    -------
    tuple of CameraExposures
        One a camera.

    Raises
    ------
    InputError
        Where the first camera has no exposure.
    """
    if not first.images:
        raise InputError.in_file(first.source, "no exposures; leave them out for the trajectory")
    clock = event_clock(camera, gnss)
    if camera is None:
        return (CameraExposures("camera_1", first, clock),)
    cameras = [CameraExposures(camera.names[0], first, clock)]
    for name, further in zip(camera.names[1:], camera.further, strict=True):
        events = own_events(further, gps_week)
        triggered = events is None
        if events is None:
            assert trigger is not None
            events = triggered_events(trigger, further)
            of_clock = clock if further.clock == "auto" else further.clock
        else:
            events, of_clock = with_names(events, further), event_clock(further, gnss)
        cameras.append(CameraExposures(name, events, of_clock, triggered))
    return tuple(cameras)


def merged_instants(cameras: Sequence[CameraExposures]) -> CameraEvents:
    """Return the instants at which any camera is exposed.

    Parameters
    ----------
    cameras : sequence of CameraExposures
        Those of the rig; of a single camera the result is its events.

    Returns
    -------
    CameraEvents
        An instant each, with the name of an image that was taken then.
    """
    if len(cameras) == 1:
        return cameras[0].events
    time = np.concatenate([camera.events.time for camera in cameras])
    images = [name for camera in cameras for name in camera.events.images]
    order = np.argsort(time, kind="stable")
    rows = order[np.concatenate([[True], np.diff(time[order]) > SHARED_S])]
    source = ", ".join(dict.fromkeys(camera.events.source for camera in cameras))
    week = cameras[0].events.gps_week
    return CameraEvents(tuple(images[k] for k in rows), time[rows], week, source)


def instants_of(camera: CameraExposures, instants: CameraEvents) -> NDArray[np.int64]:
    """Return the row of the instant of each exposure of a camera.

    Parameters
    ----------
    camera : CameraExposures
        The exposures.
    instants : CameraEvents
        `merged_instants` of its rig.

    Returns
    -------
    ndarray
        (n,) rows.
    """
    index_after = np.searchsorted(instants.time, camera.events.time, side="right")
    return np.maximum(index_after - 1, 0).astype(np.int64)


@dataclass(frozen=True)
class ExposedRows:
    """Which exposures of a camera are at which instants of a segment.

    Parameters
    ----------
    rows : ndarray
        (n,) rows of the camera's exposures, increasing.
    instant : ndarray
        (n,) of the segment's instants, numbered from 0, the one of each.
    """

    rows: NDArray[np.int64]
    instant: NDArray[np.int64]


def exposed_rows(
    cameras: Sequence[CameraExposures], instants: CameraEvents | None, chosen: NDArray[np.int64]
) -> tuple[ExposedRows, ...]:
    """Return which exposures of each camera are at some of the instants.

    Parameters
    ----------
    cameras : sequence of CameraExposures
        Those of the rig.
    instants : CameraEvents or None
        Their `merged_instants`; None without a camera.
    chosen : ndarray
        (e,) increasing rows of the instants.

    Returns
    -------
    tuple of ExposedRows
        One a camera.
    """
    if instants is None:
        return ()
    number = np.full(len(instants), -1, dtype=np.int64)
    number[chosen] = np.arange(chosen.size)
    exposed = []
    for camera in cameras:
        instant = number[instants_of(camera, instants)]
        rows = np.flatnonzero(instant >= 0)
        exposed.append(ExposedRows(rows, instant[rows]))
    return tuple(exposed)


def refuse_same_names(cameras: Sequence[CameraExposures], where: str) -> None:
    """Refuse a name that images of two cameras have.

    Parameters
    ----------
    cameras : sequence of CameraExposures
        Those of the rig.
    where : str
        The flight file, for the message.

    Raises
    ------
    InputError
        With the first such name.
    """
    first: dict[str, str] = {}
    for camera in cameras:
        for image in camera.events.images:
            if (earlier := first.setdefault(image, camera.name)) != camera.name:
                raise InputError(
                    f"{where}: camera.further: image {image} is one of camera {earlier} and one of"
                    f" camera {camera.name}; tell them apart by camera.further prefix ="
                    f' "{camera.name}_", or by the names of their files with camera.further images'
                )
