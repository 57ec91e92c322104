"""What is said about the package agrees with what it is: docstrings, README, data_specs."""

import argparse
import ast
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

import insgnss
from insgnss.cli import build_parser
from insgnss.io.formats import BAROMETER_OPTIONS, EVENT_OPTIONS, EXPORTS, GNSS_OPTIONS, IMU_OPTIONS
from insgnss.io.formats.blocks.reading import FORMATS

ROOT = Path(__file__).parents[1]
PUBLIC = [
    path
    for path in sorted((ROOT / "insgnss").rglob("*.py"))
    if not path.stem.startswith("_") or path.stem == "__init__"
]
SPECS = ROOT / "data_specs"


def _public(node: ast.Module | ast.ClassDef) -> Iterator[ast.FunctionDef | ast.ClassDef]:
    """Public functions and classes of a module, methods of a class that overrides no other's; not
    the forms of an overloaded one.
    """
    for child in node.body:
        if isinstance(child, ast.FunctionDef | ast.ClassDef) and not child.name.startswith("_"):
            if any(
                isinstance(mark, ast.Name) and mark.id == "overload"
                for mark in child.decorator_list
            ):
                continue
            yield child
            if isinstance(child, ast.ClassDef) and not child.bases:
                yield from _public(child)


def test_everything_public_says_what_it_is() -> None:
    """Oracle: the house rule, read from the sources."""
    silent = []
    for path in PUBLIC:
        module, name = ast.parse(path.read_text(encoding="utf-8")), path.relative_to(ROOT)
        silent += [f"{name}: the module has no docstring"] * (not ast.get_docstring(module))
        silent += [
            f"{name}: {node.name}" for node in _public(module) if not ast.get_docstring(node)
        ]
    assert PUBLIC
    assert silent == []


