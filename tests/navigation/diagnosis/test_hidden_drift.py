"""A drift that larger noise of a whole flight has smoothed over is said."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from insgnss.navigation.diagnosis.drift import hidden_drift
from insgnss.records import Check

NOISE = Check("IMU noise", "times 5", "factors of one", "note", "")


def solution(largest: float, epochs: tuple[int, ...] = (40,)) -> Any:
    """A hundred epochs of a separation of one sigma, some of them `largest` in velocity D."""
    apart = np.full((100, 9), 0.01)
    apart[list(epochs), 5] = 0.01 * largest
    apart[3, 0] = np.nan
    marks = 205000.0 + np.arange(1000.0)
    return SimpleNamespace(
        separation=apart,
        separation_sigma=np.full((100, 9), 0.01),
        separation_epoch=np.arange(0, 1000, 10),
        problem=SimpleNamespace(inc=SimpleNamespace(marks=marks)),
    )


def test_what_larger_noise_hides_is_said():
    """Oracle: the epoch that was changed: 18 sigma at the 40th, 4 after the noise was adopted."""
    check = hidden_drift(solution(18.0), solution(4.0), [NOISE])
    assert check is not None
    assert check.verdict == "note"
    assert "18.0 sigmas in velocity D at TOW 205400.0 s" in check.found


@pytest.mark.parametrize(
    ("before", "adopted"),
    [
        (solution(5.0), solution(1.0)),
        (solution(18.0), solution(9.0)),
        (solution(18.0, tuple(range(30))), solution(1.0)),
    ],
    ids=["nowhere", "still", "throughout"],
)
def test_what_is_not_hidden_or_is_noise_is_not_said(before, adopted):
    """It abstains below 6 sigma, where the report says it, and where a third of a flight is so."""
    assert hidden_drift(before, adopted, [NOISE]) is None
    assert hidden_drift(before, before, [NOISE]) is None


@pytest.mark.parametrize(
    ("before", "adopted", "told"),
    [
        (solution(6.1), solution(5.9), True),
        (solution(5.9), solution(1.0), False),
        (solution(6.1), solution(6.05), False),
        (solution(18.0, tuple(range(20))), solution(1.0), True),
        (solution(18.0, tuple(range(21))), solution(1.0), False),
        (solution(3.1, tuple(range(60))), solution(1.0), False),
    ],
)
def test_where_it_begins_to_be_said(before, adopted, told):
    """Oracle: beyond 6 sigma, in no more than a fifth of the epochs beyond 3."""
    assert (hidden_drift(before, adopted, [NOISE]) is not None) == told


@pytest.mark.parametrize(("usual", "told"), [(2.9, True), (3.1, False)])
def test_what_noise_leaves_now_and_then_is_below_three_sigma(usual, told):
    """Oracle: 30 epochs of a hundred of that size, beside one of 18 sigma."""
    before = solution(usual, tuple(range(30)))
    before.separation[50, 5] = 0.18
    assert (hidden_drift(before, solution(1.0), [NOISE]) is not None) == told


def test_a_constant_explains_it():
    """A time offset disagrees in turns only, and is no drift."""
    offset = Check("GNSS time offset", "5 ms", "0 ms", "note", "")
    assert hidden_drift(solution(18.0), solution(4.0), [offset]) is None
