"""The command line: dispatch, exit codes and streams, with made-up results behind the verbs."""

import io
import json
import os
import shlex
import subprocess
import sys
import types
import warnings
from ast import literal_eval
from pathlib import Path

import numpy as np
import pytest

import insgnss.flight.processing
from insgnss.base.errors import DataError, InputError, UsageError
from insgnss.cli import build_parser, main
from insgnss.cli.console import Progress
from insgnss.cli.main import VERBS

HEAVY = ("numpy", "numba", "scipy", "matplotlib", "pandas", "pyproj", "georinex", "filterpy")


@pytest.fixture
def flight(tmp_path):
    """A flight file whose inputs exist."""
    for name in ("imu.csv", "gnss.txt"):
        (tmp_path / name).write_text("1\n")
    (tmp_path / "flight.toml").write_text(
        'name = "f"\n[imu]\nfile = "imu.csv"\n[gnss]\nfile = "gnss.txt"\n'
    )
    return tmp_path / "flight.toml"


@pytest.fixture
def pipeline(monkeypatch):
    """A module in the place of insgnss.flight.processing.pipeline; tests put functions into it."""
    module = types.ModuleType("insgnss.flight.processing.pipeline")
    monkeypatch.setitem(sys.modules, "insgnss.flight.processing.pipeline", module)
    monkeypatch.setattr(insgnss.flight.processing, "pipeline", module, raising=False)
    return module


@pytest.fixture
def inspection(monkeypatch):
    """Modules in the places of those behind `inspect`; tests put functions into the first."""
    module, files = (
        types.ModuleType("insgnss.flight.inspection.described"),
        types.ModuleType("insgnss.flight.inspection.run"),
    )
    module.flight_file = lambda sources, write: sources[0]
    files.inspect_files = None
    for made_up in (module, files):
        monkeypatch.setitem(sys.modules, made_up.__name__, made_up)
    return module


def _raising(error):
    def process(flight, out, progress, force, compare):
        raise error

    return process


def test_process_hands_over_flight_directory_and_progress_and_prints_the_summary(
    pipeline, flight, tmp_path, capsys
):
    """Oracle: the arguments of the command and the summary of the made-up result."""
    seen = {}

    def process(loaded, out, progress, force, compare):
        progress("smoothing")
        seen.update(name=loaded.name, out=out)
        return types.SimpleNamespace(report={}, files=[], summary=lambda: "12 images")

    pipeline.process = process
    assert main(["process", str(flight), "--out", str(tmp_path / "here")]) == 0
    assert seen == {"name": "f", "out": tmp_path / "here"}
    streams = capsys.readouterr()
    step, summary = streams.out.splitlines()
    assert step.endswith("s] smoothing")
    assert summary == "12 images"
    assert streams.err == ""


def test_quiet_leaves_the_summary_alone(pipeline, flight, capsys):
    """Oracle: the summary of the made-up result."""

    def process(loaded, out, progress, force, compare):
        progress("smoothing")
        assert out is None
        return types.SimpleNamespace(report={}, summary=lambda: "12 images")

    pipeline.process = process
    assert main(["process", "--quiet", str(flight)]) == 0
    assert capsys.readouterr().out == "12 images\n"


def test_json_of_process_is_its_report_in_plain_types(pipeline, flight, capsys):
    """Oracle: json; values that are not finite have no JSON and become null."""
    report = {
        "sigma": np.array([0.5, np.nan]),
        "n": np.int64(3),
        "file": Path("a/b"),
        "tuple": (1, None, True),
        "inf": np.inf,
        4: "key",
    }

    def process(loaded, out, progress, force, compare):
        progress("smoothing")
        return types.SimpleNamespace(as_dict=lambda: report, summary=lambda: "not shown")

    pipeline.process = process
    assert main(["process", str(flight), "--json"]) == 0
    expected = {
        "sigma": [0.5, None],
        "n": 3,
        "file": "a/b",
        "tuple": [1, None, True],
        "inf": None,
        "4": "key",
    }
    assert json.loads(capsys.readouterr().out) == expected


