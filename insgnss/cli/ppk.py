"""The verb `ppk`: RINEX of rover and base to antenna positions, a figure and ppk.json."""

import argparse
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InputError, InsgnssError, UsageError
from ..files import atomic_write, json_ready
from ..gnss.verb_words import check_in_options, in_options
from .console import Progress
from .verb import Verb, show_result

if TYPE_CHECKING:
    from ..gnss.ppk import PpkInput, PpkResult

Draw = Callable[[Mapping[str, Any]], bytes]

EXAMPLE = """\
  insgnss ppk rover.18o --base master.18o --navigation rover.18n rover.18g --base-position 46.5712345,6.5412345,512.345
  insgnss ppk rover.obs --base base.obs --navigation base.nav --base-position 35.1347,136.9776,104.85 --base-point apc --images photos
  insgnss ppk rover.18o.gz --base ref.18d.Z --navigation brdc.18n --origin 46.57,6.54,0 --camera-delay 0.0012"""
FIGURE, DOCUMENT = "gnss_quality.png", "ppk.json"
LARGEST_HEIGHT_M = 10000.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the verb; of the engine those that are not given keep the defaults of `gnss.options`."""
    parser.add_argument("rover", type=Path, metavar="ROVER", help="observations of the rover, RINEX 2 or 3, plain or packed")
    parser.add_argument("--base", type=Path, required=True, metavar="FILE", help="observations of the base")
    parser.add_argument(
        "--navigation", type=Path, required=True, nargs="+", action="extend", metavar="FILE", help="broadcast ephemerides of all systems"
    )
    where = "deg, deg, ellipsoidal m (default: the header's, with a warning)"
    parser.add_argument("--base-position", metavar="LAT,LON,H", help=where)
    what = "what stands there: the antenna's phase centre, its reference point, or the marker (default: apc, with a note)"
    parser.add_argument("--base-point", choices=("apc", "arp", "marker"), help=what)
    parser.add_argument("--antex", type=Path, metavar="FILE", help="phase centres of antennas, for arp and marker")
    parser.add_argument("--mask", type=float, metavar="DEG", help="lowest elevation (default: 15)")
    parser.add_argument("--systems", metavar="LETTERS", help="GPS G, GLONASS R, Galileo E, QZSS J, BeiDou C (default: all)")
    parser.add_argument("--frequencies", type=int, choices=(1, 2, 3), help="1: L1, 2: and L2 or E5b, 3: and L5 (default: 2)")
    parser.add_argument("--ratio", type=float, metavar="R", help="of the ambiguity test (default: 3)")
    parser.add_argument("--engine", metavar="NAME", help="pyrtklib5, or the path of an rnx2rtkp (default: what is there)")
    parser.add_argument("--max-age", type=float, metavar="S", help="longest time to the base's epoch (default: 30)")
    parser.add_argument("--timeout", type=float, metavar="S", help="longest time of one of the engine's three runs (default: 7200)")
    what = "what the vehicle does, horizontally and vertically, m/s^2 (default: 3 1)"
    parser.add_argument("--acceleration", type=float, nargs=2, metavar="A", help=what)
    what = "further options of RTKLIB by name, such as pos2-arminfix=10"
    parser.add_argument("--more", nargs="+", action="extend", default=[], metavar="NAME=VALUE", help=what)
    what = "TOML file of changes to the covariance model: its fields, of scale and floor_m tables by class (data_specs/flight_file.md)"
    parser.add_argument("--covariance", type=Path, metavar="FILE", help=what)
    parser.add_argument("--events", type=Path, metavar="FILE", help="camera events (.MRK, text) instead of those of the rover's file")
    parser.add_argument("--images", type=Path, metavar="PLACE", help="directory of the images, or a list of their names in order")
    parser.add_argument("--image-ending", metavar="EXT", help="of the images to take from a directory of several formats")
    parser.add_argument("--camera-delay", type=float, default=0.0, metavar="S", help="from event to middle of exposure (default: 0)")
    parser.add_argument("--events-containing", default="", metavar="TEXT", help="take only events whose record lines hold this text")
    what = "take also events of the rover's file that it marks as not valid"
    parser.add_argument("--invalid-events", action="store_true", help=what)
    parser.add_argument(
        "--skip-events", type=int, nargs="+", action="extend", default=[], metavar="N", help="numbers, from 1, of events without an image"
    )
    parser.add_argument("--skip-images", nargs="+", action="extend", default=[], metavar="NAME", help="images without an event")
    parser.add_argument("--no-wet-delay", action="store_true", help="leave the wet delay between base and rover in the heights")
    parser.add_argument("--no-ionosphere", action="store_true", help="leave the ionosphere between base and rover in the positions")
    parser.add_argument(
        "--pressure", type=float, metavar="HPA", help="of the air at the base, for wet delay and ionosphere (default: standard)"
    )
    parser.add_argument("--temperature", type=float, metavar="C", help="of the air at the base (default: standard)")
    parser.add_argument("--humidity", type=float, metavar="SHARE", help="of the air at the base, 0 to 1 (default: 0.7)")
    parser.add_argument("--no-velocity", action="store_true", help="leave out the velocities from the rover's carrier phase")
    parser.add_argument("--origin", metavar="LAT,LON,H", help="of the tangent plane (default: the first fix, at height 0)")
    parser.add_argument("--out", type=Path, default=Path("ppk"), metavar="DIR", help="where the files go (default: ppk)")


@dataclass(frozen=True, eq=False)
class PpkRun:
    """A result and the files that were written of it."""

    result: "PpkResult"
    given: "PpkInput"
    files: tuple[Path, ...]

    def summary(self) -> str:
        """What a person reads."""
        mark = {"ok": "ok  ", "note": "note", "contradiction": "BAD "}
        width = max(len(check.name) for check in self.result.checks)
        lines = [self.result.verdict]
        for check in self.result.checks:
            lines.append(f"{mark[check.verdict]}  {check.name:<{width}}  {check.found}")
            if check.verdict != "ok":
                lines.append(f"      {'':<{width}}  expected: {check.expected}" + (f"; {check.advice}" if check.advice else ""))
        return "\n".join([*lines, f"{self.result.engine}, {self.result.cpu_s:.1f} s of CPU", *(str(path) for path in self.files)])

    def as_dict(self) -> dict[str, Any]:
        """JSON-able."""
        from .. import __version__

        result = self.result
        return {
            "insgnss": __version__,
            "engine": result.engine,
            "cpu_s": result.cpu_s,
            "verdict": result.verdict,
            "quality": result.quality,
            "checks": [asdict(check) for check in result.checks],
            "input": asdict(self.given),
            "files": [str(path) for path in self.files],
        }


def ppk(given: argparse.Namespace, progress: Progress, draw: Draw) -> PpkRun:
    """Do what the parsed command line asks for.

    draw : PNG of the series of a result (`report.gnss.draw_quality`).   Raises UsageError, InputError and DataError of the steps, in
    the words of the command line.
    """
    try:
        return _solved(given, progress, draw)
    except InsgnssError as error:
        raise type(error)(in_options(str(error))) from error


def _solved(given: argparse.Namespace, progress: Progress, draw: Draw) -> PpkRun:
    inputs, origin = input_of(given), None if given.origin is None else place(given.origin, "--origin")
    _refuse_absent(given)
    if given.out.exists() and not given.out.is_dir():
        raise UsageError(f"ppk: --out {given.out} is a file, a directory is expected")
    from ..gnss.antenna_files import SOLUTION, positions_of_others, write_antenna_files
    from ..gnss.ppk import solve_ppk

    if name := positions_of_others(given.out):
        raise UsageError(f"ppk: --out {given.out} holds {name} and no {SOLUTION}: positions of others; give another directory")
    given.out.mkdir(parents=True, exist_ok=True)
    result = solve_ppk(inputs, given.out, progress)
    progress("writing")
    written, missing = write_antenna_files(result.fixes, result.events, given.out, origin)
    figure, document = given.out / FIGURE, given.out / DOCUMENT
    atomic_write(figure, draw(result.series))
    checks = result.checks if missing is None else (*result.checks, missing)
    result = replace(result, checks=tuple(check_in_options(check) for check in checks))
    run = PpkRun(result, inputs, (*written, *result.files.values(), figure, document))
    atomic_write(document, json.dumps(json_ready(run.as_dict()), indent=2, allow_nan=False, ensure_ascii=False) + "\n")
    return run


def _refuse_absent(given: argparse.Namespace) -> None:
    """InputError with the option of the first file that is not there."""
    named = [("ROVER", given.rover), ("--base", given.base), *(("--navigation", file) for file in given.navigation)]
    named += [(option, file) for option, file in (("--antex", given.antex), ("--events", given.events)) if file is not None]
    for option, file in named:
        if not file.is_file():
            what = "is a directory, a file is expected" if file.is_dir() else "does not exist; check the path"
            raise InputError(f"ppk: {option} {file} {what}")


def input_of(given: argparse.Namespace) -> "PpkInput":
    """The input that a command line describes."""
    from ..exposures.naming import ImageMatch
    from ..geodesy.frames import geodetic_to_ecef
    from ..gnss.covariance import MODEL
    from ..gnss.covariance_table import read_covariance
    from ..gnss.events import RoverEvents
    from ..gnss.options import EngineOptions
    from ..gnss.ppk import PpkInput

    if given.base_position is None and given.base_point is not None:
        raise UsageError("ppk: --base-point belongs to --base-position; give the coordinates")
    position = None if given.base_position is None else geodetic_to_ecef(*place(given.base_position, "--base-position")).tolist()
    options = EngineOptions(
        base_position_m=None if position is None else (position[0], position[1], position[2]),
        base_point=None if position is None else given.base_point or "apc",
        antex=given.antex,
        more=_more(given.more),
        **_of_engine(given),
    )
    if given.events is not None and (given.events_containing or given.invalid_events):
        option = "--events-containing" if given.events_containing else "--invalid-events"
        raise UsageError(f"ppk: {option} looks at the record lines of the rover's file; --events is given as well, keep one")
    if given.images is None and (given.image_ending or given.skip_images):
        option = "--image-ending" if given.image_ending else "--skip-images"
        raise UsageError(f"ppk: {option} is of --images, which is missing; give the directory of the images or a list of their names")
    return PpkInput(
        rover=given.rover,
        base=given.base,
        navigation=tuple(given.navigation),
        options=options,
        covariance=MODEL if given.covariance is None else read_covariance(given.covariance),
        wet_delay=not given.no_wet_delay,
        ionosphere=not given.no_ionosphere,
        atmosphere=_air(given),
        velocity=not given.no_velocity,
        events=given.events,
        rover_events=RoverEvents(given.events_containing, given.invalid_events),
        match=ImageMatch(given.images, given.image_ending, tuple(given.skip_events), tuple(given.skip_images)),
        camera_delay_s=given.camera_delay,
        base_point_chosen=given.base_position is None or given.base_point is not None,
    )


def _of_engine(given: argparse.Namespace) -> dict[str, Any]:
    """What the command line asks of the engine, by the names of `EngineOptions`."""
    named = {
        "frequencies": given.frequencies,
        "systems": None if given.systems is None else given.systems.upper(),
        "elevation_mask_deg": given.mask,
        "ratio": given.ratio,
        "engine": given.engine,
        "max_age_s": given.max_age,
        "timeout_s": given.timeout,
        "acceleration_mps2": None if given.acceleration is None else tuple(given.acceleration),
    }
    return {name: value for name, value in named.items() if value is not None}


def _more(words: Sequence[str]) -> dict[str, str]:
    """Options of RTKLIB by name of words NAME=VALUE; UsageError for a word that is none, or one option twice."""
    split = {word: word.partition("=") for word in words}
    if odd := [word for word, (name, sign, _) in split.items() if not (name and sign)]:
        raise UsageError(f"ppk: --more {odd[0]!r} is no NAME=VALUE, such as pos2-arminfix=10")
    names = [word.partition("=")[0] for word in words]
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise UsageError(f"ppk: --more gives {twice} {names.count(twice)} times; keep one")
    return {name: value for name, _, value in split.values()}


def _air(given: argparse.Namespace) -> dict[str, float] | None:
    """Air at the base as far as it is given, by the names of `troposphere.standard_atmosphere`; UsageError for what cannot be."""
    from ..gnss.troposphere import standard_atmosphere

    named = {"pressure_hpa": given.pressure, "temperature_c": given.temperature, "humidity": given.humidity}
    air = {name: value for name, value in named.items() if value is not None}
    if air and given.no_wet_delay and given.no_ionosphere:
        raise UsageError("ppk: --pressure, --temperature and --humidity are of what --no-wet-delay and --no-ionosphere leave out; keep one")
    try:
        standard_atmosphere(0.0, **air)
    except InputError as refusal:
        raise UsageError(f"ppk: {refusal}") from None
    return air or None


def place(text: str, option: str) -> Any:
    """Latitude rad, longitude rad, ellipsoidal height m (3,) of "LAT,LON,H" in degrees; UsageError for what is none."""
    import numpy as np

    try:
        lat, lon, height = (float(part) for part in text.split(","))
    except ValueError:
        raise UsageError(f"ppk: {option} {text!r} is no LAT,LON,H in degrees and metres, such as 46.5712345,6.5412345,512.345") from None
    if not (abs(lat) <= 90.0 and abs(lon) <= 180.0 and abs(height) <= LARGEST_HEIGHT_M):
        hint = "are latitude and longitude swapped?" if abs(lat) > 90.0 >= abs(lon) else "order and units are deg, deg, m"
        raise UsageError(f"ppk: {option} {text!r} is no latitude, longitude, ellipsoidal height; {hint}")
    return np.array([np.radians(lat), np.radians(lon), height])


def run(options: argparse.Namespace, progress: Progress) -> int:
    """Do what the parsed command line asks for; return the exit code."""
    from ..report.gnss import draw_quality

    return show_result(options, progress, ppk(options, progress, draw_quality))


VERB = Verb(
    "ppk",
    "antenna positions with honest covariances from RINEX of rover and base, by RTKLIB",
    EXAMPLE,
    add_arguments,
    run,
)
