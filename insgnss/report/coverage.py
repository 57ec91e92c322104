"""Times without fixes, stationary periods, segments solved by themselves, and their images."""

from typing import Any

import numpy as np

from ..records import Array, Diagnostics, ExteriorOrientation
from .statistics import without_fix

OUTAGE_MATTERS = 5.0  # times the median interval of the fixes
SHORT_OUTAGE_S = 0.2  # an interval below which the same number of missing fixes does not matter
MOST_OUTAGES = 100  # outages in report.json, the longest (chosen)


def segments(d: Diagnostics) -> Array:
    """Return the first and last instant, (k, 2) s, of each segment that was solved by itself.

    Without any given, all is one segment.
    """
    return np.array(d.segments or [(d.time[0], d.time[-1])], dtype=np.float64)


def stationary_periods(d: Diagnostics) -> Array:
    """Return the stationary periods (k, 2) s within the flight, by stationarity detection."""
    if d.stationary is None:
        return np.zeros((0, 2))
    within = d.stationary[(d.stationary[:, 1] > d.time[0]) & (d.stationary[:, 0] < d.time[-1])]
    return np.clip(within, d.time[0], d.time[-1])


def median_interval(d: Diagnostics) -> float | None:
    """Usual interval of the fixes, s."""
    return float(np.median(np.diff(d.fix_time))) if d.fix_time.size > 1 else None


def outages(d: Diagnostics) -> Array:
    """Return begin and length, (k, 2) s, of the times without a used fix, in order.

    Only times that are long against the interval of the fixes count.
    """
    interval = median_interval(d)
    if interval is None or not d.used.any():
        return np.zeros((0, 2))
    intervals = without_fix(segments(d), d.fix_time, d.used)
    return intervals[intervals[:, 1] > OUTAGE_MATTERS * max(interval, SHORT_OUTAGE_S)]


def longest_outage(d: Diagnostics) -> dict[str, Any]:
    """Return the longest time without a used fix.

    With it come the largest smoothed horizontal and vertical sigma within it.
    """
    intervals = without_fix(segments(d), d.fix_time, d.used)
    begin, length = intervals[int(np.argmax(intervals[:, 1]))]
    return _within(d, float(begin), float(length)) | {"median_interval_s": median_interval(d)}


def outage_figures(d: Diagnostics, eo: ExteriorOrientation | None) -> list[dict[str, Any]]:
    """Return the figures of the longest outages, in the order of time.

    They hold the sigmas, the fixes that were rejected, and the images within each.
    """
    longest = outages(d)
    longest = longest[np.sort(np.argsort(-longest[:, 1], kind="stable")[:MOST_OUTAGES])]
    return [
        _within(d, float(begin), float(length))
        | _contents(d, eo, float(begin), float(begin + length))
        for begin, length in longest
    ]


def _within(d: Diagnostics, begin: float, length: float) -> dict[str, Any]:
    first, last = np.searchsorted(d.time, (begin, begin + length), side="right")
    sigma = d.smoothed_sigma[max(first - 1, 0) : last + 1]
    horizontal = np.hypot(sigma[:, 0], sigma[:, 1])
    return {
        "time_s": begin,
        "length_s": length,
        "horizontal_mm": 1e3 * float(horizontal.max()),
        "down_mm": 1e3 * float(sigma[:, 2].max()),
    }


def _contents(
    d: Diagnostics, eo: ExteriorOrientation | None, begin: float, end: float
) -> dict[str, Any]:
    inside = (d.fix_time > begin) & (d.fix_time < end)
    first, after = (0, 0) if eo is None else np.searchsorted(eo.time, (begin, end))
    named = eo is not None and after > first
    return {
        "rejected": int((inside & ~d.used).sum()),
        "images": int(after - first),
        "first_image": eo.images[first] if eo is not None and named else None,
        "last_image": eo.images[after - 1] if eo is not None and named else None,
    }
