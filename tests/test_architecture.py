"""The house: which room stands on which, what may be imported when, and how long a piece of code
may get. Read from the sources.
"""

import ast
import re
import sys
from collections.abc import Iterator
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

from insgnss.base.compilation import closure

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "insgnss"

BELOW_ALL = {"base", "geodesy", "records"}
STANDS_ON = {  # the table of the design, room by room; what is below all is not repeated
    "base": set(),
    "geodesy": {"base"},
    "records": {"base", "geodesy"},
    "formats": BELOW_ALL,
    "prepare": BELOW_ALL,
    # what a recording says of itself, held against the flight file
    "recognise": BELOW_ALL | {"prepare"},
    "stochastic": BELOW_ALL,
    "navigation": BELOW_ALL | {"stochastic"},
    "align": BELOW_ALL | {"navigation"},
    "orient": BELOW_ALL,
    # what a user can ask for; values are checked by the rooms that know them
    "config": BELOW_ALL | {"formats", "prepare", "orient", "recognise", "stochastic"},
    # which event is which image
    "exposures": BELOW_ALL | {"formats", "config"},
    "gnss": BELOW_ALL | {"formats", "exposures", "config", "prepare"},
    "calibrate": BELOW_ALL | {"navigation", "orient", "prepare"},
    # which error model explains the innovations
    "diagnosis": BELOW_ALL | {"calibrate", "navigation", "orient", "stochastic"},
    "adjust": BELOW_ALL | {"orient"},
    # pixels of cameras
    "targets": BELOW_ALL | {"adjust"},
    # formats: a simulated flight is written as a data set;
    # gnss: a simulated receiver flies under broadcast orbits
    # adjust: pixels of its cameras
    "simulation": BELOW_ALL | {"stochastic", "formats", "gnss", "orient", "adjust"},
    "report": BELOW_ALL,
}
ROOMS = set(STANDS_ON)
STANDS_ON |= {
    "exporting": ROOMS,
    "comparison": ROOMS,
    "proof": ROOMS | {"exporting"},
    # exporting: formats of the adjusted orientation
    "block_adjustment": ROOMS | {"exporting", "processing"},
    # comparison: poses of any format; processing: a flight is solved with each mounting
    "mounting_calibration": ROOMS | {"comparison", "processing"},
    # block_adjustment: ground points in the axes of the orientation
    "target_measurement": ROOMS | {"block_adjustment", "processing"},
    "processing": ROOMS | {"exporting"},
    "reference": BELOW_ALL | {"align", "config", "navigation", "prepare", "processing"},
    "inspection": ROOMS | {"processing"},
    "tuning": ROOMS | {"processing"},
    "installation": BELOW_ALL | {"gnss", "navigation"},
    # report: its page
    "season": BELOW_ALL | {"config", "navigation", "report", "processing"},
    "cli": (
        (ROOMS - {"adjust", "targets"})
        | {"processing", "inspection", "tuning", "reference", "exporting", "comparison", "proof"}
        | {"block_adjustment", "mounting_calibration", "target_measurement", "installation"}
        | {"season"}
    ),
    "api": ROOMS
    | {"processing", "inspection", "tuning", "exporting", "comparison", "block_adjustment"}
    | {"mounting_calibration", "target_measurement"},
    # loaded when a public name is first used
    "__init__": ROOMS | {"api", "processing", "target_measurement", "tuning"},
    "__main__": {"cli"},
}
INNER = {  # folders inside rooms, from below; a folder stands on those before it
    "formats": (
        "text",
        "imu",
        "orientation",
        "positions",
        "gnss",
        "events",
        "trajectory",
        "arrays",
        "logs",
        "bundle",
        "blocks",
        "returned",
        "vehicle",
        "markers",
        "gis",
        "images",
    ),
    "gnss": ("rinex", "satellites", "phase", "engine", "quality", "exposures"),
    "stochastic": ("moments", "estimation"),
    "report": ("rules", "charts", "figures"),
    "tuning": ("products", "in_flight"),
}
FOLDER_MODULES = 16  # beside __init__: as many as a reader overlooks

ALLOWED_ALL_THE_SAME: dict[tuple[str, str], str] = {}  # (importing module, imported module): reason
LOCAL_ONLY = {
    "matplotlib",
    "scipy",
    "pandas",
    "pyproj",
    "georinex",
    "filterpy",
    "netCDF4",
    "xarray",
    "pymavlink",
    "pyulog",
    "h5py",
}
LOCAL_ONLY |= {"dask", "distributed", "pyarrow"}
LOCAL_ONLY |= {"orjson", "pycolmap", "pyceres", "pyrtklib5", "hatanaka"}

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
    return frozenset(names)


