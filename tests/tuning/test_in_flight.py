"""A flight file to a verdict and a noise model: from simulated data sets with and without vibration."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from flown import error_of, fly, start_near
from scipy.stats import chi2

from insgnss.errors import InputError, UsageError
from insgnss.flight import Flight, load_flight
from insgnss.navigation.layout import state_layout
from insgnss.navigation.solution import solve
from insgnss.pipeline import process
from insgnss.simulate.dataset import write_dataset
from insgnss.simulate.receiver import GnssOptions
from insgnss.stochastic.model import NoiseModel, load_noise_model
from insgnss.tuning.in_flight import FlightTuning, _judged, tune_flight

GOOD = GnssOptions(sigma_m=(0.005, 0.005, 0.008))
SIGMA = np.array([0.5, 0.5, 0.5, 0.3, 0.3, 0.3, *np.radians([1.0, 1.0, 5.0])])
NAVCHIP = load_noise_model("navchip")
TRIPLED, MINUTES = 3.0, 10.0


def louder(factor: float) -> NoiseModel:
    """The NavChip with a factor on its white noise."""
    triads = [tuple(replace(axis, white_noise=factor * axis.white_noise) for axis in triad) for triad in (NAVCHIP.gyro, NAVCHIP.accel)]
    return NoiseModel("louder", "made up", *triads)


def data_set(directory: Path, vibration: float, minutes: float, seed: int) -> Flight:
    """A flight file of a NavChip that shakes by more than it says."""
    made = write_dataset(
        directory, "ign8", minutes, imu_rate=100.0, seed=seed, vibration=vibration, gnss=GOOD, start_in_air=True, line_length_m=300.0
    )
    return load_flight(made.flight_file)


@pytest.fixture(scope="module")
def shaken(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    return data_set(tmp_path_factory.mktemp("flights") / "shaken", TRIPLED, MINUTES, 1)


@pytest.fixture(scope="module")
def tuned(shaken: Flight) -> FlightTuning:
    return tune_flight(shaken)


@pytest.fixture(scope="module")
def calm(tmp_path_factory: pytest.TempPathFactory) -> FlightTuning:
    return tune_flight(data_set(tmp_path_factory.mktemp("flights") / "calm", 1.0, 3.0, 2))


def test_vibration_that_triples_white_noise_is_accepted_and_recovered(tuned):
    """Oracle: the simulator's factor; both triads within 10 %, and within three standard errors of 9 % and less."""
    assert tuned.accepted
    factors = np.array(list(tuned.noise.imu_factors().values()))
    sigma = np.array([tuned.noise.sigma(name) for name in ("gyro.white_noise", "accel.white_noise")])
    assert (np.abs(factors / TRIPLED - 1.0) < 0.1).all()
    assert (np.abs(factors - TRIPLED) < 3.0 * sigma).all()
    assert (sigma < 0.09 * TRIPLED).all()


def test_the_model_is_a_file_that_process_takes(tuned, shaken, tmp_path):
    """Oracle: the reader of noise models, the factors, and `process`; what was not estimated stays as it was."""
    assert tuned.file == shaken.path.parent / "in_flight_noise.toml"
    model = load_noise_model(tuned.file)
    factor = tuned.noise.imu_factors()
    for sensor in ("gyro", "accel"):
        for axis, static in zip(getattr(model, sensor), getattr(NAVCHIP, sensor), strict=True):
            assert axis.white_noise == pytest.approx(factor[f"{sensor}.white_noise"] * static.white_noise, rel=1e-5)
            assert dict(axis.standard_error)["white_noise"] == pytest.approx(
                tuned.noise.sigma(f"{sensor}.white_noise") * static.white_noise, rel=0.05
            )
            assert axis.turn_on_bias == pytest.approx(static.turn_on_bias, rel=1e-9)
            assert [g.driving_noise for g in axis.gauss_markov] == pytest.approx([g.driving_noise for g in static.gauss_markov], rel=1e-9)
    (source,) = model.recordings
    assert (source.file, source.sampling_rate_hz) == (Path(shaken.imu.file).name, 100.0)
    result = process(replace(shaken, imu=replace(shaken.imu, noise=str(tuned.file))), tmp_path / "out")
    assert result.diagnostics.nis.mean() / 3.0 == pytest.approx(1.0, abs=0.05)


def test_words_and_numbers_say_the_same(tuned):
    """Oracle: the result itself; JSON that Python's own module takes, and a summary with verdict, factors and advice."""
    table, picture = tuned.files[1:]
    told = json.loads(table.read_text(encoding="utf-8"))
    assert told == json.loads(json.dumps(tuned.as_dict()))
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert told["verdict"] == "accept"
    assert told["factors"]["gyro.white_noise"]["factor"] == pytest.approx(tuned.noise.factor[0])
    assert told["innovations"]["after"]["nis"] == pytest.approx(1.0, abs=0.05)
    assert len(told["straight_flight"]["upper_limit"]) == 6
    words = tuned.summary()
    for part in ("accept the noise found in flight", "accelerometer white noise", "deg/h/sqrt(Hz)", "least octave", str(tuned.file)):
        assert part in words
    assert tuned.verdict in words


