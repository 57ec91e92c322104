"""One run of RTKLIB, in a process of its own:
`python -m insgnss.gnss.engine.worker OPTIONS OUTPUT INTERVAL FILE...`.

RTKLIB keeps its observations in global variables and ends a process that it cannot go on with, so
that no run shares one with another. INTERVAL in s thins the epochs, 0 takes all. Failures are
reported on standard error, with exit code 1, or 2 for an option that this RTKLIB does not have or
whose number it would read as 0. A choice that it does not know RTKLIB itself reports, and goes on
without. That an output was written, and has epochs, is for the caller to see: postpos() returns 0
without them.
"""

import difflib
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

NUMBERS: dict[int, type] = {0: int, 1: float}  # of options by their format; 2 is text, 3 a choice


def main(arguments: list[str]) -> int:
    """Run postpos() on the arguments, and return its exit code."""
    import pyrtklib5 as rtklib

    option_file, output, interval, *files = arguments
    table = rtklib.sysopts
    requested = _options_of(option_file)
    formats = _formats(table)
    unknown = sorted(requested.keys() - formats.keys())
    if unknown:
        return _report_failure(
            f"this version of RTKLIB has no option {unknown[0]}{nearest(unknown[0], formats)}", 2
        )
    not_numbers = [
        f"{name} = {value}"
        for name, value in requested.items()
        if not _is(value, NUMBERS.get(formats[name], str))
    ]
    if not_numbers:
        return _report_failure(
            f"{not_numbers[0]} is not a number as RTKLIB expects it for this option", 2
        )
    rtklib.resetsysopts()
    if not rtklib.loadopts(option_file, table.ptr):
        return _report_failure(f"{option_file}: the options cannot be read")
    processing, solution, paths = rtklib.prcopt_t(), rtklib.solopt_t(), rtklib.filopt_t()
    rtklib.getsysopts(processing, solution, paths)
    unlimited = rtklib.gtime_t(), rtklib.gtime_t()  # start and end of the processing
    status = rtklib.postpos(
        *(*unlimited, float(interval), 0.0, processing, solution, paths),
        *(files, len(files), output, "", ""),
    )
    return _report_failure(f"postpos() returned {status}") if status else 0


def nearest(name: str, candidates: Iterable[str]) -> str:
    """Return advice: the candidate most like `name`, if possible of the same group of options.

    It is "" where none is like it.
    """
    family = name.partition("-")[0]
    same_family = [candidate for candidate in candidates if candidate.partition("-")[0] == family]
    close = [
        *difflib.get_close_matches(name, same_family, n=1),
        *difflib.get_close_matches(name, list(candidates), n=1),
    ]
    return f"; did you mean {close[0]}?" if close else ""


def _options_of(option_file: str) -> dict[str, str]:
    """Return the values of an option file by name, as text."""
    lines = Path(option_file).read_text(encoding="utf-8").splitlines()
    return dict(line.split("=", 1) for line in lines)


def _formats(table: Any) -> dict[str, int]:
    """Formats of values by name in RTKLIB's table of options, which ends with an empty name."""
    formats: dict[str, int] = {}
    while name := table[len(formats)].name.ptr:
        formats[name] = table[len(formats)].format
    return formats


def _is(value: str, kind: type) -> bool:
    """Return whether the text of an option is a number of the kind."""
    try:
        kind(value)
    except ValueError:
        return False
    return True


def _report_failure(message: str, code: int = 1) -> int:
    sys.stderr.write(message + "\n")
    return code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
