"""One thing that was looked at, with its verdict."""

from dataclasses import dataclass
from typing import Literal

Verdict = Literal["good", "note", "unknown", "defect"]


@dataclass(frozen=True)
class Finding:
    """One thing of an installation.

    Parameters
    ----------
    topic : str
        What it belongs to, such as "packages".
    name : str
        What was looked at.
    value : str
        What is there.
    verdict : str
        "good"; "note": something is missing that not everybody needs; "unknown": it could not be
        seen; "defect": insgnss does not work like this.
    advice : str
        What to do, "" where nothing is to be done.
    """

    topic: str
    name: str
    value: str
    verdict: Verdict = "good"
    advice: str = ""
