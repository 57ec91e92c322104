"""Fixes of two qualities that run beside each other must draw one path.

A receiver, or a logger, may give RTK rows between single-point ones that are seconds old, or of
another datum, and call them good to a centimetre. Rows of a quality are compared with the path of
the most frequent one, interpolated between its two neighbours: in the median their distance must be
explained by both standard deviations. Where it is not, the filter would follow whoever claims most;
`gnss.quality_sigma_m` says what the rows are worth.
"""

import numpy as np
from numpy.typing import NDArray

from ...base.findings.remedies import Step
from ...records import Array, Finding, GnssFixes, Question
from ...records.interpolation import columns_at
from ...records.qualities import Quality
from ..prepare.fix_path import between_fixes, north_east

QUALITY_CHECK = "GNSS quality"
# of a quality, with fixes of the other on both sides within `fix_path.BESIDE_S`
LEAST_FIXES_OF_QUALITY = 20
# standard deviations that rows of a quality are off in the median, horizontally or vertically: the
# draft of a flight file gives them larger ones from the first on, a run is stopped from the second
NOTED_SIGMAS, STOPPED = 3.0, 5.0


def classes_apart(gnss: GnssFixes) -> dict[Quality, tuple[str, list[float], float]]:
    """Find the qualities whose fixes lie off the path of the most frequent one.

    Returns
    -------
    dict
        By quality the finding in words, standard deviations north, east, down, m, which explain
        nine of ten distances, and how many of their own they are off.
    """
    if gnss.quality is None or gnss.time.size < 2 * LEAST_FIXES_OF_QUALITY:
        return {}
    codes, counts = np.unique(gnss.quality, return_counts=True)
    usual = int(codes[np.argmax(counts)])
    path = gnss.quality == usual
    *_, beside = between_fixes(gnss.time, gnss.time[path])
    position = np.column_stack([north_east(gnss), -gnss.height])
    variance = np.diagonal(gnss.cov_ned, axis1=1, axis2=2)
    apart = {}
    for code in (int(c) for c in codes if c != usual):
        rows = np.flatnonzero((gnss.quality == code) & beside)
        if rows.size < LEAST_FIXES_OF_QUALITY:
            continue
        off, expected = (
            _off(gnss.time, values, path, rows, sign)
            for values, sign in ((position, -1.0), (variance, 1.0))
        )
        ratio = max(_ratio(off[:, :2], expected[:, :2]), _ratio(off[:, 2:], expected[:, 2:]))
        if ratio > NOTED_SIGMAS:
            name, other = Quality(code).name.lower(), Quality(usual).name.lower()
            distance = float(np.median(np.linalg.norm(off, axis=1)))
            sigma = np.maximum(
                np.quantile(np.abs(off), 0.9, axis=0), np.sqrt(variance[rows].max(axis=0))
            )
            finding = (
                f"{rows.size} {name} fixes lie {distance:.1f} m off the path of the {other} ones"
                f" beside them, {ratio:.0f} sigmas"
            )
            apart[Quality(code)] = finding, [float(f"{s:.2g}") for s in sigma], ratio
    return apart


def check_classes(gnss: GnssFixes) -> list[Finding]:
    """Check that fixes of all qualities draw one path; nothing where they do."""
    apart = classes_apart(gnss)
    if not apart:
        return []
    floors = ", ".join(f"{q.name.lower()} = {sigma}" for q, (_, sigma, _) in apart.items())
    advice = Step(
        f"{{gnss.quality_sigma_m}} = {{{{ {floors} }}}} states how accurate these fixes are; or "
        "leave them out"
    )
    expected = f"one path, within {NOTED_SIGMAS:.0f} sigmas in the median"
    finding = "; ".join(text for text, _, _ in apart.values())
    stopped = max(ratio for _, _, ratio in apart.values()) > STOPPED
    return [Question(QUALITY_CHECK, expected).against(finding, advice, stopped)]


def _ratio(distance: Array, variance: Array) -> float:
    """Median distance (n, m), in standard deviations."""
    return float(np.median(np.sqrt(np.sum(distance**2, axis=1) / np.sum(variance, axis=1))))


def _off(
    time: Array, values: Array, path: NDArray[np.bool_], rows: NDArray[np.intp], sign: float
) -> Array:
    """`values` (n, 3) of the rows plus `sign` times those of the path there."""
    return np.asarray(values[rows] + sign * columns_at(time[rows], time[path], values[path]))
