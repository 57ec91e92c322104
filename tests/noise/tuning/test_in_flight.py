"""A flight file to a verdict and a noise model: from simulated data sets with and without
vibration.
"""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from flown import error_of, fly, start_near
from scipy.stats import chi2

from insgnss import Flight, cli, load_flight
from insgnss.base.errors import InputError, UsageError
from insgnss.flight.processing.pipeline import process
from insgnss.navigation.filter.layout import state_layout
from insgnss.navigation.filter.solution import solve
from insgnss.navigation.innovations.innovation_noise import KNOWN_SIGMA, _minutes, _untold
from insgnss.navigation.innovations.likelihood import Evaluated
from insgnss.navigation.innovations.search import Maximum
from insgnss.navigation.noise_model.model import NoiseModel, load_noise_model
from insgnss.noise.tuning.in_flight.estimation import (
    FlightTuning,
    _estimate_noise,
    _judge,
    _read_without_exposures,
    tune_flight,
)
from insgnss.noise.tuning.in_flight.files import model_in_flight
from insgnss.noise.tuning.in_flight.straight_flight import SpectralLine
from insgnss.report.charts.files import charts_of
from insgnss.simulation.dataset import write_dataset
from insgnss.simulation.raw_gnss.receiver import GnssOptions

pytestmark = pytest.mark.slow

GOOD = GnssOptions(sigma_m=(0.005, 0.005, 0.008))
SIGMA = np.array([0.5, 0.5, 0.5, 0.3, 0.3, 0.3, *np.radians([1.0, 1.0, 5.0])])
NAVCHIP = load_noise_model("navchip")
TRIPLED, MINUTES = 3.0, 10.0


def louder(factor: float) -> NoiseModel:
    """The NavChip with a factor on its white noise."""
    triads = [
        tuple(replace(axis, white_noise=factor * axis.white_noise) for axis in triad)
        for triad in (NAVCHIP.gyro, NAVCHIP.accel)
    ]
    return NoiseModel("louder", "made up", *triads)


def data_set(directory: Path, vibration: float, minutes: float, seed: int) -> Flight:
    """A flight file of a NavChip that shakes by more than it says."""
    made = write_dataset(
        directory,
        "ign8",
        minutes,
        imu_rate=100.0,
        seed=seed,
        vibration=vibration,
        gnss=GOOD,
        start_in_air=True,
        line_length_m=300.0,
    )
    return load_flight(made.flight_file)


