"""The page of an inspection: what the recording is, by what evidence, and what is doubtful."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ...report.figures.recognition import answers_in_words
from ...report.verb_page import VerbPage, checks_table, preformatted, tabulated
from .mounting_drawing import drawn_as_svg
from .text import sensor_lines

if TYPE_CHECKING:
    from ...report.charts.chart import Chart
    from .result import InspectionData

SURE = 0.9  # a confidence that is not doubtful


def inspection_page(result: "InspectionData", charts: "Sequence[Chart]") -> VerbPage:
    """Return the page of an inspection.

    Parameters
    ----------
    result : InspectionData
        What was found.
    charts : sequence of Chart
        What was recognised.

    Returns
    -------
    VerbPage
        With the findings and their evidence.
    """
    mood, why = _mood(result)
    s = result.sensing
    recognised = "" if result.recognition is None else answers_in_words(result.findings)
    sampled = f"{s.rate_hz:.5g} Hz for {s.length_s:.0f} s, {s.grade} class"
    findings = [(f.name, f.found, f"{f.confidence:.3f}", f.evidence) for f in result.findings]
    sources = [
        (x.role, x.title, x.what, ", ".join(x.columns_left_out) or "none") for x in result.sources
    ]
    left_out = [
        (str(path), why.removeprefix(str(path)).lstrip(": ")) for path, why in result.left_out
    ]
    return VerbPage(
        f"{result.name}: inspection",
        f"{recognised}; {sampled}" if recognised else sampled,
        mood,
        why,
        charts,
        parts=(
            tabulated("Findings", findings, ("finding", "value", "confidence", "evidence")),
            preformatted("What the sensor shows", sensor_lines(s, result.gyro_counts)),
            _mounting(result),
            checks_table(result.checks),
            tabulated("Files", sources, ("role", "file", "what it is", "columns left out")),
            tabulated("Left out", left_out, ("file", "why")),
        ),
        inputs=[x.path for x in result.sources],
    )


def _mounting(result: "InspectionData") -> str:
    """Return the drawing of the drafted mounting under a heading; nothing without a draft."""
    draft = result.draft
    antenna = None if draft is None else draft.value("mounting", "antenna_m")
    if draft is None or antenna is None:
        return ""
    turn = draft.value("mounting", "camera_from_body") or [[-1, 0, 0], [0, -1, 0], [0, 0, 1]]
    imu = draft.value("mounting", "imu_m") or [0.0, 0.0, 0.0]
    remark = (
        "<p>Axes of the body and, as drafted, of the camera; lever arms go from the camera to the"
        " antenna and to the IMU. What is drawn at the camera has not been measured.</p>"
    )
    return f"<h2>Mounting</h2>{remark}<div class='wide'>{drawn_as_svg(turn, antenna, imu)}</div>\n"


def _mood(result: "InspectionData") -> tuple[str, str]:
    """Return the colour of the bar, and why it has it."""
    if (refusal := result.refusal) is not None:
        return "bad", str(refusal)
    unsure = [f.name for f in result.findings if f.confidence < SURE]
    notes = [check.name for check in result.checks if check.verdict == "note"]
    if result.unrecognised:
        return "doubtful", f"no motion to compare: {result.unrecognised}"
    if unsure:
        return (
            "doubtful",
            f"not determined, or with a confidence below {SURE:g}: {', '.join(unsure)}",
        )
    if notes:
        return "doubtful", f"checks have a note: {', '.join(notes)}"
    return "good", f"every finding has a confidence of {SURE:g} or more, and no check has a note"
