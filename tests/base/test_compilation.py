"""Compiled code on disk: taken again while nothing that it was made of changed."""

import errno
import importlib
import json
import os
import pickle
import shutil
import signal
import stat
import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import llvmlite
import numpy as np
import pytest

import insgnss
from insgnss.base import compilation
from insgnss.base.advance import listening
from insgnss.base.compilation import kept

BASE = Path(insgnss.__file__).parent / "base"
SOURCES = {
    "__init__.py": "",
    "constants.py": "STEP = 1.0\n",
    "inner.py": (
        """
        from .compilation import njit
        from .constants import STEP
        @njit(cache=True)
        def inner(x):
            return x + STEP
        """
    ),
    "outer.py": (
        """
        from .compilation import njit
        from .inner import (  # the callee stands in (another) file
            inner,
        )
        @njit(cache=True)
        def outer(x):
            return 10.0 * inner(x)
        """
    ),
}
RUN = "from house.outer import outer; print(outer(1.0), sum(outer.stats.cache_hits.values()))"


@pytest.fixture
def house(tmp_path):
    """A kernel, its callee and the callee's constant, and what compiles them."""
    folder = tmp_path / "house"
    folder.mkdir()
    for name, text in SOURCES.items():
        (folder / name).write_text(text.replace("\n        ", "\n"))
    for name in ("advance.py", "shipped.py"):
        (folder / name).write_bytes((BASE / name).read_bytes())
    sources = shutil.ignore_patterns("__pycache__")
    shutil.copytree(BASE / "compilation", folder / "compilation", ignore=sources)
    return folder


def _run(house: Path, **variables: str) -> tuple[float, int]:
    """What the kernel returns for 1, and how often its code came from disk."""
    value, hits = _printed(house, RUN, **variables).split()
    return float(value), int(hits)


