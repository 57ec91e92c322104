"""The page of a comparison: what differs by how much, what explains it, and what remains."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ...report.verb_page import VerbPage, listed, tabulated
from .result import DIGITS, Component

if TYPE_CHECKING:
    from .result import Comparison

WIDE = 1.5  # rms over sigma from which on the standard deviations are doubted
STATISTICS = ("mean", "median", "sd", "rms", "p95", "largest")


def comparison_page(result: "Comparison") -> VerbPage:
    """Return the page of a comparison.

    Parameters
    ----------
    result : Comparison
        The differences.

    Returns
    -------
    VerbPage
        With charts of all components.
    """
    mood, why = _mood(result)
    sizes = ", ".join(f"{c.name} {_screen(c, 'rms')} {c.screen[1]}" for c in result.components)
    files = [
        (side, name, form, point)
        for side, name, form, point in (
            ("a", result.a, result.form_a, result.point_a),
            ("b", result.b, result.form_b, result.point_b),
        )
    ]
    without = f"without partner: {result.left_a} of a, {result.left_b} of b"
    mismatches = [f.sentence() for f in result.findings]
    return VerbPage(
        f"{Path(result.a).name} and {Path(result.b).name}: comparison",
        f"{result.n} poses matched by {result.matched_by}; rms of b minus a: {sizes}",
        mood,
        why,
        result.charts(),
        (listed("Recognised", mismatches),),
        (
            _table("b minus a, axes east, north, up at the point", result.components),
            _table("What remains after the recognised is taken off", result.remaining),
            tabulated("What was compared", files, ("", "file", "format", "positions of")),
            listed("Notes", [without, *result.notes]),
        ),
        [Path(result.a), Path(result.b)],
    )


def _mood(result: "Comparison") -> tuple[str, str]:
    """Return the colour of the bar, and why it has it."""
    if result.findings:
        names = ", ".join(finding.name for finding in result.findings)
        return "doubtful", f"a mismatch of conventions explains a part of the differences: {names}"
    wide = [
        f"{c.name} {ratio:.1f}"
        for c in result.components
        if (ratio := c.statistics().get("normalised_rms", 0.0)) > WIDE
    ]
    if wide:
        return "doubtful", (
            f"differences are larger than their standard deviations say (rms over sigma"
            f" {', '.join(wide)}; up to {WIDE:g} passes)"
        )
    nothing = "no mismatch of names, axes, angles, time, height or lever arm recognised"
    return "good", nothing


def _screen(c: Component, name: str) -> str:
    factor, unit = c.screen
    return f"{factor * c.statistics()[name]:.{DIGITS[unit]}f}"


def _table(title: str, components: Sequence[Component]) -> str:
    normalised = any(c.sigma is not None for c in components)
    head = ("", "mean", "median", "sd", "rms", "95 %", "largest", "unit")
    rows = []
    for c in components:
        row = [c.name, *(_screen(c, name) for name in STATISTICS), c.screen[1]]
        if normalised:
            ratio = c.statistics().get("normalised_rms")
            row.append("\N{EN DASH}" if ratio is None else f"{ratio:.2f}")
        rows.append(row)
    return tabulated(title, rows, (*head, *(["rms/sigma"] if normalised else [])), numbers=True)
