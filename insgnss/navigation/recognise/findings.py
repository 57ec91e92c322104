"""One property of a recording as the recogniser finds it, and how sure it is."""

from ...records import Finding

MOST_CONFIDENCE = 0.999
"""Probability, at most, that an answer is right: the recogniser is never surer than this."""


def answer(name: str, value: str, confidence: float, evidence: str) -> Finding:
    """Return what is found of a property.

    Parameters
    ----------
    name : str
        The property.
    value : str
        The answer in the words of the flight file; "unknown" stands for it without confidence.
    confidence : float
        Probability that the value is right, 0 to `MOST_CONFIDENCE`; 0 where the data do not
        determine it.
    evidence : str
        The numbers behind it.

    Returns
    -------
    Finding
        Of verdict "ok", or "unknown".
    """
    if not confidence:
        return unknown_property(name, evidence)
    return Finding(name, value, confidence=confidence, evidence=evidence)


def unknown_property(name: str, why: str) -> Finding:
    """Return that the data do not determine a property, with the reason `why`."""
    return Finding(name, "unknown", verdict="unknown", confidence=0.0, evidence=why)
