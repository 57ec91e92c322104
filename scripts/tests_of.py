"""Name the test files that a change can reach, in place of the whole suite.

    python scripts/tests_of.py                       of what differs from the last commit
    python scripts/tests_of.py main~3                of what differs from another one
    python scripts/tests_of.py --run -x -m ""        run them, with options of pytest
    python scripts/tests_of.py --changed FILE ...    of these files, whether they differ or not

A test file reaches a changed file if its code uses one of the names that the changed file defines,
directly or through the functions and classes that it uses. Names are followed one by one, those
that a function imports as well: a file that a module imports for another of its functions does not
count, nor do imports for type checkers and annotations of functions. Names loaded late are
followed where their tables say so: the public names of `insgnss` by the name that is used,
"module:function" in tables of formats, "insgnss.x.y" in a test, and of the command line the verbs
whose words occur in the test. A data file, page or script is reached by code that has its name in
a string, and by tests that list its folder ("*.py" and "insgnss").

What it cannot see: a change of how one module's import acts on another, of installed packages, and
of tests chosen by what they compute. The whole suite stays what decides before a merge.
"""

import argparse
import ast
import gc
import re
import subprocess
import sys
from collections.abc import Iterable
from fnmatch import fnmatch
from functools import cached_property
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = "insgnss"
FOLDERS = (PACKAGE, "tests", "scripts", "benchmarks")
BODY = ""  # name of what a module runs when it is imported, beside its definitions
ALL = "*"
LOCATION = re.compile(r"\.?([a-z_]\w*(?:\.\w+)*)(?::(\w+))?")  # "room.module:function"
DOTTED = re.compile(rf"\b{PACKAGE}(?:\.\w+)+")
CONTAINERS = ast.List | ast.Tuple | ast.Dict | ast.Set | ast.DictComp | ast.ListComp
FUNCTIONS = ast.FunctionDef | ast.AsyncFunctionDef

Node = tuple[str, str]  # a module by its dotted name, and one of its definitions


class Module:
    """One source file: its definitions, and what the names of its imports mean.

    Attributes
    ----------
    file : path relative to the root.
    name : dotted name; the package's own begin with "insgnss.", a test's with "tests.".
    of_package : whether it belongs to the package.
    definitions : statements of the module's body by the name that they define.
    imports : module and name (None: the module itself) by local name.
    late : the same of imports for type checkers, which say where a lazily loaded name is at home.
    """

    def __init__(self, file: str, text: str) -> None:
        parts = Path(file).with_suffix("").parts
        self.file, self.text = file, text
        self.is_package = parts[-1] == "__init__"
        self.name = ".".join(parts[:-1] if self.is_package else parts)
        self.of_package = parts[0] == PACKAGE
        self.package = self.name if self.is_package else ".".join(parts[:-1])
        self.definitions: dict[str, list[ast.stmt]] = {BODY: []}
        self.imports: dict[str, tuple[str, str | None]] = {}
        self.late: dict[str, tuple[str, str | None]] = {}
        self._define(ast.parse(text).body)
        self.lazy = "__getattr__" in self.definitions
        self.names = {*self.definitions, *self.imports, *self.late}

    def _define(self, body: list[ast.stmt]) -> None:
        for statement in body:
            if isinstance(statement, FUNCTIONS | ast.ClassDef):
                self.definitions.setdefault(statement.name, []).append(statement)
            elif isinstance(statement, ast.Import | ast.ImportFrom):
                self.imports |= self.meaning(statement)
            elif is_typing(statement):
                for inner in ast.walk(statement):
                    if isinstance(inner, ast.Import | ast.ImportFrom):
                        self.late |= self.meaning(inner)
            elif isinstance(statement, ast.If | ast.Try | ast.With):
                for part in ("body", "orelse", "finalbody"):
                    self._define(getattr(statement, part, []))
                for handler in getattr(statement, "handlers", []):
                    self._define(handler.body)
            elif not is_text(statement):
                targets = getattr(statement, "targets", [getattr(statement, "target", None)])
                names = [
                    node.id
                    for target in targets
                    if target is not None
                    for node in ast.walk(target)
                    if isinstance(node, ast.Name)
                ]
                for name in names or [BODY]:
                    self.definitions.setdefault(name, []).append(statement)

    @cached_property
    def words(self) -> set[str]:
        """The strings of the file."""
        nodes = ast.walk(ast.parse(self.text))
        return {
            node.value
            for node in nodes
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value
        }

    def meaning(self, statement: ast.Import | ast.ImportFrom) -> dict[str, tuple[str, str | None]]:
        """Return module and name by the local names that one import statement binds."""
        if isinstance(statement, ast.Import):
            return {
                alias.asname or alias.name.partition(".")[0]: (
                    alias.name if alias.asname else alias.name.partition(".")[0],
                    None,
                )
                for alias in statement.names
            }
        stem = statement.module or ""
        if statement.level:
            base = self.package.split(".")
            base = base[: len(base) - statement.level + 1]
            stem = ".".join([*base, *filter(None, [statement.module])])
        return {alias.asname or alias.name: (stem, alias.name) for alias in statement.names}


