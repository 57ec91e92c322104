"""The checks of a recording against its flight file, before anything is estimated.

A check takes the flight file and what was observed and gives its findings; it stands in
`OF_RECORDING`, and its names in `CHECKS` of `insgnss.records.verdicts`.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...io.exposures.pauses import EXPOSURE_CLOCK, check_even_intervals
from ...io.exposures.rig import CameraExposures
from ...io.formats.text.clock import CLOCK_STEP
from ...io.formats.text.units import unit_factor
from ...navigation.diagnosis.evidence import check_turn_on, without_turn_on
from ...navigation.noise_model.model import NoiseModel
from ...navigation.recognise.claims import with_set_clock, with_ticks
from ...navigation.recognise.plausibility import check_recording
from ...navigation.recognise.turns import check_events, exposure_ways
from ...records import Array, Finding, GnssFixes, ImuSamples, Question
from ..config.flight_file import Flight
from .checks import check_mounting_files, check_mountings, of_camera


class Observed(NamedTuple):
    """What a recording holds, on one clock: all exposures, those outside the flight as well, the
    noise model of the samples, and what was found when samples and fixes were prepared.
    """

    imu: ImuSamples
    C_b_imu: Array
    gnss: GnssFixes
    cameras: tuple[CameraExposures, ...]
    gps_week: int
    noise: NoiseModel
    of_preparation: tuple[Finding, ...] = ()


def check_plausibility(flight: Flight, observed: Observed) -> list[Finding]:
    """Check units, axes and clocks of samples, fixes and the first camera's exposures."""
    imu, C_b_imu, gnss, cameras, *_ = observed
    plane = flight.tangent_plane
    origin = None if plane is None else np.asarray(plane.origin)
    events, clock = (cameras[0].events, cameras[0].clock) if cameras else (None, "")
    findings = check_recording(imu, C_b_imu, gnss, events, origin, event_clock=clock)
    if flight.gnss.stationary is not None:
        return findings
    unit = (flight.imu.units or {}).get("time")
    if unit is not None:
        findings = with_ticks(findings, imu, gnss, unit_factor(unit, "time"))
    return with_set_clock(findings, imu, gnss)


def check_set_clock(flight: Flight, observed: Observed) -> list[Finding]:
    """Contradict exposures by a clock of the IMU or the receiver that was set on the way."""
    if flight.camera is None:
        return []
    stamping = {"imu": ("IMU", observed.imu.notes), "receiver": ("receiver", observed.gnss.notes)}
    whose, notes = stamping.get(flight.camera.clock, ("", ()))
    unmoved = (
        f"add the step of the {whose}'s clock to the exposure times before the clock was set, or "
        "let the other clock stamp exposures"
    )
    return [
        replace(check, verdict="contradiction", remedy=unmoved)
        for check in notes
        if check.name == CLOCK_STEP
    ]


def check_exposure_intervals(flight: Flight, observed: Observed) -> list[Finding]:
    """Ask whether the clock of a camera's exposures was set on the way, unless that is answered."""
    if EXPOSURE_CLOCK in flight.accept:
        return []
    checks = []
    for camera in observed.cameras:
        ways = exposure_ways(camera.events.time, observed.gnss)
        check = check_even_intervals(camera.events, *ways)
        if check.verdict == "note":
            checks.append(of_camera(check, camera.name) if observed.cameras[1:] else check)
    return checks


def check_further_cameras(flight: Flight, observed: Observed) -> list[Finding]:
    """Check the exposures of each further camera of a rig."""
    return [
        of_camera(check_events(camera.events, observed.gnss, camera.clock), camera.name)
        for camera in observed.cameras[1:]
    ]


def check_noise_model(flight: Flight, observed: Observed) -> list[Finding]:
    """Note a noise model without turn-on biases, or that does not fit its own recordings."""
    noise = observed.noise
    return [*([check_turn_on(noise)] if without_turn_on(noise) else []), *noise_misfit(noise)]


def noise_misfit(noise: NoiseModel) -> list[Finding]:
    """Repeat where a noise model does not fit the recordings that it was estimated from."""
    if not noise.misfit:
        return []
    more = len(noise.misfit) - 1
    finding = noise.misfit[0] + (f"; and {more} more, in its file" if more else "")
    advice = (
        "the sigmas of this flight are only as good as this noise model; tune again with a"
        " --model that fits (insgnss tune)"
    )
    return [
        Question(
            "noise model", "a noise model that fits the recordings from which it was estimated"
        ).note(finding, advice)
    ]


OF_RECORDING: tuple[Callable[[Flight, Observed], Sequence[Finding]], ...] = (
    check_plausibility,
    check_set_clock,
    check_exposure_intervals,
    check_further_cameras,
    lambda flight, observed: observed.of_preparation,
    lambda flight, observed: check_mountings(flight),
    check_noise_model,
    lambda flight, observed: check_mounting_files(
        flight, observed.gps_week, float(observed.gnss.time[0])
    ),
)
"""What is checked of a recording, in the order of the report."""
