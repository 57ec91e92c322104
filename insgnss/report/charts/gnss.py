"""Charts of a GNSS solution: what was solved epoch by epoch, and what the receiver observed.

`series` holds what `gnss.quality` found, or what a file of fixes says itself (`fix_series`), arrays
by name; those that are not known are absent, and their panels with them:

    time : (n,) s.
    kind : (n,) index in CLASSES.
    satellites, ratio, age_s, pdop, hdop, distance_m, height_difference_m : (n,).
    separation_m, separation_sigma_m : (n, 3) north, east, down, backward minus forward.
    cn0 : C/N0, {band: (k,) dB-Hz} over cn0_time (k,) s.
    slip_time, slip_satellite : (s,) s and names.
    gaps : (g, 2) s, begin and end.
"""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...records import GnssFixes
from ...records.observations import OF_THE_SOLUTION
from ..marks import Marks
from ..rules.wording import NED_NAMES
from .chart import AXES_INKS, Array, Chart, Ink, Layer, Panel, Shade
from .pieces import band, dots, length_unit, line, rules

Series = Mapping[str, Any]
Minutes = Callable[[Any], Array]

CLASS_NAMES = (
    "fixed",
    "fixed, degraded",
    "float",
    "isolated float",
    "unsupported float",
    "SBAS",
    "DGPS",
    "single",
    "PPP",
)  # as gnss.covariance.CLASSES
CLASS_INKS: tuple[Ink, ...] = (
    *("ok", "fifth", "second", "warn", "ink"),
    *("fifth", "first", "fourth", "first"),
)
KIND_OF_QUALITY = (7, 0, 2, 5, 6, 7, 8)  # RTKLIB's 0 to 6; what is unknown counts as single
VALIDATED_CODES = (0, 1)  # of these classes those of a confirmed fix
RATE_WINDOW_S = 30.0  # of the share of fixes: shorter ones show single epochs (chosen)
MOST_RATIO, LEAST_RATIO = 1000.0, 0.9  # of the axis: RTKLIB cuts at 999.9, and writes 0 for none
MOST_SLIPS = 4000  # marks of a chart: more are one dark area, and slow to draw (chosen)
MOST_SATELLITES = 8  # satellites whose names stand beside their slips
BAND_INKS: tuple[Ink, ...] = ("first", "second", "third", "fourth", "fifth")

_STATEMENTS = {  # of what the series hold
    "kind": "Colours show the class of each epoch; the share of confirmed fixes is over 30 s.",
    "ratio": (
        "The ratio compares the second best integer ambiguities with the best. Above the dashed "
        "line a fix is accepted; with few satellites this proves little."
    ),
    "age_s": "Age is that of the base's observations.",
    "pdop": "PDOP says how well the geometry of the satellites determines a position.",
    "hdop": "HDOP is that of the horizontal position.",
    "distance_m": "Atmospheric errors grow with distance and height difference from the base.",
}
_SEPARATION_OF_PPK = (
    "The backward run minus the forward run, within three standard deviations of their "
    "difference. Runs with the same ambiguities agree far better; a step of decimetres is an "
    "incorrect ambiguity fix in one run."
)
_SIGNALS = (
    "Median C/N0 of all satellites by band: a drop on one band is interference or a cable, one on "
    "all bands an obstruction. Dots are cycle slips by satellite; many at one instant mean that "
    "the receiver lost lock. Shaded times have no observations."
)


def fix_series(fixes: GnssFixes) -> dict[str, Any]:
    """Return what the source of the fixes says of each of them; empty where it says nothing.

    Parameters
    ----------
    fixes : GnssFixes
        Those of a file, with what columns it had.
    """
    series: dict[str, Any] = {}
    if fixes.quality is not None:
        classified = np.clip(fixes.quality, 0, len(KIND_OF_QUALITY) - 1)
        series["kind"] = np.asarray(KIND_OF_QUALITY)[classified]
    for name in OF_THE_SOLUTION:
        value = getattr(fixes, name)
        if value is not None:
            series[name] = value
    return {"time": fixes.time, **series} if series else {}


def charts(series: Series, marks: Marks | None = None) -> Iterator[Chart]:
    """Charts for which the series hold something: the solution, and the signals.

    Parameters
    ----------
    marks : Marks or None
        Those of the flight that the charts are shown beside; time begins with it.
    """
    if "time" not in series or not len(series["time"]):
        return
    start = float(series["time"][0])
    label, limits = f"time after the start at TOW {start:.1f} s, min", None
    shades: list[Shade] = []

    def minutes(t: Any) -> Array:
        return (np.asarray(t, dtype=np.float64) - start) / 60.0

    if marks is not None:
        start, label, limits = marks.start, marks.label, marks.span
        shades = [shade for shade in marks.shades if shade.kind == "line"]
    gaps = minutes(np.reshape(series.get("gaps", ()), (-1, 2)))
    shades += [Shade(begin, end, "outage") for begin, end in gaps.tolist()]
    statements = {**_STATEMENTS, "separation_m": _SEPARATION_OF_PPK}
    reading = " ".join(text for name, text in statements.items() if name in series)
    reading = reading or "The satellites of each epoch."
    curves = (
        ("gnss-solution", "How the antenna positions were solved", reading, _solution_panels),
        ("gnss-signals", "What the receiver observed", _SIGNALS, _signal_panels),
    )
    for name, title, text, panels in curves:
        drawn = list(panels(series, minutes))
        if drawn:
            yield Chart(
                *(name, title, text, drawn, label), link="time", shades=tuple(shades), limits=limits
            )


