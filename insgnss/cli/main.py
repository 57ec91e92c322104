"""The command line: verbs, exit codes and what a person sees of a run.

Standard output carries the result (with ``--json`` one JSON document), standard error warnings and
errors, one line each, and on a terminal the step that is running. Where standard error is no
terminal the steps are plain lines among the results instead, so that an error stays the one line it
is. Exit codes: 0 done, 1 a defect of insgnss, 2 wrong use, 3 bad input, 4 the data do not support
the answer, 130 interrupted, 143 terminated by SIGTERM (129 by SIGHUP), after which files are what
they were. Nothing heavy is imported before a verb needs it.
"""

import argparse
import gc
import os
import sys
import traceback
import warnings
from collections.abc import Callable, Sequence
from functools import partial
from glob import glob
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn

from ..base import __version__
from ..base.advance import listening
from ..base.caches import settle
from ..base.errors import DataError, InputError, InsgnssError
from ..base.files import refuse_other_than_utf8
from ..base.inputs import reading
from ..base.interrupts import Terminated, ignore_endings, raise_on_termination
from ..base.memory import keep_freed, out_of_memory
from ..base.received.trusted import trusting, words_as_paths
from .console import Parser, Progress, report_error

INTERRUPTED = 130  # exit code: 128 and the number of SIGINT, as shells have it
SHELLS = ("bash", "zsh", "fish", "powershell", "tcsh")
VERBS = {
    "demo": "simulate a short flight, process it, print the errors against truth, leave the report",
    "simulate": "write a simulated data set in the published tree, with the truth beside it",
    "inspect": "describe a recording (files, units, axes, clocks, noise, plausibility) and draft"
    " its flight file",
    "process": "compute exterior orientation, trajectory and report from raw data",
    "verify": "check a part of a flight against a textbook implementation (largest difference in"
    " sigmas), or RINEX observations against a second reader",
    "export": "write the master exterior orientation in the format of a bundle adjustment",
    "adjust": "adjust an image block with aerial control: integrated sensor orientation",
    "targets": "find ground points in photographs: predict them with their covariance, measure them"
    " to a tenth of a pixel",
    "calibrate": "estimate the lever arms of the mounting (with a verdict on each component) or the"
    " errors of the IMU",
    "camera": "read calibrated cameras of any program, compare them in pixels, and convert them",
    "tune": "estimate a noise model and its uncertainty from static recordings of an IMU or from"
    " the innovations of a flight",
    "compare": "compare two exterior orientations or trajectories, and name the wrong convention"
    " that explains their differences",
    "ppk": "compute antenna positions with realistic covariances from RINEX of rover and base, by"
    " RTKLIB",
    "figures": "the charts of a page of insgnss as PDF, SVG or PNG, one file a chart",
    "report": "a page of insgnss as PDF: the summary to hand over, with its appendix where asked"
    " for",
    "batch": "process the flights of a season in parallel, skip those already processed, and write"
    " one table and page",
    "archive": "check by hashes and versions that every result below a directory can be reproduced"
    " from its inputs",
    "doctor": "show versions and what is missing, and test the compiled core; for reports of"
    " errors",
}
"""What each verb does, in the order of the help. It is the `VERB` of the module of its name, which
is imported when a command begins with it."""
FOLDERS = {"batch": "season", "archive": "season", "figures": "pages", "report": "pages"}
"""Folders of verbs whose modules stand in one."""


def run() -> NoReturn:
    """The program `insgnss`: one command in a process of its own."""
    if "_ARGCOMPLETE" in os.environ:
        _complete()
    os.environ.setdefault(
        "OPENBLAS_NUM_THREADS", "1"
    )  # the matrices are 30 x 30: more threads only spin
    raise_on_termination()
    keep_freed()
    gc.disable()  # a run makes few cycles and ends soon; looking for them takes a tenth of its time
    code = main(expand_arguments(sys.argv[1:]) if os.name == "nt" else None)
    gc.freeze()  # nor is there anything to look for at the end
    ignore_endings()
    sys.exit(code)


def expand_arguments(arguments: Sequence[str]) -> list[str]:
    """Return the words of a command with patterns of files (flight*.csv) replaced by the files.

    The shells of Windows leave that to the program. A pattern that fits nothing stays.
    """
    files = ((word, [] if word.startswith("-") else sorted(glob(word))) for word in arguments)
    return [each for word, match in files for each in (match if "*" in word and match else [word])]