@pytest.mark.parametrize(
    ("error", "code", "line"),
    [
        (InputError("imu.csv:7: bad"), 3, "insgnss: error: imu.csv:7: bad\n"),
        (DataError("no motion;\nfly"), 4, "insgnss: error: no motion; fly\n"),
        (
            PermissionError(13, "Permission denied", "out/eo.json"),
            3,
            "insgnss: error: out/eo.json: Permission denied; check path,",
        ),
        (
            OSError(28, "No space left on device"),
            3,
            "insgnss: error: No space left on device; check path,",
        ),
        (
            MemoryError("Unable to allocate 7.45 GiB for an array with shape (1000000000,)"),
            4,
            "insgnss: error: memory is exhausted: Unable to allocate 7.45 GiB for an array",
        ),
        (MemoryError(), 4, "insgnss: error: memory is exhausted, "),
        (KeyboardInterrupt(), 130, "insgnss: error: interrupted\n"),
        (
            ZeroDivisionError("by zero"),
            1,
            "insgnss: internal error: ZeroDivisionError: by zero (at ",
        ),
    ],
)
@pytest.mark.parametrize("as_json", [False, True])
def test_every_error_is_one_line_and_its_exit_code(
    pipeline, flight, capsys, error, code, line, as_json
):
    """Oracle: the exit codes of the contract."""
    pipeline.process = _raising(error)
    assert main(["process", str(flight), *(["--json"] if as_json else [])]) == code
    streams = capsys.readouterr()
    assert streams.err.startswith(line)
    assert streams.err.count("\n") == 1
    assert "Traceback" not in streams.err
    if as_json:
        verdict = json.loads(streams.out)
        assert verdict["exit_code"] == code
        assert verdict["error"] in streams.err
    else:
        assert streams.out == ""


def test_a_program_is_taken_from_the_command_line_alone(pipeline, flight, capsys):
    """Oracle: the path that was typed; a flight without raw observations has no use for it."""
    for name in ("rover", "base", "nav"):
        (flight.parent / name).write_text("x\n")
    argv = ["process", str(flight), "--engine", "/opt/rnx2rtkp", "--json"]
    assert main(argv) == 2
    assert "--engine /opt/rnx2rtkp is for raw observations, and " in capsys.readouterr().err
    raw = 'rover = "rover"\nbase = "base"\nnavigation = ["nav"]\nengine = "auto"'
    flight.write_text(flight.read_text().replace('file = "gnss.txt"', raw))
    taken = []

    def process(flight, out, progress, force, compare):
        taken.append(flight.gnss.raw.engine)
        raise DataError("enough")

    pipeline.process = process
    assert main(argv) == 4
    assert main(["process", str(flight)]) == 4
    assert taken == ["/opt/rnx2rtkp", "auto"]


def test_debug_shows_the_traceback(pipeline, flight, capsys):
    """Oracle: the interpreter's word for it."""
    pipeline.process = _raising(ZeroDivisionError("by zero"))
    assert main(["process", str(flight), "--debug"]) == 1
    assert "Traceback (most recent call last)" in capsys.readouterr().err


def test_a_wrong_flight_file_is_bad_input_before_anything_runs(pipeline, tmp_path, capsys):
    """Oracle: the exit code of the contract; the made-up pipeline has no `process` to run."""
    assert main(["process", str(tmp_path / "none.toml")]) == 3
    assert "none.toml: does not exist" in capsys.readouterr().err


@pytest.mark.filterwarnings("default")
def test_warnings_are_one_line_each(pipeline, flight, capsys):
    """Oracle: the text of the warning."""

    def process(loaded, out, progress, force, compare):
        warnings.warn("3 fixes\nleft out", UserWarning, stacklevel=1)
        return types.SimpleNamespace(report={}, summary=lambda: "done")

    pipeline.process = process
    assert main(["process", str(flight)]) == 0
    assert capsys.readouterr().err == "insgnss: warning: 3 fixes left out\n"


def _inspection(*contradictions):
    refusal = InputError("; ".join(contradictions)) if contradictions else None
    return types.SimpleNamespace(
        summary=lambda: "the table", as_dict=lambda: {"rate_hz": 500.0}, refusal=refusal
    )


