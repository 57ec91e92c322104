"""Times without fixes, stationary periods, segments solved by themselves, and their images."""

from typing import Any

import numpy as np

from ..records import Array, Diagnostics, ExteriorOrientation
from .statistics import without_fix

OUTAGE_MATTERS = 5.0  # times the median interval of the fixes
SHORT_OUTAGE_S = 0.2  # an interval below which the same number of missing fixes does not matter
MOST_OUTAGES = 100  # outages in report.json, the longest (chosen)


def segments(run: Diagnostics) -> Array:
    """Return the first and last instant, (k, 2) s, of each segment that was solved by itself.

    Without any given, all is one segment.
    """
    return np.array(run.segments or [(run.time[0], run.time[-1])], dtype=np.float64)


def stationary_periods(run: Diagnostics) -> Array:
    """Return the stationary periods (k, 2) s within the flight, by stationarity detection."""
    if run.stationary is None:
        return np.zeros((0, 2))
    within = run.stationary[
        (run.stationary[:, 1] > run.time[0]) & (run.stationary[:, 0] < run.time[-1])
    ]
    return np.clip(within, run.time[0], run.time[-1])


def median_interval(run: Diagnostics) -> float | None:
    """Usual interval of the fixes, s."""
    return float(np.median(np.diff(run.fix_time))) if run.fix_time.size > 1 else None


def outages(run: Diagnostics) -> Array:
    """Return begin and length, (k, 2) s, of the times without a used fix, in order.

    Only times that are long against the interval of the fixes count.
    """
    interval = median_interval(run)
    if interval is None or not run.used.any():
        return np.zeros((0, 2))
    intervals = without_fix(segments(run), run.fix_time, run.used)
    return intervals[intervals[:, 1] > OUTAGE_MATTERS * max(interval, SHORT_OUTAGE_S)]


def longest_outage(run: Diagnostics) -> dict[str, Any]:
    """Return the longest time without a used fix.

    With it come the largest smoothed horizontal and vertical sigma within it.
    """
    intervals = without_fix(segments(run), run.fix_time, run.used)
    begin, length = intervals[int(np.argmax(intervals[:, 1]))]
    return _within(run, float(begin), float(length)) | {"median_interval_s": median_interval(run)}


def outage_figures(run: Diagnostics, eo: ExteriorOrientation | None) -> list[dict[str, Any]]:
    """Return the figures of the longest outages, in the order of time.

    They hold the sigmas, the fixes that were rejected, and the images within each.
    """
    longest = outages(run)
    longest = longest[np.sort(np.argsort(-longest[:, 1], kind="stable")[:MOST_OUTAGES])]
    return [
        _within(run, float(begin), float(length))
        | _contents(run, eo, float(begin), float(begin + length))
        for begin, length in longest
    ]


def _within(run: Diagnostics, begin: float, length: float) -> dict[str, Any]:
    """Return begin, length and largest sigmas (mm) of the trajectory in a time without fixes."""
    first_row, last_row = np.searchsorted(run.time, (begin, begin + length), side="right")
    sigma = run.smoothed_sigma[max(first_row - 1, 0) : last_row + 1]
    horizontal = np.hypot(sigma[:, 0], sigma[:, 1])
    return {
        "time_s": begin,
        "length_s": length,
        "horizontal_mm": 1e3 * float(horizontal.max()),
        "down_mm": 1e3 * float(sigma[:, 2].max()),
    }


def _contents(
    run: Diagnostics, eo: ExteriorOrientation | None, begin: float, end: float
) -> dict[str, Any]:
    """Return the rejected fixes and the images between two times (s)."""
    inside = (run.fix_time > begin) & (run.fix_time < end)
    first_image, next_image = (0, 0) if eo is None else np.searchsorted(eo.time, (begin, end))
    named = eo is not None and next_image > first_image
    return {
        "rejected": int((inside & ~run.used).sum()),
        "images": int(next_image - first_image),
        "first_image": eo.images[first_image] if eo is not None and named else None,
        "last_image": eo.images[next_image - 1] if eo is not None and named else None,
    }
