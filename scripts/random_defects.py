"""Plant defects at random places of numeric code, and see whether the room's quick tests notice.

    python scripts/random_defects.py                        60 of all rooms below, seed 0
    python scripts/random_defects.py --rooms orient align --number 20 --seed 3
    python scripts/random_defects.py --named                a first look: survivors are too many
    python scripts/random_defects.py --list                 only where, and what

Beside `planted_defects.py`, whose defects somebody chose: rooms are drawn in turn, of a room a
place, of a place one change:

    + and -, * and /        exchanged          and, or           exchanged
    < and <=, > and >=      exchanged where a whole number is compared, else < and >
    min, max                exchanged          a whole index     one more
    a float                 times 1.5 or 0.5   a minus sign      left out

Texts, errors, annotations and modules of pages are left alone, and so is what changes no number:
sizes of memory, shares of progress, and guards against rounding (within a function a float below
1e-5 that multiplies nothing, or one below 1e-9). The quick tests of the room are run, and those
that name the module where none of the room does. A survivor may still be one that changes nothing
(a limit that no number meets), which a person judges. It ends in a table, and in exit code 1 where
fewer than 85 % are caught.
"""

import argparse
import ast
import os
import random
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from planted_defects import PASSED, ROOT, copy_tree, run_tests

NAVIGATION = ("align", "filter", "orient", "prepare", "diagnosis", "innovations", "recognise")
ROOMS = (*(f"navigation/{room}" for room in NAVIGATION), "gnss", "photogrammetry", "noise")
LEAST_SHARE = 0.85
OVERTIME = -1  # of `run_tests`: a slow machine, or a loop without end
OPERATORS = {ast.Add: "+-", ast.Sub: "-+", ast.Mult: "*/", ast.Div: "/*"}
COMPARED = {ast.Lt: ("<", "<=", ">"), ast.LtE: ("<=", "<", ">=")}
COMPARED |= {ast.Gt: (">", ">=", "<"), ast.GtE: (">=", ">", "<=")}
EXTREMES = {"min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum"}
TEXTUAL = (ast.JoinedStr, ast.Raise, ast.Assert)
OF_PAGES = re.compile(r"(page|products|words|sheet|figures|summary|worker)\.py$")
NO_UNIT = 1e-9  # and below it factors do: units are larger
PROGRESS = {"within", "share", "progress"}  # calls that say how far the work is
ROUNDING = 1e-5  # floats below it that are no factor keep a division from zero, or allow rounding


@dataclass(frozen=True)
class Change:
    """`new` in the place of the characters `begin` to `end` of a file's text, in line `line`."""

    file: Path
    line: int
    begin: int
    end: int
    new: str

    def __str__(self) -> str:
        """Return file and line, and the line as it becomes."""
        text = (ROOT / self.file).read_text(encoding="utf-8")
        start = text.rfind("\n", 0, self.begin) + 1
        before, after = text[start : self.begin].lstrip(), text[self.end :].split("\n", 1)[0]
        changed = f"[{text[self.begin : self.end]} -> {self.new}]"
        return f"{self.file}:{self.line}: {before}{changed}{after}"


