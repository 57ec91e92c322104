"""The kernels of `process` and `demo` compiled ahead, in as many processes as processors."""

import json
import subprocess
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, as_completed
from typing import Any

from ...base import ahead
from ...base.beside import processors
from ...base.findings import Finding, Question

_COMPILE = "compile_kernel(sys.argv[2], json.loads(sys.argv[3]))"


def compile_all(
    progress: Callable[[str], None], listed: dict[str, list[Any]] | None = None
) -> Finding:
    """Compile kernels and keep them on disk.

    Parameters
    ----------
    progress : callable
        Gets how many are compiled.
    listed : dict, optional
        The types of their arguments by name, else those of `insgnss/base/kernels.json`.

    Returns
    -------
    Finding
        How many were compiled, in which time; a defect where one cannot be.
    """
    kernels = ahead.listed_kernels() if listed is None else listed
    start, reason = time.perf_counter(), ""
    progress(f"compiling {len(kernels)} kernels in {processors()} processes")
    with ThreadPoolExecutor(processors()) as pool:
        jobs = [pool.submit(_compile_elsewhere, *each) for each in kernels.items()]
        for count, job in enumerate(as_completed(jobs), 1):
            progress(f"compiled {count} of {len(kernels)} kernels")
            reason = reason or job.result()
    seconds, compiled = time.perf_counter() - start, Question("compiled", topic="kernels")
    value = f"{len(kernels)} in {seconds:.0f} s by {processors()} processes"
    if reason:
        advice = "pip install --force-reinstall insgnss"
        return compiled.contradiction(f"fails: {reason}", advice)
    return compiled.ok(value)


def _compile_elsewhere(name: str, arguments: list[Any]) -> str:
    """Compile a kernel in a process of its own; return why that fails, "" where it does not."""
    command = ahead.elsewhere(_COMPILE, name, json.dumps(arguments))
    finished = subprocess.run(command, capture_output=True, text=True, check=False)
    return f"{name}: {' '.join(finished.stderr.split())[-200:]}" if finished.returncode else ""
