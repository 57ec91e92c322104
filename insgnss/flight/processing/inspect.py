"""The inspection of a flight: the checks of its recording, without processing it."""

from dataclasses import dataclass
from typing import Any

from ...base.errors import InsgnssError
from ...base.findings import check_lines
from ...records import Finding, Question
from ..config.flight_file import Flight
from .progress import Progress, quiet
from .recording import Recording, read_recording


@dataclass(frozen=True)
class InspectResult:
    """The checks of a recording.

    Parameters
    ----------
    name : str
        The name of the flight.
    checks : tuple of Finding
        The checks.
    """

    name: str
    checks: tuple[Finding, ...]

    @property
    def contradictions(self) -> list[str]:
        """One sentence for each check that the data contradict."""
        return [check.named_sentence for check in self.checks if check.verdict == "contradiction"]

    def summary(self) -> str:
        """Return a table for the terminal."""
        return "\n".join([self.name, *check_lines(self.checks)])

    def as_dict(self) -> dict[str, Any]:
        """Return the checks in types that JSON has."""
        return {"name": self.name, "checks": [check.as_dict() for check in self.checks]}


def inspect(
    flight: Flight, progress: Progress = quiet, recording: Recording | None = None
) -> InspectResult:
    """Check a flight without processing it.

    What needs the attitude (the heading against the course) is left to
    `flight.processing.pipeline.process`.

    Parameters
    ----------
    flight : Flight
        The flight file.
    progress : Progress
        Receives the name of each step.
    recording : Recording or None
        What `read_recording` made of the flight, where that is known already.

    Returns
    -------
    InspectResult
        The checks; contradictions among them are not raised.

    Raises
    ------
    InputError, DataError
        Where the recording cannot be read.
    """
    from ...io.exposures.instants import refuse_outside
    from ...navigation.prepare.clock import common_span

    progress("reading")
    recording = recording or read_recording(flight)
    checks = list(recording.checks)
    try:
        lo, hi = common_span(recording.imu, recording.gnss, flight.start_tow, flight.end_tow)
        for camera in recording.cameras:
            refuse_outside(camera.events, lo, hi)
    except InsgnssError as error:
        message = str(error)
        checks.append(Question("span", "IMU, GNSS and images overlap").contradiction(message))
    heading = Question("heading against course", "needs the attitude: `insgnss process` checks it")
    checks.append(heading.ok("not checked here"))
    return InspectResult(flight.name, tuple(checks))
