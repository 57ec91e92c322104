"""The picture of a recognition."""

import io
from types import SimpleNamespace

import numpy as np
import pytest

from insgnss.report.figures.recognition import _verdict, _window, recognition_picture

WORDS = [f"orientation {k}" for k in range(24)]


def finding(name, value, confidence=0.99):
    return SimpleNamespace(name=name, value=value, confidence=confidence)


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


def size_of(png):
    from PIL import Image

    return Image.open(io.BytesIO(png)).size


def test_picture_is_a_png_of_readable_size():
    """Oracle: the image library; 1200 x 740 points."""
    assert size_of(recognition_picture(curves(), FINDINGS, WORDS, "flight")) == (1200, 740)


@pytest.mark.parametrize(
    "missing",
    [
        ("time", "force_gnss", "force_imu", "turn_gnss", "turn_gyro"),
        ("orientation", "orientation_score"),
        ("lag_s", "lag_score"),
    ],
)
def test_what_is_not_known_leaves_its_place_empty(missing):
    """Oracle: the picture is drawn all the same, of the same size; the recogniser gives no curves
    where nothing fits.
    """
    some = {name: value for name, value in curves().items() if name not in missing}
    assert size_of(recognition_picture(some, FINDINGS, WORDS, "flight")) == (1200, 740)


def test_a_receiver_too_slow_for_a_course_is_drawn():
    """Oracle: the picture is drawn (a course that is never known is not-a-number throughout)."""
    known = curves() | {"turn_gnss": np.full(600, np.nan)}
    assert size_of(recognition_picture(known, FINDINGS, WORDS, "walk")) == (1200, 740)


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
    text = _verdict(FINDINGS)
    assert "x y z point right backward down" in text
    assert "95.0% or more" in text
    assert "not determined: axes" in _verdict((*FINDINGS[:3], finding("axes", "unknown", 0.0)))
