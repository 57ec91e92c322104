"""All that `insgnss doctor` looks at, in its order."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ...base.errors import InsgnssError
from ...base.findings import Finding, Question
from .packages import package_findings
from .surroundings import engine_finding, grid_findings, kernel_findings, machine_findings

EXAMINATION_MARKS = {"ok": "ok", "note": "note", "unknown": "?", "contradiction": "WRONG"}
EXAMINATION_WORDS = {"ok": "good", "contradiction": "defect"}  # of the verdicts for machines


@dataclass(frozen=True)
class Examination:
    """What was found.

    Parameters
    ----------
    findings : tuple of Finding
        One a line.
    """

    findings: tuple[Finding, ...]

    @property
    def refusal(self) -> InsgnssError | None:
        """Why insgnss does not work here, with exit code 1; None where it does."""
        wrong = [f"{f.name}: {f.sentence}" for f in self.findings if f.verdict == "contradiction"]
        return InsgnssError("; ".join(wrong)) if wrong else None

    def summary(self) -> str:
        """Return the text for the terminal."""
        width = max(len(f.name) for f in self.findings)
        lines, topic = [], ""
        for f in self.findings:
            if f.topic != topic:
                topic = f.topic
                lines.append(topic)
            lines.append(f"  {EXAMINATION_MARKS[f.verdict]:5} {f.name:{width}}  {f.sentence}")
        count = Counter(f.verdict for f in self.findings)
        result = "does not work here" if self.refusal else "works here"
        last = (
            f"insgnss {result}; {len(self.findings)} lines: {count['ok']} ok, {count['note']} "
            f"notes, {count['unknown']} unknown, {count['contradiction']} wrong"
        )
        return "\n".join([*lines, last])

    def as_dict(self) -> dict[str, Any]:
        """Return the document for machines."""
        return {
            "works": self.refusal is None,
            "findings": [
                {
                    "topic": f.topic,
                    "name": f.name,
                    "value": f.found,
                    "verdict": EXAMINATION_WORDS.get(f.verdict, f.verdict),
                    "advice": f.advice,
                }
                for f in self.findings
            ],
        }


def examine(progress: Callable[[str], None], compiling: bool = False) -> Examination:
    """Look at everything.

    What cannot be loaded is a finding of its own, and the rest is looked at all the same.

    Parameters
    ----------
    progress : callable
        Gets the name of each step.
    compiling : bool
        Compile the kernels of `process` and `demo` ahead, rather than the self-test's alone.

    Returns
    -------
    Examination
        All findings.
    """
    progress("machine")
    findings = machine_findings()
    progress("packages, each imported in another process")
    findings += package_findings()
    if compiling:
        findings += _guarded("kernels", lambda: _compiled(progress))
    progress("compiled kernels; the first compilation takes up to a minute")
    findings += _guarded("kernels", _core)
    progress("grids and engine")
    findings += _guarded("grids", grid_findings)
    findings += _guarded("ppk", lambda: [engine_finding()])
    return Examination(tuple(findings))


def _compiled(progress: Callable[[str], None]) -> list[Finding]:
    """Compile the kernels ahead."""
    from .compiling import compile_all

    return [compile_all(progress)]


def _core() -> list[Finding]:
    """Look at the kernels and run the self-test."""
    from ...navigation.filter.kernels.strapdown import run_strapdown
    from .self_test import self_test

    return [*kernel_findings(run_strapdown), self_test().finding()]


def _guarded(topic: str, look: Callable[[], list[Finding]]) -> list[Finding]:
    """Return what `look` finds, or that it failed, whatever the reason."""
    try:
        return look()
    except Exception as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        advice = "see the packages above; pip install --force-reinstall insgnss"
        return [Question("loading", topic=topic).contradiction(f"fails: {reason}", advice)]
