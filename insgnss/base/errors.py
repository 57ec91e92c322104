"""The one family of errors, each with the exit code that the command line gives for it.

The message is one line that names file and line, time, value, limit and the next thing to try, as
far as they apply.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from types import MappingProxyType
from typing import Any, TypeVar

from .received.trusted import contents_withheld, instead, without_text
from .wording import setting, spell

UNSET: Any = object()
WORDS_SHOWN = 120  # characters of a library's message: the rest is its own affair (chosen)
_ENDS = re.compile("[\n\r\v\f\x1c-\x1e\x85\u2028\u2029]+")


Advised = TypeVar("Advised", bound="InsgnssError")


class InsgnssError(Exception):
    """Root of all errors that the package raises on purpose.

    A message that begins with a file shows no text of it where the file is not trusted
    (`trusted`).
    """

    exit_code = 1
    problem = location = ""

    @classmethod
    def advised(cls: type[Advised], problem: str, remedy: str) -> Advised:
        """Error that holds its `problem` apart, for who has a remedy of his own."""
        error = cls(f"{problem}; {remedy}")
        error.problem = problem
        return error

    def __init__(self, *args: Any) -> None:
        super().__init__(*(without_text(arg) if isinstance(arg, str) else arg for arg in args))


class UsageError(InsgnssError):
    """The command or the flight file asks for something that does not exist."""

    exit_code = 2


class OptionError(UsageError):
    """An option has a value that it cannot have, or does not go with another one.

    The message names the option as the caller writes it (`insgnss.base.wording`). A border that
    knows more, such as the line of a flight file, takes `key` and `problem` and says it by itself.

    Parameters
    ----------
    key : str
        The option by its key in the flight file, such as "gnss.max_age_s".
    problem : str
        What is wrong, and what to do.
    value : Any
        The value, where the message is to show it.
    """

    def __init__(self, key: str, problem: str, value: Any = UNSET) -> None:
        self.key, self.problem, self.value = key, problem, value
        option = spell(key) if value is UNSET else setting(key, value)
        super().__init__(f"{option}: {problem}")

    def __reduce__(self) -> tuple[Any, ...]:
        """Return what makes it again, in another process too; the message as it was."""
        return _option_error, (self.key, self.problem, str(self))


def _option_error(key: str, problem: str, message: str) -> OptionError:
    error = OptionError(key, problem)
    error.args = (message,)
    return error


class InputError(InsgnssError):
    """An input file or a value in it is wrong.

    Attributes
    ----------
    findings : mapping
        What a run had found by then, as its report would say it; empty of most errors.
    key, problem : str
        The value, of `of_value`, and what is wrong, without `location` (file and line) and remedy.
    """

    exit_code = 3
    findings: Mapping[str, Any] = MappingProxyType({})
    key = ""

    @classmethod
    def of_value(cls, key: str, problem: str) -> "InputError":
        """Error that names a value; who knows the line of `key` says `problem` there."""
        error = cls(f"{key}: {problem}")
        error.key, error.problem = key, problem
        return error

    @classmethod
    def at_line(
        cls, path: object, line: int | None, problem: str, remedy: str = ""
    ) -> "InputError":
        """Error that names the file, and the line counted from 1 where one is known.

        What ends lines, out of a name or a value of the file, becomes a blank.
        """
        problem = _ENDS.sub(" ", instead(path) if contents_withheld(path) else problem)
        location = f"{path}:{line}" if line is not None else f"{path}"
        error = cls(_ENDS.sub(" ", f"{location}: {problem}" + (f"; {remedy}" if remedy else "")))
        error.problem, error.location = problem, location
        return error

    @classmethod
    def in_file(cls, path: object, problem: str) -> "InputError":
        """Error that names the file, of which no line is to blame."""
        return cls.at_line(path, None, problem)

    @classmethod
    def unread(
        cls, path: object, error: OSError, advice: str = "check path and permission"
    ) -> "InputError":
        """Error for a file that the system does not read, in its words."""
        return cls.in_file(path, f"cannot be read: {error.strerror or error}; {advice}")


class DataError(InsgnssError):
    """The input is well formed, but the data do not support the answer.

    A file that is well formed is what the flight file says it is, and no text of others.
    """

    exit_code = 4

    def __init__(self, *args: Any) -> None:
        Exception.__init__(self, *args)


@contextmanager
def required_library(problem: str, path: object = None) -> Iterator[None]:
    """Refuse the import of a library that is not installed.

    Parameters
    ----------
    problem : str
        Who needs which library, and how to get it.
    path : path, optional
        The file that needs it.

    Raises
    ------
    InputError
        It is not there, and a file needs it.
    UsageError
        It is not there, and no file is named.
    """
    try:
        yield
    except ImportError:
        error = UsageError(problem) if path is None else InputError.at_line(path, None, problem)
        raise error from None


@contextmanager
def legible(path: object, problem: str, *passing: type[Exception]) -> Iterator[None]:
    """Refuse a file that a library cannot read: a damaged one makes it fail in any way.

    Parameters
    ----------
    path : path
        The file.
    problem : str
        What is wrong and what to do; `{}` stands for the library's words.
    *passing : type of Exception
        Errors that are raised as they are, besides those of the package.

    Raises
    ------
    InputError
        The library fails.
    """
    raised: tuple[type[Exception], ...] = (InsgnssError, *passing)
    try:
        yield
    except raised:
        raise
    except Exception as error:
        raise InputError.at_line(path, None, problem.format(words_of(error))) from None


def unwritten_error(path: object, error: OSError, advice: str, done: str = "written") -> UsageError:
    """Return the error for a file that the system does not write, in its words."""
    return UsageError(f"{path}: cannot be {done}: {error.strerror or error}; {advice}")


@contextmanager
def writing(path: object, advice: str, done: str = "written") -> Iterator[None]:
    """Raise UsageError, `unwritten_error`, where the system refuses."""
    try:
        yield
    except OSError as error:
        raise unwritten_error(path, error, advice, done) from None


def words_of(error: Exception) -> str:
    """Return what a library says, on one line and cut to a length, or the error's name."""
    text = " ".join(str(error).split())[:WORDS_SHOWN]
    if isinstance(error, MemoryError):
        text = "a record takes more memory than there is"
    return "".join(c if c.isprintable() else "?" for c in text) or type(error).__name__


def nearest(word: str, choices: Iterable[str], likeness: float = 0.6) -> str:
    """Return the choice that a word is nearly; an empty text where it is like none."""
    import difflib

    names = list(choices)
    similar = difflib.get_close_matches(word, names, n=1, cutoff=likeness)
    return next(iter(similar or difflib.get_close_matches(word.lower(), names, n=1)), "")


def near(word: str, choices: Iterable[str], likeness: float = 0.6) -> str:
    """Return advice for a word that is not known: the nearest choice, or all of them."""
    names = list(choices)
    similar = nearest(word, names, likeness)
    return f"did you mean {similar!r}?" if similar else f"known are {', '.join(names)}"
