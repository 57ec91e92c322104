"""Tuning on real sensors. Their recordings are not part of the project; where they are absent the
tests say so and skip.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from insgnss.noise.tuning.options import TuneOptions
from insgnss.noise.tuning.static import tune_static

DATA = Path(__file__).parents[4] / "shared" / "data"
ADIS, VARIANCES = DATA / "adis16405_static", DATA / "imu_variances" / "variances.json"
DEG_H = np.pi / 180.0 / 3600.0
HOW = {"rate_hz": 100.0, "gyro_unit": "0.05 deg/s", "accel_unit": "3.33 mg"}


@pytest.mark.slow
def test_a_disturbed_recording_is_named(tmp_path):
    """Oracle: the recordings' README: the fourth holds a mechanical disturbance, the fifth none."""
    if not ADIS.is_dir():
        pytest.skip("the recordings adis16405_static are not here")
    paths = [ADIS / f"adis_16405_imu{k}.npy" for k in (4, 5)]
    result = tune_static(
        paths, TuneOptions(**HOW, model="WN+GM", levels="7-"), tmp_path / "adis.toml"
    )
    disturbed, quiet = result.recordings
    motion = next(check for check in disturbed.checks if check.name == "motion")
    assert motion.found.startswith("disturbed: shaken at 4045 s")
    robust = next(check for check in disturbed.checks if check.name == "wavelet variances")
    assert robust.advice.startswith("robust variances")
    assert all(curve.robust for curve in disturbed.curves.values())
    assert not any(curve.robust for curve in quiet.curves.values())
    assert "leave the recording out" in motion.advice
    assert (
        next(check.found for check in quiet.checks if check.name == "motion")
        == "at rest throughout"
    )
    assert "accelerometer x, accelerometer y, accelerometer z scatter by" in result.summary()
    for t in result.tuned[
        3:
    ]:  # these accelerometers wander by more than one process, and the test says so
        assert t.goodness.p_value < 1e-6
    table = json.loads((tmp_path / "adis.json").read_text())
    assert {fit["near_stationarity"]["degrees"] for fit in table["fits"]} == {3}


def test_a_real_navchip_from_its_published_variances(tmp_path):
    """Oracle: the issue's figures for gyro y and z, white noise and two Gauss-Markov processes,
    from the scale of a quarter second on.

    Correlation times 2.05 and 1.70 s, 77 and 74 s; driving noise 16.1 and 17.5, 3.7 and 4.0
    deg/h/s/sqrt(Hz), to the digits printed.
    """
    if not VARIANCES.is_file():
        pytest.skip("the variances of imu_variances are not here")
    how = TuneOptions(
        gyro_unit="rad/s",
        accel_unit="m/s^2",
        variable="navchip_wv",
        model="WN+2GM",
        levels="6-",
        weights="diagonal",
    )
    result = tune_static([VARIANCES], how, tmp_path / "navchip.toml")
    for t, expected in zip(
        result.tuned[1:3], ((2.05, 16.1, 77.0, 3.7), (1.70, 17.5, 74.0, 4.0)), strict=True
    ):
        T1, q1, T2, q2 = t.kept.parameters[1:]
        assert_allclose([T1, T2], expected[::2], rtol=0.008)
        assert_allclose([q1 / DEG_H, q2 / DEG_H], expected[1::2], rtol=0.015)
    assert "variances do not determine the turn-on bias" in result.summary()
