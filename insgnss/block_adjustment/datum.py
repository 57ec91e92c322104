"""Ground control that stands in axes shifted against those of the block."""

from dataclasses import dataclass

import numpy as np

from ..adjust.groups import PointObservation
from ..adjust.unknowns import POINT, Key, Unknowns
from ..records.block import Array

DATUM: Key = ("shift of ground control", 0)


@dataclass(frozen=True, eq=False)
class ShiftedPoint:
    """Coordinates of a point, observed with the shift that all ground points share.

    Parameters
    ----------
    point : int
        Row of the object point.
    position_m : ndarray, (3,)
        Coordinates, m: those of the point and the shift.
    weight : ndarray, (3, 3)
        Inverse of their covariance.
    name : str
        Name of the variance component.
    """

    point: int
    position_m: Array
    weight: Array
    name: str

    @classmethod
    def of(cls, group: PointObservation) -> "ShiftedPoint":
        """Return the same observation with the shift."""
        return cls(group.point, group.position_m, group.weight, group.name)

    @property
    def keys(self) -> tuple[Key, ...]:
        """The point and the shift."""
        return ((POINT, self.point), DATUM)

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
        e = self.position_m - values.point[self.point] - values.blocks[DATUM]
        return e, np.hstack([np.eye(3), np.eye(3)])
