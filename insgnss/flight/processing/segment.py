"""A segment of a flight between gaps that are not bridged, solved."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ...io.exposures.rig import ExposedRows
from ...navigation.filter.solution import Solution
from ...navigation.innovations.residuals import mean_residuals
from ...records import Finding, GnssFixes, MeanResidual
from ...records.verdicts import Estimate


@dataclass(frozen=True)
class Segment:
    """A solved segment.

    Parameters
    ----------
    solution : Solution
        The smoothed states.
    fixes : GnssFixes
        The fixes of the segment.
    grid : ndarray, shape (k,)
        The epochs of the solution that are those of the output grid.
    at_event : ndarray, shape (e,)
        Which instants of the recording's exposures the segment holds.
    exposed : tuple of ExposedRows
        Which exposures of each camera are at which of these instants.
    history : tuple of str
        What was done, sentence by sentence.
    checks : tuple of Finding
        What the solution says of the flight file.
    time_offset_s : float
        By how much the stamps of the fixes were moved before the solution, s.
    stated : mapping of str to float
        A-priori sigma of constants, by the group of the states, that the flight file states
        without asking for them.
    requested : tuple of str
        Groups of the constants that the flight file has estimated.
    constants : tuple of Estimate
        What the segment alone says of the constants of its fixes.
    """

    solution: Solution
    fixes: GnssFixes
    grid: np.ndarray
    at_event: np.ndarray
    exposed: tuple[ExposedRows, ...]
    history: tuple[str, ...]
    checks: tuple[Finding, ...] = ()
    time_offset_s: float = 0.0
    stated: Mapping[str, float] = field(default_factory=dict)
    requested: tuple[str, ...] = ()
    constants: tuple[Estimate, ...] = ()

    def without_increments(self) -> "Segment":
        """Return the segment without the increments of its IMU."""
        lean = replace(self, solution=self.solution.without_increments())
        lean.__dict__["residuals"] = self.residuals  # they may need covariances that are not kept
        return lean

    @cached_property
    def residuals(self) -> tuple[MeanResidual, ...]:
        """Fixes minus solution, minute by minute."""
        return mean_residuals(self.solution)
