"""Published variances: the page's examples, both forms against each other, what must be refused;
real ones where they are at hand.
"""

import copy
import json
import re
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from insgnss.base.errors import InputError, UsageError
from insgnss.io.formats.imu.variances import read_variances
from insgnss.noise.moments.wavelet import wavelet_variance

SPEC = Path(__file__).parents[3] / "data_specs" / "variances.md"
PUBLISHED = Path(__file__).parents[4] / "shared" / "data" / "imu_variances" / "variances.json"
DEG_H = np.pi / 180.0 / 3600.0
UG = 9.80665e-6

HEADER = "# rate_hz = 100\n# samples = 4096\n# axis = accel_z\n"


@pytest.fixture(scope="module")
def curve():
    return wavelet_variance(np.random.default_rng(1).standard_normal(4096), 100.0)


@pytest.fixture
def page():
    found = re.search(r"```json\n(.*?)```", SPEC.read_text(), re.DOTALL)
    assert found is not None
    return json.loads(found[1])


def write(tmp_path, content):
    path = tmp_path / "published"
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


def rows(*columns):
    return "".join(
        ",".join(repr(float(v)) for v in row) + "\n" for row in zip(*columns, strict=True)
    )


def test_text_table_is_the_curve_that_was_written(tmp_path, curve):
    """Oracle: the curve itself, written as wavelet variance and as Allan deviation with and without
    interval.
    """
    tau = curve.averaging_time_s
    tables = {
        "scale_s,wavelet_variance,low,high": (curve.scale_s, curve.variance, curve.low, curve.high),
        "scale_s,variance": (curve.scale_s, curve.variance),
        "tau_s,allan_variance": (tau, 2.0 * curve.variance),
        "tau,adev": (tau, np.sqrt(2.0 * curve.variance)),
        "tau_s,deviation,low,high": (
            tau,
            *(np.sqrt(2.0 * x) for x in (curve.variance, curve.low, curve.high)),
        ),
    }
    for header, columns in tables.items():
        got = read_variances(write(tmp_path, f"{HEADER}{header}\n{rows(*columns)}")).curves[
            "accel_z"
        ]
        assert got.level.tolist() == curve.level.tolist()
        assert got.count.tolist() == curve.count.tolist()
        for name in ("variance", "low", "high"):
            assert_allclose(getattr(got, name), getattr(curve, name), rtol=1e-12)


def test_axes_stand_in_a_column_and_units_in_comments(tmp_path):
    """Oracle: 1 deg/h and 1 ug in SI."""
    text = (
        "# rate_hz: 250\n# samples: 1000\n# gyro_unit: deg/h\n# accel_unit: ug\n# sensor:"
        " demo\naxis,tau_s,allan_deviation\n"
    )
    path = write(tmp_path, text + "gyro_x,0.004,3\ngyro_x,0.008,2\naccel_y,0.004,5\n")
    got = read_variances(path)
    assert got.sensor == "demo"
    assert list(got.curves) == ["gyro_x", "accel_y"]
    assert_allclose(
        got.curves["gyro_x"].variance, 0.5 * (np.array([3.0, 2.0]) * DEG_H) ** 2, rtol=1e-14
    )
    assert_allclose(got.curves["accel_y"].variance, 0.5 * (5.0 * UG) ** 2, rtol=1e-14)
    got = read_variances(path, units={"gyro": "rad/s"}, samples=500)
    assert_allclose(got.curves["gyro_x"].variance, [4.5, 2.0], rtol=1e-14)
    assert got.curves["gyro_x"].count.tolist() == [499, 497]


def test_rounded_scales_are_taken(tmp_path):
    """Oracle: powers of two of 4 ms, printed with three digits."""
    text = (
        "# rate_hz = 250\n# samples = 100000\n# axis ="
        " gyro_x\ntau_s,deviation\n0.004,3\n1.02,1\n65.5,2\n"
    )
    assert read_variances(write(tmp_path, text)).curves["gyro_x"].level.tolist() == [1, 9, 15]


