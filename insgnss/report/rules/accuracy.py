"""Rules on how well the flight as a whole is known, and why.

Each compares a sigma with that of a good flight (an RTK fix every 0.1 to 1 s, turns between the
lines, an IMU of the class of a NavChip); the limits stand below.
"""

import math
from collections.abc import Iterator, Sequence

from ...base.findings import Finding, ranked
from ...base.wording import some
from ...records.cameras.mounting import antenna_sigmas
from ...records.states import OF_LEVER_ARM
from ...records.verdicts import REMARK
from .hidden import BORESIGHT, known_boresight
from .wording import Figures, degrees, millimetres, tilt

# median sigmas that are good: fixed ambiguities, and a MEMS IMU on a block with turns, give less
GOOD_HORIZONTAL_MM, GOOD_TILT_DEG, GOOD_HEADING_DEG = 50.0, 0.05, 0.15
GOOD_GYRO_DEG_H = 60.0  # sigma of a gyro bias: its heading drifts by a degree a minute
CODE_MM = 500.0  # horizontal sigma beyond which no ambiguities were fixed
PROCESS_RAW = "process the raw GNSS data with those of a base station (PPK), or fly with RTK"
HEIGHT_RATIO = 2.0  # of the vertical to one horizontal sigma
SHARE_OF_FIXES = 0.7  # of that ratio, from which on the fixes themselves explain it
# of the images' variance (1): 0.5, beyond which the stamps outweigh all other errors together
SHARE_OF_STAMPS = 0.5
SHARE_OF_ARM = 0.7  # of the sigma of the images (1): 0.7, half of the variance
MINUTE_S = 60.0  # for which users are told what a bias or a slow error makes
SIGNIFICANT = 3.0  # sigmas of an estimated constant
MOST_STATES = 4  # states in a sentence (chosen)
USUAL_ARM_SIGMA_M = 0.3  # of filter.lever_arm_sigma_m, which says nothing of this antenna
# what a right lever arm may come out off by (`navigation.diagnosis.advice`)
NEGLIGIBLE_ARM_M = 0.02
EITHER_WRONG = "the place of the images is in doubt"
LARGE_TURN_DEG = 2.0  # of the heading by a bore-sight: beyond it, its signs are worth a look
EARTH_RATE_DEG_H = 15.041  # of the Earth against the stars


def standing(figures: Figures) -> Iterator[Finding]:
    """Yield the accuracy of a sensor at a given position."""
    if not figures["standing"]:
        return
    attitude, bias = (
        figures["trajectory"]["attitude_deg"]["median"],
        max(figures["biases"]["gyro_sigma_deg_h"][:2]),
    )
    level = EARTH_RATE_DEG_H * math.cos(math.radians(figures["flight"]["gnss"]["stationary"][0]))
    rate = level * math.radians(attitude[2])
    text = (
        "standing at a given place: attitude from the Earth's rotation and gravity; heading sigma"
        f" {degrees(attitude[2])}, a level rate known to {rate:.2g} of the Earth's {level:.1f}"
        f" deg/h, gyro biases to {bias:.2g} deg/h; tilt sigma {degrees(tilt(attitude))}"
    )
    remedy = "repeat with the IMU turned by 180 deg about the vertical to separate bias and heading"
    yield ranked(
        "standing",
        20.0,
        text,
        remedy if bias > 0.5 * rate else "stand for longer: the gyros' noise averages out",
    )


def code(figures: Figures) -> Iterator[Finding]:
    """Yield the absolute position where no ambiguities were fixed (float ambiguities, code)."""
    north, east, down = figures["trajectory"]["position_mm"]["median"]
    horizontal = math.hypot(north, east)
    predicted = figures["innovations"]["median_sigma_mm"]
    if horizontal < CODE_MM:
        if predicted is not None and max(predicted[:2]) > CODE_MM and not figures["standing"]:
            text = "the GNSS positions are code solutions, without fixed ambiguities: each is known"
            text += f" to {millimetres(max(predicted[:2]))} horizontally"
            yield ranked("absolute position", REMARK, text, PROCESS_RAW)
        return
    text = (
        f"absolute position is known only to {millimetres(horizontal)} horizontally and "
        f"{millimetres(down)} in height"
    )
    if figures["time_correlated_errors"]:
        slowest = max(error["time_s"] for error in figures["time_correlated_errors"])
        text += (
            f": slow GNSS errors last for {slowest / MINUTE_S:.0f} minutes, and averaging does "
            "not remove them"
        )
        minute = [_relative_mm(figures, axis) for axis in range(3)]
        if math.hypot(*minute[:2]) < horizontal and minute[2] < down:
            at_worst = (
                f"{millimetres(math.hypot(*minute[:2]))} and {millimetres(minute[2])} at the worst"
            )
            text += f"; from one minute to the next positions agree to {at_worst}"
    yield ranked(
        "absolute position",
        horizontal / GOOD_HORIZONTAL_MM,
        text,
        PROCESS_RAW,
    )


