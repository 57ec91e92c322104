"""The figures of merit of a run, as the dict that report.json holds.

Everything is in the unit that its name says; what is not determined is None, never NaN. Lists of
three are in the order of the `axes` beside them. The limits in words come from `verdict`.

`line_fixes` sums up the fixes of each flight line.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.files import json_ready
from ..geodesy.rotation import rpy_from_rotation
from ..records import Array, Diagnostics, Estimate, ExteriorOrientation
from .charts.gnss import VALIDATED_CODES
from .coverage import longest_outage, outage_figures, segments, stationary_periods
from .flightlines import flight_lines, image_sigmas, line_figures
from .rules.hidden import hidden_errors
from .rules.needs import stated_need
from .rules.use import JudgedPlaces, use
from .rules.verdict import headline, limits, verdict
from .rules.wording import DEG_H_PER_RAD_S, MG_PER_M_S2, NED_NAMES, state_unit
from .statistics import (
    consistency,
    innovation_figures,
    normalised_rms,
    residual_limit,
    rms_bound,
    rms_floor,
)

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


Rows = NDArray[np.int64]

MOST_FIXES_LISTED = 200  # rejected fixes in report.json, the first (chosen)
ENU_LETTERS = ["E", "N", "U"]
NED = ["N", "E", "D"]
STATES = ("position", "velocity", "attitude")  # three axes each of what a filter navigates
FAR_WORSE = 3.0  # times the median sigma of the images: from there on the headline counts them


def run_summary(
    diagnostics: Diagnostics,
    eo: ExteriorOrientation | None,
    flight: Mapping[str, Any],
    inputs: Mapping[str, str],
    versions: Mapping[str, str],
    timings: Mapping[str, float],
    history: tuple[str, ...],
    *,
    imu_samples: int | None = None,
    epochs: int | None = None,
    series: Mapping[str, Any] | None = None,
    run: Mapping[str, Any] | None = None,
    gps_week: int | None = None,
    heading_with_antennas_deg: float | None = None,
    heading_with_sensors_deg: Mapping[str, float] | None = None,
    exposure_sigma_s: float | None = None,
) -> dict[str, Any]:
    """All figures of merit of a run, ready for JSON.

    Parameters
    ----------
    eo : of the images, None without a camera.
    flight : the resolved flight file.
    inputs : SHA-256 by path.
    versions : by package.
    timings : s by step.
    history : what was done, sentence by sentence.
    imu_samples, epochs : numbers of them, where known.
    series : what the source of the fixes says of each epoch, as `charts.gnss` takes it.
    run : when, where and by which command, as text by name.
    gps_week : of the times, for clock times of a flight without a camera; None: unknown.
    heading_with_antennas_deg : sigma of the images' headings, median, that two antennas would have
        left in this flight; None where it was not tried.
    heading_with_sensors_deg : likewise, by name, of those among other sensors that would help.
    exposure_sigma_s : standard deviation of the exposures' stamps, median; None: none that matters.
    """
    week = gps_week if eo is None else eo.gps_week
    figures = {"name": str(flight.get("name", ""))} | _judged(diagnostics, eo, week)
    if eo is not None and exposure_sigma_s is not None and figures["exposures"] is not None:
        figures["exposures"]["stamps"] = _stamps(eo, exposure_sigma_s)
    figures["counts"] = {"imu_samples": imu_samples, "epochs": epochs} | figures["counts"]
    figures["line_fixes"] = fixes_of_lines(diagnostics, eo, series)
    figures |= {
        "timings_s": timings,
        "history": history,
        "flight": flight,
        "versions": versions,
        "run": run or {},
        "heading_with_antennas_deg": heading_with_antennas_deg,
        "heading_with_sensors_deg": heading_with_sensors_deg or {},
        "inputs_sha256": inputs,
    }
    gnss = flight.get("gnss")
    figures["standing"] = isinstance(gnss, Mapping) and gnss.get("stationary") is not None
    figures = json_ready(figures)
    ranked = limits(figures)
    judged = use(figures, _places(diagnostics, eo), *stated_need(flight.get("output")))
    figures["use"] = json_ready(judged)
    figures["hidden_errors"] = [
        {"name": error.name, "effect": error.found, "help": error.advice}
        for error in hidden_errors(figures)
    ]
    first = {
        "headline": f"{figures['use']['sentence']}: {headline(figures)}",
        "verdict": verdict(ranked),
        "limits": [limit.limit for limit in ranked],
    }
    return first | figures


def _places(run: Diagnostics, eo: ExteriorOrientation | None) -> JudgedPlaces:
    """Return what is judged: the images, or without any the epochs of the trajectory."""
    if eo is not None and eo.images:
        position, psi = image_sigmas(eo)
        return JudgedPlaces(eo.time, position, np.degrees(psi), eo.images)
    of_enu = [1, 0, 2]
    sigma = run.smoothed_sigma
    return JudgedPlaces(run.time, sigma[:, :3][:, of_enu], np.degrees(sigma[:, 6:9][:, of_enu]))


def _judged(run: Diagnostics, eo: ExteriorOrientation | None, week: int | None) -> dict[str, Any]:
    """All that follows from the diagnostics and the images."""
    start, end = float(run.time[0]), float(run.time[-1])
    return {
        "span": {
            "gps_week": week,
            "start_tow_s": start,
            "end_tow_s": end,
            "duration_s": end - start,
        },
        "counts": _counts(run, eo),
        "exposures": None if eo is None or not eo.images else _exposures(run, eo),
        "boresight_heading_deg": None if eo is None else _heading_of(eo.boresight),
        "trajectory": _trajectory(run),
        "innovations": innovation_figures(run.innovation, run.innovation_sigma, run.used),
        "consistency": _consistency(run),
        "residuals": _residuals(run),
        "separation": _separation(run),
        "biases": _biases(run),
        "rejected": _rejected(run),
        "covariance_resets_s": [] if run.covariance_resets is None else run.covariance_resets,
        "longest_outage": longest_outage(run),
        "outages": outage_figures(run, eo),
        "lines": line_figures(run, eo),
        "neighbours": (
            None
            if eo is None or (pairs := _neighbour_rows(eo)) is None
            else _neighbours(eo, *pairs)
        ),
        "states": [_state(state) for state in run.states],
        "time_correlated_errors": [asdict(error) for error in run.time_correlated],
        "rests": stationary_periods(run),
        "segments": segments(run),
        "imu_gaps": [{"time_s": time, "length_s": length} for time, length in run.gaps],
        "checks": [check.as_dict() for check in run.checks],
    }


def _counts(run: Diagnostics, eo: ExteriorOrientation | None) -> dict[str, int]:
    counts = {
        "images": 0 if eo is None else len(eo.images),
        "passes": run.passes,
        "imu_gaps": len(run.gaps),
        "fixes": run.fix_time.size,
        "fixes_used": int(run.used.sum()),
        "fixes_rejected": int((~run.used).sum()),
        "fixes_withheld": 0 if run.withheld is None else int((run.withheld & ~run.used).sum()),
        "covariance_resets": 0 if run.covariance_resets is None else run.covariance_resets.size,
    }
    for name, nis, used in (
        ("velocities", run.velocity_nis, run.velocity_used),
        ("barometer_heights", run.barometer_nis, run.barometer_used),
    ):
        if nis is not None and used is not None:
            offered = np.isfinite(nis)
            counts[name] = int(offered.sum())
            counts[f"{name}_used"] = int((offered & used).sum())
            counts[f"{name}_rejected"] = int((offered & ~used).sum())
    return counts


def _min_median_max(x: Array) -> dict[str, Array]:
    """Return smallest, median and largest of each column."""
    return {"min": x.min(axis=0), "median": np.median(x, axis=0), "max": x.max(axis=0)}


def _exposures(run: Diagnostics, eo: ExteriorOrientation) -> dict[str, Any]:
    """Sigmas over the images: smallest, median, largest, first.

    The worst image of position and of attitude.
    """
    position, psi = image_sigmas(eo)
    figures: dict[str, Any] = {"axes": ENU_LETTERS, "count": len(eo.images)}
    if eo.rig is not None:
        count = np.bincount(eo.rig.number, minlength=len(eo.rig.names)).tolist()
        figures["cameras"] = dict(zip(eo.rig.names, count, strict=True))
    for name, sigmas in (("position_mm", 1e3 * position), ("attitude_deg", np.degrees(psi))):
        worst = int(np.argmax((sigmas**2).sum(axis=1)))
        at_worst = {"image": eo.images[worst], "time_s": eo.time[worst], "sigma": sigmas[worst]}
        figures[name] = _min_median_max(sigmas) | {"first": sigmas[0], "worst": at_worst}
    figures["first_image"] = eo.images[0]
    beyond = (position > FAR_WORSE * np.median(position, axis=0)).any(axis=1)
    figures["far_worse"] = {"count": int(beyond.sum()), "times": FAR_WORSE}
    figures["first_time_s"] = eo.time[0]
    heading_before = np.unwrap(run.rpy[run.time <= eo.time[0], 2])
    figures["heading_range_before_first_deg"] = (
        math.degrees(np.ptp(heading_before)) if heading_before.size else 0.0
    )
    return figures


def _stamps(eo: ExteriorOrientation, sigma_s: float) -> dict[str, float]:
    """Return the sigma of the exposures' stamps, the path flown in it, m, and its share of the
    variances of position and attitude; medians over the images.
    """
    figures = {"sigma_s": sigma_s}
    for name, rate, block in (
        ("position", eo.velocity_mps, slice(0, 3)),
        ("attitude", eo.rate_radps, slice(3, 6)),
    ):
        if rate is not None:
            variance = np.trace(eo.cov[:, block, block], axis1=1, axis2=2)
            moved = sigma_s * np.linalg.norm(rate, axis=1)
            figures[f"{name}_share"] = float(np.median(moved**2 / variance))
            if name == "position":
                figures["path_m"] = float(np.median(moved))
    return figures


def _heading_of(boresight: Array) -> float:
    """Return by how much, deg, a bore-sight turns the heading of a level body, clockwise.

    The camera realises the axes C_nb B' of a body whose attitude is C_nb.
    """
    return math.degrees(float(rpy_from_rotation(boresight.T)[2]))


def _trajectory(run: Diagnostics) -> dict[str, Any]:
    """Smoothed sigmas over the epochs of the diagnostics, and their gain on those of the filter."""
    with np.errstate(divide="ignore", invalid="ignore"):
        gain = np.median(run.filter_sigma, axis=0) / np.median(run.smoothed_sigma, axis=0)
    return {
        "axes": NED,
        "position_mm": _min_median_max(1e3 * run.smoothed_sigma[:, 0:3]),
        "velocity_mm_s": _min_median_max(1e3 * run.smoothed_sigma[:, 3:6]),
        "attitude_deg": _min_median_max(np.degrees(run.smoothed_sigma[:, 6:9])),
        "filter_over_smoothed": _by_state(gain),
    }


def _consistency(run: Diagnostics) -> dict[str, Any]:
    """Consistency of what is measured besides positions; without a barometer it has no entry."""
    out: dict[str, Any] = {"position": consistency(run.nis, run.used), "velocity": None}
    if run.velocity_nis is not None and run.velocity_used is not None:
        out["velocity"] = consistency(run.velocity_nis, run.velocity_used)
    if run.barometer_nis is not None and run.barometer_used is not None:
        out["barometer"] = consistency(run.barometer_nis, run.barometer_used, dof=1)
    return out


def _by_state(rows: Array) -> dict[str, Array]:
    """Return the nine rows by what they are of, three axes each."""
    return dict(zip(STATES, rows.reshape(3, 3, *rows.shape[1:]), strict=True))


def _separation(run: Diagnostics) -> dict[str, Any]:
    """Backward minus forward: root mean square, and the same over its sigma.

    It is 1 where both filters are honest.
    """
    difference, unit_sigma = run.separation, np.ones_like(run.separation)
    rms, ratio = (
        normalised_rms(difference, unit_sigma),
        normalised_rms(difference, run.separation_sigma),
    )
    bound = rms_bound(difference, run.separation_sigma)
    sigma_of = _by_state(run.separation_sigma.T)
    pooled = {
        state: rms_floor(values.T, sigma_of[state].T)
        for state, values in _by_state(difference.T).items()
    }
    return {
        "axes": NED,
        "epochs": int(np.isfinite(difference).any(axis=1).sum()),
        "rms": {
            "position_mm": 1e3 * rms[0:3],
            "velocity_mm_s": 1e3 * rms[3:6],
            "attitude_deg": np.degrees(rms[6:9]),
        },
        "normalised_rms": _by_state(ratio),
        "bound": _by_state(bound),
        "of_all_axes": {state: rms for state, (rms, _) in pooled.items()},
        "floor": {state: floor for state, (_, floor) in pooled.items()},
        "largest": _largest_separation(run),
    }


def _largest_separation(run: Diagnostics) -> dict[str, Any] | None:
    """Where and when forward and backward are the most sigmas apart; None where none is known."""
    ratio = np.abs(run.separation) / run.separation_sigma
    if not np.isfinite(ratio).any():
        return None
    k, column = np.unravel_index(int(np.nanargmax(ratio)), ratio.shape)
    return {
        "state": STATES[int(column) // 3],
        "axis": NED[int(column) % 3],
        "sigmas": float(ratio[k, column]),
        "time_s": float(run.separation_time[k]),
    }


def _residuals(run: Diagnostics) -> dict[str, Any] | None:
    """Fixes minus solution of each piece of time, the worst of them, and the limit of all."""
    if not run.residuals:
        return None
    mean, sigma = (
        np.array([getattr(r, key) for r in run.residuals]) for key in ("mean_m", "sigma_m")
    )
    ratio, limit = np.abs(mean) / sigma, residual_limit(mean.size)
    worst_piece, axis = (
        int(index) for index in np.unravel_index(int(np.argmax(ratio)), ratio.shape)
    )
    return {
        "axes": NED,
        "limit": limit,
        "beyond": int((ratio > limit).any(axis=1).sum()),
        "worst": {
            "begin_s": run.residuals[worst_piece].begin_s,
            "end_s": run.residuals[worst_piece].end_s,
            "axis": NED_NAMES[axis],
            "mean_mm": 1e3 * mean[worst_piece, axis],
            "sigma_mm": 1e3 * sigma[worst_piece, axis],
            "sigmas": ratio[worst_piece, axis],
        },
        "pieces": [
            {
                "begin_s": r.begin_s,
                "end_s": r.end_s,
                "fixes": r.fixes,
                "mean_mm": 1e3 * m,
                "sigma_mm": 1e3 * s,
            }
            for r, m, s in zip(run.residuals, mean, sigma, strict=True)
        ],
    }


def _biases(run: Diagnostics) -> dict[str, Any]:
    """Biases and their sigmas at the end of the flight, body axes."""
    bias, sigma = run.bias[-1], run.bias_sigma[-1]
    return {
        "axes": ["forward", "right", "down"],
        "gyro_deg_h": DEG_H_PER_RAD_S * bias[:3],
        "gyro_sigma_deg_h": DEG_H_PER_RAD_S * sigma[:3],
        "accel_mg": MG_PER_M_S2 * bias[3:],
        "accel_sigma_mg": MG_PER_M_S2 * sigma[3:],
    }


def _rejected(run: Diagnostics) -> dict[str, Any]:
    rows = np.flatnonzero(~run.used)
    listed = [
        {"time_s": float(run.fix_time[i]), "nis": float(run.nis[i])}
        for i in rows[:MOST_FIXES_LISTED]
    ]
    return {"count": rows.size, "nis_limit": float(run.nis_limit), "listed": listed}


def _neighbour_rows(eo: ExteriorOrientation) -> tuple[Rows, Rows, Array] | None:
    """Rows of neighbouring images, of a rig of one camera, and what they share; None without."""
    if eo.rig is None:
        rows = np.arange(len(eo))
        if eo.cross is None or rows.size < 2:
            return None
        return rows[:-1], rows[1:], eo.cross
    next_row = eo.rig.next_of_camera
    row = np.flatnonzero(next_row >= 0)
    if eo.rig.cross is None or not row.size:
        return None
    return row, next_row[row], eo.rig.cross[row]


def _neighbours(eo: ExteriorOrientation, first: Rows, second: Rows, cross: Array) -> dict[str, Any]:
    """Median sigma of the difference of neighbouring images (axes of the tangent plane).

    Its covariance is P_i + P_j - P_ij - P_ij'.
    """
    difference = eo.cov[first] + eo.cov[second] - cross - np.swapaxes(cross, -1, -2)
    sigma = np.median(np.sqrt(np.maximum(np.diagonal(difference, axis1=1, axis2=2), 0.0)), axis=0)
    return {
        "axes": ENU_LETTERS,
        "interval_s": float(np.median(eo.time[second] - eo.time[first])),
        "position_mm": 1e3 * sigma[:3],
        "attitude_deg": np.degrees(sigma[3:]),
    }


def _state(state: Estimate) -> dict[str, Any]:
    """A constant in SI, and the unit in which a person reads it."""
    factor, unit = state_unit(state.state)
    keys = ("name", "value", "sigma", "prior", "moves_m", "observed", "requested")
    return {key: getattr(state, key) for key in keys} | {"unit": unit, "per_unit": factor}