class _Places(ast.NodeVisitor):
    """Collects the changes that a text can have as (begin, end, new)."""

    def __init__(self, text: str) -> None:
        self.text, self.found = text, list[tuple[int, int, str]]()
        self.encoded = [line.encode() for line in text.splitlines(keepends=True)]
        self.starts, self.factors, self.in_function = [0], set[int](), False
        for line in text.splitlines(keepends=True):
            self.starts.append(self.starts[-1] + len(line))

    def at(self, line: int, column: int) -> int:
        """Place in the text of a line and a column in bytes."""
        return self.starts[line - 1] + len(self.encoded[line - 1][:column].decode())

    def span(self, node: ast.expr) -> tuple[int, int]:
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        return self.at(node.lineno, node.col_offset), self.at(node.end_lineno, node.end_col_offset)

    def between(self, left: ast.expr, right: ast.expr, old: str, new: str) -> None:
        """Exchange the one operator between two nodes."""
        begin, end = self.span(left)[1], self.span(right)[0]
        operator = rf"(?<![*/<>=]){re.escape(old)}(?![*/=])"
        places = list(re.finditer(operator, self.text[begin:end]))
        if len(places) == 1:
            self.found.append((begin + places[0].start(), begin + places[0].end(), new))

    def visit(self, node: ast.AST) -> None:
        if isinstance(node, TEXTUAL):
            return
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]).endswith("BYTES"):
            return
        if isinstance(node, ast.Call) and ast.unparse(node.func).split(".")[-1] in PROGRESS:
            return
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult | ast.Div):
            self.factors |= {id(node.left), id(node.right)}
        match node:
            case ast.BinOp(left=ast.Constant(value=0 | 0.0), op=ast.Mult() | ast.Div()):
                pass  # zero, multiplied or divided
            case ast.BinOp() if type(node.op) in OPERATORS and not _is_text(node):
                self.between(node.left, node.right, *OPERATORS[type(node.op)])
            case ast.Compare(ops=[one], comparators=[right]) if type(one) in COMPARED:
                old, bound, reverse = COMPARED[type(one)]
                whole = _is_count(node.left) or _is_count(right)
                self.between(node.left, right, old, bound if whole else reverse)
            case ast.BoolOp(values=[left, right, *_]):
                old, new = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
                self.between(left, right, old, new)
            case ast.UnaryOp(op=ast.USub()):
                begin = self.span(node)[0]
                self.found.append((begin, begin + 1, ""))
            case ast.Constant(value=float() as value) if value and not self.is_guard(node):
                self.found.extend((*self.span(node), f"{value * by:.15g}") for by in (1.5, 0.5))
            case ast.Name(id=name) if name in EXTREMES:
                self.found.append((*self.span(node), EXTREMES[name]))
            case ast.Attribute(attr=name) if name in EXTREMES:
                end = self.span(node)[1]
                self.found.append((end - len(name), end, EXTREMES[name]))
            case ast.Subscript(slice=ast.Constant(value=int() as index) as place):
                self.found.append((*self.span(place), str(index + 1)))
        if isinstance(node, ast.AnnAssign):
            return self.visit(node.value) if node.value else None
        if isinstance(node, ast.FunctionDef):
            outer, self.in_function = self.in_function, True
            for part in (*node.args.defaults, *filter(None, node.args.kw_defaults), *node.body):
                self.visit(part)
            self.in_function = outer
            return None
        return self.generic_visit(node)

    def is_guard(self, node: ast.Constant) -> bool:
        """Whether a float of a function is a guard against rounding."""
        assert isinstance(node.value, float)
        least = NO_UNIT if id(node) in self.factors else ROUNDING
        return self.in_function and node.value < least


def _is_count(node: ast.expr) -> bool:
    """Whether it is a whole number: a bound of real numbers no test can see."""
    match node:
        case ast.Constant(value=int()) | ast.Attribute(attr="size" | "n"):
            return True
        case ast.Call(func=ast.Name(id="len")) | ast.Call(func=ast.Attribute(attr="sum")):
            return True
        case ast.Subscript(value=ast.Attribute(attr="shape")):
            return True
    return False


def _is_text(node: ast.BinOp) -> bool:
    """Whether texts or lists are joined."""
    return any(
        isinstance(part, (ast.JoinedStr, ast.List))
        or (isinstance(part, ast.Constant) and isinstance(part.value, str))
        for part in (node.left, node.right)
    )


def changes_of(file: Path) -> list[list[Change]]:
    """The changes that a file of the checkout can have, line by line."""
    text = (ROOT / file).read_text(encoding="utf-8")
    places = _Places(text)
    places.visit(ast.parse(text))
    lines: dict[int, list[Change]] = {}
    for begin, end, new in sorted(places.found):
        line = text.count("\n", 0, begin) + 1
        lines.setdefault(line, []).append(Change(file, line, begin, end, new))
    return list(lines.values())


def drawn(rooms: list[str], number: int, seed: int) -> Iterator[tuple[str, Change]]:
    """Changes of the rooms in turn, each in a line of its own."""
    rng = random.Random(seed)
    of_room = {}
    for room in rooms:
        every = sorted((ROOT / "insgnss" / room).rglob("*.py"))
        files = [f for f in every if not OF_PAGES.search(f.name)]
        of_room[room] = [line for f in files for line in changes_of(f.relative_to(ROOT))]
        rng.shuffle(of_room[room])
    for k in range(number):
        room = rooms[k % len(rooms)]
        if of_room[room]:
            yield room, rng.choice(of_room[room].pop())