def test_inspect_prints_the_table(inspection, flight, capsys):
    """Oracle: the made-up result."""
    inspection.inspect_flight = lambda path, progress: _inspection()
    assert main(["inspect", str(flight)]) == 0
    assert capsys.readouterr().out == "the table\n"
    assert main(["inspect", str(flight), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"rate_hz": 500.0}


def test_inspect_prints_the_table_and_then_the_contradictions(inspection, flight, capsys):
    """Oracle: the made-up contradictions; exit code 3 of the contract, one error line, one JSON
    document.
    """
    inspection.inspect_flight = lambda path, progress: _inspection(
        "gyro looks like deg/s", "clock is off"
    )
    error = f"{flight}: gyro looks like deg/s; clock is off"
    for more in ([], ["--json"]):
        assert main(["inspect", str(flight), *more]) == 3
        streams = capsys.readouterr()
        assert streams.err == f"insgnss: error: {error}\n"
        assert (
            streams.out == "the table\n"
            if not more
            else json.loads(streams.out) == {"rate_hz": 500.0, "error": error, "exit_code": 3}
        )


def test_demo_hands_over_its_options(monkeypatch, capsys):
    """Oracle: the arguments of the command, and the defaults that --help states."""
    seen = []

    def demo(directory, minutes, seed, progress):
        seen.append((directory, minutes, seed))
        return types.SimpleNamespace(summary=lambda: "errors", as_dict=lambda: {"seed": seed})

    module = types.ModuleType("insgnss.api.demo")
    module.demo = demo
    monkeypatch.setitem(sys.modules, "insgnss.api.demo", module)
    assert main(["demo"]) == 0
    assert main(["demo", "there", "--minutes", "2.5", "--seed", "7", "--json"]) == 0
    assert seen == [(None, 8.0, 0), (Path("there"), 2.5, 7)]
    text, document = capsys.readouterr().out.split("\n", 1)
    assert text == "errors"
    assert json.loads(document) == {"seed": 7}


def test_simulate_hands_over_its_options_and_names_the_next_step(monkeypatch, capsys):
    """Oracle: the arguments of the command, and the defaults that --help states."""
    seen = []
    module = types.ModuleType("insgnss.simulation.dataset")
    module.write_dataset = lambda directory, **options: seen.append((directory, options))
    monkeypatch.setitem(sys.modules, "insgnss.simulation.dataset", module)
    assert main(["simulate", "-q", "d"]) == 0
    given = "--flight car --minutes 3 --imu-rate 250 --vibration 3 --seed 9"
    assert main(["simulate", "-q", "d", *given.split()]) == 0
    assert seen[0] == (
        Path("d"),
        {"flight": "ign8", "minutes": None, "imu_rate": 500.0, "vibration": 1.0, "seed": 0},
    )
    assert seen[1] == (
        Path("d"),
        {"flight": "car", "minutes": 3.0, "imu_rate": 250.0, "vibration": 3.0, "seed": 9},
    )
    assert f"next: insgnss process {Path('d') / 'flight.toml'}" in capsys.readouterr().out


@pytest.fixture
def master(tmp_path):
    """The eo.json of one image, seen from above at the origin."""
    import numpy as np

    from insgnss.io.formats.orientation.eo_json import write_eo_json
    from insgnss.records import ExteriorOrientation

    one, eye = np.ones(1), np.eye(3)
    down = np.diag([1.0, -1.0, -1.0])[None]
    origin, position = (
        np.array([np.radians(46.57), np.radians(6.54), 0.0]),
        np.array([[1.0, 2.0, 630.0]]),
    )
    eo = ExteriorOrientation(
        ("8001.tif",),
        one,
        2008,
        origin,
        position,
        down,
        1e-4 * np.eye(6)[None],
        np.zeros((0, 6, 6)),
        eye,
        eye,
    )
    write_eo_json(eo, tmp_path / "eo.json")
    return tmp_path / "eo.json"


def test_export_writes_beside_the_master_or_where_asked(master, tmp_path, capsys):
    """Oracle: the usual names of design.md 6; the place of the image in its tangent plane and by
    pyproj in LV95.
    """
    from pyproj import Transformer

    assert main(["export", str(master), "eo_local_plane", "-q"]) == 0
    out = tmp_path / "table.txt"
    table = [
        "generic_ascii",
        "--crs",
        "EPSG:2056",
        "--set",
        "columns=image,x,y,z",
        "--set",
        "decimals_m=3",
    ]
    assert main(["export", str(master), *table, "--out", str(out), "--json"]) == 0
    text, document = capsys.readouterr().out.split("\n", 1)
    assert text == str(tmp_path / "EO_local-plane.txt")
    assert (
        (tmp_path / "EO_local-plane.txt")
        .read_text()
        .splitlines()[-1]
        .startswith("8001.tif 1.0000 2.0000 630.0000 ")
    )
    result = json.loads(document)
    assert (result["format"], result["file"]) == ("generic_ascii", str(out))
    assert any("not above sea level" in note for note in result["notes"])
    assert any("--ground (ground_m in Python)" in note for note in result["notes"])
    image, E, N, h = out.read_text().splitlines()[-1].split()
    lon, lat, _ = Transformer.from_crs("EPSG:2056", "EPSG:4326", always_xy=True).transform(
        float(E), float(N), float(h)
    )
    assert (image, h) == ("8001.tif", "630.000")
    assert (lat - 46.57) * 111e3 == pytest.approx(2.0, abs=0.1)
    assert (lon - 6.54) * 76.6e3 == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize(
    ("argv", "says"),
    [
        (["metashap"], "export: format 'metashap' is unknown; did you mean 'metashape'?"),
        (
            ["eo_local_plane", "--crs", "EPSG:2056"],
            "eo_local_plane cannot carry a frame of kind projected; it carries tangent plane",
        ),
        (["opf"], "opf needs a projected CRS; name it, such as EPSG:2056"),
        (["metashape", "--crs", "EPSG:1"], "CRS 'EPSG:1' is unknown"),
        (["metashape", "--set", "unit=gon"], "metashape has no option 'unit'; it takes none"),
        (["metashape", "--set", "unit"], "--set 'unit' is not KEY=VALUE"),
        (
            ["eo_json", "--out", "{master}"],
            "is the input orientation, which is never overwritten; give another file",
        ),
        (
            ["metashape", "--geoid", "nowhere.gtx"],
            "takes heights above the ellipsoid; leave the geoid out or name a CRS",
        ),
        (
            ["metashape", "--crs", "EPSG:2056", "--geoid", "nowhere.gtx"],
            "geoid nowhere.gtx: does not exist",
        ),
        (["metashape", "--ground", "500"], "heights are scaled only in a projected CRS"),
        (
            ["metashape", "--crs", "EPSG:2056", "--ground", "5000"],
            "is not below the cameras, the lowest of which is at 630.0 m",
        ),
        (["metashape", "--crs", "EPSG:2056", "--ground", "nan"], "--ground nan: must be a number"),
        (
            ["kml"],
            (
                "has heights above sea level; name a grid of geoid heights (--geoid GRID,"
                " output.geoid)"
            ),
        ),
    ],
)
def test_wrong_exports_are_one_line_and_leave_nothing(argv, says, master, tmp_path, capsys):
    """Oracle: the exit code of the contract, and the directory's listing."""
    argv = [word.format(master=master) for word in argv]
    assert main(["export", str(master), *argv, "-q"]) == 2
    error = capsys.readouterr().err
    assert says in error
    assert error.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["eo.json"]


def _geoid(path):
    """A grid of 49.5 m everywhere around the master's image."""
    import numpy as np

    head = (
        np.array([46.0, 6.0, 0.5, 0.5]).astype(">f8").tobytes()
        + np.array([4, 4]).astype(">i4").tobytes()
    )
    path.write_bytes(head + np.full(16, 49.5).astype(">f4").tobytes())


def test_a_geoid_is_found_beside_where_one_stands(master, tmp_path, capsys, monkeypatch):
    """Oracle: 630.0 m less the grid's 49.5."""
    monkeypatch.chdir(tmp_path)
    _geoid(tmp_path / "my.gtx")
    table = ["generic_ascii", "--set", "columns=image,z", "--out", "t.txt", "-q"]
    assert main(["export", str(master), *table, "--crs", "EPSG:32632", "--geoid", "my.gtx"]) == 0
    assert float((tmp_path / "t.txt").read_text().split()[-1]) == pytest.approx(580.5, abs=1e-3)
    (tmp_path / "no.gtx").write_text("no grid")
    assert main(["export", str(master), *table, "--crs", "EPSG:32632", "--geoid", "no.gtx"]) == 3
    assert "no.gtx: is no grid of geoid heights" in capsys.readouterr().err


def test_a_crs_of_another_place_is_told(master, capsys):
    """Oracle: the area of use of EPSG:32732 in the registry, which is south of the equator."""
    assert main(["export", str(master), "metashape", "--crs", "EPSG:32732", "-q"]) == 0
    assert "1 of 1 images lie outside of the area of" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('"cov6":[[0.0001,0.0', '"cov6":[[-0.0001,0.0', "image 8001.tif: cov6 is no covariance"),
        ('"cov6":[[0.0001,0.0', '"cov6":[[0.0001,0.00005', "image 8001.tif: cov6 is no covariance"),
    ],
)
def test_a_damaged_master_is_bad_input(old, new, says, master, capsys):
    """Oracle: the exit code of the contract."""
    text = master.read_text()
    assert old in text
    master.write_text(text.replace(old, new, 1))
    assert main(["export", str(master), "metashape", "-q"]) == 3
    assert says in capsys.readouterr().err


