"""The picture that convinces: what the IMU felt against what GNSS saw.

It is drawn once it was recognised what the IMU is.

Left, turn rate and specific force of both over the liveliest minutes: they lie on each other only
if units, axes, signs and clock are right. Right, how far the best of the 24 orientations is ahead
of the others, and how sharply the time offset stands out.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from .style import ACCENT, AXIS_COLOURS, DPI, FAINT, LINE, dress, legend, png

Array = NDArray[np.float64]

ROWS, SHORTEST_S, LONGEST_S = (
    130,
    20.0,
    150.0,
)  # what the left-hand side shows: more could not be distinguished
LAG_S = 4.0  # on either side of the offset found
BODY = ("forward", "right", "down")
GNSS_STYLE = {
    "color": "black",
    "lw": 0.0,
    "marker": ".",
    "ms": 4.5,
    "alpha": 0.75,
    "label": "seen by GNSS",
}


class Finding(Protocol):
    """One answer of the recogniser."""

    @property
    def name(self) -> str:
        """The question, such as "axes"."""

    @property
    def value(self) -> str:
        """The answer."""

    @property
    def confidence(self) -> float:
        """Probability that it is right."""


def recognition_picture(
    curves: Mapping[str, Array],
    findings: Sequence[Finding],
    orientations: Sequence[str],
    title: str,
) -> bytes:
    """PNG of the curves that `recognise.recognition` lists; what is absent is noted.

    Parameters
    ----------
    orientations : words of the 24 orientations of curves["orientation"].
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 7.4), dpi=DPI, facecolor="white")
    grid = figure.add_gridspec(
        4,
        2,
        width_ratios=(2.1, 1.0),
        left=0.062,
        right=0.985,
        top=0.855,
        bottom=0.07,
        hspace=0.42,
        wspace=0.36,
    )
    figure.text(
        0.062, 0.955, f"{title}: what the IMU felt and what GNSS saw", size=14, weight="bold"
    )
    figure.text(0.062, 0.915, _verdict(findings), size=10.5)
    window = _window(curves)
    turn = figure.add_subplot(grid[0, 0])
    _turns(turn, curves, window)
    for k in range(3):
        _force(figure.add_subplot(grid[k + 1, 0], sharex=turn), curves, window, k)
    right = grid[:, 1].subgridspec(2, 1, height_ratios=(2.6, 1.0), hspace=0.3)
    answers = {f.name: f.value for f in findings if f.confidence}
    _orientations(figure.add_subplot(right[0]), curves, orientations, "axes" in answers)
    _lag(figure.add_subplot(right[1]), curves, answers.get("time offset", ""))
    return png(figure)


def _verdict(findings: Sequence[Finding]) -> str:
    """The answers in one line, and the least confidence among them."""
    shown = {
        "gyro unit": "gyro {}",
        "accelerometer unit": "accelerometer {}",
        "force sign": "{}",
        "axes": "x y z point {}",
        "time offset": "{} to add to the GNSS stamps",
    }
    phrased = [(f, shown[f.name]) for f in findings if f.name in shown]
    certain = [text.format(f.value) for f, text in phrased if f.confidence]
    unknown = [f.name for f, _ in phrased if not f.confidence]
    least = min((f.confidence for f, _ in phrased if f.confidence), default=0.0)
    parts = [", ".join(certain) + f"   (each at {least:.1%} or more)"] if certain else []
    return "   ".join([*parts, *([f"not determined: {', '.join(unknown)}"] if unknown else [])])


def _window(curves: Mapping[str, Array]) -> NDArray[np.bool_]:
    """Rows of the interval in which GNSS saw most motion."""
    if "time" not in curves or curves["time"].size < 2:
        return np.zeros(0, dtype=bool)
    time, force = curves["time"], curves["force_gnss"]
    length = float(np.clip(ROWS * np.median(np.diff(time)), SHORTEST_S, LONGEST_S))
    if time[-1] - time[0] <= length:
        return np.ones(time.size, dtype=bool)
    moved = np.linalg.norm(force - np.median(force, axis=0), axis=1)
    odd = moved > 3.0 * np.percentile(moved, 90)  # no motion but an outlier of GNSS
    lively = np.concatenate([[0.0], np.cumsum(np.where(odd, -10.0 * np.median(moved), moved))])
    end = np.searchsorted(time, time + length)
    first = int(np.argmax(lively[end] - lively[:-1]))
    return np.asarray((time >= time[first]) & (time < time[first] + length))


