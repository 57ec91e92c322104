"""Which program RTKLIB is: the wheel pyrtklib5 (RTKLIB EX 2.5.0; extra [ppk]) or, where it is not
installed, any rnx2rtkp on PATH with the same option file; its options and its version.

A choice that a version does not know RTKLIB writes down before it begins, and it is reported here;
a name that it does not know an rnx2rtkp leaves out without a word, so that names are looked for in
the program itself (2.4.3 b34 lacks pos2-arthresmin and -arthresmax, which are of EX, and refuses
gloarmode=fix-and-hold).
"""

import importlib.util
import re
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

from ...base.errors import OptionError, UsageError
from ...base.wording import DOCTOR
from ...records import Finding, Question
from ..options import EngineOptions
from ..ppk_options import OPTION_NAME
from .worker import nearest

MODULE = "pyrtklib5"
PROGRAM = "rnx2rtkp"
INSTALL = (
    "no GNSS engine: pip install 'insgnss[ppk]' (pyrtklib5), or put RTKLIB's rnx2rtkp (EX 2.5.0 or"
    f" later) on PATH; {DOCTOR}"
)
HOLDS = (2, 5, 0)  # the first version of EX for which the options hold
PROGRAM_LINE = re.compile(r"%\s*program\s*:.*?ver\.\s*(\S.*)")
EX_VERSION = re.compile(r"EX\s*(\d+)\.(\d+)\.(\d+)")
OF_ALL_VERSIONS = b"pos1-posmode"  # an option that every rnx2rtkp has


def engine_command(engine: str = "auto") -> list[str]:
    """Return the beginning of the engine's command line: our worker with pyrtklib5, or an rnx2rtkp.

    Raises
    ------
    UsageError
        Where there is no engine.
    """
    if engine in ("auto", MODULE) and importlib.util.find_spec(MODULE) is not None:
        return [sys.executable, "-m", "insgnss.gnss.engine.worker"]
    if engine == MODULE:
        raise UsageError(INSTALL)
    program = shutil.which(PROGRAM if engine == "auto" else engine)
    if program is None:
        if engine == "auto":
            raise UsageError(INSTALL)
        remedy = f"leave the option out to use {MODULE}, which is installed"
        if importlib.util.find_spec(MODULE) is None:
            remedy = INSTALL
        raise OptionError("gnss.engine", f"no program that can be run; {remedy}", engine)
    return [str(Path(program).resolve())]


def check_names(command: Sequence[str], text: str, options: EngineOptions) -> tuple[Finding, ...]:
    """Check whether an rnx2rtkp knows the options of an option file.

    Its binary holds them as strings.

    Returns
    -------
    tuple of Finding
        A note for options of ours that it does not know, or where a wrapper does not show what the
        program holds.

    Raises
    ------
    OptionError
        For one of `rtklib_options` that it does not know.
    """
    if command[0] == sys.executable:
        return ()
    content = binary(Path(command[0]))
    requested = [line.split("=")[0] for line in text.splitlines()]
    ask = Question("engine options", "options that it knows")
    if OF_ALL_VERSIONS not in content:
        finding = (
            f"{command[0]} does not show whether it knows these options:"
            f" {' '.join(options.rtklib_options)}"
        )
        advice = (
            "an unknown option is ignored without a message; name the program itself, not a"
            " script that calls it"
        )
        return (ask.note(finding, advice),) if options.rtklib_options else ()
    unknown = [name for name in requested if name.encode() + b"\0" not in content]
    if refused := [name for name in unknown if name in options.rtklib_options]:
        names_in_program = re.findall(OPTION_NAME.encode() + rb"(?=\0)", content)
        available = [name.decode() for name in names_in_program]
        problem = f"{command[0]} has no option {refused[0]}{nearest(refused[0], available)}"
        raise OptionError("gnss.rtklib_options", problem)
    if not unknown:
        return ()
    advice = "the engine uses its own defaults instead; RTKLIB EX 2.5.0 knows these options"
    return (ask.note(f"unknown to {command[0]}: {' '.join(unknown)}", advice),)


def binary(program: Path) -> bytes:
    """Return the bytes of the program's file, empty where it may be run but not read."""
    try:
        return program.read_bytes()
    except OSError:
        return b""


def version(path: Path, command: Sequence[str]) -> str:
    """Return the engine and its version, as it writes them into its output."""
    name = MODULE if command[0] == sys.executable else command[0]
    with path.open(encoding="utf-8", errors="replace") as stream:
        match = PROGRAM_LINE.match(next(stream, ""))
    return f"RTKLIB {match[1].strip()} ({name})" if match else f"RTKLIB of unknown version ({name})"


def check_version(engine: str) -> tuple[Finding, ...]:
    """A note where the engine is older than EX 2.5.0, for which the options hold."""
    match = EX_VERSION.search(engine)
    if match and tuple(int(number) for number in match.groups()) >= HOLDS:
        return ()
    advice = (
        "update it: pip install 'insgnss[ppk]'; of a drive with these options RTKLIB 2.4.3 b34 of"
        f" Debian fixed 0.6 %, EX 2.5.0 98 %; {DOCTOR}"
    )
    expected = "RTKLIB EX 2.5.0 or later, for which the options hold"
    return (Question("engine", expected).note(engine, advice),)
