"""The one family of errors, each with the exit code that the command line gives for it.

The message is one line that names file and line, time, value, limit and the next thing to try, as far as they apply.
"""

from collections.abc import Iterable


class InsgnssError(Exception):
    """Root of all errors that the package raises on purpose."""

    exit_code = 1


class UsageError(InsgnssError):
    """The command or the flight file asks for something that does not exist."""

    exit_code = 2


class InputError(InsgnssError):
    """An input file or a value in it is wrong."""

    exit_code = 3

    @classmethod
    def at(cls, path: object, line: int | None, what: str) -> "InputError":
        """Error that names the file, and the line counted from 1 where one is known."""
        return cls(f"{path}:{line}: {what}" if line is not None else f"{path}: {what}")


class DataError(InsgnssError):
    """The input is well formed, but the data do not support the answer."""

    exit_code = 4


def near(word: str, known: Iterable[str], likeness: float = 0.6) -> str:
    """Advice for a word that is not known: the nearest of the known ones, or all of them."""
    import difflib

    names = list(known)
    close = difflib.get_close_matches(word, names, n=1, cutoff=likeness) or difflib.get_close_matches(word.lower(), names, n=1)
    return f"did you mean {close[0]!r}?" if close else f"known are {', '.join(names)}"
