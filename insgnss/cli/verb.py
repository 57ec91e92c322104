"""What the verbs of the command line share: their declaration, and how a result is shown."""

import argparse
import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from ..base.errors import InsgnssError
from ..base.files import json_ready
from ..flight.config.command_line import add_options, made_of
from .console import Parser, Progress, fitted


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
    what : str
        What it does, as a clause that begins in lower case.
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
    what: str
    example: str
    arguments: tuple[type, ...] | Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace, Progress], Result | Judged] | None
    more_help: Callable[[], str] | None = None

    def add_to(self, verbs: Any, below: bool = False) -> None:
        """Add the parser of this verb to the sub-parsers `verbs`.

        Of a verb `below` another one, common options may stand before its name as well.
        """
        parser: Parser = verbs.add_parser(
            self.name,
            help=self.what,
            description=f"{self.what[0].upper()}{self.what[1:]}.",
            epilog=f"example:\n{self.example}",
            more_help=self.more_help,
            later=self._add_arguments,
        )
        default = argparse.SUPPRESS if below else False
        for names, meaning in (
            (("--json",), "print the result as JSON"),
            (("-q", "--quiet"), "do not print the steps while it runs"),
            (("--debug",), "print the traceback of an error"),
        ):
            parser.add_argument(*names, action="store_true", default=default, help=meaning)
        if self.run is not None:
            parser.set_defaults(run=self._checked_run)

    def _checked_run(self, options: argparse.Namespace, progress: Progress) -> int:
        """Run the verb with its options as their records have them, defaults filled in."""
        if isinstance(self.arguments, tuple):
            options.records = {kind: made_of(kind, options) for kind in self.arguments}
            for record in options.records.values():
                vars(options).update(vars(record))
        return _show(options, progress, self.run(options, progress)) if self.run else 0

    def _add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Add the verb's own options to its parser."""
        if isinstance(self.arguments, tuple):
            add_options(parser, self.arguments)
        else:
            self.arguments(parser)


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
        print(fitted(result.summary(), None if sys.stdout.isatty() else 0))
    if refusal is None:
        return 0
    report_error(f"error: {error}", refusal.exit_code, as_json=False)
    return refusal.exit_code


def print_json(document: Any) -> None:
    """Print a document as JSON on standard output."""
    print(json.dumps(json_ready(document), indent=2, allow_nan=False))


def report_error(line: str, code: int, as_json: bool) -> None:
    """Print an error as one line on standard error; with `as_json` also as JSON.

    The JSON document goes to standard output.
    """
    line = " ".join(line.split())
    print(f"insgnss: {line}", file=sys.stderr)
    if as_json:
        print_json({"error": line.partition("error: ")[2], "exit_code": code})
