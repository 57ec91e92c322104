"""Raw observations of table [gnss] and how they are solved: options of the PPK engine, and the air.

`EngineSettings` are the options that a flight file and `insgnss ppk` share; `gnss.options` adds to
them what the engine needs besides. Options of the command line stand beside the keys.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from ..base.errors import OptionError
from ..base.units import is_number
from ..base.wording import spell
from ..io.options.kinds import (
    OptionKind,
    accept_value,
    as_number,
    by_name,
    check,
    no_mapping,
    register,
)
from ..io.options.schema import Declared, Triple, declared_options, option

Point = Literal["apc", "arp", "marker"]

SYSTEMS_SOLVED = ("G", "R", "E", "J", "C")
ENGINES = ("auto", "pyrtklib5", "rnx2rtkp")
"""What a flight file may name: a file that came from others must not choose a program to run."""

# RTKLIB takes a part of a name for the whole: "ile-tempdir" would set file-tempdir
OPTION_NAME = r"(?:pos[12]|out|stats|ant[12]|misc|file)-[A-Za-z0-9_]+"
_OURS = re.compile(r"out-|file-|ant[12]-pos|pos1-(posmode|soltype|frequency|elmask|navsys)$")
_SET_BY = {
    "out-": "insgnss has to read the output",
    "ant1-pos": "the rover moves",
    "pos1-posmode": "it is always kinematic",
    "pos1-soltype": "insgnss runs both forward and backward",
}
_SET_BY_KEY = {
    "file-": "gnss.antex",
    "ant2-pos": "gnss.base_position",
    "pos1-frequency": "gnss.frequencies",
    "pos1-elmask": "gnss.elevation_mask_deg",
    "pos1-navsys": "gnss.systems",
}


@dataclass(frozen=True)
class Air:
    """Table gnss.atmosphere: the air at the base, as far as it is known."""

    pressure_hpa: float | None = option(
        None,
        "air pressure at the base, not reduced to sea level, for the corrections of wet delay and"
        " ionosphere",
        unit="hPa",
        low=300.0,
        high=1100.0,
        cli="--pressure",
        usual="standard",
    )
    temperature_c: float | None = option(
        None,
        "temperature of the air at the base",
        unit="C",
        low=-60.0,
        high=60.0,
        cli="--temperature",
        usual="standard",
    )
    humidity: float | None = option(
        None,
        "relative humidity of the air at the base",
        low=0.0,
        high=1.0,
        cli="--humidity",
        metavar="SHARE",
        usual="0.7",
    )


@dataclass(frozen=True)
class EngineSettings:
    """What the PPK engine is asked for; OptionError for a value that cannot be."""

    base_point: Point | None = option(
        None,
        "point to which the base position refers: the antenna's phase centre (apc), its reference"
        " point (arp) or the marker; required with gnss.base_position",
        cli="--base-point",
        cli_meaning=(
            "point to which the base position refers: the antenna's phase centre (apc), its"
            " reference point (arp) or the marker"
        ),
        cli_default="apc, with a note",
    )
    antex: Path | None = option(
        None,
        "ANTEX file of antenna phase centres; required if the base point is arp or marker",
        cli="--antex",
    )
    systems: str = option(
        "GREJC",
        "satellites to use: GPS G, GLONASS R, Galileo E, QZSS J, BeiDou C",
        kind="letters",
        choices=SYSTEMS_SOLVED,
        cli="--systems",
        metavar="LETTERS",
    )
    frequencies: int = option(
        2,
        "number of frequencies to use; 1: L1, 2: also L2 or E5b, 3: also L5",
        low=1,
        high=3,
        choices=(1, 2, 3),
        cli="--frequencies",
    )
    elevation_mask_deg: float = option(
        15.0,
        "satellites below this elevation are left out",
        unit="deg",
        low=0.0,
        high=60.0,
        cli="--mask",
    )
    ratio: float = option(
        3.0,
        "least ratio at which the ambiguity test passes",
        low=1.0,
        high=100.0,
        cli="--ratio",
        metavar="R",
    )
    engine: str = option(
        "auto",
        'engine that solves: "pyrtklib5", or "rnx2rtkp", the program of that name on PATH; "auto": '
        "the first of both that is installed; another program can be named only on the command "
        "line (`insgnss process --engine`), so that a flight file from others cannot start it",
        kind="engine",
        cli="--engine",
        cli_meaning=(
            "GNSS engine: pyrtklib5, or the path or name of an rnx2rtkp; auto: the first of the"
            " two that is installed"
        ),
    )
    max_age_s: float = option(
        30.0,
        "longest time between an epoch of the rover and the base epoch used with it",
        unit="s",
        low=0.01,
        high=3600.0,
        cli="--max-age",
    )
    timeout_s: float = option(
        7200.0,
        "time limit for each of the engine's two runs; a longer run is stopped",
        unit="s",
        low=1.0,
        high=1e6,
        cli="--timeout",
    )
    acceleration_mps2: tuple[float, float] = option(
        (3.0, 1.0),
        "process noise of the rover's acceleration, horizontal and vertical; the engine's dynamics"
        " model is off if epochs are too far apart",
        unit="m/s^2",
        positive=True,
        cli="--acceleration",
        metavar="A",
    )
    rtklib_options: Mapping[str, str] = option(
        dict,
        "further options of RTKLIB by name, { pos2-arminfix = 10 }",
        kind="rtklib",
        form="table of numbers and texts",
        cli="--rtklib-options",
        metavar="NAME=VALUE",
        cli_meaning="further options of RTKLIB by name, such as pos2-arminfix=10",
    )

    def __post_init__(self) -> None:
        check(self, "gnss")


def _as_texts(item: Declared, value: Any) -> Any:
    """Numbers and texts of a mapping as texts, as RTKLIB's option file has them."""
    if not isinstance(value, Mapping):
        return value
    return {name: str(x) if is_number(x) else x for name, x in value.items()}


