"""Options of a format as texts, `--set KEY=VALUE`.

They are turned into what the annotations of its writer say, or refused in one line.
"""

import inspect
import os
from typing import Any

from ...base.errors import OptionError, UsageError
from ...io.formats.exports import Export
from ...io.options.kinds import OPTION_KINDS, accept_value
from ...io.options.schema import Declared, Option, class_names
from ...navigation.orient.relative import relative_control


def typed_options(name: str, form: Export, texts: dict[str, str]) -> dict[str, Any]:
    """The options of format `name`, each of the type that its writer takes.

    Those that it does not take stay as they are. A camera may be a file of any program that
    `read_camera` knows, such as camera.toml of `insgnss adjust`.

    Raises
    ------
    UsageError
        For a text that is no such value: a number that is none or not finite, a word that is not
        one of those known.
    """
    parameters = {
        **inspect.signature(relative_control).parameters,
        **inspect.signature(form.function).parameters,
    }
    camera = texts.get("camera", "")
    if camera.lower().endswith(".toml") or ("camera" in form.needs and os.path.isfile(camera)):
        from ...io.formats.blocks.camera_files import colmap_words
        from ...io.formats.returned.cameras import read_camera

        texts = texts | {"camera": colmap_words(read_camera(camera))}
    return {
        key: (
            _parse_typed(f"{name}: {key}", text, parameters[key].annotation)
            if key in form.options and key in parameters
            else text
        )
        for key, text in texts.items()
    }


def _parse_typed(name: str, text: str, annotation: Any) -> Any:
    """The value of a text; text is taken first, as a writer that takes it reads it itself."""
    if "str" in class_names(annotation):
        return text
    item = Declared(name, annotation, ..., Option(meaning=""))
    word = OPTION_KINDS[item.kind].word
    try:
        value = word(text)
    except ValueError:
        value = text
    try:
        return accept_value(item, value, name)
    except OptionError as refusal:
        raise UsageError(f"export: {name} = {text!r}: {refusal.problem}") from None
