"""index.html of a season: what failed and why, what drifts, every flight with its report."""

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

import numpy as np

from ...records import Array
from ...records.states import LEVER_ARM
from ...report.charts.chart import Axes, Chart, Ink, Layer
from ...report.markup import escape, folded, sentence, table
from ...report.verb_page import MOST_ROWS, VerbPage, listed
from .row import Row, is_number
from .trends import Trend
from .work import FAILED, KEPT, WAITING

MARK = '<meta name="generator" content="insgnss batch">'
"""In the page, by which the next run knows that it may overwrite it."""
INKS: tuple[Ink, ...] = ("first", "second", "third")
READING = (
    "Each point is what one flight by itself says of the constant, with one standard deviation up"
    " and down; the line is fitted by weights, dashed where it is no significant drift. The first"
    " day is that of the season's first flight."
)


@dataclass(frozen=True)
class SeasonPage:
    """What stands on the page of a season.

    Parameters
    ----------
    rows : sequence of dict
        Rows of the table, paths relative to the page.
    trends : sequence of Trend
        Of its equipments.
    headline : str
        The result in one sentence, without full stop.
    settings : sequence of (str, str)
        What was asked for.
    """

    rows: Sequence[Row]
    trends: Sequence[Trend]
    headline: str
    settings: Sequence[tuple[str, str]] = ()

    def mood(self) -> tuple[str, str]:
        """Return "good", "doubtful" or "bad", and why, without full stop."""
        broken = [row for row in self.rows if row["status"] == FAILED]
        if broken:
            names = _some([str(row["name"]) for row in broken])
            return "bad", f"{len(broken)} of {len(self.rows)} flights have no result: {names}"
        waiting = sum(row["status"] == WAITING for row in self.rows)
        if waiting:
            return "doubtful", f"{waiting} of {len(self.rows)} flights were not reached"
        bad = [str(r["name"]) for r in self.rows if r["judgement"] == "bad"]
        if bad:
            return "bad", f"the reports of {_some(bad)} contradict their results"
        odd = [trend for trend in self.trends if trend.odd]
        if odd:
            which = _some([f"{t.equipment or 'an equipment'} ({t.quantity.state})" for t in odd])
            return "doubtful", f"constants do not stay as they are: {which}"
        doubtful = [str(r["name"]) for r in self.rows if r["judgement"] == "doubtful"]
        if doubtful:
            return "doubtful", f"figures of {_some(doubtful)} leave what a good flight shows"
        return "good", "every flight has a result, and no constant of an equipment drifts"

    def html(self) -> Iterator[str]:
        """Yield the page piece by piece."""
        mood, why = self.mood()
        page = VerbPage(
            "Season",
            self.headline,
            mood,
            why,
            charts=tuple(charts(self.rows, self.trends)),
            first=(*self._first(), self._flights()),
            parts=(self._all_trends(),),
            settings=dict(self.settings),
        )
        for piece in page.html():
            yield piece.replace("<title>", f"{MARK}\n<title>", 1)

    def _first(self) -> Iterator[str]:
        """What one has to see: failed flights with their reasons, equipments that drift."""
        broken = [row for row in self.rows if row["status"] == FAILED]
        if broken:
            cells = [(escape(row["name"]), escape(sentence(str(row["reason"])))) for row in broken]
            made = table(cells, ("flight", "why it has no result"))
            yield f"<h2>Failed flights</h2>\n{made}"
        yield listed("What drifts", [trend.sentence() for trend in self.trends if trend.odd])

    def _flights(self) -> str:
        head = (
            *("flight", "equipment", "date (UTC)", "status", "images", "sigma E / N / U, mm"),
            *("tilt E / N, deg", "heading, deg", "NIS ratio", "what stands out"),
        )
        made = table([_cells(row) for row in self.rows], head)
        inside = (
            made if len(self.rows) <= 10 * MOST_ROWS else folded(f"{len(self.rows)} rows", made)
        )
        return f"<h2>Flights</h2>\n{inside}"

    def _all_trends(self) -> str:
        return listed("Constants over the season", [trend.sentence() for trend in self.trends])


