"""Kernels compiled ahead: beside the main line of a first run, in processes of their own.

numba compiles a function when it is first called, one after the other. `kernels.json` lists the
functions that Python calls, the longest to compile first, with the types of their arguments
(`scripts/list_kernels.py` writes it, a test compares it with a run). What they call is compiled
with them. A type is "f8 2 C" for an array (numpy's name, axes, layout, "r" where it is read-only),
"i8" for a number, and for a named tuple its module and name with the types of its fields. A list
that is out of date costs time at the first run, and nothing else.

A helper compiles what the filter and what follows it will need, while a recording is read and
prepared. Who compiles what is decided kernel by kernel (`insgnss.base.compilation`): the main line
compiles what it needs before a helper has begun with it, and waits for the rest. A helper that
fails costs nothing but its own time, and it ends when the process ends that started it.
"""

import json
import os
import subprocess
import sys
import threading
import warnings
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from .beside import processors
from .compilation import end_turn, take_turn, unkept

KERNELS_FILE = Path(__file__).with_name("kernels.json")
ROOMS = "navigation.filter.", "navigation.innovations.", "navigation.diagnosis."
"""Whose kernels are compiled beside: a run needs those of other rooms before a helper has begun."""
HELPERS = 2  # processes: beside `run_forward`, which takes half of all compiling, one for the rest
_started: list["subprocess.Popen[bytes]"] = []


def listed_kernels() -> dict[str, list[Any]]:
    """Return the kernels of `kernels.json` with the types of their arguments."""
    kernels: dict[str, list[Any]] = json.loads(KERNELS_FILE.read_text("utf-8"))
    return kernels


def compile_ahead() -> None:
    """Start helpers where kernels of the filter are missing on disk and processors are to spare."""
    names = [name for name in listed_kernels() if name.startswith(ROOMS)]
    longest = _attribute(names[0])
    if _started or processors() < 2 or not Path(sys.executable or "").name.startswith("python"):
        return  # a program that embeds Python names itself: it would be started once more
    if not unkept(longest) or not take_turn(longest, wait=False):
        return
    end_turn(longest)
    command, nowhere = elsewhere("help_out(sys.argv[2:])", *names), subprocess.DEVNULL
    for _ in range(HELPERS):
        with suppress(OSError):  # its input stays open as long as this process lives
            _started.append(
                subprocess.Popen(command, stdin=subprocess.PIPE, stdout=nowhere, stderr=nowhere)
            )


def elsewhere(call: str, *arguments: str) -> list[str]:
    """Return the command that calls a function of this module in a process with the same modules.

    Parameters
    ----------
    call : str
        The call, in Python; `sys` and `json` are imported.
    *arguments : str
        Stand in `sys.argv` from 2 on.

    Returns
    -------
    list of str
        Python's command line, which the directory that it runs in adds no modules to. Looking for
        cycles of objects would take a fifth of compiling.
    """
    code = "import gc, json, sys; gc.disable(); sys.path[:] = json.loads(sys.argv[1]); "
    code += f"import {__name__} as ahead; ahead.{call}"
    return [sys.executable, "-P", "-c", code, json.dumps([*map(str, sys.path)]), *arguments]


def help_out(names: list[str]) -> None:
    """Compile the kernels that nobody else compiles, until the process that started this one ends.

    Parameters
    ----------
    names : list of str
        Kernels of the list.
    """
    threading.Thread(target=_end_with_starter, daemon=True).start()
    warnings.filterwarnings("error", "compiled functions cannot be kept")  # then it helps nobody
    kernels = listed_kernels()
    for name in names:
        if unkept(_attribute(name)) and take_turn(_attribute(name), wait=False):
            compile_kernel(name, kernels[name])


def _end_with_starter() -> None:
    sys.stdin.buffer.read()
    os._exit(0)


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
