"""A frozen record with other values in some of its fields, however deep they lie."""

from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

from .errors import UsageError, near

Record = TypeVar("Record")


def with_changes(record: Record, changes: dict[str, Any]) -> Record:
    """Return `record` with other values.

    Parameters
    ----------
    record : a frozen dataclass; records in its fields may be changed too.
    changes : value by field; two underscores go into a field, `imu__noise` is `noise` of `imu`.

    Returns
    -------
    The new record; the old one stays as it is.

    Raises
    ------
    UsageError : there is no such field; the message names the nearest.
    """
    if not is_dataclass(record) or isinstance(record, type):
        raise UsageError(
            f"{', '.join(changes)}: belongs to something that is not given; give the whole of it"
        )
    own: dict[str, Any] = {}
    inner: dict[str, dict[str, Any]] = {}
    field_names = [f.name for f in fields(record)]
    for key, value in changes.items():
        name, _, rest = key.partition("__")
        if name not in field_names:
            raise UsageError(f"{type(record).__name__} has no {name!r}; {near(name, field_names)}")
        if rest:
            inner.setdefault(name, {})[rest] = value
        else:
            own[name] = value
    for name, deeper in inner.items():
        own[name] = with_changes(own.get(name, getattr(record, name)), deeper)
    return replace(record, **own)