def test_two_images_of_one_name_are_bad_input(tmp_path, capsys):
    """Oracle: the exit code of the contract."""
    import numpy as np

    from insgnss.io.formats.orientation.eo_json import write_eo_json
    from insgnss.records import ExteriorOrientation

    eye, down = np.eye(3), np.broadcast_to(np.diag([1.0, -1.0, -1.0]), (2, 3, 3))
    cov = np.broadcast_to(1e-4 * np.eye(6), (2, 6, 6))
    place, origin = np.array([[1.0, 2.0, 630.0], [9.0, 2.0, 630.0]]), np.array([0.8, 0.1, 0.0])
    eo = ExteriorOrientation(
        ("a.tif", "a.tif"),
        np.array([1.0, 2.0]),
        2008,
        origin,
        place,
        down,
        cov,
        np.zeros((1, 6, 6)),
        eye,
        eye,
    )
    write_eo_json(eo, tmp_path / "eo.json")
    assert main(["export", str(tmp_path / "eo.json"), "opensfm", "-q"]) == 3
    assert "image 'a.tif' occurs 2 times" in capsys.readouterr().err


def test_export_takes_the_directory_of_a_run(master, capsys):
    """Oracle: the file beside the master; one line where there is none."""
    assert main(["export", str(master.parent), "eo_local_plane", "-q"]) == 0
    assert (master.parent / "EO_local-plane.txt").is_file()
    master.unlink()
    assert main(["export", str(master.parent), "eo_local_plane", "-q"]) == 2
    assert "holds neither eo.json nor camera_positions.csv" in capsys.readouterr().err


