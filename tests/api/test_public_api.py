"""What `import insgnss` offers: the names, their documentation, and programs as a stranger writes
them.
"""

import ast
import doctest
import inspect
import logging
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from numpydoc_sections import documented, parameters, sections

import insgnss

ROOT = Path(__file__).parents[2]
FUNCTIONS = [name for name in insgnss.__all__ if inspect.isfunction(getattr(insgnss, name))]
CLASSES = [name for name in insgnss.__all__ if inspect.isclass(getattr(insgnss, name))]
RECORDS = [name for name in CLASSES if not issubclass(getattr(insgnss, name), Exception)]
METHODS = [
    (name, method)
    for name in RECORDS
    for method, value in vars(getattr(insgnss, name)).items()
    if not method.startswith("_")
    and callable(getattr(value, "__func__", value))
    and value.__class__ is not property
]
MOST_MODULES = 40  # that the import may load, the interpreter's own apart; a millisecond each


def run_python(code: str, *options: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *options, "-c", code], capture_output=True, text=True, check=False
    )


def test_import_loads_nothing_heavy_and_dir_shows_the_public_names():
    """Oracle: the standard library's list of its modules; `__all__`."""
    code = (
        "import sys; before = set(sys.modules); import insgnss; new = {m.split('.')[0] for m in"
        " set(sys.modules) - before} - {'insgnss'}; print(sorted(new -"
        " set(sys.stdlib_module_names))); print(dir(insgnss) == sorted(insgnss.__all__));"
        " print(len(set(sys.modules) - before))"
    )
    *heavy_and_names, loaded = run_python(code, "-S").stdout.splitlines()
    assert heavy_and_names == ["[]", "True"]
    assert int(loaded) <= MOST_MODULES


def test_the_type_checker_sees_the_same_names():
    """Oracle: the imports under TYPE_CHECKING, read from the source, against the table that loads
    them, and `__all__`.
    """
    tree = ast.parse((ROOT / "insgnss" / "__init__.py").read_text(encoding="utf-8"))
    guarded = next(n for n in tree.body if isinstance(n, ast.If))
    seen = {
        alias.name: n.module
        for n in guarded.body
        if isinstance(n, ast.ImportFrom)
        for alias in n.names
    }
    assert seen == insgnss._HOME
    assert set(insgnss.__all__) == {*seen, "__version__"}
    assert (ROOT / "insgnss" / "py.typed").is_file()


def test_an_unknown_name_is_an_attribute_error_and_a_room_does_not_hide_a_verb():
    """Oracle: Python's own error, and the function before and after its room was imported."""
    with pytest.raises(AttributeError, match="no attribute 'procces'"):
        insgnss.procces  # noqa: B018
    code = (
        "import insgnss, importlib; importlib.import_module(insgnss.simulate.__module__); "
        "[importlib.import_module(f'insgnss.{name}') for name in {rooms}]; "
        "print(all(callable(getattr(insgnss, n)) for n in insgnss.__all__ if n != '__version__'))"
    )
    rooms = [path.name for path in (ROOT / "insgnss").iterdir() if (path / "__init__.py").is_file()]
    done = run_python(code.replace("{rooms}", repr(rooms)))
    assert done.stdout.strip() == "True", done.stderr


@pytest.mark.parametrize("name", [*FUNCTIONS, *RECORDS])
def test_documented_parameters_are_those_of_the_signature(name):
    """Oracle: the signature."""
    thing = getattr(insgnss, name)
    text = sections(thing.__doc__)
    assert documented(text.get("Parameters", "")) == parameters(thing)
    assert len(text[""].split()) >= 4, "the summary is no sentence"
    if name in FUNCTIONS:
        assert inspect.signature(thing).return_annotation is None or text["Returns"].strip()
        known = {"InputError", "DataError", "UsageError"}
        assert set(documented(text["Raises"])) <= known
        assert documented(text["Raises"])


@pytest.mark.parametrize(("name", "method"), METHODS, ids=lambda x: x)
def test_documented_parameters_of_methods_are_those_of_their_signatures(name, method):
    """Oracle: the signature."""
    thing = getattr(getattr(insgnss, name), method)
    text = sections(thing.__doc__)
    if parameters(thing):
        assert documented(text["Parameters"]) == parameters(thing)
        assert text["Returns"].strip()


@pytest.mark.parametrize("name", RECORDS)
def test_what_a_record_refuses_at_its_birth_is_documented(name):
    """Oracle: the source of its checks."""
    thing = getattr(insgnss, name)
    birth = vars(thing).get("__post_init__")
    refuses = birth is not None and re.search(
        r"raise |frozen\(|_as_|_check|increasing\(", inspect.getsource(birth)
    )
    if refuses:
        assert "Raises" in sections(thing.__doc__)


def public_modules() -> list[ModuleType]:
    homes = dict.fromkeys(getattr(insgnss, name).__module__ for name in [*FUNCTIONS, *CLASSES])
    return [import_module(home) for home in homes]


