"""Ready positions of an engine, treated as those of our own runs: the same too small standard
deviations, the same incorrect ambiguity fixes.

A `.pos` that holds quality, satellites and base (the header's `ref pos`, which RTKLIB writes in its
relative modes) has all that `covariance` asks for. What lacks one of them, as the files do that
insgnss itself writes, is left as it is.
"""

from dataclasses import replace
from pathlib import Path

from ...base.errors import InputError
from ...formats import sniff_gnss
from ...formats.gnss.rtklib_pos import read_pos_rows
from ...formats.text.text import Source
from ...records import GnssFixes
from .covariance import MODEL, CovarianceModel, base_distance, calibrate

ADVICE = "gnss.calibrate_covariance = false leaves the standard deviations as the file has them"


def with_calibrated(fixes: GnssFixes, path: Source, model: CovarianceModel = MODEL) -> GnssFixes:
    """Return the fixes of a file with calibrated covariances, where it holds what that needs.

    Parameters
    ----------
    fixes : GnssFixes
        The fixes of the file.
    path : path-like
        The file.
    model : CovarianceModel
        Limits and scale factors of `quality.covariance`.

    Raises
    ------
    InputError
        Where the model is another than the default one and the file does not hold quality,
        satellites and base.
    """
    rows = read_pos_rows(path) if sniff_gnss(Path(path)) == "rtklib_pos" else None
    base, satellites = (None, None) if rows is None else (rows.base_ecef, rows.columns.get("ns"))
    if base is None or satellites is None or fixes.quality is None:
        if model != MODEL:
            message = (
                "gnss.covariance calibrates positions with quality, satellites and base (an"
                " RTKLIB .pos with ref pos in its header)"
            )
            raise InputError.at_line(
                path,
                None,
                f"{message}, and this file does not; leave it out, or set gnss.sigma_m or"
                " gnss.quality_sigma_m",
            )
        return fixes
    calibrated, _ = calibrate(fixes, satellites, base_distance(fixes, base), None, model)
    last = calibrated.notes[-1]
    return replace(
        calibrated,
        notes=(
            *calibrated.notes[:-1],
            replace(last, advice=f"{last.advice}; {ADVICE}" if last.advice else ""),
        ),
    )
