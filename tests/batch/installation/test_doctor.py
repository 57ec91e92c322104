"""`insgnss doctor`: packages by made-up metadata, places on disk, the self-test, exit codes."""

import json
import sys
import types
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest

import insgnss
from insgnss.base.errors import UsageError
from insgnss.base.findings import Finding, Question
from insgnss.batch.installation import examination, packages
from insgnss.batch.installation.examination import engine_finding, grid_findings, kernel_findings
from insgnss.batch.installation.limits import limits_of, read_limits
from insgnss.batch.installation.packages import import_failures, module_of, package_findings
from insgnss.batch.installation.self_test import LIMIT_DEG, LIMIT_M, SelfTest, self_test
from insgnss.cli import main


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """A package `made-up` with its metadata on disk, and a function that installs others."""

    def install(name, version, requires=(), modules=None):
        folder = tmp_path / f"{name.replace('-', '_')}-{version}.dist-info"
        folder.mkdir()
        rows = [f"Requires-Dist: {line}\n" for line in requires]
        (folder / "METADATA").write_text(
            f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n" + "".join(rows)
        )
        files = dict(modules or {})
        for file, text in files.items():
            (tmp_path / file).parent.mkdir(exist_ok=True)
            (tmp_path / file).write_text(text)
        (folder / "RECORD").write_text("".join(f"{file},,\n" for file in files))

    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    return install


def test_packages_are_those_of_the_metadata_each_with_what_is_wrong(installed):
    """Oracle: made-up packages: one that is right, one old, one missing, one that raises, and one
    that ends the process that loads it before the last one's turn.
    """
    extras = ["lacking>=1; extra == 'more'", "zz_last>=0.9 ; extra == 'more'"]
    needed = ["goodone>=1.9", "oldone>=2.1", "Raising", "dying-lib>=1", *extras]
    installed("made-up", "3", needed)
    installed("goodone", "1.10.dev3", modules={"good_one/__init__.py": "", "tests/__init__.py": ""})
    installed("oldone", "2.0.7", modules={"oldone.py": ""})
    installed("Raising", "1", modules={"raising.py": "raise OSError('libfoo.so:\\n not there')"})
    installed("dying-lib", "1", modules={"dyinglib.py": "import os; os._exit(7)"})
    installed("zz_last", "1.0rc1", modules={"zz_last.py": "print('noise')"})
    assert module_of("goodone") == "good_one"
    found = {f.name: f for f in package_findings("made-up")}
    assert {name: f.verdict for name, f in found.items()} == {
        "goodone": "ok",
        "oldone": "contradiction",
        "Raising": "contradiction",
        "dying-lib": "contradiction",
        "more": "note",
    }
    assert found["oldone"].found == "2.0.7 is older than 2.1"
    assert found["oldone"].advice == "pip install --upgrade 'oldone>=2.1'"
    assert "cannot be imported (OSError: libfoo.so: not there)" in found["Raising"].found
    assert "ends its process (code 7)" in found["dying-lib"].found
    assert found["more"].found == "lacking missing, zz_last 1.0rc1"
    assert "made-up[more]" in found["more"].advice


def test_a_library_that_hangs_is_given_up(installed, monkeypatch):
    """Oracle: a module that sleeps for an hour."""
    monkeypatch.setattr(packages, "IMPORT_S", 0.5)
    installed("sleepy", "1", modules={"sleepy.py": "import time; time.sleep(3600)"})
    assert import_failures(["sleepy"]) == {"sleepy": "takes more than 0.5 s"}


def test_without_metadata_the_extras_are_unknown(monkeypatch):
    """Oracle: the standard library's own error for a package that is not installed."""
    (finding,) = package_findings("insgnss-that-nobody-installed")
    assert finding.verdict == "unknown"
    assert "pip install ." in finding.advice


def test_this_package_names_its_extras_once():
    """Oracle: pyproject.toml, where the metadata of the installation are of it."""
    import tomllib

    project = Path(insgnss.__file__).parents[1] / "pyproject.toml"
    if not project.is_file():
        pytest.skip("the installed package has no pyproject.toml")
    table = tomllib.loads(project.read_text(encoding="utf-8"))["project"]
    try:
        listed = packages.requirements()
    except metadata.PackageNotFoundError:
        pytest.skip("not installed")
    assert {r.extra for r in listed} - {""} <= set(table["optional-dependencies"])
    # the metadata are those of the last installation, which may be older
    assert {r.name for r in listed if not r.extra} <= {
        line.partition(">")[0] for line in table["dependencies"]
    }


