"""What `calibrate mounting` leaves: its result as that of every calibration of the mounting."""

from pathlib import Path
from typing import Any

import numpy as np

from ...base.files import pick_attributes
from ...flight.config.flight_file import Flight
from ...flight.processing.checks import camera_of
from ...geodesy.rotation import opk_from_rotation
from ...io.formats.orientation.mounting_file import DELAY, VECTORS, MountingFile
from ...records.block import Array
from ...report.figures.mounting import over_motion
from .equations import BLOCK_SCALE, BLOCK_TURN
from .in_flight import MountingResult
from .judgement import facts_of, linear_functions
from .poses import date_of
from .products import CalibratedMounting, metashape_line, provenance

KEYS_OF_GROUPS = {
    "antenna_m": "antenna_m",
    "imu_m": "imu_m",
    "boresight": "boresight",
    "delay": DELAY,
}


def flight_result(
    result: MountingResult, flight: Flight, photo: Path | None = None, date: str | None = None
) -> CalibratedMounting:
    """Return the result for the file, the page and the terminal.

    Parameters
    ----------
    result : MountingResult
        The calibration.
    flight : Flight
        The flight file.
    photo : Path, optional
        An image of the camera.
    date : str, optional
        Of the data; by default that of the flight.

    Returns
    -------
    CalibratedMounting
        The same as of the other calibrations.
    """
    cameras = result.solved.block.cameras
    origin = provenance((), cameras, photo, date or date_of(result.solved.flight.eo)) | {
        "inputs": result.inputs
    }
    mounting = mounting_file(result, flight, origin)
    line = metashape_line(mounting)
    return CalibratedMounting(
        mounting,
        f"{flight.name}: mounting in flight",
        result.headline,
        tuple((c.name, c.word, c.text) for c in result.components),
        (*result.notes, *([line] if line else [])),
        document(result),
        lambda: over_motion(*_residuals(result)),
    )


def mounting_file(result: MountingResult, flight: Flight, origin: dict[str, Any]) -> MountingFile:
    """Return what goes into mounting.toml.

    Of a vector or bore-sight of which some components are determined the others are the flight
    file's, and a remark says which.

    Parameters
    ----------
    result : MountingResult
        The calibration.
    flight : Flight
        The flight file, whose images name the camera where the block does not.
    origin : dict
        Camera and date.

    Returns
    -------
    MountingFile
        Values, covariances, reasons.
    """
    solved = result.solved
    names, J, _, _ = linear_functions(solved, result.stated)
    V = J @ solved.cov @ J.T
    table: dict[str, Any] = {}
    missing: dict[str, str] = {}
    remarks: list[str] = []
    for group, key in KEYS_OF_GROUPS.items():
        of_group = [c for c in result.components if c.group == group]
        undetermined = [c for c in of_group if not c.determined]
        if len(undetermined) == len(of_group) or not all(c.held for c in undetermined):
            missing[key] = "; ".join(c.sentence for c in of_group)
            continue
        for c in undetermined:
            remarks.append(f"{key}: the flight file's value about this axis: {c.sentence}")
        rows = [k for k, name in enumerate(names) if name[0] == group]
        cov = V[np.ix_(rows, rows)]
        if group == "delay":
            table |= {DELAY: result.delay_s, "time_offset_sigma_s": float(np.sqrt(cov[0, 0]))}
        elif group == "boresight":
            T = result.mounting.camera_from_body
            table |= {"boresight": result.mounting.boresight, "camera_from_body": T}
            table["boresight_cov"] = 0.5 * (cov + cov.T)
        else:
            table[key] = getattr(result.mounting, key)
            table[f"{key.removesuffix('_m')}_cov"] = 0.5 * (cov + cov.T)
    table |= origin
    if not origin["camera"] and (tags := camera_of(flight)) is not None:
        table |= {"camera": tags.model, "image_size": tags.image_size, "focal_px": tags.focal_px}
    return MountingFile(
        verb="calibrate mounting",
        verdict=tuple(c.sentence for c in result.components),
        not_determined=missing,
        remarks=tuple(remarks),
        **table,
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
        "parameters": [
            {
                **pick_attributes(c, "name", "group", "axis", "verdict", "sigma", "limit", "why"),
                "value": c.value if c.determined else None,
                "flight_file": c.stated,
                "remedies": list(c.remedies),
            }
            for c in result.components
        ],
        "flight_file_with": {
            **{key: getattr(result.mounting, key).tolist() for key in VECTORS},
            "boresight": B.tolist(),
            "boresight_opk_deg": np.degrees(opk_from_rotation(B)).tolist(),
            DELAY: result.delay_s,
        },
        "images": int(solved.rows.size),
        "speed_mps": list(facts.speed),
        "mean_heading_length": facts.headings,
        "tilt_deg": facts.tilt_deg,
        "factors_of_poses": [float(f) for f in solved.factors.values()],
        "factor_of_flight": list(solved.flight_factor),
        "corrections_sigma": list(result.corrections),
        "frame": {
            "turn": solved.values[BLOCK_TURN].tolist(),
            "scale": float(solved.values[BLOCK_SCALE][0]),
            "scale_sigma": float(solved.sigma(BLOCK_SCALE)[0]),
        },
        "inputs": list(result.input_files),
    }


def _residuals(result: MountingResult) -> tuple[Array, dict[str, Array]]:
    """Return residuals in body axes, and what they are drawn over."""
    solved = result.solved
    eo, rows = solved.flight.eo, solved.rows
    assert eo.velocity_mps is not None
    assert eo.rate_radps is not None
    C_mb = eo.C_mc[rows] @ solved.flight.mounting.C_cb
    e = solved.residuals
    body = np.hstack([np.einsum("nji,nj->ni", C_mb, half) for half in (e[:, :3], e[:, 3:])])
    heading = np.degrees(np.arctan2(C_mb[:, 0, 0], C_mb[:, 1, 0])) % 360.0
    rate = np.linalg.norm(eo.rate_radps[rows], axis=1)
    return body, {
        "time of week, s": eo.time[rows],
        "speed, m/s": np.linalg.norm(eo.velocity_mps[rows], axis=1),
        "heading, deg": heading,
        "turn rate, deg/s": np.degrees(rate),
    }
