"""A shift that all ground control points share, as of another CRS, geoid or datum."""

from dataclasses import dataclass

import numpy as np

from ....records.block import Array
from ...adjust.groups import PointObservation
from ...adjust.unknowns import Key, Unknowns

CONTROL_SHIFT: Key = ("shift of ground control", 0)


@dataclass(frozen=True, eq=False)
class ShiftedPoint:
    """Coordinates of a point, observed with the shift that all ground points share.

    Parameters
    ----------
    group : PointObservation
        The observation without the shift.
    """

    group: PointObservation

    @property
    def name(self) -> str:
        """Name of the variance component."""
        return self.group.name

    @property
    def keys(self) -> tuple[Key, ...]:
        """The point and the shift."""
        return (*self.group.keys, CONTROL_SHIFT)

    @property
    def weight(self) -> Array:
        """Inverse of the covariance of the coordinates, (3, 3)."""
        return self.group.weight

    def linearised(self, values: Unknowns) -> tuple[Array, Array]:
        """Linearise the group; see `ObservationGroup.linearised`.

        Parameters
        ----------
        values : Unknowns
            Where it is linearised.

        Returns
        -------
        e : ndarray, (m,)
            Observed - computed.
        J : ndarray, (m, d)
            d computed / d unknown.
        """
        e, J = self.group.linearised(values)
        return e - values.blocks[CONTROL_SHIFT], np.hstack([J, np.eye(3)])