def inner_imports(module: str, only_at_import: bool = False) -> set[str]:
    """Modules of the package that `module` imports."""
    names = {
        name.removeprefix("insgnss.")
        for name in imports(module, only_at_import)
        if name.startswith("insgnss.")
    }
    return names & set(MODULES)


def test_every_room_has_its_line_in_the_table() -> None:
    """Oracle: the directory's listing against the design's table."""
    assert {module.split(".")[0] for module in MODULES} - {"__init__"} <= set(STANDS_ON)


def test_no_arrow_runs_against_the_table() -> None:
    """Oracle: the design's table."""
    against = []
    for module in MODULES:
        room = module.split(".")[0]
        against += [
            f"{module} imports {other}; {room} may stand on"
            f" {', '.join(sorted(STANDS_ON.get(room, ()))) or 'nothing'}"
            for other in sorted(inner_imports(module))
            if other.split(".")[0] not in {room} | STANDS_ON.get(room, set())
            and (module, other) not in ALLOWED_ALL_THE_SAME
        ]
    assert against == []


def folder_in(room: str, module: str) -> str:
    """Folder inside a room that a module stands in, "" for the room itself."""
    parts = module.split(".")
    inside = parts[0] == room and len(parts) > 1 and parts[1] in INNER[room]
    return parts[1] if inside else ""


@pytest.mark.parametrize("room", INNER)
def test_folders_inside_a_room_stand_on_those_below(room: str) -> None:
    """Oracle: the order of the table, which names every folder of code."""
    folders = {path.parent.name for path in (PACKAGE / room).glob("*/__init__.py")}
    assert folders == set(INNER[room])
    for module in MODULES:
        if own := folder_in(room, module):
            below = {folder_in(room, other) for other in inner_imports(module)} - {"", own}
            allowed = INNER[room][: INNER[room].index(own)]
            assert below <= set(allowed), f"{module} imports {below - set(allowed)}"


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
        "config.flight_file",
        "navigation.problem",
        "prepare.clock",
    } <= inner_imports("processing.solve_segments")
    assert "recognise.plausibility" in inner_imports("processing.checks")
    assert "processing.pipeline" in inner_imports("cli.process")
    assert "processing.pipeline" not in inner_imports("cli.process", only_at_import=True)
    assert {"numpy", "insgnss.base.compilation"} <= set(imports("navigation.kernels.update"))


def test_exceptions_are_still_needed() -> None:
    """Oracle: the sources; an exception that nothing needs any more must go."""
    assert all(other in inner_imports(module) for module, other in ALLOWED_ALL_THE_SAME)
    assert set(LONG_MODULES) == {module for module in MODULES if lines(module) > MODULE_LINES}
    assert set(LONG_FUNCTIONS) == {
        where for module in MODULES for where, length, limit in functions(module) if length > limit
    }


def test_no_cycles() -> None:
    """Oracle: graphlib. Rooms and modules, by all their imports: those within functions and for
    type checkers as well.
    """
    rooms: dict[str, set[str]] = {}
    for module in MODULES:
        room = module.split(".")[0]
        rooms.setdefault(room, set()).update(
            {other.split(".")[0] for other in inner_imports(module)} - {room}
        )
    for graph in (rooms, {module: inner_imports(module) for module in MODULES}):
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
    assert importing == {"base.compilation"}


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
    "base/compilation.py": "sources of the package",
    "base/memory.py": "what the kernel says of memory",
    "base/received/nesting.py": "a document that is going to be replaced",
    "cli/calibrate/imu.py": "a file that is going to be replaced",
    "cli/compare.py": "a page that is going to be replaced",
    "flight/exporting/replacing.py": "files that are going to be replaced",
    "io/formats/bundle/import_helpers.py": "a table that the run has just written",
    "io/formats/bundle/opensfm.py": "a file that is going to be replaced",
    "gnss/engine/combined.py": "solutions of the engine in the run's scratch directory",
    "gnss/engine/rtklib.py": "the engine's own files, which grow while they are read",
    "gnss/engine/worker.py": "options that the run has written",
    "batch/installation/surroundings.py": "what the kernel says of the processor",
    "photogrammetry/mounting_calibration/products.py": "a file that is going to be replaced",
    "report/markup.py": "files of the package",
    "batch/season/page.py": "a page that is going to be replaced",
    "batch/season/run.py": "a table that is going to be replaced",
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
