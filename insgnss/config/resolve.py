"""The flight file as it was understood: every option with its value, in plain JSON types."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

from ..records import Rows
from ..stochastic.noise_model import NoiseModel


def resolved(flight: Any) -> dict[str, Any]:
    """Every value of a `Flight` with its default filled in, as plain JSON types.

    Paths are relative to the flight file where they lie below its directory.
    """
    base = flight.path.parent
    return {f.name: _plain(getattr(flight, f.name), base) for f in fields(flight)}


def _plain(value: Any, base: Path) -> Any:
    """Return `value` in JSON types; an object that replaces a file is described as such."""
    if isinstance(value, Rows | NoiseModel):
        return f"given as object: {value!r}"
    if is_dataclass(value):
        return {f.name: _plain(getattr(value, f.name), base) for f in fields(value)}
    if isinstance(value, Path):
        return (value.relative_to(base) if value.is_relative_to(base) else value).as_posix()
    if isinstance(value, Mapping):
        return {key: _plain(item, base) for key, item in value.items()}
    if isinstance(value, tuple):
        return [_plain(item, base) for item in value]
    return value.tolist() if hasattr(value, "tolist") else value
