"""A flight file's recording: its checks, and what the data show when read as the file says."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...base.errors import InputError, InsgnssError, UsageError
from ...records import Finding
from ...report.document import Section
from ...report.notebook import Shown
from ..processing.inspect import InspectResult
from ..processing.progress import Progress, quiet
from .page import finding_documents, findings_section

if TYPE_CHECKING:
    from ..config.flight_file import Flight


@dataclass(frozen=True, eq=False)
class FlightInspection(Shown):
    """Checks of a flight file's recording, with what the data show of themselves."""

    result: InspectResult
    findings: tuple[Finding, ...]
    unrecognised: str

    @property
    def refusal(self) -> InsgnssError | None:
        """The contradictions as an error; None where there are none."""
        return (
            InputError("; ".join(self.result.contradictions))
            if self.result.contradictions
            else None
        )

    def summary(self) -> str:
        """Return the text for the terminal."""
        unrecognised = [f"not recognised: {self.unrecognised}"] if self.unrecognised else []
        title = "What the data show, read as the flight file says"
        shown = findings_section(title, self.findings)
        return self.result.document([Section(title, unrecognised), shown]).text()

    def as_dict(self) -> dict[str, Any]:
        """Return the inspection for JSON output."""
        return self.result.as_dict() | {
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


def inspect_flight(path: "Path | Flight", progress: Progress = quiet) -> FlightInspection:
    """Check a flight file's recording and recognise it; checks report where they differ.

    Raises
    ------
    InputError
        Where the flight file or its inputs cannot be read.
    """
    from ..config.flight_file import Flight
    from ..config.load import load_flight
    from ..processing.inspect import inspect
    from ..processing.recording import read_recording

    flight = path if isinstance(path, Flight) else load_flight(path)
    progress("reading")
    recording = read_recording(flight)
    result = inspect(flight, progress, recording)
    if flight.gnss.stationary is not None:
        return FlightInspection(result, (), "the sensor is stationary")
    if recording.recognition is None:
        return FlightInspection(
            result, (), "not recognised while a check contradicts the flight file"
        )
    return FlightInspection(result, recording.recognition.findings, "")
