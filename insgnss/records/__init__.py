"""The frozen tables that wings hand to each other, checked once, at birth.

A record holds contiguous float64 arrays that nobody writes to again. Its construction refuses wrong
shapes, values that are not finite and time that does not increase, naming the record, the field,
the row and the time. Readers turn such a refusal into a message with file and line by checking
before they build (`formats`).
"""

from ._checked import Array
from .framed import FramedOrientation, MapFrame
from .from_tables import barometer_heights, camera_events, gnss_fixes, imu_samples
from .observations import (
    QUANTITIES,
    BarometerHeights,
    CameraEvents,
    GnssFixes,
    ImuSamples,
    Increments,
    Quantity,
)
from .rows import Rows
from .series import ImuBiases, Innovations
from .solutions import Diagnostics, ExteriorOrientation, Trajectory
from .variances import WaveletVariance, chi_square_interval
from .verdicts import Check, MeanResidual, StateVerdict, TimeCorrelatedError, Verdict

__all__ = [
    "QUANTITIES",
    "Array",
    "BarometerHeights",
    "CameraEvents",
    "Check",
    "Diagnostics",
    "ExteriorOrientation",
    "FramedOrientation",
    "GnssFixes",
    "ImuBiases",
    "ImuSamples",
    "Increments",
    "Innovations",
    "MapFrame",
    "MeanResidual",
    "Quantity",
    "Rows",
    "StateVerdict",
    "TimeCorrelatedError",
    "Trajectory",
    "Verdict",
    "WaveletVariance",
    "barometer_heights",
    "camera_events",
    "chi_square_interval",
    "gnss_fixes",
    "imu_samples",
]
