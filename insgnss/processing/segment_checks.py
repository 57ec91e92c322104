"""The checks of the solved segments: fixes against the solution, the vehicle's motion, the heights
of a barometer, and the images that they leave out.
"""

from collections.abc import Sequence

import numpy as np

from ..calibrate.residuals import worst_piece
from ..config.flight_file import Flight
from ..navigation.codes import BAROMETER, NOT_MEASURED, REJECTED, VELOCITY_CONSTRAINT
from ..records import Check
from ..report.rules.wording import AXES, millimetres
from ..report.statistics import residual_limit
from .recording import Recording
from .segment import Segment

MOST_REJECTED = 0.5
"""Share of rejected measurements of the motion or of a barometer that contradicts what is said."""

MOST_NAMED = 5
"""Images that a check names."""


def check_residuals(flight: Flight, segments: Sequence[Segment]) -> list[Check]:
    """Check the fixes against the smoothed solution, minute by minute.

    Parameters
    ----------
    flight : Flight
        The flight file.
    segments : sequence of Segment
        The solved segments.

    Returns
    -------
    list of Check
        The check "fixes minus solution", a note where the mean of a minute is beyond what the
        sigmas of solution and fixes allow it; nothing where no fix was used, or where the fixes are
        a given place.
    """
    pieces = [piece for segment in segments for piece in segment.residuals]
    if flight.gnss.stationary is not None or not pieces:
        return []
    limit = residual_limit(3 * len(pieces))
    worst, axis, sigmas = worst_piece(pieces)
    bad = sigmas > limit
    return [
        Check(
            "fixes minus solution",
            f"mean of {worst.begin_s:.1f} to {worst.end_s:.1f} s"
            f" {millimetres(1e3 * worst.mean_m[axis])} {AXES[axis]}, {sigmas:.1f} sigma",
            f"at most {limit:.1f} sigma in each of {len(pieces)} pieces",
            "note" if bad else "ok",
            "the solution leaves its fixes there: do not rely on positions or sigmas"
            if bad
            else "",
        )
    ]


def check_motion(flight: Flight, segments: Sequence[Segment]) -> list[Check]:
    """Check whether the vehicle moves as it is said to.

    Parameters
    ----------
    flight : Flight
        The flight file.
    segments : sequence of Segment
        The solved segments.

    Returns
    -------
    list of Check
        The check "motion" where anything is measured of the motion itself: most of it must pass its
        test.
    """
    offered, rejected = offered_and_rejected(segments, VELOCITY_CONSTRAINT)
    if offered == 0:
        return []
    bad = rejected > MOST_REJECTED * offered
    key = (
        "filter.non_holonomic = false"
        if flight.filter.non_holonomic
        else 'filter.zero_velocity = "off"'
    )
    return [
        Check(
            "motion",
            f"{rejected} of {offered} zero-velocity updates or non-holonomic constraints rejected",
            "most of them used",
            "contradiction" if bad else "ok",
            f"it does not move so: {key}" if bad else "",
        )
    ]


def check_barometer(segments: Sequence[Segment]) -> list[Check]:
    """Check whether the heights of a barometer follow the flight.

    Parameters
    ----------
    segments : sequence of Segment
        The solved segments.

    Returns
    -------
    list of Check
        The check "barometer" where there is one: most of its heights must pass their test.
    """
    offered, rejected = offered_and_rejected(segments, BAROMETER)
    if offered == 0:
        return []
    bad = rejected > MOST_REJECTED * offered
    return [
        Check(
            "barometer",
            f"{rejected} of {offered} heights rejected",
            "most of them used",
            "contradiction" if bad else "ok",
            "its heights do not follow the flight: check barometer.columns, time_offset_s (UTC is"
            " 18 s behind GPS time) and sigma_m, or leave out [barometer]"
            if bad
            else "",
        )
    ]


def offered_and_rejected(segments: Sequence[Segment], kind: int) -> tuple[int, int]:
    """Return how many measurements of a kind of `navigation.codes` there were, and were rejected.

    Parameters
    ----------
    segments : sequence of Segment
        The solved segments.
    kind : int
        The kind.

    Returns
    -------
    tuple of int
        All of them, and the rejected ones.
    """
    verdict = np.concatenate([segment.solution.verdict[:, kind] for segment in segments])
    return int((verdict != NOT_MEASURED).sum()), int((verdict == REJECTED).sum())


def check_images(recording: Recording, segments: Sequence[Segment]) -> list[Check]:
    """Note the exposures that have no orientation.

    Parameters
    ----------
    recording : Recording
        The recording.
    segments : sequence of Segment
        The solved segments.

    Returns
    -------
    list of Check
        The note "images" where there are such.
    """
    if recording.events is None:
        return []
    images = recording.events.images
    oriented = np.concatenate([segment.at_event for segment in segments])
    missing = np.setdiff1d(np.arange(len(images)), oriented)
    if not missing.size:
        return []
    names = ", ".join(images[k] for k in missing[:MOST_NAMED])
    names += ", ..." if missing.size > MOST_NAMED else ""
    return [
        Check(
            "images",
            f"{missing.size} of {len(images)} have no orientation: {names}",
            "all images within the segments",
            "note",
            "they lie in a gap, before the first fix or in a segment left out",
        )
    ]
