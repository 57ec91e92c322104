"""The record of an inspection; `run.Inspection` adds its texts and its picture."""

from dataclasses import dataclass
from pathlib import Path

from ...base.errors import DataError, InputError, InsgnssError
from ...navigation.recognise.recognition import Recognition
from ...records import CameraEvents, Finding, GnssFixes, ImuSamples
from ...report.notebook import Shown
from .draft import Draft
from .rinex.survey import Survey
from .sensing import Sensing
from .sources import InputSource, LeftOut


@dataclass(frozen=True, eq=False)
class Inspected(Shown):
    """What is said of a recording.

    Parameters
    ----------
    name : str
        Of the flight, or of the files.
    checks : tuple of Finding
        Those of the recording.
    findings : tuple of Finding
        What was recognised.
    unrecognised : str
        Why nothing was.
    """

    name: str
    checks: tuple[Finding, ...]
    findings: tuple[Finding, ...]
    unrecognised: str

    @property
    def contradictions(self) -> list[str]:
        """One sentence for each check that the data contradict."""
        return [c.named_sentence for c in self.checks if c.verdict == "contradiction"]

    @property
    def refusal(self) -> InsgnssError | None:
        """What keeps the recording from being a flight; None where nothing does."""
        return InputError("; ".join(self.contradictions)) if self.contradictions else None


@dataclass(frozen=True, eq=False)
class Recorded:
    """What the files of a recording hold, in one week, and what was recognised of them.

    Parameters
    ----------
    name : str
        Of the directory, or of the one file given.
    sources : tuple of InputSource
        The samples first.
    left_out : tuple of LeftOut
        Files that are no source, each with the reason.
    imu : ImuSamples
        As the file has them.
    gnss : GnssFixes or None
        Their times as the file has them.
    events : CameraEvents or None
        The exposures.
    recognition : Recognition or None
        None where there is no receiver, or for the reason `unrecognised`.
    unrecognised : str
        Why nothing was recognised.
    week : tuple of int, str, or None
        The GPS week with its origin, where no file gives it.
    event_clock : tuple of str, str, bool
        Whose clock stamps the exposures, why, and whether that is sure (`clock_of_events`).
    rinex : Survey or None
        RINEX files, which stand for fixes where there are none.
    """

    name: str
    sources: tuple[InputSource, ...]
    left_out: tuple[LeftOut, ...]
    imu: ImuSamples
    gnss: GnssFixes | None
    events: CameraEvents | None
    recognition: Recognition | None
    unrecognised: str
    week: tuple[int, str] | None
    event_clock: tuple[str, str, bool]
    rinex: Survey | None


@dataclass(frozen=True, eq=False)
class InspectionData(Inspected, Recorded):
    """What an inspection of files found.

    Its samples are in rad/s and m/s^2, as recognised, in the sensor's axes; its fixes are on their
    clock.

    Parameters
    ----------
    sensing : Sensing
        What the samples show of the sensor.
    gyro_counts : float or None, rad/s
        As in `alone.Alone`.
    draft : Draft or None
        The flight file.
    missing : str
        What a flight file lacks.
    written : tuple of Path
        The files of the draft.
    """

    sensing: Sensing
    gyro_counts: float | None
    draft: Draft | None
    missing: str = ""
    written: tuple[Path, ...] = ()

    @property
    def refusal(self) -> InsgnssError | None:
        """What keeps the recording from being a flight: something missing, or a contradiction."""
        return DataError(self.missing) if self.missing else super().refusal
