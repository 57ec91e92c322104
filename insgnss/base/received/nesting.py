"""JSON out of files: what stands within each other too deep is refused, not followed."""

import json
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..inputs import read_text
from ..units import exact_float

# levels: what people and programs write has below 20, and recursions take 1000
DEEPEST_NESTING = 100


def too_deep(value: object) -> bool:
    """Tell whether tables and lists are nested more than `DEEPEST_NESTING` levels deep."""
    level = [value] if isinstance(value, dict | list) else []
    for _ in range(DEEPEST_NESTING):
        within = (item.values() if isinstance(item, dict) else item for item in level)
        level = [item for items in within for item in items if isinstance(item, dict | list)]
        if not level:
            return False
    return True


def parse_json(path: object, text: str) -> Any:
    """Return the value of the JSON text of a file.

    Raises
    ------
    InputError
        It is no JSON, holds objects or lists within each other more than 100 deep, or a number too
        small for a float, which would become zero.
    """
    try:
        value = json.loads(text, parse_float=exact_float)
    except RecursionError:
        value = None
    except ValueError as error:  # JSONDecodeError, or an integer of thousands of digits
        line, why = getattr(error, "lineno", None), getattr(error, "msg", error)
        raise InputError.at_line(path, line, f"is no JSON: {why}; copy it again") from None
    else:
        if not too_deep(value):
            return value
    problem = f"has objects or lists nested more than {DEEPEST_NESTING} deep"
    raise InputError.in_file(path, f"{problem}; copy it again")


def read_object(path: Path, is_replaced: bool = False) -> dict[str, Any]:
    """Return the JSON object of a file, such as report.json; an empty one where it is none.

    Parameters
    ----------
    path : Path
        The file.
    is_replaced : bool
        Whether it is asked only what the file is that is going to be replaced.

    Raises
    ------
    InputError
        A killed run left it among files of another run, unless it is to be replaced.
    """
    try:
        text = path.read_text(encoding="utf-8") if is_replaced else read_text(path)
    except (OSError, ValueError):
        return {}
    try:
        content = parse_json(path, text)
    except InputError:
        return {}
    return content if isinstance(content, dict) else {}
