"""Blocks of any format."""

from pathlib import Path

import numpy as np

from ..text.text import Source
from .ground_points import GroundTable, read_ground_points
from .image_points import SIGMA_PX, read_image_points
from .measured_block import MeasuredBlock


def read_measured_block(
    path: Source, format: str = "auto", sigma_px: float | None = None
) -> MeasuredBlock:
    """Read."""
    measured = read_image_points(Path(path), SIGMA_PX if sigma_px is None else sigma_px)
    n = len(measured.images)
    return MeasuredBlock(
        (),
        np.zeros(n, dtype=np.int64),
        measured,
        np.full((n, 3), np.nan),
        np.full((n, 3, 3), np.nan),
    )


def read_ground(path: Source) -> tuple[GroundTable, str | None]:
    """Read."""
    return read_ground_points(Path(path)), None
