"""Keywords of functions that are the options of a record, stated there once."""

from collections.abc import Callable
from dataclasses import MISSING, fields
from inspect import Parameter, signature
from pathlib import Path
from typing import TypeVar

from ..base.inputs import Source

Door = TypeVar("Door", bound=Callable[..., object])


def options_of_record(record: type) -> Callable[[Door], Door]:
    """Name the fields of a record as keywords of a function that takes them as ``**options``.

    Parameters
    ----------
    record : dataclass
        What the function makes of its options; fields that are parameters of the function already
        are left out.

    Returns
    -------
    callable
        Decorator, after which `inspect.signature` and `help` show the keywords with their defaults.
    """

    def decorated(function: Door) -> Door:
        described = signature(function)
        named = [p for p in described.parameters.values() if p.kind is not Parameter.VAR_KEYWORD]
        named += [
            Parameter(f.name, Parameter.KEYWORD_ONLY, default=f.default, annotation=f.type)
            for f in fields(record)
            if f.name not in described.parameters and f.default is not MISSING
        ]
        setattr(function, "__signature__", described.replace(parameters=named))  # noqa: B010
        return function

    return decorated


def path_of(source: Source | None) -> Path | None:
    """Return the path that a caller may give as a text, None for none."""
    return None if source is None else Path(source)
