"""The kernels of `process` and `demo` compiled ahead, in as many processes as processors.

numba compiles a function when it is first called, one after the other. `kernels.json` lists the
functions that Python calls, the longest to compile first, with the types of their arguments
(`scripts/list_kernels.py` writes it, a test compares it with a run). What they call is compiled
with them. A type is "f8 2 C" for an array (numpy's name, axes, layout, "r" where it is read-only),
"i8" for a number, and for a named tuple its module and name with the types of its fields. A list
that is out of date costs time at the first run, and nothing else.
"""

import json
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, as_completed
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from ..base.beside import processors
from .finding import Finding

KERNELS = Path(__file__).with_name("kernels.json")
_COMPILE = f"import json, sys; from {__name__} import compile_kernel; " + (
    "compile_kernel(sys.argv[1], json.loads(sys.argv[2]))"
)


def compile_all(
    progress: Callable[[str], None], listed: dict[str, list[Any]] | None = None
) -> Finding:
    """Compile kernels and keep them on disk.

    Parameters
    ----------
    progress : callable
        Gets how many are compiled.
    listed : dict, optional
        The types of their arguments by name, else those of `kernels.json`.

    Returns
    -------
    Finding
        How many were compiled, in which time; a defect where one cannot be.
    """
    kernels = json.loads(KERNELS.read_text("utf-8")) if listed is None else listed
    start, reason = time.perf_counter(), ""
    progress(f"compiling {len(kernels)} kernels in {processors()} processes")
    with ThreadPoolExecutor(processors()) as pool:
        jobs = [pool.submit(_compile_elsewhere, *each) for each in kernels.items()]
        for count, job in enumerate(as_completed(jobs), 1):
            progress(f"compiled {count} of {len(kernels)} kernels")
            reason = reason or job.result()
    seconds = time.perf_counter() - start
    value = f"{len(kernels)} in {seconds:.0f} s by {processors()} processes"
    if reason:
        advice = "pip install --force-reinstall insgnss"
        return Finding("kernels", "compiled", f"fails: {reason}", "defect", advice)
    return Finding("kernels", "compiled", value)


def _compile_elsewhere(name: str, arguments: list[Any]) -> str:
    """Compile a kernel in a process of its own; return why that fails, "" where it does not."""
    command = [sys.executable, "-c", _COMPILE, name, json.dumps(arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return f"{name}: {' '.join(done.stderr.split())[-200:]}" if done.returncode else ""


def compile_kernel(name: str, arguments: list[Any]) -> None:
    """Compile one kernel, or take it from the disk.

    Parameters
    ----------
    name : str
        Its module within the package, and its name.
    arguments : list
        The types of its arguments.
    """
    kernel = _attribute(name)
    if hasattr(kernel, "compile"):  # else NUMBA_DISABLE_JIT
        kernel.compile(tuple(kernel.typeof_pyval(example(each)) for each in arguments))


def example(described: Any) -> Any:
    """Return a value of a type.

    Parameters
    ----------
    described : str or list
        The type as `kernels.json` has it.

    Returns
    -------
    object
        An array, a number or a named tuple.
    """
    if isinstance(described, list):
        return _attribute(described[0])(*map(example, described[1:]))
    kind, *layout = described.split()
    if not layout:
        return np.dtype(kind).type(0)
    axes, order, *read_only = layout
    array = np.zeros((2,) * int(axes), kind, order="F" if order == "F" else "C")
    if order == "A":
        array = np.zeros((*array.shape[1:], 4), kind)[..., ::2]
    array.flags.writeable = not read_only
    return array


def _attribute(name: str) -> Any:
    module, _, attribute = name.rpartition(".")
    return getattr(import_module(f"...{module}", __name__), attribute)
