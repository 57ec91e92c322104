"""The record of an inspection; `run.Inspection` adds its texts and its picture."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ...base.errors import DataError, InputError, InsgnssError
from ...records import CameraEvents, Finding, GnssFixes, ImuSamples
from .sources import Source

if TYPE_CHECKING:
    from ...navigation.recognise.recognition import Recognition
    from .draft import Draft
    from .sensing import Sensing


@dataclass(frozen=True, eq=False)
class InspectionData:
    """What an inspection found.

    Parameters
    ----------
    imu : ImuSamples
        In rad/s and m/s^2, as recognised, in the sensor's axes.
    gnss : GnssFixes or None
        On the IMU's clock.
    gyro_counts : float or None, rad/s
        As in `alone.Alone`.
    recognition : Recognition or None
        None where there is no receiver, or for the reason `unrecognised`.
    missing : str
        What a flight file lacks.
    """

    name: str
    sources: tuple[Source, ...]
    left_out: tuple[tuple[Path, str], ...]
    imu: ImuSamples
    gnss: GnssFixes | None
    events: CameraEvents | None
    sensing: "Sensing"
    gyro_counts: float | None
    recognition: "Recognition | None"
    unrecognised: str
    findings: "tuple[Finding, ...]"
    checks: tuple[Finding, ...]
    draft: "Draft | None"
    missing: str = ""
    written: tuple[Path, ...] = ()

    @property
    def contradictions(self) -> list[str]:
        """One sentence for each check that the data contradict."""
        return [c.named_sentence for c in self.checks if c.verdict == "contradiction"]

    @property
    def refusal(self) -> InsgnssError | None:
        """What keeps the recording from being a flight: something missing, or a contradiction."""
        if self.missing:
            return DataError(self.missing)
        return InputError("; ".join(self.contradictions)) if self.contradictions else None