def tests_of(file: Path, named_only: bool) -> list[str]:
    """The tests of a module's room, those that name it first, or else those elsewhere that do.

    A room's tests stand in the folder of its name, or of the nearest one above; in the folder of a
    whole wing they are those that name the room.
    """
    *parts, name = file.with_suffix("").parts[1:]
    every = {f: f.read_text("utf-8") for f in sorted((ROOT / "tests").rglob("test_*.py"))}
    folder = ".".join(["insgnss", *parts])
    names = rf"from {folder} import (\([^)]*|[^(\n]*)\b{name}\b|from {folder}.{name} import"
    named = [f for f, text in every.items() if re.search(names, text)]
    depth = max(n for n in range(len(parts) + 1) if (ROOT / "tests").joinpath(*parts[:n]).is_dir())
    home = (ROOT / "tests").joinpath(*parts[:depth])
    of_room = [f for f in every if home in f.parents]
    if depth < min(len(parts), 2):
        of_room = [f for f in of_room if ".".join(["insgnss", *parts[:2]]) in every[f]]
    chosen = [f for f in named if f in of_room] or named
    if not (named_only and chosen):
        chosen = [*chosen, *of_room]
    return [str(f.relative_to(ROOT)) for f in dict.fromkeys(chosen)]


def attempt(change: Change, tests: list[str], tree: Path, cache: Path) -> int:
    """Exit code of the room's quick tests with the change in a copy of the tree.

    Kernels are compiled once for all changes elsewhere; where theirs is the file, what refers to
    it is compiled again in a copy of the cache.
    """
    file = tree / change.file
    before, stamp = file.read_text(encoding="utf-8"), file.stat()
    file.write_text(before[: change.begin] + change.new + before[change.end :], encoding="utf-8")
    try:
        with tempfile.TemporaryDirectory(prefix="random-cache-") as name:
            compiled = Path(name) / "cache"
            if "njit" in before and cache.is_dir():
                shutil.copytree(cache, compiled, copy_function=os.link)
            return run_tests(
                tree, tests, True, compiled if "njit" in before else cache, "-x", "-n0"
            )
    finally:
        file.write_text(before, encoding="utf-8")
        os.utime(file, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))  # compiled kernels stay valid


def main() -> int:
    """Read the options, try the changes, and report."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rooms", nargs="+", default=list(ROOMS), help="folders of insgnss")
    parser.add_argument("--number", type=int, default=60, help="of changes")
    parser.add_argument("--seed", type=int, default=0, help="of the draw")
    parser.add_argument("--named", action="store_true", help="only tests that name the module")
    parser.add_argument("--list", action="store_true", help="only print the changes")
    options = parser.parse_args()
    chosen = list(drawn(options.rooms, options.number, options.seed))
    caught, undecided = (dict.fromkeys(options.rooms, 0) for _ in range(2))
    with tempfile.TemporaryDirectory(prefix="random-") as name:
        tree = Path(name) / "tree"
        if not options.list:
            copy_tree(tree)
        for room, change in chosen:
            if options.list:
                print(change)
                continue
            begin = time.monotonic()
            code = attempt(change, tests_of(change.file, options.named), tree, Path(name) / "cache")
            verdict = {PASSED: "survived", OVERTIME: "no verdict"}.get(code, "caught")
            caught[room] += verdict == "caught"
            undecided[room] += verdict == "no verdict"
            print(f"{verdict:<10}{time.monotonic() - begin:6.1f} s  {change}", flush=True)
    if options.list:
        return 0
    for room, count in caught.items():
        tried = sum(r == room for r, _ in chosen) - undecided[room]
        print(f"{room:<24}{count:>4} of {tried}")
    tried = len(chosen) - sum(undecided.values())
    share = sum(caught.values()) / max(tried, 1)
    print(f"{'all':<24}{sum(caught.values()):>4} of {tried}: {share:.1%}")
    return 0 if share >= LEAST_SHARE else 1


if __name__ == "__main__":
    sys.exit(main())