def test_the_self_test_agrees_with_its_closed_form():
    """Oracle: (I.1); a tenth of the limits is left."""
    result = self_test()
    assert result.passed
    assert result.off_m < 0.2 * LIMIT_M
    assert result.off_deg < 0.2 * LIMIT_DEG
    assert result.finding().verdict == "ok"


def test_the_self_test_sees_an_earth_that_does_not_turn(monkeypatch):
    """Oracle: Coriolis: 2 Omega v t^2 / 2 is a metre in 30 s at 16 m/s."""
    from insgnss.batch.installation import self_test as module

    integrate = module.free_inertial

    class Resting:
        def __init__(self, frame):
            self.origin_ecef, self.C_el = frame.origin_ecef, frame.C_el
            self.C_el_of_gravity, self.earth_rate_l = frame.C_el_of_gravity, np.zeros(3)

    monkeypatch.setattr(
        module, "free_inertial", lambda inc, frame, nav: integrate(inc, Resting(frame), nav)
    )
    result = self_test()
    assert not result.passed
    assert 0.1 < result.off_m < 10.0
    assert "NUMBA_CACHE_DIR" in result.finding().advice
    assert not SelfTest(float("nan"), 0.0, 0.0, "").passed


def test_the_cache_of_kernels_is_told_with_whether_it_can_be_written(tmp_path, monkeypatch):
    """Oracle: directories that can and that cannot be made: below a file there is none."""

    def kernel(path):
        return types.SimpleNamespace(_cache=types.SimpleNamespace(cache_path=str(path)))

    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    (good,) = kernel_findings(kernel(tmp_path / "made"))
    assert (good.verdict, good.advice) == ("ok", "")
    assert f"{tmp_path / 'made'} (NUMBA_CACHE_DIR), writable" in good.found
    (tmp_path / "file").write_text("")
    (bad,) = kernel_findings(kernel(tmp_path / "file" / "cache"))
    assert bad.verdict == "note"
    assert "cannot be written" in bad.found
    assert "set NUMBA_CACHE_DIR" in bad.advice
    (none,) = kernel_findings(lambda: None)
    assert "interprets" in none.found


def test_grids_are_counted_in_the_directories_of_proj(tmp_path, monkeypatch):
    """Oracle: files by hand, of which two are grids; pyproj's own directories otherwise."""
    from pyproj import datadir

    for name in ("egm96_15.gtx", "ch_swisstopo_chgeo2004_ETRS89_LHN95.tif", "proj.db"):
        (tmp_path / name).write_text("")
    monkeypatch.setattr(datadir, "get_user_data_dir", lambda: str(tmp_path))
    monkeypatch.setattr(datadir, "get_data_dir", lambda: str(tmp_path / "none"))
    found = {f.name: f for f in grid_findings()}
    grids = found["geoids and datum shifts"]
    assert grids.found == f"2 in {tmp_path}, 0 in {tmp_path / 'none'}"
    assert grids.verdict == "ok"
    assert "pyproj sync --file" in grids.advice
    monkeypatch.setattr(datadir, "get_user_data_dir", lambda: str(tmp_path / "none"))
    assert {f.name: f for f in grid_findings()}["geoids and datum shifts"].verdict == "note"


def test_the_engine_is_that_of_ppk(monkeypatch):
    """Oracle: the function by which `insgnss ppk` finds it, with an answer of each kind."""
    from insgnss.gnss.engine import program

    monkeypatch.setattr(program, "engine_command", lambda: ["/opt/rnx2rtkp"])
    assert engine_finding().found.startswith("/opt/rnx2rtkp; ")

    def none():
        raise UsageError("no GNSS engine: pip install x")

    monkeypatch.setattr(program, "engine_command", none)
    assert engine_finding().verdict == "note"
    assert "pip install x" in engine_finding().advice


def test_the_machine_says_what_it_does_not_know(tmp_path, monkeypatch):
    """Oracle: a processor by hand; a system without memory figures."""
    (tmp_path / "cpuinfo").write_text("processor\t: 0\nmodel name\t: Abacus 3000\n")
    monkeypatch.setattr(examination, "available", lambda: None)
    found = {f.name: f for f in examination.machine_findings(tmp_path / "cpuinfo")}
    assert found["processor"].found.startswith("Abacus 3000, ")
    assert found["memory"].verdict == "unknown"
    assert found["insgnss"].found.startswith(insgnss.__version__)
    assert sys.executable in found["Python"].found


