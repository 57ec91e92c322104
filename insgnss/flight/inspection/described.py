"""A flight file's recording: its checks, and what the data show when read as the file says."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...base.errors import InsgnssError, UsageError
from ...io.exposures.instants import refuse_outside
from ...navigation.prepare.clock import common_span
from ...records import Finding, Question
from ...report.document import Document, Section, checks_section
from ...report.verdict import worst_of
from ..config.flight_file import Flight
from ..config.load import load_flight
from ..processing.progress import Progress, quiet
from ..processing.recording import Recording, read_recording
from .page import finding_documents, findings_section
from .result import Inspected


@dataclass(frozen=True, eq=False)
class FlightInspection(Inspected):
    """Checks of a flight file's recording, with what the data show of themselves."""

    def summary(self) -> str:
        """Return the text for the terminal."""
        notes = [check.name for check in self.checks if check.verdict == "note"]
        verdict = worst_of(
            "no check has a note",
            [f"checks have a note: {', '.join(notes)}"] if notes else [],
            self.contradictions,
        )
        headline = f"{self.name}: {len(self.checks)} checks of the recording"
        unrecognised = [f"not recognised: {self.unrecognised}"] if self.unrecognised else []
        title = "What the data show when they are read as the flight file states"
        shown = (Section(title, unrecognised), findings_section(title, self.findings))
        return Document(self.name, headline, verdict, (checks_section(self.checks), *shown)).text()

    def as_dict(self) -> dict[str, Any]:
        """Return the inspection for JSON output."""
        return {
            "name": self.name,
            "checks": [check.as_dict() for check in self.checks],
            "findings": finding_documents(self.findings),
            "unrecognised": self.unrecognised,
        }


def flight_file(sources: Sequence[Path], write: bool) -> Path | None:
    """Find the flight file among the paths to be inspected; None where there is none.

    Parameters
    ----------
    sources : sequence of Path
    write : bool
        Whether a flight file is to be written.

    Raises
    ------
    UsageError
        Where a flight file is to be written from a flight file, or stands beside other paths.
    """
    tomls = [path for path in sources if path.suffix.lower() == ".toml"]
    if tomls and (write or len(sources) > 1):
        problem = (
            "is a flight file already; give --write the files of the recording"
            if write
            else "is a flight file; inspect it alone"
        )
        raise UsageError(f"{tomls[0]}: {problem}")
    if tomls:
        return tomls[0]
    inside = len(sources) == 1 and not write and (sources[0] / "flight.toml").is_file()
    return sources[0] if inside else None


def inspect_flight(path: Path | Flight, progress: Progress = quiet) -> FlightInspection:
    """Check a flight file's recording and recognise it; contradictions are not raised.

    What needs the attitude (the heading against the course) is left to
    `flight.processing.pipeline.process`.

    Raises
    ------
    InputError, DataError
        Where the flight file or its inputs cannot be read.
    """
    flight = path if isinstance(path, Flight) else load_flight(path)
    progress("reading")
    recording = read_recording(flight)
    findings, unrecognised = tuple[Finding, ...](), ""
    if flight.gnss.stationary is not None:
        unrecognised = "the sensor is stationary"
    elif recording.recognition is None:
        unrecognised = "nothing is recognised as long as a check contradicts the flight file"
    else:
        findings = recording.recognition.findings
    return FlightInspection(flight.name, _checks(flight, recording), findings, unrecognised)


def _checks(flight: Flight, recording: Recording) -> tuple[Finding, ...]:
    """The checks of the recording, of its span, and of what only `process` can check."""
    checks = list(recording.checks)
    try:
        lo, hi = common_span(recording.imu, recording.gnss, flight.start_tow, flight.end_tow)
        for camera in recording.cameras:
            refuse_outside(camera.events, lo, hi)
    except InsgnssError as error:
        message = str(error)
        checks.append(Question("span", "IMU, GNSS and images overlap").contradiction(message))
    heading = Question("heading against course", "needs the attitude: `insgnss process` checks it")
    return (*checks, heading.ok("not checked here"))
