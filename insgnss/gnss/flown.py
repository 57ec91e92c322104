"""The raw observations of a flight file: solved, as the fixes and exposures that a reader of ready positions would give."""

from dataclasses import replace
from math import radians
from pathlib import Path
from typing import Protocol

from ..geodesy.frames import geodetic_to_ecef
from ..records import CameraEvents
from .options import EngineOptions, Point
from .ppk import PpkInput, PpkResult, solve_ppk


class RawObservations(Protocol):
    """Table [gnss] of a flight file with rover, base and navigation; base_position: latitude, longitude (deg), height (m)."""

    @property
    def rover(self) -> Path: ...
    @property
    def base(self) -> Path: ...
    @property
    def navigation(self) -> tuple[Path, ...]: ...
    @property
    def base_position(self) -> tuple[float, ...] | None: ...
    @property
    def base_point(self) -> Point | None: ...
    @property
    def antex(self) -> Path | None: ...
    @property
    def systems(self) -> str: ...
    @property
    def frequencies(self) -> int: ...
    @property
    def elevation_mask_deg(self) -> float: ...
    @property
    def ratio(self) -> float: ...


def solve_flown(raw: RawObservations, images: Path | None, events: CameraEvents | None) -> PpkResult:
    """The result, with the exposures of the flight, and of the checks those that no record tells by itself.

    images : names of the rover's events, see `events.image_names`.   events : of another file; those of the rover's are then left alone.
    Raises what `ppk.solve_ppk` raises.
    """
    options = EngineOptions(
        base_position_m=None if raw.base_position is None else _ecef(raw.base_position),
        base_point=raw.base_point,
        antex=raw.antex,
        systems=raw.systems,
        frequencies=raw.frequencies,
        elevation_mask_deg=raw.elevation_mask_deg,
        ratio=raw.ratio,
    )
    result = solve_ppk(PpkInput(raw.rover, raw.base, raw.navigation, options, images=images, events=events is None))
    told = () if result.events is None else result.events.notes
    checks = tuple(check for check in result.checks if check not in told)
    return replace(result, events=result.events if events is None else events, checks=checks)


def _ecef(place: tuple[float, ...]) -> tuple[float, float, float]:
    x, y, z = geodetic_to_ecef(radians(place[0]), radians(place[1]), place[2]).tolist()
    return x, y, z
