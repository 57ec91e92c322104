"""Charts of a calibrated mounting: scatter of setups, residuals of a flight."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..charts.chart import AXES_INKS, Chart, Ink, Layer, Panel
from ..charts.pieces import length_unit

Array = NDArray[np.float64]
IMAGE_AXES = ("x, image right", "y, image down", "z, viewing direction")
MOST_NAMES = 24  # that stand in the chart; of more one hovers
HAIR = 1e-3  # of the distance of two images: what is drawn as x must increase
NO_VALUES = np.zeros(0)  # x of a rule across the chart
ZERO = Layer("rules", NO_VALUES, np.zeros(1), ink="faint", width=1.0)  # the rule of no residual


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


def scatter_panel(
    data: Scatter, kind: str, title: str, axis_names: tuple[str, str, str] = IMAGE_AXES
) -> Chart:
    """Show each estimate minus the mean, with its standard deviation.

    Parameters
    ----------
    data : Scatter
        The estimates.
    kind : str
        What one of them is, "setup".
    title : str
        Of the chart.
    axis_names : tuple of str
        Of the vector.

    Returns
    -------
    Chart
        Three panels, one an axis of the camera.
    """
    deviation = data.each - data.mean
    factor, unit = length_unit(float(np.abs(deviation).max()) + float(data.sigma.max()))
    panels = []
    for k, name in enumerate(axis_names):
        mean_label = ""
        if data.mean_sigma[k] > 0.0:
            mean_label = f"mean {data.mean[k]:+.4f} ± {data.mean_sigma[k]:.4f} m"
        layers = _scatter_layers(data, k, factor, mean_label)
        panels.append(Panel(f"{name}: {unit}", layers))
    names, number = data.names, np.arange(1.0, len(data.names) + 1.0)
    if len(names) <= MOST_NAMES and not all(name.isdigit() for name in names):
        low, high = deviation[:, 2] - data.sigma[:, 2], deviation[:, 2] + data.sigma[:, 2]
        below = float(low.min()) - 0.15 * max(float(high.max() - low.min()), 1e-9)
        height = np.full(number.size, factor * below)
        lowest_panel = panels[-1]
        name_labels = Layer("labels", number, height, ink="faint", texts=names)
        panels[-1] = Panel(lowest_panel.label, [*lowest_panel.layers, name_labels])
    reading = f"Dots: {kind}s, with the line where all would lie without errors."
    if data.sigma.any():
        reading = (
            f"Dots: {kind}s minus their weighted mean, with one standard deviation; band: that of"
            " the mean. Two in three bars should reach the line."
        )
    if data.left_out.any():
        reading += f" Red: {kind}s left out."
    ends = (0.5, len(names) + 0.5)
    label = f"number of the {kind}"
    return Chart(f"scatter-{kind}", title, reading, panels, label, limits=ends)


def _scatter_layers(data: Scatter, k: int, factor: float, label: str) -> list[Layer]:
    """Return the layers of axis `k`: band of the mean, error bars and dots."""
    number = np.arange(1.0, len(data.names) + 1.0)
    deviation, sigma = factor * (data.each[:, k] - data.mean[k]), factor * data.sigma[:, k]
    ends, half = np.array([0.5, number.size + 0.5]), np.full(2, factor * data.mean_sigma[k])
    layers = [ZERO]
    if label:
        layers.append(Layer("band", ends, -half, label, AXES_INKS[k], y2=half))
    kinds: tuple[tuple[NDArray[np.bool_], Ink, str], ...] = (
        (~data.left_out, AXES_INKS[k], ""),
        (data.left_out, "warn", "left out"),
    )
    for chosen, ink, name in kinds:
        if not chosen.any():
            continue
        x, y, s = number[chosen], deviation[chosen], sigma[chosen]
        if s.any():
            bars = _error_bars(x, y - s, y + s)
            layers.append(Layer("line", *bars, ink=ink))
        names = [n for n, shown in zip(data.names, chosen, strict=True) if shown]
        layers.append(Layer("points", x, y, name, ink, texts=names, width=7.0))
    return layers


def _error_bars(x: Array, low: Array, high: Array) -> tuple[Array, Array]:
    """Return a line of upright bars, broken between them; x ascends, a bar leans by a hair."""
    hairs = np.array([-HAIR, HAIR, 2.0 * HAIR])
    gap = np.full(x.size, np.nan)
    return (x[:, None] + hairs).ravel(), np.column_stack([low, high, gap]).ravel()


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


def residuals(data: Residuals) -> tuple[Chart, ...]:
    """Show residuals in the order of the images, over the course, and on the map.

    Parameters
    ----------
    data : Residuals
        The flight.

    Returns
    -------
    tuple of Chart
        Without that over the course, where no image has one.
    """
    factor, unit = length_unit(float(np.abs(data.residual).max()))
    number, values = np.arange(1.0, len(data.residual) + 1.0), factor * data.residual
    oriented = np.isfinite(data.heading_deg)
    title = "Antenna positions minus poses with the lever arm"
    reading = (
        "Steps between strips of opposite heading show a remaining error of lever arm or"
        " delay; slow waves are time-correlated errors of the fixes."
    )

    def panels(x: Array, rows: NDArray[np.bool_], joined: bool) -> list[Panel]:
        drawn = []
        for k, name in enumerate(("east", "north", "up")):
            y, ink = values[rows, k], AXES_INKS[k]
            lines = [Layer("line", x, y, ink=ink, width=1.0, faint=True)] if joined else []
            dots = Layer("points", x, y, ink=ink, texts=_numbered(rows), width=5.0)
            drawn.append(Panel(f"{name}, {unit}", [ZERO, *lines, dots]))
        return drawn

    every = np.ones(number.size, dtype=np.bool_)
    over = panels(number, every, True)
    ends = (0.5, number.size + 0.5)
    charts = [Chart("residuals", title, reading, over, "image", link="image", limits=ends)]
    if oriented.any():
        course = Chart(
            "residuals-course",
            "The same over the course",
            reading,
            panels(data.heading_deg[oriented], oriented, False),
            "course, deg",
            limits=(-5.0, 365.0),
        )
        charts.append(course)
    return (*charts, _residual_map(data))


def _numbered(rows: NDArray[np.bool_]) -> list[str]:
    return [f"image {k + 1}" for k in np.flatnonzero(rows)]


def _residual_map(data: Residuals) -> Chart:
    """Return the chart of horizontal residuals as arrows at the camera positions."""
    plan, residual = data.position[:, :2], data.residual[:, :2]
    usual = float(np.quantile(np.linalg.norm(residual, axis=1), 0.9))
    extent = float(np.ptp(plan, axis=0).max())
    scale = 0.06 * extent / max(usual, 1e-9)
    (x, y), (east, north) = plan.T, scale * residual.T
    texts = _numbered(np.ones(len(plan), dtype=np.bool_))
    layers = [
        Layer("points", x, y, "image", texts=texts, width=4.0),
        Layer("arrows", x, y, "horizontal residual", "second", x2=x + east, y2=y + north),
    ]
    factor, unit = length_unit(usual)
    reading = (
        f"Arrows are horizontal residuals; a typical arrow is {factor * usual:.2g} {unit} long."
    )
    panel = Panel("north, m", layers)
    return Chart("map", "Where the residuals lie", reading, [panel], "east, m", map=True)


BODY = ("forward", "right", "down")
BINS, LEAST_IMAGES = 12, 5  # classes, and images of a mean


def over_motion(residual: Array, against: Mapping[str, Array]) -> tuple[Chart, ...]:
    """Show residuals of positions and attitudes over what moves them.

    Parameters
    ----------
    residual : ndarray, (n, 6)
        Flight minus block, body axes: position, m, and attitude, rad.
    against : mapping
        Name with unit, and values (n,).

    Returns
    -------
    tuple of Chart
        One for each of `against`: positions above, attitudes below.
    """
    shown = (
        ("positions, mm", 1e3 * residual[:, :3]),
        ("attitudes, mdeg", 1e3 * np.degrees(residual[:, 3:6])),
    )
    reading = (
        "Flight minus block in the axes of the body, after the calibration; lines are means"
        " over similar images. With a correct mounting the lines lie about zero: a slope over"
        " speed or turn rate is a remaining delay, one over heading a shift or a lever arm,"
        " one over time a drift of the flight or a bend of the block."
    )
    return tuple(
        Chart(
            f"over-{label.partition(',')[0].replace(' ', '-')}",
            f"What is left, over {label.partition(',')[0]}",
            reading,
            [Panel(name, _dots_and_means(x, values)) for name, values in shown],
            label,
        )
        for label, x in against.items()
    )


def _dots_and_means(x: Array, values: Array) -> list[Layer]:
    """Dots of every image, and lines of the means of images alike."""
    layers = [ZERO]
    texts = _numbered(np.ones(x.size, dtype=np.bool_))
    for k, ink in enumerate(AXES_INKS):
        layers.append(Layer("points", x, values[:, k], ink=ink, texts=texts, width=3.0, faint=True))
    for k, ink in enumerate(AXES_INKS):
        centre, mean = _means(x, values[:, k])
        layers += [
            Layer("line", centre, mean, BODY[k], ink, width=2.0),
            Layer("points", centre, mean, ink=ink, width=6.0),
        ]
    return layers


def _means(x: Array, y: Array) -> tuple[Array, Array]:
    """Means of y in classes of x with as many values each."""
    order = np.argsort(x, kind="stable")
    count = max(1, min(BINS, x.size // LEAST_IMAGES))
    parts = np.array_split(order, count)
    return np.array([x[p].mean() for p in parts]), np.array([y[p].mean() for p in parts])
