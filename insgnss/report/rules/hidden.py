"""Errors that no data of a flight can reveal, and what each would do to its images.

They are listed once per report, and are no reason against the use of any image.
"""

import math
import statistics
from collections.abc import Iterator
from typing import Any

from ...base.findings import Finding
from ...base.units import STANDARD_GRAVITY
from ...records.cameras.mounting import antenna_sigmas
from .wording import Figures, degrees, millimetres, tilt

PER_M = 100.0  # distance to the ground, m, at which an error of attitude is given in mm as well
BORESIGHT_DEG = 0.1  # a bore-sight error whose effect is shown, deg: of an uncalibrated camera
# deflection of the vertical, arcsec: usual in hills; in high mountains it is three times as large
DEFLECTION_ARCSEC = 10.0
# a swing of the fixes of amplitude A and period P is an acceleration A (tau / P)^2; the innovations
# of simulated flights show one beyond this share of the sigma of the tilt times gravity: 0.3 m in
# two minutes with a NavChip, 0.1 m in one
SWING_S, SWING_NOTICED = 120.0, 0.5
UNDULATION_M = 107.0  # largest height of the geoid above or below the ellipsoid, m (EGM2008)
DATUMS_M = 0.8  # ITRF2020 against ETRS89 in Europe, m: 35 years of 2.4 cm since 1989
BORESIGHT = "bore-sight"  # topic, and check that `accept` of a flight file takes
BORESIGHT_KEY = "boresight"  # of [mounting] and of a mounting file
UNSEEN = "unseen constants"  # check that says how large an error of lever arm or stamps stays so


def hidden_errors(figures: Figures) -> list[Finding]:
    """Return the errors that the flight's data cannot reveal, each with its effect and remedy."""
    return [] if figures["standing"] else [*_position_notes(figures), *_image_notes(figures)]


def _position_notes(figures: Figures) -> Iterator[Finding]:
    """Yield the errors that shift the whole trajectory and that no flight can reveal."""
    moved = "the images" if figures["exposures"] else "the trajectory"
    yield _note(
        "base coordinates and datum",
        f"an error of the base station's coordinates shifts {moved} by the same vector; ITRF in the"
        f" place of ETRS89 is {DATUMS_M:g} m in Europe",
        "check coordinates, datum and epoch of the base, and one ground point",
    )
    undulation = (figures["flight"].get("gnss") or {}).get("undulation_m")
    undulation_text = "none" if undulation is None else f"{undulation:g} m"
    yield _note(
        "heights above the geoid",
        "heights above sea level that are taken for ellipsoidal ones shift the heights of"
        f" {moved} by the geoid undulation, up to {UNDULATION_M:.0f} m",
        "compare one height with a ground point; gnss.undulation_m states the undulation (now"
        f" {undulation_text})",
    )
    arm = antenna_sigmas(figures["flight"].get("mounting", {}).get("antenna_sigma_m"))
    time_sigma_s = (figures["flight"].get("gnss") or {}).get("time_sigma_s")
    stamps = "" if time_sigma_s is None else f", and for stamps off by {1e3 * time_sigma_s:g} ms"
    constants = [check["found"] for check in figures["checks"] if check["name"] == UNSEEN]
    effect = f"an error within the sigma of the lever arm shifts {moved} by as much"
    yield _note(
        "antenna phase centre and GNSS time stamps",
        f"{constants[0] if constants else effect}; the sigmas allow for an arm off by"
        f" {1e3 * arm[0]:g} mm, in height by {1e3 * arm[2]:g} mm{stamps}",
        "measure the lever arm to the phase centre that the GNSS engine uses;"
        " mounting.antenna_sigma_m and gnss.time_sigma_s state how well both are known",
    )
    tilted = math.radians(tilt(figures["trajectory"]["attitude_deg"]["median"]))
    swing_m = SWING_NOTICED * STANDARD_GRAVITY * tilted * (SWING_S / math.tau) ** 2
    yield _note(
        "slow errors of the GNSS positions",
        f"errors that change over minutes shift {moved} by as much: PPK over short baselines has 5"
        f" to 10 mm of them. In {SWING_S:g} s the IMU of this flight does not notice a swing of"
        f" about {millimetres(1e3 * swing_m)}",
        "compare with a second base or a few ground points; state such an error by gnss.gm_sigma "
        "and gnss.correlation_time_s",
    )
    deflection_deg = DEFLECTION_ARCSEC / 3600.0
    allowed = (figures["flight"].get("gnss") or {}).get("deflection_sigma_arcsec", 0.0)
    yield _note(
        "deflection of the vertical",
        f"a deflection of the vertical tilts {moved} by as much: {DEFLECTION_ARCSEC:.0f} arcsec, "
        f"usual in hills, are {_image_shift_text(deflection_deg)}; the sigmas allow for "
        f"{allowed:g} arcsec",
        "nothing to do if this is below the required accuracy; else state gnss.deflection_arcsec "
        "from a geoid model and its sigma, or adjust with ground control",
    )


def _image_notes(figures: Figures) -> Iterator[Finding]:
    """Yield the errors of bore-sight and events that no flight can reveal."""
    if figures["exposures"] is None:
        return
    if not known_boresight(figures["flight"]):
        heading_deg = figures["boresight_heading_deg"]
        remark = (
            f"; the stated bore-sight turns the heading by {heading_deg:+.2f} deg"
            if heading_deg
            else ""
        )
        if (figures["flight"].get("filter") or {}).get("misalignment"):
            remark += "; gyros rotated in their case do the same, even with filter.misalignment"
        yield _note(
            BORESIGHT,
            "a bore-sight error turns every image by as much: "
            f"{_image_shift_text(BORESIGHT_DEG)}{remark}",
            f'calibrate it on control points; accept = ["{BORESIGHT}"] confirms it',
        )
    spacing = [
        line["length_m"] / (line["images"] - 1) for line in figures["lines"] if line["images"] > 1
    ]
    line_spacing = f" ({statistics.median(spacing):.0f} m along the line)" if spacing else ""
    yield _note(
        "events shifted by one",
        "one missing event or image gives every later image the pose of its neighbour"
        + line_spacing,
        "compare the numbers of events and images, and the first and last image with the map",
    )


def _image_shift_text(angle_deg: float) -> str:
    """Return an angle, deg, with the shift on the ground that it causes."""
    moved = 1e3 * PER_M * math.radians(angle_deg)
    return f"{degrees(angle_deg)} or {millimetres(moved)} on the ground {PER_M:.0f} m away"


def known_boresight(flight: Figures) -> bool:
    """Tell whether a flight file took its bore-sight from a calibration, or accepts it."""
    sources: Any = flight.get("mounting_files") or ()
    calibrated = any(
        BORESIGHT_KEY in source["keys"] and source["made"]["boresight_cov"] is not None
        for source in sources
    )
    return calibrated or BORESIGHT in (flight.get("accept") or ())


def _note(name: str, effect: str, remedy: str) -> Finding:
    return Finding(name, effect, verdict="note", remedy=remedy)
