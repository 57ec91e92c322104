"""What every calibration of the mounting leaves: mounting.toml, a page, and its text."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import DataError, InputError, UsageError
from ...base.files import pick_attributes
from ...base.inputs import is_file, open_bytes, sha256
from ...base.output.staging import together
from ...base.provenance import made_from, other_results, refuse_overwriting
from ...io.formats.images.exif import camera_tags, time_taken
from ...io.formats.orientation.mounting_file import (
    MountingFile,
    read_mounting_file,
    write_mounting_file,
)
from ...records.block import Array, BrownCamera
from ...records.cameras.mounting import metashape_offset
from ...report.charts.chart import Chart
from ...report.document import Document, Section, Table, write_with_page
from ...report.notebook import Shown
from ...report.verdict import worst_of
from ..lever_arm.difference import lever_arm_difference
from ..lever_arm.records import millimetres

DETERMINED, NOT_DETERMINED = "determined", "not determined"
NO_IMU = "no pose of the camera sees the IMU: by drawing, caliper or calibrate mounting"

HASH = re.compile(r'^sha256 = "([0-9a-f]{64})"', re.MULTILINE)
"""Of an input, as `io.formats.orientation.mounting_file` writes it."""


def provenance(
    inputs: Sequence[Path],
    cameras: Sequence[BrownCamera] = (),
    photo: Path | None = None,
    date: str = "",
) -> dict[str, Any]:
    """Gather where a calibration comes from.

    Parameters
    ----------
    inputs : sequence of Path
        The files.
    cameras : sequence of BrownCamera
        Of the block; of several none is named.
    photo : Path, optional
        An image of the camera; its Exif names camera, size, focal length and, without `date`, the
        day.
    date : str
        Of the data, ISO.

    Returns
    -------
    dict
        Fields of a `MountingFile`: camera, image_size, focal_px, date and inputs.

    Raises
    ------
    InputError
        The image is not there or is damaged.
    """
    files = [path for path in dict.fromkeys(inputs) if path.is_file()]
    record: dict[str, Any] = {
        "camera": "",
        "image_size": None,
        "focal_px": None,
        "date": date,
        "inputs": tuple((path.name, sha256(path)) for path in files),
    }
    if len(cameras) == 1:
        (camera,) = cameras
        size = (camera.width, camera.height)
        record |= {"camera": camera.name, "image_size": size, "focal_px": camera.of("f")}
    if photo is None:
        return record
    if not is_file(photo):
        raise InputError.in_file(photo, "does not exist; give an image of the camera")
    with open_bytes(photo) as stream:
        tags = camera_tags(stream, photo.name)
        try:
            day = time_taken(stream, photo.name).date().isoformat()
        except ValueError:
            day = ""
    return record | {
        "camera": tags.model or record["camera"],
        "image_size": record["image_size"] or tags.image_size,
        "focal_px": record["focal_px"] or tags.focal_px,
        "date": date or day,
    }


@dataclass(frozen=True, eq=False)
class CalibratedMounting(Shown):
    """The result of a verb.

    Parameters
    ----------
    mounting : MountingFile
        What goes into the file.
    title : str
        Of the page.
    headline : str
        What was found, in one line.
    components : tuple of (str, str, str)
        Component, verdict ("determined" or "not determined"), value or reason.
    details : tuple of str
        Further sentences.
    document : dict
        Figures for machines.
    charts : callable
        Makes the charts of the page.
    files : tuple of Path
        What was written.
    """

    mounting: MountingFile
    title: str
    headline: str
    components: tuple[tuple[str, str, str], ...]
    details: tuple[str, ...]
    document: dict[str, Any]
    charts: Callable[[], Sequence[Chart]]
    files: tuple[Path, ...] = field(default=())

    @property
    def refusal(self) -> DataError | None:
        """Why the data support no answer; None where anything was determined."""
        if self.mounting.values():
            return None
        reason = self.mounting.not_determined.get("antenna_m", "")
        return DataError(f"no vector was determined in all its components: {reason}")

    def summary(self) -> str:
        """Return the text for the terminal."""
        return document_of(self).text()

    def as_dict(self) -> dict[str, Any]:
        """Return the document for machines."""
        return {
            "verb": self.mounting.verb,
            **pick_attributes(self, "headline", "details", "files"),
            "components": [
                {"component": name, "verdict": word, "text": text}
                for name, word, text in self.components
            ],
            "mounting": self.mounting.values(),
            "not_determined": dict(self.mounting.not_determined),
            **self.document,
        }


def of_lever_arm(
    verb: str,
    title: str,
    antenna: tuple[Array, Array],
    why_not: str,
    components: Sequence[tuple[str, str, str]],
    verdict: Sequence[str],
    details: Sequence[str],
    document: dict[str, Any],
    charts: Callable[[], Sequence[Chart]],
    origin: dict[str, Any],
) -> CalibratedMounting:
    """Return the result of a calibration that sees the antenna, and nothing of the IMU.

    Parameters
    ----------
    verb : str
        Of the calibration.
    title : str
        Of the page.
    antenna : tuple of ndarray
        Lever arm (3,), m, and its covariance (3, 3).
    why_not : str
        Why it is not determined; empty where it is.
    components : sequence of (str, str, str)
        Those of the antenna; without any the whole is one.
    verdict : sequence of str
        Of the file; the first is the headline.
    details : sequence of str
        Further sentences.
    document : dict
        Figures for machines.
    charts : callable
        Makes the charts of the page.
    origin : dict
        Where it comes from.

    Returns
    -------
    CalibratedMounting
        The result of the verb.
    """
    arm, cov = antenna
    value = f"{millimetres(arm, '+')} mm +- {millimetres(np.sqrt(np.diag(cov)))} mm"
    one = ("antenna_m", NOT_DETERMINED if why_not else DETERMINED, why_not or value)
    mounting = MountingFile(
        verb=f"calibrate {verb}",
        antenna_m=None if why_not else arm,
        antenna_cov=None if why_not else cov,
        verdict=tuple(verdict),
        not_determined={"imu_m": NO_IMU} | ({"antenna_m": why_not} if why_not else {}),
        **origin,
    )
    line = metashape_line(mounting)
    return CalibratedMounting(
        mounting,
        title,
        verdict[0],
        (*(components or [one]), ("imu_m", NOT_DETERMINED, NO_IMU)),
        (*details, *([line] if line else [])),
        document,
        charts,
    )


def write_mounting(
    result: CalibratedMounting, out: Path, force: bool = False
) -> CalibratedMounting:
    """Write mounting.toml and, beside it, a document for machines and the page.

    Parameters
    ----------
    result : CalibratedMounting
        What was found.
    out : Path
        The file; document and page have its name with the endings .json and .html.
    force : bool
        Whether a file that was made from none of the same inputs is overwritten.

    Returns
    -------
    CalibratedMounting
        With the names of its files.

    Raises
    ------
    UsageError
        A file would overwrite an input, or a mounting of other inputs.
    """
    page, document = out.with_suffix(".html"), out.with_suffix(".json")
    inputs = [Path(path) for path in result.document.get("inputs", ())]
    refuse_overwriting((out, document, page), inputs, "another --out FILE")
    if not force and out.is_file():
        hashes = {digest for _, digest in result.mounting.inputs}
        hashes_present = set(HASH.findall(out.read_text(encoding="utf-8", errors="replace")))
        if hashes != hashes_present and not hashes & hashes_present:
            raise UsageError(
                f"{out} exists and was made from other inputs; give another file with --out,"
                " or --force"
            )
    if not force and (reason := other_results(document, inputs, one_is_enough=True)):
        raise UsageError(f"{reason}; give another file with --out, or --force")
    result = replace(result, files=(out, document, page))
    with together():
        write_mounting_file(result.mounting, out)
        files = [file for path in inputs for file in files_of(path)]
        numbers = result.as_dict() | made_from(files, document, [out])
        write_with_page(document_of(result, result.charts()), numbers, document, page)
    return result


def files_of(path: Path) -> list[Path]:
    """List the files of an input, itself or those of a directory, such as a model of COLMAP."""
    return sorted(file for file in path.rglob("*") if file.is_file()) if path.is_dir() else [path]


def compare_arms(result: CalibratedMounting, calibration_file: Path) -> CalibratedMounting:
    """Return a result with its difference to another lever arm.

    Parameters
    ----------
    result : CalibratedMounting
        What was found.
    calibration_file : Path
        A mounting.toml.

    Returns
    -------
    CalibratedMounting
        With a sentence more.

    Raises
    ------
    InputError
        The file is wrong, or has no lever arm with standard errors.
    """
    file, _ = read_mounting_file(calibration_file)
    if file.antenna_m is None or file.antenna_cov is None:
        problem = "has no antenna_m with standard errors in [calibration.sigma] to compare with"
        raise InputError.in_file(calibration_file, problem)
    mounting = result.mounting
    if mounting.antenna_m is None or mounting.antenna_cov is None:
        return result
    difference = lever_arm_difference(
        file.antenna_m, file.antenna_cov, mounting.antenna_m, mounting.antenna_cov
    )
    line = f"against {calibration_file.name} ({file.verb or 'by hand'}): {difference.summary()}"
    document = result.document | {
        "difference_m": difference.difference_m,
        "difference_agrees": difference.agrees,
        "inputs": (*result.document.get("inputs", ()), calibration_file),
    }
    judged = replace(mounting, verdict=(*mounting.verdict, line))
    return replace(result, mounting=judged, details=(line, *result.details), document=document)


def document_of(result: CalibratedMounting, charts: Sequence[Chart] = ()) -> Document:
    """Return what a calibration says.

    Parameters
    ----------
    result : CalibratedMounting
        What was found.
    charts : sequence of Chart
        Its charts, for the page.

    Returns
    -------
    Document
        With the verdict on each component.
    """
    named: dict[str, list[str]] = {}
    for name, word, _ in result.components:
        if word != "determined" and name != "imu_m":
            named.setdefault(word, []).append(name)
    refusal, head = result.refusal, ("component", "verdict", "value")
    return Document(
        result.title,
        result.headline,
        worst_of(
            "every component that these data can show is determined",
            [f"{word}: {', '.join(names)}" for word, names in named.items()],
            [] if refusal is None else [str(refusal)],
        ),
        (
            Section("What was determined", [Table(result.components, head)]),
            *charts,
            Section("Notes", result.details),
        ),
        result.document.get("inputs", ()),
        files=result.files,
    )


def metashape_line(mounting: MountingFile) -> str:
    """Return what Metashape takes of a mounting, in words; empty where it takes nothing.

    Parameters
    ----------
    mounting : MountingFile
        The mounting.

    Returns
    -------
    str
        Of the tab "GPS/INS Offset".
    """
    location, angles = metashape_offset(
        mounting.antenna_m, mounting.boresight, mounting.camera_from_body
    )
    parts = []
    if location is not None:
        parts.append("X Y Z " + " ".join(f"{v:.4f}" for v in location) + " m")
    if angles is not None:
        parts.append("yaw pitch roll " + " ".join(f"{v:.4f}" for v in np.degrees(angles)) + " deg")
    return f"Metashape, GPS/INS Offset: {', '.join(parts)}" if parts else ""
