"""A noise model for other estimators: the rule, and the files that they read."""

import math
from pathlib import Path

import numpy as np
import pytest

from insgnss.base.errors import DataError, UsageError
from insgnss.cli import main
from insgnss.navigation.noise_model.model import (
    AxisNoise,
    GaussMarkov,
    NoiseModel,
    load_noise_model,
)
from insgnss.noise.processes.consumers import (
    CONSUMER_FORMS,
    gauss_markov_allan,
    random_walk_of,
    text_for,
    white_and_walk,
)
from insgnss.noise.processes.realisation import simulate_noise

AXIS = AxisNoise(
    white_noise=1e-4,
    quantization=2e-6,
    random_walk=3e-6,
    gauss_markov=(GaussMarkov.from_sigma(0.3, 2e-4), GaussMarkov.from_sigma(40.0, 1e-4)),
)


@pytest.mark.parametrize("cluster_s", [0.5, 4.0, 60.0])
def test_the_allan_variance_stays_at_the_cluster_time(cluster_s: float) -> None:
    """Oracle: allantools on simulated samples of the model, whose Allan deviation the two numbers
    give by IEEE Std 952: within four standard deviations of the estimate.
    """
    allantools = pytest.importorskip("allantools")
    rate, n = 20.0, 60_000
    x = simulate_noise(AXIS, n, 1.0 / rate, np.random.default_rng(5))
    _, deviation, _, _ = allantools.oadev(x, rate=rate, data_type="freq", taus=[cluster_s])
    white, walk = white_and_walk(AXIS, cluster_s)
    expected = math.sqrt(white**2 / cluster_s + walk**2 * cluster_s / 3.0)
    spread = math.sqrt(cluster_s * rate / n)  # of an overlapping estimate, roughly
    assert deviation[0] == pytest.approx(expected, rel=max(0.02, 3.0 * spread))


@pytest.mark.parametrize("x", [1e-6, 0.009999, 0.010001, 0.5, 1.8926, 3.0, 50.0])
def test_the_allan_variance_of_a_gauss_markov_process(x: float) -> None:
    """Oracle: the double integral of the autocovariance, by the midpoint rule."""
    n = 400
    t = (np.arange(n) + 0.5) / n * x
    within = np.exp(-np.abs(t[:, None] - t)).mean()
    between = np.exp(-np.abs(t[:, None] - (t + x))).mean()
    assert gauss_markov_allan(x) == pytest.approx(within - between, rel=2e-3, abs=2e-5 * x)


def test_each_process_goes_where_its_allan_variance_does() -> None:
    """Oracle: by hand: a slow process walks by its driving noise, a fast one is white of q tau."""
    slow = AxisNoise(white_noise=1e-4, gauss_markov=(GaussMarkov(1e5, 2e-6),))
    assert white_and_walk(slow, 10.0) == pytest.approx((1e-4, 2e-6), rel=1e-3)
    fast = AxisNoise(random_walk=1e-6, gauss_markov=(GaussMarkov(1e-3, 0.2),))
    assert white_and_walk(fast, 10.0) == pytest.approx((2e-4, 1e-6), rel=1e-3)
    assert white_and_walk(AxisNoise(drift=1e-6), 6.0) == pytest.approx((0.0, 3e-6))
    assert white_and_walk(AxisNoise(quantization=1e-5), 3.0) == pytest.approx((1e-5, 0.0))
    assert white_and_walk(AXIS, 10.0)[0] > AXIS.white_noise


def numbers(text: str) -> dict[str, object]:
    yaml = pytest.importorskip("ruamel.yaml").YAML(typ="safe")
    return dict(yaml.load(text.removeprefix("%YAML:1.0\n")))


