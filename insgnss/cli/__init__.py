"""The command line: `main` has the parser and the exit codes; beside it stands one module a verb."""

from .main import build_parser, main, run

__all__ = ["build_parser", "main", "run"]
