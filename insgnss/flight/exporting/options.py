"""Options of a format as texts, `--set KEY=VALUE`.

They are turned into what the annotations of its writer say, or refused in one line.
"""

import inspect
import math
from collections.abc import Callable
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin

from ...base.errors import UsageError
from ...io.formats.exports import Export
from ...navigation.orient.relative import relative_control


def typed_options(name: str, form: Export, texts: dict[str, str]) -> dict[str, Any]:
    """The options of format `name`, each of the type that its writer takes.

    Those that it does not take stay as they are. A camera may be a TOML file, such as camera.toml
    of `insgnss adjust`.

    Raises
    ------
    UsageError
        For a text that is no such value: a number that is none or not finite, a word that is not
        one of those known.
    """
    parameters = {
        **inspect.signature(relative_control).parameters,
        **inspect.signature(form.write).parameters,
    }
    if (camera := texts.get("camera", "")).lower().endswith(".toml"):
        from ...io.formats.blocks.camera_files import colmap_words
        from ...io.formats.blocks.camera_toml import read_camera_toml

        texts = texts | {"camera": colmap_words(read_camera_toml(camera))}
    return {
        key: (
            _typed(f"export: {name}: {key}", text, parameters[key].annotation)
            if key in form.options and key in parameters
            else text
        )
        for key, text in texts.items()
    }


def _typed(who: str, text: str, annotation: Any) -> Any:
    union = get_origin(annotation) in (Union, UnionType)
    kinds = get_args(annotation) if union else (annotation,)
    words = [str(word) for kind in kinds if get_origin(kind) is Literal for word in get_args(kind)]
    if words:
        if text not in words:
            raise UsageError(f"{who} {text!r} is unknown; it is one of {', '.join(words)}")
        return text
    for kind, read, noun in READ:
        if kind in kinds:
            try:
                return read(text)
            except ValueError:
                raise UsageError(f"{who} {text!r} is no {noun}") from None
    return text


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError
    return value


def _truth(text: str) -> bool:
    if text.lower() not in ("true", "false"):
        raise ValueError
    return text.lower() == "true"


READ: tuple[tuple[type, Callable[[str], Any], str], ...] = (
    (str, str, "text"),
    (bool, _truth, "true or false"),
    (float, _finite, "finite number, such as 3.5"),
    (int, int, "whole number, such as 3"),
)
"""Type, how to read it, what it is; text comes first, as a writer that takes it reads it itself."""
