"""Compiled functions (kernels): `numba.njit` whose cache on disk notices every change.

numba keeps the compiled code of a function on disk and takes it again as long as the file in which
that function stands is the same. The code of the functions that it calls and the values of its
constants are compiled into it; where they come from another file, numba does not notice that they
changed, and yesterday's results come back. Here the compiled code belongs to the content of the
function's file *and of every module of the package that this file imports, at its top, directly or
through others*: whatever a kernel can refer to stands in one of them.

Where the code is kept is numba's own choice (`NUMBA_CACHE_DIR`, `__pycache__` beside the source,
the user's cache directory; see `insgnss.base.caches`). Outdated code is overwritten in its place,
so that nothing has to be cleaned up, and several processes may compile at the same time, as numba
replaces whole files only; who needs a kernel that another compiles waits for it (`take_turn`). Each
file ends with a digest (`kept`): one that a power loss, a full disk, another numba or another user
left behind is compiled again. A disk that takes nothing costs one warning. What a platform wheel
ships beside the sources is looked at where that place has nothing (`insgnss.base.shipped`).

What numba takes from the disk it needs no knowledge of Python's and numpy's functions for, and the
half second in which it learns them (`refresh` of its contexts) is left to the first function that
has to be compiled, which asks for it by itself. Beside the machine code of a kernel the disk holds
the intermediate code that others are compiled with which call it, and reading that takes longer
than all the rest: it is left, likewise, to the first that does. Nor does a kernel need the modules
of numba that made what it calls of numpy: they are not imported for it.

Every kernel of the package is defined with the decorator of this module;
`tests/test_architecture.py` sees to it.
"""

import math
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

from ..advance import share
from ..shipped import choose_processor
from .callers import compile_bare_for_callers
from .kept import keep_soundly, unkept, warn_unkept
from .linking import load_what_runs
from .turns import compile_in_turn, end_turn, take_turn

choose_processor()
import numba  # noqa: E402 which reads its variables now

__all__ = ["end_turn", "njit", "take_turn", "unkept"]

Kernel = TypeVar("Kernel", bound=Callable[..., Any])


def njit(allocates: bool = True, **options: Any) -> Callable[[Kernel], Kernel]:
    """Return a decorator that compiles a function when it is first called and keeps it on disk.

    Parameters
    ----------
    allocates : bool
        Whether the function makes arrays. In one that makes none, slices apart, numba counts no
        references: every array that a record brings along costs two atomic operations else, a tenth
        of the filter. Such a function divides like numpy: x / 0 is infinite and no exception.
    **options
        What `numba.njit` takes, such as ``nogil`` or ``error_model``. With ``cache=True`` the
        compiled code is kept on disk for the next process.

    Returns
    -------
    Callable
        The decorator; what it returns is numba's dispatcher, or the function itself where numba is
        switched off (``NUMBA_DISABLE_JIT``).
    """

    if not allocates:
        options = {"_nrt": False, "error_model": "numpy", "fastmath": {"contract"}} | options

    def define(function: Kernel) -> Kernel:
        compiled: Kernel | None = None
        try:
            compiled = numba.njit(**options)(function)
        except RuntimeError as error:  # numba finds no directory that it can write
            warn_unkept(str(error))
        if not options.get("cache") or compiled is function:
            return compiled or function
        kept = getattr(compiled, "_cache", None)
        if compiled is None or not keep_soundly(kept, Path(function.__code__.co_filename)):
            # or a numba with other inner names: always compiling is slow, never outdated
            uncached: Kernel = numba.njit(**options | {"cache": False})(function)
            return uncached
        load_what_runs(kept)
        compile_bare_for_callers(compiled)
        compile_in_turn(compiled)
        return compiled

    return define


def _tell_of_compiling() -> None:
    """Have numba tell of each function that it compiles; one taken from the disk is none."""
    from numba.core import event

    class Compiled(event.Listener):
        def on_start(self, event: Any) -> None:
            share(math.nan)

        def on_end(self, event: Any) -> None:
            """Nothing: the next share says that it goes on."""

    event.register("numba:compile", Compiled())


with suppress(ImportError, AttributeError):  # a numba without it: a first run says less
    _tell_of_compiling()
