"""What PPK reads of a flight file: of [gnss] the raw observations and how they are solved.

The keys are documented in `insgnss.flight` and data_specs/flight_file.md; those of the engine have the defaults of `gnss.options`. Wrong
ones are refused with file and line.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from ..errors import InputError, UsageError
from ..tables import Table
from .options import RANGES, SYSTEM_BITS, EngineOptions, Point

AIR = ("pressure_hpa", "temperature_c", "humidity")
OF_POSITIONS = ("columns", "units", "undulation_m", "sigma_m", "sigma_velocity_mps", "variable", "new_when", "calibrated")


@dataclass(frozen=True)
class RawGnss:
    """rover, base and navigation of [gnss], and how they are solved; base_position: latitude, longitude (deg), ellipsoidal height (m).

    atmosphere : by the names of `gnss.troposphere.Atmosphere`, as far as known, None for the standard one.
    """

    rover: Path
    base: Path
    navigation: tuple[Path, ...]
    base_position: tuple[float, ...] | None = None
    base_point: Point | None = None
    antex: Path | None = None
    systems: str = EngineOptions.systems
    frequencies: int = EngineOptions.frequencies
    elevation_mask_deg: float = EngineOptions.elevation_mask_deg
    ratio: float = EngineOptions.ratio
    engine: str = EngineOptions.engine
    max_age_s: float = EngineOptions.max_age_s
    timeout_s: float = EngineOptions.timeout_s
    acceleration_mps2: tuple[float, float] = EngineOptions.acceleration_mps2
    more: Mapping[str, str] = field(default_factory=dict)
    wet_delay: bool = True
    ionosphere: bool = True
    atmosphere: Mapping[str, float] | None = None
    phase_velocity: bool = True

    @property
    def files(self) -> tuple[Path, ...]:
        """Every file that the solution depends on."""
        return (self.rover, self.base, *self.navigation, *((self.antex,) if self.antex else ()))


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
        raise table.error(odd[0], "is of ready positions (gnss.file), but gnss.rover is given; leave it out")
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
        ionosphere=table.flag("ionosphere", True),
        atmosphere=_atmosphere(table),
        phase_velocity=table.flag("phase_velocity", True),
    )


def _engine_options(table: Table) -> dict[str, Any]:
    """What the engine is asked for, in the ranges of `gnss.options`."""
    systems = table.text("systems", EngineOptions.systems)
    if not set(systems) <= set(SYSTEM_BITS):
        raise table.error("systems", f"{systems!r} is no text of the letters {''.join(SYSTEM_BITS)}")
    moves = table.numbers("acceleration_mps2", 2, EngineOptions.acceleration_mps2)
    if min(moves) <= 0.0:
        raise table.error("acceleration_mps2", f"{list(moves)}: both must be greater than zero, horizontal and vertical")
    engine = table.text("engine", EngineOptions.engine)
    program = table.resolve(engine)
    return {
        "systems": systems,
        "frequencies": _whole(table, "frequencies", EngineOptions.frequencies, 1, 3),
        "acceleration_mps2": moves,
        "engine": str(program.absolute()) if program.is_file() else engine,
        "more": _more(table),
        **{key: table.number(key, getattr(EngineOptions, key), *limits) for key, limits in RANGES.items()},
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
    from .troposphere import standard_atmosphere

    air = table.table("atmosphere")
    found = {key: air.number(key) for key in air.data}
    if found and not (table.flag("wet_delay", True) or table.flag("ionosphere", True)):
        raise table.error("atmosphere", "is of the corrections that gnss.wet_delay and ionosphere = false leave out; keep one of them")
    for key, value in found.items():
        try:
            standard_atmosphere(0.0, **{key: value})
        except InputError as refusal:
            raise air.error(key, str(refusal).partition(": ")[2]) from None
    return found or None
