"""What PPK reads of a flight file: of [gnss] the raw observations and how they are solved, of [camera] how events get their images.

The keys and their defaults are documented in `insgnss.flight` and data_specs/flight_file.md. Wrong ones are refused with file and line.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, Literal

from ..errors import InputError, UsageError
from ..tables import Table
from .covariance import MODEL, CovarianceModel
from .covariance_table import covariance_of
from .options import RANGES, SYSTEM_BITS, EngineOptions
from .troposphere import standard_atmosphere

AIR = ("pressure_hpa", "temperature_c", "humidity")
OF_POSITIONS = ("columns", "units", "undulation_m", "sigma_m", "sigma_velocity_mps", "variable", "new_when")


@dataclass(frozen=True)
class RawGnss:
    """rover, base and navigation of [gnss], and how they are solved; base_position: latitude, longitude (deg), ellipsoidal height (m).

    atmosphere : by the names of `gnss.troposphere.Atmosphere`, as far as known, None for the standard one.
    """

    rover: Path
    base: Path
    navigation: tuple[Path, ...]
    base_position: tuple[float, ...] | None = None
    base_point: Literal["apc", "arp", "marker"] | None = None
    antex: Path | None = None
    systems: str = "GREJC"
    frequencies: int = 2
    elevation_mask_deg: float = 15.0
    ratio: float = 3.0
    engine: str = "auto"
    max_age_s: float = 30.0
    acceleration_mps2: tuple[float, ...] = (3.0, 1.0)
    more: Mapping[str, str] = field(default_factory=dict)
    wet_delay: bool = True
    atmosphere: Mapping[str, float] | None = None
    phase_velocity: bool = True
    covariance: CovarianceModel = MODEL


@dataclass(frozen=True)
class ImageMatch:
    """What of [camera] brings events to images: `images` a directory or a list of names, None for the events' own names."""

    images: Path | None = None
    image_ending: str | None = None
    skip_events: tuple[int, ...] = ()
    skip_images: tuple[str, ...] = ()
    events_containing: str = ""


def raw_gnss(table: Table) -> RawGnss | None:
    """The raw observations of a table [gnss], None where none are given. Raises InputError with file and line."""
    needed = ("rover", "base", "navigation")
    given = [f.name for f in fields(RawGnss) if f.name in table.data]
    if not given:
        return None
    for other in ("file", "stationary"):
        if other in table.data:
            raise table.error(given[0], f"gnss.{other} is given as well; keep one of them")
    if missing := [key for key in needed if key not in table.data]:
        raise table.error(given[0], f"gnss.{missing[0]} is missing; RINEX of {', '.join(needed)} belong together")
    if odd := [key for key in OF_POSITIONS if key in table.data]:
        raise table.error(odd[0], "is of ready positions (gnss.file), but gnss.rover is given; leave it out, RINEX says it itself")
    navigation = tuple(table.resolve(name) for name in table.texts("navigation", ()))
    if lost := [file for file in navigation if not file.is_file()]:
        raise table.error("navigation", f"{lost[0]} does not exist; paths are relative to flight.toml")
    place = table.numbers("base_position", 3, None)
    if place is not None and not (abs(place[0]) <= 90 and abs(place[1]) <= 180 and -1000 <= place[2] <= 10000):
        raise table.error("base_position", f"{list(place)} is no latitude, longitude (deg), ellipsoidal height (m)")
    point = table.choice("base_point", ("apc", "arp", "marker"), "apc") if "base_point" in table.data else None
    if place is not None and point is None:
        raise table.error("base_position", 'say what stands there: base_point = "apc" (phase centre), "arp" or "marker"')
    return RawGnss(
        rover=table.file("rover"),
        base=table.file("base"),
        navigation=navigation,
        base_position=place,
        base_point=point,
        antex=table.file("antex") if "antex" in table.data else None,
        **_engine_options(table),
        wet_delay=table.flag("wet_delay", True),
        atmosphere=_atmosphere(table),
        phase_velocity=table.flag("phase_velocity", True),
        covariance=covariance_of(table.table("covariance")),
    )


def _engine_options(table: Table) -> dict[str, Any]:
    """What the engine is asked for, in the ranges of `gnss.options`."""
    systems = table.text("systems", "GREJC")
    if not set(systems) <= set(SYSTEM_BITS):
        raise table.error("systems", f"{systems!r} is no text of the letters {''.join(SYSTEM_BITS)}")
    moves = table.numbers("acceleration_mps2", 2, (3.0, 1.0))
    if min(moves) <= 0.0:
        raise table.error("acceleration_mps2", f"{list(moves)}: both must be greater than zero, horizontal and vertical")
    engine = table.text("engine", "auto")
    program = table.resolve(engine)
    defaults = {"elevation_mask_deg": 15.0, "ratio": 3.0, "max_age_s": 30.0}
    return {
        "systems": systems,
        "frequencies": _whole(table, "frequencies", 2, 1, 3),
        "acceleration_mps2": moves,
        "engine": str(program.absolute()) if program.is_file() else engine,
        "more": _more(table),
        **{key: table.number(key, default, *RANGES[key]) for key, default in defaults.items()},
    }


def _more(table: Table) -> dict[str, str]:
    """Further options of RTKLIB; names and values are those of its option file."""
    more = table.value("more", dict, {})
    for name, value in more.items():
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            raise table.error("more", f"{name} = {value!r}, expected a number or a text, as in RTKLIB's option file")
        try:
            EngineOptions(more={name: str(value)})
        except UsageError as refusal:
            raise table.error("more", str(refusal).partition(": ")[2]) from None
    return {name: str(value) for name, value in more.items()}


def _whole(table: Table, key: str, default: int, low: float, high: float) -> int:
    number = table.number(key, default, low, high)
    if number != int(number):
        raise table.error(key, f"{number:g} is no whole number")
    return int(number)


def _atmosphere(table: Table) -> dict[str, float] | None:
    """Air at the base, as far as it is given."""
    air = table.table("atmosphere")
    found = {key: air.number(key) for key in air.data}
    if found and not table.flag("wet_delay", True):
        raise table.error("atmosphere", "is of the wet delay, which gnss.wet_delay = false leaves out; keep one of them")
    for key, value in found.items():
        try:
            standard_atmosphere(0.0, **{key: value})
        except InputError as refusal:
            raise air.error(key, str(refusal).partition(": ")[2]) from None
    return found or None


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
    ending, containing = table.text("image_ending", None), table.text("events_containing", None)
    return ImageMatch(images, ending, tuple(skipped), table.texts("skip_images", ()), containing or "")
