"""Charts of what supports a run.

Innovations and their distribution, residuals, biases, constants, forward against backward.
"""

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from ...records import Diagnostics
from ...records.states import State
from ..marks import Marks
from ..rules.wording import DEG_H_PER_RAD_S, MG_PER_M_S2, NED_NAMES, state_unit
from ..statistics import NIS_95, residual_limit
from .chart import AXES_INKS, Array, Chart, Layer, Panel
from .pieces import band, dots, length_unit, line, median_limits, over_time, rules

_INNOVATIONS = (
    "Each fix minus its prediction; nearly all must lie within the shaded three standard "
    "deviations, without drift (values beyond the axis are drawn at its edge). Below, the NIS of "
    "each fix: one in twenty may exceed the dashed line; fixes above the full line were rejected."
)
_DISTRIBUTION = (
    "Used innovations over their standard deviations against the normal distribution that honest "
    "sigmas promise: a wider histogram says that the sigmas are too small, a narrower one that "
    "they are too large, a shifted one that an error is systematic."
)
_NIS = (
    "Squared innovations over their covariance (NIS) against chi-square with three degrees of "
    "freedom."
)
_RESIDUALS = (
    "Used fixes minus the smoothed solution, mean of each minute; shaded: the largest mean to "
    "expect if all sigmas are right. Beyond the shade the solution departs from its fixes."
)
_BIASES = (
    "Estimated biases within three standard deviations, after smoothing; a wide band says that the"
    " flight did not determine the bias."
)
_CONSTANTS_CAPTION = (
    "Constants that were estimated with the flight, lever arm and time offset as what has to be"
    " added to those of the flight file, within three standard deviations: dark, after"
    " smoothing; pale, what the forward filter allowed at the time. The pale band narrows where"
    " the flight determines the constant, mostly in turns and speed changes; what never narrows is"
    " not observed."
)
_SEPARATION = (
    "The flight filtered backward minus the same forward: where both are honest it stays within the"
    " shaded three standard deviations. The backward run knows the errors of the IMU from the later"
    " fixes alone, hence the width of its bands, which says nothing of the smoothed result. The"
    " scale is that of the middle of the flight."
)


def innovations(run: Diagnostics, marks: Marks) -> Chart:
    """Return innovations (north, east, down) and NIS over time, rejected fixes included."""
    t = marks.minutes(run.fix_time)
    usable = _usable_fixes(run)
    half_height = max(
        1.5 * float(np.quantile(np.abs(run.innovation[usable]), 0.98)),
        1.15 * float(np.quantile(3 * run.innovation_sigma[usable], 0.9)),
    )
    factor, unit = length_unit(half_height / 4)
    panels = [
        Panel(
            f"{name}, {unit}",
            (
                band(
                    t, np.zeros_like(t), 3 * factor * run.innovation_sigma[:, k], "3 sigma", "faint"
                ),
                *_points(t, factor * run.innovation[:, k], run.used),
            ),
            limits=(-1.03 * factor * half_height, 1.03 * factor * half_height),
        )
        for k, name in enumerate(NED_NAMES)
    ]
    low, high = 1e-2, 5.0 * max(run.nis_limit, NIS_95)
    nis = Panel(
        "NIS",
        (
            rules(run.nis_limit),
            rules(NIS_95, dashed=True),
            *_points(t, np.maximum(run.nis, low), run.used),
        ),
        scale="log",
        limits=(low, high),
    )
    title = "Whether the fixes agree with the prediction"
    return over_time("innovations", title, _INNOVATIONS, [*panels, nis], marks)


def _usable_fixes(run: Diagnostics) -> NDArray[np.bool_]:
    """Return the used fixes with an innovation; all with one where none was used."""
    finite = np.isfinite(run.innovation.sum(axis=1))
    return finite & run.used if (finite & run.used).any() else finite


def _points(t: Array, y: Array, used: NDArray[np.bool_]) -> Iterator[Layer]:
    yield dots(t[used], y[used], "fix")
    if not used.all():
        yield Layer("points", t[~used], y[~used], "rejected", "warn", mark="cross", width=7.0)


def distributions(run: Diagnostics) -> Iterator[Chart]:
    """Histograms of the normalised innovations and of NIS, with what honest sigmas promise."""
    usable = _usable_fixes(run)
    edges = np.linspace(-4.5, 4.5, 37)
    density_axis = np.linspace(-4.5, 4.5, 181)
    normal = np.exp(-0.5 * density_axis**2) / math.sqrt(2.0 * math.pi)
    ratio = run.innovation[usable] / run.innovation_sigma[usable]
    panels = [
        Panel(
            f"{name}, density",
            (
                Layer("steps", edges, _density(np.clip(x, -4.499, 4.499), edges), "fixes"),
                Layer("line", density_axis, normal, "expected", "second"),
            ),
        )
        for name, x in zip(NED_NAMES, ratio.T, strict=True)
    ]
    yield Chart(
        "innovation-distribution",
        "Whether the innovations are as large as their sigmas",
        _DISTRIBUTION,
        panels,
        "innovation over its sigma (the ends hold what lies beyond)",
        columns=3,
    )
    nis = run.nis[usable & np.isfinite(run.nis)]
    if nis.size:
        edges = np.geomspace(1e-2, max(100.0, 1.2 * run.nis_limit), 49)
        shown = np.log(np.clip(nis, edges[0] * 1.001, edges[-1] * 0.999))
        by_log = edges**1.5 * np.exp(-edges / 2.0) / math.sqrt(2.0 * math.pi)
        layers = (
            Layer("steps", edges, _density(shown, np.log(edges)), "fixes"),
            Layer("line", edges, by_log, "expected", "second"),
            Layer("rules", np.array([NIS_95]), np.zeros(0), "95 %", "ink", dashed=True),
            Layer("rules", np.array([run.nis_limit]), np.zeros(0), "gate", "ink"),
        )
        axes = Panel("density by ln NIS", layers)
        yield Chart("nis-distribution", "Distribution of NIS", _NIS, [axes], "NIS", scale="log")


