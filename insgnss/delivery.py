"""Where the products go: checked before the work, written together after it."""

import hashlib
import os
import shutil
import tempfile
from pathlib import Path
from typing import Any

from .errors import InputError, UsageError
from .flight import Flight
from .recording import Recording
from .records import Diagnostics, ExteriorOrientation, Trajectory
from .records.framed import PROJECTED
from .stochastic.model import NoiseModel

PRODUCTS = ("trajectory.sbet", "trajectory.smrmsg", "trajectory.csv", "report.html", "report.json")  # besides those of the images


def target(flight: Flight, out: Path | None) -> Path:
    """Directory of the products, once it is clear that they can be written there and take no input's place.

    Raises UsageError where it was named by the command, InputError where it was by the flight file.
    """
    from .formats import EXPORTS

    directory = flight.output.directory if out is None else Path(out)
    refusal, where = (InputError, f"{flight.path}: output.directory") if out is None else (UsageError, "--out")
    above = next(d for d in (directory, *directory.parents) if d.exists())
    if not above.is_dir():
        raise refusal(f"{where}: {above} is a file, a directory is expected; give another one")
    try:
        os.rmdir(tempfile.mkdtemp(prefix=".insgnss-", dir=above))
    except OSError as error:
        raise refusal(
            f"{where}: cannot write in {above}: {error.strerror or error}; check its permissions or give another directory"
        ) from None
    inputs = [file.resolve() for file in inputs_of(flight)]
    for name in (*PRODUCTS, *(EXPORTS[form].product for form in (*flight.output.formats, "eo_json"))):
        if (directory / name).resolve() in inputs:
            raise refusal(f"{where}: the product {name} would overwrite the input {directory / name}; give another directory")
        if (directory / name).is_dir():
            raise refusal(f"{where}: {directory / name} is a directory and in the way of a product; give another directory")
    return directory


def inputs_of(flight: Flight) -> list[Path]:
    """Every file that the result depends on."""
    imus = (flight.imu, *flight.imu.more)
    files = [flight.path, *(imu.file for imu in imus), *(imu.calibration for imu in imus if imu.calibration is not None)]
    if flight.gnss.file is not None:
        files.append(flight.gnss.file)
    if flight.gnss.raw is not None:
        files += [flight.gnss.raw.rover, flight.gnss.raw.base, *flight.gnss.raw.navigation]
    if flight.camera is not None and flight.camera.events is not None:
        files.append(flight.camera.events)
    files += [imu.noise for imu in imus if isinstance(imu.noise, Path)]
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
    """Write every product into a directory beside the target and move them in together: all of them, or none."""
    from .formats.sbet import write_sbet, write_smrmsg
    from .formats.trajectory_csv import write_trajectory_csv
    from .report.page import write_report, write_report_json

    out = Path(out)
    made = [d for d in (out, *out.parents) if not d.exists()]
    out.mkdir(parents=True, exist_ok=True)
    staging = Path(tempfile.mkdtemp(prefix=".insgnss-", dir=out))
    try:
        if eo is not None:
            report["exports"] = [
                _export(flight, eo, name, staging, recording.noise) for name in dict.fromkeys([*flight.output.formats, "eo_json"])
            ]
        write_sbet(path, staging / "trajectory.sbet")
        write_smrmsg(path, staging / "trajectory.smrmsg")
        write_trajectory_csv(path, staging / "trajectory.csv")
        write_report(staging / "report.html", report, diagnostics, eo, None if recording.ppk is None else recording.ppk.series)
        write_report_json(report, staging / "report.json")
        files = sorted(staging.iterdir())
        taken = {file.resolve() for file in inputs_of(flight)}
        if inputs := [file.name for file in files if (out / file.name).resolve() in taken]:
            raise InputError(f"{flight.path}: output.directory: the product {inputs[0]} would overwrite an input; give another directory")
        for file in files:
            os.replace(file, out / file.name)
    except BaseException:
        shutil.rmtree(staging, ignore_errors=True)
        for directory in made:
            _remove_if_empty(directory)
        raise
    staging.rmdir()
    return tuple(out / file.name for file in files)


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
