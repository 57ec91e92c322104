"""stub until merged."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...records import ExteriorOrientation

BESIDE = "eo_covariance.npz"


@dataclass(frozen=True, eq=False)
class StripCovariance:
    """rows, cov."""

    rows: NDArray[np.int64]
    cov: NDArray[np.float64]


def read_eo_covariance(path: Path, eo: ExteriorOrientation) -> tuple[StripCovariance, ...]:
    """Read."""
    raise NotImplementedError
