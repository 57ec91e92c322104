"""The house: which wing and which room imports which, what may be imported when, and how long a
piece of code may get. Read from the sources.
"""

import ast
import re
import sys
from collections.abc import Iterator
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

from insgnss.base.compilation.kept import closure

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "insgnss"

# Folder: its subfolders from below, each with those of them that it imports. "" is the package,
# whose folders are the wings. A new arrow is a decision: add it here, if it runs downward.
HOUSE: dict[str, dict[str, str]] = {
    "": {
        "base": "",
        "geodesy": "base",
        "records": "base geodesy",
        "io": "base geodesy records",
        "navigation": "base geodesy records",
        "report": "base geodesy records",
        "gnss": "base geodesy records io navigation",
        "flight": "base geodesy records io navigation report gnss",
        "noise": "base geodesy records io navigation report flight",
        "simulation": "base geodesy records io navigation gnss noise",
        "photogrammetry": "base geodesy records io navigation report flight simulation",
        "batch": "base geodesy records io navigation report gnss flight",
        "api": "base geodesy records io navigation report"
        " gnss flight noise simulation photogrammetry batch",
        "cli": "base io navigation report gnss flight noise simulation photogrammetry batch api",
        "__init__": "base geodesy records io navigation gnss"
        " flight noise simulation photogrammetry api",
        "__main__": "cli",
    },
    "io": {
        "formats": "",
        "options": "formats",
        "exposures": "formats options",
    },
    "io.formats": {
        "text": "",
        "imu": "text",
        "orientation": "text",
        "gis": "text orientation",
        "gnss": "text orientation",
        "images": "text orientation",
        "positions": "text orientation",
        "arrays": "text imu gnss",
        "events": "text orientation gnss",
        "trajectory": "text orientation gnss",
        "bundle": "text orientation",
        "logs": "text imu gnss arrays events",
        "blocks": "text orientation bundle",
        "markers": "text orientation blocks",
        "returned": "text bundle blocks",
        "vehicle": "text orientation blocks",
    },
    "navigation": {
        "prepare": "",
        "noise_model": "",
        "orient": "",
        "recognise": "prepare",
        "filter": "noise_model",
        "align": "prepare filter",
        "innovations": "filter",
        "diagnosis": "noise_model filter innovations",
    },
    "report": {
        "rules": "",
        "charts": "rules",
        "figures": "charts",
    },
    "gnss": {
        "rinex": "",
        "satellites": "rinex",
        "phase": "rinex satellites",
        "engine": "rinex satellites phase",
        "quality": "phase",
        "exposures": "rinex satellites quality",
    },
    "flight": {
        "sensors": "",
        "config": "sensors",
        "exporting": "",
        "processing": "sensors config exporting",
        "proof": "exporting",
        "inspection": "config processing",
        "reference": "config processing",
    },
    "noise": {
        "processes": "",
        "multi_position": "",
        "moments": "processes",
        "estimation": "processes moments",
        "tuning": "processes moments estimation",
    },
    "photogrammetry": {
        "adjust": "",
        "comparison": "",
        "lever_arm": "",
        "targets": "",
        "block_adjustment": "adjust comparison",
        "mounting_calibration": "adjust comparison lever_arm",
        "target_measurement": "targets block_adjustment",
    },
}
WINGS = tuple(name for name in HOUSE[""] if not name.startswith("__"))
WINGS_AT_MOST = 14
# fields and variables that label a state, a parameter, a process, a component or a check; the wings
# in which every variable called so does; and what files, their tables and frames are called
LABELS = ("name", "group", "process", "topic", "parameter", "state", "quantity", "component")
LABELLED = (
    *("navigation", "report", "flight.processing", "noise.estimation", "noise.multi_position"),
    *("noise.processes", "noise.tuning.products", "noise.tuning.in_flight", "noise.tuning.usable"),
    *("photogrammetry.adjust", "photogrammetry.mounting_calibration", "batch.season.trends"),
)
OF_FILES = ("path", "file", "entry", "table", "crs", "model")
PARSING = ("startswith", "endswith", "partition", "rpartition", "split", "rsplit")
PLANTED_LABELS = """
if check.name.startswith("GNSS ") or " from " in state.name or state.name == "drift":
    number = name.rpartition("_")[2] if not path.name.startswith(".") else ""
"""
SENTENCES = ("found", "evidence", "advice", "sentence", "remedy")
PLANTED_SENTENCES = """
try:
    pass
except Bad as refusal:
    problem = str(refusal).partition(": ")[2]
    words = "set" in str(refusal), str(refusal).split()
if check.found.startswith("as ") or "counts" in finding.evidence or check.found == "unknown":
    pass
"""
FOLDER_MODULES = 16  # beside __init__: as many as a reader overlooks

