"""Charts of a sensor's noise.

Deviation over averaging time with intervals, the fitted sum, and its processes one by one.

Shown is the Allan deviation sqrt(2 nu) of the Haar wavelet variance nu, in deg/h or micro-g as data
sheets have it. White noise falls with the root of time, quantization as time, random walk rises
with the root; a Gauss-Markov process is a hump with its top at 1.9 correlation times. And the
spectrum of the same sensor in straight flight, where lines of the propellers stand out.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...base.units import parse_unit
from ...records import Array, WaveletVariance
from ..charts.chart import Chart, Ink, Layer, Panel

Sensor = Literal["gyro", "accel"]

AXIS_UNITS = {"gyro": "deg/h", "accel": "ug"}
PART_INKS: Mapping[str, Ink] = {
    "white_noise": "third",
    "quantization": "fourth",
    "random_walk": "first",
    "drift": "faint",
    "gauss_markov_1": "second",
    "gauss_markov_2": "fifth",
    "gauss_markov_3": "fourth",
}
SENSOR_NAMES = {"gyro": "Gyroscope", "accel": "Accelerometer"}
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
MODEL_INKS: tuple[Ink, ...] = ("ink", "second", "third")
_CURVES = (
    "Dots are the deviation of the recordings with 95 % intervals, the dark line is the fitted sum"
    " of the processes, which are dashed. White noise falls with the root of time, quantization as"
    " time, random walk rises with the root, a Gauss-Markov process is a hump at 1.9 correlation"
    " times. Rings: the fit is off there by more than chance and {misfit:g} % explain."
)
_SPECTRUM = (
    "Root spectral density in straight, level flight against the noise models it is to be compared"
    " with, which white noise makes level. Red: frequencies that stand out, such as those of the"
    " propellers."
)


@dataclass(frozen=True, eq=False)
class NoisePanel:
    """One panel: the curves of one axis, or of axes that share a model, and the fitted model.

    Parameters
    ----------
    title : such as "x".
    curves, labels : one a recording.
    tau_s, modelled : averaging times and wavelet variance, X^2, of the sum, (k,) both; empty where
        nothing was fitted.
    parts : wavelet variance (k,) of each process by its name as
        `stochastic.theory.haar_variance_parts` has it.
    part_labels : words of each process, such as `process_label` writes.
    levels : those the fit used, all where None.
    words : of the sum, such as "J test: p = 0.3".
    """

    title: str
    curves: Sequence[WaveletVariance]
    labels: Sequence[str]
    tau_s: Array
    modelled: Array
    parts: Mapping[str, Array]
    part_labels: Mapping[str, str]
    levels: Sequence[int] | None = None
    words: str = ""


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


def process_label(sensor: Sensor, kind: str, value: float, time_s: float | None = None) -> str:
    """Words of a process with its strength in the units of data sheets.

    Parameters
    ----------
    kind : "white_noise" and the like; "gauss_markov" with its correlation time, s.
    value : SI; of a Gauss-Markov process its stationary standard deviation.
    """
    units = {
        "white_noise": f"{AXIS_UNITS[sensor]}/sqrt(Hz)",
        "quantization": "urad" if sensor == "gyro" else "mm/s",
        "random_walk": f"{AXIS_UNITS[sensor]}/s/sqrt(Hz)"
        if sensor == "accel"
        else "deg/h/s/sqrt(Hz)",
        "drift": f"{AXIS_UNITS[sensor]}/h",
        "gauss_markov": AXIS_UNITS[sensor],
    }
    strength = f"{_number(value / parse_unit(units[kind]).scale)} {_pretty(units[kind])}"
    if kind != "gauss_markov":
        return f"{kind.replace('_', ' ')}  {strength}"
    return (
        f"Gauss-Markov  {_duration(time_s)}, {strength}"
        if time_s is not None
        else f"Gauss-Markov  {strength}"
    )


def noise_chart(sensor: Sensor, panels: Sequence[NoisePanel]) -> Chart:
    """Return the deviation of a sensor over averaging time, a panel an axis.

    Parameters
    ----------
    sensor : "gyro" or "accel".
    panels : from the top.
    """
    factor = 1.0 / parse_unit(AXIS_UNITS[sensor]).scale
    tau = _span([curve.averaging_time_s for panel in panels for curve in panel.curves])
    drawn: list[Panel] = []
    for panel in panels:
        limits = _heights(panel, factor)
        layers = [*_noise_layers(panel, factor), *([] if drawn else _clock(tau, limits))]
        label = f"{panel.title}: deviation, {_pretty(AXIS_UNITS[sensor])}"
        drawn.append(Panel(label, layers, "log", limits))
    return Chart(
        f"noise-{sensor}",
        f"{SENSOR_NAMES[sensor]}: noise over averaging time",
        _CURVES.format(misfit=100.0 * MISFIT),
        drawn,
        "averaging time, s",
        "log",
        limits=tau,
    )


def _clock(tau: tuple[float, float], limits: tuple[float, float]) -> Iterator[Layer]:
    """Yield minutes and hours in words along the top."""
    shown = {seconds: label for seconds, label in TIMES.items() if tau[0] < seconds < tau[1]}
    if shown:
        height = np.full(len(shown), limits[1] / (limits[1] / limits[0]) ** 0.12)
        yield Layer("labels", np.array([*shown]), height, ink="faint", texts=[*shown.values()])


def spectrum_charts(panels: Sequence[SpectrumPanel]) -> tuple[Chart, ...]:
    """Return spectra beside the noise models they are to be compared with, a chart a sensor.

    Parameters
    ----------
    panels : of all channels.
    """
    charts = []
    for sensor in dict.fromkeys(panel.sensor for panel in panels):
        unit = _pretty(f"{AXIS_UNITS[sensor]}/sqrt(Hz)")
        of_sensor = [panel for panel in panels if panel.sensor == sensor]
        inside = of_sensor[0].frequency_hz > 0.0
        f = of_sensor[0].frequency_hz[inside]
        charts.append(
            Chart(
                f"spectrum-{sensor}",
                f"{SENSOR_NAMES[sensor]}: spectrum in straight flight",
                _SPECTRUM,
                [_spectrum(panel, unit) for panel in of_sensor],
                "frequency, Hz",
                "log",
                limits=(float(f[0]), float(f[-1])),
            )
        )
    return tuple(charts)


def _noise_layers(panel: NoisePanel, factor: float) -> Iterator[Layer]:
    """Yield curves, model and processes of one panel."""
    several = len(panel.curves) > 1
    for k, (curve, label) in enumerate(zip(panel.curves, panel.labels, strict=True)):
        curve_label = f"{len(panel.curves)} recordings" if several else label
        yield from _curve(panel, curve, factor, label, curve_label if k == 0 else "")
    for name, variance in panel.parts.items():
        yield Layer(
            "line",
            panel.tau_s,
            factor * _deviation(variance),
            panel.part_labels[name],
            PART_INKS.get(name, "faint"),
            dashed=True,
        )
    if panel.modelled.size:
        curve_label = f"fitted sum, {panel.words}" if panel.words else "fitted sum"
        modelled = factor * _deviation(panel.modelled)
        yield Layer("line", panel.tau_s, modelled, curve_label, "ink", width=2.0)


def _curve(
    panel: NoisePanel, curve: WaveletVariance, factor: float, label: str, model_name: str
) -> Iterator[Layer]:
    """One recording: dots with their intervals.

    Grey where the fit left them out, ringed where the fit is clearly off.
    """
    several = len(panel.curves) > 1
    tau, deviation = curve.averaging_time_s, factor * _deviation(curve.variance)
    low, high = factor * _deviation(curve.low), factor * _deviation(curve.high)
    used = (
        np.ones(tau.size, dtype=bool)
        if panel.levels is None
        else np.isin(curve.level, panel.levels)
    )
    yield Layer("band", tau, low, "", "first", y2=high, faint=several)
    yield Layer("line", tau, deviation, "", "first", width=1.0, faint=True)
    texts = [
        f"{label}: {_number(level)} within {_number(lower)} and {_number(upper)}"
        for level, lower, upper in zip(deviation, low, high, strict=True)
    ]
    inks: tuple[tuple[NDArray[np.bool_], Ink, str], ...] = (
        (used, "first", model_name and f"{model_name}, 95 %"),
        (~used, "faint", model_name and "left out of the fit"),
    )
    for mask, ink, name in inks:
        if mask.any():
            kept = [text for text, shown in zip(texts, mask, strict=True) if shown]
            diameter = 4.0 if several else 6.0
            yield Layer(
                "points",
                tau[mask],
                deviation[mask],
                name,
                ink,
                texts=kept,
                width=diameter,
                faint=several,
            )
    if not several and panel.modelled.size:
        model = factor * np.exp(
            np.interp(np.log(tau), np.log(panel.tau_s), np.log(_deviation(panel.modelled)))
        )
        misfitted = (
            used & ((model < low) | (model > high)) & (np.abs(model / deviation - 1.0) > MISFIT)
        )
        if misfitted.any():
            name = f"fit off by more than {100 * MISFIT:g} %"
            yield Layer(
                "points", tau[misfitted], deviation[misfitted], name, "warn", mark="ring", width=8.0
            )


def _spectrum(panel: SpectrumPanel, unit: str) -> Panel:
    """Return the panel of measured and modelled densities, with the lines of propellers."""
    factor = 1.0 / parse_unit(AXIS_UNITS[panel.sensor]).scale
    inside = panel.frequency_hz > 0.0
    frequency, density = panel.frequency_hz[inside], factor * panel.density[inside]
    models = [(label, factor * model[inside]) for label, model in panel.models]
    shown = np.concatenate([density, *(model for _, model in models)])
    top = 1.8 * float(shown.max())
    layers = [Layer("line", frequency, density, "in straight flight", "first", width=1.1)]
    layers += [
        Layer("line", frequency, model, label, ink, width=2.0)
        for (label, model), ink in zip(models, MODEL_INKS, strict=False)
    ]
    lines = np.array(sorted(panel.lines_hz))
    if lines.size:
        nothing = np.zeros(0)
        layers.append(
            Layer("rules", lines, nothing, "lines (propellers)", "warn", width=1.0, dashed=True)
        )
        distinct = [
            index
            for index in range(lines.size)
            if index == 0 or lines[index] > 1.25 * lines[index - 1]
        ]
        labelled = lines[distinct]
        texts = [f"{frequency:.3g} Hz" for frequency in labelled]
        layers.append(
            Layer("labels", labelled, np.full(labelled.size, 0.8 * top), ink="warn", texts=texts)
        )
    lowest = 0.6 * float(shown[shown > 0.0].min())
    return Panel(f"{panel.title}: {unit}", layers, "log", (lowest, top))


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
    """Return seconds in the unit that suits them, "12 ms" or "3 h"."""
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
