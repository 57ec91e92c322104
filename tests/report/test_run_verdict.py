"""The colour of the bar beside the headline, and the reason in words."""

import numpy as np
import pytest

from insgnss.records import Check, MeanResidual
from insgnss.report.verdict import run_verdict


def test_a_good_flight_says_what_is_good(diagnostics, eo, summary) -> None:
    """Oracle: by hand."""
    verdict, reason = run_verdict(summary(diagnostics(), eo()))
    assert verdict == "good"
    assert "no check found a contradiction" in reason


def test_every_bad_mood_has_the_reason_with_its_number(diagnostics, eo, summary) -> None:
    """Oracle: by hand; what is bad in each of the four ways."""
    against = Check("axes, vertical", "turned by 180 deg", "down", "contradiction", "")
    off = MeanResidual(0.0, 60.0, 600, (0.0, 0.4, 0.0), (0.01, 0.02, 0.03))
    used = np.zeros(1200, dtype=bool)
    cases = {
        "turned by 180 deg (expected: down)": diagnostics(checks=(against,)),
        "no GNSS fix was used": diagnostics(used=used),
        "leaves its own fixes in 1 of 1": diagnostics(residuals=(off,)),
        "2.0 times as large as their sigmas": diagnostics(2.0),
    }
    for words, d in cases.items():
        verdict, reason = run_verdict(summary(d, eo()))
        assert verdict == "bad"
        assert words in reason


def test_a_doubtful_mood_names_what_stands_out(diagnostics, eo, summary) -> None:
    """Oracle: the list of limits; their number of rank one and more, and the first topic."""
    s = summary(diagnostics(0.5), eo(0.31))
    verdict, reason = run_verdict(s)
    standing_out = [limit for limit in s["limits"] if limit["rank"] >= 1.0]
    assert verdict == "doubtful"
    assert reason.startswith(f"{len(standing_out)} figure")
    assert standing_out[0]["topic"] in reason


@pytest.mark.parametrize("scale", [0.5, 1.0, 2.0])
def test_every_reason_ends_without_full_stop(diagnostics, eo, summary, scale: float) -> None:
    """Oracle: the page puts it."""
    assert not run_verdict(summary(diagnostics(scale), eo()))[1].endswith(".")
