"""Where the products go: checked before the work, written together after it.

Those of the navigation go into the output directory. Of raw observations the solution and the antenna positions go where the published
tree (Figure 9 of paper 000) has them: into GPS-PPK beside an output directory that is called GPS-INS. Into GPS-PPK within it where it is
called otherwise, or where the one beside it holds positions of others: of which there is no `ppk.pos`.
"""

import hashlib
import os
import shutil
import tempfile
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

from .errors import DataError, InputError, UsageError
from .flight import Flight
from .gnss.antenna_files import ANTENNA_FILES, SOLUTION, positions_of_others
from .recording import Recording, sentence
from .records import Diagnostics, ExteriorOrientation, Trajectory
from .records.framed import PROJECTED
from .stochastic.model import NoiseModel

if TYPE_CHECKING:
    from .gnss.ppk import PpkResult

PRODUCTS = ("trajectory.sbet", "trajectory.smrmsg", "trajectory.csv", "report.html", "report.json")  # besides those of the images
PUBLISHED, PUBLISHED_PPK = "GPS-INS", "GPS-PPK"
OF_PPK = (SOLUTION, *ANTENNA_FILES)


def target(flight: Flight, out: Path | None) -> Path:
    """Directory of the products, once it is clear that they can be written there and take no input's place.

    Raises UsageError where it was named by the command, InputError where it was by the flight file.
    """
    from .formats import EXPORTS

    directory = flight.output.directory if out is None else Path(out)
    refusal, where = (InputError, f"{flight.path}: output.directory") if out is None else (UsageError, "--out")
    inputs = {file.resolve() for file in inputs_of(flight)}
    names = (*PRODUCTS, *(EXPORTS[form].product for form in (*flight.output.formats, "eo_json")))
    places = {directory: names} if flight.gnss.raw is None else {directory: names, ppk_directory(directory): OF_PPK}
    for place in places:
        above = next(d for d in (place, *place.parents) if d.exists())
        if not above.is_dir():
            raise refusal(f"{where}: {above} is a file, a directory is expected; give another one")
        try:
            os.rmdir(tempfile.mkdtemp(prefix=".insgnss-", dir=above))
        except OSError as error:
            raise refusal(
                f"{where}: cannot write in {above}: {error.strerror or error}; check its permissions or give another directory"
            ) from None
    for file in (place / name for place, products in places.items() for name in products):
        if file.resolve() in inputs:
            raise refusal(f"{where}: the product {file.name} would overwrite the input {file}; give another directory")
        if file.is_dir():
            raise refusal(f"{where}: {file} is a directory and in the way of a product; give another directory")
    return directory


def ppk_directory(out: Path) -> Path:
    """Where the solution of raw observations goes, of products in `out`."""
    out = out if out.name else Path(os.path.abspath(out))  # "."
    beside = out.parent / PUBLISHED_PPK
    return beside if out.name == PUBLISHED and positions_of_others(beside) is None else out / PUBLISHED_PPK


def inputs_of(flight: Flight) -> list[Path]:
    """Every file that the result depends on."""
    imus = (flight.imu, *flight.imu.more)
    of_imus = [file for imu in imus for file in (imu.file, imu.calibration)]
    given = [flight.path if flight.path.exists() else None, *of_imus, flight.gnss.file]
    files = [file for file in given if isinstance(file, Path)]  # what was given as an object has no file
    if flight.gnss.raw is not None:
        files += flight.gnss.raw.files
    if flight.camera is not None:
        files += [*([flight.camera.events] if isinstance(flight.camera.events, Path) else []), *flight.camera.match.files]
    files += [imu.noise for imu in imus if isinstance(imu.noise, Path)]
    if flight.output.geoid is not None:
        files.append(flight.output.geoid)
    return list(dict.fromkeys(files))