BELOW = ("imu", "materialise", "mounting", "similarity", "tripod")


@pytest.mark.parametrize(
    "words", [*((verb,) for verb in VERBS), *(("calibrate", v) for v in BELOW)]
)
def test_examples_of_the_help_are_commands(words, capsys):
    """Oracle: the parser that a user's words go through; those that need no file run."""
    assert main([*words, "--help"]) == 0
    text = capsys.readouterr().out.partition("\nexample")[2].partition("\nformats:")[0]
    lines = text.replace("\\\n", " ").splitlines()
    commands = [line.strip() for line in lines if line.startswith("  insgnss ")]
    assert commands or words == ("calibrate",)
    for command in commands:
        build_parser().parse_args(shlex.split(command.partition(" > ")[0])[1:])


def test_the_noise_example_runs(tmp_path, monkeypatch, capsys):
    """Oracle: the example of the help that needs nothing but a shipped model."""
    monkeypatch.chdir(tmp_path)
    assert main(["export", "--help"]) == 0
    example = next(line for line in capsys.readouterr().out.splitlines() if "kalibr --set" in line)
    assert main([*shlex.split(example)[1:], "-q"]) == 0
    assert (tmp_path / "imu.yaml").is_file()


def test_export_help_lists_the_formats(capsys):
    """Oracle: the registries, of orientations and of noise models."""
    from insgnss.io.formats import EXPORTS
    from insgnss.noise.processes.consumers import CONSUMER_FORMS

    assert main(["export", "--help"]) == 0
    text = capsys.readouterr().out.partition("formats:\n")[2]
    orientations, noise = (
        [line for line in part.splitlines() if line.strip()]
        for part in text.split("of a noise model:\n")
    )
    assert {line.split()[0] for line in noise} == set(CONSUMER_FORMS)
    assert {line.split()[0] for line in orientations} == set(EXPORTS)


