"""The verb `ppk`: RINEX of rover and base to antenna positions, a page, a figure and ppk.json."""

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..base.errors import InputError, OptionError, UsageError
from ..base.files import atomic_write, expand_patterns, json_ready, pick_attributes
from ..base.inputs import is_file
from ..base.output.staging import together
from ..base.provenance import made_from, paths_named_by, refuse_other_results
from ..base.wording import spoken_as
from ..flight.config.command_line import add_options, given_of, made_of, names_of
from ..flight.config.flight_file import TangentPlaneTable
from ..flight.config.gnss_options import GnssInput
from ..gnss.ppk_options import Air, RawGnss, all_of
from ..io.options.camera_options import CameraInput, ImageMatch, RoverEvents
from ..io.options.kinds import accept_value
from ..io.options.schema import argument, declared_options
from .console import Progress
from .verb import Verb

if TYPE_CHECKING:
    from ..gnss.ppk import PpkInput, PpkResult
    from ..report.charts.chart import Chart
    from ..report.document import Document

EXAMPLE = """\
  insgnss ppk rover.18o --base master.18o --navigation rover.18n rover.18g \\
      --base-position 46.5712345,6.5412345,512.345
  insgnss ppk rover.obs --base base.obs --navigation base.nav \\
      --base-position 35.1347,136.9776,104.85 --base-point apc --images photos
  insgnss ppk rover.obs --base 'cors/abcd*.18o.gz' --navigation brdc.18n
  insgnss ppk rover.18o.gz --base ref.18d.Z --navigation brdc.18n \
--origin 46.57,6.54,0 --camera-delay 0.0012"""
NOT_GIVEN: tuple[object, ...] = (None, "", [], {})  # options that were not asked for
FIGURE, PPK_DOCUMENT, PPK_PAGE = "gnss_quality.png", "ppk.json", "ppk.html"


@dataclass(frozen=True)
class Files:
    """Where the files go."""

    out: Path = argument(Path("ppk"), "where the files go", metavar="DIR")
    force: bool = argument(False, "overwrite the solution of other observations")


