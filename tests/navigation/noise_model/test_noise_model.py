"""Noise-model files against the published table and hand-written files."""

import math
from dataclasses import replace

import pytest
from numpy.testing import assert_allclose

from insgnss.base.errors import InputError, UsageError
from insgnss.navigation.noise_model.model import (
    AxisNoise,
    GaussMarkov,
    NoiseModel,
    load_noise_model,
    shipped_models,
    write_noise_model,
)

DEG_PER_H = math.pi / 180.0 / 3600.0
UG = 9.80665e-6

FILE = """\
name = "made up"
source = "nobody"
[gyro]
turn_on_bias = "100 deg/h"
white_noise = "0.3 deg/sqrt(h)"
quantization = "0.1 arcsec"
[[gyro.gauss_markov]]
correlation_time = "2 min"
sigma = "20 deg/h"
[gyro.z]
white_noise = "0.6 deg/sqrt(h)"
[[gyro.z.gauss_markov]]
correlation_time = "50 s"
driving_noise = "4 deg/h/s/sqrt(Hz)"
[[gyro.z.gauss_markov]]
correlation_time = "500 s"
driving_noise = "2 deg/h/s/sqrt(Hz)"
[accel]
white_noise = "51.514 \u00b5g/sqrt(Hz)"
drift = "1 ug/s"
random_walk = "3 ug/s/sqrt(Hz)"
scale_factor = "500 ppm"
misalignment = "1 mrad"
"""


@pytest.fixture
def path(tmp_path):
    file = tmp_path / "imu.toml"
    file.write_text(FILE, encoding="utf-8")
    return file


def test_navchip_is_table_5():
    """Oracle: Table 5 of paper 000 as printed, and its stationary sigmas in the digits of the issue
    (deg/h and micro-g).
    """
    model = load_noise_model("navchip")
    for gyro, accel in zip(model.gyro, model.accel, strict=True):
        assert_allclose(gyro.white_noise / DEG_PER_H, 10.825, rtol=1e-14)
        assert_allclose(accel.white_noise / UG, 51.514, rtol=1e-14)
        assert [p.correlation_time_s for p in gyro.gauss_markov] == [2.5, 72.1, 4737.1]
        assert [p.correlation_time_s for p in accel.gauss_markov] == [45.0, 2060.4]
        assert_allclose(
            [p.sigma / DEG_PER_H for p in gyro.gauss_markov], [19.9, 22.0, 57.8], atol=0.05
        )
        assert_allclose([p.sigma / UG for p in accel.gauss_markov], [31.1, 52.8], atol=0.05)
        assert_allclose(
            [gyro.turn_on_bias / DEG_PER_H, accel.turn_on_bias / UG], [100.0, 2000.0], rtol=1e-14
        )


def test_file_with_one_axis_of_its_own(path):
    """Oracle: the file's numbers, converted by hand; [gyro.z] replaces what it names and keeps the
    rest.
    """
    model = load_noise_model(path)
    x, y, z = model.gyro
    assert (model.name, model.source) == ("made up", "nobody")
    assert x == y
    assert_allclose(
        [x.white_noise, z.white_noise],
        [0.3 * math.pi / 180 / 60, 0.6 * math.pi / 180 / 60],
        rtol=1e-14,
    )
    assert x.turn_on_bias == z.turn_on_bias > 0.0
    assert_allclose(
        x.quantization, 0.1 * DEG_PER_H, rtol=1e-14
    )  # an arcsecond is a degree per hour for a second
    assert_allclose(x.gauss_markov[0].sigma, 20 * DEG_PER_H, rtol=1e-14)
    assert_allclose(
        x.gauss_markov[0].driving_noise, 20 * DEG_PER_H * math.sqrt(2 / 120), rtol=1e-14
    )
    assert [p.correlation_time_s for p in z.gauss_markov] == [50.0, 500.0]
    accel = model.accel[1]
    assert_allclose(
        [accel.drift / UG, accel.random_walk / UG, accel.scale_factor, accel.misalignment],
        [1, 3, 5e-4, 1e-3],
        rtol=1e-14,
    )
    assert accel.gauss_markov == ()