@pytest.mark.parametrize(
    ("argv", "says"),
    [
        ([], "required: VERB"),
        (["proces", "f"], "invalid choice: 'proces'"),
        (["process"], "required: FLIGHT"),
        (["process", "f", "--outt", "d"], "unrecognized arguments: --outt d (is it --out?); see"),
        (
            ["calibrate", "imu", "f", "--heigth", "1"],
            "(is it --height?); see insgnss calibrate imu",
        ),
        (["demo", "--out", "d"], "unrecognized arguments: --out; see insgnss demo --help"),
        (["demo", "--minutes", "0"], "demo: --minutes 0.0: must be greater than zero"),
        (["demo", "--minutes", "nan"], "demo: --minutes nan: must be a number greater than zero"),
        (["demo", "--minutes", "two"], "--minutes"),
        (["demo", "--seed", "1.5"], "--seed"),
        (["simulate", "d", "--flight", "ign9"], "invalid choice: 'ign9'"),
    ],
)
def test_wrong_use_is_one_line_and_exit_code_2(argv, says, capsys):
    """Oracle: the exit code of the contract."""
    assert main(argv) == 2
    error = capsys.readouterr().err
    assert says in error
    assert error.startswith("insgnss: error: ")
    assert error.count("\n") == 1
    assert "--help" in error


@pytest.mark.parametrize("value", ["-53.2804,9.0578,70", "-.5,-9,0", "-33,151,0", "-1e1,2,3"])
@pytest.mark.parametrize(
    ("argv", "option"),
    [
        (
            [
                "ppk",
                "r.18o",
                "--base",
                "b.18o",
                "--navigation",
                "b.18n",
                "--base-position",
                "VALUE",
                "--out",
                "d",
            ],
            "base_position",
        ),
        (
            ["ppk", "r.18o", "--base", "b.18o", "--navigation", "b.18n", "--origin", "VALUE"],
            "origin",
        ),
        (["compare", "a", "b", "--origin", "VALUE", "--shift", "-1.5"], "origin"),
    ],
)
def test_coordinates_of_the_southern_hemisphere_are_values(argv, option, value):
    """Oracle: what stands on the command line; argparse alone takes a minus with commas behind it
    for an option.
    """
    given = build_parser().parse_args([value if word == "VALUE" else word for word in argv])
    assert getattr(given, option) == tuple(map(float, value.split(",")))
    with pytest.raises(UsageError, match="unrecognized arguments: -x"):
        build_parser().parse_args([*argv, "-x"])


def test_wrong_use_with_json_says_so_on_standard_output(capsys):
    """Oracle: the exit code of the contract."""
    assert main(["process", "--json"]) == 2
    assert json.loads(capsys.readouterr().out)["exit_code"] == 2


@pytest.mark.parametrize("verb", ["demo", "simulate", "inspect", "process"])
def test_help_of_a_verb_has_an_example_that_parses(verb, capsys):
    """Oracle: the parser itself, fed with the printed example; --help after it stops before the
    verb runs.
    """
    assert main([verb, "--help"]) == 0
    example = capsys.readouterr().out.partition("example:\n")[2].strip().splitlines()[-1].split()
    assert example[:2] == ["insgnss", verb]
    assert main([*example[1:], "--help"]) == 0


def test_version(capsys):
    """Oracle: the package's version."""
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"insgnss {insgnss.__version__}\n"


class Terminal(io.StringIO):
    """Standard error that is a terminal."""

    def isatty(self):
        return True


def test_progress_renews_one_line_on_a_terminal(monkeypatch):
    """Oracle: the control sequences of a terminal, return and erase to the end of the line."""
    monkeypatch.setenv("TERM", "xterm")
    terminal, lines = Terminal(), io.StringIO()
    progress = Progress(terminal, lines)
    progress("reading")
    progress("smoothing")
    progress.clear()
    assert "\n" not in terminal.getvalue()
    parts = terminal.getvalue().split("\r\x1b[K")
    assert [part.partition("] ")[2] for part in parts] == ["", "reading", "smoothing", ""]
    assert lines.getvalue() == ""


