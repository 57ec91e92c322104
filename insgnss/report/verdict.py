"""The verdict on a result: the one rule that makes it from findings, and that of a flight's run.

The page colours the bar beside its headline by it, the terminal prints it below the headline.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Literal, NamedTuple

from ..base.wording import some
from .rules.use import EXCEPT, NO, STATED_NEED, USE
from .rules.wording import lengths

Word = Literal["good", "doubtful", "bad"]
NAMED = 3  # most findings that a verdict names: 3, because the sections have them all


class Verdict(NamedTuple):
    """How far a result is to be trusted.

    Parameters
    ----------
    word : str
        "good", "doubtful" or "bad".
    why : str
        The reason, without full stop.
    phrase : str
        What a person reads in the place of the word; empty: the word.
    """

    word: Word
    why: str
    phrase: str = ""

    @property
    def shown(self) -> str:
        """What a person reads before the reason."""
        return self.phrase or self.word.capitalize()

    def __str__(self) -> str:
        return f"{self.shown}: {self.why}"


def worst_of(all_good: str, doubtful: Sequence[str] = (), severe: Sequence[str] = ()) -> Verdict:
    """Return the verdict of findings: that of the worst kind that there is.

    Parameters
    ----------
    all_good : str
        What is good where nothing was found.
    doubtful, severe : sequence of str
        Findings of either kind, the most important first, without full stop.
    """
    findings = severe or doubtful
    why = some(findings, NAMED, "; ") if findings else all_good
    return Verdict("bad" if severe else "doubtful" if doubtful else "good", why)


def run_verdict(summary: Mapping[str, Any]) -> Verdict:
    """Return the verdict on the run of a flight, by its `use` (`rules.use`)."""
    judged = summary["use"]
    mood_of: dict[str, Word] = {USE: "good", EXCEPT: "doubtful", NO: "bad"}
    return Verdict(mood_of[judged["verdict"]], _reasons_text(judged, summary), judged["sentence"])


def _reasons_text(judged: Mapping[str, Any], summary: Mapping[str, Any]) -> str:
    """Return the reasons, or the need that all images are within."""
    if judged["reasons"] and judged["verdict"] != USE:
        return "; ".join(judged["reasons"])
    largest, need = (
        f"{lengths([1e3 * x for x in judged[f'{key}_m']])} and"
        f" {' / '.join(f'{x:.2g}' for x in judged[f'{key}_deg'])} deg"
        for key in ("largest", "need")
    )
    measure = f"the flight file needs {need}"
    if judged["measure"] != STATED_NEED:
        measure = (
            f"no need is stated, so {need} is taken, as usual of this receiver and this IMU on such"
            " a flight; state yours in output.need_m and output.need_deg"
        )
    subject = "all images are" if summary["exposures"] else "the whole trajectory is"
    return f"{subject} known to {largest} (east, north, up) or better; {measure}"
