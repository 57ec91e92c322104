"""What the recognised data say of a file: units, axes and clock, and where they contradict it."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...geodesy.axes import DIRECTIONS
from ...navigation.prepare.gaps import nominal_interval
from ...navigation.recognise.recognition import EXCHANGED_ADVICE, Recognition
from ...records import Finding, ImuSamples, Question
from .sources import InputSource

SURE = 0.9  # confidence from which on a finding is a live key of the draft
SAME_FACTOR = 0.02  # of a factor
UPRIGHT = 0.85  # of |f|, along the axis that is vertical
UNIT_CHECKS = {"gyro": "gyro unit", "accel": "accelerometer unit"}


@dataclass(frozen=True)
class AxesFound:
    """Axes in words with the evidence.

    `sure` is set where at least the vertical is certain, so that they are better than the default.
    """

    directions: str
    why: str
    sure: bool


def in_si(imu: ImuSamples, recognition: Recognition) -> ImuSamples:
    """Return the samples as rates in rad/s and m/s^2 of specific force, by what was recognised."""
    rate = 1.0 / nominal_interval(imu.time) if recognition.quantity == "increments" else 1.0
    gyro, accel = (
        recognition.gyro_factor * rate,
        recognition.accel_factor * recognition.accel_sign * rate,
    )
    return replace(imu, gyro=imu.gyro * gyro, accel=imu.accel * accel, quantity="mean_rate")


def factor_of_numbers(recognition: Recognition, key: str) -> float:
    """Return what the numbers of a sensor, gyro or accel, were recognised to be times."""
    return recognition.gyro_factor if key == "gyro" else recognition.accel_factor


def unit_contradictions(source: InputSource, recognition: Recognition) -> Iterator[Finding]:
    """Check the units that the file gives against the data.

    A contradiction is a note where the draft can follow the data.
    """
    units = source.header_units
    for key, name in UNIT_CHECKS.items():
        finding, factor = recognition.finding(name), factor_of_numbers(recognition, key)
        stated = units is None or key in units
        if not stated or finding.confidence <= SURE or abs(factor - 1.0) < SAME_FACTOR:
            continue
        text = f"{factor:.4g} times what the file says: {finding.evidence}"
        if units is None:
            question = Question(f"unit of {key}", f"the {key} values in the unit of its format")
            advice = "the values are not in the unit of this format; convert the file"
            yield question.contradiction(text, advice)
        else:
            expected = f"the {key} values in the unit of {units[key]}, as its header says"
            advice = "the draft follows the data"
            yield Question(f"unit of {key}", expected).note(text, advice)


def in_counts(source: InputSource, recognition: Recognition) -> Iterator[Finding]:
    """Yield a contradiction for each sensor whose numbers are in no known unit.

    The flight file must give what one count is worth.
    """
    for key, name in UNIT_CHECKS.items():
        finding = recognition.finding(name)
        accel_counts = abs(recognition.accel_factor - 1.0) > SAME_FACTOR
        if finding.confidence or not (accel_counts if key == "accel" else recognition.gyro_counts):
            continue
        worth = f" (gravity makes it about {recognition.accel_factor:.4g})" * (key == "accel")
        question = Question(f"unit of {key}", "a known unit, or the value of one count")
        yield question.contradiction(
            finding.evidence,
            f"give the value of one count{worth} in imu.units {key} from the data sheet of the "
            "sensor, and whether samples are increments",
        )


def assumed_rate(source: InputSource) -> Iterator[Finding]:
    """Yield a contradiction where samples without a clock would meet fixes at an assumed rate."""
    if "rate_hz" in source.keys:
        yield Question("IMU rate", "a clock, or the rate of the sensor").contradiction(
            f"no column of time; {source.keys['rate_hz']:g} Hz assumed",
            "set imu.rate_hz to the sampling rate of the sensor, accurate to 1e-5, or name the "
            "time column in imu.columns",
        )


def strangers(recognition: Recognition) -> Iterator[Finding]:
    """Check that samples and fixes are of one recording, latitude and longitude in their order."""
    clock = recognition.finding("time offset")
    if recognition.exchanged:
        question = Question("GNSS position", "latitude and longitude in their order")
        evidence = recognition.finding("force sign").evidence
        yield question.contradiction(evidence, EXCHANGED_ADVICE)
    elif not clock.confidence and recognition.compared:
        yield Question("common motion", "one time offset that explains the motion").note(
            clock.evidence,
            "if the vehicle moved, check that IMU samples and fixes are of one recording, as no "
            "time offset is better than others",
        )


def in_units_of_file(source: InputSource, recognition: Recognition) -> Recognition:
    """Return the findings with the units of the file's header, where the data agree with it."""
    findings = {finding.name: finding for finding in recognition.findings}
    for key, name in UNIT_CHECKS.items():
        factor = factor_of_numbers(recognition, key)
        header_unit, finding = (source.header_units or {}).get(key), findings[name]
        if (
            header_unit is not None
            and finding.confidence > 0.0
            and abs(factor - 1.0) < SAME_FACTOR
            and header_unit != finding.found
        ):
            evidence = f"converted from {header_unit}, as the header says, {finding.evidence}"
            findings[name] = replace(finding, found=header_unit, evidence=evidence)
    return replace(recognition, findings=tuple(findings.values()))


def likely_axes(source: InputSource, imu: ImuSamples, recognition: Recognition | None) -> AxesFound:
    """Choose the axes as recognised, else as the format has them, else the vertical by gravity.

    With the vertical alone forward is chosen freely.

    Parameters
    ----------
    source : InputSource
    imu : ImuSamples
        In m/s^2 of specific force.
    recognition : Recognition or None

    Returns
    -------
    AxesFound
    """
    if recognition is not None and recognition.axes is not None:
        finding, vertical = recognition.finding("axes"), recognition.finding("vertical axis")
        unsure = (
            ""
            if finding.confidence > SURE
            else "; the vertical is certain, the forward axis only likely: check the mounting"
        )
        return AxesFound(recognition.axes, in_words(finding) + unsure, vertical.confidence > SURE)
    if source.axes:
        return AxesFound(source.axes, "by the convention of the format", True)
    up = np.median(imu.accel, axis=0)
    directions, axis = vertical_axes(up)
    steady = abs(float(up["xyz".index(axis)])) > UPRIGHT * float(
        np.median(np.linalg.norm(imu.accel, axis=1))
    )
    forward = "xyz"[directions.split().index("forward")]
    why = (
        f"gravity shows that the IMU's {axis} axis is vertical; the motion does not show the "
        f"forward axis, so {forward} is taken as forward (in mounting.camera_from_body, too)"
    )
    return AxesFound(directions, why, steady)


def vertical_axes(mean_force: np.ndarray) -> tuple[str, str]:
    """Choose axes by the specific force at rest (3,): the vertical is certain, forward is free.

    Returns
    -------
    tuple of str
        The axes in words, and the IMU axis that is vertical.
    """
    axis = int(np.argmax(np.abs(mean_force)))
    names = ["", "", ""]
    names[axis] = "up" if mean_force[axis] > 0.0 else "down"
    first, second = [k for k in range(3) if k != axis]
    names[first], names[second] = "forward", "right"
    C = np.column_stack([np.eye(3)[DIRECTIONS[word][0]] * DIRECTIONS[word][1] for word in names])
    if np.linalg.det(C) < 0.0:
        names[second] = "left"
    return " ".join(names), "xyz"[axis]


def in_words(finding: Any) -> str:
    """Return a finding with its confidence and evidence."""
    return (
        f"{finding.name}: {finding.found} (confidence {finding.confidence:.3f}): {finding.evidence}"
    )
