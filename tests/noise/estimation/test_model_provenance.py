"""What a noise-model file says of its own making: recordings and standard errors."""

from dataclasses import replace

import pytest
from numpy.testing import assert_allclose

from insgnss.base.errors import InputError
from insgnss.navigation.noise_model.model import (
    AxisNoise,
    GaussMarkov,
    NoiseModel,
    RecordingSource,
    load_noise_model,
    weighted_model,
    write_noise_model,
)

DEG_H = 3.141592653589793 / 180.0 / 3600.0
UG = 9.80665e-6

FILE = """\
name = "made up"
[[recording]]
file = "one.npy"
sha256 = "00ff"
samples = 1000
sampling_rate = "0.25 1/ms"
[gyro]
white_noise = "10 deg/h/sqrt(Hz)"
standard_error = { white_noise = "0.02 deg/h/sqrt(Hz)" }
[[gyro.gauss_markov]]
correlation_time = "2.5 s"
driving_noise = "18 deg/h/s/sqrt(Hz)"
standard_error = { correlation_time = "0.1 s", driving_noise = "0.3 deg/h/s/sqrt(Hz)" }
[gyro.y]
white_noise = "11 deg/h/sqrt(Hz)"
[gyro.z]
[[gyro.z.gauss_markov]]
correlation_time = "70 s"
driving_noise = "4 deg/h/s/sqrt(Hz)"
[accel]
white_noise = "50 ug/sqrt(Hz)"
"""


@pytest.fixture
def path(tmp_path):
    file = tmp_path / "imu.toml"
    file.write_text(FILE, encoding="utf-8")
    return file


def test_what_the_file_says_of_its_making(path):
    """Oracle: the file's numbers, converted by hand; what an axis gives anew loses the error of the
    value it replaces.
    """
    model = load_noise_model(path)
    assert model.recordings == (RecordingSource("one.npy", "00ff", 1000, 250.0),)
    x, y, z = (dict(axis.standard_error) for axis in model.gyro)
    assert set(x) == {"white_noise", "correlation_time_1", "driving_noise_1"}
    assert_allclose(
        [x["white_noise"] / DEG_H, x["correlation_time_1"], x["driving_noise_1"] / DEG_H],
        [0.02, 0.1, 0.3],
        rtol=1e-12,
    )
    assert set(y) == {"correlation_time_1", "driving_noise_1"}
    assert set(z) == {"white_noise"}
    assert model.accel[0].standard_error == ()


def test_a_model_with_its_making_comes_back(path, tmp_path):
    """Oracle: equality to the last bit, where axes share values but not errors, with comments
    above.
    """
    model = load_noise_model(path)
    alike = replace(model.gyro[0], standard_error={"white_noise": 3e-9, "driving_noise_1": 1e-7})
    twice = AxisNoise(
        1e-4,
        gauss_markov=(GaussMarkov(3.0, 1e-5), GaussMarkov(60.0, 1e-6)),
        standard_error={"correlation_time_2": 2.0},
    )
    model = replace(
        model,
        gyro=(model.gyro[0], alike, twice),
        recordings=(*model.recordings, RecordingSource('b "2".csv', "aa", 7, 99.9)),
    )
    for triad in (model.gyro, (twice, twice, twice)):
        same = replace(model, gyro=triad)
        write_noise_model(same, tmp_path / "copy.toml", ["a remark " * 30, "and = 1"])
        assert load_noise_model(tmp_path / "copy.toml") == same
    text = (tmp_path / "copy.toml").read_text()
    assert text.startswith("# a remark")
    assert max(map(len, text.splitlines())) < 140
    assert text.count("[[gyro.gauss_markov]]") == 2  # the three alike: written once


def test_combined_models_keep_their_recordings(path):
    """Oracle: by definition; a recording that serves both stands once."""
    model = load_noise_model(path)
    other = replace(model, recordings=(RecordingSource("two.npy", "01", 5, 100.0),))
    assert [
        r.file for r in weighted_model([model, model, other], [(1 / 3, 1 / 3)] * 3).recordings
    ] == ["one.npy", "two.npy"]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[[recording]]", "[recording]", ":2: recording: .*expected \\[\\[recording\\]\\] tables"),
        ('"0.25 1/ms"', '"4 ms"', ":6: recording.sampling_rate: '4 ms' is of dimension time"),
        ('"0.25 1/ms"', "250", ":6: recording.sampling_rate: 250 has no unit"),
        (
            "samples = 1000",
            'samples = "1000"',
            ":5: recording.samples: '1000' is a text, expected a number",
        ),
        (
            'sha256 = "00ff"',
            'sha = "00ff"',
            ":4: recording.sha: unknown key; did you mean 'sha256'",
        ),
        ('sha256 = "00ff"\n', "", ":2: recording.sha256: is missing; it has no default"),
        (
            '{ white_noise = "0.02 deg/h/sqrt(Hz)" }',
            '"0.02 deg/h/sqrt(Hz)"',
            ":9: gyro.standard_error: '0.02 deg/h/sqrt\\(Hz\\)' is a text, expected a table",
        ),
        ('"0.02 deg/h/sqrt(Hz)"', "0.02", ":9: gyro.standard_error.white_noise: 0.02 has no unit"),
        (
            '{ white_noise = "0.02',
            '{ wite_noise = "0.02',
            ":9: gyro.standard_error.wite_noise: unknown key; did you mean 'white_noise'",
        ),
        (
            '{ correlation_time = "0.1 s",',
            '{ sigma = "0.1 s",',
            ":13: gyro.gauss_markov.standard_error.sigma: unknown key",
        ),
        (
            '"0.1 s"',
            '"-0.1 s"',
            ":13: gyro.gauss_markov.standard_error.correlation_time: '-0.1 s' is negative",
        ),
    ],
)
def test_wrong_provenance_is_refused_with_file_and_line(path, old, new, message):
    """Oracle: by contract (design.md 4 and 5), one line that names file, line, key and what is
    expected.
    """
    assert old in FILE
    path.write_text(FILE.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError, match=message):
        load_noise_model(path)


@pytest.mark.parametrize(
    "errors",
    [
        {"driving_noise_1": 1.0},
        {"white_noise": -1.0},
        {"white_noise": float("nan")},
        {"colour": 1.0},
    ],
)
def test_impossible_standard_errors_are_refused_at_birth(errors):
    """Oracle: by definition; an error is of a parameter that is there, finite and not negative."""
    with pytest.raises(InputError, match="standard_error"):
        AxisNoise(white_noise=1.0, standard_error=errors)


def test_three_axes_are_three():
    """Oracle: by definition."""
    with pytest.raises(InputError, match="expected 3"):
        NoiseModel("n", "s", (AxisNoise(),) * 3, (AxisNoise(),) * 2)