@pytest.mark.parametrize("name", shipped_models())
def test_shipped_models_come_back_from_their_copy(name, tmp_path):
    """Oracle: equality to the last bit after writing and reading; every shipped model says what it
    rests on.
    """
    model = load_noise_model(name)
    write_noise_model(model, tmp_path / "copy.toml")
    assert load_noise_model(tmp_path / "copy.toml") == model
    assert model.name == name
    assert model.source
    assert name == "navchip" or "generic" in model.source


def test_axes_that_differ_come_back(path, tmp_path):
    """Oracle: equality to the last bit, of a model whose axes share only some quantities and whose
    text needs escaping.
    """
    model = replace(load_noise_model(path), name='a "quoted" \\ name', source="two\nlines, \u00b5")
    bare = AxisNoise(white_noise=1.234567890123456e-3)
    rich = replace(bare, drift=1e-7, gauss_markov=(GaussMarkov(33.3, 1e-5), GaussMarkov(1e4, 2e-7)))
    model = replace(model, accel=(bare, rich, AxisNoise()))
    write_noise_model(model, tmp_path / "copy.toml")
    assert load_noise_model(tmp_path / "copy.toml") == model


def test_a_file_is_written_whole_or_not_at_all(tmp_path):
    """Oracle: the directory afterwards; a refused write leaves the old file and no remains."""
    model = load_noise_model("navchip")
    target = tmp_path / "noise.toml"
    target.mkdir()
    with pytest.raises(UsageError, match="is a directory where a file must be written"):
        write_noise_model(model, target)
    with pytest.raises(UsageError, match="the directory does not exist"):
        write_noise_model(model, tmp_path / "nowhere" / "noise.toml")
    (tmp_path / "file").touch()
    with pytest.raises(UsageError, match="cannot be written"):
        write_noise_model(model, tmp_path / "file" / "noise.toml")
    (tmp_path / "file").unlink()
    assert [p.name for p in tmp_path.iterdir()] == ["noise.toml"]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            '"100 deg/h"',
            '"100"',
            (
                ":4: gyro.turn_on_bias: '100' has no unit; angle time\\^-1 is expected, as in '1"
                " deg/h'"
            ),
        ),
        ('"100 deg/h"', "100", ":4: gyro.turn_on_bias: 100 has no unit"),
        ('"100 deg/h"', '"2 mg"', ":4: gyro.turn_on_bias: '2 mg' is of dimension length"),
        ('"100 deg/h"', '"-1 deg/h"', ":4: gyro.turn_on_bias: '-1 deg/h' is negative"),
        (
            "turn_on_bias",
            "turn_on_bais",
            ":4: gyro.turn_on_bais: unknown key; did you mean 'turn_on_bias'",
        ),
        (
            'source = "nobody"',
            'sauce = "nobody"',
            ":2: sauce: unknown table or key; did you mean 'source'",
        ),
        ('name = "made up"', "name = 3", ":1: name: 3 is a number, expected a text"),
        ("[gyro.z]", "[gyro.w]", ":10: gyro.w: unknown key"),
        ("[accel]", "[acel]", ":18: acel: unknown table or key; did you mean 'accel'"),
        ('"2 min"', '"0 s"', ":8: gyro.gauss_markov.correlation_time: '0 s' must be positive"),
        (
            '"50 s"',
            '"50 m"',
            ":13: gyro.z.gauss_markov.correlation_time: '50 m' is of dimension length; time",
        ),
        (
            '"500 s"',
            '"500 m"',
            ":16: gyro.z.gauss_markov.correlation_time: '500 m' is of dimension length; time",
        ),
        ('sigma = "20 deg/h"', "", ":7: gyro.gauss_markov: a Gauss-Markov process takes"),
        (
            '"20 deg/h"',
            '"20 deg/h"\ndriving_noise = "1 deg/h/s/sqrt(Hz)"',
            ":7: gyro.gauss_markov: a Gauss-Markov process takes",
        ),
        (
            'sigma = "20 deg/h"',
            'sigmas = "20 deg/h"',
            ":9: gyro.gauss_markov.sigmas: unknown key; did you mean 'sigma'",
        ),
        (
            "[[gyro.gauss_markov]]",
            "[gyro.gauss_markov]",
            ":7: gyro.gauss_markov: .*expected \\[\\[gyro.gauss_markov\\]\\] tables",
        ),
        ('white_noise = "51.514 \u00b5g/sqrt(Hz)"', "", ":18: accel.x: white_noise is missing"),
        ('[gyro.z]\nwhite_noise = "0.6 deg/sqrt(h)"', "[gyro]", "not TOML: .*line 10"),
        ('name = "made up"', "name = ", "not TOML: .*line 1"),
    ],
)
def test_wrong_files_are_refused_with_file_and_line(path, old, new, message):
    """Oracle: by contract (design.md 4 and 5): one line that names file, line, key and what is
    expected.
    """
    assert old in FILE
    path.write_text(FILE.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError, match=message) as caught:
        load_noise_model(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_a_table_is_not_a_value_and_must_be_there(path):
    """Oracle: by contract, as above, for a sensor that is no table and for one that is missing."""
    path.write_text('gyro = 5\n[accel]\nwhite_noise = "1 ug/sqrt(Hz)"\n', encoding="utf-8")
    with pytest.raises(InputError, match=":1: gyro: 5 is a number, expected a table"):
        load_noise_model(path)
    path.write_text(FILE[: FILE.index("[accel]")], encoding="utf-8")
    with pytest.raises(InputError, match="table \\[accel\\] is missing"):
        load_noise_model(path)
    path.write_bytes(b"name = '\xff'")
    with pytest.raises(InputError, match="not UTF-8"):
        load_noise_model(path)
    with pytest.raises(
        InputError, match=r"navchp: no such file.*shipped consumer, navchip, tactical"
    ):
        load_noise_model("navchp")


@pytest.mark.parametrize(
    "build",
    [
        lambda: GaussMarkov(0.0, 1.0),
        lambda: GaussMarkov(math.inf, 1.0),
        lambda: GaussMarkov(1.0, -1.0),
        lambda: GaussMarkov(1.0, math.nan),
        lambda: GaussMarkov.from_sigma(0.0, 1.0),
        lambda: AxisNoise(drift=-1e-9),
        lambda: AxisNoise(white_noise=math.nan),
        lambda: NoiseModel("n", "s", (AxisNoise(),) * 2, (AxisNoise(),) * 3),
    ],
)
def test_impossible_parameters_are_refused_at_birth(build):
    """Oracle: by definition; variances are not negative, correlation times positive, axes three."""
    with pytest.raises(InputError):
        build()


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: AxisNoise(white_noise="a"), InputError, "white_noise 'a' must be finite and not"),
        (lambda: AxisNoise(gauss_markov=5), UsageError, "gauss_markov 5: give a tuple of Gauss"),
        (lambda: GaussMarkov("a", 1.0), InputError, "correlation_time 'a' s must be positive"),
        (lambda: NoiseModel("m", "", 5, 5), InputError, "1 gyro axes, expected 3"),
        (
            lambda: NoiseModel.of_alike_axes("m", 5e-5, 6e-4),
            UsageError,
            r"'m': 5e-05 stands for gyro noise; give an AxisNoise, such as AxisNoise\(white_noise",
        ),
    ],
)
def test_what_is_no_noise_is_refused_at_construction(make, error, message):
    """Oracle: a value of another kind in each."""
    with pytest.raises(error, match=message):
        make()
