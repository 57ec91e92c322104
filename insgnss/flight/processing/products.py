"""The products of a run: their directories, checked before it, and their files, written after.

The products of the navigation go into the output directory. Of raw observations the solution and
the antenna positions go where the published tree (Figure 9 of paper 000) has them: into GPS-PPK
beside an output directory that is called GPS-INS. They go into GPS-PPK within it where it is called
otherwise, or where the one beside it holds positions of others, of which there is no `ppk.pos`.
"""

import os
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.errors import DataError, InputError, InsgnssError, UsageError
from ...base.output.scratch import scratch_directory
from ...base.output.staging import together
from ...base.provenance import DIGESTS_KEY as HASHES
from ...base.provenance import hashes_of_products, other_results
from ...base.received.outputs import refuse_outside
from ...base.wording import relative
from ...geodesy.crs import is_globe
from ...geodesy.frames import LocalFrame
from ...gnss.antenna_files import (
    ANTENNA_FILES,
    SOLUTION_FILE,
    positions_of_others,
    write_antenna_files,
)
from ...io.formats import EXPORTS
from ...io.formats.gis.background import read_background
from ...io.formats.orientation.eo_covariance import write_eo_covariance
from ...io.formats.trajectory.sbet import write_sbet, write_smrmsg
from ...io.formats.trajectory.trajectory_csv import write_trajectory_csv
from ...navigation.noise_model.model import NoiseModel
from ...records import ExteriorOrientation, GnssFixes
from ...records.framed import GEOGRAPHIC, PROJECTED
from ...records.observations import in_week
from ...report.charts.chart import Background
from ...report.charts.encoded import background_of
from ...report.page import write_report, write_report_json
from ..config.flight_file import Flight
from ..exporting.export import ExportFrame, export, refuse_names
from .checks import of_flight_file
from .input_files import input_files, measurements
from .recording import Recording
from .result import ProcessResult

if TYPE_CHECKING:
    from ...gnss.ppk import PpkResult

STRIPS = "eo_covariance.npz"
REPORT = "report.json"
# besides those of the images
PRODUCTS = ("trajectory.sbet", "trajectory.smrmsg", "trajectory.csv", STRIPS, "report.html", REPORT)
OF_MANY_IMAGES = "eo_images.npz"  # numbers of eo.json, from 10 000 images on
PPK_PRODUCTS = (SOLUTION_FILE, *ANTENNA_FILES)
PUBLISHED, PUBLISHED_PPK = "GPS-INS", "GPS-PPK"  # directories of the published tree


def output_directory(flight: Flight, out: Path | None) -> Path:
    """Return the directory of the products, once it is clear that they can be written there.

    Parameters
    ----------
    flight : Flight
        The flight file.
    out : Path or None
        The directory that takes the place of the flight file's.

    Returns
    -------
    Path
        The directory; it need not exist.

    Raises
    ------
    UsageError, InputError
        Where the directory cannot be written to, or a product would take the place of an input: the
        first where `out` names it, the second where the flight file does; InputError where the
        flight file names one outside of its own directory.
    """
    directory = flight.output.directory if out is None else Path(out)
    refusal: type[InsgnssError] = InputError
    where = f"{flight.path}: output.directory"
    if out is not None:
        refusal, where = UsageError, "--out"
    forms = [EXPORTS[name] for name in (*flight.output.formats, "eo_json")]
    exports = (form.product for form in forms)
    trees = {form.product for form in forms if form.several}
    products: dict[Path, tuple[str, ...]] = {directory: (*PRODUCTS, OF_MANY_IMAGES, *exports)}
    if flight.gnss.raw is not None:
        products[ppk_directory(directory)] = PPK_PRODUCTS
    if out is None:
        refuse_outside(flight.path, "output.directory", products)
    for target in products:
        if reason := _not_writable(target):
            raise refusal(f"{where}: {reason}")
    inputs = {file.resolve() for file in input_files(flight)}
    for file in (target / name for target, names in products.items() for name in names):
        if file.resolve() in inputs:
            raise refusal(
                f"{where}: the product {file.name} would overwrite the input {file}; give another "
                "directory"
            )
        if file.is_dir() and file.name not in trees:
            raise refusal(
                f"{where}: {file} is a directory and in the way of a product; give "
                "another directory"
            )
    return directory


def overwriting(flight: Flight, directory: Path, out: Path | None) -> InsgnssError | None:
    """Return the error of products that would take the place of others' results.

    Parameters
    ----------
    flight : Flight
        The flight file.
    directory : Path
        Of the products.
    out : Path or None
        That directory where it takes the place of the flight file's.

    Returns
    -------
    UsageError, InputError or None
        The first where `out` names it, the second where the flight file does; None where nothing is
        there, or results of these measurements. Files that are broken are no other measurements:
        whoever reads them says so first.
    """
    reason = other_results(directory / REPORT, measurements(flight))
    if reason is None:
        return None
    if out is not None:
        return UsageError(f"--out: {reason}; give another --out, or --force")
    where = f"{flight.path}: output.directory"
    return InputError(f"{where}: {reason}; give another directory with --out, or --force")


def refuse_image_names(flight: Flight, images: Sequence[str]) -> None:
    """Refuse names of images that a format of [output] cannot hold.

    Parameters
    ----------
    flight : Flight
        The flight file.
    images : sequence of str
        The names.

    Raises
    ------
    InputError
        The first such name, or a rule of output.rename that is none.
    """
    with of_flight_file(flight, "output.formats", (InputError, UsageError)):
        refuse_names(images, flight.output.formats, flight.output.rename)


def ppk_directory(out: Path) -> Path:
    """Return where the solution of raw observations goes, of products in the directory `out`."""
    out = out if out.name else Path(os.path.abspath(out))  # "."
    beside = out.parent / PUBLISHED_PPK
    published = out.name == PUBLISHED and positions_of_others(beside) is None
    return beside if published else out / PUBLISHED_PPK