def _relative_mm(figures: Figures, axis: int) -> float:
    """Sigma of the change in a minute of Gauss-Markov errors, 2 s^2 (1 - exp(-t / T)) each.

    It is a bound for what uses the IMU as well.
    """
    changes = [
        2.0 * error["sigma_m"][axis] ** 2 * -math.expm1(-MINUTE_S / error["time_s"])
        for error in figures["time_correlated_errors"]
    ]
    return 1e3 * math.sqrt(sum(changes))


def heights(figures: Figures) -> Iterator[Finding]:
    """Yield heights that are much less accurate than the horizontal."""
    north, east, down = figures["trajectory"]["position_mm"]["median"]
    ratio = down / max(north, east)
    if ratio < HEIGHT_RATIO or figures["standing"]:
        return
    sigma = figures["innovations"]["median_sigma_mm"]
    of_fixes = sigma is not None and sigma[2] > SHARE_OF_FIXES * ratio * max(sigma[:2])
    text = (
        f"heights are known to {millimetres(down)}, {ratio:.1f} times as uncertain as east and"
        f" north ({millimetres(max(north, east))})"
    )
    why, help_ = "the lever arm or the IMU weakens them", "look at the antenna's lever arm down"
    if of_fixes:
        why, help_ = (
            "the GNSS heights are that much weaker, all satellites being above",
            "use one or two height control points",
        )
    yield ranked("heights", ratio / HEIGHT_RATIO, f"{text}, because {why}", help_)


def by_stamps(figures: Figures, quantity: str) -> bool:
    """Tell whether the exposures' stamps explain most of the images' sigma of "position" or
    "attitude", which then is no matter of fixes and IMU.
    """
    stamps = (figures["exposures"] or {}).get("stamps") or {}
    return float(stamps.get(f"{quantity}_share", 0.0)) > SHARE_OF_STAMPS


def overall_attitude(figures: Figures) -> Iterator[Finding]:
    """Yield heading and tilt of the whole flight against what a good flight shows."""
    if figures["standing"]:
        return
    if by_stamps(figures, "attitude"):
        return
    median = (figures["exposures"] or figures["trajectory"])["attitude_deg"]["median"]
    if median[2] > GOOD_HEADING_DEG:
        times = (
            f"{median[2] / tilt(median):.1f} times the sigma of tilt"
            if tilt(median) > 0.0
            else "tilt being known"
        )
        text = (
            f"heading is known to {degrees(median[2])} in the median of the images, {times},"
            " because with this IMU only changes of horizontal velocity show it"
        )
        help_ = (
            "make sharper and more frequent turns, or use a better gyro, or two antennas with their"
            " heading in [[measurement]]"
        )
        if tried_deg := figures.get("heading_with_antennas_deg"):
            help_ += f" (antennas 1 m apart would give {degrees(tried_deg)} in this flight)"
        if sigmas_deg := figures.get("heading_with_sensors_deg"):
            by_gain = sorted(sigmas_deg, key=lambda name: sigmas_deg[name])
            sigmas = ", ".join(f"{name} {degrees(sigmas_deg[name])}" for name in by_gain)
            help_ += f"; other sensors would leave: {sigmas}"
        yield ranked("heading", median[2] / GOOD_HEADING_DEG, text, help_)
    if tilt(median) > GOOD_TILT_DEG:
        same, accel = 1e3 * math.radians(tilt(median)), max(figures["biases"]["accel_sigma_mg"][:2])
        text = (
            f"tilt is known to {degrees(tilt(median))} in the median, as much as a level"
            f" accelerometer's bias of {same:.2g} mg tilts the images"
        )
        text += f"; these biases are known to {accel:.2g} mg at the end"
        yield ranked(
            "tilt",
            tilt(median) / GOOD_TILT_DEG,
            text,
            "turn between all lines, or use better fixes or a better IMU",
        )


