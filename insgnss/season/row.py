"""What of a flight stands in the table of a season: one row, from its report.json."""

import hashlib
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..config.flight_file import Flight

LEVER = ("forward", "right", "down")
COLUMNS = (
    *("name", "flight", "equipment", "date_utc", "status", "judgement", "reason"),
    *("images", "fixes", "fixes_used", "duration_s"),
    *("sigma_e_mm", "sigma_n_mm", "sigma_u_mm"),
    *("sigma_att_e_deg", "sigma_att_n_deg", "sigma_att_u_deg"),
    *("nis_ratio", "limits"),
    *(f"lever_arm_{axis}_m" for axis in LEVER),
    *(f"lever_arm_{axis}_sigma_m" for axis in LEVER),
    *("time_offset_s", "time_offset_sigma_s"),
    *(f"boresight_{axis}_deg" for axis in "xyz"),
    *(f"boresight_{axis}_sigma_deg" for axis in "xyz"),
    *("version", "inputs_sha256", "seconds", "report"),
)
"""Of season.csv, in their order (data_specs/season.md)."""
TEXTS = {
    *("name", "flight", "equipment", "date_utc", "status", "judgement", "reason", "limits"),
    *("version", "inputs_sha256", "report"),
}
Row = dict[str, Any]


def row_of(report: Mapping[str, Any]) -> Row:
    """Return what a report says of its flight, by column.

    Parameters
    ----------
    report : mapping
        What report.json holds.

    Returns
    -------
    dict
        None for what it does not hold.
    """
    from ..report.mood import mood

    exposures = report.get("exposures") or {}
    position = (exposures.get("position_mm") or {}).get("median") or [None] * 3
    attitude = (exposures.get("attitude_deg") or {}).get("median") or [None] * 3
    limits = [limit for limit in report["limits"] if limit["rank"] >= 1.0]
    constants = {one["name"]: one for one in report.get("constants", ())}
    judgement, why = mood(report)
    row: Row = dict.fromkeys(COLUMNS)
    row |= {
        "date_utc": _date(report),
        "judgement": judgement,
        "reason": "" if judgement == "good" else why,
        "images": report["counts"]["images"],
        "fixes": report["counts"]["fixes"],
        "fixes_used": report["counts"]["fixes_used"],
        "duration_s": report["span"]["duration_s"],
        "nis_ratio": ((report["consistency"] or {}).get("position") or {}).get("mean_per_dof"),
        "limits": "; ".join(dict.fromkeys(limit["topic"] for limit in limits)),
        "version": report["versions"]["insgnss"],
        "inputs_sha256": digest(report["inputs_sha256"]),
    }
    for axis, sigma, turn in zip("enu", position, attitude, strict=True):
        row[f"sigma_{axis}_mm"], row[f"sigma_att_{axis}_deg"] = sigma, turn
    for axis in LEVER:
        if (one := constants.get(f"antenna lever arm {axis}")) is not None:
            row[f"lever_arm_{axis}_m"] = one["assumed"] + one["correction"]
            row[f"lever_arm_{axis}_sigma_m"] = one["sigma"]
    if (one := constants.get("GNSS time offset")) is not None:
        row["time_offset_s"] = one["assumed"] + one["correction"]
        row["time_offset_sigma_s"] = one["sigma"]
    return row


def digest(hashes: Mapping[str, str]) -> str:
    """Return one hash of all inputs, by their contents and their names relative to the flight."""
    text = json.dumps(sorted(hashes.items()))
    return hashlib.sha256(text.encode()).hexdigest()


def _date(report: Mapping[str, Any]) -> str:
    """Return the instant of the first epoch, UTC; empty without a GPS week."""
    from ..geodesy.gpstime import calendar_from_gps

    span, flight = report["span"], report.get("flight") or {}
    week = span.get("gps_week")
    week = flight.get("gps_week") if week is None else week
    if week is None:
        return ""
    when = calendar_from_gps(int(week), float(span["start_tow_s"]))
    return when.strftime("%Y-%m-%dT%H:%M:%SZ")


def equipment_of(flight: Flight) -> str:
    """Return the name of the equipment of a flight: the file that it includes; "" without one."""
    return flight.included[0].stem if flight.included else ""


def boresight_of(flight: Flight) -> Row:
    """Return the bore-sight of a flight with its calibrated sigmas, as columns.

    Angles omega, phi, kappa of (M.4); sigmas of a turn about the camera's x, y, z, None where no
    calibration (`mounting.file`) gave it.

    Parameters
    ----------
    flight : Flight
        The flight file.
    """
    import numpy as np

    from ..geodesy.rotation import opk_from_rotation

    angles = np.degrees(opk_from_rotation(flight.mounting.boresight))
    row: Row = {f"boresight_{a}_deg": float(v) for a, v in zip("xyz", angles, strict=True)}
    for source in reversed(flight.mounting_files):
        if source.made.boresight is not None and source.made.boresight_cov is not None:
            sigma = np.degrees(np.sqrt(np.diag(source.made.boresight_cov)))
            row |= {f"boresight_{a}_sigma_deg": float(s) for a, s in zip("xyz", sigma, strict=True)}
            break
    return row


def read_report(path: Path) -> dict[str, Any] | None:
    """Return a report.json, None where there is none that can be read."""
    try:
        report = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return report if isinstance(report, dict) and "inputs_sha256" in report else None


def is_number(value: Any) -> bool:
    """Tell whether a value of a row is a finite number."""
    return isinstance(value, int | float) and math.isfinite(value)
