"""What a person sees of a run while it runs, and the parser of the command line.

The parser complains as the rest of the program does. Nothing is coloured, so that NO_COLOR has
nothing to switch off; the only control sequence is that of the line that renews itself.
"""

import argparse
import os
import re
import time
from collections.abc import Callable
from typing import Any, NoReturn, TextIO

from ..base.errors import UsageError


class Progress:
    """Says which step runs: one line that renews itself on a terminal, else a line a step.

    A terminal that knows no control sequences (TERM=dumb) gets a line a step as well. Silent where
    `lines` is None.

    Parameters
    ----------
    terminal : standard error.
    lines : where plain lines go when it is no terminal.
    """

    def __init__(self, terminal: TextIO, lines: TextIO | None, quiet: bool = False) -> None:
        renews = terminal.isatty() and os.environ.get("TERM") != "dumb"
        self._terminal = terminal if renews and not quiet else None
        self._lines = None if quiet or self._terminal else lines
        self._start = time.monotonic()

    @property
    def renews(self) -> bool:
        """Whether one line renews itself, on a terminal."""
        return self._terminal is not None

    def __call__(self, step: str) -> None:
        """Announce `step`, with the seconds since the start."""
        elapsed = time.monotonic() - self._start
        if self._terminal:
            self._terminal.write(f"\r\x1b[K[{elapsed:6.1f} s] {step}")
            self._terminal.flush()
        elif self._lines:
            print(f"[{elapsed:6.1f} s] {step}", file=self._lines, flush=True)

    def clear(self) -> None:
        """Take the renewing line away."""
        if self._terminal:
            self._terminal.write("\r\x1b[K")
            self._terminal.flush()


class Parser(argparse.ArgumentParser):
    """Parser whose complaints are `UsageError`.

    Its epilog may be a function, called only where help is asked for.

    A word that begins as a negative number does is a value, as in "--origin -46.5,6.5,0", and never
    an option.

    `later` adds arguments, and may set the epilog, when the parser is first used: what it imports
    costs nothing where another verb runs. A verb whose words may stand in an order that argparse
    does not know sets `rearranged`, which is given the parsing, the words and the namespace.
    """

    rearranged: "Callable[[Callable[..., Any], Any, Any], Any] | None" = None

    def __init__(
        self,
        *,
        more_help: Callable[[], str] | None = None,
        later: "Callable[[Parser], None] | None" = None,
        **kwargs: Any,
    ) -> None:
        super().__init__(
            allow_abbrev=False, formatter_class=argparse.RawDescriptionHelpFormatter, **kwargs
        )
        self._negative_number_matcher = re.compile(r"-\.?\d")
        self.more_help = more_help
        self._later = later

    def complete(self) -> None:
        """Add the arguments that are left for later, once."""
        later, self._later = self._later, None
        if later is not None:
            later(self)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        self.complete()
        if self.rearranged is not None:
            return self.rearranged(super().parse_known_args, args, namespace)
        return super().parse_known_args(args, namespace)

    def format_usage(self) -> str:
        self.complete()
        return super().format_usage()

    def format_help(self) -> str:
        self.complete()
        return super().format_help() + ("\n" + self.more_help() if self.more_help else "")

    def error(self, message: str) -> NoReturn:
        raise UsageError(f"{message}; see {self.prog} --help")
