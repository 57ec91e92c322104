"""The charts that convince: what the IMU felt against what GNSS saw.

They are made once it was recognised what the IMU is. Turn rate and specific force of both over the
liveliest minutes lie on each other only if units, axes, signs and clock are right; then how far the
best of the 24 orientations is ahead of the others, and how sharply the time offset stands out.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ...records import Array, Finding
from ..charts.chart import AXES_INKS, Chart, Layer, Panel

# what is shown of the motion: more could not be distinguished
MOST_ROWS_DRAWN, SHORTEST_SHOWN_S, LONGEST_SHOWN_S = 130, 20.0, 150.0
BEST, WORDS_AT = 10, 1.55  # orientations shown, and where on the axis their words stand
SHOWN_LAG_S = 4.0  # on either side of the offset found
BODY = ("forward", "right", "down")
_MOTION_OF_RECORDING = (
    "Turn rate and specific force of the IMU, lines, and what the receiver saw of them, dots, "
    "over the segment with the strongest motion. Both agree only if units, axes, signs and clock "
    "are right."
)
_ORIENTATIONS = (
    "How well each of the 24 orientations of the IMU explains what GNSS saw: 1 perfectly, -1 the"
    " opposite. The best must stand clear of the next one."
)
_CLOCK = (
    "Share of what GNSS saw that the IMU explains, by the time that is added to the GNSS stamps: a"
    " narrow summit is an offset that is well known."
)


def recognition_charts(
    curves: Mapping[str, Array], findings: Sequence[Finding], orientations: Sequence[str]
) -> tuple[Chart, ...]:
    """Return the charts of the curves that `navigation.recognise.recognition` lists, as far as they
    are there.

    Parameters
    ----------
    curves : by name.
    findings : of the recogniser.
    orientations : words of the 24 orientations of curves["orientation"].
    """
    answers = {f.name: f.found for f in findings if f.confidence}
    charts = []
    window = _window(curves)
    if window.any():
        charts.append(_motion(curves, window))
    if "orientation_score" in curves:
        charts.append(_orientations(curves["orientation_score"], orientations, "axes" in answers))
    if "lag_s" in curves and np.isfinite(curves["lag_score"]).any():
        charts.append(_clock(curves, answers.get("time offset", "")))
    return tuple(charts)


def answers_in_words(findings: Sequence[Finding]) -> str:
    """The answers in one line, and the least confidence among them."""
    shown = {
        "gyro unit": "gyro {}",
        "accelerometer unit": "accelerometer {}",
        "force sign": "{}",
        "axes": "x y z point {}",
        "time offset": "{} to add to the GNSS stamps",
    }
    phrased = [(f, shown[f.name]) for f in findings if f.name in shown]
    certain = [text.format(f.found) for f, text in phrased if f.confidence]
    unknown = [f.name for f, _ in phrased if not f.confidence]
    lowest_confidence = min((f.confidence for f, _ in phrased if f.confidence), default=0.0)
    parts = [", ".join(certain) + f" (each at {lowest_confidence:.1%} or more)"] if certain else []
    return "; ".join([*parts, *([f"not determined: {', '.join(unknown)}"] if unknown else [])])


def _window(curves: Mapping[str, Array]) -> NDArray[np.bool_]:
    """Rows of the interval in which GNSS saw most motion."""
    if "time" not in curves or curves["time"].size < 2:
        return np.zeros(0, dtype=bool)
    time, force = curves["time"], curves["force_gnss"]
    length = float(
        np.clip(MOST_ROWS_DRAWN * np.median(np.diff(time)), SHORTEST_SHOWN_S, LONGEST_SHOWN_S)
    )
    if time[-1] - time[0] <= length:
        return np.ones(time.size, dtype=bool)
    moved = np.linalg.norm(force - np.median(force, axis=0), axis=1)
    outlier = moved > 3.0 * np.percentile(moved, 90)  # no motion but an outlier of GNSS
    lively = np.concatenate([[0.0], np.cumsum(np.where(outlier, -10.0 * np.median(moved), moved))])
    end = np.searchsorted(time, time + length)
    first = int(np.argmax(lively[end] - lively[:-1]))
    return np.asarray((time >= time[first]) & (time < time[first] + length))


def _symmetric_limits(*series: Array) -> tuple[float, float] | None:
    """Return limits that a few outliers of GNSS do not widen."""
    finite = np.concatenate([x[np.isfinite(x)] for x in series])
    if not finite.size:
        return None
    low, high = (float(x) for x in np.percentile(finite, [1, 99]))
    margin = 0.25 * max(high - low, 1.0)
    return low - margin, high + margin


def _motion(curves: Mapping[str, Array], window: NDArray[np.bool_]) -> Chart:
    """Turn rate and specific force of both."""
    time = curves["time"][window]
    x = time - time[0]
    gyro, gnss = (np.degrees(curves[name][window]) for name in ("turn_gyro", "turn_gnss"))
    slow = "" if np.isfinite(gnss).any() else " The vehicle moved too slowly for a GNSS course."

    def panel(label: str, felt: Array, of_gnss: Array, k: int) -> Panel:
        layers = [
            Layer("line", x, felt, "felt by the IMU", AXES_INKS[k]),
            Layer("points", x, of_gnss, "seen by GNSS", "ink", width=3.5),
        ]
        return Panel(label, layers, limits=_symmetric_limits(felt, of_gnss))

    panels = [panel("turn rate about the vertical, deg/s", gyro, gnss, 0)]
    for k, name in enumerate(BODY):
        felt, of_gnss = (curves[of][window, k] for of in ("force_imu", "force_gnss"))
        panels.append(panel(f"specific force {name}, m/s\N{SUPERSCRIPT TWO}", felt, of_gnss, k))
    label = f"s after {time[0]:.1f} s"
    return Chart(
        "motion", "What the IMU felt and what GNSS saw", _MOTION_OF_RECORDING + slow, panels, label
    )


def _orientations(score: Array, names: Sequence[str], certain: bool) -> Chart:
    """Return the best of 24 scores, highest on top, marked where it is `certain` to be right."""
    order = np.argsort(score)[-BEST:]
    rank, ordered = np.arange(1.0, order.size + 1.0), score[order]
    texts = [names[k] for k in order]
    best_mark = Layer(
        "points", ordered[-1:], rank[-1:], "found", "second", texts=texts[-1:], width=10.0
    )
    layers = [
        Layer("rules", np.zeros(1), np.zeros(0), ink="faint", width=1.0),
        Layer("points", ordered, rank, ink="faint", texts=texts, width=7.0),
        *([best_mark] if certain else []),
        Layer("labels", np.full(rank.size, WORDS_AT), rank, ink="ink", texts=texts),
    ]
    unsure = "" if certain else " None is sure here."
    return Chart(
        "orientations",
        "How well each orientation of the IMU's x y z fits",
        _ORIENTATIONS + unsure,
        [Panel(f"the best of {score.size}", layers, limits=(0.0, order.size + 1.0))],
        "score, 1 perfect, -1 the opposite",
        limits=(-1.1, 2.0),
    )


def _clock(curves: Mapping[str, Array], offset: str) -> Chart:
    """Return the share of the GNSS motion that the IMU explains, against the time offset.

    `offset` is the offset found, with its unit.
    """
    lag, score = curves["lag_s"], np.maximum(curves["lag_score"], -0.2)
    middle = float(offset.split()[0]) if offset else 0.0
    in_view = np.abs(lag - middle) < SHOWN_LAG_S
    if not in_view.any():
        in_view[:] = True
    layers = [Layer("line", lag[in_view], score[in_view])]
    if offset:
        maximum = np.array([middle])
        layers += [
            Layer("rules", maximum, np.zeros(0), ink="second"),
            Layer("labels", maximum, np.array([0.06]), ink="second", texts=[offset], width=13.0),
        ]
    lowest = min(-0.05, float(np.nanmin(score[in_view])))
    return Chart(
        "clock",
        "Agreement against the time offset",
        _CLOCK,
        [Panel("agreement", layers, limits=(lowest, 1.05))],
        "added to the GNSS stamps, s",
    )
