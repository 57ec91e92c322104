"""Products of a calibrated mounting: mounting.toml, calibrate_mounting.json and a page."""

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..base.files import atomic_write, json_ready
from ..config.flight_file import Flight
from ..geodesy.rotation import opk_from_rotation
from ..orient.mounting_file import DELAY, VECTORS, MountingFile, mounting_text
from ..processing.checks import camera_of
from ..processing.staging import Staging
from ..records.block import Array
from ..report.figures.mounting import residual_pictures
from ..report.markup import document as page
from ..report.markup import escape, folded, pictured, sentence, table
from .judgement import CONTRADICTING, METRES, UNITS, Component, facts_of, linear_functions
from .run import MountingResult

TOML, DOCUMENT, PAGE = "mounting.toml", "calibrate_mounting.json", "calibrate_mounting.html"
GROUPS = {"antenna_m": "antenna_m", "imu_m": "imu_m", "boresight": "boresight", "delay": DELAY}


def mounting_file(result: MountingResult, flight: Flight) -> MountingFile:
    """Return what goes into mounting.toml.

    Of a vector or bore-sight of which some components are determined the others are the flight
    file's, and a remark says which.

    Parameters
    ----------
    result : MountingResult
        The calibration.
    flight : Flight
        The flight file, for its camera.

    Returns
    -------
    MountingFile
        Values, covariances, reasons.
    """
    solved = result.solved
    names, J, _, _ = linear_functions(solved, result.stated)
    V = J @ solved.cov @ J.T
    given: dict[str, Any] = {}
    missing: dict[str, str] = {}
    remarks: list[str] = []
    for group, key in GROUPS.items():
        own = [c for c in result.components if c.group == group]
        weak = [c for c in own if not c.determined]
        if len(weak) == len(own):
            missing[key] = "; ".join(dict.fromkeys(c.sentence for c in weak))
            continue
        for c in weak:
            remarks.append(f"{key}: the flight file's value about this axis: {c.sentence}")
        rows = [k for k, name in enumerate(names) if name[0] == group]
        cov = V[np.ix_(rows, rows)]
        if group == "delay":
            given |= {DELAY: result.delay_s, "time_offset_sigma_s": float(np.sqrt(cov[0, 0]))}
        elif group == "boresight":
            T = result.mounting.camera_from_body
            given |= {"boresight": result.mounting.boresight, "camera_from_body": T}
            given["boresight_cov"] = 0.5 * (cov + cov.T)
        else:
            given[key] = getattr(result.mounting, key)
            given[f"{key.removesuffix('_m')}_cov"] = 0.5 * (cov + cov.T)
    tags = camera_of(flight)
    if tags is not None:
        given |= {"camera": tags.model, "image_size": tags.image_size, "focal_px": tags.focal_px}
    return MountingFile(
        verb="calibrate mounting",
        date=result.date,
        inputs=result.inputs,
        verdict=tuple(c.sentence for c in result.components),
        not_determined=missing,
        remarks=tuple(remarks),
        **given,
    )


def document(result: MountingResult) -> dict[str, Any]:
    """Return everything that was found, for machines.

    Parameters
    ----------
    result : MountingResult
        The calibration.

    Returns
    -------
    dict
        What the JSON file holds.
    """
    solved, facts = result.solved, facts_of(result.solved)
    B = result.mounting.boresight
    return {
        "headline": result.headline,
        "components": [
            {
                "name": c.name,
                "group": c.group,
                "axis": c.axis,
                "verdict": c.verdict,
                "value": c.value if c.determined else None,
                "sigma": c.sigma,
                "limit": c.limit,
                "flight_file": c.stated,
                "why": c.why,
                "remedies": list(c.remedies),
            }
            for c in result.components
        ],
        "mounting": {
            **{key: getattr(result.mounting, key).tolist() for key in VECTORS},
            "boresight": B.tolist(),
            "boresight_opk_deg": np.degrees(opk_from_rotation(B)).tolist(),
            DELAY: result.delay_s,
        },
        "images": int(solved.rows.size),
        "speed_mps": list(facts.speed),
        "mean_heading_length": facts.headings,
        "tilt_deg": facts.tilt_deg,
        "factors_of_poses": [float(f) for f in solved.factors],
        "factor_of_flight": list(solved.flight_factor),
        "corrections_sigma": list(result.corrections),
        "frame": {
            "turn": solved.values["turn of the block"].tolist(),
            "scale": float(solved.values["scale of the block"][0]),
            "scale_sigma": float(solved.sigma("scale of the block")[0]),
        },
        "date": result.date,
        "inputs_sha256": dict(result.inputs),
        "notes": list(result.notes),
    }