def _density(x: Array, edges: Array) -> Array:
    return np.asarray(np.histogram(x, bins=edges, density=True)[0], dtype=np.float64)


def residuals(run: Diagnostics, marks: Marks) -> Chart:
    """Means of fixes minus solution, minute by minute; those beyond the limit stand out."""
    t = marks.minutes(np.array([0.5 * (minute.begin_s + minute.end_s) for minute in run.residuals]))
    mean, sigma = (
        np.array([getattr(minute, key) for minute in run.residuals])
        for key in ("mean_m", "sigma_m")
    )
    limit = residual_limit(mean.size)
    factor, unit = length_unit(float(np.median(limit * sigma)))
    panels = []
    for k, name in enumerate(NED_NAMES):
        offset, beyond = factor * mean[:, k], np.abs(mean[:, k]) > limit * sigma[:, k]
        layers = [band(t, np.zeros_like(t), factor * limit * sigma[:, k], "limit", "faint")]
        layers.append(Layer("points", t[~beyond], offset[~beyond], "mean", width=5.0))
        if beyond.any():
            layers.append(
                Layer(
                    "points", t[beyond], offset[beyond], "beyond", "warn", mark="cross", width=8.0
                )
            )
        panels.append(Panel(f"{name}, {unit}", layers))
    title = "Fixes minus solution, minute by minute"
    return over_time("residuals", title, _RESIDUALS, panels, marks)


def biases(run: Diagnostics, marks: Marks) -> Chart:
    """Gyro above accelerometer, the body's three axes in each."""
    t = marks.minutes(run.time)
    sensors = ((0, DEG_H_PER_RAD_S, "gyro, deg/h"), (3, MG_PER_M_S2, "accelerometer, mg"))
    panels = []
    for first, scale, label in sensors:
        bands, lines = [], []
        for row, axis in enumerate(("forward", "right", "down")):
            bias, sigma = scale * run.bias[:, first + row], scale * run.bias_sigma[:, first + row]
            bias = marks.broken(t, bias)
            bands.append(band(t, bias, 3 * sigma, ink=AXES_INKS[row]))
            lines.append(line(t, bias, axis, AXES_INKS[row]))
        panels.append(Panel(label, (*bands, *lines)))
    return over_time("biases", "Errors of the IMU", _BIASES, panels, marks)


def constants(run: Diagnostics, marks: Marks) -> Chart | None:
    """Lever arm, time offset, scale factors over time; None where no constant was estimated."""
    constants = run.constants
    if constants is None or not constants.states:
        return None
    t = marks.minutes(run.time)
    panels = []
    for label, members in _grouped_states(constants.states):
        factor, unit = state_unit(constants.states[members[0]])
        layers: list[Layer] = []
        for row, column in enumerate(members):
            ink = AXES_INKS[row % 3]
            value = marks.broken(t, factor * constants.value[:, column])
            layers.append(band(t, value, 3 * factor * constants.filter_sigma[:, column], ink=ink))
            layers.append(band(t, value, 3 * factor * constants.sigma[:, column], ink=ink))
            state = constants.states[column]
            name = str(state) if state.sensor else state.axis or "value"
            layers.append(line(t, value, name, ink))
        limits = _limits(
            factor * constants.value[:, members], 3 * factor * constants.filter_sigma[:, members]
        )
        panels.append(Panel(f"{label}, {unit}", layers, limits=limits))
    title = "Constants estimated in flight"
    return over_time("constants", title, _CONSTANTS_CAPTION, panels, marks)


def _grouped_states(states: Sequence[State]) -> list[tuple[str, list[int]]]:
    """Return constants that share a panel under one name: the three axes of one quantity."""
    groups: dict[str, list[int]] = {}
    for k, state in enumerate(states):
        groups.setdefault(f"{state.sensor} {state.group}".lstrip(), []).append(k)
    return list(groups.items())


def _limits(value: Array, bound: Array) -> tuple[float, float]:
    """Return limits that show the bands of the flight's second half and the values."""
    half = len(value) // 2
    low = min(float(value.min()), float((value - bound)[half:].min()))
    high = max(float(value.max()), float((value + bound)[half:].max()))
    pad = 0.5 * max(high - low, 1e-9)
    return low - pad, high + pad


def separation(run: Diagnostics, marks: Marks) -> Chart:
    """Position, tilt and heading, one above the other."""
    t = marks.minutes(run.separation_time)
    finite = run.separation_sigma[:, :3][np.isfinite(run.separation_sigma[:, :3])]
    factor, unit = length_unit(float(np.median(finite)) if finite.size else 0.0)
    rows = (
        ([0, 1, 2], factor, f"position, {unit}"),
        ([6, 7], math.degrees(1.0), "tilt, deg"),
        ([8], math.degrees(1.0), "heading, deg"),
    )
    panels = []
    for columns, scale, label in rows:
        bands, lines = [], []
        for k in columns:
            bound = 3 * scale * run.separation_sigma[:, k]
            bands.append(band(t, np.zeros_like(t), bound, ink=AXES_INKS[k % 3]))
            difference = marks.broken(t, scale * run.separation[:, k])
            lines.append(line(t, difference, NED_NAMES[k % 3], AXES_INKS[k % 3]))
        limits = median_limits(
            scale * run.separation[:, columns], 3 * scale * run.separation_sigma[:, columns]
        )
        panels.append(Panel(label, (*bands, *lines), limits=limits))
    return over_time("separation", "Forward against backward", _SEPARATION, panels, marks)
