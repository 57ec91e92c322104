"""The verb `tune`: static recordings or a flight."""

import argparse
from collections.abc import Callable
from typing import TYPE_CHECKING

from ..errors import UsageError
from .options import TuneOptions, options_of

if TYPE_CHECKING:
    from .in_flight import FlightTuning
    from .result import TuneResult
    from .several import SeveralTuned


def tune(given: argparse.Namespace, progress: Callable[[str], None]) -> "TuneResult | FlightTuning | SeveralTuned":
    """Do what the parsed command line asks for. Raises UsageError for what does not go together."""
    if given.flight is not None and given.static:
        raise UsageError(f"tune: both static recordings ({given.static[0]}) and --flight are given; choose one of them")
    if given.flight is None and not given.static:
        raise UsageError("tune: give static recordings, or --flight FLIGHT; see insgnss tune --help")
    options = options_of(given)
    if given.flight is None:
        if given.parameters:
            raise UsageError("tune: --parameters belongs to --flight; --model names the processes of static recordings")
        from .static import tune_static

        return tune_static(given.static, options, given.out, given.force, progress)
    if options != TuneOptions():
        raise UsageError("tune: with --flight only --parameters, --out and --force have a meaning; the flight file says the rest")
    from ..config.load import load_flight
    from .several import tune_each

    names = [name.strip() for name in given.parameters.split(",")] if given.parameters else None
    return tune_each(load_flight(given.flight), given.out, names, progress, given.force)
