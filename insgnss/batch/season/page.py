"""index.html of a season: what failed and why, what drifts, every flight with its report."""

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from urllib.parse import quote

import numpy as np

from ...base.wording import some
from ...records import Array
from ...records.states import LEVER_ARM
from ...report.charts.chart import Chart, Ink, Layer, Panel
from ...report.document import Document, Marked, Section, Table
from ...report.markup import sentence
from ...report.verdict import Verdict, worst_of
from .row import Row, is_number
from .trends import SeasonTrend
from .work import FAILED, JOB_KEPT, WAITING, is_changed

PAGE_MARK = '<meta name="generator" content="insgnss batch">'
"""In the page, by which the next run knows that it may overwrite it."""
TREND_INKS: tuple[Ink, ...] = ("first", "second", "third")
TREND_CAPTION = (
    "Each point is the constant determined from one flight; its bar is one standard deviation up "
    "and down. The line is a weighted fit, dashed where the drift is not significant. Days count "
    "from the season's first flight."
)


def season_document(
    rows: Sequence[Row],
    trends: Sequence[SeasonTrend],
    headline: str,
    settings: Mapping[str, str] = MappingProxyType({}),
    files: Sequence[Path] = (),
) -> Document:
    """Return what a season says.

    Parameters
    ----------
    rows : sequence of dict
        Rows of the table, paths relative to the page.
    trends : sequence of SeasonTrend
        Trends of its equipments.
    headline : str
        The result in one sentence, without full stop.
    settings : mapping
        What was asked for.
    files : sequence of Path
        What was written.
    """
    failed = [
        (row["name"], sentence(str(row["reason"]))) for row in rows if _has_status(row, FAILED)
    ]
    header: tuple[str, ...] = ("flight", "equipment", "date (UTC)", "status", "images")
    header += ("sigma E / N / U, mm", "tilt E / N, deg", "heading, deg", "NIS ratio")
    header += ("what stands out",)
    changed = [f"{r['name']}: {r['reason']}" for r in rows if is_changed(r)]
    drifts = [trend.sentence() for trend in trends if trend.odd]
    return Document(
        "Season",
        headline,
        _verdict(rows, trends),
        (
            Section("Failed flights", [Table(failed, ("flight", "why it has no result"))]),
            Section("What drifts", drifts),
            Section("Changed since they were processed", changed, "terminal"),
            Section("Flights", [Table(list(map(_cells, rows)), header)], "page"),
            *charts(rows, trends),
            Section("Constants over the season", [t.sentence() for t in trends], "page"),
        ),
        settings=settings,
        files=files,
    )


def page_html(document: Document) -> Iterator[str]:
    """Yield the page of a season piece by piece, with the mark by which it is known."""
    for piece in document.html():
        yield piece.replace("<title>", f"{PAGE_MARK}\n<title>", 1)


def _verdict(rows: Sequence[Row], trends: Sequence[SeasonTrend]) -> Verdict:
    """Return the verdict: flights without results first, then what their reports say."""
    names = {
        kind: [str(row["name"]) for row in rows if row[column] == kind]
        for column, kind in (
            ("status", FAILED),
            ("status", WAITING),
            ("judgement", "bad"),
            ("judgement", "doubtful"),
        )
    }
    contradicting = [
        f"{t.equipment or 'an equipment'} ({t.quantity.state})" for t in trends if t.odd
    ]
    failures = {
        f"{len(names[FAILED])} of {len(rows)} flights have no result": names[FAILED],
        "the reports of these flights contradict their results": names["bad"],
    }
    doubtful = {
        f"{len(names[WAITING])} of {len(rows)} flights were not reached": names[WAITING],
        "these constants of the equipment drift or scatter": contradicting,
        "some figures of these flights are worse than those of a good flight": names["doubtful"],
    }
    return worst_of(
        "every flight has a result, and no constant of the equipment drifts",
        *(
            [f"{text}: {some(of)}" for text, of in kind.items() if of]
            for kind in (doubtful, failures)
        ),
    )


def _has_status(row: Row, *status: str) -> bool:
    return row["status"] in status


