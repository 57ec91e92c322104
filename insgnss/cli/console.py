"""What a person sees of a run while it runs, and the parser of the command line.

The parser complains as the rest of the program does. Nothing is coloured, so that NO_COLOR has
nothing to switch off; the only control sequence is that of the line that renews itself.
"""

import argparse
import json
import math
import os
import re
import shutil
import sys
import textwrap
import time
from collections.abc import Callable
from typing import Any, NoReturn, TextIO

from ..base.errors import UsageError
from ..base.files import json_ready
from ..base.wording import duration

LONG_STEP_S = 5.0  # rest of a step (s): a longer one shows how far it is
RENEWED_S = 0.2  # time between two renewals of a terminal's line (s): faster ones flicker
MEASURED_S = 1.0  # time that a speed is taken from (s): a shorter one is a guess
REPEATED_S = 20.0  # time between two plain lines about one step (s): logs stay short


class Progress:
    """Says which step runs: one line that renews itself on a terminal, else a line a step.

    A step that takes longer than `LONG_STEP_S` says how far it is and how much time is left, as far
    as its loops tell (`insgnss.base.advance`): on the line that renews itself, else in a line now
    and then. A terminal that knows no control sequences (TERM=dumb) gets plain lines as well.
    Silent where `lines` is None.

    Parameters
    ----------
    terminal : standard error.
    lines : where plain lines go when it is no terminal.
    """

    def __init__(self, terminal: TextIO, lines: TextIO | None, quiet: bool = False) -> None:
        renews = terminal.isatty() and os.environ.get("TERM") != "dumb"
        self._terminal = terminal if renews and not quiet else None
        self._lines = None if quiet or self._terminal else lines
        self._start = self._written = time.monotonic()
        self._step, self._compiled = "", 0
        self._compiling: str | None = None  # the step of which a plain line has said it
        self._since: tuple[float, float] | None = self._start, 0.0

    @property
    def renews(self) -> bool:
        """Whether one line renews itself, on a terminal."""
        return self._terminal is not None

    def __call__(self, step: str) -> None:
        """Announce `step`, with the seconds since the start."""
        self._step, self._since = step, (time.monotonic(), 0.0)
        self._write(step)

    def share(self, done: float) -> None:
        """Say how far the step is, 0 to 1; NaN while a kernel is compiled.

        Parameters
        ----------
        done : float
            The share that is done; time left follows from it where it is long.
        """
        now = time.monotonic()
        if math.isnan(done):
            self._compiled += 1
            first_compilation, long_ago = (
                self._compiling != self._step,
                now - self._written >= REPEATED_S,
            )
            if first_compilation or self._terminal or long_ago:
                self._compiling = self._step
                counted = self._compiled > 1 and (self._terminal or not first_compilation)
                count = f" ({self._compiled})" if counted else ""
                step = f"{self._step}: " if self._step else ""
                self._write(f"{step}compiling, once after an installation{count}")
            self._since = None
            return
        if self._since is None:  # what was compiled says nothing of the speed
            self._since = now, done
        began, done_before = self._since
        if done <= done_before:  # a loop begins, perhaps long after the step
            self._since = now, done
            return
        if now - began < MEASURED_S:
            return
        remaining = (now - began) * (1.0 - done) / (done - done_before)
        lasts_long = now - began + remaining > LONG_STEP_S
        if lasts_long and now - self._written >= (RENEWED_S if self._terminal else REPEATED_S):
            self._write(f"{self._step}: {100.0 * done:.0f} %, {duration(remaining)} left")

    def _write(self, text: str) -> None:
        self._written = time.monotonic()
        line = f"[{self._written - self._start:6.1f} s] {text}"
        if self._terminal:
            # a line that wraps would not be renewed, but repeated
            self._terminal.write(f"\r\x1b[K{line[: shutil.get_terminal_size().columns - 1]}")
            self._terminal.flush()
        elif self._lines:
            print(line, file=self._lines, flush=True)

    def clear(self) -> None:
        """Take the renewing line away."""
        if self._terminal:
            self._terminal.write("\r\x1b[K")
            self._terminal.flush()


def fit_to_width(text: str, width: int | None = None) -> str:
    """Return a text whose lines a terminal holds, the rest of a long one indented below it.

    Parameters
    ----------
    text : str
        Lines.
    width : int or None
        Characters of a line; None: those of this terminal; 0: lines stay as they are.
    """
    width = shutil.get_terminal_size().columns - 1 if width is None else width
    out = []
    for line in text.split("\n"):
        if not 0 < width < len(line):
            out.append(line)
            continue
        indent = " " * (len(line) - len(line.lstrip()) + 2)
        out += textwrap.wrap(
            line, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
        )
    return "\n".join(out)


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

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse the arguments; name the nearest option where one is unknown."""
        parsed, unknown = self.parse_known_args(args, namespace)
        if unknown:
            import difflib

            parser = self._of(parsed)
            word, options = unknown[0].partition("=")[0], list(parser._option_string_actions)
            similar = difflib.get_close_matches(word, options, 1, 0.75) if word[:1] == "-" else []
            hint = f" (is it {similar[0]}?)" if similar else ""
            parser.error(f"unrecognized arguments: {' '.join(unknown)}{hint}")
        return parsed

    def _of(self, parsed: Any) -> argparse.ArgumentParser:
        """The parser of the verb that was asked for, where there is one."""
        parser: argparse.ArgumentParser = self
        while True:
            below = [a for a in parser._actions if isinstance(a, argparse._SubParsersAction)]
            name = getattr(parsed, str(below[0].dest), None) if below else None
            if not below or not isinstance(name, str):
                return parser
            parser = below[0].choices[name]

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        self.complete()
        if self.rearranged is not None:
            return self.rearranged(super().parse_known_args, args, namespace)
        return super().parse_known_args(args, namespace)

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Refuse a value that is none of the choices and name the nearest one."""
        try:
            super()._check_value(action, value)
        except argparse.ArgumentError as error:
            import difflib

            if similar := difflib.get_close_matches(str(value), map(str, action.choices or ()), 1):
                error.message = f"{error.message.partition(' (')[0]}; did you mean {similar[0]}?"
            raise

    def format_usage(self) -> str:
        self.complete()
        return super().format_usage()

    def format_help(self) -> str:
        self.complete()
        return super().format_help() + ("\n" + self.more_help() if self.more_help else "")

    def error(self, message: str) -> NoReturn:
        raise UsageError(f"{message}; see {self.prog} --help")
