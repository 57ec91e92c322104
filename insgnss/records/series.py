"""What the filter estimated of the IMU, and how the fixes agreed with it, row by row."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ._checked import Array
from .rows import Rows, RowShapes
from .states import State

DEG_H_OF_RAD_S, MG_OF_MS2 = np.degrees(1.0) * 3600.0, 1e3 / 9.80665
"""deg/h in a rad/s, and mg in a m/s^2."""


@dataclass(frozen=True, eq=False, repr=False)
class ImuBiases(Rows):
    """Smoothed biases of the IMU over time, with their standard deviations, in body axes.

    Parameters
    ----------
    time : (n,) s, GPST.
    gyro : (n, 3) bias of the gyroscopes forward, right, down, rad/s: measured minus true.
    accel : (n, 3) bias of the accelerometers, m/s^2.
    gyro_sigma : (n, 3) standard deviation of `gyro`, rad/s.
    accel_sigma : (n, 3) standard deviation of `accel`, m/s^2.
    gps_week : GPS week of `time`.

    Raises
    ------
    InputError : a shape is wrong, a value is not finite, or time does not increase.
    """

    _ROWS: ClassVar[RowShapes] = {"time": ()} | dict.fromkeys(
        ("gyro", "accel", "gyro_sigma", "accel_sigma"), (3,)
    )
    _NOUN: ClassVar[str] = "epochs"

    time: Array
    gyro: Array
    accel: Array
    gyro_sigma: Array
    accel_sigma: Array
    gps_week: int | None = None

    def _columns(self) -> dict[str, Any]:
        columns: dict[str, Any] = {"tow": self.time}
        for sensor, unit, factor in (("gyro", "deg_h", DEG_H_OF_RAD_S), ("accel", "mg", MG_OF_MS2)):
            for prefix, values in (
                ("", getattr(self, sensor)),
                ("sd_", getattr(self, f"{sensor}_sigma")),
            ):
                columns |= {
                    f"{prefix}{sensor}_{c}_{unit}": factor * values[:, k]
                    for k, c in enumerate("xyz")
                }
        return columns


@dataclass(frozen=True, eq=False, repr=False)
class Innovations(Rows):
    """Position fixes against what the filter predicted of them before it used them.

    Parameters
    ----------
    time : (n,) s, GPST, of the fixes.
    position : (n, 3) measured minus predicted, axes north, east, down of the local frame, m.
    sigma : (n, 3) standard deviation of `position`, m.
    nis : (n,) normalised innovation squared, three degrees of freedom.
    used : (n,) bool, whether the fix passed the gate.
    gps_week : GPS week of `time`.

    Raises
    ------
    InputError : a shape is wrong, a value is not finite, or time does not increase.
    """

    _ROWS: ClassVar[RowShapes] = {
        **{"time": (), "position": (3,), "sigma": (3,), "nis": ()},
        "used": None,
    }
    _NOUN: ClassVar[str] = "fixes"

    time: Array
    position: Array
    sigma: Array
    nis: Array
    used: NDArray[np.bool_]
    gps_week: int | None = None

    def _details(self) -> list[str]:
        return [f"{int(np.count_nonzero(self.used))} used"]

    def _columns(self) -> dict[str, Any]:
        columns: dict[str, Any] = {"tow": self.time}
        for prefix, values in (("", self.position), ("sd_", self.sigma)):
            columns |= {f"{prefix}{axis}_m": values[:, k] for k, axis in enumerate("ned")}
        return columns | {"nis": self.nis, "used": self.used}


@dataclass(frozen=True, eq=False)
class ConstantSeries:
    """Constants estimated besides biases, at m epochs: what the flight knew of them, and when.

    Parameters
    ----------
    states : tuple of State
        (c,) the constants.
    value, sigma : ndarray
        (m, c) smoothed value and standard deviation, SI.
    filter_sigma : ndarray
        (m, c) standard deviation of the forward filter at the time.
    """

    states: tuple[State, ...]
    value: Array
    sigma: Array
    filter_sigma: Array

    @classmethod
    def joined(
        cls, segments: Sequence["ConstantSeries | None"], sizes: Sequence[int]
    ) -> "ConstantSeries | None":
        """Return those of several segments as one; NaN where a segment did not estimate them.

        Parameters
        ----------
        segments : sequence of ConstantSeries or None
            Those of the segments, in the order of time.
        sizes : sequence of int
            Number of epochs of each segment.
        """
        present = [segment for segment in segments if segment is not None]
        states = tuple(dict.fromkeys(state for segment in present for state in segment.states))
        if not states:
            return None
        pieces = [np.full((3, size, len(states)), np.nan) for size in sizes]
        for piece, segment in zip(pieces, segments, strict=True):
            if segment is not None:
                columns = [states.index(state) for state in segment.states]
                piece[:, :, columns] = segment.value, segment.sigma, segment.filter_sigma
        return cls(states, *np.concatenate(pieces, axis=1))
