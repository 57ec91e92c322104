"""Simulations that stand outside the package, in benchmarks/, and that `simulate` writes too."""

import sys
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

from ..base.errors import UsageError

PACKAGE_PARENT = Path(__file__).parents[1]  # this file stands one folder deep


def import_plugged(module: str) -> Any:
    """Import a module of a package in benchmarks/.

    Parameters
    ----------
    module : str
        Its name, such as "published_blocks.survey".

    Returns
    -------
    module
        The module, from benchmarks/ beside the package in a checkout, or inside it in a wheel.

    Raises
    ------
    UsageError
        If neither place has the package.
    """
    name = module.partition(".")[0]
    if name not in sys.modules:
        folders = [root / "benchmarks" / name for root in (PACKAGE_PARENT.parent, PACKAGE_PARENT)]
        source = next((f / "__init__.py" for f in folders if (f / "__init__.py").is_file()), None)
        spec = source and spec_from_file_location(name, source)
        if not spec or not spec.loader:
            raise UsageError(f"this installation has no {folders[0]}; install the wheel of insgnss")
        sys.modules[name] = module_from_spec(spec)
        spec.loader.exec_module(sys.modules[name])
    return import_module(module)
