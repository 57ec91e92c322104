"""A frozen record with other values in some of its fields, however deep they lie."""

import difflib
from collections.abc import Iterable, Iterator
from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

from ...base.errors import UsageError
from ...base.wording import phrase

Record = TypeVar("Record")


def with_changes(record: Record, changes: dict[str, Any], keywords: Iterable[str] = ()) -> Record:
    """Return `record` with other values.

    Parameters
    ----------
    record : a frozen dataclass; records in its fields may be changed too.
    changes : value by field; two underscores go into a field, `imu__noise` is `noise` of `imu`.
    keywords : further words that the caller may have meant, those of a function.

    Returns
    -------
    The new record; the old one stays as it is.

    Raises
    ------
    UsageError : there is no such field; the message names the nearest.
    """
    top = {key: value for key, value in changes.items() if "__" not in key}
    inner = {key: value for key, value in changes.items() if "__" in key}
    for some in (top, inner):  # a table that is given may be changed at once
        known_names = list(_names(record))
        for key in some:
            if key not in known_names:
                _refuse_unknown(record, key, list(dict.fromkeys([*keywords, *known_names])))
        record = _changed_record(record, some)
    return record


def _names(record: Any, prefix: str = "") -> Iterator[str]:
    """Every field by the word that changes it."""
    for field in fields(record):
        yield prefix + field.name
        value = getattr(record, field.name)
        if _has_fields(value):
            yield from _names(value, f"{prefix}{field.name}__")


def _has_fields(value: Any) -> bool:
    return is_dataclass(value) and not isinstance(value, type)


def _refuse_unknown(record: Any, key: str, names: list[str]) -> None:
    """Raise UsageError for a word that changes nothing."""
    table, _, leaf = key.rpartition("__")
    if table in names and not _has_fields(value := _value(record, table)):
        reason = "not given" if value is None else "no table"
        raise UsageError(
            f"{_dotted_key(key)}: {_dotted_key(table)} is {reason}; give the complete table"
        )
    if table not in names:
        table = ""
    beside = [name for name in names if name.rpartition("__")[0] == table]
    by_leaf = {name.rpartition("__")[2]: name for name in reversed(beside if table else names)}
    alike = (
        [name for name in names if name.rpartition("__")[2] == leaf]
        or (difflib.get_close_matches(key, names, n=1) if not table else [])
        or [by_leaf[word] for word in difflib.get_close_matches(leaf, by_leaf, n=1)]
    )
    advice = f"did you mean {phrase(alike)}?" if alike else f"known are {', '.join(beside)}"
    raise UsageError(f"{_dotted_key(key)}: there is no such key; {advice}")


def _value(record: Any, key: str) -> Any:
    for name in key.split("__"):
        record = getattr(record, name)
    return record


def _dotted_key(key: str) -> str:
    return key.replace("__", ".")


def _changed_record(record: Any, changes: dict[str, Any]) -> Any:
    tables: dict[str, dict[str, Any]] = {}
    changed: dict[str, Any] = {}
    for key, value in changes.items():
        name, _, key_within = key.partition("__")
        if key_within:
            tables.setdefault(name, {})[key_within] = value
        else:
            changed[name] = value
    deeper = {name: _changed_record(getattr(record, name), inner) for name, inner in tables.items()}
    return replace(record, **changed, **deeper)
