"""report.html, one page that needs nothing else: data and what draws them are in it.

It is for the person who has to trust the images.

The order is that of the questions: what accuracy, what limits it, where, image by image, line by
line, how it looks, what was checked and thrown away, from what it was made. Every text is escaped;
charts and the table of images are drawn by the page's own script.

The table of images is data of the page, one row an image, with flags for what is worth a look:

    {"prefix": "DJI_", "suffix": ".JPG", "names": ["0001", ...], "start": 205200.0, "near": 0.02,
     "flag_names": [...], "flags": "base64 of uint16, one bit a flag",
     "columns": [{"key": "time", "head": "TOW, s", "digits": 3, "bytes": 2, "steps": "base64"}]}

Before "time" stands the clock time, a column without data, which adds seconds to those of another:
{"key": "clock", "head": "CEST", "clock": 7182.0, "of": "time"}.
A column holds whole numbers of its last printed digit, little endian, in as few bytes as they
need; times and coordinates the differences from row to row, the offset of the first apart. Ten
thousand images take half a megabyte.
"""

import base64
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, tzinfo
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.files import atomic_write, json_ready, text_sha256
from ..geodesy.gpstime import DAY_S, calendar_from_gps
from ..records import Array, Diagnostics, ExteriorOrientation
from . import sections
from .charts.chart import Background, Chart
from .charts.encoded import pack_array
from .charts.run import charts, track_rows
from .coverage import outages, segments
from .document import Document, Section
from .flightlines import flight_lines, image_sigmas
from .rules.wording import local_zone
from .sections import made_from
from .verdict import run_verdict

FLAGS = (
    "in an outage",
    "before the first or after the last fix",
    "in a bridged gap of the IMU",
    "outside the lines",
    "largest position sigma",
    "largest attitude sigma",
    "position sigma over 3 times the median",
    "attitude sigma over 3 times the median",
)
STANDS_OUT = 3.0  # times the median: an image that stands out
UNKNOWN_LINE = 0  # number of an image outside the lines, which count from 1


def image_table(run: Diagnostics, eo: ExteriorOrientation, zone: tzinfo = UTC) -> dict[str, Any]:
    """Return the table of images, ready for JSON.

    Parameters
    ----------
    run : Diagnostics
        Of the run.
    eo : ExteriorOrientation
        Of at least one image.
    zone : tzinfo, optional
        Time zone of the clock times.
    """
    line = image_lines(run, eo)
    position, psi = image_sigmas(eo)
    columns = [
        _clock_column(eo, zone),
        _column("time", "TOW, s", eo.time, 3, tip="TOW", unit="s", running=True),
        _column("line", "line", line, 0, dash=UNKNOWN_LINE, tip="line"),
    ]
    if eo.rig is not None:
        cameras = ", ".join(f"{k} {name}" for k, name in enumerate(eo.rig.names, 1))
        title = f"camera of the rig: {cameras}"
        columns.append(_column("camera", "camera", eo.rig.number + 1, 0, tip="camera", title=title))
    for key, values in zip(("east", "north", "up"), eo.position_m.T, strict=True):
        title = f"{key} in the tangent plane of eo.json"
        columns.append(_column(key, f"{key[0].upper()}, m", values, 3, title=title, running=True))
    about = "of the attitude about "
    for key, sign, sigmas, unit, digits, of in (
        ("sigma", "σ", 1e3 * position, "mm", 1, ""),
        ("psi", "σψ", np.degrees(psi), "deg", 4, about),
    ):
        for axis, values in zip("ENU", sigmas.T, strict=True):
            tip, title = f"sigma {of}{axis}", f"standard deviation {of}{axis}"
            labels = f"{key} {axis}", f"{sign}{axis}, {unit}"
            columns.append(_column(*labels, values, digits, unit=unit, tip=tip, title=title))
    prefix, suffix, names = shortened(eo.images)
    steps = np.diff(np.unique(eo.time))  # two cameras of a rig may have one instant
    return {
        "prefix": prefix,
        "suffix": suffix,
        "names": names,
        "start": float(run.time[0]),
        # an image belongs to the instants that lie nearer to it than this, minutes
        "near": 0.6 * float(np.median(steps)) / 60.0 if steps.size else 0.02,
        "flag_names": FLAGS,
        "flags": base64.b64encode(flags(run, eo, line).astype("<u2").tobytes()).decode("ascii"),
        "columns": columns,
    }


def track(run: Diagnostics) -> dict[str, str]:
    """Return where the flight was at which minute, for the map to follow the charts."""
    rows = track_rows(run)
    return {
        "minutes": pack_array((run.time[rows] - run.time[0]) / 60.0),
        "east": pack_array(run.position[rows, 1]),
        "north": pack_array(run.position[rows, 0]),
    }


