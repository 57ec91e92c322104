"""The script that plants defects: where it finds a piece of text, and what it refuses."""

import ast
import importlib
import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

SCRIPT = Path(__file__).parents[1] / "scripts" / "planted_defects.py"


@pytest.fixture(scope="module")
def script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("planted_defects", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_text_is_found_however_it_is_wrapped(script: ModuleType) -> None:
    """Oracle: by hand; what stands around the piece stays as it is."""
    text = "x = f(\n    a + b,\n    c,\n)\n"
    assert script.planted(text, "a+b,  c", "a - b, c") == "x = f(\n    a - b, c,\n)\n"
    assert script.planted(text, "a - b", "a") is None


def test_text_that_occurs_twice_is_refused(script: ModuleType) -> None:
    """Oracle: two places, of which none can be meant."""
    with pytest.raises(script.EntryError, match="more than once"):
        script.planted("y = a * b + a *  b\n", "a * b", "a / b")


def test_module_may_be_a_folder(script: ModuleType, tmp_path: Path) -> None:
    """Oracle: two files, one of which has the text; then both, then a piece that is no Python."""
    for name, line in (("one.py", "a = b * c\n"), ("two.py", "a = b / c\n")):
        (tmp_path / name).write_text(line)
    defect = script.Defect(".", "b * c", "b + c", "a product", ())
    assert script.place_of(defect, tmp_path) == (tmp_path / "one.py", "a = b + c\n")
    with pytest.raises(script.EntryError, match="makes no Python"):
        script.place_of(script.Defect(".", "b * c", "b +", "a product", ()), tmp_path)
    (tmp_path / "two.py").write_text("a = b  *  c\n")
    with pytest.raises(script.EntryError, match="occurs 2 times, not once"):
        script.place_of(defect, tmp_path)


def test_unknown_keys_are_refused(script: ModuleType, tmp_path: Path) -> None:
    """Oracle: the keys of the table."""
    (tmp_path / "t.toml").write_text(
        '[[defect]]\nmodule = "a"\nold = "b"\nnew = "c"\ntests = ["d"]\n'
    )
    with pytest.raises(script.EntryError, match="defect 1: 'breaks' is missing or unknown"):
        script.load(tmp_path / "t.toml")


def test_changes_at_random_places_are_those_of_the_table(monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: by hand, change by change; texts, errors and annotations have none."""
    monkeypatch.syspath_prepend(SCRIPT.parent)
    text = (
        'def f(a: "1.0 - 2.0", x):\n'
        '    """1.0 - 2.0 < 3."""\n'
        "    if len(a) < 3 and -x[1] >= max(2.0, x):\n"
        '        raise ValueError(f"{1.0 - x}")\n'
        "    return (a) - (\n        x * 2.0\n    )\n"
    )
    places = importlib.import_module("random_defects")._Places(text)
    places.visit(ast.parse(text))
    got = [(text[begin:end], new) for begin, end, new in sorted(places.found)]
    assert got == [
        *[("<", "<="), ("and", "or"), ("-", ""), ("1", "2"), (">=", "<="), ("max", "min")],
        *[("2.0", "1"), ("2.0", "3"), ("-", "+"), ("*", "/"), ("2.0", "1"), ("2.0", "3")],
    ]


def test_what_changes_no_number_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: by hand: guards against rounding, sizes of memory, progress; a factor is a unit."""
    monkeypatch.syspath_prepend(SCRIPT.parent)
    script = importlib.import_module("random_defects")
    text = (
        "TINY = 1e-9\nBLOCK_BYTES = 8.0 * 3.0\n"
        "def f(a):\n    share(7.0)\n    return a / max(abs(a) + 1e-9, 1e-12 * a) * 1e-6 + 0.0 * a\n"
    )
    places = script._Places(text)
    places.visit(ast.parse(text))
    got = [(text[begin:end], new) for begin, end, new in sorted(places.found)]
    assert [old for old, _ in got if old.startswith("1e")] == ["1e-9"] * 2 + ["1e-6"] * 2
    assert not {"7.0", "8.0"} & {old for old, _ in got}
    files = {change.file.name for _, change in script.drawn(["noise/tuning"], 80, 0)}
    assert files
    assert not [name for name in files if script.OF_PAGES.search(name)]


def test_tests_of_a_room_stand_in_its_folder_or_name_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: the tree of tests, by hand."""
    monkeypatch.syspath_prepend(SCRIPT.parent)
    tests_of = importlib.import_module("random_defects").tests_of
    of_kernel = tests_of(Path("insgnss/navigation/filter/kernels/strapdown.py"), False)
    assert "tests/navigation/filter/test_strapdown.py" in of_kernel
    of_engine = tests_of(Path("insgnss/gnss/engine/combined.py"), False)
    assert of_engine[0] == "tests/gnss/test_combined.py"
    assert "tests/gnss/test_orbits.py" not in of_engine
