"""Kernels compiled by helpers beside the main line of a first run."""

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

import insgnss

BASE = Path(insgnss.__file__).parent / "base"
OUTER = """
from ...base.compilation import njit
from ...calibrate.inner import inner
@njit(cache=True)
def outer(x):
    return 10.0 * inner(x)
"""
INNER = """
from ..base.compilation import njit
@njit(cache=True)
def inner(x):
    return x + 1.0
"""
START = """
from house.base import ahead
from house.navigation.filter.outer import outer
ahead.processors = lambda: 2
ahead.compile_ahead()
ahead.compile_ahead()
print(*(helper.pid for helper in ahead._started), flush=True)
"""
END = """
for helper in ahead._started:
    helper.wait()
print(outer(1.0), sum(outer.stats.cache_hits.values()))
"""
HOLDER = """
import fcntl, os, sys
fcntl.lockf(os.open(sys.argv[1], os.O_RDWR | os.O_CREAT), fcntl.LOCK_EX)
print(flush=True)
sys.stdin.read()
"""
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(os.name == "nt", reason="no locks, and therefore no helpers"),
]


@pytest.fixture
def start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Callable[..., "subprocess.Popen[str]"]:
    """A process that has a kernel compiled ahead, whose callee is in another directory."""
    house = tmp_path / "house"
    for name in ("", "base", "navigation", "navigation/filter", "calibrate"):
        (house / name).mkdir()
        (house / name / "__init__.py").write_text("")
    for name in ("advance", "ahead", "beside", "shipped"):
        (house / "base" / f"{name}.py").write_bytes((BASE / f"{name}.py").read_bytes())
    sources = shutil.ignore_patterns("__pycache__")
    shutil.copytree(BASE / "compilation", house / "base" / "compilation", ignore=sources)
    (house / "base" / "kernels.json").write_text('{"navigation.filter.outer.outer": ["f8"]}')
    (house / "navigation" / "filter" / "outer.py").write_text(OUTER)
    (house / "calibrate" / "inner.py").write_text(INNER)
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "0")

    def process(code: str) -> "subprocess.Popen[str]":
        code = f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n{code}"
        command = [sys.executable, "-c", code]
        return subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=house.parent)

    return process


def test_the_main_line_takes_what_helpers_compiled(start, tmp_path):
    """Oracle: 10 (1 + 1), by hand; numba's count of what came from the disk; no helper where
    nothing is to be compiled.
    """
    for helpers in (2, 0):
        printed, _ = start(START + END).communicate(timeout=120)
        pids, result = printed.splitlines()
        assert len(pids.split()) == helpers
        assert result == "20.0 1"
    assert len(list(tmp_path.rglob("*.nbc"))) == 2


def test_a_helper_that_fails_costs_nothing(start, tmp_path):
    """Oracle: 10 (1 + 1), by hand, compiled by the main line."""
    (tmp_path / "house" / "base" / "kernels.json").write_text(
        '{"navigation.filter.outer.outer": ["f8"], "navigation.filter.none": []}'.replace(
            '"f8"', '"i8", "i8"'
        )
    )
    printed, _ = start(START + END).communicate(timeout=120)
    assert printed.splitlines()[1] == "20.0 0"


def test_no_helper_outlives_a_killed_process(start, tmp_path):
    """Oracle: the processes of the system, while a callee is kept from being compiled, for which
    the helper waits.
    """
    place = tmp_path / "house" / "calibrate" / "__pycache__"
    place.mkdir()
    command = [sys.executable, "-c", HOLDER, str(place / "compiling.lock")]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as holder:
        assert holder.stdout.readline() == b"\n"
        with start(START + "sys.stdin.read(); import time; time.sleep(60)") as main:
            pids = main.stdout.readline().split()
            time.sleep(2.0)  # until they wait
            assert any(_runs(pid) for pid in pids)
            main.kill()
            for _ in range(100):
                if not any(map(_runs, pids)):
                    break
                time.sleep(0.1)
            assert not any(map(_runs, pids))
        holder.kill()


def _runs(pid: str) -> bool:
    """Whether a process runs; one that ended and that nobody asked about does not."""
    done = subprocess.run(
        ["ps", "-o", "stat=", "-p", pid], capture_output=True, text=True, check=False
    )
    return bool(done.stdout.strip()) and not done.stdout.startswith("Z")
