"""What would separate unknowns that are hardly told apart: each advice is tried."""

from dataclasses import replace

import numpy as np
import pytest
from mounted_blocks import Plan, precision_expected

from insgnss.photogrammetry.adjust.aerial import BORESIGHT, CAMERA_LEVER_ARM, EXPOSURE_DELAY, SHIFT
from insgnss.photogrammetry.adjust.separation import REMEDIES_OF_PAIRS, inseparable

OPPOSITE = {"headings_deg": (0.0, 180.0, 0.0, 180.0)}
OPPOSITE_ACROSS = {"headings_deg": (90.0, 270.0, 90.0, 270.0)}
ACROSS = {"headings_deg": (90.0, 90.0, 90.0, 90.0)}
HEIGHTS = {"heights_m": (100.0, 250.0, 100.0, 250.0)}
SPEEDS = {"speeds_mps": (6.0, 18.0, 6.0, 18.0)}
TILTED = {"tilts_deg": (0.0, 45.0, 0.0, -45.0)}
ALL = " of all images"
CENTRE, DECENTRING = ("f", "cx", "cy"), ("f", "cx", "cy", "p1", "p2")
LEVER = Plan(mounting=(CAMERA_LEVER_ARM,), control=6)
SHIFTED = Plan(mounting=(SHIFT,), control=8)
NARROW = Plan(f_px=12000.0, heights_m=(300.0,) * 4, mounting=(BORESIGHT,), control=8)
TURNED = Plan(mounting=(BORESIGHT,), free=DECENTRING, **OPPOSITE)
PORTRAIT = replace(TURNED, portrait=True, f_px=8000.0, heights_m=(200.0, 400.0, 200.0, 400.0))
CLOCK = Plan(mounting=(EXPOSURE_DELAY, SHIFT), free=("f",), control=6)
GROUND = Plan(aerial=False, control=8)
PLAIN = {"free": CENTRE}
CASES = [  # two unknowns, a plan in which they are not told apart, and what is done against it
    ("f", "height" + ALL, GROUND, {"aerial": True}),
    ("f", "height" + ALL, GROUND, TILTED),
    ("f", "height" + ALL, LEVER, HEIGHTS),
    ("f", "lever arm z", LEVER, HEIGHTS),
    ("f", "shift z", SHIFTED, HEIGHTS),
    ("cx", "lever arm x", LEVER, HEIGHTS),
    ("cy", "lever arm y", LEVER, HEIGHTS),
    ("cx", "shift x", SHIFTED, OPPOSITE),
    ("cy", "shift y", SHIFTED, OPPOSITE),
    ("cx", "shift y", replace(SHIFTED, **ACROSS), OPPOSITE_ACROSS),
    ("cy", "shift x", replace(SHIFTED, **ACROSS), OPPOSITE_ACROSS),
    ("time offset", "shift x", CLOCK, OPPOSITE),
    ("time offset", "shift y", replace(CLOCK, **ACROSS), OPPOSITE_ACROSS),
    (
        "time offset",
        "lever arm x",
        replace(LEVER, mounting=(EXPOSURE_DELAY, CAMERA_LEVER_ARM)),
        SPEEDS,
    ),
    ("cx", "bore-sight y", NARROW, {"calibrated_px": 1.0}),
    ("cy", "bore-sight x", NARROW, {"calibrated_px": 1.0}),
    ("cx", "rotation about y" + ALL, NARROW, {"free": ("f",)}),
    ("cy", "rotation about x" + ALL, NARROW, {"free": ("f",)}),
    ("cx", "p1", TURNED, PLAIN),
    ("p1", "bore-sight y", TURNED, PLAIN),
    ("p1", "rotation about y" + ALL, TURNED, PLAIN),
    ("cy", "p2", PORTRAIT, PLAIN),
    ("p2", "bore-sight x", PORTRAIT, PLAIN),
    ("p2", "rotation about x" + ALL, PORTRAIT, PLAIN),
]


def correlated(plan):
    """Pairs beyond 0.9, and their advice."""
    pairs = inseparable(precision_expected(plan))
    return {
        frozenset(n.replace(" of camera one", "") for n in (p.first, p.second)): p for p in pairs
    }


@pytest.mark.parametrize(("first", "second", "plan", "remedy"), CASES)
def test_the_remedy_separates(first, second, plan, remedy) -> None:
    """Oracle: the covariance of a block that is flown so: the pair is there and has an advice, and
    is no longer there when the advice is followed.
    """
    pair = frozenset((first, second))
    before = correlated(plan)
    assert pair in before
    assert before[pair].remedy
    assert pair not in correlated(replace(plan, **remedy))


def test_every_advice_was_tried() -> None:
    """Oracle: the list of cases; radial parameters have nothing to be done about, and the lever arm
    across the image's x is along the flight where the camera is mounted so.
    """
    tried = {frozenset(n.replace(ALL, "") for n in case[:2]) for case in CASES}
    missing = set(REMEDIES_OF_PAIRS) - tried
    assert missing == {frozenset(("k",)), frozenset(("time offset", "lever arm y"))}


def test_positions_that_are_observed_are_not_asked_for() -> None:
    """Oracle: the pair of camera constant and height of a block with observed positions, whose
    lever arm is an unknown; its advice names what is left to do."""
    pair = frozenset(("f", f"height{ALL}"))
    assert "observe the positions" in correlated(GROUND)[pair].remedy
    assert correlated(LEVER)[pair].remedy.startswith("fly some strips with the camera tilted")


def test_radial_parameters_are_said_to_be_normal() -> None:
    """Oracle: any block that estimates three of them."""
    found = correlated(Plan(free=("f", "k1", "k2", "k3"), control=8))
    pairs = [p for names, p in found.items() if names <= {"k1", "k2", "k3"}]
    assert len(pairs) == 3
    assert all("normal" in p.remedy for p in pairs)


def test_common_motions_have_their_covariance() -> None:
    """Oracle: the covariance of all poses, summed up."""
    precision = precision_expected(replace(LEVER, images=3))
    n = 12
    P = precision.cov(*(("pose", i) for i in range(n)))
    C = precision.result.values.C_mc
    A = np.zeros((6 * n, 3))
    for i in range(n):
        A[6 * i + 2, 0] = 1.0 / n
        A[6 * i + 3 : 6 * i + 6, 1] = C[i, :, 1] / n
        A[6 * i + 3 : 6 * i + 6, 2] = C[i, :, 0] / n
    got = precision.scale * precision.cofactors.common_motions
    assert got == pytest.approx(A.T @ P @ A, rel=1e-8, abs=1e-16)
    f = precision.result.problem.layout.of(("camera", 0))[0][0]
    whole = precision.cov(*(("pose", i) for i in range(n)), ("camera", 0))
    assert precision.cofactors.common[f] == pytest.approx(whole[6 * n, : 6 * n] @ A, rel=1e-8)
