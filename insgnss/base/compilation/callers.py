"""Kernels that others call, compiled without what only Python needs to call them."""

from typing import Any


def compile_bare_for_callers(kernel: Any) -> None:
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
