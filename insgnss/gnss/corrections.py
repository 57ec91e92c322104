"""What carrier phases add to the fixes of PPK, each with its line in the report: wet delay and
ionosphere taken off, velocities from phase (TDCP).

An epoch without velocity from phase gets that of its neighbours' positions, with their covariance
and `BETWEEN_MPS`.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..base.errors import DataError
from ..geodesy.frames import ecef_to_geodetic, geodetic_to_ecef, moved_geodetic, rotation_en
from ..geodesy.gpstime import WEEK_S
from ..navigation.prepare.fix_covariance.classes import SAME_EPOCH_S
from ..records import Array, Finding, GnssFixes, Question
from ..records.qualities import Quality
from .options import EngineOptions
from .phase.double_differences import FAR_M
from .phase.ionosphere import (
    LEAST_EPOCHS,
    LEAST_FLIGHT_S,
    LEAST_SHARE_REMOVED,
    engine_models_it,
    ionosphere_correction,
)
from .phase.troposphere import (
    Atmosphere,
    displacement_per_delay,
    standard_atmosphere,
    wet_delay_correction,
)
from .phase.velocity import at_stamps, time_differenced_velocity
from .rinex.navigation_message import Navigation
from .rinex.observation_record import Observations
from .satellites.satellite_geometry import Sky

# m/s, one sigma: a drone's velocity at a fix against its mean between the fixes before and after, 2
# s apart at 1 Hz
BETWEEN_MPS = 1.0
# share of the fixes with a velocity from phase below which a note asks for cycle slips: 0.9,
# because a flight with locked phases has all but the first and last
MOST_VELOCITIES = 0.9


def without_wet_delay(
    fixes: GnssFixes, sky: Sky, base_ecef: Array, air: Atmosphere | Mapping[str, float] | None
) -> tuple[GnssFixes, Finding]:
    """Return fixes with the correction of `troposphere`, its covariance added, and a line on it."""
    too_few_satellites = ~np.isfinite(displacement_per_delay(sky, fixes.time.size)[:, 0])
    quality = np.where(
        too_few_satellites,
        Quality.SINGLE,
        Quality.FIXED if fixes.quality is None else fixes.quality,
    )  # single: not corrected
    correction = wet_delay_correction(
        replace(fixes, quality=quality), base_ecef, sky, _at_base(air, base_ecef)
    )
    correction_down_mm = 1e3 * correction.correction_ned[:, 2]
    finding = (
        f"heights raised by {-correction_down_mm.max():.1f} to {-correction_down_mm.min():.1f} mm"
    )
    if np.isfinite(correction.height_per_metre):
        finding += f", {1e3 * correction.height_per_metre:+.3f} mm per metre above the base"
    finding += (
        f"; {too_few_satellites.sum()} epochs with too few satellites stay as they are"
        if too_few_satellites.any()
        else ""
    )
    source = "standard atmosphere" if air is None else "given atmosphere"
    ask = Question("GNSS wet delay", f"a correction from the {source}; the engine leaves it out")
    return _move_fixes(fixes, correction.correction_ned, correction.cov_ned), ask.ok(finding)


def without_ionosphere(
    fixes: GnssFixes,
    observed: tuple[Observations, Observations],
    navigation: Navigation,
    sky: Sky,
    base_ecef: Array,
    options: EngineOptions,
    air: Atmosphere | Mapping[str, float] | None,
) -> tuple[GnssFixes, Finding]:
    """Return fixes with the correction of `ionosphere`, its covariance added, and a line on it."""
    ask = Question(
        "GNSS ionosphere", "a correction from two frequencies, which the engine does not apply"
    )
    if engine_models_it(options):
        return fixes, ask.ok("left to the engine, which models it")
    correction = ionosphere_correction(
        *(fixes, *observed, navigation, base_ecef, sky),
        *(_at_base(air, base_ecef), options.frequencies),
    )
    if correction is None:
        reason = (
            f"not corrected: fewer than {LEAST_EPOCHS} epochs, or less than"
            f" {LEAST_FLIGHT_S / 60.0:.0f} minutes, determine the correction"
        )
        advice = (
            "errors of 1 to 2 mm per km of baseline may remain; the correction needs two"
            " frequencies of rover and base, and positions with fixed ambiguities within"
            f" {FAR_M / 1e3:.0f} km of the base"
        )
        return fixes, ask.note(reason, advice)
    zenith_m, *gradients = correction.ionosphere.value.mean(axis=0)
    north, east = gradients[0] + gradients[2], gradients[1] + gradients[3]
    moved_mm = 1e3 * correction.correction_ned[correction.correction_ned.any(axis=1)]
    median_ned = ", ".join(f"{x:+.1f}" for x in np.median(moved_mm, axis=0))
    finding = (
        f"{zenith_m:.1f} m in zenith, {1e6 * north:+.1f} mm/km to the north, {1e6 * east:+.1f} to"
        " the east: "
    )
    finding += f"{len(moved_mm)} positions moved by {median_ned} mm north, east, down in the median"
    if correction.gain < LEAST_SHARE_REMOVED:
        sigma = 1e3 * float(np.median(correction.cov_ned[:, 2, 2]) ** 0.5)
        finding += (
            "; heights are not corrected for the gradient, which would take away only"
            f" {100.0 * max(correction.gain, 0.0):.0f} % ({100.0 * LEAST_SHARE_REMOVED:.0f} % are"
            f" needed) of their variance: they are uncertain by {sigma:.1f} mm"
        )
    return _move_fixes(fixes, correction.correction_ned, correction.cov_ned), ask.ok(finding)


def _at_base(air: Atmosphere | Mapping[str, float] | None, base_ecef: Array) -> Atmosphere | None:
    """Return the air at the base (3,), m, ECEF; a mapping completes the standard atmosphere."""
    if isinstance(air, Mapping):
        return standard_atmosphere(float(ecef_to_geodetic(base_ecef)[2]), **air)
    return air


def _move_fixes(fixes: GnssFixes, ned: Array, cov: Array) -> GnssFixes:
    """Add a correction (n, 3), m NED, and its covariance (n, 3, 3), m^2, to the fixes."""
    lat, lon, height = moved_geodetic(fixes.lat, fixes.lon, fixes.height, ned)
    return replace(fixes, lat=lat, lon=lon, height=height, cov_ned=fixes.cov_ned + cov)


def with_velocity(
    fixes: GnssFixes, rover: Observations, navigation: Navigation
) -> tuple[GnssFixes, Finding]:
    """Return fixes with velocities from phase where there are some, else from positions."""
    velocity, cov = _from_positions(fixes)
    try:
        intervals = time_differenced_velocity(rover, navigation, fixes)
        weeks = 0.0 if fixes.gps_week is None else (fixes.gps_week - intervals.gps_week) * WEEK_S
        phase, phase_cov = at_stamps(intervals, fixes.time + weeks)
        from_phase = np.isfinite(phase).all(axis=1)
        if not from_phase.any():
            raise DataError(
                f"{rover.header.path}: no two neighbouring intervals have a velocity from phase"
            )
    except DataError as error:
        advice = (
            "velocities are computed from the positions instead; check the loss-of-lock flags and"
            " the navigation files"
        )
        check = Question("GNSS velocity", "velocities").note(str(error), advice)
        return replace(fixes, velocity_ned=velocity, velocity_cov_ned=cov), check
    velocity[from_phase] = phase[from_phase]
    cov[from_phase] = phase_cov[from_phase]
    sigma = 1e3 * np.sqrt(np.median(np.diagonal(cov[from_phase], axis1=1, axis2=2), axis=0))
    finding = (
        f"{from_phase.sum()} of {from_phase.size} epochs from phase, standard deviations"
        f" {', '.join(f'{s:.0f}' for s in sigma)} mm/s"
    )
    ask = Question("GNSS velocity", f"{100 * MOST_VELOCITIES:.0f} % at least")
    advice = (
        "the other epochs have velocities computed from positions, because of cycle slips or few"
        " satellites"
    )
    check = ask.note(finding, advice, when=from_phase.mean() < MOST_VELOCITIES)
    return replace(fixes, velocity_ned=velocity, velocity_cov_ned=cov), check


def _from_positions(fixes: GnssFixes) -> tuple[Array, Array]:
    """Return velocities (n, 3), m/s, and covariances (n, 3, 3) from each fix's neighbours."""
    n = fixes.time.size
    earlier = np.maximum(np.arange(n) - 1, 0)
    later = np.minimum(np.arange(n) + 1, n - 1)
    interval = np.maximum(fixes.time[later] - fixes.time[earlier], SAME_EPOCH_S)
    position = geodetic_to_ecef(fixes.lat, fixes.lon, fixes.height)
    moved = np.einsum(
        "nji,nj->ni", rotation_en(fixes.lat, fixes.lon), position[later] - position[earlier]
    )
    cov = (fixes.cov_ned[later] + fixes.cov_ned[earlier]) / interval[:, None, None] ** 2
    cov += BETWEEN_MPS**2 * np.eye(3)
    return moved / interval[:, None], cov
