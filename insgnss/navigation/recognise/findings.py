"""One property of a recording as the recogniser finds it, and how sure it is."""

from dataclasses import dataclass


@dataclass(frozen=True, eq=False)
class Finding:
    """One answer of the recogniser.

    Parameters
    ----------
    name : str
        The property, one of `NAMES`.
    value : str
        The answer in the words of the flight file, or "unknown".
    confidence : float
        Probability that the value is right, 0 to `MOST`; 0 where the data do not determine it.
    evidence : str
        The numbers behind it, in plain words.
    """

    name: str
    value: str
    confidence: float
    evidence: str


MOST = 0.999
"""The recogniser is never surer than this."""

NAMES = (
    "quantity",
    "accelerometer unit",
    "gyro unit",
    "gyro triad",
    "force sign",
    "vertical axis",
    "forward axis",
    "axes",
    "time offset",
    "time scale",
)
"""Of all findings, in their order in `Recognition.findings`."""