LOCAL_ONLY = {
    "matplotlib",
    "scipy",
    "pandas",
    "pyproj",
    "georinex",
    "filterpy",
    "gtsam",
    "netCDF4",
    "xarray",
    "pymavlink",
    "pyulog",
    "h5py",
}
LOCAL_ONLY |= {"dask", "distributed", "pyarrow"}
LOCAL_ONLY |= {"orjson", "pycolmap", "pyceres", "pyrtklib5", "hatanaka"}

FILES_OF_THE_ROOT = {"pyproject.toml", "README.md", "LICENSE", "CHANGELOG.md", "CITATION.cff"}
# of code, without docstrings: at 100 columns what 400 and 60 were at 140
MODULE_LINES, FUNCTION_LINES, KERNEL_LINES = 500, 80, 220
LONG_MODULES: dict[str, str] = {}
LONG_FUNCTIONS: dict[str, str] = {}


def name_of(path: Path) -> str:
    """Dotted name inside the package; of a room's __init__ the room, of the package's own
    "__init__".
    """
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(parts[:-1] if len(parts) > 1 and parts[-1] == "__init__" else parts)


MODULES = {name_of(path): path for path in sorted(PACKAGE.rglob("*.py"))}


@cache
def tree(module: str) -> ast.Module:
    return ast.parse(MODULES[module].read_text(encoding="utf-8"))


def at_import(node: ast.AST) -> Iterator[ast.AST]:
    """Nodes that run when the module is imported: all but the bodies of functions and
    `if TYPE_CHECKING`.
    """
    for child in ast.iter_child_nodes(node):
        typing_only = isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test)
        if (
            not isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
            and not typing_only
        ):
            yield child
            yield from at_import(child)


@cache
def nodes(module: str, only_at_import: bool = False) -> tuple[ast.AST, ...]:
    """Nodes of a module's source: every rule reads them, and walking the tree is what costs."""
    return tuple(at_import(tree(module)) if only_at_import else ast.walk(tree(module)))


@cache
def imports(module: str, only_at_import: bool = False) -> frozenset[str]:
    """Full names of what a module imports: `insgnss.room.module`, or the outer package's name."""
    names: set[str] = set()
    package = ["insgnss", *module.split(".")]
    if MODULES[module].name != "__init__.py":
        package.pop()
    elif module == "__init__":
        package = ["insgnss"]
    for node in nodes(module, only_at_import):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            stem = ".".join([*base, *([node.module] if node.module else [])])
            for alias in node.names:
                inner = f"{stem}.{alias.name}"
                names.add(inner if inner.removeprefix("insgnss.") in MODULES else stem)
    if "insgnss" in names:
        names.add("insgnss.__init__")
    return frozenset(names)


def inner_imports(module: str, only_at_import: bool = False) -> set[str]:
    """Modules of the package that `module` imports."""
    names = {
        name.removeprefix("insgnss.")
        for name in imports(module, only_at_import)
        if name.startswith("insgnss.")
    }
    return names & set(MODULES)


def test_wings_are_few_and_have_their_line_in_the_table() -> None:
    """Oracle: the directory's listing against the design's table."""
    assert {module.split(".")[0] for module in MODULES} == set(HOUSE[""])
    assert len(WINGS) <= WINGS_AT_MOST


def folder_in(folder: str, module: str) -> str:
    """Subfolder of a folder that a module stands in, "" where it stands in none."""
    prefix = f"{folder}." if folder else ""
    return module.removeprefix(prefix).split(".")[0] if module.startswith(prefix) else ""


@pytest.mark.parametrize("folder", HOUSE)
def test_imports_are_those_of_the_table_and_run_downward(folder: str) -> None:
    """Oracle: the design's table; imports in functions, for typing and of the package's root are
    counted.
    """
    table = {name: set(below.split()) for name, below in HOUSE[folder].items()}
    listed = {path.parent.name for path in (PACKAGE / folder.replace(".", "/")).glob("*/*.py")}
    assert listed <= set(table), f"{listed - set(table)} have no line in the table"
    arrows: dict[str, dict[str, str]] = {name: {} for name in table}
    for module in MODULES:
        if (name := folder_in(folder, module)) in table:
            for other in inner_imports(module):
                arrows[name].setdefault(folder_in(folder, other), f"{module} imports {other}")
    order = list(table)
    for name, below in table.items():
        arrows_out = {other: why for other, why in arrows[name].items() if other in table}
        arrows_out.pop(name, None)
        new = [why for other, why in arrows_out.items() if other not in below]
        assert not new, f"{new}: not in the table"
        assert below == set(arrows_out), f"{name} imports {below - set(arrows_out)} no more"
        assert below <= set(order[: order.index(name)]), f"{name}: an arrow runs upward"


