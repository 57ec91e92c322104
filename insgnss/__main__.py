"""``python -m insgnss`` is the command line."""

from .cli import run

run()