def ground_below(flight: Flight, fixes: GnssFixes, frame: LocalFrame) -> Background | None:
    """Return what the map of the page shows below the flight, where the flight file names it.

    Parameters
    ----------
    flight : Flight
        The flight file.
    fixes : GnssFixes
        Where the flight was.
    frame : LocalFrame
        The frame of the map.

    Raises
    ------
    InputError
        The file cannot be read, says no place, or shows another place.
    """
    file, gnss = flight.output.background, flight.gnss
    if file is None:
        return None
    places = np.stack([fixes.lat, fixes.lon, fixes.height], axis=1)
    with of_flight_file(flight, "output.background", InputError):
        ground = read_background(file, frame, places, gnss.datum, gnss.epoch)
    return background_of(ground.pixels, ground.edges, file.name)


def write_products(
    flight: Flight,
    out: Path,
    result: ProcessResult,
    recording: Recording,
    background: Background | None = None,
) -> tuple[Path, ...]:
    """Write every product, all of them or none.

    They are written into directories within their targets, and moved into these together.

    Parameters
    ----------
    flight : Flight
        The flight file.
    out : Path
        The directory of the products.
    result : ProcessResult
        What is to be written; its report is completed by the notes of the writers.
    recording : Recording
        The recording.
    background : Background, optional
        What the map of the page shows below the flight.

    Returns
    -------
    tuple of Path
        The files.

    Raises
    ------
    InputError
        Where a product would overwrite an input, or cannot be what the flight file asks
        for.
    """
    eo, trajectory, report, ppk = result.eo, result.trajectory, result.report, recording.ppk
    with together() as staging:
        directory = staging.tree(Path(out))
        if eo is not None:
            names = dict.fromkeys([*flight.output.formats, "eo_json"])
            exports = [_export(flight, eo, name, directory, recording.noise) for name in names]
            report["exports"] = exports
        if eo is not None and result.strips:
            write_eo_covariance(eo, result.strips, directory / STRIPS, result.common)
        if ppk is not None:
            target = ppk_directory(Path(out))
            notes = _write_solution(recording, ppk, eo, staging.tree(target))
            report["ppk"] |= {"directory": relative(target, out), "notes": notes}
        write_sbet(trajectory, directory / "trajectory.sbet")
        write_smrmsg(trajectory, directory / "trajectory.smrmsg")
        write_trajectory_csv(trajectory, directory / "trajectory.csv")
        report["flight_directory"] = relative(flight.path.parent, Path(out))
        report[HASHES] = hashes_of_products(staging.goals(), Path(out))
        digest = write_report_json(report, directory / REPORT)
        write_report(
            directory / "report.html",
            report,
            result.diagnostics,
            eo,
            recording.series,
            digest,
            background,
        )
        files = staging.goals()
        _refuse_overwriting(flight, files)
    return files


def _not_writable(directory: Path) -> str | None:
    """Say why a directory cannot be made or written to; None where it can."""
    above = next(d for d in (directory, *directory.parents) if d.exists())
    if not above.is_dir():
        return f"{above} is a file, a directory is expected; give another one"
    try:
        with scratch_directory(above):
            pass
    except OSError as error:
        return (
            f"cannot write in {above}: {error.strerror or error}; check its permissions or give "
            "another directory"
        )
    return None


def _refuse_overwriting(flight: Flight, files: Iterable[Path]) -> None:
    """Raise InputError where a product would take the place of an input."""
    inputs = {file.resolve() for file in input_files(flight)}
    if taken := [file.name for file in files if file.resolve() in inputs]:
        raise InputError(
            f"{flight.path}: output.directory: the product {taken[0]} would overwrite an input; "
            "give another directory"
        )


def _write_solution(
    recording: Recording,
    ppk: "PpkResult",
    eo: ExteriorOrientation | None,
    directory: Path,
) -> list[str]:
    """Write the PPK solution, and the antenna positions in the tangent plane of the images.

    The exposures are those of the run, their times back on the clock of the fixes, as these were
    solved.
    """
    ppk.write(directory / SOLUTION_FILE)
    events = recording.events
    if events is not None and ppk.fixes.gps_week is not None:
        events = in_week(events, ppk.fixes.gps_week)
        events = replace(events, time=events.time - recording.offsets.gnss)
    origin = None if eo is None else eo.origin
    try:
        _, missing = write_antenna_files(ppk.fixes, events, directory, origin)
    except DataError as error:  # no exposure between fixes: those files alone are missing
        return [str(error)]
    return [] if missing is None else [missing.named_sentence]


def _export(
    flight: Flight, eo: ExteriorOrientation, name: str, directory: Path, noise: NoiseModel
) -> dict[str, Any]:
    """Write one format in the frame of [output], or in its own where it cannot carry that.

    The gyroscopes of `noise` give relative control its weight. What the report says of it is
    returned.
    """
    form, output = EXPORTS[name], flight.output
    globe = output.crs is not None and is_globe(output.crs)
    named = output.crs is not None and (GEOGRAPHIC if globe else PROJECTED) in form.frames
    geoid = output.geoid if (named and not globe) or form.heights == "sea level" else None
    target = ExportFrame(geoid=geoid)
    if named:
        target = ExportFrame(output.crs, geoid, None, None if globe else output.ground_m)
    options = {"noise": noise} if "noise" in form.options else {}
    rename = output.rename if form.frames else ()  # the master keeps the names of the files
    with of_flight_file(flight, "output"):
        done = export(eo, name, directory / form.product, target, rename, **options)
    return {"format": name, "file": form.product, "frame": done.frame, "notes": list(done.notes)}
