"""The calibration file, and what it does to samples."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from insgnss.base.errors import InputError
from insgnss.navigation.prepare.calibration import (
    ImuCalibration,
    TriadCalibration,
    load_calibration,
    write_calibration,
)
from insgnss.records import ImuSamples

SPEC = Path(__file__).parents[3] / "data_specs" / "imu_calibration.md"
EXAMPLE, BAD, MESSAGE = (
    re.search(rf"```{kind}\n(.*?)```", SPEC.read_text(), re.DOTALL)[1]
    for kind in ("true", "bad", "message")
)


def written(tmp_path, text):
    path = tmp_path / "calibration.toml"
    path.write_text(text)
    return path


def test_the_page_of_the_format_is_read_and_its_bad_line_refused(tmp_path):
    """Oracle: the numbers of the page, converted by hand: 12.5 deg/h = 6.0602e-5 rad/s, 3.1 mg =
    0.030400615 m/s^2.
    """
    got = load_calibration(written(tmp_path, EXAMPLE))
    assert got.gyro.bias[0] == pytest.approx(12.5 * np.pi / 180.0 / 3600.0, rel=1e-14)
    assert got.accel.bias[0] == pytest.approx(0.030400615, rel=1e-12)
    np.testing.assert_allclose(
        got.gyro.response,
        [[1.00085, 0.0004, -0.0011], [0.0002, 0.9988, 0.0009], [-0.0003, 0.0001, 1.0003]],
        rtol=0,
        atol=1e-15,
    )
    np.testing.assert_allclose(
        got.accel.matrix,
        [[1.001, 0, 0], [0.0004, 0.9985, 0], [-0.0002, 0.0007, 1.0003]],
        rtol=0,
        atol=1e-15,
    )
    with pytest.raises(InputError) as refusal:
        load_calibration(written(tmp_path, BAD))
    assert MESSAGE.strip() in str(refusal.value)


@pytest.mark.parametrize("quantity", ["mean_rate", "increments", "instant_rate"])
def test_what_the_sensor_did_is_undone(quantity):
    """Oracle: the error model (C.1) applied by hand to a known signal, scaled by each sample's own
    interval for increments.
    """
    rng = np.random.default_rng(4)
    time = 10.0 + np.cumsum(np.full(50, 0.01) + rng.uniform(-1e-3, 1e-3, 50))
    time[30:] += 2.0  # after a gap an increment is still over one interval
    dt = np.diff(time, prepend=time[0] - np.median(np.diff(time)))
    dt[30] = np.median(np.diff(time))
    truth = rng.normal(size=(2, 50, 3))
    triads = [
        TriadCalibration(rng.normal(size=3) * 0.1, np.eye(3) + rng.uniform(-0.03, 0.03, (3, 3)))
        for _ in range(2)
    ]
    scale = dt[:, None] if quantity == "increments" else 1.0
    raw = [(v @ c.response.T + c.bias) * scale for v, c in zip(truth, triads, strict=True)]
    got = ImuCalibration(*triads).apply(ImuSamples(time, *raw, quantity))
    np.testing.assert_allclose(got.gyro, truth[0] * scale, rtol=0, atol=1e-13)
    np.testing.assert_allclose(got.accel, truth[1] * scale, rtol=0, atol=1e-13)
    assert got.quantity == quantity
    assert "applied" in got.notes[-1].found


def test_three_misalignments_are_the_lower_triangle(tmp_path):
    """Oracle: the page: N_yx, N_zx, N_zy."""
    got = load_calibration(
        written(tmp_path, '[accel]\nmisalignment = ["1 mrad", "2 mrad", "3 mrad"]\n')
    )
    np.testing.assert_allclose(
        got.accel.response, [[1, 0, 0], [0.001, 1, 0], [0.002, 0.003, 1]], rtol=0, atol=1e-16
    )
    np.testing.assert_array_equal(got.gyro.response, np.eye(3))


def test_written_and_read_again(tmp_path):
    """Oracle: round trip of random calibrations, exact to a unit in the last place of one."""
    rng = np.random.default_rng(5)
    for full in (True, False):
        E = np.eye(3) + rng.uniform(-0.05, 0.05, (3, 3)) * (1.0 if full else np.tri(3))
        triad = TriadCalibration(
            rng.normal(size=3) * 0.1, E, rng.uniform(0, 1e-3, 3), rng.uniform(0, 1e-3, (3, 3))
        )
        given = ImuCalibration(
            triad, replace(triad, bias_sigma=None, response_sigma=None), 'unit "7"', "a\\b"
        )
        write_calibration(given, tmp_path / "c.toml", ("made by a test",))
        got = load_calibration(tmp_path / "c.toml")
        assert (got.name, got.source) == (given.name, given.source)
        np.testing.assert_array_equal(got.gyro.bias, triad.bias)
        np.testing.assert_allclose(got.gyro.response, E, rtol=0, atol=3e-16)
        np.testing.assert_allclose(got.accel.response, E, rtol=0, atol=3e-16)
        np.testing.assert_array_equal(got.gyro.response_sigma, triad.response_sigma)
        assert got.accel.bias_sigma is None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            '[gyro]\nbias = ["1 deg/h", "2", "3 deg/h"]',
            r"calibration.toml:2: gyro.bias: '2' has no unit",
        ),
        ("[gyro]\nbias = [1.0, 2.0, 3.0]", r":2: gyro.bias: 1.0 has no unit"),
        ('[accel]\nbias = ["1 mg", "2 mg"]', r":2: accel.bias: 2 values, expected 3"),
        (
            '[accel]\nscalefactor = ["1 ppm"]',
            r":2: accel.scalefactor: unknown key; did you mean 'scale_factor'",
        ),
        (
            '[accelerometer]\nbias = ["1 mg", "1 mg", "1 mg"]',
            r":1: accelerometer: unknown table or key",
        ),
        (
            '[gyro]\nmisalignment = ["1 mrad", "2 mrad", "3 mrad", "4 mrad"]',
            r":2: gyro.misalignment: 4 values, expected 3 or 6",
        ),
        (
            "\n[accel]\nmatrix = [[0,1,0],[1,0,0],[0,0,-1]]",
            r":3: accel.matrix: differs from identity by 200 %",
        ),
        ("[accel]\nmatrix = [[1,0,0],[0,1,0]]", r":2: accel.matrix: .*expected 3 rows of 3"),
        (
            '[accel]\nmatrix = [[1,0,0],[0,1,0],[0,0,1]]\nscale_factor = ["1 ppm","1 ppm","1 ppm"]',
            r":2: accel.matrix: is given with scale_factor, which it replaces",
        ),
        (
            '[accel]\nscale_factor = ["12 %", "0 %", "0 %"]',
            r":2: accel.scale_factor: differs from identity by 12 %",
        ),
        (
            '[gyro]\nbias = ["30 deg/s", "0 deg/s", "0 deg/s"]',
            r":2: gyro.bias: 0.524 is beyond 0.349 rad/s; check the unit",
        ),
        ('[accel]\nbias = ["1 g", "0 g", "0 g"]', r":2: accel.bias: 9.81 is beyond 5 m/s\^2"),
        ("name = x y\n", r":1: not TOML"),
    ],
)
def test_what_is_no_calibration_is_refused_by_line(tmp_path, text, message):
    """Oracle: the page of the format."""
    with pytest.raises(InputError, match=message):
        load_calibration(written(tmp_path, text))


def test_a_missing_file_and_an_impossible_calibration_are_refused(tmp_path):
    """Oracle: the house rule."""
    with pytest.raises(InputError, match="does not exist"):
        load_calibration(tmp_path / "none.toml")
    with pytest.raises(InputError, match="differs from identity by 50 %"):
        ImuCalibration(accel=TriadCalibration(response=1.5 * np.eye(3)))
    with pytest.raises(InputError, match="not finite"):
        ImuCalibration(gyro=TriadCalibration(bias=np.array([np.nan, 0, 0])))


@pytest.mark.parametrize(
    ("sensor", "least", "beyond", "message"),
    [
        ("gyro", np.radians(19.9), np.radians(20.1), "bias: 0.351 is beyond 0.349 rad/s"),
        ("accel", 4.95, 5.05, r"bias: 5.05 is beyond 5 m/s\^2"),
    ],
)
def test_biases_and_responses_that_no_imu_has(sensor, least, beyond, message):
    """Oracle: 20 deg/s, 5 m/s^2, and a tenth of the matrix, a little less and a little more."""
    for axis, sign in ((0, 1.0), (2, -1.0)):
        unit = sign * np.eye(3)[axis]
        ImuCalibration(**{sensor: TriadCalibration(bias=least * unit)})
        with pytest.raises(InputError, match=message):
            ImuCalibration(**{sensor: TriadCalibration(bias=beyond * unit)})
    off = np.zeros((3, 3))
    off[0, 1] = -1.0
    ImuCalibration(**{sensor: TriadCalibration(response=np.eye(3) + 0.099 * off)})
    with pytest.raises(InputError, match="differs from identity by 10 %"):
        ImuCalibration(**{sensor: TriadCalibration(response=np.eye(3) + 0.101 * off)})