@pytest.fixture(scope="module")
def shaken(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    return data_set(tmp_path_factory.mktemp("flights") / "shaken", TRIPLED, MINUTES, 1)


@pytest.fixture(scope="module")
def tuned(shaken: Flight) -> FlightTuning:
    return tune_flight(shaken)


@pytest.fixture(scope="module")
def unshaken(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    return data_set(tmp_path_factory.mktemp("flights") / "calm", 1.0, 3.0, 2)


@pytest.fixture(scope="module")
def calm(unshaken: Flight) -> FlightTuning:
    return tune_flight(unshaken)


def test_vibration_that_triples_white_noise_is_accepted_and_recovered(tuned):
    """Oracle: the simulator's factor; both triads within 10 %, and within three standard errors of
    9 % and less.
    """
    assert tuned.accepted
    factors = np.array(list(tuned.noise.imu_factors().values()))
    sigma = np.array(
        [tuned.noise.sigma(name) for name in ("gyro.white_noise", "accel.white_noise")]
    )
    assert (np.abs(factors / TRIPLED - 1.0) < 0.1).all()
    assert (np.abs(factors - TRIPLED) < 3.0 * sigma).all()
    assert (sigma < 0.09 * TRIPLED).all()


def test_the_model_is_a_file_that_process_takes(tuned, shaken, tmp_path):
    """Oracle: the reader of noise models, the factors, and `process`; what was not estimated stays
    as it was.
    """
    assert tuned.file == shaken.path.parent / "in_flight_noise.toml"
    model = load_noise_model(tuned.file)
    factor = tuned.noise.imu_factors()
    for sensor in ("gyro", "accel"):
        for axis, static in zip(getattr(model, sensor), getattr(NAVCHIP, sensor), strict=True):
            assert axis.white_noise == pytest.approx(
                factor[f"{sensor}.white_noise"] * static.white_noise, rel=1e-5
            )
            assert dict(axis.standard_error)["white_noise"] == pytest.approx(
                tuned.noise.sigma(f"{sensor}.white_noise") * static.white_noise, rel=0.05
            )
            assert axis.turn_on_bias == pytest.approx(static.turn_on_bias, rel=1e-9)
            assert [g.driving_noise for g in axis.gauss_markov] == pytest.approx(
                [g.driving_noise for g in static.gauss_markov], rel=1e-9
            )
    (source,) = model.recordings
    assert (source.file, source.sampling_rate_hz) == (Path(shaken.imu.file).name, 100.0)
    result = process(
        replace(shaken, imu=replace(shaken.imu, noise=str(tuned.file))), tmp_path / "out"
    )
    assert result.diagnostics.nis.mean() / 3.0 == pytest.approx(1.0, abs=0.05)


def test_words_and_numbers_say_the_same(tuned):
    """Oracle: the result itself; JSON that Python's own module takes, and a summary with verdict,
    factors and advice.
    """
    model, table, _ = tuned.files
    told = json.loads(table.read_text(encoding="utf-8"))
    assert len(told.pop("inputs_sha256")) == 4  # flight file, IMU, fixes and events
    assert set(told.pop("products_sha256")) == {model.name}
    assert set(told.pop("versions")) == {"insgnss", "python", "numpy"}
    assert set(told.pop("run")) == {"command"}
    assert told == json.loads(json.dumps(tuned.as_dict()))
    assert told["verdict"] == "accept"
    assert told["factors"]["gyro.white_noise"]["factor"] == pytest.approx(tuned.noise.factor[0])
    assert told["innovations"]["after"]["nis"] == pytest.approx(1.0, abs=0.05)
    assert len(told["straight_flight"]["upper_limit"]) == 6
    words = tuned.summary()
    for part in (
        "accept the noise found in flight",
        "accelerometer white noise",
        "deg/h/sqrt(Hz)",
        "least octave",
        str(tuned.file),
    ):
        assert part in words
    assert all(words_of in words for words_of in (tuned.headline, "; ".join(tuned.reasons)))


def test_the_page_shows_the_spectrum(tuned):
    """Oracle: the density that was measured, in deg/h and micro-g, and the static model's white
    noise as a level line; the page is of the table's run.
    """
    _, charts = charts_of(next(file for file in tuned.files if file.suffix == ".json"))
    assert [chart.name for chart in charts] == ["spectrum-gyro", "spectrum-accel"]
    s = tuned.straight
    for c, (chart, k) in enumerate((chart, k) for chart in charts for k in range(3)):
        measured, static, *_ = chart.panels[k].layers
        unit = (np.pi / 648000.0, 9.80665e-6)[c // 3]
        inside = s.frequency_hz > 0.0
        assert measured.y == pytest.approx(s.density[c][inside] / unit, rel=0.01)
        white = getattr(tuned.static, ("gyro", "accel")[c // 3])[k % 3].white_noise
        assert static.y == pytest.approx(white / unit, rel=1e-4)


def test_the_spectrum_agrees(tuned):
    """Oracle: the simulator's white noise, which the quietest octave of the straight lines shows to
    some percent.
    """
    assert tuned.straight is not None
    static = np.array([axis.white_noise for axis in (*NAVCHIP.gyro, *NAVCHIP.accel)])
    assert tuned.straight.upper_limit / static == pytest.approx(np.full(6, TRIPLED), rel=0.1)


@pytest.fixture(scope="module")
def foreign(shaken: Flight) -> FlightTuning:
    """The shaken flight against the model of another class of sensors, whose drifts are not those
    of its IMU.
    """
    flight = replace(
        shaken, imu=replace(shaken.imu, noise="tactical"), gnss=replace(shaken.gnss, gm_sigma="off")
    )
    return tune_flight(flight, shaken.path.parent / "tactical_in_flight.toml")


def test_a_far_factor_is_found_but_not_accepted_where_it_stands_in_for_drifts(foreign):
    """Oracle: the simulator's white noise, 27 times that of the tactical model; white noise above
    the density of the samples themselves cannot be, and what the innovations ask for besides are
    the NavChip's Gauss-Markov processes."""
    tuned = foreign
    truth = TRIPLED * NAVCHIP.gyro[0].white_noise
    assert truth / tuned.static.gyro[0].white_noise == pytest.approx(27.06, rel=1e-3)
    assert tuned.noise.imu_factors()["gyro.white_noise"] > 27.0
    assert not tuned.noise.held
    assert not tuned.accepted
    assert "gyro white noise would be" in tuned.verdict
    assert "name the noise model of a sensor of its kind" in tuned.verdict
    assert "gyro white noise cannot be" in tuned.summary()
    assert (tuned.file, [file.suffix for file in tuned.files]) == (None, [".json", ".html"])
    assert not (tuned.files[0].parent / "tactical_in_flight.toml").exists()


def test_no_accepted_factor_contradicts_the_truth(foreign, tuned):
    """Oracle: the simulator's white noise: an accepted factor is within three standard errors of
    it, whatever the static model.
    """
    for told in (foreign, tuned):
        for sensor in ("gyro", "accel") if told.accepted else ():
            name = f"{sensor}.white_noise"
            truth = (
                TRIPLED
                * getattr(NAVCHIP, sensor)[0].white_noise
                / getattr(told.static, sensor)[0].white_noise
            )
            assert abs(told.noise.imu_factors()[name] - truth) < 3.0 * told.noise.sigma(name)
    assert tuned.accepted


def test_a_short_flight_says_what_length_would_do():
    """Oracle: the rule that standard errors fall with the root of time; half the length asks for as
    long a flight.
    """
    sigma = 2.0 * KNOWN_SIGMA
    at = Evaluated(
        0.0, np.zeros(1), np.array([[2.0 / sigma**2]]), np.zeros((0, 3)), np.zeros(0), 0, 0
    )
    told = _minutes(Maximum(np.zeros(1), at), 5.0)
    assert told == pytest.approx([20.0])
    assert "20 min of such a flight" in _untold(0.1, sigma, float(told[0]))
    assert np.isinf(
        _minutes(Maximum(np.zeros(1), replace(at, information=100.0 * at.information)), 5.0)
    ).all()


def test_a_true_model_is_kept_and_only_evidence_written(calm):
    """Oracle: a simulated IMU that is as its model says; the directory's listing."""
    assert not calm.accepted
    assert calm.file is None
    assert [file.suffix for file in calm.files] == [".json", ".html"]
    assert all(file.is_file() for file in calm.files)
    assert not list(calm.files[0].parent.glob("*noise.toml"))
    assert "keep the static model" in calm.summary()
    assert calm.as_dict()["verdict"] == "keep"


def test_the_verb_takes_the_parameters_that_it_is_given(unshaken, tmp_path, capsys):
    """Oracle: the flight file's model, of which only the driving noise was asked for; it is held or
    scaled, and the rest is as it was.
    """
    target = tmp_path / "noise.toml"
    argv = [
        "tune",
        "--flight",
        unshaken.path,
        "--parameters",
        "gyro.driving_noise, accel.driving_noise",
        "--out",
        target,
        "-q",
        "--json",
    ]
    assert cli.main([str(word) for word in argv]) == 0
    told = json.loads(capsys.readouterr().out)
    assert set(told["factors"]) == {"gyro.driving_noise", "accel.driving_noise", "fixes.position"}
    assert told["files"][0] == str(target.with_suffix(".json"))
    assert told["notes"] == []


def test_a_factor_of_driving_noise_is_that_of_every_slow_process(tuned, shaken):
    """Oracle: the product, of Gauss-Markov processes and random walk; standard errors to two
    digits.
    """
    names = ("gyro.driving_noise", "accel.driving_noise")
    noise = replace(
        tuned.noise, names=names, factor=np.array([2.0, 1.0]), log_sigma=np.array([0.1, 0.0])
    )
    walking = replace(NAVCHIP, gyro=tuple(replace(axis, random_walk=1e-7) for axis in NAVCHIP.gyro))
    model = model_in_flight(shaken, replace(_read_without_exposures(shaken), noise=walking), noise)
    for axis, static in zip(model.gyro, walking.gyro, strict=True):
        assert axis.white_noise == static.white_noise
        assert axis.random_walk == pytest.approx(2e-7, rel=1e-5)
        assert [g.driving_noise for g in axis.gauss_markov] == pytest.approx(
            [2.0 * g.driving_noise for g in static.gauss_markov], rel=1e-5
        )
        assert dict(axis.standard_error)["random_walk"] == pytest.approx(0.2e-7, rel=0.05)
    assert model.accel == NAVCHIP.accel


@pytest.mark.parametrize(
    ("adopted", "gain", "asked", "white"),
    [
        ((True, True), 19.0, "auto", True),  # noise of the IMU explains as much
        ((True, True), 21.0, "auto", False),
        ((True, False), 21.0, "auto", True),  # the stretches do not agree
        ((True, True), 0.0, "on", False),  # the flight file's own
        ((False, False), 0.0, "auto", False),
    ],
)
def test_a_correlated_error_that_was_adopted_is_doubted(monkeypatch, adopted, gain, asked, white):
    """Oracle: the rule; the correlated error stays where the likelihood gains more than 20 beside
    free noise of the IMU.
    """

    def part(coloured: int, cost: float) -> SimpleNamespace:
        return SimpleNamespace(
            problem=SimpleNamespace(layout=SimpleNamespace(gm=coloured)),
            at_best=SimpleNamespace(cost=cost),
        )

    room = "insgnss.navigation.innovations."
    monkeypatch.setattr(room + "pieces.without_correlated", lambda _: part(-1, gain))
    monkeypatch.setattr(room + "innovation_noise.in_flight_noise", lambda parts, *_: parts[0])
    flight = SimpleNamespace(gnss=SimpleNamespace(gm_sigma=asked))
    found, dropped = _estimate_noise(
        flight, [part(3 if has else -1, 0.0) for has in adopted], (), lambda _: None
    )
    assert (found.problem.layout.gm < 0) == (white or not any(adopted))
    assert dropped == white


def test_what_is_odd_is_reported(tuned):
    """Oracle: the numbers put in: a line of 83 Hz, fixes twice as bad as they claim, no straight
    flight, a lost segment.
    """
    assert tuned.straight is not None
    line = SpectralLine("accel z", 83.0, 0.7, 0.7 / (2.0 * np.pi * 83.0), 40.0)
    noise = replace(
        tuned.noise,
        factor=np.where(
            [name == "fixes.position" for name in tuned.noise.names], 2.0, tuned.noise.factor
        ),
    )
    words = replace(
        tuned,
        noise=noise,
        straight=replace(tuned.straight, lines=(line,)),
        dropped_correlated=True,
        notes=("left out: 3 s",),
    ).summary()
    for said in (
        "line accel z 83.00 Hz (or folded from +-100 Hz): rms 0.7 m/s^2; swings by 0.0013 m/s",
        "sigma of the positions: 2.00 +-",
    ):
        assert said in words
    assert "noise of the IMU explains what the solution took for a time-correlated error" in words
    assert "  left out: 3 s" in words
    assert "no straight, level flight" in replace(tuned, straight=None).summary()


def test_errors_fit_their_covariance_again(tuned):
    """Oracle: NEES of twenty other flights with the same vibration, each independent: chi-square of
    180 degrees of freedom, 99 % bounds.

    The filter with the static model is outside, the one with the model of the tuned flight inside.
    """
    layouts = state_layout(NAVCHIP), state_layout(tuned.model)
    nees = np.array(
        [[errors_squared(seed, layout) for layout in layouts] for seed in range(20)]
    ).sum(axis=0)
    low, high = chi2.ppf([0.005, 0.995], 9 * 20)
    assert nees[0] > high
    assert low < nees[1] < high


def errors_squared(seed: int, layout) -> float:
    """NEES of position, velocity and attitude in the middle of a flight whose IMU is three times as
    loud as the NavChip.
    """
    flown = fly(30.0, 100 + seed, imu_hz=100.0, noise=louder(TRIPLED), layout=layout)
    start = start_near(flown, SIGMA, SIGMA * np.random.default_rng(seed).standard_normal(9))
    solution = solve(flown.problem, start, separations=0)
    k = solution.time.size * 6 // 10
    error = error_of(solution.nav[k : k + 1], flown.true_nav(slice(k, k + 1)))[0]
    return float(error @ np.linalg.solve(solution.nav_covariance()[k], error))


def test_each_doubt_keeps_the_static_model(tuned):
    """Oracle: the rule, one condition broken at a time, in its own words."""
    noise = tuned.noise
    best, after = noise.at_best, noise.after
    coloured = replace(best, whiteness=replace(best.whiteness, lag_one=np.array([0.02, 0.4, 0.01])))
    slow = {
        "p_value": np.array([1e-303, 0.5, 0.5]),
        "together": np.array([0.42, 0.0, 0.0]),
        "lag_one": np.full(3, 0.02),
    }
    lasting = replace(best, whiteness=replace(best.whiteness, **slow))
    doubts = (
        ((replace(noise, chance=0.01), 0, 0), "chance"),
        (
            (replace(noise, chance=0.01, gain=0.5 * chi2.isf(1e-3, 2), duration_s=300.0), 0, 0),
            "10 min of such a flight would be enough to determine them",
        ),
        ((replace(noise, at_best=coloured), 0, 0), "stay correlated, 0.40"),
        (
            (replace(noise, after=replace(after, nis=1.3), at_best=replace(best, nis=1.3)), 0, 0),
            "1.300 after",
        ),
        ((noise, 2, 2 + after.fixes // 50), f"2 of {after.fixes} fixes rejected before"),
        ((replace(noise, at_best=lasting), 0, 0), "0.02 from fix to fix and 0.42 over 20 fixes"),
        (
            (noise, 0, 0, [("gyro.white_noise", 1.9)]),
            "gyro white noise would be 1.9 times the quietest octave",
        ),
        (
            (replace(noise, loss=500.0, held=(("accel.white_noise", ""),)), 0, 0),
            "rule out accelerometer white noise",
        ),
        (
            (replace(noise, free=0, held=(("gyro.white_noise", "too short"),)), 0, 0),
            "gyro white noise not determined by this flight: too short",
        ),
    )
    assert _judge(noise, 0, 0)[0]
    for given, words in doubts:
        accepted, reasons = _judge(*given)
        assert not accepted
        assert words in "; ".join(reasons)


@pytest.mark.parametrize(
    ("change", "arguments", "error", "words"),
    [
        (None, {"parameters": ["gyro.bias"]}, UsageError, "gyro.bias"),
        (None, {"parameters": ["white_noise", "gyro.white_noise"]}, UsageError, "not for both"),
        (
            lambda f: replace(f, imu=replace(f.imu, file=f.path.parent / "README.md")),
            {},
            UsageError,
            "holds results of other measurements: .* was not made from README.md",
        ),
        (None, {"out": "flight.toml"}, UsageError, "input of this flight"),
        (None, {"out": "noise.txt"}, UsageError, r"end its name with \.toml"),
        (
            lambda f: replace(f, gnss=replace(f.gnss, stationary=(46.5, 6.5, 400.0))),
            {"force": True},
            InputError,
            "static",
        ),
        (
            lambda f: replace(f, imu=replace(f.imu, further=(f.imu,))),
            {"force": True},
            InputError,
            "imu.further",
        ),
    ],
)
def test_wrong_use_is_refused(
    tuned,
    shaken,
    change: Callable[[Flight], Flight] | None,
    arguments: dict,
    error: type[Exception],
    words: str,
):
    """Oracle: the contract; one line that names what is wrong."""
    flight = change(shaken) if change else shaken
    if "out" in arguments:
        arguments = {"out": shaken.path.parent / arguments["out"]}
    with pytest.raises(error, match=words) as refusal:
        tune_flight(flight, **arguments)
    assert "\n" not in str(refusal.value)
