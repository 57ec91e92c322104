"""The picture of one sensor's noise.

Deviation over averaging time with intervals, the fitted sum, and its processes one by one.

Drawn is the Allan deviation sqrt(2 nu) of the Haar wavelet variance nu, in deg/h or micro-g as data
sheets have it. White noise falls with the root of time, quantization as time, random walk rises
with the root; a Gauss-Markov process is a hump with its top at 1.9 correlation times. And the
spectrum of the same sensor in straight flight, where lines of the propellers stand out.
"""

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ...base.units import parse_unit
from ...records import WaveletVariance
from .style import ACCENT, DPI, FAINT, LINE, WARN, dress, png

Array = NDArray[np.float64]
Sensor = Literal["gyro", "accel"]

UNIT = {"gyro": "deg/h", "accel": "ug"}
PART_COLOURS = {
    "white_noise": "#009E73",
    "quantization": "#CC79A7",
    "random_walk": "#56B4E9",
    "drift": "#7F6A50",
    "gauss_markov": ("#D55E00", "#E69F00", "#7B3294", "#A6611A", "#7F8C1A"),
}
NAMES = {"gyro": "Gyroscope", "accel": "Accelerometer"}
# relative, of deviations: smaller ones are not worth a ring, though long recordings tell them
MISFIT = 0.05
TIMES = {
    60.0: "1 min",
    600.0: "10 min",
    3600.0: "1 h",
    10800.0: "3 h",
    36000.0: "10 h",
    86400.0: "1 d",
}
_WIDTH, _ROW, _FOOT = 11.0, 2.75, 0.62  # inches
_TITLE_LETTERS, _SUBTITLE_LETTERS = 84, 130
_LEFT, _RIGHT = 0.075, 0.69


@dataclass(frozen=True, eq=False)
class NoisePanel:
    """One panel: the curves of one axis, or of axes that share a model, and the fitted model.

    Parameters
    ----------
    title : such as "x".
    curves, labels : one a recording.
    levels : those the fit used, all where None. tau_s (k,), modelled (k,) : averaging times and
        wavelet variance, X^2, of the sum; empty where nothing was fitted.
    parts : wavelet variance (k,) of each process by its name as
        `stochastic.theory.haar_variance_parts` has it.
    part_labels : words of each process, such as `process_label` writes.
    words : of the verdict, a few lines.
    """

    title: str
    curves: Sequence[WaveletVariance]
    labels: Sequence[str]
    tau_s: Array
    modelled: Array
    parts: Mapping[str, Array]
    part_labels: Mapping[str, str]
    levels: Sequence[int] | None = None
    words: Sequence[str] = ()


@dataclass(frozen=True, eq=False)
class SpectrumPanel:
    """Root density of one channel, X/sqrt(Hz), as the noise model has it.

    White noise q is level at q. `frequency_hz` and `density` are (n,).

    Parameters
    ----------
    models : words and density (n,) of each.
    lines_hz : where lines stand out.
    """

    sensor: Sensor
    title: str
    frequency_hz: Array
    density: Array
    models: Sequence[tuple[str, Array]] = ()
    lines_hz: Sequence[float] = ()


def process_label(sensor: Sensor, process: str, value: float, time_s: float | None = None) -> str:
    """Words of a process with its strength in the units of data sheets.

    Parameters
    ----------
    process : name of a part, "gauss_markov_1" and the like with their correlation time, s.
    value : SI; of a Gauss-Markov process its stationary standard deviation.
    """
    kind = "gauss_markov" if process.startswith("gauss_markov") else process
    units = {
        "white_noise": f"{UNIT[sensor]}/sqrt(Hz)",
        "quantization": "urad" if sensor == "gyro" else "mm/s",
        "random_walk": f"{UNIT[sensor]}/s/sqrt(Hz)" if sensor == "accel" else "deg/h/s/sqrt(Hz)",
        "drift": f"{UNIT[sensor]}/h",
        "gauss_markov": UNIT[sensor],
    }
    strength = f"{_number(value / parse_unit(units[kind]).scale)} {_pretty(units[kind])}"
    if kind != "gauss_markov":
        return f"{kind.replace('_', ' ')}  {strength}"
    return (
        f"Gauss-Markov  {_duration(time_s)}, {strength}"
        if time_s is not None
        else f"Gauss-Markov  {strength}"
    )