def is_typing(statement: ast.AST) -> bool:
    """Return whether a statement is for type checkers alone."""
    test = statement.test if isinstance(statement, ast.If) else None
    return getattr(test, "id", getattr(test, "attr", "")) in ("TYPE_CHECKING", "_TYPE_CHECKING")


def is_text(statement: ast.AST) -> bool:
    """Return whether a statement is a docstring."""
    return isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)


class Uses:
    """What one definition uses: other definitions, strings, and patterns of files that it lists."""

    def __init__(self, tree: "Tree", module: Module, name: str) -> None:
        self.tree, self.module = tree, module
        self.nodes: set[Node] = set()
        self.strings: set[str] = set()
        self.patterns: set[str] = set()
        self.words: set[str] = set()  # of strings that may be a command's
        self.verbs: dict[str, set[Node]] = {}  # reached where the word occurs in a test
        self.keyed: dict[str, set[Node]] = {}  # reached where the key occurs in what is reached
        self.bound = dict(module.imports)
        for statement in module.definitions.get(name, []):
            self._visit(statement)
        self.nodes.discard((module.name, name))

    def _reach(self, modules: Iterable[str]) -> None:
        for module in modules:
            self.nodes |= self.tree.nodes_of(self.module, module, BODY)

    def _visit(self, node: ast.AST, command: bool = True) -> None:
        if is_text(node):
            return
        if isinstance(node, ast.Import | ast.ImportFrom):
            self.bound |= self.module.meaning(node)
            if isinstance(node, ast.Import):  # import a.b.c binds a alone
                self._reach(alias.name for alias in node.names)
            return
        if isinstance(node, FUNCTIONS):
            inner = [*node.decorator_list, *node.args.defaults, *node.args.kw_defaults, *node.body]
        else:
            inner = list(ast.iter_child_nodes(node))
        if isinstance(node, ast.Name | ast.Attribute) and self._name(node):
            return
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            self._string(node.value)
            self.words |= {*node.value.split(), node.value} if command else set()
        elif isinstance(node, ast.Dict) and self.module.of_package and self._table(node):
            return
        elif isinstance(node, ast.Call):
            inner = self._call(node, inner)
        elif isinstance(node, ast.JoinedStr):
            self._joined(node)
        # a key, a file's name or what is compared is no word of a command
        command = not isinstance(node, ast.Subscript | ast.Compare | ast.BinOp | ast.Dict)
        for child in inner:
            if child is not None:
                self._visit(child, command)

    def _name(self, node: ast.expr, *more: str) -> bool:
        """Follow a name, or the attributes of one that an import binds."""
        words = list(more)
        while isinstance(node, ast.Attribute):
            words.insert(0, node.attr)
            node = node.value
        if not isinstance(node, ast.Name):
            return False
        if node.id in self.bound:
            self.nodes |= self.tree.follow(self.module, *self.bound[node.id], words)
        elif node.id in self.module.definitions:
            self.nodes.add((self.module.name, node.id))
        return True

    def _call(self, call: ast.Call, inner: list[ast.AST]) -> list[ast.AST]:
        """Follow setattr(module, "name") and the like; note the patterns of files listed."""
        function = getattr(call.func, "attr", getattr(call.func, "id", ""))
        texts = [a.value if isinstance(a, ast.Constant) else None for a in call.args]
        if function in ("glob", "rglob"):
            self.patterns |= {text for text in texts if isinstance(text, str)}
        if (
            function in ("setattr", "delattr", "getattr", "object")
            and len(texts) > 1
            and isinstance(texts[1], str)
            and isinstance(call.args[0], ast.Name | ast.Attribute)
            and self._name(call.args[0], texts[1])
        ):
            return [call.func, *call.args[2:], *(word.value for word in call.keywords)]
        if function == "import_module" and self.module.of_package and not self.module.lazy:
            self._verbs(call.args[0])
        return inner

    def _table(self, table: ast.Dict) -> bool:
        """Note what the entries of a table of "module:function" reach, each by its key."""
        texts = (node for node in ast.walk(table) if isinstance(node, ast.Constant))
        if not any(":" in str(t.value) and LOCATION.fullmatch(str(t.value)) for t in texts):
            return False
        whole = self.nodes
        for key, value in zip(table.keys, table.values, strict=True):
            self.nodes = set()
            self._visit(value)
            if isinstance(key, ast.Constant) and not isinstance(value, ast.Dict):
                self.keyed.setdefault(str(key.value), set()).update(self.nodes)
            else:
                whole |= self.nodes
        self.nodes = whole
        return True

    def _verbs(self, argument: ast.expr) -> None:
        """Note the modules beside this one, or in a folder there, that a table's words name."""
        first = argument.values[0] if isinstance(argument, ast.JoinedStr) else None
        head = first.value.strip(".") if isinstance(first, ast.Constant) else ""
        modules, words = self.tree.modules, self.module.words
        if not head and any(":" in word and LOCATION.fullmatch(word) for word in words):
            return  # locations in full
        for word in words:
            stem = ".".join(filter(None, [self.module.package, head]))
            nodes = {
                node
                for name in (f"{stem}.{word}", *self.tree.below(stem, word))
                if name in modules
                for node in self.tree.nodes_of(self.module, name, ALL)
            }
            if head:  # a folder of readers: any of them
                self.nodes |= nodes
            elif nodes:
                self.verbs.setdefault(word, set()).update(nodes)

    def _joined(self, text: ast.JoinedStr) -> None:
        """Follow what is imported as f"insgnss.room.{name}" by the strings of this file."""
        first = text.values[0] if text.values else None
        if isinstance(first, ast.Constant) and str(first.value).startswith(f"{PACKAGE}."):
            for word in self.module.words:
                self._reach_location(f"{first.value}{word}", "")

    def _string(self, text: str) -> None:
        self.strings |= {text, text.rpartition("/")[2]}
        match = LOCATION.fullmatch(text)
        if match and not self.module.lazy and (":" in text or "." in text):
            for base in ("", *parents(f"{self.module.package}.")):
                self._reach_location(f"{base}.{match[1]}".strip("."), match[2] or "")
        if not self.module.of_package:
            for name in DOTTED.findall(text):
                self._reach_location(name, "")
            for module in self.tree.outside(Path(text).stem if text.endswith(".py") else ""):
                self.nodes |= self.tree.nodes_of(module, module.name, ALL)
            if text == PACKAGE:
                self.nodes |= self.tree.nodes_of(self.module, f"{PACKAGE}.__main__", ALL)

    def _reach_location(self, name: str, attribute: str) -> None:
        """Reach what "insgnss.room.module.name" names."""
        stem, words = name, [attribute] if attribute else []
        while stem.startswith(f"{PACKAGE}.") and stem not in self.tree.modules:
            stem, _, word = stem.rpartition(".")
            words.insert(0, word)
        module = self.tree.modules.get(stem)
        if module is None or not module.of_package:
            return
        if not words or words[0] in module.names or not module.text:  # flight.toml is no module
            self.nodes |= self.tree.follow(self.module, stem, None, words)


