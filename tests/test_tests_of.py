"""The script that names the tests that a change can reach, and the one that counts lines."""

import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[1]
sys.path.append(str(ROOT / "scripts"))
from lines_of_code import by_wing, lines_of_code  # noqa: E402
from tests_of import Tree, changed_files  # noqa: E402

FILES = {
    "insgnss/__init__.py": (
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from .api import make, weigh\n"
        "HOME = {'make': 'api', 'weigh': 'api'}\ndef __getattr__(name): ...\n"
    ),
    "insgnss/__main__.py": "from .cli.main import main\nmain()\n",
    "insgnss/api.py": (
        "def make():\n    from .core.kernel import step\n    return step()\n"
        "def weigh():\n    from .scale import weight\n    return weight()\n"
    ),
    "insgnss/core/__init__.py": "",
    "insgnss/core/kernel.py": (
        "from ..scale import UNIT\nfrom typing import TYPE_CHECKING\n"
        "if TYPE_CHECKING:\n    from ..words import Word\n"
        "def step(of: 'Word' = None): return UNIT\n"
    ),
    "insgnss/scale.py": "UNIT = 1\ndef weight(): return open('weights.toml')\n",
    "insgnss/weights.toml": "",
    "insgnss/words.py": "class Word: ...\ndef text(): ...\ndef data(): ...\n",
    "insgnss/table.py": (
        "from importlib import import_module\n"
        "FORMS = {'text': 'words:text', 'step': 'core.kernel:step'}\n"
        "def read(form): return import_module(FORMS[form])\n"
    ),
    "insgnss/cli/__init__.py": "from .main import main\n",
    "insgnss/cli/main.py": (
        "from importlib import import_module\nVERBS = ('fly', 'lift')\n"
        "def main(argv=()): return import_module(f'.{argv[0]}', __package__)\n"
    ),
    "insgnss/cli/fly.py": "def run():\n    from ..core.kernel import step\n    step()\n",
    "insgnss/cli/lift.py": "def run():\n    from .. import scale\n    scale.weight()\n",
    "scripts/draw.py": "import insgnss\ninsgnss.weigh()\n",
    "data_specs/words.md": "",
    "tests/helper.py": "from insgnss.core.kernel import step\ndef stepped(): return step()\n",
    "tests/test_lazy_name.py": "import insgnss\ndef test(): insgnss.make()\n",
    "tests/test_other_name.py": "from insgnss import weigh\ndef test(): weigh()\n",
    "tests/test_helper.py": "from helper import stepped\ndef test(): stepped()\n",
    "tests/test_verb.py": "from insgnss.cli import main\ndef test(): main(['fly'])\n",
    "tests/test_program.py": "def test(): run('-m', 'insgnss', 'lift')\n",
    "tests/test_patched.py": "def test(patch): patch.setattr('insgnss.words.data', 1)\n",
    "tests/test_table.py": "from insgnss.table import read\ndef test(): read('text')\n",
    "tests/test_all_forms.py": "from insgnss.table import FORMS\ndef test(): list(FORMS)\n",
    "tests/test_script.py": "def test(): run('scripts/draw.py')\n",
    "tests/test_house.py": "def test(): (ROOT / 'insgnss').rglob('*.py')\n",
    "tests/test_pages.py": "def test(): (ROOT / 'data_specs').glob('*.md')\n",
    "tests/room/conftest.py": (
        "@fixture\ndef stepped():\n    import insgnss.core.kernel as k\n    k.step()\n"
    ),
    "tests/room/test_fixture.py": "def test(stepped): ...\n",
}
USERS_OF_THE_KERNEL = "all_forms fixture helper house lazy_name verb"
REACHING = {  # by hand, from the sources above
    "insgnss/core/kernel.py": USERS_OF_THE_KERNEL,
    "insgnss/scale.py": f"{USERS_OF_THE_KERNEL} other_name program script",
    "insgnss/weights.toml": "other_name program script",
    "insgnss/words.py": "all_forms house patched table",
    "insgnss/cli/fly.py": "house verb",
    "insgnss/cli/lift.py": "house program",
    "insgnss/deleted.py": "house",
    "scripts/draw.py": "script",
    "data_specs/words.md": "pages",
    "tests/room/conftest.py": "fixture",
    "tests/test_patched.py": "patched",
    "README.md": "",
}


@pytest.fixture(scope="module")
def made_up(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("tree")
    for name, text in FILES.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    return root


@pytest.mark.parametrize("changed", REACHING)
def test_a_change_selects_the_tests_that_use_it(made_up: Path, changed: str) -> None:
    """Oracle: by hand, the tests of a small tree that use a name of the changed file."""
    names = {Path(file).stem.removeprefix("test_") for file in Tree(made_up, [changed]).selected()}
    assert names == set(REACHING[changed].split())


@pytest.mark.slow
def test_planted_defects_select_the_tests_that_notice_them() -> None:
    """Oracle: the table of planted defects, which names tests that fail once a file is changed.

    On average a third of the test files at most: without that, naming all of them would pass.
    """
    table = tomllib.loads((ROOT / "scripts" / "planted_defects.toml").read_text(encoding="utf-8"))
    tree = Tree(ROOT, [])
    reached = {
        test.file: {tree.modules[module].file for module, _ in tree.reached(test)[0]}
        for test in tree.tests
    }
    missed, shares = [], []
    everywhere = ["tests/test_architecture.py"]  # lists the files of the package, uses none
    for entry in table["defect"]:
        changed = entry["module"]  # a file, or the folder that it lies in
        if not changed.startswith("insgnss/") or entry["tests"] == everywhere:
            continue  # of a package that is plugged in by its name
        there = {test for test in reached if any(changed in file for file in reached[test])}
        shares.append(len(there) / len(reached))
        for name in entry["tests"]:
            tests = [test for test in reached if test.startswith(name.partition("::")[0])]
            missed += [(changed, name)] * there.isdisjoint(tests)
    assert missed == []
    assert np.mean(shares) < 1 / 3, np.mean(shares)


def test_changed_files_are_those_of_git(made_up: Path) -> None:
    """Oracle: a file changed, one deleted, one new, one whose name git would quote."""
    git = ["git", "-c", "user.name=x", "-c", "user.email=x@x", "-C", str(made_up)]
    for words in (["init", "-q"], ["add", "."], ["commit", "-qm", "x"]):
        subprocess.run([*git, *words], check=True)
    (made_up / "insgnss/scale.py").write_text("UNIT = 2\n")
    (made_up / "tests/test_table.py").unlink()
    (made_up / "tests/test_höhe.py").write_text("")
    assert changed_files(made_up, "HEAD") == [
        "insgnss/scale.py",
        "tests/test_höhe.py",
        "tests/test_table.py",
    ]


def test_lines_of_code(tmp_path: Path) -> None:
    """Oracle: counted by hand; the string in the brackets takes three lines."""
    text = '"""Doc\nstring."""\n\n# comment\nx = (  # why\n    """a\n\n"""\n)\n\n\n'
    text += 'def f():\n    """One."""\n\n    return x\n'
    assert lines_of_code(text) == 7
    (tmp_path / "wing").mkdir()
    (tmp_path / "wing" / "one.py").write_text(text)
    (tmp_path / "two.py").write_text("x = 1\n")
    assert by_wing(tmp_path) == {"wing": 7, tmp_path.name: 1}
