"""What the verbs of the command line share: their declaration, and how a result is shown."""

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from ..base.errors import InsgnssError
from ..flight.config.command_line import add_options, made_of
from .console import Parser, Progress, fit_to_width, print_json, report_error


class Result(Protocol):
    """What every verb's result offers: a text for the terminal, and a document for `--json`."""

    def summary(self) -> str:
        """Return the text for the terminal."""

    def as_dict(self) -> dict[str, Any]:
        """Return the document for machines."""


@dataclass(frozen=True)
class Judged:
    """A result with what it refuses, an error of `files`, which becomes the exit code."""

    result: Result
    refusal: InsgnssError | None
    files: tuple[Path, ...] = ()


@dataclass(frozen=True)
class Message:
    """A result that is a text and a document."""

    text: str
    document: dict[str, Any]

    def summary(self) -> str:
        """Return the text for the terminal."""
        return self.text

    def as_dict(self) -> dict[str, Any]:
        """Return the document for machines."""
        return self.document


@dataclass(frozen=True)
class Verb:
    """One verb of the command line.

    Attributes
    ----------
    name : str
        The word that a user types.
    example : str
        Commands that work, one a line.
    arguments : tuple of type, or callable
        The dataclasses that declare the verb's options, or what adds them to its parser.
    run : callable, or None
        Does what the parsed command line asks for; returns the result, which is shown. It finds the
        value of each declared option, its default where nobody gave it, and in `records` the
        dataclasses.
        None where only the verbs below it do something.
    more_help : callable, optional
        Gives the text behind the help, only when help is asked for.
    """

    name: str
    example: str
    arguments: tuple[type, ...] | Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace, Progress], Result | Judged] | None
    more_help: Callable[[], str] | None = None

    def declare(self, parser: Parser, clause: str, below: bool = False) -> None:
        """Give a parser the help and the arguments of this verb.

        Parameters
        ----------
        parser : Parser
            The parser that a command of this verb goes through.
        clause : str
            What the verb does, in words that begin in lower case.
        below : bool
            Whether it stands below another verb, before whose name common options may stand, too.
        """
        parser.description = f"{clause[0].upper()}{clause[1:]}."
        parser.epilog, parser.more_help = f"example:\n{self.example}", self.more_help
        default = argparse.SUPPRESS if below else False
        for names, meaning in (
            (("--json",), "print the result as JSON"),
            (("-q", "--quiet"), "do not print the steps while it runs"),
            (("--debug",), "print the traceback of an error"),
        ):
            parser.add_argument(*names, action="store_true", default=default, help=meaning)
        if isinstance(self.arguments, tuple):
            add_options(parser, self.arguments)
        else:
            self.arguments(parser)
        if self.run is not None:
            parser.set_defaults(run=self._checked_run)

    def _checked_run(self, options: argparse.Namespace, progress: Progress) -> int:
        """Run the verb with its options as their records have them, defaults filled in."""
        if isinstance(self.arguments, tuple):
            options.records = {kind: made_of(kind, options) for kind in self.arguments}
            for record in options.records.values():
                vars(options).update(vars(record))
        return _show(options, progress, self.run(options, progress)) if self.run else 0


def _show(options: argparse.Namespace, progress: Progress, result: Result | Judged) -> int:
    """Print a result as text or JSON, its refusal as one line on standard error.

    Return the exit code.
    """
    refusal, error = None, ""
    if isinstance(result, Judged):
        refusal, files = result.refusal, ", ".join(map(str, result.files))
        result, error = result.result, f"{files}: {refusal}" if files else str(refusal)
    progress.clear()
    if options.json:
        refused = {} if refusal is None else {"error": error, "exit_code": refusal.exit_code}
        print_json(result.as_dict() | refused)
    else:
        print(fit_to_width(result.summary(), None if sys.stdout.isatty() else 0))
    if refusal is None:
        return 0
    report_error(f"error: {error}", refusal.exit_code, as_json=False)
    return refusal.exit_code
