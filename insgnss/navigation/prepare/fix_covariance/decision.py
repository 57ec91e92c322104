"""Apply the rules of the table, and say in a sentence which of them acted."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ....base.errors import InputError
from ....base.findings.remedies import joined
from ....records import GnssFixes
from .classes import base_distance, calibrate
from .numbers import CALIBRATED_ORIGIN, FIX_CLASSES, MEASURED, CalibrationNumbers, Triple
from .quality import with_floors, without_worthless
from .rounding import with_rounding

KEEP_SIGMAS = (
    "gnss.calibrate_covariance = false leaves the standard deviations as the file has them"
)


@dataclass(frozen=True)
class CovarianceRules:
    """What a flight file says of the rules.

    Parameters
    ----------
    numbers : CalibrationNumbers, optional
        Numbers by which positions of an engine are calibrated, or PPK has done so; None: they are
        taken as they are stated.
    required : bool
        Whether positions that cannot be calibrated are refused.
    floors : mapping of int to tuple of float
        Least standard deviations north, east, down, m, by code of quality.
    ppk : mapping of str to int, optional
        How many fixes of each class PPK has calibrated; None for other sources.
    """

    numbers: CalibrationNumbers | None = None
    required: bool = False
    floors: Mapping[int, Triple] = field(default_factory=dict)
    ppk: Mapping[str, int] | None = None


def decide(fixes: GnssFixes, rules: CovarianceRules) -> tuple[GnssFixes, str]:
    """Decide the covariances of fixes.

    Parameters
    ----------
    fixes : GnssFixes
        Fixes as their source states them.
    rules : CovarianceRules
        What the flight file says of the rules.

    Returns
    -------
    fixes : GnssFixes
        Fixes with the covariances that the filter takes, with notes of what changed.
    sentence : str
        Which rules acted, for the history.

    Raises
    ------
    InputError
        Where positions must be calibrated, and their source lacks quality, satellites or base.
    """
    acted = [_stated(fixes, rules)]
    if rules.numbers is not None and rules.ppk is None:
        fixes, counts = with_calibration(fixes, rules.numbers, rules.required)
        acted += [f"calibrated by class ({_classes(counts, rules.numbers)})"] if counts else []
    if len(acted) > 1 or rules.ppk is not None:
        fixes = replace(fixes, source_format=CALIBRATED_ORIGIN)
    floored = with_floors(fixes, rules.floors)
    raised = _enlarged(fixes, floored)
    kept = without_worthless(floored)
    rounded = with_rounding(kept)
    acted += [
        f"{raised} of {len(fixes)} raised to gnss.quality_sigma_m",
        f"{len(floored) - len(kept)} left out",
        f"{_enlarged(kept, rounded)} enlarged by the rounding of their positions",
    ]
    return rounded, f"covariances of the GNSS positions: {'; '.join(acted)}"


def with_calibration(
    fixes: GnssFixes, numbers: CalibrationNumbers = MEASURED, required: bool = False
) -> tuple[GnssFixes, Mapping[str, int]]:
    """Calibrate the covariances of an engine's fixes, where their source states what that needs.

    Parameters
    ----------
    fixes : GnssFixes
        Fixes as their source states them.
    numbers : CalibrationNumbers
        Scale factors, floors and limits of the classes.
    required : bool
        Whether fixes that cannot be calibrated are refused.

    Returns
    -------
    fixes : GnssFixes
        Calibrated fixes; the same ones without quality, satellites or base.
    counts : mapping of str to int
        Number of fixes of each class; none where they are not calibrated.

    Raises
    ------
    InputError
        Where they are required to be calibrated and cannot be.
    """
    if fixes.base_ecef is None or fixes.satellites is None or fixes.quality is None:
        if required:
            raise InputError.at_line(
                fixes.source,
                None,
                "gnss.covariance calibrates positions with quality, satellites and base (an "
                "RTKLIB .pos with ref pos in its header), which this file lacks; leave "
                "gnss.covariance out, or set gnss.sigma_m or gnss.quality_sigma_m",
            )
        return fixes, {}
    satellites = np.nan_to_num(fixes.satellites)  # a number that is not known confirms nothing
    distance = base_distance(fixes, fixes.base_ecef)
    calibrated, kind = calibrate(fixes, satellites, distance, None, numbers)
    *before, last = calibrated.notes
    last = replace(last, remedy=joined((last.remedy, KEEP_SIGMAS), "; ") if last.remedy else "")
    counts = {name: int((kind == k).sum()) for k, name in enumerate(FIX_CLASSES)}
    return replace(calibrated, notes=(*before, last)), counts


def _stated(fixes: GnssFixes, rules: CovarianceRules) -> str:
    """Say where the covariances come from."""
    if rules.ppk is not None:
        return (
            f"those of PPK, calibrated by class ({_classes(rules.ppk, rules.numbers or MEASURED)})"
        )
    assumed = 0 if fixes.sigma_assumed is None else int(fixes.sigma_assumed.sum())
    if not assumed:
        return "of their source"
    whole = "gnss.sigma_m, their source has none"
    return whole if assumed == len(fixes) else f"of their source, gnss.sigma_m for {assumed}"


def _classes(counts: Mapping[str, int], numbers: CalibrationNumbers) -> str:
    """Name the classes that occur, with the factors and floors of their standard deviations."""
    return ", ".join(
        f"{count} {name}: {_triple(numbers.scale[name])} sigma, floor"
        f" {_triple(numbers.floor_m[name])} m"
        for name, count in counts.items()
        if count
    )


def _triple(values: Triple) -> str:
    """One number where all three are the same."""
    return " / ".join(f"{x:g}" for x in (values if len(set(values)) > 1 else values[:1]))


def _enlarged(before: GnssFixes, after: GnssFixes) -> int:
    """Count the fixes whose covariance changed."""
    return int((before.cov_ned != after.cov_ned).any(axis=(1, 2)).sum())