def draw_noise(
    sensor: Sensor, panels: Sequence[NoisePanel], title: str, subtitle: str = ""
) -> bytes:
    """PNG of all panels of a sensor, one under the other.

    Parameters
    ----------
    title : the verdict in a few words; subtitle : model, recordings, what was left out.
    """
    from matplotlib.figure import Figure

    title, subtitle, head = _wrapped(f"{NAMES[sensor]}: {title}", subtitle)
    height = head + _FOOT + _ROW * len(panels) + (0.9 if len(panels) == 1 else 0.0)
    figure = Figure(figsize=(_WIDTH, height), dpi=DPI, facecolor="white")
    _head(figure, height, title, subtitle)
    factor = 1.0 / parse_unit(UNIT[sensor]).scale
    tau = _span([curve.averaging_time_s for panel in panels for curve in panel.curves])
    axes = figure.subplots(len(panels), 1, squeeze=False, sharex=True)[:, 0]
    figure.subplots_adjust(
        left=_LEFT, right=_RIGHT, top=1.0 - head / height, bottom=_FOOT / height, hspace=0.14
    )
    for ax, panel in zip(axes, panels, strict=True):
        dress(ax)
        _panel(ax, panel, factor)
        _log(ax, tau, _heights(panel, factor))
        ax.set_ylabel(f"{panel.title}: deviation, {_pretty(UNIT[sensor])}", size=9)
    axes[-1].set_xlabel("averaging time, s", size=9)
    _clock(axes[0], tau)
    return png(figure)


def draw_psd(panels: Sequence[SpectrumPanel], title: str, subtitle: str = "") -> bytes:
    """PNG of spectra beside the noise models they are to be compared with.

    A column a sensor, in the order of the panels.
    """
    from matplotlib.figure import Figure

    sensors = list(dict.fromkeys(panel.sensor for panel in panels))
    rows = max(sum(panel.sensor == sensor for panel in panels) for sensor in sensors)
    title, subtitle, head = _wrapped(title, subtitle)
    height = head + _FOOT + 2.3 * rows
    figure = Figure(figsize=(_WIDTH, height), dpi=DPI, facecolor="white")
    _head(figure, height, title, subtitle)
    axes = figure.subplots(rows, len(sensors), squeeze=False, sharex=True)
    figure.subplots_adjust(
        left=_LEFT,
        right=0.985,
        top=1.0 - head / height,
        bottom=_FOOT / height,
        hspace=0.16,
        wspace=0.17,
    )
    for k, sensor in enumerate(sensors):
        own = [panel for panel in panels if panel.sensor == sensor]
        for row in range(rows):
            if row >= len(own):
                axes[row, k].set_axis_off()
                continue
            _spectrum(axes[row, k], own[row], first=row == 0)
        axes[len(own) - 1, k].set_xlabel("frequency, Hz", size=9)
    named = {
        label: handle
        for ax in figure.axes
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True)
    }
    anchor: dict[str, Any] = {
        "loc": "upper right",
        "bbox_to_anchor": (0.985, 1.0 - (head - 0.41) / height),
        "borderaxespad": 0.0,
    }
    figure.legend(
        list(named.values()),
        list(named),
        ncols=len(named),
        frameon=False,
        fontsize=8.5,
        handlelength=1.6,
        **anchor,
    )
    return png(figure)