def test_the_top_level_holds_what_the_user_fixed() -> None:
    files = {entry.name for entry in ROOT.iterdir() if entry.is_file() and entry.name[0] != "."}
    assert files <= FILES_OF_THE_ROOT


def test_folders_with_arrows_inside_have_their_place_in_the_table() -> None:
    """Oracle: the imports of all folders."""
    for folder in {".".join(module.split(".")[:k]) for module in MODULES for k in (1, 2, 3)}:
        path = PACKAGE / folder.replace(".", "/")
        inside = {one.parent.name for one in path.glob("*/__init__.py")}
        arrows = {
            (name, other)
            for module in MODULES
            if (name := folder_in(folder, module)) in inside
            for other in {folder_in(folder, one) for one in inner_imports(module)} & inside - {name}
        }
        assert folder in HOUSE or not arrows, f"{folder}: {sorted(arrows)}"


def test_a_folder_is_overlooked_at_a_glance() -> None:
    """Oracle: the directory's listing."""
    for folder in {path.parent for path in MODULES.values()}:
        count = len(list(folder.glob("*.py"))) - 1
        assert count <= FOLDER_MODULES, f"{folder.relative_to(ROOT)} has {count} modules"


def test_the_reader_of_imports_sees_all_kinds() -> None:
    """Oracle: imports of the sources, read by eye."""
    assert {
        "base.errors",
        "records",
        "flight.config.flight_file",
        "navigation.filter.problem",
        "navigation.prepare.clock",
    } <= inner_imports("flight.processing.solve_segments")
    assert "navigation.recognise.plausibility" in inner_imports("flight.processing.pipeline")
    assert "flight.processing.pipeline" in inner_imports("cli.process")
    assert "flight.processing.pipeline" not in inner_imports("cli.process", only_at_import=True)
    assert {"numpy", "insgnss.base.compilation"} <= set(imports("navigation.filter.kernels.update"))


def test_exceptions_are_still_needed() -> None:
    """Oracle: the sources; an exception that nothing needs any more must go."""
    assert set(LONG_MODULES) == {module for module in MODULES if lines(module) > MODULE_LINES}
    assert set(LONG_FUNCTIONS) == {
        where for module in MODULES for where, length, limit in functions(module) if length > limit
    }


def test_imports_name_modules_that_exist() -> None:
    """Oracle: the files; an import inside a function fails only when a user gets there."""
    missing = {
        (module, name)
        for module in MODULES
        for name in imports(module)
        if name.startswith("insgnss.") and name.removeprefix("insgnss.") not in MODULES
    }
    assert not missing


def test_no_kind_is_read_from_a_name() -> None:
    """Oracle: the syntax tree. What a state, a parameter, a component or a check is stands in the
    fields of its record; a label is compared as a whole, and never by its beginning, its end or a
    part. Files, tables and columns of files have no such record.
    """
    assert [ast.unparse(node) for node in texts_of_labels(ast.parse(PLANTED_LABELS), True)] == [
        "check.name.startswith('GNSS ')",
        "' from ' in state.name",
        "name.rpartition('_')",
    ]
    parsed = {
        f"{module}:{node.lineno}: {ast.unparse(node)}"
        for module in MODULES
        if not module.startswith("base.")  # below the records
        for node in texts_of_labels(tree(module), module.startswith(LABELLED))
    }
    assert not parsed, "\n".join(sorted(parsed))


def test_no_message_is_taken_apart() -> None:
    """Oracle: the syntax tree. What is wrong by an error (`problem`, `location`, `key`) and what a
    finding holds stands in its fields; a sentence is shown as a whole.
    """
    assert {ast.unparse(node) for node in sentences_parsed(ast.parse(PLANTED_SENTENCES))} == {
        "check.found.startswith('as ')",
        "'counts' in finding.evidence",
        "'set' in str(refusal)",
        "str(refusal).partition(': ')",
    }
    parsed = {
        f"{module}:{node.lineno}: {ast.unparse(node)}"
        for module in MODULES
        for node in sentences_parsed(tree(module))
    }
    assert not parsed, "\n".join(sorted(parsed))