@pytest.mark.parametrize("module", public_modules(), ids=lambda module: module.__name__)
def test_examples_of_the_documentation_run(module):
    """Oracle: the output that stands in the examples."""
    failed, _ = doctest.testmod(module, optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    assert failed == 0


def test_there_are_examples():
    """Oracle: a finder that finds none would let the test above pass."""
    tried = [
        test
        for module in public_modules()
        for test in doctest.DocTestFinder().find(module)
        if test.examples
    ]
    assert len(tried) >= 5


def test_scripts_import_from_the_package_in_three_lines_at_most():
    """Oracle: the sources of the numbered stories."""
    for path in sorted((ROOT / "scripts").glob("[0-9]*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        lines = [
            node.lineno
            for node in ast.walk(tree)
            if (
                isinstance(node, ast.Import)
                and any(a.name.split(".")[0] == "insgnss" for a in node.names)
            )
            or (isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "insgnss")
        ]
        assert len(lines) <= 3, f"{path.name}: {len(lines)} imports from insgnss"


def programs() -> list[str]:
    """The Python programs of the guide to the API."""
    text = (ROOT / "docs" / "guides" / "python.md").read_text(encoding="utf-8")
    return re.findall(r"```python\n(.*?)```", text, re.DOTALL)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Arrays that the programs find in files of their own: a flight and a drive, and the flight as
    a data set.
    """
    root = tmp_path_factory.mktemp("programs")
    for name, sim in (
        (
            "flight",
            insgnss.simulate(
                "ign8", 3.0, directory=root / "ign8", imu_rate_hz=100.0, seed=2, start_in_air=True
            ).simulated,
        ),
        (
            "drive",
            insgnss.simulate(
                "car",
                3.0,
                imu_rate_hz=100.0,
                gnss_rate_hz=1.0,
                gnss_sigma_m=(0.3, 0.3, 0.5),
                seed=3,
            ),
        ),
    ):
        imu = np.column_stack([sim.imu.time, sim.imu.gyro, sim.imu.accel])
        gnss = np.column_stack(
            [sim.gnss.time, np.degrees(sim.gnss.lat), np.degrees(sim.gnss.lon), sim.gnss.height]
        )
        np.savez(
            root / f"{name}.npz",
            imu=imu,
            gnss=gnss,
            events=sim.events.time,
            names=np.array(sim.events.images),
        )
    return root


def smoothed_arrays(names: dict[str, Any]) -> None:
    """The images fit the truth to five of their standard deviations in position."""
    eo = names["result"].eo
    truth = np.load("ign8/truth/eo.npz")["position_enu"]
    sigma = np.sqrt(np.diagonal(eo.cov, axis1=1, axis2=2)[:, :3])
    assert np.abs((eo.position_m - truth) / sigma).max() < 5.0


def noise_model(names: dict[str, Any]) -> None:
    """The report knows the model, and the gate."""
    told = names["result"].report["flight"]
    assert (
        told["imu"]["noise"] == "given as object: <NoiseModel my IMU, gyro WN+bias, accel WN+bias>"
    )
    assert told["gnss"]["gate_sigma"] == 4.0


def plotted_bias(names: dict[str, Any]) -> None:
    """A picture, of numbers that are biases of a NavChip."""
    assert Path("bias.png").read_bytes().startswith(b"\x89PNG")
    assert 0.0 < np.abs(names["biases"].gyro).max() < np.radians(0.5)


def twenty_images(names: dict[str, Any]) -> None:
    """Twenty rows whose easting is PROJ's of the images' geographic coordinates."""
    from pyproj import Transformer

    from insgnss.geodesy.frames import TangentPlane

    eo = names["eo"]
    rows = [
        line.split(",")
        for line in Path("utm.csv").read_text(encoding="utf-8").splitlines()
        if line.startswith("8")
    ]
    assert [row[0] for row in rows] == list(eo.images[:20])
    lat, lon, _ = TangentPlane(*eo.origin).geodetic_from_position(eo.position_m[:20])
    easting, _ = Transformer.from_crs(4326, 32632, always_xy=True).transform(
        np.degrees(lon), np.degrees(lat), direction="FORWARD"
    )
    np.testing.assert_allclose([float(row[1]) for row in rows], easting, atol=1e-3)


def car(names: dict[str, Any]) -> None:
    """The motion measured itself: the non-holonomic constraint was used."""
    assert any(
        "non-holonomic constraints" in sentence for sentence in names["result"].report["history"]
    )


def heard(names: dict[str, Any]) -> None:
    """The logger of the package lets steps through."""
    assert names["logging"].getLogger("insgnss").isEnabledFor(logging.INFO)


LEFT_BEHIND = {
    "Hear the steps": heard,
    "Smooth my arrays": smoothed_arrays,
    "Change the noise model": noise_model,
    "Plot a bias": plotted_bias,
    "Twenty images to UTM": twenty_images,
    "A car: IMU at 100 Hz, GNSS at 1 Hz, no velocity across the wheels": car,
}


@pytest.mark.slow
@pytest.mark.parametrize("program", programs(), ids=lambda text: text.splitlines()[0].lstrip("# "))
def test_the_programs_of_the_guide_run(program, recorded, monkeypatch):
    """Oracle: what each leaves behind, by `LEFT_BEHIND`; at most a dozen lines, no import of an
    inner module.
    """
    monkeypatch.chdir(recorded)
    lines = [line for line in program.splitlines() if line.strip() and not line.startswith("#")]
    assert len(lines) <= 12
    assert not re.search(r"insgnss\.\w+\.\w+ import|from insgnss\.|import insgnss\.", program)
    names: dict[str, Any] = {}
    exec(compile(program, "python.md", "exec"), names)
    LEFT_BEHIND[program.splitlines()[0].removeprefix("# ")](names)


def test_there_are_six_programs():
    """Oracle: the number of programs in the guide."""
    assert len(programs()) == 6


def test_what_a_stranger_looks_for_in_the_help_is_there():
    """Oracle: words by hand; no public name is described by a module that a program cannot name."""
    assert "`gyro` and `accel` (n, 3)" in insgnss.estimate.__doc__
    assert 'eo["8001.tif"]' in insgnss.ExteriorOrientation.__doc__
    assert "dataclasses.replace" in insgnss.NoiseModel.__doc__
    for name in (*FUNCTIONS, *CLASSES):
        inner = re.findall(r"`insgnss\.\w+\.\w+", getattr(insgnss, name).__doc__)
        assert inner == [], name
