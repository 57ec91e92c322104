"""What a flight says of its noise, as a record; `in_flight_result.FlightTuning` adds its texts."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ....navigation.noise_model.model import NoiseModel

if TYPE_CHECKING:
    from ....navigation.innovations.innovation_noise import InFlightNoise
    from .straight_flight import StraightFlight


@dataclass(frozen=True)
class FlightTuningData:
    """What a flight says of its noise. accepted : whether the static model gives way.
    reasons : of that, sentence by sentence.

    noise : the estimate.   static, model : the model of the flight file, and the same with the
                            factors found.
    files : what was written.
    lost_before, lost_after : fixes that the solutions with the static model and with the new one
        reject.
    straight : spectrum of the IMU in straight flight, None without.
    dropped_correlated : whether noise of the IMU explains what the
    solution took for a time-correlated error of the fixes.
    notes : what became of segments between gaps of the IMU.
    key : of the flight
    file, for the model found.
    """

    name: str
    accepted: bool
    reasons: tuple[str, ...]
    noise: "InFlightNoise"
    static: NoiseModel
    model: NoiseModel
    lost_before: int
    lost_after: int
    straight: "StraightFlight | None"
    dropped_correlated: bool
    notes: tuple[str, ...] = ()
    files: tuple[Path, ...] = ()
    key: str = "imu.noise"

    @property
    def headline(self) -> str:
        """The verdict without its reasons."""
        return (
            "accept the noise found in flight"
            if self.accepted
            else f"keep the static model {self.static.name}"
        )

    @property
    def verdict(self) -> str:
        """In one sentence."""
        return f"{self.headline}: {'; '.join(self.reasons)}"

    @property
    def file(self) -> Path | None:
        """The noise model that was written, or None."""
        return self.files[0] if self.accepted and self.files else None
