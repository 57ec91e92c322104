"""The verb `tune` on static recordings, from files to files, against simulated noise and by
contract.
"""

import hashlib
import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from static_files import ACCEL, BIAS, DEG_H, GRAVITY, GYRO, RATE, UG, samples, save

from insgnss import cli
from insgnss.base.errors import DataError
from insgnss.cli.console import fit_to_width
from insgnss.flight.processing.recording_checks import noise_misfit
from insgnss.navigation.noise_model.model import AxisNoise, GaussMarkov, load_noise_model
from insgnss.noise.estimation.selection import rank
from insgnss.noise.moments.wavelet import wavelet_variance
from insgnss.noise.processes.realisation import simulate_noise
from insgnss.noise.tuning.options import FAMILY, TuneOptions, chosen_levels
from insgnss.noise.tuning.static import tune_static
from insgnss.noise.tuning.usable import rounded_axis
from insgnss.report.charts.files import charts_of

UNITS = ["--gyro-unit", "rad/s", "--accel-unit", "m/s^2", "--rate", f"{RATE:g}"]
OPTIONS = TuneOptions(rate_hz=RATE, gyro_unit="rad/s", accel_unit="m/s^2", model="WN+GM")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two recordings of twelve minutes."""
    where = tmp_path_factory.mktemp("static")
    for k in (1, 2):
        save(where / f"rest{k}.npy", samples(k))
    return where


@pytest.fixture(scope="module")
def tuned(folder):
    """One model an axis of both recordings."""
    return tune_static([folder / "rest1.npy", folder / "rest2.npy"], OPTIONS, folder / "imu.toml")


def truth(sensor):
    axis = GYRO if sensor == "gyro" else ACCEL
    (process,) = axis.gauss_markov
    return {
        "white_noise": axis.white_noise,
        "correlation_time_1": process.correlation_time_s,
        "driving_noise_1": process.driving_noise,
    }


@pytest.mark.slow
def test_intervals_hold_the_simulated_noise(tuned):
    """Oracle: the parameters simulated; of 18 intervals of 95 % at least 14 hold them (fewer: 1 in
    500).
    """
    held = [
        e.low < truth(t.sensor)[e.name] < e.high for t in tuned.tuned for e in t.inference.estimates
    ]
    assert len(held) == 18
    assert sum(held) >= 14
    assert all(t.inference.goodness.p_value > 1e-4 for t in tuned.tuned)


@pytest.mark.slow
def test_the_noise_model_says_what_was_found_and_of_what(tuned, folder):
    """Oracle: the result's own estimates to the digits of the file, hashlib, and the means put in
    (Earth's rotation is not simulated).
    """
    model = load_noise_model(folder / "imu.toml")
    assert model == tuned.model
    for t in tuned.tuned:
        axis = getattr(model, t.sensor)[t.axes[0]]
        errors = dict(axis.standard_error)
        assert_allclose(axis.white_noise, t.inference["white_noise"].value, rtol=1e-5)
        assert_allclose(
            axis.gauss_markov[0].correlation_time_s,
            t.inference["correlation_time_1"].value,
            rtol=1e-5,
        )
        assert_allclose(
            errors["driving_noise_1"], t.inference["driving_noise_1"].standard_error, rtol=0.05
        )
    assert [r.file for r in model.recordings] == ["rest1.npy", "rest2.npy"]
    assert (
        model.recordings[0].sha256
        == hashlib.sha256((folder / "rest1.npy").read_bytes()).hexdigest()
    )
    assert {(r.samples, r.sampling_rate_hz) for r in model.recordings} == {(36_000, RATE)}
    assert_allclose(model.gyro[0].turn_on_bias, np.sqrt(np.mean(BIAS**2)), rtol=0.01)
    assert_allclose(
        model.accel[0].turn_on_bias, max(abs(np.linalg.norm(GRAVITY) - 9.80665), 0.015), rtol=0.05
    )


def test_the_table_for_machines(tuned, folder):
    """Oracle: the wavelet variance of the samples, and the file's own sums: parts make the model,
    both fits have their objective.
    """
    table = json.loads((folder / "imu.json").read_text())
    fit = table["fits"][4]
    assert (fit["sensor"], fit["axes"], fit["composition"]) == ("accel", ["y"], "WN+GM")
    for recording, curve in zip(("rest1.npy", "rest2.npy"), fit["curves"], strict=True):
        assert (curve["recording"], curve["axis"]) == (recording, "y")
        expected = wavelet_variance(np.load(folder / recording)[:, 4], RATE)
        assert_allclose(curve["wavelet_variance"], expected.variance, rtol=1e-12)
        assert_allclose(
            np.sum(list(curve["parts"].values()), axis=0), curve["modelled"], rtol=1e-12
        )
    width = np.subtract(fit["curves"][0]["high"], fit["curves"][0]["low"])
    assert np.all(width > 0)
    assert fit["diagonal_weights"]["objective"] > 0
    assert set(fit["diagonal_weights"]["parameters"]) == {
        "white_noise",
        "correlation_time_1",
        "driving_noise_1",
    }
    assert [e["name"] for e in fit["estimates"]] == [
        "white_noise",
        "correlation_time_1",
        "driving_noise_1",
    ]
    assert table["recordings"][0]["checks"][0]["name"] == "sampling"


def test_the_page_shows_the_deviations_of_the_table(tuned, folder):
    """Oracle: the page is of the table's run; its dots are sqrt(2 nu) of the samples, in deg/h and
    micro-g, its dark line the sum of the parts, and each axis has its row of parameters.
    """
    page, charts = charts_of(folder / "imu.json")
    assert [chart.name for chart in charts] == ["noise-gyro", "noise-accel"]
    for chart, unit, first in zip(charts, (np.pi / 648000.0, 9.80665e-6), (0, 3), strict=True):
        for k, panel in enumerate(chart.panels):
            dots = next(layer for layer in panel.layers if layer.kind == "points")
            samples = np.load(folder / "rest1.npy")[:, first + k]
            nu = wavelet_variance(samples, RATE).variance
            shown = np.sqrt(2.0 * nu)[: dots.y.size] / unit
            assert_allclose(dots.y, shown, rtol=1e-5)
            (total,) = (layer for layer in panel.layers if layer.name.startswith("fitted sum"))
            parts = [layer for layer in panel.layers if layer.dashed]
            assert_allclose(total.y**2, sum(layer.y**2 for layer in parts), rtol=1e-4)
    text = page.read_text()
    assert text.count("<td>gyro x</td>") == 3
    assert "<h2 id=" in text


def test_joint_axes_are_tighter(tuned, folder):
    """Oracle: three axes of the same noise; the standard error of one fit to all falls by about
    sqrt(3), between 1.3 and 2.3.
    """
    joint = tune_static(
        [folder / "rest1.npy", folder / "rest2.npy"],
        TuneOptions(**{**OPTIONS.__dict__, "axes": "joint"}),
        folder / "joint.toml",
    )
    assert [t.name for t in joint.tuned] == ["gyro xyz", "accel xyz"]
    for t in joint.tuned:
        for name in truth(t.sensor):
            single = np.mean(
                [s.inference[name].log_error for s in tuned.tuned if s.sensor == t.sensor]
            )
            assert 1.3 < single / t.inference[name].log_error < 2.3
    assert joint.model is not None
    assert "[gyro.x]" not in (folder / "joint.toml").read_text()


def test_what_a_person_reads(tuned):
    """Oracle: by contract; units of Table 5, intervals, fit, turn-on bias and files are there, no
    line of a terminal is endless.
    """
    text = tuned.summary()
    for said in (
        "rest1.npy: 36000 samples at 50 Hz",
        "deg/h/sqrt(Hz)",
        "1e-3 deg/s^2/sqrt(Hz)",
        "ug/s/sqrt(Hz)",
        "fits",
        "turn_on_bias",
    ):
        assert said in text
    assert all(
        len(line) <= 100 for line in fit_to_width(text, 100).splitlines() if "wrote" not in line
    )


def refusal(capsys, *argv):
    """Exit code and the one line of standard error."""
    code = cli.main(["tune", *map(str, argv), "-q"])
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    return code, lines[0]


def test_wrong_use_is_refused_before_anything_is_read(tuned, folder, tmp_path, capsys):
    """Oracle: design.md 5, exit code 2 and a line that says what to do."""
    rest, out = folder / "rest1.npy", ["--out", tmp_path / "x.toml"]
    rows = "".join(f"gyro_x,{2.0**j / RATE},{1e-9 / 2**j}\n" for j in range(1, 9))
    (folder / "nameless.csv").write_text(
        f"# rate_hz = {RATE}\n# samples = 36000\naxis,scale_s,wavelet_variance\n{rows}"
    )
    for argv, said in (
        ([], "give static recordings, or --flight FLIGHT"),
        ([rest, "--flight", "flight.toml"], "both static recordings"),
        ([rest, *UNITS, "--model", "", *out], "a model without a name"),
        ([rest, *UNITS, "--gyro-model", "WN,", *out], "a process is missing"),
        ([rest, *UNITS, "--columns", "", *out], "argument --columns: '': give names in the order"),
        ([rest, *UNITS, "--skip", "-1", *out], "argument --skip: '-1' must be 0 or more"),
        ([rest, *UNITS, "--out", "/proc/x.toml"], "/proc/x.toml: cannot be written"),
        ([rest, *UNITS, "--parameters", "gyro.white_noise"], "--parameters belongs to --flight"),
        (
            ["--flight", "flight.toml", "--model", "WN"],
            "with --flight only --parameters, --out and --force have an effect",
        ),
        ([rest, *UNITS, "--model", "WN+2GN", *out], "unknown process 'GN', did you mean 'GM'?"),
        ([rest, *UNITS, "--model", "WN", "--levels", "3:", *out], "is no level"),
        ([rest, *UNITS, "--model", "WN", "--levels", "40-", *out], "no such level; there are 1 to"),
        (
            [rest, "--rate", "50", *out],
            "nor an option states the unit of the gyro columns; give --gyro-unit",
        ),
        (
            [rest, "--rate", "50", "--gyro-unit", "rad/s", *out],
            "nor an option states the unit of the accel columns; give --accel-unit",
        ),
        ([rest, *UNITS[:4], *out], "give the sensor's rate in samples a second, --rate HZ"),
        ([rest, rest, *UNITS, *out], "given twice"),
        ([rest, *UNITS, "--only", "gyro_w", *out], "'gyro_w' is none of gyro, accel, gyro_x"),
        ([rest, *UNITS, "--out", tmp_path / "x.txt"], "end its name with .toml"),
        (
            [folder / "nameless.csv", *UNITS, "--out", folder / "imu.toml"],
            "holds results of other measurements: imu.json was not made from nameless.csv",
        ),
        (
            [rest, *UNITS, "--columns", "gx=1,gy", *out],
            "give names in the order of the columns, or every one as in",
        ),
        ([rest, *UNITS, "--columns", "gx,gy,gz,ax,ay,ax", *out], "names ax twice"),
        (
            [folder / "nameless.csv", *out],
            "states the unit that the gyro variances are of; give --gyro-unit, such as rad/s",
        ),
        ([rest, *UNITS, "--bootstrap", "1", *out], "give 2 replicates at least"),
        ([rest, *UNITS, "--seed", "-1", *out], "--seed -1: must be 0 or more"),
        ([rest, *UNITS, "--accept", "colour", "--model", "WN", *out], "no such check"),
    ):
        code, line = refusal(capsys, *argv)
        assert code == 2, line
        assert said in line
    assert list(tmp_path.iterdir()) == []


def test_recordings_that_do_not_support_an_answer_are_refused(tmp_path, capsys):
    """Oracle: design.md 5, exit code 4; one fault a file, and nothing is written."""
    t = np.arange(6_000)[:, None] / RATE
    rest = samples(3, 2)
    faults = {
        "short": (rest[:2_500], "length: 50.0 s without interruption; expected 60 s and more"),
        "constant": (rest * [1, 0, 1, 1, 1, 1], "constant channel: gyro y is 0 throughout"),
        "moving": (
            rest + np.sin(2.0 * t) * [0.2, 0, 0, 3, 0, 0],
            "If the sensor was at rest, check the units: the scatter is 0.14 rad/s, 2.1",
        ),
        "in_g": (
            rest / [1, 1, 1, 9.8, 9.8, 9.8],
            "the values look like g: give --accel-unit g; gravity must be in them; --accept units",
        ),
    }
    for name, (values, said) in faults.items():
        path = save(tmp_path / f"{name}.npy", values)
        code, line = refusal(capsys, path, *UNITS, "--out", tmp_path / "x.toml")
        assert code == 4
        assert f"{name}.npy: " in line
        assert said in line
    for more, said in (
        (["--model", "DR"], "a drift without noise"),
        (["--skip", "3"], "no samples from 180 s on"),
    ):
        code, line = refusal(
            capsys, save(tmp_path / "rest.npy", rest), *UNITS, *more, "--out", tmp_path / "x.toml"
        )
        assert code == 4
        assert said in line
    assert {path.suffix for path in tmp_path.iterdir()} == {".npy"}


def test_damaged_files_are_refused(folder, tmp_path, capsys):
    """Oracle: design.md 5, exit code 3; a value that is no number, a file that is none, a copy
    under another name.
    """
    values = samples(3, 2)
    values[77, 3] = math.nan
    code, line = refusal(capsys, save(tmp_path / "nan.npy", values), *UNITS)
    assert code == 3
    assert "row" in line
    code, line = refusal(capsys, tmp_path / "none.npy", *UNITS)
    assert code == 3
    assert "none.npy: cannot be read" in line
    (tmp_path / "copy.npy").write_bytes((folder / "rest1.npy").read_bytes())
    code, line = refusal(
        capsys, folder / "rest1.npy", tmp_path / "copy.npy", *UNITS, "--out", tmp_path / "x.toml"
    )
    assert code == 2
    assert "the same bytes as rest1.npy" in line


@pytest.mark.slow
def test_published_variances_will_do(folder, tmp_path, capsys):
    """Oracle: the recording that the published table is of; the same estimates to the digits
    printed.
    """
    lines = [
        f"# rate_hz = {RATE}",
        "# samples = 36000",
        "# gyro_unit = rad/s",
        "axis,scale_s,wavelet_variance",
    ]
    for k, letter in enumerate("xyz"):
        curve = wavelet_variance(np.load(folder / "rest1.npy")[:, k], RATE)
        lines += [
            f"gyro_{letter},{s:.9g},{v:.12g}"
            for s, v in zip(curve.scale_s, curve.variance, strict=True)
        ]
    (tmp_path / "table.csv").write_text("\n".join(lines) + "\n")
    assert (
        cli.main(
            [
                "tune",
                str(tmp_path / "table.csv"),
                "--model",
                "WN+GM",
                "--out",
                str(tmp_path / "t.toml"),
                "--json",
                "-q",
            ]
        )
        == 0
    )
    document = json.loads(capsys.readouterr().out)
    alone = tune_static([folder / "rest1.npy"], OPTIONS, tmp_path / "alone.toml")
    for fit, t in zip(document["fits"], alone.tuned[:3], strict=True):
        assert_allclose([e["value"] for e in fit["estimates"]], t.kept.parameters, rtol=1e-6)
    assert not (tmp_path / "t.toml").exists()
    assert "no noise model was written" in document["notes"][0]
    assert "variances do not determine the turn-on bias" in document["turn_on_bias"][0]


def test_text_with_units_in_its_header_needs_no_options(tmp_path, capsys):
    """Oracle: the same samples as an array; white noise agrees to the digits of the text."""
    values = samples(5, 3)
    head = (
        "tow[s],"
        + ",".join(f"g{c}[deg/s]" for c in "xyz")
        + ","
        + ",".join(f"a{c}[mg]" for c in "xyz")
    )
    table = np.column_stack(
        [
            1000.0 + np.arange(len(values)) / RATE,
            np.degrees(values[:, :3]),
            values[:, 3:] / 9.80665e-3,
        ]
    )
    np.savetxt(tmp_path / "rest.csv", table, fmt="%.9g", delimiter=",", header=head, comments="")
    assert (
        cli.main(
            [
                "tune",
                str(tmp_path / "rest.csv"),
                "--model",
                "WN",
                "--weights",
                "diagonal",
                "--out",
                str(tmp_path / "a.toml"),
                "-q",
            ]
        )
        == 0
    )
    capsys.readouterr()
    save(tmp_path / "rest.npy", values)
    array = tune_static(
        [tmp_path / "rest.npy"],
        TuneOptions(**{**OPTIONS.__dict__, "model": "WN", "weights": "diagonal"}),
        tmp_path / "b.toml",
    )
    assert array.model is not None
    for sensor in ("gyro", "accel"):
        text = getattr(load_noise_model(tmp_path / "a.toml"), sensor)
        assert_allclose(
            [a.white_noise for a in text],
            [a.white_noise for a in getattr(array.model, sensor)],
            rtol=1e-4,
        )


@pytest.mark.parametrize(
    ("text", "levels"),
    [
        ("3-", (3, 4, 5, 6)),
        ("2-4", (2, 3, 4)),
        ("1, 5-", (1, 5, 6)),
        ("4", (4,)),
        ("-2", (1, 2)),
        (None, None),
    ],
)
def test_levels_in_words(text, levels):
    """Oracle: by definition, of six levels."""
    assert chosen_levels(text, 6) == levels


@pytest.mark.slow
def test_a_filtered_sensor_is_told_from_which_scale_on_the_model_fits(folder, tmp_path):
    """Oracle: the mean of neighbouring samples, which takes three quarters of the finest scale of
    white noise and little of the others.
    """
    values = np.load(folder / "rest1.npy")
    save(tmp_path / "filtered.npy", 0.5 * (values[1:] + values[:-1]))
    result = tune_static([tmp_path / "filtered.npy"], OPTIONS, tmp_path / "imu.toml")
    for t in result.tuned:
        assert t.goodness.p_value < 1e-9
        assert any(
            remark.startswith("from scale 0.") and "--levels" in remark for remark in t.remarks
        )
    text = result.summary()
    assert "does not fit (J" in text
    assert "weights of the intervals kept" in text
    advised = {
        t.name: re.search(r"fits \(p = (\S+)\): --levels (\d+-)", t.remarks[-1])
        for t in result.tuned
    }
    (levels,) = {match[2] for match in advised.values()}
    followed = tune_static(
        [tmp_path / "filtered.npy"],
        TuneOptions(**{**OPTIONS.__dict__, "levels": levels}),
        tmp_path / "followed.toml",
    )
    for t in followed.tuned:  # what is promised is what comes, to the two digits said
        assert_allclose(t.goodness.p_value, float(advised[t.name][1]), rtol=0.05)
        assert t.goodness.p_value >= 0.05
    again = tune_static(
        [tmp_path / "filtered.npy"],
        TuneOptions(**{**OPTIONS.__dict__, "levels": "7-"}),
        tmp_path / "fits.toml",
    )
    held = [
        e.low < truth(t.sensor)[e.name] < e.high for t in again.tuned for e in t.inference.estimates
    ]
    assert sum(held) >= 14


def test_scales_that_determine_the_white_noise_are_not_advised_away(tmp_path):
    """Oracle: rounding noise put in, which is most of the finest scales: a model without it that
    leaves them out would have less noise there than was measured.
    """
    rng = np.random.default_rng(3)
    n = int(12 * 60 * RATE)
    axes = (replace(GYRO, quantization=30.0 * DEG_H / RATE),) * 3 + (
        replace(ACCEL, quantization=150.0 * UG / RATE),
    ) * 3
    noise = [simulate_noise(axis, n, 1.0 / RATE, rng) for axis in axes]
    save(tmp_path / "rounded.npy", np.column_stack(noise) + np.concatenate([BIAS, GRAVITY]))
    result = tune_static([tmp_path / "rounded.npy"], OPTIONS, tmp_path / "x.toml")
    for t in result.tuned:
        assert t.goodness.p_value < 1e-9
        assert "among those that determine the white noise" in t.remarks[-1]
        assert "--model WN+2GM or QN+WN+GM" in t.remarks[-1]
        assert "--levels" not in " ".join(t.remarks)
    assert len(result.model.misfit) == 6


def test_knocks_do_not_move_the_noise(folder, tmp_path):
    """Oracle: the noise simulated, before three knocks of two seconds were put in; a knock is no
    white noise of the sensor. Robust variances know it to 2 %, the others have four times as much.
    """
    values = np.load(folder / "rest1.npy")
    rng = np.random.default_rng(0)
    size = np.std(np.diff(values, axis=0), axis=0)
    for at in (5000, 12000, 25000):
        values[at : at + 100] += 30.0 * size * rng.standard_normal((100, 6))
    save(tmp_path / "knocked.npy", values)
    joint = TuneOptions(**{**OPTIONS.__dict__, "axes": "joint"})
    result = tune_static([tmp_path / "knocked.npy"], joint, tmp_path / "x.toml")
    for t in result.tuned:
        assert all(curve.robust for curve in t.kept.curves)
        assert_allclose(t.noise.white_noise, truth(t.sensor)["white_noise"], rtol=0.02)
    assert "robust variances" in result.summary()
    plain = TuneOptions(**{**joint.__dict__, "robust": False})
    moved = tune_static([tmp_path / "knocked.npy"], plain, tmp_path / "y.toml")
    assert all(t.noise.white_noise > 2.0 * truth(t.sensor)["white_noise"] for t in moved.tuned)
    back = load_noise_model(tmp_path / "y.toml")
    assert back.misfit == moved.model.misfit
    assert [m.partition(": ")[0] for m in back.misfit] == ["gyro xyz", "accel xyz"]
    (note,) = noise_misfit(back)
    assert note.verdict == "note"
    assert note.found.startswith("gyro xyz: WN+GM does not fit (J")
    assert note.found.endswith("; and 1 more, in its file")
    assert noise_misfit(replace(back, misfit=())) == []


def test_nothing_is_written_where_the_file_falls_short_of_the_fit(folder, tmp_path, monkeypatch):
    """Oracle: a writer that halves the white noise, at the finest scale half of the deviation."""

    def halved(axis, units):
        return rounded_axis(replace(axis, white_noise=0.5 * axis.white_noise), units)

    monkeypatch.setattr("insgnss.noise.tuning.products.written.rounded_axis", halved)
    with pytest.raises(DataError, match=r"x.toml: gyro x: the noise model .* 0\.5\d* times"):
        tune_static([folder / "rest1.npy"], OPTIONS, tmp_path / "x.toml")
    assert list(tmp_path.iterdir()) == []


def test_a_process_below_a_sample_leaves_the_competition():
    """Oracle: a process of 2 ms at 50 Hz, white noise to this recording: WN is taken for it."""
    axis = AxisNoise(
        white_noise=1e-4, gauss_markov=(GaussMarkov.from_sigma(0.002, 1e-3),), random_walk=1e-5
    )
    curve = wavelet_variance(
        simulate_noise(axis, 60_000, 1.0 / RATE, np.random.default_rng(2)), RATE
    )
    names = ("WN+RW", "GM+RW", "WN+GM+RW", "WN+3GM+RW")
    assert len(rank([curve], names).candidates) == len(names)
    ranking = rank([curve], names, below_a_sample=False)
    assert len(ranking.candidates) < len(names)
    assert str(ranking.chosen.composition) == "WN+RW"
    for candidate in ranking.candidates:
        assert all(p.correlation_time_s >= 1.0 / RATE for p in candidate.fit.axis.gauss_markov)
    assert "WN+3GM+RW" in FAMILY


@pytest.mark.slow
def test_a_slow_misfit_is_not_blamed_on_fine_scales(tmp_path):
    """Oracle: a slow Gauss-Markov process put in beside the one of the model; the advice is that
    process, not fewer fine scales.
    """
    rng = np.random.default_rng(6)
    n = int(40 * 60 * RATE)
    slow = GaussMarkov.from_sigma(150.0, 60.0 * DEG_H)
    gyro = AxisNoise(white_noise=GYRO.white_noise, gauss_markov=(*GYRO.gauss_markov, slow))
    noise = [simulate_noise(axis, n, 1.0 / RATE, rng) for axis in (gyro,) * 3 + (ACCEL,) * 3]
    save(tmp_path / "slow.npy", np.column_stack(noise) + np.concatenate([BIAS, GRAVITY]))
    result = tune_static([tmp_path / "slow.npy"], OPTIONS, tmp_path / "x.toml")
    long = [r for t in result.tuned[:3] for r in t.remarks if "the misfit is at long scales" in r]
    assert long
    assert all("--model WN+2GM or WN+GM+RW" in r and "--levels" not in r for r in long)
    for t in result.tuned[:3]:
        lowest = min((j for _, j in t.inference.goodness.misfits), default=0)
        starts = [int(m[1]) for r in t.remarks for m in re.finditer(r"--levels (\d+)-", r)]
        assert all(start > lowest for start in starts)


def test_models_compete_where_none_is_named(folder, tmp_path, capsys):
    """Oracle: the processes simulated, which no smaller and no larger model of the list matches;
    the ranking is told.
    """
    argv = [
        "tune",
        str(folder / "rest1.npy"),
        *UNITS,
        "--model",
        "WN,WN+GM,WN+2GM",
        "--out",
        str(tmp_path / "x.toml"),
        "-q",
        "--axes",
        "joint",
    ]
    assert cli.main(argv) == 0
    text = capsys.readouterr().out
    assert text.count("WN+GM chosen of 3 models by WIC") == 2
    ranking = json.loads((tmp_path / "x.json").read_text())["fits"][0]["ranking"]
    assert {model["composition"] for model in ranking["models"]} == {"WN", "WN+GM", "WN+2GM"}
    assert ranking["chosen"] == "WN+GM"


@pytest.mark.slow
def test_recordings_of_different_sensors_are_told_apart(folder, tmp_path):
    """Oracle: a recording whose noise is half as large again; near-stationarity is refused, and of
    two neither is blamed.
    """
    values = np.load(folder / "rest2.npy")
    mean = values.mean(axis=0)
    save(tmp_path / "other.npy", mean + 1.5 * (values - mean))
    joint = TuneOptions(**{**OPTIONS.__dict__, "axes": "joint"})
    result = tune_static([folder / "rest1.npy", tmp_path / "other.npy"], joint, tmp_path / "x.toml")
    for t in result.tuned:
        assert t.stationarity is not None
        assert t.stationarity.p_value < 1e-6
    text = result.summary()
    assert "one parameter set does not serve both recordings: they differ" in text
    assert "curve 1" not in text
    same = tune_static([folder / "rest1.npy", folder / "rest2.npy"], joint, tmp_path / "same.toml")
    assert all(t.stationarity is not None and t.stationarity.p_value > 1e-3 for t in same.tuned)


@pytest.mark.slow
def test_a_warm_up_is_told_with_what_to_skip(folder, tmp_path):
    """Oracle: 400 deg/h put in, settling with a minute; three time constants are three minutes, and
    without them there is no trend.
    """
    values = np.load(folder / "rest1.npy")
    t = np.arange(len(values)) / RATE
    values[:, 1] += 400.0 * DEG_H * np.exp(-t / 60.0)
    save(tmp_path / "cold.npy", values)
    cold = tune_static([tmp_path / "cold.npy"], OPTIONS, tmp_path / "cold.toml")
    line = next(line for line in cold.summary().splitlines() if "warm-up" in line)
    assert "axis y settle after the start" in line
    there = [(t.name, trend) for t in cold.tuned for _, _, trend in t.trends if trend.is_there]
    assert [name for name, _ in there] == ["gyro y"]
    assert 30.0 < there[0][1].time_s < 120.0
    warm = tune_static(
        [tmp_path / "cold.npy"],
        TuneOptions(**{**OPTIONS.__dict__, "skip_s": 240.0}),
        tmp_path / "warm.toml",
    )
    assert "warm-up" not in warm.summary()
    assert warm.recordings[0].begin_s == 240.0


@pytest.mark.slow
def test_bootstrap_and_robust_variances_are_there_for_the_asking(folder, tmp_path, capsys):
    """Oracle: theory's own interval of white noise, half to twice; the table says how both were
    made.
    """
    argv = [
        "tune",
        str(folder / "rest1.npy"),
        *UNITS,
        "--model",
        "WN",
        "--levels",
        "-3",
        "--axes",
        "joint",
        "-q",
        "--json",
    ]
    assert cli.main([*argv, "--bootstrap", "100", "--out", str(tmp_path / "x.toml")]) == 0
    fit = json.loads(capsys.readouterr().out)["fits"][0]
    assert fit["intervals"] == "bootstrap"
    assert fit["j_test"]["draws"] == 100
    (white,) = fit["estimates"]
    ratio = (white["high"] - white["low"]) / (2 * 1.96 * white["standard_error"])
    assert 0.5 < ratio < 2.0
    assert cli.main([*argv, "--robust", "--out", str(tmp_path / "y.toml")]) == 0
    robust = json.loads(capsys.readouterr().out)["fits"][0]
    assert all(curve["robust"] for curve in robust["curves"])
    assert_allclose(robust["estimates"][0]["value"], white["value"], rtol=0.02)
