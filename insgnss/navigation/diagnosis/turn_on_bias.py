"""Turn-on biases that the noise model lacks: named, and looked for in the innovations.

A model whose axes have no `turn_on_bias`, as published variances give one, takes the constant
biases of the sensors for zero. Where the innovations show them, the solution is wrong.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...base.errors import DataError
from ...base.units import STANDARD_GRAVITY
from ...records import Finding, Question
from .evidence import GAIN, misfit

if TYPE_CHECKING:
    from ..filter.solution import Solution
    from ..noise_model.model import NoiseModel

TURN_ON = {  # a-priori sigma of a calibrated MEMS IMU, rad/s and m/s^2
    "gyro": np.radians(100.0) / 3600.0,
    "accel": 2e-3 * STANDARD_GRAVITY,
}
TURN_ON_ADVICE = (
    "set turn_on_bias in the noise model: 100 deg/h and 2 mg suit a calibrated MEMS IMU, or as its "
    "recordings at rest tell"
)


def without_turn_on(noise: "NoiseModel") -> tuple[str, ...]:
    """Name the sensors with noise of which an axis has no turn-on bias.

    Parameters
    ----------
    noise : NoiseModel
        The noise model of the IMU.

    Returns
    -------
    tuple of str
        Some of "gyro" and "accel".
    """
    return tuple(
        sensor
        for sensor in TURN_ON
        if any(a.white_noise > 0.0 and a.turn_on_bias == 0.0 for a in getattr(noise, sensor))
    )


def with_turn_on(noise: "NoiseModel") -> "NoiseModel":
    """Give every axis that has no turn-on bias one of `TURN_ON`.

    Parameters
    ----------
    noise : NoiseModel
        The noise model of the IMU.

    Returns
    -------
    NoiseModel
        The model with turn-on biases; those that it has stay.
    """
    gx, gy, gz = (
        replace(axis, turn_on_bias=axis.turn_on_bias or TURN_ON["gyro"]) for axis in noise.gyro
    )
    ax, ay, az = (
        replace(axis, turn_on_bias=axis.turn_on_bias or TURN_ON["accel"]) for axis in noise.accel
    )
    return replace(noise, gyro=(gx, gy, gz), accel=(ax, ay, az))


def check_turn_on(noise: "NoiseModel") -> Finding:
    """Note what a noise model that `without_turn_on` names does.

    Parameters
    ----------
    noise : NoiseModel
        A noise model of which a sensor lacks turn-on biases.

    Returns
    -------
    Finding
        The note "turn-on bias".
    """
    missing = " and ".join(without_turn_on(noise))
    finding = (
        f"noise model {noise.name} without turn_on_bias of {missing}: constant biases are taken "
        "for zero"
    )
    return Question("turn-on bias", "turn_on_bias of gyro and accel").note(finding, TURN_ON_ADVICE)


def check_biases_in_innovations(
    noise: "NoiseModel", solution: "Solution | None", solve_with_biases: "Callable[[], Solution]"
) -> Finding | None:
    """Check whether the innovations show the turn-on biases that a noise model lacks.

    Parameters
    ----------
    noise : NoiseModel
        A noise model of which a sensor lacks turn-on biases.
    solution : Solution or None
        The solution without these biases; None where there is none.
    solve_with_biases : callable
        Solves the same problem with the biases among its states.

    Returns
    -------
    Finding or None
        The contradiction "turn-on bias" where they gain more than `evidence.GAIN` in (C.1).
    """
    try:
        candidate = solve_with_biases()
    except DataError:
        return None
    gain = np.inf if solution is None else misfit(solution) - misfit(candidate)
    if gain <= GAIN:
        return None
    reason = (
        "no solution without them"
        if solution is None
        else f"-2 log L falls by {gain:.0f} with them, limit {GAIN:g}"
    )
    check = check_turn_on(noise)
    finding = f"{check.found}, and the innovations show them ({reason})"
    return replace(check, found=finding, verdict="contradiction")