@pytest.fixture
def looked(monkeypatch):
    """An examination whose parts are made up; the function sets what the core says."""
    row = Finding("Python", "3", topic="machine")
    monkeypatch.setattr(examination, "machine_findings", lambda: [row])
    monkeypatch.setattr(examination, "package_findings", lambda: [])
    monkeypatch.setattr(examination, "grid_findings", lambda: [])
    monkeypatch.setattr(
        examination, "engine_finding", lambda: Finding("engine", "none", topic="ppk")
    )
    return lambda core: monkeypatch.setattr(examination, "_core", core)


def test_doctor_prints_a_line_a_thing_and_ends_with_code_0(looked, capsys):
    """Oracle: the made-up findings; the exit code of the contract."""
    looked(lambda: [Question("cache", topic="kernels").note("here", "set it")])
    assert main(["doctor", "-q"]) == 0
    streams = capsys.readouterr()
    assert streams.err == ""
    assert streams.out.splitlines() == [
        "machine",
        "  ok    Python  3",
        "kernels",
        "  note  cache   here; set it",
        "ppk",
        "  ok    engine  none",
        "insgnss works here; 3 lines: 2 ok, 1 notes, 0 unknown, 0 wrong",
    ]
    assert main(["doctor", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["works"] is True
    assert document["findings"][1] == {
        "topic": "kernels",
        "name": "cache",
        "value": "here",
        "verdict": "note",
        "advice": "set it",
    }


def test_a_core_that_fails_is_code_1_and_one_line_after_all_others(looked, capsys):
    """Oracle: exit code 1 of the contract, for what is wrong with insgnss itself."""

    def missing():
        raise ModuleNotFoundError("No module named 'numba'")

    looked(missing)
    assert main(["doctor", "-q"]) == 1
    streams = capsys.readouterr()
    assert (
        "  WRONG loading  fails: ModuleNotFoundError: No module named 'numba'; see" in streams.out
    )
    last = streams.out.splitlines()[-1]
    assert last.endswith("here; 3 lines: 2 ok, 0 notes, 0 unknown, 1 wrong")
    assert streams.err.count("\n") == 1
    assert streams.err.startswith("insgnss: error: loading: fails: ModuleNotFoundError")
    assert main(["doctor", "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["works"] is False


def test_limits_are_listed_with_value_and_reason(capsys):
    """Oracle: a constant by hand, its value by import; `docs/ARCHITECTURE.md`'s wings."""
    from insgnss.records.cameras.mounting import MAX_LEVER_M

    assert main(["doctor", "--limits", "-q"]) == 0
    lines = capsys.readouterr().out.splitlines()
    lever = f"MAX_LEVER_M = {MAX_LEVER_M}  lever arm (m): longer ones are in another unit"
    assert f"  records/cameras/mounting.py  {lever}" in lines
    assert {"base", "io", "navigation", "flight", "batch", "cli"} < set(lines)
    assert main(["doctor", "--limits", "--compile"]) == 2


def test_a_reason_stands_behind_above_or_below():
    """Oracle: a module by hand."""
    text = (
        'A = 1.0\n"""First, m."""\n\n# second\n# s\nB, C = 2, np.radians(3.0)  # third\n'
        'D = 4\n\nE = "5"\nF = (\n    1,  # one\n    2,\n)\n'
    )
    assert [(limit.name, limit.value, limit.reason) for limit in limits_of(text)] == [
        ("A", "1.0", "First, m."),
        ("B, C", "(2, np.radians(3.0))", "second s third"),
        ("D", "4", ""),
        ("F", "(1, 2)", "one"),
    ]


def test_the_limits_of_a_wing_have_reasons():
    """Oracle: the rule of docs/ARCHITECTURE.md: none of these wings has a number without one."""
    wings = ("base", "geodesy", "records", "batch", "cli")
    limits = [x for x in read_limits().limits if x.module.startswith(wings)]
    assert len(limits) > 50
    assert [f"{x.module}: {x.name}" for x in limits if not x.reason] == []


def test_doctor_starts_without_numpy():
    """Oracle: an interpreter in which numpy and numba cannot be imported: each is a line, as a
    stranger with a broken installation needs it.
    """
    import subprocess

    code = (
        "import sys; sys.modules['numpy'] = sys.modules['numba'] = None;"
        " from insgnss.batch.installation import examination as e;"
        " e.package_findings = lambda: []; r = e.examine(lambda step: None);"
        " print(r.summary());"
        " from insgnss.cli import main; print('code', main(['doctor', '--limits', '-q']))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=60
    )
    assert done.returncode == 0, done.stderr
    assert "WRONG loading" in done.stdout
    assert "insgnss does not work here" in done.stdout
    assert done.stdout.endswith("code 0\n")
