"""Pictures of a calibrated mounting: scatter of setups, residuals of a flight."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..markup import Picture
from .style import ACCENT, AXIS_COLOURS, FAINT, LINE, WARN, legend, length_unit, png, sheet

Array = NDArray[np.float64]
AXES = ("x, image right", "y, image down", "z, viewing direction")
MOST_NAMES = 16


@dataclass(frozen=True, eq=False)
class Scatter:
    """Estimates of one vector, each by itself, and their mean.

    Parameters
    ----------
    names : tuple of str
        (n,) of the estimates.
    each, sigma : ndarray, (n, 3)
        Estimates and standard deviations, m.
    left_out : ndarray of bool, (n,)
        Which do not take part.
    mean, mean_sigma : ndarray, (3,)
        Their mean and its standard errors, m.
    """

    names: tuple[str, ...]
    each: Array
    sigma: Array
    left_out: NDArray[np.bool_]
    mean: Array
    mean_sigma: Array


def scattered(
    data: Scatter, kind: str, title: str, axis_names: tuple[str, str, str] = AXES
) -> Picture:
    """Draw each estimate minus the mean, with its standard deviation.

    Parameters
    ----------
    data : Scatter
        The estimates.
    kind : str
        What one of them is, "setup".
    title : str
        Of the picture.
    axis_names : tuple of str
        Of the vector.

    Returns
    -------
    Picture
        Three panels, one an axis of the camera.
    """
    off = data.each - data.mean
    factor, unit = length_unit(float(np.abs(off).max()) + float(data.sigma.max()))
    figure, axes = sheet(3, 1, 6.6)
    x = np.arange(len(data.names))
    for k, ax in enumerate(axes[:, 0]):
        band = factor * data.mean_sigma[k]
        ax.axhspan(-band, band, color=AXIS_COLOURS[k], alpha=0.18, lw=0)
        ax.axhline(0.0, color=FAINT, lw=0.8)
        for chosen, colour in ((~data.left_out, AXIS_COLOURS[k]), (data.left_out, WARN)):
            ax.errorbar(
                x[chosen],
                factor * off[chosen, k],
                factor * data.sigma[chosen, k],
                fmt="o",
                ms=4,
                lw=1.0,
                capsize=2,
                color=colour,
            )
        text = axis_names[k]
        if data.mean_sigma[k] > 0.0:
            text += f": {data.mean[k]:+.4f} ± {data.mean_sigma[k]:.4f} m"
        ax.set_title(text, fontsize=9, loc="left")
        ax.set_ylabel(unit)
        few = len(x) <= MOST_NAMES
        ax.set_xticks(x if few else x[:: -(-len(x) // MOST_NAMES)])
        ax.set_xticklabels([])
    last = axes[-1, 0]
    last.set_xticklabels([data.names[int(k)] for k in last.get_xticks()], fontsize=7, rotation=25)
    reading = f"Dots: {kind}s, with the line where all would lie without errors."
    if data.sigma.any():
        reading = (
            f"Dots: {kind}s minus their weighted mean, with one standard deviation; band: that of"
            " the mean. Two in three bars should reach the line."
        )
    if data.left_out.any():
        reading += f" Red: {kind}s left out."
    return Picture(f"scatter-{kind}", title, reading, png(figure))


@dataclass(frozen=True, eq=False)
class Residuals:
    """Residuals of a flight, image by image.

    Parameters
    ----------
    residual : ndarray, (n, 3)
        East, north, up, m.
    heading_deg : ndarray, (n,)
        Course of each image; NaN where it has none.
    position : ndarray, (n, 3)
        Antenna positions, m.
    """

    residual: Array
    heading_deg: Array
    position: Array


def residuals(data: Residuals) -> list[Picture]:
    """Draw residuals in the order of the images, and over the course.

    Parameters
    ----------
    data : Residuals
        The flight.

    Returns
    -------
    list of Picture
        Over images and heading, and on the map.
    """
    factor, unit = length_unit(float(np.abs(data.residual).max()))
    figure, axes = sheet(3, 2, 6.8)
    order = np.arange(len(data.residual))
    for k, name in enumerate(("east", "north", "up")):
        left, right = axes[k]
        values = factor * data.residual[:, k]
        left.plot(order, values, ".-", color=AXIS_COLOURS[k], lw=0.7, ms=3)
        right.plot(data.heading_deg, values, ".", color=AXIS_COLOURS[k], ms=4)
        right.set_xlim(-5.0, 365.0)
        right.set_xticks([0, 90, 180, 270, 360])
        for ax in (left, right):
            ax.axhline(0.0, color=FAINT, lw=0.8)
        left.set_ylabel(f"{name}, {unit}")
    axes[-1, 0].set_xlabel("image")
    axes[-1, 1].set_xlabel("course, deg")
    over = Picture(
        "residuals",
        "Antenna positions minus poses with the lever arm",
        "In the order of the images, and over the course. Steps between strips of opposite course"
        " are a lever arm or a delay that is left; slow waves are time-correlated errors of the"
        " fixes.",
        png(figure),
    )
    return [over, _map(data)]


def _map(data: Residuals) -> Picture:
    figure, axes = sheet(1, 1, 6.5)
    ax = axes[0, 0]
    plan, off = data.position[:, :2], data.residual[:, :2]
    usual = float(np.quantile(np.linalg.norm(off, axis=1), 0.9))
    size = float(np.ptp(plan, axis=0).max())
    scale = 0.06 * size / max(usual, 1e-9)
    ax.plot(plan[:, 0], plan[:, 1], ".", color=LINE, ms=3, label="image")
    ax.quiver(
        *plan.T, *(scale * off).T, angles="xy", scale_units="xy", scale=1, color=ACCENT, width=0.002
    )
    ax.margins(0.08)
    ax.set_aspect("equal")
    ax.set_xlabel("east, m")
    ax.set_ylabel("north, m")
    legend(ax)
    factor, unit = length_unit(usual)
    reading = f"Arrows are horizontal residuals; the usual long one is {factor * usual:.2g} {unit}."
    return Picture("map", "Where the residuals lie", reading, png(figure))


BODY = ("forward", "right", "down")
BINS, LEAST = 12, 5  # classes, and images of a mean


def over_motion(residual: Array, against: Mapping[str, Array]) -> tuple[Picture, ...]:
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
    for columns, factor, unit, name, title in (
        (slice(0, 3), 1e3, "mm", "positions", "What is left of the positions"),
        (slice(3, 6), 1e3 * np.degrees(1.0), "mdeg", "attitudes", "What is left of the attitudes"),
    ):
        figure, axes = sheet(len(against), 1, 2.8 * len(against))
        figure.subplots_adjust(hspace=0.42)  # each has an axis of its own
        values = factor * residual[:, columns]
        for (label, x), ax in zip(against.items(), axes[:, 0], strict=True):
            for k, colour in enumerate(AXIS_COLOURS):
                ax.plot(x, values[:, k], ".", ms=2, color=colour, alpha=0.35)
            for k, colour in enumerate(AXIS_COLOURS):
                centre, mean = _means(x, values[:, k])
                ax.plot(centre, mean, "-o", ms=4, lw=1.4, color=colour, label=BODY[k])
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
