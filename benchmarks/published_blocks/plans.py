"""The numbers of the tables of papers 003 and 004, and the cameras.

Table 2 of paper 003 counts observations as an adjustment does, two of each measured point: of the
corridor's points at most ten of its images see one (80 % forward, two lines), and its tie points
have 10.7 observations each. Hence 52 776 measurements of 4926 tie points of the block, 47 of its 5
control and 267 of its 15 check points; 8520, 16 and 49 of the corridor's. Paper 004 has 24 712
measurements of 6912 tie points, three of each at least.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from insgnss.records.block import INTERIOR, BrownCamera, InteriorCovariance

from .pose_errors import PoseErrors

FREE_003 = ("f", "cx", "cy", "k1", "k2")
FREE_004 = ("f", "cx", "cy", "k1", "k2", "k3", "p1", "p2")


def _camera(
    name: str, size: tuple[int, int], free: tuple[str, ...], values: Mapping[str, float]
) -> BrownCamera:
    interior = np.array([values.get(key, 0.0) for key in INTERIOR])
    return BrownCamera(name, *size, interior, free=free)


NEX5R_16 = _camera(
    "nex5r_16mm",
    (4912, 3264),
    FREE_003,
    {"f": 3341.2, "cx": 2468.4, "cy": 1623.3, "k1": -0.0412, "k2": 0.0135}
    | {"p1": 2.1e-4, "p2": -1.5e-4},
)
"""Sony NEX-5R with its lens of 16 mm, pixels of 4.8 um: the true camera of paper 003's flights."""
NEX5R_20 = _camera(
    "nex5r_20mm",
    (4920, 3276),
    FREE_004,
    {"f": 4172.6, "cx": 2469.3, "cy": 1631.8, "k1": -0.0785, "k2": 0.0912, "k3": -0.0214}
    | {"p1": -3.4e-4, "p2": 2.2e-4},
)
"""The same body with 20 mm: the true camera of paper 004."""
OFF: Mapping[str, float] = {
    **{"f": -4.0, "cx": 3.0, "cy": -2.5, "k1": 0.002, "k2": -0.0015},
    **{"k3": 0.001, "p1": 5e-5, "p2": -5e-5},
}
"""What the stated camera is off in the parameters that are estimated."""
CALIBRATED: Mapping[str, float] = {
    **{"f": 0.8, "cx": 0.5, "cy": 0.5, "k1": 1e-4, "k2": 1e-4, "k3": 1e-4},
    **{"p1": 1e-5, "p2": 1e-5},
}
"""Standard deviations of a calibration over a test field on another day, for what is not
self-calibrated: Fast AT and direct orientation."""


@dataclass(frozen=True)
class Survey:
    """What a table says of a block.

    Parameters
    ----------
    name : str
        Of `SURVEYS`.
    camera : BrownCamera
        The true camera; its `free` is what self-calibration estimates.
    ties : tuple of int
        Tie points, their measurements, the fewest of a point.
    tie_px : tuple of float
        Standard deviations of tie points in the richest and in the poorest texture.
    target_px : float
        That of surveyed points in images.
    ground_m : tuple of float
        (3) those of their survey.
    control, check : tuple of int
        Points and their measurements.
    relief_m : float
        Between the lowest and the highest place.
    errors : PoseErrors
        Of the poses.
    origin_deg, height_m : tuple of float, float
        Latitude, longitude and ellipsoidal height of the tangent plane's origin, on the ground.
    gps_week : int
        Of the flight.
    """

    name: str
    camera: BrownCamera
    ties: tuple[int, int, int]
    tie_px: tuple[float, float]
    target_px: float
    ground_m: tuple[float, float, float]
    control: tuple[int, int]
    check: tuple[int, int]
    relief_m: float
    errors: PoseErrors
    origin_deg: tuple[float, float]
    height_m: float
    gps_week: int

    @property
    def stated_camera(self) -> BrownCamera:
        """The camera that is written for self-calibration: a few pixels off."""
        off = [OFF.get(name, 0.0) * (name in self.camera.free) for name in INTERIOR]
        return self.camera.with_(self.camera.interior + off)

    @property
    def calibration(self) -> InteriorCovariance:
        """The covariance of an earlier calibration."""
        names = tuple(name for name in INTERIOR if name in CALIBRATED and name in self.camera.free)
        return InteriorCovariance(names, np.diag([CALIBRATED[name] ** 2 for name in names]))

    def calibrated(self, rng: np.random.Generator) -> BrownCamera:
        """Return the camera as an earlier calibration found it, with errors of `CALIBRATED`."""
        sigma = [CALIBRATED.get(name, 0.0) * (name in self.camera.free) for name in INTERIOR]
        error = rng.standard_normal(len(INTERIOR)) * sigma
        return replace(self.camera.with_(self.camera.interior - error), free=())


BLOCK_2015 = Survey(
    "block2015",
    NEX5R_16,
    (4926, 52776, 2),
    (1.0, 1.5),
    0.5,
    (0.01, 0.01, 0.015),
    (5, 47),
    (15, 267),
    12.0,
    PoseErrors(),
    (46.5700, 6.5400),
    620.0,
    1850,
)
"""Block 2015 of paper 003: seven lines and seven across them, 120 and 150 m above ground."""
CORRIDOR_2014 = replace(
    BLOCK_2015,
    name="corridor2014",
    ties=(1595, 8520, 2),
    tie_px=(1.0, 1.0),
    control=(3, 16),
    check=(6, 49),
    relief_m=30.0,
    gps_week=1798,
)
"""Corridor 2014 of paper 003: two lines of 1200 m at 130 m."""
MAPKITE = Survey(
    "mapkite",
    NEX5R_20,
    (6912, 24712, 3),
    (0.83, 0.83),
    0.83,
    (0.015, 0.015, 0.015),
    (19, 0),
    (18, 0),
    26.0,
    PoseErrors((0.02, 0.02, 0.05), (1.5, 1.5, 3.0), axes="tangent plane"),
    (41.8250, 2.1100),
    920.0,
    1902,
)
"""The corridor of paper 004; attitudes are those of an autopilot. Its points are measured in all
images that see them."""
SURVEYS: Mapping[str, Survey] = {made.name: made for made in (BLOCK_2015, CORRIDOR_2014, MAPKITE)}
