"""The sensors that a flight with an uncertain heading is tried with, as their makers state them."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ...base.units import DEG
from ...records.measurements import Measurement
from .kinds import TURN, kinds
from .options import MeasurementInput

ANTENNA_PAIR = "two antennas 1 m apart"
ANTENNAS_SIGMA = 0.2 * DEG  # of a heading by antennas 1 m apart, as makers of receivers state it
VELOCITY_SIGMA_MPS = 0.05  # of a wheel or an optical flow sensor
FIELD_SIGMA_UT = 0.4  # of a magnetometer on a chip, at 10 Hz


def trial_sensors() -> dict[str, Measurement]:
    """Return the sensors that may improve a heading, by what a user would buy.

    Returns
    -------
    dict of str to Measurement
        Of one instant each. The antennas' mounting is known; the others have the states that their
        kinds have by default.
    """
    antennas = _sensor("heading", ("heading",), ANTENNAS_SIGMA)
    field = ("x", "y", "z")
    return {
        ANTENNA_PAIR: replace(
            antennas, predict=lambda motion, _: motion.roll_pitch_heading[:, 2], states=()
        ),
        "an odometer": _sensor("body_velocity", ("forward",), VELOCITY_SIGMA_MPS),
        "velocities along all body axes": _sensor(
            "body_velocity", ("forward", "right", "down"), VELOCITY_SIGMA_MPS
        ),
        "a magnetometer": _sensor("magnetometer", field, FIELD_SIGMA_UT, declination_deg=0.0),
    }


def _sensor(kind: str, columns: tuple[str, ...], sigma: float, **options: Any) -> Measurement:
    """Return a sensor of a shipped kind at one instant, whose derivative is by differences."""
    table = MeasurementInput(kind=kind, file=Path(kind), **options)
    predict, states, *_ = kinds()[kind].model(table, columns)
    period = TURN if kinds()[kind].unit == "angle" else None
    zero = np.zeros((1, len(columns)))
    return Measurement(kind, np.zeros(1), zero, sigma, predict, states, period=period)