def test_a_terminal_without_control_sequences_gets_plain_lines(monkeypatch):
    """Oracle: the name by which such a terminal is known; there is no escape in what it gets."""
    monkeypatch.setenv("TERM", "dumb")
    terminal, lines = Terminal(), io.StringIO()
    progress = Progress(terminal, lines)
    progress("reading")
    progress.clear()
    assert terminal.getvalue() == ""
    assert lines.getvalue().endswith("s] reading\n")


@pytest.mark.parametrize("argv", [["--help"], ["process", "--help"], ["process", "none.toml"]])
def test_nothing_is_coloured_even_where_colours_are_asked_for(argv, monkeypatch, capsys):
    """Oracle: the escape character that begins every colour; NO_COLOR changes nothing."""
    texts = []
    for wish in ("FORCE_COLOR", "NO_COLOR"):
        with monkeypatch.context() as environment:
            environment.setenv(wish, "1")
            main(argv)
        streams = capsys.readouterr()
        texts.append(streams.out + streams.err)
    assert texts[0] == texts[1]
    assert "\x1b" not in texts[0]


def test_quiet_shows_no_steps_on_a_terminal(monkeypatch):
    """Oracle: both streams, empty."""
    monkeypatch.setenv("TERM", "xterm")
    terminal, lines = Terminal(), io.StringIO()
    progress = Progress(terminal, lines, quiet=True)
    progress("reading")
    progress.clear()
    assert terminal.getvalue() == lines.getvalue() == ""


def _python(*args, **options):
    return subprocess.run(
        [sys.executable, *args], capture_output=True, text=True, timeout=60, check=False, **options
    )


def test_help_imports_nothing_heavy():
    """Oracle: sys.modules of a fresh interpreter."""
    code = (
        f"import sys; from insgnss.cli import main; main(['--help']); print([m for m in {HEAVY} if"
        " m in sys.modules])"
    )
    run = _python("-c", code)
    assert run.returncode == 0, run.stderr
    assert run.stdout.splitlines()[-1] == "[]"


@pytest.mark.parametrize(
    ("words", "modules"),
    [
        (["--help"], {"main", "console"}),
        (["compare", "--help"], {"main", "console", "verb", "compare"}),
        (["calibrate", "--help"], {"main", "console", "verb", "calibrate"}),
    ],
)
def test_a_command_imports_no_other_verb(words, modules):
    """Oracle: sys.modules of a fresh interpreter."""
    code = (
        f"import sys; from insgnss.cli import main; main({words});"
        " print([m.split('.')[2] for m in sys.modules if m.startswith('insgnss.cli.')])"
    )
    run = _python("-c", code)
    assert run.returncode == 0, run.stderr
    assert set(literal_eval(run.stdout.splitlines()[-1])) == modules


def test_the_module_runs_and_returns_the_exit_code():
    """Oracle: the exit code of the contract, seen by the operating system."""
    run = _python("-m", "insgnss", "nonsense")
    assert (run.returncode, run.stderr.count("\n")) == (2, 1)


@pytest.mark.skipif(os.name == "nt", reason="POSIX pipes")
def test_a_reader_that_leaves_early_is_no_error():
    """Oracle: a pipe whose reading end is closed before the program writes."""
    read, write = os.pipe()
    os.close(read)
    run = subprocess.run(
        [sys.executable, "-m", "insgnss", "--help"],
        stdout=write,
        stderr=subprocess.PIPE,
        timeout=60,
        check=False,
    )
    os.close(write)
    assert (run.returncode, run.stderr) == (0, b"")


def test_a_misspelt_verb_is_answered_with_the_one_it_may_be(capsys):
    """Oracle: the verbs; a word like none of them gets them all."""
    assert main(["proces", "flight.toml"]) == 2
    assert "'proces'; did you mean process?; see insgnss --help" in capsys.readouterr().err
    assert main(["xyzzy"]) == 2
    assert "choose from 'demo', 'simulate'" in capsys.readouterr().err
