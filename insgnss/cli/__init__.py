"""The command line: `main` has the parser and the exit codes; every verb has its own module."""

from .main import build_parser, main, run

__all__ = ["build_parser", "main", "run"]