def _solution_panels(series: Series, minutes: Minutes) -> Iterator[Panel]:
    """Yield the panels of satellites, ratio, age, DOP and separation that the series hold."""
    t = minutes(series["time"])
    kind = np.asarray(series.get("kind", np.zeros(t.size)), dtype=np.int64)
    classified = "kind" in series
    if "satellites" in series:
        count = np.asarray(series["satellites"], dtype=np.float64)
        yield Panel(
            "satellites",
            list(_by_class(t, count, kind, classified)),
            limits=(0.0, 1.15 * float(np.nanmax(count, initial=1.0))),
        )
    if classified:
        yield Panel("fixed, %", (line(t, _rate(t, kind), "fixed", "ok"),), limits=(-3.0, 103.0))
    if "ratio" in series:
        ratio = np.clip(np.asarray(series["ratio"], dtype=np.float64), LEAST_RATIO, MOST_RATIO)
        yield Panel(
            "ratio",
            (*_by_class(t, ratio, kind, classified), rules(3.0, dashed=True)),
            scale="log",
            limits=(LEAST_RATIO, 1.2 * MOST_RATIO),
        )
    for name, label in (("age_s", "age of the base's data, s"), ("pdop", "PDOP"), ("hdop", "HDOP")):
        if name in series and not (name == "hdop" and "pdop" in series):
            y = np.asarray(series[name], dtype=np.float64)
            yield Panel(label, list(_by_class(t, y, kind, classified)))
    if "separation_m" in series:
        yield _separation_panel(t, series)
    if "distance_m" in series:
        km = np.asarray(series["distance_m"]) / 1e3
        yield Panel("from the base, km", (line(t, km, "distance"),))
    if "height_difference_m" in series:
        above = np.asarray(series["height_difference_m"])
        yield Panel("above the base, m", (line(t, above, "height"),))


def _by_class(t: Array, y: Array, kind: NDArray[np.int64], classified: bool) -> Iterator[Layer]:
    """Yield the dots of each kind of fix, in its colour."""
    for k in np.unique(kind):
        rows = kind == k
        yield dots(
            t[rows],
            y[rows],
            CLASS_NAMES[k] if classified else "fix",
            CLASS_INKS[k] if classified else "first",
            width=2.6,
        )


def _rate(t: Array, kind: NDArray[np.int64]) -> Array:
    """Share of validated fixes within `RATE_WINDOW_S`, percent."""
    count = np.concatenate([[0.0], np.cumsum(np.isin(kind, VALIDATED_CODES))])
    half = RATE_WINDOW_S / 120.0
    begin_row, end_row = np.searchsorted(t, t - half), np.searchsorted(t, t + half, side="right")
    return np.asarray(100.0 * (count[end_row] - count[begin_row]) / (end_row - begin_row))


def _separation_panel(t: Array, series: Series) -> Panel:
    """Return backward minus forward positions over time with their three-sigma bands."""
    separation, sigma = np.asarray(series["separation_m"]), np.asarray(series["separation_sigma_m"])
    finite = np.isfinite(separation).all(axis=1)
    typical = float(np.median(sigma[finite])) if finite.any() else 1.0
    largest = 1.2 * float(np.quantile(np.abs(separation[finite]), 0.99)) if finite.any() else 0.0
    half_height = max(4.0 * typical, largest)
    factor, unit = length_unit(half_height / 4.0)
    layers = []
    for k in range(3):
        zero = np.zeros(int(finite.sum()))
        layers.append(band(t[finite], zero, 3.0 * factor * sigma[finite, k], ink=AXES_INKS[k]))
    layers += [
        line(t, factor * separation[:, k], NED_NAMES[k], AXES_INKS[k], width=1.0) for k in range(3)
    ]
    limits = (-1.05 * half_height * factor, 1.05 * half_height * factor)
    return Panel(f"backward - forward, {unit}", layers, limits=limits)


def _signal_panels(series: Series, minutes: Minutes) -> Iterator[Panel]:
    """Yield C/N0 of each frequency and the cycle slips of each satellite over time."""
    if len(series.get("cn0", ())):
        t = minutes(series["cn0_time"])
        yield Panel(
            "C/N0, dB-Hz",
            [
                line(t, np.asarray(level), name, BAND_INKS[k % 5], width=1.0)
                for k, (name, level) in enumerate(series["cn0"].items())
            ],
        )
    if len(series.get("slip_time", ())):
        satellites = list(series["slip_satellite"])
        row = {name: k for k, name in enumerate(sorted(set(satellites)))}
        thinned = slice(None, None, -(-len(satellites) // MOST_SLIPS))
        y = np.array([row[name] for name in satellites], dtype=np.float64)
        layer = Layer(
            *("points", minutes(series["slip_time"])[thinned], y[thinned], "cycle slips", "warn"),
            width=4.0,
            texts=satellites[thinned],
        )
        t = minutes(series["time"])
        step = -(-len(row) // MOST_SATELLITES)
        names, rows = [*row][::step], np.arange(0.0, len(row), step)
        label_time = np.full(rows.size, t[0] + 0.02 * (t[-1] - t[0]))
        labels = Layer("labels", label_time, rows, ink="faint", texts=names)
        yield Panel("satellite", (layer, labels), limits=(-1.0, float(len(row))))
