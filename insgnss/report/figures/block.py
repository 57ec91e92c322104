"""Charts of an adjusted image block: the map, precision, residuals on the format, images."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..charts.chart import AXES_INKS, Chart, Ink, Layer, Mark, Panel
from ..charts.pieces import length_unit

Array = NDArray[np.float64]
MOST_MARKS = 6000  # marks of a chart: more hide each other, and slow a page down (chosen)
LINE_INKS: tuple[Ink, ...] = ("first", "fourth", "fifth")  # of flight lines in turn
SHARE = 0.06  # of the map's width that the longest usual arrow has
CIRCLE = 0.07  # of the format, from its corner: where the circle of chance stands


@dataclass(frozen=True, eq=False)
class Field:
    """Mean residuals of a camera by their place on the format.

    Parameters
    ----------
    camera : str
        Its name.
    size : tuple
        Width and height, px.
    centre, mean, sigma : ndarray
        (k, 2) px.
    """

    camera: str
    size: tuple[int, int]
    centre: Array
    mean: Array
    sigma: Array


@dataclass(frozen=True, eq=False)
class Ground:
    """What lies where in the axes of the block.

    Parameters
    ----------
    position : ndarray
        (n, 3) projection centres, m.
    point, sigma : ndarray
        (m, 3) object points and their standard deviations, m.
    lines : sequence of ndarray
        Rows of the images of each flight line.
    """

    position: Array
    point: Array
    sigma: Array
    lines: Sequence[NDArray[np.int64]]

    def around(self, points: Array) -> NDArray[np.bool_]:
        """Return which points lie around the images: one on the horizon would shrink all else."""
        low, high = self.position[:, :2].min(axis=0), self.position[:, :2].max(axis=0)
        margin = 0.25 * float(max(high - low)) + 20.0
        inside = (points[:, :2] > low - margin) & (points[:, :2] < high + margin)
        return np.asarray(inside.all(axis=1))


def charts(
    figures: Mapping[str, Any], fields: Sequence[Field], ground: Ground
) -> tuple[Chart, ...]:
    """All charts for which there is something to show.

    Parameters
    ----------
    figures : of adjust.json.
    fields : mean residuals, a camera each.
    ground : what lies where.
    """
    return (
        _map_chart(figures, ground),
        precision_map(figures, ground),
        *(_residual_field(field) for field in fields if len(field.mean)),
        _images(figures),
    )


def _map_chart(figures: Mapping[str, Any], ground: Ground) -> Chart:
    """Images, flight lines, control and check points with their residuals."""
    position = ground.position
    names = [image["image"] for image in figures["images"]]
    tie_points = ground.point[ground.around(ground.point)]
    tie_points = tie_points[:: max(1, -(-len(tie_points) // MOST_MARKS))]
    layers = [
        Layer("points", tie_points[:, 0], tie_points[:, 1], ink="faint", width=1.5, faint=True)
    ]
    lines = [rows for rows in ground.lines if len(rows) > 1]
    numbers = [str(k + 1) for k, rows in enumerate(ground.lines) if len(rows) > 1]
    layers += [
        Layer(
            "line",
            position[rows, 0],
            position[rows, 1],
            ink=LINE_INKS[k % len(LINE_INKS)],
            width=2.5,
        )
        for k, rows in enumerate(lines)
    ]
    layers.append(
        Layer("points", position[:, 0], position[:, 1], "image", "ink", texts=names, width=4.0)
    )
    if lines:
        starts = position[[rows[0] for rows in lines]]
        layers.append(Layer("labels", starts[:, 0], starts[:, 1], ink="faint", texts=numbers))
    points = list(_surveyed_points(figures))
    reading = "Dots are images."
    if lines:
        reading = (
            "Dots are images, coloured lines the flight lines as they were cut, with their numbers"
            " at the first image; dots on no line stand alone."
        )
    if points:
        offsets = np.vstack([p.offset_m for p in points])
        usual = float(np.quantile(np.linalg.norm(offsets, axis=1), 0.9))
        low, high = position[:, :2].min(axis=0), position[:, :2].max(axis=0)
        extent = 1.5 * float((high - low).max()) + 40.0
        factor = SHARE * extent / max(usual, 1e-9)
        for group in points:
            layers += group.layers(factor, 0.02 * extent)
        scale, unit = length_unit(usual)
        reading += (
            f" Arrows: surveyed minus adjusted, east and north, {factor:.0f} times enlarged"
            f" (nine tenths are below {scale * usual:.1f} {unit}); red: the same of the height,"
            " up is up."
        )
    return Chart("map", "The block", reading, [Panel("north, m", layers)], "east, m", map=True)


@dataclass(frozen=True, eq=False)
class _SurveyedPoints:
    """Surveyed points of one kind: positions and surveyed minus adjusted (n, 3), m."""

    kind: str
    names: Sequence[str]
    position: Array
    offset_m: Array
    ink: Ink
    mark: Mark

    def layers(self, factor: float, above: float) -> Iterator[Layer]:
        """Yield marks, arrows that are so many times enlarged, and names so many m above."""
        x, y = self.position[:, 0], self.position[:, 1]
        east, north, up = (factor * self.offset_m).T
        texts = [
            f"{name}: " + " / ".join(f"{1e3 * value:+.1f}" for value in offset) + " mm E N U"
            for name, offset in zip(self.names, self.offset_m, strict=True)
        ]
        yield Layer("points", x, y, self.kind, self.ink, mark=self.mark, texts=texts, width=8.0)
        yield Layer("arrows", x, y, ink=self.ink, x2=x + east, y2=y + north)
        yield Layer("arrows", x, y, ink="warn", x2=x, y2=y + up, faint=True)
        yield Layer("labels", x, y + above, ink="ink", texts=self.names)


def _surveyed_points(figures: Mapping[str, Any]) -> Iterator[_SurveyedPoints]:
    """Yield ground control and check points, as far as there are residuals."""
    kinds: tuple[tuple[str, str, str, Ink, Mark], ...] = (
        ("ground control", "ground_control", "residual_m", "second", "triangle"),
        ("check point", "check_points", "difference_m", "third", "square"),
    )
    for kind, group, key, ink, mark in kinds:
        if points := [p for p in figures[group] if key in p]:
            position, residual = (
                np.array([p[name] for p in points]) for name in ("position_m", key)
            )
            yield _SurveyedPoints(kind, [p["point"] for p in points], position, residual, ink, mark)


def precision_map(
    figures: Mapping[str, Any], ground: Ground, proposed: Array | None = None
) -> Chart:
    """Standard deviations of the heights of the object points.

    Parameters
    ----------
    figures : of adjust.json.
    ground : what lies where.
    proposed : (2,) or (3,) where one more control point would help; None: nowhere.
    """
    shown_points = np.flatnonzero(ground.around(ground.point))
    shown_points = shown_points[:: max(1, -(-shown_points.size // MOST_MARKS))]
    shown, up = ground.point[shown_points], 1e3 * ground.sigma[shown_points, 2]
    layers = [
        Layer(
            "points",
            shown[:, 0],
            shown[:, 1],
            value=up,
            value_name="sigma of the height, mm",
            width=3.5,
        )
    ]
    if control := figures["ground_control"]:
        position = np.array([p["position_m"] for p in control])
        names = [p["point"] for p in control]
        layers.append(
            Layer(
                *("points", position[:, 0], position[:, 1], "ground control", "second"),
                mark="triangle",
                texts=names,
                width=8.0,
            )
        )
    if proposed is not None:
        x, y = np.asarray(proposed[:1]), np.asarray(proposed[1:2])
        label = "one more would help here"
        layers.append(Layer("points", x, y, label, "warn", mark="ring", width=10.0, texts=[label]))
    reading = (
        "Each dot is an object point; its colour is the standard deviation of its height. Points of"
        " two images, at the rim, are worse than those of many; colours that change over the whole"
        " block ask for ground control where they are yellow."
    )
    title = "Precision of the object points"
    return Chart("precision", title, reading, [Panel("north, m", layers)], "east, m", map=True)


def _residual_field(field: Field) -> Chart:
    """Return the chart of mean residuals (px) by position on the image format."""
    width, height = field.size
    magnitude = np.linalg.norm(field.mean, axis=1)
    noise = float(np.sqrt((field.sigma**2).sum(axis=1).mean()))
    factor = 0.06 * width / max(float(np.quantile(magnitude, 0.9)), noise, 1e-9)
    column, row = field.centre[:, 0], height - field.centre[:, 1]
    angle = np.linspace(0.0, 2.0 * np.pi, 49)
    ring = factor * noise * np.array([np.cos(angle), np.sin(angle)])
    corner = np.array([CIRCLE * width, (1.0 - CIRCLE) * height])
    texts = [f"{dx:+.3f} {dy:+.3f} px" for dx, dy in field.mean]
    layers = [
        Layer(
            "line",
            np.array([0.0, width, width, 0.0, 0.0]),
            np.array([0.0, 0.0, height, height, 0.0]),
            ink="faint",
            width=1.0,
        ),
        Layer("points", column, row, ink="first", texts=texts, width=2.5, faint=True),
        Layer(
            *("arrows", column, row, "mean residual"),
            x2=column + factor * field.mean[:, 0],
            y2=row - factor * field.mean[:, 1],
        ),
        Layer("line", corner[0] + ring[0], corner[1] + ring[1], "by chance", "warn"),
    ]
    reading = (
        f"Mean residuals of the image observations of {field.camera} in cells of the format, seen "
        f"as the image is, {factor:.0f} times enlarged; the circle at the upper left is the size "
        f"to expect by chance ({noise:.3f} px). Longer arrows that agree with their neighbours "
        "show distortion that the interior orientation does not describe."
    )
    return Chart(
        f"format-{''.join(c if c.isalnum() else '-' for c in field.camera)}",
        f"Residuals on the format: {field.camera}",
        reading,
        [Panel("pixels above the lower edge", layers)],
        "x, px",
        map=True,
    )


def _images(figures: Mapping[str, Any]) -> Chart:
    """Residuals and precision image by image."""
    images = figures["images"]
    names = [image["image"] for image in images]
    number = np.arange(1.0, len(images) + 1.0)
    rms = np.array([np.nan if i["rms_px"] is None else i["rms_px"] for i in images])
    sigma = 1e3 * np.array([i["sigma_m"] for i in images])
    angle = 1e3 * np.degrees([i["sigma_rad"] for i in images])

    def dots(values: Array, name: str, ink: Ink) -> Layer:
        return Layer("points", number, values, name, ink, texts=names, width=5.0)

    panels = [
        Panel("rms, px", [dots(rms, "", "first")], limits=_limits_from_zero(rms)),
        *(
            Panel(
                label,
                [dots(values[:, k], axis, AXES_INKS[k]) for k, axis in enumerate(axes)],
                limits=_limits_from_zero(values),
            )
            for label, values, axes in (
                ("sigma, mm", sigma, ("E", "N", "U")),
                ("sigma, mdeg", angle, ("psi E", "psi N", "psi U")),
            )
        ),
    ]
    reading = (
        "Root mean square of the residuals of each image, and standard deviations of its position"
        " and attitude after the adjustment. An image that stands out above its neighbours has few"
        " points, points in one part of it, or wrong ones."
    )
    label = "image, in the order of the block"
    ends = (0.5, len(images) + 0.5)
    title = "Images one by one"
    return Chart("by-image", title, reading, panels, label, link="image", limits=ends)


def _limits_from_zero(values: Array) -> tuple[float, float]:
    """Limits from zero to somewhat above the largest of the values that are known."""
    finite = values[np.isfinite(values)]
    return 0.0, 1.08 * float(finite.max(initial=1e-9))