def image_lines(run: Diagnostics, eo: ExteriorOrientation) -> NDArray[np.int64]:
    """Return the number of the flight line of each image, 0 outside the lines."""
    line = np.zeros(len(eo.images), dtype=np.int64)
    for number, of in enumerate(flight_lines(run, eo), 1):
        line[of.image : of.next_image] = number
    return line


def flags(run: Diagnostics, eo: ExteriorOrientation, line: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return what is worth a look at each image, one bit for each of `FLAGS`."""
    position, psi = (np.sqrt((x**2).sum(axis=1)) for x in image_sigmas(eo))
    without = outages(run)
    gaps = np.array(run.gaps, dtype=np.float64).reshape(-1, 2)
    times = run.fix_time[run.used]
    findings = [
        _inside_spans(eo.time, without[:, 0], without.sum(axis=1)),
        _without_near_fix(eo.time, segments(run), times),
        _inside_spans(eo.time, gaps[:, 0], gaps.sum(axis=1)),
        (line == UNKNOWN_LINE) & bool((line != UNKNOWN_LINE).any()),
        _is_largest(position),
        _is_largest(psi),
        position > STANDS_OUT * np.median(position),
        psi > STANDS_OUT * np.median(psi),
    ]
    return sum(
        (is_so.astype(np.int64) << bit for bit, is_so in enumerate(findings)),
        start=np.zeros(line.size, dtype=np.int64),
    )


def _inside_spans(time: Array, begin: Array, end: Array) -> NDArray[np.bool_]:
    """Return which instants lie inside one of the spans, which follow each other."""
    if not begin.size:
        return np.zeros(time.size, dtype=np.bool_)
    k = np.searchsorted(begin, time) - 1
    return (k >= 0) & (time < end[np.maximum(k, 0)])


def _without_near_fix(time: Array, spans: Array, fixes: Array) -> NDArray[np.bool_]:
    """Return which instants have no used fix before or none behind them within their segment."""
    out = np.zeros(time.size, dtype=np.bool_)
    for start, end in spans:
        of_span = fixes[(fixes >= start) & (fixes <= end)]
        inside = (time >= start) & (time <= end)
        out |= inside & ((time < of_span[0]) | (time > of_span[-1]) if of_span.size else True)
    return out


def _is_largest(x: Array) -> NDArray[np.bool_]:
    """Return which value is the largest, where there are several to compare."""
    return (np.arange(x.size) == int(np.argmax(x))) & (x.size > 1)


def shortened(names: tuple[str, ...]) -> tuple[str, str, list[str]]:
    """Return what all names begin and end with, and what stands between."""
    prefix = _common(names) if len(names) > 1 else ""
    tails = [name[len(prefix) :] for name in names]
    suffix = _common([name[::-1] for name in tails])[::-1] if len(names) > 1 else ""
    return prefix, suffix, [name[: len(name) - len(suffix)] for name in tails]


def _common(names: Sequence[str]) -> str:
    """Return what all names begin with."""
    first, last = min(names), max(names)  # all others lie between them
    first_difference = next(
        (k for k, (a, b) in enumerate(zip(first, last, strict=False)) if a != b), None
    )
    return first[: min(len(first), len(last)) if first_difference is None else first_difference]


def _clock_column(eo: ExteriorOrientation, zone: tzinfo) -> dict[str, Any]:
    """Return the column of clock times, which the page makes of those of "time"."""
    tow = float(eo.time[0])
    local = calendar_from_gps(eo.gps_week, tow).astimezone(zone)
    of_day = 3600.0 * local.hour + 60.0 * local.minute + local.second + 1e-6 * local.microsecond
    name = f"{local:%Z}"
    clock_offset_s = round(of_day - tow, 3) % DAY_S
    return {"key": "clock", "head": name, "tip": name, "of": "time", "clock": clock_offset_s}


def _column(
    key: str, head: str, values: Any, digits: int, *, running: bool = False, **more: Any
) -> dict[str, Any]:
    """Return a column in units of its last printed digit.

    `running` ones hold differences from the row before.
    """
    x = np.asarray(values, dtype=np.float64)
    offset = float(np.round(x[0], digits)) if running else 0.0
    whole = np.clip(np.rint((x - offset) * 10.0**digits), -(2**31) + 1, 2**31 - 1)
    steps = np.diff(whole, prepend=0.0) if running else whole
    size = next(n for n in (1, 2, 4) if np.abs(steps).max(initial=0.0) < 2.0 ** (8 * n - 1))
    data = base64.b64encode(steps.astype(f"<i{size}").tobytes()).decode("ascii")
    column = {"key": key, "head": head, "digits": digits, "bytes": size, "steps": data}
    return column | more | ({"offset": offset, "differences": True} if running else {})


def write_report(
    path: str | Path,
    summary: Mapping[str, Any],
    diagnostics: Diagnostics,
    eo: ExteriorOrientation | None,
    series: Mapping[str, Any] | None = None,
    report_sha256: str = "",
    background: Background | None = None,
) -> Path:
    """Write the page, whole or not at all; returns where it is.

    Parameters
    ----------
    path : the file, or a directory that gets report.html.
    summary : of `summary.run_summary`.
    eo : None without a camera.
    series : what the source of the fixes says of each epoch, as `charts.gnss` takes it.
    report_sha256 : SHA-256 of the text of report.json of the same run, as `write_report_json`
        returns it.
    background : what the map shows below the flight.
    """
    path = Path(path)
    if path.is_dir():
        path = path / "report.html"
    shown = charts(diagnostics, eo, summary["standing"], series or None, background)
    data: dict[str, Any] = {"track": track(diagnostics)}
    if eo is not None and eo.images:
        data["images"] = image_table(diagnostics, eo, local_zone(summary))
    atomic_write(path, page(summary, shown, data, report_sha256))
    return path


def write_report_json(summary: Mapping[str, Any], path: str | Path) -> str:
    """Write `summary` to `path`, whole or not at all; returns the SHA-256 of the text."""
    import orjson

    form = orjson.OPT_INDENT_2 | orjson.OPT_APPEND_NEWLINE
    form |= orjson.OPT_SERIALIZE_NUMPY | orjson.OPT_NON_STR_KEYS
    text = orjson.dumps(summary, default=json_ready, option=form).decode()
    atomic_write(path, text)
    return text_sha256(text)


def page(
    summary: Mapping[str, Any],
    shown: Sequence[Chart],
    data: Mapping[str, Any] = MappingProxyType({}),
    report_sha256: str = "",
) -> Iterator[str]:
    """The HTML of the page, piece by piece.

    Parameters
    ----------
    shown : the charts.
    data : what the script needs besides by name: "images" and "track" of the table of images.
    report_sha256 : SHA-256 of the text of report.json.
    """
    document = run_document(summary, shown, with_images="images" in data)
    yield from document.html(tuple(made_from(summary)), data, report_sha256)


def run_document(
    summary: Mapping[str, Any],
    shown: Sequence[Chart] = (),
    with_images: bool = False,
    files: Sequence[Path] = (),
) -> Document:
    """Return the document of a run: what accuracy, what limits it, where, how it looks.

    Parameters
    ----------
    summary : of `summary.run_summary`, with its exports where there are any.
    shown : the charts.
    with_images : whether the page has data of the table of images.
    files : what was written.
    """
    name = summary["name"] or "flight"
    return Document(
        f"{name}: insgnss report",
        summary["headline"],
        run_verdict(summary)._replace(phrase="Why"),  # the headline begins with the phrase
        tuple(_sections(summary, shown, with_images)),
        files=files,
        heading=name,
        about=sections.about(summary),
    )


def _sections(
    s: Mapping[str, Any], shown: Sequence[Chart], with_images: bool
) -> Iterator[Section | Chart]:
    pending, moving = {chart.name: chart for chart in shown}, not s["standing"]

    def of(*names: str) -> Iterator[Chart]:
        return (pending.pop(name) for name in names if name in pending)

    yield sections.limits(s)
    notes = (note for export in s.get("exports", ()) for note in export["notes"])
    yield Section("Notes on the exports", tuple(dict.fromkeys(notes)))
    yield from of("map")
    if with_images:
        yield sections.images(s)
    yield sections.flight_lines(s)
    yield sections.earlier(s)
    yield sections.hidden_section(s)
    yield sections.settings(s)
    if moving:
        yield sections.fixes_by_line(s)
    yield sections.key_numbers(s)
    yield from of("motion", "sigmas", "image-sigmas")
    yield from of("innovations", "innovation-distribution", "nis-distribution")
    if moving:
        yield sections.innovations(s)
        yield from of("residuals")
        yield sections.residuals(s)
    yield from of("biases")
    yield sections.constants(s)
    yield from of("constants", "separation", "gnss-solution", "gnss-signals", *pending)
    if moving:
        yield from (sections.rejected_section(s), sections.gaps(s))
    yield from (sections.segments_and_stationary_periods(s), sections.checks(s))