def boresight(figures: Figures) -> Iterator[Finding]:
    """Yield a large bore-sight that turns the heading of the images by more than its sigma.

    Nothing in a flight shows whether its signs are right; it is one number that a person can check.
    One that a calibration found has no signs to be mistaken, and one that is accepted was checked;
    of one of ordinary size `hidden` says what an error of it does.
    """
    heading_deg = figures["boresight_heading_deg"]
    if heading_deg is None or figures["exposures"] is None or known_boresight(figures["flight"]):
        return
    sigma = figures["exposures"]["attitude_deg"]["median"][2]
    if abs(heading_deg) <= max(sigma, LARGE_TURN_DEG):
        return
    text = (
        f"the bore-sight turns the heading of the images by {heading_deg:+.2f} deg ="
        f" {abs(heading_deg) / sigma:.1f} sigma; with the wrong signs all images are turned by"
        " twice that, and no data of this flight can reveal it"
    )
    yield ranked(
        BORESIGHT,
        abs(heading_deg) / LARGE_TURN_DEG,
        text,
        "check the signs of mounting.boresight, or calibrate it on control points; accept = "
        f'["{BORESIGHT}"] in the flight file confirms the signs',
    )


def gyro_bias(figures: Figures) -> Iterator[Finding]:
    """Yield gyro biases that the flight left undetermined."""
    sigma = figures["biases"]["gyro_sigma_deg_h"]
    worst = max(range(3), key=lambda k: sigma[k])
    if sigma[worst] < GOOD_GYRO_DEG_H:
        return
    of_minute = degrees(sigma[worst] * MINUTE_S / 3600.0)
    text = (
        f"the gyro bias {figures['biases']['axes'][worst]} is known only to {sigma[worst]:.0f} "
        f"deg/h at the end: where GNSS is missing, the images turn by {of_minute} a minute"
    )
    yield ranked(
        "gyro bias",
        sigma[worst] / GOOD_GYRO_DEG_H,
        text,
        "record a minute at rest before or after the flight, or fly longer",
    )


def arm_states(figures: Figures) -> dict[str, Figures]:
    """Return the states of the lever arm's error by axis."""
    named = {state["name"]: state for state in figures["states"]}
    return {state.axis: named[str(state)] for state in OF_LEVER_ARM if str(state) in named}


def lever_arm(figures: Figures) -> Iterator[Finding]:
    """Yield a lever arm that was estimated far from what the mounting states.

    The flight measures only the vector from IMU to antenna: which of both places is wrong, it
    cannot determine, and the images move with that of the IMU. Who states a sigma that holds
    the departure says that it is the antenna's.
    """
    arm = arm_states(figures)
    if (
        figures["exposures"] is None
        or figures["standing"]
        or not arm
        or "mounting" not in figures["flight"]
    ):
        return
    mounting, options = figures["flight"]["mounting"], figures["flight"]["filter"]
    adopted_sigma = 0.0
    if options["lever_arm"] and options["lever_arm_sigma_m"] != USUAL_ARM_SIGMA_M:
        adopted_sigma = options["lever_arm_sigma_m"]
    beyond = [
        abs(arm[of.axis]["value"]) / math.hypot(arm[of.axis]["sigma"], max(stated, adopted_sigma))
        for of, stated in zip(
            OF_LEVER_ARM, antenna_sigmas(mounting["antenna_sigma_m"]), strict=True
        )
        if of.axis in arm and abs(arm[of.axis]["value"]) > NEGLIGIBLE_ARM_M
    ]
    if not beyond or max(beyond) <= SIGNIFICANT:
        return
    value = [arm[state.axis]["value"] if state.axis in arm else 0.0 for state in OF_LEVER_ARM]
    difference = _in_camera(mounting, value)
    antenna = _millimetre_list(mounting["antenna_m"], difference, 1.0)
    imu = _millimetre_list(mounting["imu_m"], difference, -1.0)
    text = (
        f"{EITHER_WRONG}: the lever arm from the IMU to the antenna came out"
        f" {math.hypot(*value):.3f} m = {max(beyond):.0f} sigma from what the mounting states, and"
        " the flight cannot determine whether imu_m or antenna_m is wrong; if it is imu_m, all"
        " images are off by as much"
    )
    help_ = (
        f"measure both, and set mounting.imu_m = {imu} or mounting.antenna_m = {antenna}, or state"
        " with mounting.antenna_sigma_m that the antenna's place is known no better"
    )
    yield ranked("lever arm", max(beyond) / SIGNIFICANT + 1.0, text, help_)