def sha256(file: Path) -> str:
    """Hash of a file's bytes."""
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def deliver(
    flight: Flight,
    out: Path,
    eo: ExteriorOrientation | None,
    path: Trajectory,
    report: dict[str, Any],
    diagnostics: Diagnostics,
    recording: Recording,
) -> tuple[Path, ...]:
    """Write every product into a directory beside its target and move them in together: all of them, or none."""
    from .formats.sbet import write_sbet, write_smrmsg
    from .formats.trajectory_csv import write_trajectory_csv
    from .report.page import write_report, write_report_json

    with ExitStack() as stack:
        staged = [stack.enter_context(_Staging(Path(out)))]
        staging = staged[0].staging
        if eo is not None:
            report["exports"] = [
                _export(flight, eo, name, staging, recording.noise) for name in dict.fromkeys([*flight.output.formats, "eo_json"])
            ]
        if recording.ppk is not None:
            staged.append(stack.enter_context(_Staging(ppk_directory(Path(out)))))
            told = _write_solution(flight, recording, recording.ppk, eo, staged[1].staging)
            report["ppk"] |= {"directory": os.path.relpath(staged[1].target, out), "notes": told}
        write_sbet(path, staging / "trajectory.sbet")
        write_smrmsg(path, staging / "trajectory.smrmsg")
        write_trajectory_csv(path, staging / "trajectory.csv")
        write_report(staging / "report.html", report, diagnostics, eo, None if recording.ppk is None else recording.ppk.series)
        write_report_json(report, staging / "report.json")
        moves = [move for place in staged for move in place.moves()]
        taken = {file.resolve() for file in inputs_of(flight)}
        if inputs := [goal.name for _, goal in moves if goal.resolve() in taken]:
            raise InputError(f"{flight.path}: output.directory: the product {inputs[0]} would overwrite an input; give another directory")
        for file, goal in moves:
            os.replace(file, goal)
    return tuple(goal for _, goal in moves)


class _Staging:
    """A directory within the target, made with it where it is not there, whose files move in together; gone at the end."""

    def __init__(self, target: Path) -> None:
        self.target = target

    def __enter__(self) -> "_Staging":
        self.made = [d for d in (self.target, *self.target.parents) if not d.exists()]
        self.target.mkdir(parents=True, exist_ok=True)
        self.staging = Path(tempfile.mkdtemp(prefix=".insgnss-", dir=self.target))
        return self

    def moves(self) -> list[tuple[Path, Path]]:
        """Each file of the staging directory and where it goes."""
        return [(file, self.target / file.name) for file in sorted(self.staging.iterdir())]

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        shutil.rmtree(self.staging, ignore_errors=True)
        for directory in self.made if kind is not None else ():
            _remove_if_empty(directory)


def _write_solution(flight: Flight, recording: Recording, ppk: "PpkResult", eo: ExteriorOrientation | None, staging: Path) -> list[str]:
    """Write the solution and the antenna positions, in the tangent plane of the images; what is to be said of them.

    The exposures are those of the run, their times back on the clock of the fixes, as these were solved.
    """
    from .gnss.antenna_files import write_antenna_files
    from .prepare.clock import in_week

    ppk.write(staging / SOLUTION)
    events = recording.events
    if events is not None and ppk.fixes.gps_week is not None:
        events = in_week(events, ppk.fixes.gps_week)
        events = replace(events, time=events.time - flight.gnss.time_offset_s)
    try:
        _, missing = write_antenna_files(ppk.fixes, events, staging, None if eo is None else eo.origin)
    except DataError as error:  # no exposure between fixes: those files alone are missing
        return [str(error)]
    return [] if missing is None else [sentence(missing)]


def _export(flight: Flight, eo: ExteriorOrientation, name: str, staging: Path, noise: NoiseModel) -> dict[str, Any]:
    """Write one format in the frame of [output], or in its own where it cannot carry a projected one; what the report says of it.

    noise : by whose gyroscopes relative control weighs.
    """
    from .exporting.export import Target, export
    from .formats import EXPORTS

    form, output = EXPORTS[name], flight.output
    projected = output.crs is not None and PROJECTED in form.frames
    sea_level = form.heights == "sea level"
    geoid = output.geoid if projected or sea_level else None
    target = Target(output.crs, geoid, None, output.ground_m) if projected else Target(geoid=geoid)
    options = {"noise": noise} if "noise" in form.options else {}
    try:
        done = export(eo, name, staging / form.product, target, **options)
    except UsageError as error:  # the flight file asked for it
        raise InputError(f"{flight.path}: output: {error}") from None
    return {"format": name, "file": form.product, "frame": done.frame, "notes": list(done.notes)}


def _remove_if_empty(directory: Path) -> None:
    if directory.exists() and not any(directory.iterdir()):
        directory.rmdir()
