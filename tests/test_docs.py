"""What is said about the package agrees with what it is: docstrings, README, data_specs."""

import argparse
import ast
import re
import tomllib
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

import pytest

import insgnss
from insgnss.cli import build_parser
from insgnss.flight import KEYS
from insgnss.formats import EXPORTS, GNSS_OPTIONS, IMU_OPTIONS
from insgnss.gnss.covariance import CLASSES, MODEL

ROOT = Path(__file__).parents[1]
PUBLIC = [path for path in sorted((ROOT / "insgnss").rglob("*.py")) if not path.stem.startswith("_") or path.stem == "__init__"]
SPECS = ROOT / "data_specs"


def _public(node: ast.Module | ast.ClassDef) -> Iterator[ast.FunctionDef | ast.ClassDef]:
    """Public functions and classes of a module, methods of a class that overrides no other's; not the forms of an overloaded one."""
    for child in node.body:
        if isinstance(child, ast.FunctionDef | ast.ClassDef) and not child.name.startswith("_"):
            if any(isinstance(mark, ast.Name) and mark.id == "overload" for mark in child.decorator_list):
                continue
            yield child
            if isinstance(child, ast.ClassDef) and not child.bases:
                yield from _public(child)


@pytest.mark.parametrize("path", PUBLIC, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_everything_public_says_what_it_is(path: Path) -> None:
    """Oracle: the house rule, read from the source."""
    module = ast.parse(path.read_text(encoding="utf-8"))
    assert ast.get_docstring(module), "the module has no docstring"
    silent = [node.name for node in _public(module) if not ast.get_docstring(node)]
    assert silent == []


def _verbs() -> dict[str, argparse.ArgumentParser]:
    parser = build_parser()
    choices = next(action.choices for action in parser._actions if isinstance(action, argparse._SubParsersAction))
    return dict(choices)


def _code(text: str) -> str:
    """Code of a Markdown text: fenced and indented blocks, and what stands between backticks; one piece a line."""
    fenced = re.findall(r"```\w*\n(.*?)```", text, re.DOTALL)
    rest = re.sub(r"```\w*\n.*?```", "", text, flags=re.DOTALL)
    return "\n".join([*fenced, *re.findall(r"^    .*$", rest, re.MULTILINE), *re.findall(r"`([^`]+)`", rest)])


@pytest.mark.parametrize("page", ["README.md", "benchmarks/README.md", "CHANGELOG.md"])
def test_commands_in_the_texts_exist(page: str) -> None:
    """Oracle: the parser of the command line."""
    verbs = _verbs()
    for verb, rest in re.findall(r"(?:^|[ /])insgnss +([a-z]\w*)(.*)$", _code((ROOT / page).read_text(encoding="utf-8")), re.MULTILINE):
        assert verb in verbs, f"{page}: insgnss {verb} does not exist"
        for option in re.findall(r"--[a-z][\w-]*", rest):
            assert option in verbs[verb]._option_string_actions, f"{page}: insgnss {verb} has no {option}"


def test_readme_shows_every_verb() -> None:
    """Oracle: the parser of the command line."""
    shown = re.findall(r"insgnss +([a-z]\w*)", _code((ROOT / "README.md").read_text(encoding="utf-8")))
    assert set(_verbs()) <= set(shown)


def test_files_that_the_texts_link_to_exist() -> None:
    """Oracle: the directory's listing."""
    for page in [ROOT / "README.md", *sorted((ROOT / "benchmarks").glob("*.md")), *sorted(SPECS.glob("*.md"))]:
        for target in re.findall(r"\]\(([^)#:]+)\)", page.read_text(encoding="utf-8")):
            assert (page.parent / target).exists(), f"{page.relative_to(ROOT)}: no {target}"


def test_every_format_has_a_page() -> None:
    """Oracle: the lists that readers and exports are found by, and the modules' names."""
    modules = {path.stem for path in (ROOT / "insgnss/formats").glob("[a-z]*.py")}
    pages = {path.stem for path in SPECS.glob("*.md")}
    exports = {place.partition(":")[0] for form in EXPORTS.values() for place in (form.writer, form.reader)}
    exports = {name for name in exports if name and not name.startswith("_")}
    assert {*exports, *IMU_OPTIONS, *GNSS_OPTIONS, "events"} <= modules
    # settings, and RINEX, whose readers stand in gnss/: they give raw observations, not a record of the formats
    assert pages == modules | {"README", "flight_file", "imu_calibration", "noise_model", "rinex"}


def test_pages_ship_inside_the_wheel() -> None:
    """Oracle: the build's table, and the installed package where the tests run against one."""
    build = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["hatch"]["build"]["targets"]["wheel"]
    assert build["force-include"]["data_specs"] == "insgnss/data_specs"
    installed = Path(insgnss.__file__).parent
    if installed != ROOT / "insgnss":
        assert {page.name: page.read_text() for page in (installed / "data_specs").glob("*.md")} == {
            page.name: page.read_text() for page in SPECS.glob("*.md")
        }


def test_every_key_of_the_flight_file_is_documented() -> None:
    """Oracle: the keys that the reader knows, and the covariance model's defaults."""
    page = (SPECS / "flight_file.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (`.*?`) \|(.*)$", page, re.MULTILINE)
    told = {key: text for names, text in rows for key in re.findall(r"`([\w.]+)`", names)}
    known = set()
    for table, keys in KEYS.items():
        for key in keys:
            if table.startswith("gnss.covariance"):  # these stand in tables of their own
                assert re.search(rf"^\|[^|]*\b{key}\b", page, re.MULTILINE), f"flight_file.md: {table} does not name {key}"
            elif "." in table:  # the members of an inline table stand in its row
                row = told[table.replace("imu.more.units", "imu.units")]
                assert re.search(rf"\b{key}\b", row), f"flight_file.md: {table} does not name {key}"
            elif key not in KEYS:
                known.add(f"{table}.{key}" if table else key)
    assert sorted(known - set(told)) == [], "not in flight_file.md"
    assert sorted(set(told) - known) == [], "unknown to the reader"


def test_numbers_of_the_covariance_model_are_those_on_the_page() -> None:
    """Oracle: `gnss.covariance.MODEL`."""
    page = (SPECS / "flight_file.md").read_text(encoding="utf-8").partition("## gnss.covariance")[2]
    told = {}
    for names, *values in re.findall(r"^\| ([a-z0-9_, ]+) \| ([\d. ,]+) \|(?: ([\d. ]+) \|)?", page, re.MULTILINE):
        numbers = [[float(x) for x in value.split()] for value in ", ".join(filter(None, values)).split(",")]
        for place, name in enumerate(names.split(", ")):
            told[name] = numbers if name in CLASSES else numbers[place]
    for name in CLASSES:
        for value, default in zip(told.pop(name), (MODEL.scale[name], MODEL.floor_m[name]), strict=True):
            assert tuple(value if len(value) == 3 else value * 3) == default, name
    for name, value in told.items():
        default = getattr(MODEL, name)
        assert (tuple(value) if isinstance(default, tuple) else value[0]) == default, name
    assert set(told) == {f.name for f in fields(MODEL)} - {"scale", "floor_m"}
