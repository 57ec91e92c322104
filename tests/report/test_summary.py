"""The figures of merit of a run in closed form, and the sentences on what limits it."""

import json
import math
import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from insgnss.base.files import json_ready
from insgnss.report.rules.verdict import NOTHING_STANDS_OUT
from insgnss.report.rules.wording import degrees, lengths, millimetres
from insgnss.report.summary import MOST_FIXES_LISTED

START = 205200.0


def leaves(value: Any) -> Iterator[Any]:
    if isinstance(value, dict | list):
        for item in value.values() if isinstance(value, dict) else value:
            yield from leaves(item)
    else:
        yield value


def test_figures_are_those_put_in(diagnostics, eo, summary) -> None:
    """Oracle: closed form; sigmas, biases and counts of a run that was made by hand."""
    s = summary(diagnostics(), eo())
    assert s["counts"]["fixes_used"] == s["counts"]["fixes"] == 1200
    assert s["exposures"]["position_mm"]["median"] == pytest.approx([2, 3, 4])
    assert s["exposures"]["attitude_deg"]["max"] == pytest.approx([0.004, 0.003, 0.02])
    assert s["trajectory"]["position_mm"]["median"] == pytest.approx([3, 2, 4])
    assert s["trajectory"]["filter_over_smoothed"]["velocity"] == pytest.approx([3, 3, 3])
    assert s["biases"]["gyro_deg_h"] == pytest.approx([36, -72, 108])
    assert s["biases"]["gyro_sigma_deg_h"] == pytest.approx([9, 9, 9])
    assert s["biases"]["accel_mg"] == pytest.approx([1, -2, 3])
    assert s["biases"]["accel_sigma_mg"] == pytest.approx([0.1, 0.1, 0.1])
    assert s["longest_outage"]["length_s"] == pytest.approx(0.1, abs=1e-6)


def test_white_run_is_consistent_and_has_no_limit(diagnostics, eo, summary) -> None:
    """Oracle: closed form; white innovations and separations of the sigma they claim leave nothing
    to say.
    """
    s = summary(diagnostics(), eo())
    assert s["consistency"]["position"]["verdict"] == "consistent"
    assert s["innovations"]["rms_mm"] == pytest.approx([20, 20, 30], rel=4 / math.sqrt(2 * 1200))
    assert max(abs(r) for r in s["innovations"]["lag1"]) < s["innovations"]["lag1_bound_99"] * 1.5
    for state in s["separation"]["normalised_rms"].values():
        assert state == pytest.approx([1, 1, 1], abs=4 / math.sqrt(2 * 120))
    assert s["verdict"] == [NOTHING_STANDS_OUT]
    assert "2.0 / 3.0 / 4.0 mm (E, N, U), tilt 0.004 deg, heading 0.02 deg" in s["headline"]


@pytest.mark.parametrize(("scale", "word"), [(2.0, "overconfident"), (0.5, "conservative")])
def test_wrong_sigmas_are_said(diagnostics, eo, summary, scale: float, word: str) -> None:
    """Oracle: closed form; innovations twice (half) their sigma."""
    s = summary(diagnostics(scale), eo())
    assert s["consistency"]["position"]["verdict"] == word
    size = s["consistency"]["position"]["size"]
    assert size == pytest.approx(scale, rel=4 * math.sqrt(0.5 / 3600))
    assert len(s["verdict"]) == 1
    assert s["verdict"][0].startswith(f"the GNSS positions scatter {size:.2f} times as much")
    assert ("the images are too small" in s["verdict"][0]) == (word == "overconfident")
    assert ("the images are better than" in s["verdict"][0]) == (word == "conservative")


def test_a_difference_that_only_a_test_can_see_is_no_limit(diagnostics, eo, summary) -> None:
    """Oracle: closed form; sigmas wrong by 10 % are outside the bounds of 1200 fixes, and of no
    matter to their user.
    """
    s = summary(diagnostics(1.1), eo())
    assert s["consistency"]["position"]["verdict"] == "overconfident"
    assert s["verdict"] == [NOTHING_STANDS_OUT]