def _panel(ax: Any, panel: NoisePanel, factor: float) -> None:
    """Curves, model and processes of one panel, and what they are to the right of it."""
    several = len(panel.curves) > 1
    for k, (curve, label) in enumerate(zip(panel.curves, panel.labels, strict=True)):
        words = f"{len(panel.curves)} recordings" if several else label
        _curve(ax, panel, curve, factor, words if k == 0 else None, several)
    if panel.modelled.size:
        ax.plot(
            panel.tau_s,
            factor * _deviation(panel.modelled),
            color="black",
            lw=1.5,
            label="fitted sum of",
            zorder=4,
        )
    colours = iter(PART_COLOURS["gauss_markov"])
    for name, variance in panel.parts.items():
        colour = next(colours, FAINT) if name.startswith("gauss_markov") else PART_COLOURS[name]
        ax.plot(
            panel.tau_s,
            factor * _deviation(variance),
            color=colour,
            lw=1.1,
            ls=(0, (5, 2)),
            label=panel.part_labels[name],
            zorder=3,
        )
    anchor = {"loc": "upper left", "bbox_to_anchor": (1.015, 1.02), "borderaxespad": 0.0}
    ax.legend(frameon=False, fontsize=8.5, handlelength=2.0, labelspacing=0.45, **anchor)
    if panel.words:
        ax.text(
            1.022,
            0.0,
            "\n".join(panel.words),
            transform=ax.transAxes,
            size=8.5,
            va="bottom",
            color="#333333",
            linespacing=1.35,
        )


def _curve(
    ax: Any,
    panel: NoisePanel,
    curve: WaveletVariance,
    factor: float,
    label: str | None,
    light: bool,
) -> None:
    """One recording: dots with their intervals.

    Grey where the fit left them out, ringed where the fit is clearly off.
    """
    tau, deviation = curve.averaging_time_s, factor * _deviation(curve.variance)
    low, high = factor * _deviation(curve.low), factor * _deviation(curve.high)
    used = (
        np.ones(tau.size, dtype=bool)
        if panel.levels is None
        else np.isin(curve.level, panel.levels)
    )
    faint, size = (0.45, 2.8) if light else (1.0, 4.2)
    ax.fill_between(tau, low, high, color=LINE, alpha=0.07 if light else 0.16, lw=0, zorder=1)
    ax.plot(tau, deviation, color=LINE, lw=0.8, alpha=0.6 * faint, zorder=2)
    for mask, colour, words in (
        (used, LINE, label and f"{label}, 95 %"),
        (~used, "#B4B9C1", label and "left out of the fit"),
    ):
        if mask.any():
            ax.plot(
                tau[mask],
                deviation[mask],
                "o",
                ms=size,
                color=colour,
                alpha=faint,
                label=words,
                zorder=5,
            )
            if not light:
                ax.vlines(tau[mask], low[mask], high[mask], color=colour, lw=0.9, zorder=5)
    if not light and panel.modelled.size:
        model = factor * np.exp(
            np.interp(np.log(tau), np.log(panel.tau_s), np.log(_deviation(panel.modelled)))
        )
        off = used & ((model < low) | (model > high)) & (np.abs(model / deviation - 1.0) > MISFIT)
        if off.any():
            ax.plot(
                tau[off],
                deviation[off],
                "o",
                mfc="none",
                mec=WARN,
                ms=8.5,
                mew=1.2,
                label=f"fit off by more than {100 * MISFIT:g} %",
                zorder=6,
            )


def _spectrum(ax: Any, panel: SpectrumPanel, first: bool) -> None:
    dress(ax)
    factor = 1.0 / parse_unit(UNIT[panel.sensor]).scale
    inside = panel.frequency_hz > 0.0
    f, density = panel.frequency_hz[inside], factor * panel.density[inside]
    ax.plot(f, density, color=LINE, lw=0.8, label="in straight flight", zorder=2)
    for (words, model), style in zip(
        panel.models, ({"color": "black"}, {"color": ACCENT}, {"color": "#009E73"}), strict=False
    ):
        ax.plot(f, factor * model[inside], lw=1.4, label=words, zorder=3, **style)
    shown = np.concatenate([density, *(factor * model[inside] for _, model in panel.models)])
    top = 1.8 * float(shown.max())
    _log(ax, (float(f[0]), float(f[-1])), (0.6 * float(shown[shown > 0.0].min()), top))
    lines = sorted(panel.lines_hz)
    for number, frequency in enumerate(lines):
        ax.axvline(
            frequency,
            color=WARN,
            lw=0.8,
            ls=":",
            zorder=1,
            label="lines (propellers)" if number == 0 else None,
        )
    apart = [
        frequency for k, frequency in enumerate(lines) if k == 0 or frequency > 1.25 * lines[k - 1]
    ]
    unit = _pretty(f"{UNIT[panel.sensor]}/sqrt(Hz)")
    ax.set_ylabel(f"{panel.title}: {unit}", size=9)
    for frequency in apart:
        ax.annotate(
            f"{frequency:.3g} Hz",
            (frequency, top),
            (0, 4),
            textcoords="offset points",
            size=7.5,
            ha="center",
            color=WARN,
        )
    if first:
        ax.set_title(NAMES[panel.sensor], size=9.5, loc="left", pad=7)


