"""What a photogrammetry program knows of an image block, by names."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...records.block import Array, BrownCamera
from .ground_points import GroundTable
from .image_points import ImagePoints


@dataclass(frozen=True, eq=False)
class MeasuredBlock:
    """What a photogrammetry program knows of an image block, by names."""

    cameras: tuple[BrownCamera, ...]
    camera: NDArray[np.int64]
    measured: ImagePoints
    position_m: Array
    C_mc: Array
    ground: GroundTable | None = None
    crs: str | None = None
    local: bool = True
