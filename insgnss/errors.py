"""The one family of errors, each with the exit code that the command line gives for it.

The message is one line that names file and line, time, value, limit and the next thing to try, as far as they apply.
"""


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
