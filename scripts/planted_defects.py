"""Plant one defect per equation of the chain read -> product, and see whether the tests notice.

    python scripts/planted_defects.py                  all of them, half an hour of one core
    python scripts/planted_defects.py --sample 6       six drawn at random (CI), half a minute
    python scripts/planted_defects.py --only orient    those whose module or promise has the word
    python scripts/planted_defects.py --check          only whether every snippet still occurs once

A test that passes says little unless it fails when the thing is wrong. `planted_defects.toml`
beside this script lists defects: a module, a short piece of its text, what takes its place, the
equation or promise that breaks, and the tests that are named for it. Each is planted in a copy of
the tree, never in the checkout, and its tests are run there, the quick ones first and, where none
of them notices, the slow ones. It is caught where a test fails; the quick
tests are run without any defect first, since one that fails by itself catches nothing.

Text is compared without any white space, so that re-wrapped lines do no harm. A module may be a
file or a folder; the piece has to occur exactly once in it. Tests run with kernels interpreted
(NUMBA_DISABLE_JIT), which is faster than compiling one anew for each defect and leaves no stale
kernels behind; `compiled = true` asks for compiled ones, from a cache of their own for each defect.

It ends in a table and exit code 1 where fewer than 95 % are caught, a piece of text does not occur
exactly once, or a test fails without a defect.
"""

import argparse
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import Queue

ROOT = Path(__file__).resolve().parents[1]
TABLE = Path(__file__).with_suffix(".toml")
COPIED = (
    "insgnss",
    "tests",
    "data_specs",
    "docs",
    "scripts",
    "benchmarks",
    "pyproject.toml",
    "README.md",
    "CHANGELOG.md",
)
LEAST_SHARE = 0.95
TIMEOUT_S = 300.0
PASSED, FAILED, NONE = 0, 1, 5  # exit codes of pytest, the last where no test was chosen
KEYS = {"module", "old", "new", "breaks", "tests", "compiled"}


class EntryError(Exception):
    """An entry of the table that cannot be planted, or tests that fail without it."""


@dataclass(frozen=True)
class Defect:
    """One entry of the table.

    Attributes
    ----------
    module : file or folder, relative to the root, that holds the text.
    old, new : the text, unique in the module but for white space, and what takes its place.
    breaks : the equation or promise.
    tests : paths or node ids for pytest.
    compiled : whether the tests need compiled kernels.
    """

    module: str
    old: str
    new: str
    breaks: str
    tests: tuple[str, ...]
    compiled: bool = False

    @property
    def room(self) -> str:
        """First folder of the module, or the module itself."""
        parts = Path(self.module).parts
        return parts[1] if len(parts) > 1 else parts[0]


@dataclass(frozen=True)
class Outcome:
    """What became of one defect: "caught", "survived", or why there is no verdict; seconds."""

    defect: Defect
    verdict: str
    seconds: float


def load(path: Path = TABLE) -> list[Defect]:
    """The defects of the table. Raises EntryError for a key that is missing or unknown."""
    out = []
    for k, entry in enumerate(tomllib.loads(path.read_text(encoding="utf-8"))["defect"], start=1):
        if odd := (set(entry) ^ KEYS) - {"compiled"}:
            raise EntryError(f"{path.name}: defect {k}: {sorted(odd)[0]!r} is missing or unknown")
        out.append(Defect(**{**entry, "tests": tuple(entry["tests"])}))
    return out


def bare(text: str) -> tuple[str, list[int]]:
    """The text without white space, and the place in `text` of each of its characters."""
    places = [k for k, c in enumerate(text) if not c.isspace()]
    return "".join(text[k] for k in places), places


def planted(text: str, old: str, new: str) -> str | None:
    """`text` with its one occurrence of `old`, white space aside, as `new`; None without one.

    Raises EntryError where there are several.
    """
    stripped, places = bare(text)
    wanted, _ = bare(old)
    first = stripped.find(wanted)
    if first < 0:
        return None
    if stripped.find(wanted, first + 1) >= 0:
        raise EntryError(f"{old!r} occurs more than once")
    return text[: places[first]] + new + text[places[first + len(wanted) - 1] + 1 :]


