"""What an adjustment says of the vehicle: findings, and what to do about a trial."""

from collections.abc import Iterator, Mapping
from itertools import permutations, product
from typing import Any

import numpy as np

from ....base.findings import Finding, ranked
from ....base.wording import some
from ....records.block import Array
from ....report.rules.wording import lengths
from ...adjust.kinematic import (
    KINEMATIC_CONTROL,
    SIZE,
    TARGET_SIZES,
    VEHICLE_CLOCK,
    VEHICLE_SHIFT,
)
from ...adjust.unknowns import Key
from ..parameters import FRD, VEHICLE_PARAMETERS
from .places import Vehicle

MANY_LEFT_OUT = 0.1
"""Of the measurements of the target: gross errors of a good detector are below 2 %."""
# times the share that was left out, for its rank: before ground control
DISCONNECTED_VEHICLE = 10.0
# images (1) that tell the size of a target: 5, a median of fewer may be one outlier's
FEWEST_SIZES = 5
SIGNIFICANT_W = 3.0  # median standardised residual of sizes (1): 3, beyond chance
# within which exchanged axes explain a lever arm: sigmas of it, and m to which it was measured
FRAME_SIGMAS, FRAME_M = 4.0, 0.05
MISTAKES: dict[tuple[tuple[int, ...], tuple[float, ...]], str] = {  # by order and signs
    ((1, 0, 2), (1.0, 1.0, 1.0)): "forward and right were exchanged",
    ((1, 0, 2), (1.0, 1.0, -1.0)): (
        "it was given right, forward, up (east, north, up of a vehicle heading north)"
    ),
    ((2, 0, 1), (1.0, 1.0, 1.0)): (
        "it was given in the axes of a camera that looks ahead (right, down, forward)"
    ),
}


def left_out(figures: Mapping[str, Any]) -> Iterator[Finding]:
    """Say which measurements of the target do not fit, and that they are too many.

    Parameters
    ----------
    figures : mapping
        Figures of the block.

    Yields
    ------
    Finding
        The finding.
    """
    vehicle = figures["vehicle"]
    if vehicle is None or not vehicle["left_out"]:
        return
    names = [p["image"] for p in vehicle["points"] if p["left_out"]]
    named = some(names)
    n, k = vehicle["exposures"], vehicle["left_out"]
    share = k / n
    text = f"{k} of {n} measurements of the vehicle's target do not fit and were left out: {named}"
    if k > 1 and share > MANY_LEFT_OUT:
        yield ranked(KINEMATIC_CONTROL, DISCONNECTED_VEHICLE * share + 1.0, text)
    else:
        yield ranked(
            KINEMATIC_CONTROL, 0.6, text, "see these images: another target, a shadow, a wrong name"
        )


def wrong_target_size(figures: Mapping[str, Any]) -> Iterator[Finding]:
    """Say that the target is larger or smaller than stated, where its sizes in images agree.

    Parameters
    ----------
    figures : mapping
        Figures of the block.

    Yields
    ------
    Finding
        The finding.
    """
    vehicle = figures["vehicle"]
    if vehicle is None or SIZE in vehicle["parameters"]:
        return
    share = [p["size_residual_px"] / p["size_px"] for p in vehicle["points"] if "size_px" in p]
    size_w = [p["size_w"] for p in vehicle["points"] if "size_px" in p]
    if len(share) < FEWEST_SIZES or abs(np.median(size_w)) < SIGNIFICANT_W:
        return
    percent = 100.0 * float(np.median(share))
    yield ranked(
        TARGET_SIZES,
        float(abs(np.median(size_w))) / SIGNIFICANT_W,
        f"the target looks {abs(percent):.1f} % {'larger' if percent > 0.0 else 'smaller'} than"
        f" vehicle.size_m, median of {len(share)} images",
        "give its diameter, or estimate it with vehicle.size_sigma_m",
    )


def remedy(vehicle: Vehicle | None, key: Key, value: Array, sigma: Array) -> str:
    """Say what to do about what a trial found.

    Parameters
    ----------
    vehicle : Vehicle or None
        The vehicle.
    key : tuple
        The unknown that was added.
    value, sigma : ndarray
        What it is, with standard deviation.

    Returns
    -------
    str
        The advice; empty of what is no unknown of a vehicle.
    """
    if vehicle is None or key not in [one.key for one in VEHICLE_PARAMETERS]:
        return ""
    if key[0] == VEHICLE_CLOCK:
        offset = vehicle.options.time_offset_s + float(value[0])
        return (
            f"correct the vehicle's clock (vehicle.time_offset_s = {offset:+.3f}), or estimate its"
            " delay with vehicle.time_offset_sigma_s"
        )
    if key[0] == VEHICLE_SHIFT:
        return (
            "check coordinates, datum and antenna of the vehicle's base against those of the"
            " drone's, or estimate it with vehicle.shift_sigma_m"
        )
    arm = vehicle.track.arm_m + value
    arm_text = ", ".join(f"{x:.2f}" for x in arm)
    axes = frame_of(vehicle.track.arm_m, arm, sigma)
    return f"{f'{axes}; ' if axes else ''}with vehicle.target_m = [{arm_text}] it fits"


def frame_of(stated: Array, adjusted: Array, sigma: Array) -> str:
    """Say in which axes a lever arm was stated that the adjustment finds to be another.

    Parameters
    ----------
    stated, adjusted, sigma : ndarray, (3,)
        As stated, as found, and its standard deviation, m: forward, right, down.

    Returns
    -------
    str
        Such as "it was given upwards instead of down"; empty where no exchange of axes explains it.
    """
    limit = FRAME_SIGMAS * sigma + FRAME_M
    fits = []
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            if order == (0, 1, 2) and signs == (1.0, 1.0, 1.0):
                continue
            difference = np.abs(np.array(signs) * stated[list(order)] - adjusted)
            if (difference < limit).all():
                # what people do wrong changes little
                changed = 3 * sum(k != p for k, p in enumerate(order)) + signs.count(-1.0)
                cost = 1 if (order, signs) in MISTAKES else changed
                fits.append((cost, float((difference / limit).sum()), order, signs))
    if not fits or (np.abs(stated) < FRAME_M).all():
        return ""
    _, _, order, signs = min(fits)
    if order == (0, 1, 2):
        names = (("forward", "backwards"), ("right", "left"), ("down", "upwards"))
        wrong = [k for k in range(3) if signs[k] < 0.0 and abs(stated[k]) > limit[k]]
        return " and ".join(f"it was given {names[k][1]} instead of {names[k][0]}" for k in wrong)
    numbers = ("first", "second", "third")
    order_names = ", ".join(
        f"{FRD[k]} is {'minus ' if signs[k] < 0.0 else ''}its {numbers[order[k]]}" for k in range(3)
    )
    return MISTAKES.get((order, signs), f"its axes were others ({order_names} number)")


def headline_words(figures: Mapping[str, Any]) -> str:
    """Return the residuals of the vehicle in words; empty without one."""
    fig = figures["vehicle"]
    if fig is None:
        return ""
    used = np.array([p["residual_m"] for p in fig["points"] if not p["left_out"]]).reshape(-1, 3)
    if not len(used):
        return ""
    rms = np.sqrt((used**2).mean(axis=0))
    return f"{len(used)} places of the vehicle {lengths([1e3 * x for x in rms])} rms"