def _printed(house: Path, code: str, **variables: str) -> str:
    """What code prints in a process of its own."""
    environment = (
        os.environ | {"PYTHONPATH": str(house.parent), "PYTHONDONTWRITEBYTECODE": "1"} | variables
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        env=environment,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.mark.slow
def test_code_is_made_anew_when_a_callee_or_a_constant_in_another_file_changes(house, monkeypatch):
    """Oracle: the sums, by hand; numba alone goes on returning the first one."""
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    assert _run(house) == (20.0, 0)
    assert _run(house) == (20.0, 1)
    (house / "inner.py").write_text(
        (house / "inner.py").read_text().replace("x + STEP", "x - STEP")
    )
    assert _run(house) == (0.0, 0)
    (house / "constants.py").write_text("STEP = 3.0\n")
    assert _run(house) == (-20.0, 0)
    assert _run(house) == (-20.0, 1)
    assert (
        len(list((house / "__pycache__").glob("outer.outer*.nbc"))) == 1
    )  # outdated code is overwritten


@pytest.mark.slow
def test_code_from_disk_is_run_without_what_numba_compiles_with(house, monkeypatch):
    """Oracle: the modules in which numba keeps its versions of numpy's functions; sums by hand."""
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    loaded = RUN.replace("; print(outer(1.0),", "; y = outer(1.0); print(LEARNED, y,")
    loaded = loaded.replace("LEARNED", "'numba.np.npyimpl' in __import__('sys').modules")
    both = loaded.replace("; y =", "; from house.inner import inner; inner(1.0); y =")
    assert _printed(house, loaded) == "True 20.0 0"
    assert _printed(house, loaded) == "False 20.0 1"
    # a caller that is compiled beside a callee from disk
    (house / "outer.py").write_text((house / "outer.py").read_text().replace("10.0 *", "5.0 *"))
    assert _printed(house, both) == "True 10.0 0"
    assert _printed(house, loaded) == "False 10.0 1"


@pytest.mark.slow
def test_what_only_callers_need_is_read_when_one_is_compiled(house, monkeypatch):
    """Oracle: the bytes that are left unread; sums by hand. With a numba of other inner names they
    are read at once, and nothing else changes.
    """
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    unread = "from house.inner import inner; x = inner(1.0); (one,) = inner.overloads.values(); "
    unread += "before = getattr(one.library, '_intermediate', None) is not None; "
    unread += "from house.outer import outer; y = outer(1.0); "
    unread += "print(x, y, before, getattr(one.library, '_intermediate', None) is not None)"
    assert _printed(house, unread) == "2.0 20.0 False False"
    assert _printed(house, unread) == "2.0 20.0 True True"
    (house / "outer.py").write_text((house / "outer.py").read_text().replace("10.0 *", "5.0 *"))
    assert _printed(house, unread) == "2.0 10.0 True False"
    linking = house / "compilation" / "linking.py"
    linking.write_text(linking.read_text().replace('"_unserialize"', '"_renamed"'))
    for _ in range(2):
        assert _printed(house, unread) == "2.0 10.0 False False"
    assert _run(house) == (10.0, 1)


@pytest.mark.slow
def test_a_kernel_compiled_for_others_is_compiled_whole_where_python_calls_it(house, monkeypatch):
    """Oracle: 1 + 1 and 10 (1 + 1), by hand; numba's count of what came from the disk; the symbol
    of numba's function that takes Python's arguments.
    """
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    both = RUN.replace("print(", "from house.inner import inner; print(")
    both = both.replace(
        "outer(1.0),", "outer(1.0), inner(1.0), sum(inner.stats.cache_hits.values()),"
    )
    assert _run(house) == (20.0, 0)
    (code,) = (house / "__pycache__").glob("inner.inner*.nbc")
    assert b"cpython5house5inner" not in code.read_bytes()
    assert _printed(house, both) == "20.0 2.0 0 1"
    assert b"cpython5house5inner" in code.read_bytes()
    assert _printed(house, both) == "20.0 2.0 1 1"
    (house / "outer.py").write_text((house / "outer.py").read_text().replace("10.0 *", "5.0 *"))
    assert _printed(house, both) == "10.0 2.0 1 0"


PRODUCT = """
import numpy as np
from .compilation import njit
@njit(cache=True)
def product(A):
    out, image = np.zeros(A.shape), np.zeros(len(A))
    np.dot(A, A, out)
    np.dot(A, A[0], image)
    return out.sum() + image.sum() + np.dot(A[0], A[1])
"""


@pytest.mark.slow
def test_products_take_blas_without_the_package_around_it(house, monkeypatch):
    """Oracle: numpy's product; the modules that are there afterwards; scipy itself, which is whole
    for whoever asks for it. With scipy's module elsewhere numba imports the package, as ever.
    """
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    (house / "product.py").write_text(PRODUCT)
    text = (BASE.parent / "navigation" / "filter" / "kernels" / "blas.py").read_text()
    (house / "blas.py").write_text(text.replace("....base.compilation", ".compilation"))
    run = "import sys, numpy as np; from house.blas import link_blas; link_blas(); "
    run += "from house.product import product; A = np.arange(4.0).reshape(2, 2); y = product(A); "
    there = "print(y, *(name in sys.modules for name in ('scipy.linalg', 'numba.np.arrayobj')))"
    whole = "import scipy.linalg; from scipy.linalg import blas; x = blas.dgemm(1.0, A, A); "
    whole += "print(y, bool((x == A @ A).all()), hasattr(scipy.linalg, 'cython_blas'))"
    A = np.arange(4.0).reshape(2, 2)
    expected = (A @ A).sum() + (A @ A[0]).sum() + A[0] @ A[1]
    assert _printed(house, run + there) == f"{expected} False True"  # which compiles
    assert _printed(house, run + there) == f"{expected} False False"
    assert _printed(house, run + whole) == f"{expected} True True"
    assert _printed(house, "import scipy.linalg; " + run + whole) == f"{expected} True True"
    text = (house / "blas.py").read_text()
    assert '/ "linalg"' in text
    (house / "blas.py").write_text(text.replace('/ "linalg"', '/ "elsewhere"'))
    assert _printed(house, run + there) == f"{expected} True False"


@pytest.mark.slow
def test_the_directory_that_the_user_names_is_taken(house, tmp_path):
    """Oracle: numba's variable; the file system."""
    assert _run(house, NUMBA_CACHE_DIR=str(tmp_path / "own")) == (20.0, 0)
    assert _run(house, NUMBA_CACHE_DIR=str(tmp_path / "own")) == (20.0, 1)
    assert list((tmp_path / "own").rglob("outer.outer*.nbc"))
    assert not (house / "__pycache__").exists()


@pytest.mark.slow
def test_what_a_wheel_ships_is_run_where_nothing_else_is_kept(house, tmp_path):
    """Oracle: numba's count of what came from the disk: a copy of sources and code elsewhere, whose
    user keeps code in another directory; without the wheel's mark, or with other sources, nothing
    is taken.
    """
    kept_elsewhere = str(tmp_path / "user")
    assert _run(house, NUMBA_CACHE_DIR="") == (20.0, 0)
    installed = tmp_path / "root" / "house"
    shutil.copytree(house, installed)
    assert _run(installed, NUMBA_CACHE_DIR=kept_elsewhere + "0") == (20.0, 0)
    described = {"name": "", "features": ["none such"], "llvmlite": llvmlite.__version__}
    (installed / "processor.json").write_text(json.dumps(described))
    assert _run(installed, NUMBA_CACHE_DIR=kept_elsewhere) == (20.0, 1)
    assert not list(Path(kept_elsewhere).rglob("*.nb?"))
    (installed / "constants.py").write_text("STEP = 3.0\n")
    assert _run(installed, NUMBA_CACHE_DIR=kept_elsewhere) == (40.0, 0)
    assert _run(installed, NUMBA_CACHE_DIR=kept_elsewhere) == (40.0, 1)
    assert list(Path(kept_elsewhere).rglob("outer.outer*.nbc"))


@pytest.mark.slow
def test_a_numba_of_other_inner_names_keeps_nothing(house, monkeypatch):
    """Oracle: no code on disk, and right results: better slow than outdated."""
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    kept_source = house / "compilation" / "kept.py"
    kept_source.write_text(kept_source.read_text().replace('"_cache_file"', '"_renamed"'))
    for _ in range(2):
        assert _run(house) == (20.0, 0)
    assert not list(house.rglob("*.nbc"))


def test_without_compiling_the_functions_themselves_run(house):
    """Oracle: numba's variable NUMBA_DISABLE_JIT."""
    environment = os.environ | {"PYTHONPATH": str(house.parent), "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(
        [sys.executable, "-c", "from house.outer import outer; print(outer(1.0))"],
        capture_output=True,
        text=True,
        env=environment,
        check=True,
    )
    assert done.stdout == "20.0\n"


@pytest.fixture
def twice(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., tuple[float, int]]:
    """A call of 2 x by a kernel that is defined anew: its value, and how often the disk had it."""
    from numba.core import config

    monkeypatch.setattr(config, "CACHE_DIR", "")
    monkeypatch.setattr(kept, "_warned", [])
    (tmp_path / "twice.py").write_text("def twice(x):\n    return 2 * x\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "twice", raising=False)
    module = importlib.import_module("twice")

    def call(x: float = 1.0) -> tuple[float, int]:
        kernel = compilation.njit(cache=True)(module.twice)
        value = kernel(x)
        return value, sum(kernel.stats.cache_hits.values())

    return call


def _files(directory: Path) -> tuple[Path, Path]:
    """Index and code of the one kernel that is kept there."""
    (index,), (code,) = (list((directory / "__pycache__").glob(f"*.nb{kind}")) for kind in "ic")
    return index, code


class _Ends:
    """Whoever unpickles it ends."""

    def __reduce__(self) -> Any:
        return sys.exit, (1,)


def _changed(whole: bytes, place: int) -> bytes:
    return whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :]


DAMAGES = {
    "empty": lambda whole: b"",
    "truncated": lambda whole: whole[: len(whole) // 2],
    "last byte lost": lambda whole: whole[:-1],
    "a bit of its digest": lambda whole: _changed(whole, len(whole) - 1),
    # of the object file: bytes that the loader does not read, so that a wrong test ends no process
    "a bit of its content": lambda whole: _changed(whole, max(whole.find(b"\x7fELF"), 0) + 12),
    "zeros": lambda whole: bytes(len(whole)),
    "a pickle of somebody": lambda whole: pickle.dumps(_Ends()) + bytes(16),
}


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("which", [0, 1])
def test_a_damaged_file_is_compiled_again_in_silence(twice, tmp_path, damage, which):
    """Oracle: 2 x, by hand; numba's own count of what came from the disk."""
    assert (twice(), twice()) == ((2.0, 0), (2.0, 1))
    file = _files(tmp_path)[which]
    file.write_bytes(DAMAGES[damage](file.read_bytes()))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert (twice(), twice()) == ((2.0, 0), (2.0, 1))
        file.unlink()
        assert (twice(), twice()) == ((2.0, 0), (2.0, 1))


def test_code_of_other_versions_or_another_processor_is_not_run(twice, tmp_path, monkeypatch):
    """Oracle: numba's own count of what came from the disk."""
    import numba
    from numba.core.codegen import CPUCodegen

    assert (twice(), twice()) == ((2.0, 0), (2.0, 1))
    for package in (numba, llvmlite, np):
        with monkeypatch.context() as patch:
            patch.setattr(package, "__version__", "0.1")
            assert (twice(), twice()) == ((2.0, 0), (2.0, 1))
        assert (twice(), twice()) == ((2.0, 0), (2.0, 1))
    with monkeypatch.context() as patch:
        patch.setattr(CPUCodegen, "magic_tuple", lambda self: ("another processor",))
        assert (twice(), twice()) == ((2.0, 0), (2.0, 1))
    assert twice() == (2.0, 1)


def test_two_processes_that_give_one_name_to_two_codes_do_no_harm(twice, tmp_path):
    """Oracle: the index of a call with a float beside the code of one with an integer, as two
    processes leave them that compile at the same time; numba's count.
    """
    assert twice(1.0) == (2.0, 0)
    index, code = _files(tmp_path)
    of_float = index.read_bytes()
    index.unlink()
    assert twice(1) == (2, 0)
    assert _files(tmp_path) == (index, code)
    index.write_bytes(of_float)
    assert (twice(1.0), twice(1.0)) == ((2.0, 0), (2.0, 1))
    assert (twice(1), twice(1), twice(1.0)) == ((2, 0), (2, 1), (2.0, 1))


def test_what_others_may_have_written_is_not_run(twice, tmp_path):
    """Oracle: who may write a file, by its owner and mode; numba's own count of what came from the
    disk.
    """
    if not hasattr(os, "getuid"):
        pytest.skip("there each user has a directory of his own")
    me = os.getuid()
    table = [
        (me, 0o644, 0, 0o644, True),
        (me, 0o664, 0, 0o644, True),  # a group of one user
        (0, 0o644, me, 0o644, True),
        (me + 1, 0o644, me + 1, 0o644, True),  # runs in any case: it is his source
        (me + 1, 0o644, me, 0o644, False),
        (me, 0o666, me, 0o644, False),
        (me, 0o777, me, 0o777, True),  # a file system without modes
    ]
    for file_owner, file_mode, owner, mode, expected in table:
        file = SimpleNamespace(st_uid=file_owner, st_mode=file_mode | stat.S_IFREG)
        source = SimpleNamespace(st_uid=owner, st_mode=mode | stat.S_IFREG)
        assert kept._is_trusted_owner(file, source) is expected
    assert not kept._is_trusted_owner(SimpleNamespace(st_uid=me + 1, st_mode=0o100644), None)
    assert (twice(), twice()) == ((2.0, 0), (2.0, 1))
    _files(tmp_path)[1].chmod(0o666)
    assert (twice(), twice()) == ((2.0, 0), (2.0, 1))


@pytest.mark.parametrize("number", ["ENOSPC", "EDQUOT", "EFBIG", "EROFS"])
def test_a_disk_that_takes_nothing_costs_one_warning(twice, tmp_path, monkeypatch, number):
    """Oracle: 2 x, by hand; the warning; nothing is left behind."""

    def refuse(*_: Any) -> None:
        raise OSError(getattr(errno, number), os.strerror(getattr(errno, number)))

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", refuse)
        with pytest.warns(UserWarning, match="cannot be kept") as caught:
            assert (twice(), twice(), twice(1)) == ((2.0, 0), (2.0, 0), (2, 0))
    (warning,) = caught
    assert str(tmp_path / "__pycache__") in str(warning.message)
    assert os.strerror(getattr(errno, number)) in str(warning.message)
    assert "NUMBA_CACHE_DIR" in str(warning.message)
    assert not list((tmp_path / "__pycache__").glob("*twice*.nb*"))
    assert (twice(), twice()) == ((2.0, 0), (2.0, 1))


def test_without_any_directory_functions_are_compiled_and_one_warning_says_so(twice, monkeypatch):
    """Oracle: numba's own error, which is "no locator available"."""
    from numba.core.caching import _CacheLocator

    def refuse(_: Any) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(_CacheLocator, "ensure_cache_path", refuse)
    with pytest.warns(UserWarning, match=r"cannot be kept \(.*no locator available") as caught:
        assert (twice(), twice()) == ((2.0, 0), (2.0, 0))
    assert len(caught) == 1


HOLDER = """
import fcntl, os, sys
os.makedirs(os.path.dirname(sys.argv[1]), exist_ok=True)
fcntl.lockf(os.open(sys.argv[1], os.O_RDWR | os.O_CREAT), fcntl.LOCK_EX)
print(flush=True)
sys.stdin.read()
"""


@pytest.mark.skipif(os.name == "nt", reason="no locks: every process compiles for itself")
@pytest.mark.parametrize("compiles", [True, False])
def test_a_kernel_that_another_process_compiles_is_waited_for(twice, tmp_path, compiles):
    """Oracle: numba's count of what came from the disk, and what is said of the waiting; the other
    process leaves the code behind, or dies without.
    """
    assert twice() == (2.0, 0)
    code = {file: file.read_bytes() for file in _files(tmp_path)}
    for file in code:
        file.unlink()
    said = []
    command = [sys.executable, "-c", HOLDER, str(tmp_path / "__pycache__" / "compiling.lock")]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        assert other.stdout.readline() == b"\n"

        def end(share: float) -> None:
            said.append(share)
            if compiles:
                for file, content in code.items():
                    file.write_bytes(content)
            other.kill()

        with listening(end):
            assert twice() == (2.0, int(compiles))
    assert np.isnan(said).all()
    assert len(said) == (1 if compiles else 2)  # waiting; compiling in its place


KILLED = """
import os, signal
replace, left = os.replace, [{count}]
def replace_or_die(*names):
    left[0] -= 1
    if not left[0]:
        os.kill(os.getpid(), signal.SIGKILL)
    replace(*names)
os.replace = replace_or_die
"""


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="no signal that nobody can catch")
def test_after_a_kill_at_any_point_of_saving_results_are_those_of_the_new_source(
    house, monkeypatch
):
    """Oracle: the sums, by hand. numba alone runs yesterday's code where the process ended after
    the index of a function and before its code.
    """
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    assert _run(house) == (20.0, 0)
    for step, count in enumerate((1, 2, 3, 4), 3):  # index and code of inner, then of outer
        (house / "constants.py").write_text(f"STEP = {step}.0\n")
        environment = os.environ | {"PYTHONPATH": str(house.parent)}
        done = subprocess.run(
            [sys.executable, "-c", KILLED.format(count=count) + RUN],
            capture_output=True,
            env=environment,
            check=False,
        )
        assert done.returncode == -signal.SIGKILL
        assert _run(house) == (10.0 * (1 + step), 0)
    assert _run(house) == (70.0, 1)


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="no limits")
def test_on_a_full_disk_the_index_may_be_there_and_the_code_is_not(house, monkeypatch):
    """Oracle: the sums, by hand; the limit of the system for the size of a file."""
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    limit = "import resource as r; r.setrlimit(r.RLIMIT_FSIZE, (4096, r.RLIM_INFINITY)); "
    assert _run(house) == (20.0, 0)
    (house / "constants.py").write_text("STEP = 3.0\n")
    for _ in range(2):
        assert _printed(house, limit + RUN) == "40.0 0"
    assert _run(house) == (40.0, 0)
    assert _run(house) == (40.0, 1)


@pytest.mark.slow
def test_processes_that_compile_at_once_each_get_the_right_sum(house, monkeypatch):
    """Oracle: the sums, by hand."""
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    environment = os.environ | {"PYTHONPATH": str(house.parent)}
    assert _run(house) == (20.0, 0)
    (house / "constants.py").write_text("STEP = 2.0\n")
    together = [
        subprocess.Popen(
            [sys.executable, "-c", RUN.replace("1.0", x)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env=environment,
            text=True,
        )
        for x in ("1.0", "1", "1.0")
    ]
    for process in together:
        out, error = process.communicate(timeout=120)
        assert (error, float(out.split()[0])) == ("", 30.0)
    assert _run(house) in ((30.0, 0), (30.0, 1))