def sentences_parsed(parsed: ast.AST) -> Iterator[ast.expr]:
    """Yield where a part of a finding's sentence, or of the text of a caught error, decides."""
    caught = {node.name for node in ast.walk(parsed) if isinstance(node, ast.ExceptHandler)}

    def is_sentence(node: ast.expr) -> bool:
        match node:
            case ast.Attribute(attr=attr):
                return attr in SENTENCES
            case ast.Call(func=ast.Name("str"), args=[ast.Name(name)]):
                return name in caught
        return False

    for node in ast.walk(parsed):
        match node:
            case ast.Call(func=ast.Attribute(value=text, attr=method), args=[_, *_]):
                parses = method in PARSING and is_sentence(text)
            case ast.Compare(ops=[ast.In() | ast.NotIn()], comparators=[text]):
                parses = is_sentence(text)
            case _:
                parses = False
        if parses:
            yield node


def texts_of_labels(parsed: ast.AST, bare: bool) -> Iterator[ast.expr]:
    """Yield where the text of a label decides; with `bare` also that of a variable called so."""

    def is_label(node: ast.expr) -> bool:
        if isinstance(node, ast.Attribute):
            of = node.value.id if isinstance(node.value, ast.Name) else ""
            return node.attr in LABELS and of not in OF_FILES
        return bare and isinstance(node, ast.Name) and node.id in LABELS

    for node in ast.walk(parsed):
        match node:
            case ast.Call(func=ast.Attribute(value=text, attr=method)) if method in PARSING:
                parses = is_label(text)
            case ast.Compare(left=ast.Constant(), ops=[ast.In() | ast.NotIn()], comparators=[text]):
                parses = is_label(text)
            case _:
                parses = False
        if parses:
            yield node


def test_no_cycles() -> None:
    """Oracle: graphlib. Modules, by all their imports: those within functions and for type checkers
    as well.
    """
    graph = {module: inner_imports(module) for module in MODULES}
    assert set(graph) <= set(TopologicalSorter(graph).static_order())


def test_help_loads_the_standard_library_only() -> None:
    """Oracle: sys.stdlib_module_names, over all that `insgnss --help` imports."""
    seen, todo = set(), ["__main__", "__init__"]
    while todo:
        module = todo.pop()
        seen.add(module)
        todo += inner_imports(module, only_at_import=True) - seen
        outer = {name.split(".")[0] for name in imports(module, only_at_import=True)} - {"insgnss"}
        assert outer <= sys.stdlib_module_names, (
            f"{module} imports {outer - sys.stdlib_module_names}"
        )
    assert {"cli", "base.errors"} <= seen


def test_heavy_libraries_are_imported_where_they_are_used() -> None:
    """Oracle: the house rule that importing is cheap."""
    heavy = [
        f"{module} imports {name} at its top; import it in the function that needs it"
        for module in MODULES
        for name in sorted(imports(module, only_at_import=True))
        if name.split(".")[0] in LOCAL_ONLY
    ]
    assert heavy == []


@cache
def docstrings(module: str) -> tuple[tuple[int, int], ...]:
    """First and last line of each docstring of a module."""
    owners = (ast.Module, ast.ClassDef, ast.FunctionDef)
    texts = [
        node.body[0]
        for node in nodes(module)
        if isinstance(node, owners) and ast.get_docstring(node, clean=False)
    ]
    return tuple((text.lineno, text.end_lineno or text.lineno) for text in texts)


def docstring_lines(module: str, begin: int, end: int) -> int:
    """Lines of a module's docstrings between two lines, both included."""
    return sum(b - a + 1 for a, b in docstrings(module) if begin <= a and b <= end)


@cache
def lines(module: str) -> int:
    """Lines of a module without its docstrings."""
    whole = len(MODULES[module].read_text(encoding="utf-8").splitlines())
    return whole - docstring_lines(module, 1, whole)


@cache
def functions(module: str) -> tuple[tuple[str, int, int], ...]:
    """Name, length and limit of each function; documentation, which has sections of its own, is not
    counted.
    """
    compiled = module.split(".")[-1] == "_kernels" or "kernels" in module.split(".")[:-1]
    limit = KERNEL_LINES if compiled else FUNCTION_LINES
    measured = []
    for node in nodes(module):
        if isinstance(node, ast.FunctionDef):
            end = node.end_lineno or node.lineno
            length = end - node.lineno + 1 - docstring_lines(module, node.lineno, end)
            measured.append((f"{module}.{node.name}", length, limit))
    return tuple(measured)


