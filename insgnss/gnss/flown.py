"""The raw observations of a flight file: solved, as the fixes and exposures that a reader of ready positions would give."""

from dataclasses import replace
from math import radians

from ..geodesy.frames import geodetic_to_ecef
from ..records import CameraEvents
from .events import image_names, name_events
from .flight_table import ImageMatch, RawGnss
from .image_times import with_times
from .options import EngineOptions
from .ppk import PpkInput, PpkResult, solve_ppk


def solve_flown(raw: RawGnss, images: ImageMatch | None, events: CameraEvents | None) -> PpkResult:
    """The result, with the exposures of the flight, and of the checks those that no record tells by itself.

    images : of the events, None without a camera.   events : of another file; those of the rover's are then left alone.
    Raises what `ppk.solve_ppk` and `events.name_events` raise.
    """
    if events is not None and images is not None:
        events = _named(events, images)  # before the engine runs
    given = replace(_input(raw), events=None if events is None else False)
    if images is not None and events is None:
        given = replace(
            given,
            events=True,
            images=images.images,
            image_ending=images.image_ending,
            events_containing=images.events_containing,
            skip_events=images.skip_events,
            skip_images=images.skip_images,
        )
    result = solve_ppk(given)
    told = () if result.events is None else result.events.notes
    checks = tuple(check for check in result.checks if check not in told)
    return replace(result, events=result.events if events is None else events, checks=checks)


def _named(events: CameraEvents, images: ImageMatch) -> CameraEvents:
    names = None if images.images is None else image_names(images.images, images.image_ending)
    return with_times(
        lambda taken: name_events(events, names, taken_s=taken, skip_events=images.skip_events, skip_images=images.skip_images),
        images.images,
        names,
    )


def _input(raw: RawGnss) -> PpkInput:
    horizontal, vertical = raw.acceleration_mps2
    options = EngineOptions(
        base_position_m=None if raw.base_position is None else _ecef(raw.base_position),
        base_point=raw.base_point,
        antex=raw.antex,
        systems=raw.systems,
        frequencies=raw.frequencies,
        elevation_mask_deg=raw.elevation_mask_deg,
        ratio=raw.ratio,
        engine=raw.engine,
        max_age_s=raw.max_age_s,
        acceleration_mps2=(horizontal, vertical),
        more=raw.more,
    )
    return PpkInput(
        raw.rover,
        raw.base,
        raw.navigation,
        options,
        covariance=raw.covariance,
        wet_delay=raw.wet_delay,
        atmosphere=raw.atmosphere,
        velocity=raw.phase_velocity,
    )


def _ecef(place: tuple[float, ...]) -> tuple[float, float, float]:
    x, y, z = geodetic_to_ecef(radians(place[0]), radians(place[1]), place[2]).tolist()
    return x, y, z
