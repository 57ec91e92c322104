"""What to do about a finding: a setting of an option, an action in words, or several of either.

A remedy holds the option's key and value. It becomes text where it is shown, in the way in which
that caller writes options (`base.wording`): a flight file, a command line, Python.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from string import Formatter
from typing import Any

from ..wording import set_to, spell


@dataclass(frozen=True)
class SetKey:
    """An option and the value that it should have.

    Parameters
    ----------
    key : str
        The option as the flight file calls it: "imu.axes", or "imu.units gyro" of a table's entry.
    value : object
        A value of TOML.
    instead : str
        The value that it was taken for, where that is worth saying.
    """

    key: str
    value: Any
    instead: str = ""

    def __str__(self) -> str:
        """Return the setting as the present caller writes it."""
        return set_to(self.key, self.value, self.instead)


@dataclass(frozen=True, init=False)
class Step:
    """An action in words, with options in braces: `Step("check {imu.columns} or {}", other)`.

    Parameters
    ----------
    words : str
        The action; a key in braces is an option, empty braces are the next of `parts`.
    *parts : object
        Settings, numbers and texts.
    """

    words: str
    parts: tuple[object, ...]

    def __init__(self, words: str, *parts: object) -> None:
        object.__setattr__(self, "words", words)
        object.__setattr__(self, "parts", parts)

    def __str__(self) -> str:
        """Return the action as the present caller names options."""
        return _Words().vformat(self.words, self.parts, {})


Remedy = str | SetKey | Step


def join_remedies(remedies: Sequence[Remedy], by: str = " or ") -> Step:
    """Return several remedies as one.

    Parameters
    ----------
    remedies : sequence of Remedy
        Each of them.
    by : str
        What stands between two.
    """
    return Step(by.join(["{}"] * len(remedies)), *remedies)


class _Words(Formatter):
    """Formats a number or nothing in braces as usual, else the name of an option."""

    def get_field(
        self, field_name: str, args: Sequence[Any], kwargs: Mapping[str, Any]
    ) -> tuple[Any, str]:
        if field_name.isdigit():
            return args[int(field_name)], field_name
        return spell(field_name), field_name
