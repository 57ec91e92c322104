"""The verb `ppk`: RINEX of rover and base to antenna positions, a figure and ppk.json."""

import argparse
import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InputError, UsageError
from ..files import atomic_write, json_ready

if TYPE_CHECKING:
    from .ppk import PpkInput, PpkResult

Progress = Callable[[str], None]
Draw = Callable[[Mapping[str, Any]], bytes]

EXAMPLE = """\
  insgnss ppk rover.18o --base master.18o --navigation rover.18n rover.18g --base-position 46.5712345,6.5412345,512.345
  insgnss ppk rover.obs --base base.obs --navigation base.nav --base-position 35.1347,136.9776,104.85 --base-point apc --images photos
  insgnss ppk rover.18o.gz --base ref.18d.Z --navigation brdc.18n --origin 46.57,6.54,0 --camera-delay 0.0012"""
FIGURE, DOCUMENT = "gnss_quality.png", "ppk.json"
LARGEST_HEIGHT_M = 10000.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the verb."""
    parser.add_argument("rover", type=Path, metavar="ROVER", help="observations of the rover, RINEX 2 or 3, plain or packed")
    parser.add_argument("--base", type=Path, required=True, metavar="FILE", help="observations of the base")
    parser.add_argument("--navigation", type=Path, required=True, nargs="+", metavar="FILE", help="broadcast ephemerides of all systems")
    where = "deg, deg, ellipsoidal m; with = where it begins with a minus (default: the header's, with a warning)"
    parser.add_argument("--base-position", metavar="LAT,LON,H", help=where)
    what = "what stands there: the antenna's phase centre, its reference point, or the marker (default: apc)"
    parser.add_argument("--base-point", choices=("apc", "arp", "marker"), help=what)
    parser.add_argument("--antex", type=Path, metavar="FILE", help="phase centres of antennas, for arp and marker")
    parser.add_argument("--mask", type=float, default=15.0, metavar="DEG", help="lowest elevation (default: 15)")
    parser.add_argument(
        "--systems", default="GREJC", metavar="LETTERS", help="GPS G, GLONASS R, Galileo E, QZSS J, BeiDou C (default: all)"
    )
    parser.add_argument("--frequencies", type=int, default=2, choices=(1, 2, 3), help="1: L1, 2: and L2 or E5b, 3: and L5 (default: 2)")
    parser.add_argument("--ratio", type=float, default=3.0, metavar="R", help="of the ambiguity test (default: 3)")
    parser.add_argument("--engine", default="auto", metavar="NAME", help="pyrtklib5, or the path of an rnx2rtkp (default: what is there)")
    parser.add_argument("--max-age", type=float, default=30.0, metavar="S", help="longest time to the base's epoch (default: 30)")
    what = "what the vehicle does, horizontally and vertically, m/s^2 (default: 3 1)"
    parser.add_argument("--acceleration", type=float, nargs=2, default=(3.0, 1.0), metavar="A", help=what)
    what = "further options of RTKLIB by name, such as pos2-arminfix=10"
    parser.add_argument("--more", nargs="+", default=(), metavar="NAME=VALUE", help=what)
    what = "TOML file of changes to the covariance model: its fields, of scale and floor_m tables by class (data_specs/flight_file.md)"
    parser.add_argument("--covariance", type=Path, metavar="FILE", help=what)
    parser.add_argument("--events", type=Path, metavar="FILE", help="camera events (.MRK, text) instead of those of the rover's file")
    parser.add_argument("--images", type=Path, metavar="PLACE", help="directory of the images, or a list of their names in order")
    parser.add_argument("--image-ending", metavar="EXT", help="of the images to take from a directory of several formats")
    parser.add_argument("--camera-delay", type=float, default=0.0, metavar="S", help="from event to middle of exposure (default: 0)")
    parser.add_argument("--events-containing", default="", metavar="TEXT", help="take only events whose record lines hold this text")
    parser.add_argument("--skip-events", type=int, nargs="+", default=(), metavar="N", help="numbers, from 1, of events without an image")
    parser.add_argument("--skip-images", nargs="+", default=(), metavar="NAME", help="images without an event")
    parser.add_argument("--no-wet-delay", action="store_true", help="leave the wet delay between base and rover in the heights")
    parser.add_argument("--pressure", type=float, metavar="HPA", help="of the air at the base, for the wet delay (default: standard)")
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

    draw : PNG of the series of a result (`report.gnss.draw_quality`).   Raises UsageError, InputError and DataError of the steps.
    """
    inputs, origin = input_of(given), None if given.origin is None else place(given.origin, "--origin")
    if given.out.exists() and not given.out.is_dir():
        raise UsageError(f"ppk: --out {given.out} is a file, a directory is expected")
    from .antenna_files import write_antenna_files
    from .ppk import solve_ppk

    given.out.mkdir(parents=True, exist_ok=True)
    result = solve_ppk(inputs, given.out, progress)
    progress("writing")
    written, missing = write_antenna_files(result.fixes, result.events, given.out, origin)
    figure, document = given.out / FIGURE, given.out / DOCUMENT
    atomic_write(figure, draw(result.series))
    if missing is not None:
        result = replace(result, checks=(*result.checks, missing))
    run = PpkRun(result, inputs, (*written, *result.files.values(), figure, document))
    atomic_write(document, json.dumps(json_ready(run.as_dict()), indent=2, allow_nan=False, ensure_ascii=False) + "\n")
    return run


