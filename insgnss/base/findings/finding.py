"""The records of a finding and of the question that it answers."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from .remedies import Remedy

Verdict = Literal["ok", "note", "unknown", "contradiction"]


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at, and what was found.

    Parameters
    ----------
    name : str
        Its subject; of a check the name that `accept` of a flight file takes.
    found : str
        What was found, with the number and its unit.
    expected : str
        What was expected, with the limit.
    verdict : str
        "ok"; "note"; "unknown", which could not be seen; or "contradiction", which stops `process`.
    remedy : Remedy
        What to do about it.
    beyond_chance : bool
        False of what a right flight may show as well, by chance.
    rank : float
        How many times it exceeds what a good result shows; below one it is a remark.
    confidence : float
        Probability that it is right; 0 where the data do not determine it.
    evidence : str
        The numbers behind it.
    topic : str
        Which part of what was looked at it belongs to.
    spans_s : tuple of (float, float)
        First and last instant of each time that it concerns, s; empty: all.
    """

    name: str
    found: str
    expected: str = ""
    verdict: Verdict = "ok"
    remedy: Remedy = ""
    beyond_chance: bool = True
    rank: float = 0.0
    confidence: float = 1.0
    evidence: str = ""
    topic: str = ""
    spans_s: tuple[tuple[float, float], ...] = ()

    @property
    def advice(self) -> str:
        """The remedy as the present caller writes it (`base.wording`)."""
        return str(self.remedy)

    @property
    def sentence(self) -> str:
        """What was found and what to do about it in one."""
        return f"{self.found}; {self.advice}" if self.advice else self.found

    @property
    def named_sentence(self) -> str:
        """The same with its subject and what was expected."""
        return f"{self.name}: {self.found}; expected {self.expected}; {self.advice}"

    @property
    def limit(self) -> dict[str, Any]:
        """For machines, as one that limits a result."""
        rank = {"topic": self.name, "rank": self.rank}
        return rank | {"text": self.found, "help": self.advice}

    def as_dict(self) -> dict[str, Any]:
        """Return the finding for machines, as a check."""
        return {
            "name": self.name,
            "found": self.found,
            "expected": self.expected,
            "verdict": self.verdict,
            "advice": self.advice,
            "beyond_chance": self.beyond_chance,
        } | ({"spans_s": self.spans_s} if self.spans_s else {})


def check_lines(findings: Sequence[Finding]) -> list[str]:
    """Return findings for the terminal, those that are not in order with what was expected."""
    marks = {"ok": "ok  ", "note": "note", "unknown": "?   ", "contradiction": "BAD "}
    width = max((len(f.name) for f in findings), default=0)
    lines = []
    for f in findings:
        lines.append(f"{marks[f.verdict]}  {f.name:<{width}}  {f.found}")
        if f.verdict != "ok":
            advice = f"; {f.advice}" if f.advice else ""
            lines.append(f"      {'':<{width}}  expected: {f.expected}{advice}")
    return lines


def ranked(name: str, rank: float, result: str, remedy: Remedy = "") -> Finding:
    """Return what limits a result: its subject, its rank, what was found, and what would help."""
    verdict: Verdict = "contradiction" if rank >= 1.0 else "note"
    return Finding(name, result, verdict=verdict, remedy=remedy, rank=rank)


@dataclass(frozen=True)
class Question:
    """Something to look at, whose answers are findings.

    Parameters
    ----------
    name : str
        The subject.
    expected : str
        What a right answer is, with the limit.
    topic : str
        Which part of what is looked at it belongs to.
    """

    name: str
    expected: str = ""
    topic: str = ""

    def answer(self, result: str, verdict: Verdict, remedy: Remedy = "") -> Finding:
        """Return a finding; of one that is in order the remedy is left out."""
        if verdict == "ok":
            remedy = ""
        return Finding(self.name, result, self.expected, verdict, remedy, topic=self.topic)

    def ok(self, result: str) -> Finding:
        """Return that it is in order."""
        return self.answer(result, "ok")

    def note(self, result: str, remedy: Remedy = "", when: object = True) -> Finding:
        """Return a note; where `when` does not hold, that it is in order."""
        return self.answer(result, "note" if when else "ok", remedy)

    def contradiction(self, result: str, remedy: Remedy = "", when: object = True) -> Finding:
        """Return a contradiction; where `when` does not hold, that it is in order."""
        return self.answer(result, "contradiction" if when else "ok", remedy)

    def against(self, result: str, remedy: Remedy, sure: object) -> Finding:
        """Return a contradiction where the data are sure of it, else a note."""
        return self.answer(result, "contradiction" if sure else "note", remedy)
