"""Pictures of an adjusted image block: residuals on the format, the map, images, precision."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..markup import Picture
from .style import ACCENT, AXIS_COLOURS, FAINT, LINE, WARN, legend, length_unit, png, sheet

Array = NDArray[np.float64]
MOST_POINTS = 6000
SHARE = 0.06  # of the map's width that the longest usual arrow has
STRONG = 0.9  # a correlation that is printed


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


def pictures(
    figures: Mapping[str, Any], fields: Sequence[Field], ground: Ground
) -> tuple[Picture, ...]:
    """All pictures for which there is something to show.

    Parameters
    ----------
    figures : of adjust.json.
    fields : mean residuals, a camera each.
    ground : what lies where.
    """
    drawn = [_map(figures, ground), precision_map(figures, ground)]
    drawn += [_format(field) for field in fields if len(field.mean)]
    drawn += [_images(figures)]
    drawn += [_correlations(c) for c in figures["cameras"] if len(c["correlated"]) > 1]
    return tuple(drawn)


def _map(figures: Mapping[str, Any], ground: Ground) -> Picture:
    """Images, flight lines, control and check points with their residuals."""
    figure, axes = sheet(1, 1, 8.5)
    ax = axes[0, 0]
    X = ground.position
    shown = ground.point[:: max(1, len(ground.point) // MOST_POINTS)]
    shown = shown[ground.around(shown)]
    ax.plot(*shown[:, :2].T, ".", color="#C3C9D2", ms=1, zorder=1)
    low, high = X[:, :2].min(axis=0), X[:, :2].max(axis=0)
    margin = 0.25 * float(max(high - low)) + 20.0
    for k, rows in enumerate(ground.lines):
        if len(rows) > 1:
            own = X[rows]
            ax.plot(own[:, 0], own[:, 1], "-", color=FAINT, lw=0.8, zorder=2)
            ax.annotate(str(k + 1), own[0, :2], fontsize=7, color=FAINT)
    ax.plot(X[:, 0], X[:, 1], ".", color=LINE, ms=4, zorder=3, label="image")
    arrows = []
    for kind, key, colour, shape in (
        ("ground control", "residual_m", ACCENT, "^"),
        ("check point", "difference_m", AXIS_COLOURS[2], "s"),
    ):
        points = [p for p in figures[_NAMES[kind]] if key in p]
        if not points:
            continue
        ends = np.array([p["position_m"] for p in points])
        d = np.array([p[key] for p in points])
        ax.plot(ends[:, 0], ends[:, 1], shape, mfc="none", mec=colour, ms=7, zorder=5, label=kind)
        for p, x in zip(points, ends, strict=True):
            ax.annotate(p["point"], x[:2], xytext=(5, 4), textcoords="offset points", fontsize=7)
        arrows.append((ends, d, colour))
    reading = "Dots are images, grey lines flight lines, with their numbers at the first image."
    if arrows:
        every = np.vstack([d for _, d, _ in arrows])
        usual = float(np.quantile(np.linalg.norm(every, axis=1), 0.9))
        factor = SHARE * float(max(high - low).item() + 2.0 * margin) / max(usual, 1e-9)
        for ends, d, colour in arrows:
            ax.quiver(
                *ends[:, :2].T,
                *(factor * d[:, :2]).T,
                color=colour,
                angles="xy",
                scale_units="xy",
                scale=1.0,
                width=0.003,
                zorder=6,
            )
            for x, up in zip(ends, d[:, 2], strict=True):
                ax.plot([x[0], x[0]], [x[1], x[1] + factor * up], color=WARN, lw=2.0, alpha=0.7)
        scale, unit = length_unit(usual)
        reading += (
            f" Arrows: surveyed minus adjusted, east and north, {factor:.0f} times enlarged"
            f" (nine tenths are below {scale * usual:.1f} {unit}); bars: the same of the height,"
            " up is up."
        )
    ax.set_aspect("equal", adjustable="datalim")
    ax.set_xlabel("east, m")
    ax.set_ylabel("north, m")
    legend(ax)
    return Picture("map", "The block", reading, png(figure))


_NAMES = {"ground control": "ground_control", "check point": "check_points"}


def precision_map(
    figures: Mapping[str, Any], ground: Ground, proposed: Array | None = None
) -> Picture:
    """Standard deviations of the heights of the object points.

    Parameters
    ----------
    figures : of adjust.json.
    ground : what lies where.
    proposed : (2,) or (3,) where one more control point would help; None: nowhere.
    """
    figure, axes = sheet(1, 1, 8.0)
    figure.subplots_adjust(right=0.94)
    ax = axes[0, 0]
    near = np.flatnonzero(ground.around(ground.point))
    near = near[:: max(1, near.size // MOST_POINTS)]
    up = 1e3 * ground.sigma[near, 2]
    low, high = np.quantile(up, (0.02, 0.95)) if near.size else (0.0, 1.0)
    drawn = ax.scatter(*ground.point[near, :2].T, c=up, s=5, cmap="viridis", vmin=low, vmax=high)
    figure.colorbar(drawn, ax=ax, label="sigma of the height, mm", fraction=0.04, pad=0.02)
    control = np.array([p["position_m"] for p in figures["ground_control"]]).reshape(-1, 3)
    if len(control):
        ax.plot(*control[:, :2].T, "^", mfc="none", mec=ACCENT, ms=8, label="ground control")
    if proposed is not None:
        ax.plot(*proposed[:2], "*", color=WARN, ms=14, label="one more would help here")
    ax.set_aspect("equal", adjustable="datalim")
    ax.set_xlabel("east, m")
    ax.set_ylabel("north, m")
    if len(control) or proposed is not None:
        legend(ax)
    reading = (
        "Each dot is an object point; its colour is the standard deviation of its height. Points of"
        " two images, at the rim, are worse than those of many; colours that change over the whole"
        " block ask for ground control where they are yellow."
    )
    return Picture("precision", "Precision of the object points", reading, png(figure))


def _format(field: Field) -> Picture:
    """Mean residuals by place on the format."""
    figure, axes = sheet(1, 1, 7.0)
    ax = axes[0, 0]
    width, height = field.size
    size = np.linalg.norm(field.mean, axis=1)
    noise = float(np.sqrt((field.sigma**2).sum(axis=1).mean()))
    factor = 0.06 * width / max(float(np.quantile(size, 0.9)), noise, 1e-9)
    ax.quiver(
        *field.centre.T,
        *(factor * field.mean).T,
        color=LINE,
        angles="xy",
        scale_units="xy",
        scale=1.0,
        width=0.003,
    )
    ax.add_patch(_circle((0.07 * width, 0.07 * height), factor * noise))
    ax.set_xlim(0.0, width)
    ax.set_ylim(height, 0.0)
    ax.set_aspect("equal")
    ax.set_xlabel("x, px")
    ax.set_ylabel("y, px")
    reading = (
        f"Mean residuals of the image observations of {field.camera} in cells of the format,"
        f" {factor:.0f} times enlarged; the circle at the upper left is what chance gives"
        f" ({noise:.3f} px). Arrows that are longer and agree with their neighbours show what the"
        " interior orientation does not describe."
    )
    name = "".join(c if c.isalnum() else "_" for c in field.camera)
    return Picture(
        f"format_{name}", f"Residuals on the format: {field.camera}", reading, png(figure)
    )


def _circle(centre: tuple[float, float], radius: float) -> Any:
    from matplotlib.patches import Circle

    return Circle(centre, radius, fill=False, color=WARN, lw=1.0)


def _images(figures: Mapping[str, Any]) -> Picture:
    """Residuals and precision image by image."""
    images = figures["images"]
    figure, axes = sheet(3, 1, 7.5, sharex=True)
    number = np.arange(1, len(images) + 1)
    rms = np.array([np.nan if i["rms_px"] is None else i["rms_px"] for i in images])
    axes[0, 0].plot(number, rms, ".", color=LINE, ms=4)
    axes[0, 0].set_ylabel("rms, px")
    axes[0, 0].set_ylim(0.0, None)
    sigma = 1e3 * np.array([i["sigma_m"] for i in images])
    angle = np.degrees([i["sigma_rad"] for i in images])
    for k, (axis, colour) in enumerate(zip("ENU", AXIS_COLOURS, strict=True)):
        axes[1, 0].plot(number, sigma[:, k], ".", color=colour, ms=4, label=axis)
        axes[2, 0].plot(number, 1e3 * angle[:, k], ".", color=colour, ms=4, label=f"psi {axis}")
    axes[1, 0].set_ylabel("sigma, mm")
    axes[2, 0].set_ylabel("sigma, mdeg")
    for ax in axes[1:, 0]:
        ax.set_ylim(0.0, None)
        legend(ax)
    axes[2, 0].set_xlabel("image, in the order of the block")
    reading = (
        "Root mean square of the residuals of each image, and standard deviations of its position"
        " and attitude after the adjustment. An image that stands out above its neighbours has few"
        " points, points in one part of it, or wrong ones."
    )
    return Picture("images", "Images one by one", reading, png(figure))


def _correlations(camera: Mapping[str, Any]) -> Picture:
    """Correlations of the interior orientation."""
    names = camera["correlated"]
    rho = np.array(camera["correlation"])
    figure, axes = sheet(1, 1, 5.5)
    ax = axes[0, 0]
    ax.grid(False)
    ax.imshow(rho, cmap="RdBu_r", vmin=-1.0, vmax=1.0)
    for i in range(len(names)):
        for j in range(len(names)):
            if i != j:
                strong = abs(rho[i, j]) > STRONG
                ax.text(
                    j,
                    i,
                    f"{rho[i, j]:+.2f}",
                    ha="center",
                    va="center",
                    fontsize=7,
                    color="white" if strong else "black",
                )
    ax.set_xticks(range(len(names)), names)
    ax.set_yticks(range(len(names)), names)
    name = "".join(c if c.isalnum() else "_" for c in camera["name"])
    reading = (
        f"Correlations of the parameters of {camera['name']}. Coefficients of one polynomial are"
        " strongly correlated always; only what they make of a ray together counts."
    )
    return Picture(
        f"correlations_{name}", f"Interior orientation: {camera['name']}", reading, png(figure)
    )
