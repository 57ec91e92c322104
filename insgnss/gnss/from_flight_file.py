"""The raw observations of a flight file: solved, as the fixes and exposures that a reader of ready
positions would give.
"""

from dataclasses import fields, replace

from ..base.files import pick_attributes
from ..io.exposures.naming import ImageMatch
from .covariance_model import MODEL, CovarianceModel
from .options import options_at
from .ppk import PpkInput, PpkResult, solve_ppk
from .ppk_options import EngineSettings, RawGnss
from .rinex.camera_events import RoverEvents


def solve_raw_gnss(
    raw: RawGnss,
    covariance: CovarianceModel = MODEL,
    exposures: tuple[RoverEvents, ImageMatch] | bool | None = None,
) -> PpkResult:
    """Solve the raw observations of a flight file by PPK.

    Parameters
    ----------
    raw : RawGnss
        Files and options of the flight file.
    covariance : CovarianceModel
        Model of `navigation.prepare.fix_covariance.classes`.
    exposures : tuple of RoverEvents and ImageMatch, or bool, optional
        Which of the rover's events there must be, and their images; None: those that there are;
        False: another file has them.

    Returns
    -------
    PpkResult
        The result with the exposures of the rover's file, and those of the checks that are not
        notes of these exposures.

    Raises
    ------
    InputError, UsageError, DataError
        As `ppk.solve_ppk` raises them.
    """
    inputs = replace(
        ppk_input(raw),
        covariance=covariance,
        events=exposures if exposures is None else bool(exposures),
    )
    if isinstance(exposures, tuple):
        inputs = replace(inputs, rover_events=exposures[0], match=exposures[1])
    result = solve_ppk(inputs)
    event_notes = () if result.events is None else result.events.notes
    return replace(
        result, checks=tuple(check for check in result.checks if check not in event_notes)
    )


def ppk_input(raw: RawGnss) -> PpkInput:
    """Return the input of the solver that raw observations and their options are."""
    settings = pick_attributes(raw, *(f.name for f in fields(EngineSettings)))
    return PpkInput(
        **pick_attributes(
            raw, "rover", "base", "navigation", "wet_delay", "ionosphere", "atmosphere"
        ),
        options=options_at(raw.base_position, **settings),
        velocity=raw.phase_velocity,
    )
