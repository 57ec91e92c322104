"""Compiled code on disk: taken again while nothing that it was made of changed."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import insgnss

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
    for name in ("compilation.py", "advance.py"):
        source = BASE / name
        (folder / name).write_bytes(source.read_bytes())
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
    text = (house / "compilation.py").read_text()
    (house / "compilation.py").write_text(text.replace('"_unserialize"', '"_renamed"'))
    for _ in range(2):
        assert _printed(house, unread) == "2.0 10.0 False False"
    assert _run(house) == (10.0, 1)


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
    text = (BASE.parent / "navigation" / "kernels" / "blas.py").read_text()
    (house / "blas.py").write_text(text.replace("...base.compilation", ".compilation"))
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
def test_a_numba_of_other_inner_names_keeps_nothing(house, monkeypatch):
    """Oracle: no code on disk, and right results: better slow than outdated."""
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    text = (house / "compilation.py").read_text()
    (house / "compilation.py").write_text(text.replace('"_cache_file"', '"_renamed"'))
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
