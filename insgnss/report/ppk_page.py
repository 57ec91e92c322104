"""The page of a PPK solution: its quality in a sentence, epoch by epoch, signals, checks."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..records import Finding
from .charts import gnss
from .charts.chart import Chart
from .verb_page import VerbPage, checks_table, tabulated

MOST_NAMED = 3  # checks that are named beside the bar
MOODS = {"good": "good", "usable with care": "doubtful", "poor": "bad"}


def ppk_charts(series: Mapping[str, Any]) -> list[Chart]:
    """Return the charts of a solution.

    Parameters
    ----------
    series : mapping
        As `report.charts.gnss` takes them.
    """
    return list(gnss.charts(series))


def ppk_page(
    document: Mapping[str, Any],
    checks: Sequence[Finding],
    series: Mapping[str, Any],
    inputs: Sequence[Path],
    twin: str,
) -> VerbPage:
    """Return the page of a solution.

    Parameters
    ----------
    document : mapping
        What ppk.json holds.
    checks : sequence of Finding
        Of all steps.
    series : mapping
        Of the solution, epoch by epoch.
    inputs : sequence of Path
        Observations and ephemerides.
    twin : str
        Text of ppk.json.
    """
    word, _, rest = document["verdict"].partition(": ")
    quality = [(name, value) for name, value in document["quality"].items() if _is_plain(value)]
    return VerbPage(
        f"PPK: {Path(document['input']['rover']).name}",
        f"{word.capitalize()}: {rest}",
        MOODS.get(word, "doubtful"),
        _why(word, checks),
        ppk_charts(series),
        parts=(
            checks_table(checks),
            tabulated("Figures of merit", [(name, f"{value:.6g}") for name, value in quality]),
            tabulated("Files", [(str(file),) for file in document["files"]]),
        ),
        inputs=inputs,
        settings=_flat(document["input"]),
        versions={"engine": str(document["engine"]), "its CPU, s": f"{document['cpu_s']:.1f}"},
        twin=twin,
    )


def _why(word: str, checks: Sequence[Finding]) -> str:
    """Return why the bar has its colour: what was found against the solution, the worst first."""
    odd = sorted(
        (check for check in checks if check.verdict != "ok"), key=lambda c: c.verdict == "note"
    )
    if word == "good":
        names = ", ".join(dict.fromkeys(check.name for check in odd))
        notes = f"; there are notes on {names}" if odd else ""
        return f"nearly all epochs are fixed and confirmed, and no check is against them{notes}"
    more = f"; and {len(odd) - MOST_NAMED} more" if len(odd) > MOST_NAMED else ""
    named = "; ".join(f"{check.name}: {check.found}" for check in odd[:MOST_NAMED])
    return f"{named}{more}" if odd else "too few epochs are fixed and confirmed"


def _is_plain(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _flat(of: Mapping[str, Any], prefix: str = "") -> dict[str, object]:
    """Return options with dotted names, those that are empty left out."""
    options: dict[str, object] = {}
    for name, value in of.items():
        if isinstance(value, Mapping):
            options |= _flat(value, f"{prefix}{name}.")
        elif value is not None and value != () and value != "":
            options[f"{prefix}{name}"] = value
    return options
