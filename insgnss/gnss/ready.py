"""Ready positions of an engine, treated as those of our own runs: the same too small standard deviations, the same wrong integers.

A `.pos` that tells quality, satellites and base (the header's `ref pos`, which RTKLIB writes in its relative modes) has all that
`covariance` asks for. What lacks one of them, as the files do that insgnss itself writes, is left as it is.
"""

from dataclasses import replace

from ..formats._text import Source
from ..formats.rtklib_pos import read_pos_rows
from ..records import GnssFixes
from .covariance import MODEL, CovarianceModel, base_distance, calibrate

ADVICE = "gnss.calibrated = false leaves the standard deviations as the file has them"


def with_calibrated(fixes: GnssFixes, path: Source, model: CovarianceModel = MODEL) -> GnssFixes:
    """Fixes of the `.pos` at `path` with the covariances of `covariance`, where the file tells what that needs."""
    rows = read_pos_rows(path)
    base, satellites = rows.base_ecef, rows.columns.get("ns")
    if base is None or satellites is None or fixes.quality is None:
        return fixes
    found, _ = calibrate(fixes, satellites, base_distance(fixes, base), None, model)
    last = found.notes[-1]
    return replace(found, notes=(*found.notes[:-1], replace(last, advice=f"{last.advice}; {ADVICE}" if last.advice else "")))