def _reach(ax: Any, *series: Array) -> None:
    """Set limits that a few outliers of GNSS do not widen."""
    finite = np.concatenate([x[np.isfinite(x)] for x in series])
    if finite.size:
        low, high = np.percentile(finite, [1, 99])
        margin = 0.25 * max(float(high - low), 1.0)
        ax.set_ylim(low - margin, high + margin)


def _turns(ax: Any, curves: Mapping[str, Array], window: NDArray[np.bool_]) -> None:
    dress(ax)
    ax.set_title("Rate of turn about the vertical, deg/s", loc="left", size=9)
    if not window.any():
        _absent(ax, "GNSS and IMU show no common motion")
        return
    time = curves["time"][window]
    gyro, gnss = (np.degrees(curves[name][window]) for name in ("turn_gyro", "turn_gnss"))
    ax.plot(time - time[0], gyro, color=LINE, lw=1.1, label="felt by the IMU")
    ax.plot(time - time[0], gnss, **GNSS_STYLE)
    if not np.isfinite(gnss).any():
        ax.text(
            0.01,
            0.06,
            "too slow for GNSS to have a course",
            transform=ax.transAxes,
            color=FAINT,
            size=8,
        )
    _reach(ax, gyro, gnss)
    legend(ax)


def _force(ax: Any, curves: Mapping[str, Array], window: NDArray[np.bool_], k: int) -> None:
    dress(ax)
    ax.set_title(f"Specific force {BODY[k]}, m/s$^2$", loc="left", size=9)
    if not window.any():
        _absent(ax, "nothing to compare")
        return
    time = curves["time"][window]
    felt, seen = curves["force_imu"][window, k], curves["force_gnss"][window, k]
    ax.plot(time - time[0], felt, color=AXIS_COLOURS[k], lw=1.1)
    ax.plot(time - time[0], seen, **GNSS_STYLE)
    _reach(ax, felt, seen)
    if k == 2:
        ax.set_xlabel(f"s after {time[0]:.1f} s")


def _orientations(
    ax: Any, curves: Mapping[str, Array], orientations: Sequence[str], certain: bool
) -> None:
    """Bars of the 24 scores, the best on top, and marked where it is `certain` to be right."""
    dress(ax)
    ax.set_title("How well each orientation of the IMU's x y z fits", loc="left", size=9)
    if "orientation_score" not in curves:
        _absent(ax, "no orientation was found")
        return
    score = curves["orientation_score"]
    order = np.argsort(score)
    colours = [FAINT] * (order.size - 1) + [ACCENT if certain else FAINT]
    ax.barh(np.arange(order.size), score[order], color=colours, height=0.72)
    ax.set_yticks(np.arange(order.size), [orientations[k] for k in order], size=7)
    if certain:
        ax.get_yticklabels()[-1].set_weight("bold")
    else:
        ax.text(
            0.98,
            0.02,
            "none is sure",
            transform=ax.transAxes,
            ha="right",
            color=ACCENT,
            size=10,
            weight="bold",
        )
    ax.axvline(0.0, color=FAINT, lw=0.8)
    ax.set_xlim(-1.05, 1.05)
    ax.set_ylim(-0.7, order.size - 0.3)
    ax.set_xlabel("score, 1 perfect, -1 the opposite")


def _lag(ax: Any, curves: Mapping[str, Array], offset: str) -> None:
    """Share of what GNSS saw that the IMU explains, against the time offset.

    `offset` is the offset found, with its unit.
    """
    dress(ax)
    ax.set_title("Agreement against the time offset", loc="left", size=9)
    ax.set_xlabel("added to the GNSS stamps, s")
    if "lag_s" not in curves or not np.isfinite(curves["lag_score"]).any():
        _absent(ax, "no time offset was found")
        return
    lag, score = curves["lag_s"], np.maximum(curves["lag_score"], -0.2)
    middle = float(offset.split()[0]) if offset else 0.0
    wide = np.abs(lag - middle) < LAG_S
    if not wide.any():
        wide[:] = True
    ax.plot(lag[wide], score[wide], color=LINE, lw=1.2)
    if offset:
        ax.axvline(middle, color=ACCENT, lw=1.0)
        ax.annotate(
            offset,
            (middle, 0.06),
            xytext=(6, 0),
            textcoords="offset points",
            size=10,
            color=ACCENT,
            weight="bold",
        )
    ax.set_ylim(min(-0.05, float(np.nanmin(score[wide]))), 1.05)


def _absent(ax: Any, why: str) -> None:
    ax.text(0.5, 0.5, why, transform=ax.transAxes, ha="center", va="center", color=FAINT, size=9)
    ax.set_xticks([])
    ax.set_yticks([])
