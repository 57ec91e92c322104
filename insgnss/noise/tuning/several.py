"""Noise in flight of each IMU of a flight that carries several.

The innovations of the IMUs combined tell the noise of their weighted mean, not whose it is: factors
of several IMUs would enter them as one sum. So each IMU has the flight for itself, with its own
file, axes and noise model, and with lever arms from where it sits: the vector r from the first IMU,
body axes, moves the IMU in camera axes by C_cb r (M.1). The others stay as they are.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ...base.errors import InsgnssError
from ...flight.config.flight_file import Flight
from ...flight.processing.progress import Progress, quiet
from ...report.notebook import Shown
from .in_flight.estimation import FlightTuning, chosen_parameters, estimate, tune_flight
from .in_flight.files import plan_model_file, write

TOGETHER = (
    "each IMU was tuned alone: noise that all IMUs have in common, such as vibration, does not"
    " average out, although `process` assumes that it does where it combines the IMUs"
)


@dataclass(frozen=True)
class SeveralTuned(Shown):
    """What a flight says of the noise of each of its IMUs, in the order of the flight file."""

    name: str
    tuned: tuple[FlightTuning, ...]

    def summary(self) -> str:
        """What a person reads."""
        return "\n\n".join([*(one.summary() for one in self.tuned), TOGETHER])

    def as_dict(self) -> dict[str, Any]:
        """JSON-able."""
        return {
            "name": self.name,
            "imus": [one.as_dict() for one in self.tuned],
            "notes": [TOGETHER],
        }


def tune_each(
    flight: Flight,
    out: Path | None = None,
    parameters: Sequence[str] | None = None,
    progress: Progress = quiet,
    force: bool = False,
) -> FlightTuning | SeveralTuned:
    """`tune_flight` for the IMU of a flight, or for each of several: files of the second bear _2
    behind the name, and so on.

    Nothing is written unless all of them could be tuned. Raises as `tune_flight` does, with the
    number of the IMU.
    """
    if not flight.imu.further:
        return tune_flight(flight, out, parameters, progress, force)
    chosen, first = chosen_parameters(parameters), plan_model_file(flight, out, force)
    flights = alone(flight)
    more = [first.with_name(f"{first.stem}_{k}.toml") for k in range(2, len(flights) + 1)]
    targets = [first, *(plan_model_file(flight, target, force) for target in more)]
    tuned = [_estimate(one, k, chosen, progress) for k, one in enumerate(flights, start=1)]
    return SeveralTuned(
        flight.name, tuple(write(*one) for one in zip(tuned, flights, targets, strict=True))
    )


def alone(flight: Flight) -> tuple[Flight, ...]:
    """The flight of each of its IMUs without the others."""
    m = flight.mounting
    return tuple(
        replace(
            flight,
            name=f"{flight.name}, IMU {k}",
            imu=replace(imu, further=(), lever_m=(0.0, 0.0, 0.0)),
            mounting=replace(m, imu_m=m.imu_m + m.C_cb @ imu.lever_m),
        )
        for k, imu in enumerate((flight.imu, *flight.imu.further), start=1)
    )


def _estimate(
    flight: Flight, number: int, chosen: tuple[str, ...], progress: Progress
) -> FlightTuning:
    """The estimate of one IMU, whose errors tell its number."""
    try:
        tuned = estimate(flight, chosen, lambda step: progress(f"IMU {number}: {step}"))
    except InsgnssError as error:
        raise type(error)(f"IMU {number} alone: {error}") from None
    return tuned if number == 1 else replace(tuned, key=f"imu.further[{number - 1}].noise")
