"""Apply the rules of the table, and say in a sentence which of them acted.

A file may hold positions with too few digits for what they claim. Receivers print 1e-7 deg (1.1
cm), decimetres, or a ten-thousandth of a minute (18 cm). Rounding to a step q adds an error of
variance q^2 / 12 where the position moves or scatters by more than a step; while the same number
comes again and again, its error does too, and n such fixes say no more than one,

    var = n q^2 / 12                                                                           (Q.1)

for each of a run of n equal numbers. It is added where a single rounding is as large as a third of
what a fix claims; below that it is in the claim's own uncertainty.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ....base.errors import InputError
from ....base.findings.remedies import join_remedies
from ....geodesy.earth import curvature_radii
from ....records import Array, GnssFixes, Question
from ....records.variances import decimal_step
from ..stuck_channels import run_edges
from .classes import base_distance, calibrate
from .numbers import CALIBRATED_ORIGIN, FIX_CLASSES, MEASURED, CalibrationNumbers, Triple
from .quality import with_floors, without_worthless

PROBED = 2000  # positions that show the step
LARGEST_M, SMALLEST_STEP_M = 20.0, 1e-4  # of a step that is looked for
EXACT_M = 1e-6  # off the multiples of a step: conversions of units, no measurement
COUNTS = 0.3  # of the sigma, from which on a rounding is added
# m: sigma that a run's rounding adds at most: decimetres with few digits are not to be taken for
# code solutions (`navigation.filter.epochs.CODE_M`)
MOST_M = 0.35


def with_rounding(gnss: GnssFixes) -> GnssFixes:
    """Add the variance of rounded positions (Q.1) to the covariances.

    Parameters
    ----------
    gnss : GnssFixes

    Returns
    -------
    GnssFixes
        With a note of the steps; `gnss` itself where no rounding counts.
    """
    meridian, normal = curvature_radii(gnss.lat[0])
    columns = (
        (gnss.lat, float(meridian)),
        (gnss.lon, float(normal * np.cos(gnss.lat[0]))),
        (gnss.height, 1.0),
    )
    variance = np.diagonal(gnss.cov_ned, axis1=1, axis2=2)
    more, steps = np.zeros((gnss.time.size, 3)), [0.0, 0.0, 0.0]
    for k, (column, metres) in enumerate(columns):
        scales = (1.0,) if k == 2 else (np.degrees(1.0), 60.0 * np.degrees(1.0), 1.0)
        step = metres * max(rounding_step(column * s, metres / s) / s for s in scales)
        if step**2 / 12.0 > COUNTS**2 * np.median(variance[:, k]):
            steps[k] = step
            most = max(1.0, MOST_M**2 / (step**2 / 12.0))
            lengths = np.diff(run_edges(column))
            more[:, k] = step**2 / 12.0 * np.minimum(np.repeat(lengths, lengths), most)
    if not any(steps):
        return gnss
    shown = " / ".join(f"{100.0 * step:.2g}" for step in steps)
    expected = f"steps below {COUNTS * np.sqrt(12.0):.1g} standard deviations"
    note = Question("GNSS quality", expected).note(
        f"positions are rounded to {shown} cm (north, east, height), which their standard "
        "deviations do not cover; these were enlarged by the rounding",
        "write the positions with more digits (9 decimals of a degree, millimetres of height)",
    )
    cov = gnss.cov_ned + more[:, :, None] * np.eye(3)
    return replace(gnss, cov_ned=cov, notes=(*gnss.notes, note))


def rounding_step(column: Array, metres: float) -> float:
    """Return the decimal step of which all values are multiples; 0 where there is none.

    Parameters
    ----------
    column : ndarray, shape (n,)
    metres : float
        Of its unit.

    Returns
    -------
    float
        In units of the column.
    """
    probed = column[np.linspace(0, column.size - 1, PROBED).astype(np.int64)]
    return decimal_step(probed, LARGEST_M / metres, SMALLEST_STEP_M / metres, EXACT_M / metres)


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
    acted = [_source_sentence(fixes, rules)]
    if rules.numbers is not None and rules.ppk is None:
        fixes, counts = with_calibration(fixes, rules.numbers, rules.required)
        acted += [f"calibrated by class ({_classes(counts, rules.numbers)})"] if counts else []
    if len(acted) > 1 or rules.ppk is not None:
        fixes = replace(fixes, source_format=CALIBRATED_ORIGIN)
    floored = with_floors(fixes, rules.floors)
    raised = _count_enlarged(fixes, floored)
    kept = without_worthless(floored)
    rounded = with_rounding(kept)
    acted += [
        f"{raised} of {len(fixes)} raised to gnss.quality_sigma_m",
        f"{len(floored) - len(kept)} left out",
        f"{_count_enlarged(kept, rounded)} enlarged by the rounding of their positions",
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
    last = replace(
        last, remedy=join_remedies((last.remedy, KEEP_SIGMAS), "; ") if last.remedy else ""
    )
    counts = {name: int((kind == k).sum()) for k, name in enumerate(FIX_CLASSES)}
    return replace(calibrated, notes=(*before, last)), counts


def _source_sentence(fixes: GnssFixes, rules: CovarianceRules) -> str:
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


def _count_enlarged(before: GnssFixes, after: GnssFixes) -> int:
    """Count the fixes whose covariance changed."""
    return int((before.cov_ned != after.cov_ned).any(axis=(1, 2)).sum())