def measured_arm(figures: Figures) -> Iterator[Finding]:
    """Yield a lever arm that is stated, and estimated as if it were not, where images suffer.

    `insgnss inspect` drafts its estimation, as it knows no lever arm; who measures it later may
    leave that in the flight file.
    """
    arm = arm_states(figures)
    if figures["exposures"] is None or not arm or "mounting" not in figures["flight"]:
        return
    mounting, options = figures["flight"]["mounting"], figures["flight"]["filter"]
    length_m = math.dist(mounting["antenna_m"], mounting["imu_m"])
    remaining_mm = 1e3 * max(state["sigma"] for state in arm.values())
    of_images_mm = max(figures["exposures"]["position_mm"]["median"])
    if options["lever_arm"] and length_m and remaining_mm > SHARE_OF_ARM * of_images_mm:
        text = (
            f"the mounting states a lever arm of {length_m:.2f} m, but filter.lever_arm estimates"
            f" its error from {options['lever_arm_sigma_m']:g} m on: {millimetres(remaining_mm)}"
            f" remain, a large part of the {millimetres(of_images_mm)} of the images"
        )
        help_ = (
            "if the lever arm was measured, delete filter.lever_arm and filter.lever_arm_sigma_m;"
            " mounting.antenna_sigma_m states how well (5 mm where it is left out)"
        )
        yield ranked("estimated lever arm", REMARK, text, help_)


def _millimetre_list(position: Sequence[float], difference: Sequence[float], sign: float) -> str:
    """Return a position moved by `difference`, to the mm, as a flight file has it."""
    return (
        f"[{', '.join(f'{x + sign * d:.3f}' for x, d in zip(position, difference, strict=True))}]"
    )


def _in_camera(mounting: Figures, vector: Sequence[float]) -> list[float]:
    """Turn a vector in the body's axes into those of the camera of a mounting."""
    for matrix in (mounting["boresight"], mounting["camera_from_body"]):
        vector = [sum(c * x for c, x in zip(row, vector, strict=True)) for row in matrix]
    return list(vector)


def states(figures: Figures) -> Iterator[Finding]:
    """Yield what became of the constants that the flight was to estimate.

    Those that it does not determine come first, then the values of the others; of those that the
    flight file does not ask for the check that adopted them has the values.
    """
    typical = max(figures["trajectory"]["position_mm"]["median"])
    unobserved, estimated, of_antenna = [], [], False
    of_arm = {str(state) for state in OF_LEVER_ARM}
    for state in figures["states"]:
        factor, unit = state["per_unit"], state["unit"]
        if not state["observed"] and state["moves_m"] is None:
            unobserved.append(state["name"])
        elif not state["observed"]:
            text = (
                f"the flight does not determine the {state['name']}: sigma"
                f" {state['sigma'] * factor:.2g} {unit} after the flight,"
                f" {state['prior'] * factor:.2g} {unit} before it, which moves positions by"
                f" {millimetres(1e3 * state['moves_m'])}"
            )
            help_ = (
                "fly changes of speed"
                if unit in ("ms", "ppm")
                else "measure it, or turn on the spot and fly figures of eight"
            )
            rank = max(1.0, 1e3 * state["moves_m"] / typical) if state["requested"] else REMARK
            yield ranked("constants", rank, text, help_)
        elif state["requested"] and abs(state["value"]) > SIGNIFICANT * state["sigma"]:
            of_antenna = of_antenna or state["name"] in of_arm
            estimated.append(
                f"{state['name']} {state['value'] * factor:+.3g} +- {state['sigma'] * factor:.2g}"
                f" {unit}"
            )
    if estimated:
        yield ranked(
            "constants",
            REMARK,
            "the flight file's values were corrected from the flight by"
            f" {some(estimated, MOST_STATES)}",
            "the flight measures only the vector from IMU to antenna: if imu_m is wrong instead,"
            " the images are off by as much; measure both"
            if of_antenna and not any(lever_arm(figures))
            else "",
        )
    if unobserved:
        yield ranked(
            "constants",
            REMARK,
            f"the flight cannot determine {some(unobserved, MOST_STATES)}; no image suffers from"
            " it",
            "leave them out of [filter]",
        )