def _run_verb(argv: Sequence[str], progress: Progress) -> int:
    try:
        options = build_parser().parse_args(argv)
    except SystemExit as request:  # --help and --version
        return int(request.code or 0)
    refuse_other_than_utf8([*argv, os.path.abspath(".")])
    if line := settle():
        warnings.warn(line, stacklevel=2)
    with reading():
        code: int = options.run(options, progress)
    return code


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code.

    `argv` without the program's name, of the process by default.
    """
    argv = list(sys.argv[1:] if argv is None else argv)
    as_json, debug = "--json" in argv, "--debug" in argv
    progress = Progress(
        sys.stderr, None if as_json else sys.stdout, quiet="--quiet" in argv or "-q" in argv
    )
    with warnings.catch_warnings(), listening(progress.share):
        warnings.showwarning = _warn_in_one_line(progress)
        try:
            with trusting(words_as_paths(argv)):
                code = _run_verb(argv, progress)
            sys.stdout.flush()
        except BrokenPipeError:  # the reader of our output has seen enough
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            code = 0
        except (Exception, KeyboardInterrupt) as error:
            code, line = _verdict(error)
            progress.clear()
            if debug:
                traceback.print_exc()
            report_error(line, code, as_json)
    return code


def _verdict(error: BaseException) -> tuple[int, str]:
    """Exit code and one line for what ended the run."""
    if isinstance(error, InsgnssError):
        return error.exit_code, f"error: {error}"
    if isinstance(error, MemoryError):
        return DataError.exit_code, f"error: {out_of_memory(error)}"
    if isinstance(error, OSError):
        where = f"{error.filename}: " if error.filename else ""
        return (
            InputError.exit_code,
            f"error: {where}{error.strerror or error}; check path, permission and free space",
        )
    if isinstance(error, Terminated):
        return error.exit_code, "error: terminated"
    if isinstance(error, KeyboardInterrupt):
        return INTERRUPTED, "error: interrupted"
    frames = traceback.extract_tb(error.__traceback__)
    package_frames = [
        frame for frame in frames if Path(__file__).parents[1] in Path(frame.filename).parents
    ] or frames
    location = f"{package_frames[-1].filename}:{package_frames[-1].lineno}"
    return (
        InsgnssError.exit_code,
        (
            f"internal error: {type(error).__name__}: {error} (at {location}); this is a"
            " defect of insgnss: report it with the traceback (--debug) and what `insgnss"
            " doctor` prints"
        ),
    )


def _warn_in_one_line(progress: Progress) -> Callable[..., None]:
    def show(message: Warning | str, category: type[Warning], *where: Any, **more: Any) -> None:
        progress.clear()
        print(f"insgnss: warning: {' '.join(str(message).split())}", file=sys.stderr)

    return show


class _PrintCompletion(argparse.Action):
    """Prints the shell's part of the completion, and ends as --version does."""

    def __call__(self, parser: Any, options: Any, value: Any, name: str | None = None) -> None:
        from argcomplete import shell_integration

        print(shell_integration.shellcode(["insgnss"], shell=value))
        parser.exit()


def _complete() -> None:
    """Answer a shell that asks, in its environment, how the words before the cursor go on."""
    import argcomplete

    parser = build_parser()
    todo: list[argparse.ArgumentParser] = [parser]
    while todo:  # a verb's arguments are added when it is first used
        each = todo.pop()
        if isinstance(each, Parser):
            each.complete()
            each.rearranged = None
        for action in each._actions:
            if isinstance(action, argparse._SubParsersAction):
                todo += action.choices.values()
            elif each.prog.endswith(" export") and action.dest == "format":
                action.completer = _formats  # type: ignore[attr-defined]
    argcomplete.autocomplete(parser, always_complete_options="long")  # ends the process


def _formats(**_: Any) -> list[str]:
    from ..io.formats.exports import EXPORTS
    from ..noise.processes.consumers import CONSUMER_FORMS

    return sorted({*EXPORTS, *CONSUMER_FORMS})


def build_parser() -> Parser:
    """Return the parser of the command line; a verb's module is imported when it is first used."""
    parser = Parser(
        prog="insgnss",
        description=(
            "From a mapping drone's raw IMU and GNSS data to the exterior orientation of every"
            " image."
        ),
        epilog=(
            "exit codes: 0 done, 2 wrong use, 3 bad input, 4 the data do not support the"
            " answer\nfirst steps: insgnss demo"
        ),
    )
    parser.add_argument("--version", action="version", version=f"insgnss {__version__}")
    shells = parser.add_argument(
        "--completion",
        action=_PrintCompletion,
        choices=SHELLS,
        help="print the completion script of this shell and end",
    )
    shells.metavar = "SHELL"
    verbs = parser.add_subparsers(metavar="VERB", required=True, dest="verb", parser_class=Parser)
    for name, clause in VERBS.items():
        verbs.add_parser(name, help=clause, later=partial(_declare, name))
    return parser


def _declare(name: str, parser: Parser) -> None:
    """Give the parser of a verb what the verb's module declares."""
    module = f".{FOLDERS[name]}.{name}" if name in FOLDERS else f".{name}"
    import_module(module, __package__).VERB.declare(parser, VERBS[name])
