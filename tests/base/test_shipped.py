"""The processor that a platform wheel's kernels were compiled for, chosen before numba is there."""

import json
import os
import sys

import llvmlite
import pytest
from llvmlite.binding import get_host_cpu_features

from insgnss.base.shipped import NUMBA_VARIABLES, PROCESSORS, choose_processor, read_processor
from insgnss.batch.installation import examination

HERE = [name for name, present in get_host_cpu_features().items() if present][:3]
SHIPPED = {"name": "x86-64-v3", "features": HERE, "llvmlite": llvmlite.__version__}
CASES = {
    "this processor": ({}, "x86-64-v3"),
    "a processor without a feature": ({"features": [*HERE, "none-such"]}, ""),
    "another compiler": ({"llvmlite": "0.1"}, ""),
}


@pytest.fixture
def described(tmp_path, monkeypatch):
    """What a wheel says, in a process that has not imported numba yet."""
    monkeypatch.delitem(sys.modules, "numba", raising=False)
    for name in NUMBA_VARIABLES:
        monkeypatch.setenv(name, "")  # restored afterwards
        monkeypatch.delenv(name)

    def write(**changes):
        path = tmp_path / "processor.json"
        path.write_text(json.dumps(SHIPPED | changes))
        return path

    return write


@pytest.mark.parametrize("case", CASES)
def test_kernels_are_taken_by_processors_that_can_run_them(described, case):
    """Oracle: the features that LLVM finds here; numba's variables."""
    changes, expected = CASES[case]
    assert choose_processor(described(**changes)) == expected
    assert os.environ.get("NUMBA_CPU_NAME", "") == expected
    assert ("NUMBA_CPU_FEATURES" in os.environ) is bool(expected)


def test_the_users_choice_and_an_imported_numba_stay(described, tmp_path, monkeypatch):
    """Oracle: numba's variables, which it reads once."""
    assert choose_processor(tmp_path / "none.json") == ""
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "numba", sys)
        assert choose_processor(described()) == ""
    monkeypatch.setenv("NUMBA_CPU_NAME", "generic")
    assert choose_processor(described()) == ""
    assert os.environ["NUMBA_CPU_NAME"] == "generic"


def test_doctor_says_whether_shipped_kernels_are_used(described, monkeypatch):
    """Oracle: the description by hand."""
    assert examination._shipped_findings({}) == []
    (unused,) = examination._shipped_findings(read_processor(described()))
    assert "not used here" in unused.found
    assert f"llvmlite=={llvmlite.__version__}" in unused.advice
    choose_processor(described())
    (used,) = examination._shipped_findings(read_processor(described()))
    assert (used.verdict, used.found[:13]) == ("ok", "for x86-64-v3")


def test_level_3_of_the_abi_is_avx2_and_fma():
    """Oracle: the System V ABI for x86-64: AVX, AVX2, BMI1, BMI2, F16C, FMA, LZCNT, MOVBE."""
    name, features = PROCESSORS["x86_64"]
    assert name == "x86-64-v3"
    assert {*features} == {"avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe"}