class Tree:
    """The sources of a checkout, and what reaches what in them.

    Parameters
    ----------
    root : directory with insgnss/ and tests/.
    changed : files to be found, relative to the root; deleted ones count as empty modules.
    """

    def __init__(self, root: Path, changed: Iterable[str]) -> None:
        self.root, self.changed = root, set(changed)
        files = {
            path.relative_to(root).as_posix(): path.read_text(encoding="utf-8")
            for folder in FOLDERS
            for path in sorted((root / folder).rglob("*.py"))
        }
        gone = {file: "" for file in self.changed if file.endswith(".py") and file not in files}
        modules = [Module(*item) for item in (gone | files).items()]
        self.modules = {module.name: module for module in modules}
        self._uses: dict[Node, Uses] = {}
        self._outside: dict[str, list[Module]] = {}
        for module in modules:
            if not module.of_package:
                self._outside.setdefault(module.name.rpartition(".")[2], []).append(module)

    @cached_property
    def tests(self) -> list[Module]:
        """The files of tests."""
        return [
            module
            for module in self.modules.values()
            if module.file.startswith("tests/") and Path(module.file).name.startswith("test_")
        ]

    def below(self, stem: str, word: str) -> list[str]:
        """Return modules of a name in the folders of a package."""
        return [
            name
            for name in self.modules
            if name.startswith(f"{stem}.") and name.endswith(f".{word}") and word.isidentifier()
        ]

    def outside(self, stem: str) -> list[Module]:
        """Return the modules of this name outside the package: scripts, helpers of tests."""
        return self._outside.get(stem, [])

    def find(self, user: Module, name: str) -> Module | None:
        """Return the module that `name` means in `user`; tests find theirs by the last word."""
        if name in self.modules or user.of_package or name.startswith(f"{PACKAGE}."):
            return self.modules.get(name)
        near = self.outside(name.rpartition(".")[2])
        near = [module for module in near if module.name.endswith(f".{name}")]
        folders = (user.package, "tests", "scripts", "benchmarks")
        return min(
            near,
            key=lambda m: folders.index(m.package) if m.package in folders else len(folders),
            default=None,
        )

    def follow(self, user: Module, stem: str, name: str | None, words: list[str]) -> set[Node]:
        """Return the definitions that `stem`.`name`.words names in `user`."""
        chain = [*([name] if name else []), *words]
        module, executed = self.find(user, stem), set()
        while module is not None and chain and chain[0] not in module.definitions:
            inner = self.modules.get(f"{module.name}.{chain[0]}")
            target = module.imports.get(chain[0], (module.name, chain[0]))
            if target != (module.name, chain[0]):
                executed.add((module.name, BODY))
                return executed | self.follow(module, *target, chain[1:])
            if inner is None:
                return executed | self.nodes_of(user, module.name, chain[0])
            executed.add((module.name, BODY))
            module, chain = inner, chain[1:]
        if module is None:
            return executed
        return executed | self.nodes_of(user, module.name, chain[0] if chain else ALL)

    def nodes_of(self, user: Module, name: str, definition: str) -> set[Node]:
        """Return the nodes of one definition of a module, with what importing the module runs."""
        module = self.find(user, name)
        if module is None:
            return set()
        nodes = {(module.name, BODY)}
        if definition == ALL:
            return nodes | {(module.name, each) for each in module.definitions}
        if definition in module.definitions:
            nodes.add((module.name, definition))
            if not (user is module or user.of_package) and self._is_table(module, definition):
                nodes.add((module.name, ALL))
        elif module.lazy and definition in module.late:
            nodes.add((module.name, "__getattr__"))
            nodes |= self.follow(module, *module.late[definition], [])
        return nodes

    def _is_table(self, module: Module, name: str) -> bool:
        """Return whether a test that uses a table of lazily loaded names uses all of them."""
        loads = module.lazy or "import_module" in module.text
        return loads and any(
            isinstance(getattr(statement, "value", None), CONTAINERS)
            for statement in module.definitions[name]
        )

    def uses(self, node: Node) -> Uses:
        """Return what a definition uses; of all of a module's names, what they stand for."""
        if node not in self._uses:
            module = self.modules[node[0]]
            uses = self._uses[node] = Uses(self, module, node[1])
            if node[1] == ALL:
                for name in module.late if module.lazy else ():
                    uses.nodes |= self.follow(module, *module.late[name], [])
                for name in module.definitions:
                    inner = self.uses((module.name, name))
                    for nodes in (*inner.verbs.values(), *inner.keyed.values()):
                        uses.nodes |= nodes
            for parent in parents(module.name):  # importing a module runs its packages
                if parent in self.modules:
                    uses.nodes.add((parent, BODY))
        return self._uses[node]

    def reached(self, test: Module) -> tuple[set[Node], set[str], set[str]]:
        """Return the definitions that a test file reaches, the strings in them, and patterns."""
        todo = [(test.name, name) for name in test.definitions]
        for parent in parents(test.name):
            if conftest := self.modules.get(f"{parent}.conftest"):
                todo += [(conftest.name, name) for name in fixtures(conftest)]
        nodes, strings, patterns = set(todo), set(), set()
        words: set[str] = set()
        verbs: dict[str, set[Node]] = {}
        keyed: dict[str, set[Node]] = {}
        while todo:
            node = todo.pop()
            uses = self.uses(node)
            new = set(uses.nodes)
            strings |= uses.strings
            if not self.modules[node[0]].of_package:
                patterns |= uses.patterns
                words |= uses.words
            for word, targets in uses.verbs.items():
                verbs.setdefault(word, set()).update(targets)
            for key, targets in uses.keyed.items():
                keyed.setdefault(key, set()).update(targets)
            for word in verbs.keys() & words:
                new |= verbs[word]
            for key in keyed.keys() & strings:
                new |= keyed[key]
            new -= nodes
            nodes |= new
            todo += new
        return nodes, strings, patterns

    def selected(self) -> list[str]:
        """Return the test files that reach a changed file."""
        return [test.file for test in self.tests if self._is_reached(test)]

    def _is_reached(self, test: Module) -> bool:
        nodes, strings, patterns = self.reached(test)
        files = {self.modules[module].file for module, _ in nodes}
        if files & self.changed:
            return True
        own = {text for name in test.definitions for text in self.uses((test.name, name)).strings}
        for file in map(Path, self.changed):
            named = {file.name, file.stem} if file.parts[0] == PACKAGE else {file.name}
            if file.suffix != ".py" and named & strings:
                return True
            listed = any(fnmatch(file.name, pattern) for pattern in patterns - {"*", "*.*"})
            if listed and own & set(file.parts[:-1]):
                return True
        return False