def _kinds(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    """Parsers below another one, with all their arguments."""
    kinds = [a.choices for a in parser._actions if isinstance(a, argparse._SubParsersAction)]
    for choices in kinds:
        for verb in choices.values():
            verb.complete()
    return dict(kinds[0]) if kinds else {}


def _verbs() -> dict[str, argparse.ArgumentParser]:
    return _kinds(build_parser())


def _code(text: str) -> str:
    """Code of a Markdown text: fenced and indented blocks, and what stands between backticks; one
    piece a line.
    """
    fenced = re.findall(r"```\w*\n(.*?)```", text, re.DOTALL)
    rest = re.sub(r"```\w*\n.*?```", "", text, flags=re.DOTALL)
    return "\n".join(
        [*fenced, *re.findall(r"^    .*$", rest, re.MULTILINE), *re.findall(r"`([^`]+)`", rest)]
    )


COMMANDS_IN = [
    "README.md",
    "benchmarks/README.md",
    "CHANGELOG.md",
    *(path.relative_to(ROOT).as_posix() for path in sorted((ROOT / "docs").rglob("*.md"))),
]


@pytest.mark.parametrize("page", COMMANDS_IN)
def test_commands_in_the_texts_exist(page: str) -> None:
    """Oracle: the parser of the command line; of a verb with kinds, that of the kind."""
    verbs = _verbs()
    for verb, rest in re.findall(
        r"(?:^|[ /])insgnss +([a-z]\w*)(.*)$",
        _code((ROOT / page).read_text(encoding="utf-8")),
        re.MULTILINE,
    ):
        assert verb in verbs, f"{page}: insgnss {verb} does not exist"
        parser = _kinds(verbs[verb]).get(rest.split()[0] if rest.split() else "", verbs[verb])
        for option in re.findall(r"--[a-z][\w-]*", rest):
            assert option in parser._option_string_actions, (
                f"{page}: insgnss {verb} has no {option}"
            )


def test_readme_shows_every_verb() -> None:
    """Oracle: the parser of the command line."""
    shown = re.findall(
        r"insgnss +([a-z]\w*)", _code((ROOT / "README.md").read_text(encoding="utf-8"))
    )
    assert set(_verbs()) <= set(shown)


def test_files_that_the_texts_link_to_exist() -> None:
    """Oracle: the directory's listing."""
    for page in [
        ROOT / "README.md",
        ROOT / ".github" / "CONTRIBUTING.md",
        *sorted((ROOT / "docs").rglob("*.md")),
        *sorted((ROOT / "benchmarks").glob("*.md")),
        *sorted(SPECS.glob("*.md")),
    ]:
        for target in re.findall(r"\]\(([^)#:]+)\)", page.read_text(encoding="utf-8")):
            assert (page.parent / target).exists(), f"{page.relative_to(ROOT)}: no {target}"


def test_every_format_has_a_page() -> None:
    """Oracle: the lists that readers and exports are found by, and the pages' names."""
    pages = {path.stem for path in SPECS.glob("*.md")}
    exports = {form.page for form in EXPORTS.values()}
    # readers of blocks by their modules; `reading` itself hands over
    blocks = {row[0].partition(":")[0].rpartition(".")[2] for row in FORMATS.values()} - {"reading"}
    formats = {*exports, *blocks, *IMU_OPTIONS, *GNSS_OPTIONS, *EVENT_OPTIONS, *BAROMETER_OPTIONS}
    assert formats <= pages
    # read by more than one verb, or by Python alone, and therefore in no list
    others = {"eo_json", "odyn", "trajectory_csv", "variances", "sbet", "rtklib_pos_write"}
    # settings and sensors, and RINEX, whose readers stand in gnss/: they give raw observations
    others |= {
        "measurement",
        "dbat",
        "image_points",
        "ground_points",
        "camera_toml",
        "camera_files",
    }
    others |= {"eo_covariance", "block_file", "adjust_json"}
    others |= {"season"}  # written by `insgnss batch`
    others |= {"camera_positions"}  # written by `insgnss ppk`
    others |= {"target_positions", "target_sizes"}  # of vehicles, read by `insgnss adjust`
    others |= {"targets", "metashape_markers", "pix4d_marks"}  # written by `insgnss targets`
    others |= {
        "README",
        "flight_file",
        "imu_calibration",
        "mounting_file",
        "pose_covariance",
        "noise_model",
        "noise_exports",
        "pose_table",
    }
    others |= {"rinex", "returned"}  # poses of bundle adjustments, read by `insgnss compare`
    assert pages == formats | others


def test_pages_ship_inside_the_wheel() -> None:
    """Oracle: the build's table, and the installed package where the tests run against one."""
    build = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["hatch"][
        "build"
    ]["targets"]["wheel"]
    assert build["force-include"] == {
        folder: f"insgnss/{folder}" for folder in ("data_specs", "benchmarks/published_blocks")
    }
    installed = Path(insgnss.__file__).parent
    if installed != ROOT / "insgnss":
        assert (installed / "benchmarks" / "published_blocks" / "__init__.py").is_file()
        assert {
            page.name: page.read_text() for page in (installed / "data_specs").glob("*.md")
        } == {page.name: page.read_text() for page in SPECS.glob("*.md")}


def test_changelog_and_examples_are_of_this_version() -> None:
    """Oracle: the package's version; a date stands beside a release and beside nothing else."""
    heading = re.search(
        r"^## (\S+) \((.*)\)$", (ROOT / "CHANGELOG.md").read_text("utf-8"), re.MULTILINE
    )
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    released = re.search(r"^date-released: (.*)$", citation, re.MULTILINE)
    assert heading is not None
    assert released is not None
    if heading[2] != "unreleased":
        assert heading.groups() == (insgnss.__version__, released[1])
    for page in SPECS.glob("*.md"):
        versions = set(re.findall(r"insgnss (\d+\.\d+\.\d+)", page.read_text("utf-8")))
        assert versions <= {insgnss.__version__}, page.name


def test_the_citation_is_of_this_version_and_invents_nobody() -> None:
    """Oracle: the package's version, pyproject.toml, the licence; keys that CFF 1.2.0 requires."""
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    keys = dict(re.findall(r"^([a-z-]+): *(.*)$", text, re.MULTILINE))
    assert {"cff-version", "message", "title", "authors"} <= set(keys)
    assert keys["cff-version"] == "1.2.0"
    assert keys["version"] == insgnss.__version__
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert keys["license"] == project["license"]
    assert keys["title"].strip('"') == f"insgnss: {project['description'].replace('From', 'from')}"
    licence = (ROOT / "LICENSE").read_text(encoding="utf-8")
    authors = re.findall(r"^  - name: (.*)$", text, re.MULTILINE)
    assert len(authors) == 1
    assert re.search(rf"Copyright \(c\) \d+ {authors[0]}$", licence, re.MULTILINE)


def test_licences_of_what_others_made_are_listed() -> None:
    """Oracle: the licence files in the package, against the metadata and the README."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    shipped = {path.relative_to(ROOT).as_posix() for path in (ROOT / "insgnss").rglob("LICENSE*")}
    assert set(project["license-files"]) == {"LICENSE", *shipped}
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert all(f"]({name})" in readme for name in shipped)
