"""The kernels that `insgnss doctor --compile` compiles, and the list of them."""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

from insgnss.base import ahead
from insgnss.batch.installation import compiling

SCRIPT = Path(__file__).parents[3] / "scripts" / "list_kernels.py"
LISTED = ahead.listed_kernels()


@pytest.fixture(scope="module")
def script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("list_kernels", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
def test_examples_have_the_types_that_are_listed(script: ModuleType) -> None:
    """Oracle: numba's own types of the examples, described anew; parameters of the functions."""
    from numba import typeof

    for name, arguments in LISTED.items():
        kernel = ahead._attribute(name)
        assert getattr(kernel, "py_func", kernel).__code__.co_argcount == len(arguments)
        types = [typeof(ahead.example(each)) for each in arguments]
        assert [script.described(kind) for kind in types] == arguments


@pytest.mark.slow
def test_the_list_holds_what_a_run_calls(tmp_path: Path) -> None:
    """Oracle: the functions that the demonstration and the self-test take from the disk, with their
    types; a first run may have to compile them.
    """
    command = [sys.executable, str(SCRIPT), "--out", str(tmp_path / "kernels.json")]
    for _ in range(2):
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if not done.returncode:
            break
    assert done.returncode == 0, done.stderr
    assert json.loads((tmp_path / "kernels.json").read_text("utf-8")) == LISTED


@pytest.mark.slow
def test_compiling_ahead_fills_the_cache_and_names_what_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: the files; a kernel by hand that does not exist."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "0")
    listed = {"io.formats.text._kernels.count_newlines": ["u1 1 C"]}
    steps: list[str] = []
    finding = compiling.compile_all(steps.append, listed)
    assert (finding.verdict, finding.found[:4]) == ("ok", "1 in")
    assert steps[-1] == "compiled 1 of 1 kernels"
    assert len(list((tmp_path / "cache").rglob("*count_newlines*.nbc"))) == 1
    finding = compiling.compile_all(steps.append, listed | {"io.formats.text._kernels.none": []})
    assert finding.verdict == "contradiction"
    assert "io.formats.text._kernels.none" in finding.found