def test_json_page(tmp_path, page):
    """Oracle: the page's numbers, plain, as a member, and in lists, as R's JSON has them."""
    lists = {**page, "freq": [100.0], "n": [1000000], "sensor": ["demo"]}
    for content, member in (
        (page, None),
        ({"a": {"a": lists}, "b": {"b": lists}}, "b"),
        ({"only": lists}, None),
    ):
        got = read_variances(write(tmp_path, content), member=member)
        assert got.sensor == "demo"
        assert list(got.curves) == ["gyro_x"]
        assert got.curves["gyro_x"].variance.tolist() == [0.0509178, 0.0331453]
        assert got.curves["gyro_x"].high.tolist() == [0.0511180, 0.0333298]
    got = read_variances(write(tmp_path, page), units={"gyro": "deg/s"})
    assert_allclose(
        got.curves["gyro_x"].low, np.array([0.0507188, 0.0329623]) * (3600 * DEG_H) ** 2, rtol=1e-14
    )


def test_json_of_allan_variances(tmp_path, page):
    """Oracle: half the Allan variance over the averaging time, with the interval that a table
    without interval gets.
    """
    del page["wvar"]
    page["avar"] = {
        "Gyro. X": {
            "levels": [0.02, 0.04],
            "allan": [0.06, 0.03],
            "adev": [9, 9],
            "lci": [9, 9],
            "uci": [9, 9],
            "type": ["mo"],
        }
    }
    got = read_variances(write(tmp_path, page)).curves["gyro_x"]
    text = (
        "# rate_hz = 100\n# samples = 1000000\n# axis ="
        " gyro_x\ntau_s,allan_variance\n0.02,0.06\n0.04,0.03\n"
    )
    table = read_variances(write(tmp_path, text)).curves["gyro_x"]
    assert got.level.tolist() == [2, 3]
    for name in ("variance", "low", "high"):
        assert getattr(got, name).tolist() == getattr(table, name).tolist()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("tau_s,variance\n0.01,1\n", ":4: 'variance' beside tau_s may be a wavelet or Allan"),
        ("tau_s,power\n0.01,1\n", "the header must name"),
        ("0.01,1\n0.02,0.5\n", "no header"),
        ("scale_s,tau_s,deviation\n0.02,0.01,1\n", "one column of scale_s, tau_s"),
        ("tau_s,deviation,low\n0.01,1,0.9\n", "only one end"),
        (
            "tau_s,deviation\n0.01,1\n0.05,1\n",
            ":6: scale 0.1 s is 10 samples of 100 Hz; only scales of 2, 4, 8",
        ),
        ("scale_s,variance\n0.01,1\n", "scale 0.01 s is 1 samples"),
        ("tau_s,deviation\n0.02,1\n0.01,1\n", ":6: scale 0.02 s follows 0.04 s"),
        ("tau_s,deviation\n0.02,1\n-0.02,1\n", ":6: scale -0.04 s"),
        (
            "tau_s,deviation\n0.01,1\n81.92,1\n",
            ":6: scale 163.84 s is longer than 4096 samples",
        ),
        ("tau_s,deviation\n0.01,-1\n", ":5: variance -0.5"),
        (
            "tau_s,deviation,low,high\n0.01,1,1.1,1.2\n",
            ":5: the confidence interval at scale 0.02 s",
        ),
        ("tau_s,deviation\n0.01,one\n", ":5: 'one' where a finite number"),
        ("axis,tau_s,deviation\nyaw,0.01,1\n", ":5: axis 'yaw' is unknown; write gyro_x"),
    ],
)
def test_wrong_tables_are_refused_with_their_line(tmp_path, text, words):
    """Oracle: the line that was spoiled, counted by hand."""
    with pytest.raises(InputError, match=re.escape(words)) as refusal:
        read_variances(write(tmp_path, HEADER + text))
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("# samples = 99\n# axis = gyro_x\n", "rate_hz is not stated"),
        ("# rate_hz = 99\n# axis = gyro_x\n", "samples is not stated"),
        ("# rate_hz = 99\n# samples = 99\n", "axis is not stated"),
        (
            "# rate_hz = 0\n# samples = 99\n# axis = gyro_x\n",
            ":1: rate_hz 0; it must be greater than zero",
        ),
        ("# rate_hz = fast\n# samples = 99\n# axis = gyro_x\n", ":1: 'fast' where a finite number"),
        ("# rate_hz = 99\n# samples = 99\n# axis = up\n", ":3: axis 'up'"),
        (
            "# rate_hz = 99\n# samples = 99\n# axis = gyro_x\n# unit = mg\n",
            ":4: unit of gyro: 'mg' is none of rad/s",
        ),
    ],
)
def test_wrong_comments_are_refused(tmp_path, text, words):
    """Oracle: the comment that was spoiled or left out."""
    with pytest.raises(InputError, match=re.escape(words)):
        read_variances(write(tmp_path, text + "tau_s,deviation\n0.0101,1\n"))