PPK_TABLES = (
    RawGnss,
    GnssInput,
    Air,
    CameraInput,
    ImageMatch,
    RoverEvents,
    TangentPlaneTable,
    Files,
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the verb.

    They are those that the tables of the flight file declare, and where the files go.
    """
    add_options(parser, PPK_TABLES, required=("rover", "base", "navigation"))


@dataclass(frozen=True, eq=False)
class PpkRun:
    """A result and the files that were written of it."""

    result: "PpkResult"
    request: "PpkInput"
    files: tuple[Path, ...]
    origin: Mapping[str, Any] = field(default_factory=dict)

    def summary(self) -> str:
        """Return the text for the terminal."""
        return self.document().text()

    def document(self, charts: "Sequence[Chart]" = ()) -> "Document":
        """Return the quality of the solution: in a sentence, epoch by epoch, in checks and numbers.

        Parameters
        ----------
        charts : sequence of Chart
            Those of its series, for the page.
        """
        from ..report.document import Document, checks_section, dotted_keys, pairs
        from ..report.verdict import worst_of

        result, request = self.result, self.request
        grade = result.quality["grade"]
        remarked = [check for check in result.checks if check.verdict != "ok"]
        remarked.sort(key=lambda check: check.verdict == "note")
        findings = [f"{check.name}: {check.found}" for check in remarked]
        findings = findings or ["too few epochs are fixed and confirmed"]
        names = ", ".join(dict.fromkeys(check.name for check in remarked))
        notes = f"; there are notes on {names}" if remarked else ""
        merits = {
            name: f"{value:.6g}"
            for name, value in result.quality.items()
            if isinstance(value, int | float) and not isinstance(value, bool)
        }
        engine = {"engine": result.engine, "its CPU, s": f"{result.cpu_s:.1f}"}
        return Document(
            f"PPK: {Path(all_of(request.rover)[0]).name}",
            result.verdict,
            worst_of(
                f"nearly all epochs are fixed and confirmed, and no check contradicts them{notes}",
                findings if grade not in ("good", "poor") else [],
                findings if grade == "poor" else [],
            ),
            (*charts, checks_section(result.checks), pairs("Figures of merit", merits)),
            [*all_of(request.rover), *all_of(request.base), *request.navigation],
            settings={
                k: v for k, v in dotted_keys(json_ready(asdict(request))) if v not in NOT_GIVEN
            },
            versions=engine,
            files=self.files,
        )

    def as_dict(self) -> dict[str, Any]:
        """JSON-able."""
        from ..base import __version__

        result, request = self.result, self.request
        return {
            "insgnss": __version__,
            **pick_attributes(result, "engine", "cpu_s", "verdict", "quality"),
            "checks": [check.as_dict() for check in result.checks],
            "input": asdict(request),
            **self.origin,
            "files": [str(path) for path in self.files],
        }


def ppk(arguments: argparse.Namespace, progress: Progress) -> PpkRun:
    """Do what the parsed command line asks for.

    Raises
    ------
    UsageError, InputError, DataError
        Of the steps, in the words of the command line.
    """
    with spoken_as(names_of()):
        try:
            return _solve_and_write(arguments, progress)
        except OptionError as error:
            raise UsageError(f"ppk: {error}") from error


def _solve_and_write(arguments: argparse.Namespace, progress: Progress) -> PpkRun:
    """Return the solved run, with all its files written or none."""
    inputs = input_of(arguments)
    origin = None
    if arguments.origin is not None:
        origin = geodetic_position(arguments.origin, "tangent_plane.origin")
    _refuse_absent(arguments)
    files_to = made_of(Files, arguments)
    if files_to.out.exists() and not files_to.out.is_dir():
        raise UsageError(
            f"ppk: --out {files_to.out} is a file; give a directory (created if missing)"
        )
    from ..gnss.antenna_files import SOLUTION_FILE, positions_of_others, write_antenna_files
    from ..gnss.exposures.camera_positions import camera_positions
    from ..gnss.ppk import solve_ppk
    from ..io.formats.positions.camera_positions import PRODUCT, write_camera_positions

    if name := positions_of_others(files_to.out):
        raise UsageError(
            f"ppk: --out {files_to.out} holds {name} and no {SOLUTION_FILE}: its positions"
            " were not written by insgnss ppk; give another directory"
        )
    measured = (*all_of(inputs.rover), *all_of(inputs.base))
    refuse_other_results("ppk", files_to.out / PPK_DOCUMENT, measured, files_to.force)
    with together() as staging:
        into = staging.tree(files_to.out)
        result = solve_ppk(inputs, into, progress)
        progress("writing")
        written, missing = write_antenna_files(result.fixes, result.events, into, origin)
        result = result if missing is None else replace(result, checks=(*result.checks, missing))
        if result.events is not None:
            positions, of_camera = camera_positions(result.fixes, result.events)
            write_camera_positions(positions, into / PRODUCT)
            result = replace(result, checks=(*result.checks, *of_camera))
            written = (*written, into / PRODUCT)
        report_files = tuple(into / name for name in (FIGURE, PPK_DOCUMENT, PPK_PAGE))
        files = (*written, *result.files.values(), *report_files)
        run = PpkRun(result, inputs, tuple(map(staging.destination, files)))
        settings = () if arguments.covariance is None else (arguments.covariance,)
        run = _with_report(run, (*paths_named_by(inputs), *settings), *report_files)
    return run


def _with_report(
    run: PpkRun, inputs: Sequence[Path], figure: Path, document: Path, page: Path
) -> PpkRun:
    """Write figure, page and, last, the document; return the run that says how it was made."""
    from ..report.charts.drawn import draw_sheet
    from ..report.charts.gnss import charts
    from ..report.document import write_with_page

    shown = list(charts(run.result.series))
    atomic_write(figure, draw_sheet([shown]))
    products = [path for path in figure.parent.rglob("*") if path.is_file()]
    run = replace(run, origin=made_from(inputs, document, products))
    write_with_page(run.document(shown), run.as_dict(), document, page)
    return run


def _refuse_absent(arguments: argparse.Namespace) -> None:
    """InputError with the option of the first file that is not there."""
    named = [
        *(("ROVER", file) for file in all_of(one_or_several(arguments.rover))),
        *(("--base", file) for file in all_of(one_or_several(arguments.base))),
        *(("--navigation", file) for file in arguments.navigation),
    ]
    named += [
        (option, file)
        for option, file in (("--antex", arguments.antex), ("--events", arguments.events))
        if file is not None and not (option == "--events" and file.is_dir())
    ]
    for option, file in named:
        if not is_file(file):
            problem = (
                "is a directory, a file is expected"
                if file.is_dir()
                else "does not exist; check the path"
            )
            raise InputError(f"ppk: {option} {file} {problem}")


def input_of(arguments: argparse.Namespace) -> "PpkInput":
    """The input that a command line describes.

    OptionError and UsageError for what it cannot ask for.
    """
    from ..flight.config.load import read_covariance
    from ..gnss.covariance_model import MODEL
    from ..gnss.from_flight_file import ppk_input

    raw, air = given_of(arguments, RawGnss), given_of(arguments, Air)
    _refuse_contradictions(arguments, raw)
    if "systems" in raw:
        raw["systems"] = raw["systems"].upper()
    if "rtklib_options" in raw:
        raw["rtklib_options"] = _named_values(raw["rtklib_options"])
    raw |= {name: one_or_several(raw[name]) for name in ("rover", "base")}
    return replace(
        ppk_input(RawGnss(**raw, atmosphere=air or None)),
        covariance=MODEL if arguments.covariance is None else read_covariance(arguments.covariance),
        events=arguments.events,
        rover_events=RoverEvents(**given_of(arguments, RoverEvents)),
        match=ImageMatch(**given_of(arguments, ImageMatch)),
        camera_delay_s=arguments.time_offset_s or 0.0,
        time_scale=arguments.time_scale,
        base_point_chosen=arguments.base_position is None or arguments.base_point is not None,
    )


def _refuse_contradictions(arguments: argparse.Namespace, raw: Mapping[str, Any]) -> None:
    """UsageError for options that do not go together."""
    if arguments.base_position is None and arguments.base_point is not None:
        raise UsageError("ppk: --base-point belongs to --base-position; give the coordinates")
    if arguments.events is not None and (arguments.events_containing or arguments.invalid_events):
        option = "--events-containing" if arguments.events_containing else "--invalid-events"
        raise UsageError(
            f"ppk: {option} selects among the events of the rover's file, but --events gives"
            " another file; keep one"
        )
    if given_of(arguments, Air) and not (raw.get("wet_delay", True) or raw.get("ionosphere", True)):
        raise UsageError(
            "ppk: --pressure, --temperature and --humidity have no effect with --no-wet-delay"
            " and --no-ionosphere; keep one"
        )


def one_or_several(paths: Sequence[Path]) -> Path | tuple[Path, ...]:
    """The files that the command line names, each pattern in it replaced by its files."""
    files = expand_patterns(paths)
    return files[0] if len(files) == 1 else files


def _named_values(pairs: Sequence[str]) -> dict[str, str]:
    """Options of RTKLIB by name of words NAME=VALUE.

    OptionError for a word that is none, or one option twice.
    """
    key = "gnss.rtklib_options"
    split = {word: word.partition("=") for word in pairs}
    if malformed := [word for word, (name, sign, _) in split.items() if not (name and sign)]:
        raise OptionError(key, f"{malformed[0]!r} is no NAME=VALUE, such as pos2-arminfix=10")
    names = [word.partition("=")[0] for word in pairs]
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise OptionError(key, f"gives {twice} {names.count(twice)} times; keep one")
    return {name: value for name, _, value in split.values()}


def geodetic_position(coordinates: Any, key: str) -> Any:
    """Latitude rad, longitude rad, ellipsoidal height m (3,) of the same in degrees.

    OptionError of `key` for what is none.
    """
    import numpy as np

    lat, lon, height = accept_value(declared_options(RawGnss)["base_position"], coordinates, key)
    return np.array([np.radians(lat), np.radians(lon), height])


VERB = Verb("ppk", EXAMPLE, add_arguments, ppk)