def test_the_files_have_the_keys_and_units_of_their_readers(tmp_path: Path) -> None:
    """Oracle: the keys of the examples in the documents of Kalibr (imu.yaml), OpenVINS
    (kalibr_imu_chain.yaml), VINS-Mono (config) and GTSAM (PreintegrationCombinedParams), read by a
    YAML parser; scaled by hand.
    """
    model = load_noise_model("navchip")
    walk = random_walk_of(model, 10.0)
    kalibr = numbers(text_for("kalibr", model, rate_hz=250.0, topic="/imu"))
    assert list(kalibr) == [
        "accelerometer_noise_density",
        "accelerometer_random_walk",
        "gyroscope_noise_density",
        "gyroscope_random_walk",
        "rostopic",
        "update_rate",
    ]
    assert kalibr["gyroscope_random_walk"] == pytest.approx(walk.gyro_walk, rel=1e-5)
    assert (kalibr["rostopic"], kalibr["update_rate"]) == ("/imu", 250.0)
    openvins = numbers(text_for("openvins", model, rate_hz=250.0))["imu0"]
    assert openvins["accelerometer_noise_density"] == pytest.approx(walk.accel_white, rel=1e-5)
    for name, size in (("T_i_b", 4), ("Tw", 3), ("R_IMUtoGYRO", 3), ("Ta", 3), ("R_IMUtoACC", 3)):
        np.testing.assert_array_equal(openvins[name], np.eye(size))
    assert openvins["model"] == "kalibr"
    np.testing.assert_array_equal(openvins["Tg"], np.zeros((3, 3)))
    gtsam = numbers(text_for("gtsam", model, rate_hz=250.0))
    for name, root in (
        ("accelerometerCovariance", walk.accel_white),
        ("gyroscopeCovariance", walk.gyro_white),
        ("biasAccCovariance", walk.accel_walk),
        ("biasOmegaCovariance", walk.gyro_walk),
    ):
        np.testing.assert_allclose(gtsam[name], root**2 * np.eye(3), rtol=1e-5)
    ros = numbers(text_for("ros", model, rate_hz=250.0))
    variance = walk.gyro_white**2 * 250.0
    np.testing.assert_allclose(
        ros["angular_velocity_covariance"], (variance * np.eye(3)).ravel(), rtol=1e-5
    )


def test_vins_propagates_what_the_numbers_say() -> None:
    """Oracle: the midpoint integration that VINS-Mono publishes, one second of it at rest: each
    sample counts as two independent halves, a bias steps by acc_w dt.
    """
    model = load_noise_model("navchip")
    walk, rate = random_walk_of(model), 200.0
    vins = numbers(text_for("vins", model, rate_hz=rate))
    dt = 1.0 / rate
    velocity = rate * 2.0 * (0.5 * dt * vins["acc_n"]) ** 2
    bias = rate * (dt * vins["acc_w"]) ** 2
    assert velocity == pytest.approx(walk.accel_white**2, rel=1e-5)  # N^2 t after t = 1 s
    assert bias == pytest.approx(walk.accel_walk**2, rel=1e-5)  # K^2 t


def test_what_cannot_be_written_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: messages by hand; exit codes of the contract."""
    white = NoiseModel.of_alike_axes("w", AxisNoise(white_noise=1e-4), AXIS)
    with pytest.raises(DataError, match=r"gyro of 'w' has no process slower than the cluster time"):
        text_for("kalibr", white, rate_hz=100.0)
    model = load_noise_model("navchip")
    for options, says in (
        ({}, "no rate of the samples is known"),
        ({"rate_hz": 100.0, "cluster_s": 0.0}, "cluster time 0 s"),
        ({"rate_hz": 100.0, "topic": "/a b"}, "is no name of a topic"),
    ):
        with pytest.raises(UsageError, match=says):
            text_for("kalibr", model, **options)
    out = tmp_path / "imu.yaml"
    argv = ["export", "navchip", "kalibr", "--out", str(out), "--set", "rate=250"]
    assert main([*argv, "--set", "cluster=5", "-q"]) == 0
    assert "at 5 s" in out.read_text()
    assert "Allan variance at 5 s" in capsys.readouterr().out
    for more, says in (
        (["--set", "rate=x"], "rate=x: a number greater than zero"),
        (["--set", "bias=1"], "kalibr takes no bias"),
        (["--crs", "EPSG:2056"], "have no effect on a noise model"),
    ):
        assert main([*argv, *more]) == 2
        assert says in capsys.readouterr().err
    assert set(CONSUMER_FORMS) == {"kalibr", "openvins", "vins", "gtsam", "ros"}
