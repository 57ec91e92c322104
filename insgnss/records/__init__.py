"""The frozen tables that wings hand to each other, checked once, at birth.

It imports `base` and `geodesy`; every wing above but `cli` imports it.

A record holds contiguous float64 arrays that nobody writes to again. Its construction refuses wrong
shapes, values that are not finite and time that does not increase, naming the record, the field,
the row and the time. Readers turn such a refusal into a message with file and line by checking
before they build (`insgnss/io/formats/`).

The way of the data: `ImuSamples`, `GnssFixes` and `CameraEvents` are recorded, `Increments` are
integrated, `Trajectory` and `ExteriorOrientation` are estimated, `Finding`s are judged.

Where to look
    samples, fixes (with satellites, ratio, age, PDOP), exposures, air pressure: `observations.py`
    a measurement of one's own, and the motion that it predicts from: `measurements.py`
    the same from pandas or a mapping of columns: `from_tables.py`
    trajectory, exterior orientation, diagnostics: `solutions.py`; between epochs `interpolation.py`
    biases of the IMU and innovations, row by row: `series.py`
    rows by name, index, mask and time, and tables of other libraries: `rows.py`
    the covariance of a strip: `strips.py`; offsets between neighbours: `relative.py`
    the exterior orientation in the frame of an export: `framed.py`
    Brown's camera: `cameras/camera.py`
    where the bore-sight is applied (`C_cb`): `cameras/mounting.py`, by
        `insgnss/navigation/orient/exterior.py`
    the GPS/INS offset of Metashape: (M.6) and `metashape_offset` in `cameras/mounting.py`
    which camera of a rig took which image: `cameras/rig.py`
    an image block: `block.py`; camera positions without attitude: `cameras/camera_positions.py`
    error states of the filter: `states.py`
    checks and their ranks, estimates, mean residuals: `verdicts.py`
    wavelet variances: `variances.py`
    what kind of a solution a fix is: `qualities.py`
    what a record checks at its birth: `_checked.py`
"""

from ..base.findings import Finding, Question, Verdict
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
from .verdicts import Check, Estimate, MeanResidual, TimeCorrelatedError
