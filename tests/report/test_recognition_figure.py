"""The charts of a recognition: what they show, and what is left out where it is not known."""

from types import SimpleNamespace

import numpy as np
import pytest

from insgnss.report.figures.recognition import BEST, _window, answers_in_words, recognition_charts

WORDS = [f"orientation {k}" for k in range(24)]


def finding(name, value, confidence=0.99):
    return SimpleNamespace(name=name, found=value, confidence=confidence)


FINDINGS = (
    finding("gyro unit", "rad/s"),
    finding("accelerometer unit", "g"),
    finding("force sign", "specific force"),
    finding("axes", "right backward down", 0.95),
    finding("time offset", "-0.210 s"),
    finding("time scale", "same"),
)


def curves(n=600, lively=300.0):
    """Both sensors see the same motion, most of it in the minute after `lively` s."""
    time = np.arange(float(n))
    motion = np.exp(-(((time - lively - 30.0) / 30.0) ** 2))
    force = np.column_stack([motion * np.sin(time), motion * np.cos(time), -9.8 + motion])
    lag = np.linspace(-30.0, 30.0, 601)
    return {
        "time": 1000.0 + time,
        "force_gnss": force + 0.01,
        "force_imu": force,
        "turn_gnss": np.where(time % 50 < 5, np.nan, 0.2 * motion),
        "turn_gyro": 0.2 * motion,
        "lag_s": lag,
        "lag_score": np.exp(-((lag + 0.21) ** 2)),
        "orientation": np.tile(np.eye(3), (24, 1, 1)),
        "orientation_score": np.linspace(-1.0, 1.0, 24),
    }


def shown(known=None, findings=FINDINGS):
    return {c.name: c for c in recognition_charts(known or curves(), findings, WORDS)}


def test_both_sensors_lie_over_each_other():
    """Oracle: the motion that was put in, in degrees, and 0.01 m/s^2 between the forces."""
    panels = shown()["motion"].panels
    felt, seen = panels[0].layers
    assert (felt.kind, seen.kind) == ("line", "points")
    known = np.isfinite(seen.y)
    assert felt.y[known] == pytest.approx(seen.y[known])
    assert np.abs(felt.y).max() == pytest.approx(np.degrees(0.2), rel=0.01)
    for panel in panels[1:]:
        felt, seen = panel.layers
        assert seen.y - felt.y == pytest.approx(0.01)


def test_the_best_orientations_with_the_one_found():
    """Oracle: the scores that were put in; the best ten, the found one marked where it is sure."""
    chart = shown()["orientations"]
    dots = next(layer for layer in chart.panels[0].layers if layer.kind == "points")
    assert dots.x == pytest.approx(np.linspace(-1.0, 1.0, 24)[-BEST:])
    assert dots.texts[-1] == "orientation 23"
    (found,) = (layer for layer in chart.panels[0].layers if layer.name == "found")
    assert (found.x.tolist(), list(found.texts)) == ([1.0], ["orientation 23"])
    unsure = shown(findings=FINDINGS[:3])["orientations"]
    assert not any(layer.name for layer in unsure.panels[0].layers)
    assert "None is sure" in unsure.reading


def test_the_offset_stands_at_the_summit():
    """Oracle: the offset that was put in, -0.21 s, and the summit of the curve."""
    layers = shown()["clock"].panels[0].layers
    curve, rule, words = layers
    assert curve.x[np.argmax(curve.y)] == pytest.approx(-0.21, abs=0.06)
    assert (rule.x.tolist(), list(words.texts)) == ([-0.21], ["-0.210 s"])


@pytest.mark.parametrize(
    ("missing", "left"),
    [
        (
            ("time", "force_gnss", "force_imu", "turn_gnss", "turn_gyro"),
            ["orientations", "clock"],
        ),
        (("orientation", "orientation_score"), ["motion", "clock"]),
        (("lag_s", "lag_score"), ["motion", "orientations"]),
    ],
)
def test_what_is_not_known_has_no_chart(missing, left):
    """Oracle: by hand; the recogniser gives no curves where nothing fits."""
    some = {name: value for name, value in curves().items() if name not in missing}
    assert list(shown(some)) == left


def test_a_receiver_too_slow_for_a_course_is_told():
    """Oracle: by hand; a course that is never known is not-a-number throughout."""
    assert "too slowly" in shown(curves() | {"turn_gnss": np.full(600, np.nan)})["motion"].reading
    assert "too slowly" not in shown()["motion"].reading


def test_the_liveliest_stretch_is_shown_and_a_wrong_fix_is_not_lively():
    """Oracle: the motion that was put in, at 300 to 360 s; a fix that is off by kilometres, at 50
    s.
    """
    known = curves()
    known["force_gnss"][50] = [1e4, 0.0, 0.0]
    shown = known["time"][_window(known)] - 1000.0
    assert shown[0] <= 310.0 <= 350.0 <= shown[-1]
    assert shown[-1] - shown[0] <= 150.0
    assert not (shown < 60.0).any()


def test_the_verdict_names_what_is_known_and_what_is_not():
    """Oracle: the findings."""
    text = answers_in_words(FINDINGS)
    assert "x y z point right backward down" in text
    assert "95.0% or more" in text
    assert "not determined: axes" in answers_in_words(
        (*FINDINGS[:3], finding("axes", "unknown", 0.0))
    )
