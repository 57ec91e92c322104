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
file ends with a digest (`_kept_class`): one that a power loss, a full disk, another numba or
another user left behind is compiled again. A disk that takes nothing costs one warning.

What numba takes from the disk it needs no knowledge of Python's and numpy's functions for, and the
half second in which it learns them (`refresh` of its contexts) is left to the first function that
has to be compiled, which asks for it by itself. Beside the machine code of a kernel the disk holds
the intermediate code that others are compiled with which call it, and reading that takes longer
than all the rest: it is left, likewise, to the first that does. Nor does a kernel need the modules
of numba that made what it calls of numpy: they are not imported for it.

Every kernel of the package is defined with the decorator of this module;
`tests/test_architecture.py` sees to it.
"""

import hashlib
import math
import os
import pickle
import re
import stat
import sys
import warnings
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import llvmlite
import numba
import numpy as np

from .advance import share

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

F = TypeVar("F", bound=Callable[..., Any])
DIGEST_BYTES = 16  # of a kept file: no damage passes, and 1 MB takes 0.8 ms
_warned: list[str] = []
_COMMENT = re.compile(r"#[^\n]*")
_IMPORT = re.compile(r"^from (\.+)([\w.]*) import (\([^)]*\)|[^\n]*)", re.MULTILINE)


def njit(allocates: bool = True, **options: Any) -> Callable[[F], F]:
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

    def define(function: F) -> F:
        compiled: F | None = None
        try:
            compiled = numba.njit(**options)(function)
        except RuntimeError as error:  # numba finds no directory that it can write
            _warn_unkept(str(error))
        if not options.get("cache") or compiled is function:
            return compiled or function
        kept = getattr(compiled, "_cache", None)
        if compiled is None or not _keep_soundly(kept, Path(function.__code__.co_filename)):
            # or a numba with other inner names: always compiling is slow, never outdated
            uncached: F = numba.njit(**options | {"cache": False})(function)
            return uncached
        _load_what_runs(kept)
        _compile_bare_for_callers(compiled)
        _compile_in_turn(compiled)
        return compiled

    return define


def _keep_soundly(kept: Any, source: Path) -> bool:
    """Have a function's cache verify what it takes from the disk, and go on where it cannot save.

    Parameters
    ----------
    kept : numba.core.caching.Cache
        The cache of one function.
    source : Path
        The file that defines the function.

    Returns
    -------
    bool
        False with a numba of other inner names.
    """
    entry: Any = getattr(kept, "_cache_file", None)
    names = "_source_stamp", "_index_path", "_data_path", "_dump", "_open_for_write"
    if not all(hasattr(entry, name) for name in names):
        return False
    entry.__class__ = _kept_class()
    versions = np.__version__, llvmlite.__version__
    entry._source_stamp = (entry._source_stamp, *versions, digest(source))
    entry.source = source.stat() if source.is_file() else None
    save = kept.save_overload

    def save_overload(signature: Any, code: Any) -> None:
        try:
            save(signature, code)
        except OSError as error:
            _warn_unkept(f"{kept.cache_path}: {error.strerror or error}")

    kept.save_overload = save_overload
    return True


@cache
def _kept_class() -> Any:
    """Return numba's class of a function's files on disk, with files that are verified.

    A file is a pickle and its digest, which is keyed with the sources and with the versions of
    numba, llvmlite and numpy. Nothing is unpickled, and no machine code run, before the digest is
    right. Within its file the code stands beside what it was compiled for (types, processor):
    processes that compile at the same time may give one name to two entries.
    """
    from numba.core.caching import IndexDataCacheFile

    class Kept(IndexDataCacheFile):
        source: os.stat_result | None

        def load(self, key: Any) -> Any:
            name = self._load_index().get(key)
            compiled_for, code = (name and self._content(self._data_path(name))) or (None, None)
            return code if compiled_for == key else None

        def save(self, key: Any, data: Any) -> None:
            super().save(key, (key, data))

        def _load_index(self) -> Any:
            return self._content(self._index_path) or {}

        def _save_index(self, overloads: Any) -> None:
            self._write(self._index_path, overloads)

        def _save_data(self, name: str, data: Any) -> None:
            self._write(self._data_path(name), data)

        def _write(self, path: str, content: Any) -> None:
            data = self._dump(content)
            with self._open_for_write(path) as file:
                file.write(data)
                file.write(self._digest(data))

        def _content(self, path: str) -> Any:
            """Return what a file holds, None where it is not to be used, whatever the reason."""
            try:
                with open(path, "rb") as file:
                    data = memoryview(file.read())
                    trusted = _trusted(os.fstat(file.fileno()), self.source)
                content = data[:-DIGEST_BYTES]
                if trusted and data[-DIGEST_BYTES:] == self._digest(content):
                    return pickle.loads(content)
            except Exception:  # compiling always helps, and says what else is wrong
                return None
            return None

        def _digest(self, data: Any) -> bytes:
            made_by = hashlib.sha256(repr((self._version, self._source_stamp)).encode()).digest()
            return hashlib.blake2b(data, digest_size=DIGEST_BYTES, key=made_by).digest()

    return Kept


def _trusted(file: os.stat_result, source: os.stat_result | None) -> bool:
    """Whether a file is of somebody whose code runs here anyway: this user, root, the source's.

    Nor may others write it, unless they may write the source as well.
    """
    if not hasattr(os, "getuid"):  # Windows
        return True
    owner, mode = (source.st_uid, source.st_mode) if source else (0, 0)
    open_to_all = file.st_mode & ~mode & stat.S_IWOTH
    return file.st_uid in (os.getuid(), 0, owner) and not open_to_all


def _warn_unkept(reason: str) -> None:
    """Warn, once in a process, that compiled functions are not kept."""
    if not _warned:
        _warned.append(reason)
        warnings.warn(
            f"compiled functions cannot be kept ({reason}), so every command compiles them again,"
            " up to a minute: free space there, or set NUMBA_CACHE_DIR to a directory that you can"
            " write",
            stacklevel=2,
        )


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


def _load_what_runs(kept: Any) -> None:
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


def _compile_bare_for_callers(kernel: Any) -> None:
    """Have a kernel that another one calls compiled without what Python needs to call it.

    That takes a fifth of all compiling: the conversion of each array of a record. Where Python
    calls a kernel that was compiled for others only it is compiled once more, and kept whole. The
    machine code of the callers is the same. With a numba of other inner names all is as ever.
    """
    names = "get_call_template", "add_overload", "_compiler"
    if not all(hasattr(kernel, name) for name in names):
        return
    kept, compiler, compile_whole = kernel._cache, kernel._compiler, kernel.compile
    load, template, add = kept.load_overload, kernel.get_call_template, kernel.add_overload
    for_callers: list[bool] = []  # innermost last; numba compiles in one thread at a time

    def get_call_template(*types: Any) -> Any:
        for_callers.append(True)
        try:
            return template(*types)
        finally:
            for_callers.pop()

    def customised(flags: Any) -> Any:
        if for_callers:
            flags.no_cpython_wrapper = flags.no_cfunc_wrapper = True
        return flags

    def load_overload(signature: Any, context: Any) -> Any:
        code = load(signature, context)
        return code if code is None or for_callers or _callable(code) else None

    def add_overload(code: Any) -> None:
        if _callable(code):
            add(code)
        else:
            kernel.overloads[tuple(code.signature.args)] = code

    def compile_kernel(signature: Any) -> Any:
        if not for_callers and not _callable(kernel.overloads.get(signature)):
            kernel.overloads.pop(signature, None)
        return compile_whole(signature)

    compiler._customize_flags, kernel.get_call_template = customised, get_call_template
    kept.load_overload, kernel.add_overload = load_overload, add_overload
    kernel.compile = compile_kernel


def _callable(code: Any) -> bool:
    """Whether Python can call compiled code."""
    name = code and code.fndesc.llvm_cpython_wrapper_name
    return bool(code) and bool(code.library.get_pointer_to_function(name))


def _compile_in_turn(kernel: Any) -> None:
    """Have the processes that need a kernel at the same time compile it once.

    The turn is taken where the disk has no code, which is then looked for again, and ends when the
    code is kept. A kernel compiles its callees within its own turn and calls never go round in a
    circle, so that no two processes wait for each other: numba's lock of threads comes first.
    """
    from numba.core.compiler_lock import global_compiler_lock

    kept, compile_alone = kernel._cache, kernel.compile
    load = kept.load_overload

    def load_overload(signature: Any, context: Any) -> Any:
        code = load(signature, context)
        if code is None and take_turn(kernel):
            code = load(signature, context)
        return code

    def compile_kernel(signature: Any) -> Any:
        with global_compiler_lock:
            try:
                return compile_alone(signature)
            finally:
                end_turn(kernel)

    kept.load_overload, kernel.compile = load_overload, compile_kernel


def take_turn(kernel: Any, wait: bool = True) -> bool:
    """Keep other processes from compiling a kernel until this process has compiled it, or ends.

    Parameters
    ----------
    kernel : numba.core.dispatcher.Dispatcher
        A kernel that is kept on disk.
    wait : bool
        Whether to wait while another process compiles it.

    Returns
    -------
    bool
        False where another process compiles it, or where the file system knows no locks.
    """
    with suppress(OSError):
        try:
            _lock(kernel, "LOCK_EX", "LOCK_NB")
        except (BlockingIOError, PermissionError):  # which of them depends on the system
            if not wait:
                return False
            share(math.nan)
            _lock(kernel, "LOCK_EX")
        return fcntl is not None
    return False


def end_turn(kernel: Any) -> None:
    """Let other processes compile a kernel."""
    with suppress(OSError):
        _lock(kernel, "LOCK_UN")


def _lock(kernel: Any, *operation: str) -> None:
    """Lock a kernel's byte in a file of its cache's directory, for the threads of this process."""
    if fcntl is not None:
        entry = kernel._cache._cache_file
        directory, name = os.path.split(entry._index_path)
        flags = sum(getattr(fcntl, each) for each in operation)
        fcntl.lockf(_lock_file(directory), flags, 1, zlib.crc32(name.encode()))


@cache
def _lock_file(directory: str) -> int:
    """Return an open file, which stays open: closing it would end all turns of the process."""
    return os.open(os.path.join(directory, "compiling.lock"), os.O_RDWR | os.O_CREAT, 0o600)


def unkept(kernel: Any) -> bool:
    """Tell whether a kernel is kept on disk once it is compiled, and is not there yet."""
    entry: Any = getattr(getattr(kernel, "_cache", None), "_cache_file", None)
    return type(entry) is _kept_class() and not entry._load_index()


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
        there = module in sys.modules or not module.startswith("numba.")
        if there or environment.lookup_environment(name) is not None:
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


@cache
def digest(source: Path) -> str:
    """Return one digest of the contents of a source file and of all that it imports (`closure`)."""
    state = hashlib.sha256()
    for path in sorted(closure(source)):
        state.update(f"{path.name} {len(_text(path))}\n".encode())
        state.update(_text(path).encode())
    return state.hexdigest()


def closure(source: Path) -> set[Path]:
    """Return a source file and those of the package that it imports, directly or through others."""
    seen: set[Path] = set()
    todo = [source]
    while todo:
        path = todo.pop()
        if path not in seen:
            seen.add(path)
            todo += imported(path)
    return seen


@cache
def imported(source: Path) -> tuple[Path, ...]:
    """Return the files of the package that one source file imports at its top.

    The package imports its own modules by relative names only, one statement from the first column
    on; what is imported within functions or for type checkers alone does not reach a kernel.
    """
    files: list[Path] = []
    for dots, module, names in _IMPORT.findall(_COMMENT.sub("", _text(source))):
        stem = source.parents[len(dots) - 1].joinpath(*filter(None, module.split(".")))
        inner = (stem / name.split()[0] for name in names.strip("() \n").split(",") if name.strip())
        for path in (stem, *inner):
            files += (
                file for file in (path.with_suffix(".py"), path / "__init__.py") if file.is_file()
            )
    return tuple(files)


@cache
def _text(path: Path) -> str:
    """Return a source file's content, "" where it lies in an archive or cannot be read."""
    try:
        return path.read_text(encoding="utf-8")
    except OSError:
        return ""
