"""An inspection in words for the terminal, and as JSON output."""

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.findings import check_lines
from .sensing import DEG_H, DEG_S, EARTH_RATE, MG, Sensing

if TYPE_CHECKING:
    from .result import InspectionData

MOST_LEFT_OUT = 8
EVIDENCE_WIDTH = 100


def summary(result: "InspectionData") -> str:
    """Return sources, findings, what the sensor shows, checks, and what to do next."""
    lines = [result.name]
    for source in result.sources:
        lines.append(f"  {source.role:<6}  {source.title}: {source.what}")
        if source.columns_left_out:
            columns = f"columns left out: {', '.join(source.columns_left_out)}"
            lines += [f"          {line}" for line in textwrap.wrap(columns, EVIDENCE_WIDTH)]
    lines += [
        "",
        *([f"no motion to compare: {result.unrecognised}"] if result.unrecognised else []),
        *finding_lines(result.findings),
        "",
        *sensor_lines(result.sensing, result.gyro_counts),
        "",
    ]
    lines += check_lines(result.checks)
    if result.left_out:
        lines += [
            "",
            *(
                f"left out  {path}: {why.removeprefix(str(path)).lstrip(': ')[:120]}"
                for path, why in result.left_out[:MOST_LEFT_OUT]
            ),
        ]
        if len(result.left_out) > MOST_LEFT_OUT:
            lines.append(f"left out  {len(result.left_out) - MOST_LEFT_OUT} more files")
    lines += [f"wrote {path}" for path in result.written]
    if result.missing:
        lines += ["", f"no flight: {result.missing}"]
    elif result.written:
        lines += [f"next: insgnss process {result.written[-1]}"]
    else:
        lines += ["", "next: insgnss inspect ... --write writes a flight file of this"]
    return "\n".join(lines)


def finding_lines(findings: Any) -> list[str]:
    """Return a table of findings, the evidence folded."""
    width, wide = max(len(f.name) for f in findings), max(len(f.found) for f in findings)
    lines = [f"{'finding':<{width}}  {'value':<{wide}}  confidence  evidence"]
    for f in findings:
        first, *rest = textwrap.wrap(f.evidence, EVIDENCE_WIDTH, break_long_words=False) or [""]
        lines.append(
            f"{f.name:<{width}}  {f.found:<{wide}}  {f.confidence:10.3f}  {first}".rstrip()
        )
        lines += [f"{'':<{width + wide + 16}}{more}" for more in rest]
    return lines


def finding_documents(findings: Any) -> list[dict[str, Any]]:
    """Return the findings for JSON output."""
    return [
        {"name": f.name, "value": f.found, "confidence": f.confidence, "evidence": f.evidence}
        for f in findings
    ]


def sensor_lines(sensing: Sensing, gyro_counts: float | None = None) -> list[str]:
    """Return what the IMU shows of itself; gyro_counts as in `alone.Alone`."""
    s, unit, factor = sensing, "deg/s", DEG_S
    if gyro_counts is not None:
        unit, factor = "counts", gyro_counts
    lines = [f"sensor    {s.rate_hz:.5g} Hz for {s.length_s:.0f} s, {s.grade} class"]
    noise = "          white noise {:<9} gyro {} {}/sqrt(Hz), accelerometer {} mg/sqrt(Hz)"
    state = "at rest:" if s.rest_s else "quietest:"
    lines.append(noise.format(state, _three(s.rest_gyro / factor), unit, _three(s.rest_accel / MG)))
    if not s.is_static:
        lines.append(
            noise.format(
                "moving:", _three(s.moving_gyro / factor), unit, _three(s.moving_accel / MG)
            )
        )
    if not s.rest_s:
        return [*lines, "          no stationary period of a second"]
    axis = int(np.argmax(np.abs(s.mean_accel)))
    sense = "up" if s.mean_accel[axis] > 0 else "down"
    lines.append(
        f"          at rest {s.rest_s:.0f} s in {len(s.stationary)}"
        f" stationary periods{', all of it' if s.is_static else ''}: |f| {s.gravity:.5g} m/s^2,"
        f" {'xyz'[axis]} points {sense}; mean rate {_three(s.mean_gyro / factor)} {unit}"
    )
    if s.sees_earth:
        size = float(np.linalg.norm(s.mean_gyro))
        lines.append(
            f"          the gyros see the Earth turn: {size / DEG_H:.2f} of"
            f" {EARTH_RATE / DEG_H:.2f} deg/h, so they can find north at rest"
        )
    return lines


def _three(x: np.ndarray) -> str:
    return " ".join(f"{v:.3g}" for v in x)


def document(result: "InspectionData") -> dict[str, Any]:
    """Return the inspection for JSON output."""
    s = result.sensing
    numbers = {
        name: np.asarray(getattr(s, name)).tolist()
        for name in ("rest_gyro", "rest_accel", "moving_gyro", "moving_accel")
    }
    rest = {"rest_s": s.rest_s, "sees_earth": s.sees_earth, "grade": s.grade}
    return {
        "name": result.name,
        "sources": [
            {
                "role": x.role,
                "file": str(x.path),
                "what": x.what,
                "keys": _plain(x.keys),
                "columns_left_out": list(x.columns_left_out),
            }
            for x in result.sources
        ],
        "findings": finding_documents(result.findings),
        "unrecognised": result.unrecognised,
        "sensor": {"rate_hz": s.rate_hz, "length_s": s.length_s, "white_noise_si": numbers, **rest},
        "checks": [c.as_dict() for c in result.checks],
        "left_out": {str(path): why for path, why in result.left_out},
        "missing": result.missing,
        "written": [str(path) for path in result.written],
    }


def _plain(keys: Any) -> Any:
    return {key: list(value) if isinstance(value, tuple) else value for key, value in keys.items()}