SPOILED = {
    "freq and n": ({"freq": 0}, "freq 0 and n"),
    "n": ({"n": None}, "n 'null'; finite numbers"),
    "type": ({"type": ["Gyroscope", "Gyroscope"]}, "must name the same axes"),
    "axis": ({"axis": ["Q"]}, "axis 'Gyroscope Q'"),
    "kind": ({"type": [1]}, "type '[1]'; text is expected"),
    "curve": ({"wvar": {"Gyro. X": 3}}, "its curve is no JSON object"),
}


@pytest.mark.parametrize("name", SPOILED)
def test_wrong_json_is_refused(tmp_path, page, name):
    """Oracle: the entry that was spoiled."""
    change, words = SPOILED[name]
    with pytest.raises(InputError, match=re.escape(words)):
        read_variances(write(tmp_path, page | change))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"variance": [0.05]}, "have 2, 1, 2, 2 values"),
        ({"variance": [0.05, float("nan")]}, "finite numbers are expected"),
        ({"variance": [0.05, 10**309]}, "finite numbers are expected"),
        ({"variance": [0.0509, 0.5]}, "the confidence interval at scale 0.04 s"),
        ({"scales": [0.02, 0.05]}, "scale 0.05 s is 5 samples"),
        ({"alpha": [0.1]}, "intervals of 90 %"),
        ({"decomp": ["dwt"]}, "decomp 'dwt'; only 'modwt'"),
        ({"filter": "d4"}, "filter 'd4'; only 'haar'"),
        ({"ci_low": None}, "ci_low 'null'; finite"),
    ],
)
def test_wrong_curves_are_refused(tmp_path, page, change, words):
    """Oracle: the entry that was spoiled; the message names the curve."""
    content = copy.deepcopy(page)
    content["wvar"]["Gyro. X"] |= change
    with pytest.raises(InputError, match=re.escape(words)) as refusal:
        read_variances(write(tmp_path, content))
    assert "Gyro. X: " in str(refusal.value)


def test_wrong_use_is_told(tmp_path, page):
    """Oracle: the names that are there."""
    with pytest.raises(UsageError, match="several members; set member to one of a, b"):
        read_variances(write(tmp_path, {"a": page, "b": page}))
    with pytest.raises(UsageError, match="no member 'c'; set member to one of a, b"):
        read_variances(write(tmp_path, {"a": page, "b": page}), member="c")
    with pytest.raises(UsageError, match="no member 'c'"):
        read_variances(write(tmp_path, page), member="c")
    with pytest.raises(UsageError, match="only JSON files have members"):
        read_variances(write(tmp_path, HEADER + "tau_s,deviation\n0.01,1\n"), member="c")
    with pytest.raises(UsageError, match="none of gyro, accel"):
        read_variances(write(tmp_path, page), units={"mag": "T"})
    with pytest.raises(InputError, match="2: is no JSON"):
        read_variances(write(tmp_path, '{"a":\n}'))
    with pytest.raises(InputError, match="an object with wvar or avar"):
        read_variances(write(tmp_path, "[1, 2]"))


def test_real_published_variances():
    """Oracle: the file's own numbers; its Allan variances are twice its wavelet variances to their
    last term.
    """
    if not PUBLISHED.is_file():
        pytest.skip("the published variances of real IMUs are not here")
    for member in json.loads(PUBLISHED.read_text()):
        got = read_variances(PUBLISHED, member=member)
        assert len(got.curves) in (3, 6)
    wavelet, allan = (read_variances(PUBLISHED, member=f"navchip_{kind}") for kind in ("wv", "av"))
    assert wavelet.sensor == "NAVCHIP_FLT"
    for axis, curve in wavelet.curves.items():
        assert (curve.rate_hz, curve.samples, curve.level.tolist()) == (
            250.0,
            3105250,
            list(range(1, 21)),
        )
        assert_allclose(allan.curves[axis].variance[:15], curve.variance[1:16], rtol=1e-2)
    assert wavelet.curves["gyro_x"].variance[0] == 2.6547275557064194e-06
