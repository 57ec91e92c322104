"""The mood of a report: the colour of the bar beside its headline, and why it has it."""

from collections.abc import Mapping
from typing import Any

from .rules.verdict import MOST_SENTENCES

# mean NIS a degree of freedom: beyond it the sigmas of the result are wrong by more than 40 %
FAR_ABOVE = 2.0
NAMED = 3  # things that stand out and are named beside the bar


def mood(summary: Mapping[str, Any]) -> tuple[str, str]:
    """Return good, doubtful or bad, and the reason in words, without full stop.

    It is bad for a contradiction, no fix used, innovations far above their sigmas, or a solution
    that leaves its own fixes.
    """
    if reason := _bad(summary):
        return "bad", reason
    standing_out = [limit for limit in summary["limits"] if limit["rank"] >= 1.0]
    if not standing_out:
        if summary["standing"]:
            return "good", "nothing in the data is odd; no fixes were there to support the result"
        return "good", (
            "no check found a contradiction, the innovations agree with their sigmas, and no"
            " figure leaves what a good flight shows"
        )
    topics = list(dict.fromkeys(limit["topic"] for limit in standing_out[:MOST_SENTENCES]))
    named = ", ".join(topics[:NAMED]) + (" and more" if len(topics) > NAMED else "")
    count = len(standing_out)
    return "doubtful", (
        f"{count} {'figure leaves' if count == 1 else 'figures leave'} what a good flight shows"
        f" ({named}); {'it is' if count == 1 else 'they are'} the"
        f" {'sentence' if count == 1 else 'sentences'} under What limits this flight. Nothing"
        " contradicts the result"
    )


def _bad(s: Mapping[str, Any]) -> str:
    """Return why a report is bad; nothing where it is not."""
    against = [check for check in s["checks"] if check["verdict"] == "contradiction"]
    if against:
        first = against[0]
        more = f" (and {len(against) - 1} more)" if len(against) > 1 else ""
        return (
            f"the check of {first['name']} contradicts the input{more}: {first['found']}"
            f" (expected: {first['expected']})"
        )
    if not s["counts"]["fixes_used"]:
        return "no GNSS fix was used, nothing supports the positions"
    residuals = s["residuals"]
    if residuals is not None and residuals["beyond"]:
        return (
            f"the solution leaves its own fixes in {residuals['beyond']} of"
            f" {len(residuals['pieces'])} pieces, by more than the {residuals['limit']:.1f} sigmas"
            " that chance allows"
        )
    position = s["consistency"]["position"]
    if (
        not s["standing"]
        and position["verdict"] == "overconfident"
        and position["mean_per_dof"] > FAR_ABOVE
    ):
        return (
            f"the innovations are {position['size']:.1f} times as large as their sigmas say (mean"
            f" NIS per degree of freedom {position['mean_per_dof']:.2f}, limit {FAR_ABOVE:.0f}):"
            " the sigmas of the result are too small"
        )
    return ""
