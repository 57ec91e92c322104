"""The fixes of each flight line: used and rejected, quality, satellites, PDOP, mean innovations."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..records import Diagnostics, ExteriorOrientation
from .charts.gnss import VALIDATED_CODES
from .flightlines import flight_lines

FLOAT_CODES = (2, 3, 4)  # of the classes of fixes (`charts.gnss.NAMES`)


def fixes_of_lines(
    run: Diagnostics, eo: ExteriorOrientation | None, series: Mapping[str, Any] | None
) -> list[dict[str, Any]]:
    """Return one row a line, numbered as `flightlines.line_figures` does.

    Parameters
    ----------
    series : what the source of the fixes says of each epoch (`charts.gnss`); shares, satellites and
        PDOP are None where it does not say them.
    """
    rows = []
    for number, line in enumerate(flight_lines(run, eo), 1):
        start, end = run.time[line.first], run.time[line.last]
        of_line = (run.fix_time >= start) & (run.fix_time <= end)
        used = of_line & run.used
        innovation = run.innovation[used]
        innovation = innovation[np.isfinite(innovation).all(axis=1)]
        sigma = run.innovation_sigma[used]
        rows.append(
            {
                "line": number,
                "fixes": int(of_line.sum()),
                "used": int(used.sum()),
                "rejected": int((of_line & ~run.used).sum()),
                "innovation_mm": 1e3 * innovation.mean(axis=0) if len(innovation) else None,
                "innovation_sigma_mm": 1e3 * np.median(sigma, axis=0) if len(sigma) else None,
                **_of_source(series, float(start), float(end)),
            }
        )
    return rows


def _of_source(series: Mapping[str, Any] | None, start: float, end: float) -> dict[str, Any]:
    """Return what the source says of its epochs from one instant to another."""
    out: dict[str, Any] = dict.fromkeys(
        ("fixed_share", "float_share", "satellites", "least_satellites", "pdop", "largest_pdop")
    )
    if not series:
        return out
    time = np.asarray(series["time"])
    rows = slice(*np.searchsorted(time, (start, np.nextafter(end, np.inf))))
    if rows.start == rows.stop:
        return out
    if "kind" in series:
        kind = np.asarray(series["kind"])[rows]
        out["fixed_share"] = float(np.isin(kind, VALIDATED_CODES).mean())
        out["float_share"] = float(np.isin(kind, FLOAT_CODES).mean())
    for name, least, extreme in (
        ("satellites", "least_satellites", np.min),
        ("pdop", "largest_pdop", np.max),
    ):
        values = np.asarray(series.get(name, ()), dtype=np.float64)
        values = values[rows][np.isfinite(values[rows])] if values.size else values
        if values.size:
            out[name], out[least] = float(np.median(values)), float(extreme(values))
    return out
