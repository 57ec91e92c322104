"""What residuals of image observations have in common by their place on the format."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ....base.findings import Finding, ranked
from ....records.block import Array
from ...adjust.adjustment import residuals_px
from ..solve import AdjustedBlock

# rms of the residuals that repeat by place (px), and their mean square over its variance (chosen)
PATTERN_PX, PATTERN_SIGMA = 0.15, 2.0
CELLS = (12, 9)  # of the format, about square for 4:3 (chosen)
FEWEST_OF_CELL = 8  # observations of a cell


@dataclass(frozen=True, eq=False)
class Pattern:
    """Means of the residuals of one camera over the cells of its format.

    Parameters
    ----------
    centre, mean : ndarray
        (k, 2) middle of each cell and mean residual there, px.
    sigma : ndarray
        (k, 2) standard deviations that the redundancy of the observations leaves to the means, px.
    """

    centre: Array
    mean: Array
    sigma: Array

    @property
    def rms(self) -> float:
        """Root mean square of the mean residuals beyond their noise, px; zero where none is."""
        if not len(self.mean):
            return 0.0
        return float(np.sqrt(max(0.0, float(np.mean(self.mean**2 - self.sigma**2)))))

    @property
    def normalised_square(self) -> float:
        """Mean of the squared means in their standard deviations; one for noise."""
        return float(np.mean((self.mean / self.sigma) ** 2)) if len(self.mean) else 0.0


def patterns(solved: AdjustedBlock) -> tuple[Pattern, ...]:
    """Return the pattern of each camera.

    Parameters
    ----------
    solved : AdjustedBlock
        The adjusted block.

    Returns
    -------
    tuple of Pattern
        One a camera; cells with few observations are left out.
    """
    block = solved.result.problem.block
    observations, r = block.observations, solved.precision.redundancy
    e = residuals_px(solved.result)
    taking = np.isfinite(r[:, 0])
    out = []
    for c, camera in enumerate(block.cameras):
        mine = taking & (block.camera[observations.image] == c)
        cell = (observations.uv[mine] / (camera.width, camera.height) * CELLS).astype(int)
        cell = np.clip(cell, 0, np.array(CELLS) - 1)
        number = cell[:, 0] * CELLS[1] + cell[:, 1]
        size = CELLS[0] * CELLS[1]
        count = np.bincount(number, minlength=size)
        good = count >= FEWEST_OF_CELL
        mean, var = np.zeros((size, 2)), np.zeros((size, 2))
        for k in range(2):
            variance_px2 = np.maximum(r[mine, k], 0.0) * observations.sigma_px[mine, k] ** 2
            with np.errstate(all="ignore"):
                mean[:, k] = np.bincount(number, e[mine, k], size) / count
                var[:, k] = np.bincount(number, variance_px2, size) / count**2
        centre = (np.stack(np.divmod(np.arange(size), CELLS[1]), axis=1) + 0.5) / CELLS
        centre = centre * (camera.width, camera.height)
        good &= (var > 0.0).all(axis=1)
        out.append(Pattern(centre[good], mean[good], np.sqrt(var[good])))
    return tuple(out)


def repeating(figures: Mapping[str, Any], drawn: Sequence[Pattern]) -> Iterator[Finding]:
    """Say which cameras have residuals that repeat from image to image.

    Parameters
    ----------
    figures : mapping
        Figures of the block.
    drawn : sequence of Pattern
        One a camera.

    Yields
    ------
    Finding
        One a camera whose pattern is more than noise.
    """
    for camera, pattern in zip(figures["cameras"], drawn, strict=True):
        if pattern.rms > PATTERN_PX and pattern.normalised_square > PATTERN_SIGMA:
            yield ranked(
                "camera",
                1.0 + pattern.rms,
                f"residuals of camera {camera['name']} repeat from image to image:"
                f" {pattern.rms:.2f} px by their place on the format, which its interior"
                " orientation does not describe",
            )
