"""What of a flight stands in the table of a season: one row, from its report.json."""

import hashlib
import json
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ...base.output.unfinished import is_unfinished
from ...base.received.nesting import read_object
from ...flight.config.flight_file import Flight
from ...records.states import AXES, OF_LEVER_ARM, TIME_OFFSET

BIAS_UNITS = {"gyro": "deg_h", "accel": "mg"}
BIAS_COLUMNS = {
    f"{sensor}_bias_{axis}_{unit}": (f"{sensor} bias {axis}", unit.replace("_", "/"))
    for sensor, unit in BIAS_UNITS.items()
    for axis in AXES
}
"""Name and unit of the biases by column."""
ROW_COLUMNS = (
    *("name", "flight", "equipment", "date_utc", "status", "judgement", "reason"),
    *("images", "fixes", "fixes_used", "duration_s"),
    *("sigma_e_mm", "sigma_n_mm", "sigma_u_mm"),
    *("sigma_att_e_deg", "sigma_att_n_deg", "sigma_att_u_deg"),
    *("nis_ratio", "limits"),
    *(f"lever_arm_{axis}_m" for axis in AXES),
    *(f"lever_arm_{axis}_sigma_m" for axis in AXES),
    *("time_offset_s", "time_offset_sigma_s"),
    *(f"boresight_{axis}_deg" for axis in "xyz"),
    *(f"boresight_{axis}_sigma_deg" for axis in "xyz"),
    *BIAS_COLUMNS,
    *("version", "inputs_sha256", "seconds", "report"),
)
"""Of season.csv, in their order (data_specs/season.md)."""
TEXT_COLUMNS = {
    *("name", "flight", "equipment", "date_utc", "status", "judgement", "reason", "limits"),
    *("version", "inputs_sha256", "report"),
}
LEVER_ARM_COLUMNS = {state: f"lever_arm_{state.axis}" for state in OF_LEVER_ARM}
LEVER_ARM_COLUMNS[TIME_OFFSET] = "time_offset"
"""The constants of a report, and the beginnings of their columns."""
EQUIPMENT_FILE = "equipment_file"  # of a row, not of the table
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
    from ...report.verdict import run_verdict

    exposures = report.get("exposures") or {}
    position = (exposures.get("position_mm") or {}).get("median") or [None] * 3
    attitude = (exposures.get("attitude_deg") or {}).get("median") or [None] * 3
    limits = [limit for limit in report["limits"] if limit["rank"] >= 1.0]
    judgement, why, _ = run_verdict(report)
    row: Row = dict.fromkeys(ROW_COLUMNS)
    row |= {
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
    for axis, sigma, attitude_sigma in zip("enu", position, attitude, strict=True):
        row[f"sigma_{axis}_mm"], row[f"sigma_att_{axis}_deg"] = sigma, attitude_sigma
    biases = report.get("biases") or {}
    of_axes = [
        bias
        for sensor, unit in BIAS_UNITS.items()
        for bias in biases.get(f"{sensor}_{unit}") or [None] * 3
    ]
    row |= dict(zip(BIAS_COLUMNS, of_axes, strict=True))
    return row | constants_row(report)


def constants_row(report: Mapping[str, Any]) -> Row:
    """Return what a flight tells of the constants of its fixes and when it was, by column.

    Parameters
    ----------
    report : mapping
        What report.json holds, or what a run that was refused had found by then.
    """
    row: Row = {"date_utc": _date(report)}
    constants = {constant["name"]: constant for constant in report.get("constants", ())}
    for state, column in LEVER_ARM_COLUMNS.items():
        if (constant := constants.get(str(state))) is not None:
            row[f"{column}_{state.unit}"] = constant["assumed"] + constant["correction"]
            row[f"{column}_sigma_{state.unit}"] = constant["sigma"]
    return row


def known_from_refusal(findings: Mapping[str, Any]) -> Row:
    """Return the constants of a flight that was refused because of them, by column.

    An equipment that has drifted far contradicts its flight files: without these flights its trend
    would end where it begins to matter. Of any other contradiction the constants may be a
    consequence, and are left out.

    Parameters
    ----------
    findings : mapping
        What the run had found by then (`InputError.findings`).
    """
    names, groups = (
        set(findings.get("contradictions", ())),
        {state.group for state in LEVER_ARM_COLUMNS},
    )
    if not names or "constants" not in findings or not names <= groups:
        return {}
    return constants_row(findings)


def digest(hashes: Mapping[str, str]) -> str:
    """Return one hash of all inputs, by their contents and their names relative to the flight."""
    text = json.dumps(sorted(hashes.items()))
    return hashlib.sha256(text.encode()).hexdigest()


def _date(report: Mapping[str, Any]) -> str:
    """Return the instant of the first epoch, UTC; empty without a GPS week."""
    from ...geodesy.gpstime import calendar_from_gps

    span, flight = report["span"], report.get("flight") or {}
    week = span.get("gps_week")
    week = flight.get("gps_week") if week is None else week
    if week is None:
        return ""
    when = calendar_from_gps(int(week), float(span["start_tow_s"]))
    return when.strftime("%Y-%m-%dT%H:%M:%SZ")


def equipment_of(flight: Flight) -> Row:
    """Return the name of the equipment of a flight, the file that it includes, and that file.

    Both are empty without one.
    """
    if not flight.included:
        return {"equipment": "", EQUIPMENT_FILE: ""}
    file = flight.included[0]
    return {"equipment": file.stem, EQUIPMENT_FILE: str(file.resolve())}


def with_own_names(rows: Sequence[Row]) -> list[Row]:
    """Return rows in which files of one name in several directories are several equipments.

    Parameters
    ----------
    rows : sequence of dict
        With the file of each equipment; "a/wing3.toml" and "b/wing3.toml" become a/wing3, b/wing3.
    """
    files: dict[str, set[str]] = {}
    for row in rows:
        if row.get(EQUIPMENT_FILE):
            files.setdefault(str(row["equipment"]), set()).add(str(row[EQUIPMENT_FILE]))
    out = []
    for row in rows:
        same_equipment = files.get(str(row.get("equipment") or ""), set())
        if len(same_equipment) > 1 and row.get(EQUIPMENT_FILE):
            above = Path(os.path.commonpath([Path(file).parent for file in same_equipment]))
            name = Path(str(row[EQUIPMENT_FILE])).relative_to(above).with_suffix("")
            row = row | {"equipment": name.as_posix()}
        out.append(row)
    return out


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

    from ...geodesy.rotation import opk_from_rotation

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
    report = {} if is_unfinished(path) else read_object(path)
    return report if "inputs_sha256" in report else None


def is_number(value: Any) -> bool:
    """Tell whether a value of a row is a finite number."""
    return isinstance(value, int | float) and math.isfinite(value)