def written(result: MountingResult, directory: Path, flight: Flight) -> tuple[Path, ...]:
    """Write every product, or none.

    Parameters
    ----------
    result : MountingResult
        The calibration.
    directory : Path
        Where they go.
    flight : Flight
        The flight file.

    Returns
    -------
    tuple of Path
        The files.
    """
    text = json.dumps(json_ready(document(result)), indent=1, allow_nan=False, ensure_ascii=False)
    with Staging(directory) as staging:
        into = staging.directory
        atomic_write(into / TOML, mounting_text(mounting_file(result, flight)))
        atomic_write(into / DOCUMENT, text + "\n")
        against = any(c.verdict == CONTRADICTING for c in result.components)
        mood = "doubtful" if against or not all(c.determined for c in result.components) else "good"
        title = f"{flight.name}: mounting"
        atomic_write(into / PAGE, page(title, result.headline, mood, _body(result)))
        moves = staging.moves()
        for source, goal in moves:
            os.replace(source, goal)
    return tuple(goal for _, goal in moves)


def _body(result: MountingResult) -> Iterator[str]:
    yield "<h2>Components</h2>\n"
    yield table(
        [_row(c) for c in result.components],
        ("component", "value", "sigma", "flight file", "verdict"),
    )
    reasons = [c for c in result.components if not c.determined or c.why]
    if reasons:
        items = "".join(f"<li>{escape(sentence(c.sentence))}</li>\n" for c in reasons)
        yield f"<h2>Why, and what would help</h2>\n<ul>\n{items}</ul>\n"
    residual, against = _residuals(result)
    yield from map(pictured, residual_pictures(residual, against))
    if result.notes:
        items = "".join(f"<li>{escape(sentence(note))}</li>\n" for note in result.notes)
        yield f"<h2>Notes</h2>\n<ul>\n{items}</ul>\n"
    rows = [(escape(name), f"<code>{escape(digest)}</code>") for name, digest in result.inputs]
    yield folded("Inputs", table(rows, ("file", "SHA-256")))


def _row(c: Component) -> tuple[str, ...]:
    factor, unit, digits = UNITS.get(c.group, METRES)
    mark = {"determined": "ok", "not determined": "note"}.get(c.verdict, "contradiction")
    value = f"{factor * c.value:+.{digits}f} {unit}" if c.determined else "–"
    words = "contradicts the flight file" if c.verdict == CONTRADICTING else c.verdict
    return (
        escape(c.name),
        value,
        f"{factor * c.sigma:.{digits}f} {unit}",
        f"{factor * c.stated:+.{digits}f} {unit}" if c.group != "shift" else "",
        f'<span class="{mark}">{words}</span>',
    )


def _residuals(result: MountingResult) -> tuple[Array, dict[str, Array]]:
    """Return residuals in body axes, and what they are drawn over."""
    solved = result.solved
    eo, rows = solved.flight.eo, solved.rows
    assert eo.velocity_mps is not None and eo.rate_radps is not None
    C_mb = eo.C_mc[rows] @ solved.flight.mounting.C_cb
    e = solved.residuals
    body = np.hstack([np.einsum("nji,nj->ni", C_mb, part) for part in (e[:, :3], e[:, 3:])])
    heading = np.degrees(np.arctan2(C_mb[:, 0, 0], C_mb[:, 1, 0])) % 360.0
    rate = np.linalg.norm(eo.rate_radps[rows], axis=1)
    return body, {
        "time of week, s": eo.time[rows],
        "speed, m/s": np.linalg.norm(eo.velocity_mps[rows], axis=1),
        "heading, deg": heading,
        "turn rate, deg/s": np.degrees(rate),
    }