def _wrapped(title: str, subtitle: str) -> tuple[str, str, float]:
    """Title and subtitle in lines that fit, and the inches above the panels that they take."""
    above, below = textwrap.wrap(title, _TITLE_LETTERS), textwrap.wrap(subtitle, _SUBTITLE_LETTERS)
    return "\n".join(above), "\n".join(below), 0.67 + 0.22 * len(above) + 0.17 * len(below)


def _head(figure: Any, height: float, title: str, subtitle: str) -> None:
    figure.text(_LEFT, 1.0 - 0.16 / height, title, size=13, weight="bold", va="top")
    figure.text(
        _LEFT,
        1.0 - (0.21 + 0.22 * (title.count("\n") + 1)) / height,
        subtitle,
        size=9.5,
        color="#333333",
        va="top",
    )


def _log(ax: Any, x: tuple[float, float], y: tuple[float, float]) -> None:
    """Logarithmic axes with the given limits and plain numbers."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_xlim(*x)
    ax.set_ylim(*y)
    for axis, (low, high) in ((ax.xaxis, x), (ax.yaxis, y)):
        axis.set_major_locator(
            LogLocator(subs=(1.0,) if high / low > 60.0 else (1.0, 2.0, 5.0), numticks=20)
        )
        axis.set_minor_locator(LogLocator(subs=tuple(range(2, 10)), numticks=20))
        axis.set_minor_formatter(NullFormatter())
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.grid(True, which="minor", color="#F1F3F5", lw=0.5)
    ax.tick_params(which="minor", length=2, color="#C8CCD2")


def _clock(ax: Any, tau: tuple[float, float]) -> None:
    """Minutes and hours along the top."""
    from matplotlib.ticker import NullLocator

    top = ax.secondary_xaxis("top")
    shown = {seconds: words for seconds, words in TIMES.items() if tau[0] < seconds < tau[1]}
    top.set_xticks(list(shown), list(shown.values()), fontsize=8)
    top.xaxis.set_minor_locator(NullLocator())
    top.tick_params(length=3, color=FAINT)
    top.spines["top"].set_visible(False)


def _heights(panel: NoisePanel, factor: float) -> tuple[float, float]:
    """Limits of the vertical axis: all deviations and the sum.

    Intervals and processes may run out of it.
    """
    shown = np.concatenate(
        [
            factor * _deviation(np.asarray(v))
            for v in (*(c.variance for c in panel.curves), panel.modelled)
        ]
    )
    return 0.25 * float(shown.min()), 1.8 * float(shown.max())


def _span(times: Sequence[Array]) -> tuple[float, float]:
    return min(float(t.min()) for t in times) / 1.4, max(float(t.max()) for t in times) * 1.4


def _deviation(variance: Array) -> Array:
    """Allan deviation of a wavelet variance."""
    return np.asarray(np.sqrt(2.0 * variance))


def _number(value: float) -> str:
    """Three digits, without exponent where that is readable."""
    return f"{float(f'{value:.3g}'):g}"


def _duration(seconds: float) -> str:
    for unit, length, until in (
        ("ms", 1e-3, 0.1),
        ("s", 1.0, 600.0),
        ("min", 60.0, 7200.0),
        ("h", 3600.0, 172800.0),
    ):
        if seconds < until:
            return f"{_number(seconds / length)} {unit}"
    return f"{_number(seconds / 86400.0)} d"


def _pretty(unit: str) -> str:
    """A unit as people write it."""
    return (
        unit.replace("sqrt(Hz)", "\N{SQUARE ROOT}Hz")
        .replace("ug", "\N{MICRO SIGN}g")
        .replace("urad", "\N{MICRO SIGN}rad")
    )