def test_size() -> None:
    """Oracle: the house's limits; what is longer says why in the lists above."""
    long = [
        f"{module} has {lines(module)} lines (limit {MODULE_LINES}); find the noun it misses"
        for module in MODULES
        if lines(module) > MODULE_LINES and module not in LONG_MODULES
    ]
    long += [
        f"{where} has {length} lines (limit {limit}); make two of it"
        for module in MODULES
        for where, length, limit in functions(module)
        if length > limit and where not in LONG_FUNCTIONS
    ]
    assert long == []


def test_only_the_command_line_prints() -> None:
    """Oracle: the house rule."""
    prints = [
        f"{module}:{node.lineno}"
        for module in MODULES
        if module.split(".")[0] != "cli"
        for node in nodes(module)
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id == "print"
    ]
    assert prints == []


def test_kernels_are_defined_by_the_decorator_of_the_house() -> None:
    """Oracle: the sources; by numba's own decorator a change of a callee in another file would go
    unnoticed.
    """
    importing = {
        module for module in MODULES if "numba" in {name.split(".")[0] for name in imports(module)}
    }
    assert {".".join(module.split(".")[:2]) for module in importing} == {"base.compilation"}


def test_compiled_code_belongs_to_all_that_a_kernel_can_refer_to() -> None:
    """Oracle: the imports of the sources by Python's own parser, followed through all modules."""
    compiled = [module for module in MODULES if "base.compilation" in inner_imports(module)]
    assert compiled
    for module in compiled:
        seen, todo = set(), [module]
        while todo:
            one = todo.pop()
            seen.add(one)
            todo += inner_imports(one, only_at_import=True) - seen
        missing = {MODULES[one] for one in seen} - closure(MODULES[module])
        assert not missing, f"what {module} compiles does not belong to {missing}"


@pytest.mark.parametrize("folder", ["insgnss", "scripts", "benchmarks", "tests"])
def test_no_notes_to_oneself(folder: str) -> None:
    """Oracle: the house rule that nothing unfinished is shipped."""
    note = re.compile(r"\b(" + "|".join(["TO" + "DO", "FIX" + "ME", "X" * 3]) + r")\b")
    found = [
        f"{path}:{number}"
        for path in sorted((ROOT / folder).rglob("*.py"))
        for number, text in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if note.search(text)
    ]
    assert found == []


OPENS = re.compile(
    r"\.open\((\"rb\"|encoding)|\.read_bytes\(\)|\.read_text\(|np\.load\(\w*[pP]ath|Image\.open\(path"
)
WITHOUT_DOOR = {  # reads without `base.inputs`, and why
    "base/ahead.py": "a list in the package",
    "base/compilation/kept.py": "sources of the package",
    "base/shipped.py": "a description in the package",
    "base/memory.py": "what the kernel says of memory",
    "base/received/nesting.py": "a document that is going to be replaced",
    "cli/calibrate/imu.py": "a file that is going to be replaced",
    "cli/compare.py": "a page that is going to be replaced",
    "flight/exporting/replacing.py": "files that are going to be replaced",
    "io/formats/bundle/import_helpers.py": "a table that the run has just written",
    "io/formats/bundle/opensfm.py": "a file that is going to be replaced",
    "gnss/engine/combined.py": "solutions of the engine in the run's scratch directory",
    "gnss/engine/program.py": "the engine's program and the first line of its output",
    "gnss/engine/rtklib.py": "the engine's own files in the run's scratch directory, which grow",
    "gnss/engine/worker.py": "options that the run has written",
    "batch/installation/limits.py": "the sources of the package itself",
    "batch/installation/examination.py": "what the kernel says of the processor",
    "photogrammetry/mounting_calibration/products.py": "a file that is going to be replaced",
    "report/markup.py": "files of the package",
    "batch/season/page.py": "a page or a table that is going to be replaced",
    "simulation/faults.py": "a data set that is being made",
    "photogrammetry/target_measurement/run.py": "a table that is going to be replaced",
}


def test_files_of_the_user_are_read_through_one_door() -> None:
    """Oracle: the sources; whatever reads by other means says why."""
    found = {
        path.relative_to(PACKAGE).as_posix()
        for path in PACKAGE.rglob("*.py")
        if OPENS.search(path.read_text(encoding="utf-8"))
    }
    assert found == set(WITHOUT_DOOR)
