"""Pictures of a calibrated mounting: what is left of the poses by what moves a wrong constant."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ..markup import Picture
from .style import AXIS_COLOURS, FAINT, legend, png, sheet

Array = NDArray[np.float64]
AXES = ("forward", "right", "down")
BINS = 12
LEAST = 5  # images of a mean


def residual_pictures(residual: Array, against: Mapping[str, Array]) -> tuple[Picture, ...]:
    """Draw residuals of positions and attitudes over what moves them.

    Parameters
    ----------
    residual : ndarray, (n, 6)
        Flight minus block, body axes: position, m, and attitude, rad.
    against : mapping
        Name with unit, and values (n,).

    Returns
    -------
    tuple of Picture
        Positions, attitudes.
    """
    pictures = []
    for part, factor, unit, name, title in (
        (slice(0, 3), 1e3, "mm", "positions", "What is left of the positions"),
        (slice(3, 6), 1e3 * np.degrees(1.0), "mdeg", "attitudes", "What is left of the attitudes"),
    ):
        figure, axes = sheet(len(against), 1, 2.6 * len(against))
        values = factor * residual[:, part]
        for (label, x), ax in zip(against.items(), axes[:, 0], strict=True):
            for k, colour in enumerate(AXIS_COLOURS):
                ax.plot(x, values[:, k], ".", ms=2, color=colour, alpha=0.35)
            for k, colour in enumerate(AXIS_COLOURS):
                centre, mean = _means(x, values[:, k])
                ax.plot(centre, mean, "-o", ms=4, lw=1.4, color=colour, label=AXES[k])
            ax.axhline(0.0, color=FAINT, lw=0.8)
            ax.set_xlabel(label)
            ax.set_ylabel(unit)
            legend(ax)
        reading = (
            f"Flight minus block in the axes of the body, {unit}, after the calibration; lines are"
            " means of images alike. A mounting that is right leaves lines about zero: a slope over"
            " speed or turn rate is a delay that is left, one over heading a shift or a lever arm,"
            " one over time a drift of the flight or a bend of the block."
        )
        pictures.append(Picture(name, title, reading, png(figure)))
    return tuple(pictures)


def _means(x: Array, y: Array) -> tuple[Array, Array]:
    """Means of y in classes of x with as many values each."""
    order = np.argsort(x, kind="stable")
    count = max(1, min(BINS, x.size // LEAST))
    parts = np.array_split(order, count)
    return np.array([x[p].mean() for p in parts]), np.array([y[p].mean() for p in parts])
