"""A small run of scripts/fuzz_readers.py, and proof that it finds what it looks for."""

import importlib.util
import sys
import warnings
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from insgnss.base.errors import InputError
from insgnss.io.formats.text.layout import float_of


@pytest.fixture(scope="module")
def fuzzer() -> ModuleType:
    spec = importlib.util.spec_from_file_location(
        "fuzz_readers", Path(__file__).parents[3] / "scripts/fuzz_readers.py"
    )
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["fuzz_readers"] = module
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
def test_every_mutated_file_is_a_record_or_one_line(fuzzer: ModuleType) -> None:
    """Oracle: the rule itself: no traceback, no hang, no warning, no cut file in silence, and no
    other number than the one that is written.
    """
    counts, finds = fuzzer.fuzz(2600, 20181121)
    assert finds == []
    total = sum(counts.values(), start=fuzzer.Counter())
    assert total["refused"] > 1000
    assert total["record"] + total["noted"] > 200


@pytest.mark.parametrize(
    ("read", "cut", "verdict", "why"),
    [
        (lambda path: path, "", "record", ""),
        (lambda path: path, "cut", "find", "nothing said"),
        (lambda path: 1 / 0, "", "find", "ZeroDivisionError"),
        (lambda path: warnings.warn("odd", stacklevel=1), "", "find", "UserWarning"),
        (lambda path: print("odd"), "", "find", "printed"),  # noqa: T201
        (lambda path: (_ for _ in ()).throw(InputError("two\nlines")), "", "find", "2 lines"),
        (lambda path: (_ for _ in ()).throw(InputError("one line")), "", "refused", "one line"),
    ],
)
def test_the_judge_sees_each_kind_of_find(
    fuzzer: ModuleType, read: object, cut: str, verdict: str, why: str
) -> None:
    """Oracle: readers that do what a reader must not."""
    case = fuzzer.Case(
        "x",
        "x",
        b"1\n",
        (lambda path: next(read(path)) if hasattr(read(path), "send") else read(path)),
    )  # type: ignore[operator]
    got = fuzzer.judge(case, Path("x"), cut)
    assert got[0] == verdict
    assert why in got[1]


@pytest.mark.parametrize(
    ("read", "expected", "why"),
    [
        (lambda text: {"x": float(text.split()[1])}, "same", "2.4 instead of 1.4"),
        (lambda text: [float(x) for x in text.split()[:2]], "rows", "2.4 instead of 1.4"),
        (lambda text: np.array([float("nan")]), "finite", "1 more numbers that are none"),
        (lambda text: (1.0, 2.0), "same", "2 numbers instead of 1"),
    ],
)
def test_the_judge_sees_another_number_than_the_one_written(
    fuzzer: ModuleType, tmp_path: Path, read: object, expected: str, why: str
) -> None:
    """Oracle: readers that read 2.4 for 1.4, nothing for a number, or a number too many."""
    case = fuzzer.Case("x", "x", b"", lambda path: read(path.read_text()))  # type: ignore[operator]
    base = [{"x": 1.4} if expected != "rows" else [3.0, 1.4]]
    (tmp_path / "x").write_text("3.0 2.4\n")
    assert fuzzer.judge(case, tmp_path / "x", expected, base) == ("find", why)


@pytest.mark.parametrize("text", ["12.50", "-7", "+0.25", "1e-3", "-31.5E+2", ".5", "100."])
def test_spellings_of_a_number_are_its_own_and_others_are_none(
    fuzzer: ModuleType, text: str
) -> None:
    """Oracle: Python's float(), and the strict rule of tables."""
    from fuzz_values import misspelled, respelled

    for k in range(60):
        rng = np.random.default_rng([3, k])
        assert float(respelled(rng, text)) == float(text)
        assert float_of(misspelled(rng, text, False)) is None


def test_inputs_depend_on_seed_and_number_alone(fuzzer: ModuleType) -> None:
    """Oracle: the same call again."""
    case = fuzzer.text_cases()[0]
    once, again, other = (
        fuzzer.mutate(np.random.default_rng(seed), case) for seed in ([1, 7], [1, 7], [1, 8])
    )
    assert once == again
    assert once != other
