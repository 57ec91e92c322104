"""What an inspection says: what the recording is, by what evidence, and what is doubtful."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from ...base.files import json_ready, pick_attributes
from ...base.units import DEG_PER_H, MILLI_G
from ...navigation.prepare.fix_path import north_east
from ...navigation.recognise.findings import Finding
from ...records.interpolation import columns_at
from ...report.charts.chart import Chart
from ...report.document import Document, Drawing, Section, Table, checks_section
from ...report.figures.recognition import answers_in_words
from ...report.verdict import worst_of
from .mounting_drawing import drawn_as_svg
from .result import InspectionData
from .sensing import DEG_S, EARTH_RATE, Sensing

SURE = 0.9  # a confidence that is not doubtful
# findings that only motion shows; of a vehicle that keeps its place they are open, not doubtful
AXIS_CHECKS = ("force sign", "vertical axis", "forward axis", "axes")
# median speed (m/s) of a vehicle that keeps its place: wind moves a hovering copter by 0.5 m/s
KEEPS_PLACE_MS, SPEED_S = 1.0, 2.0
MOST_LEFT_OUT = 8  # most files that are not folded: 8, because directories of images have many


def inspection_document(result: InspectionData, charts: Sequence[Chart] = ()) -> Document:
    """Return what an inspection says.

    Parameters
    ----------
    result : InspectionData
        What was found.
    charts : sequence of Chart
        What was recognised, for the page.
    """
    s, refusal, next_ = result.sensing, result.refusal, ""
    recognised = "" if result.recognition is None else f"{answers_in_words(result.findings)}; "
    if result.written:
        next_ = f"next: insgnss process {result.written[-1]}"
    elif not result.missing:
        next_ = "next: write a flight file of these findings with insgnss inspect ... --write"
    left_out = [x.why if x.problem else f"{x.path}: {x.why}" for x in result.left_out]
    unsure = [f.name for f in result.findings if f.confidence < SURE]
    at_place = [name for name in unsure if name in AXIS_CHECKS] if _hovers(result) else []
    unsure = [name for name in unsure if name not in at_place]
    every = "every finding"
    if at_place:
        every = (
            f"the vehicle stayed in place and does not show {', '.join(at_place)}; every other "
            "finding"
        )
    notes = [check.name for check in result.checks if check.verdict == "note"]
    doubts = {
        f"no motion to compare: {result.unrecognised}": result.unrecognised,
        f"not determined, or with a confidence below {SURE:g}: {', '.join(unsure)}": unsure,
        f"checks have a note: {', '.join(notes)}": notes,
    }
    return Document(
        f"{result.name}: inspection",
        f"{recognised}{s.rate_hz:.5g} Hz for {s.length_s:.0f} s, {s.grade} class",
        worst_of(
            f"{every} has a confidence of {SURE:g} or more, and no check has a note",
            [text for text, names in doubts.items() if names],
            [] if refusal is None else [str(refusal)],
        ),
        (
            *charts,
            findings_section("Findings", result.findings),
            Section("What the sensor shows", tuple(_sensor(s, result.gyro_counts))),
            Section("Mounting", _mounting(result), "page"),
            checks_section(result.checks),
            Section("Files", [_source_line(source) for source in result.sources]),
            Section("Left out", left_out[:MOST_LEFT_OUT], more=left_out[MOST_LEFT_OUT:]),
        ),
        [x.path for x in result.sources],
        files=result.written,
        next=next_,
    )


def _hovers(result: InspectionData) -> bool:
    """Whether the vehicle keeps its place for more than half of the recording."""
    gnss = result.gnss
    if gnss is None or gnss.time.size < 2:
        return False
    time = np.arange(gnss.time[0], gnss.time[-1], SPEED_S)
    path = columns_at(time, gnss.time, north_east(gnss))
    step = np.linalg.norm(np.diff(path, axis=0), axis=1)
    return bool(step.size and np.median(step) < KEEPS_PLACE_MS * SPEED_S)


def _source_line(source: Any) -> str:
    columns = ", ".join(source.columns_left_out)
    text = f"{source.role}: {source.title}: {source.what}"
    return f"{text}; columns left out: {columns}" if columns else text


def findings_section(title: str, findings: Sequence[Finding]) -> Section:
    """Return findings with their evidence as a table.

    Parameters
    ----------
    title : str
        The heading.
    findings : sequence of Finding
        What was recognised.
    """
    rows = [(f.name, f.found, f"{f.confidence:.3f}", f.evidence) for f in findings]
    return Section(title, [Table(rows, ("finding", "value", "confidence", "evidence"))])


def finding_documents(findings: Any) -> list[dict[str, Any]]:
    """Return the findings for JSON output."""
    return [
        {"name": f.name, "value": f.found} | pick_attributes(f, "confidence", "evidence")
        for f in findings
    ]


def _sensor(s: Sensing, gyro_counts: float | None) -> Iterator[str]:
    """Yield what the IMU shows of itself; gyro_counts as in `alone.Alone`."""
    unit, factor = ("deg/s", DEG_S) if gyro_counts is None else ("counts", gyro_counts)
    noises = [("at rest" if s.rest_s else "quietest", s.rest_gyro, s.rest_accel)]
    if not s.is_static:
        noises.append(("moving", s.moving_gyro, s.moving_accel))
    for state, gyro, accel in noises:
        yield (
            f"white noise {state}: gyro {_three_numbers(gyro / factor)} {unit}/sqrt(Hz),"
            f" accelerometer {_three_numbers(accel / MILLI_G)} mg/sqrt(Hz)"
        )
    if not s.rest_s:
        yield "no stationary period of a second"
        return
    axis = int(np.argmax(np.abs(s.mean_accel)))
    yield (
        f"at rest for {s.rest_s:.0f} s in {len(s.stationary)} stationary "
        f"periods{', all of it' if s.is_static else ''}: specific force {s.gravity:.5g} m/s^2, "
        f"{'xyz'[axis]} points {'up' if s.mean_accel[axis] > 0 else 'down'}; mean rate "
        f"{_three_numbers(s.mean_gyro / factor)} {unit}"
    )
    if s.sees_earth:
        size = float(np.linalg.norm(s.mean_gyro))
        yield (
            f"the gyros sense the Earth's rotation, {size / DEG_PER_H:.2f} of "
            f"{EARTH_RATE / DEG_PER_H:.2f} deg/h, so they can find north at rest"
        )


def _three_numbers(x: np.ndarray) -> str:
    return " ".join(f"{v:.3g}" for v in x)


def _mounting(result: InspectionData) -> "tuple[Drawing, ...]":
    """Return the drawing of the drafted mounting; nothing without a draft."""
    draft = result.draft
    antenna = None if draft is None else draft.value("mounting", "antenna_m")
    if draft is None or antenna is None:
        return ()
    camera_axes = draft.value("mounting", "camera_from_body") or [[-1, 0, 0], [0, -1, 0], [0, 0, 1]]
    imu = draft.value("mounting", "imu_m") or [0.0, 0.0, 0.0]
    remark = (
        "<p>Axes of the body and, as drafted, of the camera; lever arms go from the camera to the"
        " antenna and to the IMU. What is drawn at the camera has not been measured.</p>"
    )
    return (
        Drawing(f"{remark}<div class='wide'>{drawn_as_svg(camera_axes, antenna, imu)}</div>\n"),
    )


def numbers_of(result: InspectionData) -> dict[str, Any]:
    """Return the inspection for JSON output."""
    s = result.sensing
    noise = pick_attributes(s, "rest_gyro", "rest_accel", "moving_gyro", "moving_accel")
    return {
        **pick_attributes(result, "name", "unrecognised", "missing"),
        "sources": [
            {
                **pick_attributes(x, "role", "what"),
                "file": str(x.path),
                "keys": {k: list(v) if isinstance(v, tuple) else v for k, v in x.keys.items()},
                "columns_left_out": list(x.columns_left_out),
            }
            for x in result.sources
        ],
        "findings": finding_documents(result.findings),
        "sensor": pick_attributes(s, "rate_hz", "length_s", "rest_s", "sees_earth", "grade")
        | {"white_noise_si": json_ready(noise)},
        "checks": [asdict(c) for c in result.checks],
        "left_out": {str(x.path): x.why for x in result.left_out},
        "written": [str(path) for path in result.written],
    }
