"""What holds for all tests: one thread for linear algebra, and their order.

OpenBLAS' threads are set before numpy is loaded: the matrices are 30 x 30, and more threads only
wait for each other.

The processes of pytest-xdist share numba's cache on disk, and wait where another one compiles the
kernel that they need (`insgnss.base.compilation`). The kernels of the filter take half of all
compiling, and nearly every test of a whole flight needs them. One file of tests is therefore begun
with that compiles them, and meanwhile the other processes run those of rooms that stand without the
filter: without this order they waited for it.
"""

import gc
import os
import sys

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from collections import Counter
from pathlib import Path

import pytest

# some tests share code with the scripts of the repository
sys.path.append(str(Path(__file__).parents[1] / "scripts"))

# until all tests are collected: they stay, and searching them for garbage takes half of the time
gc.disable()

COMPILES_THE_FILTER = "test_public_api.py"
WITHOUT_THE_FILTER = frozenset(
    ("adjust", "block_adjustment", "comparison", "config", "documentation", "exporting", "formats")
    + ("geodesy", "gnss", "mounting_calibration", "proof", "report", "estimation", "targets")
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
