"""The command line: `main` has the parser and the exit codes; every verb has its own module.

It imports every wing but `records` and `geodesy`; `insgnss/__main__.py` alone imports it. Help
loads the standard library only: a verb imports its room when it runs, not before.

The way of the data: `run` in `main.py` is the program. It loads the module of the verb, which adds
its options to the parser, calls a room with them and shows the result: a text on standard output,
or with `--json` one document. What ends the run becomes one line and an exit code there.

Where to look
    a new verb: a module with a `VERB`, its name in `VERBS` of `main.py`; all steps under "How to
        add" in `docs/ARCHITECTURE.md`
    a verb with verbs below it: `calibrate/` (lever arms, mounting, IMU)
    the verbs of many flights, `batch` and `archive`: `season/`; of pages, `figures` and `report`:
        `pages/`
    what a verb declares, and how a result is shown: `verb.py`
    exit codes, interruption, completion for shells: `main.py`
    the parser's messages and the lines of progress: `console.py`
    options that are keys of the flight file: `insgnss/flight/config/command_line.py`
"""

from .main import build_parser, main, run

__all__ = ["build_parser", "main", "run"]