def _some(names: Sequence[str], most: int = 3) -> str:
    """Return names, the first few of many."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return f"{', '.join(names[:most])}{more}"


def _cells(row: Row) -> tuple[str, ...]:
    """Return the cells of a flight, HTML, its name linked to its report."""
    name = escape(row["name"])
    if row.get("report"):
        target = quote(str(row["report"]).replace(os.sep, "/"))
        name = f'<a href="{escape(target)}">{name}</a>'
    judged = str(row.get("judgement") or "")
    mark = {"good": "ok", "doubtful": "note", "bad": "contradiction"}.get(judged, "note")
    status = str(row["status"]) if row["status"] in (FAILED, WAITING) else judged
    status += " (kept)" if row["status"] == KEPT else ""
    why = row.get("reason") if row["status"] not in (FAILED, WAITING) else ""
    positions = [row.get(f"sigma_{axis}_mm") for axis in "enu"]
    tilts = [row.get(f"sigma_att_{axis}_deg") for axis in "en"]
    return (
        name,
        escape(row.get("equipment") or ""),
        _whole(str(row.get("date_utc") or "").replace("T", " ").rstrip("Z")),
        f'<span class="{mark}">{escape(status)}</span>',
        escape("" if row.get("images") is None else f"{row['images']:.0f}"),
        _whole(" / ".join(f"{x:.1f}" for x in positions if is_number(x))),
        _whole(" / ".join(f"{x:.4f}" for x in tilts if is_number(x))),
        escape(_number(row.get("sigma_att_u_deg"), ".3f")),
        escape(_number(row.get("nis_ratio"), ".2f")),
        escape(why or row.get("limits") or ""),
    )


def _whole(text: str) -> str:
    """A cell that is not broken into lines."""
    return f'<span class="whole">{escape(text)}</span>'


def _number(value: object, form: str) -> str:
    return format(value, form) if is_number(value) else ""


def charts(rows: Sequence[Row], trends: Sequence[Trend]) -> Iterator[Chart]:
    """Yield the charts of a season: constants of each equipment, then sigmas of all flights.

    Parameters
    ----------
    rows : sequence of dict
        Rows of the table.
    trends : sequence of Trend
        Of its equipments.
    """
    groups: dict[tuple[str, str], list[Trend]] = {}
    for trend in trends:
        groups.setdefault((trend.equipment, trend.quantity.state.group), []).append(trend)
    for number, ((equipment, kind), own) in enumerate(groups.items(), 1):
        panels = [
            Axes(f"{t.quantity.state.axis or kind}, {t.quantity.unit}", list(_layers(t, ink)))
            for t, ink in zip(own, INKS, strict=False)
        ]
        of = f" of {equipment}" if equipment else ""
        # mounting.antenna_m counts from the camera, in its axes
        seen = " from the IMU, body axes," if kind == LEVER_ARM else ""
        title = f"{kind[0].upper()}{kind[1:]}{of}{seen} over the season"
        yield Chart(f"constants-{number}", title, READING, panels, "days since the first flight")
    yield from _sigmas(rows)


def _layers(trend: Trend, ink: Ink) -> Iterator[Layer]:
    """Values with their sigmas, and the line."""
    x, y, s = trend.days, trend.value, trend.sigma
    nan = np.full(x.size, np.nan)
    yield Layer(
        "line",
        np.column_stack([x, x, x]).ravel(),
        np.column_stack([y - s, y + s, nan]).ravel(),
        ink=ink,
        faint=True,
    )
    texts = [f"{name}: {v:.4g} ± {d:.2g}" for name, v, d in zip(trend.names, y, s, strict=True)]
    yield Layer("points", x, y, str(trend.quantity.state), ink, texts=texts, width=5.0)
    if np.isfinite(trend.slope):
        ends: Array = np.array([x.min(), x.max()])
        drifts = trend.finding == "drift"
        yield Layer(
            *("line", ends, trend.level + trend.slope * ends),
            name="drift" if drifts else "",
            ink="warn" if drifts else "ink",
            dashed=not drifts,
        )


def _sigmas(rows: Sequence[Row]) -> Iterator[Chart]:
    """Yield the median sigmas of the flights by their number."""
    number = np.arange(1.0, len(rows) + 1.0)
    names = [str(row["name"]) for row in rows]
    panels = []
    for label, columns, words in (
        ("sigma of position, mm", [f"sigma_{a}_mm" for a in "enu"], ("east", "north", "up")),
        ("of attitude, deg", [f"sigma_att_{a}_deg" for a in "enu"], ("about E", "about N", "up")),
    ):
        layers = []
        for column, word, ink in zip(columns, words, INKS, strict=True):
            y = np.array([r[column] if is_number(r.get(column)) else np.nan for r in rows])
            there = np.isfinite(y)
            texts = [name for name, finite in zip(names, there, strict=True) if finite]
            if there.any():
                layers.append(
                    Layer("points", number[there], y[there], word, ink, texts=texts, width=5.0)
                )
        if layers:
            panels.append(Axes(label, layers))
    if panels:
        reading = (
            "Median standard deviations of the images of each flight, in the order of the table;"
            " flights without images have none."
        )
        yield Chart("season-sigmas", "Sigmas of the flights", reading, panels, "flight, number")


def is_ours(path: Path) -> bool:
    """Tell whether a file is a page of a season."""
    try:
        with path.open(encoding="utf-8") as stream:
            return MARK in stream.read(2000)
    except (OSError, UnicodeDecodeError):
        return False