def input_of(given: argparse.Namespace) -> "PpkInput":
    """The input that a command line describes."""
    from ..geodesy.frames import geodetic_to_ecef
    from .covariance import MODEL
    from .covariance_table import read_covariance
    from .options import EngineOptions
    from .ppk import PpkInput

    if given.base_position is None and given.base_point is not None:
        raise UsageError("ppk: --base-point belongs to --base-position; give the coordinates")
    position = None if given.base_position is None else geodetic_to_ecef(*place(given.base_position, "--base-position")).tolist()
    options = EngineOptions(
        base_position_m=None if position is None else (position[0], position[1], position[2]),
        base_point=None if position is None else given.base_point or "apc",
        antex=given.antex,
        frequencies=given.frequencies,
        systems=given.systems.upper(),
        elevation_mask_deg=given.mask,
        ratio=given.ratio,
        engine=given.engine,
        max_age_s=given.max_age,
        acceleration_mps2=(given.acceleration[0], given.acceleration[1]),
        more=_more(given.more),
    )
    if given.events is not None and given.events_containing:
        raise UsageError("ppk: --events-containing looks at the record lines of the rover's file; --events is given as well, keep one")
    return PpkInput(
        rover=given.rover,
        base=given.base,
        navigation=tuple(given.navigation),
        options=options,
        covariance=MODEL if given.covariance is None else read_covariance(given.covariance),
        wet_delay=not given.no_wet_delay,
        atmosphere=_air(given),
        velocity=not given.no_velocity,
        events=given.events,
        images=given.images,
        image_ending=given.image_ending,
        camera_delay_s=given.camera_delay,
        events_containing=given.events_containing,
        skip_events=tuple(given.skip_events),
        skip_images=tuple(given.skip_images),
    )


def _more(words: Iterable[str]) -> dict[str, str]:
    """Options of RTKLIB by name of words NAME=VALUE; UsageError for a word that is none."""
    split = {word: word.partition("=") for word in words}
    if odd := [word for word, (name, sign, _) in split.items() if not (name and sign)]:
        raise UsageError(f"ppk: --more {odd[0]!r} is no NAME=VALUE, such as pos2-arminfix=10")
    return {name: value for name, _, value in split.values()}


def _air(given: argparse.Namespace) -> dict[str, float] | None:
    """Air at the base as far as it is given, by the names of `troposphere.standard_atmosphere`; UsageError for what cannot be."""
    from .troposphere import standard_atmosphere

    named = {"pressure_hpa": given.pressure, "temperature_c": given.temperature, "humidity": given.humidity}
    air = {name: value for name, value in named.items() if value is not None}
    if air and given.no_wet_delay:
        raise UsageError("ppk: --pressure, --temperature and --humidity are of the wet delay; --no-wet-delay is given as well, keep one")
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