def place_of(defect: Defect, root: Path) -> tuple[Path, str]:
    """The file that holds the defect's text, and its content with the defect.

    Raises EntryError where the text does not occur exactly once in the module.
    """
    module = root / defect.module
    files = sorted(module.rglob("*.py")) if module.is_dir() else [module]
    if not all(file.is_file() for file in files):
        raise EntryError(f"{defect.module} does not exist")
    found = []
    for file in files:
        changed = planted(file.read_text(encoding="utf-8"), defect.old, defect.new)
        if changed is not None:
            found.append((file, changed))
    if len(found) != 1:
        raise EntryError(f"{defect.old!r} occurs {len(found)} times, not once")
    file, changed = found[0]
    try:
        compile(changed, str(file), "exec")
    except SyntaxError as error:
        raise EntryError(f"{defect.new!r} makes no Python: {error}") from None
    return file, changed


def copy_tree(target: Path) -> Path:
    """A copy of the tree in the directory `target`, which is made; compiled files stay behind."""
    skip = shutil.ignore_patterns("__pycache__", "*.nbi", "*.nbc", ".*")
    target.mkdir(parents=True)
    for name in COPIED:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, target / name, ignore=skip)
        elif source.is_file():
            shutil.copy2(source, target / name)
    return target


def run_tests(tree: Path, tests: Iterable[str], compiled: bool, cache: Path, *more: str) -> int:
    """Exit code of pytest on tests within a copy of the tree; -1 where it takes too long."""
    environment = dict(os.environ)
    environment |= {
        "PYTHONPATH": str(tree),
        "PYTHONDONTWRITEBYTECODE": "1",
        "NUMBA_DISABLE_JIT": "0" if compiled else "1",
        "NUMBA_CACHE_DIR": str(cache),
        "OPENBLAS_NUM_THREADS": "1",
        "HYPOTHESIS_STORAGE_DIRECTORY": str(cache / "hypothesis"),
    }
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--tb=line", *more]
    try:
        done = subprocess.run(
            [*command, *tests],
            cwd=tree,
            env=environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=TIMEOUT_S if more else None,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return -1
    if not more and done.returncode != PASSED:
        print(done.stdout[-3000:], done.stderr[-1000:], sep="\n")
    return done.returncode


def check_baseline(defects: list[Defect], tree: Path, cache: Path) -> None:
    """Run the tests of all defects without any. Raises EntryError where they do not pass."""
    for compiled in (False, True):
        tests = dict.fromkeys(t for d in defects if d.compiled is compiled for t in d.tests)
        if tests and run_tests(tree, whole(tests), compiled, cache / f"baseline-{compiled}"):
            raise EntryError("tests fail without any defect, so that they would catch nothing")


def whole(tests: Iterable[str]) -> list[str]:
    """The tests without those that another entry has with its whole file."""
    given = list(tests)
    return [test for test in given if "::" not in test or test.split("::")[0] not in given]


def try_defect(defect: Defect, tree: Path, cache: Path) -> Outcome:
    """Plant one defect in a copy of the tree, run its tests, and take it out again."""
    begin = time.monotonic()
    file, changed = place_of(defect, tree)
    before = file.read_text(encoding="utf-8")
    file.write_text(changed, encoding="utf-8")
    try:
        # in one process: where workers stop at the first failure, pytest ends as if interrupted
        code = run_tests(tree, defect.tests, defect.compiled, cache, "-x", "-n0")
        if code in (PASSED, NONE):  # what no quick test guards
            code = run_tests(tree, defect.tests, defect.compiled, cache, "-x", "-n0", "-m", "slow")
            code = PASSED if code == NONE else code
    finally:
        file.write_text(before, encoding="utf-8")
    verdicts = {PASSED: "survived", FAILED: "caught", -1: f"over {TIMEOUT_S:.0f} s"}
    return Outcome(
        defect, verdicts.get(code, f"pytest ended with {code}"), time.monotonic() - begin
    )


def try_all(defects: list[Defect], jobs: int, baseline: bool) -> Iterator[Outcome]:
    """The outcome of every defect, in their order, from `jobs` copies of the tree at a time."""
    with tempfile.TemporaryDirectory(prefix="planted-") as name:
        room = Path(name)
        trees: Queue[Path] = Queue()
        for k in range(jobs):
            trees.put(copy_tree(room / f"tree-{k}"))
        if baseline:
            tree = trees.get()
            check_baseline(defects, tree, room)
            trees.put(tree)

        def work(numbered: tuple[int, Defect]) -> Outcome:
            tree = trees.get()
            cache = room / f"cache-{numbered[0]}"
            try:
                return try_defect(numbered[1], tree, cache)
            finally:
                shutil.rmtree(cache, ignore_errors=True)
                trees.put(tree)

        with ThreadPoolExecutor(jobs) as pool:
            yield from pool.map(work, enumerate(defects))


def report(outcomes: list[Outcome]) -> float:
    """Print what was caught, room by room, and what was not; the share caught."""
    print(f"\n{'room':<16}{'planted':>8}{'caught':>8}")
    for room in sorted({o.defect.room for o in outcomes}):
        of_room = [o for o in outcomes if o.defect.room == room]
        caught = sum(o.verdict == "caught" for o in of_room)
        print(f"{room:<16}{len(of_room):>8}{caught:>8}")
    caught = sum(o.verdict == "caught" for o in outcomes)
    share = caught / len(outcomes)
    seconds = sum(o.seconds for o in outcomes)
    print(f"{'all':<16}{len(outcomes):>8}{caught:>8}   {share:.1%}, {seconds:.0f} s of tests")
    for o in outcomes:
        if o.verdict != "caught":
            print(f"{o.verdict}: {o.defect.module}: {o.defect.old}  ->  {o.defect.new}")
            print(f"    {o.defect.breaks}; {' '.join(o.defect.tests)}")
    return share


def main() -> int:
    """Read the options, try the defects, and report."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sample", type=int, help="try so many of them, drawn at random")
    parser.add_argument("--seed", type=int, default=0, help="of the draw")
    parser.add_argument("--only", default="", help="those whose module or promise has this text")
    parser.add_argument("--jobs", type=int, default=1, help="copies of the tree tried at a time")
    parser.add_argument("--check", action="store_true", help="only look for the pieces of text")
    parser.add_argument("--no-baseline", action="store_true", help="leave out the run without any")
    options = parser.parse_args()
    try:
        every = load()
        wrong = [message for d in every if (message := problem(d))]
        if wrong:
            raise EntryError("\n".join(wrong))
        print(f"{len(every)} defects in {TABLE.name}, each at its place")
        if options.check:
            return 0
        chosen = [d for d in every if options.only in f"{d.module} {d.breaks}"]
        if options.sample is not None:
            chosen = random.Random(options.seed).sample(chosen, min(options.sample, len(chosen)))
        outcomes = []
        for outcome in try_all(chosen, max(1, options.jobs), not options.no_baseline):
            outcomes.append(outcome)
            d = outcome.defect
            print(
                f"{outcome.verdict:<10}{outcome.seconds:6.1f} s  {d.module}: {d.breaks}", flush=True
            )
    except EntryError as error:
        print(error, file=sys.stderr)
        return 1
    if not outcomes:
        print("no defect has that text", file=sys.stderr)
        return 1
    return 0 if report(outcomes) >= LEAST_SHARE else 1


def problem(defect: Defect) -> str:
    """Why a defect cannot be planted in the checkout, in one line; empty where it can."""
    try:
        place_of(defect, ROOT)
    except EntryError as error:
        return f"{TABLE.name}: {defect.module}: {error}"
    missing = [t for t in defect.tests if not (ROOT / t.split("::")[0]).exists()]
    return f"{TABLE.name}: {defect.module}: no test {missing[0]}" if missing else ""


if __name__ == "__main__":
    sys.exit(main())
