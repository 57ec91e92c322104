"""Charts of a comparison.

Differences of every component over time or images, with their standard deviations, and their
distribution; where a mismatch was recognised, what remains after it is taken off.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...records import Array
from ..charts.chart import Chart, Ink, Layer, Panel

BREAK_STEPS = 10.0  # a step of time so many times the usual one breaks the line
MOST_OWN_DOTS = 400  # values up to which each has its dot; more are a line (chosen)
# half height of a panel in which nothing is to be seen
LEAST_HALF_HEIGHT = {"mm": 0.1, "m": 1e-4, "deg": 1e-4, "mm/s": 0.1, "m/s": 1e-4}
# of a distribution, standard deviations; and its classes
FARTHEST_SIGMAS, HISTOGRAM_CLASSES = (5.0, 25)
_DIFFERENCES = (
    "Each component of b minus a{shaded}. Differences that are constant, change with the"
    " heading or drift point to a different convention, lever arm or clock."
)
_SHADED = ", within three standard deviations where shaded"
_REMAINING = "Differences after all recognised errors are removed; the remainder is unexplained."
_NORMALISED = (
    "Differences over their standard deviations: honest ones follow the dark curve, the normal "
    "density. A wider distribution says that the standard deviations are too small, a shifted one "
    "that an error is systematic. The outermost classes hold all larger values."
)
_DISTRIBUTION_CAPTION = "How often each difference occurs; a second hump is a second population."


@dataclass(frozen=True, eq=False)
class Curve:
    """Differences (n,) in the unit of the screen, and their standard deviations or None."""

    values: Array
    sigma: Array | None
    unit: str


@dataclass(frozen=True, eq=False)
class ComparisonPanel:
    """One component: its differences, and what remains of them or None."""

    name: str
    difference: Curve
    remaining: Curve | None = None


def comparison_charts(
    panels: Sequence[ComparisonPanel],
    times: tuple[Array | None, Array | None],
    names: Sequence[str] = (),
) -> tuple[Chart, ...]:
    """Return the charts: differences, what remains of them, and their distribution.

    Parameters
    ----------
    panels : a component each.
    times : (n,) s of the differences and of what remains, or None for their order.
    names : of the pairs, such as images; may be empty.
    """
    charts = [_over_time("differences", [(p.name, p.difference) for p in panels], times[0], names)]
    remaining = [(p.name, p.remaining) for p in panels if p.remaining is not None]
    if remaining:
        labels = names if remaining[0][1].values.size == len(names) else ()
        charts.append(_over_time("remaining", remaining, times[1], labels))
    return (*charts, _distribution(panels))


def _over_time(
    name: str, curves: Sequence[tuple[str, Curve]], time: Array | None, names: Sequence[str]
) -> Chart:
    """Differences as they are, or what remains of them."""
    n = curves[0][1].values.size
    x = np.arange(1.0, n + 1.0) if time is None else (time - time[0]) / 60.0
    remaining = name == "remaining"
    shaded = _SHADED if any(curve.sigma is not None for _, curve in curves) else ""
    return Chart(
        name,
        "What remains after the recognised is taken off" if remaining else "b minus a",
        _REMAINING if remaining else _DIFFERENCES.format(shaded=shaded),
        [
            Panel(
                f"{component}, {curve.unit}",
                _layers(x, curve, names, remaining),
                limits=_panel_limits(curve),
            )
            for component, curve in curves
        ],
        "image, in the order of file a" if time is None else "time after the first pose, min",
        link="image" if time is None else "time",
    )


def _layers(x: Array, curve: Curve, names: Sequence[str], remaining: bool) -> list[Layer]:
    """Return the layers of one curve: zero line, three-sigma band, dots or, of many, a line."""
    ink: Ink = "second" if remaining else "first"
    along, y, sigma = _broken(x, curve.values, curve.sigma)
    layers = [Layer("rules", np.zeros(0), np.zeros(1), ink="faint", width=1.0)]
    if sigma is not None:
        layers.append(Layer("band", along, -3.0 * sigma, "three sigma", "faint", y2=3.0 * sigma))
    if x.size > MOST_OWN_DOTS:
        return [*layers, Layer("line", along, y, ink=ink, width=1.3)]
    return [*layers, Layer("points", x, curve.values, ink=ink, texts=names, width=5.0)]


def _broken(x: Array, y: Array, sigma: Array | None) -> tuple[Array, Array, Array | None]:
    """Return series with NaN where time makes a leap, so that no line bridges it."""
    step = np.diff(x)
    if step.size == 0:
        return x, y, sigma
    leaps = np.flatnonzero(step > BREAK_STEPS * np.median(step)) + 1
    middle = 0.5 * (x[leaps - 1] + x[leaps])
    return (
        np.insert(x, leaps, middle),
        np.insert(y, leaps, np.nan),
        None if sigma is None else np.insert(sigma, leaps, np.nan),
    )


def _panel_limits(curve: Curve) -> tuple[float, float]:
    """Return limits that hold all differences, and three sigmas where these are as small."""
    values, sigma = curve.values, curve.sigma
    half_height = 1.1 * max(float(np.abs(values).max()), LEAST_HALF_HEIGHT[curve.unit])
    low, high = min(float(values.min()), 0.0), max(float(values.max()), 0.0)
    if sigma is not None and 3.0 * float(np.median(sigma)) < 4.0 * half_height:
        widest = max(half_height, 3.3 * float(np.median(sigma)))
        return (
            min(low, -widest) if low < 0 else -0.3 * widest,
            max(high, widest) if high > 0 else 0.3 * widest,
        )
    return low - 0.1 * half_height, high + 0.1 * half_height


def _distribution(panels: Sequence[ComparisonPanel]) -> Chart:
    """Histograms.

    Of differences over their standard deviations where there are some, with the density that they
    should follow.
    """
    normalised = [panel for panel in panels if panel.difference.sigma is not None]
    shown = normalised or panels
    return Chart(
        "distribution",
        "Distribution of the differences",
        _NORMALISED if normalised else _DISTRIBUTION_CAPTION,
        [_histogram(panel) for panel in shown],
        "standard deviations" if normalised else "b minus a",
        columns=min(3, len(shown)),
        limits=(-FARTHEST_SIGMAS, FARTHEST_SIGMAS) if normalised else None,
    )


def _histogram(panel: ComparisonPanel) -> Panel:
    """Return the density of differences over sigmas; their counts where no sigma is stated."""
    values, sigma, unit = panel.difference.values, panel.difference.sigma, panel.difference.unit
    if sigma is None:
        count, edges = np.histogram(values, bins=40)
        layers = [Layer("steps", edges, count.astype(np.float64))]
        return Panel(f"number by {panel.name}, {unit}", layers)
    edges = np.linspace(-FARTHEST_SIGMAS, FARTHEST_SIGMAS, HISTOGRAM_CLASSES + 1)
    count, _ = np.histogram(np.clip(values / sigma, -FARTHEST_SIGMAS, FARTHEST_SIGMAS), bins=edges)
    density = count / (count.sum() * np.diff(edges))
    x = np.linspace(-FARTHEST_SIGMAS, FARTHEST_SIGMAS, 101)
    normal = np.exp(-0.5 * x**2) / np.sqrt(2.0 * np.pi)
    return Panel(
        f"{panel.name}: density",
        [Layer("steps", edges, density, "found"), Layer("line", x, normal, "expected", "ink")],
    )
