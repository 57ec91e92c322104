"""Kernels that a platform wheel ships, and the kind of processor that they were compiled for.

`scripts/platform_wheel.py` compiles the kernels of `kernels.json` for the oldest processor of a
kind (x86-64-v3: AVX2 and FMA, since 2013), puts them beside their sources and writes `PROCESSOR`,
which stands in such a wheel alone. numba takes them where it compiles for that processor itself.
It is told to before it is imported, if this processor can run it and the compiler is the same;
else, and where numba is there already or its user chose, kernels are compiled as ever.
"""

import json
import os
import sys
from pathlib import Path
from typing import Any

PROCESSOR = Path(__file__).with_name("processor.json")
"""LLVM's name of the processor, the features that it needs, the version of llvmlite."""
NUMBA_VARIABLES = "NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES"
PROCESSORS: dict[str, tuple[str, tuple[str, ...]]] = {
    # the levels of the System V ABI for x86-64; all that LLVM names of level 3 beyond level 2
    "x86_64": ("x86-64-v3", ("avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe")),
    "arm64": ("apple-m1", ()),
    "aarch64": ("generic", ()),
}
"""By machine: the processor that a wheel is compiled for, and the features to look for."""


def choose_processor(described: Path = PROCESSOR) -> str:
    """Have numba compile for the processor of the shipped kernels, where this one can run them.

    Parameters
    ----------
    described : Path
        What a platform wheel says of its kernels.

    Returns
    -------
    str
        LLVM's name of the processor, "" where numba decides as ever.
    """
    if "numba" in sys.modules or any(name in os.environ for name in NUMBA_VARIABLES):
        return ""
    shipped = read_processor(described)
    if not shipped:
        return ""
    import llvmlite
    import llvmlite.binding

    if shipped["llvmlite"] != llvmlite.__version__:
        return ""
    features = llvmlite.binding.get_host_cpu_features()
    if not all(features.get(name) for name in shipped["features"]):
        return ""
    os.environ.update(dict(zip(NUMBA_VARIABLES, (shipped["name"], ""), strict=True)))
    return str(shipped["name"])


def read_processor(described: Path = PROCESSOR) -> dict[str, Any]:
    """Return what a platform wheel says of its kernels, nothing where none are shipped."""
    try:
        content: dict[str, Any] = json.loads(described.read_text(encoding="utf-8"))
    except OSError:
        return {}
    return content
