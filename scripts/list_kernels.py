"""List the kernels that `insgnss demo` and `doctor` run with the types of their arguments.

    python scripts/list_kernels.py [--out insgnss/base/kernels.json]

`insgnss doctor --compile` and the helpers of a first run compile them by this list. The longest to
compile come first, by the size of their intermediate code.
"""

import argparse
import gc
import json
import tempfile
from pathlib import Path
from typing import Any

from numba.core import types
from numba.core.dispatcher import Dispatcher
from numba.np.numpy_support import as_dtype

from insgnss.api.demo import demo
from insgnss.base.ahead import KERNELS_FILE
from insgnss.batch.installation.self_test import self_test


def described(kind: Any) -> str | list[Any]:
    """Return a type of numba as `insgnss.base.ahead` describes it."""
    if isinstance(kind, types.NamedTuple | types.NamedUniTuple):
        name = f"{kind.instance_class.__module__}.{kind.instance_class.__name__}"
        return [name.removeprefix("insgnss."), *map(described, kind.types)]
    if isinstance(kind, types.Array):
        read_only = "" if kind.mutable else " r"
        return f"{as_dtype(kind.dtype).str[1:]} {kind.ndim} {kind.layout}{read_only}"
    return str(as_dtype(kind).str[1:])


def called_kernels() -> dict[str, list[Any]]:
    """Return the kernels that Python called in this process, with the types of their arguments.

    Raises
    ------
    SystemExit
        Where kernels were compiled in this process, whose callees would be listed as well.
    """
    sizes, listed = {}, {}
    for kernel in (o for o in gc.get_objects() if isinstance(o, Dispatcher)):
        module, _, rest = kernel.py_func.__module__.partition(".")
        for arguments, compiled in kernel.overloads.items() if module == "insgnss" else ():
            if kernel.stats.cache_misses:
                raise SystemExit("kernels had to be compiled: run it once more")
            name = f"{rest}.{kernel.py_func.__name__}"
            listed[name] = [described(kind) for kind in arguments]
            sizes[name] = len(getattr(compiled.library, "_intermediate", None) or b"")
    return {name: listed[name] for name in sorted(listed, key=lambda n: (-sizes[n], n))}


def main() -> None:
    """Run the demonstration and the self-test, and write the list."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=KERNELS_FILE)
    out = parser.parse_args().out
    self_test()
    with tempfile.TemporaryDirectory() as directory:
        demo(Path(directory) / "demo", minutes=3.0)
    kernels = called_kernels()
    rows = (f"{json.dumps(name)}: {json.dumps(kernel)}" for name, kernel in kernels.items())
    out.write_text("{\n" + ",\n".join(rows) + "\n}\n", encoding="utf-8")
    print(f"{len(kernels)} kernels in {out}")


if __name__ == "__main__":
    main()