def fixtures(conftest: Module) -> list[str]:
    """Return the fixtures of a conftest, and its body; hooks of pytest use nothing of ours."""
    return [BODY] + [
        name
        for name, statements in conftest.definitions.items()
        if any(
            "fixture" in ast.unparse(decorator)
            for statement in statements
            for decorator in getattr(statement, "decorator_list", ())
        )
    ]


def parents(name: str) -> list[str]:
    """Return the packages that a dotted name lies in."""
    parts = name.split(".")
    return [".".join(parts[:k]) for k in range(1, len(parts))]


def changed_files(root: Path, revision: str) -> list[str]:
    """Return the files that differ between a revision and the working tree, and untracked ones."""
    git = ["git", "-C", str(root)]
    commands = (
        [*git, "diff", "--name-only", "--no-renames", "-z", revision, "--"],
        [*git, "ls-files", "--others", "--exclude-standard", "-z"],
    )
    texts = [subprocess.run(c, capture_output=True, text=True, check=False) for c in commands]
    for done in texts:
        if done.returncode:
            sys.exit(f"tests_of.py: git: {done.stderr.strip()}")
    return sorted({name for done in texts for name in done.stdout.split("\0") if name})


def main() -> int:
    """Print the test files, or run them."""
    gc.disable()  # syntax trees have no cycles, and looking for them takes a third of the time
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("revision", nargs="?", default="HEAD", help="default: the last commit")
    parser.add_argument("--changed", nargs="+", metavar="FILE", help="in place of a difference")
    parser.add_argument("--run", nargs=argparse.REMAINDER, help="run pytest with these options")
    options = parser.parse_args()
    changed = options.changed or changed_files(ROOT, options.revision)
    tree = Tree(ROOT, changed)
    files = tree.selected()
    share = len(files) / max(1, len(tree.tests))
    print(f"{len(files)} of {len(tree.tests)} test files ({share:.0%})", file=sys.stderr)
    if options.run is None or not files:
        print(*files, sep="\n", end="\n" if files else "")
        return 0
    return subprocess.run([sys.executable, "-m", "pytest", *options.run, *files]).returncode


if __name__ == "__main__":
    sys.exit(main())