def _cells(row: Row) -> tuple[str, ...]:
    """Return the cells of a flight, its name linked to its report."""
    judged = str(row.get("judgement") or "")
    mark = {"good": "ok", "doubtful": "note", "bad": "contradiction"}.get(judged, "note")
    status = str(row["status"]) if _has_status(row, FAILED, WAITING) else judged
    status += " (kept)" if _has_status(row, JOB_KEPT) else ""
    why = "" if _has_status(row, FAILED, WAITING) else row.get("reason")
    return (
        Marked(row["name"], link=quote(str(row.get("report") or "").replace(os.sep, "/"))),
        row.get("equipment") or "",
        Marked(str(row.get("date_utc") or "").replace("T", " ").rstrip("Z"), "whole"),
        Marked(status, mark),
        _numbers(row, ["images"], ".0f"),
        _numbers(row, [f"sigma_{axis}_mm" for axis in "enu"], ".1f"),
        _numbers(row, [f"sigma_att_{axis}_deg" for axis in "en"], ".4f"),
        _numbers(row, ["sigma_att_u_deg"], ".3f"),
        _numbers(row, ["nis_ratio"], ".2f"),
        why or row.get("limits") or "",
    )


def _numbers(row: Row, columns: Sequence[str], form: str) -> Marked:
    """Return a cell of numbers that is not broken into lines."""
    values = (row.get(column) for column in columns)
    return Marked(" / ".join(format(x, form) for x in values if is_number(x)), "whole")


def charts(rows: Sequence[Row], trends: Sequence[SeasonTrend]) -> Iterator[Chart]:
    """Yield the charts of a season: constants of each equipment, then sigmas of all flights.

    Parameters
    ----------
    rows : sequence of dict
        Rows of the table.
    trends : sequence of SeasonTrend
        Of its equipments.
    """
    groups: dict[tuple[str, str], list[SeasonTrend]] = {}
    for trend in trends:
        groups.setdefault((trend.equipment, trend.quantity.state.group), []).append(trend)
    for number, ((equipment, kind), members) in enumerate(groups.items(), 1):
        panels = [
            Panel(
                f"{t.quantity.state.axis or kind}, {t.quantity.unit}", list(_trend_layers(t, ink))
            )
            for t, ink in zip(members, TREND_INKS, strict=False)
        ]
        of = f" of {equipment}" if equipment else ""
        # mounting.antenna_m counts from the camera, in its axes
        source = " from the IMU, body axes," if kind == LEVER_ARM else ""
        title = f"{kind[0].upper()}{kind[1:]}{of}{source} over the season"
        yield Chart(
            f"constants-{number}", title, TREND_CAPTION, panels, "days since the first flight"
        )
    yield from _sigmas(rows)


def _trend_layers(trend: SeasonTrend, ink: Ink) -> Iterator[Layer]:
    """Yield the values of a trend with their sigmas, and its line."""
    days, values, sigmas = trend.days, trend.value, trend.sigma
    nan = np.full(days.size, np.nan)
    yield Layer(
        "line",
        np.column_stack([days, days, days]).ravel(),
        np.column_stack([values - sigmas, values + sigmas, nan]).ravel(),
        ink=ink,
        faint=True,
    )
    texts = [
        f"{name}: {value:.4g} ± {sigma:.2g}"
        for name, value, sigma in zip(trend.names, values, sigmas, strict=True)
    ]
    yield Layer("points", days, values, str(trend.quantity.state), ink, texts=texts, width=5.0)
    if np.isfinite(trend.slope):
        ends: Array = np.array([days.min(), days.max()])
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
    for label, columns, description in (
        ("sigma of position, mm", [f"sigma_{a}_mm" for a in "enu"], ("east", "north", "up")),
        ("of attitude, deg", [f"sigma_att_{a}_deg" for a in "enu"], ("about E", "about N", "up")),
    ):
        layers = []
        for column, word, ink in zip(columns, description, TREND_INKS, strict=True):
            y = np.array([r[column] if is_number(r.get(column)) else np.nan for r in rows])
            plotted = np.isfinite(y)
            texts = [name for name, finite in zip(names, plotted, strict=True) if finite]
            if plotted.any():
                layers.append(
                    Layer("points", number[plotted], y[plotted], word, ink, texts=texts, width=5.0)
                )
        if layers:
            panels.append(Panel(label, layers))
    if panels:
        reading = (
            "Median standard deviations of the images of each flight, in the order of the table; "
            "flights without images are missing."
        )
        yield Chart("season-sigmas", "Sigmas of the flights", reading, panels, "flight, number")


def is_ours(path: Path, mark: str = PAGE_MARK) -> bool:
    """Tell whether a file is a page of a season, or has another mark at its beginning."""
    try:
        with path.open(encoding="utf-8") as stream:
            return mark in stream.read(2000)
    except (OSError, UnicodeDecodeError):
        return False