def test_the_spectrum_agrees(tuned):
    """Oracle: the simulator's white noise, which the quietest octave of the straight lines shows to some percent."""
    assert tuned.straight is not None
    static = np.array([axis.white_noise for axis in (*NAVCHIP.gyro, *NAVCHIP.accel)])
    assert tuned.straight.upper_limit / static == pytest.approx(np.full(6, TRIPLED), rel=0.1)


def test_a_true_model_is_kept_and_only_evidence_written(calm):
    """Oracle: a simulated IMU that is as its model says; the directory's listing."""
    assert not calm.accepted
    assert calm.file is None
    assert [file.suffix for file in calm.files] == [".json", ".png"]
    assert all(file.is_file() for file in calm.files)
    assert not list(calm.files[0].parent.glob("*noise.toml"))
    assert "keep the static model" in calm.summary()
    assert calm.as_dict()["verdict"] == "keep"


def test_errors_fit_their_covariance_again(tuned):
    """Oracle: NEES of twenty other flights with the same vibration, each independent: chi-square of 180 degrees of freedom, 99 % bounds.

    The filter with the static model is outside, the one with the model of the tuned flight inside.
    """
    layouts = state_layout(NAVCHIP), state_layout(tuned.model)
    nees = np.array([[errors_squared(seed, layout) for layout in layouts] for seed in range(20)]).sum(axis=0)
    low, high = chi2.ppf([0.005, 0.995], 9 * 20)
    assert nees[0] > high
    assert low < nees[1] < high


def errors_squared(seed: int, layout) -> float:
    """NEES of position, velocity and attitude in the middle of a flight whose IMU is three times as loud as the NavChip."""
    flown = fly(30.0, 100 + seed, imu_hz=100.0, noise=louder(TRIPLED), layout=layout)
    start = start_near(flown, SIGMA, SIGMA * np.random.default_rng(seed).standard_normal(9))
    solution = solve(flown.problem, start, separations=0)
    k = solution.time.size * 6 // 10
    error = error_of(solution.nav[k : k + 1], flown.true_nav(slice(k, k + 1)))[0]
    return float(error @ np.linalg.solve(solution.P[k, :9, :9], error))


def test_each_doubt_keeps_the_static_model(tuned):
    """Oracle: the rule, one condition broken at a time, in its own words."""
    noise = tuned.noise
    best, after = noise.at_best, noise.after
    coloured = replace(best, whiteness=replace(best.whiteness, lag_one=np.array([0.02, 0.4, 0.01])))
    doubts = (
        ((replace(noise, chance=0.01), 0, 0), "chance"),
        ((replace(noise, at_best=coloured), 0, 0), "stay correlated, 0.40"),
        ((replace(noise, after=replace(after, nis=1.3), at_best=replace(best, nis=1.3)), 0, 0), "1.300 after"),
        ((noise, 2, 2 + after.fixes // 50), f"2 of {after.fixes} fixes lost before"),
        ((replace(noise, free=0, held=(("gyro.white_noise", "too short"),)), 0, 0), "gyro white noise not told by this flight: too short"),
    )
    assert _judged(noise, 0, 0)[0]
    for given, words in doubts:
        accepted, reasons = _judged(*given)
        assert not accepted
        assert words in "; ".join(reasons)


@pytest.mark.parametrize(
    ("change", "arguments", "error", "words"),
    [
        (None, {"parameters": ["gyro.bias"]}, UsageError, "gyro.bias"),
        (None, {"parameters": ["white_noise", "gyro.white_noise"]}, UsageError, "not for both"),
        (None, {}, UsageError, "there already"),
        (None, {"out": "flight.toml"}, UsageError, "input of this flight"),
        (None, {"out": "noise.txt"}, UsageError, r"end its name with \.toml"),
        (None, {"out": "nowhere/noise.toml"}, UsageError, "create it first"),
        (lambda f: replace(f, gnss=replace(f.gnss, stationary=(46.5, 6.5, 400.0))), {"force": True}, InputError, "static"),
        (lambda f: replace(f, imu=replace(f.imu, more=(f.imu,))), {"force": True}, InputError, "imu.more"),
    ],
)
def test_wrong_use_is_refused(
    tuned, shaken, change: Callable[[Flight], Flight] | None, arguments: dict, error: type[Exception], words: str
):
    """Oracle: the contract; one line that names what is wrong."""
    flight = change(shaken) if change else shaken
    if "out" in arguments:
        arguments = {"out": shaken.path.parent / arguments["out"]}
    with pytest.raises(error, match=words) as refusal:
        tune_flight(flight, **arguments)
    assert "\n" not in str(refusal.value)
