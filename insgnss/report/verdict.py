"""The verdict on a result: the one rule that makes it from findings, and that of a flight's run.

The page colours the bar beside its headline by it, the terminal prints it below the headline.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Literal, NamedTuple

from ..base.wording import some
from .rules.verdict import MOST_SENTENCES

# mean NIS a degree of freedom: beyond it the sigmas of the result are wrong by more than 40 %
FAR_ABOVE = 2.0
NAMED = 3  # most findings that a verdict names: 3, because the sections have them all


class Verdict(NamedTuple):
    """How far a result is to be trusted.

    Parameters
    ----------
    word : str
        "good", "doubtful" or "bad".
    why : str
        The reason, without full stop.
    """

    word: Literal["good", "doubtful", "bad"]
    why: str

    def __str__(self) -> str:
        return f"{self.word.capitalize()}: {self.why}"


def worst_of(good: str, doubtful: Sequence[str] = (), bad: Sequence[str] = ()) -> Verdict:
    """Return the verdict of findings: that of the worst kind that there is.

    Parameters
    ----------
    good : str
        What is good where nothing was found.
    doubtful, bad : sequence of str
        Findings of either kind, the most important first, without full stop.
    """
    findings = bad or doubtful
    why = some(findings, NAMED, "; ") if findings else good
    return Verdict("bad" if bad else "doubtful" if doubtful else "good", why)


def run_verdict(summary: Mapping[str, Any]) -> Verdict:
    """Return the verdict on the run of a flight.

    It is bad for a contradiction, no fix used, innovations far above their sigmas, or a solution
    that leaves its own fixes.
    """
    reason = _bad(summary)
    good = (
        "nothing in the data is odd; no fixes were there to support the result"
        if summary["standing"]
        else "no check found a contradiction, the innovations agree with their sigmas, and no"
        " figure leaves what a good flight shows"
    )
    standing_out = [limit for limit in summary["limits"] if limit["rank"] >= 1.0]
    if reason or not standing_out:
        return worst_of(good, bad=[reason] if reason else [])
    topics = list(dict.fromkeys(limit["topic"] for limit in standing_out[:MOST_SENTENCES]))
    n = len(standing_out)
    beyond = (
        f"{f'{n} figures are' if n > 1 else '1 figure is'} beyond those of a good flight"
        f" ({some(topics, NAMED)}), see What limits this flight; nothing contradicts the result"
    )
    return worst_of(good, [beyond])


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