def test_poor_heading_of_the_first_image_is_said_with_its_reason(diagnostics, eo, summary) -> None:
    """Oracle: by hand; a quarter of the circle, 90 deg, is flown before the first image, nothing
    where heading stands still.
    """
    turned = summary(diagnostics(), eo(0.31))["verdict"]
    assert turned == [
        "heading is known to 0.31 deg at the first image, to 0.02 deg in the median: the turns"
        " before it (90 deg of heading) were too slow or too early; make a turn or a figure of"
        " eight before the first line"
    ]
    straight = summary(diagnostics(rpy=np.zeros((1200, 3))), eo(0.31))["verdict"]
    assert straight == [
        "heading is known to 0.31 deg at the first image, to 0.02 deg in the median: no turn came"
        " before it; make a turn or a figure of eight before the first line"
    ]


def test_lasting_and_biased_innovations_are_said(diagnostics, eo, summary) -> None:
    """Oracle: closed form; a sine of long period in the north, a constant in the down
    innovations.
    """
    d = diagnostics()
    innovation = d.innovation.copy()
    innovation[:, 0] += 0.03 * np.sin(np.arange(1200) / 50)
    innovation[:, 2] += 0.04
    said = summary(diagnostics(innovation=innovation), eo())["verdict"]
    off, lasting = said
    assert off.startswith("the GNSS positions are ")
    assert " mm down off their prediction in the mean" in off
    assert re.search(r"correlate with those of the one before by \+0\.\d+ north \(", lasting)


def test_rejections_outages_and_disagreement_are_said(diagnostics, eo, summary) -> None:
    """Oracle: by hand; 60 of 1200 fixes, 6 s on end, rejected; separation thrice its sigma in all
    states.
    """
    used = np.ones(1200, dtype=bool)
    used[600:660] = False
    d = diagnostics()
    said = " | ".join(summary(diagnostics(used=used, separation=3 * d.separation), eo())["verdict"])
    assert "60 of 1200 fixes (5.0 %)" in said
    assert "no GNSS position was used for 6.1 s from" in said
    told = re.search(r"forward and backward disagree by, in sigmas \(rms\), (.*?):", said)
    assert told is not None
    ratios = {state: float(ratio) for ratio, state in re.findall(r"([\d.]+) in (\w+)", told[1])}
    assert sorted(ratios) == ["attitude", "position", "velocity"]
    assert all(2.8 < ratio < 3.5 for ratio in ratios.values())


def test_list_of_rejected_fixes_is_cut_but_counted(diagnostics, eo, summary) -> None:
    """Oracle: by hand."""
    s = summary(diagnostics(used=np.zeros(1200, dtype=bool)), eo())
    assert s["rejected"]["count"] == 1200
    assert len(s["rejected"]["listed"]) == MOST_FIXES_LISTED
    assert s["rejected"]["listed"][1]["time_s"] == pytest.approx(START + 0.1, abs=1e-6)
    assert "all 1200 fixes were rejected" in s["verdict"][0]


def test_every_case_is_json_without_nan(odd_cases, summary) -> None:
    """Oracle: json; what is written with NaN forbidden and read again is the same."""
    for name, (d, images) in odd_cases.items():
        s = summary(d, images)
        assert json.loads(json.dumps(s, allow_nan=False)) == s, name
        assert all(
            leaf is None or isinstance(leaf, str | int | float | bool) for leaf in leaves(s)
        ), name
        assert s["verdict"], name


def test_json_keeps_numbers_and_drops_what_is_none() -> None:
    """Oracle: by hand."""
    mixed = {
        "a": np.array([1.0, np.nan]),
        2: (np.float64(np.inf), np.int64(3), np.bool_(True), None, "x"),
    }
    assert json_ready(mixed) == {"a": [1.0, None], "2": [None, 3, True, None, "x"]}


def test_numbers_in_sentences() -> None:
    """Oracle: by hand."""
    assert [millimetres(x) for x in (2.34, -0.01, 123.4, 12345.0)] == [
        "2.3 mm",
        "0.0 mm",
        "123 mm",
        "12.3 m",
    ]
    assert [lengths(x) for x in ((2.0, 3.04, 140.0), (2361.0, 900.0, 4476.0))] == [
        "2.0 / 3.0 / 140 mm",
        "2.36 / 0.90 / 4.48 m",
    ]
    assert [degrees(x) for x in (0.0212, 0.31, 33.3)] == ["0.021 deg", "0.31 deg", "33 deg"]
