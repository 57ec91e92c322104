"""What holds for all tests: one thread for linear algebra, each kernel compiled once, their order.

OpenBLAS' threads are set before numpy is loaded: the matrices are 30 x 30, and more threads only
wait for each other.

The processes of pytest-xdist share numba's cache on disk, but two that need the same kernel at the
same time both compile it, and on a fresh machine all of them begin with the same ones. Here a
kernel is compiled under a lock of its own, a file in the directory that the processes of one run
share: who comes second waits, then takes the code from the disk, and meanwhile nobody is kept from
compiling another kernel. A kernel compiles its callees within its own turn, and calls never go
round in a circle, so that no two processes can wait for each other. A process that is killed loses
its locks. Without file locks (Windows) or with a numba of other inner names every process compiles
for itself, as without this file.

The kernels of the filter take half of all compiling, and nearly every test of a whole flight needs
them. One file of tests is therefore begun with that compiles them, and meanwhile the other
processes run those of rooms that stand without the filter: without this order they waited for it.
"""

import gc
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None

# until all tests are collected: they stay, and searching them for garbage takes half of the time
gc.disable()

COMPILES_THE_FILTER = "test_public_api.py"
WITHOUT_THE_FILTER = frozenset(
    ("adjust", "block_adjustment", "comparison", "config", "documentation", "exporting", "formats")
    + ("geodesy", "gnss", "mounting_calibration", "proof", "report", "stochastic", "targets")
)
"""Directories of tests."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with what compiles the filter and what does not need it; then the largest files."""
    tests = Counter(item.path for item in items)

    def place_in_order(item: pytest.Item) -> tuple[int, int, str]:
        if item.path.name == COMPILES_THE_FILTER:
            rank = 0
        else:
            rank = 2 if WITHOUT_THE_FILTER.isdisjoint(item.nodeid.split("/")) else 1
        return rank, -tests[item.path], str(item.path)

    items.sort(key=place_in_order)
    gc.freeze()
    gc.enable()


@contextmanager
def turn(directory: Path, name: str) -> Iterator[None]:
    """Hold the lock of a name among the processes that share a directory."""
    file = directory / sha256(name.encode()).hexdigest()[:32]
    descriptor = os.open(file, os.O_RDWR | os.O_CREAT, 0o600)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


def compile_in_turn(directory: Path) -> None:
    """Have numba look for a cached kernel, and compile it, under the kernel's lock."""
    from numba.core.compiler_lock import global_compiler_lock
    from numba.core.dispatcher import Dispatcher

    def compile_kernel(self: Any, signature: Any) -> Any:
        # a kernel that is not kept on disk is nothing to wait for
        if getattr(getattr(self, "_cache", None), "cache_path", None) is None:
            return compile_alone(self, signature)
        # numba's lock of threads comes first, as within a compilation its callees' turns come after
        with global_compiler_lock, turn(directory, f"{self.__module__}.{self.__qualname__}"):
            return compile_alone(self, signature)

    compile_alone = Dispatcher.compile
    Dispatcher.compile = compile_kernel


@pytest.fixture(scope="session", autouse=True)
def _each_kernel_is_compiled_once(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Of the processes of pytest-xdist alone: another has nobody to wait for."""
    if fcntl is not None and hasattr(request.config, "workerinput"):
        directory = tmp_path_factory.getbasetemp().parent / "kernels"
        directory.mkdir(exist_ok=True)
        compile_in_turn(directory)