def _no_rtklib(item: Declared, value: Any) -> str:
    if problem := no_mapping(item, value):
        return problem
    for name, setting in value.items():
        if not isinstance(setting, str):
            expected = "expected a number or a text, as in RTKLIB's option file"
            return f"{name} = {setting!r}, {expected}"
        if problem := rtklib_problem(name, setting):
            return problem
    return ""


def _no_air(item: Declared, name: str, value: Any) -> str:
    try:
        accept_value(declared_options(Air)[name], value, name)
    except OptionError as refusal:
        return refusal.problem
    return ""


register("air", OptionKind(no_mapping, by_name(as_number), _no_air))
register("rtklib", OptionKind(_no_rtklib, _as_texts, several=True))


def rtklib_problem(name: str, value: object) -> str:
    """What is wrong with a further option of RTKLIB, empty where it may be set."""
    if not re.fullmatch(OPTION_NAME, name):
        return f"{name[:60]!r} is not the name of an RTKLIB option, such as pos2-arminfix"
    if _OURS.match(name):
        keys = (
            f"{spell(key)} sets it"
            for prefix, key in _SET_BY_KEY.items()
            if name.startswith(prefix)
        )
        why = next(keys, "") or next(
            why for prefix, why in _SET_BY.items() if name.startswith(prefix)
        )
        return f"{name[:60]} cannot be set there: {why}"
    if re.search(r"[\r\n#]", str(value)):
        return f"the value of {name} contains # or a line break; remove it"
    return ""


@dataclass(frozen=True)
class RawGnss(EngineSettings):
    """RINEX of rover and base in table [gnss], and how it is solved.

    base_position is latitude, longitude (deg) and ellipsoidal height (m).
    """

    rover: Path | tuple[Path, ...] = option(
        ...,
        "observations of the rover, RINEX 2 or 3 (plain, .gz, .Z, Hatanaka; rinex.md), for PPK"
        " instead of gnss.file (needs `pip install '.[ppk]'`); consecutive files as a list or a"
        " pattern (rover/*.18o)",
        kind="observations",
        form="path or list of paths",
        cli="ROVER",
        cli_meaning="observations of the rover, RINEX 2 or 3, also compressed; consecutive files"
        " are joined",
    )
    base: Path | tuple[Path, ...] = option(
        ...,
        "observations of the base, as for the rover; for example hourly files of a station",
        kind="observations",
        form="path or list of paths",
        cli="--base",
        cli_meaning="observations of the base; several files (hourly ones) are joined",
    )
    navigation: tuple[Path, ...] = option(
        ..., "broadcast ephemerides of all systems, RINEX 2, 3 or 4", cli="--navigation"
    )
    base_position: Triple | None = option(
        None,
        "position of the base; checked against its code observations (rinex.md)",
        kind="place",
        usual="of the base's header, with a warning",
        cli="--base-position",
        metavar="LAT,LON,H",
        cli_meaning="position of the base, deg, deg, ellipsoidal m",
    )
    wet_delay: bool = option(
        True,
        "correct heights for the difference in tropospheric wet delay between base and rover,"
        " which the engine does not apply",
        cli="--no-wet-delay",
        cli_meaning="do not correct heights for the wet delay between base and rover",
    )
    ionosphere: bool = option(
        True,
        "correct fixed positions for the ionospheric difference between base and rover, determined"
        " from two frequencies, which the engine does not apply; for flights of at least 5"
        " minutes, up to 10 km from the base",
        cli="--no-ionosphere",
        cli_meaning="do not correct positions for the ionosphere between base and rover",
    )
    atmosphere: Mapping[str, float] | None = option(
        None,
        "measured air pressure, temperature and humidity at the base, for the corrections of wet"
        " delay and ionosphere",
        kind="air",
        form="table, below",
        usual="standard",
    )
    phase_velocity: bool = option(
        True,
        "velocities from the rover's carrier phase; false: fixes without velocity",
        cli="--no-velocity",
        cli_meaning="leave out the velocities from the rover's carrier phase",
    )

    @property
    def files(self) -> tuple[Path, ...]:
        """Every file that the solution depends on."""
        antex = (self.antex,) if self.antex else ()
        return (*all_of(self.rover), *all_of(self.base), *self.navigation, *antex)


def all_of(files: Path | tuple[Path, ...]) -> tuple[Path, ...]:
    """Return one file or several as a tuple."""
    return files if isinstance(files, tuple) else (files,)


OF_POSITIONS = (
    "columns",
    "units",
    "undulation_m",
    "sigma_m",
    "sigma_velocity_mps",
    "variable",
    "repeat_column",
    "calibrate_covariance",
)
"""Keys of ready positions, which raw observations do not take."""
