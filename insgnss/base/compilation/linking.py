"""Compiled code that is taken from the disk, without what only numba's compiler needs of it."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any


def load_what_runs(kept: Any) -> None:
    """Have a function's cache take from the disk what it needs to run, not what others need of it.

    Parameters
    ----------
    kept : numba.core.caching.Cache
        The cache of one function. With a numba of other inner names it stays as it is.
    """
    if not (hasattr(kept, "_load_overload") and hasattr(kept, "_guard_against_spurious_io_errors")):
        return

    def load_overload(signature: Any, context: Any) -> Any:
        from numba.core.runtime import rtsys

        rtsys.initialize(context)
        guarded = kept._guard_against_spurious_io_errors()
        with guarded, _linked_later(context.codegen()), _makers_unread():
            return kept._load_overload(signature, context)

    kept.load_overload = load_overload


@contextmanager
def _makers_unread() -> Iterator[None]:
    """Have compiled code come without the modules of numba whose functions are compiled into it.

    numba imports them for their names, which nothing but its object mode looks up.
    """
    from numba.core import environment

    names = "_rebuild_env", "Environment", "lookup_environment"
    if not all(hasattr(environment, name) for name in names):
        yield
        return
    rebuild = environment._rebuild_env

    def rebuild_bare(module: str, constants: Any, name: str) -> Any:
        loaded = module in sys.modules or not module.startswith("numba.")
        if loaded or environment.lookup_environment(name) is not None:
            return rebuild(module, constants, name)
        bare = environment.Environment({"__name__": module})
        bare.consts[:] = constants
        bare.env_name = name
        environment.Environment._memo[name] = bare
        return bare

    environment._rebuild_env = rebuild_bare
    try:
        yield
    finally:
        environment._rebuild_env = rebuild


@contextmanager
def _linked_later(codegen: Any) -> Iterator[None]:
    """Have compiled code that is taken from the disk keep what only callers need unread."""
    library = _linked_later_class()
    if library is None or getattr(codegen, "_library_class", None) is not library.__base__:
        yield
        return
    codegen._library_class = library
    try:
        yield
    finally:
        codegen._library_class = library.__base__


@cache
def _linked_later_class() -> Any:
    """Return numba's class of compiled code, whose intermediate code is read when it is linked.

    None with a numba of other inner names.
    """
    try:
        from llvmlite import binding
        from numba.core.codegen import JITCodeLibrary

        names = (
            *("enable_object_caching", "_set_compiled_object", "_finalize_final_module"),
            *("_get_module_for_linking", "get_pointer_to_function", "_unserialize"),
        )
        if not all(hasattr(JITCodeLibrary, name) for name in names):
            return None
    except ImportError:
        return None

    class LinkedLater(JITCodeLibrary):
        _intermediate: bytes | None = None

        @classmethod
        def _unserialize(cls, codegen: Any, state: Any) -> Any:
            name, kind, data = state
            if kind != "object":
                return super()._unserialize(codegen, state)
            library = codegen.create_library(name)
            machine_code, library._intermediate = data
            library.enable_object_caching()
            library._set_compiled_object(machine_code)
            library._finalize_final_module()
            return library

        def _get_module_for_linking(self) -> Any:
            if self._intermediate is not None:
                self._shared_module = binding.parse_bitcode(self._intermediate)
                self._codegen._engine._load_defined_symbols(self._shared_module)
                self._intermediate = None
            return super()._get_module_for_linking()

        def get_pointer_to_function(self, name: str) -> Any:
            if self._intermediate is None:
                return super().get_pointer_to_function(name)
            return self._codegen._engine.get_function_address(name)

    return LinkedLater
