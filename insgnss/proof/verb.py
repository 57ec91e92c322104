"""`insgnss export --proof FORMAT DIR`: the two positional arguments of the verb are those."""

import argparse
from collections.abc import Callable
from pathlib import Path

from ..errors import UsageError
from ..exporting.export import known_format
from ..exporting.verb import ExportResult, frame_kind


def proof_verb(given: argparse.Namespace, progress: Callable[[str], None]) -> ExportResult:
    """Write the scene. Raises UsageError for options that have no meaning with it."""
    from .write import write_proof

    name, directory = str(given.eo), Path(given.format)
    known_format(name)
    if given.out or given.settings:
        raise UsageError("export: with --proof neither --out nor --set has a meaning; the scene goes into DIR")
    progress("writing the scene")
    frame = frame_kind(given.frame)
    return ExportResult(name, tuple(write_proof(name, directory, given.crs, given.geoid, frame, given.ground)))
